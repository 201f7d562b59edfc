//! Scenes: what stands before the camera.

use std::{
    path::PathBuf,
    sync::{Arc, OnceLock},
};

use dioptric_pipeline::{
    Camera, FileQuantity, Given, KeptCamera, LightPaths, PipelineError, RenderEffort, RenderMethod, SceneSource,
    SceneSpec, WorldLamp, WorldSpec, WorldView, parse_illuminant,
};
use dioptric_scene::{
    ExrSamples, Pattern, Scene as RadianceScene, SceneLight, View, filled_depth, joules_per_photon, reflectance_under,
    write_scene_exr,
};
use dioptric_spectrum::{Illuminant, Quantity, SpectralImage, WavelengthGrid};
use ndarray::{Array2, Array3, ArrayView1, Axis, Ix2, Ix3};
use pyo3::{
    IntoPyObjectExt,
    prelude::*,
    types::{PyDict, PyTuple},
};

use crate::{
    errors::{exception, guarded, wrong},
    input::{self, is_single, number, numbers, owned_f32},
    options::count,
    restorer::restorer,
    scene_options::{fill_of, with_options},
    serial::to_python,
    view::view,
    worker::{Follower, run, run_apart},
    world::_World,
};

/// What stands before the camera: spectral radiance and depth, from arrays, a file, or drawn. It never changes.
///
/// Radiance is W m⁻² sr⁻¹ nm⁻¹ and absolute; depth is metres along the axis from the entrance pupil. Row 0 is the top.
#[pyclass(frozen, module = "dioptric")]
pub(crate) struct Scene {
    source: Source,
    /// The radiance, once it was asked for.
    radiance: OnceLock<Given<RadianceScene>>,
}

enum Source {
    /// A camera file can say it; nothing is read before it is needed.
    Spec(Box<SceneSpec>),
    /// Made of arrays.
    Given(Given<RadianceScene>),
}

impl Scene {
    /// Returns the scene that a camera file says.
    pub(crate) fn of_choice(spec: SceneSpec) -> Self {
        Self { source: Source::Spec(Box::new(spec)), radiance: OnceLock::new() }
    }

    /// Returns the scene of a camera.
    pub(crate) fn of_camera(kept: &KeptCamera) -> Self {
        match &kept.given().scene {
            Some(scene) => Self::of_given(scene.clone()),
            None => Self::of_choice(kept.camera().scene.clone()),
        }
    }

    /// Returns a scene that a program made.
    pub(crate) fn of_radiance(scene: RadianceScene) -> Self {
        Self::of_given(Given::new(scene))
    }

    /// Returns the scene as a part of a camera, read where it is of a file.
    pub(crate) fn given(&self, py: Python<'_>) -> PyResult<Given<RadianceScene>> {
        self.opened(py).cloned()
    }

    fn of_given(scene: Given<RadianceScene>) -> Self {
        Self { source: Source::Given(scene), radiance: OnceLock::new() }
    }

    /// Returns a camera before which this scene stands.
    pub(crate) fn put_into(&self, kept: &KeptCamera) -> KeptCamera {
        match &self.source {
            Source::Spec(spec) => {
                let mut given = kept.given().clone();
                given.scene = None;
                kept.with_camera(Camera { scene: SceneSpec::clone(spec), ..kept.camera().clone() }, given)
            }
            Source::Given(scene) => {
                let bare = SceneSpec::of_file(PathBuf::new());
                kept.with(|camera| camera.scene = bare).with_given_scene(scene.clone())
            }
        }
    }

    fn opened(&self, py: Python<'_>) -> PyResult<&Given<RadianceScene>> {
        if let Some(scene) = self.radiance.get() {
            return Ok(scene);
        }
        let scene = match &self.source {
            Source::Given(scene) => scene.clone(),
            Source::Spec(spec) => {
                let spec = spec.clone();
                run_apart(py, move |_| spec.open(None).map(Given::new))?
            }
        };
        Ok(self.radiance.get_or_init(|| scene))
    }
}

