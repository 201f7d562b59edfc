//! The panels have what the camera file has, and tell of each field what it is.

use std::{collections::BTreeSet, sync::LazyLock, time::Duration};

use dioptric_pipeline::{
    BlurSpec, CAMERA_SCHEMA, Camera, Crop, Diffraction, DualPixelSpec, FillDepth, FlatSize, FocusSpec, FramesSpec,
    Iris, LensReflections, LensSpec, LightPaths, Photodiodes, RenderEffort, SceneSource, SceneSpec, StopSpec,
    SurfaceChange, WavelengthSpec, WorldSpec, with_exposure_s,
};
use dioptric_scene::{Pattern, Wave};
use dioptric_sensor::{Binning, BinningKind, Brightness, ColorCorrection, ExposureControl, LensShading, ToneCurve};
use dioptric_spectrum::Illuminant;
use dioptric_studio::{
    engine::EngineSettings,
    ui::{Studio, StudioSettings},
};
use egui::{Key, accesskit::Role, vec2};
use egui_kittest::{
    Harness,
    kittest::{By, NodeT, Queryable},
};

use super::desk::{draw, small, studio, type_into, window, window_of};

/// The field of a panel by its label, and the keys of the camera file that it changes: types of the schema and their keys or variants.
const PANELS: &[(&str, &[&str])] = &[
    ("name", &["Camera.name"]),
    ("lens", &["Camera.lens", "LensSpec.BuiltIn", "LensSpec.Changed.lens"]),
    (
        "lens file",
        &[
            "LensSpec.File",
            "LensSpec.MeasuredEye",
            "LensSpec.MeasuredEye.file",
            "LensSpec.MeasuredEye.drawn",
            "DrawnEye.number",
            "DrawnEye.seed",
        ],
    ),
    ("pupil", &["LensSpec.MeasuredEye.pupil_mm"]),
    ("focal length", &["LensSpec.Thin", "LensSpec.Thin.focal_length_mm"]),
    ("diameter", &["LensSpec.Thin.diameter_mm", "LensSpec.Pinhole", "LensSpec.Pinhole.diameter_mm"]),
    ("surface", &["LensSpec.Changed", "LensSpec.Changed.surfaces", "SurfaceChange.surface"]),
    ("curvature", &["SurfaceChange.curvature_per_mm", "Iris.curvature"]),
    ("spacing", &["SurfaceChange.thickness_mm"]),
    ("unknown glass", &["Camera.lens_reading", "LensReadOptions.missing_glass"]),
    ("beyond its table", &["LensReadOptions.glass_range"]),
    ("configuration", &["LensReadOptions.configuration"]),
    ("catalogues", &["LensReadOptions.glasses"]),
    ("index slope", &["LensReadOptions.slope_per_nm"]),
    ("lens scale", &["LensReadOptions.lens_scale"]),
    ("coating", &["LensReadOptions.coating"]),
    ("PSF file", &["Camera.psfs"]),
    ("coating file", &["CoatingSpec.File"]),
    ("seq numbers", &["LensReadOptions.seq_numbers"]),
    ("stop", &["Camera.stop"]),
    ("f-number", &["StopSpec.FNumber"]),
    ("diameter of stop", &["StopSpec.DiameterMm"]),
    ("iris", &["Camera.iris"]),
    ("blades", &["Iris.blades"]),
    ("rotation", &["Iris.rotation_deg"]),
    ("tilt", &["Camera.movements", "Movements.tilt_deg"]),
    ("swing", &["Movements.swing_deg"]),
    ("rise", &["Movements.rise_mm"]),
    ("shift", &["Movements.shift_mm"]),
    ("focus", &["Camera.focus"]),
    ("distance", &["FocusSpec.DistanceMm"]),
    ("film distance", &["FocusSpec.FilmMm"]),
    ("film", &["Camera.film", "FilmSpec.Pixels"]),
    ("columns", &["FilmSpec.Pixels.columns"]),
    ("rows", &["FilmSpec.Pixels.rows"]),
    ("pixel pitch", &["FilmSpec.Pixels.pitch_um"]),
    ("part of the film", &["Camera.crop"]),
    ("part from column", &["Crop.x"]),
    ("part from row", &["Crop.y"]),
    ("part columns", &["Crop.columns"]),
    ("part rows", &["Crop.rows"]),
    ("diffraction", &["Camera.diffraction", "Diffraction.Hurb"]),
    ("gamma", &["Diffraction.Hurb.gamma"]),
    ("reflections", &["Camera.lens_reflections"]),
    ("film reflectance", &["LensReflections.Film"]),
    ("blur", &["Camera.blur"]),
    ("views", &["BlurSpec.Views"]),
    ("bands", &["Camera.wavelengths", "WavelengthSpec.Range"]),
    ("first band", &["WavelengthSpec.Range.first_nm"]),
    ("last band", &["WavelengthSpec.Range.last_nm"]),
    ("step", &["WavelengthSpec.Range.step_nm"]),
    ("list of bands", &["WavelengthSpec.ListNm"]),
    ("sensor", &["Camera.sensor", "SensorSpec.BuiltIn"]),
    ("sensor file", &["SensorSpec.File"]),
    ("photodiodes", &["Camera.dual_pixel", "DualPixelSpec.photodiodes"]),
    ("crosstalk", &["DualPixelSpec.crosstalk"]),
    ("transition", &["DualPixelSpec.transition_deg"]),
    ("exposure", &["Camera.exposure", "ExposureControl.Manual", "ExposureControl.Auto"]),
    ("time", &["Exposure.time_s"]),
    ("gain", &["Exposure.analog_gain"]),
    ("readout", &["Exposure.gain_mode"]),
    ("binning", &["Exposure.binning", "Binning.kind"]),
    ("pixels as one", &["Binning.pixels"]),
    ("temperature", &["Exposure.temperature_c"]),
    ("metering", &["AutoExposure.metering"]),
    ("percentile", &["Metering.Percentile"]),
    ("target", &["AutoExposure.target_fraction"]),
    ("longest", &["AutoExposure.limit"]),
    ("photon", &["Camera.noise", "NoiseSources.Only", "NoiseSources.Except"]),
    ("seed", &["Camera.seed"]),
    ("frames", &["Camera.frames"]),
    ("frames of burst", &["FramesSpec.Burst", "FramesSpec.MovingBurst", "FramesSpec.MovingBurst.frames"]),
    ("motion", &["FramesSpec.MovingBurst.motion_px"]),
    ("stops", &["FramesSpec.BracketStops"]),
    ("ratio of times", &["FramesSpec.Interleaved", "FramesSpec.Interleaved.ratio"]),
    ("ratio of gains", &["FramesSpec.Interleaved.gain_ratio"]),
    ("rows of one time", &["FramesSpec.Interleaved.period_rows"]),
    ("demosaic", &["Camera.processing", "Processing.demosaic"]),
    ("highlights", &["Processing.highlights"]),
    ("denoising", &["Processing.denoise"]),
    ("defects", &["Processing.defect_threshold"]),
    ("shading", &["Processing.shading", "LensShading.Radial"]),
    ("shading r²", &["LensShading.Radial.a2"]),
    ("shading r⁴", &["LensShading.Radial.a4"]),
    ("shading r⁶", &["LensShading.Radial.a6"]),
    ("sharpening", &["Processing.sharpen_px"]),
    ("distortion", &["Processing.lens_corrections", "LensCorrections.distortion"]),
    ("lateral color", &["LensCorrections.lateral_color"]),
    ("vignetting", &["LensCorrections.vignetting"]),
    ("white", &["Processing.white", "WhiteBalance.Light", "WhiteBalance.Patch"]),
    ("colors", &["Processing.color"]),
    ("fitted under", &["ColorCorrection.AutoUnder", "ColorCorrection.Fitted", "ColorCorrection.FittedRoots"]),
    ("primaries", &["Processing.space"]),
    ("brightness", &["Processing.brightness", "Brightness.Percentile"]),
    ("factor", &["Brightness.Factor"]),
    ("percent", &["Brightness.Percentile.percent"]),
    ("put at", &["Brightness.Percentile.to"]),
    ("local range", &["Processing.local_tone", "LocalTone.range"]),
    ("local detail", &["LocalTone.detail"]),
    ("curve", &["Processing.curve"]),
    ("power", &["ToneCurve.Gamma"]),
    ("contrast", &["ToneCurve.Filmic", "ToneCurve.Filmic.contrast"]),
    ("scene", &["Camera.scene", "SceneSpec.source", "SceneSource.StillLife", "SceneSource.Target"]),
    ("scene width", &["SceneSource.StillLife.columns", "SceneSource.Target.columns"]),
    ("scene height", &["SceneSource.StillLife.rows", "SceneSource.Target.rows"]),
    ("pattern", &["SceneSource.Target.pattern"]),
    ("check", &["Pattern.Checkerboard", "Pattern.Checkerboard.check_px"]),
    ("slope", &["Pattern.SlantedBar", "Pattern.SlantedBar.slope"]),
    ("lines", &["Pattern.RadialLines", "Pattern.RadialLines.n_lines"]),
    ("points apart", &["Pattern.PointArray", "Pattern.PointArray.spacing_px"]),
    ("cycles", &["Pattern.SiemensStar", "Pattern.SiemensStar.n_cycles"]),
    ("smallest leaf", &["Pattern.DeadLeaves", "Pattern.DeadLeaves.min_radius_px"]),
    ("largest leaf", &["Pattern.DeadLeaves.max_radius_px"]),
    ("darkest leaf", &["Pattern.DeadLeaves.min_reflectance"]),
    ("lightest leaf", &["Pattern.DeadLeaves.max_reflectance"]),
    ("leaf seed", &["Pattern.DeadLeaves.seed"]),
    ("waves", &["Pattern.Harmonics", "Pattern.Harmonics.waves"]),
    ("wave cycles", &["Wave.cycles"]),
    (
        "pattern contrast",
        &["Wave.contrast", "Pattern.Sweep.contrast", "Pattern.ZonePlate.contrast", "Pattern.Noise.contrast"],
    ),
    ("phase", &["Wave.phase_deg"]),
    ("wave turned", &["Wave.angle_deg", "Pattern.Gabor.wave"]),
    ("window", &["Pattern.Gabor", "Pattern.Gabor.sigma"]),
    ("turned", &["Pattern.Lines", "Pattern.Lines.angle_deg"]),
    ("lines apart", &["Pattern.Lines.spacing_px", "Pattern.Grid", "Pattern.Grid.spacing_px"]),
    ("line width", &["Pattern.Lines.width_px", "Pattern.Grid.width_px"]),
    ("first cycles", &["Pattern.Sweep", "Pattern.Sweep.first_cycles"]),
    ("last cycles", &["Pattern.Sweep.last_cycles"]),
    ("edge cycles", &["Pattern.ZonePlate", "Pattern.ZonePlate.edge_cycles"]),
    ("steps", &["Pattern.Ramp", "Pattern.Ramp.steps"]),
    ("ratio", &["Pattern.Ramp.ratio"]),
    ("words", &["Pattern.Letters", "Pattern.Letters.text"]),
    ("capitals", &["Pattern.Letters.height_px"]),
    ("cell", &["Pattern.Noise", "Pattern.Noise.cell_px"]),
    ("noise seed", &["Pattern.Noise.seed"]),
    ("path", &["SceneSource.File", "SceneSource.World", "WorldSpec.file"]),
    ("field of view", &["SceneSpec.field_of_view_deg"]),
    ("depth", &["SceneSpec.depth_m"]),
    ("illuminance", &["SceneSpec.illuminance_lux"]),
    ("light", &["SceneSpec.illuminant", "Illuminant"]),
    ("mean luminance", &["SceneSpec.mean_luminance_cd_m2"]),
    ("mean on the film", &["SceneSpec.mean_lux"]),
    ("flat, by its size", &["SceneSpec.flat"]),
    ("flat width", &["FlatSize.width_mm"]),
    ("flat distance", &["FlatSize.distance_mm"]),
    ("file's light", &["SceneSpec.light"]),
    ("white level", &["SceneSpec.white_level"]),
    ("missing depth", &["SceneSpec.fill_depth"]),
    ("filled depth", &["FillDepth.Metres"]),
    ("hidden file", &["SceneSpec.hidden"]),
    ("points file", &["SceneSpec.points"]),
    ("method", &["WorldSpec.method"]),
    ("until", &["WorldSpec.effort"]),
    ("samples", &["RenderEffort.Samples"]),
    ("noise", &["RenderEffort.Noise"]),
    ("unit", &["WorldSpec.unit_m"]),
    ("at a time", &["WorldSpec.time_s"]),
    ("animation", &["WorldSpec.animation"]),
    ("variant", &["WorldSpec.variant"]),
    ("advance", &["WorldSpec.advance_mm"]),
    ("to the right", &["WorldSpec.aside_mm"]),
    ("own size of the view", &["WorldSpec.size"]),
    ("what edges hide", &["WorldSpec.layers"]),
    ("value of a band", &["WorldSpec.bands"]),
    ("scattering", &["WorldSpec.paths"]),
    ("scatterings", &["LightPaths.UpTo"]),
    ("world seed", &["WorldSpec.seed"]),
    ("irradiance", &["Camera.outputs", "Outputs.irradiance"]),
    ("EXR samples", &["Outputs.exr_samples"]),
    ("depth map", &["Outputs.depth"]),
    ("volts", &["Outputs.volts"]),
    ("raw", &["Outputs.raw"]),
    ("raw DNG", &["Outputs.also"]),
];

