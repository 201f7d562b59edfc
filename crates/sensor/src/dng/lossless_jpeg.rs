//! Lossless JPEG with Huffman codes (ITU-T T.81, process 14 and annex H), as DNG compresses raw samples.

/// An image of whole numbers, the components of a pixel side by side.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Decoded {
    pub(super) rows: usize,
    pub(super) columns: usize,
    pub(super) components: usize,
    pub(super) samples: Vec<u16>,
}

/// Markers (T.81, table B.1).
const SOI: u8 = 0xd8;
const SOF3: u8 = 0xc3;
const DHT: u8 = 0xc4;
const SOS: u8 = 0xda;
const DRI: u8 = 0xdd;
const EOI: u8 = 0xd9;

/// Returns the image that the bytes are, which must have as many samples as are wanted.
pub(super) fn decode(bytes: &[u8], n_samples: usize) -> Result<Decoded, String> {
    if bytes.get(..2) != Some(&[0xff, SOI]) {
        return Err("are no JPEG, expected them to begin with FF D8".to_owned());
    }
    let mut tables: [Option<HuffmanTable>; 4] = Default::default();
    let (mut frame, mut restart) = (None, 0);
    let mut at = 2;
    loop {
        let (marker, segment, next) = segment(bytes, at)?;
        match marker {
            SOF3 => frame = Some(Frame::read(segment)?),
            DHT => read_tables(segment, &mut tables)?,
            DRI => restart = usize::from(be16(segment, 0).ok_or("are short of a restart interval")?),
            SOS => {
                let frame = frame.ok_or("have no frame header before the scan")?;
                return frame.scan(segment, &tables, restart, &bytes[next..], n_samples);
            }
            EOI => return Err("hold no scan".to_owned()),
            // Other processes: FFC8 is reserved, FFCC defines arithmetic coding.
            0xc0..=0xcf => return Err(format!("are JPEG of process FF{marker:02X}, expected lossless FFC3")),
            _ => {}
        }
        at = next;
    }
}

/// Returns the marker at a place, what its segment holds, and where it ends.
fn segment(bytes: &[u8], mut at: usize) -> Result<(u8, &[u8], usize), String> {
    let short = || "end in a header".to_owned();
    if bytes.get(at) != Some(&0xff) {
        return Err(format!("have no marker at byte {at}"));
    }
    // Any number of fill bytes may stand before a marker.
    while bytes.get(at + 1) == Some(&0xff) {
        at += 1;
    }
    let marker = *bytes.get(at + 1).ok_or_else(short)?;
    if marker == EOI {
        return Ok((marker, &[], at + 2));
    }
    let length = usize::from(be16(bytes, at + 2).ok_or_else(short)?);
    let held = bytes.get(at + 4..at + 2 + length).ok_or_else(short)?;
    Ok((marker, held, at + 2 + length))
}

fn be16(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_be_bytes([*bytes.get(at)?, *bytes.get(at + 1)?]))
}

/// What a frame header says.
#[derive(Clone, Debug)]
struct Frame {
    precision: u32,
    rows: usize,
    columns: usize,
    /// The numbers of the components.
    ids: Vec<u8>,
}

impl Frame {
    fn read(segment: &[u8]) -> Result<Self, String> {
        let short = "are short of a frame header";
        let (&precision, &n) = segment.first().zip(segment.get(5)).ok_or(short)?;
        let rows = usize::from(be16(segment, 1).ok_or(short)?);
        let columns = usize::from(be16(segment, 3).ok_or(short)?);
        let components = segment.get(6..6 + 3 * usize::from(n)).ok_or(short)?;
        if !(2..=16).contains(&precision) || rows == 0 || columns == 0 || !(1..=4).contains(&n) {
            return Err(format!(
                "state {precision} bits, {columns} × {rows} pixels and {n} components, expected 2 to 16, one or more, 1 to 4"
            ));
        }
        // The factor of a single component means nothing (T.81, A.2.2).
        if n > 1 && components.chunks_exact(3).any(|component| component[1] != 0x11) {
            return Err("have subsampled components, expected all of one size".to_owned());
        }
        let ids = components.chunks_exact(3).map(|component| component[0]).collect();
        Ok(Self { precision: u32::from(precision), rows, columns, ids })
    }

