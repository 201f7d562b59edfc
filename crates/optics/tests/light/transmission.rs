//! The share of light that lenses let through along rays.

use dioptric_golden::needs_shared;
use dioptric_optics::{
    Coating, CoatingLayer, CoordinateBreak, Film, Glass, Interface, Lens, ObjectPoint, RayBatch, RayBatchF32, RayLight,
    RayLightF32, Shape, Surface, Vignetting,
    analysis::projected_solid_angle,
    glam::{DVec2, DVec3},
};

const NM: f64 = 550.0;

fn glass(index: f64) -> Glass {
    if index == 1.0 { Glass::Air } else { Glass::Constant { index } }
}

/// A lens of rows of radius (infinite for a plane), index behind and thickness, all of the same rims.
fn lens(rows: &[[f64; 3]], semi_aperture_mm: f64) -> Lens {
    let interface = |&[radius_mm, index, thickness_after_mm]: &[f64; 3]| Interface {
        surface: Surface { curvature_per_mm: 1.0 / radius_mm, ..Surface::plane(semi_aperture_mm) },
        medium_after: glass(index),
        thickness_after_mm,
    };
    Lens::new("of rows", "a test", rows.iter().map(interface).collect(), 0).unwrap()
}

fn share_of(lens: &Lens, point: DVec3, direction: DVec3) -> f64 {
    let mut rays = RayBatch::from_points(&[point], &[direction.normalize()]);
    lens.at(NM).unwrap().trace_shares(&mut rays, Vignetting::On)[0]
}

#[test]
fn a_slanted_plate_transmits_each_polarization_by_itself() {
    let plate = lens(&[[f64::INFINITY, 1.5, 3.0], [f64::INFINITY, 1.0, 0.0]], 50.0);
    assert_eq!(share_of(&plate, DVec3::ZERO, DVec3::new(0.0, 1.0, 1.0)), 1.0);
    let bare = plate.clone().with_light_loss(Some(Coating::Bare)).unwrap();
    for degrees in [0.0f64, 20.0, 56.3, 75.0, 85.0] {
        let cos = degrees.to_radians().cos();
        let there = Film::new(1.0, &[], 1.5.into(), NM).shares(cos);
        let expected = 0.5 * (there.t_s * there.t_s + there.t_p * there.t_p);
        let direction = DVec3::new(0.3 * degrees.to_radians().sin(), 0.91f64.sqrt() * degrees.to_radians().sin(), cos);
        let found = share_of(&bare, DVec3::ZERO, direction);
        assert!((found - expected).abs() < 1e-9, "{degrees}: {found} {expected}");
    }
    // Surfaces are series: good to 1e-9.
    for coating in [Coating::MGF2, Coating::named("bbar").unwrap(), Coating::named("vcoat").unwrap()] {
        let coated = plate.clone().with_light_loss(Some(coating)).unwrap();
        let straight = share_of(&coated, DVec3::ZERO, DVec3::Z);
        assert!(straight > 0.96 && straight < 1.0 + 1e-9, "{straight}");
    }
    let mgf2 = plate.with_light_loss(Some(Coating::MGF2)).unwrap();
    let film = Film::new(1.0, &[(1.38.into(), NM / 4.0 / 1.38)], 1.5.into(), NM).shares(0.6);
    let found = share_of(&mgf2, DVec3::ZERO, DVec3::new(0.8, 0.0, 0.6));
    assert!((found - 0.5 * (film.t_s.powi(2) + film.t_p.powi(2))).abs() < 1e-9, "{found}");
}

