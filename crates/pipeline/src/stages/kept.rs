//! A camera that is kept and changed.

use std::{fs, path::PathBuf, sync::Arc};

use dioptric_forward::{ImagingPlan, check_depth_map};
use dioptric_psf::{LensImage, LensImageModel};
use dioptric_scene::{Scene, StillLife};
use dioptric_sensor::{Developed, ElectronRate, Illumination, Processing, Sensor};
use dioptric_spectrum::{Bands, Cancel, DepthMap, Illuminant, Quantity, SpectralImage, WavelengthGrid};
use dioptric_world::World;

use super::{
    Watch,
    band_store::BandFolder,
    bank,
    electrons::{self, PixelRates},
    film::{self, FilmPlace},
    frames::{self, FrameSet, MovedLight},
    given::GivenParts,
    irradiance::{self, Irradiance, Keeping},
    lens::{self, ResolvedLens},
    lens_tables::{LensAberrations, TableParts},
    lit_still_life::{self, RadiantStillLife},
    memory::MemoryBudget,
    narrow_surfaces::NarrowSurfaces,
    painting::{PaintingInputs, Paintings},
    part::Part,
    plan,
    scene::{self, ResolvedScene, SceneSummary},
    slot::Slot,
    spec::{
        AberrationInputs, BankInputs, ElectronInputs, FilmInputs, FrameInputs, GeometryInputs, IrradianceInputs,
        LensInputs, PictureInputs, PlanInputs, Raster, SceneInputs, WorldInputs,
    },
    world::{self, WorldRender, WorldStage},
};
use crate::{
    BlurSpec, Camera, DualPixelSpec, Frames, Leftover, LensFacts, PaintingFolder, PipelineError, Progress, Quality,
    SceneSource, Stage,
};

/// Irradiance that is kept in memory where nothing else is asked for, bytes: 2 GiB.
const MEMORY_BYTES: u64 = 2 << 30;

/// A camera whose results are kept: change it and ask again, and only what the change touches is computed.
///
/// Clones and changed cameras ([`with`](Self::with)) share what is kept, so that going back to an earlier setting costs
/// nothing. Results are the same to the bit whether they were kept or made anew, and for any number of threads.
///
/// ```
/// use dioptric_pipeline::{Camera, FilmSpec, KeptCamera, SceneSource, Silent, WavelengthSpec};
/// use dioptric_spectrum::Cancel;
///
/// let mut camera = Camera::demo()?;
/// camera.film = FilmSpec::Pixels { columns: 48, rows: 32, pitch_um: 660.0 };
/// camera.scene.source = SceneSource::StillLife { columns: 54, rows: 36 };
/// camera.wavelengths = WavelengthSpec::ListNm(vec![450.0, 550.0, 650.0]);
/// let kept = KeptCamera::new(camera);
/// let first = kept.capture(&Silent, &Cancel::new())?;
/// // Another seed: the scene is imaged no second time.
/// let second = kept.with(|camera| camera.seed = 2).capture(&Silent, &Cancel::new())?;
/// assert!(std::sync::Arc::ptr_eq(&first.irradiance, &second.irradiance));
/// assert_ne!(first.frames.exposed.volts.planes_v, second.frames.exposed.volts.planes_v);
/// # Ok::<(), dioptric_pipeline::PipelineError>(())
/// ```
#[derive(Clone, Debug)]
pub struct KeptCamera {
    camera: Camera,
    pub(super) given: GivenParts,
    quality: Quality,
    memory_bytes: u64,
    budget: Option<MemoryBudget>,
    bands: Option<(PathBuf, String)>,
    paintings: Option<PaintingFolder>,
    kept: Arc<KeptResults>,
}

/// The results of all stages.
#[derive(Debug)]
pub(super) struct KeptResults {
    pub(super) lens: Slot<LensInputs, ResolvedLens>,
    pub(super) world: Slot<WorldInputs, World>,
    painting: Slot<PaintingInputs, Scene>,
    lit: Slot<StillLife, RadiantStillLife>,
    pub(super) scene: Slot<SceneInputs, ResolvedScene>,
    pub(super) summary: Slot<SceneInputs, SceneSummary>,
    pub(super) depth: Slot<GeometryInputs, DepthMap>,
    pub(super) film: Slot<FilmInputs, FilmPlace>,
    pub(super) bank: Slot<BankInputs, LensImageModel>,
    pub(super) plan: Slot<PlanInputs, ImagingPlan>,
    pub(super) irradiance: Slot<IrradianceInputs, Irradiance>,
    pub(super) electrons: Slot<ElectronInputs, PixelRates>,
    pub(super) frames: Slot<FrameInputs, FrameSet>,
    aberrations: Slot<AberrationInputs, LensAberrations>,
    pub(super) picture: Slot<PictureInputs, Developed>,
}

