//! Light in media against closed forms.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::{
    f64::consts::{PI, TAU},
    sync::Arc,
};

use dioptric_backward::{
    BandSampling, Bands, Camera, LightPaths, Pinhole, PixelGrid, Placement, RenderSettings, Renderer, Rendering,
};
use dioptric_optics::glam::DVec2;
use dioptric_spectrum::{Cancel, Spectrum, WavelengthGrid};
use dioptric_world::{
    Beyond, Density, Emission, Field, FilledBox, Filling, Glow, Interface, Light, Material, Medium, MediumId, Shape,
    SpectralCurve, Texture, TriangleMesh, World, WorldBuilder,
    glam::{DAffine3, DVec3, Vec3},
};

const BANDS_NM: [f64; 3] = [450.0, 550.0, 650.0];

/// Renders what is seen along +z from the origin, or from elsewhere.
fn render(world: &World, placement: Placement, (n, half_tangent): (usize, f64), paths: LightPaths) -> Rendering {
    let grid = WavelengthGrid::new(BANDS_NM.to_vec()).unwrap();
    let camera = Camera::Pinhole(Pinhole {
        placement,
        pixels: PixelGrid::new(n, n),
        half_tangents: DVec2::splat(half_tangent),
        layer: 0,
    });
    let bands = Bands { grid, sampling: BandSampling::Center };
    let settings = RenderSettings { bands, paths, samples_per_pass: 64, seed: 1, clamp: None };
    let mut renderer = Renderer::new(world, &camera, settings).unwrap();
    for _ in 0..8 {
        assert!(renderer.pass(&Cancel::new(), &|_| {}).unwrap());
    }
    renderer.rendering()
}

/// Returns the mean of each band with its standard error.
fn means(picture: &Rendering) -> [(f64, f64); 3] {
    std::array::from_fn(|band| {
        let (values, errors) = (&picture.picture.planes()[band], &picture.standard_error.planes()[band]);
        let error = errors.iter().map(|e| f64::from(e * e)).sum::<f64>().sqrt() / errors.len() as f64;
        (f64::from(values.mean().unwrap()), error)
    })
}

fn curve(values: [f64; 3]) -> SpectralCurve {
    SpectralCurve::new(&Spectrum::new(BANDS_NM.to_vec(), values.to_vec()).unwrap(), Beyond::Held)
}

fn even(absorption: [f64; 3], scattering: [f64; 3], asymmetry: f32) -> Medium {
    Medium::even(curve(absorption), curve(scattering), asymmetry)
}

/// The same medium in the grid of a box, whose numbers are 1, or half of them 2 and half of them 0 by turns.
fn in_grid(medium: Medium, (low, high): (DVec3, DVec3), is_even: bool) -> Medium {
    let side = 8;
    let number = |i: usize| match is_even {
        true => 1.0,
        false => 2.0 * ((i + i / side + i / (side * side)) % 2) as f32,
    };
    let field = Field::new([side; 3], 1, (0..side.pow(3)).map(number).collect()).unwrap();
    let place = DAffine3::from_translation(low) * DAffine3::from_scale(high - low);
    Medium { density: Density::Box(Arc::new(FilledBox::new(place, Filling::Numbers(field)))), ..medium }
}

/// Fills a shape, which has no surface unless it is said.
fn fill(builder: &mut WorldBuilder, shape: Shape, place: DAffine3, medium: MediumId, material: Material) {
    let material = builder.add_material("boundary", material);
    let shape = builder.add_shape(shape, place, material, None);
    builder.set_interface(shape, Interface { inside: Some(medium), outside: None });
}

/// A ball of radius 1 before the camera that holds a medium, under a sky of radiance 1.
fn ball(medium: Medium, material: Material) -> World {
    let mut builder = WorldBuilder::new();
    let medium = builder.add_medium(medium);
    let place = DAffine3::from_translation(DVec3::Z * 3.0);
    fill(&mut builder, Shape::Sphere { radius_m: 1.0 }, place, medium, material);
    builder.add_light(Light::Sky { radiance: SpectralCurve::constant(1.0) });
    builder.build().unwrap()
}

