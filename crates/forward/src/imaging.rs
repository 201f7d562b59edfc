//! The imaging of a scene's layers through one lens or one part of its pupil.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use dioptric_psf::{FieldsAlong, FilmMap, FilmQuery, Kernel, LensImage};
use dioptric_spectrum::Cancelled;
use glam::DVec2;
use ndarray::Array2;
use rayon::prelude::*;

use crate::{
    BandKernels, BandRadiance, Border, Film, ForwardError, ImagingSpec, SceneGeometry, SceneRadiance,
    blocks::Blocks,
    coverage::Composite,
    gather::{GatherTask, Past, gather, out_samples},
    halo::{Halos, beside},
    kept::Kept,
    lamps::{Lamp, without_lamps},
    node_kernels::NodeKernel,
    places::SceneRaster,
    points::{Beside, Drawing, Maps, Point},
    raster::{Level, Raster},
    rectangle::Rectangle,
    sampler::Sampler,
    scene_layers::SceneLayers,
    sight::{Before, Sight},
    stopwatch::{Part, Stopwatch},
    surface::{LayerCoordinates, Surface},
    surroundings::Surroundings,
    tile::{TileGroup, film_pixels},
    tiling::{LayeredLens, Rule, Tiling, reach_px},
    visible::Visible,
    work::Work,
};

/// What kernels that are kept take, and bands in flight, when nothing else is asked for, bytes.
pub(crate) const USUAL_BYTES: usize = 256 << 20;

/// Work on a group of tiles in one band over that of a kernel, about in proportion to their time.
const GROUP_UNITS: u64 = 8;

/// A plan for one lens, or for one part of a pupil: all but the lens, which each method takes.
pub(crate) struct Imaging {
    pub(crate) spec: ImagingSpec,
    pub(crate) scene: Arc<SceneLayers>,
    raster: SceneRaster,
    tiling: Tiling,
    blocks: Blocks,
    /// How far from the middle of the film light is taken from, mm.
    reach_mm: f64,
    /// Of the middle of the bands at which kernels are computed.
    middle_map: Arc<FilmMap>,
    middle_nm: f64,
    visible: Option<Visible>,
    /// The points beside the scene; `None` where no film point looks.
    points: Vec<Option<Beside>>,
    kept: Mutex<Kept>,
    /// The largest that the kernels of a band have been, bytes.
    kernel_bytes: usize,
    pub(crate) stopwatch: Stopwatch,
    /// Bytes that bands in flight may take; `None` for the usual ones.
    pub(crate) in_flight_bytes: Option<usize>,
}

