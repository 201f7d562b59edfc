//! The film of a lens that has an axis of symmetry but for the blades of its iris: the share of its light over that through a round stop.
//!
//! Points of the film look where they do through the circle of as much area, along a radius; only how much light they get differs, where
//! rims cut the opening. Turned by a blade the film is the same, so that one sector tells all.

use std::f64::consts::TAU;

use glam::DVec2;
use rayon::prelude::*;

use crate::{
    film_map::ShareMap,
    lattice::{AREA_OVER_RADIUS, DIM, Lattice, MOST_AREA_HALVINGS, MOST_OFF_SR, N_AZIMUTHS},
    mesh::Mesh,
    pupil::Outline,
    pupil_division::PupilDivision,
    station::{Station, SurveyedLens},
};

/// How many of the azimuths that are looked at lie in a sector, at least and at most.
const N_OF_SECTOR: (usize, usize) = (2, 8);

/// Stations of one sector: at radii, each at azimuths evenly from +x on.
#[derive(Debug)]
pub(crate) struct BladedSurvey {
    n_blades: usize,
    n_of_sector: usize,
    rings: Vec<Ring>,
}

/// Stations at a radius, and their irradiances over that of the round lens.
#[derive(Debug)]
struct Ring {
    radius_mm: f64,
    stations: Vec<Station>,
    shares: Vec<f64>,
}

impl BladedSurvey {
    /// Surveys the film; `round_sr` has the irradiances of the round lens, by the distance from the axis.
    pub(crate) fn new(
        lens: &SurveyedLens<'_>,
        n_blades: usize,
        lattice: Lattice,
        round_sr: &(dyn Fn(f64) -> f64 + Sync),
    ) -> Self {
        let n_of_sector = N_AZIMUTHS.div_ceil(n_blades).clamp(N_OF_SECTOR.0, N_OF_SECTOR.1);
        let mut survey = Self { n_blades, n_of_sector, rings: Vec::new() };
        let middle = lens.station(DVec2::ZERO, None);
        let even = (0..=lattice.n_steps).map(|i| lattice.step_mm * i as f64).collect::<Vec<_>>();
        let seeds = vec![middle.outline(); n_of_sector];
        survey.rings = even.iter().map(|&radius_mm| survey.ring(lens, radius_mm, &seeds, round_sr)).collect();
        let largest_sr = survey.rings.iter().map(|ring| round_sr(ring.radius_mm)).fold(0.0, f64::max);
        survey.settle_darkness(largest_sr, round_sr);
        // Halve the intervals whose middle was not foreseen.
        let mut open: Vec<f64> = even[..lattice.n_steps].to_vec();
        for _ in 0..MOST_AREA_HALVINGS {
            let mut next = Vec::new();
            for from_mm in std::mem::take(&mut open) {
                let below = survey.rings.partition_point(|ring| ring.radius_mm <= from_mm) - 1;
                let [low, high] = [below, below + 1].map(|i| &survey.rings[i]);
                let radius_mm = 0.5 * (low.radius_mm + high.radius_mm);
                let seeds: Vec<Option<&Outline>> =
                    low.stations.iter().zip(&high.stations).map(|(a, b)| a.outline().or(b.outline())).collect();
                let found = survey.ring(lens, radius_mm, &seeds, round_sr);
                let here_sr = round_sr(radius_mm);
                let is_foreseen =
                    found.shares.iter().zip(low.shares.iter().zip(&high.shares)).all(|(found, (a, b))| {
                        (found - 0.5 * (a + b)).abs() * here_sr <= AREA_OVER_RADIUS * MOST_OFF_SR * largest_sr
                    });
                if !is_foreseen {
                    next.extend([low.radius_mm, radius_mm]);
                }
                survey.rings.insert(below + 1, found);
            }
            survey.settle_darkness(largest_sr, round_sr);
            open = next;
        }
        survey
    }

    fn ring(
        &self,
        lens: &SurveyedLens<'_>,
        radius_mm: f64,
        seeds: &[Option<&Outline>],
        round_sr: &(dyn Fn(f64) -> f64 + Sync),
    ) -> Ring {
        let step_rad = TAU / (self.n_blades * self.n_of_sector) as f64;
        let station = |j: usize| lens.station(DVec2::from_angle(step_rad * j as f64) * radius_mm, seeds[j]);
        let stations: Vec<Station> = (0..self.n_of_sector).into_par_iter().map(station).collect();
        let whole_sr = round_sr(radius_mm);
        let share = |station: &Station| if whole_sr > 0.0 { station.irradiance_sr / whole_sr } else { 1.0 };
        Ring { radius_mm, shares: stations.iter().map(share).collect(), stations }
    }

    /// Gives rings in darkness or nearly so, of which no share is known, those of the ring within.
    fn settle_darkness(&mut self, largest_sr: f64, round_sr: &dyn Fn(f64) -> f64) {
        for i in 1..self.rings.len() {
            if round_sr(self.rings[i].radius_mm) <= DIM * largest_sr {
                self.rings[i].shares = self.rings[i - 1].shares.clone();
            }
        }
    }