/// Adds a slab from z = 0 down to −depth, so wide that nothing is seen of its rim.
fn add_slab(builder: &mut WorldBuilder, medium: Medium, depth_m: f32) {
    const WIDE: f32 = 200.0;
    let medium = builder.add_medium(medium);
    let top = TriangleMesh::quad(Vec3::new(-WIDE, -WIDE, 0.0), Vec3::X * 2.0 * WIDE, Vec3::Y * 2.0 * WIDE);
    let bottom = TriangleMesh::quad(Vec3::new(-WIDE, -WIDE, -depth_m), Vec3::Y * 2.0 * WIDE, Vec3::X * 2.0 * WIDE);
    for face in [top, bottom] {
        fill(builder, Shape::Mesh(face), DAffine3::IDENTITY, medium, Material::Open);
    }
}

/// A view of a point of the slab's top whose cosine to its normal is `mu`, from above or from below, in a plane of this azimuth.
fn view(mu: f64, azimuth: f64) -> (Placement, DVec3) {
    let sine = (1.0 - mu * mu).sqrt();
    let towards = DVec3::new(sine * azimuth.cos(), sine * azimuth.sin(), mu);
    (Placement::look_at(2.0 * towards, DVec3::ZERO, DVec3::new(0.1, 0.9, 0.2)).unwrap(), towards)
}

#[track_caller]
fn assert_means(name: &str, picture: &Rendering, expected: [f64; 3], most_error: f64) {
    for ((mean, error), expected) in means(picture).into_iter().zip(expected) {
        assert!((mean - expected).abs() <= 4.0 * error + 2e-5 * expected, "{name}: {mean} {expected} ± {error}");
        assert!(error < most_error * expected.max(1e-3), "{name}: {error} of {expected}");
    }
}

fn glass(index: f32) -> Material {
    Material::Dielectric { index: SpectralCurve::constant(index), roughness: None }
}

/// What only scatters can't be seen under an even sky, however differently its bands scatter, with and without a boundary
/// that refracts.
#[test]
fn white_medium_cannot_be_seen_in_a_furnace() {
    let place = (DVec3::new(-1.0, -1.0, 2.0), DVec3::new(1.0, 1.0, 4.0));
    for (scattering, g) in [([0.5, 3.0, 12.0], 0.6), ([20.0, 4.0, 0.0], -0.4)] {
        for material in [Material::Open, glass(1.4)] {
            let medium = even([0.0; 3], scattering, g);
            for medium in [medium.clone(), in_grid(medium, place, false)] {
                let picture =
                    render(&ball(medium, material.clone()), Placement::IDENTITY, (12, 0.25), LightPaths::Full);
                assert_means(&format!("furnace {scattering:?}"), &picture, [1.0; 3], 0.006);
            }
        }
    }
}

/// What is left of light on its way through a medium that absorbs alone, e^(−σd), without noise.
#[test]
fn absorption_is_beer_lambert_exactly() {
    let absorption = [0.1, 1.0, 4.0];
    let picture = render(
        &ball(even(absorption, [0.0; 3], 0.0), Material::Open),
        Placement::IDENTITY,
        (1, 1e-5),
        LightPaths::Full,
    );
    let expected = absorption.map(|per_m: f64| (-2.0 * per_m).exp());
    for ((mean, error), expected) in means(&picture).into_iter().zip(expected) {
        assert!((mean / expected - 1.0).abs() < 1e-5 && error < 1e-6, "{mean} {expected} {error}");
    }
    // Of a grid the same without closed form.
    let place = (DVec3::new(-1.0, -1.0, 2.0), DVec3::new(1.0, 1.0, 4.0));
    let medium =
        Medium { scattering: SpectralCurve::constant(0.0), ..in_grid(even(absorption, [0.0; 3], 0.0), place, true) };
    let picture = render(&ball(medium, Material::Open), Placement::IDENTITY, (8, 1e-5), LightPaths::Full);
    // From the middle of the last cell to its end it falls from 1 to a half.
    assert_means("grid", &picture, absorption.map(|per_m: f64| (-per_m * (2.0 - 0.0625)).exp()), 0.02);
}

