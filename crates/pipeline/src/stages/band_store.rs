//! Finished bands of the irradiance in a file, from which a killed run goes on.

use std::{
    fs::{self, File, OpenOptions},
    io::{Read, Seek, SeekFrom, Write},
    ops::Range,
    path::{Path, PathBuf},
};

use ndarray::Array2;

use super::spec::IrradianceInputs;
use crate::{Camera, PipelineError, Quality};

/// What the bands are made from.
const KEY: &str = "bands.ron";
/// The bands one after the other, little-endian.
const BANDS: &str = "bands.raw";

/// Rows of a band that are read or written at a time.
const ROWS_AT_ONCE: usize = 64;

/// How a camera keeps bands as they are finished.
#[derive(Clone, Copy, Debug)]
pub(super) struct BandKeeping<'a> {
    /// The folder.
    pub(super) path: &'a Path,
    /// The build of the program, since another may image otherwise.
    pub(super) build: &'a str,
    pub(super) quality: Quality,
    pub(super) camera: &'a Camera,
}

impl BandKeeping<'_> {
    /// Returns the folder with what its bands are made from.
    pub(super) fn folder(&self, inputs: &IrradianceInputs) -> Result<BandFolder, PipelineError> {
        let key = (self.build, self.quality, self.camera, inputs.files().collect::<Vec<_>>());
        let key = ron::to_string(&key)
            .map_err(|error| PipelineError::Write { path: self.path.to_owned(), reason: error.to_string() })?;
        Ok(BandFolder { path: self.path.to_owned(), key, photodiode: None })
    }
}

/// A folder in which bands are kept as they are finished, and what they are made from: another camera's are not taken.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct BandFolder {
    pub(super) path: PathBuf,
    pub(super) key: String,
    /// The photodiode that they are the light of; none of whole pixels.
    pub(super) photodiode: Option<usize>,
}

/// Whether an unfinished run has kept bands in this folder.
pub fn has_kept_bands(folder: &Path) -> bool {
    let has_any = |name: &str| fs::metadata(folder.join(name)).is_ok_and(|bands| bands.len() > 0);
    has_any(BANDS) || has_any(&format!("photodiode-0-{BANDS}"))
}

/// The file of the bands, open.
pub(super) struct BandStore {
    file: File,
    path: PathBuf,
    size: (usize, usize),
    n_done: usize,
}

impl BandFolder {
    /// Returns the folder of the bands of one of the photodiodes that share the light of each pixel.
    pub(super) fn of_photodiode(&self, number: usize) -> Self {
        Self { photodiode: Some(number), ..self.clone() }
    }

    /// The name of the file of the bands, or of the file that holds what they are made from.
    fn name(&self, name: &str) -> String {
        self.photodiode.map_or_else(|| name.to_owned(), |number| format!("photodiode-{number}-{name}"))
    }

    /// Takes the bands of another folder if they are of this camera; returns whether they were.
    pub(super) fn adopt(&self, other: &Path) -> Result<bool, PipelineError> {
        let names = [BANDS, KEY].map(|name| self.name(name));
        if fs::read_to_string(other.join(&names[1])).ok().as_ref() != Some(&self.key) {
            return Ok(false);
        }
        for name in &names {
            fs::rename(other.join(name), self.path.join(name)).map_err(|error| self.unwritable(&error))?;
        }
        Ok(true)
    }

    /// Opens the file of the bands: what of it is whole stays, if it is of this camera.
    pub(super) fn open(&self, size: (usize, usize), n_bands: usize) -> Result<BandStore, PipelineError> {
        let opened = || -> std::io::Result<BandStore> {
            let path = self.path.join(self.name(BANDS));
            let key = self.path.join(self.name(KEY));
            let is_ours = fs::read_to_string(&key).ok().as_ref() == Some(&self.key);
            let mut file = OpenOptions::new().read(true).write(true).create(true).truncate(!is_ours).open(&path)?;
            let n_done = ((file.metadata()?.len() / band_bytes(size)) as usize).min(n_bands);
            // Half a band, which the end of the process cut off, is made anew.
            file.set_len(n_done as u64 * band_bytes(size))?;
            file.seek(SeekFrom::End(0))?;
            if !is_ours {
                fs::write(&key, &self.key)?;
            }
            Ok(BandStore { file, path, size, n_done })
        };
        opened().map_err(|error| self.unwritable(&error))
    }

