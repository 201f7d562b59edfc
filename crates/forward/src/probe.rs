//! How fine the mesh of a layer must be, and on which raster each of its kernels lies.

use std::collections::{BTreeMap, BTreeSet};

use dioptric_psf::FilmMap;
use dioptric_spectrum::Cancelled;
use rayon::prelude::*;

use crate::{
    Settings,
    active::LARGEST_JOINED,
    block_layers::BlockLayers,
    cost::Cost,
    expansion::Expansion,
    film_lens::FilmLens,
    geometry::FilmFrame,
    knot_kernels::{KnotKernel, LayerKernels, Symmetry, edge_spread_peak},
    mesh::{Mesh, Weights},
    patch::{Cell, Knot, Patch, SMALLEST},
    raster::LayerRaster,
    work::Work,
};

/// Finds where the spline over a layer is too coarse.
pub(crate) struct Probe<'a> {
    lens: &'a FilmLens<'a>,
    layer: usize,
    /// Where layers have anything, in blocks of the pixels of a frame.
    content: (&'a BlockLayers, &'a FilmFrame),
    settings: &'a Settings,
    /// Wavelengths over which a blur is at its widest, nm.
    wavelengths_nm: &'a [f64],
    symmetry: Symmetry,
    /// The axis of the lens, where the layer's map has one. Where the pupil is cut off from the smallest fields on, on opposite sides of the axis, kernels change with the
    /// magnitude of the field there: the spline of cells that are large beside the blur rounds that off, and the middles of cells do not show it.
    axis: Option<Knot>,
    /// The spread of a point at canonical knots, pixels of the film.
    spreads_px: BTreeMap<Knot, f64>,
    /// Those computed so far, by the factor of the raster.
    kernels: BTreeMap<usize, LayerKernels>,
}

impl<'a> Probe<'a> {
    pub(crate) fn new(
        (lens, layer): (&'a FilmLens<'a>, usize),
        content: (&'a BlockLayers, &'a FilmFrame),
        settings: &'a Settings,
        wavelengths_nm: &'a [f64],
    ) -> Self {
        let symmetry = Symmetry::of(lens.image);
        let axis = match &lens.maps[layer] {
            FilmMap::Radial(map) => Some(Knot::nearest(map.axis_mm(), 1e-3 * lens.film.pitch_um)),
            FilmMap::Plane(_) | FilmMap::Shifted(_) => None,
        };
        Self {
            lens,
            layer,
            content,
            settings,
            wavelengths_nm,
            symmetry,
            axis,
            spreads_px: BTreeMap::new(),
            kernels: BTreeMap::new(),
        }
    }

    /// Which knots have kernels that follow from each other.
    pub(crate) fn symmetry(&self) -> Symmetry {
        self.symmetry
    }

    /// Returns the factor of the raster that the kernel of a knot is on: by the blur at the knot.
    pub(crate) fn factor_at(&mut self, knot: Knot) -> usize {
        LayerRaster::factor_for(self.spread_px(knot), self.settings.widest_blur_px)
    }

    #[inline(never)]
    fn spread_px(&mut self, knot: Knot) -> f64 {
        let canonical = self.symmetry.canonical(knot);
        let compute = || self.lens.spread_px(self.layer, canonical, self.wavelengths_nm);
        *self.spreads_px.entry(canonical).or_insert_with(compute)
    }

    /// Whether a cell lies farther beyond the film than a point in it is spread, of which 5 % is left for the film then, and than the smallest cells at its edge, whose
    /// splines take up the kernels beside them.
    fn is_beyond_reach(&mut self, cell: &Cell) -> bool {
        let film = self.lens.film;
        let at = cell.pixels(&FilmFrame::new(film, 1));
        let beyond = |first: i64, n: usize, film: usize| (-(first + n as i64)).max(first - film as i64).max(0) as f64;
        let (down, across) =
            (beyond(at.first_row, at.rows, film.rows), beyond(at.first_column, at.columns, film.columns));
        down.hypot(across) > self.spread_px(cell.knot()) + SMALLEST as f64
    }

