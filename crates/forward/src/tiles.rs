//! The film cut into patches, layer by layer and raster by raster, over which PSFs change smoothly.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use dioptric_spectrum::{Cancel, Cancelled};
use rayon::prelude::*;

use crate::{
    Settings,
    block_layers::BlockLayers,
    convolve::fast_size,
    cost::patches_by_knots,
    film_lens::FilmLens,
    geometry::FilmFrame,
    knot_kernels::{LayerKernels, Symmetry},
    mesh::Mesh,
    patch::{Cell, Knot, Patch},
    probe::Probe,
    rectangle::Rectangle,
    seams::Seams,
    work::Work,
};

/// The factor of the film's own raster.
const FILM: usize = 1;

/// The patches of a layer, fine enough for the spline to follow the PSF.
#[derive(Default)]
pub(crate) struct LayerTiles {
    /// Those with something in them, by the factor of the raster that their kernels are on.
    pub(crate) patches: BTreeMap<usize, Vec<Patch>>,
    /// Length that weights of knots are smoothed over where patches have it so, pixels.
    pub(crate) smoothing_px: usize,
    /// The canonical knots, each with the factor of its raster.
    knots: BTreeMap<Knot, usize>,
}

impl LayerTiles {
    /// Halves the cells of a layer until the spline is as near to the kernels of the lens as the settings ask.
    fn new(cells: Vec<Cell>, mut probe: Probe<'_>, work: &Work<'_>) -> Result<Self, Cancelled> {
        let Some(first) = cells.first() else { return Ok(Self::default()) };
        let mut mesh = Mesh { size: first.size, added: BTreeSet::new() };
        probe.refine(&mut mesh, &cells, work)?;
        let mut pieces = vec![];
        cells.into_iter().for_each(|cell| mesh.pieces_of(cell, &mut pieces));
        // Pixels of the widest raster with centers in a piece reach half a pixel beyond it.
        pieces.retain(|(cell, shares)| {
            let widest = shares.iter().map(|(knot, _)| probe.factor_at(*knot)).max().unwrap_or(1);
            probe.may_have_any(cell, widest / 2)
        });
        let all = pieces.iter().flat_map(|(_, shares)| shares.iter().map(|(knot, _)| *knot));
        let factors: BTreeMap<Knot, usize> = all.map(|knot| (knot, probe.factor_at(knot))).collect();
        let mut patches: BTreeMap<usize, Vec<Patch>> = BTreeMap::new();
        for (cell, shares) in pieces {
            for (factor, patch) in Patch::by_factor(cell, shares, |knot| factors[&knot]) {
                patches.entry(factor).or_default().push(patch);
            }
        }
        for (&factor, patches) in &mut patches {
            let costs = probe.costs(factor, patches, mesh.size, work)?;
            let by_knots = patches_by_knots(patches, &costs, factor, probe.symmetry());
            patches.iter_mut().zip(by_knots).for_each(|(patch, by_knots)| patch.is_by_knots = by_knots);
        }
        let knots = factors.into_iter().map(|(knot, factor)| (probe.symmetry().canonical(knot), factor)).collect();
        Ok(Self { patches, smoothing_px: 0, knots })
    }

    /// Returns the blocks of all rasters, of a film of so many rows and columns.
    fn spread_blocks(&self, kernels: &[&LayerKernels], film: (usize, usize)) -> SpreadBlocks {
        let window_at = |knot: Knot| {
            let windows = kernels.iter().map(|kernels| kernels.window_at(knot));
            Rectangle::around(windows).unwrap_or(Rectangle::PIXEL)
        };
        // What is spread, over a part of the film and its margin, by a kernel.
        let along = |factor: usize, size_px: usize, (n, film_px): (usize, usize)| {
            (size_px.div_ceil(factor) + self.smoothing_px).min(film_px.div_ceil(factor) + n - 1) + n - 1
        };
        let block = |factor: usize, (down_px, across_px): (usize, usize), window: Rectangle| {
            (along(factor, down_px, (window.rows, film.0)), along(factor, across_px, (window.columns, film.1)))
        };
        let of_raster = |(&factor, patches): (&usize, &Vec<Patch>)| {
            let mut spans: BTreeMap<Knot, [Knot; 2]> = BTreeMap::new();
            for patch in patches.iter().filter(|patch| patch.is_by_knots) {
                let [first, .., last] = patch.cell.corners();
                for (knot, _) in &patch.shares {
                    let span = spans.entry(*knot).or_insert([first, last]);
                    span[0] = Knot { right: span[0].right.min(first.right), down: span[0].down.min(first.down) };
                    span[1] = Knot { right: span[1].right.max(last.right), down: span[1].down.max(last.down) };
                }
            }
            let around_knots = spans.iter().map(|(knot, [first, last])| {
                let size_px = ((last.down - first.down) as usize, (last.right - first.right) as usize);
                block(factor, size_px, window_at(*knot))
            });
            let sizes: Vec<(usize, usize)> = around_knots.collect();
            let alone = patches.iter().filter(|patch| !patch.is_by_knots).map(|patch| {
                let windows = patch.shares.iter().map(|&(knot, _)| window_at(knot));
                let window = Rectangle::around(windows).unwrap_or(Rectangle::PIXEL);
                block(factor, (patch.cell.size, patch.cell.size), window)
            });
            let sum_px2: usize = sizes.iter().map(|(rows, columns)| rows * columns).sum();
            let transformed = sizes.iter().copied().chain(alone);
            SpreadBlocks {
                largest_px2: transformed.map(|(rows, columns)| fast_size(rows) * fast_size(columns)).max().unwrap_or(0),
                mean_px2: sum_px2 / sizes.len().max(1),
            }
        };
        self.patches.iter().map(of_raster).fold(SpreadBlocks::default(), SpreadBlocks::larger)
    }

