//! Glasses whose catalogue states what they let through, in the lenses that name them.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::path::Path;

use dioptric_optics::{GlassCatalogue, LensFile, RayBatch, ReadOptions, Vignetting, glam::DVec3};

const AGF: &str = "NM MINE 1 0\nCD 2.25\nLD 0.3 2.5\nIT 0.5 0.8 20\nIT 0.6 0.9 20\n";
const ZMX: &str = "MODE SEQ\nENPD 4\nWAVM 1 0.5 1\nPWAV 1\nSURF 0\nDISZ INFINITY\nSURF 1\nSTOP\nDISZ 10\nGLAS MINE 0 0 1.5 0\n\
                   SURF 2\nDISZ 20\nSURF 3\n";

fn plate(agf: &str, zmx: &str) -> LensFile {
    let catalogues = vec![GlassCatalogue::from_bytes(Path::new("mine.agf"), agf.as_bytes()).unwrap()];
    let options = ReadOptions { catalogues, ..ReadOptions::default() };
    LensFile::from_bytes(Path::new("plate.zmx"), zmx.as_bytes(), &options).unwrap()
}

/// The share of light that an upright and a leaning ray keep behind the plate's 10 mm, and the leaning ray's path.
fn shares(file: &LensFile) -> (Vec<f64>, f64) {
    let absorption = file.lens.absorption_at(500.0).unwrap();
    assert_eq!(absorption.unknown_behind(), [0; 0]);
    let leaning = DVec3::new(0.0, 0.6, 0.8);
    let mono = file.lens.at(500.0).unwrap();
    let mut rays = RayBatch::from_points(&[DVec3::ZERO; 2], &[DVec3::Z, leaning]);
    // The leaning ray leaves the plate beside its rim.
    (absorption.trace(&mono, &mut rays, Vignetting::Off), 10.0 / (1.0 - (0.6_f64 / 1.5).powi(2)).sqrt())
}

#[test]
fn light_is_lost_as_the_catalogue_of_the_file_says() {
    let file = plate(AGF, ZMX);
    let (found, path_mm) = shares(&file);
    for (share, path_mm) in found.iter().zip([10.0, path_mm]) {
        let expected = 0.8_f64.powf(path_mm / 20.0);
        assert!((share - expected).abs() < 1e-15, "{share} {expected}");
    }
    // It stays with the lens in its own file, and in a Zemax file with its catalogue.
    let text = file.lens.to_ron();
    let again = LensFile::from_bytes(Path::new("plate.ron"), text.as_bytes(), &ReadOptions::default()).unwrap();
    assert_eq!(again.lens, file.lens);
    let (zmx, agf) = file.to_zmx_and_agf("mine").unwrap();
    for (again, expected) in shares(&plate(&agf.unwrap(), &zmx)).0.iter().zip(&found) {
        assert!((again - expected).abs() < 1e-15, "{again} {expected}");
    }
}
