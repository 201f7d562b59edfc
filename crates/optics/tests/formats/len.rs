//! OSLO files: what is read, and what is refused where it cannot be.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::path::Path;

use dioptric_optics::{
    Field, Glass, LensFile, OpticsError, PhaseProfile, ReadOptions, Shape,
    glam::{DMat3, DVec2, DVec3},
};

fn try_read(name: &str, text: &str, configuration: Option<usize>) -> Result<LensFile, OpticsError> {
    let options = ReadOptions { configuration, ..ReadOptions::default() };
    LensFile::from_bytes(Path::new(name), text.as_bytes(), &options)
}

fn read(text: &str) -> LensFile {
    try_read("a.len", text, None).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

#[track_caller]
fn message(text: &str) -> String {
    try_read("a.len", text, None).unwrap_err().to_string()
}

/// An own singlet, n = 1.5, radii of ±20, 2 thick.
fn singlet(system: &str, first: &str, second: &str) -> String {
    format!(
        "// OSLO 6.6\nLEN NEW \"single\" 20 3\n{system}\nTH 1e20\nNXT // SRF 1\nGLA 1.5\nRD 20\nTH 2\n{first}\nNXT\nAIR\nRD -20\nTH 19\n{second}\nNXT\nAIR\n\
         WV 0.55\nEND 3\n"
    )
}

#[test]
fn a_singlet_has_the_focal_length_of_the_lens_maker() {
    let file = read(&singlet("EBR 2\nANG 5", "", ""));
    let first = file.lens.at(550.0).unwrap().first_order_of_stop();
    let (c1, c2, t, n) = (1.0 / 20.0, -1.0 / 20.0, 2.0, 1.5);
    let power = (n - 1.0) * (c1 - c2 + (n - 1.0) * t * c1 * c2 / n);
    assert!((first.efl_mm * power - 1.0).abs() < 1e-12);
    assert!((first.entrance_pupil_diameter_mm / 4.0 - 1.0).abs() < 1e-12);
    assert_eq!((file.lens.name(), file.lens.stop(), file.film_distance_mm), ("single", 0, Some(19.0)));
    assert_eq!((file.wavelengths_nm, file.object_distance_mm), (vec![550.0], None));
    let Field::Angle { y_deg, .. } = file.fields[2] else { panic!("an angle") };
    assert!((y_deg - 5.0).abs() < 1e-12 && file.fields.len() == 3);
    assert_eq!(file.notes.len(), 2, "{:?}", file.notes);
}

#[test]
fn units_are_millimetres() {
    let (one, inch) = (read(&singlet("EBR 2", "AP 3", "")), read(&singlet("EBR 2\nUNI 25.4", "AP 3", "")));
    let efl_mm = |file: &LensFile| file.lens.at(550.0).unwrap().first_order().efl_mm;
    assert!((efl_mm(&inch) / efl_mm(&one) / 25.4 - 1.0).abs() < 1e-12);
    assert!((inch.film_distance_mm.unwrap() - 19.0 * 25.4).abs() < 1e-9);
}

#[test]
fn a_triplet_with_everything_is_as_its_words_say() {
    let file = read(include_str!("../corpus/triplet.len"));
    let lens = &file.lens;
    assert_eq!((lens.name(), lens.source(), lens.stop()), ("own triplet", "made up", 3));
    assert_eq!(
        (file.comments.as_slice(), file.surface_comments[0].as_str()),
        (&["a second line".to_owned()][..], "front")
    );
    let surfaces = lens.interfaces();
    assert_eq!(surfaces[0].medium_after, Glass::Named("SCHOTT:N-SK16".to_owned()));
    assert_eq!(surfaces[4].medium_after, surfaces[0].medium_after);
    assert_eq!(surfaces[0].surface.semi_aperture_mm, 9.5);
    assert_eq!(surfaces[1].surface.shape, Shape::EvenAsphere { conic: -0.5, coefficients: vec![1e-7] });
    assert_eq!(surfaces[3].surface.curvature_per_mm, 0.04923);
    for (nm, index) in [(587.56, 1.62), (486.13, 1.6319), (656.27, 1.6149)] {
        assert!((surfaces[2].medium_after.index_at(nm).unwrap() - index).abs() < 1e-9);
    }
    // Picked up with the sign reversed.
    assert_eq!(surfaces[5].surface.curvature_per_mm, -surfaces[4].surface.curvature_per_mm);
    let Shape::Toroid { curvature_x_per_mm, .. } = surfaces[6].surface.shape else { panic!("a toroid") };
    assert_eq!((curvature_x_per_mm, surfaces[6].surface.curvature_per_mm), (1.0 / 300.0, 1.0 / 200.0));
    assert_eq!(lens.moves().len(), 1);
    assert_eq!((lens.moves()[0].tilt_deg, lens.moves()[0].decenter_mm), ([-0.5, 0.0, 0.0], [0.0, 0.1, 0.0]));
    assert_eq!(lens.image_surface().curvature_per_mm, -0.01);
    assert_eq!(file.wavelength_weights, [1.0, 0.5, 0.5]);
    assert_eq!((file.reference_wavelength_nm, file.fields.len()), (Some(587.56), 2));
    assert_eq!(file.field_weights, [1.0, 0.5]);
    let near = try_read("a.len", include_str!("../corpus/triplet.len"), Some(2)).unwrap();
    assert_eq!((near.lens.interfaces()[1].thickness_after_mm, near.film_distance_mm), (7.0, Some(43.0)));
    assert_eq!(near.configurations.len(), 2);
}

#[test]
fn tilts_of_the_kind_are_those_of_the_same_code_v_file() {
    let seq = "RDM;LEN\nEPD 4\nDIM M\nWL 550\nSO 0 0.1e14\nS 20 2 1.5\n STO\nS -20 19\n ADE 3\n BDE -2\n YDE 0.3\nSI 0 0\nGO\n";
    let seq = try_read("a.seq", seq, None).unwrap();
    let len = read(&singlet("EBR 2", "", "TLA 3; TLB -2; DCY 0.3"));
    assert_eq!(len.lens.placements(), seq.lens.placements());
    // The other order turns the shift as well.
    let other = read(&singlet("EBR 2", "", "TLA 3; DCY 0.3; DT -1")).lens.placements()[1].vertex_mm;
    let (sine, cosine) = 3.0_f64.to_radians().sin_cos();
    let shift = DVec2::new(other.y, other.z - 2.0);
    assert!((shift - DVec2::new(0.3 * cosine, -0.3 * sine)).length() < 1e-12, "{other}");
}

/// The maker's own translation: about the fixed axes of the right-hand rule by TLC about z, then −TLB about y, then −TLA about x
/// (lambdares.com/kb/comparing-tilt-values-in-oslo-vs-tracepro-after-importing-oslo-lens-file).
#[test]
fn tilts_are_those_that_the_maker_of_the_program_states() {
    let file = read(&singlet("EBR 2", "", "TLA 3; TLB -2; TLC 5"));
    let [a, b, c] = [3.0_f64, -2.0, 5.0].map(f64::to_radians);
    let expected = DMat3::from_rotation_x(-a) * DMat3::from_rotation_y(-b) * DMat3::from_rotation_z(c);
    assert!((file.lens.placements()[1].rotation - expected).to_cols_array().iter().all(|e| e.abs() < 1e-15));
}

/// The program's user guide: the local origin lies by DCX, DCY, DCZ beside the vertex of the base system, and what follows
/// stands on the axis of the local one (sinopt.com/software1/usrguide54/enterdat/tiltdec.htm).
#[test]
fn decenters_move_along_the_axes_of_the_frame() {
    let text = singlet("EBR 2\nUNI 10.0", "DCX 0.1; DCY -0.2; DCZ 0.3", "");
    let vertices_mm: Vec<DVec3> = read(&text).lens.placements().into_iter().map(|placed| placed.vertex_mm).collect();
    assert_eq!(vertices_mm, [DVec3::new(1.0, -2.0, 3.0), DVec3::new(1.0, -2.0, 23.0)]);
}

#[test]
fn mirrors_gratings_and_perfect_lenses_are_such() {
    let mirror = "LEN NEW \"m\" 50 2\nEBR 2\nTH 1e20\nNXT\nRFH\nRD -100\nCC -1\nTH -50\nNXT\nAIR\nWV .55\nEND 2\n";
    let file = read(mirror);
    assert_eq!((file.lens.mirrors(), file.film_distance_mm), (&[0][..], Some(50.0)));
    assert!((file.lens.at(550.0).unwrap().first_order().efl_mm - 50.0).abs() < 1e-12);
    let grating = read(&singlet("EBR 2", "GSP 0.002; GOR -1", "AP 4"));
    let profile = PhaseProfile::Grating { lines_per_mm: [0.0, 500.0] };
    assert_eq!((grating.lens.diffractive()[0].order, &grating.lens.diffractive()[0].profile), (-1, &profile));
    let perfect = "LEN NEW \"p\" 1 2\nEBR 2\nTH 1e20\nNXT\nAIR\nPFL 15\nTH 15\nNXT\nAIR\nEND 2\n";
    assert!((read(perfect).lens.at(550.0).unwrap().first_order().efl_mm - 15.0).abs() < 1e-12);
}

#[test]
fn an_image_that_is_solved_for_stands_at_the_focus() {
    let text = singlet("EBR 2", "", "").replace("TH 19", "PY 0.0");
    let file = read(&text);
    let bfl_mm = file.lens.at(550.0).unwrap().first_order().bfl_mm;
    assert!((file.film_distance_mm.unwrap() - bfl_mm).abs() < 1e-12);
    let stored = read(&singlet("EBR 2", "", "PY 0.0"));
    assert_eq!(stored.film_distance_mm, Some(19.0));
    assert!(
        stored
            .notes
            .iter()
            .any(|note| note.starts_with("solves are not worked out anew") && note.contains("PY (line "))
    );
    assert!(
        message(&singlet("EBR 2", "", "").replace("TH 2\n", "PY 1\n"))
            .contains("the distance of a solve is not stored")
    );
}

#[test]
fn near_objects_have_a_cone_and_heights() {
    let text = singlet("EBR 2\nOBH 4", "", "").replace("1e20", "100");
    let file = read(&text);
    let first = file.lens.at(550.0).unwrap().first_order_of_stop();
    assert!((first.entrance_pupil_diameter_mm - 4.0).abs() < 1e-12);
    assert_eq!(file.fields[2], Field::ObjectHeight { x_mm: 0.0, y_mm: 4.0 });
    let aperture = read(&singlet("NAO 0.05\nOBH 4", "", "").replace("1e20", "100"));
    let radius_mm = 0.5 * aperture.lens.at(550.0).unwrap().first_order_of_stop().entrance_pupil_diameter_mm;
    assert!((radius_mm - 100.0 * 0.05_f64.asin().tan()).abs() < 1e-9);
}

#[test]
fn what_cannot_be_traced_is_refused_and_what_is_not_understood_noted() {
    for (words, expected) in [
        ("RCO 1", "9: RCO: changes rays and is not supported"),
        ("APN 2", "APN: changes rays and is not supported"),
        ("LMO NSS", "LMO: groups whose surfaces are not met in order"),
        ("ASP ZER 4", "aspheres of the kind 'ZER' are not supported"),
        ("AS1 0.1", "AS1 needs ASP ASR"),
        ("GLA 1.5 1.6 1.7 1.8", "4 indices for 3 wavelengths (WV)"),
        ("GLA UNOBTAINIUM", "UNOBTAINIUM"),
        ("RD x", "RD: 'x' is not a number"),
        ("PK CV 2", "PK CV: expected the number of a surface before its own"),
        ("BEN; TLA 3", "BEN is supported of a mirror that has one tilt alone"),
        ("GSP 1; GOR 0.5", "a diffraction order of 0.5"),
        ("NOT \"x", "a text in quotes does not end"),
        ("NXT", "LEN states 3 surfaces behind the object and 4 follow it"),
    ] {
        let found = message(&singlet("EBR 2", words, ""));
        assert!(found.contains(expected), "{words}: {found}");
    }
    assert!(message("EBR 2\n").contains("EBR: expected LEN NEW"));
    assert!(message(&singlet("NAP 0.1", "", "")).contains("NAP: changes rays"));
    assert!(message(&singlet("FNO 4", "", "").replace("1e20", "100")).contains("FNO of an object that is near"));
    assert!(message(&singlet("UNI 0", "", "")).contains("UNI: expected the millimetres of a unit"));
    let file = read(&singlet("EBR 2", "XYZ 3; DRW ON", "XYZ 4"));
    assert!(file.notes.contains(&"not understood and passed over: XYZ (line 9)".to_owned()), "{:?}", file.notes);
}

#[test]
fn what_is_no_number_or_stands_twice_is_said() {
    let text = singlet("EBR 2", "", "");
    for (from, to, expected) in [
        ("GLA 1.5", "GLA MOD M1 1.62 36.5x", "'36.5x' is not a number"),
        ("RD 20", "RD 20\nAP CHK -8.25", "an aperture of -8.25, expected 0 or more"),
    ] {
        let found = message(&text.replace(from, to));
        assert!(found.contains(expected), "{found}");
    }
    let twice = text.replace("RD 20", "RD 20\nAST").replace("RD -20", "RD -20\nAST");
    let file = read(&twice);
    let note = "two stops (AST): that of surface 2 takes the place of that of surface 1";
    assert!(file.notes.iter().any(|found| found == note), "{:?}", file.notes);
    assert_eq!(file.lens.stop(), 1);
}
