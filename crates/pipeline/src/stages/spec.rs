//! What each stage is made from: parts of the camera, each stage's holding those of the stages before it.
//!
//! Two cameras with equal inputs of a stage share its result. This module is the table of what a change recomputes.

use std::{
    fs,
    path::{Path, PathBuf},
    time::SystemTime,
};

use dioptric_backward::MicroArray;
use dioptric_forward::Film;
use dioptric_optics::{Iris, LensFile};
use dioptric_scene::{FileReading, FillDepth, PointTable, Scene, may_be_read_with};
use dioptric_sensor::{ExposureControl, Noise, OpticalFilter, Processing, Sensor, WhiteBalance};
use dioptric_spectrum::Illuminant;
use dioptric_world::ReadOptions;
use serde::{Deserialize, Serialize};

use super::{
    canvas::Viewing,
    given::{Given, GivenParts},
};
use crate::{
    BlurSpec, BorderSpec, Camera, Crop, Diffraction, DualPixelSpec, FilmSpec, FilterSpec, FlatSize, FocusSpec,
    FramesSpec, LensReadOptions, LensReflections, LensSpec, LightFieldSpec, Movements, PipelineError, Quality,
    RenderEffort, SceneSource, SceneSpec, StopSpec, WavelengthSpec, WorldChange, WorldLamp, WorldSky, WorldSpec,
};

/// A file as it was when it was looked at, so that a change of it is seen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct FileStamp {
    path: PathBuf,
    /// Length and time of the last change; `None` where the file cannot be looked at, which reading it will report.
    state: Option<(u64, Option<SystemTime>)>,
}

impl FileStamp {
    /// Returns the stamps of all that reading a path may read: the files of a folder, or a file and those beside it that
    /// differ in their ending alone (the samples of a header, the glasses of a lens) or belong to a scene (its depth, its camera).
    fn all_of(path: &Path) -> Vec<Self> {
        let folder = if path.is_dir() { Some(path) } else { path.parent() };
        let folder = folder.filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let entries = fs::read_dir(folder).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()));
        let mut beside: Vec<PathBuf> = match path.is_dir() {
            true => entries.collect(),
            false => {
                let belongs = |entry: &PathBuf| entry.file_stem() == path.file_stem() || may_be_read_with(path, entry);
                entries.filter(|entry| belongs(entry) && entry.is_file()).collect()
            }
        };
        beside.retain(|entry| entry.file_name() != path.file_name());
        beside.sort();
        std::iter::once(path).chain(beside.iter().map(PathBuf::as_path)).map(Self::of).collect()
    }

    pub(crate) fn of(path: &Path) -> Self {
        let state = fs::metadata(path).ok().map(|data| (data.len(), data.modified().ok()));
        Self { path: path.to_owned(), state }
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }
}

/// The lens, its stop set, moved before the film.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LensInputs {
    pub(crate) given: Option<Given<LensFile>>,
    pub(crate) choice: LensSpec,
    pub(crate) reading: LensReadOptions,
    pub(crate) stop: StopSpec,
    pub(crate) iris: Option<Iris>,
    pub(crate) movements: Movements,
    /// The file of the point spread functions that take the place of its own.
    pub(crate) psfs: Option<PathBuf>,
    files: Vec<FileStamp>,
}

/// Where the samples of the scene are: all that imaging is planned from.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct GeometryInputs {
    pub(crate) given: Option<Given<Scene>>,
    pub(crate) source: SceneSource,
    pub(crate) field_of_view_deg: Option<f64>,
    pub(crate) depth_m: Option<f64>,
    /// The size of a flat scene, and the lens from whose entrance pupil it is seen.
    pub(crate) flat: Option<(FlatSize, Box<LensInputs>)>,
    pub(crate) fill_depth: Option<FillDepth>,
    pub(crate) hidden: Option<PathBuf>,
    pub(crate) points: Option<PathBuf>,
    pub(crate) wavelengths: WavelengthSpec,
    pub(crate) quality: Quality,
    /// The lens, and the distance between the pixels behind it, µm, that see a picture that is large in all bands: it is read no finer than by far more
    /// than they need.
    pub(crate) seen_by: Option<(Box<LensInputs>, f64)>,
    /// Whether the view of the still life is but the summary of a picture that rays from the film make.
    pub(crate) is_summary: bool,
    /// The frame in which a preview has all that the film sees of the still life, where that matters and is known from the lens and the film.
    pub(crate) frame: Option<i32>,
    /// The level that a world's light is brought to, cd/m²; that of other scenes is no matter of their geometry.
    pub(crate) mean_luminance_cd_m2: Option<f64>,
    files: Vec<FileStamp>,
}

