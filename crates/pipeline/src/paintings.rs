//! Views of worlds kept in files, so that a later run does not gather them again.

use std::{
    cmp::Reverse,
    env, fs, io,
    path::{Path, PathBuf},
    time::{SystemTime, UNIX_EPOCH},
};

use dioptric_backward::GatheredView;
use dioptric_scene::{ExrParts, ExrSamples, read_spectral_exr, write_spectral_exr};
use dioptric_spectrum::{Quantity, SpectralImage, WavelengthGrid};
use etcetera::{BaseStrategy, choose_base_strategy};

use crate::PipelineError;

/// Pixels of the smallest view that is worth a file: it takes a second to gather.
const LEAST_PIXELS: usize = 100_000;

/// Bytes of all views together; those that were not used for longest give way.
const MOST_BYTES: u64 = 1 << 30;

/// Names the user's folder; nothing is kept where it is empty.
const VARIABLE: &str = "DIOPTRIC_CACHE";

/// Returns what tells one build of a program from another: its version, and the size and age of its file.
pub fn program_build(file: &Path) -> Option<String> {
    let file = file.metadata().ok()?;
    let built = file.modified().ok()?.duration_since(UNIX_EPOCH).ok()?;
    Some(format!("{} {} {}", env!("CARGO_PKG_VERSION"), file.len(), built.as_nanos()))
}

/// A folder in which views of worlds are kept from run to run, those of the built-in still life among them.
///
/// A view is used again, bit for bit, where the same build of the program gathered it of an equal world, known by the contents of its
/// files, from the same place at the same size on the same bands. Files that cannot be read or written are as if they were not there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PaintingFolder {
    path: PathBuf,
    build: String,
}

/// What a view is known by.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ViewKey {
    /// Words that differ between worlds, places and ways to look at them.
    pub(crate) words: String,
    pub(crate) rows: usize,
    pub(crate) columns: usize,
    pub(crate) grid: WavelengthGrid,
}

impl PaintingFolder {
    /// Returns the user's folder of views, which all programs share: the one that the environment variable `DIOPTRIC_CACHE` names,
    /// else `dioptric` in the user's cache; `None` where there is none or, by an empty variable, none is wanted.
    ///
    /// `program` is the file of the program that looks, by which its builds are distinguished.
    pub fn of_user(program: &Path) -> Option<Self> {
        let folder = match env::var_os(VARIABLE) {
            Some(folder) => PathBuf::from(folder),
            None => choose_base_strategy().ok()?.cache_dir().join("dioptric"),
        };
        if folder.as_os_str().is_empty() { None } else { Some(Self::new(folder, program_build(program)?)) }
    }

    /// Returns the folder at a path, which need not exist yet; `build` tells builds of the program apart, since another may
    /// see otherwise.
    pub fn new(path: impl Into<PathBuf>, build: impl Into<String>) -> Self {
        Self { path: path.into(), build: build.into() }
    }

    /// Returns where the folder is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns how many views of any build are kept, and their bytes.
    pub fn kept(&self) -> (usize, u64) {
        let views = views(&self.path);
        (views.len(), views.iter().map(|view| view.bytes).sum())
    }

    /// Removes the views of all builds, and nothing else; returns how many there were, and their bytes.
    ///
    /// # Errors
    ///
    /// When a file of a view cannot be removed.
    pub fn clear(&self) -> io::Result<(usize, u64)> {
        let kept = self.kept();
        for view in views(&self.path) {
            match fs::remove_file(view.file) {
                // Another program has removed it.
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                removed => removed?,
            }
        }
        Ok(kept)
    }

    /// Returns a view, made now where there is no file of it.
    pub(crate) fn view(
        &self,
        key: &ViewKey,
        make: impl FnOnce() -> Result<GatheredView, PipelineError>,
    ) -> Result<GatheredView, PipelineError> {
        if !is_kept(key) {
            return make();
        }
        let file = self.file(key);
        if let Some(seen) = restored(&file, key) {
            note_use(&file);
            return Ok(seen);
        }
        let seen = make()?;
        self.keep(&file, &seen);
        Ok(seen)
    }

    /// Whether a view that would be kept is not.
    pub(crate) fn lacks(&self, key: &ViewKey) -> bool {
        is_kept(key) && !self.file(key).exists()
    }

    fn file(&self, key: &ViewKey) -> PathBuf {
        let mut hasher = blake3::Hasher::new();
        for words in [&self.build, &key.words] {
            hasher.update(&(words.len() as u64).to_le_bytes()).update(words.as_bytes());
        }
        for nm in key.grid.centers_nm() {
            hasher.update(&nm.to_bits().to_le_bytes());
        }
        let hash = hasher.finalize().to_hex();
        self.path.join(format!("{PREFIX}{}x{}-{}.exr", key.columns, key.rows, &hash[..16]))
    }

    /// Writes a view, and removes what was not used for longest of too many.
    fn keep(&self, file: &Path, seen: &GatheredView) {
        // Quick to read again.
        let samples = ExrSamples::Uncompressed;
        let parts = ExrParts { depth: Some(&seen.depth), samples, ..ExrParts::default() };
        let is_written =
            fs::create_dir_all(&self.path).is_ok() && write_spectral_exr(file, &seen.radiance, &parts).is_ok();
        if is_written {
            remove_least_used(&self.path, MOST_BYTES);
        }
    }
}

/// What the names of files begin with.
const PREFIX: &str = "view-";

/// Whether a view is worth a file.
fn is_kept(key: &ViewKey) -> bool {
    key.rows.saturating_mul(key.columns) >= LEAST_PIXELS
}