/// Stacks of many layers change within a few degrees: a filter of 24 layers, to the digits of a single one.
#[test]
fn stacks_of_many_layers_are_followed_at_all_angles() {
    let layer = |index: f64| CoatingLayer { medium: Glass::Constant { index }, thickness_nm: 600.0 / 4.0 / index };
    let layers: Vec<CoatingLayer> = (0..24).map(|i| layer(if i % 2 == 0 { 2.35 } else { 1.38 })).collect();
    let index_and_nm: Vec<_> = (0..24)
        .map(|i| if i % 2 == 0 { 2.35f64 } else { 1.38 })
        .map(|index| (index.into(), 600.0 / 4.0 / index))
        .collect();
    let plate = lens(&[[f64::INFINITY, 1.5, 3.0], [f64::INFINITY, 1.0, 0.0]], 50.0);
    let coated = plate.with_light_loss(Some(Coating::Layers(layers))).unwrap();
    for degrees in 0..18 {
        let (sin, cos) = (5.0 * f64::from(degrees)).to_radians().sin_cos();
        let film = Film::new(1.0, &index_and_nm, 1.5.into(), NM).shares(cos);
        let expected = 0.5 * (film.t_s.powi(2) + film.t_p.powi(2));
        let found = share_of(&coated, DVec3::ZERO, DVec3::new(sin, 0.0, cos));
        assert!((found - expected).abs() < 1e-7, "{degrees}: {found} {expected}");
    }
}

/// Two plates of bare glass turned against each other by 90° about the light: what the first polarizes the second takes.
#[test]
fn crossed_plates_turn_the_plane_of_incidence() {
    let tilt = |surfaces: (usize, usize), x: f64, y: f64| CoordinateBreak {
        surfaces,
        pivot_mm: 0.0,
        decenter_mm: [0.0; 3],
        tilt_deg: [x.to_degrees(), y.to_degrees(), 0.0],
        tilt_first: false,
    };
    let angle = 60f64.to_radians();
    let rows =
        [[f64::INFINITY, 1.5, 2.0], [f64::INFINITY, 1.0, 48.0], [f64::INFINITY, 1.5, 2.0], [f64::INFINITY, 1.0, 0.0]];
    let shares = Film::new(1.0, &[], 1.5.into(), NM).shares(angle.cos());
    let (s, p) = (shares.t_s * shares.t_s, shares.t_p * shares.t_p);
    for (second, expected) in [([angle, 0.0], 0.5 * (s * s + p * p)), ([0.0, angle], s * p)] {
        let moves = vec![tilt((0, 1), angle, 0.0), tilt((2, 3), second[0], second[1])];
        let lens = lens(&rows, 60.0).with_moves(moves).unwrap().with_light_loss(Some(Coating::Bare)).unwrap();
        let found = share_of(&lens, DVec3::new(0.0, 0.0, -50.0), DVec3::Z);
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    }
}

#[test]
fn glass_takes_light_along_each_way_and_ideal_coatings_none() {
    let named = Glass::Named("SCHOTT:N-SF11".to_owned());
    let plane = |medium_after: Glass, thickness_after_mm: f64| Interface {
        surface: Surface::plane(20.0),
        medium_after,
        thickness_after_mm,
    };
    let plate = Lens::new("plate", "a test", vec![plane(named.clone(), 8.0), plane(Glass::Air, 0.0)], 0).unwrap();
    let clear = plate.clone().with_light_loss(Some(Coating::Ideal)).unwrap();
    let mut rays = RayBatch::from_points(&[DVec3::ZERO], &[DVec3::new(0.6, 0.0, 0.8)]);
    let found = clear.at(420.0).unwrap().trace_shares(&mut rays, Vignetting::On)[0];
    let path_mm = 8.0 / (1.0 - (0.6 / named.index_at(420.0).unwrap()).powi(2)).sqrt();
    let expected = named.internal_transmittance(420.0, path_mm).unwrap();
    assert!(expected < 0.95 && (found - expected).abs() < 1e-12, "{found} {expected}");
    assert!(plate.at(420.0).unwrap().is_lossless() && !clear.at(420.0).unwrap().is_lossless());
}

