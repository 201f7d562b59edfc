//! Worlds changed by name before they are built.

#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::{fs, sync::Arc};

use dioptric_spectrum::Cancel;
use dioptric_world::{
    Density, Emission, Field, FilledBox, Filling, Interface, Light, Material, MaterialId, Medium, Ray, ReadOptions,
    Shape, SpectralCurve, Texture, TriangleMesh, World, WorldBuilder,
    glam::{DAffine3, DVec3, Vec3},
    open_world, write_world,
};

fn matte(builder: &mut WorldBuilder, reflectance: f32) -> MaterialId {
    let texture = builder.add_texture(Texture::Curve(SpectralCurve::constant(reflectance)));
    builder.add_material(&format!("gray {reflectance}"), Material::Matte { reflectance: texture })
}

/// Two balls of 0.5 m, at x = 0 and x = 3, and a block beneath; a point light above.
fn room() -> WorldBuilder {
    let mut builder = WorldBuilder::new();
    let gray = matte(&mut builder, 0.5);
    builder.begin_object("balls");
    for (name, x) in [("left", 0.0), ("right", 3.0)] {
        builder.begin_object(name);
        let place = DAffine3::from_translation(DVec3::X * x);
        builder.add_shape(Shape::Sphere { radius_m: 0.5 }, place, gray, None);
        builder.end_object();
    }
    builder.end_object();
    builder.name_next("floor");
    let block = TriangleMesh::block(Vec3::new(-4.0, -2.0, -4.0), Vec3::new(4.0, -1.0, 4.0));
    builder.add_shape(Shape::Mesh(block), DAffine3::IDENTITY, gray, None);
    let intensity = SpectralCurve::constant(1.0);
    builder.add_light(Light::Point { position: DVec3::Y * 2.0, intensity });
    builder
}

/// How far a ray from z = 10 towards −z goes.
fn met(world: &World, x: f32, y: f32) -> Option<(f32, String)> {
    let hit = world.intersect(&Ray { origin: Vec3::new(x, y, 10.0), direction: Vec3::NEG_Z }, f32::INFINITY)?;
    Some((hit.distance_m, world.object_names()[world.object_of(&hit)].clone()))
}

#[test]
fn what_is_moved_is_there() {
    let mut builder = room();
    builder.move_object("left", DVec3::new(0.0, 1.0, 2.0)).unwrap();
    builder.move_object_to("right", DVec3::new(-1.0, 0.0, 1.0)).unwrap();
    let world = builder.build().unwrap();
    assert_eq!(met(&world, 0.0, 1.0), Some((7.5, "left".to_owned())));
    assert_eq!(met(&world, -1.0, 0.0), Some((8.5, "right".to_owned())));
    assert_eq!(met(&world, 3.0, 0.0), None);
    assert_eq!(met(&world, 0.0, -1.5), Some((6.0, "floor".to_owned())));
}

#[test]
fn parts_go_with_what_they_are_parts_of() {
    let mut builder = room();
    assert_eq!(builder.bounds_of_object("balls").unwrap(), Some([DVec3::splat(-0.5), DVec3::new(3.5, 0.5, 0.5)]));
    // A quarter turn about y takes x to −z, about the middle at x = 1.5.
    builder.turn_object("balls", DVec3::Y, std::f64::consts::FRAC_PI_2, None).unwrap();
    let [low, high] = builder.bounds_of_object("balls").unwrap().unwrap();
    assert!(low.abs_diff_eq(DVec3::new(1.0, -0.5, -2.0), 1e-12), "{low}");
    assert!(high.abs_diff_eq(DVec3::new(2.0, 0.5, 2.0), 1e-12), "{high}");
    let [left, _] = builder.bounds_of_object("left").unwrap().unwrap();
    assert!(left.abs_diff_eq(DVec3::new(1.0, -0.5, 1.0), 1e-12), "{left}");
    // Twice as large about the floor they stand on.
    builder.scale_object("balls", DVec3::splat(2.0), Some(DVec3::NEG_Y * 0.5)).unwrap();
    let [low, high] = builder.bounds_of_object("balls").unwrap().unwrap();
    assert!(low.abs_diff_eq(DVec3::new(2.0, -0.5, -4.0), 1e-12) && high.y == 1.5, "{low} {high}");
    assert_eq!(builder.find_objects("b*").unwrap(), ["balls", "left", "right"]);
    builder.remove_object("balls").unwrap();
    let names: Vec<String> = builder.objects().into_iter().map(|object| object.name).collect();
    assert_eq!(names, ["floor", "point light"]);
    assert_eq!(met(&builder.build().unwrap(), 2.0, 0.0), None);
}

