//! Openings and obscurations that are no round rims: what they stop, and how files state them.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::{f64::consts::PI, path::Path};

use dioptric_optics::{
    Aperture, CoordinateBreak, Glass, Interface, Iris, Layout, Lens, LensFile, ObjectPoint, OpticsError, Outline,
    PupilBoundary, RayBatch, RayBatchF32, RayFate, ReadOptions, Shape, Surface, Vignetting,
    glam::{DVec2, DVec3},
};

const OPENING: Aperture = Aperture {
    surface: 1,
    outline: Outline::Rectangle { half_x_mm: 3.0, half_y_mm: 1.5 },
    center_mm: [0.5, -1.0],
    is_obscuration: false,
};

fn interfaces() -> Vec<Interface> {
    let glass = Glass::Constant { index: 1.5 };
    let row = |surface, medium_after, thickness_after_mm| Interface { surface, medium_after, thickness_after_mm };
    vec![
        row(Surface::sphere(50.0, 8.0), glass, 3.0),
        row(Surface::plane(6.0), Glass::Air, 1.0),
        row(Surface::plane(5.0), Glass::Air, 0.0),
    ]
}

fn with(apertures: &[Aperture]) -> Lens {
    Lens::new_with_apertures("open", "test", interfaces(), 2, apertures.to_vec()).unwrap()
}

/// Rays along z over a square.
fn rays() -> RayBatch {
    let place = |i: usize| DVec3::new(0.14 * (i % 91) as f64 - 6.3, 0.14 * (i / 91) as f64 - 6.3, -5.0);
    let points: Vec<DVec3> = (0..91 * 91).map(place).collect();
    RayBatch::from_points(&points, &vec![DVec3::Z; points.len()])
}

#[test]
fn rays_end_at_the_surface_whose_apertures_stop_them_and_others_are_untouched() {
    let ellipse = Outline::Ellipse { half_x_mm: 2.0, half_y_mm: 4.0 };
    let hole =
        Aperture { surface: 1, outline: Outline::Circle { radius_mm: 1.2 }, center_mm: [0.0; 2], is_obscuration: true };
    for apertures in [vec![OPENING], vec![Aperture { outline: ellipse, ..OPENING }, hole.clone()], vec![hole]] {
        let (bare, lens) = (with(&[]).at(550.0).unwrap(), with(&apertures).at(550.0).unwrap());
        let (mut expected, mut found) = (rays(), rays());
        bare.trace(&mut expected, Vignetting::On);
        lens.trace(&mut found, Vignetting::On);
        let mut at_opening = rays();
        bare.trace_surfaces(0..2, &mut at_opening, Vignetting::On);
        let mut n_stopped = 0;
        for i in 0..found.len() {
            let place = at_opening.point_mm(i);
            let is_there = at_opening.fate[i].is_in_flight();
            if is_there && !apertures.iter().all(|aperture| aperture.is_clear_at(place.x, place.y)) {
                assert_eq!(found.fate[i], RayFate::Vignetted { surface: 1 });
                assert_eq!(found.point_mm(i), place);
                n_stopped += 1;
            } else {
                assert_eq!((found.fate[i], found.point_mm(i)), (expected.fate[i], expected.point_mm(i)));
                assert_eq!(found.direction(i), expected.direction(i));
            }
        }
        assert!(n_stopped > 100 && found.n_in_flight() > 100);
        // On any number of threads, in single precision, and without rims.
        let mut shared = rays();
        lens.trace_parallel(&mut shared, Vignetting::On);
        assert_eq!((&shared.fate, &shared.x_mm), (&found.fate, &found.x_mm));
        let (mut single, mut open) = (RayBatchF32::from(&rays()), rays());
        lens.trace_to_film_f32(&mut single, Vignetting::On, 90.0);
        let differ = (0..found.len()).filter(|&i| single.fate[i] != found.fate[i]).count();
        assert!(differ <= 4, "{differ} rays within rounding of an edge");
        lens.trace(&mut open, Vignetting::Off);
        assert_eq!(open.n_in_flight(), open.len());
    }
}

