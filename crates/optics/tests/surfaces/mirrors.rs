//! Mirrors: closed forms, unfolded lenses, and first and third order of telescopes.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::f64::consts::PI;

use dioptric_optics::{
    Aperture, CoordinateBreak, ExitPupilBounds, Glass, ImageSurface, Interface, Layout, Lens, LensFile, MirrorShadow,
    MonoLens, ObjectPoint, Outline, PupilBoundary, PupilReach, RayBatch, ReadOptions, SeidelSettings, Shape, Surface,
    Vignetting,
    analysis::{Autofocus, PupilRule, projected_solid_angle},
    glam::{DVec2, DVec3},
    rays_towards,
};

/// A surface in air.
fn row(radius_mm: f64, conic: f64, semi_aperture_mm: f64, thickness_after_mm: f64) -> Interface {
    let curvature_per_mm = if radius_mm.is_finite() { 1.0 / radius_mm } else { 0.0 };
    let shape = if conic == 0.0 { Shape::Sphere } else { Shape::Conic { conic } };
    let surface = Surface { curvature_per_mm, shape, semi_aperture_mm };
    Interface { surface, medium_after: Glass::Air, thickness_after_mm }
}

fn single(radius_mm: f64, conic: f64, semi_aperture_mm: f64) -> Lens {
    let mirror = row(radius_mm, conic, semi_aperture_mm, 0.0);
    Lens::new("mirror", "test", vec![mirror], 0).unwrap().with_mirrors([0]).unwrap()
}

/// A two-mirror telescope by the focal length of its primary mirror, its own, and how far its focus is behind the secondary.
struct Telescope {
    primary_mm: f64,
    focal_mm: f64,
    back_mm: f64,
    semi_aperture_mm: f64,
}

const TELESCOPE: Telescope =
    Telescope { primary_mm: 800.0, focal_mm: 3200.0, back_mm: 1000.0, semi_aperture_mm: 160.0 };

impl Telescope {
    fn magnification(&self) -> f64 {
        self.focal_mm / self.primary_mm
    }

    fn separation_mm(&self) -> f64 {
        (self.focal_mm - self.back_mm) / self.magnification()
    }

    /// Returns the telescope of these conic constants: both mirrors are concave towards the primary focus.
    fn lens(&self, conics: [f64; 2]) -> Lens {
        let (d, b, f) = (self.separation_mm(), self.back_mm, self.focal_mm);
        let secondary_mm = -2.0 * d * b / (f - b - d);
        let shadow_mm = self.semi_aperture_mm * b / f;
        let primary = row(-2.0 * self.primary_mm, conics[0], self.semi_aperture_mm, -d);
        let secondary = row(secondary_mm, conics[1], 1.3 * shadow_mm, 0.0);
        Lens::new("telescope", "test", vec![primary, secondary], 0).unwrap().with_mirrors([0, 1]).unwrap()
    }

    /// Conics of Cassegrain's telescope: a paraboloid, and the hyperboloid whose foci are those of both.
    fn cassegrain(&self) -> Lens {
        let m = self.magnification();
        self.lens([-1.0, -((m + 1.0) / (m - 1.0)).powi(2)])
    }

    /// Conics of Ritchey and Chrétien's telescope, which has no coma of third order either.
    fn ritchey_chretien(&self) -> Lens {
        let (m, ratio) = (self.magnification(), self.back_mm / self.separation_mm());
        let primary = -1.0 - 2.0 / m.powi(3) * ratio;
        self.lens([primary, -1.0 - 2.0 / (m - 1.0).powi(3) * (m * (2.0 * m - 1.0) + ratio)])
    }
}

fn disc(radius_mm: f64, n_rays: usize) -> Vec<DVec2> {
    (0..n_rays).map(|i| radius_mm * (i as f64 / n_rays as f64).sqrt() * DVec2::from_angle(2.4 * i as f64)).collect()
}

fn traced(lens: &MonoLens, point: &ObjectPoint, radius_mm: f64, film_distance_mm: f64) -> RayBatch {
    let mut rays = rays_towards(point, &disc(radius_mm, 200), 0.0, 0.0);
    lens.trace_to_film(&mut rays, Vignetting::On, film_distance_mm);
    assert_eq!(rays.n_in_flight(), 200);
    rays
}

/// Checks that all rays meet in a point of the film by equal paths, to rounding of the paths.
#[track_caller]
fn assert_perfect(lens: &Lens, point: &ObjectPoint, radius_mm: f64, film_distance_mm: f64, tolerance_mm: f64) {
    let lens = lens.at(550.0).unwrap();
    let rays = traced(&lens, point, radius_mm, film_distance_mm);
    for i in 0..rays.len() {
        let miss_mm = rays.point_mm(i).truncate().length();
        assert!(miss_mm < tolerance_mm, "ray {i} misses by {miss_mm:e} mm");
        let longer_mm = (rays.opl_mm[i] - rays.opl_mm[0]).abs();
        assert!(longer_mm < tolerance_mm, "ray {i} is longer by {longer_mm:e} mm");
    }
}

#[test]
fn paraboloid_images_a_far_point_perfectly() {
    // At f/0.63, to some roundings of a path of 100 mm.
    let far = ObjectPoint::Infinite(DVec3::Z);
    assert_perfect(&single(-200.0, -1.0, 80.0), &far, 80.0, 100.0, 5e-13);
}

