//! Buffers packed by meshoptimizer: the extensions `EXT_meshopt_compression` and `KHR_meshopt_compression`.

use serde_json::Value;

use super::json::index;

/// Vertices of a block that are packed together, and bytes of one.
const GROUP: usize = 16;
const MOST_OF_BLOCK: usize = 256;
const BYTES_OF_BLOCK: usize = 8192;
/// What the packed bytes may become at most, a byte.
const MOST_EXPANSION: usize = 32;

/// Returns the bytes of a packed buffer view, and the stride of its rows.
pub(super) fn unpacked(view: &Value, buffers: &[Vec<u8>]) -> Result<(Vec<u8>, Option<usize>), String> {
    let word = |name: &str| index(view, name).ok_or_else(|| format!("has no {name}"));
    let text = |name: &str| view.get(name).and_then(Value::as_str);
    let (first, length) = (index(view, "byteOffset").unwrap_or(0), word("byteLength")?);
    let bytes = buffers.get(word("buffer")?).and_then(|bytes| bytes.get(first..first.checked_add(length)?));
    let bytes = bytes.ok_or("reaches beyond its buffer")?;
    let (count, stride) = (word("count")?, word("byteStride")?);
    if count.checked_mul(stride).is_none_or(|n| n > MOST_EXPANSION * bytes.len()) {
        return Err(format!("has {count} rows in {length} bytes"));
    }
    let filter = text("filter").unwrap_or("NONE");
    let mode = text("mode").unwrap_or("");
    let broken = || format!("of mode {mode} is broken");
    let of_indices = |indices: Vec<u32>| {
        let bytes = indices.iter().flat_map(|index| index.to_le_bytes().into_iter().take(stride)).collect();
        (bytes, None)
    };
    if mode == "ATTRIBUTES" && stride % 4 == 0 && (4..=MOST_OF_BLOCK).contains(&stride) {
        let mut rows = vertices(bytes, count, stride).ok_or_else(broken)?;
        filtered(&mut rows, stride, filter)?;
        return Ok((rows, Some(stride)));
    }
    match (mode, stride) {
        ("TRIANGLES", 2 | 4) if count % 3 == 0 => Ok(of_indices(triangles(bytes, count).ok_or_else(broken)?)),
        ("INDICES", 2 | 4) => Ok(of_indices(indices(bytes, count).ok_or_else(broken)?)),
        _ => Err(format!("of mode {mode} has rows of {stride} bytes")),
    }
}

/// Takes bytes one after the other.
struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn take(&mut self, n: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(n)?;
        self.0 = rest;
        Some(taken)
    }

    fn next(&mut self) -> Option<u8> {
        Some(self.take(1)?[0])
    }

    /// Seven bits a byte, the lowest first.
    fn number(&mut self) -> Option<u32> {
        let mut number = 0;
        for shift in [0, 7, 14, 21, 28] {
            let byte = self.next()?;
            number |= u32::from(byte & 127).wrapping_shl(shift);
            if byte < 128 {
                return Some(number);
            }
        }
        Some(number)
    }

    fn difference(&mut self) -> Option<u32> {
        self.number().map(signed)
    }
}

/// Returns what a number of alternating sign stands for: 0, −1, 1, −2 …
fn signed(number: u32) -> u32 {
    (number >> 1) ^ (number & 1).wrapping_neg()
}

/// How a byte of all rows of a block is packed.
#[derive(Clone, Copy)]
enum Packing {
    /// In differences of so many bits, by the two bits that each group has of its own.
    Of([usize; 4]),
    /// All alike.
    Zeros,
    /// In full.
    Full,
}

/// What the differences of four bytes of rows are.
#[derive(Clone, Copy, PartialEq)]
enum Differences {
    /// Of numbers of so many bytes, of alternating sign.
    Bytes(usize),
    /// The bits that change in all four, turned left by so many.
    Bits(u32),
}

