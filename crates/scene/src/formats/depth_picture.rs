//! Depth in a 16-bit picture beside an ordinary one, as depth cameras leave it.

use std::path::{Path, PathBuf};

use dioptric_pictures::DynamicImage;
use ndarray::Array2;

use super::{
    camera::{beside, depth_unit_beside},
    picture::decode,
    unusable::unreadable,
};
use crate::SceneError;

/// The depth that one code stands for where no camera file states it, m: depth cameras write millimetres.
const UNIT_M: f64 = 1e-3;

/// Reads the depth of a picture from the gray 16-bit picture beside it, with the path of that, or returns `None` where there is
/// none.
///
/// For `room.png` the names looked for are `room.depth.png`, `room_depth.png` and the same with `.tif`. Codes are millimetres
/// along the axis, or what `depth_unit_m` of the camera file beside the picture says. A depth of 0 says that nothing was measured.
pub(super) fn depth_beside(
    picture: &Path,
    rows: usize,
    columns: usize,
) -> Result<Option<(PathBuf, Array2<f32>)>, SceneError> {
    let endings = [".depth.png", "_depth.png", ".depth.tif", "_depth.tif"];
    let is_other = |path: &Path| path != picture && path.is_file();
    let Some(path) = beside(picture, &endings).into_iter().find(|path| is_other(path)) else { return Ok(None) };
    let wrong = |reason: String| Err(unreadable(&path, reason));
    let codes = match decode(&path, 4)? {
        DynamicImage::ImageLuma16(codes) => codes,
        other => return wrong(format!("its samples are {:?}, expected gray ones of 16 bits", other.color())),
    };
    if (codes.height() as usize, codes.width() as usize) != (rows, columns) {
        let (width, height) = codes.dimensions();
        return wrong(format!("it has {width} × {height} samples, but {} has {columns} × {rows}", picture.display()));
    }
    let unit_m = depth_unit_beside(picture)?.unwrap_or(UNIT_M);
    let z_m = Array2::from_shape_fn((rows, columns), |(row, column)| {
        (unit_m * f64::from(codes.get_pixel(column as u32, row as u32)[0])) as f32
    });
    Ok(Some((path, z_m)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use dioptric_pictures::save;
    use image::{ImageBuffer, Luma};
    use std::fs;

    fn read(name: &str, codes: &[[u16; 4]], camera: Option<&str>) -> Result<Option<Array2<f32>>, SceneError> {
        let folder = tempfile::tempdir().unwrap();
        let depth = ImageBuffer::from_fn(4, codes.len() as u32, |x, y| Luma([codes[y as usize][x as usize]]));
        save(&depth.into(), &folder.path().join(name)).unwrap();
        if let Some(text) = camera {
            fs::write(folder.path().join("room.camera.json"), text).unwrap();
        }
        Ok(depth_beside(&folder.path().join("room.png"), 2, 4)?.map(|(_, z_m)| z_m))
    }

    #[test]
    fn depth_beside_a_picture_is_in_millimetres() {
        for name in ["room.depth.png", "room_depth.png", "room.depth.tif"] {
            let depth = read(name, &[[500, 1000, 1500, 2000], [700; 4]], None).unwrap().unwrap();
            assert_eq!(depth, ndarray::arr2(&[[0.5, 1.0, 1.5, 2.0], [0.7; 4]]), "{name}");
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
        let depth = read("2e-4").unwrap().unwrap();
        let (near_m, far_m) = (depth[(0, 0)], depth[(1, 3)]);
        // Single precision.
        assert!((near_m - 1.0).abs() < 1e-6 && (far_m - 2.0).abs() < 1e-6);
        let message = read("-1").unwrap_err().to_string();
        assert!(message.contains("room.camera.json") && message.contains("depth_unit_m is -1"), "{message}");
    }

    #[test]
    fn depth_that_does_not_fit_is_refused_by_name() {
        let message = read("room.depth.png", &[[500; 4]], None).unwrap_err().to_string();
        assert!(message.contains("room.depth.png") && message.contains("4 × 1"), "{message}");
        let folder = tempfile::tempdir().unwrap();
        save(&image::RgbImage::new(4, 2).into(), &folder.path().join("room.depth.png")).unwrap();
        let message = depth_beside(&folder.path().join("room.png"), 2, 4).unwrap_err().to_string();
        assert!(message.contains("16 bits"), "{message}");
    }
}
