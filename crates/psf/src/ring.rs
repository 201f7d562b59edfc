//! Rings of the pupil's mesh, and how they are cut into pieces (`docs/hurb.md`, "From cells to Gaussians").

use std::sync::LazyLock;

use dioptric_optics::quadrature::gauss_legendre_on;

use crate::mesh::Mesh;

/// A piece of this many standard deviations across leaves a ripple of 2 %, which pixels and neighbors hide.
pub(crate) const PIECE: f64 = 2.7;

/// A ring of cells of the mesh.
#[derive(Clone, Copy)]
pub(crate) struct Ring {
    /// How many rings there are from this one to the edge.
    n_to_edge: usize,
    /// The shares of the pupil's radius at both sides.
    inner_share: f64,
    outer_share: f64,
}

/// A piece of a cell: its place, from 0 on the inner side to 1 on the outer, its width there, and its part of the area.
#[derive(Clone, Copy)]
pub(crate) struct Piece {
    pub(crate) at: f64,
    pub(crate) step: f64,
    pub(crate) share_of_area: f64,
}

/// How the cells of a ring are cut from the inner side to the outer.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Cut {
    Whole,
    /// Into so many, by Gauss's rule.
    Gauss(usize),
    /// Into so many of equal steps.
    Equal(usize),
}

impl Ring {
    pub(crate) fn new(mesh: Mesh, number: usize) -> Self {
        let (inner_share, outer_share) = (mesh.share(number as f64), mesh.share((number + 1) as f64));
        Self { n_to_edge: mesh.n_rings - number, inner_share, outer_share }
    }

    /// Returns how many pieces the ring's spread needs, if its wide axis in the middle is so many pixels: it doubles
    /// over the last few rings, which is no matter below a pixel.
    fn edge_pieces(self, wide: f64) -> usize {
        match self.n_to_edge {
            1 => 3,
            2 | 3 if wide > 0.3 => 2,
            4..=6 if wide > 0.6 => 2,
            _ => 1,
        }
    }

    /// Returns how cells are cut which are so many standard deviations long, if in their middles the wide axis has so many
    /// pixels.
    pub(crate) fn cut(self, wide: f64, n_sigmas: f64) -> Cut {
        let n_edge = self.edge_pieces(wide);
        let n_tiles = ((n_sigmas / PIECE).ceil() as usize).clamp(n_edge, 64);
        // Where the spread is wider than the pieces, Gauss's rule; where they lie side by side, equal ones. Wedges about
        // the middle hold the most of their light near their outer sides: drawn as even strips they would leave a dot there.
        if n_tiles == 1 && self.inner_share > 0.0 {
            Cut::Whole
        } else if n_sigmas < n_edge as f64 {
            Cut::Gauss(n_edge)
        } else {
            Cut::Equal(n_tiles)
        }
    }

    /// Returns the pieces of a cell that is cut like that.
    pub(crate) fn pieces(self, cut: Cut) -> Vec<Piece> {
        match cut {
            Cut::Whole => vec![Piece { at: 0.5, step: 1.0, share_of_area: 1.0 }],
            Cut::Gauss(n) => self.gauss_pieces(n).collect(),
            Cut::Equal(n) => self.equal_pieces(n).collect(),
        }
    }

    /// Returns so many pieces of equal steps, for light that they tile: each where its area has its centroid, and as wide as
    /// an even step of the area's variance is.
    fn equal_pieces(self, n: usize) -> impl Iterator<Item = Piece> {
        (0..n).map(move |i| {
            // The sides of the piece, on a scale that crowds towards the edge (eq. 5).
            let step = |i: f64| i / n as f64;
            let (from, to) = (self.share(step(i as f64)), self.share(step((i + 1) as f64)));
            let whole = self.outer_share * self.outer_share - self.inner_share * self.inner_share;
            let area = to * to - from * from;
            // Centroid and variance of its area, which goes with s ds (eq. 6).
            let mean = 2.0 / 3.0 * (to.powi(3) - from.powi(3)) / area;
            let variance = 0.5 * (to * to + from * from) - mean * mean;
            let width = (12.0 * variance).max(0.0).sqrt();
            Piece {
                at: self.place(mean),
                step: width / (self.outer_share - self.inner_share),
                share_of_area: area / whole,
            }
        })
    }

