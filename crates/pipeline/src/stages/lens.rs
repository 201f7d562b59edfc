//! The lens: read, its stop set, moved before the film.

use dioptric_optics::{Lens, LensFile, MonoLens};
use dioptric_spectrum::WavelengthGrid;

use super::spec::LensInputs;
use crate::{PipelineError, REFERENCE_WAVELENGTH_NM, with_blades};

/// A lens ready for use.
#[derive(Clone, Debug)]
pub struct ResolvedLens {
    /// The lens, its stop set and its movements applied.
    pub lens: Lens,
    /// The lens at the reference wavelength.
    pub reference: MonoLens,
    /// What its file states and this program does otherwise or not at all, a sentence each.
    pub notes: Vec<String>,
}

impl ResolvedLens {
    /// What is to be known of it at these wavelengths, a sentence each: its [`notes`](Self::notes), and which glasses are continued beyond
    /// the range in which they are known.
    pub fn notes_at(&self, wavelengths_nm: &[f64]) -> Vec<String> {
        self.notes.iter().cloned().chain(self.lens.notes_on_glass_range(wavelengths_nm)).collect()
    }
}

pub(super) fn resolve(inputs: &LensInputs) -> Result<ResolvedLens, PipelineError> {
    let file = match inputs.given.as_deref() {
        Some(lens) => LensFile::from(lens.clone()),
        None => inputs.choice.open(&inputs.reading)?,
    };
    let note_on_stop = inputs.stop.note_at(&file.lens, REFERENCE_WAVELENGTH_NM);
    let lens = inputs.stop.apply(with_blades(file.lens, inputs.iris)?)?;
    let note_on_iris = lens.note_on_iris();
    let lens = inputs.movements.apply(lens)?;
    let reference = lens.at(REFERENCE_WAVELENGTH_NM)?;
    // What limits the light is that of the lens's own object.
    let note_on_limit = reference.note_on_limit(file.object_distance_mm.unwrap_or(f64::INFINITY));
    let notes = file.notes.into_iter().chain(note_on_stop).chain(note_on_iris).chain(note_on_limit).collect();
    Ok(ResolvedLens { lens, reference, notes })
}

/// Checks that every medium of the lens is known at bands that are known before the scene is.
pub(super) fn check_glasses(lens: &ResolvedLens, grid: Option<&WavelengthGrid>) -> Result<(), PipelineError> {
    for &wavelength_nm in grid.iter().flat_map(|grid| grid.centers_nm()) {
        lens.lens.at(wavelength_nm)?;
    }
    Ok(())
}
