//! The work of a plan: layers of depth over the film, their kernels, and the imaging of a band.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use dioptric_psf::{FilmMap, LensImage};
use dioptric_spectrum::{Cancel, Cancelled, WavelengthGrid};
use glam::DVec2;
use ndarray::Array2;
use rayon::prelude::*;

use crate::{
    BandKernels, BandRadiance, BlurMode, Film, ForwardError, ImagingSpec, SceneGeometry, SceneRadiance, Settings, Sink,
    basis::{BandBasis, BasisBetween, Kept},
    block_layers::BlockLayers,
    blur::{LayerTask, blur_layer},
    geometry::check_extent,
    lateral_color::LateralColor,
    layers::{Blurs, Layers},
    occluded::OccludedSamples,
    occlusion::{BlurredPlane, Composite, LayerAlpha},
    raster::LayerRaster,
    sampler::{LayerCoordinates, Surface},
    stopwatch::{Part, Stopwatch},
    tiles::{Cell, FilmLens, Tiling, active_cells, cells_over, joined_for},
    work::{Progress, Watch, Work, plane_of},
};

/// Kernels and alpha that a plan keeps when nothing else is asked for, bytes.
const KEPT_BUDGET_BYTES: usize = 256 << 20;

/// What bands in flight take when nothing else is asked for, bytes.
const IN_FLIGHT_BYTES: usize = 256 << 20;

/// A plan but for the lens, which each method takes.
pub(crate) struct Layout {
    pub(crate) spec: ImagingSpec,
    /// The bands at which PSFs are computed; between them they are interpolated.
    kernel_bands: Vec<usize>,
    /// Those and more, at which the alpha of layers is computed: interpolated between them as well.
    basis_bands: Vec<usize>,
    pub(crate) layers: Layers,
    /// Of each layer.
    rasters: Vec<LayerRaster>,
    tiling: Tiling,
    /// By the factor of their raster.
    blocks: BTreeMap<usize, BlockLayers>,
    layer_coordinates: LayerCoordinates,
    pub(crate) occluded: OccludedSamples,
    /// How far off axis light is taken from, mm.
    extent_mm: f64,
    pub(crate) kept: Mutex<Kept>,
    /// Of each band that was asked for, those of all layers.
    maps: Mutex<BTreeMap<usize, Arc<Vec<FilmMap>>>>,
    pub(crate) stopwatch: Stopwatch,
    /// Bytes that bands in flight may take; `None` for the usual ones, and as many bands as there are threads (up to four) at least.
    pub(crate) in_flight_bytes: Option<usize>,
}

/// Layers of depth over a film, each on its raster.
struct Stack {
    layers: Layers,
    kernel_bands: Vec<usize>,
    /// Blur radius of each layer, pixels of the film.
    radius_px: Vec<f64>,
    rasters: Vec<LayerRaster>,
    /// Of each layer, in the middle band.
    maps: Vec<FilmMap>,
    extent_mm: f64,
}

impl Stack {
    fn over(lens: &dyn LensImage, scene: &SceneGeometry<'_>, spec: &ImagingSpec, dioptres: (f64, f64)) -> Self {
        let ImagingSpec { film, grid, settings } = spec;
        let (pitch_mm, corner_mm, middle_nm) = (1e-3 * film.pitch_um, film.half_diagonal_mm(), middle_nm(grid));
        let fields = blur_fields(lens, &lens.film_map(dioptres.0, middle_nm, corner_mm), film);
        let blurs = Blurs { kernels: lens, pitch_mm, fields: &fields, wavelengths_nm: grid.centers_nm() };
        let layers = Layers::over(dioptres, settings.layer_step_px, &blurs);
        let kernel_bands = layers.chromatic_knots(settings.chromatic_step_px, &blurs);
        let radius_px: Vec<f64> = (0..layers.len()).map(|layer| layers.radius_px_at(layer as f32)).collect();
        let pad_px = radius_px.iter().map(|&radius_px| pad_for(radius_px)).fold(0.0, f64::max);
        let border_px = pad_px + 2.0 * settings.knot_spacing_px as f64;
        let extent_mm = corner_mm + pitch_mm * std::f64::consts::SQRT_2 * border_px;
        let maps: Vec<FilmMap> =
            layers.dioptres().par_iter().map(|&d| lens.film_map(d, middle_nm, extent_mm)).collect();
        let view = (scene.view, scene.size());
        let factor = |radius_px: f64| LayerRaster::factor_for(radius_px, settings.widest_blur_px);
        let raster = |(&radius_px, map)| LayerRaster::new(film, factor(radius_px), view, map);
        let rasters = radius_px.iter().zip(&maps).map(raster).collect();
        Self { layers, kernel_bands, radius_px, rasters, maps, extent_mm }
    }
}

