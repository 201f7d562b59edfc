//! Materials of files against the formulas of their standards, written here once more in double precision.

#![cfg(feature = "gltf")]

use std::{f64::consts::PI, path::Path};

use dioptric_spectrum::Cancel;
use dioptric_world::{
    Hit, Ray, ReadOptions, World,
    glam::{DVec3, Vec3},
    read_world,
};

fn read(name: &str, text: &str) -> World {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join(name);
    std::fs::write(&path, text).expect("a folder that can be written to");
    read_path(&path)
}

fn read_path(path: &Path) -> World {
    read_world(path, &ReadOptions::default(), &Cancel::new()).unwrap_or_else(|error| panic!("{error}"))
}

fn above(world: &World, [x, y]: [f32; 2]) -> Hit {
    let ray = Ray { origin: Vec3::new(x, y, 2.0), direction: Vec3::NEG_Z };
    world.intersect(&ray, f32::INFINITY).expect("the square at z = 0")
}

/// A square at z = 0 of a material of pbrt's third version.
fn third(material: &str) -> World {
    let square = r#"Shape "trianglemesh" "point P" [-1 -1 0  1 -1 0  1 1 0  -1 1 0] "integer indices" [0 1 2 0 2 3]"#;
    read("world.pbrt", &format!("WorldBegin {material} {square} WorldEnd"))
}

/// A square at z = 0 of a material of glTF.
fn gltf(material: &str) -> World {
    use base64::prelude::{BASE64_STANDARD, Engine};
    let corners = [[-1.0_f32, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let bytes: Vec<u8> = corners.iter().flat_map(|[x, y]| [*x, *y, 0.0]).flat_map(f32::to_le_bytes).collect();
    let data = BASE64_STANDARD.encode(bytes);
    let text = format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],"materials":[{{{material}}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"material":0}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":6,"type":"VEC3"}}],
        "bufferViews":[{{"buffer":0,"byteLength":72}}],
        "buffers":[{{"byteLength":72,"uri":"data:application/octet-stream;base64,{data}"}}]}}"#
    );
    read("world.gltf", &text)
}

fn direction(degrees: f64, azimuth_deg: f64) -> DVec3 {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let (y, x) = azimuth_deg.to_radians().sin_cos();
    DVec3::new(sin * x, sin * y, cos)
}

/// GGX's D G / (4 cos o cos i), and the cosine on the small mirrors.
fn gloss(alpha: f64, o: DVec3, i: DVec3) -> (f64, f64) {
    let m = (o + i).normalize();
    let lambda = |v: DVec3| 0.5 * ((1.0 + alpha * alpha * (1.0 - v.z * v.z) / (v.z * v.z)).sqrt() - 1.0);
    let root = m.z * m.z * (alpha * alpha - 1.0) + 1.0;
    let d = alpha * alpha / (PI * root * root);
    (d / (1.0 + lambda(o) + lambda(i)) / (4.0 * o.z * i.z), o.dot(m))
}

/// Fresnel's equations for light from index `from` to index `to`.
fn fresnel(cos: f64, from: f64, to: f64) -> f64 {
    let sin2 = (from / to).powi(2) * (1.0 - cos * cos);
    if sin2 >= 1.0 {
        return 1.0;
    }
    let inner = (1.0 - sin2).sqrt();
    let parallel = (to * cos - from * inner) / (to * cos + from * inner);
    let across = (from * cos - to * inner) / (from * cos + to * inner);
    0.5 * (parallel * parallel + across * across)
}

/// The third version's α of a roughness.
fn alpha_of(roughness: f64) -> f64 {
    let x = roughness.max(1e-3).ln();
    1.62142 + 0.819955 * x + 0.1734 * x.powi(2) + 0.0171201 * x.powi(3) + 0.000640711 * x.powi(4)
}

fn schlick(f0: f64, f90: f64, cos: f64) -> f64 {
    f0 + (f90 - f0) * (1.0 - cos).powi(5)
}

