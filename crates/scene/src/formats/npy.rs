//! Arrays of `NumPy` (`.npy`): the format of its documentation, "numpy.lib.format", versions 1 to 3.

use std::{fs::File, io::Read, path::Path};

use super::{
    stated::{Noted, Stated, name_of, short},
    unusable::{TRUNCATED, check_memory, unreadable},
};
use crate::SceneError;

pub(super) const MAGIC: &[u8] = b"\x93NUMPY";

/// An array of real numbers.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct NpyArray {
    /// Axes, the slowest first.
    pub(super) sides: Vec<usize>,
    /// Its numbers in that order.
    pub(super) values: Vec<f32>,
    /// The largest number that whole numbers of its type have; `None` for floats.
    pub(super) top: Option<f64>,
    /// Bytes behind its numbers, as of another array.
    n_more: usize,
}

impl NpyArray {
    /// Returns the array with what is to be said of its file.
    pub(super) fn noted(self, path: &Path) -> Noted<Self> {
        let n = self.n_more;
        let note = (n > 0).then(|| format!("{}: {n} bytes behind its array are not used", name_of(path)));
        Noted::new(self, note)
    }
}

/// Reads an array.
///
/// # Errors
/// When it is none, is truncated, or has other elements than real numbers.
pub(super) fn read_npy(path: &Path) -> Result<Noted<NpyArray>, SceneError> {
    let mut file = File::open(path).map_err(|error| unreadable(path, error))?;
    let length = file.metadata().map_err(|error| unreadable(path, error))?.len();
    // The numbers of the file, the single floats that they become, and the planes that are made of these.
    check_memory(path, length.saturating_mul(9), length)?;
    let mut bytes = vec![];
    file.read_to_end(&mut bytes).map_err(|error| unreadable(path, error))?;
    parse(&bytes).map_err(|reason| unreadable(path, reason)).map(|array| array.noted(path))
}

/// What stands before the numbers of an array.
struct Header {
    sides: Vec<usize>,
    /// The kind of its elements, without their order.
    kind: String,
    is_big_endian: bool,
    /// Whether the first axis is the fastest.
    is_fortran: bool,
    /// Where its numbers begin.
    n_bytes: usize,
}

fn truncated() -> String {
    TRUNCATED.to_owned()
}

fn header_of(bytes: &[u8]) -> Result<Header, String> {
    if !bytes.starts_with(MAGIC) {
        return Err("it is no array of NumPy".to_owned());
    }
    let (length, from): (usize, usize) = match bytes.get(6..12) {
        Some(&[1, _, a, b, ..]) => (usize::from(u16::from_le_bytes([a, b])), 10),
        Some(&[2 | 3, _, a, b, c, d]) => (u32::from_le_bytes([a, b, c, d]) as usize, 12),
        Some(&[version, ..]) => return Err(format!("it is of version {version}, expected 1 to 3")),
        _ => return Err(truncated()),
    };
    let header = bytes.get(from..from.saturating_add(length)).ok_or_else(truncated)?;
    let header = String::from_utf8_lossy(header);
    let mut keys = Stated::new("key", entries_of(&header)?);
    let mut required = |name: &str| keys.take(name).ok_or_else(|| format!("its header lacks '{name}'"));
    let kind = required("descr")?;
    let is_fortran = match required("fortran_order")?.as_str() {
        "True" => true,
        "False" => false,
        other => return Err(format!("fortran_order is '{}', expected True or False", short(other))),
    };
    let shape = required("shape")?;
    let sides = shape.trim_matches(['(', ')']).split(',').map(str::trim).filter(|side| !side.is_empty());
    let sides: Vec<usize> = sides
        .map(|side| side.parse().map_err(|_| format!("a side of its shape is '{}'", short(side))))
        .collect::<Result<_, _>>()?;
    if let Some(other) = keys.names().next() {
        return Err(format!("its header has the key '{}', expected descr, fortran_order and shape", short(other)));
    }
    let kind = kind.trim_matches(['\'', '"']).to_owned();
    let (order, kind) = kind.split_at(usize::from(kind.starts_with(['<', '>', '|', '='])));
    let (is_big_endian, kind) = (order == ">", kind.to_owned());
    Ok(Header { sides, kind, is_big_endian, is_fortran, n_bytes: from + length })
}

/// Reads the array of these bytes.
pub(super) fn parse(bytes: &[u8]) -> Result<NpyArray, String> {
    numbers_of(header_of(bytes)?, bytes)
}

/// Reads an array of real or complex numbers; of complex ones the last axis has the real and the imaginary part. Returns whether they are.
pub(super) fn parse_complex(bytes: &[u8]) -> Result<(NpyArray, bool), String> {
    let mut header = header_of(bytes)?;
    let part = match header.kind.as_str() {
        "c8" => "f4",
        "c16" => "f8",
        _ => return Ok((numbers_of(header, bytes)?, false)),
    };
    if header.is_fortran && header.sides.len() > 1 {
        return Err("its complex numbers are in the order of Fortran, expected that of C".to_owned());
    }
    header.kind = part.to_owned();
    header.sides.push(2);
    header.is_fortran = false;
    Ok((numbers_of(header, bytes)?, true))
}

