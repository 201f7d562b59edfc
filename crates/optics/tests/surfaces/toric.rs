//! Surfaces that bend differently along x and y.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use dioptric_optics::{
    Glass, Interface, Lens, MonoLens, ObjectPoint, RayBatch, RayFate, Shape, Surface, Vignetting,
    glam::{DVec2, DVec3},
    rays_towards,
};

const INDEX: f64 = 1.5;

/// A single surface into glass, by its radius along y.
fn single(radius_y_mm: f64, shape: Shape) -> MonoLens {
    let surface = Surface { shape, ..Surface::sphere(radius_y_mm, 6.0) };
    let medium_after = Glass::Constant { index: INDEX };
    let interface = Interface { surface, medium_after, thickness_after_mm: 0.0 };
    Lens::new("surface", "test", vec![interface], 0).unwrap().at(550.0).unwrap()
}

/// A disc of rays of this direction, traced.
fn traced(lens: &MonoLens, direction: DVec3) -> RayBatch {
    let place = |i: usize| 5.0 * (i as f64 / 60.0).sqrt() * DVec2::from_angle(2.4 * i as f64);
    let targets: Vec<DVec2> = (0..60).map(place).collect();
    let mut rays = rays_towards(&ObjectPoint::Infinite(direction.normalize()), &targets, 0.0, -20.0);
    lens.trace(&mut rays, Vignetting::On);
    rays
}

fn biconic(radius_x_mm: f64, conic_x: f64, conic: f64) -> Shape {
    Shape::Biconic { conic, curvature_x_per_mm: 1.0 / radius_x_mm, conic_x }
}

fn toroid(radius_x_mm: f64, conic: f64, coefficients: &[f64]) -> Shape {
    Shape::Toroid { curvature_x_per_mm: 1.0 / radius_x_mm, conic, coefficients: coefficients.to_vec() }
}

#[track_caller]
fn assert_same(a: &RayBatch, b: &RayBatch) {
    assert_eq!(a.fate, b.fate);
    assert!(a.n_in_flight() > 30);
    for i in 0..a.len() {
        // Some dozen operations on numbers of the order of the start's distance, 20 mm.
        let (apart_mm, turned) = (a.point_mm(i) - b.point_mm(i), a.direction(i) - b.direction(i));
        assert!(apart_mm.length() < 4e-14 && turned.length() < 4e-15, "ray {i}: {apart_mm} {turned}");
    }
}

#[test]
fn biconic_and_toroid_of_equal_curvatures_are_the_conic_and_the_sphere() {
    for direction in [DVec3::Z, DVec3::new(0.3, -0.2, 1.0)] {
        for conic in [-2.3, -1.0, -0.4, 0.0, 1.2] {
            let expected = traced(&single(20.0, Shape::Conic { conic }), direction);
            assert_same(&traced(&single(20.0, biconic(20.0, conic, conic)), direction), &expected);
        }
        for radius_mm in [20.0, -20.0, f64::INFINITY] {
            let expected = traced(&single(radius_mm, Shape::Sphere), direction);
            assert_same(&traced(&single(radius_mm, toroid(radius_mm, 0.0, &[])), direction), &expected);
        }
    }
}

#[test]
fn elliptic_cylinders_image_far_light_to_perfect_lines() {
    // The section that images a far point perfectly has conic constant −1/n² and focus n R/(n − 1).
    let (radius_mm, conic) = (20.0, -1.0 / (INDEX * INDEX));
    let focus_mm = INDEX * radius_mm / (INDEX - 1.0);
    for (lens, across) in [
        (single(radius_mm, toroid(f64::INFINITY, conic, &[])), DVec3::Y),
        (single(radius_mm, biconic(f64::INFINITY, 0.0, conic)), DVec3::Y),
        (single(f64::INFINITY, biconic(radius_mm, conic, 0.0)), DVec3::X),
    ] {
        let mut rays = traced(&lens, DVec3::Z);
        lens.to_film(&mut rays, focus_mm);
        let along = DVec3::new(across.y, across.x, 0.0);
        for i in 0..rays.len() {
            assert!(rays.fate[i].is_in_flight());
            assert!(rays.point_mm(i).dot(across).abs() < 1e-13, "{}", rays.point_mm(i));
        }
        let longest = (0..rays.len()).map(|i| rays.point_mm(i).dot(along).abs()).fold(0.0, f64::max);
        assert!(longest > 4.5, "the line is as long as the beam is wide: {longest}");
        let (y, x) = (lens.first_order().bfl_mm, lens.first_order_x().bfl_mm);
        let (focused, straight) = if across == DVec3::Y { (y, x) } else { (x, y) };
        assert!((focused - focus_mm).abs() < 1e-12 && straight.is_infinite(), "{y} {x}");
    }
}