    /// Decodes the one scan of all components.
    fn scan(
        &self,
        header: &[u8],
        tables: &[Option<HuffmanTable>; 4],
        restart: usize,
        bytes: &[u8],
        n_samples: usize,
    ) -> Result<Decoded, String> {
        let Self { precision, rows, columns, ref ids } = *self;
        let n = ids.len();
        let found = rows * columns * n;
        if found != n_samples {
            return Err(format!("hold {columns} × {rows} pixels of {n} components, expected {n_samples} samples"));
        }
        let short = "are short of a scan header";
        let specs = header.get(1..1 + 2 * n).ok_or(short)?;
        let &[predictor, _, shift] = header.get(1 + 2 * n..4 + 2 * n).ok_or(short)? else { return Err(short.into()) };
        let shift = u32::from(shift & 15);
        if usize::from(header[0]) != n || specs.chunks_exact(2).zip(ids).any(|(spec, id)| spec[0] != *id) {
            return Err("have scans of single components, expected one of all".to_owned());
        }
        if !(1..=7).contains(&predictor) || shift >= precision {
            return Err(format!(
                "have predictor {predictor} and a shift of {shift} bits, expected 1 to 7, and fewer bits"
            ));
        }
        if !restart.is_multiple_of(columns) {
            return Err(format!("restart every {restart} pixels, expected whole rows of {columns}"));
        }
        let tables: Option<Vec<&HuffmanTable>> =
            specs.chunks_exact(2).map(|spec| tables.get(usize::from(spec[1] >> 4))?.as_ref()).collect();
        let tables = tables.ok_or("name a Huffman table that is not there")?;
        // Every sample takes a bit or more.
        if found.div_ceil(8) > bytes.len() {
            return Err("end early".to_owned());
        }
        let scan = Scan { tables, predictor, first: 1 << (precision - shift - 1), row_samples: columns * n };
        let mut samples = scan.decode(rows, restart / columns, bytes)?;
        samples.iter_mut().for_each(|sample| *sample <<= shift);
        Ok(Decoded { rows, columns, components: n, samples })
    }
}

/// A scan of interleaved components.
struct Scan<'a> {
    /// One for each component.
    tables: Vec<&'a HuffmanTable>,
    predictor: u8,
    /// What the first sample is predicted to be.
    first: u16,
    row_samples: usize,
}

impl Scan<'_> {
    /// Decodes rows of samples; after so many the prediction starts anew, never after 0.
    fn decode(&self, rows: usize, restart_rows: usize, bytes: &[u8]) -> Result<Vec<u16>, String> {
        let mut samples = vec![0; rows * self.row_samples];
        let mut bits = BitReader::new(bytes);
        let none = [];
        for row in 0..rows {
            let restarts = restart_rows > 0 && row > 0 && row % restart_rows == 0;
            if restarts {
                bits.restart()?;
            }
            let (before, from) = samples.split_at_mut(row * self.row_samples);
            let above = if row == 0 || restarts { &none[..] } else { &before[before.len() - self.row_samples..] };
            self.decode_row(&mut from[..self.row_samples], above, &mut bits)?;
            if bits.is_beyond_end() {
                return Err(format!("end early, in row {row} of {rows}"));
            }
        }
        Ok(samples)
    }

    /// Decodes a row; `above` is empty for the first one (T.81, H.1.2.1).
    fn decode_row(&self, row: &mut [u16], above: &[u16], bits: &mut BitReader<'_>) -> Result<(), String> {
        let n = self.tables.len();
        for i in 0..row.len() {
            let prediction = match (i >= n, above.is_empty()) {
                (false, true) => self.first,
                (true, true) => row[i - n],
                (false, false) => above[i],
                (true, false) => predicted(self.predictor, row[i - n], above[i], above[i - n]),
            };
            row[i] = prediction.wrapping_add(bits.difference(self.tables[i % n])?);
        }
        Ok(())
    }
}

/// Returns the prediction from the samples to the left, above, and above to the left (T.81, table H.1).
#[inline]
fn predicted(predictor: u8, left: u16, above: u16, diagonal: u16) -> u16 {
    let (a, b, c) = (i32::from(left), i32::from(above), i32::from(diagonal));
    let value = match predictor {
        1 => a,
        2 => b,
        3 => c,
        4 => a + b - c,
        5 => a + ((b - c) >> 1),
        6 => b + ((a - c) >> 1),
        _ => (a + b) >> 1,
    };
    value as u16
}

