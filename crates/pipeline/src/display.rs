//! Spectra as colors on a screen.

use std::sync::LazyLock;

use dioptric_spectrum::{Observer, SpectralImage, WavelengthGrid, Xyz, srgb_decode, srgb_encode};
use image::RgbImage;
use ndarray::Array2;

/// Turns spectra on one grid into linear sRGB.
pub struct SpectrumToRgb {
    /// Weights of red, green and blue, a list of one a band each.
    weights: [Vec<f64>; 3],
}

impl SpectrumToRgb {
    /// For spectra seen as they are; Y of 1 lux or cd/m² becomes linear 1.
    pub fn new(grid: &WavelengthGrid) -> Self {
        let xyz = Observer::Cie1931.weights(grid);
        let mut weights = [0, 1, 2].map(|_| vec![0.0; grid.len()]);
        for band in 0..grid.len() {
            let rgb = Xyz([xyz[0][band], xyz[1][band], xyz[2][band]]).to_linear_srgb();
            for (list, value) in weights.iter_mut().zip(rgb) {
                list[band] = value;
            }
        }
        Self { weights }
    }

    /// For spectra that are shown: seen as they are, or in gray, the sum of all bands, where none of them is visible.
    pub fn shown(grid: &WavelengthGrid) -> Self {
        /// Light beyond is less than a ten-thousandth as bright as the best seen (CIE 1924).
        const VISIBLE_NM: [f64; 2] = [390.0, 740.0];
        let is_visible = grid.centers_nm().iter().any(|nm| (VISIBLE_NM[0]..=VISIBLE_NM[1]).contains(nm));
        if is_visible { Self::new(grid) } else { Self { weights: [0, 1, 2].map(|_| vec![1.0; grid.len()]) } }
    }

    /// For spectra of which this one is to look white, linear (1, 1, 1).
    pub fn with_white(grid: &WavelengthGrid, white: &[f64]) -> Self {
        let mut it = Self::new(grid);
        for list in &mut it.weights {
            let sum: f64 = list.iter().zip(white).map(|(w, v)| w * v).sum();
            list.iter_mut().for_each(|w| *w /= sum);
        }
        it
    }

    /// The weights of a band on red, green and blue.
    pub fn of_band(&self, band: usize) -> [f64; 3] {
        [self.weights[0][band], self.weights[1][band], self.weights[2][band]]
    }
}

/// A picture in linear sRGB, summed a band at a time.
#[derive(Clone, Debug)]
pub struct LinearRgb {
    /// Red, green and blue.
    pub planes: [Array2<f32>; 3],
}

/// The share of a film without light that is worth a word.
pub const LEAST_DARK_FRACTION: f64 = 1e-3;

impl LinearRgb {
    /// A picture without light.
    pub fn black(rows: usize, columns: usize) -> Self {
        Self { planes: [(); 3].map(|()| Array2::zeros((rows, columns))) }
    }

    /// Adds a band seen in this color.
    pub fn add(&mut self, band: &Array2<f32>, rgb: [f64; 3]) {
        for (plane, weight) in self.planes.iter_mut().zip(rgb) {
            plane.scaled_add(weight as f32, band);
        }
    }

    /// Returns the picture of all bands of an image.
    pub fn of_image(image: &SpectralImage) -> Self {
        let to_rgb = SpectrumToRgb::new(image.grid());
        let mut rgb = Self::black(image.rows(), image.columns());
        for (band, plane) in image.planes().iter().enumerate() {
            rgb.add(plane, to_rgb.of_band(band));
        }
        rgb
    }

    /// Returns the picture with colors that a screen cannot show moved towards the gray of their luminance until it can.
    pub fn within_gamut(mut self) -> Self {
        let [red, green, blue] = &mut self.planes;
        ndarray::Zip::from(red).and(green).and(blue).for_each(|r, g, b| {
            let least = r.min(*g).min(*b);
            let [_, y, _] = Xyz::from_linear_srgb([*r, *g, *b].map(f64::from)).0;
            if least < 0.0 && y > 0.0 {
                let share = (y / (y - f64::from(least))) as f32;
                for v in [r, g, b] {
                    *v = y as f32 + share * (*v - y as f32);
                }
            }
        });
        self
    }

    /// Returns the level below which this share of all samples lie.
    pub fn level_at(&self, share: f64) -> f64 {
        level_at(&self.planes.each_ref(), share)
    }

    /// Returns the 8-bit picture in which linear `white` is full.
    pub fn to_srgb(&self, white: f64) -> RgbImage {
        self.to_srgb_with_black(white, [0.0; 3])
    }

    /// Returns the 8-bit picture on a display that lights up where the picture is dark: `black` is that light of red, green and blue as a share of
    /// white, whose light stays.
    pub fn to_srgb_with_black(&self, white: f64, black: [f64; 3]) -> RgbImage {
        let (rows, columns) = self.planes[0].dim();
        RgbImage::from_fn(columns as u32, rows as u32, |x, y| {
            let at = (y as usize, x as usize);
            image::Rgb([0, 1, 2].map(|i| code(black[i] + (1.0 - black[i]) * f64::from(self.planes[i][at]) / white)))
        })
    }
}

