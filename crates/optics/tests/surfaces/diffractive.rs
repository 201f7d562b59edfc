//! Gratings and diffractive surfaces: the grating equation, ideal diffractive lenses, and files.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::f64::consts::{PI, TAU};

use dioptric_optics::{
    Blaze, DiffractiveSurface, Glass, Interface, Lens, LensFile, MonoLens, ObjectPoint, PhaseProfile, RayBatch,
    RayFate, ReadOptions, SeidelSettings, SeidelSums, Shape, Surface, Vignetting,
    analysis::{PupilCoordinates, projected_solid_angle},
    glam::{DVec2, DVec3},
};

const WAVELENGTH_NM: f64 = 550.0;

/// A single surface between these media with a phase.
fn single(surface: Surface, indices: [f64; 2], order: i32, profile: PhaseProfile) -> Lens {
    let [before, after] = indices.map(|index| Glass::Constant { index });
    let interface = Interface { surface, medium_after: after, thickness_after_mm: 0.0 };
    let lens = Lens::new("diffractive", "test", vec![interface], 0).unwrap().with_object_medium(before).unwrap();
    lens.with_diffractive(vec![DiffractiveSurface { surface: 0, order, profile, blaze: None }]).unwrap()
}

fn ray(lens: &MonoLens, place_mm: DVec2, direction: DVec3) -> RayBatch {
    let direction = direction.normalize();
    let mut ray = RayBatch::from_points(&[place_mm.extend(0.0) - direction * 20.0], &[direction]);
    lens.trace(&mut ray, Vignetting::On);
    ray
}

const GRATING: PhaseProfile = PhaseProfile::Grating { lines_per_mm: [70.0, 240.0] };
const DIRECTIONS: [DVec3; 4] =
    [DVec3::Z, DVec3::new(0.0, 0.3, 1.0), DVec3::new(0.2, -0.1, 1.0), DVec3::new(-0.5, 0.4, 1.0)];

#[test]
fn plane_grating_obeys_its_equation() {
    let lambda_mm = 1e-6 * WAVELENGTH_NM;
    for order in [-2, -1, 0, 1, 3] {
        for (indices, is_mirror) in [([1.0, 1.0], false), ([1.5, 1.0], false), ([1.0, 1.7], false), ([1.3, 1.3], true)]
        {
            let mut lens = single(Surface::plane(10.0), indices, order, GRATING);
            if is_mirror {
                lens = lens.with_mirrors([0]).unwrap();
            }
            let lens = lens.at(WAVELENGTH_NM).unwrap();
            for direction in DIRECTIONS {
                let place_mm = DVec2::new(1.0, -2.0);
                let ray = ray(&lens, place_mm, direction);
                let before = direction.normalize();
                let expected =
                    before.truncate() * indices[0] + DVec2::new(70.0, 240.0) * (f64::from(order) * lambda_mm);
                if expected.length() > indices[1] {
                    assert_eq!(ray.fate[0], RayFate::TotalReflection { surface: 0 });
                    continue;
                }
                assert!(ray.fate[0].is_in_flight());
                let after = ray.direction(0);
                assert!((after.truncate() * indices[1] - expected).length() < 1e-14, "{order} {after}");
                assert!((after.length() - 1.0).abs() < 1e-15 && (after.z < 0.0) == is_mirror);
                // 20 mm in the medium before, and the phase at the place.
                let phase_mm = f64::from(order) * lambda_mm * place_mm.dot(DVec2::new(70.0, 240.0));
                assert!((ray.opl_mm[0] - 20.0 * indices[0] - phase_mm).abs() < 1e-13);
            }
        }
    }
}

#[test]
fn order_that_does_not_propagate_ends() {
    let fine = PhaseProfile::Grating { lines_per_mm: [0.0, 1500.0] };
    let lens = single(Surface::plane(10.0), [1.0, 1.0], 1, fine.clone()).at(WAVELENGTH_NM).unwrap();
    // sin θ = .825 at normal incidence; .825 + .25 is none.
    assert!(ray(&lens, DVec2::ZERO, DVec3::Z).fate[0].is_in_flight());
    let steep = DVec3::new(0.0, 0.25, (1.0_f64 - 0.0625).sqrt());
    assert_eq!(ray(&lens, DVec2::ZERO, steep).fate[0], RayFate::TotalReflection { surface: 0 });
    // Light that plain refraction would reflect totally leaves in the order that turns it back.
    let lens = single(Surface::plane(10.0), [1.6, 1.0], -1, fine).at(WAVELENGTH_NM).unwrap();
    let inside = DVec3::new(0.0, 0.8, 0.6);
    assert!(ray(&lens, DVec2::ZERO, inside).fate[0].is_in_flight());
}

