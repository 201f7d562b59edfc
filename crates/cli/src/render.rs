//! `dioptric render`: a world seen by a camera, ray by ray from its film.

use std::{
    fs,
    path::Path,
    time::{Duration, Instant},
};

use anyhow::{Context, bail};
use dioptric_analysis::{Run, RunReport};
use dioptric_pipeline::{
    Camera, Crop, FilmSpec, KeptCamera, LensReadOptions, LensReflections, LensSpec, LightPaths, PipelineError,
    Progress, RenderEffort, RenderMethod, Rendering, RenderingSummary, SceneSource, SceneSpec, SensorSpec, Silent,
    Stage, Staged, StopSpec, WavelengthSpec, WorldRender, WorldSpec, WorldView, parse_white, with_exposure_s,
    world_camera, write_json, write_scene, write_seen_png,
};
use dioptric_report::write_run;
use dioptric_spectrum::{Cancel, WavelengthGrid};
use serde::Serialize;

use crate::{
    args::Common,
    lens::tell,
    render_args::RenderArgs,
    run::{Clock, parse_size, stem_of, summary},
    terminal::{print, print_json, remark},
};

/// The name of a checkpoint.
const STATE: &str = "render.state";
/// The name of the scene as the middle of the entrance pupil sees it.
const SCENE: &str = "scene.exr";
/// Checkpoints are written at least so far apart.
const BETWEEN_CHECKPOINTS: Duration = Duration::from_secs(10);
/// The name of the picture so far, until the whole one takes its place.
const PREVIEW: &str = "preview.png";
/// Pictures so far are written at least so far apart.
const BETWEEN_PREVIEWS: Duration = Duration::from_secs(1);
/// How many times as wide the pixels of the first looks are; they take 1/64 and 1/16 of a pass.
const FIRST_LOOKS: [usize; 2] = [8, 4];

/// The report of a run, with what is known of the rendering.
#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    run: Option<RunReport>,
    rendering: RenderingSummary,
}

pub(crate) fn run(arguments: &RenderArgs, common: &Common) -> anyhow::Result<()> {
    if let Some(seconds) = arguments.seconds.filter(|seconds| !(seconds.is_finite() && *seconds > 0.0)) {
        bail!("--seconds is {seconds}, expected a finite number above 0");
    }
    if arguments.world.to_str().is_none() {
        // The report could not name it.
        bail!("{}: its name is not in UTF-8, expected one that is", arguments.world.display());
    }
    let (clock, cancel) = (Clock::new(common.quiet), Cancel::new());
    let kept = KeptCamera::new(camera_of(arguments, common)?);
    kept.camera().validate()?;
    check_lens(kept.camera(), arguments)?;
    let world = kept.world(&clock, &cancel)?;
    tell(world.notes(), common);
    let is_of_file = matches!(&kept.camera().scene.source, SceneSource::World(spec) if spec.view == WorldView::OfFile);
    if is_of_file && world.cameras().is_empty() {
        let whole = "the file has no camera: the whole of it is seen; --eye and --look-at give another view";
        tell(&[whole.to_owned()], common);
    }
    let mut camera = kept.camera().clone();
    let SceneSource::World(spec) = kept.camera().scene.source.clone() else { unreachable!("the scene is a world") };
    // The demo's lens is that of the still life.
    let is_still_life = spec.is_still_life();
    let has_lens = arguments.lens.is_some() || arguments.camera_file().is_some() || is_still_life;
    let own = world_camera(&world, &spec, arguments.fov_deg)?;
    let takes_own = arguments.camera_file().is_none() && !is_still_life;
    let own_has_lens = takes_own && camera.take_from_world(&own)?;
    // The level is that of a view, which the camera of the file has a part in.
    let kept = match arguments.mean_luminance_cd_m2 {
        None => kept,
        level => {
            camera.scene.mean_luminance_cd_m2 = level;
            kept.with(|own| own.scene = camera.scene.clone())
        }
    };
    kept.camera().validate()?;
    let world = match arguments.mean_luminance_cd_m2 {
        None => world,
        Some(_) => {
            let world = kept.world(&clock, &cancel)?;
            tell(world.notes().last().map_or(&[], std::slice::from_ref), common);
            world
        }
    };
    if !has_lens && !own_has_lens {
        let grid = camera.wavelengths.grid()?.map_or_else(|| WavelengthGrid::uniform(400.0, 700.0, 10.0), Ok)?;
        let (first_nm, last_nm) = grid.range_nm();
        tell(&world.note_on_bands(first_nm, last_nm).into_iter().collect::<Vec<_>>(), common);
        if let Some(reflections @ (LensReflections::Ghosts | LensReflections::Film(_))) = arguments.lens_reflections {
            bail!(
                "--lens-reflections {reflections} is of a lens, expected --lens or --camera: the camera of the world's file has none"
            );
        }
        if arguments.mean_lux.is_some() {
            bail!(
                "--mean-lux is of a film, expected --lens or --camera, or --mean-luminance: the camera of the world's file has none"
            );
        }
        let render = WorldRender::of_own_camera(world.clone(), &own, &spec, grid)?;
        let render = cropped(render, arguments)?;
        return render_without_sensor(arguments, common, (&render, &clock, &cancel), &|rendering| {
            RenderingSummary::of(rendering, &world, &spec)
        });
    }
    change_lens(&mut camera, arguments)?;
    change_film(&mut camera, arguments)?;
    camera.focus = match arguments.place.focus() {
        Some(focus) => focus,
        // What stands ahead in the middle.
        None if arguments.lens.is_some() => camera.focus_ahead(&world)?,
        None => camera.focus,
    };
    let kept = kept.with(|own| *own = camera);
    let render = kept.world_render(&clock, &cancel)?;
    if arguments.crop.is_some() {
        if arguments.mean_lux.is_some() {
            bail!("--mean-lux is of a whole picture, expected no --crop, or --mean-luminance");
        }
        let render = cropped(render, arguments)?;
        return render_without_sensor(arguments, common, (&render, &clock, &cancel), &|rendering| {
            RenderingSummary::of(rendering, &world, &spec)
        });
    }
    let rendering = refine(arguments, (&render, &clock, &cancel))?;
    finish(arguments, common, (&kept, &clock, &cancel), (&render, &rendering))
}

