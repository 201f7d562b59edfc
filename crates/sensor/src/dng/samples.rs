//! The samples of a raw frame in a DNG file: strips or tiles, plain, deflated, as JPEG without and with loss or as JPEG XL, whole numbers or floats.

use std::{borrow::Cow, io::Read};

use dioptric_files::memory;
use flate2::read::ZlibDecoder;
use rayon::prelude::*;

use super::{
    lossless_jpeg, pictured,
    predictor::Predictor,
    tags::{
        BITS_PER_SAMPLE, COLUMN_INTERLEAVE_FACTOR, COMPRESSION, IMAGE_LENGTH, IMAGE_WIDTH, PLANAR_CONFIGURATION,
        PREDICTOR, ROW_INTERLEAVE_FACTOR, ROWS_PER_STRIP, SAMPLE_FORMAT, SAMPLES_PER_PIXEL, STRIP_BYTE_COUNTS,
        STRIP_OFFSETS, SUB_TILE_BLOCK_SIZE, TILE_BYTE_COUNTS, TILE_LENGTH, TILE_OFFSETS, TILE_WIDTH,
    },
    tiff_reader::{Fields, TiffReader},
};

/// What a code takes while a frame is read, bytes: itself, its level and the sample of a plane.
const CODE_BYTES: u64 = 8;
/// A deflated byte is no more than so many.
const MOST_DEFLATED: usize = 1032;

/// Values of the tag `Compression`.
const PLAIN: usize = 1;
const LOSSLESS_JPEG: usize = 7;
/// Deflated: the number that Adobe uses, and the older one.
const DEFLATED: [usize; 2] = [8, 32_946];
const LOSSY_JPEG: usize = 34_892;
const JPEG_XL: usize = 52_546;
/// Values of the tag `SampleFormat`.
const WHOLE: usize = 1;
const FLOAT: usize = 3;

/// The samples of a frame as they stand in the file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Samples {
    pub(super) rows: usize,
    pub(super) columns: usize,
    /// Samples of a pixel, side by side.
    pub(super) n_planes: usize,
    pub(super) bits: u32,
    pub(super) codes: Codes,
}

/// Samples of all planes, side by side.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Codes {
    Whole(Vec<u16>),
    Floats(Vec<f32>),
}

impl Samples {
    /// Returns one sample.
    pub(super) fn at(&self, row: usize, column: usize, plane: usize) -> f32 {
        let place = (row * self.columns + column) * self.n_planes + plane;
        match &self.codes {
            Codes::Whole(codes) => f32::from(codes[place]),
            Codes::Floats(values) => values[place],
        }
    }

    /// Returns the highest code; 1 of floats, which may go beyond.
    pub(super) fn top(&self) -> f64 {
        match &self.codes {
            Codes::Whole(_) => f64::from((1_u32 << self.bits) - 1),
            Codes::Floats(_) => 1.0,
        }
    }
}

/// A sample of one of the two kinds.
trait Sample: Copy + Default + Send + Sync {
    /// Unpacks a row of bytes of so many bits a sample.
    fn unpack(file: TiffReader<'_>, bits: u32, stored: &[u8], row: &mut [Self]);

    fn of_code(code: u16) -> Self;

    /// Of a share of the highest code.
    fn of_share(share: f32, top: f32) -> Self;
}

impl Sample for u16 {
    fn unpack(file: TiffReader<'_>, bits: u32, stored: &[u8], row: &mut [Self]) {
        unpack_codes(file, bits, stored, row);
    }

    fn of_code(code: u16) -> Self {
        code
    }

    fn of_share(share: f32, top: f32) -> Self {
        (share * top).round() as Self
    }
}

impl Sample for f32 {
    fn unpack(file: TiffReader<'_>, bits: u32, stored: &[u8], row: &mut [Self]) {
        unpack_floats(file, bits, stored, row);
    }

    fn of_code(code: u16) -> Self {
        Self::from(code)
    }

    fn of_share(share: f32, _: f32) -> Self {
        finite(share)
    }
}

/// How the codes of a frame are stored.
struct Storage<'a> {
    file: TiffReader<'a>,
    compression: usize,
    predictor: Predictor,
    is_float: bool,
    bits: u32,
    n_planes: usize,
    rows: usize,
    columns: usize,
    /// Pixels of a tile; a strip is as wide as the frame.
    tile_rows: usize,
    tile_columns: usize,
    /// Whether the last rows of tiles are filled up.
    is_tiled: bool,
    blocks: Vec<&'a [u8]>,
    /// Of how many fields the rows and the columns are, one field after the other.
    fields: [usize; 2],
}

