//! Local tone mapping: less contrast between parts of a picture, and as much or more within them.
//!
//! The logarithm of luminance is parted into a base, which is smooth but for strong edges, and detail. The base is the guided
//! filter's (He, Sun & Tang, "Guided image filtering", IEEE Trans. Pattern Anal. Mach. Intell. 35, 2013), computed on a coarser
//! raster and read on the fine one (He & Sun, "Fast guided filter", arXiv:1505.00996), so that edges have no halos as wide as the
//! filter. Base and detail are put together with factors of their own (Durand & Dorsey, "Fast bilateral filtering for the
//! display of high-dynamic-range images", SIGGRAPH 2002).

use ndarray::{Array2, ArrayView3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::SensorError;

/// How the contrast between and within parts of a picture is changed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct LocalTone {
    /// The factor on the contrast between parts, in stops about a middle gray of 18 %: 1 leaves it, 0.5 halves it.
    pub range: f64,
    /// The factor on the contrast within parts, in stops: 1 leaves it.
    pub detail: f64,
}

impl Default for LocalTone {
    /// Nothing is changed.
    fn default() -> Self {
        Self { range: 1.0, detail: 1.0 }
    }
}

/// The gray that keeps its brightness, of a white of 1.
const MIDDLE_GRAY: f32 = 0.18;
/// Light that is added before the logarithm, of a white of 1: what is darker is noise rather than detail.
const DARKEST: f32 = 1.0 / 512.0;
/// The half side of the filter's window, as a share of the longer side of the picture.
const REACH: f64 = 0.03;
/// Edges of this many stops are half base and half detail.
const EDGE_STOPS: f32 = 0.4;
/// Samples of the coarse raster in half the side of the window.
const COARSE_REACH: usize = 6;

impl LocalTone {
    /// Whether nothing is changed.
    pub fn is_none(self) -> bool {
        self == Self::default()
    }

    /// Reads `range` or `range,detail`.
    ///
    /// # Errors
    /// When these are no numbers.
    pub fn parse(text: &str) -> Result<Self, SensorError> {
        let numbers: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
        match numbers.as_deref() {
            Some(&[range]) => Ok(Self { range, ..Self::default() }),
            Some(&[range, detail]) => Ok(Self { range, detail }),
            _ => Err(SensorError::Word {
                what: "local tone",
                found: text.to_owned(),
                expected: "RANGE, or RANGE,DETAIL: factors on the contrast between and within parts, as 0.6,1.2"
                    .to_owned(),
            }),
        }
    }

    pub(crate) fn check(self) -> Result<(), SensorError> {
        let all = [("local_tone.range", self.range, 0.0, 2.0), ("local_tone.detail", self.detail, 0.0, 4.0)];
        match all.into_iter().find(|(_, value, low, high)| !(low..=high).contains(&value)) {
            Some((key, value, ..)) => Err(SensorError::value(
                "the processing",
                key,
                value,
                "a number from 0 to 2 (range), from 0 to 4 (detail)",
            )),
            None => Ok(()),
        }
    }

    /// Returns the factor on the light of each pixel, rows × columns × 3 linear and in the primaries of sRGB, made so many times as
    /// bright.
    pub(crate) fn factors(self, light: ArrayView3<'_, f32>, brightness: f32) -> Array2<f32> {
        let (rows, columns, _) = light.dim();
        let mut stops = Array2::<f32>::zeros((rows, columns));
        ndarray::Zip::from(&mut stops).and(light.lanes(ndarray::Axis(2))).par_for_each(|stops, rgb| {
            // The luminance of linear sRGB (IEC 61966-2-1).
            let luminance = brightness * (0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]);
            *stops = (luminance.max(0.0) + DARKEST).log2();
        });
        let base = Base::of(&stops);
        let anchor = (MIDDLE_GRAY + DARKEST).log2();
        let (range, detail) = (self.range as f32, self.detail as f32);
        stops.outer_iter_mut().into_par_iter().enumerate().for_each(|(row, mut line)| {
            let line = line.as_slice_mut().expect("a new array is contiguous");
            base.for_row(row, line, |stops, base| {
                let wanted = anchor + range * (base - anchor) + detail * (stops - base);
                (wanted - stops).exp2()
            });
        });
        stops
    }
}

