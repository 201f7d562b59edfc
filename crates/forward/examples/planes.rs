//! Uniform planes through random lenses, stops, focuses, depths and kinds of diffraction: how far a picture is from the irradiance of a uniform scene, and that from counted rays.
//! `cargo run --release --example planes -p dioptric-forward [-- CASES]`

#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "an example shows its numbers, and stops where one is missing"
)]

use dioptric_forward::{Film, Settings, Source, render};
use dioptric_optics::Lens;
use dioptric_psf::{Diffraction, ImageSettings, LensImage, LensImageModel};
use dioptric_scene::View;
use dioptric_spectrum::{DepthMap, Quantity, SpectralImage, WavelengthGrid};
use glam::DVec2;
use ndarray::Array2;

/// Numbers without order between 0 and 1 (Weyl's sequence of the golden ratio, hashed).
struct Draws(u64);

impl Draws {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.next())
    }
}

fn main() {
    let n_cases: usize = std::env::args().nth(1).map_or(300, |word| word.parse().unwrap());
    let names: Vec<String> = Lens::built_in_names().map(str::to_owned).collect();
    let mut draws = Draws(1);
    let mut worst = 0.0_f64;
    for case in 0..n_cases {
        let name = &names[(draws.next() * names.len() as f64) as usize];
        let wide = Lens::built_in(name).unwrap();
        let Ok(mono) = wide.at(550.0) else { continue };
        let f_number =
            draws.between(mono.first_order().f_number.max(0.8), 22.0_f64.max(mono.first_order().f_number * 2.0));
        let lens = wide.with_f_number(f_number, 550.0).unwrap_or(wide);
        let (focus_mm, plane_m) = (draws.between(400.0, 1e5), draws.between(0.4, 100.0));
        let diffraction = match (3.0 * draws.next()) as usize {
            0 => Diffraction::None,
            1 => Diffraction::Hurb { gamma: 1.0 },
            _ => Diffraction::Wave,
        };
        let Ok(film_distance_mm) = lens.at(550.0).unwrap().film_distance_mm_for(focus_mm) else { continue };
        let nm = draws.between(420.0, 680.0);
        let efl_mm = lens.at(550.0).unwrap().first_order().efl_mm.abs();
        let film = Film::centered(24, 200, 1e3 * draws.between(0.05, 0.8) * efl_mm / 200.0);
        let grid = WavelengthGrid::new(vec![nm]).unwrap();
        let model = LensImageModel::new(&lens, &[nm], &ImageSettings::new(film_distance_mm, diffraction)).unwrap();
        let size = (60, 500);
        let radiance = SpectralImage::new(Quantity::Radiance, grid, vec![Array2::ones(size)]).unwrap();
        let depth = DepthMap::new(Array2::from_elem(size, plane_m as f32)).unwrap();
        // Far wider than the film sees.
        let view = View { focal_px: 500.0 / 2.0 / 5.0, center_x_px: 249.5, center_y_px: 29.5 };
        let source = Source { radiance: &radiance, depth: &depth, view, occluded: None, points: &[] };
        let mut pictures = vec![];
        render(&source, &model, &film, &Settings::default(), &|_| {}, &mut |_, band| {
            pictures.push(band);
            Ok(())
        })
        .unwrap();
        let map = model.film_map(nm, film.half_diagonal_mm());
        let mut error = 0.0_f64;
        for ((row, column), &value) in pictures[0].indexed_iter() {
            let place = 1e-3 * film.pitch_um * DVec2::new(column as f64 - 99.5, 11.5 - row as f64);
            let expected = map.irradiance_sr(place);
            if expected > 0.0 && map.field_tan(place).is_some_and(|tan| tan.x.abs() < 4.9 && tan.y.abs() < 0.5) {
                error = error.max((f64::from(value) / expected - 1.0).abs());
            }
        }
        worst = worst.max(error);
        println!(
            "{case}: {name} f/{f_number:.2}, focus {focus_mm:.0} mm, plane {plane_m:.2} m, {nm:.0} nm, {diffraction:?}: {error:.1e}"
        );
    }
    println!("worst of {n_cases}: {worst:.1e}");
}
