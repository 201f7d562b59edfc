//! Pages of TIFF files: what each states of itself.

use std::{
    io::{Read, Seek},
    path::Path,
};

use ndarray::Array2;
use serde_json::Value as Json;
use tiff::{
    decoder::{Decoder, ifd::Value},
    tags::Tag,
};

use super::{
    length_unit::length_m,
    mat::UnitOf,
    picture_parts::differ,
    stated::{name_of, note_of},
    tiff_depth_map::{DEPTH_TAGS, DepthMapTags},
    tiff_gdal::GdalWords,
    wavelength_unit::{in_nm, wavelength_in},
};

/// The name of a page.
const PAGE_NAME: Tag = Tag::Unknown(285);
/// Tags that say how samples lie in the file, or what changes nothing: from sizes and strips to who made it when.
const HARMLESS: [u16; 47] = [
    254, 255, 256, 257, 258, 259, 262, 263, 266, 269, 270, 271, 272, 273, 274, 277, 278, 279, 282, 283, 284, 285, 288,
    289, 292, 293, 296, 297, 305, 306, 315, 316, 317, 320, 322, 323, 324, 325, 337, 338, 339, 347, 530, 531, 33432,
    34853, 42113,
];

/// The codes of black and of white of each sample.
const REFERENCE_BLACK_WHITE: Tag = Tag::Unknown(532);

/// Keys of a description under which its wavelengths stand, nm.
const WAVELENGTHS: [&str; 4] = ["wavelengths_nm", "wavelength_nm", "wavelengths", "wavelength"];

/// Keys under which its unit stands.
const UNITS: [&str; 2] = ["unit", "units"];

/// How large the numbers of a page can be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum SampleDepth {
    Unsigned(u8),
    Signed(u8),
    Float,
}

/// What the samples of a page are marked as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Marked {
    /// Gray, 0 being white or black.
    Gray {
        is_white_zero: bool,
    },
    /// Red, green and blue.
    Rgb,
    /// What is not read, in words.
    Unread(&'static str),
    Other,
}

/// What samples are marked as that are not read (TIFF 6.0, and its technical notes).
const UNREAD: [(u16, &str); 6] = [
    (3, "a table of colors (palette)"),
    (5, "inks (CMYK)"),
    (6, "brightness and differences of colors (YCbCr, as JPEG within TIFF has it)"),
    (8, "colors of CIE L*a*b*"),
    (9, "colors of CIE L*a*b* (ICC)"),
    (10, "colors of CIE L*a*b* (ITU)"),
];
/// What is not read of samples whose bits are in reverse order.
const REVERSED: &str = "samples whose bits stand in reverse order (FillOrder 2)";
/// What is not read of numbers (TIFF 6.0, section 19, and its supplement 2).
const UNSTATED: &str = "numbers of a kind that is not stated (SampleFormat 4)";
const COMPLEX: &str = "complex numbers (SampleFormat 5 or 6)";
/// The tag of the version of DNG that a file is written by.
const DNG_VERSION: u16 = 50_706;

/// What a page states of itself.
pub(super) struct Page {
    pub(super) index: usize,
    /// Columns and rows.
    pub(super) size: (u32, u32),
    pub(super) n_samples: usize,
    pub(super) depth: SampleDepth,
    pub(super) bits: u8,
    pub(super) marked: Marked,
    /// What each of the last samples is: 0 unspecified, 1 and 2 an opacity.
    pub(super) extra: Vec<u16>,
    /// Whether it is a reduced one or a mask, in a word.
    pub(super) aside: Option<&'static str>,
    /// What it says of its depths, where it is marked as a map of them.
    pub(super) depth_map: Option<DepthMapTags>,
    /// Whether it is a page of a raw photograph.
    pub(super) is_raw: bool,
    pub(super) has_tiles_of_planes: bool,
    /// Whether its samples are compressed as those of a JPEG picture.
    pub(super) is_jpeg: bool,
    name: Option<String>,
    /// The name of the document that it is of.
    pub(super) document: Option<String>,
    pub(super) gdal: GdalWords,
    /// What its descriptions say, of which some writers have two.
    pub(super) descriptions: Vec<String>,
    no_data: Option<f64>,
    /// How the picture lies, 1 being upright.
    orientation: u16,
    /// Tags that nobody here knows.
    pub(super) unknown: Vec<u16>,
}