/// Checks a material against its function without the cosine, direction by direction, and against the integral of that over all
/// directions of light from above, at 0°, 60° and 80°, by evaluating and by drawing.
fn check(name: &str, world: &World, formula: &dyn Fn(DVec3, DVec3) -> f64) {
    let hit = above(world, [0.3, 0.1]);
    for degrees in [0.0, 60.0, 80.0] {
        let o = direction(degrees, 20.0);
        let bsdf = world.bsdf(&hit, o.as_vec3(), &[550.0]);
        for (own, azimuth) in [(1.0, 20.0), (35.0, 200.0), (58.0, 190.0), (75.0, 80.0), (83.0, 201.0)] {
            let i = direction(own, azimuth);
            let (found, expected) = (f64::from(bsdf.eval(i.as_vec3())[0]), formula(o, i) * i.z);
            assert!((found - expected).abs() < 2e-3 * expected.max(1e-3), "{name} {degrees} {own}: {found} {expected}");
        }
        let n = 500;
        let mut sums = [0.0; 2];
        for index in 0..n * n {
            // Even in the square of the sine.
            let sin2 = ((index / n) as f64 + 0.5) / n as f64;
            let i = direction(sin2.sqrt().asin().to_degrees(), 360.0 * ((index % n) as f64 + 0.5) / n as f64);
            sums[0] += PI * f64::from(bsdf.eval(i.as_vec3())[0]) / i.z / (n * n) as f64;
            sums[1] += PI * formula(o, i) / (n * n) as f64;
        }
        // Half a per cent, as asked for of every material.
        assert!((sums[0] / sums[1] - 1.0).abs() < 5e-3, "{name} at {degrees}: {sums:?}");
        let m = 200;
        let drawn: f64 = (0..m * m)
            .filter_map(|k| {
                let u = [((k % m) as f32 + 0.5) / m as f32, ((k / m) as f32 + 0.5) / m as f32];
                bsdf.sample((k as f32 * 0.618_034).fract(), u)
            })
            .filter(|sample| sample.incident.z > 0.0)
            .map(|sample| f64::from(sample.weight[0]) / f64::from(m * m))
            .sum();
        // What 40,000 draws of golden-ratio and grid points leave.
        assert!((drawn - sums[1]).abs() < 0.01 * sums[1] + 2e-3, "{name} at {degrees}: drawn {drawn}, {}", sums[1]);
    }
}

#[test]
fn plastic_substrate_uber_and_translucent_are_pbrts() {
    let alpha = alpha_of(0.1);
    // The boundary of plastic is met from its inside in pbrt's third version.
    check("plastic", &third(r#"Material "plastic" "rgb Kd" [.5 .5 .5] "rgb Ks" [.25 .25 .25]"#), &|o, i| {
        let (gloss, cos) = gloss(alpha, o, i);
        0.5 / PI + 0.25 * gloss * fresnel(cos, 1.5, 1.0)
    });
    let substrate =
        r#"Material "substrate" "rgb Kd" [.5 .5 .5] "rgb Ks" [.1 .1 .1] "float uroughness" .1 "float vroughness" .1"#;
    check("substrate", &third(substrate), &|o, i| {
        let m = (o + i).normalize();
        let base = |v: DVec3| 1.0 - (1.0 - 0.5 * v.z).powi(5);
        let root = m.z * m.z * (alpha * alpha - 1.0) + 1.0;
        let d = alpha * alpha / (PI * root * root);
        let diffuse = 28.0 / (23.0 * PI) * 0.5 * (1.0 - 0.1) * base(o) * base(i);
        diffuse + d / (4.0 * o.dot(m) * o.z.max(i.z)) * schlick(0.1, 1.0, o.dot(m))
    });
    let uber = r#"Material "uber" "rgb Kd" [.4 .4 .4] "rgb Ks" [.3 .3 .3] "float index" 1.7 "float roughness" .2"#;
    let rough = alpha_of(0.2);
    check("uber", &third(uber), &|o, i| {
        let (gloss, cos) = gloss(rough, o, i);
        0.4 / PI + 0.3 * gloss * fresnel(cos, 1.0, 1.7)
    });
    let translucent = r#"Material "translucent" "rgb Kd" [.6 .6 .6] "rgb Ks" [.2 .2 .2] "rgb reflect" [.5 .5 .5]"#;
    check("translucent", &third(translucent), &|o, i| {
        let (gloss, cos) = gloss(alpha, o, i);
        0.3 / PI + 0.1 * gloss * fresnel(cos, 1.0, 1.5)
    });
    check("matte with sigma", &third(r#"Material "matte" "rgb Kd" [.5 .5 .5] "float sigma" 30"#), &|o, i| {
        let variance = 30_f64.to_radians().powi(2);
        let (a, b) = (1.0 - variance / (2.0 * (variance + 0.33)), 0.45 * variance / (variance + 0.09));
        let (so, si) = ((1.0 - o.z * o.z).sqrt(), (1.0 - i.z * i.z).sqrt());
        let along = (o.x * i.x + o.y * i.y) / (so * si).max(1e-12);
        0.5 / PI * (a + b * along.max(0.0) * so * si / o.z.max(i.z))
    });
}

