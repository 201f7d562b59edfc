//! Pictures of worlds whose light is known in closed form.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::f64::consts::PI;

use dioptric_backward::{
    BackwardError, BandSampling, Bands, Camera, LensCamera, LensCameraSettings, LensOrigin, LightPaths, Pinhole,
    PixelGrid, Placement, RenderSettings, Renderer, Rendering, ThinLens, auxiliary, layered_depth, write_auxiliary_exr,
    write_rendering_exr,
};
use dioptric_diffraction::Hurb;
use dioptric_optics::{CoordinateBreak, Glass, Lens, glam::DVec2};
use dioptric_spectrum::{Cancel, WavelengthGrid};
use dioptric_world::{
    Emission, Light, Material, Shape, SpectralCurve, Texture, TriangleMesh, World, WorldBuilder,
    glam::{DAffine3, DVec3, Vec3},
};

fn bands(centers_nm: &[f64]) -> Bands {
    Bands { grid: WavelengthGrid::new(centers_nm.to_vec()).unwrap(), sampling: BandSampling::Center }
}

fn settings(bands: &Bands, samples_per_pass: u32) -> RenderSettings {
    RenderSettings { bands: bands.clone(), paths: LightPaths::Full, samples_per_pass, seed: 1, clamp: None }
}

/// Radiance 1 from everywhere.
fn sky() -> World {
    let mut builder = WorldBuilder::new();
    builder.add_light(Light::Sky { radiance: SpectralCurve::constant(1.0) });
    builder.build().unwrap()
}

/// Adds a surface of this albedo and glow.
fn add_gray(builder: &mut WorldBuilder, shape: Shape, albedo: f32, radiance: f32) {
    let texture = builder.add_texture(Texture::Curve(SpectralCurve::constant(albedo)));
    let material = builder.add_material("gray", Material::Matte { reflectance: texture });
    let emission = Emission { radiance: SpectralCurve::constant(radiance), is_two_sided: true };
    builder.add_shape(shape, DAffine3::IDENTITY, material, (radiance > 0.0).then_some(emission));
}

fn quad(corner: [f32; 3], x_m: f32, y_m: f32) -> Shape {
    Shape::Mesh(TriangleMesh::quad(Vec3::from_array(corner), Vec3::X * x_m, Vec3::Y * y_m))
}

fn pinhole(n_pixels: usize, half_tangent: f64) -> Pinhole {
    Pinhole {
        placement: Placement::IDENTITY,
        pixels: PixelGrid::new(n_pixels, n_pixels),
        half_tangents: DVec2::splat(half_tangent),
        layer: 0,
    }
}

/// A lens with this film, of so many pixels, looking along +z with its entrance pupil at the origin.
fn lens_settings(film_distance_mm: f64, film_size_mm: f64, n_pixels: usize) -> LensCameraSettings {
    LensCameraSettings {
        film_distance_mm,
        film_size_mm: DVec2::splat(film_size_mm),
        pixels: PixelGrid::new(n_pixels, n_pixels),
        placement: Placement::IDENTITY,
        origin: LensOrigin::EntrancePupil,
        diffraction: None,
        micro_array: None,
    }
}

fn camera(lens: &Lens, bands: &Bands, settings: LensCameraSettings) -> Camera {
    Camera::Lens(Box::new(LensCamera::new(lens, bands, settings).unwrap()))
}

fn pass(renderer: &mut Renderer<'_>) -> bool {
    renderer.pass(&Cancel::new(), &|_| {}).unwrap()
}

fn render(world: &World, camera: &Camera, settings: RenderSettings, n_passes: u32) -> Rendering {
    let mut renderer = Renderer::new(world, camera, settings).unwrap();
    for _ in 0..n_passes {
        assert!(pass(&mut renderer));
    }
    renderer.rendering()
}

/// Mean of a band over the picture, and its standard error.
fn mean(rendering: &Rendering, band: usize) -> (f64, f64) {
    let plane = &rendering.picture.planes()[band];
    let n = plane.len() as f64;
    let variance: f64 = rendering.standard_error.planes()[band].iter().map(|e| f64::from(*e).powi(2)).sum();
    (plane.iter().map(|v| f64::from(*v)).sum::<f64>() / n, variance.sqrt() / n)
}

/// Irradiance by a uniform disc of radius a and radiance 1, at the distance v and h off its axis.
fn disc_irradiance(a: f64, v: f64, h: f64) -> f64 {
    let (sum, difference) = (v * v + h * h + a * a, v * v + h * h - a * a);
    0.5 * PI * (1.0 - difference / (sum * sum - 4.0 * h * h * a * a).sqrt())
}