#[test]
fn curved_surfaces_bend_by_their_tangential_phase() {
    let shapes = [
        (0.04, Shape::Sphere),
        (0.04, Shape::Conic { conic: -1.4 }),
        (0.02, Shape::EvenAsphere { conic: 0.5, coefficients: vec![1e-4, -2e-6] }),
        (0.02, Shape::OddAsphere { conic: 0.5, coefficients: vec![1e-3, 2e-3, 1e-5] }),
        (0.02, Shape::Biconic { conic: 0.5, curvature_x_per_mm: -0.03, conic_x: -1.0 }),
    ];
    let rings = PhaseProfile::Rings { radius_mm: 5.0, coefficients_rad: vec![-300.0, 80.0, 9.0] };
    for (curvature_per_mm, shape) in shapes {
        let surface = Surface { curvature_per_mm, shape, semi_aperture_mm: 8.0 };
        for profile in [GRATING, rings.clone()] {
            let lens = single(surface.clone(), [1.0, 1.5], 1, profile.clone()).at(WAVELENGTH_NM).unwrap();
            for direction in DIRECTIONS {
                let ray = ray(&lens, DVec2::new(1.5, 2.5), direction);
                let (p, after) = (ray.point_mm(0), ray.direction(0));
                assert!((p.z - surface.sag_at_mm(p.x, p.y)).abs() < 1e-12 && (after.length() - 1.0).abs() < 1e-15);
                let h = 1e-4;
                let slope = |u: DVec2| {
                    let at = |s: f64| surface.sag_at_mm(p.x + s * u.x, p.y + s * u.y);
                    (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h)
                };
                let gradient_per_mm = match &profile {
                    PhaseProfile::Wavefront(_) => unreachable!("diffraction/tests/wavefront_error.rs has them"),
                    PhaseProfile::Grating { lines_per_mm } => DVec2::from_array(*lines_per_mm),
                    PhaseProfile::Rings { .. } => {
                        let s = p.truncate().length_squared() / 25.0;
                        p.truncate() * (2.0 / 25.0 * (-300.0 + 160.0 * s + 27.0 * s * s) / TAU)
                    }
                };
                let left = after * 1.5 - direction.normalize() - (gradient_per_mm * 1e-6 * WAVELENGTH_NM).extend(0.0);
                // Along both tangents of the surface nothing is left; slopes by differences are good to 1e-12.
                for u in [DVec2::X, DVec2::Y] {
                    let tangent = DVec3::new(u.x, u.y, slope(u));
                    assert!(left.dot(tangent).abs() < 1e-11, "{surface:?}: {:e}", left.dot(tangent));
                }
            }
        }
    }
}

/// The phase of a diffractive lens that is ideal in air at a wavelength: f − √(f² + r²) in waves, by its series.
fn ideal(focal_mm: f64, radius_mm: f64, wavelength_nm: f64) -> PhaseProfile {
    let mut binomial = 0.5;
    let term = |i: i32| {
        let term = -focal_mm * binomial * (radius_mm / focal_mm).powi(2 * i);
        binomial *= (0.5 - f64::from(i)) / f64::from(i + 1);
        term * TAU / (1e-6 * wavelength_nm)
    };
    PhaseProfile::Rings { radius_mm, coefficients_rad: (1..=12).map(term).collect() }
}

