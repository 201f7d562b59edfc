//! The directory of a TIFF page as it stands in the file (TIFF 6.0, section 2, and `BigTIFF`).

use std::{
    fs::File,
    io::{Read, Result, Seek, SeekFrom},
    path::Path,
};

/// Bytes of a text that are read.
const MOST_BYTES: u64 = 1 << 20;
/// Directories below one that are looked at.
const MOST_BELOW: u64 = 1000;

/// Whether a file is a TIFF, by its first bytes, or by its name where they say nothing.
pub(super) fn is_tiff(path: &Path) -> bool {
    let is_named =
        || path.extension().is_some_and(|own| own.eq_ignore_ascii_case("tif") || own.eq_ignore_ascii_case("tiff"));
    let by_content = dioptric_pictures::format_of(path).ok().flatten();
    by_content.map_or_else(is_named, |format| format == dioptric_pictures::ImageFormat::Tiff)
}

/// The entries of a directory.
pub(super) struct Directory {
    is_big_endian: bool,
    is_big_file: bool,
    /// Each tag, with the place of its entry.
    entries: Vec<(u16, u64)>,
    /// The place of the next directory; 0 behind the last.
    next: u64,
    /// Where that stands.
    next_at: u64,
}

/// The tag of the directories below one (TIFF technical note 1, 1995).
pub(super) const BELOW: u16 = 330;

impl Directory {
    /// Reads the directory at a place of a file.
    pub(super) fn read(file: &mut File, at: u64) -> Result<Self> {
        let mut this = Self::head(file)?;
        let (n_count, n_entry) = if this.is_big_file { (8, 20) } else { (2, 12) };
        let count = this.number_at(file, at, n_count)?;
        for index in 0..count.min(u16::MAX.into()) {
            let place = at + n_count as u64 + n_entry * index;
            this.entries.push((this.number_at(file, place, 2)? as u16, place));
        }
        this.next_at = at + n_count as u64 + n_entry * count;
        this.next = this.number_at(file, this.next_at, this.side()).unwrap_or(0);
        Ok(this)
    }

    /// Reads the directories of all pages up to so many, each with its place.
    pub(super) fn all(file: &mut File, most: usize) -> Result<Vec<(u64, Self)>> {
        let head = Self::head(file)?;
        let mut at = if head.is_big_file { head.number_at(file, 8, 8)? } else { head.number_at(file, 4, 4)? };
        let mut all: Vec<(u64, Self)> = vec![];
        while at != 0 && all.len() < most && all.iter().all(|(own, _)| *own != at) {
            let directory = Self::read(file, at)?;
            let next = directory.next;
            all.push((at, directory));
            at = next;
        }
        Ok(all)
    }

    /// Reads how numbers stand in the file.
    fn head(file: &mut File) -> Result<Self> {
        let mut start = [0; 4];
        file.rewind()?;
        file.read_exact(&mut start)?;
        let this = Self { is_big_endian: start[0] == b'M', is_big_file: false, entries: vec![], next: 0, next_at: 0 };
        Ok(Self { is_big_file: this.number(&start[2..]) == 43, ..this })
    }

    /// Returns the number of two or four bytes of a tag that has one.
    pub(super) fn number_of(&self, file: &mut File, tag: u16) -> Result<Option<u64>> {
        let Some((_, entry)) = self.entries.iter().find(|(own, _)| *own == tag) else { return Ok(None) };
        let n_bytes = if self.number_at(file, entry + 2, 2)? == 4 { 4 } else { 2 };
        self.place_of(tag).map(|place| self.number_at(file, place, n_bytes)).transpose()
    }

    /// Returns where the values of a tag stand that fit into its entry.
    pub(super) fn place_of(&self, tag: u16) -> Option<u64> {
        let (_, place) = self.entries.iter().find(|(own, _)| *own == tag)?;
        Some(place + if self.is_big_file { 12 } else { 8 })
    }

    /// Returns the places of the directories below it.
    pub(super) fn below(&self, file: &mut File) -> Result<Vec<u64>> {
        let Some((_, entry)) = self.entries.iter().find(|(own, _)| *own == BELOW) else { return Ok(vec![]) };
        let n = self.number_at(file, entry + 4, self.side())?.min(MOST_BELOW);
        let values = entry + 4 + self.side() as u64;
        let n_bytes = if [16, 18].contains(&self.number_at(file, entry + 2, 2)?) { 8 } else { 4 };
        let is_within = n * n_bytes as u64 <= self.side() as u64;
        let from = if is_within { values } else { self.number_at(file, values, self.side())? };
        (0..n).map(|i| self.number_at(file, from + i * n_bytes as u64, n_bytes)).collect()
    }

    /// Returns where the place of the next directory stands, and the bytes that would lead to another.
    pub(super) fn link_to(&self, next: u64) -> (u64, Vec<u8>) {
        (self.next_at, self.bytes(next, self.side()))
    }

    /// Returns the two bytes of a whole number.
    pub(super) fn bytes_of(&self, value: u16) -> Vec<u8> {
        self.bytes(value.into(), 2)
    }

    fn bytes(&self, value: u64, n_bytes: usize) -> Vec<u8> {
        let all = value.to_be_bytes();
        let own = all[8 - n_bytes..].iter().copied();
        if self.is_big_endian { own.collect() } else { own.rev().collect() }
    }

    /// How many bytes a place in the file takes.
    fn side(&self) -> usize {
        if self.is_big_file { 8 } else { 4 }
    }

    /// Returns all texts of a tag, which some writers have twice.
    pub(super) fn texts(&self, file: &mut File, tag: u16) -> Result<Vec<String>> {
        let side = self.side();
        let mut texts = vec![];
        for (_, place) in self.entries.iter().filter(|(own, _)| *own == tag) {
            let n_bytes = self.number_at(file, place + 4, side)?;
            let values = place + 4 + side as u64;
            let from = if n_bytes <= side as u64 { values } else { self.number_at(file, values, side)? };
            let mut bytes = vec![];
            file.seek(SeekFrom::Start(from))?;
            file.by_ref().take(n_bytes.min(MOST_BYTES)).read_to_end(&mut bytes)?;
            texts.push(String::from_utf8_lossy(&bytes).trim_matches(['\0', ' ', '\n']).to_owned());
        }
        texts.retain(|text| !text.is_empty());
        Ok(texts)
    }

    fn number_at(&self, file: &mut File, at: u64, n_bytes: usize) -> Result<u64> {
        let mut bytes = [0; 8];
        file.seek(SeekFrom::Start(at))?;
        file.read_exact(&mut bytes[..n_bytes])?;
        Ok(self.number(&bytes[..n_bytes]))
    }

    fn number(&self, bytes: &[u8]) -> u64 {
        let put = |number: u64, byte: &u8| number << 8 | u64::from(*byte);
        if self.is_big_endian { bytes.iter().fold(0, put) } else { bytes.iter().rev().fold(0, put) }
    }
}