impl Default for KeptResults {
    /// Keeps one or two results of what is large and a few of what is small.
    fn default() -> Self {
        Self {
            lens: Slot::new(8),
            world: Slot::new(2),
            painting: Slot::new(4),
            lit: Slot::new(1),
            scene: Slot::new(2),
            summary: Slot::new(8),
            depth: Slot::new(2),
            film: Slot::new(8),
            bank: Slot::new(4),
            plan: Slot::new(2),
            irradiance: Slot::new(2),
            electrons: Slot::new(2),
            frames: Slot::new(2),
            aberrations: Slot::new(4),
            picture: Slot::new(4),
        }
    }
}

/// How often each stage was run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StageCounts {
    /// Lenses resolved.
    pub lens: usize,
    /// Pictures of the still life painted for previews.
    pub painting: usize,
    /// Scenes read or made.
    pub scene: usize,
    /// Films placed.
    pub film: usize,
    /// Models of a lens's image traced.
    pub bank: usize,
    /// Imagings planned.
    pub plan: usize,
    /// Scenes imaged.
    pub irradiance: usize,
    /// Electron rates collected.
    pub electrons: usize,
    /// Sets of frames taken.
    pub frames: usize,
    /// Pictures developed.
    pub picture: usize,
}

/// What came of a camera, stage by stage.
#[derive(Clone, Debug)]
pub struct Capture {
    /// The camera.
    pub camera: Camera,
    /// How finely it was simulated.
    pub quality: Quality,
    /// The lens.
    pub lens: Arc<ResolvedLens>,
    /// The scene, in brief.
    pub scene: Arc<SceneSummary>,
    /// The film.
    pub place: Arc<FilmPlace>,
    /// The sensor, of the film's size.
    pub sensor: Sensor,
    /// The irradiance on the film.
    pub irradiance: Arc<Irradiance>,
    /// The mean rate of photo-electrons of whole pixels.
    pub rate: Arc<ElectronRate>,
    /// The frames.
    pub frames: Arc<FrameSet>,
    /// From the raw frame to the picture.
    pub processing: Processing,
    /// What the lens does to the frame, where the processing undoes some of it.
    pub aberrations: Option<Arc<LensAberrations>>,
    /// The picture.
    pub developed: Arc<Developed>,
    /// What the rate of electrons was made from.
    pub(super) inputs: ElectronInputs,
    /// The rates of photodiodes that are read by themselves, besides that of whole pixels.
    pub(super) rates: Arc<PixelRates>,
}

impl Capture {
    /// The bands.
    pub fn grid(&self) -> &WavelengthGrid {
        self.irradiance.grid()
    }

    /// What is to be said of the lens at the bands of the picture, a sentence each: what its file states and this program does otherwise,
    /// and which glasses are continued beyond the range in which they are known.
    pub fn lens_notes(&self) -> Vec<String> {
        let of_glasses = self.lens.lens.notes_on_glass_range(self.grid().centers_nm());
        self.lens.notes.iter().cloned().chain(of_glasses).collect()
    }

    /// What is written of the frames.
    pub fn frame_parts(&self) -> Frames<'_> {
        let first = self.lens.reference.first_order();
        Frames {
            sensor: &self.sensor,
            exposure: &self.frames.exposure,
            rate: &self.rate,
            exposed: &self.frames.exposed,
            processing: &self.processing,
            lens: self.aberrations.as_ref().map(|aberrations| &aberrations.tables),
            optics: Some(LensFacts {
                name: self.lens.lens.name(),
                f_number: first.f_number,
                focal_length_mm: first.efl_mm,
            }),
            grid: self.grid(),
            light: self.scene.light.as_ref().map_or(Illuminant::D65, |light| light.illuminant.clone()),
        }
    }
}

impl KeptCamera {
    /// A camera of which nothing is computed yet, at full quality.
    pub fn new(camera: Camera) -> Self {
        let (given, quality) = (GivenParts::default(), Quality::Full);
        let (memory_bytes, kept) = (MEMORY_BYTES, Arc::default());
        Self { camera, given, quality, memory_bytes, budget: None, bands: None, paintings: None, kept }
    }

    /// Returns the camera changed; what is kept is shared.
    #[must_use]
    pub fn with(&self, change: impl FnOnce(&mut Camera)) -> Self {
        let mut changed = self.clone();
        change(&mut changed.camera);
        changed
    }

