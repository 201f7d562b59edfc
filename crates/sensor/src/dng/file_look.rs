//! The look of a profile: maps of hue, saturation and value, an exposure and a tone curve (DNG 1.6, chapter 6).
//!
//! They are for linear light in the primaries of ROMM RGB (ISO 22028-2) under D50.

use dioptric_spectrum::{Xyz, adapt_bradford, srgb_decode, srgb_encode};
use ndarray::{Array3, Zip};
use rayon::prelude::*;
use serde::Serialize;

use super::{
    color::{D50_XY, inverse, xyz_of},
    gain_table::GainTableMap,
    tags::{
        BASELINE_EXPOSURE, BASELINE_EXPOSURE_OFFSET, PROFILE_HUE_SAT_MAP_DIMS, PROFILE_HUE_SAT_MAP_ENCODING,
        PROFILE_LOOK_TABLE_DATA, PROFILE_LOOK_TABLE_DIMS, PROFILE_LOOK_TABLE_ENCODING, PROFILE_TONE_CURVE,
    },
    tiff_reader::Fields,
};

/// The chromaticities of red, green and blue of ROMM RGB.
const ROMM_XY: [[f64; 2]; 3] = [[0.7347, 0.2653], [0.1596, 0.8404], [0.0366, 0.0001]];
/// The most entries of a map: far more than profiles have (90 × 30 × 30).
const MOST_ENTRIES: usize = 1 << 20;

/// How far the profile of a file makes its picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DngRendering {
    /// By its color matrices alone.
    Matrices,
    /// By its matrices and its map of hues, saturations and values: the colors that it was measured to have.
    #[default]
    Colors,
    /// Also as bright as the file asks, with its look table and its tone curve: as a raw converter shows it at first.
    Look,
}

impl DngRendering {
    /// The choices with the words for them.
    pub const NAMES: [(&'static str, Self); 3] =
        [("matrices", Self::Matrices), ("colors", Self::Colors), ("look", Self::Look)];
}

/// A map over hue, saturation and value: what is added to a hue, degrees, and the factors on saturation and value.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ColorMap {
    /// Steps of hue, which go round, of saturation and of value, which end at 1.
    pub steps: [usize; 3],
    /// Whether value is looked up as sRGB codes it.
    pub of_codes: bool,
    /// By value, then hue, then saturation.
    #[serde(skip)]
    entries: Vec<[f32; 3]>,
}

impl ColorMap {
    /// Reads a map of the size and coding that a profile states, if it has one.
    pub(super) fn read(profile: &Fields<'_>, data: u16, dims: u16, coding: u16) -> Result<Option<Self>, String> {
        let (values, steps) = (profile.numbers(data)?, profile.whole(dims)?);
        if values.is_empty() {
            return Ok(None);
        }
        let wrong = |reason: String| Err(format!("has a color map in field {data} {reason}"));
        let (&[hues, saturations], &[values_n]) = steps.split_at(steps.len().min(2)) else {
            return wrong(format!("of {} sizes, expected 3", steps.len()));
        };
        let n = hues.saturating_mul(saturations).saturating_mul(values_n);
        if hues == 0 || saturations < 2 || values_n == 0 || n > MOST_ENTRIES || values.len() != 3 * n {
            return wrong(format!("of {} numbers for {hues} × {saturations} × {values_n} entries", values.len()));
        }
        if values.iter().any(|value| !value.is_finite()) {
            return wrong("with numbers that are none".to_owned());
        }
        let of_codes = match profile.one_or(coding, 0)? {
            0 => false,
            1 => true,
            other => return wrong(format!("coded as {other}, expected 0 (linear) or 1 (sRGB)")),
        };
        let entries = values.chunks_exact(3).map(|entry| [entry[0] as f32, entry[1] as f32, entry[2] as f32]).collect();
        Ok(Some(Self { steps: [hues, saturations, values_n], of_codes, entries }))
    }

    /// Returns the mean of maps of one size by their shares, or the first of several sizes.
    pub(super) fn mixed(maps: &[(f64, &Self)]) -> Option<Self> {
        let all: f64 = maps.iter().map(|(share, _)| share).sum();
        let (_, first) = maps.first()?;
        let mut mixed = Self { entries: vec![[0.0; 3]; first.entries.len()], ..(*first).clone() };
        if maps.iter().any(|(_, map)| (map.steps, map.of_codes) != (first.steps, first.of_codes)) || all <= 0.0 {
            return Some((*first).clone());
        }
        for (share, map) in maps {
            let share = (share / all) as f32;
            for (mean, entry) in mixed.entries.iter_mut().zip(&map.entries) {
                mean.iter_mut().zip(entry).for_each(|(mean, value)| *mean += share * value);
            }
        }
        Some(mixed)
    }

