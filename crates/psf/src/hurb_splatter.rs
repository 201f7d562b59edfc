//! A pupil mesh whose rays HURB spreads at the stop, as Gaussians on pixels.
//!
//! The derivation is in `docs/hurb.md`, which comments name by its equations.

use dioptric_diffraction::{Covariance, Hurb, StopEdge};
use dioptric_optics::MonoLens;
use dioptric_optics::StopPoint;
use glam::DVec2;
use multiversion::multiversion;

use crate::{
    Diffraction,
    blurred_edge::LANES,
    mesh::Mesh,
    raster::Raster,
    ring::{Cut, PIECE, Piece, Ring},
    splat::{Splat, SplatBuffer, Splats},
    spots::Node,
};

/// A cell this many standard deviations across, both ways, is drawn as a polygon.
const POLYGON: f64 = 8.0;
/// Of cells wider than so many pixels, the least wide axis of a Gaussian that is drawn, pixels: the cells of a blur lie side by side, and what one loses to its
/// neighbor it gets back.
const NARROW: [(f64, f64); 3] = [(0.0, 0.12), (0.5, 0.2), (1.0, 0.25)];
/// How many standard deviations from the picture a cell is left out.
const FAR: f64 = 5.0;
/// Variance, pixels², that a pixel's own size adds when the need for subdivision is judged.
const PIXEL_VARIANCE: f64 = 0.12;
/// How much of the distance by which neighbors' Gaussians come apart at one standard deviation each is made softer.
const FAN: f64 = 1.5;

/// Uncertainty bending at the stop.
#[derive(Clone, Debug)]
pub(crate) struct StopHurb {
    pub(crate) model: Hurb,
    pub(crate) edge: StopEdge,
}

/// Returns what bends rays at the stop.
pub(crate) fn bending(lens: &MonoLens, diffraction: Diffraction) -> Option<StopHurb> {
    diffraction.hurb().map(|model| StopHurb { model, edge: StopEdge::of(lens) })
}

impl StopHurb {
    /// Returns the Gaussian of a ray on the film, pixels².
    #[inline(always)]
    fn covariance(&self, node: &Node) -> Covariance {
        // Project the spread at the stop onto the film: Σ = J C Jᵀ (eqs. 3 and 4).
        let circle = self.edge.circle();
        let at = StopPoint { mm: node.in_stop * circle.radius_mm };
        let at_stop = match self.edge.is_round() {
            true => self.model.covariance(at, circle),
            false => self.model.covariance_at(at, &self.edge),
        };
        at_stop.mapped(node.along_l_mm, node.along_m_mm)
    }

    /// Returns the Gaussians of eight rays on the film, pixels²: those of a round stop without a branch.
    #[inline(always)]
    fn covariances(&self, samples: &[Sample; LANES]) -> [Covariance; LANES] {
        let mut found = [Covariance { xx: 0.0, xy: 0.0, yy: 0.0 }; LANES];
        if self.edge.is_round() {
            let (model, circle) = (self.model, self.edge.circle());
            for i in 0..LANES {
                let node = &samples[i].node;
                let at_stop = model.covariance(StopPoint { mm: node.in_stop * circle.radius_mm }, circle);
                found[i] = at_stop.mapped(node.along_l_mm, node.along_m_mm);
            }
        } else {
            for i in 0..LANES {
                found[i] = self.covariance(&samples[i].node);
            }
        }
        found
    }
}

/// A mesh on pixels and the energies of its cells.
pub(crate) struct HurbSplatter<'a> {
    pub(crate) mesh: Mesh,
    /// In pixels.
    pub(crate) nodes: &'a [Node],
    pub(crate) bending: &'a StopHurb,
    /// Rows and columns of the picture.
    pub(crate) size: (usize, usize),
}

