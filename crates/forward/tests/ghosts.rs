//! Ghosts drawn on a film, against the table of ghosts and closed forms.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use dioptric_forward::{Film, GhostFilm, GhostSources};
use dioptric_optics::{
    Coating, GhostRequest, Glass, Interface, Lens, MirrorFilm, MonoLens, ObjectPoint, Surface,
    glam::{DVec2, DVec3},
};
use dioptric_spectrum::Cancel;
use ndarray::Array2;

const NM: f64 = 550.0;

/// Surfaces by radius, index behind and thickness, mm, bare, behind a stop of this radius.
fn behind_a_stop(rows: &[[f64; 3]], stop_radius_mm: f64) -> MonoLens {
    let interface = |&[radius_mm, index, thickness_after_mm]: &[f64; 3], semi_aperture_mm: f64| Interface {
        surface: Surface { curvature_per_mm: 1.0 / radius_mm, ..Surface::plane(semi_aperture_mm) },
        medium_after: if index == 1.0 { Glass::Air } else { Glass::Constant { index } },
        thickness_after_mm,
    };
    let stop = interface(&[f64::INFINITY, 1.0, 0.1], stop_radius_mm);
    let interfaces = std::iter::once(stop).chain(rows.iter().map(|row| interface(row, 10.0))).collect();
    let lens = Lens::new("behind a stop", "a test", interfaces, 0).unwrap();
    lens.with_light_loss(Some(Coating::Bare)).unwrap().at(NM).unwrap()
}

fn double_gauss() -> MonoLens {
    let lens = Lens::built_in("dgauss-50mm").unwrap().with_light_loss(Some(Coating::Bare)).unwrap();
    lens.at(NM).unwrap()
}

fn drawn(sources: &GhostSources, lens: &MonoLens, film_distance_mm: f64, film: Film) -> Array2<f32> {
    drawn_on(sources, lens, MirrorFilm::dark(film_distance_mm), film)
}

fn drawn_on(sources: &GhostSources, lens: &MonoLens, mirror: MirrorFilm, film: Film) -> Array2<f32> {
    sources.irradiance(0, &GhostFilm { lens, mirror, film }, &Cancel::new()).unwrap()
}

/// Light in all over the light of a point of irradiance or intensity 1, in mm² or sr, and the middle of it on the film, mm.
fn light_and_middle(picture: &Array2<f32>, film: Film) -> (f64, DVec2) {
    let pitch_mm = 1e-3 * film.pitch_um;
    let mut sum = (0.0, DVec2::ZERO);
    for ((row, column), &value) in picture.indexed_iter() {
        let right_mm = (column as f64 + 0.5 - 0.5 * film.columns as f64) * pitch_mm;
        let up_mm = (0.5 * film.rows as f64 - row as f64 - 0.5) * pitch_mm;
        let light = f64::from(value) * pitch_mm * pitch_mm;
        // The picture is the film turned.
        sum = (sum.0 + light, sum.1 - light * DVec2::new(right_mm, up_mm));
    }
    (sum.0, sum.1 / sum.0)
}

/// All light of all pairs is that of the table, of stars and lamps, off the axis in any direction.
#[test]
fn light_of_all_pairs_is_that_of_the_table() {
    let lens = double_gauss();
    let (film_distance_mm, n_rays) = (37.3768, 20_000);
    let (radius_mm, rim_z_mm) = (lens.semi_aperture_mm(0), lens.front_rim_z_mm());
    let all_of_it = Film::centered(600, 700, 200.0);
    let small = Film::centered(240, 360, 100.0);
    for (field_tan, depth_m, film, film_reflectance) in [
        (DVec2::ZERO, f64::INFINITY, all_of_it, 0.0),
        (DVec2::new(0.12, -0.1), f64::INFINITY, all_of_it, 0.0),
        (DVec2::new(-0.05, 0.2), 0.7, all_of_it, 0.0),
        (DVec2::new(0.0, 0.2), f64::INFINITY, all_of_it, 0.0),
        (DVec2::new(0.12, -0.1), f64::INFINITY, small, 0.3),
        (DVec2::new(-0.05, 0.2), 0.7, small, 0.3),
    ] {
        let per_cos = (1.0 + field_tan.length_squared()).sqrt();
        let (point, all) = if depth_m.is_finite() {
            let place = DVec3::Z * lens.projection_center_z_mm() + 1e3 * depth_m * field_tan.extend(-1.0);
            // Over the disc of the rim, in the mean of four directions at a half of its square: exact to the fourth order.
            let at = |place_mm: DVec2| {
                let way = place_mm.extend(rim_z_mm) - place;
                way.z.abs() / way.length().powi(3)
            };
            let ring_mm = radius_mm / 2.0_f64.sqrt();
            let mean = 0.25 * [DVec2::X, DVec2::Y, -DVec2::X, -DVec2::Y].map(|to| at(ring_mm * to)).iter().sum::<f64>();
            (ObjectPoint::Finite(place), 1e6 * mean)
        } else {
            let direction = DVec3::new(-field_tan.x, -field_tan.y, 1.0) / per_cos;
            (ObjectPoint::Infinite(direction), per_cos.recip())
        };
        let film_half_mm = Some(film.half_size_mm());
        let request =
            GhostRequest { point, film_distance_mm, n_rays, rim_z_mm, film_half_mm, film_reflectance, most_bounces: 2 };
        let table = lens.ghosts(&request).unwrap();
        let expected: f64 = table.pairs.iter().map(|ghost| ghost.light.power_on_film).sum();
        let source = GhostSources::of_point(field_tan, depth_m, 1, n_rays);
        let (light, _) =
            light_and_middle(&drawn_on(&source, &lens, film.as_mirror(film_distance_mm, film_reflectance), film), film);
        let share = light / (all * std::f64::consts::PI * radius_mm * radius_mm);
        // Squares of the grid that the circle cuts, and beams that the film's edges cut.
        assert!((share / expected - 1.0).abs() < 3e-3, "{field_tan} {depth_m}: {share} {expected}");
    }
}

