//! Words and numbers of a glTF file's JSON.

use serde_json::{Map, Value};

/// The words of each kind of object that are read, or change no picture, each with what it holds: `object`, `objects`, `index`, `indices`,
/// `flag`, `text` and `texts` (of these alone, after `=`), `code` (likewise), so many numbers (from `=` one to another), `*` of any number
/// of them, `any`. A kind is the place of its objects: the names of the keys on the way, without numbers, or its extension. The word `*`
/// stands for names of the file's own.
const WORDS: &[(&str, &str)] = &[
    (
        "",
        "accessors:objects animations:objects asset:object buffers:objects bufferViews:objects cameras:objects extensionsRequired:texts \
         extensionsUsed:texts images:objects materials:objects meshes:objects nodes:objects samplers:objects scene:index scenes:objects \
         skins:objects textures:objects",
    ),
    (
        "accessors",
        "bufferView:index byteOffset:index componentType:code=5120|5121|5122|5123|5125|5126 count:index max:any min:any normalized:flag \
         sparse:object type:text=SCALAR|VEC2|VEC3|VEC4|MAT2|MAT3|MAT4",
    ),
    ("accessors.sparse", "count:index indices:object values:object"),
    ("accessors.sparse.indices", "bufferView:index byteOffset:index componentType:code=5121|5123|5125"),
    ("accessors.sparse.values", "bufferView:index byteOffset:index"),
    ("animations", "channels:objects samplers:objects"),
    ("animations.channels", "sampler:index target:object"),
    ("animations.channels.target", "node:index path:text=translation|rotation|scale|weights|pointer"),
    ("animations.samplers", "input:index interpolation:text=LINEAR|STEP|CUBICSPLINE output:index"),
    ("asset", "copyright:text generator:text minVersion:text version:text"),
    ("buffers", "byteLength:index uri:text"),
    ("bufferViews", "buffer:index byteLength:index byteOffset:index byteStride:index target:code=34962|34963"),
    ("cameras", "orthographic:object perspective:object type:text"),
    ("cameras.orthographic", "xmag:1 ymag:1 zfar:1=0| znear:1=0|"),
    ("cameras.perspective", "aspectRatio:1=0.01|100 yfov:1=0.001|3.14 zfar:1=0| znear:1=0|"),
    ("images", "bufferView:index mimeType:text uri:text"),
    (
        "materials",
        "alphaCutoff:1=0| alphaMode:text=OPAQUE|MASK|BLEND doubleSided:flag emissiveFactor:3=0| emissiveTexture:object \
         normalTexture:object occlusionTexture:object pbrMetallicRoughness:object",
    ),
    (
        "materials.pbrMetallicRoughness",
        "baseColorFactor:4=0|1 baseColorTexture:object metallicFactor:1=0|1 metallicRoughnessTexture:object roughnessFactor:1=0|1",
    ),
    ("meshes", "primitives:objects weights:*"),
    ("meshes.primitives", "attributes:object indices:index material:index mode:code=0|1|2|3|4|5|6 targets:objects"),
    ("meshes.primitives.attributes", "*:index"),
    ("meshes.primitives.targets", "*:index"),
    (
        "nodes",
        "camera:index children:indices matrix:16 mesh:index rotation:4 scale:3 skin:index translation:3 weights:*",
    ),
    (
        "samplers",
        "magFilter:code=9728|9729 minFilter:code=9728|9729|9984|9985|9986|9987 wrapS:code=10497|33071|33648 \
         wrapT:code=10497|33071|33648",
    ),
    ("scenes", "nodes:indices"),
    ("skins", "inverseBindMatrices:index joints:indices skeleton:index"),
    ("texture", "index:index scale:1 strength:1=0|1 texCoord:index"),
    ("textures", "sampler:index source:index"),
    ("EXT_meshopt_compression", MESHOPT),
    ("EXT_mesh_gpu_instancing", "attributes:object"),
    ("EXT_mesh_gpu_instancing.attributes", "*:index"),
    ("EXT_texture_webp", "source:index"),
    ("KHR_animation_pointer", "pointer:text"),
    ("KHR_draco_mesh_compression", "attributes:object bufferView:index"),
    ("KHR_draco_mesh_compression.attributes", "*:index"),
    ("KHR_lights_punctual", "light:index lights:objects"),
    ("KHR_lights_punctual.lights", "color:3=0| intensity:1=0| range:1=0| spot:object type:text"),
    ("KHR_lights_punctual.lights.spot", "innerConeAngle:1=0|1.5708 outerConeAngle:1=0|1.5708"),
    ("KHR_materials_anisotropy", "anisotropyRotation:1 anisotropyStrength:1=0|1 anisotropyTexture:object"),
    (
        "KHR_materials_clearcoat",
        "clearcoatFactor:1=0|1 clearcoatNormalTexture:object clearcoatRoughnessFactor:1=0|1 clearcoatRoughnessTexture:object \
         clearcoatTexture:object",
    ),
    (
        "KHR_materials_diffuse_transmission",
        "diffuseTransmissionColorFactor:3=0|1 diffuseTransmissionColorTexture:object diffuseTransmissionFactor:1=0|1 \
         diffuseTransmissionTexture:object",
    ),
    ("KHR_materials_dispersion", "dispersion:1=0|"),
    ("KHR_materials_emissive_strength", "emissiveStrength:1=0|"),
    ("KHR_materials_ior", "ior:1=0|"),
    (
        "KHR_materials_iridescence",
        "iridescenceFactor:1=0|1 iridescenceIor:1=1| iridescenceTexture:object iridescenceThicknessMaximum:1=0| \
         iridescenceThicknessMinimum:1=0| iridescenceThicknessTexture:object",
    ),
    (
        "KHR_materials_pbrSpecularGlossiness",
        "diffuseFactor:4=0|1 diffuseTexture:object glossinessFactor:1=0|1 specularFactor:3=0|1 specularGlossinessTexture:object",
    ),
    (
        "KHR_materials_sheen",
        "sheenColorFactor:3=0|1 sheenColorTexture:object sheenRoughnessFactor:1=0|1 sheenRoughnessTexture:object",
    ),
    (
        "KHR_materials_specular",
        "specularColorFactor:3=0| specularColorTexture:object specularFactor:1=0|1 specularTexture:object",
    ),
    ("KHR_materials_transmission", "transmissionFactor:1=0|1 transmissionTexture:object"),
    ("KHR_materials_unlit", ""),
    (
        "KHR_materials_volume",
        "attenuationColor:3=0|1 attenuationDistance:1=0| thicknessFactor:1=0| thicknessTexture:object",
    ),
    ("KHR_materials_variants", "mappings:objects variants:objects"),
    ("KHR_materials_variants.mappings", "material:index variants:indices"),
    ("KHR_materials_variants.variants", ""),
    ("KHR_mesh_quantization", ""),
    ("KHR_meshopt_compression", MESHOPT),
    ("KHR_node_visibility", "visible:flag"),
    ("KHR_texture_basisu", "source:index"),
    ("KHR_texture_transform", "offset:2 rotation:1 scale:2 texCoord:index"),
];

