//! A real lens, the whole way from radiance to irradiance, held to radiometry and to traced rays.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a test fails by panicking and shows its numbers")]

use dioptric_forward::{Film, Settings, check_depth_map, irradiance};
use dioptric_optics::{Lens, ObjectPoint, Vignetting, rays_over_front};
use dioptric_psf::{Diffraction, ImageSettings, LensImageModel};
use dioptric_scene::{Scene, View};
use dioptric_spectrum::{DepthMap, Quantity, SpectralImage, WavelengthGrid};
use glam::DVec2;
use ndarray::Array2;

/// The double Gauss focused at a depth, and what a scene at a depth looks like through it.
struct Camera {
    lens: Lens,
    film: Film,
    film_distance_mm: f64,
}

impl Camera {
    fn new(f_number: f64, focus_m: f64, film: Film) -> Self {
        let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(f_number, 550.0).unwrap();
        let mono = lens.at(550.0).unwrap();
        let film_distance_mm =
            mono.film_distance_mm_for(1e3 * focus_m - mono.first_order().entrance_pupil_z_mm).unwrap();
        Self { lens, film, film_distance_mm }
    }

    fn image(&self, scene: &Scene, diffraction: Diffraction, settings: &Settings) -> Vec<Array2<f32>> {
        let settings_of_lens = ImageSettings::new(self.film_distance_mm, diffraction);
        let model = LensImageModel::new(&self.lens, scene.radiance.grid().centers_nm(), &settings_of_lens).unwrap();
        let mut bands = vec![];
        irradiance(scene, &model, &self.film, settings, &|_| {}, &mut |_, band| {
            bands.push(band);
            Ok(())
        })
        .unwrap();
        bands
    }
}

fn scene(planes: Vec<Array2<f32>>, wavelengths_nm: Vec<f64>, z_m: f64, focal_px: f64) -> Scene {
    let (rows, columns) = planes[0].dim();
    let grid = WavelengthGrid::new(wavelengths_nm).unwrap();
    let radiance = SpectralImage::new(Quantity::Radiance, grid, planes).unwrap();
    let (center_x_px, center_y_px) = (0.5 * (columns as f64 - 1.0), 0.5 * (rows as f64 - 1.0));
    Scene {
        depth: Some(DepthMap::flat(rows, columns, z_m).unwrap()),
        view: Some(View { focal_px, center_x_px, center_y_px }),
        ..Scene::new("test", radiance)
    }
}

/// A uniform Lambertian plane in focus, against the formula of the working f-number, on the axis.
#[track_caller]
fn check_radiometry(f_number: f64, z_m: f64, tolerance: f64) {
    let camera = Camera::new(f_number, z_m, Film::centered(64, 64, 10.0));
    let radiance = 0.37;
    let scene = scene(vec![Array2::from_elem((100, 100), radiance)], vec![550.0], z_m, 4000.0);
    let picture = camera.image(&scene, Diffraction::Hurb { gamma: 1.0 }, &Settings::default()).remove(0);
    let first = camera.lens.at(550.0).unwrap().first_order();
    let image_mm = camera.film_distance_mm - first.rear_principal_mm;
    let magnification = image_mm / first.efl_mm - 1.0;
    let pupil_magnification = first.exit_pupil_diameter_mm / first.entrance_pupil_diameter_mm;
    let working = f_number * (1.0 + magnification / pupil_magnification);
    let expected = std::f64::consts::PI * f64::from(radiance) / (4.0 * working * working);
    let ratio = f64::from(picture[(32, 32)]) / expected;
    println!("f/{f_number} at {z_m} m: E/(πL/(4N_w²)) = {ratio:.5}");
    assert!((ratio - 1.0).abs() <= tolerance, "f/{f_number} at {z_m} m: {ratio}");
}

#[test]
fn a_lambertian_plane_gets_the_irradiance_of_the_working_f_number() {
    // The formula is paraxial; the tolerances are what the aberrations of the pupil leave.
    check_radiometry(8.0, 8.0, 0.003);
    check_radiometry(8.0, 0.5, 0.003);
    check_radiometry(4.0, 8.0, 0.006);
    check_radiometry(4.0, 1.0, 0.006);
}

