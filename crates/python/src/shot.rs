//! What came of a camera.

use std::{
    path::{Path, PathBuf},
    sync::{Arc, OnceLock},
};

use dioptric_analysis::{Run, RunReport};
use dioptric_pipeline::{
    Capture, IRRADIANCE_FILE, Imaged, Irradiance, KeptCamera, PipelineError, Quality, Staged, picture_png, write_file,
    write_frames, write_json,
};
use dioptric_psf::LensImageModel;
use dioptric_scene::write_planes_exr;
use dioptric_spectrum::{Bands, DepthMap};
use ndarray::{Array2, Array3, ArrayView1, Axis};
use pyo3::{
    IntoPyObjectExt,
    prelude::*,
    types::{PyBytes, PyDict, PyTuple},
};

use crate::{
    camera::Camera,
    changes::{changed, of_exposure, of_picture},
    errors::exception,
    restorer::restorer,
    save::{is_picture, write_picture},
    serial::to_python,
    view::{plane_or_planes, raw_planes, rgb8, view},
    worker::{Follower, run},
};

/// A picture that was taken, with every stage that led to it.
///
/// Arrays are read-only views of the results; they hold what they need, and outlive the shot. Row 0 is the top, upright as the
/// photographer sees it.
#[pyclass(frozen, module = "dioptric")]
pub(crate) struct Shot {
    kept: KeptCamera,
    capture: Arc<Capture>,
    /// Irradiance that was kept in a file, once it was asked for.
    read: OnceLock<Arc<Array3<f32>>>,
    rgb: OnceLock<Arc<Array3<u8>>>,
}

impl Shot {
    /// The results.
    pub(crate) fn capture(&self) -> &Capture {
        &self.capture
    }

    /// Takes the picture of a camera.
    pub(crate) fn take(py: Python<'_>, kept: KeptCamera, follower: &Follower) -> PyResult<Self> {
        let capture = run(py, follower, |progress, cancel| kept.capture(progress, cancel))?;
        Ok(Self { kept, capture: Arc::new(capture), read: OnceLock::new(), rgb: OnceLock::new() })
    }

    /// Takes the picture again with a change that images nothing.
    fn again(
        &self,
        py: Python<'_>,
        function: &str,
        changes: Option<&Bound<'_, PyDict>>,
        known: &[&str],
    ) -> PyResult<Self> {
        let kept = changed(function, &self.kept, changes, known)?;
        kept.keep(&self.capture);
        Self::take(py, kept, &Follower::nobody())
    }

    /// Returns views of the planes of a frame.
    fn planes<'py>(
        &self,
        py: Python<'py>,
        pick: impl Fn(&Capture) -> &Vec<Array2<f32>>,
    ) -> PyResult<Vec<Bound<'py, PyAny>>> {
        (0..pick(&self.capture).len()).map(|n| view(py, &self.capture, |capture| pick(capture)[n].view())).collect()
    }

    fn model_and_depth(&self, py: Python<'_>) -> PyResult<(Arc<LensImageModel>, Arc<DepthMap>)> {
        self.kept.keep(&self.capture);
        run(py, &Follower::nobody(), |progress, cancel| {
            Ok((self.kept.model(progress, cancel)?, self.kept.depth(progress, cancel)?))
        })
    }
}

#[pymethods]
impl Shot {
    /// The camera that took it.
    #[getter]
    fn camera(&self) -> Camera {
        Camera::new(self.kept.with_quality(Quality::Full))
    }