#[test]
fn copies_stand_beside_what_they_are_of() {
    let mut builder = room();
    assert_eq!(builder.copy_object("left", "third").unwrap(), ["third"]);
    assert_eq!(builder.copy_object("balls", "balls").unwrap(), ["balls.2"]);
    builder.move_object("third", DVec3::X * -2.0).unwrap();
    builder.move_object("balls.2", DVec3::Y * 3.0).unwrap();
    let dark = matte(&mut builder, 0.1);
    builder.set_material_of("third", dark).unwrap();
    let info = builder.objects();
    let third = info.iter().find(|object| object.name == "third").unwrap();
    assert_eq!((third.materials[0].as_str(), third.parent.as_deref()), ("gray 0.1", Some("balls")));
    let world = builder.build().unwrap();
    assert_eq!(met(&world, -2.0, 0.0), Some((9.5, "third".to_owned())));
    assert_eq!(met(&world, 0.0, 0.0), Some((9.5, "left".to_owned())));
    assert_eq!(met(&world, 3.0, 3.0), Some((9.5, "right.2".to_owned())));
}

#[test]
fn instances_are_objects_and_their_materials_their_own() {
    let mut builder = WorldBuilder::new();
    let gray = matte(&mut builder, 0.5);
    let group = builder.add_group();
    builder.add_shape_to(group, Shape::Sphere { radius_m: 0.5 }, DAffine3::IDENTITY, gray, None);
    for x in [0.0, 2.0] {
        builder.name_next("tree");
        builder.add_instance(group, DAffine3::from_translation(DVec3::X * x));
    }
    let dark = matte(&mut builder, 0.1);
    builder.set_material_of("tree.2", dark).unwrap();
    builder.move_object("tree.2", DVec3::Y).unwrap();
    let world = builder.build().unwrap();
    let at = |x: f32, y: f32| {
        let ray = Ray { origin: Vec3::new(x, y, 5.0), direction: Vec3::NEG_Z };
        let hit = world.intersect(&ray, f32::INFINITY).unwrap();
        (world.object_names()[world.object_of(&hit)].clone(), world.bsdf(&hit, Vec3::Z, &[550.0]).albedo()[0])
    };
    assert_eq!(at(0.0, 0.0), ("tree".to_owned(), 0.5));
    assert_eq!(at(2.0, 1.0), ("tree.2".to_owned(), 0.1));
}

#[test]
fn lights_are_objects() {
    let mut builder = room();
    builder.name_next("pane");
    let gray = builder.material_named("gray 0.5").unwrap();
    let quad = TriangleMesh::quad(Vec3::ZERO, Vec3::X, Vec3::Y);
    let emission = Emission { radiance: SpectralCurve::constant(2.0), is_two_sided: false };
    builder.add_shape(Shape::Mesh(quad), DAffine3::IDENTITY, gray, Some(emission));
    builder.move_object("point light", DVec3::X).unwrap();
    builder.brighten_object("point light", 3.0).unwrap();
    builder.brighten_object("pane", 0.5).unwrap();
    let level = |builder: &WorldBuilder, name: &str| {
        let object = builder.objects().into_iter().find(|object| object.name == name).unwrap();
        object.light.map(|light| (light.unit, light.value))
    };
    // An even spectrum of 1 per nm is 72 983 cd.
    let (unit, candela) = level(&builder, "point light").unwrap();
    assert!(unit == "cd" && (candela / (3.0 * 72_983.0) - 1.0).abs() < 1e-3, "{candela}");
    let (unit, luminance) = level(&builder, "pane").unwrap();
    assert!(unit == "cd/m²" && (luminance / 72_983.0 - 1.0).abs() < 1e-3, "{luminance}");
    assert_eq!(level(&builder, "left"), None);
    let error = builder.brighten_object("left", 2.0).unwrap_err().to_string();
    assert_eq!(error, "the object to brighten is 'left': expected one that gives light");
    builder.remove_object("pane").unwrap();
    let world = builder.build().unwrap();
    let light = world.sample_light(Vec3::new(1.0, 0.0, 0.0), 0.5, [0.5; 2], &[550.0]).unwrap();
    assert_eq!((light.direction, light.distance_m, light.radiance), (Vec3::Y, 2.0, [0.75]));
}

