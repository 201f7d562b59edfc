//! The ideal picture of a layer: what an aberration-free lens of the same geometry would put on the film.

use dioptric_psf::FilmMap;
use dioptric_scene::View;
use dioptric_spectrum::{Cancel, Cancelled};
use glam::DVec2;
use ndarray::{Array2, Axis, parallel::prelude::*};

use crate::{block_layers::BlockLayers, geometry::FilmFrame, layers::tent};

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

/// One surface of the scene: its layer coordinates, and its radiance in one band where its light is wanted.
#[derive(Clone, Copy)]
pub(crate) struct Surface<'a> {
    /// As many samples as there are layer coordinates, row by row.
    pub(crate) radiance: Option<&'a [f32]>,
    /// NaN where the surface has no sample.
    layer_coordinates: &'a [f32],
    /// Of [`LayerCoordinates`].
    ranges: &'a [(u16, u16)],
}

/// The layer coordinates of a surface.
pub(crate) struct LayerCoordinates {
    /// NaN where the surface has no sample.
    samples: Array2<f32>,
    /// The layers that have weight in each square between four samples, first and last: most squares lie in few layers, so
    /// most of the work of a layer is to find that it has no part of a square.
    ranges: Array2<(u16, u16)>,
}

impl LayerCoordinates {
    /// Takes samples in standard layout.
    pub(crate) fn new(samples: Array2<f32>, cancel: &Cancel) -> Result<Self, Cancelled> {
        let (rows, columns) = samples.dim();
        let mut ranges = Array2::from_elem((rows, columns), (u16::MAX, 0));
        ranges.axis_iter_mut(Axis(0)).into_par_iter().enumerate().try_for_each(|(top, mut line)| {
            cancel.check()?;
            let bottom = (top + 1).min(rows - 1);
            for (left, (first, last)) in line.iter_mut().enumerate() {
                let right = (left + 1).min(columns - 1);
                let corners = [(top, left), (top, right), (bottom, left), (bottom, right)].map(|at| samples[at]);
                for coordinate in corners.into_iter().filter(|coordinate| !coordinate.is_nan()) {
                    *first = (*first).min(coordinate as u16);
                    *last = (*last).max(coordinate.ceil() as u16);
                }
            }
            Ok(())
        })?;
        Ok(Self { samples, ranges })
    }

    /// The surface, with its radiance in standard layout where its light is wanted.
    pub(crate) fn surface<'a>(&'a self, radiance: Option<&'a [f32]>) -> Surface<'a> {
        let (samples, ranges) = (self.samples.as_slice(), self.ranges.as_slice());
        let standard = "made in standard layout";
        Surface { radiance, layer_coordinates: samples.expect(standard), ranges: ranges.expect(standard) }
    }

    pub(crate) fn samples(&self) -> &Array2<f32> {
        &self.samples
    }

    /// Returns the first and last layer with weight in each square that begins at a sample of a row.
    pub(crate) fn ranges_of_row(&self, row: usize) -> &[(u16, u16)] {
        let columns = self.ranges.ncols();
        &self.ranges.as_slice().expect("made in standard layout")[row * columns..][..columns]
    }

    /// The bytes of memory that they take.
    pub(crate) fn size_bytes(&self) -> usize {
        self.samples.len() * (size_of::<f32>() + size_of::<(u16, u16)>())
    }
}

/// Resamples surfaces of the scene on the film.
pub(crate) struct Sampler {
    pub(crate) view: View,
    /// Rows and columns of the scene.
    size: (usize, usize),
    pub(crate) frame: FilmFrame,
    /// Samples a pixel, each way: more than one where the scene is finer than the film.
    pub(crate) per_pixel: usize,
    /// Samples of the scene a pixel of film, each way, at the axis.
    pub(crate) scene_per_film: f64,
}

impl Sampler {
    /// Returns the sampler that takes as many samples a pixel as the scene has at the axis, at most `most` each way.
    pub(crate) fn new((view, size): (View, (usize, usize)), frame: FilmFrame, map: &FilmMap, most: usize) -> Self {
        let tan_per_px = map.tan_per_mm(frame.pitch_mm()) * frame.pitch_mm();
        let scene_per_film = view.focal_px * tan_per_px;
        // A quarter finer than the film does no harm.
        let per_pixel = (scene_per_film - 0.25).ceil().clamp(1.0, most as f64) as usize;
        Self { view, size, frame, per_pixel, scene_per_film }
    }