/// Keys that the text of the camera file alone has, and why. A type stands for all its keys.
const TEXT: &[(&str, &str)] = &[
    ("Camera.border", "a detail of blurs at the rim, written in the text of the camera file"),
    ("Camera.chip_seed", "which chip of a make it is, written in the text of the camera file"),
    ("Panorama", "which way a panorama is looked at, written in the text of the camera file"),
    ("Metering.EachFilter", "a share for each filter, written in the text of the camera file"),
    ("WorldSpec.view", "places and directions in the world's own units, written in the text of the camera file"),
    ("WorldSpec.sky", "as above"),
    ("WorldSpec.lamps", "as above"),
    ("WorldSpec.changes", "a list of changes, written in the text of the camera file or made by a program"),
    ("WorldChange", "as above"),
    ("WorldShape", "as above"),
    ("WorldMaterial", "as above"),
    ("WorldColor", "as above"),
    ("WorldLight", "as above"),
    ("LightAmount", "as above"),
    ("WorldView", "as above"),
    ("WorldSky", "as above"),
    ("WorldLamp", "as above"),
    ("Camera.light_field", "a light field is decoded by `dioptric lightfield`; the window shows its raw picture"),
    ("LightFieldSpec", "as above"),
    ("MicroArray", "as above"),
    ("MicroElements", "as above"),
    ("Camera.filters", "a list of names and closed forms, written in the text of the camera file"),
    ("FilterSpec", "as above"),
    ("Camera.video", "a video is taken by `dioptric video`; the window shows its camera at rest"),
    ("VideoSpec", "as above"),
    ("CameraTurn", "as above"),
    ("Processing.perspective", "eight numbers, which are read off the picture"),
    ("Perspective", "as above"),
    ("SceneSpec.reading", "what a file does not state itself, said once in the text of the camera file"),
    ("FileReading", "as above"),
    ("DepthKind", "as above"),
    ("LensShading.Map", "as many numbers as cells and filters, from a calibration"),
    ("ShadingMap", "as above"),
    ("ColorCorrection.Matrix", "nine numbers or more, from a calibration"),
    ("WhiteBalance.Gains", "from a calibration; a light or a patch states them otherwise"),
    ("WhiteBalance.WhitePatch", "the word white-patch has the usual number"),
    ("WhiteBalance.ShadesOfGray", "the word shades-of-gray has the usual number"),
    ("WhiteBalance.GrayEdge", "the word gray-edge has the usual numbers"),
    ("WhiteBalance.Patch", "the word patch:X,Y,W,H has them"),
    ("Spectrum", "a table of wavelengths; the light's field reads it from a CSV file"),
];