/// A part that has z up and another hand stands upright in a world of glTF's frame.
#[test]
fn parts_are_put_in_by_their_up() {
    let mut part = room();
    part.set_up(DVec3::Z, false);
    part.name_next("mast");
    let gray = part.material_named("gray 0.5").unwrap();
    let mast = TriangleMesh::block(Vec3::new(-0.1, -0.1, 1.0), Vec3::new(0.1, 0.1, 9.0));
    part.add_shape(Shape::Mesh(mast), DAffine3::IDENTITY, gray, None);
    let mut builder = room();
    let place = DAffine3::from_translation(DVec3::new(0.0, 0.0, -20.0));
    assert_eq!(builder.add_world(part, "part", place).unwrap(), "part");
    let [low, high] = builder.bounds_of_object("mast").unwrap().unwrap();
    assert!(low.abs_diff_eq(DVec3::new(-0.1, 1.0, -20.1), 1e-6), "{low}");
    assert!(high.abs_diff_eq(DVec3::new(0.1, 9.0, -19.9), 1e-6), "{high}");
    builder.move_object("part", DVec3::X * 100.0).unwrap();
    let info = builder.objects();
    let left = info.iter().find(|object| object.name == "left.2").unwrap();
    assert_eq!((left.parent.as_deref(), left.materials[0].as_str()), (Some("balls.2"), "gray 0.5"));
    assert!(left.bounds_m.unwrap()[0].x > 99.0);
    let world = builder.build().unwrap();
    let (distance_m, name) = met(&world, 100.0, 8.0).unwrap();
    assert!((distance_m - 29.9).abs() < 1e-5 && name == "mast");
    assert_eq!(world.n_lights(), 2);
}

#[test]
fn wrong_names_and_transforms_are_told() {
    let mut builder = room();
    for (name, expected) in [
        ("lft", "no object is called 'lft': near it are 'left'"),
        ("Right*", "no object is called 'Right*': near it are 'right'"),
        ("x", "no object is called 'x': there are 'balls', 'left', 'right', 'floor', 'point light'"),
    ] {
        assert_eq!(builder.move_object(name, DVec3::X).unwrap_err().to_string(), expected);
    }
    let flat = builder.scale_object("left", DVec3::new(1.0, 0.0, 1.0), None).unwrap_err().to_string();
    assert!(flat.contains("expected a finite transform"), "{flat}");
    assert!(builder.turn_object("left", DVec3::ZERO, 1.0, None).is_err());
    let error = builder.material_named("gray").unwrap_err().to_string();
    assert_eq!(error, "no material is called 'gray': near it are 'gray 0.5'");
}

#[test]
fn files_name_their_objects() {
    let folder = tempfile::tempdir().unwrap();
    let names = |file: &str, text: &str| -> Vec<String> {
        let path = folder.path().join(file);
        fs::write(&path, text).unwrap();
        let builder = open_world(&path, &ReadOptions::default(), &Cancel::new()).unwrap();
        builder.objects().into_iter().map(|object| object.name).collect()
    };
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    assert_eq!(names("a.obj", &format!("{triangle}o lid\nf 1 2 3\no pot\nf 1 2 3\n")), ["lid", "pot"]);
    assert_eq!(names("b.obj", &format!("{triangle}f 1 2 3\n")), ["b"]);
    fs::write(
        folder.path().join("cup.ply"),
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
         element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
    )
    .unwrap();
    let pbrt = "WorldBegin\nMakeNamedMaterial \"tiles\" \"string type\" \"diffuse\"\n\
        Shape \"sphere\"\nShape \"plymesh\" \"string filename\" \"cup.ply\"\n\
        AttributeBegin\nNamedMaterial \"tiles\"\nShape \"disk\"\n\
        #ObjectName Chair:Vector(0, 1, 2)\nShape \"sphere\"\nAttributeEnd\nShape \"disk\"\n\
        ObjectBegin \"tree\"\nShape \"sphere\"\nObjectEnd\nObjectInstance \"tree\"\nObjectInstance \"tree\"\n\
        LightSource \"point\"\n";
    let expected = ["sphere", "cup", "tiles", "Chair", "disc", "tree", "tree.2", "point light"];
    assert_eq!(names("c.pbrt", pbrt), expected);
    let gltf = r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "car", "children": [1, 2]}, {"name": "lamp", "extensions": {"KHR_lights_punctual": {"light": 0}}}, {}],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point"}]}}}"#;
    assert_eq!(names("d.gltf", gltf), ["car", "lamp", "node 2"]);
}

