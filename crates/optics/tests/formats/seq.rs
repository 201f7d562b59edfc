//! CODE V files: what is read, and what is said where something cannot be.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::path::Path;

use dioptric_optics::{Field, Glass, LensFile, OpticsError, ReadOptions, Shape};

const DOUBLET: &str = "RDM;LEN       \"VERSION: 10.1\"
TITLE 'a doublet'   ! named
DIM   M
EPD   10.0
WL    656.3 587.6 &
      486.1
REF   2
XAN   0.0 0.0
YAN   0.0 2.0
VUY   0.0 0.2
VLY   0.0 0.1
PRV
PWL 700.0 480.0
'MYGLASS' 1.60 1.62
END
SO    0.0 0.1e11
S     60.0 4.0 NBK7_SCHOTT
  STO
  CIR 7.0
  CCY 0; THC 0
S     -40.0 2.0 MYGLASS
S     -200.0 95.0
SI    0.0 0.5
GO
";

fn read(text: &str) -> Result<LensFile, OpticsError> {
    LensFile::from_bytes(Path::new("lens.seq"), text.as_bytes(), &ReadOptions::default())
}

#[track_caller]
fn message(from: &str, to: &str) -> String {
    assert!(DOUBLET.contains(from), "{from}");
    read(&DOUBLET.replacen(from, to, 1)).unwrap_err().to_string()
}

#[track_caller]
fn medium(word: &str) -> Glass {
    read(&DOUBLET.replace("NBK7_SCHOTT", word)).unwrap().lens.interfaces()[0].medium_after.clone()
}

#[test]
fn surfaces_pupil_fields_and_wavelengths_are_read() {
    let file = read(DOUBLET).unwrap();
    let lens = &file.lens;
    assert_eq!((lens.name(), lens.stop(), lens.interfaces().len()), ("a doublet", 0, 3));
    assert_eq!(lens.interfaces()[0].medium_after, Glass::Named("SCHOTT:N-BK7".to_owned()));
    let private = Glass::Tabulated { wavelengths_nm: vec![480.0, 700.0], indices: vec![1.62, 1.6] };
    assert_eq!(lens.interfaces()[1].medium_after, private);
    // The defocus of the image surface is part of the distance.
    assert_eq!((file.film_distance_mm, file.object_distance_mm), (Some(95.5), None));
    assert_eq!(file.wavelengths_nm, [656.3, 587.6, 486.1]);
    assert_eq!(file.reference_wavelength_nm, Some(587.6));
    assert_eq!(file.fields, [0.0, 2.0].map(|y_deg| Field::Angle { x_deg: 0.0, y_deg }));
    assert!((lens.stop_semi_aperture_mm() - 5.0).abs() < 1e-14);
    assert_eq!(file.notes, [VIGNETTING]);
}

/// The note on the doublet itself.
const VIGNETTING: &str = "vignetting factors of 1 field: rims that the file does not state are those that the so narrowed pupils need, \
                          and end rays of every field alike";

/// Returns the notes on a file beside that on the vignetting of its fields.
fn notes_on(text: &str) -> Vec<String> {
    let mut notes = read(text).unwrap().notes;
    notes.retain(|note| note != VIGNETTING);
    notes
}

/// Returns such notes on the doublet with a text in the place of another.
#[track_caller]
fn notes(from: &str, to: &str) -> Vec<String> {
    assert!(DOUBLET.contains(from), "{from}");
    notes_on(&DOUBLET.replacen(from, to, 1))
}

