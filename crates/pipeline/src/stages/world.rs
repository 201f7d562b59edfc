//! Worlds: read, seen from the middle of the entrance pupil, and rendered through the lens.

use std::{fs, path::Path, sync::Arc};

use dioptric_backward::{
    Auxiliary, Bands, Camera, FilmLine, GatheredView, LensCamera, LensCameraSettings, LensOrigin, LightPaths, Pinhole,
    PixelGrid, RenderSettings, Renderer, Rendering, ViewDetail, auxiliary, depth_along, gathered_view, layered_depth,
    write_auxiliary_exr, write_rendering_exr,
};
use dioptric_optics::{Lens, glam::DVec2};
use dioptric_scene::{HiddenLayer, Scene, SceneLight, View};
use dioptric_spectrum::{Cancel, DepthMap, Illuminant, Quantity, SpectralImage, WavelengthGrid};
use dioptric_world::{CameraKind, Flux, Light, World, WorldBuilder, WorldCamera, glam::DVec3, open_world};
use ndarray::Array2;

use super::{
    IRRADIANCE_FILE, Watch,
    film::FilmPlace,
    lens::ResolvedLens,
    scene::ResolvedScene,
    spec::{IrradianceInputs, SceneInputs, WorldInputs},
    world_change::change_world,
    world_light::light_on,
    world_sky::add_sky,
    world_view::{horizontal_fov_deg, placement, world_camera},
};
use crate::{
    Diffraction, PaintingFolder, PipelineError, Progress, Quality, RenderEffort, RenderMethod, SceneSource, Stage,
    WorldLamp, WorldSky, WorldSpec, gathered::GatheredPicture, still_life,
};

/// Samples of a pass: as many as spread well, and few enough for a first picture soon.
const SAMPLES_PER_PASS: u32 = 8;
/// Samples of a pass that is as large as it may be, and passes that tell the noise to a sixth or better.
const MOST_SAMPLES_PER_PASS: u32 = 1024;
const TELLING_PASSES: u32 = 16;
/// Passes that noise is judged by.
const PILOT_PASSES: u32 = 4;
/// The most columns of a first look at what a pinhole sees.
const CLEAN_COLUMNS: usize = 480;
/// The most passes where noise decides.
const MOST_PASSES: u32 = 4096;

/// A world as a camera sees it, to be rendered pass by pass.
#[derive(Clone, Debug)]
pub struct WorldRender {
    world: Arc<World>,
    camera: Camera,
    bands: Bands,
    paths: LightPaths,
    seed: u64,
    samples_per_pass: u32,
    identity: String,
}

/// Reads a world.
pub(super) fn read(inputs: &WorldInputs, watch: &Watch<'_>) -> Result<World, PipelineError> {
    watch.progress.at(Stage::Scene, 0.0);
    if inputs.file.as_os_str() == WorldSpec::STILL_LIFE {
        return Ok(World::still_life());
    }
    let mut builder = match inputs.file.as_os_str() == WorldSpec::EMPTY {
        true => WorldBuilder::new(),
        false => open_world(&inputs.file, &inputs.reading, watch.cancel)?,
    };
    inputs.changes.iter().try_for_each(|change| change_world(&mut builder, change, watch.cancel))?;
    for WorldLamp { at_m: (x, y, z), lumens } in &inputs.lamps {
        let intensity = Flux::Lumens(*lumens).spectrum(&Illuminant::D65.spectrum(), 4.0 * std::f64::consts::PI)?;
        builder.add_light(Light::Point { position: DVec3::new(*x, *y, *z), intensity });
    }
    let (up, front) = builder.up_and_front();
    match &inputs.sky {
        Some(sky) => add_sky(&mut builder, sky, up, front)?,
        None if !builder.has_light() => {
            builder.note(
                "nothing in the file gives light: an even sky of radiance 1 W m⁻² sr⁻¹ nm⁻¹ does; --sky day or --light gives another",
            );
            add_sky(&mut builder, &WorldSky::Even(1.0), up, front)?;
        }
        None => {}
    }
    Ok(builder.build()?)
}

