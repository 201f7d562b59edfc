//! What every target shares: a reader takes a path, and an input becomes a file.

use std::{cell::RefCell, env, fs, path::{Path, PathBuf}, process};

thread_local! {
    static FOLDER: RefCell<Option<PathBuf>> = const { RefCell::new(None) };
}

/// Writes an input as a file of this kind and reads it; whether it is read does not matter, only that it ends.
pub fn read(data: &[u8], extension: &str, reader: impl FnOnce(&Path) -> bool) {
    let folder = FOLDER.with(|folder| folder.borrow_mut().get_or_insert_with(make_folder).clone());
    let path = folder.join("input").with_extension(extension);
    fs::write(&path, data).expect("the folder can be written to");
    let _ = reader(&path);
}

/// Makes a folder in memory where the system has one.
fn make_folder() -> PathBuf {
    let memory = Path::new("/dev/shm");
    let root = if memory.is_dir() { memory.to_owned() } else { env::temp_dir() };
    let folder = root.join(format!("dioptric-fuzz-{}", process::id()));
    fs::create_dir_all(&folder).expect("the folder can be made");
    dioptric_files::memory::allow(Some(1 << 30));
    folder
}
