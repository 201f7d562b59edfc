//! Ghosts against closed forms and against another tracer.

use dioptric_golden::needs_shared;
use dioptric_optics::{
    Aperture, Coating, CoatingLayer, Film, Ghost, GhostRequest, Glass, Interface, Iris, Lens, MirrorFilm, ObjectPoint,
    Outline, Surface,
    glam::{DVec2, DVec3},
};
use num_complex::Complex64;

const NM: f64 = 550.0;

fn lens(rows: &[[f64; 3]], semi_aperture_mm: f64) -> Lens {
    let interface = |&[radius_mm, index, thickness_after_mm]: &[f64; 3]| Interface {
        surface: Surface { curvature_per_mm: 1.0 / radius_mm, ..Surface::plane(semi_aperture_mm) },
        medium_after: if index == 1.0 { Glass::Air } else { Glass::Constant { index } },
        thickness_after_mm,
    };
    let lens = Lens::new("of rows", "a test", rows.iter().map(interface).collect(), 0).unwrap();
    lens.with_light_loss(Some(Coating::Bare)).unwrap()
}

fn absorbing(index: f64, k: f64) -> Glass {
    let law = Box::new(Glass::Constant { index });
    Glass::Absorbing { law, wavelengths_nm: vec![400.0, 700.0], extinctions: vec![k; 2] }
}

fn request(field_rad: f64, film_distance_mm: f64, n_rays: usize) -> GhostRequest {
    let point = ObjectPoint::Infinite(DVec3::new(0.0, field_rad.sin(), field_rad.cos()));
    // As the tracers that it is compared with have it.
    GhostRequest {
        point,
        film_distance_mm,
        n_rays,
        rim_z_mm: 0.0,
        film_half_mm: None,
        film_reflectance: 0.0,
        most_bounces: 2,
    }
}

/// A stop of this radius right before a lens of wide rims.
fn behind_a_stop(rows: &[[f64; 3]], stop_radius_mm: f64) -> Lens {
    let mut all = vec![[f64::INFINITY, 1.0, 0.1]];
    all.extend(rows);
    let mut interfaces = lens(&all, 10.0).interfaces().to_vec();
    interfaces[0].surface.semi_aperture_mm = stop_radius_mm;
    Lens::new("behind a stop", "a test", interfaces, 0).unwrap().with_light_loss(Some(Coating::Bare)).unwrap()
}

#[test]
fn a_plate_sends_its_ghost_beside_the_light() {
    let (index, thickness_mm, field) = (1.5, 4.0, 0.3f64);
    let plate = behind_a_stop(&[[f64::INFINITY, index, thickness_mm], [f64::INFINITY, 1.0, 0.0]], 2.0);
    let found = plate.at(NM).unwrap().ghosts(&request(field, 20.0, 4000)).unwrap();
    let [ghost] = found.pairs.as_slice() else { panic!("{found:?}") };
    let inside = (field.sin() / index).asin();
    let shares = Film::new(1.0, &[], index.into(), NM).shares(field.cos());
    let back = Film::new(index, &[], 1.0.into(), NM).shares(inside.cos());
    let power =
        |n: i32| 0.5 * (shares.t_s * back.r_s.powi(2 * n) * back.t_s + shares.t_p * back.r_p.powi(2 * n) * back.t_p);
    assert_eq!((ghost.first, ghost.second, ghost.light.open), (2, 1, 1.0));
    assert!((found.direct.power / power(0) - 1.0).abs() < 1e-9, "{found:?}");
    assert!((ghost.light.power / power(1) - 1.0).abs() < 1e-9, "{ghost:?}");
    // It goes through the plate twice more.
    let beside_mm = ghost.light.centroid_mm.y - found.direct.centroid_mm.y;
    assert!((beside_mm / (2.0 * thickness_mm * inside.tan()) - 1.0).abs() < 1e-9, "{beside_mm}");
    assert!((ghost.light.rms_radius_mm / found.direct.rms_radius_mm - 1.0).abs() < 1e-9);
    // Four reflections and six are on, each two going through it twice more.
    let six = GhostRequest { most_bounces: 6, ..request(field, 20.0, 4000) };
    let found = plate.at(NM).unwrap().ghosts(&six).unwrap();
    assert_eq!(found.pairs.len(), 3);
    for (n, ghost) in (1..).zip(&found.pairs) {
        let beside_mm = ghost.light.centroid_mm.y - found.direct.centroid_mm.y;
        assert!((ghost.light.power / power(n) - 1.0).abs() < 1e-6, "{ghost:?}");
        assert!((beside_mm / (f64::from(2 * n) * thickness_mm * inside.tan()) - 1.0).abs() < 1e-9, "{beside_mm}");
    }
    assert_eq!(found.pairs[2].then, [2, 1, 2, 1]);
    // In single precision, which many rays are followed in, the same to 1e-5.
    let many = plate.at(NM).unwrap().ghosts(&request(field, 20.0, 40_000)).unwrap();
    assert!((many.pairs[0].light.power / power(1) - 1.0).abs() < 1e-5, "{many:?}");
    let beside_mm = many.pairs[0].light.centroid_mm.y - many.direct.centroid_mm.y;
    assert!((beside_mm / (2.0 * thickness_mm * inside.tan()) - 1.0).abs() < 1e-5, "{beside_mm}");
}

