//! The work of a plan: layers of depth over the film, their kernels, and the imaging of a band.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError},
};

use dioptric_psf::{FilmMap, LensImage};
use dioptric_scene::View;
use dioptric_spectrum::{Cancel, Cancelled, WavelengthGrid};
use glam::DVec2;
use ndarray::Array2;
use rayon::prelude::*;

use crate::{
    BandKernels, BandRadiance, BlurMode, Film, ForwardError, ImagingSpec, SceneGeometry, SceneRadiance, Settings,
    active::{Seen, active_cells, cells_over, joined_for},
    basis::{BandBasis, BasisBetween, Kept},
    block_layers::BlockLayers,
    blur::{LayerTask, blur_layer},
    by_knots::{buffer_bytes, spread_bytes},
    film_lens::FilmLens,
    geometry::{FilmFrame, check_extent},
    halo::Halos,
    lateral_color::LateralColor,
    layers::{Blurs, Layers},
    level::Level,
    mixed::MixedSamples,
    narrow::NarrowRule,
    occluded::{Distances, OccludedSamples},
    occlusion::{BlurredPlane, Composite, LayerAlpha},
    patch::Cell,
    raster::LayerRaster,
    rectangle::Rectangle,
    sampler::{LayerCoordinates, Surface},
    stopwatch::{Part, Stopwatch},
    tiles::{LayerTiles, SpreadBlocks, Tiling},
    work::{Progress, Work, plane_of},
};

/// Kernels and alpha that a plan keeps when nothing else is asked for, bytes.
pub(crate) const KEPT_BUDGET_BYTES: usize = 256 << 20;

/// What bands in flight take when nothing else is asked for, bytes.
const IN_FLIGHT_BYTES: usize = 256 << 20;

/// The depths of a scene in layers and what their edges hide: the same for all parts of a pupil.
pub(crate) struct SceneLayers {
    pub(crate) layers: Layers,
    /// The bands at which PSFs are computed; between them they are interpolated.
    pub(crate) kernel_bands: Vec<usize>,
    /// Those at which the alpha of layers is computed: interpolated between them as well. Others than those of kernels, where points move, and fewer, where blur is wide.
    pub(crate) basis_bands: Vec<usize>,
    layer_coordinates: LayerCoordinates,
    pub(crate) occluded: OccludedSamples,
    /// Samples that show both sides of an edge of depth.
    mixed: MixedSamples,
    /// The share of samples on surfaces narrower than the pupil.
    pub(crate) narrow_fraction: f64,
}

impl SceneLayers {
    /// Lays a scene in layers of the blur of a lens.
    pub(crate) fn over(
        lens: &dyn LensImage,
        scene: &SceneGeometry<'_>,
        spec: &ImagingSpec,
        cancel: &Cancel,
    ) -> Result<Self, ForwardError> {
        let ImagingSpec { film, grid, settings } = spec;
        film.check()?;
        settings.check()?;
        scene.check()?;
        let (near_m, far_m) = scene.depth.range_m();
        let dioptres = (1.0 / far_m, 1.0 / near_m);
        check_extent(lens, grid, dioptres, film, cancel)?;

        let (pitch_mm, corner_mm, middle_nm) = (1e-3 * film.pitch_um, film.half_diagonal_mm(), middle_nm(grid));
        let map = lens.film_map(dioptres.0, middle_nm, corner_mm);
        let fields = blur_fields(lens, &map, film);
        let blurs = Blurs { kernels: lens, pitch_mm, fields: &fields, wavelengths_nm: grid.centers_nm() };
        let layers = Layers::over(dioptres, settings.layer_step_px, &blurs);
        let kernel_bands = layers.chromatic_knots(settings.chromatic_step_px, &blurs);
        let extent_mm = extent_of(&radii_px(&layers), film, settings);
        let basis_bands = match hides(settings, &layers) {
            true => {
                let by_blur = layers.coverage_knots(settings.chromatic_step_px, &blurs);
                let of_kernels = with_others_beside(&kernel_bands, &by_blur);
                LateralColor { lens, film, grid, extent_mm }.knots(&of_kernels, dioptres, settings.coverage_step_px)
            }
            false => kernel_bands.clone(),
        };
        let z_m = scene.depth.z_m();
        let coordinate = |row: usize, column: usize| layers.coordinate_of(z_m[(row, column)]);
        let layer_coordinates = LayerCoordinates::new(plane_of(z_m.dim(), cancel, coordinate)?, cancel)?;
        let nearest = lens.film_map(layers.dioptres()[0], middle_nm, extent_mm);
        let scene_per_film = LayerRaster::new(film, 1, (scene.view, scene.size()), &nearest).sampler.scene_per_film;
        let (occluded, mixed, narrow_fraction) = match hides(settings, &layers) {
            true => {
                let distances = Distances::of(scene, &layers, cancel)?;
                let jump = settings.depth_edge_px as f32;
                let narrow = NarrowRule { jump, scene_per_film: scene_per_film as f32 };
                (
                    OccludedSamples::find(&distances, &layers, settings, scene_per_film, cancel)?,
                    MixedSamples::find(&distances, jump, cancel)?,
                    narrow.fraction(&distances.front, cancel)?,
                )
            }
            false => (OccludedSamples::Nothing, MixedSamples::default(), 0.0),
        };
        Ok(Self { layers, kernel_bands, basis_bands, layer_coordinates, occluded, mixed, narrow_fraction })
    }