    /// Returns the outline of what is seen from the nearest station of this sector that sees something.
    pub(crate) fn seed(&self, place_mm: DVec2) -> Option<&Outline> {
        let lit = self.rings.iter().flat_map(|ring| &ring.stations).filter_map(|s| Some((s.place_mm, s.outline()?)));
        lit.min_by(|a, b| a.0.distance_squared(place_mm).total_cmp(&b.0.distance_squared(place_mm))).map(|lit| lit.1)
    }

    /// Returns the share of the round lens's light over the film about its axis.
    pub(crate) fn share_map(&self, axis_mm: DVec2, lattice: Lattice) -> ShareMap {
        self.tabulated(axis_mm, lattice, &|_, _| 1.0)
    }

    /// Returns the same of a part of the pupil.
    pub(crate) fn part_share_map(
        &self,
        (axis_mm, lattice): (DVec2, Lattice),
        mesh: Mesh,
        (division, part): (&PupilDivision, usize),
    ) -> ShareMap {
        // As if each station lay in each sector.
        let of_sector = |sector: usize| {
            let turn = DVec2::from_angle(TAU * sector as f64 / self.n_blades as f64);
            [1.0, -1.0].map(|sign| division.cell_shares(part, mesh, turn * sign))
        };
        let cell_shares: Vec<[Vec<f64>; 2]> = (0..self.n_blades).map(of_sector).collect();
        let mut known: Vec<Vec<f64>> = Vec::new();
        for ring in &self.rings {
            let share = |(sector, j): (usize, usize)| {
                let bundle = ring.stations[j].bundle.as_deref()?;
                let shares = &cell_shares[sector][usize::from(bundle.pupil_sign < 0.0)];
                Some(bundle.energies.iter().zip(shares).map(|(energy, share)| energy * share).sum::<f64>())
            };
            let azimuths = (0..self.n_blades).flat_map(|sector| (0..self.n_of_sector).map(move |j| (sector, j)));
            // In darkness that of the ring within.
            let found =
                azimuths.enumerate().map(|(i, at)| share(at).or(known.last().map(|ring| ring[i])).unwrap_or(0.0));
            let found = found.collect();
            known.push(found);
        }
        self.tabulated(axis_mm, lattice, &|(ring, fraction), azimuth| {
            let n = self.n_blades * self.n_of_sector;
            let (below, u) = (azimuth.floor() as usize, azimuth.fract());
            let at = |ring: &[f64]| ring[below % n] * (1.0 - u) + ring[(below + 1) % n] * u;
            at(&known[ring]) * (1.0 - fraction) + at(&known[ring + 1]) * fraction
        })
    }

    /// Tabulates shares, times a factor by the ring below, the place between it and the next, and the azimuth counted in those of stations.
    fn tabulated(&self, axis_mm: DVec2, lattice: Lattice, factor: &dyn Fn((usize, f64), f64) -> f64) -> ShareMap {
        let n = self.n_blades * self.n_of_sector;
        // Between those of stations, at least four times as many.
        let finer = (4 * N_AZIMUTHS).div_ceil(n);
        let (step_mm, n_radii) = lattice.table_radii();
        let mut table = Vec::with_capacity(n_radii * n * finer);
        for i in 0..n_radii {
            let radius_mm = step_mm * i as f64;
            let above = self.rings.partition_point(|ring| ring.radius_mm <= radius_mm).clamp(1, self.rings.len() - 1);
            let [low, high] = [above - 1, above].map(|k| &self.rings[k]);
            let fraction = ((radius_mm - low.radius_mm) / (high.radius_mm - low.radius_mm)).clamp(0.0, 1.0);
            let shares: Vec<f64> =
                low.shares.iter().zip(&high.shares).map(|(a, b)| a * (1.0 - fraction) + b * fraction).collect();
            table.extend((0..n * finer).map(|j| {
                let azimuth = j as f64 / finer as f64;
                on_circle(&shares, azimuth) * factor((above - 1, fraction), azimuth)
            }));
        }
        ShareMap::new(axis_mm, step_mm, n * finer, table)
    }
}

/// Returns a periodic function at a place counted in its samples of one period: the trigonometric polynomial through them.
fn on_circle(samples: &[f64], at: f64) -> f64 {
    let n = samples.len();
    let weight = |j: usize| {
        let half = std::f64::consts::PI * (at - j as f64) / n as f64;
        if half.sin().abs() < 1e-12 {
            return 1.0;
        }
        let over = if n.is_multiple_of(2) { half.tan() } else { half.sin() };
        (n as f64 * half).sin() / (n as f64 * over)
    };
    samples.iter().enumerate().map(|(j, sample)| sample * weight(j)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waves_of_a_few_samples_are_found_between_them() {
        for n in [2, 3, 4, 5, 8] {
            let wave = |at: f64| 0.7 + 0.2 * (TAU * at / n as f64).cos();
            let samples: Vec<f64> = (0..n).map(|j| wave(j as f64)).collect();
            for at in [0.0, 0.3, 1.5, 2.0, 6.9, 23.25] {
                assert!((on_circle(&samples, at) - wave(at)).abs() < 1e-12, "{n} {at}");
            }
        }
    }
}