    /// How finely it was simulated: "full", "draft", "preview" or "sketch".
    #[getter]
    fn quality(&self) -> &'static str {
        match self.capture.quality {
            Quality::Full => "full",
            Quality::Draft => "draft",
            Quality::Preview => "preview",
            Quality::Sketch => "sketch",
        }
    }

    /// Rows and columns of the picture.
    #[getter]
    fn shape(&self) -> (usize, usize) {
        let picture = &self.capture.developed.picture;
        (picture.rows(), picture.columns())
    }

    /// Distance between the samples of the irradiance on the film, µm.
    #[getter]
    fn pitch_um(&self) -> f64 {
        self.capture.place.pitch_um
    }

    /// Distance of the film behind the last vertex, mm.
    #[getter]
    fn film_mm(&self) -> f64 {
        self.capture.place.film_distance_mm
    }

    /// How long the shutter was open, s, as given or metered.
    #[getter]
    fn exposure_s(&self) -> f64 {
        self.capture.frames.exposure.time_s
    }

    /// Centers of the bands, nm; (bands,) float64.
    #[getter]
    fn wavelengths_nm<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        view(py, &self.capture, |capture| ArrayView1::from(capture.grid().centers_nm()))
    }

    /// Spectral irradiance on the film, W m⁻² nm⁻¹; (bands, rows, columns) float32.
    ///
    /// A view; where it was kept in a file (``memory_bytes`` of `Camera.render`), read at the first access.
    #[getter]
    fn irradiance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let irradiance = &self.capture.irradiance;
        if !irradiance.is_spilled() {
            return view(py, irradiance, |irradiance| irradiance.cube().expect("it is in memory"));
        }
        if self.read.get().is_none() {
            let cube = run(py, &Follower::nobody(), |_, cancel| -> Result<_, PipelineError> {
                let (rows, columns) = irradiance.size();
                let mut cube = Array3::zeros((irradiance.grid().len(), rows, columns));
                for (band, mut plane) in cube.axis_iter_mut(Axis(0)).enumerate() {
                    cancel.check()?;
                    plane.assign(&*irradiance.band(band)?);
                }
                Ok(cube)
            })?;
            self.read.get_or_init(|| Arc::new(cube));
        }
        view(py, self.read.get().expect("it was read"), |cube| cube.view())
    }

    /// Mean rate of photo-electrons, electrons a second; (rows, columns) float32, or a tuple, one a filter, of a sensor of stacked
    /// filters.
    #[getter]
    fn electron_rate<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plane_or_planes(py, self.planes(py, |capture| &capture.rate.planes_e_per_s)?)
    }

    /// Electrons at the end of the exposure, with shot noise; (rows, columns) float32, or a tuple, one a filter.
    #[getter]
    fn electrons<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plane_or_planes(py, self.planes(py, |capture| &capture.frames.exposed.electrons.planes_e)?)
    }

    /// Voltages at the pixels' outputs before the analog gain, V; (rows, columns) float32, or a tuple, one a filter.
    #[getter]
    fn volts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plane_or_planes(py, self.planes(py, |capture| &capture.frames.exposed.volts.planes_v)?)
    }

    /// The frame as the converter gives it: digital numbers, (rows, columns) uint16; float32 volts without a converter; a tuple,
    /// one a filter, of a sensor of stacked filters.
    #[getter]
    fn raw<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plane_or_planes(py, raw_planes(py, &self.capture, |capture| &capture.frames.exposed.raw)?)
    }

    /// The levels of `raw`: ``black``, ``white`` (saturation) and ``top`` samples, ``step_v`` from one sample to the next, V, and
    /// ``volts_per_electron`` after the gain.
    #[getter]
    fn levels<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let levels = &self.capture.frames.exposed.raw.levels;
        let dict = PyDict::new(py);
        for (key, value) in [
            ("black", levels.black),
            ("white", levels.white),
            ("top", levels.top),
            ("step_v", levels.step_v),
            ("volts_per_electron", levels.volts_per_electron),
        ] {
            dict.set_item(key, value)?;
        }
        Ok(dict)
    }

    /// The picture's codes, 0-1; (rows, columns, 3) float32.
    #[getter]
    fn picture<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        view(py, &self.capture.developed, |developed| developed.picture.codes.view())
    }

    /// The picture's 8-bit codes, those of ``picture.png``; (rows, columns, 3) uint8, rounded at the first access.
    #[getter]
    fn rgb<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let rgb = self.rgb.get_or_init(|| rgb8(&self.capture.developed.picture));
        view(py, rgb, |rgb| rgb.view())
    }

    /// Depth of the scene's samples along the axis, m; (scene rows, scene columns) float32.
    #[getter]
    fn depth_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let kept = &self.kept;
        let depth = run(py, &Follower::nobody(), |progress, cancel| kept.depth(progress, cancel))?;
        view(py, &depth, |depth| depth.z_m().view())
    }

    /// Returns which object of a world each pixel sees in its middle.
    ///
    /// Returns
    /// -------
    /// labels : ndarray of uint32, (rows, columns)
    ///     The number of the object plus 1; 0 where there is none.
    /// names : list of str
    ///     The names of the objects, in the order of their numbers.
    fn objects<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Vec<String>)> {
        let kept = &self.kept;
        let (labels, names) = run(py, &Follower::nobody(), |progress, cancel| kept.objects(progress, cancel))?;
        let labels = view(py, &Arc::new(labels), |labels| labels.view())?;
        Ok((labels, names))
    }

    /// Returns what was measured: lens, film, scene, bank, irradiance, sensor statistics, losses; the keys of ``report.json``.
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let (model, depth) = self.model_and_depth(py)?;
        let capture = &*self.capture;
        let report = run(py, &Follower::nobody(), |_, _| {
            RunReport::new(&Run { capture, model: &model, depth: Some(&depth) }, Vec::new())
        })?;
        to_python(py, &report)
    }

    /// Takes the picture again under another exposure; the scene is not imaged again, whatever was rendered since.
    ///
    /// Parameters
    /// ----------
    /// seed, exposure_s, analog_gain, gain_mode, binning, temperature_c, metering, chip_seed, noise, burst, bracket_stops, white, demosaic, denoise, highlights, lens_corrections,
    /// color, sharpen_px, local_tone, perspective, brightness, curve, space, defect_threshold
    ///     As of `Camera.with_`.
    ///
    /// Returns
    /// -------
    /// Shot
    #[pyo3(signature = (**changes), text_signature = "($self, *, seed=None, exposure_s=None, analog_gain=None, gain_mode=None, binning=None, temperature_c=None, metering=None, chip_seed=None, noise=None, burst=None, bracket_stops=None, \