#[pymethods]
impl Scene {
    /// Makes a scene of arrays.
    ///
    /// Parameters
    /// ----------
    /// radiance : array_like, (bands, rows, columns)
    ///     What `quantity` says, finite and not negative; copied, as 32-bit floats.
    /// wavelengths_nm : list of float
    ///     Centers of the bands, ascending.
    /// depth_m : float or array_like (rows, columns)
    ///     Depth along the axis, above 0; ``inf`` is allowed.
    /// fov_deg : float, optional
    ///     Horizontal field of view from edge to edge.
    /// intrinsics : (float, float, float), optional
    ///     In place of it the focal length, and the column and the row of the axis, in samples; their centers are at whole numbers.
    /// quantity : {"radiance", "reflectance", "photons"}
    ///     Spectral radiance, W m⁻² sr⁻¹ nm⁻¹; reflectance, which is lit by ``light`` (D65) of ``illuminance_lux`` (1000); or
    ///     photons s⁻¹ m⁻² sr⁻¹ nm⁻¹.
    /// light : str, optional
    ///     The light on it, where that is known, as ``"D65"``: what white balance goes by.
    /// illuminance_lux : float, optional
    /// fill_depth : {"beside", "far"} or float, optional
    ///     The depth where it is 0 or NaN, as of `Scene.read`.
    /// name : str
    #[staticmethod]
    #[pyo3(signature = (radiance, wavelengths_nm, *, depth_m, fov_deg=None, intrinsics=None, quantity="radiance", light=None,
        illuminance_lux=None, fill_depth=None, name="scene"))]
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    fn from_array(
        radiance: &Bound<'_, PyAny>,
        wavelengths_nm: &Bound<'_, PyAny>,
        depth_m: &Bound<'_, PyAny>,
        fov_deg: Option<f64>,
        intrinsics: Option<[f64; 3]>,
        quantity: &str,
        light: Option<&str>,
        illuminance_lux: Option<f64>,
        fill_depth: Option<&Bound<'_, PyAny>>,
        name: &str,
    ) -> PyResult<Self> {
        let quantity: FileQuantity = quantity.parse().map_err(|error| exception(PipelineError::from(error)))?;
        let fill = fill_depth.map(|value| fill_of("fill_depth", value)).transpose()?;
        if fov_deg.is_some() == intrinsics.is_some() {
            let found = if fov_deg.is_some() { "given beside intrinsics" } else { "missing" };
            return Err(wrong("fov_deg", found, "either a field of view or intrinsics"));
        }
        let cube = owned_f32("radiance", radiance, "(bands, rows, columns)", &[3])?;
        let cube: Array3<f32> = cube.into_dimensionality::<Ix3>().expect("three axes were checked");
        let depth = match is_single(depth_m) {
            true => Array2::from_elem((cube.dim().1, cube.dim().2), number("depth_m", depth_m)? as f32),
            false => {
                let map = owned_f32("depth_m", depth_m, "(rows, columns)", &[2])?;
                map.into_dimensionality::<Ix2>().expect("two axes were checked")
            }
        };
        let wavelengths_nm = numbers("wavelengths_nm", wavelengths_nm)?;
        guarded(|| {
            let make = || -> Result<RadianceScene, PipelineError> {
                let grid = WavelengthGrid::new(wavelengths_nm)?;
                let (_, rows, columns) = cube.dim();
                let planes = cube.axis_iter(Axis(0)).map(|plane| plane.to_owned()).collect();
                let light = light.map(parse_illuminant).transpose()?;
                let (radiance, light) = radiance_of(quantity, grid, planes, light, illuminance_lux)?;
                let mut scene = RadianceScene::new(name, radiance);
                let (depth, note) = filled_depth(name, depth, fill)?;
                scene.depth = Some(depth);
                scene.notes.extend(note);
                scene.view = Some(match (fov_deg, intrinsics) {
                    (None, Some([focal_px, center_x_px, center_y_px])) => View { focal_px, center_x_px, center_y_px },
                    (fov_deg, _) => View::from_horizontal_fov_deg(fov_deg.unwrap_or(f64::NAN), columns, rows)?,
                });
                scene.light = light;
                scene.validate()?;
                Ok(scene)
            };
            Ok(Self::of_given(Given::new(make().map_err(exception)?)))
        })
    }

    /// Reads a scene: a spectral EXR, an ENVI header, a folder of band pictures, or an ordinary picture, which is lifted to
    /// spectra. The file is read when it is needed.
    ///
    /// Parameters
    /// ----------
    /// path : str or os.PathLike
    /// fov_deg : float, optional
    ///     Horizontal field of view, for files that hold none.
    /// depth_m : float, optional
    ///     One depth for all of it, for files that hold none.
    /// width_mm, distance_mm : float, optional
    ///     In place of both a flat scene by its width from edge to edge and its distance from the first vertex of the lens.
    /// fill_depth : {"beside", "far"} or float, optional
    ///     The depth where none was measured: the farther of those beside it, the farthest of the scene, or so many metres.
    /// hidden : str or os.PathLike, optional
    ///     A file of what lies behind the first surface: radiance and depth of the same samples.
    /// points : str or os.PathLike, optional
    ///     A table (``.csv``) of points that shine beside it: stars, LEDs, lamps.
    /// white_level : float, optional
    ///     The number that a perfect white has in a cube that does not state it.
    /// quantity : {"radiance", "reflectance", "photons"}, optional
    /// unit, variable, axes : str, optional
    /// scale : float, optional
    /// scene_wavelengths_nm : list of float, optional
    ///     What a cube's numbers are, where its file does not say so.
    /// no_data : {"black", "fill", "refuse"}, optional
    ///     What becomes of samples that are no light.
    /// depth, view : str or os.PathLike, optional
    ///     Files of the depth and of the camera data, in place of those in the file or beside it.
    /// depth_unit, depth_kind : str, optional
    ///     What the depth's numbers are, as ``"5000/m"``, ``"radial"``, ``"inverse:0.5,20"``, ``"buffer:0.1,100"``,
    ///     ``"disparity:0.193"``.
    /// depth_variable : str, optional
    ///     The channel of an EXR file, or the array of another, that holds the depth; the number of one of several planes of a TIFF.
    /// panorama : str, optional
    ///     A picture of all directions, ``"equirectangular"`` or ``"cube"``, and where a camera in it looks: ``"cube:90,0"``.
    /// illuminant : str, optional
    ///     The light that it is put under, as ``"D65"``, ``"3200K"``, or a CSV file.
    /// illuminance_lux : float, optional
    /// light : str, optional
    ///     The light that is on a file of radiance, which does not state it.
    /// mean_luminance_cd_m2 : float, optional
    ///     Scales the radiance.
    #[staticmethod]
    #[pyo3(signature = (path, **options), text_signature = "(path, *, fov_deg=None, depth_m=None, width_mm=None, distance_mm=None, fill_depth=None, hidden=None, \
