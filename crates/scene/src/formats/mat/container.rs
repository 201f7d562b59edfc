//! The arrays of a MATLAB file of version 5 to 7: "MAT-File Format", The `MathWorks`, chapter 1; and those of HDF5.
//!
//! Little- and big-endian, compressed or not. Memory: the file, what its wanted variables are inflated to, which deflate bounds
//! by 1032 times their part of the file, and at most a million arrays of structures.

use std::{fs::File, io::Read, path::Path};

use flate2::read::ZlibDecoder;

use super::{
    super::unusable::{TRUNCATED, check_memory, unreadable},
    elements::{self, LIMIT_ARRAYS, LIMIT_DEPTH, Listed},
    hdf5::{Entry, Hdf5},
    packing::Attribute,
};
use crate::SceneError;

/// Deflate cannot shrink more than 1032 times; a header that says otherwise lies.
const LIMIT_RATIO: u64 = 1040;
/// What is inflated of a variable to learn its name.
const PEEK_BYTES: usize = 512;

/// Types of stored elements.
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;

/// Stands for the file in place of a variable.
pub(super) const WHOLE: &str = "/";

/// The variables of a file that were wanted, inflated.
#[derive(Debug)]
pub(super) struct MatFile {
    is_big_endian: bool,
    /// Whether the last index of its arrays is the fastest: those of HDF5 that MATLAB did not write.
    pub(super) is_row_major: bool,
    /// Each variable with the content of its element.
    variables: Vec<(String, Vec<u8>)>,
    /// All variables of the file.
    pub(super) listed: Vec<Listed>,
    /// What is stated of those of HDF5 besides their numbers.
    attributes: Vec<(String, Vec<Attribute>)>,
    /// What is said of those of HDF5.
    said: Vec<Said>,
}

/// What is said of a variable besides its numbers and attributes.
#[derive(Debug)]
struct Said {
    name: String,
    /// What it is in words.
    words: String,
    /// The names of its axes.
    axes: Vec<String>,
    /// The paths of the scales of each.
    scales: Vec<Vec<String>>,
}

/// An array: its sides, and what it holds.
#[derive(Clone, Debug)]
pub(super) struct MatArray<'a> {
    pub(super) sides: Vec<usize>,
    pub(super) content: Content<'a>,
}

