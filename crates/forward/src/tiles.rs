//! The film cut into square cells, with a knot for the PSF at each corner.

use dioptric_psf::{FilmMap, LensImage, PsfQuery};
use std::collections::{BTreeMap, BTreeSet};

use dioptric_spectrum::{Cancel, Cancelled};
use glam::DVec2;
use ndarray::Array2;
use rayon::prelude::*;

use crate::{Film, Settings, geometry::FilmFrame, layers::Layers, sampler::Sampler, work::Work};

/// A point of the film at which the PSF is computed: pixels to the right of the axis and below it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Knot {
    pub(crate) right: i32,
    pub(crate) down: i32,
}

impl Knot {
    /// Returns the field at the knot.
    fn field_tan(self, map: &FilmMap, pitch_mm: f64) -> DVec2 {
        map.field_tan(DVec2::new(f64::from(self.right), -f64::from(self.down)) * pitch_mm)
    }
}

/// Which knots have kernels that follow from each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Symmetry {
    /// Those that mirror each other about the axes and their diagonals.
    Octants,
    /// None.
    None,
}

impl Symmetry {
    pub(crate) fn of(kernels: &dyn LensImage) -> Self {
        if kernels.is_symmetric() { Self::Octants } else { Self::None }
    }

    /// Returns the knot whose kernel a knot's follows from: that of the same distance from the axis in the first octant,
    /// right and up, or itself.
    fn canonical(self, knot: Knot) -> Knot {
        match self {
            Self::Octants => {
                let (a, b) = (knot.right.abs(), knot.down.abs());
                Knot { right: a.max(b), down: -a.min(b) }
            }
            Self::None => knot,
        }
    }
}

/// A square of the film, which may reach beyond its edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Cell {
    /// The corner at the top left.
    pub(crate) corner: Knot,
    /// Length of a side, pixels.
    pub(crate) size: usize,
}

/// Cells are not halved below this size, pixels.
const SMALLEST: usize = 16;

impl Cell {
    /// The corners: top left, top right, bottom left, bottom right.
    pub(crate) fn knots(&self) -> [Knot; 4] {
        let Knot { right, down } = self.corner;
        let size = self.size as i32;
        [(0, 0), (size, 0), (0, size), (size, size)].map(|(r, d)| Knot { right: right + r, down: down + d })
    }

    fn middle(&self) -> Knot {
        let half = (self.size / 2) as i32;
        Knot { right: self.corner.right + half, down: self.corner.down + half }
    }

    fn quarters(&self) -> [Self; 4] {
        let half = (self.size / 2) as i32;
        let Knot { right, down } = self.corner;
        [(0, 0), (half, 0), (0, half), (half, half)]
            .map(|(r, d)| Self { corner: Knot { right: right + r, down: down + d }, size: self.size / 2 })
    }

    /// The row and column of the first pixel whose centre lies in the cell.
    pub(crate) fn first_pixel(&self, frame: &FilmFrame) -> (i64, i64) {
        let (center_row, center_column) = frame.center();
        (
            (f64::from(self.corner.down) + center_row).ceil() as i64,
            (f64::from(self.corner.right) + center_column).ceil() as i64,
        )
    }
}

/// Returns the cells of a film and of a border of `pad_px` around it.
pub(crate) fn cells_over(film: &Film, pad_px: usize, size: usize) -> Vec<Cell> {
    let reach = |n: usize| ((0.5 * n as f64 + pad_px as f64) / size as f64).ceil() as i32;
    let (across, along) = (reach(film.columns), reach(film.rows));
    let step = size as i32;
    (-along..along)
        .flat_map(|row| (-across..across).map(move |column| (row, column)))
        .map(|(row, column)| Cell { corner: Knot { right: column * step, down: row * step }, size })
        .collect()
}

