//! Where light gets through a lens: first places of a pupil.

use std::cmp::Ordering;

use glam::DVec2;

use super::{EDGE_MM, PupilBoundary, Search, edge::EdgeSearch};
use crate::{RayFate, Vignetting};

/// Rays across the front of the lens in a first look, and in a second where that finds no light.
const LOOKS: [usize; 2] = [25, 97];
/// How many of the rays that get furthest lead to finer ones, how many those are across, and how often.
const N_LEADERS: usize = 16;
const N_FINER: i32 = 2;
const FINER_ROUNDS: usize = 28;
/// Rays across a part of the pupil and its surroundings, and how far these go, over the part's width.
const AROUND: usize = 25;
const SURROUNDINGS: f64 = 1.6;

/// How far a ray gets: how many surfaces it meets, is within the rims of and is bent by, three for each that it passes, and how much it is
/// short of the next of these, as a negative number.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
struct Progress(usize, f64);

/// A ray through a place of the front, over its rim's radius.
#[derive(Clone, Copy)]
struct Trial {
    on_front: DVec2,
    progress: Progress,
}

impl Search<'_> {
    /// Returns places of the pupil, each with its clearance: those of rays spread over the whole front of the lens or,
    /// where none of them gets through, of rays near to those that get furthest.
    ///
    /// Surfaces let through less and less: what passes the first k of them holds all that passes k + 1. So rays that get
    /// further than others are near to those that get further still.
    pub(super) fn lit_over_front(&self) -> Vec<(DVec2, f64)> {
        for n_across in LOOKS {
            let lit = self.look(n_across);
            if !lit.is_empty() {
                return lit;
            }
        }
        Vec::new()
    }

    fn look(&self, n_across: usize) -> Vec<(DVec2, f64)> {
        let mut step = 2.0 / n_across as f64;
        let disc: Vec<DVec2> = cells(n_across).filter(|place| place.length() <= 1.0 + step).collect();
        let lit = self.lit(&disc);
        if !lit.is_empty() {
            return lit;
        }
        let mut leaders = self.furthest(self.tried(&disc), Vec::new());
        for _ in 0..FINER_ROUNDS {
            step *= 0.5;
            let around = |leader: &Trial| {
                let offsets = (-N_FINER..=N_FINER).flat_map(|i| (-N_FINER..=N_FINER).map(move |j| (i, j)));
                let center = leader.on_front;
                let finer = offsets.filter(|offset| *offset != (0, 0));
                finer.map(move |(i, j)| center + step * DVec2::new(i.into(), j.into()))
            };
            let finer: Vec<DVec2> = leaders.iter().flat_map(around).collect();
            let lit = self.lit(&finer);
            if !lit.is_empty() {
                return lit;
            }
            leaders = self.furthest(self.tried(&finer), leaders);
        }
        Vec::new()
    }

    /// Returns places of the pupil around a part of it that is known.
    pub(super) fn lit_around(&self, part: &PupilBoundary) -> Vec<(DVec2, f64)> {
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for place in part.edge_mm() {
            (low, high) = (low.min(place), high.max(place));
        }
        let (middle, half) = (0.5 * (low + high), 0.5 * SURROUNDINGS * (high - low));
        self.lit_targets(cells(AROUND).map(|place| middle + half * place).collect())
    }

    fn lit(&self, on_front: &[DVec2]) -> Vec<(DVec2, f64)> {
        self.lit_targets(on_front.iter().map(|place| self.target_through_front(*place)).collect())
    }

    pub(super) fn lit_targets(&self, targets_mm: Vec<DVec2>) -> Vec<(DVec2, f64)> {
        let clearances = self.clearances(&targets_mm);
        targets_mm.into_iter().zip(clearances).filter(|(_, clearance)| *clearance > EDGE_MM).collect()
    }

    /// Returns where the ray through this place of the first surface, over its rim's radius, crosses the pupil's plane.
    fn target_through_front(&self, on_front: DVec2) -> DVec2 {
        let point_mm = self.lens.on_front_mm(on_front * self.lens.semi_aperture_mm(0));
        self.plane.meets_mm(point_mm, self.point.direction_to(point_mm))
    }

    /// Returns how far rays through these places of the front get.
    fn tried(&self, on_front: &[DVec2]) -> Vec<Trial> {
        let targets: Vec<DVec2> = on_front.iter().map(|place| self.target_through_front(*place)).collect();
        let mut rays = self.plane.rays(self.lens, self.point, &targets);
        self.lens.trace(&mut rays, Vignetting::On);
        let progress = |i: usize| {
            let Some(surface) = rays.fate[i].surface() else { return Progress(3 * self.lens.n_surfaces(), 0.0) };
            let [point_mm, direction] = self.lens.in_frame_of(surface, rays.point_mm(i), rays.direction(i));
            let place_mm = point_mm.truncate();
            match rays.fate[i] {
                // A ray through the vertex meets the surface.
                RayFate::Missed { .. } => Progress(3 * surface, -point_mm.cross(direction).length()),
                RayFate::Vignetted { .. } => Progress(3 * surface + 1, self.lens.clearance_on_mm(surface, place_mm)),
                _ => {
                    let step = &self.lens.steps()[surface];
                    let cosine = step.normal_at(place_mm).normalize().dot(direction);
                    let sine = step.index_before / step.index_after * (1.0 - cosine * cosine).max(0.0).sqrt();
                    Progress(3 * surface + 2, -sine)
                }
            }
        };
        on_front.iter().enumerate().map(|(i, &on_front)| Trial { on_front, progress: progress(i) }).collect()
    }

    fn furthest(&self, new: Vec<Trial>, old: Vec<Trial>) -> Vec<Trial> {
        let mut all: Vec<Trial> = new.into_iter().chain(old).collect();
        all.sort_by(|a, b| b.progress.partial_cmp(&a.progress).unwrap_or(Ordering::Equal));
        all.truncate(N_LEADERS);
        all
    }
}

/// Returns the middles of the cells of a square from −1 to 1.
fn cells(n_across: usize) -> impl Iterator<Item = DVec2> {
    let at = move |i: usize| (2 * i + 1) as f64 / n_across as f64 - 1.0;
    (0..n_across).flat_map(move |row| (0..n_across).map(move |column| DVec2::new(at(column), at(row))))
}