impl HurbSplatter<'_> {
    /// Takes from the energies of the cells what bending spreads, and deposits it.
    pub(crate) fn deposit(&self, energies: &mut [f64], raster: &mut Raster) {
        let mut bent = SpreadCells { azimuth_step: self.mesh.azimuth(1.0), ..SpreadCells::default() };
        let (mut splats, mut film) = (Splats::default(), None);
        for (number, energies) in energies.chunks_exact_mut(self.mesh.n_azimuths).enumerate() {
            draw_ring(self, number, energies, &mut bent, &mut splats);
            if !splats.is_empty() {
                film.get_or_insert_with(|| SplatBuffer::new(self.size)).add(&splats);
                splats.clear();
            }
        }
        if let Some(film) = film {
            film.add_to(raster);
        }
    }

    /// Takes the cells of a ring that bending spreads.
    #[inline(always)]
    fn take_ring(&self, number: usize, energies: &mut [f64], bent: &mut SpreadCells) {
        let ring = Ring::new(self.mesh, number);
        bent.clear();
        for (group, energies) in energies.chunks_mut(LANES).enumerate() {
            let mut cells = [Cell::default(); LANES];
            let mut middles = [Sample::default(); LANES];
            // The Gaussians in the middles of eight cells.
            for i in 0..energies.len() {
                let [a, b, c, d] = self.mesh.corners(number, group * LANES + i);
                cells[i] = Cell { corners: [self.nodes[a], self.nodes[b], self.nodes[c], self.nodes[d]] };
                middles[i] = cells[i].sample(0.5, 0.5);
            }
            let looks = Looks::new(&middles, self.bending);
            // Leave narrow ones to polygons, cut the others into pieces outwards.
            for (i, energy) in energies.iter_mut().enumerate() {
                if !looks.is_still(i) {
                    let energy = std::mem::take(energy);
                    if !cells[i].is_beyond(looks.wide2[i], self.size, self.bending) {
                        bent.add(
                            &cells[i],
                            energy,
                            ring.cut(looks.wide2[i].sqrt(), looks.out_in_sigmas2[i].sqrt()),
                            ring,
                        );
                    }
                }
            }
        }
    }
}

#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
fn draw_ring(mesh: &HurbSplatter, number: usize, energies: &mut [f64], bent: &mut SpreadCells, splats: &mut Splats) {
    mesh.take_ring(number, energies, bent);
    bent.draw(mesh.bending, splats);
}

/// Cells of a ring that bending spreads, and the parts of them that are drawn.
#[derive(Default)]
struct SpreadCells {
    cells: Vec<Cell>,
    parts: Vec<Part>,
    /// Parts of those parts, side by side around.
    side_by_side: Vec<Part>,
    /// How the last cell was cut, and its pieces: those of others are often the same.
    cut: Option<Cut>,
    pieces: Vec<Piece>,
    /// The azimuth from one cell to the next, radians.
    azimuth_step: f64,
}

/// A part of a cell.
#[derive(Clone, Copy)]
struct Part {
    /// The number of its cell.
    cell: usize,
    /// Its middle and its lengths as shares of the cell, outwards and around.
    middle: (f64, f64),
    lengths: (f64, f64),
    energy: f64,
}

impl SpreadCells {
    fn clear(&mut self) {
        self.cells.clear();
        self.parts.clear();
        self.side_by_side.clear();
        self.cut = None;
    }

    /// Adds the pieces of a cell.
    #[inline(always)]
    fn add(&mut self, cell: &Cell, energy: f64, cut: Cut, ring: Ring) {
        if self.cut != Some(cut) {
            self.cut = Some(cut);
            self.pieces = ring.pieces(cut);
        }
        let number = self.cells.len();
        self.cells.push(*cell);
        for piece in &self.pieces {
            let energy = energy * piece.share_of_area;
            self.parts.push(Part { cell: number, middle: (piece.at, 0.5), lengths: (piece.step, 1.0), energy });
        }
    }