/// The kernels of one layer at one wavelength, at the canonical knots.
#[derive(Clone, Debug)]
pub(crate) struct LayerKernels {
    /// Samples along a side of every kernel; odd.
    pub(crate) width: usize,
    symmetry: Symmetry,
    by_knot: BTreeMap<Knot, Vec<f32>>,
}

impl LayerKernels {
    /// Takes kernels of any odd sizes, scales each to a sum of 1 and pads them to one size.
    pub(crate) fn new(symmetry: Symmetry, kernels: Vec<(Knot, Array2<f32>)>) -> Self {
        let width = kernels.iter().map(|(_, k)| k.nrows().max(k.ncols())).max().unwrap_or(1);
        let by_knot = kernels.into_iter().map(|(knot, kernel)| (knot, padded(&kernel, width))).collect();
        Self { width, symmetry, by_knot }
    }

    /// The number of kernels.
    pub(crate) fn n_kernels(&self) -> usize {
        self.by_knot.len()
    }

    /// The bytes of memory of the kernels' samples.
    pub(crate) fn size_bytes(&self) -> usize {
        self.by_knot.len() * self.width * self.width * size_of::<f32>()
    }

    /// Returns the kernels between two wavelengths.
    pub(crate) fn mixed(&self, other: &Self, fraction: f32) -> Self {
        let width = self.width.max(other.width);
        let mix = |(knot, a): (&Knot, &Vec<f32>)| {
            let (a, b) = (widened(a, self.width, width), widened(&other.by_knot[knot], other.width, width));
            (*knot, a.iter().zip(&b).map(|(a, b)| a + fraction * (b - a)).collect())
        };
        Self { width, symmetry: self.symmetry, by_knot: self.by_knot.iter().map(mix).collect() }
    }

    /// Returns the kernel at a knot anywhere on the film: that of its canonical knot, mirrored.
    pub(crate) fn at(&self, knot: Knot) -> Vec<f32> {
        let kernel = &self.by_knot[&self.symmetry.canonical(knot)];
        if self.symmetry == Symmetry::None {
            return kernel.clone();
        }
        let (n, last) = (self.width, self.width - 1);
        let swap = knot.down.abs() > knot.right.abs();
        let (flip_columns, flip_rows) = (knot.right < 0, knot.down > 0);
        let mut turned = Vec::with_capacity(n * n);
        for row in 0..n {
            let row = if flip_rows { last - row } else { row };
            for column in 0..n {
                let column = if flip_columns { last - column } else { column };
                let (r, c) = if swap { (last - column, last - row) } else { (row, column) };
                turned.push(kernel[r * n + c]);
            }
        }
        turned
    }
}

fn padded(kernel: &Array2<f32>, width: usize) -> Vec<f32> {
    let (rows, columns) = kernel.dim();
    let (top, left) = ((width - rows) / 2, (width - columns) / 2);
    let sum: f64 = kernel.iter().map(|&v| f64::from(v)).sum();
    let scale = if sum > 0.0 { 1.0 / sum } else { 0.0 };
    let mut samples = vec![0.0; width * width];
    for ((row, column), &value) in kernel.indexed_iter() {
        samples[(top + row) * width + left + column] = (f64::from(value) * scale) as f32;
    }
    samples
}

fn widened(kernel: &[f32], width: usize, to: usize) -> Vec<f32> {
    let margin = (to - width) / 2;
    let mut samples = vec![0.0; to * to];
    for (row, line) in kernel.chunks_exact(width).enumerate() {
        samples[(margin + row) * to + margin..][..width].copy_from_slice(line);
    }
    samples
}

/// The cells of every layer, fine enough for the PSF to be interpolated across them.
pub(crate) struct Tiling {
    /// Of each layer, the cells with something in them.
    pub(crate) cells: Vec<Vec<Cell>>,
    symmetry: Symmetry,
    /// Of each layer, the canonical knots of its cells.
    knots: Vec<BTreeSet<Knot>>,
}

