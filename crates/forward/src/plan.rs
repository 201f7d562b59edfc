//! All of imaging that does not depend on the scene's light, made once.

use std::{
    borrow::Cow,
    collections::{BTreeMap, BTreeSet},
    sync::{Arc, Mutex, PoisonError},
};

use dioptric_psf::{FilmMap, LensImage};
use dioptric_spectrum::{Cancel, Cancelled, WavelengthGrid};
use glam::DVec2;
use ndarray::Array2;
use rayon::prelude::*;

use crate::{
    BandRadiance, BlurMode, Film, ForwardError, SceneGeometry, SceneRadiance, Settings, Sink,
    blur::{LayerTask, blur_layer},
    geometry::check_extent,
    knot_kernels::LayerKernels,
    layers::{Blurs, Layers},
    occluded::OccludedSamples,
    occlusion::{BlurredLayer, Composite},
    raster::LayerRaster,
    sampler::Surface,
    stopwatch::{Clock, ImagingTimes, Part, Stopwatch},
    tiles::{Cell, FilmLens, Tiling, active_cells, cells_over, joined_for},
    work::{Progress, Work, plane_of},
};

/// What a plan is made for, beside the scene's geometry and the lens.
#[derive(Clone, Debug, PartialEq)]
pub struct ImagingSpec {
    /// The film.
    pub film: Film,
    /// The bands.
    pub grid: WavelengthGrid,
    /// How finely the picture is made.
    pub settings: Settings,
}

/// The imaging of one scene geometry through one lens on one film: made once, then used for any light and any band.
///
/// It owns all that it needs and shares the lens, so it can be kept beside it and used from several threads. Kernels are computed
/// when a band first needs them and kept up to a number of bytes ([`with_kernel_budget`](Self::with_kernel_budget)).
/// Results are the same to the bit for any number of threads, kernels kept or not.
///
/// ```
/// use std::sync::Arc;
/// use dioptric_forward::{BandRadiance, DiscLens, Film, ImagingPlan, ImagingSpec, SceneGeometry, Settings};
/// use dioptric_scene::View;
/// use dioptric_spectrum::{Cancel, DepthMap, WavelengthGrid};
/// use ndarray::Array2;
///
/// let depth = DepthMap::flat(60, 80, 2.0)?;
/// let view = View { focal_px: 5000.0, center_x_px: 39.5, center_y_px: 29.5 };
/// let spec = ImagingSpec {
///     film: Film { rows: 40, columns: 40, pitch_um: 10.0 },
///     grid: WavelengthGrid::uniform(500.0, 600.0, 50.0)?,
///     settings: Settings::default(),
/// };
/// let lens = Arc::new(DiscLens { focus_dioptres: 1.0, radius_um_per_dioptre: 100.0, focal_mm: 50.0, ..DiscLens::default() });
/// let cancel = Cancel::new();
/// let scene = SceneGeometry { depth: &depth, view, occluded_depth: None };
/// let plan = ImagingPlan::new(lens, &scene, spec, &|_| {}, &cancel)?;
/// for level in [0.1, 0.2] {
///     let radiance = Array2::from_elem((60, 80), level);
///     let irradiance = plan.image(1, BandRadiance { front: &radiance, occluded: None }, &cancel)?;
///     assert!((irradiance[(20, 20)] - level).abs() < 1e-5);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct ImagingPlan {
    lens: Arc<dyn LensImage + Send>,
    layout: Layout,
}

impl std::fmt::Debug for ImagingPlan {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Layout { spec, layers, .. } = &self.layout;
        f.debug_struct("ImagingPlan").field("spec", spec).field("dioptres", &layers.dioptres()).finish_non_exhaustive()
    }
}

/// The kernels of a lens in one band, at the knots of every depth layer.
#[derive(Clone, Debug)]
pub struct BandKernels {
    by_layer: Arc<Vec<LayerKernels>>,
}

impl BandKernels {
    /// The number of kernels; those that mirror each other count once.
    pub fn n_kernels(&self) -> usize {
        self.by_layer.iter().map(LayerKernels::n_kernels).sum()
    }

