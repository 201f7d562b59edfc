//! From the raw frame to the picture.

use dioptric_pipeline::{Camera, light_word, parse_illuminant, parse_white, white_word};
use dioptric_sensor::{
    Brightness, ColorCorrection, ColorSpace, Demosaic, Highlights, LensShading, LocalTone, Processing, ToneCurve,
};
use dioptric_spectrum::Illuminant;
use egui::Ui;

use super::{
    super::fields::{NumberField, choice, meaning, optional, tick, variant},
    Desk,
};
use crate::engine::Field;

pub(super) fn show(ui: &mut Ui, camera: &mut Camera, desk: &Desk<'_>) {
    let processing = &mut camera.processing;
    raw(ui, processing);
    colors(ui, processing);
    tones(ui, processing);
    desk.tell(ui, Field::Processing, camera);
}

/// Of the raw frame, before and while it gets its colors.
fn raw(ui: &mut Ui, processing: &mut Processing) {
    let methods = Demosaic::NAMES.map(|(name, method)| (method, name));
    choice(ui, "demosaic", "How the missing colors are found", &mut processing.demosaic, &methods);
    let highlights = [(Highlights::Reconstruct, "rebuilt"), (Highlights::Clip, "clipped")];
    choice(ui, "highlights", "What becomes of light beyond saturation", &mut processing.highlights, &highlights);
    let words = "How much noise is taken out: 0 none, 0.5 what noise may be, more what texture may be too";
    let field = NumberField::even("denoising", "", 0.0..=100.0, 0.0..=2.0, words);
    optional(ui, field, &mut processing.denoise, 0.5);
    let words = "Pixels further than this above or below all their neighbors are replaced, as a share of saturation";
    let field = NumberField::even("defects", "", 0.0..=1.0, 0.0..=0.5, words);
    optional(ui, field, &mut processing.defect_threshold, 0.1);
    shading(ui, &mut processing.shading);
    let words =
        "Standard deviation of the blur by lens and pixels that is undone; 0.5 to 0.8 for sharp lenses, 0 leaves it";
    NumberField::even("sharpening", "px", 0.0..=2.0, 0.0..=2.0, words).show(ui, &mut processing.sharpen_px);
    ui.label("Undone of the simulated lens:");
    let corrections = &mut processing.lens_corrections;
    tick(ui, "distortion", "Straight lines of the scene become straight", &mut corrections.distortion);
    tick(ui, "lateral color", "The channels are laid over each other", &mut corrections.lateral_color);
    tick(ui, "vignetting", "An even surface becomes even", &mut corrections.vignetting);
}

fn shading(ui: &mut Ui, shading: &mut Option<LensShading>) {
    let mut kind = match shading {
        None => 0,
        Some(LensShading::Radial { .. }) => 1,
        Some(LensShading::Map(_)) => 2,
    };
    // A map has as many numbers as cells: it comes from a file.
    let mut kinds = vec![(0, "as it is"), (1, "by a formula")];
    kinds.extend(matches!(shading, Some(LensShading::Map(_))).then_some((2, "by the map of the camera file")));
    let words = "The fall of light towards the corners that is undone";
    if choice(ui, "shading", words, &mut kind, &kinds) {
        *shading = (kind == 1).then_some(LensShading::Radial { a2: 0.3, a4: 0.0, a6: 0.0 });
    }
    if let Some(LensShading::Radial { a2, a4, a6 }) = shading {
        let field = |label, words| NumberField::even(label, "", -100.0..=100.0, -2.0..=2.0, words);
        field("shading r²", "Factor of r², r being 1 at the corners").show(ui, a2);
        field("shading r⁴", "Factor of r⁴, r being 1 at the corners").show(ui, a4);
        field("shading r⁶", "Factor of r⁶, r being 1 at the corners").show(ui, a6);
    }
}