/// Reads the numbers behind a header.
fn numbers_of(header: Header, bytes: &[u8]) -> Result<NpyArray, String> {
    let Header { sides, kind, is_big_endian, is_fortran, n_bytes } = header;
    let Some((size, top, number)) = element(&kind) else {
        return Err(match kind.strip_prefix('c') {
            Some(_) => {
                "its elements are complex numbers, expected real ones: save their magnitudes (numpy.abs)".to_owned()
            }
            None => format!("its elements are '{}', expected real numbers", short(&kind)),
        });
    };
    let n = sides.iter().try_fold(1_usize, |n, &side| n.checked_mul(side)).unwrap_or(usize::MAX);
    let data = &bytes[n_bytes..];
    if data.len() / size < n {
        return Err(truncated());
    }
    let value = |index: usize| {
        let mut little = [0; 8];
        little[..size].copy_from_slice(&data[index * size..(index + 1) * size]);
        if is_big_endian {
            little[..size].reverse();
        }
        number(little) as f32
    };
    let values = if is_fortran && sides.len() > 1 {
        // The first axis is the fastest: places of the elements in the order of rows.
        let mut strides = vec![1; sides.len()];
        (1..sides.len()).for_each(|axis| strides[axis] = strides[axis - 1] * sides[axis - 1]);
        let place = |mut index: usize| {
            let mut at = 0;
            for axis in (0..sides.len()).rev() {
                at += strides[axis] * (index % sides[axis]);
                index /= sides[axis];
            }
            at
        };
        (0..n).map(|index| value(place(index))).collect()
    } else {
        (0..n).map(value).collect()
    };
    Ok(NpyArray { sides, values, top, n_more: data.len() - n * size })
}

/// Returns the bytes of an array of single floats: version 1, its numbers after a multiple of 64 bytes.
pub(super) fn npy_bytes(sides: &[usize], values: &[f32]) -> Vec<u8> {
    let shape: String = sides.iter().map(|side| format!("{side}, ")).collect();
    let mut header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}), }}", shape.trim_end());
    while !(10 + header.len() + 1).is_multiple_of(64) {
        header.push(' ');
    }
    header.push('\n');
    let mut bytes = [MAGIC, &[1, 0], &(header.len() as u16).to_le_bytes(), header.as_bytes()].concat();
    bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    bytes
}

/// Whether an array of these bytes has sides that are wanted and numbers; complex ones are refused when they are read.
pub(super) fn is_array_of(start: &[u8], is_wanted: impl Fn(&[usize]) -> bool) -> bool {
    let has_numbers = |header: &Header| element(&header.kind).is_some() || header.kind.starts_with('c');
    header_of(start).is_ok_and(|header| has_numbers(&header) && is_wanted(&header.sides))
}

/// The bytes of an element, the largest whole number of its type, and how it is read.
type Element = (usize, Option<f64>, fn([u8; 8]) -> f64);

/// Returns the bytes of an element, the largest whole number of its type, and how it is read from little-endian bytes.
fn element(kind: &str) -> Option<Element> {
    fn four(b: [u8; 8]) -> [u8; 4] {
        [b[0], b[1], b[2], b[3]]
    }
    Some(match kind {
        "f2" => (2, None, |b| exr::prelude::f16::from_le_bytes([b[0], b[1]]).to_f64()),
        "f4" => (4, None, |b| f64::from(f32::from_le_bytes(four(b)))),
        "f8" => (8, None, f64::from_le_bytes),
        "b1" => (1, Some(1.0), |b| f64::from(b[0])),
        "u1" => (1, Some(f64::from(u8::MAX)), |b| f64::from(b[0])),
        "i1" => (1, Some(f64::from(i8::MAX)), |b| f64::from(i8::from_le_bytes([b[0]]))),
        "u2" => (2, Some(f64::from(u16::MAX)), |b| f64::from(u16::from_le_bytes([b[0], b[1]]))),
        "i2" => (2, Some(f64::from(i16::MAX)), |b| f64::from(i16::from_le_bytes([b[0], b[1]]))),
        "u4" => (4, Some(f64::from(u32::MAX)), |b| f64::from(u32::from_le_bytes(four(b)))),
        "i4" => (4, Some(f64::from(i32::MAX)), |b| f64::from(i32::from_le_bytes(four(b)))),
        "u8" => (8, Some(u64::MAX as f64), |b| u64::from_le_bytes(b) as f64),
        "i8" => (8, Some(i64::MAX as f64), |b| i64::from_le_bytes(b) as f64),
        _ => return None,
    })
}

