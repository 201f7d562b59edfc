//! Rays from the film to the scene, and the bounds of the exit pupil that they start within.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use dioptric_optics::{
    Aperture, CoordinateBreak, ExitPupilBounds, Glass, ImageSurface, Interface, Lens, MonoLens, Outline, PupilReach,
    RayBatch, RayBatchF32, RayFate, Shape, Surface, Vignetting,
    glam::{DVec2, DVec3},
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Every built-in lens, and some that are moved, curved otherwise, immersed and stopped by more than circles, each with its
/// film distance for a far object, mm.
fn lenses() -> Vec<(String, Lens, f64)> {
    let mut all: Vec<Lens> = Lens::built_in_names().map(|name| Lens::built_in(name).unwrap()).collect();
    let gauss = Lens::built_in("dgauss-50mm").unwrap();
    let last = gauss.interfaces().len() - 1;
    let movement = |surfaces, decenter_mm, tilt_deg| CoordinateBreak {
        surfaces,
        pivot_mm: 10.0,
        decenter_mm,
        tilt_deg,
        tilt_first: false,
    };
    let whole = movement((0, last), [3.0, -2.0, 0.0], [4.0, -3.0, 1.0]);
    let group = movement((2, 4), [0.1, 0.05, 0.0], [0.3, 0.2, 0.0]);
    let film = movement((last + 1, last + 1), [0.0, 1.0, 0.2], [5.0, 2.0, 10.0]);
    all.push(gauss.clone().with_moves(vec![whole, group, film]).unwrap());
    all.push(gauss.clone().with_image_surface(ImageSurface { curvature_per_mm: -1.0 / 60.0, conic: -0.3 }).unwrap());
    all.push(gauss.clone().with_object_medium(Glass::Constant { index: 1.333 }).unwrap());
    let rectangle = Outline::Rectangle { half_x_mm: 6.0, half_y_mm: 3.0 };
    let opening = Aperture { surface: gauss.stop(), outline: rectangle, center_mm: [1.0, 0.0], is_obscuration: false };
    let spot = Aperture {
        surface: gauss.stop(),
        outline: Outline::Circle { radius_mm: 1.5 },
        center_mm: [0.0; 2],
        is_obscuration: true,
    };
    let interfaces = gauss.interfaces().to_vec();
    all.push(Lens::new_with_apertures("slit", "test", interfaces, gauss.stop(), vec![opening, spot]).unwrap());
    let toroid = Shape::Toroid { curvature_x_per_mm: 0.012, conic: 0.3, coefficients: vec![1e-5, 1e-8] };
    let front = Interface {
        surface: Surface { shape: toroid, ..Surface::sphere(60.0, 8.0) },
        medium_after: Glass::Constant { index: 1.6 },
        thickness_after_mm: 5.0,
    };
    let back = Interface {
        surface: Surface::sphere(-80.0, 8.0),
        medium_after: Glass::Constant { index: 1.336 },
        thickness_after_mm: 0.0,
    };
    all.push(Lens::new("toric", "test", vec![front, back], 0).unwrap());
    all.push(Lens::thin(50.0, 12.0).unwrap());
    let placed = |lens: Lens| {
        let mono = lens.at(550.0).unwrap();
        let film_distance_mm =
            mono.film_distance_mm_for(f64::INFINITY).or_else(|_| mono.film_distance_mm_for(500.0)).unwrap_or(30.0);
        (lens.name().to_owned(), lens, film_distance_mm)
    };
    all.into_iter().map(placed).collect()
}