#[test]
fn ellipsoid_and_hyperboloid_image_focus_to_focus() {
    // The foci of a conic of eccentricity e lie R/(1 ± e) from its vertex.
    let (radius_mm, e) = (-150.0_f64, 0.6_f64);
    let near_mm = radius_mm.abs() / (1.0 + e);
    let far = ObjectPoint::Finite(DVec3::new(0.0, 0.0, radius_mm / (1.0 - e)));
    assert_perfect(&single(radius_mm, -e * e, 60.0), &far, 40.0, near_mm, 1e-12);
    // A convex hyperboloid makes of light that runs to its far focus light that runs to the near one, the way back.
    let (radius_mm, e) = (-120.0_f64, 2.5_f64);
    let concave = single(radius_mm, -e * e, 40.0).at(550.0).unwrap();
    let source = ObjectPoint::Finite(DVec3::new(0.0, 0.0, radius_mm / (1.0 + e)));
    let mut rays = rays_towards(&source, &disc(30.0, 100), 0.0, 0.0);
    concave.trace(&mut rays, Vignetting::On);
    // Light leaves it as though it came from the other focus, behind the mirror.
    let virtual_mm = DVec3::new(0.0, 0.0, radius_mm / (1.0 - e));
    for i in 0..rays.len() {
        let off_mm = (virtual_mm - rays.point_mm(i)).cross(rays.direction(i)).length();
        assert!(rays.n[i] < 0.0 && off_mm < 1e-12, "ray {i} passes the focus by {off_mm:e} mm");
    }
}

#[test]
fn cassegrain_is_perfect_on_axis() {
    // Rays go 1.6 m, in sums of some twenty terms that round by 1e-13 mm each, and meet at f/10.
    let far = ObjectPoint::Infinite(DVec3::Z);
    assert_perfect(&TELESCOPE.cassegrain(), &far, 160.0, TELESCOPE.back_mm, 2e-11);
}

#[test]
fn telescope_has_its_lengths_by_first_order() {
    let mono = TELESCOPE.cassegrain().at(550.0).unwrap();
    let first = mono.first_order();
    let power_per_mm = 1.0 / TELESCOPE.focal_mm;
    assert!((first.power_per_mm / power_per_mm - 1.0).abs() < 1e-13);
    assert!((first.bfl_mm / TELESCOPE.back_mm - 1.0).abs() < 1e-13);
    assert!((first.f_number - TELESCOPE.focal_mm / 320.0).abs() < 1e-12);
    assert_eq!((first.entrance_pupil_z_mm, first.entrance_pupil_diameter_mm), (0.0, 320.0));
    // The secondary images the primary, which is the stop: 1/z + 1/d = −2/R, z along the light.
    let radius_mm = 1.0 / TELESCOPE.cassegrain().interfaces()[1].surface.curvature_per_mm;
    let (pupil_mm, d) = (first.exit_pupil_z_mm, TELESCOPE.separation_mm());
    assert!((1.0 / pupil_mm + 1.0 / d - 2.0 / radius_mm).abs() < 1e-15, "{pupil_mm}");
    let film_mm = mono.film_distance_mm_for(f64::INFINITY).unwrap();
    assert!((film_mm - TELESCOPE.back_mm).abs() < 1e-10 && !mono.is_film_backward());
    // Nearer objects are imaged behind: Newton's equation.
    let distance_mm = 1e6;
    let object_mm = distance_mm + first.ffl_mm;
    let behind_mm = mono.film_distance_mm_for(distance_mm).unwrap() - film_mm;
    assert!((behind_mm * object_mm / TELESCOPE.focal_mm.powi(2) - 1.0).abs() < 1e-9);
}

#[test]
fn real_axial_beam_of_a_telescope_fills_its_primary() {
    let mono = TELESCOPE.cassegrain().at(550.0).unwrap();
    let beam = mono.axial_beam(f64::INFINITY).unwrap();
    assert!(beam.is_limited_by_stop && (beam.height_mm - 160.0).abs() < 1e-9);
    assert!((mono.real_f_number().unwrap() - 10.0).abs() < 1e-9);
    assert!(mono.is_rotational());
}

#[test]
fn spherical_mirror_has_the_textbook_sums() {
    // Stop at the mirror, far object: S1 = 2 |c|³ y⁴, S2 = −2 c² y³ ū, S3 = 2 |c| y² ū², S4 = −S3 (Petzval −2c).
    let (radius_mm, y, u) = (-400.0_f64, 40.0_f64, 0.02_f64);
    let c = radius_mm.abs().recip();
    let total = single(radius_mm, 0.0, y).seidel(&SeidelSettings::far(u)).unwrap().total;
    let s3 = 2.0 * c * y * y * u * u;
    assert!((total.s1 / (2.0 * c.powi(3) * y.powi(4)) - 1.0).abs() < 1e-13, "{total:?}");
    assert!((total.s2.abs() / (2.0 * c * c * y.powi(3) * u) - 1.0).abs() < 1e-13, "{total:?}");
    assert!((total.s3 / s3 - 1.0).abs() < 1e-13 && (total.s4 / s3 + 1.0).abs() < 1e-13, "{total:?}");
    assert!(total.s5.abs() < 1e-17 && total.c1 == 0.0 && total.c2 == 0.0, "{total:?}");
    // A paraboloid has no spherical aberration, and the coma of the sphere.
    let parabola = single(radius_mm, -1.0, y).seidel(&SeidelSettings::far(u)).unwrap().total;
    assert!(parabola.s1.abs() < 1e-15 * total.s1 && (parabola.s2 / total.s2 - 1.0).abs() < 1e-13);
}

