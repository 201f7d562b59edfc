//! The layout of the 4D Light Field Benchmark (Honauer, Johannsen, Kondermann and Goldluecke 2016), which most tools that estimate
//! depth read.
//!
//! `input_CamNNN.png` are the views row by row from the top left, `gt_depth_lowres.pfm` (m) and `gt_disp_lowres.pfm` (px) the truth of the one
//! in the middle and `…_CamNNN.pfm` of each, and `parameters.cfg` the parallel cameras: with its names a disparity is
//! `baseline_mm · focal_length_mm · max(resolution) / sensor_size_mm · (1/z − 1/focus_distance)`, z and focus in mm.

use std::{fmt::Write as _, path::Path};

use dioptric_pipeline::{LightField, PipelineError, write_file};
use ndarray::Array2;

use super::{of_planes, truth_of};
use crate::png::png_bytes;

/// The folder.
const FOLDER: &str = "hci";
/// Stands for a focus at infinity, m: what reads the file divides by it.
const FAR_FOCUS_M: f64 = 1e9;

/// Writes the folder, pictures with `white` in linear light as their white; returns the names of the files.
pub(super) fn write(field: &LightField, white: f64, folder: &Path) -> Result<Vec<String>, PipelineError> {
    let (rows, columns) = field.n_views();
    if rows % 2 == 0 || columns % 2 == 0 {
        let reason = format!(
            "has {columns} × {rows} views, none of them in the middle, which the benchmark's layout needs: expected odd numbers, behind an array by --views"
        );
        return Err(PipelineError::Unsuitable { what: "the light field", reason });
    }
    let own = folder.join(FOLDER);
    std::fs::create_dir_all(&own).map_err(|e| PipelineError::Write { path: own.clone(), reason: e.to_string() })?;
    let mut files = Vec::new();
    let mut put = |name: String, bytes: &[u8]| {
        write_file(&own.join(&name), bytes)?;
        files.push(format!("{FOLDER}/{name}"));
        Ok::<(), PipelineError>(())
    };
    let mut disparities = (f32::INFINITY, f32::NEG_INFINITY);
    for number in 0..rows * columns {
        let (row, column) = (number / columns, number % columns);
        let picture = of_planes(field.view(row, column).unwrap_or_default()).within_gamut().to_srgb(white);
        put(format!("input_Cam{number:03}.png"), &png_bytes(&picture)?)?;
        let Some((depth_m, disparity_px)) = truth_of(field, row, column) else { continue };
        let is_middle = number == rows * columns / 2;
        for (kind, plane) in [("depth", &depth_m), ("disp", &disparity_px)] {
            let bytes = pfm(plane);
            put(format!("gt_{kind}_lowres_Cam{number:03}.pfm"), &bytes)?;
            if is_middle {
                put(format!("gt_{kind}_lowres.pfm"), &bytes)?;
            }
        }
        if is_middle {
            let finite = disparity_px.iter().filter(|d| d.is_finite());
            disparities = finite.fold(disparities, |(low, high), d| (low.min(*d), high.max(*d)));
        }
    }
    put("parameters.cfg".to_owned(), parameters(field, disparities).as_bytes())?;
    Ok(files)
}

fn parameters(field: &LightField, (least_px, most_px): (f32, f32)) -> String {
    let ((rows, columns), (height, width)) = (field.n_views(), field.size());
    let alike = field.geometry().cameras_alike();
    let mut text = format!(
        "[intrinsics]\nfocal_length_mm = {}\nimage_resolution_x_px = {width}\nimage_resolution_y_px = {height}\nsensor_size_mm = {}\n\n",
        alike.scale_mm,
        alike.pitch_mm * width.max(height) as f64
    );
    let focus_m = alike.focus_m.min(FAR_FOCUS_M);
    write!(
        text,
        "[extrinsics]\nnum_cams_x = {columns}\nnum_cams_y = {rows}\nbaseline_mm = {}\nfocus_distance_m = {focus_m}\n\n[meta]\ndepth_map_scale = 1.0\n",
        alike.baseline_mm
    )
    .expect("text can be added to text");
    if least_px <= most_px {
        writeln!(text, "disp_min = {least_px}\ndisp_max = {most_px}").expect("text can be added to text");
    }
    text
}

/// Returns a portable float map: rows from the bottom up, little-endian.
fn pfm(plane: &Array2<f32>) -> Vec<u8> {
    let (rows, columns) = plane.dim();
    let mut bytes = format!("Pf\n{columns} {rows}\n-1.0\n").into_bytes();
    plane.outer_iter().rev().for_each(|row| row.iter().for_each(|v| bytes.extend(v.to_le_bytes())));
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn float_maps_begin_at_the_bottom() {
        let plane = ndarray::arr2(&[[1.0, 2.0, 3.0], [4.0, 5.0, 6.5]]);
        let bytes = pfm(&plane);
        let (header, samples) = bytes.split_at(b"Pf\n3 2\n-1.0\n".len());
        assert_eq!(header, b"Pf\n3 2\n-1.0\n");
        let values: Vec<f32> = samples.chunks(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        assert_eq!(values, [4.0, 5.0, 6.5, 1.0, 2.0, 3.0]);
    }
}