    /// The bytes of memory that the samples of the kernels take.
    pub fn size_bytes(&self) -> usize {
        self.by_layer.iter().map(LayerKernels::size_bytes).sum()
    }

    /// Returns the kernels between two bands.
    fn mixed(&self, upper: &Self, fraction: f32) -> Self {
        if fraction == 0.0 {
            return self.clone();
        }
        let pairs = self.by_layer.iter().zip(upper.by_layer.iter());
        Self { by_layer: Arc::new(pairs.map(|(lower, upper)| lower.mixed(upper, fraction)).collect()) }
    }
}

/// Kernels that a plan keeps when nothing else is asked for, bytes.
const KERNEL_BUDGET_BYTES: usize = 256 << 20;

impl ImagingPlan {
    /// Plans the imaging of a scene geometry: layers of depth, what their edges hide, and where PSFs are needed.
    ///
    /// `progress` receives the fraction that is done, from 0 to 1.
    ///
    /// # Errors
    /// When the parts of the scene do not fit each other, when the lens is not known for the wavelengths or depths or
    /// for the corner of the film, or when the work is cancelled.
    pub fn new(
        lens: Arc<dyn LensImage + Send>,
        scene: &SceneGeometry<'_>,
        spec: ImagingSpec,
        progress: &(dyn Fn(f64) + Sync),
        cancel: &Cancel,
    ) -> Result<Self, ForwardError> {
        progress(0.0);
        let layout = Layout::new(lens.as_ref(), scene, spec, progress, (0.0, 1.0), cancel)?;
        progress(1.0);
        Ok(Self { lens, layout })
    }

    /// Returns the plan that keeps at most this many bytes of kernels; others are computed anew for each band.
    #[must_use]
    pub fn with_kernel_budget(mut self, bytes: usize) -> Self {
        self.layout.kept = Mutex::new(KeptKernels { budget_bytes: bytes, ..KeptKernels::default() });
        self
    }

    /// Returns the plan that adds up, by a clock, the time that its parts take; see [`times`](Self::times).
    #[must_use]
    pub fn with_clock(mut self, clock: Arc<Clock>) -> Self {
        self.layout.stopwatch = Stopwatch::of(clock);
        self
    }

    /// Returns where the time of imaging went since the plan got a clock, summed over threads; nothing without one.
    pub fn times(&self) -> ImagingTimes {
        self.layout.stopwatch.times()
    }

    /// What the plan was made for.
    pub fn spec(&self) -> &ImagingSpec {
        &self.layout.spec
    }

    /// Returns the bytes of memory that the plan takes now, kept kernels included, the lens left out.
    pub fn size_bytes(&self) -> usize {
        self.layout.size_bytes()
    }

    /// Returns the kernels of a band, computed where they are not kept.
    ///
    /// # Errors
    /// When there is no such band, or the work is cancelled.
    pub fn kernels(&self, band: usize, cancel: &Cancel) -> Result<BandKernels, ForwardError> {
        self.layout.check_band(band)?;
        Ok(self.layout.kernels(self.lens.as_ref(), band, &Work::unobserved(cancel))?)
    }

    /// Returns the irradiance on the film in one band, W m⁻² nm⁻¹, rows × columns.
    ///
    /// # Errors
    /// When there is no such band, when the radiance is not that of the planned samples, or when the work is cancelled.
    pub fn image(&self, band: usize, radiance: BandRadiance<'_>, cancel: &Cancel) -> Result<Array2<f32>, ForwardError> {
        self.layout.check_band(band)?;
        radiance.check(self.layout.layer_coordinates.dim(), self.layout.occluded.needs_radiance())?;
        let work = Work::unobserved(cancel);
        let kernels = self.layout.kernels(self.lens.as_ref(), band, &work)?;
        Ok(self.layout.image(self.lens.as_ref(), band, &kernels, radiance, &work)?)
    }

