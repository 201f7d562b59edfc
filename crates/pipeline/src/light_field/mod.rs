//! Light fields: pictures of one scene from a raster of viewpoints, refocused after the fact, and depth from their disparity.
//!
//! Views are upright as the photographer sees them, row 0 at the top; so is the raster of viewpoints, seen from behind the
//! camera. The geometry, its signs and units are derived in `docs/lightfield.md`.

mod decode;
mod depth;
mod frame;
mod geometry;
mod lattice;
mod shift;

use ndarray::Array2;
use rayon::prelude::*;

pub(crate) use decode::{ArrayFilm, Decoding};
pub use depth::{DepthEstimate, DepthSearch};
pub use frame::ArrayFrame;
pub use geometry::{ParallelCameras, ViewGeometry};
pub(crate) use lattice::fitted;

use crate::PipelineError;
use shift::shifted;

/// Pictures of one scene from a raster of viewpoints.
#[derive(Clone, Debug)]
pub struct LightField {
    // Invariants: there is a view, all have the same number of planes of one size, and a weight above 0 exists.
    rows: usize,
    columns: usize,
    views: Vec<View>,
    geometry: ViewGeometry,
}

/// What is seen from one viewpoint.
#[derive(Clone, Debug)]
pub(crate) struct View {
    /// One plane a channel, rows × columns.
    pub(crate) planes: Vec<Array2<f32>>,
    /// What it counts: 0 where the rim of the pupil cuts off a part of its light.
    pub(crate) weight: f32,
    /// Depth of what each sample sees, m, where the scene is known.
    pub(crate) depth_m: Option<Array2<f32>>,
}

impl LightField {
    /// Returns a light field of so many rows and columns of viewpoints; views are given row by row, from the top left on.
    ///
    /// # Errors
    /// When there are not as many views as that, they differ in size or in number of planes, or none of them counts.
    pub(crate) fn new(
        (rows, columns): (usize, usize),
        views: Vec<View>,
        geometry: ViewGeometry,
    ) -> Result<Self, PipelineError> {
        let wrong = |reason: String| PipelineError::Unsuitable { what: "the light field", reason };
        if rows * columns == 0 || views.len() != rows * columns {
            return Err(wrong(format!("{} views, expected {rows} × {columns}", views.len())));
        }
        let size_of = |view: &View| view.planes.first().map(|plane| (view.planes.len(), plane.dim()));
        let size = size_of(&views[0]);
        let has_size =
            |view: &View| size_of(view) == size && view.planes.iter().all(|p| Some(p.dim()) == size.map(|s| s.1));
        let Some((_, (height, width))) = size.filter(|_| views.iter().all(has_size)) else {
            return Err(wrong("its views differ in size".to_owned()));
        };
        if height == 0 || width == 0 {
            return Err(wrong("its views have no sample".to_owned()));
        }
        if !views.iter().any(|view| view.weight > 0.0) {
            return Err(wrong("no view is free of the rim of the pupil".to_owned()));
        }
        Ok(Self { rows, columns, views, geometry })
    }

    /// Rows and columns of viewpoints.
    pub fn n_views(&self) -> (usize, usize) {
        (self.rows, self.columns)
    }

    /// Rows and columns of samples of each view.
    pub fn size(&self) -> (usize, usize) {
        self.views[0].planes[0].dim()
    }

    /// How far apart neighboring views show a point.
    pub fn geometry(&self) -> &ViewGeometry {
        &self.geometry
    }

    /// Returns what is seen from a viewpoint, a plane a channel; row 0 is the highest viewpoint, column 0 that farthest to
    /// the left. `None` where there is no such viewpoint.
    pub fn view(&self, row: usize, column: usize) -> Option<&[Array2<f32>]> {
        (row < self.rows && column < self.columns).then(|| &self.views[row * self.columns + column].planes[..])
    }

    /// Returns the true depth of what each sample of a view sees, from the center of the entrance pupil, m, where the scene is known:
    /// along the line in the middle of the sample's light. Infinite where nothing is met, NaN where no light comes.
    pub fn true_depth_m(&self, row: usize, column: usize) -> Option<&Array2<f32>> {
        self.views.get(row * self.columns + column).filter(|_| column < self.columns)?.depth_m.as_ref()
    }

    /// Whether a view counts: whether no rim of the pupil cuts off a part of its light.
    pub fn is_whole(&self, row: usize, column: usize) -> bool {
        row < self.rows && column < self.columns && self.views[row * self.columns + column].weight > 0.0
    }

