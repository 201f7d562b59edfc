//! Zemax archives (`.zar`): a lens with the files that it needs, one after the other, each compressed by itself.
//!
//! Their layout is not published; the facts are those by which the Python package zmxtools unpacks the archives of lens makers. A file
//! begins with a header of which the first byte tells the version, and which holds the number of bytes that follow and the file's name:
//!
//! | first byte | header, bytes | number of bytes at | name at |
//! |---|---|---|---|
//! | `EA` | 332 | 12, 32 bits | 32, ASCII to a zero |
//! | `EC` | 648 | 16, 64 bits | 48, UTF-16 to a zero |
//!
//! A name that ends in `.LZW` is that of a file compressed by Welch's algorithm (1984): codes of 9 bits and more from the highest bit on,
//! of which the first 256 are the bytes, without any for an end or a new beginning.

/// The most bytes of all files of an archive: as many as a lens file may have, some times over.
const MOST_BYTES: usize = 64 << 20;
/// The longest code, bits: more words than an archive has bytes.
const LONGEST_CODE: u32 = 27;

/// A file of an archive.
pub(super) struct Packed {
    pub(super) name: String,
    pub(super) bytes: Vec<u8>,
}

impl Packed {
    pub(super) fn has_extension(&self, extension: &str) -> bool {
        self.name.rsplit_once('.').is_some_and(|(_, own)| own.eq_ignore_ascii_case(extension))
    }
}

/// Returns the files of an archive.
pub(super) fn unpack(archive: &[u8]) -> Result<Vec<Packed>, String> {
    let mut files = Vec::new();
    let (mut rest, mut n_bytes) = (archive, 0);
    while rest.len() > 1 {
        let (header_bytes, n_packed, name) = match rest[0] {
            0xEA => (332, number_at(rest, 12, 4), name_at(rest, 32, 332, 1)),
            0xEC => (648, number_at(rest, 16, 8), name_at(rest, 48, 648, 2)),
            first => {
                return Err(format!(
                    "it is no Zemax archive: a file in it begins with {first:#04x}, expected 0xea or 0xec"
                ));
            }
        };
        let cut = || format!("file {} of the archive is cut off", files.len() + 1);
        let n_packed = n_packed.and_then(|n| usize::try_from(n).ok()).ok_or_else(cut)?;
        let packed = rest.get(header_bytes..).and_then(|after| after.get(..n_packed)).ok_or_else(cut)?;
        let name = name.ok_or_else(cut)?;
        let (name, bytes) = match name.len().checked_sub(4).filter(|&end| name.is_char_boundary(end)) {
            Some(end) if name[end..].eq_ignore_ascii_case(".lzw") => {
                let room = MOST_BYTES.saturating_sub(n_bytes);
                (name[..end].to_owned(), expand(packed, room).map_err(|why| format!("{name} of the archive {why}"))?)
            }
            _ => (name, packed.to_vec()),
        };
        n_bytes += bytes.len();
        files.push(Packed { name, bytes });
        rest = &rest[header_bytes + n_packed..];
    }
    Ok(files)
}

/// Returns the number of this many bytes, the lowest first.
fn number_at(bytes: &[u8], from: usize, n_bytes: usize) -> Option<u64> {
    let own = bytes.get(from..from + n_bytes)?;
    Some(own.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte)))
}

/// Returns the text between two places, of one or two bytes a sign, up to a zero.
fn name_at(bytes: &[u8], from: usize, to: usize, width: usize) -> Option<String> {
    let own = bytes.get(from..to)?;
    let units = own.chunks_exact(width).map(|unit| u16::from_le_bytes([unit[0], unit.get(1).copied().unwrap_or(0)]));
    let units: Vec<u16> = units.take_while(|unit| *unit != 0).collect();
    Some(String::from_utf16_lossy(&units))
}

/// Returns what Welch's algorithm has compressed.
///
/// A word is the one before it and the next byte, and so stands in what was written: it is kept as its place there.
fn expand(packed: &[u8], room: usize) -> Result<Vec<u8>, String> {
    const N_BYTES: usize = 256;
    let mut written: Vec<u8> = Vec::new();
    let mut words: Vec<std::ops::Range<usize>> = Vec::new();
    let (mut held, mut n_held) = (0_u64, 0);
    let mut bytes = packed.iter();
    let mut before: Option<std::ops::Range<usize>> = None;
    loop {
        let n_bits = 1 + (N_BYTES + words.len()).ilog2();
        if n_bits > LONGEST_CODE {
            return Err("has more words than it has bytes".to_owned());
        }
        while n_held < n_bits {
            let Some(byte) = bytes.next() else { return Ok(written) };
            (held, n_held) = (held << 8 | u64::from(*byte), n_held + 8);
        }
        n_held -= n_bits;
        let code = (held >> n_held) as usize & ((1 << n_bits) - 1);
        let from = written.len();
        // The word that is about to be complete may be meant already.
        let grown = before.clone().map(|word| word.start..word.end + 1);
        match (code.checked_sub(N_BYTES), &grown) {
            (None, _) => written.push(code as u8),
            (Some(i), _) if i < words.len() => written.extend_from_within(words[i].clone()),
            (Some(i), Some(word)) if i == words.len() => {
                let first = written[word.start];
                written.extend_from_within(word.start..word.end - 1);
                written.push(first);
            }
            _ => return Err("is not compressed as it should be".to_owned()),
        }
        if written.len() > room {
            return Err(format!("is larger than {room} bytes"));
        }
        words.extend(grown);
        before = Some(from..written.len());
    }
}

