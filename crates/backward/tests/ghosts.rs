//! Light that surfaces of a lens reflect, met from the film, against a closed form.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::f64::consts::{FRAC_PI_2, PI};

use dioptric_backward::{
    BandSampling, Bands, Camera, LensCamera, LensCameraSettings, LensOrigin, LightPaths, PixelGrid, Placement,
    RenderSettings, Renderer,
};
use dioptric_optics::{Coating, CoordinateBreak, Film, Glass, Interface, Lens, MirrorFilm, Surface, glam::DVec2};
use dioptric_spectrum::{Cancel, WavelengthGrid};
use dioptric_world::{Light, SpectralCurve, WorldBuilder};

const NM: f64 = 550.0;
const INDEX: f64 = 1.6;
const THICKNESS_MM: f64 = 2.0;
const RIM_MM: f64 = 12.0;
const FILM_MM: f64 = 9.0;

/// A bare plate.
fn plate() -> Lens {
    let interface = |medium_after, thickness_after_mm| Interface {
        surface: Surface::plane(RIM_MM),
        medium_after,
        thickness_after_mm,
    };
    let surfaces = vec![interface(Glass::Constant { index: INDEX }, THICKNESS_MM), interface(Glass::Air, 0.0)];
    Lens::new("plate", "a test", surfaces, 0).unwrap().with_light_loss(Some(Coating::Bare)).unwrap()
}

fn camera(lens: &Lens, bands: &Bands) -> LensCamera {
    camera_of(lens, bands, 1e-3, FILM_MM)
}

fn camera_of(lens: &Lens, bands: &Bands, film_width_mm: f64, film_distance_mm: f64) -> LensCamera {
    let settings = LensCameraSettings {
        film_distance_mm,
        film_size_mm: DVec2::splat(film_width_mm),
        pixels: PixelGrid::new(8, 8),
        placement: Placement::IDENTITY,
        origin: LensOrigin::EntrancePupil,
        diffraction: None,
        micro_array: None,
    };
    LensCamera::new(lens, bands, settings).unwrap()
}

/// The mean over the film under a sky of radiance 1, and its standard error.
fn irradiance(camera: LensCamera, bands: &Bands) -> (f64, f64) {
    let mut builder = WorldBuilder::new();
    builder.add_light(Light::Sky { radiance: SpectralCurve::constant(1.0) });
    let (world, camera) = (builder.build().unwrap(), Camera::Lens(Box::new(camera)));
    let settings =
        RenderSettings { bands: bands.clone(), paths: LightPaths::Full, samples_per_pass: 256, seed: 1, clamp: None };
    let mut renderer = Renderer::new(&world, &camera, settings).unwrap();
    for _ in 0..8 {
        renderer.pass(&Cancel::new(), &|_| {}).unwrap();
    }
    let found = renderer.rendering();
    let n = found.picture.planes()[0].len() as f64;
    let mean = found.picture.planes()[0].iter().map(|v| f64::from(*v)).sum::<f64>() / n;
    let error = found.standard_error.planes()[0].iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt() / n;
    (mean, error)
}

/// Of an even sky a plate sends ∫ T R² T cos θ dΩ to the film by two reflections, as far as its rims let light through.
#[test]
fn a_plates_ghosts_of_the_sky_are_those_of_fresnel() {
    let bands = Bands { grid: WavelengthGrid::new(vec![NM]).unwrap(), sampling: BandSampling::Center };
    let lens = plate();
    let (direct, _) = irradiance(camera(&lens, &bands), &bands);
    let (with_ghosts, error) = irradiance(camera(&lens, &bands).with_ghosts(0.0).unwrap(), &bands);
    // n_reflections 0 and 2, of rays that cross the plate once or three times.
    let expected = |n_reflections: i32| {
        let n = 20_000;
        let term = |i: usize| {
            let angle = FRAC_PI_2 * (i as f64 + 0.5) / f64::from(n);
            let inside = (angle.sin() / INDEX).asin();
            let reached_mm = FILM_MM * angle.tan() + f64::from(1 + n_reflections) * THICKNESS_MM * inside.tan();
            if reached_mm > RIM_MM {
                return 0.0;
            }
            let before = Film::new(1.0, &[], INDEX.into(), NM).shares(angle.cos());
            let behind = Film::new(INDEX, &[], 1.0.into(), NM).shares(inside.cos());
            let s = before.t_s * behind.r_s.powi(n_reflections) * behind.t_s;
            let p = before.t_p * behind.r_p.powi(n_reflections) * behind.t_p;
            0.5 * (s + p) * 2.0 * PI * angle.sin() * angle.cos() * FRAC_PI_2 / f64::from(n)
        };
        (0..n as usize).map(term).sum::<f64>()
    };
    assert!((direct / expected(0) - 1.0).abs() < 0.01, "{direct} {}", expected(0));
    // The same random numbers: what the difference has of noise is that of the ghosts alone, less than that of the sum.
    let ghosts = with_ghosts - direct;
    assert!(error < 0.05 * expected(2), "{error}");
    assert!((ghosts / expected(2) - 1.0).abs() < 0.02, "{ghosts} {} {error}", expected(2));
}

