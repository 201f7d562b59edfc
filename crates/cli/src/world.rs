//! `dioptric world`: what the file of a world holds.

use std::{fmt::Write, path::Path};

use dioptric_pipeline::{
    Camera, KeptCamera, SceneSource, SceneSpec, Silent, WorldSpec, WorldSummary, open_world, write_world,
};
use dioptric_spectrum::Cancel;
use serde::Serialize;

use crate::{
    args::Common,
    lens::tell,
    render_args::WorldCommand,
    terminal::{print, print_json},
};

/// So many materials are named.
const MOST_NAMED: usize = 24;

pub(crate) fn run(command: &WorldCommand, common: &Common) -> anyhow::Result<()> {
    let (world, reading) = match command {
        WorldCommand::Info { world, reading } => (world, reading),
        WorldCommand::Convert { input, output, reading, strict } => {
            return convert((output, *strict), &reading.spec_of(input), common);
        }
    };
    let spec = reading.spec_of(world);
    let mut camera = Camera::demo()?;
    camera.scene = SceneSpec { source: SceneSource::World(spec.clone()), ..SceneSpec::of_file(world.clone()) };
    let read = KeptCamera::new(camera).world(&Silent, &Cancel::new())?;
    let summary = WorldSummary::of(&read, &spec);
    if common.json {
        return print_json(&summary);
    }
    print(&table(&summary)?)
}

/// What became of a world.
#[derive(Serialize)]
struct Converted<'a> {
    input: &'a Path,
    output: &'a Path,
    notes: Vec<String>,
    losses: Vec<String>,
}

fn convert((output, is_strict): (&Path, bool), spec: &WorldSpec, common: &Common) -> anyhow::Result<()> {
    let input = &*spec.file;
    let builder = open_world(input, &spec.reading(), &Cancel::new())?;
    let notes = builder.notes();
    if is_strict && !notes.is_empty() {
        let notes = notes.join("; ");
        anyhow::bail!("{}: not all that the file says is read, which --strict asks for: {notes}", input.display());
    }
    let losses = write_world(&builder, output, is_strict)?;
    if common.json {
        return print_json(&Converted { input, output, notes, losses });
    }
    tell(&notes, common);
    tell(&losses.iter().map(|loss| format!("not held by the format: {loss}")).collect::<Vec<_>>(), common);
    Ok(())
}

fn table(summary: &WorldSummary) -> Result<String, std::fmt::Error> {
    let mut text = String::new();
    writeln!(text, "{}", summary.file.display())?;
    let point = |p: [f64; 3]| format!("{:.4}, {:.4}, {:.4}", p[0], p[1], p[2]);
    match summary.bounds_m {
        Some([low, high]) => {
            let size: Vec<String> = (0..3).map(|k| format!("{:.4}", high[k] - low[k])).collect();
            writeln!(text, "size       {} m, from {} to {}", size.join(" × "), point(low), point(high))?;
        }
        None => writeln!(text, "size       nothing in it has an extent")?,
    }
    writeln!(text, "unit       {} m; up is {}", summary.unit_m, point(summary.up))?;
    writeln!(text, "shapes     {} triangles and other primitives", summary.n_primitives)?;
    writeln!(text, "lights     {}", summary.n_lights)?;
    let named = |names: &[String]| {
        let more = names.len().saturating_sub(MOST_NAMED);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        format!("{}{more}", names.iter().take(MOST_NAMED).map(String::as_str).collect::<Vec<_>>().join(", "))
    };
    writeln!(text, "objects    {}", named(&summary.objects))?;
    writeln!(text, "materials  {}", named(&summary.materials))?;
    if summary.cameras.is_empty() {
        writeln!(text, "cameras    none: the whole is seen, or what --eye and --look-at say")?;
    }
    for (index, camera) in summary.cameras.iter().enumerate() {
        let fov = camera.horizontal_fov_deg.map_or_else(String::new, |deg| format!(", {deg:.1}° wide"));
        writeln!(
            text,
            "camera {:<3} '{}': {}{fov}, {} × {} pixels, at {} towards {}",
            index + 1,
            camera.name,
            camera.kind,
            camera.size.0,
            camera.size.1,
            point(camera.eye_m),
            point(camera.forward)
        )?;
    }
    for (index, animation) in summary.animations.iter().enumerate() {
        writeln!(text, "moves {:<4} '{}': for {:.3} s", index + 1, animation.name, animation.end_s)?;
    }
    if !summary.variants.is_empty() {
        writeln!(text, "variants   {}", summary.variants.join(", "))?;
    }
    writeln!(text, "files      {}", summary.sources.len())?;
    for note in &summary.notes {
        writeln!(text, "note: {note}")?;
    }
    Ok(text)
}
