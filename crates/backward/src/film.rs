//! What the passes of a rendering have gathered.

use dioptric_spectrum::{Quantity, SpectralImage, WavelengthGrid};
use ndarray::Array2;

/// Sums over passes for each pixel and band: of their means, and of the squares of those.
///
/// Passes are independent estimates of the same picture, so that their spread estimates the error of their mean.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Film {
    pub(crate) rows: usize,
    pub(crate) columns: usize,
    pub(crate) n_bands: usize,
    /// Pixel by pixel, row by row: bands together.
    pub(crate) sums: Vec<f64>,
    pub(crate) squares: Vec<f64>,
    /// Passes that each pixel has had.
    pub(crate) n_passes: Vec<u32>,
}

impl Film {
    pub(crate) fn new(rows: usize, columns: usize, n_bands: usize) -> Self {
        let n = rows * columns;
        Self {
            rows,
            columns,
            n_bands,
            sums: vec![0.0; n * n_bands],
            squares: vec![0.0; n * n_bands],
            n_passes: vec![0; n],
        }
    }

    /// Adds the means of one more pass of a pixel.
    pub(crate) fn add(&mut self, pixel: usize, means: &[f64]) {
        let begin = pixel * self.n_bands;
        for (band, mean) in means.iter().enumerate() {
            self.sums[begin + band] += mean;
            self.squares[begin + band] += mean * mean;
        }
        self.n_passes[pixel] += 1;
    }

    /// Returns the mean of a pixel's band, and the variance of a single pass about it; without a spread while there is one
    /// pass only.
    pub(crate) fn mean_and_variance(&self, pixel: usize, band: usize) -> (f64, f64) {
        let n = f64::from(self.n_passes[pixel]);
        let at = pixel * self.n_bands + band;
        let mean = self.sums[at] / n.max(1.0);
        let variance = if n > 1.0 { (self.squares[at] - n * mean * mean).max(0.0) / (n - 1.0) } else { 0.0 };
        (mean, variance)
    }

    /// Returns the picture so far.
    pub(crate) fn picture(&self, quantity: Quantity, grid: &WavelengthGrid) -> SpectralImage {
        let mut picture = SpectralImage::zeros(quantity, grid.clone(), self.rows, self.columns);
        for (band, mut means) in picture.planes_mut().enumerate() {
            means.iter_mut().enumerate().for_each(|(pixel, mean)| *mean = self.mean_and_variance(pixel, band).0 as f32);
        }
        picture
    }

    /// Returns the picture so far, and the standard error of each of its samples: not a number where a pixel has had fewer
    /// passes than two, whose spread says nothing.
    pub(crate) fn develop(&self, quantity: Quantity, grid: &WavelengthGrid) -> (SpectralImage, SpectralImage) {
        let mut error = SpectralImage::zeros(quantity, grid.clone(), self.rows, self.columns);
        for (band, mut errors) in error.planes_mut().enumerate() {
            for (pixel, error) in errors.iter_mut().enumerate() {
                let (_, variance) = self.mean_and_variance(pixel, band);
                let n_passes = self.n_passes[pixel];
                *error = if n_passes > 1 { (variance / f64::from(n_passes)).sqrt() as f32 } else { f32::NAN };
            }
        }
        (self.picture(quantity, grid), error)
    }

    /// Returns how many passes each pixel needs until its relative standard error, over all bands, is `noise`; between
    /// those that it has had and `most`. A pixel darker than a tenth of the mean of those that have light is held to the error of
    /// one that is as bright.
    ///
    /// What a pixel needs is judged by its neighbors and never by itself: a pixel whose first passes happened to miss
    /// something bright would else stop too soon, and the picture would be too dark.
    pub(crate) fn passes_needed(&self, noise: f64, most: u32) -> Vec<u32> {
        let of_pixel = |pixel: usize| {
            let bands = (0..self.n_bands).map(|band| self.mean_and_variance(pixel, band));
            bands.fold([0.0; 2], |sum, (mean, variance)| [sum[0] + mean, sum[1] + variance * self.n_bands as f64])
        };
        let pilot: Vec<[f64; 2]> = (0..self.n_passes.len()).map(of_pixel).collect();
        // Pixels that light doesn't reach, as beyond a lens's image, say nothing of the picture.
        let lit: Vec<f64> = pilot.iter().map(|[mean, _]| *mean).filter(|mean| *mean > 0.0).collect();
        let whole = lit.iter().sum::<f64>() / lit.len().max(1) as f64;
        let needed = |pixel: usize| {
            let (row, column) = (pixel / self.columns, pixel % self.columns);
            let rows = row.saturating_sub(REACH)..(row + REACH + 1).min(self.rows);
            let columns = column.saturating_sub(REACH)..(column + REACH + 1).min(self.columns);
            let around = rows.flat_map(|r| columns.clone().map(move |c| r * self.columns + c));
            let (mut n, mut sum) = (0.0_f64, [0.0; 2]);
            for [mean, variance] in around.filter(|&other| other != pixel).map(|other| pilot[other]) {
                n += 1.0;
                sum = [sum[0] + mean, sum[1] + variance];
            }
            let mean = (sum[0] / n.max(1.0)).max(DARK * whole);
            let passes = sum[1] / n.max(1.0) / (noise * mean).powi(2);
            let had = self.n_passes[pixel];
            if passes.is_finite() { (passes.ceil() as u32).clamp(had, most.max(had)) } else { had }
        };
        (0..self.n_passes.len()).map(needed).collect()
    }

