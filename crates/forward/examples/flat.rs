//! A flat textured megapixel of 31 bands through built-in lenses: where the time goes.
//! `cargo run --release --example flat -p dioptric-forward [-- LENS … [--depth]]`

#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "an example shows its numbers, and stops where one is missing"
)]

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use dioptric_forward::{Film, ImagingPlan, ImagingSpec, Settings, Source};
use dioptric_optics::Lens;
use dioptric_psf::{Diffraction, ImageSettings, LensImageModel};
use dioptric_scene::View;
use dioptric_spectrum::{Cancel, DepthMap, Quantity, SpectralImage, WavelengthGrid};
use ndarray::Array2;

/// Lenses with half the diagonal that they light, mm.
const LENSES: [(&str, f64); 7] = [
    ("paper-2el", 10.0),
    ("dgauss-50mm", 11.3),
    ("cooke-50mm", 11.3),
    ("canon-50mm", 11.3),
    ("achromat-100mm", 5.0),
    ("tessar-50mm", 7.5),
    ("fisheye-12.5mm", 7.0),
];

fn main() {
    let wanted: Vec<String> = std::env::args().skip(1).collect();
    let has_depth = wanted.iter().any(|word| word == "--depth");
    let named = |name: &str| wanted.iter().all(|word| word.starts_with("--")) || wanted.iter().any(|word| word == name);
    let (rows, columns) = (1000, 1000);
    for (name, radius_mm) in LENSES.into_iter().filter(|(name, _)| named(name)) {
        let lens = Lens::built_in(name).unwrap();
        let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2000.0).unwrap();
        let film = Film::centered(rows, columns, 2e3 * radius_mm / f64::hypot(rows as f64, columns as f64));
        let grid = WavelengthGrid::uniform(400.0, 700.0, 10.0).unwrap();
        let start = Instant::now();
        let settings = ImageSettings::new(film_distance_mm, Diffraction::Hurb { gamma: 1.0 });
        let model = LensImageModel::new(&lens, grid.centers_nm(), &settings).unwrap();
        let focal_px = lens.at(550.0).unwrap().first_order().efl_mm / (1e-3 * film.pitch_um);
        let texture =
            Array2::from_shape_fn((rows, columns), |(r, c)| ((r * 7919 + c * 104_729 + r * c) % 97) as f32 + 3.0);
        let radiance = SpectralImage::new(Quantity::Radiance, grid.clone(), vec![texture; grid.len()]).unwrap();
        let z_m = |(r, c): (usize, usize)| match has_depth {
            true if r.abs_diff(500).pow(2) + c.abs_diff(400).pow(2) < 150 * 150 => 0.7,
            true => 1.2 + 2e-3 * c as f32,
            false => 2.0,
        };
        let depth = DepthMap::new(Array2::from_shape_fn((rows, columns), z_m)).unwrap();
        let view = View { focal_px, center_x_px: 499.5, center_y_px: 499.5 };
        let source = Source { radiance: &radiance, depth: &depth, view, occluded: None, points: &[] };
        let spec = ImagingSpec { film, grid, settings: Settings::default() };
        let cancel = Cancel::new();
        let plan = ImagingPlan::new(Arc::new(model), &source.geometry(), spec, &|_| {}, &cancel).unwrap();
        let began = Instant::now();
        let clock = move || -> Duration { began.elapsed() };
        let plan = plan.with_clock(Arc::new(clock));
        let planned = start.elapsed();
        let mut sum = 0.0;
        plan.stream(&source.light(), &|_| {}, &cancel, &mut |_, band| {
            sum += f64::from(band.sum());
            Ok(())
        })
        .unwrap();
        println!("{name}: planned {planned:.2?}, all {:.2?}, sum {sum:.4e}", start.elapsed());
        for (part, time) in plan.times().parts() {
            println!("    {part} {time:.2?}");
        }
    }
}