/// A triplet's rays in their order, forward and back, in double and single precision.
#[test]
fn light_takes_the_same_way_back() {
    for name in ["dgauss-50mm", "wide-6mm", "asphere-15mm"] {
        let lens = Lens::built_in(name).unwrap().with_light_loss(Some(Coating::MGF2)).unwrap().at(NM).unwrap();
        let point = ObjectPoint::far(0.2, DVec2::new(0.6, 0.8));
        let radius_mm = 0.7 * 0.5 * lens.first_order().entrance_pupil_diameter_mm;
        let targets: Vec<DVec2> =
            (0..40).map(|i| DVec2::from_angle(0.7 * f64::from(i)) * (radius_mm * f64::from(i) / 40.0)).collect();
        let mut rays = lens.rays_towards(&point, &targets, lens.first_order().entrance_pupil_z_mm, 0.0);
        let mut light = RayLight::unpolarized(rays.len());
        lens.trace_light(&mut rays, &mut light, Vignetting::Off);
        let reversed = lens.reversed();
        let (mut back, mut single) = (RayBatch::default(), RayBatchF32::default());
        for i in 0..rays.len() {
            let start = rays.point_mm(i) + rays.direction(i);
            back.push(start, -rays.direction(i), 0.0);
            single.push(start, -rays.direction(i));
        }
        let (mut in_parts, mut parts_light) = (single.clone(), RayLightF32::unpolarized(back.len()));
        reversed.trace_light_to_stop_f32(&mut in_parts, &mut parts_light);
        reversed.trace_light_from_stop_f32(&mut in_parts, &mut parts_light);
        let mut back_light = RayLight::unpolarized(back.len());
        reversed.trace_light(&mut back, &mut back_light, Vignetting::Off);
        let mut single_light = RayLightF32::unpolarized(back.len());
        reversed.trace_light_f32(&mut single, &mut single_light);
        let mut n_lit = 0;
        for i in 0..rays.len() {
            if !(rays.fate[i].is_in_flight() && back.fate[i].is_in_flight()) {
                continue;
            }
            let share = light.share(i);
            assert!((back_light.share(i) / share - 1.0).abs() < 1e-10, "{name} {i}: {} {share}", back_light.share(i));
            if single.fate[i].is_in_flight() {
                n_lit += 1;
                // In single precision terms of 1e-6 are left out at each of some ten surfaces.
                assert!(
                    (single_light.share(i) / share - 1.0).abs() < 1e-5,
                    "{name} {i}: {} {share}",
                    single_light.share(i)
                );
                assert!(
                    (parts_light.share(i) / share - 1.0).abs() < 1e-5,
                    "{name} {i}: {} {share}",
                    parts_light.share(i)
                );
            }
        }
        assert!(n_lit > 10, "{name}: {n_lit}");
    }
}

/// A lens between equal tilts is one on its axis: surface by surface, and as blocks.
#[test]
fn moved_lenses_lose_what_they_lose_on_their_axis() {
    let lens = Lens::built_in("tessar-50mm").unwrap().with_light_loss(Some(Coating::Bare)).unwrap();
    let moved = lens.clone().with_moves(vec![CoordinateBreak {
        surfaces: (0, lens.interfaces().len()),
        pivot_mm: 0.0,
        decenter_mm: [1.0, -2.0, 0.0],
        tilt_deg: [0.0; 3],
        tilt_first: false,
    }]);
    let direction = DVec3::new(0.1, 0.2, 1.0);
    let on_axis = share_of(&lens, DVec3::new(0.4, 0.3, 0.0), direction);
    let aside = share_of(&moved.unwrap(), DVec3::new(1.4, -1.7, 0.0), direction);
    assert!(on_axis > 0.5 && (aside - on_axis).abs() < 1e-12, "{aside} {on_axis}");
}

/// A built-in lens of glass that absorbs nothing.
fn clear(name: &str) -> Lens {
    let lens = Lens::built_in(name).unwrap();
    let of_index = |interface: &Interface| {
        let index = interface.medium_after.index_at(NM).unwrap();
        Interface { medium_after: glass(index), ..interface.clone() }
    };
    Lens::new(name, "a test", lens.interfaces().iter().map(of_index).collect(), lens.stop()).unwrap()
}

