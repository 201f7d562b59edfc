//! The samples of a raw frame in a DNG file: strips or tiles, plain or as lossless JPEG.

use dioptric_files::memory;
use rayon::prelude::*;

use super::{
    lossless_jpeg,
    tags::{
        BITS_PER_SAMPLE, COLUMN_INTERLEAVE_FACTOR, COMPRESSION, IMAGE_LENGTH, IMAGE_WIDTH, PLANAR_CONFIGURATION,
        ROW_INTERLEAVE_FACTOR, ROWS_PER_STRIP, SAMPLE_FORMAT, SAMPLES_PER_PIXEL, STRIP_BYTE_COUNTS, STRIP_OFFSETS,
        SUB_TILE_BLOCK_SIZE, TILE_BYTE_COUNTS, TILE_LENGTH, TILE_OFFSETS, TILE_WIDTH,
    },
    tiff_reader::{Fields, TiffReader},
};

/// What a code takes while a frame is read, bytes: itself, its level and the sample of a plane.
const CODE_BYTES: u64 = 8;

/// Values of the tag `Compression`.
const PLAIN: usize = 1;
const LOSSLESS_JPEG: usize = 7;

/// The codes of a frame as they stand in the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Samples {
    pub(super) rows: usize,
    pub(super) columns: usize,
    /// Samples of a pixel, side by side.
    pub(super) n_planes: usize,
    pub(super) bits: u32,
    pub(super) codes: Vec<u16>,
}

/// How the codes of a frame are stored.
struct Storage<'a> {
    file: TiffReader<'a>,
    compression: usize,
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
}

/// Reads the codes of the frame of a directory.
///
/// What is taken of memory is bounded by the length of the file: plain samples must all be there, and a compressed one takes a bit
/// or more.
pub(super) fn read(file: TiffReader<'_>, fields: &Fields<'_>) -> Result<Samples, String> {
    let storage = Storage::new(file, fields)?;
    let Storage { rows, columns, n_planes, bits, .. } = storage;
    Ok(Samples { rows, columns, n_planes, bits, codes: storage.codes()? })
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
        let depth = match bits.first() {
            Some(&depth) if (8..=16).contains(&depth) && bits.iter().all(|bits| *bits == depth) => depth as u32,
            _ => return Err(format!("has {bits:?} bits a sample, expected from 8 to 16, the same for all planes")),
        };
        for (tag, expected, what) in [
            (SAMPLE_FORMAT, 1, "samples that are no whole numbers"),
            (PLANAR_CONFIGURATION, 1, "planes one after the other"),
            (ROW_INTERLEAVE_FACTOR, 1, "interleaved rows"),
            (COLUMN_INTERLEAVE_FACTOR, 1, "interleaved columns"),
            (SUB_TILE_BLOCK_SIZE, 1, "blocks within tiles"),
        ] {
            if let Some(other) = fields.whole(tag)?.into_iter().find(|value| *value != expected) {
                return Err(format!("has {what} (field {tag} is {other}), which is not read"));
            }
        }
        if ![PLAIN, LOSSLESS_JPEG].contains(&compression) {
            return Err(format!(
                "has compression {compression}, expected none (1) or lossless JPEG (7); a DNG converter makes such a file"
            ));
        }
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
        Ok(Self { file, compression, bits, n_planes, rows, columns, tile_rows, tile_columns, is_tiled, blocks })
    }

    fn codes(&self) -> Result<Vec<u16>, String> {
        let line = self.columns * self.n_planes;
        let bits_a_sample = if self.compression == PLAIN { self.bits as usize } else { 1 };
        let n_samples = self.rows.checked_mul(line).filter(|n| n / 8 * bits_a_sample <= self.file.n_bytes());
        let Some(n_samples) = n_samples else {
            return Err(format!(
                "states {} × {} pixels, more than its {} bytes can hold",
                self.columns,
                self.rows,
                self.file.n_bytes()
            ));
        };
        let mut codes = vec![0; n_samples];
        let n_across = self.columns.div_ceil(self.tile_columns);
        // One row of tiles after the other; the first reason counts, whatever the threads.
        let reasons: Vec<Result<(), String>> = codes
            .par_chunks_mut(self.tile_rows * line)
            .zip(self.blocks.par_chunks(n_across))
            .map(|(rows, blocks)| {
                let n_rows = rows.len() / line;
                for (number, block) in blocks.iter().enumerate() {
                    self.read_block(block, number * self.tile_columns, rows, n_rows)?;
                }
                Ok(())
            })
            .collect();
        reasons.into_iter().collect::<Result<(), _>>()?;
        Ok(codes)
    }

    /// Reads a strip or tile whose first column is given into the rows that it covers.
    fn read_block(&self, block: &[u8], first: usize, rows: &mut [u16], n_rows: usize) -> Result<(), String> {
        let line = self.columns * self.n_planes;
        let stored_line = self.tile_columns * self.n_planes;
        let stored_rows = if self.is_tiled { self.tile_rows } else { n_rows };
        let n = self.tile_columns.min(self.columns - first) * self.n_planes;
        let from = first * self.n_planes;
        let lines = rows.chunks_exact_mut(line).map(|row| &mut row[from..from + n]);
        if self.compression == LOSSLESS_JPEG {
            let n_stored = stored_rows.checked_mul(stored_line).ok_or("has tiles without end")?;
            let decoded =
                lossless_jpeg::decode(block, n_stored).map_err(|reason| format!("has samples that {reason}"))?;
            // However many rows and components these are: the samples of a tile follow one another.
            lines
                .zip(decoded.samples.chunks_exact(stored_line))
                .for_each(|(row, stored)| row.copy_from_slice(&stored[..n]));
            return Ok(());
        }
        let n_bytes = stored_line.checked_mul(self.bits as usize).ok_or("has tiles without end")?.div_ceil(8);
        if n_bytes.checked_mul(n_rows).is_none_or(|all| all > block.len()) {
            return Err(format!("has {} bytes in a strip or tile, expected {n_rows} rows of {n_bytes}", block.len()));
        }
        lines.zip(block.chunks_exact(n_bytes)).for_each(|(row, stored)| self.unpack(stored, row));
        Ok(())
    }

    /// Unpacks a row: bytes, shorts, or bits of which the first are highest (DNG 1.4, `BitsPerSample`).
    fn unpack(&self, stored: &[u8], row: &mut [u16]) {
        match self.bits {
            8 => row.iter_mut().zip(stored).for_each(|(code, &byte)| *code = u16::from(byte)),
            16 => row.iter_mut().zip(stored.chunks_exact(2)).for_each(|(code, pair)| {
                let pair = [pair[0], pair[1]];
                *code = if self.file.is_big_endian() { u16::from_be_bytes(pair) } else { u16::from_le_bytes(pair) };
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
}
