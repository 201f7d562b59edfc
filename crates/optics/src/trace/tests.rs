//! The kernel against its scalar twin, and against itself in pieces and on threads.

use glam::{DVec2, DVec3};

use super::*;
use crate::{
    CoordinateBreak, Glass, Interface, Lens, MonoLens, ObjectPoint, RayBatch, RayBatchF32, Shape, Surface, rays_towards,
};

/// Rays that fill the front of a lens, and more: some pass, some are vignetted, some miss.
fn bundle(lens: &MonoLens, field_tan: f64, n_rays: usize) -> RayBatch {
    let point = ObjectPoint::from_field(lens, DVec2::new(field_tan, 0.3 * field_tan), 0.5);
    let radius_mm = 1.2 * lens.semi_aperture_mm(0);
    let place = |i: usize| radius_mm * (i as f64 / n_rays as f64).sqrt() * DVec2::from_angle(2.4 * i as f64);
    let targets: Vec<DVec2> = (0..n_rays).map(place).collect();
    rays_towards(&point, &targets, lens.first_order().entrance_pupil_z_mm, 0.0)
}

#[track_caller]
fn assert_same_bits(a: &RayBatch, b: &RayBatch) {
    assert_eq!(a.fate, b.fate);
    let bits = |r: &RayBatch| {
        let lists = [&r.x_mm, &r.y_mm, &r.z_mm, &r.l, &r.m, &r.n, &r.opl_mm];
        lists.map(|list| list.iter().map(|v| v.to_bits()).collect::<Vec<_>>())
    };
    assert_eq!(bits(a), bits(b));
}

/// Traces each ray of a batch by itself.
pub(crate) fn trace_one_by_one(lens: &MonoLens, rims: Vignetting, rays: &mut RayBatch) {
    let plan = Plan::new(&lens.steps_for(rays.object_z_mm), 0, rims);
    for i in 0..rays.len() {
        let ((x, y, z), (l, m, n)) = (rays.point_mm(i).into(), rays.direction(i).into());
        let (ray, fate) = scalar_reference::trace_one(&plan, &Ray { x, y, z, l, m, n, opl: rays.opl_mm[i] });
        (rays.x_mm[i], rays.y_mm[i], rays.z_mm[i]) = (ray.x, ray.y, ray.z);
        (rays.l[i], rays.m[i], rays.n[i]) = (ray.l, ray.m, ray.n);
        (rays.opl_mm[i], rays.fate[i]) = (ray.opl, fate);
    }
}

#[test]
fn tile_and_scalar_twin_agree_to_the_bit() {
    for name in ["dgauss-50mm", "paper-2el", "fisheye-12.5mm", "asphere-15mm", "singlet-50mm"] {
        let lens = Lens::built_in(name).unwrap().at(550.0).unwrap();
        for rims in [Vignetting::On, Vignetting::Off] {
            for (field_tan, n_rays) in [(0.0, 501), (0.3, 1003), (3.0, 777)] {
                let rays = bundle(&lens, field_tan, n_rays);
                let (mut tiled, mut single) = (rays.clone(), rays.clone());
                lens.trace(&mut tiled, rims);
                trace_one_by_one(&lens, rims, &mut single);
                assert_same_bits(&tiled, &single);
            }
        }
    }
    let odd = Surface {
        shape: Shape::OddAsphere { conic: -0.5, coefficients: vec![1e-3, 2e-3, -1e-4, 1e-6] },
        ..Surface::sphere(20.0, 9.0)
    };
    let medium_after = Glass::Constant { index: 1.6 };
    let odd = Lens::new("odd", "test", vec![Interface { surface: odd, medium_after, thickness_after_mm: 0.0 }], 0);
    for lens in [Lens::thin(50.0, 10.0).unwrap(), odd.unwrap()] {
        let lens = lens.at(550.0).unwrap();
        let rays = bundle(&lens, 0.2, 99);
        let (mut tiled, mut single) = (rays.clone(), rays.clone());
        lens.trace(&mut tiled, Vignetting::On);
        trace_one_by_one(&lens, Vignetting::On, &mut single);
        assert_same_bits(&tiled, &single);
    }
}

#[test]
fn pieces_and_threads_change_no_bit() {
    let lens = Lens::built_in("dgauss-50mm").unwrap().at(500.0).unwrap();
    let rays = bundle(&lens, 0.2, 10_001);
    let (mut whole, mut shared) = (rays.clone(), rays.clone());
    lens.trace(&mut whole, Vignetting::On);
    lens.trace_parallel(&mut shared, Vignetting::On);
    assert_same_bits(&whole, &shared);
    let losses = whole.losses();
    assert!(losses.n_in_flight > 1000 && losses.by_surface.iter().filter(|s| s.n_vignetted > 0).count() > 3);

    let (mut whole_on_film, mut shared_on_film) = (rays.clone(), rays.clone());
    lens.trace_to_film(&mut whole_on_film, Vignetting::On, 36.0);
    lens.trace_to_film_parallel(&mut shared_on_film, Vignetting::On, 36.0);
    assert_same_bits(&whole_on_film, &shared_on_film);
    assert_eq!(whole_on_film.fate, whole.fate);

    // A trace in pieces passes the lens frame between them, which rounds z.
    let mut pieces = rays;
    lens.trace_surfaces(0..lens.stop() + 1, &mut pieces, Vignetting::On);
    lens.trace_surfaces(lens.stop() + 1..lens.n_surfaces(), &mut pieces, Vignetting::On);
    assert_eq!(whole.fate, pieces.fate);
    let apart = whole.x_mm.iter().zip(&pieces.x_mm).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(apart < 1e-13, "{apart}");
}