impl Imaging {
    pub(crate) fn new(
        lens: &dyn LensImage,
        geometry: &SceneGeometry<'_>,
        scene: Arc<SceneLayers>,
        spec: ImagingSpec,
        work: &Work<'_>,
    ) -> Result<Self, ForwardError> {
        let ImagingSpec { film, grid, settings } = &spec;
        let (rows, columns) = geometry.size();
        let raster = SceneRaster { view: geometry.view, rows, columns, border: settings.border };
        let layers = &scene.layers;
        let widest_px = (0..layers.len()).map(|layer| layers.radius_px_at(layer as f32)).fold(0.0, f64::max);
        let margin_px = reach_px(widest_px).ceil() as usize;
        let reach_mm = film.half_diagonal_mm() + 1.5e-3 * film.pitch_um * margin_px as f64;

        // Look which layers lie where.
        let wavelengths_nm = grid.centers_nm();
        let middle = scene.kernel_bands[scene.kernel_bands.len() / 2];
        let middle_nm = wavelengths_nm[middle];
        let wavelengths_nm = [wavelengths_nm[0], middle_nm, wavelengths_nm[grid.len() - 1]];
        let maps: Vec<Arc<FilmMap>> = wavelengths_nm.par_iter().map(|&nm| lens.film_map(nm, reach_mm)).collect();
        let middle_map = maps[1].clone();
        let maps: Vec<&FilmMap> = maps.iter().map(Arc::as_ref).collect();
        let surfaces: Vec<&LayerCoordinates> =
            std::iter::once(&scene.coordinates).chain(scene.occluded.layer_coordinates()).collect();
        let blocks = Blocks::find((film, margin_px), &raster, &maps, &surfaces, work.cancel())?;

        let coordinate_of = |depth_m: f32| layers.coordinate_of(depth_m);
        let points = Beside::all(geometry, (film, maps[1]), &raster, (&scene.coordinates, &coordinate_of));
        let sight = Sight::of((lens, film, middle_nm), maps[1], &raster, &scene, work.cancel())?;

        // Cut the film into tiles for each of them.
        let stopwatch = Stopwatch::default();
        let layered = LayeredLens { image: lens, film, layers, stopwatch: &stopwatch };
        let rule = Rule { lens: layered, settings, blocks: &blocks, middle_nm, wavelengths_nm: &wavelengths_nm };
        let mut tiling = Tiling::new(&rule, work)?;
        let unobserved = Work::unobserved(work.cancel());
        let kernels = BandKernels { by_layer: Arc::new(tiling.middle_kernels(&layered, middle_nm, &unobserved)?) };
        let through = |sight| Visible::through(sight, (&tiling.layers, &kernels.by_layer), film, work.cancel());
        let visible = sight.map(through).transpose()?;
        let mut kept = Kept { budget_bytes: USUAL_BYTES, ..Kept::default() };
        kept.keep(middle, &kernels);
        Ok(Self {
            scene,
            raster,
            tiling,
            blocks,
            reach_mm,
            middle_map,
            middle_nm,
            visible,
            points,
            kept: Mutex::new(kept),
            // Those of the middle band tell how much memory kernels take.
            kernel_bytes: kernels.size_bytes() + kernels.size_bytes() / 4,
            stopwatch,
            in_flight_bytes: None,
            spec,
        })
    }

    /// The bytes of memory that it takes, what it shares with other parts of a pupil left out.
    pub(crate) fn size_bytes(&self) -> usize {
        self.blocks.size_bytes()
            + self.visible.as_ref().map_or(0, Visible::size_bytes)
            + self.tiling.size_bytes()
            + self.kept().size_bytes
    }

    /// The points beside the scene; none for one where no film point looks.
    pub(crate) fn points_beside(&self) -> &[Option<Beside>] {
        &self.points
    }

    /// The points that lie behind the first surface, and those where no film point looks.
    pub(crate) fn points_unseen(&self) -> (usize, usize) {
        let film = &self.spec.film;
        // As far beside the film as blurs reach.
        let half_mm = 0.5e-3 * film.pitch_um * DVec2::new(film.columns as f64, film.rows as f64);
        let most_mm = half_mm + (self.reach_mm - film.half_diagonal_mm());
        let place_mm = |point: &Option<Beside>| self.middle_map.place_mm(point.as_ref()?.seen_at().0);
        let is_beyond = |point: &Option<Beside>| place_mm(point).is_none_or(|mm| mm.abs().cmpgt(most_mm).any());
        let behind = self.points.iter().flatten().filter(|point| point.is_behind()).count();
        (behind, self.points.iter().filter(|point| is_beyond(point)).count())
    }

    /// The part of the film from which rays pass behind all surfaces that are known.
    pub(crate) fn unknown_fraction(&self) -> f64 {
        self.visible.as_ref().map_or(0.0, |visible| visible.unknown_fraction)
    }

    /// Keeps at most so many bytes of kernels from now on.
    pub(crate) fn keep_at_most(&mut self, budget_bytes: usize) {
        self.kept().limit(budget_bytes);
    }

    /// Rows and columns of the scene.
    pub(crate) fn size(&self) -> (usize, usize) {
        self.scene.size()
    }