/// Returns the share of samples that get next to nothing of the mean light.
pub fn dark_fraction(light: &Array2<f32>) -> f64 {
    /// A blur leaves nothing beyond its window; the mean of a night scene is a thousand times its darkest places.
    const DARK: f32 = 1e-6;
    let n = light.len().max(1) as f64;
    let mean = (light.iter().map(|&v| f64::from(v)).sum::<f64>() / n) as f32;
    light.iter().filter(|&&light| light <= DARK * mean).count() as f64 / n
}

/// Returns the level below which this share of all samples of planes lie, found by counting: the samples are not copied.
///
/// # Panics
/// When there is no sample.
pub fn level_at(planes: &[&Array2<f32>], share: f64) -> f64 {
    let n_samples: usize = planes.iter().map(|plane| plane.len()).sum();
    let mut place = (n_samples.checked_sub(1).expect("at least one sample") as f64 * share) as usize;
    let keys = || planes.iter().copied().flatten().map(|&sample| ordered_key(sample));
    // The upper half of the key that has the place, then the lower half among those.
    let upper = of_place(keys().map(|key| key >> 16), &mut place);
    let lower = of_place(keys().filter(|key| key >> 16 == upper).map(|key| key & 0xffff), &mut place);
    f64::from(sample_of_key(upper << 16 | lower))
}

/// Returns which of 2¹⁶ numbers stands at a place of their order, and leaves the place among those that equal it.
fn of_place(numbers: impl Iterator<Item = u32>, place: &mut usize) -> u32 {
    let mut counts = vec![0_usize; 1 << 16];
    numbers.for_each(|number| counts[number as usize] += 1);
    let mut number = 0;
    while number + 1 < counts.len() && *place >= counts[number] {
        *place -= counts[number];
        number += 1;
    }
    number as u32
}

/// Returns a number that orders samples as `f32::total_cmp` does.
fn ordered_key(sample: f32) -> u32 {
    let bits = sample.to_bits();
    if bits >> 31 == 0 { bits | 1 << 31 } else { !bits }
}

/// Returns the sample of a key of [`ordered_key`].
fn sample_of_key(key: u32) -> f32 {
    f32::from_bits(if key >> 31 == 1 { key & !(1 << 31) } else { !key })
}

/// Returns the 8-bit sRGB code of a linear value.
pub fn code(linear: f64) -> u8 {
    static CODES: LazyLock<Codes> = LazyLock::new(Codes::new);
    CODES.of(linear)
}

/// The 8-bit sRGB codes of linear values, to look up: the power that defines them takes ten times as long.
struct Codes {
    /// The code at the beginning of each part of the values from 0 to 1, all of one width, which hold one step of codes at most.
    begin: Vec<u8>,
    /// The least value of each code from 1 on.
    least: Vec<f64>,
}

impl Codes {
    const PARTS: usize = 4096;

    fn new() -> Self {
        let begin = (0..=Self::PARTS).map(|part| Self::computed(part as f64 / Self::PARTS as f64)).collect();
        Self { begin, least: (1..=u8::MAX).map(|code| srgb_decode((f64::from(code) - 0.5) / 255.0)).collect() }
    }

    fn computed(linear: f64) -> u8 {
        (255.0 * srgb_encode(linear)).round() as u8
    }

    fn of(&self, linear: f64) -> u8 {
        // No number is 0.
        let part = (linear * Self::PARTS as f64) as usize;
        let code = self.begin[part.min(Self::PARTS)];
        code + u8::from(self.least.get(usize::from(code)).is_some_and(|least| linear >= *least))
    }
}

