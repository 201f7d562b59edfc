//! Zemax files: what is read, and what is said where something cannot be.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::path::Path;

use dioptric_optics::{
    CatalogueGlass, Field, Glass, GlassCatalogue, Lens, LensFile, MissingGlass, ObjectPoint, OpticsError, ReadOptions,
    Shape, Vignetting,
    analysis::{PupilCoordinates, PupilSampling, hexapolar},
    glam::DVec2,
};

const SINGLET: &str = "VERS 140124 258 36214
MODE SEQ
NAME a singlet
UNIT MM X W X CM MR CPMM
ENPD 1.0E+1
GCAT SCHOTT MISC
FTYP 0 0 2 1 0 0 0
XFLN 0 0 0
YFLN 0 5 0
WAVM 1 5.875618E-1 1
WAVM 2 0.55 1
PWAV 1
SURF 0
  TYPE STANDARD
  CURV 0.0 0 0 0 0 \"\"
  DISZ INFINITY
  DIAM 0 0 0 0 1 \"\"
SURF 1
  STOP
  TYPE EVENASPH
  CURV 2.0E-2
  COAT AR
  PARM 1 0
  PARM 2 1.0E-6
  PARM 3 0
  DISZ 5.0
  GLAS N-BK7 0 0 1.5168 64.17 0 0 0 0 0 0
  CONI -0.5
  DIAM 6.0 1 0 0 1 \"\"
SURF 2
  TYPE STANDARD
  CURV -0.01
  DISZ 60.0
SURF 3
  TYPE STANDARD
  CURV 0.0
  DISZ 0
TOL TOFF 0
MNUM 1 1
";

fn read_with(bytes: &[u8], options: &ReadOptions) -> Result<LensFile, OpticsError> {
    LensFile::from_bytes(Path::new("lens.zmx"), bytes, options)
}

fn read(text: &str) -> Result<LensFile, OpticsError> {
    read_with(text.as_bytes(), &ReadOptions::default())
}

#[track_caller]
fn message(from: &str, to: &str) -> String {
    assert!(SINGLET.contains(from), "{from}");
    read(&SINGLET.replace(from, to)).unwrap_err().to_string()
}

#[test]
fn surfaces_pupil_fields_and_wavelengths_are_read() {
    let file = read(SINGLET).unwrap();
    let lens = &file.lens;
    assert_eq!((lens.name(), lens.stop(), lens.interfaces().len()), ("a singlet", 0, 2));
    assert_eq!(lens.interfaces()[0].medium_after, Glass::Named("SCHOTT:N-BK7".to_owned()));
    let asphere = Shape::EvenAsphere { conic: -0.5, coefficients: vec![1e-6] };
    assert_eq!(lens.interfaces()[0].surface.shape, asphere);
    assert_eq!((file.film_distance_mm, file.object_distance_mm), (Some(60.0), None));
    // FTYP says that one wavelength is used.
    assert_eq!(file.wavelengths_nm, [587.5618]);
    assert_eq!(file.fields[1], Field::Angle { x_deg: 0.0, y_deg: 5.0 });
    // `COAT AR` says what covers the surfaces, and not what that is.
    assert_eq!(file.notes.len(), 1);
    assert!(file.notes[0].starts_with("its coatings are named but not stated (AR)"), "{:?}", file.notes);
    // The pupil is the stop itself: 10 mm, although the glass is 12 mm wide.
    assert!((lens.stop_semi_aperture_mm() - 5.0).abs() < 1e-14);
    // The second surface is as wide as the field of 5 degrees needs.
    let wide_mm = lens.interfaces()[1].surface.semi_aperture_mm;
    assert!((5.0..5.3).contains(&wide_mm), "{wide_mm}");
}

#[test]
fn every_encoding_and_line_end_gives_the_same_lens() {
    let expected = read(SINGLET).unwrap();
    let crlf = SINGLET.replace('\n', "\r\n");
    let utf16: Vec<u8> = crlf.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let big: Vec<u8> = crlf.encode_utf16().flat_map(u16::to_be_bytes).collect();
    for bytes in [
        crlf.as_bytes().to_vec(),
        [b"\xEF\xBB\xBF", crlf.as_bytes()].concat(),
        [b"\xFF\xFE", utf16.as_slice()].concat(),
        [b"\xFE\xFF", big.as_slice()].concat(),
        utf16,
    ] {
        assert_eq!(read_with(&bytes, &ReadOptions::default()).unwrap(), expected);
    }
}