    fn unwritable(&self, error: &std::io::Error) -> PipelineError {
        PipelineError::Write { path: self.path.clone(), reason: error.to_string() }
    }
}

impl BandStore {
    /// How many bands are there, from the first on.
    pub(super) fn n_done(&self) -> usize {
        self.n_done
    }

    /// Returns a band that is there.
    pub(super) fn read(&mut self, band: usize) -> Result<Array2<f32>, PipelineError> {
        let plane = read_plane(&mut self.file, band, self.size);
        plane.map_err(|error| PipelineError::Read { path: self.path.clone(), reason: error.to_string() })
    }

    /// Adds the next band.
    pub(super) fn append(&mut self, plane: &Array2<f32>) -> std::io::Result<()> {
        self.file.seek(SeekFrom::Start(self.n_done as u64 * band_bytes(self.size)))?;
        write_plane(&mut self.file, plane)?;
        self.n_done += 1;
        Ok(())
    }

    /// Returns the file, which holds all bands.
    pub(super) fn into_file(self) -> File {
        self.file
    }
}

fn band_bytes((rows, columns): (usize, usize)) -> u64 {
    4 * rows as u64 * columns as u64
}

/// Writes a band where the file stands, some rows at a time.
pub(super) fn write_plane(file: &mut File, plane: &Array2<f32>) -> std::io::Result<()> {
    let plane = plane.as_standard_layout();
    let samples = plane.as_slice().expect("it is in standard order");
    let mut bytes = Vec::new();
    for samples in samples.chunks((ROWS_AT_ONCE * plane.ncols()).max(1)) {
        bytes.resize(4 * samples.len(), 0);
        for (bytes, sample) in bytes.chunks_exact_mut(4).zip(samples) {
            bytes.copy_from_slice(&sample.to_le_bytes());
        }
        file.write_all(&bytes)?;
    }
    Ok(())
}

/// Reads a band of a file of bands.
pub(super) fn read_plane(file: &mut File, band: usize, size: (usize, usize)) -> std::io::Result<Array2<f32>> {
    let mut samples = Vec::with_capacity(size.0 * size.1);
    for first in (0..size.0).step_by(ROWS_AT_ONCE) {
        samples.extend(read_rows(file, band, first..(first + ROWS_AT_ONCE).min(size.0), size)?);
    }
    Ok(Array2::from_shape_vec(size, samples).expect("as many samples as were asked for"))
}

/// Reads rows of a band of a file of bands.
pub(super) fn read_rows(
    file: &mut File,
    band: usize,
    rows: Range<usize>,
    size: (usize, usize),
) -> std::io::Result<Vec<f32>> {
    let row_bytes = 4 * size.1;
    let mut bytes = vec![0; row_bytes * rows.len()];
    file.seek(SeekFrom::Start(band as u64 * band_bytes(size) + (row_bytes * rows.start) as u64))?;
    file.read_exact(&mut bytes)?;
    Ok(bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_whole_bands_of_the_same_camera_stay() {
        let (one, other) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let folder =
            |path: &Path, key: &str| BandFolder { path: path.to_owned(), key: key.to_owned(), photodiode: None };
        let size = (2, 3);
        let plane = |band: usize| Array2::from_shape_fn(size, |(r, c)| (100 * band + 10 * r + c) as f32 + 0.1);
        let first = folder(one.path(), "camera");
        let mut store = first.open(size, 5).unwrap();
        (0..3).for_each(|band| store.append(&plane(band)).unwrap());
        drop(store);
        // Killed amid the fourth.
        let mut cut = OpenOptions::new().append(true).open(one.path().join(BANDS)).unwrap();
        cut.write_all(&[1, 2, 3, 4, 5]).unwrap();
        let mut again = first.open(size, 5).unwrap();
        assert_eq!(again.n_done(), 3);
        assert_eq!(again.read(1).unwrap(), plane(1));
        again.append(&plane(3)).unwrap();
        assert_eq!((again.read(3).unwrap(), again.n_done()), (plane(3), 4));
        drop(again);
        // Another folder takes them, if it is the same camera's.
        assert!(!folder(other.path(), "another").adopt(one.path()).unwrap());
        let second = folder(other.path(), "camera");
        assert!(second.adopt(one.path()).unwrap());
        assert_eq!(second.open(size, 5).unwrap().n_done(), 4);
        assert_eq!(folder(other.path(), "another").open(size, 5).unwrap().n_done(), 0);
    }
}