impl Differences {
    fn of(code: u8) -> Option<Self> {
        match (code & 15, code >> 4) {
            (0, 0) => Some(Self::Bytes(1)),
            (1, 0) => Some(Self::Bytes(2)),
            (2, turn) => Some(Self::Bits(turn.into())),
            _ => None,
        }
    }

    fn add_to(self, last: &mut [u8], differences: [u8; 4]) {
        let four = |bytes: &[u8]| bytes.iter().rev().fold(0_u32, |four, byte| four << 8 | u32::from(*byte));
        match self {
            Self::Bytes(1) => {
                for (last, difference) in last.iter_mut().zip(differences) {
                    *last = last.wrapping_add(signed(difference.into()) as u8);
                }
            }
            Self::Bytes(n) => {
                for (last, difference) in last.chunks_exact_mut(n).zip(differences.chunks_exact(n)) {
                    let next = four(last).wrapping_add(signed(four(difference)));
                    last.copy_from_slice(&next.to_le_bytes()[..n]);
                }
            }
            Self::Bits(turn) => {
                last.copy_from_slice(&(four(last) ^ four(&differences).rotate_right(turn)).to_le_bytes());
            }
        }
    }
}

fn vertices(bytes: &[u8], count: usize, stride: usize) -> Option<Vec<u8>> {
    let (&version, rest) = bytes.split_first()?;
    let n_channels = stride / 4;
    // The first row's predecessor stands at the end and, in the second version, what the differences are.
    let (tail, padded) = match version {
        0xa0 => (stride, stride.max(32)),
        0xa1 => (stride + n_channels, (stride + n_channels).max(24)),
        _ => return None,
    };
    let (last, codes) = rest.get(rest.len().checked_sub(tail)?..)?.split_at(stride);
    let mut last = last.to_vec();
    let of_channels = match version {
        0xa0 => vec![Differences::Bytes(1); n_channels],
        _ => codes.iter().map(|code| Differences::of(*code)).collect::<Option<_>>()?,
    };
    let mut bytes = Bytes(rest.get(..rest.len().checked_sub(padded)?)?);
    let most = (BYTES_OF_BLOCK / stride / GROUP * GROUP).min(MOST_OF_BLOCK);
    let mut rows = vec![0; count * stride];
    for block in rows.chunks_mut(most * stride) {
        let n = block.len() / stride;
        let packings = if version == 0xa0 { None } else { Some(bytes.take(n_channels)?) };
        for (channel, differences) in of_channels.iter().enumerate() {
            let mut four = [[0; MOST_OF_BLOCK]; 4];
            for (k, column) in four.iter_mut().enumerate() {
                let packing = match packings.map(|packings| packings[channel] >> (2 * k) & 3) {
                    None => Packing::Of([0, 2, 4, 8]),
                    Some(0) => Packing::Of([0, 1, 2, 4]),
                    Some(1) => Packing::Of([1, 2, 4, 8]),
                    Some(2) => Packing::Zeros,
                    Some(_) => Packing::Full,
                };
                unpack(&mut bytes, packing, &mut column[..n])?;
            }
            let last = &mut last[4 * channel..][..4];
            for (row, into) in block.chunks_exact_mut(stride).enumerate() {
                differences.add_to(last, four.map(|column| column[row]));
                into[4 * channel..][..4].copy_from_slice(last);
            }
        }
    }
    Some(rows)
}

fn unpack(bytes: &mut Bytes<'_>, packing: Packing, into: &mut [u8]) -> Option<()> {
    let bits_of = match packing {
        Packing::Of(bits) => bits,
        Packing::Zeros => return Some(()),
        Packing::Full => {
            into.copy_from_slice(bytes.take(into.len())?);
            return Some(());
        }
    };
    let n_groups = into.len().div_ceil(GROUP);
    let widths = bytes.take(n_groups.div_ceil(4))?;
    for (group, into) in into.chunks_mut(GROUP).enumerate() {
        let bits = bits_of[usize::from(widths[group / 4] >> (2 * (group % 4)) & 3)];
        into.copy_from_slice(differences(bytes, bits)?.get(..into.len())?);
    }
    Some(())
}

