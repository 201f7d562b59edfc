//! Views through parts of a pupil, held to pictures integrated over the pupil.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use dioptric_forward::{BlurMode, DiscLens, Film, ForwardError, OccludedLayer, Settings, Source, render};
use dioptric_psf::LensImage;
use dioptric_scene::View;
use dioptric_spectrum::{DepthMap, Quantity, SpectralImage, WavelengthGrid};
use ndarray::Array2;

/// Pixels of the film each way.
const SIDE: usize = 160;
/// Samples of the scene in a pixel, each way.
const FINE: usize = 2;
/// Blur radius of the slats and of the wall, pixels; the wall lies beyond the focus.
const SLATS: f64 = 14.0;
const WALL: f64 = -6.0;

/// Radiance of the slats, upright and slanted a little, 7 pixels wide every 19: narrower than the blur of the pupil. `None` between them.
fn slat(x: f64, y: f64) -> Option<f64> {
    let along = (x + 0.15 * y).rem_euclid(19.0);
    (along < 7.0).then_some(0.3 + 0.4 * ((y / 23.0).floor().rem_euclid(2.0)))
}

/// Radiance of the wall: a checkerboard of 9 pixels.
fn wall(x: f64, y: f64) -> f64 {
    if ((x / 9.0).floor() + (y / 9.0).floor()).rem_euclid(2.0) < 0.5 { 1.5 } else { 0.1 }
}

/// A plane of the scene, its samples taken at their middles; (0, 0) is the middle of the film's first pixel.
fn plane(of: impl Fn(f64, f64) -> f64) -> Array2<f32> {
    let place = |i: usize| (i as f64 + 0.5) / FINE as f64 - 0.5;
    Array2::from_shape_fn((FINE * SIDE, FINE * SIDE), |(row, column)| of(place(column), place(row)) as f32)
}

fn image(plane: Array2<f32>) -> SpectralImage {
    SpectralImage::new(Quantity::Radiance, WavelengthGrid::new(vec![550.0]).unwrap(), vec![plane]).unwrap()
}

fn depth(dioptres: Array2<f32>) -> DepthMap {
    DepthMap::new(dioptres.mapv(|d| 1.0 / d)).unwrap()
}

struct Slats {
    front: (SpectralImage, DepthMap),
    wall: (SpectralImage, DepthMap),
}

impl Slats {
    fn new() -> Self {
        let dioptres = |blur: f64| 20.0 + blur;
        let radiance = plane(|x, y| slat(x, y).unwrap_or_else(|| wall(x, y)));
        let front = plane(|x, y| dioptres(if slat(x, y).is_some() { SLATS } else { WALL }));
        Self { front: (image(radiance), depth(front)), wall: (image(plane(wall)), depth(plane(|_, _| dioptres(WALL)))) }
    }

    /// Renders with the wall behind the slats known, or as the picture alone shows it.
    fn rendered(&self, lens: &dyn LensImage, mode: BlurMode, wall_is_known: bool) -> Array2<f32> {
        let middle = 0.5 * ((FINE * SIDE) as f64 - 1.0);
        let view = View { focal_px: 1000.0 * FINE as f64, center_x_px: middle, center_y_px: middle };
        let occluded = OccludedLayer { radiance: &self.wall.0, depth: &self.wall.1 };
        let source = Source {
            radiance: &self.front.0,
            depth: &self.front.1,
            view,
            occluded: wall_is_known.then_some(occluded),
            points: &[],
        };
        picture(&source, lens, mode).unwrap()
    }

    /// The mean over 4000 points of the pupil of the first surface met, at a pixel's middle.
    fn truth() -> Array2<f64> {
        let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
        let pupil: Vec<(f64, f64)> = (0..4000)
            .map(|i| {
                let (radius, angle) = (((i as f64 + 0.5) / 4000.0).sqrt(), golden * i as f64);
                (radius * angle.cos(), radius * angle.sin())
            })
            .collect();
        Array2::from_shape_fn((SIDE, SIDE), |(row, column)| {
            // Each point of the pupil at a place of its own in the pixel.
            let seen = |(i, (u, v)): (usize, &(f64, f64))| {
                let (x, y) = (column as f64 + inside(i, 0.754_877_666), row as f64 + inside(i, 0.569_840_290));
                slat(x + SLATS * u, y + SLATS * v).unwrap_or_else(|| wall(x + WALL * u, y + WALL * v))
            };
            pupil.iter().enumerate().map(seen).sum::<f64>() / pupil.len() as f64
        })
    }
}

/// From −½ to ½, evenly over many.
fn inside(i: usize, step: f64) -> f64 {
    (0.5 + step * i as f64).fract() - 0.5
}

fn picture(source: &Source<'_>, lens: &dyn LensImage, mode: BlurMode) -> Result<Array2<f32>, ForwardError> {
    imaged(source, lens, Settings { mode, ..Settings::default() })
}

