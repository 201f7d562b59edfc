//! Objects made again in another process, from what `__reduce__` of their classes gives.
//!
//! Large arrays are among these arguments as NumPy arrays, so that protocol 5 of pickle passes them beside the stream.

use std::path::Path;

use dioptric_optics::{Coating, GlassRange, Iris, LensFile, ReadOptions};
use dioptric_pipeline::{
    Camera as CameraFile, Imaged, KeptCamera, LensReadOptions, LensSpec, Quality, SceneSpec, SensorSpec, StopSpec,
};
use dioptric_scene::{Scene as RadianceScene, SceneLight, View};
use dioptric_sensor::Sensor as SensorSheet;
use dioptric_spectrum::{DepthMap, Quantity, SpectralImage, WavelengthGrid};
use ndarray::{Array2, Ix2};
use pyo3::prelude::*;

use crate::{
    camera::Camera,
    errors::{exception, guarded},
    input::owned_f32,
    lens::Lens,
    paintings::painting_folder,
    restorer::quality_of,
    scene::Scene,
    sensor::Sensor,
    serial::from_python,
    shot::Shot,
};

/// Makes a lens again of the text of its file fully open, how far its stop is open, what becomes of glasses beyond their range, and what covers the
/// surfaces of which its file says nothing; pickles call it.
#[pyfunction]
pub(crate) fn _restore_lens(
    text: &str,
    stop_mm: f64,
    glass_range: &Bound<'_, PyAny>,
    other_coating: &Bound<'_, PyAny>,
    notes: Vec<String>,
    choice: &Bound<'_, PyAny>,
) -> PyResult<Lens> {
    let choice: Option<(LensSpec, LensReadOptions, StopSpec, Option<Iris>)> = from_python("the lens", choice)?;
    let other_coating: Option<Coating> = from_python("the lens", other_coating)?;
    let glass_range: GlassRange = from_python("the lens", glass_range)?;
    let file = LensFile::from_bytes(Path::new("lens.ron"), text.as_bytes(), &ReadOptions::default());
    let file = file.map_err(exception)?;
    let lens = file.lens.with_stop_diameter_mm(stop_mm).map_err(exception)?.with_glass_range(glass_range);
    let lens = lens.with_light_loss(other_coating).map_err(exception)?;
    let file = LensFile { lens, notes, ..file };
    Ok(match choice {
        Some((lens, reading, stop, iris)) => Lens::restored(file, Some((lens, reading)), (stop, iris)),
        None => Lens::restored(file, None, (StopSpec::AsGiven, None)),
    })
}

/// Makes a sensor again; pickles call it.
#[pyfunction]
pub(crate) fn _restore_sensor(text: &str, spec: &Bound<'_, PyAny>) -> PyResult<Sensor> {
    let spec: Option<SensorSpec> = from_python("the sensor", spec)?;
    Ok(Sensor::restored(SensorSheet::from_ron(text, "the data sheet").map_err(exception)?, spec))
}

/// Makes a scene again that a camera file can say; pickles call it.
#[pyfunction]
pub(crate) fn _restore_scene_spec(spec: &Bound<'_, PyAny>) -> PyResult<Scene> {
    let spec: SceneSpec = from_python("the scene", spec)?;
    Ok(Scene::of_choice(spec))
}

/// Makes a scene of arrays again: its name, bands, planes, depth, focal length and axis in samples, light and notes; pickles call it.
#[pyfunction]
#[pyo3(signature = (name, wavelengths_nm, planes, depth_m, view, light, notes))]
pub(crate) fn _restore_scene(
    name: String,
    wavelengths_nm: Vec<f64>,
    planes: Vec<Bound<'_, PyAny>>,
    depth_m: &Bound<'_, PyAny>,
    view: [f64; 3],
    light: &Bound<'_, PyAny>,
    notes: Vec<String>,
) -> PyResult<Scene> {
    let light: Option<(dioptric_spectrum::Illuminant, Option<f64>)> = from_python("the light", light)?;
    let planes = planes.iter().map(plane).collect::<PyResult<Vec<_>>>()?;
    let depth = plane(depth_m)?;
    guarded(|| {
        let grid = WavelengthGrid::new(wavelengths_nm).map_err(exception)?;
        let radiance = SpectralImage::new(Quantity::Radiance, grid, planes).map_err(exception)?;
        let mut scene = RadianceScene::new(name, radiance);
        let [focal_px, center_x_px, center_y_px] = view;
        scene.view = Some(View { focal_px, center_x_px, center_y_px });
        scene.depth = Some(DepthMap::new(depth).map_err(exception)?);
        scene.light = light.map(|(illuminant, illuminance_lux)| SceneLight { illuminant, illuminance_lux });
        scene.notes = notes;
        scene.validate().map_err(exception)?;
        Ok(Scene::of_radiance(scene))
    })
}

fn plane(samples: &Bound<'_, PyAny>) -> PyResult<Array2<f32>> {
    let plane = owned_f32("samples", samples, "(rows, columns)", &[2])?;
    Ok(plane.into_dimensionality::<Ix2>().expect("two axes were checked"))
}

/// Makes a camera again, with the parts of it that are in no file; pickles call it.
#[pyfunction]
#[pyo3(signature = (text, lens, scene, sensor))]
pub(crate) fn _restore_camera(
    py: Python<'_>,
    text: &str,
    lens: Option<Py<Lens>>,
    scene: Option<Py<Scene>>,
    sensor: Option<Py<Sensor>>,
) -> PyResult<Camera> {
    let file = guarded(|| CameraFile::parse(text, Path::new("camera.ron")).map_err(exception))?;
    let kept = KeptCamera::new(file.clone()).with_paintings(painting_folder(py));
    let mut given = kept.given().clone();
    given.lens = lens.map(|lens| lens.get().given());
    given.scene = scene.map(|scene| scene.get().given(py)).transpose()?;
    given.sensor = sensor.map(|sensor| sensor.get().given());
    Ok(Camera::new(kept.with_camera(file, given)))
}

/// Takes a shot again from its irradiance, a cube or one a photodiode, without imaging the scene; pickles call it.
#[pyfunction]
pub(crate) fn _restore_shot(
    py: Python<'_>,
    camera: Py<Camera>,
    quality: &str,
    imaged: &Bound<'_, PyAny>,
    wavelengths_nm: Vec<f64>,
    cubes: Vec<Vec<Bound<'_, PyAny>>>,
) -> PyResult<Shot> {
    let imaged: Imaged = from_python("the shot", imaged)?;
    let quality = quality_of(quality).unwrap_or(Quality::Full);
    let grid = WavelengthGrid::new(wavelengths_nm).map_err(exception)?;
    let picture = |planes: &Vec<Bound<'_, PyAny>>| -> PyResult<SpectralImage> {
        let planes = planes.iter().map(plane).collect::<PyResult<Vec<_>>>()?;
        SpectralImage::new(Quantity::Irradiance, grid.clone(), planes).map_err(exception)
    };
    let pictures = cubes.iter().map(picture).collect::<PyResult<Vec<_>>>()?;
    let kept = camera.get().kept().with_quality(quality);
    guarded(|| kept.keep_imaged(imaged, pictures).map_err(exception))?;
    Shot::take(py, kept, &crate::worker::Follower::nobody())
}
