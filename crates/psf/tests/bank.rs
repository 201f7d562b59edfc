//! The bank, held to direct tracing, closed forms and conservation.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use dioptric_diffraction::airy;
use dioptric_optics::{CoordinateBreak, Lens, glam::DVec2};
use dioptric_psf::{BankSettings, Diffraction, FieldSampling, LensImageModel, Picture, PsfQuery};

fn dgauss(f_number: f64) -> Lens {
    Lens::built_in("dgauss-50mm").unwrap().with_f_number(f_number, 550.0).unwrap()
}

fn focused_at_2_m(lens: &Lens, diffraction: Diffraction) -> LensImageModel {
    let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2000.0).unwrap();
    let settings = BankSettings::covering(film_distance_mm, 0.2, (0.1, 1.2), (420.0, 680.0), diffraction);
    LensImageModel::build(lens, &settings).unwrap()
}

/// Points all over the field, the depths and the wavelengths: (x, y, dioptres, nm).
const PLACES: [(f64, f64, f64, f64); 4] =
    [(0.0, 0.0, 0.5, 550.0), (0.1, 0.05, 0.13, 433.0), (-0.12, 0.11, 1.2, 680.0), (0.0, -0.03, 0.49, 600.0)];

#[test]
fn axial_brightness_is_that_of_the_working_f_number() {
    for (f_number, expected) in [(8.0, 0.012138), (4.0, 0.048705), (2.0277, 0.190958)] {
        let lens = dgauss(f_number);
        let mono = lens.at(550.0).unwrap();
        let film_distance_mm = mono.film_distance_mm_for(8000.0).unwrap();
        let dioptres = 1e3 / (8000.0 + mono.first_order().entrance_pupil_z_mm);
        let settings =
            BankSettings::covering(film_distance_mm, 0.1, (dioptres, dioptres), (550.0, 550.0), Diffraction::None);
        let value = LensImageModel::build(&lens, &settings)
            .unwrap()
            .radial_geometry(dioptres, 550.0)
            .unwrap()
            .irradiance_per_radiance(0.0);
        // Two independent estimators agreed on these to 1e-4.
        assert!((value / expected - 1.0).abs() < 3e-4, "f/{f_number}: {value}");
    }
}

#[test]
fn lens_without_an_axis_of_symmetry_is_refused() {
    let step = CoordinateBreak {
        surfaces: (0, 0),
        pivot_mm: 0.0,
        decenter_mm: [0.1, 0.0, 0.0],
        tilt_deg: [0.0; 3],
        tilt_first: false,
    };
    let lens = dgauss(4.0).with_moves(vec![step]).unwrap();
    let settings = BankSettings::covering(36.5, 0.1, (0.5, 0.5), (550.0, 550.0), Diffraction::None);
    let message = LensImageModel::build(&lens, &settings).unwrap_err().to_string();
    let expected = "a bank of point spread functions needs a lens that is centered and rotationally symmetric, which";
    assert!(message.starts_with(expected), "{message}");
}

#[test]
fn energy_of_a_point_is_conserved() {
    let bank = focused_at_2_m(&dgauss(4.0), Diffraction::None);
    for (x, y, dioptres, nm) in PLACES {
        let kernel = bank.kernel(PsfQuery::new(DVec2::new(x, y), dioptres, nm, 5.0));
        assert!((kernel.sum() - 1.0).abs() < 1e-6, "{}", kernel.sum());
        // On pixels the centroid of an area is known to a part of a pixel.
        assert!(Picture::from(&kernel).centroid_um().length() < 0.5);
    }
}

#[test]
fn bending_keeps_all_but_the_far_tails() {
    let bank = focused_at_2_m(&dgauss(4.0), Diffraction::Hurb { gamma: 1.0 });
    for (x, y, dioptres, nm) in PLACES {
        let sum = bank.kernel(PsfQuery::new(DVec2::new(x, y), dioptres, nm, 5.0)).sum();
        assert!((0.985..1.0).contains(&sum), "{sum}");
    }
}

#[test]
fn blur_is_signed_and_grows_with_the_distance_from_focus() {
    let bank = focused_at_2_m(&dgauss(4.0), Diffraction::None);
    let blurs: Vec<f64> = (1..12).map(|i| bank.blur_radius_mm(DVec2::X * 0.05, 0.1 * f64::from(i), 550.0)).collect();
    assert!(blurs.windows(2).all(|pair| pair[0] < pair[1]), "{blurs:?}");
    assert!(blurs[0] < -0.1 && blurs[10] > 0.15);
    for (i, blur) in blurs.iter().enumerate() {
        let kernel = bank.kernel(PsfQuery::new(DVec2::new(0.0, 0.05), 0.1 * (i + 1) as f64, 550.0, 2.0));
        let edge_mm = 1e-3 * Picture::from(&kernel).energy_radius_um(0.95);
        // Spherical aberration is about 5 µm.
        assert!((blur.abs() - edge_mm).abs() < 0.006, "{blur} {edge_mm}");
    }
}