fn colors(ui: &mut Ui, processing: &mut Processing) {
    let now = white_word(&processing.white).unwrap_or_else(|| "as in the file".to_owned());
    let words = "What is made white: scene, none, gray-world, white-patch, shades-of-gray, gray-edge, patch:X,Y,W,H, or a light";
    let parse = |text: &str| parse_white(text).map_err(|error| error.to_string());
    if let Some(white) = meaning(ui, "white", words, &now, parse) {
        processing.white = white;
    }
    let mut corrections = vec![
        (ColorCorrection::Auto, "matrix for the white's light"),
        (ColorCorrection::AutoUnder(Illuminant::D65), "the same for a light"),
        (ColorCorrection::Roots, "always with roots of products"),
        (ColorCorrection::Fitted(Illuminant::D65), "matrix for a light"),
        (ColorCorrection::FittedRoots(Illuminant::D65), "matrix with roots for a light"),
        (ColorCorrection::None, "none"),
    ];
    if let ColorCorrection::Matrix(_) = processing.color {
        corrections.push((processing.color.clone(), "the matrix of the camera file"));
    }
    variant(ui, "colors", "How channels become colors", &mut processing.color, &corrections);
    if let ColorCorrection::AutoUnder(light) | ColorCorrection::Fitted(light) | ColorCorrection::FittedRoots(light) =
        &mut processing.color
    {
        let now = light_word(light).unwrap_or_else(|| "measured".to_owned());
        let parse = |text: &str| parse_illuminant(text).map_err(|error| error.to_string());
        if let Some(other) = meaning(ui, "fitted under", "The light that the matrix is fitted under", &now, parse) {
            *light = other;
        }
    }
    let spaces = [(ColorSpace::Srgb, "sRGB"), (ColorSpace::DisplayP3, "Display P3")];
    choice(ui, "primaries", "The primaries of the picture", &mut processing.space, &spaces);
}

fn tones(ui: &mut Ui, processing: &mut Processing) {
    let kinds = [
        (Brightness::AsExposed, "as exposed"),
        (Brightness::Factor(2.0), "by a factor"),
        (Brightness::Percentile { percent: 99.0, to: 0.9 }, "by a percentile"),
    ];
    variant(ui, "brightness", "How bright the picture is made", &mut processing.brightness, &kinds);
    match &mut processing.brightness {
        Brightness::AsExposed => {}
        Brightness::Factor(factor) => {
            let field = NumberField::by_factors("factor", "×", 1e-3..=1e4, 0.1..=16.0, "Factor on the light");
            field.show(ui, factor);
        }
        Brightness::Percentile { percent, to } => {
            let words = "The share of pixels that come to lie below";
            NumberField::even("percent", "%", 0.0..=100.0, 50.0..=100.0, words).show(ui, percent);
            let field =
                NumberField::even("put at", "", 1e-3..=10.0, 0.1..=1.0, "Where that share is put, white being 1");
            field.show(ui, to);
        }
    }
    let LocalTone { range, detail } = &mut processing.local_tone;
    let words = "Factor on the contrast between parts of the picture, in stops; 1 leaves it";
    NumberField::even("local range", "×", 0.0..=2.0, 0.0..=2.0, words).show(ui, range);
    let words = "Factor on the contrast within parts of the picture, in stops; 1 leaves it";
    NumberField::even("local detail", "×", 0.0..=4.0, 0.0..=4.0, words).show(ui, detail);
    let curves = [
        (ToneCurve::Srgb, "sRGB"),
        (ToneCurve::Linear, "linear"),
        (ToneCurve::Gamma(0.6), "power"),
        (ToneCurve::Filmic { contrast: 0.5 }, "filmic"),
    ];
    variant(ui, "curve", "The curve from light to codes", &mut processing.curve, &curves);
    match &mut processing.curve {
        ToneCurve::Gamma(power) => {
            NumberField::even("power", "", 0.01..=10.0, 0.2..=2.0, "Power of the light").show(ui, power);
        }
        ToneCurve::Filmic { contrast } => {
            NumberField::even("contrast", "", 0.0..=1.0, 0.0..=1.0, "Contrast of the middle").show(ui, contrast);
        }
        ToneCurve::Srgb | ToneCurve::Linear => {}
    }
}