#[test]
fn ideal_diffractive_lens_images_a_far_point_perfectly() {
    let (focal_mm, radius_mm) = (80.0, 8.0);
    let lens = single(Surface::plane(radius_mm), [1.0; 2], 1, ideal(focal_mm, radius_mm, WAVELENGTH_NM));
    assert!(lens.is_rotational());
    let mono = lens.at(WAVELENGTH_NM).unwrap();
    let first = mono.first_order();
    assert!((first.efl_mm / focal_mm - 1.0).abs() < 1e-13 && (first.bfl_mm / focal_mm - 1.0).abs() < 1e-13);
    let targets: Vec<DVec2> =
        (0..100).map(|i| 0.8 * f64::from(i).sqrt() * DVec2::from_angle(2.4 * f64::from(i))).collect();
    let mut rays = mono.rays_towards(&ObjectPoint::Infinite(DVec3::Z), &targets, 0.0, 0.0);
    mono.trace_to_film(&mut rays, Vignetting::On, focal_mm);
    for i in 0..rays.len() {
        assert!(rays.point_mm(i).truncate().length() < 1e-12, "{}", rays.point_mm(i));
        assert!((rays.opl_mm[i] - rays.opl_mm[0]).abs() < 1e-12);
    }
    // Power goes with the wavelength, and with the order.
    let red = lens.at(700.0).unwrap().first_order().efl_mm;
    assert!((red * 700.0 / (focal_mm * WAVELENGTH_NM) - 1.0).abs() < 1e-13, "{red}");
    let third = single(Surface::plane(radius_mm), [1.0; 2], 3, ideal(focal_mm, radius_mm, WAVELENGTH_NM));
    let third = third.at(WAVELENGTH_NM).unwrap().first_order().efl_mm;
    assert!((3.0 * third / focal_mm - 1.0).abs() < 1e-13, "{third}");
    // A ray near the axis meets it where first-order optics predicts, on a glass surface too.
    let curved = Surface::sphere(60.0, 4.0);
    let rings = PhaseProfile::Rings { radius_mm: 4.0, coefficients_rad: vec![-200.0, 30.0] };
    let mono = single(curved, [1.0, 1.6], 1, rings).at(WAVELENGTH_NM).unwrap();
    let near = ray(&mono, DVec2::new(0.0, 1e-5), DVec3::Z);
    let focus_mm = -near.y_mm[0] * near.n[0] / near.m[0];
    assert!((focus_mm / mono.first_order().bfl_mm - 1.0).abs() < 1e-9, "{focus_mm}");
    let expected = 0.6 / 60.0 + 200.0 * 1e-6 * WAVELENGTH_NM / (PI * 16.0);
    assert!((mono.first_order().power_per_mm / expected - 1.0).abs() < 1e-13);
}

/// A lens of glass with a diffractive front and a grating that reflects behind it.
fn hybrid() -> Lens {
    let glass = Glass::Constant { index: 1.5 };
    let front = Interface { surface: Surface::sphere(60.0, 6.0), medium_after: glass, thickness_after_mm: 4.0 };
    let back = Interface { surface: Surface::plane(6.0), medium_after: Glass::Air, thickness_after_mm: 20.0 };
    let mirror =
        Interface { surface: Surface::sphere(-500.0, 20.0), medium_after: Glass::Air, thickness_after_mm: 0.0 };
    let lens = Lens::new("hybrid", "test", vec![front, back, mirror], 0).unwrap().with_mirrors([2]).unwrap();
    let rings = PhaseProfile::Rings { radius_mm: 6.0, coefficients_rad: vec![-150.0, 12.0, 1.0] };
    let grating = PhaseProfile::Grating { lines_per_mm: [0.0, 200.0] };
    lens.with_diffractive(vec![
        DiffractiveSurface { surface: 0, order: 1, profile: rings, blaze: None },
        DiffractiveSurface { surface: 2, order: -1, profile: grating, blaze: None },
    ])
    .unwrap()
}

#[test]
fn light_finds_its_way_back_through_gratings() {
    let lens = hybrid().at(WAVELENGTH_NM).unwrap();
    let targets: Vec<DVec2> =
        (0..50).map(|i| 0.7 * f64::from(i).sqrt() * DVec2::from_angle(2.4 * f64::from(i))).collect();
    let start = lens.rays_towards(&ObjectPoint::Infinite(DVec3::new(0.05, 0.1, 1.0).normalize()), &targets, 0.0, 0.0);
    let mut rays = start.clone();
    lens.trace(&mut rays, Vignetting::On);
    assert_eq!(rays.n_in_flight(), 50);
    let mut back = RayBatch::with_capacity(50);
    (0..50).for_each(|i| back.push(rays.point_mm(i) + rays.direction(i) * 5.0, -rays.direction(i), 0.0));
    let mut in_two = back.clone();
    let reversed = lens.reversed();
    reversed.trace(&mut back, Vignetting::On);
    reversed.trace_to_stop(&mut in_two, Vignetting::On);
    reversed.trace_from_stop(&mut in_two, Vignetting::On);
    for i in 0..50 {
        let beside_mm = (back.point_mm(i) - start.point_mm(i)).cross(start.direction(i)).length();
        assert!(beside_mm < 1e-11 && (back.direction(i) + start.direction(i)).length() < 1e-13, "{beside_mm:e}");
        assert!((in_two.direction(i) - back.direction(i)).length() < 1e-13);
    }
}

