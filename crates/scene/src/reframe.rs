//! A scene on other samples of the same picture.

use dioptric_spectrum::{DepthMap, SpectralImage};
use ndarray::Array2;
use rayon::prelude::*;

use crate::{Scene, SceneError, View};

/// How far beyond the outermost centers of the old samples new ones may lie, in old samples: to the edge of the picture and rounding.
const MARGIN: f64 = 0.5 + 1e-6;

impl Scene {
    /// Returns the scene on `rows` × `columns` samples of another view from the same projection center: wider or narrower, finer or coarser.
    ///
    /// Radiance runs in straight lines between the old samples, both ways, and is that of the outermost samples in the half sample around
    /// them; a depth is that of the nearest sample, since between an object and what lies behind it there is nothing. Samples much larger than
    /// the old ones do not average them: see [`binned`](Self::binned).
    ///
    /// # Errors
    /// When the scene has no view, or the new samples reach beyond the old ones.
    pub fn reframed(&self, view: View, rows: usize, columns: usize) -> Result<Self, SceneError> {
        let old = self.require_view()?;
        let (first, last) = (view.tan_at(0.0, 0.0), view.tan_at(rows as f64 - 1.0, columns as f64 - 1.0));
        let ((top, left), (bottom, right)) = (old.position_of(first.0, first.1), old.position_of(last.0, last.1));
        let rows = Line::new("rows", rows, (top, bottom), self.rows())?;
        let columns = Line::new("columns", columns, (left, right), self.columns())?;
        let image = |image: &SpectralImage| {
            let planes = image.planes().par_iter().map(|plane| between(plane, &rows, &columns)).collect();
            SpectralImage::new(image.quantity(), image.grid().clone(), planes)
        };
        let depth = |depth: &DepthMap| DepthMap::new(nearest(depth.z_m(), &rows, &columns));
        self.with_samples(image, depth, Some(view))
    }
}

/// Where new samples of a row or a column lie among the old ones.
struct Line {
    /// The old sample before each new one, and how far it is to the next, 0–1.
    places: Vec<(usize, f32)>,
}

impl Line {
    /// Returns `n` samples evenly from the first to the last position among `n_old`.
    fn new(what: &'static str, n: usize, (first, last): (f64, f64), n_old: usize) -> Result<Self, SceneError> {
        let end = n_old as f64 - 1.0;
        let is_within = n > 0 && first >= -MARGIN && last <= end + MARGIN;
        if !is_within {
            return Err(SceneError::Setting {
                what,
                value: format!("{n} from sample {first:.1} to sample {last:.1}"),
                expected: format!("a part of samples 0 to {end}"),
            });
        }
        let step = if n > 1 { (last - first) / (n - 1) as f64 } else { 0.0 };
        let place = |i: usize| {
            let at = (first + step * i as f64).clamp(0.0, end);
            let before = (at as usize).min(n_old.saturating_sub(2));
            (before, (at - before as f64) as f32)
        };
        Ok(Self { places: (0..n).map(place).collect() })
    }
}

fn between(plane: &Array2<f32>, rows: &Line, columns: &Line) -> Array2<f32> {
    let (last_row, last_column) = (plane.nrows() - 1, plane.ncols() - 1);
    Array2::from_shape_fn((rows.places.len(), columns.places.len()), |(row, column)| {
        let ((r, down), (c, across)) = (rows.places[row], columns.places[column]);
        let (below, right) = ((r + 1).min(last_row), (c + 1).min(last_column));
        let along = |r: usize| (1.0 - across) * plane[(r, c)] + across * plane[(r, right)];
        (1.0 - down) * along(r) + down * along(below)
    })
}

fn nearest(plane: &Array2<f32>, rows: &Line, columns: &Line) -> Array2<f32> {
    let at = |(before, part): (usize, f32)| before + usize::from(part > 0.5);
    Array2::from_shape_fn((rows.places.len(), columns.places.len()), |(row, column)| {
        plane[(at(rows.places[row]), at(columns.places[column]))]
    })
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use dioptric_spectrum::{Quantity, WavelengthGrid};

    use super::*;

    /// A scene whose radiance is linear in the tangents to its samples, half of it near.
    fn ramp(fov_deg: f64, rows: usize, columns: usize) -> Scene {
        let view = View::from_horizontal_fov_deg(fov_deg, columns, rows).unwrap();
        let tan = |row: usize, column: usize| view.tan_at(row as f64, column as f64);
        let plane = Array2::from_shape_fn((rows, columns), |(r, c)| {
            let (x, y) = tan(r, c);
            (2.0 + x - 3.0 * y) as f32
        });
        let z_m = Array2::from_shape_fn((rows, columns), |(r, c)| if tan(r, c).0 < 0.013 { 1.0 } else { 4.0 });
        let grid = WavelengthGrid::new(vec![550.0]).unwrap();
        let radiance = SpectralImage::new(Quantity::Radiance, grid, vec![plane]).unwrap();
        Scene { depth: Some(DepthMap::new(z_m).unwrap()), view: Some(view), ..Scene::new("ramp", radiance) }
    }

    #[test]
    fn a_ramp_stays_the_ramp() {
        let wide = ramp(50.0, 60, 80);
        for (fov_deg, rows, columns) in [(40.0, 33, 47), (30.0, 100, 150), (12.0, 5, 9), (1.0, 1, 1)] {
            let wanted = ramp(fov_deg, rows, columns);
            let found = wide.reframed(wanted.view.unwrap(), rows, columns).unwrap();
            for (found, wanted) in found.radiance.planes()[0].iter().zip(&wanted.radiance.planes()[0]) {
                assert_relative_eq!(found, wanted, max_relative = 1e-6);
            }
            // A depth is one of the two, and differs only beside the edge.
            let depths = |scene: &Scene| scene.depth.clone().unwrap().z_m().clone();
            let differing = depths(&found).iter().zip(&depths(&wanted)).filter(|(a, b)| a != b).count();
            assert!(differing <= rows * columns.div_ceil(40), "{differing} of {rows} × {columns}");
            assert!(depths(&found).iter().all(|z| [1.0, 4.0].contains(z)));
        }
    }

    #[test]
    fn the_same_samples_stay_as_they_are() {
        let scene = ramp(34.0, 6, 9);
        assert_eq!(scene.reframed(scene.view.unwrap(), 6, 9).unwrap(), scene);
        // The half sample around the outermost centers belongs to the picture.
        let finer = ramp(34.0, 12, 18);
        let found = scene.reframed(finer.view.unwrap(), 12, 18).unwrap();
        assert_eq!(found.radiance.planes()[0][(0, 0)], scene.radiance.planes()[0][(0, 0)]);
    }

    #[test]
    fn nothing_is_made_up_beyond_the_picture() {
        let scene = ramp(34.0, 20, 30);
        let wider = View::from_horizontal_fov_deg(36.0, 30, 20).unwrap();
        let message = scene.reframed(wider, 20, 30).unwrap_err().to_string();
        assert!(message.contains("samples 0 to 19"), "{message}");
        let taller = View::from_horizontal_fov_deg(34.0, 30, 24).unwrap();
        assert!(scene.reframed(taller, 24, 30).is_err() && scene.reframed(wider, 0, 30).is_err());
        assert!(Scene { view: None, ..scene.clone() }.reframed(wider, 20, 30).is_err());
    }
}
