//! Files of several configurations: two thin-ish lenses in air, 1/f = 1/f1 + 1/f2 − d/(f1 f2) between their principal planes, through all formats
//! that can hold them.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::path::Path;

use dioptric_optics::{
    Aperture, CoordinateBreak, Field, Glass, Interface, Lens, LensFile, OpticsError, Outline, ReadOptions, Shape,
    Surface,
};

/// n of the glass, in air of index 1 as files have it.
const INDEX: f64 = 1.5;
const RADIUS_MM: f64 = 60.0;
const THICKNESS_MM: f64 = 4.0;
const GAPS_MM: [f64; 3] = [10.0, 25.5, 40.25];

fn try_read(name: &str, text: &str, configuration: Option<usize>) -> Result<LensFile, OpticsError> {
    let options = ReadOptions { configuration, ..ReadOptions::default() };
    LensFile::from_bytes(Path::new(name), text.as_bytes(), &options)
}

fn read(name: &str, text: &str, configuration: Option<usize>) -> LensFile {
    try_read(name, text, configuration).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// The focal length of an equi-biconvex (positive) or equi-biconcave lens in a medium of index 1, and the distance of its principal planes from
/// its vertices.
fn thick(radius_mm: f64) -> (f64, f64) {
    let (c1, c2) = (1.0 / radius_mm, -1.0 / radius_mm);
    let power = (INDEX - 1.0) * (c1 - c2 + (INDEX - 1.0) * THICKNESS_MM * c1 * c2 / INDEX);
    (1.0 / power, (INDEX - 1.0) * c1 * THICKNESS_MM / (INDEX * power))
}

/// EFL and BFL of the pair whose inner vertices are this far apart.
fn pair_mm(gap_mm: f64) -> (f64, f64) {
    let ((f1, inset1), (f2, inset2)) = (thick(RADIUS_MM), thick(-RADIUS_MM));
    let d = gap_mm + inset1 + inset2;
    let f = 1.0 / (1.0 / f1 + 1.0 / f2 - d / (f1 * f2));
    (f, f * (1.0 - d / f1) - inset2)
}

/// The same two lenses as a Zemax file; three configurations of the gap between them, of the film, and of the beam.
fn zemax(operands: &str) -> String {
    let r = 1.0 / RADIUS_MM;
    let surface = |i: usize, curvature: f64, distance: &str, glass: &str| {
        format!("SURF {i}\n  TYPE STANDARD\n  CURV {curvature:e}\n  DISZ {distance}\n{glass}")
    };
    let glass = format!("  GLAS ___BLANK 1 0 {INDEX} 0\n");
    let t = THICKNESS_MM.to_string();
    let gap = GAPS_MM[1].to_string();
    let surfaces = [
        surface(0, 0.0, "INFINITY", ""),
        surface(1, r, &t, &glass) + "  STOP\n",
        surface(2, -r, &gap, ""),
        surface(3, -r, &t, &glass),
        surface(4, r, "100", ""),
        surface(5, 0.0, "0", ""),
    ];
    let head = "MODE SEQ\nNAME zoom\nUNIT MM\nENPD 8\nFTYP 0 0 2 1 0 0 0\nXFLN 0 0\nYFLN 0 2\nWAVM 1 0.55 1\nPWAV 1\nMNUM 3 2\n";
    format!("{head}{}{operands}", surfaces.concat())
}

/// Operands as the program writes them: surface, configuration, value and nine more words.
fn operands() -> String {
    let mut text = String::new();
    for (i, gap_mm) in GAPS_MM.into_iter().enumerate() {
        text += &format!("LTTL 0 {} \"zoom {}\" 0 0 0 1 1 0 0.0 \"\" 0\n", i + 1, ["wide", "middle", "tele"][i]);
        text += &format!("THIC 2 {} {gap_mm} 0 0 0 1 1 1 0 0 \"\" 0\n", i + 1);
        text += &format!("THIC 4 {} {} 0 0 0 1 1 1 0 0 \"\" 0\n", i + 1, pair_mm(gap_mm).1);
        text += &format!("APER 0 {} {} 0 0 0 1 1 1 0 0 \"\" 0\n", i + 1, 8 - i);
    }
    text
}

/// The refractive index of the air that a lens in "air" is relative to, so that media of index 1 are not air.
#[track_caller]
fn check_pair(file: &LensFile, i: usize) {
    let first = file.lens.at(550.0).unwrap().first_order();
    let (efl_mm, bfl_mm) = pair_mm(GAPS_MM[i]);
    assert!((first.efl_mm / efl_mm - 1.0).abs() < 1e-12, "{i}: {} {efl_mm}", first.efl_mm);
    assert!((first.bfl_mm / bfl_mm - 1.0).abs() < 1e-12, "{i}: {} {bfl_mm}", first.bfl_mm);
    assert!((file.film_distance_mm.unwrap() / bfl_mm - 1.0).abs() < 1e-12);
}

#[test]
fn each_configuration_of_a_zemax_zoom_has_its_focal_length() {
    let text = zemax(&operands());
    for i in 0..3 {
        let file = read("a.zmx", &text, Some(i + 1));
        check_pair(&file, i);
        let pupil_mm = file.lens.at(550.0).unwrap().first_order_of_stop().entrance_pupil_diameter_mm;
        assert!((pupil_mm / (8.0 - i as f64) - 1.0).abs() < 1e-12);
        assert_eq!(
            (file.configuration, file.configurations.len(), file.notes.len()),
            (i + 1, 3, 0),
            "{:?}",
            file.notes
        );
    }
    let file = read("a.zmx", &text, None);
    check_pair(&file, 1);
    assert_eq!(file.notes, ["of 3 configurations number 2 (zoom middle) is in use"]);
    assert_eq!(file.configuration_names(), ["zoom wide", "zoom middle", "zoom tele"]);
    for number in [0, 4] {
        let message = try_read("a.zmx", &text, Some(number)).unwrap_err().to_string();
        assert!(message.ends_with(&format!("configuration {number} is asked for, expected 1 to 3")), "{message}");
    }
}

#[test]
fn all_configurations_have_the_same_glass() {
    let file = read("a.zmx", &zemax(&operands()), None);
    for surface in 1..4 {
        let rims: Vec<f64> =
            file.configurations.iter().map(|c| c.lens.interfaces()[surface].surface.semi_aperture_mm).collect();
        assert!(rims.iter().all(|rim| *rim == rims[0]), "{rims:?}");
    }
    // The stop is an iris, as wide as each configuration says.
    let stop = |i: usize| file.configurations[i].lens.interfaces()[0].surface.semi_aperture_mm;
    assert!(stop(0) > stop(1) && stop(1) > stop(2));
}

/// Checks that a file comes back as it was from every format that holds configurations.
#[track_caller]
fn check_round_trips(file: &LensFile) {
    let plain = |file: LensFile| LensFile { notes: Vec::new(), ..file };
    let ron = file.to_ron();
    assert_eq!(plain(read("a.ron", &ron, None)), plain(file.clone()), "{ron}");
    let zmx = file.to_zmx().unwrap();
    let again = read("a.zmx", &zmx, None);
    assert_eq!(plain(again), plain(file.clone()), "{zmx}");
}

#[test]
fn configurations_come_back_from_our_own_files_and_zemax() {
    let file = read("a.zmx", &zemax(&operands()), None);
    check_round_trips(&file);
    check_round_trips(&file.clone().with_configuration(3).unwrap());
    assert_eq!(read("a.ron", &file.to_ron(), Some(1)).lens, file.clone().with_configuration(1).unwrap().lens);
    assert!(file.left_out("zmx").is_empty() && file.left_out("ron").is_empty());
    let lost = file.left_out("dat").join("; ");
    assert!(lost.contains("no place for several configurations: of 3 it has number 2 alone"), "{lost}");
}

/// Everything that may differ: distances, a curvature, an asphere, media, rims, the stop, the object, the use.
fn varied() -> LensFile {
    let interface = |surface, medium_after, thickness_after_mm| Interface { surface, medium_after, thickness_after_mm };
    let asphere = |radius_mm: f64, conic: f64, a4: f64| Surface {
        shape: Shape::EvenAsphere { conic, coefficients: vec![a4, -2.5e-9] },
        ..Surface::sphere(radius_mm, 9.0)
    };
    let build = |radius_mm: f64, conic: f64, gap_mm: f64, glass: &str, rim_mm: f64, stop: usize| {
        let interfaces = vec![
            interface(asphere(radius_mm, conic, 1e-6 * gap_mm), Glass::Named(glass.to_owned()), 4.1),
            interface(Surface::sphere(-38.7, rim_mm), Glass::Air, gap_mm),
            interface(Surface::sphere(77.0, 6.0), Glass::NdVd { nd: 1.6 + 0.01 * conic, vd: 50.0 }, 2.2),
            interface(Surface::plane(6.0), Glass::Air, 0.0),
        ];
        Lens::new("varied", "made up", interfaces, stop).unwrap()
    };
    let lenses = [
        build(41.3, -0.3, 5.0, "SCHOTT:N-BK7", 9.0, 3),
        build(43.9, 0.4, 12.5, "SCHOTT:N-SF5", 8.5, 2),
        build(41.3, -0.3, 17.5, "SCHOTT:N-BK7", 9.0, 3),
    ];
    let state = |i: usize| {
        let mut file = LensFile::from(lenses[i].clone());
        file.film_distance_mm = Some(30.0 + i as f64);
        file.object_distance_mm = [None, Some(750.0), Some(1000.0)][i];
        file.wavelengths_nm = vec![486.1327, 550.0 + i as f64, 656.2725];
        file.wavelength_weights = vec![0.5, 1.0, 0.25 + i as f64];
        file.reference_wavelength_nm = Some(file.wavelengths_nm[[1, 1, 0][i]]);
        file.fields = [0.0, 3.0 + i as f64].map(|y_deg| Field::Angle { x_deg: 0.5, y_deg }).to_vec();
        file.field_weights = vec![1.0, 2.0 + i as f64];
        file.surface_comments = ["front", "", "", "iris"].map(str::to_owned).to_vec();
        file
    };
    let configuration = |i: usize| {
        let alone = state(i);
        dioptric_optics::Configuration {
            name: ["far", "", "near, 1:10"][i].to_owned(),
            lens: alone.lens,
            film_distance_mm: alone.film_distance_mm,
            object_distance_mm: alone.object_distance_mm,
            wavelengths_nm: alone.wavelengths_nm,
            wavelength_weights: alone.wavelength_weights,
            reference_wavelength_nm: alone.reference_wavelength_nm,
            fields: alone.fields,
            field_weights: alone.field_weights,
        }
    };
    LensFile { configurations: (0..3).map(configuration).collect(), configuration: 1, ..state(0) }
}

#[test]
fn whatever_may_differ_comes_back() {
    check_round_trips(&varied());
    // What Zemax has no operand for, our own file holds.
    let mut file = varied();
    let step = CoordinateBreak {
        surfaces: (1, 2),
        pivot_mm: 1.0,
        decenter_mm: [0.0, 0.5, 0.0],
        tilt_deg: [1.0, 0.0, 0.0],
        tilt_first: false,
    };
    file.configurations[2].lens = file.configurations[2].lens.clone().with_moves(vec![step]).unwrap();
    let hole =
        Aperture { surface: 0, outline: Outline::Circle { radius_mm: 1.0 }, center_mm: [0.0; 2], is_obscuration: true };
    let lens = &file.configurations[1].lens;
    let interfaces = lens.interfaces().to_vec();
    let holed = Lens::new_with_apertures(lens.name(), lens.source(), interfaces, lens.stop(), vec![hole]).unwrap();
    file.configurations[1].lens = holed;
    let ron = file.to_ron();
    assert_eq!(read("a.ron", &ron, None).configurations, file.configurations, "{ron}");
    let message = file.to_zmx().unwrap_err().to_string();
    assert!(message.contains("differs among its configurations, for which the format has no operand"), "{message}");
}

#[test]
fn code_v_has_them_as_zoom_positions() {
    let text = "RDM;LEN\nTIT 'zoom'\nEPD 8\nDIM M\nWL 550\nYAN 0 2\nSO 0 0.1e14\nS 60 4 1.5\n STO\nS -60 10\nS -60 4 1.5\nS 60 100\nSI 0 0\n";
    let film: Vec<String> = GAPS_MM.iter().map(|gap_mm| pair_mm(*gap_mm).1.to_string()).collect();
    let zoom = format!(
        "ZOO 3\nZOO TIT\nTIT Z1 'wide'\nTIT Z3 'tele'\nZOO THI S2 10 25.5 40.25\nZOO THC S2 100 100 100\nZOO THI S4\nTHI S4 Z1 {}\nTHI S4 \
         Z2 {}; THI S4 Z3 {}\nZOO EPD 8 7 6\nZOO YAN F2 2 1.5 1\nGO\n",
        film[0], film[1], film[2]
    );
    for i in 0..3 {
        let file = read("a.seq", &format!("{text}{zoom}"), Some(i + 1));
        check_pair(&file, i);
        let pupil_mm = file.lens.at(550.0).unwrap().first_order_of_stop().entrance_pupil_diameter_mm;
        assert!((pupil_mm / (8.0 - i as f64) - 1.0).abs() < 1e-12);
        assert_eq!(file.fields[1], Field::Angle { x_deg: 0.0, y_deg: [2.0, 1.5, 1.0][i] });
    }
    let file = read("a.seq", &format!("{text}{zoom}"), None);
    assert_eq!(file.configuration_names(), ["wide", "", "tele"]);
    // The stop is stated by the pupil that it makes, which rounds in its last digits.
    let again = read("a.seq", &file.to_seq().unwrap(), None);
    for (i, (a, b)) in again.states().iter().zip(file.states()).enumerate() {
        check_pair(a, i);
        assert_eq!(
            (&a.fields, &a.wavelengths_nm, a.film_distance_mm),
            (&b.fields, &b.wavelengths_nm, b.film_distance_mm)
        );
        let rims =
            |file: &LensFile| file.lens.interfaces().iter().map(|i| i.surface.semi_aperture_mm).collect::<Vec<_>>();
        assert!(rims(a).iter().zip(rims(&b)).all(|(a, b)| (a / b - 1.0).abs() < 1e-12));
    }
    assert_eq!(again.configuration_names(), file.configuration_names());
    let short = try_read("a.seq", &format!("{text}ZOO 3\nZOO THI S2 1 2\nGO\n"), None).unwrap_err().to_string();
    assert!(short.contains("2 values of THI for 3 zoom positions"), "{short}");
}

#[test]
fn varied_configurations_come_back_from_code_v() {
    let mut file = varied();
    // The format has no zoom of the stop.
    let lens = &file.configurations[1].lens;
    let moved = Lens::new(lens.name(), lens.source(), lens.interfaces().to_vec(), 3).unwrap();
    file.configurations[1].lens = moved;
    let text = file.to_seq().unwrap();
    let again = read("a.seq", &text, None);
    for (a, b) in again.states().iter().zip(file.states()) {
        for (a, b) in a.lens.interfaces().iter().zip(b.lens.interfaces()) {
            assert_eq!((&a.medium_after, a.thickness_after_mm), (&b.medium_after, b.thickness_after_mm), "{text}");
            assert_eq!((a.surface.curvature_per_mm, &a.surface.shape), (b.surface.curvature_per_mm, &b.surface.shape));
            assert!((a.surface.semi_aperture_mm / b.surface.semi_aperture_mm - 1.0).abs() < 1e-12);
        }
        let of_use = |file: &LensFile| LensFile { lens: b.lens.clone(), notes: Vec::new(), ..file.clone() };
        assert_eq!(of_use(a), of_use(&b), "{text}");
    }
    let message = varied().to_seq().unwrap_err().to_string();
    assert!(message.contains("STO of the file's surface S3 differs among its configurations"), "{message}");
}

#[test]
fn sums_of_distances_are_worked_out_and_other_solves_refused() {
    let with = |solve: &str, operands: &str| {
        let text = zemax(operands).replace("SURF 5", &format!("{solve}SURF 5"));
        let first = |number| try_read("a.zmx", &text, Some(number));
        (first(1), first(2))
    };
    let gaps = operands().lines().filter(|line| !line.starts_with("THIC 4")).collect::<Vec<_>>().join("\n");
    // The second lens and the film: the whole length from surface 2 on is 144 in all configurations.
    let (one, _) = with("  TOLE 2 144\n", &gaps);
    assert!((one.unwrap().film_distance_mm.unwrap() - (144.0 - 10.0 - 4.0)).abs() < 1e-12);
    let (one, _) = with("  TCOM 2 120\n", &gaps);
    assert!((one.unwrap().film_distance_mm.unwrap() - 110.0).abs() < 1e-12);
    let (one, stored) = with("  MAZH 0 0\n", &gaps);
    let message = one.unwrap_err().to_string();
    assert!(message.contains("MAZH: the solve of surface 4 is stored for configuration 2 alone"), "{message}");
    let stored = stored.unwrap();
    assert!(stored.configurations.is_empty());
    let note = stored.notes.last().unwrap();
    assert!(
        note.starts_with(
            "of 3 configurations number 2 (zoom middle) alone is read, for not all can be: configuration 1: "
        ),
        "{note}"
    );
    let temperature = "TEMP 0 1 20 0 0 0\nTEMP 0 2 20 0 0 0\nTEMP 0 3 60 0 0 0\n";
    let (one, stored) = with("", &(operands() + temperature));
    let message = one.unwrap_err().to_string();
    assert!(
        message.contains("TEMP: values of this operand that differ among configurations are not supported"),
        "{message}"
    );
    assert!(stored.is_ok());
}

#[test]
fn what_is_wrong_with_configurations_is_refused() {
    let message = |result: Result<LensFile, OpticsError>| result.unwrap_err().to_string();
    let bad = |number: usize, operand: &str| {
        message(try_read("a.zmx", &zemax(&format!("{}{operand}\n", operands())), Some(number)))
    };
    assert!(bad(1, "THIC 9 1 3 0 0 0").contains("THIC: surface 9, expected one from 0 to 5"));
    assert!(bad(2, "THIC 2 4 3 0 0 0").contains("configuration 4 is asked for, expected 1 to 3"));
    assert!(bad(2, "STPS 0 2 77 0 0 0").contains("STPS: the file has no surface 77"));
    assert!(bad(2, "MIND 2 2 1.7 0 0 0").contains("MIND: the surface has no model glass behind it"));
    let ron = read("a.zmx", &zemax(&operands()), None).to_ron();
    let bad = |from: &str, to: &str| message(try_read("a.ron", &ron.replacen(from, to, 1), None));
    assert!(bad("configuration: 2", "configuration: 5").contains("configuration 5 is asked for, expected 1 to 3"));
    assert!(bad("surface: 1,", "surface: 7,").contains("surface 7, expected a surface from 0 to 3"), "{ron}");
    assert!(bad("(surface: 1,", "(surfaces: 1,").contains("surfaces"));
    let single = LensFile::from(Lens::built_in("dgauss-50mm").unwrap()).to_ron();
    let refusal = message(try_read("a.ron", &single, Some(2)));
    assert!(refusal.ends_with("configuration 2 is asked for, expected 1: the lens has one alone"), "{refusal}");
    assert!(try_read("a.ron", &single, Some(1)).is_ok());
}
