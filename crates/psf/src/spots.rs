//! What a point spread function is drawn from: a mesh of spots on the film, and the energy of each cell between them.

use glam::DVec2;

use crate::mesh::Mesh;

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

    /// Returns how far from the point that places count from the farthest spot lies, mm.
    pub(crate) fn extent_mm(&self) -> f64 {
        self.nodes.iter().map(|node| node.at_mm.length()).fold(0.0, f64::max)
    }
}

/// Returns the fractions of a mesh's energy in its cells, from the squares of the outline's radii: at each azimuth of the mesh and once between two.
///
/// Cells of a plane that light passes evenly: their areas by Simpson's rule around the pupil. The sum is the area.
pub(crate) fn cell_areas(mesh: Mesh, rho: &[f64]) -> Vec<f64> {
    let n = rho.len();
    let wedge = mesh.azimuth(1.0);
    let ring = |ring: usize| {
        let (inner, outer) = (mesh.share(ring as f64), mesh.share((ring + 1) as f64));
        let sector = 0.5 * wedge * (outer * outer - inner * inner);
        (0..mesh.n_azimuths).map(move |j| {
            let [from, between, to] = [2 * j, 2 * j + 1, (2 * j + 2) % n].map(|i| rho[i] * rho[i]);
            sector * (from + 4.0 * between + to) / 6.0
        })
    };
    (0..mesh.n_rings).flat_map(ring).collect()
}