#[test]
fn rays_end_where_and_as_they_should() {
    let lens = Lens::built_in("paper-2el").unwrap().at(550.0).unwrap();
    let at = |y: f64, direction: DVec3| {
        let mut rays = RayBatch::from_points(&[DVec3::new(0.0, y, -5.0)], &[direction.normalize()]);
        lens.trace(&mut rays, Vignetting::On);
        (rays.fate[0], rays.point_mm(0))
    };
    assert_eq!(at(12.4, DVec3::Z).0, RayFate::InFlight);
    let (fate, point) = at(12.6, DVec3::Z);
    assert_eq!(fate, RayFate::Vignetted { surface: 0 });
    assert!((point.z - (67.0 - (67.0_f64.powi(2) - 12.6_f64.powi(2)).sqrt())).abs() < 1e-12, "{point}");
    let (fate, point) = at(80.0, DVec3::Z);
    assert_eq!((fate, point), (RayFate::Missed { surface: 0 }, DVec3::new(0.0, 80.0, 0.0)));

    // Light inside a glass ball beyond the critical angle, 37.3 degrees.
    let ball = Interface { surface: Surface::sphere(-10.0, 9.99), medium_after: Glass::Air, thickness_after_mm: 0.0 };
    let window = Interface {
        surface: Surface::plane(9.0),
        medium_after: Glass::Constant { index: 1.65 },
        thickness_after_mm: 10.0,
    };
    let dome = Lens::new("dome", "test", vec![window, ball], 0).unwrap().at(550.0).unwrap();
    let end = |y: f64| {
        let mut rays = RayBatch::from_points(&[DVec3::new(0.0, y, -1.0)], &[DVec3::Z]);
        dome.trace(&mut rays, Vignetting::On);
        rays.fate[0]
    };
    assert_eq!(end(10.0 * (1.0 / 1.65) - 1e-9), RayFate::InFlight);
    assert_eq!(end(10.0 * (1.0 / 1.65) + 1e-9), RayFate::TotalReflection { surface: 1 });
}

#[test]
fn film_in_one_go_is_the_film_in_two_to_rounding() {
    for name in ["dgauss-50mm", "singlet-50mm", "asphere-15mm"] {
        let lens = Lens::built_in(name).unwrap().at(550.0).unwrap();
        let film_distance_mm = lens.film_distance_mm_for(2_000.0).unwrap();
        let rays = bundle(&lens, 0.1, 1003);
        let (mut one, mut two) = (rays.clone(), rays);
        lens.trace_to_film(&mut one, Vignetting::On, film_distance_mm);
        lens.trace(&mut two, Vignetting::On);
        lens.to_film(&mut two, film_distance_mm);
        assert!(one.n_in_flight() > 100, "{name}");
        assert_eq!((&one.fate, &one.z_mm, &one.l), (&two.fate, &two.z_mm, &two.l));
        for i in 0..one.len() {
            assert!((one.point_mm(i) - two.point_mm(i)).length() < 1e-12, "{name}");
            assert!((one.opl_mm[i] - two.opl_mm[i]).abs() < 1e-12, "{name}");
        }
    }
}

/// Returns the rms and the largest distance on the film, µm, between rays in single and in double precision.
fn single_precision_error_um(lens: &MonoLens, field_tan: f64, dioptres: f64) -> (f64, f64) {
    let film_distance_mm =
        lens.film_distance_mm_for(if dioptres > 0.0 { 1e3 / dioptres } else { f64::INFINITY }).unwrap();
    let point = ObjectPoint::from_field(lens, DVec2::new(field_tan, 0.4 * field_tan), dioptres);
    let radius_mm = 0.5 * lens.first_order().entrance_pupil_diameter_mm;
    let place = |i: usize| radius_mm * (i as f64 / 4000.0).sqrt() * DVec2::from_angle(2.4 * i as f64);
    let targets: Vec<DVec2> = (0..4000).map(place).collect();
    // Rays that start at the point itself are moved to the lens before they are rounded.
    let start_z_mm = if dioptres > 0.0 { point.z_mm() } else { -100.0 };
    let mut exact = rays_towards(&point, &targets, lens.first_order().entrance_pupil_z_mm, start_z_mm);
    let mut single = RayBatchF32::from(&exact);
    lens.trace_to_film(&mut exact, Vignetting::On, film_distance_mm);
    lens.trace_to_film_f32(&mut single, Vignetting::On, film_distance_mm);
    let both = (0..exact.len()).filter(|&i| exact.fate[i].is_in_flight() && single.fate[i].is_in_flight());
    let apart = |i: usize| {
        1e3 * (DVec2::new(single.x_mm[i].into(), single.y_mm[i].into()) - exact.point_mm(i).truncate()).length()
    };
    let errors: Vec<f64> = both.map(apart).collect();
    assert!(errors.len() > 500, "{}", errors.len());
    let mean_square = errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64;
    (mean_square.sqrt(), errors.into_iter().fold(0.0, f64::max))
}

