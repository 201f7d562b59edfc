//! The film cut into square cells, and PSFs that change smoothly across them.
//!
//! Over a layer the kernel is a quadratic B-spline of the place on the film (docs/forward.md): each cell has a knot at its middle,
//! and the kernel at a place is a mean, with smooth weights that sum to 1, of those of the nine knots around it. Where that is
//! not near enough to the kernel of the lens, cells are halved and knots added; a coarser spline is a finer one as well
//! (Chaikin's subdivision), so cells of different size meet smoothly.

use std::collections::{BTreeMap, BTreeSet};

use dioptric_psf::{FilmMap, LensImage, PsfQuery};
use dioptric_spectrum::{Cancel, Cancelled};
use ndarray::Array2;
use rayon::prelude::*;

use crate::{
    Film, Settings,
    cost::{Cost, patches_by_knots},
    expansion::Expansion,
    knot_kernels::{KnotKernel, LayerKernels, Symmetry, edge_spread_peak},
    layers::Layers,
    patch::{Cell, Knot, Patch},
    raster::LayerRaster,
    sampler::Sampler,
    stopwatch::{Part, Stopwatch},
    work::Work,
};

/// Weights of three knots in a row at the middle of the second's cell.
const AT_MIDDLE: [f64; 3] = [0.125, 0.75, 0.125];

/// From the coefficients of three knots in a row to those of the polynomials 1, u and u² − 1/12 in the second's cell,
/// where u runs from −1/2 to 1/2.
const TO_POLYNOMIALS: [[f64; 3]; 3] = [[1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0], [-0.5, 0.0, 0.5], [0.5, -1.0, 0.5]];

/// Returns the cells of a film and of a border of `pad_px` around it.
pub(crate) fn cells_over(film: &Film, pad_px: usize, size: usize) -> Vec<Cell> {
    let reach = |n: usize| ((0.5 * n as f64 + pad_px as f64) / size as f64).ceil() as i32;
    let (columns, rows) = (reach(film.columns), reach(film.rows));
    (-rows..rows).flat_map(|down| (-columns..columns).map(move |across| Cell { down, across, size })).collect()
}

/// Cells are not joined to larger ones than this, pixels.
const LARGEST_JOINED: usize = 512;

/// Returns the cells that hold these, at least as wide as a blur: of smaller ones, transforms are mostly border.
pub(crate) fn joined_for(blur_px: f64, mut cells: Vec<Cell>) -> Vec<Cell> {
    while cells.first().is_some_and(|cell| (cell.size as f64) < blur_px && 2 * cell.size <= LARGEST_JOINED) {
        let parents: BTreeSet<Cell> = cells.iter().map(Cell::parent).collect();
        cells = parents.into_iter().collect();
    }
    cells
}

/// A mesh of cells over a layer: those of one size, and halves of them where knots were added.
struct Mesh {
    size: usize,
    /// Smaller cells whose knot has a kernel of its own.
    added: BTreeSet<Cell>,
}

/// Knots with weights.
type Weights = BTreeMap<Knot, f64>;

impl Mesh {
    /// Returns the spline's coefficient at the knot of a cell: a kernel of its own, or what the coarser spline comes to.
    fn coefficient(&self, cell: &Cell) -> Weights {
        if cell.size == self.size || self.added.contains(cell) {
            return BTreeMap::from([(cell.knot(), 1.0)]);
        }
        // Three quarters of the coarser cell that it lies in, one of the next in its direction, each way.
        let parent = cell.parent();
        let toward = |place: i32| if place.rem_euclid(2) == 0 { -1 } else { 1 };
        let (down, across) = (toward(cell.down), toward(cell.across));
        let parents = [(0, 0, 9.0), (down, 0, 3.0), (0, across, 3.0), (down, across, 1.0)];
        let terms = parents.map(|(down, across, weight)| (parent.beside(down, across), weight / 16.0));
        self.sum(terms.into_iter())
    }

