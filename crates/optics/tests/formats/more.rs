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

#[dioptric_golden::needs_shared]
#[test]
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

#[dioptric_golden::needs_shared]
#[test]
fn diffractive_elements_are_refused() {
    let message = |name: &str, options: &ReadOptions| read_with(name, options).unwrap_err().to_string();
    let fresnel = message("doelens.json", &ReadOptions::default());
    assert!(fresnel.contains("surfaces[0].type: surfaces of type 'Fresnel' are not supported"), "{fresnel}");
}

#[dioptric_golden::needs_shared]
#[test]
fn empty_conic_constant_is_none() {
    assert!(read_with("dogmar.77deg.4.38mm.json", &ReadOptions::default()).is_ok());
}

#[dioptric_golden::needs_shared]
#[test]
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
        ("wavelength_weights: [1.0]", "wavelength_weights is [1.0], expected 0 numbers of 0 or more"),
    ] {
        let message = read(wrong).unwrap_err().to_string();
        assert!(message.ends_with(expected), "{message}");
    }
}

#[dioptric_golden::needs_shared]
#[test]
fn b270_has_the_focal_length_of_its_maker() {
    // The aspheric condenser of 26 mm that Thorlabs sells as ACL3026U.
    let options = ReadOptions { missing_glass: MissingGlass::FromNdVd, ..Default::default() };
    let file = read_with("ACL3026U-Zemax(ZMX).zmx", &options).unwrap();
    assert!((efl_mm(&file) - 25.91).abs() < 0.02, "{}", efl_mm(&file));
}

#[test]
fn weights_comments_and_labels_survive_every_way() {
    let seq = "RDM; LEN; TIT 'a'; EPD 5; DIM M; WL 656 588 486; WTW 1 2 1; REF 2; YAN 0 5; WTF 1 0.5\nSO 0 1E11\n\
               S 50 5 1.5; STO; SLB \"front lens\"\nS -50 60\nSI 0 0\n";
    let read = |name: &str, text: &str| {
        LensFile::from_bytes(Path::new(name), text.as_bytes(), &ReadOptions::default()).unwrap()
    };
    let file = read("a.seq", seq);
    assert_eq!(
        (file.wavelength_weights.as_slice(), file.field_weights.as_slice()),
        (&[1.0, 2.0, 1.0][..], &[1.0, 0.5][..])
    );
    assert_eq!(file.surface_comments, ["front lens", ""]);
    let kept = |file: &LensFile| {
        let LensFile { wavelengths_nm, wavelength_weights, reference_wavelength_nm, fields, field_weights, .. } =
            file.clone();
        let uses = (wavelengths_nm, wavelength_weights, reference_wavelength_nm, fields, field_weights);
        (uses, file.surface_comments.clone(), file.film_distance_mm)
    };
    let ron = read("a.ron", &file.to_ron());
    let zmx = read("a.zmx", &ron.to_zmx().unwrap());
    assert_eq!(kept(&file), kept(&ron));
    assert_eq!(kept(&file), kept(&zmx));
}

#[test]
fn dropped_planes_are_noted() {
    let seq = "RDM; EPD 5; WL 588\nSO 0 1E11\nS 0 20\nS 50 5 1.5; STO\nS -50 60\nSI 0 0\n";
    let file = LensFile::from_bytes(Path::new("a.seq"), seq.as_bytes(), &ReadOptions::default()).unwrap();
    assert_eq!((file.lens.interfaces().len(), file.notes.len()), (2, 1), "{:?}", file.notes);
    assert!(
        file.notes[0].contains("the plane of line 3") && file.notes[0].contains("the lens begins 20 mm behind it"),
        "{}",
        file.notes[0]
    );
}

#[dioptric_golden::needs_shared]
#[test]
fn stop_within_an_opening_is_written() {
    let file = read_with("thorlabs_lj1598l1.zmx", &ReadOptions::default()).unwrap();
    let again = LensFile::from_bytes(Path::new("a.zmx"), file.to_zmx().unwrap().as_bytes(), &ReadOptions::default());
    let (lens, again) = (&file.lens, &again.unwrap().lens);
    assert_eq!(lens.apertures(), again.apertures());
    let rims = |lens: &dioptric_optics::Lens| -> Vec<f64> {
        lens.interfaces().iter().map(|interface| interface.surface.semi_aperture_mm).collect()
    };
    for (rim, again) in rims(lens).iter().zip(rims(again)) {
        assert!((rim / again - 1.0).abs() < 1e-12, "{rim} {again}");
    }
}