#[test]
fn toroid_has_a_focal_line_for_each_of_its_radii() {
    let (radius_x_mm, radius_y_mm) = (15.0, 25.0);
    // A square term on top of the curve of radius 50 makes it one of radius 25.
    let lens = single(50.0, toroid(radius_x_mm, 0.0, &[0.5 / 25.0 - 0.5 / 50.0]));
    let focus_mm = |radius_mm: f64| INDEX * radius_mm / (INDEX - 1.0);
    assert!((lens.first_order().bfl_mm - focus_mm(radius_y_mm)).abs() < 1e-12);
    assert!((lens.first_order_x().bfl_mm - focus_mm(radius_x_mm)).abs() < 1e-12);
    let height_mm = 1e-3;
    let starts = [DVec3::new(height_mm, 0.0, -1.0), DVec3::new(0.0, height_mm, -1.0)];
    let mut rays = RayBatch::from_points(&starts, &[DVec3::Z; 2]);
    lens.trace(&mut rays, Vignetting::On);
    let crosses_mm = [-rays.x_mm[0] / rays.l[0], -rays.y_mm[1] / rays.m[1]];
    for (found_mm, radius_mm) in crosses_mm.into_iter().zip([radius_x_mm, radius_y_mm]) {
        // Spherical aberration at this height is of the order of its square over the radius.
        assert!((found_mm - focus_mm(radius_mm)).abs() < 1e-6, "{found_mm}");
    }
}

#[test]
fn rays_end_on_the_surface_that_the_formula_states() {
    let (rx, conic, coefficients) = (-30.0, -1.7, [2e-3, -3e-5, 4e-7]);
    let lens = single(14.0, toroid(rx, conic, &coefficients));
    let rays = traced(&lens, DVec3::new(0.2, 0.35, 1.0));
    assert!(rays.n_in_flight() > 40);
    for i in (0..rays.len()).filter(|&i| rays.fate[i].is_in_flight()) {
        let (x, y, z) = rays.point_mm(i).into();
        let y2 = y * y;
        let conic_part = y2 / 14.0 / (1.0 + (1.0 - (1.0 + conic) * y2 / 196.0).sqrt());
        let curve = conic_part + y2 * (coefficients[0] + y2 * (coefficients[1] + y2 * coefficients[2]));
        // The ring: every point is as far from the axis of rotation as the curve is at its y.
        let from_axis = ((rx - z).powi(2) + x * x).sqrt();
        assert!((from_axis - (rx - curve).abs()).abs() < 2e-14, "{from_axis}");
        assert!((rays.direction(i).length() - 1.0).abs() < 1e-15);
    }
}

#[test]
fn rays_beside_the_surface_miss_it() {
    let lens = single(10.0, biconic(8.0, 0.0, 0.0));
    let mut rays = RayBatch::from_points(&[DVec3::new(8.1, 0.0, -5.0), DVec3::new(3.0, 3.0, -5.0)], &[DVec3::Z; 2]);
    lens.trace(&mut rays, Vignetting::Off);
    assert_eq!(rays.fate, [RayFate::Missed { surface: 0 }, RayFate::InFlight]);
}

#[test]
fn rim_must_fit_in_every_direction() {
    let check = |radius_y_mm: f64, shape: Shape| {
        let surface = Surface { shape, ..Surface::sphere(radius_y_mm, 6.0) };
        let interface = Interface { surface, medium_after: Glass::Air, thickness_after_mm: 0.0 };
        Lens::new("rim", "test", vec![interface], 0).map(|_| ()).map_err(|error| error.to_string())
    };
    assert_eq!(check(6.1, biconic(6.1, 0.0, 0.0)), Ok(()));
    let message = "surface 0: a rim of 6 mm does not fit on a surface of radius 5 mm";
    assert_eq!(check(5.0, biconic(6.1, 0.0, 0.0)), Err(message.to_owned()));
    assert_eq!(check(6.1, biconic(5.0, 0.0, 0.0)), Err(message.to_owned()));
    assert_eq!(check(6.1, toroid(5.0, 0.0, &[])), Err(message.to_owned()));
    assert!(check(6.1, toroid(6.1, 0.0, &[f64::NAN])).unwrap_err().contains("coefficient is NaN"));
    assert!(check(6.1, biconic(f64::NAN, 0.0, 0.0)).unwrap_err().contains("curvature_x_per_mm is NaN"));
}