/// Returns the color of a single wavelength as `#rrggbb`, bright enough for a line on white.
pub fn wavelength_color(wavelength_nm: f64) -> String {
    // Beyond the visible the color is that of its end.
    let grid = WavelengthGrid::new(vec![wavelength_nm.clamp(405.0, 680.0)]).expect("a wavelength in the visible");
    let rgb = Observer::Cie1931.xyz(&grid, &[1.0]).to_linear_srgb().map(|v| v.max(0.0));
    let most = rgb.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    // Yellow and green at full drive vanish on white paper.
    let luminance: f64 = Xyz::from_linear_srgb(rgb.map(|v| v / most)).0[1];
    let level = (0.35 / luminance).min(1.0);
    let [r, g, b] = rgb.map(|v| code(v / most * level));
    format!("#{r:02x}{g:02x}{b:02x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_those_of_the_curve() {
        for step in -1000..=201_000 {
            // Beside all thresholds but by a part of a step, and beyond both ends.
            let linear = f64::from(step) / 200_000.0 + 1.7e-7;
            assert_eq!(code(linear), Codes::computed(linear), "{linear}");
        }
        let ends = [f64::NAN, f64::NEG_INFINITY, f64::INFINITY].map(code);
        assert_eq!(ends, [0, 0, 255]);
        for (at, least) in (1..=255).zip(Codes::new().least) {
            assert_eq!([code(least * (1.0 - 1e-9)), code(least * (1.0 + 1e-9))], [at - 1, at]);
        }
    }

    #[test]
    fn the_white_given_is_white() {
        let grid = WavelengthGrid::uniform(400.0, 700.0, 10.0).unwrap();
        let white: Vec<f64> = grid.centers_nm().iter().map(|w| w / 500.0).collect();
        let to_rgb = SpectrumToRgb::with_white(&grid, &white);
        for channel in 0..3 {
            let sum: f64 = (0..grid.len()).map(|band| to_rgb.of_band(band)[channel] * white[band]).sum();
            approx::assert_abs_diff_eq!(sum, 1.0, epsilon = 1e-12);
        }
    }

    #[test]
    fn wavelengths_have_their_colors() {
        let rgb = |nm| {
            let text = wavelength_color(nm);
            [1, 3, 5].map(|i| u8::from_str_radix(&text[i..i + 2], 16).unwrap())
        };
        let ([r, g, b], [r2, g2, b2]) = (rgb(450.0), rgb(650.0));
        assert!(b > r && b > g && r2 > g2 && r2 > b2);
        let [r, g, b] = rgb(530.0);
        assert!(g > r && g > b);
        assert_eq!(rgb(300.0), rgb(405.0));
    }

    #[test]
    fn a_color_beyond_the_screen_keeps_its_luminance() {
        let mut picture = LinearRgb::black(1, 1);
        picture.add(&ndarray::array![[1.0]], [-0.2, 0.1, 0.9]);
        let luminance = |p: &LinearRgb| Xyz::from_linear_srgb([0, 1, 2].map(|i| f64::from(p.planes[i][(0, 0)]))).0[1];
        let shown = picture.clone().within_gamut();
        approx::assert_abs_diff_eq!(luminance(&shown), luminance(&picture), epsilon = 1e-6);
        approx::assert_abs_diff_eq!(shown.planes[0][(0, 0)], 0.0, epsilon = 1e-6);
    }

    #[test]
    fn a_lifted_black_leaves_white() {
        let mut picture = LinearRgb::black(1, 3);
        picture.add(&ndarray::array![[0.0, 1.0, 2.0]], [1.0, 1.0, 1.0]);
        let shown = picture.to_srgb_with_black(2.0, [19, 31, 36].map(|of| srgb_decode(f64::from(of) / 255.0)));
        assert_eq!((shown[(0, 0)].0, shown[(2, 0)].0), ([19, 31, 36], [255; 3]));
        // Half the light of white and half that of black.
        let half = 0.5 + 0.5 * srgb_decode(31.0 / 255.0);
        assert_eq!(shown[(1, 0)].0[1], code(half));
        assert_eq!(picture.to_srgb(2.0), picture.to_srgb_with_black(2.0, [0.0; 3]));
    }

    #[test]
    fn film_beyond_the_light_is_counted() {
        assert_eq!(dark_fraction(&Array2::zeros((10, 10))), 1.0);
        // A dim corner is no darkness.
        let lit = |(row, column): (usize, usize)| if column < 7 { if row == 0 { 1e-3 } else { 5.0 } } else { 0.0 };
        assert_eq!(dark_fraction(&Array2::from_shape_fn((10, 10), lit)), 0.3);
    }

    #[test]
    fn the_near_infrared_is_shown_in_gray() {
        let grid = WavelengthGrid::uniform(800.0, 900.0, 50.0).unwrap();
        assert_eq!([0, 1, 2].map(|band| SpectrumToRgb::shown(&grid).of_band(band)), [[1.0; 3]; 3]);
        let partly = WavelengthGrid::uniform(700.0, 900.0, 50.0).unwrap();
        assert!(SpectrumToRgb::shown(&partly).of_band(0)[0] > 10.0 * SpectrumToRgb::shown(&partly).of_band(4)[0].abs());
    }

    #[test]
    fn levels_are_those_of_the_sorted_samples() {
        let mut picture = LinearRgb::black(1, 4);
        picture.add(&ndarray::array![[1.0, 2.0, 3.0, 4.0]], [1.0, 1.0, 1.0]);
        assert_eq!([picture.level_at(0.0), picture.level_at(1.0)], [1.0, 4.0]);
    }

    #[test]
    fn counted_levels_are_the_sorted_ones() {
        // Of both signs and many magnitudes, some alike, with zeros and infinities.
        let sample = |i: usize| ((i * 7919 % 613) as f32 - 300.0).powi(3) * 10.0_f32.powi(i as i32 % 11 - 5);
        let mut one = Array2::from_shape_fn((23, 31), |(r, c)| sample(31 * r + c));
        one[(3, 4)] = f32::INFINITY;
        one[(5, 6)] = -0.0;
        let other = one.mapv(|v| 0.5 * v);
        let mut sorted: Vec<f32> = one.iter().chain(&other).copied().collect();
        sorted.sort_by(f32::total_cmp);
        for share in [0.0, 0.02, 0.37, 0.5, 0.99, 1.0] {
            let expected = sorted[((sorted.len() - 1) as f64 * share) as usize];
            assert_eq!(level_at(&[&one, &other], share).to_bits(), f64::from(expected).to_bits(), "{share}");
        }
    }
}