/// `Kr` and `Kt` color what glass mirrors and refracts, `opacity` is the share that is there.
#[test]
fn glass_has_its_colors_and_uber_its_opacity() {
    let through = |world: &World| {
        let hit = above(world, [0.3, 0.1]);
        let bsdf = world.bsdf(&hit, Vec3::Z, &[550.0]);
        let n = 4000;
        let mut sums = [0.0; 2];
        for k in 0..n {
            let Some(sample) = bsdf.sample((k as f32 + 0.5) / n as f32, [0.3, 0.6]) else { continue };
            sums[usize::from(sample.incident.z < 0.0)] += f64::from(sample.weight[0]) / f64::from(n);
        }
        sums
    };
    let glass = third(r#"Material "glass" "rgb Kr" [.5 .5 .5] "rgb Kt" [.8 .8 .8] "float index" 1.5"#);
    let [back, on] = through(&glass);
    // Of refracted radiance n² stays behind.
    assert!((back - 0.5 * 0.04).abs() < 1e-3 && (on - 0.8 * 0.96 / 2.25).abs() < 1e-3, "{back} {on}");
    let uber = third(r#"Material "uber" "rgb Kd" [.4 .4 .4] "rgb Ks" [0 0 0] "rgb opacity" [.25 .25 .25]"#);
    let n = 10_000;
    let place = |k: u32| Vec3::new((k % 100) as f32 / 60.0 - 0.8, (k / 100) as f32 / 60.0 - 0.8, 2.0);
    let met =
        (0..n).filter(|k| uber.intersect(&Ray { origin: place(*k), direction: Vec3::NEG_Z }, 9.0).is_some()).count();
    let hidden = (0..n).filter(|k| uber.is_occluded(&Ray { origin: place(*k), direction: Vec3::NEG_Z }, 9.0)).count();
    // Four deviations of a binomial of 10,000.
    assert!((2330..2670).contains(&met) && met == hidden, "{met} {hidden}");
}

/// glTF 2.0, appendix B.
#[test]
fn metal_and_rough_are_those_of_gltf() {
    let world = gltf(
        r#""pbrMetallicRoughness":{"baseColorFactor":[0.5,0.5,0.5,1],"metallicFactor":0.3,"roughnessFactor":0.6}"#,
    );
    check("metal-rough", &world, &|o, i| {
        let (gloss, cos) = gloss(0.36, o, i);
        let layer = schlick(0.04, 1.0, cos);
        let dielectric = (1.0 - layer) * 0.5 / PI + layer * gloss;
        0.7 * dielectric + 0.3 * gloss * schlick(0.5, 1.0, cos)
    });
    let world = gltf(
        r#""pbrMetallicRoughness":{"baseColorFactor":[0.5,0.5,0.5,1],"metallicFactor":0,"roughnessFactor":0.8},
           "extensions":{"KHR_materials_ior":{"ior":1.8},"KHR_materials_specular":{"specularFactor":0.5},
                         "KHR_materials_clearcoat":{"clearcoatFactor":0.7,"clearcoatRoughnessFactor":0.5}}"#,
    );
    check("coated, with ior and specular", &world, &|o, i| {
        let (base_gloss, cos) = gloss(0.64, o, i);
        let layer = schlick(0.5 * (0.8_f64 / 2.8).powi(2), 0.5, cos);
        let base = (1.0 - layer) * 0.5 / PI + layer * base_gloss;
        let coat = 0.7 * schlick(0.04, 1.0, o.z);
        (1.0 - coat) * base + coat * gloss(0.25, o, i).0
    });
    let glossy = gltf(
        r#""extensions":{"KHR_materials_pbrSpecularGlossiness":{"diffuseFactor":[0.5,0.5,0.5,1],"specularFactor":[0.2,0.2,0.2],
                         "glossinessFactor":0.3}}"#,
    );
    check("specular-glossiness", &glossy, &|o, i| {
        let (gloss, cos) = gloss(0.49, o, i);
        let layer = schlick(0.2, 1.0, cos);
        (1.0 - layer) * 0.5 / PI + layer * gloss
    });
}