#[test]
fn lengths_are_converted_from_other_units() {
    let inches = read(&SINGLET.replace("UNIT MM", "UNIT IN")).unwrap();
    let expected = read(SINGLET).unwrap();
    let efl_mm = |file: &LensFile| file.lens.at(550.0).unwrap().first_order().efl_mm;
    assert!((efl_mm(&inches) / efl_mm(&expected) - 25.4).abs() < 1e-12);
    let sag = |file: &LensFile, r: f64| file.lens.interfaces()[0].surface.sag_mm(r);
    assert!((sag(&inches, 4.0 * 25.4) / sag(&expected, 4.0) - 25.4).abs() < 1e-12);
    assert!(
        (inches.lens.interfaces()[1].surface.semi_aperture_mm / 25.4
            - expected.lens.interfaces()[1].surface.semi_aperture_mm)
            .abs()
            < 1e-9
    );
}

#[test]
fn dummy_planes_are_merged_into_distances() {
    let dummy = "SURF 1\n  TYPE STANDARD\n  CURV 0\n  DISZ 20\nSURF 2\n  STOP";
    let renumbered = SINGLET.replace("SURF 3", "SURF 4").replace("SURF 2", "SURF 3").replace("SURF 1\n  STOP", dummy);
    let file = read(&renumbered).unwrap();
    let expected = read(SINGLET).unwrap();
    assert_eq!(file.lens, expected.lens);
    let near = read(&renumbered.replace("DISZ INFINITY", "DISZ 100")).unwrap();
    assert_eq!(near.object_distance_mm, Some(120.0));
}

#[test]
fn ideal_lens_and_model_glass_are_read() {
    let text = SINGLET
        .replace("CURV -0.01", "CURV 0\n  PARM 1 40")
        .replace("  TYPE STANDARD\n  CURV 0\n", "  TYPE PARAXIAL\n  CURV 0\n");
    let lens = read(&text).unwrap().lens;
    assert_eq!(lens.interfaces()[1].surface.shape, Shape::ThinLens { power_per_mm: 0.025 });
    let lens = read(&SINGLET.replace("GLAS N-BK7", "GLAS ___BLANK")).unwrap().lens;
    assert_eq!(lens.interfaces()[0].medium_after, Glass::NdVd { nd: 1.5168, vd: 64.17 });
    let lens = read(&SINGLET.replace("GLAS N-BK7 0 0 1.5168 64.17", "GLAS ___BLANK 1 0 1.5 0")).unwrap().lens;
    assert_eq!(lens.interfaces()[0].medium_after, Glass::Constant { index: 1.5 });
}

#[test]
fn missing_glass_is_named_with_where_it_was_sought() {
    let text = SINGLET.replace("N-BK7", "UNOBTAIN-7");
    let expected = "lens.zmx:27: surface 1: no glass is named 'UNOBTAIN-7'; no name is similar; the file states \
        n_d 1.5168 and V_d 64.17 for it; the file's catalogues (GCAT) are SCHOTT, MISC";
    assert_eq!(read(&text).unwrap_err().to_string(), expected);

    let with = |missing_glass| {
        let file = read_with(text.as_bytes(), &ReadOptions { missing_glass, ..Default::default() }).unwrap();
        assert!(
            file.notes.iter().any(|note| note.starts_with("glass 'UNOBTAIN-7' is in no catalogue")),
            "{:?}",
            file.notes
        );
        file.lens.interfaces()[0].medium_after.clone()
    };
    assert_eq!(with(MissingGlass::FromNdVd), Glass::NdVd { nd: 1.5168, vd: 64.17 });
    let Glass::Named(nearest) = with(MissingGlass::Nearest) else { panic!("not from the catalogue") };
    assert!(nearest.contains("BK7") || nearest.contains("K9"), "{nearest}");

    let glass = Glass::Constant { index: 1.7 };
    let own = CatalogueGlass { maker: "OWN".to_owned(), name: "UNOBTAIN-7".to_owned(), glass: glass.clone() };
    let options = ReadOptions { catalogues: vec![GlassCatalogue::new(vec![own])], ..Default::default() };
    assert_eq!(read_with(text.as_bytes(), &options).unwrap().lens.interfaces()[0].medium_after, glass);
}