#[cfg(test)]
mod tests {
    use std::{collections::HashMap, path::Path};

    use super::*;
    use crate::{LensFile, ReadOptions};

    /// Compresses by Welch's algorithm, with a dictionary of words.
    fn compress(bytes: &[u8]) -> Vec<u8> {
        let mut words: HashMap<Vec<u8>, usize> = (0..=255).map(|byte| (vec![byte], usize::from(byte))).collect();
        let (mut codes, mut word) = (Vec::new(), Vec::new());
        for byte in bytes {
            word.push(*byte);
            if !words.contains_key(&word) {
                words.insert(word.clone(), words.len());
                codes.push(words[&word[..word.len() - 1]]);
                word = vec![*byte];
            }
        }
        codes.extend(words.get(&word));
        let mut bits = String::new();
        for (i, code) in codes.iter().enumerate() {
            // Whoever reads has one word fewer, and none before the second code.
            let n_words = 256 + i.saturating_sub(1);
            let n_bits = (n_words.ilog2() + 1) as usize;
            bits += &format!("{code:0n_bits$b}");
        }
        bits += &"0".repeat((8 - bits.len() % 8) % 8);
        bits.as_bytes().chunks(8).map(|bits| bits.iter().fold(0, |byte, bit| byte << 1 | (bit - b'0'))).collect()
    }

    /// Packs files, those of odd numbers as the earlier version does.
    fn pack(files: &[(&str, &[u8])]) -> Vec<u8> {
        let mut archive = Vec::new();
        for (i, (name, bytes)) in files.iter().enumerate() {
            let packed = compress(bytes);
            let name = format!("{name}.LZW");
            let is_early = i % 2 == 1;
            let mut header = vec![0; if is_early { 332 } else { 648 }];
            let size = packed.len() as u64;
            if is_early {
                header[0] = 0xEA;
                header[12..16].copy_from_slice(&(size as u32).to_le_bytes());
                header[32..32 + name.len()].copy_from_slice(name.as_bytes());
            } else {
                (header[0], header[1]) = (0xEC, 3);
                header[16..24].copy_from_slice(&size.to_le_bytes());
                for (place, unit) in name.encode_utf16().enumerate() {
                    header[48 + 2 * place..50 + 2 * place].copy_from_slice(&unit.to_le_bytes());
                }
            }
            archive.extend(header);
            archive.extend(packed);
        }
        archive
    }

    #[test]
    fn files_come_out_as_they_went_in() {
        let long: Vec<u8> = (0..70_000_u64).map(|i| (i * i / 7 % 251) as u8).collect();
        let runs = [b'a'; 5000];
        let files: [(&str, &[u8]); 4] =
            [("lens.zmx", b"SURF 0\n"), ("LONG.AGF", &long), ("runs.dat", &runs), ("empty.ses", b"")];
        let archive = pack(&files);
        let found = unpack(&archive).unwrap();
        for (found, (name, bytes)) in found.iter().zip(files) {
            assert_eq!((found.name.as_str(), found.bytes.as_slice()), (name, bytes));
        }
        assert_eq!(found.len(), 4);
        for n in [1, 100, 648, 700, archive.len() - 1] {
            let _ = unpack(&archive[..n]);
        }
        assert!(unpack(&archive[..700]).is_err());
    }

    #[test]
    fn the_lens_of_an_archive_has_its_glasses() {
        let lens = "UNIT MM\nENPD 4\nGCAT MINE\nPWAV 1\nWAVM 1 0.55 1\nSURF 0\n  DISZ INFINITY\nSURF 1\n  STOP\n  CURV 0.02\n  \
                    DISZ 2\n  GLAS OWN\n  DIAM 3\nSURF 2\n  DISZ 90\n  DIAM 3\nSURF 3\n  DISZ 0\n";
        let glasses = "CC mine\nNM OWN 2 0 1.5 60 0 0\nCD 1.25 0 0 0 0 0\nLD 0.3 2\n";
        let files: [(&str, &[u8]); 3] =
            [("a.zmx", lens.as_bytes()), ("MINE.AGF", glasses.as_bytes()), ("COATING.DAT", b"")];
        let read = |files: &[(&str, &[u8])]| {
            LensFile::from_bytes(Path::new("x/archive.zar"), &pack(files), &ReadOptions::default())
        };
        let file = read(&files).unwrap();
        assert!((file.lens.at(550.0).unwrap().first_order().efl_mm - 100.0).abs() < 1e-9);
        assert!(file.notes.iter().any(|note| note.starts_with("COATING.DAT of the archive")), "{:?}", file.notes);
        let message = read(&files[1..]).unwrap_err().to_string();
        assert!(message.contains("archive.zar") && message.contains("0 lenses as .zmx, expected one"), "{message}");
        assert!(read(&files[..1]).unwrap_err().to_string().contains("OWN"));
    }

    #[test]
    fn what_is_no_archive_is_refused() {
        assert!(unpack(b"PK\x03\x04 a zip").err().unwrap().contains("no Zemax archive"));
        let mut broken = pack(&[("a.zmx", b"aaaaaaaaaaaa")]);
        let n = broken.len();
        broken[n - 4..].fill(0xFF);
        assert!(unpack(&broken).err().unwrap().contains("compressed"));
    }
}
