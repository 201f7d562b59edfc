//! The camera.

use std::path::PathBuf;

use dioptric_pipeline::{Camera as CameraFile, KeptCamera, Quality, parse_bytes};
use pyo3::{
    prelude::*,
    types::{PyDict, PyType},
};

use crate::{
    changes::{all, changed},
    errors::{exception, guarded, wrong},
    lens::Lens,
    options::word,
    paintings::painting_folder,
    scene::Scene,
    sensor::Sensor,
    serial::{from_python, to_python},
    shot::Shot,
    worker::{Follower, run},
};

/// A camera and what stands before it. It never changes: `with_` returns another.
///
/// Cameras that come from one another share the results of their stages, so that only what a change touches is computed: another
/// exposure, sensor or processing never images the scene again.
#[pyclass(frozen, module = "dioptric")]
pub(crate) struct Camera {
    kept: KeptCamera,
}

impl Camera {
    pub(crate) fn new(kept: KeptCamera) -> Self {
        Self { kept }
    }

    /// Returns the camera of a camera file; paintings of the still life are kept in the user's cache, as the program does.
    pub(crate) fn of_file(py: Python<'_>, file: CameraFile) -> Self {
        Self::new(KeptCamera::new(file).with_paintings(painting_folder(py)))
    }
}

#[pymethods]
impl Camera {
    /// Returns the camera of the built-in demo: a still life through a 50 mm double Gauss at f/4, as of ``dioptric run``.
    #[staticmethod]
    fn demo(py: Python<'_>) -> PyResult<Self> {
        guarded(|| Ok(Self::of_file(py, CameraFile::demo().map_err(exception)?)))
    }