#[test]
fn apertures_move_with_their_surface() {
    let shift = CoordinateBreak {
        surfaces: (1, 1),
        pivot_mm: 0.0,
        decenter_mm: [0.7, 0.3, 0.0],
        tilt_deg: [0.0; 3],
        tilt_first: false,
    };
    let moved = with(&[OPENING]).with_moves(vec![shift]).unwrap().at(550.0).unwrap();
    let [x, y] = OPENING.center_mm;
    let still = with(&[Aperture { center_mm: [x + 0.7, y + 0.3], ..OPENING }]).at(550.0).unwrap();
    let (mut one, mut other) = (rays(), rays());
    moved.trace_surfaces(0..2, &mut one, Vignetting::On);
    still.trace_surfaces(0..2, &mut other, Vignetting::On);
    // The round rim of 6 mm moves too, which no ray of the opening sees.
    let passes = |rays: &RayBatch| rays.fate.iter().map(|fate| fate.is_in_flight()).collect::<Vec<_>>();
    assert_eq!(passes(&one), passes(&other));
}

#[test]
fn pupil_has_the_area_of_the_opening() {
    let plate = vec![Interface { surface: Surface::plane(6.0), medium_after: Glass::Air, thickness_after_mm: 0.0 }];
    let area_mm2 = |outline| {
        let opening = Aperture { surface: 0, outline, center_mm: [0.3, -0.2], is_obscuration: false };
        let lens =
            Lens::new_with_apertures("plate", "test", plate.clone(), 0, vec![opening]).unwrap().at(550.0).unwrap();
        let point = ObjectPoint::from_field(&lens, DVec2::ZERO, 0.0);
        PupilBoundary::find(&lens, &point, 1440).unwrap().area_mm2()
    };
    let (half_x_mm, half_y_mm) = (3.0, 1.5);
    // Straight sides between 1440 places of an edge with corners: a part in 1e4.
    assert!((area_mm2(Outline::Rectangle { half_x_mm, half_y_mm }) / 18.0 - 1.0).abs() < 3e-4);
    assert!((area_mm2(Outline::Ellipse { half_x_mm, half_y_mm }) / (4.5 * PI) - 1.0).abs() < 3e-4);
}

#[test]
fn circles_about_the_axis_leave_a_lens_its_symmetry() {
    let hole = Outline::Circle { radius_mm: 1.0 };
    let round = Aperture { outline: hole, center_mm: [0.0; 2], is_obscuration: true, ..OPENING };
    for (aperture, is_symmetric) in [
        (round.clone(), true),
        (Aperture { is_obscuration: false, ..round.clone() }, true),
        (Aperture { center_mm: [0.0, 0.1], ..round }, false),
        (OPENING, false),
    ] {
        let lens = with(&[aperture]);
        assert_eq!([lens.is_rotational(), lens.at(550.0).unwrap().is_rotational()], [is_symmetric; 2]);
    }
}

#[test]
fn lens_with_apertures_comes_back_from_its_own_file() {
    let lens = with(&[OPENING, Aperture { surface: 2, is_obscuration: true, ..OPENING }]);
    let read = |text: &str| LensFile::from_bytes(Path::new("a.ron"), text.as_bytes(), &ReadOptions::default());
    assert_eq!(read(&lens.to_ron()).unwrap().lens, lens);
    let wrong = lens.to_ron().replace("half_x_mm: 3.0", "half_x_mm: -3.0");
    let message = read(&wrong).unwrap_err().to_string();
    assert!(
        message.contains("surface 1: half the width of an aperture is -3, expected a finite number above 0"),
        "{message}"
    );
    let message = read(&lens.to_ron().replace("surface: 2", "surface: 7")).unwrap_err().to_string();
    assert!(message.contains("surface of an aperture is 7"), "{message}");
    for path in ["a.dat", "a.json"] {
        let file = LensFile::from(with(&[OPENING]));
        let refused = if path == "a.dat" { file.to_dat() } else { file.to_omni_json() };
        let message = refused.unwrap_err().to_string();
        assert!(message.contains("surface 1 has an aperture beside its round rim"), "{message}");
    }
}

#[test]
fn opening_may_be_longer_than_a_cylinder_is_wide() {
    let bar = |half_x_mm: f64, half_y_mm: f64| {
        let shape = Shape::Toroid { curvature_x_per_mm: 0.0, conic: 0.0, coefficients: Vec::new() };
        let surface = Surface { shape, ..Surface::sphere(5.0, half_x_mm.hypot(half_y_mm)) };
        let row = Interface { surface, medium_after: Glass::Air, thickness_after_mm: 0.0 };
        let outline = Outline::Rectangle { half_x_mm, half_y_mm };
        let opening = Aperture { surface: 0, outline, center_mm: [0.0; 2], is_obscuration: false };
        Lens::new_with_apertures("bar", "test", vec![row], 0, vec![opening]).map(|_| ())
    };
    assert_eq!(bar(20.0, 5.0), Ok(()));
    assert!(matches!(bar(20.0, 5.1), Err(OpticsError::RimBeyondSurface { surface: 0, .. })));
}