    /// Returns the camera at another quality; what is kept is shared.
    #[must_use]
    pub fn with_quality(&self, quality: Quality) -> Self {
        Self { quality, ..self.clone() }
    }

    /// Returns the camera with irradiance of more than so many bytes kept in a temporary file instead of memory.
    #[must_use]
    pub fn with_memory_bytes(&self, memory_bytes: u64) -> Self {
        Self { memory_bytes, ..self.clone() }
    }

    /// Returns the camera whose imaging takes at most so many bytes: scene, plan, bands that are worked on and film. Irradiance that
    /// does not fit goes to a temporary file. A plan that is kept already stays as it is.
    #[must_use]
    pub fn with_memory_budget(&self, bytes: u64) -> Self {
        Self { budget: Some(MemoryBudget { bytes }), ..self.clone() }
    }

    /// Returns the camera that keeps bands of the irradiance in a folder as they are finished, for a run that goes on after this one
    /// was killed; `build` tells builds of the program apart, since another may image otherwise.
    #[must_use]
    pub fn with_bands_kept_in(&self, folder: impl Into<PathBuf>, build: impl Into<String>) -> Self {
        Self { bands: Some((folder.into(), build.into())), ..self.clone() }
    }

    /// Takes the finished bands that a killed run of this camera left, to go on from there; returns whether there were any.
    ///
    /// # Errors
    /// When they cannot be moved to the folder of this camera's bands, or there is none.
    pub fn take_bands(&self, leftovers: &[Leftover]) -> Result<bool, PipelineError> {
        let inputs = self.irradiance_inputs()?;
        let Some(folder) = self.band_folder(&inputs)? else { return Ok(false) };
        let folders = match inputs.dual_pixel {
            None => vec![folder],
            Some(spec) => (0..spec.photodiodes.names().len()).map(|number| folder.of_photodiode(number)).collect(),
        };
        for leftover in leftovers {
            let mut is_any = false;
            for folder in &folders {
                is_any |= folder.adopt(leftover.path())?;
            }
            if is_any {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Returns where bands are kept: a part of the camera that was made in a program has no name by which to know it again.
    fn band_folder(&self, inputs: &IrradianceInputs) -> Result<Option<BandFolder>, PipelineError> {
        let Some((path, build)) = self.bands.as_ref().filter(|_| self.given.check_none().is_ok()) else {
            return Ok(None);
        };
        let key = (build, self.quality, &self.camera, inputs.files().collect::<Vec<_>>());
        let key = ron::to_string(&key)
            .map_err(|error| PipelineError::Write { path: path.clone(), reason: error.to_string() })?;
        Ok(Some(BandFolder { path: path.clone(), key, photodiode: None }))
    }

    /// Returns the camera that keeps paintings of the still life in a folder, for it and others to take from there.
    #[must_use]
    pub fn with_paintings(&self, folder: Option<PaintingFolder>) -> Self {
        Self { paintings: folder, ..self.clone() }
    }

    /// The camera.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The quality.
    pub fn quality(&self) -> Quality {
        self.quality
    }

    /// How often each stage was run, by this camera and all that share its results.
    pub fn stage_counts(&self) -> StageCounts {
        let kept = &*self.kept;
        StageCounts {
            lens: kept.lens.n_made(),
            painting: kept.painting.n_made(),
            scene: kept.scene.n_made(),
            film: kept.film.n_made(),
            bank: kept.bank.n_made(),
            plan: kept.plan.n_made(),
            irradiance: kept.irradiance.n_made(),
            electrons: kept.electrons.n_made(),
            frames: kept.frames.n_made(),
            picture: kept.picture.n_made(),
        }
    }

    /// Takes the picture; stages whose inputs are as before hand out what they kept.
    ///
    /// # Errors
    /// When a number makes no sense, a name is unknown, a file cannot be read, parts do not go together, or the work is
    /// cancelled.
    pub fn capture(&self, progress: &dyn Progress, cancel: &Cancel) -> Result<Capture, PipelineError> {
        self.camera.validate()?;
        let inputs = self.picture_inputs()?;
        let chain = self.chain(progress, cancel);
        let frame_inputs = &inputs.frames;
        let electron_inputs = &frame_inputs.electrons;
        let irradiance_inputs = &electron_inputs.irradiance;

        let lens = chain.lens(&irradiance_inputs.plan.bank.film.lens)?;
        check_glasses(&lens, self.camera.wavelengths.grid()?.as_ref())?;
        let irradiance = chain.irradiance(irradiance_inputs)?;
        let place = chain.film(&irradiance_inputs.plan.bank.film, &irradiance_inputs.scene)?;
        let scene = chain.summary(&irradiance_inputs.scene)?;
        let rates = chain.electrons(electron_inputs)?;
        let sensor = electrons::read_out(electron_inputs, &place);
        let frames = chain.frames(frame_inputs)?;
        let processing = self.camera.processing.under(scene.light.as_ref().map(|light| &light.illuminant));
        let aberrations = chain.aberrations(&inputs)?;
        let developed = chain.picture(inputs.clone(), &processing, aberrations.clone())?;
        progress.at(Stage::Picture, 1.0);
        Ok(Capture {
            camera: self.camera.clone(),
            quality: self.quality,
            lens,
            scene,
            place,
            sensor,
            irradiance,
            rate: rates.whole.clone(),
            frames,
            processing,
            aberrations,
            developed,
            inputs: electron_inputs.clone(),
            rates,
        })
    }

    /// Checks all that can be without taking the picture: every number, the lens with its stop and glasses, the sensor, and
    /// that the scene's file is there. Returns the lens.
    ///
    /// # Errors
    /// As [`capture`](Self::capture) has them before it computes anything.
    pub fn check(&self) -> Result<Arc<ResolvedLens>, PipelineError> {
        self.camera.validate()?;
        let inputs = self.irradiance_inputs()?;
        let lens = self.kept.lens.get_or_make(inputs.plan.bank.film.lens, lens::resolve)?;
        check_glasses(&lens, self.camera.wavelengths.grid()?.as_ref())?;
        let file = match &self.camera.scene.source {
            SceneSource::File(path) => Some(path),
            SceneSource::World(world) => Some(&world.file).filter(|_| !world.is_still_life()),
            SceneSource::StillLife { .. } | SceneSource::Target { .. } => None,
        };
        if let Some(path) = file.filter(|_| self.given.scene.is_none()) {
            fs::metadata(path).map_err(|e| PipelineError::Read { path: path.clone(), reason: e.to_string() })?;
        }
        Ok(lens)
    }

    /// Returns the model of the lens's image that the picture was made with, traced now where it is not kept.
    ///
    /// # Errors
    /// As [`capture`](Self::capture).
    pub fn model(&self, progress: &dyn Progress, cancel: &Cancel) -> Result<Arc<LensImageModel>, PipelineError> {
        let inputs = self.irradiance_inputs()?;
        let chain = self.chain(progress, cancel);
        chain.bank(&inputs.plan.bank, &inputs.scene)
    }

    /// Returns the scene as it is imaged at this quality, read or made now where it is not kept.
    ///
    /// # Errors
    /// As [`capture`](Self::capture).
    pub fn scene(&self, progress: &dyn Progress, cancel: &Cancel) -> Result<Arc<ResolvedScene>, PipelineError> {
        let inputs = self.irradiance_inputs()?;
        let chain = self.chain(progress, cancel);
        chain.scene(&inputs.scene)
    }

    /// Returns the depth of each sample of the scene, m; of a camera that continues a run, what that wrote of it.
    ///
    /// # Errors
    /// As [`capture`](Self::capture).
    pub fn depth(&self, progress: &dyn Progress, cancel: &Cancel) -> Result<Arc<DepthMap>, PipelineError> {
        let inputs = self.irradiance_inputs()?;
        let chain = self.chain(progress, cancel);
        if let Some(kept) = self.kept.depth.get(&inputs.scene.geometry) {
            return Ok(kept);
        }
        let scene = chain.scene(&inputs.scene)?;
        Ok(self.kept.depth.put(inputs.scene.geometry, scene.scene.require_depth()?.clone()))
    }

    /// Returns the irradiance on the film.
    ///
    /// # Errors
    /// As [`capture`](Self::capture).
    pub fn irradiance(&self, progress: &dyn Progress, cancel: &Cancel) -> Result<Arc<Irradiance>, PipelineError> {
        self.camera.validate()?;
        let inputs = self.irradiance_inputs()?;
        let chain = self.chain(progress, cancel);
        chain.irradiance(&inputs)
    }

    /// Returns the world before the camera, read now where it is not kept.
    ///
    /// # Errors
    /// When the scene is no world, or its files cannot be read.
    pub fn world(&self, progress: &dyn Progress, cancel: &Cancel) -> Result<Arc<World>, PipelineError> {
        let scene = SceneInputs::of(&self.camera, &self.given, self.quality);
        let chain = self.chain(progress, cancel);
        chain.world(&scene.geometry)
    }

    /// Returns the world of a file before the camera; `None` where that is the built-in still life.
    ///
    /// # Errors
    /// As [`world`](Self::world).
    pub fn world_of_file(&self, progress: &dyn Progress, cancel: &Cancel) -> Result<Option<Arc<World>>, PipelineError> {
        let is_still_life = matches!(&self.camera.scene.source, SceneSource::World(spec) if spec.is_still_life());
        if is_still_life { Ok(None) } else { self.world(progress, cancel).map(Some) }
    }

    /// Returns the world before the camera as its lens sees it, to be rendered pass by pass.
    ///
    /// # Errors
    /// When the scene is no world, or as [`capture`](Self::capture).
    pub fn world_render(&self, progress: &dyn Progress, cancel: &Cancel) -> Result<WorldRender, PipelineError> {
        self.camera.validate()?;
        let inputs = self.irradiance_inputs()?;
        let chain = self.chain(progress, cancel);
        let resolved = chain.scene(&inputs.scene)?;
        let lens = chain.lens(&inputs.plan.bank.film.lens)?;
        // What is too near for the lens is found before the work.
        let grid = resolved.scene.radiance.grid();
        check_glasses(&lens, Some(grid))?;
        check_depth_map(&lens.lens, grid, resolved.scene.require_depth()?)?;
        chain.world_render(&inputs)
    }

    /// Returns the built-in still life as the lens sees it, for a look at the picture before it is lit: at once, but slow and with more
    /// noise; `None` of a world, which needs no light before.
    ///
    /// # Errors
    /// As [`world_render`](Self::world_render).
    pub fn unlit_render(&self, progress: &dyn Progress, cancel: &Cancel) -> Result<Option<WorldRender>, PipelineError> {
        self.camera.validate()?;
        let inputs = self.irradiance_inputs()?;
        let chain = self.chain(progress, cancel);
        let Some(spec) = inputs.scene.geometry.still_life() else { return Ok(None) };
        let (life, _) = lit_still_life::picture_of(&inputs.scene.geometry, spec);
        let stage = WorldStage::StillLife(Arc::new(RadiantStillLife::unlit(&life)?));
        chain.through_lens(stage, &inputs).map(Some)
    }

    /// Whether the irradiance on the film is kept, so that a capture starts behind it.
    ///
    /// # Errors
    /// When the sensor cannot be read.
    pub fn has_irradiance(&self) -> Result<bool, PipelineError> {
        Ok(self.kept.irradiance.get(&self.irradiance_inputs()?).is_some())
    }

    /// Keeps a rendered picture as the irradiance of this camera, so that a capture starts behind it.
    ///
    /// # Errors
    /// When the picture is no irradiance on the film of this camera.
    pub fn keep_irradiance(&self, picture: SpectralImage) -> Result<(), PipelineError> {
        let inputs = self.irradiance_inputs()?;
        let (quantity, pitch_um) = (picture.quantity(), picture.pitch_um());
        let Some(pitch_um) = pitch_um.filter(|_| quantity == Quantity::Irradiance) else {
            let reason = format!("its unit is {}, expected an irradiance on pixels of a known pitch", quantity.unit());
            return Err(PipelineError::Unsuitable { what: "the picture", reason });
        };
        self.kept.irradiance.put(inputs, Irradiance::of_image(picture, pitch_um));
        Ok(())
    }

    /// Returns the width and the height of the film, mm; of a film that has the scene's size, the scene is opened for it.
    ///
    /// # Errors
    /// As [`capture`](Self::capture) has them before it traces the lens.
    pub fn film_size_mm(&self, progress: &dyn Progress, cancel: &Cancel) -> Result<[f64; 2], PipelineError> {
        let film = match self.irradiance_inputs()?.plan.bank.film.raster {
            Raster::Pixels(film) => film,
            Raster::Scene => self.lens_and_film(progress, cancel)?.1.film(),
        };
        Ok([film.columns, film.rows].map(|n| 1e-3 * film.pitch_um * n as f64))
    }

    /// Returns the lens and the film behind it.
    pub(super) fn lens_and_film(
        &self,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<(Arc<ResolvedLens>, Arc<FilmPlace>), PipelineError> {
        let inputs = self.irradiance_inputs()?;
        let chain = self.chain(progress, cancel);
        let film = &inputs.plan.bank.film;
        Ok((chain.lens(&film.lens)?, chain.film(film, &inputs.scene)?))
    }

    fn chain<'a>(&'a self, progress: &'a dyn Progress, cancel: &'a Cancel) -> Chain<'a> {
        Chain { camera: self, kept: &self.kept, paintings: self.paintings.as_ref(), watch: Watch { progress, cancel } }
    }

    pub(super) fn irradiance_inputs(&self) -> Result<IrradianceInputs, PipelineError> {
        Ok(self.picture_inputs()?.frames.electrons.irradiance)
    }

    fn picture_inputs(&self) -> Result<PictureInputs, PipelineError> {
        PictureInputs::of(&self.camera, &self.given, self.quality)
    }

    pub(super) fn results(&self) -> &KeptResults {
        &self.kept
    }
}

/// Checks that every medium of the lens is known at bands that are known before the scene is.
fn check_glasses(lens: &ResolvedLens, grid: Option<&WavelengthGrid>) -> Result<(), PipelineError> {
    for &wavelength_nm in grid.iter().flat_map(|grid| grid.centers_nm()) {
        lens.lens.at(wavelength_nm)?;
    }
    Ok(())
}

/// The stages in their order, each asking for the ones it needs.
struct Chain<'a> {
    camera: &'a KeptCamera,
    kept: &'a KeptResults,
    paintings: Option<&'a PaintingFolder>,
    watch: Watch<'a>,
}

impl Chain<'_> {
    fn lens(&self, inputs: &LensInputs) -> Result<Arc<ResolvedLens>, PipelineError> {
        self.kept.lens.get_or_make(inputs.clone(), lens::resolve)
    }