/// Rays from all over a film of this half diagonal to all over the rim of the last surface, and their film places.
fn from_film(lens: &MonoLens, film_distance_mm: f64, half_mm: f64, n: usize, seed: u64) -> (Vec<DVec2>, RayBatch) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let last = lens.n_surfaces() - 1;
    let placement =
        ExitPupilBounds::find(&[lens.reversed()], film_distance_mm, DVec2::splat(half_mm), PupilReach::WholeLens)
            .unwrap()
            .plane();
    let (mut places, mut rays) = (Vec::new(), RayBatch::with_capacity(n));
    while rays.len() < n {
        let mut pair = || DVec2::new(random.random::<f64>(), random.random::<f64>()) * 2.0 - DVec2::ONE;
        let (place, target) = (pair() * half_mm, pair() * 1.2 * lens.semi_aperture_mm(last));
        let site = lens.film_site(place, film_distance_mm).unwrap();
        let target = placement.lens_from_surface(target.extend(0.0));
        places.push(place);
        rays.push(target, (target - site.point_mm).normalize(), 0.0);
    }
    (places, rays)
}

fn half_film_mm(lens: &MonoLens, film_distance_mm: f64) -> f64 {
    (0.3 * film_distance_mm).min(15.0).min(2.0 * lens.semi_aperture_mm(lens.n_surfaces() - 1))
}

/// How far from a point the line of a ray passes.
fn off_line_mm(rays: &RayBatch, i: usize, point_mm: DVec3) -> f64 {
    (point_mm - rays.point_mm(i)).cross(rays.direction(i)).length()
}

#[test]
fn light_returns_the_way_it_came() {
    for (name, lens, film_distance_mm) in lenses() {
        let lens = lens.at(550.0).unwrap();
        let (_, start) = from_film(&lens, film_distance_mm, half_film_mm(&lens, film_distance_mm), 4000, 1);
        let mut rays = start.clone();
        lens.reversed().trace(&mut rays, Vignetting::On);
        assert!(rays.n_in_flight() > 10, "{name}: {}", rays.n_in_flight());
        let mut home = RayBatch::with_capacity(start.len());
        for i in 0..rays.len() {
            home.push(rays.point_mm(i), -rays.direction(i), 0.0);
        }
        home.fate.clone_from(&rays.fate);
        lens.trace(&mut home, Vignetting::Off);
        for i in (0..home.len()).filter(|&i| home.fate[i].is_in_flight()) {
            assert!(off_line_mm(&home, i, start.point_mm(i)) < 1e-11, "{name} ray {i}");
            assert!((home.direction(i) + start.direction(i)).length() < 1e-12, "{name} ray {i}");
        }
        // Back at the last surface, not at the plane where they began.
        let behind = |i: usize| (home.point_mm(i) - start.point_mm(i)).dot(start.direction(i));
        let index = lens.image_index();
        let is_ideal = name == "thin lens";
        for i in (0..home.len()).filter(|&i| home.fate[i].is_in_flight() && !is_ideal) {
            let longer_mm = rays.opl_mm[i] - (home.opl_mm[i] + index * behind(i));
            assert!(longer_mm.abs() < 1e-11, "{name} ray {i}: {longer_mm}");
        }
    }
}

#[test]
fn rims_end_the_same_rays_both_ways() {
    for (name, lens, film_distance_mm) in lenses() {
        let lens = lens.at(550.0).unwrap();
        let (_, start) = from_film(&lens, film_distance_mm, half_film_mm(&lens, film_distance_mm), 4000, 2);
        let (mut clipped, mut free) = (start.clone(), start.clone());
        lens.reversed().trace(&mut clipped, Vignetting::On);
        lens.reversed().trace(&mut free, Vignetting::Off);
        let mut home = RayBatch::with_capacity(start.len());
        for i in 0..free.len() {
            home.push(free.point_mm(i), -free.direction(i), 0.0);
        }
        home.fate.clone_from(&free.fate);
        lens.trace(&mut home, Vignetting::On);
        let mut n_lost = 0;
        for i in (0..start.len()).filter(|&i| free.fate[i].is_in_flight()) {
            assert_eq!(home.fate[i].is_in_flight(), clipped.fate[i].is_in_flight(), "{name} ray {i}");
            // The last rim met on the way back that stops the ray is the first on the way there.
            if let (RayFate::Vignetted { surface: there }, RayFate::Vignetted { surface: back }) =
                (home.fate[i], clipped.fate[i])
            {
                assert!(there <= back && usize::from(back) < lens.n_surfaces(), "{name}: {there} {back}");
                n_lost += 1;
            }
        }
        assert!(n_lost > 20, "{name}: {n_lost}");
    }
}