const ZMX: &str =
    "MODE SEQ\nUNIT MM X W X CM MR CPMM\nENPD 10\nFTYP 0 0 1 1 0 0 0\nXFLN 0\nYFLN 0\nPWAV 1\nWAVM 1 0.55 1
SURF 0\n  DISZ INFINITY\nSURF 1\n  STOP\n  CURV 0.02\n  DISZ 5\n  DIAM 6\nHERE\nSURF 2\n  DISZ 0\n";

#[test]
fn zemax_apertures_are_read_and_written() {
    let read = |text: &str| LensFile::from_bytes(Path::new("a.zmx"), text.as_bytes(), &ReadOptions::default()).unwrap();
    let circle = |radius_mm| Outline::Circle { radius_mm };
    let (half_x_mm, half_y_mm) = (2.0, 3.0);
    for (lines, expected) in [
        ("CLAP 0 12.5 0", vec![]),
        ("CLAP 1.5 12.5 0", vec![(circle(1.5), [0.0; 2], true)]),
        ("CLAP 1.5 12.5 0\n  OBDC 2 -3", vec![(circle(12.5), [2.0, -3.0], false), (circle(1.5), [2.0, -3.0], true)]),
        ("OBSC 0 1", vec![(circle(1.0), [0.0; 2], true)]),
        ("SQAP 2 3 0", vec![(Outline::Rectangle { half_x_mm, half_y_mm }, [0.0; 2], false)]),
        ("ELAP 2 3 0\n  OBDC 1 0", vec![(Outline::Ellipse { half_x_mm, half_y_mm }, [1.0, 0.0], false)]),
        ("SQOB 2 3 0", vec![(Outline::Rectangle { half_x_mm, half_y_mm }, [0.0; 2], true)]),
    ] {
        let file = read(&ZMX.replace("HERE", lines));
        let of = |(outline, center_mm, is_obscuration): &Bound| {
            let (center_mm, is_obscuration) = (*center_mm, *is_obscuration);
            Aperture { surface: 0, outline: outline.clone(), center_mm, is_obscuration }
        };
        assert_eq!(file.lens.apertures(), expected.iter().map(of).collect::<Vec<_>>(), "{lines}");
        // The stated pupil decides how wide the stop is, unless the opening lies within it.
        let reach_mm = if lines.starts_with("SQAP") {
            13f64.sqrt()
        } else if lines.starts_with("ELAP") {
            4.0
        } else {
            5.0
        };
        assert!((file.lens.stop_semi_aperture_mm() - reach_mm).abs() < 1e-12, "{lines}");
        assert_eq!(file.notes.iter().any(|note| note.contains("limits the light")), reach_mm < 5.0, "{:?}", file.notes);
        match expected.as_slice() {
            [] | [(Outline::Circle { .. }, _, true)] => {
                assert_eq!(read(&file.to_zmx().unwrap()).lens.apertures(), file.lens.apertures())
            }
            [(Outline::Rectangle { .. }, _, false)] => {
                assert_eq!(read(&file.to_zmx().unwrap()).lens.apertures(), file.lens.apertures());
            }
            _ => {}
        }
    }
    let inches = read(&ZMX.replace("UNIT MM", "UNIT IN").replace("HERE", "SQAP 2 3 0\n  OBDC 1 0"));
    assert_eq!(inches.lens.apertures()[0].outline.bounds_mm()[1], DVec2::new(50.8, 3.0 * 25.4));
    assert_eq!(inches.lens.apertures()[0].center_mm, [25.4, 0.0]);
}

#[test]
fn code_v_apertures_are_read() {
    let text = "RDM\nDIM M\nEPD 4\nWL 550\nSO 0 1e11\nS 50 3 1.5\nSTO\nREX 2\nREY 3\nADY -1\nCIR OBS L'A' 0.5\n\
        S -50 40\nELX S2 3; ELY S2 2\nCIR S2 EDG 9\nSI 0 0\n";
    let lens = LensFile::from_bytes(Path::new("a.seq"), text.as_bytes(), &ReadOptions::default()).unwrap().lens;
    let of = |surface, outline, center_mm, is_obscuration| Aperture { surface, outline, center_mm, is_obscuration };
    let expected = [
        of(0, Outline::Rectangle { half_x_mm: 2.0, half_y_mm: 3.0 }, [0.0, -1.0], false),
        of(0, Outline::Circle { radius_mm: 0.5 }, [0.0; 2], true),
        of(1, Outline::Ellipse { half_x_mm: 3.0, half_y_mm: 2.0 }, [0.0; 2], false),
    ];
    assert_eq!(lens.apertures(), expected);
}