fn make_folder(out: &Path) -> anyhow::Result<()> {
    fs::create_dir_all(out).with_context(|| format!("cannot make {}", out.display()))
}

/// Returns the part that is asked for.
fn cropped(render: WorldRender, arguments: &RenderArgs) -> anyhow::Result<WorldRender> {
    let Some(Crop { x, y, columns, rows }) = arguments.crop else { return Ok(render) };
    Ok(render.cropped((x, y), (columns, rows))?)
}

/// Returns the camera of the file or the demo before the world, with what the command line changes but for lens and film.
fn camera_of(arguments: &RenderArgs, common: &Common) -> anyhow::Result<Camera> {
    let mut camera = arguments.camera_file().map_or_else(Camera::demo, Camera::read)?;
    let size = arguments.pixels.as_deref().map(parse_size).transpose()?;
    let of_file = arguments.reading.spec_of(&arguments.world);
    let spec = WorldSpec {
        view: arguments.view.view(arguments.camera_of_world()),
        sky: arguments.view.sky.clone(),
        lamps: arguments.view.light.clone(),
        effort: effort(arguments),
        // The view of the still life does not hang on the film, unless that has its pixels.
        size: size.filter(|_| !of_file.is_still_life() || camera.film == FilmSpec::Scene),
        paths: arguments.bounces.map_or_else(LightPaths::default, LightPaths::UpTo),
        seed: common.seed.unwrap_or(1),
        ..of_file
    };
    camera.scene = SceneSpec {
        source: SceneSource::World(spec),
        field_of_view_deg: arguments.fov_deg,
        mean_lux: arguments.mean_lux,
        ..SceneSpec::of_file(arguments.world.clone())
    };
    if arguments.camera_file().is_none() {
        camera.name = stem_of(&arguments.world);
    }
    camera.seed = common.seed.unwrap_or(camera.seed);
    if let Some(list) = arguments.bands.nm()? {
        camera.wavelengths = WavelengthSpec::ListNm(list);
    }
    if let Some(sensor) = &arguments.sensor {
        camera.sensor = SensorSpec::named(sensor);
    }
    if let Some(time_s) = arguments.exposure_s {
        camera.exposure = with_exposure_s(camera.exposure, time_s);
    }
    if let Some(white) = &arguments.white {
        camera.processing.white = parse_white(white)?;
    }
    Ok(camera)
}

fn effort(arguments: &RenderArgs) -> RenderEffort {
    match (arguments.samples, arguments.noise, arguments.seconds) {
        (Some(n), ..) => RenderEffort::Samples(n),
        (None, Some(noise), _) => RenderEffort::Noise(noise),
        // Time ends it.
        (None, None, Some(_)) => RenderEffort::Samples(1 << 24),
        (None, None, None) => RenderEffort::default(),
    }
}

