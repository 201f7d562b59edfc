//! Spatial frequency response from a texture, by its power and by what it has in common with a reference.
//!
//! Both methods compare a picture with its reference: the target as an ideal camera of the same framing pictures it. The
//! direct one takes the root of the ratio of power spectra, the power of noise taken off (Cao, Guichard & Hornung, "Measuring
//! texture sharpness of a digital camera", Proc. SPIE 7250, 2009; McElvain, Campbell, Miller & Jin, "Texture-based measurement of spatial
//! frequency response using the dead leaves target", Proc. SPIE 7537, 2010). The full-reference one takes the cross-power
//! over the power of the reference, to which nothing adds that is not in the reference (Kirk, Herzer, Artmann & Kunz,
//! "Description of texture loss using the dead leaves target", Proc. SPIE 9023, 2014). What the reference averages over, such as
//! the area of its pixels, is in neither response.

use dioptric_fft::{Complex, Planner};
use ndarray::{Array2, ArrayView2};
use std::f64::consts::{PI, TAU};

use crate::{SensorError, Viewing, acuity::acutance, sfr::interpolated};

/// The least side of a texture, pixels.
const LEAST_SIDE: usize = 64;
/// The least side of an even patch, pixels.
const LEAST_PATCH: usize = 32;
/// Deviations below this share of the mean are no texture.
const FLAT: f64 = 1e-6;
/// The first ring that the window leaves as it is.
const FIRST_RING: usize = 2;
/// Up to where responses are extrapolated to frequency 0 and pictures are laid over each other, cycles a pixel.
const LOW_END: f64 = 0.06;
/// Coefficients below this frequency tell the shift, cycles a pixel.
const SHIFT_END: f64 = 0.15;
/// The least coherence of a picture and its reference at low frequencies.
const LEAST_COHERENCE: f64 = 0.5;

/// A response at evenly spaced frequencies.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureResponse {
    /// Frequencies, cycles a pixel, 0 to 0.5.
    pub frequencies: Vec<f64>,
    /// The response at each frequency, 1 where it is extrapolated to frequency 0.
    pub response: Vec<f64>,
}

impl TextureResponse {
    /// Returns the response at a frequency, cycles a pixel, with straight lines between the tabled ones.
    pub fn at(&self, frequency: f64) -> f64 {
        interpolated(&self.frequencies, &self.response, frequency)
    }

    /// Returns the first frequency at which half the response is left, cycles a pixel.
    pub fn mtf50(&self) -> Option<f64> {
        let i = self.response.iter().position(|&r| r < 0.5).filter(|&i| i > 0)?;
        let (f, r) = (&self.frequencies, &self.response);
        Some(f[i - 1] + (f[i] - f[i - 1]) * (r[i - 1] - 0.5) / (r[i - 1] - r[i]))
    }

    /// Returns the texture acutance, which weighs the response as [`EdgeResponse::acutance`](crate::EdgeResponse::acutance) does.
    ///
    /// # Errors
    /// When the viewing has a number that is not above 0.
    pub fn acutance(&self, viewing: &Viewing) -> Result<f64, SensorError> {
        acutance(|frequency| self.at(frequency), viewing)
    }
}

/// What shows the noise of a picture of a texture.
#[derive(Clone, Copy, Debug)]
pub enum TextureNoise<'a> {
    /// An even patch beside the texture.
    Flat(ArrayView2<'a, f32>),
    /// The same texture in another frame: half the power of the difference is noise.
    SecondFrame(ArrayView2<'a, f32>),
}

/// Power spectra of a texture and the responses that follow.
///
/// Spectra are means over rings of one frequency, divided by the sum of the squared window: white noise has its variance at
/// each frequency. Means are subtracted; the window is Hann's in both directions.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureSpectra {
    /// Frequencies of the rings, cycles a pixel, 0 to 0.5.
    pub frequencies: Vec<f64>,
    /// The power of the picture.
    pub picture_power: Vec<f64>,
    /// The power of the noise, 0 where none was shown.
    pub noise_power: Vec<f64>,
    /// The power of the reference.
    pub reference_power: Vec<f64>,
    /// The response by the root of the ratio of powers.
    pub direct: TextureResponse,
    /// The response by what picture and reference have in common, none where they do not show the same part of a texture.
    pub full_reference: Option<TextureResponse>,
    /// How much of the picture's low frequencies is in the reference, 0 to 1.
    pub coherence: f64,
    /// By how many (rows, columns) the picture is shifted against the reference, which the full-reference response makes up for.
    pub shift_px: (f64, f64),
}

