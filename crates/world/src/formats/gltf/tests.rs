use base64::prelude::BASE64_STANDARD;
use glam::Vec3;

use super::*;
use crate::{Ray, World};

/// A triangle 5 m before a camera, red, in two files that differ in how much they promise.
fn file(count: &str, indices: usize) -> String {
    let floats = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].into_iter().flat_map(f32::to_le_bytes);
    let bytes: Vec<u8> = floats.chain([0, 0, 1, 0, 2, 0]).collect();
    let base64 = BASE64_STANDARD.encode(bytes);
    format!(
        r#"{{"asset":{{"version":"2.0"}},"extensionsUsed":["KHR_lights_punctual"],
        "extensions":{{"KHR_lights_punctual":{{"lights":[{{"type":"point","intensity":683}}]}}}},
        "scene":0,"scenes":[{{"nodes":[0,1]}}],
        "nodes":[{{"mesh":0,"translation":[0,0,-3]}},
                 {{"camera":0,"translation":[0,0,2],"extensions":{{"KHR_lights_punctual":{{"light":0}}}}}}],
        "cameras":[{{"type":"perspective","perspective":{{"yfov":0.5,"znear":0.1,"aspectRatio":2}}}}],
        "materials":[{{"name":"red","pbrMetallicRoughness":{{"baseColorFactor":[1,0,0,1],"metallicFactor":0}},
                       "emissiveFactor":[0,0,1]}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1,"material":0}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":{count},"type":"VEC3","min":[0,0,0],"max":[1,1,0]}},
                     {{"bufferView":1,"componentType":5123,"count":{indices},"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}},{{"buffer":0,"byteOffset":36,"byteLength":6}}],
        "buffers":[{{"byteLength":42,"uri":"data:application/octet-stream;base64,{base64}"}}]}}"#
    )
}

fn read_text(text: &str) -> Result<World, WorldError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("world.gltf");
    std::fs::write(&path, text).unwrap();
    crate::read_world(&path, &crate::ReadOptions::default(), &Cancel::new())
}

fn seen(world: &World, [x, y]: [f32; 2]) -> crate::Hit {
    let ray = Ray { origin: Vec3::new(x, y, 2.0), direction: Vec3::NEG_Z };
    world.intersect(&ray, f32::INFINITY).expect("a surface ahead")
}

#[test]
fn triangle_camera_and_light_are_read() {
    let world = read_text(&file("3", 3)).unwrap();
    let camera = &world.cameras()[0];
    assert_eq!(camera.resolution, (960, 480));
    let forwards = camera.world_from_camera.transform_vector3(DVec3::Z).as_vec3();
    let origin = camera.world_from_camera.translation.as_vec3() + Vec3::new(0.2, 0.2, 0.0);
    let hit = world.intersect(&Ray { origin, direction: forwards }, f32::INFINITY).unwrap();
    // One rounding of an f32.
    assert!((hit.distance_m - 5.0).abs() <= 5.0 * f32::EPSILON, "{}", hit.distance_m);
    let albedo = world.bsdf(&hit, -forwards, &[450.0, 650.0]).albedo();
    assert!(albedo[1] > 0.6 && albedo[0] < 0.2, "{albedo:?}");
    assert!(world.emission(&hit, -forwards, &[450.0])[0] > 0.1);
    assert_eq!(world.n_lights(), 2);
}

