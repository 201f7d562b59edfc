//! TIFF files of numbers: stacks of pages, many samples a pixel, floats and signed numbers.

use std::{
    fs::{self, File},
    path::Path,
};

use ndarray::Array2;
use tiff::{
    TiffError, TiffUnsupportedError,
    decoder::{Decoder, Limits},
};

use super::{
    picture_parts::{comment, notes_on_page},
    stated::{Noted, name_of, note_of, tells},
    tiff_bands::{AsGray, planes_of},
    tiff_directory::{BELOW, Directory},
    tiff_gdal::{GDAL, GdalWords},
    tiff_page::{Marked, Page, PageWords, SampleDepth, StatedBands},
    unusable::{check_memory, fault, unreadable},
};
use crate::SceneError;

/// The tag of a description.
const DESCRIPTION: u16 = 270;
/// The tags of the name of a document, of XMP data, and of Exif data.
const DOCUMENT: u16 = 269;
const XMP: u16 = 700;
const EXIF: u16 = 34_665;
/// The tags of who made the file, when and with what.
const MADE_BY: [(u16, &str); 8] = [
    (271, "Make"),
    (272, "Model"),
    (305, "Software"),
    (306, "DateTime"),
    (315, "Artist"),
    (316, "HostComputer"),
    (337, "TargetPrinter"),
    (33_432, "Copyright"),
];
/// The tag of what samples are marked as.
const PHOTOMETRIC: u16 = 262;
/// What of it is decoded, and a depth map.
const KNOWN_MARKS: [u64; 11] = [0, 1, 2, 3, 4, 5, 6, 8, 9, 10, 51_177];
/// The tag of an ICC profile.
const PROFILE: u16 = 34_675;
/// Pages of a file.
const LIMIT_PAGES: usize = 10_000;

/// What is said of raw photographs.
pub(super) const RAW: &str = "it is a raw photograph, which is no scene: `dioptric develop` makes a picture of a DNG";

/// Returns what is wrong with a file that what decodes it does not take.
fn broken(path: &Path, error: &TiffError) -> SceneError {
    let is_unknown = matches!(error, TiffError::UnsupportedError(TiffUnsupportedError::UnknownInterpretation));
    if let Some(what) = Some(path).filter(|_| is_unknown).and_then(unknown_mark) {
        return unreadable(path, what);
    }
    unreadable(
        path,
        match error {
            TiffError::UnsupportedError(TiffUnsupportedError::UnknownInterpretation) => {
                "its samples are marked as none that are read, as logarithms or those of a sensor, expected gray or red, green and blue: \
                 `dioptric develop` makes a picture of a raw photograph"
                    .to_owned()
            }
            TiffError::UnsupportedError(TiffUnsupportedError::UnsupportedSampleFormat(formats)) => {
                let kinds = formats.iter().map(|own| match own.to_u16() {
                    4 => "of no stated kind",
                    5 => "complex whole numbers",
                    6 => "complex numbers",
                    _ => "of a kind that is not known",
                });
                let kinds = kinds.collect::<std::collections::BTreeSet<_>>().into_iter().collect::<Vec<_>>().join(" and ");
                format!("its samples are {kinds} (SampleFormat): expected whole numbers or floats")
            }
            TiffError::UnsupportedError(_) => {
                fault("TIFF", error, Some("whole numbers or floats of one kind without compression, or with LZW or Deflate"))
            }
            _ => fault("TIFF", error, None),
        },
    )
}

/// Returns what a page of a file is marked as that is known but not read, and the way on.
fn unknown_mark(path: &Path) -> Option<String> {
    let mut file = File::open(path).ok()?;
    let pages = Directory::all(&mut file, LIMIT_PAGES).ok()?;
    // The first that is none of those of TIFF 6.0 and its notes.
    let mut marks = pages.iter().filter_map(|(_, page)| page.number_of(&mut file, PHOTOMETRIC).ok()?);
    let mark = marks.find(|mark| !KNOWN_MARKS.contains(mark))?;
    Some(match mark {
        32_803 | 34_892 => {
            "its samples are those of a sensor, which are no scene: `dioptric develop` makes a picture of a DNG"
                .to_owned()
        }
        32_844 | 32_845 => {
            "it holds logarithms of light (LogL or LogLuv), expected linear floats: convert it".to_owned()
        }
        other => format!(
            "its samples are marked as {other} (tag 262), which is not read, expected gray (0 or 1) or red, green and blue (2)"
        ),
    })
}

