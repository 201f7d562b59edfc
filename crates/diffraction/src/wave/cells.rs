//! The cells of a true pupil: vignetted, obscured, and cut where its edge has corners.

use std::{f64::consts::TAU, ops::Range};

use dioptric_optics::{MonoLens, ObjectPoint, PupilBoundary, PupilPlane, Vignetting, quadrature::gauss_legendre_on};
use glam::{DVec2, DVec3};

use super::{
    grid::PupilGrid,
    propagation::{FilmRays, Propagation, Waves},
};
use crate::DiffractionError;

/// The cells of a pupil in its plane, azimuth by azimuth.
///
/// A hole is counted by cells of negative area: what is stopped is what an opening of its shape would pass. So every
/// part is a region with an edge of few corners, and sums over its nodes converge as fast as those over a disc.
pub(crate) struct PupilCells {
    pub(crate) targets_mm: Vec<DVec2>,
    areas_mm2: Vec<f64>,
    /// Shares of the energy, of sum 1; negative in holes.
    pub(crate) energy: Vec<f64>,
    /// The solid angle or cross-section of the beam.
    pub(super) collected: f64,
    pub(crate) plane: PupilPlane,
    /// A place within the pupil's outer edge.
    pub(crate) center_mm: DVec2,
    /// Half the distance of the neighbors that derivatives are taken from, mm.
    step_mm: f64,
}

impl PupilCells {
    /// Finds the pupil of a point, and lays nodes over it: `None` if no light gets through.
    pub(crate) fn find(lens: &MonoLens, point: &ObjectPoint, grid: PupilGrid) -> Option<Self> {
        let mut parts: Option<Self> = None;
        lens.for_each_clear_part(&mut |part, sign| {
            let Some(region) = Self::of_region(part, point, grid) else { return false };
            match &mut parts {
                None => parts = Some(region),
                Some(cells) => cells.add(region, sign),
            }
            true
        });
        let mut cells = parts?;
        cells.collected = cells.energy.iter().sum();
        let collected = cells.collected;
        cells.energy.iter_mut().for_each(|energy| *energy /= collected);
        // Behind holes as large as the pupil rounding remains.
        let gross: f64 = cells.energy.iter().map(|energy| energy.abs()).sum();
        (collected > 0.0 && gross < LARGEST_HOLE).then_some(cells)
    }

    /// Adds a further region, as clear or as a hole.
    fn add(&mut self, region: Self, sign: f64) {
        self.step_mm = self.step_mm.min(region.step_mm);
        self.targets_mm.extend(region.targets_mm);
        self.areas_mm2.extend(region.areas_mm2.iter().map(|area| sign * area));
        self.energy.extend(region.energy.iter().map(|energy| sign * energy));
    }

    /// Lays nodes over the pupil of a lens without obscurations; energies are solid angles.
    fn of_region(lens: &MonoLens, point: &ObjectPoint, grid: PupilGrid) -> Option<Self> {
        let (boundary, azimuths) = azimuths(lens, point, grid)?;
        let (center_mm, plane) = (boundary.center_mm(), *boundary.plane());
        let radii = gauss_legendre_on(grid.n_radii, 0.0, 1.0);
        let (targets_mm, areas_mm2): (Vec<DVec2>, Vec<f64>) =
            polar(&azimuths, &radii).map(|(offset, area)| (center_mm + offset, area)).unzip();
        let taken = |(target, area): (&DVec2, &f64)| area * solid_angle_on_plane(point, &plane, *target);
        let energy: Vec<f64> = targets_mm.iter().zip(&areas_mm2).map(taken).collect();
        let narrowest_mm = azimuths.iter().map(|azimuth| azimuth.rho_mm).fold(f64::INFINITY, f64::min);
        // Truncation is of order the step squared, 1e-8 of a derivative's own change over the pupil; rounding is
        // 1e-16 over it. The outermost node stays further than that from the edge, up to 80 radii.
        let step_mm = narrowest_mm * 1e-4f64.min(0.5 / (grid.n_radii * grid.n_radii) as f64);
        Some(Self { targets_mm, areas_mm2, energy, collected: 0.0, plane, center_mm, step_mm })
    }

    pub(super) fn n_nodes(&self) -> usize {
        self.targets_mm.len()
    }

    /// Traces the nodes to the film, and finds what waves they stand for and how much of the directions each takes: spherical waves
    /// where that can be, and plane ones where a sphere is missed or where the pupil's own image is folded, for the rays behind it need
    /// not be.
    ///
    /// # Errors
    /// When rays are lost, or the waves fold over one another either way.
    pub(super) fn waves(
        &self,
        lens: &MonoLens,
        point: &ObjectPoint,
        film_distance_mm: f64,
    ) -> Result<CellWaves, DiffractionError> {
        let trace = |nodes, step| self.trace((lens, point, film_distance_mm), nodes, step);
        let mut blocks = self.blocks();
        let mut rays = trace(blocks.next().unwrap_or_default(), DVec2::ZERO)?;
        for nodes in blocks {
            rays.append(trace(nodes, DVec2::ZERO)?);
        }
        let centroid_mm = self.centroid_mm(&rays);
        for propagation in [Propagation::Fresnel, Propagation::Debye] {
            let Some(waves) = propagation.waves_of(&rays, centroid_mm).if_finite() else { continue };
            let directions = |nodes, step| {
                let waves = propagation.waves_of(&trace(nodes, step)?, centroid_mm).if_finite();
                Ok(waves.map(|waves| waves.d))
            };
            if let Some(areas) = self.direction_areas(&directions)? {
                return Ok(CellWaves { rays, centroid_mm, waves, areas });
            }
        }
        Err(DiffractionError::Folded { wavelength_nm: lens.wavelength_nm() })
    }

