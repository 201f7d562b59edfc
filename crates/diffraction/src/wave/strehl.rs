//! The peak of a point spread function against that of a perfect lens.

use glam::DVec2;

use super::{PupilSamples, axis::SampleAxis, transform};
use crate::DiffractionError;

/// The peak of a point spread function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Where it is on the film, mm, lens frame.
    pub on_film_mm: DVec2,
    /// Its height over that of the same amplitudes all in phase: the Strehl ratio.
    pub strehl: f64,
}

/// Places to each side at which the peak is first looked for, at most.
const LARGEST_SEARCH: usize = 80;

impl PupilSamples {
    /// Returns the irradiance at a film point over that of the same amplitudes all in phase.
    pub fn strehl_at(&self, on_film_mm: DVec2) -> f64 {
        self.irradiance_per_mm2(on_film_mm) / self.perfect_peak_per_mm2()
    }

    /// Finds the highest point of the point spread function on the film, and the Strehl ratio there.
    ///
    /// It is looked for on a lattice of a quarter λN about the centroid, as far as rays go and one and a half λN more,
    /// or as far as the nodes resolve, and 20 λN at most; and then by parabolas to 1e-4 λN.
    ///
    /// # Errors
    /// When there are too few nodes even for one and a half λN.
    pub fn peak(&self) -> Result<Peak, DiffractionError> {
        let unit_mm = self.airy_unit_mm();
        let nodes = self.clone().about(self.centroid_mm());
        let spot_mm = nodes.q_x_mm.iter().zip(&nodes.q_y_mm).map(|(x, y)| x.hypot(*y)).fold(0.0, f64::max);
        let wanted = ((spot_mm / unit_mm + 1.5) * 4.0).ceil().min(LARGEST_SEARCH as f64) as usize;
        let extent_mm = |half: usize| (half as f64 + 0.5) * 0.25 * unit_mm * std::f64::consts::SQRT_2;
        let half = (6..=wanted).rev().find(|&half| nodes.check(extent_mm(half)).is_ok()).unwrap_or(6);
        nodes.check(extent_mm(half))?;
        let axis = SampleAxis::new(2 * half + 1, 0.25 * unit_mm, 1);
        let lattice = transform::mean_square(&nodes.plane_waves(DVec2::ZERO), &axis, &axis);
        let highest = lattice.indexed_iter().max_by(|a, b| a.1.total_cmp(b.1));
        let (row, column) = highest.map_or((half, half), |(place, _)| place);
        let place = |i: usize| (i as f64 - half as f64) * 0.25 * unit_mm;
        let on_film_mm = nodes.climb(nodes.reference_mm + DVec2::new(place(column), place(row)), unit_mm);
        Ok(Peak { on_film_mm, strehl: nodes.strehl_at(on_film_mm) })
    }

    /// Goes from a point near a summit to the summit.
    fn climb(&self, from_mm: DVec2, unit_mm: f64) -> DVec2 {
        let mut at = from_mm;
        let mut step = 0.125 * unit_mm;
        for _ in 0..8 {
            let here = self.irradiance_per_mm2(at);
            let offset = |direction: DVec2| {
                let (plus, minus) =
                    (self.irradiance_per_mm2(at + direction * step), self.irradiance_per_mm2(at - direction * step));
                let bend = plus - 2.0 * here + minus;
                let shift = if bend < 0.0 { 0.5 * (minus - plus) / bend } else { (plus - minus).signum() };
                direction * (shift.clamp(-1.0, 1.0) * step)
            };
            at += offset(DVec2::X) + offset(DVec2::Y);
            step *= 0.5;
        }
        at
    }
}