/// Reads the codes of the frame of a directory.
///
/// What is taken of memory is bounded by the length of the file: plain samples must all be there, and a compressed one takes a bit
/// or more.
pub(super) fn read(file: TiffReader<'_>, fields: &Fields<'_>) -> Result<Samples, String> {
    let storage = Storage::new(file, fields)?;
    let Storage { rows, columns, n_planes, bits, .. } = storage;
    let codes = if storage.is_float { Codes::Floats(storage.samples()?) } else { Codes::Whole(storage.samples()?) };
    Ok(Samples { rows, columns, n_planes, bits, codes })
}

impl<'a> Storage<'a> {
    fn new(file: TiffReader<'a>, fields: &Fields<'a>) -> Result<Self, String> {
        let rows = fields.one_or(IMAGE_LENGTH, 0)?;
        let columns = fields.one_or(IMAGE_WIDTH, 0)?;
        let n_planes = fields.one_or(SAMPLES_PER_PIXEL, 1)?;
        let bits = fields.whole(BITS_PER_SAMPLE)?;
        let compression = fields.one_or(COMPRESSION, PLAIN)?;
        if rows == 0 || columns == 0 || !(1..=4).contains(&n_planes) {
            return Err(format!("has {columns} × {rows} pixels of {n_planes} samples, expected some pixels of 1 to 4"));
        }
        let formats = fields.whole(SAMPLE_FORMAT)?;
        let is_float = formats.first() == Some(&FLOAT);
        let depth = match bits.first() {
            Some(&depth) if !is_float && (8..=16).contains(&depth) && bits.iter().all(|bits| *bits == depth) => {
                depth as u32
            }
            Some(&depth) if is_float && [16, 24, 32].contains(&depth) && bits.iter().all(|bits| *bits == depth) => {
                depth as u32
            }
            _ if is_float => {
                return Err(format!("has floats of {bits:?} bits, expected 16, 24 or 32, the same for all planes"));
            }
            _ => return Err(format!("has {bits:?} bits a sample, expected from 8 to 16, the same for all planes")),
        };
        for (tag, expected, what) in [
            (SAMPLE_FORMAT, if is_float { FLOAT } else { WHOLE }, "samples that are no whole numbers and no floats"),
            (PLANAR_CONFIGURATION, 1, "planes one after the other"),
            (SUB_TILE_BLOCK_SIZE, 1, "blocks within tiles"),
        ] {
            if let Some(other) = fields.whole(tag)?.into_iter().find(|value| *value != expected) {
                return Err(format!("has {what} (field {tag} is {other}), which is not read"));
            }
        }
        let interleaved = [fields.one_or(ROW_INTERLEAVE_FACTOR, 1)?, fields.one_or(COLUMN_INTERLEAVE_FACTOR, 1)?];
        if !(1..=rows).contains(&interleaved[0]) || !(1..=columns).contains(&interleaved[1]) {
            let [down, across] = interleaved;
            return Err(format!(
                "has rows of {down} and columns of {across} fields, expected at least 1 and no more than there are"
            ));
        }
        let is_deflated = DEFLATED.contains(&compression);
        let is_known = match compression {
            PLAIN | JPEG_XL => true,
            LOSSLESS_JPEG => !is_float,
            LOSSY_JPEG => !is_float && depth == 8,
            _ => is_deflated,
        };
        if !is_known {
            return Err(format!(
                "has compression {compression} of {}, expected none (1), lossless JPEG of whole numbers (7), deflate (8), JPEG of 8 bits (34892) \
                 or JPEG XL (52546); a DNG converter makes such a file",
                if is_float { "floats".to_owned() } else { format!("{depth} bits") }
            ));
        }
        if is_deflated && ![8, 16, 24, 32].contains(&depth) {
            return Err(format!("has deflated samples of {depth} bits, expected 8, 16, 24 or 32"));
        }
        let predictor =
            if is_deflated { Predictor::of(fields.one_or(PREDICTOR, 1)?, is_float)? } else { Predictor::None };
        let is_tiled = fields.has(TILE_WIDTH);
        let (tile_columns, tile_rows, places, counts) = if is_tiled {
            let (width, length) = (fields.one_or(TILE_WIDTH, 0)?, fields.one_or(TILE_LENGTH, 0)?);
            (width, length, fields.whole(TILE_OFFSETS)?, fields.whole(TILE_BYTE_COUNTS)?)
        } else {
            let length = fields.one_or(ROWS_PER_STRIP, rows)?.min(rows);
            (columns, length, fields.whole(STRIP_OFFSETS)?, fields.whole(STRIP_BYTE_COUNTS)?)
        };
        if tile_rows == 0 || tile_columns == 0 {
            return Err(format!("has tiles of {tile_columns} × {tile_rows} pixels, expected some"));
        }
        let n_blocks = rows.div_ceil(tile_rows) * columns.div_ceil(tile_columns);
        if places.len() < n_blocks || counts.len() < n_blocks {
            let found = places.len().min(counts.len());
            return Err(format!("has {found} strips or tiles, expected {n_blocks}"));
        }
        // Codes, and the levels and planes that are made of them.
        let bytes = (rows as u64).saturating_mul(columns as u64).saturating_mul(CODE_BYTES * n_planes as u64);
        memory::check(bytes, file.n_bytes() as u64).map_err(|error| error.to_string())?;
        let block = |(&place, &n): (&usize, &usize)| {
            file.slice(place, n).ok_or_else(|| format!("ends before the {n} bytes of samples at byte {place}"))
        };
        let blocks = places.iter().zip(&counts).take(n_blocks).map(block).collect::<Result<_, _>>()?;
        let bits = depth;
        Ok(Self {
            file,
            compression,
            predictor,
            is_float,
            bits,
            n_planes,
            rows,
            columns,
            tile_rows,
            tile_columns,
            is_tiled,
            blocks,
            fields: interleaved,
        })
    }