points=None, white_level=None, quantity=None, unit=None, scale=None, scene_wavelengths_nm=None, variable=None, \
axes=None, no_data=None, depth=None, depth_unit=None, depth_kind=None, depth_variable=None, view=None, panorama=None, \
illuminant=None, illuminance_lux=None, light=None, mean_luminance_cd_m2=None)")]
    fn read(path: PathBuf, options: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        if !path.exists() {
            let reason = "there is no such file or folder".to_owned();
            return Err(exception(PipelineError::Read { path, reason }));
        }
        Ok(Self::of_choice(with_options("read", SceneSpec::of_file(path), options)?))
    }

    /// Returns a three-dimensional world as the camera sees it from a place.
    ///
    /// Parameters
    /// ----------
    /// path : str, os.PathLike or World
    ///     A file: ``.pbrt``, ``.gltf``, ``.glb``, ``.obj``, ``.ply`` or ``.stl``.
    /// eye, look_at, up : (float, float, float), optional
    ///     Where the center of the entrance pupil stands, what is in the middle of the picture, m, and what is up in it; without ``eye``
    ///     the place of the file's camera, or the whole of the world.
    /// camera : str, optional
    ///     In place of them a camera of the file, by its name or its number from 1; ``"whole"`` to see all of it.
    /// unit_m : float
    ///     Length of the file's unit, m.
    /// time_s : float, optional
    ///     How far the animations of a glTF file have come; without it everything stands as it is written.
    /// animation : str, optional
    ///     Which one moves it, by its name or its number from 1; the first, and others that move what none before them does.
    /// variant : str, optional
    ///     Which of the variants of its materials a glTF file shows; the file's own.
    /// sky : str, optional
    ///     Light from beyond: "even:RADIANCE" (W m⁻² sr⁻¹ nm⁻¹), "day:ELEVATION,AZIMUTH,TURBIDITY", or the path of a picture of all
    ///     directions; of a world without light an even sky.
    /// lamps : list of (x, y, z, lumens), optional
    ///     Lamps that are added, m and lm.
    /// method : {"backward", "forward"}
    ///     Rays from the film through the lens, or the view blurred by its point spread functions.
    /// samples : int
    ///     A pixel. Default 64.
    /// noise : float, optional
    ///     In place of ``samples`` the relative standard error of a pixel.
    /// bounces : int, optional
    ///     How often light is followed over; all of it without it.
    /// size : (columns, rows), optional
    ///     Of the view; that of the file's camera without it.
    /// seed : int
    /// fov_deg, illuminant, ... :
    ///     As of `Scene.read`.
    #[staticmethod]
    #[pyo3(signature = (path, *, eye=None, look_at=None, up=None, camera=None, unit_m=1.0, time_s=None, animation=None, variant=None, sky=None, lamps=None, method="backward",
        samples=None, noise=None, bounces=None, size=None, seed=None, **options), text_signature = "(path, *, eye=None, look_at=None, up=None, camera=None, unit_m=1.0, time_s=None, animation=None, variant=None, sky=None, lamps=None, method='backward', \
samples=None, noise=None, bounces=None, size=None, seed=None, fov_deg=None, depth_m=None, width_mm=None, \
distance_mm=None, fill_depth=None, hidden=None, points=None, white_level=None, quantity=None, unit=None, \
scale=None, scene_wavelengths_nm=None, variable=None, axes=None, no_data=None, depth=None, depth_unit=None, \
depth_kind=None, depth_variable=None, view=None, panorama=None, illuminant=None, illuminance_lux=None, light=None, \
mean_luminance_cd_m2=None)")]
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    fn world(
        path: &Bound<'_, PyAny>,
        eye: Option<(f64, f64, f64)>,
        look_at: Option<(f64, f64, f64)>,
        up: Option<(f64, f64, f64)>,
        camera: Option<&str>,
        unit_m: f64,
        time_s: Option<f64>,
        animation: Option<String>,
        variant: Option<String>,
        sky: Option<&str>,
        lamps: Option<Vec<(f64, f64, f64, f64)>>,
        method: &str,
        samples: Option<&Bound<'_, PyAny>>,
        noise: Option<f64>,
        bounces: Option<&Bound<'_, PyAny>>,
        size: Option<(usize, usize)>,
        seed: Option<&Bound<'_, PyAny>>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        // A `World` of Python's holds the native one.
        let made = path.getattr_opt("_native")?.and_then(|native| native.cast_into::<_World>().ok());
        let mut world = match &made {
            Some(made) => made.get().spec(),
            None => WorldSpec { unit_m, ..WorldSpec::of_file(input::path("path", path)?) },
        };
        if world.is_file() && !world.file.exists() {
            let reason = "there is no such file".to_owned();
            return Err(exception(PipelineError::Read { path: world.file, reason }));
        }
        world.view = match (eye, camera) {
            (Some(_), Some(camera)) => {
                return Err(wrong("camera", format!("'{camera}'"), "eye or a camera of the file, not both"));
            }
            (Some(eye_m), None) => WorldView::From { eye_m, look_at_m: look_at, up },
            (None, _) if look_at.is_some() || up.is_some() => {
                return Err(wrong("eye", "missing", "a place beside look_at and up"));
            }
            (None, Some("whole")) => WorldView::Whole,
            (None, Some(camera)) => WorldView::Camera(camera.to_owned()),
            (None, None) => WorldView::OfFile,
        };
        (world.time_s, world.animation, world.variant) =
            (time_s.or(world.time_s), animation.or(world.animation), variant.or(world.variant));
        world.sky = sky.map(str::parse).transpose().map_err(|error: PipelineError| exception(error))?;
        let lamp = |(x, y, z, lumens)| WorldLamp { at_m: (x, y, z), lumens };
        world.lamps = lamps.unwrap_or_default().into_iter().map(lamp).collect();
        world.method = match method {
            "backward" => RenderMethod::Backward,
            "forward" => RenderMethod::Forward,
            other => return Err(wrong("method", format!("'{other}'"), "'backward' or 'forward'")),
        };
        let small = |key: &str, value: &Bound<'_, PyAny>| -> PyResult<u32> {
            u32::try_from(count(key, value)?).map_err(|_| wrong(key, value, "a smaller number"))
        };
        world.effort = match (samples, noise) {
            (Some(_), Some(noise)) => return Err(wrong("noise", noise, "samples or noise, not both")),
            (Some(samples), None) => RenderEffort::Samples(small("samples", samples)?),
            (None, Some(noise)) => RenderEffort::Noise(noise),
            (None, None) => RenderEffort::default(),
        };
        if let Some(bounces) = bounces {
            world.paths = LightPaths::UpTo(small("bounces", bounces)?);
        }
        world.size = size;
        if let Some(value) = seed {
            world.seed = crate::options::seed("seed", value)?;
        }
        let source = SceneSource::World(world);
        let spec = with_options("world", SceneSpec { source, ..SceneSpec::of_file(PathBuf::new()) }, options)?;
        Ok(Self::of_choice(spec))
    }

    /// Returns the built-in still life, with objects at several depths, under a light like a room's.
    ///
    /// Parameters
    /// ----------
    /// columns, rows : int
    /// illuminant, illuminance_lux, mean_luminance_cd_m2
    ///     As of `Scene.read`.
    #[staticmethod]
    #[pyo3(signature = (columns=1080, rows=720, **options), text_signature = "(columns=1080, rows=720, *, fov_deg=None, depth_m=None, width_mm=None, distance_mm=None, fill_depth=None, \
