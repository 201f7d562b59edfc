//! Changes of a camera by name, each as the command line has it.

use dioptric_optics::Lens as OpticsLens;
use dioptric_pipeline::{
    Camera, CoatingSpec, Crop, FilmSpec, FocusSpec, FramesSpec, Given, GivenParts, Iris, KeptCamera, LensReadOptions,
    LensSpec, PICTURE, RetiredBank, SceneSpec, SensorOptions, SensorSpec, StopSpec, WavelengthSpec, reference_nm_of,
    with_auto_exposure, with_blades, with_exposure_s,
};
use dioptric_sensor::Processing;
use pyo3::{
    prelude::*,
    types::{PyDict, PyString},
};

use crate::{
    errors::{exception, wrong, wrong_type},
    input::{number, numbers, path, type_name},
    lens::Lens,
    options::{count, diffraction, each_option, seed, with_gamma, word},
    scene::Scene,
    scene_options::{SCENE_OPTIONS, check_flat, set_scene_option},
    sensor::Sensor,
};

/// What changes the frames and what comes after, but not the light on the sensor.
const OF_EXPOSURE: &[&str] = &[
    "seed",
    "exposure_s",
    "analog_gain",
    "gain_mode",
    "binning",
    "temperature_c",
    "metering",
    "chip_seed",
    "noise",
    "burst",
    "bracket_stops",
    "both_gains",
    "interleaved_ratio",
    "interleaved_gain_ratio",
];
/// All changes, in the order in which they are made.
const ALL: &[&str] = &[
    "name",
    "lens",
    "f_number",
    "stop_mm",
    "coating",
    "blades",
    "blade_rotation_deg",
    "blade_curvature",
    "focus_mm",
    "film_mm",
    "tilt_deg",
    "swing_deg",
    "rise_mm",
    "shift_mm",
    "sensor",
    "film",
    "crop",
    "pixels",
    "pixel_um",
    "dual_pixel",
    "filters",
    "diffraction",
    "gamma",
    "psfs",
    "blur",
    "border",
    "lens_reflections",
    "bank",
    "bank_error",
    "scene",
    "fov_deg",
    "depth_m",
    "width_mm",
    "distance_mm",
    "fill_depth",
    "hidden",
    "points",
    "white_level",
    "quantity",
    "unit",
    "scale",
    "scene_wavelengths_nm",
    "variable",
    "axes",
    "no_data",
    "depth",
    "depth_unit",
    "depth_kind",
    "depth_variable",
    "view",
    "panorama",
    "illuminant",
    "illuminance_lux",
    "scene_light",
    "mean_luminance_cd_m2",
    "mean_lux",
    "wavelengths_nm",
    "exposure_s",
    "analog_gain",
    "gain_mode",
    "binning",
    "temperature_c",
    "metering",
    "chip_seed",
    "noise",
    "burst",
    "bracket_stops",
    "both_gains",
    "interleaved_ratio",
    "interleaved_gain_ratio",
    "seed",
];

/// Returns the names of what changes the picture alone.
pub(crate) fn of_picture() -> Vec<&'static str> {
    PICTURE.iter().map(|key| key.name).collect()
}

/// Returns the names of what changes the frames and what comes after, but not the light on the sensor.
pub(crate) fn of_exposure() -> Vec<&'static str> {
    [OF_EXPOSURE, &of_picture()].concat()
}

/// Returns the names of all changes, in the order in which they are made.
pub(crate) fn all() -> Vec<&'static str> {
    [ALL, &of_picture()].concat()
}

/// Returns the camera with changes made, checked.
pub(crate) fn changed(
    function: &str,
    kept: &KeptCamera,
    options: Option<&Bound<'_, PyDict>>,
    known: &[&str],
) -> PyResult<KeptCamera> {
    let mut changed = kept.clone();
    let mut checks_lens = false;
    each_option(function, options, known, |key, value| {
        checks_lens |= matches!(key, "lens" | "f_number" | "stop_mm" | "coating" | "blades");
        match key {
            "lens" => set_lens(&mut changed, value),
            "scene" => set_scene(&mut changed, value),
            "coating" => set_coating(&mut changed, value),
            "sensor" => set_sensor(&mut changed, value),
            _ => {
                let (mut camera, given) = (changed.camera().clone(), changed.given().clone());
                set(&mut camera, &given, key, value)?;
                changed = changed.with_camera(camera, given);
                Ok(())
            }
        }
    })?;
    let camera = changed.camera();
    check_flat(&camera.scene)?;
    camera.validate().map_err(exception)?;
    if checks_lens {
        open_lens(&changed)?;
    }
    if changed.given().sensor.is_none() {
        camera.sensor.open().map_err(exception)?;
    }
    Ok(changed)
}