both_gains=None, interleaved_ratio=None, interleaved_gain_ratio=None, white=None, demosaic=None, denoise=None, highlights=None, \
lens_corrections=None, color=None, sharpen_px=None, local_tone=None, perspective=None, brightness=None, curve=None, \
space=None, defect_threshold=None)")]
    fn expose(&self, py: Python<'_>, changes: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        self.again(py, "expose", changes, &of_exposure())
    }

    /// Develops the same frames otherwise.
    ///
    /// Parameters
    /// ----------
    /// white, demosaic, denoise, highlights, lens_corrections, color, sharpen_px, local_tone, perspective, brightness, curve, space,
    /// defect_threshold
    ///     As of `Camera.with_`.
    ///
    /// Returns
    /// -------
    /// Shot
    #[pyo3(signature = (**changes), text_signature = "($self, *, white=None, demosaic=None, denoise=None, highlights=None, lens_corrections=None, color=None, \
sharpen_px=None, local_tone=None, perspective=None, brightness=None, curve=None, space=None, defect_threshold=None)")]
    fn develop(&self, py: Python<'_>, changes: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        self.again(py, "develop", changes, &of_picture())
    }

    /// Returns the picture as the bytes of a PNG file, equal to the ``picture.png`` of ``dioptric run``.
    fn png<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let developed = &self.capture.developed;
        let png = run(py, &Follower::nobody(), |_, _| picture_png(&developed.picture))?;
        Ok(PyBytes::new(py, &png))
    }

    /// Writes the picture to a path that ends in ``.png``, else everything into a folder.
    ///
    /// A folder gets what ``dioptric run`` writes and the camera's ``outputs`` ask for, but for the page ``report.html``:
    /// ``picture.png``, ``irradiance.exr``, ``depth.exr``, ``volts.exr``, ``raw.png``, ``report.json``, and ``camera.ron`` and
    /// ``kept.ron``, from which a run continues, where files can name all parts. Files appear whole or not at all.
    ///
    /// Returns
    /// -------
    /// list of str, the names of the files.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<Vec<String>> {
        if is_picture(&path)? {
            return run(py, &Follower::nobody(), |_, _| write_picture(&self.capture.developed.picture, &path));
        }
        let (model, depth) = self.model_and_depth(py)?;
        run(py, &Follower::nobody(), |_, _| {
            let staged = Staged::folder(&path)?;
            let files = self.write_into(staged.path(), &model, &depth)?;
            staged.commit()?;
            Ok(files)
        })
    }

    /// Returns all stages as an ``xarray.Dataset``, with coordinates in nm and mm and units; needs xarray, which
    /// ``pip install dioptric[xarray]`` brings.
    fn to_xarray<'py>(slf: Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("dioptric._xarray")?.call_method1("dataset", (slf,))
    }

    /// Copies by the camera and the irradiance, so that shots can be sent to other processes: the frames are taken again there with
    /// their seeds, to the bit.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let capture = &*self.capture;
        let of_one = |irradiance: &Irradiance| -> PyResult<Vec<Bound<'py, PyAny>>> {
            let band = |band| {
                let plane = irradiance.band(band).map_err(exception)?.into_owned();
                view(py, &Arc::new(plane), |plane| plane.view())
            };
            (0..irradiance.grid().len()).map(band).collect()
        };
        let photodiodes = capture.irradiance.photodiodes();
        let cubes = match photodiodes.is_empty() {
            true => vec![of_one(&capture.irradiance)?],
            false => photodiodes.iter().map(of_one).collect::<PyResult<_>>()?,
        };
        let arguments = [
            self.camera().into_bound_py_any(py)?,
            self.quality().into_bound_py_any(py)?,
            to_python(py, &Imaged::of(capture))?,
            capture.grid().centers_nm().into_bound_py_any(py)?,
            cubes.into_bound_py_any(py)?,
        ];
        Ok((restorer(py, "_restore_shot")?, PyTuple::new(py, arguments)?))
    }

    fn __copy__(own: Py<Self>) -> Py<Self> {
        own
    }

    fn __deepcopy__(own: Py<Self>, memo: &Bound<'_, PyAny>) -> Py<Self> {
        let _ = memo;
        own
    }

    fn _repr_png_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        self.png(py)
    }

    fn _repr_html_<'py>(slf: Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("dioptric._html")?.call_method1("shot", (slf,))
    }

    fn __repr__(&self) -> String {
        let place = &self.capture.place;
        let bands = self.capture.grid().len();
        let name = &self.capture.camera.name;
        format!("<Shot {name}: {} × {} pixels, {bands} bands, {:.4} s>", place.columns, place.rows, self.exposure_s())
    }
}