/// Returns sixteen numbers of 0, 1, 2, 4 or 8 bits, the largest of few bits standing for one that follows in full.
fn differences(bytes: &mut Bytes<'_>, bits: usize) -> Option<[u8; GROUP]> {
    match bits {
        0 => return Some([0; GROUP]),
        8 => return bytes.take(GROUP)?.try_into().ok(),
        _ => {}
    }
    let packed = bytes.take(GROUP * bits / 8)?;
    let full = (1_u8 << bits) - 1;
    let mut numbers = [0; GROUP];
    for (k, number) in numbers.iter_mut().enumerate() {
        let at = k * bits;
        // Single bits begin with the lowest of a byte, others with the highest.
        let shift = if bits == 1 { at % 8 } else { 8 - bits - at % 8 };
        *number = packed[at / 8] >> shift & full;
        if *number == full {
            *number = bytes.next()?;
        }
    }
    Some(numbers)
}

/// The last sixteen of something, the latest first.
struct Latest<T>([T; 16], usize);

impl<T: Copy> Latest<T> {
    fn at(&self, back: u8) -> T {
        self.0[(self.1 + 16 - 1 - usize::from(back)) % 16]
    }

    fn push(&mut self, value: T) {
        self.0[self.1] = value;
        self.1 = (self.1 + 1) % 16;
    }
}

fn triangles(bytes: &[u8], count: usize) -> Option<Vec<u32>> {
    let (&head, rest) = bytes.split_first()?;
    let most_recent = match head {
        0xe1 => 13,
        0xe0 => 15,
        _ => return None,
    };
    let (rest, table) = rest.split_at_checked(rest.len().checked_sub(16)?)?;
    let (codes, rest) = rest.split_at_checked(count / 3)?;
    let mut bytes = Bytes(rest);
    let (mut edges, mut vertices) = (Latest([(0_u32, 0_u32); 16], 0), Latest([0_u32; 16], 0));
    let (mut next, mut last) = (0_u32, 0_u32);
    let mut found = Vec::with_capacity(count);
    for &code in codes {
        let (high, low) = (code >> 4, code & 15);
        if high < 15 {
            let (a, b) = edges.at(high);
            let c = match low {
                0 => {
                    next = next.wrapping_add(1);
                    next.wrapping_sub(1)
                }
                low if low < most_recent => vertices.at(low),
                low => {
                    last = match low {
                        15 => last.wrapping_add(bytes.difference()?),
                        14 => last.wrapping_add(1),
                        _ => last.wrapping_sub(1),
                    };
                    last
                }
            };
            if low == 0 || low >= most_recent {
                vertices.push(c);
            }
            edges.push((c, b));
            edges.push((a, c));
            found.extend([a, b, c]);
            continue;
        }
        let (is_free, aux) = if low < 14 { (false, table[usize::from(low)]) } else { (true, bytes.next()?) };
        let first = if is_free && low == 15 { 15 } else { 0 };
        let places = [first, aux >> 4, aux & 15];
        if is_free && aux == 0 {
            next = 0;
        }
        let mut corners = [0; 3];
        for (corner, place) in corners.iter_mut().zip(places) {
            *corner = match place {
                0 => {
                    next = next.wrapping_add(1);
                    next.wrapping_sub(1)
                }
                15 if is_free => 0,
                place => vertices.at(place - 1),
            };
        }
        for (corner, place) in corners.iter_mut().zip(places) {
            if is_free && place == 15 {
                last = last.wrapping_add(bytes.difference()?);
                *corner = last;
            }
            // Those that were among the latest stay where they are.
            if place == 0 || is_free && place == 15 {
                vertices.push(*corner);
            }
        }
        let [a, b, c] = corners;
        edges.push((b, a));
        edges.push((c, b));
        edges.push((a, c));
        found.extend(corners);
    }
    Some(found)
}

