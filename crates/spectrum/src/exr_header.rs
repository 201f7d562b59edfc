//! The same bytes for the same picture: the attributes of an `OpenEXR` header in a fixed order.
//!
//! The format leaves their order open, and the library that writes them keeps its own in a table without one.

use std::{
    fs::File,
    io::{self, Read, Seek, SeekFrom, Write},
};

/// Bytes before the first header: a magic number, then the version and its flags.
const PREAMBLE: usize = 8;
/// The flag of a file with several headers, which a byte of zero ends.
const MULTIPART: u8 = 0x10;
/// Headers longer than this are left as they are.
const LONGEST: u64 = 1 << 22;

/// Sorts the attributes of each header of an `OpenEXR` file that has been written, so that equal pictures are equal files.
///
/// The file must be open for reading and writing. Headers that are not whole, or longer than 4 MiB, are left as they are.
///
/// # Errors
/// When the file cannot be read or written.
pub fn sort_exr_attributes(file: &mut File) -> io::Result<()> {
    file.seek(SeekFrom::Start(0))?;
    let mut start = Vec::new();
    Read::by_ref(file).take(LONGEST).read_to_end(&mut start)?;
    let Some(sorted) = sorted_headers(&start) else { return Ok(()) };
    file.seek(SeekFrom::Start(PREAMBLE as u64))?;
    file.write_all(&sorted)
}

/// Returns the headers at the start of these bytes with their attributes in the order of their names, as long as
/// they were; `None` if they are not whole.
fn sorted_headers(start: &[u8]) -> Option<Vec<u8>> {
    let is_multipart = start.get(5)? & MULTIPART != 0;
    let mut rest = start.get(PREAMBLE..)?;
    let mut sorted = Vec::new();
    loop {
        let mut attributes = Vec::new();
        while *rest.first()? != 0 {
            let length = attribute_length(rest)?;
            attributes.push(rest.get(..length)?);
            rest = rest.get(length..)?;
        }
        rest = &rest[1..];
        let is_end = attributes.is_empty();
        attributes.sort_by_key(|attribute| attribute.split(|byte| *byte == 0).next());
        sorted.extend(attributes.concat());
        sorted.push(0);
        if is_end || !is_multipart {
            return Some(sorted);
        }
    }
}

/// Returns the length of an attribute: name, zero, type, zero, length of its value, value.
fn attribute_length(bytes: &[u8]) -> Option<usize> {
    let name = bytes.iter().position(|byte| *byte == 0)? + 1;
    let kind = bytes.get(name..)?.iter().position(|byte| *byte == 0)? + 1;
    let size = bytes.get(name + kind..name + kind + 4)?;
    Some(name + kind + 4 + u32::from_le_bytes(size.try_into().ok()?) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attribute(name: &str, value: &[u8]) -> Vec<u8> {
        let mut bytes = format!("{name}\0string\0").into_bytes();
        bytes.extend((value.len() as u32).to_le_bytes());
        bytes.extend(value);
        bytes
    }

    fn file(flags: u8, headers: &[&[Vec<u8>]], end: &[u8]) -> Vec<u8> {
        let mut bytes = vec![0x76, 0x2f, 0x31, 0x01, 2, flags, 0, 0];
        for header in headers {
            bytes.extend(header.concat());
            bytes.push(0);
        }
        bytes.extend(end);
        bytes
    }

    #[test]
    fn attributes_come_in_the_order_of_their_names() {
        let (a, ab, b) = (attribute("a", b"\0z"), attribute("ab", b""), attribute("b", b"value"));
        let one = file(0, &[&[b.clone(), ab.clone(), a.clone()]], b"samples");
        let expected = [a.clone(), ab.clone(), b.clone(), vec![0]].concat();
        assert_eq!(sorted_headers(&one).unwrap(), expected);
        let two = file(MULTIPART, &[&[b.clone(), a.clone()], &[b.clone(), ab.clone()]], b"\0samples");
        let expected = [a, b.clone(), vec![0], ab, b, vec![0], vec![0]].concat();
        assert_eq!(sorted_headers(&two).unwrap(), expected);
    }

    #[test]
    fn headers_that_end_early_are_left() {
        let whole = file(0, &[&[attribute("b", b"value"), attribute("a", b"value")]], b"");
        for length in 0..whole.len() {
            assert_eq!(sorted_headers(&whole[..length]), None, "{length} bytes");
        }
    }
}