/// What an array holds.
#[derive(Clone, Debug)]
pub(super) enum Content<'a> {
    /// Real numbers, the first index fastest.
    Numbers(Numbers<'a>),
    /// The fields of a structure, of its first element where there are more.
    Fields(Vec<(String, MatArray<'a>)>),
    /// Text, cells, sparse and complex arrays, objects and functions.
    Other(&'static str),
}

/// Numbers as they are stored.
#[derive(Clone, Copy, Debug)]
pub(super) struct Numbers<'a> {
    bytes: &'a [u8],
    kind: u32,
    is_big_endian: bool,
    /// Whether the array is one of whole numbers, whatever they are stored as.
    pub(super) is_integer: bool,
    /// The largest number that an array of this class holds.
    top: f64,
}

impl MatFile {
    /// Reads those variables of a file that are wanted.
    pub(super) fn read(path: &Path, wanted: &dyn Fn(&Listed) -> bool) -> Result<Self, SceneError> {
        let mut file = File::open(path).map_err(|error| unreadable(path, error))?;
        let length = file.metadata().map_err(|error| unreadable(path, error))?.len();
        check_memory(path, length, length)?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(|error| unreadable(path, error))?;
        if bytes.starts_with(b"CDF") {
            return Err(unreadable(path, "it is a classic NetCDF file, expected one of NetCDF-4 (nccopy -k nc4)"));
        }
        if is_hdf5(&bytes) {
            return Self::of_hdf5(path, bytes, wanted);
        }
        // A broken file is named by what reads it. Single floats are made of the inflated numbers while those are there.
        let inflated = wanted_bytes(&bytes, wanted).unwrap_or(0);
        check_memory(path, length.saturating_add(inflated.saturating_mul(2)), length)?;
        Self::parse(&bytes, wanted).map_err(|reason| unreadable(path, reason))
    }

    fn of_hdf5(path: &Path, bytes: Vec<u8>, wanted: &dyn Fn(&Listed) -> bool) -> Result<Self, SceneError> {
        let wrong = |reason: String| unreadable(path, reason);
        let length = bytes.len() as u64;
        let file = Hdf5::open(bytes).map_err(wrong)?;
        let entries = file.entries().map_err(wrong)?;
        let chosen: Vec<_> = entries.iter().filter(|entry| wanted(&entry.listed)).collect();
        // Numbers as they are read, and as bytes.
        let n_bytes = chosen.iter().map(|entry| entry.n_bytes).fold(0, u64::saturating_add);
        check_memory(path, length.saturating_add(n_bytes.saturating_mul(2)), length)?;
        let mut variables = vec![];
        for entry in chosen {
            variables.push((entry.listed.name.clone(), file.element(entry).map_err(wrong)?));
        }
        let own = entries.iter().map(|entry| (entry.listed.name.clone(), entry.attributes.clone()));
        let attributes = std::iter::once((WHOLE.to_owned(), file.attributes())).chain(own).collect();
        let said = |own: &Entry| Said {
            name: own.listed.name.clone(),
            words: own.words.clone(),
            axes: own.axes.clone(),
            scales: own.scales.clone(),
        };
        let said = entries.iter().map(said).collect();
        let listed = entries.into_iter().map(|entry| entry.listed).collect();
        Ok(Self { is_big_endian: false, is_row_major: !file.is_matlab, variables, listed, attributes, said })
    }

    fn parse(bytes: &[u8], wanted: &dyn Fn(&Listed) -> bool) -> Result<Self, String> {
        let is_big_endian = match bytes.get(126..128) {
            Some(b"IM") => false,
            Some(b"MI") => true,
            _ => {
                return Err("it is neither HDF5 nor a MATLAB file of version 5 to 7.3: expected one of them".to_owned());
            }
        };
        let mut rest = Elements { bytes: &bytes[128..], is_big_endian };
        let (mut variables, mut listed): (Vec<(String, Vec<u8>)>, _) = (Vec::new(), Vec::new());
        while let Some((kind, content)) = rest.next()? {
            let variable = match kind {
                MATRIX => {
                    let own = header_of(content, is_big_endian)?.listed();
                    let content = wanted(&own).then(|| content.to_vec());
                    Some((own, content))
                }
                COMPRESSED => inflate(content, is_big_endian, wanted)?,
                _ => None,
            };
            let Some((own, content)) = variable.filter(|(own, _)| !own.name.is_empty()) else { continue };
            variables.extend(content.map(|content| (own.name.clone(), content)));
            listed.push(own);
        }
        Ok(Self { is_big_endian, is_row_major: false, variables, listed, attributes: vec![], said: vec![] })
    }

    /// What is stated of a variable besides its numbers.
    pub(super) fn attributes_of(&self, name: &str) -> &[Attribute] {
        self.attributes.iter().find(|(own, _)| own == name).map_or(&[], |(_, attributes)| attributes)
    }

    /// Returns what a variable is called in words, and the names of its axes; both empty where nothing is stated.
    pub(super) fn words_of(&self, name: &str) -> (&str, &[String]) {
        self.said.iter().find(|own| own.name == name).map_or(("", &[]), |own| (&own.words, &own.axes))
    }

    /// Returns the paths of the scales of each axis of a variable; several where nothing says which is its own.
    pub(super) fn scales_of(&self, name: &str) -> &[Vec<String>] {
        self.said.iter().find(|own| own.name == name).map_or(&[], |own| &own.scales)
    }

    /// Returns a variable, or a field of a structure as `data.cube`; `None` where the file has none of this name.
    pub(super) fn array(&self, name: &str) -> Result<Option<MatArray<'_>>, String> {
        let Some((_, content)) = self.variables.iter().find(|(own, _)| own == name) else {
            let Some((outer, field)) = name.rsplit_once('.') else { return Ok(None) };
            return Ok(self.array(outer)?.and_then(|array| array.into_field(field)));
        };
        let mut n_left = LIMIT_ARRAYS;
        array_of(content, self.is_big_endian, LIMIT_DEPTH, &mut n_left).map(Some)
    }
}

impl<'a> MatArray<'a> {
    fn into_field(self, name: &str) -> Option<Self> {
        let Content::Fields(fields) = self.content else { return None };
        fields.into_iter().find(|(own, _)| own == name).map(|(_, array)| array)
    }

    /// Returns the names of the arrays of numbers in it, as `data.cube`, and the lengths of their sides.
    pub(super) fn numeric_fields(&self, name: &str) -> Vec<(String, Vec<usize>)> {
        match &self.content {
            Content::Numbers(_) => vec![(name.to_owned(), self.sides.clone())],
            Content::Fields(fields) => {
                fields.iter().flat_map(|(own, array)| array.numeric_fields(&format!("{name}.{own}"))).collect()
            }
            Content::Other(_) => vec![],
        }
    }

    /// Returns the names of what it holds, that of an array itself, and of what is in structures as `outer.inner`.
    pub(super) fn leaves(&self, name: &str) -> Vec<String> {
        match &self.content {
            Content::Fields(fields) => {
                fields.iter().flat_map(|(own, array)| array.leaves(&format!("{name}.{own}"))).collect()
            }
            _ if self.len() > 0 => vec![name.to_owned()],
            _ => vec![],
        }
    }

    /// Returns a field of a structure that is there and not empty.
    pub(super) fn field(&self, name: &str) -> Option<&Self> {
        match &self.content {
            Content::Fields(fields) => fields.iter().find(|(own, _)| own == name).map(|(_, array)| array),
            _ => None,
        }
        .filter(|array| array.len() > 0)
    }

    /// The number of elements.
    pub(super) fn len(&self) -> usize {
        // Sides were checked to have a product.
        self.sides.iter().product()
    }

    /// Returns the numbers, or what the array holds in their place.
    pub(super) fn numbers(&self) -> Result<Numbers<'a>, &'static str> {
        match &self.content {
            Content::Numbers(numbers) => Ok(*numbers),
            Content::Fields(_) => Err("a structure"),
            Content::Other(what) => Err(what),
        }
    }

    /// Returns the one number of an array of one.
    pub(super) fn number(&self) -> Option<f64> {
        (self.len() == 1).then(|| self.numbers().ok().map(|numbers| numbers.at(0))).flatten()
    }

    /// Returns all numbers of a list.
    pub(super) fn list(&self) -> Option<Vec<f64>> {
        let numbers = self.numbers().ok()?;
        Some((0..self.len()).map(|index| numbers.at(index)).collect())
    }
}

impl Numbers<'_> {
    /// Returns the largest whole number that the array's class holds; 0 for other numbers.
    pub(super) fn top(&self) -> f64 {
        self.top
    }

    /// Returns a number by its index; there is one for each element of the array.
    pub(super) fn at(&self, index: usize) -> f64 {
        let size = width_of(self.kind).expect("the kind was checked");
        let mut little = [0; 8];
        little[..size].copy_from_slice(&self.bytes[index * size..(index + 1) * size]);
        if self.is_big_endian {
            little[..size].reverse();
        }
        let [a, b, c, d, ..] = little;
        match self.kind {
            1 => f64::from(i8::from_le_bytes([a])),
            2 => f64::from(a),
            3 => f64::from(i16::from_le_bytes([a, b])),
            4 => f64::from(u16::from_le_bytes([a, b])),
            5 => f64::from(i32::from_le_bytes([a, b, c, d])),
            6 => f64::from(u32::from_le_bytes([a, b, c, d])),
            7 => f64::from(f32::from_le_bytes([a, b, c, d])),
            9 => f64::from_le_bytes(little),
            12 => i64::from_le_bytes(little) as f64,
            _ => u64::from_le_bytes(little) as f64,
        }
    }
}

