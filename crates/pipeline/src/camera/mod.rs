//! The camera file: everything about a shot, in one RON file.

mod bank;
mod blur;
mod border;
mod check;
mod crop;
mod dual_pixel;
mod filters;
mod frames;
mod lens;
mod light_field;
mod measured_eye;
mod movements;
mod photodiodes;
mod reflections;
mod scene;
mod sensor_options;
mod syntax;
mod video;
mod world;
mod world_change;
mod world_sky;

use std::path::{Path, PathBuf};

use dioptric_optics::{Iris, SurfaceChange};
use dioptric_psf::{Diffraction, PsfError};
use dioptric_sensor::{AutoExposure, ExposureControl, Metering, NoiseSources, Processing};
use dioptric_spectrum::WavelengthGrid;
use ron::extensions::Extensions;
use serde::{Deserialize, Serialize};

pub use bank::RetiredBank;
pub use blur::BlurSpec;
pub use border::BorderSpec;
pub use crop::Crop;
pub use dual_pixel::DualPixelSpec;
pub use filters::FilterSpec;
pub(crate) use frames::at_rest;
pub use frames::{Exposed, FramesSpec, PhotodiodeReads};
pub use lens::{
    CoatingSpec, LensReadOptions, REFERENCE_WAVELENGTH_NM, nearest_to_reference_nm, reference_nm_of, with_blades,
};
pub use light_field::LightFieldSpec;
pub use measured_eye::DrawnEye;
pub use movements::Movements;
pub use photodiodes::Photodiodes;
pub use reflections::LensReflections;
pub(crate) use scene::bands_or_own;
pub use scene::{FlatSize, SceneSource, SceneSpec};
pub use sensor_options::SensorOptions;
pub use syntax::CAMERA_SCHEMA;
pub use video::{CameraTurn, TurnPath, VideoSpec};
pub use world::{RenderEffort, RenderMethod, WorldLamp, WorldSpec, WorldView};
pub use world_change::{LightAmount, WorldChange, WorldColor, WorldLight, WorldMaterial, WorldShape};
pub use world_sky::WorldSky;

use self::check::Checker;
use crate::{Outputs, PipelineError};

/// The camera of the built-in demo.
const DEMO: &str = include_str!("../../data/demo.ron");

/// A camera and what stands before it.
///
/// Everything that may be left out of a file has a default; paths are relative to the file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// What to call the shot.
    pub name: String,
    /// The lens.
    pub lens: LensSpec,
    /// What the lens's file leaves open.
    #[serde(default)]
    pub lens_reading: LensReadOptions,
    /// How far its stop is open.
    #[serde(default)]
    pub stop: StopSpec,
    /// The blades that close the stop; those of the lens's own file if left out, and a round stop where that has none.
    #[serde(default)]
    pub iris: Option<Iris>,
    /// How it is turned and moved before the film.
    #[serde(default)]
    pub movements: Movements,
    /// Where the film is.
    pub focus: FocusSpec,
    /// How large the film is.
    #[serde(default)]
    pub film: FilmSpec,
    /// The part of the film that is simulated; all of it if left out.
    #[serde(default)]
    pub crop: Option<Crop>,
    /// Diffraction at the stop.
    #[serde(default)]
    pub diffraction: Diffraction,
    /// A file of point spread functions (`.npz`) in place of those of the lens and of its diffraction; the lens still says where points lie on the
    /// film and how bright they are. The blur is that of the file at every focus and f-number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(extend("default" = null)))]
    pub psfs: Option<PathBuf>,
    /// Of older files.
    #[serde(default, skip_serializing)]
    #[cfg_attr(feature = "schema", schemars(skip))]
    pub bank: RetiredBank,
    /// What becomes of the light that surfaces of the lens reflect.
    #[serde(default)]
    pub lens_reflections: LensReflections,
    /// How the point-spread functions are laid over the scene.
    #[serde(default)]
    pub blur: BlurSpec,
    /// What lies beyond the edges of the scene.
    #[serde(default)]
    pub border: BorderSpec,
    /// What makes a light-field camera of it: an array of small lenses or holes before the film, or more cameras beside it.
    #[serde(default)]
    pub light_field: Option<LightFieldSpec>,
    /// Filters before the lens, which the picture is not corrected for; what belongs to the camera is in `filter_stack` of its sensor.
    #[serde(default)]
    pub filters: Vec<FilterSpec>,
    /// The sensor.
    pub sensor: SensorSpec,
    /// Photodiodes that share the light below each microlens and are read one by one; whole pixels if left out.
    #[serde(default)]
    pub dual_pixel: Option<DualPixelSpec>,
    /// The exposure.
    #[serde(default = "automatic")]
    pub exposure: ExposureControl,
    /// Which sources of noise are on.
    #[serde(default)]
    pub noise: NoiseSources,
    /// How many frames the picture is made of.
    #[serde(default)]
    pub frames: FramesSpec,
    /// What `dioptric video` takes in place of one picture.
    #[serde(default)]
    pub video: Option<VideoSpec>,
    /// From the raw frame to the picture.
    #[serde(default)]
    pub processing: Processing,
    /// What stands before the camera.
    pub scene: SceneSpec,
    /// The bands that are simulated.
    #[serde(default)]
    pub wavelengths: WavelengthSpec,
    /// The seed of all noise.
    #[serde(default = "one")]
    pub seed: u64,
    /// Which chip of its kind the sensor is: the seed of what stays with it, PRNU, DSNU, columns and defects.
    #[serde(default)]
    pub chip_seed: u64,
    /// What is written.
    #[serde(default)]
    pub outputs: Outputs,
}