impl TextureSpectra {
    /// Returns the spectra of a texture in linear light.
    ///
    /// # Errors
    /// When the pictures differ in size or are under 64 × 64 pixels, an even patch under 32 × 32, when one is flat, or when noise
    /// leaves nothing of the texture.
    pub fn measure(
        picture: &ArrayView2<'_, f32>,
        reference: &ArrayView2<'_, f32>,
        noise: Option<TextureNoise<'_>>,
    ) -> Result<Self, SensorError> {
        let (rows, columns) = picture.dim();
        same_size("the reference of a texture, rows × columns", picture, reference)?;
        if rows < LEAST_SIDE || columns < LEAST_SIDE {
            return Err(unsuitable(format!(
                "needs at least {LEAST_SIDE} × {LEAST_SIDE} pixels, but {rows} × {columns} are given"
            )));
        }
        for (name, plane) in [("picture", picture), ("reference", reference)] {
            if is_flat(plane) {
                return Err(unsuitable(format!("is not in the {name}, which is flat")));
            }
        }
        let mut planner = Planner::new();
        let (of_picture, of_reference) = (transform(picture, &mut planner), transform(reference, &mut planner));
        let picture_power = Rings::of_power(&of_picture);
        let reference_power = Rings::of_power(&of_reference);
        let frequencies = picture_power.frequencies();
        let noise_power = match noise {
            None => vec![0.0; frequencies.len()],
            Some(TextureNoise::Flat(patch)) => flat_power(&patch, &frequencies, &mut planner)?,
            Some(TextureNoise::SecondFrame(second)) => second_frame_power(picture, &second, &mut planner)?,
        };

        let texture_power = |ring: usize| (picture_power.means[ring] - noise_power[ring]).max(0.0);
        let direct: Vec<f64> =
            (0..frequencies.len()).map(|ring| (texture_power(ring) / reference_power.means[ring]).sqrt()).collect();
        let direct = response_of(&frequencies, &direct, &picture_power.counts)
            .ok_or_else(|| unsuitable("has less power at low frequencies than the noise".to_owned()))?;

        let cross = Array2::from_shape_fn((rows, columns), |at| of_picture[at] * of_reference[at].conj());
        let shift_px = shift(&cross, &mut planner);
        let aligned = aligned_power(&cross, shift_px);
        let coherence = low_coherence(&aligned, &picture_power, &reference_power);
        let common: Vec<f64> =
            aligned.means.iter().zip(&reference_power.means).map(|(common, ideal)| common / ideal).collect();
        let full_reference = match coherence >= LEAST_COHERENCE {
            true => response_of(&frequencies, &common, &aligned.counts),
            false => None,
        };
        Ok(Self {
            picture_power: picture_power.means,
            noise_power,
            reference_power: reference_power.means,
            direct,
            full_reference,
            coherence,
            shift_px,
            frequencies,
        })
    }

    /// Returns the least frequency, cycles a pixel, at which the noise has all of the picture's power; the direct response is 0 there.
    pub fn noise_from(&self) -> Option<f64> {
        let is_noise = |ring: &usize| self.noise_power[*ring] >= self.picture_power[*ring];
        (FIRST_RING..self.frequencies.len()).find(is_noise).map(|ring| self.frequencies[ring])
    }
}

