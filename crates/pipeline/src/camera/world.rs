//! A three-dimensional world before the camera, as a camera file says it.

use std::path::PathBuf;

use dioptric_backward::{BandSampling, LightPaths};
use dioptric_spectrum::WavelengthGrid;
use dioptric_world::ReadOptions;
use serde::{Deserialize, Serialize};

use super::{check::Checker, world_change::WorldChange, world_sky::WorldSky};
use crate::PipelineError;

/// A three-dimensional world before the camera, and how it is rendered.
///
/// The center of the lens's entrance pupil stands where the world's file has its camera, and looks where that does; without
/// one it sees the whole.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct WorldSpec {
    /// The file: `.pbrt`, `.gltf`, `.glb`, `.obj`, `.ply` or `.stl`; `still-life`, the built-in scene of the demo;
    /// or `empty`, a world of nothing, to which `changes` add.
    pub file: PathBuf,
    /// How long the file's unit of length is, m.
    #[serde(default = "one_meter")]
    pub unit_m: f64,
    /// How far the animations of a glTF file have come, s; without it everything stands as it is written.
    #[serde(default)]
    pub time_s: Option<f64>,
    /// Which animation moves it, by its name or its number from 1, from its beginning on if no time is given; if left out the
    /// first, and others that move what none before them does.
    #[serde(default)]
    pub animation: Option<String>,
    /// Which of the variants of its materials a glTF file shows, by name; the file's own materials if left out.
    #[serde(default)]
    pub variant: Option<String>,
    /// What is changed in it, one after the other.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub changes: Vec<WorldChange>,
    /// From where it is seen.
    #[serde(default)]
    pub view: WorldView,
    /// Light from beyond it, besides its own; of a world without any light an even sky if left out.
    #[serde(default)]
    pub sky: Option<WorldSky>,
    /// Lamps that are added to it.
    #[serde(default)]
    pub lamps: Vec<WorldLamp>,
    /// How its light comes to the film.
    #[serde(default)]
    pub method: RenderMethod,
    /// When it is rendered well enough.
    #[serde(default)]
    pub effort: RenderEffort,
    /// Columns and rows of the view from the middle of the entrance pupil, which `film: Scene` has too; those of the file's
    /// camera if left out.
    #[serde(default)]
    pub size: Option<(usize, usize)>,
    /// How far the camera stands before the place of the file's, along its axis, mm.
    #[serde(default)]
    pub advance_mm: f64,
    /// How far the camera stands to the right of the place of the file's and above it, as the picture shows it, mm.
    #[serde(default)]
    pub aside_mm: (f64, f64),
    /// How many surfaces, one behind another, the view knows, 1 or 2; counts for `method: Forward` and `dioptric compare` alone. Of 2 it is rendered once more without what stands in front, and blurred
    /// edges show what lies behind them instead of a guess. The back of a closed shape is none of them.
    #[serde(default = "one_layer")]
    pub layers: u32,
    /// Whether a band is the mean over its width, or the value at its center.
    #[serde(default)]
    pub bands: BandSampling,
    /// How often light may be scattered on its way.
    #[serde(default)]
    pub paths: LightPaths,
    /// The seed of the rendering's samples; that of the sensor's noise is the camera's.
    #[serde(default = "one")]
    pub seed: u64,
}

/// From where a world is seen.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum WorldView {
    /// From where the file has its first camera; without one, the whole.
    #[default]
    OfFile,
    /// From where the file has the camera of this name, or of this number from 1.
    Camera(String),
    /// The whole of it, a quarter round from its front and from above.
    Whole,
    /// From a place.
    From {
        /// Where the center of the entrance pupil stands, m.
        eye_m: (f64, f64, f64),
        /// What is in the middle of the picture, m; the middle of the world if left out.
        #[serde(default)]
        look_at_m: Option<(f64, f64, f64)>,
        /// What is up in the picture; if left out, what is up in the world.
        #[serde(default)]
        up: Option<(f64, f64, f64)>,
    },
}

/// A lamp that shines alike in all directions, of the color of daylight D65.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct WorldLamp {
    /// Where it is, m.
    pub at_m: (f64, f64, f64),
    /// Its luminous flux, lm.
    pub lumens: f64,
}

/// How the light of a world comes to the film.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum RenderMethod {
    /// Rays from the film through the lens into the world: the final picture.
    #[default]
    Backward,
    /// The view from the middle of the entrance pupil, blurred by the lens's point spread functions: the rapid one.
    Forward,
}

/// When a rendering is good enough.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum RenderEffort {
    /// After so many samples a pixel, rounded up to whole passes.
    Samples(u32),
    /// When the relative standard error of a pixel over all bands is this.
    Noise(f64),
}

impl Default for RenderEffort {
    fn default() -> Self {
        Self::Samples(64)
    }
}

fn one_meter() -> f64 {
    1.0
}

fn one_layer() -> u32 {
    1
}

fn one() -> u64 {
    1
}

impl WorldSpec {
    /// A world's file, with the defaults for all else.
    pub fn of_file(file: PathBuf) -> Self {
        Self {
            file,
            unit_m: one_meter(),
            time_s: None,
            animation: None,
            variant: None,
            changes: Vec::new(),
            view: WorldView::default(),
            sky: None,
            lamps: Vec::new(),
            method: RenderMethod::default(),
            effort: RenderEffort::default(),
            size: None,
            advance_mm: 0.0,
            aside_mm: (0.0, 0.0),
            layers: one_layer(),
            bands: BandSampling::default(),
            paths: LightPaths::default(),
            seed: one(),
        }
    }

