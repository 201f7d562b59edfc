//! What a point spread function is drawn from: a mesh of spots on the film, and the energy of each cell between them.

use glam::DVec2;

use crate::{
    mesh::{Mesh, polar},
    pupil::Outline,
};

/// Places along each side of a cell at which obscurations are looked for.
const CLEAR_ACROSS: usize = 8;

/// One node of a mesh of rays.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Node {
    /// Where it lies, mm, picture frame, about a point of the film.
    pub(crate) at_mm: DVec2,
    /// Place in the stop over the stop's radius.
    pub(crate) in_stop: DVec2,
    /// Movement for a unit change of the direction cosine along x at the stop, mm, picture frame.
    pub(crate) along_l_mm: DVec2,
    /// The same along y.
    pub(crate) along_m_mm: DVec2,
}

/// A mesh of rays on the film.
#[derive(Clone, Debug)]
pub(crate) struct Spots {
    pub(crate) mesh: Mesh,
    pub(crate) nodes: Vec<Node>,
    /// Of the cells; their sum is 1.
    pub(crate) energies: Vec<f64>,
}

impl Spots {
    /// Returns where the centroid of what is drawn lies, mm: of each cell, that of its two triangles.
    pub(crate) fn centroid_mm(&self) -> DVec2 {
        let at = |node: usize| self.nodes[node].at_mm;
        let place = |((ring, j), energy): ((usize, usize), &f64)| {
            let outer = self.mesh.outer_share(ring);
            let [a, b, c, d] = self.mesh.corners(ring, j);
            (at(a) + at(c) + outer * at(b) + (1.0 - outer) * at(d)) * (energy / 3.0)
        };
        self.mesh.cells().zip(&self.energies).map(place).sum()
    }

    /// Returns the spots counted from a place, mm.
    pub(crate) fn about(mut self, place_mm: DVec2) -> Self {
        self.nodes.iter_mut().for_each(|node| node.at_mm -= place_mm);
        self
    }

    /// Returns the rms distance of the energy from where places count from, mm, cells taken at the means of their corners.
    pub(crate) fn rms_mm(&self) -> f64 {
        let square = |((ring, j), energy): ((usize, usize), &f64)| {
            let corners = self.mesh.corners(ring, j).map(|node| self.nodes[node].at_mm);
            (corners.into_iter().sum::<DVec2>() / 4.0).length_squared() * energy
        };
        self.mesh.cells().zip(&self.energies).map(square).sum::<f64>().sqrt()
    }

    /// Returns the corners of the box that holds the cells which have energy, mm.
    pub(crate) fn bounds_mm(&self) -> (DVec2, DVec2) {
        let lit = self.mesh.cells().zip(&self.energies).filter(|(_, energy)| **energy != 0.0);
        let corners = lit.flat_map(|((ring, j), _)| self.mesh.corners(ring, j)).map(|node| self.nodes[node].at_mm);
        corners.fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)))
    }

    /// Returns the place, mm, with half the energy to its left and half below, cells taken at the means of their corners.
    pub(crate) fn median_mm(&self) -> DVec2 {
        let middle = |(ring, j): (usize, usize)| {
            self.mesh.corners(ring, j).map(|node| self.nodes[node].at_mm).into_iter().sum::<DVec2>() / 4.0
        };
        let median = |along: fn(DVec2) -> f64| {
            let cells = self.mesh.cells().map(|cell| along(middle(cell)));
            let mut cells: Vec<(f64, f64)> = cells.zip(self.energies.iter().copied()).collect();
            cells.sort_by(|a, b| a.0.total_cmp(&b.0));
            let half = 0.5 * self.energies.iter().sum::<f64>();
            let mut held = 0.0;
            let found = cells.iter().find(|(_, energy)| {
                held += energy;
                held >= half
            });
            found.map_or(0.0, |(at, _)| *at)
        };
        DVec2::new(median(|at| at.x), median(|at| at.y))
    }

    /// Returns how far from the point that places count from the farthest spot lies, mm.
    pub(crate) fn extent_mm(&self) -> f64 {
        self.nodes.iter().map(|node| node.at_mm.length()).fold(0.0, f64::max)
    }
}

/// Returns the areas of the cells of an outline's mesh, by Simpson's rule around it: its radii are known at each azimuth of the mesh and once
/// between two.
pub(crate) fn cell_areas(mesh: Mesh, outline: &Outline) -> Vec<f64> {
    let (rho, n) = (&outline.rho, outline.rho.len());
    let ring = |ring: usize| {
        let (inner, outer) = (mesh.share(ring as f64), mesh.share((ring + 1) as f64));
        (0..mesh.n_azimuths).map(move |j| {
            let wedge = match outline.is_even() {
                true => mesh.azimuth(1.0),
                false => outline.wedge(mesh, j)[1] - outline.wedge(mesh, j)[0],
            };
            let sector = 0.5 * wedge * (outer * outer - inner * inner);
            let [from, between, to] = [2 * j, 2 * j + 1, (2 * j + 2) % n].map(|i| rho[i] * rho[i]);
            sector * (from + 4.0 * between + to) / 6.0
        })
    };
    (0..mesh.n_rings).flat_map(ring).collect()
}

/// Returns how much of each cell of an outline's mesh obscurations leave clear: of 8 × 8 rays through it. `passed` says of places of the
/// outline's plane which rays get through the lens, with its obscurations or without.
pub(crate) fn clear_shares(mesh: Mesh, outline: &Outline, passed: &dyn Fn(&[DVec2], bool) -> Vec<bool>) -> Vec<f64> {
    let n = CLEAR_ACROSS;
    let rho = |j: usize| outline.rho[(2 * j) % outline.rho.len()];
    let place = |ring: usize, j: usize, k: usize| {
        let middle = |i: usize| (i as f64 + 0.5) / n as f64;
        let (out, around) = (middle(k / n), middle(k % n));
        let [inner, outer] = [ring, ring + 1].map(|ring| mesh.share(ring as f64).powi(2));
        // Even in area.
        let share = (inner + (outer - inner) * out).sqrt();
        let azimuth = match outline.is_even() {
            true => mesh.azimuth(j as f64 + around),
            false => {
                let [from, to] = outline.wedge(mesh, j);
                from + (to - from) * around
            }
        };
        polar(outline.center, share * (rho(j) + (rho(j + 1) - rho(j)) * around), azimuth)
    };
    let places: Vec<DVec2> = mesh.cells().flat_map(|(ring, j)| (0..n * n).map(move |k| place(ring, j, k))).collect();
    let n_passed = |passed: &[bool]| passed.iter().filter(|passed| **passed).count() as f64;
    let mut shares: Vec<f64> =
        passed(&places, true).chunks(n * n).map(|cell| n_passed(cell) / (n * n) as f64).collect();
    // Rims end some rays of the outermost cells, whose areas have that already.
    let outermost = mesh.n_cells() - mesh.n_azimuths;
    let whole = passed(&places[outermost * n * n..], false);
    for (share, cell) in shares[outermost..].iter_mut().zip(whole.chunks(n * n)) {
        *share = (*share * (n * n) as f64 / n_passed(cell).max(1.0)).min(1.0);
    }
    shares
}