/// Whether a file is HDF5, which a MATLAB file of version 7.3 is behind its first 512 bytes.
fn is_hdf5(bytes: &[u8]) -> bool {
    // What a program puts before an HDF5 file is of 512 bytes, or a power of two times as many.
    let mut starts = std::iter::once(0).chain((9..usize::BITS).map(|power| 1_usize << power));
    bytes.starts_with(b"MATLAB 7.3")
        || starts.any(|at| bytes.get(at..).is_some_and(|rest| rest.starts_with(b"\x89HDF\r\n\x1a\n")))
}

/// Returns what the variables of a file whose names are wanted are inflated to, bytes.
fn wanted_bytes(bytes: &[u8], wanted: &dyn Fn(&Listed) -> bool) -> Result<u64, String> {
    let is_big_endian = bytes.get(126..128) == Some(b"MI");
    let mut rest = Elements { bytes: bytes.get(128..).unwrap_or_default(), is_big_endian };
    let mut sum = 0_u64;
    while let Some((kind, content)) = rest.next()? {
        if kind == COMPRESSED {
            let limit = (content.len() as u64).saturating_mul(LIMIT_RATIO);
            let peeked = peek(content, is_big_endian)?.filter(|peeked| wanted(&peeked.own) && peeked.n_bytes <= limit);
            sum = sum.saturating_add(peeked.map_or(0, |peeked| peeked.n_bytes));
        }
    }
    Ok(sum)
}

