//! Gathered views against closed forms, against paths, and against each other.

use std::sync::Mutex;

use dioptric_backward::{
    BackwardError, BandSampling, Bands, Camera, GatheredView, LightPaths, Pinhole, PixelGrid, Placement,
    RenderSettings, Renderer, ViewDetail, gathered_view, layered_depth,
};
use dioptric_spectrum::{Cancel, SpectralImage, WavelengthGrid};
use dioptric_world::{
    CameraKind, Emission, Light, Material, ReadOptions, Relief, Shape, SpectralCurve, Texture, TextureId, TriangleMesh,
    World, WorldBuilder,
    glam::{DAffine3, DVec2, DVec3, Vec3},
    read_world,
};

fn pinhole(columns: usize, rows: usize, half_tan: f64) -> Pinhole {
    let half_tangents = half_tan * DVec2::new(1.0, rows as f64 / columns as f64);
    Pinhole { placement: Placement::IDENTITY, pixels: PixelGrid::new(columns, rows), half_tangents, layer: 0 }
}

fn grid(n: usize) -> WavelengthGrid {
    WavelengthGrid::new((0..n).map(|i| 420.0 + 260.0 * i as f64 / n as f64).collect()).expect("wavelengths ascend")
}

fn gathered(world: &World, view: &Pinhole, grid: &WavelengthGrid, detail: ViewDetail) -> GatheredView {
    gathered_view(world, view, grid, (detail, 1), &|_| {}, &Cancel::new()).expect("a view")
}

fn curve(builder: &mut WorldBuilder, value: f32) -> TextureId {
    builder.add_texture(Texture::Curve(SpectralCurve::constant(value)))
}

/// A wall 2 m ahead under an even sky sends out its reflectance times the sky's radiance; a mirror shows that sky, and glass nearly all of it.
#[test]
fn wall_mirror_and_glass_under_an_even_sky() {
    let glass = SpectralCurve::constant(1.5);
    for (make, expected) in [
        (None, 0.4 * 3.0),
        (Some(Material::Mirror { reflectance: TextureId(1), roughness: None }), 0.8 * 3.0),
        (Some(Material::Mirror { reflectance: TextureId(1), roughness: Some([TextureId(2); 2]) }), 0.8 * 3.0),
        (Some(Material::Dielectric { index: glass, roughness: None }), 3.0),
        (Some(Material::Translucent { reflectance: TextureId(0), transmittance: TextureId(2) }), 0.5 * 3.0),
    ] {
        let mut builder = WorldBuilder::new();
        let reflectance = curve(&mut builder, 0.4);
        curve(&mut builder, 0.8);
        curve(&mut builder, 0.1);
        let material = make.clone().unwrap_or(Material::Matte { reflectance });
        let material = builder.add_material("wall", material);
        let wall = match make {
            // A pane has two faces.
            Some(Material::Dielectric { .. }) => {
                TriangleMesh::block(Vec3::new(-9.0, -9.0, 2.0), Vec3::new(9.0, 9.0, 2.1))
            }
            _ => TriangleMesh::quad(Vec3::new(-9.0, -9.0, 2.0), Vec3::Y * 18.0, Vec3::X * 18.0),
        };
        builder.add_shape(Shape::Mesh(wall), DAffine3::IDENTITY, material, None);
        builder.add_light(Light::Sky { radiance: SpectralCurve::constant(3.0) });
        let world = builder.build().unwrap();
        for (detail, n_bands) in [(ViewDetail::Fine, 3), (ViewDetail::Quick, 11), (ViewDetail::Quick, 40)] {
            let view = gathered(&world, &pinhole(30, 20, 0.3), &grid(n_bands), detail);
            for plane in view.radiance.planes() {
                let mean = f64::from(plane.mean().unwrap());
                assert!((mean / expected - 1.0).abs() < 0.02, "{make:?} {detail:?}: {mean} for {expected}");
                // Four rays over all directions, 13 times as many by smoothing: 5 % rms if they were independent; four times that at most.
                let spread = plane.iter().map(|v| (f64::from(*v) / mean - 1.0).abs()).fold(0.0, f64::max);
                assert!(spread < 0.2, "{make:?} {detail:?}: {spread}");
            }
            assert!(view.depth.z_m().iter().all(|z| (z - 2.0).abs() < 1e-5));
        }
    }
}

