//! Mirrors and glass against closed forms.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::f64::consts::PI;

use dioptric_backward::{
    BandSampling, Bands, Camera, LightPaths, Pinhole, PixelGrid, Placement, RenderSettings, Renderer, Rendering,
};
use dioptric_optics::glam::DVec2;
use dioptric_spectrum::{Cancel, WavelengthGrid};
use dioptric_world::{
    Emission, Light, Material, Shape, SpectralCurve, Texture, TriangleMesh, World, WorldBuilder,
    glam::{DAffine3, DVec3, Vec3},
};

fn render(world: &World, n_pixels: usize, half_tangent: f64, paths: LightPaths) -> Rendering {
    render_from(world, Placement::IDENTITY, n_pixels, half_tangent, paths)
}

fn render_from(
    world: &World,
    placement: Placement,
    n_pixels: usize,
    half_tangent: f64,
    paths: LightPaths,
) -> Rendering {
    render_with_seed(world, placement, n_pixels, (half_tangent, paths), 1)
}

fn render_with_seed(
    world: &World,
    placement: Placement,
    n_pixels: usize,
    (half_tangent, paths): (f64, LightPaths),
    seed: u64,
) -> Rendering {
    let bands = Bands { grid: WavelengthGrid::new(vec![550.0]).unwrap(), sampling: BandSampling::Center };
    let camera = Camera::Pinhole(Pinhole {
        placement,
        pixels: PixelGrid::new(n_pixels, n_pixels),
        half_tangents: DVec2::splat(half_tangent),
        layer: 0,
    });
    let settings = RenderSettings { bands, paths, samples_per_pass: 64, seed, clamp: None };
    let mut renderer = Renderer::new(world, &camera, settings).unwrap();
    for _ in 0..8 {
        assert!(renderer.pass(&Cancel::new(), &|_| {}).unwrap());
    }
    renderer.rendering()
}

fn quad(z_m: f32) -> Shape {
    Shape::Mesh(TriangleMesh::quad(Vec3::new(-1.0, -1.0, z_m), Vec3::X * 2.0, Vec3::Y * 2.0))
}

/// A lit wall 1 m behind the camera, seen in a mirror 1 m before it, is a wall 3 m before it.
#[test]
fn mirror_shows_the_virtual_image() {
    let mut builder = WorldBuilder::new();
    let reflectance = builder.add_texture(Texture::Curve(SpectralCurve::constant(0.8)));
    let mirror = builder.add_material("mirror", Material::Mirror { reflectance, roughness: None });
    builder.add_shape(quad(1.0), DAffine3::IDENTITY, mirror, None);
    let reflectance = builder.add_texture(Texture::Curve(SpectralCurve::constant(0.5)));
    let wall = builder.add_material("wall", Material::Matte { reflectance });
    builder.add_shape(quad(-1.0), DAffine3::IDENTITY, wall, None);
    let position = DVec3::new(0.5, 0.3, 0.0);
    builder.add_light(Light::Point { position, intensity: SpectralCurve::constant(1.0) });
    let world = builder.build().unwrap();
    let (n, half_tangent) = (15, 0.12);
    // The mirror and the wall; light from the wall by way of the mirror back to it is a further scattering.
    let picture = render(&world, n, half_tangent, LightPaths::UpTo(2));
    for ((row, column), &found) in picture.picture.planes()[0].indexed_iter() {
        let at_m = |pixel: usize| 3.0 * half_tangent * (2.0 * (pixel as f64 + 0.5) / n as f64 - 1.0);
        let to_lamp = position - DVec3::new(at_m(column), -at_m(row), -1.0);
        let expected = 0.8 * 0.5 / PI * to_lamp.z / to_lamp.length().powi(3);
        let error = f64::from(picture.standard_error.planes()[0][(row, column)]);
        // A pixel of 48 mm changes the value at its middle by w²/24 times second derivatives of up to 6 per m²: 6e-4.
        let limit = 7e-4 * expected + 4.0 * error;
        assert!((f64::from(found) - expected).abs() < limit, "{row} {column}: {found} {expected} {error}");
        assert!(limit < 2.5e-3 * expected, "{limit}");
    }
}