#[test]
fn what_is_guessed_or_passed_over_is_noted_with_its_line() {
    assert_eq!(notes("S     -200.0 95.0", "S     -200.0"), ["surface S3 (line 22) states no thickness: 0 is taken"]);
    assert!(notes("S     -200.0 95.0", "S     -200.0\nTHI 95").is_empty());
    let second = "two stops (STO): that of line 22, S2, takes the place of S1";
    assert_eq!(notes("MYGLASS\nS ", "MYGLASS\nSTO\nS "), [second]);
    assert!(notes("  STO\n", "  STO\n  STO S1\n").is_empty());
    let unknown = "not understood, or before the first surface, and passed over: QXY (line 4), CIX (line 20)";
    let text = DOUBLET.replace("EPD   10.0", "QXY 3;EPD 10").replace("  CCY 0; THC 0", "  CIX 7; QXY 2; CCY 0");
    assert_eq!(notes_on(&text), [unknown]);
    assert_eq!(notes("EPD   10.0", "CIR 3; EPD 10"), [unknown.replace("QXY (line 4), CIX (line 20)", "CIR (line 4)")]);
    // A line goes on at a last & alone.
    assert_eq!(notes("EPD   10.0", "E&PD 10.0").len(), 1);
    assert!(notes("EPD   10.0", "EPD & ! goes on\n 10.0").is_empty());
    let film = "the film is no sphere or conic: of its shape, curvature and conic constant are taken alone";
    assert_eq!(notes("GO", "ASP; A 1e-5\nGO"), [film]);
    let zoom = "ZOO 3\nZOO THI S1 4 5 6\nGO";
    assert_eq!(notes("GO", zoom), ["of 3 configurations number 1 is in use"]);
    let solve = "solves and pickups are not worked out anew, the stored values stand: PIM (line 23)";
    assert_eq!(notes("S     -200.0 95.0", "S -200.0 95.0\nPIM"), [solve]);
}

#[test]
fn distance_of_the_object_and_the_surface_named_must_be_there() {
    let object = message("SO    0.0 0.1e11", "SO 0.0");
    assert!(object.contains("16: SO: the distance to the object is missing"), "{object}");
    let stop = message("  STO\n", "  STO S7\n");
    assert!(stop.contains("18: STO: there is no surface S7 before this line"), "{stop}");
}

#[test]
fn wavelength_that_a_glass_does_not_reach_is_noted() {
    let notes = notes_on(&DOUBLET.replace("PWL 700.0 480.0", "PWL 700.0 500.0"));
    assert!(notes[0].starts_with("the rims are found without 486.1 nm: a glass"), "{notes:?}");
}

#[test]
fn vignetting_of_a_field_narrows_the_rims_it_needs() {
    let last_rim_mm = |text: &str| read(text).unwrap().lens.interfaces()[2].surface.semi_aperture_mm;
    let far_field = DOUBLET.replace("YAN   0.0 2.0", "YAN   0.0 20.0");
    let whole = far_field.replace("VUY   0.0 0.2\nVLY   0.0 0.1\n", "");
    assert!(last_rim_mm(&far_field) < 0.97 * last_rim_mm(&whole));
    // Where the file states every rim, factors do nothing.
    let second = "S     -40.0 2.0 MYGLASS";
    let stated = far_field.replace(second, &format!("{second}\nCIR 8")).replace("200.0 95.0", "200.0 95.0\nCIR 8");
    let notes = read(&stated).unwrap().notes;
    assert!(notes.iter().any(|note| note.ends_with("end rays, and the factors do not")), "{notes:?}");
}

/// Light of a positive field angle rises: behind the stop its upper edge is the outer one. (The pupil is
/// half as wide along x, so that no other point of its edge is further from the axis.)
#[test]
fn upper_edge_of_a_positive_field_is_the_outer_one() {
    let rim_mm = |keys: &str| {
        let text = format!(
            "RDM\nEPD 10\nWL 550\nYAN 20\nVUX 0.5\nVLX 0.5\n{keys}\nSO 0 1E10\nS 0 10\n STO\nS 0 5 1.5\nS 0 50\nSI 0\n"
        );
        read(&text).unwrap().lens.interfaces()[1].surface.semi_aperture_mm
    };
    let shift_mm = 10.0 * 20_f64.to_radians().tan();
    for (keys, edge_mm) in [("", 5.0), ("VUY 0.5", 2.5), ("VLY 0.5", 5.0)] {
        // The rims are wider by 1e-9, against rounding.
        assert!((rim_mm(keys) - (edge_mm + shift_mm)).abs() < 2e-8, "{keys}: {}", rim_mm(keys));
    }
    let zemax = "MODE SEQ\nENPD 10\nFTYP 0 0 1 1\nYFLN 20\nVDYN -0.25\nVCYN 0.25\nVCXN 0.5\nWAVM 1 0.55 1\nPWAV 1\nSURF 0\nDISZ INFINITY\n\
                 SURF 1\nSTOP\nDISZ 10\nSURF 2\nDISZ 5\nGLAS ___BLANK 1 0 1.5 0\nSURF 3\nDISZ 50\nSURF 4\n";
    let file = LensFile::from_bytes(Path::new("a.zmx"), zemax.as_bytes(), &ReadOptions::default()).unwrap();
    assert!((file.lens.interfaces()[1].surface.semi_aperture_mm - (2.5 + shift_mm)).abs() < 2e-8);
}