/// Which lens.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum LensSpec {
    /// A built-in lens by name; also "thin:50mm:f2" and "pinhole:0.1mm".
    BuiltIn(String),
    /// A lens file.
    File(PathBuf),
    /// An ideal thin lens, free of aberrations.
    Thin {
        /// Focal length, mm.
        focal_length_mm: f64,
        /// Diameter of its rim, which is the stop, mm.
        diameter_mm: f64,
    },
    /// A hole without a lens; needs a focus of `FilmMm`.
    Pinhole {
        /// Diameter, mm.
        diameter_mm: f64,
    },
    /// An eye that is known by the coefficients of its wavefront; also "eye:IASstats30.mat:3mm".
    MeasuredEye {
        /// Coefficients of the terms of OSA, µm: `.csv`; with their statistics `.json`, or `.mat` as of ISETCam.
        file: PathBuf,
        /// Diameter of the pupil that they are of, mm.
        pupil_mm: f64,
        /// An eye drawn from the statistics; left out, the mean.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        drawn: Option<DrawnEye>,
    },
    /// Another lens with some of its curvatures and distances changed.
    Changed {
        /// That lens, itself not a changed one.
        lens: Box<Self>,
        /// What is changed of it.
        surfaces: Vec<SurfaceChange>,
    },
}

/// How far the stop is open.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum StopSpec {
    /// As the lens file says.
    #[default]
    AsGiven,
    /// At this f-number, for an object at infinity, at the main wavelength of the lens's file, else at 550 nm; up to 5 % below that of the lens it is fully open.
    FNumber(f64),
    /// At this diameter of the stop, mm.
    DiameterMm(f64),
}

/// Where the film is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum FocusSpec {
    /// In focus for an object at this distance from the first vertex, mm, by first-order optics at the main wavelength of the lens's file, else at 550 nm; `lens
    /// analyze` tells where the least spot is.
    DistanceMm(f64),
    /// At this distance from the last vertex, mm.
    FilmMm(f64),
    /// In focus for the near part of the scene: the depth that 2 % of its samples do not reach.
    NearObject,
}

/// How large the film is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum FilmSpec {
    /// The pixels of the sensor.
    #[default]
    Sensor,
    /// As many pixels as the scene has samples, of such a pitch that they see the scene's field. The sensor's
    /// pixels are taken to be of this size.
    Scene,
    /// The pixels of the sensor, as many of them as the scene's field covers.
    Field,
    /// Pixels of the user's choice. The sensor's pixels are taken to be of this size.
    Pixels {
        /// Columns.
        columns: usize,
        /// Rows.
        rows: usize,
        /// Distance between pixels, µm.
        pitch_um: f64,
    },
}

/// Which sensor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum SensorSpec {
    /// A built-in sensor by name.
    BuiltIn(String),
    /// A sensor file.
    File(PathBuf),
}

