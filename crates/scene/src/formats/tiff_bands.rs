//! The samples of TIFF pages as planes of numbers, whatever they are marked as.

use std::{
    fs::File,
    io::{BufReader, Read, Seek, SeekFrom},
    path::Path,
};

use ndarray::Array2;
use tiff::decoder::{Decoder, DecodingResult, Limits};

use super::{
    tiff_directory::Directory,
    tiff_page::{Marked, Page},
};

/// The tag of what samples are marked as.
const PHOTOMETRIC: u16 = 262;

/// A TIFF file whose pages of red, green and blue are marked as gray.
///
/// What decodes pages of colors leaves out the samples that are none: a near infrared, further bands.
pub(super) struct AsGray {
    file: File,
    at: u64,
    /// Where two bytes of the file are others, in their order.
    marks: Vec<(u64, [u8; 2])>,
}

impl AsGray {
    /// Opens the file again in which the pages were found at these places.
    pub(super) fn open(path: &Path, pages: &[(Page, u64)]) -> std::io::Result<Decoder<BufReader<Self>>> {
        let mut file = File::open(path)?;
        let mut marks = vec![];
        for (page, at) in pages {
            if page.marked == Marked::Rgb && page.has_plain_samples() {
                let directory = Directory::read(&mut file, *at)?;
                // 1 is gray, 0 being black.
                marks.extend(directory.place_of(PHOTOMETRIC).map(|place| (place, directory.bytes_of(1))));
            }
        }
        marks.sort_unstable();
        file.rewind()?;
        let mut limits = Limits::default();
        limits.decoding_buffer_size = 4 << 30;
        let decoder = Decoder::new(BufReader::new(Self { file, at: 0, marks })).map_err(std::io::Error::other)?;
        Ok(decoder.with_limits(limits))
    }
}

impl Read for AsGray {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let n = self.file.read(buffer)?;
        let (from, end) = (self.at, self.at + n as u64);
        let first = self.marks.partition_point(|(at, _)| at + 2 <= from);
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