#[test]
fn uniform_plane_follows_working_f_number() {
    let bands = bands(&[550.0]);
    let gauss = Lens::built_in("dgauss-50mm").unwrap();
    for (f_number, tolerance) in [(8.0, 0.003), (4.0, 0.006), (2.03, 0.02)] {
        let lens = gauss.with_f_number(f_number, 550.0).unwrap();
        let mono = lens.at(550.0).unwrap();
        for distance_mm in [8_000.0, 500.0] {
            let film_distance_mm = mono.film_distance_mm_for(distance_mm).unwrap();
            let picture = render(
                &sky(),
                &camera(&lens, &bands, lens_settings(film_distance_mm, 0.05, 1)),
                settings(&bands, 4096),
                6,
            );
            let expected = PI / (4.0 * mono.working_f_number(distance_mm).powi(2));
            let (found, error) = mean(&picture, 0);
            assert!(error < 7e-4 * expected, "f/{f_number}: {}", error / expected);
            assert!((found / expected - 1.0).abs() < tolerance, "f/{f_number} at {distance_mm}: {}", found / expected);
        }
    }
}

#[test]
fn thin_lens_and_pinhole_follow_closed_form() {
    let bands = bands(&[550.0]);
    for (lens, radius_mm) in [(Lens::thin(50.0, 12.5).unwrap(), 6.25), (Lens::pinhole(0.4).unwrap(), 0.2)] {
        for (pixel, x_mm) in [((20, 20), 0.0), ((40, 20), -20.0 * 40.0 / 41.0)] {
            let mut of_pixel = lens_settings(52.0, 40.0, 41);
            of_pixel.pixels = of_pixel.pixels.cropped(pixel, (1, 1)).unwrap();
            let picture = render(&sky(), &camera(&lens, &bands, of_pixel), settings(&bands, 4096), 6);
            let (found, error) = mean(&picture, 0);
            let expected = disc_irradiance(radius_mm, 52.0, x_mm);
            // The pixel's own width changes the value at its middle by 1e-4.
            let limit = 2e-4 + 4.0 * error / expected;
            assert!((found / expected - 1.0).abs() < limit, "{}: {} {limit}", lens.name(), found / expected);
            assert!(limit < 4e-3, "{limit}");
        }
    }
}

#[test]
fn immersion_lowers_irradiance_by_index_squared() {
    let bands = bands(&[550.0]);
    let lens = Lens::thin(50.0, 12.5).unwrap().with_object_medium(Glass::Constant { index: 1.333 }).unwrap();
    let picture = render(&sky(), &camera(&lens, &bands, lens_settings(52.0, 0.1, 1)), settings(&bands, 4096), 4);
    let (found, error) = mean(&picture, 0);
    let expected = disc_irradiance(6.25, 52.0, 0.0) / (1.333 * 1.333);
    assert!((found / expected - 1.0).abs() < 1e-4 + 4.0 * error / expected, "{}", found / expected);
}

#[test]
fn camera_turned_as_whole_sees_same_sky() {
    let bands = bands(&[550.0]);
    let lens = Lens::built_in("dgauss-50mm").unwrap();
    let turn = CoordinateBreak {
        surfaces: (0, lens.interfaces().len()),
        pivot_mm: 12.0,
        decenter_mm: [5.0, -3.0, 1.0],
        tilt_deg: [20.0, -10.0, 5.0],
        tilt_first: false,
    };
    let turned = lens.clone().with_moves(vec![turn]).unwrap();
    let [straight, turned] = [lens, turned]
        .map(|lens| render(&sky(), &camera(&lens, &bands, lens_settings(36.4, 30.0, 3)), settings(&bands, 2048), 4));
    // The corners are vignetted most; the mean of four is good to 0.13 % in each picture.
    let corners =
        |r: &Rendering| [(0, 0), (0, 2), (2, 0), (2, 2)].map(|at| r.picture.planes()[0][at]).iter().sum::<f32>();
    let (found, expected) = (mean(&turned, 0).0, mean(&straight, 0).0);
    assert!((found / expected - 1.0).abs() < 2e-3, "{found} {expected}");
    assert!((corners(&turned) / corners(&straight) - 1.0).abs() < 5e-3, "{} {}", corners(&turned), corners(&straight));
}