/// Returns the lens of a camera, its stop set.
pub(crate) fn open_lens(kept: &KeptCamera) -> PyResult<OpticsLens> {
    let camera = kept.camera();
    let file = match &kept.given().lens {
        Some(file) => (**file).clone(),
        None => camera.lens.open(&camera.lens_reading).map_err(exception)?,
    };
    let reference_nm = reference_nm_of(&file);
    with_blades(file.lens, camera.iris).and_then(|lens| camera.stop.apply_at(lens, reference_nm)).map_err(exception)
}

/// Covers the surfaces of the lens, the camera file's or a given one.
fn set_coating(kept: &mut KeptCamera, value: &Bound<'_, PyAny>) -> PyResult<()> {
    let coating = Some(CoatingSpec::named(&path_or_name("coating", value)?));
    let (mut camera, given) = (kept.camera().clone(), kept.given().clone());
    if let Some(lens) = &given.lens {
        let reading = LensReadOptions { coating, ..LensReadOptions::default() };
        let file = reading.coated((**lens).clone()).map_err(exception)?;
        *kept = kept.with_given_lens(Given::new(file));
        return Ok(());
    }
    camera.lens_reading.coating = coating;
    *kept = kept.with_camera(camera, given);
    Ok(())
}

/// Puts another lens in: what the camera said of the stop and the glasses of the old one goes with it.
fn set_lens(kept: &mut KeptCamera, value: &Bound<'_, PyAny>) -> PyResult<()> {
    if let Ok(lens) = value.cast::<Lens>() {
        *kept = lens.get().put_into(kept);
        return Ok(());
    }
    let text: String = path_or_name("lens", value)?;
    let mut given = kept.given().clone();
    given.lens = None;
    let camera = Camera {
        lens: LensSpec::named(&text),
        stop: StopSpec::AsGiven,
        iris: None,
        lens_reading: LensReadOptions::default(),
        ..kept.camera().clone()
    };
    *kept = kept.with_camera(camera, given);
    Ok(())
}

fn set_scene(kept: &mut KeptCamera, value: &Bound<'_, PyAny>) -> PyResult<()> {
    if let Ok(scene) = value.cast::<Scene>() {
        *kept = scene.get().put_into(kept);
        return Ok(());
    }
    let path = path_or_name("scene", value)?;
    *kept = Scene::of_choice(SceneSpec::of_file(path.into())).put_into(kept);
    Ok(())
}

/// Puts another sensor in; the film becomes its pixels, as on the command line.
fn set_sensor(kept: &mut KeptCamera, value: &Bound<'_, PyAny>) -> PyResult<()> {
    if let Ok(sensor) = value.cast::<Sensor>() {
        *kept = sensor.get().put_into(kept);
    } else {
        let mut given = kept.given().clone();
        given.sensor = None;
        let sensor = SensorSpec::named(&path_or_name("sensor", value)?);
        *kept = kept.with_camera(Camera { sensor, ..kept.camera().clone() }, given);
    }
    *kept = kept.with(|camera| camera.film = FilmSpec::Sensor);
    Ok(())
}

fn set(camera: &mut Camera, given: &GivenParts, key: &str, value: &Bound<'_, PyAny>) -> PyResult<()> {
    let scene_key = if key == "scene_light" { "light" } else { key };
    let is_set = set_optics(camera, key, value)?
        || set_film(camera, given, key, value)?
        || set_imaging(camera, key, value)?
        || (SCENE_OPTIONS.contains(&scene_key) && key != "light" && {
            set_scene_option(&mut camera.scene, scene_key, value)?;
            true
        })
        || set_frames(camera, key, value)?;
    if is_set { Ok(()) } else { set_sensor_option(camera, key, value) }
}