    fn scene(&self, inputs: &SceneInputs) -> Result<Arc<ResolvedScene>, PipelineError> {
        self.kept.scene.get_or_make(inputs.clone(), |inputs| {
            self.watch.progress.at(Stage::Scene, 0.0);
            self.watch.cancel.check()?;
            let paintings = Paintings { kept: &self.kept.painting, folder: self.paintings };
            let scene = match inputs.geometry.world() {
                _ if let Some(spec) = inputs.geometry.still_life() => {
                    lit_still_life::view(inputs, spec, paintings, &self.watch)?
                }
                Some((_, spec)) => world::view(inputs, spec, &self.world(&inputs.geometry)?, &self.watch)?,
                None => {
                    let lens = inputs.geometry.flat.as_ref().map(|(_, lens)| self.lens(lens)).transpose()?;
                    let pupil_z_mm = lens.map(|lens| lens.reference.projection_center_z_mm());
                    scene::open(inputs, pupil_z_mm, paintings, &self.watch)?
                }
            };
            self.watch.progress.at(Stage::Scene, 1.0);
            Ok(scene)
        })
    }

    fn world(&self, geometry: &GeometryInputs) -> Result<Arc<World>, PipelineError> {
        let Some((inputs, _)) = geometry.world() else {
            let reason = match geometry.still_life() {
                Some(_) => "the still life is built in and no world that is read, expected one of a file",
                None => "it is no world, expected 'source: World((file: ...))'",
            };
            let reason = reason.to_owned();
            return Err(PipelineError::Unsuitable { what: "scene", reason });
        };
        self.kept.world.get_or_make(inputs, |inputs| world::read(inputs, &self.watch))
    }

