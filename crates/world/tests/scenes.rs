//! World files: what becomes of their words, that all real ones load, and that no malformed one does harm.

mod mutate;

use std::path::{Path, PathBuf};

use dioptric_golden::mutant;
use dioptric_spectrum::{Cancel, Observer, WavelengthGrid};
use dioptric_world::{
    CameraKind, Ray, ReadOptions, World, WorldError,
    glam::{DVec3, Vec3},
    read_world,
};

use mutate::{seeds, write_beside};

fn read(path: &Path) -> Result<World, WorldError> {
    read_world(path, &ReadOptions::default(), &Cancel::new())
}

fn read_text(text: &str) -> Result<World, WorldError> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("world.pbrt");
    std::fs::write(&path, text).expect("a folder that can be written to");
    read(&path)
}

fn hit(world: &World, origin: [f32; 3], direction: [f32; 3]) -> Option<dioptric_world::Hit> {
    let ray = Ray { origin: Vec3::from_array(origin), direction: Vec3::from_array(direction).normalize() };
    world.intersect(&ray, f32::INFINITY)
}

const SMALL: &str = include_str!("corpus/small.pbrt");

#[test]
fn small_world_is_what_it_says() {
    let world = read_text(SMALL).unwrap();
    assert_eq!((world.n_lights(), world.n_primitives()), (3, 4));
    assert!(world.notes().iter().any(|note| note.contains("curve")), "{:?}", world.notes());
    let floor = hit(&world, [1.0, 0.0, 1.0], [0.0, -1.0, 0.0]).unwrap();
    assert!((floor.distance_m - 1.0).abs() < 1e-6 && floor.geometric_normal.y.abs() > 0.999);
    // Fields of 1.25 m: (1, 1) lies in the field (4, 4), which is red; the next one is black.
    let red = world.bsdf(&floor, Vec3::Y, &[450.0, 650.0]).albedo();
    assert!(red[1] > 0.6 && red[0] < 0.3, "{red:?}");
    let black = hit(&world, [1.0, 0.0, 2.0], [0.0, -1.0, 0.0]).unwrap();
    assert_eq!(world.bsdf(&black, Vec3::Y, &[450.0, 650.0]).albedo(), [0.0; 2]);
    for x in [2.0, -2.0] {
        let ball = hit(&world, [x, 0.0, -5.0], [0.0, 0.0, 1.0]).unwrap();
        assert!((ball.distance_m - 4.5).abs() < 1e-5 && ball.geometric_normal.z < -0.99 && ball.instance.is_some());
        let gold = world.bsdf(&ball, Vec3::NEG_Z, &[450.0, 680.0]).albedo();
        assert!((gold[0] - 0.385).abs() < 0.03 && gold[1] > 0.94, "{gold:?}");
    }
    // The disc was turned to shine down.
    let lamp = hit(&world, [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]).unwrap();
    assert!(world.emission(&lamp, Vec3::NEG_Y, &[600.0])[0] > 0.0);
    assert_eq!(world.emission(&lamp, Vec3::Y, &[600.0]), [0.0]);
    let camera = &world.cameras()[0];
    assert_eq!(camera.resolution, (300, 200));
    assert!(camera.world_from_camera.translation.abs_diff_eq(DVec3::new(0.0, 1.0, -5.0), 1e-12));
    let forwards = camera.world_from_camera.transform_vector3(DVec3::Z);
    assert!(forwards.abs_diff_eq(DVec3::new(0.0, -1.0, 5.0).normalize(), 1e-12));
    assert!(matches!(camera.kind, CameraKind::Perspective { fov_deg: 40.0, lens_radius_m: 0.02, .. }));
}