    /// Returns a weighted sum of coefficients.
    fn sum(&self, terms: impl Iterator<Item = (Cell, f64)>) -> Weights {
        let mut sum = Weights::new();
        for (cell, weight) in terms {
            for (knot, part) in self.coefficient(&cell) {
                *sum.entry(knot).or_default() += weight * part;
            }
        }
        sum
    }

    /// Returns the weights of knots in the kernel at the middle of a cell.
    fn at_middle(&self, cell: &Cell) -> Weights {
        self.sum(around(cell).map(|(cell, [down, across])| (cell, AT_MIDDLE[down] * AT_MIDDLE[across])))
    }

    /// Whether knots were added whose weight is not zero all over a cell, so that it is no polynomial.
    fn is_divided(&self, cell: &Cell) -> bool {
        let quarter = cell.children()[0];
        let mut near = (-1..=2).flat_map(|down| (-1..=2).map(move |across| (down, across)));
        near.any(|(down, across)| self.added.contains(&quarter.beside(down, across)))
    }

    /// Puts the patches of a cell, or of its parts, into `patches`.
    fn patches_of(&self, cell: Cell, patches: &mut Vec<Patch>) {
        if cell.is_divisible() && self.is_divided(&cell) {
            cell.children().into_iter().for_each(|child| self.patches_of(child, patches));
            return;
        }
        let mut shares: BTreeMap<Knot, [f64; 9]> = BTreeMap::new();
        for (near, [down, across]) in around(&cell) {
            for (knot, part) in self.coefficient(&near) {
                let share = shares.entry(knot).or_default();
                for (i, share) in share.iter_mut().enumerate() {
                    *share += part * TO_POLYNOMIALS[i / 3][down] * TO_POLYNOMIALS[i % 3][across];
                }
            }
        }
        let shares = shares.into_iter().map(|(knot, share)| (knot, share.map(|s| s as f32))).collect();
        patches.push(Patch { cell, is_by_knots: false, shares });
    }
}

/// Returns a cell and those around it, each with its number down and across.
fn around(cell: &Cell) -> impl Iterator<Item = (Cell, [usize; 2])> {
    let cell = *cell;
    (0..9_usize).map(move |i| (cell.beside((i / 3) as i32 - 1, (i % 3) as i32 - 1), [i / 3, i % 3]))
}

/// A lens at one wavelength, its maps and kernels on the film.
pub(crate) struct FilmLens<'a> {
    pub(crate) image: &'a dyn LensImage,
    /// Of each layer.
    pub(crate) rasters: &'a [LayerRaster],
    pub(crate) layers: &'a Layers,
    /// Of each layer.
    pub(crate) maps: &'a [FilmMap],
    pub(crate) wavelength_nm: f64,
    pub(crate) stopwatch: &'a Stopwatch,
}

impl FilmLens<'_> {
    fn kernel(&self, layer: usize, knot: Knot) -> KnotKernel {
        let pitch_um = self.rasters[layer].film.pitch_um;
        let field_tan = knot.field_tan(&self.maps[layer], 1e-3 * pitch_um);
        let query = PsfQuery::new(field_tan, self.layers.dioptres()[layer], self.wavelength_nm, pitch_um);
        KnotKernel::new(&self.image.kernel(query).samples)
    }

    /// Computes the kernels of canonical knots of a layer.
    fn layer_kernels(
        &self,
        layer: usize,
        knots: impl IntoIterator<Item = Knot>,
        work: &Work<'_>,
    ) -> Result<BTreeMap<Knot, KnotKernel>, Cancelled> {
        let knots: Vec<Knot> = knots.into_iter().collect();
        let computed = knots.into_par_iter().map(|knot| {
            work.check()?;
            let kernel = self.stopwatch.time(Part::Kernels, || self.kernel(layer, knot));
            work.advance(1);
            Ok((knot, kernel))
        });
        computed.collect()
    }
}

