//! Layers laid one behind the other until every pixel is covered.

use dioptric_psf::Kernel;
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
/// Layers, nearest first, cover a pixel no more than once ("saturating coverage"): a continuous surface that spans many layers shows no seams. Where surfaces lie apart,
/// what a layer covers is what rays see of it past those before ([`Sight`](crate::sight::Sight)): parts of the pupil, each seen once.
pub(crate) struct Composite {
    light: Array2<f32>,
    /// Where layers hide each other.
    pixels: Array2<Open>,
}

/// The part of a pixel's pupil that is still open.
#[derive(Clone, Copy)]
struct Open {
    part: f32,
    /// What it was before the last layer, and that layer.
    before: f32,
    layer: u16,
}

/// A pixel with less coverage in all stays dark.
const LEAST_COVERAGE: f32 = 1e-5;

impl Composite {
    /// Returns a picture without light, in which layers may hide each other.
    pub(crate) fn new((rows, columns): (usize, usize), hides: bool) -> Self {
        let size = if hides { (rows, columns) } else { (0, 0) };
        let open = Open { part: 1.0, before: 1.0, layer: 0 };
        Self { light: Array2::zeros((rows, columns)), pixels: Array2::from_elem(size, open) }
    }

    /// Returns the part of a pixel's pupil that is open after the layers up to the last but one before a layer; the one before it may be the same surface.
    pub(crate) fn open_well_before(&self, layer: usize, at: (usize, usize)) -> f32 {
        let open = self.pixels[at];
        if usize::from(open.layer) + 1 >= layer { open.before } else { open.part }
    }

    /// Lays pixels of a layer, counted from those of a film, behind the layers before.
    pub(crate) fn under(&mut self, film: &Rectangle, layer: usize, gathered: &Gathered) {
        let (Rectangle { columns, .. }, layer) = (gathered.at, layer as u16);
        let first = gathered.at.offset_in(film);
        let sums = self.light.as_slice_mut().expect("in standard order")[first..].chunks_mut(film.columns);
        if gathered.alpha.is_empty() {
            for (sums, light) in sums.zip(gathered.light.chunks_exact(columns)) {
                sums.iter_mut().zip(light).for_each(|(sum, light)| *sum += light);
            }
            return;
        }
        let pixels = self.pixels.as_slice_mut().expect("in standard order")[first..].chunks_mut(film.columns);
        let layers = gathered.light.chunks_exact(columns).zip(gathered.alpha.chunks_exact(columns));
        for ((sums, pixels), (light, alpha)) in sums.zip(pixels).zip(layers) {
            let pixels = sums.iter_mut().zip(pixels);
            for ((sum, open), (light, alpha)) in pixels.zip(light.iter().zip(alpha)) {
                if *alpha <= 2.0 * Kernel::NEGLIGIBLE as f32 {
                    // Nothing but what kernels leave out on two sides, and rounding errors of transforms.
                    continue;
                }
                let taken = alpha.min(open.part);
                *sum += light * (taken / alpha);
                *open = Open { part: open.part - taken, before: open.part, layer };
            }
        }
    }

    /// Returns the picture; where layers hide each other, each pixel scaled to full coverage.
    pub(crate) fn finish(self) -> Array2<f32> {
        let mut light = self.light;
        if self.pixels.is_empty() {
            return light.mapv_into(|light| light.max(0.0));
        }
        Zip::from(&mut light).and(&self.pixels).for_each(|light, open| {
            let covered = 1.0 - open.part;
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
        let mut picture = Composite::new((1, 1), true);
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
    fn a_surface_in_two_layers_covers_once() {
        assert_eq!(composite(&[(0.4 * 3.0, 0.4), (0.6 * 3.0, 0.6), (9.0, 0.5)]), 3.0);
    }

    #[test]
    fn the_layer_before_does_not_count() {
        let mut picture = Composite::new((1, 1), true);
        for layer in [0, 3, 4] {
            picture.under(&PIXEL, layer, &Gathered { at: PIXEL, light: vec![1.0], alpha: vec![0.25] });
        }
        assert_eq!([5, 6].map(|layer| picture.open_well_before(layer, (0, 0))), [0.5, 0.25]);
    }

    #[test]
    fn a_thin_cover_is_scaled_to_a_full_one() {
        assert!((composite(&[(0.9 * 3.0, 0.9)]) - 3.0).abs() < 1e-6);
        assert_eq!(composite(&[]), 0.0);
    }
}