/// Returns the bytes of a stored number of a type, or `None` for types that are none.
fn width_of(kind: u32) -> Option<usize> {
    Some(match kind {
        1 | 2 => 1,
        3 | 4 => 2,
        5..=7 => 4,
        9 | 12 | 13 => 8,
        _ => return None,
    })
}

/// Elements one after the other.
struct Elements<'a> {
    bytes: &'a [u8],
    is_big_endian: bool,
}

impl<'a> Elements<'a> {
    fn word(&self, at: usize) -> Option<u32> {
        let bytes: [u8; 4] = self.bytes.get(at..at + 4)?.try_into().ok()?;
        Some(if self.is_big_endian { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
    }

    /// Returns the type and the content of the next element; `None` at the end.
    fn next(&mut self) -> Result<Option<(u32, &'a [u8])>, String> {
        if self.bytes.is_empty() {
            return Ok(None);
        }
        let first = self.word(0).ok_or(TRUNCATED)?;
        // Up to four bytes stand in the tag itself, their number in its upper half.
        let (kind, from, n_bytes, padded) = if first >> 16 != 0 {
            (first & 0xffff, 4, (first >> 16) as usize, 8)
        } else {
            let n_bytes = self.word(4).ok_or(TRUNCATED)? as usize;
            // Compressed elements follow each other without a gap.
            let padded = if first == COMPRESSED { n_bytes } else { n_bytes.next_multiple_of(8) };
            (first, 8, n_bytes, 8 + padded)
        };
        if from == 4 && n_bytes > 4 {
            return Err("an element of more than four bytes stands in its own tag".to_owned());
        }
        let content = self.bytes.get(from..from + n_bytes).ok_or(TRUNCATED)?;
        self.bytes = self.bytes.get(padded..).unwrap_or_default();
        Ok(Some((kind, content)))
    }

    fn required(&mut self) -> Result<(u32, &'a [u8]), String> {
        self.next()?.ok_or_else(|| TRUNCATED.to_owned())
    }
}

/// The beginning of a compressed variable.
struct Peeked<'a> {
    own: Listed,
    /// The bytes that it says it is inflated to.
    n_bytes: u64,
    /// Its first bytes, those of its tag before them.
    start: Vec<u8>,
    /// What follows them.
    stream: ZlibDecoder<&'a [u8]>,
}

const BROKEN: &str = "a compressed variable is broken";

/// Inflates the beginning of an element if it is a variable.
fn peek(bytes: &[u8], is_big_endian: bool) -> Result<Option<Peeked<'_>>, String> {
    let mut stream = ZlibDecoder::new(bytes);
    let mut start = Vec::with_capacity(PEEK_BYTES);
    stream.by_ref().take(PEEK_BYTES as u64).read_to_end(&mut start).map_err(|_| BROKEN.to_owned())?;
    let tag = Elements { bytes: &start, is_big_endian };
    let (Some(kind), Some(n_bytes)) = (tag.word(0), tag.word(4)) else { return Err(TRUNCATED.to_owned()) };
    if kind != MATRIX {
        return Ok(None);
    }
    let own = header_of(&start[8..], is_big_endian)?.listed();
    Ok(Some(Peeked { own, n_bytes: n_bytes.into(), start, stream }))
}