/// The patches of every layer, fine enough for the spline to follow the PSF.
pub(crate) struct Tiling {
    /// Of each layer, those with something in them.
    pub(crate) patches: Vec<Vec<Patch>>,
    symmetry: Symmetry,
    /// Of each layer, the canonical knots of its patches.
    knots: Vec<BTreeSet<Knot>>,
}

impl Tiling {
    /// Halves the cells of each layer until the spline is as near to the kernels of the lens as the settings ask.
    pub(crate) fn new(
        active: Vec<Vec<Cell>>,
        lens: &FilmLens<'_>,
        settings: &Settings,
        work: &Work<'_>,
    ) -> Result<Self, Cancelled> {
        let symmetry = Symmetry::of(lens.image);
        let patches: Vec<Vec<Patch>> = active
            .into_par_iter()
            .enumerate()
            .map(|(layer, cells)| {
                let Some(first) = cells.first() else { return Ok(vec![]) };
                let mut mesh = Mesh { size: first.size, added: BTreeSet::new() };
                let mut probe = Probe { lens, layer, symmetry, kernels: BTreeMap::new() };
                probe.refine(&mut mesh, &cells, settings, work)?;
                let mut patches = vec![];
                cells.into_iter().for_each(|cell| mesh.patches_of(cell, &mut patches));
                let costs = probe.costs(&patches, (mesh.size, settings.negligible_edge), work)?;
                let by_knots = patches_by_knots(&patches, &costs, symmetry);
                patches.iter_mut().zip(by_knots).for_each(|(patch, by_knots)| patch.is_by_knots = by_knots);
                Ok(patches)
            })
            .collect::<Result<_, Cancelled>>()?;
        let canonical =
            |patch: &Patch| -> Vec<Knot> { patch.shares.iter().map(|&(knot, _)| symmetry.canonical(knot)).collect() };
        let knots = patches.iter().map(|patches| patches.iter().flat_map(canonical).collect()).collect();
        Ok(Self { patches, symmetry, knots })
    }

    /// The number of canonical knots, all layers together.
    pub(crate) fn n_knots(&self) -> usize {
        self.knots.iter().map(BTreeSet::len).sum()
    }

    /// The number of patches, all layers together.
    pub(crate) fn n_patches(&self) -> usize {
        self.patches.iter().map(Vec::len).sum()
    }

    /// The bytes of memory of the patches and the knots.
    pub(crate) fn size_bytes(&self) -> usize {
        let of_patch = |patch: &Patch| size_of::<Patch>() + size_of_val(patch.shares.as_slice());
        self.patches.iter().flatten().map(of_patch).sum::<usize>() + self.n_knots() * size_of::<Knot>()
    }

    /// Computes the kernels of all layers at a wavelength; none for a layer without cells.
    pub(crate) fn kernels_at(&self, lens: &FilmLens<'_>, work: &Work<'_>) -> Result<Vec<LayerKernels>, Cancelled> {
        let layers = self.knots.par_iter().enumerate().map(|(layer, knots)| {
            let by_knot = lens.layer_kernels(layer, knots.iter().copied(), work)?;
            Ok(LayerKernels::new(self.symmetry, by_knot))
        });
        layers.collect()
    }
}

/// Finds where the spline over a layer is too coarse.
struct Probe<'a> {
    lens: &'a FilmLens<'a>,
    layer: usize,
    symmetry: Symmetry,
    /// Those computed so far, at canonical knots.
    kernels: BTreeMap<Knot, KnotKernel>,
}

