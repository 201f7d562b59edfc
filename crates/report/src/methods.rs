//! A world both ways, side by side with the difference.

use std::path::Path;

use dioptric_analysis::MethodComparison;
use dioptric_pipeline::{PipelineError, display::code, write_file, write_json};
use image::{Rgb, RgbImage, imageops};
use ndarray::Array2;

use crate::{
    lettering::{Ink, Weight, width_px, write},
    png::png_bytes,
};

/// Space between pictures, px.
const GAP: u32 = 8;
/// Height of the lines of their names, and what is below the last of them, px.
const LINE: u32 = 16;
const BELOW_NAMES: u32 = 10;
/// The difference that is full color, as a share of the mean of the picture.
const FULL: f64 = 0.25;

/// Writes a comparison into a folder: `compare.json`, `compare.csv` and `compare.png`.
///
/// # Errors
/// When a file cannot be written.
pub fn write_comparison(comparison: &MethodComparison, folder: &Path) -> Result<(), PipelineError> {
    write_json(&folder.join("compare.json"), comparison)?;
    write_file(&folder.join("compare.csv"), comparison.table().as_bytes())?;
    write_file(&folder.join("compare.png"), &png_bytes(&comparison_picture(comparison))?)
}

/// Returns both pictures as an observer sees them, exposed alike, and their difference in luminance: red where the blurred
/// view is brighter, blue where it is darker, gray in the band of depth edges that is judged by itself.
pub fn comparison_picture(comparison: &MethodComparison) -> RgbImage {
    let white = comparison.backward.level_at(0.99).max(f64::MIN_POSITIVE);
    let [backward, forward] =
        [&comparison.backward, &comparison.forward].map(|picture| picture.clone().within_gamut().to_srgb(white));
    let difference = difference(comparison);
    let name = format!("forward − backward, full color ±{:.0} % of the mean", 100.0 * FULL);
    side_by_side(&[
        ("backward: rays from the film".to_owned(), backward),
        ("forward: view and point spreads".to_owned(), forward),
        (name, difference),
    ])
}

fn difference(comparison: &MethodComparison) -> RgbImage {
    // Luminance of linear sRGB.
    let luminance = |planes: &[Array2<f32>; 3], at: (usize, usize)| {
        0.2126 * f64::from(planes[0][at]) + 0.7152 * f64::from(planes[1][at]) + 0.0722 * f64::from(planes[2][at])
    };
    let (rows, columns) = comparison.is_edge.dim();
    let of_backward = Array2::from_shape_fn((rows, columns), |at| luminance(&comparison.backward.planes, at));
    let mean = (of_backward.sum() / of_backward.len() as f64).max(f64::MIN_POSITIVE);
    RgbImage::from_fn(columns as u32, rows as u32, |x, y| {
        let at = (y as usize, x as usize);
        let share = (luminance(&comparison.forward.planes, at) - of_backward[at]) / mean / FULL;
        let fade = 1.0 - share.abs().min(1.0);
        let paper = if comparison.is_edge[at] { 0.8 } else { 1.0 };
        let [own, other] = [paper, paper * fade].map(code);
        Rgb(if share > 0.0 { [own, other, other] } else { [other, other, own] })
    })
}

/// Returns pictures of one size beside each other on white, each below its name, which is broken into lines as wide as the picture.
pub(crate) fn side_by_side(pictures: &[(String, RgbImage)]) -> RgbImage {
    let ink = Ink { em_px: 12.0, weight: Weight::Regular, color: [40; 3] };
    let names: Vec<Vec<String>> =
        pictures.iter().map(|(name, picture)| lines(name, f64::from(picture.width()), &ink)).collect();
    let top = LINE * names.iter().map(Vec::len).max().unwrap_or(0) as u32 + BELOW_NAMES;
    let width = pictures.iter().map(|(_, picture)| picture.width()).sum::<u32>() + GAP * (pictures.len() as u32 + 1);
    let height = pictures.iter().map(|(_, picture)| picture.height()).max().unwrap_or(0) + top + GAP;
    let mut sheet = RgbImage::from_pixel(width, height, Rgb([255; 3]));
    let mut x = GAP;
    for ((_, picture), lines) in pictures.iter().zip(names) {
        for (row, line) in lines.iter().rev().enumerate() {
            write(&mut sheet, (f64::from(x), f64::from(top - 8 - LINE * row as u32)), &ink, line);
        }
        imageops::replace(&mut sheet, picture, i64::from(x), i64::from(top));
        x += picture.width() + GAP;
    }
    sheet
}

/// Breaks words into lines no wider than so many pixels, a word that is wider by itself on a line of its own.
fn lines(words: &str, width: f64, ink: &Ink) -> Vec<String> {
    let mut lines: Vec<String> = vec![];
    for word in words.split_whitespace() {
        match lines.last_mut() {
            Some(line) if width_px(&format!("{line} {word}"), ink.em_px, ink.weight) <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_stand_beside_each_other_below_their_names() {
        let picture = |value: u8| RgbImage::from_pixel(40, 30, Rgb([value; 3]));
        let sheet = side_by_side(&[("a".to_owned(), picture(10)), ("b".to_owned(), picture(200))]);
        let top = LINE + BELOW_NAMES;
        assert_eq!(sheet.dimensions(), (3 * GAP + 80, top + 30 + GAP));
        let at = |x: u32| sheet.get_pixel(x, top + 15).0[0];
        assert_eq!([at(GAP + 5), at(2 * GAP + 45)], [10, 200]);
        assert!((0..top).any(|y| (GAP..GAP + 12).any(|x| sheet.get_pixel(x, y).0[0] < 128)));
    }

    #[test]
    fn names_wider_than_their_pictures_take_several_lines() {
        let ink = Ink { em_px: 12.0, weight: Weight::Regular, color: [0; 3] };
        let name = "forward − backward, full color ±25 % of the mean";
        let broken = lines(name, 120.0, &ink);
        assert!(broken.len() > 1 && broken.join(" ") == name, "{broken:?}");
        assert!(broken.iter().all(|line| width_px(line, 12.0, Weight::Regular) <= 120.0));
        let sheet =
            side_by_side(&[(name.to_owned(), RgbImage::new(120, 30)), ("b".to_owned(), RgbImage::new(120, 30))]);
        assert_eq!(sheet.height(), LINE * broken.len() as u32 + BELOW_NAMES + 30 + GAP);
    }
}