    /// Rows and columns of the scene.
    pub(crate) fn size(&self) -> (usize, usize) {
        self.layer_coordinates.samples().dim()
    }

    pub(crate) fn size_bytes(&self) -> usize {
        self.layer_coordinates.size_bytes()
            + self.occluded.layer_coordinates().map_or(0, LayerCoordinates::size_bytes)
            + self.occluded.size_bytes()
            + self.mixed.size_bytes()
    }
}

/// A plan but for the lens, which each method takes.
pub(crate) struct Layout {
    pub(crate) spec: ImagingSpec,
    pub(crate) scene: Arc<SceneLayers>,
    /// Of each layer, by their factor.
    rasters: Vec<BTreeMap<usize, LayerRaster>>,
    tiling: Tiling,
    /// By the factor of their raster.
    blocks: BTreeMap<usize, BlockLayers>,
    /// How far off axis light is taken from, mm.
    extent_mm: f64,
    pub(crate) kept: Mutex<Kept>,
    /// Of the kernels that the plan has seen.
    largest: Largest,
    /// About how many pixels of the film layers cover, all layers together; 0 where none hides another.
    n_covered: usize,
    /// Of each band that was asked for, those of all layers.
    maps: Mutex<BTreeMap<usize, Arc<Vec<FilmMap>>>>,
    /// Of the layers in some bands, once anything was asked for.
    levels: OnceLock<BTreeMap<usize, Vec<Option<Level>>>>,
    halos: Halos,
    pub(crate) stopwatch: Stopwatch,
    /// Bytes that bands in flight may take; `None` for the usual ones, and as many bands as there are threads (up to four) at least.
    pub(crate) in_flight_bytes: Option<usize>,
}

/// Returns those of the bands at which kernels are computed at which coverage has to be: where blur asks for it, and all beside which kernels are interpolated, so that those
/// between two bases are theirs.
fn with_others_beside(kernel_bands: &[usize], by_blur: &[usize]) -> Vec<usize> {
    let is_in = |bands: &[usize], band: usize| bands.binary_search(&band).is_ok();
    let is_amid = |band: usize| band > 0 && is_in(kernel_bands, band - 1) && is_in(kernel_bands, band + 1);
    kernel_bands.iter().copied().filter(|&band| !is_amid(band) || is_in(by_blur, band)).collect()
}

/// Returns the blur radius of each layer, pixels of the film.
fn radii_px(layers: &Layers) -> Vec<f64> {
    (0..layers.len()).map(|layer| layers.radius_px_at(layer as f32)).collect()
}

/// Returns how far off axis light is taken from, mm.
fn extent_of(radius_px: &[f64], film: &Film, settings: &Settings) -> f64 {
    let pad_px = radius_px.iter().map(|&radius_px| pad_for(radius_px)).fold(0.0, f64::max);
    let border_px = pad_px + 2.0 * settings.knot_spacing_px as f64;
    film.half_diagonal_mm() + 1e-3 * film.pitch_um * std::f64::consts::SQRT_2 * border_px
}

/// Returns the first, the middle and the last of some bands.
fn few_of(bands: &[usize]) -> impl Iterator<Item = usize> {
    BTreeSet::from([0, bands.len() / 2, bands.len() - 1].map(|number| bands[number])).into_iter()
}

/// The wavelength of the middle band.
fn middle_nm(grid: &WavelengthGrid) -> f64 {
    grid.centers_nm()[grid.len() / 2]
}

/// Whether layers hide those behind them.
fn hides(settings: &Settings, layers: &Layers) -> bool {
    settings.mode != BlurMode::Pointwise && layers.len() > 1
}

/// Units of work of a kernel and of a patch of the film in one band, about in proportion to their time.
const KERNEL_UNITS: u64 = 1;
const PATCH_UNITS: u64 = 8;