/// Light scattered once in a slab, by the integral over its depth, forwards and back.
#[test]
fn single_scattering_in_a_slab_has_its_closed_form() {
    let (absorption, scattering, g, depth) = ([0.02, 0.5, 1.0], [0.03, 0.4, 3.0], 0.55_f64, 1.0);
    let (mu_sun, mu_eye) = (0.8_f64, 0.5_f64);
    let phase = |cosine: f64| (1.0 - g * g) / (4.0 * PI * (1.0 + g * g - 2.0 * g * cosine).powf(1.5));
    for from_below in [false, true] {
        let mut builder = WorldBuilder::new();
        add_slab(&mut builder, even(absorption, scattering, g as f32), depth as f32);
        let (_, to_sun) = view(mu_sun, 2.0);
        builder.add_light(Light::Distant { direction: -to_sun, irradiance: SpectralCurve::constant(1.0) });
        let (_, to_eye) = view(mu_eye, 0.3);
        let to_eye = if from_below { DVec3::new(to_eye.x, to_eye.y, -to_eye.z) } else { to_eye };
        let placement = Placement::look_at(4.0 * to_eye, DVec3::ZERO, DVec3::Y).unwrap();
        let picture = render(&builder.build().unwrap(), placement, (8, 1e-4), LightPaths::Direct);
        // From the way that light goes to the way that it goes then.
        let cosine = (-to_sun).dot(to_eye);
        let expected = [0, 1, 2].map(|i| {
            let (tau, share) =
                ((absorption[i] + scattering[i]) * depth, scattering[i] / (absorption[i] + scattering[i]));
            let (sun, eye) = (tau / mu_sun, tau / mu_eye);
            let path = match from_below {
                true => mu_sun / (mu_sun - mu_eye) * ((-sun).exp() - (-eye).exp()),
                false => mu_sun / (mu_sun + mu_eye) * (1.0 - (-sun - eye).exp()),
            };
            share * phase(cosine) * path
        });
        assert_means(&format!("slab, from below {from_below}"), &picture, expected, 0.006);
    }
}

/// Chandrasekhar's H function of a medium of this albedo that scatters alike in all directions, by iterating its equation.
fn h_function(albedo: f64) -> impl Fn(f64) -> f64 {
    let n = 400;
    let nodes: Vec<f64> = (0..n).map(|i| (f64::from(i) + 0.5) / f64::from(n)).collect();
    let root = (1.0 - albedo).sqrt();
    let mut h = vec![1.0; nodes.len()];
    let places = nodes.clone();
    let at = move |mu: f64, h: &[f64]| {
        let sum: f64 = nodes.iter().zip(h).map(|(x, h)| x * h / (mu + x)).sum::<f64>() / f64::from(n);
        1.0 / (root + 0.5 * albedo * sum)
    };
    for _ in 0..500 {
        h = places.iter().map(|&mu| at(mu, &h)).collect();
    }
    move |mu| at(mu, &h)
}

/// A slab so thick that nothing comes through: what it sends back of an even sky and of the sun (Chandrasekhar 1960).
#[test]
fn thick_slab_has_chandrasekhars_albedo() {
    let albedos = [0.5, 0.9, 0.99];
    let (mu_sun, mu_eye) = (0.6, 0.35);
    for is_sunny in [false, true] {
        let mut builder = WorldBuilder::new();
        // As deep as a hundred mean free paths; bands differ in density too.
        let density = [3.0, 1.0, 2.0];
        let scattering = [0, 1, 2].map(|i| density[i] * albedos[i]);
        let absorption = [0, 1, 2].map(|i| density[i] * (1.0 - albedos[i]));
        add_slab(&mut builder, even(absorption, scattering, 0.0), 100.0);
        builder.add_light(match is_sunny {
            true => Light::Distant { direction: -view(mu_sun, 2.0).1, irradiance: SpectralCurve::constant(1.0) },
            false => Light::Sky { radiance: SpectralCurve::constant(1.0) },
        });
        let picture = render(&builder.build().unwrap(), view(mu_eye, 0.3).0, (16, 1e-4), LightPaths::Full);
        let expected = albedos.map(|albedo| {
            let h = h_function(albedo);
            match is_sunny {
                true => albedo / (4.0 * PI) * mu_sun / (mu_sun + mu_eye) * h(mu_sun) * h(mu_eye),
                false => 1.0 - (1.0 - albedo).sqrt() * h(mu_eye),
            }
        });
        assert_means(&format!("thick slab, sunny {is_sunny}"), &picture, expected, 0.005);
    }
    // Its mean has a closed form.
    let (h, n) = (h_function(0.9), 1000);
    let mean = (0..n).map(|i| h((f64::from(i) + 0.5) / f64::from(n))).sum::<f64>() / f64::from(n);
    assert!((mean - 2.0 / 0.9 * (1.0 - 0.1_f64.sqrt())).abs() < 1e-5, "{mean}");
}

