//! A lens on a film that reaches far beyond the fields whose light it gathers.

#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

use dioptric_forward::{Film, PsfDomain, Settings, irradiance};
use dioptric_optics::Lens;
use dioptric_psf::{Diffraction, FieldSampling, LensImageModel, SampleCounts};
use dioptric_scene::{Scene, View};
use dioptric_spectrum::{DepthMap, Quantity, SpectralImage, WavelengthGrid};
use ndarray::Array2;

/// Half the field that the scene has, to its sides and up and down: 23° and 16°.
const HALF_TAN: (f64, f64) = (0.43, 0.287);

/// Returns the irradiance of a film of so many rows and half as many more columns under a simple asphere of 15 mm, and the field beyond which its light is
/// scattered.
fn checks_on(rows: usize) -> (Array2<f32>, Option<f64>) {
    let lens = Lens::built_in("asphere-15mm").unwrap().with_f_number(4.0, 550.0).unwrap();
    let (scene_rows, scene_columns) = (240, 360);
    let grid = WavelengthGrid::new(vec![550.0]).unwrap();
    let checks = Array2::from_shape_fn((scene_rows, scene_columns), |(r, c)| f32::from((r / 20 + c / 20) as u8 % 2));
    let radiance = SpectralImage::new(Quantity::Radiance, grid.clone(), vec![checks]).unwrap();
    let focal_px = 0.5 * scene_columns as f64 / HALF_TAN.0;
    let view = View { focal_px, center_x_px: 179.5, center_y_px: 119.5 };
    let depth = DepthMap::new(Array2::from_elem((scene_rows, scene_columns), 2.0)).unwrap();
    let scene = Scene { depth: Some(depth), view: Some(view), ..Scene::new("checks", radiance) };
    let film = Film::centered(rows, rows * 3 / 2, 66.0);
    let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2000.0).unwrap();
    let (diffraction, depth_range_m) = (Diffraction::None, (2.0, 2.0));
    let domain = PsfDomain { lens: &lens, film: &film, film_distance_mm, depth_range_m, grid: &grid, diffraction };
    let counts = SampleCounts { n_radial: 24, ..SampleCounts::STANDARD };
    let model = LensImageModel::build(&lens, &domain.settings().unwrap().with_counts(counts)).unwrap();
    let mut bands = vec![];
    irradiance(&scene, &model, &film, &Settings::default(), &|_| {}, &mut |_, band| {
        bands.push(band);
        Ok(())
    })
    .unwrap();
    (bands.remove(0), model.scattered_beyond_tan())
}

/// Rays of fields beyond 57° land anywhere on the film. When they were in the model, the picture was smeared over hundreds of pixels in the middle as well.
#[test]
fn a_larger_film_has_the_same_picture_in_its_middle() {
    let (small, none) = checks_on(160);
    assert_eq!(none, None, "all of a film of 32° sees gathered light");
    let mean = f64::from(small.sum()) / small.len() as f64;
    for rows in [240, 320, 480] {
        let (large, scattered_beyond) = checks_on(rows);
        let (first_row, first_column) = ((rows - 160) / 2, (rows * 3 / 2 - 240) / 2);
        let middle = large.slice(ndarray::s![first_row..first_row + 160, first_column..first_column + 240]);
        let square: f64 = small.iter().zip(&middle).map(|(a, b)| f64::from(a - b).powi(2)).sum();
        let rms = (square / small.len() as f64).sqrt() / mean;
        let light = f64::from(large.sum() / small.sum());
        println!("{rows} rows: rms {rms:.4} of the mean, light {light:.4}, scattered beyond {scattered_beyond:?}");
        // Reference points follow the middle rays of all fields, those of the large film others than those of the small: edges of checks move in their pixels.

        assert!((light - 1.0).abs() < 2e-3, "{rows} rows: {light}");
        // The rms spread of the asphere is a third of its image height at 54°.
        let last_deg = scattered_beyond.unwrap().atan().to_degrees();
        assert!((52.0..56.0).contains(&last_deg), "{rows} rows: {last_deg}");
    }
}

/// Fields of a lens without an axis are sampled on a grid, which has to cover the film, and beyond it no fields whose light goes anywhere.
#[test]
fn grid_of_fields_ends_where_light_is_scattered() {
    let lens = Lens::built_in("asphere-15mm").unwrap().with_f_number(4.0, 550.0).unwrap();
    let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2000.0).unwrap();
    let grid = WavelengthGrid::new(vec![450.0, 550.0, 650.0]).unwrap();
    let corner_deg = |rows: usize| {
        let film = Film::centered(rows, rows * 3 / 2, 66.0);
        let (diffraction, depth_range_m) = (Diffraction::None, (1.0, 3.0));
        let domain = PsfDomain { lens: &lens, film: &film, film_distance_mm, depth_range_m, grid: &grid, diffraction };
        match domain.grid_settings().unwrap().fields {
            FieldSampling::Grid { tans_x: x, tans_y: y } => x[x.len() - 1].hypot(y[y.len() - 1]).atan().to_degrees(),
            other => panic!("a grid was asked for, not {other:?}"),
        }
    };
    // The corner of 24 × 16 mm lies 14.3 mm out, at 44°; that of 32 × 21 mm 19 mm out, at 52°.
    let [small, large] = [240, 320].map(corner_deg);
    assert!((44.0..56.5).contains(&small) && (52.0..57.5).contains(&large), "{small} {large}");
}