#[test]
fn ritchey_chretien_is_aplanatic_in_third_order() {
    let settings = SeidelSettings::far(0.004);
    let of = |lens: Lens| lens.seidel(&settings).unwrap();
    let (sphere, classical) = (of(TELESCOPE.lens([0.0; 2])), of(TELESCOPE.cassegrain()));
    let found = of(TELESCOPE.ritchey_chretien());
    assert!(classical.total.s1.abs() < 1e-13 * sphere.total.s1.abs(), "{classical:?}");
    assert!(found.total.s1.abs() < 1e-13 * sphere.total.s1.abs(), "{found:?}");
    assert!(found.total.s2.abs() < 1e-13 * sphere.total.s2.abs(), "{found:?}");
    // The coma of Cassegrain's telescope is that of a paraboloid of its focal length.
    let paraboloid = single(-2.0 * TELESCOPE.focal_mm, -1.0, 160.0).seidel(&settings).unwrap();
    assert!((classical.total.s2 / paraboloid.total.s2 - 1.0).abs() < 1e-12);
    // Petzval's sum: of the powers of both mirrors over the index.
    let h2 = found.lagrange_mm * found.lagrange_mm;
    let lens = TELESCOPE.cassegrain();
    let [c1, c2] = [0, 1].map(|i: usize| lens.interfaces()[i].surface.curvature_per_mm);
    assert!((found.total.s4 / (2.0 * h2 * (c1 - c2)) - 1.0).abs() < 1e-12, "{found:?}");
}

/// A plate at the center of curvature of a sphere, which its back takes the spherical aberration of.
fn schmidt(semi_aperture_mm: f64) -> Lens {
    let (radius_mm, index) = (-800.0_f64, 1.5);
    let a4 = 2.0 * radius_mm.recip().powi(3) / (8.0 * (1.0 - index));
    let shape = Shape::EvenAsphere { conic: 0.0, coefficients: vec![a4] };
    let glass = Glass::Constant { index };
    let front = Interface { medium_after: glass, ..row(f64::INFINITY, 0.0, semi_aperture_mm, 0.0) };
    let back = Interface {
        surface: Surface { shape, ..Surface::plane(1.01 * semi_aperture_mm) },
        medium_after: Glass::Air,
        thickness_after_mm: 800.0,
    };
    let mirror = row(radius_mm, 0.0, 2.0 * semi_aperture_mm, 0.0);
    Lens::new("Schmidt", "test", vec![front, back, mirror], 0).unwrap().with_mirrors([2]).unwrap()
}

#[test]
fn schmidt_camera_has_field_curvature_alone() {
    let found = schmidt(100.0).seidel(&SeidelSettings::far(0.05)).unwrap();
    let mirror = found.per_surface[2];
    let total = found.total;
    assert!(total.s1.abs() < 1e-13 * mirror.s1, "{total:?}");
    // The stop lies at the center of curvature: chief rays meet the mirror head-on.
    for sum in [total.s2, total.s3, total.s5] {
        assert!(sum.abs() < 1e-12 * mirror.s1, "{total:?}");
    }
    let h2 = found.lagrange_mm * found.lagrange_mm;
    assert!((total.s4 / (-2.0 * h2 / 800.0) - 1.0).abs() < 1e-12, "{total:?}");
}

/// Returns the lens behind a plane mirror that its light meets head-on: what follows is the mirror image of the lens.
fn behind_plane_mirror(lens: &Lens, gap_mm: f64) -> Lens {
    let mut interfaces = vec![row(f64::INFINITY, 0.0, 40.0 + 4.0 * lens.front_semi_aperture_mm(), -gap_mm)];
    let negated = |list: &[f64]| list.iter().map(|a| -a).collect();
    interfaces.extend(lens.interfaces().iter().map(|interface| {
        let surface = &interface.surface;
        let shape = match surface.shape.clone() {
            Shape::EvenAsphere { conic, coefficients } => {
                Shape::EvenAsphere { conic, coefficients: negated(&coefficients) }
            }
            Shape::OddAsphere { conic, coefficients } => {
                Shape::OddAsphere { conic, coefficients: negated(&coefficients) }
            }
            Shape::Biconic { conic, curvature_x_per_mm, conic_x } => {
                Shape::Biconic { conic, curvature_x_per_mm: -curvature_x_per_mm, conic_x }
            }
            Shape::Toroid { curvature_x_per_mm, conic, coefficients } => {
                Shape::Toroid { curvature_x_per_mm: -curvature_x_per_mm, conic, coefficients: negated(&coefficients) }
            }
            other => other,
        };
        let surface =
            Surface { curvature_per_mm: -surface.curvature_per_mm, shape, semi_aperture_mm: surface.semi_aperture_mm };
        Interface { surface, thickness_after_mm: -interface.thickness_after_mm, ..interface.clone() }
    }));
    Lens::new("mirrored", "test", interfaces, lens.stop() + 1).unwrap().with_mirrors([0]).unwrap()
}