fn indices(bytes: &[u8], count: usize) -> Option<Vec<u32>> {
    let (&(0xd0 | 0xd1), rest) = bytes.split_first()? else { return None };
    let mut bytes = Bytes(rest.get(..rest.len().checked_sub(4)?)?);
    let mut last = [0_u32; 2];
    let mut next = || {
        let number = bytes.number()?;
        let last = &mut last[(number & 1) as usize];
        *last = last.wrapping_add(signed(number >> 1));
        Some(*last)
    };
    (0..count).map(|_| next()).collect()
}

/// Undoes what was done to rows before they were packed.
fn filtered(rows: &mut [u8], stride: usize, filter: &str) -> Result<(), String> {
    let short = |row: &[u8], k: usize| f32::from(i16::from_le_bytes([row[2 * k], row[2 * k + 1]]));
    let put = |row: &mut [u8], k: usize, value: f32| {
        row[2 * k..2 * k + 2].copy_from_slice(&(value.round() as i16).to_le_bytes())
    };
    match (filter, stride) {
        ("NONE", _) => {}
        ("OCTAHEDRAL", 4) => {
            for row in rows.chunks_exact_mut(4) {
                let normal = normal_of([0, 1, 2].map(|k| f32::from(row[k] as i8)));
                (0..3).for_each(|k| row[k] = (127.0 * normal[k]).round() as i8 as u8);
            }
        }
        ("OCTAHEDRAL", 8) => {
            for row in rows.chunks_exact_mut(8) {
                let normal = normal_of([0, 1, 2].map(|k| short(row, k)));
                (0..3).for_each(|k| put(row, k, 32767.0 * normal[k]));
            }
        }
        ("QUATERNION", 8) => {
            for row in rows.chunks_exact_mut(8) {
                let code = i16::from_le_bytes([row[6], row[7]]);
                let scale = std::f32::consts::FRAC_1_SQRT_2 / f32::from(code | 3);
                let [x, y, z] = [0, 1, 2].map(|k| scale * short(row, k));
                let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
                // The largest, which is left out, stands at the place of the last two bits.
                let largest = (code & 3) as usize;
                for (k, value) in [w, x, y, z].into_iter().enumerate() {
                    put(row, (largest + k) % 4, 32767.0 * value);
                }
            }
        }
        ("EXPONENTIAL", _) => {
            for number in rows.chunks_exact_mut(4) {
                let code = i32::from_le_bytes([number[0], number[1], number[2], number[3]]);
                let value = f64::from(code << 8 >> 8) * f64::from(code >> 24).exp2();
                number.copy_from_slice(&(value as f32).to_le_bytes());
            }
        }
        ("COLOR", 4 | 8) => {
            let bytes = stride / 4;
            let number = |row: &[u8], k: usize, is_signed: bool| match (bytes, is_signed) {
                (1, false) => i32::from(row[k]),
                (1, true) => i32::from(row[k] as i8),
                (_, false) => i32::from(u16::from_le_bytes([row[2 * k], row[2 * k + 1]])),
                (_, true) => i32::from(i16::from_le_bytes([row[2 * k], row[2 * k + 1]])),
            };
            for row in rows.chunks_exact_mut(stride) {
                // The highest bit of the share of cover says how many bits the numbers have.
                let alpha = number(row, 3, false);
                let most = (2 << alpha.max(1).ilog2()) - 1;
                let (luma, orange, green) = (number(row, 0, false), number(row, 1, true), number(row, 2, true));
                let cover = alpha & (most >> 1);
                let colors = [luma + orange - green, luma + green, luma - orange - green, cover << 1 | cover & 1];
                let full = if bytes == 1 { 255.0 } else { 65535.0 };
                for (k, value) in colors.into_iter().enumerate() {
                    let value = (f64::from(value) * full / f64::from(most)).round() as u16;
                    row[bytes * k..][..bytes].copy_from_slice(&value.to_le_bytes()[..bytes]);
                }
            }
        }
        _ => return Err(format!("of the filter {filter} has rows of {stride} bytes")),
    }
    Ok(())
}