impl Page {
    /// Reads what the page states that a decoder stands at.
    ///
    /// # Errors
    /// When a tag cannot be read.
    pub(super) fn of<R: Read + Seek>(
        decoder: &mut Decoder<R>,
        index: usize,
        is_depth_map: bool,
    ) -> tiff::TiffResult<Self> {
        let size = decoder.dimensions()?;
        let n_samples = decoder.find_tag_unsigned::<u16>(Tag::SamplesPerPixel)?.unwrap_or(1).max(1);
        let bits = decoder.find_tag_unsigned_vec::<u16>(Tag::BitsPerSample)?.and_then(|list| list.first().copied());
        let bits = bits.unwrap_or(1).min(64) as u8;
        let format = decoder.find_tag_unsigned_vec::<u16>(Tag::SampleFormat)?.and_then(|list| list.first().copied());
        let photometric = decoder.find_tag_unsigned::<u16>(Tag::PhotometricInterpretation)?.unwrap_or(1);
        let kind = decoder.find_tag_unsigned::<u32>(Tag::NewSubfileType)?.unwrap_or(0);
        let compression = decoder.find_tag_unsigned::<u16>(Tag::Compression)?.unwrap_or(1);
        let is_planar = decoder.find_tag_unsigned::<u16>(Tag::PlanarConfiguration)? == Some(2);
        let has_tiles = decoder.find_tag_unsigned::<u32>(Tag::TileWidth)?.is_some();
        let orientation = decoder.find_tag_unsigned::<u16>(Tag::Orientation)?.unwrap_or(1);
        let extra = decoder.find_tag_unsigned_vec::<u16>(Tag::ExtraSamples)?.unwrap_or_default();
        let is_reversed = decoder.find_tag_unsigned::<u16>(Tag::FillOrder)? == Some(2);
        let mut text = |tag| decoder.get_tag_ascii_string(tag).ok().filter(|text| !text.trim().is_empty());
        let (name, descriptions) = (text(PAGE_NAME), text(Tag::ImageDescription).into_iter().collect());
        let no_data = text(Tag::GdalNodata).and_then(|text| text.trim().parse().ok());
        let tags = decoder.tag_iter().filter_map(|entry| entry.ok()).map(|(tag, _)| tag.to_u16());
        let mut unknown: Vec<u16> = tags.filter(|tag| !HARMLESS.contains(tag)).collect();
        if is_of_usual_range(decoder.find_tag(REFERENCE_BLACK_WHITE).ok().flatten(), bits) {
            unknown.retain(|tag| *tag != REFERENCE_BLACK_WHITE.to_u16());
        }
        let depth_map = is_depth_map.then(|| DepthMapTags::of(decoder));
        if depth_map.is_some() {
            unknown.retain(|tag| !DEPTH_TAGS.contains(tag));
        }
        let mut resolution = |tag| match decoder.find_tag(tag) {
            Ok(Some(Value::Rational(over, under))) if over > 0 && under > 0 => Some(f64::from(over) / f64::from(under)),
            _ => None,
        };
        if let (Some(across), Some(down)) = (resolution(Tag::XResolution), resolution(Tag::YResolution))
            && differ(across, down)
        {
            // Pixels that are not square.
            unknown.extend([Tag::XResolution.to_u16(), Tag::YResolution.to_u16()]);
        }
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
            marked: match photometric {
                _ if is_reversed => Marked::Unread(REVERSED),
                _ if format == Some(4) => Marked::Unread(UNSTATED),
                _ if matches!(format, Some(5 | 6)) => Marked::Unread(COMPLEX),
                0 | 1 => Marked::Gray { is_white_zero: photometric == 0 },
                2 => Marked::Rgb,
                other => {
                    let unread = UNREAD.iter().find(|(own, _)| *own == other);
                    unread.map_or(Marked::Other, |(_, what)| Marked::Unread(what))
                }
            },
            extra,
            aside: match kind {
                kind if kind & 1 != 0 => Some("reduced"),
                // Of GDAL and others, 0 where there are no data.
                kind if kind & 4 != 0 || photometric == 4 => Some("a mask"),
                _ => None,
            },
            depth_map,
            is_raw: unknown.contains(&DNG_VERSION),
            has_tiles_of_planes: is_planar && n_samples > 1 && has_tiles,
            is_jpeg: matches!(compression, 6 | 7),
            name,
            document: None,
            gdal: GdalWords::default(),
            descriptions,
            no_data,
            orientation,
            unknown,
        })
    }

    pub(super) fn words(&self) -> PageWords {
        PageWords {
            no_data: self.no_data,
            // Of several samples none is counted from white.
            is_white_zero: self.marked == Marked::Gray { is_white_zero: true } && self.n_samples == 1,
            descriptions: self.descriptions.clone(),
            called: self.names().chain(self.descriptions.iter()).cloned().collect::<Vec<_>>().join("; "),
            unit: self.gdal.unit.clone().or_else(|| self.descriptions.iter().find_map(|text| unit_of_numbers(text))),
            packed: self.gdal.factor(),
            orientation: self.orientation,
            depth_map: self.depth_map,
        }
    }

    /// Returns what the page and its document are called.
    pub(super) fn names(&self) -> impl Iterator<Item = &String> {
        self.name.iter().chain(&self.document)
    }

    pub(super) fn bytes(&self) -> u64 {
        4 * u64::from(self.size.0) * u64::from(self.size.1) * self.n_samples as u64
    }

    /// Whether its samples are no gray or colors of a picture.
    pub(super) fn is_stack(&self) -> bool {
        // Beside gray a sample that is no opacity is a band of whole numbers; of floats it is named.
        let is_gray = self.opacities().len() == 1 || self.depth == SampleDepth::Float;
        let most = if self.is_colored() { 4 } else { 1 + usize::from(is_gray) };
        matches!(self.depth, SampleDepth::Signed(_))
            || self.n_samples > most
            || self.bits > 16 && self.depth != SampleDepth::Float
    }

    pub(super) fn is_colored(&self) -> bool {
        self.marked == Marked::Rgb
    }

    /// Returns how many wavelengths its description lists.
    pub(super) fn n_listed(&self) -> Option<usize> {
        listed_in(self).map(|(list, _)| list.len())
    }

    /// Returns what is said of planes with a mark that 0 is white: those of a sample a pixel are counted from white, others are not.
    pub(super) fn note_of_white(&self, path: &Path) -> Option<String> {
        let is_marked = self.marked == Marked::Gray { is_white_zero: true };
        let what = match self.n_samples {
            1 => "(tag 262) is obeyed: its numbers are counted from the largest down",
            _ => "(tag 262) is not used: its bands are taken as they stand",
        };
        is_marked.then(|| format!("{}: its mark that 0 is white {what}", name_of(path)))
    }

    /// Whether its samples are numbers by themselves, a plane each.
    pub(super) fn has_plain_samples(&self) -> bool {
        let is_marked = matches!(self.marked, Marked::Gray { .. } | Marked::Rgb);
        is_marked && !self.is_jpeg && matches!(self.bits, 8 | 16 | 32 | 64)
    }

    /// Which of its samples are opacities: a fourth of colors of which nothing is said, too.
    pub(super) fn opacities(&self) -> Vec<usize> {
        if self.extra.is_empty() && self.is_colored() && self.n_samples == 4 {
            return vec![3];
        }
        let first = self.n_samples.saturating_sub(self.extra.len());
        (first..self.n_samples).filter(|sample| matches!(self.extra[sample - first], 1 | 2)).collect()
    }

    /// Returns the number, from 1, of a last sample that is neither a color nor an opacity: it may be a near infrared.
    pub(super) fn unknown_sample(&self) -> Option<usize> {
        let n_colors = if self.is_colored() { 3 } else { 1 };
        let says_nothing = self.extra == [0] || self.extra.is_empty() && !self.is_colored();
        (self.n_samples == n_colors + 1 && says_nothing).then_some(self.n_samples)
    }

    pub(super) fn top(&self) -> Option<f64> {
        match self.depth {
            SampleDepth::Unsigned(bits) => Some(2.0_f64.powi(bits.into()) - 1.0),
            SampleDepth::Signed(bits) => Some(2.0_f64.powi(i32::from(bits) - 1) - 1.0),
            SampleDepth::Float => None,
        }
    }
}