    /// Those on the film's pixels.
    fn on_film(&self) -> &[Patch] {
        self.patches.get(&FILM).map_or(&[], Vec::as_slice)
    }

    fn n_patches(&self) -> usize {
        self.patches.values().map(Vec::len).sum()
    }
}

/// The blocks in which samples are spread by kernels.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SpreadBlocks {
    /// Samples of the largest one that is transformed.
    pub(crate) largest_px2: usize,
    /// Samples of those around the knots of a raster in the mean, where they are largest.
    pub(crate) mean_px2: usize,
}

impl SpreadBlocks {
    fn larger(self, other: Self) -> Self {
        Self { largest_px2: self.largest_px2.max(other.largest_px2), mean_px2: self.mean_px2.max(other.mean_px2) }
    }
}

/// The patches of every layer.
pub(crate) struct Tiling {
    pub(crate) layers: Vec<LayerTiles>,
    symmetry: Symmetry,
}

impl Tiling {
    /// Tiles each layer over its cells, where it has `content`. `wavelengths_nm` are those over which a blur is at its widest.
    pub(crate) fn new(
        (active, content): (Vec<Vec<Cell>>, (&BlockLayers, &FilmFrame)),
        lens: &FilmLens<'_>,
        settings: &Settings,
        wavelengths_nm: &[f64],
        work: &Work<'_>,
    ) -> Result<Self, Cancelled> {
        let probe = |layer: usize| Probe::new((lens, layer), content, settings, wavelengths_nm);
        let tiles = active.into_par_iter().enumerate().map(|(layer, cells)| LayerTiles::new(cells, probe(layer), work));
        Ok(Self { layers: tiles.collect::<Result<_, Cancelled>>()?, symmetry: Symmetry::of(lens.image) })
    }

    /// Begins to look for seams between the patches on the film's pixels, layer by layer.
    pub(crate) fn seams(&self) -> Vec<Seams> {
        self.layers.iter().map(|tiles| Seams::between(tiles.on_film())).collect()
    }

    /// Adds the seams that kernels of another band leave.
    pub(crate) fn add_band(
        &self,
        seams: &mut [Seams],
        kernels: &[LayerKernels],
        cancel: &Cancel,
    ) -> Result<(), Cancelled> {
        let layers = self.layers.par_iter().zip(seams).zip(kernels);
        layers.try_for_each(|((tiles, seams), kernels)| seams.add_band(tiles.on_film(), kernels, cancel))
    }

    /// Has patches around seams spread by knots, whose weights are smoothed over a length, or over twice that in layers with large ones.
    pub(crate) fn smooth(&mut self, seams: Vec<Seams>, length_px: usize) {
        for (tiles, seams) in self.layers.iter_mut().zip(seams) {
            let (length_px, smoothed) = seams.smoothed(tiles.on_film(), length_px);
            tiles.smoothing_px = length_px;
            for (number, around) in smoothed {
                if let Some(patch) = tiles.patches.get_mut(&FILM).map(|patches| &mut patches[number]) {
                    (patch.is_by_knots, patch.around) = (true, Some(around));
                }
            }
        }
    }

    /// The number of canonical knots, all layers together.
    pub(crate) fn n_knots(&self) -> usize {
        self.layers.iter().map(|tiles| tiles.knots.len()).sum()
    }

    /// The number of patches, all layers and rasters together.
    pub(crate) fn n_patches(&self) -> usize {
        self.layers.iter().map(LayerTiles::n_patches).sum()
    }

    /// The bytes of memory of the patches and the knots.
    pub(crate) fn size_bytes(&self) -> usize {
        let patches = self.layers.iter().flat_map(|tiles| tiles.patches.values()).flatten();
        patches.map(Patch::size_bytes).sum::<usize>() + self.n_knots() * size_of::<(Knot, usize)>()
    }

    /// Returns about how large the blocks are in which the samples of a film of this size are spread by kernels of some bands.
    pub(crate) fn spread_blocks(&self, bands: &[Arc<Vec<LayerKernels>>], film: (usize, usize)) -> SpreadBlocks {
        let layers = self.layers.par_iter().enumerate();
        let of_layer = |(layer, tiles): (usize, &LayerTiles)| {
            let kernels: Vec<&LayerKernels> = bands.iter().map(|by_layer| &by_layer[layer]).collect();
            tiles.spread_blocks(&kernels, film)
        };
        layers.map(of_layer).reduce(SpreadBlocks::default, SpreadBlocks::larger)
    }

    /// Computes the kernels of all layers at a wavelength; none for a layer without cells.
    pub(crate) fn kernels_at(&self, lens: &FilmLens<'_>, work: &Work<'_>) -> Result<Vec<LayerKernels>, Cancelled> {
        let layers = self.layers.par_iter().enumerate().map(|(layer, tiles)| {
            let by_knot = lens.layer_kernels(layer, tiles.knots.iter().map(|(&knot, &factor)| (knot, factor)), work)?;
            Ok(LayerKernels::new(self.symmetry, by_knot))
        });
        layers.collect()
    }
}
