//! Layers laid one behind the other until every pixel is covered.

use std::sync::Arc;

use ndarray::{Array2, Zip};

use crate::rectangle::Rectangle;

/// What a layer gathers on some pixels of the film, row by row: radiance times coverage, and coverage, which is empty where nothing hides anything.
pub(crate) struct Gathered {
    pub(crate) at: Rectangle,
    pub(crate) light: Vec<f32>,
    pub(crate) alpha: Vec<f32>,
}

/// The picture so far, and what of each pixel no layer has covered yet.
///
/// Layers in a row, nearest first, belong to one surface, which covers a pixel no more than once ("saturating coverage"): a continuous surface that spans many layers
/// shows no seams. Where a layer has nothing between two that have, another surface begins behind the first. Beside the edge of the first, where the chief ray passes
/// it, what lies beyond the focus as the first does is seen through the part of the pupil that the first leaves: it may cover all of that. Elsewhere, which part of the
/// pupil the first covers says nothing about which part the second does: as much of it is seen as the first leaves (docs/forward.md 3).
pub(crate) struct Composite {
    light: Array2<f32>,
    /// Where layers hide each other.
    pixels: Array2<Covered>,
    chief: Arc<ChiefLayers>,
}

/// The layers that the chief rays of a film meet first.
#[derive(Debug, Default)]
pub(crate) struct ChiefLayers {
    /// Row by row; empty where layers do not hide each other.
    pub(crate) first: Vec<u16>,
    /// Of each layer.
    pub(crate) is_beyond_focus: Vec<bool>,
}

/// What of a pixel is covered so far.
#[derive(Clone, Copy)]
struct Covered {
    /// Not covered by surfaces before the last one.
    open: f32,
    /// What the last one covers of the pixel by itself.
    surface: f32,
    /// The last layer that it has.
    layer: u16,
}

/// What the chief ray of a pixel meets first, as a layer, and which layers lie beyond the focus.
#[derive(Clone, Copy)]
pub(crate) struct Sees<'a> {
    pub(crate) first: u16,
    pub(crate) is_beyond_focus: &'a [bool],
}

impl Sees<'_> {
    /// Whether the chief ray passes a nearer layer on its way to one, both beyond the focus: the nearer is the less blurred.
    #[inline(always)]
    fn beside(self, nearer: u16, layer: u16) -> bool {
        self.first + 1 >= layer && self.is_beyond_focus[usize::from(nearer)] && self.is_beyond_focus[usize::from(layer)]
    }
}

impl Covered {
    const NOTHING: Self = Self { open: 1.0, surface: 0.0, layer: 0 };

    /// Lays a layer that covers a fraction of the pixel behind, and returns how much of its light is seen.
    #[inline(always)]
    fn takes(&mut self, alpha: f32, layer: u16, sees: Sees<'_>) -> f32 {
        let is_behind = layer > self.layer + 1 && !sees.beside(self.layer, layer);
        if is_behind && alpha <= LEAST_OF_LAYER {
            // Too little to begin a surface: a small lamp.
            let open = self.open();
            self.surface += (1.0 - self.surface) * alpha.max(0.0);
            return open;
        }
        if is_behind {
            *self = Self { open: self.open(), surface: 0.0, layer };
        }
        if alpha > LEAST_OF_LAYER {
            self.layer = layer;
        }
        let taken = alpha.clamp(0.0, 1.0 - self.surface);
        self.surface += taken;
        self.open * if taken < alpha { taken / alpha } else { 1.0 }
    }

    /// What nothing covers.
    #[inline(always)]
    fn open(self) -> f32 {
        self.open * (1.0 - self.surface)
    }
}

/// Coverage below which a layer has nothing of a surface: rounding errors of transforms are less.
const LEAST_OF_LAYER: f32 = 1e-4;
/// A pixel with less coverage in all stays dark.
const LEAST_COVERAGE: f32 = 1e-5;

impl Composite {
    /// Returns a picture without light, in which layers may hide each other.
    pub(crate) fn new((rows, columns): (usize, usize), chief: Arc<ChiefLayers>) -> Self {
        let size = if chief.first.is_empty() { (0, 0) } else { (rows, columns) };
        Self { light: Array2::zeros((rows, columns)), pixels: Array2::from_elem(size, Covered::NOTHING), chief }
    }

