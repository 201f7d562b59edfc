//! The numbers of an ENVI file, read a few lines at a time.

use std::{
    fs::File,
    io::{Read, Seek, SeekFrom},
    ops::Range,
    path::PathBuf,
};

use dioptric_spectrum::WavelengthGrid;
use ndarray::Array2;
use rayon::prelude::*;

use super::{
    envi_header::{DataType, EnviHeader, Interleave},
    no_data::{Mended, mend_rows},
    reading::NoData,
    reduced::{block_of, start_of},
    stated::name_of,
    unusable::{check_made, unreadable},
};
use crate::SceneError;

/// Bytes of the file, and of its numbers as floats, that are in memory at a time; a line of the wanted bands is at least.
const AT_ONCE_BYTES: usize = 8 << 20;

/// What is wanted of a cube.
#[derive(Clone)]
pub(super) struct Wanted<'a> {
    /// The good bands of the file by ascending wavelength.
    pub(super) order: &'a [usize],
    /// For each wanted band its places in `order`, with weights.
    pub(super) weights: &'a [Vec<(usize, f64)>],
    pub(super) grid: &'a WavelengthGrid,
    /// The rows and the columns of the file that are wanted.
    pub(super) window: (Range<usize>, Range<usize>),
    /// As how many rows and columns: as many, or fewer.
    pub(super) size: (usize, usize),
    pub(super) choice: NoData,
}

/// What makes light or reflectances of the numbers of each band.
pub(super) enum Meaning {
    /// Light: a factor a band.
    Light(Vec<f64>),
    /// A reflectance: a factor.
    Reflectance(f64),
    /// A reflectance between cubes of a perfect white and of no light, and a factor.
    Between(Box<[EnviFile; 2]>, f64),
}

/// A header, and where its numbers are.
pub(super) struct EnviFile {
    pub(super) header_path: PathBuf,
    pub(super) data_path: PathBuf,
    pub(super) header: EnviHeader,
    pub(super) wavelengths_nm: Vec<f64>,
    pub(super) notes: Vec<String>,
}

/// The bands of a file that are needed, read a few lines at a time.
struct Lines<'a> {
    of: &'a EnviFile,
    data: File,
    /// The bands, ascending.
    needed: Vec<usize>,
    meaning: &'a Meaning,
    /// The needed bands of a perfect white and of no light.
    references: Option<[Vec<Array2<f32>>; 2]>,
    /// The columns that are wanted.
    columns: Range<usize>,
}

impl<'a> Lines<'a> {
    fn open(of: &'a EnviFile, wanted: &Wanted<'_>, meaning: &'a Meaning) -> Result<Self, SceneError> {
        let mut needed: Vec<usize> = wanted.weights.iter().flatten().map(|(place, _)| wanted.order[*place]).collect();
        needed.sort_unstable();
        needed.dedup();
        let references = match meaning {
            Meaning::Between(pair, _) => {
                Some([pair[0].lines(&needed, of.header.rows)?, pair[1].lines(&needed, of.header.rows)?])
            }
            _ => None,
        };
        let data = File::open(&of.data_path).map_err(|error| unreadable(&of.data_path, error))?;
        Ok(Self { of, data, needed, meaning, references, columns: wanted.window.1.clone() })
    }

    /// Reads lines of the needed bands, and makes light or reflectances of their numbers.
    fn read(&mut self, lines: Range<usize>) -> Result<Vec<Vec<f32>>, SceneError> {
        let mut raw = self.of.read(&mut self.data, &self.needed, lines.clone())?;
        let (of, columns) = (self.of, self.of.header.columns);
        raw.par_iter_mut().zip(&self.needed).enumerate().for_each(|(index, (samples, &band))| match self.meaning {
            Meaning::Light(factors) => of.convert(samples, band, factors[band]),
            Meaning::Reflectance(factor) => of.convert(samples, band, *factor),
            Meaning::Between(_, factor) => {
                of.convert(samples, band, 1.0);
                let Some([white, dark]) = &self.references else { return };
                for (at, sample) in samples.iter_mut().enumerate() {
                    let (row, column) = (lines.start + at / columns, at % columns);
                    let of = |lines: &[Array2<f32>]| lines[index][(row % lines[index].nrows(), column)];
                    let (white, dark) = (of(white), of(dark));
                    *sample = if white > dark { (*sample - dark) / (white - dark) * *factor as f32 } else { f32::NAN };
                }
            }
        });
        if self.columns.len() < columns {
            raw.par_iter_mut().for_each(|samples| {
                let lines = samples.chunks(columns);
                *samples = lines.flat_map(|line| &line[self.columns.clone()]).copied().collect();
            });
        }
        Ok(raw)
    }