#[test]
fn picture_does_not_move_with_bounds() {
    let bands = bands(&[450.0, 650.0]);
    let lens = Lens::built_in("dgauss-50mm").unwrap();
    let tight = LensCamera::new(&lens, &bands, lens_settings(36.6, 30.0, 5)).unwrap();
    let wide = tight.with_inflated_bounds(1.3);
    let [tight, wide] =
        [tight, wide].map(|camera| render(&sky(), &Camera::Lens(Box::new(camera)), settings(&bands, 2048), 6));
    for band in 0..2 {
        let ((a, _), (b, error)) = (mean(&tight, band), mean(&wide, band));
        assert!(error < 4e-4 * b && (b / a - 1.0).abs() < 1e-3, "{band}: {} ({error})", b / a);
        // Corners, which are vignetted most.
        let corner = |r: &Rendering| r.picture.planes()[band][(0, 0)];
        assert!((corner(&wide) / corner(&tight) - 1.0).abs() < 0.01, "{band}: {} {}", corner(&wide), corner(&tight));
    }
}

/// Each reflection adds half of what came before: 1 + 1/2 + 1/4 …
#[test]
fn furnace_glows_twice_its_emission() {
    let mut builder = WorldBuilder::new();
    add_gray(&mut builder, Shape::Sphere { radius_m: 2.0 }, 0.5, 1.0);
    let world = builder.build().unwrap();
    let bands = bands(&[450.0, 550.0]);
    let camera = Camera::Pinhole(pinhole(8, 0.5));
    let picture = render(&world, &camera, settings(&bands, 64), 16);
    for band in 0..2 {
        let (found, error) = mean(&picture, band);
        assert!(error < 0.004 && (found - 2.0).abs() < 4.0 * error, "{found} {error}");
    }
    let limited = |paths| {
        let settings = RenderSettings { paths, ..settings(&bands, 64) };
        mean(&render(&world, &camera, settings, 8), 0)
    };
    assert_eq!(limited(LightPaths::Emission).0, 1.0);
    for (paths, expected) in [(LightPaths::Direct, 1.5), (LightPaths::UpTo(3), 1.875)] {
        let (found, error) = limited(paths);
        // Where every sample is the same, the rounding of single precision is left.
        assert!((found - expected).abs() < 4.0 * error + 1e-6, "{found} {expected} {error}");
    }
}

/// A square lamp 1 m before a wall, by the form factor of a rectangle.
#[test]
fn lamp_lights_wall_by_its_form_factor() {
    let mut builder = WorldBuilder::new();
    add_gray(&mut builder, quad([-1.0, -1.0, 3.0], 2.0, 2.0), 0.5, 0.0);
    // Beside the view.
    add_gray(&mut builder, quad([-0.5, 0.5, 2.0], 1.0, 1.0), 0.0, 3.0);
    let world = builder.build().unwrap();
    let bands = bands(&[550.0]);
    let picture = render(&world, &Camera::Pinhole(pinhole(1, 1e-3)), settings(&bands, 256), 16);
    let (found, error) = mean(&picture, 0);
    // Of a rectangle a × b a unit away, seen from below its corner; summed and differenced over corners.
    let corner = |a: f64, b: f64| {
        let (x, y) = (a.hypot(1.0), b.hypot(1.0));
        (a / x * (b / x).atan() + b / y * (a / y).atan()) / (2.0 * PI)
    };
    let factor = 2.0 * (corner(0.5, 1.5) - corner(0.5, 0.5));
    let expected = 3.0 * factor * 0.5;
    assert!(error < 0.01 * expected && (found - expected).abs() < 4.0 * error, "{found} {expected} {error}");
}

/// A wall 2 m away, its albedo one half, and a lamp of intensity 1 between it and the camera, aside and above.
fn lamp_and_wall() -> World {
    let mut builder = WorldBuilder::new();
    add_gray(&mut builder, quad([-1.0, -1.0, 2.0], 2.0, 2.0), 0.5, 0.0);
    builder.add_light(Light::Point { position: LAMP_M, intensity: SpectralCurve::constant(1.0) });
    builder.build().unwrap()
}

const LAMP_M: DVec3 = DVec3::new(0.5, 0.5, 1.0);

/// Radiance of that wall, ρ/π I cos θ / d².
fn wall_radiance(x_m: f64, y_m: f64) -> f64 {
    let to_lamp = LAMP_M - DVec3::new(x_m, y_m, 2.0);
    0.5 / PI * -to_lamp.z / to_lamp.length().powi(3)
}