/// A part of a picture and words of cameras that are not known are reported; the whole as a part, and names of files, are not.
/// A ball of glass filled with a dye: a ray through its middle is left exp(−σ d), by the file's unit.
#[test]
fn media_fill_what_they_are_in() {
    let text = "WorldBegin\nMakeNamedMedium \"dye\" \"string type\" \"homogeneous\" \"spectrum sigma_a\" [400 3 700 3] \"rgb sigma_s\" [0 0 0] \"float scale\" 2\n\
                MakeNamedMedium \"ink\" \"string type\" \"homogeneous\" \"rgb sigma_a\" [1 4 4] \"rgb sigma_s\" [0 0 0]\n\
                Material \"dielectric\"\nMediumInterface \"dye\" \"\"\nShape \"sphere\" \"float radius\" .1\n\
                AttributeBegin\nMediumInterface \"ink\" \"\"\nTranslate 1 0 0\nShape \"sphere\" \"float radius\" .1\nAttributeEnd\n";
    let world = read_text(text).unwrap();
    let left = |x: f32, nm: f32| {
        let ray = Ray { origin: Vec3::new(x, 0.0, 0.0), direction: Vec3::Z };
        let wall = world.intersect(&ray, f32::INFINITY).unwrap();
        let of = |medium| world.medium(medium).absorption.at(&[nm])[0];
        (-world.medium_along(&ray).map_or(0.0, of) * wall.distance_m).exp()
    };
    assert!((left(0.0, 550.0) - (-6.0_f32 * 0.1).exp()).abs() < 1e-5, "{}", left(0.0, 550.0));
    // A color says but roughly what is left of each wavelength.
    let [red, blue] = [left(1.0, 650.0), left(1.0, 450.0)];
    assert!((red - (-0.1_f32).exp()).abs() < 0.03 && (blue - (-0.4_f32).exp()).abs() < 0.03, "{red} {blue}");
    assert!(world.notes().is_empty(), "{:?}", world.notes());
}

/// Coefficients, presets and grids of media are those that the file says, in metres; what is none is left out by name.
#[test]
fn media_are_even_or_in_grids() {
    let grid = "\"integer nx\" 2 \"float density\" [1 3] \"point3 p0\" [-1 -1 -1] \"point3 p1\" [1 1 1]";
    let text = format!(
        "MakeNamedMedium \"fog\" \"string type\" \"homogeneous\" \"rgb sigma_a\" [0 0 0] \"float sigma_s\" 2 \"float g\" .5\n\
         MakeNamedMedium \"milk\" \"string type\" \"homogeneous\" \"string preset\" \"Wholemilk\" \"float scale\" 1000\n\
         MakeNamedMedium \"smoke\" \"string type\" \"uniformgrid\" {grid} \"spectrum sigma_s\" [400 5 700 5]\n\
         MakeNamedMedium \"old\" \"string type\" \"heterogeneous\" {grid} \"rgb sigma_s\" [4 4 4]\n\
         MakeNamedMedium \"short\" \"string type\" \"uniformgrid\" \"integer nx\" 3 \"float density\" [1 3]\n\
         MakeNamedMedium \"vdb\" \"string type\" \"nanovdb\" \"string filename\" \"a.nvdb\"\n\
         MediumInterface \"\" \"fog\"\nCamera \"perspective\"\nWorldBegin\nMaterial \"interface\"\n\
         MediumInterface \"milk\" \"fog\"\nShape \"sphere\" \"float radius\" 1\nTranslate 5 0 0\n\
         MediumInterface \"smoke\" \"fog\"\nShape \"sphere\" \"float radius\" 1\nTranslate 5 0 0\n\
         MediumInterface \"old\" \"fog\"\nShape \"sphere\" \"float radius\" 1\n"
    );
    let world = read_text(&text).unwrap();
    let ray = |x: f32| Ray { origin: Vec3::new(x, 0.0, 0.0), direction: Vec3::Z };
    let at = |x: f32| {
        let medium = world.medium(world.medium_along(&ray(x)).expect("a medium"));
        (medium.at(Vec3::new(x, 0.0, 0.0), &[450.0, 650.0]), medium.asymmetry)
    };
    // Around everything, and in view of what it is around.
    for x in [-30.0, 3.0] {
        let (fog, g) = at(x);
        assert_eq!((fog.absorption, fog.scattering, g), ([0.0; 2], [2.0; 2], 0.5));
    }
    let (milk, _) = at(0.0);
    // Smooth spectra of the three numbers.
    assert!((milk.scattering[0] - 3770.0).abs() < 200.0 && (2550.0..3210.0).contains(&milk.scattering[1]), "{milk:?}");
    assert!(milk.absorption[0] > 5.0 * milk.absorption[1] && milk.absorption[1] > 0.0, "{milk:?}");
    // Its box is the file's where it is named, whatever it fills.
    assert_eq!(at(5.0).0.scattering, [0.0; 2]);
    let smoke = world.medium(world.medium_along(&ray(5.0)).unwrap());
    let densities = [-0.5, 0.0, 0.5].map(|x| smoke.at(Vec3::new(x, 0.0, 0.0), &[550.0]).scattering[0]);
    assert_eq!(densities, [5.0, 10.0, 15.0]);
    let old = world.medium(world.medium_along(&ray(10.0)).unwrap()).at(Vec3::ZERO, &[550.0]);
    assert!((old.scattering[0] - 8.0).abs() < 1e-3, "{old:?}");
    // Nothing is met where there is no surface.
    assert!(world.intersect(&ray(0.0), f32::INFINITY).is_none() && !world.is_occluded(&ray(0.0), 9.0));
    let notes = world.notes().join("\n");
    assert!(
        notes.contains("grid is none, left out: space is clear: short (") && notes.contains("vdb (nanovdb)"),
        "{notes}"
    );
}

