//! Words: on pictures in `DejaVu` Sans, which is built in, the same pixels on every machine; in drawings in the font of
//! the reader's system.

use std::sync::LazyLock;

use ab_glyph::{Font, FontRef, Glyph, PxScale, ScaleFont, point};
use image::{Rgb, RgbImage};

/// The font of all drawings: what the reader's system has.
pub(crate) const FONT: &str = "system-ui, 'Segoe UI', 'DejaVu Sans', Helvetica, Arial, sans-serif";

/// A face of the font that is built in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Weight {
    Regular,
    Bold,
}

/// How words are written: the size of their em in pixels, weight and color.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ink {
    pub(crate) em_px: f64,
    pub(crate) weight: Weight,
    pub(crate) color: [u8; 3],
}

static FACES: LazyLock<[FontRef<'static>; 2]> = LazyLock::new(|| {
    [dejavu::sans::regular(), dejavu::sans::bold()]
        .map(|face| FontRef::try_from_slice(face).expect("the built-in font is sound"))
});

fn face(weight: Weight) -> &'static FontRef<'static> {
    &FACES[weight as usize]
}

/// Returns the glyphs of words that start at the origin, and where the next word would start, px.
fn glyphs(words: &str, em_px: f64, weight: Weight) -> (Vec<Glyph>, f32) {
    let font = face(weight);
    // The library's size is from the highest to the lowest line, not that of the em.
    let em = font.units_per_em().unwrap_or(1.0);
    let scale = PxScale::from(em_px as f32 * font.height_unscaled() / em);
    let scaled = font.as_scaled(scale);
    let mut x = 0.0;
    let mut last = None;
    let glyphs = words.chars().map(|letter| {
        let id = font.glyph_id(letter);
        x += last.replace(id).map_or(0.0, |last| scaled.kern(last, id));
        let glyph = id.with_scale_and_position(scale, point(x, 0.0));
        x += scaled.h_advance(id);
        glyph
    });
    let glyphs = glyphs.collect();
    (glyphs, x)
}

/// Returns how wide words are in a font of this size, px.
///
/// `DejaVu` Sans is wider than most system fonts, so that this is enough room for any of them.
pub(crate) fn width_px(words: &str, em_px: f64, weight: Weight) -> f64 {
    f64::from(glyphs(words, em_px, weight).1)
}

/// Writes words on a picture; `x, y` is the left end of their baseline.
pub(crate) fn write(picture: &mut RgbImage, (x, y): (f64, f64), ink: &Ink, words: &str) {
    for mut glyph in glyphs(words, ink.em_px, ink.weight).0 {
        glyph.position.x += x as f32;
        glyph.position.y += y as f32;
        let Some(outline) = face(ink.weight).outline_glyph(glyph) else { continue };
        let corner = outline.px_bounds().min;
        outline.draw(|column, row, cover| {
            let (column, row) = (corner.x as i64 + i64::from(column), corner.y as i64 + i64::from(row));
            let (Ok(column), Ok(row)) = (u32::try_from(column), u32::try_from(row)) else { return };
            if let Some(Rgb(pixel)) = picture.get_pixel_mut_checked(column, row) {
                for (below, over) in pixel.iter_mut().zip(ink.color) {
                    let mixed = f32::from(*below) + cover.clamp(0.0, 1.0) * (f32::from(over) - f32::from(*below));
                    *below = mixed.round() as u8;
                }
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INK: Ink = Ink { em_px: 18.0, weight: Weight::Regular, color: [0, 0, 0] };

    #[test]
    fn units_and_greek_have_letters() {
        for letter in ["µ", "°", "λ", "²", "−", "Ø"] {
            let mut picture = RgbImage::from_pixel(30, 30, Rgb([255; 3]));
            write(&mut picture, (5.0, 22.0), &INK, letter);
            let dark = picture.pixels().filter(|p| p.0[0] < 128).count();
            assert!(dark >= 6, "{letter}: {dark}");
            // A letter that the font lacks would be a box as wide as any other such.
            assert_ne!(face(Weight::Regular).glyph_id(letter.chars().next().unwrap()).0, 0, "{letter}");
        }
    }

    #[test]
    fn words_are_as_wide_as_measured() {
        let mut picture = RgbImage::from_pixel(200, 30, Rgb([255; 3]));
        write(&mut picture, (10.0, 22.0), &INK, "550 nm");
        let inked = |x: &u32| (0..30).any(|y| picture.get_pixel(*x, y).0[0] < 128);
        let (first, last) = ((0..200).find(inked).unwrap(), (0..200).rev().find(inked).unwrap());
        let end = 10.0 + width_px("550 nm", 18.0, Weight::Regular);
        // Letters have a few pixels of air about them.
        assert!((10..15).contains(&first) && (end - 4.0..end).contains(&f64::from(last)), "{first} {last} {end}");
        assert!(width_px("550 nm", 18.0, Weight::Bold) > width_px("550 nm", 18.0, Weight::Regular));
    }

    #[test]
    fn words_beyond_the_edge_are_cut() {
        let mut picture = RgbImage::from_pixel(20, 10, Rgb([255; 3]));
        write(&mut picture, (-8.0, 4.0), &INK, "550 nm");
        assert_eq!(picture.dimensions(), (20, 10));
        assert!(picture.pixels().any(|p| p.0[0] < 128));
    }
}