impl Shot {
    fn write_into(
        &self,
        folder: &Path,
        model: &LensImageModel,
        depth: &DepthMap,
    ) -> Result<Vec<String>, PipelineError> {
        let capture = &*self.capture;
        let outputs = &capture.camera.outputs;
        let mut files = Vec::new();
        if outputs.irradiance {
            capture.irradiance.write_exr_under(
                &capture.white_of(),
                &folder.join(IRRADIANCE_FILE),
                outputs.exr_samples,
            )?;
            files.push(IRRADIANCE_FILE.to_owned());
        }
        if outputs.depth {
            write_planes_exr(&folder.join("depth.exr"), &[("Z", depth.z_m())], outputs.exr_samples)?;
            files.push("depth.exr".to_owned());
        }
        files.extend(write_frames(&capture.frame_parts(), &capture.developed.picture, outputs, folder)?.0);
        if self.kept.given().check_none().is_ok() {
            write_file(&folder.join("camera.ron"), capture.camera.to_ron().as_bytes())?;
            files.push("camera.ron".to_owned());
            if outputs.irradiance && capture.quality == Quality::Full {
                self.kept.write_resume_file(capture, folder)?;
                files.push(dioptric_pipeline::RESUME_FILE.to_owned());
            }
        }
        let report = RunReport::new(&Run { capture, model, depth: Some(depth) }, files.clone())?;
        write_json(&folder.join("report.json"), &report)?;
        files.push("report.json".to_owned());
        Ok(files)
    }
}