/// A base of 0.5 with the usual layer gives back about 0.5 of the light, and not 0.3; of the roughest layer, which is the default, a little less,
/// for what its small mirrors hide from each other.
#[test]
fn plain_plastics_of_gltf_are_as_bright_as_their_color() {
    let world = gltf(r#""pbrMetallicRoughness":{"baseColorFactor":[0.5,0.5,0.5,1],"metallicFactor":0}"#);
    let hit = above(&world, [0.0, 0.5]);
    let bsdf = world.bsdf(&hit, Vec3::Z, &[550.0]);
    let n = 40_000;
    let sum: f64 = (0..n)
        .filter_map(|k| {
            bsdf.sample(
                (k as f32 * 0.618_034).fract(),
                [((k % 200) as f32 + 0.5) / 200.0, ((k / 200) as f32 + 0.5) / 200.0],
            )
        })
        .map(|sample| f64::from(sample.weight[0]) / f64::from(n))
        .sum();
    assert!((0.485..0.525).contains(&sum), "{sum}");
}

/// Blend and mask pass rays in the share that is open, glow and volume follow their words.
#[test]
fn alpha_and_volume_of_gltf_are_followed() {
    let met = |world: &World| {
        let place = |k: u32| Vec3::new((k % 100) as f32 / 60.0 - 0.8, (k / 100) as f32 / 60.0 - 0.8, 2.0);
        (0..10_000)
            .filter(|k| world.intersect(&Ray { origin: place(*k), direction: Vec3::NEG_Z }, 9.0).is_some())
            .count()
    };
    let with = |mode: &str, alpha: &str| {
        gltf(&format!(r#""alphaMode":"{mode}","pbrMetallicRoughness":{{"baseColorFactor":[1,1,1,{alpha}]}}"#))
    };
    assert_eq!(
        (met(&with("OPAQUE", "0.4")), met(&with("MASK", "0.4")), met(&with("MASK", "0.6"))),
        (10_000, 0, 10_000)
    );
    assert!((3804..4196).contains(&met(&with("BLEND", "0.4"))));
    let volume = gltf(
        r#""extensions":{"KHR_materials_transmission":{"transmissionFactor":1},
           "KHR_materials_volume":{"thicknessFactor":1,"attenuationDistance":0.5,"attenuationColor":[0.25,0.25,0.25]}}"#,
    );
    let hit = above(&volume, [0.0, 0.5]);
    let from_below = Ray { origin: Vec3::new(0.0, 0.5, -1.0), direction: Vec3::Z };
    let within = volume.intersect(&from_below, 9.0).expect("the square");
    let filling = volume.medium_along(&from_below).expect("an absorbing medium");
    let left = (-volume.medium(filling).absorption.at(&[550.0])[0] * within.distance_m).exp();
    // A metre of a quarter each half metre.
    assert!((left - 0.0625).abs() < 1e-4, "{left}");
    assert!(volume.medium_along(&hit.ray_towards(Vec3::Z)).is_none());
    assert!(volume.medium_along(&Ray { origin: Vec3::Z, direction: Vec3::NEG_Z }).is_none());
}

fn shared(name: &str) -> World {
    read_path(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/inputs/world").join(name))
}

/// Leaves cut out by their alpha, a screen of half coverage, and a boundary that is none.
#[dioptric_golden::needs_shared]
#[test]
fn alpha_and_interfaces_of_pbrt_are_passed() {
    let leaf = shared("alpha.pbrt");
    let met =
        |x: f32, y: f32| leaf.intersect(&Ray { origin: Vec3::new(x, y, -3.0), direction: Vec3::Z }, 9.0).is_some();
    let n_met = (0..400).filter(|k| met((k % 20) as f32 / 10.5 - 0.9, (k / 20) as f32 / 10.5 - 0.9)).count();
    assert!((20..380).contains(&n_met), "{n_met} of 400");
    assert_eq!(leaf.notes(), [""; 0]);
    // Shadows of a screen of alpha one half let half the light of the lamp through; of the interface all.
    for (name, expected) in [("alpha_half.pbrt", 0.5), ("interface.pbrt", 1.0)] {
        let world = shared(name);
        let n = 4000;
        let lit = (0..n)
            .filter(|k| {
                let at = Vec3::new((k % 63) as f32 / 100.0 - 0.3, (k / 63) as f32 / 100.0 - 0.3, 0.99);
                let to = Vec3::new(0.0, 0.0, -2.5) - at;
                !world.is_occluded(&Ray { origin: at, direction: to.normalize() }, to.length())
            })
            .count() as f64
            / f64::from(n);
        // The screen lies behind the lamp in neither file: z = -2 is between it and the wall.
        assert!((lit - expected).abs() < 0.04, "{name}: {lit}");
    }
}

/// A sky of two to one in a file of the fourth version is one by angles: its upper half is what lies above.
#[dioptric_golden::needs_shared]
#[test]
fn skies_of_two_to_one_are_by_angles() {
    let world = shared("sky21.pbrt");
    assert!(world.notes().iter().any(|note| note.contains("square")), "{:?}", world.notes());
    let spherical = shared("spherical.pbrt");
    assert!(matches!(spherical.cameras()[0].kind, dioptric_world::CameraKind::Panorama { .. }));
}
