//! Every lens file of the shared data loads, or is refused for the right reason.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use dioptric_optics::{D_LINE_NM, GlassCatalogue, LensFile, OpticsError, ReadOptions, Shape};

fn read(name: &str) -> Option<Result<LensFile, OpticsError>> {
    let path = dioptric_golden::shared(&format!("data/lenses/{name}"))?;
    Some(LensFile::read(&path, &ReadOptions::default()))
}

/// Checks the number of surfaces, the stop, and the focal length and back focal length at 550 nm.
#[track_caller]
fn check(name: &str, n_surfaces: usize, stop: usize, efl_mm: f64, bfl_mm: f64) {
    let Some(file) = read(name) else { return };
    let lens = file.unwrap().lens;
    assert_eq!((lens.interfaces().len(), lens.stop()), (n_surfaces, stop), "{name}");
    let first = lens.at(550.0).unwrap().first_order();
    let (efl_error, bfl_error) = ((first.efl_mm - efl_mm).abs(), (first.bfl_mm - bfl_mm).abs());
    // The published values have three decimals.
    assert!(efl_error <= 6e-4 && bfl_error <= 6e-4, "{name}: {} {}", first.efl_mm, first.bfl_mm);
}

#[dioptric_golden::needs_shared]
#[test]
fn lenses_of_iset_have_their_published_focal_lengths() {
    check("2el.XXdeg.50mm.dat", 3, 1, 51.997, 51.080);
    check("2el.XXdeg.50mm.json", 3, 1, 51.997, 51.080);
    check("dgauss.22deg.50.0mm.dat", 11, 5, 50.358, 36.106);
    check("dgauss.22deg.50.0mm.json", 11, 5, 50.358, 36.106);
    check("fisheye.87deg.12.5mm.dat", 17, 11, 12.520, 28.046);
    check("fisheye.87deg.12.5mm.json", 17, 11, 12.520, 28.046);
    check("tessar.22deg.50.0mm.json", 8, 4, 50.090, 40.931);
    check("telephoto.250mm.json", 7, 3, 249.566, 105.070);
}

#[dioptric_golden::needs_shared]
#[test]
fn cooke_triplet_of_iset_and_the_spectral_double_gauss_load() {
    let Some(file) = read("cooke40deg-zemax.json") else { return };
    let lens = file.unwrap().lens;
    // The prescription is the 50 mm triplet that comes with Zemax.
    assert!((lens.at(550.0).unwrap().first_order().efl_mm - 50.0).abs() < 0.05);
    assert_eq!((lens.interfaces().len(), lens.stop()), (7, 4));

    let Some(file) = read("dgauss.22deg.3.0mm_aperture0.6_spectral.json") else { return };
    let lens = file.unwrap().lens;
    let efl_mm = |nm| lens.at(nm).unwrap().first_order().efl_mm;
    assert!(efl_mm(400.0) < efl_mm(550.0) && efl_mm(550.0) < efl_mm(700.0), "a glass is a table that falls");
    let message = lens.at(390.0).unwrap_err().to_string();
    assert!(message.contains("from 395 to 705 nm, not at 390 nm"), "{message}");
}

#[dioptric_golden::needs_shared]
#[test]
fn lenses_of_deeplens_load_with_their_film() {
    let Some(file) = read("deeplens_ef50mm_f1.8.json") else { return };
    let file = file.unwrap();
    assert_eq!((file.lens.interfaces().len(), file.lens.stop()), (12, 6));
    assert!((file.film_distance_mm.unwrap() - 37.5632629).abs() < 1e-6);
    let first = file.lens.at(550.0).unwrap().first_order();
    // The fifty-digit reference has this lens with its numbers rounded back to decimals; the file's are 32-bit.
    assert!((first.efl_mm - 51.46687463377028).abs() < 2e-5, "{}", first.efl_mm);

    let Some(file) = read("deeplens_cellphone68deg.json") else { return };
    let file = file.unwrap();
    let first = file.lens.at(550.0).unwrap().first_order();
    // The film lies where the program focused real rays, a hundredth of a millimetre from the paraxial focus.
    assert!(
        (file.film_distance_mm.unwrap() - first.bfl_mm).abs() < 0.01,
        "{} {:?}",
        first.bfl_mm,
        file.film_distance_mm
    );
    // The corner of the film sees the field that the file's name states, 68 degrees, but for distortion.
    let field_deg = 2.0 * (3.565 / first.efl_mm).atan().to_degrees();
    assert!((field_deg - 68.0).abs() < 4.0, "{field_deg}");
}