/// Sets what stands before the film; returns whether the key is among that.
fn set_optics(camera: &mut Camera, key: &str, value: &Bound<'_, PyAny>) -> PyResult<bool> {
    match key {
        "name" => camera.name = word(key, value)?,
        "f_number" => camera.stop = StopSpec::FNumber(number(key, value)?),
        "stop_mm" => camera.stop = StopSpec::DiameterMm(number(key, value)?),
        "blades" => {
            let expected = "a whole number of 3 to 64, or None for a round stop";
            let blades: u32 = value.extract().map_err(|_| wrong_type(key, type_name(value), expected))?;
            let old = camera.iris.unwrap_or(Iris { blades, rotation_deg: 0.0, curvature: 0.0 });
            camera.iris = Some(Iris { blades, ..old });
        }
        "blade_rotation_deg" | "blade_curvature" => {
            let number = number(key, value)?;
            let iris = camera.iris.as_mut().ok_or_else(|| wrong(key, number, "'blades' with it"))?;
            *(if key == "blade_curvature" { &mut iris.curvature } else { &mut iris.rotation_deg }) = number;
        }
        "focus_mm" if value.is_instance_of::<PyString>() => match word(key, value)?.as_str() {
            "near" => camera.focus = FocusSpec::NearObject,
            other => return Err(wrong(key, format!("'{other}'"), "a distance in mm, or 'near' for the near object")),
        },
        "focus_mm" => camera.focus = FocusSpec::DistanceMm(number(key, value)?),
        "film_mm" => camera.focus = FocusSpec::FilmMm(number(key, value)?),
        "tilt_deg" => camera.movements.tilt_deg = number(key, value)?,
        "swing_deg" => camera.movements.swing_deg = number(key, value)?,
        "rise_mm" => camera.movements.rise_mm = number(key, value)?,
        "shift_mm" => camera.movements.shift_mm = number(key, value)?,
        _ => return Ok(false),
    }
    Ok(true)
}

/// Sets what the film is; returns whether the key is among that.
fn set_film(camera: &mut Camera, given: &GivenParts, key: &str, value: &Bound<'_, PyAny>) -> PyResult<bool> {
    match key {
        "crop" => {
            let expected = "four whole numbers: the first column and row, columns and rows";
            let (x, y, columns, rows) = value.extract().map_err(|_| wrong_type(key, type_name(value), expected))?;
            camera.crop = Some(Crop { x, y, columns, rows });
        }
        "mean_lux" => {
            camera.scene.mean_lux = Some(number(key, value)?);
            camera.scene.mean_luminance_cd_m2 = None;
        }
        "dual_pixel" => {
            let found = word(key, value)?;
            let expected = "'none', 'left-right', 'top-bottom' or 'quad', also as 'left-right:0.05:3'";
            camera.dual_pixel = match found.as_str() {
                "none" => None,
                _ => Some(found.parse().map_err(|_| wrong(key, format!("'{found}'"), expected))?),
            };
        }
        "filters" => {
            let expected = "a list of names, files and words as 'nd:0.9'";
            let found: Vec<String> = value.extract().map_err(|_| wrong_type(key, type_name(value), expected))?;
            camera.filters = found.iter().map(|word| word.parse()).collect::<Result<_, _>>().map_err(exception)?;
        }
        "film" => {
            camera.film = match word(key, value)?.as_str() {
                "sensor" => FilmSpec::Sensor,
                "scene" => FilmSpec::Scene,
                "field" => FilmSpec::Field,
                other => return Err(wrong(key, format!("'{other}'"), "'sensor', 'field' or 'scene'")),
            }
        }
        "pixels" => {
            let (columns, rows) =
                value.extract().map_err(|_| wrong_type(key, type_name(value), "a pair of columns and rows"))?;
            let pitch_um = match camera.film {
                FilmSpec::Pixels { pitch_um, .. } => pitch_um,
                // Until `pixel_um` is set, that of the sensor.
                _ => match given.sensor.as_deref() {
                    Some(sensor) => sensor.pixel_pitch_um,
                    None => camera.sensor.open().map_err(exception)?.pixel_pitch_um,
                },
            };
            camera.film = FilmSpec::Pixels { columns, rows, pitch_um };
        }
        "pixel_um" => match &mut camera.film {
            FilmSpec::Pixels { pitch_um, .. } => *pitch_um = number(key, value)?,
            _ => return Err(wrong(key, number(key, value)?, "'pixels' with it: the film's pixels are the sensor's")),
        },
        _ => return Ok(false),
    }
    Ok(true)
}

