//! Pictures drawn from ray maps.

use dioptric_diffraction::{Covariance, Edge, Hurb};
use glam::DVec2;
use ndarray::Array2;

use crate::{
    Kernel,
    kernel::trim,
    mesh::Mesh,
    raster::Raster,
    ray_map::{Node, Record},
    splat::{self, Gaussian},
};

/// Half the side of the largest window, pixels.
const MOST_PIXELS: f64 = 600.0;
/// Of what the window of a diffracted picture holds, the share that is kept when the window is trimmed.
const KEPT_OF_TAILS: f64 = 0.999;
/// How far diffraction's tails are followed beyond the geometric picture, in units of λN.
const TAILS: f64 = 12.0;
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

/// Uncertainty bending at the stop.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bending {
    pub(crate) model: Hurb,
    pub(crate) edge: Edge,
}

/// A ray map turned to its field and scaled to pixels, and the window that holds it.
pub(crate) struct Layout<'a> {
    record: &'a Record,
    nodes: Vec<Node>,
    bending: Option<Bending>,
    /// The geometric picture's reach from the centroid, pixels.
    reach: f64,
    /// λN, pixels; 0 without diffraction.
    unit: f64,
    side: usize,
    /// The side that holds the picture.
    natural_side: usize,
}

impl<'a> Layout<'a> {
    /// Returns the layout of a ray map; `turn` is the direction of the field in the picture.
    pub(crate) fn new(record: &'a Record, turn: DVec2, bending: Option<Bending>, pitch_um: f64) -> Self {
        let scale = 1e3 / pitch_um;
        let mut nodes: Vec<Node> = (0..record.mesh.n_nodes()).map(|i| record.node(i)).collect();
        for node in &mut nodes {
            for v in [&mut node.at_mm, &mut node.along_l_mm, &mut node.along_m_mm] {
                // To pixels: columns to the right, rows down.
                *v = turn.rotate(*v) * DVec2::new(scale, -scale);
            }
        }
        let reach = nodes.iter().map(|node| node.at_mm.abs().max_element()).fold(0.0, f64::max);
        let unit = bending.map_or(0.0, |bending| unit(record, &nodes, bending));
        let half = (reach + TAILS * unit - 0.5).ceil().clamp(0.0, MOST_PIXELS) as usize;
        Self { record, nodes, bending, reach, unit, side: 2 * half + 1, natural_side: 2 * half + 1 }
    }

    /// Returns the layout with a window of so many pixels along its side, if any are asked for.
    pub(crate) fn with_side(self, side: Option<usize>) -> Self {
        Self { side: side.unwrap_or(self.side), ..self }
    }

    /// The side of the window in pixels; an odd number unless another was asked for.
    pub(crate) fn side(&self) -> usize {
        self.side
    }

    /// The range of phases B that a wave sum would have to follow, radians: over the pupil's radius, for light from
    /// its outermost ray to the corner of the window that holds the picture.
    pub(crate) fn bandwidth(&self) -> f64 {
        let corner = std::f64::consts::FRAC_1_SQRT_2 * self.natural_side as f64;
        std::f64::consts::PI * (self.reach + corner) / self.unit
    }

    /// Draws the energy of each pixel of the window.
    pub(crate) fn draw(mut self) -> Array2<f64> {
        let middle = DVec2::splat(0.5 * self.side as f64);
        self.nodes.iter_mut().for_each(|node| node.at_mm += middle);
        let record = self.record;
        let mut raster = Raster::new(self.side(), self.side());
        let mut energies: Vec<f64> = record.energies().iter().map(|e| f64::from(*e)).collect();
        if let Some(bending) = self.bending {
            // What is bent is deposited as Gaussians, and is then no part of the mesh.
            let mut gaussians = Vec::with_capacity(2 * record.mesh.n_cells());
            for (ring, energies) in energies.chunks_exact_mut(record.mesh.n_azimuths).enumerate() {
                let ring = Ring::new(record.mesh, ring);
                for (j, energy) in energies.iter_mut().enumerate() {
                    let corners = record.mesh.corners(ring.number, j).map(|node| self.nodes[node]);
                    let cell = Cell { corners, ring, energy: *energy };
                    if cell.bend(&mut gaussians, raster.size(), bending) {
                        *energy = 0.0;
                    }
                }
            }
            splat::deposit(&mut raster, &gaussians);
        }
        let at: Vec<DVec2> = self.nodes.iter().map(|node| node.at_mm).collect();
        raster.mesh(record.mesh, &at, &energies);
        raster.finish()
    }
}