/// The bands that are simulated.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum WavelengthSpec {
    /// Those of the scene; 400–700 nm in steps of 10 nm where it has none of its own.
    #[default]
    Scene,
    /// Equal steps.
    Range {
        /// First band, nm.
        first_nm: f64,
        /// Last band, nm.
        last_nm: f64,
        /// Step, nm.
        step_nm: f64,
    },
    /// These bands, nm.
    ListNm(Vec<f64>),
}

impl WavelengthSpec {
    /// Returns the bands asked for, or `None` for those of the scene.
    ///
    /// # Errors
    /// When they do not ascend or the step does not lead from first to last.
    pub fn grid(&self) -> Result<Option<WavelengthGrid>, PipelineError> {
        Ok(match self {
            Self::Scene => None,
            Self::Range { first_nm, last_nm, step_nm } => Some(WavelengthGrid::uniform(*first_nm, *last_nm, *step_nm)?),
            Self::ListNm(list) => Some(WavelengthGrid::new(list.clone())?),
        })
    }

    /// Returns the bands before a world, which has none of its own.
    pub(crate) fn of_world(&self) -> Result<WavelengthGrid, PipelineError> {
        Ok(self.grid()?.map_or_else(|| WavelengthGrid::uniform(400.0, 700.0, 10.0), Ok)?)
    }
}

/// The most bands that a picture may have.
const MOST_BANDS: usize = 10_000;

fn one() -> u64 {
    1
}

/// Just not saturating: the pixel that 99 % of all pixels do not exceed is put at 90 % of saturation.
pub(crate) fn automatic() -> ExposureControl {
    ExposureControl::Auto(AutoExposure::new(Metering::Percentile(99.0), 0.9))
}

impl Camera {
    /// The camera of the built-in demo: nothing but this crate is needed to run it.
    ///
    /// # Errors
    /// Never; the file is held to by a test.
    pub fn demo() -> Result<Self, PipelineError> {
        Self::parse(DEMO, Path::new("demo.ron"))
    }

    /// Reads a camera file.
    ///
    /// # Errors
    /// Names the file, the line and the key that is wrong, and what was expected.
    pub fn read(path: &Path) -> Result<Self, PipelineError> {
        let text = dioptric_files::text::read(path).map_err(|e| {
            let reason = match e.kind() {
                std::io::ErrorKind::InvalidData => {
                    "it is no text, expected a camera file; pictures are scenes (--scene FILE)".to_owned()
                }
                _ => e.to_string(),
            };
            PipelineError::Read { path: path.to_owned(), reason }
        })?;
        Self::parse(&text, path)
    }

