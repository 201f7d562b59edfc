//! Stars and lamps as points: where they land, how much light they bring, and what hides them.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use dioptric_forward::{DiscLens, Film, Settings, Source, render};
use dioptric_scene::{PointBrightness, PointLight, PointPlace, View};
use dioptric_spectrum::{DepthMap, Quantity, SpectralImage, WavelengthGrid};
use ndarray::{Array2, s};

const SIDE: usize = 64;
/// A pixel in tangents, and one over it.
const FOCAL_PX: f64 = 1000.0;

/// In focus at 2 m; a dioptre is 8 pixels.
fn lens() -> DiscLens {
    DiscLens { focus_dioptres: 0.5, radius_um_per_dioptre: 8.0, focal_mm: 1.0, ..DiscLens::default() }
}

fn picture(plane: Array2<f32>, depth_m: Array2<f32>, points: &[PointLight]) -> Array2<f64> {
    let (rows, columns) = plane.dim();
    let focal_px = FOCAL_PX * rows as f64 / SIDE as f64;
    let view = View { focal_px, center_x_px: 0.5 * (columns as f64 - 1.0), center_y_px: 0.5 * (rows as f64 - 1.0) };
    let grid = WavelengthGrid::new(vec![550.0]).unwrap();
    let radiance = SpectralImage::new(Quantity::Radiance, grid, vec![plane]).unwrap();
    let depth = DepthMap::new(depth_m).unwrap();
    let source = Source { radiance: &radiance, depth: &depth, view, occluded: None, points };
    let mut picture = None;
    let mut sink = |_: usize, plane: Array2<f32>| {
        picture = Some(plane.mapv(f64::from));
        Ok(())
    };
    render(&source, &lens(), &Film::centered(SIDE, SIDE, 1.0), &Settings::default(), &|_| {}, &mut sink).unwrap();
    picture.unwrap()
}

fn flat(fine: usize, value: f32) -> Array2<f32> {
    Array2::from_elem((fine * SIDE, fine * SIDE), value)
}

/// Of what is above a level: the sum, and the middle in pixels from that of the film, down and across.
fn light_and_middle(picture: &Array2<f64>, level: f64) -> (f64, [f64; 2]) {
    let sum = picture.iter().map(|value| value - level).sum::<f64>();
    let from_middle = |i: usize| i as f64 - 0.5 * (SIDE as f64 - 1.0);
    let mean = |of: &dyn Fn((usize, usize)) -> usize| {
        picture.indexed_iter().map(|(at, value)| from_middle(of(at)) * (value - level)).sum::<f64>() / sum
    };
    (sum, [mean(&|at| at.0), mean(&|at| at.1)])
}

fn star(tan: [f64; 2], depth_m: f64, irradiance: f32) -> [PointLight; 1] {
    let place = PointPlace::Field { tan_x: tan[0], tan_y: tan[1] };
    [PointLight { place, depth_m, light: PointBrightness::Irradiance(vec![irradiance]) }]
}

/// Of a scene four times as fine as the film, one bright sample anywhere in a pixel, at any depth.
#[test]
fn bright_samples_land_where_they_lie_and_keep_their_light() {
    for depth_m in [1.0_f32, 0.8] {
        for (down, across) in (0..5).flat_map(|down| (0..5).map(move |across| (down, across))) {
            let fine = 4;
            let mut plane = flat(fine, 0.0);
            let at = (127 + down, 120 + across);
            plane[at] = 1.0;
            let (light, middle) = light_and_middle(&picture(plane, flat(fine, depth_m), &[]), 0.0);
            let place = |sample: usize| (sample as f64 - 0.5 * (256.0 - 1.0)) / fine as f64;
            assert!((light * 16.0 - 1.0).abs() < 1e-4, "{light}");
            for (found, expected) in middle.into_iter().zip([place(at.0), place(at.1)]) {
                assert!((found - expected).abs() < 0.01, "{depth_m} m, {at:?}: {found} {expected}");
            }
        }
    }
}

/// A star of irradiance E brings E / cos³ in radiance times tan².
#[test]
fn stars_of_a_list_bring_what_they_are_said_to() {
    let level = 0.25;
    for tan in [[0.0, 0.0], [0.0101, -0.0053], [0.0032, 0.0148]] {
        for depth_m in [1.0, 0.8] {
            let star = star(tan, depth_m, 3e-6);
            let found = picture(flat(1, level), flat(1, 50.0), &star);
            let (light, middle) = light_and_middle(&found, f64::from(level));
            let cos = 1.0 / (1.0 + tan[0] * tan[0] + tan[1] * tan[1]).sqrt();
            let expected = 3e-6 / cos.powi(3) * FOCAL_PX * FOCAL_PX;
            assert!((light / expected - 1.0).abs() < 2e-4, "{light} {expected}");
            let expected = [-tan[1] * FOCAL_PX, tan[0] * FOCAL_PX];
            assert!(middle.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 0.01), "{middle:?}");
        }
    }
}

/// Behind a surface points are hidden, before it and beside it they are not; past an edge of it half the pupil sees them.
#[test]
fn surfaces_hide_points() {
    let at = |tan_x: f64, depth_m: f64| star([tan_x, 0.0], depth_m, 1e-6);
    let light = |depth_m: &Array2<f32>, star: &[PointLight]| {
        picture(flat(1, 0.0), depth_m.clone(), star).sum() / (1e-6 * FOCAL_PX * FOCAL_PX)
    };
    let wall = flat(1, 1.5);
    assert!(light(&wall, &at(0.0, 3.0)) < 1e-6);
    assert!(light(&wall, &at(0.0, f64::INFINITY)) < 1e-6);
    assert!((light(&wall, &at(0.0, 1.2)) - 1.0).abs() < 1e-3);
    // A near board to the left, blurred by 8 pixels, before far darkness; stars are blurred by 4.
    let mut edge = flat(1, 100.0);
    edge.slice_mut(s![.., ..SIDE / 2]).fill(2.0 / 3.0);
    let found: Vec<f64> = [-0.02, -0.004, 0.0, 0.004, 0.02].map(|tan_x| light(&edge, &at(tan_x, 80.0))).into();
    println!("{found:?}");
    assert!(found[0] < 1e-3 && (found[4] - 1.0).abs() < 1e-3);
    assert!(found.windows(2).all(|pair| pair[0] <= pair[1] + 1e-3));
    // From the middle of the edge half of the pupil sees the star.
    assert!((found[2] - 0.5).abs() < 0.05, "{found:?}");
}

/// A wall that is hardly out of focus hides what lies behind it too, far from its edge and whatever the layers are.
#[test]
fn walls_near_the_focus_hide_points() {
    for (near_m, far_m) in [(1.8, 2.4), (1.95, 2.1), (1.6, 3.0), (2.0, 100.0)] {
        let mut edge = flat(1, far_m);
        edge.slice_mut(s![.., ..SIDE / 2]).fill(near_m);
        for depth_m in [1.1, 1.3, 2.0, 1e9].map(|times| times * f64::from(near_m)) {
            let behind = star([-0.02, 0.0], depth_m, 1e-6);
            let light = picture(flat(1, 0.0), edge.clone(), &behind).sum() / (1e-6 * FOCAL_PX * FOCAL_PX);
            assert!(light < 1e-3, "{near_m} m before {depth_m} m: {light}");
        }
    }
}