hidden=None, points=None, white_level=None, quantity=None, unit=None, scale=None, scene_wavelengths_nm=None, \
variable=None, axes=None, no_data=None, depth=None, depth_unit=None, depth_kind=None, depth_variable=None, view=None, \
panorama=None, illuminant=None, illuminance_lux=None, light=None, mean_luminance_cd_m2=None)")]
    fn still_life(columns: usize, rows: usize, options: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let source = SceneSource::StillLife { columns, rows };
        let spec = SceneSpec { source, ..SceneSpec::of_file(PathBuf::new()) };
        Ok(Self::of_choice(with_options("still_life", spec, options)?))
    }

    /// Returns a flat target that faces the camera.
    ///
    /// Parameters
    /// ----------
    /// pattern : {"uniform", "checkerboard", "slanted-bar", "radial-lines", "point-array", "siemens-star", "color-chart"}
    /// columns, rows : int
    /// fov_deg : float
    ///     Horizontal field of view from its left edge to its right.
    /// depth_m : float
    ///     Its distance along the axis.
    /// width_mm, distance_mm : float
    ///     In place of both, as of `Scene.read`.
    /// size : float, optional
    ///     Of the pattern: side of a square or distance of points in samples (default 16), slope of the bar (2.6), number of lines
    ///     (8) or of pairs of sectors (36), radius of the largest of the dead leaves in samples (100; the smallest has 1).
    /// illuminant, illuminance_lux, mean_luminance_cd_m2
    ///     As of `Scene.read`.
    #[staticmethod]
    #[pyo3(signature = (pattern, columns, rows, *, size=None, **options), text_signature = "(pattern, columns, rows, *, size=None, fov_deg=None, depth_m=None, width_mm=None, distance_mm=None, \
