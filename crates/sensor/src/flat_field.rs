//! Frames divided by one of an even white, which undoes what lens and small lenses shade.

use ndarray::Array2;

use crate::{Levels, Raw, RawPlane, SensorError, Tile};

/// The share of the brightest below which a white frame tells nothing of how much was shaded.
const DARKEST: f32 = 0.05;
/// The share of pixels that are darker than what counts as not shaded.
const UNSHADED: f64 = 0.99;

impl Raw {
    /// Returns the frame with each pixel divided by the share of light that reached it in a frame of an even white; where that is below a
    /// twentieth, by a twentieth.
    ///
    /// # Errors
    /// When the frames differ in size, mosaic or number of planes.
    pub fn flat_fielded(&self, white: &Self) -> Result<Self, SensorError> {
        let layout = |raw: &Self| (raw.size(), raw.tile.clone(), raw.planes.len());
        if layout(self) != layout(white) {
            let told = |raw: &Self| {
                let (rows, columns) = raw.size();
                let mosaic = if raw.tile.is_some() { "a mosaic" } else { "planes" };
                format!("{columns} × {rows} pixels of {mosaic} of {}", raw.filter_names.join(" "))
            };
            return Err(SensorError::Shape { what: "white frame", expected: told(self), found: told(white) });
        }
        let shares = white.unshaded_shares();
        let planes = self.linear().into_iter().zip(shares).map(|(light, share)| {
            RawPlane::Evened(ndarray::Zip::from(&light).and(&share).map_collect(|v, share| v / share.max(DARKEST)))
        });
        let saturation_e = self.levels.saturation_e();
        Ok(Self {
            planes: planes.collect(),
            levels: Levels::of_file((0.0, 1.0, 1.0), saturation_e, None),
            ..self.clone()
        })
    }

    /// Returns the share of light that reached each pixel of a frame of an even white, a plane each: 1 in those of its filter that are
    /// shaded least.
    pub fn unshaded_shares(&self) -> Vec<Array2<f32>> {
        let whole = Tile::single(0);
        let tile = self.tile.as_ref().unwrap_or(&whole);
        let shares = |plane: Array2<f32>| {
            let filter = |(row, column): (usize, usize)| tile.filter_at(row, column);
            let mut of_filter = vec![Vec::new(); tile.n_filters()];
            plane.indexed_iter().for_each(|(place, v)| of_filter[filter(place)].push(*v));
            let full = |values: &mut Vec<f32>| {
                let at = ((UNSHADED * values.len() as f64) as usize).min(values.len() - 1);
                values.select_nth_unstable_by(at, f32::total_cmp).1.max(f32::MIN_POSITIVE)
            };
            let full: Vec<f32> = of_filter.iter_mut().map(|v| if v.is_empty() { 1.0 } else { full(v) }).collect();
            Array2::from_shape_fn(plane.dim(), |place| plane[place] / full[filter(place)])
        };
        self.linear().into_iter().map(shares).collect()
    }
}
