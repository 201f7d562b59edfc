//! A camera that is kept and changed.

use std::{fs, path::PathBuf, sync::Arc};

use dioptric_files::Leftover;
use dioptric_psf::LensImageModel;
use dioptric_spectrum::{Cancel, DepthMap};

use super::{
    Watch,
    band_store::BandKeeping,
    canvas::frame_that,
    capture::Capture,
    chain::Chain,
    electrons,
    film::{self, FilmPlace, Outline, binned, film_distances_mm},
    film_reach::FilmReach,
    given::GivenParts,
    irradiance::Irradiance,
    lens::{self, ResolvedLens, check_glasses},
    memory::MemoryBudget,
    painting::PaintReach,
    results::{KeptResults, StageCounts},
    scene::ResolvedScene,
    spec::{FilmInputs, IrradianceInputs, PictureInputs, Raster},
    white_of::WhiteOf,
};
use crate::{Camera, PaintingFolder, PipelineError, Progress, Quality, SceneSource, Stage};

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
    pub(super) camera: Camera,
    pub(super) given: GivenParts,
    pub(super) quality: Quality,
    memory_bytes: u64,
    budget: Option<MemoryBudget>,
    bands: Option<(PathBuf, String)>,
    paintings: Option<PaintingFolder>,
    pub(super) kept: Arc<KeptResults>,
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
        Self { budget: Some(MemoryBudget::new(bytes)), ..self.clone() }
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
        let Some(keeping) = self.band_keeping() else { return Ok(false) };
        let folder = keeping.folder(&inputs)?;
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

    /// Returns how bands are kept: a part of the camera that was made in a program has no name by which to know it again.
    fn band_keeping(&self) -> Option<BandKeeping<'_>> {
        let (path, build) = self.bands.as_ref().filter(|_| self.given.check_none().is_ok())?;
        Some(BandKeeping { path, build, quality: self.quality, camera: &self.camera })
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
        self.kept.counts()
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
        let scene = match irradiance.summary.factor {
            1.0 => scene,
            factor => Arc::new(scene.brightened(factor)),
        };
        let rates = chain.electrons(electron_inputs)?;
        let sensor = electrons::read_out(electron_inputs, &place, &lens);
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
        let inputs = self.picture_inputs()?.frames.electrons.irradiance;
        let lens = self.kept.lens.get_or_make(inputs.plan.bank.film.lens, lens::resolve)?;
        check_glasses(&lens, self.camera.wavelengths.grid()?.as_ref())?;
        let file = match &self.camera.scene.source {
            SceneSource::File(path) => Some(path),
            SceneSource::World(world) => Some(&world.file).filter(|_| world.is_file()),
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

    /// Returns the lens as it is used, read now where it is not kept.
    ///
    /// # Errors
    /// When the camera or its lens cannot be read or built.
    pub fn lens(&self, progress: &dyn Progress, cancel: &Cancel) -> Result<Arc<ResolvedLens>, PipelineError> {
        let inputs = self.irradiance_inputs()?;
        self.chain(progress, cancel).lens(&inputs.plan.bank.film.lens)
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

    /// Paints what previews of the built-in still life are taken from in other fields of view, where that is not kept: in memory, and in the folder of
    /// [`with_paintings`](Self::with_paintings). A second or less for each of 2 (next) or up to 25 paintings (all), which is better spent while a picture is
    /// looked at than after the change. Nothing is done for other scenes and qualities, nor where it is known how much the film sees: one painting serves
    /// all fields of view there.
    ///
    /// # Errors
    /// As [`scene`](Self::scene).
    pub fn paint_ahead(
        &self,
        reach: PaintReach,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<(), PipelineError> {
        let inputs = self.irradiance_inputs()?;
        self.chain(progress, cancel).paint_ahead(&inputs.scene, reach)
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

    /// Returns what is white on the film: what the irradiance there is developed by.
    ///
    /// # Errors
    /// As [`capture`](Self::capture).
    pub fn white_of(&self, progress: &dyn Progress, cancel: &Cancel) -> Result<WhiteOf, PipelineError> {
        let inputs = self.irradiance_inputs()?;
        let chain = self.chain(progress, cancel);
        let (lens, scene) = (chain.lens(&inputs.plan.bank.film.lens)?, chain.summary(&inputs.scene)?);
        let light = scene.light.as_ref().map(|light| light.illuminant.clone());
        Ok(WhiteOf { light, lens: lens.transmittance().cloned() })
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

    /// Returns the width and the height of the whole film, mm; of a film that has the scene's size, the scene is opened for it, of a flat
    /// one in a file its header alone where that tells the size.
    ///
    /// # Errors
    /// As [`capture`](Self::capture) has them before it traces the lens.
    pub fn film_size_mm(&self, progress: &dyn Progress, cancel: &Cancel) -> Result<[f64; 2], PipelineError> {
        let inputs = self.irradiance_inputs()?;
        let (chain, place) = (self.chain(progress, cancel), &inputs.plan.bank.film);
        let film = match place.raster {
            Raster::Pixels(film) => film,
            Raster::Scene | Raster::Field(_) => {
                let whole = FilmInputs { crop: None, ..place.clone() };
                let lens = chain.lens(&whole.lens)?;
                let mut choice = inputs.scene.choice();
                if choice.flat.is_some() {
                    choice = choice.seen_from(lens.reference.projection_center_z_mm())?;
                }
                let outline = if self.given.scene.is_none() { Outline::of_flat(&choice)? } else { None };
                match outline {
                    Some(outline) => film::place(&whole, &lens, &outline, 1)?.film(),
                    None => chain.film(&whole, &inputs.scene)?.film(),
                }
            }
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

    pub(super) fn chain<'a>(&'a self, progress: &'a dyn Progress, cancel: &'a Cancel) -> Chain<'a> {
        Chain {
            kept: &self.kept,
            memory_bytes: self.memory_bytes,
            budget: self.budget.map(|budget| self.with_frames(budget)),
            bands: self.band_keeping(),
            paintings: self.paintings.as_ref(),
            watch: Watch { progress, cancel },
        }
    }

    /// Returns a budget with what the frames of the camera take. Errors of the camera are those of its stages, which meet them as well.
    fn with_frames(&self, budget: MemoryBudget) -> MemoryBudget {
        let Ok(PictureInputs { frames, .. }) = self.picture_inputs() else { return budget };
        let sensor = &frames.electrons.sensor;
        let photodiodes = self.camera.dual_pixel.map_or(1, |spec| spec.photodiodes.names().len());
        let reads = if sensor.split_pixel.is_some() { 2 } else { 1 };
        budget.with_frames(reads * frames.shutter.frames.count(), photodiodes * sensor.n_planes())
    }

    pub(super) fn irradiance_inputs(&self) -> Result<IrradianceInputs, PipelineError> {
        Ok(self.picture_inputs()?.frames.electrons.irradiance)
    }

    pub(super) fn picture_inputs(&self) -> Result<PictureInputs, PipelineError> {
        let mut inputs = PictureInputs::of(&self.camera, &self.given, self.quality)?;
        let irradiance = &mut inputs.frames.electrons.irradiance;
        irradiance.set_frame(self.frame_of_film(irradiance));
        Ok(inputs)
    }

    /// Returns the frame in which a preview of the still life has all that the film sees of it; `None` where that does not matter, or is not known. Errors
    /// of the lens are those of its stage, which meets them as well.
    fn frame_of_film(&self, inputs: &IrradianceInputs) -> Option<i32> {
        let (lens, focus, pixels) = inputs.onlooker()?;
        let lens = self.kept.lens.get_or_make(lens.clone(), lens::resolve).ok()?;
        let (film, _) = binned(pixels, self.quality);
        let reaches = film_distances_mm(focus, &lens.reference).ok()?.map(|film_distance_mm| FilmReach {
            lens: &lens.reference,
            film_distance_mm,
            film: &film,
        });
        let half_size = reaches[0].half_size_tan();
        frame_that(self.quality, half_size, |half_size, pitch| {
            reaches.iter().all(|reach| reach.is_within(half_size, pitch))
        })
    }

    pub(super) fn results(&self) -> &KeptResults {
        &self.kept
    }
}
