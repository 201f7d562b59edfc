//! The stages of a kept camera in their order.

use std::sync::Arc;

use dioptric_forward::{ImagingPlan, check_depth_map};
use dioptric_psf::{LensImage, LensImageModel};
use dioptric_scene::Scene;
use dioptric_sensor::{Developed, Illumination, Processing};
use dioptric_spectrum::Bands;

use super::{
    Watch,
    band_store::BandKeeping,
    bank,
    electrons::{self, PixelRates},
    film::{self, FilmPlace, Outline},
    frames::{self, FrameSet, MovedLight},
    ghosts::Ghosts,
    irradiance::{self, Irradiance, Keeping},
    lens::{self, ResolvedLens, check_glasses},
    lens_tables::{LensAberrations, TableParts},
    memory::MemoryBudget,
    narrow_surfaces::NarrowSurfaces,
    painting::Paintings,
    part::Part,
    plan,
    results::KeptResults,
    scene::{self, ResolvedScene, SceneSummary},
    spec::{
        AberrationInputs, BankInputs, ElectronInputs, FilmInputs, FrameInputs, IrradianceInputs, LensInputs,
        PictureInputs, PlanInputs, SceneInputs,
    },
    unseen_points::UnseenPoints,
    world,
};
use crate::{BlurSpec, DualPixelSpec, PaintingFolder, PipelineError, Progress, Stage};

/// The stages in their order, each asking for the ones it needs.
#[derive(Clone, Copy)]
pub(super) struct Chain<'a> {
    pub(super) kept: &'a KeptResults,
    /// Irradiance of more bytes goes to a temporary file.
    pub(super) memory_bytes: u64,
    /// What imaging may take in all, where that is limited.
    pub(super) budget: Option<MemoryBudget>,
    pub(super) bands: Option<BandKeeping<'a>>,
    pub(super) paintings: Option<&'a PaintingFolder>,
    pub(super) watch: Watch<'a>,
}