    /// Returns the ideal picture of a layer within a rectangle, row by row, or `None` where there is nothing of it: irradiance,
    /// W m⁻² nm⁻¹, where the surfaces have radiance, and alpha, the share of each pixel that the layer covers, where not.
    ///
    /// Beyond the edge of the scene lies darkness at the depth of the edge. `blocks` are those of the surfaces.
    pub(crate) fn sample(
        &self,
        rectangle: Rectangle,
        map: &FilmMap,
        layer: usize,
        surfaces: &[Surface<'_>],
        blocks: &BlockLayers,
        cancel: &Cancel,
    ) -> Result<Option<Vec<f32>>, Cancelled> {
        let mut ideal = Vec::with_capacity(rectangle.rows * rectangle.columns);
        let n = self.per_pixel;
        let share = 1.0 / (n * n) as f32;
        let mut has_any = false;
        // Places of the samples within pixels, mm from the axis.
        let along = |first: i64, n_pixels: usize| -> Vec<f64> {
            let place = |k: usize| first as f64 + (k as f64 + 0.5) / n as f64 - 0.5;
            (0..n * n_pixels).map(place).collect()
        };
        let x_mm: Vec<f64> =
            along(rectangle.first_column, rectangle.columns).iter().map(|&c| self.frame.x_mm(c)).collect();
        let y_mm: Vec<f64> = along(rectangle.first_row, rectangle.rows).iter().map(|&r| self.frame.y_mm(r)).collect();
        for (row, y_mm) in (rectangle.first_row..).zip(y_mm.chunks_exact(n)) {
            cancel.check()?;
            let blocks = blocks.of_row(row);
            for (column, x_mm) in (rectangle.first_column..).zip(x_mm.chunks_exact(n)) {
                if blocks.is_some_and(|blocks| !blocks.may_have(column, layer)) {
                    ideal.push(0.0);
                    continue;
                }
                let mut sum = 0.0;
                for (&y, &x) in y_mm.iter().flat_map(|y| x_mm.iter().map(move |x| (y, x))) {
                    let Some((tan, gain)) = map.at(DVec2::new(x, y)) else { continue };
                    let (v, u) = self.view.position_of(tan.x, tan.y);
                    let square = Square::at(self.size, v, u);
                    for surface in surfaces {
                        let Some((value, weight)) = square.value_of(surface, layer) else { continue };
                        sum += if surface.radiance.is_some() { value * gain as f32 } else { weight };
                        has_any |= weight > 0.0;
                    }
                }
                ideal.push(sum * share);
            }
        }
        Ok(has_any.then_some(ideal))
    }
}

/// A place between four samples of the scene; beyond the edge of the scene, at the edge.
struct Square {
    /// The numbers of the samples, row by row, the first of which is that of the square.
    corners: [usize; 4],
    down: f32,
    across: f32,
    /// Whether the place lies on the scene.
    is_inside: bool,
}

impl Square {
    #[inline]
    fn at((rows, columns): (usize, usize), row: f64, column: f64) -> Self {
        let (last_row, last_column) = ((rows - 1) as f64, (columns - 1) as f64);
        let is_inside = row >= -0.5 && column >= -0.5 && row <= last_row + 0.5 && column <= last_column + 0.5;
        let (row, column) = (row.clamp(0.0, last_row), column.clamp(0.0, last_column));
        let (top, left) = (row as u32 as usize, column as u32 as usize);
        let (below, beside) = (if top + 1 < rows { columns } else { 0 }, usize::from(left + 1 < columns));
        let first = top * columns + left;
        Self {
            corners: [first, first + beside, first + below, first + below + beside],
            down: (row - f64::from(top as u32)) as f32,
            across: (column - f64::from(left as u32)) as f32,
            is_inside,
        }
    }

    /// Returns radiance × weight (0 where there is no radiance) and weight of a layer, or `None` where it has no weight.
    #[inline]
    fn value_of(&self, surface: &Surface<'_>, layer: usize) -> Option<(f32, f32)> {
        let (first, last) = surface.ranges[self.corners[0]];
        if layer < usize::from(first) || layer > usize::from(last) {
            return None;
        }
        let Self { down, across, .. } = *self;
        let shares = [(1.0 - down) * (1.0 - across), (1.0 - down) * across, down * (1.0 - across), down * across];
        let coordinate = layer as f32;
        let (mut light, mut alpha) = (0.0, 0.0);
        for (corner, share) in self.corners.into_iter().zip(shares) {
            let weight = share * tent(surface.layer_coordinates[corner], coordinate);
            light += surface.radiance.map_or(0.0, |radiance| weight * radiance[corner]);
            alpha += weight;
        }
        Some((if self.is_inside { light } else { 0.0 }, alpha))
    }
}