/// What a compressed variable is, and its bytes where they were wanted.
type Inflated = (Listed, Option<Vec<u8>>);

/// Looks into a compressed element; if it is a variable that is wanted it is inflated.
fn inflate(bytes: &[u8], is_big_endian: bool, wanted: &dyn Fn(&Listed) -> bool) -> Result<Option<Inflated>, String> {
    let Some(Peeked { own, n_bytes, mut start, stream }) = peek(bytes, is_big_endian)? else { return Ok(None) };
    if !wanted(&own) {
        return Ok(Some((own, None)));
    }
    if n_bytes > (bytes.len() as u64).saturating_mul(LIMIT_RATIO) {
        let name = &own.name;
        return Err(format!("its variable '{name}' claims {n_bytes} bytes in {} compressed ones", bytes.len()));
    }
    let mut content = start.split_off(8);
    content.truncate(n_bytes as usize);
    let missing = n_bytes - content.len() as u64;
    stream.take(missing).read_to_end(&mut content).map_err(|_| BROKEN.to_owned())?;
    if (content.len() as u64) < n_bytes {
        return Err(TRUNCATED.to_owned());
    }
    Ok(Some((own, Some(content))))
}

/// The head of an array.
struct Header<'a> {
    class: u32,
    is_complex: bool,
    is_logical: bool,
    sides: Vec<usize>,
    name: String,
    /// What follows.
    rest: Elements<'a>,
}

impl Header<'_> {
    fn listed(self) -> Listed {
        let has_numbers = (6..=15).contains(&self.class);
        let [is_numeric, is_complex] = [false, true].map(|is_complex| has_numbers && self.is_complex == is_complex);
        Listed { name: self.name, sides: self.sides, is_numeric, is_complex, is_list: false }
    }
}

/// Reads the head of an array; of opaque ones, which have no sides, class and name alone.
fn header_of(bytes: &[u8], is_big_endian: bool) -> Result<Header<'_>, String> {
    let mut rest = Elements { bytes, is_big_endian };
    let (_, flags) = rest.required()?;
    let flags = Elements { bytes: flags, is_big_endian }.word(0).ok_or(TRUNCATED)?;
    let (class, is_complex, is_logical) = (flags & 0xff, flags & 0x0800 != 0, flags & elements::LOGICAL != 0);
    let sides = if class == 17 { vec![] } else { sides_of(rest.required()?.1, is_big_endian)? };
    let name = String::from_utf8_lossy(rest.required()?.1).into_owned();
    Ok(Header { class, is_complex, is_logical, sides, name, rest })
}