/// Whether codes of black and white, pairs of one a sample, are 0 and the largest.
fn is_of_usual_range(value: Option<Value>, bits: u8) -> bool {
    let Some(Value::List(list)) = value else { return false };
    let top = 2.0_f64.powi(bits.into()) - 1.0;
    let ends = list.iter().map(|value| match value {
        Value::Rational(over, under) => f64::from(*over) / f64::from(*under),
        Value::Unsigned(number) => f64::from(*number),
        _ => f64::NAN,
    });
    ends.zip([0.0, top].into_iter().cycle()).all(|(own, usual)| own == usual)
}

/// What the first page says besides its numbers.
#[derive(Clone, Debug, Default)]
pub(super) struct PageWords {
    /// The number that stands for none.
    pub(super) no_data: Option<f64>,
    /// Whether 0 is white.
    pub(super) is_white_zero: bool,
    pub(super) descriptions: Vec<String>,
    /// What the file calls its numbers, in names and descriptions.
    pub(super) called: String,
    /// The unit of its numbers.
    pub(super) unit: Option<String>,
    /// The factor that made quantities of its numbers, where they were packed.
    pub(super) packed: Option<f64>,
    orientation: u16,
    pub(super) depth_map: Option<DepthMapTags>,
}

impl PageWords {
    /// Makes what stands for no number no number.
    pub(super) fn ignore(&self, plane: &mut Array2<f32>) {
        if let Some(none) = self.no_data.map(|none| none as f32) {
            plane.mapv_inplace(|v| if v == none { f32::NAN } else { v });
        }
    }