    /// Whether the layer may have anything within a number of pixels of a cell.
    pub(crate) fn may_have_any(&self, cell: &Cell, margin_px: usize) -> bool {
        let (blocks, frame) = self.content;
        // A pixel reaches half of one beyond cells that hold its center.
        let margin = if frame.factor() == 1 { margin_px } else { margin_px.div_ceil(frame.factor()) + 1 };
        blocks.may_have_any(&cell.pixels(frame).grown(margin), self.layer)
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
        // The spline at the middle of each cell and on the axis, by the factor of the coarsest raster of its kernels.
        let mut splines: BTreeMap<usize, Vec<(Cell, Knot, Weights)>> = BTreeMap::new();
        for cell in cells {
            let is_large = cell.size > LARGEST_JOINED * self.factor_at(cell.knot());
            // The spline over a cell is that of the cells around it as well.
            if !is_large && (!self.may_have_any(&cell, cell.size) || self.is_beyond_reach(&cell)) {
                continue;
            }
            let weights = mesh.at_middle(&cell);
            let knots = weights.keys().copied().chain([cell.knot()]);
            let coarsest = knots.map(|knot| self.factor_at(knot)).max().unwrap_or(1);
            let may_divide = cell.is_divisible_to((PER_BLUR * widest_px * coarsest as f64) as usize);
            if is_large || may_divide && self.is_off_at_corners(mesh, &cell) {
                divided.insert(cell);
            } else if may_divide {
                let splines = splines.entry(coarsest).or_default();
                splines.push((cell, cell.knot(), weights));
                // The axis in its middle is looked at as it is.
                let axis = self.axis.filter(|axis| cell.holds(*axis) && *axis != cell.knot());
                splines.extend(axis.map(|axis| (cell, axis, mesh.at_place(&cell, axis))));
            }
        }
        let (mut shadings, mut on_axis) = (BTreeMap::new(), BTreeMap::new());
        for (factor, splines) in splines {
            for (cell, knot, SplineError { edge, shading }) in self.spline_errors(factor, &splines, work)? {
                if edge > self.settings.max_edge_error {
                    divided.insert(cell);
                }
                // What cells of another size, or other moments, do to a plane spans two of them at least.
                let left = what_blur_leaves(self.spread_px(cell.knot()) / (2 * cell.size) as f64);
                let shading = shading.times(left);
                let shadings = if knot == cell.knot() { &mut shadings } else { &mut on_axis };
                shadings.insert(cell, shading);
            }
        }
        divide_for_shading(&shadings, &on_axis, self.settings.max_shading_error, &mut divided);
        Ok(divided)
    }

    /// Returns by how much splines are off at places of cells.
    fn spline_errors(
        &mut self,
        factor: usize,
        splines: &[(Cell, Knot, Weights)],
        work: &Work<'_>,
    ) -> Result<Vec<(Cell, Knot, SplineError)>, Cancelled> {
        let symmetry = self.symmetry;
        let known = self.kernels.entry(factor).or_insert_with(|| LayerKernels::new(symmetry, BTreeMap::new()));
        let knots = splines.iter().flat_map(|(_, knot, weights)| weights.keys().copied().chain([*knot]));
        let wanted: BTreeSet<Knot> =
            knots.filter(|knot| !known.has(*knot)).map(|knot| symmetry.canonical(knot)).collect();
        let unobserved = Work::unobserved(work.cancel());
        let wanted = wanted.into_iter().map(|knot| (knot, factor));
        known.extend(self.lens.layer_kernels(self.layer, wanted, &unobserved)?);
        let error = |(cell, knot, weights): &(Cell, Knot, Weights)| {
            work.check()?;
            let difference = spline_error(known, *knot, weights);
            let edge = edge_spread_peak(&difference.samples, difference.at.columns);
            let shading = Shading::of(&difference, cell.size as f64 / factor as f64);
            Ok((*cell, *knot, SplineError { edge, shading }))
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
            let knots = around.map(|cell| cell.knot()).chain(patch.shares.iter().map(|(knot, _)| *knot));
            let kernel_size = self.kernel_size_of(knots.collect(), factor);
            Ok(Cost { n_terms: 9, n_across: 3, kernel_size })
        };
        patches.par_iter().map(cost).collect()
    }