/// A closed room with a lamp, colored walls, a coated ball, a rough one and a mirror.
fn room() -> World {
    let mut builder = WorldBuilder::new();
    let [white, red, dark, rough] = [0.7, 0.3, 0.1, 0.2].map(|value| curve(&mut builder, value));
    let walls = builder.add_material("walls", Material::Matte { reflectance: white });
    let side = builder.add_material("side", Material::Matte { reflectance: red });
    let coated = |roughness| Material::Coated { base: red, index: SpectralCurve::constant(1.5), roughness };
    let glossy = builder.add_material("glossy", coated(None));
    let rough = builder.add_material("rough", coated(Some([rough; 2])));
    let mirror = builder.add_material("mirror", Material::Mirror { reflectance: white, roughness: None });
    let black = builder.add_material_with("lamp", Material::Matte { reflectance: dark }, None::<Relief>);
    let mut block = |low: [f32; 3], high: [f32; 3], material| {
        let mesh = TriangleMesh::block(Vec3::from_array(low), Vec3::from_array(high));
        builder.add_shape(Shape::Mesh(mesh), DAffine3::IDENTITY, material, None)
    };
    block([-1.5, -1.0, -1.0], [1.5, 1.2, 4.0], walls);
    block([-1.5, -1.0, 1.0], [-1.4, 1.0, 3.9], side);
    block([0.3, -1.0, 2.6], [0.9, 0.1, 3.2], side);
    for (x, material) in [(-0.7, glossy), (0.0, rough), (0.75, mirror)] {
        let at = DAffine3::from_translation(DVec3::new(x, -0.7, 2.2));
        builder.add_shape(Shape::Sphere { radius_m: 0.3 }, at, material, None);
    }
    let panel = TriangleMesh::quad(Vec3::new(-0.5, 1.19, 1.5), Vec3::X, Vec3::Z);
    let emission = Emission { radiance: SpectralCurve::constant(5.0), is_two_sided: false };
    builder.add_shape(Shape::Mesh(panel), DAffine3::IDENTITY, black, Some(emission));
    builder.build().expect("a sound world")
}

fn paths(world: &World, view: Pinhole, grid: &WavelengthGrid, n_passes: u32) -> SpectralImage {
    let camera = Camera::Pinhole(view);
    let settings = RenderSettings {
        bands: Bands { grid: grid.clone(), sampling: BandSampling::Center },
        paths: LightPaths::Full,
        samples_per_pass: 64,
        seed: 9,
        clamp: None,
    };
    let mut renderer = Renderer::new(world, &camera, settings).expect("sound settings");
    for _ in 0..n_passes {
        renderer.pass(&Cancel::new(), &|_| {}).expect("a pass");
    }
    renderer.picture()
}

/// The mean ratio of two pictures, and the median difference of blocks of pixels.
fn differences(found: &SpectralImage, expected: &SpectralImage, block: usize) -> (f64, f64) {
    let (rows, columns) = (found.rows() / block, found.columns() / block);
    let mut ratios = Vec::new();
    let (mut sums, mut n) = ([0.0; 2], 0.0);
    for (found, expected) in found.planes().iter().zip(expected.planes()) {
        for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
            let of = |plane: &ndarray::Array2<f32>| {
                let part = ndarray::s![row * block..(row + 1) * block, column * block..(column + 1) * block];
                f64::from(plane.slice(part).mean().expect("a block"))
            };
            let (a, b) = (of(found), of(expected));
            (sums[0], sums[1], n) = (sums[0] + a, sums[1] + b, n + 1.0);
            ratios.push((a / b - 1.0).abs());
        }
    }
    ratios.sort_by(f64::total_cmp);
    (sums[0] / sums[1], ratios[ratios.len() / 2])
}

/// Blocks of 6 × 6 pixels differ by the noise of both and by what is smoothed too far.
#[test]
fn rooms_are_what_paths_find() {
    let bands = WavelengthGrid::new(vec![550.0]).unwrap();
    let still_life = World::still_life();
    let mut eye = pinhole(90, 60, 0.3057);
    eye.placement = Placement { world_from_camera: still_life.cameras()[0].world_from_camera };
    assert!(matches!(still_life.cameras()[0].kind, CameraKind::Perspective { .. }));
    let room = room();
    for (name, world, view) in [("room", &room, pinhole(90, 60, 0.6)), ("still life", &still_life, eye)] {
        let expected = paths(world, view, &bands, 2);
        for detail in [ViewDetail::Fine, ViewDetail::Quick] {
            let found = gathered(world, &view, &bands, detail);
            let (mean, block) = differences(&found.radiance, &expected, 6);
            println!("{name} {detail:?}: mean {mean:.4}, blocks {block:.4}");
            assert!((mean - 1.0).abs() < 0.04, "{name} {detail:?}: {mean}");
            assert!(block < 0.09, "{name} {detail:?}: {block}");
        }
    }
}

