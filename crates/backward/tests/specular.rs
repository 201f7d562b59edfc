//! Mirrors and glass against closed forms.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::f64::consts::PI;

use dioptric_backward::{
    BandSampling, Bands, Camera, LightPaths, Pinhole, PixelGrid, Placement, RenderSettings, Renderer, Rendering,
};
use dioptric_optics::glam::DVec2;
use dioptric_spectrum::{Cancel, WavelengthGrid};
use dioptric_world::{
    Light, Material, Shape, SpectralCurve, Texture, TriangleMesh, World, WorldBuilder,
    glam::{DAffine3, DVec3, Vec3},
};

fn render(world: &World, n_pixels: usize, half_tangent: f64, paths: LightPaths) -> Rendering {
    let bands = Bands { grid: WavelengthGrid::new(vec![550.0]).unwrap(), sampling: BandSampling::Center };
    let camera = Camera::Pinhole(Pinhole {
        placement: Placement::IDENTITY,
        pixels: PixelGrid::new(n_pixels, n_pixels),
        half_tangents: DVec2::splat(half_tangent),
        layer: 0,
    });
    let settings = RenderSettings { bands, paths, samples_per_pass: 64, seed: 1, clamp: None };
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
        // Of 512 samples some 23 meet Russian roulette where little else varies: where none of them ends, the spread of the
        // passes does not show it. √(23 × (1/.95 − 1))/512 = .002.
        assert!((found - 1.0).abs() < 4.5 * error.hypot(0.002) && *error < 0.02, "{found} {error}");
    }
    let error = errors.iter().map(|e| e * e).sum::<f32>().sqrt() / picture.len() as f32;
    let mean = picture.mean().unwrap();
    assert!((mean - 1.0).abs() < 4.0 * error && error < 0.002, "{mean} {error}");
}
