//! What is seen past the edges of near surfaces, held to pictures integrated over the pupil.
#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a helper of tests fails by panicking and shows its numbers"
)]

use dioptric_forward::{BlurMode, DiscLens, Film, OccludedLayer, Settings, Source, render};
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
    imaged(&source, &Settings::default())
}

fn imaged(source: &Source<'_>, settings: &Settings) -> Array2<f32> {
    let lens = DiscLens { focus_dioptres: 20.0, ..DiscLens::default() };
    let mut picture = None;
    let mut sink = |_: usize, plane: Array2<f32>| {
        picture = Some(plane);
        Ok(())
    };
    render(source, &lens, &Film::centered(SIDE, SIDE, 1.0), settings, &|_| {}, &mut sink).unwrap();
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

/// A plane of a scene, on its samples: where it is, and how bright.
struct Plane {
    blur_px: f64,
    is_there: Array2<bool>,
    radiance: Array2<f64>,
}

/// Planes one behind the other, nearest first, the last of which is everywhere.
struct Planes {
    /// Samples along a pixel.
    fine: f64,
    planes: Vec<Plane>,
}

impl Planes {
    fn size(&self) -> (usize, usize) {
        self.planes[0].is_there.dim()
    }

    /// The first surface and what lies behind it.
    fn scene(&self) -> [(SpectralImage, DepthMap); 2] {
        [0, 1].map(|number| {
            let seen = |at: (usize, usize)| {
                let mut there = self.planes.iter().filter(|plane| plane.is_there[at]);
                there.nth(number).unwrap_or(&self.planes[self.planes.len() - 1])
            };
            let radiance = Array2::from_shape_fn(self.size(), |at| seen(at).radiance[at] as f32);
            let depth_m = Array2::from_shape_fn(self.size(), |at| (1.0 / (20.0 + seen(at).blur_px)) as f32);
            let grid = WavelengthGrid::new(vec![550.0]).unwrap();
            let radiance = SpectralImage::new(Quantity::Radiance, grid, vec![radiance]).unwrap();
            (radiance, DepthMap::new(depth_m).unwrap())
        })
    }

    fn picture(&self, mode: BlurMode) -> Array2<f64> {
        let [front, behind] = self.scene();
        let middle = |n: usize| 0.5 * (n as f64 - 1.0);
        let view = View {
            focal_px: 1000.0 * self.fine,
            center_x_px: middle(self.size().1),
            center_y_px: middle(self.size().0),
        };
        let occluded = Some(OccludedLayer { radiance: &behind.0, depth: &behind.1 });
        let source = Source { radiance: &front.0, depth: &front.1, view, occluded, points: &[] };
        imaged(&source, &Settings { mode, ..Settings::default() }).mapv(f64::from)
    }

    /// The mean over the pupil of the first plane met, and over a pixel.
    fn truth(&self) -> Array2<f64> {
        const POINTS: usize = 4000;
        let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
        let mut sums = Array2::<f64>::zeros((SIDE, SIDE));
        for i in 0..POINTS {
            let (radius, angle) = (((i as f64 + 0.5) / POINTS as f64).sqrt(), golden * i as f64);
            let (u, v) = (radius * angle.cos(), radius * angle.sin());
            let beside = |step: f64| (0.5 + step * (i * 7919 % POINTS) as f64).fract() - 0.5;
            // Of each plane the samples that the film's columns and rows see through this point.
            let seen = |through: f64, blur_px: f64, beside: f64, n: usize| -> Vec<usize> {
                let sample = |px: usize| {
                    let from_middle = px as f64 + beside - 0.5 * (SIDE as f64 - 1.0) + blur_px * through;
                    (self.fine * from_middle + 0.5 * n as f64).clamp(0.0, (n - 1) as f64) as usize
                };
                (0..SIDE).map(sample).collect()
            };
            let seen: Vec<[Vec<usize>; 2]> = self
                .planes
                .iter()
                .map(|plane| {
                    let (rows, columns) = self.size();
                    [
                        seen(v, plane.blur_px, beside(0.569_840_290), rows),
                        seen(u, plane.blur_px, beside(0.754_877_666), columns),
                    ]
                })
                .collect();
            for ((row, column), sum) in sums.indexed_iter_mut() {
                let mut met = self.planes.iter().zip(&seen);
                let met = met.find_map(|(plane, [rows, columns])| {
                    let at = (rows[row], columns[column]);
                    plane.is_there[at].then(|| plane.radiance[at])
                });
                *sum += met.unwrap_or(0.0) / POINTS as f64;
            }
        }
        sums
    }

    /// Prints and returns the error in all, and the worst block over its own mean and that of the picture, the larger.
    fn errors(&self, name: &str, mode: BlurMode) -> (f64, f64) {
        let (found, truth) = (blocks(&self.picture(mode)), blocks(&self.truth()));
        let mean = truth.iter().sum::<f64>() / truth.len() as f64;
        let total = found.iter().sum::<f64>() / truth.iter().sum::<f64>() - 1.0;
        let worst = found.iter().zip(&truth).map(|(found, truth)| (found - truth).abs() / truth.max(mean));
        let worst = worst.fold(0.0, f64::max);
        println!("{name}, {mode:?}: {:+.2} % in all, worst block {:.2} %", 100.0 * total, 100.0 * worst);
        (total, worst)
    }
}

/// Numbers between 0 and 1, always the same.
fn drawn(n: usize) -> impl FnMut() -> f64 {
    let mut state = n as u64;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// A blur radius with its sign, pixels, and the radiance of each sample that is there.
type OfPlane<'a> = (f64, &'a dyn Fn(usize, usize) -> Option<f64>);

fn planes(fine: f64, planes: &[OfPlane<'_>]) -> Planes {
    let n = (1.3 * SIDE as f64 * fine) as usize;
    let plane = |&(blur_px, of): &OfPlane<'_>| Plane {
        blur_px,
        is_there: Array2::from_shape_fn((n, n), |(row, column)| of(row, column).is_some()),
        radiance: Array2::from_shape_fn((n, n), |(row, column)| of(row, column).unwrap_or(0.0)),
    };
    Planes { fine, planes: planes.iter().map(plane).collect() }
}

/// Leaves of one or two depths before lamps of 3 × 3 samples on a wall: of each lamp the leaves leave some parts of the pupil.
#[test]
fn lamps_behind_foliage_are_cut_leaf_by_leaf() {
    const FINE: f64 = 2.35;
    let n = (1.3 * SIDE as f64 * FINE) as usize;
    let leaves = |seed: usize, radiance: f64| {
        let mut draw = drawn(seed);
        let mut leaves = Array2::from_elem((n, n), None);
        for _ in 0..230 {
            let (row, column, radius) = (draw() * n as f64, draw() * n as f64, 3.0 + 9.0 * draw());
            for (at, leaf) in leaves.indexed_iter_mut() {
                if (at.0 as f64 - row).hypot(at.1 as f64 - column) < radius {
                    *leaf = Some(radiance);
                }
            }
        }
        leaves
    };
    let (near, far) = (leaves(1, 0.2), leaves(2, 0.1));
    let mut wall = Array2::from_elem((n, n), 0.05);
    let mut draw = drawn(3);
    for _ in 0..60 {
        let (row, column) = ((draw() * (n - 4) as f64) as usize, (draw() * (n - 4) as f64) as usize);
        for at in (0..9).map(|i| (row + i / 3, column + i % 3)) {
            // A scene knows what lies behind one leaf, not behind two.
            if near[at].is_none() || far[at].is_none() {
                wall[at] = 100.0;
            }
        }
    }
    let (near, far, wall) = (
        |row: usize, column: usize| near[(row, column)],
        |row: usize, column: usize| far[(row, column)],
        |row: usize, column: usize| Some(wall[(row, column)]),
    );
    for (name, near_px, far_px, wall_px) in [
        ("leaves in focus", 0.0, None, -9.1),
        ("lamps in focus", 6.3, None, 0.0),
        ("on either side", 3.0, None, -1.5),
        ("leaves of two depths", 7.7, Some(3.3), -2.6),
    ] {
        let all: Vec<OfPlane<'_>> = match far_px {
            Some(far_px) => vec![(near_px, &near), (far_px, &far), (wall_px, &wall)],
            None => vec![(near_px, &near), (wall_px, &wall)],
        };
        let (total, worst) = planes(FINE, &all).errors(name, BlurMode::Layered);
        // Of light behind two leaves nothing is known; the wall behind both is as dark as they are.
        let most = if far_px.is_some() { 0.01 } else { 0.005 };
        assert!(total.abs() < most && worst < 0.04, "{name}: {total}, {worst}");
    }
}

/// Bars narrower than the pupil before a window 60 times as bright as they are.
#[test]
fn windows_behind_bars_keep_their_light() {
    const FINE: f64 = 2.35;
    let bars = |row: usize, column: usize| (column % 40 < 8 || row % 50 < 8).then_some(0.2);
    let window = |row: usize, column: usize| {
        Some(if (60..210).contains(&row) && (80..220).contains(&column) { 20.0 } else { 0.3 })
    };
    let scene = planes(FINE, &[(4.0, &bars), (-3.6, &window)]);
    let even = planes(FINE, &[(4.0, &bars), (-3.6, &|_, _| Some(20.0))]);
    for (name, scene, mode, most) in [
        ("an even wall", &even, BlurMode::Layered, 0.01),
        ("an even wall", &even, BlurMode::Views(16), 0.01),
        ("a window", &scene, BlurMode::Views(16), 0.04),
        // Its rim lies behind bars: what a pixel sees of it is the mean over the window and the wall.
        ("a window", &scene, BlurMode::Layered, 0.08),
    ] {
        let (total, worst) = scene.errors(name, mode);
        assert!(total.abs() < 0.25 * most && worst < most, "{name}, {mode:?}: {total}, {worst}");
    }
}