    /// Returns pieces by Gauss's rule, for light whose spread is wider than they are.
    fn gauss_pieces(self, n: usize) -> impl Iterator<Item = Piece> {
        let rule: &'static [(f64, f64)] = &RULES[n.clamp(1, MOST_GAUSS_PIECES) - 1];
        // The area between u and u + du goes with share · dshare/du, a cubic.
        let area = move |u: f64| self.share(u) * (self.gap_inner() - self.range() * u);
        let whole: f64 = rule.iter().map(|&(u, weight)| weight * area(u)).sum();
        let mut from = 0.0;
        rule.iter().map(move |&(u, weight)| {
            let (start, to) = (from, from + weight);
            from = to;
            Piece {
                at: self.place(self.share(u)),
                step: self.place(self.share(to)) - self.place(self.share(start)),
                share_of_area: weight * area(u) / whole,
            }
        })
    }

    /// Returns the share of the pupil's radius `u` of the way outwards, on a scale on which pieces crowd towards the
    /// edge like rings do, only more so: there the spread grows like 1/distance.
    fn share(self, u: f64) -> f64 {
        1.0 - (self.gap_inner() - self.range() * u).powi(2)
    }

    fn gap_inner(self) -> f64 {
        (1.0 - self.inner_share).sqrt()
    }

    fn range(self) -> f64 {
        self.gap_inner() - (1.0 - self.outer_share).max(0.0).sqrt()
    }

    fn place(self, share: f64) -> f64 {
        (share - self.inner_share) / (self.outer_share - self.inner_share)
    }
}

/// The most pieces of a cell by Gauss's rule.
const MOST_GAUSS_PIECES: usize = 4;

/// Gauss's rules on 0 to 1 of one place and more: places and weights.
static RULES: LazyLock<[Vec<(f64, f64)>; MOST_GAUSS_PIECES]> =
    LazyLock::new(|| std::array::from_fn(|i| gauss_legendre_on(i + 1, 0.0, 1.0)));

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_make_up_their_ring() {
        let mesh = Mesh { n_rings: 12, n_azimuths: 48 };
        for number in [0, 5, 11] {
            let ring = Ring::new(mesh, number);
            for n in 1..=4 {
                for pieces in [ring.equal_pieces(n).collect::<Vec<_>>(), ring.gauss_pieces(n).collect()] {
                    assert_eq!(pieces.len(), n);
                    assert!((pieces.iter().map(|p| p.share_of_area).sum::<f64>() - 1.0).abs() < 1e-12);
                    assert!(pieces.windows(2).all(|pair| pair[0].at < pair[1].at));
                    assert!(pieces.iter().all(|p| p.at > 0.0 && p.at < 1.0));
                }
                assert!((ring.gauss_pieces(n).map(|p| p.step).sum::<f64>() - 1.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn pieces_have_the_moments_of_the_rings_area() {
        let mesh = Mesh { n_rings: 12, n_azimuths: 48 };
        for number in [0, 5, 11] {
            let ring = Ring::new(mesh, number);
            let (from, to) = (ring.inner_share, ring.outer_share);
            let mean_power =
                |k: i32| 2.0 / f64::from(k + 2) * (to.powi(k + 2) - from.powi(k + 2)) / (to * to - from * from);
            for n in 1..=4 {
                let share = |p: &Piece| from + p.at * (to - from);
                let (mut mean, mut square) = (0.0, 0.0);
                for piece in ring.equal_pieces(n) {
                    let width = piece.step * (to - from);
                    mean += piece.share_of_area * share(&piece);
                    square += piece.share_of_area * (share(&piece).powi(2) + width * width / 12.0);
                }
                assert!((mean - mean_power(1)).abs() < 1e-12 && (square - mean_power(2)).abs() < 1e-12, "{number} {n}");
            }
        }
        // A wedge: two thirds of the way out.
        assert!((Ring::new(mesh, 0).equal_pieces(1).next().unwrap().at - 2.0 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn gausss_rule_integrates_over_the_ring_what_grows_towards_its_edge() {
        let ring = Ring::new(Mesh { n_rings: 12, n_azimuths: 48 }, 11);
        // The mean over the ring's area of √(1 − share), by the substitution share = 1 − gap².
        let gap = (1.0 - ring.inner_share).sqrt();
        let exact = 4.0 * (gap.powi(3) / 3.0 - gap.powi(5) / 5.0) / (1.0 - ring.inner_share.powi(2));
        let mean: f64 = ring
            .gauss_pieces(3)
            .map(|p| p.share_of_area * (1.0 - ring.inner_share - p.at * (1.0 - ring.inner_share)).sqrt())
            .sum();
        assert!((mean / exact - 1.0).abs() < 1e-12, "{mean} {exact}");
    }
}