    /// Images all bands: hands the irradiance on the film, W m⁻² nm⁻¹, to `sink` band by band.
    ///
    /// `progress` receives the fraction that is done, from 0 to 1. A few bands are worked on at once.
    ///
    /// # Errors
    /// When the radiance is not that of the planned samples and bands, when a band cannot be read or handed on, or when the
    /// work is cancelled.
    pub fn stream(
        &self,
        radiance: &SceneRadiance<'_>,
        progress: &(dyn Fn(f64) + Sync),
        cancel: &Cancel,
        sink: &mut Sink<'_>,
    ) -> Result<(), ForwardError> {
        radiance.check(self.layout.layer_coordinates.dim(), &self.layout.spec.grid)?;
        progress(0.0);
        self.layout.stream(self.lens.as_ref(), radiance, &Watch { progress, range: (0.0, 1.0), cancel }, sink)
    }
}

/// Who follows a piece of work.
pub(crate) struct Watch<'a> {
    pub(crate) progress: &'a Progress<'a>,
    /// The fractions reported at the start and at the end.
    pub(crate) range: (f64, f64),
    pub(crate) cancel: &'a Cancel,
}

/// A plan but for the lens, which each method takes.
pub(crate) struct Layout {
    spec: ImagingSpec,
    /// The bands at which PSFs are computed; between them they are interpolated.
    kernel_bands: Vec<usize>,
    layers: Layers,
    /// Of each layer.
    rasters: Vec<LayerRaster>,
    tiling: Tiling,
    layer_coordinates: Array2<f32>,
    occluded: OccludedSamples,
    /// How far off axis light is taken from, mm.
    extent_mm: f64,
    kept: Mutex<KeptKernels>,
    stopwatch: Stopwatch,
}

/// Kernels of the bands at which they are computed, as many as the budget allows.
#[derive(Default)]
struct KeptKernels {
    budget_bytes: usize,
    size_bytes: usize,
    by_band: BTreeMap<usize, BandKernels>,
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

        // Lay layers over the depths.
        let wavelengths_nm = grid.centers_nm();
        let middle_nm = wavelengths_nm[wavelengths_nm.len() / 2];
        let corner_mm = film.half_diagonal_mm();
        let fields = blur_fields(lens, &lens.film_map(dioptres.0, middle_nm, corner_mm), film);
        let blurs = Blurs { kernels: lens, pitch_mm: 1e-3 * film.pitch_um, fields: &fields, wavelengths_nm };
        let layers = Layers::over(dioptres, settings.layer_step_px, &blurs);
        let kernel_bands = layers.chromatic_knots(settings.chromatic_step_px, &blurs);
        let z_m = scene.depth.z_m();
        let layer_coordinates = plane_of(z_m.dim(), cancel, |row, column| layers.coordinate_of(z_m[(row, column)]))?;

        let pad_px = (0..layers.len()).map(|l| pad_for(layers.radius_px_at(l as f32))).fold(0.0, f64::max);
        let cell_size = settings.knot_spacing_px;
        let extent_mm = corner_mm + 1e-3 * film.pitch_um * std::f64::consts::SQRT_2 * (pad_px + 2.0 * cell_size as f64);
        let maps: Vec<FilmMap> = layers.dioptres().iter().map(|&d| lens.film_map(d, middle_nm, extent_mm)).collect();
        let radius_px: Vec<f64> = (0..layers.len()).map(|layer| layers.radius_px_at(layer as f32)).collect();
        let raster = |(&radius_px, map)| LayerRaster::new(film, LayerRaster::factor_for(radius_px), scene.view, map);
        let rasters: Vec<LayerRaster> = radius_px.iter().zip(&maps).map(raster).collect();
        let scene_per_film = LayerRaster::new(film, 1, scene.view, &maps[0]).sampler.scene_per_film;
        let occluded = OccludedSamples::find(scene, &layers, settings, scene_per_film, cancel)?;