/// Numbers of a numpy tracer that carries amplitudes of both polarizations: its mean over a grid of rays that pass, to 1e-4.
#[test]
fn double_gauss_and_singlet_transmit_what_another_tracer_finds() {
    for (name, bare, mgf2) in [("singlet-50mm", 0.91656, 0.97435), ("dgauss-50mm", 0.58654, 0.96389)] {
        let lens = clear(name);
        let grid = |lens: &Lens| {
            let mono = lens.at(NM).unwrap();
            let radius_mm = lens.front_semi_aperture_mm();
            let n = 160;
            let at = |i: usize| radius_mm * ((2 * i + 1) as f64 / n as f64 - 1.0);
            let targets: Vec<DVec2> = (0..n * n)
                .map(|i| DVec2::new(at(i % n), at(i / n)))
                .filter(|place| place.length() <= radius_mm)
                .collect();
            let mut rays = mono.rays_towards(&ObjectPoint::Infinite(DVec3::Z), &targets, 0.0, 0.0);
            let shares = mono.trace_shares(&mut rays, Vignetting::On);
            shares.iter().sum::<f64>() / rays.n_in_flight() as f64
        };
        for (coating, expected) in [(Coating::Bare, bare), (Coating::MGF2, mgf2)] {
            let coated = lens.clone().with_light_loss(Some(coating)).unwrap();
            let found = grid(&coated);
            // The five decimals that it states.
            assert!((found - expected).abs() < 1e-4, "{name}: {found} {expected}");
            // On the axis over the pupil, and in what light reaches the film, it is nearly the same.
            let mono = coated.at(NM).unwrap();
            let axial = mono.axial_transmission(f64::INFINITY).unwrap();
            assert!((axial - expected).abs() < 2e-3, "{name}: {axial} {expected}");
            let far = ObjectPoint::Infinite(DVec3::Z);
            let cones = [&lens, &coated].map(|lens| projected_solid_angle(&lens.at(NM).unwrap(), &far, 64));
            assert!((cones[1] / cones[0] - axial).abs() < 1e-4);
        }
    }
}

/// Of ghosts' reference the light that goes straight on, per ray that passes, at three fields.
#[needs_shared("reference/ghosts")]
#[test]
fn direct_light_of_the_reference_is_met_off_the_axis() {
    for (kind, coating) in [("bare", Coating::Bare), ("mgf2", Coating::MGF2)] {
        for field_deg in [0.0f64, 5.0, 10.0] {
            let path =
                dioptric_golden::shared(&format!("reference/ghosts/dgauss-50mm_{kind}_{field_deg}.json")).unwrap();
            let json: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
            let expected = json["direct"]["power"].as_f64().unwrap() / json["direct"]["open"].as_f64().unwrap();
            let lens = Lens::built_in("dgauss-50mm").unwrap().with_light_loss(Some(coating.clone())).unwrap();
            let (mono, radius_mm, n) = (lens.at(NM).unwrap(), lens.front_semi_aperture_mm(), 160);
            let at = |i: usize| radius_mm * ((2 * i + 1) as f64 / n as f64 - 1.0);
            let all = (0..n * n).map(|i| DVec2::new(at(i % n), at(i / n)));
            let targets: Vec<DVec2> = all.filter(|place| place.length() <= radius_mm).collect();
            let field = field_deg.to_radians();
            let point = ObjectPoint::Infinite(DVec3::new(0.0, field.sin(), field.cos()));
            let mut rays = mono.rays_towards(&point, &targets, 0.0, 0.0);
            let shares = mono.trace_shares(&mut rays, Vignetting::On);
            let found = shares.iter().sum::<f64>() / rays.n_in_flight() as f64;
            assert!((found - expected).abs() < 1e-4, "{kind} {field_deg}: {found} {expected}");
        }
    }
}