/// Returns all keys of the schema: `Type.key`, `Type.Variant` and `Type.Variant.key`. Variants without a value are words of a choice.
fn keys() -> BTreeSet<String> {
    let schema: serde_json::Value = serde_json::from_str(CAMERA_SCHEMA).unwrap();
    let mut all = BTreeSet::new();
    let types = schema["$defs"].as_object().unwrap().iter().map(|(name, of)| (name.as_str(), of));
    for (name, of) in types.chain([("Camera", &schema)]) {
        let names = |of: &serde_json::Value| of["properties"].as_object().cloned().unwrap_or_default();
        all.extend(names(of).keys().map(|key| format!("{name}.{key}")));
        for (variant, inner) in of["oneOf"].as_array().into_iter().flatten().flat_map(names) {
            all.extend(names(&inner).keys().map(|key| format!("{name}.{variant}.{key}")));
            all.insert(format!("{name}.{variant}"));
        }
    }
    all
}

/// Cameras that between them have every key.
fn cameras() -> Vec<Camera> {
    let with = |change: &dyn Fn(&mut Camera)| {
        let mut camera = small();
        change(&mut camera);
        camera
    };
    let target = |pattern: Pattern| {
        with(&move |camera| {
            camera.scene.source = SceneSource::Target { pattern: pattern.clone(), columns: 60, rows: 40 };
            (camera.scene.depth_m, camera.scene.field_of_view_deg) = (Some(2.0), Some(36.0));
        })
    };
    let wave = Wave { cycles: 5.0, contrast: 0.5, phase_deg: 10.0, angle_deg: 10.0 };
    vec![
        with(&everything),
        with(&otherwise),
        with(&|camera| {
            let scene = &mut camera.scene;
            *scene = SceneSpec::of_file("none.exr".into());
            (scene.fill_depth, scene.white_level) = (Some(FillDepth::Metres(3.0)), Some(1.0));
            scene.flat = Some(FlatSize { width_mm: 10.0, distance_mm: 100.0 });
            camera.lens = LensSpec::File("none.zmx".into());
            camera.lens_reading.slope_per_nm = Some(-1e-4);
            camera.lens_reading.lens_scale = Some(2.0);
            camera.iris = Some(Iris { blades: 6, rotation_deg: 10.0, curvature: 0.5 });
            camera.frames = FramesSpec::Interleaved { ratio: 8.0, period_rows: 2, gain_ratio: 1.0 };
        }),
        world(RenderEffort::Samples(8)),
        world(RenderEffort::Noise(0.1)),
        with(&|camera| camera.lens = LensSpec::Thin { focal_length_mm: 50.0, diameter_mm: 10.0 }),
        with(&|camera| camera.lens = LensSpec::named("eye:none.mat:3mm:7")),
        target(Pattern::Checkerboard { check_px: 5 }),
        target(Pattern::SlantedBar { slope: 0.1 }),
        target(Pattern::RadialLines { n_lines: 5 }),
        target(Pattern::PointArray { spacing_px: 10 }),
        target(Pattern::SiemensStar { n_cycles: 9 }),
        target(Pattern::DeadLeaves {
            min_radius_px: 2.0,
            max_radius_px: 20.0,
            min_reflectance: 0.25,
            max_reflectance: 0.75,
            seed: 1,
        }),
        target(Pattern::Harmonics { waves: vec![wave] }),
        target(Pattern::Gabor { wave, sigma: 0.2 }),
        target(Pattern::Lines { spacing_px: 10.0, width_px: 2.0, angle_deg: 10.0 }),
        target(Pattern::Grid { spacing_px: 10.0, width_px: 2.0 }),
        target(Pattern::Sweep { first_cycles: 2.0, last_cycles: 10.0, contrast: 0.5 }),
        target(Pattern::ZonePlate { edge_cycles: 10.0, contrast: 0.5 }),
        target(Pattern::Ramp { steps: 5, ratio: Some(10.0) }),
        target(Pattern::Letters { text: "A".to_owned(), height_px: 10.0 }),
        target(Pattern::Noise { cell_px: 2, contrast: 0.5, seed: 1 }),
    ]
}