/// What is below a surface fills its shapes: by coefficients in the file's unit, by a substance, or so that it sends back the color told.
#[test]
fn what_is_below_a_surface_scatters_light() {
    let below = |params: &str| {
        let text = format!("WorldBegin\nMaterial {params}\nShape \"sphere\"\n");
        let world = read_text(&text).unwrap();
        assert!(world.notes().is_empty(), "{:?}", world.notes());
        let inside = Ray { origin: Vec3::ZERO, direction: Vec3::Z };
        let outside = Ray { origin: Vec3::new(0.0, 0.0, -3.0), direction: Vec3::Z };
        assert!(world.medium_along(&outside).is_none() && world.intersect(&outside, 9.0).is_some());
        let medium = world.medium(world.medium_along(&inside).expect("a medium"));
        (medium.at(Vec3::ZERO, &[450.0, 550.0, 650.0]), medium.asymmetry)
    };
    let (own, g) = below(
        "\"subsurface\" \"spectrum sigma_a\" [400 1 700 1] \"spectrum sigma_s\" [400 9 700 9] \"float scale\" 10 \"float g\" .8",
    );
    assert_eq!((own.absorption, own.scattering, g), ([10.0; 3], [90.0; 3], 0.8));
    let (skin, _) = below("\"subsurface\" \"string name\" \"Skin1\" \"float scale\" 1000");
    // The mean of 0.17 and what is beside it, per mm.
    assert!((skin.absorption[1] - 170.0).abs() < 60.0 && skin.absorption[0] > 2.0 * skin.absorption[2], "{skin:?}");
    // Light that is sent back more is absorbed less, whatever way it is scattered.
    let albedo = |kd: f64, g: f64| {
        let kd = format!("\"kdsubsurface\" \"spectrum Kd\" [400 {kd} 700 {kd}] \"float mfp\" .01 \"float g\" {g}");
        let of = below(&kd).0;
        assert!((of.absorption[0] + of.scattering[0] - 100.0).abs() < 1e-3, "{of:?}");
        of.scattering[0] / 100.0
    };
    let albedos = [0.1, 0.4, 0.8, 0.99].map(|kd| albedo(kd, 0.0));
    assert!(albedos.is_sorted() && albedos[0] > 0.5 && albedos[3] > 0.999 && albedos[3] < 1.0, "{albedos:?}");
    let of_forward = albedo(0.4, 0.7);
    assert!((of_forward * 0.3 / (1.0 - 0.7 * of_forward) - albedos[1]).abs() < 1e-4, "{of_forward}");
}

/// Curves of one material are one mesh, met where they are; hair has the color of its pigment.
#[test]
fn curves_are_met_and_hair_is_brown() {
    let text = "WorldBegin\nScale 2 2 2\nMaterial \"hair\" \"float eumelanin\" .5\n\
                Shape \"curve\" \"point3 P\" [0 -1 0  0 0 0  0 1 0  0 2 0] \"float width\" .1\n\
                Shape \"curve\" \"point3 P\" [1 -1 0  1 0 0  1 1 0  1 2 0] \"float width\" .1\n\
                Material \"diffuse\"\nShape \"curve\" \"point3 P\" [2 -1 0  2 0 0  2 1 0]\n";
    let world = read_text(text).unwrap();
    assert_eq!(world.n_primitives(), 24);
    let notes = world.notes().join("\n");
    assert!(notes.contains("a curve of 3 points") && !notes.contains("hair"), "{notes}");
    for x in [0.0, 2.0] {
        let found = hit(&world, [x, 0.0, -5.0], [0.0, 0.0, 1.0]).unwrap();
        assert!((found.distance_m - 4.9).abs() < 0.015, "{}", found.distance_m);
        let [blue, green, red] = world.bsdf(&found, Vec3::NEG_Z, &[450.0, 550.0, 650.0]).albedo();
        assert!(red > 1.2 * green && green > 1.5 * blue && blue > 0.0, "{blue} {green} {red}");
        assert!(hit(&world, [x + 0.11, 0.0, -5.0], [0.0, 0.0, 1.0]).is_none());
    }
}

