//! A mesh whose rays are bent at the stop, as splats.

use dioptric_diffraction::{Covariance, Edge, Hurb};
use glam::DVec2;

use crate::{
    mesh::Mesh,
    ray_map::Node,
    ring::{Piece, Ring},
    splat::Splat,
};

/// A cell this many standard deviations across, both ways, is drawn as a polygon.
const POLYGON: f64 = 8.0;
/// A Gaussian whose wide axis is below this, in pixels, is not drawn.
const NARROW: f64 = 0.12;
/// The same where cells are at least this wide, pixels, in a blur of many pixels.
const NARROW_CELL: f64 = 0.5;
const PART_OF_A_PIXEL: f64 = 0.2;
/// The same where they are wider than a pixel.
const WIDE_CELL: f64 = 1.0;
const PART_OF_A_WIDE_CELL: f64 = 0.25;
/// How many standard deviations from the picture a cell is left out.
const FAR: f64 = 5.0;
/// Variance, pixels², that a pixel's own size adds when the need for subdivision is judged.
const PIXEL_VARIANCE: f64 = 0.12;
/// A piece of this many standard deviations across leaves a ripple of 2 %, which pixels and neighbours hide.
const PIECE: f64 = 2.7;

/// Uncertainty bending at the stop.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bending {
    pub(crate) model: Hurb,
    pub(crate) edge: Edge,
}

/// A mesh on pixels and the energies of its cells.
pub(crate) struct BentMesh<'a> {
    pub(crate) mesh: Mesh,
    /// In pixels.
    pub(crate) nodes: &'a [Node],
    pub(crate) bending: Bending,
    /// Rows and columns of the picture.
    pub(crate) size: (usize, usize),
}

impl BentMesh<'_> {
    /// Takes from the energies of the cells, ring by ring, what bending spreads, as splats.
    pub(crate) fn take(&self, energies: &mut [f64]) -> Vec<Splat> {
        let mut splats = Vec::with_capacity(2 * self.mesh.n_cells());
        for (number, energies) in energies.chunks_exact_mut(self.mesh.n_azimuths).enumerate() {
            let ring = Ring::new(self.mesh, number);
            for (j, energy) in energies.iter_mut().enumerate() {
                let corners = self.mesh.corners(number, j).map(|node| self.nodes[node]);
                let cell = Cell::new(corners, *energy, self.bending);
                if !cell.is_still() {
                    *energy = 0.0;
                    if !cell.is_beyond(self.size, self.bending) {
                        cell.bend(&mut splats, ring, self.bending);
                    }
                }
            }
        }
        splats
    }
}

impl Bending {
    /// Returns a ray with its Gaussian.
    #[inline(always)]
    fn bend(self, node: Node) -> Bent {
        let r = node.in_stop.length().min(1.0);
        let spread = self.model.spread(r * self.edge.radius_mm, self.edge.radius_mm, self.edge.wave_number_per_mm);
        let radial = node.in_stop.try_normalize().unwrap_or(DVec2::X);
        let on_film = |d: DVec2| node.along_l_mm * d.x + node.along_m_mm * d.y;
        let (radial, across) = (on_film(radial) * spread.radial, on_film(radial.perp()) * spread.across);
        Bent { at: node.at_mm, covariance: Covariance::along(radial).plus(Covariance::along(across)) }
    }
}

/// Where a ray lands, in pixels, and its Gaussian there.
#[derive(Clone, Copy)]
struct Bent {
    at: DVec2,
    covariance: Covariance,
}

/// A cell of the mesh with its corners: inner, outer, outer next, inner next.
struct Cell {
    corners: [Node; 4],
    energy: f64,
    middle: Bent,
    /// The wide axis of the Gaussian in the middle, pixels.
    wide: f64,
    /// The shorter of the cell's lengths outwards and around, pixels.
    least_length: f64,
    /// Both lengths in standard deviations, the pixel's included.
    n_sigmas: (f64, f64),
}

impl Cell {
    fn new(corners: [Node; 4], energy: f64, bending: Bending) -> Self {
        let middle = bending.bend(between(&corners, 0.5, 0.5));
        let (along, around) = sides(&corners, 0.5, 0.5);
        let widened = widened(middle.covariance);
        Self {
            corners,
            energy,
            middle,
            wide: middle.covariance.axes().1.sqrt(),
            least_length: along.length_squared().min(around.length_squared()).sqrt(),
            n_sigmas: (in_sigmas(along, widened), in_sigmas(around, widened)),
        }
    }

    /// Whether bending is so small beside the cell that it is drawn as it is.
    fn is_still(&self) -> bool {
        // Cells of a blur lie side by side: what one loses to its neighbour it gets back.
        let narrow = match self.least_length {
            side if side > WIDE_CELL => PART_OF_A_WIDE_CELL,
            side if side > NARROW_CELL => PART_OF_A_PIXEL,
            _ => NARROW,
        };
        self.wide < narrow || self.n_sigmas.0.min(self.n_sigmas.1) > POLYGON
    }