fn sides_of(bytes: &[u8], is_big_endian: bool) -> Result<Vec<usize>, String> {
    let words = Elements { bytes, is_big_endian };
    let sides: Vec<usize> = (0..bytes.len() / 4).filter_map(|i| words.word(4 * i)).map(|side| side as usize).collect();
    let product = sides.iter().try_fold(1_usize, |product, &side| product.checked_mul(side));
    match product {
        Some(_) if !sides.is_empty() && sides.len() <= LIMIT_DEPTH => Ok(sides),
        _ => Err(format!("an array has the sides {:?}", &sides[..sides.len().min(4)])),
    }
}

fn array_of<'a>(
    bytes: &'a [u8],
    is_big_endian: bool,
    depth: usize,
    n_left: &mut usize,
) -> Result<MatArray<'a>, String> {
    if bytes.is_empty() {
        return Ok(MatArray { sides: vec![0], content: Content::Other("nothing") });
    }
    if depth == 0 || *n_left == 0 {
        return Err(format!("its structures hold more than {LIMIT_ARRAYS} arrays or {LIMIT_DEPTH} levels"));
    }
    *n_left -= 1;
    let Header { class, is_complex, is_logical, sides, rest, .. } = header_of(bytes, is_big_endian)?;
    let content = match class {
        2 => fields_of(&sides, rest, depth, n_left)?,
        4 => Content::Other("text"),
        6..=15 if is_complex => Content::Other("complex numbers"),
        6..=15 => {
            let numbers = numbers_of(&sides, rest, class)?;
            // Of true and false, which are stored as 1 and 0.
            let top = if is_logical { 1.0 } else { numbers.top };
            Content::Numbers(Numbers { top, ..numbers })
        }
        1 => Content::Other("cells"),
        5 => Content::Other("a sparse array"),
        _ => Content::Other("an object"),
    };
    Ok(MatArray { sides, content })
}

fn numbers_of<'a>(sides: &[usize], mut rest: Elements<'a>, class: u32) -> Result<Numbers<'a>, String> {
    let (kind, bytes) = rest.required()?;
    let width = width_of(kind).ok_or_else(|| format!("numbers are stored as type {kind}, which is none"))?;
    let n_numbers: usize = sides.iter().product();
    if bytes.len() / width < n_numbers {
        return Err(format!("an array of {n_numbers} numbers has {} bytes", bytes.len()));
    }
    // Classes 8 to 15 are signed and unsigned whole numbers of 8, 16, 32 and 64 bits, in turn.
    let is_integer = class > 7;
    let top = match class {
        8..=15 => {
            let bits = 8 << ((class - 8) / 2);
            let positive = if class.is_multiple_of(2) { bits - 1 } else { bits };
            2.0_f64.powi(positive) - 1.0
        }
        _ => 0.0,
    };
    Ok(Numbers { bytes, kind, is_big_endian: rest.is_big_endian, is_integer, top })
}

fn fields_of<'a>(
    sides: &[usize],
    mut rest: Elements<'a>,
    depth: usize,
    n_left: &mut usize,
) -> Result<Content<'a>, String> {
    let is_big_endian = rest.is_big_endian;
    let (_, width) = rest.required()?;
    let width = Elements { bytes: width, is_big_endian }.word(0).ok_or(TRUNCATED)? as usize;
    let (_, names) = rest.required()?;
    if width == 0 {
        return Err("the names of a structure's fields are of no length".to_owned());
    }
    let name_of = |name: &[u8]| {
        let end = name.iter().position(|&byte| byte == 0).unwrap_or(name.len());
        String::from_utf8_lossy(&name[..end]).into_owned()
    };
    let mut fields = Vec::new();
    if sides.iter().product::<usize>() > 0 {
        for name in names.chunks_exact(width) {
            let (kind, content) = rest.required()?;
            if kind != MATRIX {
                return Err(format!("the field '{}' is of type {kind}, expected an array", name_of(name)));
            }
            fields.push((name_of(name), array_of(content, is_big_endian, depth - 1, n_left)?));
        }
    }
    Ok(Content::Fields(fields))
}
