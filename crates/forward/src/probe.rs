//! How fine the mesh of a layer must be, and on which raster each of its kernels lies.

use std::collections::{BTreeMap, BTreeSet};

use dioptric_spectrum::Cancelled;
use rayon::prelude::*;

use crate::{
    Settings,
    active::LARGEST_JOINED,
    cost::Cost,
    expansion::Expansion,
    film_lens::FilmLens,
    knot_kernels::{KnotKernel, LayerKernels, Symmetry, edge_spread_peak},
    mesh::{Mesh, Weights},
    patch::{Cell, Knot, Patch},
    raster::LayerRaster,
    work::Work,
};

/// Finds where the spline over a layer is too coarse.
pub(crate) struct Probe<'a> {
    lens: &'a FilmLens<'a>,
    layer: usize,
    settings: &'a Settings,
    /// Wavelengths over which a blur is at its widest, nm.
    wavelengths_nm: &'a [f64],
    symmetry: Symmetry,
    /// The spread of a point at canonical knots, pixels of the film.
    spreads_px: BTreeMap<Knot, f64>,
    /// Those computed so far, by the factor of the raster.
    kernels: BTreeMap<usize, LayerKernels>,
}

impl<'a> Probe<'a> {
    pub(crate) fn new(
        (lens, layer): (&'a FilmLens<'a>, usize),
        settings: &'a Settings,
        wavelengths_nm: &'a [f64],
    ) -> Self {
        let symmetry = Symmetry::of(lens.image);
        Self { lens, layer, settings, wavelengths_nm, symmetry, spreads_px: BTreeMap::new(), kernels: BTreeMap::new() }
    }

    /// Which knots have kernels that follow from each other.
    pub(crate) fn symmetry(&self) -> Symmetry {
        self.symmetry
    }

    /// Returns the factor of the raster that the kernel of a knot is on: by the blur at the knot.
    pub(crate) fn factor_at(&mut self, knot: Knot) -> usize {
        LayerRaster::factor_for(self.spread_px(knot), self.settings.widest_blur_px)
    }

    fn spread_px(&mut self, knot: Knot) -> f64 {
        let canonical = self.symmetry.canonical(knot);
        let compute = || self.lens.spread_px(self.layer, canonical, self.wavelengths_nm);
        *self.spreads_px.entry(canonical).or_insert_with(compute)
    }

    /// Whether the spline is off by more than the settings allow at a corner of a cell, by the spread of a point alone: where cells are
    /// large beside what the blur changes over, the middles of cells around a sharp place all lie where it is wide.
    fn is_off_at_corners(&mut self, mesh: &Mesh, cell: &Cell) -> bool {
        /// By how much a change of a disc's radius by a part of itself changes the spread of an edge.
        const EDGE_PER_RADIUS: f64 = 0.25;
        /// What a pixel makes of a point, pixels.
        const LEAST_PX: f64 = 0.5;
        let corners = cell.corners().into_iter().zip(mesh.at_corners(cell));
        corners.into_iter().any(|(corner, weights)| {
            let own = self.spread_px(corner).max(LEAST_PX);
            let spline = weights.iter().map(|(knot, weight)| weight * self.spread_px(*knot).powi(2)).sum::<f64>();
            let spline = spline.max(0.0).sqrt().max(LEAST_PX);
            EDGE_PER_RADIUS * (spline - own).abs() > self.settings.max_edge_error * spline.max(own)
        })
    }

    /// Adds knots to a mesh, in the quarters of cells at whose middle the spline is off by more than the settings allow, and of
    /// those that are too large for the raster of their kernel; and of those around, where a change of size would be seen.
    pub(crate) fn refine(&mut self, mesh: &mut Mesh, cells: &[Cell], work: &Work<'_>) -> Result<(), Cancelled> {
        let mut candidates: Vec<Cell> = cells.iter().copied().filter(Cell::is_divisible).collect();
        while !candidates.is_empty() {
            let divided = self.divided(mesh, candidates, work)?;
            let added: Vec<Cell> = divided.iter().flat_map(Cell::children).collect();
            mesh.added.extend(added.iter().copied());
            candidates = added.into_iter().filter(Cell::is_divisible).collect();
        }
        work.advance(cells.len() as u64);
        Ok(())
    }

