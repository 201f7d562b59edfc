//! A uniform scene has the irradiance of a uniform scene, whatever lens, stop, depth, film and diffraction.

#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use dioptric_forward::{BlurMode, Film, Settings, Source, render};
use dioptric_optics::{CoordinateBreak, Lens};
use dioptric_psf::{Diffraction, ImageSettings, LensImage, LensImageModel};
use dioptric_scene::View;
use dioptric_spectrum::{DepthMap, Quantity, SpectralImage, WavelengthGrid};
use glam::DVec2;
use ndarray::Array2;

/// A film before a lens, and a plane, or two of which the right one is three times as far.
#[derive(Debug)]
struct Plane {
    lens: Lens,
    focus_mm: f64,
    plane_m: f64,
    has_step: bool,
    film: Film,
    diffraction: Diffraction,
    settings: Settings,
}

impl Plane {
    /// Returns the largest relative difference of its picture from the irradiance of an even scene: as the model says it that made the picture, and as one says it that
    /// was asked for nothing but the film.
    fn errors(&self) -> [f64; 2] {
        let Self { lens, focus_mm, plane_m, has_step, film, diffraction, settings } = self;
        let mono = lens.at(550.0).unwrap();
        let film_distance_mm = mono.film_distance_mm_for(*focus_mm).unwrap();
        let settings_of_image = ImageSettings::new(film_distance_mm, *diffraction);
        let model = || LensImageModel::new(lens, &[530.0], &settings_of_image).unwrap();
        let grid = WavelengthGrid::new(vec![530.0]).unwrap();
        let size = (150, 300);
        let radiance = SpectralImage::new(Quantity::Radiance, grid, vec![Array2::from_elem(size, 0.7)]).unwrap();
        let depth_m = |(_, column)| if *has_step && column >= 150 { 3.0 * plane_m } else { *plane_m } as f32;
        let depth = DepthMap::new(Array2::from_shape_fn(size, depth_m)).unwrap();
        // Far wider than the film sees.
        let tan = film.half_diagonal_mm() / mono.film_scale_mm(film_distance_mm).abs();
        let view = View { focal_px: 20.0 / tan, center_x_px: 149.5, center_y_px: 74.5 };
        let source = Source { radiance: &radiance, depth: &depth, view, occluded: None, points: &[] };
        let mut picture = Array2::zeros((0, 0));
        let mut sink = |_: usize, band: Array2<f32>| {
            picture = band;
            Ok(())
        };
        let own = model();
        render(&source, &own, film, settings, &|_| {}, &mut sink).unwrap();
        [own, model()].map(|model| {
            let map = model.film_map(530.0, film.half_diagonal_mm());
            let pitch_mm = 1e-3 * film.pitch_um;
            let even = Array2::from_shape_fn((film.rows, film.columns), |(row, column)| {
                let middle = DVec2::new(0.5 * (film.columns - 1) as f64, 0.5 * (film.rows - 1) as f64);
                0.7 * map.irradiance_sr(pitch_mm * DVec2::new(column as f64 - middle.x, middle.y - row as f64))
            });
            let brightest = even.iter().copied().fold(0.0, f64::max);
            let off = |(light, even): (&f32, &f64)| (f64::from(*light) / even - 1.0).abs();
            picture.iter().zip(&even).filter(|(_, even)| **even > 1e-3 * brightest).map(off).fold(0.0, f64::max)
        })
    }
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
        let plane = Plane {
            lens: Lens::built_in(lens).unwrap().with_f_number(f_number, 550.0).unwrap(),
            focus_mm: 2000.0,
            plane_m,
            has_step: false,
            film: Film::centered(37, 300, 60.0),
            diffraction,
            settings,
        };
        // Single precision.
        let worst = plane.errors();
        assert!(worst.iter().all(|off| *off < 1e-5), "{lens} f/{f_number}, {plane_m} m, {diffraction:?}: {worst:?}");
    }
}