/// The light in the scene.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SceneInputs {
    pub(crate) geometry: GeometryInputs,
    pub(crate) illuminant: Option<Illuminant>,
    pub(crate) illuminance_lux: Option<f64>,
    pub(crate) light: Option<Illuminant>,
    pub(crate) mean_luminance_cd_m2: Option<f64>,
    pub(crate) white_level: Option<f64>,
    pub(crate) reading: FileReading,
}

/// A world, read from its files.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct WorldInputs {
    pub(crate) file: PathBuf,
    pub(crate) reading: ReadOptions,
    pub(crate) changes: Vec<WorldChange>,
    pub(crate) sky: Option<WorldSky>,
    pub(crate) lamps: Vec<WorldLamp>,
    pub(crate) level: Option<LevelInputs>,
    files: Vec<FileStamp>,
}

/// The level that a world's light is brought to, and the view that it is that of.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LevelInputs {
    pub(crate) mean_luminance_cd_m2: f64,
    pub(crate) spec: Box<WorldSpec>,
    pub(crate) fov_deg: Option<f64>,
}

/// The place and the raster of the film.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FilmInputs {
    pub(crate) lens: LensInputs,
    pub(crate) geometry: GeometryInputs,
    pub(crate) focus: FocusSpec,
    pub(crate) raster: Raster,
    pub(crate) crop: Option<Crop>,
}

/// The pixels of the film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Raster {
    /// So many, of this size.
    Pixels(Film),
    /// As many as the scene has samples.
    Scene,
    /// As many of these as the scene's field covers.
    Field(Film),
}

/// The point spread functions of the lens.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct BankInputs {
    pub(crate) film: FilmInputs,
    pub(crate) diffraction: Diffraction,
}

/// The plan of the imaging.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PlanInputs {
    pub(crate) bank: BankInputs,
    pub(crate) blur: BlurSpec,
    pub(crate) border: BorderSpec,
    /// The photodiode whose part of the pupil is imaged through, by number; none for the whole pupil.
    pub(crate) photodiode: Option<(DualPixelSpec, usize)>,
}

/// The spectral irradiance on the film.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct IrradianceInputs {
    pub(crate) plan: PlanInputs,
    pub(crate) scene: SceneInputs,
    /// What becomes of the light that surfaces of the lens reflect.
    pub(crate) reflections: LensReflections,
    pub(crate) micro_array: Option<MicroArray>,
    /// The photodiodes whose irradiances it is the sum of; none for whole pixels.
    pub(crate) dual_pixel: Option<DualPixelSpec>,
    /// The mean illuminance that it is brought to, lux.
    pub(crate) mean_lux: Option<f64>,
    /// How well a world is rendered by rays from the film; none where its view is blurred, or there is no world.
    pub(crate) effort: Option<RenderEffort>,
}

/// The mean rate of photo-electrons.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ElectronInputs {
    pub(crate) irradiance: IrradianceInputs,
    pub(crate) sensor: Sensor,
    /// Filters before the lens.
    pub(crate) filters: Vec<OpticalFilter>,
}

/// The frames of the sensor.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FrameInputs {
    pub(crate) electrons: ElectronInputs,
    pub(crate) shutter: ShutterInputs,
}

/// How the sensor is exposed and read.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ShutterInputs {
    pub(crate) exposure: ExposureControl,
    pub(crate) frames: FramesSpec,
    pub(crate) noise: Noise,
}

/// What the lens does to the frame of a sensor.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct AberrationInputs {
    pub(crate) film: FilmInputs,
    pub(crate) scene: SceneInputs,
    pub(crate) sensor: Sensor,
}

/// The picture.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PictureInputs {
    pub(crate) frames: FrameInputs,
    pub(crate) processing: Processing,
}