    /// The number of passes of each pixel.
    pub(crate) fn passes(&self) -> Array2<u32> {
        Array2::from_shape_fn((self.rows, self.columns), |(row, column)| self.n_passes[row * self.columns + column])
    }
}

/// Pixels of a smaller share of the picture's mean are dark: at the rim of a lens's image, where few rays get through, their number
/// would grow without bound.
const DARK: f64 = 0.1;
/// How far the neighbors of a pixel reach that say what it needs.
const REACH: usize = 3;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spread_of_passes_is_the_standard_error() {
        let mut film = Film::new(1, 2, 1);
        for value in [1.0, 2.0, 3.0, 6.0] {
            film.add(1, &[value]);
        }
        let grid = WavelengthGrid::new(vec![550.0]).unwrap();
        let (picture, error) = film.develop(Quantity::Irradiance, &grid);
        assert_eq!(picture.planes()[0][(0, 1)], 3.0);
        // The sample variance is 14/3; over four passes.
        assert!((error.planes()[0][(0, 1)] - (14.0_f32 / 12.0).sqrt()).abs() < 1e-6);
        assert_eq!(picture.planes()[0][(0, 0)], 0.0);
        // Unknown is not 0.
        assert!(error.planes()[0][(0, 0)].is_nan());
        film.add(0, &[5.0]);
        assert!(film.develop(Quantity::Irradiance, &grid).1.planes()[0][(0, 0)].is_nan());
    }

    /// A film twice as wide, the other half dark, needs the passes of the lit half and none beyond.
    #[test]
    fn dark_pixels_need_nothing() {
        let render = |columns: usize| {
            let mut film = Film::new(8, columns, 1);
            for pass in 0..4 {
                for pixel in 0..8 * columns {
                    let column = pixel % columns;
                    // A rim where one pass of four finds light, a hundredth of the rest in the mean.
                    let rim = if (pixel / columns + pass).is_multiple_of(4) { 0.04 } else { 0.0 };
                    film.add(
                        pixel,
                        &[match column {
                            0..8 => 1.0 + 0.1 * (pass % 2) as f64,
                            8..16 => rim,
                            _ => 0.0,
                        }],
                    );
                }
            }
            film.passes_needed(0.01, 100_000)
        };
        let (narrow, wide) = (render(16), render(32));
        for row in 0..8 {
            assert_eq!(narrow[16 * row..16 * row + 8], wide[32 * row..32 * row + 8]);
            assert!(wide[32 * row + 20..32 * (row + 1)].iter().all(|&n| n == 4));
            // Variance 4e-4 in six of seven columns around, held to a tenth of the mean of .53: 1,220. By its own brightness 47,000.
            assert!((1_100..1_300).contains(&wide[32 * row + 13]), "{}", wide[32 * row + 13]);
        }
    }

    #[test]
    fn own_value_does_not_count() {
        let mut film = Film::new(9, 9, 1);
        for pass in 0..4 {
            for pixel in 0..81 {
                film.add(pixel, &[if pixel == 40 { 100.0 * f64::from(pass) } else { 1.0 + 0.1 * f64::from(pass % 2) }]);
            }
        }
        let calm = film.passes_needed(0.01, 1000);
        // Variance .1²/3 about a mean of 1.05 needs 30 passes for 1 %.
        assert_eq!(calm[40], 31);
        assert_eq!(calm[41], 1000);
    }
}
