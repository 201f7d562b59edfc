//! What lies around a film, whose wings reach into it.

use dioptric_psf::FilmMap;
use ndarray::{Array2, s};

use crate::{
    Film,
    halo::beside,
    places::{Places, SceneRaster, UNSEEN},
    points::Point,
    raster::{BLOCK, Level, Raster},
    tile::film_pixels,
};

/// A film, and where in the scene what lies around it is seen.
pub(crate) struct Surroundings<'a> {
    pub(crate) film: &'a Film,
    pub(crate) scene: &'a SceneRaster,
    pub(crate) map: &'a FilmMap,
}

impl Surroundings<'_> {
    /// Returns a picture changed by what is done to it with its surroundings: what chief rays see of the radiance of a surface, row by row, if any, and points. `change` is also
    /// told how many pixels lie beside the picture.
    pub(crate) fn with(
        &self,
        picture: &Array2<f32>,
        (radiance, points): (&[f32], &[Point]),
        change: impl FnOnce(Array2<f32>, usize) -> Array2<f32>,
    ) -> Array2<f32> {
        let m = beside(self.film);
        let (rows, columns) = picture.dim();
        let (wide_rows, wide_columns) = (rows + 2 * m, columns + 2 * m);
        let (pixels, film) = (Raster::new(self.film, Level::PIXEL), film_pixels(self.film));
        let (first_row, first_column) = (film.first_row - m as i64, film.first_column - m as i64);
        let mut wide = vec![0.0; wide_rows * wide_columns];
        if !radiance.is_empty() {
            let (across, down) = self.scene.steps();
            let step_mm = pixels.x_mm(1.0) - pixels.x_mm(0.0);
            let mut places = Places::default();
            // The film has its own picture; what lies to the right of it is looked up from a point on that is as one from the left is.
            let after = (m + columns) / BLOCK as usize * BLOCK as usize;
            for (row, line) in wide.chunks_exact_mut(wide_columns).enumerate() {
                let y_mm = pixels.y_mm((first_row + row as i64) as f64);
                let is_beside = (m..m + rows).contains(&row);
                for part in if is_beside { [0..m, after..wide_columns] } else { [0..wide_columns, 0..0] } {
                    let first_mm = pixels.x_mm((first_column + part.start as i64) as f64);
                    places.find(self.scene, self.map, part.len(), (first_mm, step_mm, y_mm));
                    for (k, value) in line[part].iter_mut().enumerate().filter(|(k, _)| places.first[*k] != UNSEEN) {
                        let first = places.first[k] as usize;
                        let nearest = first
                            + if places.across[k] >= 0.5 { across } else { 0 }
                            + if places.down[k] >= 0.5 { down } else { 0 };
                        *value = radiance[nearest] * places.light[k];
                    }
                }
            }
        }
        for point in points {
            let [down_px, across_px] = point.place_px(1e-3 * self.film.pitch_um);
            let row = pixels.row_before(down_px + 0.5) - first_row;
            let column = pixels.column_before(across_px + 0.5) - first_column;
            if (0..wide_rows as i64).contains(&row) && (0..wide_columns as i64).contains(&column) {
                wide[row as usize * wide_columns + column as usize] += point.light() as f32;
            }
        }
        for (row, line) in picture.rows().into_iter().enumerate() {
            let own = &mut wide[(row + m) * wide_columns + m..][..columns];
            own.iter_mut().zip(line).for_each(|(own, value)| *own = *value);
        }
        let wide = Array2::from_shape_vec((wide_rows, wide_columns), wide).expect("a value for each pixel");
        change(wide, m).slice(s![m..m + rows, m..m + columns]).to_owned()
    }
}
