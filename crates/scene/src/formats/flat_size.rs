//! How many samples a file has, by its header alone.

use std::path::Path;

use dioptric_pictures::orientation_of;
use image::metadata::Orientation;

use super::{
    contents::is_of,
    depth::files_beside,
    envi::{envi_size, header_of},
    picture::picture_size_of,
    reading::FileReading,
};

/// Returns the rows and columns of a scene's file that has no depth of its own nor one beside it, where its header tells them: an ENVI
/// cube's or an ordinary picture's, upright. `None` where samples have to be read to know.
pub fn flat_size_of(path: &Path, reading: &FileReading) -> Option<(usize, usize)> {
    if reading.depth.is_some() || reading.panorama.is_some() || path.is_dir() || !files_beside(path).is_empty() {
        return None;
    }
    if is_of(path, &["png", "jpg", "jpeg", "webp", "bmp", "tif", "tiff"]) {
        let (columns, rows) = picture_size_of(path).ok()?;
        let is_turned = matches!(
            orientation_of(path),
            Orientation::Rotate90 | Orientation::Rotate270 | Orientation::Rotate90FlipH | Orientation::Rotate270FlipH
        );
        return Some(if is_turned { (columns, rows) } else { (rows, columns) });
    }
    let header = if is_of(path, &["hdr"]) { path.to_owned() } else { header_of(path)? };
    envi_size(&header)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ReadOptions, read_scene};

    /// What the header tells is what a reader of all samples finds.
    #[test]
    fn headers_tell_the_size_of_the_scene() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        dioptric_pictures::save(&image::RgbImage::new(7, 4).into(), &at("a.png")).unwrap();
        let head = "ENVI\nsamples = 5\nlines = 3\nbands = 2\ndata type = 1\ninterleave = bip\nwavelength = {500, 600}\n\
                    reflectance scale factor = 255\n";
        std::fs::write(at("b.hdr"), head).unwrap();
        std::fs::write(at("b.raw"), [9; 30]).unwrap();
        let told = FileReading::default();
        for name in ["a.png", "b.hdr", "b.raw"] {
            let scene = read_scene(&at(name), &ReadOptions::default()).unwrap();
            assert_eq!(flat_size_of(&at(name), &told), Some((scene.rows(), scene.columns())), "{name}");
        }
        // Depth beside it decides how the scene is seen, and a panorama's view has other samples.
        dioptric_pictures::save(&image::GrayImage::new(7, 4).into(), &at("a.depth.png")).unwrap();
        assert_eq!(flat_size_of(&at("a.png"), &told), None);
        let panorama = FileReading { panorama: "equirectangular".parse().ok(), ..told.clone() };
        assert_eq!(flat_size_of(&at("b.hdr"), &panorama), None);
        assert_eq!(flat_size_of(&at("absent.hdr"), &told), None);
    }

    #[dioptric_golden::needs_shared]
    #[test]
    fn turned_pictures_are_counted_upright() {
        let Some(path) = dioptric_golden::shared("inputs/user/rot.jpg") else { return };
        let scene = read_scene(&path, &ReadOptions::default()).unwrap();
        assert_ne!(scene.rows(), scene.columns());
        assert_eq!(flat_size_of(&path, &FileReading::default()), Some((scene.rows(), scene.columns())));
    }
}