/// The wavelength of the middle band.
fn middle_nm(grid: &WavelengthGrid) -> f64 {
    grid.centers_nm()[grid.len() / 2]
}

/// Whether layers hide those behind them.
fn hides(settings: &Settings, layers: &Layers) -> bool {
    settings.mode == BlurMode::Layered && layers.len() > 1
}

/// Units of work of a kernel and of a patch of the film in one band, about in proportion to their time.
const KERNEL_UNITS: u64 = 1;
const PATCH_UNITS: u64 = 8;

impl Layout {
    pub(crate) fn new(
        lens: &dyn LensImage,
        scene: &SceneGeometry<'_>,
        spec: ImagingSpec,
        progress: &Progress<'_>,
        range: (f64, f64),
        cancel: &Cancel,
    ) -> Result<Self, ForwardError> {
        let ImagingSpec { film, grid, settings } = &spec;
        film.check()?;
        settings.check()?;
        scene.check()?;
        let (near_m, far_m) = scene.depth.range_m();
        let dioptres = (1.0 / far_m, 1.0 / near_m);
        check_extent(lens, grid, dioptres, film, cancel)?;

        let stack = Stack::over(lens, scene, &spec, dioptres);
        let Stack { layers, kernel_bands, radius_px, rasters, maps, extent_mm } = stack;
        let z_m = scene.depth.z_m();
        let coordinate = |row: usize, column: usize| layers.coordinate_of(z_m[(row, column)]);
        let layer_coordinates = LayerCoordinates::new(plane_of(z_m.dim(), cancel, coordinate)?, cancel)?;
        let scene_per_film = LayerRaster::new(film, 1, (scene.view, scene.size()), &maps[0]).sampler.scene_per_film;
        let occluded = OccludedSamples::find(scene, &layers, settings, scene_per_film, cancel)?;

        // Find the cells in which a layer has anything, and halve them until the spline follows the PSFs.
        let (wavelengths_nm, middle_nm) = (grid.centers_nm(), middle_nm(grid));
        let ends: Vec<FilmMap> = [wavelengths_nm[0], wavelengths_nm[wavelengths_nm.len() - 1], middle_nm]
            .into_par_iter()
            .flat_map(|w| [0, layers.len() - 1].map(|l| lens.film_map(layers.dioptres()[l], w, extent_mm)))
            .collect();
        let surfaces: Vec<&LayerCoordinates> =
            std::iter::once(&layer_coordinates).chain(occluded.layer_coordinates()).collect();
        let extents = Extents { radius_px: &radius_px, maps: &ends, surfaces: &surfaces };
        let (active, blocks) = active_cells_of(&rasters, &extents, settings.knot_spacing_px, cancel)?;
        let work = Work::new(cancel, progress, range, active.iter().map(Vec::len).sum::<usize>() as u64);
        let stopwatch = Stopwatch::default();
        let film_lens = FilmLens {
            image: lens,
            rasters: &rasters,
            layers: &layers,
            maps: &maps,
            wavelength_nm: middle_nm,
            stopwatch: &stopwatch,
        };
        let tiling = Tiling::new(active, &film_lens, settings, &work)?;
        let kept = Mutex::new(Kept { budget_bytes: KEPT_BUDGET_BYTES, ..Kept::default() });
        let basis_bands = match hides(settings, &layers) {
            true => {
                LateralColor { lens, film, grid, extent_mm }.knots(&kernel_bands, dioptres, settings.coverage_step_px)
            }
            false => kernel_bands.clone(),
        };
        Ok(Self {
            basis_bands,
            kernel_bands,
            layers,
            rasters,
            tiling,
            blocks,
            layer_coordinates,
            occluded,
            extent_mm,
            kept,
            maps: Mutex::default(),
            stopwatch,
            in_flight_bytes: None,
            spec,
        })
    }

