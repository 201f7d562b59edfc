//! Results as images of the screen: pure functions of them.

use dioptric_pipeline::display::{SpectrumToRgb, code};
use dioptric_spectrum::WavelengthGrid;
use egui::{Color32, ColorImage};
use ndarray::{ArrayView2, Axis};

use crate::engine::Product;

/// What the middle shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shown {
    /// The developed picture.
    #[default]
    Picture,
    /// The raw frame, each pixel in the color of its filter.
    Raw,
    /// The irradiance of one band.
    Irradiance,
    /// The depth of the scene.
    Depth,
    /// The difference of the snapshots A and B.
    Difference,
}

impl Shown {
    /// All of them with their names.
    pub const ALL: [(Self, &'static str); 5] = [
        (Self::Picture, "Picture"),
        (Self::Raw, "Raw"),
        (Self::Irradiance, "Irradiance"),
        (Self::Depth, "Depth"),
        (Self::Difference, "A − B"),
    ];
}

/// Returns the developed picture.
pub(in crate::ui) fn picture(product: &Product) -> ColorImage {
    ColorImage::from_rgb(product.size(), &product.rgb8)
}

/// Returns the raw frame between black and saturation, each pixel of a mosaic in the color of its filter.
pub(in crate::ui) fn raw(product: &Product) -> ColorImage {
    let raw = &product.capture.frames.exposed.raw;
    let size = product.size();
    let (black, white) = (raw.levels.black, raw.levels.white);
    let level = |sample: f64| code(((sample - black) / (white - black)).clamp(0.0, 1.0));
    let at = |row: usize, column: usize| raw.planes[0].sample(row, column).unwrap_or(black);
    let color = |filter: &str, level: u8| match filter.chars().next().map(|first| first.to_ascii_lowercase()) {
        Some('r') => Color32::from_rgb(level, 0, 0),
        Some('g') => Color32::from_rgb(0, level, 0),
        Some('b') => Color32::from_rgb(0, 0, level),
        _ => Color32::from_gray(level),
    };
    let pixels = (0..size[0] * size[1]).map(|i| {
        let (row, column) = (i / size[0], i % size[0]);
        let level = level(at(row, column));
        match &raw.tile {
            Some(tile) => color(&raw.filter_names[tile.filter_at(row, column)], level),
            None => Color32::from_gray(level),
        }
    });
    ColorImage::new(size, pixels.collect())
}

/// Returns the irradiance at the band nearest to a wavelength, in the color of its light, and that band's wavelength.
pub(in crate::ui) fn irradiance(product: &Product, wavelength_nm: f64) -> (ColorImage, f64) {
    let grid = product.capture.grid();
    let band = grid.nearest(wavelength_nm);
    let nm = grid.centers_nm()[band];
    let image = match product.capture.irradiance.cube() {
        Some(cube) => {
            let plane = cube.index_axis(Axis(0), band);
            let most = plane.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
            let tint = tint(nm);
            colored(plane, |e| tint.map(|t| code(f64::from(e / most) * t)))
        }
        // Kept in a file: too large to be looked at band by band.
        None => ColorImage::filled(product.size(), Color32::DARK_GRAY),
    };
    (image, nm)
}

/// Returns linear sRGB of the hue of a wavelength, 1 at most.
pub(in crate::ui) fn tint(nm: f64) -> [f64; 3] {
    let Ok(grid) = WavelengthGrid::new(vec![nm.clamp(405.0, 680.0)]) else { return [1.0; 3] };
    let rgb = SpectrumToRgb::new(&grid).of_band(0).map(|v| v.max(0.0));
    let most = rgb.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    // Not so pure that blue cannot be seen.
    rgb.map(|v| 0.25 + 0.75 * v / most)
}

/// Returns the depth of the scene, near things light, even steps in dioptres.
pub(in crate::ui) fn depth(product: &Product) -> ColorImage {
    let (near_m, far_m) = product.depth.range_m();
    let (near, far) = (1.0 / near_m, 1.0 / far_m);
    colored(product.depth.z_m().view(), |z_m| {
        let share = if near > far { (1.0 / f64::from(z_m) - far) / (near - far) } else { 0.5 };
        viridis(share.clamp(0.0, 1.0))
    })
}

/// Returns how picture A differs from B, gray where it does not, amplified.
pub(in crate::ui) fn difference(a: &Product, b: &Product, gain: f32) -> Option<ColorImage> {
    if a.size() != b.size() {
        return None;
    }
    let pixels = a.rgb8.chunks_exact(3).zip(b.rgb8.chunks_exact(3)).map(|(a, b)| {
        let channel = |i: usize| (128.0 + gain * (f32::from(a[i]) - f32::from(b[i]))).clamp(0.0, 255.0) as u8;
        Color32::from_rgb(channel(0), channel(1), channel(2))
    });
    Some(ColorImage::new(a.size(), pixels.collect()))
}

/// Returns the root mean square of the difference of two pictures, as a share of full scale.
pub(in crate::ui) fn difference_rms(a: &Product, b: &Product) -> Option<f64> {
    let sum: f64 = a.rgb8.iter().zip(&b.rgb8).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum();
    (a.size() == b.size()).then(|| (sum / a.rgb8.len() as f64).sqrt() / 255.0)
}

/// Returns an image of linear colors.
pub(in crate::ui) fn of_linear(rgb: &[[f32; 3]], side: usize) -> ColorImage {
    let pixels = rgb.iter().map(|rgb| {
        // The square root lets the faint parts of a point spread be seen.
        let [r, g, b] = rgb.map(|v| code(f64::from(v.max(0.0)).sqrt()));
        Color32::from_rgb(r, g, b)
    });
    ColorImage::new([side, side], pixels.collect())
}

fn colored(plane: ArrayView2<'_, f32>, color: impl Fn(f32) -> [u8; 3]) -> ColorImage {
    let (rows, columns) = plane.dim();
    let pixels = plane.iter().map(|&value| {
        let [r, g, b] = color(value);
        Color32::from_rgb(r, g, b)
    });
    ColorImage::new([columns, rows], pixels.collect())
}

/// Returns a color of the map viridis, which those who see few colors read too (van der Walt and Smith; five of its colors, and straight
/// lines between them).
fn viridis(share: f64) -> [u8; 3] {
    const STOPS: [[f64; 3]; 5] =
        [[68.0, 1.0, 84.0], [59.0, 82.0, 139.0], [33.0, 145.0, 140.0], [94.0, 201.0, 98.0], [253.0, 231.0, 37.0]];
    let place = share * 4.0;
    let below = (place as usize).min(3);
    let t = place - below as f64;
    [0, 1, 2].map(|i| (STOPS[below][i] + t * (STOPS[below + 1][i] - STOPS[below][i])).round() as u8)
}
