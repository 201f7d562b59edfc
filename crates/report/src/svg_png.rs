//! SVG drawings as PNG pictures.

use std::sync::{Arc, LazyLock};

use resvg::{
    tiny_skia::{Color, Pixmap, Transform},
    usvg::{self, Tree, fontdb},
};

use dioptric_pipeline::PipelineError;

/// The longest side of a picture, pixels.
const LONGEST_PX: f64 = 20_000.0;

/// The fonts that every drawing finds, whatever the machine has: the same text, the same pixels.
static FONTS: LazyLock<Arc<fontdb::Database>> = LazyLock::new(|| {
    let mut fonts = fontdb::Database::new();
    for face in [dejavu::sans::regular(), dejavu::sans::bold(), dejavu::sans::oblique()] {
        fonts.load_font_data(face.to_vec());
    }
    fonts.set_sans_serif_family("DejaVu Sans");
    fonts.set_serif_family("DejaVu Sans");
    fonts.set_monospace_family("DejaVu Sans");
    Arc::new(fonts)
});

/// Returns an SVG document as a PNG of `scale` pixels for each of its own, on white.
///
/// Text is set in `DejaVu` Sans, which is built in, so that the picture is the same on every machine.
///
/// # Errors
/// When the text is no SVG, or the picture would be empty or longer than 20,000 pixels.
pub fn svg_to_png(svg: &str, scale: f64) -> Result<Vec<u8>, PipelineError> {
    let cannot = |reason: String| PipelineError::Png { reason };
    let options = usvg::Options { fontdb: FONTS.clone(), font_family: "DejaVu Sans".to_owned(), ..Default::default() };
    let tree = Tree::from_str(svg, &options).map_err(|e| cannot(e.to_string()))?;
    let [width, height] = [tree.size().width(), tree.size().height()].map(|px| (f64::from(px) * scale).ceil());
    if !(width >= 1.0 && height >= 1.0 && width.max(height) <= LONGEST_PX) {
        return Err(cannot(format!("the drawing is {width} x {height} pixels, expected 1 to {LONGEST_PX} a side")));
    }
    let mut pixels = Pixmap::new(width as u32, height as u32)
        .ok_or_else(|| cannot(format!("{width} x {height} pixels do not fit")))?;
    pixels.fill(Color::WHITE);
    resvg::render(&tree, Transform::from_scale(scale as f32, scale as f32), &mut pixels.as_mut());
    pixels.encode_png().map_err(|e| cannot(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: &str = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"40\" height=\"20\">\
        <rect x=\"0\" y=\"0\" width=\"20\" height=\"20\" fill=\"#ff0000\"/></svg>";

    fn picture(svg: &str, scale: f64) -> image::RgbImage {
        image::load_from_memory(&svg_to_png(svg, scale).unwrap()).unwrap().to_rgb8()
    }

    #[test]
    fn shapes_have_their_place_and_the_rest_is_white() {
        let picture = picture(SQUARE, 1.5);
        assert_eq!(picture.dimensions(), (60, 30));
        assert_eq!((picture.get_pixel(10, 15).0, picture.get_pixel(50, 15).0), ([255, 0, 0], [255, 255, 255]));
    }

    #[test]
    fn words_are_drawn_in_any_font_that_is_asked_for() {
        for font in ["Helvetica, Arial, sans-serif", "system-ui", crate::lettering::FONT] {
            let svg = format!(
                "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"90\" height=\"30\">\
                 <text x=\"5\" y=\"22\" font-size=\"18\" font-family=\"{font}\">µm ° λ</text></svg>"
            );
            let dark = picture(&svg, 1.0).pixels().filter(|p| p.0[0] < 128).count();
            // Six letters of some twenty pixels each.
            assert!(dark > 60, "{font}: {dark}");
        }
    }

    #[test]
    fn what_cannot_be_drawn_is_said() {
        for (svg, scale, word) in [("<p>", 1.0, "PNG"), (SQUARE, 1e6, "40000000"), (SQUARE, 0.0, "0 x 0")] {
            let message = svg_to_png(svg, scale).unwrap_err().to_string();
            assert!(message.contains(word), "{message}");
        }
    }
}