    pub(crate) fn size_bytes(&self) -> usize {
        let planes = self.layer_coordinates.size_bytes()
            + self.occluded.layer_coordinates().map_or(0, LayerCoordinates::size_bytes);
        let maps = self.maps().values().flat_map(|maps| maps.iter()).map(FilmMap::size_bytes).sum::<usize>();
        let blocks = self.blocks.values().map(BlockLayers::size_bytes).sum::<usize>();
        planes + maps + blocks + self.occluded.size_bytes() + self.tiling.size_bytes() + self.kept().size_bytes
    }

    /// Rows and columns of the scene.
    pub(crate) fn size(&self) -> (usize, usize) {
        self.layer_coordinates.samples().dim()
    }

    fn hides(&self) -> bool {
        hides(&self.spec.settings, &self.layers)
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
        let maps: Arc<Vec<FilmMap>> = Arc::new(self.layers.dioptres().par_iter().map(map).collect());
        self.maps().insert(band, maps.clone());
        maps
    }

    /// Returns the kernels of a band, between the two bands around it at which they are computed.
    pub(crate) fn kernels(&self, lens: &dyn LensImage, band: usize, work: &Work<'_>) -> Result<BandKernels, Cancelled> {
        let above = self.kernel_bands.partition_point(|&knot| knot < band);
        let upper = self.kernel_bands[above];
        if upper == band {
            return self.computed_kernels(lens, band, work);
        }
        let lower = self.kernel_bands[above - 1];
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
        let wavelength_nm = self.spec.grid.centers_nm()[band];
        let film_lens = FilmLens {
            image: lens,
            rasters: &self.rasters,
            layers: &self.layers,
            maps: &maps,
            wavelength_nm,
            stopwatch: &self.stopwatch,
        };
        let by_layer = self.tiling.kernels_at(&film_lens, work)?;
        let kernels = BandKernels { by_layer: Arc::new(by_layer) };
        let mut kept = self.kept();
        if !kept.kernels.contains_key(&band) && kept.takes(kernels.size_bytes()) {
            kept.kernels.insert(band, kernels.clone());
        }
        Ok(kernels)
    }

    /// Returns the basis of a band between the two around it at which they are computed.
    pub(crate) fn basis_between(
        &self,
        lens: &dyn LensImage,
        band: usize,
        work: &Work<'_>,
    ) -> Result<BasisBetween, Cancelled> {
        let above = self.basis_bands.partition_point(|&knot| knot < band);
        let (upper, lower) = (self.basis_bands[above], self.basis_bands[above.saturating_sub(1)]);
        if upper == band {
            let basis = self.basis(lens, band, work)?;
            return Ok(BasisBetween::new(&basis, &basis, 0.0));
        }
        let fraction = (band - lower) as f32 / (upper - lower) as f32;
        Ok(BasisBetween::new(&self.basis(lens, lower, work)?, &self.basis(lens, upper, work)?, fraction))
    }

    /// Returns the basis of a band at which it is computed.
    fn basis(&self, lens: &dyn LensImage, band: usize, work: &Work<'_>) -> Result<BandBasis, Cancelled> {
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
        let surfaces: Vec<Surface<'_>> = std::iter::once(&self.layer_coordinates)
            .chain(self.occluded.layer_coordinates())
            .map(|depths| depths.surface(None))
            .collect();
        let maps = self.maps_at(lens, band);
        let covered = |layer: usize| {
            let mut blurred = self.blank();
            self.blur_onto_film(layer, &maps[layer], &surfaces, kernels, &mut blurred, work)?;
            Ok(blurred.into_alpha())
        };
        (0..self.layers.len()).into_par_iter().map(covered).collect()
    }

