//! Light behind arrays of small lenses and holes, against closed forms.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::f64::consts::PI;

use dioptric_backward::{
    BandSampling, Bands, Camera, LensCamera, LensCameraSettings, LensOrigin, LightPaths, MicroArray, MicroElements,
    MicroLayout, PixelGrid, Placement, RenderSettings, Renderer, Rendering, auxiliary,
};
use dioptric_optics::{Lens, glam::DVec2};
use dioptric_spectrum::{Cancel, WavelengthGrid};
use dioptric_world::{
    Light, Material, Shape, SpectralCurve, Texture, TriangleMesh, World, WorldBuilder,
    glam::{DAffine3, Vec3},
};

/// The plane of the array behind the lens, and the gap behind it, mm.
const ARRAY_MM: f64 = 54.0;
const GAP_MM: f64 = 0.4;
const PITCH_MM: f64 = 0.1;

fn lenses(diameter_mm: Option<f64>, layout: MicroLayout) -> MicroArray {
    let elements = MicroElements::Lenses { focal_length_mm: GAP_MM, diameter_mm };
    MicroArray { elements, pitch_mm: PITCH_MM, gap_mm: GAP_MM, layout, offset_mm: (0.0, 0.0), turned_deg: 0.0 }
}

fn bands() -> Bands {
    Bands { grid: WavelengthGrid::new(vec![550.0]).unwrap(), sampling: BandSampling::Center }
}

fn camera(lens: &Lens, array: MicroArray, film_size_mm: DVec2, pixels: PixelGrid) -> Camera {
    let settings = LensCameraSettings {
        film_distance_mm: ARRAY_MM + GAP_MM,
        film_size_mm,
        pixels,
        placement: Placement::IDENTITY,
        origin: LensOrigin::EntrancePupil,
        diffraction: None,
        micro_array: Some(array),
    };
    Camera::Lens(Box::new(LensCamera::new(lens, &bands(), settings).unwrap()))
}

/// Radiance 1 from everywhere.
fn sky() -> World {
    let mut builder = WorldBuilder::new();
    builder.add_light(Light::Sky { radiance: SpectralCurve::constant(1.0) });
    builder.build().unwrap()
}

fn render(camera: &Camera, samples_per_pass: u32, n_passes: u32) -> Rendering {
    let settings =
        RenderSettings { bands: bands(), paths: LightPaths::Emission, samples_per_pass, seed: 1, clamp: None };
    let world = sky();
    let mut renderer = Renderer::new(&world, camera, settings).unwrap();
    for _ in 0..n_passes {
        assert!(renderer.pass(&Cancel::new(), &|_| {}).unwrap());
    }
    renderer.rendering()
}

/// Irradiance and its standard error at a place of the film, mm to the right of the axis and above it.
fn at_place(lens: &Lens, array: MicroArray, [right_mm, up_mm]: [f64; 2]) -> (f64, f64) {
    // Pixels of half a micrometer.
    const N: usize = 4001;
    let pixel = |mm: f64| (0.5 * (N as f64 - 1.0) + mm / 0.5e-3).round() as usize;
    let part = PixelGrid::new(N, N).cropped((pixel(right_mm), pixel(-up_mm)), (1, 1)).unwrap();
    let picture = render(&camera(lens, array, DVec2::splat(0.5e-3 * N as f64), part), 1024, 4);
    let value = |image: &dioptric_spectrum::SpectralImage| f64::from(image.planes()[0][(0, 0)]);
    (value(&picture.picture), value(&picture.standard_error))
}

/// Irradiance by a uniform disc of radiance 1 as seen from its axis.
fn disc_irradiance(radius_mm: f64, distance_mm: f64) -> f64 {
    PI * radius_mm * radius_mm / (radius_mm * radius_mm + distance_mm * distance_mm)
}

/// Behind the middle of an element on the axis all of it shows the middle of the pupil, and nothing else is seen.
#[test]
fn element_shines_as_a_window() {
    let lens = Lens::thin(50.0, 6.0).unwrap();
    let square = {
        // Four corners of half a pitch, the form factor of a rectangle from below its corner.
        let (a, x) = (0.5 * PITCH_MM / GAP_MM, (0.5 * PITCH_MM / GAP_MM).hypot(1.0));
        4.0 * a / x * (a / x).atan()
    };
    let holes =
        MicroArray { elements: MicroElements::Holes { diameter_mm: 0.03 }, ..lenses(None, MicroLayout::Square) };
    for (array, expected) in [
        (lenses(None, MicroLayout::Square), square),
        (lenses(Some(0.08), MicroLayout::Square), disc_irradiance(0.04, GAP_MM)),
        (lenses(Some(0.1), MicroLayout::Hexagonal), disc_irradiance(0.05, GAP_MM)),
        (holes, disc_irradiance(0.015, GAP_MM)),
    ] {
        let (found, error) = at_place(&lens, array, [0.0, 0.0]);
        // Elements beside it are drawn too where the table of pupils cannot exclude them.
        let limit = 1e-3 + 4.0 * error / expected;
        assert!((found / expected - 1.0).abs() < limit && limit < 0.02, "{array:?}: {found} {expected} {error}");
    }
}

