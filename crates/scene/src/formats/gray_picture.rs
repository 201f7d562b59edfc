//! Gray pictures of numbers: depths, and bands of folders.

use std::path::Path;

use dioptric_pictures::{DynamicImage, StatedColors};
use ndarray::Array2;

use super::{
    picture::{decode, has_holes, pnm_top},
    picture_parts::{note_of_orientation, notes_on_parts},
    stated::{Noted, name_of, note_of},
    tiff_directory::is_tiff,
    tiff_file::{TiffAs, TiffFile, TiffStack, read_tiff},
    tiff_page::PageWords,
    unusable::unreadable,
};
use crate::SceneError;

/// The numbers of a gray picture as they stand there.
pub(super) struct GrayPicture {
    /// What stands for none is no number.
    pub(super) values: Array2<f32>,
    /// The largest code of whole numbers; `None` of floats.
    pub(super) top: Option<f64>,
    /// The wavelength that the file states, nm.
    pub(super) wavelength_nm: Option<f64>,
    /// What a page of a TIFF says of them.
    pub(super) page: PageWords,
}

/// Reads a gray picture, which may be saved as a colored one; of a TIFF of several planes that of the number told, from 1.
///
/// # Errors
/// When it cannot be read, has colors, or several planes of which none is told.
pub(super) fn read_gray(path: &Path, wanted: TiffAs, told: Option<&str>) -> Result<Noted<GrayPicture>, SceneError> {
    if is_tiff(path) {
        let mut notes = vec![];
        let file = read_tiff(path, wanted)?.told_in(&mut notes);
        let gray = of_tiff(path, file, told, &mut notes)?;
        // Depths have lengths.
        notes.extend(gray.page.note_of_unit(path).filter(|_| wanted != TiffAs::Depths));
        notes.extend(note_of_colors(path).filter(|_| wanted != TiffAs::Depths));
        return Ok(Noted::new(gray, notes));
    }
    if told.is_some() {
        return Err(unreadable(path, "it has one plane without a name, expected it without --depth-variable"));
    }
    let mut notes = notes_on_parts(path)?;
    notes.extend(note_of_orientation(path));
    notes.extend(note_of_colors(path));
    let gray = codes_of(path, &mut notes)?;
    Ok(Noted::new(gray, notes))
}

/// Returns what is said of the light of codes that a file states, be it sRGB's, where they are taken as numbers.
fn note_of_colors(path: &Path) -> Option<String> {
    let stated = match StatedColors::of_floats(path) {
        Ok(None) => StatedColors::are_in_chunks(path).then(|| "sRGB".to_owned())?,
        Ok(Some(colors)) => colors.name,
        // What cannot be converted to light is a number all the same.
        Err(reason) => reason,
    };
    Some(format!("{}: its codes are taken as numbers, and not as it states their light: {stated}", name_of(path)))
}

fn of_tiff(
    path: &Path,
    file: TiffFile,
    told: Option<&str>,
    notes: &mut Vec<String>,
) -> Result<GrayPicture, SceneError> {
    let page = match &file {
        TiffFile::Picture(page) | TiffFile::Linear(_, page) => page.clone(),
        TiffFile::Stack(stack) => stack.page.clone(),
    };
    let mut gray = match file {
        TiffFile::Picture(page) => {
            notes.extend(page.note_of_orientation(path));
            // What decodes pictures counts them from black.
            let mut gray = codes_of(path, notes)?;
            page.count_from_black(&mut gray.values, gray.top);
            gray
        }
        TiffFile::Linear([values, ..], _) => {
            GrayPicture { values, top: None, wavelength_nm: None, page: PageWords::default() }
        }
        TiffFile::Stack(stack) => plane_of(path, stack, told, notes)?,
    };
    page.ignore(&mut gray.values);
    gray.page = page.clone();
    notes.extend(page.notes_of_description(path));
    Ok(gray)
}