#[test]
fn glass_may_be_a_name_a_code_or_an_index() {
    assert_eq!(medium("SCHOTT:N-BK7"), Glass::Named("SCHOTT:N-BK7".to_owned()));
    assert_eq!(medium("N-BK7"), Glass::Named("SCHOTT:N-BK7".to_owned()));
    assert_eq!(medium("1.5168:64.17"), Glass::NdVd { nd: 1.5168, vd: 64.17 });
    assert_eq!(medium("517642"), Glass::NdVd { nd: 1.517, vd: 64.2 });
    assert_eq!(medium("517.642"), Glass::NdVd { nd: 1.517, vd: 64.2 });
    assert_eq!(medium("516800.641700"), Glass::NdVd { nd: 1.5168, vd: 64.17 });
    assert_eq!(medium("1.5"), Glass::Constant { index: 1.5 });
    assert_eq!(medium("003283"), Glass::NdVd { nd: 2.003, vd: 28.3 });
    for wrong in ["517:642", "517642.12", "5170642"] {
        let message = read(&DOUBLET.replace("NBK7_SCHOTT", wrong)).unwrap_err().to_string();
        assert!(message.contains(wrong) && message.contains("written as 1.5168, 1.5168:64.17"), "{message}");
    }
    assert_eq!(medium("AIR"), Glass::Air);
}

#[test]
fn reference_wavelength_must_be_one_of_the_list() {
    let message = read(&DOUBLET.replace("REF   2", "REF   9")).unwrap_err().to_string();
    assert!(message.contains("the reference wavelength is number 9, expected 1 to 3"), "{message}");
}

#[test]
fn conics_aspheres_and_curvatures_are_read() {
    let text = DOUBLET.replace("  CIR 7.0", "  ASP; K -0.7; A 1E-6; C 1E-10").replace("S     -200.0", "S  0 ");
    let lens = read(&text).unwrap().lens;
    let shape = Shape::EvenAsphere { conic: -0.7, coefficients: vec![1e-6, 0.0, 1e-10] };
    assert_eq!(lens.interfaces()[0].surface.shape, shape);
    assert_eq!(lens.interfaces()[2].surface.curvature_per_mm, 0.0);
    let curved = DOUBLET
        .replace("RDM;", "CUM;")
        .replace("S     60.0", "S 0.02")
        .replace("-40.0", "-0.02")
        .replace("-200.0", "-0.005");
    assert_eq!(read(&curved).unwrap().lens.interfaces()[1].surface.curvature_per_mm, -0.02);
    let later = DOUBLET.replace("GO\n", "RDY S2 -41\nTHI S1 4.5\nCIR S3 6\nSTO S2\n");
    let lens = read(&later).unwrap().lens;
    assert_eq!(lens.interfaces()[1].surface.curvature_per_mm, 1.0 / -41.0);
    assert_eq!(lens.interfaces()[0].thickness_after_mm, 4.5);
    assert_eq!(lens.interfaces()[2].surface.semi_aperture_mm, 6.0);
    assert_eq!(lens.stop(), 1);
}

#[test]
fn inches_and_near_objects_are_converted() {
    let text =
        DOUBLET.replace("DIM   M", "DIM   I").replace("0.1e11", "10").replace("YAN", "YOB").replace("XAN", "XOB");
    let file = read(&text).unwrap();
    assert_eq!(file.object_distance_mm, Some(254.0));
    assert!(matches!(file.fields[1], Field::ObjectHeight { y_mm, .. } if (y_mm - 50.8).abs() < 1e-12));
}

