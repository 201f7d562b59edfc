//! What is seen past the edges of near surfaces, held to pictures integrated over the pupil.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use dioptric_forward::{DiscLens, Film, OccludedLayer, Settings, Source, render};
use dioptric_scene::View;
use dioptric_spectrum::{DepthMap, Quantity, SpectralImage, WavelengthGrid};
use ndarray::Array2;

/// Pixels of the film each way.
const SIDE: usize = 96;
/// Samples of the scene in a pixel, each way.
const FINE: usize = 3;
const NEAR: f64 = 0.1;
const WALL: f64 = 0.02;
const LAMP: f64 = 400.0;

/// A near half plane, its edge upright a little left of the film's middle, before lamps on a wall; blur radii with their signs, pixels.
struct Edge {
    near_px: f64,
    lamps_px: f64,
    wall_px: f64,
}

impl Edge {
    fn is_near(x: f64) -> bool {
        // Halfway between two samples.
        x < 45.0 + 0.5 / FINE as f64
    }

    /// Whether there is one of four lamps, two of which the chief rays see; they fill whole pixels.
    fn is_lamp(x: f64, y: f64) -> bool {
        let lamps = [(50.0, 20.0), (47.0, 48.0), (43.0, 72.0), (58.0, 60.0)];
        lamps.iter().any(|&(column, row)| (x - column).abs() < 0.5 && (y - row).abs() < 0.5)
    }

    /// Depths in focus are 20 dioptres, and a dioptre is a pixel.
    fn scene(&self) -> [(SpectralImage, DepthMap); 2] {
        let behind = |x: f64, y: f64| if Self::is_lamp(x, y) { (LAMP, self.lamps_px) } else { (WALL, self.wall_px) };
        let front = |x: f64, y: f64| if Self::is_near(x) { (NEAR, self.near_px) } else { behind(x, y) };
        [layer(&front), layer(&behind)]
    }

    /// The mean over the pupil of the first surface met, and over a pixel.
    fn truth(&self) -> Array2<f64> {
        const POINTS: usize = 6000;
        let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
        let pupil = (0..POINTS).map(|i| {
            let (radius, angle) = (((i as f64 + 0.5) / POINTS as f64).sqrt(), golden * i as f64);
            let beside = |step: f64| (0.5 + step * i as f64).fract() - 0.5;
            ([radius * angle.cos(), radius * angle.sin()], [beside(0.754_877_666), beside(0.569_840_290)])
        });
        let pupil: Vec<([f64; 2], [f64; 2])> = pupil.collect();
        Array2::from_shape_fn((SIDE, SIDE), |(row, column)| {
            let seen = |([u, v], [right, down]): &([f64; 2], [f64; 2])| {
                let (x, y) = (column as f64 + right, row as f64 + down);
                if Self::is_near(x + self.near_px * u) {
                    NEAR
                } else if Self::is_lamp(x + self.lamps_px * u, y + self.lamps_px * v) {
                    LAMP
                } else {
                    WALL
                }
            };
            pupil.iter().map(seen).sum::<f64>() / POINTS as f64
        })
    }
}

fn layer(of: &dyn Fn(f64, f64) -> (f64, f64)) -> (SpectralImage, DepthMap) {
    let place = |i: usize| (i as f64 + 0.5) / FINE as f64 - 0.5;
    let at = |(row, column): (usize, usize)| of(place(column), place(row));
    let size = (FINE * SIDE, FINE * SIDE);
    let radiance = Array2::from_shape_fn(size, |place| at(place).0 as f32);
    let depth_m = Array2::from_shape_fn(size, |place| (1.0 / (20.0 + at(place).1)) as f32);
    let grid = WavelengthGrid::new(vec![550.0]).unwrap();
    (SpectralImage::new(Quantity::Radiance, grid, vec![radiance]).unwrap(), DepthMap::new(depth_m).unwrap())
}