#[test]
fn gratings_survive_our_own_and_zemax_files() {
    let file = LensFile { film_distance_mm: Some(30.0), ..LensFile::from(hybrid()) };
    let again =
        |name: &str, text: &str| LensFile::from_bytes(name.as_ref(), text.as_bytes(), &ReadOptions::default()).unwrap();
    assert_eq!(again("lens.ron", &file.to_ron()), file);
    let zmx = again("lens.zmx", &file.to_zmx().unwrap());
    assert_eq!(zmx.lens.diffractive(), file.lens.diffractive());
    assert_eq!(zmx.lens.mirrors(), file.lens.mirrors());
    let message = file.to_omni_json().unwrap_err().to_string();
    assert!(message.contains("surface 2 is a mirror"), "{message}");
    let message = hybrid().seidel(&SeidelSettings::far(0.0)).unwrap_err().to_string();
    assert!(message.contains("centered and rotationally symmetric"), "{message}");
}

#[test]
fn impossible_diffractive_surfaces_are_refused() {
    let lens = Lens::built_in("dgauss-50mm").unwrap();
    let at = |surface: usize, profile: PhaseProfile| DiffractiveSurface { surface, order: 1, profile, blaze: None };
    let message = |list: Vec<DiffractiveSurface>| lens.clone().with_diffractive(list).unwrap_err().to_string();
    assert!(message(vec![at(99, GRATING)]).contains("expected a surface that the lens has"));
    assert!(
        message(vec![at(1, GRATING), at(1, GRATING)]).contains("surface 1 cannot be diffractive: it is named twice")
    );
    let rings = |radius_mm: f64, a: f64| PhaseProfile::Rings { radius_mm, coefficients_rad: vec![a] };
    assert!(message(vec![at(1, rings(0.0, 1.0))]).contains("radius_mm of a phase is 0"));
    assert!(message(vec![at(1, rings(1.0, f64::NAN))]).contains("number of a phase is NaN"));
}

/// Rings of a path of `per_mm[0]` r² + `per_mm[1]` r⁴ at the wavelength.
fn rings_of_path(per_mm: [f64; 2]) -> PhaseProfile {
    let radius_mm = 5.0_f64;
    let cycles = |per_mm: f64, power: i32| TAU * per_mm * radius_mm.powi(power) / (1e-6 * WAVELENGTH_NM);
    PhaseProfile::Rings { radius_mm, coefficients_rad: vec![cycles(per_mm[0], 2), cycles(per_mm[1], 4)] }
}

fn rings_on(lens: Lens, surface: usize, per_mm: [f64; 2]) -> Lens {
    let rings = DiffractiveSurface { surface, order: 1, profile: rings_of_path(per_mm), blaze: None };
    lens.with_diffractive(vec![rings]).unwrap()
}

fn settings(object_distance_mm: f64, chief_slope: f64) -> SeidelSettings {
    SeidelSettings { wavelength_nm: WAVELENGTH_NM, object_distance_mm, ..SeidelSettings::far(chief_slope) }
}

fn list(sums: &SeidelSums) -> [f64; 7] {
    [sums.s1, sums.s2, sums.s3, sums.s4, sums.s5, sums.c1, sums.c2]
}

