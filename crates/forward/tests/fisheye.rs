//! A fisheye lens on a film larger than its image.

#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use dioptric_forward::{Border, Film, Settings, irradiance};
use dioptric_optics::Lens;
use dioptric_psf::{Diffraction, ImageSettings, LensImage, LensImageModel};
use dioptric_scene::{Scene, View};
use dioptric_spectrum::{DepthMap, Quantity, SpectralImage, WavelengthGrid};
use glam::DVec2;
use ndarray::Array2;

/// Half the field that the scene has, to its sides and up and down: 85° and 82°.
const HALF_TAN: (f64, f64) = (11.43, 7.62);

/// Returns a film that the image circle lies within, and the picture on it of a plane of checks so many samples wide, in a band of
/// 550 nm, with where the edge of the scene lands to the right.
fn picture(check_px: usize) -> (Film, Array2<f32>, f64) {
    let lens = Lens::built_in("fisheye-12.5mm").unwrap().with_f_number(8.0, 550.0).unwrap();
    let (rows, columns) = (600, 900);
    let grid = WavelengthGrid::new(vec![550.0]).unwrap();
    let checks =
        Array2::from_shape_fn((rows, columns), |(r, c)| (r / check_px + c / check_px).is_multiple_of(2).into());
    let radiance =
        SpectralImage::new(Quantity::Radiance, grid.clone(), vec![checks.mapv(|light: u8| f32::from(light))]).unwrap();
    let focal_px = 0.5 * columns as f64 / HALF_TAN.0;
    let view = View { focal_px, center_x_px: 449.5, center_y_px: 299.5 };
    let depth = DepthMap::new(Array2::from_elem((rows, columns), 3.0)).unwrap();
    let scene = Scene { depth: Some(depth), view: Some(view), ..Scene::new("checks", radiance) };
    let film = Film::centered(120, 180, 300.0);
    let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(3000.0).unwrap();
    let model = LensImageModel::new(&lens, &[550.0], &ImageSettings::new(film_distance_mm, Diffraction::None)).unwrap();
    let mut bands = vec![];
    let settings = Settings { border: Border::Black, ..Settings::default() };
    irradiance(&scene, &model, &film, &settings, &|_| {}, &mut |_, band| {
        bands.push(band);
        Ok(())
    })
    .unwrap();
    let edge_mm = model.film_map(550.0, 30.0).place_mm(DVec2::X * HALF_TAN.0).unwrap().x;
    (film, bands.remove(0), edge_mm)
}

#[test]
fn beyond_the_image_circle_the_film_is_dark() {
    let (film, uniform, edge_mm) = picture(10_000);
    assert!((15.0..19.0).contains(&edge_mm), "{edge_mm}");
    let place = |(row, column): (usize, usize)| DVec2::new(column as f64 - 89.5, row as f64 - 59.5) * 0.3;
    let mut n_lit = 0;
    for (at, &light) in uniform.indexed_iter() {
        // The scene's corners lie a little farther out than the middles of its sides.
        if place(at).length() > 1.08 * edge_mm {
            assert_eq!(light, 0.0, "{at:?}");
        }
        n_lit += usize::from(light > 0.0);
    }
    let circle_px = std::f64::consts::PI * (edge_mm / 0.3).powi(2);
    assert!((n_lit as f64 / circle_px - 1.0).abs() < 0.06, "{n_lit} of {circle_px} pixels, film {film:?}");
}

/// At the rim a pixel sees scores of samples of the scene: checks much finer than pixels are as gray there as they are on average.
#[test]
fn the_rim_of_the_image_is_averaged() {
    let (_, uniform, edge_mm) = picture(10_000);
    let (_, checks, _) = picture(2);
    let row = 60;
    let columns = |low: f64, high: f64| {
        (90..180_usize).filter(move |column| (low..high).contains(&((*column as f64 - 89.5) * 0.3 / edge_mm)))
    };
    for column in columns(0.8, 0.95) {
        let share = f64::from(checks[(row, column)] / uniform[(row, column)]);
        // Of 10 samples and more along the radius, and 4 and more across, checks of 2 leave at most a fifth of their contrast.
        assert!((share - 0.5).abs() < 0.1, "column {column}: {share}");
    }
    assert!(columns(0.8, 0.95).count() > 5);
}