/// Returns the plane of a stack that is told, or its only one; planes that are all alike are one.
fn plane_of(
    path: &Path,
    mut stack: TiffStack,
    told: Option<&str>,
    notes: &mut Vec<String>,
) -> Result<GrayPicture, SceneError> {
    let n = stack.planes.len();
    let are_alike = n > 1 && stack.planes[1..].iter().all(|plane| *plane == stack.planes[0]);
    let index = match told {
        Some(told) => {
            told.trim().parse().ok().filter(|number| (1..=n).contains(number)).map(|number: usize| number - 1)
        }
        None => (n == 1 || are_alike).then_some(0),
    };
    let index = index.ok_or_else(|| {
        let reason = format!(
            "it has {n} planes, samples of a pixel or pages: expected one, or of a depth its number by --depth-variable, 1 to {n}"
        );
        unreadable(path, reason)
    })?;
    let others: Vec<String> =
        (0..n).filter(|own| *own != index && !are_alike).map(|own| (own + 1).to_string()).collect();
    notes.extend(note_of(path, "plane", &others));
    let wavelength_nm = stack.wavelengths_nm.as_ref().map(|list| list[index]);
    Ok(GrayPicture { values: stack.planes.swap_remove(index), top: stack.top, wavelength_nm, page: stack.page })
}

/// Returns the codes of a gray picture and the largest that there can be.
fn codes_of(path: &Path, notes: &mut Vec<String>) -> Result<GrayPicture, SceneError> {
    let of = |size: (u32, u32), codes: Vec<f32>, top: u16| {
        let values = Array2::from_shape_vec((size.1 as usize, size.0 as usize), codes).expect("a code a pixel");
        GrayPicture { values, top: Some(top.into()), wavelength_nm: None, page: PageWords::default() }
    };
    let picture = decode(path, 4)?;
    let size = (picture.width(), picture.height());
    if has_holes(&picture) {
        notes.extend(note_of(path, "channel", &["opacity".to_owned()]));
    }
    let colored = || unreadable(path, "it has colors, expected a gray picture of 8 or 16 bits");
    let mut gray = match picture {
        DynamicImage::ImageLuma8(_) | DynamicImage::ImageLumaA8(_) => {
            of(size, picture.into_luma8().into_raw().into_iter().map(f32::from).collect(), u8::MAX.into())
        }
        DynamicImage::ImageLuma16(_) | DynamicImage::ImageLumaA16(_) => {
            of(size, picture.into_luma16().into_raw().into_iter().map(f32::from).collect(), u16::MAX)
        }
        DynamicImage::ImageRgb8(_) | DynamicImage::ImageRgba8(_) => {
            let picture = picture.into_rgb8();
            let is_gray = picture.pixels().all(|p| p.0[0] == p.0[1] && p.0[2] == p.0[1]);
            let codes = is_gray.then(|| picture.pixels().map(|p| f32::from(p.0[1])).collect());
            of(size, codes.ok_or_else(colored)?, u8::MAX.into())
        }
        DynamicImage::ImageRgb16(_) | DynamicImage::ImageRgba16(_) => {
            let picture = picture.into_rgb16();
            let is_gray = picture.pixels().all(|p| p.0[0] == p.0[1] && p.0[2] == p.0[1]);
            let codes = is_gray.then(|| picture.pixels().map(|p| f32::from(p.0[1])).collect());
            of(size, codes.ok_or_else(colored)?, u16::MAX)
        }
        other => {
            let reason = format!("its samples are {:?}, expected gray ones of 8 or 16 bits", other.color());
            return Err(unreadable(path, reason));
        }
    };
    // Codes whose largest is another were stretched to all of their bits: these are the numbers again.
    let top = gray.top.unwrap_or_default();
    if let Some(own) = pnm_top(path).map(f64::from).filter(|own| *own != top) {
        let factor = (own / top) as f32;
        gray.values.mapv_inplace(|code| (code * factor).round());
        gray.top = Some(own);
    }
    Ok(gray)
}
