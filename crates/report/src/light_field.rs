//! A light field in pictures: its views, a series of refocused ones, and its depth.

mod hci;

use std::path::Path;

use dioptric_pipeline::{
    DepthEstimate, LightField, ParallelCameras, PipelineError, display::LinearRgb, write_file, write_json,
};
use dioptric_scene::{ExrSamples, write_planes_exr};
use image::{Rgb, RgbImage, imageops};
use ndarray::Array2;
use serde::Serialize;

use crate::{
    lettering::{Ink, Weight, write},
    png::{enlarged, png_bytes},
};

/// Columns that small pictures are enlarged to, about.
const COLUMNS: usize = 480;
/// Between the views of a sheet, px.
const GAP: u32 = 2;
/// Below this confidence a depth is shown gray.
const CONFIDENT: f32 = 0.3;
/// Dark violet, blue, teal, green, yellow: even steps of lightness (the map viridis of matplotlib, CC0).
const SCALE: [[f64; 3]; 5] =
    [[68.0, 1.0, 84.0], [59.0, 82.0, 139.0], [33.0, 145.0, 140.0], [94.0, 201.0, 98.0], [253.0, 231.0, 37.0]];

/// How views are written besides as pictures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ViewFiles {
    /// As `view-ROW-COLUMN.exr`: linear light, with the true depth `Z` and `disparity` of each sample where the scene is known.
    pub exr: bool,
    /// As the folder `hci`, laid out as the 4D Light Field Benchmark is.
    pub hci: bool,
}

/// How far an estimated depth is from the true one, over the samples that are certain.
#[derive(Clone, Debug, Serialize)]
pub struct DepthError {
    /// The median of |estimate / truth − 1|.
    pub median: f64,
    /// The share of samples that are less than 1 % wrong.
    pub share_within_1_percent: f64,
    /// The share of samples whose disparity is less than 0.07 pixels wrong, as the benchmark counts.
    pub share_within_0_07_px: f64,
}

/// What was written of a light field.
#[derive(Clone, Debug, Serialize)]
pub struct LightFieldReport {
    /// Rows and columns of viewpoints.
    pub n_views: (usize, usize),
    /// Rows and columns of samples of each view.
    pub size: (usize, usize),
    /// Viewpoints, row by row from the top left, of which no light is cut off by the rim of the pupil: only these are used.
    pub whole: Vec<bool>,
    /// Depths that a picture was refocused on, m, with the disparity of neighboring views there, pixels.
    pub refocused: Vec<(f64, f64)>,
    /// The least, the median and the greatest depth, m, of the samples whose depth is certain enough to be used.
    pub depth_m: Option<[f32; 3]>,
    /// The share of such samples.
    pub confident_share: f64,
    /// How wrong these are, where the scene is known and a view is in the middle.
    pub depth_error: Option<DepthError>,
    /// The parallel cameras that show the same disparities.
    pub cameras_alike: CamerasAlike,
    /// The files.
    pub files: Vec<String>,
}

/// Parallel cameras that show points of each depth as far apart as views do.
#[derive(Clone, Debug, Serialize)]
pub struct CamerasAlike {
    /// The image of a unit tangent, mm.
    pub scale_mm: f64,
    /// Between samples, mm.
    pub pitch_mm: f64,
    /// Between neighbors, mm.
    pub baseline_mm: f64,
    /// The depth that all show at the same place, m; none where that is infinite.
    pub focus_m: Option<f64>,
}

