//! Surfaces and groups that are tilted and decentered, and curved films.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use dioptric_optics::{
    CoordinateBreak, Glass, ImageSurface, Interface, Lens, MonoLens, ObjectPoint, PupilBoundary, RayBatch, RayFate,
    SeidelSettings, Shape, Surface, Vignetting,
    glam::{DMat3, DVec2, DVec3},
    rays_towards,
};

fn still(surfaces: (usize, usize)) -> CoordinateBreak {
    CoordinateBreak { surfaces, pivot_mm: 0.0, decenter_mm: [0.0; 3], tilt_deg: [0.0; 3], tilt_first: false }
}

/// A plate of glass between planes.
fn plate(index: f64, thickness_after_mm: f64) -> Lens {
    let medium_after = Glass::Constant { index };
    let front = Interface { surface: Surface::plane(20.0), medium_after, thickness_after_mm };
    let back = Interface { surface: Surface::plane(20.0), medium_after: Glass::Air, thickness_after_mm: 0.0 };
    Lens::new("plate", "test", vec![front, back], 0).unwrap()
}

/// Rays of a field that fill a lens and more.
fn bundle(lens: &MonoLens, n_rays: usize) -> RayBatch {
    let point = ObjectPoint::from_field(lens, DVec2::new(0.1, -0.15), 0.8);
    let radius_mm = 1.1 * lens.semi_aperture_mm(0);
    let place = |i: usize| radius_mm * (i as f64 / n_rays as f64).sqrt() * DVec2::from_angle(2.4 * i as f64);
    let targets: Vec<DVec2> = (0..n_rays).map(place).collect();
    rays_towards(&point, &targets, lens.first_order().entrance_pupil_z_mm, 0.0)
}

/// Applies a motion to every ray.
fn moved(rays: &RayBatch, rotation: DMat3, shift_mm: DVec3) -> RayBatch {
    let mut moved = RayBatch::with_capacity(rays.len());
    for i in 0..rays.len() {
        moved.push(rotation * rays.point_mm(i) + shift_mm, rotation * rays.direction(i), rays.opl_mm[i]);
    }
    moved.fate.clone_from(&rays.fate);
    moved
}

#[track_caller]
fn assert_near(a: &RayBatch, b: &RayBatch, tolerance_mm: f64) {
    assert_eq!(a.fate, b.fate);
    for i in 0..a.len() {
        let apart_mm = (a.point_mm(i) - b.point_mm(i)).length();
        let turned = (a.direction(i) - b.direction(i)).length();
        let longer_mm = (a.opl_mm[i] - b.opl_mm[i]).abs();
        assert!(apart_mm < tolerance_mm && turned < 0.1 * tolerance_mm, "ray {i}: {apart_mm} {turned}");
        assert!(longer_mm < tolerance_mm, "ray {i}: {longer_mm}");
    }
}

#[test]
fn tilted_plate_shifts_a_ray_sideways() {
    let (index, thickness_mm) = (1.5168, 7.0);
    for tilt_deg in [5.0_f64, 30.0, -45.0] {
        let tilt = CoordinateBreak { tilt_deg: [tilt_deg, 0.0, 0.0], ..still((0, 1)) };
        let lens = plate(index, thickness_mm).with_moves(vec![tilt]).unwrap().at(550.0).unwrap();
        let mut rays = RayBatch::from_points(&[DVec3::new(0.3, 0.2, -30.0)], &[DVec3::Z]);
        lens.trace(&mut rays, Vignetting::On);
        lens.to_film(&mut rays, 25.0);
        let (sine, cosine) = tilt_deg.to_radians().sin_cos();
        // The ray turns towards the normal, which leans to −y for a positive turn about x.
        let shift_mm = -thickness_mm * sine * (1.0 - cosine / (index * index - sine * sine).sqrt());
        let expected = DVec3::new(0.3, 0.2 + shift_mm, thickness_mm + 25.0);
        assert!((rays.point_mm(0) - expected).length() < 2e-14, "{}", rays.point_mm(0));
        assert!((rays.direction(0) - DVec3::Z).length() < 1e-15);
    }
}