/// Size and energy of the ghost of a thin beam through a singlet, by hand: paraxial rays and normal incidence.
#[test]
fn a_singlets_ghost_is_where_first_order_optics_has_it() {
    let (index, r1, r2, t_mm, film_mm) = (1.6, 60.0, -45.0, 3.0, 5.0);
    let refract = |y: f64, u: f64, c: f64, n1: f64, n2: f64| (n1 * u - (n2 - n1) * c * y) / n2;
    // Heights on the film of a ray that comes at height 1 in parallel, reflected n times two; z counts along the light.
    let height = |n_pairs: usize| {
        let (mut y, mut u) = (1.0, refract(1.0, 0.0, 1.0 / r1, 1.0, index));
        y += t_mm * u;
        for _ in 0..n_pairs {
            u += 2.0 * y / r2;
            y += t_mm * u;
            u += 2.0 * y * (-1.0 / r1);
            y += t_mm * u;
        }
        y + film_mm * refract(y, u, 1.0 / r2, index, 1.0)
    };
    // The errors of third order are the square of the beam over the radii.
    let thin = behind_a_stop(&[[r1, index, t_mm], [r2, 1.0, 0.0]], 1e-3);
    let found = thin.at(NM).unwrap().ghosts(&request(0.0, film_mm, 4000)).unwrap();
    let [ghost] = found.pairs.as_slice() else { panic!("{found:?}") };
    let r = ((index - 1.0) / (index + 1.0)).powi(2);
    assert!((ghost.light.power / ((1.0 - r).powi(2) * r * r) - 1.0).abs() < 1e-6, "{ghost:?}");
    assert!((found.direct.power / (1.0 - r).powi(2) - 1.0).abs() < 1e-6);
    let ratio = ghost.light.rms_radius_mm / found.direct.rms_radius_mm;
    assert!((ratio / (height(1) / height(0)).abs() - 1.0).abs() < 1e-6, "{ratio} {}", height(1) / height(0));
    // Off the axis its middle lies where the paraxial chief ray has it.
    let aside = thin.at(NM).unwrap().ghosts(&request(1e-4, film_mm, 4000)).unwrap();
    let ratio = aside.pairs[0].light.centroid_mm.y / aside.direct.centroid_mm.y;
    assert!((ratio / aside.pairs[0].magnification - 1.0).abs() < 1e-6, "{ratio} {:?}", aside.pairs[0]);
}

