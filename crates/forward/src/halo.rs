//! The light of a point that diffraction takes beyond the window of its kernel.
//!
//! A window holds all but a hundredth of the light of a point; the rest falls with the third power of the distance (`docs/forward.md`, 2). It is taken
//! from the finished picture of a band and spread on pixels 2, 4, 8 … times as wide, the farther the wider.

use std::{collections::BTreeMap, f64::consts::PI, ops::Range};

use dioptric_psf::{FilmQuery, Kernel, LensImage};
use glam::DVec2;
use multiversion::multiversion;
use ndarray::Array2;
use rayon::prelude::*;

use crate::{
    Film,
    layers::Layers,
    points::Point,
    surroundings::{Surroundings, beside},
};

/// Distance, in pixels of a raster, over which a halo passes to the next one of wider pixels.
const PASSES_OVER: [f64; 2] = [3.0, 4.5];
/// Distance at which the halo begins on the first raster, in its pixels, or more; where that is less than on the film's own, that is the first.
const FIRST: f64 = 1.25;
/// Points along each side of a pixel at which the halo is looked up.
pub(crate) const POINTS: usize = 8;
/// Pixels beside the middle that the halo of one raster reaches.
const REACH: usize = 5;

/// What lies beyond the windows of kernels in a band.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Beyond {
    /// Share of the light.
    pub(crate) share: f64,
    /// The radii between which the samples of the window fade out, pixels.
    fade_px: [f64; 2],
    /// The part of the share that falls faster than what edges bend.
    steep: f64,
    /// λN, pixels.
    pub(crate) lambda_n_px: f64,
}

impl Beyond {
    /// Of the sharpest layer, on the axis. Where windows are wider, off the axis or out of focus, halos are the same from some distance on.
    fn of(lens: &dyn LensImage, layers: &Layers, (wavelength_nm, pitch_um): (f64, f64), widest_px: f64) -> Self {
        let radius_px = |layer: &usize| layers.radius_px_at(*layer as f32);
        let sharpest = (0..layers.len()).min_by(|a, b| radius_px(a).total_cmp(&radius_px(b))).unwrap_or(0);
        let factor = (radius_px(&sharpest) / widest_px).log2().ceil().max(0.0).exp2();
        let dioptres = layers.dioptres()[sharpest];
        let query = FilmQuery { place_mm: DVec2::ZERO, dioptres, wavelength_nm, pitch_um: factor * pitch_um };
        let kernel = lens.kernel(query);
        if kernel.lambda_n_px == 0.0 {
            // It holds all that there is, whatever it is scaled by.
            return Self { fade_px: [factor; 2], ..Self::default() };
        }
        let fade_px = kernel.fade_px().map(|px| px.max(LEAST_RADIUS));
        let share = 1.0 - kernel.kept_share;
        // An edge bends 2 / π² λN over its radius beyond a circle.
        let bent = 2.0 / (PI * PI) * kernel.lambda_n_px * Fade(fade_px).inverse();
        Self {
            share,
            fade_px: fade_px.map(|px| factor * px),
            steep: (1.0 - bent / share).clamp(0.0, 1.0),
            lambda_n_px: factor * kernel.lambda_n_px,
        }
    }

    /// Returns a share of the light that begins at a distance, pixels, all of it bent by edges.
    #[cfg(test)]
    pub(crate) fn from_step(share: f64, start_px: f64, lambda_n_px: f64) -> Self {
        Self { share, fade_px: [start_px; 2], steep: 0.0, lambda_n_px }
    }

    /// Returns what lies beyond between two bands: share times distance, which stands for the halo far out, and the window are linear there.
    fn between(below: Self, above: Self, fraction: f64) -> Self {
        let mix = |below: f64, above: f64| below + fraction * (above - below);
        let fade_px = [0, 1].map(|end| mix(below.fade_px[end], above.fade_px[end]));
        let far = |beyond: &Self| beyond.share / Fade(beyond.fade_px).inverse();
        let share = mix(far(&below), far(&above)) * Fade(fade_px).inverse();
        let (steep, lambda_n_px) = (mix(below.steep, above.steep), mix(below.lambda_n_px, above.lambda_n_px));
        Self { share, fade_px, steep, lambda_n_px }
    }

