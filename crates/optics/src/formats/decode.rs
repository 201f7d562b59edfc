//! The bytes of a file, and as text, whatever its encoding.

use std::{fs, path::Path};

use crate::OpticsError;

/// The largest lens file, bytes: far more than any lens needs.
const LARGEST_FILE: u64 = 16 << 20;

/// Returns what a file holds, unless it is larger than any that this crate reads.
pub(super) fn bytes_of(path: &Path) -> Result<Vec<u8>, OpticsError> {
    let failed = |reason: String| OpticsError::Io { path: path.to_owned(), reason };
    let n_bytes = fs::metadata(path).map_err(|error| failed(error.to_string()))?.len();
    if n_bytes > LARGEST_FILE {
        return Err(failed(format!("the file has {n_bytes} bytes; expected at most {LARGEST_FILE}")));
    }
    fs::read(path).map_err(|error| failed(error.to_string()))
}

/// Returns the text in UTF-8 or UTF-16 (with or without a byte-order mark), or in Latin-1 where it is neither.
///
/// Lens programs of the last thirty years write all of these. Without a mark, text is taken for UTF-16 where every
/// other byte of its beginning is 0, which holds for no other text. Signs that are broken become `�`.
pub(super) fn text_of(bytes: &[u8]) -> String {
    match bytes {
        [0xEF, 0xBB, 0xBF, rest @ ..] => String::from_utf8_lossy(rest).into_owned(),
        [0xFF, 0xFE, rest @ ..] => utf16(rest, u16::from_le_bytes),
        [0xFE, 0xFF, rest @ ..] => utf16(rest, u16::from_be_bytes),
        _ if has_zeros_at(bytes, 1) => utf16(bytes, u16::from_le_bytes),
        _ if has_zeros_at(bytes, 0) => utf16(bytes, u16::from_be_bytes),
        _ => match std::str::from_utf8(bytes) {
            Ok(text) => text.to_owned(),
            Err(_) => bytes.iter().map(|&byte| char::from(byte)).collect(),
        },
    }
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> String {
    let units = bytes.as_chunks::<2>().0.iter().map(|&pair| unit(pair));
    char::decode_utf16(units).map(|sign| sign.unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
}

/// Whether of the first pairs of bytes each has a 0 at this place and none at the other.
fn has_zeros_at(bytes: &[u8], place: usize) -> bool {
    let pairs = bytes.as_chunks::<2>().0;
    pairs.len() >= 4 && pairs.iter().take(16).all(|pair| pair[place] == 0 && pair[1 - place] != 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_encoding_gives_the_same_text() {
        let text = "NAME Größe 50\r\nSURF 0\r\n";
        let little: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
        let big: Vec<u8> = text.encode_utf16().flat_map(u16::to_be_bytes).collect();
        let latin: Vec<u8> = text.chars().map(|sign| sign as u8).collect();
        let marked = |mark: &[u8], bytes: &[u8]| [mark, bytes].concat();
        assert_eq!(text_of(text.as_bytes()), text);
        assert_eq!(text_of(&marked(&[0xEF, 0xBB, 0xBF], text.as_bytes())), text);
        assert_eq!(text_of(&marked(&[0xFF, 0xFE], &little)), text);
        assert_eq!(text_of(&marked(&[0xFE, 0xFF], &big)), text);
        assert_eq!(text_of(&little), text);
        assert_eq!(text_of(&big), text);
        assert_eq!(text_of(&latin), text);
        assert_eq!(text_of(&[0xFF, 0xFE, 0x41]), "");
        assert_eq!(text_of(&[]), "");
    }
}