    /// Draws the parts as splats side by side around, each as wide as its Gaussian is long or narrow enough for it.
    #[inline(always)]
    fn draw(&mut self, bending: &StopHurb, splats: &mut Splats) {
        // Parts no longer around than their Gaussians are wide, and those to be cut around.
        for parts in self.parts.chunks(LANES) {
            let samples = samples(&self.cells, parts);
            let looks = Looks::new(&samples, bending);
            for (i, part) in parts.iter().enumerate() {
                let n = looks.n_around(i);
                if n == 1 {
                    splats.push(looks.splat(&samples[i], part, (i, self.azimuth_step)));
                } else {
                    let share = 1.0 / f64::from(n);
                    self.side_by_side.extend((0..n).map(|j| Part {
                        middle: (part.middle.0, (f64::from(j) + 0.5) * share),
                        lengths: (part.lengths.0, share),
                        energy: part.energy * share,
                        ..*part
                    }));
                }
            }
        }
        // The parts of those that were cut.
        for parts in self.side_by_side.chunks(LANES) {
            let samples = samples(&self.cells, parts);
            let looks = Looks::new(&samples, bending);
            for (i, part) in parts.iter().enumerate() {
                splats.push(looks.splat(&samples[i], part, (i, self.azimuth_step)));
            }
        }
    }
}

/// Returns the rays in the middles of up to eight parts of cells.
#[inline(always)]
fn samples(cells: &[Cell], parts: &[Part]) -> [Sample; LANES] {
    let mut samples = [Sample::default(); LANES];
    for (sample, part) in samples.iter_mut().zip(parts) {
        *sample = cells[part.cell].sample(part.middle.0, part.middle.1);
    }
    samples
}

/// A cell of the mesh with its corners: inner, outer, outer next, inner next.
#[derive(Clone, Copy, Default)]
struct Cell {
    corners: [Node; 4],
}

/// A ray between the corners of a cell, and the cell's sides through it, outwards and around, pixels.
#[derive(Clone, Copy, Default)]
struct Sample {
    node: Node,
    out: DVec2,
    around: DVec2,
}

impl Cell {
    /// Returns what lies `a` of the way outwards and `b` around.
    #[inline(always)]
    fn sample(&self, a: f64, b: f64) -> Sample {
        let [p, q, r, s] = &self.corners;
        let weights = [(1.0 - a) * (1.0 - b), a * (1.0 - b), a * b, (1.0 - a) * b];
        let mix = |p: DVec2, q: DVec2, r: DVec2, s: DVec2| {
            (p * weights[0] + q * weights[1]) + (r * weights[2] + s * weights[3])
        };
        Sample {
            node: Node {
                at_mm: mix(p.at_mm, q.at_mm, r.at_mm, s.at_mm),
                in_stop: mix(p.in_stop, q.in_stop, r.in_stop, s.in_stop),
                along_l_mm: mix(p.along_l_mm, q.along_l_mm, r.along_l_mm, s.along_l_mm),
                along_m_mm: mix(p.along_m_mm, q.along_m_mm, r.along_m_mm, s.along_m_mm),
            },
            out: (q.at_mm - p.at_mm) * (1.0 - b) + (r.at_mm - s.at_mm) * b,
            around: (s.at_mm - p.at_mm) * (1.0 - a) + (r.at_mm - q.at_mm) * a,
        }
    }

    /// Whether next to nothing of the cell's light, bent as at its middle, with the variance given, and as near its outer
    /// side, meets the picture.
    #[inline(always)]
    fn is_beyond(&self, wide2: f64, (rows, columns): (usize, usize), bending: &StopHurb) -> bool {
        let [a, b, c, d] = self.corners.map(|node| node.at_mm);
        let (low, high) = (a.min(b).min(c.min(d)), a.max(b).max(c.max(d)));
        let end = DVec2::new(columns as f64, rows as f64);
        let is_apart = |low: DVec2, high: DVec2| high.cmplt(DVec2::ZERO).any() || low.cmpgt(end).any();
        if !is_apart(low, high) {
            return false;
        }
        let near_edge = bending.covariance(&self.sample(0.9, 0.5).node).axes().1;
        let reach = DVec2::splat(FAR * wide2.max(near_edge).sqrt());
        is_apart(low - reach, high + reach)
    }
}

/// The Gaussians of eight rays, pixels², and how the cells about them compare. The compiler makes vectors of it: nothing in
/// its setup branches.
struct Looks {
    covariance: [[f64; LANES]; 3],
    /// The variance along the wide axis.
    wide2: [f64; LANES],
    /// The squares of the sides outwards and around, pixels², and in standard deviations, a pixel's included.
    out2: [f64; LANES],
    around2: [f64; LANES],
    out_in_sigmas2: [f64; LANES],
    around_in_sigmas2: [f64; LANES],
}