    /// Returns what a color becomes, linear light.
    fn apply(&self, rgb: [f32; 3]) -> [f32; 3] {
        let [hue, saturation, value] = hsv_of(rgb.map(|part| part.max(0.0)));
        let coded = if self.of_codes { srgb_encode(f64::from(value)) as f32 } else { value };
        let [shift_deg, saturation_factor, value_factor] = self.entry(hue, saturation, coded);
        let changed = coded * value_factor;
        let value = if self.of_codes { srgb_decode(f64::from(changed)) as f32 } else { changed };
        rgb_of([hue + shift_deg / 60.0, (saturation * saturation_factor).clamp(0.0, 1.0), value.max(0.0)])
    }

    /// Returns the entry at a hue, sixths of a turn, a saturation and a value: linear between those of the map.
    fn entry(&self, hue: f32, saturation: f32, value: f32) -> [f32; 3] {
        let [hues, saturations, values] = self.steps;
        let turned = hue / 6.0 * hues as f32;
        let (hue, hue_part) = (turned as usize, turned.fract());
        let along = |part: f32, n: usize| {
            let place = part.clamp(0.0, 1.0) * (n - 1) as f32;
            let below = (place as usize).min(n.saturating_sub(2));
            (below, place - below as f32)
        };
        let ((saturation, saturation_part), (value, value_part)) =
            (along(saturation, saturations), along(value, values));
        let mut sum = [0.0; 3];
        for (value, of_value) in [(value, 1.0 - value_part), (value + 1, value_part)] {
            for (hue, of_hue) in [(hue, 1.0 - hue_part), (hue + 1, hue_part)] {
                for (saturation, of_saturation) in
                    [(saturation, 1.0 - saturation_part), (saturation + 1, saturation_part)]
                {
                    let weight = of_value * of_hue * of_saturation;
                    if weight > 0.0 {
                        let entry = self.entries[(value * hues + hue % hues) * saturations + saturation];
                        sum.iter_mut().zip(entry).for_each(|(sum, part)| *sum += weight * part);
                    }
                }
            }
        }
        sum
    }
}

/// What a profile adds to colors for a look.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct DngLook {
    /// Stops that pictures are brighter by (`BaselineExposure` and the profile's offset to it).
    pub exposure_stops: f64,
    /// The look table.
    pub table: Option<ColorMap>,
    /// Local gains.
    pub gains: Option<GainTableMap>,
    /// Points of the tone curve, from light to light.
    pub curve: Option<Vec<[f64; 2]>>,
}

impl DngLook {
    /// Reads the exposure of a file and the look of a profile, which may be that of the file.
    pub(super) fn read(first: &Fields<'_>, profile: &Fields<'_>) -> Result<Self, String> {
        // Some writers state 0 over 0, which is none.
        let stops = |fields: &Fields<'_>, tag: u16| -> Result<f64, String> {
            Ok(fields.numbers(tag)?.first().copied().filter(|stops| stops.is_finite()).unwrap_or(0.0))
        };
        let curve = profile.numbers(PROFILE_TONE_CURVE)?;
        let curve: Vec<[f64; 2]> = curve.chunks_exact(2).map(|point| [point[0], point[1]]).collect();
        let rises = curve.windows(2).all(|pair| pair[0][0] < pair[1][0]);
        if curve.len() == 1 || !rises || curve.iter().flatten().any(|value| !value.is_finite()) {
            return Err("has a tone curve whose points do not follow each other".to_owned());
        }
        Ok(Self {
            exposure_stops: stops(first, BASELINE_EXPOSURE)? + stops(profile, BASELINE_EXPOSURE_OFFSET)?,
            table: ColorMap::read(
                profile,
                PROFILE_LOOK_TABLE_DATA,
                PROFILE_LOOK_TABLE_DIMS,
                PROFILE_LOOK_TABLE_ENCODING,
            )?,
            gains: None,
            curve: (!curve.is_empty()).then_some(curve),
        })
    }

    /// Returns whether it changes nothing.
    pub(super) fn is_none(&self) -> bool {
        *self == Self::default()
    }
}

/// Reads the map of hues, saturations and values for a calibration light.
pub(super) fn hue_sat_map(profile: &Fields<'_>, data: u16) -> Result<Option<ColorMap>, String> {
    ColorMap::read(profile, data, PROFILE_HUE_SAT_MAP_DIMS, PROFILE_HUE_SAT_MAP_ENCODING)
}

