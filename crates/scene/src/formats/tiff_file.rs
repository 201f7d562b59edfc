//! TIFF files of numbers: stacks of pages, many samples a pixel, floats and signed numbers.

use std::{fs::File, io::BufReader, path::Path};

use ndarray::Array2;
use serde_json::Value;
use tiff::{
    decoder::{Decoder, DecodingResult, Limits},
    tags::Tag,
};

use super::{
    stated::{name_of, note_of, short},
    unusable::{check_memory, unreadable},
};
use crate::SceneError;

/// Pages of a file.
const LIMIT_PAGES: usize = 10_000;
/// The name of a page.
const PAGE_NAME: Tag = Tag::Unknown(285);
/// Tags that say how samples lie in the file, or what changes nothing: from sizes and strips to who made it when.
const HARMLESS: [u16; 45] = [
    254, 255, 256, 257, 258, 259, 262, 263, 266, 269, 270, 271, 272, 273, 277, 278, 279, 282, 283, 284, 285, 288, 289,
    292, 293, 296, 297, 305, 306, 315, 316, 317, 320, 322, 323, 324, 325, 338, 339, 347, 530, 531, 532, 33432, 42113,
];

/// What a TIFF file holds.
pub(super) enum TiffFile {
    /// One page of gray or of colors in whole numbers, which is a picture.
    Picture(PageWords),
    /// Linear red, green and blue: a page of floats.
    Linear([Array2<f32>; 3], PageWords),
    /// Planes of numbers.
    Stack(TiffStack),
}

/// What the first page says besides its numbers.
#[derive(Clone, Debug, Default)]
pub(super) struct PageWords {
    /// The number that stands for none.
    pub(super) no_data: Option<f64>,
    /// Whether 0 is white, so that decoded samples are counted from there.
    is_white_zero: bool,
    /// Its description, where nothing took it.
    description: Option<String>,
    /// What of the file is not used.
    pub(super) notes: Vec<String>,
}

impl PageWords {
    /// Makes what stands for no number no number.
    pub(super) fn ignore(&self, plane: &mut Array2<f32>) {
        if let Some(none) = self.no_data.map(|v| v as f32) {
            plane.mapv_inplace(|v| if v == none { f32::NAN } else { v });
        }
    }

    /// Returns decoded samples, whose largest is `top`, to the numbers of the file: what stands for none becomes no number.
    pub(super) fn undo(&self, plane: &mut Array2<f32>, top: f32) {
        if self.is_white_zero {
            plane.mapv_inplace(|v| top - v);
        }
        self.ignore(plane);
    }

    /// Returns what of a file of depth is not used, its description among it.
    pub(super) fn notes_of_depth(&self, path: &Path) -> Vec<String> {
        let mut notes = self.notes.clone();
        // Writers put the shape of the array there.
        let says = |text: &&String| !(text.starts_with("{\"shape\":") || text.starts_with("ImageJ="));
        let described = self.description.as_ref().filter(says);
        notes.extend(described.map(|text| format!("{}: its description '{}' is not used", name_of(path), short(text))));
        notes
    }
}

/// The planes of a stack.
pub(super) struct TiffStack {
    pub(super) planes: Vec<Array2<f32>>,
    /// The wavelengths that the file states, nm.
    pub(super) wavelengths_nm: Option<Vec<f64>>,
    /// The largest code of whole numbers.
    pub(super) top: Option<f64>,
    pub(super) page: PageWords,
}