#[test]
fn lenses_without_losses_have_no_ghosts_and_others_are_refused_in_words() {
    let lens = Lens::built_in("dgauss-50mm").unwrap();
    let found = lens.at(NM).unwrap().ghosts(&request(0.0, 37.0, 100)).unwrap();
    assert!(found.pairs.is_empty() && (found.direct.power - found.direct.open).abs() < 1e-12);
    assert_eq!(found.veil(), 0.0);
    let grating = dioptric_optics::DiffractiveSurface {
        surface: 0,
        order: 1,
        profile: dioptric_optics::PhaseProfile::Grating { lines_per_mm: [0.0, 100.0] },
        blaze: None,
    };
    let message =
        lens.with_diffractive(vec![grating]).unwrap().at(NM).unwrap().ghosts(&request(0.0, 37.0, 100)).unwrap_err();
    assert!(message.to_string().contains("without mirrors and gratings"), "{message}");
}

/// The double Gauss with a coating, and its ghosts over the grid of rays of the numpy tracers.
fn double_gauss(kind: &str, field_deg: f64) -> Vec<Ghost> {
    let coating = Coating::named(kind).unwrap();
    let lens = Lens::built_in("dgauss-50mm").unwrap().with_light_loss(Some(coating)).unwrap();
    let n_rays = (160.0f64 * 160.0 * std::f64::consts::PI / 4.0).floor() as usize;
    lens.at(NM).unwrap().ghosts(&request(field_deg.to_radians(), 37.3768, n_rays)).unwrap().pairs
}

#[test]
fn pairs_of_the_double_gauss_are_those_of_numpy() {
    let rows: Vec<Vec<&str>> =
        include_str!("ghosts.csv").lines().skip(3).map(|line| line.split(',').collect()).collect();
    for kind in ["bare", "mgf2"] {
        for field_deg in ["0", "5", "10"] {
            let found = double_gauss(kind, field_deg.parse().unwrap());
            let own: Vec<_> = rows.iter().filter(|row| row[..2] == [kind, field_deg]).collect();
            assert_eq!((own.len(), found.len()), (45, 45));
            for row in own {
                let number = |i: usize| row[i].parse::<f64>().unwrap();
                let pair = |ghost: &&Ghost| [ghost.first, ghost.second] == [2, 3].map(|i| number(i) as usize);
                let Ghost { light, .. } = found.iter().find(pair).unwrap();
                // Rays on the edge of a rim may fall on either side of it.
                assert!((light.power / number(4) - 1.0).abs() < 1e-3, "{row:?} {light:?}");
                assert!((light.open - number(5)).abs() < 1e-3, "{row:?} {light:?}");
                let away_mm = (light.centroid_mm - DVec2::new(0.0, number(6))).length();
                assert!(away_mm < 1e-2 && (light.rms_radius_mm / number(7) - 1.0).abs() < 1e-3, "{row:?} {light:?}");
            }
        }
    }
}

/// The same at three fields by the shared numpy tracer, which states 1 %. Of four pairs it leaves rays out: those that are totally
/// reflected within glass, and steep ones for which its Newton's method for spheres does not converge.
#[needs_shared("reference/ghosts")]
#[test]
fn pairs_of_the_double_gauss_are_those_of_another_tracer() {
    const LEFT_OUT: [(usize, usize); 4] = [(10, 6), (6, 4), (8, 4), (10, 4)];
    for kind in ["bare", "mgf2"] {
        for field_deg in [0.0f64, 5.0, 10.0] {
            let path =
                dioptric_golden::shared(&format!("reference/ghosts/dgauss-50mm_{kind}_{field_deg}.json")).unwrap();
            let json: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
            let found = double_gauss(kind, field_deg);
            let rows = json["pairs"].as_array().unwrap();
            assert_eq!(rows.len(), found.len(), "{kind} {field_deg}");
            for row in rows {
                let number = |key: &str| row[key].as_f64().unwrap();
                let both = ["first", "second"].map(|key| row[key].as_u64().unwrap() as usize);
                let Ghost { light, .. } = found.iter().find(|ghost| [ghost.first, ghost.second] == both).unwrap();
                let place = DVec2::new(number("x"), number("y"));
                let is_near = (light.power / number("power") - 1.0).abs() < 0.01
                    && (light.centroid_mm - place).length() < 0.1
                    && (light.rms_radius_mm / number("rms") - 1.0).abs() < 0.01;
                let is_left_out = LEFT_OUT.contains(&both.into()) && light.open > number("open");
                assert!(is_near || is_left_out, "{kind} {field_deg} {row} {light:?}");
            }
        }
    }
}