    /// Returns those of some cells of one size that are to be halved.
    fn divided(&mut self, mesh: &Mesh, cells: Vec<Cell>, work: &Work<'_>) -> Result<BTreeSet<Cell>, Cancelled> {
        /// The least size of a cell, parts of the blur radius up to which its raster serves.
        const PER_BLUR: f64 = 0.25;
        let widest_px = self.settings.widest_blur_px;
        let mut divided = BTreeSet::new();
        // The spline at the middle of each cell, by the factor of the coarsest raster of its kernels.
        let mut splines: BTreeMap<usize, Vec<(Cell, Weights)>> = BTreeMap::new();
        for cell in cells {
            let weights = mesh.at_middle(&cell);
            let knots = weights.keys().copied().chain([cell.knot()]);
            let coarsest = knots.map(|knot| self.factor_at(knot)).max().unwrap_or(1);
            let is_large = cell.size > LARGEST_JOINED * self.factor_at(cell.knot());
            let may_divide = cell.is_divisible_to((PER_BLUR * widest_px * coarsest as f64) as usize);
            if is_large || may_divide && self.is_off_at_corners(mesh, &cell) {
                divided.insert(cell);
            } else if may_divide {
                splines.entry(coarsest).or_default().push((cell, weights));
            }
        }
        let mut shadings: BTreeMap<Cell, f64> = BTreeMap::new();
        for (factor, splines) in splines {
            for (cell, SplineError { edge, shading }) in self.spline_errors(factor, &splines, work)? {
                if edge > self.settings.max_edge_error {
                    divided.insert(cell);
                }
                shadings.insert(cell, shading * what_blur_leaves(self.spread_px(cell.knot()) / cell.size as f64));
            }
        }
        divide_for_shading(&shadings, self.settings.max_shading_error, &mut divided);
        Ok(divided)
    }

    /// Returns by how much splines are off at the middles of cells.
    fn spline_errors(
        &mut self,
        factor: usize,
        splines: &[(Cell, Weights)],
        work: &Work<'_>,
    ) -> Result<Vec<(Cell, SplineError)>, Cancelled> {
        let symmetry = self.symmetry;
        let known = self.kernels.entry(factor).or_insert_with(|| LayerKernels::new(symmetry, BTreeMap::new()));
        let knots = splines.iter().flat_map(|(cell, weights)| weights.keys().copied().chain([cell.knot()]));
        let wanted: BTreeSet<Knot> =
            knots.filter(|knot| !known.has(*knot)).map(|knot| symmetry.canonical(knot)).collect();
        let unobserved = Work::unobserved(work.cancel());
        let wanted = wanted.into_iter().map(|knot| (knot, factor));
        known.extend(self.lens.layer_kernels(self.layer, wanted, &unobserved)?);
        let error = |(cell, weights): &(Cell, Weights)| {
            work.check()?;
            let difference = spline_error(known, cell.knot(), weights);
            let edge = edge_spread_peak(&difference.samples, difference.width);
            let shading = shading_error(&difference, cell.size as f64 / factor as f64);
            Ok((*cell, SplineError { edge, shading }))
        };
        splines.par_iter().map(error).collect()
    }

    /// Returns what patches on a raster take by themselves; `largest` is the size of whole cells.
    pub(crate) fn costs(
        &self,
        factor: usize,
        patches: &[Patch],
        largest: usize,
        work: &Work<'_>,
    ) -> Result<Vec<Cost>, Cancelled> {
        let nothing = LayerKernels::new(self.symmetry, BTreeMap::new());
        let known = self.kernels.get(&factor).unwrap_or(&nothing);
        let cost = |patch: &Patch| -> Result<Cost, Cancelled> {
            if patch.shares.iter().all(|(knot, _)| known.has(*knot)) {
                let kernels = patch.shares.iter().map(|(knot, _)| (*knot, known.at(*knot))).collect();
                return Ok(Expansion::of(patch, &kernels, self.settings.negligible_edge, work.cancel())?.cost());
            }
            // Knots of the smallest cells are not known yet: as wide as that of a cell around it, and changing in all ways.
            let around = std::iter::successors(Some(patch.cell), |cell| (cell.size < largest).then(|| cell.parent()));
            let mut knots = around.map(|cell| cell.knot()).chain(patch.shares.iter().map(|(knot, _)| *knot));
            let width = knots.find(|knot| known.has(*knot)).map_or(1, |knot| known.width_at(knot));
            Ok(Cost { n_terms: 9, n_across: 3, width })
        };
        patches.par_iter().map(cost).collect()
    }
}