    /// Returns about how many rows and columns of samples kernels have on a raster: as the first knot's whose kernel is known there, or on another raster, or by the spread of a
    /// point.
    fn kernel_size_of(&self, knots: Vec<Knot>, factor: usize) -> (usize, usize) {
        let known_on = |factor: usize, known: &LayerKernels| {
            let knot = knots.iter().find(|knot| known.has(**knot))?;
            Some((factor, known.window_at(*knot)))
        };
        let own = self.kernels.get(&factor).and_then(|known| known_on(factor, known));
        let other = || self.kernels.iter().find_map(|(factor, known)| known_on(*factor, known));
        if let Some((raster, window)) = own.or_else(other) {
            let [rows, columns] = [window.rows, window.columns].map(|n| (n * raster).div_ceil(factor));
            return (rows, columns);
        }
        let spread_px = |knot: &Knot| self.spreads_px.get(&self.symmetry.canonical(*knot));
        let widest_px = knots.iter().filter_map(spread_px).fold(0.0, |widest: f64, spread| widest.max(*spread));
        let width = 2 * (widest_px / factor as f64).ceil() as usize + 1;
        (width, width)
    }
}

/// Returns the kernel at a knot less that of a spline.
fn spline_error(kernels: &LayerKernels, knot: Knot, spline: &Weights) -> KnotKernel {
    let terms = spline.iter().map(|(&at, &weight)| (at, -weight)).chain([(knot, 1.0)]);
    let kernels: Vec<(KnotKernel, f32)> = terms.map(|(at, weight)| (kernels.at(at), weight as f32)).collect();
    let terms: Vec<(&KnotKernel, f32)> = kernels.iter().map(|(kernel, weight)| (kernel, *weight)).collect();
    KnotKernel::sum_of(&terms)
}

/// By how much a spline is off at a place of a cell.
struct SplineError {
    /// Largest error of the edge spread functions along rows and columns.
    edge: f64,
    shading: Shading,
}

/// By how much the moments of a spline are off at a place of a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Shading {
    /// Change of the irradiance of a uniform plane, were the cell halved and none around it; above or below 0.
    second: f64,
    /// How far the centroid is off, down and across, over the size of the cell.
    first: [f64; 2],
}

impl Shading {
    /// Returns that of the difference of a kernel from the spline: of second moments, by how much the irradiance of a uniform plane changes when it is
    /// added at knots half a cell apart, half the second derivative of the second moments (docs/forward.md, eq. 2).
    fn of(difference: &KnotKernel, cell_size: f64) -> Self {
        let [down, _, across] = difference.second_moments();
        // The spline of one knot has the second derivative −2 over the square of its cell.
        let half_cell = 0.5 * cell_size;
        Self {
            second: (down + across) / (half_cell * half_cell),
            first: difference.first_moments().map(|moment| moment / cell_size),
        }
    }

    fn times(self, factor: f64) -> Self {
        Self { second: self.second * factor, first: self.first.map(|moment| moment * factor) }
    }

    /// Returns how much of a plane the first moments, which are off by other amounts above, below, left and right as far as there are cells, draw together or
    /// apart at most: their largest slopes from cell to cell, down and across.
    fn spread_between(&self, vertical: [Option<&Self>; 2], horizontal: [Option<&Self>; 2]) -> f64 {
        let slope = |beside: [Option<&Self>; 2], i: usize| {
            beside.into_iter().flatten().map(|next| (next.first[i] - self.first[i]).abs()).fold(0.0, f64::max)
        };
        slope(vertical, 0) + slope(horizontal, 1)
    }
}

