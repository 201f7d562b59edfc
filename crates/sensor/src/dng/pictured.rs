//! Tiles that are pictures of their own: JPEG with loss and JPEG XL, each by a crate.

use jxl_oxide::{AllocTracker, JxlImage};
use zune_core::{bytestream::ZCursor, colorspace::ColorSpace, options::DecoderOptions};
use zune_jpeg::JpegDecoder;

/// The pixels of a tile and the samples of each, as the file states them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Size {
    pub(super) rows: usize,
    pub(super) columns: usize,
    pub(super) n_planes: usize,
}

/// What a decoder may take for a sample beside its result, bytes: some floats of several stages.
const DECODER_BYTES: usize = 64;
/// Likewise for a picture of any size: groups of 256 × 256 pixels and tables.
const LEAST_DECODER_BYTES: usize = 64 << 20;

impl Size {
    fn check(self, (columns, rows, n_planes): (usize, usize, usize)) -> Result<(), String> {
        let found = Self { rows, columns, n_planes };
        if found == self {
            return Ok(());
        }
        let words = |size: Self| format!("{} × {} pixels of {} samples", size.columns, size.rows, size.n_planes);
        Err(format!("has a tile with a picture of {}, expected {}", words(found), words(self)))
    }

    fn n_samples(self) -> usize {
        self.rows * self.columns * self.n_planes
    }
}

/// Decodes a JPEG of 8 bits (DNG 1.4, compression 34892): planes as they are, or as its markers say they were turned into luma and chroma.
pub(super) fn jpeg(block: &[u8], size: Size) -> Result<Vec<u8>, String> {
    let unreadable = |reason: &dyn std::fmt::Debug| {
        let reason = format!("{reason:?}").lines().collect::<Vec<_>>().join(" ");
        format!("has a JPEG that cannot be decoded: {}", reason.trim_end())
    };
    let kind = if size.n_planes == 1 { ColorSpace::Luma } else { ColorSpace::RGB };
    let limits = DecoderOptions::default().set_max_width(size.columns).set_max_height(size.rows);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(block), limits.jpeg_set_out_colorspace(kind));
    decoder.decode_headers().map_err(|error| unreadable(&error))?;
    let info = decoder.info().ok_or_else(|| unreadable(&"no size"))?;
    size.check((info.width.into(), info.height.into(), info.components.into()))?;
    let samples = decoder.decode().map_err(|error| unreadable(&error))?;
    if samples.len() == size.n_samples() { Ok(samples) } else { Err(unreadable(&"planes of another kind")) }
}

/// Decodes a JPEG XL (DNG 1.7, compression 52546) to shares of its highest sample.
pub(super) fn jpeg_xl(block: &[u8], size: Size) -> Result<Vec<f32>, String> {
    let unreadable = |error: &dyn std::fmt::Display| format!("has a JPEG XL that cannot be decoded: {error}");
    let most_bytes = size.n_samples().saturating_mul(DECODER_BYTES).saturating_add(LEAST_DECODER_BYTES);
    let image = JxlImage::builder()
        // Samples of 16 bits in full.
        .force_wide_buffers(true)
        .alloc_tracker(AllocTracker::with_limit(most_bytes))
        .read(block)
        .map_err(|error| unreadable(&error))?;
    let n_planes = if image.pixel_format().is_grayscale() { 1 } else { 3 };
    size.check((image.width() as usize, image.height() as usize, n_planes))?;
    let picture = image.render_frame(0).map_err(|error| unreadable(&error))?;
    let mut stream = picture.stream_no_alpha();
    let mut samples = vec![0.0; size.n_samples()];
    let n = stream.write_to_buffer(&mut samples);
    if stream.channels() as usize != size.n_planes || n != samples.len() {
        return Err(unreadable(&format!("it has {n} samples of {} planes", stream.channels())));
    }
    Ok(samples)
}