/// Returns the kernel at a knot less that of a spline.
fn spline_error(kernels: &LayerKernels, knot: Knot, spline: &Weights) -> KnotKernel {
    let terms = || spline.iter().map(|(&at, &weight)| (at, -weight)).chain([(knot, 1.0)]);
    let kernels: Vec<(KnotKernel, f64)> = terms().map(|(at, weight)| (kernels.at(at), weight)).collect();
    let width = kernels.iter().map(|(kernel, _)| kernel.width).max().unwrap_or(1);
    let mut samples = vec![0.0; width * width];
    for (kernel, weight) in kernels {
        kernel.add_to(&mut samples, width, weight as f32);
    }
    KnotKernel { width, samples }
}

/// By how much a spline is off at the middle of a cell.
struct SplineError {
    /// Largest error of the edge spread functions along rows and columns.
    edge: f64,
    /// That of the irradiance of a uniform plane, were the cell halved and none around it; above or below 0.
    shading: f64,
}

/// Marks cells of one size, beside those that are marked, whose halving or not would be seen on a uniform plane.
///
/// Where all cells are of one size the spline is off by the same second moments everywhere, which no uniform plane shows: only where cells of
/// two sizes meet, or where its curvature changes from cell to cell (docs/forward.md 2).
fn divide_for_shading(shadings: &BTreeMap<Cell, f64>, most: f64, divided: &mut BTreeSet<Cell>) {
    let beside = |cell: &Cell| {
        let cell = *cell;
        let around = (-1..=1).flat_map(|down| (-1..=1).map(move |across| (down, across)));
        around.filter(|at| *at != (0, 0)).map(move |(down, across)| cell.beside(down, across))
    };
    for (cell, shading) in shadings {
        let steps =
            [(-1, 0), (1, 0), (0, -1), (0, 1)].into_iter().filter_map(|(d, a)| shadings.get(&cell.beside(d, a)));
        // The curvature of the spline is that of each cell; a smooth one lies half-way where they meet.
        if steps.into_iter().any(|next| 0.5 * (next - shading).abs() > most) {
            divided.insert(*cell);
        }
    }
    let mut border: Vec<Cell> = divided.iter().copied().collect();
    while let Some(cell) = border.pop() {
        for next in beside(&cell) {
            if shadings.get(&next).is_some_and(|shading| shading.abs() > most) && divided.insert(next) {
                border.push(next);
            }
        }
    }
}

/// Returns the share of a ripple of the period of a cell that a blur leaves, whose radius is so many cells: that of an even disc, between its zeros.
fn what_blur_leaves(radius_per_cell: f64) -> f64 {
    // |2 J₁(x) / x| is at most 1.6 x^(−3/2), x = 2π times the radius over the period.
    1.0 / (1.0 + (std::f64::consts::TAU * radius_per_cell).powf(1.5) / 1.6)
}

/// Returns by how much the irradiance of a uniform plane changes when a difference of kernels is added at knots half
/// a cell apart: half the second derivative of its second moments (docs/forward.md, eq. 2).
fn shading_error(difference: &KnotKernel, cell_size: f64) -> f64 {
    let width = difference.width;
    let middle = (width / 2) as f64;
    let moments = difference.samples.iter().enumerate().map(|(i, &sample)| {
        let (row, column) = ((i / width) as f64 - middle, (i % width) as f64 - middle);
        f64::from(sample) * (row * row + column * column)
    });
    // The spline of one knot has the second derivative −2 over the square of its cell.
    let half_cell = 0.5 * cell_size;
    moments.sum::<f64>() / (half_cell * half_cell)
}
