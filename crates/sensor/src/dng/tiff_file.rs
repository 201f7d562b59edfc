//! A TIFF file of directories within directories, as DNG wants it: little-endian, tags in order, all that is pointed to on even
//! places (TIFF 6.0, section 2).

use std::collections::BTreeMap;

use super::tags::{STRIP_BYTE_COUNTS, STRIP_OFFSETS};

/// The values of a field.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Value {
    Byte(Vec<u8>),
    Ascii(String),
    Short(Vec<u16>),
    Long(Vec<u32>),
    Rational(Vec<(u32, u32)>),
    Undefined(Vec<u8>),
    SignedRational(Vec<(i32, i32)>),
    Double(Vec<f64>),
}

impl Value {
    /// Returns a number as a fraction of so many parts.
    pub(crate) fn fraction(value: f64, parts: u32) -> (u32, u32) {
        ((value * f64::from(parts)).round().clamp(0.0, f64::from(u32::MAX)) as u32, parts)
    }

    /// Returns the number of the type, how many values there are, and their bytes.
    fn encoded(&self) -> (u16, usize, Vec<u8>) {
        let pair = |(a, b): &(u32, u32)| [a.to_le_bytes(), b.to_le_bytes()].concat();
        let signed = |(a, b): &(i32, i32)| [a.to_le_bytes(), b.to_le_bytes()].concat();
        match self {
            Self::Byte(v) => (1, v.len(), v.clone()),
            Self::Ascii(text) => {
                // TIFF text is ASCII and ends with a zero.
                let plain = text.chars().map(|c| if c.is_ascii() && c != '\0' { c as u8 } else { b'?' });
                let bytes: Vec<u8> = plain.chain([0]).collect();
                (2, bytes.len(), bytes)
            }
            Self::Short(v) => (3, v.len(), v.iter().flat_map(|n| n.to_le_bytes()).collect()),
            Self::Long(v) => (4, v.len(), v.iter().flat_map(|n| n.to_le_bytes()).collect()),
            Self::Rational(v) => (5, v.len(), v.iter().flat_map(pair).collect()),
            Self::Undefined(v) => (7, v.len(), v.clone()),
            Self::SignedRational(v) => (10, v.len(), v.iter().flat_map(signed).collect()),
            Self::Double(v) => (12, v.len(), v.iter().flat_map(|n| n.to_le_bytes()).collect()),
        }
    }
}

/// A directory with all that hangs on it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Directory {
    fields: BTreeMap<u16, Value>,
    /// Directories to which a field of this number points.
    children: BTreeMap<u16, Self>,
    /// The samples of its image, one strip.
    strip: Option<Vec<u8>>,
}

impl Directory {
    pub(crate) fn set(&mut self, tag: u16, value: Value) {
        self.fields.insert(tag, value);
    }

    #[cfg(test)]
    pub(crate) fn remove(&mut self, tag: u16) {
        self.fields.remove(&tag);
    }

    pub(crate) fn set_child(&mut self, tag: u16, child: Self) {
        self.children.insert(tag, child);
    }

    pub(crate) fn set_strip(&mut self, bytes: Vec<u8>) {
        self.strip = Some(bytes);
    }

    /// Returns the file whose first directory this is, or `None` if it were beyond 4 GiB.
    pub(crate) fn into_file(self) -> Option<Vec<u8>> {
        let mut file = b"II*\0\0\0\0\0".to_vec();
        let first = self.append_to(&mut file)?;
        file[4..8].copy_from_slice(&first.to_le_bytes());
        Some(file)
    }

    /// Returns such a file with bytes between its header and all else.
    #[cfg(test)]
    pub(crate) fn into_file_behind(self, bytes: &[u8]) -> Option<Vec<u8>> {
        let mut file = b"II*\0\0\0\0\0".to_vec();
        file.extend(bytes);
        let first = self.append_to(&mut file)?;
        file[4..8].copy_from_slice(&first.to_le_bytes());
        Some(file)
    }

    /// Appends the directory after all that it points to, and returns its place.
    fn append_to(mut self, file: &mut Vec<u8>) -> Option<u32> {
        for (tag, child) in std::mem::take(&mut self.children) {
            let place = child.append_to(file)?;
            self.set(tag, Value::Long(vec![place]));
        }
        if let Some(strip) = self.strip.take() {
            let place = append_even(file, &strip)?;
            self.set(STRIP_OFFSETS, Value::Long(vec![place]));
            self.set(STRIP_BYTE_COUNTS, Value::Long(vec![u32::try_from(strip.len()).ok()?]));
        }
        let mut table = u16::try_from(self.fields.len()).ok()?.to_le_bytes().to_vec();
        for (tag, value) in &self.fields {
            let (kind, count, mut bytes) = value.encoded();
            table.extend(tag.to_le_bytes());
            table.extend(kind.to_le_bytes());
            table.extend(u32::try_from(count).ok()?.to_le_bytes());
            if bytes.len() <= 4 {
                bytes.resize(4, 0);
                table.extend(bytes);
            } else {
                table.extend(append_even(file, &bytes)?.to_le_bytes());
            }
        }
        // No directory follows.
        table.extend([0; 4]);
        append_even(file, &table)
    }
}

/// Appends bytes on an even place, and returns it.
fn append_even(file: &mut Vec<u8>, bytes: &[u8]) -> Option<u32> {
    if file.len() % 2 == 1 {
        file.push(0);
    }
    let place = u32::try_from(file.len()).ok()?;
    file.extend_from_slice(bytes);
    u32::try_from(file.len()).ok()?;
    Some(place)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_has_its_parts_on_even_places_and_in_order() {
        let mut child = Directory::default();
        child.set(37, Value::Ascii("odd".to_owned()));
        let mut first = Directory::default();
        first.set(300, Value::Short(vec![7]));
        first.set(256, Value::Byte(vec![1, 2, 3, 4, 5]));
        first.set_child(330, child);
        first.set_strip(vec![9; 3]);
        let file = first.into_file().unwrap();
        let number = |at: usize, n: usize| (0..n).rev().fold(0_usize, |sum, i| sum << 8 | usize::from(file[at + i]));
        let at = number(4, 4);
        assert_eq!((&file[..4], at % 2, number(at, 2)), (&b"II*\0"[..], 0, 5));
        let tags: Vec<usize> = (0..5).map(|i| number(at + 2 + 12 * i, 2)).collect();
        assert_eq!(tags, [256, 273, 279, 300, 330]);
        let place = |i: usize| number(at + 2 + 12 * i + 8, 4);
        assert_eq!((place(0) % 2, &file[place(0)..place(0) + 5]), (0, &[1, 2, 3, 4, 5][..]));
        assert_eq!((&file[place(1)..place(1) + place(2)], place(3)), (&[9, 9, 9][..], 7));
        let child = place(4);
        assert_eq!((number(child, 2), &file[child + 10..child + 14]), (1, &b"odd\0"[..]));
    }
}
