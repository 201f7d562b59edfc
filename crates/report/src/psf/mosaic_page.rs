//! Point-spread functions side by side: wavelengths across, fields and distances down, with labels and scales.

use std::{ops::Range, path::Path};

use image::{Rgb, RgbImage, imageops};
use ndarray::Array2;

use crate::{
    axis::round_up,
    lettering::{Ink, Weight, write},
    page,
    png::png_bytes,
};
use dioptric_analysis::{LineChart, PsfRow, PsfSet};
use dioptric_files::is_stream;
use dioptric_pipeline::{PipelineError, display::LinearRgb, display::code, number};

/// Side of a tile where there is room, pixels.
const TILE: u32 = 168;
/// The longest sum of tiles, pixels.
const LONGEST: u32 = 18_000;
/// Space between tiles, left of them for the names of points, and above them for those of wavelengths, pixels.
const GAP: u32 = 6;
const LEFT: u32 = 104;
const TOP: u32 = 44;
/// Room under a row of tiles for its scale, pixels.
const SCALE: u32 = 22;
/// The share of a picture's energy that a square within its tile holds; the far tails of diffraction would leave the
/// rest of it small.
const HELD: f64 = 0.98;

/// Draws all pictures: wavelengths across, with the light of all of them together in color at the end of each row;
/// fields and distances down.
///
/// Each tile is exposed for its brightest pixel. The tiles of a row are of one scale, given by the bar below them,
/// about the centroid; x runs to the right, y up.
///
/// # Errors
/// When there are more rows than a picture holds.
pub fn psf_mosaic(set: &PsfSet) -> Result<RgbImage, PipelineError> {
    let n_colors = set.spectral_weights.len();
    let n_columns = if n_colors > 1 { n_colors + 1 } else { n_colors } as u32;
    let points: Vec<Range<usize>> = set.points().collect();
    let tile = TILE.min(LONGEST / n_columns.max(1)).min((LONGEST / points.len().max(1) as u32).saturating_sub(SCALE));
    if tile < 8 {
        let reason = format!("{} points are too many for one picture", points.len());
        return Err(PipelineError::Png { reason });
    }
    let layout = Layout { tile, n_columns, n_rows: points.len() as u32 };
    let sides_um: Vec<f64> = points.iter().map(|point| row_side_um(set, point.clone())).collect();
    let (width, height) = layout.size();
    let mut sheet = RgbImage::from_pixel(width, height, Rgb([255; 3]));
    label(&mut sheet, set, &layout, &points, &sides_um);
    for (row, (point, side_um)) in points.iter().zip(&sides_um).enumerate() {
        let side_px = side_um / set.pixel_um;
        for (column, i) in point.clone().enumerate() {
            let gray = resampled(&set.pictures[i], side_px, tile as usize);
            let top = gray.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
            let picture =
                RgbImage::from_fn(tile, tile, |x, y| Rgb([code(f64::from(gray[(y as usize, x as usize)] / top)); 3]));
            layout.put(&mut sheet, &picture, row, column);
        }
        if n_colors > 1 {
            let color = set.color_of(point.clone()).unwrap_or_else(|| LinearRgb::black(1, 1));
            let planes = color.planes.each_ref().map(|plane| resampled(plane, side_px, tile as usize));
            let light = LinearRgb { planes };
            let picture = light.to_srgb(light.level_at(1.0).max(f64::MIN_POSITIVE));
            layout.put(&mut sheet, &picture, row, n_colors);
        }
    }
    Ok(sheet)
}

/// Returns the side of the square that holds nearly all light of each picture of a point and of them all, µm.
fn row_side_um(set: &PsfSet, point: Range<usize>) -> f64 {
    let own = point.clone().filter(|i| !set.rows[*i].is_dark()).map(|i| set.pictures[i].view());
    let whole = set.polychromatic_of(point).map(|light| light.picture);
    let side = |picture: ndarray::ArrayView2<'_, f32>| {
        2.0 * dioptric_psf::Picture::new(picture, set.pixel_um).energy_half_side_um(HELD)
    };
    let widest = own.map(side).chain(whole.as_ref().map(|picture| side(picture.view()))).fold(0.0, f64::max);
    // A rim of a tenth, and never less than a few pixels.
    (1.1 * widest).max(5.0 * set.pixel_um)
}

/// Names of points and wavelengths, in black, and what is less to be seen, in gray.
const NAME: Ink = Ink { em_px: 13.0, weight: Weight::Bold, color: [0x11; 3] };
const NOTE: Ink = Ink { em_px: 11.0, weight: Weight::Regular, color: [0x55; 3] };

