//! A uniform scene has the irradiance of a uniform scene, whatever lens, stop, depth, film and diffraction.

#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use dioptric_forward::{Film, Settings, Source, render};
use dioptric_optics::Lens;
use dioptric_psf::{Diffraction, ImageSettings, LensImage, LensImageModel};
use dioptric_scene::View;
use dioptric_spectrum::{DepthMap, Quantity, SpectralImage, WavelengthGrid};
use glam::DVec2;
use ndarray::Array2;

/// Returns the largest relative difference of a picture of an even plane from the irradiance of an even scene.
fn error(lens: &str, f_number: f64, plane_m: f64, diffraction: Diffraction, settings: &Settings) -> f64 {
    let lens = Lens::built_in(lens).unwrap().with_f_number(f_number, 550.0).unwrap();
    let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2000.0).unwrap();
    let (film, grid) = (Film::centered(37, 300, 60.0), WavelengthGrid::new(vec![530.0]).unwrap());
    let model = LensImageModel::new(&lens, &[530.0], &ImageSettings::new(film_distance_mm, diffraction)).unwrap();
    let size = (150, 300);
    let radiance = SpectralImage::new(Quantity::Radiance, grid, vec![Array2::from_elem(size, 0.7)]).unwrap();
    let depth = DepthMap::new(Array2::from_elem(size, plane_m as f32)).unwrap();
    // Far wider than the film sees.
    let view = View { focal_px: 60.0, center_x_px: 149.5, center_y_px: 74.5 };
    let source = Source { radiance: &radiance, depth: &depth, view, occluded: None, points: &[] };
    let mut picture = Array2::zeros((0, 0));
    let mut sink = |_: usize, band: Array2<f32>| {
        picture = band;
        Ok(())
    };
    render(&source, &model, &film, settings, &|_| {}, &mut sink).unwrap();
    let map = model.film_map(530.0, film.half_diagonal_mm());
    let off = |((row, column), light): ((usize, usize), &f32)| {
        let place_mm = 0.06 * DVec2::new(column as f64 - 149.5, 18.0 - row as f64);
        (f64::from(*light) / (0.7 * map.irradiance_sr(place_mm)) - 1.0).abs()
    };
    picture.indexed_iter().map(off).fold(0.0, f64::max)
}

/// Kernels of a thin line within a wide blur, of a field that curves, of rims that cut the pupil from the axis on, and of waves.
#[test]
fn planes_are_exact() {
    let coarse = Settings { tile_px: 256, max_edge_error: 1.0, widest_blur_px: 8.0, ..Settings::default() };
    let hurb = Diffraction::Hurb { gamma: 1.0 };
    for (lens, f_number, plane_m, diffraction, settings) in [
        ("paper-2el", 2.8, 0.4, Diffraction::None, Settings::default()),
        ("dgauss-50mm", 2.5, 0.5, hurb, Settings::default()),
        ("dgauss-50mm", 2.03, 0.4, hurb, coarse),
        ("canon-50mm", 1.85, 30.0, Diffraction::None, coarse),
        ("tessar-50mm", 8.0, 2.0, Diffraction::Wave, Settings::default()),
    ] {
        let worst = error(lens, f_number, plane_m, diffraction, &settings);
        // Single precision.
        assert!(worst < 1e-5, "{lens} f/{f_number}, {plane_m} m, {diffraction:?}: {worst}");
    }
}

/// Returns the contrast, beside what a picture has of it by itself, of a grating of so many cycles per pixel through an ideal lens with waves, on pixels of 5 µm.
fn contrast(f_number: f64, cycles_per_px: f64) -> f64 {
    const FINE: usize = 8;
    let lens = Lens::thin(50.0, 50.0 / f_number).unwrap();
    let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2000.0).unwrap();
    let (film, grid) = (Film::centered(16, 200, 5.0), WavelengthGrid::new(vec![550.0]).unwrap());
    let model = LensImageModel::new(&lens, &[550.0], &ImageSettings::new(film_distance_mm, Diffraction::Wave)).unwrap();
    let (rows, columns) = (FINE * 60, FINE * 260);
    let grating = |(_, column): (usize, usize)| {
        let px = (column as f64 + 0.5) / FINE as f64;
        (1.0 + (std::f64::consts::TAU * cycles_per_px * px).cos()) as f32
    };
    let planes = vec![Array2::from_shape_fn((rows, columns), grating)];
    let radiance = SpectralImage::new(Quantity::Radiance, grid, planes).unwrap();
    let depth = DepthMap::new(Array2::from_elem((rows, columns), 2.0)).unwrap();
    let (center_x_px, center_y_px) = (0.5 * (columns as f64 - 1.0), 0.5 * (rows as f64 - 1.0));
    // As the lens sees from its middle.
    let view = View { focal_px: film_distance_mm / 5e-3 * FINE as f64, center_x_px, center_y_px };
    let source = Source { radiance: &radiance, depth: &depth, view, occluded: None, points: &[] };
    let mut picture = Array2::zeros((0, 0));
    let mut sink = |_: usize, band: Array2<f32>| {
        picture = band;
        Ok(())
    };
    render(&source, &model, &film, &Settings::default(), &|_| {}, &mut sink).unwrap();
    // The amplitude of the frequency that pixels make of it.
    let line: Vec<f64> = picture.row(8).iter().map(|light| f64::from(*light)).collect();
    let line = &line[40..160];
    let mean = line.iter().sum::<f64>() / line.len() as f64;
    let along = |of: fn(f64) -> f64| {
        let terms = line.iter().enumerate();
        terms.map(|(i, light)| light * of(std::f64::consts::TAU * cycles_per_px * i as f64)).sum::<f64>()
    };
    2.0 * along(f64::cos).hypot(along(f64::sin)) / (line.len() as f64 * mean)
}

/// What the optics leave of a grating, times the pixel, and not what would be left of pixels before the optics.
#[test]
fn gratings_are_blurred_before_they_are_sampled() {
    for (f_number, cycles_per_px) in [(22.0_f64, 0.8_f64), (22.0, 0.3), (8.0, 0.8), (8.0, 0.4)] {
        // The diffraction MTF of a circle, and the pixel.
        let working = f_number * (1.0 + 50.0 / 1950.0);
        let s = (cycles_per_px / 5e-3 * 550e-6 * working).min(1.0);
        let optics = 2.0 / std::f64::consts::PI * (s.acos() - s * (1.0 - s * s).sqrt());
        let pixel = (std::f64::consts::PI * cycles_per_px).sin() / (std::f64::consts::PI * cycles_per_px);
        let (found, expected) = (contrast(f_number, cycles_per_px), optics * pixel.abs());
        println!("f/{f_number}, {cycles_per_px} cycles per pixel: {found:.4}, expected {expected:.4}");
        assert!((found - expected).abs() < 0.01, "f/{f_number}, {cycles_per_px}: {found}, {expected}");
    }
}