    /// The name of the built-in still life, in place of a file.
    pub const STILL_LIFE: &str = "still-life";

    /// The wavelengths at which the colors of the still life are known; beyond, they are those at the ends.
    const STILL_LIFE_NM: (f64, f64) = (300.0, 1100.0);

    /// The built-in still life in a view of so many columns and rows, with the defaults for all else.
    pub fn still_life(size: (usize, usize)) -> Self {
        Self { size: Some(size), ..Self::of_file(PathBuf::from(Self::STILL_LIFE)) }
    }

    /// Returns how its file is read.
    pub fn reading(&self) -> ReadOptions {
        ReadOptions {
            metres_per_unit: self.unit_m,
            time_s: self.time_s,
            animation: self.animation.clone(),
            variant: self.variant.clone(),
        }
    }

    /// The name of a world of nothing, in place of a file; its frame is that of glTF.
    pub const EMPTY: &str = "empty";

    /// Whether it is read from a file, and not built in.
    pub fn is_file(&self) -> bool {
        !self.is_still_life() && self.file.as_os_str() != Self::EMPTY
    }

    /// Returns all files that it names.
    pub(crate) fn files(&self) -> impl Iterator<Item = PathBuf> {
        let own = self.is_file().then(|| self.file.clone());
        own.into_iter().chain(self.changes.iter().flat_map(WorldChange::files))
    }

    /// Whether it is the built-in still life and no file.
    pub fn is_still_life(&self) -> bool {
        self.file.as_os_str() == Self::STILL_LIFE
    }

    /// Returns the effort of rays from the film, or `None` where the view is blurred instead.
    pub(crate) fn backward(&self) -> Option<RenderEffort> {
        (self.method == RenderMethod::Backward).then_some(self.effort)
    }

    /// Checks that the colors of the still life are known to rays from the film on all bands.
    pub(crate) fn check_bands(&self, grid: &WavelengthGrid, checker: &Checker<'_>) -> Result<(), PipelineError> {
        if self.backward().is_none() {
            return Ok(());
        }
        let share = if self.bands == BandSampling::Mean { 0.5 } else { 0.0 };
        let ((first_nm, last_nm), widths_nm) = (grid.range_nm(), grid.widths_nm());
        let reached_nm = (first_nm - share * widths_nm[0], last_nm + share * widths_nm[widths_nm.len() - 1]);
        let known_nm = Self::STILL_LIFE_NM;
        if known_nm.0 <= reached_nm.0 && reached_nm.1 <= known_nm.1 {
            return Ok(());
        }
        let found = format!("bands that reach from {} to {} nm", reached_nm.0, reached_nm.1);
        let expected = format!(
            "ones within {} to {} nm, where rays from the film know the colors of the still life",
            known_nm.0, known_nm.1
        );
        checker.wrong("wavelengths", &found, &expected)
    }

    pub(super) fn check(&self, checker: &Checker<'_>) -> Result<(), PipelineError> {
        checker.number("unit_m", self.unit_m)?;
        self.time_s.map_or(Ok(()), |time_s| checker.number("time_s", time_s))?;
        let point = |key: &'static str, (x, y, z): (f64, f64, f64)| {
            [x, y, z].into_iter().try_for_each(|value| checker.number(key, value))
        };
        if let WorldView::From { eye_m, look_at_m, up } = &self.view {
            point("eye_m", *eye_m)?;
            look_at_m.map_or(Ok(()), |at_m| point("look_at_m", at_m))?;
            up.map_or(Ok(()), |up| point("up", up))?;
        }
        match &self.sky {
            Some(WorldSky::Even(radiance)) => checker.number("Even", *radiance)?,
            Some(WorldSky::Day { elevation_deg, azimuth_deg, turbidity }) => {
                checker.number("elevation_deg", *elevation_deg)?;
                checker.number("azimuth_deg", *azimuth_deg)?;
                checker.number("turbidity", *turbidity)?;
            }
            Some(WorldSky::Picture(_)) | None => {}
        }
        for lamp in &self.lamps {
            checker.number("lumens", lamp.lumens)?;
            point("at_m", lamp.at_m)?;
        }
        checker.number("advance_mm", self.advance_mm)?;
        checker.number("aside_mm", self.aside_mm.0)?;
        checker.number("aside_mm", self.aside_mm.1)?;
        if let Some((columns, rows)) = self.size {
            checker.count("size", columns, 1..=65_536)?;
            checker.count("size", rows, 1..=65_536)?;
        }
        checker.count("layers", self.layers as usize, 1..=2)?;
        if self.is_still_life() {
            if self.unit_m != one_meter() {
                checker.wrong("unit_m", &self.unit_m.to_string(), "1, the unit of the still life")?;
            }
            if self.time_s.is_some() || self.animation.is_some() || self.variant.is_some() {
                let expected = "none: nothing in the still life moves or has variants";
                checker.wrong("time_s, animation or variant", "given", expected)?;
            }
            let has_more = self.sky.is_some() || !self.lamps.is_empty() || !self.changes.is_empty();
            if self.view != WorldView::OfFile || has_more {
                let expected = "none: the still life has a view and light of its own";
                checker.wrong("view, sky, lamps or changes", "given", expected)?;
            }
        }
        match self.effort {
            RenderEffort::Samples(n) => checker.count("Samples", n as usize, 1..=1 << 24),
            RenderEffort::Noise(noise) => checker.number("Noise", noise),
        }
    }
}