    /// Counts samples whose largest is `top`, 1 of floats, from black, as light is.
    pub(super) fn count_from_black(&self, plane: &mut Array2<f32>, top: Option<f64>) {
        if self.is_white_zero {
            let top = top.unwrap_or(1.0) as f32;
            plane.mapv_inplace(|v| top - v);
        }
    }

    /// Returns what is said of a unit that nothing took.
    pub(super) fn note_of_unit(&self, path: &Path) -> Option<String> {
        note_of(path, "unit", self.unit.as_slice())
    }

    /// Returns what is said of numbers that lie as stored.
    pub(super) fn note_of_orientation(&self, path: &Path) -> Option<String> {
        (self.orientation != 1)
            .then(|| format!("{}: its orientation, {} (tag 274), is not used", name_of(path), self.orientation))
    }

    /// Returns what is said of descriptions that nothing took; of those that programs write by themselves it is the keys that say more
    /// than they usually do.
    pub(super) fn notes_of_description(&self, path: &Path) -> Vec<String> {
        let (mut keys, mut described) = (vec![], vec![]);
        for text in &self.descriptions {
            match written_keys(text) {
                Some(own) => keys.extend(own),
                None => described.push(text.clone()),
            }
        }
        let notes = [note_of(path, "description key", &keys), note_of(path, "description", &described)];
        notes.into_iter().flatten().collect()
    }
}

/// Returns the keys of a description that tifffile or `ImageJ` wrote that say more than the shape of the array, in rows before columns, and how `ImageJ`
/// shows it; none of another description.
fn written_keys(text: &str) -> Option<Vec<String>> {
    if text.starts_with("ImageJ=") {
        const KEYS: [&str; 14] = [
            "ImageJ",
            "images",
            "hyperstack",
            "mode",
            "loop",
            "yunit",
            "zunit",
            "tunit",
            "spacing",
            "finterval",
            "fps",
            "min",
            "max",
            "axes",
        ];
        const AXES: [&str; 3] = ["channels", "slices", "frames"];
        let pairs = text.lines().filter_map(|line| line.split_once('=')).map(|(key, value)| (key.trim(), value.trim()));
        let is_long = |(key, value): &(&str, &str)| AXES.contains(key) && *value != "1";
        // Of bands along several axes it is not known which are whose.
        let are_several = pairs.clone().filter(is_long).count() > 1;
        let is_usual = |key: &str, value: &str| match AXES.contains(&key) {
            true => !(are_several && value != "1"),
            false => KEYS.contains(&key) || key == "unit" && value.starts_with("pixel"),
        };
        return Some(pairs.filter(|(key, value)| !is_usual(key, value)).map(|(key, _)| key.to_owned()).collect());
    }
    match serde_json::from_str(text) {
        Ok(Json::Object(map)) if map.contains_key("shape") => {
            Some(map.iter().filter(|(key, value)| !is_of_shape(key, value)).map(|(key, _)| key.clone()).collect())
        }
        _ => None,
    }
}

