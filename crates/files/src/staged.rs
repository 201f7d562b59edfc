//! Results that appear whole or not at all.

use std::{
    env,
    fs::{self, File, OpenOptions},
    io,
    path::{Path, PathBuf},
};

use crate::{
    WriteError,
    hidden::{HiddenFolder, Leftover},
    target::{Sink, Target, followed},
};

/// What stands in the names of hidden folders before the number of their process.
const PARTIAL: &str = ".partial-";

/// A file or folder of results that is written beside its place and moved there at the end.
///
/// It is written inside a hidden folder of its own, `.NAME.partial-PID` beside the target or `.run.partial-PID` in a folder that is
/// there. Dropped without [`commit`](Self::commit), it leaves nothing behind; files that were at the place before stay. What a
/// killed process left is removed when the next one writes to the same place; that of a process that lives is left alone.
///
/// Links are followed. What is no regular file (a device, a FIFO, `/dev/stdout`, `-` for standard output) is opened at once and written to
/// at the end; it is never replaced.
#[derive(Debug)]
pub struct Staged {
    target: PathBuf,
    hidden: HiddenFolder,
    /// What is moved to the target.
    content: PathBuf,
    end: End,
    /// Folders above the target that were made for it, outermost first.
    made_parents: Vec<PathBuf>,
    is_committed: bool,
}

/// What becomes of what was written.
#[derive(Debug)]
enum End {
    /// The files of a folder go into this one.
    Folder(PathBuf),
    /// A file gets this name.
    Rename(PathBuf),
    /// A file's bytes replace those of this one, beside which nothing can be written.
    Fill(PathBuf),
    /// A file's bytes are written there.
    Sink(Option<Sink>),
}

/// Writes bytes to a file, as [`Staged::file`] does.
///
/// # Errors
/// When the file cannot be written; what was there stays.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    let staged = Staged::file(path)?;
    fs::write(staged.path(), bytes).map_err(|error| WriteError::of_io(path, &error))?;
    staged.commit()
}

impl Staged {
    /// Makes a folder to fill; its files take the place of those of the same name in `target` at the end.
    ///
    /// # Errors
    /// When the folder, or the one above it, cannot be written to.
    pub fn folder(target: &Path) -> Result<Self, WriteError> {
        if target.exists() && !target.is_dir() {
            return Err(WriteError::of(target, "it is not a folder"));
        }
        let begin = || {
            let place = if target.is_dir() { target.to_owned() } else { followed(target)? };
            let staged = Self::beside(&place, target, End::Folder(place.clone()))?;
            fs::create_dir(&staged.content)?;
            Ok(staged)
        };
        begin().map_err(|error: io::Error| WriteError::of_io(target, &error))
    }

    /// Chooses where to write a file that takes the place of `target` at the end.
    ///
    /// # Errors
    /// When nothing can be written there.
    pub fn file(target: &Path) -> Result<Self, WriteError> {
        let begin = || {
            let staged = match Target::at(target)? {
                Target::Open(sink) => Self::elsewhere(target, End::Sink(Some(sink)))?,
                Target::Regular(place) => match Self::beside(&place, target, End::Rename(place.clone())) {
                    Err(_) if place.exists() => Self::elsewhere(target, End::Fill(place))?,
                    staged => staged?,
                },
            };
            File::create(&staged.content)?;
            if let End::Rename(place) = &staged.end {
                remove(leftovers(place, false));
            }
            Ok(staged)
        };
        begin().map_err(|error: io::Error| WriteError::of_io(target, &error))
    }

    /// Makes the hidden folder beside or inside a place, and those above it.
    fn beside(place: &Path, target: &Path, end: End) -> io::Result<Self> {
        let made_parents = make_parents(place)?;
        let (folder, start) = places(place, matches!(end, End::Folder(_)));
        let hidden = HiddenFolder::make(&folder, numbered(&start));
        hidden.map(|hidden| Self::in_hidden(hidden, target, end, made_parents.clone())).inspect_err(|_| {
            remove_empty(&made_parents);
        })
    }

    /// Makes the hidden folder among temporary files.
    fn elsewhere(target: &Path, end: End) -> io::Result<Self> {
        let hidden = HiddenFolder::make(&env::temp_dir(), numbered(&format!(".dioptric{PARTIAL}")))?;
        Ok(Self::in_hidden(hidden, target, end, Vec::new()))
    }