fn world(effort: RenderEffort) -> Camera {
    let mut camera = small();
    let mut world = WorldSpec::of_file("none.pbrt".into());
    (world.effort, world.paths, world.size) = (effort, LightPaths::UpTo(3), Some((30, 20)));
    camera.scene = SceneSpec { source: SceneSource::World(world), ..SceneSpec::of_file("none".into()) };
    camera
}

fn everything(camera: &mut Camera) {
    camera.crop = Some(Crop { x: 8, y: 8, columns: 32, rows: 24 });
    camera.blur = BlurSpec::Views(4);
    camera.lens_reflections = LensReflections::Film(0.1);
    camera.diffraction = Diffraction::Hurb { gamma: 1.0 };
    camera.wavelengths = WavelengthSpec::Range { first_nm: 400.0, last_nm: 700.0, step_nm: 100.0 };
    camera.stop = StopSpec::DiameterMm(8.0);
    camera.frames = FramesSpec::MovingBurst { frames: 2, motion_px: 1.0 };
    if let ExposureControl::Auto(auto) = &mut camera.exposure {
        auto.limit.binning = Some(Binning { kind: BinningKind::Charge, pixels: 2 });
    }
    let scene = &mut camera.scene;
    scene.field_of_view_deg = Some(36.0);
    (scene.illuminance_lux, scene.mean_luminance_cd_m2) = (Some(100.0), Some(10.0));
    let processing = &mut camera.processing;
    (processing.denoise, processing.defect_threshold) = (Some(0.5), Some(0.2));
    processing.shading = Some(LensShading::Radial { a2: 0.1, a4: 0.0, a6: 0.0 });
    processing.color = ColorCorrection::Fitted(Illuminant::D65);
    processing.brightness = Brightness::Percentile { percent: 99.0, to: 0.9 };
    processing.curve = ToneCurve::Gamma(0.5);
}

