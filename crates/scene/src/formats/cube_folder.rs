//! A folder with a picture of each face of a cube, seen from its middle.

use std::path::{Path, PathBuf};

use dioptric_spectrum::SpectralImage;
use ndarray::{Array2, Axis, concatenate};

use super::{
    contents::{Contents, Image},
    picture::linear_srgb,
    reading::Panorama,
    stated::{name_of, note_of},
    unusable::unreadable,
};
use crate::SceneError;

/// The words that names of faces are or end in: right, left, up, down, front and back.
const NAMES: [&[&str]; 6] = [
    &["right", "px", "posx"],
    &["left", "nx", "negx"],
    &["up", "top", "py", "posy"],
    &["down", "bottom", "ny", "negy"],
    &["front", "pz", "posz"],
    &["back", "nz", "negz"],
];

const SIGNED: [&str; 6] = ["+x", "-x", "+y", "-y", "+z", "-z"];

/// Returns the face of the cube that a file is named after.
fn face_of(path: &Path) -> Option<usize> {
    let stem = path.file_stem()?.to_string_lossy().to_lowercase();
    // `+x`, `-z`.
    let signed = stem.get(stem.len().saturating_sub(2)..).unwrap_or_default();
    if let Some(number) = SIGNED.iter().position(|own| *own == signed) {
        return Some(number);
    }
    let word = stem.rsplit(|c: char| !c.is_ascii_alphanumeric()).next().unwrap_or_default().to_owned();
    NAMES.iter().position(|names| names.contains(&word.as_str()))
}

/// The files of six faces, and the names of other files beside them.
pub(super) struct CubeFolder {
    faces: [PathBuf; 6],
    others: Vec<String>,
}

impl CubeFolder {
    /// Finds the faces in a folder; `None` where it has not all six.
    pub(super) fn find(folder: &Path) -> Option<Self> {
        let mut paths: Vec<PathBuf> =
            std::fs::read_dir(folder).ok()?.filter_map(|entry| Some(entry.ok()?.path())).collect();
        paths.retain(|path| path.is_file());
        paths.sort();
        let face = |number: usize| paths.iter().find(|path| face_of(path) == Some(number)).cloned();
        let faces = [face(0)?, face(1)?, face(2)?, face(3)?, face(4)?, face(5)?];
        let others = paths.iter().filter(|path| !faces.contains(path)).map(|path| name_of(path)).collect();
        Some(Self { faces, others })
    }

    /// Returns the names of faces that a folder lacks which has three or more of them, as a cube's would.
    pub(super) fn missing(folder: &Path) -> Option<Vec<&'static str>> {
        let paths: Vec<PathBuf> =
            std::fs::read_dir(folder).ok()?.filter_map(|entry| Some(entry.ok()?.path())).collect();
        let is_there = |number: &usize| paths.iter().any(|path| path.is_file() && face_of(path) == Some(*number));
        let missing: Vec<usize> = (0..NAMES.len()).filter(|number| !is_there(number)).collect();
        (1..=3).contains(&missing.len()).then(|| missing.into_iter().map(|number| NAMES[number][0]).collect())
    }

    /// Reads the faces, each by `read`, and puts them side by side as a panorama.
    ///
    /// # Errors
    /// Those of the faces, and when they are not squares of one size and one kind.
    pub(super) fn read(
        self,
        folder: &Path,
        read: impl Fn(&Path) -> Result<Contents, SceneError>,
    ) -> Result<Contents, SceneError> {
        let mut faces = vec![];
        for path in &self.faces {
            let face = read(path)?;
            let (rows, columns) = face.size();
            let first: Option<&Contents> = faces.first();
            if rows != columns || first.is_some_and(|first| first.size() != (rows, columns)) {
                let reason = format!(
                    "it is {columns} × {rows} samples, expected a square as large as the other faces of the cube"
                );
                return Err(unreadable(path, reason));
            }
            faces.push(face);
        }
        let what = format!("six faces of a cube, each {}", faces[0].what);
        let heeds = faces[0].heeds;
        let mut notes: Vec<String> = faces.iter_mut().flat_map(|face| std::mem::take(&mut face.notes)).collect();
        notes.extend(note_of(folder, "file", &self.others));
        let own_grid = faces[0].own_grid.clone();
        let image = side_by_side(folder, faces)?;
        let panorama = Some(Panorama::Cube { yaw_deg: 0.0, pitch_deg: 0.0 });
        Ok(Contents { panorama, notes, own_grid, heeds, ..Contents::of(image, what) })
    }
}