    /// The numbers of nodes that are traced at a time: rays take more memory than what is kept of them.
    fn blocks(&self) -> impl Iterator<Item = Range<usize>> {
        let n = self.n_nodes();
        (0..n).step_by(AT_A_TIME).map(move |first| first..n.min(first + AT_A_TIME))
    }

    /// Traces rays so many steps beside these nodes to the film.
    fn trace(
        &self,
        (lens, point, film_distance_mm): (&MonoLens, &ObjectPoint, f64),
        nodes: Range<usize>,
        steps: DVec2,
    ) -> Result<FilmRays, DiffractionError> {
        let targets_mm: Vec<DVec2> =
            self.targets_mm[nodes].iter().map(|target| target + steps * self.step_mm).collect();
        let mut rays = self.plane.rays(lens, point, &targets_mm);
        lens.trace(&mut rays, Vignetting::Off);
        lens.to_film(&mut rays, film_distance_mm);
        match rays.len() - rays.n_in_flight() {
            0 => Ok(FilmRays::new(&rays, lens, film_distance_mm)),
            n_lost => {
                Err(DiffractionError::LostRays { wavelength_nm: lens.wavelength_nm(), n_lost, n_rays: rays.len() })
            }
        }
    }

    /// Returns the mean place on the film.
    fn centroid_mm(&self, rays: &FilmRays) -> DVec2 {
        self.energy.iter().enumerate().map(|(i, e)| *e * rays.place_mm(i)).sum()
    }

    /// Returns the area Δ of each cell in (dx, dy) (`docs/wave.md`, eq. 5), negative in holes, or `None` if directions fold over one
    /// another; `directions` returns those of rays so many steps beside nodes, or `None` if there are none.
    fn direction_areas(
        &self,
        directions: &dyn Fn(Range<usize>, DVec2) -> Result<Option<Vec<DVec2>>, DiffractionError>,
    ) -> Result<Option<Vec<f64>>, DiffractionError> {
        let mut areas = Vec::with_capacity(self.n_nodes());
        let mut first = None;
        for nodes in self.blocks() {
            let slopes = |axis: DVec2| -> Result<Option<Vec<DVec2>>, DiffractionError> {
                let beside = (directions(nodes.clone(), axis)?, directions(nodes.clone(), -axis)?);
                let (Some(after), Some(before)) = beside else { return Ok(None) };
                Ok(Some(
                    after.iter().zip(&before).map(|(after, before)| (after - before) / (2.0 * self.step_mm)).collect(),
                ))
            };
            let (Some(along_x), Some(along_y)) = (slopes(DVec2::X)?, slopes(DVec2::Y)?) else { return Ok(None) };
            for ((x, y), area) in along_x.iter().zip(&along_y).zip(&self.areas_mm2[nodes.clone()]) {
                let jacobian = x.perp_dot(*y);
                let is_one_to_one = jacobian * *first.get_or_insert(jacobian) > 0.0;
                if !is_one_to_one {
                    return Ok(None);
                }
                areas.push(jacobian.abs() * area);
            }
        }
        Ok(Some(areas))
    }
}

/// What nodes of a pupil send to the film.
pub(super) struct CellWaves {
    pub(super) rays: FilmRays,
    pub(super) centroid_mm: DVec2,
    pub(super) waves: Waves,
    /// The area Δ of the cell of each in (dx, dy).
    pub(super) areas: Vec<f64>,
}

/// Nodes that are traced at a time.
const AT_A_TIME: usize = 1 << 16;

/// Energies of all cells, those of holes counted as positive, over the light that gets through, at most.
const LARGEST_HOLE: f64 = 1e6;

/// An azimuth of a region: the share of the circle that it stands for, in radians, and how far the edge is.
#[derive(Clone, Copy)]
pub(super) struct Spoke {
    direction: DVec2,
    width_rad: f64,
    rho_mm: f64,
}

/// The share to which sums over the azimuths of an elongated pupil are exact, and the most azimuths for that.
const AZIMUTH_ERROR: f64 = 1e-6;
const MOST_AZIMUTHS: usize = 1024;

