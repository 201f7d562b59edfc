//! How finely the film is cut into tiles for each layer, and on what samples each tile is imaged.

use std::{
    collections::{BTreeMap, BTreeSet},
    ops::Range,
};

use dioptric_psf::{FilmQuery, LensImage};
use dioptric_spectrum::Cancelled;
use glam::DVec2;
use rayon::prelude::*;

use crate::{
    Film, Settings,
    blocks::Blocks,
    layers::Layers,
    node_kernels::{LayerKernels, NodeAt, NodeKernel, edge_spread_peak},
    raster::{Level, Raster},
    stopwatch::{Part, Stopwatch},
    symmetry::{Mirror, Node, Symmetry},
    tile::{Tile, TileGroup},
    work::Work,
};

/// The least side of a tile, in samples of its raster, on which blurs have radii of up to four times as many.
const LEAST_TILE: i32 = 16;
/// How far kernels reach beyond the radius that holds 95 % of a blur: twice as far, and some pixels.
const REACH: (f64, f64) = (2.0, 8.0);
/// Standard deviations of kernels, pixels, between which detail below a pixel is imaged as such: below, points stay points; above, none of it is left, nor of what it is
/// folded to on pixels.
const FINE_BLUR_PX: Range<f64> = 0.05..4.0;
/// What a kernel on parts of pixels may leave of fine gratings: a Gaussian of 1.2 samples leaves it. Of more, finer parts are taken.
const LEFT_OF_DETAIL: f64 = 0.2;

/// A lens before a film, whose layers of depth are imaged.
#[derive(Clone, Copy)]
pub(crate) struct LayeredLens<'a> {
    pub(crate) image: &'a dyn LensImage,
    pub(crate) film: &'a Film,
    pub(crate) layers: &'a Layers,
    pub(crate) stopwatch: &'a Stopwatch,
}

impl LayeredLens<'_> {
    /// Returns where a node lies, mm from the film's middle.
    fn place_mm(&self, Node { right, down }: Node) -> DVec2 {
        1e-3 * self.film.pitch_um * DVec2::new(f64::from(right), -f64::from(down))
    }

    /// Returns the kernel at a node of a layer.
    fn kernel(&self, layer: usize, (node, level): NodeAt, wavelength_nm: f64) -> NodeKernel {
        let pitch_um = Raster::new(self.film, level).pitch_um();
        let (place_mm, dioptres) = (self.place_mm(node), self.layers.dioptres()[layer]);
        let query = FilmQuery { place_mm, dioptres, wavelength_nm, pitch_um };
        self.stopwatch.time(Part::Kernels, || NodeKernel::new(&self.image.kernel(query)))
    }

    /// Returns the largest radius of what a point becomes at a node of a layer, pixels.
    fn spread_px(&self, layer: usize, node: Node, wavelengths_nm: &[f64]) -> f64 {
        let (place_mm, dioptres) = (self.place_mm(node), self.layers.dioptres()[layer]);
        let spread_mm = |&wavelength_nm: &f64| self.image.spread_mm(place_mm, dioptres, wavelength_nm);
        wavelengths_nm.iter().map(spread_mm).fold(0.0, f64::max) / (1e-3 * self.film.pitch_um)
    }
}

/// Returns how far beyond the film light is taken from for a blur of a radius, pixels.
pub(crate) fn reach_px(radius_px: f64) -> f64 {
    REACH.0 * radius_px + REACH.1
}

/// The tiles of a layer.
#[derive(Debug, Default)]
pub(crate) struct LayerTiles {
    pub(crate) groups: Vec<TileGroup>,
    /// Canonical nodes, each with the width of the samples that its kernel is on.
    nodes: BTreeSet<NodeAt>,
    /// Kernels of the middle band by which they were cut.
    known: BTreeMap<NodeAt, NodeKernel>,
}

