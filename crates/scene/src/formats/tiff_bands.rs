//! The samples of TIFF pages as planes of numbers, whatever they are marked as.

use std::{
    fs::File,
    io::{BufReader, Read, Seek, SeekFrom},
    path::Path,
};

use ndarray::Array2;
use tiff::decoder::{Decoder, DecodingResult, Limits};

use super::{tiff_directory::Directory, tiff_page::Page};

/// The tag of what samples are marked as.
const PHOTOMETRIC: u16 = 262;

/// The tag of what kind a page is.
const KIND: u16 = 254;
/// The mark, and the bit of the kind, of depth maps (DNG 1.5).
const DEPTH_MAP: u64 = 51_177;
const DEPTH_MAP_KIND: u64 = 8;

/// A TIFF file whose pages are marked as gray, 0 being black, so that samples are decoded as they stand.
///
/// What decodes pages of colors leaves out the samples that are none: a near infrared, further bands. It turns round what is counted
/// from white, and takes no depth maps.
pub(super) struct AsGray {
    file: File,
    at: u64,
    /// Where bytes of the file are others, in their order.
    marks: Vec<(u64, Vec<u8>)>,
}

impl AsGray {
    /// Opens a file, and returns the places of the directories of its depth maps, which are marked as gray.
    pub(super) fn with_depth_maps(path: &Path, most: usize) -> std::io::Result<(BufReader<Self>, Vec<u64>)> {
        let mut file = File::open(path)?;
        let mut maps = vec![];
        // What is broken is named by what decodes it.
        let pages = Directory::all(&mut file, most).unwrap_or_default();
        for (at, directory) in &pages {
            if is_depth_map(&mut file, directory)? {
                maps.push(*at);
            }
        }
        maps.extend(maps_below(&mut file, &pages).into_iter().map(|(at, _)| at));
        let reader = Self::marked(file, maps.iter().copied(), most)?;
        Ok((reader, maps))
    }

    /// Opens the file again in which the pages, up to so many, were found at these places.
    pub(super) fn open(path: &Path, pages: &[(Page, u64)], most: usize) -> std::io::Result<Decoder<BufReader<Self>>> {
        let plain = pages.iter().filter(|(page, _)| page.has_plain_samples()).map(|(_, at)| *at);
        let reader = Self::marked(File::open(path)?, plain, most)?;
        let mut limits = Limits::default();
        limits.decoding_buffer_size = 4 << 30;
        Ok(Decoder::new(reader).map_err(std::io::Error::other)?.with_limits(limits))
    }

    /// Marks pages at these places as gray, and puts depth maps that lie below pages behind the last.
    fn marked(mut file: File, directories: impl Iterator<Item = u64>, most: usize) -> std::io::Result<BufReader<Self>> {
        let mut marks = vec![];
        for at in directories {
            let directory = Directory::read(&mut file, at)?;
            // 1 is gray, 0 being black.
            marks.extend(directory.place_of(PHOTOMETRIC).map(|place| (place, directory.bytes_of(1))));
        }
        let pages = Directory::all(&mut file, most).unwrap_or_default();
        let below = maps_below(&mut file, &pages);
        let before = pages.last().into_iter().chain(&below);
        let after = below.iter().map(|(at, _)| *at).chain([0]);
        marks.extend(before.zip(after).filter(|_| !below.is_empty()).map(|((_, own), next)| own.link_to(next)));
        marks.sort_unstable();
        file.rewind()?;
        Ok(BufReader::new(Self { file, at: 0, marks }))
    }
}

/// Whether a page is marked as a depth map.
fn is_depth_map(file: &mut File, directory: &Directory) -> std::io::Result<bool> {
    let mark = directory.number_of(file, PHOTOMETRIC)?;
    let kind = directory.number_of(file, KIND)?.unwrap_or(0);
    Ok(mark == Some(DEPTH_MAP) || kind & DEPTH_MAP_KIND != 0)
}

/// Returns the depth maps in directories below those of pages; what is broken is none.
fn maps_below(file: &mut File, pages: &[(u64, Directory)]) -> Vec<(u64, Directory)> {
    let mut maps: Vec<(u64, Directory)> = vec![];
    for (_, page) in pages {
        for at in page.below(file).unwrap_or_default() {
            let is_new = pages.iter().chain(&maps).all(|(own, _)| *own != at);
            let Some(directory) = Directory::read(file, at).ok().filter(|_| is_new) else { continue };
            if is_depth_map(file, &directory).unwrap_or(false) {
                maps.push((at, directory));
            }
        }
    }
    maps
}

impl Read for AsGray {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let n = self.file.read(buffer)?;
        let (from, end) = (self.at, self.at + n as u64);
        let first = self.marks.partition_point(|(at, bytes)| at + bytes.len() as u64 <= from);
        for (at, bytes) in self.marks[first..].iter().take_while(|(at, _)| *at < end) {
            for (place, byte) in (*at..).zip(bytes) {
                if (from..end).contains(&place) {
                    buffer[(place - from) as usize] = *byte;
                }
            }
        }
        self.at = end;
        Ok(n)
    }
}

impl Seek for AsGray {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        self.at = self.file.seek(to)?;
        Ok(self.at)
    }
}

/// Returns the planes of the page that a decoder stands at, one a sample.
pub(super) fn planes_of<R: Read + Seek>(decoder: &mut Decoder<R>, page: &Page) -> tiff::TiffResult<Vec<Array2<f32>>> {
    let mut result = DecodingResult::U8(vec![]);
    let layout = decoder.read_image_to_buffer(&mut result)?;
    let (columns, rows) = (page.size.0 as usize, page.size.1 as usize);
    let is_planar = layout.planes > 1;
    let samples = floats(result);
    let n = page.n_samples;
    if samples.len() < rows * columns * n {
        let reason = std::io::Error::new(std::io::ErrorKind::UnexpectedEof, "fewer samples than the page has");
        return Err(tiff::TiffError::IoError(reason));
    }
    let plane = |sample: usize| {
        Array2::from_shape_fn((rows, columns), |(row, column)| {
            let at = row * columns + column;
            if is_planar { samples[sample * rows * columns + at] } else { samples[at * n + sample] }
        })
    };
    Ok((0..n).map(plane).collect())
}

fn floats(result: DecodingResult) -> Vec<f32> {
    match result {
        DecodingResult::U8(v) => v.into_iter().map(f32::from).collect(),
        DecodingResult::U16(v) => v.into_iter().map(f32::from).collect(),
        DecodingResult::U32(v) => v.into_iter().map(|v| v as f32).collect(),
        DecodingResult::U64(v) => v.into_iter().map(|v| v as f32).collect(),
        DecodingResult::I8(v) => v.into_iter().map(f32::from).collect(),
        DecodingResult::I16(v) => v.into_iter().map(f32::from).collect(),
        DecodingResult::I32(v) => v.into_iter().map(|v| v as f32).collect(),
        DecodingResult::I64(v) => v.into_iter().map(|v| v as f32).collect(),
        DecodingResult::F16(v) => v.into_iter().map(f32::from).collect(),
        DecodingResult::F32(v) => v,
        DecodingResult::F64(v) => v.into_iter().map(|v| v as f32).collect(),
    }
}