/// The most columns of a view of the still life that is no more than the summary of a picture.
const SUMMARY_COLUMNS: usize = 270;

/// Returns the view from the middle of the entrance pupil: radiance and depth.
///
/// At full quality it is rendered by paths as carefully as was asked for. It is gathered (`docs/backward.md`) for previews, where rays
/// from the film make the picture and it is but the summary, and of the still life; unless light is to be followed otherwise than in full.
/// `has_room` tells whether so many rows, columns, bands and layers may take the memory that they do; views that are gathered are kept in a folder.
pub(super) fn view(
    inputs: &SceneInputs,
    spec: &WorldSpec,
    world: &Arc<World>,
    (has_room, folder): (HasRoom<'_>, Option<&PaintingFolder>),
    watch: &Watch<'_>,
) -> Result<ResolvedScene, PipelineError> {
    let geometry = &inputs.geometry;
    let of_view = world_camera(world, spec, geometry.field_of_view_deg)?;
    let (columns, rows) = spec.size.unwrap_or(of_view.resolution);
    let mut binning = geometry.quality.scene_binning(columns);
    if geometry.is_summary {
        binning *= (columns / binning).div_ceil(SUMMARY_COLUMNS).max(1);
    }
    let (columns, rows) = ((columns / binning).max(1), (rows / binning).max(1));
    let fov_deg = geometry.field_of_view_deg.or_else(|| horizontal_fov_deg(&of_view));
    let fov_deg = fov_deg.ok_or_else(|| PipelineError::Unsuitable {
        what: "field_of_view_deg",
        reason: format!("missing, and {} has no camera that states an angle; expected degrees", spec.file.display()),
    })?;
    let view = View::from_horizontal_fov_deg(fov_deg, columns, rows)?;
    let wanted = geometry.wavelengths.of_world()?;
    let bands = Bands { grid: geometry.quality.bands_of(&wanted)?, sampling: spec.bands };
    let is_forward = spec.method == RenderMethod::Forward;
    let n_layers = if is_forward { spec.layers } else { 1 };
    has_room((rows, columns), bands.grid.len(), n_layers)?;
    let pinhole = Pinhole {
        placement: placement(world, spec, geometry.field_of_view_deg)?,
        pixels: PixelGrid::new(columns, rows),
        half_tangents: 0.5 * DVec2::new(columns as f64, rows as f64) / view.focal_px,
        layer: 0,
    };
    let is_rough = !is_forward || geometry.quality != Quality::Full || spec.is_still_life();
    let is_gathered = is_rough && spec.paths == LightPaths::Full;
    let mut layers = match is_gathered {
        true => {
            let is_fine = is_forward && geometry.quality >= Quality::Draft;
            let picture = GatheredPicture {
                world: world.clone(),
                world_words: if folder.is_some() { fingerprint(world, spec) } else { String::new() },
                view: pinhole,
                grid: bands.grid,
                detail: if is_fine { ViewDetail::Fine } else { ViewDetail::Quick },
                seed: spec.seed,
            };
            gathered_layers(&picture, n_layers, folder, watch)?
        }
        false => rendered_layers(world, spec, (pinhole, n_layers), bands, watch)?,
    }
    .into_iter();
    let first = layers.next().expect("there is one layer at least");
    let hidden = layers.next().map(|behind| hidden_layer(&first, behind)).transpose()?;
    let name = spec.file.file_stem().unwrap_or(spec.file.as_os_str()).to_string_lossy().into_owned();
    let light = match &inputs.light {
        Some(stated) => Some(SceneLight { illuminant: stated.clone(), illuminance_lux: None }),
        None if spec.is_still_life() => Some(still_life::light()?),
        None => light_on(world, &pinhole)?,
    };
    let (first_nm, last_nm) = first.radiance.grid().range_nm();
    let of_file = world.notes().iter().cloned();
    let without_media = "media are left out of quick views: glass is clear, and fog and smoke are away";
    let of_media =
        (is_gathered && spec.method == RenderMethod::Forward && world.has_media()).then(|| without_media.to_owned());
    let notes = of_file.chain(world.note_on_bands(first_nm, last_nm)).chain(of_media);
    let notes = notes.map(|note| format!("{name}: {note}")).collect();
    let scene =
        Scene { depth: Some(first.depth), view: Some(view), hidden, light, notes, ..Scene::new(name, first.radiance) };
    Ok(ResolvedScene { scene, binning })
}

/// Tells whether so many rows and columns, bands and layers may take the memory that they do.
type HasRoom<'a> = &'a dyn Fn((usize, usize), usize, u32) -> Result<(), PipelineError>;

/// Gathers a view and what it hides.
fn gathered_layers(
    picture: &GatheredPicture,
    n_layers: u32,
    folder: Option<&PaintingFolder>,
    watch: &Watch<'_>,
) -> Result<Vec<GatheredView>, PipelineError> {
    let seen = |layer: u32| {
        let report = |part| watch.progress.at(Stage::Scene, (f64::from(layer) + part) / f64::from(n_layers));
        let mut picture = picture.clone();
        picture.view.layer = layer;
        let (folder, cancel) = (folder.cloned(), watch.cancel.clone());
        watch.run_reporting(&report, move |progress| picture.seen(folder.as_ref(), progress, &cancel))
    };
    (0..n_layers).map(seen).collect()
}

/// Renders a view and what it hides by paths.
fn rendered_layers(
    world: &Arc<World>,
    spec: &WorldSpec,
    (pinhole, n_layers): (Pinhole, u32),
    bands: Bands,
    watch: &Watch<'_>,
) -> Result<Vec<GatheredView>, PipelineError> {
    let (effort, samples_per_pass) = match spec.method {
        // As few as reach every band.
        RenderMethod::Backward => (RenderEffort::Samples(1), 1),
        RenderMethod::Forward => (spec.effort, SAMPLES_PER_PASS),
    };
    let camera = Camera::Pinhole(pinhole);
    let (paths, seed) = (spec.paths, spec.seed);
    let render =
        WorldRender { world: world.clone(), camera, bands, paths, seed, samples_per_pass, identity: String::new() };
    let seen = |(layer, z_m): (u32, Array2<f32>)| -> Result<GatheredView, PipelineError> {
        let render = WorldRender { camera: Camera::Pinhole(Pinhole { layer, ..pinhole }), ..render.clone() };
        let mut renderer = render.renderer()?;
        let share = f64::from(n_layers).recip();
        let range = (share * f64::from(layer), share * f64::from(layer + 1));
        let progress = AtStage { progress: watch.progress, stage: Stage::Scene, range };
        render.refine(&mut renderer, effort, &progress, watch.cancel, &mut |_| Ok(true))?;
        Ok(GatheredView { radiance: renderer.picture(), depth: DepthMap::new(z_m)? })
    };
    (0..).zip(layered_depth(world, &pinhole, n_layers as usize, watch.cancel)?).map(seen).collect()
}

/// Returns what the first surfaces hide; where they hide nothing, the layer repeats them.
fn hidden_layer(first: &GatheredView, behind: GatheredView) -> Result<HiddenLayer, PipelineError> {
    let (mut radiance, mut behind_m) = (behind.radiance, behind.depth.z_m().clone());
    for (at, &first_m) in first.depth.z_m().indexed_iter() {
        // Through the sky nothing is hidden.
        if first_m == f32::INFINITY {
            behind_m[at] = first_m;
            radiance.planes_mut().zip(first.radiance.planes()).for_each(|(mut behind, first)| behind[at] = first[at]);
        }
    }
    Ok(HiddenLayer { radiance, depth: DepthMap::new(behind_m)? })
}

/// Progress of one stage reported as another's.
struct AtStage<'a> {
    progress: &'a dyn Progress,
    stage: Stage,
    /// The fractions reported at the start and at the end.
    range: (f64, f64),
}