    /// Returns the light of a point of light 1 that lies at a distance from it, for a pixel of the film, were the pupil round and nothing else seen.
    pub(crate) fn density(&self) -> impl Fn(f64) -> f64 + use<> {
        let (fade, steep) = (Fade(self.fade_px), self.steep);
        let (bent, steep) = ((1.0 - steep) / (2.0 * PI * fade.inverse()), steep / (2.0 * PI * fade.inverse_cube()));
        move |r: f64| {
            let part = fade.at(r);
            if part > 0.0 { part * (bent * r.powi(-3) + steep * r.powi(-5)) } else { 0.0 }
        }
    }
}

/// The least radius at which a window may begin to fade, pixels: the law of the tail has no middle.
const LEAST_RADIUS: f64 = 0.5;

/// A linear rise from 0 to 1 between two radii: what windows leave to the halo.
#[derive(Clone, Copy)]
struct Fade([f64; 2]);

impl Fade {
    fn at(self, radius: f64) -> f64 {
        let Self([start, end]) = self;
        if end > start { ((radius - start) / (end - start)).clamp(0.0, 1.0) } else { f64::from(radius >= end) }
    }

    /// The integral of the rise over r² by r: 1 / r of a step.
    fn inverse(self) -> f64 {
        let Self([start, end]) = self;
        if end > start * 1.0001 { (end / start).ln() / (end - start) } else { 1.0 / end }
    }

    /// The integral of the rise over r⁴ by r: 1 / 3 r³ of a step.
    fn inverse_cube(self) -> f64 {
        let Self([start, end]) = self;
        if end > start * 1.0001 {
            let (square, cube) = (start.powi(-2) - end.powi(-2), start.powi(-3) - end.powi(-3));
            (0.5 * square - start * cube / 3.0) / (end - start) + end.powi(-3) / 3.0
        } else {
            end.powi(-3) / 3.0
        }
    }
}

/// The halos of the bands of a plan.
#[derive(Debug)]
pub(crate) struct Halos {
    /// None where no light lies beyond the windows.
    of_bands: Vec<Option<Halo>>,
}

impl Halos {
    /// Returns the halos of so many bands on a film. Windows are looked up in some of them, of given wavelengths, the first and the last among them, and lie
    /// between two of those in the others.
    pub(crate) fn of(
        (lens, layers): (&dyn LensImage, &Layers),
        (film, widest_px): (&Film, f64),
        looked_up: &[(usize, f64)],
        n_bands: usize,
    ) -> Self {
        let of = |&(band, wavelength_nm): &(usize, f64)| {
            (band, Beyond::of(lens, layers, (wavelength_nm, film.pitch_um), widest_px))
        };
        let known: BTreeMap<usize, Beyond> = looked_up.par_iter().map(of).collect();
        let halo = |band: usize| {
            let ((lower, below), (upper, above)) = (known.range(..=band).next_back()?, known.range(band..).next()?);
            let fraction = (band - lower) as f64 / (upper - lower).max(1) as f64;
            let beyond = Beyond::between(*below, *above, fraction);
            let (rows, columns) = (film.rows + 2 * beside(film), film.columns + 2 * beside(film));
            (beyond.share > Kernel::NEGLIGIBLE).then(|| Halo::new(beyond, (rows, columns)))
        };
        Self { of_bands: (0..n_bands).into_par_iter().map(halo).collect() }
    }

    /// Whether light lies beyond the windows of any band.
    pub(crate) fn are_any(&self) -> bool {
        self.of_bands.iter().any(Option::is_some)
    }

    /// Returns what lies beyond the windows of a band, if any does.
    pub(crate) fn beyond(&self, band: usize) -> Option<&Beyond> {
        self.of_bands.get(band)?.as_ref().map(|halo| &halo.beyond)
    }

