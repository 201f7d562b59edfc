//! The ideal picture of a layer: what an aberration-free lens of the same geometry would put on the film.

use dioptric_psf::FilmMap;
use dioptric_scene::View;
use dioptric_spectrum::{Cancel, Cancelled};
use ndarray::{Array2, Axis, parallel::prelude::*};

use crate::{
    Film,
    block_layers::BlockLayers,
    geometry::FilmFrame,
    layers::tent,
    rectangle::Rectangle,
    sample_density::SampleDensity,
    squares::{SceneRaster, Squares, UNSEEN},
};

/// One surface of the scene: its layer coordinates, and its radiance in one band where its light is wanted.
#[derive(Clone, Copy)]
pub(crate) struct Surface<'a> {
    /// As many samples as there are layer coordinates, row by row.
    pub(crate) radiance: Option<&'a [f32]>,
    /// NaN where the surface has no sample.
    layer_coordinates: &'a [f32],
    /// Of [`LayerCoordinates`].
    ranges: &'a [(u16, u16)],
    /// Whether all samples lie in the first layer and no other.
    is_flat: bool,
}

/// The layer coordinates of a surface.
pub(crate) struct LayerCoordinates {
    /// NaN where the surface has no sample.
    samples: Array2<f32>,
    /// The layers that have weight in each square between four samples, first and last: most squares lie in few layers, so
    /// most of the work of a layer is to find that it has no part of a square.
    ranges: Array2<(u16, u16)>,
    is_flat: bool,
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
        let is_flat = samples.iter().all(|coordinate| *coordinate == 0.0);
        Ok(Self { samples, ranges, is_flat })
    }

    /// The surface, with its radiance in standard layout where its light is wanted.
    pub(crate) fn surface<'a>(&'a self, radiance: Option<&'a [f32]>) -> Surface<'a> {
        let (samples, ranges) = (self.samples.as_slice(), self.ranges.as_slice());
        let standard = "made in standard layout";
        let (layer_coordinates, ranges) = (samples.expect(standard), ranges.expect(standard));
        Surface { radiance, layer_coordinates, ranges, is_flat: self.is_flat }
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
    pub(crate) scene: SceneRaster,
    pub(crate) frame: FilmFrame,
    density: SampleDensity,
    /// Samples of the scene a pixel of film, each way, at the axis.
    pub(crate) scene_per_film: f64,
}

impl Sampler {
    /// Returns the sampler that takes as many samples of each pixel of a raster as it sees of the scene, at most `most` each way.
    /// The pixels of the raster are `factor` times as wide as the film's.
    pub(crate) fn new(
        (view, size): (View, (usize, usize)),
        (film, factor): (&Film, usize),
        map: &FilmMap,
        most: usize,
    ) -> Self {
        let frame = FilmFrame::new(film, factor);
        let scene_per_film = view.focal_px * map.tan_per_mm(frame.pitch_mm()) * frame.pitch_mm();
        let scene = SceneRaster { view, rows: size.0, columns: size.1 };
        Self { scene, frame, density: SampleDensity::of((&view, size), film, map, most), scene_per_film }
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
        // All that a scene at one depth has is in one layer, with weight 1: no weights to look up, to the same bits.
        let flat = match surfaces {
            [Surface { radiance: Some(radiance), is_flat: true, .. }] if layer == 0 => Some(*radiance),
            _ => None,
        };
        let is_of_light = surfaces.iter().all(|surface| surface.radiance.is_some());
        let mut ideal = vec![0.0; rectangle.rows * rectangle.columns];
        let mut has_any = false;
        let (mut squares, mut light) = (Squares::default(), vec![]);
        for (down, line) in ideal.chunks_exact_mut(rectangle.columns).enumerate() {
            cancel.check()?;
            let row = rectangle.first_row + down as i64;
            let blocks = blocks.of_row(row);
            let mut start = 0;
            while start < rectangle.columns {
                let run = match &blocks {
                    Some(blocks) => blocks.next_run(rectangle.first_column, start..rectangle.columns, layer),
                    None => start..rectangle.columns,
                };
                let (run, samples) = self.density.first_run(row, rectangle.first_column, run);
                start = run.end;
                // Beyond the scene there is no light, but what lies there may hide some: a look a pixel is enough for that.
                if is_of_light && samples.is_beyond_scene {
                    continue;
                }
                let (n_down, n) = if samples.is_beyond_scene { (1, 1) } else { (samples.down, samples.across) };
                let first_column = rectangle.first_column + run.start as i64;
                let x_mm = |place: usize| self.frame.x_mm(place_in(first_column, place, n));
                let pixels = &mut line[run];
                for place in 0..n_down {
                    let y_mm = self.frame.y_mm(place_in(row, place, n_down));
                    let n_places = n * pixels.len();
                    if let Some(radiance) = flat {
                        squares.find(&self.scene, map, n_places, (x_mm, y_mm));
                        squares.light(&self.scene, radiance, &mut light);
                        add_by_pixel(&light, n, pixels);
                        has_any |= squares.sees_any(n_places);
                        continue;
                    }
                    squares.find_each(&self.scene, map, n_places, (x_mm, y_mm));
                    for (pixel, first) in pixels.iter_mut().zip((0..).step_by(n)) {
                        for at in first..first + n {
                            has_any |= self.add(&squares, at, surfaces, layer, pixel);
                        }
                    }
                }
                let share = 1.0 / (n_down * n) as f32;
                pixels.iter_mut().for_each(|pixel| *pixel *= share);
            }
        }
        Ok(has_any.then_some(ideal))
    }

    /// Adds what of a layer is seen at a place to a pixel: light where the surfaces have radiance, weight where not. Returns
    /// whether there is any.
    #[inline]
    fn add(&self, squares: &Squares, at: usize, surfaces: &[Surface<'_>], layer: usize, pixel: &mut f32) -> bool {
        let first = squares.first[at] as usize;
        if first == UNSEEN as usize {
            return false;
        }
        let (beside, below) = self.scene.steps();
        let corners = [first, first + beside, first + below, first + below + beside];
        let (down, across) = (squares.down[at], squares.across[at]);
        let shares = [(1.0 - down) * (1.0 - across), (1.0 - down) * across, down * (1.0 - across), down * across];
        let mut has_any = false;
        for surface in surfaces {
            let (first, last) = surface.ranges[corners[0]];
            if layer < usize::from(first) || layer > usize::from(last) {
                continue;
            }
            let weights: [f32; 4] =
                std::array::from_fn(|i| shares[i] * tent(surface.layer_coordinates[corners[i]], layer as f32));
            let weight = weights[0] + weights[1] + weights[2] + weights[3];
            has_any |= weight > 0.0;
            *pixel += match surface.radiance {
                Some(radiance) => {
                    let light: f32 = (0..4).map(|i| weights[i] * radiance[corners[i]]).sum();
                    light * squares.gain[at]
                }
                None => weight,
            };
        }
        has_any
    }
}

/// Returns the place of a sample, `n` of which lie in each of some pixels, as a row or column of the film; pixels are counted from `first`.
fn place_in(first: i64, sample: usize, n: usize) -> f64 {
    first as f64 + (sample as f64 + 0.5) / n as f64 - 0.5
}

/// Adds `n` samples to each of some pixels.
fn add_by_pixel(samples: &[f32], n: usize, pixels: &mut [f32]) {
    for (pixel, samples) in pixels.iter_mut().zip(samples.chunks_exact(n)) {
        samples.iter().for_each(|sample| *pixel += sample);
    }
}