impl Progress for AtStage<'_> {
    fn at(&self, _: Stage, fraction: f64) {
        self.progress.at(self.stage, self.range.0 + (self.range.1 - self.range.0) * fraction);
    }
}

impl WorldRender {
    /// Returns the world before a camera, to no end but the numbers of its picture.
    pub(super) fn bare(
        world: Arc<World>,
        camera: Camera,
        bands: Bands,
        (paths, samples_per_pass): (LightPaths, u32),
    ) -> Self {
        Self { world, camera, bands, paths, seed: 1, samples_per_pass, identity: String::new() }
    }

    /// Returns the world as the lens of a camera file sees it.
    pub(super) fn through_lens(
        world: Arc<World>,
        inputs: &IrradianceInputs,
        (lens, place): (&ResolvedLens, &FilmPlace),
        grid: WavelengthGrid,
    ) -> Result<Self, PipelineError> {
        let SceneSource::World(spec) = &inputs.scene.geometry.source else {
            unreachable!("the world that is given is that of these inputs");
        };
        if inputs.plan.bank.diffraction == Diffraction::Wave {
            let reason = "rays from the film carry no waves, expected None, Hurb or HurbCalibrated".to_owned();
            return Err(PipelineError::Unsuitable { what: "diffraction: Wave", reason });
        }
        let bands = Bands { grid, sampling: spec.bands };
        let (columns, rows) = place.part.map_or((place.columns, place.rows), |part| (part.of_columns, part.of_rows));
        let settings = LensCameraSettings {
            // The focus puts the array there, and the film lies behind it.
            film_distance_mm: place.film_distance_mm + inputs.micro_array.map_or(0.0, |array| array.gap_mm),
            film_size_mm: DVec2::new(columns as f64, rows as f64) * (1e-3 * place.pitch_um),
            pixels: PixelGrid::new(columns, rows),
            placement: placement(&world, spec, inputs.scene.geometry.field_of_view_deg)?,
            origin: LensOrigin::EntrancePupil,
            diffraction: inputs.plan.bank.diffraction.hurb(),
            micro_array: inputs.micro_array,
        };
        let mut identity = format!("{} {:?} {settings:?}", fingerprint(&world, spec), lens.lens);
        let camera = LensCamera::new(&lens.lens, &bands, settings)?;
        let camera = match inputs.reflections.film_reflectance() {
            None => camera,
            Some(film) => {
                identity += " with ghosts";
                if film > 0.0 {
                    identity += &format!(", {film} of the light on the film among them");
                }
                camera.with_ghosts(film)?
            }
        };
        let camera = Camera::Lens(Box::new(camera));
        let (paths, seed) = (spec.paths, spec.seed);
        let whole = Self { world, camera, bands, paths, seed, samples_per_pass: SAMPLES_PER_PASS, identity };
        match place.part {
            Some(part) => whole.cropped((part.first_column, part.first_row), (place.columns, place.rows)),
            None => Ok(whole),
        }
    }