/// Returns what is said where no page is a picture.
fn no_page(path: &Path) -> SceneError {
    let reason = if has_depth_map(path) {
        "it holds a depth map (DNG) and no picture: expected it as --depth of one"
    } else {
        "it has no page of full size"
    };
    unreadable(path, reason)
}

/// Whether a page of a TIFF file is marked as a depth map.
pub(super) fn has_depth_map(path: &Path) -> bool {
    AsGray::with_depth_maps(path, LIMIT_PAGES).is_ok_and(|(_, maps)| !maps.is_empty())
}

/// What is wanted of a TIFF file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TiffAs {
    /// What it is marked as: a picture, or a stack of planes; depth maps are left to who asks.
    Marked,
    /// Planes of numbers, whatever they are marked as; so many where it is known, so that one marked as an opacity may be among them,
    /// and with depth maps left to who asks.
    Planes(Option<usize>),
    /// The depths of a picture: those of pages that are marked so, where there are any, or else planes of numbers.
    Depths,
}

/// What a TIFF file holds.
pub(super) enum TiffFile {
    /// One page of gray or of colors in whole numbers, which is a picture.
    Picture(PageWords),
    /// Linear red, green and blue: a page of floats.
    Linear([Array2<f32>; 3], PageWords),
    /// Planes of numbers.
    Stack(TiffStack),
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
pub(super) fn read_tiff(path: &Path, wanted: TiffAs) -> Result<Noted<TiffFile>, SceneError> {
    let Pages { mut pages, unused, mut notes } = pages_of(path, wanted, wanted != TiffAs::Depths)?;
    let Some((first, _)) = pages.first() else { return Err(no_page(path)) };
    let words = first.words();
    // A picture of two gray samples may be told by its description to be one of two bands.
    let n_planes = pages.iter().map(|(page, _)| page.n_samples).sum();
    let of_gdal = first.gdal.wavelengths_nm.as_ref().map(Vec::len);
    let is_listed = [first.n_listed(), of_gdal].contains(&Some(n_planes));
    let as_planes = first.is_stack() || ((wanted != TiffAs::Marked || is_listed) && first.has_plain_samples());
    // Depths are counted as they stand, which is said where they are read.
    let is_said = as_planes && (wanted != TiffAs::Depths || first.n_samples > 1);
    notes.extend(first.note_of_white(path).filter(|_| is_said));
    // Gray pages are planes of a stack, colored ones a picture and others.
    let is_picture = !as_planes && (pages.len() == 1 || first.n_samples > 1);
    if is_picture {
        notes.extend(notes_on_others(path, &pages, unused));
        if first.depth != SampleDepth::Float {
            return Ok(Noted::new(TiffFile::Picture(words), notes));
        }
        pages.truncate(1);
    } else {
        notes.extend(note_of(path, "page", &unused));
    }
    notes.extend(words.note_of_orientation(path));
    let mut planes = planes_of_pages(path, &pages)?;
    let first = &pages[0].0;
    let words = unpacked(&pages, words, &mut planes);
    if is_picture {
        if first.unknown_sample().is_none() {
            notes.extend(without_opacity(path, first, &mut planes));
        }
        return Ok(Noted::new(TiffFile::Linear(colors_of(path, planes)?, words), notes));
    }
    let top = first.top().filter(|_| pages.iter().all(|(page, _)| !page.gdal.is_packed()));
    if pages.iter().any(|(page, _)| page.gdal.unit != first.gdal.unit) {
        return Err(unreadable(path, "its metadata of GDAL state several units: expected one for all pages"));
    }
    // That of a page is of its samples.
    let of_pages = pages.iter().filter_map(|(page, _)| page.gdal.wavelengths_nm.clone()).collect::<Vec<_>>().concat();
    let gdal_nm = Some(of_pages).filter(|own| own.len() == planes.len());
    let own: Vec<Page> = pages.into_iter().map(|(page, _)| page).collect();
    // Where there are as many wavelengths as samples, what is marked as an opacity is a band.
    let mut bands = StatedBands::of(&own).map_err(|reason| unreadable(path, reason))?;
    if let (Some(own), Some(gdal)) = (&bands.wavelengths_nm, &gdal_nm)
        && own != gdal
    {
        let reason = "its descriptions state other wavelengths than its metadata of GDAL: expected one of them";
        return Err(unreadable(path, reason));
    }
    bands.wavelengths_nm = bands.wavelengths_nm.or(gdal_nm);
    let n_stated = bands.wavelengths_nm.as_ref().map(Vec::len);
    let is_whole = wanted == TiffAs::Planes(Some(planes.len())) || n_stated == Some(planes.len());
    if is_whole {
        notes.extend(note_on_opacities(path, &own[0]));
    } else {
        notes.extend(without_opacity(path, &own[0], &mut planes));
    }
    if let Some(n_stated) = n_stated.filter(|n| *n != planes.len()) {
        return Err(unreadable(path, format!("it states {n_stated} wavelengths, but has {} planes", planes.len())));
    }
    notes.extend(note_of(path, "description key", &bands.keys));
    notes.extend(note_of(path, "page name", &bands.names));
    let mut document: Vec<String> =
        own.iter().flat_map(|page| &page.document).filter_map(|text| comment(text.as_bytes())).collect();
    document.dedup();
    notes.extend(note_of(path, "document name", &document));
    let mut page = words;
    page.descriptions = described(&own, bands.are_described);
    Ok(Noted::new(TiffFile::Stack(TiffStack { planes, wavelengths_nm: bands.wavelengths_nm, top, page }), notes))
}

/// Makes the quantities of numbers that are packed, those that stand for none being none.
fn unpacked(pages: &[(Page, u64)], mut words: PageWords, planes: &mut [Array2<f32>]) -> PageWords {
    for ((page, _), own) in pages.iter().zip(planes.chunks_mut(pages[0].0.n_samples)) {
        own.iter_mut().for_each(|plane| page.words().ignore(plane));
        page.gdal.unpack(own);
    }
    words.no_data = None;
    words
}

/// Returns what the descriptions of all pages say, each once, where their wavelengths are not all that they say.
fn described(pages: &[Page], are_bands: bool) -> Vec<String> {
    let mut all: Vec<String> =
        if are_bands { vec![] } else { pages.iter().flat_map(|page| page.descriptions.clone()).collect() };
    let mut known = std::collections::HashSet::new();
    all.retain(|text| known.insert(text.clone()));
    all
}

/// Returns the number of a tag, with its name where that is known.
fn named_tag(tag: u16) -> String {
    const NAMES: [(u16, &str); 10] = [
        (282, "XResolution, pixels that are not square"),
        (283, "YResolution, pixels that are not square"),
        (301, "TransferFunction"),
        (330, "SubIFDs"),
        (532, "ReferenceBlackWhite"),
        (PROFILE, "ICC profile"),
        (33_550, "ModelPixelScale"),
        (33_922, "ModelTiepoint"),
        (34_735, "GeoKeyDirectory"),
        (37_510, "UserComment"),
    ];
    let name = NAMES.iter().find(|(own, _)| *own == tag);
    name.map_or_else(|| tag.to_string(), |(_, name)| format!("{tag} ({name})"))
}

/// The pages of a file that are like its first, with the places of their directories.
struct Pages {
    pages: Vec<(Page, u64)>,
    /// The numbers of others, from 1.
    unused: Vec<String>,
    /// The tags that nobody knows.
    notes: Vec<String>,
}

/// Reads what pages state, and of a scene their words of geometry: those of depths where they are wanted and there, or else all others.
fn pages_of(path: &Path, wanted: TiffAs, of_scene: bool) -> Result<Pages, SceneError> {
    let broken = |error| broken(path, &error);
    let (reader, maps) = AsGray::with_depth_maps(path, LIMIT_PAGES).map_err(|error| unreadable(path, error))?;
    let length = fs::metadata(path).map_err(|error| unreadable(path, error))?.len();
    let mut decoder = Decoder::new(reader).map_err(broken)?.with_limits(Limits::default());
    let mut pages: Vec<(Page, u64)> = vec![];
    let (mut bytes, mut unused, mut unknown) = (0, vec![], vec![]);
    let (mut told, mut xmp, mut items) = (vec![], vec![], vec![]);
    for index in 1.. {
        if index > LIMIT_PAGES {
            return Err(unreadable(path, format!("it has more than {LIMIT_PAGES} pages")));
        }
        if index > 1 {
            if !decoder.more_images() {
                break;
            }
            decoder.next_image().map_err(broken)?;
        }
        let at = decoder.ifd_pointer().map_or(0, |place| place.0);
        let mut page = Page::of(&mut decoder, index - 1, maps.contains(&at)).map_err(broken)?;
        if page.unknown.contains(&BELOW) {
            let mut file = File::open(path).map_err(|error| unreadable(path, error))?;
            let below = Directory::read(&mut file, at).and_then(|own| own.below(&mut file)).unwrap_or_default();
            let are_maps = below.iter().all(|own| maps.contains(own));
            page.unknown.retain(|tag| *tag != BELOW || !are_maps);
        }
        let is_depth = page.depth_map.is_some();
        if is_depth != (wanted == TiffAs::Depths && !maps.is_empty()) {
            unused.extend((is_depth && wanted == TiffAs::Planes(None)).then(|| format!("{index} (a depth map)")));
            continue;
        }
        if page.aside.is_none() {
            let mut file = File::open(path).map_err(|error| unreadable(path, error))?;
            let directory = Directory::read(&mut file, at).map_err(|error| unreadable(path, error))?;
            let mut texts =
                |tag| directory.texts(&mut file, tag).map_err(|error: std::io::Error| unreadable(path, error));
            // What decodes the file keeps the last of two.
            page.descriptions = texts(DESCRIPTION)?;
            page.document = texts(DOCUMENT)?.into_iter().next();
            for (tag, name) in MADE_BY {
                let own = texts(tag)?.into_iter().filter(|text| tells(text));
                told.extend(own.map(|text| format!("{name}: {text}")));
            }
            let (own_xmp, gdal) = (texts(XMP)?, texts(GDAL)?.join(" "));
            page.gdal = GdalWords::of(&gdal, page.n_samples);
            let read = [(XMP, !own_xmp.is_empty()), (GDAL, !gdal.is_empty()), (EXIF, true)];
            page.unknown.retain(|tag| !read.contains(&(*tag, true)));
            xmp.extend(own_xmp);
            items.append(&mut page.gdal.left);
            // A page that says nothing of its samples has them as the first has.
            if let Some((first, _)) = pages.first().filter(|_| gdal.is_empty()) {
                page.gdal = first.gdal.clone();
                page.gdal.wavelengths_nm = None;
            }
        }
        bytes += page.bytes();
        // Its numbers as they stand, and as single floats.
        check_memory(path, bytes.saturating_mul(2), length)?;
        if page.is_raw {
            return Err(unreadable(path, RAW));
        }
        if let (Marked::Unread(what), false) = (page.marked, page.aside.is_some()) {
            let reason = format!("it holds {what}, expected gray or red, green and blue: convert it to sRGB");
            return Err(unreadable(path, reason));
        }
        // A picture is in the colors of its profile; bands and depths are numbers.
        let is_picture = !page.is_stack() && matches!(wanted, TiffAs::Marked | TiffAs::Planes(None));
        page.unknown.retain(|tag| *tag != PROFILE || !is_picture);
        unknown.extend(page.unknown.iter().map(|tag| named_tag(*tag)));
        let first = pages.first().map(|(first, _)| first);
        let is_like = first.is_none_or(|first| {
            let is_kind = first.depth == page.depth || !first.is_colored();
            first.size == page.size && first.n_samples == page.n_samples && is_kind
        });
        if page.aside.is_some() || (!is_like && first.is_some_and(|first| !first.is_stack())) {
            unused.push(page.aside.map_or_else(|| index.to_string(), |what| format!("{index} ({what})")));
        } else if let Some(first) = first.filter(|first| is_like && first.depth != page.depth) {
            let of = |page: &Page| match page.depth {
                SampleDepth::Float => format!("floats of {} bits", page.bits),
                SampleDepth::Signed(bits) => format!("whole numbers of {bits} bits with a sign"),
                SampleDepth::Unsigned(bits) => format!("whole numbers of {bits} bits"),
            };
            let reason =
                format!("its page {index} holds {}, its first {}: expected pages of one kind", of(&page), of(first));
            return Err(unreadable(path, reason));
        } else if is_like {
            pages.push((page, at));
        } else {
            let of = |page: &Page| format!("{} × {} samples", page.size.0, page.size.1);
            let (own, first) = (of(&page), first.map(of).unwrap_or_default());
            let reason =
                format!("its page {index} is {own}, its first {first}: expected pages of one size, a band each");
            return Err(unreadable(path, reason));
        }
    }
    let mut notes = vec![];
    if !pages.is_empty() {
        notes = notes_on_page(path, &xmp, of_scene);
    }
    for (kind, mut names) in [("item of GDAL", items), ("text", told), ("tag", unknown)] {
        names.sort();
        names.dedup();
        notes.extend(note_of(path, kind, &names));
    }
    Ok(Pages { pages, unused, notes })
}

/// Returns the samples of the first picture of a file where they are floats, those of an opacity left out and named; `None` where they are codes.
///
/// # Errors
/// When the file is of a kind that is not read, or its samples are no picture's.
pub(super) fn float_planes(path: &Path) -> Result<Option<Noted<Vec<Array2<f32>>>>, SceneError> {
    let Pages { mut pages, .. } = pages_of(path, TiffAs::Planes(None), false)?;
    pages.truncate(1);
    let Some((first, _)) = pages.first() else { return Err(no_page(path)) };
    match first.depth {
        SampleDepth::Float => {}
        SampleDepth::Unsigned(..=16) => return Ok(None),
        _ => {
            let reason = "its samples are whole numbers with a sign, or of 32 bits and more, expected codes of 8 or 16 bits, or floats";
            return Err(unreadable(path, reason));
        }
    }
    let mut planes = planes_of_pages(path, &pages)?;
    let words = unpacked(&pages, first.words(), &mut planes);
    planes.iter_mut().for_each(|plane| words.count_from_black(plane, None));
    let note = without_opacity(path, &pages[0].0, &mut planes);
    Ok(Some(Noted::new(planes, note)))
}

/// Returns what is said of the pages and samples of a TIFF file of which the first picture is taken; of one that is not read here nothing, since whoever
/// decodes it says what is wrong.
pub(super) fn notes_on_pages(path: &Path) -> Vec<String> {
    let Ok(Pages { pages, unused, mut notes }) = pages_of(path, TiffAs::Planes(None), false) else { return vec![] };
    notes.extend(notes_on_others(path, &pages, unused));
    notes
}

/// Names the pages behind the first, its sample that is neither a color nor an opacity, and what it states that no picture is made of.
fn notes_on_others(path: &Path, pages: &[(Page, u64)], mut unused: Vec<String>) -> Vec<String> {
    unused.extend(pages.iter().skip(1).map(|(page, _)| (page.index + 1).to_string()));
    let mut notes: Vec<String> = note_of(path, "page", &unused).into_iter().collect();
    let Some((first, _)) = pages.first() else { return notes };
    let unknown = first.unknown_sample().map(|sample| format!("sample {sample} (ExtraSamples 0)"));
    notes.extend(note_of(path, "channel", unknown.as_slice()));
    if first.depth != SampleDepth::Float {
        let no_data = first.words().no_data.map(|none| none.to_string());
        notes.extend(note_of(path, "number for no data (GDAL)", no_data.as_slice()));
        notes.extend(note_of(path, "word of GDAL", &first.gdal.of_numbers()));
    } else {
        notes.extend(first.words().note_of_unit(path));
    }
    let named: Vec<String> = first.names().filter_map(|text| comment(text.as_bytes())).collect();
    notes.extend(note_of(path, "name", &named));
    let told: Vec<String> = first.descriptions.iter().filter_map(|text| comment(text.as_bytes())).collect();
    notes.extend(note_of(path, "description", &told));
    notes
}

/// Returns the samples of all pages, a plane each.
fn planes_of_pages(path: &Path, pages: &[(Page, u64)]) -> Result<Vec<Array2<f32>>, SceneError> {
    let broken = |error| broken(path, &error);
    let mut decoder = AsGray::open(path, pages, LIMIT_PAGES).map_err(|error| unreadable(path, error))?;
    let mut planes = vec![];
    for (page, _) in pages {
        if page.has_tiles_of_planes {
            // What decodes it stumbles over such tiles.
            return Err(unreadable(
                path,
                "its bands lie apart and in tiles, expected strips, or the bands of a sample together",
            ));
        }
        if !matches!(page.bits, 8 | 16 | 32 | 64) {
            let reason = format!(
                "its samples are of {} {}, expected 8, 16, 32 or 64 where they are bands or depths: convert it",
                page.bits,
                if page.bits == 1 { "bit" } else { "bits" }
            );
            return Err(unreadable(path, reason));
        }
        decoder.seek_to_image(page.index).map_err(broken)?;
        planes.extend(planes_of(&mut decoder, page).map_err(broken)?);
    }
    Ok(planes)
}

/// Leaves out the samples of a page that are opacities, and names them.
fn without_opacity(path: &Path, first: &Page, planes: &mut Vec<Array2<f32>>) -> Option<String> {
    let opacities = first.opacities();
    let mut index = 0;
    planes.retain(|_| {
        index += 1;
        !opacities.contains(&((index - 1) % first.n_samples))
    });
    (!opacities.is_empty()).then(|| note_of(path, "channel", &["opacity".to_owned()])).flatten()
}

/// Returns what is said of samples that are marked as opacities and are bands.
fn note_on_opacities(path: &Path, first: &Page) -> Option<String> {
    let first_extra = first.n_samples.saturating_sub(first.extra.len());
    let marked: Vec<String> = first
        .opacities()
        .into_iter()
        .filter(|sample| *sample >= first_extra)
        .map(|own| (own + 1).to_string())
        .collect();
    (!marked.is_empty()).then(|| {
        format!(
            "{}: its sample {} of a pixel, marked as an opacity (ExtraSamples), is taken for a band: there are as many wavelengths as samples",
            name_of(path),
            marked.join(" and ")
        )
    })
}

/// Returns red, green and blue of a page of floats; a further sample is left out.
fn colors_of(path: &Path, mut planes: Vec<Array2<f32>>) -> Result<[Array2<f32>; 3], SceneError> {
    if planes.len() == 2 || planes.len() == 4 {
        planes.pop();
    }
    let mut planes = planes.into_iter();
    match (planes.next(), planes.next(), planes.next()) {
        (Some(r), Some(g), Some(b)) => Ok([r, g, b]),
        (Some(gray), None, None) => Ok([gray.clone(), gray.clone(), gray]),
        _ => Err(unreadable(path, "its samples are neither gray nor red, green and blue")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A TIFF of one strip of 4 × 2 samples of so many bits, with further entries of a directory: tag, type, values.
    fn tiff(n_samples: u16, bits: u16, more: &[(u16, u16, Vec<u32>)]) -> Vec<u8> {
        let strip = vec![1_u8; usize::from(n_samples) * 8 * usize::from(bits).max(8) / 8];
        let mut entries: Vec<(u16, u16, Vec<u32>)> = [
            (256, 4, vec![4]),
            (257, 4, vec![2]),
            (258, 3, vec![bits.into(); n_samples.into()]),
            (259, 3, vec![1]),
            (262, 3, vec![if n_samples == 3 { 2 } else { 1 }]),
            (273, 4, vec![8]),
            (277, 3, vec![n_samples.into()]),
            (278, 4, vec![2]),
            (279, 4, vec![strip.len() as u32]),
        ]
        .into();
        entries.extend(more.iter().cloned());
        let (mut file, mut directory) = (vec![], (entries.len() as u16).to_le_bytes().to_vec());
        file.extend([&b"II*\0"[..], &[0; 4], &strip].concat());
        for (tag, kind, values) in entries {
            let bytes: Vec<u8> = values
                .iter()
                .flat_map(|v| if kind == 3 { (*v as u16).to_le_bytes().to_vec() } else { v.to_le_bytes().to_vec() })
                .collect();
            let n = if kind == 5 { values.len() / 2 } else { values.len() };
            directory.extend([&tag.to_le_bytes()[..], &kind.to_le_bytes(), &(n as u32).to_le_bytes()].concat());
            if bytes.len() > 4 {
                directory.extend((file.len() as u32).to_le_bytes());
                file.extend(bytes);
            } else {
                directory.extend([&bytes[..], &vec![0; 4 - bytes.len()]].concat());
            }
        }
        let at = file.len() as u32;
        file[4..8].copy_from_slice(&at.to_le_bytes());
        [file, directory, vec![0; 4]].concat()
    }

    #[test]
    fn codes_of_black_and_white_are_named_where_unusual() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tif");
        for (black, white, is_named) in [(0, 255, false), (16, 235, true)] {
            let range = [black, 1, white, 1].repeat(3);
            std::fs::write(&path, tiff(3, 8, &[(532, 5, range)])).unwrap();
            let mut notes = vec![];
            read_tiff(&path, TiffAs::Marked).unwrap().told_in(&mut notes);
            assert_eq!(notes.join(" ").contains("'532 (Ref"), is_named, "{notes:?}");
        }
    }

    #[test]
    fn bands_of_a_few_bits_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tif");
        std::fs::write(&path, tiff(5, 1, &[])).unwrap();
        let message = read_tiff(&path, TiffAs::Marked).map(|_| ()).unwrap_err().to_string();
        assert!(message.contains("of 1 bit, expected 8"), "{message}");
    }
}