#[test]
fn catalogues_of_the_file_decide_between_makers() {
    let glass = |makers: &str| {
        let text = SINGLET.replace("N-BK7", "F2").replace("GCAT SCHOTT MISC", makers);
        read(&text).map(|file| file.lens.interfaces()[0].medium_after.clone())
    };
    assert_eq!(glass("GCAT MISC CDGM SCHOTT").unwrap(), Glass::Named("CDGM:F2".to_owned()));
    // None of the file's makers has it: the commonest one's, with a note.
    assert_eq!(glass("GCAT OHARA").unwrap(), Glass::Named("SCHOTT:F2".to_owned()));
}

#[test]
fn glass_of_a_maker_that_the_file_does_not_name_is_reported() {
    let notes = |makers: &str| {
        let text = SINGLET.replace("N-BK7 0 0 1.5168 64.17", "S-FPL53 0 0 1.43875 94.95");
        let text = text.replace("GCAT SCHOTT MISC", makers);
        read(&text).unwrap().notes
    };
    let expected = "glass 'S-FPL53' is in none of the file's catalogues (SCHOTT, MISC): it is OHARA:S-FPL53";
    assert!(notes("GCAT SCHOTT MISC").iter().any(|note| note == expected), "{:?}", notes("GCAT SCHOTT MISC"));
    for silent in ["GCAT SCHOTT OHARA", ""] {
        assert!(!notes(silent).iter().any(|note| note.contains("S-FPL53")));
    }
}

#[test]
fn odd_powers_and_square_terms_are_read() {
    let shape = |from: &str, to: &str| {
        let file = read(&SINGLET.replace(from, to)).unwrap();
        file.lens.interfaces()[0].surface.shape.clone()
    };
    let odd = Shape::OddAsphere { conic: -0.5, coefficients: vec![0.0, 1e-6, 0.0] };
    assert_eq!(shape("EVENASPH", "ODDASPHE"), odd);
    let even = Shape::OddAsphere { conic: -0.5, coefficients: vec![0.0, 0.01, 0.0, 1e-6, 0.0, 0.0] };
    assert_eq!(shape("PARM 1 0", "PARM 1 0.01"), even);
}

#[test]
fn what_cannot_be_traced_is_refused_by_name() {
    assert!(message("TYPE EVENASPH", "TYPE GRINSUR1").starts_with("lens.zmx:18: surface 1: surfaces of type GRINSUR1"));
    assert!(message("TYPE EVENASPH", "TYPE TOROIDAL\n  XDAT 1 2").contains("Zernike terms (XDAT) of a toroid"));
    assert!(message("TYPE EVENASPH", "TYPE COORDBRK").contains("surface 1: a coordinate break cannot be the stop"));
    assert!(message("  CONI", "  OBSC 1 2\n  CONI").contains("OBSC: an obscuration with a hole"));
    assert!(message("  CONI", "  SPID 1 0\n  CONI").contains("SPID: a spider of 0 arms 1 wide; expected"));
    assert!(message("MODE SEQ", "MODE NSC").contains("MODE: NSC is not supported; expected SEQ"));
    assert!(message("FTYP 0", "FTYP 7").contains("field type 7 is not supported"));
}

#[test]
fn mistakes_are_reported_by_line_and_keyword() {
    assert_eq!(message("CURV 2.0E-2", "CURV 2.0F-2"), "lens.zmx:21: CURV: '2.0F-2' is not a number");
    assert_eq!(message("CURV 2.0E-2", "CURV"), "lens.zmx:21: CURV: expected 1 numbers, found 0");
    assert_eq!(
        message("UNIT MM", "UNIT FURLONG"),
        "lens.zmx:4: UNIT: 'FURLONG' is no unit of length; expected MM, CM, IN or METER"
    );
    assert!(message("SURF 2", "SURF 1").contains("SURF: surface 1 after surface 1; expected ascending numbers"));
    assert!(message("  STOP\n", "").contains("exactly one stop, but 0"));
    assert!(message("DISZ 5.0", "DISZ INFINITY").contains("surface 0: thickness is inf"));
    assert!(message("ENPD 1.0E+1", "ENPD -1").contains("the stated entrance pupil of -1 mm makes"));
    assert!(read("").unwrap_err().to_string().contains("the file has 0 surfaces"));
}