/// Checks that light comes to pixels of a stack from the whole exit pupil, as their optics take it to.
fn check_stack(camera: &Camera, sensor: &Sensor) -> Result<(), PipelineError> {
    let expected = match (camera.dual_pixel, &camera.light_field) {
        _ if sensor.pixel_stack.is_none() => return Ok(()),
        (Some(_), _) => "dual_pixel, which states itself how photodiodes share the light of the pupil",
        (None, Some(LightFieldSpec::Array(_))) => "a light_field, whose array sends light of other angles",
        (None, _) => return Ok(()),
    };
    let reason = format!("of {} does not go with {expected}, expected a sensor without it", sensor.name);
    Err(PipelineError::Unsuitable { what: "pixel_stack", reason })
}

/// Checks that a patch that is made white lies in the frame.
fn check_patch(camera: &Camera, sensor: &Sensor) -> Result<(), PipelineError> {
    let WhiteBalance::Patch { left, top, width, height } = camera.processing.white else { return Ok(()) };
    let (columns, rows) = match (camera.crop, camera.film) {
        (Some(crop), _) => (crop.columns, crop.rows),
        (None, FilmSpec::Sensor) => (sensor.columns, sensor.rows),
        (None, FilmSpec::Pixels { columns, rows, .. }) => (columns, rows),
        (None, FilmSpec::Scene | FilmSpec::Field) => return Ok(()),
    };
    let is_within = left.saturating_add(width) <= columns && top.saturating_add(height) <= rows && width * height > 0;
    if is_within {
        return Ok(());
    }
    let found = format!("a patch of {width} × {height} pixels from column {left}, row {top}");
    let expected = format!("one within the frame of {columns} × {rows} pixels");
    Err(PipelineError::Value { origin: camera.name.clone(), key: "white", found, expected })
}

impl LensInputs {
    pub(crate) fn of(camera: &Camera, given: &GivenParts) -> Self {
        let lens_file = camera.lens.file().filter(|_| given.lens.is_none()).map_or_else(Vec::new, FileStamp::all_of);
        let named = camera.lens_reading.files().chain(camera.psfs.as_deref()).map(FileStamp::of);
        Self {
            given: given.lens.clone(),
            choice: camera.lens.clone(),
            reading: camera.lens_reading.clone(),
            stop: camera.stop,
            iris: camera.iris,
            movements: camera.movements,
            psfs: camera.psfs.clone(),
            files: lens_file.into_iter().chain(named).collect(),
        }
    }
}

impl GeometryInputs {
    /// Returns how a still life is looked at.
    pub(crate) fn viewing(&self) -> Viewing {
        Viewing { quality: self.quality, frame: self.frame }
    }

    /// Returns what the world of this geometry is read from, or `None` for a scene that is none.
    pub(crate) fn world(&self) -> Option<(WorldInputs, &WorldSpec)> {
        let SceneSource::World(spec) = &self.source else { return None };
        // What doesn't change the level of the view is left out.
        let of_view = |spec: &WorldSpec| {
            let WorldSpec { method, effort, layers, seed, .. } = WorldSpec::of_file(PathBuf::new());
            Box::new(WorldSpec { method, effort, layers, seed, ..spec.clone() })
        };
        let level = self.mean_luminance_cd_m2.map(|mean_luminance_cd_m2| LevelInputs {
            mean_luminance_cd_m2,
            spec: of_view(spec),
            fov_deg: self.field_of_view_deg,
        });
        let inputs = WorldInputs {
            file: spec.file.clone(),
            reading: spec.reading(),
            changes: spec.changes.clone(),
            sky: spec.sky.clone(),
            lamps: spec.lamps.clone(),
            level,
            files: self.files.clone(),
        };
        Some((inputs, spec))
    }
}

impl SceneInputs {
    /// Returns the part of a camera file that says this.
    pub(crate) fn choice(&self) -> SceneSpec {
        let GeometryInputs { source, field_of_view_deg, depth_m, flat, fill_depth, hidden, points, .. } =
            &self.geometry;
        SceneSpec {
            source: source.clone(),
            field_of_view_deg: *field_of_view_deg,
            depth_m: *depth_m,
            flat: flat.as_ref().map(|(flat, _)| *flat),
            fill_depth: *fill_depth,
            hidden: hidden.clone(),
            points: points.clone(),
            white_level: self.white_level,
            reading: self.reading.clone(),
            illuminant: self.illuminant.clone(),
            light: self.light.clone(),
            illuminance_lux: self.illuminance_lux,
            mean_luminance_cd_m2: self.mean_luminance_cd_m2,
            // Of what the film gets, not of the scene.
            mean_lux: None,
        }
    }

