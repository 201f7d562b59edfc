//! The directories of a TIFF file, read with every count and place held to the bytes that are there (TIFF 6.0, section 2).

use std::collections::BTreeMap;

/// A file in memory, with its order of bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct TiffReader<'a> {
    bytes: &'a [u8],
    is_big_endian: bool,
}

/// The fields of a directory.
#[derive(Clone, Debug)]
pub(super) struct Fields<'a> {
    file: TiffReader<'a>,
    fields: BTreeMap<u16, Field<'a>>,
}

#[derive(Clone, Copy, Debug)]
struct Field<'a> {
    kind: u16,
    bytes: &'a [u8],
}

impl<'a> TiffReader<'a> {
    /// Returns the reader of a file and the place of its first directory.
    pub(super) fn new(bytes: &'a [u8]) -> Result<(Self, usize), String> {
        Self::beginning(bytes, [b"II*\0", b"MM\0*"])
            .unwrap_or_else(|| Err("is no TIFF file, expected it to begin with II*\\0 or MM\\0*".to_owned()))
    }

    /// Returns the same of a camera profile (DCP), which has letters in place of the number of TIFF files; `None` of other files.
    pub(super) fn of_profile(bytes: &'a [u8]) -> Option<Result<(Self, usize), String>> {
        Self::beginning(bytes, [b"IIRC", b"MMCR"])
    }

    fn beginning(bytes: &'a [u8], [little, big]: [&[u8; 4]; 2]) -> Option<Result<(Self, usize), String>> {
        let begin = bytes.get(..4)?;
        let is_big_endian = begin == big;
        (is_big_endian || begin == little).then(|| Self::of_order(bytes, is_big_endian))
    }

    fn of_order(bytes: &'a [u8], is_big_endian: bool) -> Result<(Self, usize), String> {
        let file = Self { bytes, is_big_endian };
        let first = file.whole(4, 4).ok_or("ends in its header")?;
        Ok((file, first as usize))
    }

    pub(super) fn is_big_endian(self) -> bool {
        self.is_big_endian
    }

    pub(super) fn n_bytes(self) -> usize {
        self.bytes.len()
    }

    /// Returns bytes of the file, or `None` where they reach beyond its end.
    pub(super) fn slice(self, place: usize, n: usize) -> Option<&'a [u8]> {
        self.bytes.get(place..place.checked_add(n)?)
    }

    /// Returns the directory at a place.
    pub(super) fn fields_at(self, place: usize) -> Result<Fields<'a>, String> {
        let beyond = || format!("ends before the directory at byte {place}");
        let n = self.whole(place, 2).ok_or_else(beyond)? as usize;
        let table = self.slice(place + 2, 12 * n).ok_or_else(beyond)?;
        let mut fields = BTreeMap::new();
        for i in 0..n {
            let at = place + 2 + 12 * i;
            let number = |offset: usize, n: usize| self.whole(at + offset, n).ok_or_else(beyond);
            let (tag, kind, count) = (number(0, 2)? as u16, number(2, 2)? as u16, number(4, 4)? as usize);
            // Fields of types that are not known are passed over (TIFF 6.0, page 16).
            let Some(size) = size_of(kind) else { continue };
            let n_bytes = count.checked_mul(size).ok_or_else(|| format!("field {tag} has too many values, {count}"))?;
            let bytes = if n_bytes <= 4 {
                &table[12 * i + 8..12 * i + 8 + n_bytes]
            } else {
                let reason = || format!("ends before the {n_bytes} bytes of field {tag}");
                self.slice(number(8, 4)? as usize, n_bytes).ok_or_else(reason)?
            };
            fields.entry(tag).or_insert(Field { kind, bytes });
        }
        Ok(Fields { file: self, fields })
    }

    /// Returns the whole number of so many bytes at a place.
    fn whole(self, place: usize, n: usize) -> Option<u64> {
        self.slice(place, n).map(|bytes| self.number(bytes))
    }

    fn number(self, bytes: &[u8]) -> u64 {
        let add = |sum: u64, byte: &u8| sum << 8 | u64::from(*byte);
        if self.is_big_endian { bytes.iter().fold(0, add) } else { bytes.iter().rev().fold(0, add) }
    }
}

/// Returns the bytes of a value of a type.
fn size_of(kind: u16) -> Option<usize> {
    match kind {
        1 | 2 | 6 | 7 => Some(1),
        3 | 8 => Some(2),
        4 | 9 | 11 | 13 => Some(4),
        5 | 10 | 12 => Some(8),
        _ => None,
    }
}

impl<'a> Fields<'a> {
    pub(super) fn has(&self, tag: u16) -> bool {
        self.fields.contains_key(&tag)
    }