/// Blades, openings and obscurations cut ghosts as they cut the image.
#[test]
fn what_is_no_round_rim_cuts_ghosts_too() {
    // 64 straight blades are a circle of as much area to 0.02 %.
    let lens = Lens::built_in("dgauss-50mm").unwrap().with_light_loss(Some(Coating::Bare)).unwrap();
    let at_f4 = |iris| {
        let lens = lens.clone().with_iris(iris).unwrap().with_f_number(4.0, NM).unwrap();
        lens.at(NM).unwrap().ghosts(&request(0.05, 37.0, 30_000)).unwrap()
    };
    let (round, bladed) = (at_f4(None), at_f4(Some(Iris { blades: 64, rotation_deg: 0.0, curvature: 0.0 })));
    assert!((round.direct.power / bladed.direct.power - 1.0).abs() < 2e-3, "{:?} {:?}", round.direct, bladed.direct);
    assert_eq!(round.pairs.len(), bladed.pairs.len());
    for (a, b) in round.pairs.iter().zip(&bladed.pairs).take(8) {
        // Rays at the edge decide, of which a ghost through little of the pupil has few.
        assert!((a.light.power / b.light.power - 1.0).abs() < 1e-2, "{a:?} {b:?}");
    }
    // A plate of which a disc is covered: of light along the axis a quarter less, image and ghost alike.
    let plate = lens_of_plate();
    let covered =
        Aperture { surface: 0, outline: Outline::Circle { radius_mm: 5.0 }, center_mm: [0.0; 2], is_obscuration: true };
    let holed = Lens::new_with_apertures("holed", "a test", plate.interfaces().to_vec(), 0, vec![covered]).unwrap();
    let holed = holed.with_light_loss(Some(Coating::Bare)).unwrap();
    let [whole, holed] = [plate, holed].map(|lens| lens.at(NM).unwrap().ghosts(&request(0.0, 20.0, 30_000)).unwrap());
    let lights = [(whole.direct, holed.direct), (whole.pairs[0].light, holed.pairs[0].light)];
    for (whole, holed) in lights {
        assert!((holed.power / whole.power - 0.75).abs() < 1e-3, "{whole:?} {holed:?}");
    }
}

fn lens_of_plate() -> Lens {
    lens(&[[f64::INFINITY, 1.5, 3.0], [f64::INFINITY, 1.0, 0.0]], 10.0)
}