    fn kept(&self) -> MutexGuard<'_, Kept> {
        // Whoever panicked with the lock had nothing half-written in it.
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn check_band(&self, band: usize) -> Result<(), ForwardError> {
        let n_bands = self.spec.grid.len();
        if band < n_bands { Ok(()) } else { Err(ForwardError::NoSuchBand { band, n_bands }) }
    }

    /// Returns the kernels of a band, between the two bands around it at which they are computed.
    pub(crate) fn kernels(&self, lens: &dyn LensImage, band: usize, work: &Work<'_>) -> Result<BandKernels, Cancelled> {
        let (lower, upper, fraction) = about(&self.scene.kernel_bands, band);
        let kernels = self.computed_kernels(lens, lower, work)?;
        if upper == lower {
            return Ok(kernels);
        }
        Ok(kernels.mixed(&self.computed_kernels(lens, upper, work)?, fraction))
    }

    /// Returns the kernel of a point that shines in a band, likewise.
    fn point_kernel(&self, lens: &dyn LensImage, band: usize, query: FilmQuery) -> NodeKernel {
        let (lower, upper, fraction) = about(&self.scene.point_bands, band);
        let computed = |band: usize| {
            let FilmQuery { place_mm, dioptres, pitch_um, .. } = query;
            let key = (band, [place_mm.x, place_mm.y, dioptres, pitch_um].map(f64::to_bits));
            if let Some(kernel) = self.kept().of_points.get(&key) {
                return kernel.clone();
            }
            let query = FilmQuery { wavelength_nm: self.spec.grid.centers_nm()[band], ..query };
            // On cells so narrow samples are taken as they are.
            let kernel = Arc::new(NodeKernel::new(&Kernel { excess_px2: [0.0; 2], ..lens.kernel(query) }));
            self.kept().keep_of_point(key, &kernel);
            kernel
        };
        if upper == lower {
            return Arc::unwrap_or_clone(computed(lower));
        }
        NodeKernel::sum_of(&[(&computed(lower), 1.0 - fraction), (&computed(upper), fraction)])
    }

    /// Returns the kernels of a band at which they are computed, kept or new.
    fn computed_kernels(&self, lens: &dyn LensImage, band: usize, work: &Work<'_>) -> Result<BandKernels, Cancelled> {
        if let Some(kernels) = self.kept().kernels.get(&band) {
            return Ok(kernels.clone());
        }
        let ImagingSpec { film, grid, .. } = &self.spec;
        let layered = LayeredLens { image: lens, film, layers: &self.scene.layers, stopwatch: &self.stopwatch };
        let by_layer = Arc::new(self.tiling.kernels_at(&layered, grid.centers_nm()[band], work)?);
        let kernels = BandKernels { by_layer };
        self.kept().keep(band, &kernels);
        Ok(kernels)
    }

    /// Returns the units of work of all bands from `first` on.
    pub(crate) fn stream_units(&self, first: usize) -> u64 {
        let n_bands = self.spec.grid.len().saturating_sub(first) as u64;
        let n_kernels = self.tiling.n_nodes() as u64 * self.scene.kernel_bands.len() as u64;
        self.tiling.n_groups() as u64 * n_bands * GROUP_UNITS + n_kernels
    }

    /// How many bands are worked on at once: more than there are threads, so that none waits, where pictures are small.
    pub(crate) fn bands_at_once(&self) -> usize {
        let threads = rayon::current_num_threads();
        match self.in_flight_bytes {
            None => (USUAL_BYTES / self.band_bytes().max(1)).clamp(threads.min(4), 4 * threads),
            Some(limit) => (limit / self.band_bytes().max(1)).clamp(1, 4 * threads),
        }
    }