#[test]
fn drawing_shows_openings_and_obscurations() {
    let layout = Layout {
        film_distance_mm: 90.0,
        object_distance_mm: f64::INFINITY,
        film_label: "film".to_owned(),
        fields_deg: vec![0.0],
        wavelengths_nm: vec![550.0],
        n_rays: 3,
        width_px: 900.0,
    };
    let hole = Aperture { outline: Outline::Circle { radius_mm: 1.0 }, is_obscuration: true, ..OPENING };
    let (bare, drawn) = (with(&[]).draw(&layout).unwrap(), with(&[hole]).draw(&layout).unwrap());
    assert_eq!((bare.matches("3.5\"").count(), drawn.matches("3.5\"").count()), (0, 1));
    assert_ne!(with(&[OPENING]).draw(&layout).unwrap(), bare);
}

/// What lets light through beside a beam of 5 mm radius: the outline, its middle, and whether it is an obscuration.
type Bound = (Outline, [f64; 2], bool);

/// The light through a disc of 5 mm that a bound leaves, mm², by counting.
fn clear_area_mm2((outline, center_mm, is_obscuration): Bound) -> f64 {
    const STEP_MM: f64 = 0.01;
    let aperture = Aperture { surface: 0, outline, center_mm, is_obscuration };
    let at = |i: i32| STEP_MM * (f64::from(i) + 0.5);
    let row = |j: i32| (-500..500).filter(|&i| at(i).hypot(at(j)) < 5.0 && aperture.is_clear_at(at(i), at(j))).count();
    (-500..500).map(row).sum::<usize>() as f64 * STEP_MM * STEP_MM
}

/// Two plane plates in parallel light, and an ideal lens of 50 mm: light keeps its height, so every surface bounds it alike.
fn file_with(format: &str, surface: usize, (outline, [x, y], is_obscuration): Bound) -> LensFile {
    let words = |circle: &str, rectangle: [&str; 2], ellipse: [&str; 2]| match &outline {
        Outline::Circle { radius_mm } => format!("{circle} {radius_mm}"),
        Outline::Rectangle { half_x_mm, half_y_mm } => {
            format!("{} {half_x_mm} {} {half_y_mm}", rectangle[0], rectangle[1])
        }
        Outline::Ellipse { half_x_mm, half_y_mm } => format!("{} {half_x_mm} {} {half_y_mm}", ellipse[0], ellipse[1]),
        other => panic!("{other:?} is no shape of these files"),
    };
    let text = match format {
        "a.ron" => {
            let row = |i: usize| {
                let (stop, medium) = if i == 1 { ("stop: true, ", "") } else { ("", ", medium: Constant(index: 1.5)") };
                let medium = if i == 0 { medium } else { "" };
                format!("({stop}semi_aperture_mm: {}, thickness_mm: 2.0{medium})", if i == 1 { 5.0 } else { 20.0 })
            };
            format!(
                "(name: \"a\", source: \"test\", surfaces: [{}, {}, (semi_aperture_mm: 20.0, shape: ThinLens(power_per_mm: 0.02), \
                 thickness_mm: 0.0)], apertures: [(surface: {surface}, outline: {}, center_mm: ({x:?}, {y:?}), \
                 is_obscuration: {is_obscuration})])",
                row(0),
                row(1),
                format!("{outline:?}").replace(" { ", "(").replace(" }", ")")
            )
        }
        "a.zmx" => {
            let [circle, square, elliptic] =
                if is_obscuration { ["OBSC 0", "SQOB", "ELOB"] } else { ["CLAP 0", "SQAP", "ELAP"] };
            let line = words(circle, [square, ""], [elliptic, ""]);
            let of = |i: usize| if i == surface { format!("  {line} 0\n  OBDC {x} {y}\n") } else { String::new() };
            format!(
                "MODE SEQ\nUNIT MM X W X CM MR CPMM\nENPD 10\nFTYP 0 0 1 1 0 0 0\nXFLN 0\nYFLN 0\nPWAV 1\nWAVM 1 0.55 1\n\
                 SURF 0\n  DISZ INFINITY\nSURF 1\n  DISZ 2\n  GLAS ___BLANK 1 0 1.5 0\n  DIAM 20\n{}SURF 2\n  STOP\n  DISZ 2\n  \
                 DIAM 5\n{}SURF 3\n  TYPE PARAXIAL\n  PARM 1 50\n  DISZ 50\n  DIAM 20\nSURF 4\n  DISZ 0\n",
                of(0),
                of(1)
            )
        }
        _ => {
            let obs = if is_obscuration { "OBS " } else { "" };
            let line = match outline {
                Outline::Circle { radius_mm } => format!("CIR {obs}{radius_mm}"),
                Outline::Rectangle { half_x_mm, half_y_mm } => format!("REX {obs}{half_x_mm}; REY {obs}{half_y_mm}"),
                Outline::Ellipse { half_x_mm, half_y_mm } => format!("ELX {obs}{half_x_mm}; ELY {obs}{half_y_mm}"),
                other => panic!("{other:?} is no shape of these files"),
            };
            let line = format!("{line}; ADX {obs}{x}; ADY {obs}{y}");
            let of = |i: usize| if i == surface { line.as_str() } else { "" };
            format!(
                "RDM\nDIM M\nEPD 10\nWL 550\nSO 0 1e11\nS 0 2 1.5\n{}\nS 0 2\nSTO\n{}\nS 50 5 1.5\nS -50 40\nSI 0 0\n",
                of(0),
                of(1)
            )
        }
    };
    LensFile::from_bytes(Path::new(format), text.as_bytes(), &ReadOptions::default()).unwrap()
}