/// Kernels hold what is within twelve λN, .985 of all; the rest is spread over the film as an aperture does.
#[test]
fn light_far_from_a_point_is_that_of_waves() {
    const N: usize = 401;
    let (f_number, pitch_um) = (16.0, 5.0);
    let film = Film::centered(N, N, pitch_um);
    let camera = Camera::new(f_number, 2.0, film);
    let mut points = Array2::zeros((N, N));
    points[(N / 2, N / 2)] = 1.0;
    let scene = scene(vec![points], vec![550.0], 2.0, 1e3 * camera.film_distance_mm / pitch_um);
    let beyond = |picture: &Array2<f64>, r_px: f64| -> f64 {
        let from_middle = |i: usize| i as f64 - (N / 2) as f64;
        let lights = picture.indexed_iter();
        let far = lights.filter(|((row, column), _)| from_middle(*row).hypot(from_middle(*column)) > r_px);
        far.map(|(_, light)| light).sum()
    };
    for diffraction in [Diffraction::Wave, Diffraction::Hurb { gamma: 1.0 }] {
        let picture = camera.image(&scene, diffraction, &Settings::default()).remove(0).mapv(f64::from);
        let picture = &picture / picture.sum();
        let law = 2.0 / std::f64::consts::PI.powi(2) * 1e-3 * 550.0 * f_number / pitch_um / std::f64::consts::TAU;
        for r in (18..32).chain([35, 40, 50, 60, 80]) {
            // Across the border of the window, 21 pixels from the middle, and from one raster to the next.
            for (place, distance) in [((0, r), r as f64), ((r, r), std::f64::consts::SQRT_2 * r as f64)] {
                let ratio = picture[(N / 2 - place.0, N / 2 + place.1)] * distance.powi(3) / law;
                assert!((0.6..1.5).contains(&ratio), "{diffraction:?} {distance} px: {ratio}");
            }
        }
        // Of an Airy disc, 2 λN / π² r lies beyond a radius r (the mean over its rings), and as much less as falls beside the film stays where it is.
        let unit_px = 1e-3 * 550.0 * f_number / pitch_um;
        for times in [13.0, 20.0, 40.0, 80.0] {
            let r_px = times * unit_px;
            let off_film = 4.0 * std::f64::consts::SQRT_2 / (std::f64::consts::PI * N as f64);
            let expected = 2.0 / (std::f64::consts::PI.powi(2)) * unit_px * (1.0 / r_px - off_film);
            let found = beyond(&picture, r_px);
            println!("{diffraction:?} beyond {times} λN: {found:.5}, {expected:.5}");
            // What windows leave out of kernels is known to a twentieth, and wide pixels take some of it inwards and outwards.
            assert!((found / expected - 1.0).abs() < 0.12, "{diffraction:?} beyond {times} λN: {found}, {expected}");
        }
    }
}