#[dioptric_golden::needs_shared]
#[test]
fn zemax_triplet_loads_as_wide_as_its_pupil_and_fields_need() {
    let Some(file) = read("optiland_lens1.zmx") else { return };
    let file = file.unwrap();
    assert_eq!((file.lens.interfaces().len(), file.lens.stop()), (7, 4));
    assert_eq!((file.film_distance_mm, file.object_distance_mm), (Some(18.660079956054688), None));
    assert_eq!(file.wavelengths_nm, [486.1327, 587.5618, 656.2725]);
    assert_eq!(file.reference_wavelength_nm, Some(587.5618));
    let first = file.lens.at(587.5618).unwrap().first_order();
    assert!((first.entrance_pupil_diameter_mm - 8.333333969116211).abs() < 1e-12);
    assert!((first.efl_mm - 25.0).abs() < 0.02 && (first.bfl_mm - 18.66).abs() < 0.15, "{first:?}");
}

#[dioptric_golden::needs_shared]
#[test]
fn code_v_lenses_load() {
    let Some(file) = read("optiland_cooke_triplet.seq") else { return };
    let file = file.unwrap();
    assert_eq!((file.lens.name(), file.lens.interfaces().len(), file.lens.stop()), ("Cooke Triplet", 6, 0));
    assert_eq!(file.film_distance_mm, Some(42.2017));
    let first = file.lens.at(587.6).unwrap().first_order();
    assert!((first.entrance_pupil_diameter_mm - 10.0).abs() < 1e-12);
    assert!((first.efl_mm - 50.3).abs() < 0.1, "{}", first.efl_mm);

    let Some(file) = read("optiland_asphere.seq") else { return };
    let file = file.unwrap();
    let shape = &file.lens.interfaces()[0].surface.shape;
    assert_eq!(*shape, Shape::EvenAsphere { conic: -0.5, coefficients: vec![1.5e-6, -2.3e-9] });
    // A thick lens of n_d 1.5168: P = (n−1)(c₁−c₂) + (n−1)² d c₁ c₂ / n.
    let power_per_mm = 0.5168 * (0.02 + 0.0125) - 0.5168_f64.powi(2) * 5.0 * 0.02 * 0.0125 / 1.5168;
    let efl_mm = file.lens.at(D_LINE_NM).unwrap().first_order().efl_mm;
    assert!((efl_mm * power_per_mm - 1.0).abs() < 1e-9, "{efl_mm}");
    assert!(file.notes[0].contains("neither radii (RDM) nor curvatures (CUM) are announced"), "{:?}", file.notes);
    assert!(file.notes[1].contains("no surface is marked as the stop"));
}

#[dioptric_golden::needs_shared]
#[test]
fn agf_catalogue_has_the_index_of_the_built_in_glass() {
    let Some(path) = dioptric_golden::shared("data/lenses/tiny_schott.agf") else { return };
    let catalogue = GlassCatalogue::read(&path).unwrap();
    let found = catalogue.find("TINY_SCHOTT:N-BK7").unwrap();
    let built_in = GlassCatalogue::built_in().find("SCHOTT:N-BK7").unwrap();
    for nm in [300.0, 400.0, D_LINE_NM, 1000.0, 2500.0] {
        assert_eq!(found.glass.index_at(nm).unwrap(), built_in.glass.index_at(nm).unwrap());
    }
    assert!(found.glass.index_at(299.0).is_err());
}