fn lenses_of_every_shape() -> Vec<Lens> {
    let mut lenses: Vec<Lens> =
        ["dgauss-50mm", "asphere-15mm", "paper-2el"].map(|name| Lens::built_in(name).unwrap()).into();
    let shapes = [
        Shape::Conic { conic: -0.7 },
        Shape::OddAsphere { conic: 0.2, coefficients: vec![0.0, 1e-3, 2e-5, -1e-6] },
        Shape::Biconic { conic: -0.8, curvature_x_per_mm: -0.01, conic_x: 1.5 },
        Shape::Toroid { curvature_x_per_mm: 0.02, conic: 0.4, coefficients: vec![1e-3, 2e-6] },
        Shape::ThinLens { power_per_mm: 0.02 },
    ];
    for shape in shapes {
        let curvature_per_mm = if matches!(shape, Shape::ThinLens { .. }) { 0.0 } else { 0.03 };
        let surface = Surface { shape, curvature_per_mm, semi_aperture_mm: 6.0 };
        let medium_after = Glass::Constant { index: 1.6 };
        let front = Interface { surface, medium_after, thickness_after_mm: 4.0 };
        let back = row(-60.0, 0.0, 6.0, 0.0);
        lenses.push(Lens::new("shape", "test", vec![front, back], 0).unwrap());
    }
    lenses
}

#[test]
fn lens_behind_a_plane_mirror_is_the_lens() {
    let gap_mm = 30.0;
    for lens in lenses_of_every_shape() {
        let folded = behind_plane_mirror(&lens, gap_mm);
        let (straight, folded) = (lens.at(550.0).unwrap(), folded.at(550.0).unwrap());
        let (a, b) = (straight.first_order(), folded.first_order());
        for (a, b) in [(a.efl_mm, b.efl_mm), (a.bfl_mm, b.bfl_mm), (a.f_number, b.f_number)] {
            assert!((a / b - 1.0).abs() < 1e-12, "{}: {a} {b}", lens.name());
        }
        assert!((a.entrance_pupil_z_mm + gap_mm - b.entrance_pupil_z_mm).abs() < 1e-10);
        let film_mm = a.bfl_mm.abs();
        let source = DVec3::new(8.0, -30.0, -900.0);
        let targets = disc(0.9 * lens.front_semi_aperture_mm(), 60);
        // The straight lens stands where the mirror image of the other is, `gap_mm` behind the mirror.
        let rays = |shift_mm: f64| {
            let point = ObjectPoint::Finite(source + DVec3::Z * shift_mm);
            rays_towards(&point, &targets, shift_mm, shift_mm - 50.0)
        };
        let (mut straight_rays, mut here) = (rays(0.0), rays(gap_mm));
        straight.trace_to_film(&mut straight_rays, Vignetting::On, film_mm);
        folded.trace_to_film(&mut here, Vignetting::On, film_mm);
        assert!(straight_rays.n_in_flight() > 10, "{}", lens.name());
        for i in 0..here.len() {
            assert_eq!(here.fate[i].is_in_flight(), straight_rays.fate[i].is_in_flight());
            if !here.fate[i].is_in_flight() {
                continue;
            }
            let apart_mm = (here.point_mm(i) - straight_rays.point_mm(i)).truncate().length();
            assert!(apart_mm < 1e-10, "{}: ray {i}: {apart_mm:e}", lens.name());
            assert!((here.n[i] + straight_rays.n[i]).abs() < 1e-13 && here.n[i] < 0.0);
        }
        assert!((here.z_mm[0] - folded.film_placement(film_mm).vertex_mm.z).abs() < 1e-10);
    }
}

/// The double Gauss with a mirror of 45° that folds its light down before the film.
fn folded(before_film_mm: f64) -> (Lens, f64) {
    let lens = Lens::built_in("dgauss-50mm").unwrap();
    let mut interfaces = lens.interfaces().to_vec();
    let n = interfaces.len();
    interfaces[n - 1].thickness_after_mm = before_film_mm;
    interfaces.push(row(f64::INFINITY, 0.0, 60.0, 0.0));
    let turn = |surfaces: (usize, usize)| CoordinateBreak {
        surfaces,
        pivot_mm: 0.0,
        decenter_mm: [0.0; 3],
        tilt_deg: [45.0, 0.0, 0.0],
        tilt_first: false,
    };
    let folded = Lens::new("folded", "test", interfaces, lens.stop()).unwrap().with_mirrors([n]).unwrap();
    (folded.with_moves(vec![turn((n, n + 1)), turn((n + 1, n + 1))]).unwrap(), before_film_mm)
}

#[test]
fn bent_axes_of_another_length_than_the_distances_between_vertices_are_noted() {
    let (folded, _) = folded(20.0);
    assert_eq!(folded.at(550.0).unwrap().note_on_bent_axis(), None);
    // The mirror stands farther away than its distance says.
    let mut moves = folded.moves().to_vec();
    moves[0].decenter_mm = [0.0, 0.0, 10.0];
    let moved = folded.with_moves(moves).unwrap().at(550.0).unwrap();
    let note = moved.note_on_bent_axis().unwrap();
    assert!(note.contains("distances between vertices"), "{note}");
}