    /// Lays pixels of a layer, counted from those of a film, behind the layers before.
    pub(crate) fn under(&mut self, film: &Rectangle, layer: usize, gathered: &Gathered) {
        let (Rectangle { columns, .. }, number) = (gathered.at, layer as u16);
        let first = gathered.at.offset_in(film);
        let sums = self.light.as_slice_mut().expect("in standard order")[first..].chunks_mut(film.columns);
        if gathered.alpha.is_empty() {
            for (sums, light) in sums.zip(gathered.light.chunks_exact(columns)) {
                sums.iter_mut().zip(light).for_each(|(sum, light)| *sum += light);
            }
            return;
        }
        let pixels = self.pixels.as_slice_mut().expect("in standard order")[first..].chunks_mut(film.columns);
        let ChiefLayers { first: chief, is_beyond_focus } = self.chief.as_ref();
        let chief = chief[first..].chunks(film.columns);
        let layers = gathered.light.chunks_exact(columns).zip(gathered.alpha.chunks_exact(columns));
        for (((sums, pixels), chief), (light, alpha)) in sums.zip(pixels).zip(chief).zip(layers) {
            let pixels = sums.iter_mut().zip(pixels).zip(chief);
            for (((sum, pixel), first), (light, alpha)) in pixels.zip(light.iter().zip(alpha)) {
                *sum += light * pixel.takes(*alpha, number, Sees { first: *first, is_beyond_focus });
            }
        }
    }

    /// Returns the picture; where layers hide each other, each pixel scaled to full coverage.
    pub(crate) fn finish(self) -> Array2<f32> {
        let mut light = self.light;
        if self.pixels.is_empty() {
            return light.mapv_into(|light| light.max(0.0));
        }
        Zip::from(&mut light).and(&self.pixels).for_each(|light, pixel| {
            let covered = 1.0 - pixel.open();
            *light = if covered > LEAST_COVERAGE { (*light / covered).max(0.0) } else { 0.0 };
        });
        light
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PIXEL: Rectangle = Rectangle::PIXEL;

    fn composite(layers: &[(f32, f32)]) -> f32 {
        composite_seen(layers, 0)
    }

    /// Of a pixel whose chief ray meets a layer first; all are beyond the focus.
    fn composite_seen(layers: &[(f32, f32)], first: u16) -> f32 {
        let chief = ChiefLayers { first: vec![first], is_beyond_focus: vec![true; layers.len()] };
        let mut picture = Composite::new((1, 1), Arc::new(chief));
        for (layer, &(light, alpha)) in layers.iter().enumerate() {
            picture.under(&PIXEL, layer, &Gathered { at: PIXEL, light: vec![light], alpha: vec![alpha] });
        }
        picture.finish()[(0, 0)]
    }

    #[test]
    fn full_cover_hides_what_is_behind() {
        assert_eq!(composite(&[(3.0, 1.0), (0.0, 0.0), (7.0, 1.0)]), 3.0);
        assert_eq!(composite(&[(3.0, 1.0), (7.0, 1.0)]), 3.0);
    }

    #[test]
    fn half_cover_lets_half_of_what_is_behind_through() {
        assert_eq!(composite(&[(0.5 * 3.0, 0.5), (0.0, 0.0), (7.0, 1.0)]), 5.0);
    }

    #[test]
    fn a_surface_in_two_layers_covers_once() {
        assert_eq!(composite(&[(0.4 * 3.0, 0.4), (0.6 * 3.0, 0.6), (9.0, 0.5)]), 3.0);
    }

    /// A lamp that covers a hundredth of a pixel, behind something that leaves a fiftieth of it open, before a dark wall.
    #[test]
    fn small_lamps_do_not_shine_through_surfaces() {
        let seen = composite(&[(0.0, 0.98), (0.0, 0.0), (0.01 * 1e4, 0.01), (0.0, 0.0), (0.0, 1.0)]);
        assert!((seen / (0.02 * 0.01 * 1e4) - 1.0).abs() < 1e-4, "{seen}");
        // Beside the edge, where the chief ray sees it, it is not hidden.
        let seen = composite_seen(&[(0.0, 0.3), (0.0, 0.0), (0.01 * 1e4, 0.01), (0.0, 0.0), (0.0, 1.0)], 2);
        assert!((seen / (0.01 * 1e4) - 1.0).abs() < 1e-4, "{seen}");
    }

    #[test]
    fn a_thin_cover_is_scaled_to_a_full_one() {
        assert!((composite(&[(0.9 * 3.0, 0.9)]) - 3.0).abs() < 1e-6);
        assert_eq!(composite(&[]), 0.0);
    }
}