/// Finds the pupil and the azimuths of its nodes: equally spaced where the edge is smooth, Gauss and Legendre's between
/// corners where it has any. A pupil that is long and narrow takes as many more as it needs.
///
/// About the center of an ellipse of axes a and b, ρ² has harmonics of 2θ that fall like ((a − b) / (a + b))ᵏ, so that
/// sums over n azimuths err by the (n / 2)-th of them.
fn azimuths(lens: &MonoLens, point: &ObjectPoint, grid: PupilGrid) -> Option<(PupilBoundary, Vec<Spoke>)> {
    let mut boundary = PupilBoundary::find(lens, point, grid.n_azimuths)?;
    let rho_mm = boundary.rho_at_azimuths_mm();
    let ends = rho_mm.iter().fold((f64::INFINITY, 0.0_f64), |ends, rho| (ends.0.min(*rho), ends.1.max(*rho)));
    let ratio = (ends.1 - ends.0) / (ends.1 + ends.0);
    let needed = (2.0 * AZIMUTH_ERROR.ln() / ratio.ln()).ceil().min(MOST_AZIMUTHS as f64) as usize;
    let n = grid.n_azimuths.max(needed.next_multiple_of(2));
    // A round edge has no corners.
    let corners = if ratio < ROUND { vec![] } else { boundary.corners_rad(lens, point) };
    if corners.is_empty() {
        if n > rho_mm.len() {
            boundary = PupilBoundary::find(lens, point, n)?;
        }
        let spokes = equal_azimuths(boundary.rho_at_azimuths_mm());
        return Some((boundary, spokes));
    }
    let (angles, widths_rad): (Vec<f64>, Vec<f64>) = between_corners(&corners, grid.n_azimuths).unzip();
    let rho_mm = boundary.edge_at_mm(lens, point, &angles)?;
    let spoke = |((angle, width_rad), rho_mm)| Spoke { direction: DVec2::from_angle(angle), width_rad, rho_mm };
    let spokes = angles.iter().copied().zip(widths_rad).zip(rho_mm).map(spoke).collect();
    Some((boundary, spokes))
}

/// Differences of radii, over their sum, below which an edge is that of one round rim.
const ROUND: f64 = 1e-9;

/// Returns azimuths and their widths between corners, as densely as `n` equal ones of the full circle need.
fn between_corners(corners_rad: &[f64], n: usize) -> impl Iterator<Item = (f64, f64)> {
    let ends = corners_rad.iter().copied().zip(corners_rad[1..].iter().copied().chain([corners_rad[0] + TAU]));
    ends.filter(|(from, to)| to - from > NO_ARC).flat_map(move |(from, to)| {
        let share = (to - from) / TAU * n as f64;
        gauss_legendre_on((AT_ENDS + DENSER * share).ceil() as usize, from, to)
    })
}

/// Arcs shorter than this are left out, radians.
const NO_ARC: f64 = 1e-9;
/// How many azimuths an arc has to itself, and how many times as many as equal ones of the full circle.
const AT_ENDS: f64 = 6.0;
const DENSER: f64 = 1.3;

fn equal_azimuths(rho_mm: &[f64]) -> Vec<Spoke> {
    let width_rad = TAU / rho_mm.len() as f64;
    let spoke = |(i, rho_mm): (usize, &f64)| Spoke {
        direction: DVec2::from_angle(width_rad * i as f64),
        width_rad,
        rho_mm: *rho_mm,
    };
    rho_mm.iter().enumerate().map(spoke).collect()
}

/// Returns the nodes of a star-shaped region and the areas of their cells, azimuth by azimuth.
fn polar<'a>(azimuths: &'a [Spoke], radii: &'a [(f64, f64)]) -> impl Iterator<Item = (DVec2, f64)> + 'a {
    azimuths.iter().flat_map(move |&Spoke { direction, width_rad, rho_mm }| {
        radii.iter().map(move |(t, w)| (direction * (rho_mm * t), rho_mm * rho_mm * t * w * width_rad))
    })
}

/// Returns the nodes of the unit disc and the areas of their cells.
pub(super) fn disc(grid: PupilGrid) -> Vec<(DVec2, f64)> {
    let (azimuths, radii) = (equal_azimuths(&vec![1.0; grid.n_azimuths]), gauss_legendre_on(grid.n_radii, 0.0, 1.0));
    polar(&azimuths, &radii).collect()
}

/// Returns the solid angle (for a far point: the cross-section of the beam) per area of a pupil's plane at a place of it, mm.
pub(super) fn solid_angle_on_plane(point: &ObjectPoint, plane: &PupilPlane, place_mm: DVec2) -> f64 {
    match *point {
        ObjectPoint::Finite(from) => {
            let way = plane.in_lens_mm(place_mm) - from;
            (way.dot(plane.normal()) / way.length().powi(3)).abs()
        }
        ObjectPoint::Infinite(direction) => direction.dot(plane.normal()),
    }
}

/// Returns the solid angle (for a far point: the cross-section of the beam) per area of a plane across the axis.
pub(super) fn solid_angle_per_area(point: &ObjectPoint, target_mm: DVec3) -> f64 {
    match *point {
        ObjectPoint::Finite(from) => {
            let way = target_mm - from;
            (way.z / way.length().powi(3)).abs()
        }
        ObjectPoint::Infinite(direction) => direction.z,
    }
}