fn otherwise(camera: &mut Camera) {
    camera.dual_pixel = Some(DualPixelSpec::of(Photodiodes::LeftRight));
    camera.focus = FocusSpec::FilmMm(50.0);
    camera.scene.mean_lux = Some(10.0);
    camera.wavelengths = WavelengthSpec::ListNm(vec![450.0, 550.0]);
    camera.frames = FramesSpec::BracketStops(vec![-1.0, 0.0]);
    camera.exposure = with_exposure_s(camera.exposure, 0.01);
    camera.processing.brightness = Brightness::Factor(2.0);
    camera.processing.curve = ToneCurve::Filmic { contrast: 0.5 };
    camera.lens = camera.lens.with_changes(vec![SurfaceChange { surface: 0, ..SurfaceChange::default() }]);
}

/// A window of a camera whose pictures nobody waits for, all its sections open; so high that all of them are seen.
fn opened<'a>(camera: &Camera) -> Harness<'a, Option<Studio>> {
    let ui = |ui: &mut egui::Ui, studio: &mut Option<Studio>| {
        if let Some(studio) = studio {
            studio.ui(ui);
        }
    };
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("camera.ron");
    std::fs::write(&file, camera.to_ron()).unwrap();
    let mut harness = Harness::builder().with_size([1400.0, 4000.0]).build_ui_state(ui, None);
    let settings = StudioSettings { engine: EngineSettings::default(), autosave: None, camera: Some(file.clone()) };
    *harness.state_mut() = Some(Studio::new(&harness.ctx, settings).unwrap());
    draw(&mut harness);
    assert_eq!(*studio(&harness).session().camera(), Camera::read(&file).unwrap());
    let closed = ["Noise", "Processing", "Simulation", "Output", "Surfaces", "More of the scene", "More of the world"];
    for header in closed.into_iter().chain(["What the file leaves open"]) {
        // By name, not by place: the drawing of the lens comes with the first picture and moves what is below.
        if let Some(header) = harness.query_by_label(header) {
            header.click_accesskit();
        }
        draw(&mut harness);
        std::thread::sleep(Duration::from_millis(20));
    }
    // Sections open in a moment, not at once.
    (0..30).for_each(|_| harness.step());
    harness
}