    /// Returns the picture of a band with the halos of its points and of what lies around it, if any light lies beyond its windows.
    pub(crate) fn applied(
        &self,
        band: usize,
        picture: Array2<f32>,
        (surroundings, radiance, points): (&Surroundings<'_>, &[f32], &[Point]),
    ) -> Array2<f32> {
        match self.of_bands.get(band) {
            Some(Some(halo)) => {
                surroundings.with(&picture, (radiance, points), |wide, beside| halo.applied(wide, beside))
            }
            _ => picture,
        }
    }
}

/// The halo around each point of a band: parts of it on rasters of pixels 2, 4, 8 … times as wide as the film's, of sum 1.
#[derive(Debug)]
struct Halo {
    beyond: Beyond,
    /// How many times pixels are doubled before the first raster.
    n_doublings: usize,
    rasters: Vec<RasterPart>,
}

/// The part of a halo on one raster: of each pixel from the middle, to the right and down.
#[derive(Debug)]
struct RasterPart([[f32; REACH + 1]; REACH + 1]);

impl Halo {
    fn new(beyond: Beyond, (rows, columns): (usize, usize)) -> Self {
        let n_doublings = (beyond.fade_px[0] / FIRST).log2().floor().max(0.0) as usize;
        let n_rasters = f64::hypot(rows as f64, columns as f64).log2().ceil().max(0.0) as usize + 1;
        let part = |doublings: usize| RasterPart::new(beyond, doublings, doublings == n_doublings);
        let rasters = (n_doublings..n_rasters.max(n_doublings + 1)).map(part).collect();
        Self { beyond, n_doublings, rasters }
    }

    /// Takes from each pixel of a picture what its halo takes to others, and adds that to them.
    ///
    /// With T the halo of a point, E + T ⊗ E − E (T ⊗ 1): the sum of the picture is kept, and an even one stays even, for beyond its edges it counts as even.
    ///
    /// What lies less than `beside` pixels from its edges is not wanted.
    fn applied(&self, mut picture: Array2<f32>, beside: usize) -> Array2<f32> {
        let (rows, columns) = picture.dim();
        let wanted = beside..rows - beside;
        let (brought, landing) = (self.of(&picture, &wanted), self.of_ones((rows, columns), beside));
        let share = self.beyond.share as f32;
        for (row, mut line) in picture.rows_mut().into_iter().enumerate().filter(|(row, _)| wanted.contains(row)) {
            let came = self.on_film(&brought, row, columns);
            let went = self.on_film(&landing, row, columns);
            for ((light, came), went) in line.iter_mut().zip(came).zip(went) {
                // Where rasters are sharpened to make up for their blur, next to a bright point, less than nothing may come.
                *light = (*light + share * (came - *light * went)).max(0.0);
            }
        }
        picture
    }

    /// Returns how much of the halo of each pixel lands on a picture of so many rows and columns, on pixels as [`of`](Self::of) has them: right where pixels lie
    /// `beside` its edges or more.
    fn of_ones(&self, (rows, columns): (usize, usize), beside: usize) -> Array2<f32> {
        // Ones on ever wider pixels are products of lines.
        let mut lines = vec![[vec![1.0; rows], vec![1.0; columns]]];
        for doublings in 1..self.n_doublings + self.rasters.len() {
            lines.push([0, 1].map(|way| halved_line(&lines[doublings - 1][way])));
        }
        // What lands through rasters that reach no edge is all of it: their parts, and the splines to them.
        let reaches_edge = |raster: usize| (REACH + 3) << (self.n_doublings + raster) > beside;
        let outer = (0..self.rasters.len()).find(|raster| reaches_edge(*raster)).unwrap_or(self.rasters.len() - 1);
        let [down, across] = &lines[self.n_doublings + outer];
        let ones = Array2::from_shape_fn((down.len(), across.len()), |(row, column)| down[row] * across[column]);
        let mut landing = on_rasters(&ones, &self.rasters[outer..], &(0..ones.nrows()));
        for doublings in (self.n_doublings.min(1)..self.n_doublings + outer).rev() {
            let [down, across] = &lines[doublings];
            landing = doubled(&landing, (down.len(), across.len()));
            if let Some(raster) = doublings.checked_sub(self.n_doublings) {
                landing += self.rasters[raster].total();
            }
        }
        landing
    }

    /// Returns what halos bring to the pixels of some rows of a picture, on its own or, to all, on pixels twice as wide: see [`on_film`](Self::on_film).
    fn of(&self, picture: &Array2<f32>, wanted: &Range<usize>) -> Array2<f32> {
        match self.n_doublings {
            0 => on_rasters(picture, &self.rasters, wanted),
            n => self.by_doublings(&halved(picture), n - 1),
        }
    }

