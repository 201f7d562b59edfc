//! The bank, held to direct tracing, closed forms and conservation.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use dioptric_optics::{Lens, glam::DVec2};
use dioptric_psf::{BankSettings, Diffraction, Picture, PsfBank};

fn dgauss(f_number: f64) -> Lens {
    Lens::built_in("dgauss-50mm").unwrap().with_f_number(f_number, 550.0).unwrap()
}

fn focused_at_2_m(lens: &Lens, diffraction: Diffraction) -> PsfBank {
    let film_mm = lens.at(550.0).unwrap().film_mm_for(2000.0).unwrap();
    let settings = BankSettings::covering(film_mm, 0.2, (0.1, 1.2), (420.0, 680.0), diffraction);
    PsfBank::build(lens, &settings).unwrap()
}

/// Points all over the field, the depths and the wavelengths: (x, y, dioptres, nm).
const PLACES: [(f64, f64, f64, f64); 4] =
    [(0.0, 0.0, 0.5, 550.0), (0.1, 0.05, 0.13, 433.0), (-0.12, 0.11, 1.2, 680.0), (0.0, -0.03, 0.49, 600.0)];

#[test]
fn axial_brightness_is_that_of_the_working_f_number() {
    for (f_number, expected) in [(8.0, 0.012138), (4.0, 0.048705), (2.0277, 0.190958)] {
        let lens = dgauss(f_number);
        let mono = lens.at(550.0).unwrap();
        let film_mm = mono.film_mm_for(8000.0).unwrap();
        let dioptres = 1e3 / (8000.0 + mono.first_order().entrance_pupil_z_mm);
        let settings = BankSettings::covering(film_mm, 0.1, (dioptres, dioptres), (550.0, 550.0), Diffraction::None);
        let value = PsfBank::build(&lens, &settings).unwrap().geometry(dioptres, 550.0).irradiance_per_radiance(0.0);
        // Two independent estimators agreed on these to 1e-4.
        assert!((value / expected - 1.0).abs() < 3e-4, "f/{f_number}: {value}");
    }
}

#[test]
fn energy_of_a_point_is_conserved() {
    let bank = focused_at_2_m(&dgauss(4.0), Diffraction::None);
    for (x, y, dioptres, nm) in PLACES {
        let kernel = bank.kernel(DVec2::new(x, y), dioptres, nm, 5.0);
        assert!((kernel.sum() - 1.0).abs() < 1e-6, "{}", kernel.sum());
        // On pixels the centroid of an area is known to a part of a pixel.
        assert!(Picture::from(&kernel).centroid_um().length() < 0.5);
    }
}

#[test]
fn bending_keeps_all_but_the_far_tails() {
    let bank = focused_at_2_m(&dgauss(4.0), Diffraction::Hurb { gamma: 1.0 });
    for (x, y, dioptres, nm) in PLACES {
        let sum = bank.kernel(DVec2::new(x, y), dioptres, nm, 5.0).sum();
        assert!((0.985..1.0).contains(&sum), "{sum}");
    }
}

#[test]
fn blur_is_signed_and_grows_with_the_distance_from_focus() {
    let bank = focused_at_2_m(&dgauss(4.0), Diffraction::None);
    let blurs: Vec<f64> = (1..12).map(|i| bank.blur_radius_mm(0.05, 0.1 * f64::from(i), 550.0)).collect();
    assert!(blurs.windows(2).all(|pair| pair[0] < pair[1]), "{blurs:?}");
    assert!(blurs[0] < -0.1 && blurs[10] > 0.15);
    for (i, blur) in blurs.iter().enumerate() {
        let kernel = bank.kernel(DVec2::new(0.0, 0.05), 0.1 * (i + 1) as f64, 550.0, 2.0);
        let edge_mm = 1e-3 * Picture::from(&kernel).energy_radius_um(0.95);
        // Spherical aberration is about 5 µm.
        assert!((blur.abs() - edge_mm).abs() < 0.006, "{blur} {edge_mm}");
    }
}