    fn world_render(&self, inputs: &IrradianceInputs) -> Result<WorldRender, PipelineError> {
        let geometry = &inputs.scene.geometry;
        let stage = match geometry.still_life() {
            Some(spec) => {
                let (life, _) = lit_still_life::picture_of(geometry, spec);
                let light = |life: &StillLife| RadiantStillLife::new(life, &self.watch);
                WorldStage::StillLife(self.kept.lit.get_or_make(life, light)?)
            }
            None => WorldStage::World(self.world(geometry)?),
        };
        self.through_lens(stage, inputs)
    }

    fn through_lens(&self, stage: WorldStage, inputs: &IrradianceInputs) -> Result<WorldRender, PipelineError> {
        let film = &inputs.plan.bank.film;
        let grid = self.summary(&inputs.scene)?.grid()?;
        let (lens, place) = (self.lens(&film.lens)?, self.film(film, &inputs.scene)?);
        WorldRender::through_lens(stage, inputs, (&lens, &place), grid)
    }

    fn summary(&self, inputs: &SceneInputs) -> Result<Arc<SceneSummary>, PipelineError> {
        self.kept.summary.get_or_make(inputs.clone(), |inputs| SceneSummary::of(&self.scene(inputs)?.scene))
    }

    fn film(&self, inputs: &FilmInputs, scene: &SceneInputs) -> Result<Arc<FilmPlace>, PipelineError> {
        self.kept.film.get_or_make(inputs.clone(), |inputs| {
            let scene = self.scene(scene)?;
            film::place(inputs, &*self.lens(&inputs.lens)?, &scene)
        })
    }