    /// Returns the world as a camera of its own file sees it: one by formula gives radiance, one with a lens irradiance.
    ///
    /// Lens files are looked for beside the world's.
    ///
    /// # Errors
    /// When the camera is of a kind that cannot be rendered, or its lens cannot be read.
    pub fn of_own_camera(
        world: Arc<World>,
        camera: &WorldCamera,
        spec: &WorldSpec,
        grid: WavelengthGrid,
    ) -> Result<Self, PipelineError> {
        let resolution = spec.size.unwrap_or(camera.resolution);
        let camera = WorldCamera { resolution, ..camera.clone() };
        let bands = Bands { grid, sampling: spec.bands };
        let folder = spec.file.parent().unwrap_or(Path::new(""));
        let read_lens = |name: &str| Lens::read(&folder.join(name));
        let lens = match &camera.kind {
            CameraKind::Lens { file, .. } if !file.is_empty() => fs::read(folder.join(file)).ok(),
            _ => None,
        };
        let lens = lens.map(|bytes| blake3::hash(&bytes));
        let identity = format!("{} {camera:?} {lens:?}", fingerprint(&world, spec));
        let camera = Camera::from_world(&camera, &bands, &read_lens)?;
        let (paths, seed) = (spec.paths, spec.seed);
        Ok(Self { world, camera, bands, paths, seed, samples_per_pass: SAMPLES_PER_PASS, identity })
    }