#[test]
fn fold_mirror_gives_the_unfolded_image() {
    let (folded, before_mm) = folded(20.0);
    let straight = Lens::built_in("dgauss-50mm").unwrap().at(550.0).unwrap();
    let folded = folded.at(550.0).unwrap();
    let film_mm = 37.0;
    for tan in [DVec2::ZERO, DVec2::new(0.1, -0.2)] {
        let point = ObjectPoint::from_field(&straight, tan, 0.5);
        let mut a = straight.rays_towards(&point, &disc(8.0, 150), 15.0, 0.0);
        let mut b = a.clone();
        straight.trace_to_film(&mut a, Vignetting::On, film_mm);
        folded.trace_to_film(&mut b, Vignetting::On, film_mm - before_mm);
        assert!(a.n_in_flight() > 50);
        let on = |lens: &MonoLens, rays: &RayBatch, mm: f64| lens.landed(rays, mm).collect::<Vec<_>>();
        let (at, there) = (on(&straight, &a, film_mm), on(&folded, &b, film_mm - before_mm));
        assert_eq!(at.len(), there.len());
        for (a, b) in at.iter().zip(&there) {
            assert!((a.mm - b.mm).length() < 1e-12, "{a:?} {b:?}");
        }
        for i in (0..a.len()).filter(|&i| a.fate[i].is_in_flight()) {
            assert!((a.opl_mm[i] - b.opl_mm[i]).abs() < 1e-12);
        }
    }
    // The light runs down: the film lies below the mirror, and its normal, along the light, points there.
    let site = folded.film_site(DVec2::ZERO, film_mm - before_mm).unwrap();
    assert!((site.normal.abs() - DVec3::Y).length() < 1e-12, "{site:?}");
    let mirror_mm = folded.surface_placement(folded.n_surfaces() - 1).vertex_mm;
    assert!(((site.point_mm - mirror_mm) - site.normal * (film_mm - before_mm)).length() < 1e-12, "{site:?}");
}

#[test]
fn light_finds_its_way_back_through_mirrors() {
    let (fold, _) = folded(20.0);
    let obscured = with_hole(&TELESCOPE.ritchey_chretien(), 60.0);
    for (lens, film_mm, tan, radius_mm) in [
        (TELESCOPE.cassegrain(), 1000.0, 0.002, 150.0),
        (schmidt(60.0), 400.0, 0.02, 55.0),
        (fold, 17.0, 0.1, 8.0),
        (obscured, 1000.0, 0.001, 150.0),
    ] {
        let lens = lens.at(550.0).unwrap();
        let point = ObjectPoint::from_field(&lens, DVec2::new(tan, 0.5 * tan), 0.0);
        let start = lens.rays_towards(&point, &disc(radius_mm, 100), lens.first_order().entrance_pupil_z_mm, 0.0);
        let mut rays = start.clone();
        lens.trace_to_film(&mut rays, Vignetting::On, film_mm);
        let passed: Vec<usize> = (0..rays.len()).filter(|&i| rays.fate[i].is_in_flight()).collect();
        assert!(passed.len() > 60, "{}", passed.len());
        let mut back = RayBatch::with_capacity(passed.len());
        for &i in &passed {
            back.push(rays.point_mm(i), -rays.direction(i), 0.0);
        }
        let reversed = lens.reversed();
        let mut in_two = back.clone();
        reversed.trace(&mut back, Vignetting::On);
        reversed.trace_to_stop(&mut in_two, Vignetting::On);
        reversed.trace_from_stop(&mut in_two, Vignetting::On);
        for (ray, &i) in passed.iter().enumerate() {
            assert!(back.fate[ray].is_in_flight(), "{:?}", back.fate[ray]);
            let line = (back.point_mm(ray) - start.point_mm(i)).cross(start.direction(i)).length();
            assert!(line < 1e-9, "ray {i} comes back {line:e} mm beside where it came from");
            assert!((back.direction(ray) + start.direction(i)).length() < 1e-12);
            assert!((in_two.direction(ray) - back.direction(ray)).length() < 1e-12);
        }
    }
}

/// Adds a hole in the primary mirror, which also stands for the shadow of the secondary.
fn with_hole(lens: &Lens, radius_mm: f64) -> Lens {
    let hole =
        Aperture { surface: 0, outline: Outline::Circle { radius_mm }, center_mm: [0.0; 2], is_obscuration: true };
    let interfaces = lens.interfaces().to_vec();
    let lens = Lens::new_with_apertures(lens.name(), lens.source(), interfaces, lens.stop(), vec![hole]).unwrap();
    lens.with_mirrors([0, 1]).unwrap()
}