/// Marks cells of one size, beside those that are marked, whose halving or not would be seen on a uniform plane.
///
/// Where all cells are of one size the spline is off by the same second moments everywhere, which no uniform plane shows: only where cells of
/// two sizes meet, or where its curvature changes from cell to cell; of first moments, where they are off by more in one cell than in the next
/// (docs/forward.md 2).
fn divide_for_shading(
    shadings: &BTreeMap<Cell, Shading>,
    on_axis: &BTreeMap<Cell, Shading>,
    most: f64,
    divided: &mut BTreeSet<Cell>,
) {
    for (cell, shading) in shadings {
        let beside = |down: i32, across: i32| shadings.get(&cell.beside(down, across));
        let [above, below, left, right] = [beside(-1, 0), beside(1, 0), beside(0, -1), beside(0, 1)];
        // The curvature of the spline is that of each cell; a smooth one lies half-way where they meet.
        let steps = [above, below, left, right].into_iter().flatten().map(|next| next.second - shading.second);
        let has_step = steps.into_iter().any(|step| 0.5 * step.abs() > most);
        // Half the second derivative, by the middles around it.
        let has_peak = on_axis.get(cell).is_some_and(|axis| (axis.second - shading.second).abs() > most);
        if has_step || has_peak || shading.spread_between([above, below], [left, right]) > most {
            divided.insert(*cell);
        }
    }
    let mut border: Vec<Cell> = divided.iter().copied().collect();
    while let Some(cell) = border.pop() {
        let around = (-1..=1).flat_map(|down| (-1..=1).map(move |across| cell.beside(down, across)));
        for next in around {
            let is_seen = |shading: &Shading| shading.second.abs() > most;
            if shadings.get(&next).is_some_and(is_seen) && divided.insert(next) {
                border.push(next);
            }
        }
    }
}

/// Returns the share of a ripple that a blur leaves, whose radius is so many of its periods: that of an even disc, between its zeros.
fn what_blur_leaves(radius_per_period: f64) -> f64 {
    // |2 J₁(x) / x| is at most 1.6 x^(−3/2), x = 2π times the radius over the period.
    1.0 / (1.0 + (std::f64::consts::TAU * radius_per_period).powf(1.5) / 1.6)
}

#[cfg(test)]
mod tests {
    use dioptric_psf::LensImage;
    use dioptric_spectrum::Cancel;
    use glam::DVec2;

    use super::*;
    use crate::{
        DiscLens, Film,
        layers::{Blurs, Layers},
        stopwatch::Stopwatch,
    };

    /// Kernels on wide pixels counted as one sample each where none was known: patches that took nineteen transforms each by themselves were not spread by knots, and
    /// the demo through a singlet took three times as long.
    #[test]
    fn kernels_on_other_rasters_are_as_wide_as_they_will_be() {
        let lens = DiscLens { radius_um_per_dioptre: 8.0, ..DiscLens::default() };
        let film = Film::centered(64, 64, 1.0);
        let (wavelengths_nm, settings, stopwatch) = ([550.0], Settings::default(), Stopwatch::default());
        let blurs = Blurs { kernels: &lens, pitch_mm: 1e-3, fields: &[DVec2::ZERO], wavelengths_nm: &wavelengths_nm };
        let layers = Layers::over((20.0, 20.0), settings.layer_step_px, &blurs);
        let maps = [lens.film_map(20.0, 550.0, 1.0)];
        let film_lens = FilmLens {
            image: &lens,
            film: &film,
            layers: &layers,
            maps: &maps,
            wavelength_nm: 550.0,
            stopwatch: &stopwatch,
        };
        let knot = Knot { right: 64, down: -32 };
        let cancel = Cancel::new();
        let kernels_on =
            |factor: usize| film_lens.layer_kernels(0, [(knot, factor)], &Work::unobserved(&cancel)).unwrap();
        let (everything, frame) = (BlockLayers::of_everything(), FilmFrame::new(&film, 1));
        let mut probe = Probe::new((&film_lens, 0), (&everything, &frame), &settings, &wavelengths_nm);
        assert_eq!(probe.factor_at(knot), 4);
        let expected = kernels_on(4)[&knot].at;
        // By the spread of the point, which holds 95 % of its light, and by a kernel on the film's pixels, whose border of a sample on each side is narrower.
        let by_spread = probe.kernel_size_of(vec![knot], 4);
        probe.kernels.insert(1, LayerKernels::new(probe.symmetry, kernels_on(1)));
        let by_other = probe.kernel_size_of(vec![knot], 4);
        for (found, most) in [(by_spread, 4), (by_other, 2)] {
            let off = found.0.abs_diff(expected.rows).max(found.1.abs_diff(expected.columns));
            assert!(off <= most, "{found:?} {expected:?}");
        }
        probe.kernels.insert(4, LayerKernels::new(probe.symmetry, kernels_on(4)));
        assert_eq!(probe.kernel_size_of(vec![knot], 4), (expected.rows, expected.columns));
    }