/// With sun and eye in each other's place a slab's L / cos θ stays, θ the angle of the sun (Helmholtz).
#[test]
fn sun_and_eye_change_places() {
    let ways = [(0.9, 0.4), (0.3, 2.2)];
    let of_sun = |sun: (f64, f64), eye: (f64, f64)| {
        let mut builder = WorldBuilder::new();
        add_slab(&mut builder, even([0.1, 0.2, 0.3], [1.0, 3.0, 0.4], 0.7), 2.0);
        let direction = -view(sun.0, sun.1).1;
        builder.add_light(Light::Distant { direction, irradiance: SpectralCurve::constant(1.0) });
        means(&render(&builder.build().unwrap(), view(eye.0, eye.1).0, (32, 1e-4), LightPaths::Full))
            .map(|(mean, error)| (mean / sun.0, error / sun.0))
    };
    for ((there, error), (back, of_back)) in of_sun(ways[0], ways[1]).into_iter().zip(of_sun(ways[1], ways[0])) {
        let error = error.hypot(of_back);
        println!("there {there:.5}, back {back:.5} ± {error:.5}");
        assert!((there - back).abs() < 4.0 * error && error < 0.01 * there, "{there} {back} {error}");
    }
}

/// A ball in a grid of numbers that are all 1 is that of an even medium; the grid is wider than the ball.
#[test]
fn grid_of_ones_is_an_even_medium() {
    let medium = even([0.3, 0.1, 0.8], [2.0, 1.0, 0.2], 0.5);
    let place = (DVec3::new(-2.0, -2.0, 1.0), DVec3::new(2.0, 2.0, 5.0));
    let sun = |medium: Medium| {
        let mut builder = WorldBuilder::new();
        let medium = builder.add_medium(medium);
        let ball = DAffine3::from_translation(DVec3::Z * 3.0);
        fill(&mut builder, Shape::Sphere { radius_m: 1.0 }, ball, medium, Material::Open);
        let direction = DVec3::new(-0.6, -0.8, 0.0);
        builder.add_light(Light::Distant { direction, irradiance: SpectralCurve::constant(1.0) });
        means(&render(&builder.build().unwrap(), Placement::IDENTITY, (32, 0.2), LightPaths::Full))
    };
    for ((a, error), (b, of_b)) in sun(medium.clone()).into_iter().zip(sun(in_grid(medium, place, true))) {
        let error = error.hypot(of_b);
        println!("even {a:.5}, grid {b:.5} ± {error:.5}");
        assert!((a - b).abs() < 4.0 * error && error < 0.005 * a, "{a} {b} {error}");
    }
}