#[test]
fn a_point_lands_where_its_rays_do() {
    let film = Film::centered(600, 900, 24.0);
    let camera = Camera::new(4.0, 2.0, film);
    let (rows, columns, focal_px, z_m) = (640, 940, 2100.0, 1.6);
    let wavelengths_nm = vec![420.0, 550.0, 680.0];
    let (reference, points) = (camera.lens.at(550.0).unwrap(), [(319_usize, 500_usize), (120, 800), (600, 60)]);
    for (row, column) in points {
        let mut plane = Array2::zeros((rows, columns));
        plane[(row, column)] = 1.0;
        let scene = scene(vec![plane; 3], wavelengths_nm.clone(), z_m, focal_px);
        let (tan_x, tan_y) = scene.view.unwrap().tan_at(row as f64, column as f64);
        let pictures = camera.image(&scene, Diffraction::None, &Settings::default());
        for (picture, &wavelength_nm) in pictures.iter().zip(&wavelengths_nm) {
            let lens = camera.lens.at(wavelength_nm).unwrap();
            let point = ObjectPoint::from_field(&reference, DVec2::new(tan_x, tan_y), 1.0 / z_m);
            let mut rays = rays_over_front(&lens, &point, 400);
            lens.trace(&mut rays, Vignetting::On);
            lens.to_film(&mut rays, camera.film_distance_mm);
            let through: Vec<usize> = (0..rays.len()).filter(|&i| rays.fate[i].is_in_flight()).collect();
            let mean = |of: &[f64]| through.iter().map(|&i| of[i]).sum::<f64>() / through.len() as f64;
            // The picture is the film turned by half a turn.
            let expected_column = 449.5 - 1e3 * mean(&rays.x_mm) / film.pitch_um;
            let expected_row = 299.5 + 1e3 * mean(&rays.y_mm) / film.pitch_um;
            let sum: f64 = picture.iter().map(|&v| f64::from(v)).sum();
            let moment = |of: &dyn Fn((usize, usize)) -> usize| {
                picture.indexed_iter().map(|(at, &v)| of(at) as f64 * f64::from(v)).sum::<f64>() / sum
            };
            let (found_row, found_column) = (moment(&|at| at.0), moment(&|at| at.1));
            let off = (found_row - expected_row).hypot(found_column - expected_column);
            println!("{wavelength_nm} nm at {row}, {column}: {off:.4} px off {expected_row:.2}, {expected_column:.2}");
            assert!(
                off < 0.1,
                "{wavelength_nm} nm: {found_row}, {found_column} is not {expected_row}, {expected_column}"
            );
        }
    }
}

#[test]
fn psfs_shared_between_bands_are_as_good_as_one_for_each() {
    let camera = Camera::new(4.0, 1.0, Film::centered(160, 240, 5.0));
    let bars = Array2::from_shape_fn((200, 280), |(r, c)| if (r / 9 + c / 7) % 2 == 0 { 1.0 } else { 0.2 });
    let wavelengths_nm: Vec<f64> = (0..16).map(|i| 400.0 + 20.0 * f64::from(i)).collect();
    let mut scene = scene(vec![bars; 16], wavelengths_nm, 1.0, 10_500.0);
    let z_m = Array2::from_shape_fn((200, 280), |(_, c)| if c < 140 { 1.0 } else { 1.15 });
    scene.depth = Some(DepthMap::new(z_m).unwrap());
    let at = |chromatic_step_px| {
        camera.image(&scene, Diffraction::Hurb { gamma: 1.0 }, &Settings { chromatic_step_px, ..Settings::default() })
    };
    let (shared, own) = (at(Settings::default().chromatic_step_px), at(0.0));
    let mut worst = 0.0_f64;
    for (a, b) in shared.iter().zip(&own) {
        let mean = b.mean().unwrap();
        worst = worst.max((a - b).mapv(|d| (d / mean).powi(2)).mean().unwrap().sqrt().into());
    }
    println!("PSFs shared between bands: rms error {worst:.5} of the mean");
    // A quarter of a pixel of blur, interpolated, is less than a tenth of the error that two layers leave.
    assert!(worst < 1e-3, "{worst}");
}

/// Depth begins at the entrance pupil, some centimeters behind the first surface.
#[test]
fn depth_inside_the_lens_is_refused() {
    let camera = Camera::new(4.0, 2.0, Film::centered(24, 36, 100.0));
    let grid = WavelengthGrid::new(vec![550.0]).unwrap();
    let refused = |z_m: f32| {
        let mut depth = Array2::from_elem((10, 12), 2.0_f32);
        depth[(3, 7)] = z_m;
        let depth = DepthMap::new(depth).unwrap();
        let mapped = check_depth_map(&camera.lens, &grid, &depth);
        mapped.err().map(|error| error.to_string())
    };
    let least_m = 1e-3 * camera.lens.at(550.0).unwrap().projection_center_z_mm() as f32;
    for z_m in [1e-4, 0.5 * least_m, 0.999 * least_m] {
        let message = refused(z_m).unwrap();
        assert!(message.contains("row 3, column 7") && message.contains("inside dgauss-50mm"), "{message}");
    }
    assert_eq!(refused(least_m + 0.3), None);
}