#[test]
fn single_precision_lands_within_a_twentieth_of_a_micrometre() {
    // The double Gauss at f/2, from half a metre to a kilometre and beyond, 0 to 10 degrees off the axis.
    let lens = Lens::built_in("dgauss-50mm").unwrap().at(550.0).unwrap();
    for field_tan in [0.0, 0.08, 0.176] {
        for dioptres in [2.0, 0.5, 1e-3, 0.0] {
            let (rms_um, max_um) = single_precision_error_um(&lens, field_tan, dioptres);
            println!("{field_tan} {dioptres}: {rms_um:.4} rms, {max_um:.4} max");
            assert!(rms_um <= 0.02 && max_um <= 0.05, "{field_tan} {dioptres}: {rms_um} {max_um}");
        }
    }
}

#[test]
fn single_precision_lands_where_it_should_through_other_lenses() {
    for name in ["paper-2el", "asphere-15mm", "singlet-50mm"] {
        let lens = Lens::built_in(name).unwrap().at(550.0).unwrap();
        let (rms_um, max_um) = single_precision_error_um(&lens, 0.1, 0.5);
        println!("{name}: {rms_um:.4} rms, {max_um:.4} max");
        assert!(rms_um <= 0.02 && max_um <= 0.05, "{name}: {rms_um} {max_um}");
    }
}

#[test]
fn single_precision_and_its_scalar_twin_agree_to_the_bit() {
    for name in ["dgauss-50mm", "fisheye-12.5mm", "asphere-15mm"] {
        let lens = Lens::built_in(name).unwrap().at(550.0).unwrap();
        let mut rays = RayBatchF32::from(&bundle(&lens, 0.3, 777));
        let start = rays.clone();
        let plan = Plan::new(lens.steps(), 0, Vignetting::On);
        trace_batch(&plan, Goal::LastSurface, rays.slices());
        for i in 0..rays.len() {
            let (x, y, z) = (start.x_mm[i], start.y_mm[i], start.z_mm[i]);
            let ray = Ray { x, y, z, l: start.l[i], m: start.m[i], n: start.n[i], opl: 0.0 };
            let (ray, fate) = scalar_reference::trace_one(&plan, &ray);
            let bits = [rays.x_mm[i], rays.y_mm[i], rays.z_mm[i], rays.l[i], rays.m[i], rays.n[i]].map(f32::to_bits);
            assert_eq!((rays.fate[i], bits), (fate, [ray.x, ray.y, ray.z, ray.l, ray.m, ray.n].map(f32::to_bits)));
        }
    }
}

#[test]
fn single_precision_goes_through_tilted_and_twice_curved_surfaces_too() {
    let toric = Shape::Biconic { conic: -0.8, curvature_x_per_mm: 0.03, conic_x: 1.5 };
    let interface = |shape: Shape, radius_mm: f64, index: f64| Interface {
        surface: Surface { shape, ..Surface::sphere(radius_mm, 9.0) },
        medium_after: Glass::Constant { index },
        thickness_after_mm: 3.0,
    };
    let interfaces = vec![interface(toric, 20.0, 1.6), interface(Shape::Sphere, -60.0, 1.0)];
    let centered = Lens::new("twice curved", "test", interfaces, 0).unwrap();
    let tilt = CoordinateBreak {
        surfaces: (1, 1),
        pivot_mm: 0.0,
        decenter_mm: [0.1, 0.2, 0.0],
        tilt_deg: [1.0, 2.0, 0.0],
        tilt_first: false,
    };
    let tilted = centered.clone().with_moves(vec![tilt]).unwrap();
    for lens in [centered, tilted] {
        let lens = lens.at(550.0).unwrap();
        let mut exact = bundle(&lens, 0.1, 777);
        let mut single = RayBatchF32::from(&exact);
        lens.trace_to_film(&mut exact, Vignetting::On, 20.0);
        lens.trace_to_film_f32(&mut single, Vignetting::On, 20.0);
        assert!(exact.n_in_flight() > 100);
        for i in (0..exact.len()).filter(|&i| exact.fate[i].is_in_flight() && single.fate[i].is_in_flight()) {
            let apart_mm = DVec2::new(single.x_mm[i].into(), single.y_mm[i].into()) - exact.point_mm(i).truncate();
            assert!(apart_mm.length() < 5e-5, "{apart_mm}");
        }
    }
}
