//! Tilted, decentered and anamorphic surfaces and curved films in lens files.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::path::Path;

use dioptric_optics::{
    CoordinateBreak, Glass, ImageSurface, Interface, Lens, LensFile, RayBatch, ReadOptions, Shape, Surface, Vignetting,
    glam::{DVec2, DVec3},
};

const PLATE: &str = "MODE SEQ
UNIT MM
ENPD 4
WAVM 1 0.55 1
PWAV 1
SURF 0
  DISZ INFINITY
SURF 1
  STOP
  DISZ 10
SURF 2
  TYPE COORDBRK
  PARM 3 30
  DISZ 0
SURF 3
  DISZ 7
  GLAS ___BLANK 1 0 1.5 0
SURF 4
  DISZ 0
SURF 5
  TYPE COORDBRK
  PARM 3 -30
  PARM 6 1
  DISZ 20
SURF 6
  CURV -0.05
  CONI 0.25
";

fn read(name: &str, text: &str) -> LensFile {
    LensFile::from_bytes(Path::new(name), text.as_bytes(), &ReadOptions::default())
        .unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// Where rays through a lens meet the film, in the film's own frame.
fn on_film(lens: &Lens, film_distance_mm: f64) -> Vec<Option<DVec2>> {
    let mono = lens.at(550.0).unwrap();
    let start = |i: i32| DVec3::new(0.5 * f64::from(i % 9 - 4), 0.5 * f64::from(i / 9 - 4), -5.0);
    let starts: Vec<DVec3> = (0..81).map(start).collect();
    let direction = DVec3::new(0.02, -0.03, 1.0).normalize();
    let mut rays = RayBatch::from_points(&starts, &[direction; 81]);
    mono.trace(&mut rays, Vignetting::On);
    mono.to_film(&mut rays, film_distance_mm);
    let placement = mono.film_placement(film_distance_mm);
    let place =
        |i: usize| rays.fate[i].is_in_flight().then(|| placement.surface_from_lens(rays.point_mm(i)).truncate());
    (0..rays.len()).map(place).collect()
}

#[track_caller]
fn assert_same(a: &LensFile, b: &LensFile) {
    // An axis that goes round by breaks is as long as its pieces, and so are its distances.
    let film_distance_mm = b.film_distance_mm.unwrap();
    let (a, b) = (on_film(&a.lens, a.film_distance_mm.unwrap_or(film_distance_mm)), on_film(&b.lens, film_distance_mm));
    assert!(a.iter().flatten().count() > 40);
    for (a, b) in a.into_iter().zip(b) {
        match (a, b) {
            // Angles are written in degrees and read back: some roundings of a hundred millimetres.
            (Some(a), Some(b)) => assert!((a - b).length() < 1e-12, "{a} {b}"),
            (a, b) => assert_eq!(a, b),
        }
    }
}

fn still(surfaces: (usize, usize)) -> CoordinateBreak {
    CoordinateBreak { surfaces, pivot_mm: 0.0, decenter_mm: [0.0; 3], tilt_deg: [0.0; 3], tilt_first: false }
}

#[test]
fn tilted_plate_of_a_zemax_file_shifts_light_and_its_return_puts_the_film_back() {
    let file = read("plate.zmx", PLATE);
    assert_eq!((file.lens.interfaces().len(), file.film_distance_mm), (3, Some(20.0)));
    assert_eq!(file.lens.image_surface(), ImageSurface { curvature_per_mm: -0.05, conic: 0.25 });
    let mono = file.lens.at(550.0).unwrap();
    let mut rays = RayBatch::from_points(&[DVec3::ZERO], &[DVec3::Z]);
    mono.trace(&mut rays, Vignetting::On);
    mono.to_film_plane(&mut rays, 20.0);
    let (sine, cosine) = 30_f64.to_radians().sin_cos();
    let shift_mm = -7.0 * sine * (1.0 - cosine / (2.25 - sine * sine).sqrt());
    // The return is made at the plate's back, so that the film follows the axis from there.
    let film = DVec3::new(0.0, -7.0 * sine, 10.0 + 7.0 * cosine + 20.0);
    assert!((mono.film_placement(20.0).vertex_mm - film).length() < 1e-14);
    assert!((rays.point_mm(0) - DVec3::new(0.0, shift_mm, film.z)).length() < 1e-13, "{}", rays.point_mm(0));
    // Vignetting that the file leaves out are as wide as the tilted beam needs them.
    assert!((file.lens.interfaces()[1].surface.semi_aperture_mm - 2.0 / cosine).abs() < 1e-6);
}

#[test]
fn breaks_are_in_the_units_of_the_file() {
    let inches = PLATE.replace("UNIT MM", "UNIT IN").replace("PARM 3 30", "PARM 1 0.5\n  PARM 2 -1\n  PARM 3 30");
    let lens = read("plate.zmx", &inches).lens;
    let placement = lens.placements()[1];
    assert!((placement.vertex_mm - DVec3::new(12.7, -25.4, 254.0)).length() < 1e-12);
    assert!((placement.tilt_deg()[0] - 30.0).abs() < 1e-13);
}

/// A lens with every kind of shape and move.
fn design() -> LensFile {
    let biconic = Shape::Biconic { conic: -0.3, curvature_x_per_mm: 0.02, conic_x: 0.7 };
    let interface = |shape, radius_mm, medium_after| Interface {
        surface: Surface { shape, ..Surface::sphere(radius_mm, 6.0) },
        medium_after,
        thickness_after_mm: 2.5,
    };
    let mut interfaces = vec![
        interface(biconic, 40.0, Glass::Constant { index: 1.5 }),
        interface(Shape::Sphere, -60.0, Glass::Air),
        interface(Shape::Sphere, f64::INFINITY, Glass::Air),
        interface(Shape::Conic { conic: -1.0 }, 80.0, Glass::Named("SCHOTT:N-BK7".to_owned())),
        interface(Shape::Sphere, -70.0, Glass::Air),
    ];
    interfaces[4].thickness_after_mm = 0.0;
    let lens = Lens::new("placed", "test", interfaces, 2).unwrap();
    let moves = vec![
        CoordinateBreak { decenter_mm: [0.1, -0.2, 0.0], tilt_deg: [2.0, -1.0, 5.0], ..still((0, 0)) },
        CoordinateBreak { decenter_mm: [0.4, 0.1, 0.0], tilt_deg: [1.0, 1.5, -20.0], pivot_mm: 1.25, ..still((3, 4)) },
        CoordinateBreak { tilt_deg: [-3.0, 0.5, 0.0], tilt_first: true, ..still((4, 4)) },
    ];
    let mut file = LensFile::from(lens.with_moves(moves).unwrap());
    file.film_distance_mm = Some(55.0);
    file.wavelengths_nm = vec![550.0];
    file.reference_wavelength_nm = Some(550.0);
    file
}

#[test]
fn files_written_trace_the_same() {
    let file = design();
    let json = read("a.json", &file.to_omni_json().unwrap());
    assert_same(&json, &file);
    let zmx = read("a.zmx", &file.to_zmx().unwrap());
    assert_eq!((zmx.lens.stop(), zmx.lens.interfaces().len()), (2, 5));
    assert_same(&zmx, &file);
    assert_eq!(file.to_zmx().unwrap().matches("COORDBRK").count(), 5, "around surface 0 and the group, and within it");

    let mut bent = design();
    let mut moves = bent.lens.moves().to_vec();
    moves.push(CoordinateBreak { tilt_deg: [4.0, 0.0, 0.0], ..still((5, 5)) });
    let image_surface = ImageSurface { curvature_per_mm: -0.01, conic: 0.5 };
    bent.lens = bent.lens.with_moves(moves).unwrap().with_image_surface(image_surface).unwrap();
    let zmx = read("a.zmx", &bent.to_zmx().unwrap());
    assert_same(&zmx, &bent);
    assert_eq!(zmx.lens.image_surface(), image_surface);
    let message = bent.to_omni_json().unwrap_err().to_string();
    assert!(message.ends_with("surface 5 (the film) is tilted or decentered"), "{message}");
    let message = design().to_dat().unwrap_err().to_string();
    assert_eq!(message, "a .dat file cannot hold this lens: surface 0 is tilted or decentered");
}

#[test]
fn tilts_written_about_their_pivots_keep_every_length_of_the_axis() {
    let wide =
        PLATE.replace("ENPD 4", "ENPD 8").replace("DISZ 7", "DISZ 7\n  DIAM 20").replace("SURF 4", "SURF 4\n  DIAM 20");
    for tilt_deg in [[30.0, 0.0, 0.0], [0.01, -0.02, 3.0], [0.0, 0.0, 45.0]] {
        for (surfaces, pivot_mm) in [((1, 2), 0.0), ((1, 2), 3.0), ((2, 2), -4.0)] {
            let mut file = read("plate.zmx", &wide);
            let plate = CoordinateBreak { tilt_deg, pivot_mm, decenter_mm: [0.3, -0.1, 0.0], ..still(surfaces) };
            file.lens = file.lens.with_moves(vec![plate]).unwrap();
            let again = read("again.zmx", &file.to_zmx().unwrap());
            let lengths = |file: &LensFile| {
                let gaps = file.lens.interfaces().iter().map(|interface| interface.thickness_after_mm);
                gaps.chain(file.film_distance_mm).collect::<Vec<_>>()
            };
            // The last gap of a lens is the film's.
            let n_gaps = file.lens.interfaces().len() - 1;
            let (mut expected, mut found) = (lengths(&file), lengths(&again));
            expected.remove(n_gaps);
            found.remove(n_gaps);
            for (expected, found) in expected.into_iter().zip(found) {
                // A pivot is known to rounding over the square of the tilt: 1e-16 mm over 1e-7.
                assert!((expected - found).abs() < 1e-8, "{tilt_deg:?}: {expected} {found}");
            }
            assert_same(&again, &file);
        }
    }
}

#[test]
fn toroid_is_written_and_read_in_any_unit() {
    let toroid = Shape::Toroid { curvature_x_per_mm: 0.0, conic: 0.5, coefficients: vec![1e-3, 0.0, -2e-7] };
    let surface = Surface { shape: toroid.clone(), ..Surface::sphere(40.0, 5.0) };
    let interface = Interface { surface, medium_after: Glass::Constant { index: 1.5 }, thickness_after_mm: 0.0 };
    let mut file = LensFile::from(Lens::new("toroid", "test", vec![interface], 0).unwrap());
    file.film_distance_mm = Some(100.0);
    let text = file.to_zmx().unwrap();
    let again = read("a.zmx", &text);
    assert_eq!(again.lens.interfaces()[0].surface.shape, toroid);
    let lengths = read("a.zmx", &text.replace("UNIT MM", "UNIT CM")).lens;
    let sag = |lens: &Lens, scale: f64| lens.interfaces()[0].surface.sag_at_mm(3.0 * scale, 4.0 * scale);
    assert!((sag(&lengths, 10.0) - 10.0 * sag(&file.lens, 1.0)).abs() < 1e-12);
    let message = file.to_omni_json().unwrap_err().to_string();
    assert!(message.contains("surface 0 is neither a sphere nor a conic, a biconic or an asphere"), "{message}");
}