/// Changes a picture, rows × columns × linear sRGB, by a map of colors and a look.
pub(super) fn render(picture: &mut Array3<f32>, map: Option<&ColorMap>, look: &DngLook) {
    if map.is_none() && look.is_none() {
        return;
    }
    let (to_romm, to_srgb) = matrices();
    let gain = look.exposure_stops.exp2() as f32;
    let curve = look.curve.as_deref().map(ToneTable::new);
    let change = |rgb: [f32; 3], local: &dyn Fn([f32; 3]) -> f32| {
        let mut rgb = product(&to_romm, rgb);
        if let Some(map) = map {
            rgb = map.apply(rgb);
        }
        rgb = rgb.map(|part| gain * part);
        let local = local(rgb);
        rgb = rgb.map(|part| local * part);
        if let Some(table) = &look.table {
            rgb = table.apply(rgb);
        }
        if let Some(curve) = &curve {
            rgb = curve.apply(rgb);
        }
        product(&to_srgb, rgb)
    };
    let (n_rows, n_columns, _) = picture.dim();
    let mut rows: Vec<_> = picture.outer_iter_mut().collect();
    rows.par_iter_mut().enumerate().for_each(|(number, row)| {
        let gains = look.gains.as_ref().map(|gains| gains.row(number, n_rows));
        Zip::indexed(row.rows_mut()).for_each(|column, mut pixel| {
            let local = |rgb: [f32; 3]| gains.as_ref().map_or(1.0, |gains| gains.gain(column, n_columns, rgb));
            let changed = change([pixel[0], pixel[1], pixel[2]], &local);
            pixel.iter_mut().zip(changed).for_each(|(part, changed)| *part = changed);
        });
    });
}

/// A tone curve over evenly spaced light: a natural cubic spline through its points, held at its ends.
struct ToneTable(Vec<f32>);

/// Steps of a table of a curve.
const TONE_STEPS: usize = 1 << 12;

impl ToneTable {
    fn new(points: &[[f64; 2]]) -> Self {
        let bends = bends(points);
        let at = |light: f64| {
            let last = points.len() - 1;
            if light <= points[0][0] || light >= points[last][0] {
                return points[if light <= points[0][0] { 0 } else { last }][1];
            }
            let i = points.partition_point(|point| point[0] <= light) - 1;
            let ([x0, y0], [x1, y1]) = (points[i], points[i + 1]);
            let width = x1 - x0;
            let (b, a) = ((light - x0) / width, (x1 - light) / width);
            a * y0 + b * y1 + ((a * a * a - a) * bends[i] + (b * b * b - b) * bends[i + 1]) * width * width / 6.0
        };
        // Finer towards darkness, where curves are steepest: the root of light is looked up.
        Self((0..=TONE_STEPS).map(|i| at((i as f64 / TONE_STEPS as f64).powi(2)) as f32).collect())
    }

    fn at(&self, light: f32) -> f32 {
        let place = light.clamp(0.0, 1.0).sqrt() * TONE_STEPS as f32;
        let below = (place as usize).min(TONE_STEPS - 1);
        let part = place - below as f32;
        self.0[below] + part * (self.0[below + 1] - self.0[below])
    }

    /// Returns a color whose largest and smallest parts are those of the curve and whose middle part keeps its place between them: its hue stays.
    fn apply(&self, rgb: [f32; 3]) -> [f32; 3] {
        let (largest, smallest) = (rgb[0].max(rgb[1]).max(rgb[2]), rgb[0].min(rgb[1]).min(rgb[2]));
        let (to_largest, to_smallest) = (self.at(largest), self.at(smallest));
        let slope = if largest > smallest { (to_largest - to_smallest) / (largest - smallest) } else { 0.0 };
        rgb.map(|part| to_smallest + slope * (part - smallest))
    }
}

/// Returns the second derivatives of a natural cubic spline through points, one each.
fn bends(points: &[[f64; 2]]) -> Vec<f64> {
    let n = points.len();
    let (mut bends, mut rest) = (vec![0.0; n], vec![0.0; n]);
    for i in 1..n - 1 {
        let ([x0, y0], [x1, y1], [x2, y2]) = (points[i - 1], points[i], points[i + 1]);
        let share = (x1 - x0) / (x2 - x0);
        let pivot = share * bends[i - 1] + 2.0;
        let turn = (y2 - y1) / (x2 - x1) - (y1 - y0) / (x1 - x0);
        bends[i] = (share - 1.0) / pivot;
        rest[i] = (6.0 * turn / (x2 - x0) - share * rest[i - 1]) / pivot;
    }
    bends[n - 1] = 0.0;
    for i in (0..n - 1).rev() {
        bends[i] = bends[i] * bends[i + 1] + rest[i];
    }
    bends
}