/// Returns the direction of two coordinates on an octahedron of this size.
fn normal_of([x, y, size]: [f32; 3]) -> [f32; 3] {
    let z = size - x.abs() - y.abs();
    let below = z.min(0.0);
    let [x, y] = [x, y].map(|v| v + if v >= 0.0 { below } else { -below });
    let length = (x * x + y * y + z * z).sqrt();
    if length > 0.0 { [x, y, z].map(|v| v / length) } else { [0.0; 3] }
}

#[cfg(test)]
mod tests {
    use base64::{Engine, prelude::BASE64_STANDARD};

    use super::*;

    /// Packed by meshoptimizer 0.2's encoders: a grid of 9 × 9 vertices of four numbers of 16 bits, and of its triangles with some that jump.
    const VERTICES: &str = "\
        oP8HAMjIyMjIyMjIP8jIyMjIyMjIP8jIyMjIyMjIP8jIyMjIyMjIP8jIyMjIyMjIP8jIyMjIyMjIP8jIyMjIyMjIP8jIyMjIyMjIP8jIyMjIyM\
        jAAAAAyFUFAgiwggUsIIsIBQUiwgiwBQWCLCCLBQUIIsIIBYAAAABVAQAAMAC0DAADALS0AMAAMLS0AAwAA7S0AADAALREAAAAAgAACAAA/wcA\
        UPBvMH8gEJ/gUPBv4NAgwLDgUPBv4NAgwJ8wUPBAMH+PwJ8wUPBAMH+PwJ8wUF9vMH8gEJ/gUPBv4NAgEJ/gUPBv4NAgwJ8wUPBv4NAgwMAAAA\
        CfWQEClzIZBAMEMgI0EQICMmGjnSMDBAOs1CZzAwQEAyuQgvUDAwQAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA=";
    const TRIANGLES: &str = "\
        4f4eEA4QDhAOEA4QDhAOEA7+HhAOEA4QDhAOEA4QDhAO/h4QDhAOEA4QDhAOEA4QDv4eEA4QDhAOEA4QDhAOEA7+HhAOEA4QDhAOEA4QDhAO/h\
        4QDhAOEA4QDhAOEA4QDv4eEA4QDhAOEA4QDhAOEA7+HhAOEA4QDhAOEA4QDhAO/////v/+Hw8SDwIPAg8CDwIPAg8CDwJPlQEE/5IBnwE4kS0A\
        /0YCAf8oAiQAdodWZ3iphmWJaJgBaQAA";
    const INDICES: &str = "\
        0QAEIAAeJCIEIAAeJCIEIAAeJCIEIAAeJCIEIAAeJCIEIAAeJCIEIAAeJCIEIAAeJB4EIAAeJCIEIAAeJCIEIAAeJCIEIAAeJCIEIAAeJCIEIA\
        AeJCIEIAAeJCIEIAAeJB4EIAAeJCIEIAAeJCIEIAAeJCIEIAAeJCIEIAAeJCIEIAAeJCIEIAAeJCIEIAAeJB4EIAAeJCIEIAAeJCIEIAAeJCIE\
        IAAeJCIEIAAeJCIEIAAeJCIEIAAeJCIEIAAeJB4EIAAeJCIEIAAeJCIEIAAeJCIEIAAeJCIEIAAeJCIEIAAeJCIEIAAeJCIEIAAeJB4EIAAeJC\
        IEIAAeJCIEIAAeJCIEIAAeJCIEIAAeJCIEIAAeJCIEIAAeJCIEIAAeJB4EIAAeJCIEIAAeJCIEIAAeJCIEIAAeJCIEIAAeJCIEIAAeJCIEIAAe\
        JCIEIAAeJB4EIAAeJCIEIAAeJCIEIAAeJCIEIAAeJCIEIAAeJCIEIAAeJCIEIAAeJCIEIAAeJBUmCSgbcVsmXW8FBXYEAgVQBAACTAAAAAA=";