#[test]
fn numbers_of_surfaces_that_are_left_out_are_noted() {
    let file = read(&SINGLET.replace("SURF 2", "SURF 4").replace("SURF 3", "SURF 5")).unwrap();
    assert_eq!(file.lens, read(SINGLET).unwrap().lens);
    let note = "the file has no surface 2, 3: the next stands in its place, and nothing between them";
    assert!(file.notes.iter().any(|found| found == note), "{:?}", file.notes);
}

#[test]
fn solves_and_the_environment_are_noted_and_a_parameter_0_is_not() {
    let text = SINGLET
        .replace("  DISZ 60.0", "  DISZ 60.0\n  MAZH 0 0\n  PZUP 1 1 0 0")
        .replace("  PARM 1 0\n", "  PARM 0 3\n  PARM 1 0\n")
        .replace("ENPD 1.0E+1", "ENPD 1.0E+1\nENVD 35 1 1");
    let file = read(&text).unwrap();
    assert_eq!(file.lens, read(SINGLET).unwrap().lens);
    assert!(file.notes[0].starts_with("the file's lens works at 35 °C and 1 atm (ENVD)"), "{:?}", file.notes);
    assert!(file.notes[1].ends_with("the stored values stand at surface 2 (MAZH, PZUP)"), "{:?}", file.notes);
    assert!(read(&text.replace("ENVD 35 1 1", "ENVD 35 1 0")).unwrap().notes[0].starts_with("solves"));
}

#[test]
fn working_f_number_and_object_cone_set_the_stop() {
    let near = SINGLET.replace("DISZ INFINITY", "DISZ 200");
    let stop_mm = |beam: &str| read(&near.replace("ENPD 1.0E+1", beam)).unwrap().lens.stop_semi_aperture_mm();
    let lens = read(&near).unwrap().lens;
    // The stop is the first vertex: a cone of 1 degree is 200 mm · tan 1° wide there, and the image-space slope of the
    // marginal ray is the object-space one over the magnification.
    let semi_aperture_mm = 200.0 * 1.0_f64.to_radians().tan();
    assert!((stop_mm("OBNA 1 1") - semi_aperture_mm).abs() < 1e-12);
    let magnification = lens.at(587.5618).unwrap().conjugate(200.0).magnification;
    let f_number = 0.5 * (200.0 * magnification / semi_aperture_mm).abs();
    assert!((stop_mm(&format!("FNUM {f_number} 1")) - semi_aperture_mm).abs() < 1e-12);
    // A far object makes it the f-number.
    let far_mm = |beam: &str| read(&SINGLET.replace("ENPD 1.0E+1", beam)).unwrap().lens.stop_semi_aperture_mm();
    assert!((far_mm("FNUM 5 1") - far_mm("FNUM 5 0")).abs() < 1e-12);
}

#[test]
fn stop_of_no_stated_width_is_as_wide_as_the_other_rims_let_it_be() {
    let text = SINGLET
        .replace("  STOP\n", "")
        .replace("SURF 3", "SURF 4")
        .replace("  DISZ 60.0\n", "  DISZ 20.0\nSURF 3\n  STOP\n  CURV 0\n  DISZ 40.0\n");
    for beam in ["FLOA", "ENPD 0"] {
        let file = read(&text.replace("ENPD 1.0E+1", beam)).unwrap();
        let note = "no width of the beam or of the stop is stated";
        assert!(file.notes.iter().any(|found| found.starts_with(note)), "{:?}", file.notes);
        // The only other rim is the first surface's, of 6 mm, which is the pupil of a far object.
        let first = file.lens.at(587.5618).unwrap().first_order();
        assert!((first.entrance_pupil_diameter_mm - 12.0).abs() < 1e-9, "{}", first.entrance_pupil_diameter_mm);
    }
}