    /// Returns the views that count with how far their viewpoints lie to the right of the middle and above it, in steps
    /// between neighbors.
    fn whole_views(&self) -> impl Iterator<Item = (&View, [f64; 2])> {
        let middle = [0.5 * (self.columns as f64 - 1.0), 0.5 * (self.rows as f64 - 1.0)];
        let place = move |i: usize| [(i % self.columns) as f64 - middle[0], middle[1] - (i / self.columns) as f64];
        self.views.iter().enumerate().filter(|(_, view)| view.weight > 0.0).map(move |(i, view)| (view, place(i)))
    }

    /// Returns the picture that is sharp where neighboring views are this far apart, pixels: the mean of all views that
    /// count, each moved by what its viewpoint is away from the middle (shift and add). A plane a channel.
    pub fn refocused(&self, disparity_px: f64) -> Vec<Array2<f32>> {
        let total: f32 = self.whole_views().map(|(view, _)| view.weight).sum();
        let views: Vec<_> = self.whole_views().collect();
        (0..self.views[0].planes.len())
            .into_par_iter()
            .map(|channel| {
                let mut sum = Array2::zeros(self.size());
                for (view, [right, up]) in &views {
                    let moved = shifted(&view.planes[channel], disparity_px * right, -disparity_px * up);
                    sum.scaled_add(view.weight / total, &moved);
                }
                sum
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use dioptric_optics::Lens;
    use dioptric_spectrum::Cancel;

    use super::*;

    /// A smooth pattern that repeats nowhere within a view.
    fn pattern(x: f64, y: f64) -> f32 {
        let waves = [(0.31, 0.17, 0.3), (-0.13, 0.41, 1.1), (0.53, -0.29, 2.3), (0.07, 0.61, 0.7)];
        waves.iter().map(|(kx, ky, phase)| (kx * x + ky * y + phase).sin()).sum::<f64>() as f32 + 5.0
    }

    /// Views of a plane with a disparity on the left half, and of another on the right.
    fn field(left_px: f64, right_px: f64) -> LightField {
        let size = (40, 64);
        let view = |row: usize, column: usize| {
            let (right, up) = (column as f64 - 2.0, 1.0 - row as f64);
            let plane = Array2::from_shape_fn(size, |(y, x)| {
                let disparity = if x < 32 { left_px } else { right_px };
                // Nearer points move to the left in views from farther right, and down in those from above.
                pattern(x as f64 + disparity * right, y as f64 - disparity * up)
            });
            View { planes: vec![plane], weight: 1.0, depth_m: None }
        };
        let views = (0..15).map(|i| view(i / 5, i % 5)).collect();
        let lens = Lens::thin(50.0, 10.0).unwrap().at(550.0).unwrap();
        LightField::new((3, 5), views, ViewGeometry::cameras(&lens, 50.0, 20.0, 0.1)).unwrap()
    }

    #[test]
    fn refocusing_lines_views_up() {
        let field = field(0.7, 0.7);
        let sharp = &field.refocused(0.7)[0];
        for ((y, x), value) in sharp.indexed_iter().filter(|((y, x), _)| (4..36).contains(y) && (4..60).contains(x)) {
            // The cubic through four samples follows waves of ten and more to a per cent of their height.
            assert!((value - pattern(x as f64, y as f64)).abs() < 0.03, "{y} {x}");
        }
        let contrast = |plane: &Array2<f32>| plane.std(0.0);
        assert!(contrast(sharp) > 1.1 * contrast(&field.refocused(-0.7)[0]));
    }

    #[test]
    fn depth_follows_disparity() {
        let field = field(0.9, 0.25);
        let (near_m, far_m) = (field.geometry().depth_m(1.2), field.geometry().depth_m(0.1));
        let search = DepthSearch { near_m, far_m, radius_px: 3 };
        let found = field.depth(&search, &Cancel::new()).unwrap();
        for (columns, expected) in [(6..24, 0.9), (40..58, 0.25)] {
            for (y, x) in (6..34).flat_map(|y| columns.clone().map(move |x| (y, x))) {
                let disparity_px = f64::from(found.disparity_px[(y, x)]);
                assert!((disparity_px - expected).abs() < 0.02, "{y} {x}: {disparity_px}");
                let depth_m = f64::from(found.depth_m[(y, x)]);
                assert!((depth_m / field.geometry().depth_m(disparity_px) - 1.0).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn views_must_fit_each_other() {
        let lens = Lens::thin(50.0, 10.0).unwrap().at(550.0).unwrap();
        let view = |rows| View { planes: vec![Array2::zeros((rows, 4))], weight: 1.0, depth_m: None };
        let new = |views| LightField::new((1, 2), views, ViewGeometry::cameras(&lens, 50.0, 20.0, 0.1));
        assert!(new(vec![view(3), view(3)]).is_ok());
        for views in [vec![view(3)], vec![view(3), view(4)], vec![view(0), view(0)]] {
            assert!(new(views).is_err());
        }
    }
}