    pub(crate) fn of(camera: &Camera, given: &GivenParts, quality: Quality) -> Self {
        let scene = &camera.scene;
        Self {
            geometry: GeometryInputs {
                given: given.scene.clone(),
                source: as_seen(&scene.source, camera.film, quality),
                field_of_view_deg: scene.field_of_view_deg,
                depth_m: scene.depth_m,
                flat: scene.flat.map(|flat| (flat, Box::new(LensInputs::of(camera, given)))),
                fill_depth: scene.fill_depth,
                hidden: scene.hidden.clone(),
                points: scene.points.clone(),
                wavelengths: camera.wavelengths.clone(),
                quality,
                seen_by: None,
                is_summary: is_summary(&scene.source, camera.film),
                frame: None,
                mean_luminance_cd_m2: match &scene.source {
                    SceneSource::World(_) => scene.mean_luminance_cd_m2,
                    _ => None,
                },
                files: scene
                    .points
                    .iter()
                    .flat_map(|path| PointTable::light_files(path).into_iter().chain([path.clone()]))
                    .flat_map(|path| FileStamp::all_of(&path))
                    .chain(match &scene.source {
                        SceneSource::File(path) if given.scene.is_none() => {
                            let others = [&scene.hidden, &scene.reading.depth, &scene.reading.view];
                            let others = others.into_iter().flatten().flat_map(|path| FileStamp::all_of(path));
                            FileStamp::all_of(path).into_iter().chain(others).collect()
                        }
                        SceneSource::World(world) => world.files().flat_map(|path| FileStamp::all_of(&path)).collect(),
                        _ => Vec::new(),
                    })
                    .collect(),
            },
            illuminant: scene.illuminant.clone(),
            light: scene.light.clone(),
            illuminance_lux: scene.illuminance_lux,
            mean_luminance_cd_m2: scene.mean_luminance_cd_m2,
            white_level: scene.white_level,
            reading: scene.reading.clone(),
        }
    }
}

impl IrradianceInputs {
    pub(crate) fn of(camera: &Camera, given: &GivenParts, sensor: &Sensor, quality: Quality) -> Self {
        let mut scene = SceneInputs::of(camera, given, quality);
        let of_sensor = Film::centered(sensor.rows, sensor.columns, sensor.pixel_pitch_um);
        let raster = match camera.film {
            FilmSpec::Sensor => Raster::Pixels(of_sensor),
            FilmSpec::Field => Raster::Field(of_sensor),
            FilmSpec::Pixels { columns, rows, pitch_um } => Raster::Pixels(Film::centered(rows, columns, pitch_um)),
            FilmSpec::Scene => Raster::Scene,
        };
        let lens = LensInputs::of(camera, given);
        if let Raster::Pixels(film) | Raster::Field(film) = &raster {
            let is_large = given.scene.is_none() && is_large_picture(&camera.scene);
            scene.geometry.seen_by = is_large.then(|| (Box::new(lens.clone()), film.pitch_um));
        }
        let film =
            FilmInputs { lens, geometry: scene.geometry.clone(), focus: camera.focus, raster, crop: camera.crop };
        let bank = BankInputs { film, diffraction: camera.diffraction };
        let micro_array = camera.light_field.as_ref().and_then(LightFieldSpec::micro_array);
        let effort = match &camera.scene.source {
            SceneSource::World(spec) => spec.backward(),
            _ => None,
        };
        let plan = PlanInputs { bank, blur: camera.blur, border: camera.border, photodiode: None };
        let mean_lux = camera.scene.mean_lux;
        let reflections = camera.lens_reflections;
        Self { plan, scene, reflections, micro_array, dual_pixel: camera.dual_pixel, mean_lux, effort }
    }
}

/// What a picture takes in all bands from which on it is read no finer than needed, bytes.
const LARGE_BYTES: u64 = 256 << 20;

/// Bands of a picture where none are asked for.
const USUAL_BANDS: u64 = 31;