    fn in_hidden(hidden: HiddenFolder, target: &Path, end: End, made_parents: Vec<PathBuf>) -> Self {
        let name = target.file_name().map_or_else(|| "out".into(), ToOwned::to_owned);
        let content = hidden.path().join(if matches!(end, End::Folder(_)) { "results".into() } else { name });
        Self { target: target.to_owned(), hidden, content, end, made_parents, is_committed: false }
    }

    /// Where to write.
    pub fn path(&self) -> &Path {
        &self.content
    }

    /// Whether the bytes go to standard output.
    pub fn is_standard_output(&self) -> bool {
        matches!(self.end, End::Sink(Some(Sink::Stdout)))
    }

    /// The hidden folder, for what is not moved to the target; it is removed in the end.
    pub fn root(&self) -> &Path {
        self.hidden.path()
    }

    /// Returns the hidden folders that killed processes left for the same target.
    pub fn leftovers(&self) -> Vec<Leftover> {
        match &self.end {
            End::Folder(place) => leftovers(place, true),
            End::Rename(place) => leftovers(place, false),
            End::Fill(_) | End::Sink(_) => Vec::new(),
        }
    }

    /// Moves what was written to its place, and removes what killed processes left for it.
    ///
    /// # Errors
    /// When a file cannot be moved. Of a folder whose files cannot all be moved none is.
    pub fn commit(mut self) -> Result<(), WriteError> {
        let content = &self.content;
        let moved = match &mut self.end {
            End::Folder(place) => move_files(content, place),
            End::Rename(place) => rename(content, place),
            End::Fill(place) => fill(content, place),
            End::Sink(sink) => sink.take().map_or(Ok(()), |sink| sink.take(content)),
        };
        moved.map_err(|error| WriteError::of_io(&self.target, &error))?;
        self.is_committed = true;
        remove(self.leftovers());
        Ok(())
    }
}

impl Drop for Staged {
    fn drop(&mut self) {
        self.hidden.remove();
        if !self.is_committed {
            remove_empty(&self.made_parents);
        }
    }
}

/// Removes folders, the last first, as far as they are empty.
fn remove_empty(folders: &[PathBuf]) {
    for folder in folders.iter().rev() {
        let _ = fs::remove_dir(folder);
    }
}

/// Returns names of hidden folders that start alike.
fn numbered(start: &str) -> impl Fn(usize) -> String {
    move |attempt| match attempt {
        0 => format!("{start}{}", std::process::id()),
        _ => format!("{start}{}-{attempt}", std::process::id()),
    }
}

/// Returns the folder in which the hidden folders for a target lie, and how their names start.
fn places(target: &Path, is_folder: bool) -> (PathBuf, String) {
    // Inside an existing folder, so that a folder that cannot be written to is found out before the work.
    if is_folder && target.is_dir() {
        return (target.to_owned(), format!(".run{PARTIAL}"));
    }
    let name = target.file_name().map_or_else(|| "out".to_owned(), |name| name.to_string_lossy().into_owned());
    let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    (folder.to_owned(), format!(".{name}{PARTIAL}"))
}

/// Returns what killed processes left for a target, in the target and beside it.
fn leftovers(target: &Path, is_folder: bool) -> Vec<Leftover> {
    let beside = places(target, false);
    let inside = is_folder.then(|| places(target, true)).filter(|inside| *inside != beside);
    let mut found: Vec<Leftover> =
        std::iter::once(beside).chain(inside).flat_map(|(folder, start)| Leftover::all_in(&folder, &start)).collect();
    found.sort_by(|a, b| a.path().cmp(b.path()));
    found
}

fn remove(leftovers: Vec<Leftover>) {
    leftovers.into_iter().for_each(Leftover::remove);
}

/// Makes the folders above `target` and returns those that were missing.
fn make_parents(target: &Path) -> io::Result<Vec<PathBuf>> {
    let parents: Vec<PathBuf> =
        target.ancestors().skip(1).filter(|p| !p.as_os_str().is_empty()).map(Path::to_owned).collect();
    let mut missing: Vec<PathBuf> = parents.into_iter().take_while(|parent| !parent.exists()).collect();
    missing.reverse();
    if let Some(parent) = missing.last() {
        fs::create_dir_all(parent)?;
    }
    Ok(missing)
}

/// Gives a file its name, and the permissions of what had it before.
fn rename(content: &Path, place: &Path) -> io::Result<()> {
    if let Ok(before) = fs::metadata(place) {
        // A file system without permissions loses nothing.
        let _ = fs::set_permissions(content, before.permissions());
    }
    match fs::rename(content, place) {
        // A file that is mounted by itself keeps its place.
        Err(_) if place.is_file() => fill(content, place),
        renamed => renamed,
    }
}