/// Clear glass under a sky of radiance 1 has radiance 1 all over: L/n² stays the same, and nothing is absorbed.
#[test]
fn glass_sphere_cannot_be_seen_under_a_uniform_sky() {
    let mut builder = WorldBuilder::new();
    let glass = Material::Dielectric { index: SpectralCurve::constant(1.5), roughness: None };
    let glass = builder.add_material("glass", glass);
    let place = DAffine3::from_translation(DVec3::new(0.0, 0.0, 3.0));
    builder.add_shape(Shape::Sphere { radius_m: 1.0 }, place, glass, None);
    builder.add_light(Light::Sky { radiance: SpectralCurve::constant(1.0) });
    let picture = render(&builder.build().unwrap(), 8, 0.3, LightPaths::Full);
    let (picture, errors) = (&picture.picture.planes()[0], &picture.standard_error.planes()[0]);
    for (found, error) in picture.iter().zip(errors) {
        // Paths are followed until they leave; what the sphere sends on is 1 whichever way they go.
        assert!((found - 1.0).abs() < 4.5 * error + 1e-5 && *error < 0.02, "{found} {error}");
    }
    let error = errors.iter().map(|e| e * e).sum::<f32>().sqrt() / picture.len() as f32;
    let mean = picture.mean().unwrap();
    assert!((mean - 1.0).abs() < 4.0 * error && error < 0.002, "{mean} {error}");
}

/// In a closed room of albedo ρ and emission 1 the radiance is 1/(1 − ρ) everywhere, and glass changes none of it: whatever it sends
/// where, caustics of caustics included. Eight seeds together have a mean that is right to .15 %, and the spread that they state.
#[test]
fn glass_in_a_furnace_changes_nothing() {
    let mut builder = WorldBuilder::new();
    let reflectance = builder.add_texture(Texture::Curve(SpectralCurve::constant(0.8)));
    let gray = builder.add_material("gray", Material::Matte { reflectance });
    let emission = Emission { radiance: SpectralCurve::constant(1.0), is_two_sided: true };
    builder.add_shape(Shape::Sphere { radius_m: 5.0 }, DAffine3::IDENTITY, gray, Some(emission));
    let glass = Material::Dielectric { index: SpectralCurve::constant(1.5), roughness: None };
    let glass = builder.add_material("glass", glass);
    let place = DAffine3::from_translation(DVec3::new(0.1, -0.2, 3.0));
    builder.add_shape(Shape::Sphere { radius_m: 1.0 }, place, glass, None);
    let world = builder.build().unwrap();
    let means: Vec<(f64, f64)> = (1..=8)
        .map(|seed| {
            let picture = render_with_seed(&world, Placement::IDENTITY, 8, (0.4, LightPaths::Full), seed);
            let errors = &picture.standard_error.planes()[0];
            let variance: f64 = errors.iter().map(|e| f64::from(e * e)).sum();
            (f64::from(picture.picture.planes()[0].mean().unwrap()), variance.sqrt() / errors.len() as f64)
        })
        .collect();
    let n = means.len() as f64;
    let mean = means.iter().map(|(mean, _)| mean).sum::<f64>() / n;
    let error = means.iter().map(|(_, error)| error * error).sum::<f64>().sqrt() / n;
    assert!(error < 0.0075 && (mean - 5.0).abs() < 3.0 * error, "{mean} {error}");
    // χ² of eight seeds lies from 1.3 to 24 but for 6 cases in a thousand.
    let chi2: f64 = means.iter().map(|(mean, error)| ((mean - 5.0) / error).powi(2)).sum();
    assert!((1.3..24.0).contains(&chi2), "{chi2}");
}

/// The share of unpolarized light that passes a boundary from air into an index n, by the angles on both sides (Fresnel).
fn passed(n: f64, outside: f64, inside: f64) -> f64 {
    let (cos_o, cos_i) = (outside.cos(), inside.cos());
    let across = (cos_o - n * cos_i) / (cos_o + n * cos_i);
    let along = (n * cos_o - cos_i) / (n * cos_o + cos_i);
    1.0 - 0.5 * (across * across + along * along)
}