/// Sets how a lens forms an image, and of which bands; returns whether the key is among that.
fn set_imaging(camera: &mut Camera, key: &str, value: &Bound<'_, PyAny>) -> PyResult<bool> {
    match key {
        "diffraction" => camera.diffraction = diffraction(key, value)?,
        "gamma" => camera.diffraction = with_gamma(camera.diffraction, number(key, value)?)?,
        "psfs" => {
            let named = path(key, value)?;
            camera.psfs = Some(named).filter(|path| path.as_os_str() != "none");
        }
        "blur" => {
            let found = word(key, value)?;
            let expected = "'layered', 'pointwise' or 'views:16'";
            camera.blur = found.parse().map_err(|_| wrong(key, format!("'{found}'"), expected))?;
        }
        "border" => {
            let found = word(key, value)?;
            let expected = "'hold', 'mirror' or 'black'";
            camera.border = found.parse().map_err(|_| wrong(key, format!("'{found}'"), expected))?;
        }
        "lens_reflections" => {
            let found = word(key, value)?;
            camera.lens_reflections =
                found.parse().map_err(|_| wrong(key, format!("'{found}'"), "'off', 'ghosts' or 'film:0.1'"))?;
        }
        // Of older programs; the report notes it.
        "bank" | "bank_error" => camera.bank = RetiredBank::STATED,
        "wavelengths_nm" if value.is_instance_of::<PyString>() => match word(key, value)?.as_str() {
            "scene" => camera.wavelengths = WavelengthSpec::Scene,
            other => return Err(wrong(key, format!("'{other}'"), "numbers, or 'scene' for the scene's own")),
        },
        "wavelengths_nm" => camera.wavelengths = WavelengthSpec::ListNm(numbers(key, value)?),
        _ => return Ok(false),
    }
    Ok(true)
}

/// Sets exposures and their number; returns whether the key is among that.
fn set_frames(camera: &mut Camera, key: &str, value: &Bound<'_, PyAny>) -> PyResult<bool> {
    match key {
        "exposure_s" if value.is_instance_of::<PyString>() => match word(key, value)?.as_str() {
            "auto" => camera.exposure = with_auto_exposure(camera.exposure),
            other => return Err(wrong(key, format!("'{other}'"), "a time in s, or 'auto'")),
        },
        "exposure_s" => camera.exposure = with_exposure_s(camera.exposure, number(key, value)?),
        "burst" => camera.frames = FramesSpec::Burst(count(key, value)?),
        "bracket_stops" => camera.frames = FramesSpec::BracketStops(numbers(key, value)?),
        "both_gains" => match value.extract::<bool>() {
            Ok(true) => camera.frames = FramesSpec::BothGains,
            Ok(false) if camera.frames == FramesSpec::BothGains => camera.frames = FramesSpec::Single,
            Ok(false) => {}
            Err(_) => return Err(wrong(key, value, "True or False")),
        },
        "interleaved_ratio" => {
            camera.frames = FramesSpec::Interleaved { ratio: number(key, value)?, period_rows: 2, gain_ratio: 1.0 };
        }
        "interleaved_gain_ratio" => {
            let gain_ratio = number(key, value)?;
            camera.frames = match camera.frames {
                FramesSpec::Interleaved { ratio, period_rows, .. } => {
                    FramesSpec::Interleaved { ratio, period_rows, gain_ratio }
                }
                _ => FramesSpec::Interleaved { ratio: 1.0, period_rows: 2, gain_ratio },
            };
        }
        "seed" => camera.seed = seed(key, value)?,
        "chip_seed" => camera.chip_seed = seed(key, value)?,
        _ => return Ok(false),
    }
    Ok(true)
}

fn set_sensor_option(camera: &mut Camera, key: &str, value: &Bound<'_, PyAny>) -> PyResult<()> {
    let mut options = SensorOptions::default();
    match key {
        "analog_gain" => options.analog_gain = Some(number(key, value)?),
        "noise" => options.noise = Some(word(key, value)?),
        "gain_mode" => options.gain_mode = Some(word(key, value)?),
        "binning" => options.binning = Some(word(key, value)?),
        "temperature_c" => options.temperature_c = Some(number(key, value)?),
        "metering" => options.metering = Some(word(key, value)?),
        _ => return set_picture_option(&mut camera.processing, key, value),
    }
    options.apply(&mut camera.noise, &mut camera.exposure, &mut camera.processing).map_err(exception)
}

/// Makes one of the choices of [`PICTURE`].
fn set_picture_option(processing: &mut Processing, name: &str, value: &Bound<'_, PyAny>) -> PyResult<()> {
    let key = PICTURE.iter().find(|key| key.name == name).expect("names were compared with those of the table");
    let text = if key.is_number() { number(name, value)?.to_string() } else { word(name, value)? };
    key.set(processing, &text).map_err(exception)
}

/// Returns the usual processing with changes made.
pub(crate) fn changed_processing(function: &str, options: Option<&Bound<'_, PyDict>>) -> PyResult<Processing> {
    let mut processing = Processing::default();
    each_option(function, options, &of_picture(), |key, value| set_picture_option(&mut processing, key, value))?;
    Ok(processing)
}

fn path_or_name(key: &str, value: &Bound<'_, PyAny>) -> PyResult<String> {
    let path: std::path::PathBuf =
        value.extract().map_err(|_| wrong_type(key, type_name(value), "a name, a path or an object of dioptric"))?;
    Ok(path.to_string_lossy().into_owned())
}