    fn bank(&self, inputs: &BankInputs, scene: &SceneInputs) -> Result<Arc<LensImageModel>, PipelineError> {
        self.kept.bank.get_or_make(inputs.clone(), |inputs| {
            let summary = self.summary(scene)?;
            let (lens, place) = (self.lens(&inputs.film.lens)?, self.film(&inputs.film, scene)?);
            // Every medium must be known at every band before rays are traced.
            let grid = summary.grid()?;
            check_glasses(&lens, Some(&grid))?;
            // The scene itself can tell where it is too near; a continued run has been through this.
            let resolved = self.kept.scene.get(scene);
            if let Some(depth) = resolved.as_ref().and_then(|resolved| resolved.scene.depth.as_ref()) {
                check_depth_map(&lens.lens, &grid, depth)?;
            }
            self.watch.progress.at(Stage::Lens, 0.0);
            bank::build(inputs, &lens, &place, (summary.near_m, summary.far_m), &grid, &self.watch)
        })
    }

    fn plan(&self, inputs: &PlanInputs, scene: &SceneInputs) -> Result<Arc<ImagingPlan>, PipelineError> {
        self.kept.plan.get_or_make(inputs.clone(), |inputs| {
            let (place, resolved) = (self.film(&inputs.bank.film, scene)?, self.scene(scene)?);
            let budget = self.camera.budget;
            // What is too large for it is found before the lens is traced.
            budget.map_or(Ok(()), |budget| budget.check(&resolved.scene, &place))?;
            let model = self.bank(&inputs.bank, scene)?;
            let lens: Arc<dyn LensImage + Send> = match inputs.photodiode {
                None => model,
                Some((spec, number)) => {
                    let f_number = place.working_f_number(&*self.lens(&inputs.bank.film.lens)?);
                    let images = model.through(spec.pupil_division(f_number))?;
                    images.into_iter().nth(number).expect("a photodiode of those that there are")
                }
            };
            plan::plan(inputs, lens, &place, &resolved.scene, budget, &self.watch)
        })
    }