/// Writes a light field into a folder: `views.png`, a `view-ROW-COLUMN.png` each, `refocus-NN.png` for each depth,
/// `depth.exr` (`Z`, m; `disparity`, px; `confidence`; where the scene is known `Z_true` and `disparity_true`), `depth.png` and
/// `lightfield.json`; and the views in the other ways that are asked for.
///
/// # Errors
/// When a file cannot be written, or the benchmark's layout is asked for and no view is in the middle.
pub fn write_light_field(
    field: &LightField,
    estimate: &DepthEstimate,
    depths_m: &[f64],
    also: ViewFiles,
    folder: &Path,
) -> Result<LightFieldReport, PipelineError> {
    let mut files = Vec::new();
    let mut put = |name: String, picture: &RgbImage| {
        write_file(&folder.join(&name), &png_bytes(picture)?)?;
        files.push(name);
        Ok::<(), PipelineError>(())
    };
    let (rows, columns) = field.n_views();
    let view = |row: usize, column: usize| of_planes(field.view(row, column).unwrap_or_default());
    let white = view(rows / 2, columns / 2).level_at(0.99).max(f64::MIN_POSITIVE);
    let factor = COLUMNS.div_ceil(field.size().1).max(1) as u32;
    let (height, width) = (field.size().0 as u32 + GAP, field.size().1 as u32 + GAP);
    let mut sheet = RgbImage::new(columns as u32 * width - GAP, rows as u32 * height - GAP);
    for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
        let picture = view(row, column).within_gamut().to_srgb(white);
        imageops::replace(&mut sheet, &picture, i64::from(column as u32 * width), i64::from(row as u32 * height));
        put(format!("view-{}-{}.png", row + 1, column + 1), &enlarged(&picture, factor))?;
    }
    put("views.png".to_owned(), &sheet)?;
    let mut refocused = Vec::new();
    for (number, &depth_m) in depths_m.iter().enumerate() {
        let disparity_px = field.geometry().disparity_px(depth_m);
        let picture = of_planes(&field.refocused(disparity_px)).within_gamut().to_srgb(white);
        put(format!("refocus-{:02}.png", number + 1), &titled(&enlarged(&picture, factor), &in_meters(depth_m)))?;
        refocused.push((depth_m, disparity_px));
    }
    put("depth.png".to_owned(), &depth_picture(estimate, field, factor))?;
    let mut planes =
        vec![("Z", &estimate.depth_m), ("disparity", &estimate.disparity_px), ("confidence", &estimate.confidence)];
    let truth = middle_truth(field);
    if let Some((depth_m, disparity_px)) = &truth {
        planes.extend([("Z_true", depth_m), ("disparity_true", disparity_px)]);
    }
    write_planes_exr(&folder.join("depth.exr"), &planes, ExrSamples::Single)?;
    files.push("depth.exr".to_owned());
    if also.exr {
        files.extend(write_views_exr(field, folder)?);
    }
    if also.hci {
        files.extend(hci::write(field, white, folder)?);
    }
    files.push("lightfield.json".to_owned());
    let told = estimate.depth_m.iter().zip(&estimate.confidence);
    let mut confident: Vec<f32> = told.filter(|(_, c)| **c >= CONFIDENT).map(|(depth_m, _)| *depth_m).collect();
    confident.sort_by(f32::total_cmp);
    let n = confident.len();
    let report = LightFieldReport {
        n_views: (rows, columns),
        size: field.size(),
        whole: (0..rows * columns).map(|i| field.is_whole(i / columns, i % columns)).collect(),
        refocused,
        depth_m: (n > 0).then(|| [confident[0], confident[n / 2], confident[n - 1]]),
        confident_share: n as f64 / estimate.depth_m.len() as f64,
        depth_error: truth.and_then(|truth| DepthError::of(estimate, &truth)),
        cameras_alike: CamerasAlike::of(field),
        files,
    };
    write_json(&folder.join("lightfield.json"), &report)?;
    Ok(report)
}

impl CamerasAlike {
    fn of(field: &LightField) -> Self {
        let ParallelCameras { scale_mm, pitch_mm, baseline_mm, focus_m } = field.geometry().cameras_alike();
        Self { scale_mm, pitch_mm, baseline_mm, focus_m: focus_m.is_finite().then_some(focus_m) }
    }
}

impl DepthError {
    /// Returns the error of what is certain and has a finite true depth; `None` where there is no such sample.
    fn of(estimate: &DepthEstimate, (depth_m, disparity_px): &(Array2<f32>, Array2<f32>)) -> Option<Self> {
        let is_told = |place: &(usize, usize)| estimate.confidence[*place] >= CONFIDENT && depth_m[*place].is_finite();
        let places: Vec<_> = ndarray::indices(depth_m.dim()).into_iter().filter(is_told).collect();
        let of_depth = |place: &(usize, usize)| f64::from((estimate.depth_m[*place] / depth_m[*place] - 1.0).abs());
        let of_disparity = |place: &(usize, usize)| (estimate.disparity_px[*place] - disparity_px[*place]).abs();
        let mut errors: Vec<f64> = places.iter().map(of_depth).collect();
        errors.sort_by(f64::total_cmp);
        let share = |n: usize| n as f64 / places.len() as f64;
        Some(Self {
            median: *errors.get(errors.len() / 2)?,
            share_within_1_percent: share(errors.partition_point(|error| *error < 0.01)),
            share_within_0_07_px: share(places.iter().filter(|place| of_disparity(place) < 0.07).count()),
        })
    }
}

/// Returns the true depth and disparity of the view in the middle, where there is one and the scene is known.
fn middle_truth(field: &LightField) -> Option<(Array2<f32>, Array2<f32>)> {
    let (rows, columns) = field.n_views();
    (rows % 2 == 1 && columns % 2 == 1).then(|| truth_of(field, rows / 2, columns / 2))?
}

/// Returns the true depth, m, and disparity, px, of the samples of a view, where the scene is known.
fn truth_of(field: &LightField, row: usize, column: usize) -> Option<(Array2<f32>, Array2<f32>)> {
    let depth_m = field.true_depth_m(row, column)?;
    let disparity_px = depth_m.mapv(|depth_m| field.geometry().disparity_px(f64::from(depth_m)) as f32);
    Some((depth_m.clone(), disparity_px))
}