    /// Reads a camera file; paths in it are relative to its folder.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        guarded(|| Ok(Self::of_file(py, CameraFile::read(&path).map_err(exception)?)))
    }

    /// Returns the camera of a camera file's text, in RON.
    ///
    /// Parameters
    /// ----------
    /// text : str
    /// folder : str or os.PathLike
    ///     What paths in it are relative to.
    #[staticmethod]
    #[pyo3(signature = (text, folder=None))]
    fn from_ron(py: Python<'_>, text: &str, folder: Option<PathBuf>) -> PyResult<Self> {
        let name = folder.unwrap_or_default().join("camera.ron");
        guarded(|| Ok(Self::of_file(py, CameraFile::parse(text, &name).map_err(exception)?)))
    }

    /// Returns the camera of a dictionary as `to_dict` makes it: the keys of the camera file; what is left out has its default.
    #[staticmethod]
    fn from_dict(data: &Bound<'_, PyDict>) -> PyResult<Self> {
        let file: CameraFile = from_python("the camera", data.as_any())?;
        guarded(|| {
            file.validate().map_err(exception)?;
            Ok(Self::of_file(data.py(), file))
        })
    }

    /// Continues a run from its folder, of ``dioptric run`` or `Shot.save`: what it imaged is taken from there as long as nothing
    /// before it changes.
    #[staticmethod]
    fn resume(py: Python<'_>, folder: PathBuf) -> PyResult<Self> {
        let resumed = run(py, &Follower::nobody(), |_, _| KeptCamera::resume(&folder))?;
        for note in resumed.notes {
            let warn = py.import("warnings")?.getattr("warn")?;
            warn.call1((format!("{note}: the scene is imaged anew"),))?;
        }
        Ok(Self::new(resumed.camera.with_paintings(painting_folder(py))))
    }

    /// Returns the camera with changes, checked now. Names, words and units are those of ``dioptric run``.
    ///
    /// Parameters
    /// ----------
    /// lens : Lens, name or path
    ///     Its stop as it is; what the camera said of the stop of the old lens goes with that.
    /// f_number, stop_mm : float
    ///     How far the stop is open.
    /// focus_mm : float, or "near"
    ///     Distance in focus before the first vertex; "near" for the near part of the scene.
    /// film_mm : float
    ///     The film's place behind the last vertex, in place of a focus.
    /// tilt_deg, swing_deg, rise_mm, shift_mm : float
    ///     The lens turned and moved before the film.
    /// sensor : Sensor, name or path
    ///     The film becomes its pixels, unless ``film`` or ``pixels`` says otherwise.
    /// film : {"sensor", "scene"}
    ///     Whether it has the sensor's pixels or as many as the scene has samples.
    /// crop : (x, y, columns, rows)
    ///     The part of the film that is simulated, pixels from the top left of the picture.
    /// pixels : (columns, rows)
    /// pixel_um : float
    ///     A film of pixels of one's own.
    /// dual_pixel : {"none", "left-right", "top-bottom", "quad", "left-right:CROSSTALK:DEGREES"}
    ///     Reads the photodiodes below each microlens one by one.
    /// filters : list of str
    ///     Filters before the lens: built-in ones, files, ``"nd:0.9"``, ``"longpass:590nm"``, ``"glass:N-BK7:3mm"`` and the like.
    /// diffraction : {"none", "hurb", "hurb-scene3d", "hurb-calibrated", "wave"}
    /// gamma : float
    ///     Strength of HURB.
    /// blur : {"layered", "pointwise", "views:N"}
    ///     Layers of depth; each sample on its own, as in the paper; layers through N parts of the pupil.
    /// border : {"hold", "mirror", "black"}
    ///     What the lens sees beyond the ends of the scene: the samples at its border, the scene mirrored, or nothing.
    /// scene : Scene or path
    /// fov_deg, depth_m, width_mm, distance_mm, fill_depth, hidden, points, white_level, quantity, unit, scale, scene_wavelengths_nm, variable,
    /// axes, no_data, depth, depth_unit, depth_kind, view, panorama
    /// illuminant, illuminance_lux, scene_light, mean_luminance_cd_m2
    ///     Of the scene, as of `Scene.read`.
    /// mean_lux : float
    ///     Scales the light of the scene so that the film gets this illuminance on average, lux.
    /// wavelengths_nm : list of float, or "scene"
    ///     The bands that are simulated.
    /// exposure_s : float, or "auto"
    /// analog_gain : float
    /// noise : str
    ///     Sources: "all", "none", "photon,read", "all,-defects".
    /// burst : int
    /// bracket_stops : list of float
    ///     Several frames, merged.
    /// interleaved_ratio : float
    ///     Pairs of rows exposed for the chosen time and for one so many times shorter in turn, merged.
    /// interleaved_gain_ratio : float
    ///     Pairs of rows read with the chosen analog gain and with one so many times lower in turn, merged.
    /// white, demosaic, highlights, color : str
    /// denoise, sharpen_px : float
    ///     Of the processing.
    /// lens_corrections : str
    ///     Aberrations of the lens that are undone: "all", "none", or of "distortion,lateral-color,vignetting".
    /// local_tone : str
    ///     Factors on the contrast between parts of the picture and within them: "0.6" or "0.6,1.2".
    /// perspective : str
    ///     The corners of the part that is stretched to the whole picture: "0.1,0,0.9,0,1,1,0,1".
    /// brightness : str
    ///     "as-exposed", a factor as "1.5", or a percentile and where it is put as "99%:0.9".
    /// curve : str
    ///     "linear", "srgb", "gamma:0.45", "filmic:0.5".
    /// space : str
    ///     "srgb" or "display-p3".
    /// defect_threshold : float
    ///     How far a lone pixel is off before it is replaced, a share of saturation.
    /// seed : int
    /// name : str
    #[pyo3(signature = (**changes))]
    fn with_(&self, changes: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        guarded(|| Ok(Self::new(changed("with_", &self.kept, changes, &all())?)))
    }

    /// Takes the picture. Other Python threads run meanwhile; Ctrl-C ends it.
    ///
    /// Parameters
    /// ----------
    /// quality : {"full", "draft", "preview", "sketch"}
    ///     Draft: at most 960 columns and 11 bands; preview: 480 and 5; sketch: 160 and 4.
    /// progress : bool or callable
    ///     ``True`` for a bar (tqdm's where that is installed), or a callable of the stage's title and the part of it that is done,
    ///     0-1, called from this thread some 40 times a second.
    /// memory_bytes : int
    ///     Irradiance of more than this is kept in a temporary file. Default 2 GiB.
    /// memory : str or int
    ///     The most that imaging takes, as ``"4GiB"`` or in bytes: scene, plan, bands that are worked on and film; ``--memory`` of the
    ///     program. Results are the same.
    ///
    /// Returns
    /// -------
    /// Shot
    #[pyo3(signature = (*, quality="full", progress=None, memory_bytes=None, memory=None))]
    fn render(
        &self,
        py: Python<'_>,
        quality: &str,
        progress: Option<&Bound<'_, PyAny>>,
        memory_bytes: Option<u64>,
        memory: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Shot> {
        let quality = match quality {
            "full" => Quality::Full,
            "draft" => Quality::Draft,
            "preview" => Quality::Preview,
            "sketch" => Quality::Sketch,
            other => return Err(wrong("quality", format!("'{other}'"), "'full', 'draft', 'preview' or 'sketch'")),
        };
        let mut kept = self.kept.with_quality(quality);
        if let Some(bytes) = memory_bytes {
            kept = kept.with_memory_bytes(bytes);
        }
        if let Some(memory) = memory {
            let budget = match memory.extract::<u64>() {
                Ok(bytes) => bytes,
                Err(_) => parse_bytes(&word("memory", memory)?).map_err(exception)?,
            };
            dioptric_files::memory::allow(Some(budget));
            kept = kept.with_memory_budget(budget);
        }
        Shot::take(py, kept, &Follower::of(progress)?)
    }

    /// What the shot is called.
    #[getter]
    fn name(&self) -> &str {
        &self.kept.camera().name
    }

    /// The lens, its stop set.
    #[getter]
    fn lens(&self) -> PyResult<Lens> {
        guarded(|| Lens::of_camera(&self.kept))
    }

    /// What stands before the camera.
    #[getter]
    fn scene(&self) -> Scene {
        Scene::of_camera(&self.kept)
    }

    /// The sensor.
    #[getter]
    fn sensor(&self) -> PyResult<Sensor> {
        Sensor::of_camera(&self.kept)
    }

    /// Returns how often each stage was run, by this camera and all that share its results.
    fn stage_counts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let counts = self.kept.stage_counts();
        let dict = PyDict::new(py);
        for (stage, count) in [
            ("lens", counts.lens),
            ("scene", counts.scene),
            ("film", counts.film),
            ("bank", counts.bank),
            ("plan", counts.plan),
            ("irradiance", counts.irradiance),
            ("electrons", counts.electrons),
            ("frames", counts.frames),
            ("picture", counts.picture),
        ] {
            dict.set_item(stage, count)?;
        }
        Ok(dict)
    }

    /// Returns the camera as a dictionary with the keys of the camera file. A part that was made in Python shows its name alone.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, self.kept.camera())
    }

    /// Returns the camera as the text of a camera file, which ``dioptric run`` takes.
    ///
    /// Raises ``ValueError`` where a part was made in Python and is in no file.
    fn to_ron(&self) -> PyResult<String> {
        self.kept.given().check_none().map_err(exception)?;
        Ok(self.kept.camera().to_ron())
    }

    /// Writes the camera file.
    fn write(&self, path: PathBuf) -> PyResult<()> {
        let text = self.to_ron()?;
        guarded(|| dioptric_files::write(&path, text.as_bytes()).map_err(exception))
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.kept.camera() == other.kept.camera() && self.kept.given() == other.kept.given()
    }

    fn __repr__(&self) -> String {
        format!("<Camera {}>", self.name())
    }

    /// Copies by the text of the camera file, so that cameras can be sent to other processes; what is kept stays here.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        Ok((PyType::new::<Self>(py).getattr("from_ron")?, (self.to_ron()?,)))
    }
}