    /// Reads all samples.
    fn samples<T: Sample>(&self) -> Result<Vec<T>, String> {
        let line = self.columns * self.n_planes;
        let n_samples = self.rows.checked_mul(line).filter(|n| match self.compression {
            PLAIN => n / 8 * self.bits as usize <= self.file.n_bytes(),
            LOSSLESS_JPEG => n / 8 <= self.file.n_bytes(),
            // An even picture takes no more than its header.
            LOSSY_JPEG | JPEG_XL => true,
            _ => n / MOST_DEFLATED <= self.file.n_bytes(),
        });
        let Some(n_samples) = n_samples else {
            return Err(format!(
                "states {} × {} pixels, more than its {} bytes can hold",
                self.columns,
                self.rows,
                self.file.n_bytes()
            ));
        };
        let mut codes = vec![T::default(); n_samples];
        let n_across = self.columns.div_ceil(self.tile_columns);
        // One row of tiles after the other; the first reason counts, whatever the threads.
        let reasons: Vec<Result<(), String>> = codes
            .par_chunks_mut(self.tile_rows * line)
            .zip(self.blocks.par_chunks(n_across))
            .map(|(rows, blocks)| {
                let n_rows = rows.len() / line;
                for (number, block) in blocks.iter().enumerate() {
                    self.read_block(block, number * self.tile_columns, (&mut *rows, n_rows))?;
                }
                Ok(())
            })
            .collect();
        reasons.into_iter().collect::<Result<(), _>>()?;
        Ok(if self.fields == [1, 1] { codes } else { self.woven(&codes) })
    }

    /// Returns samples whose rows and columns stand field by field, the first of each n, then the second of each, in their order (DNG 1.7,
    /// `RowInterleaveFactor`).
    fn woven<T: Sample>(&self, stored: &[T]) -> Vec<T> {
        let places = |n: usize, fields: usize| -> Vec<usize> {
            (0..fields).flat_map(|field| (field..n).step_by(fields)).collect()
        };
        let (to_rows, to_columns) = (places(self.rows, self.fields[0]), places(self.columns, self.fields[1]));
        let line = self.columns * self.n_planes;
        let mut woven = vec![T::default(); stored.len()];
        for (stored, row) in stored.chunks_exact(line).zip(to_rows) {
            let woven = &mut woven[row * line..][..line];
            for (pixel, column) in stored.chunks_exact(self.n_planes).zip(&to_columns) {
                woven[column * self.n_planes..][..self.n_planes].copy_from_slice(pixel);
            }
        }
        woven
    }

    /// Reads a strip or tile whose first column is given into the rows that it covers.
    fn read_block<T: Sample>(
        &self,
        block: &[u8],
        first: usize,
        (rows, n_rows): (&mut [T], usize),
    ) -> Result<(), String> {
        let line = self.columns * self.n_planes;
        let stored_line = self.tile_columns * self.n_planes;
        let stored_rows = if self.is_tiled { self.tile_rows } else { n_rows };
        let n = self.tile_columns.min(self.columns - first) * self.n_planes;
        let from = first * self.n_planes;
        let lines = rows.chunks_exact_mut(line).map(|row| &mut row[from..from + n]);
        let n_stored = stored_rows.checked_mul(stored_line).ok_or("has tiles without end")?;
        let size = pictured::Size { rows: stored_rows, columns: self.tile_columns, n_planes: self.n_planes };
        let samples: Vec<T> = match self.compression {
            // However many rows and components these are: the samples of a tile follow one another.
            LOSSLESS_JPEG => {
                let decoded =
                    lossless_jpeg::decode(block, n_stored).map_err(|reason| format!("has samples that {reason}"))?;
                decoded.samples.into_iter().map(T::of_code).collect()
            }
            LOSSY_JPEG => pictured::jpeg(block, size)?.into_iter().map(|code| T::of_code(u16::from(code))).collect(),
            JPEG_XL => {
                let top = ((1_u64 << self.bits) - 1) as f32;
                pictured::jpeg_xl(block, size)?.into_iter().map(|share| T::of_share(share, top)).collect()
            }
            _ => {
                let n_bytes = stored_line.checked_mul(self.bits as usize).ok_or("has tiles without end")?.div_ceil(8);
                let block = self.inflated(block, n_bytes, stored_rows)?;
                if n_bytes.checked_mul(n_rows).is_none_or(|all| all > block.len()) {
                    let n = block.len();
                    return Err(format!("has {n} bytes in a strip or tile, expected {n_rows} rows of {n_bytes}"));
                }
                lines
                    .zip(block.chunks_exact(n_bytes))
                    .for_each(|(row, stored)| T::unpack(self.file, self.bits, stored, row));
                return Ok(());
            }
        };
        lines.zip(samples.chunks_exact(stored_line)).for_each(|(row, stored)| row.copy_from_slice(&stored[..n]));
        Ok(())
    }

