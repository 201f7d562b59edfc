//! `dioptric run`: the whole of Figure 1.

use std::{
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
    time::{Duration, Instant},
};

use anyhow::{Context, bail};
use dioptric_analysis::{Run, RunReport, RunTimes};
use dioptric_files::memory;
use dioptric_pipeline::{
    BlurSpec, Camera, Clock as PartClock, Diffraction, FilmSpec, FlatSize, FocusSpec, FrameFile, FramesSpec,
    ImagingTimes, KeptCamera, LensReadOptions, LensSpec, Progress, Quality, RetiredBank, SceneSource, SceneSpec,
    SensorOptions, SensorSpec, Silent, Stage, Staged, StopSpec, WavelengthSpec, display, number, parse_illuminant,
    parse_numbers, with_exposure_s,
};
use dioptric_report::write_run;
use dioptric_spectrum::Cancel;

use crate::{
    args::{Common, DiffractionKind, DualPixelArg, FilmKind, FrameArgs, QualityKind, RunArgs},
    lens::tell,
    memory::{give_back_at_once, give_back_freed},
    paintings::{build, painting_folder},
    terminal::{Bar, print, print_json, remark},
};

/// Where results go when nothing else is asked for.
pub(crate) const OUT: &str = "dioptric-out";

pub(crate) fn run(arguments: &RunArgs, common: &Common) -> anyhow::Result<()> {
    let kept = camera_of(arguments, common)?;
    kept.camera().validate()?;
    let out = &*match (&arguments.out, &arguments.from) {
        (Some(out), _) => out.clone(),
        (None, Some(from)) => beside(from),
        (None, None) => PathBuf::from(OUT),
    };
    let staged = Staged::folder(out)?;
    let kept = match build() {
        Some(build) => kept.with_bands_kept_in(staged.root(), build),
        None => kept,
    };
    if arguments.resume && !kept.take_bands(&staged.leftovers())? {
        remark(common.quiet, "no killed run of this camera left bands here: it starts from the beginning");
    }
    let (clock, cancel) = (Clock::new(common.quiet).sparing(common.memory.is_some()), Cancel::new());
    let capture = kept.capture(&clock, &cancel)?;
    let model = kept.model(&clock, &cancel)?;
    let depth = kept.depth(&clock, &cancel)?;
    clock.at(Stage::Report, 0.0);
    let run = Run { capture: &capture, model: &model, depth: Some(&depth) };
    let report = write_run(&run, staged.path(), &|| clock.times())?;
    if capture.camera.outputs.irradiance && capture.quality == Quality::Full {
        kept.write_resume_file(&capture, staged.path())?;
    }
    staged.commit()?;
    let total_s = clock.total_s();
    drop(clock);
    tell(&report.lens_notes, common);
    // Of a lens's own file, where nobody asked for a focus.
    let is_asked = arguments.camera.is_some() || arguments.from.is_some() || arguments.place.focus().is_some();
    let is_file = matches!(capture.camera.lens, LensSpec::File(_));
    let note_on_film = (is_file && !is_asked).then(|| capture.note_on_film()).flatten();
    tell(note_on_film.as_slice(), common);
    tell(&report.sensor.notes, common);
    tell(&report.scene.notes, common);
    if report.film.dark_fraction > display::LEAST_DARK_FRACTION {
        let percent = 100.0 * report.film.dark_fraction;
        let words = "where that is not black in the scene, the lens shows less of it than the film is large: take a smaller \
                     film (--film scene) or a wider scene. A scene ends before 90 degrees from the axis; what a lens sees beyond, dioptric render \
                     takes from a panorama (--sky)";
        remark(common.quiet, &format!("{percent:.1} % of the film gets no light; {words}"));
    }
    if report.sensor.exposure_time_s > LONGEST_EXPOSURE_S {
        let words = "is the scene as dark as that? What its file means can be said: --quantity, --unit, --scale";
        remark(common.quiet, &format!("the exposure takes {:.1e} s: {words}", report.sensor.exposure_time_s));
    }
    let is_coarse = matches!(capture.quality, Quality::Preview | Quality::Sketch);
    if is_coarse && matches!(capture.camera.blur, BlurSpec::Views(_)) {
        remark(common.quiet, "a preview has layers of depth in place of views through parts of the pupil");
    }
    if common.json {
        return print_json(&report);
    }
    remark(common.quiet, "");
    if common.quiet { Ok(()) } else { print(&summary(&report, total_s, out)) }
}