/// Codes of at most 16 bits, each for a number of bits that follow.
#[derive(Clone, Debug)]
struct HuffmanTable {
    /// The longest code, bits.
    longest: u32,
    /// For all that so many bits can be: the length of the code that they begin with, 0 for none, and what it stands for.
    codes: Vec<(u8, u8)>,
}

/// Reads the tables of a segment (T.81, B.2.4.2).
fn read_tables(mut segment: &[u8], tables: &mut [Option<HuffmanTable>; 4]) -> Result<(), String> {
    while let Some((&head, rest)) = segment.split_first() {
        let short = "are short of a Huffman table";
        let counts = rest.get(..16).ok_or(short)?;
        let n: usize = counts.iter().map(|&count| usize::from(count)).sum();
        let values = rest.get(16..16 + n).ok_or(short)?;
        let place = tables.get_mut(usize::from(head)).ok_or("number a Huffman table beyond 3")?;
        *place = Some(HuffmanTable::new(counts, values)?);
        segment = &rest[16 + n..];
    }
    Ok(())
}

impl HuffmanTable {
    fn new(counts: &[u8], values: &[u8]) -> Result<Self, String> {
        let longest = counts.iter().rposition(|&count| count > 0).ok_or("have an empty Huffman table")? as u32 + 1;
        let mut codes = Vec::with_capacity(1 << longest);
        let mut values = values.iter();
        for (length, &count) in (1_u32..=longest).zip(counts) {
            for &value in values.by_ref().take(usize::from(count)) {
                if value > 16 {
                    return Err(format!("have a Huffman code for {value} bits, expected 16 at most"));
                }
                codes.extend(std::iter::repeat_n((length as u8, value), 1 << (longest - length)));
            }
            if codes.len() > 1 << longest {
                return Err("have more Huffman codes than there can be".to_owned());
            }
        }
        codes.resize(1 << longest, (0, 0));
        Ok(Self { longest, codes })
    }
}

/// Bits of a scan, in which FF is followed by 0.
struct BitReader<'a> {
    bytes: &'a [u8],
    at: usize,
    /// The next bits, the first of them highest.
    held: u64,
    n_held: u32,
    /// How many of the bits are zeros after the end.
    n_after_end: u32,
}