/// A lamp that a ball lens images on a white card behind it: the card sees its radiance in all directions that the ball bends to it.
#[test]
fn ball_lens_gathers_the_light_of_a_lamp() {
    // The card is at the back focal point of a ball of radius 1: a ray at an angle there has that angle to the normal inside the ball.
    let (index, card_m, lamp_m, lamp_radius_m, albedo) = (1.5_f64, 1.5_f64, 6.0_f64, 1.5_f64, 0.5_f64);
    let mut builder = WorldBuilder::new();
    let glass = Material::Dielectric { index: SpectralCurve::constant(index as f32), roughness: None };
    let glass = builder.add_material("glass", glass);
    builder.add_shape(Shape::Sphere { radius_m: 1.0 }, DAffine3::IDENTITY, glass, None);
    let reflectance = builder.add_texture(Texture::Curve(SpectralCurve::constant(albedo as f32)));
    let card = builder.add_material("card", Material::Matte { reflectance });
    builder.add_shape(quad(-card_m as f32), DAffine3::IDENTITY, card, None);
    let reflectance = builder.add_texture(Texture::Curve(SpectralCurve::constant(0.0)));
    let black = builder.add_material("black", Material::Matte { reflectance });
    let lamp = Shape::Disc { radius_m: lamp_radius_m, inner_radius_m: 0.0 };
    let place = DAffine3::from_translation(DVec3::new(0.0, 0.0, lamp_m));
    let glow = Emission { radiance: SpectralCurve::constant(1.0), is_two_sided: true };
    builder.add_shape(lamp, place, black, Some(glow));
    // A square millimeter of the card, seen past the ball; of light that the ball mirrors within nothing.
    let at = DVec3::new(0.0, 0.0, -card_m);
    let placement = Placement::look_at(DVec3::new(4.0, 0.0, -1.0), at, DVec3::Y).unwrap();
    let picture = render_from(&builder.build().unwrap(), placement, 16, 1e-4, LightPaths::UpTo(3));

    const STEPS: usize = 100_000;
    let widest = (1.0 / card_m).asin();
    let irradiance = (0..STEPS).map(|step| {
        let angle = widest * (step as f64 + 0.5) / STEPS as f64;
        let (outside, inside) = ((card_m * angle.sin()).asin(), (card_m * angle.sin() / index).asin());
        let leaves = outside - angle + PI - 2.0 * inside;
        let slope = (angle - 2.0 * (outside - inside)).tan();
        let at_lamp_m = leaves.sin() + (lamp_m + leaves.cos()) * slope;
        let lit = f64::from(u8::from(at_lamp_m.abs() < lamp_radius_m));
        lit * passed(index, outside, inside).powi(2) * 2.0 * PI * angle.sin() * angle.cos() * widest / STEPS as f64
    });
    let expected = albedo / PI * irradiance.sum::<f64>();
    let n = picture.picture.planes()[0].len() as f64;
    let found = f64::from(picture.picture.planes()[0].mean().unwrap());
    let error = picture.standard_error.planes()[0].iter().map(|e| f64::from(e * e)).sum::<f64>().sqrt() / n;
    // Without the ball it would be ½ sin²(11.3°).
    let bare = albedo * (lamp_radius_m / lamp_radius_m.hypot(lamp_m + card_m)).powi(2);
    println!("behind a ball lens {found:.5} ± {error:.5}, expected {expected:.5}, without it {bare:.5}");
    assert!((found - expected).abs() < 4.0 * error && error < 0.01 * expected, "{found} {expected} {error}");
    assert!(expected > 3.0 * bare);
}

/// Rough surfaces send as much light one way as the other: with lamp and camera in each other's place L d² / cos θ stays, d and θ of
/// the lamp (Helmholtz).
#[test]
fn lamp_and_camera_change_places() {
    let places = [DVec3::new(0.9, 0.2, 1.1), DVec3::new(-0.3, 1.6, 0.8)];
    let textured =
        |builder: &mut WorldBuilder, value: f32| builder.add_texture(Texture::Curve(SpectralCurve::constant(value)));
    let curve = SpectralCurve::constant;
    type Make<'a> = &'a dyn Fn(&mut WorldBuilder) -> Material;
    let materials: [(&str, Make<'_>); 4] = [
        ("matte", &|b| Material::Matte { reflectance: textured(b, 0.6) }),
        ("metal", &|b| Material::Metal {
            n: curve(0.2),
            k: curve(3.9),
            roughness: Some([textured(b, 0.5), textured(b, 0.3)]),
        }),
        ("mirror", &|b| Material::Mirror {
            reflectance: textured(b, 0.9),
            roughness: Some([textured(b, 0.6), textured(b, 0.6)]),
        }),
        ("coated", &|b| Material::Coated {
            base: textured(b, 0.4),
            index: curve(1.5),
            roughness: Some([textured(b, 0.4), textured(b, 0.4)]),
        }),
    ];
    for (name, material) in materials {
        let of_lamp = |lamp: DVec3, camera: DVec3| {
            let mut builder = WorldBuilder::new();
            let material = material(&mut builder);
            let material = builder.add_material(name, material);
            builder.add_shape(quad(0.0), DAffine3::IDENTITY, material, None);
            builder.add_light(Light::Point { position: lamp, intensity: curve(1.0) });
            let placement = Placement::look_at(camera, DVec3::ZERO, DVec3::Z).unwrap();
            let picture = render_from(&builder.build().unwrap(), placement, 1, 1e-5, LightPaths::Direct);
            f64::from(picture.picture.planes()[0][(0, 0)]) * lamp.length().powi(3) / lamp.z
        };
        let [there, back] = [of_lamp(places[0], places[1]), of_lamp(places[1], places[0])];
        println!("{name}: {there:.6} {back:.6}");
        // Single precision of the directions.
        assert!(there > 0.0 && (there / back - 1.0).abs() < 2e-5, "{name}: {there} {back}");
    }
}
