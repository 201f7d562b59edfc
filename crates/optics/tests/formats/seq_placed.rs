//! Cylinders, toroids, tilts and decenters of CODE V files.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::path::Path;

use dioptric_optics::{
    CoordinateBreak, Lens, LensFile, RayBatch, ReadOptions, Shape, Vignetting,
    glam::{DVec2, DVec3},
};

const SEQ: &str = "RDM
DIM M
EPD 4
WL 550
SO 0 1E10
S 50 5 1.5
 STO
S -50 10
 XDE 0.1; YDE 0.2; ZDE 0.3; ADE 2; BDE 3; CDE 4; DAR
S 0 20
 ADE -1
SI -30
";

fn read(text: &str) -> LensFile {
    LensFile::from_bytes(Path::new("a.seq"), text.as_bytes(), &ReadOptions::default())
        .unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn still(surfaces: (usize, usize)) -> CoordinateBreak {
    CoordinateBreak { surfaces, pivot_mm: 0.0, decenter_mm: [0.0; 3], tilt_deg: [0.0; 3], tilt_first: false }
}

/// Where rays through a lens meet the film, in the film's own frame; with `swap` x and y change places before and after.
fn on_film(file: &LensFile, swap: bool) -> Vec<Option<DVec2>> {
    let mono = file.lens.at(550.0).unwrap();
    let film_distance_mm = file.film_distance_mm.unwrap();
    let turn = |v: DVec3| if swap { DVec3::new(v.y, v.x, v.z) } else { v };
    let start = |i: i32| turn(DVec3::new(0.9 * f64::from(i % 9 - 4), 0.8 * f64::from(i / 9 - 4), -5.0));
    let starts: Vec<DVec3> = (0..81).map(start).collect();
    let direction = turn(DVec3::new(0.02, -0.03, 1.0).normalize());
    let mut rays = RayBatch::from_points(&starts, &[direction; 81]);
    mono.trace(&mut rays, Vignetting::On);
    mono.to_film(&mut rays, film_distance_mm);
    let placement = mono.film_placement(film_distance_mm);
    let place = |i: usize| {
        let own = turn(placement.surface_from_lens(rays.point_mm(i)));
        rays.fate[i].is_in_flight().then(|| own.truncate())
    };
    (0..rays.len()).map(place).collect()
}

/// Checks that the same rays pass in both, at least this many, and meet the film at the same places.
#[track_caller]
fn assert_same(a: &[Option<DVec2>], b: &[Option<DVec2>], n_least: usize) {
    assert!(a.iter().flatten().count() >= n_least, "{}", a.iter().flatten().count());
    for (a, b) in a.iter().zip(b) {
        match (a, b) {
            // Some roundings of lengths of some tens of millimetres.
            (Some(a), Some(b)) => assert!((*a - *b).length() < 1e-13, "{a} {b}"),
            (a, b) => assert_eq!(a, b),
        }
    }
}

#[test]
fn turns_about_x_and_y_are_left_handed() {
    let file = read(SEQ);
    let expected = [
        CoordinateBreak { decenter_mm: [0.1, 0.2, 0.3], tilt_deg: [-2.0, -3.0, 4.0], ..still((1, 1)) },
        CoordinateBreak { tilt_deg: [1.0, 0.0, 0.0], ..still((2, 3)) },
    ];
    // A plane in air that is not the stop does nothing, and is dropped; what it turns is not.
    let merged = CoordinateBreak { surfaces: (2, 2), pivot_mm: 10.0, ..expected[1] };
    assert_eq!(file.lens.moves(), [expected[0], merged]);
    assert_eq!(file.lens.image_surface().curvature_per_mm, -1.0 / 30.0);
    assert_eq!(file.film_distance_mm, Some(30.0));
}

/// A wedge whose front leans its top towards the film (ADE > 0: y turns to z by the left hand's rule) bends light as
/// a prism does that is thicker at its foot: towards −y.
#[test]
fn leaning_front_bends_light_as_a_prism_does() {
    let wedge = "RDM\nEPD 4\nWL 550\nSO 0 1E10\nS 0 5 1.5\n STO; ADE 3; DAR\nS 0 100\nSI 0\n";
    let file = read(wedge);
    let mono = file.lens.at(550.0).unwrap();
    let normal = file.lens.placements()[0].rotation.z_axis;
    let lean = 3_f64.to_radians();
    assert!((normal - DVec3::new(0.0, lean.sin(), lean.cos())).length() < 1e-15, "{normal}");
    let mut rays = RayBatch::from_points(&[DVec3::new(0.0, 0.0, -5.0)], &[DVec3::Z]);
    mono.trace(&mut rays, Vignetting::On);
    // Snell at the leaning front, of the angles to its normal, and then at the upright back.
    let within = lean - (lean.sin() / 1.5).asin();
    assert!((rays.direction(0).y - 1.5 * within.sin()).abs() < 1e-15, "{}", rays.direction(0));
}

#[test]
fn reversed_tilts_undo_what_came_before() {
    let tilts = "XDE 0.4; YDE -0.3; ADE -20; BDE 10; CDE 5";
    let plate = |back: &str| {
        let ends = "S 60 10 1.6\n STO\nS 0 10\n";
        read(&format!("RDM\nEPD 4\nWL 550\nSO 0 1E10\n{ends}S 0 7 1.5\n {tilts}\nS 0 {back}\nSI 0\n"))
    };
    // Undone at the back, and at a plane in air that the axis passes first.
    let at_back = plate(&format!("20\n {tilts}; REV"));
    let last_tilt = at_back.lens.moves()[1];
    assert_eq!(last_tilt.decenter_mm, [-0.4, 0.3, -0.0]);
    assert_eq!((last_tilt.tilt_deg, last_tilt.tilt_first), ([-20.0, 10.0, -5.0], true));
    let axis_is_upright = |file: &LensFile| {
        let placement = file.lens.at(550.0).unwrap().film_placement(file.film_distance_mm.unwrap());
        (placement.rotation.z_axis - DVec3::Z).length() < 1e-15
            && (placement.rotation.x_axis - DVec3::X).length() < 1e-15
    };
    assert!(axis_is_upright(&at_back) && !axis_is_upright(&plate("20")));
    let at_dummy = plate(&format!("0\nS 0 20\n {tilts}; REV"));
    assert_same(&on_film(&at_dummy, false), &on_film(&at_back, false), 10);
    // The same plate by a Zemax file, whose second break undoes the first.
    let zemax = LensFile::from_bytes(
        Path::new("a.zmx"),
        b"MODE SEQ\nENPD 4\nWAVM 1 0.55 1\nPWAV 1\nSURF 0\nDISZ INFINITY\nSURF 1\nSTOP\nCURV 0.016666666666666666\nDISZ 10\n\
          GLAS ___BLANK 1 0 1.6 0\nSURF 2\nDISZ 10\nSURF 3\nTYPE COORDBRK\nPARM 1 0.4\nPARM 2 -0.3\nPARM 3 20\nPARM 4 -10\n\
          PARM 5 5\nSURF 4\nDISZ 7\nGLAS ___BLANK 1 0 1.5 0\nSURF 5\nSURF 6\nTYPE COORDBRK\nPARM 1 -0.4\nPARM 2 0.3\n\
          PARM 3 -20\nPARM 4 10\nPARM 5 -5\nPARM 6 1\nDISZ 20\nSURF 7\n",
        &ReadOptions::default(),
    );
    assert_same(&on_film(&zemax.unwrap(), false), &on_film(&at_back, false), 10);
    // Behind an image nothing is left to bend.
    assert_eq!(read(&SEQ.replace("SI -30", "SI -30\n ADE 5; REV")), read(SEQ));
}

fn first_shape(keys: &str) -> Shape {
    let text = SEQ.replace(" STO\n", &format!(" STO\n {keys}\n"));
    read(&text).lens.interfaces()[0].surface.shape.clone()
}

#[test]
fn toroids_and_anamorphic_conics_are_read() {
    let toroid = Shape::Toroid { curvature_x_per_mm: 0.025, conic: -0.5, coefficients: vec![0.0, 1e-6] };
    assert_eq!(first_shape("YTO; RDX 40; K -0.5; A 1E-6"), toroid);
    let biconic = Shape::Biconic { conic: -0.5, curvature_x_per_mm: 0.01, conic_x: 2.0 };
    assert_eq!(first_shape("AAS; CUX 0.01; KY -0.5; KX 2"), biconic);
    let cylinder = |curvature_x_per_mm| Shape::Toroid { curvature_x_per_mm, conic: 0.0, coefficients: vec![] };
    assert_eq!(first_shape("CYL"), cylinder(0.0));
    assert_eq!(first_shape("CYL; RDY 0; RDX 50"), cylinder(0.02));
}

/// A surface whose curve is along x, and the same with x and y changing places.
#[track_caller]
fn assert_turned(along_x: &str, along_y: &str, n_least: usize) {
    let lens = |keys: &str| {
        let text = SEQ.replace("S 50 5 1.5\n STO\n", &format!("S 0 5 1.5\n STO\nS 0 5 1.6\n {keys}\n"));
        read(&text.replace(" XDE 0.1; YDE 0.2; ZDE 0.3; ADE 2; BDE 3; CDE 4; DAR\n", "").replace(" ADE -1\n", ""))
    };
    let wide = |lens: &str| lens.to_owned() + "; CIR 9";
    let (x, y) = (lens(&wide(along_x)), lens(&wide(along_y)));
    assert_same(&on_film(&x, true), &on_film(&y, false), n_least);
    let is_apart = |(a, b): (&Option<DVec2>, &Option<DVec2>)| a.zip(*b).is_some_and(|(a, b)| (a - b).length() > 1e-3);
    assert!(on_film(&x, false).iter().zip(&on_film(&y, false)).any(is_apart));
}

#[test]
fn curves_along_x_are_those_along_y_turned() {
    assert_turned("XTO; RDX 12; RDY 30; K -0.5; A 1E-4", "YTO; RDY 12; RDX 30; K -0.5; A 1E-4", 10);
    assert_turned("XTO; RDX 12; K 0.5", "YTO; RDY 12; K 0.5", 10);
    assert_turned("XTO; RDX 12", "YTO; RDY 12", 10);
    assert_turned("CYL; RDX 12; A 2E-4", "CYL; RDY 12; A 2E-4", 10);
    assert_turned(
        "XTO; RDX 12; RDY 30; REX 1.5; REY 0.5; ADX 0.6; ADY 0.3",
        "YTO; RDY 12; RDX 30; REX 0.5; REY 1.5; ADX 0.3; ADY 0.6",
        3,
    );
    assert_turned("XTO; RDX 12; RDY 30; YDE 0.5; ADE 2; DAR", "YTO; RDY 12; RDX 30; XDE 0.5; BDE -2; DAR", 10);
}

/// In its own plane a cylinder does what a sphere does; across it nothing.
#[test]
fn cylinder_focuses_in_one_plane() {
    let film = |keys: &str, start: DVec3| {
        let file = read(&SEQ.replace("S 50 5 1.5\n STO\n", &format!("S 0 5 1.5\n STO; {keys}\n")));
        let lens: &Lens = &file.lens;
        let mono = lens.at(550.0).unwrap();
        let mut rays = RayBatch::from_points(&[start], &[DVec3::Z]);
        mono.trace_surfaces(0..1, &mut rays, Vignetting::On);
        rays.direction(0)
    };
    let (along_x, along_y) = (DVec3::new(1.5, 0.0, -3.0), DVec3::new(0.0, 1.5, -3.0));
    assert_eq!(film("CYL; RDX 12", along_y), DVec3::Z);
    assert!((film("CYL; RDX 12", along_x) - film("RDY 12", along_x)).length() < 1e-15);
    assert_eq!(film("CYL; RDY 12", along_x), DVec3::Z);
    assert!((film("CYL; RDY 12", along_y) - film("RDY 12", along_y)).length() < 1e-15);
}