#[test]
fn pinhole_sees_lit_wall_in_closed_form() {
    let (bands, n, half_tangent) = (bands(&[450.0, 650.0]), 9, 0.12);
    let picture = render(&lamp_and_wall(), &Camera::Pinhole(pinhole(n, half_tangent)), settings(&bands, 64), 4);
    let at_m = |pixel: usize| 2.0 * half_tangent * (2.0 * (pixel as f64 + 0.5) / n as f64 - 1.0);
    for ((row, column), &found) in picture.picture.planes()[1].indexed_iter() {
        let expected = wall_radiance(at_m(column), -at_m(row));
        let error = f64::from(picture.standard_error.planes()[1][(row, column)]);
        // The pixel's width of 53 mm changes the value at its middle by w²/24 times the second derivatives, 15 r²/d⁴ − 6/d² or
        // up to 3.4 per m²: 4e-4.
        let limit = 5e-4 * expected + 4.0 * error;
        assert!((f64::from(found) - expected).abs() < limit, "{row} {column}: {found} {expected} {error}");
        assert!(limit < 1.5e-3 * expected, "{limit}");
    }
}

#[test]
fn lens_sees_lit_wall_in_closed_form() {
    let (bands, world) = (bands(&[550.0]), lamp_and_wall());
    let (film_mm, n) = (10.0, 41);
    let gauss = Lens::built_in("dgauss-50mm").unwrap().with_f_number(8.0, 550.0).unwrap();
    for (lens, pixels) in [
        (Lens::thin(50.0, 6.25).unwrap(), vec![(20, 20), (36, 8), (3, 39)]),
        (Lens::pinhole(0.4).unwrap(), vec![(20, 20), (36, 8)]),
        // On the axis, where its working f-number is all that counts.
        (gauss, vec![(20, 20)]),
    ] {
        let mono = lens.at(550.0).unwrap();
        let is_ideal = lens.interfaces().len() == 1;
        let from_lens_mm = 2_000.0 - if is_ideal { 0.0 } else { mono.projection_center_z_mm() };
        let film_distance_mm = mono.film_distance_mm_for(from_lens_mm).unwrap_or(50.0);
        for (column, row) in pixels {
            let mut of_pixel = lens_settings(film_distance_mm, film_mm, n);
            of_pixel.pixels = of_pixel.pixels.cropped((column, row), (1, 1)).unwrap();
            let picture = render(&world, &camera(&lens, &bands, of_pixel), settings(&bands, 4096), 6);
            let (found, error) = mean(&picture, 0);
            let at_mm = |pixel: usize| film_mm * ((pixel as f64 + 0.5) / n as f64 - 0.5);
            let at_m = |pixel: usize| 2.0 * at_mm(pixel) / film_distance_mm;
            let per_radiance = match is_ideal {
                true => {
                    let radius_mm = mono.stop_semi_aperture_mm();
                    disc_irradiance(radius_mm, film_distance_mm, at_mm(column).hypot(at_mm(row)))
                }
                false => PI / (4.0 * mono.working_f_number(from_lens_mm).powi(2)),
            };
            let expected = per_radiance * wall_radiance(at_m(column), -at_m(row));
            // The 0.3 % for a real lens at f/8; 2e-4 for the pixel's own width.
            let limit = if is_ideal { 2e-4 } else { 3e-3 } + 4.0 * error / expected;
            assert!((found / expected - 1.0).abs() < limit, "{} {column}: {}", lens.name(), found / expected);
            assert!(limit < 6e-3, "{limit}");
        }
    }
}

#[test]
fn picture_is_upright() {
    let mut builder = WorldBuilder::new();
    // To the right of the axis and above it.
    add_gray(&mut builder, quad([0.1, 0.2, 2.0], 0.1, 0.1), 0.0, 1.0);
    let world = builder.build().unwrap();
    let bands = bands(&[550.0]);
    let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(8.0, 550.0).unwrap();
    let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2_000.0).unwrap();
    let view = pinhole(16, 0.16);
    let thin = ThinLens { view, radius_m: 0.003, focus_distance_m: 2.0 };
    let through_lens = camera(&lens, &bands, lens_settings(film_distance_mm, 16.0, 16));
    for camera in [through_lens, Camera::Pinhole(view), Camera::ThinLens(thin)] {
        let picture = render(&world, &camera, settings(&bands, 16), 2);
        let plane = &picture.picture.planes()[0];
        let sum = |value: &dyn Fn((usize, usize)) -> usize| {
            plane.indexed_iter().map(|(place, v)| value(place) as f32 * v).sum::<f32>() / plane.iter().sum::<f32>()
        };
        let (row, column) = (sum(&|place| place.0), sum(&|place| place.1));
        // At .15 and .25 of 2 m, .075 and .125 of .16.
        assert!((row - 1.25).abs() < 0.4 && (column - 11.25).abs() < 0.4, "{row} {column}");
    }
}

