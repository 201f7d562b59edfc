//! What arrays of MATLAB files are, and elements of version 5, written: "MAT-File Format", The `MathWorks`, chapter 1. All are little-endian.

/// Structures within each other.
pub(super) const LIMIT_DEPTH: usize = 32;
/// Arrays of all structures of a variable.
pub(super) const LIMIT_ARRAYS: usize = 1_000_000;

/// What is known of a variable without its content.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Listed {
    pub(super) name: String,
    pub(super) sides: Vec<usize>,
    /// Whether it is an array of real numbers.
    pub(super) is_numeric: bool,
    /// Whether it is one of complex numbers.
    pub(super) is_complex: bool,
    /// Whether it may be a list of wavelengths whatever its name: the scale of an axis of another, or one that is called so in words.
    pub(super) is_list: bool,
}

/// Classes of arrays.
pub(super) const CELLS: u32 = 1;
pub(super) const DOUBLES: u32 = 6;
pub(super) const SINGLES: u32 = 7;
/// The flag of an array of true and false, beside its class.
pub(super) const LOGICAL: u32 = 0x0200;
/// Types of stored elements.
const INT8: u32 = 1;
const UINT16: u32 = 4;
const INT32: u32 = 5;
const UINT32: u32 = 6;
const SINGLE: u32 = 7;
const DOUBLE: u32 = 9;
const MATRIX: u32 = 14;
/// Bytes of a field's name, of which the last is 0.
const FIELD_NAME_BYTES: usize = 32;

/// The first 128 bytes of a file.
pub(super) fn file_head() -> Vec<u8> {
    let mut head = b"MATLAB 5.0 MAT-file, written by dioptric".to_vec();
    head.resize(124, b' ');
    head.extend([0, 1, b'I', b'M']);
    head
}

/// Returns an element with its tag, filled up to a multiple of 8 bytes; `None` from 4 GiB on, which no tag holds.
fn element(kind: u32, content: &[u8]) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(content.len() + 16);
    bytes.extend(kind.to_le_bytes());
    bytes.extend(u32::try_from(content.len()).ok()?.to_le_bytes());
    bytes.extend(content);
    bytes.resize(bytes.len().next_multiple_of(8), 0);
    Some(bytes)
}

/// Returns the head of an array: its class, its sides and its name.
fn head(class: u32, sides: &[usize], name: &str) -> Option<Vec<u8>> {
    let flags: Vec<u8> = [class, 0].iter().flat_map(|word| word.to_le_bytes()).collect();
    let mut words = Vec::with_capacity(4 * sides.len());
    for side in sides {
        words.extend(i32::try_from(*side).ok()?.to_le_bytes());
    }
    Some([element(UINT32, &flags)?, element(INT32, &words)?, element(INT8, name.as_bytes())?].concat())
}

/// Returns an array of numbers of a class, stored as this type, the first index fastest: the content of its element.
pub(super) fn stored(name: &str, sides: &[usize], (class, kind): (u32, u32), numbers: &[u8]) -> Option<Vec<u8>> {
    let mut bytes = head(class, sides, name)?;
    bytes.reserve(numbers.len() + 16);
    bytes.extend(kind.to_le_bytes());
    bytes.extend(u32::try_from(numbers.len()).ok()?.to_le_bytes());
    bytes.extend(numbers);
    bytes.resize(bytes.len().next_multiple_of(8), 0);
    Some(bytes)
}

/// Returns an array of doubles, the first index fastest.
pub(super) fn doubles(name: &str, sides: &[usize], values: &[f64]) -> Option<Vec<u8>> {
    let numbers: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    stored(name, sides, (DOUBLES, DOUBLE), &numbers)
}

/// Returns an array of singles, the first index fastest.
pub(super) fn singles(name: &str, sides: &[usize], values: impl Iterator<Item = f32>) -> Option<Vec<u8>> {
    let numbers: Vec<u8> = values.flat_map(f32::to_le_bytes).collect();
    stored(name, sides, (SINGLES, SINGLE), &numbers)
}

/// Returns a line of text.
pub(super) fn text(name: &str, text: &str) -> Option<Vec<u8>> {
    let codes: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    stored(name, &[usize::from(!text.is_empty()), codes.len() / 2], (4, UINT16), &codes)
}

/// Returns an array that holds nothing that could be read.
pub(super) fn other(name: &str, class: u32, sides: &[usize]) -> Option<Vec<u8>> {
    head(class, sides, name)
}

/// Returns a structure of one element; its fields are contents of arrays without names.
pub(super) fn structure(name: &str, fields: &[(String, Vec<u8>)]) -> Option<Vec<u8>> {
    let width = fields.iter().map(|(own, _)| own.len() + 1).fold(FIELD_NAME_BYTES, usize::max);
    let mut bytes = head(2, &[1, 1], name)?;
    bytes.extend(element(INT32, &i32::try_from(width).ok()?.to_le_bytes())?);
    let names = fields.iter().flat_map(|(own, _)| {
        let mut padded = own.clone().into_bytes();
        padded.resize(width, 0);
        padded
    });
    bytes.extend(element(INT8, &names.collect::<Vec<u8>>())?);
    for (_, content) in fields {
        bytes.extend(variable(content)?);
    }
    Some(bytes)
}

/// Returns an array as a variable of a file, or a field of a structure.
pub(super) fn variable(content: &[u8]) -> Option<Vec<u8>> {
    element(MATRIX, content)
}