/// Returns drawn energies as a kernel, trimmed to what matters.
pub(crate) fn kernel(energies: &Array2<f64>, is_diffracted: bool, pitch_um: f64) -> Kernel {
    let kept = if is_diffracted { KEPT_OF_TAILS } else { 1.0 - 1e-7 };
    Kernel { samples: trim(energies, kept), pitch_um }
}

/// Returns λN in pixels: what the Gaussian of a ray through the middle of the stop would give.
fn unit(record: &Record, nodes: &[Node], bending: Bending) -> f64 {
    let center = nodes[record.mesh.node(0, 0)];
    let per_cosine = center.along_l_mm.length().max(center.along_m_mm.length());
    let Edge { radius_mm, wave_number_per_mm } = bending.edge;
    per_cosine * std::f64::consts::PI / (wave_number_per_mm * radius_mm)
}

/// A ring of cells of the mesh.
#[derive(Clone, Copy)]
struct Ring {
    number: usize,
    /// How many rings there are from this one to the edge.
    n_to_edge: usize,
    /// The shares of the pupil's radius at both sides.
    inner_share: f64,
    outer_share: f64,
}

impl Ring {
    fn new(mesh: Mesh, number: usize) -> Self {
        let (inner_share, outer_share) = (mesh.share(number as f64), mesh.share((number + 1) as f64));
        Self { number, n_to_edge: mesh.n_rings - number, inner_share, outer_share }
    }

    /// Returns how many pieces its spread needs: it doubles over the last few.
    fn edge_pieces(self, is_blurred: bool) -> usize {
        match (self.n_to_edge, is_blurred) {
            (1, false) => 6,
            (1, true) => 3,
            (2 | 3, false) => 3,
            (4..=6, false) => 2,
            _ => 1,
        }
    }
}

/// A cell of the mesh with its corners: inner, outer, outer next, inner next.
struct Cell {
    corners: [Node; 4],
    ring: Ring,
    energy: f64,
}

impl Cell {
    /// Returns what lies between the corners, `a` of the way outwards and `b` around.
    fn at(&self, a: f64, b: f64) -> Node {
        let weights = [(1.0 - a) * (1.0 - b), a * (1.0 - b), a * b, (1.0 - a) * b];
        let mix =
            |of: fn(&Node) -> DVec2| -> DVec2 { self.corners.iter().zip(weights).map(|(node, w)| of(node) * w).sum() };
        Node {
            at_mm: mix(|n| n.at_mm),
            in_stop: mix(|n| n.in_stop),
            along_l_mm: mix(|n| n.along_l_mm),
            along_m_mm: mix(|n| n.along_m_mm),
        }
    }

    /// Whether next to nothing of the cell's light, bent as at its middle and as near its outer side, meets the picture.
    fn is_beyond(&self, (rows, columns): (usize, usize), bending: Bending) -> bool {
        let spread = [0.5, 0.9].map(|a| bending.covariance(&self.at(a, 0.5)).axes().1.sqrt());
        let reach = DVec2::splat(FAR * spread[0].max(spread[1]));
        let [a, b, c, d] = self.corners.map(|node| node.at_mm);
        let (low, high) = (a.min(b).min(c.min(d)) - reach, a.max(b).max(c.max(d)) + reach);
        high.x < 0.0 || high.y < 0.0 || low.x > columns as f64 || low.y > rows as f64
    }

    /// Returns the sides of the cell through a place in it: outwards and around.
    fn sides(&self, a: f64, b: f64) -> (DVec2, DVec2) {
        let [p, q, r, s] = self.corners.map(|node| node.at_mm);
        ((q - p) * (1.0 - b) + (r - s) * b, (s - p) * (1.0 - a) + (r - q) * a)
    }