/// Returns the folder of a run that continues another without being told where to: that of the other stays.
fn beside(from: &Path) -> PathBuf {
    let from = from.canonicalize().unwrap_or_else(|_| from.to_owned());
    let mut name = from.file_name().unwrap_or_default().to_owned();
    name.push("-changed");
    from.with_file_name(name)
}

/// Exposures longer than this are asked about: an hour.
const LONGEST_EXPOSURE_S: f64 = 3600.0;

/// What is to be known of a budget for a run that is continued.
const MEMORY_WITH_FROM: &str =
    "--memory limits scene and imaging: the irradiance of the run that is continued is read whole beside it";

/// Returns the camera of the file, of the run to continue or of the demo, with what the command line changes.
pub(crate) fn camera_of(arguments: &RunArgs, common: &Common) -> anyhow::Result<KeptCamera> {
    let kept = match (&arguments.from, &arguments.camera) {
        (Some(folder), _) => {
            let resumed = KeptCamera::resume(folder)?;
            tell(&resumed.notes, common);
            if common.memory.is_some() {
                tell(&[MEMORY_WITH_FROM.to_owned()], common);
            }
            resumed.camera
        }
        (None, Some(path)) => KeptCamera::new(Camera::read(path)?),
        (None, None) => KeptCamera::new(Camera::demo()?),
    };
    let mut camera = kept.camera().clone();
    if arguments.camera.is_none() && arguments.from.is_none() {
        change_demo(&mut camera, arguments);
    }
    if let Some(scene) = &arguments.scene {
        camera.scene = SceneSpec::of_file(scene.clone());
    }
    change_scene(&mut camera, arguments)?;
    change_lens(&mut camera, arguments)?;
    change_sensor(&mut camera, arguments)?;
    if let Some(seed) = common.seed {
        camera.seed = seed;
    }
    if let Some(list) = arguments.bands.nm()? {
        camera.wavelengths = WavelengthSpec::ListNm(list);
    }
    let quality = match arguments.quality {
        QualityKind::Sketch => Quality::Sketch,
        QualityKind::Preview => Quality::Preview,
        QualityKind::Draft => Quality::Draft,
        QualityKind::Full => Quality::Full,
    };
    let kept = kept.with(|own| *own = camera).with_quality(quality).with_paintings(painting_folder());
    let kept = match memory::allowed_bytes() {
        Some(bytes) => kept.with_memory_budget(bytes),
        None => kept,
    };
    let film = film_of(&kept, arguments)?;
    Ok(kept.with(|own| own.film = film))
}

/// Returns the film with the pixels asked for; where only their number or their pitch is, the film stays as large as it is.
fn film_of(kept: &KeptCamera, arguments: &RunArgs) -> anyhow::Result<FilmSpec> {
    let size = arguments.pixels.as_deref().map(parse_size).transpose()?;
    let size_um = || kept.film_size_mm(&Silent, &Cancel::new()).map(|size_mm| size_mm.map(|mm| 1e3 * mm));
    Ok(match (size, arguments.pixel_um) {
        (None, None) if arguments.film.is_some() => match arguments.film {
            Some(FilmKind::Scene) => FilmSpec::Scene,
            Some(FilmKind::Field) => FilmSpec::Field,
            _ => FilmSpec::Sensor,
        },
        (None, None) => kept.camera().film,
        (Some((columns, rows)), Some(pitch_um)) => FilmSpec::Pixels { columns, rows, pitch_um },
        (Some((columns, rows)), None) => {
            let [width_um, height_um] = size_um()?;
            // The whole of the new film lies within the old one.
            FilmSpec::Pixels { columns, rows, pitch_um: (width_um / columns as f64).min(height_um / rows as f64) }
        }
        (None, Some(pitch_um)) if !(pitch_um > 0.0 && pitch_um.is_finite()) => {
            bail!("--pixel-um is {pitch_um}, expected a finite number of µm above 0")
        }
        (None, Some(pitch_um)) => {
            let [columns, rows] = size_um()?.map(|um| (um / pitch_um).round().max(1.0) as usize);
            FilmSpec::Pixels { columns, rows, pitch_um }
        }
    })
}