/// The edge spread of an ideal lens in focus is the integral of the line spread that the forward way has, in units of λN.
#[test]
fn knife_edge_has_the_forward_kernel() {
    let mut builder = WorldBuilder::new();
    add_gray(&mut builder, quad([0.0, -5.0, 2.0], 10.0, 10.0), 0.0, 1.0);
    let world = builder.build().unwrap();
    let bands = bands(&[550.0]);
    let lens = Lens::thin(50.0, 50.0 / 16.0).unwrap();
    let mono = lens.at(550.0).unwrap();
    let film_distance_mm = mono.film_distance_mm_for(2_000.0).unwrap();
    let (n_pixels, film_um) = (40, 80.0);
    let mut of_lens = lens_settings(film_distance_mm, 1e-3 * film_um, n_pixels);
    of_lens.pixels = of_lens.pixels.cropped((0, 18), (n_pixels, 4)).unwrap();
    of_lens.diffraction = Some(Hurb::PAPER);
    let picture = render(&world, &camera(&lens, &bands, of_lens), settings(&bands, 64), 16);
    let unit_um = 0.55 * mono.working_f_number(2_000.0);
    let lit = disc_irradiance(50.0 / 32.0, film_distance_mm, 0.0);
    // The integral of the line spread up to the edges and the middles of the pixels, by Simpson's rule.
    let half_step = 0.5 * film_um / n_pixels as f64 / unit_um;
    let lsf = |at: f64| Hurb::PAPER.lsf(at);
    let mut edge_spread = vec![0.5];
    for i in 0..n_pixels {
        let from = i as f64 * half_step;
        let step = half_step / 6.0 * (lsf(from) + 4.0 * lsf(from + 0.5 * half_step) + lsf(from + half_step));
        edge_spread.push(edge_spread[i] + step);
    }
    let spread_at = |place: i64| {
        let far = edge_spread[place.unsigned_abs() as usize];
        if place < 0 { 1.0 - far } else { far }
    };
    let (mut chi2, mut largest) = (0.0, 0.0_f64);
    for column in 0..n_pixels {
        // The mean over the pixel by Simpson's rule.
        let middle = 2 * column as i64 + 1 - n_pixels as i64;
        let spread = [-1, 0, 1].map(|d| spread_at(middle + d));
        let expected = lit * (spread[0] + 4.0 * spread[1] + spread[2]) / 6.0;
        let column_of = |plane: &dioptric_spectrum::SpectralImage| {
            (0..4).map(|row| f64::from(plane.planes()[0][(row, column)])).collect::<Vec<f64>>()
        };
        let found = column_of(&picture.picture).iter().sum::<f64>() / 4.0;
        let variance = column_of(&picture.standard_error).iter().map(|e| e * e).sum::<f64>() / 16.0;
        // The closed form takes sines for tangents, 5e-4 of the light at f/16.
        let sigma = (variance + (5e-4 * lit).powi(2)).sqrt();
        chi2 += ((found - expected) / sigma).powi(2) / n_pixels as f64;
        largest = largest.max(((found - expected) / sigma).abs());
    }
    // Forty pixels: the largest of as many normal numbers exceeds 4 once in four hundred times.
    assert!(largest < 4.0 && chi2 < 1.8, "{largest} {chi2}");
}

/// A small scene with much light and little.
fn busy_world() -> World {
    let mut builder = WorldBuilder::new();
    add_gray(&mut builder, quad([-1.0, -1.0, 3.0], 2.0, 2.0), 0.6, 0.0);
    add_gray(&mut builder, quad([-0.3, 0.1, 1.5], 0.2, 0.2), 0.2, 5.0);
    builder.add_light(Light::Sky { radiance: SpectralCurve::constant(0.05) });
    builder.build().unwrap()
}

fn busy_camera(bands: &Bands) -> Camera {
    let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(4.0, 550.0).unwrap();
    let diffraction = Some(Hurb::PAPER);
    camera(&lens, bands, LensCameraSettings { diffraction, ..lens_settings(37.4, 20.0, 36) })
}

