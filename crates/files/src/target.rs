//! What lies at the path of a result: a regular file that is replaced, or a node that is opened.

use std::{
    fs::{self, File, OpenOptions},
    io::{self, Write},
    path::{Path, PathBuf},
};

/// Links to links that are followed.
const MOST_LINKS: usize = 40;

/// Where a result goes.
#[derive(Debug)]
pub(crate) enum Target {
    /// A regular file, or the place of one: all links are followed.
    Regular(PathBuf),
    /// What is written to and never replaced: a device, a FIFO, the other end of a pipe.
    Open(Sink),
}

/// What takes bytes.
#[derive(Debug)]
pub(crate) enum Sink {
    Stdout,
    Stderr,
    File(File),
}

impl Target {
    /// Looks at a path, and opens what is there but for a regular file. A FIFO waits for its reader.
    pub(crate) fn at(path: &Path) -> io::Result<Self> {
        if let Some(sink) = standard(path) {
            return Ok(Self::Open(sink));
        }
        match fs::metadata(path) {
            Ok(found) if found.is_dir() => Err(io::Error::other("it is a folder")),
            // Another open file of this process: what it holds stays.
            Ok(_) if is_descriptor(path) => Ok(Self::Open(Sink::File(OpenOptions::new().append(true).open(path)?))),
            Ok(found) if found.is_file() => {
                // What cannot be written to is not replaced either.
                drop(OpenOptions::new().write(true).open(path)?);
                Ok(Self::Regular(fs::canonicalize(path)?))
            }
            Ok(_) => Ok(Self::Open(Sink::File(OpenOptions::new().write(true).open(path)?))),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Self::Regular(followed(path)?)),
            Err(error) => Err(error),
        }
    }
}

impl Sink {
    /// Writes all of a file.
    pub(crate) fn take(self, content: &Path) -> io::Result<()> {
        let mut from = File::open(content)?;
        let mut copy = |to: &mut dyn Write| io::copy(&mut from, to).and_then(|_| to.flush());
        match self {
            Self::Stdout => copy(&mut io::stdout().lock()),
            Self::Stderr => copy(&mut io::stderr().lock()),
            Self::File(mut file) => copy(&mut file),
        }
    }
}

/// Whether a path names no regular file and no folder, but a stream: `-`, a device, a FIFO. Its name says nothing of a format.
pub fn is_stream(path: &Path) -> bool {
    standard(path).is_some() || is_descriptor(path) || fs::metadata(path).is_ok_and(|at| !at.is_file() && !at.is_dir())
}

/// Returns the standard stream that a path names.
fn standard(path: &Path) -> Option<Sink> {
    match path.to_str()? {
        "-" => Some(Sink::Stdout),
        "/dev/stdout" | "/dev/fd/1" | "/proc/self/fd/1" if cfg!(unix) => Some(Sink::Stdout),
        "/dev/stderr" | "/dev/fd/2" | "/proc/self/fd/2" if cfg!(unix) => Some(Sink::Stderr),
        _ => None,
    }
}

/// Whether a path names a file that a process has open.
fn is_descriptor(path: &Path) -> bool {
    cfg!(unix) && ["/dev/fd", "/proc/self/fd"].iter().any(|folder| path.starts_with(folder))
}

/// Follows links whose last one leads to nothing yet.
pub(crate) fn followed(path: &Path) -> io::Result<PathBuf> {
    let mut path = path.to_owned();
    for _ in 0..MOST_LINKS {
        let Ok(next) = fs::read_link(&path) else { return Ok(path) };
        path = path.parent().unwrap_or(Path::new("")).join(next);
    }
    Err(io::Error::other("links lead in a circle"))
}