/// A stop 8 mm before an aspheric and a plain surface of glass, of which the one with this number is `ringed`.
fn landscape(ringed: usize, per_mm: [f64; 2]) -> Lens {
    let at = |surface: Surface, index: f64, thickness_after_mm: f64| Interface {
        surface,
        medium_after: Glass::Constant { index },
        thickness_after_mm,
    };
    let asphere = Shape::EvenAsphere { conic: -0.6, coefficients: vec![-3e-6, 2e-8] };
    let interfaces = vec![
        at(Surface::plane(3.0), 1.0, 8.0),
        at(Surface { shape: asphere, ..Surface::sphere(60.0, 8.0) }, 1.6, 4.0),
        at(Surface::sphere(-90.0, 8.0), 1.0, 0.0),
    ];
    rings_on(Lens::new("landscape", "test", interfaces, 0).unwrap(), ringed, per_mm)
}

/// A concave mirror with rings, the stop before it.
fn ringed_mirror() -> Lens {
    let at =
        |surface: Surface, thickness_after_mm: f64| Interface { surface, medium_after: Glass::Air, thickness_after_mm };
    let interfaces = vec![at(Surface::plane(3.0), 30.0), at(Surface::sphere(-160.0, 9.0), 0.0)];
    let lens = Lens::new("mirror", "test", interfaces, 0).unwrap().with_mirrors([1]).unwrap();
    rings_on(lens, 1, [-5e-4, 2e-7])
}

/// Real rays of a small pupil and a small field land off the paraxial image by the gradient of the third-order sums, the rest falls
/// off with the square of both.
#[track_caller]
fn check_against_rays(lens: &Lens, object_distance_mm: f64) {
    let chief_slope = 0.1;
    let sums = lens.seidel(&settings(object_distance_mm, chief_slope)).unwrap();
    let SeidelSums { s1, s2, s3, s4, s5, .. } = sums.total;
    let mono = lens.at(WAVELENGTH_NM).unwrap();
    let first = mono.first_order();
    let (pupil_z_mm, pupil_mm) = (first.entrance_pupil_z_mm, 0.5 * first.entrance_pupil_diameter_mm);
    let film_mm = mono.film_distance_mm_for(object_distance_mm).unwrap();
    // n'u' of the marginal ray, over the height of which the image is the invariant.
    let slope = match object_distance_mm.is_finite() {
        true => pupil_mm / (object_distance_mm + pupil_z_mm) / mono.conjugate(object_distance_mm).magnification,
        false => -first.power_per_mm * pupil_mm,
    };
    let image_mm = sums.lagrange_mm / slope;
    let size = s1.abs() + s2.abs() + s3.abs() + s4.abs() + s5.abs();
    for (rho, field) in [
        (DVec2::new(0.3, 0.8), DVec2::ZERO),
        (DVec2::new(0.5, -0.7), DVec2::new(0.0, 1.0)),
        (DVec2::new(-0.9, 0.4), DVec2::new(0.6, 0.8)),
        (DVec2::ZERO, DVec2::new(0.6, 0.8)),
    ] {
        let (a, b, e) = (rho.length_squared(), rho.dot(field), field.length_squared());
        let gradient = rho * (4.0 * s1 * a + 8.0 * s2 * b + 4.0 * (s3 + s4) * e)
            + field * (4.0 * s2 * a + 8.0 * s3 * b + 4.0 * s5 * e);
        let expected = gradient / (8.0 * slope);
        let of_rays = |scale: f64| {
            let point = match object_distance_mm.is_finite() {
                true => {
                    let height_mm = -chief_slope * (object_distance_mm + pupil_z_mm);
                    ObjectPoint::Finite((scale * height_mm * field).extend(-object_distance_mm))
                }
                false => ObjectPoint::Infinite((scale * chief_slope * field).extend(1.0).normalize()),
            };
            let mut rays = mono.rays_towards(&point, &[scale * pupil_mm * rho], pupil_z_mm, 0.0);
            mono.trace_to_film(&mut rays, Vignetting::Off, film_mm);
            (rays.point_mm(0).truncate() - scale * image_mm * field) / scale.powi(3)
        };
        let (coarse, fine) = (of_rays(0.04), of_rays(0.02));
        // What is left of the fifth order once halved scales have been extrapolated is of the seventh, 1e-6 here.
        let found = (4.0 * fine - coarse) / 3.0;
        let off_mm = (found - expected).length();
        assert!(off_mm < 2e-5 * size / slope.abs(), "{found} {expected}, {rho} {field}");
    }
}