#[test]
fn threads_change_no_bit() {
    let bands = bands(&[450.0, 550.0, 650.0]);
    let (world, camera) = (busy_world(), busy_camera(&bands));
    let with = |n_threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        pool.install(|| render(&world, &camera, settings(&bands, 4), 2))
    };
    let (one, four) = (with(1), with(4));
    assert_eq!(one.picture, four.picture);
    assert_eq!(one.standard_error, four.standard_error);
}

#[test]
fn crop_draws_what_whole_draws() {
    let bands = bands(&[450.0, 650.0]);
    let world = busy_world();
    let lens = Lens::built_in("dgauss-50mm").unwrap();
    let whole = lens_settings(37.4, 20.0, 40);
    let crop = LensCameraSettings { pixels: whole.pixels.cropped((11, 7), (20, 21)).unwrap(), ..whole.clone() };
    let [whole, crop] = [whole, crop].map(|of| render(&world, &camera(&lens, &bands, of), settings(&bands, 2), 1));
    for ((row, column), value) in crop.picture.planes()[1].indexed_iter() {
        assert_eq!(*value, whole.picture.planes()[1][(row + 7, column + 11)]);
    }
}

#[test]
fn resumed_rendering_has_same_bits() {
    let bands = bands(&[450.0, 550.0]);
    let (world, camera) = (busy_world(), busy_camera(&bands));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("state");
    let begin = || Renderer::new(&world, &camera, settings(&bands, 4)).unwrap();
    let mut whole = begin();
    pass(&mut whole);
    pass(&mut whole);
    whole.aim_at_noise(0.05, 4).unwrap();
    whole.save(&path, "busy").unwrap();
    let mut resumed = begin();
    resumed.resume(&path, "busy").unwrap();
    assert_eq!(resumed.n_passes(), 2);
    for renderer in [&mut whole, &mut resumed] {
        pass(renderer);
        pass(renderer);
    }
    assert_eq!(whole.rendering().picture, resumed.rendering().picture);
    assert_eq!(whole.rendering().n_samples, resumed.rendering().n_samples);
    // Nothing else resumes.
    let message = |found: Result<(), BackwardError>| found.unwrap_err().to_string();
    assert!(message(begin().resume(&path, "another")).contains("is of another rendering"));
    let mut other = Renderer::new(&world, &camera, RenderSettings { seed: 2, ..settings(&bands, 4) }).unwrap();
    assert!(message(other.resume(&path, "busy")).contains("is of another rendering"));
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() - 3]).unwrap();
    assert!(message(begin().resume(&path, "busy")).contains("is not what a picture of this size takes"));
    std::fs::write(&path, "no").unwrap();
    assert!(message(begin().resume(&path, "busy")).contains("is no checkpoint"));
}