/// Checks that there is such a lens, which a large world is not read without.
fn check_lens(camera: &Camera, arguments: &RenderArgs) -> anyhow::Result<()> {
    if arguments.lens.is_some() {
        let mut camera = camera.clone();
        change_lens(&mut camera, arguments)?;
        camera.lens.open(&camera.lens_reading)?;
    }
    Ok(())
}

fn change_lens(camera: &mut Camera, arguments: &RenderArgs) -> anyhow::Result<()> {
    if let Some(lens) = &arguments.lens {
        camera.lens = LensSpec::named(lens);
        (camera.stop, camera.iris) = (StopSpec::AsGiven, None);
        camera.lens_reading = LensReadOptions::default();
    }
    arguments.state.reading.change(&mut camera.lens_reading);
    camera.stop = arguments.state.stop().unwrap_or(camera.stop);
    arguments.state.iris.change(&mut camera.iris)?;
    arguments.state.movements.change(&mut camera.movements);
    if let Some(kind) = arguments.diffraction {
        camera.diffraction = kind.into();
    }
    camera.lens_reflections = arguments.lens_reflections.unwrap_or(camera.lens_reflections);
    Ok(())
}

/// Changes the pixels of the film; its width stays unless another is given.
fn change_film(camera: &mut Camera, arguments: &RenderArgs) -> anyhow::Result<()> {
    let size = arguments.pixels.as_deref().map(parse_size).transpose()?;
    camera.film = match (camera.film, size, arguments.film_width_mm) {
        (film, None, None) => film,
        (FilmSpec::Pixels { columns, pitch_um, .. }, Some(size), width_mm) => {
            pixels(size, width_mm.unwrap_or(1e-3 * pitch_um * columns as f64))
        }
        (FilmSpec::Pixels { columns, rows, .. }, None, Some(width_mm)) => pixels((columns, rows), width_mm),
        (_, Some(size), Some(width_mm)) => pixels(size, width_mm),
        // The view of the world has the pixels asked for.
        (film @ FilmSpec::Scene, Some(_), None) => film,
        _ => bail!("--pixels and --film-width-mm go together, unless the camera has a film of its own"),
    };
    Ok(())
}

fn pixels((columns, rows): (usize, usize), width_mm: f64) -> FilmSpec {
    FilmSpec::Pixels { columns, rows, pitch_um: 1e3 * width_mm / columns as f64 }
}

/// What a rendering is, and who follows it.
type Job<'a> = (&'a WorldRender, &'a Clock, &'a Cancel);

/// Renders pass by pass, and keeps what there is every now and then.
fn refine(arguments: &RenderArgs, (render, clock, cancel): Job<'_>) -> anyhow::Result<Rendering> {
    let (began, effort) = (Instant::now(), effort(arguments));
    let out = &arguments.out;
    make_folder(out)?;
    let (state, identity) = (out.join(STATE), render.identity(effort));
    let mut renderer = render.renderer()?;
    if arguments.resume && state.exists() {
        renderer.resume(&state, &identity)?;
    }
    let preview = out.join(PREVIEW);
    if renderer.n_passes() == 0 {
        clock.at(Stage::Irradiance, 0.0);
        for factor in FIRST_LOOKS {
            let (picture, factor_seen) = render.first_look(factor, cancel)?;
            write_seen_png(&picture, factor_seen, &preview)?;
            // What is clean needs no finer look.
            if factor_seen != factor {
                break;
            }
        }
    }
    let (mut saved, mut shown): (Option<Instant>, Option<Instant>) = (None, None);
    let is_due = |last: Option<Instant>, after: Duration| last.is_none_or(|at| at.elapsed() >= after);
    render.refine(&mut renderer, effort, clock, cancel, &mut |renderer| {
        let elapsed = began.elapsed();
        let is_over = arguments.seconds.is_some_and(|seconds| elapsed.as_secs_f64() >= seconds);
        if is_over || is_due(saved, BETWEEN_CHECKPOINTS) {
            renderer.save(&state, &identity)?;
            saved = Some(Instant::now());
        }
        if is_over || is_due(shown, BETWEEN_PREVIEWS) {
            write_seen_png(&renderer.picture(), 1, &preview)?;
            shown = Some(Instant::now());
        }
        Ok::<bool, PipelineError>(!is_over)
    })?;
    renderer.save(&state, &identity)?;
    Ok(renderer.rendering())
}