impl Layout {
    pub(crate) fn new(
        lens: &dyn LensImage,
        view: View,
        scene: Arc<SceneLayers>,
        spec: ImagingSpec,
        (progress, range): (&Progress<'_>, (f64, f64)),
        cancel: &Cancel,
    ) -> Result<Self, ForwardError> {
        let ImagingSpec { film, grid, settings } = &spec;
        let layers = &scene.layers;
        let radius_px = radii_px(layers);
        let extent_mm = extent_of(&radius_px, film, settings);
        let middle_nm = middle_nm(grid);
        let maps: Vec<FilmMap> =
            layers.dioptres().par_iter().map(|&d| lens.film_map(d, middle_nm, extent_mm)).collect();

        // Find the cells in which a layer has anything, and halve them until the spline follows the PSFs.
        let wavelengths_nm = grid.centers_nm();
        let wavelengths_nm = [wavelengths_nm[0], wavelengths_nm[wavelengths_nm.len() - 1], middle_nm];
        let ends: Vec<FilmMap> = wavelengths_nm
            .into_par_iter()
            .flat_map(|w| [0, layers.len() - 1].map(|l| lens.film_map(layers.dioptres()[l], w, extent_mm)))
            .collect();
        let surfaces: Vec<&LayerCoordinates> =
            std::iter::once(&scene.layer_coordinates).chain(scene.occluded.layer_coordinates()).collect();
        let extents = Extents { radius_px: &radius_px, maps: &ends, surfaces: &surfaces };
        let active = active_cells_of(film, view, &extents, settings, cancel)?;
        let work = Work::new(cancel, progress, range, active.iter().map(Vec::len).sum::<usize>() as u64);
        let stopwatch = Stopwatch::default();
        let film_lens =
            FilmLens { image: lens, film, layers, maps: &maps, wavelength_nm: middle_nm, stopwatch: &stopwatch };
        let all_cells = active.concat();
        let content_factor = content_factor(film, &all_cells);
        let on_pixels = LayerRaster::new(film, content_factor, (view, scene.size()), &maps[0]).sampler;
        let content = BlockLayers::find(&on_pixels, &all_cells, extents.maps, extents.surfaces, cancel)?;
        let seen = (active, (&content, &on_pixels.frame));
        let mut tiling = Tiling::new(seen, &film_lens, settings, &wavelengths_nm, &work)?;
        let mut kept = Kept { budget_bytes: KEPT_BUDGET_BYTES, ..Kept::default() };
        // Where colors differ most.
        let wavelengths: Vec<(usize, f64)> =
            few_of(&scene.kernel_bands).map(|band| (band, grid.centers_nm()[band])).collect();
        let largest = match settings.smoothing_px {
            0 => Largest::default(),
            length_px => {
                smooth_seams(&mut tiling, (&film_lens, extent_mm), &wavelengths, length_px, &mut kept, cancel)?
            }
        };
        let rasters_of = |(tiles, map): (&LayerTiles, &FilmMap)| -> BTreeMap<usize, LayerRaster> {
            let raster = |&factor: &usize| (factor, LayerRaster::new(film, factor, (view, scene.size()), map));
            tiles.patches.keys().map(raster).collect()
        };
        let rasters: Vec<_> = tiling.layers.iter().zip(&maps).map(rasters_of).collect();
        let blocks = blocks_of(&rasters, &tiling, (content_factor, content), &extents, cancel)?;
        let halos = Halos::of((lens, layers), (film, settings.widest_blur_px), &wavelengths, grid.len());
        let n_covered = match hides(settings, layers) {
            true => n_covered(&tiling, &blocks, &radius_px, film),
            false => 0,
        };
        let kept = Mutex::new(kept);
        Ok(Self {
            scene,
            rasters,
            tiling,
            blocks,
            extent_mm,
            kept,
            largest,
            n_covered,
            maps: Mutex::default(),
            levels: OnceLock::new(),
            halos,
            stopwatch,
            in_flight_bytes: None,
            spec,
        })
    }

    /// The bytes of memory that it takes, what it shares with other parts of a pupil left out.
    pub(crate) fn size_bytes(&self) -> usize {
        let maps = self.maps().values().flat_map(|maps| maps.iter()).map(FilmMap::size_bytes).sum::<usize>();
        let blocks = self.blocks.values().map(BlockLayers::size_bytes).sum::<usize>();
        maps + blocks + self.tiling.size_bytes() + self.kept().size_bytes
    }

    /// Keeps at most so many bytes of kernels and alpha from now on; alpha that was kept is dropped.
    pub(crate) fn keep_at_most(&mut self, budget_bytes: usize) {
        self.kept().limit(budget_bytes);
    }

    /// Drops the maps of the bands that were asked for; they are made again where they are.
    pub(crate) fn drop_maps(&self) {
        self.maps().clear();
    }

    /// Rows and columns of the scene.
    pub(crate) fn size(&self) -> (usize, usize) {
        self.scene.size()
    }

    fn hides(&self) -> bool {
        hides(&self.spec.settings, &self.scene.layers)
    }

    fn maps(&self) -> MutexGuard<'_, BTreeMap<usize, Arc<Vec<FilmMap>>>> {
        self.maps.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn kept(&self) -> MutexGuard<'_, Kept> {
        // Whoever panicked with the lock had nothing half-written in it.
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn check_band(&self, band: usize) -> Result<(), ForwardError> {
        let n_bands = self.spec.grid.len();
        if band < n_bands { Ok(()) } else { Err(ForwardError::NoSuchBand { band, n_bands }) }
    }

    /// Returns the maps of all layers in a band, kept or new.
    fn maps_at(&self, lens: &dyn LensImage, band: usize) -> Arc<Vec<FilmMap>> {
        if let Some(maps) = self.maps().get(&band) {
            return maps.clone();
        }
        let wavelength_nm = self.spec.grid.centers_nm()[band];
        let map = |&dioptres: &f64| lens.film_map(dioptres, wavelength_nm, self.extent_mm);
        let maps: Arc<Vec<FilmMap>> = Arc::new(self.scene.layers.dioptres().par_iter().map(map).collect());
        self.maps().insert(band, maps.clone());
        maps
    }

    /// Returns the kernels of a band, between the two bands around it at which they are computed.
    pub(crate) fn kernels(&self, lens: &dyn LensImage, band: usize, work: &Work<'_>) -> Result<BandKernels, Cancelled> {
        let above = self.scene.kernel_bands.partition_point(|&knot| knot < band);
        let upper = self.scene.kernel_bands[above];
        if upper == band {
            return self.computed_kernels(lens, band, work);
        }
        let lower = self.scene.kernel_bands[above - 1];
        let fraction = (band - lower) as f32 / (upper - lower) as f32;
        let lower = self.computed_kernels(lens, lower, work)?;
        Ok(lower.mixed(&self.computed_kernels(lens, upper, work)?, fraction))
    }

    /// Returns the kernels of a band at which they are computed, kept or new.
    fn computed_kernels(&self, lens: &dyn LensImage, band: usize, work: &Work<'_>) -> Result<BandKernels, Cancelled> {
        if let Some(kernels) = self.kept().kernels.get(&band) {
            work.advance(kernels.n_kernels() as u64 * KERNEL_UNITS);
            return Ok(kernels.clone());
        }
        let maps = self.maps_at(lens, band);
        let by_layer = self.tiling.kernels_at(&self.film_lens(lens, band, &maps), work)?;
        let kernels = BandKernels { by_layer: Arc::new(by_layer) };
        self.kept().keep(band, &kernels);
        Ok(kernels)
    }

    /// The lens in a band, of which these are the maps.
    fn film_lens<'a>(&'a self, image: &'a dyn LensImage, band: usize, maps: &'a [FilmMap]) -> FilmLens<'a> {
        FilmLens {
            image,
            film: &self.spec.film,
            layers: &self.scene.layers,
            maps,
            wavelength_nm: self.spec.grid.centers_nm()[band],
            stopwatch: &self.stopwatch,
        }
    }

    /// Returns the basis of a band between the two around it at which they are computed.
    pub(crate) fn basis_between(
        &self,
        lens: &dyn LensImage,
        band: usize,
        work: &Work<'_>,
    ) -> Result<BasisBetween, Cancelled> {
        let above = self.scene.basis_bands.partition_point(|&knot| knot < band);
        let (upper, lower) = (self.scene.basis_bands[above], self.scene.basis_bands[above.saturating_sub(1)]);
        let upper_basis = self.basis(lens, upper, work)?;
        let lower_basis = if upper == band { upper_basis.clone() } else { self.basis(lens, lower, work)? };
        self.between(lens, (band, [lower, upper]), [&lower_basis, &upper_basis], work)
    }

    /// Returns the basis of a band between two, or of one of them; its kernels are its own where kernels are computed at bands between.
    pub(crate) fn between(
        &self,
        lens: &dyn LensImage,
        (band, pair): (usize, [usize; 2]),
        [lower, upper]: [&BandBasis; 2],
        work: &Work<'_>,
    ) -> Result<BasisBetween, Cancelled> {
        let fraction = (band - pair[0]) as f32 / (pair[1] - pair[0]).max(1) as f32;
        let kernels = match self.has_kernels_within(pair) && !pair.contains(&band) {
            true => self.kernels(lens, band, work)?,
            false => lower.kernels.mixed(&upper.kernels, fraction),
        };
        Ok(BasisBetween::new(kernels, [lower, upper], fraction))
    }

    /// Whether kernels are computed at bands between two.
    fn has_kernels_within(&self, [lower, upper]: [usize; 2]) -> bool {
        self.scene.kernel_bands.iter().any(|band| (lower + 1..upper).contains(band))
    }

    /// Returns the basis of a band at which it is computed.
    pub(crate) fn basis(&self, lens: &dyn LensImage, band: usize, work: &Work<'_>) -> Result<BandBasis, Cancelled> {
        let kernels = self.kernels(lens, band, work)?;
        if !self.hides() {
            return Ok(BandBasis { kernels, alpha: None });
        }
        let kept = self.kept().alpha.get(&band).cloned();
        let alpha = match kept {
            Some(alpha) => {
                work.advance(self.tiling.n_patches() as u64 * PATCH_UNITS);
                alpha
            }
            None => Arc::new(self.alpha_of_layers(lens, band, &kernels, work)?),
        };
        let mut kept = self.kept();
        if !kept.alpha.contains_key(&band) && kept.takes(alpha.iter().map(LayerAlpha::size_bytes).sum()) {
            kept.alpha.insert(band, alpha.clone());
        }
        Ok(BandBasis { kernels, alpha: Some(alpha) })
    }

    /// Returns what of the film each layer covers in a band.
    fn alpha_of_layers(
        &self,
        lens: &dyn LensImage,
        band: usize,
        kernels: &BandKernels,
        work: &Work<'_>,
    ) -> Result<Vec<LayerAlpha>, Cancelled> {
        let surfaces: Vec<Surface<'_>> = std::iter::once(&self.scene.layer_coordinates)
            .chain(self.scene.occluded.layer_coordinates())
            .map(|depths| depths.surface(None))
            .collect();
        let maps = self.maps_at(lens, band);
        let levels = self.levels_at(lens, band, work)?;
        let covered = |layer: usize| {
            let mut blurred = self.blank();
            let surfaces = (surfaces.as_slice(), levels[layer].as_ref());
            self.blur_onto_film((layer, &maps[layer]), surfaces, kernels, &mut blurred, work)?;
            Ok(blurred.into_alpha())
        };
        (0..self.scene.layers.len()).into_par_iter().map(covered).collect()
    }

    /// Returns what levels the alpha of each layer in a band: between a few bands, over which it changes little.
    fn levels_at(&self, lens: &dyn LensImage, band: usize, work: &Work<'_>) -> Result<Vec<Option<Level>>, Cancelled> {
        if !self.spec.settings.levels_wide_blur {
            return Ok(vec![None; self.scene.layers.len()]);
        }
        let levels = match self.levels.get() {
            Some(levels) => levels,
            None => {
                let at = |band: usize| {
                    let maps = self.maps_at(lens, band);
                    let film_lens = self.film_lens(lens, band, &maps);
                    let of =
                        |layer: usize| Level::of(&film_lens, layer, self.scene.layers.radius_px_at(layer as f32), work);
                    let levels = (0..self.scene.layers.len()).into_par_iter().map(of);
                    Ok((band, levels.collect::<Result<_, Cancelled>>()?))
                };
                let levels: BTreeMap<usize, Vec<Option<Level>>> =
                    few_of(&self.scene.basis_bands).map(at).collect::<Result<_, Cancelled>>()?;
                self.levels.get_or_init(|| levels)
            }
        };
        let (Some((lower, below)), Some((upper, above))) =
            (levels.range(..=band).next_back(), levels.range(band..).next())
        else {
            return Ok(vec![None; self.scene.layers.len()]);
        };
        let fraction = (band - lower) as f64 / (upper - lower).max(1) as f64;
        let pairs = below.iter().zip(above);
        Ok(pairs.map(|(below, above)| Level::between(below.as_ref(), above.as_ref(), fraction)).collect())
    }

    /// Returns the units of work of all bands from `first` on; with `alone`, a basis is computed again for each pair of bands that it is an end of.
    pub(crate) fn stream_units(&self, first: usize, alone: bool) -> u64 {
        let n_patches = self.tiling.n_patches() as u64;
        let n_kernels = self.tiling.n_knots() as u64 * self.scene.kernel_bands.len() as u64;
        let n_bases = self.scene.basis_bands.len() * if alone { 2 } else { 1 };
        let n_planes = self.spec.grid.len().saturating_sub(first) + if self.hides() { n_bases } else { 0 };
        n_patches * n_planes as u64 * PATCH_UNITS + n_kernels * KERNEL_UNITS
    }

    /// Returns the pairs of neighboring bands whose bases are computed, each with the bands from `first` on that lie between them; a single band is
    /// a pair of its own.
    pub(crate) fn bands_between_bases(&self, first: usize) -> Vec<([usize; 2], Vec<usize>)> {
        let bases = &self.scene.basis_bands;
        let last = bases[bases.len() - 1];
        let single = (bases.len() == 1).then_some([last; 2]);
        let pairs = bases.windows(2).map(|pair| [pair[0], pair[1]]).chain(single);
        let with_bands =
            |pair: [usize; 2]| (pair, (pair[0].max(first)..pair[1] + usize::from(pair[1] == last)).collect());
        pairs.map(with_bands).filter(|(_, bands): &(_, Vec<usize>)| !bands.is_empty()).collect()
    }

    /// How many bands between two bases are worked on at once: more than there are threads, so that none waits, where pictures are small.
    ///
    /// Where their bytes are limited the bases count, and each band has kernels of its own.
    pub(crate) fn bands_at_once(&self, bases: [&BandBasis; 2]) -> usize {
        let threads = rayon::current_num_threads();
        let Some(limit) = self.in_flight_bytes else {
            let own_kernels = if self.has_bands_with_own_kernels() { bases[0].kernels.size_bytes() } else { 0 };
            return (IN_FLIGHT_BYTES / (self.plane_bytes() + own_kernels).max(1)).clamp(threads.min(4), 4 * threads);
        };
        let left = limit.saturating_sub(bases.map(BandBasis::size_bytes).iter().sum());
        let band = self.plane_bytes() + spread_bytes(&self.largest.blocks) + bases[0].kernels.size_bytes();
        (left / band.max(1)).clamp(1, 4 * threads)
    }

    /// Whether kernels are computed at bands between those at which the coverage of layers is.
    fn has_bands_with_own_kernels(&self) -> bool {
        self.scene.basis_bands.windows(2).any(|pair| self.has_kernels_within([pair[0], pair[1]]))
    }

    /// What the planes of a band take while it is imaged, bytes: those of the film, or of the scene where that is larger.
    fn plane_bytes(&self) -> usize {
        // Light, what is uncovered, a blurred layer and the samples that are spread by knots, of which some planes are never whole: wide pixels and what is in
        // flight take as much less.
        const PLANES: usize = 4;
        let (Film { rows, columns, .. }, (scene_rows, scene_columns)) = (self.spec.film, self.size());
        PLANES * size_of::<f32>() * (rows * columns).max(scene_rows * scene_columns)
    }

    /// About what a band takes while it is imaged, bytes: its planes, what is spread around knots before it is added to them, and kernels as far as the plan
    /// has seen any.
    pub(crate) fn band_bytes(&self) -> usize {
        self.plane_bytes() + spread_bytes(&self.largest.blocks) + self.largest.kernel_bytes
    }

    /// About what two bases take, bytes: the coverage of layers where they hide each other, and kernels as far as the plan has seen any; and what threads
    /// transform in.
    pub(crate) fn bases_bytes(&self) -> usize {
        // .9 to 1.5 times as much as this coverage was measured.
        let bases = 2 * (size_of::<f32>() * self.n_covered + self.largest.kernel_bytes);
        bases + rayon::current_num_threads() * buffer_bytes(&self.largest.blocks)
    }

    /// Reads a band and images it.
    pub(crate) fn image_of(
        &self,
        lens: &dyn LensImage,
        band: usize,
        basis: &BasisBetween,
        radiance: &SceneRadiance<'_>,
        work: &Work<'_>,
    ) -> Result<Array2<f32>, ForwardError> {
        work.check()?;
        let front = radiance.front.band(band)?;
        let needed = radiance.occluded.filter(|_| self.scene.occluded.needs_radiance());
        let occluded = needed.map(|occluded| occluded.band(band)).transpose()?;
        let light = BandRadiance { front: &front, occluded: occluded.as_deref() };
        light.check(self.size(), self.scene.occluded.needs_radiance())?;
        Ok(self.image(lens, band, basis, light, work)?)
    }

    pub(crate) fn image(
        &self,
        lens: &dyn LensImage,
        band: usize,
        basis: &BasisBetween,
        light: BandRadiance<'_>,
        work: &Work<'_>,
    ) -> Result<Array2<f32>, Cancelled> {
        let maps = self.maps_at(lens, band);
        let front = self.scene.mixed.unmixed(light.front);
        let occluded = self.scene.occluded.samples(&front, light.occluded, work.cancel())?;
        let front = front.as_standard_layout();
        let occluded = occluded.as_ref().map(|samples| samples.as_standard_layout());
        let mut surfaces = vec![self.scene.layer_coordinates.surface(front.as_slice())];
        if let (Some(radiance), Some(depths)) = (&occluded, self.scene.occluded.layer_coordinates()) {
            surfaces.push(depths.surface(radiance.as_slice()));
        }
        let Film { rows, columns, .. } = self.spec.film;
        let mut blurred = self.blank();
        if let ([map], false) = (maps.as_slice(), self.hides()) {
            self.blur_onto_film((0, map), (&surfaces, None), &basis.kernels, &mut blurred, work)?;
            return Ok(self.finished(band, || blurred.into_picture()));
        }
        let mut picture = Composite::new(rows, columns);
        for (layer, map) in maps.iter().enumerate() {
            self.blur_onto_film((layer, map), (&surfaces, None), &basis.kernels, &mut blurred, work)?;
            self.stopwatch.time(Part::Compositing, || {
                if let Some(alpha) = basis.alpha(layer) {
                    return picture.composite_under(&mut blurred, alpha, work.cancel());
                }
                picture.add(&mut blurred);
                Ok(())
            })?;
        }
        let finish = || if self.hides() { picture.finish() } else { picture.finish_sum() };
        Ok(self.finished(band, finish))
    }

    /// Returns the picture of a band with the halos of its points.
    fn finished(&self, band: usize, picture: impl FnOnce() -> Array2<f32>) -> Array2<f32> {
        self.stopwatch.time(Part::Compositing, || self.halos.applied(band, picture()))
    }

    /// A plane of the film with nothing on it.
    fn blank(&self) -> BlurredPlane {
        let Film { rows, columns, .. } = self.spec.film;
        BlurredPlane::new(rows, columns)
    }

    /// Adds the light of a layer, or its alpha, levelled, where the surfaces have no radiance, blurred, to a plane of the film.
    fn blur_onto_film(
        &self,
        (layer, map): (usize, &FilmMap),
        (surfaces, level): (&[Surface<'_>], Option<&Level>),
        kernels: &BandKernels,
        blurred: &mut BlurredPlane,
        work: &Work<'_>,
    ) -> Result<(), Cancelled> {
        for (factor, patches) in &self.tiling.layers[layer].patches {
            let LayerRaster { film, sampler } = &self.rasters[layer][factor];
            let task = LayerTask {
                sampler,
                map,
                layer,
                surfaces,
                blocks: &self.blocks[factor],
                patches,
                kernels: &kernels.by_layer[layer],
                level,
                film_rows: film.rows,
                film_columns: film.columns,
                smoothing_px: self.tiling.layers[layer].smoothing_px,
                negligible_edge: self.spec.settings.negligible_edge,
                stopwatch: &self.stopwatch,
            };
            if *factor == 1 {
                blur_layer(&task, blurred, work, PATCH_UNITS)?;
                continue;
            }
            let mut coarse = BlurredPlane::new(film.rows, film.columns);
            blur_layer(&task, &mut coarse, work, PATCH_UNITS)?;
            self.stopwatch.time(Part::Compositing, || blurred.add_magnified(&coarse, *factor, work.cancel()))?;
        }
        Ok(())
    }
}

/// How far layers reach.
struct Extents<'a> {
    /// Blur radius of each layer, pixels of the film.
    radius_px: &'a [f64],
    /// At the ends of the bands and of the depths.
    maps: &'a [FilmMap],
    /// Layer coordinates of the scene's surfaces.
    surfaces: &'a [&'a LayerCoordinates],
}