#[test]
fn words_of_films_and_cameras_are_reported() {
    let notes = |film: &str, camera: &str| {
        let text = format!("Film \"rgb\" {film}\nCamera \"perspective\" {camera}\nWorldBegin\nShape \"sphere\"\n");
        read_text(&text).unwrap().notes().to_vec()
    };
    let film = "\"integer xresolution\" 30 \"integer yresolution\" 20 \"string filename\" \"a.exr\"";
    let with = |more: &str| format!("{film} {more}");
    assert_eq!(notes(&with("\"integer pixelbounds\" [ 0 30 0 20 ] \"float cropwindow\" [ 0 1 0 1 ]"), ""), [""; 0]);
    for part in ["\"integer pixelbounds\" [ 5 30 0 20 ]", "\"float cropwindow\" [ 0 .5 0 1 ]"] {
        let found = notes(&with(part), "");
        assert!(found.len() == 1 && found[0].contains("a part of the picture"), "{found:?}");
    }
    let found = notes(film, "\"float fov\" 30 \"string cauchyfile\" \"a.txt\" \"float shutteropen\" 0");
    assert_eq!(found, ["Camera \"perspective\": not supported and left out: cauchyfile"]);
}

/// The same scene in millimetres is the same world, light included.
#[test]
fn units_scale_lengths_and_keep_light() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("world.pbrt");
    std::fs::write(&path, SMALL).unwrap();
    let small =
        read_world(&path, &ReadOptions { metres_per_unit: 0.001, ..ReadOptions::default() }, &Cancel::new()).unwrap();
    let large = read(&path).unwrap();
    let ball = hit(&small, [0.002, 0.0, -0.005], [0.0, 0.0, 1.0]).unwrap();
    assert!((ball.distance_m - 0.0045).abs() < 1e-8);
    let at =
        |world: &World, p: Vec3| world.sample_light(p, 0.5, [0.3, 0.4], &[550.0]).map(|s| (s.direction, s.radiance));
    let (a, b) = (at(&small, Vec3::new(0.0, -1e-3, 0.0)), at(&large, Vec3::NEG_Y));
    let (Some((da, la)), Some((db, lb))) = (a, b) else { panic!("both are lit: {a:?} {b:?}") };
    assert!(da.abs_diff_eq(db, 1e-5) && (la[0] / lb[0] - 1.0).abs() < 1e-4, "{la:?} {lb:?}");
    let camera = &small.cameras()[0];
    assert!(camera.world_from_camera.translation.abs_diff_eq(DVec3::new(0.0, 0.001, -0.005), 1e-12));
    assert!(matches!(camera.kind, CameraKind::Perspective { focus_distance_m: 0.005, .. }));
}

#[test]
fn explicit_spectra_of_lights_keep_their_mean() {
    // A light of the third version has the radiance that it names; the fourth scales it to a weighted mean of 1.
    let text = r#"WorldBegin AreaLightSource "diffuse" "spectrum L" [ 360 3 830 3 ] "float scale" 2 Shape "sphere" "#;
    let radiance = |text: &str| {
        let world = read_text(text).unwrap();
        let ball = hit(&world, [0.0, 0.0, -5.0], [0.0, 0.0, 1.0]).unwrap();
        world.emission(&ball, Vec3::NEG_Z, &[550.0])[0]
    };
    assert!((radiance(text) - 2.0).abs() < 1e-5);
    assert!((radiance(&format!("{text} WorldEnd")) - 6.0).abs() < 1e-5);
}