#[test]
fn ranges_beyond_a_buffer_are_refused() {
    assert!(read_text(&file("3", 4)).unwrap_err().to_string().contains("accessor 1"));
    assert!(read_text(&file("4000000000", 3)).unwrap_err().to_string().contains("accessor 0"));
    let no_accessor = file("3", 3).replace("\"POSITION\":0", "\"POSITION\":9");
    assert!(read_text(&no_accessor).unwrap_err().to_string().contains("accessor 9 is named, of which there are 2"));
    assert!(read_text("{}").unwrap_err().to_string().contains("expected 2.0"));
    assert!(read_text("{\n\"asset\": }").unwrap_err().to_string().contains("line 2"));
    let draco = file("3", 3).replace("\"scene\":0", r#""scene":0,"extensionsRequired":["KHR_draco_mesh_compression"]"#);
    assert!(read_text(&draco).unwrap_err().to_string().contains("KHR_draco_mesh_compression"));
}

#[test]
fn unknown_words_are_noted_once() {
    let text = file("3", 3).replace("\"material\":0}", "\"material\":0,\"colour\":1}");
    let text = text.replace("\"name\":\"red\"", r#""name":"red","shine":3,"extensions":{"VENDOR_shine":{}}"#);
    let notes = read_text(&text).unwrap().notes().join("\n");
    assert!(notes.contains("materials.shine") && notes.contains("meshes.primitives.colour"), "{notes}");
    assert!(notes.contains("VENDOR_shine"), "{notes}");
}

/// The words of a file that change no picture aren't told.
#[test]
fn a_plain_file_has_nothing_to_tell() {
    let plain = file("3", 3).replace("\"emissiveFactor\":[0,0,1]", "\"extras\":{\"x\":1}");
    assert_eq!(read_text(&plain).unwrap().notes(), [""; 0]);
}

fn strip(mode: u64, n: u32) -> Vec<[u32; 3]> {
    let indices: Vec<u32> = (0..n).collect();
    meshes::triangles(mode, &indices)
}

/// GLB whose JSON isn't padded to whole words, as some writers leave it, and a file of points alone, which says so.
#[test]
fn parts_without_padding_are_read() {
    let json = file("3", 3).replace("\"emissiveFactor\"", "\"extras\":{},\"emissiveFactor\"");
    for padding in ["", " ", "  ", "   "] {
        let json = format!("{json}{padding}");
        let mut glb = b"glTF\x02\0\0\0".to_vec();
        glb.extend((20 + json.len() as u32 + 8 + 2).to_le_bytes());
        glb.extend((json.len() as u32).to_le_bytes());
        glb.extend(b"JSON");
        glb.extend(json.as_bytes());
        glb.extend([2, 0, 0, 0]);
        glb.extend(b"BIN\0ab");
        let (text, binary) = parts(&glb).unwrap();
        assert_eq!((text.len(), binary), (json.len(), Some(&b"ab"[..])));
    }
    let points = file("3", 3).replace("\"material\":0}", "\"material\":0,\"mode\":0}");
    let notes = read_text(&points).unwrap().notes().join("\n");
    assert!(notes.contains("no area") && notes.contains("nothing in the file"), "{notes}");
}

#[test]
fn strips_and_fans_are_triangles() {
    assert_eq!(strip(5, 5), [[0, 1, 2], [2, 1, 3], [2, 3, 4]]);
    assert_eq!(strip(6, 5), [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
    assert_eq!(strip(4, 7), [[0, 1, 2], [3, 4, 5]]);
}

#[test]
fn escapes_of_names_are_undone() {
    assert_eq!(unescaped("a%20b%C3%BC%zz.png"), "a bü%zz.png");
}

/// Inputs that went wrong, each with the value that is right.
mod shared {
    use std::path::Path;

    use super::*;

    fn read(name: &str) -> World {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/inputs/world").join(name);
        crate::read_world(&path, &crate::ReadOptions::default(), &Cancel::new()).unwrap_or_else(|e| panic!("{e}"))
    }

    fn albedo(world: &World, at: [f32; 2]) -> [f32; 3] {
        world.bsdf(&seen(world, at), Vec3::Z, &[450.0, 550.0, 640.0]).albedo()
    }

    /// Whether a color is red, green, blue or yellow, as the fields of `quad.png`.
    fn color([blue, green, red]: [f32; 3]) -> &'static str {
        match [blue, green, red].map(|v| v > 0.5) {
            [false, false, true] => "red",
            [false, true, false] => "green",
            [true, false, false] => "blue",
            [false, true, true] => "yellow",
            _ => "another",
        }
    }

    fn fields(world: &World) -> [&'static str; 4] {
        [[-0.5, 0.5], [0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]].map(|at| color(albedo(world, at)))
    }

    #[dioptric_golden::needs_shared]
    #[test]
    fn pictures_lie_where_the_file_says() {
        let quad = ["red", "green", "blue", "yellow"];
        assert_eq!(fields(&read("01_glb_embedded.glb")), quad);
        // The second coordinates see a corner of the picture.
        assert_eq!(fields(&read("05_texcoord1.gltf")), ["red"; 4]);
        // Beyond its edges a clamped picture goes on with the colors there.
        let clamped = read("19_wrap_clamp3.gltf");
        assert_eq!(fields(&clamped), quad);
        assert_eq!([[-0.95, 0.95], [0.95, -0.95]].map(|at| color(albedo(&clamped, at))), ["red", "yellow"]);
    }

    #[dioptric_golden::needs_shared]
    #[test]
    fn glow_follows_its_picture() {
        let world = read("02_emissive_texture.gltf");
        let glow = |x: f32| world.emission(&seen(&world, [x, 0.3]), Vec3::Z, &[550.0])[0];
        let (one, other) = (glow(-0.5), glow(0.5));
        assert!(one.min(other) < 1e-3 && one.max(other) > 0.5, "{one} {other}");
        // Lights that are drawn have the same radiance as those that are met.
        let mut found = [0, 0];
        for i in 0..256 {
            let u = [(i % 16) as f32 / 16.0 + 0.03, (i / 16) as f32 / 16.0 + 0.03];
            let Some(light) = world.sample_light(Vec3::new(0.0, 0.0, 1.0), 0.5, u, &[550.0]) else { continue };
            let at = Vec3::Z + light.distance_m * light.direction;
            let met = world.emission(&seen(&world, [at.x, at.y]), Vec3::Z, &[550.0])[0];
            assert!((light.radiance[0] - met).abs() < 1e-3, "{} {met} at {at}", light.radiance[0]);
            found[usize::from(met > 0.5)] += 1;
        }
        assert!(found.iter().all(|n| *n > 50), "{found:?}");
    }

    /// Roughness in green, metal in blue: the plastic half reflects its base, and is no mirror.
    #[dioptric_golden::needs_shared]
    #[test]
    fn metal_and_roughness_follow_their_picture() {
        let world = read("08_metal_texture.gltf");
        let mirrors = |x: f32| {
            let bsdf = world.bsdf(&seen(&world, [x, 0.3]), Vec3::Z, &[550.0]);
            // Far from the mirror direction only a diffuse base gives light back.
            let aside = Vec3::new(0.9, 0.0, 0.435_89);
            std::f32::consts::PI * bsdf.eval(aside)[0] / aside.z
        };
        let (left, right) = (mirrors(-0.5), mirrors(0.5));
        // White plastic on the left, rough metal on the right.
        assert!(left > 0.8 && right < 0.6, "{left} {right}");
    }

    /// The node of a skinned mesh, 10 m away, is of no account: its joint stands at the origin.
    #[dioptric_golden::needs_shared]
    #[test]
    fn skins_hang_on_their_joints() {
        let (low, high) = read("16_skin.gltf").bounds().unwrap();
        assert!(
            low.abs_diff_eq(DVec3::new(-1.0, -1.0, 0.0), 1e-4) && high.abs_diff_eq(DVec3::new(1.0, 1.0, 0.0), 1e-4)
        );
    }
}

/// A file that has most words, over the triangle of [`file`].
fn wordy() -> Value {
    let mut root: Value = serde_json::from_str(&file("3", 3)).unwrap();
    let picture = r#"{"index":0,"texCoord":0,"extensions":{"KHR_texture_transform":{"offset":[0,0],"rotation":0,"scale":[1,1],"texCoord":0}}}"#;
    let material = r#"{"name":"all","alphaMode":"MASK","alphaCutoff":0.4,"doubleSided":true,"emissiveFactor":[0.1,0,0],
        "emissiveTexture":PICTURE,"normalTexture":PICTURE,"occlusionTexture":PICTURE,
        "pbrMetallicRoughness":{"baseColorFactor":[0.5,0.5,0.5,1],"baseColorTexture":PICTURE,"metallicFactor":0.3,"roughnessFactor":0.4,
            "metallicRoughnessTexture":PICTURE},
        "extensions":{"KHR_materials_ior":{"ior":1.4},"KHR_materials_dispersion":{"dispersion":0.2},
            "KHR_materials_specular":{"specularFactor":0.5,"specularColorFactor":[1,0.5,0.5],"specularTexture":PICTURE},
            "KHR_materials_transmission":{"transmissionFactor":0.4,"transmissionTexture":PICTURE},
            "KHR_materials_volume":{"thicknessFactor":0.1,"attenuationDistance":0.3,"attenuationColor":[1,0.4,0.4]},
            "KHR_materials_clearcoat":{"clearcoatFactor":0.6,"clearcoatRoughnessFactor":0.1,"clearcoatTexture":PICTURE},
            "KHR_materials_emissive_strength":{"emissiveStrength":3}}}"#;
    root["materials"] = serde_json::from_str(&format!("[{}]", material.replace("PICTURE", picture))).unwrap();
    root["textures"] = serde_json::from_str(r#"[{"source":0,"sampler":0}]"#).unwrap();
    root["samplers"] =
        serde_json::from_str(r#"[{"wrapS":33071,"wrapT":10497,"magFilter":9729,"minFilter":9729}]"#).unwrap();
    let bytes = include_bytes!("../../../tests/corpus/picture.png");
    let uri = format!("data:image/png;base64,{}", BASE64_STANDARD.encode(bytes));
    root["images"] = Value::Array(vec![Value::Object([("uri".to_owned(), Value::from(uri))].into_iter().collect())]);
    root["nodes"][0]["rotation"] = serde_json::from_str("[0,0,0,1]").unwrap();
    root["nodes"][0]["scale"] = serde_json::from_str("[1,1,1]").unwrap();
    root["meshes"][0]["primitives"][0]["mode"] = Value::from(4);
    root
}

/// Every object of a file, by the way to it.
fn objects(value: &Value, way: &str, found: &mut Vec<String>) {
    match value {
        Value::Object(object) => {
            found.push(way.to_owned());
            object.iter().for_each(|(key, value)| objects(value, &format!("{way}/{key}"), found));
        }
        Value::Array(list) => {
            list.iter().enumerate().for_each(|(number, value)| objects(value, &format!("{way}/{number}"), found));
        }
        _ => {}
    }
}

/// A strange word in any object, and a strange value of any word, is told or refused; nothing is taken and ignored.
#[test]
fn strange_words_and_values_are_told_everywhere() {
    let root = wordy();
    let told = |root: &Value| read_text(&root.to_string()).map(|world| world.notes().to_vec());
    let plain = told(&root).unwrap();
    let mut ways = Vec::new();
    objects(&root, "", &mut ways);
    let mut n = 0;
    for way in ways {
        let is_free = way.ends_with("extensions") || way.ends_with("attributes");
        let mut strange = root.clone();
        strange.pointer_mut(&way).unwrap()["quux"] = Value::from(7);
        if !is_free {
            let notes = told(&strange).unwrap().join("\n");
            assert!(notes.contains("quux"), "{way}: {notes}");
        }
        let words: Vec<String> = root.pointer(&way).unwrap().as_object().unwrap().keys().cloned().collect();
        for word in words {
            for value in
                [Value::Null, Value::from("blarg"), Value::from(-7), Value::from(1e300), Value::from(vec![0.5; 9])]
            {
                let mut strange = root.clone();
                strange.pointer_mut(&way).unwrap()[&word] = value.clone();
                // Names and numbers without bounds may be that, and sides without sense.
                let is_fine = ["name", "rotation", "scale", "uri", "max", "min"].contains(&word.as_str())
                    || value == 1e300
                        && [
                            "emissiveStrength",
                            "attenuationDistance",
                            "thicknessFactor",
                            "dispersion",
                            "ior",
                            "intensity",
                            "znear",
                            "zfar",
                            "alphaCutoff",
                        ]
                        .contains(&word.as_str())
                    || value == "blarg" && ["generator", "copyright"].contains(&word.as_str());
                match told(&strange) {
                    Ok(notes) if !is_fine => assert_ne!(notes, plain, "{way}/{word}: {value}"),
                    _ => {}
                }
                n += 1;
            }
        }
    }
    assert!(n > 500, "{n}");
}

/// What is left out is left out: the default stands, or the nearest number.
#[test]
fn strange_values_leave_their_defaults() {
    let with = |cutoff: &str| {
        let text = file("3", 3).replace("\"metallicFactor\":0", &format!("\"metallicFactor\":{cutoff}"));
        let world = read_text(&text).unwrap();
        let bsdf = world.bsdf(&seen(&world, [0.2, 0.2]), Vec3::Z, &[450.0, 650.0]).albedo();
        (bsdf, world.notes().join("\n"))
    };
    let (one, none) = (with("1").0, with("0").0);
    assert_ne!(one, none);
    for (value, expected, said) in
        [("\"0\"", one, "left out: materials"), ("-3", none, "nearest"), ("12", one, "nearest")]
    {
        let (found, notes) = with(value);
        assert_eq!(found, expected, "{value}");
        assert!(notes.contains(said) && notes.contains("metallicFactor"), "{notes}");
    }
}

/// A mesh at many places of one node, by its accessor of places.
#[test]
fn instances_of_a_node_stand_where_it_says() {
    // The places are the corners of the triangle itself.
    let places = r#""mesh":0,"extensions":{"EXT_mesh_gpu_instancing":{"attributes":{"TRANSLATION":0}}},"#;
    let text = file("3", 3).replace("\"mesh\":0,", places);
    let world = read_text(&text).unwrap();
    assert_eq!(world.n_primitives(), 3);
    for corner in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]] {
        assert!((seen(&world, [corner[0] + 0.2, corner[1] + 0.2]).distance_m - 5.0).abs() < 1e-5);
    }
    let of_file = r#""KHR_materials_variants":{"variants":[{"name":"green"}]},"KHR_lights_punctual":{"lights""#;
    let variants = file("3", 3).replace(r#""KHR_lights_punctual":{"lights""#, of_file);
    assert!(read_text(&variants).unwrap().notes().iter().any(|note| note.ends_with(": green")));
}

/// Returns a world whose triangle has a black base and these extensions.
fn extended(extensions: &str) -> World {
    let dark = "\"baseColorFactor\":[0,0,0,1]";
    let text = file("3", 3).replace("\"baseColorFactor\":[1,0,0,1]", dark);
    let text = text.replace("\"emissiveFactor\":[0,0,1]", &format!("\"extensions\":{{{extensions}}}"));
    read_text(&text).unwrap()
}

/// Blue fibers over a black base: blue is sent back as the table of sheens says, more towards the rim; what they send back the base lacks.
#[test]
fn cloth_has_a_sheen() {
    let sheen = "\"KHR_materials_sheen\":{\"sheenColorFactor\":[0,0,1],\"sheenRoughnessFactor\":0.5}";
    let (plain, cloth) = (extended(""), extended(sheen));
    assert_eq!(cloth.notes(), [""; 0]);
    for cos in [1.0_f32, 0.5, 0.2] {
        let outgoing = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
        let [of_plain, of_cloth] =
            [&plain, &cloth].map(|world| world.bsdf(&seen(world, [0.2, 0.2]), outgoing, &[450.0, 620.0]).albedo());
        let fibers = crate::velvet::albedo(0.25, cos);
        let expected = of_plain[0] * (1.0 - fibers) + fibers;
        assert!((of_cloth[0] - expected).abs() < 0.05 * expected, "{cos}: {of_cloth:?} {expected}");
        assert!(of_cloth[1] < of_cloth[0] && of_cloth[1] > 0.0, "{of_cloth:?}");
    }
}

/// Glass takes light below its coat and its sheen too.
#[test]
fn volumes_are_kept_below_coats_and_sheens() {
    let volume = "\"KHR_materials_transmission\":{\"transmissionFactor\":1},\"KHR_materials_volume\":{\"thicknessFactor\":1,\
                  \"attenuationDistance\":2,\"attenuationColor\":[0.5,0.5,0.5]}";
    for more in [
        "",
        ",\"KHR_materials_clearcoat\":{\"clearcoatFactor\":1}",
        ",\"KHR_materials_sheen\":{\"sheenColorFactor\":[1,1,1]}",
    ] {
        let world = extended(&format!("{volume}{more}"));
        // From behind, and so from within, 4 m on.
        let ray = Ray { origin: Vec3::new(0.2, 0.2, -7.0), direction: Vec3::Z };
        let hit = world.intersect(&ray, f32::INFINITY).unwrap();
        let medium = world.medium(world.medium_along(&hit.ray_towards(-Vec3::Z)).expect("a volume that absorbs"));
        let left = (-medium.absorption.at(&[550.0])[0] * hit.distance_m).exp();
        assert!((left - 0.25).abs() < 1e-4, "{more}: {left}");
    }
}

/// Brushed metal: towards the side along u the highlight is as wide as of the rougher α, across as of the finer, turned by its rotation.
#[test]
fn brushed_metal_spreads_light_along_its_turn() {
    let with = |extension: &str| {
        let metal = r#""baseColorFactor":[1,1,1,1],"metallicFactor":1,"roughnessFactor":0.4"#;
        let text = file("3", 3).replace(r#""baseColorFactor":[1,0,0,1],"metallicFactor":0"#, metal);
        let world =
            read_text(&text.replace(r#""emissiveFactor":[0,0,1]"#, &format!(r#""extensions":{{{extension}}}"#)))
                .unwrap();
        let bsdf = world.bsdf(&seen(&world, [0.2, 0.2]), Vec3::Z, &[550.0]);
        [Vec3::X, Vec3::Y].map(|side| bsdf.eval((Vec3::Z + 0.5 * side).normalize())[0])
    };
    let even = with("");
    assert!((even[0] / even[1] - 1.0).abs() < 1e-4, "{even:?}");
    let brushed = |turn: &str| with(&format!(r#""KHR_materials_anisotropy":{{"anisotropyStrength":0.7{turn}}}"#));
    // GGX's density and masking by α of 0.16 and 0.16 + 0.84 · 0.49, at a tilt whose tangent is tan(atan(0.5)/2).
    let tan = (0.5_f64.atan() / 2.0).tan();
    let value = |along: f64, across: f64| {
        let root = 1.0 + (tan / along).powi(2);
        let lambda = 0.5 * ((1.0 + (0.5 * along).powi(2)).sqrt() - 1.0);
        let cos = tan.atan().cos();
        1.0 / (std::f64::consts::PI * along * across * root * root * cos.powi(4)) / (1.0 + lambda) / 4.0
    };
    let (fine, rough) = (0.16, 0.16 + 0.84 * 0.49);
    let [along, across] = brushed("");
    assert!((f64::from(along) / value(rough, fine) - 1.0).abs() < 1e-3, "{along} {}", value(rough, fine));
    assert!((f64::from(across) / value(fine, rough) - 1.0).abs() < 1e-3, "{across} {}", value(fine, rough));
    let turned = brushed(r#","anisotropyRotation":1.5707963"#);
    assert!((turned[0] / across - 1.0).abs() < 1e-3 && (turned[1] / along - 1.0).abs() < 1e-3, "{turned:?}");
}