/// Takes a rendering of irradiance through the sensor to the picture, and writes everything.
fn finish(
    arguments: &RenderArgs,
    common: &Common,
    (kept, clock, cancel): (&KeptCamera, &Clock, &Cancel),
    (render, rendering): (&WorldRender, &Rendering),
) -> anyhow::Result<()> {
    let out = &arguments.out;
    kept.keep_irradiance(rendering.picture.clone())?;
    let staged = Staged::folder(out)?;
    let capture = kept.capture(clock, cancel)?;
    let (model, depth) = (kept.model(clock, cancel)?, kept.depth(clock, cancel)?);
    clock.at(Stage::Report, 0.0);
    let run = Run { capture: &capture, model: &model, depth: Some(&depth) };
    let mut report = write_run(&run, staged.path(), &|| clock.times())?;
    // The same samples, with their standard errors.
    let rendering = &brightened(rendering, capture.irradiance.summary.factor);
    let files = render.write_files(rendering, &render.auxiliary(cancel)?, staged.path())?;
    report.files.extend(
        files
            .into_iter()
            .filter(|file| !report.files.iter().any(|known| known == file))
            .map(str::to_owned)
            .collect::<Vec<_>>(),
    );
    if arguments.layers.is_some() {
        report.files.push(SCENE.to_owned());
    }
    let world = kept.world(&Silent, cancel)?;
    let SceneSource::World(spec) = &kept.camera().scene.source else { unreachable!("the scene is a world") };
    let rendering = RenderingSummary::of(rendering, &world, spec);
    let report = Report { run: Some(report), rendering };
    write_json(&staged.path().join("report.json"), &report)?;
    write_json(&staged.path().join("timings.json"), &clock.times())?;
    kept.write_resume_file(&capture, staged.path())?;
    if let Some(layers) = arguments.layers {
        let seen = KeptCamera::new(kept.camera().clone()).with(|camera| {
            if let SceneSource::World(spec) = &mut camera.scene.source {
                (spec.method, spec.layers) = (RenderMethod::Forward, layers);
                // Where time ended the rendering, as many samples as it took.
                if arguments.seconds.is_some() {
                    spec.effort = RenderEffort::Samples((report.rendering.samples_per_pixel as u32).max(1));
                }
            }
        });
        write_scene(&seen, &staged.path().join(SCENE), clock, cancel)?;
    }
    staged.commit()?;
    remove_preview(out);
    tell(&capture.lens_notes(), common);
    if common.json {
        return print_json(&report);
    }
    remark(common.quiet, "");
    match &report.run {
        Some(run) if !common.quiet => print(&(samples(&report.rendering) + &summary(run, clock.total_s(), out))),
        _ => Ok(()),
    }
}

/// Returns a rendering under light so many times as strong.
fn brightened(rendering: &Rendering, factor: f64) -> Rendering {
    let mut rendering = rendering.clone();
    if factor != 1.0 {
        let planes = rendering.picture.planes_mut().chain(rendering.standard_error.planes_mut());
        planes.for_each(|mut plane| plane *= factor as f32);
    }
    rendering
}

/// Renders what a camera by formula sees, which has no film, or a part of a picture, which is no sensor's: the picture is as
/// an observer sees it.
fn render_without_sensor(
    arguments: &RenderArgs,
    common: &Common,
    job: Job<'_>,
    sum_up: &dyn Fn(&Rendering) -> RenderingSummary,
) -> anyhow::Result<()> {
    let (render, clock, cancel) = job;
    if arguments.layers.is_some() {
        bail!("--layers is of a whole picture on the film of a lens, expected --lens or --camera, and no --crop");
    }
    let rendering = refine(arguments, job)?;
    let out = &arguments.out;
    let staged = Staged::folder(out)?;
    clock.at(Stage::Report, 0.0);
    render.write_files(&rendering, &render.auxiliary(cancel)?, staged.path())?;
    write_seen_png(&rendering.picture, 1, &staged.path().join("picture.png"))?;
    let report = Report { run: None, rendering: sum_up(&rendering) };
    write_json(&staged.path().join("report.json"), &report)?;
    staged.commit()?;
    remove_preview(out);
    if common.json {
        return print_json(&report);
    }
    let text = samples(&report.rendering) + &format!("{}, as an observer sees it\n", out.join("picture.png").display());
    if common.quiet { Ok(()) } else { print(&text) }
}

/// Removes the picture so far when the whole one is there.
fn remove_preview(out: &Path) {
    // One that cannot be removed does no harm.
    let _ = fs::remove_file(out.join(PREVIEW));
}

fn samples(rendering: &RenderingSummary) -> String {
    let n = rendering.samples_per_pixel;
    match &rendering.relative_standard_error {
        Some(errors) => {
            let error = 100.0 * errors.iter().sum::<f64>() / errors.len() as f64;
            format!("{n:.0} samples a pixel, standard error {error:.2} % of the mean in a band\n")
        }
        None => format!("{n:.0} samples a pixel\n"),
    }
}