    /// Reads a camera from text; paths in it are relative to the folder of `path`, which also names it in errors.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn parse(text: &str, path: &Path) -> Result<Self, PipelineError> {
        let mut camera: Self = dioptric_files::ron::from_text(text)
            .map_err(|error| PipelineError::syntax(path, syntax::with_values(error)))?;
        camera.check(&Checker::of_file(path, text))?;
        camera.resolve_paths(path.parent().unwrap_or(Path::new("")));
        Ok(camera)
    }

    /// Checks every number; what was typed on a command line may be checked again.
    ///
    /// # Errors
    /// Names the first key that is wrong and what was expected.
    pub fn validate(&self) -> Result<(), PipelineError> {
        self.check(&Checker::of_settings(&self.name))
    }

    fn check(&self, checker: &Checker<'_>) -> Result<(), PipelineError> {
        self.check_lens(checker)?;
        self.check_film(checker)?;
        if let Err(PsfError::Setting { key, found, expected }) = self.diffraction.check() {
            checker.wrong(key, &found.to_string(), expected)?;
        }
        self.blur.check(self.diffraction, checker)?;
        if let LensReflections::Film(reflectance) = self.lens_reflections {
            checker.number("Film", reflectance)?;
        }
        self.check_psfs(checker)?;
        self.check_binning(checker)?;
        self.exposure.check().map_err(|error| checker.of_sensor(error))?;
        self.processing.check().map_err(|error| checker.of_sensor(error))?;
        match &self.wavelengths {
            WavelengthSpec::Scene => {}
            WavelengthSpec::Range { first_nm, last_nm, step_nm } => {
                checker.number("first_nm", *first_nm)?;
                checker.number("last_nm", *last_nm)?;
                checker.number("step_nm", *step_nm)?;
                if (last_nm - first_nm) / step_nm > MOST_BANDS as f64 {
                    let found = format!("{step_nm} from {first_nm} to {last_nm}");
                    checker.wrong("step_nm", &found, &format!("{MOST_BANDS} bands at most"))?;
                }
            }
            WavelengthSpec::ListNm(list) if list.is_empty() => checker.wrong("ListNm", "no wavelength", "1 or more")?,
            WavelengthSpec::ListNm(list) => list.iter().try_for_each(|&nm| checker.number("ListNm", nm))?,
        }
        self.frames.check()?;
        if let Some(spec) = &self.light_field {
            spec.check(checker)?;
        }
        if let Some(spec) = &self.dual_pixel {
            spec.check(self, checker)?;
        }
        if let Some(spec) = &self.video {
            spec.check(self, checker)?;
        }
        self.scene.check(checker)?;
        match &self.scene.source {
            SceneSource::World(spec) if spec.is_still_life() => {
                spec.check_bands(&self.wavelengths.of_world()?, checker)
            }
            _ => Ok(()),
        }
    }

    /// Checks the lens, its stop, focus and movements.
    fn check_lens(&self, checker: &Checker<'_>) -> Result<(), PipelineError> {
        if let LensSpec::Changed { lens, .. } = &self.lens
            && let LensSpec::Changed { .. } = **lens
        {
            checker.wrong("lens", "Changed of Changed", "one list of changes")?;
        }
        match self.lens.base() {
            LensSpec::Thin { focal_length_mm, diameter_mm } => {
                checker.number("focal_length_mm", *focal_length_mm)?;
                checker.number("diameter_mm", *diameter_mm)?;
            }
            LensSpec::Pinhole { diameter_mm } => checker.number("diameter_mm", *diameter_mm)?,
            LensSpec::MeasuredEye { pupil_mm, .. } => checker.number("pupil_mm", *pupil_mm)?,
            LensSpec::BuiltIn(_) | LensSpec::File(_) | LensSpec::Changed { .. } => {}
        }
        if let Some(slope_per_nm) = self.lens_reading.slope_per_nm {
            checker.number("slope_per_nm", slope_per_nm)?;
        }
        if let Some(lens_scale) = self.lens_reading.lens_scale {
            checker.number("lens_scale", lens_scale)?;
        }
        match self.stop {
            StopSpec::FNumber(n) => checker.number("FNumber", n)?,
            StopSpec::DiameterMm(d) => checker.number("DiameterMm", d)?,
            StopSpec::AsGiven => {}
        }
        if let Some(Iris { blades, rotation_deg, curvature }) = self.iris {
            checker.number("blades", f64::from(blades))?;
            checker.number("rotation_deg", rotation_deg)?;
            checker.number("curvature", curvature)?;
        }
        match self.focus {
            FocusSpec::DistanceMm(d) => checker.number("DistanceMm", d)?,
            FocusSpec::FilmMm(d) => checker.number("FilmMm", d)?,
            FocusSpec::NearObject => {}
        }
        let Movements { tilt_deg, swing_deg, rise_mm, shift_mm } = self.movements;
        for (key, value) in
            [("tilt_deg", tilt_deg), ("swing_deg", swing_deg), ("rise_mm", rise_mm), ("shift_mm", shift_mm)]
        {
            checker.number(key, value)?;
        }
        Ok(())
    }

    /// Checks what does not go with point spread functions of a file, which are those of a whole pupil.
    fn check_psfs(&self, checker: &Checker<'_>) -> Result<(), PipelineError> {
        if self.psfs.is_none() {
            return Ok(());
        }
        let with = |what: &str| format!("{what}, with psfs of a file, which are those of the whole pupil");
        if let BlurSpec::Views(_) = self.blur {
            checker.wrong("blur", &self.blur.to_string(), &with("layered or pointwise"))?;
        }
        if self.dual_pixel.is_some() {
            checker.wrong("dual_pixel", "photodiodes", &with("none"))?;
        }
        if matches!(self.light_field, Some(LightFieldSpec::Array(_))) {
            checker.wrong("light_field", "an array before the film", &with("none"))?;
        }
        let Movements { tilt_deg, swing_deg, .. } = self.movements;
        for (key, turned_deg) in [("tilt_deg", tilt_deg), ("swing_deg", swing_deg)] {
            if turned_deg != 0.0 {
                checker.wrong(
                    key,
                    &turned_deg.to_string(),
                    "0, with psfs of a file, which are those of a lens before its film",
                )?;
            }
        }
        Ok(())
    }

    /// Checks what does not go with pixels that are read as one.
    fn check_binning(&self, checker: &Checker<'_>) -> Result<(), PipelineError> {
        let Some(binning) = self.exposure.shot().binning else { return Ok(()) };
        let with = |what: &str| format!("{what}, with binning");
        checker.count("pixels", binning.pixels, 2..=16)?;
        if matches!(self.frames, FramesSpec::Interleaved { .. }) {
            checker.wrong("frames", "Interleaved", &with("Single, Burst or BracketStops"))?;
        }
        if self.dual_pixel.is_some() {
            checker.wrong("dual_pixel", "photodiodes read one by one", &with("whole pixels"))?;
        }
        if self.light_field.is_some() {
            checker.wrong("light_field", "a light-field camera", &with("none"))?;
        }
        Ok(())
    }

    /// Checks the film, and what goes with a part of it or an array before it.
    fn check_film(&self, checker: &Checker<'_>) -> Result<(), PipelineError> {
        if let FilmSpec::Pixels { columns, rows, pitch_um } = self.film {
            checker.count("columns", columns, 1..=65_536)?;
            checker.count("rows", rows, 1..=65_536)?;
            checker.number("pitch_um", pitch_um)?;
        }
        if let (Some(crop), FilmSpec::Pixels { columns, rows, .. }) = (self.crop, self.film) {
            crop.check((rows, columns))?;
        }
        if self.crop.is_some() && self.light_field.is_some() {
            let reason = "a part of the film is no light field, expected the whole film".to_owned();
            return Err(PipelineError::Unsuitable { what: "crop", reason });
        }
        if let (Some(LightFieldSpec::Array(_)), false) = (&self.light_field, self.processing.lens_corrections.is_none())
        {
            let reason =
                "are for the picture of a lens, expected none where an array stands before the film".to_owned();
            return Err(PipelineError::Unsuitable { what: "lens_corrections", reason });
        }
        Ok(())
    }

    /// Takes paths as relative to a folder; absolute ones stay.
    pub fn resolve_paths(&mut self, folder: &Path) {
        if let Some(path) = self.lens.file_mut() {
            *path = folder.join(&path);
        }
        for path in self.lens_reading.files_mut().chain(&mut self.psfs) {
            *path = folder.join(&path);
        }
        if let SensorSpec::File(path) = &mut self.sensor {
            *path = folder.join(&path);
        }
        filters::resolve_paths(&mut self.filters, folder);
        self.scene.resolve_paths(folder);
    }

    /// Returns the camera as the text of a camera file.
    pub fn to_ron(&self) -> String {
        let style = ron::ser::PrettyConfig::new().extensions(Extensions::IMPLICIT_SOME);
        ron::ser::to_string_pretty(self, style).expect("every part of a camera can be written as RON")
    }
}