/// Returns hue in sixths of a turn from red, saturation and value.
fn hsv_of([r, g, b]: [f32; 3]) -> [f32; 3] {
    let (value, least) = (r.max(g).max(b), r.min(g).min(b));
    let gap = value - least;
    if gap <= 0.0 {
        return [0.0, 0.0, value];
    }
    let hue = if value == r {
        (g - b) / gap
    } else if value == g {
        2.0 + (b - r) / gap
    } else {
        4.0 + (r - g) / gap
    };
    [hue.rem_euclid(6.0), gap / value, value]
}

/// The color of a hue in sixths of a turn, a saturation and a value.
fn rgb_of([hue, saturation, value]: [f32; 3]) -> [f32; 3] {
    [5.0, 3.0, 1.0].map(|first| {
        let place = (first + hue).rem_euclid(6.0);
        value - value * saturation * place.min(4.0 - place).clamp(0.0, 1.0)
    })
}

/// Returns the matrices from linear sRGB to linear ROMM RGB and back, white to white.
fn matrices() -> ([[f32; 3]; 3], [[f32; 3]; 3]) {
    let (d65, d50) = (Xyz::from_linear_srgb([1.0; 3]), xyz_of(D50_XY));
    let unit = |i: usize| [0, 1, 2].map(|j| f64::from(u8::from(i == j)));
    let columns = [0, 1, 2].map(|i| adapt_bradford(Xyz::from_linear_srgb(unit(i)), d65, d50).0);
    let d50_from_srgb = transposed(columns);
    // What each primary gives of the white.
    let primaries = transposed(ROMM_XY.map(|xy| xyz_of(xy).0));
    let parts = inverse(primaries).map(|row| row.iter().zip(d50.0).map(|(m, v)| m * v).sum::<f64>());
    let romm_from_d50 = inverse(primaries.map(|row| [0, 1, 2].map(|j| row[j] * parts[j])));
    let to_romm =
        [0, 1, 2].map(|i| [0, 1, 2].map(|j| (0..3).map(|k| romm_from_d50[i][k] * d50_from_srgb[k][j]).sum::<f64>()));
    let single = |matrix: [[f64; 3]; 3]| matrix.map(|row| row.map(|value| value as f32));
    (single(to_romm), single(inverse(to_romm)))
}

fn transposed(rows: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| rows[j][i]))
}

