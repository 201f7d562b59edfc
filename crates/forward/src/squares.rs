//! Where in the scene the places along a row of the film lie.

use dioptric_psf::{FieldsAlong, FilmMap};
use dioptric_scene::View;
use multiversion::multiversion;

/// Stands for the square of a place that nothing is seen from.
pub(crate) const UNSEEN: u32 = u32::MAX;

/// Places from one at which the map is looked up to the next.
const APART: usize = 8;

/// Places that one polynomial serves: from one that is looked up over a second to a third.
const SEGMENT: usize = 2 * APART;

/// Places that are looked up for a segment: its ends, its middle and two beyond, the last of which tells how good the polynomial is.
const N_LOOKED_UP: usize = 5;

/// How far off a place between those that are looked up may lie, samples of the scene.
const LARGEST_ERROR: f64 = 5e-6;

/// How far off the light between them may be, parts of it.
const LARGEST_GAIN_ERROR: f64 = 1e-7;

/// Rows and columns up to which places lie between others: those that [`whole`] serves, and far beyond any scene.
const FARTHEST: f64 = 4e6;

/// The samples of a scene and the directions that they are seen in.
#[derive(Clone, Copy)]
pub(crate) struct SceneRaster {
    pub(crate) view: View,
    pub(crate) rows: usize,
    pub(crate) columns: usize,
}

impl SceneRaster {
    /// From a sample to the one beside it and the one below it; to itself where there is none.
    pub(crate) fn steps(&self) -> (usize, usize) {
        (usize::from(self.columns > 1), if self.rows > 1 { self.columns } else { 0 })
    }

    /// Returns the row and column of a field.
    #[inline(always)]
    fn place_of(&self, tan_x: f64, tan_y: f64) -> [f64; 2] {
        let View { focal_px, center_x_px, center_y_px } = self.view;
        [center_y_px - focal_px * tan_y, center_x_px + focal_px * tan_x]
    }
}

/// Squares between four samples of the scene in which places lie; beyond the edge of the scene, at the edge.
///
/// There are as many as places, and more up to a whole number of segments.
#[derive(Default)]
pub(crate) struct Squares {
    /// The number of the sample at the upper left of each, or [`UNSEEN`].
    pub(crate) first: Vec<u32>,
    /// How far below and to the right of it the place lies, 0 to 1.
    pub(crate) down: Vec<f32>,
    pub(crate) across: Vec<f32>,
    /// Irradiance per radiance, sr; 0 beyond the edge.
    pub(crate) gain: Vec<f32>,
    /// Segments whose places are looked up one by one.
    uneven: Vec<usize>,
    x_mm: Vec<f64>,
    seen: FieldsAlong,
}

impl Squares {
    /// Finds what is seen at each of `n` places of one height, `x_mm` of their numbers to the right.
    pub(crate) fn find_each(
        &mut self,
        scene: &SceneRaster,
        map: &FilmMap,
        n: usize,
        (x_mm, y_mm): (impl Fn(usize) -> f64, f64),
    ) {
        self.resize(n);
        self.look_up(map, (0..n).map(x_mm), y_mm);
        locate(scene, 0, self);
    }

    /// Finds what is seen at `n` places of one height, `x_mm` of their numbers to the right: evenly spaced.
    ///
    /// The map is looked up at every eighth place. Between three of these a polynomial of third order has the places of all, unless it
    /// would be off, or what the lens sees ends there (docs/forward.md 3).
    pub(crate) fn find(
        &mut self,
        scene: &SceneRaster,
        map: &FilmMap,
        n: usize,
        (x_mm, y_mm): (impl Fn(usize) -> f64, f64),
    ) {
        let n_segments = n.div_ceil(SEGMENT);
        self.resize(n_segments * SEGMENT);
        let looked_up = 0..2 * n_segments + N_LOOKED_UP - 2;
        self.look_up(map, looked_up.map(|place| x_mm(place * APART)), y_mm);
        interpolate(scene, self);
        for i in 0..self.uneven.len() {
            let start = self.uneven[i] * SEGMENT;
            self.look_up(map, (start..n.min(start + SEGMENT)).map(&x_mm), y_mm);
            locate(scene, start, self);
        }
    }

    fn resize(&mut self, len: usize) {
        self.first.resize(len, 0);
        for values in [&mut self.down, &mut self.across, &mut self.gain] {
            values.resize(len, 0.0);
        }
    }

    /// Looks a map up at places of one height.
    fn look_up(&mut self, map: &FilmMap, x_mm: impl Iterator<Item = f64>, y_mm: f64) {
        self.x_mm.clear();
        self.x_mm.extend(x_mm);
        map.along(&self.x_mm, y_mm, &mut self.seen);
    }