/// Takes a quarter of an hour: 300 lenses, stops, depths, kinds of diffraction, movements and qualities by lot.
#[test]
#[ignore = "it takes a quarter of an hour"]
fn planes_are_exact_by_lot() {
    let mut state = 7_u64;
    let mut lot = |n: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) % n as u64) as usize
    };
    let names: Vec<&str> = Lens::built_in_names().collect();
    let preview = Settings { layer_step_px: 4.0, max_edge_error: 0.03, widest_blur_px: 8.0, ..Settings::default() };
    let views = Settings { mode: BlurMode::Views(4), ..Settings::default() };
    let (mut found, mut n_refused) = (vec![], 0);
    while found.len() < 300 {
        let name = names[lot(names.len())];
        let lens = Lens::built_in(name).unwrap();
        let mono = lens.at(550.0).unwrap();
        let wide_open = mono.first_order().f_number;
        let lens = [1.0, 1.0, 1.4, 2.0, 4.0].map(|stops| lens.clone().with_f_number(stops * wide_open, 550.0));
        let (lens, focus_mm) = (lens[lot(5)].clone(), [600.0, 2000.0, 1e9][lot(3)]);
        let (plane_m, has_step) = ([0.7, 1.5, 5.0, 1e6][lot(4)], lot(3) == 0);
        let (diffraction, moves) = (
            [Diffraction::None, Diffraction::Hurb { gamma: 1.0 }, Diffraction::Wave][lot(3)],
            [([0.0; 3], [0.0; 3]), ([0.0; 3], [0.0; 3]), ([0.0, 2.0, 0.0], [0.0; 3]), ([0.0; 3], [2.0, 0.0, 0.0])]
                [lot(4)],
        );
        let (settings, (rows, columns)) = ([Settings::default(), preview, views][lot(3)], [(40, 60), (25, 80)][lot(2)]);
        let (Ok(lens), true) = (lens, wide_open.is_finite()) else { continue };
        let (decenter_mm, tilt_deg) = moves;
        let surfaces = (0, lens.interfaces().len() - 1);
        let whole = CoordinateBreak { surfaces, pivot_mm: 0.0, decenter_mm, tilt_deg, tilt_first: false };
        let lens = if moves == ([0.0; 3], [0.0; 3]) { lens } else { lens.with_moves(vec![whole]).unwrap() };
        // Half the diagonal is 0.4 of the focal length.
        let pitch_um = 1e3 * 0.8 * mono.first_order().efl_mm.abs() / f64::hypot(rows as f64, columns as f64);
        let film = Film::centered(rows, columns, pitch_um);
        let what = format!("{name} {focus_mm} {plane_m} {has_step} {diffraction:?} {moves:?} {:?}", settings.mode);
        let plane = Plane { lens, focus_mm, plane_m, has_step, film, diffraction, settings };
        // Parts of a pupil have no waves; some lenses no focus so near.
        match std::panic::catch_unwind(|| plane.errors()) {
            Ok(errors) => found.push((errors, what)),
            Err(_) => n_refused += 1,
        }
    }
    for k in [0, 1] {
        found.sort_by(|a, b| b.0[k].total_cmp(&a.0[k]));
        println!("by {}:", ["the model of the picture", "another one"][k]);
        found.iter().take(8).for_each(|(errors, what)| println!("  {:.1e} {:.1e} {what}", errors[0], errors[1]));
    }
    println!("{} pictures, {n_refused} refused", found.len());
    assert!(found.iter().all(|(errors, _)| errors.iter().all(|off| *off < 1e-5)));
}

/// Returns the contrast, beside what a picture has of it by itself, of a grating of so many cycles per pixel through an ideal lens in focus at 2 m, on pixels of 5 µm.
fn contrast(f_number: f64, cycles_per_px: f64, (plane_m, diffraction): (f64, Diffraction)) -> f64 {
    const FINE: usize = 8;
    let lens = Lens::thin(50.0, 50.0 / f_number).unwrap();
    let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2000.0).unwrap();
    let (film, grid) = (Film::centered(16, 200, 5.0), WavelengthGrid::new(vec![550.0]).unwrap());
    let model = LensImageModel::new(&lens, &[550.0], &ImageSettings::new(film_distance_mm, diffraction)).unwrap();
    let (rows, columns) = (FINE * 60, FINE * 260);
    let grating = |(_, column): (usize, usize)| {
        let px = (column as f64 + 0.5) / FINE as f64;
        (1.0 + (std::f64::consts::TAU * cycles_per_px * px).cos()) as f32
    };
    let planes = vec![Array2::from_shape_fn((rows, columns), grating)];
    let radiance = SpectralImage::new(Quantity::Radiance, grid, planes).unwrap();
    let depth = DepthMap::new(Array2::from_elem((rows, columns), plane_m as f32)).unwrap();
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
        let found = contrast(f_number, cycles_per_px, (2.0, Diffraction::Wave));
        let expected = optics * pixel.abs();
        println!("f/{f_number}, {cycles_per_px} cycles per pixel: {found:.4}, expected {expected:.4}");
        assert!((found - expected).abs() < 0.01, "f/{f_number}, {cycles_per_px}: {found}, {expected}");
    }
}

/// Discs narrower than half a pixel, which leave much beyond one cycle per pixel.
#[test]
fn gratings_keep_what_narrow_kernels_leave_of_them() {
    let mut worst = 0.0_f64;
    for radius_px in [0.12, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5] {
        // In front of a film 51.28 mm behind the lens a point so far from the focus has a disc of this radius.
        let per_dioptre_mm = 0.5 * 12.5 * 50.0 / 0.975e3;
        let plane_m = 1.0 / (0.5 + 5e-3 * radius_px / per_dioptre_mm);
        for cycles_per_px in [0.2, 0.45, 0.7, 0.9_f64] {
            // The transform of a disc, by its line spread.
            let n = 2000;
            let term = |i: i32| {
                let t = (f64::from(i) + 0.5) / f64::from(n);
                (1.0 - t * t).sqrt() * (std::f64::consts::TAU * cycles_per_px * radius_px * t).cos()
            };
            let optics = 4.0 / std::f64::consts::PI * (0..n).map(term).sum::<f64>() / f64::from(n);
            let pixel = (std::f64::consts::PI * cycles_per_px).sin() / (std::f64::consts::PI * cycles_per_px);
            let found = contrast(4.0, cycles_per_px, (plane_m, Diffraction::None));
            println!("{radius_px} px, {cycles_per_px} cycles per pixel: {found:.4}, expected {:.4}", optics * pixel);
            worst = worst.max((found - (optics * pixel).abs()).abs());
        }
    }
    assert!(worst < 0.01, "{worst}");
}