    /// About what a band takes while it is imaged, bytes: its planes, and kernels.
    pub(crate) fn band_bytes(&self) -> usize {
        // The picture, what is open and what the surface covers; a layer as it is sampled and as it is gathered, light and coverage of each; both surfaces
        // without their lamps.
        const PLANES: usize = 9;
        let (Film { rows, columns, .. }, (scene_rows, scene_columns)) = (self.spec.film, self.size());
        // Halos: the picture with what lies around it, what they bring and take.
        const HALO_PLANES: usize = 4;
        let m = beside(&self.spec.film);
        let wide = (rows + 2 * m) * (columns + 2 * m);
        let halos = if self.scene.halos.are_any() { HALO_PLANES * wide + Halos::values(wide) } else { 0 };
        let planes = PLANES * (rows * columns).max(scene_rows * scene_columns) + halos;
        size_of::<f32>() * planes + self.kernel_bytes
    }

    /// Reads a band and images it.
    pub(crate) fn image_of(
        &self,
        lens: &dyn LensImage,
        band: usize,
        radiance: &SceneRadiance<'_>,
        work: &Work<'_>,
    ) -> Result<Array2<f32>, ForwardError> {
        work.check()?;
        let front = radiance.front.band(band)?;
        let needed = radiance.occluded.filter(|_| self.scene.occluded.needs_radiance());
        let occluded = needed.map(|occluded| occluded.band(band)).transpose()?;
        let points: Vec<f32> = radiance.points.iter().map(|point| point.light.by_band()[band]).collect();
        let light = BandRadiance { front: &front, occluded: occluded.as_deref(), points: &points };
        light.check(self.size(), self.scene.occluded.needs_radiance())?;
        Ok(self.image(lens, band, light, work)?)
    }

    /// Images a band: layer by layer what each tile gathers, one behind the other; then the light of the lens.
    pub(crate) fn image(
        &self,
        lens: &dyn LensImage,
        band: usize,
        light: BandRadiance<'_>,
        work: &Work<'_>,
    ) -> Result<Array2<f32>, Cancelled> {
        let cancel = work.cancel();
        let kernels = self.kernels(lens, band, work)?;
        let map = lens.film_map(self.spec.grid.centers_nm()[band], self.reach_mm);
        let (front, lamps) =
            without_lamps(self.scene.mixed.unmixed(light.front), &|row, column| self.is_inner(row, column));
        let occluded = self.scene.occluded.samples(&front, light.occluded, cancel)?;
        let is_behind = |row: usize, column: usize| {
            let behind = self.scene.occluded.layer_coordinates().filter(|_| self.scene.occluded.needs_radiance());
            self.is_inner(row, column)
                && behind.is_some_and(|behind| !behind.samples()[row * self.raster.columns + column].is_nan())
        };
        let (occluded, lamps_behind) = occluded.map_or((None, vec![]), |occluded| {
            let (occluded, lamps) = without_lamps(occluded, &is_behind);
            (Some(occluded), lamps)
        });
        let maps = Maps { of_band: &map, of_middle: &self.middle_map, pitch_mm: 1e-3 * self.spec.film.pitch_um };
        let lamps = self.lamps_of(&lamps, (&self.scene.coordinates, true), &maps);
        let lamps_behind =
            self.scene.occluded.layer_coordinates().map(|behind| self.lamps_of(&lamps_behind, (behind, false), &maps));
        let lamps: Vec<Point> = lamps.into_iter().chain(lamps_behind.unwrap_or_default()).collect();
        let points = self.points.iter().zip(light.points);
        let points: Vec<Point> = points.filter_map(|(point, light)| point.as_ref()?.lit(*light, &maps)).collect();
        let front = front.as_standard_layout();
        let occluded = occluded.as_ref().map(|samples| samples.as_standard_layout());
        let surface = |radiance, coordinates| Surface { radiance, coordinates };
        let mut surfaces = vec![surface(front.as_slice().unwrap_or_default(), &self.scene.coordinates)];
        if let (Some(radiance), Some(coordinates)) = (&occluded, self.scene.occluded.layer_coordinates()) {
            surfaces.push(surface(radiance.as_slice().unwrap_or_default(), coordinates));
        }
        let with_alpha = self.scene.hides;
        let sampler = Sampler { scene: self.raster, map: &map, blocks: &self.blocks, surfaces: &surfaces, with_alpha };
        let Film { rows, columns, .. } = self.spec.film;
        let mut picture = Composite::new((rows, columns), self.scene.hides);
        for (layer, tiles) in self.tiling.layers.iter().enumerate() {
            let task = GatherTask {
                film: &self.spec.film,
                kernels: &kernels.by_layer[layer],
                sampler: &sampler,
                layer,
                stopwatch: &self.stopwatch,
                cancel,
            };
            self.lay(&task, &tiles.groups, &mut picture)?;
            work.advance(tiles.groups.len() as u64 * GROUP_UNITS);
        }
        let kernel = |query: FilmQuery| self.stopwatch.time(Part::Kernels, || self.point_kernel(lens, band, query));
        let drawing = Drawing {
            lens,
            film: &self.spec.film,
            middle_nm: self.middle_nm,
            kernel: &kernel,
            sight: self.visible.as_ref().map(Visible::sight),
        };
        let mut picture = picture.finish();
        picture.iter_mut().zip(drawing.drawn(&lamps, cancel)?).for_each(|(sum, light)| *sum += light);
        let beside = drawing.drawn(&points, cancel)?;
        Ok(self.stopwatch.time(Part::Compositing, || {
            // What a pixel sees is spread before it is lit: an even scene stays even.
            let around = Surroundings { film: &self.spec.film, scene: &self.raster, map: &map };
            let front = front.as_slice().unwrap_or_default();
            let halos = &self.scene.halos;
            let haloed = |picture: Array2<f32>, sources: (&[f32], &[Point])| {
                let halo = |wide, beside| halos.applied(band, wide, beside);
                if halos.are_any() { around.with(&picture, sources, halo) } else { picture }
            };
            let picture = haloed(picture, (front, &lamps));
            let beside = (!beside.is_empty()).then(|| Array2::from_shape_vec((rows, columns), beside).ok()).flatten();
            let beside = beside.map(|beside| haloed(beside, (&[], &points)));
            self.lit(picture, beside, &map)
        }))
    }