    /// Puts the sum of bands, by their places in `order`, with weights, into a part of a plane.
    fn sum(&self, raw: &[Vec<f32>], order: &[usize], weights: &[(usize, f64)], part: &mut [f32]) {
        let band = |at: usize| raw[self.needed.binary_search(&order[at]).expect("the band was asked for")].as_slice();
        if let [(only, 1.0)] = weights[..] {
            part.copy_from_slice(band(only));
            return;
        }
        let bands: Vec<(&[f32], f64)> = weights.iter().map(|&(at, weight)| (band(at), weight)).collect();
        for (at, sample) in part.iter_mut().enumerate() {
            *sample = bands.iter().map(|(samples, weight)| weight * f64::from(samples[at])).sum::<f64>() as f32;
        }
    }
}

impl EnviFile {
    /// Reads the planes that are sums of bands (by their places in `order`, with weights), of means over blocks of samples, and puts light
    /// in the place of what is none.
    pub(super) fn planes(
        &self,
        wanted: &Wanted<'_>,
        meaning: &Meaning,
    ) -> Result<(Vec<Array2<f32>>, Mended), SceneError> {
        let &Wanted { weights, ref window, size: (rows, columns), .. } = wanted;
        // What is wanted of it, and a few lines at a time.
        let bytes = [rows, columns, weights.len(), 4].iter().fold(1_u64, |n, &side| n.saturating_mul(side as u64));
        check_made(&self.data_path, bytes.saturating_add(2 * AT_ONCE_BYTES as u64))?;
        let lines = Lines::open(self, wanted, meaning)?;
        let is_whole = (rows, columns) == (window.0.len(), window.1.len());
        let (planes, mended) = if is_whole { self.whole(lines, wanted)? } else { self.means(lines, wanted)? };
        let mended = mended.checked(&self.header_path).map_err(|error| match meaning {
            Meaning::Between(pair, _) => {
                let (white, dark) = (name_of(&pair[0].header_path), name_of(&pair[1].header_path));
                unreadable(
                    &self.header_path,
                    format!("{white} is nowhere brighter than {dark}: expected them the other way round"),
                )
            }
            _ => error,
        })?;
        Ok((planes, mended))
    }

    /// Reads the planes with all samples of the window.
    fn whole(&self, mut lines: Lines<'_>, wanted: &Wanted<'_>) -> Result<(Vec<Array2<f32>>, Mended), SceneError> {
        let &Wanted { order, weights, grid, ref window, size, choice } = wanted;
        let mut planes: Vec<Array2<f32>> = weights.iter().map(|_| Array2::zeros(size)).collect();
        for at in self.chunks(window.0.clone(), lines.needed.len()) {
            let raw = lines.read(at.clone())?;
            // Counted from the first line of the window.
            let rows = at.start - window.0.start..at.end - window.0.start;
            planes.par_iter_mut().zip(weights).for_each(|(plane, weights)| {
                let mut part = plane.slice_mut(ndarray::s![rows.clone(), ..]);
                let part = part.as_slice_mut().expect("whole rows of a new plane follow each other");
                lines.sum(&raw, order, weights, part);
            });
        }
        let mended = mend_rows(&self.header_path, grid, &mut planes, choice, window.0.start)?;
        Ok((planes, mended))
    }