/// What stands twice, and what has no place here, is said.
#[test]
fn what_is_replaced_or_left_out_is_noted() {
    let second = "  DISZ 60.0\n";
    let cases = [
        (second, "  STOP\n  DISZ 60.0\n", "two stops (STOP): that of surface 2 takes the place of that of surface 1"),
        (second, "  SQAP 5 4\n  SQOB 2 1\n  DISZ 60.0\n", "surface 2: two apertures: SQOB takes the place of SQAP"),
        (
            "GLAS N-BK7 0 0 1.5168 64.17 0",
            "GLAS ___BLANK 1 0 1.5168 64.17 0.03",
            "surface 1: the deviation of its partial dispersion P_g,F from that of usual glasses, 0.03, is left out",
        ),
        (
            "FTYP 0 0 2 1 0 0 0\nXFLN 0 0 0\nYFLN 0 5 0\nWAVM 1 5.875618E-1 1\nWAVM 2 0.55 1\nPWAV 1",
            "FTYP 0 0 2 3 0 0 0\nYFLN 0 5 0\nWAVM 1 0.5 1\nWAVM 3 0.55 1\nPWAV 3",
            "the file states no wavelength 2",
        ),
        ("WAVM 2 0.55 1", "WAVM 1 0.55 1", "wavelength 1 is stated twice: 0.55 µm takes the place of 0.5875618 µm"),
        ("  CURV 0.0\n", "  TYPE EVENASPH\n  PARM 2 1E-5\n  CURV 0.0\n", "the film is no sphere or conic"),
        ("  CURV 0.0\n", "  TYPE ZERNSAG\n  CURV 0.0\n", "the film is no sphere or conic"),
        (
            "  CURV 0.0 0 0 0 0 \"\"\n  DISZ INFINITY\n",
            "  CURV 0.02\n  DISZ 300\n",
            "the object is taken for a plane: its radius of 50 mm is left out",
        ),
    ];
    for (from, to, note) in cases {
        assert!(SINGLET.contains(from), "{from}");
        let notes = read(&SINGLET.replace(from, to)).unwrap().notes;
        assert!(notes.iter().any(|found| found.starts_with(note)), "{note}: {notes:?}");
    }
    let sound = SINGLET.replace("  CURV 0.0\n", "  TYPE EVENASPH\n  CURV 0.01\n  CONI -1\n");
    assert_eq!(read(&sound).unwrap().notes, read(SINGLET).unwrap().notes);
}

#[test]
fn crystals_are_found_in_the_catalogues_that_zemax_keeps_them_in() {
    let text = SINGLET.replace("GLAS N-BK7 0 0 1.5168 64.17", "GLAS BAF2").replace("SCHOTT MISC", "INFRARED");
    let lens = read(&text).unwrap().lens;
    assert_eq!(lens.interfaces()[0].medium_after, Glass::Named("MISC:BAF2".to_owned()));
}

/// Returns a file that states no diameters: rows of curvature, distance, index behind, with the stop at `stop`.
fn bare(head: &str, rows: &[(f64, f64, f64)], stop: usize) -> String {
    let mut text = format!("MODE SEQ\nUNIT MM\n{head}\nWAVM 1 0.55 1\nSURF 0\n");
    for (i, (curvature, distance, index)) in rows.iter().enumerate() {
        text += &format!("  CURV {curvature}\n  DISZ {distance}\n");
        text += if *index == 1.0 { "" } else { "  GLAS ___BLANK 1 0 " };
        text += &if *index == 1.0 { String::new() } else { format!("{index} 0\n") };
        text += &format!("SURF {}\n", i + 1);
        text += if i + 1 == stop { "  STOP\n" } else { "" };
    }
    text + "  CURV 0\n  DISZ 0\n"
}

#[test]
fn rims_of_a_wide_angle_lens_are_those_of_rays_aimed_at_its_stop() {
    // Beyond 60° the paraxial pupil of a fisheye leads no ray through the stop.
    let fisheye = Lens::built_in("fisheye-12.5mm").unwrap();
    let mono = fisheye.at(550.0).unwrap();
    let mut rows = vec![(0.0, 1e10, 1.0)];
    rows.extend(fisheye.interfaces().iter().map(|interface| {
        let index = interface.medium_after.index_at(550.0).unwrap();
        (interface.surface.curvature_per_mm, interface.thickness_after_mm, index)
    }));
    let head = "FNUM 16 0\nFTYP 0 0 3 1\nXFLN 0 0 0\nYFLN 0 60 80";
    let read = read(&bare(head, &rows, fisheye.stop() + 1)).unwrap().lens.at(550.0).unwrap();
    let places = PupilSampling {
        coordinates: PupilCoordinates::Stop { radius_mm: read.stop_semi_aperture_mm() * (1.0 - 1e-6) },
        places: hexapolar(4),
        rims: Vignetting::On,
    };
    for field_deg in [0.0, 60.0, 80.0_f64] {
        let point = ObjectPoint::from_field(&mono, DVec2::new(0.0, -field_deg.to_radians().tan()), 0.0);
        let rays = places.rays_on_film(&read, &point, 20.0);
        assert_eq!(rays.n_in_flight(), rays.len(), "{field_deg}°");
    }
}

