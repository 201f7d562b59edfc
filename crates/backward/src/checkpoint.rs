//! Checkpoints: what a rendering has gathered, in a file from which it goes on to the same bits.

use std::{
    fs,
    io::{self, Write},
    path::Path,
};

use dioptric_files::Staged;

use crate::{BackwardError, Renderer};

/// The first bytes of a checkpoint, with the version of its layout.
const MAGIC: &[u8; 16] = b"dioptric render1";

impl Renderer<'_> {
    /// Writes a checkpoint, whole or not at all.
    ///
    /// `identity` describes what is rendered beyond the settings: the world and the camera. A checkpoint resumes
    /// nothing else.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn save(&self, path: &Path, identity: &str) -> Result<(), BackwardError> {
        let failed = |error: io::Error| BackwardError::Write { file: path.to_owned(), reason: error.to_string() };
        let staged = Staged::file(path)?;
        let written = fs::File::create(staged.path()).and_then(|file| {
            let mut out = io::BufWriter::new(file);
            self.write_to(&mut out, identity)?;
            out.into_inner().map_err(io::IntoInnerError::into_error)?.sync_all()
        });
        written.map_err(failed)?;
        Ok(staged.commit()?)
    }

    fn write_to(&self, out: &mut impl Write, identity: &str) -> io::Result<()> {
        out.write_all(MAGIC)?;
        out.write_all(&self.fingerprint(identity).to_le_bytes())?;
        out.write_all(&self.n_passes.to_le_bytes())?;
        for list in [&self.film.sums, &self.film.squares] {
            list.iter().try_for_each(|value| out.write_all(&value.to_le_bytes()))?;
        }
        self.film.n_passes.iter().try_for_each(|n| out.write_all(&n.to_le_bytes()))?;
        out.write_all(&[u8::from(self.targets.is_some())])?;
        self.targets.iter().flatten().try_for_each(|n| out.write_all(&n.to_le_bytes()))
    }

    /// Takes up what a checkpoint holds, in place of what has been gathered so far.
    ///
    /// # Errors
    /// When there is no such file, it is damaged, or it is of another rendering.
    pub fn resume(&mut self, path: &Path, identity: &str) -> Result<(), BackwardError> {
        let wrong = |reason: &str| BackwardError::Checkpoint { file: path.to_owned(), reason: reason.to_owned() };
        let bytes = fs::read(path).map_err(|error| wrong(&format!("cannot be read: {error}")))?;
        let mut rest = &bytes[..];
        if take::<16>(&mut rest) != Some(*MAGIC) {
            return Err(wrong("is no checkpoint of this version, expected one to start with 'dioptric render1'"));
        }
        if take(&mut rest).map(u64::from_le_bytes) != Some(self.fingerprint(identity)) {
            return Err(wrong("is of another rendering, expected one of the same world, camera and settings"));
        }
        let mut read = self.clone();
        read.fill_from(&mut rest).filter(|()| rest.is_empty()).ok_or_else(|| {
            wrong(&format!("has {} bytes, which is not what a picture of this size takes", bytes.len()))
        })?;
        *self = read;
        Ok(())
    }

    fn fill_from(&mut self, rest: &mut &[u8]) -> Option<()> {
        self.n_passes = u32::from_le_bytes(take(rest)?);
        for value in self.film.sums.iter_mut().chain(&mut self.film.squares) {
            *value = f64::from_le_bytes(take(rest)?);
        }
        for n in &mut self.film.n_passes {
            *n = u32::from_le_bytes(take(rest)?);
        }
        let n = self.film.n_passes.len();
        self.targets = match take::<1>(rest)? {
            [0] => None,
            _ => Some((0..n).map(|_| take(rest).map(u32::from_le_bytes)).collect::<Option<_>>()?),
        };
        Some(())
    }

    /// A number that differs between renderings: FNV-1a of what is rendered and how.
    fn fingerprint(&self, identity: &str) -> u64 {
        let settings = self.settings();
        let what = format!("{identity}\n{settings:?}\n{:?}", self.camera().pixels());
        what.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
    }
}

fn take<const N: usize>(rest: &mut &[u8]) -> Option<[u8; N]> {
    let (first, after) = rest.split_first_chunk()?;
    *rest = after;
    Some(*first)
}
