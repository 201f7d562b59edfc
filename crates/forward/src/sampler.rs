//! The ideal picture of a layer: what a lens without blur would put on the film.

use dioptric_psf::FilmMap;
use dioptric_spectrum::{Cancel, Cancelled};
use rayon::prelude::*;

use crate::{
    blocks::Blocks,
    layers::tent,
    places::{Places, SceneRaster, UNSEEN},
    raster::Raster,
    rectangle::Rectangle,
    surface::Surface,
};

/// A layer on a raster: radiance, and the fraction of each sample that it covers.
pub(crate) struct IdealLayer {
    pub(crate) at: Rectangle,
    /// Radiance times coverage.
    pub(crate) light: Vec<f32>,
    /// Empty where nothing hides anything.
    pub(crate) alpha: Vec<f32>,
    /// Of each row the samples with anything, first and after the last, counted from the first of the row.
    pub(crate) lit: Vec<(usize, usize)>,
}

impl IdealLayer {
    /// Whether there is anything in a rectangle.
    pub(crate) fn has_any(&self, within: &Rectangle) -> bool {
        let Some(common) = within.intersection(&self.at) else { return false };
        let first = (common.first_column - self.at.first_column) as usize;
        let rows = self.lit[(common.first_row - self.at.first_row) as usize..].iter().take(common.rows);
        rows.into_iter().any(|&(start, end)| start < first + common.columns && end > first)
    }
}

/// Resamples surfaces of the scene on rasters of the film, in one band.
pub(crate) struct Sampler<'a> {
    pub(crate) scene: SceneRaster,
    pub(crate) map: &'a FilmMap,
    pub(crate) blocks: &'a Blocks,
    pub(crate) surfaces: &'a [Surface<'a>],
    /// Whether the fractions that layers cover are wanted.
    pub(crate) with_alpha: bool,
}

impl Sampler<'_> {
    /// Returns what a layer puts on a rectangle of a raster.
    pub(crate) fn sample(
        &self,
        raster: &Raster,
        at: Rectangle,
        layer: usize,
        cancel: &Cancel,
    ) -> Result<IdealLayer, Cancelled> {
        let mut light = vec![0.0; at.len()];
        let mut alpha = vec![0.0; if self.with_alpha { at.len() } else { 0 }];
        let mut lit = vec![(0, 0); at.rows];
        let lines = light.par_chunks_mut(at.columns).zip(&mut lit).enumerate();
        let fill = |places: &mut Places, row: usize, light: &mut [f32], alpha: &mut [f32]| {
            self.row(raster, (at.first_row + row as i64, at.first_column), layer, places, (light, alpha))
        };
        if self.with_alpha {
            lines.zip(alpha.par_chunks_mut(at.columns)).try_for_each_init(
                Places::default,
                |places, ((row, (light, lit)), alpha)| {
                    cancel.check()?;
                    *lit = fill(places, row, light, alpha);
                    Ok(())
                },
            )?;
        } else {
            lines.try_for_each_init(Places::default, |places, (row, (light, lit))| {
                cancel.check()?;
                *lit = fill(places, row, light, &mut []);
                Ok(())
            })?;
        }
        Ok(IdealLayer { at, light, alpha, lit })
    }

    /// Fills a row, and returns the samples that have anything.
    fn row(
        &self,
        raster: &Raster,
        (row, first_column): (i64, i64),
        layer: usize,
        places: &mut Places,
        (light, alpha): (&mut [f32], &mut [f32]),
    ) -> (usize, usize) {
        let end = first_column + light.len() as i64;
        let (mut start, mut lit) = (first_column, (light.len(), 0));
        loop {
            let (run, [n_down, n_across]) = self.blocks.next_run(raster, row, start..end, layer);
            if run.is_empty() {
                return if lit.0 < lit.1 { lit } else { (0, 0) };
            }
            start = run.end;
            let within = (run.start - first_column) as usize..(run.end - first_column) as usize;
            let (light, mut alpha) =
                (&mut light[within.clone()], if alpha.is_empty() { &mut [][..] } else { &mut alpha[within.clone()] });
            let step_mm = (raster.x_mm(1.0) - raster.x_mm(0.0)) / n_across as f64;
            let first_mm = raster.x_mm(run.start as f64 - 0.5) + 0.5 * step_mm;
            let mut has_any = false;
            for line in 0..n_down {
                let y_mm = raster.y_mm(row as f64 + (line as f64 + 0.5) / n_down as f64 - 0.5);
                places.find(&self.scene, self.map, n_across * light.len(), (first_mm, step_mm, y_mm));
                has_any |= self.add(places, n_across, layer, (light, &mut alpha));
            }
            let share = 1.0 / (n_down * n_across) as f32;
            if share != 1.0 {
                light.iter_mut().chain(alpha.iter_mut()).for_each(|sample| *sample *= share);
            }
            if has_any {
                lit = (lit.0.min(within.start), lit.1.max(within.end));
            }
        }
    }

    /// Adds what of a layer is seen at points, `n` of which lie in each sample; returns whether there is any.
    fn add(&self, places: &Places, n: usize, layer: usize, (light, alpha): (&mut [f32], &mut [f32])) -> bool {
        let (beside, below) = self.scene.steps();
        let mut has_any = false;
        if let ([surface], true) = (self.surfaces, alpha.is_empty() && layer == 0 && self.is_flat()) {
            for (k, &first) in places.first.iter().enumerate() {
                if first == UNSEEN {
                    continue;
                }
                has_any = true;
                let corners =
                    [first as usize, first as usize + beside, first as usize + below, first as usize + below + beside];
                let [a, b, c, d] = corners.map(|corner| surface.radiance[corner]);
                let (down, across) = (places.down[k], places.across[k]);
                let (upper, lower) = (a + (b - a) * across, c + (d - c) * across);
                light[k / n] += (upper + (lower - upper) * down) * places.light[k];
            }
            return has_any;
        }
        for (k, &first) in places.first.iter().enumerate() {
            if first == UNSEEN {
                continue;
            }
            let first = first as usize;
            let corners = [first, first + beside, first + below, first + below + beside];
            let (down, across) = (places.down[k], places.across[k]);
            let shares = [(1.0 - down) * (1.0 - across), (1.0 - down) * across, down * (1.0 - across), down * across];
            for surface in self.surfaces {
                let (nearest, farthest) = surface.coordinates.ranges()[first];
                if layer < usize::from(nearest) || layer > usize::from(farthest) {
                    continue;
                }
                let coordinates = surface.coordinates.samples();
                let weights: [f32; 4] =
                    std::array::from_fn(|i| shares[i] * tent(coordinates[corners[i]], layer as f32));
                let weight = weights[0] + weights[1] + weights[2] + weights[3];
                if weight <= 0.0 {
                    continue;
                }
                has_any = true;
                let radiance: f32 = (0..4).map(|i| weights[i] * surface.radiance[corners[i]]).sum();
                light[k / n] += radiance * places.light[k];
                if let Some(alpha) = alpha.get_mut(k / n) {
                    *alpha += weight;
                }
            }
        }
        has_any
    }

    /// Whether all that there is lies in the first layer, with weight 1.
    fn is_flat(&self) -> bool {
        self.surfaces.iter().all(|surface| surface.coordinates.is_flat())
    }
}