/// Returns the view of a file of this size and these bands, `None` where there is none.
fn restored(file: &Path, key: &ViewKey) -> Option<GatheredView> {
    if !file.exists() {
        return None;
    }
    let read = read_spectral_exr(file).ok()?.of_own_file();
    // Names of bands have fewer digits than their wavelengths.
    let radiance = SpectralImage::new(Quantity::Radiance, key.grid.clone(), read.image.into_planes()).ok()?;
    let depth = read.depth?;
    let size = (key.rows, key.columns);
    (depth.z_m().dim() == size && (radiance.rows(), radiance.columns()) == size)
        .then_some(GatheredView { radiance, depth })
}

/// Dates a view's file by its last use.
fn note_use(file: &Path) {
    let file = fs::File::options().append(true).open(file);
    // A folder that may only be read is used all the same.
    drop(file.and_then(|file| file.set_modified(SystemTime::now())));
}

/// The file of a view.
struct ViewFile {
    used: SystemTime,
    bytes: u64,
    file: PathBuf,
}

/// Returns the views of a folder, the last used first.
fn views(folder: &Path) -> Vec<ViewFile> {
    let Ok(entries) = fs::read_dir(folder) else { return vec![] };
    let mut views: Vec<ViewFile> = entries
        .filter_map(Result::ok)
        .filter(|entry| entry.file_name().to_string_lossy().starts_with(PREFIX))
        .filter_map(|entry| {
            let metadata = entry.metadata().ok()?;
            Some(ViewFile { used: metadata.modified().ok()?, bytes: metadata.len(), file: entry.path() })
        })
        .collect();
    views.sort_by_key(|view| Reverse(view.used));
    views
}

/// Removes the views of a folder that were not used for longest until the rest takes at most so many bytes.
fn remove_least_used(folder: &Path, most_bytes: u64) {
    let mut bytes = 0;
    for view in views(folder) {
        bytes += view.bytes;
        if bytes > most_bytes {
            // Another program may have removed it.
            drop(fs::remove_file(view.file));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::{
        collections::BTreeSet,
        sync::atomic::{AtomicUsize, Ordering},
    };

    use dioptric_spectrum::DepthMap;
    use ndarray::Array2;

    use super::*;

    #[test]
    fn view_is_kept_to_the_bit() {
        let folder = tempfile::tempdir().unwrap();
        let views = PaintingFolder::new(folder.path().join("made/when/needed"), "one build");
        let grid = WavelengthGrid::new(vec![450.123_456_789, 610.0]).unwrap();
        let key = ViewKey { words: "a room".to_owned(), rows: 250, columns: 400, grid: grid.clone() };
        let plane = |band: usize| {
            Array2::from_shape_fn((250, 400), |(r, c)| 1.1_f32.powi((r + 3 * band) as i32 % 50) + c as f32)
        };
        let z_m = Array2::from_shape_fn((250, 400), |(r, c)| if r < 9 { f32::INFINITY } else { 1.0 + c as f32 / 7.0 });
        let seen = GatheredView {
            radiance: SpectralImage::new(Quantity::Radiance, grid, vec![plane(0), plane(1)]).unwrap(),
            depth: DepthMap::new(z_m).unwrap(),
        };
        let n_made = AtomicUsize::new(0);
        let view = || {
            views.view(&key, || {
                n_made.fetch_add(1, Ordering::Relaxed);
                Ok(seen.clone())
            })
        };
        assert!(views.lacks(&key));
        assert_eq!((view().unwrap(), view().unwrap()), (seen.clone(), seen.clone()));
        assert!(!views.lacks(&key) && n_made.load(Ordering::Relaxed) == 1);
        // A file that was cut off is made anew.
        let file = views.file(&key);
        let bytes = fs::read(&file).unwrap();
        fs::write(&file, &bytes[..bytes.len() / 2]).unwrap();
        assert_eq!((view().unwrap(), n_made.load(Ordering::Relaxed)), (seen.clone(), 2));
        assert_eq!(fs::read(&file).unwrap(), bytes);
        // Other bands, another size, another place and another build are other files.
        let others = [
            views.file(&ViewKey { grid: WavelengthGrid::new(vec![450.0, 610.0]).unwrap(), ..key.clone() }),
            views.file(&ViewKey { rows: 251, ..key.clone() }),
            views.file(&ViewKey { words: "another".to_owned(), ..key.clone() }),
            PaintingFolder::new(&views.path, "another build").file(&key),
        ];
        assert!(!others.contains(&file));
        // What is small is made again each time, and leaves no file.
        let small = ViewKey { rows: 9, ..key.clone() };
        views.view(&small, || Ok(seen.clone())).unwrap();
        assert!(!views.lacks(&small) && !views.file(&small).exists());
    }

    #[test]
    fn views_not_used_for_longest_give_way() {
        let folder = tempfile::tempdir().unwrap();
        for (age_s, name) in [(40, "view-a.exr"), (30, "view-b.exr"), (20, "view-c.exr"), (50, "notes.txt")] {
            let path = folder.path().join(name);
            fs::write(&path, vec![0; 100]).unwrap();
            let at = SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(1_000_000 - age_s);
            fs::File::options().append(true).open(&path).unwrap().set_modified(at).unwrap();
        }
        let left = || {
            let names = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name());
            BTreeSet::from_iter(names.map(|name| name.into_string().unwrap()))
        };
        // The first made is used again.
        note_use(&folder.path().join("view-a.exr"));
        remove_least_used(folder.path(), 250);
        assert_eq!(left(), ["notes.txt", "view-a.exr", "view-c.exr"].map(str::to_owned).into());
        let views = PaintingFolder::new(folder.path(), "any build");
        assert_eq!((views.kept(), views.clear().unwrap(), views.kept()), ((2, 200), (2, 200), (0, 0)));
        assert_eq!(left(), ["notes.txt".to_owned()].into());
    }
}