    fn irradiance(&self, inputs: &IrradianceInputs) -> Result<Arc<Irradiance>, PipelineError> {
        self.kept.irradiance.get_or_make(inputs.clone(), |inputs| {
            if let Some(spec) = inputs.dual_pixel {
                return self.irradiance_of_photodiodes(inputs, spec);
            }
            if let Some(effort) = inputs.effort {
                let picture = self.world_render(inputs)?.render(effort, &self.watch)?.picture;
                let place = self.film(&inputs.plan.bank.film, &inputs.scene)?;
                return Ok(Irradiance::of_image(picture, place.pitch_um));
            }
            if inputs.micro_array.is_some() {
                let reason = "only rays from the film go through its array, expected a world with method: Backward";
                return Err(PipelineError::Unsuitable { what: "light_field", reason: reason.to_owned() });
            }
            self.imaged(inputs)
        })
    }

    /// Images the scene through the pupil, or the part of it that a photodiode sees.
    fn imaged(&self, inputs: &IrradianceInputs) -> Result<Irradiance, PipelineError> {
        let plan = self.plan(&inputs.plan, &inputs.scene)?;
        let resolved = self.scene(&inputs.scene)?;
        let place = self.film(&inputs.plan.bank.film, &inputs.scene)?;
        let scene: &Scene = &resolved.scene;
        let memory_bytes = match self.camera.budget {
            Some(budget) => budget.irradiance_bytes(&plan, scene, &place)?.min(self.camera.memory_bytes),
            None => self.camera.memory_bytes,
        };
        let folder = match inputs.plan.photodiode {
            None => self.camera.band_folder(inputs)?,
            Some((_, number)) => self.camera.band_folder(inputs)?.map(|folder| folder.of_photodiode(number)),
        };
        let keeping = Keeping { memory_bytes, folder: folder.as_ref() };
        let irradiance = irradiance::image(&plan, scene, &place, keeping, &self.watch)?;
        let is_layered = inputs.plan.blur == BlurSpec::Layered;
        let narrow = if is_layered { NarrowSurfaces::of(&plan, scene) } else { None };
        Ok(irradiance.with_narrow_surfaces(narrow))
    }