#[test]
fn pause_at_the_stop_changes_nothing() {
    for (name, lens, film_distance_mm) in lenses() {
        let reversed = lens.at(550.0).unwrap().reversed();
        let (_, start) = from_film(
            reversed.forward(),
            film_distance_mm,
            half_film_mm(reversed.forward(), film_distance_mm),
            2000,
            3,
        );
        let (mut whole, mut parts) = (start.clone(), start);
        reversed.trace(&mut whole, Vignetting::On);
        reversed.trace_to_stop(&mut parts, Vignetting::On);
        let edge_mm = reversed.forward().stop_semi_aperture_mm();
        for i in (0..parts.len()).filter(|&i| parts.fate[i].is_in_flight()) {
            let own_mm = reversed.stop_placement().surface_from_lens(parts.point_mm(i));
            assert!(own_mm.truncate().length() <= edge_mm + 1e-12, "{name}");
        }
        reversed.trace_from_stop(&mut parts, Vignetting::On);
        for i in 0..whole.len() {
            assert_eq!(whole.fate[i].is_in_flight(), parts.fate[i].is_in_flight(), "{name} ray {i}");
            let apart_mm = (whole.point_mm(i) - parts.point_mm(i)).length();
            assert!(!whole.fate[i].is_in_flight() || apart_mm < 1e-12, "{name} ray {i}: {apart_mm}");
            let turned = (whole.direction(i) - parts.direction(i)).length();
            assert!(!whole.fate[i].is_in_flight() || turned < 1e-13, "{name} ray {i}: {turned}");
        }
    }
}

#[test]
fn single_precision_keeps_scene_rays() {
    for (name, lens, film_distance_mm) in lenses() {
        let lens = lens.at(550.0).unwrap();
        let (_, start) = from_film(&lens, film_distance_mm, half_film_mm(&lens, film_distance_mm), 2000, 4);
        let mut narrow = RayBatchF32::from(&start);
        for i in 0..start.len() {
            let (point, direction) = (start.point_mm(i), start.direction(i));
            (narrow.x_mm[i], narrow.y_mm[i], narrow.z_mm[i]) = point.as_vec3().into();
            (narrow.l[i], narrow.m[i], narrow.n[i]) = direction.as_vec3().into();
        }
        let mut wide = start;
        lens.reversed().trace(&mut wide, Vignetting::On);
        lens.reversed().trace_f32(&mut narrow);
        let both = |i: &usize| wide.fate[*i].is_in_flight() && narrow.fate[*i].is_in_flight();
        let kept: Vec<usize> = (0..wide.len()).filter(both).collect();
        assert!(kept.len() + 20 > wide.n_in_flight(), "{name}");
        let turned = |&i: &usize| {
            let direction = DVec3::new(narrow.l[i].into(), narrow.m[i].into(), narrow.n[i].into());
            (direction - wide.direction(i)).length_squared()
        };
        let rms_angle = (kept.iter().map(turned).sum::<f64>() / kept.len() as f64).sqrt();
        // A twentieth of a micrometre over the focal length, and no less than some twenty roundings of a cosine (6e-8).
        let limit = (5e-5 / lens.first_order().efl_mm.abs()).max(3e-7);
        assert!(rms_angle < limit, "{name}: {rms_angle} {limit}");
    }
}