fn side_by_side(folder: &Path, faces: Vec<Contents>) -> Result<Image, SceneError> {
    let differ = || unreadable(folder, "the faces of its cube are of different kinds or bands, expected six alike");
    let joined = |planes: &[&Array2<f32>]| {
        let views: Vec<_> = planes.iter().map(|plane| plane.view()).collect();
        concatenate(Axis(1), &views).expect("faces are of one size")
    };
    let images: Vec<Image> = faces.into_iter().map(|face| face.image).collect();
    if let Image::Spectral(first) = &images[0] {
        let spectral: Option<Vec<&SpectralImage>> = images
            .iter()
            .map(|image| match image {
                Image::Spectral(own) if (own.quantity(), own.grid()) == (first.quantity(), first.grid()) => Some(own),
                _ => None,
            })
            .collect();
        let spectral = spectral.ok_or_else(differ)?;
        let band = |band: usize| joined(&spectral.iter().map(|own| &own.planes()[band]).collect::<Vec<_>>());
        let planes = (0..first.grid().len()).map(band).collect();
        return Ok(Image::Spectral(SpectralImage::new(first.quantity(), first.grid().clone(), planes)?));
    }
    let mut white = None;
    let mut colors = vec![];
    for (index, image) in images.into_iter().enumerate() {
        let (planes, own_white) = match image {
            Image::Spectral(_) => return Err(differ()),
            Image::Linear { planes, white_cd_m2 } => (planes, white_cd_m2),
            Image::Codes(picture, stated) => (linear_srgb(picture, stated.as_ref()), None),
        };
        if index > 0 && own_white != white {
            return Err(differ());
        }
        white = own_white;
        colors.push(planes);
    }
    let plane = |k: usize| joined(&colors.iter().map(|planes| &planes[k]).collect::<Vec<_>>());
    Ok(Image::Linear { planes: [plane(0), plane(1), plane(2)], white_cd_m2: white })
}

#[cfg(test)]
mod tests {
    use super::SIGNED;
    use crate::{FileReading, ReadOptions, read_scene};

    /// Each face is of a gray of its own, and is found in its direction.
    #[test]
    fn faces_of_a_folder_are_seen_in_their_directions() {
        for names in [["right", "left", "up", "down", "front", "back"], ["px", "nx", "py", "ny", "pz", "nz"], SIGNED] {
            let folder = tempfile::tempdir().unwrap();
            for (face, name) in names.iter().enumerate() {
                let gray = image::RgbImage::from_pixel(8, 8, image::Rgb([40 * face as u8 + 40; 3]));
                dioptric_pictures::save(&gray.into(), &folder.path().join(format!("room_{name}.png"))).unwrap();
            }
            for (looks, face) in [("90,0", 0), ("-90,0", 1), ("0,90", 2), ("0,-90", 3), ("0,0", 4), ("180,0", 5)] {
                let panorama = Some(format!("cube:{looks}").parse().unwrap());
                let options = ReadOptions {
                    reading: FileReading { panorama, ..FileReading::default() },
                    horizontal_fov_deg: Some(60.0),
                    illuminance_lux: Some(1000.0),
                    ..ReadOptions::default()
                };
                let scene = read_scene(folder.path(), &options).unwrap();
                let white = 1000.0 / std::f64::consts::PI;
                let code = (40.0 * face as f64 + 40.0) / 255.0;
                let expected = white * ((code + 0.055) / 1.055).powf(2.4);
                // The lift to spectra and back, on bands of 10 nm.
                assert!((scene.mean_luminance_cd_m2() / expected - 1.0).abs() < 2e-3, "{looks}: {}", scene.notes[0]);
            }
            std::fs::remove_file(folder.path().join(format!("room_{}.png", names[2]))).unwrap();
            let message = read_scene(folder.path(), &ReadOptions::default()).unwrap_err().to_string();
            assert!(message.contains("of its six faces up are missing"), "{message}");
        }
        // Skies of games lie in frames of their own.
        let folder = tempfile::tempdir().unwrap();
        for name in ["rt", "lf", "up", "dn", "ft", "bk"] {
            let gray = image::RgbImage::from_pixel(8, 8, image::Rgb([40; 3]));
            dioptric_pictures::save(&gray.into(), &folder.path().join(format!("{name}.png"))).unwrap();
        }
        let reading = FileReading { panorama: "cube".parse().ok(), ..FileReading::default() };
        let options = ReadOptions { reading, horizontal_fov_deg: Some(60.0), ..ReadOptions::default() };
        let message = read_scene(folder.path(), &options).unwrap_err().to_string();
        assert!(message.contains("expected faces called right, left, up, down, front and back"), "{message}");
    }
}
