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
    read_with(text, &crate::ReadOptions::default())
}

fn read_with(text: &str, options: &crate::ReadOptions) -> Result<World, WorldError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("world.gltf");
    std::fs::write(&path, text).unwrap();
    crate::read_world(&path, options, &Cancel::new())
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
    root["animations"] = serde_json::json!([{"name": "turn", "samplers": [{"input": 0, "output": 0, "interpolation": "STEP"}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "rotation"}}]}]);
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
        let medium = world.medium(world.medium_towards(&hit, -Vec3::Z, None).expect("a volume that absorbs"));
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
    // By a picture whose red and green say up, and blue seven tenths of the strength.
    let mut png = std::io::Cursor::new(Vec::new());
    let picture = image::RgbImage::from_pixel(1, 1, image::Rgb([128, 255, 179]));
    picture.write_to(&mut png, image::ImageFormat::Png).unwrap();
    let uri = format!("data:image/png;base64,{}", BASE64_STANDARD.encode(png.into_inner()));
    let anisotropy =
        r#""extensions":{"KHR_materials_anisotropy":{"anisotropyStrength":1,"anisotropyTexture":{"index":0}}}"#;
    let text = file("3", 3)
        .replace(r#""baseColorFactor":[1,0,0,1],"metallicFactor":0"#, r#""metallicFactor":1,"roughnessFactor":0.4"#)
        .replace(r#""emissiveFactor":[0,0,1]"#, anisotropy)
        .replace(r#""scene":0"#, &format!(r#""scene":0,"textures":[{{"source":0}}],"images":[{{"uri":"{uri}"}}]"#));
    let world = read_text(&text).unwrap();
    assert_eq!(world.notes(), [""; 0]);
    let bsdf = world.bsdf(&seen(&world, [0.2, 0.2]), Vec3::Z, &[550.0]);
    let [x, y] = [Vec3::X, Vec3::Y].map(|side| bsdf.eval((Vec3::Z + 0.5 * side).normalize())[0]);
    // 128 is a 255th of a half turn aside.
    assert!((x / across - 1.0).abs() < 0.01 && (y / along - 1.0).abs() < 0.01, "{x} {y}: {across} {along}");
}

/// What an animation moves, each with its floats at 1 s and at 3 s.
type Channels<'a> = &'a [(&'a str, &'a [f32])];

/// The file of one triangle, with these animations.
fn animated(animations: &[(&str, Channels<'_>)]) -> String {
    let mut root: Value = serde_json::from_str(&file("3", 3)).unwrap();
    let mut bytes = Vec::new();
    let mut accessor = |floats: &[f32], count: usize| {
        let (first, kind) = (bytes.len(), ["SCALAR", "VEC2", "VEC3", "VEC4"][floats.len() / count - 1]);
        bytes.extend(floats.iter().flat_map(|value| value.to_le_bytes()));
        let views = root["bufferViews"].as_array_mut().unwrap();
        views.push(serde_json::json!({"buffer": 1, "byteOffset": first, "byteLength": 4 * floats.len()}));
        let view = views.len() - 1;
        let accessors = root["accessors"].as_array_mut().unwrap();
        accessors.push(serde_json::json!({"bufferView": view, "componentType": 5126, "count": count, "type": kind}));
        accessors.len() - 1
    };
    let times = accessor(&[1.0, 3.0], 2);
    let made = animations.iter().map(|(name, channels)| {
        let samplers: Vec<Value> = channels
            .iter()
            .map(|(_, floats)| serde_json::json!({"input": times, "output": accessor(floats, 2)}))
            .collect();
        let target = |pointer: &str| match pointer.split('/').collect::<Vec<_>>()[..] {
            [node, path] => serde_json::json!({"node": node.parse::<usize>().unwrap(), "path": path}),
            _ => serde_json::json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": pointer}}}),
        };
        let channels = channels.iter().enumerate();
        let channels: Vec<Value> = channels
            .map(|(number, (pointer, _))| serde_json::json!({"sampler": number, "target": target(pointer)}))
            .collect();
        serde_json::json!({"name": name, "channels": channels, "samplers": samplers})
    });
    root["animations"] = made.collect();
    let uri = format!("data:application/octet-stream;base64,{}", BASE64_STANDARD.encode(&bytes));
    root["buffers"].as_array_mut().unwrap().push(serde_json::json!({"byteLength": bytes.len(), "uri": uri}));
    root.to_string()
}

fn read_at(text: &str, time_s: Option<f64>, animation: Option<&str>) -> Result<World, WorldError> {
    read_with(text, &crate::ReadOptions { time_s, animation: animation.map(str::to_owned), ..Default::default() })
}

/// Half of the way from 1 s to 3 s a mesh, a camera and what pointers lead to have come half of theirs.
#[test]
fn everything_moves_with_the_time() {
    let text = animated(&[(
        "all",
        &[
            ("0/translation", &[0.0, 0.0, -3.0, 0.0, 4.0, -5.0]),
            ("1/translation", &[0.0, 0.0, 2.0, 2.0, 0.0, 2.0]),
            ("/cameras/0/perspective/yfov", &[0.5, 0.7]),
            ("/extensions/KHR_lights_punctual/lights/0/intensity", &[683.0, 2049.0]),
            ("/materials/0/pbrMetallicRoughness/baseColorFactor", &[0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0]),
        ],
    )]);
    let world = read_at(&text, Some(2.0), None).unwrap();
    assert_eq!(world.notes().iter().filter(|note| !note.contains("glow")).count(), 0, "{:?}", world.notes());
    let hit = world.intersect(&Ray { origin: Vec3::new(0.2, 2.2, 2.0), direction: Vec3::NEG_Z }, 100.0).unwrap();
    assert!((hit.distance_m - 6.0).abs() < 1e-5, "{}", hit.distance_m);
    let albedo = world.bsdf(&hit, Vec3::Z, &[550.0]).albedo()[0];
    assert!((albedo - 0.04 - 0.96 * 0.5).abs() < 1e-3, "{albedo}");
    let camera = &world.cameras()[0];
    assert_eq!(camera.world_from_camera.translation, DVec3::new(1.0, 0.0, 2.0));
    let CameraKind::Perspective { fov_deg, .. } = camera.kind else { panic!("a perspective camera") };
    assert!((fov_deg - 0.6_f64.to_degrees()).abs() < 1e-5, "{fov_deg}");
    // Beside the lamp, which is near, twice what the lamp of the file gives at the same distance.
    let still = read_at(&text, None, None).unwrap();
    let lit = |world: &World, x: f32| {
        let at = Vec3::new(x, 0.1, 2.0);
        (0..64)
            .filter_map(|i| world.sample_light(at, i as f32 / 64.0, [0.5; 2], &[550.0]))
            .find(|light| light.distance_m < 0.2)
            .expect("the lamp")
            .radiance[0]
    };
    assert!((lit(&world, 1.0) / lit(&still, 0.0) - 2.0).abs() < 1e-3);
    assert!((seen(&still, [0.2, 0.2]).distance_m - 5.0).abs() < 1e-5);
    assert!(still.notes().iter().any(|note| note.ends_with("without --time: all (3.000 s)")), "{:?}", still.notes());
    let ends = &world.choices().animations[0];
    assert_eq!((ends.name.as_str(), ends.end_s), ("all", 3.0));
    let late = read_at(&text, Some(9.0), None).unwrap();
    assert_eq!(late.cameras()[0].world_from_camera.translation.x, 2.0);
    assert!(late.notes().iter().any(|note| note.contains("ends at 3.000 s")), "{:?}", late.notes());
}

/// Of two animations of one node the first is shown, with the one of another node; either alone when it is asked for.
#[test]
fn animations_that_move_the_same_are_choices() {
    let text = animated(&[
        ("walk", &[("0/translation", &[0.0, 0.0, -4.0, 0.0, 0.0, -4.0])]),
        ("run", &[("0/translation", &[0.0, 0.0, -7.0, 0.0, 0.0, -7.0])]),
        ("pan", &[("1/translation", &[1.0, 0.0, 2.0, 1.0, 0.0, 2.0])]),
    ]);
    let shown = |animation: Option<&str>| {
        let world = read_at(&text, Some(2.0), animation).unwrap();
        (seen(&world, [0.2, 0.2]).distance_m.round(), world.cameras()[0].world_from_camera.translation.x)
    };
    assert_eq!(shown(None), (6.0, 1.0));
    assert_eq!(shown(Some("run")), (9.0, 0.0));
    assert_eq!(shown(Some("3")), (5.0, 1.0));
    let error = read_at(&text, Some(2.0), Some("jump")).unwrap_err().to_string();
    assert!(error.contains("'jump'") && error.contains("walk, run, pan"), "{error}");
    let still = read_at(&file("3", 3), Some(1.0), None).unwrap();
    assert!(still.notes().iter().any(|note| note.contains("nothing in the file moves")), "{:?}", still.notes());
}

/// A node with a matrix turns about its place as one with three words does; one that isn't visible is not there.
#[test]
fn matrices_are_parted_before_they_move() {
    let text = animated(&[("turn", &[("0/rotation", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0])])]);
    let text = text.replace("\"translation\":[0,0,-3]", "\"matrix\":[2,0,0,0,0,2,0,0,0,0,2,0,0.5,0.5,-3,1]");
    // A half turn about z, and twice the size: the triangle lies on the other side of (0.5, 0.5).
    let (low, high) = read_at(&text, Some(3.0), None).unwrap().bounds().unwrap();
    assert!(low.abs_diff_eq(DVec3::new(-1.5, -1.5, -3.0), 1e-5) && high.abs_diff_eq(DVec3::new(0.5, 0.5, -3.0), 1e-5));
    let hidden = animated(&[("hide", &[("/nodes/0/extensions/KHR_node_visibility/visible", &[1.0, 0.0])])]);
    let hidden =
        hidden.replace("\"mesh\":0,", "\"mesh\":0,\"extensions\":{\"KHR_node_visibility\":{\"visible\":true}},");
    assert!(read_at(&hidden, Some(0.0), None).unwrap().bounds().is_some());
    assert!(read_at(&hidden, Some(3.0), None).unwrap().bounds().is_none());
}

/// A variant shows its material; one that isn't there is refused with those that are.
#[test]
fn variants_show_their_materials() {
    let mut root: Value = serde_json::from_str(&file("3", 3)).unwrap();
    root["materials"] = serde_json::json!([root["materials"][0], {"name": "white"}]);
    root["extensions"]["KHR_materials_variants"] =
        serde_json::json!({"variants": [{"name": "day"}, {"name": "night"}]});
    root["meshes"][0]["primitives"][0]["extensions"]["KHR_materials_variants"] =
        serde_json::json!({"mappings": [{"material": 1, "variants": [1]}]});
    let with = |variant: Option<&str>| {
        let variant = variant.map(str::to_owned);
        read_with(&root.to_string(), &crate::ReadOptions { variant, ..Default::default() })
    };
    let blue = |variant: Option<&str>| {
        let world = with(variant).unwrap();
        world.bsdf(&seen(&world, [0.2, 0.2]), Vec3::Z, &[450.0]).albedo()[0]
    };
    assert!(blue(Some("night")) > 0.5 && blue(Some("day")) < 0.2 && blue(None) < 0.2);
    let error = with(Some("dusk")).unwrap_err().to_string();
    assert!(error.contains("'dusk'") && error.contains("day, night"), "{error}");
    assert_eq!(with(None).unwrap().choices().variants, ["day", "night"]);
}

/// A film half a micrometre thick over a black base shows each wavelength its own interference, and half of it half of that.
#[test]
fn films_have_the_colors_of_interference() {
    let with = |factor: f32| {
        let film = format!(
            "\"KHR_materials_iridescence\":{{\"iridescenceFactor\":{factor},\"iridescenceIor\":1.4,\"iridescenceThicknessMaximum\":500}}"
        );
        let world = extended(&film);
        assert_eq!(world.notes(), [""; 0]);
        world
    };
    let nm = [420.0, 500.0, 560.0, 640.0];
    for cos in [1.0_f32, 0.6, 0.3] {
        let outgoing = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
        let albedo = |world: &World| world.bsdf(&seen(world, [0.2, 0.2]), outgoing, &nm).albedo();
        let [none, half, whole] = [0.0, 0.5, 1.0].map(|factor| albedo(&with(factor)));
        for (lane, nm) in nm.into_iter().enumerate() {
            let expected = crate::film::reflectance(cos, 1.4, 0.04, 2.0 * 1.4 * 500.0 / nm);
            assert!((whole[lane] - expected).abs() < 1e-5, "{nm} nm at {cos}: {} {expected}", whole[lane]);
            assert!((half[lane] - 0.5 * (none[lane] + expected)).abs() < 1e-5, "{nm} nm at {cos}");
        }
    }
    // A pane with the film lets through what that leaves.
    let pane = extended(
        "\"KHR_materials_transmission\":{\"transmissionFactor\":1},\"KHR_materials_iridescence\":{\"iridescenceFactor\":1}",
    );
    let white = pane.bsdf(&seen(&pane, [0.2, 0.2]), Vec3::Z, &[550.0]).albedo()[0];
    assert!((white - crate::film::reflectance(1.0, 1.3, 0.04, 2.0 * 1.3 * 400.0 / 550.0)).abs() < 1e-4, "{white}");
}

/// A leaf: of what its layer lets in, three quarters go through, green, by Lambert's law; a quarter of its own color comes back.
#[test]
fn leaves_let_diffuse_light_through() {
    let leaf = "\"KHR_materials_diffuse_transmission\":{\"diffuseTransmissionFactor\":0.75,\"diffuseTransmissionColorFactor\":[0,1,0]}";
    let world = extended(leaf);
    assert_eq!(world.notes(), [""; 0]);
    let hit = seen(&world, [0.2, 0.2]);
    let bsdf = world.bsdf(&hit, Vec3::Z, &[450.0, 540.0, 640.0]);
    for cos in [1.0_f32, 0.5] {
        let below = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, -cos);
        let [blue, green, red] = bsdf.eval(below);
        let expected = 0.75 * 0.96 * cos / std::f32::consts::PI;
        assert!((green / expected - 1.0).abs() < 0.05, "{green} {expected}");
        assert!(blue < 0.2 * green && red < 0.2 * green, "{blue} {green} {red}");
    }
    // Where both are there, what goes through straight takes from the diffuse.
    let clear = extended(&format!("{leaf},\"KHR_materials_transmission\":{{\"transmissionFactor\":1}}"));
    let below = clear.bsdf(&seen(&clear, [0.2, 0.2]), Vec3::Z, &[540.0]).eval(Vec3::new(0.9, 0.0, -0.435_89))[0];
    assert!(below < 0.02, "{below}");
    // Without an end the index mirrors all.
    let mirror = extended("\"KHR_materials_ior\":{\"ior\":0}");
    assert!((mirror.bsdf(&seen(&mirror, [0.2, 0.2]), Vec3::Z, &[540.0]).albedo()[0] - 1.0).abs() < 1e-5);
}

/// A picture of 16 × 16, its quarters red and green over blue and yellow, as Basis Universal packs it in either way, the
/// second also by Zstandard.
const PACKED: [&[u8]; 2] =
    [include_bytes!("../../../tests/corpus/etc1s.ktx2"), include_bytes!("../../../tests/corpus/uastc.ktx2")];

#[test]
fn pictures_packed_by_basis_universal_are_read() {
    let mut root = wordy();
    root["materials"] =
        serde_json::json!([{"pbrMetallicRoughness": {"metallicFactor": 0, "baseColorTexture": {"index": 0}}}]);
    root["textures"] = serde_json::json!([{"extensions": {"KHR_texture_basisu": {"source": 0}}}]);
    for packed in PACKED {
        root["images"] =
            serde_json::json!([{"uri": format!("data:image/ktx2;base64,{}", BASE64_STANDARD.encode(packed))}]);
        // The corners of the picture, row by row, lie at the vertices of triangles of their own.
        for (uv, expected) in [
            ([0.2_f32, 0.2_f32], [220, 30, 30]),
            ([0.8, 0.2], [30, 200, 40]),
            ([0.2, 0.8], [40, 50, 210]),
            ([0.8, 0.8], [230, 210, 40]),
        ] {
            let transform = serde_json::json!({"KHR_texture_transform": {"offset": uv, "scale": [0, 0]}});
            let mut root = root.clone();
            root["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] = transform;
            root["materials"][0]["extensions"] = serde_json::json!({"KHR_materials_unlit": {}});
            let world = read_text(&root.to_string()).unwrap();
            let glow = world.emission(&seen(&world, [0.2, 0.2]), Vec3::Z, &[450.0, 540.0, 640.0]);
            let expected = expected.map(|code| dioptric_spectrum::srgb_decode(f64::from(code) / 255.0) as f32);
            let light = SpectralCurve::from_rgb_light([1.0; 3]).at(&[450.0, 540.0, 640.0]);
            let share = SpectralCurve::from_rgb_reflectance(expected).at(&[450.0, 540.0, 640.0]);
            for lane in 0..3 {
                let expected = light[lane] * share[lane];
                // ETC1S has five bits a color.
                assert!((glow[lane] - expected).abs() < 0.05, "{uv:?}: {glow:?} {expected}");
            }
        }
    }
    root["images"] =
        serde_json::json!([{"uri": format!("data:image/ktx2;base64,{}", BASE64_STANDARD.encode(&PACKED[0][..200]))}]);
    let notes = read_text(&root.to_string()).unwrap().notes().join("\n");
    assert!(notes.contains("KTX 2, expected one packed by Basis Universal"), "{notes}");
}

/// A sheet z = x y of 3 × 3 squares with colors and texture coordinates, packed by Google's Draco 1.5.7 in either way.
const EDGES: &str = "\
    RFJBQ08CAgEBAAAAEBICEgIABu/T6lOtGv8BEf8Ca0H/AmtBA/8AAAAAAAEAAAEACQMAAAIBAwkCAAECAQICBAACAQEBAQAPAwEMJwEoAwEMBQ\
    DY2F+KquqqKsepqqkqAAAAqKpwHAAAwI0DAADkOAAAAHIcAADgxgEAAHIcAAAAxwEAAHQcAADgxgEAAHAcAAAANw4AAAAA/z8AAAAAAAAAAAAA\
    AAAAAAAAgD8OBQEBAA0DAQgTAQQDARQBGAMBCAYAZSho32+qqqqqqqr9AWiXNM0ANAQwdzQAIQJIHm879wNgiNIAlBIdAA4AAAABAuBAAAAAAP\
    8PAAAAAAAAAAAAAAAAgD8MAQEBAQOsAQE6AQH//5sBAQEDAQEHAGpcLzcfqQAAAAD/AAAA";
/// The same, one vertex after the other.
const SEQUENCE: &str = "\
    RFJBQ08CAgEAAAASEAEAAQQBBQQBAgUCBgUCAwYDBwYEBQgFCQgFBgkGCgkGBwoHCwoICQwJDQwJCg0KDg0KCw4LDw4BAwAJAwAAAwkCAAECAg\
    QAAgICAQABAQAPAwEELwE8AwAgi1BVAQAAQFUFAAAAVRUAAAAEAFUVAFBVAQAcR1UFAHQcVRUAwHEEAFU1VVVVAQA5TlUFAOA4VRUAkOMEAFWV\
    VVVVAQBVVVUFAFRVVRUAUFUBAAAAAP8/AAAAAQEADQMBBCcBPAMAIIuqKgCoKgCoKgAIQKqqKgCoKgCoKgAIQKqqKgCoKgCoKgAIQKqqKgCoKg\
    CoKgAAAAAAAP8PAAAAAQEBA6sBAS0BAQED//+bAQ8MwHOsQcfZviRbG1KAAAAAAP8AAAAAAAAAAAAAAAAAAAAAAIA/DgAAAAAAAAAAAACAPww=";

#[test]
fn meshes_packed_by_draco_are_read() {
    for packed in [EDGES, SEQUENCE] {
        let with = |packed: &str| {
            let mut root: Value = serde_json::from_str(&file("3", 3)).unwrap();
            let n_bytes = BASE64_STANDARD.decode(packed).unwrap().len();
            let accessor = |kind: &str, component: u64, is_normalized: bool| serde_json::json!({"componentType": component, "count": 16, "type": kind, "normalized": is_normalized});
            root["accessors"] = serde_json::json!([
                accessor("VEC3", 5126, false),
                accessor("VEC2", 5126, false),
                accessor("VEC4", 5121, true),
                accessor("SCALAR", 5123, false)
            ]);
            root["bufferViews"] = serde_json::json!([{"buffer": 0, "byteLength": n_bytes}]);
            let uri = format!("data:application/octet-stream;base64,{packed}");
            root["buffers"] = serde_json::json!([{"byteLength": n_bytes, "uri": uri}]);
            root["extensionsRequired"] = serde_json::json!(["KHR_draco_mesh_compression"]);
            root["materials"] = serde_json::json!([{"pbrMetallicRoughness": {"metallicFactor": 0}}]);
            root["meshes"][0]["primitives"][0] = serde_json::json!({
                "attributes": {"POSITION": 0, "TEXCOORD_0": 1, "COLOR_0": 2}, "indices": 3, "material": 0,
                "extensions": {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0, "TEXCOORD_0": 1, "COLOR_0": 2}}}
            });
            read_text(&root.to_string())
        };
        let world = with(packed).unwrap();
        assert_eq!((world.notes(), world.n_primitives()), (&[][..], 18));
        for [x, y] in [[0.3, 0.05], [0.36, 0.35], [0.6, 0.9], [0.95, 0.3]] {
            let hit = seen(&world, [x, y]);
            // On edges the sheet is x y; within squares flat to a ninth of a quarter.
            let z_m = 5.0 - hit.distance_m;
            assert!((z_m - x * y).abs() < 1.0 / 36.0, "{x} {y}: {z_m}");
            assert!((hit.uv.x - x).abs() < 1e-3 && (hit.uv.y - y).abs() < 1e-3, "{x} {y}: {}", hit.uv);
            let albedo = world.bsdf(&hit, Vec3::Z, &[450.0, 540.0, 640.0]).albedo();
            let base = SpectralCurve::from_rgb_reflectance([x, y, 0.0]).at(&[450.0, 540.0, 640.0]);
            assert!((0..3).all(|lane| (albedo[lane] - 0.04 - 0.96 * base[lane]).abs() < 0.01), "{albedo:?} {base:?}");
        }
        let mut broken = BASE64_STANDARD.decode(packed).unwrap();
        broken.truncate(60);
        let error = with(&BASE64_STANDARD.encode(broken)).unwrap_err().to_string();
        assert!(error.contains("packed by Draco can't be unpacked"), "{error}");
    }
}
