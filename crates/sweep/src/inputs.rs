//! The files that cameras are made from, and what they hold.

use std::{
    collections::{BTreeSet, HashMap},
    fs::{self, File},
    io,
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
    time::SystemTime,
};

use dioptric_pipeline::{Camera, FilterSpec, SceneSource, SensorSpec, may_be_read_with_scene};

use crate::SweepError;

/// The files of a sweep, each read and hashed once.
#[derive(Debug, Default)]
pub(crate) struct Inputs {
    known: Mutex<HashMap<PathBuf, Input>>,
}

/// A file, and all that reading it may read.
#[derive(Clone, Debug)]
struct Input {
    hash: String,
    files: Vec<Stamp>,
}

/// A file as it was when it was hashed.
#[derive(Clone, Debug, PartialEq)]
struct Stamp {
    path: PathBuf,
    state: Option<(u64, Option<SystemTime>)>,
}

impl Stamp {
    fn of(path: &Path) -> Self {
        let state = fs::metadata(path).ok().map(|data| (data.len(), data.modified().ok()));
        Self { path: path.to_owned(), state }
    }
}

impl Inputs {
    /// Returns the camera with the name and the content of each file in place of its path.
    pub(crate) fn by_content(&self, camera: &Camera) -> Result<Camera, SweepError> {
        let mut named = camera.clone();
        for path in paths(&mut named) {
            let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
            *path = PathBuf::from(format!("{}/{name}", self.hash_of(path)?));
        }
        Ok(named)
    }

    fn hash_of(&self, path: &Path) -> Result<String, SweepError> {
        // Locked while it is hashed, so that no file is read twice.
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(input) = known.get(path) {
            return Ok(input.hash.clone());
        }
        let input = Input::of(path)?;
        let hash = input.hash.clone();
        known.insert(path.to_owned(), input);
        Ok(hash)
    }

    /// Checks that the files of a camera are what they were.
    pub(crate) fn check_unchanged(&self, camera: &Camera) -> Result<(), SweepError> {
        let known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        for path in paths(&mut camera.clone()) {
            let changed =
                known.get(path).and_then(|input| input.files.iter().find(|file| Stamp::of(&file.path) != **file));
            if let Some(changed) = changed {
                return Err(SweepError::Changed { path: changed.path.clone() });
            }
        }
        Ok(())
    }
}

/// Returns the paths in a camera.
fn paths(camera: &mut Camera) -> Vec<&mut PathBuf> {
    let lens = camera.lens.file_mut();
    let sensor = if let SensorSpec::File(path) = &mut camera.sensor { Some(path) } else { None };
    let scene = match &mut camera.scene.source {
        SceneSource::File(path) => Some(path),
        SceneSource::World(world) if !world.is_still_life() => Some(&mut world.file),
        SceneSource::World(_) => None,
        SceneSource::StillLife { .. } | SceneSource::Target { .. } => None,
    };
    lens.into_iter()
        .chain(camera.lens_reading.files_mut())
        .chain(&mut camera.psfs)
        .chain(sensor)
        .chain(camera.filters.iter_mut().filter_map(FilterSpec::file_mut))
        .chain(scene)
        .chain(&mut camera.scene.hidden)
        .chain(&mut camera.scene.points)
        .chain(&mut camera.scene.reading.depth)
        .chain(&mut camera.scene.reading.view)
        .collect()
}

impl Input {
    fn of(path: &Path) -> Result<Self, SweepError> {
        let mut files = BTreeSet::new();
        collect(path, &mut files)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut all = blake3::Hasher::new();
        let mut stamps = Vec::new();
        for file in files {
            // Before it is read: a change while it is read is seen later.
            stamps.push(Stamp::of(&file));
            let name = file.strip_prefix(folder).unwrap_or(&file).to_string_lossy().into_owned();
            let mut own = blake3::Hasher::new();
            File::open(&file).and_then(|mut open| io::copy(&mut open, &mut own)).map_err(SweepError::reading(&file))?;
            all.update(&(name.len() as u64).to_le_bytes());
            all.update(name.as_bytes());
            all.update(own.finalize().as_bytes());
        }
        Ok(Self { hash: all.finalize().to_hex().to_string(), files: stamps })
    }
}

/// Adds a file and those that reading it may read: the files of a folder, those beside it that differ in their ending alone
/// (the samples of a header, the glasses of a lens) or belong to a scene (its depth, its camera), and those that a world names in quotes.
fn collect(path: &Path, files: &mut BTreeSet<PathBuf>) -> Result<(), SweepError> {
    let data = fs::metadata(path).map_err(SweepError::reading(path))?;
    let folder = if data.is_dir() { path } else { path.parent().unwrap_or(Path::new("")) };
    if !data.is_dir() && !files.insert(path.to_owned()) {
        return Ok(());
    }
    let listed = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    for entry in fs::read_dir(listed).map_err(SweepError::reading(listed))? {
        let name = entry.map_err(SweepError::reading(listed))?.file_name();
        let beside = folder.join(&name);
        let belongs = beside.file_stem() == path.file_stem() || may_be_read_with_scene(path, &beside);
        if (data.is_dir() || belongs) && beside.is_file() {
            files.insert(beside);
        }
    }
    let is_world = path.extension().is_some_and(|ending| ending == "pbrt" || ending == "gltf");
    if is_world && !data.is_dir() {
        let bytes = fs::read(path).map_err(SweepError::reading(path))?;
        for name in String::from_utf8_lossy(&bytes).split('"').skip(1).step_by(2) {
            let named = folder.join(name.replace("%20", " "));
            if !name.is_empty() && name.len() < 4096 && named.is_file() {
                collect(&named, files)?;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn worlds_bring_what_they_name() {
        let folder = tempfile::tempdir().unwrap();
        let put = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
        put("a.pbrt", "Include \"b.pbrt\"\nShape \"sphere\"");
        put("b.pbrt", "Shape \"plymesh\" \"string filename\" \"m.ply\"\nInclude \"a.pbrt\"");
        put("m.ply", "ply 1");
        put("other.ply", "ply 2");
        let hash = || Input::of(&folder.path().join("a.pbrt")).unwrap().hash;
        let before = hash();
        put("other.ply", "ply 3");
        assert_eq!(hash(), before);
        put("m.ply", "ply 2");
        assert_ne!(hash(), before);
    }

    #[test]
    fn contents_count_and_folders_do_not() {
        let folder = tempfile::tempdir().unwrap();
        let hash = |name: &str, text: &str| {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(&path, text).unwrap();
            Input::of(&path).unwrap().hash
        };
        assert_eq!(hash("x/s.hdr", "1"), hash("y/s.hdr", "1"));
        assert_ne!(hash("x/s.hdr", "1"), hash("y/s.hdr", "2"));
        // The samples beside a header.
        hash("y/s.img", "3");
        assert_ne!(hash("x/s.hdr", "1"), hash("y/s.hdr", "1"));
        let missing = Input::of(&folder.path().join("none.exr")).unwrap_err().to_string();
        assert!(missing.contains("none.exr") && !missing.contains('\n'), "{missing}");
    }
}
