//! How the picture is computed: diffraction, blur, sampling, bands; and what is written of it.

use dioptric_pipeline::{
    BlurSpec, BorderSpec, Camera, Diffraction, ExrSamples, FrameFile, LensReflections, Outputs, WavelengthSpec,
};
use egui::Ui;

use super::{
    super::fields::{NumberField, choice, count, numbers, text, tick, variant},
    Desk,
};
use crate::engine::{Field, Rung};

/// The bands that a choice starts with, nm.
const FIRST_NM: f64 = 400.0;
const LAST_NM: f64 = 700.0;

pub(super) fn show(ui: &mut Ui, camera: &mut Camera, desk: &Desk<'_>) {
    let kinds = [
        (Diffraction::None, "none"),
        (Diffraction::Hurb { gamma: 1.0 }, "HURB"),
        (Diffraction::HurbCalibrated, "HURB, calibrated"),
        (Diffraction::Wave, "waves"),
    ];
    variant(ui, "diffraction", "Diffraction at the stop", &mut camera.diffraction, &kinds);
    if let Diffraction::Hurb { gamma } = &mut camera.diffraction {
        let words = "Factor on HURB's spread: 1 as in the paper, 1.414 in later programs";
        NumberField::even("gamma", "×", 1e-3..=100.0, 0.1..=3.0, words).show(ui, gamma);
    }
    let kinds = [
        (LensReflections::Off, "left out"),
        (LensReflections::Ghosts, "ghosts"),
        (LensReflections::Film(0.1), "ghosts, film too"),
    ];
    let words = "Light that surfaces of the lens reflect: ghosts are what two of them reflect";
    variant(ui, "reflections", words, &mut camera.lens_reflections, &kinds);
    if let LensReflections::Film(reflectance) = &mut camera.lens_reflections {
        let words = "The share of the light on the film that it sends back to the lens, as a mirror does";
        NumberField::even("film reflectance", "", 0.0..=1.0, 0.0..=0.5, words).show(ui, reflectance);
    }
    let blurs = [
        (BlurSpec::Layered, "layers of depth"),
        (BlurSpec::Views(16), "layers, from parts of the pupil"),
        (BlurSpec::Pointwise, "point by point"),
    ];
    variant(ui, "blur", "How the point spread functions are laid over the scene", &mut camera.blur, &blurs);
    let borders = [(BorderSpec::Hold, "samples go on"), (BorderSpec::Mirror, "mirrored"), (BorderSpec::Black, "black")];
    variant(ui, "border", "What lies beyond the edges of the scene", &mut camera.border, &borders);
    if let BlurSpec::Views(n) = &mut camera.blur {
        let words = "Parts of the pupil that the scene is seen through one after the other";
        count(ui, "views", words, 2..=256, n);
        if desk.product.is_some_and(|product| product.rung < Rung::Full) {
            ui.weak("The picture shown has layers in place of views; the full one has them.");
        }
    }
    bands(ui, &mut camera.wavelengths);
    desk.tell(ui, Field::Simulation, camera);
}

fn bands(ui: &mut Ui, bands: &mut WavelengthSpec) {
    let kinds = [
        (WavelengthSpec::Scene, "those of the scene"),
        (WavelengthSpec::Range { first_nm: FIRST_NM, last_nm: LAST_NM, step_nm: 10.0 }, "equal steps"),
        (WavelengthSpec::ListNm(vec![450.0, 550.0, 650.0]), "a list"),
    ];
    variant(ui, "bands", "The wavelengths that are simulated", bands, &kinds);
    match bands {
        WavelengthSpec::Scene => {}
        WavelengthSpec::Range { first_nm, last_nm, step_nm } => {
            let nm = |label, words| NumberField::even(label, "nm", 100.0..=20_000.0, 350.0..=1000.0, words);
            nm("first band", "The shortest wavelength").show(ui, first_nm);
            nm("last band", "The longest wavelength; the step must lead there").show(ui, last_nm);
            NumberField::even("step", "nm", 0.1..=1000.0, 1.0..=50.0, "From band to band").show(ui, step_nm);
        }
        WavelengthSpec::ListNm(list) => {
            numbers(ui, "list of bands", "Wavelengths in nm, ascending; 400:700:10 for steps", list);
        }
    }
}

/// What the shot is called, and which files are exported of it.
pub(super) fn output(ui: &mut Ui, camera: &mut Camera) {
    if let Some(name) = text(ui, "name", "What to call the shot", &camera.name) {
        camera.name = name;
    }
    ui.label("Exported beside picture.png and report.html:");
    let Outputs { irradiance, depth, volts, raw, also, exr_samples } = &mut camera.outputs;
    let spectra = "irradiance.exr, the spectral irradiance on the sensor";
    tick(ui, "irradiance", spectra, irradiance);
    tick(ui, "depth map", "depth.exr, the depth that was used", depth);
    tick(ui, "volts", "volts.exr, the voltages of the pixels", volts);
    tick(ui, "raw", "raw.png, the digital numbers in 16 bits", raw);
    let kinds = ExrSamples::NAMES.map(|(name, samples)| (samples, name));
    let words = "How EXR files hold their samples: single floats, half floats (a quarter of the size, off by at most .05 %), or uncompressed";
    choice(ui, "EXR samples", words, exr_samples, &kinds);
    let files = [
        (FrameFile::Electrons, "electrons"),
        (FrameFile::RawTiff, "raw TIFF"),
        (FrameFile::RawDng, "raw DNG"),
        (FrameFile::PicturePng16, "picture PNG, 16 bits"),
        (FrameFile::PictureTiff8, "picture TIFF, 8 bits"),
        (FrameFile::PictureTiff16, "picture TIFF, 16 bits"),
        (FrameFile::PictureExr, "picture EXR"),
    ];
    for (file, name) in files {
        let mut is_on = also.contains(&file);
        if tick(ui, name, "One more file of the frame or the picture", &mut is_on) {
            also.retain(|other| *other != file);
            also.extend(is_on.then_some(file));
        }
    }
}