/// The library that writes the files keeps their attributes in no order.
#[test]
fn equal_renderings_are_equal_files() {
    let bands = bands(&[450.0, 550.0]);
    let (world, camera) = (busy_world(), busy_camera(&bands));
    let rendering = render(&world, &camera, settings(&bands, 2), 1);
    let seen = auxiliary(&world, &camera, &bands.grid, &Cancel::new()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let bytes = |name: usize| {
        let [picture, aside] = ["picture", "aside"].map(|what| folder.path().join(format!("{what}{name}.exr")));
        write_rendering_exr(&picture, &rendering, Some(&seen.z_m)).unwrap();
        write_auxiliary_exr(&aside, &seen).unwrap();
        [picture, aside].map(|path| std::fs::read(path).unwrap())
    };
    let first = bytes(0);
    assert!((1..8).all(|name| bytes(name) == first));
}

#[test]
fn cancelled_pass_leaves_picture() {
    let bands = bands(&[450.0, 550.0]);
    let (world, camera) = (busy_world(), busy_camera(&bands));
    let mut renderer = Renderer::new(&world, &camera, settings(&bands, 4)).unwrap();
    pass(&mut renderer);
    let before = renderer.rendering().picture;
    let cancel = Cancel::new();
    let stopped = renderer.pass(&cancel, &|share| {
        if share > 0.2 {
            cancel.cancel();
        }
    });
    assert!(matches!(stopped, Err(BackwardError::Cancelled(_))));
    assert_eq!(renderer.rendering().picture, before);
    assert_eq!(renderer.n_passes(), 1);
}

/// A choice by a pixel's own first samples would darken pixels in which they missed the lamp.
#[test]
fn adaptive_sampling_has_no_bias() {
    let bands = bands(&[550.0]);
    let (world, camera) = (busy_world(), busy_camera(&bands));
    let (even, even_error) = mean(&render(&world, &camera, settings(&bands, 16), 16), 0);
    let (mut found, mut n_samples) = (Vec::new(), 0);
    for seed in 0..6 {
        let mut renderer =
            Renderer::new(&world, &camera, RenderSettings { seed: 100 + seed, ..settings(&bands, 2) }).unwrap();
        for _ in 0..3 {
            pass(&mut renderer);
        }
        renderer.aim_at_noise(0.2, 40).unwrap();
        while pass(&mut renderer) {}
        let rendering = renderer.rendering();
        let (least, most) = (rendering.n_samples.iter().min().unwrap(), rendering.n_samples.iter().max().unwrap());
        assert!(least < most, "{least} {most}");
        n_samples += rendering.n_samples.iter().sum::<u32>() / rendering.n_samples.len() as u32;
        found.push(mean(&rendering, 0).0);
    }
    assert!(n_samples / 6 < 70, "{n_samples}");
    let n = found.len() as f64;
    let average = found.iter().sum::<f64>() / n;
    let variance = found.iter().map(|v| (v - average).powi(2)).sum::<f64>() / (n - 1.0);
    let error = (variance / n).sqrt().hypot(even_error);
    assert!((average - even).abs() < 4.0 * error && error < 0.01 * even, "{average} {even} {error}");
}

/// On a film twice as wide as the lens's image pixels at its rim need most, and those beyond it no more than the first passes.
#[test]
fn adaptive_sampling_leaves_out_what_the_lens_does_not_see() {
    let bands = bands(&[550.0]);
    let (world, lens) = (sky(), Lens::built_in("dgauss-50mm").unwrap());
    let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2_000.0).unwrap();
    let camera = camera(&lens, &bands, lens_settings(film_distance_mm, 90.0, 24));
    let even = mean(&render(&world, &camera, settings(&bands, 64), 16), 0);
    let mut found = Vec::new();
    for seed in 0..24 {
        let of_seed = RenderSettings { seed: 100 + seed, ..settings(&bands, 4) };
        let mut renderer = Renderer::new(&world, &camera, of_seed).unwrap();
        (0..4).for_each(|_| assert!(pass(&mut renderer)));
        renderer.aim_at_noise(0.1, 400).unwrap();
        while pass(&mut renderer) {}
        let rendering = renderer.rendering();
        let at = |row: usize, column: usize| rendering.n_samples[(row, column)];
        assert_eq!([at(0, 0), at(12, 0), at(0, 12)], [16; 3]);
        assert!(rendering.n_samples.iter().any(|&n| n > 2 * at(12, 12)));
        found.push(mean(&rendering, 0).0);
    }
    let n = found.len() as f64;
    let average = found.iter().sum::<f64>() / n;
    let variance = found.iter().map(|v| (v - average).powi(2)).sum::<f64>() / (n - 1.0);
    let error = (variance / n).sqrt().hypot(even.1);
    assert!((average - even.0).abs() < 4.0 * error && error < 2e-3 * even.0, "{average} {even:?} {error}");
}

#[test]
fn depth_is_from_the_entrance_pupil() {
    let mut builder = WorldBuilder::new();
    add_gray(&mut builder, quad([-5.0, -5.0, 4.0], 10.0, 10.0), 0.25, 0.0);
    add_gray(&mut builder, quad([0.0, -0.5, 2.0], 0.5, 1.0), 0.5, 0.0);
    let world = builder.build().unwrap();
    let bands = bands(&[550.0, 650.0]);
    let lens = Lens::built_in("dgauss-50mm").unwrap();
    let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2_000.0).unwrap();
    let view = pinhole(16, 0.16);
    for camera in [camera(&lens, &bands, lens_settings(film_distance_mm, 16.0, 16)), Camera::Pinhole(view)] {
        let seen = auxiliary(&world, &camera, &bands.grid, &Cancel::new()).unwrap();
        for ((row, column), &z_m) in seen.z_m.indexed_iter() {
            let (expected, albedo) = if column >= 8 { (2.0, 0.5) } else { (4.0, 0.25) };
            assert!((z_m - expected).abs() < 1e-5, "{row} {column}: {z_m}");
            assert_eq!(seen.albedo.planes()[0][(row, column)], albedo);
            assert_eq!(seen.normal[2][(row, column)], -1.0);
            assert_eq!(seen.material[(row, column)], if column >= 8 { 2.0 } else { 1.0 });
        }
        assert!(seen.distance_m[(0, 0)] > 4.05);
    }
    let layers = layered_depth(&world, &view, 3, &Cancel::new()).unwrap();
    assert!((layers[0][(3, 12)] - 2.0).abs() < 1e-6 && (layers[1][(3, 12)] - 4.0).abs() < 1e-6);
    assert_eq!((layers[1][(3, 2)], layers[2][(3, 12)]), (f32::INFINITY, f32::INFINITY));
}

