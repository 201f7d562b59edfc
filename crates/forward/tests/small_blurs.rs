//! Blurs of less than a pixel, on scenes hardly finer than the film.

#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use std::f64::consts::TAU;

use dioptric_forward::{Film, Settings, irradiance};
use dioptric_optics::Lens;
use dioptric_psf::{Diffraction, FilmQuery, ImageSettings, LensImage, LensImageModel};
use dioptric_scene::{Scene, View};
use dioptric_spectrum::{DepthMap, Quantity, SpectralImage, WavelengthGrid};
use glam::DVec2;
use ndarray::Array2;

const PITCH_UM: f64 = 40.0;
const FILM_MM: f64 = 52.0;
const PIXELS: usize = 48;
/// Of the grating, pixels.
const PERIOD_PX: f64 = 4.0;

/// Returns the contrast that an upright grating at a depth has on the film, with so many samples of the scene along a pixel.
fn contrast(lens: &LensImageModel, grid: &WavelengthGrid, density: f64, dioptres: f64) -> f64 {
    let n = (1.5 * density * PIXELS as f64) as usize;
    // The scene's samples are seen under the angles of pixels over the density.
    let tan_per_mm = lens.film_map(550.0, 1.0).field_tan(DVec2::new(0.1, 0.0)).unwrap().x / 0.1;
    let focal_px = density / (1e-3 * PITCH_UM * tan_per_mm);
    let center_px = 0.5 * (n as f64 - 1.0);
    let wave = |column: usize| (TAU * (column as f64 - center_px) / (density * PERIOD_PX)).cos();
    let plane = Array2::from_shape_fn((n, n), |(_, column)| (1.0 + 0.5 * wave(column)) as f32);
    let radiance = SpectralImage::new(Quantity::Radiance, grid.clone(), vec![plane]).unwrap();
    let scene = Scene {
        depth: Some(DepthMap::new(Array2::from_elem((n, n), (1.0 / dioptres) as f32)).unwrap()),
        view: Some(View { focal_px, center_x_px: center_px, center_y_px: center_px }),
        ..Scene::new("grating", radiance)
    };
    let film = Film::centered(PIXELS, PIXELS, PITCH_UM);
    let mut picture = None;
    irradiance(&scene, lens, &film, &Settings::default(), &|_| {}, &mut |_, band| {
        picture = Some(band);
        Ok(())
    })
    .unwrap();
    let row = picture.unwrap().row(PIXELS / 2).to_vec();
    let mean = row.iter().map(|&e| f64::from(e)).sum::<f64>() / PIXELS as f64;
    let wave = |column: usize| (TAU * (column as f64 - 0.5 * (PIXELS as f64 - 1.0)) / PERIOD_PX).cos();
    let amplitude = row.iter().enumerate().map(|(column, &e)| f64::from(e) * wave(column)).sum::<f64>();
    2.0 * amplitude / (PIXELS as f64 * mean)
}

/// A disc of radius r leaves 2 J₁(2πrf)/(2πrf) of a grating of f cycles; its series to what matters here.
fn left_by_disc(radius_px: f64) -> f64 {
    let q = (TAU * radius_px / PERIOD_PX / 2.0).powi(2);
    1.0 - q / 2.0 + q * q / 12.0 - q.powi(3) / 144.0 + q.powi(4) / 2880.0
}

/// Through every radius: below a sixth of a sample light is a point, which a disc of that radius is but for 0.009; beyond, kernels of one to three samples have the variance of the disc, σ² = r²/4, and so its contrast but for
/// the fourth order, which is 0.03 for discs of a sample's radius at a quarter of a cycle a sample.
#[test]
fn blurs_below_a_pixel_take_their_contrast() {
    let grid = WavelengthGrid::new(vec![550.0]).unwrap();
    let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(8.0, 550.0).unwrap();
    let model = LensImageModel::new(&lens, grid.centers_nm(), &ImageSettings::new(FILM_MM, Diffraction::None)).unwrap();
    let radius_px = |dioptres: f64| {
        // The rim of the pupil as the kernel on fine samples has it: twice the deviation.
        let query = FilmQuery { place_mm: DVec2::ZERO, dioptres, wavelength_nm: 550.0, pitch_um: 0.05 * PITCH_UM };
        let kernel = model.kernel(query).samples;
        let middle = 0.5 * (kernel.nrows() as f64 - 1.0);
        let along = |((row, _), e): ((usize, usize), &f32)| f64::from(*e) * (row as f64 - middle).powi(2);
        let variance = kernel.indexed_iter().map(along).sum::<f64>() / kernel.sum() as f64;
        0.05 * 2.0 * (variance - 1.0 / 12.0).max(0.0).sqrt()
    };
    let focus = model.focus_dioptres();
    let per_dioptre = radius_px(focus + 0.5) / 0.5;
    for density in [1.0, 2.0] {
        let sharp = contrast(&model, &grid, density, focus);
        let mut last = 1.0;
        for step in 1..=12 {
            let dioptres = focus + 0.1 * f64::from(step) / per_dioptre;
            let left = contrast(&model, &grid, density, dioptres) / sharp;
            let expected = left_by_disc(radius_px(dioptres)) / left_by_disc(radius_px(focus));
            println!("{density} samples a pixel, radius {:.3} px: {left:.4}, disc {expected:.4}", radius_px(dioptres));
            assert!((left - expected).abs() < 0.035, "{density} samples, step {step}: {left} for {expected}");
            assert!(left < last + 1e-4, "{density} samples, step {step}: {left} after {last}");
            last = left;
        }
    }
}