impl Probe<'_> {
    /// Adds knots to a mesh, in the quarters of cells at whose middle the spline is off by more than the settings allow.
    fn refine(
        &mut self,
        mesh: &mut Mesh,
        cells: &[Cell],
        settings: &Settings,
        work: &Work<'_>,
    ) -> Result<(), Cancelled> {
        let mut candidates: Vec<Cell> = cells.iter().copied().filter(Cell::is_divisible).collect();
        while !candidates.is_empty() {
            let splines: Vec<(Cell, Weights)> = candidates.iter().map(|cell| (*cell, mesh.at_middle(cell))).collect();
            let wanted: BTreeSet<Knot> = splines
                .iter()
                .flat_map(|(_, weights)| weights.keys())
                .map(|&knot| self.symmetry.canonical(knot))
                .filter(|knot| !self.kernels.contains_key(knot))
                .collect();
            let unobserved = Work::unobserved(work.cancel());
            self.kernels.extend(self.lens.layer_kernels(self.layer, wanted, &unobserved)?);
            let known = LayerKernels::new(self.symmetry, std::mem::take(&mut self.kernels));
            let errors: Vec<f64> = splines
                .par_iter()
                .map(|(cell, weights)| {
                    work.check()?;
                    let difference = spline_error(&known, cell.knot(), weights);
                    let edge_error = edge_spread_peak(&difference.samples, difference.width);
                    let shading_error = shading_error(&difference, cell.size);
                    // Over what is allowed.
                    Ok((edge_error / settings.max_edge_error).max(shading_error / settings.max_shading_error))
                })
                .collect::<Result<_, Cancelled>>()?;
            self.kernels = known.into_kernels();
            let too_coarse = candidates.iter().zip(errors).filter(|(_, error)| *error > 1.0);
            let added: Vec<Cell> = too_coarse.flat_map(|(cell, _)| cell.children()).collect();
            mesh.added.extend(added.iter().copied());
            candidates = added.into_iter().filter(Cell::is_divisible).collect();
        }
        work.advance(cells.len() as u64);
        Ok(())
    }
}