/// Role, label and description of each widget that can be used, but for those beyond the panels.
fn widgets(harness: &Harness<'_, Option<Studio>>) -> Vec<(Role, String, String)> {
    let used = [Role::TextInput, Role::Slider, Role::ComboBox, Role::CheckBox];
    let all = harness.query_all(By::new().recursive(true).predicate(|_| true));
    // The panels stand at the left; charts have legends that are not theirs.
    let is_used = |node: &egui_kittest::Node<'_>| used.contains(&node.accesskit_node().role());
    all.filter(|node| is_used(node) && node.rect().right() < 520.0)
        .map(|node| {
            let node = node.accesskit_node();
            let text = |text: Option<String>| text.unwrap_or_default();
            let description = node.data().description().map(str::to_owned);
            (node.role(), text(node.label()), text(description))
        })
        .collect()
}

/// The widgets of the panels of all cameras, made once.
fn all_widgets() -> &'static [(Role, String, String)] {
    static ALL: LazyLock<Vec<(Role, String, String)>> =
        LazyLock::new(|| cameras().iter().flat_map(|camera| widgets(&opened(camera))).collect());
    &ALL
}

#[test]
fn every_key_of_the_camera_file_is_in_a_panel_or_has_a_reason() {
    let keys = keys();
    assert!(keys.len() > 150, "{}", keys.len());
    let is_of =
        |listed: &str, key: &str| key == listed || key.strip_prefix(listed).is_some_and(|rest| rest.starts_with('.'));
    let in_panels: Vec<&str> = PANELS.iter().flat_map(|(_, keys)| keys.iter().copied()).collect();
    let has = |key: &str| {
        in_panels.iter().any(|listed| *listed == key || (!listed.contains('.') && is_of(listed, key)))
            || TEXT.iter().any(|(listed, _)| is_of(listed, key))
    };
    let unreachable: Vec<&String> = keys.iter().filter(|key| !has(key)).collect();
    assert!(unreachable.is_empty(), "neither in a panel nor listed with a reason: {unreachable:?}");
    // What is listed is there.
    let listed = in_panels.iter().chain(TEXT.iter().map(|(key, _)| key));
    let gone: Vec<&&str> = listed.filter(|listed| !keys.iter().any(|key| is_of(listed, key))).collect();
    assert!(gone.is_empty(), "no longer in the schema: {gone:?}");
    // And so are the fields.
    let labels: BTreeSet<&String> = all_widgets().iter().map(|(_, label, _)| label).collect();
    let missing: Vec<&str> =
        PANELS.iter().map(|(label, _)| *label).filter(|label| !labels.contains(&label.to_string())).collect();
    assert!(missing.is_empty(), "no field is called {missing:?}, but {labels:?}");
}