#[test]
fn depth_is_that_of_the_first_surface_and_of_what_it_hides() {
    let world = World::still_life();
    let mut view = pinhole(61, 40, 0.3);
    view.placement = Placement { world_from_camera: world.cameras()[0].world_from_camera };
    let expected = layered_depth(&world, &view, 2, &Cancel::new()).unwrap();
    for (layer, expected) in (0..).zip(&expected) {
        let found = gathered(&world, &Pinhole { layer, ..view }, &grid(1), ViewDetail::Quick).depth;
        let n_other =
            found.z_m().iter().zip(expected).filter(|(a, b)| (*a / *b - 1.0).abs() > 1e-5 && **a != **b).count();
        // Something thin can be missed between the corners of a pixel.
        assert!(n_other * 200 < expected.len(), "{layer}: {n_other}");
    }
    // Behind the vase is the wall, not its inside.
    assert!(expected[1].iter().zip(&expected[0]).all(|(behind, first)| behind >= first));
}

#[test]
fn one_thread_and_three_gather_the_same() {
    let world = room();
    for detail in [ViewDetail::Fine, ViewDetail::Quick] {
        let on = |n_threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
            pool.install(|| gathered(&world, &pinhole(45, 70, 0.5), &grid(2), detail).radiance)
        };
        assert_eq!(on(1), on(3));
    }
}

#[test]
fn gathering_reports_progress_and_is_cancelled() {
    let world = room();
    let view = pinhole(24, 16, 0.5);
    let done = Mutex::new(Vec::new());
    let report = |part: f64| done.lock().unwrap().push(part);
    gathered_view(&world, &view, &grid(1), (ViewDetail::Fine, 1), &report, &Cancel::new()).unwrap();
    let mut done = done.into_inner().unwrap();
    done.sort_by(f64::total_cmp);
    assert_eq!(done, (1..=32).map(|n| f64::from(n) / 32.0).collect::<Vec<_>>());
    for after in [0.0, 0.4, 0.7] {
        let cancel = Cancel::new();
        let stop = |part: f64| {
            if part > after {
                cancel.cancel();
            }
        };
        let ended = gathered_view(&world, &view, &grid(1), (ViewDetail::Quick, 1), &stop, &cancel);
        assert!(matches!(ended, Err(BackwardError::Cancelled(_))), "{after}");
    }
}

/// Nothing to be lit, no light, a view of one pixel, and a camera within a wall.
#[test]
fn empty_and_dark_worlds_are_black() {
    let empty = WorldBuilder::new().build().unwrap();
    let mut builder = WorldBuilder::new();
    let gray = curve(&mut builder, 0.5);
    let gray = builder.add_material("gray", Material::Matte { reflectance: gray });
    builder.add_shape(Shape::Sphere { radius_m: 1.0 }, DAffine3::IDENTITY, gray, None);
    let dark = builder.build().unwrap();
    for (world, size) in [(&empty, (7, 5)), (&dark, (7, 5)), (&dark, (1, 1))] {
        let view = gathered(world, &pinhole(size.0, size.1, 0.5), &grid(2), ViewDetail::Fine);
        assert!(view.radiance.planes().iter().flatten().all(|v| *v == 0.0));
    }
    assert!(
        gathered_view(&dark, &pinhole(0, 3, 0.5), &grid(1), (ViewDetail::Fine, 1), &|_| {}, &Cancel::new()).is_err()
    );
}

/// Prints how far gathered views are from paths, and from those of another seed, in parts of full scale (4 × mean).
#[test]
#[ignore = "takes minutes: makes the table of docs/backward.md"]
fn errors_of_gathered_views() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/worlds/room.pbrt");
    let room = read_world(file.as_ref(), &ReadOptions::default(), &Cancel::new()).unwrap();
    let still_life = World::still_life();
    for (name, world, view, n_bands, n_passes) in [
        ("room.pbrt", &room, pinhole(180, 120, 1.0), 5, 6),
        ("still life", &still_life, pinhole(360, 240, 0.3057), 8, 2),
    ] {
        let placement = Placement { world_from_camera: world.cameras()[0].world_from_camera };
        let (view, bands) = (Pinhole { placement, ..view }, grid(n_bands));
        let expected = paths(world, view, &bands, n_passes);
        for detail in [ViewDetail::Fine, ViewDetail::Quick] {
            let [found, other] = [1, 2].map(|seed| {
                gathered_view(world, &view, &bands, (detail, seed), &|_| {}, &Cancel::new()).expect("a view").radiance
            });
            let (mean, block) = differences(&found, &expected, 6);
            let [from_paths, of_seeds] = [&expected, &other].map(|other| rms_of_full_scale(&found, other));
            println!("{name} {detail:?}: mean {mean:.4}, blocks {block:.4}, rms {from_paths:.4}, seeds {of_seeds:.4}");
        }
    }
}

fn rms_of_full_scale(found: &SpectralImage, expected: &SpectralImage) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0);
    for (found, expected) in found.planes().iter().zip(expected.planes()) {
        let full = 4.0 * expected.mean().expect("pixels");
        for (a, b) in found.iter().zip(expected) {
            sum += f64::from((a / full).min(1.0) - (b / full).min(1.0)).powi(2);
            n += 1.0;
        }
    }
    f64::sqrt(sum / n)
}