fill_depth=None, hidden=None, points=None, white_level=None, quantity=None, unit=None, scale=None, \
scene_wavelengths_nm=None, variable=None, axes=None, no_data=None, depth=None, depth_unit=None, \
depth_kind=None, depth_variable=None, view=None, panorama=None, illuminant=None, illuminance_lux=None, light=None, \
mean_luminance_cd_m2=None)")]
    fn target(
        pattern: &str,
        columns: usize,
        rows: usize,
        size: Option<f64>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let whole = |usual: usize| match size {
            None => Ok(usual),
            Some(n) if n >= 1.0 && n.fract() == 0.0 && n < 1e6 => Ok(n as usize),
            Some(n) => Err(wrong("size", n, "a whole number of 1 or more")),
        };
        let pattern = match pattern {
            "uniform" => Pattern::Uniform,
            "checkerboard" => Pattern::Checkerboard { check_px: whole(16)? },
            "slanted-bar" => Pattern::SlantedBar { slope: size.unwrap_or(2.6) },
            "radial-lines" => Pattern::RadialLines { n_lines: whole(8)? },
            "point-array" => Pattern::PointArray { spacing_px: whole(16)? },
            "siemens-star" => Pattern::SiemensStar { n_cycles: whole(36)? },
            "color-chart" => Pattern::ColorChart,
            "dead-leaves" => Pattern::DeadLeaves {
                min_radius_px: 1.0,
                max_radius_px: size.unwrap_or(100.0),
                min_reflectance: 0.25,
                max_reflectance: 0.75,
                seed: 1,
            },
            other => {
                let expected = "uniform, checkerboard, slanted-bar, radial-lines, point-array, siemens-star, color-chart or dead-leaves";
                return Err(wrong("pattern", format!("'{other}'"), expected));
            }
        };
        let source = SceneSource::Target { pattern, columns, rows };
        let spec = with_options("target", SceneSpec { source, ..SceneSpec::of_file(PathBuf::new()) }, options)?;
        for (key, value) in [("fov_deg", spec.field_of_view_deg), ("depth_m", spec.depth_m)] {
            if value.is_none() && spec.flat.is_none() {
                return Err(wrong(key, "missing", "a number: a target has none of its own"));
            }
        }
        Ok(Self::of_choice(spec))
    }

    /// What the scene is called.
    #[getter]
    fn name(&self, py: Python<'_>) -> PyResult<String> {
        Ok(self.opened(py)?.name.clone())
    }

    /// Bands, rows and columns.
    #[getter]
    fn shape(&self, py: Python<'_>) -> PyResult<(usize, usize, usize)> {
        let scene = self.opened(py)?;
        Ok((scene.radiance.grid().len(), scene.rows(), scene.columns()))
    }

    /// Centers of the bands, nm; (bands,) float64.
    #[getter]
    fn wavelengths_nm<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let owner = Arc::new(self.opened(py)?.clone());
        view(py, &owner, |scene| ArrayView1::from(scene.radiance.grid().centers_nm()))
    }

    /// Depth of each sample along the axis, m; (rows, columns) float32, a view.
    #[getter]
    fn depth_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let owner = Arc::new(self.opened(py)?.clone());
        owner.require_depth().map_err(exception)?;
        view(py, &owner, |scene| scene.depth.as_ref().expect("it was checked").z_m().view())
    }

    /// Mean luminance, cd/m² (CIE 1931).
    #[getter]
    fn mean_luminance_cd_m2(&self, py: Python<'_>) -> PyResult<f64> {
        Ok(self.opened(py)?.mean_luminance_cd_m2())
    }

    /// Returns the spectral radiance of a band, W m⁻² sr⁻¹ nm⁻¹; (rows, columns) float32, a view.
    fn band<'py>(&self, py: Python<'py>, band: usize) -> PyResult<Bound<'py, PyAny>> {
        let owner = Arc::new(self.opened(py)?.clone());
        let n_bands = owner.radiance.planes().len();
        if band >= n_bands {
            return Err(wrong("band", band, &format!("0 to {}", n_bands - 1)));
        }
        view(py, &owner, |scene| scene.radiance.planes()[band].view())
    }

    /// Returns the spectral radiance, W m⁻² sr⁻¹ nm⁻¹; (bands, rows, columns) float32, copied from the bands.
    fn to_array<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let scene = self.opened(py)?;
        view(py, &Arc::new(scene.radiance.to_cube()), |cube| cube.view())
    }

    /// Writes the scene as spectral EXR with depth and view, which `Scene.read` and ``dioptric run --scene`` read.
    fn write(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let scene = self.opened(py)?;
        run(py, &Follower::nobody(), |_, _| Ok(write_scene_exr(&path, scene, ExrSamples::Single)?))
    }

    /// Scenes are equal when what a camera file says of them is, or their samples are.
    fn __eq__(&self, other: &Self) -> bool {
        match (&self.source, &other.source) {
            (Source::Given(own), Source::Given(other)) => own == other || **own == **other,
            (Source::Spec(own), Source::Spec(other)) => own == other,
            _ => false,
        }
    }

    /// Copies by what a camera file says, or by the arrays, so that scenes can be sent to other processes.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let scene = match &self.source {
            Source::Spec(spec) => {
                let arguments = [to_python(py, spec)?];
                return Ok((restorer(py, "_restore_scene_spec")?, PyTuple::new(py, arguments)?));
            }
            Source::Given(scene) => scene,
        };
        let owner = Arc::new(scene.clone());
        let view_of = scene.view.ok_or_else(|| wrong("the scene", "without a view", "one of `Scene.from_array`"))?;
        let bands = 0..scene.radiance.planes().len();
        let planes = bands.map(|band| view(py, &owner, |scene| scene.radiance.planes()[band].view()));
        let light = scene.light.as_ref().map(|light| (&light.illuminant, light.illuminance_lux));
        let arguments = [
            scene.name.as_str().into_bound_py_any(py)?,
            scene.radiance.grid().centers_nm().into_bound_py_any(py)?,
            planes.collect::<PyResult<Vec<_>>>()?.into_bound_py_any(py)?,
            self.depth_m(py)?,
            [view_of.focal_px, view_of.center_x_px, view_of.center_y_px].into_bound_py_any(py)?,
            to_python(py, &light)?,
            scene.notes.clone().into_bound_py_any(py)?,
        ];
        Ok((restorer(py, "_restore_scene")?, PyTuple::new(py, arguments)?))
    }

    fn __copy__(own: Py<Self>) -> Py<Self> {
        own
    }

    fn __deepcopy__(own: Py<Self>, memo: &Bound<'_, PyAny>) -> Py<Self> {
        let _ = memo;
        own
    }

    fn __repr__(&self) -> String {
        let of_size = |what: &str, columns: usize, rows: usize| format!("<Scene {what}: {columns} × {rows}>");
        match &self.source {
            Source::Given(scene) => of_size(&scene.name, scene.columns(), scene.rows()),
            Source::Spec(spec) => match &spec.source {
                SceneSource::File(path) => format!("<Scene {}>", path.display()),
                SceneSource::World(world) => format!("<Scene {}>", world.file.display()),
                SceneSource::StillLife { columns, rows } => of_size("still life", *columns, *rows),
                SceneSource::Target { pattern, columns, rows } => of_size(&format!("{pattern:?}"), *columns, *rows),
            },
        }
    }
}

