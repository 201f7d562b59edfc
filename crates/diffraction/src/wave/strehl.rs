//! The peak of a point spread function against that of a perfect lens.

use dioptric_optics::{MonoLens, ObjectPoint};
use glam::DVec2;

use super::{
    PupilGrid, PupilSamples, WavePsf, WaveWindow, WindowCenter,
    transform::{Irradiance, PlaneWaves},
};
use crate::DiffractionError;

/// The peak of a point spread function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Where it is on the film, mm, lens frame.
    pub on_film_mm: DVec2,
    /// Its height over that of the same amplitudes all in phase: the Strehl ratio.
    pub strehl: f64,
}

/// Side of the pixels among which the highest is looked for, in λN: a peak is some two of them wide.
const SEARCH_PIXEL: f64 = 0.4;
/// Pixels along the side of a window of the search, at most: with those of the largest range of phases a sum takes less memory than the nodes
/// do, and four windows hold any blur.
const SEARCH_SIDE: usize = 1536;
/// How far beyond the rays the peak is looked for, in λN.
const BESIDE_RAYS: f64 = 1.5;
/// How many of the highest summits among the pixels the way up is gone from, and how far below the highest pixel they may be: as
/// much as a peak that lies between pixels loses.
const SUMMITS: usize = 3;
const LOWEST_SUMMIT: f64 = 0.7;
/// The largest range of phases that is accepted: some two million nodes, 450 MB while they are traced.
const LARGEST_BANDWIDTH: f64 = 3400.0;
/// By how much finer than the one before a grid of nodes is at most: its outermost nodes then lie within 2e-4 of the radius from the edge.
const MOST_FINER: f64 = 8.0;
/// Steps of the way up, at most, and the last one that is gone, in λN.
const MOST_STEPS: usize = 12;
const LAST_STEP: f64 = 1e-5;

impl PupilSamples {
    /// Returns the irradiance at a film point over that of the same amplitudes all in phase.
    pub fn strehl_at(&self, on_film_mm: DVec2) -> f64 {
        self.irradiance_per_mm2(on_film_mm) / self.perfect_peak_per_mm2()
    }

    /// Returns how far from the centroid the peak may be, mm: as far as the farthest ray and a little more.
    fn search_reach_mm(&self) -> f64 {
        self.spot_mm() + BESIDE_RAYS * self.airy_unit_mm()
    }

    /// Returns windows of one size that cover the rectangle about all rays and a little more: the peak is in one of them.
    fn search_windows(&self) -> Vec<WaveWindow> {
        let (unit_mm, pitch_mm) = (self.airy_unit_mm(), SEARCH_PIXEL * self.airy_unit_mm());
        // The middle and the side of the rectangle, and the numbers of windows and of pixels of each, along an axis.
        let along = |q_mm: &[f64]| {
            let ends = q_mm.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), q| (a.min(*q), b.max(*q)));
            let side_mm = ends.1 - ends.0 + 2.0 * BESIDE_RAYS * unit_mm;
            let n_pixels = (side_mm / pitch_mm).ceil().max(1.0) as usize;
            let n_windows = n_pixels.div_ceil(SEARCH_SIDE);
            (0.5 * (ends.0 + ends.1), n_windows, n_pixels.div_ceil(n_windows))
        };
        let ((x_mm, n_x, columns), (y_mm, n_y, rows)) = (along(&self.q_x_mm), along(&self.q_y_mm));
        let middle_mm = self.reference_mm + DVec2::new(x_mm, y_mm);
        let size_mm = DVec2::new(columns as f64, rows as f64) * pitch_mm;
        let place = |i: usize, n: usize| i as f64 - 0.5 * (n as f64 - 1.0);
        let window = |i: usize| {
            let center = WindowCenter::At(middle_mm + DVec2::new(place(i % n_x, n_x), place(i / n_x, n_y)) * size_mm);
            WaveWindow { pitch_um: 1e3 * pitch_mm, rows, columns, center }
        };
        (0..n_x * n_y).map(window).collect()
    }

    /// Finds the highest point of the point spread function on the film, and the Strehl ratio there.
    ///
    /// It is looked for among pixels as far as rays go and a little more, and from the highest of them by Newton's steps to 1e-5 λN.
    ///
    /// # Errors
    /// When there are too few nodes for a window of that size.
    pub fn peak(&self) -> Result<Peak, DiffractionError> {
        let (unit_mm, reach_mm, centroid_mm) = (self.airy_unit_mm(), self.search_reach_mm(), self.centroid_mm());
        let bandwidth = self.check(reach_mm - self.reference_mm.distance(centroid_mm))?;
        let mut summits: Vec<(DVec2, f64)> = vec![];
        for window in self.search_windows() {
            // Beyond the reach, at corners, the nodes are too few.
            let psf = self.psf_about(window.center.on_film_mm(|| centroid_mm), &window, None, bandwidth)?;
            summits.extend(summits_of(&psf, |at_mm| at_mm.distance(centroid_mm) <= reach_mm));
            summits.sort_unstable_by(|a, b| b.1.total_cmp(&a.1));
            summits.truncate(SUMMITS);
        }
        let waves = self.plane_waves(DVec2::ZERO);
        let summit = |&(at_mm, _): &(DVec2, f64)| {
            let (from_reference_mm, irradiance) = climb(&waves, at_mm - self.reference_mm, unit_mm);
            Peak { on_film_mm: self.reference_mm + from_reference_mm, strehl: irradiance / self.perfect_peak_per_mm2() }
        };
        Ok(summits
            .iter()
            .map(summit)
            .max_by(|a, b| a.strehl.total_cmp(&b.strehl))
            .expect("a window has at least one pixel"))
    }

    /// Finds the peak of a point on the film, `film_distance_mm` behind the last vertex, with as many nodes as its blur needs.
    ///
    /// # Errors
    /// When no light gets through, rays within the pupil are lost, or the blur needs more nodes than a wave sum can have.
    pub fn peak_of(lens: &MonoLens, point: &ObjectPoint, film_distance_mm: f64) -> Result<Peak, DiffractionError> {
        let mut nodes = Self::trace(lens, point, film_distance_mm, PupilGrid::STANDARD, None)?;
        loop {
            match nodes.finer_grid(nodes.search_reach_mm(), LARGEST_BANDWIDTH)? {
                // Where a grid is far finer, one between shows the edge first, so that a large one need not be laid twice.
                // Of a far finer grid one between shows the edge of the pupil first, so that it is laid once.
                Some(grid) => {
                    let grid = grid.min(nodes.grid.scaled(MOST_FINER));
                    nodes = Self::trace(lens, point, film_distance_mm, grid, None)?;
                }
                None => return nodes.peak(),
            }
        }
    }
}

