//! Pictures read at fewer pixels than they have: means of blocks, a row at a time where the format allows it.

use std::{fs::File, io::BufReader, path::Path};

use dioptric_files::memory;
use image::{DynamicImage, ImageBuffer, ImageError, ImageFormat};
use png::{BitDepth, ColorType, Decoder, Transformations};

use crate::{format_of, read_within, size_of};

/// How codes of 16 bits stand for light, in which blocks are averaged.
pub struct Curve<'a> {
    /// Returns the light of a code.
    pub to_light: &'a dyn Fn(u16) -> f64,
    /// Returns the code of light.
    pub to_code: &'a dyn Fn(f64) -> u16,
}

/// Reads a picture as `columns` × `rows` means of blocks of its pixels, as codes of 16 bits; opacity is left out. PNG that is not interlaced takes
/// no more memory than the result and a row, other formats their samples too.
///
/// # Errors
/// When the file cannot be read, is no picture, has fewer pixels, or takes more memory than it may.
pub fn read_reduced(
    path: &Path,
    (columns, rows): (usize, usize),
    curve: &Curve<'_>,
) -> Result<DynamicImage, ImageError> {
    let from = size_of(path)?;
    if columns == 0 || rows == 0 || columns > from.0 || rows > from.1 {
        let reason = format!("{} × {} pixels, expected {columns} × {rows} at least", from.0, from.1);
        return Err(ImageError::IoError(std::io::Error::other(reason)));
    }
    // Sums and codes of the means, and a row of the file as bytes and as codes.
    let taken = 30_u64.saturating_mul(columns as u64).saturating_mul(rows as u64);
    let taken = taken.saturating_add(16_u64.saturating_mul(from.0 as u64));
    memory::check(taken, std::fs::metadata(path)?.len())
        .map_err(|error| ImageError::IoError(std::io::Error::other(error)))?;
    let mut means = Means::new(from, (columns, rows), curve);
    let is_png = format_of(path)? == Some(ImageFormat::Png);
    if !is_png || !add_png(path, &mut means)? {
        // Rows of 16 bits are made of one at a time.
        let picture = read_within(path, 0)?;
        add_rows(&picture, &mut means);
    }
    Ok(means.into_picture())
}

/// Adds the rows of a PNG file; whether it has them one after the other.
fn add_png(path: &Path, means: &mut Means<'_>) -> Result<bool, ImageError> {
    let wrong = |error: png::DecodingError| ImageError::IoError(std::io::Error::other(error));
    let mut decoder = Decoder::new(BufReader::new(File::open(path)?));
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(wrong)?;
    if reader.info().interlaced {
        return Ok(false);
    }
    let (color, depth) = reader.output_color_type();
    let is_gray = matches!(color, ColorType::Grayscale | ColorType::GrayscaleAlpha);
    let n_samples = color.samples();
    let mut codes = Vec::new();
    let mut y = 0;
    while let Some(row) = reader.next_row().map_err(wrong)? {
        codes.clear();
        match depth {
            BitDepth::Sixteen => {
                codes.extend(row.data().as_chunks::<2>().0.iter().map(|&code| u16::from_be_bytes(code)));
            }
            _ => codes.extend(row.data().iter().map(|&code| 257 * u16::from(code))),
        }
        let pixels = codes.chunks_exact(n_samples);
        means.add(y, pixels.map(|of| if is_gray { [of[0]; 3] } else { [of[0], of[1], of[2]] }));
        y += 1;
    }
    Ok(true)
}

/// Adds the rows of a picture in memory.
fn add_rows(picture: &DynamicImage, means: &mut Means<'_>) {
    let (width, height) = (picture.width(), picture.height());
    for y in 0..height {
        let row = picture.crop_imm(0, y, width, 1).into_rgb16();
        means.add(y as usize, row.pixels().map(|pixel| pixel.0));
    }
}

/// Sums of light over blocks.
struct Means<'a> {
    from: (usize, usize),
    to: (usize, usize),
    light: Vec<f64>,
    curve: &'a Curve<'a>,
    sums: Vec<[f64; 3]>,
    n: Vec<u32>,
}

impl<'a> Means<'a> {
    fn new(from: (usize, usize), to: (usize, usize), curve: &'a Curve<'a>) -> Self {
        let light = (0..=u16::MAX).map(curve.to_light).collect();
        let n_blocks = to.0 * to.1;
        Self { from, to, light, curve, sums: vec![[0.0; 3]; n_blocks], n: vec![0; n_blocks] }
    }

    /// Adds a row of pixels.
    fn add(&mut self, y: usize, row: impl Iterator<Item = [u16; 3]>) {
        let first = y * self.to.1 / self.from.1 * self.to.0;
        for (x, codes) in row.enumerate() {
            let block = first + x * self.to.0 / self.from.0;
            self.n[block] += 1;
            for (sum, code) in self.sums[block].iter_mut().zip(codes) {
                *sum += self.light[usize::from(code)];
            }
        }
    }

    fn into_picture(self) -> DynamicImage {
        let code = |(sum, n): ([f64; 3], u32)| sum.map(|sum| (self.curve.to_code)(sum / f64::from(n.max(1))));
        let codes = self.sums.into_iter().zip(self.n).flat_map(code).collect();
        let picture = ImageBuffer::from_raw(self.to.0 as u32, self.to.1 as u32, codes);
        DynamicImage::ImageRgb16(picture.expect("three codes a block"))
    }
}