#[test]
fn every_field_tells_what_it_is_and_its_range() {
    for (role, label, description) in all_widgets() {
        assert!(!label.is_empty() && description.len() > 8, "{role:?} {label:?}: {description:?}");
        if *role == Role::Slider {
            let has_range = description.contains("from ") || description.contains(" or more");
            assert!(has_range, "{label}: {description}");
        }
    }
}

#[test]
fn numbers_of_panels_change_the_camera() {
    let mut camera = small();
    everything(&mut camera);
    // Nothing of it is drawn: what is asked is whether the camera follows.
    let mut harness = opened(&camera);
    let typed =
        [("views", "7"), ("sharpening", "0.6"), ("local detail", "1.5"), ("part columns", "20"), ("percent", "98")];
    for (label, text) in typed {
        type_into(&mut harness, label, text);
    }
    harness.get_by_role_and_label(Role::CheckBox, "distortion").click();
    draw(&mut harness);
    let now = studio(&harness).session().camera();
    assert_eq!((now.blur, now.crop.unwrap().columns), (BlurSpec::Views(7), 20));
    let processing = &now.processing;
    assert_eq!((processing.sharpen_px, processing.local_tone.detail), (0.6, 1.5));
    assert!(processing.lens_corrections.distortion && !processing.lens_corrections.vignetting);
    assert_eq!(processing.brightness, Brightness::Percentile { percent: 98.0, to: 0.9 });
    assert_eq!(studio(&harness).session().history().n_past(), 6);
}