    /// Returns the rows of cells that are marked, of rows from above down whose cells are all alike, once some are.
    fn marked(of_row: &[Shading], first: &[i32]) -> Vec<i32> {
        let cell = |down: i32, across: i32| Cell { down, across, size: 64 };
        let rows = of_row.iter().zip(0..);
        let cells = rows.flat_map(|(shading, down)| (-2..3).map(move |across| (cell(down, across), *shading)));
        let mut divided = first.iter().map(|&down| cell(down, 0)).collect();
        divide_for_shading(&cells.collect(), &BTreeMap::new(), 1e-3, &mut divided);
        (0..of_row.len() as i32).filter(|&down| divided.contains(&cell(down, 0))).collect()
    }

    fn second(values: &[f64]) -> Vec<Shading> {
        values.iter().map(|&second| Shading { second, ..Shading::default() }).collect()
    }

    #[test]
    fn even_curvature_is_seen_nowhere() {
        assert!(marked(&second(&[0.2; 6]), &[]).is_empty());
        assert!(marked(&second(&[0.200, 0.201, 0.202, 0.203]), &[]).is_empty());
    }

    #[test]
    fn steps_of_curvature_are_halved() {
        assert_eq!(marked(&second(&[1e-4, 2e-4, 5e-3, 5e-3, 4e-3, 3.5e-3, 9e-4]), &[]), [1, 2, 3, 4, 5, 6]);
        assert_eq!(marked(&second(&[1e-4, 2e-4, 2.5e-3, 9e-4, 1e-4]), &[]), [1, 2]);
    }

    #[test]
    fn peaks_on_the_axis_are_halved() {
        let cell = |down: i32| Cell { down, across: 0, size: 64 };
        let shading = |second: f64| Shading { second, ..Shading::default() };
        let middles = (-3..3).map(|down| (cell(down), shading(2e-4))).collect();
        let halved = |peak: f64| {
            let on_axis = [-1, 0].map(|down| (cell(down), shading(peak))).into();
            let mut divided = BTreeSet::new();
            divide_for_shading(&middles, &on_axis, 1e-3, &mut divided);
            divided
        };
        assert_eq!(halved(1.3e-3), BTreeSet::from([cell(-1), cell(0)]));
        assert!(halved(1.1e-3).is_empty());
    }

    #[test]
    fn sizes_meet_where_it_does_not_show() {
        let row = second(&[2e-3, 1.9e-3, 1.5e-3, 1.1e-3, 0.9e-3, 0.5e-3, 1.2e-3]);
        assert_eq!(marked(&row, &[1]), [0, 1, 2, 3]);
        assert!(marked(&row, &[]).is_empty());
    }

    #[test]
    fn centroids_that_are_off_unevenly_are_seen() {
        let rows = |values: &[f64]| -> Vec<Shading> {
            values.iter().map(|&down| Shading { first: [down, 0.0], ..Shading::default() }).collect()
        };
        assert!(marked(&rows(&[4e-3; 5]), &[]).is_empty());
        assert_eq!(marked(&rows(&[0.0, 1e-4, 2e-4, 5e-3, 5e-3]), &[]), [2, 3]);
    }

    #[test]
    fn wide_blur_leaves_little_of_small_cells() {
        assert_eq!(what_blur_leaves(0.0), 1.0);
        // 2 J₁(x)/x of a disc of that radius is −.067, and between its zeros .1 and .02 at most.
        assert!((0.067..0.1).contains(&what_blur_leaves(1.0)) && (0.015..0.025).contains(&what_blur_leaves(3.0)));
    }
}