impl<'a> BitReader<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, held: 0, n_held: 0, n_after_end: 0 }
    }

    /// Holds 57 bits or more.
    #[inline]
    fn fill(&mut self) {
        while self.n_held <= 56 {
            let byte = match (self.bytes.get(self.at), self.bytes.get(self.at + 1)) {
                (Some(0xff), Some(0)) => {
                    self.at += 2;
                    0xff
                }
                // A marker, or the end.
                (Some(0xff), _) | (None, _) => {
                    self.n_after_end += 8;
                    0
                }
                (Some(&byte), _) => {
                    self.at += 1;
                    byte
                }
            };
            self.held |= u64::from(byte) << (56 - self.n_held);
            self.n_held += 8;
        }
    }

    #[inline]
    fn skip(&mut self, n: u32) {
        self.held <<= n;
        self.n_held -= n;
    }

    /// Returns the next difference, modulo 2¹⁶ (T.81, F.2.2.1 and H.1.2.2).
    #[inline]
    fn difference(&mut self, table: &HuffmanTable) -> Result<u16, String> {
        if self.n_held < 32 {
            self.fill();
        }
        let (length, n) = table.codes[(self.held >> (64 - table.longest)) as usize];
        if length == 0 {
            return Err("have a code that is in no Huffman table".to_owned());
        }
        self.skip(u32::from(length));
        Ok(match n {
            0 => 0,
            // No bits follow the largest.
            16 => 1 << 15,
            n => {
                let n = u32::from(n);
                let value = (self.held >> (64 - n)) as u16;
                self.skip(n);
                let is_negative = value >> (n - 1) == 0;
                if is_negative { value.wrapping_sub((1 << n) - 1) } else { value }
            }
        })
    }

    /// Whether bits were taken that are not there.
    fn is_beyond_end(&self) -> bool {
        self.n_after_end > self.n_held
    }

    /// Goes on behind the next restart marker.
    fn restart(&mut self) -> Result<(), String> {
        match (self.bytes.get(self.at), self.bytes.get(self.at + 1)) {
            (Some(0xff), Some(0xd0..=0xd7)) => {
                *self = Self { at: self.at + 2, ..Self::new(self.bytes) };
                Ok(())
            }
            _ => Err(format!("have no restart marker at byte {} of the scan", self.at)),
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// How an image is written.
    #[derive(Clone, Copy)]
    pub(in crate::dng) struct Coding {
        pub(in crate::dng) bits: u8,
        pub(in crate::dng) predictor: u8,
        pub(in crate::dng) shift: u8,
        /// Rows between restarts, 0 for none.
        pub(in crate::dng) restart_rows: usize,
    }

    impl Coding {
        pub(in crate::dng) fn of_bits(bits: u8) -> Self {
            Self { bits, predictor: 1, shift: 0, restart_rows: 0 }
        }
    }

    /// Bits as they are written, FF followed by 0.
    #[derive(Default)]
    struct BitWriter {
        bytes: Vec<u8>,
        held: u32,
        n_held: u32,
    }

    impl BitWriter {
        fn put(&mut self, value: u32, n: u32) {
            for i in (0..n).rev() {
                self.held = self.held << 1 | (value >> i & 1);
                self.n_held += 1;
                if self.n_held == 8 {
                    self.flush();
                }
            }
        }

        fn flush(&mut self) {
            let byte = (self.held << (8 - self.n_held)) as u8;
            self.bytes.push(byte);
            if byte == 0xff {
                self.bytes.push(0);
            }
            (self.held, self.n_held) = (0, 0);
        }

        fn pad(&mut self) {
            while self.n_held != 0 {
                self.put(1, 1);
            }
        }
    }

    /// Returns an image as lossless JPEG, every difference's size under a code of five bits.
    pub(in crate::dng) fn encode(
        samples: &[u16],
        (rows, columns, n): (usize, usize, usize),
        coding: Coding,
    ) -> Vec<u8> {
        let Coding { bits, predictor, shift, restart_rows } = coding;
        let mut file = vec![0xff, SOI, 0xff, 0xe0, 0, 4, 1, 2];
        let marker = |file: &mut Vec<u8>, marker: u8, held: &[u8]| {
            file.extend([0xff, marker]);
            file.extend(((held.len() + 2) as u16).to_be_bytes());
            file.extend(held);
        };
        let counts = (1..=16).map(|length| if length == 5 { 17 } else { 0 });
        let table: Vec<u8> = [0].into_iter().chain(counts).chain(0..=16).collect();
        marker(&mut file, DHT, &table);
        let [[r0, r1], [c0, c1]] = [rows, columns].map(|n| (n as u16).to_be_bytes());
        let head = [bits, r0, r1, c0, c1, n as u8];
        let frame: Vec<u8> = head.into_iter().chain((0..n as u8).flat_map(|id| [id, 0x11, 0])).collect();
        marker(&mut file, SOF3, &frame);
        if restart_rows > 0 {
            marker(&mut file, DRI, &((restart_rows * columns) as u16).to_be_bytes());
        }
        let specs = (0..n as u8).flat_map(|id| [id, 0]);
        let scan: Vec<u8> = [n as u8].into_iter().chain(specs).chain([predictor, 0, shift]).collect();
        marker(&mut file, SOS, &scan);
        let mut writer = BitWriter::default();
        let at = |row: usize, i: usize| samples[row * columns * n + i] >> shift;
        let mut n_restarts = 0;
        for row in 0..rows {
            let restarts = restart_rows > 0 && row > 0 && row % restart_rows == 0;
            if restarts {
                writer.pad();
                writer.bytes.extend([0xff, 0xd0 + n_restarts % 8]);
                n_restarts += 1;
            }
            for i in 0..columns * n {
                let prediction = match (row == 0 || restarts, i < n) {
                    (true, true) => 1 << (bits - shift - 1),
                    (true, false) => at(row, i - n),
                    (false, true) => at(row - 1, i),
                    (false, false) => predicted(predictor, at(row, i - n), at(row - 1, i), at(row - 1, i - n)),
                };
                let difference = at(row, i).wrapping_sub(prediction);
                let signed = i32::from(difference as i16);
                let size = if difference == 1 << 15 { 16 } else { 32 - signed.unsigned_abs().leading_zeros() };
                writer.put(size, 5);
                if size < 16 {
                    writer.put((if signed < 0 { signed + (1 << size) - 1 } else { signed }) as u32, size);
                }
            }
        }
        writer.pad();
        file.extend(writer.bytes);
        file.extend([0xff, EOI]);
        file
    }

    /// Samples that differ by little and by much, so that every size of difference occurs.
    pub(in crate::dng) fn uneven(n: usize, bits: u8) -> Vec<u16> {
        let top = ((1_u32 << bits) - 1) as u16;
        let value = |i: usize| (i as u32).wrapping_mul(2_654_435_761).rotate_left((i % 13) as u32) >> (i % 17 + 8);
        (0..n).map(|i| value(i) as u16 & top).collect()
    }

    #[test]
    fn every_predictor_precision_and_number_of_components_is_decoded() {
        for predictor in 1..=7 {
            for (bits, n, restart_rows) in [(16, 1, 0), (14, 2, 0), (12, 3, 3), (8, 4, 1), (2, 1, 2)] {
                let size = (7, 11, n);
                let samples = uneven(7 * 11 * n, bits);
                let coding = Coding { bits, predictor, shift: 0, restart_rows };
                let found = decode(&encode(&samples, size, coding), samples.len()).unwrap();
                let wanted = Decoded { rows: 7, columns: 11, components: n, samples };
                assert_eq!(found, wanted, "predictor {predictor}, {bits} bits");
            }
        }
        let samples: Vec<u16> = uneven(60, 12).iter().map(|sample| sample & !3).collect();
        let coding = Coding { shift: 2, ..Coding::of_bits(12) };
        assert_eq!(decode(&encode(&samples, (6, 10, 1), coding), 60).unwrap().samples, samples);
    }

    #[test]
    fn the_largest_difference_has_no_bits_of_its_own() {
        let samples = [0, 0x8000, 0, 0xffff, 0x7fff, 0xffff];
        assert_eq!(decode(&encode(&samples, (1, 6, 1), Coding::of_bits(16)), 6).unwrap().samples, samples);
    }

    #[test]
    fn what_is_no_lossless_jpeg_is_refused() {
        let samples = uneven(60, 12);
        let right = encode(&samples, (6, 10, 1), Coding { restart_rows: 2, ..Coding::of_bits(12) });
        let place = |marker: u8| right.windows(2).position(|pair| pair == [0xff, marker]).unwrap();
        let reason = |change: &dyn Fn(&mut Vec<u8>)| {
            let mut bytes = right.clone();
            change(&mut bytes);
            decode(&bytes, 60).unwrap_err()
        };
        for (change, word) in [
            (&(|bytes: &mut Vec<u8>| bytes[0] = 0) as &dyn Fn(&mut Vec<u8>), "no JPEG"),
            (&|bytes| bytes[place(SOF3) + 1] = 0xc0, "process FFC0"),
            (&|bytes| bytes[place(SOF3) + 4] = 17, "17 bits"),
            (&|bytes| bytes[place(SOF3) + 8] = 11, "11 × 6"),
            (&|bytes| bytes[place(SOS) + 7] = 0, "predictor 0"),
            (&|bytes| bytes[place(SOS) + 5] = 9, "single components"),
            (&|bytes| bytes[place(SOS) + 6] = 0x30, "Huffman table"),
            (&|bytes| bytes[place(DRI) + 5] = 19, "whole rows"),
            (&|bytes| bytes[place(0xd0) + 1] = 0, "restart marker"),
            // Three codes of one bit.
            (&|bytes| (bytes[place(DHT) + 5], bytes[place(DHT) + 9]) = (3, 14), "more Huffman codes"),
            (&|bytes| bytes.truncate(place(SOS) + 20), "end early"),
            (&|bytes| bytes.truncate(right.len() - 9), "end early"),
            (&|bytes| bytes.truncate(30), "end in a header"),
        ] {
            assert!(reason(change).contains(word), "{word}: {}", reason(change));
        }
    }
}