/// Returns the keys and values of a header: the text of a Python dictionary of words, truths and tuples.
fn entries_of(header: &str) -> Result<Vec<(String, String)>, String> {
    let text = header.trim().trim_end_matches('\0').trim();
    let inner = text.strip_prefix('{').and_then(|text| text.strip_suffix('}'));
    let mut rest = inner.ok_or("its header is no dictionary")?.trim();
    let mut entries = vec![];
    while !rest.is_empty() {
        let (key, value) = rest.split_once(':').ok_or("its header is no dictionary")?;
        let value = value.trim_start();
        let end = match value.chars().next() {
            Some('(') => value.find(')').map(|end| end + 1),
            Some('[') => value.find(']').map(|end| end + 1),
            _ => value.find(',').or(Some(value.len())),
        };
        let (value, after) = value.split_at(end.ok_or("its header is no dictionary")?);
        entries.push((key.trim().trim_matches(['\'', '"']).to_owned(), value.trim().to_owned()));
        rest = after.trim_start().trim_start_matches(',').trim_start();
    }
    Ok(entries)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Returns the bytes of an array, as `NumPy` writes them.
    pub(crate) fn npy(descr: &str, fortran: bool, shape: &str, data: &[u8]) -> Vec<u8> {
        let order = if fortran { "True" } else { "False" };
        let mut header = format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}");
        while (10 + header.len() + 1) % 64 != 0 {
            header.push(' ');
        }
        header.push('\n');
        let mut bytes = [MAGIC, &[1, 0], &(header.len() as u16).to_le_bytes()].concat();
        bytes.extend(header.bytes());
        bytes.extend(data);
        bytes
    }

    #[test]
    fn arrays_of_every_type_are_read() {
        let check = |descr: &str, data: Vec<u8>, top: Option<f64>| {
            let array = parse(&npy(descr, false, "(2, 3)", &data)).unwrap();
            let values = vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0];
            assert_eq!(array, NpyArray { sides: vec![2, 3], values, top, n_more: 0 }, "{descr}");
        };
        let of = |f: &dyn Fn(u8) -> Vec<u8>| (0..6).flat_map(f).collect::<Vec<u8>>();
        check("<f4", of(&|v| f32::from(v).to_le_bytes().to_vec()), None);
        check(">f4", of(&|v| f32::from(v).to_be_bytes().to_vec()), None);
        check("<f8", of(&|v| f64::from(v).to_le_bytes().to_vec()), None);
        check("<f2", of(&|v| exr::prelude::f16::from_f32(v.into()).to_le_bytes().to_vec()), None);
        check("|u1", of(&|v| vec![v]), Some(255.0));
        check(">u2", of(&|v| u16::from(v).to_be_bytes().to_vec()), Some(65535.0));
        check("<i2", of(&|v| i16::from(v).to_le_bytes().to_vec()), Some(32767.0));
        check("<i8", of(&|v| i64::from(v).to_le_bytes().to_vec()), Some(i64::MAX as f64));
        let fortran = parse(&npy("|u1", true, "(2, 3)", &[0, 1, 2, 3, 4, 5])).unwrap();
        assert_eq!(fortran.values, [0.0, 2.0, 4.0, 1.0, 3.0, 5.0]);
        assert_eq!(parse(&npy("|u1", false, "(3,)", &[1, 2, 3])).unwrap().sides, [3]);
    }

    #[test]
    fn written_arrays_are_read_again() {
        for sides in [vec![], vec![3], vec![2, 3]] {
            let values: Vec<f32> = (0..sides.iter().product()).map(|i| i as f32 + 0.5).collect();
            let array = parse(&npy_bytes(&sides, &values)).unwrap();
            assert_eq!((array.sides, array.values, array.n_more), (sides, values, 0));
        }
    }

    #[test]
    fn complex_numbers_are_two_on_the_last_axis() {
        let data: Vec<u8> = [1.0_f32, 2.0, 3.0, 4.0].into_iter().flat_map(f32::to_le_bytes).collect();
        let (array, is_complex) = parse_complex(&npy("<c8", false, "(2,)", &data)).unwrap();
        assert_eq!((array.sides, array.values, is_complex), (vec![2, 2], vec![1.0, 2.0, 3.0, 4.0], true));
        assert!(!parse_complex(&npy("<f4", false, "(4,)", &data)).unwrap().1);
        assert!(parse_complex(&npy("<c8", true, "(1, 2)", &data)).unwrap_err().contains("Fortran"));
    }

    #[test]
    fn what_is_no_array_is_refused() {
        for (bytes, word) in [
            (vec![], "no array"),
            (b"\x93NUMPY\x01\x00".to_vec(), "truncated"),
            (b"\x93NUMPY\x09\x00\x00\x00\x00\x00".to_vec(), "version 9"),
            (npy("<f4", false, "(2, 3)", &[0; 23]), "truncated"),
            (npy("<c8", false, "(1,)", &[0; 8]), "complex numbers, expected real"),
            (npy("<M8", false, "(1,)", &[0; 8]), "'M8'"),
            (npy("<f4", false, "(99999999999, 99999999999, 9999)", &[0; 8]), "truncated"),
            (npy("<f4", false, "(a,)", &[0; 8]), "'a'"),
        ] {
            let message = parse(&bytes).unwrap_err();
            assert!(message.contains(word), "{message}");
        }
    }
}
