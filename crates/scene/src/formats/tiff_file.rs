//! TIFF files of numbers: stacks of pages, many samples a pixel, floats and signed numbers.

use std::{fs::File, io::BufReader, path::Path};

use ndarray::Array2;
use tiff::decoder::{Decoder, Limits};

use super::{
    stated::{Noted, note_of},
    tiff_bands::{AsGray, planes_of},
    tiff_directory::Directory,
    tiff_page::{Marked, Page, PageWords, SampleDepth, wavelengths_of},
    unusable::{check_memory, said, unreadable},
};
use crate::SceneError;

/// The tag of a description.
const DESCRIPTION: u16 = 270;
/// Pages of a file.
const LIMIT_PAGES: usize = 10_000;

/// What is wanted of a TIFF file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TiffAs {
    /// What it is marked as: a picture, or a stack of planes.
    Marked,
    /// Planes of numbers, whatever they are marked as; so many where it is known, so that one marked as an opacity may be among them.
    Planes(Option<usize>),
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
    let Pages { mut pages, mut unused, mut notes } = pages_of(path)?;
    let Some((first, _)) = pages.first() else { return Err(unreadable(path, "it has no page of full size")) };
    let words = first.words();
    let as_planes = first.is_stack() || (wanted != TiffAs::Marked && first.has_plain_samples());
    // Gray pages are planes of a stack, colored ones a picture and others.
    let is_picture = !as_planes && (pages.len() == 1 || first.n_samples > 1);
    if is_picture {
        unused.extend(pages[1..].iter().map(|(page, _)| (page.index + 1).to_string()));
        notes.extend(note_of(path, "page", &unused));
        let unknown = first.unknown_sample().map(|sample| format!("sample {sample} (ExtraSamples 0)"));
        notes.extend(note_of(path, "channel", unknown.as_slice()));
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
    if is_picture {
        if first.unknown_sample().is_none() {
            notes.extend(without_opacity(path, first, &mut planes));
        }
        return Ok(Noted::new(TiffFile::Linear(colors_of(path, planes)?, words), notes));
    }
    let top = first.top();
    let own: Vec<Page> = pages.into_iter().map(|(page, _)| page).collect();
    // Where there are as many wavelengths as samples, what is marked as an opacity is a band.
    let is_whole = wanted == TiffAs::Planes(Some(planes.len())) || wavelengths_of(&own, planes.len()).is_some();
    if !is_whole {
        notes.extend(without_opacity(path, &own[0], &mut planes));
    }
    let wavelengths_nm = wavelengths_of(&own, planes.len()).map(|(list, left)| {
        notes.extend(note_of(path, "key of its description", &left));
        list
    });
    Ok(Noted::new(TiffFile::Stack(TiffStack { planes, wavelengths_nm, top, page: words }), notes))
}

/// The pages of a file that are like its first, with the places of their directories.
struct Pages {
    pages: Vec<(Page, u64)>,
    /// The numbers of others, from 1.
    unused: Vec<String>,
    /// The tags that nobody knows.
    notes: Vec<String>,
}

fn pages_of(path: &Path) -> Result<Pages, SceneError> {
    let broken = |error: tiff::TiffError| unreadable(path, said(error));
    let file = File::open(path).map_err(|error| unreadable(path, error))?;
    let length = file.metadata().map_err(|error| unreadable(path, error))?.len();
    let mut decoder = Decoder::new(BufReader::new(file)).map_err(broken)?.with_limits(Limits::default());
    let mut pages: Vec<(Page, u64)> = vec![];
    let (mut bytes, mut unused, mut unknown) = (0, vec![], vec![]);
    for index in 1.. {
        let mut page = Page::of(&mut decoder, index - 1).map_err(broken)?;
        let at = decoder.ifd_pointer().map_or(0, |place| place.0);
        if pages.is_empty() && !page.is_reduced && !page.descriptions.is_empty() {
            // What decodes the file keeps the last of two.
            let mut file = File::open(path).map_err(|error| unreadable(path, error))?;
            let directory = Directory::read(&mut file, at).map_err(|error| unreadable(path, error))?;
            page.descriptions = directory.texts(&mut file, DESCRIPTION).map_err(|error| unreadable(path, error))?;
        }
        bytes += page.bytes();
        // Its numbers as they stand, and as single floats.
        check_memory(path, bytes.saturating_mul(2), length)?;
        if index > LIMIT_PAGES {
            return Err(unreadable(path, format!("it has more than {LIMIT_PAGES} pages")));
        }
        if page.marked == Marked::Inks {
            return Err(unreadable(
                path,
                "it holds inks (CMYK), expected gray or red, green and blue; convert it to sRGB",
            ));
        }
        if page.marked == Marked::Palette {
            let reason = "it has a table of colors (palette), expected gray or red, green and blue; convert it to sRGB";
            return Err(unreadable(path, reason));
        }
        unknown.extend(page.unknown.iter().map(ToString::to_string));
        let first = pages.first().map(|(first, _)| first);
        let is_like = first.is_none_or(|first| first.size == page.size && first.n_samples == page.n_samples);
        if page.is_reduced || (!is_like && first.is_some_and(|first| !first.is_stack())) {
            unused.push(if page.is_reduced { format!("{index} (reduced)") } else { index.to_string() });
        } else if is_like {
            pages.push((page, at));
        } else {
            let of = |page: &Page| format!("{} × {} samples", page.size.0, page.size.1);
            let (own, first) = (of(&page), first.map(of).unwrap_or_default());
            let reason =
                format!("its page {index} is {own}, its first {first}: expected pages of one size, a band each");
            return Err(unreadable(path, reason));
        }
        if !decoder.more_images() {
            break;
        }
        decoder.next_image().map_err(broken)?;
    }
    unknown.sort();
    unknown.dedup();
    let notes = note_of(path, "tag", &unknown).into_iter().collect();
    Ok(Pages { pages, unused, notes })
}

/// Returns the samples of all pages, a plane each.
fn planes_of_pages(path: &Path, pages: &[(Page, u64)]) -> Result<Vec<Array2<f32>>, SceneError> {
    let broken = |error: tiff::TiffError| unreadable(path, said(error));
    let mut decoder = AsGray::open(path, pages).map_err(|error| unreadable(path, error))?;
    let mut planes = vec![];
    for (page, _) in pages {
        if page.has_tiles_of_planes {
            // What decodes it stumbles over such tiles.
            return Err(unreadable(
                path,
                "its bands lie apart and in tiles, expected strips, or the bands of a sample together",
            ));
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