/// The image of a pupil of radius ρ, a distance Z before the array, has the radius ρ g/Z about c + (c − p) g/Z.
#[test]
fn pupil_image_ends_at_its_rim() {
    let lens = Lens::thin(50.0, 10.0).unwrap();
    let array = MicroArray { offset_mm: (0.03, -0.02), ..lenses(None, MicroLayout::Square) };
    let share = GAP_MM / ARRAY_MM;
    let radius_mm = 5.0 * share;
    for element in [[0.0, 0.0], [5.0, -3.0]] {
        let center_mm = [0, 1].map(|i| {
            let offset_mm = if i == 0 { 0.03 } else { -0.02 };
            (offset_mm + PITCH_MM * element[i]) * (1.0 + share)
        });
        for (way, times, is_lit) in
            [([1.0, 0.0], 0.97, true), ([1.0, 0.0], 1.03, false), ([0.6, -0.8], 0.97, true), ([0.6, -0.8], 1.03, false)]
        {
            let place = [0, 1].map(|i| center_mm[i] + times * radius_mm * way[i]);
            let (found, _) = at_place(&lens, array, place);
            assert_eq!(found > 0.0, is_lit, "{element:?} {way:?} {times}: {found}");
        }
    }
}

/// What crosses the array reaches the film: spread over (1 + g/Z)² of its area, less what rims take.
#[test]
fn array_keeps_light() {
    // Slow, so that cosines hardly differ before and behind the array.
    let lens = Lens::thin(50.0, 6.0).unwrap();
    let share = GAP_MM / ARRAY_MM;
    let row_step = 0.75_f64.sqrt();
    for (array, film_mm, fill) in [
        (lenses(None, MicroLayout::Square), DVec2::new(10.0, 10.0), 1.0),
        (lenses(Some(0.1), MicroLayout::Square), DVec2::new(10.0, 10.0), 0.25 * PI),
        (lenses(None, MicroLayout::Hexagonal), DVec2::new(10.0, 12.0 * row_step), 1.0),
        (lenses(Some(0.1), MicroLayout::Hexagonal), DVec2::new(10.0, 12.0 * row_step), 0.25 * PI / row_step),
    ] {
        // Whole periods of the images of the pupil.
        let film_mm = film_mm * PITCH_MM * (1.0 + share);
        let picture = render(&camera(&lens, array, film_mm, PixelGrid::new(40, 40)), 256, 4);
        let n = 1600.0;
        let mean = picture.picture.planes()[0].iter().map(|v| f64::from(*v)).sum::<f64>() / n;
        let variance: f64 = picture.standard_error.planes()[0].iter().map(|v| f64::from(*v).powi(2)).sum();
        let error = variance.sqrt() / n;
        let expected = fill * disc_irradiance(3.0, ARRAY_MM) / (1.0 + share).powi(2);
        // Light leaves an element of f/4 by slopes up to 1/8: cos⁴ is 1 − 2 ⟨e²⟩/f². Of squares p²/6, of hexagons 5 p²/36, of
        // discs p²/8.
        let second_mm2 = match (array.elements, array.layout) {
            (MicroElements::Lenses { diameter_mm: None, .. }, MicroLayout::Square) => 0.01 / 6.0,
            (MicroElements::Lenses { diameter_mm: None, .. }, MicroLayout::Hexagonal) => 0.05 / 36.0,
            _ => 0.01 / 8.0,
        };
        let cosines = 1.0 - 2.0 * second_mm2 / (GAP_MM * GAP_MM);
        let limit = 3e-3 + 4.0 * error / expected;
        assert!((mean / (expected * cosines) - 1.0).abs() < limit, "{array:?}: {} {limit}", mean / expected / cosines);
        assert!(limit < 0.02, "{limit}");
    }
}

#[test]
fn depth_behind_an_array_is_that_of_the_world() {
    let mut builder = WorldBuilder::new();
    let texture = builder.add_texture(Texture::Curve(SpectralCurve::constant(0.5)));
    let material = builder.add_material("gray", Material::Matte { reflectance: texture });
    let wall = TriangleMesh::quad(Vec3::new(-1.0, -1.0, 0.7), Vec3::X * 2.0, Vec3::Y * 2.0);
    builder.add_shape(Shape::Mesh(wall), DAffine3::IDENTITY, material, None);
    let world = builder.build().unwrap();
    let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(4.0, 550.0).unwrap();
    let array = lenses(None, MicroLayout::Hexagonal);
    let settings = LensCameraSettings {
        film_distance_mm: lens.at(550.0).unwrap().film_distance_mm_for(600.0).unwrap() + GAP_MM,
        film_size_mm: DVec2::new(6.0, 4.0),
        pixels: PixelGrid::new(30, 20),
        placement: Placement::IDENTITY,
        origin: LensOrigin::EntrancePupil,
        diffraction: None,
        micro_array: Some(array),
    };
    let camera = Camera::Lens(Box::new(LensCamera::new(&lens, &bands(), settings).unwrap()));
    let seen = auxiliary(&world, &camera, &bands().grid, &Cancel::new()).unwrap();
    assert!(seen.z_m.iter().all(|z_m| (z_m - 0.7).abs() < 1e-5));
}

#[test]
fn array_that_sees_too_much_is_refused() {
    let lens = Lens::thin(50.0, 25.0).unwrap();
    let settings = |array| LensCameraSettings {
        film_distance_mm: 60.0,
        film_size_mm: DVec2::splat(4.0),
        pixels: PixelGrid::new(4, 4),
        placement: Placement::IDENTITY,
        origin: LensOrigin::EntrancePupil,
        diffraction: None,
        micro_array: Some(array),
    };
    let message = |array| LensCamera::new(&lens, &bands(), settings(array)).unwrap_err().to_string();
    let far = MicroArray { gap_mm: 30.0, ..lenses(None, MicroLayout::Square) };
    assert!(message(far).contains("64 of its elements at most"));
    assert!(message(MicroArray { pitch_mm: -1.0, ..far }).contains("the pitch of the array in mm is -1"));
}