/// Veiling glare of a whole lens: what even light from all sides adds in the middle of the film.
#[test]
fn veiling_glare_of_a_lens_is_that_of_rendered_ghosts() {
    let film_mm = 37.0;
    let bands = Bands { grid: WavelengthGrid::new(vec![NM]).unwrap(), sampling: BandSampling::Center };
    let lens = Lens::built_in("dgauss-50mm").unwrap().with_light_loss(Some(Coating::Bare)).unwrap();
    let expected =
        lens.at(NM).unwrap().veiling_glare(DVec2::ZERO, &MirrorFilm::dark(film_mm), 100_000).unwrap().unwrap();
    let camera = || camera_of(&lens, &bands, 1e-3, film_mm);
    let (direct, _) = irradiance(camera(), &bands);
    let (with_ghosts, error) = irradiance(camera().with_ghosts(0.0).unwrap(), &bands);
    let (found, noise) = (with_ghosts / direct - 1.0, error / direct);
    assert!(noise < 0.05 * expected && (found - expected).abs() < 2.5 * noise, "{found} {expected} {noise}");
}

/// A film that reflects: what the plate sends back to it of an even sky, by rays that go straight through the plate unfolded.
#[test]
fn a_films_ghosts_are_those_of_unfolded_rays() {
    const WIDTH_MM: f64 = 10.0;
    const REFLECTANCE: f64 = 0.4;
    let bands = Bands { grid: WavelengthGrid::new(vec![NM]).unwrap(), sampling: BandSampling::Center };
    let lens = plate();
    let of = |reflectance: f64| {
        let camera = camera_of(&lens, &bands, WIDTH_MM, FILM_MM).with_ghosts(reflectance).unwrap();
        irradiance(camera, &bands)
    };
    let ((dark, _), (bright, error)) = (of(0.0), of(REFLECTANCE));
    // From places of the film, in directions by their cosine: the ways by the film and the plate's near face, and its far one.
    let n = 60;
    let middle = |i: usize| (i as f64 + 0.5) / f64::from(n);
    let mut sum = 0.0;
    for (i, j, k, l) in (0..n * n).flat_map(|p| (0..n * n).map(move |d| (p / n, p % n, d / n, d % n))) {
        // Every place with every direction would be too many.
        if (i + 3 * j + 5 * k + 7 * l) % 12 != 0 {
            continue;
        }
        let [i, j, k, l] = [i, j, k, l].map(|v| middle(v as usize));
        let start_mm = WIDTH_MM * DVec2::new(i - 0.5, j - 0.5);
        let sine = k.sqrt();
        let to = DVec2::from_angle(2.0 * PI * l);
        let (out, inside) = (sine.asin().tan() * to, (sine / INDEX).asin().tan() * to);
        // After so many ways between film and plate, and so many through the plate.
        let at = |n_air: i32, n_glass: i32| {
            start_mm + f64::from(n_air) * FILM_MM * out + f64::from(n_glass) * THICKNESS_MM * inside
        };
        let within = |places: &[(i32, i32)]| places.iter().all(|&(air, glass)| at(air, glass).length() <= RIM_MM);
        let on_film = |n_air: i32, n_glass: i32| at(n_air, n_glass).abs().max_element() <= 0.5 * WIDTH_MM;
        let before = Film::new(1.0, &[], INDEX.into(), NM).shares((1.0 - k).sqrt());
        let behind = Film::new(INDEX, &[], 1.0.into(), NM).shares((1.0 - k / INDEX / INDEX).sqrt());
        let both = |of: &dyn Fn(f64, f64, f64) -> f64| {
            0.5 * (of(before.t_s, before.r_s, behind.t_s) + of(before.t_p, before.r_p, behind.t_p))
        };
        if on_film(2, 0) && within(&[(1, 0), (3, 0), (3, 1)]) {
            sum += both(&|t, r, t_out| r * t * t_out);
        }
        if on_film(2, 2) && within(&[(1, 0), (1, 1), (1, 2), (3, 2), (3, 3)]) {
            sum += both(&|t, r, t_out| (t * t_out).powi(2) * r);
        }
    }
    let expected = PI * REFLECTANCE * 12.0 * sum / f64::from(n).powi(4);
    let found = bright - dark;
    assert!(error < 0.05 * expected && (found / expected - 1.0).abs() < 0.03, "{found} {expected} {error}");
}

#[test]
fn lenses_without_losses_have_no_ghosts_and_tilted_ones_are_refused() {
    let bands = Bands { grid: WavelengthGrid::new(vec![NM]).unwrap(), sampling: BandSampling::Center };
    let lossless = plate().with_light_loss(None).unwrap();
    assert!(!camera(&lossless, &bands).with_ghosts(0.0).unwrap().has_ghosts());
    let tilt = CoordinateBreak {
        surfaces: (0, 1),
        pivot_mm: 0.0,
        decenter_mm: [0.0; 3],
        tilt_deg: [2.0, 0.0, 0.0],
        tilt_first: false,
    };
    let tilted = plate().with_moves(vec![tilt]).unwrap();
    let message = camera(&tilted, &bands).with_ghosts(0.0).unwrap_err().to_string();
    assert!(message.contains("centered lenses without mirrors"), "{message}");
}