/// Returns the pixels within reach that are higher than their neighbors, with the height of a parabola through these.
fn summits_of(psf: &WavePsf, is_within_reach: impl Fn(DVec2) -> bool) -> Vec<(DVec2, f64)> {
    let samples = &psf.samples;
    let is_within_reach = |(row, column)| is_within_reach(psf.pixel_mm(row, column));
    let within_reach = samples.indexed_iter().filter(|(pixel, _)| is_within_reach(*pixel));
    let highest = within_reach.map(|(_, here)| *here).fold(0.0, f64::max);
    let summit = |((row, column), here): ((usize, usize), &f64)| {
        if *here < LOWEST_SUMMIT * highest || !is_within_reach((row, column)) {
            return None;
        }
        // What lies beyond the border is taken as what mirrors it.
        let at = |row: Option<usize>, column: Option<usize>| row.zip(column).and_then(|at| samples.get(at)).copied();
        let across = [at(Some(row), column.checked_sub(1)), at(Some(row), Some(column + 1))];
        let down = [at(row.checked_sub(1), Some(column)), at(Some(row + 1), Some(column))];
        let mut height = *here;
        for [before, after] in [across, down] {
            let (before, after) = (before.or(after).unwrap_or(0.0), after.or(before).unwrap_or(0.0));
            if before.max(after) > *here {
                return None;
            }
            let bend = 2.0 * here - before - after;
            height += if bend > 0.0 { (after - before).powi(2) / (8.0 * bend) } else { 0.0 };
        }
        Some((psf.pixel_mm(row, column), height))
    };
    samples.indexed_iter().filter_map(summit).collect()
}

/// Goes from a point near a summit, mm from the reference, to the summit, and returns the irradiance there.
fn climb(waves: &PlaneWaves, from_mm: DVec2, unit_mm: f64) -> (DVec2, f64) {
    let mut best = (from_mm, waves.irradiance_at(from_mm));
    let mut most_mm = 0.25 * unit_mm;
    for _ in 0..MOST_STEPS {
        let (at_mm, Irradiance { value, slope, bend }) = best.clone();
        // Newton's step where the irradiance bends down all ways, and elsewhere one straight up.
        let is_hill = bend.x_axis.x < 0.0 && bend.determinant() > 0.0;
        let step_mm = if is_hill { -(bend.inverse() * slope) } else { slope.normalize_or_zero() * most_mm };
        let step_mm = step_mm.clamp_length_max(most_mm);
        if step_mm.length() < LAST_STEP * unit_mm {
            break;
        }
        let next = waves.irradiance_at(at_mm + step_mm);
        if next.value >= value {
            best = (at_mm + step_mm, next);
        } else {
            most_mm = 0.5 * step_mm.length();
        }
    }
    (best.0, best.1.value)
}