#[test]
fn what_bounds_light_bounds_it_on_every_surface_of_every_format() {
    let circle = |radius_mm| Outline::Circle { radius_mm };
    let ellipse = Outline::Ellipse { half_x_mm: 2.0, half_y_mm: 3.0 };
    let rectangle = Outline::Rectangle { half_x_mm: 2.5, half_y_mm: 1.5 };
    let bounds: [Bound; 9] = [
        (circle(2.0), [0.0; 2], false),
        (circle(2.0), [1.5, -0.5], false),
        (ellipse.clone(), [0.0; 2], false),
        (ellipse.clone(), [0.5, 1.0], false),
        (rectangle.clone(), [0.0; 2], false),
        (rectangle.clone(), [-1.0, 0.5], false),
        (circle(2.0), [0.0; 2], true),
        (ellipse, [0.0; 2], true),
        (rectangle, [1.0, 0.0], true),
    ];
    for bound in bounds {
        let area_mm2 = clear_area_mm2(bound.clone());
        for surface in [0, 1] {
            for format in ["a.ron", "a.zmx", "a.seq"] {
                let file = file_with(format, surface, bound.clone());
                let lens = file.lens.at(550.0).unwrap();
                let efl_mm = lens.first_order().efl_mm;
                let found = lens.f_number_of_light().unwrap();
                // Cells of a hundredth of a millimetre count an area to a part in a thousand.
                let expected = efl_mm / (2.0 * (area_mm2 / PI).sqrt());
                assert!((found / expected - 1.0).abs() < 1e-3, "{format} {surface} {bound:?}: {found} {expected}");
                let first = lens.first_order();
                if let (Outline::Circle { radius_mm }, [0.0, 0.0], false) = bound {
                    // A round opening about the axis is the rim.
                    assert!((first.entrance_pupil_diameter_mm - 2.0 * radius_mm).abs() < 1e-9, "{format} {surface}");
                    assert!(file.lens.apertures().is_empty() && file.lens.is_rotational());
                }
                if let (Outline::Rectangle { half_x_mm, half_y_mm }, [0.0, 0.0], false) = bound {
                    let widths_mm = [lens.first_order_x(), first].map(|first| first.entrance_pupil_diameter_mm);
                    for (found, half_mm) in widths_mm.into_iter().zip([half_x_mm, half_y_mm]) {
                        assert!((found - 2.0 * half_mm).abs() < 1e-9, "{format} {surface}: {found}");
                    }
                    let note = lens.note_on_limit(f64::INFINITY).unwrap();
                    assert!(note.contains("an opening of surface"), "{note}");
                }
            }
        }
    }
}

