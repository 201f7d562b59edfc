//! Edges of depth through a double Gauss, layered and through views of the pupil, against a picture that pbrt traced.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking and shows its numbers")]

use dioptric_backward::{
    BandSampling, Bands, Camera, LightPaths, Pinhole, PixelGrid, Placement, RenderSettings, Renderer, layered_depth,
};
use dioptric_forward::{BlurMode, Film, Settings, irradiance};
use dioptric_optics::{Lens, glam::DVec2};
use dioptric_psf::{Diffraction, ImageSettings, LensImageModel};
use dioptric_scene::{HiddenLayer, Scene, View, read_spectral_exr};
use dioptric_spectrum::{Cancel, DepthMap, SpectralImage, WavelengthGrid};
use dioptric_world::{
    ReadOptions, World,
    glam::{DAffine3, DVec3},
    read_world,
};
use ndarray::{Array2, s};

/// From `scene.json` (the stop of 17.1 mm is that of the file): the film behind the last vertex, and the first vertex before it, mm.
const FILM_MM: f64 = 36.979;
const LENGTH_MM: f64 = 32.04;

/// The picture: samples a side, and the tangent of half its angle, beyond what the film's blurred border sees.
const SIDE: usize = 640;
const HALF_TAN: f64 = 0.2;

fn lens(folder: &std::path::Path) -> Lens {
    Lens::read(&folder.join("dgauss50.dat")).unwrap()
}

/// Returns what the middle of the entrance pupil sees, and what is behind that.
fn seen(world: &World, lens: &Lens, grid: &WavelengthGrid) -> Scene {
    let pupil_mm = FILM_MM + LENGTH_MM - lens.at(550.0).unwrap().first_order().entrance_pupil_z_mm;
    let world_from_camera = DAffine3::from_translation(1e-3 * DVec3::new(0.0, 0.0, pupil_mm));
    let view = Pinhole {
        placement: Placement { world_from_camera },
        pixels: PixelGrid::new(SIDE, SIDE),
        half_tangents: DVec2::splat(HALF_TAN),
        layer: 0,
    };
    let layer = |layer: u32| {
        let camera = Camera::Pinhole(Pinhole { layer, ..view });
        let settings = RenderSettings {
            bands: Bands { grid: grid.clone(), sampling: BandSampling::Mean },
            paths: LightPaths::Emission,
            samples_per_pass: 16,
            seed: 1,
            clamp: None,
        };
        let mut renderer = Renderer::new(world, &camera, settings).unwrap();
        renderer.pass(&Cancel::new(), &|_| {}).unwrap();
        renderer.rendering().picture
    };
    let mut depths = layered_depth(world, &view, 2, &Cancel::new()).unwrap().into_iter();
    let mut depth = || DepthMap::new(depths.next().unwrap()).unwrap();
    let (first, behind) = (depth(), depth());
    Scene {
        depth: Some(first),
        view: Some(View::from_horizontal_fov_deg(2.0 * HALF_TAN.atan().to_degrees(), SIDE, SIDE).unwrap()),
        hidden: Some(HiddenLayer { radiance: layer(1), depth: behind }),
        ..Scene::new("depth_edge", layer(0))
    }
}

/// Returns the means over blocks of 8 × 8.
fn blocks(picture: &Array2<f32>) -> Array2<f64> {
    let (rows, columns) = picture.dim();
    Array2::from_shape_fn((rows / 8, columns / 8), |(r, c)| {
        f64::from(picture.slice(s![8 * r..8 * r + 8, 8 * c..8 * c + 8]).mean().unwrap())
    })
}

/// Returns the blocks within a blur of an edge of depth: those of the film whose surroundings have near and far.
fn edge_band(depth: &DepthMap, pitch_tan: f64) -> Array2<bool> {
    const N: usize = 32;
    const REACH_PX: f64 = 10.0;
    let z_m = depth.z_m();
    let position = |px: f64| (px * pitch_tan / HALF_TAN * 0.5 + 0.5) * SIDE as f64;
    Array2::from_shape_fn((N, N), |(r, c)| {
        let range = |i: usize| {
            let (low, high) = (8.0 * i as f64 - 128.0 - REACH_PX, 8.0 * i as f64 - 120.0 + REACH_PX);
            position(low).max(0.0) as usize..(position(high) as usize).min(SIDE)
        };
        let part = z_m.slice(s![range(r), range(c)]);
        part.iter().any(|z| *z < 2.0) && part.iter().any(|z| *z > 2.0)
    })
}

/// Whether a block shows the bright patch behind the edge, which the middle of the pupil does not see.
fn is_patch((row, column): (usize, usize)) -> bool {
    (10..22).contains(&row) && column == 15
}

/// Returns the rms of relative differences of blocks over all bands: of those in the band of edges but for the patch, of the patch and of the
/// others.
fn errors(found: &[Array2<f32>], truth: &SpectralImage, is_edge: &Array2<bool>) -> [f64; 3] {
    let mut sums = [(0.0, 0.0); 3];
    for (band, picture) in found.iter().enumerate() {
        let (found, truth) = (blocks(picture), blocks(&truth.planes()[band]));
        for ((place, a), b) in found.indexed_iter().zip(&truth) {
            let part = if is_patch(place) { 1 } else { 2 * usize::from(!is_edge[place]) };
            let (sum, n) = &mut sums[part];
            *sum += (a / b - 1.0).powi(2);
            *n += 1.0;
        }
    }
    sums.map(|(sum, n): (f64, f64)| (sum / n).sqrt())
}

#[dioptric_golden::needs_shared]
#[test]
fn edges_are_those_of_a_traced_picture() {
    let folder = dioptric_golden::shared("reference/render/depth_edge").unwrap();
    let truth = read_spectral_exr(&folder.join("dgauss.exr")).unwrap().of_own_file().image;
    let grid = truth.grid().clone();
    let world = read_world(
        &folder.join("pinhole.pbrt"),
        &ReadOptions { metres_per_unit: 1.0, ..ReadOptions::default() },
        &Cancel::new(),
    )
    .unwrap();
    let lens = lens(&folder);
    let scene = seen(&world, &lens, &grid);
    let film = Film::centered(256, 256, 62.5);
    let depth = scene.depth.as_ref().unwrap();
    let settings = ImageSettings::new(FILM_MM, Diffraction::None);
    let model = LensImageModel::new(&lens, grid.centers_nm(), &settings).unwrap();
    let is_edge = edge_band(depth, 62.5e-3 / 51.1);
    let image = |scene: &Scene, mode: BlurMode| {
        let settings = Settings { mode, ..Settings::default() };
        let mut bands = vec![];
        let mut take = |_, band| {
            bands.push(band);
            Ok(())
        };
        irradiance(scene, &model, &film, &settings, &|_| {}, &mut take).unwrap();
        errors(&bands, &truth, &is_edge)
    };
    let guessed = Scene { hidden: None, ..scene.clone() };
    // The edges, the patch behind them, and the rest. pbrt's noise is some tenths of a per cent of a block; what is behind the bar, 3 % of the
    // band, can only be guessed.
    for (name, scene, mode, most) in [
        ("layers, what is behind guessed", &guessed, BlurMode::Layered, [0.02, 1.0, 0.01]),
        ("layers", &scene, BlurMode::Layered, [0.01, 0.065, 0.01]),
        ("16 views", &scene, BlurMode::Views(16), [0.01, 0.04, 0.01]),
    ] {
        let found = image(scene, mode);
        println!("{name}: {:.2?} %", found.map(|error| 100.0 * error));
        assert!(found.iter().zip(&most).all(|(error, most)| error <= most), "{name}: {found:?}");
    }
}
