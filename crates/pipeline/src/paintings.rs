//! Paintings of the still life kept in files, so that a later run does not paint them again.

use std::{
    cmp::Reverse,
    env, fs,
    hash::{DefaultHasher, Hash, Hasher},
    path::{Path, PathBuf},
    time::{SystemTime, UNIX_EPOCH},
};

use dioptric_scene::{ExrParts, ExrSamples, Scene, StillLife, read_spectral_exr, write_spectral_exr};
use dioptric_spectrum::{Cancel, Quantity, SpectralImage, WavelengthGrid};
use etcetera::{BaseStrategy, choose_base_strategy};

use crate::PipelineError;

/// Pixels of the smallest painting that is worth a file: it takes a second to paint.
const LEAST_PIXELS: usize = 100_000;

/// Bytes of all paintings together; the oldest give way.
const MOST_BYTES: u64 = 1 << 30;

/// Names the user's folder; nothing is kept where it is empty.
const VARIABLE: &str = "DIOPTRIC_CACHE";

/// Returns what tells one build of a program from another: its version, and the size and age of its file.
pub fn program_build(file: &Path) -> Option<String> {
    let file = file.metadata().ok()?;
    let built = file.modified().ok()?.duration_since(UNIX_EPOCH).ok()?;
    Some(format!("{} {} {}", env!("CARGO_PKG_VERSION"), file.len(), built.as_nanos()))
}

/// A folder in which paintings of the still life are kept from run to run.
///
/// A painting is used again, bit for bit, where the same build of the program painted it at the same size on the same bands. Files
/// that cannot be read or written are as if they were not there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PaintingFolder {
    path: PathBuf,
    build: String,
}

impl PaintingFolder {
    /// Returns the user's folder of paintings, which all programs share: the one that the environment variable `DIOPTRIC_CACHE` names,
    /// else `dioptric` in the user's cache; `None` where there is none or, by an empty variable, none is wanted.
    ///
    /// `program` is the file of the program that paints, by which its builds are distinguished.
    pub fn of_user(program: &Path) -> Option<Self> {
        let folder = match env::var_os(VARIABLE) {
            Some(folder) => PathBuf::from(folder),
            None => choose_base_strategy().ok()?.cache_dir().join("dioptric"),
        };
        if folder.as_os_str().is_empty() { None } else { Some(Self::new(folder, program_build(program)?)) }
    }

    /// Returns the folder at a path, which need not exist yet; `build` tells builds of the program apart, since another may
    /// paint otherwise.
    pub fn new(path: impl Into<PathBuf>, build: impl Into<String>) -> Self {
        Self { path: path.into(), build: build.into() }
    }

    /// Returns the still life, painted now where there is no painting of it.
    pub(crate) fn scene(
        &self,
        life: &StillLife,
        grid: &WavelengthGrid,
        progress: &(dyn Fn(f64) + Sync),
        cancel: &Cancel,
    ) -> Result<Scene, PipelineError> {
        if !is_kept(life) {
            return Ok(life.scene_with(grid, progress, cancel)?);
        }
        let file = self.file(life, grid);
        if let Some(scene) = restored(&file, life, grid) {
            return Ok(scene);
        }
        let scene = life.scene_with(grid, progress, cancel)?;
        self.keep(&file, &scene);
        Ok(scene)
    }

    /// Whether a painting that would be kept is not.
    pub(crate) fn lacks(&self, life: &StillLife, grid: &WavelengthGrid) -> bool {
        is_kept(life) && !self.file(life, grid).exists()
    }

    fn file(&self, life: &StillLife, grid: &WavelengthGrid) -> PathBuf {
        let StillLife { rows, columns, horizontal_fov_deg, quick, moved_m, .. } = *life;
        let mut hasher = DefaultHasher::new();
        (&self.build, rows, columns, horizontal_fov_deg.to_bits(), quick, moved_m.map(f64::to_bits)).hash(&mut hasher);
        grid.centers_nm().iter().for_each(|nm| nm.to_bits().hash(&mut hasher));
        self.path.join(format!("still-life-{columns}x{rows}-{:016x}.exr", hasher.finish()))
    }