#[cfg(test)]
mod tests {
    use dioptric_sensor::{NoiseSource, WhiteBalance};
    use dioptric_spectrum::Illuminant;

    use super::*;

    const SHORT: &str = r#"(
    name: "short",
    lens: BuiltIn("dgauss-50mm"),
    stop: FNumber(4.0),
    focus: DistanceMm(2000.0),
    sensor: File("my/sensor.ron"),
    scene: (source: File("scene.exr")),
)"#;

    fn parse(text: &str) -> Result<Camera, PipelineError> {
        Camera::parse(text, Path::new("folder/shot.ron"))
    }

    #[test]
    fn the_demo_is_a_camera() {
        let demo = Camera::demo().unwrap();
        demo.validate().unwrap();
        assert_eq!(parse(&demo.to_ron()).unwrap(), demo);
    }

    #[test]
    fn processing_keeps_its_old_words() {
        let of = |processing: &str| {
            let with = format!("processing: ({processing}),\n    sensor:");
            parse(&SHORT.replace("sensor:", &with)).unwrap().processing
        };
        assert_eq!(of(""), Processing::default());
        assert_eq!(of("white: GrayWorld"), Processing { white: WhiteBalance::GrayWorld, ..Processing::default() });
        assert_eq!(of("white: Light(D50), curve: Srgb"), Processing::for_light(Illuminant::D50));
        assert_eq!(of("demosaic: Directional, highlights: Clip, denoise: 0.0"), Processing::plain());
        let light = "white: Light(Chromaticity(x: 0.46, y: 0.414))";
        assert_eq!(of(light), Processing::for_light(Illuminant::Chromaticity { x: 0.46, y: 0.414 }));
    }

    #[test]
    fn noise_is_switched_in_the_file() {
        let of = |noise: &str| {
            let with = format!("noise: {noise},\n    sensor:");
            parse(&SHORT.replace("sensor:", &with)).unwrap().noise
        };
        assert_eq!(parse(SHORT).unwrap().noise, NoiseSources::ALL);
        assert_eq!(of("None"), NoiseSources::NONE);
        assert_eq!(of("Only([Photon])"), NoiseSources::only(&[NoiseSource::Photon]));
        check_error(&SHORT.replace("sensor:", "noise: Only([Hiss]),\n    sensor:"), &["shot.ron:6", "Hiss"]);
    }

    #[test]
    fn what_is_left_out_has_a_default_and_paths_follow_the_file() {
        let camera = parse(SHORT).unwrap();
        assert_eq!((camera.seed, camera.film, camera.blur), (1, FilmSpec::Sensor, BlurSpec::Layered));
        assert_eq!(camera.diffraction, Diffraction::Hurb { gamma: 1.0 });
        assert_eq!(camera.sensor, SensorSpec::File(PathBuf::from("folder/my/sensor.ron")));
    }

    #[track_caller]
    fn check_error(text: &str, words: &[&str]) {
        let message = parse(text).unwrap_err().to_string();
        for word in words {
            assert!(message.contains(word), "'{word}' in: {message}");
        }
        assert!(!message.contains('\n'), "{message}");
    }

    #[test]
    fn a_wrong_key_is_named_with_its_line() {
        check_error(&SHORT.replace("focus:", "fokus:"), &["folder/shot.ron:5", "fokus"]);
        check_error(&SHORT.replace("BuiltIn", "BuildIn"), &["shot.ron:3", "BuildIn"]);
        check_error(&SHORT[..60], &["shot.ron"]);
        check_error("", &["shot.ron:1"]);
    }

    #[test]
    fn a_number_out_of_range_is_named_with_its_line() {
        check_error(&SHORT.replace("4.0", "NaN"), &["shot.ron:4", "FNumber", "NaN"]);
        check_error(&SHORT.replace("4.0", "-4.0"), &["shot.ron:4", "FNumber", "-4"]);
        check_error(&SHORT.replace("2000.0", "0"), &["shot.ron:5", "DistanceMm"]);
        let film = "film: Pixels(columns: 0, rows: 4, pitch_um: 1.0),\n    sensor:";
        check_error(&SHORT.replace("sensor:", film), &["shot.ron:6", "columns", "0"]);
        // A key of older files is read and ignored.
        for old in ["Standard", "Within(error: -0.1)", "Paper"] {
            let camera = parse(&SHORT.replace("sensor:", &format!("bank: {old},\n    sensor:"))).unwrap();
            assert!(camera.bank.note().unwrap().contains("ignored"));
            assert_eq!(parse(SHORT).unwrap().bank.note(), None);
        }
        for (metering, value) in [("Percentile(NaN)", "NaN"), ("Percentile(-3)", "-3"), ("Percentile(101)", "101")] {
            let exposure = format!("exposure: Auto((metering: {metering}, target_fraction: 0.9)),\n    sensor:");
            check_error(&SHORT.replace("sensor:", &exposure), &["shot.ron:6", "Percentile", value, "0 to 100"]);
        }
        let manual = |time_s: &str| format!("exposure: Manual((time_s: {time_s})),\n    sensor:");
        check_error(&SHORT.replace("sensor:", &manual("-0.1")), &["shot.ron:6", "time_s", "-0.1"]);
        // A time of 0 is a bias frame.
        parse(&SHORT.replace("sensor:", &manual("0.0"))).unwrap();
    }
}