    fn by_doublings(&self, picture: &Array2<f32>, n_doublings: usize) -> Array2<f32> {
        match n_doublings {
            0 => on_rasters(picture, &self.rasters, &(0..picture.nrows())),
            n => doubled(&self.by_doublings(&halved(picture), n - 1), picture.dim()),
        }
    }

    /// Returns a row of the film of what halos bring.
    fn on_film(&self, brought: &Array2<f32>, row: usize, columns: usize) -> Vec<f32> {
        match self.n_doublings {
            0 => brought.row(row).to_vec(),
            _ => doubled_row(brought, row, columns),
        }
    }
}

/// Returns what the parts of a halo on a raster and wider ones bring to each pixel of some rows of a picture on the first.
fn on_rasters(picture: &Array2<f32>, rasters: &[RasterPart], wanted: &Range<usize>) -> Array2<f32> {
    let [part, wider @ ..] = rasters else { return Array2::zeros(picture.dim()) };
    let mut brought = part.of(picture, wanted);
    if !wider.is_empty() {
        let means = halved(picture);
        let from_farther = on_rasters(&means, wider, &(0..means.nrows()));
        for (row, mut line) in brought.rows_mut().into_iter().enumerate().filter(|(row, _)| wanted.contains(row)) {
            let more = doubled_row(&from_farther, row, line.len());
            line.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
        }
    }
    brought
}

impl RasterPart {
    /// Returns the part of the halo beyond a window on pixels that are doubled so many times.
    fn new(beyond: Beyond, doublings: usize, is_first: bool) -> Self {
        let pixel = (doublings as f64).exp2();
        // Of sum 1.
        let density = beyond.density();
        let passed = |r_pixels: f64| {
            let [start, end] = PASSES_OVER;
            ((r_pixels - start) / (end - start)).clamp(0.0, 1.0)
        };
        let share = |r: f64| (if is_first { 1.0 } else { passed(2.0 * r) }) - passed(r);
        let at = |pixel_at: usize, point: usize| pixel_at as f64 + (point as f64 + 0.5) / POINTS as f64 - 0.5;
        let energy = |right: usize, down: usize| {
            let points = (0..POINTS * POINTS).map(|i| (at(right, i % POINTS).abs(), at(down, i / POINTS).abs()));
            let energies = points.map(|(x, y)| share(x.hypot(y)) * density(pixel * x.hypot(y)));
            energies.sum::<f64>() * (pixel / POINTS as f64).powi(2)
        };
        let raw: [[f64; REACH + 2]; REACH + 2] =
            std::array::from_fn(|down| std::array::from_fn(|right| energy(right, down)));
        // Less half the variance of the blur times the second differences, so that it is blurred back to what it is: of splines to wider pixels and back, and of pixels between.
        let blur = 2.0 * 0.25 + 1.0 / 12.0;
        let sharp = |right: usize, down: usize| {
            let beside = raw[down][right.abs_diff(1)]
                + raw[down][right + 1]
                + raw[down.abs_diff(1)][right]
                + raw[down + 1][right];
            raw[down][right] + 0.5 * blur * (4.0 * raw[down][right] - beside)
        };
        Self(std::array::from_fn(|down| std::array::from_fn(|right| sharp(right, down) as f32)))
    }

    /// What lands of a pixel's part, near and far.
    fn total(&self) -> f32 {
        let times = |pixels: usize| if pixels == 0 { 1.0 } else { 2.0 };
        let line = |energies: &[f32; REACH + 1]| -> f32 {
            energies.iter().enumerate().map(|(right, energy)| times(right) * energy).sum()
        };
        self.0.iter().enumerate().map(|(down, energies)| times(down) * line(energies)).sum()
    }