/// Returns the response of ratios at frequencies, 1 toward frequency 0; `None` where they do not lead there.
fn response_of(frequencies: &[f64], ratios: &[f64], counts: &[f64]) -> Option<TextureResponse> {
    let at_zero = extrapolated_to_zero(frequencies, ratios, counts)?;
    let mut response: Vec<f64> = ratios.iter().map(|ratio| ratio / at_zero).collect();
    // The mean is subtracted: the first ring has little, and the middle nothing.
    response[0] = 1.0;
    Some(TextureResponse { frequencies: frequencies.to_vec(), response })
}

/// Returns the power that a picture shares with its reference once the shift between them is made up for.
fn aligned_power(cross: &Array2<Complex<f32>>, shift_px: (f64, f64)) -> Rings {
    let (rows, columns) = cross.dim();
    Rings::new((rows, columns), |(i, j)| {
        let (down, along) = (signed(i, rows), signed(j, columns));
        let (sin, cos) = (TAU * (down * shift_px.0 + along * shift_px.1)).sin_cos();
        f64::from(cross[(i, j)].re) * cos - f64::from(cross[(i, j)].im) * sin
    })
}

/// Returns the coherence of a picture and its reference over the low frequencies, 0 to 1.
fn low_coherence(aligned: &Rings, picture: &Rings, reference: &Rings) -> f64 {
    let frequencies = picture.frequencies();
    let sum = |power: &Rings| -> f64 {
        let low = (FIRST_RING..frequencies.len()).take_while(|&ring| frequencies[ring] <= low_end(&frequencies));
        low.map(|ring| power.means[ring] * power.counts[ring]).sum()
    };
    let common = sum(aligned);
    (common * common.abs() / (sum(picture) * sum(reference))).clamp(0.0, 1.0)
}

fn unsuitable(reason: String) -> SensorError {
    SensorError::Unsuitable { what: "the texture", reason }
}

fn same_size(
    what: &'static str,
    picture: &ArrayView2<'_, f32>,
    other: &ArrayView2<'_, f32>,
) -> Result<(), SensorError> {
    let words = |(rows, columns): (usize, usize)| format!("{rows} × {columns}");
    if picture.dim() == other.dim() {
        return Ok(());
    }
    Err(SensorError::Shape { what, expected: words(picture.dim()), found: words(other.dim()) })
}

fn is_flat(plane: &ArrayView2<'_, f32>) -> bool {
    let n = plane.len() as f64;
    let mean = plane.iter().map(|&v| f64::from(v)).sum::<f64>() / n;
    let variance = plane.iter().map(|&v| (f64::from(v) - mean).powi(2)).sum::<f64>() / n;
    variance.is_nan() || variance.sqrt() <= FLAT * mean.abs()
}

/// Hann's window at the middles of so many pixels.
fn window(n: usize) -> Vec<f64> {
    (0..n).map(|i| (PI * (i as f64 + 0.5) / n as f64).sin().powi(2)).collect()
}

/// Returns the transform of a plane less its mean under the window, over the root of the sum of the squared window.
fn transform(plane: &ArrayView2<'_, f32>, planner: &mut Planner) -> Array2<Complex<f32>> {
    let (rows, columns) = plane.dim();
    let (down, along) = (window(rows), window(columns));
    let weight = |(i, j): (usize, usize)| down[i] * along[j];
    let (mut sum, mut weights, mut squares) = (0.0, 0.0, 0.0);
    for (at, &value) in plane.indexed_iter() {
        let w = weight(at);
        sum += w * f64::from(value);
        weights += w;
        squares += w * w;
    }
    let (mean, scale) = (sum / weights, 1.0 / squares.sqrt());
    let mut samples = Array2::from_shape_fn((rows, columns), |at| {
        Complex::new((weight(at) * (f64::from(plane[at]) - mean) * scale) as f32, 0.0)
    });
    let (of_row, of_column) = (planner.forward(columns), planner.forward(rows));
    along_both(&mut samples, |row| of_row.process(row), |column| of_column.process(column));
    samples
}