/// `power` and `illuminance` of pbrt's 4th version multiply what a light gives by itself: the flux of a point into all directions, of a cone with half its
/// edge, of a Lambertian surface π A L, each side counted; the illuminance by a sky π L.
#[test]
fn power_and_illuminance_set_the_light() {
    use std::f64::consts::PI;
    // What falls on the origin, which faces it, or comes to it.
    let light = |text: String, metres_per_unit: f64| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("world.pbrt");
        std::fs::write(&path, format!("WorldBegin {text}")).unwrap();
        let world =
            read_world(&path, &ReadOptions { metres_per_unit, ..ReadOptions::default() }, &Cancel::new()).unwrap();
        let sample = world.sample_light(Vec3::ZERO, 0.5, [0.3, 0.4], &[550.0]);
        (f64::from(sample.expect("a light that is seen").radiance[0]), world.notes().to_vec())
    };
    let ratio = |with: &str, of: &dyn Fn(&str) -> String| {
        [1.0, 0.001].map(|unit| light(of(with), unit).0 / light(of(""), unit).0)
    };
    let check = |with: &str, expected: f64, of: &dyn Fn(&str) -> String| {
        for found in ratio(with, of) {
            assert!((found / expected - 1.0).abs() < 1e-5, "{}: {found}, not {expected}", of(with));
        }
    };
    let point = |with: &str| format!(r#"LightSource "point" "point3 from" [0 0 2] {with}"#);
    check(r#""float power" 30 "float scale" 2"#, 2.0 * 30.0 / (4.0 * PI), &point);
    let spot = |with: &str| {
        format!(
            r#"LightSource "spot" "point3 from" [0 0 2] "point3 to" [0 0 0] "float coneangle" 40 "float conedeltaangle" 10 {with}"#
        )
    };
    let solid_angle = 2.0 * PI * (1.0 - 0.5 * (30f64.to_radians().cos() + 40f64.to_radians().cos()));
    check(r#""float power" 30"#, 30.0 / solid_angle, &spot);
    let distant = |with: &str| format!(r#"LightSource "distant" "point3 from" [0 0 1] "point3 to" [0 0 0] {with}"#);
    check(r#""float illuminance" 500"#, 500.0, &distant);
    let sky = |with: &str| format!(r#"LightSource "infinite" {with}"#);
    check(r#""float illuminance" 500 "float scale" 3"#, 1500.0 / PI, &sky);
    let of_shape = |shape: &'static str| {
        move |with: &str| format!(r#"AreaLightSource "diffuse" {with} Translate 0 0 3 Rotate 180 1 0 0 {shape}"#)
    };
    let disc = of_shape(r#"Scale 2 2 2 Shape "disk" "float radius" 0.5"#);
    check(r#""float power" 7"#, 7.0 / (PI * PI), &disc);
    check(r#""float power" 7 "bool twosided" true"#, 7.0 / (2.0 * PI * PI), &disc);
    check(r#""float power" 7"#, 7.0 / (PI * 4.0 * PI * 0.25), &of_shape(r#"Shape "sphere" "float radius" 0.5"#));
    check(
        r#""float power" 7"#,
        7.0 / (PI * 2.0 * PI * 0.5),
        &of_shape(r#"Rotate 90 1 0 0 Shape "cylinder" "float radius" 0.5 "float zmin" 0 "float zmax" 1"#),
    );
    // Each triangle of 4.5 square units is a light of its own, and each patch.
    let square = r#""point3 P" [-1.5 -1.5 0  1.5 -1.5 0  1.5 1.5 0  -1.5 1.5 0] "integer indices" [0 1 2 0 2 3]"#;
    let mesh = move |with: &str| of_shape("")(with) + &format!(r#"Shape "trianglemesh" {square}"#);
    check(r#""float power" 7"#, 7.0 / (PI * 4.5), &mesh);
    let patch = r#""point3 P" [-1.5 -1.5 0  1.5 -1.5 0  -1.5 1.5 0  1.5 1.5 0]"#;
    let patch = move |with: &str| of_shape("")(with) + &format!(r#"Shape "bilinearmesh" {patch}"#);
    check(r#""float power" 7"#, 7.0 / (PI * 9.0), &patch);
    // Of unequal triangles, 1 and 3 square units, all emit the same radiance, which a note states.
    let unequal =
        r#"Shape "trianglemesh" "point3 P" [-1 -1 0  1 -1 0  -1 0 0  -1 -4 0] "integer indices" [0 1 2 0 3 1]"#;
    let unequal = of_shape(unequal);
    check(r#""float power" 7"#, 14.0 / (PI * 4.0), &unequal);
    let (_, notes) = light(unequal(r#""float power" 7"#), 1.0);
    assert!(notes.iter().any(|note| note.contains("2 faces of unequal areas")), "{notes:?}");
    // As without.
    check(r#""float power" -1"#, 1.0, &point);
    // Earlier versions don't know the words.
    let third = |with: &str| format!("{} WorldEnd", point(with));
    check(r#""float power" 30"#, 1.0, &third);
    let (_, notes) = light(third(r#""float power" 30"#), 1.0);
    assert!(notes.iter().any(|note| note.contains("left out: power")), "{notes:?}");
}

/// A black body is scaled to a peak of 1 at its own wavelength, be that beyond the visible, in textures and lights alike; the fourth
/// version scales lights to a photopic mean of 1.
#[test]
fn black_bodies_peak_at_one() {
    // (1450 nm / 550 nm)⁵ (e^4.965114 − 1)/(e^13.0798 − 1) of 2000 K, and the like of 6500 K.
    let share = |kelvin: f64| {
        let x = 1.438_776_877e7 / (550.0 * kelvin);
        ((x / 4.965_114_232).powi(5) * 4.965_114_232_f64.exp_m1() / x.exp_m1()) as f32
    };
    let glow = |kelvin: f64, words: &str, end: &str| {
        let light = words.replace('@', &format!("[ {kelvin} ]"));
        let world = read_text(&format!("WorldBegin {light} Shape \"sphere\" {end}")).unwrap();
        assert_eq!(world.notes(), [""; 0]);
        let ball = hit(&world, [0.0, 0.0, -5.0], [0.0, 0.0, 1.0]).unwrap();
        let emission = world.emission(&ball, Vec3::NEG_Z, &[550.0])[0];
        let albedo = world.bsdf(&ball, Vec3::NEG_Z, &[550.0]).albedo()[0];
        (emission, albedo)
    };
    for kelvin in [2000.0, 6500.0] {
        let share = share(kelvin);
        let is_share = |value: f32, factor: f32| (value / (factor * share) - 1.0).abs() < 1e-5;
        let area = "AreaLightSource \"diffuse\" \"blackbody L\" @ \"float scale\" 3";
        assert!(is_share(glow(kelvin, area, "WorldEnd").0, 3.0), "{kelvin}");
        // The same curve by another factor, whose photopic mean is 3.
        let by_version_4 = glow(kelvin, area, "").0 / share;
        let planck = |nm: f64| {
            (nm / 550.0).powi(-5) * (2.61596e4 / kelvin).exp_m1() / (1.438_776_877e7 / (nm * kelvin)).exp_m1()
        };
        let grid = WavelengthGrid::uniform(380.0, 780.0, 5.0).unwrap();
        let weights = &Observer::Cie1931.weights(&grid)[1];
        let weighted: f64 = grid.centers_nm().iter().zip(weights).map(|(&nm, weight)| weight * planck(nm)).sum();
        let expected = 3.0 * weights.iter().sum::<f64>() / weighted / f64::from(share);
        assert!((f64::from(by_version_4) / expected - 1.0).abs() < 1e-3, "{kelvin}: {by_version_4} {expected}");
        for texture in [
            "Material \"diffuse\" \"blackbody reflectance\" @",
            "Texture \"warm\" \"spectrum\" \"constant\" \"blackbody value\" @ Material \"diffuse\" \"texture reflectance\" \"warm\"",
            "Texture \"warm\" \"spectrum\" \"scale\" \"blackbody tex\" @ \"float scale\" 1 Material \"diffuse\" \"texture reflectance\" \"warm\"",
            "Texture \"warm\" \"spectrum\" \"mix\" \"blackbody tex1\" @ \"blackbody tex2\" @ Material \"diffuse\" \"texture reflectance\" \"warm\"",
        ] {
            assert!(is_share(glow(kelvin, texture, "").1, 1.0), "{texture}");
        }
    }
    // The third version has a factor after the temperature.
    let with_factor = "WorldBegin LightSource \"infinite\" \"blackbody L\" [ 2000 5 ] WorldEnd";
    let sky = read_text(with_factor).unwrap().sky(Vec3::Y, &[550.0])[0];
    assert!((sky / (5.0 * share(2000.0)) - 1.0).abs() < 1e-5, "{sky}");
}

#[test]
fn faults_are_named_with_their_line() {
    for (text, line, word) in [
        ("WorldBegin\nShape sphere", 2, "quotes"),
        ("WorldBegin\nShap \"sphere\"", 2, "Shap"),
        ("WorldBegin\n\nTranslate 1 2", 3, "3 numbers"),
        ("WorldBegin\nTranslate 1 2 1e999", 2, "1e999"),
        ("WorldBegin\nShape \"sphere\" \"float radius\" -1", 2, "radius"),
        ("WorldBegin\nShape \"trianglemesh\" \"integer indices\" [0 1 9] \"point P\" [0 0 0 1 0 0 0 1 0]", 2, "9"),
        ("WorldBegin\nAttributeEnd", 2, "AttributeEnd"),
        ("WorldBegin\nScale 0 0 0\nShape \"sphere\"", 3, "flattens"),
        ("LookAt 0 0 0  0 0 0  0 1 0", 1, "LookAt"),
        ("WorldBegin\nMaterial \"matte\" \"spectrum Kd\" [ 400 1 300 1 ]", 2, "300"),
        ("WorldBegin\nShape \"sphere", 2, "quoted"),
    ] {
        let message = read_text(text).unwrap_err().to_string();
        let is_named = message.contains("world.pbrt") && message.contains(&format!("line {line}:"));
        assert!(is_named && message.contains(word), "{text}: {message}");
    }
}

/// Names that nothing has are noted, each kind in one sentence with its count, and the rest of the world is read.
#[test]
fn unknown_names_are_notes() {
    let text = "WorldBegin\nNamedMaterial \"none of these\"\nObjectInstance \"x\"\nCoordSysTransform \"nowhere\"\n\
                Material \"matte\" \"texture Kd\" \"gone\"\nMaterial \"velvet\"\nShape \"torus\"\nShape \"sphere\"\n\
                Texture \"a\" \"float\" \"imagemap\" \"string filename\" \"1.png\"\n\
                Texture \"b\" \"float\" \"imagemap\" \"string filename\" \"2.png\"\n";
    let world = read_text(text).unwrap();
    assert_eq!(world.n_primitives(), 1);
    for word in ["none of these", "x", "nowhere", "gone", "velvet", "torus", "1.png, 2.png"] {
        assert!(world.notes().iter().any(|note| note.ends_with(&format!(": {word}"))), "{word}: {:?}", world.notes());
    }
}

/// Bytes before the text, packed files and places of the camera are read as the programs that wrote them mean.
#[test]
fn marks_packing_and_coordinates_of_the_camera_are_read() {
    use std::io::Write;
    let text = "\u{feff}LookAt 0 0 -5  0 0 0  0 1 0\nCamera \"omni\" \"string lensfile\" \"a.dat\" \"float filmdistance\" 0.05\n\
                WorldBegin\nCoordSysTransform \"camera\"\nTranslate 0 0 2\nShape \"sphere\" \"float radius\" 0.5\n";
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("world.pbrt.gz");
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    packed.write_all(text.as_bytes()).unwrap();
    std::fs::write(&path, packed.finish().unwrap()).unwrap();
    let world = read(&path).unwrap();
    // 2 m before the camera.
    let ball = hit(&world, [0.0, 0.0, -5.0], [0.0, 0.0, 1.0]).unwrap();
    assert!((ball.distance_m - 1.5).abs() < 1e-5, "{}", ball.distance_m);
    // ISET's omni camera counts in metres.
    let CameraKind::Lens { film_distance_mm, .. } = world.cameras()[0].kind else { panic!("{:?}", world.cameras()) };
    assert_eq!(film_distance_mm, Some(50.0));
}

#[test]
fn files_that_include_themselves_end() {
    let message = read_text("Include \"world.pbrt\"").unwrap_err().to_string();
    assert!(message.contains("deeper"), "{message}");
    assert!(read_text("Include \"gone.pbrt\"").unwrap().notes()[0].contains("gone.pbrt"));
}

#[test]
fn cancelled_reading_stops() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("world.pbrt");
    std::fs::write(&path, SMALL).unwrap();
    let cancel = Cancel::new();
    cancel.cancel();
    assert!(matches!(read_world(&path, &ReadOptions::default(), &cancel), Err(WorldError::Cancelled(_))));
}

#[test]
fn unknown_kinds_are_refused() {
    assert!(read(Path::new("world.xyz")).unwrap_err().to_string().contains(".pbrt"));
    assert!(read(Path::new("gone.pbrt")).unwrap_err().to_string().contains("gone.pbrt"));
}

/// A world with some bytes changed, moved, copied or cut out is a world or one sentence.
#[test]
fn every_seed_is_read_and_hundreds_of_its_mutants_end_in_a_world_or_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    write_beside(folder.path());
    for (name, seed) in seeds() {
        assert!(mutate::read(folder.path(), name, seed), "{name}: {:?}", read(&folder.path().join(name)).err());
        let n_read = (0..500).filter(|&number| mutate::read(folder.path(), name, &mutant(seed, number))).count();
        // Some changes are harmless and most are not: else the readers, or the mutants, would be asleep.
        assert!((5..495).contains(&n_read), "{name}: {n_read} of 500 mutants were read");
    }
}

/// Our own Figure 4: every word of it is understood, and its camera is in focus on the eye before a wall of bricks.
#[test]
fn metronome_is_in_focus_on_its_eye() {
    let world = read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/worlds/metronome.pbrt")).unwrap();
    assert!(world.notes().is_empty(), "{:?}", world.notes());
    let names: Vec<&str> = world.material_names().collect();
    let camera = &world.cameras()[0];
    let origin = camera.world_from_camera.translation.as_vec3();
    // Along the axis, and towards points of the picture plane 1 m ahead.
    let seen = |x: f64, y: f64| {
        let direction = camera.world_from_camera.transform_vector3(DVec3::new(x, y, 1.0)).normalize().as_vec3();
        let hit = world
            .intersect(&Ray { origin, direction }, f32::INFINITY)
            .expect("the floor and the wall fill the picture");
        let depth_m = hit.distance_m * (x * x + y * y + 1.0).sqrt().recip() as f32;
        (names[hit.material.0 as usize], depth_m)
    };
    let (name, depth_m) = seen(0.0, 0.0);
    // 1/50 mm − 1/137 mm = 1/78.74 mm.
    assert!(name == "ink" && (depth_m - 0.07874).abs() < 2e-4, "{name} {depth_m}");
    let corners = [(-0.17, 0.15), (0.17, 0.15), (0.0, -0.17), (-0.02, 0.0)].map(|(x, y)| seen(x, y).0);
    assert!(corners[0].starts_with("brick") || corners[0] == "mortar", "{corners:?}");
    assert!(corners[1].starts_with("brick") || corners[1] == "mortar", "{corners:?}");
    // The ray at −0.17 is 10 mm below the origin at the body's front; the dial reaches down to 11.5 mm.
    assert!(corners[2] == "dial" && corners[3] == "iris", "{corners:?}");
    // Illuminance on the eye, facing the flash: a few thousand lux, as a flash lamp gives.
    let eye = seen(0.0, 0.0).1 * camera.world_from_camera.transform_vector3(DVec3::Z).as_vec3() + origin;
    let lit: f32 = (0..64)
        .filter_map(|i| world.sample_light(eye, (i as f32 + 0.5) / 64.0, [0.5, 0.5], &[555.0]))
        .filter(|sample| sample.is_delta)
        .map(|sample| sample.radiance[0] / sample.pdf / 64.0)
        .sum();
    assert!((500.0..20_000.0).contains(&(lit * 72_983.0)), "{} lx", lit * 72_983.0);
}

fn shared(place: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared").join(place)
}

#[dioptric_golden::needs_shared]
#[test]
fn all_reference_scenes_load() {
    let folders = ["data/scenes3d", "data/paper/indestructibleObject", "reference/render"];
    let mut paths: Vec<PathBuf> = folders.iter().map(|folder| shared(folder)).collect();
    let mut worlds = 0;
    while let Some(path) = paths.pop() {
        if path.is_dir() {
            paths.extend(path.read_dir().unwrap().map(|entry| entry.unwrap().path()));
            continue;
        }
        let kind = path.extension().map(|e| e.to_string_lossy().into_owned());
        if !matches!(kind.as_deref(), Some("pbrt" | "ply" | "obj" | "gltf" | "glb")) {
            continue;
        }
        // Parts of files that are included by others name materials that aren't theirs.
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if name.ends_with("_geometry.pbrt") || name == "default-geom.pbrt" {
            continue;
        }
        let world = read(&path).unwrap_or_else(|error| panic!("{error}"));
        println!(
            "{}: {} primitives, {} lights, notes {:?}",
            path.display(),
            world.n_primitives(),
            world.n_lights(),
            world.notes()
        );
        worlds += 1;
    }
    assert!(worlds > 20, "{worlds}");
}

/// The paper's Figure 4: its object is met where its camera looks, and its materials have their textures.
#[dioptric_golden::needs_shared]
#[test]
fn figure_4_is_seen_by_its_camera() {
    let path = shared("data/paper/indestructibleObject/mainDefocused.pbrt");
    let world =
        read_world(&path, &ReadOptions { metres_per_unit: 0.001, ..ReadOptions::default() }, &Cancel::new()).unwrap();
    let camera = &world.cameras()[0];
    let CameraKind::Lens { focal_length_mm, film_distance_mm, film_diagonal_mm, .. } = camera.kind else {
        panic!("{camera:?}")
    };
    assert_eq!((focal_length_mm, film_distance_mm, film_diagonal_mm), (Some(50.0), Some(137.0), 70.0));
    // In focus at 1/f − 1/137 mm: about 79 mm, where FIGURES has the object.
    let origin = camera.world_from_camera.translation.as_vec3();
    let forwards = camera.world_from_camera.transform_vector3(DVec3::Z).normalize().as_vec3();
    let seen = world.intersect(&Ray { origin, direction: forwards }, f32::INFINITY).expect("the object is ahead");
    assert!((0.05..0.12).contains(&seen.distance_m), "{}", seen.distance_m);
    let missing: Vec<_> = world.notes().iter().filter(|note| note.contains("brickDiffuse")).collect();
    assert!(missing.is_empty(), "{missing:?}");
    assert!(world.notes().iter().any(|note| note.contains("rockDiffuse.tga")), "{:?}", world.notes());
}
