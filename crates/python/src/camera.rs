//! The camera.

use std::{path::PathBuf, sync::Arc};

use dioptric_analysis::MethodComparison;
use dioptric_pipeline::{
    ArrayFrame, Camera as CameraFile, Given, KeptCamera, RenderEffort, SceneSource, StopSpec, parse_bytes,
};
use ndarray::Array3;
use pyo3::{
    IntoPyObjectExt,
    prelude::*,
    types::{PyDict, PyTuple},
};

use crate::{
    changes::{all, changed},
    errors::{exception, guarded, wrong},
    lens::Lens,
    light_field::LightField,
    options::{count, word},
    paintings::painting_folder,
    restorer::{quality_of, restorer},
    scene::Scene,
    sensor::Sensor,
    serial::{from_python, to_python},
    shot::Shot,
    video::Video,
    view::view,
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

    /// The camera with what is kept.
    pub(crate) fn kept(&self) -> &KeptCamera {
        &self.kept
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
    /// coating : str
    ///     What covers all surfaces between air and glass: "bare", "mgf2", "vcoat", "bbar", a file, or "ideal" for no loss of light.
    /// blades, blade_rotation_deg, blade_curvature : int, float, float
    ///     The blades that close the stop, 3 to 64; the turn of their opening from one with a corner at its top; 0 for straight edges to 1
    ///     for edges as curved as the rim.
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
    /// psfs : path
    ///     A file of point spread functions (``.npz``) in place of those of the lens; "none" for the lens's own.
    /// blur : {"layered", "pointwise", "views:N"}
    ///     Layers of depth; each sample on its own, as in the paper; layers through N parts of the pupil.
    /// border : {"hold", "mirror", "black"}
    ///     What the lens sees beyond the ends of the scene: the samples at its border, the scene mirrored, or nothing.
    /// lens_reflections : {"off", "ghosts", "film:R"}
    ///     Light that surfaces of the lens reflect: left out, or what two of them reflect falls on the film; the film one of them, a mirror that
    ///     reflects the share R of its light.
    /// scene : Scene or path
    /// fov_deg, depth_m, width_mm, distance_mm, fill_depth, hidden, points, white_level, quantity, unit, scale, scene_wavelengths_nm, variable,
    /// axes, no_data, depth, depth_unit, depth_kind, depth_variable, view, panorama
    /// illuminant, illuminance_lux, scene_light, mean_luminance_cd_m2
    ///     Of the scene, as of `Scene.read`.
    /// mean_lux : float
    ///     Scales the light of the scene so that the film gets this illuminance on average, lux.
    /// wavelengths_nm : list of float, or "scene"
    ///     The bands that are simulated.
    /// exposure_s : float, or "auto"
    /// analog_gain : float
    /// gain_mode : {"low", "high"}
    ///     Readout of dual-gain pixels.
    /// binning : str
    ///     Pixels of one filter that are read as one: "charge:2" (electrons summed before they are read), "voltage:2" (the mean after the
    ///     source followers), "digital:2" (numbers summed), "none".
    /// temperature_c : float
    ///     Of the chip.
    /// metering : str
    ///     What an automatic exposure looks at: "mean", "center", "peak", "percentile:99", "filters:99".
    /// chip_seed : int
    ///     Which chip of its kind the sensor is.
    /// noise : str
    ///     Sources: "all", "none", "photon,read", "all,-defects".
    /// burst : int
    /// bracket_stops : list of float
    ///     Several frames, merged.
    /// both_gains : bool
    ///     Whether each pixel is read with both gains of a dual-gain sensor, merged.
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
    #[pyo3(signature = (**changes), text_signature = "($self, *, name=None, lens=None, f_number=None, stop_mm=None, coating=None, blades=None, blade_rotation_deg=None, blade_curvature=None, focus_mm=None, film_mm=None, tilt_deg=None, \
swing_deg=None, rise_mm=None, shift_mm=None, sensor=None, film=None, crop=None, pixels=None, pixel_um=None, \
dual_pixel=None, filters=None, diffraction=None, gamma=None, psfs=None, blur=None, border=None, lens_reflections=None, bank=None, bank_error=None, \
scene=None, fov_deg=None, depth_m=None, width_mm=None, distance_mm=None, fill_depth=None, hidden=None, points=None, \
white_level=None, quantity=None, unit=None, scale=None, scene_wavelengths_nm=None, variable=None, axes=None, \
no_data=None, depth=None, depth_unit=None, depth_kind=None, depth_variable=None, view=None, panorama=None, illuminant=None, \
illuminance_lux=None, scene_light=None, mean_luminance_cd_m2=None, mean_lux=None, wavelengths_nm=None, \
exposure_s=None, analog_gain=None, gain_mode=None, binning=None, temperature_c=None, metering=None, chip_seed=None, noise=None, burst=None, bracket_stops=None, both_gains=None, interleaved_ratio=None, \
interleaved_gain_ratio=None, seed=None, white=None, demosaic=None, denoise=None, highlights=None, \
lens_corrections=None, color=None, sharpen_px=None, local_tone=None, perspective=None, brightness=None, curve=None, \
space=None, defect_threshold=None)")]
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
        let Some(quality) = quality_of(quality) else {
            return Err(wrong("quality", format!("'{quality}'"), "'full', 'draft', 'preview' or 'sketch'"));
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

    /// Takes the frames of a video one after the other: how the camera turns is that of its file, with what is given changed.
    ///
    /// Parameters
    /// ----------
    /// frames : int
    /// frames_per_s : float
    /// row_time_us : float
    ///     From one row's readout to the next, 0 for a global shutter; that of the sensor without it.
    /// pan_deg_per_s, tilt_deg_per_s, roll_deg_per_s : float
    ///     To the right, upwards and clockwise.
    /// shake_deg, shake_hz : float
    ///     Standard deviation of the shake of a hand, and the middle of its frequencies.
    /// progress : bool or callable
    ///     As of `render`, for what all frames are taken from.
    ///
    /// Returns
    /// -------
    /// Video, whose frames are taken when they are asked for.
    #[pyo3(signature = (*, frames=None, frames_per_s=None, row_time_us=None, pan_deg_per_s=None, tilt_deg_per_s=None,
        roll_deg_per_s=None, shake_deg=None, shake_hz=None, progress=None))]
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    fn video(
        &self,
        py: Python<'_>,
        frames: Option<&Bound<'_, PyAny>>,
        frames_per_s: Option<f64>,
        row_time_us: Option<f64>,
        pan_deg_per_s: Option<f64>,
        tilt_deg_per_s: Option<f64>,
        roll_deg_per_s: Option<f64>,
        shake_deg: Option<f64>,
        shake_hz: Option<f64>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Video> {
        let mut spec = self.kept.camera().video.unwrap_or_default();
        if let Some(value) = frames {
            spec.frames = count("frames", value)?;
        }
        spec.row_time_us = row_time_us.or(spec.row_time_us);
        let motion = &mut spec.motion;
        for (place, given) in [
            (&mut spec.frames_per_s, frames_per_s),
            (&mut motion.pan_deg_per_s, pan_deg_per_s),
            (&mut motion.tilt_deg_per_s, tilt_deg_per_s),
            (&mut motion.roll_deg_per_s, roll_deg_per_s),
            (&mut motion.shake_deg, shake_deg),
            (&mut motion.shake_hz, shake_hz),
        ] {
            *place = given.unwrap_or(*place);
        }
        let kept = self.kept.with(|camera| camera.video = Some(spec));
        kept.camera().validate().map_err(exception)?;
        run(py, &Follower::of(progress)?, |progress, cancel| Ok(Video::new(kept.video(progress, cancel)?)))
    }

    /// Takes the light field of a camera with an array before its film, or of a raster of cameras, as its file's ``light_field`` has it; the
    /// scene must be a world.
    ///
    /// Parameters
    /// ----------
    /// views : int, optional
    ///     Along each side of the pupil behind an array; one a pixel across its image without it.
    /// frame : path, optional
    ///     A frame that was taken behind the array, a DNG file or an EXR file of linear light; rendered now without it.
    /// white : path, optional
    ///     A frame of an even white, which evens out the other and shows where the array is.
    /// progress : bool or callable
    ///     As of `render`.
    ///
    /// Returns
    /// -------
    /// LightField
    #[pyo3(signature = (*, views=None, frame=None, white=None, progress=None))]
    fn light_field(
        &self,
        py: Python<'_>,
        views: Option<&Bound<'_, PyAny>>,
        frame: Option<PathBuf>,
        white: Option<PathBuf>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<LightField> {
        let n_views = views.map(|value| count("views", value)).transpose()?;
        if white.is_some() && frame.is_none() {
            return Err(wrong("white", "given", "none without a frame"));
        }
        run(py, &Follower::of(progress)?, |progress, cancel| {
            let Some(frame) = &frame else {
                return Ok(LightField::new(self.kept.light_field(n_views, progress, cancel)?));
            };
            let frame = ArrayFrame::read(frame, white.as_deref())?;
            Ok(LightField::new(self.kept.decoded_frame(&frame, n_views, progress, cancel)?.0))
        })
    }

    /// Renders the world before the camera both ways, rays from the film against its view blurred by point spread functions, and compares
    /// them.
    ///
    /// Parameters
    /// ----------
    /// samples : int, optional
    ///     A pixel, of both; those of the scene without it.
    /// progress : bool or callable
    ///     As of `render`.
    ///
    /// Returns
    /// -------
    /// dict, with the keys of ``dioptric compare --json``, and ``backward`` and ``forward``, both pictures as an observer sees them, linear
    /// sRGB in lux, (rows, columns, 3) float32.
    #[pyo3(signature = (*, samples=None, progress=None))]
    fn compare_methods<'py>(
        &self,
        py: Python<'py>,
        samples: Option<&Bound<'py, PyAny>>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.kept.given().check_none().map_err(exception)?;
        let mut camera = self.kept.camera().clone();
        if let (Some(value), SceneSource::World(world)) = (samples, &mut camera.scene.source) {
            let n = u32::try_from(count("samples", value)?).map_err(|_| wrong("samples", value, "a smaller number"))?;
            world.effort = RenderEffort::Samples(n);
        }
        camera.validate().map_err(exception)?;
        let comparison =
            run(py, &Follower::of(progress)?, |progress, cancel| MethodComparison::of(&camera, progress, cancel))?;
        let numbers = to_python(py, &comparison)?;
        for (key, picture) in [("backward", &comparison.backward), ("forward", &comparison.forward)] {
            let planes = &picture.planes;
            let (rows, columns) = planes[0].dim();
            let samples = Array3::from_shape_fn((rows, columns, 3), |(row, column, k)| planes[k][(row, column)]);
            numbers.set_item(key, view(py, &Arc::new(samples), |samples| samples.view())?)?;
        }
        Ok(numbers)
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

    /// Cameras are equal when their files are, and what was made in Python: large contents are compared where they are not the same.
    fn __eq__(&self, other: &Self) -> bool {
        fn alike<T: PartialEq>(own: Option<&Given<T>>, other: Option<&Given<T>>) -> bool {
            own == other || matches!((own, other), (Some(own), Some(other)) if **own == **other)
        }
        let (own, others) = (self.kept.given(), other.kept.given());
        self.kept.camera() == other.kept.camera()
            && alike(own.lens.as_ref(), others.lens.as_ref())
            && alike(own.sensor.as_ref(), others.sensor.as_ref())
            && alike(own.scene.as_ref(), others.scene.as_ref())
    }

    fn __repr__(&self) -> String {
        format!("<Camera {}>", self.name())
    }

    /// Copies by the text of the camera file and the parts that were made in Python, so that cameras can be sent to other processes;
    /// what is kept stays here.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (camera, given) = (self.kept.camera(), self.kept.given());
        let lens = given.lens.as_ref().map(|lens| Lens::restored((**lens).clone(), None, (StopSpec::AsGiven, None)));
        let scene = given.scene.as_ref().map(|_| Scene::of_camera(&self.kept));
        let sensor = given.sensor.as_ref().map(|sheet| Sensor::restored((**sheet).clone(), None));
        let arguments = [
            camera.to_ron().into_bound_py_any(py)?,
            lens.into_bound_py_any(py)?,
            scene.into_bound_py_any(py)?,
            sensor.into_bound_py_any(py)?,
        ];
        Ok((restorer(py, "_restore_camera")?, PyTuple::new(py, arguments)?))
    }

    fn __copy__(own: Py<Self>) -> Py<Self> {
        own
    }

    fn __deepcopy__(own: Py<Self>, memo: &Bound<'_, PyAny>) -> Py<Self> {
        let _ = memo;
        own
    }
}