    /// Whether next to nothing of the cell's light, bent as at its middle and as near its outer side, meets the picture.
    fn is_beyond(&self, (rows, columns): (usize, usize), bending: Bending) -> bool {
        let [a, b, c, d] = self.corners.map(|node| node.at_mm);
        let (low, high) = (a.min(b).min(c.min(d)), a.max(b).max(c.max(d)));
        let end = DVec2::new(columns as f64, rows as f64);
        let is_apart = |low: DVec2, high: DVec2| high.cmplt(DVec2::ZERO).any() || low.cmpgt(end).any();
        if !is_apart(low, high) {
            return false;
        }
        let near_edge = bending.bend(between(&self.corners, 0.9, 0.5)).covariance.axes().1.sqrt();
        let reach = DVec2::splat(FAR * self.wide.max(near_edge));
        is_apart(low - reach, high + reach)
    }

    /// Adds the splats of the cell.
    fn bend(&self, splats: &mut Vec<Splat>, ring: Ring, bending: Bending) {
        let n_edge = ring.edge_pieces(self.wide);
        let n_tiles = ((self.n_sigmas.0 / PIECE).ceil() as usize).clamp(n_edge, 64);
        // Where the spread is wider than the pieces, Gauss's rule; where they lie side by side, equal ones. Wedges about the
        // middle hold the most of their light near their outer sides: drawn as even strips they would leave a dot there.
        if n_tiles == 1 && !ring.is_innermost() {
            self.add(splats, &Piece::WHOLE, self.middle, bending);
        } else if self.n_sigmas.0 < n_edge as f64 {
            ring.gauss_pieces(n_edge).for_each(|piece| self.add_piece(splats, &piece, bending));
        } else {
            ring.equal_pieces(n_tiles).for_each(|piece| self.add_piece(splats, &piece, bending));
        }
    }

    fn add_piece(&self, splats: &mut Vec<Splat>, piece: &Piece, bending: Bending) {
        self.add(splats, piece, bending.bend(between(&self.corners, piece.at, 0.5)), bending);
    }

    /// Adds the splats of a piece side by side around, each as wide as its Gaussian is long or narrow enough for it.
    fn add(&self, splats: &mut Vec<Splat>, piece: &Piece, middle: Bent, bending: Bending) {
        let (_, around) = sides(&self.corners, piece.at, 0.5);
        let n_long = (around.length_squared() / middle.covariance.axes().1).sqrt();
        let n_narrow = in_sigmas(around, widened(middle.covariance)) / PIECE;
        let n = n_long.min(n_narrow).ceil().clamp(1.0, 64.0) as usize;
        let energy = self.energy * piece.share_of_area / n as f64;
        for j in 0..n {
            let b = (j as f64 + 0.5) / n as f64;
            let Bent { at, covariance } =
                if n == 1 { middle } else { bending.bend(between(&self.corners, piece.at, b)) };
            let (along, _) = sides(&self.corners, piece.at, b);
            let covariance = covariance.plus(Covariance::along(along * (piece.step / 12f64.sqrt())));
            splats.push(Splat { at, covariance, side: around / n as f64, energy });
        }
    }
}

/// Returns what lies between corners, `a` of the way outwards and `b` around.
#[inline(always)]
fn between(corners: &[Node; 4], a: f64, b: f64) -> Node {
    let weights = [(1.0 - a) * (1.0 - b), a * (1.0 - b), a * b, (1.0 - a) * b];
    let mix = |of: fn(&Node) -> DVec2| -> DVec2 { corners.iter().zip(weights).map(|(node, w)| of(node) * w).sum() };
    Node {
        at_mm: mix(|n| n.at_mm),
        in_stop: mix(|n| n.in_stop),
        along_l_mm: mix(|n| n.along_l_mm),
        along_m_mm: mix(|n| n.along_m_mm),
    }
}

/// Returns the sides of a cell through a place in it: outwards and around.
#[inline(always)]
fn sides(corners: &[Node; 4], a: f64, b: f64) -> (DVec2, DVec2) {
    let [p, q, r, s] = [0, 1, 2, 3].map(|corner| corners[corner].at_mm);
    ((q - p) * (1.0 - b) + (r - s) * b, (s - p) * (1.0 - a) + (r - q) * a)
}

/// Returns a covariance with that of a pixel.
fn widened(c: Covariance) -> Covariance {
    Covariance { xx: c.xx + PIXEL_VARIANCE, yy: c.yy + PIXEL_VARIANCE, ..c }
}

/// Returns the length of a side in standard deviations of a Gaussian.
fn in_sigmas(side: DVec2, c: Covariance) -> f64 {
    let determinant = c.xx * c.yy - c.xy * c.xy;
    ((c.yy * side.x * side.x - 2.0 * c.xy * side.x * side.y + c.xx * side.y * side.y) / determinant).sqrt()
}