#[test]
fn wedge_bends_a_ray_as_a_prism_does() {
    let (index, wedge_deg) = (1.6, 12.0_f64);
    let tilt = CoordinateBreak { tilt_deg: [0.0, wedge_deg, 0.0], ..still((1, 1)) };
    let lens = plate(index, 5.0).with_moves(vec![tilt]).unwrap().at(550.0).unwrap();
    let mut rays = RayBatch::from_points(&[DVec3::new(0.0, 0.0, -1.0)], &[DVec3::Z]);
    lens.trace(&mut rays, Vignetting::On);
    // Into the plate head-on; out of it at the wedge's angle: sin(wedge + deviation) = n sin(wedge).
    let deviation = (index * wedge_deg.to_radians().sin()).asin() - wedge_deg.to_radians();
    assert!((rays.l[0] + deviation.sin()).abs() < 1e-15, "{} {}", rays.l[0], deviation.sin());
}

#[test]
fn whole_lens_moved_is_its_rays_moved_back() {
    let lens = Lens::built_in("dgauss-50mm").unwrap();
    let n = lens.interfaces().len();
    let step =
        CoordinateBreak { pivot_mm: 13.0, decenter_mm: [1.5, -0.7, 2.0], tilt_deg: [8.0, -5.0, 20.0], ..still((0, n)) };
    let (film_distance_mm, centered) = (36.5, lens.at(550.0).unwrap());
    let placed = lens.with_moves(vec![step]).unwrap();
    assert!(!placed.is_rotational());
    let placed = placed.at(550.0).unwrap();
    let placement = placed.film_placement(-centered.last_vertex_z_mm());
    let start = bundle(&centered, 1000);
    let (mut expected, mut found) = (start.clone(), moved(&start, placement.rotation, placement.vertex_mm));
    centered.trace(&mut expected, Vignetting::On);
    centered.to_film(&mut expected, film_distance_mm);
    placed.trace_parallel(&mut found, Vignetting::On);
    placed.to_film(&mut found, film_distance_mm);
    assert!(expected.n_in_flight() > 200 && expected.losses().by_surface.len() > 3);
    // Some hundred roundings of numbers of the order of 100 mm, of which steep rays make a few times more.
    assert_near(&found, &moved(&expected, placement.rotation, placement.vertex_mm), 2e-12);
}

#[test]
fn decentered_group_is_rays_shifted_between_the_groups() {
    let lens = Lens::built_in("dgauss-50mm").unwrap();
    let (n, first) = (lens.interfaces().len(), 6);
    let shift_mm = DVec3::new(0.4, -0.3, 0.0);
    let step = CoordinateBreak { decenter_mm: shift_mm.into(), ..still((first, n - 1)) };
    let centered = lens.at(550.0).unwrap();
    let placed = lens.with_moves(vec![step]).unwrap().at(550.0).unwrap();
    let start = bundle(&centered, 500);
    let (mut front, mut found) = (start.clone(), start);
    centered.trace_surfaces(0..first, &mut front, Vignetting::On);
    let mut shifted = moved(&front, DMat3::IDENTITY, -shift_mm);
    centered.trace_surfaces(first..n, &mut shifted, Vignetting::On);
    placed.trace(&mut found, Vignetting::On);
    for i in (0..found.len()).filter(|&i| front.fate[i].is_in_flight()) {
        assert_eq!(found.fate[i], shifted.fate[i]);
        assert!((found.point_mm(i) - shifted.point_mm(i) - shift_mm).length() < 1e-12);
    }
    // Its pupil is not where that of the centered lens is.
    let point = ObjectPoint::from_field(&placed, DVec2::ZERO, 0.0);
    let pupil = PupilBoundary::find(&placed, &point, 32).unwrap();
    assert!(pupil.center_mm().length() > 1e-3);
}