/// The guided filter's coefficients of a plane that guides itself, on a coarse raster: base = a × plane + b.
struct Base {
    /// Pixels a sample, each way.
    step: usize,
    a: Array2<f32>,
    b: Array2<f32>,
}

impl Base {
    fn of(plane: &Array2<f32>) -> Self {
        let (rows, columns) = plane.dim();
        let reach_px = REACH * rows.max(columns) as f64;
        let step = ((reach_px / COARSE_REACH as f64) as usize).max(1);
        let reach = ((reach_px / step as f64).round() as usize).max(1);
        let coarse = block_means(plane, step);
        let mean = box_means(&coarse, reach);
        let mean_of_squares = box_means(&coarse.mapv(|v| v * v), reach);
        let variance = &mean_of_squares - &mean.mapv(|v| v * v);
        let a = variance.mapv(|v| v.max(0.0) / (v.max(0.0) + EDGE_STOPS * EDGE_STOPS));
        let b = &mean * &a.mapv(|a| 1.0 - a);
        Self { step, a: box_means(&a, reach), b: box_means(&b, reach) }
    }

    /// Replaces each value of a row by a function of it and its base.
    fn for_row(&self, row: usize, line: &mut [f32], of: impl Fn(f32, f32) -> f32) {
        let (rows, columns) = self.a.dim();
        let place = |i: usize, n: usize| {
            let at = ((i as f32 + 0.5) / self.step as f32 - 0.5).clamp(0.0, (n - 1) as f32);
            let below = (at as usize).min(n.saturating_sub(2));
            (below, (below + 1).min(n - 1), at - below as f32)
        };
        let (above, under, down) = place(row, rows);
        let mixed = |plane: &Array2<f32>| -> Vec<f32> {
            (0..columns).map(|c| plane[(above, c)] * (1.0 - down) + plane[(under, c)] * down).collect()
        };
        let (a, b) = (mixed(&self.a), mixed(&self.b));
        for (column, value) in line.iter_mut().enumerate() {
            let (left, right, across) = place(column, columns);
            let mix = |values: &[f32]| values[left] * (1.0 - across) + values[right] * across;
            *value = of(*value, mix(&a) * *value + mix(&b));
        }
    }
}

/// Returns the means of blocks of so many pixels each way; those at the right and bottom may be smaller.
fn block_means(plane: &Array2<f32>, step: usize) -> Array2<f32> {
    let (rows, columns) = plane.dim();
    let mut means = Array2::zeros((rows.div_ceil(step), columns.div_ceil(step)));
    means.outer_iter_mut().into_par_iter().enumerate().for_each(|(block_row, mut line)| {
        let from = block_row * step..((block_row + 1) * step).min(rows);
        let height = from.len();
        for row in from {
            let values = plane.row(row);
            let values = values.as_slice().expect("planes of stops are contiguous");
            line.iter_mut().zip(values.chunks(step)).for_each(|(sum, block)| *sum += block.iter().sum::<f32>());
        }
        for (block_column, mean) in line.iter_mut().enumerate() {
            let width = step.min(columns - block_column * step);
            *mean /= (width * height) as f32;
        }
    });
    means
}