    /// Reads the planes of means over blocks of the window's samples.
    fn means(&self, mut lines: Lines<'_>, wanted: &Wanted<'_>) -> Result<(Vec<Array2<f32>>, Mended), SceneError> {
        let &Wanted { order, weights, grid, ref window, size: (rows, columns), choice } = wanted;
        let (own_rows, own_columns) = (window.0.len(), window.1.len());
        let mut planes: Vec<Array2<f32>> = weights.iter().map(|_| Array2::zeros((rows, columns))).collect();
        let mut mended = Mended::default();
        for at in self.chunks(window.0.clone(), lines.needed.len()) {
            let raw = lines.read(at.clone())?;
            let of_weights = |weights: &Vec<(usize, f64)>| {
                let mut part = Array2::zeros((at.len(), own_columns));
                lines.sum(&raw, order, weights, part.as_slice_mut().expect("a new plane is in standard order"));
                part
            };
            let mut parts: Vec<Array2<f32>> = weights.par_iter().map(of_weights).collect();
            mended.add(mend_rows(&self.header_path, grid, &mut parts, choice, at.start)?);
            let first = at.start - window.0.start;
            planes.par_iter_mut().zip(&parts).for_each(|(plane, part)| {
                for (line, samples) in part.rows().into_iter().enumerate() {
                    let row = block_of(first + line, rows, own_rows);
                    for (column, sample) in samples.iter().enumerate() {
                        plane[(row, block_of(column, columns, own_columns))] += sample;
                    }
                }
            });
        }
        let side = |block: usize, n: usize, own: usize| start_of(block + 1, n, own) - start_of(block, n, own);
        for plane in &mut planes {
            for ((row, column), sum) in plane.indexed_iter_mut() {
                *sum /= (side(row, rows, own_rows) * side(column, columns, own_columns)) as f32;
            }
        }
        Ok((planes, mended))
    }

    /// Returns a reference's lines: as many as the cube has, or else their mean.
    fn lines(&self, bands: &[usize], cube_rows: usize) -> Result<Vec<Array2<f32>>, SceneError> {
        let (rows, columns) = (self.header.rows, self.header.columns);
        let is_whole = rows == cube_rows;
        let mut sums = vec![Array2::<f64>::zeros((if is_whole { rows } else { 1 }, columns)); bands.len()];
        let mut file = File::open(&self.data_path).map_err(|error| unreadable(&self.data_path, error))?;
        for lines in self.chunks(0..rows, bands.len()) {
            let mut raw = self.read(&mut file, bands, lines.clone())?;
            for ((samples, &band), sum) in raw.iter_mut().zip(bands).zip(&mut sums) {
                self.convert(samples, band, 1.0);
                for (at, sample) in samples.iter().enumerate() {
                    let row = if is_whole { lines.start + at / columns } else { 0 };
                    sum[(row, at % columns)] += f64::from(*sample);
                }
            }
        }
        let share = if is_whole { 1.0 } else { 1.0 / rows as f64 };
        Ok(sums.into_iter().map(|sum| sum.mapv(|v| (v * share) as f32)).collect())
    }

    /// Makes what the header says of numbers as they are stored, and a factor more; those to be ignored become no numbers.
    fn convert(&self, samples: &mut [f32], band: usize, factor: f64) {
        let of = |list: &Option<Vec<f64>>, usual: f64| list.as_ref().map_or(usual, |list| list[band]);
        let (gain, offset) = (of(&self.header.gains, 1.0), of(&self.header.offsets, 0.0));
        let ignored = self.header.ignored.map(|v| v as f32);
        for sample in samples {
            let is_ignored = ignored.is_some_and(|ignored| *sample == ignored);
            *sample = if is_ignored { f32::NAN } else { ((f64::from(*sample) * gain + offset) * factor) as f32 };
        }
    }

    /// Returns ranges of these lines that fit into memory.
    fn chunks(&self, rows: Range<usize>, n_bands: usize) -> impl Iterator<Item = Range<usize>> + use<> {
        let line = self.header.columns
            * (4 * n_bands).max(match self.header.interleave {
                Interleave::Bsq => 1,
                Interleave::Bil | Interleave::Bip => self.header.bands * self.header.data_type.bytes(),
            });
        let step = (AT_ONCE_BYTES / line).max(1);
        rows.clone().step_by(step).map(move |first| first..(first + step).min(rows.end))
    }

    /// Bytes of a frame with what is skipped before and after it.
    pub(super) fn frame_bytes(&self) -> u64 {
        let (rows, columns, bands) = (self.header.rows as u64, self.header.columns as u64, self.header.bands as u64);
        let samples = match self.header.interleave {
            Interleave::Bsq => rows.saturating_mul(columns),
            Interleave::Bil | Interleave::Bip => columns.saturating_mul(bands),
        };
        let [before, after] = self.header.frame_offsets;
        samples.saturating_mul(self.header.data_type.bytes() as u64).saturating_add(before).saturating_add(after)
    }