    /// Whether anything is seen at the first `n` places.
    pub(crate) fn sees_any(&self, n: usize) -> bool {
        self.first.iter().take(n).any(|first| *first != UNSEEN)
    }

    /// Puts the light at each place, of a surface without holes in one layer, into `light`.
    pub(crate) fn light(&self, scene: &SceneRaster, radiance: &[f32], light: &mut Vec<f32>) {
        light.resize(self.first.len(), 0.0);
        interpolate_light(self, scene.steps(), radiance, light);
    }
}

/// The polynomial of third order through four numbers, evenly spaced, the first at the first place of a segment, less a whole number.
#[derive(Clone, Copy)]
struct Cubic {
    coefficients: [f32; 4],
}

impl Cubic {
    #[inline(always)]
    fn through([a, b, c, d, _]: [f64; N_LOOKED_UP], base: f64) -> Self {
        // Newton's form, with differences over the distance between those that are looked up.
        let (first, second, third) = (b - a, a - 2.0 * b + c, d - a + 3.0 * (b - c));
        let apart = APART as f64;
        let coefficients = [
            a - base,
            (first - second / 2.0 + third / 3.0) / apart,
            (second - third) / (2.0 * apart * apart),
            third / (6.0 * apart * apart * apart),
        ];
        Self { coefficients: coefficients.map(|coefficient| coefficient as f32) }
    }

    #[inline(always)]
    fn at(&self, place: f32) -> f32 {
        let [constant, slope, bend, turn] = self.coefficients;
        constant + place * (slope + place * (bend + place * turn))
    }
}

/// Returns how far off a polynomial of third order through the first four of five numbers, evenly spaced, is between the first three.
#[inline(always)]
fn error_between([a, b, c, d, e]: [f64; N_LOOKED_UP]) -> f64 {
    // The largest of |t (t − 1) (t − 2) (t − 3)| / 24 for t from 0 to 2, times the fourth difference.
    const LARGEST: f64 = 1.0 / 24.0;
    LARGEST * (a + e - 4.0 * (b + d) + 6.0 * c).abs()
}

/// Puts the squares of all places but those of uneven segments between what is seen at every eighth.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2", "aarch64+neon"))]
fn interpolate(scene: &SceneRaster, squares: &mut Squares) {
    let Squares { first, down, across, gain, uneven, seen, .. } = squares;
    let FieldsAlong { tan_x, tan_y, irradiance_per_radiance } = seen;
    uneven.clear();
    let lanes = first.as_chunks_mut::<SEGMENT>().0.iter_mut().zip(down.as_chunks_mut::<SEGMENT>().0);
    let lanes = lanes.zip(across.as_chunks_mut::<SEGMENT>().0.iter_mut().zip(gain.as_chunks_mut::<SEGMENT>().0));
    for (segment, ((first, down), (across, gain))) in lanes.enumerate() {
        // What is seen from the ends, the middle and two places beyond; gains that are no numbers tell nothing.
        let ends = 2 * segment..2 * segment + N_LOOKED_UP;
        let (tan_x, tan_y) = (&tan_x[ends.clone()], &tan_y[ends.clone()]);
        let places: [[f64; 2]; N_LOOKED_UP] = std::array::from_fn(|i| scene.place_of(tan_x[i], tan_y[i]));
        let (rows, columns) = (places.map(|place| place[0]), places.map(|place| place[1]));
        let gains: [f64; N_LOOKED_UP] = irradiance_per_radiance[ends].try_into().expect("as many");
        let is_even = error_between(rows).max(error_between(columns)) <= LARGEST_ERROR
            && error_between(gains) <= LARGEST_GAIN_ERROR * gains[0]
            && rows[0].abs().max(columns[0].abs()) < FARTHEST;
        if !is_even {
            uneven.push(segment);
            continue;
        }
        // The place of each, from a sample above and to the left of all; beyond the edge of the scene, at the edge.
        let (row, column) = (Along::of(rows, scene.rows), Along::of(columns, scene.columns));
        let bright = Cubic::through(gains, 0.0);
        for k in 0..SEGMENT {
            let place = k as f32;
            let ((top, below, is_row), (left, beside, is_column)) = (row.at(place), column.at(place));
            first[k] = top as u32 * scene.columns as u32 + left as u32;
            (down[k], across[k]) = (below, beside);
            gain[k] = if is_row && is_column { bright.at(place) } else { 0.0 };
        }
    }
}

/// The rows or columns of the places of a segment.
struct Along {
    /// From a whole number on, somewhat below all.
    polynomial: Cubic,
    base: i32,
    /// The first and last row or column, and the last that has another after it, from there on.
    first: f32,
    last: f32,
    last_before: f32,
}