    /// Packed by meshoptimizer 1.3 in its second version: 36 rows whose four channels hold bits that change, numbers of 16 bits, and bits of bytes.
    const SECOND: &str = "\
        obq3nroAQkJCQvhCQkJC+EJCQkL4QkJCQvhCQkJC+EJCQkL4QkJCQvgAEhISEhISEhISEhISEhISEhISEhISEhISEhISEhISEhISEhIKBmZmZm\
        ZmZmZmZmZmZmZmZg8ABgYGBgA8PDw8PDw8PDw8PDw8PDw8PDw8PDw8PDw8PDw8PDw8PDw8PADArxMqOsGl5KRDLyaW3dnISDcrotKZvRxcW/fu\
        /qVhUFC/wwkLOCzgAwMDAyMDLwIwMgAjgAYAAwIAsdNx17FT8V+x03HXsVPxT9GzUfdRs9F/0bNR91Gz0U/xU7EAAAAAAACAPwAA6P0AAAAJAA\
        AAAAABckI=";

    fn view(packed: &str, count: usize, stride: usize, mode: &str) -> Result<(Vec<u8>, Option<usize>), String> {
        let bytes = BASE64_STANDARD.decode(packed).unwrap();
        let text = format!(
            r#"{{"buffer":0,"byteLength":{},"count":{count},"byteStride":{stride},"mode":"{mode}"}}"#,
            bytes.len()
        );
        unpacked(&serde_json::from_str(&text).unwrap(), &[bytes])
    }

    /// The vertices of each triangle, from the least on.
    fn turned(triangles: &[u32]) -> Vec<[u32; 3]> {
        let turn = |t: &[u32]| match t.iter().enumerate().min_by_key(|(_, v)| **v) {
            Some((least, _)) => [t[least], t[(least + 1) % 3], t[(least + 2) % 3]],
            None => [0; 3],
        };
        triangles.chunks_exact(3).map(turn).collect()
    }

    #[test]
    fn what_the_encoders_packed_is_unpacked() {
        let (rows, stride) = view(VERTICES, 81, 8, "ATTRIBUTES").unwrap();
        let number = |x: u32, y: u32| [x * 100, y * 90, (x * x + 3 * y) % 17 * 40, 0];
        let expected = (0..81).flat_map(|i| number(i % 9, i / 9)).flat_map(|v| (v as u16).to_le_bytes());
        assert_eq!((rows, stride), (expected.collect(), Some(8)));
        let cell = |(x, y): (u32, u32)| [0, 1, 9, 9, 1, 10].map(|k| y * 9 + x + k);
        let cells = (0..64).map(|i| (i % 8, i / 8)).flat_map(cell);
        let jumps = [5, 70, 7, 80, 0, 28, 5, 70, 28, 0, 1, 2, 40, 41, 40, 3, 60, 61, 61, 60, 79];
        let expected: Vec<u32> = cells.chain(jumps).collect();
        let n = expected.len();
        let numbers = |packed, mode| {
            let (bytes, stride) = view(packed, n, 4, mode).unwrap();
            assert_eq!(stride, None);
            bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect::<Vec<u32>>()
        };
        assert_eq!(numbers(INDICES, "INDICES"), expected);
        // Triangles may begin at another of their corners.
        assert_eq!(turned(&numbers(TRIANGLES, "TRIANGLES")), turned(&expected));
        let short = view(INDICES, n, 2, "INDICES").unwrap().0;
        assert_eq!(short[2 * 30..][..2], (expected[30] as u16).to_le_bytes());
    }

    #[test]
    fn the_second_version_is_unpacked() {
        let rows = (0..36_u32).flat_map(|i| {
            let bits = 0x3f80_0000 ^ (i % 5 * 0x21_0000);
            let shorts = [i * 777 % 65536, (65000 + i * 30) % 65536].map(|v| v as u16);
            let bytes = [(i * i * i * 37 + i * 91) as u8, (i * i % 7) as u8, u8::from(i > 20), 9];
            let scattered = (i.wrapping_mul(2_654_435_761) & 0xff) << 12;
            let shorts = shorts.map(u16::to_le_bytes).concat();
            [&bits.to_le_bytes()[..], &shorts, &bytes, &scattered.to_le_bytes()].concat()
        });
        assert_eq!(view(SECOND, 36, 16, "ATTRIBUTES").unwrap().0, rows.collect::<Vec<u8>>());
    }