    /// Adds the Gaussians of a cell whose rays are bent, unless bending is so small beside it that a polygon will do.
    fn bend(&self, gaussians: &mut Vec<Gaussian>, size: (usize, usize), bending: Bending) -> bool {
        let (along, around) = self.sides(0.5, 0.5);
        let covariance = bending.covariance(&self.at(0.5, 0.5));
        let (_, wide) = covariance.axes();
        let widened =
            Covariance { xx: covariance.xx + PIXEL_VARIANCE, yy: covariance.yy + PIXEL_VARIANCE, ..covariance };
        let (n_along, n_around) = (in_sigmas(along, widened), in_sigmas(around, widened));
        // Cells of a blur lie side by side: what one loses to its neighbour it gets back.
        let narrow = match along.length().min(around.length()) {
            side if side > WIDE_CELL => PART_OF_A_WIDE_CELL,
            side if side > NARROW_CELL => PART_OF_A_PIXEL,
            _ => NARROW,
        };
        if wide < narrow * narrow || (n_along > POLYGON && n_around > POLYGON) {
            return false;
        }
        if self.is_beyond(size, bending) {
            return true;
        }
        // A piece of this many standard deviations across leaves a ripple of 2 %, which pixels and neighbours hide.
        const PIECE: f64 = 2.7;
        let pieces = |n_sigmas: f64| (n_sigmas / PIECE).ceil().clamp(1.0, 64.0) as usize;
        // Out of focus, where a cell is larger than a pixel, the tails of single rings hardly show.
        let is_blurred = around.length() > 1.0;
        let n_along = pieces(n_along).max(self.ring.edge_pieces(is_blurred));
        self.add_pieces(gaussians, (n_along, pieces(n_around)), bending);
        true
    }

    /// Adds a Gaussian for each of so many pieces outwards and around.
    fn add_pieces(&self, gaussians: &mut Vec<Gaussian>, (n_along, n_around): (usize, usize), bending: Bending) {
        let (share_inner, share_outer) = (self.ring.inner_share, self.ring.outer_share);
        let whole = share_outer * share_outer - share_inner * share_inner;
        // Pieces crowd towards the edge like rings do, only more so: there the spread grows like 1/distance.
        let (gap_inner, gap_outer) = ((1.0 - share_inner).sqrt(), (1.0 - share_outer).max(0.0).sqrt());
        let share = |i: usize| 1.0 - (gap_inner + (gap_outer - gap_inner) * i as f64 / n_along as f64).powi(2);
        for i in 0..n_along {
            let (inner, outer) = (share(i), share(i + 1));
            let place = |share: f64| (share - share_inner) / (share_outer - share_inner);
            let (a, step_a) = (place(0.5 * (inner + outer)), place(outer) - place(inner));
            let energy = self.energy * (outer * outer - inner * inner) / whole / n_around as f64;
            for j in 0..n_around {
                let b = (j as f64 + 0.5) / n_around as f64;
                let node = self.at(a, b);
                let (along, around) = self.sides(a, b);
                let footprint = |side: DVec2| Covariance::along(side / 12f64.sqrt());
                let covariance =
                    bending.covariance(&node).plus(footprint(along * step_a)).plus(footprint(around / n_around as f64));
                gaussians.push(Gaussian { at: node.at_mm, covariance, energy });
            }
        }
    }
}

impl Bending {
    /// Returns the covariance on the film of a ray's Gaussian, pixels².
    fn covariance(self, node: &Node) -> Covariance {
        let r = node.in_stop.length().min(1.0);
        let spread = self.model.spread(r * self.edge.radius_mm, self.edge.radius_mm, self.edge.wave_number_per_mm);
        let radial = node.in_stop.try_normalize().unwrap_or(DVec2::X);
        let on_film = |d: DVec2| node.along_l_mm * d.x + node.along_m_mm * d.y;
        Covariance::along(on_film(radial) * spread.radial)
            .plus(Covariance::along(on_film(radial.perp()) * spread.across))
    }
}

/// Returns the length of a side in standard deviations of a Gaussian.
fn in_sigmas(side: DVec2, c: Covariance) -> f64 {
    let determinant = c.xx * c.yy - c.xy * c.xy;
    ((c.yy * side.x * side.x - 2.0 * c.xy * side.x * side.y + c.xx * side.y * side.y) / determinant).sqrt()
}