impl Along {
    #[inline(always)]
    fn of(places: [f64; N_LOOKED_UP], n: usize) -> Self {
        let [a, b, c, d, _] = places;
        // The polynomial goes less far beyond its ends and its middle than this.
        let beyond = 0.125 * (a - 2.0 * b + c).abs() + 0.1 * (d - a + 3.0 * (b - c)).abs();
        let base = (a.min(b).min(c) - beyond).floor();
        let from_base = |place: usize| (place as f64 - base) as f32;
        Self {
            polynomial: Cubic::through(places, base),
            base: base as i32,
            first: from_base(0),
            last: from_base(n - 1),
            last_before: from_base(n.saturating_sub(2)),
        }
    }

    /// Returns the row or column before a place, how far the place is from it, and whether it is within the scene.
    #[inline(always)]
    fn at(&self, place: f32) -> (i32, f32, bool) {
        let at = self.polynomial.at(place);
        let is_inside = at >= self.first - 0.5 && at <= self.last + 0.5;
        let at = if at < self.first { self.first } else { at };
        let at = if at > self.last { self.last } else { at };
        let before = if at > self.last_before { self.last_before } else { at }.floor();
        (self.base + whole(before), at - before, is_inside)
    }
}

/// Returns a whole number of magnitude below 2²², in operations that all vectors have: a saturating cast is none.
#[inline(always)]
fn whole(number: f32) -> i32 {
    /// Above it single precision has whole numbers alone, by their last bits.
    const OFFSET: f32 = 1.5 * (1 << 23) as f32;
    (number + OFFSET).to_bits() as i32 - OFFSET.to_bits() as i32
}

/// Puts the squares that are seen one by one into those of a segment.
#[multiversion(targets("x86_64+avx2", "aarch64+neon"))]
fn locate(scene: &SceneRaster, start: usize, squares: &mut Squares) {
    let Squares { first, down, across, gain, seen, .. } = squares;
    let (last_row, last_column) = ((scene.rows - 1) as f64, (scene.columns - 1) as f64);
    let (last_top, last_left) = (scene.rows.saturating_sub(2) as f64, scene.columns.saturating_sub(2) as f64);
    let fields = seen.tan_x.iter().zip(&seen.tan_y).zip(&seen.irradiance_per_radiance);
    let places = down[start..].iter_mut().zip(&mut across[start..]).zip(&mut gain[start..]);
    for (((&tan_x, &tan_y), &gain), (first, ((down, across), bright))) in
        fields.zip(first[start..].iter_mut().zip(places))
    {
        let [row, column] = scene.place_of(tan_x, tan_y);
        let is_inside = row >= -0.5 && column >= -0.5 && row <= last_row + 0.5 && column <= last_column + 0.5;
        let (row, column) = (row.clamp(0.0, last_row), column.clamp(0.0, last_column));
        let (top, left) = (row.min(last_top) as i32, column.min(last_left) as i32);
        (*down, *across) = ((row - f64::from(top)) as f32, (column - f64::from(left)) as f32);
        *first = if gain.is_nan() { UNSEEN } else { top as u32 * scene.columns as u32 + left as u32 };
        *bright = if is_inside && !gain.is_nan() { gain as f32 } else { 0.0 };
    }
}

/// Puts the light at each place between its four samples into `light`.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2", "aarch64+neon"))]
fn interpolate_light(squares: &Squares, (beside, below): (usize, usize), radiance: &[f32], light: &mut [f32]) {
    let lanes = squares.first.as_chunks::<SEGMENT>().0.iter().zip(light.as_chunks_mut::<SEGMENT>().0);
    let shares = squares.down.as_chunks::<SEGMENT>().0.iter().zip(squares.across.as_chunks::<SEGMENT>().0);
    for (((first, light), (down, across)), gain) in lanes.zip(shares).zip(squares.gain.as_chunks::<SEGMENT>().0) {
        let mut corners = [[0.0; SEGMENT]; 4];
        for k in 0..SEGMENT {
            let first = if first[k] == UNSEEN { 0 } else { first[k] as usize };
            let upper = &radiance[first..][..=beside];
            let lower = &radiance[first + below..][..=beside];
            (corners[0][k], corners[1][k]) = (upper[0], upper[beside]);
            (corners[2][k], corners[3][k]) = (lower[0], lower[beside]);
        }
        for k in 0..SEGMENT {
            let (down, across) = (down[k], across[k]);
            let mean = (1.0 - down) * (1.0 - across) * corners[0][k]
                + (1.0 - down) * across * corners[1][k]
                + down * (1.0 - across) * corners[2][k]
                + down * across * corners[3][k];
            light[k] = if gain[k] == 0.0 { 0.0 } else { mean * gain[k] };
        }
    }
}

