//! What may be said of a scene beside where it comes from, from keyword arguments.

use std::path::PathBuf;

use dioptric_pipeline::{FillDepth, FlatSize, PipelineError, SceneSpec};
use dioptric_scene::SceneError;
use pyo3::{prelude::*, types::PyDict};

use crate::{
    errors::{exception, wrong, wrong_type},
    input::{number, numbers, type_name},
    options::{each_option, light, word},
};

/// Returns what a camera file says of a scene, with options set.
pub(crate) fn with_options(
    function: &str,
    mut spec: SceneSpec,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<SceneSpec> {
    each_option(function, options, SCENE_OPTIONS, |key, value| set_scene_option(&mut spec, key, value))?;
    check_flat(&spec)?;
    Ok(spec)
}

/// What may be said of a scene beside where it comes from, in the order in which it is set; the words are those of the command line.
pub(crate) const SCENE_OPTIONS: &[&str] = &[
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
    "light",
    "mean_luminance_cd_m2",
];

/// Sets one of [`SCENE_OPTIONS`]. A size takes the place of a field of view and a depth, and these that of a size.
pub(crate) fn set_scene_option(spec: &mut SceneSpec, key: &str, value: &Bound<'_, PyAny>) -> PyResult<()> {
    match key {
        "fov_deg" => {
            spec.field_of_view_deg = Some(number(key, value)?);
            spec.flat = None;
        }
        "depth_m" => {
            spec.depth_m = Some(number(key, value)?);
            spec.flat = None;
        }
        "width_mm" => {
            let distance_mm = spec.flat.map_or(f64::NAN, |flat| flat.distance_mm);
            spec.flat = Some(FlatSize { width_mm: number(key, value)?, distance_mm });
            (spec.field_of_view_deg, spec.depth_m) = (None, None);
        }
        "distance_mm" => match &mut spec.flat {
            Some(flat) => flat.distance_mm = number(key, value)?,
            None => return Err(wrong(key, number(key, value)?, "'width_mm' with it, the width of a flat scene")),
        },
        "fill_depth" => spec.fill_depth = Some(fill_of(key, value)?),
        "quantity" => spec.reading.quantity = Some(parsed(key, value)?),
        "unit" => spec.reading.unit = Some(word(key, value)?),
        "scale" => spec.reading.scale = Some(number(key, value)?),
        "scene_wavelengths_nm" => spec.reading.wavelengths_nm = Some(numbers(key, value)?),
        "variable" => spec.reading.variable = Some(word(key, value)?),
        "axes" => spec.reading.axes = Some(word(key, value)?),
        "no_data" => spec.reading.no_data = Some(parsed(key, value)?),
        "depth_unit" => spec.reading.depth_unit = Some(word(key, value)?),
        "depth_kind" => spec.reading.depth_kind = Some(parsed(key, value)?),
        "depth_variable" => spec.reading.depth_variable = Some(word(key, value)?),
        "panorama" => spec.reading.panorama = Some(parsed(key, value)?),
        "depth" | "view" => {
            let path: PathBuf = value.extract().map_err(|_| wrong_type(key, type_name(value), "a path"))?;
            if key == "depth" { spec.reading.depth = Some(path) } else { spec.reading.view = Some(path) }
        }
        "points" => {
            let expected = "a path: a table of points that shine";
            spec.points = Some(value.extract().map_err(|_| wrong_type(key, type_name(value), expected))?);
        }
        "hidden" => {
            let expected = "a path: a file of what lies behind the first surface";
            spec.hidden = Some(value.extract().map_err(|_| wrong_type(key, type_name(value), expected))?);
        }
        "white_level" => spec.white_level = Some(number(key, value)?),
        "illuminant" => spec.illuminant = Some(light(key, value)?),
        "illuminance_lux" => spec.illuminance_lux = Some(number(key, value)?),
        "light" => spec.light = Some(light(key, value)?),
        _ => spec.mean_luminance_cd_m2 = Some(number(key, value)?),
    }
    Ok(())
}

/// Returns a choice by its word.
fn parsed<T: std::str::FromStr<Err = SceneError>>(key: &str, value: &Bound<'_, PyAny>) -> PyResult<T> {
    word(key, value)?.parse().map_err(|error| exception(PipelineError::from(error)))
}

/// Reads the depth where none was measured.
pub(crate) fn fill_of(key: &str, value: &Bound<'_, PyAny>) -> PyResult<FillDepth> {
    let fill = match value.extract::<f64>() {
        Ok(z_m) => FillDepth::Metres(z_m),
        Err(_) => word(key, value)?.parse().map_err(exception)?,
    };
    fill.check().map_err(exception)?;
    Ok(fill)
}

/// Refuses the width of a flat scene without its distance.
pub(crate) fn check_flat(spec: &SceneSpec) -> PyResult<()> {
    match spec.flat {
        Some(flat) if flat.distance_mm.is_nan() => {
            Err(wrong("width_mm", flat.width_mm, "'distance_mm' with it, from the first vertex of the lens"))
        }
        _ => Ok(()),
    }
}
