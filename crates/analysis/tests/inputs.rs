//! Measurements of the shared inputs that once went wrong.

#![expect(clippy::unwrap_used, reason = "a test that cannot open its files fails")]

use dioptric_analysis::measure::{ChartRequest, CodeCurve, EdgeRequest, MeasuredPicture, PixelRegion};
use dioptric_golden::shared;
use dioptric_pipeline::DevelopedFile;

#[dioptric_golden::needs_shared]
#[test]
fn an_edge_with_two_percent_of_noise_has_its_mtf50_in_every_region() {
    let path = shared("inputs/sensor/edge_noise2pc.png").unwrap();
    let picture = MeasuredPicture::open(&path, CodeCurve::ByFile).unwrap();
    for region in ["20,20,120,120", "0,0,160,160", "30,10,100,140", "40,40,80,80", "10,30,140,100"] {
        let request = EdgeRequest { region: Some(PixelRegion::parse(region).unwrap()), ..EdgeRequest::default() };
        let measured = request.measure(&picture).unwrap();
        let channel = &measured.channels[0];
        let (mtf50, error) = (channel.mtf50_cycles_per_pixel.unwrap(), channel.mtf50_error_cycles_per_pixel.unwrap());
        // The truth is 0.2202; the smallest region has an error of 0.007 by its noise.
        assert!((mtf50 - 0.2202).abs() < f64::max(0.01, 2.0 * error) && error < 0.01, "{region}: {mtf50} ± {error}");
        if region.starts_with("20") {
            assert!((mtf50 - 0.2202).abs() < 0.01, "{mtf50}");
            assert!((channel.acutance.unwrap() - 0.7147).abs() < 0.02, "{:?}", channel.acutance);
        }
    }
}

#[dioptric_golden::needs_shared]
#[test]
fn a_raw_file_is_measured_by_its_raw_frame() {
    let path = shared("inputs/sensor/plain.dng").unwrap();
    let picture = MeasuredPicture::open(&path, CodeCurve::ByFile).unwrap();
    // 128 × 96 pixels of RGGB, without an edge: each filter says so, and no preview is looked at.
    let request = EdgeRequest { region: Some(PixelRegion::parse("0,0,128,96").unwrap()), ..EdgeRequest::default() };
    let reason = match request.measure(&picture) {
        Ok(measured) => measured.channels.iter().map(|channel| channel.channel.clone()).collect::<String>(),
        Err(error) => error.to_string(),
    };
    assert!(["RGB", "slanted edge"].iter().any(|word| reason.contains(word)), "{reason}");
    let chart = ChartRequest { corners: None, light: None };
    let reason = chart.measure(&picture).unwrap_err().to_string();
    assert!(reason.contains("dioptric develop"), "{reason}");
}

/// The picture of a shared raw file.
fn developed(name: &str) -> DevelopedFile {
    DevelopedFile::read(&shared(&format!("inputs/sensor/{name}.dng")).unwrap(), Default::default()).unwrap()
}

#[dioptric_golden::needs_shared]
#[test]
fn gains_and_lights_of_raw_files_are_obeyed() {
    let [plain, gained, stated, numbered, exposed] =
        ["plain", "gainmap", "illuminant_data", "two_illuminants", "baseline_0_over_0"].map(developed);
    // The corner of the file with a gain map is 131 without it, and with it that of the file without shading.
    let code = |of: &DevelopedFile| 255.0 * of.developed.picture.rgb_at(2, 2)[1];
    assert!(
        (code(&plain) - 224.0).abs() < 3.0 && (code(&gained) - 224.0).abs() < 3.0,
        "{} {}",
        code(&plain),
        code(&gained)
    );
    assert_eq!(gained.file.opcodes, ["GainMap"; 4]);
    for (a, b) in stated.developed.picture.codes.iter().zip(&numbered.developed.picture.codes) {
        // Chromaticities in hundred-thousandths stand for the numbers of the lights.
        assert!((a - b).abs() < 1.0 / 255.0, "{a} {b}");
    }
    assert!(exposed.file.notes.iter().all(|note| !note.contains("NaN")), "{:?}", exposed.file.notes);
    assert_eq!(exposed.developed.picture, plain.developed.picture);
}