/// A medium that glows as the sky does is in balance with it: whatever it absorbs and scatters, it can't be seen. Without sky and
/// scattering its radiance is 1 − e^(−τ).
#[test]
fn glow_is_in_balance_with_what_is_absorbed() {
    let place = (DVec3::new(-1.0, -1.0, 2.0), DVec3::new(1.0, 1.0, 4.0));
    let glow = Some(Glow::Spectrum(SpectralCurve::constant(1.0), None));
    for scattering in [[0.0; 3], [4.0, 0.5, 1.0]] {
        let medium = Medium { glow: glow.clone(), ..even([0.2, 1.0, 3.0], scattering, 0.4) };
        for medium in [medium.clone(), in_grid(medium, place, false)] {
            let picture = render(&ball(medium, Material::Open), Placement::IDENTITY, (16, 0.25), LightPaths::Full);
            assert_means(&format!("balance {scattering:?}"), &picture, [1.0; 3], 0.004);
        }
    }
    let mut builder = WorldBuilder::new();
    let medium = builder.add_medium(Medium { glow, ..even([0.2, 1.0, 3.0], [0.0; 3], 0.0) });
    let at = DAffine3::from_translation(DVec3::Z * 3.0);
    fill(&mut builder, Shape::Sphere { radius_m: 1.0 }, at, medium, Material::Open);
    let picture = render(&builder.build().unwrap(), Placement::IDENTITY, (1, 1e-5), LightPaths::Full);
    assert_means("glow", &picture, [0.2, 1.0, 3.0].map(|per_m: f64| 1.0 - (-2.0 * per_m).exp()), 1e-5);
}

/// The camera may be within a medium: what a file says is around it, or a shape that holds both. A lamp 2 m on is seen through 2 m of it.
#[test]
fn camera_is_in_the_medium_around_it() {
    let absorption = [0.1, 0.5, 1.0];
    for is_held in [false, true] {
        let mut builder = WorldBuilder::new();
        let fog = builder.add_medium(even(absorption, [0.0; 3], 0.0));
        if is_held {
            fill(&mut builder, Shape::Sphere { radius_m: 5.0 }, DAffine3::IDENTITY, fog, Material::Open);
        }
        builder.set_medium_at(DVec3::ZERO, fog);
        let black = builder.add_texture(Texture::Curve(SpectralCurve::constant(0.0)));
        let black = builder.add_material("black", Material::Matte { reflectance: black });
        let lamp = Shape::Mesh(TriangleMesh::quad(Vec3::new(-1.0, -1.0, 2.0), Vec3::X * 2.0, Vec3::Y * 2.0));
        let glow = Emission { radiance: SpectralCurve::constant(1.0), is_two_sided: true };
        builder.add_shape(lamp, DAffine3::IDENTITY, black, Some(glow));
        builder.add_light(Light::Sky { radiance: SpectralCurve::constant(1.0) });
        let world = builder.build().unwrap();
        let picture = render(&world, Placement::IDENTITY, (1, 1e-5), LightPaths::Full);
        assert_means("lamp in fog", &picture, absorption.map(|per_m: f64| (-2.0 * per_m).exp()), 1e-4);
        // The sky behind 5 m of it, or behind fog without end.
        let back = Placement::look_at(DVec3::ZERO, -DVec3::Z, DVec3::Y).unwrap();
        let left = if is_held { absorption.map(|per_m: f64| (-5.0 * per_m).exp()) } else { [0.0; 3] };
        assert_means("sky in fog", &render(&world, back, (1, 1e-5), LightPaths::Full), left, 1e-4);
    }
}

/// The glow of a point lamp in fog, by light scattered once: the integral along the line of sight.
#[test]
fn lamp_in_fog_has_its_glow() {
    let (scattering, distance, aside) = ([0.01, 0.1, 0.3], 3.0_f64, 0.5_f64);
    let mut builder = WorldBuilder::new();
    let fog = builder.add_medium(even([0.0; 3], scattering, 0.0));
    builder.set_medium_at(DVec3::ZERO, fog);
    let position = DVec3::new(aside, 0.0, distance);
    builder.add_light(Light::Point { position, intensity: SpectralCurve::constant(1.0) });
    let picture = render(&builder.build().unwrap(), Placement::IDENTITY, (48, 1e-4), LightPaths::Direct);
    let expected = scattering.map(|per_m| {
        let (n, far) = (200_000, 400.0 * distance);
        // Even steps of the angle under which the lamp sees the line of sight.
        let (first, last) = ((-distance / aside).atan(), ((far - distance) / aside).atan());
        let at = (0..n).map(|i| first + (last - first) * (f64::from(i) + 0.5) / f64::from(n));
        let left = at.map(|angle| (-per_m * (distance + aside * angle.tan() + aside / angle.cos())).exp());
        per_m / (2.0 * TAU) * left.sum::<f64>() * (last - first) / f64::from(n) / aside
    });
    assert_means("lamp in fog", &picture, expected, 0.02);
}