#[test]
fn third_order_of_rings_is_that_of_rays() {
    for object_distance_mm in [f64::INFINITY, 300.0] {
        for ringed in [1, 2] {
            check_against_rays(&landscape(ringed, [-2e-3, 3e-6]), object_distance_mm);
        }
        check_against_rays(&ringed_mirror(), object_distance_mm);
    }
}

#[test]
fn rings_without_phase_leave_the_sums() {
    let settings = settings(250.0, 0.1);
    let plain = landscape(1, [0.0; 2]).with_diffractive(vec![]).unwrap().seidel(&settings).unwrap();
    for ringed in [1, 2] {
        let found = landscape(ringed, [0.0; 2]).seidel(&settings).unwrap();
        for (found, expected) in found.per_surface.iter().zip(&plain.per_surface) {
            for (found, expected) in list(found).into_iter().zip(list(expected)) {
                assert!((found - expected).abs() < 1e-14, "{found} {expected}");
            }
        }
    }
}

#[test]
fn diffractive_lens_in_air_has_its_published_sums() {
    // Buralli & Morris, Applied Optics 28, 3950 (1989): a plane lens at its stop, a far object. S1 = y⁴ φ³ − 8 λ G y⁴, S2 = y² φ² H,
    // S3 = φ H², no Petzval curvature and no distortion; the Abbe number is λ / (λ_F − λ_C).
    let (power, fourth, y, slope) = (0.02, 4e-7, 3.0, 0.1);
    let lens = |stop_mm: f64| {
        let plane = |semi_aperture_mm: f64, thickness_after_mm: f64| Interface {
            surface: Surface::plane(semi_aperture_mm),
            medium_after: Glass::Air,
            thickness_after_mm,
        };
        let interfaces = vec![plane(y, stop_mm), plane(20.0, 0.0)];
        rings_on(Lens::new("rings", "test", interfaces, 0).unwrap(), 1, [-0.5 * power, fourth])
    };
    let found = lens(0.0).seidel(&settings(f64::INFINITY, slope)).unwrap();
    let h = found.lagrange_mm;
    let abbe = WAVELENGTH_NM / (486.1327 - 656.2725);
    let y4 = y.powi(4);
    let expected = [
        y4 * power.powi(3) - 8.0 * fourth * y4,
        y * y * power * power * h,
        power * h * h,
        0.0,
        0.0,
        y * y * power / abbe,
        0.0,
    ];
    for (found, expected) in list(&found.total).into_iter().zip(expected) {
        assert!((found - expected).abs() < 1e-15, "{found} {expected}");
    }
    // With the stop in the front focal plane neither coma nor astigmatism: the rays of all fields meet the lens alike.
    let landscape = rings_on(lens(1.0 / power).with_diffractive(vec![]).unwrap(), 1, [-0.5 * power, 0.0]);
    let found = landscape.seidel(&settings(f64::INFINITY, slope)).unwrap().total;
    assert!(found.s2.abs() < 1e-16 && found.s3.abs() < 1e-16 && found.s4 == 0.0, "{found:?}");
    assert!((found.s1 - y4 * power.powi(3)).abs() < 1e-16, "{found:?}");
}