#[test]
fn hole_takes_its_share_of_the_pupil() {
    let whole = TELESCOPE.cassegrain().at(550.0).unwrap();
    let ring = with_hole(&TELESCOPE.cassegrain(), 60.0).at(550.0).unwrap();
    let axis = ObjectPoint::Infinite(DVec3::Z);
    let [all, clear] = [&whole, &ring].map(|lens| projected_solid_angle(lens, &axis, 64));
    // The cosines behind Cassegrain's telescope are not quite in proportion to the heights before: the square of f/10.
    assert!((clear / all / (1.0 - (60.0_f64 / 160.0).powi(2)) - 1.0).abs() < 2e-3, "{clear} {all}");
    let cone = PI * (160.0_f64 / 3200.0).powi(2);
    assert!((all / cone - 1.0).abs() < 2e-3, "{all} {cone}");
    let mut rays = rays_towards(&axis, &disc(160.0, 4000), 0.0, 0.0);
    ring.trace(&mut rays, Vignetting::On);
    let share = rays.n_in_flight() as f64 / 4000.0;
    assert!((share - (1.0 - (60.0_f64 / 160.0).powi(2))).abs() < 1e-3, "{share}");
    let pupil = PupilBoundary::find(&ring, &axis, 64).unwrap();
    assert!((pupil.area_mm2() / (PI * 160.0 * 160.0) - 1.0).abs() < 1e-9);
}

#[test]
fn secondary_mirror_shades_the_primary() {
    let plain = TELESCOPE.cassegrain();
    assert_eq!(plain.mirror_shadows(), [MirrorShadow { mirror: 1, before: 0 }]);
    let shaded = plain.with_mirror_shadows().unwrap();
    assert_eq!((shaded.stop(), shaded.mirrors(), shaded.apertures().len()), (1, &[1, 2][..], 1));
    let shadow_mm = plain.interfaces()[1].surface.semi_aperture_mm;
    let [plain, shaded] = [plain, shaded].map(|lens| lens.at(550.0).unwrap());
    let (a, b) = (plain.first_order(), shaded.first_order());
    assert!((a.efl_mm / b.efl_mm - 1.0).abs() < 1e-14 && (a.bfl_mm / b.bfl_mm - 1.0).abs() < 1e-14);
    for tan in [0.0, 0.01] {
        // The shadow on the primary is that of a disc in its own plane: it moves with the field.
        let separation_mm = TELESCOPE.separation_mm();
        let direction = DVec3::new(0.0, tan, 1.0).normalize();
        for place in disc(150.0, 400) {
            let through = |lens: &MonoLens, z_mm: f64| {
                let mut ray =
                    RayBatch::from_points(&[(place - DVec2::Y * tan * 900.0).extend(z_mm - 900.0)], &[direction]);
                lens.trace_surfaces(0..1 + usize::from(z_mm > 0.0), &mut ray, Vignetting::On);
                ray.fate[0].is_in_flight()
            };
            let is_shaded = (place - DVec2::Y * tan * separation_mm).length() <= shadow_mm;
            assert!(through(&plain, 0.0) && through(&shaded, separation_mm) != is_shaded, "{tan} {place}");
        }
    }
    // A Mangin mirror shades nothing.
    assert!(single(-400.0, 0.0, 10.0).mirror_shadows().is_empty() && schmidt(50.0).mirror_shadows().is_empty());
}

#[test]
fn best_focus_of_a_mirror_is_downstream() {
    for lens in [single(-400.0, -1.0, 40.0), TELESCOPE.ritchey_chretien()] {
        let lens = lens.at(550.0).unwrap();
        let expected_mm = lens.film_distance_mm_for(f64::INFINITY).unwrap();
        let axis = [ObjectPoint::Infinite(DVec3::Z)];
        let lenses = std::slice::from_ref(&lens);
        let focus = Autofocus::alike(lenses, &axis, PupilRule::of_rings(8));
        let (film_mm, rms_mm) = focus.best_film_mm(expected_mm + 0.5).unwrap();
        assert!((film_mm - expected_mm).abs() < 1e-2 && rms_mm < 1e-4, "{film_mm} {rms_mm}");
    }
}

#[test]
fn schmidt_camera_is_sharp_on_its_curved_film() {
    // Its focal surface is concentric with the mirror: the center lies 400 mm downstream, at the plate.
    let camera = |curvature_per_mm: f64| {
        let film = ImageSurface { curvature_per_mm, conic: 0.0 };
        schmidt(60.0).with_image_surface(film).unwrap().at(550.0).unwrap()
    };
    let rms_mm = |lens: &MonoLens, tan: f64| {
        let point = ObjectPoint::from_field(lens, DVec2::new(0.6, 0.8) * tan, 0.0);
        let mut rays = lens.rays_towards(&point, &disc(55.0, 300), 0.0, 0.0);
        lens.trace_to_film(&mut rays, Vignetting::On, 400.0);
        let places: Vec<DVec2> = lens.landed(&rays, 400.0).map(|place| place.mm).collect();
        assert_eq!(places.len(), 300);
        let mean = places.iter().sum::<DVec2>() / 300.0;
        (places.iter().map(|place| (*place - mean).length_squared()).sum::<f64>() / 300.0).sqrt()
    };
    let (curved, flat, wrong) = (camera(1.0 / 400.0), camera(0.0), camera(-1.0 / 400.0));
    let axis_mm = rms_mm(&curved, 0.0);
    // At 3° a flat film is defocused by h²/2R = .55 mm, one that is curved the other way by twice as much.
    let [curved_mm, flat_mm, wrong_mm] = [&curved, &flat, &wrong].map(|lens| rms_mm(lens, 0.0524));
    assert!(curved_mm < 2.0 * axis_mm && flat_mm > 10.0 * curved_mm, "{axis_mm} {curved_mm} {flat_mm}");
    assert!((wrong_mm / flat_mm - 2.0).abs() < 0.1, "{flat_mm} {wrong_mm}");
}