fn product(matrix: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A map of so many steps whose entries are told by their places.
    fn map(steps: [usize; 3], of_codes: bool, entry: impl Fn([usize; 3]) -> [f32; 3]) -> ColorMap {
        let [hues, saturations, values] = steps;
        let places = (0..values).flat_map(|v| (0..hues).flat_map(move |h| (0..saturations).map(move |s| [h, s, v])));
        ColorMap { steps, of_codes, entries: places.map(entry).collect() }
    }

    fn picture(rgb: [f32; 3]) -> Array3<f32> {
        Array3::from_shape_fn((2, 3, 3), |(_, _, i)| rgb[i])
    }

    fn rendered(rgb: [f32; 3], map: Option<&ColorMap>, look: &DngLook) -> [f32; 3] {
        let mut picture = picture(rgb);
        render(&mut picture, map, look);
        assert_eq!(picture.slice(ndarray::s![0, 0, ..]), picture.slice(ndarray::s![1, 2, ..]));
        [0, 1, 2].map(|i| picture[(1, 1, i)])
    }

    fn assert_near(found: [f32; 3], wanted: [f32; 3], tolerance: f32) {
        let near = found.iter().zip(wanted).all(|(a, b)| (a - b).abs() <= tolerance);
        assert!(near, "{found:?} {wanted:?}");
    }

    #[test]
    fn hues_there_and_back() {
        for rgb in [[0.9, 0.2, 0.1], [0.2, 0.9, 0.3], [0.1, 0.3, 1.7], [0.4; 3], [0.0; 3], [0.3, 0.3, 0.1]] {
            assert_near(rgb_of(hsv_of(rgb)), rgb, 1e-6);
        }
        assert_eq!(hsv_of([1.0, 1.0, 0.0]), [1.0, 1.0, 1.0]);
    }

    /// ISO 22028-2, annex: ROMM RGB of XYZ under D50, here of the primaries of sRGB (Bradford), as published tables of the two spaces have it.
    #[test]
    fn primaries_are_those_of_romm_rgb() {
        let (to_romm, to_srgb) = matrices();
        let wanted = [[0.5293, 0.3301, 0.1406], [0.0983, 0.8735, 0.0282], [0.0169, 0.1177, 0.8655]];
        for (row, wanted) in to_romm.into_iter().zip(wanted) {
            assert_near(row, wanted, 4e-4);
        }
        assert_near(product(&to_srgb, product(&to_romm, [0.2, 0.7, 0.4])), [0.2, 0.7, 0.4], 1e-6);
        assert_near(product(&to_romm, [1.0; 3]), [1.0; 3], 1e-6);
    }

    #[test]
    fn maps_that_change_nothing_leave_colors() {
        let none = map([6, 4, 3], true, |_| [0.0, 1.0, 1.0]);
        for rgb in [[0.2, 0.5, 0.8], [1.4, 0.3, 0.2], [0.0; 3]] {
            assert_near(rendered(rgb, Some(&none), &DngLook::default()), rgb, 3e-6);
        }
    }

    /// What is done to hue, saturation and value, by hand in the primaries of the map.
    #[test]
    fn maps_turn_hues_and_scale_saturation_and_value() {
        let turned = map([1, 2, 1], false, |_| [120.0, 0.5, 0.8]);
        // Hue 1/3 of a turn on: red's parts go to green, green's to blue.
        let [r, g, b] = [0.6_f32, 0.3, 0.2];
        let [_, saturation, value] = hsv_of([r, g, b]);
        let faded = |part: f32| 0.8 * (value - (value - part) * 0.5);
        assert!(saturation > 0.6);
        assert_near(turned.apply([r, g, b]), [faded(b), faded(r), faded(g)], 1e-6);
        // By codes the factor is one on the code.
        let coded = map([1, 2, 1], true, |_| [0.0, 1.0, 0.5]);
        let wanted = srgb_decode(0.5 * srgb_encode(0.4)) as f32;
        assert_near(coded.apply([0.4; 3]), [wanted; 3], 1e-6);
    }

    /// Value is the slowest, saturation the fastest of the three; hue goes round, saturation and value end.
    #[test]
    fn entries_are_found_between_those_of_the_map() {
        let steps = [4, 3, 2];
        let told = map(steps, false, |[h, s, v]| [h as f32, s as f32, v as f32]);
        let at = |hue_deg: f32, saturation: f32, value: f32| told.entry(hue_deg / 60.0, saturation, value);
        assert_near(at(90.0, 0.5, 0.0), [1.0, 1.0, 0.0], 1e-6);
        assert_near(at(135.0, 0.75, 0.25), [1.5, 1.5, 0.25], 1e-6);
        assert_near(at(315.0, 1.0, 1.0), [1.5, 2.0, 1.0], 1e-6);
        assert_near(at(0.0, 1.0, 5.0), [0.0, 2.0, 1.0], 1e-6);
    }

    #[test]
    fn maps_of_lights_are_mixed_by_their_shares() {
        let of = |saturation: f32| map([2, 2, 1], false, move |_| [10.0 * saturation, saturation, 1.0]);
        let (warm, cold) = (of(0.8), of(1.2));
        let mixed = ColorMap::mixed(&[(0.25, &warm), (0.75, &cold)]).unwrap();
        assert_near(mixed.entry(0.0, 0.5, 0.5), [11.0, 1.1, 1.0], 1e-5);
        assert_eq!(ColorMap::mixed(&[]), None);
    }

    #[test]
    fn looks_brighten_and_curve_and_keep_hues() {
        let stops = DngLook { exposure_stops: 1.0, ..DngLook::default() };
        assert_near(rendered([0.1, 0.2, 0.3], None, &stops), [0.2, 0.4, 0.6], 1e-6);
        // A square by its points: a spline through many of them meets it.
        let points = (0..=64).map(|i| f64::from(i) / 64.0).map(|x| [x, x * x]).collect();
        let curve = ToneTable::new(&DngLook { curve: Some(points), ..DngLook::default() }.curve.unwrap());
        let [low, middle, high] = [0.2_f32, 0.35, 0.6];
        let place = (middle - low) / (high - low);
        let wanted = [high * high, low * low + place * (high * high - low * low), low * low];
        assert_near(curve.apply([high, middle, low]), wanted, 2e-5);
        assert_near(curve.apply([3.0, 3.0, 3.0]), [1.0; 3], 1e-6);
        // A straight line of two points.
        let line = ToneTable::new(&[[0.0, 0.1], [1.0, 0.6]]);
        assert_near(line.apply([0.25; 3]), [0.225; 3], 1e-5);
    }
}