/// Writes everything but the tiles.
fn label(sheet: &mut RgbImage, set: &PsfSet, layout: &Layout, points: &[Range<usize>], sides_um: &[f64]) {
    let (x0, y0) = layout.corner(0, 0);
    if let Some(point) = points.first() {
        for (column, i) in point.clone().enumerate() {
            let words = format!("{} nm", number(set.rows[i].wavelength_nm));
            write(sheet, (f64::from(layout.corner(0, column).0), f64::from(y0) - 7.0), &NAME, &words);
        }
        if set.spectral_weights.len() > 1 {
            let x = f64::from(layout.corner(0, set.spectral_weights.len()).0);
            write(sheet, (x, f64::from(y0) - 7.0), &NAME, "all together");
        }
    }
    let note = "each tile exposed for its brightest pixel; fields to the right, y up";
    write(sheet, (f64::from(x0), 14.0), &NOTE, note);
    for (row, (point, side_um)) in points.iter().zip(sides_um).enumerate() {
        let first: &PsfRow = &set.rows[point.start];
        let y = f64::from(layout.corner(row, 0).1);
        write(sheet, (8.0, y + 16.0), &NAME, &field(first));
        write(sheet, (8.0, y + 34.0), &NAME, &distance(first.distance_mm));
        if point.clone().all(|i| set.rows[i].is_dark()) {
            write(sheet, (8.0, y + 52.0), &Ink { em_px: 12.0, ..NOTE }, "dark");
            continue;
        }
        let bar_um = round_down(0.45 * side_um);
        let bar_px = bar_um / side_um * f64::from(layout.tile);
        let below = layout.corner(row, 0).1 + layout.tile + 9;
        draw_bar(sheet, (x0, below), bar_px.round() as u32);
        let place = (f64::from(x0) + bar_px + 6.0, f64::from(below) + 4.0);
        write(sheet, place, &Ink { em_px: 12.0, ..NAME }, &length(bar_um));
    }
}

/// Draws a scale from a place to the right: a line of two pixels with an upright one at each end.
fn draw_bar(sheet: &mut RgbImage, (x, y): (u32, u32), length: u32) {
    let upright = |x: u32| (x..x + 2).flat_map(move |x| (y - 4..y + 4).map(move |y| (x, y)));
    let line = (x..x + length).flat_map(|x| [(x, y - 1), (x, y)]);
    for (x, y) in line.chain(upright(x)).chain(upright((x + length).saturating_sub(2).max(x))) {
        if let Some(pixel) = sheet.get_pixel_mut_checked(x, y) {
            *pixel = Rgb(NAME.color);
        }
    }
}

/// How pictures of point spread functions are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PsfFormat {
    /// An EXR with a channel a picture (`.exr`).
    Exr,
    /// A labelled [mosaic](psf_mosaic) (`.png`).
    Png,
    /// An archive of `NumPy` that a camera takes in place of the functions of its lens (`.npz`).
    Npz,
}

impl PsfFormat {
    /// Returns the format that the name of a file ends in, of any case.
    ///
    /// # Errors
    /// When it ends in none of them.
    pub fn of(path: &Path) -> Result<Self, PipelineError> {
        let cannot = |what: String| PipelineError::Write {
            path: path.to_owned(),
            reason: format!("{what} is no format of pictures here; expected .exr, .npz or .png"),
        };
        if path.extension().is_none() && is_stream(path) {
            return Ok(Self::Exr);
        }
        let Some(extension) = path.extension() else { return Err(cannot("a name without an ending".to_owned())) };
        match extension.to_string_lossy().to_lowercase().as_str() {
            "exr" => Ok(Self::Exr),
            "png" => Ok(Self::Png),
            "npz" => Ok(Self::Npz),
            other => Err(cannot(format!("'.{other}'"))),
        }
    }
}

/// Writes the pictures of point spread functions.
///
/// # Errors
/// When the file cannot be written.
pub fn write_psfs(set: &PsfSet, path: &Path, format: PsfFormat) -> Result<(), PipelineError> {
    let cannot = |e: std::io::Error| PipelineError::Write { path: path.to_owned(), reason: e.to_string() };
    match format {
        PsfFormat::Exr => set.write_exr(path),
        PsfFormat::Npz => set.write_npz(path),
        PsfFormat::Png => std::fs::write(path, png_bytes(&psf_mosaic(set)?)?).map_err(cannot),
    }
}

/// Returns a self-contained page of point spread functions: the [mosaic](psf_mosaic), the charts, and the numbers as lines of text.
///
/// # Errors
/// When there are more points than a picture holds.
pub fn psf_page(set: &PsfSet, lens: &str, charts: &[LineChart], table: &str) -> Result<String, PipelineError> {
    let n = set.rows.len();
    let alt = format!("{n} point spread functions: wavelengths across, fields and distances down");
    let mut body = page::section("Point spread functions", &page::picture(&png_bytes(&psf_mosaic(set)?)?, &alt));
    body += &page::section("Charts", &page::charts(charts));
    body += &page::section("Numbers", &page::lines(table));
    let source = format!("{n} point spread functions on pixels of {} µm", number(set.pixel_um));
    Ok(page::page(lens, &source, &body))
}

/// Where tiles lie.
struct Layout {
    tile: u32,
    n_columns: u32,
    n_rows: u32,
}