fn picture(scene: &[(SpectralImage, DepthMap); 2]) -> Array2<f32> {
    let middle = 0.5 * ((FINE * SIDE) as f64 - 1.0);
    let view = View { focal_px: 1000.0 * FINE as f64, center_x_px: middle, center_y_px: middle };
    let [front, behind] = scene;
    let occluded = Some(OccludedLayer { radiance: &behind.0, depth: &behind.1 });
    let source = Source { radiance: &front.0, depth: &front.1, view, occluded, points: &[] };
    let lens = DiscLens { focus_dioptres: 20.0, ..DiscLens::default() };
    let mut picture = None;
    let mut sink = |_: usize, plane: Array2<f32>| {
        picture = Some(plane);
        Ok(())
    };
    render(&source, &lens, &Film::centered(SIDE, SIDE, 1.0), &Settings::default(), &|_| {}, &mut sink).unwrap();
    picture.unwrap()
}

/// Means of 8 × 8 pixels away from the rim.
fn blocks(picture: &Array2<f64>) -> Vec<f64> {
    let block =
        |(row, column): (usize, usize)| picture.slice(ndarray::s![row..row + 8, column..column + 8]).sum() / 64.0;
    (16..SIDE - 16)
        .step_by(8)
        .flat_map(|row| (16..SIDE - 16).step_by(8).map(move |column| (row, column)))
        .map(block)
        .collect()
}

/// Lamps are cut where rays are, wherever the focus is.
#[test]
fn lamps_behind_an_edge_are_cut_by_it() {
    for (name, near_px, lamps_px, wall_px) in [
        ("both before the focus", 14.0, 8.0, 4.0),
        ("both beyond it", -6.0, -13.0, -15.0),
        ("on either side", 6.0, -8.0, -10.0),
        ("edge in focus", 0.0, -12.0, -14.0),
        ("lamps in focus", 12.0, 0.0, -4.0),
    ] {
        let edge = Edge { near_px, lamps_px, wall_px };
        let (found, truth) = (blocks(&picture(&edge.scene()).mapv(f64::from)), blocks(&edge.truth()));
        let mean = truth.iter().sum::<f64>() / truth.len() as f64;
        let total = found.iter().sum::<f64>() / truth.iter().sum::<f64>() - 1.0;
        let square = found.iter().zip(&truth).map(|(found, truth)| (found - truth).powi(2)).sum::<f64>();
        let rms = (square / truth.len() as f64).sqrt() / mean;
        println!("{name}: {:+.2} % in all, {:.2} % of the mean over blocks", 100.0 * total, 100.0 * rms);
        // A pixel of a lamp's edge is a sixteenth of its disc of 8 pixels.
        assert!(total.abs() < 0.012 && rms < 0.06, "{name}: {total}, {rms}");
    }
}

/// A ramp that leans by a pixel of blur in three hides all that lies behind it: none of a row of lamps just above its far edge shows on it.
#[test]
fn a_slanted_surface_lets_nothing_through() {
    const EDGE: f64 = 30.0;
    let ramp = |y: f64| 14.0 - (y - EDGE).max(0.0) / 3.0;
    let behind = |_: f64, y: f64| if (y - EDGE + 4.0).abs() < 1.0 { (LAMP, -9.0) } else { (WALL, -9.0) };
    let far_edge = ramp(SIDE as f64);
    // Farther up is farther away.
    let front = |x: f64, y: f64| if y > EDGE { (NEAR, 14.0 + far_edge - ramp(y)) } else { behind(x, y) };
    let found = picture(&[layer(&front), layer(&behind)]);
    let reach = (EDGE + 14.0 + far_edge.abs()) as usize + 3;
    for row in reach.max(EDGE as usize + 16)..SIDE - 4 {
        let worst = found.row(row).iter().skip(20).take(SIDE - 40).fold(0.0_f32, |worst, v| worst.max((v - 0.1).abs()));
        // Of a lamp as bright as 4,000 of it.
        assert!(worst < 0.01, "row {row}: {worst}");
    }
}