#[test]
fn what_cannot_be_traced_is_refused_by_name() {
    assert!(message("  CIR 7.0", "  CIR HOL 1").contains("a hole in a surface that is no mirror"));
    assert!(message("  CIR 7.0", "  REX 3; ARO 30").contains("ARO: turned apertures are not supported"));
    assert!(
        message("  CIR 7.0", "  XDE 0; RET S1").starts_with("lens.seq:19: RET: this kind of tilt is not supported")
    );
    assert!(message("  CIR 7.0", "  XDE 0; BEN").contains("BEN: a surface that bends the axis, but is no mirror"));
    assert!(message("  CIR 7.0", "  ADE 1; ZOD 3").contains("ZOD: tilts about another point than the vertex"));
    assert!(message("  CIR 7.0", "  CYL; CUX 0.01").contains("CYL: a cylinder is curved along x and along y"));
    assert!(message("  CIR 7.0", "  AAS; AR 1E-5").contains("AR: higher terms of an anamorphic asphere"));
    assert!(message("  CIR 7.0", "  SPS ODD").contains("surfaces of the kind 'SPS ODD' are not supported"));
    assert!(message("NBK7_SCHOTT", "REFO").contains("'REFO' is no glass; expected a glass, AIR or REFL"));
    assert!(message("EPD   10.0", "NA 0.1").contains("state EPD, FNO or NAO"));
}

#[test]
fn mistakes_are_reported_by_line_and_command() {
    assert_eq!(message("S     60.0", "S     6O.0"), "lens.seq:17: S: '6O.0' is not a number");
    assert!(message("NBK7_SCHOTT", "NBK8_SCHOTT").starts_with("lens.seq:17: S: no glass is named 'SCHOTT:NBK8'"));
    assert!(message("1.60 1.62", "1.60").contains("lens.seq:14: MYGLASS: 1 indices for 2 wavelengths (PWL)"));
    assert!(message("DIM   M", "DIM   Q").contains("'Q' is no unit of length; expected M, C or I"));
    assert!(message("SI    0.0 0.5\n", "").contains("the file has no image surface (SI)"));
    assert!(message("SO ", "S ").contains("out of order; expected SO, the object, first"));
    assert!(message("YAN", "YIM").contains("fields of two kinds"));
}

#[test]
fn object_may_be_infinitely_far_as_a_word_and_unannounced_radii_are_noted() {
    assert_eq!(read(&DOUBLET.replace("0.1e11", "inf")).unwrap(), read(DOUBLET).unwrap());
    let unsaid = DOUBLET.replace("RDM;LEN", "LEN");
    let file = read(&unsaid).unwrap();
    assert!(file.notes[0].starts_with("neither radii (RDM) nor curvatures (CUM) are announced"), "{:?}", file.notes);
    let message = read(&unsaid.replace("-40.0 2.0", "-0.04 2.0")).unwrap_err().to_string();
    assert!(message.contains("the numbers of S are taken for radii"), "{message}");
}

/// Norland's adhesive as Edmund's files have it: Cauchy's law 1.5375 + 8290.45/λ² − 2.11046e8/λ⁴ of its data sheet, squared.
#[test]
fn private_glasses_by_formula_are_read_or_noted() {
    let of =
        |law: &str| read(&DOUBLET.replace("'MYGLASS' 1.60 1.62\n", &format!("'MYGLASS' 1.60 1.62\n'NOA61' {law}\n")));
    let law = "LAU 2.36390625 0.0 0.025493134 -0.000580235 -0.349933e-5 0.445404e-7";
    let text = DOUBLET.replace("'MYGLASS' 1.60 1.62\n", &format!("'NOA61' {law}\n")).replace("MYGLASS", "NOA61");
    let lens = read(&text).unwrap().lens;
    for nm in [450.0_f64, 587.6, 900.0] {
        let stated = 1.5375 + 8290.45 / nm.powi(2) - 2.11046e8 / nm.powi(4);
        let index = lens.interfaces()[1].medium_after.index_at(nm).unwrap();
        assert!((index - stated).abs() < 1e-7, "{nm}: {index} {stated}");
    }
    let unknown = of("GML 2.3 0 0.02").unwrap();
    assert!(unknown.notes.iter().any(|note| note.contains("NOA61") && note.contains("GML")), "{:?}", unknown.notes);
}