    /// Writes a painting, and removes the oldest of too many.
    fn keep(&self, file: &Path, scene: &Scene) {
        // Quick to read again.
        let samples = ExrSamples::Uncompressed;
        let parts = ExrParts { depth: scene.depth.as_ref(), view: scene.view, samples, ..ExrParts::default() };
        let is_written =
            fs::create_dir_all(&self.path).is_ok() && write_spectral_exr(file, &scene.radiance, &parts).is_ok();
        if is_written {
            remove_oldest(&self.path, MOST_BYTES);
        }
    }
}

/// Whether a painting is worth a file.
fn is_kept(life: &StillLife) -> bool {
    !life.with_hidden && life.rows.saturating_mul(life.columns) >= LEAST_PIXELS
}

/// Returns the scene of a file of this size and these bands, `None` where there is none.
fn restored(file: &Path, life: &StillLife, grid: &WavelengthGrid) -> Option<Scene> {
    if !file.exists() {
        return None;
    }
    let read = read_spectral_exr(file).ok()?;
    // Names of bands have fewer digits than their wavelengths.
    let radiance = SpectralImage::new(Quantity::Radiance, grid.clone(), read.image.into_planes()).ok()?;
    life.of_painting(radiance, read.depth?).ok()
}

/// Removes the oldest paintings of a folder until the rest takes at most so many bytes.
fn remove_oldest(folder: &Path, most_bytes: u64) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    let mut paintings: Vec<(SystemTime, u64, PathBuf)> = entries
        .filter_map(Result::ok)
        .filter(|entry| entry.file_name().to_string_lossy().starts_with("still-life-"))
        .filter_map(|entry| {
            let metadata = entry.metadata().ok()?;
            Some((metadata.modified().ok()?, metadata.len(), entry.path()))
        })
        .collect();
    paintings.sort_by_key(|(at, ..)| Reverse(*at));
    let mut bytes = 0;
    for (_, len, path) in paintings {
        bytes += len;
        if bytes > most_bytes {
            // Another program may have removed it.
            drop(fs::remove_file(path));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    #[test]
    fn painting_is_kept_to_the_bit() {
        let folder = tempfile::tempdir().unwrap();
        let paintings = PaintingFolder::new(folder.path().join("made/when/needed"), "one build");
        let (life, grid) = (StillLife::new(400, 250), WavelengthGrid::new(vec![450.123_456_789, 610.0]).unwrap());
        let n_reports = AtomicUsize::new(0);
        let count = |_| {
            n_reports.fetch_add(1, Ordering::Relaxed);
        };
        let painted = paintings.scene(&life, &grid, &count, &Cancel::new()).unwrap();
        assert!(n_reports.swap(0, Ordering::Relaxed) > 0);
        let kept = paintings.scene(&life, &grid, &count, &Cancel::new()).unwrap();
        assert_eq!((kept, n_reports.into_inner()), (painted.clone(), 0));
        // A file that was cut off is painted anew.
        let file = paintings.file(&life, &grid);
        let bytes = fs::read(&file).unwrap();
        fs::write(&file, &bytes[..bytes.len() / 2]).unwrap();
        assert_eq!(paintings.scene(&life, &grid, &|_| {}, &Cancel::new()).unwrap(), painted);
        assert_eq!(fs::read(&file).unwrap(), bytes);
        // Other bands, another size and another build are other files.
        let others = [
            paintings.file(&life, &WavelengthGrid::new(vec![450.0, 610.0]).unwrap()),
            paintings.file(&StillLife::new(400, 251), &grid),
            PaintingFolder::new(&paintings.path, "another build").file(&life, &grid),
        ];
        assert!(!others.contains(&file));
    }

    #[test]
    fn oldest_paintings_give_way() {
        let folder = tempfile::tempdir().unwrap();
        for (age_s, name) in
            [(30, "still-life-a.exr"), (20, "still-life-b.exr"), (10, "still-life-c.exr"), (40, "notes.txt")]
        {
            let path = folder.path().join(name);
            fs::write(&path, vec![0; 100]).unwrap();
            let at = SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(1_000_000 - age_s);
            fs::File::options().append(true).open(&path).unwrap().set_modified(at).unwrap();
        }
        remove_oldest(folder.path(), 250);
        let mut left: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        left.sort();
        assert_eq!(left, ["notes.txt", "still-life-b.exr", "still-life-c.exr"]);
    }
}