#[test]
fn a_part_of_the_film_has_the_fields_of_the_whole() {
    let mut camera = small();
    let whole = window_of(&camera, ([1400.0, 900.0], 1.0), None);
    camera.crop = Some(Crop { x: 48, y: 0, columns: 48, rows: 32 });
    let part = window_of(&camera, ([1400.0, 900.0], 1.0), None);
    let [whole, part] = [&whole, &part].map(|harness| studio(harness).product().unwrap());
    // The middle of the upper right quarter.
    let (a, b) = (whole.probe([0.75, 0.25]).unwrap(), part.probe([0.5, 0.5]).unwrap());
    assert!((a.field_deg.unwrap() - b.field_deg.unwrap()).abs() < 0.01, "{:?} {:?}", a.field_deg, b.field_deg);
    assert_eq!((whole.film_size(), part.film_size(), part.size()), ([96, 64], [96, 64], [48, 32]));
    assert!((a.depth_m.unwrap() / b.depth_m.unwrap() - 1.0).abs() < 1e-3);
}

#[test]
fn the_window_fits_screens_and_themes() {
    for (size, points, theme) in [
        ([1280.0, 720.0], 1.0, egui::Theme::Dark),
        ([1280.0, 720.0], 1.0, egui::Theme::Light),
        ([1920.0, 1080.0], 2.0, egui::Theme::Light),
        ([3840.0, 2160.0], 1.0, egui::Theme::Dark),
    ] {
        let mut harness = window_of(&small(), (size, points), None);
        harness.ctx.set_theme(theme);
        draw(&mut harness);
        let screen = egui::Rect::from_min_size(egui::Pos2::ZERO, vec2(size[0], size[1]));
        let picture = 0.15 * screen.area();
        for (label, least) in [("picture", picture), ("drawing of the lens", 2e4), ("point spread function", 2e3)] {
            let place = harness.get_by_label(label).rect();
            assert!(screen.expand(1.0).contains_rect(place), "{label} at {place:?} of {size:?}");
            assert!(place.area() > least, "{label} is {place:?} of {size:?}");
        }
    }
}

#[test]
fn keys_reach_everything() {
    let mut harness = window(None);
    let mut reached = BTreeSet::new();
    for _ in 0..160 {
        harness.key_press(Key::Tab);
        harness.step();
        let all = harness.query_all(By::new().recursive(true).predicate(|_| true));
        reached.extend(all.filter(|node| node.is_focused()).filter_map(|node| node.accesskit_node().label()));
    }
    for label in
        ["Camera", "→A", "Pause", "scene", "f-number", "f-number slider", "swing", "sensor", "gain", "Lens bench"]
    {
        assert!(reached.contains(label), "{label} is not reached: {reached:?}");
    }
    // The picture has keys of its own.
    let mut harness = window(None);
    let spread = |harness: &Harness<'_, Option<Studio>>| studio(harness).session().camera().focus;
    let before = spread(&harness);
    for key in [Key::ArrowRight, Key::ArrowRight, Key::ArrowDown, Key::Enter, Key::E, Key::Plus] {
        harness.key_press(key);
        harness.step();
    }
    assert_ne!(spread(&harness), before);
    harness.key_press(Key::F4);
    draw(&mut harness);
    assert!(harness.query_by_label("camera file").is_some());
}