#[test]
fn pupil_of_a_decentered_lens_is_decentered() {
    let lens = Lens::built_in("dgauss-50mm").unwrap();
    let step = CoordinateBreak { decenter_mm: [30.0, 5.0, 0.0], ..still((0, lens.interfaces().len())) };
    let lens = lens.with_moves(vec![step]).unwrap().at(550.0).unwrap();
    // Thirty millimetres off, the axis of the lens frame does not even cross the lens.
    let point = ObjectPoint::Infinite(DVec3::new(0.0, 0.1, 1.0).normalize());
    let pupil = PupilBoundary::find(&lens, &point, 32).unwrap();
    assert!((pupil.center_mm() - DVec2::new(30.0, 5.0)).length() < 3.0, "{}", pupil.center_mm());
    let at_edge = |beyond_mm: f64| {
        let edges = pupil.rho_at_azimuths_mm().iter().enumerate();
        let place = |(i, rho_mm): (usize, &f64)| {
            pupil.center_mm() + (rho_mm + beyond_mm) * DVec2::from_angle(std::f64::consts::TAU * i as f64 / 32.0)
        };
        lens.clearances_mm(rays_towards(&point, &edges.map(place).collect::<Vec<_>>(), pupil.z_mm(), 0.0))
    };
    assert!(at_edge(-1e-9).iter().all(|clearance_mm| (0.0..1e-8).contains(clearance_mm)));
    assert!(at_edge(1e-9).iter().all(|clearance_mm| *clearance_mm < 0.0));
}

#[test]
fn tilt_and_its_return_change_no_bit() {
    let lens = Lens::built_in("asphere-15mm").unwrap();
    let n = lens.interfaces().len();
    let there =
        CoordinateBreak { pivot_mm: 1.0, tilt_deg: [3.0, 4.0, 5.0], decenter_mm: [0.1, 0.2, 0.3], ..still((0, n)) };
    let back =
        CoordinateBreak { tilt_deg: [-3.0, -4.0, -5.0], decenter_mm: [-0.1, -0.2, -0.3], tilt_first: true, ..there };
    let again = lens.clone().with_moves(vec![there, back]).unwrap();
    assert!(again.is_rotational() && again.check_rotational("a test").is_ok());
    let (a, b) = (lens.at(550.0).unwrap(), again.at(550.0).unwrap());
    let (mut rays, mut same) = (bundle(&a, 300), bundle(&a, 300));
    a.trace(&mut rays, Vignetting::On);
    b.trace(&mut same, Vignetting::On);
    assert_eq!(rays, same);
}

#[test]
fn what_needs_symmetry_refuses_a_lens_without() {
    let step = CoordinateBreak { decenter_mm: [0.1, 0.0, 0.0], ..still((0, 0)) };
    let lens = plate(1.5, 3.0).with_moves(vec![step]).unwrap();
    let message = lens.seidel(&SeidelSettings::far(0.1)).unwrap_err().to_string();
    let expected = "a sum of Seidel aberrations needs a lens that is centered and rotationally symmetric, \
                    which plate is not";
    assert_eq!(message, expected);
    assert!(!lens.at(550.0).unwrap().is_rotational());
}

#[test]
fn lens_moved_sideways_as_a_whole_is_recentered() {
    let lens = Lens::built_in("asphere-15mm").unwrap();
    let n = lens.interfaces().len();
    let aside = |surfaces| CoordinateBreak { decenter_mm: [0.5, -0.25, 0.0], ..still(surfaces) };
    let of = |moves: Vec<CoordinateBreak>| lens.clone().with_moves(moves).unwrap().recentered();
    assert_eq!(of(vec![aside((0, n - 1))]), Some((lens.clone(), DVec2::new(0.5, -0.25))));
    let farther = of(vec![aside((0, n - 1)), aside((0, n - 1))]).map(|(_, aside)| aside);
    assert_eq!(farther, Some(DVec2::new(1.0, -0.5)));
    let turned = CoordinateBreak { tilt_deg: [0.1, 0.0, 0.0], ..aside((0, n - 1)) };
    let towards_film = CoordinateBreak { decenter_mm: [0.5, 0.0, 0.1], ..still((0, n - 1)) };
    for moves in [vec![], vec![aside((0, 0))], vec![aside((0, n))], vec![turned], vec![towards_film]] {
        assert_eq!(of(moves.clone()), None, "{moves:?}");
    }
    let curved = lens.clone().with_image_surface(ImageSurface { curvature_per_mm: -0.05, conic: 0.0 }).unwrap();
    assert_eq!(curved.with_moves(vec![aside((0, n - 1))]).unwrap().recentered(), None);
}