    /// Returns the rendering of a part of the picture: from this column and row on, so many of each; its samples are those of
    /// the whole.
    ///
    /// # Errors
    /// When the part does not lie in the picture.
    pub fn cropped(mut self, first: (usize, usize), size: (usize, usize)) -> Result<Self, PipelineError> {
        let pixels = self.camera.pixels().cropped(first, size)?;
        self.camera = self.camera.with_pixels(pixels);
        Ok(self)
    }

    /// Returns a first look at the picture, and how many of its pixels are one each way: gathered and clean of a pinhole; behind a lens one
    /// pass with as few samples as reach every band, on pixels `factor` times as wide and as high.
    ///
    /// # Errors
    /// When the work is cancelled.
    pub fn first_look(&self, factor: usize, cancel: &Cancel) -> Result<(SpectralImage, usize), PipelineError> {
        let pixels = self.camera.pixels();
        if let (Camera::Pinhole(view), LightPaths::Full) = (&self.camera, self.paths) {
            let factor = pixels.size().1.div_ceil(CLEAN_COLUMNS).max(1);
            let view = Pinhole { pixels: pixels.coarser(factor), ..*view };
            let seen =
                gathered_view(&self.world, &view, &self.bands.grid, (ViewDetail::Quick, self.seed), &|_| {}, cancel)?;
            return Ok((seen.radiance, factor));
        }
        let camera = self.camera.clone().with_pixels(pixels.coarser(factor));
        let coarse = Self { camera, samples_per_pass: 1, ..self.clone() };
        let mut renderer = coarse.renderer()?;
        renderer.pass(cancel, &|_| {})?;
        Ok((renderer.picture(), factor))
    }

    /// Returns the same in passes of as many samples as leave some that tell the noise, where their number is known: a large
    /// pass spreads its samples better than many small ones, and shows its picture later.
    #[must_use]
    pub fn in_large_passes(self, effort: RenderEffort) -> Self {
        let RenderEffort::Samples(n) = effort else { return self };
        let most = 1 << (n / TELLING_PASSES).max(1).ilog2();
        Self { samples_per_pass: self.samples_per_pass.max(most.min(MOST_SAMPLES_PER_PASS)), ..self }
    }

    /// What the pixels are of: irradiance on a film, or the radiance that a camera by formula sees.
    pub fn quantity(&self) -> Quantity {
        self.camera.quantity()
    }

    /// Returns what is rendered in words, so that no checkpoint is continued as another rendering.
    pub fn identity(&self, effort: RenderEffort) -> String {
        match effort {
            RenderEffort::Samples(_) => self.identity.clone(),
            RenderEffort::Noise(noise) => format!("{} noise {noise}", self.identity),
        }
    }