impl LayerTiles {
    /// Returns the tile that a pixel lies in, if anything is gathered there, and the width of its samples.
    pub(crate) fn at(&self, (row, column): (i64, i64)) -> Option<(Tile, Level)> {
        let has = |tile: &Tile| {
            let within = |first: i32, at: i64| (i64::from(first)..i64::from(first + tile.size)).contains(&at);
            within(tile.down, row) && within(tile.right, column)
        };
        self.groups.iter().find_map(|group| {
            let member = group.members.iter().find(|(tile, _)| has(tile));
            member.map(|(tile, _)| (*tile, group.level))
        })
    }
}

/// The tiles of every layer.
pub(crate) struct Tiling {
    pub(crate) layers: Vec<LayerTiles>,
    symmetry: Symmetry,
}

/// What tiles are cut by.
pub(crate) struct Rule<'a> {
    pub(crate) lens: LayeredLens<'a>,
    pub(crate) settings: &'a Settings,
    pub(crate) blocks: &'a Blocks,
    /// The middle one, by whose kernels tiles are cut, and those over which a blur is at its widest.
    pub(crate) middle_nm: f64,
    pub(crate) wavelengths_nm: &'a [f64],
}

impl Tiling {
    pub(crate) fn new(rule: &Rule<'_>, work: &Work<'_>) -> Result<Self, Cancelled> {
        let symmetry = Symmetry::of(rule.lens.image);
        let layers = (0..rule.lens.layers.len()).into_par_iter().map(|layer| {
            let tiles = rule.tiles(layer, symmetry, work);
            work.advance(1);
            tiles
        });
        Ok(Self { layers: layers.collect::<Result<_, Cancelled>>()?, symmetry })
    }

    /// The number of canonical nodes, all layers together.
    pub(crate) fn n_nodes(&self) -> usize {
        self.layers.iter().map(|tiles| tiles.nodes.len()).sum()
    }

    /// The number of groups of tiles, all layers together.
    pub(crate) fn n_groups(&self) -> usize {
        self.layers.iter().map(|tiles| tiles.groups.len()).sum()
    }

    pub(crate) fn size_bytes(&self) -> usize {
        let members = self.layers.iter().flat_map(|tiles| &tiles.groups).map(|group| group.members.len());
        members.sum::<usize>() * size_of::<(Tile, Mirror)>() + self.n_nodes() * size_of::<NodeAt>()
    }

    /// Computes the kernels of all layers in the band by which they were cut, of which some are known.
    pub(crate) fn middle_kernels(
        &mut self,
        lens: &LayeredLens<'_>,
        wavelength_nm: f64,
        work: &Work<'_>,
    ) -> Result<Vec<LayerKernels>, Cancelled> {
        let kernels = self.kernels_at(lens, wavelength_nm, work)?;
        self.layers.iter_mut().for_each(|tiles| tiles.known.clear());
        Ok(kernels)
    }

    /// Computes the kernels of all layers at a wavelength.
    pub(crate) fn kernels_at(
        &self,
        lens: &LayeredLens<'_>,
        wavelength_nm: f64,
        work: &Work<'_>,
    ) -> Result<Vec<LayerKernels>, Cancelled> {
        // Node by node, so that the rays of each serve all layers.
        let mut layers_of: BTreeMap<NodeAt, Vec<usize>> = BTreeMap::new();
        for (layer, tiles) in self.layers.iter().enumerate() {
            tiles.nodes.iter().for_each(|node| layers_of.entry(*node).or_default().push(layer));
        }
        let layers_of: Vec<(NodeAt, Vec<usize>)> = layers_of.into_iter().collect();
        let of_node = |(node, layers): &(NodeAt, Vec<usize>)| {
            let kernel = |&layer: &usize| {
                work.check()?;
                let known = self.layers[layer].known.get(node).cloned();
                let kernel = known.unwrap_or_else(|| lens.kernel(layer, *node, wavelength_nm));
                work.advance(1);
                Ok(kernel)
            };
            layers.iter().map(kernel).collect::<Result<Vec<NodeKernel>, Cancelled>>()
        };
        let kernels: Vec<Vec<NodeKernel>> = layers_of.par_iter().map(of_node).collect::<Result<_, Cancelled>>()?;
        let mut by_layer: Vec<BTreeMap<NodeAt, NodeKernel>> = vec![BTreeMap::new(); self.layers.len()];
        for ((node, layers), kernels) in layers_of.iter().zip(kernels) {
            for (&layer, kernel) in layers.iter().zip(kernels) {
                by_layer[layer].insert(*node, kernel);
            }
        }
        Ok(by_layer.into_iter().map(|kernels| LayerKernels::new(self.symmetry, kernels)).collect())
    }
}