    /// Lays what the tiles of a layer gather behind a picture.
    fn lay(&self, task: &GatherTask<'_>, groups: &[TileGroup], picture: &mut Composite) -> Result<(), Cancelled> {
        let film = film_pixels(&self.spec.film);
        let mut by_level: BTreeMap<Level, Vec<&TileGroup>> = BTreeMap::new();
        groups.iter().for_each(|group| by_level.entry(group.level).or_default().push(group));
        let visible = self.visible.as_ref().filter(|_| task.layer >= 2);
        let past = visible.map(|visible| Past { visible, picture: &*picture });
        let past = past.as_ref();
        let mut gathered = vec![];
        for (level, groups) in by_level {
            if level < Level::PIXEL {
                gathered.extend(gather(task, &groups, (None, past))?);
                continue;
            }
            let raster = Raster::new(&self.spec.film, level);
            let Some(at) = self.seen_by(task, &groups, &raster) else { continue };
            let ideal =
                self.stopwatch.time(Part::Sampling, || task.sampler.sample(&raster, at, task.layer, task.cancel))?;
            gathered.extend(gather(task, &groups, (Some(&ideal), past))?);
        }
        self.stopwatch.time(Part::Compositing, || {
            gathered.iter().for_each(|gathered| picture.under(&film, task.layer, gathered));
        });
        Ok(())
    }