impl Tiling {
    /// Halves the cells of each layer until the PSF half-way between the knots is met.
    pub(crate) fn new(
        active: Vec<Vec<Cell>>,
        maps: &[FilmMap],
        layers: &Layers,
        film: &Film,
        wavelength_nm: f64,
        kernels: &dyn LensImage,
        settings: &Settings,
        work: &Work<'_>,
    ) -> Result<Self, Cancelled> {
        let symmetry = Symmetry::of(kernels);
        let cells: Vec<Vec<Cell>> = active
            .into_par_iter()
            .enumerate()
            .map(|(layer, cells)| {
                let mut probe = Probe {
                    symmetry,
                    kernel_at: &|knot: Knot| {
                        let field_tan = knot.field_tan(&maps[layer], 1e-3 * film.pitch_um);
                        kernels
                            .kernel(PsfQuery::new(field_tan, layers.dioptres()[layer], wavelength_nm, film.pitch_um))
                            .samples
                    },
                    kernels: BTreeMap::new(),
                    errors: BTreeMap::new(),
                    cancel: work.cancel(),
                };
                let mut halved = vec![];
                for cell in cells {
                    probe.halve_until(cell, settings.max_edge_error, &mut halved)?;
                    work.advance(1);
                }
                Ok(halved)
            })
            .collect::<Result<_, Cancelled>>()?;
        let canonical = |cell: &Cell| cell.knots().map(|knot| symmetry.canonical(knot));
        let knots = cells.iter().map(|cells| cells.iter().flat_map(canonical).collect()).collect();
        Ok(Self { cells, symmetry, knots })
    }

    /// The number of canonical knots, all layers together.
    pub(crate) fn n_knots(&self) -> usize {
        self.knots.iter().map(BTreeSet::len).sum()
    }

    /// The bytes of memory of the cells and the knots.
    pub(crate) fn size_bytes(&self) -> usize {
        self.cells.iter().map(|cells| size_of_val(cells.as_slice())).sum::<usize>() + self.n_knots() * size_of::<Knot>()
    }

    /// Computes the kernels of all layers at a wavelength; none for a layer without cells.
    pub(crate) fn kernels_at(
        &self,
        maps: &[FilmMap],
        layers: &Layers,
        film: &Film,
        wavelength_nm: f64,
        kernels: &dyn LensImage,
        work: &Work<'_>,
    ) -> Result<Vec<LayerKernels>, Cancelled> {
        let wanted: Vec<(usize, Knot)> =
            self.knots.iter().enumerate().flat_map(|(layer, knots)| knots.iter().map(move |&k| (layer, k))).collect();
        let computed: Vec<(usize, Knot, Array2<f32>)> = wanted
            .into_par_iter()
            .map(|(layer, knot)| {
                work.check()?;
                let field_tan = knot.field_tan(&maps[layer], 1e-3 * film.pitch_um);
                let dioptres = layers.dioptres()[layer];
                let kernel = kernels.kernel(PsfQuery::new(field_tan, dioptres, wavelength_nm, film.pitch_um)).samples;
                work.advance(1);
                Ok((layer, knot, kernel))
            })
            .collect::<Result<_, Cancelled>>()?;
        let mut by_layer: Vec<Vec<(Knot, Array2<f32>)>> = vec![vec![]; layers.len()];
        for (layer, knot, kernel) in computed {
            by_layer[layer].push((knot, kernel));
        }
        Ok(by_layer.into_iter().map(|kernels| LayerKernels::new(self.symmetry, kernels)).collect())
    }
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

/// Tells where the PSF cannot be interpolated across a cell.
struct Probe<'a> {
    symmetry: Symmetry,
    kernel_at: &'a dyn Fn(Knot) -> Array2<f32>,
    kernels: BTreeMap<Knot, Array2<f32>>,
    errors: BTreeMap<(Knot, usize), f64>,
    cancel: &'a Cancel,
}