    /// Images the bands from `first` on.
    pub(crate) fn stream_from(
        &self,
        first: usize,
        lens: &dyn LensImage,
        radiance: &SceneRadiance<'_>,
        watch: &Watch<'_>,
        sink: &mut Sink<'_>,
    ) -> Result<(), ForwardError> {
        let n_bands = self.spec.grid.len();
        let n_patches = self.tiling.n_patches() as u64;
        let n_kernels = self.tiling.n_knots() as u64 * self.kernel_bands.len() as u64;
        let n_planes = n_bands.saturating_sub(first) + if self.hides() { self.basis_bands.len() } else { 0 };
        let n_units = n_patches * n_planes as u64 * PATCH_UNITS + n_kernels * KERNEL_UNITS;
        let work = Work::new(watch.cancel, watch.progress, watch.range, n_units);
        let mut hand_on = |band, picture| sink(band, picture).map_err(|reason| ForwardError::Sink { band, reason });
        let mut lower = None;
        let last = n_bands - 1;
        for pair in self.basis_bands.windows(2) {
            let bands: Vec<usize> = (pair[0].max(first)..pair[1] + usize::from(pair[1] == last)).collect();
            if bands.is_empty() {
                continue;
            }
            let below = match lower.take() {
                Some(basis) => basis,
                None => self.basis(lens, pair[0], &work)?,
            };
            let upper = self.basis(lens, pair[1], &work)?;
            for group in bands.chunks(self.bands_at_once()) {
                let pictures: Vec<Result<Array2<f32>, ForwardError>> = group
                    .par_iter()
                    .map(|&band| {
                        let fraction = (band - pair[0]) as f32 / (pair[1] - pair[0]) as f32;
                        let basis = BasisBetween::new(&below, &upper, fraction);
                        self.image_of(lens, band, &basis, radiance, &work)
                    })
                    .collect();
                for (&band, picture) in group.iter().zip(pictures) {
                    hand_on(band, picture?)?;
                }
            }
            lower = Some(upper);
        }
        if n_bands == 1 && first == 0 {
            let only = self.basis(lens, 0, &work)?;
            hand_on(0, self.image_of(lens, 0, &BasisBetween::new(&only, &only, 0.0), radiance, &work)?)?;
        }
        (watch.progress)(watch.range.1);
        Ok(())
    }

    /// How many bands are worked on at once: more than there are threads, so that none waits, where pictures are small.
    fn bands_at_once(&self) -> usize {
        let threads = rayon::current_num_threads();
        let least = if self.in_flight_bytes.is_some() { 1 } else { threads.min(4) };
        (self.in_flight_bytes.unwrap_or(IN_FLIGHT_BYTES) / self.band_bytes().max(1)).clamp(least, 4 * threads)
    }

    /// What a band takes while it is imaged, bytes: planes of the film, or of the scene where that is larger.
    pub(crate) fn band_bytes(&self) -> usize {
        const PLANES: usize = 4;
        let (Film { rows, columns, .. }, (scene_rows, scene_columns)) = (self.spec.film, self.size());
        PLANES * size_of::<f32>() * (rows * columns).max(scene_rows * scene_columns)
    }