/// Returns the means over squares of 2 × `reach` + 1 samples, of those of them that are on the plane.
fn box_means(plane: &Array2<f32>, reach: usize) -> Array2<f32> {
    let along = |plane: &Array2<f32>| {
        let n = plane.ncols();
        let mut means = Array2::zeros(plane.dim());
        means.outer_iter_mut().into_par_iter().zip(plane.outer_iter()).for_each(|(mut to, from)| {
            let sums: Vec<f64> = std::iter::once(0.0)
                .chain(from.iter().scan(0.0, |sum, &v| {
                    *sum += f64::from(v);
                    Some(*sum)
                }))
                .collect();
            for (i, mean) in to.iter_mut().enumerate() {
                let (first, end) = (i.saturating_sub(reach), (i + reach + 1).min(n));
                *mean = ((sums[end] - sums[first]) / (end - first) as f64) as f32;
            }
        });
        means
    };
    along(&along(plane).reversed_axes().as_standard_layout().into_owned())
        .reversed_axes()
        .as_standard_layout()
        .into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array3;

    fn gray(plane: &Array2<f32>) -> Array3<f32> {
        let (rows, columns) = plane.dim();
        Array3::from_shape_fn((rows, columns, 3), |(r, c, _)| plane[(r, c)])
    }

    fn mapped(plane: &Array2<f32>, tone: LocalTone) -> Array2<f32> {
        plane * &tone.factors(gray(plane).view(), 1.0)
    }

    /// Two parts, four stops apart, each with a fine texture of a quarter stop.
    fn two_parts() -> Array2<f32> {
        Array2::from_shape_fn((120, 200), |(r, c)| {
            let part = if c < 100 { 0.045_f32 } else { 0.72 };
            part * (0.125 * if (r / 3 + c / 3).is_multiple_of(2) { 1.0 } else { -1.0_f32 }).exp2()
        })
    }

    /// The mean stops and the contrast of a part, away from the edge between them.
    fn part(plane: &Array2<f32>, from: usize) -> (f32, f32) {
        let stops = plane.slice(ndarray::s![30..90, from..from + 48]).mapv(f32::log2);
        let (low, high) = stops.iter().fold((f32::MAX, f32::MIN), |(l, h), &v| (l.min(v), h.max(v)));
        (stops.mean().unwrap(), high - low)
    }

    #[test]
    fn parts_come_closer_and_texture_stays() {
        let plane = two_parts();
        let toned = mapped(&plane, LocalTone { range: 0.5, detail: 1.0 });
        let ((dark, dark_texture), (bright, bright_texture)) = (part(&toned, 20), part(&toned, 132));
        let ((was_dark, was_texture), (was_bright, _)) = (part(&plane, 20), part(&plane, 132));
        assert!((was_bright - was_dark - 4.0).abs() < 0.01 && (was_texture - 0.25).abs() < 0.01);
        // Half of four stops; the light added before the logarithm takes a little of it.
        assert!((bright - dark - 2.0).abs() < 0.1, "{}", bright - dark);
        for texture in [dark_texture, bright_texture] {
            assert!((texture - 0.25).abs() < 0.03, "{texture}");
        }
        // Middle gray is between them and stays: both move by the same.
        assert!(((dark - was_dark) + (bright - was_bright)).abs() < 0.1);
    }

    #[test]
    fn detail_is_a_factor_of_its_own_and_none_changes_nothing() {
        let plane = two_parts();
        let same = mapped(&plane, LocalTone::default());
        assert!((&same - &plane).iter().all(|d| d.abs() < 1e-5));
        let (_, texture) = part(&mapped(&plane, LocalTone { range: 1.0, detail: 2.0 }), 132);
        assert!((texture - 0.5).abs() < 0.05, "{texture}");
        let black = Array2::zeros((40, 40));
        assert_eq!(mapped(&black, LocalTone { range: 0.5, detail: 1.5 }), black);
    }

    #[test]
    fn edges_have_no_wide_halos() {
        let edge = Array2::from_shape_fn((120, 200), |(_, c)| if c < 100 { 0.045_f32 } else { 0.72 });
        let toned = mapped(&edge, LocalTone { range: 0.5, detail: 1.0 }).mapv(f32::log2);
        let far = (toned[(60, 10)], toned[(60, 190)]);
        for (near, far) in [(toned[(60, 94)], far.0), (toned[(60, 105)], far.1)] {
            // Four stops are taken for detail to (0.4 / 2)² / (1 + …) of them: a tenth of a stop.
            assert!((near - far).abs() < 0.15, "{near} {far}");
        }
    }

    #[test]
    fn words_are_read_and_checked() {
        assert_eq!(LocalTone::parse("0.6").unwrap(), LocalTone { range: 0.6, detail: 1.0 });
        assert_eq!(LocalTone::parse("0.6, 1.2").unwrap(), LocalTone { range: 0.6, detail: 1.2 });
        assert!(LocalTone::parse("much").is_err());
        assert!(LocalTone { range: -0.1, detail: 1.0 }.check().is_err());
        assert!(LocalTone { range: 0.5, detail: f64::NAN }.check().is_err());
    }
}