/// Finds the cells of each layer in which it has anything.
fn active_cells_of(
    film: &Film,
    view: View,
    extents: &Extents<'_>,
    settings: &Settings,
    cancel: &Cancel,
) -> Result<Vec<Vec<Cell>>, Cancelled> {
    let Extents { radius_px, maps, surfaces } = *extents;
    let n_layers = radius_px.len();
    let samples: Vec<&Array2<f32>> = surfaces.iter().map(|surface| surface.samples()).collect();
    let frame = FilmFrame::new(film, 1);
    // Layers by the factor of their coarsest raster: what is imaged on wide pixels has cells as much larger.
    let mut by_factor: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (layer, &radius_px) in radius_px.iter().enumerate() {
        by_factor.entry(LayerRaster::factor_for(radius_px, settings.widest_blur_px)).or_default().push(layer);
    }
    let mut active = vec![vec![]; n_layers];
    for (factor, layers) in by_factor {
        let pad_px = layers.iter().map(|&layer| pad_for(radius_px[layer])).fold(0.0, f64::max);
        let cells = cells_over(film, pad_px.ceil() as usize, settings.knot_spacing_px * factor);
        let seen = Seen { view: &view, frame: &frame, margin_px: 0.5 * (factor - 1) as f64 };
        let mut found = active_cells(&cells, seen, maps, &samples, n_layers, cancel)?;
        for layer in layers {
            active[layer] = joined_for(2.0 * radius_px[layer], factor, std::mem::take(&mut found[layer]));
        }
    }
    Ok(active)
}

