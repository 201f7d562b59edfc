//! `dioptric lightfield`: views, refocused pictures and depth of a light-field camera.

use dioptric_pipeline::{
    ArrayFrame, Camera, DepthSearch, ExrSamples, IRRADIANCE_FILE, Irradiance, KeptCamera, LightField, MicroArray,
    RenderEffort, SceneSource, Staged,
};
use dioptric_report::{LightFieldReport, ViewFiles, write_light_field};
use dioptric_spectrum::Cancel;

use crate::{
    args::Common,
    paintings::painting_folder,
    render_args::LightFieldArgs,
    run::Clock,
    terminal::{print, print_json, remark},
};

/// Refocused pictures where no depths are asked for.
const N_REFOCUSED: usize = 8;
/// How much farther than the scene depths are sought, as a share.
const MARGIN: f64 = 0.1;

pub(crate) fn run(arguments: &LightFieldArgs, common: &Common) -> anyhow::Result<()> {
    let mut camera = Camera::read(&arguments.camera)?;
    if let SceneSource::World(spec) = &mut camera.scene.source {
        spec.effort = arguments.samples.map_or(spec.effort, RenderEffort::Samples);
        spec.seed = common.seed.unwrap_or(spec.seed);
    }
    let kept = KeptCamera::new(camera).with_paintings(painting_folder());
    kept.check()?;
    let staged = Staged::folder(&arguments.out)?;
    let (clock, cancel) = (Clock::new(common.quiet), Cancel::new());
    let n_views = arguments.views.map(usize::from);
    let field = match (&arguments.frame, &arguments.irradiance) {
        (Some(path), _) => {
            let frame = ArrayFrame::read(path, arguments.white.as_deref())?;
            frame.notes().iter().for_each(|note| remark(common.quiet, note));
            let (field, array) = kept.decoded_frame(&frame, n_views, &clock, &cancel)?;
            if arguments.white.is_some() {
                let MicroArray { pitch_mm, turned_deg, offset_mm: (right_mm, up_mm), .. } = array;
                let (pitch_um, right_um, up_um) = (1e3 * pitch_mm, 1e3 * right_mm, 1e3 * up_mm);
                remark(
                    common.quiet,
                    &format!(
                        "the white picture shows an array of a pitch of {pitch_um:.3} µm, turned by {turned_deg:.3}°, {right_um:.2} µm to the right and {up_um:.2} µm up"
                    ),
                );
            }
            field
        }
        (None, Some(path)) => {
            let mut notes = vec![];
            let irradiance = Irradiance::read_exr(path, None)?.told_in(&mut notes);
            notes.iter().for_each(|note| remark(common.quiet, note));
            kept.decoded(&irradiance, n_views, &clock, &cancel)?
        }
        (None, None) => kept.light_field(n_views, &clock, &cancel)?,
    };
    let search = search(arguments, &kept, (&clock, &cancel))?;
    let estimate = field.depth(&search, &cancel)?;
    let depths_m = if arguments.refocus_m.is_empty() { series(&field, &search) } else { arguments.refocus_m.clone() };
    let also = ViewFiles { exr: arguments.exr, hci: arguments.hci };
    let report = write_light_field(&field, &estimate, &depths_m, also, staged.path())?;
    if arguments.irradiance.is_none() && arguments.frame.is_none() && camera_has_array(&kept) {
        let white = kept.white_of(&clock, &cancel)?;
        let irradiance = kept.irradiance(&clock, &cancel)?;
        irradiance.write_exr_under(&white, &staged.path().join(IRRADIANCE_FILE), ExrSamples::Single)?;
    }
    staged.commit()?;
    drop(clock);
    match (common.json, common.quiet) {
        (true, _) => print_json(&report),
        (false, true) => Ok(()),
        (false, false) => print(&(summary(&report) + &format!("{}\n", arguments.out.join("depth.png").display()))),
    }
}

fn camera_has_array(kept: &KeptCamera) -> bool {
    matches!(kept.camera().light_field, Some(dioptric_pipeline::LightFieldSpec::Array(_)))
}

/// Returns where depth is sought: what is asked for, or a little more than the scene has.
fn search(
    arguments: &LightFieldArgs,
    kept: &KeptCamera,
    (clock, cancel): (&Clock, &Cancel),
) -> anyhow::Result<DepthSearch> {
    let mut range = (arguments.near_m, arguments.far_m);
    if range.0.is_none() || range.1.is_none() {
        let (near_m, far_m) = kept.depth(clock, cancel)?.range_m();
        range = (range.0.or(Some(near_m * (1.0 - MARGIN))), range.1.or(Some(far_m * (1.0 + MARGIN))));
    }
    let (near_m, far_m) = (range.0.unwrap_or(0.0), range.1.unwrap_or(f64::INFINITY));
    Ok(DepthSearch { near_m, far_m, radius_px: arguments.radius_px })
}

/// Returns depths over a range, evenly in disparity.
fn series(field: &LightField, search: &DepthSearch) -> Vec<f64> {
    let geometry = field.geometry();
    let (most, least) = (geometry.disparity_px(search.near_m), geometry.disparity_px(search.far_m));
    let share = |i: usize| i as f64 / (N_REFOCUSED - 1) as f64;
    (0..N_REFOCUSED).map(|i| geometry.depth_m(most + share(i) * (least - most))).collect()
}

fn summary(report: &LightFieldReport) -> String {
    let ((rows, columns), (height, width)) = (report.n_views, report.size);
    let n_whole = report.whole.iter().filter(|&&is| is).count();
    let mut text = format!("{columns} × {rows} views of {width} × {height} samples, {n_whole} of them whole\n");
    for (depth_m, disparity_px) in &report.refocused {
        text += &format!("refocused on {depth_m:.4} m: neighboring views {disparity_px:+.4} px apart\n");
    }
    if let Some([near_m, middle_m, far_m]) = report.depth_m {
        let share = 100.0 * report.confident_share;
        text +=
            &format!("depth {near_m:.3} to {far_m:.3} m, median {middle_m:.3} m, over {share:.0} % of the samples\n");
    }
    if let Some(error) = &report.depth_error {
        text += &format!(
            "against the scene: median error {:.2} %, {:.0} % within 1 %\n",
            100.0 * error.median,
            100.0 * error.share_within_1_percent
        );
    }
    text
}