/// Returns the radiance of numbers, and the light on them.
fn radiance_of(
    quantity: FileQuantity,
    grid: WavelengthGrid,
    planes: Vec<Array2<f32>>,
    light: Option<Illuminant>,
    illuminance_lux: Option<f64>,
) -> Result<(SpectralImage, Option<SceneLight>), PipelineError> {
    match quantity {
        FileQuantity::Reflectance => {
            let light = SceneLight::new(light.unwrap_or(Illuminant::D65), illuminance_lux.unwrap_or(1000.0));
            let white = light.illuminant.white_radiance(&grid, illuminance_lux.unwrap_or(1000.0));
            let image = SpectralImage::new(Quantity::Reflectance, grid, planes)?;
            Ok((reflectance_under(&image, &white)?, Some(light)))
        }
        FileQuantity::Radiance | FileQuantity::Photons => {
            let mut image = SpectralImage::new(Quantity::Radiance, grid.clone(), planes)?;
            if quantity == FileQuantity::Photons {
                for (mut plane, &nm) in image.planes_mut().zip(grid.centers_nm()) {
                    plane.mapv_inplace(|v| (f64::from(v) * joules_per_photon(nm)) as f32);
                }
            }
            Ok((image, light.map(|illuminant| SceneLight { illuminant, illuminance_lux })))
        }
    }
}