    /// Images the scene through the part of the pupil that each photodiode sees, one after the other.
    fn irradiance_of_photodiodes(
        &self,
        inputs: &IrradianceInputs,
        spec: DualPixelSpec,
    ) -> Result<Irradiance, PipelineError> {
        let n = spec.photodiodes.names().len();
        // The sum is as large as each of them.
        let memory_bytes = self.camera.memory_bytes;
        let camera = KeptCamera { memory_bytes: memory_bytes / (n as u64 + 1), ..self.camera.clone() };
        let irradiance = |number: usize| {
            let plan = PlanInputs { photodiode: Some((spec, number)), ..inputs.plan.clone() };
            let inputs = IrradianceInputs { plan, dual_pixel: None, ..inputs.clone() };
            let progress = Part { progress: self.watch.progress, number, of: n };
            let watch = Watch { progress: &progress, cancel: self.watch.cancel };
            Chain { camera: &camera, kept: self.kept, paintings: self.paintings, watch }.imaged(&inputs)
        };
        let photodiodes = (0..n).map(irradiance).collect::<Result<Vec<_>, _>>()?;
        let narrow = photodiodes[0].summary.narrow_surfaces;
        Ok(Irradiance::of_photodiodes(photodiodes, memory_bytes)?.with_narrow_surfaces(narrow))
    }

    fn electrons(&self, inputs: &ElectronInputs) -> Result<Arc<PixelRates>, PipelineError> {
        self.kept.electrons.get_or_make(inputs.clone(), |inputs| {
            let irradiance = self.irradiance(&inputs.irradiance)?;
            let place = self.film(&inputs.irradiance.plan.bank.film, &inputs.irradiance.scene)?;
            electrons::collect(irradiance, electrons::on_film(&inputs.sensor, &place), &place, &self.watch)
        })
    }

    fn frames(&self, inputs: &FrameInputs) -> Result<Arc<FrameSet>, PipelineError> {
        self.kept.frames.get_or_make(inputs.clone(), |inputs| {
            let irradiance = &inputs.electrons.irradiance;
            let place = self.film(&irradiance.plan.bank.film, &irradiance.scene)?;
            let rates = self.electrons(&inputs.electrons)?;
            let dual_pixel = irradiance.dual_pixel;
            self.watch.progress.at(Stage::Sensor, 0.5);
            let (shutter, sensor) = (inputs.shutter.clone(), electrons::on_film(&inputs.electrons.sensor, &place));
            // What moves between frames is the irradiance.
            let irradiance = if shutter.moves() { Some(self.irradiance(irradiance)?) } else { None };
            let exit_pupil = electrons::exit_pupil(&sensor, &place);
            self.watch.run(move || {
                if let Some(spec) = dual_pixel {
                    return frames::expose_photodiodes(&shutter, &sensor, spec, &rates);
                }
                let moved = irradiance.as_deref().map(|irradiance| MovedLight {
                    light: Illumination { exit_pupil, ..Illumination::on_pixels(irradiance) },
                    samples_per_px: 1.0 / place.binning as f64,
                });
                frames::expose(&shutter, &sensor, &rates.whole, moved.as_ref())
            })
        })
    }

    /// Returns what the lens does to the frame, where the processing undoes some of it.
    fn aberrations(&self, inputs: &PictureInputs) -> Result<Option<Arc<LensAberrations>>, PipelineError> {
        if inputs.processing.lens_corrections.is_none() {
            return Ok(None);
        }
        let ElectronInputs { irradiance, sensor } = &inputs.frames.electrons;
        let film = irradiance.plan.bank.film.clone();
        let inputs = AberrationInputs { film, scene: irradiance.scene.clone(), sensor: sensor.clone() };
        let aberrations = self.kept.aberrations.get_or_make(inputs, |inputs| {
            let (lens, summary) = (self.lens(&inputs.film.lens)?, self.summary(&inputs.scene)?);
            let place = self.film(&inputs.film, &inputs.scene)?;
            let parts = TableParts {
                lens: &lens,
                place: &place,
                sensor: &electrons::on_film(&inputs.sensor, &place),
                light: summary.light.as_ref().map(|light| &light.illuminant),
                grid: &summary.grid()?,
                depth_range_m: (summary.near_m, summary.far_m),
            };
            parts.aberrations(&self.watch)
        })?;
        Ok(Some(aberrations))
    }

    fn picture(
        &self,
        inputs: PictureInputs,
        processing: &Processing,
        aberrations: Option<Arc<LensAberrations>>,
    ) -> Result<Arc<Developed>, PipelineError> {
        self.kept.picture.get_or_make(inputs, |inputs| {
            self.watch.progress.at(Stage::Picture, 0.0);
            let irradiance = &inputs.frames.electrons.irradiance;
            let place = self.film(&irradiance.plan.bank.film, &irradiance.scene)?;
            let frames = self.frames(&inputs.frames)?;
            let sensor = electrons::read_out(&inputs.frames.electrons, &place);
            let processing = processing.clone();
            self.watch.run(move || {
                let tables = aberrations.as_ref().map(|aberrations| &aberrations.tables);
                Ok(sensor.develop_with(frames.exposed.developed_from(), &processing, tables)?)
            })
        })
    }
}