/// Does something to each row, then to each column.
fn along_both(
    samples: &mut Array2<Complex<f32>>,
    to_row: impl Fn(&mut [Complex<f32>]),
    to_column: impl Fn(&mut [Complex<f32>]),
) {
    for mut row in samples.rows_mut() {
        to_row(row.as_slice_mut().expect("the rows of an owned array are contiguous"));
    }
    for mut column in samples.columns_mut() {
        let mut values = column.to_vec();
        to_column(&mut values);
        column.iter_mut().zip(values).for_each(|(to, value)| *to = value);
    }
}

/// The frequency of a coefficient, cycles a sample, −0.5 to 0.5.
fn signed(index: usize, n: usize) -> f64 {
    let at = index as f64;
    if 2 * index > n { (at - n as f64) / n as f64 } else { at / n as f64 }
}

/// Means over rings of coefficients, each as wide as one over the lesser side.
struct Rings {
    side: usize,
    means: Vec<f64>,
    counts: Vec<f64>,
}

impl Rings {
    fn new((rows, columns): (usize, usize), of: impl Fn((usize, usize)) -> f64) -> Self {
        let side = rows.min(columns);
        let (mut sums, mut counts) = (vec![0.0; side / 2 + 1], vec![0.0; side / 2 + 1]);
        for i in 0..rows {
            for j in 0..columns {
                let ring = (signed(i, rows).hypot(signed(j, columns)) * side as f64).round() as usize;
                if ring < sums.len() {
                    sums[ring] += of((i, j));
                    counts[ring] += 1.0;
                }
            }
        }
        let means = sums.iter().zip(&counts).map(|(sum, count)| sum / count).collect();
        Self { side, means, counts }
    }

    /// The power of a transform.
    fn of_power(transform: &Array2<Complex<f32>>) -> Self {
        Self::new(transform.dim(), |at| transform[at].norm_sqr().into())
    }

    fn frequencies(&self) -> Vec<f64> {
        (0..self.means.len()).map(|ring| ring as f64 / self.side as f64).collect()
    }
}

/// Returns the power of the noise that differs between two frames: half that of their difference.
fn second_frame_power(
    picture: &ArrayView2<'_, f32>,
    second: &ArrayView2<'_, f32>,
    planner: &mut Planner,
) -> Result<Vec<f64>, SensorError> {
    same_size("the second frame of a texture, rows × columns", picture, second)?;
    if is_flat(second) {
        return Err(unsuitable("is not in the second frame, which is flat".to_owned()));
    }
    if picture == second {
        return Err(unsuitable("has no second frame: both are the same, expected another exposure".to_owned()));
    }
    let twice = Rings::of_power(&transform(&(picture - second).view(), planner));
    Ok(twice.means.iter().map(|power| 0.5 * power).collect())
}

/// Returns the power of an even patch at frequencies.
fn flat_power(
    patch: &ArrayView2<'_, f32>,
    frequencies: &[f64],
    planner: &mut Planner,
) -> Result<Vec<f64>, SensorError> {
    let (rows, columns) = patch.dim();
    if rows < LEAST_PATCH || columns < LEAST_PATCH {
        return Err(unsuitable(format!(
            "needs an even patch of at least {LEAST_PATCH} × {LEAST_PATCH} pixels, but {rows} × {columns} are given"
        )));
    }
    let of_patch = transform(patch, planner);
    let power = Rings::of_power(&of_patch);
    let own = power.frequencies();
    // The mean is subtracted and the shading of the patch is no noise: the first rings say nothing.
    let lowest = own[FIRST_RING];
    Ok(frequencies.iter().map(|&f| interpolated(&own, &power.means, f.max(lowest))).collect())
}

/// Where low frequencies end: not before six rings.
fn low_end(frequencies: &[f64]) -> f64 {
    LOW_END.max(frequencies[FIRST_RING + 5])
}