impl Probe<'_> {
    /// Returns what patches take by themselves; `largest` is the size of whole cells.
    fn costs(
        &mut self,
        patches: &[Patch],
        (largest, negligible_edge): (usize, f64),
        work: &Work<'_>,
    ) -> Result<Vec<Cost>, Cancelled> {
        let known = LayerKernels::new(self.symmetry, std::mem::take(&mut self.kernels));
        let cost = |patch: &Patch| -> Result<Cost, Cancelled> {
            if patch.shares.iter().all(|(knot, _)| known.has(*knot)) {
                let kernels = patch.shares.iter().map(|(knot, _)| (*knot, known.at(*knot))).collect();
                return Ok(Expansion::of(patch, &kernels, negligible_edge, work.cancel())?.cost());
            }
            // Knots of the smallest cells are not known yet: as wide as that of a cell around it, and changing in all ways.
            let around = std::iter::successors(Some(patch.cell), |cell| (cell.size < largest).then(|| cell.parent()));
            let width =
                around.map(|cell| cell.knot()).find(|knot| known.has(*knot)).map_or(1, |knot| known.width_at(knot));
            Ok(Cost { n_terms: 9, n_across: 3, width })
        };
        let costs = patches.par_iter().map(cost).collect();
        self.kernels = known.into_kernels();
        costs
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

/// Returns by how much the irradiance of a uniform plane changes when a difference of kernels is added at knots half
/// a cell apart: half the second derivative of its second moments (docs/forward.md, eq. 2).
fn shading_error(difference: &KnotKernel, cell_size: usize) -> f64 {
    let width = difference.width;
    let middle = (width / 2) as f64;
    let moments = difference.samples.iter().enumerate().map(|(i, &sample)| {
        let (row, column) = ((i / width) as f64 - middle, (i % width) as f64 - middle);
        f64::from(sample) * (row * row + column * column)
    });
    // The spline of one knot has the second derivative −2 over the square of its cell.
    let half_cell = 0.5 * cell_size as f64;
    moments.sum::<f64>().abs() / (half_cell * half_cell)
}

/// Returns, for each layer, the cells in which the scene has anything at its depth.
pub(crate) fn active_cells(
    cells: &[Cell],
    sampler: &Sampler,
    maps: &[FilmMap],
    surfaces: &[&Array2<f32>],
    n_layers: usize,
    cancel: &Cancel,
) -> Result<Vec<Vec<Cell>>, Cancelled> {
    let found: Vec<Vec<bool>> = cells
        .par_iter()
        .map(|cell| {
            cancel.check()?;
            Ok(layers_in(cell, sampler, maps, surfaces, n_layers))
        })
        .collect::<Result<_, Cancelled>>()?;
    let of_layer =
        |layer| cells.iter().zip(&found).filter(move |(_, found): &(_, &Vec<bool>)| found[layer]).map(|(&c, _)| c);
    Ok((0..n_layers).map(|layer| of_layer(layer).collect()).collect())
}

fn layers_in(
    cell: &Cell,
    sampler: &Sampler,
    maps: &[FilmMap],
    surfaces: &[&Array2<f32>],
    n_layers: usize,
) -> Vec<bool> {
    const STEPS: usize = 4;
    let (rows, columns) = surfaces[0].dim();
    let (mut top, mut bottom, mut left, mut right) = (f64::MAX, f64::MIN, f64::MAX, f64::MIN);
    let (first_row, first_column) = cell.first_pixel(&sampler.frame);
    let side = cell.size as f64;
    let along = |first: i64, k: usize| first as f64 - 0.5 + side * k as f64 / STEPS as f64;
    for (map, k) in maps.iter().flat_map(|map| (0..(STEPS + 1) * (STEPS + 1)).map(move |k| (map, k))) {
        let place_mm = sampler.frame.place_mm(along(first_row, k / (STEPS + 1)), along(first_column, k % (STEPS + 1)));
        let tan = map.field_tan(place_mm);
        let (row, column) = sampler.view.position_of(tan.x, tan.y);
        (top, bottom) = (top.min(row), bottom.max(row));
        (left, right) = (left.min(column), right.max(column));
    }
    // Beyond the edge the scene goes on in the dark at the depth of the edge; two samples of slack for curved maps.
    let clamp = |low: f64, high: f64, n: usize| {
        let last = (n - 1) as f64;
        (low.floor() - 2.0).clamp(0.0, last) as usize..=(high.ceil() + 2.0).clamp(0.0, last) as usize
    };
    let mut found = vec![false; n_layers];
    for row in clamp(top, bottom, rows) {
        for column in clamp(left, right, columns) {
            for surface in surfaces {
                let place = surface[(row, column)];
                if !place.is_nan() {
                    let below = place as usize;
                    found[below] = true;
                    found[(below + usize::from(place.fract() > 0.0)).min(n_layers - 1)] = true;
                }
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{geometry::FilmFrame, patch::polynomials};

    #[test]
    fn cells_cover_the_film_and_its_border_once() {
        for (rows, columns) in [(100, 151), (128, 64)] {
            let film = Film::centered(rows, columns, 1.0);
            let frame = FilmFrame::new(&film);
            let mut hits = Array2::<u8>::zeros((rows + 20, columns + 20));
            for cell in cells_over(&film, 10, 32) {
                let (row, column) = cell.first_pixel(&frame);
                for r in row..row + 32 {
                    for c in column..column + 32 {
                        if let (Ok(r), Ok(c)) = (usize::try_from(r + 10), usize::try_from(c + 10))
                            && let Some(hit) = hits.get_mut((r, c))
                        {
                            *hit += 1;
                        }
                    }
                }
            }
            assert!(hits.iter().all(|&hit| hit == 1));
        }
    }

    /// A mesh of 64-pixel cells of which one is halved, and one of its quarters again.
    fn mesh() -> (Mesh, Vec<Patch>) {
        let marked = Cell { down: 0, across: 0, size: 64 };
        let again = marked.children()[3];
        let added = marked.children().into_iter().chain(again.children()).collect();
        let mesh = Mesh { size: 64, added };
        let mut patches = vec![];
        for (down, across) in (-2..3).flat_map(|down| (-2..3).map(move |across| (down, across))) {
            mesh.patches_of(Cell { down, across, size: 64 }, &mut patches);
        }
        (mesh, patches)
    }

    /// Returns the spline through values at knots, at a place in pixels below and to the right of the axis.
    fn spline(patches: &[Patch], value_at: &dyn Fn(Knot) -> f64, down: f64, right: f64) -> f64 {
        let is_in = |patch: &&Patch| {
            let size = patch.cell.size as f64;
            let (u, v) = (right / size - f64::from(patch.cell.across), down / size - f64::from(patch.cell.down));
            (0.0..1.0).contains(&u) && (0.0..1.0).contains(&v)
        };
        let patch = patches.iter().find(is_in).unwrap();
        let size = patch.cell.size as f64;
        let down = polynomials((down / size - f64::from(patch.cell.down) - 0.5) as f32);
        let across = polynomials((right / size - f64::from(patch.cell.across) - 0.5) as f32);
        let weight =
            |shares: &[f32; 9]| (0..9).map(|i| f64::from(shares[i] * down[i / 3] * across[i % 3])).sum::<f64>();
        patch.shares.iter().map(|(knot, shares)| weight(shares) * value_at(*knot)).sum()
    }

    #[test]
    fn weights_of_knots_sum_to_one() {
        let (_, patches) = mesh();
        for patch in patches {
            for product in 0..9 {
                let sum: f32 = patch.shares.iter().map(|(_, shares)| shares[product]).sum();
                let expected = if product == 0 { 1.0 } else { 0.0 };
                assert!((sum - expected).abs() < 1e-6, "{sum} of {:?}", patch.cell);
            }
        }
    }

    #[test]
    fn patches_cover_cells_once() {
        let (_, patches) = mesh();
        let area: usize = patches.iter().map(|patch| patch.cell.size.pow(2)).sum();
        assert_eq!(area, 25 * 64 * 64);
        assert_eq!(patches.iter().map(|patch| patch.cell.size).min(), Some(16));
    }

    /// A plane is reproduced exactly, whatever the sizes of the cells.
    #[test]
    fn linear_kernels_are_met_everywhere() {
        let (_, patches) = mesh();
        let plane = |knot: Knot| 3.0 + 0.02 * f64::from(knot.right) - 0.05 * f64::from(knot.down);
        for (down, right) in [(0.3, 0.7), (31.0, 33.0), (50.2, 47.9), (-40.0, 90.0), (64.1, 15.9)] {
            let value = spline(&patches, &plane, down, right);
            // Single precision of the shares.
            assert!((value - (3.0 + 0.02 * right - 0.05 * down)).abs() < 1e-4, "{value} at {down}, {right}");
        }
    }

    /// Values and slopes have no steps across the borders of patches of any size.
    #[test]
    fn slopes_go_on_across_borders() {
        let (_, patches) = mesh();
        let wild = |knot: Knot| (0.7 * f64::from(knot.right)).sin() + (0.3 * f64::from(knot.down * knot.right)).cos();
        let (near, far) = (1e-3, 0.5);
        for border in [-64.0, 0.0, 16.0, 32.0, 48.0, 64.0, 80.0] {
            for along in [-50.0, -10.0, 5.0, 20.0, 40.0, 70.0, 100.0] {
                for is_down in [true, false] {
                    let at = |by: f64| {
                        let (a, b) = (border + by, along);
                        if is_down { spline(&patches, &wild, a, b) } else { spline(&patches, &wild, b, a) }
                    };
                    assert!((at(near) - at(-near)).abs() < 1e-3, "a step at {border}, {along}");
                    let slopes = [at(far) - at(0.0), at(0.0) - at(-far)].map(|rise| rise / far);
                    // The curvature is at most the largest second difference of the values over the smallest cell's square.
                    assert!(
                        (slopes[0] - slopes[1]).abs() < 8.0 / 256.0 * far,
                        "a kink at {border}, {along}: {slopes:?}"
                    );
                }
            }
        }
    }
}