    /// Returns a renderer that has not begun.
    ///
    /// # Errors
    /// When a setting makes no sense.
    pub fn renderer(&self) -> Result<Renderer<'_>, PipelineError> {
        let settings = RenderSettings {
            bands: self.bands.clone(),
            paths: self.paths,
            samples_per_pass: self.samples_per_pass,
            seed: self.seed,
            clamp: None,
        };
        Ok(Renderer::new(&self.world, &self.camera, settings)?)
    }

    /// Makes passes until the picture is good enough, or `is_wanted`, which is called after each, returns false.
    ///
    /// # Errors
    /// When the work is cancelled, or `is_wanted` fails.
    pub fn refine(
        &self,
        renderer: &mut Renderer<'_>,
        effort: RenderEffort,
        progress: &dyn Progress,
        cancel: &Cancel,
        is_wanted: &mut dyn FnMut(&Renderer<'_>) -> Result<bool, PipelineError>,
    ) -> Result<(), PipelineError> {
        loop {
            let n_done = renderer.n_passes();
            let n_passes = match effort {
                RenderEffort::Samples(n) => Some(n.div_ceil(renderer.settings().samples_per_pass)),
                RenderEffort::Noise(noise) => {
                    if n_done >= PILOT_PASSES && renderer.n_passes_left().is_none() {
                        renderer.aim_at_noise(noise, MOST_PASSES)?;
                    }
                    renderer.n_passes_left().map(|left| n_done + left)
                }
            };
            if n_passes.is_some_and(|n| n_done >= n) {
                return Ok(());
            }
            let of = f64::from(n_passes.unwrap_or(2 * PILOT_PASSES));
            let show = |share: f64| progress.at(Stage::Irradiance, (f64::from(n_done) + share) / of);
            show(0.0);
            if !renderer.pass(cancel, &show)? || !is_wanted(renderer)? {
                return Ok(());
            }
        }
    }

    /// Renders the picture.
    ///
    /// # Errors
    /// When the work is cancelled.
    pub(crate) fn render(&self, effort: RenderEffort, watch: &Watch<'_>) -> Result<SpectralImage, PipelineError> {
        let mut renderer = self.renderer()?;
        self.refine(&mut renderer, effort, watch.progress, watch.cancel, &mut |_| Ok(true))?;
        Ok(renderer.picture())
    }

    /// Returns what the camera sees besides light: depth, normals, materials.
    ///
    /// # Errors
    /// When the work is cancelled.
    pub fn auxiliary(&self, cancel: &Cancel) -> Result<Auxiliary, PipelineError> {
        Ok(auxiliary(&self.world, &self.camera, &self.bands.grid, cancel)?)
    }

    /// Returns the depth of what is met along lines from the film through the array before it, m from the center of the entrance pupil.
    pub(super) fn depth_along(&self, lines_mm: &[FilmLine], cancel: &Cancel) -> Result<Vec<f32>, PipelineError> {
        match &self.camera {
            Camera::Lens(lens) => Ok(depth_along(&self.world, lens, lines_mm, cancel)?),
            _ => Ok(vec![f32::NAN; lines_mm.len()]),
        }
    }

    /// Writes a picture with its standard errors and its depth, and beside it `auxiliary.exr`; returns the names of the files.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write_files(
        &self,
        rendering: &Rendering,
        seen: &Auxiliary,
        folder: &Path,
    ) -> Result<[&str; 2], PipelineError> {
        let name = if self.quantity() == Quantity::Irradiance { IRRADIANCE_FILE } else { RADIANCE_FILE };
        write_rendering_exr(&folder.join(name), rendering, Some(&seen.z_m))?;
        write_auxiliary_exr(&folder.join(AUXILIARY_FILE), seen)?;
        Ok([name, AUXILIARY_FILE])
    }
}

/// The name of the file of what a camera by formula sees.
const RADIANCE_FILE: &str = "radiance.exr";
/// The name of the file of depth, normals and materials.
const AUXILIARY_FILE: &str = "auxiliary.exr";

/// Returns words that differ between worlds: the contents of all files that one was read from, wherever they lie, and what was added to it.
fn fingerprint(world: &World, spec: &WorldSpec) -> String {
    let mut hasher = blake3::Hasher::new();
    for path in world.sources() {
        let mut own = blake3::Hasher::new();
        let is_read = fs::File::open(path).and_then(|file| own.update_reader(file).map(|_| ())).is_ok();
        // A file that wasn't there differs from every one that is.
        hasher.update(&[u8::from(is_read)]);
        hasher.update(own.finalize().as_bytes());
    }
    let WorldSpec { unit_m, time_s, animation, variant, changes, view, sky, lamps, .. } = spec;
    let shown = (time_s, animation, variant);
    let (hash, gain) = (hasher.finalize().to_hex(), world.gain());
    format!("{hash} {unit_m} {shown:?} {changes:?} {view:?} {sky:?} {lamps:?} {gain}")
}