impl Chain<'_> {
    pub(super) fn lens(&self, inputs: &LensInputs) -> Result<Arc<ResolvedLens>, PipelineError> {
        self.kept.lens.get_or_make(inputs.clone(), lens::resolve)
    }

    pub(super) fn scene(&self, inputs: &SceneInputs) -> Result<Arc<ResolvedScene>, PipelineError> {
        self.kept.scene.get_or_make(inputs.clone(), |inputs| {
            self.watch.progress.at(Stage::Scene, 0.0);
            self.watch.cancel.check()?;
            let paintings = self.paintings();
            let mut scene = match inputs.geometry.world() {
                Some((_, spec)) => {
                    let has_room = |size, n_bands, n_layers| {
                        self.budget.map_or(Ok(()), |budget| budget.check_rendering(size, n_bands, n_layers))
                    };
                    world::view(inputs, spec, &self.world(&inputs.geometry)?, (&has_room, self.paintings), &self.watch)?
                }
                None => {
                    let lens = inputs.geometry.flat.as_ref().map(|(_, lens)| self.lens(lens)).transpose()?;
                    let pupil_z_mm = lens.map(|lens| lens.reference.projection_center_z_mm());
                    let finest = match &inputs.geometry.seen_by {
                        Some((lens, pitch_um)) => scene::finest_tangent(&*self.lens(lens)?, *pitch_um),
                        None => None,
                    };
                    scene::open(inputs, pupil_z_mm, finest, paintings, &self.watch)?
                }
            };
            if let Some(path) = &inputs.geometry.points {
                scene::put_points(&mut scene.scene, path)?;
            }
            self.watch.progress.at(Stage::Scene, 1.0);
            Ok(scene)
        })
    }

    pub(super) fn paintings(&self) -> Paintings<'_> {
        Paintings { kept: &self.kept.painting, folder: self.paintings }
    }

    pub(super) fn summary(&self, inputs: &SceneInputs) -> Result<Arc<SceneSummary>, PipelineError> {
        self.kept.summary.get_or_make(inputs.clone(), |inputs| SceneSummary::of(&*self.scene(inputs)?))
    }

    pub(super) fn film(&self, inputs: &FilmInputs, scene: &SceneInputs) -> Result<Arc<FilmPlace>, PipelineError> {
        self.kept.film.get_or_make(inputs.clone(), |inputs| {
            let resolved = self.scene(scene)?;
            film::place(inputs, &*self.lens(&inputs.lens)?, &Outline::of(&resolved.scene)?, resolved.binning)
        })
    }

    pub(super) fn bank(&self, inputs: &BankInputs, scene: &SceneInputs) -> Result<Arc<LensImageModel>, PipelineError> {
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
            bank::build(inputs, &lens, &place, &grid)
        })
    }

    pub(super) fn plan(&self, inputs: &PlanInputs, scene: &SceneInputs) -> Result<Arc<ImagingPlan>, PipelineError> {
        self.kept.plan.get_or_make(inputs.clone(), |inputs| {
            let (place, resolved) = (self.film(&inputs.bank.film, scene)?, self.scene(scene)?);
            let budget = self.budget;
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

    pub(super) fn irradiance(&self, inputs: &IrradianceInputs) -> Result<Arc<Irradiance>, PipelineError> {
        self.kept
            .irradiance
            .get_or_make(inputs.clone(), |inputs| self.irradiance_as_lit(inputs)?.with_mean_lux(inputs.mean_lux))
    }

    /// Returns the irradiance under the light that the scene has.
    fn irradiance_as_lit(&self, inputs: &IrradianceInputs) -> Result<Irradiance, PipelineError> {
        if let Some(spec) = inputs.dual_pixel {
            let irradiance = self.irradiance_of_photodiodes(inputs, spec)?;
            self.make_room_for_film(inputs, &irradiance)?;
            return Ok(irradiance);
        }
        if let Some(effort) = inputs.effort {
            let place = self.film(&inputs.plan.bank.film, &inputs.scene)?;
            let n_bands = self.summary(&inputs.scene)?.wavelengths_nm.len();
            self.budget.map_or(Ok(()), |budget| budget.check_rendering_on(&place, n_bands))?;
            let picture = self.world_render(inputs)?.render(effort, &self.watch)?;
            return Ok(Irradiance::of_image(picture, place.pitch_um));
        }
        if inputs.micro_array.is_some() {
            let reason = "only rays from the film go through its array, expected a world with method: Backward";
            return Err(PipelineError::Unsuitable { what: "light_field", reason: reason.to_owned() });
        }
        let irradiance = self.imaged(inputs)?;
        self.make_room_for_film(inputs, &irradiance)?;
        Ok(irradiance)
    }

    /// Lets go of plans, then of scenes but for the depth, where the budget does not hold them beside what becomes of the irradiance.
    fn make_room_for_film(&self, inputs: &IrradianceInputs, irradiance: &Irradiance) -> Result<(), PipelineError> {
        let place = self.film(&inputs.plan.bank.film, &inputs.scene)?;
        if self.drops_plans(&place, irradiance) {
            let resolved = self.scene(&inputs.scene)?;
            self.kept.depth.put(inputs.scene.geometry.clone(), resolved.scene.require_depth()?.clone());
            self.kept.let_go_of_scenes();
        }
        Ok(())
    }

    /// Lets go of plans where the budget does not hold them beside what becomes of an irradiance; returns whether more has to go.
    fn drops_plans(&self, place: &FilmPlace, irradiance: &Irradiance) -> bool {
        let Some(budget) = self.budget else { return false };
        let has_room =
            || budget.holds(self.kept.imaging_bytes() + irradiance.memory_bytes(), place, irradiance.grid().len());
        if !has_room() {
            self.kept.plan.clear();
        }
        !has_room()
    }

    /// Images the scene through the pupil, or the part of it that a photodiode sees.
    pub(super) fn imaged(&self, inputs: &IrradianceInputs) -> Result<Irradiance, PipelineError> {
        let film_reflectance = inputs.reflections.film_reflectance();
        if let Some(reflectance) = film_reflectance {
            // A lens whose ghosts are not followed is told before the work.
            let film = &inputs.plan.bank.film;
            let mirror = self.film(film, &inputs.scene)?.mirror(reflectance);
            self.lens(&film.lens)?.reference.ghost_beams(&mirror)?;
        }
        let plan = self.plan(&inputs.plan, &inputs.scene)?;
        let resolved = self.scene(&inputs.scene)?;
        let place = self.film(&inputs.plan.bank.film, &inputs.scene)?;
        let scene: &Scene = &resolved.scene;
        let memory_bytes = match self.budget {
            // The sum of photodiodes' light is as large as each of them.
            Some(budget) => {
                let n_irradiances =
                    inputs.plan.photodiode.map_or(1, |(spec, _)| 1 + spec.photodiodes.names().len() as u64);
                (budget.irradiance_bytes(&plan, scene, &place)? / n_irradiances).min(self.memory_bytes)
            }
            None => self.memory_bytes,
        };
        let folder = self.bands.map(|keeping| keeping.folder(inputs)).transpose()?;
        let folder = match inputs.plan.photodiode {
            None => folder,
            Some((_, number)) => folder.map(|folder| folder.of_photodiode(number)),
        };
        let keeping = Keeping { memory_bytes, folder: folder.as_ref() };
        let ghosts = match film_reflectance {
            None => None,
            Some(reflectance) => {
                let quality = inputs.plan.bank.film.geometry.quality;
                let n_photodiodes = inputs.plan.photodiode.map_or(1, |(spec, _)| spec.photodiodes.names().len());
                let behind = (self.lens(&inputs.plan.bank.film.lens)?, place.clone(), reflectance);
                Some(Ghosts::of(&plan, scene, behind, (quality, n_photodiodes))?)
            }
        };
        let irradiance = irradiance::image((&plan, ghosts.as_ref()), scene, &place, keeping, &self.watch)?;
        let is_layered = inputs.plan.blur == BlurSpec::Layered;
        let narrow = if is_layered { NarrowSurfaces::of(&plan, scene) } else { None };
        let points = UnseenPoints::of(&plan, scene);
        Ok(irradiance.with_narrow_surfaces(narrow).with_unseen_points(points))
    }

    /// Returns the chain with its progress reported elsewhere.
    fn reporting<'b>(&'b self, progress: &'b dyn Progress) -> Chain<'b> {
        Chain { watch: Watch { progress, cancel: self.watch.cancel }, ..*self }
    }

    /// Images the scene through the part of the pupil that each photodiode sees, one after the other.
    pub(super) fn irradiance_of_photodiodes(
        &self,
        inputs: &IrradianceInputs,
        spec: DualPixelSpec,
    ) -> Result<Irradiance, PipelineError> {
        let n = spec.photodiodes.names().len();
        // The sum is as large as each of them.
        let memory_bytes = self.memory_bytes / (n as u64 + 1);
        let plan_of = |number: usize| PlanInputs { photodiode: Some((spec, number)), ..inputs.plan.clone() };
        let part = |number: usize| Part { progress: self.watch.progress, number, of: n };
        let (place, resolved) = (self.film(&inputs.plan.bank.film, &inputs.scene)?, self.scene(&inputs.scene)?);
        // What is too large for the budget is found before any of them is imaged. Their plans are of much the same size.
        for number in 0..n {
            let Some(budget) = self.budget else { break };
            let plan = self.reporting(&part(number)).plan(&plan_of(number), &inputs.scene)?;
            if budget.would_fit_twice(&plan, &resolved.scene, &place) {
                break;
            }
            self.kept.plan.clear();
        }
        drop(resolved);
        let irradiance = |number: usize| {
            let inputs = IrradianceInputs { plan: plan_of(number), dual_pixel: None, ..inputs.clone() };
            let irradiance = Chain { memory_bytes, ..self.reporting(&part(number)) }.imaged(&inputs)?;
            // The next photodiode has a plan of its own.
            if self.budget.is_some_and(|budget| !budget.is_ample_for(self.kept.imaging_bytes())) {
                self.kept.plan.clear();
            }
            Ok(irradiance.without_seen())
        };
        let photodiodes = (0..n).map(irradiance).collect::<Result<Vec<_>, PipelineError>>()?;
        let first = &photodiodes[0].summary;
        let (narrow, points, ghosts) = (first.narrow_surfaces, first.unseen_points, first.ghost_share);
        let memory_bytes = match self.budget {
            Some(budget) => budget.left_beside_film(&place, photodiodes[0].grid().len(), self.kept.imaging_bytes()),
            None => u64::MAX,
        };
        let memory_bytes = memory_bytes.min(self.memory_bytes);
        let irradiance = Irradiance::of_photodiodes(photodiodes, memory_bytes)?;
        Ok(irradiance.with_narrow_surfaces(narrow).with_unseen_points(points).with_ghost_share(ghosts))
    }

    pub(super) fn electrons(&self, inputs: &ElectronInputs) -> Result<Arc<PixelRates>, PipelineError> {
        self.kept.electrons.get_or_make(inputs.clone(), |inputs| {
            let irradiance = self.irradiance(&inputs.irradiance)?;
            let place = self.film(&inputs.irradiance.plan.bank.film, &inputs.irradiance.scene)?;
            let sensor = electrons::exposed(inputs, &place);
            let exit_pupil =
                electrons::exit_pupil(&sensor, &place, &*self.lens(&inputs.irradiance.plan.bank.film.lens)?);
            electrons::collect(irradiance, sensor, exit_pupil, &self.watch)
        })
    }

    pub(super) fn frames(&self, inputs: &FrameInputs) -> Result<Arc<FrameSet>, PipelineError> {
        self.kept.frames.get_or_make(inputs.clone(), |inputs| {
            let irradiance = &inputs.electrons.irradiance;
            let film = &irradiance.plan.bank.film;
            let (lens, place) = (self.lens(&film.lens)?, self.film(film, &irradiance.scene)?);
            let rates = self.electrons(&inputs.electrons)?;
            let dual_pixel = irradiance.dual_pixel;
            self.watch.progress.at(Stage::Sensor, 0.5);
            let (shutter, sensor) = (inputs.shutter.clone(), electrons::exposed(&inputs.electrons, &place));
            // What moves between frames is the irradiance.
            let irradiance = if shutter.moves() { Some(self.irradiance(irradiance)?) } else { None };
            let exit_pupil = electrons::exit_pupil(&sensor, &place, &lens);
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
    pub(super) fn aberrations(&self, inputs: &PictureInputs) -> Result<Option<Arc<LensAberrations>>, PipelineError> {
        if inputs.processing.lens_corrections.is_none() {
            return Ok(None);
        }
        let ElectronInputs { irradiance, sensor, .. } = &inputs.frames.electrons;
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

    pub(super) fn picture(
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
            let lens = self.lens(&irradiance.plan.bank.film.lens)?;
            let sensor = electrons::read_out(&inputs.frames.electrons, &place, &lens);
            let processing = processing.clone();
            self.watch.run(move || {
                let tables = aberrations.as_ref().map(|aberrations| &aberrations.tables);
                Ok(sensor.develop_with(frames.exposed.developed_from(), &processing, tables)?)
            })
        })
    }
}