/// A ball of 0.5 m at the origin that a grid fills, by the name "smoke", and another that milk fills.
fn smoke_and_milk() -> WorldBuilder {
    let mut builder = WorldBuilder::new();
    let open = builder.add_material("nothing", Material::Open);
    let curve = SpectralCurve::constant;
    let place = DAffine3::from_translation(DVec3::splat(-0.5));
    let field = Field::new([2, 1, 1], 1, vec![1.0, 3.0]).unwrap();
    let density = Density::Box(Arc::new(FilledBox::new(place, Filling::Numbers(field))));
    let smoke = builder.add_medium(Medium { density, ..Medium::even(curve(0.0), curve(2.0), 0.3) });
    let milk = builder.add_medium(Medium::even(curve(0.25), curve(4.0), 0.75));
    for (name, x, medium) in [("smoke", 0.0, smoke), ("milk", 3.0, milk)] {
        builder.name_next(name);
        let place = DAffine3::from_translation(DVec3::X * x);
        let ball = builder.add_shape(Shape::Sphere { radius_m: 0.5 }, place, open, None);
        builder.set_interface(ball, Interface { inside: Some(medium), outside: None });
    }
    builder
}

/// What is scattered and absorbed at a point, 1/m, by what a ray towards it is in there.
fn at(world: &World, point: Vec3) -> Option<[f32; 2]> {
    let ray = Ray { origin: point - 2.0 * Vec3::Z, direction: Vec3::Z };
    let met = world.meet(&ray, 2.0)?;
    let medium = world.medium(world.medium_towards(&met.hit, ray.direction, None)?);
    let found = medium.at(point, &[550.0]);
    Some([found.scattering[0], found.absorption[0]])
}

/// What fills a shape goes with it, and into a world that it is put into.
#[test]
fn media_go_with_their_shapes() {
    let own = smoke_and_milk().build().unwrap();
    // Linear between the middles of the two cells.
    let expected = [0.0, 0.2].map(|x| at(&own, Vec3::new(x, 0.0, 0.0)).unwrap());
    assert!((expected[0][0] - 4.0).abs() < 1e-5 && expected[1][0] > 5.0, "{expected:?}");
    let mut builder = smoke_and_milk();
    let copies = builder.copy_object("smoke", "copy").unwrap();
    builder.move_object(&copies[0], DVec3::new(0.0, 4.0, 0.0)).unwrap();
    builder.remove_object("smoke").unwrap();
    let moved = builder.clone().build().unwrap();
    assert_eq!(at(&moved, Vec3::ZERO), None);
    for (x, expected) in [0.0, 0.2].into_iter().zip(expected) {
        let found = at(&moved, Vec3::new(x, 4.0, 0.0)).unwrap();
        assert!((found[0] - expected[0]).abs() < 1e-5, "{found:?} {expected:?}");
    }
    assert_eq!(at(&moved, Vec3::X * 3.0), Some([4.0, 0.25]));
    let mut whole = smoke_and_milk();
    whole.add_world(builder, "more", DAffine3::from_translation(DVec3::Z * -6.0)).unwrap();
    let whole = whole.build().unwrap();
    assert_eq!(at(&whole, Vec3::ZERO), Some(expected[0]));
    let found = at(&whole, Vec3::new(0.2, 4.0, -6.0)).unwrap();
    assert!((found[0] - expected[1][0]).abs() < 1e-5, "{found:?}");
    assert_eq!(at(&whole, Vec3::new(3.0, 0.0, -6.0)), Some([4.0, 0.25]));
}

/// pbrt's files hold even media, that around the camera too; what differs from place to place is named.
#[test]
fn even_media_are_written() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("media.pbrt");
    let mut builder = smoke_and_milk();
    let fog = builder.add_medium(Medium::even(SpectralCurve::constant(0.5), SpectralCurve::constant(0.1), 0.0));
    let camera = r#"LookAt 0 0 -9  0 0 0  0 1 0
Camera "perspective" "float fov" 40
WorldBegin
"#;
    fs::write(folder.path().join("camera.pbrt"), camera).unwrap();
    let of_camera = open_world(&folder.path().join("camera.pbrt"), &ReadOptions::default(), &Cancel::new()).unwrap();
    of_camera.build().unwrap().cameras().iter().for_each(|camera| builder.add_camera(camera.clone()));
    builder.set_medium_at(DVec3::Z * -9.0, fog);
    let losses = write_world(&builder, &file, false).unwrap();
    assert!(losses.iter().any(|loss| loss.contains("differ from place to place")), "{losses:?}");
    let read = open_world(&file, &ReadOptions::default(), &Cancel::new()).unwrap().build().unwrap();
    let found = at(&read, Vec3::X * 3.0).unwrap();
    assert!((found[0] - 4.0).abs() < 1e-4 && (found[1] - 0.25).abs() < 1e-5, "{found:?}");
    let away = Ray { origin: Vec3::new(0.0, 0.0, -9.0), direction: Vec3::Y };
    let fog = read.medium(read.medium_along(&away).unwrap()).at(Vec3::ZERO, &[550.0]);
    assert!((fog.absorption[0] - 0.5).abs() < 1e-4 && (fog.scattering[0] - 0.1).abs() < 1e-5, "{fog:?}");
}