/// What the largest kernels of a band take.
#[derive(Clone, Copy, Debug, Default)]
struct Largest {
    /// All kernels of a band, bytes.
    kernel_bytes: usize,
    blocks: SpreadBlocks,
}

/// Smooths weights of knots where kernels of some bands would leave seams. Keeps these kernels, which imaging needs anyway, and returns what the largest take.
fn smooth_seams(
    tiling: &mut Tiling,
    (film_lens, extent_mm): (&FilmLens<'_>, f64),
    wavelengths: &[(usize, f64)],
    length_px: usize,
    kept: &mut Kept,
    cancel: &Cancel,
) -> Result<Largest, Cancelled> {
    let (mut kernel_bytes, mut of_bands) = (0, vec![]);
    let mut seams = tiling.seams();
    for &(band, wavelength_nm) in wavelengths {
        let map = |&dioptres: &f64| film_lens.image.film_map(dioptres, wavelength_nm, extent_mm);
        let maps: Vec<FilmMap> = film_lens.layers.dioptres().par_iter().map(map).collect();
        let film_lens = FilmLens { maps: &maps, wavelength_nm, ..*film_lens };
        let by_layer = Arc::new(tiling.kernels_at(&film_lens, &Work::unobserved(cancel))?);
        tiling.add_band(&mut seams, &by_layer, cancel)?;
        of_bands.push(by_layer.clone());
        let kernels = BandKernels { by_layer };
        kernel_bytes = kernel_bytes.max(kernels.size_bytes());
        kept.keep(band, &kernels);
    }
    tiling.smooth(seams, length_px);
    let size = (film_lens.film.rows, film_lens.film.columns);
    // The allocator holds a tenth more than many kernels are.
    Ok(Largest { kernel_bytes: kernel_bytes + kernel_bytes / 10, blocks: tiling.spread_blocks(&of_bands, size) })
}

/// Returns about how many pixels of the film layers cover, all layers together.
fn n_covered(tiling: &Tiling, blocks: &BTreeMap<usize, BlockLayers>, radius_px: &[f64], film: &Film) -> usize {
    let of_layer = |(layer, tiles): (usize, &LayerTiles)| {
        let on_raster = |factor: &usize| {
            let size = (film.rows.div_ceil(*factor), film.columns.div_ceil(*factor));
            factor * factor * blocks[factor].n_reached(layer, radius_px[layer] / *factor as f64, size)
        };
        tiles.patches.keys().map(on_raster).sum::<usize>().min(film.rows * film.columns)
    };
    tiling.layers.par_iter().enumerate().map(of_layer).sum()
}

/// Returns how many times as wide as the film's pixels are to be in whose blocks all that layers have is looked for: there are no more blocks than over four films, or over a
/// million pixels, however far beyond the film light is blurred from.
fn content_factor(film: &Film, cells: &[Cell]) -> usize {
    let frame = FilmFrame::new(film, 1);
    let n_pixels = Rectangle::around(cells.iter().map(|cell| cell.pixels(&frame))).map_or(0, |all| all.len());
    let most = (4 * film.rows * film.columns).max(1 << 20);
    let mut factor = 1;
    while n_pixels > most * factor * factor {
        factor *= 2;
    }
    factor
}

/// Finds the layers of the blocks of pixels over all patches, by the factor of their raster; those of one are known.
fn blocks_of(
    rasters: &[BTreeMap<usize, LayerRaster>],
    tiling: &Tiling,
    known: (usize, BlockLayers),
    extents: &Extents<'_>,
    cancel: &Cancel,
) -> Result<BTreeMap<usize, BlockLayers>, Cancelled> {
    let mut cells: BTreeMap<usize, Vec<Cell>> = BTreeMap::new();
    for (&factor, patches) in
        tiling.layers.iter().flat_map(|tiles| &tiles.patches).filter(|(factor, _)| **factor != known.0)
    {
        cells.entry(factor).or_default().extend(patches.iter().map(|patch| patch.cell));
    }
    let blocks = cells.iter().filter_map(|(&factor, cells)| {
        let LayerRaster { sampler, .. } = rasters.iter().find_map(|rasters| rasters.get(&factor))?;
        let found = BlockLayers::find(sampler, cells, extents.maps, extents.surfaces, cancel);
        Some(found.map(|found| (factor, found)))
    });
    blocks.chain([Ok(known)]).collect()
}

/// Returns how far beyond the film light is taken from, pixels: the 95 % radius of a blur, doubled, holds all but the
/// faintest of its light.
fn pad_for(radius_px: f64) -> f64 {
    2.0 * radius_px + 8.0
}

/// Returns a few fields over the film, of which the blur tells that of all: from the axis outwards, or all over it.
fn blur_fields(kernels: &dyn LensImage, map: &FilmMap, film: &Film) -> Vec<DVec2> {
    if kernels.is_symmetric() {
        let corner = map.field_tan(DVec2::X * film.half_diagonal_mm());
        return [0.0, 0.5, 1.0].map(|part| part * corner).to_vec();
    }
    let half_mm = 0.5e-3 * film.pitch_um * DVec2::new(film.columns as f64, film.rows as f64);
    let parts = [-1.0, 0.0, 1.0];
    let places = parts.iter().flat_map(|&up| parts.iter().map(move |&across| DVec2::new(across, up)));
    places.map(|place| map.field_tan(place * half_mm)).collect()
}