fn write_views_exr(field: &LightField, folder: &Path) -> Result<Vec<String>, PipelineError> {
    let (rows, columns) = field.n_views();
    let places = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
    places
        .map(|(row, column)| {
            let name = format!("view-{}-{}.exr", row + 1, column + 1);
            let truth = truth_of(field, row, column);
            let names: &[&str] =
                if field.view(row, column).is_some_and(|planes| planes.len() == 3) { &["R", "G", "B"] } else { &["Y"] };
            let mut planes: Vec<(&str, &Array2<f32>)> =
                names.iter().copied().zip(field.view(row, column).unwrap_or_default()).collect();
            if let Some((depth_m, disparity_px)) = &truth {
                planes.extend([("Z", depth_m), ("disparity", disparity_px)]);
            }
            write_planes_exr(&folder.join(&name), &planes, ExrSamples::Single)?;
            Ok(name)
        })
        .collect()
}

fn of_planes(planes: &[Array2<f32>]) -> LinearRgb {
    // Of one channel a gray picture.
    LinearRgb { planes: std::array::from_fn(|i| planes.get(i).or(planes.first()).cloned().unwrap_or_default()) }
}

fn in_meters(depth_m: f64) -> String {
    if depth_m.is_infinite() { "refocused on infinity".to_owned() } else { format!("refocused on {depth_m:.3} m") }
}

/// Returns the picture below a line of words.
fn titled(picture: &RgbImage, words: &str) -> RgbImage {
    let top = 26;
    let mut sheet = RgbImage::from_pixel(picture.width(), picture.height() + top, Rgb([255; 3]));
    let ink = Ink { em_px: 12.0, weight: Weight::Regular, color: [40; 3] };
    write(&mut sheet, (4.0, f64::from(top) - 8.0), &ink, words);
    imageops::replace(&mut sheet, picture, 0, i64::from(top));
    sheet
}

/// Returns the depth as colors that are even in disparity, near yellow and far violet, beside the scale; gray where the views
/// agree at other depths as well.
fn depth_picture(estimate: &DepthEstimate, field: &LightField, factor: u32) -> RgbImage {
    let finite = || estimate.disparity_px.iter().copied().filter(|d| d.is_finite());
    let (least, most) = finite().fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), d| (a.min(d), b.max(d)));
    let (least, most) = if least < most { (least, most) } else { (least - 0.5, least + 0.5) };
    let (rows, columns) = estimate.disparity_px.dim();
    let picture = RgbImage::from_fn(columns as u32, rows as u32, |x, y| {
        let at = (y as usize, x as usize);
        let full = color((estimate.disparity_px[at] - least) / (most - least));
        let share = f64::from((estimate.confidence[at] / CONFIDENT).clamp(0.0, 1.0));
        Rgb(full.map(|v| (160.0 + share * (v - 160.0)).round() as u8))
    });
    let picture = enlarged(&picture, factor);
    let (bar, room) = (20, 90);
    let mut sheet = RgbImage::from_pixel(picture.width() + bar + room, picture.height().max(60), Rgb([255; 3]));
    imageops::replace(&mut sheet, &picture, 0, 0);
    let height = sheet.height();
    for (x, y) in (0..bar).flat_map(|x| (0..height).map(move |y| (x, y))) {
        let share = 1.0 - (y as f32 + 0.5) / height as f32;
        sheet.put_pixel(picture.width() + 8 + x, y, Rgb(color(share).map(|v| v.round() as u8)));
    }
    let ink = Ink { em_px: 12.0, weight: Weight::Regular, color: [40; 3] };
    for i in 0..5_u8 {
        let share = f64::from(i) / 4.0;
        let depth_m = field.geometry().depth_m(f64::from(least) + share * f64::from(most - least));
        let words = if depth_m.is_infinite() { "∞".to_owned() } else { format!("{depth_m:.3} m") };
        let y = (1.0 - share) * (f64::from(height) - 16.0) + 12.0;
        write(&mut sheet, (f64::from(picture.width() + bar) + 14.0, y), &ink, &words);
    }
    sheet
}

/// Returns the color of a share of the scale, 0 to 255 a channel.
fn color(share: f32) -> [f64; 3] {
    let at = f64::from(if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) }) * (SCALE.len() - 1) as f64;
    let below = (at as usize).min(SCALE.len() - 2);
    let t = at - below as f64;
    std::array::from_fn(|i| SCALE[below][i] + t * (SCALE[below + 1][i] - SCALE[below][i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scale_runs_from_violet_to_yellow() {
        assert_eq!((color(0.0), color(1.0)), (SCALE[0], SCALE[4]));
        assert_eq!((color(0.5), color(f32::NAN)), (SCALE[2], SCALE[0]));
        // Lightness grows all along.
        let luma = |share: f32| color(share).iter().zip([0.2126, 0.7152, 0.0722]).map(|(v, w)| v * w).sum::<f64>();
        assert!((0..20).all(|i| luma(i as f32 / 20.0) < luma((i + 1) as f32 / 20.0)));
    }
}