/// Returns the unit of light, of shares or of lengths that a description in JSON states.
fn unit_of_numbers(text: &str) -> Option<String> {
    let Ok(Json::Object(map)) = serde_json::from_str(text) else { return None };
    UNITS.iter().find_map(|key| map.get(*key)?.as_str()).filter(|unit| is_of_numbers(unit)).map(str::to_owned)
}

fn is_of_numbers(unit: &str) -> bool {
    length_m(unit).is_some() || !matches!(UnitOf::read(Some(unit)), UnitOf::Unknown)
}

/// Whether a key of tifffile is one of the shape of the array, in rows before columns, or the unit of its numbers.
fn is_of_shape(key: &str, value: &Json) -> bool {
    let text = value.as_str().unwrap_or_default();
    let is_read =
        (key == "axes" && text.to_uppercase().contains("YX")) || (UNITS.contains(&key) && is_of_numbers(text));
    ["shape", "truncated"].contains(&key) || is_read
}

/// What pages say of their bands.
#[derive(Debug, Default)]
pub(super) struct StatedBands {
    /// Their wavelengths, nm.
    pub(super) wavelengths_nm: Option<Vec<f64>>,
    /// Whether these are those of descriptions.
    pub(super) are_described: bool,
    /// The names of pages, where these are no wavelengths.
    pub(super) names: Vec<String>,
    /// The keys of the description that are not used.
    pub(super) keys: Vec<String>,
}

impl StatedBands {
    /// Returns the wavelengths that pages are named after or described by, or that the first one's description lists as JSON.
    ///
    /// # Errors
    /// When they state two lists that differ.
    pub(super) fn of(pages: &[Page]) -> Result<Self, String> {
        let named = |text: Option<&String>| text.and_then(|text| wavelength_in(text));
        let of_names: Option<Vec<f64>> = pages.iter().map(|page| named(page.name.as_ref())).collect();
        let of_texts: Option<Vec<f64>> = pages.iter().map(|page| named(page.descriptions.first())).collect();
        let (listed, keys) = pages.first().and_then(listed_in).unzip();
        let names =
            if of_names.is_some() { vec![] } else { pages.iter().filter_map(|page| page.name.clone()).collect() };
        let described = of_texts.or(listed);
        if let (Some(named), Some(described)) = (&of_names, &described)
            && named != described
        {
            let reason =
                "its pages are named after other wavelengths than its description states: expected one of them";
            return Err(reason.to_owned());
        }
        let are_described = described.is_some();
        Ok(Self { wavelengths_nm: described.or(of_names), are_described, names, keys: keys.unwrap_or_default() })
    }
}

/// Returns the wavelengths that a page's description lists as JSON, nm, and the keys there that are not used.
fn listed_in(page: &Page) -> Option<(Vec<f64>, Vec<String>)> {
    let maps = page.descriptions.iter().filter_map(|text| match serde_json::from_str(text) {
        Ok(Json::Object(map)) => Some(map),
        _ => None,
    });
    let mut map = maps.into_iter().find(|map| WAVELENGTHS.iter().any(|key| map.contains_key(*key)))?;
    let list = WAVELENGTHS.iter().find_map(|key| map.remove(*key))?;
    let list = list.as_array()?.iter().map(Json::as_f64).collect::<Option<Vec<f64>>>()?;
    // The unit beside a list is that of the list, where it is one of wavelengths.
    let unit =
        ["wavelength_unit", "wavelength_units", "wavelengths_unit", "unit", "units"].into_iter().find_map(|key| {
            let own = in_nm(map.get(key)?.as_str()?, &list)?;
            Some((key, own))
        });
    let list = match unit {
        Some((key, own)) => {
            map.remove(key);
            own
        }
        None => list,
    };
    let left = map.into_iter().filter(|(key, value)| !is_of_shape(key, value)).map(|(key, _)| key).collect();
    Some((list, left))
}