#[test]
fn telecentric_lens_is_read_with_its_numerical_aperture() {
    // A plano-convex lens of focal length 100 mm with its stop in the rear focal plane, and what follows: NA 0.05 from
    // the front focal plane fills a stop of 100 mm · tan(asin 0.05) in radius, to first order.
    let rows = [
        (0.0, 100.0, 1.0),
        (0.02, 0.0, 1.5),
        (0.0, 100.0, 1.0),
        (0.0, 100.0, 1.0),
        (0.02, 0.0, 1.5),
        (0.0, 100.0, 1.0),
    ];
    let head = "OBNA 0.05 0\nFTYP 1 0 2 1\nXFLN 0 0\nYFLN 0 4";
    let read = read(&bare(head, &rows, 3)).unwrap();
    let lens = read.lens.at(550.0).unwrap();
    assert!(lens.first_order().entrance_pupil_z_mm.is_infinite());
    let expected_mm = 100.0 * (0.05f64).asin().tan();
    assert!((lens.stop_semi_aperture_mm() / expected_mm - 1.0).abs() < 1e-12);
    // The first rim holds the cone of the outermost point: its height and the cone's own, and what the aberration of
    // the rays to the stop's edge adds (2 % were found).
    let rim_mm = read.lens.front_semi_aperture_mm();
    assert!((1.0..1.05).contains(&(rim_mm / (4.0 + expected_mm))), "{rim_mm}");
}

#[test]
fn words_of_older_files_and_flags_are_read_or_noted() {
    // Without WAVM, the lists of files of 2002.
    let lists = "WAVN 0.4861 0.5876 0.6563\nWWGN 1 2 3\nPWAV 2";
    let old =
        SINGLET.replace("WAVM 1 5.875618E-1 1\nWAVM 2 0.55 1\nPWAV 1", lists).replace("FTYP 0 0 2 1", "FTYP 0 0 2 3");
    let file = read(&old).unwrap();
    assert_eq!((file.wavelengths_nm.len(), file.reference_wavelength_nm), (3, Some(587.6)));
    assert_eq!(file.wavelength_weights, [1.0, 2.0, 3.0]);
    let both = "WAVM 1 0.4861 1\nWAVM 2 0.5876 1\nWAVM 3 0.6563 1\nPWAV 2";
    let twice = read(&old.replace("PWAV 2", both)).unwrap();
    assert_eq!((twice.wavelengths_nm, twice.reference_wavelength_nm), (file.wavelengths_nm, Some(587.6)));
    let note = |from: &str, to: &str, word: &str| {
        let file = read(&SINGLET.replace(from, to)).unwrap();
        assert!(file.notes.iter().any(|note| note.contains(word)), "{to}: {:?}", file.notes);
    };
    note("FTYP 0 0 2 1 0 0 0", "FTYP 0 1 2 1 0 0 0", "telecentric");
    note("FTYP 0 0 2 1 0 0 0", "FTYP 0 0 2 1 0 0 1", "afocal");
    note("GCAT SCHOTT MISC", "GCAT SCHOTT MISC\nGFAC 1 0.5", "apodization");
    assert_eq!(read(&SINGLET.replace("GCAT", "GFAC 0 0\nGCAT")).unwrap(), read(SINGLET).unwrap());
    // Lines that end as on old Macintoshes.
    assert_eq!(read(&SINGLET.replace('\n', "\r")).unwrap(), read(SINGLET).unwrap());
}

#[test]
fn glasses_by_six_digits_are_those_of_their_numbers() {
    let medium = |line: &str| {
        let file = read(&SINGLET.replace("N-BK7 0 0 1.5168 64.17", line)).unwrap();
        file.lens.interfaces()[0].medium_after.clone()
    };
    assert_eq!(medium("517642 0 0 1.5 40"), Glass::NdVd { nd: 1.517, vd: 64.2 });
    assert_eq!(medium("517642 0 0 1.5168 64.17"), Glass::NdVd { nd: 1.5168, vd: 64.17 });
}