#[test]
fn exit_pupil_bounds_hold_all_light_of_mirrors() {
    for (lens, film_mm, tan, half_mm) in [
        (TELESCOPE.ritchey_chretien(), 1000.0, 0.004, 14.0),
        (single(-400.0, -1.0, 40.0), 200.0, 0.02, 5.0),
        (folded(20.0).0, 17.0, 0.1, 8.0),
    ] {
        let lens = lens.at(550.0).unwrap();
        let reversed = [lens.reversed()];
        let bounds = ExitPupilBounds::find(&reversed, film_mm, DVec2::splat(half_mm), PupilReach::WholeLens).unwrap();
        let mut n_found = 0;
        for share in [0.0, 0.4, 1.0] {
            let point = ObjectPoint::from_field(&lens, DVec2::new(0.3, 0.8) * (share * tan), 0.0);
            let radius_mm = 0.5 * lens.first_order().entrance_pupil_diameter_mm;
            let z_mm = lens.first_order().entrance_pupil_z_mm;
            let mut rays = lens.rays_towards(&point, &disc(radius_mm, 200), z_mm, 0.0);
            lens.trace_to_film(&mut rays, Vignetting::On, film_mm);
            let plane = bounds.plane();
            for i in (0..200).filter(|&i| rays.fate[i].is_in_flight()) {
                let (own, along) =
                    (plane.surface_from_lens(rays.point_mm(i)), plane.direction_to_own(rays.direction(i)));
                let crossing = plane.lens_from_surface(own - along * (own.z / along.z));
                assert!(own.z > 0.0 && along.z > 0.0, "the plane looks along the light");
                let place = lens.film_point(rays.point_mm(i), film_mm).mm;
                assert!(bounds.contains(place, crossing), "{share} {place} {crossing}");
                n_found += 1;
            }
        }
        assert!(n_found > 200, "{n_found}");
    }
}

#[test]
fn bend_of_code_v_follows_the_axis() {
    let read = |tilts: &str| {
        let start = "RDM\nEPD 10\nDIM M\nWL 550\nYAN 0\nSO 0 1E11\nS 0 30\n STO\nS 0 -50 REFL\n";
        let text = format!("{start} {tilts}; BEN\nSI 0 0\nGO\n");
        LensFile::from_bytes("fold.seq".as_ref(), text.as_bytes(), &ReadOptions::default())
    };
    for tilt in ["ADE 30", "BDE -45"] {
        let file = read(tilt).unwrap();
        let (lens, film_mm) = (file.lens.at(550.0).unwrap(), file.film_distance_mm.unwrap());
        assert_eq!(film_mm, 50.0);
        for place in [DVec2::ZERO, DVec2::new(2.0, -3.0)] {
            let mut ray = RayBatch::from_points(&[place.extend(-5.0)], &[DVec3::Z]);
            lens.trace_to_film(&mut ray, Vignetting::On, film_mm);
            // The film stands across the folded axis, and light along the axis lands where it came in.
            let film = lens.film_placement(film_mm);
            assert!((film.direction_to_own(ray.direction(0)) - DVec3::Z).length() < 1e-14);
            let landed = lens.film_point(ray.point_mm(0), film_mm).mm;
            assert!((landed - place).length() < 1e-13, "{tilt}: {landed}");
        }
    }
    let message = read("ADE 30; BDE 10").unwrap_err().to_string();
    assert!(
        message.contains("BEN: a mirror that bends the axis is supported where it has one tilt alone"),
        "{message}"
    );
}

#[test]
fn mirrors_that_cannot_be_are_refused() {
    let lens = Lens::built_in("dgauss-50mm").unwrap();
    let message = |mirror: usize| lens.clone().with_mirrors([mirror]).unwrap_err().to_string();
    assert!(message(99).starts_with("surface 99 cannot be a mirror: the lens has the surfaces 0 to "));
    assert!(message(0).contains("the medium behind it is") && message(0).contains("expected that before it, air"));
    let thin = Lens::thin(50.0, 10.0).unwrap().with_mirrors([0]).unwrap_err().to_string();
    assert_eq!(thin, "surface 0 cannot be a mirror: it is an ideal thin lens");
}

#[test]
fn mirrors_survive_our_own_and_zemax_files() {
    let (fold, _) = folded(20.0);
    let image = ImageSurface { curvature_per_mm: 1.0 / 300.0, conic: 0.0 };
    let curved = schmidt(60.0).with_image_surface(image).unwrap();
    for (lens, film_mm) in [(TELESCOPE.ritchey_chretien(), 1000.0), (curved, 401.0), (fold, 17.0)] {
        let file = LensFile { film_distance_mm: Some(film_mm), ..LensFile::from(lens.clone()) };
        let again = |name: &str, text: &str| {
            LensFile::from_bytes(name.as_ref(), text.as_bytes(), &ReadOptions::default()).unwrap()
        };
        assert_eq!(again("lens.ron", &file.to_ron()), file);
        let zmx = again("lens.zmx", &file.to_zmx().unwrap());
        assert_eq!((zmx.lens.mirrors(), zmx.lens.stop()), (lens.mirrors(), lens.stop()));
        assert!((zmx.film_distance_mm.unwrap() - film_mm).abs() < 1e-12);
        assert_eq!(zmx.lens.image_surface(), lens.image_surface());
        let [a, b] = [&lens, &zmx.lens].map(|lens| lens.at(550.0).unwrap());
        let point = ObjectPoint::from_field(&a, DVec2::new(0.002, 0.001), 0.0);
        let targets = disc(5.0, 20);
        let [a, b] = [&a, &b].map(|lens| {
            let mut rays = lens.rays_towards(&point, &targets, 0.0, 0.0);
            lens.trace_to_film(&mut rays, Vignetting::On, film_mm);
            rays
        });
        for i in 0..20 {
            assert!((a.point_mm(i) - b.point_mm(i)).length() < 1e-9, "{}", lens.name());
        }
    }
}