/// The words of buffers packed by meshoptimizer.
const MESHOPT: &str = "buffer:index byteLength:index byteOffset:index byteStride:index count:index fallback:flag \
     filter:text=NONE|OCTAHEDRAL|QUATERNION|EXPONENTIAL|COLOR mode:text=ATTRIBUTES|TRIANGLES|INDICES";

/// Whether an extension is read.
pub(super) fn is_read(extension: &str) -> bool {
    extension.contains('_') && WORDS.iter().any(|(place, _)| *place == extension)
}

/// How a value fits its word.
enum Fit {
    Sound,
    Near(Value),
    Wrong,
}

/// What of a file isn't known, or isn't what its word holds, by the place of its object.
#[derive(Debug, Default)]
pub(super) struct Left {
    pub(super) words: Vec<String>,
    pub(super) wrong: Vec<String>,
    pub(super) near: Vec<String>,
    pub(super) extensions: Vec<String>,
}

impl Left {
    /// Takes it out of a whole file, and moves numbers into the range of their words.
    pub(super) fn out_of(root: &mut Value) -> Self {
        let mut left = Self::default();
        left.look_at(root, "");
        left
    }

    /// Adds what was taken out of it later.
    pub(super) fn append(&mut self, later: Self) {
        self.words.extend(later.words);
        self.wrong.extend(later.wrong);
        self.near.extend(later.near);
        self.extensions.extend(later.extensions);
    }

    fn look_at(&mut self, value: &mut Value, place: &str) {
        match value {
            Value::Array(items) => items.iter_mut().for_each(|item| self.look_at(item, place)),
            Value::Object(object) => {
                if let Some(Value::Object(extensions)) = object.get_mut("extensions") {
                    self.look_at_extensions(extensions);
                }
                // Objects of other kinds belong to extensions that aren't read.
                let Some((_, words)) = WORDS.iter().find(|(kind, _)| *kind == place) else { return };
                object.retain(|key, value| self.keeps(key, value, (place, words)));
            }
            _ => {}
        }
    }