    /// Reads a band and images it.
    fn image_of(
        &self,
        lens: &dyn LensImage,
        band: usize,
        basis: &BasisBetween,
        radiance: &SceneRadiance<'_>,
        work: &Work<'_>,
    ) -> Result<Array2<f32>, ForwardError> {
        work.check()?;
        let front = radiance.front.band(band)?;
        let needed = radiance.occluded.filter(|_| self.occluded.needs_radiance());
        let occluded = needed.map(|occluded| occluded.band(band)).transpose()?;
        let light = BandRadiance { front: &front, occluded: occluded.as_deref() };
        light.check(self.size(), self.occluded.needs_radiance())?;
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
        let occluded = self.occluded.samples(light.front, light.occluded, work.cancel())?;
        let front = light.front.as_standard_layout();
        let occluded = occluded.as_ref().map(|samples| samples.as_standard_layout());
        let mut surfaces = vec![self.layer_coordinates.surface(front.as_slice())];
        if let (Some(radiance), Some(depths)) = (&occluded, self.occluded.layer_coordinates()) {
            surfaces.push(depths.surface(radiance.as_slice()));
        }
        let Film { rows, columns, .. } = self.spec.film;
        let (mut picture, mut blurred) = (Composite::new(rows, columns), self.blank());
        for (layer, map) in maps.iter().enumerate() {
            self.blur_onto_film(layer, map, &surfaces, &basis.kernels, &mut blurred, work)?;
            self.stopwatch.time(Part::Compositing, || {
                if let Some(alpha) = basis.alpha(layer) {
                    return picture.composite_under(&mut blurred, alpha, work.cancel());
                }
                picture.add(&mut blurred);
                Ok(())
            })?;
        }
        let finish = || if self.hides() { picture.finish() } else { picture.finish_sum() };
        Ok(self.stopwatch.time(Part::Compositing, finish))
    }

    /// A plane of the film with nothing on it.
    fn blank(&self) -> BlurredPlane {
        let Film { rows, columns, .. } = self.spec.film;
        BlurredPlane::new(rows, columns)
    }

    /// Adds the light of a layer, or its alpha where the surfaces have no radiance, blurred, to a plane of the film.
    fn blur_onto_film(
        &self,
        layer: usize,
        map: &FilmMap,
        surfaces: &[Surface<'_>],
        kernels: &BandKernels,
        blurred: &mut BlurredPlane,
        work: &Work<'_>,
    ) -> Result<(), Cancelled> {
        let LayerRaster { factor, film, sampler } = &self.rasters[layer];
        let patches = &self.tiling.patches[layer];
        let task = LayerTask {
            sampler,
            map,
            layer,
            surfaces,
            blocks: &self.blocks[factor],
            patches,
            kernels: &kernels.by_layer[layer],
            film_rows: film.rows,
            film_columns: film.columns,
            negligible_edge: self.spec.settings.negligible_edge,
            stopwatch: &self.stopwatch,
        };
        if *factor == 1 {
            blur_layer(&task, blurred, work, PATCH_UNITS)?;
        } else if !patches.is_empty() {
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

/// The cells of each layer in which it has anything, and the layers of blocks of pixels by the factor of their raster.
type Active = (Vec<Vec<Cell>>, BTreeMap<usize, BlockLayers>);

/// Finds where layers have anything.
fn active_cells_of(
    rasters: &[LayerRaster],
    extents: &Extents<'_>,
    cell_size: usize,
    cancel: &Cancel,
) -> Result<Active, Cancelled> {
    let Extents { radius_px, maps, surfaces } = *extents;
    let n_layers = rasters.len();
    let samples: Vec<&Array2<f32>> = surfaces.iter().map(|surface| surface.samples()).collect();
    let (mut active, mut blocks): Active = (vec![vec![]; n_layers], BTreeMap::new());
    let factors: BTreeSet<usize> = rasters.iter().map(|raster| raster.factor).collect();
    for factor in factors {
        let members: Vec<usize> = (0..n_layers).filter(|&layer| rasters[layer].factor == factor).collect();
        let LayerRaster { film, sampler, .. } = &rasters[members[0]];
        let pad_px = members.iter().map(|&layer| pad_for(radius_px[layer])).fold(0.0, f64::max) / factor as f64;
        let cells = cells_over(film, pad_px.ceil() as usize, cell_size);
        let mut found = active_cells(&cells, sampler, maps, &samples, n_layers, cancel)?;
        blocks.insert(factor, BlockLayers::find(sampler, &cells, maps, surfaces, cancel)?);
        for layer in members {
            let blur_px = 2.0 * radius_px[layer] / factor as f64;
            active[layer] = joined_for(blur_px, std::mem::take(&mut found[layer]));
        }
    }
    Ok((active, blocks))
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