    /// Returns the bytes of a block of so many rows of bytes as they would stand in a plain one.
    fn inflated<'b>(&self, block: &'b [u8], n_bytes: usize, n_rows: usize) -> Result<Cow<'b, [u8]>, String> {
        if !DEFLATED.contains(&self.compression) {
            return Ok(Cow::Borrowed(block));
        }
        let wanted = n_bytes.checked_mul(n_rows).ok_or("has tiles without end")?;
        let mut bytes = Vec::new();
        let limit = (wanted as u64).min((block.len() as u64).saturating_mul(MOST_DEFLATED as u64));
        ZlibDecoder::new(block)
            .take(limit)
            .read_to_end(&mut bytes)
            .map_err(|error| format!("has deflated samples that cannot be read: {error}"))?;
        for row in bytes.chunks_exact_mut(n_bytes) {
            self.predictor.undo(row, self.bits as usize / 8, self.n_planes, self.file.is_big_endian());
        }
        Ok(Cow::Owned(bytes))
    }
}

/// Unpacks a row of whole numbers: bytes, shorts, or bits of which the first are highest (DNG 1.4, `BitsPerSample`).
fn unpack_codes(file: TiffReader<'_>, bits: u32, stored: &[u8], row: &mut [u16]) {
    match bits {
        8 => row.iter_mut().zip(stored).for_each(|(code, &byte)| *code = u16::from(byte)),
        16 => row.iter_mut().zip(stored.chunks_exact(2)).for_each(|(code, pair)| {
            let pair = [pair[0], pair[1]];
            *code = if file.is_big_endian() { u16::from_be_bytes(pair) } else { u16::from_le_bytes(pair) };
        }),
        bits => {
            let (mut held, mut n_held, mut bytes) = (0_u32, 0, stored.iter());
            for code in row {
                while n_held < bits {
                    held = held << 8 | u32::from(bytes.next().copied().unwrap_or(0));
                    n_held += 8;
                }
                n_held -= bits;
                *code = (held >> n_held & ((1 << bits) - 1)) as u16;
            }
        }
    }
}

/// Unpacks a row of floats: IEEE 754 of 16 and 32 bits, and of 24 with an exponent of 7 (DNG 1.4, chapter 2); what is not finite is 0.
fn unpack_floats(file: TiffReader<'_>, bits: u32, stored: &[u8], row: &mut [f32]) {
    let n = bits as usize / 8;
    for (value, bytes) in row.iter_mut().zip(stored.chunks_exact(n)) {
        let digits = |sum: u32, byte: &u8| sum << 8 | u32::from(*byte);
        let word = if file.is_big_endian() { bytes.iter().fold(0, digits) } else { bytes.iter().rev().fold(0, digits) };
        let float = match bits {
            16 => small_float(word, 5, 10),
            24 => small_float(word, 7, 16),
            _ => f32::from_bits(word),
        };
        *value = finite(float);
    }
}

fn finite(value: f32) -> f32 {
    if value.is_finite() { value } else { 0.0 }
}

/// Returns a float of a sign, so many bits of exponent and so many of fraction.
fn small_float(word: u32, exponent_bits: u32, fraction_bits: u32) -> f32 {
    let exponent = (word >> fraction_bits & ((1 << exponent_bits) - 1)) as i32;
    let fraction = (word & ((1 << fraction_bits) - 1)) as f32 / (1_u32 << fraction_bits) as f32;
    let bias = (1 << (exponent_bits - 1)) - 1;
    let sign = if word >> (exponent_bits + fraction_bits) & 1 == 1 { -1.0 } else { 1.0 };
    match exponent {
        0 => sign * fraction * 2.0_f32.powi(1 - bias),
        all if all == (1 << exponent_bits) - 1 => f32::NAN,
        exponent => sign * (1.0 + fraction) * 2.0_f32.powi(exponent - bias),
    }
}