    fn keeps(&mut self, key: &str, value: &mut Value, (place, words): (&str, &str)) -> bool {
        let inner = if place.is_empty() { key.to_owned() } else { format!("{place}.{key}") };
        let holds =
            |word: &str| words.split_ascii_whitespace().find_map(|w| w.split_once(':').filter(|(w, _)| *w == word));
        let holds = match key {
            "extras" => "any",
            "name" => "text",
            "extensions" => "object",
            _ => match holds(key).or_else(|| holds("*")) {
                Some((_, holds)) => holds,
                None => {
                    self.words.push(inner);
                    return false;
                }
            },
        };
        match fit(value, holds) {
            Fit::Sound => {}
            Fit::Near(near) => {
                *value = near;
                self.near.push(inner.clone());
            }
            Fit::Wrong => {
                self.wrong.push(inner);
                return false;
            }
        }
        if !matches!(key, "extras" | "extensions") {
            self.look_at(value, if key.ends_with("Texture") { "texture" } else { &inner });
        }
        true
    }

    fn look_at_extensions(&mut self, extensions: &mut Map<String, Value>) {
        extensions.retain(|name, value| {
            match (is_read(name), value.is_object()) {
                (true, true) => self.look_at(value, name),
                (true, false) => self.wrong.push(name.clone()),
                (false, _) => self.extensions.push(name.clone()),
            }
            value.is_object()
        });
    }
}

/// Returns whether a value is what its word holds.
fn fit(value: &Value, holds: &str) -> Fit {
    let (holds, of) = holds.split_once('=').unwrap_or((holds, ""));
    let is_of = |word: &str| of.is_empty() || of.split('|').any(|known| known == word);
    let all = |is: fn(&Value) -> bool| value.as_array().is_some_and(|list| list.iter().all(is));
    let is_sound = match holds {
        "any" => true,
        "object" => value.is_object(),
        "objects" => all(Value::is_object),
        "index" => value.is_u64(),
        "indices" => all(Value::is_u64),
        "flag" => value.is_boolean(),
        "text" => value.as_str().is_some_and(is_of),
        "texts" => all(Value::is_string),
        "code" => value.as_u64().is_some_and(|code| is_of(&code.to_string())),
        _ => return fit_numbers(value, holds, of),
    };
    if is_sound { Fit::Sound } else { Fit::Wrong }
}

/// Returns whether a value is so many numbers in a range; one that is missing has no end.
fn fit_numbers(value: &Value, count: &str, range: &str) -> Fit {
    let list = match value {
        Value::Array(list) if count != "1" => list.as_slice(),
        Value::Number(_) if count == "1" => std::slice::from_ref(value),
        _ => return Fit::Wrong,
    };
    let numbers: Vec<f64> = list.iter().filter_map(Value::as_f64).collect();
    if numbers.len() != list.len() || count.parse().is_ok_and(|n: usize| n != list.len()) {
        return Fit::Wrong;
    }
    let (least, most) = range.split_once('|').unwrap_or_default();
    let least = least.parse().unwrap_or(f64::NEG_INFINITY);
    let most = most.parse().unwrap_or(f64::INFINITY);
    if numbers.iter().all(|v| (least..=most).contains(v)) {
        return Fit::Sound;
    }
    let near: Vec<Value> = numbers.iter().map(|v| Value::from(v.clamp(least, most))).collect();
    Fit::Near(if count == "1" { near.into_iter().next().unwrap_or_default() } else { Value::Array(near) })
}

pub(super) fn list<'a>(value: &'a Value, key: &str) -> &'a [Value] {
    value.get(key).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

pub(super) fn index(value: &Value, key: &str) -> Option<usize> {
    value.get(key)?.as_u64().and_then(|n| usize::try_from(n).ok())
}

pub(super) fn number(value: &Value, key: &str) -> Option<f64> {
    value.get(key)?.as_f64()
}

pub(super) fn number_or(value: Option<&Value>, key: &str, default: f64) -> f64 {
    value.and_then(|value| number(value, key)).unwrap_or(default)
}

pub(super) fn numbers<const N: usize>(value: &Value, key: &str) -> Option<[f64; N]> {
    let list = value.get(key)?.as_array()?;
    let numbers: Vec<f64> = list.iter().filter_map(Value::as_f64).collect();
    numbers.try_into().ok()
}

pub(super) fn extension<'a>(value: &'a Value, name: &str) -> Option<&'a Value> {
    value.get("extensions")?.get(name)
}
