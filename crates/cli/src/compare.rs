//! `dioptric compare`: a world by rays from the film against its view blurred by point spread functions.

use std::fmt::Write;

use dioptric_analysis::MethodComparison;
use dioptric_pipeline::{Camera, RenderEffort, SceneSource, Staged};
use dioptric_report::write_comparison;
use dioptric_spectrum::Cancel;

use crate::{
    args::Common,
    lens::tell,
    render_args::CompareArgs,
    run::Clock,
    terminal::{print, print_json, remark},
};

pub(crate) fn run(arguments: &CompareArgs, common: &Common) -> anyhow::Result<()> {
    let mut camera = Camera::read(&arguments.camera)?;
    if let SceneSource::World(spec) = &mut camera.scene.source {
        spec.effort = arguments.samples.map_or(spec.effort, RenderEffort::Samples);
        spec.seed = common.seed.unwrap_or(spec.seed);
    }
    camera.validate()?;
    let staged = Staged::folder(&arguments.out)?;
    let clock = Clock::new(common.quiet);
    let comparison = MethodComparison::of(&camera, &clock, &Cancel::new())?;
    write_comparison(&comparison, staged.path())?;
    staged.commit()?;
    drop(clock);
    tell(&comparison.notes, common);
    if common.json {
        return print_json(&comparison);
    }
    remark(common.quiet, "");
    print(&table(&comparison)?)?;
    if common.quiet { Ok(()) } else { print(&format!("{}\n", arguments.out.join("compare.png").display())) }
}

fn table(comparison: &MethodComparison) -> Result<String, std::fmt::Error> {
    let mut text = format!(
        "{}: the view blurred against rays from the film; depth edges reach {:.1} % of the picture\n\
         band, nm  total, %        off edges, %  edge band, %  noise, %  right, px  down, px  larger, %  blur, px²\n",
        comparison.name,
        100.0 * comparison.edge_fraction
    );
    for row in &comparison.rows {
        let band = row.edge_band.map_or_else(|| "–".to_owned(), |share| format!("{:.2}", 100.0 * share));
        let known = |share: f64| if share.is_nan() { "–".to_owned() } else { format!("{:.2}", 100.0 * share) };
        let told = |change: f64| if change.is_nan() { "–".to_owned() } else { format!("{change:+.3}") };
        writeln!(
            text,
            "{:>8.1}  {:>+6.2} ± {:<5}  {:>12.2}  {band:>12}  {:>8}  {:>9}  {:>8}  {:>9}  {:>9}",
            row.wavelength_nm,
            100.0 * row.total,
            known(row.total_error),
            100.0 * row.off_edges,
            known(row.noise),
            told(row.fit.right_px),
            told(row.fit.down_px),
            told(100.0 * row.fit.magnification),
            told(row.fit.blur_px2)
        )?;
    }
    Ok(text)
}