/// Where the light goes along the axis through a plate, before a film that reflects: sums of all reflections in closed form.
#[test]
fn the_account_of_a_plate_is_that_of_all_its_reflections() {
    let r = (0.5f64 / 2.5).powi(2);
    let (sent_on, sent_back) = ((1.0 - r) / (1.0 + r), 2.0 * r / (1.0 + r));
    let all = GhostRequest { most_bounces: 12, ..request(0.0, 20.0, 1000) };
    let plate = lens_of_plate();
    let found = plate.at(NM).unwrap().light_account(&all).unwrap();
    assert!((found.film - sent_on).abs() < 1e-9 && (found.reflected - sent_back).abs() < 1e-9, "{found:?}");
    assert!((found.shares().iter().sum::<f64>() - 1.0).abs() < 1e-12 && found.beyond < 1e-9, "{found:?}");
    // One whose glass absorbs: from behind the first surface on a share a is left of each way.
    let clear = 0.7f64;
    let k = -clear.ln() * NM * 1e-6 / (4.0 * std::f64::consts::PI * 3.0);
    let mut interfaces = plate.interfaces().to_vec();
    interfaces[0].medium_after = absorbing(1.5, k);
    let gray = Lens::new("gray", "a test", interfaces, 0).unwrap().with_light_loss(Some(Coating::Bare)).unwrap();
    let found = gray.at(NM).unwrap().light_account(&all).unwrap();
    let rest = 1.0 - r * r * clear * clear;
    let film = (1.0 - r).powi(2) * clear / rest;
    let reflected = r + (1.0 - r).powi(2) * r * clear * clear / rest;
    assert!((found.film - film).abs() < 1e-8 && (found.reflected - reflected).abs() < 1e-8, "{found:?} {film}");
    assert!((found.glass - (1.0 - film - reflected)).abs() < 1e-8 && found.coatings.abs() < 1e-9, "{found:?}");
    // A film that reflects: to and fro between it and the plate, of which it gets all that it does not send back.
    let film = 0.3;
    let mirror = GhostRequest { film_reflectance: film, ..all };
    let found = plate.at(NM).unwrap().ghosts(&mirror).unwrap();
    let there = sent_on / (1.0 - film * sent_back);
    let account = plate.at(NM).unwrap().light_account(&mirror).unwrap();
    assert!((account.film - (1.0 - film) * there).abs() < 1e-8, "{account:?} {there}");
    assert!((account.reflected - sent_back - sent_on * film * there).abs() < 1e-8, "{account:?}");
    // The brightest ghost is that of the film and the surface before it; the next one of the film and the first surface.
    let [a, b] = [&found.pairs[0], &found.pairs[1]];
    assert!((a.first, a.second, b.first, b.second) == (2, 1, 2, 0), "{a:?} {b:?}");
    assert!((a.light.power - (1.0 - r).powi(2) * film * r).abs() < 1e-9, "{a:?}");
    assert!((b.light.power - (1.0 - r).powi(4) * film * r).abs() < 1e-9, "{b:?}");
    // Of half the width of the light in one direction it sends back half as much, and counts half.
    let narrow = GhostRequest { film_half_mm: Some(DVec2::new(5.0, 20.0)), n_rays: 30_000, ..mirror };
    let [open, narrow] = [mirror, narrow].map(|request| plate.at(NM).unwrap().ghosts(&request).unwrap());
    let ratio = narrow.pairs.iter().find(|ghost| ghost.first == 2).unwrap().light.power / open.pairs[0].light.power;
    let expected = narrow.direct.power_on_film / narrow.direct.power;
    assert!((ratio / expected - 1.0).abs() < 1e-6, "{ratio} {expected}");
}