fn imaged(source: &Source<'_>, lens: &dyn LensImage, settings: Settings) -> Result<Array2<f32>, ForwardError> {
    let mut picture = None;
    let mut sink = |_: usize, plane: Array2<f32>| {
        picture = Some(plane);
        Ok(())
    };
    render(source, lens, &Film::centered(SIDE, SIDE, 1.0), &settings, &|_| {}, &mut sink)?;
    Ok(picture.unwrap())
}

fn lens() -> DiscLens {
    DiscLens { focus_dioptres: 20.0, ..DiscLens::default() }
}

/// Errors over the mean, away from the rim of the picture, where darkness comes in from outside: rms over pixels and over means of 4 × 4.
fn errors(picture: &Array2<f32>, truth: &Array2<f64>) -> (f64, f64) {
    let inner = 24..SIDE - 24;
    let mean = truth.slice(ndarray::s![inner.clone(), inner.clone()]).mean().unwrap();
    let error = |row: usize, column: usize| (f64::from(picture[(row, column)]) - truth[(row, column)]) / mean;
    let rms = |values: Vec<f64>| (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt();
    let places = |step: usize| {
        inner.clone().step_by(step).flat_map(move |row| (24..SIDE - 24).step_by(step).map(move |c| (row, c)))
    };
    let block = |(row, column): (usize, usize)| (0..16).map(|i| error(row + i / 4, column + i % 4)).sum::<f64>() / 16.0;
    (rms(places(1).map(|(row, column)| error(row, column)).collect()), rms(places(4).map(block).collect()))
}

/// A fence before a wall, both out of focus: what of the wall is seen depends on the place in the pupil, which layers cannot hold.
#[test]
fn views_see_between_slats_narrower_than_the_pupil() {
    let (scene, truth) = (Slats::new(), Slats::truth());
    let mut of = vec![];
    for (name, mode, wall_is_known) in [
        ("layers, guessed", BlurMode::Layered, false),
        ("layers", BlurMode::Layered, true),
        ("views(7)", BlurMode::Views(7), true),
        ("views(16)", BlurMode::Views(16), true),
        ("views(37)", BlurMode::Views(37), true),
        ("views(16), guessed", BlurMode::Views(16), false),
    ] {
        let (pixels, blocks) = errors(&scene.rendered(&lens(), mode, wall_is_known), &truth);
        println!("{name}: {:.2} % of pixels, {:.2} % of blocks", 100.0 * pixels, 100.0 * blocks);
        of.push(blocks);
    }
    assert!(of[1] <= 0.06, "layers {}", of[1]);
    assert!(of[3] <= 0.025 && of[3] <= 0.5 * of[1], "views {} against layers {}", of[3], of[1]);
}

/// Views of a scene without edges add up to its picture in layers.
#[test]
fn views_of_one_plane_add_up() {
    let scene = Slats::new();
    let middle = 0.5 * ((FINE * SIDE) as f64 - 1.0);
    let view = View { focal_px: 1000.0 * FINE as f64, center_x_px: middle, center_y_px: middle };
    // A wall that leans by 4 pixels of blur over the picture.
    let leaning = depth(plane(|x, _| 20.0 - 4.0 - 4.0 * x / SIDE as f64));
    let source = Source { radiance: &scene.wall.0, depth: &leaning, view, occluded: None, points: &[] };
    let growing = DiscLens { growth: 0.4, distortion_per_mm2: 0.5, ..lens() };
    for lens in [lens(), growing] {
        let exact =
            // All on samples of one size.
            |mode| {
                let settings = Settings { mode, max_edge_error: 0.001, subpixels: false, ..Settings::default() };
                imaged(&source, &lens, settings).unwrap()
            };
        let whole = exact(BlurMode::Layered);
        for n in [2, 16] {
            let views = exact(BlurMode::Views(n));
            let (pixels, _) = errors(&views, &whole.mapv(f64::from));
            println!("{n} views of {lens:?}: {:.3} %", 100.0 * pixels);
            // Slanted bilinear samples of small kernels against those of large ones; kernels of parts are interpolated to .001 of an edge.
            assert!(pixels < 0.006, "{n} views: {pixels}");
        }
    }
}

#[test]
fn number_of_views_is_checked() {
    let scene = Slats::new();
    let view = View { focal_px: 1000.0, center_x_px: 79.5, center_y_px: 79.5 };
    let source = Source { radiance: &scene.front.0, depth: &scene.front.1, view, occluded: None, points: &[] };
    for n in [0, 1, 257] {
        let error = picture(&source, &lens(), BlurMode::Views(n)).unwrap_err().to_string();
        assert!(error.contains("the number of views") && error.contains("2 to 256"), "{error}");
    }
}