    /// Returns what it brings to each pixel of some rows of a picture.
    fn of(&self, picture: &Array2<f32>, wanted: &Range<usize>) -> Array2<f32> {
        let (rows, columns) = picture.dim();
        let mut spread = vec![0.0; rows * columns];
        let line_at = |row: isize| {
            let row = usize::try_from(row).ok().filter(|row| *row < rows);
            row.and_then(|row| picture.as_slice().map(|values| &values[row * columns..][..columns]))
        };
        let mut padded = vec![0.0; columns + 2 * REACH];
        for (row, sums) in
            (0..).zip(spread.chunks_exact_mut(columns)).filter(|(row, _)| wanted.contains(&(*row as usize)))
        {
            for (down, energies) in (0..).zip(&self.0) {
                // Rows above and below have the same energies.
                padded[REACH..][..columns].fill(0.0);
                let above = if down == 0 { None } else { line_at(row - down) };
                for line in above.into_iter().chain(line_at(row + down)) {
                    padded[REACH..].iter_mut().zip(line).for_each(|(sum, light)| *sum += light);
                }
                add_line(energies, &padded, sums);
            }
        }
        Array2::from_shape_vec((rows, columns), spread).expect("it has a value for each pixel")
    }
}

/// Adds a line with a margin, spread to both sides.
#[multiversion(targets("x86_64+avx2", "aarch64+neon"))]
fn add_line(energies: &[f32; REACH + 1], padded: &[f32], sums: &mut [f32]) {
    sums.iter_mut().zip(&padded[REACH..]).for_each(|(sum, light)| *sum += energies[0] * light);
    for (right, energy) in (1..).zip(&energies[1..]) {
        let pairs = padded[REACH - right..].iter().zip(&padded[REACH + right..]);
        sums.iter_mut().zip(pairs).for_each(|(sum, (left, right))| *sum += energy * (left + right));
    }
}

/// Pixels beyond the edges that a raster of wider pixels has.
const MARGIN: usize = 1;

/// Returns the number of pixels twice as wide that cover some, with their margin.
fn n_halved(n: usize) -> usize {
    n.div_ceil(2) + 2 * MARGIN
}

/// Returns the means of a picture over pixels twice as wide, by quadratic splines, with a margin: ⅛, ⅜, ⅜, ⅛ each way.
fn halved(picture: &Array2<f32>) -> Array2<f32> {
    let (rows, columns) = picture.dim();
    let (n_rows, n_columns) = (n_halved(rows), n_halved(columns));
    let mut means = Array2::zeros((n_rows, n_columns));
    let mut down = vec![0.0; 2 * n_columns + 2];
    for (row, mut means) in means.rows_mut().into_iter().enumerate() {
        // Pixel i of these has the pixels 2 (i − 1) and the next one in it.
        down.fill(0.0);
        for (k, weight) in WEIGHTS.into_iter().enumerate() {
            let line = (2 * row + k).checked_sub(3).filter(|row| *row < rows);
            let line = line.and_then(|row| picture.as_slice().map(|values| &values[row * columns..][..columns]));
            if let Some(line) = line {
                down[3..].iter_mut().zip(line).for_each(|(sum, light)| *sum += weight * light);
            }
        }
        for (mean, four) in means.iter_mut().zip(down.windows(4).step_by(2)) {
            *mean = WEIGHTS[0] * (four[0] + four[3]) + WEIGHTS[1] * (four[1] + four[2]);
        }
    }
    means
}

/// Returns the means of a line, as [`halved`] has them.
fn halved_line(line: &[f32]) -> Vec<f32> {
    let mean = |i: usize| {
        let pixels = WEIGHTS.iter().enumerate();
        pixels.filter_map(|(k, weight)| Some(weight * line.get((2 * i + k).checked_sub(3)?)?)).sum()
    };
    (0..n_halved(line.len())).map(mean).collect()
}

const WEIGHTS: [f32; 4] = [0.125, 0.375, 0.375, 0.125];

/// Returns a plane on pixels half as wide, by quadratic splines: ¾ of the wider pixel and ¼ of the next, each way.
fn doubled(plane: &Array2<f32>, (rows, columns): (usize, usize)) -> Array2<f32> {
    let values = (0..rows).flat_map(|row| doubled_row(plane, row, columns)).collect();
    Array2::from_shape_vec((rows, columns), values).expect("it has a value for each pixel")
}

fn doubled_row(plane: &Array2<f32>, row: usize, columns: usize) -> Vec<f32> {
    let own = row / 2 + MARGIN;
    let next = if row.is_multiple_of(2) { own - 1 } else { own + 1 };
    let mut line = Vec::with_capacity(plane.ncols());
    line.extend(plane.row(own).iter().zip(plane.row(next)).map(|(own, next)| 0.75 * own + 0.25 * next));
    let mut doubled = vec![0.0; 2 * columns.div_ceil(2)];
    for (two, three) in doubled.as_chunks_mut::<2>().0.iter_mut().zip(line.windows(3)) {
        *two = [0.75 * three[1] + 0.25 * three[0], 0.75 * three[1] + 0.25 * three[2]];
    }
    doubled.truncate(columns);
    doubled
}

#[cfg(test)]
mod tests {
    use super::*;