#[test]
fn second_layer_shows_what_first_hides() {
    let mut builder = WorldBuilder::new();
    add_gray(&mut builder, quad([-5.0, -5.0, 4.0], 10.0, 10.0), 0.0, 2.0);
    add_gray(&mut builder, quad([-5.0, -5.0, 2.0], 10.0, 10.0), 0.0, 1.0);
    let world = builder.build().unwrap();
    let bands = bands(&[550.0]);
    let placement = Placement::look_at(DVec3::ZERO, DVec3::Z, DVec3::Y).unwrap();
    for (layer, expected) in [(0, 1.0), (1, 2.0), (2, 0.0)] {
        let camera = Camera::Pinhole(Pinhole { placement, layer, ..pinhole(2, 0.1) });
        let picture = render(&world, &camera, settings(&bands, 1), 1);
        assert!(picture.picture.planes()[0].iter().all(|&v| v == expected), "{layer}");
    }
}

/// A ball of radius 0.3 m before another and a wall: what each hides is the next, and never its own back, in depth as in light.
#[test]
fn backs_of_closed_shapes_hide_nothing() {
    let mut builder = WorldBuilder::new();
    add_gray(&mut builder, quad([-5.0, -5.0, 6.0], 10.0, 10.0), 0.0, 3.0);
    let gray = builder.add_texture(Texture::Curve(SpectralCurve::constant(0.0)));
    let material = builder.add_material("ball", Material::Matte { reflectance: gray });
    for (z_m, radiance) in [(2.0, 1.0), (4.0, 2.0)] {
        let emission = Emission { radiance: SpectralCurve::constant(radiance), is_two_sided: true };
        let place = DAffine3::from_translation(DVec3::new(0.0, 0.0, z_m));
        builder.add_shape(Shape::Sphere { radius_m: 0.3 }, place, material, Some(emission));
    }
    let world = builder.build().unwrap();
    let view = pinhole(4, 0.02);
    let layers = layered_depth(&world, &view, 4, &Cancel::new()).unwrap();
    let bands = bands(&[550.0]);
    for (layer, (nearest_m, radiance)) in
        [(1.7, 1.0), (3.7, 2.0), (6.0, 3.0), (f32::INFINITY, 0.0)].into_iter().enumerate()
    {
        // The balls' fronts lie up to r − √(r² − x²) farther off the axis: x is 1.5 % of 4 m, in pixels at √2 times that.
        let slack_m = 0.3 - (0.09_f32 - 2.0 * 0.06 * 0.06).sqrt();
        let is_there = |&z_m: &f32| z_m == nearest_m || (nearest_m..nearest_m + slack_m).contains(&z_m);
        assert!(layers[layer].iter().all(is_there), "{layer}: {}", layers[layer]);
        let camera = Camera::Pinhole(Pinhole { layer: layer as u32, ..view });
        let picture = render(&world, &camera, settings(&bands, 1), 1);
        assert!(picture.picture.planes()[0].iter().all(|&found| found == radiance), "{layer}");
    }
}

#[test]
fn bad_settings_end_in_a_sentence() {
    let world = sky();
    let of_bands = bands(&[550.0]);
    let view = pinhole(2, 0.1);
    let message = |camera: &Camera, settings| Renderer::new(&world, camera, settings).unwrap_err().to_string();
    let none = settings(&of_bands, 0);
    assert_eq!(message(&Camera::Pinhole(view), none), "the samples of a pass is 0, expected 1 to 65536");
    let flat = Pinhole { half_tangents: DVec2::new(0.1, 0.0), ..view };
    assert!(message(&Camera::Pinhole(flat), settings(&of_bands, 1)).contains("expected tangents above 0"));
    let other = busy_camera(&bands(&[450.0]));
    assert!(message(&other, settings(&of_bands, 1)).contains("expected the bands that the camera was made for"));
    assert!(PixelGrid::new(4, 4).cropped((3, 0), (2, 1)).is_err());
    assert!(Placement::look_at(DVec3::ZERO, DVec3::Y, DVec3::Y).is_err());
}