#[test]
fn file_and_back_keeps_moves_shapes_and_the_film() {
    let biconic = Shape::Biconic { conic: -0.3, curvature_x_per_mm: 0.02, conic_x: 0.7 };
    let toroid = Shape::Toroid { curvature_x_per_mm: 0.03, conic: 0.5, coefficients: vec![1e-3, -2e-5] };
    let surface = |shape| Surface { shape, ..Surface::sphere(40.0, 5.0) };
    let interface = |shape, medium_after| Interface { surface: surface(shape), medium_after, thickness_after_mm: 2.0 };
    let interfaces = vec![interface(biconic, Glass::Constant { index: 1.5 }), interface(toroid, Glass::Air)];
    let lens = Lens::new("anamorphic", "test", interfaces, 0).unwrap();
    let moves = vec![
        CoordinateBreak { tilt_deg: [1.0, 2.0, 3.0], tilt_first: true, ..still((1, 2)) },
        CoordinateBreak { decenter_mm: [0.1, 0.0, -0.2], pivot_mm: 0.7, ..still((0, 0)) },
    ];
    let image_surface = ImageSurface { curvature_per_mm: -1.0 / 12.0, conic: 0.25 };
    let lens = lens.with_moves(moves).unwrap().with_image_surface(image_surface).unwrap();
    let path = std::env::temp_dir().join(format!("dioptric-placed-{}.ron", std::process::id()));
    std::fs::write(&path, lens.to_ron()).unwrap();
    let again = Lens::read(&path).unwrap();
    std::fs::write(&path, lens.to_ron().replace("(1, 2)", "(1, 3)")).unwrap();
    let message = Lens::read(&path).unwrap_err().to_string();
    std::fs::remove_file(&path).unwrap();
    assert_eq!(again, lens);
    assert!(message.contains("move 0 is of surfaces 1 to 3, expected"), "{message}");
}

#[test]
fn rays_end_on_a_curved_film() {
    let lens = Lens::built_in("dgauss-50mm").unwrap();
    let image_surface = ImageSurface { curvature_per_mm: -1.0 / 40.0, conic: 0.0 };
    let curved = lens.clone().with_image_surface(image_surface).unwrap().at(550.0).unwrap();
    assert!(curved.is_rotational(), "a curved film is no tilt");
    let film_distance_mm = 36.5;
    let mut rays = bundle(&curved, 200);
    curved.trace(&mut rays, Vignetting::On);
    let (mut flat, behind) = (rays.clone(), rays.clone());
    curved.to_film(&mut rays, film_distance_mm);
    curved.to_film_plane(&mut flat, film_distance_mm);
    let center = DVec3::Z * (curved.last_vertex_z_mm() + film_distance_mm - 40.0);
    assert!(rays.n_in_flight() > 50);
    for i in (0..rays.len()).filter(|&i| rays.fate[i].is_in_flight()) {
        assert!(((rays.point_mm(i) - center).length() - 40.0).abs() < 2e-14);
        let onwards = (rays.point_mm(i) - flat.point_mm(i)).dot(rays.direction(i));
        assert!(((rays.point_mm(i) - flat.point_mm(i)).length() - onwards.abs()).abs() < 1e-14, "on its line");
        assert!((rays.opl_mm[i] - flat.opl_mm[i] - onwards).abs() < 1e-13);
    }
    // On a film that is flat by default both are one.
    let flat_lens = lens.at(550.0).unwrap();
    let mut same = behind;
    flat_lens.to_film(&mut same, film_distance_mm);
    assert_eq!(same, flat);
    // A small ball does not fill the field.
    let ball = ImageSurface { curvature_per_mm: -1.0, conic: 0.0 };
    let ball = Lens::built_in("dgauss-50mm").unwrap().with_image_surface(ball).unwrap().at(550.0).unwrap();
    let mut rays = bundle(&ball, 200);
    ball.trace(&mut rays, Vignetting::On);
    ball.to_film(&mut rays, film_distance_mm);
    assert!(rays.fate.contains(&RayFate::Missed { surface: 11 }));
}
