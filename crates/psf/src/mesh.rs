//! The mesh of the pupil whose nodes are traced.

use std::f64::consts::TAU;

use glam::DVec2;

/// A polar mesh over the pupil: a center, then rings out to its edge, each of equally many nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Mesh {
    pub(crate) n_rings: usize,
    pub(crate) n_azimuths: usize,
}

impl Mesh {
    pub(crate) fn n_cells(self) -> usize {
        self.n_rings * self.n_azimuths
    }

    /// Returns the radius of a ring as a share of the pupil's: 0 is the center, `n_rings` the edge.
    ///
    /// Rings crowd a little towards the edge, where outlines are drawn and diffraction is strongest.
    pub(crate) fn share(self, ring: f64) -> f64 {
        let s = ring / self.n_rings as f64;
        1.0 - (1.0 - s).max(0.0).powf(1.4)
    }

    pub(crate) fn azimuth(self, j: f64) -> f64 {
        TAU * j / self.n_azimuths as f64
    }

    /// Returns the place of a node in a list: all of ring 0 are the center.
    pub(crate) fn node(self, ring: usize, j: usize) -> usize {
        if ring == 0 {
            0
        } else {
            1 + (ring - 1) * self.n_azimuths + if j < self.n_azimuths { j } else { j % self.n_azimuths }
        }
    }

    /// Returns the node that mirrors a node about azimuth 0.
    pub(crate) fn mirrored(self, node: usize) -> usize {
        let Some(beyond) = node.checked_sub(1) else { return 0 };
        let j = beyond % self.n_azimuths;
        node - j + (self.n_azimuths - j) % self.n_azimuths
    }

    /// Returns the polar places (share of the radius, azimuth) of all nodes in order.
    pub(crate) fn nodes(self) -> impl Iterator<Item = (f64, f64)> {
        let ring = move |ring: usize| {
            let share = self.share(ring as f64);
            (0..self.n_azimuths).map(move |j| (share, self.azimuth(j as f64)))
        };
        std::iter::once((0.0, 0.0)).chain((1..=self.n_rings).flat_map(ring))
    }

    /// Returns the ring and azimuth numbers of all cells in order: cell (i, j) lies between rings i and i + 1.
    pub(crate) fn cells(self) -> impl Iterator<Item = (usize, usize)> {
        (0..self.n_rings).flat_map(move |ring| (0..self.n_azimuths).map(move |j| (ring, j)))
    }

    /// Returns the mean over each cell of what is known at places of the unit disc: at its middle, or at `n_across`² places that are even in its
    /// area.
    pub(crate) fn cell_means(self, n_across: usize, at: impl Fn(DVec2) -> f64) -> Vec<f64> {
        let middle = |(ring, j): (usize, usize)| {
            let [inner, outer] = [ring, ring + 1].map(|ring| self.share(ring as f64));
            let radius = (inner * inner + inner * outer + outer * outer) / (1.5 * (inner + outer));
            polar(DVec2::ZERO, radius, self.azimuth(j as f64 + 0.5))
        };
        let within = |(ring, j): (usize, usize), k: usize| {
            let [inner, outer] = [ring, ring + 1].map(|ring| self.share(ring as f64).powi(2));
            let [out, around] = [k / n_across, k % n_across].map(|i| (i as f64 + 0.5) / n_across as f64);
            polar(DVec2::ZERO, (inner + (outer - inner) * out).sqrt(), self.azimuth(j as f64 + around))
        };
        let mean = |cell: (usize, usize)| match n_across {
            1 => at(middle(cell)),
            n => (0..n * n).map(|k| at(within(cell, k))).sum::<f64>() / (n * n) as f64,
        };
        self.cells().map(mean).collect()
    }

    /// Returns the share of a cell's area in the pupil that lies in the triangle on its outer side.
    pub(crate) fn outer_share(self, ring: usize) -> f64 {
        let (inner, outer) = (self.share(ring as f64), self.share((ring + 1) as f64));
        outer / (inner + outer)
    }

    /// Returns the nodes at the corners of a cell: inner, outer, outer next, inner next.
    pub(crate) fn corners(self, ring: usize, j: usize) -> [usize; 4] {
        [self.node(ring, j), self.node(ring + 1, j), self.node(ring + 1, j + 1), self.node(ring, j + 1)]
    }
}

/// Returns a polar place about a center.
pub(crate) fn polar(center: DVec2, radius: f64, azimuth: f64) -> DVec2 {
    center + DVec2::from_angle(azimuth) * radius
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cell_has_its_four_corners_among_the_nodes() {
        let mesh = Mesh { n_rings: 3, n_azimuths: 5 };
        assert_eq!(mesh.nodes().count(), 16);
        assert_eq!(mesh.cells().count(), mesh.n_cells());
        assert_eq!(mesh.corners(0, 4), [0, 5, 1, 0]);
        assert_eq!(mesh.corners(2, 4), [10, 15, 11, 6]);
        assert_eq!((mesh.share(0.0), mesh.share(3.0)), (0.0, 1.0));
        assert_eq!([0, 1, 6, 7, 10].map(|node| mesh.mirrored(node)), [0, 1, 6, 10, 7]);
    }
}