/// Writes a file's bytes in place of those of another.
fn fill(content: &Path, place: &Path) -> io::Result<()> {
    Sink::File(OpenOptions::new().write(true).create(true).truncate(true).open(place)?).take(content)
}

/// Moves the files of a folder into another: first each is found to have a place, then all are moved.
fn move_files(from: &Path, to: &Path) -> io::Result<()> {
    if !to.is_dir() {
        return fs::rename(from, to);
    }
    let mut moves = Vec::new();
    plan(from, to, &mut moves)?;
    for (content, target) in moves {
        match target {
            Target::Regular(place) => rename(&content, &place)?,
            Target::Open(sink) => sink.take(&content)?,
        }
    }
    Ok(())
}

/// Finds where the files of a folder go, and makes the folders that they need.
fn plan(from: &Path, to: &Path, moves: &mut Vec<(PathBuf, Target)>) -> io::Result<()> {
    let mut entries: Vec<PathBuf> = fs::read_dir(from)?.map(|entry| Ok(entry?.path())).collect::<io::Result<_>>()?;
    // Folders last: where a file has no place, none is made.
    entries.sort_by_key(|path| (path.is_dir(), path.clone()));
    for content in entries {
        let place = to.join(content.file_name().unwrap_or_default());
        let named = |error: io::Error| io::Error::new(error.kind(), format!("{}: {error}", place.display()));
        if !content.is_dir() {
            moves.push((content, Target::at(&place).map_err(named)?));
        } else if place.exists() && !place.is_dir() {
            return Err(named(io::Error::other("it is no folder")));
        } else {
            fs::create_dir_all(&place).map_err(named)?;
            plan(&content, &place, moves)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names_in(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    #[test]
    fn an_abandoned_folder_leaves_nothing() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("a/b/out");
        let staged = Staged::folder(&target).unwrap();
        fs::write(staged.path().join("half.txt"), "half").unwrap();
        drop(staged);
        assert!(names_in(root.path()).is_empty());
    }

    #[test]
    fn a_committed_folder_replaces_only_what_it_has() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("out");
        fs::create_dir(&target).unwrap();
        fs::write(target.join("old.txt"), "old").unwrap();
        fs::write(target.join("both.txt"), "old").unwrap();
        let staged = Staged::folder(&target).unwrap();
        fs::write(staged.path().join("both.txt"), "new").unwrap();
        assert_eq!(fs::read_to_string(target.join("both.txt")).unwrap(), "old");
        staged.commit().unwrap();
        assert_eq!(names_in(&target), ["both.txt", "old.txt"]);
        assert_eq!(fs::read_to_string(target.join("both.txt")).unwrap(), "new");
    }

    #[test]
    fn a_file_appears_at_the_end() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("deep/lens.svg");
        let staged = Staged::file(&target).unwrap();
        fs::write(staged.path(), "whole").unwrap();
        assert!(!target.exists());
        assert_eq!(staged.path().extension().unwrap(), "svg");
        staged.commit().unwrap();
        assert_eq!(fs::read_to_string(&target).unwrap(), "whole");
        assert_eq!(names_in(target.parent().unwrap()), ["lens.svg"]);
    }

    /// Leaves what a killed process would: a hidden folder that nobody holds.
    fn leave(folder: &Path, name: &str, file: &str) {
        let left = folder.join(name);
        fs::create_dir_all(left.join("results")).unwrap();
        fs::write(left.join(file), "half").unwrap();
    }

    #[test]
    fn leftovers_of_the_dead_are_removed() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("out");
        fs::create_dir(&target).unwrap();
        leave(&target, ".run.partial-1", "results/half.txt");
        leave(root.path(), ".out.partial-2", "lock");
        leave(root.path(), ".other.partial-3", "lock");
        let alive = Staged::folder(&target).unwrap();
        assert_eq!(names_in(root.path()), [".other.partial-3", ".out.partial-2", "out"]);
        // Found, and held until they are let go.
        let found: Vec<PathBuf> = alive.leftovers().iter().map(|left| left.path().to_owned()).collect();
        assert_eq!(found, [root.path().join(".out.partial-2"), target.join(".run.partial-1")]);
        let second = Staged::folder(&target).unwrap();
        fs::write(second.path().join("a.txt"), "whole").unwrap();
        second.commit().unwrap();
        // The first is alive, though its process has the same number.
        assert_eq!(names_in(root.path()), [".other.partial-3", "out"]);
        assert_eq!(names_in(&target).len(), 2);
        fs::write(alive.path().join("b.txt"), "whole").unwrap();
        alive.commit().unwrap();
        assert_eq!(names_in(&target), ["a.txt", "b.txt"]);
    }

    #[test]
    fn leftovers_of_a_file_are_removed_at_once() {
        let root = tempfile::tempdir().unwrap();
        leave(root.path(), ".lens.svg.partial-77", "lens.svg");
        let staged = Staged::file(&root.path().join("lens.svg")).unwrap();
        assert_eq!(names_in(root.path()).len(), 1);
        drop(staged);
        assert!(names_in(root.path()).is_empty());
    }

    /// What stands at the name of a result in a folder decides before any file is moved.
    #[test]
    fn no_file_is_moved_where_one_has_no_place() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("out");
        fs::create_dir_all(target.join("picture.png")).unwrap();
        fs::write(target.join("a.txt"), "old").unwrap();
        let staged = Staged::folder(&target).unwrap();
        for name in ["a.txt", "picture.png", "z.txt"] {
            fs::write(staged.path().join(name), "new").unwrap();
        }
        let message = staged.commit().unwrap_err().to_string();
        assert!(message.contains("picture.png: it is a folder"), "{message}");
        assert_eq!(names_in(&target), ["a.txt", "picture.png"]);
        assert_eq!(fs::read_to_string(target.join("a.txt")).unwrap(), "old");
    }

    #[test]
    fn folders_within_folders_are_filled() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("out");
        fs::create_dir_all(target.join("frames")).unwrap();
        fs::write(target.join("frames/old.txt"), "old").unwrap();
        let staged = Staged::folder(&target).unwrap();
        fs::create_dir(staged.path().join("frames")).unwrap();
        fs::write(staged.path().join("frames/new.txt"), "new").unwrap();
        staged.commit().unwrap();
        assert_eq!(names_in(&target.join("frames")), ["new.txt", "old.txt"]);
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_and_stay() {
        use std::os::unix::fs::{PermissionsExt, symlink};

        let root = tempfile::tempdir().unwrap();
        let at = |name: &str| root.path().join(name);
        fs::write(at("real.txt"), "old").unwrap();
        fs::set_permissions(at("real.txt"), fs::Permissions::from_mode(0o640)).unwrap();
        symlink("real.txt", at("link.txt")).unwrap();
        symlink("new.txt", at("dangling.txt")).unwrap();
        for name in ["link.txt", "dangling.txt"] {
            write(&at(name), b"new").unwrap();
            assert!(fs::symlink_metadata(at(name)).unwrap().is_symlink());
        }
        assert_eq!(["real.txt", "new.txt"].map(|name| fs::read_to_string(at(name)).unwrap()), ["new", "new"]);
        assert_eq!(fs::metadata(at("real.txt")).unwrap().permissions().mode() & 0o777, 0o640);
        symlink("loop.txt", at("loop.txt")).unwrap();
        assert!(write(&at("loop.txt"), b"new").is_err());
    }

    #[cfg(unix)]
    #[test]
    fn nodes_are_written_to_and_stay() {
        use std::os::unix::fs::FileTypeExt;

        let root = tempfile::tempdir().unwrap();
        let fifo = root.path().join("pipe.svg");
        assert!(std::process::Command::new("mkfifo").arg(&fifo).status().unwrap().success());
        let reader = std::thread::spawn({
            let fifo = fifo.clone();
            move || fs::read_to_string(fifo).unwrap()
        });
        write(&fifo, b"all of it").unwrap();
        assert_eq!(reader.join().unwrap(), "all of it");
        write(Path::new("/dev/null"), b"gone").unwrap();
        assert!(fs::metadata(&fifo).unwrap().file_type().is_fifo());
        assert!(fs::metadata("/dev/null").unwrap().file_type().is_char_device());
        assert_eq!(names_in(root.path()), ["pipe.svg"]);
    }

    #[test]
    fn a_place_that_cannot_be_written_to_is_named() {
        let root = tempfile::tempdir().unwrap();
        let file = root.path().join("file");
        fs::write(&file, "").unwrap();
        for error in [
            Staged::folder(&file).unwrap_err(),
            Staged::folder(&file.join("out")).unwrap_err(),
            Staged::file(&file.join("out.csv")).unwrap_err(),
            Staged::file(root.path()).unwrap_err(),
        ] {
            assert!(error.to_string().contains("cannot write"), "{error}");
        }
        assert_eq!(names_in(root.path()), ["file"]);
    }
}