#[test]
fn mirrors_are_drawn_with_rays_to_the_film() {
    let (fold, _) = folded(20.0);
    let obscured = with_hole(&TELESCOPE.cassegrain(), 40.0);
    for (lens, film_mm, n_mirrors) in [(obscured, 1000.0, 2), (schmidt(60.0), 400.0, 1), (fold, 17.0, 1)] {
        let layout = Layout {
            film_distance_mm: film_mm,
            object_distance_mm: f64::INFINITY,
            film_label: "film".to_owned(),
            fields_deg: vec![0.0, 0.1],
            wavelengths_nm: vec![550.0],
            n_rays: 7,
            width_px: 900.0,
        };
        let svg = lens.draw(&layout).unwrap();
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{}", lens.name());
        assert!(svg.matches("stroke=\"#4d5a66\"").count() >= n_mirrors && svg.contains("film"));
        assert!(svg.contains("stroke-opacity=\"0.85\""), "{}: rays reach the film", lens.name());
    }
}

/// Returns the lens with media of these indices in place of those that are not air.
fn with_indices(lens: &Lens, indices: &[f64]) -> Lens {
    let mut glasses = indices.iter().filter(|index| **index != 1.0);
    let mut interfaces = lens.interfaces().to_vec();
    for interface in interfaces.iter_mut().filter(|interface| interface.medium_after != Glass::Air) {
        interface.medium_after = Glass::Constant { index: *glasses.next().unwrap() };
    }
    assert_eq!(glasses.next(), None);
    let (name, source, apertures) = (lens.name(), lens.source(), lens.apertures().to_vec());
    let plain = Lens::new_with_apertures(name, source, interfaces, lens.stop(), apertures).unwrap();
    plain.with_mirrors(lens.mirrors().to_vec()).unwrap().with_moves(lens.moves().to_vec()).unwrap()
}

/// Files of other programs against ray-optics (`scripts/mirror_reference.py`).
#[dioptric_golden::needs_shared]
#[test]
fn files_with_mirrors_agree_with_ray_optics() {
    let mut now: Option<(MonoLens, f64, f64)> = None;
    let (mut n_files, mut n_rays) = (0, 0);
    for line in include_str!("mirror_reference.csv").lines().filter(|line| !line.starts_with('#')) {
        let cells: Vec<&str> = line.split(',').collect();
        let number = |i: usize| cells[i].parse::<f64>().unwrap();
        if cells[0] == "file" {
            let file = dioptric_golden::shared(&format!("data/lenses/more/{}", cells[1])).unwrap();
            let file = LensFile::read(&file, &ReadOptions::default()).unwrap();
            let indices: Vec<f64> = cells[5].split(':').map(|index| index.parse().unwrap()).collect();
            let lens = with_indices(&file.lens, &indices).at(number(2)).unwrap();
            let film_mm = file.film_distance_mm.unwrap();
            let along_light = if lens.is_film_backward() { -1.0 } else { 1.0 };
            let first = lens.first_order();
            if number(3) != 0.0 {
                assert!((first.efl_mm * along_light / number(3) - 1.0).abs() < 1e-9, "{line}: {}", first.efl_mm);
                let defocus_mm = (first.bfl_mm - film_mm) * along_light;
                assert!((defocus_mm - number(4)).abs() < 1e-9 * first.efl_mm, "{line}: {defocus_mm}");
            }
            // A plane before the first surface, at which nothing happens, is left out.
            let left_out_mm = if cells[1] == "one_mirror_up_45deg.zmx" { 10.0 } else { 0.0 };
            now = Some((lens, film_mm, left_out_mm));
            n_files += 1;
            continue;
        }
        let (lens, film_mm, left_out_mm) = now.as_ref().unwrap();
        let (start_mm, tan) = (DVec3::new(number(2), number(3), -10.0 - left_out_mm), number(4));
        let mut ray = RayBatch::from_points(&[start_mm], &[DVec3::new(0.0, tan, 1.0).normalize()]);
        lens.trace_to_film(&mut ray, Vignetting::Off, *film_mm);
        let place_mm = lens.film_point(ray.point_mm(0), *film_mm).mm;
        let direction = lens.film_placement(*film_mm).direction_to_own(ray.direction(0));
        let expected = DVec3::new(number(7), number(8), number(9).abs());
        assert!((place_mm - DVec2::new(number(5), number(6))).length() < 1e-9, "{line}: {place_mm}");
        assert!((direction - expected).length() < 1e-11, "{line}: {direction}");
        n_rays += 1;
    }
    assert_eq!((n_files, n_rays), (6, 48));
}