#[test]
fn an_ideal_lens_in_focus_draws_the_airy_pattern() {
    let lens = Lens::thin(50.0, 50.0 / 8.0).unwrap();
    let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2000.0).unwrap();
    let settings = BankSettings {
        fields: FieldSampling::Radial(vec![0.0]),
        ..BankSettings::covering(film_distance_mm, 0.0, (0.5, 0.5), (550.0, 550.0), Diffraction::Wave)
    };
    let bank = LensImageModel::build(&lens, &settings).unwrap();
    let unit_um = 0.55 * film_distance_mm / 6.25;
    let kernel = bank.kernel(PsfQuery::new(DVec2::ZERO, 0.5, 550.0, 0.125 * unit_um));
    assert_eq!(bank.wave_fraction(PsfQuery::new(DVec2::X * 0.0, 0.5, 550.0, 0.125 * unit_um)), 1.0);
    // A square of ±12 λN holds 98.3 %, of which trimming keeps 99.9 %.
    assert!((0.975..0.99).contains(&kernel.sum()), "{}", kernel.sum());
    let (sum, picture) = (kernel.sum(), Picture::from(&kernel));
    for r in [1.0, 1.22, 2.0, 5.0] {
        let expected = airy::encircled_energy(r);
        // The pupil is evenly bright in tangents, not in sines; pixels of an eighth λN smear a little.
        let value = sum * picture.encircled_energy(r * unit_um);
        assert!((value - expected).abs() < 0.005, "at {r}: {value}, not {expected}");
    }
}

#[test]
fn waves_give_way_to_bending_as_the_blur_grows() {
    let lens = dgauss(4.0);
    let bank = focused_at_2_m(&lens, Diffraction::Wave);
    let bent = focused_at_2_m(&lens, Diffraction::Hurb { gamma: 1.0 });
    let shares: Vec<f64> = (0..8)
        .map(|i| bank.wave_fraction(PsfQuery::new(DVec2::X * 0.05, 0.5 + 0.1 * f64::from(i), 550.0, 4.0)))
        .collect();
    assert!(shares[0] == 1.0 && shares[7] == 0.0 && shares.windows(2).all(|pair| pair[0] >= pair[1]), "{shares:?}");
    let blended = shares.iter().position(|share| *share > 0.0 && *share < 1.0).unwrap();
    let dioptres = 0.5 + 0.1 * blended as f64;
    let edge = |bank: &LensImageModel| {
        let kernel = bank.kernel(PsfQuery::new(DVec2::new(0.05, 0.0), dioptres, 550.0, 4.0));
        let sum = kernel.sum();
        (sum, Picture::from(&kernel).edge_spread(0.0))
    };
    let ((wave_sum, wave), (bent_sum, bent)) = (edge(&bank), edge(&bent));
    // Both windows are trimmed to 99.9 % of what they hold.
    assert!((wave_sum - bent_sum).abs() < 0.005, "{wave_sum} {bent_sum}");
    let at = |profile: &dioptric_psf::Profile, x: f64| {
        let i = profile.at_um.partition_point(|u| *u < x - 1e-6);
        profile.values[i.min(profile.values.len() - 1)]
    };
    for x in (-20..=20).map(|i| 4.0 * f64::from(i) + 2.0) {
        // The edge of bending is within 0.6 % of that of waves at these blurs.
        assert!((at(&wave, x) - at(&bent, x)).abs() < 0.008, "at {x}: {} {}", at(&wave, x), at(&bent, x));
    }
}

#[test]
fn a_turned_field_turns_the_picture() {
    for diffraction in [Diffraction::None, Diffraction::Hurb { gamma: 1.0 }, Diffraction::Wave] {
        let bank = focused_at_2_m(&dgauss(4.0), diffraction);
        let right = bank.kernel(PsfQuery::new(DVec2::new(0.15, 0.0), 0.5, 550.0, 2.0));
        let up = bank.kernel(PsfQuery::new(DVec2::new(0.0, 0.15), 0.5, 550.0, 2.0));
        assert_eq!(right.samples.dim(), up.samples.dim(), "{diffraction:?}");
        let side = right.samples.nrows();
        for ((row, column), &value) in up.samples.indexed_iter() {
            // A quarter turn to the left takes (x, y) to (−y, x): columns from the right become rows from the top.
            let before = right.samples[(column, side - 1 - row)];
            assert!((value - before).abs() < 2e-4, "{diffraction:?} at {row}, {column}: {value} {before}");
        }
    }
}