/// The ghost of a slanted plate lies where light goes that passes it twice more, as large as the stop.
#[test]
fn a_plates_ghost_lies_where_it_must() {
    let (index, thickness_mm, stop_mm, distance_mm) = (1.5, 4.0, 2.0, 20.0);
    let plate = behind_a_stop(&[[f64::INFINITY, index, thickness_mm], [f64::INFINITY, 1.0, 0.0]], stop_mm);
    let film = Film::centered(800, 800, 50.0);
    let field_tan = DVec2::new(0.25, -0.15);
    let sine = field_tan.length() / (1.0 + field_tan.length_squared()).sqrt();
    let inside_tan = (sine / index).asin().tan();
    let way_mm = (0.1 + distance_mm) * field_tan.length() + 3.0 * thickness_mm * inside_tan;
    let picture = drawn(&GhostSources::of_point(field_tan, f64::INFINITY, 1, 40_000), &plate, distance_mm, film);
    let (light, middle_mm) = light_and_middle(&picture, film);
    let expected_mm = -field_tan.normalize() * way_mm;
    assert!((middle_mm - expected_mm).length() < 2e-3, "{middle_mm} {expected_mm}");
    // Half as bright pixels are the rim of the stop.
    let most = picture.iter().fold(0.0_f32, |most, &value| most.max(value));
    let n_lit = picture.iter().filter(|value| **value > 0.5 * most).count() as f64;
    let radius_mm = (n_lit * 0.05 * 0.05 / std::f64::consts::PI).sqrt();
    assert!((radius_mm - stop_mm).abs() < 0.02, "{radius_mm}");
    assert!(light > 0.0);
}

/// The ghost of a singlet is a disc as wide as first-order optics has it, with the light of two reflections at normal incidence.
#[test]
fn a_singlets_ghost_is_as_wide_as_it_must_be() {
    let (index, r1, r2, t_mm, film_mm, stop_mm) = (1.6, 60.0, -45.0, 3.0, 5.0, 0.5);
    let singlet = behind_a_stop(&[[r1, index, t_mm], [r2, 1.0, 0.0]], stop_mm);
    let refract = |y: f64, u: f64, c: f64, n1: f64, n2: f64| (n1 * u - (n2 - n1) * c * y) / n2;
    let (mut y, mut u) = (1.0, refract(1.0, 0.0, 1.0 / r1, 1.0, index));
    y += t_mm * u;
    for c in [1.0 / r2, -1.0 / r1] {
        u += 2.0 * y * c;
        y += t_mm * u;
    }
    let height = (y + film_mm * refract(y, u, 1.0 / r2, index, 1.0)).abs();
    let film = Film::centered(400, 400, 4.0);
    let picture = drawn(&GhostSources::of_point(DVec2::ZERO, f64::INFINITY, 1, 40_000), &singlet, film_mm, film);
    let (light, middle_mm) = light_and_middle(&picture, film);
    let r = ((index - 1.0) / (index + 1.0)).powi(2);
    let expected = std::f64::consts::PI * stop_mm * stop_mm * (1.0 - r).powi(2) * r * r;
    // Squares that the rim cuts.
    assert!((light / expected - 1.0).abs() < 3e-3, "{light} {expected}");
    assert!(middle_mm.length() < 1e-4, "{middle_mm}");
    let most = f64::from(picture[(200, 200)]);
    let n_lit = picture.iter().filter(|value| f64::from(**value) > 0.5 * most).count() as f64;
    let radius_mm = (n_lit * 0.004 * 0.004 / std::f64::consts::PI).sqrt();
    // Third order: the square of the stop over the radii, 1e-4; half a pixel at the rim.
    assert!((radius_mm - stop_mm * height).abs() < 2e-3, "{radius_mm} {}", stop_mm * height);
    let even = expected / (std::f64::consts::PI * (stop_mm * height).powi(2));
    assert!((most / even - 1.0).abs() < 0.02, "{most} {even}");
}

#[test]
fn threads_change_no_bit() {
    let lens = double_gauss();
    let source = GhostSources::of_point(DVec2::new(0.1, 0.07), 2.0, 1, 12_000);
    let film = Film::centered(80, 120, 300.0);
    let on = |n: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| drawn(&source, &lens, 37.4, film))
    };
    let (one, four) = (on(1), on(4));
    assert!(one == four && one.iter().any(|value| *value > 0.0));
}

#[test]
fn lenses_whose_ghosts_are_not_followed_are_refused_in_words() {
    let lens = Lens::built_in("dgauss-50mm").unwrap().with_light_loss(Some(Coating::Bare)).unwrap();
    let curved = lens.clone().with_image_surface(dioptric_optics::ImageSurface { curvature_per_mm: -0.01, conic: 0.0 });
    let message = curved.unwrap().at(NM).unwrap().ghost_beams(&MirrorFilm::dark(37.0)).unwrap_err().to_string();
    assert!(message.contains("flat films alone"), "{message}");
    let lossless = lens.with_light_loss(None).unwrap().at(NM).unwrap();
    let source = GhostSources::of_point(DVec2::ZERO, 1.0, 1, 1000);
    assert!(drawn(&source, &lossless, 37.0, Film::centered(9, 9, 1000.0)).iter().all(|value| *value == 0.0));
}
