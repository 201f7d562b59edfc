//! What is kept of each stage.

use dioptric_forward::ImagingPlan;
use dioptric_psf::LensImageModel;
use dioptric_scene::Scene;
use dioptric_sensor::Developed;
use dioptric_spectrum::DepthMap;
use dioptric_world::World;

use super::{
    electrons::PixelRates,
    film::FilmPlace,
    frames::FrameSet,
    irradiance::Irradiance,
    lens::ResolvedLens,
    lens_tables::LensAberrations,
    memory::scene_bytes,
    painting::PaintingInputs,
    scene::{ResolvedScene, SceneSummary},
    slot::Slot,
    spec::{
        AberrationInputs, BankInputs, ElectronInputs, FilmInputs, FrameInputs, GeometryInputs, IrradianceInputs,
        LensInputs, PictureInputs, PlanInputs, SceneInputs, WorldInputs,
    },
};

/// The results of all stages.
#[derive(Debug)]
pub(super) struct KeptResults {
    pub(super) lens: Slot<LensInputs, ResolvedLens>,
    pub(super) world: Slot<WorldInputs, World>,
    pub(super) painting: Slot<PaintingInputs, Scene>,
    pub(super) scene: Slot<SceneInputs, ResolvedScene>,
    pub(super) summary: Slot<SceneInputs, SceneSummary>,
    pub(super) depth: Slot<GeometryInputs, DepthMap>,
    pub(super) film: Slot<FilmInputs, FilmPlace>,
    pub(super) bank: Slot<BankInputs, LensImageModel>,
    pub(super) plan: Slot<PlanInputs, ImagingPlan>,
    pub(super) irradiance: Slot<IrradianceInputs, Irradiance>,
    pub(super) electrons: Slot<ElectronInputs, PixelRates>,
    pub(super) frames: Slot<FrameInputs, FrameSet>,
    pub(super) aberrations: Slot<AberrationInputs, LensAberrations>,
    pub(super) picture: Slot<PictureInputs, Developed>,
}

impl Default for KeptResults {
    /// Keeps one or two results of what is large and a few of what is small.
    fn default() -> Self {
        Self {
            lens: Slot::new(8),
            world: Slot::new(2),
            painting: Slot::new(10),
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

impl KeptResults {
    /// Returns the bytes of memory that scenes and plans take.
    pub(super) fn imaging_bytes(&self) -> u64 {
        let scenes: u64 = self.scene.all().iter().map(|resolved| scene_bytes(&resolved.scene)).sum();
        scenes + self.plan.all().iter().map(|plan| plan.size_bytes() as u64).sum::<u64>()
    }

    /// Lets go of scenes and of plans for them, the largest of what imaging needs and nothing after it does.
    pub(super) fn let_go_of_scenes(&self) {
        self.plan.clear();
        self.scene.clear();
        self.painting.clear();
        self.world.clear();
    }

    /// How often each stage was run.
    pub(super) fn counts(&self) -> StageCounts {
        StageCounts {
            lens: self.lens.n_made(),
            painting: self.painting.n_made(),
            scene: self.scene.n_made(),
            film: self.film.n_made(),
            bank: self.bank.n_made(),
            plan: self.plan.n_made(),
            irradiance: self.irradiance.n_made(),
            electrons: self.electrons.n_made(),
            frames: self.frames.n_made(),
            picture: self.picture.n_made(),
        }
    }
}
