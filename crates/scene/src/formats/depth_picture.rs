//! Depth in a 16-bit picture beside an ordinary one, as depth cameras leave it.

use std::path::Path;

use dioptric_pictures::DynamicImage;
use dioptric_spectrum::DepthMap;
use ndarray::Array2;

use super::{
    beside::unreadable,
    camera::{beside, depth_unit_beside},
    picture::decode,
};
use crate::SceneError;

/// The depth that one code stands for where no camera file states it, m: depth cameras write millimetres.
const UNIT_M: f64 = 1e-3;

/// Reads the depth of a picture from the gray 16-bit picture beside it, or returns `None` where there is none.
///
/// For `room.png` the names looked for are `room.depth.png`, `room_depth.png` and the same with `.tif`. Codes are millimetres
/// along the axis, or what `depth_unit_m` of the camera file beside the picture says. Code 0 says that nothing was measured:
/// such a place gets the farther of the depths next to it in its row, as what a depth camera does not see mostly lies
/// behind an edge.
pub(crate) fn depth_beside(picture: &Path, rows: usize, columns: usize) -> Result<Option<DepthMap>, SceneError> {
    let endings = [".depth.png", "_depth.png", ".depth.tif", "_depth.tif"];
    let is_other = |path: &Path| path != picture && path.is_file();
    let Some(path) = beside(picture, &endings).into_iter().find(|path| is_other(path)) else { return Ok(None) };
    let wrong = |reason: String| Err(unreadable(&path, reason));
    let codes = match decode(&path)? {
        DynamicImage::ImageLuma16(codes) => codes,
        other => return wrong(format!("its samples are {:?}, expected gray ones of 16 bits", other.color())),
    };
    if (codes.height() as usize, codes.width() as usize) != (rows, columns) {
        let (width, height) = codes.dimensions();
        return wrong(format!("it has {width} × {height} samples, but {} has {columns} × {rows}", picture.display()));
    }
    let unit_m = depth_unit_beside(picture)?.unwrap_or(UNIT_M);
    let mut z_m = Array2::from_shape_fn((rows, columns), |(row, column)| {
        (unit_m * f64::from(codes.get_pixel(column as u32, row as u32)[0])) as f32
    });
    fill_unmeasured(&mut z_m);
    match DepthMap::new(z_m) {
        Ok(depth) => Ok(Some(depth)),
        Err(_) => wrong("no sample of it has a depth".to_owned()),
    }
}

/// Gives places of depth 0 the farther of the depths next to them in their row, and rows without any the row above or, at the
/// top, below.
fn fill_unmeasured(z_m: &mut Array2<f32>) {
    for mut row in z_m.rows_mut() {
        let measured: Vec<f32> = row.to_vec();
        let last_before = |end: usize| measured[..end].iter().rev().copied().find(|&z| z > 0.0).unwrap_or(0.0);
        let mut column = 0;
        while column < measured.len() {
            if measured[column] > 0.0 {
                column += 1;
                continue;
            }
            let length = measured[column..].iter().take_while(|&&z| z == 0.0).count();
            let after = measured.get(column + length).copied().unwrap_or(0.0);
            row.slice_mut(ndarray::s![column..column + length]).fill(last_before(column).max(after));
            column += length;
        }
    }
    let is_known = |z_m: &Array2<f32>, row: usize| z_m[(row, 0)] > 0.0;
    let n_rows = z_m.nrows();
    let fill = |z_m: &mut Array2<f32>, row: usize, from: usize| {
        if !is_known(z_m, row) && is_known(z_m, from) {
            let copy = z_m.row(from).to_owned();
            z_m.row_mut(row).assign(&copy);
        }
    };
    (1..n_rows).for_each(|row| fill(z_m, row, row - 1));
    (1..n_rows).rev().for_each(|row| fill(z_m, row - 1, row));
}

#[cfg(test)]
mod tests {
    use super::*;
    use dioptric_pictures::save;
    use image::{ImageBuffer, Luma};
    use std::fs;

    fn read(name: &str, codes: &[[u16; 4]], camera: Option<&str>) -> Result<Option<DepthMap>, SceneError> {
        let folder = tempfile::tempdir().unwrap();
        let depth = ImageBuffer::from_fn(4, codes.len() as u32, |x, y| Luma([codes[y as usize][x as usize]]));
        save(&depth.into(), &folder.path().join(name)).unwrap();
        if let Some(text) = camera {
            fs::write(folder.path().join("room.camera.json"), text).unwrap();
        }
        depth_beside(&folder.path().join("room.png"), 2, 4)
    }

    #[test]
    fn depth_beside_a_picture_is_in_millimetres() {
        for name in ["room.depth.png", "room_depth.png", "room.depth.tif"] {
            let depth = read(name, &[[500, 1000, 1500, 2000], [700; 4]], None).unwrap().unwrap();
            assert_eq!((depth.range_m(), depth.z_m()[(0, 1)]), ((0.5, 2.0), 1.0), "{name}");
        }
        assert_eq!(depth_beside(Path::new("nowhere/room.png"), 2, 4), Ok(None));
    }

    #[test]
    fn camera_file_states_the_unit_of_depth() {
        let camera = |unit: &str| {
            format!(
                r#"{{"width": 4, "height": 2, "fx_px": 5, "fy_px": 5, "cx_px": 1.5, "cy_px": 0.5, "depth_unit_m": {unit}}}"#
            )
        };
        let read = |unit| read("room.depth.png", &[[5000; 4], [10_000; 4]], Some(&camera(unit)));
        let (near_m, far_m) = read("2e-4").unwrap().unwrap().range_m();
        // Single precision.
        assert!((near_m - 1.0).abs() < 1e-6 && (far_m - 2.0).abs() < 1e-6);
        let message = read("-1").unwrap_err().to_string();
        assert!(message.contains("room.camera.json") && message.contains("depth_unit_m is -1"), "{message}");
    }

    #[test]
    fn what_was_not_measured_lies_behind() {
        let depth = read("room.depth.png", &[[500, 0, 0, 1500], [0, 700, 0, 0]], None).unwrap().unwrap();
        let row = |row: usize| depth.z_m().row(row).to_vec();
        assert_eq!((row(0), row(1)), (vec![0.5, 1.5, 1.5, 1.5], vec![0.7; 4]));
        let above = read("room.depth.png", &[[0; 4], [900, 0, 800, 0]], None).unwrap().unwrap();
        assert_eq!(above.z_m().row(0).to_vec(), vec![0.9, 0.9, 0.8, 0.8]);
    }

    #[test]
    fn depth_that_does_not_fit_is_refused_by_name() {
        for (codes, word) in [(vec![[500; 4]], "4 × 1"), (vec![[0; 4]; 2], "no sample")] {
            let message = read("room.depth.png", &codes, None).unwrap_err().to_string();
            assert!(message.contains("room.depth.png") && message.contains(word), "{message}");
        }
        let folder = tempfile::tempdir().unwrap();
        save(&image::RgbImage::new(4, 2).into(), &folder.path().join("room.depth.png")).unwrap();
        let message = depth_beside(&folder.path().join("room.png"), 2, 4).unwrap_err().to_string();
        assert!(message.contains("16 bits"), "{message}");
    }
}