        // Find the cells in which a layer has anything, and halve them until the spline follows the PSFs.
        let ends: Vec<FilmMap> = [wavelengths_nm[0], wavelengths_nm[wavelengths_nm.len() - 1], middle_nm]
            .into_iter()
            .flat_map(|w| [0, layers.len() - 1].map(|l| lens.film_map(layers.dioptres()[l], w, extent_mm)))
            .collect();
        let surfaces: Vec<&Array2<f32>> =
            std::iter::once(&layer_coordinates).chain(occluded.layer_coordinates()).collect();
        let mut active: Vec<Vec<Cell>> = vec![vec![]; layers.len()];
        let factors: BTreeSet<usize> = rasters.iter().map(|raster| raster.factor).collect();
        for factor in factors {
            let members: Vec<usize> = (0..layers.len()).filter(|&layer| rasters[layer].factor == factor).collect();
            let LayerRaster { film, sampler, .. } = &rasters[members[0]];
            let pad_px = members.iter().map(|&layer| pad_for(radius_px[layer])).fold(0.0, f64::max) / factor as f64;
            let cells = cells_over(film, pad_px.ceil() as usize, cell_size);
            let mut found = active_cells(&cells, sampler, &ends, &surfaces, layers.len(), cancel)?;
            for layer in members {
                let blur_px = 2.0 * radius_px[layer] / factor as f64;
                active[layer] = joined_for(blur_px, std::mem::take(&mut found[layer]));
            }
        }
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
        let kept = Mutex::new(KeptKernels { budget_bytes: KERNEL_BUDGET_BYTES, ..KeptKernels::default() });
        Ok(Self {
            kernel_bands,
            layers,
            rasters,
            tiling,
            layer_coordinates,
            occluded,
            extent_mm,
            kept,
            stopwatch,
            spec,
        })
    }

    fn size_bytes(&self) -> usize {
        let planes = (self.layer_coordinates.len() + self.occluded.layer_coordinates().map_or(0, Array2::len))
            * size_of::<f32>();
        planes + self.occluded.size_bytes() + self.tiling.size_bytes() + self.kept().size_bytes
    }

    fn kept(&self) -> std::sync::MutexGuard<'_, KeptKernels> {
        // Whoever panicked with the lock had nothing half-written in it.
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn check_band(&self, band: usize) -> Result<(), ForwardError> {
        let n_bands = self.spec.grid.len();
        if band < n_bands { Ok(()) } else { Err(ForwardError::NoSuchBand { band, n_bands }) }
    }

    fn maps_at(&self, lens: &dyn LensImage, band: usize) -> Vec<FilmMap> {
        let wavelength_nm = self.spec.grid.centers_nm()[band];
        let map = |&dioptres: &f64| lens.film_map(dioptres, wavelength_nm, self.extent_mm);
        self.layers.dioptres().iter().map(map).collect()
    }

    /// Returns the kernels of a band, between the two bands around it at which they are computed.
    fn kernels(&self, lens: &dyn LensImage, band: usize, work: &Work<'_>) -> Result<BandKernels, Cancelled> {
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
        if let Some(kernels) = self.kept().by_band.get(&band) {
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
        let size_bytes = kernels.size_bytes();
        if kept.size_bytes + size_bytes <= kept.budget_bytes && !kept.by_band.contains_key(&band) {
            kept.size_bytes += size_bytes;
            kept.by_band.insert(band, kernels.clone());
        }
        Ok(kernels)
    }

    pub(crate) fn stream(
        &self,
        lens: &dyn LensImage,
        radiance: &SceneRadiance<'_>,
        watch: &Watch<'_>,
        sink: &mut Sink<'_>,
    ) -> Result<(), ForwardError> {
        let n_bands = self.spec.grid.len();
        let n_patches = self.tiling.n_patches() as u64;
        let n_kernels = self.tiling.n_knots() as u64 * self.kernel_bands.len() as u64;
        let n_units = n_patches * n_bands as u64 * PATCH_UNITS + n_kernels * KERNEL_UNITS;
        let work = Work::new(watch.cancel, watch.progress, watch.range, n_units);
        let mut hand_on = |band, picture| sink(band, picture).map_err(|reason| ForwardError::Sink { band, reason });
        let mut lower = self.computed_kernels(lens, 0, &work)?;
        for pair in self.kernel_bands.windows(2) {
            let upper = self.computed_kernels(lens, pair[1], &work)?;
            let bands: Vec<usize> = (pair[0]..pair[1]).collect();
            for group in bands.chunks(rayon::current_num_threads().clamp(1, 4)) {
                let pictures: Vec<Result<Array2<f32>, ForwardError>> = group
                    .par_iter()
                    .map(|&band| {
                        let fraction = (band - pair[0]) as f32 / (pair[1] - pair[0]) as f32;
                        self.image_of(lens, band, &lower.mixed(&upper, fraction), radiance, &work)
                    })
                    .collect();
                for (&band, picture) in group.iter().zip(pictures) {
                    hand_on(band, picture?)?;
                }
            }
            lower = upper;
        }
        let last = n_bands - 1;
        let picture = self.image_of(lens, last, &lower, radiance, &work)?;
        (watch.progress)(watch.range.1);
        hand_on(last, picture)
    }

    /// Reads a band and images it.
    fn image_of(
        &self,
        lens: &dyn LensImage,
        band: usize,
        kernels: &BandKernels,
        radiance: &SceneRadiance<'_>,
        work: &Work<'_>,
    ) -> Result<Array2<f32>, ForwardError> {
        work.check()?;
        let front = radiance.front.band(band)?;
        let needed = radiance.occluded.filter(|_| self.occluded.needs_radiance());
        let occluded = needed.map(|occluded| occluded.band(band)).transpose()?;
        let light = BandRadiance { front: &front, occluded: occluded.as_deref() };
        light.check(self.layer_coordinates.dim(), self.occluded.needs_radiance())?;
        Ok(self.image(lens, band, kernels, light, work)?)
    }

    fn image(
        &self,
        lens: &dyn LensImage,
        band: usize,
        kernels: &BandKernels,
        light: BandRadiance<'_>,
        work: &Work<'_>,
    ) -> Result<Array2<f32>, Cancelled> {
        let maps = self.maps_at(lens, band);
        let occluded: Option<Cow<'_, Array2<f32>>> = match &self.occluded {
            OccludedSamples::Nothing => None,
            OccludedSamples::Estimated { fill, .. } => Some(Cow::Owned(fill.samples(light.front, work.cancel())?)),
            OccludedSamples::Known(_) => light.occluded.map(Cow::Borrowed),
        };
        let mut surfaces = vec![Surface { radiance: light.front, layer_coordinates: &self.layer_coordinates }];
        if let (Some(radiance), Some(layer_coordinates)) = (&occluded, self.occluded.layer_coordinates()) {
            surfaces.push(Surface { radiance, layer_coordinates });
        }
        let Film { rows, columns, .. } = self.spec.film;
        let hides = self.spec.settings.mode == BlurMode::Layered && self.layers.len() > 1;
        let (mut picture, mut blurred) = (Composite::new(rows, columns), BlurredLayer::new(rows, columns));
        for (layer, patches) in self.tiling.patches.iter().enumerate() {
            let LayerRaster { factor, film, sampler } = &self.rasters[layer];
            let task = LayerTask {
                sampler,
                map: &maps[layer],
                layer,
                surfaces: &surfaces,
                patches,
                kernels: &kernels.by_layer[layer],
                film_rows: film.rows,
                film_columns: film.columns,
                with_alpha: hides,
                stopwatch: &self.stopwatch,
            };
            if *factor == 1 {
                blur_layer(&task, &mut blurred, work, PATCH_UNITS)?;
            } else if !patches.is_empty() {
                let mut coarse = BlurredLayer::new(film.rows, film.columns);
                blur_layer(&task, &mut coarse, work, PATCH_UNITS)?;
                self.stopwatch.time(Part::Compositing, || blurred.add_magnified(&coarse, *factor, work.cancel()))?;
            }
            self.stopwatch.time(Part::Compositing, || {
                if hides {
                    return picture.composite_under(&mut blurred, work.cancel());
                }
                picture.add(&mut blurred);
                Ok(())
            })?;
        }
        let finish = || if hides { picture.finish() } else { picture.finish_sum() };
        Ok(self.stopwatch.time(Part::Compositing, finish))
    }
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