#[cfg(test)]
mod tests {
    use dioptric_psf::RadialMap;

    use super::*;

    /// A lens of 10 mm with barrel distortion whose picture ends at a radius of 4 mm.
    fn map() -> FilmMap {
        let tan_at = |r: f64| (r <= 4.0).then_some(0.1 * r * (1.0 + 5e-4 * r * r));
        RadialMap::tabulate(6.0, tan_at, |tan| 0.2 / (1.0 + tan * tan).powi(2)).into()
    }

    /// Places over and beyond a scene of 400 × 600 samples and a lens: as they are found one by one, to the error allowed.
    #[test]
    fn places_between_are_those_of_the_map() {
        let view = View { focal_px: 1500.0, center_x_px: 299.5, center_y_px: 199.5 };
        let scene = SceneRaster { view, rows: 400, columns: 600 };
        let map = map();
        let (mut squares, mut alone) = (Squares::default(), Squares::default());
        let (mut n_between, mut n_unseen, mut n_dark) = (0, 0, 0);
        for (y_mm, n) in [(0.0, 1203), (1.1, 1200), (-1.33, 1), (2.7, 900), (3.999, 1000), (5.0, 40)] {
            let x_mm = |place: usize| 0.0083 * place as f64 - 4.6;
            squares.find(&scene, &map, n, (x_mm, y_mm));
            n_between += squares.first.len() / SEGMENT - squares.uneven.len();
            for place in 0..n {
                alone.find_each(&scene, &map, 1, (|_| x_mm(place), y_mm));
                n_unseen += usize::from(alone.first[0] == UNSEEN);
                n_dark += usize::from(alone.gain[0] == 0.0);
                assert_eq!(squares.first[place] == UNSEEN, alone.first[0] == UNSEEN, "{place} {y_mm}");
                if alone.first[0] == UNSEEN {
                    continue;
                }
                let at = |squares: &Squares, place: usize| {
                    let first = squares.first[place] as usize;
                    let (row, column) = ((first / scene.columns) as f32, (first % scene.columns) as f32);
                    [row + squares.down[place], column + squares.across[place]]
                };
                let (found, expected) = (at(&squares, place), at(&alone, 0));
                // Single precision of numbers up to 600 is 3e-5.
                let off = (found[0] - expected[0]).abs().max((found[1] - expected[1]).abs());
                assert!(off < 5e-6 + 7e-5, "{place} {y_mm}: {found:?} {expected:?}");
                assert!((squares.gain[place] - alone.gain[0]).abs() <= 3e-7 * alone.gain[0]);
            }
        }
        assert!(n_between > 100 && n_unseen > 100 && n_dark > n_unseen + 100, "{n_between} {n_unseen} {n_dark}");
    }

    /// Light that changes evenly over the scene is that at the place, wherever its square is.
    #[test]
    fn light_is_that_at_the_place() {
        for (rows, columns) in [(40, 60), (1, 60), (40, 1)] {
            let view = View { focal_px: 100.0, center_x_px: 0.0, center_y_px: 0.0 };
            let scene = SceneRaster { view, rows, columns };
            let radiance: Vec<f32> = (0..rows * columns)
                .map(|at| 1.0 + 0.5 * (at / columns) as f32 + 0.25 * (at % columns) as f32)
                .collect();
            let map = RadialMap::tabulate(20.0, |r| Some(0.1 * r), |_| 2.0).into();
            let (mut squares, mut light) = (Squares::default(), vec![]);
            let (y_mm, n) = (-0.123, 120);
            squares.find(&scene, &map, n, (|place| 0.05 * place as f64 - 0.2, y_mm));
            squares.light(&scene, &radiance, &mut light);
            assert!(squares.sees_any(n));
            for (place, light) in light.iter().take(n).enumerate() {
                let (row, column) = (1.23_f64, 0.5 * place as f64 - 2.0);
                let (last_row, last_column) = ((rows - 1) as f64, (columns - 1) as f64);
                let is_inside = row <= last_row + 0.5 && (-0.5..=last_column + 0.5).contains(&column);
                let inside = (row.min(last_row), column.clamp(0.0, last_column));
                let expected = if is_inside { 2.0 * (1.0 + 0.5 * inside.0 + 0.25 * inside.1) } else { 0.0 };
                assert!((f64::from(*light) - expected).abs() < 1e-4, "{rows} × {columns}: {place} {light} {expected}");
            }
        }
    }
}