/// Hair that absorbs nothing can't be seen under an even sky, one before another; brown hair is darker the more there is of it.
#[test]
fn white_hair_cannot_be_seen_in_a_furnace() {
    let hairs = |color: f32, n_rows: i32| {
        let mut builder = WorldBuilder::new();
        let color = builder.add_texture(Texture::Curve(SpectralCurve::constant(color)));
        let material = Material::Hair { color, roughness: [0.3; 2], tilt_deg: 2.0, index: 1.55 };
        let hair = builder.add_material("hair", material);
        // Cylinders have u about them.
        builder.set_turn(hair, 0.5 * std::f32::consts::PI);
        for row in 0..n_rows {
            for column in -12..12 {
                let at = DVec3::new(0.1 * f64::from(column) + 0.03 * f64::from(row), 0.0, 3.0 + 0.12 * f64::from(row));
                let place = DAffine3::from_translation(at) * DAffine3::from_rotation_x(0.5 * PI + 0.1 * f64::from(row));
                let shape = Shape::Cylinder { radius_m: 0.04, z_min_m: -3.0, z_max_m: 3.0 };
                builder.add_shape(shape, place, hair, None);
            }
        }
        builder.add_light(Light::Sky { radiance: SpectralCurve::constant(1.0) });
        render(&builder.build().unwrap(), Placement::IDENTITY, (12, 0.2), LightPaths::Full)
    };
    assert_means("white hair", &hairs(1.0, 4), [1.0; 3], 0.004);
    let [one, four] = [1, 4].map(|n_rows| means(&hairs(0.3, n_rows))[0].0);
    assert!(four < 0.8 * one && four > 0.1, "{one} {four}");
}

/// Several skies light a matte ball as one that is their sum does: each counts once, whichever way it is found.
#[test]
fn skies_add_up_on_surfaces() {
    let lit_by = |radiances: &[f32]| {
        let mut builder = WorldBuilder::new();
        let gray = builder.add_texture(Texture::Curve(SpectralCurve::constant(0.5)));
        let matte = builder.add_material("gray", Material::Matte { reflectance: gray });
        let place = DAffine3::from_translation(DVec3::Z * 3.0);
        builder.add_shape(Shape::Sphere { radius_m: 1.0 }, place, matte, None);
        for &radiance in radiances {
            builder.add_light(Light::Sky { radiance: SpectralCurve::constant(radiance) });
        }
        let world = builder.build().unwrap();
        render(&world, Placement::look_at(DVec3::ZERO, DVec3::Z, DVec3::Y).unwrap(), (8, 0.2), LightPaths::default())
    };
    for radiances in [&[1.0][..], &[0.6, 0.4], &[0.2, 0.3, 0.5]] {
        assert_means(&format!("{radiances:?}"), &lit_by(radiances), [0.5; 3], 2e-3);
    }
}

/// Light that goes on nearly straight is scattered by finite numbers, whose integral over all directions is 1.
#[test]
fn the_most_forward_phase_is_finite() {
    for asymmetry in [1.0, -1.0, 0.99] {
        let medium = even([0.0; 3], [1.0; 3], asymmetry);
        // Over t = (1 − cos)^¼, in which the peak is wide enough for a sum.
        let n = 200_000;
        let top = 2.0_f64.powf(0.25);
        let sum: f64 = (0..n)
            .map(|i| {
                let t = top * (f64::from(i) + 0.5) / f64::from(n);
                let from_peak = t.powi(4);
                let cosine = (1.0 - from_peak) as f32 * asymmetry.signum();
                let value = f64::from(medium.phase(cosine));
                assert!(value.is_finite() && value >= 0.0, "{asymmetry} {cosine}: {value}");
                2.0 * std::f64::consts::PI * value * 4.0 * t.powi(3) * top / f64::from(n)
            })
            .sum();
        // Cosines near 1 are 6e-8 apart, an eighth of the peak's width.
        assert!((sum - 1.0).abs() < 0.05, "{asymmetry}: {sum}");
    }
}