/// Whether a scene is a picture of one depth and of a stated view that is large in all bands.
fn is_large_picture(scene: &SceneSpec) -> bool {
    let SceneSource::File(path) = &scene.source else { return false };
    let is_flat = scene.flat.is_some() || (scene.depth_m.is_some() && scene.field_of_view_deg.is_some());
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    is_flat
        && scene.hidden.is_none()
        && scene.reading.depth.is_none()
        && match ending.as_str() {
            "png" | "jpg" | "jpeg" | "tif" | "tiff" => dioptric_pictures::size_of(path).is_ok_and(|(columns, rows)| {
                (columns as u64 * rows as u64).saturating_mul(4 * USUAL_BANDS) > LARGE_BYTES
            }),
            _ => dioptric_scene::envi_bytes(path).is_some_and(|bytes| bytes > LARGE_BYTES),
        }
}

/// Whether a view of the still life is needed for the summary of the scene alone: rays from the film make the picture, which does not have
/// as many pixels as the view.
fn is_summary(source: &SceneSource, film: FilmSpec) -> bool {
    let SceneSource::World(spec) = source else { return false };
    spec.is_still_life() && spec.backward().is_some() && film != FilmSpec::Scene
}

/// Returns a source as far as the view of it depends on it: not on the samples of rays from the film, and a preview not on those of the still
/// life, which are finer than its own, unless the film has as many.
fn as_seen(source: &SceneSource, film: FilmSpec, quality: Quality) -> SceneSource {
    let mut seen = source.clone();
    match &mut seen {
        SceneSource::World(spec) if spec.backward().is_some() => spec.effort = RenderEffort::default(),
        SceneSource::StillLife { columns, rows } if film != FilmSpec::Scene => {
            (*columns, *rows) = quality.still_life_size((*columns, *rows));
        }
        _ => {}
    }
    seen
}

impl IrradianceInputs {
    /// Returns the lens, its focus and the film where it matters to a preview of the still life how much of it they see.
    pub(crate) fn onlooker(&self) -> Option<(&LensInputs, FocusSpec, &Film)> {
        let (geometry, film) = (&self.scene.geometry, &self.plan.bank.film);
        let Raster::Pixels(pixels) = &film.raster else { return None };
        let is_painting = matches!(geometry.source, SceneSource::StillLife { .. }) && geometry.given.is_none();
        // The mean luminance that a scene is brought to is that of all of it.
        let is_whole = self.scene.mean_luminance_cd_m2.is_some() || geometry.hidden.is_some();
        (is_painting && !is_whole).then_some((&film.lens, film.focus, pixels))
    }

    /// Sets the frame in which a preview has all that the film sees of the still life.
    pub(crate) fn set_frame(&mut self, frame: Option<i32>) {
        self.scene.geometry.frame = frame;
        self.plan.bank.film.geometry.frame = frame;
    }

    /// Returns the files that the irradiance is made from.
    pub(crate) fn files(&self) -> impl Iterator<Item = &FileStamp> {
        self.plan.bank.film.lens.files.iter().chain(&self.scene.geometry.files)
    }
}

impl PictureInputs {
    /// Returns the inputs of the whole chain; those of the stages before the picture are parts of it.
    ///
    /// # Errors
    /// When the sensor cannot be read.
    pub(crate) fn of(camera: &Camera, given: &GivenParts, quality: Quality) -> Result<Self, PipelineError> {
        let sensor = given.sensor.as_deref().map_or_else(|| camera.sensor.open(), |sensor| Ok(sensor.clone()))?;
        check_stack(camera, &sensor)?;
        check_patch(camera, &sensor)?;
        camera.frames.check_sensor(&sensor, camera.exposure.shot().gain_mode)?;
        let irradiance = IrradianceInputs::of(camera, given, &sensor, quality);
        let frames = FrameInputs {
            electrons: ElectronInputs { irradiance, sensor, filters: FilterSpec::open_all(&camera.filters)? },
            shutter: ShutterInputs {
                exposure: camera.exposure,
                frames: camera.frames.clone(),
                noise: Noise { sources: camera.noise, fixed_pattern_seed: camera.chip_seed, ..Noise::all(camera.seed) },
            },
        };
        Ok(Self { frames, processing: camera.processing.clone() })
    }
}