    pub(super) fn n_frames(&self) -> u64 {
        match self.header.interleave {
            Interleave::Bsq => self.header.bands as u64,
            Interleave::Bil | Interleave::Bip => self.header.rows as u64,
        }
    }

    /// Reads lines of bands as they are stored.
    fn read(&self, file: &mut File, bands: &[usize], lines: Range<usize>) -> Result<Vec<Vec<f32>>, SceneError> {
        let (size, columns) = (self.header.data_type.bytes(), self.header.columns);
        let start =
            |frame: usize| self.header.offset + frame as u64 * self.frame_bytes() + self.header.frame_offsets[0];
        let mut bytes_at = |from: u64, n: usize| -> Result<Vec<u8>, SceneError> {
            let mut bytes = vec![0; n];
            file.seek(SeekFrom::Start(from))
                .and_then(|_| file.read_exact(&mut bytes))
                .map_err(|error| unreadable(&self.data_path, error))?;
            Ok(bytes)
        };
        let floats = |bytes: &[u8]| -> Vec<f32> {
            numbers(bytes, (0, size), bytes.len() / size, self.header.data_type, self.header.is_big_endian)
        };
        let line_bytes = columns * size;
        match self.header.interleave {
            Interleave::Bsq => {
                let of_band = |&band: &usize| {
                    Ok(floats(&bytes_at(start(band) + (lines.start * line_bytes) as u64, lines.len() * line_bytes)?))
                };
                bands.iter().map(of_band).collect()
            }
            Interleave::Bil => {
                let mut result = vec![Vec::with_capacity(lines.len() * columns); bands.len()];
                for line in lines {
                    // Most bands are read in one go, few each by itself.
                    let whole = match 4 * bands.len() >= self.header.bands {
                        true => Some(bytes_at(start(line), self.header.bands * line_bytes)?),
                        false => None,
                    };
                    for (samples, &band) in result.iter_mut().zip(bands) {
                        match &whole {
                            Some(bytes) => samples.extend(floats(&bytes[band * line_bytes..(band + 1) * line_bytes])),
                            None => {
                                samples.extend(floats(&bytes_at(start(line) + (band * line_bytes) as u64, line_bytes)?))
                            }
                        }
                    }
                }
                Ok(result)
            }
            Interleave::Bip => {
                let stride = self.header.bands * size;
                let n = lines.len() * columns;
                let [before, after] = self.header.frame_offsets;
                let mut bytes = Vec::new();
                if before + after == 0 {
                    bytes = bytes_at(start(lines.start), n * stride)?;
                } else {
                    for line in lines {
                        bytes.extend(bytes_at(start(line), columns * stride)?);
                    }
                }
                let (kind, is_big) = (self.header.data_type, self.header.is_big_endian);
                let of_band = |&band: &usize| numbers(&bytes, (band * size, stride), n, kind, is_big);
                Ok(bands.par_iter().map(of_band).collect())
            }
        }
    }
}

/// Returns `n` numbers, the first at a place of the bytes and each so many bytes behind the one before.
fn numbers(bytes: &[u8], (first, stride): (usize, usize), n: usize, kind: DataType, is_big_endian: bool) -> Vec<f32> {
    /// One loop a type and order, so that it holds no other choice.
    fn all<const N: usize>(bytes: &[u8], at: (usize, usize), n: usize, of: impl Fn([u8; N]) -> f32) -> Vec<f32> {
        let number = |i: usize| {
            let from = at.0 + i * at.1;
            of(bytes[from..from + N].try_into().expect("a slice of N bytes"))
        };
        (0..n).map(number).collect()
    }
    let at = (first, stride);
    macro_rules! of {
        ($type:ty, $to:expr) => {
            if is_big_endian {
                all(bytes, at, n, |b| $to(<$type>::from_be_bytes(b)))
            } else {
                all(bytes, at, n, |b| $to(<$type>::from_le_bytes(b)))
            }
        };
    }
    match kind {
        DataType::U8 => of!(u8, f32::from),
        DataType::I16 => of!(i16, f32::from),
        DataType::U16 => of!(u16, f32::from),
        DataType::I32 => of!(i32, |v| v as f32),
        DataType::U32 => of!(u32, |v| v as f32),
        DataType::F32 => of!(f32, |v| v),
        DataType::F64 => of!(f64, |v| v as f32),
        DataType::I64 => of!(i64, |v| v as f32),
        DataType::U64 => of!(u64, |v| v as f32),
    }
}