impl Layout {
    /// Returns the top left corner of a tile, pixels.
    fn corner(&self, row: usize, column: usize) -> (u32, u32) {
        (LEFT + column as u32 * (self.tile + GAP), TOP + row as u32 * (self.tile + SCALE))
    }

    fn size(&self) -> (u32, u32) {
        // Room for the note above a single column.
        let width = (LEFT + self.n_columns * (self.tile + GAP)).max(LEFT + 420);
        (width, TOP + self.n_rows * (self.tile + SCALE))
    }

    fn put(&self, sheet: &mut RgbImage, tile: &RgbImage, row: usize, column: usize) {
        let (x, y) = self.corner(row, column);
        imageops::replace(sheet, tile, i64::from(x), i64::from(y));
    }
}

/// Returns the square of `side_px` pixels about the middle of a picture as `n` × `n` means over areas.
fn resampled(picture: &Array2<f32>, side_px: f64, n: usize) -> Array2<f32> {
    let step = side_px / n as f64;
    let shares = |i: usize, length: usize| {
        // Pixel k covers k to k + 1; the middle of the picture is that of its middle pixel.
        let low = (length / 2) as f64 + 0.5 - 0.5 * side_px + step * i as f64;
        let high = low + step;
        let first = low.floor().max(0.0) as usize;
        let last = (high.ceil().max(0.0) as usize).min(length);
        (first..last).map(move |k| (k, ((k + 1) as f64).min(high) - (k as f64).max(low))).collect::<Vec<_>>()
    };
    let (rows, columns) = picture.dim();
    let across: Vec<Vec<(usize, f64)>> = (0..n).map(|i| shares(i, columns)).collect();
    let down: Vec<Vec<(usize, f64)>> = (0..n).map(|i| shares(i, rows)).collect();
    Array2::from_shape_fn((n, n), |(row, column)| {
        let sum: f64 = down[row]
            .iter()
            .flat_map(|(r, a)| across[column].iter().map(move |(c, b)| a * b * f64::from(picture[(*r, *c)])))
            .sum();
        (sum / (step * step)) as f32
    })
}

/// Returns the largest of 1, 2 or 5 times a power of ten that is no larger.
fn round_down(most: f64) -> f64 {
    let up = round_up(most);
    let lower = [0.5, 0.4, 0.2].into_iter().map(|share| up * share);
    std::iter::once(up).chain(lower).find(|v| *v <= most * (1.0 + 1e-9) && is_round(*v)).unwrap_or(up)
}

fn is_round(value: f64) -> bool {
    (round_up(value) / value - 1.0).abs() < 1e-9
}

fn field(row: &PsfRow) -> String {
    match row.field_y_deg {
        0.0 => format!("{}°", number(row.field_deg)),
        y => format!("{}°, y {}°", number(row.field_deg), number(y)),
    }
}

fn length(um: f64) -> String {
    if um >= 1000.0 { format!("{} mm", number(1e-3 * um)) } else { format!("{} µm", number(um)) }
}

fn distance(mm: f64) -> String {
    match mm {
        mm if mm.is_infinite() => "∞".to_owned(),
        mm if mm >= 1000.0 => format!("{} m", number(1e-3 * mm)),
        mm => format!("{} mm", number(mm)),
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;

    use super::*;

    #[test]
    fn a_picture_resampled_keeps_its_place_and_its_level() {
        let mut picture = Array2::zeros((5, 5));
        picture[(2, 2)] = 1.0;
        picture[(1, 3)] = 0.5;
        // Three pixels across nine: each becomes three by three.
        let tile = resampled(&picture, 3.0, 9);
        assert_eq!((tile[(4, 4)], tile[(3, 3)], tile[(2, 6)], tile[(0, 0)]), (1.0, 1.0, 0.5, 0.0));
        // Finer than pixels or coarser, all light within is there.
        for (side, n) in [(5.0, 2), (5.0, 7), (9.0, 4)] {
            let mean = resampled(&picture, side, n).mean().unwrap();
            assert_abs_diff_eq!(f64::from(mean) * side * side, 1.5, epsilon = 1e-5);
        }
    }

    #[test]
    fn a_bar_has_its_length() {
        let mut sheet = RgbImage::from_pixel(60, 20, Rgb([255; 3]));
        draw_bar(&mut sheet, (5, 10), 40);
        let dark = |y: u32| (0..60).filter(|x| sheet.get_pixel(*x, y).0[0] < 128).collect::<Vec<u32>>();
        assert_eq!(dark(10), (5..45).collect::<Vec<u32>>());
        assert_eq!(dark(7), [5, 6, 43, 44]);
    }

    #[test]
    fn scales_are_round_and_fit() {
        assert_eq!([9.9, 10.0, 1.2, 49.0, 0.07].map(round_down), [5.0, 10.0, 1.0, 20.0, 0.05]);
        assert_eq!([200.0, 2000.0, 0.5].map(length), ["200 µm", "2 mm", "0.5 µm"]);
        assert_eq!([f64::INFINITY, 2500.0, 300.0].map(distance), ["∞", "2.5 m", "300 mm"]);
    }
}