#[test]
fn polygons_and_turned_shapes_bound_light_and_come_back_from_a_file() {
    let slit = Outline::Rectangle { half_x_mm: 1.5, half_y_mm: 0.4 };
    // A square with a corner cut out: its area is 3/4 of 16 mm².
    let notched = Outline::Polygon {
        corners_mm: vec![[-2.0, -2.0], [2.0, -2.0], [2.0, 0.0], [0.0, 0.0], [0.0, 2.0], [-2.0, 2.0]],
    };
    for (outline, area_mm2) in [(Outline::Turned { by_deg: 35.0, outline: Box::new(slit) }, 2.4), (notched, 12.0)] {
        let lens = with(&[Aperture { surface: 2, outline, center_mm: [0.3, -0.2], is_obscuration: false }]);
        let read = LensFile::from_bytes(Path::new("a.ron"), lens.to_ron().as_bytes(), &ReadOptions::default());
        assert_eq!(read.unwrap().lens, lens);
        let message = LensFile::from(lens.clone()).to_seq().unwrap_err().to_string();
        assert!(message.contains("surface 2 has an aperture that is no circle"), "{message}");
        let plate = vec![Interface { surface: Surface::plane(6.0), medium_after: Glass::Air, thickness_after_mm: 0.0 }];
        let aperture = Aperture { surface: 0, ..lens.apertures()[0].clone() };
        let plate = Lens::new_with_apertures("plate", "test", plate, 0, vec![aperture]).unwrap().at(550.0).unwrap();
        let point = ObjectPoint::Infinite(DVec3::Z);
        let found_mm2 = dioptric_optics::PupilRegion::find(&plate, &point, 192).unwrap().area_mm2();
        // Lines between some hundred places of an edge with corners.
        assert!((found_mm2 / area_mm2 - 1.0).abs() < 2e-3, "{found_mm2} {area_mm2}");
    }
}

#[test]
fn a_lens_with_blades_comes_back_from_its_own_file_open_and_closed() {
    let iris = Iris { blades: 7, rotation_deg: 12.0, curvature: 0.25 };
    let open = with(&[]).with_iris(Some(iris)).unwrap();
    for lens in [open.clone(), open.with_stop_diameter_mm(3.0).unwrap()] {
        let read = LensFile::from_bytes(Path::new("a.ron"), lens.to_ron().as_bytes(), &ReadOptions::default()).unwrap();
        assert_eq!(read.lens, lens);
        assert_eq!(read.lens.iris_opening(), lens.iris_opening());
        let left_out = |extension| LensFile::from(lens.clone()).left_out(extension).join("; ");
        assert!(left_out("zmx").contains("blades of the stop (iris)") && !left_out("ron").contains("blades"));
    }
}

#[test]
fn circle_on_the_stop_limits_the_stated_beam() {
    let text = "RDM;LEN\nEPD 20\nDIM M\nWL 587.6\nSO 0 1e14\nS 50 5 1.5168\nSTO\nCIR 5\nS -50 45\nCIR 12\nSI 0 0\nGO\n";
    let file = LensFile::from_bytes(Path::new("a.seq"), text.as_bytes(), &ReadOptions::default()).unwrap();
    let lens = file.lens.at(587.6).unwrap();
    assert!((lens.first_order().entrance_pupil_diameter_mm - 10.0).abs() < 1e-12);
    assert!((lens.real_f_number().unwrap() / lens.first_order().f_number - 1.0).abs() < 1e-9);
    let note = "the rim or opening of the stop, 10.0000 mm across, limits the light: the stated entrance pupil of 20 mm would fill \
                20.0000 mm";
    assert!(file.notes.iter().any(|found| found == note), "{:?}", file.notes);
}

#[test]
fn spiders_of_zemax_take_the_light_of_their_arms() {
    let lens = |spider: &str| {
        let text = ZMX.replace("HERE", spider);
        LensFile::from_bytes(Path::new("a.zmx"), text.as_bytes(), &ReadOptions::default()).unwrap().lens
    };
    let [three, four] = [lens("SPID 0.4 3 0"), lens("SPID 0.4 4 0")];
    assert_eq!([&three, &four].map(|lens| lens.apertures().len()), [3, 2]);
    // Arms lie along x, and a third or a quarter of a turn on.
    let is_clear = |lens: &Lens, deg: f64| {
        let at = 3.0 * DVec2::from_angle(deg.to_radians());
        lens.apertures().iter().all(|aperture| aperture.is_clear_at(at.x, at.y))
    };
    for deg in [0.0, 120.0, 240.0] {
        assert!(!is_clear(&three, deg) && is_clear(&three, deg + 60.0), "{deg}");
    }
    for deg in [0.0, 90.0, 180.0, 270.0] {
        assert!(!is_clear(&four, deg) && is_clear(&four, deg + 45.0), "{deg}");
    }
}