impl Looks {
    #[inline(always)]
    fn new(samples: &[Sample; LANES], bending: &StopHurb) -> Self {
        let none = [0.0; LANES];
        let (mut covariance, mut wide2) = ([none; 3], none);
        let (mut out2, mut around2, mut out_in_sigmas2, mut around_in_sigmas2) = (none, none, none, none);
        let covariances = bending.covariances(samples);
        for i in 0..LANES {
            let (Sample { out, around, .. }, c) = (samples[i], covariances[i]);
            let widened = Covariance { xx: c.xx + PIXEL_VARIANCE, yy: c.yy + PIXEL_VARIANCE, ..c };
            (covariance[0][i], covariance[1][i], covariance[2][i]) = (c.xx, c.xy, c.yy);
            wide2[i] = c.axes().1;
            out2[i] = out.length_squared();
            around2[i] = around.length_squared();
            out_in_sigmas2[i] = in_sigmas2(out, widened);
            around_in_sigmas2[i] = in_sigmas2(around, widened);
        }
        Self { covariance, wide2, out2, around2, out_in_sigmas2, around_in_sigmas2 }
    }

    /// Whether bending is so small beside the cell that it is drawn as it is.
    #[inline(always)]
    fn is_still(&self, i: usize) -> bool {
        let side2 = self.out2[i].min(self.around2[i]);
        let of_side = |narrow: f64, (side, of_side): (f64, f64)| if side2 > side * side { of_side } else { narrow };
        let narrow = NARROW.into_iter().fold(NARROW[0].1, of_side);
        self.wide2[i] < narrow * narrow || self.out_in_sigmas2[i].min(self.around_in_sigmas2[i]) > POLYGON * POLYGON
    }

    /// Returns how many splats side by side a part needs that has a cell's whole length around.
    #[inline(always)]
    fn n_around(&self, i: usize) -> u32 {
        let (long2, narrow2) = (self.around2[i] / self.wide2[i], self.around_in_sigmas2[i] / (PIECE * PIECE));
        long2.min(narrow2).sqrt().ceil().clamp(1.0, 64.0) as u32
    }

    /// Returns the splat of a part.
    ///
    /// Gaussians along the radii of the stop fan out. Far from a blur's edge the splats of neighbors would leave gaps, 48
    /// spokes, so each is softened across by how far it comes apart from the next; but by less than a part's own side,
    /// for in focus they all meet in the middle.
    #[inline(always)]
    fn splat(&self, sample: &Sample, part: &Part, (i, azimuth_step): (usize, f64)) -> Splat {
        let [xx, xy, yy] = [self.covariance[0][i], self.covariance[1][i], self.covariance[2][i]];
        // Fold the side outwards into the covariance; the one around stays an even side (eq. 7).
        let along = Covariance::along(sample.out * (part.lengths.0 / 12f64.sqrt()));
        let side = sample.around * part.lengths.1;
        // Soften along the side around by what neighbors come apart at one standard deviation (eq. 7a).
        let (apart, side2) = (self.wide2[i] * (azimuth_step * part.lengths.1).powi(2), side.length_squared());
        let softness = FAN * apart * side2 / ((apart + side2) * (apart + side2)).max(f64::MIN_POSITIVE);
        let fan = Covariance {
            xx: softness * side.x * side.x,
            xy: softness * side.x * side.y,
            yy: softness * side.y * side.y,
        };
        Splat {
            at: sample.node.at_mm,
            covariance: Covariance { xx, xy, yy }.plus(along).plus(fan),
            side,
            energy: part.energy,
        }
    }
}

/// Returns the square of a side's length in standard deviations of a Gaussian.
#[inline(always)]
fn in_sigmas2(side: DVec2, c: Covariance) -> f64 {
    let determinant = c.xx * c.yy - c.xy * c.xy;
    (c.yy * side.x * side.x - 2.0 * c.xy * side.x * side.y + c.xx * side.y * side.y) / determinant
}
