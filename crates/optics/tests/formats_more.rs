//! Lens files of other programs that used to be read wrongly, or refused for no good reason.

use std::path::{Path, PathBuf};

use dioptric_optics::{Field, LensFile, MissingGlass, OpticsError, ReadOptions, SeqNumbers};

fn read_with(name: &str, options: &ReadOptions) -> Result<LensFile, OpticsError> {
    let path: PathBuf = [env!("CARGO_MANIFEST_DIR"), "../../../shared/data/lenses/more", name].iter().collect();
    LensFile::read(&path, options)
}

fn efl_mm(file: &LensFile) -> f64 {
    file.lens.at(file.reference_wavelength_nm.unwrap_or(587.6)).expect("glasses that are known").first_order().efl_mm
}

#[test]
#[dioptric_golden::needs_shared]
fn numbers_of_seq_are_what_is_plausible() {
    for (name, expected_mm) in [("landscape_lens.seq", 10.0), ("singlet.seq", 13.11)] {
        let file = read_with(name, &ReadOptions::default()).unwrap();
        assert!((efl_mm(&file) - expected_mm).abs() < 5e-3, "{name}: {}", efl_mm(&file));
        assert!(file.notes.iter().any(|note| note.contains("are taken for curvatures")), "{:?}", file.notes);
    }
    // Asked for, radii are taken: the beam then does not fit on them.
    let options = ReadOptions { seq_numbers: Some(SeqNumbers::Radii), ..Default::default() };
    let message = read_with("landscape_lens.seq", &options).unwrap_err().to_string();
    assert!(message.contains("are taken for radii"), "{message}");
}

#[test]
#[dioptric_golden::needs_shared]
fn diffractive_elements_and_placeholders_are_refused() {
    let message = |name: &str, options: &ReadOptions| read_with(name, options).unwrap_err().to_string();
    let fresnel = message("doelens.json", &ReadOptions::default());
    assert!(fresnel.contains("surfaces[0].type: surfaces of type 'Fresnel' are not supported"), "{fresnel}");
    for missing_glass in [MissingGlass::Refuse, MissingGlass::FromNdVd, MissingGlass::Nearest] {
        let options = ReadOptions { missing_glass, ..Default::default() };
        let placeholder = message("ACL3026U-Zemax(ZMX).zmx", &options);
        assert!(placeholder.contains("B270") && placeholder.contains("are no data"), "{placeholder}");
    }
}

#[test]
#[dioptric_golden::needs_shared]
fn empty_conic_constant_is_none() {
    assert!(read_with("dogmar.77deg.4.38mm.json", &ReadOptions::default()).is_ok());
}

#[test]
#[dioptric_golden::needs_shared]
fn own_file_keeps_what_zemax_files_say() {
    let zemax = read_with("zemax_double_gaussian.zmx", &ReadOptions::default()).unwrap();
    let again = LensFile::from_bytes(Path::new("a.ron"), zemax.to_ron().as_bytes(), &ReadOptions::default()).unwrap();
    assert!(zemax.object_distance_mm.is_some() && !zemax.wavelengths_nm.is_empty() && !zemax.fields.is_empty());
    // Radii read back are two roundings from their curvatures; the rest is the same.
    assert!((efl_mm(&zemax) / efl_mm(&again) - 1.0).abs() < 1e-13);
    assert_eq!(LensFile { notes: Vec::new(), lens: again.lens.clone(), ..zemax }, again);
}

#[test]
fn own_file_checks_what_it_says_of_use() {
    let text = |line: &str| {
        format!(
            "(name: \"a\", source: \"b\", surfaces: [(radius_mm: 50.0, stop: true, semi_aperture_mm: 5.0, thickness_mm: 0.0)],
             {line})"
        )
    };
    let read = |line: &str| LensFile::from_bytes(Path::new("a.ron"), text(line).as_bytes(), &ReadOptions::default());
    let good = read("fields: [Angle(x_deg: 0.0, y_deg: 7.0)], wavelengths_nm: [500.0, 600.0], film_distance_mm: 40.0")
        .unwrap();
    assert_eq!(good.fields, [Field::Angle { x_deg: 0.0, y_deg: 7.0 }]);
    assert_eq!((good.wavelengths_nm.len(), good.film_distance_mm, good.object_distance_mm), (2, Some(40.0), None));
    for (wrong, expected) in [
        ("wavelengths_nm: [0.0]", "a wavelength of wavelengths_nm is 0, expected a number above 0"),
        ("film_distance_mm: NaN", "film_distance_mm is NaN, expected a finite number"),
        ("object_distance_mm: inf", "object_distance_mm is inf, expected a finite number"),
        ("fields: [Angle(x_deg: inf, y_deg: 0.0)]", "a number of fields is inf, expected a finite number"),
    ] {
        let message = read(wrong).unwrap_err().to_string();
        assert!(message.ends_with(expected), "{message}");
    }
}
