//! The ideal picture of a layer: what an aberration-free lens of the same geometry would put on the film.

use dioptric_psf::FilmMap;
use dioptric_scene::View;
use dioptric_spectrum::{Cancel, Cancelled};
use ndarray::Array2;

use crate::{geometry::FilmFrame, layers::tent};

/// A rectangle of film pixels, which may reach beyond the film.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Rectangle {
    pub(crate) first_row: i64,
    pub(crate) first_column: i64,
    pub(crate) rows: usize,
    pub(crate) columns: usize,
}

impl Rectangle {
    /// Returns the part within `margin` pixels of a film, or `None` if there is none.
    pub(crate) fn clipped(&self, film_rows: usize, film_columns: usize, margin: usize) -> Option<Self> {
        let clip = |first: i64, n: usize, film: usize| {
            let start = first.max(-(margin as i64));
            let end = (first + n as i64).min((film + margin) as i64);
            (end > start).then(|| (start, (end - start) as usize))
        };
        let (first_row, rows) = clip(self.first_row, self.rows, film_rows)?;
        let (first_column, columns) = clip(self.first_column, self.columns, film_columns)?;
        Some(Self { first_row, first_column, rows, columns })
    }
}

/// One surface of the scene in one band: its radiance and its layer coordinates.
#[derive(Clone, Copy)]
pub(crate) struct Surface<'a> {
    pub(crate) radiance: &'a Array2<f32>,
    /// NaN where the surface has no sample.
    pub(crate) layer_coordinates: &'a Array2<f32>,
}

/// Resamples surfaces of the scene on the film.
pub(crate) struct Sampler {
    pub(crate) view: View,
    pub(crate) frame: FilmFrame,
    /// Samples a pixel, each way: more than one where the scene is finer than the film.
    pub(crate) per_pixel: usize,
    /// Samples of the scene a pixel of film, each way, at the axis.
    pub(crate) scene_per_film: f64,
}

/// The ideal picture of a layer within a rectangle, row by row.
#[derive(Default)]
pub(crate) struct IdealLayer {
    /// Irradiance, W m⁻² nm⁻¹.
    pub(crate) light: Vec<f32>,
    /// Alpha: the share of each pixel that the layer covers.
    pub(crate) alpha: Vec<f32>,
}

impl Sampler {
    /// Returns the sampler that takes as many samples a pixel as the scene has at the axis, at most `most` each way.
    pub(crate) fn new(view: View, frame: FilmFrame, map: &FilmMap, most: usize) -> Self {
        let tan_per_px = map.tan_per_mm(frame.pitch_mm()) * frame.pitch_mm();
        let scene_per_film = view.focal_px * tan_per_px;
        // A quarter finer than the film does no harm.
        let per_pixel = (scene_per_film - 0.25).ceil().clamp(1.0, most as f64) as usize;
        Self { view, frame, per_pixel, scene_per_film }
    }

    /// Puts what the surfaces show of a layer within a rectangle into `ideal`, and returns whether there is anything.
    ///
    /// Beyond the edge of the scene lies darkness at the depth of the edge.
    pub(crate) fn sample(
        &self,
        rectangle: Rectangle,
        map: &FilmMap,
        layer: usize,
        surfaces: &[Surface<'_>],
        ideal: &mut IdealLayer,
        cancel: &Cancel,
    ) -> Result<bool, Cancelled> {
        let IdealLayer { light, alpha } = ideal;
        light.clear();
        alpha.clear();
        let n = self.per_pixel;
        let share = 1.0 / (n * n) as f32;
        let layer = layer as f32;
        let mut total = 0.0;
        for row in 0..rectangle.rows {
            for column in 0..rectangle.columns {
                cancel.check()?;
                let (mut pixel_light, mut pixel_alpha) = (0.0, 0.0);
                for part in 0..n * n {
                    let offset = |k: usize| (k as f64 + 0.5) / n as f64 - 0.5;
                    let place_mm = self.frame.place_mm(
                        (rectangle.first_row + row as i64) as f64 + offset(part / n),
                        (rectangle.first_column + column as i64) as f64 + offset(part % n),
                    );
                    let Some((tan, gain)) = map.at(place_mm) else { continue };
                    let (v, u) = self.view.position_of(tan.x, tan.y);
                    for surface in surfaces {
                        let (l, c) = at(surface, v, u, layer);
                        pixel_light += l * gain as f32;
                        pixel_alpha += c;
                    }
                }
                light.push(pixel_light * share);
                alpha.push(pixel_alpha * share);
                total += pixel_alpha;
            }
        }
        Ok(total > 0.0)
    }
}

/// Returns radiance × weight and weight of a layer between the samples of a surface.
#[inline]
fn at(surface: &Surface<'_>, row: f64, column: f64, layer: f32) -> (f32, f32) {
    let (rows, columns) = surface.layer_coordinates.dim();
    let (last_row, last_column) = ((rows - 1) as f64, (columns - 1) as f64);
    let is_inside = row >= -0.5 && column >= -0.5 && row <= last_row + 0.5 && column <= last_column + 0.5;
    let (row, column) = (row.clamp(0.0, last_row), column.clamp(0.0, last_column));
    let (top, left) = (row as usize, column as usize);
    let (bottom, right) = ((top + 1).min(rows - 1), (left + 1).min(columns - 1));
    let (down, across) = ((row - top as f64) as f32, (column - left as f64) as f32);
    let corners = [
        (top, left, (1.0 - down) * (1.0 - across)),
        (top, right, (1.0 - down) * across),
        (bottom, left, down * (1.0 - across)),
        (bottom, right, down * across),
    ];
    let (mut light, mut alpha) = (0.0, 0.0);
    for (r, c, share) in corners {
        let weight = share * tent(surface.layer_coordinates[(r, c)], layer);
        light += weight * surface.radiance[(r, c)];
        alpha += weight;
    }
    if is_inside { (light, alpha) } else { (0.0, alpha) }
}