    /// Returns the bytes of a field.
    pub(super) fn bytes(&self, tag: u16) -> Option<&'a [u8]> {
        self.fields.get(&tag).map(|field| field.bytes)
    }

    /// Returns the whole number that bytes of a field are, in the file's order.
    pub(super) fn number_of(&self, bytes: &[u8]) -> u64 {
        self.file.number(bytes)
    }

    /// Returns the text of a field, without its zeros and spaces; `None` where there is none.
    pub(super) fn text(&self, tag: u16) -> Option<String> {
        let bytes = self.fields.get(&tag).filter(|field| matches!(field.kind, 1 | 2 | 7))?.bytes;
        let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
        let text = String::from_utf8_lossy(&bytes[..end]).trim().to_owned();
        (!text.is_empty()).then_some(text)
    }

    /// Returns the values of a field of whole numbers; none where it is absent.
    pub(super) fn whole(&self, tag: u16) -> Result<Vec<usize>, String> {
        let Some(field) = self.fields.get(&tag) else { return Ok(Vec::new()) };
        match field.kind {
            1 | 3 | 4 | 7 | 13 => {
                let size = size_of(field.kind).unwrap_or(1);
                Ok(field.bytes.chunks_exact(size).map(|bytes| self.file.number(bytes) as usize).collect())
            }
            other => Err(format!("field {tag} is of type {other}, expected whole numbers (1, 3 or 4)")),
        }
    }

    /// Returns the only value of a field of whole numbers, or that of a field that is absent.
    pub(super) fn one_or(&self, tag: u16, absent: usize) -> Result<usize, String> {
        Ok(self.whole(tag)?.first().copied().unwrap_or(absent))
    }

    /// Returns the values of a field of numbers of any type; none where it is absent. A fraction over 0 is not finite.
    pub(super) fn numbers(&self, tag: u16) -> Result<Vec<f64>, String> {
        let Some(field) = self.fields.get(&tag) else { return Ok(Vec::new()) };
        let file = self.file;
        let long = |bytes: &[u8]| file.number(bytes);
        let value = |bytes: &[u8]| -> Option<f64> {
            Some(match field.kind {
                1 | 3 | 4 | 7 | 13 => long(bytes) as f64,
                6 => f64::from(long(bytes) as u8 as i8),
                8 => f64::from(long(bytes) as u16 as i16),
                9 => f64::from(long(bytes) as u32 as i32),
                5 => long(&bytes[..4]) as f64 / long(&bytes[4..]) as f64,
                10 => f64::from(long(&bytes[..4]) as u32 as i32) / f64::from(long(&bytes[4..]) as u32 as i32),
                11 => f64::from(f32::from_bits(long(bytes) as u32)),
                12 => f64::from_bits(long(bytes)),
                _ => return None,
            })
        };
        let size = size_of(field.kind).unwrap_or(1);
        let values: Option<Vec<f64>> = field.bytes.chunks_exact(size).map(value).collect();
        values.ok_or_else(|| format!("field {tag} is of type {}, expected numbers", field.kind))
    }

    /// Returns as many finite numbers as a field must have; `None` where it is absent.
    pub(super) fn finite(&self, tag: u16, n: usize) -> Result<Option<Vec<f64>>, String> {
        let values = self.numbers(tag)?;
        match values.len() {
            0 if !self.has(tag) => Ok(None),
            found if found != n => Err(format!("field {tag} has {found} numbers, expected {n}")),
            _ if values.iter().all(|value| value.is_finite()) => Ok(Some(values)),
            _ => Err(format!("field {tag} has a fraction over 0, expected finite numbers")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dng::tiff_file::{Directory, Value};

    #[test]
    fn what_is_written_is_read() {
        let mut child = Directory::default();
        child.set(37, Value::Ascii("odd".to_owned()));
        let mut first = Directory::default();
        first.set(300, Value::Short(vec![7]));
        first.set(301, Value::SignedRational(vec![(-3, 4), (1, 0)]));
        first.set(302, Value::Double(vec![1e-3, -2.0]));
        first.set_child(330, child);
        let file = first.into_file().unwrap();
        let (reader, place) = TiffReader::new(&file).unwrap();
        let fields = reader.fields_at(place).unwrap();
        assert_eq!((fields.whole(300).unwrap(), fields.one_or(299, 4).unwrap()), (vec![7], 4));
        assert_eq!(fields.finite(302, 2).unwrap(), Some(vec![1e-3, -2.0]));
        assert_eq!(fields.numbers(301).unwrap(), [-0.75, f64::INFINITY]);
        assert!(fields.finite(301, 2).unwrap_err().contains("over 0") && fields.whole(301).is_err());
        let child = reader.fields_at(fields.one_or(330, 0).unwrap()).unwrap();
        assert_eq!((child.text(37), child.text(38)), (Some("odd".to_owned()), None));
    }

    #[test]
    fn big_endian_files_are_read() {
        let file = b"MM\0*\0\0\0\x08\0\x01\x01\0\0\x03\0\0\0\x01\x12\x34\0\0\0\0\0\0";
        let (reader, place) = TiffReader::new(file).unwrap();
        assert_eq!(reader.fields_at(place).unwrap().whole(256).unwrap(), [0x1234]);
    }

    #[test]
    fn what_lies_beyond_the_end_is_refused() {
        let reason = |file: &[u8]| {
            let read = TiffReader::new(file).and_then(|(reader, place)| reader.fields_at(place).map(|_| ()));
            read.unwrap_err()
        };
        assert!(reason(b"II+\0").contains("TIFF"));
        assert!(reason(b"II*\0\x08\0\0").contains("header"));
        assert!(reason(b"II*\0\xff\0\0\0").contains("directory at byte 255"));
        // A thousand million values of eight bytes.
        let field = b"II*\0\x08\0\0\0\x01\0\x00\x01\x05\0\0\0\0\x40\0\0\0\0\0\0\0\0";
        assert!(reason(field).contains("field 256"), "{}", reason(field));
    }
}