    /// As meshoptimizer's own decoders give them.
    #[test]
    fn filters_are_undone() {
        let mut normals = [10_i8, 20, 127, 5, -90, 60, 127, 1, 0, 0, 127, 0, -127, 0, 127, 9].map(|v| v as u8);
        filtered(&mut normals, 4, "OCTAHEDRAL").unwrap();
        let expected = [13_i8, 26, 124, 5, -106, 59, -37, 1, 0, 0, 127, 0, -127, 0, 0, 9].map(|v| v as u8);
        assert_eq!(normals, expected);
        let of_shorts = |shorts: &[i16], filter: &str| {
            let mut bytes: Vec<u8> = shorts.iter().flat_map(|v| v.to_le_bytes()).collect();
            filtered(&mut bytes, 8, filter).unwrap();
            bytes.chunks_exact(2).map(|b| i16::from_le_bytes([b[0], b[1]])).collect::<Vec<i16>>()
        };
        let wide = of_shorts(&[1000, -20000, 32767, 5, -30000, 20000, 32767, 1], "OCTAHEDRAL");
        assert_eq!(wide, [1411, -28215, 16601, 5, -19345, 4193, -26112, 1]);
        let turns = of_shorts(&[1000, -2000, 3000, 32766, 0, 0, 0, 32765], "QUATERNION");
        assert_eq!(turns, [-1414, 2121, 32660, 707, 0, 32767, 0, 0]);
        // Colors of six and of twelve bits.
        let mut colors = [36, 23, 253, 63, 0, 0, 0, 32, 38, 250, 19, 51, 63, 0, 0, 48];
        filtered(&mut colors, 4, "COLOR").unwrap();
        assert_eq!(colors, [251, 134, 65, 255, 0, 0, 0, 0, 53, 231, 101, 158, 255, 255, 255, 130]);
        let mut colors = [0, 9, 255, 5, 1, 255, 255, 15, 153, 9, 103, 254, 204, 4, 204, 12];
        filtered(&mut colors, 8, "COLOR").unwrap();
        assert_eq!(colors, [239, 255, 24, 128, 4, 64, 255, 255, 67, 51, 93, 230, 102, 102, 137, 153]);
        let mut floats: Vec<u8> = [-50331643_i32, 50331641, 0].iter().flat_map(|v| v.to_le_bytes()).collect();
        filtered(&mut floats, 12, "EXPONENTIAL").unwrap();
        let expected: Vec<u8> = [0.625_f32, -28.0, 0.0].iter().flat_map(|v| v.to_le_bytes()).collect();
        assert_eq!(floats, expected);
        assert!(filtered(&mut floats, 12, "QUATERNION").is_err());
    }

    /// Cut off or of other bytes, it ends in a sentence or in some numbers.
    #[test]
    fn broken_bytes_do_no_harm() {
        for (packed, count, stride, mode) in [
            (VERTICES, 81, 8, "ATTRIBUTES"),
            (SECOND, 36, 16, "ATTRIBUTES"),
            (TRIANGLES, 405, 4, "TRIANGLES"),
            (INDICES, 405, 4, "INDICES"),
        ] {
            let whole = BASE64_STANDARD.decode(packed).unwrap();
            for n in 0..whole.len() {
                let _ = view(&BASE64_STANDARD.encode(&whole[..n]), count, stride, mode);
                let mut other = whole.clone();
                other[n] ^= 0x5a;
                let _ = view(&BASE64_STANDARD.encode(other), count, stride, mode);
            }
            assert!(view(packed, 1 << 40, stride, mode).is_err() && view(packed, count, 0, mode).is_err());
            assert!(view(packed, count, stride, "OTHER").unwrap_err().contains("OTHER"));
        }
    }
}