#[test]
fn rings_are_thin_lens_of_endless_index() {
    // Sweatt, J. Opt. Soc. Am. 67, 803 (1977): of index N, its faces differ by the path over N − 1. What is left falls as 1/N.
    let (index, [square, fourth], bent_per_mm) = (1e7, [-2e-3, 3e-6], 1.0 / 70.0);
    let at = |surface: Surface, index: f64, thickness_after_mm: f64| Interface {
        surface,
        medium_after: Glass::Constant { index },
        thickness_after_mm,
    };
    let stop = || at(Surface::plane(3.0), 1.0, 8.0);
    let face = |square_per_mm: f64, fourth_per_mm3: f64| Surface {
        shape: Shape::OddAsphere { conic: 0.0, coefficients: vec![0.0, square_per_mm, 0.0, fourth_per_mm3] },
        ..Surface::sphere(1.0 / bent_per_mm, 8.0)
    };
    let thin = |path: f64| -path / (index - 1.0);
    let sweatt = vec![
        stop(),
        // The front face bulges where the path is longer. Light in the layer runs along the normal of its faces, which shortens the
        // layer's extent along z by the cosine of their slope.
        at(face(thin(square), thin(fourth + 0.5 * square * bent_per_mm * bent_per_mm)), index, 0.0),
        at(face(0.0, 0.0), 1.5, 0.0),
    ];
    let rings = vec![stop(), at(face(0.0, 0.0), 1.5, 0.0)];
    let sweatt = Lens::new("sweatt", "test", sweatt, 0).unwrap();
    let rings = rings_on(Lens::new("rings", "test", rings, 0).unwrap(), 1, [square, fourth]);
    for object_distance_mm in [f64::INFINITY, 300.0] {
        let settings = settings(object_distance_mm, 0.1);
        let (found, expected) = (rings.seidel(&settings).unwrap().total, sweatt.seidel(&settings).unwrap().total);
        for (found, expected) in list(&found).into_iter().zip(list(&expected)).take(5) {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
    }
}

#[dioptric_golden::needs_shared]
#[test]
fn zemax_grating_has_the_diameter_that_opticstudio_stored() {
    let path = dioptric_golden::shared("data/lenses/more/flat_transmission_grating.zmx").unwrap();
    let file = LensFile::read(&path, &ReadOptions::default()).unwrap();
    let lens = file.lens.at(587.0).unwrap();
    let coordinates = PupilCoordinates::entrance(&lens);
    let places = [DVec2::X, DVec2::NEG_X, DVec2::Y, DVec2::NEG_Y];
    let tan = 10_f64.to_radians().tan();
    let mut widest_mm = 0.0_f64;
    for field in [DVec2::ZERO, DVec2::new(0.0, -tan), DVec2::new(-tan, 0.0)] {
        let point = ObjectPoint::from_field(&lens, field, 0.0);
        let mut rays = coordinates.rays(&lens, &point, &places);
        lens.trace_to_film(&mut rays, Vignetting::Off, file.film_distance_mm.unwrap());
        widest_mm = (0..4).map(|i| rays.point_mm(i).truncate().length()).fold(widest_mm, f64::max);
    }
    // The semi-diameter of the image in the file, by rays at the ends of the axes of the pupil of all fields.
    assert!((widest_mm - 13.319_073_572_664_644).abs() < 1e-6, "{widest_mm}");
}

#[dioptric_golden::needs_shared]
#[test]
fn deeplens_grating_is_read() {
    let path = dioptric_golden::shared("data/lenses/more/a489_grating.json").unwrap();
    let file = LensFile::read(&path, &ReadOptions::default());
    match file {
        Ok(file) => {
            let [DiffractiveSurface { order: 1, profile: PhaseProfile::Grating { lines_per_mm: [x, y] }, .. }] =
                file.lens.diffractive()
            else {
                panic!("{:?}", file.lens.diffractive())
            };
            // 1000 rad over 3 mm.
            assert!(*x == 0.0 && (y - 1000.0 / (3.0 * TAU)).abs() < 1e-12, "{x} {y}");
            assert!(file.notes.iter().any(|note| note.starts_with("DOE: of the grating the first order")));
        }
        Err(error) => panic!("{error}"),
    }
}

const SMOOTH: Blaze = Blaze { design_nm: 550.0, order: None, levels: None };

#[test]
fn shares_of_orders_are_those_of_scalar_theory_and_add_up_to_one() {
    // sinc² of a smooth relief; of staircases the figures that are usually published.
    assert_eq!(SMOOTH.share_of(1, 1.0), 1.0);
    assert!((SMOOTH.share_of(1, 1.5) - (2.0 / PI).powi(2)).abs() < 1e-15 && SMOOTH.share_of(3, 1.0) < 1e-30);
    for (levels, published) in [(2, 0.41), (4, 0.81), (8, 0.95), (16, 0.99)] {
        let found = Blaze { levels: Some(levels), ..SMOOTH }.share_of(1, 1.0);
        let x = PI / f64::from(levels);
        assert!((found - (x.sin() / x).powi(2)).abs() < 1e-15 && (found - published).abs() < 5e-3, "{levels}: {found}");
    }
    let many = Blaze { levels: Some(1_000_000), ..SMOOTH };
    for waves in [0.3, 0.9, 1.0, 1.234, 2.5] {
        assert!((many.share_of(1, waves) - SMOOTH.share_of(1, waves)).abs() < 1e-11);
        // What the orders beyond ±n have falls off as 2/(π² n) for a jump of 2 in a groove.
        let n = 100_000;
        for blaze in [SMOOTH, Blaze { levels: Some(2), ..SMOOTH }, Blaze { levels: Some(5), ..SMOOTH }] {
            let sum: f64 = (-n..=n).map(|order| blaze.share_of(order, waves)).sum();
            // A groove of N steps has jumps of 2 N in all at most.
            let jumps = f64::from(blaze.levels.unwrap_or(1));
            let rest = 2.1 * jumps * jumps / (PI * PI * f64::from(n));
            assert!((1.0 - sum).abs() < rest, "{blaze:?} {waves}: {sum}");
        }
    }
}

#[test]
fn a_kinoform_has_less_light_off_its_wavelength() {
    let glass = Glass::Named("SCHOTT:N-BK7".to_owned());
    let rings = PhaseProfile::Rings { radius_mm: 5.0, coefficients_rad: vec![-100.0] };
    let with = |blaze: Option<Blaze>, order: i32, media: [Glass; 2], mirrors: &[usize]| {
        let [before, after] = media;
        let interface = Interface { surface: Surface::plane(4.0), medium_after: after, thickness_after_mm: 0.0 };
        let lens = Lens::new("kinoform", "test", vec![interface], 0).unwrap().with_object_medium(before).unwrap();
        let phase = DiffractiveSurface { surface: 0, order, profile: rings.clone(), blaze };
        lens.with_mirrors(mirrors.iter().copied()).unwrap().with_diffractive(vec![phase]).unwrap()
    };
    let sinc2 = |x: f64| if x == 0.0 { 1.0 } else { ((PI * x).sin() / (PI * x)).powi(2) };
    let far = ObjectPoint::far(0.05, DVec2::Y);
    let step = |nm: f64| glass.index_at(nm).unwrap() - Glass::Air.index_at(nm).unwrap();
    for nm in [450.0, 550.0, 632.8] {
        for order in [1, -1, 2, 0] {
            let design = Blaze { order: Some(1), ..SMOOTH };
            let lens = with(Some(design), order, [Glass::Air, glass.clone()], &[]);
            let waves = 550.0 / nm * step(nm) / step(550.0);
            let expected = sinc2(waves - f64::from(order));
            assert!((lens.diffraction_efficiency_at(nm).unwrap() - expected).abs() < 1e-14);
            let plain = with(None, order, [Glass::Air, glass.clone()], &[]);
            assert_eq!(plain.at(nm).unwrap().diffraction_efficiency(), 1.0);
            let cone = |lens: &Lens| projected_solid_angle(&lens.at(nm).unwrap(), &far, 64);
            assert!((cone(&lens) - expected * cone(&plain)).abs() < 1e-15);
        }
        // Between equal media, and at a mirror of no dispersion, only the wavelength counts; the order of the surface is the design's.
        let vacuum = Glass::Constant { index: 1.0 };
        for mirrors in [&[][..], &[0]] {
            let lens = with(Some(SMOOTH), -2, [vacuum.clone(), vacuum.clone()], mirrors);
            let found = lens.diffraction_efficiency_at(nm).unwrap();
            assert!((found - sinc2(2.0 - 2.0 * 550.0 / nm)).abs() < 1e-14, "{nm} {found}");
        }
    }
    let lens = with(Some(Blaze { levels: Some(8), ..SMOOTH }), 1, [Glass::Air, glass.clone()], &[]);
    let file = LensFile::from(lens);
    let again = LensFile::from_bytes("a.ron".as_ref(), file.to_ron().as_bytes(), &ReadOptions::default()).unwrap();
    assert_eq!(again.lens, file.lens);
    assert!(file.left_out("zmx")[0].contains("the relief of gratings (blaze)"));
    for (from, to, expected) in [
        ("design_nm: 550.0", "design_nm: 0.0", "design_nm of a blaze is 0, expected a finite number above 0"),
        ("levels: 8", "levels: 1", "levels of a blaze is 1, expected 2 to 1000000"),
    ] {
        let text = file.to_ron().replace(from, to);
        let error = LensFile::from_bytes("a.ron".as_ref(), text.as_bytes(), &ReadOptions::default()).unwrap_err();
        assert!(error.to_string().contains(expected), "{error}");
    }
}