/// Changes what the demo has for its own lens and scene alone: the film and the name, and with the scene focus and bands.
fn change_demo(camera: &mut Camera, arguments: &RunArgs) {
    if arguments.scene.is_some() {
        camera.focus = FocusSpec::NearObject;
        camera.wavelengths = WavelengthSpec::Scene;
    }
    if arguments.scene.is_some() || arguments.lens.is_some() {
        camera.film = FilmSpec::Scene;
    }
    let scene = arguments.scene.as_deref().map_or_else(|| "Still life".to_owned(), stem_of);
    let lens = match arguments.lens.as_deref().map(LensSpec::named) {
        Some(LensSpec::File(path)) => stem_of(&path),
        Some(_) => arguments.lens.clone().unwrap_or_default(),
        None => "50 mm double Gauss".to_owned(),
    };
    let stop = match (arguments.state.f_number, arguments.state.stop_mm) {
        (Some(n), _) => format!(" at f/{n}"),
        (None, Some(mm)) => format!(", stop {mm} mm"),
        (None, None) if arguments.lens.is_none() => " at f/4".to_owned(),
        (None, None) => String::new(),
    };
    camera.name = format!("{scene}, {lens}{stop}");
}

pub(crate) fn stem_of(path: &Path) -> String {
    path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

fn change_scene(camera: &mut Camera, arguments: &RunArgs) -> anyhow::Result<()> {
    let scene = &mut camera.scene;
    scene.field_of_view_deg = arguments.fov_deg.or(scene.field_of_view_deg);
    scene.depth_m = arguments.depth_m.or(scene.depth_m);
    if arguments.fov_deg.is_some() || arguments.depth_m.is_some() {
        scene.flat = None;
    }
    if let (Some(width_mm), Some(distance_mm)) = (arguments.width_mm, arguments.distance_mm) {
        (scene.field_of_view_deg, scene.depth_m) = (None, None);
        scene.flat = Some(FlatSize { width_mm, distance_mm });
    }
    scene.points = arguments.points.clone().or_else(|| scene.points.take());
    scene.hidden = arguments.hidden.clone().or_else(|| scene.hidden.take());
    arguments.scene_file.change(scene)?;
    scene.mean_luminance_cd_m2 = arguments.mean_luminance_cd_m2.or(scene.mean_luminance_cd_m2);
    scene.illuminance_lux = arguments.illuminance_lux.or(scene.illuminance_lux);
    // A level that is asked for takes the place of the other.
    if arguments.mean_lux.is_some() {
        scene.mean_luminance_cd_m2 = None;
    }
    scene.mean_lux = arguments.mean_lux.or(scene.mean_lux.filter(|_| arguments.mean_luminance_cd_m2.is_none()));
    if let Some(name) = &arguments.illuminant {
        scene.illuminant = Some(parse_illuminant(name)?);
    }
    if let Some(light) = &arguments.scene_light {
        scene.light = Some(parse_illuminant(light)?);
    }
    Ok(())
}

fn change_lens(camera: &mut Camera, arguments: &RunArgs) -> anyhow::Result<()> {
    if let Some(lens) = &arguments.lens {
        camera.lens = LensSpec::named(lens);
        // The f-number in the file was meant for another lens, and so was what it says of glasses.
        (camera.stop, camera.iris) = (StopSpec::AsGiven, None);
        camera.lens_reading = LensReadOptions::default();
    }
    arguments.state.reading.change(&mut camera.lens_reading);
    camera.stop = arguments.state.stop().unwrap_or(camera.stop);
    camera.focus = arguments.place.focus().unwrap_or(camera.focus);
    arguments.state.iris.change(&mut camera.iris)?;
    arguments.state.movements.change(&mut camera.movements);
    camera.crop = arguments.crop.or(camera.crop);
    if let Some(kind) = arguments.diffraction {
        camera.diffraction = diffraction(kind);
    }
    camera.diffraction = with_gamma(camera.diffraction, arguments.gamma)?;
    if arguments.bank.is_some() || arguments.bank_error.is_some() {
        camera.bank = RetiredBank::STATED;
    }
    if let Some(path) = &arguments.psfs {
        camera.psfs = Some(path.clone()).filter(|path| path.as_os_str() != "none");
    }
    camera.lens_reflections = arguments.lens_reflections.unwrap_or(camera.lens_reflections);
    camera.blur = arguments.blur.unwrap_or(camera.blur);
    camera.border = arguments.border.unwrap_or(camera.border);
    Ok(())
}

/// Returns HURB with another strength, where one is asked for.
pub(crate) fn with_gamma(choice: Diffraction, gamma: Option<f64>) -> anyhow::Result<Diffraction> {
    match (choice, gamma) {
        (_, None) => Ok(choice),
        (Diffraction::Hurb { .. }, Some(gamma)) => Ok(Diffraction::Hurb { gamma }),
        (_, Some(_)) => bail!("--gamma is the strength of HURB, expected with --diffraction hurb"),
    }
}

pub(crate) fn diffraction(kind: DiffractionKind) -> Diffraction {
    match kind {
        DiffractionKind::None => Diffraction::None,
        DiffractionKind::Hurb => Diffraction::Hurb { gamma: 1.0 },
        DiffractionKind::HurbScene3d => Diffraction::Hurb { gamma: std::f64::consts::SQRT_2 },
        DiffractionKind::HurbCalibrated => Diffraction::HurbCalibrated,
        DiffractionKind::Wave => Diffraction::Wave,
    }
}

fn change_sensor(camera: &mut Camera, arguments: &RunArgs) -> anyhow::Result<()> {
    if let Some(sensor) = &arguments.sensor {
        camera.sensor = SensorSpec::named(sensor);
        // Its pixels come with it: all of them where the scene has no end, else those that it covers.
        camera.film = match camera.scene.source {
            SceneSource::StillLife { .. } | SceneSource::World(_) => FilmSpec::Sensor,
            SceneSource::File(_) | SceneSource::Target { .. } => FilmSpec::Field,
        };
    }
    if !arguments.frames.filters.is_empty() {
        camera.filters.clone_from(&arguments.frames.filters);
    }
    if let Some(DualPixelArg(spec)) = arguments.dual_pixel {
        camera.dual_pixel = spec;
    }
    if let Some(frames) = frames_of(&arguments.frames)? {
        camera.frames = frames;
    }
    if let Some(list) = &arguments.frames.also {
        camera.outputs.also = FrameFile::parse_list(list)?;
    }
    camera.outputs.exr_samples = arguments.frames.exr_samples.unwrap_or(camera.outputs.exr_samples);
    if let Some(time_s) = arguments.exposure_s {
        camera.exposure = with_exposure_s(camera.exposure, time_s);
    }
    camera.chip_seed = arguments.frames.chip_seed.unwrap_or(camera.chip_seed);
    let options = sensor_options(&arguments.frames);
    Ok(options.apply(&mut camera.noise, &mut camera.exposure, &mut camera.processing)?)
}

/// Returns what the command line changes of the sensor's frames and of the picture.
pub(crate) fn sensor_options(arguments: &FrameArgs) -> SensorOptions {
    SensorOptions {
        noise: arguments.noise.clone(),
        analog_gain: arguments.analog_gain,
        gain_mode: arguments.gain_mode.clone(),
        binning: arguments.binning.clone(),
        temperature_c: arguments.temperature_c,
        metering: arguments.metering.clone(),
        picture: arguments.picture.0.clone(),
    }
}

/// Returns how many frames the command line asks for.
pub(crate) fn frames_of(arguments: &FrameArgs) -> anyhow::Result<Option<FramesSpec>> {
    Ok(match (arguments.burst, arguments.bracket_stops.as_deref()) {
        (Some(frames), _) => Some(match arguments.burst_motion_px {
            Some(motion_px) => FramesSpec::MovingBurst { frames, motion_px },
            None => FramesSpec::Burst(frames),
        }),
        (None, Some(list)) => Some(FramesSpec::BracketStops(parse_numbers("--bracket-stops", list)?)),
        (None, None) if arguments.both_gains => Some(FramesSpec::BothGains),
        (None, None) => {
            match (arguments.interleaved_ratio, arguments.interleaved_gain_ratio, arguments.interleaved_rows) {
                (None, None, None) => None,
                (None, None, Some(_)) => {
                    bail!(
                        "--interleaved-rows needs --interleaved-ratio or --interleaved-gain-ratio, which rows of two kinds differ by"
                    )
                }
                (ratio, gain_ratio, rows) => Some(FramesSpec::Interleaved {
                    ratio: ratio.unwrap_or(1.0),
                    period_rows: rows.unwrap_or(2),
                    gain_ratio: gain_ratio.unwrap_or(1.0),
                }),
            }
        }
    })
}

pub(crate) fn parse_size(text: &str) -> anyhow::Result<(usize, usize)> {
    let parts = text.split_once(['x', 'X', '×']);
    parts
        .and_then(|(columns, rows)| Some((columns.trim().parse().ok()?, rows.trim().parse().ok()?)))
        .with_context(|| format!("--pixels is '{text}', expected WxH, as 640x480"))
}

pub(crate) fn summary(report: &RunReport, total_s: f64, out: &Path) -> String {
    format!(
        "{}: {}{} × {} pixels of {} µm on {}, {} bands{}, {} ms, {:.1} s\n{}\n",
        report.camera.name,
        report.lens.t_number.map_or_else(String::new, |t| format!("T/{:.2}, ", t.abs())),
        report.film.columns,
        report.film.rows,
        number(report.film.pitch_um),
        report.sensor.sensor,
        report.irradiance.wavelengths_nm.len(),
        report.irradiance.reflections.in_words().map_or_else(String::new, |words| format!(", {words}")),
        milliseconds(report.sensor.exposure_time_s),
        total_s,
        out.join("report.html").display(),
    )
}

/// Returns a time in ms as people write it: of very short and very long ones the order of magnitude.
fn milliseconds(time_s: f64) -> String {
    let ms = 1e3 * time_s;
    if ms == 0.0 || (0.01..1e6).contains(&ms) { format!("{ms:.2}") } else { format!("{ms:.2e}") }
}

/// Shows progress and measures how long each stage takes.
pub(crate) struct Clock {
    bar: Bar,
    started: Instant,
    stages: Mutex<Vec<(Stage, Instant)>>,
    imaging: Mutex<Option<ImagingTimes>>,
    is_sparing: bool,
    /// The thirty-second of the imaging at which memory was last given back.
    last_given: AtomicUsize,
}

impl Clock {
    pub(crate) fn new(quiet: bool) -> Self {
        let (stages, imaging, last_given) = (Mutex::default(), Mutex::default(), AtomicUsize::new(0));
        Self { bar: Bar::new(quiet), started: Instant::now(), stages, imaging, is_sparing: false, last_given }
    }

    /// Returns the clock of a run that has a budget of memory, or has none: what bands needed is given back as they are done, not to add up in the allocator.
    fn sparing(self, is_sparing: bool) -> Self {
        if is_sparing {
            give_back_at_once();
        }
        Self { is_sparing, ..self }
    }

    /// Returns how long the work has taken so far, s.
    pub(crate) fn total_s(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }

    /// Returns how long each stage has taken so far, and the parts of the imaging.
    pub(crate) fn times(&self) -> RunTimes {
        let stages = self.stages.lock().unwrap_or_else(PoisonError::into_inner);
        let ends = stages.iter().skip(1).map(|(_, start)| *start).chain([Instant::now()]);
        let stage = |((stage, start), end): (&(Stage, Instant), Instant)| {
            (stage.title().to_owned(), (end - *start).as_secs_f64())
        };
        let part = |(part, time): (&str, Duration)| (part.to_owned(), time.as_secs_f64());
        let imaging = *self.imaging.lock().unwrap_or_else(PoisonError::into_inner);
        RunTimes {
            stages_s: stages.iter().zip(ends).map(stage).collect(),
            imaging_s: imaging.iter().flat_map(ImagingTimes::parts).map(part).collect(),
        }
    }
}

impl Progress for Clock {
    fn at(&self, stage: Stage, fraction: f64) {
        let mut stages = self.stages.lock().unwrap_or_else(PoisonError::into_inner);
        if stages.last().is_none_or(|(last, _)| *last != stage) {
            stages.push((stage, Instant::now()));
            // What a stage needed is not what the next one does.
            give_back_freed();
        }
        drop(stages);
        let part = (32.0 * fraction) as usize;
        if self.is_sparing && stage == Stage::Irradiance && self.last_given.fetch_max(part, Ordering::Relaxed) < part {
            give_back_freed();
        }
        self.bar.show(stage.title(), fraction);
    }

    fn clock(&self) -> Option<Arc<PartClock>> {
        let started = self.started;
        Some(Arc::new(move || started.elapsed()))
    }

    fn imaged(&self, times: &ImagingTimes) {
        *self.imaging.lock().unwrap_or_else(PoisonError::into_inner) = Some(*times);
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;
    use crate::args::{Cli, Command};

    fn try_camera(options: &[&str]) -> anyhow::Result<Camera> {
        let cli = Cli::read([&["dioptric", "run"], options].concat())?.0;
        let Command::Run(arguments) = &cli.command else { panic!("another command") };
        let kept = camera_of(arguments, &cli.common)?;
        kept.camera().validate()?;
        Ok(kept.camera().clone())
    }

    fn camera(options: &[&str]) -> Camera {
        try_camera(options).unwrap()
    }

    #[test]
    fn the_demo_is_itself_until_something_is_changed() {
        assert_eq!(camera(&[]), Camera::demo().unwrap());
    }

    #[track_caller]
    fn check_film(options: &[&str], expected: (usize, usize), expected_um: f64) {
        let FilmSpec::Pixels { columns, rows, pitch_um } = camera(options).film else { panic!("a film of no size") };
        assert_eq!((columns, rows), expected, "{options:?}");
        assert_relative_eq!(pitch_um, expected_um, max_relative = 1e-12);
    }

    /// The demo's film is 960 × 640 pixels of 33 µm, 31.68 × 21.12 mm; the sensor imx363 has 4032 × 3024 of 1.4 µm.
    #[test]
    fn film_keeps_its_size_under_other_pixels() {
        check_film(&["--pixels", "480x320"], (480, 320), 66.0);
        // What is taller or wider than the film lies within it.
        check_film(&["--pixels", "320x320"], (320, 320), 66.0);
        check_film(&["--pixels", "960x320"], (960, 320), 33.0);
        check_film(&["--pixel-um", "66"], (480, 320), 66.0);
        check_film(&["--pixels", "100x50", "--pixel-um", "2"], (100, 50), 2.0);
        check_film(&["--sensor", "imx363", "--pixels", "403x302"], (403, 302), 1.4 * 4032.0 / 403.0);
    }

    /// A sensor that is named comes with its pixels and its film, unless others are asked for.
    #[test]
    fn a_named_sensor_brings_its_film() {
        let folder = tempfile::tempdir().unwrap();
        let before = |name: &str, scene: &str| {
            let path = folder.path().join(name);
            let film = "film: Pixels(columns: 48, rows: 32, pitch_um: 200.0)";
            let text = format!(
                "(name: \"own\", lens: BuiltIn(\"dgauss-50mm\"), stop: FNumber(4.0), focus: DistanceMm(2000.0), {film}, \
                 sensor: BuiltIn(\"nikon-d5100\"), scene: ({scene}))"
            );
            std::fs::write(&path, text).unwrap();
            path.to_str().unwrap().to_owned()
        };
        let target = "source: Target(pattern: Uniform, columns: 32, rows: 32), field_of_view_deg: 14.0, depth_m: 2.0";
        let target = before("target.ron", target);
        let life = before("life.ron", "source: StillLife(columns: 60, rows: 40)");
        let film = |options: &[&str]| camera(options).film;
        let own = FilmSpec::Pixels { columns: 48, rows: 32, pitch_um: 200.0 };
        for (options, expected) in [
            // Without a sensor the film is that of the file, the demo's or the scene's.
            (&[target.as_str()][..], own),
            (&["--scene", "photo.png"], FilmSpec::Scene),
            // With one it is the sensor's, as far as the scene reaches.
            (&[&target, "--sensor", "imx363"], FilmSpec::Field),
            (&["--scene", "photo.png", "--sensor", "imx363"], FilmSpec::Field),
            (&["--scene", "photo.png", "--lens", "tessar-50mm", "--sensor", "imx363"], FilmSpec::Field),
            (&[&life, "--sensor", "imx363"], FilmSpec::Sensor),
            (&["--sensor", "imx363"], FilmSpec::Sensor),
            // What is asked for besides counts.
            (&["--scene", "photo.png", "--sensor", "imx363", "--film", "scene"], FilmSpec::Scene),
            (&["--scene", "photo.png", "--sensor", "imx363", "--film", "sensor"], FilmSpec::Sensor),
            (&["--scene", "photo.png", "--film", "field"], FilmSpec::Field),
            (
                &["--scene", "photo.png", "--sensor", "imx363", "--pixels", "100x50", "--pixel-um", "2"],
                FilmSpec::Pixels { columns: 100, rows: 50, pitch_um: 2.0 },
            ),
        ] {
            assert_eq!(film(options), expected, "{options:?}");
        }
        check_film(&[&life, "--sensor", "imx363", "--pixels", "2016x1512"], (2016, 1512), 2.8);
        // The scene of 14° is 12 mm wide behind this lens; the sensor, of 5.6 mm, sees less of it.
        let kept = KeptCamera::new(camera(&[&target, "--sensor", "imx363"]));
        let [width_mm, height_mm] = kept.film_size_mm(&Silent, &Cancel::new()).unwrap();
        assert_relative_eq!(width_mm, 4032.0 * 1.4e-3, max_relative = 1e-9);
        assert_relative_eq!(height_mm, 3024.0 * 1.4e-3, max_relative = 1e-9);
    }

    /// A flat cube is not read for the size of its film: of this one the numbers are not there.
    #[test]
    fn a_header_tells_the_film_of_a_flat_cube() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("large.hdr");
        let head = "ENVI\nsamples = 200000\nlines = 100000\nbands = 31\ndata type = 12\ninterleave = bil\n";
        std::fs::write(&path, head).unwrap();
        std::fs::write(path.with_extension("raw"), "").unwrap();
        let scene =
            ["--scene", path.to_str().unwrap(), "--fov-deg", "40", "--depth-m", "1000", "--lens", "pinhole:0.2mm"];
        let more = ["--film-mm", "10", "--pixels", "320x320"];
        let FilmSpec::Pixels { columns, rows, pitch_um } = camera(&[&scene[..], &more].concat()).film else {
            panic!("a film of no size")
        };
        // As wide as 40° are 10 mm behind the hole, and half as high.
        let half_height_mm = 5.0 * 20_f64.to_radians().tan();
        assert_eq!((columns, rows), (320, 320));
        assert_relative_eq!(pitch_um, 1e3 * 2.0 * half_height_mm / 320.0, max_relative = 1e-6);
    }

    #[test]
    fn pixels_that_cannot_be_are_named() {
        for (options, word) in [
            (["--pixels", "0x4"], "columns"),
            (["--pixel-um", "-2"], "--pixel-um"),
            (["--pixel-um", "1e-9"], "columns"),
            (["--pixels", "4"], "WxH"),
        ] {
            let message = try_camera(&options).unwrap_err().to_string();
            assert!(message.contains(word), "{options:?}: {message}");
        }
    }

    #[test]
    fn another_lens_or_scene_has_a_film_and_a_name_of_its_own() {
        let film = Camera::demo().unwrap().film;
        for (options, name, is_demos_film) in [
            (&["--f-number", "8"][..], "Still life, 50 mm double Gauss at f/8", true),
            (&["--lens", "designs/tele.zmx"], "Still life, tele", false),
            (&["--lens", "fisheye-12.5mm", "--f-number", "5.6"], "Still life, fisheye-12.5mm at f/5.6", false),
            (&["--scene", "a/room.exr", "--stop-mm", "3"], "room, 50 mm double Gauss, stop 3 mm", false),
        ] {
            let camera = camera(options);
            assert_eq!((camera.name.as_str(), camera.film == film), (name, is_demos_film));
        }
    }
}