/// Returns what ratios tend to at frequency 0, by a straight line through their logarithms over the square of the frequency,
/// which is exact for a Gaussian; `None` where one of them is not above 0.
fn extrapolated_to_zero(frequencies: &[f64], ratios: &[f64], counts: &[f64]) -> Option<f64> {
    let (mut w, mut wx, mut wy, mut wxx, mut wxy) = (0.0, 0.0, 0.0, 0.0, 0.0);
    let rings = frequencies.iter().zip(ratios).zip(counts).skip(FIRST_RING);
    for ((frequency, ratio), count) in rings.take_while(|((f, _), _)| **f <= low_end(frequencies)) {
        let (x, y) = (frequency.powi(2), ratio.ln());
        if !y.is_finite() {
            return None;
        }
        (w, wx, wy) = (w + count, wx + count * x, wy + count * y);
        (wxx, wxy) = (wxx + count * x * x, wxy + count * x * y);
    }
    Some(((wxx * wy - wx * wxy) / (w * wxx - wx * wx)).exp())
}

/// Returns by how many (rows, columns) the first of two transforms is shifted against the second, of which this is the
/// product with its conjugate: the peak of their correlation, then the slope of the phase.
fn shift(cross: &Array2<Complex<f32>>, planner: &mut Planner) -> (f64, f64) {
    let (rows, columns) = cross.dim();
    let is_low = |(i, j): (usize, usize)| {
        let frequency = signed(i, rows).hypot(signed(j, columns));
        frequency > 0.5 / rows.min(columns) as f64 && frequency <= SHIFT_END
    };
    // Coefficients of the same weight have a sharp peak.
    let mut correlation = Array2::from_shape_fn((rows, columns), |at| {
        let norm = cross[at].norm();
        if is_low(at) && norm > 0.0 { cross[at] / norm } else { Complex::new(0.0, 0.0) }
    });
    let (of_row, of_column) = (planner.inverse(columns), planner.inverse(rows));
    along_both(&mut correlation, |row| of_row.process(row), |column| of_column.process(column));
    let peak = correlation.indexed_iter().max_by(|a, b| a.1.re.total_cmp(&b.1.re)).map_or((0, 0), |(at, _)| at);
    let (mut down, mut along) = (signed(peak.0, rows) * rows as f64, signed(peak.1, columns) * columns as f64);
    for _ in 0..4 {
        // A shift of s turns the phase by −2π f s; what is left of it is fitted by weight.
        let [mut yy, mut yx, mut xx, mut yp, mut xp] = [0.0; 5];
        for (at, value) in cross.indexed_iter() {
            if !is_low(at) {
                continue;
            }
            let (fy, fx) = (signed(at.0, rows), signed(at.1, columns));
            let (re, im) = (f64::from(value.re), f64::from(value.im));
            let (sin, cos) = (TAU * (fy * down + fx * along)).sin_cos();
            let phase = (re * sin + im * cos).atan2(re * cos - im * sin);
            let weight = re.hypot(im);
            yy += weight * fy * fy;
            yx += weight * fy * fx;
            xx += weight * fx * fx;
            yp += weight * fy * phase;
            xp += weight * fx * phase;
        }
        let determinant = yy * xx - yx * yx;
        if determinant <= 0.0 {
            break;
        }
        down -= (xx * yp - yx * xp) / determinant / TAU;
        along -= (yy * xp - yx * yp) / determinant / TAU;
    }
    (down, along)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// A texture with power at all frequencies: squares of many sizes and grays, each over those before.
    fn squares(side: usize, seed: u64) -> Array2<f32> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut plane = Array2::from_elem((side, side), 0.5_f32);
        for _ in 0..side * side / 2 {
            let size = (2.0 / (1.0 - random.random::<f64>()).sqrt()).min(40.0) as usize;
            let (row, column) = (random.random_range(0..side), random.random_range(0..side));
            let gray = 0.25 + 0.5 * random.random::<f32>();
            let (rows, columns) = (row..(row + size).min(side), column..(column + size).min(side));
            plane.slice_mut(ndarray::s![rows, columns]).fill(gray);
        }
        plane
    }

    #[test]
    fn a_texture_has_its_own_response() {
        let texture = squares(128, 1);
        let half = texture.mapv(|v| 0.1 + 0.5 * v);
        let spectra = TextureSpectra::measure(&half.view(), &texture.view(), None).unwrap();
        for response in [&spectra.direct, spectra.full_reference.as_ref().unwrap()] {
            // Single precision; neither gain nor offset is in the response.
            response.response.iter().for_each(|&r| assert_abs_diff_eq!(r, 1.0, epsilon = 1e-4));
            assert_eq!(response.mtf50(), None);
        }
        assert_abs_diff_eq!(spectra.shift_px.0.hypot(spectra.shift_px.1), 0.0, epsilon = 1e-4);
        assert_abs_diff_eq!(spectra.coherence, 1.0, epsilon = 1e-4);
    }

    #[test]
    fn a_shifted_reference_is_laid_over_the_picture() {
        let large = squares(300, 2);
        let at = |row: usize, column: usize| large.slice(ndarray::s![row..row + 256, column..column + 256]);
        // What is at row 3 of the reference is at row 0 of the picture.
        let spectra = TextureSpectra::measure(&at(23, 18), &at(20, 20), None).unwrap();
        let (down, along) = spectra.shift_px;
        // The windows differ by as much as the pictures are shifted, hundredths.
        assert_abs_diff_eq!(down, -3.0, epsilon = 0.05);
        assert_abs_diff_eq!(along, 2.0, epsilon = 0.05);
        assert!(spectra.full_reference.unwrap().at(0.3) > 0.9);
        let other = squares(256, 3);
        let spectra = TextureSpectra::measure(&at(0, 0), &other.view(), None).unwrap();
        assert_eq!(spectra.full_reference, None);
    }

    #[test]
    fn what_is_no_texture_is_refused() {
        let texture = squares(96, 4);
        let flat = Array2::from_elem((96, 96), 0.3_f32);
        let refused = |picture: &Array2<f32>, reference: &Array2<f32>, noise: Option<TextureNoise<'_>>, words: &str| {
            let error = TextureSpectra::measure(&picture.view(), &reference.view(), noise).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        };
        refused(&flat, &texture, None, "is not in the picture, which is flat");
        refused(&texture, &flat, None, "is not in the reference, which is flat");
        refused(&squares(60, 1), &squares(60, 1), None, "needs at least 64 × 64 pixels, but 60 × 60");
        refused(&texture, &squares(95, 1), None, "expected 96 × 96, found 95 × 95");
        let small = squares(16, 1);
        refused(&texture, &texture, Some(TextureNoise::Flat(small.view())), "patch of at least 32 × 32");
        let loud = squares(96, 9).mapv(|v| 9.0 * v);
        refused(&texture, &texture, Some(TextureNoise::Flat(loud.view())), "less power at low frequencies");
        refused(&texture, &texture, Some(TextureNoise::SecondFrame(flat.view())), "second frame, which is flat");
        refused(&texture, &texture, Some(TextureNoise::SecondFrame(texture.view())), "expected another exposure");
    }

    #[test]
    fn where_noise_has_all_of_the_power_is_stated() {
        let texture = squares(128, 5);
        let measure =
            |noise: Option<TextureNoise<'_>>| TextureSpectra::measure(&texture.view(), &texture.view(), noise).unwrap();
        assert_eq!(measure(None).noise_from(), None);
        // White noise whose power lies between the texture's at low and at high frequencies.
        let mut random = ChaCha8Rng::seed_from_u64(6);
        let patch = Array2::from_shape_simple_fn((64, 64), || 0.5 + 0.3 * (random.random::<f32>() - 0.5));
        let spectra = measure(Some(TextureNoise::Flat(patch.view())));
        let from = spectra.noise_from().unwrap();
        assert!((0.05..0.5).contains(&from), "{from}");
        assert_eq!(spectra.direct.at(from), 0.0);
    }
}
