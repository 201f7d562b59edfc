//! `dioptric trace`: rays from a table through a lens.

use std::{fs::File, io};

use anyhow::Context;
use dioptric_analysis::{RayTable, TraceError, TraceSettings};
use dioptric_pipeline::Staged;

use crate::{
    args::{Common, TraceArgs},
    lens::tell,
    terminal::{output_error, remark},
};

pub(crate) fn run(arguments: &TraceArgs, common: &Common) -> anyhow::Result<()> {
    let used = arguments.lens.open(common)?;
    let wavelength_nm = used.wavelength_or_usual();
    let lens = arguments.lens.state.apply(used, &[wavelength_nm], common)?.lens;
    let rays = RayTable::open(&arguments.rays)?;
    tell(&lens.notes_on_ranges(&rays.wavelengths_nm()), common);
    let settings = TraceSettings { rims_clip: !arguments.no_clip, film_distance_mm: arguments.film_mm };
    let Some(path) = &arguments.output else {
        let out = io::BufWriter::new(io::stdout().lock());
        return rays.trace(&lens, &settings, out).map_err(without_closed_pipe);
    };
    let staged = Staged::file(path)?;
    let file = File::create(staged.path()).with_context(|| format!("cannot write {}", path.display()))?;
    rays.trace(&lens, &settings, io::BufWriter::new(file))?;
    staged.commit()?;
    remark(common.quiet, &format!("wrote {}", path.display()));
    Ok(())
}

fn without_closed_pipe(error: TraceError) -> anyhow::Error {
    match error {
        TraceError::Write(io) => output_error(io),
        other => other.into(),
    }
}