#[test]
fn ideal_lenses_and_holes_have_no_surfaces_to_lose_light_at() {
    for lens in [Lens::thin(50.0, 10.0).unwrap(), Lens::pinhole(0.3).unwrap()] {
        let coated = lens.with_light_loss(Some(Coating::Bare)).unwrap().at(NM).unwrap();
        assert!(coated.is_lossless() && coated.axial_transmission(f64::INFINITY) == Some(1.0));
    }
}

#[test]
fn mirrors_are_perfect_unless_a_metal_is_stated() {
    let mirror = Lens::new(
        "mirror",
        "a test",
        vec![Interface {
            surface: Surface { shape: Shape::Conic { conic: -1.0 }, ..Surface::sphere(-200.0, 20.0) },
            medium_after: Glass::Air,
            thickness_after_mm: 0.0,
        }],
        0,
    )
    .unwrap()
    .with_mirrors([0])
    .unwrap()
    .with_light_loss(Some(Coating::MGF2))
    .unwrap();
    assert!(mirror.at(NM).unwrap().is_lossless());
    let aluminium = Glass::Absorbing {
        law: Box::new(Glass::Constant { index: 0.958 }),
        wavelengths_nm: vec![500.0, 600.0],
        extinctions: vec![6.69, 6.69],
    };
    let metal = Coating::Metal { metal: aluminium, layers: Vec::new() };
    let coated = mirror.clone().with_coatings(vec![(0, metal.clone())]).unwrap();
    let found = share_of(&coated, DVec3::new(0.0, 0.0, -50.0), DVec3::Z);
    let (n, k) = (0.958f64, 6.69f64);
    let expected = ((n - 1.0).powi(2) + k * k) / ((n + 1.0).powi(2) + k * k);
    assert!((found - expected).abs() < 1e-6, "{found} {expected}");
    // Beyond what is known of the metal nothing is guessed.
    let wrong = coated.at(700.0).unwrap_err().to_string();
    assert!(wrong.contains("surface 0") && wrong.contains("not known at 700 nm"), "{wrong}");
    let wrong = mirror.with_coatings(vec![(0, Coating::Bare)]).unwrap().at(NM).unwrap_err().to_string();
    assert!(wrong.contains("surface 0") && wrong.contains("Ideal, Metal or Table"), "{wrong}");
    let singlet = Lens::built_in("singlet-50mm").unwrap().with_light_loss(Some(Coating::MGF2)).unwrap();
    let wrong = singlet.clone().with_coatings(vec![(1, metal)]).unwrap().at(NM).unwrap_err().to_string();
    assert!(wrong.contains("surface 1"), "{wrong}");
    assert!(
        singlet.with_coatings(vec![(9, Coating::Bare)]).unwrap_err().to_string().contains("surface 9, expected 0 to")
    );
}

#[test]
fn coatings_stay_in_our_own_file() {
    let text = Lens::built_in("singlet-50mm").unwrap().to_ron().replacen(
        "thickness_mm",
        "coating: Broadband(at_nm: 520.0), thickness_mm",
        1,
    );
    let path = std::path::Path::new("coated.ron");
    let read = |text: &str| dioptric_optics::LensFile::from_bytes(path, text.as_bytes(), &Default::default());
    let lens = read(&text).unwrap().lens;
    assert_eq!(lens.coatings(), [(0, Coating::Broadband { at_nm: 520.0 })]);
    assert_eq!(read(&lens.to_ron()).unwrap().lens, lens);
    assert!(lens.at(NM).unwrap().is_lossless());
    let wrong = read(&text.replace("at_nm: 520.0", "at_nm: -1.0")).unwrap_err().to_string();
    assert!(wrong.contains("surface 0") && wrong.contains("at_nm of a coating is -1"), "{wrong}");
    assert!(read(&text.replace("Broadband", "Magic")).is_err());
}