impl Probe<'_> {
    fn halve_until(&mut self, cell: Cell, max_edge_error: f64, out: &mut Vec<Cell>) -> Result<(), Cancelled> {
        if cell.size / 2 < SMALLEST || self.edge_error(&cell)? <= max_edge_error {
            out.push(cell);
            return Ok(());
        }
        cell.quarters().into_iter().try_for_each(|quarter| self.halve_until(quarter, max_edge_error, out))
    }

    /// Returns the largest error of the edge spread function, of edges along rows and columns, mid-cell.
    fn edge_error(&mut self, cell: &Cell) -> Result<f64, Cancelled> {
        let key = (self.symmetry.canonical(cell.middle()), cell.size);
        if let Some(&error) = self.errors.get(&key) {
            return Ok(error);
        }
        let wanted: Vec<Knot> = cell.knots().into_iter().chain([cell.middle()]).collect();
        for knot in &wanted {
            self.cancel.check()?;
            let canonical = self.symmetry.canonical(*knot);
            let kernel_at = self.kernel_at;
            self.kernels.entry(canonical).or_insert_with(|| kernel_at(canonical));
        }
        let canonical = wanted.iter().map(|&k| self.symmetry.canonical(k));
        let kernels = LayerKernels::new(self.symmetry, canonical.map(|k| (k, self.kernels[&k].clone())).collect());
        let turned: Vec<Vec<f32>> = wanted.iter().map(|&knot| kernels.at(knot)).collect();
        let difference: Vec<f64> = (0..kernels.width * kernels.width)
            .map(|i| f64::from(turned[4][i]) - 0.25 * turned[..4].iter().map(|k| f64::from(k[i])).sum::<f64>())
            .collect();
        let error = edge_spread_peak(&difference, kernels.width);
        self.errors.insert(key, error);
        Ok(error)
    }
}

/// Returns the largest magnitude of the edge spread functions, along rows and columns, of a kernel.
pub(crate) fn edge_spread_peak(kernel: &[f64], width: usize) -> f64 {
    let (mut down, mut right, mut peak) = (0.0_f64, 0.0_f64, 0.0_f64);
    for i in 0..width {
        down += kernel[i * width..][..width].iter().sum::<f64>();
        right += kernel.iter().skip(i).step_by(width).sum::<f64>();
        peak = peak.max(down.abs()).max(right.abs());
    }
    peak
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_cover_the_film_and_its_border_once() {
        for (rows, columns) in [(100, 151), (128, 64)] {
            let film = Film { rows, columns, pitch_um: 1.0 };
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

    #[test]
    fn kernels_are_mirrored_with_their_knots() {
        // A comet pointing away from the axis at (tan 2, 1): right and up.
        let comet = |x: f64, y: f64| {
            let mut kernel = Array2::zeros((5, 5));
            kernel[((2.0 - y) as usize, (2.0 + x) as usize)] = 1.0;
            kernel
        };
        let kernels = LayerKernels::new(Symmetry::Octants, vec![(Knot { right: 64, down: -32 }, comet(2.0, 1.0))]);
        for (right, down, x, y) in [
            (64, -32, 2.0, 1.0),
            (-64, -32, -2.0, 1.0),
            (64, 32, 2.0, -1.0),
            (32, -64, 1.0, 2.0),
            (-32, 64, -1.0, -2.0),
            (32, 64, 1.0, -2.0),
            (-32, -64, -1.0, 2.0),
        ] {
            let expected: Vec<f32> = comet(x, y).into_iter().collect();
            assert_eq!(kernels.at(Knot { right, down }), expected, "at {right}, {down}");
        }
        let both =
            [(64, comet(2.0, 1.0)), (-64, comet(1.0, 0.0))].map(|(right, comet)| (Knot { right, down: 9 }, comet));
        let kernels = LayerKernels::new(Symmetry::None, both.to_vec());
        for (knot, comet) in both {
            assert_eq!(kernels.at(knot), comet.into_iter().collect::<Vec<_>>());
        }
    }
}