    /// Returns the rectangle of a raster that tiles gather from.
    fn seen_by(&self, task: &GatherTask<'_>, groups: &[&TileGroup], raster: &Raster) -> Option<Rectangle> {
        let pixels = Raster::new(&self.spec.film, Level::PIXEL);
        let tiles = groups.iter().flat_map(|group| group.members.iter().map(|(tile, _)| tile));
        let seen = tiles.filter_map(|tile| {
            let out = out_samples(&tile.pixels(&self.spec.film)?, &pixels, raster);
            let windows = tile.corners().map(|node| task.kernels.window_at((node, raster.level)));
            Some(out.seen_through(&Rectangle::around(windows.into_iter())?))
        });
        Rectangle::around(seen)
    }

    /// Whether a sample of the scene does not go on beyond its edges.
    fn is_inner(&self, row: usize, column: usize) -> bool {
        let SceneRaster { rows, columns, .. } = self.raster;
        self.raster.border == Border::Black || (row > 0 && column > 0 && row + 1 < rows && column + 1 < columns)
    }

    /// Returns lamps as points at their depths, on the first surface or behind it.
    fn lamps_of(
        &self,
        lamps: &[Lamp],
        (coordinates, is_first): (&LayerCoordinates, bool),
        maps: &Maps<'_>,
    ) -> Vec<Point> {
        let columns = self.raster.columns;
        let of = |lamp: &Lamp| {
            let at = |coordinates: &LayerCoordinates| coordinates.samples()[lamp.row * columns + lamp.column];
            let depth = self.scene.layers.layer_and_dioptres_at(at(coordinates));
            let before = (!is_first).then(|| {
                let coordinate = at(&self.scene.coordinates);
                Before { coordinate, dioptres: self.scene.layers.layer_and_dioptres_at(coordinate).1 }
            });
            Point::of_lamp(lamp, &self.raster, maps, (depth, before))
        };
        lamps.iter().filter_map(of).collect()
    }

    /// Returns a picture of radiance as irradiance: times that of a uniform scene of radiance 1. Film points that look beyond the scene see but what shines
    /// `beside` it.
    fn lit(&self, mut picture: Array2<f32>, beside: Option<Array2<f32>>, map: &FilmMap) -> Array2<f32> {
        let raster = Raster::new(&self.spec.film, Level::PIXEL);
        let Rectangle { first_row, first_column, columns, .. } = film_pixels(&self.spec.film);
        let x_mm: Vec<f64> = (0..columns as i64).map(|column| raster.x_mm((first_column + column) as f64)).collect();
        let is_masked = self.raster.border != Border::Black;
        let samples = picture.as_slice_mut().expect("it is in standard order");
        let rows = samples.par_chunks_mut(columns).enumerate();
        rows.for_each_init(FieldsAlong::default, |seen, (row, line)| {
            map.along(&x_mm, raster.y_mm((first_row + row as i64) as f64), seen);
            for (i, sample) in line.iter_mut().enumerate() {
                let gain = seen.irradiance_sr[i];
                let seen_part = if is_masked {
                    let position = self.raster.position_of(seen.tan_x[i], seen.tan_y[i]);
                    let beside = if i > 0 { i - 1 } else { columns.min(2) - 1 };
                    let step = DVec2::new(seen.tan_x[i] - seen.tan_x[beside], seen.tan_y[i] - seen.tan_y[beside]);
                    self.raster.part_within(position, self.raster.view.focal_px * step.length())
                } else {
                    1.0
                };
                *sample = *sample * seen_part + beside.as_ref().map_or(0.0, |beside| beside[(row, i)]);
                *sample *= if gain.is_nan() { 0.0 } else { gain as f32 };
            }
        });
        picture
    }
}

/// Returns those of some bands, the first and the last of all among them, about a band, and how far it lies from the first towards the second.
fn about(bands: &[usize], band: usize) -> (usize, usize, f32) {
    let above = bands.partition_point(|&knot| knot < band);
    let upper = bands[above];
    let lower = if upper == band { upper } else { bands[above - 1] };
    (lower, upper, (band - lower) as f32 / (upper - lower).max(1) as f32)
}