    fn halo(half_px: f64, share: f64, size: (usize, usize)) -> Halo {
        Halo::new(Beyond::from_step(share, half_px, 0.0), size)
    }

    #[test]
    fn even_pictures_stay_even_and_sums_are_kept() {
        for (half_px, size) in [(0.5, (33, 70)), (2.5, (64, 48)), (5.5, (101, 90)), (23.5, (40, 61)), (200.5, (7, 1))] {
            let halo = halo(half_px, 0.02, size);
            for light in halo.applied(Array2::from_elem(size, 3.0), 0) {
                assert!((light - 3.0).abs() < 1e-6, "{half_px}: {light}");
            }
            let uneven = Array2::from_shape_fn(size, |(row, column)| ((row * 7 + column * 13) % 11) as f32);
            let (before, after) = (uneven.sum(), halo.applied(uneven, 0).sum());
            assert!((after / before - 1.0).abs() < 1e-5, "{half_px}: {before} {after}");
        }
    }

    /// Beside the edges by more than rasters reach, what lands is found without them.
    #[test]
    fn what_lands_is_all_where_no_edge_is_near() {
        for half_px in [0.5, 2.5, 5.5, 23.5] {
            let halo = halo(half_px, 0.02, (300, 260));
            let (beside, whole) = (100, halo.of_ones((300, 260), 0));
            for ((row, column), landing) in halo.of_ones((300, 260), beside).indexed_iter() {
                let wide = if halo.n_doublings == 0 { 1 } else { 2 };
                let is_inner = |at: usize, n: usize| (beside + 4..n - beside - 4).contains(&(wide * at));
                if is_inner(row, 300) && is_inner(column, 260) {
                    assert!((landing - whole[(row, column)]).abs() < 2e-6, "{half_px} {row} {column}: {landing}");
                }
            }
        }
    }

    /// Beyond the radius h lies 1, and h / r beyond another.
    #[test]
    fn a_halo_falls_with_the_third_power_of_the_distance() {
        let (n, share) = (801, 0.5);
        for half_px in [0.5, 1.5, 2.5, 4.5, 9.5, 14.5] {
            let halo = halo(half_px, share, (n, n));
            // Wherever the point lies among the pixels of wider rasters.
            for at in [(400, 400), (403, 398), (397, 401)] {
                let mut point = Array2::zeros((n, n));
                point[at] = 1.0;
                let picture = halo.applied(point, 0);
                let from_point = |row: usize, column: usize| {
                    DVec2::new(column as f64 - at.1 as f64, row as f64 - at.0 as f64).length()
                };
                let beyond = |r: f64| share * half_px / r;
                for r in [2.0, 3.0, 5.0, 10.0].map(|times| times * half_px).into_iter().filter(|r| *r > 4.0) {
                    let lights = picture.indexed_iter();
                    let between = lights.filter(|((row, column), _)| (r..395.0).contains(&from_point(*row, *column)));
                    let sum: f64 = between.map(|(_, light)| f64::from(*light)).sum();
                    let ratio = sum / (beyond(r) - beyond(395.0));
                    assert!((0.92..1.12).contains(&ratio), "{half_px} {at:?}, beyond {r}: {ratio}");
                }
                // Single pixels of a ring: parts of the halo are shares of wide pixels.
                for r in [3.0, 5.0, 7.0, 10.0].map(|times| times * half_px).into_iter().filter(|r| *r > 7.0) {
                    let on_ring = (0..63).map(|i| DVec2::from_angle(0.1 * f64::from(i)) * r);
                    for place in on_ring {
                        let pixel =
                            ((at.0 as f64 + place.y).round() as usize, (at.1 as f64 + place.x).round() as usize);
                        let law = share * half_px / (2.0 * PI) / from_point(pixel.0, pixel.1).powi(3);
                        let ratio = f64::from(picture[pixel]) / law;
                        assert!((0.63..1.35).contains(&ratio), "{half_px} {at:?}, at {place}: {ratio}");
                    }
                }
            }
        }
    }
}