#[test]
fn no_light_passes_outside_the_bounds() {
    for (name, lens, film_distance_mm) in lenses() {
        let at = |nm: f64| lens.at(nm).unwrap().reversed();
        let half_mm = half_film_mm(at(550.0).forward(), film_distance_mm);
        let colors = [450.0, 550.0, 650.0].map(at);
        for reach in [PupilReach::WholeLens, PupilReach::Stop] {
            let bounds = ExitPupilBounds::find(&colors, film_distance_mm, DVec2::splat(half_mm), reach).unwrap();
            let (mut n_lit, mut n_outside) = (0, 0);
            for (seed, nm) in [450.0, 480.0, 550.0, 600.0, 650.0].into_iter().enumerate() {
                let reversed = at(nm);
                let (places, start) =
                    from_film(reversed.forward(), film_distance_mm, half_mm, 30_000, 10 + seed as u64);
                let mut rays = start.clone();
                match reach {
                    PupilReach::WholeLens => reversed.trace(&mut rays, Vignetting::On),
                    PupilReach::Stop => reversed.trace_to_stop(&mut rays, Vignetting::On),
                }
                for i in (0..rays.len()).filter(|&i| rays.fate[i].is_in_flight()) {
                    n_lit += 1;
                    n_outside += usize::from(!bounds.contains(places[i], start.point_mm(i)));
                }
            }
            assert!(n_lit > 300, "{name}: {n_lit}");
            assert_eq!(n_outside, 0, "{name} {reach:?}: of {n_lit}");
        }
    }
}

#[test]
fn bounds_waste_few_rays() {
    for (f_number, least) in [(2.03, 0.88), (8.0, 0.88), (22.0, 0.88)] {
        let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(f_number, 550.0).unwrap();
        let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2_000.0).unwrap();
        let reversed = lens.at(550.0).unwrap().reversed();
        let bounds = ExitPupilBounds::find(
            std::slice::from_ref(&reversed),
            film_distance_mm,
            DVec2::new(18.0, 12.0),
            PupilReach::WholeLens,
        )
        .unwrap();
        let mut random = ChaCha8Rng::seed_from_u64(5);
        for place in [DVec2::ZERO, DVec2::new(5.0, -6.0)] {
            let mut rays = RayBatch::default();
            for _ in 0..20_000 {
                let target = bounds.sample(place, DVec2::new(random.random(), random.random())).unwrap().point_mm;
                assert!(bounds.contains(place, target));
                let site = reversed.forward().film_site(place, film_distance_mm).unwrap();
                rays.push(target, (target - site.point_mm).normalize(), 0.0);
            }
            reversed.trace(&mut rays, Vignetting::On);
            let share = rays.n_in_flight() as f64 / rays.len() as f64;
            assert!(share > least, "f/{f_number} at {place}: {share}");
        }
    }
}

#[test]
fn samples_fill_the_bounds_evenly() {
    let lens = Lens::built_in("dgauss-50mm").unwrap().at(550.0).unwrap();
    let bounds = ExitPupilBounds::find(&[lens.reversed()], 36.4, DVec2::splat(15.0), PupilReach::WholeLens).unwrap();
    let place = DVec2::new(3.0, 4.0);
    let n = 400;
    let sample = |i: usize| {
        let u = DVec2::new((i % n) as f64 + 0.5, (i / n) as f64 + 0.5) / n as f64;
        bounds.sample(place, u).unwrap()
    };
    // A box of half the width holds its own area's share of the samples.
    let (corner, side_mm) = (DVec2::new(-3.0, -2.0), 5.0);
    let is_in =
        |p: DVec3| (p.truncate() - corner).min_element() > 0.0 && (p.truncate() - corner).max_element() < side_mm;
    let n_in = (0..n * n).filter(|&i| is_in(sample(i).point_mm)).count();
    let found_mm2 = n_in as f64 / (n * n) as f64 * sample(0).area_mm2;
    assert!((found_mm2 / (side_mm * side_mm) - 1.0).abs() < 0.01, "{found_mm2}");
}

#[test]
fn film_within_the_lens_is_refused() {
    let lens = Lens::built_in("dgauss-50mm").unwrap().at(550.0).unwrap();
    let find = |film_distance_mm| {
        ExitPupilBounds::find(&[lens.reversed()], film_distance_mm, DVec2::ONE, PupilReach::WholeLens)
    };
    assert_eq!(
        find(-3.0).unwrap_err().to_string(),
        "the film of dgauss-50mm lies -3 mm behind the last vertex, expected a distance above 0"
    );
}