/// Reads a TIFF file; a picture is left to the reader of pictures.
///
/// # Errors
/// When it is none, is truncated or too large, or its pages differ in size.
pub(super) fn read_tiff(path: &Path) -> Result<TiffFile, SceneError> {
    let wrong = |reason: String| unreadable(path, reason);
    let broken = |error: tiff::TiffError| unreadable(path, error.to_string().replace('\n', " "));
    let file = File::open(path).map_err(|error| unreadable(path, error))?;
    let length = file.metadata().map_err(|error| unreadable(path, error))?.len();
    let mut limits = Limits::default();
    limits.decoding_buffer_size = 4 << 30;
    let mut decoder = Decoder::new(BufReader::new(file)).map_err(broken)?.with_limits(limits);
    let mut pages: Vec<Page> = vec![];
    let (mut bytes, mut unused, mut unknown) = (0, vec![], vec![]);
    for index in 1.. {
        let page = Page::of(&mut decoder, index - 1).map_err(broken)?;
        bytes += page.bytes();
        // Its numbers as they stand, and as single floats.
        check_memory(path, bytes.saturating_mul(2), length)?;
        if index > LIMIT_PAGES {
            return Err(wrong(format!("it has more than {LIMIT_PAGES} pages")));
        }
        if page.has_inks {
            return Err(wrong(
                "it holds inks (CMYK), expected gray or red, green and blue; convert it to sRGB".to_owned(),
            ));
        }
        unknown.extend(page.unknown.iter().map(ToString::to_string));
        let is_like = pages.first().is_none_or(|first| first.size == page.size && first.n_samples == page.n_samples);
        if page.is_reduced || (!is_like && !pages[0].is_stack()) {
            unused.push(index.to_string());
        } else if is_like {
            pages.push(page);
        } else {
            let of = |page: &Page| format!("{} × {} samples", page.size.0, page.size.1);
            let (own, first) = (of(&page), of(&pages[0]));
            return Err(wrong(format!(
                "its page {index} is {own}, its first {first}: expected pages of one size, a band each"
            )));
        }
        if !decoder.more_images() {
            break;
        }
        decoder.next_image().map_err(broken)?;
    }
    let Some(first) = pages.first() else { return Err(wrong("it has no page of full size".to_owned())) };
    unknown.sort();
    unknown.dedup();
    let mut notes: Vec<String> = note_of(path, "tag", &unknown).into_iter().collect();
    if !first.is_stack() && (pages.len() == 1 || first.n_samples > 1) {
        unused.extend((2..=pages.len()).map(|index| index.to_string()));
        notes.extend(note_of(path, "page", &unused));
        let is_float = matches!(first.depth, SampleDepth::Float);
        let unknown = first.has_unknown_sample.then(|| format!("sample {} (ExtraSamples 0)", first.n_samples));
        notes.extend(note_of(path, "channel", unknown.as_slice()));
        if !is_float {
            return Ok(TiffFile::Picture(first.words(notes)));
        }
    } else {
        notes.extend(note_of(path, "page", &unused));
    }
    let is_linear = !first.is_stack() && (pages.len() == 1 || first.n_samples > 1);
    let n_pages = if is_linear { 1 } else { pages.len() };
    let mut planes = vec![];
    for page in &pages[..n_pages] {
        if page.has_tiles_of_planes {
            // What decodes it stumbles over such tiles.
            return Err(wrong(
                "its bands lie apart and in tiles, expected strips, or the bands of a sample together".to_owned(),
            ));
        }
        decoder.seek_to_image(page.index).map_err(broken)?;
        if page.is_colored && page.n_samples > 4 {
            // What decodes it knows of red, green, blue and opacity alone.
            let n = page.n_samples;
            return Err(wrong(format!(
                "its {n} samples a pixel are marked as red, green, blue and others, which it cannot be decoded as: expected them marked as gray \
                 (minisblack), or a page a band"
            )));
        }
        planes.extend(planes_of(&mut decoder, page).map_err(broken)?);
    }
    if is_linear {
        if planes.len() == 2 || planes.len() == 4 {
            planes.pop();
            if !first.has_unknown_sample {
                notes.extend(note_of(path, "channel", &["opacity".to_owned()]));
            }
        }
        let words = first.words(notes);
        let mut planes = planes.into_iter();
        return match (planes.next(), planes.next(), planes.next()) {
            (Some(r), Some(g), Some(b)) => Ok(TiffFile::Linear([r, g, b], words)),
            (Some(gray), None, None) => Ok(TiffFile::Linear([gray.clone(), gray.clone(), gray], words)),
            _ => Err(wrong("its samples are neither gray nor red, green and blue".to_owned())),
        };
    }
    let wavelengths_nm = wavelengths_of(&pages, planes.len());
    if let (None, Some(text)) = (&wavelengths_nm, pages.iter().find_map(|page| page.description.as_ref())) {
        notes.push(format!("{}: its description '{}' is not used", name_of(path), short(text)));
    }
    // Its description was used or named.
    let page = PageWords { description: None, ..first.words(notes) };
    Ok(TiffFile::Stack(TiffStack { planes, wavelengths_nm, top: first.top(), page }))
}

/// How large the numbers of a page can be.
#[derive(Clone, Copy, Debug, PartialEq)]
enum SampleDepth {
    Unsigned(u8),
    Signed(u8),
    Float,
}

/// What a page states of itself.
struct Page {
    index: usize,
    /// Columns and rows.
    size: (u32, u32),
    n_samples: usize,
    depth: SampleDepth,
    bits: u8,
    is_colored: bool,
    has_inks: bool,
    is_reduced: bool,
    has_tiles_of_planes: bool,
    name: Option<String>,
    description: Option<String>,
    no_data: Option<f64>,
    is_white_zero: bool,
    /// Whether its last sample is neither a color nor an opacity: it may be a near infrared.
    has_unknown_sample: bool,
    unknown: Vec<u16>,
}