/// The light of a whole lens adds up, and dielectric coatings take none of it.
#[test]
fn the_account_of_a_lens_closes() {
    for kind in ["bare", "mgf2", "bbar"] {
        let lens = Lens::built_in("dgauss-50mm").unwrap().with_light_loss(Coating::named(kind)).unwrap();
        for field_deg in [0.0f64, 10.0] {
            let mono = lens.at(NM).unwrap();
            let film_half_mm = Some(DVec2::new(18.0, 12.0));
            let two = GhostRequest { film_half_mm, ..request(field_deg.to_radians(), 37.3768, 1500) };
            let [(pairs, of_two), (fours, of_four)] = [2, 4].map(|most_bounces| {
                let request = GhostRequest { most_bounces, ..two };
                (mono.ghosts(&request).unwrap(), mono.light_account(&request).unwrap())
            });
            for (found, account) in [(&pairs, of_two), (&fours, of_four)] {
                assert!((account.shares().iter().sum::<f64>() - 1.0).abs() < 1e-9, "{account:?}");
                assert!(account.coatings.abs() < 1e-8, "{account:?}");
                let on_film: f64 = found.pairs.iter().map(|ghost| ghost.light.power_on_film).sum();
                assert!((found.direct.power_on_film + on_film - account.film).abs() < 1e-9, "{account:?}");
            }
            // Two reflections more leave less beyond, but for light that is totally reflected again and again, and the pairs as they are.
            assert!(of_four.beyond < 0.6 * of_two.beyond, "{of_two:?} {of_four:?}");
            let is_pair = |ghost: &&Ghost| ghost.then.is_empty();
            assert!(fours.pairs.iter().filter(is_pair).eq(&pairs.pairs), "{kind} {field_deg}");
            // With all that counts nothing is left.
            if kind != "bare" {
                let all = mono.light_account(&GhostRequest { most_bounces: 12, ..two }).unwrap();
                assert!(all.beyond < 1e-7 && (all.shares().iter().sum::<f64>() - 1.0).abs() < 1e-9, "{all:?}");
            }
        }
    }
    // A layer that absorbs takes what neither goes on nor back.
    let layer = CoatingLayer { medium: absorbing(2.0, 0.5), thickness_nm: 30.0 };
    let dark = lens_of_plate().with_light_loss(Some(Coating::Layers(vec![layer]))).unwrap();
    let found = dark.at(NM).unwrap().light_account(&request(0.0, 20.0, 500)).unwrap();
    let film = Film::new(1.0, &[(Complex64::new(2.0, 0.5), 30.0)], 1.5.into(), NM);
    let [front, back] = [film.shares(1.0), film.reversed().shares(1.0)];
    let (taken, taken_back) = (1.0 - front.r_s - front.t_s, 1.0 - back.r_s - back.t_s);
    // By the first surface, by the second, back at the first, and at the second again.
    let expected = taken + front.t_s * taken_back * (1.0 + back.r_s + back.r_s.powi(2));
    assert!((found.coatings - expected).abs() < 1e-9, "{found:?} {expected}");
}

/// The glare of a plate under an even sky: integrals over the angle of rays that cross it once and three times, as far as its rims let them.
#[test]
fn veiling_glare_of_a_plate_is_that_of_fresnel() {
    let (index, thickness_mm, rim_mm, film_mm) = (1.5, 3.0, 10.0, 9.0);
    let plate = lens_of_plate().at(NM).unwrap();
    let found = plate.veiling_glare(DVec2::ZERO, &MirrorFilm::dark(film_mm), 200_000).unwrap().unwrap();
    let light = |n_reflections: i32| {
        let n = 20_000;
        let term = |i: usize| {
            let sine2 = (i as f64 + 0.5) / f64::from(n);
            let (angle, inside) = (sine2.sqrt().asin(), (sine2.sqrt() / index).asin());
            let reached_mm = film_mm * angle.tan() + f64::from(1 + n_reflections) * thickness_mm * inside.tan();
            let before = Film::new(1.0, &[], index.into(), NM).shares(angle.cos());
            let behind = Film::new(index, &[], 1.0.into(), NM).shares(inside.cos());
            let s = before.t_s * behind.r_s.powi(n_reflections) * behind.t_s;
            let p = before.t_p * behind.r_p.powi(n_reflections) * behind.t_p;
            if reached_mm > rim_mm { 0.0 } else { s + p }
        };
        (0..n as usize).map(term).sum::<f64>()
    };
    let expected = light(2) / light(0);
    // Squares of the grid at rims.
    assert!((found / expected - 1.0).abs() < 2e-3, "{found} {expected}");
}

#[test]
fn numbers_of_reflections_and_of_the_film_that_make_no_sense_are_refused() {
    let plate = lens_of_plate().at(NM).unwrap();
    let message = |request: GhostRequest| plate.ghosts(&request).unwrap_err().to_string();
    let usual = request(0.0, 20.0, 100);
    assert!(message(GhostRequest { most_bounces: 3, ..usual }).contains("3 reflections, expected an even number"));
    assert!(message(GhostRequest { most_bounces: 14, ..usual }).contains("from 2 to 12"));
    assert!(message(GhostRequest { film_reflectance: 1.2, ..usual }).contains("reflectance is 1.2, expected 0 to 1"));
}
