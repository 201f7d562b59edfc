//! Words and numbers of a glTF file's JSON.

use serde_json::{Map, Value};

/// What every object may hold and means nothing here.
const EVERYWHERE: [&str; 3] = ["name", "extras", "extensions"];

/// The words of each kind of object that are read, or change no picture. A kind is the place of its objects: the names of the keys on the
/// way, without numbers.
const KNOWN: &[(&str, &[&str])] = &[
    (
        "",
        &[
            "accessors",
            "animations",
            "asset",
            "buffers",
            "bufferViews",
            "cameras",
            "extensionsRequired",
            "extensionsUsed",
            "images",
            "materials",
            "meshes",
            "nodes",
            "samplers",
            "scene",
            "scenes",
            "skins",
            "textures",
        ],
    ),
    (
        "accessors",
        &["bufferView", "byteOffset", "componentType", "count", "max", "min", "normalized", "sparse", "type"],
    ),
    ("accessors.sparse", &["count", "indices", "values"]),
    ("buffers", &["byteLength", "uri"]),
    ("bufferViews", &["buffer", "byteLength", "byteOffset", "byteStride", "target"]),
    ("cameras", &["orthographic", "perspective", "type"]),
    ("cameras.orthographic", &["xmag", "ymag", "zfar", "znear"]),
    ("cameras.perspective", &["aspectRatio", "yfov", "zfar", "znear"]),
    ("images", &["bufferView", "mimeType", "uri"]),
    (
        "materials",
        &[
            "alphaCutoff",
            "alphaMode",
            "doubleSided",
            "emissiveFactor",
            "emissiveTexture",
            "normalTexture",
            "occlusionTexture",
            "pbrMetallicRoughness",
        ],
    ),
    (
        "materials.pbrMetallicRoughness",
        &["baseColorFactor", "baseColorTexture", "metallicFactor", "metallicRoughnessTexture", "roughnessFactor"],
    ),
    ("meshes", &["primitives", "weights"]),
    ("meshes.primitives", &["attributes", "indices", "material", "mode", "targets"]),
    ("nodes", &["camera", "children", "matrix", "mesh", "rotation", "scale", "skin", "translation", "weights"]),
    ("samplers", &["magFilter", "minFilter", "wrapS", "wrapT"]),
    ("scenes", &["nodes"]),
    ("skins", &["inverseBindMatrices", "joints", "skeleton"]),
    ("textures", &["sampler", "source"]),
];

/// The extensions that are read.
pub(super) const EXTENSIONS: &[&str] = &[
    "EXT_texture_webp",
    "KHR_lights_punctual",
    "KHR_materials_clearcoat",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

/// Words that aren't known, by the place of their object; and extensions that aren't read.
#[derive(Debug, Default)]
pub(super) struct Unknown {
    pub(super) words: Vec<String>,
    pub(super) extensions: Vec<String>,
}

impl Unknown {
    /// Finds them in a whole file.
    pub(super) fn of(root: &Value) -> Self {
        let mut found = Self::default();
        found.look_at(root, "");
        found
    }

    fn look_at(&mut self, value: &Value, place: &str) {
        match value {
            Value::Array(items) => items.iter().for_each(|item| self.look_at(item, place)),
            Value::Object(object) => {
                self.look_at_extensions(object);
                // Objects of other kinds have names of the file's own as keys, or belong to extensions.
                let Some((_, known)) = KNOWN.iter().find(|(kind, _)| *kind == place) else { return };
                for (key, value) in object {
                    let inner = if place.is_empty() { key.clone() } else { format!("{place}.{key}") };
                    if known.contains(&key.as_str()) {
                        self.look_at(value, &inner);
                    } else if !EVERYWHERE.contains(&key.as_str()) {
                        self.words.push(inner);
                    }
                }
            }
            _ => {}
        }
    }

    fn look_at_extensions(&mut self, object: &Map<String, Value>) {
        let Some(Value::Object(extensions)) = object.get("extensions") else { return };
        let unread = extensions.keys().filter(|name| !EXTENSIONS.contains(&name.as_str()));
        self.extensions.extend(unread.cloned());
    }
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