impl Page {
    fn of(decoder: &mut Decoder<BufReader<File>>, index: usize) -> tiff::TiffResult<Self> {
        let size = decoder.dimensions()?;
        let n_samples = decoder.find_tag_unsigned::<u16>(Tag::SamplesPerPixel)?.unwrap_or(1).max(1);
        let bits = decoder.find_tag_unsigned_vec::<u16>(Tag::BitsPerSample)?.and_then(|list| list.first().copied());
        let bits = bits.unwrap_or(1).min(64) as u8;
        let format = decoder.find_tag_unsigned_vec::<u16>(Tag::SampleFormat)?.and_then(|list| list.first().copied());
        let photometric = decoder.find_tag_unsigned::<u16>(Tag::PhotometricInterpretation)?.unwrap_or(1);
        let kind = decoder.find_tag_unsigned::<u32>(Tag::NewSubfileType)?.unwrap_or(0);
        let extra = decoder.find_tag_unsigned_vec::<u16>(Tag::ExtraSamples)?.unwrap_or_default();
        let is_colored = matches!(photometric, 2 | 3 | 6);
        let is_planar = decoder.find_tag_unsigned::<u16>(Tag::PlanarConfiguration)? == Some(2);
        let has_tiles_of_planes =
            is_planar && n_samples > 1 && decoder.find_tag_unsigned::<u32>(Tag::TileWidth)?.is_some();
        let mut text = |tag| decoder.get_tag_ascii_string(tag).ok().filter(|text| !text.trim().is_empty());
        let (name, description) = (text(PAGE_NAME), text(Tag::ImageDescription));
        let no_data = text(Tag::GdalNodata).and_then(|text| text.trim().parse().ok());
        let tags = decoder.tag_iter().filter_map(|entry| entry.ok()).map(|(tag, _)| tag.to_u16());
        let unknown = tags.filter(|tag| !HARMLESS.contains(tag)).collect();
        Ok(Self {
            index,
            size,
            n_samples: n_samples.into(),
            depth: match format {
                Some(2) => SampleDepth::Signed(bits),
                Some(3) => SampleDepth::Float,
                _ => SampleDepth::Unsigned(bits),
            },
            bits,
            is_colored,
            has_inks: photometric == 5,
            is_reduced: kind & 1 != 0,
            has_tiles_of_planes,
            name,
            description,
            no_data,
            // Of several samples none is counted from white.
            is_white_zero: photometric == 0 && n_samples == 1,
            has_unknown_sample: n_samples == if is_colored { 4 } else { 2 } && extra == [0],
            unknown,
        })
    }

    fn words(&self, notes: Vec<String>) -> PageWords {
        let (no_data, is_white_zero, description) = (self.no_data, self.is_white_zero, self.description.clone());
        PageWords { no_data, is_white_zero, description, notes }
    }

    fn bytes(&self) -> u64 {
        4 * u64::from(self.size.0) * u64::from(self.size.1) * self.n_samples as u64
    }

    /// Whether its samples are no gray or colors of a picture.
    fn is_stack(&self) -> bool {
        let is_signed = matches!(self.depth, SampleDepth::Signed(_));
        is_signed
            || if self.is_colored { self.n_samples > 4 } else { self.n_samples > 2 }
            || self.bits > 16 && self.depth != SampleDepth::Float
    }

    fn top(&self) -> Option<f64> {
        match self.depth {
            SampleDepth::Unsigned(bits) => Some(2.0_f64.powi(bits.into()) - 1.0),
            SampleDepth::Signed(bits) => Some(2.0_f64.powi(i32::from(bits) - 1) - 1.0),
            SampleDepth::Float => None,
        }
    }
}

/// Returns the planes of the page that a decoder stands at.
fn planes_of(decoder: &mut Decoder<BufReader<File>>, page: &Page) -> tiff::TiffResult<Vec<Array2<f32>>> {
    let mut result = DecodingResult::U8(vec![]);
    let layout = decoder.read_image_to_buffer(&mut result)?;
    let (columns, rows) = (page.size.0 as usize, page.size.1 as usize);
    let is_planar = layout.planes > 1;
    let samples = floats(result);
    let n = page.n_samples;
    let is_whole = samples.len() >= rows * columns * n;
    if !is_whole {
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

/// Returns the wavelengths that pages are named after, or that the first one's description lists as JSON.
fn wavelengths_of(pages: &[Page], n_planes: usize) -> Option<Vec<f64>> {
    let named = |text: Option<&String>| text.and_then(|text| wavelength_in(text));
    let of_names: Option<Vec<f64>> = pages.iter().map(|page| named(page.name.as_ref())).collect();
    let of_texts: Option<Vec<f64>> = pages.iter().map(|page| named(page.description.as_ref())).collect();
    let listed = || {
        let Value::Object(map) = serde_json::from_str(pages[0].description.as_ref()?).ok()? else { return None };
        let keys = ["wavelengths_nm", "wavelength_nm", "wavelengths", "wavelength"];
        let list = keys.iter().find_map(|key| map.get(*key))?.as_array()?;
        list.iter().map(Value::as_f64).collect::<Option<Vec<f64>>>()
    };
    of_names.or(of_texts).or_else(listed).filter(|list| list.len() == n_planes)
}

/// Returns the wavelength of a text such as `450 nm` or `Band 450.5nm`.
fn wavelength_in(text: &str) -> Option<f64> {
    let before = text.trim().strip_suffix("nm")?.trim_end();
    let number = before.rsplit(|c: char| !(c.is_ascii_digit() || c == '.')).next()?;
    number.parse().ok().filter(|nm: &f64| *nm > 0.0)
}