impl Rule<'_> {
    /// Cuts the film into tiles between whose corners kernels of a layer may be interpolated.
    fn tiles(&self, layer: usize, symmetry: Symmetry, work: &Work<'_>) -> Result<LayerTiles, Cancelled> {
        let LayeredLens { film, .. } = self.lens;
        let sharpest = self.spread_px(layer, Node { right: 0, down: 0 });
        let pixels = self.level_for(sharpest).pixels() as i32;
        let mut tiles = Tile::over(film, self.settings.tile_px as i32 * pixels);
        let mut known = LayerKernels::new(symmetry, BTreeMap::new());
        let mut made = LayerTiles::default();
        while !tiles.is_empty() {
            work.check()?;
            let mut groups: BTreeMap<Tile, Vec<(Tile, Mirror)>> = BTreeMap::new();
            for tile in tiles.drain(..) {
                let (canonical, mirror) = tile.canonical(symmetry);
                groups.entry(canonical).or_default().push((tile, mirror));
            }
            let groups: Vec<Candidate> = groups
                .into_par_iter()
                .filter_map(|(canonical, members)| self.candidate(layer, canonical, members))
                .collect();
            // The kernels that tell how far off interpolated ones are.
            let nodes = groups.iter().flat_map(Candidate::looked_at);
            let nodes: BTreeSet<NodeAt> = nodes.map(|(node, level)| (symmetry.canonical(node), level)).collect();
            let missing: Vec<NodeAt> = nodes.into_iter().filter(|node| !known.has(node)).collect();
            let kernel = |node: &NodeAt| {
                work.check()?;
                Ok((*node, self.lens.kernel(layer, *node, self.middle_nm)))
            };
            known.extend(missing.par_iter().map(kernel).collect::<Result<_, Cancelled>>()?);
            let is_coarse: Vec<bool> = groups
                .par_iter()
                .map(|group| group.can_be_cut && self.error(&known, group) > self.settings.max_edge_error)
                .collect();
            for (group, is_coarse) in groups.into_iter().zip(is_coarse) {
                if is_coarse {
                    tiles.extend(
                        group
                            .members
                            .iter()
                            .flat_map(|(tile, _)| tile.quarters())
                            .filter(|tile| tile.pixels(film).is_some()),
                    );
                } else {
                    self.take(group, symmetry, &mut made);
                }
            }
        }
        known.retain(&made.nodes);
        made.known = known.into_kernels();
        Ok(made)
    }

    /// Returns tiles with anything in reach, and the level that they are imaged on.
    fn candidate(&self, layer: usize, canonical: Tile, members: Vec<(Tile, Mirror)>) -> Option<Candidate> {
        let nodes = canonical.corners().into_iter().chain([canonical.center()]);
        let spreads: Vec<f64> = nodes.map(|node| self.spread_px(layer, node)).collect();
        let (least, most) = spreads.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), s| (a.min(*s), b.max(*s)));
        let reach = reach_px(most);
        let has_any = |(tile, _): &(Tile, Mirror)| {
            let range = |start: i32| f64::from(start) - reach..f64::from(start + tile.size) + reach;
            self.blocks.has(layer, range(tile.down), range(tile.right))
        };
        let members: Vec<(Tile, Mirror)> = members.into_iter().filter(has_any).collect();
        let level = self.level_for(least);
        let can_be_cut = canonical.size / 2 >= LEAST_TILE * level.pixels() as i32;
        let most = members.iter().map(|(tile, _)| self.density(tile)).max()?;
        let is_finer = level == Level::PIXEL && self.settings.subpixels && most > 1;
        let finest = if is_finer { self.finer_level(layer, canonical.center(), most) } else { None };
        Some(Candidate { canonical, members, level, finest, can_be_cut })
    }

    /// Returns the largest error of the edge spread functions in the middle of a tile, along rows and columns.
    fn error(&self, kernels: &LayerKernels, group: &Candidate) -> f64 {
        let at = |node: Node| kernels.at((node, group.judged()));
        let (corners, middle) = (group.canonical.corners().map(at), at(group.canonical.center()));
        let terms: Vec<(&NodeKernel, f32)> =
            corners.iter().map(|kernel| (kernel, -0.25)).chain([(&middle, 1.0)]).collect();
        let difference = NodeKernel::sum_of(&terms);
        edge_spread_peak(&difference.samples, difference.at.columns)
    }

    /// The most samples of the scene along a pixel of a tile.
    fn density(&self, tile: &Tile) -> usize {
        let range = |start: i32| f64::from(start)..f64::from(start + tile.size);
        self.blocks.most_density(range(tile.down), range(tile.right))
    }

    /// Adds tiles that need not be cut.
    fn take(&self, group: Candidate, symmetry: Symmetry, made: &mut LayerTiles) {
        let Candidate { canonical, members, level, finest, .. } = group;
        let mut add = |canonical: Tile, members: Vec<(Tile, Mirror)>, level: Level| {
            made.nodes.extend(canonical.corners().map(|node| (symmetry.canonical(node), level)));
            made.groups.push(TileGroup { level, canonical, members });
        };
        let Some(finest) = finest else { return add(canonical, members, level) };
        // Where the scene is finer than the film and the blur leaves detail, tiles are imaged on parts of pixels, each by itself.
        let (finer, others): (Vec<_>, Vec<_>) = members.into_iter().partition(|(tile, _)| self.density(tile) > 1);
        for (tile, _) in finer {
            add(tile, vec![(tile, Mirror::default())], finest.max(Level::of_density(self.density(&tile))));
        }
        if !others.is_empty() {
            add(canonical, others, level);
        }
    }

    /// Returns the parts of pixels that hold what the kernel about a node leaves of a scene with so many samples along a pixel, if it leaves anything finer than pixels.
    fn finer_level(&self, layer: usize, node: Node, density: usize) -> Option<Level> {
        let mut level = Level::HALF;
        loop {
            let kernel = self.lens.kernel(layer, (node, level), self.middle_nm);
            let sigmas_px = kernel.variances().map(|variance| variance.sqrt() * level.step_px());
            if sigmas_px[0].min(sigmas_px[1]) >= FINE_BLUR_PX.end {
                return None;
            }
            let is_finest = level == Level::EIGHTH.max(Level::of_density(density));
            if is_finest || kernel.left_of_detail() < LEFT_OF_DETAIL {
                return (sigmas_px[0].max(sigmas_px[1]) > FINE_BLUR_PX.start).then_some(level);
            }
            level = Level(level.0 - 1);
        }
    }

    fn spread_px(&self, layer: usize, node: Node) -> f64 {
        self.lens.spread_px(layer, node, self.wavelengths_nm)
    }

    /// Returns the level on which a blur of this radius is imaged.
    fn level_for(&self, radius_px: f64) -> Level {
        let doublings = (radius_px / self.settings.widest_blur_px).log2().ceil().max(0.0);
        Level(doublings.min(12.0) as i8)
    }
}

/// Tiles that mirror each other, of which kernels tell whether they are to be cut.
struct Candidate {
    canonical: Tile,
    members: Vec<(Tile, Mirror)>,
    level: Level,
    /// The finest parts of pixels that any is imaged on.
    finest: Option<Level>,
    can_be_cut: bool,
}

impl Candidate {
    /// The samples on which kernels tell.
    fn judged(&self) -> Level {
        self.finest.unwrap_or(self.level)
    }

    /// The nodes whose kernels tell.
    fn looked_at(&self) -> Vec<NodeAt> {
        let nodes = self.canonical.corners().into_iter().chain([self.canonical.center()]);
        if self.can_be_cut { nodes.map(|node| (node, self.judged())).collect() } else { vec![] }
    }
}
