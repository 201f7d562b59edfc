//! The configurations of a file of a design program, each a system of the same surfaces.

use super::{glasses::Glasses, lens_file::LensFile, system::System, text_error::TextError};

/// A configuration as a design program's file has it.
pub(super) struct SystemState {
    /// What the file calls it; empty where it does not.
    pub(super) name: String,
    /// The system, or why it cannot be had.
    pub(super) system: Result<System, TextError>,
}

/// Returns the file of these configurations, of which `stored` is in use where no other is asked for, counted from 1.
///
/// Surfaces are kept that any configuration needs. A rim that the file leaves to the program is as wide as the widest configuration needs:
/// all of them have the same glass. Where a configuration cannot be had that is not in use, the file is that of the one in use alone, with a
/// note.
pub(super) fn build(mut states: Vec<SystemState>, stored: usize, glasses: &Glasses) -> Result<LensFile, TextError> {
    let in_use = glasses.configuration().unwrap_or(stored);
    let n_configurations = states.len();
    if !(1..=n_configurations).contains(&in_use) {
        return Err(crate::OpticsError::Configuration { number: in_use, n_configurations }.into());
    }
    let refusal = states.iter().enumerate().find_map(|(i, state)| Some((i, state.system.as_ref().err()?.in_words())));
    if let Some((i, reason)) = refusal {
        return alone(
            states.swap_remove(in_use - 1),
            (in_use, n_configurations),
            &format!("configuration {}: {reason}", i + 1),
        );
    }
    let mut systems: Vec<(String, System)> =
        states.into_iter().filter_map(|state| Some((state.name, state.system.ok()?))).collect();
    let kept = |system: &System| system.dummies().into_iter().map(|is_dummy| !is_dummy).collect::<Vec<bool>>();
    let mut is_kept = kept(&systems[0].1);
    for (_, system) in &systems[1..] {
        is_kept.iter_mut().zip(kept(system)).for_each(|(is_kept, here)| *is_kept |= here);
    }
    for (_, system) in &mut systems {
        system.keep(&is_kept);
    }
    let fallback = systems[in_use - 1].clone();
    match built(systems, in_use) {
        Ok(file) => Ok(file),
        Err((i, error)) => {
            let state = SystemState { name: fallback.0, system: Ok(fallback.1) };
            let reason = format!("configuration {}: {}", i + 1, error.in_words());
            if i + 1 == in_use { Err(error) } else { alone(state, (in_use, n_configurations), &reason) }
        }
    }
}

/// Returns the file of the configuration in use, with a note on why it has no other.
fn alone(state: SystemState, (in_use, n): (usize, usize), reason: &str) -> Result<LensFile, TextError> {
    let mut file = LensFile { configuration: in_use, ..state.system?.build()? };
    let name = if state.name.is_empty() { String::new() } else { format!(" ({})", state.name) };
    file.notes.push(format!("of {n} configurations number {in_use}{name} alone is read, for not all can be: {reason}"));
    Ok(file)
}

/// Returns the file of all configurations; an error with the place of the one that it is of.
fn built(systems: Vec<(String, System)>, in_use: usize) -> Result<LensFile, (usize, TextError)> {
    let mut files: Vec<(String, LensFile)> = Vec::with_capacity(systems.len());
    let open_rims = open_rims(&systems);
    for (i, (name, system)) in systems.into_iter().enumerate() {
        files.push((name, system.build().map_err(|error| (i, error))?));
    }
    for (surface, _) in open_rims.iter().enumerate().filter(|(_, is_open)| **is_open) {
        let rim_mm = |file: &LensFile| file.lens.interfaces()[surface].surface.semi_aperture_mm;
        let widest_mm = files.iter().map(|(_, file)| rim_mm(file)).fold(0.0, f64::max);
        for (i, (_, file)) in files.iter_mut().enumerate() {
            if rim_mm(file) < widest_mm {
                let lens = file.lens.with_semi_aperture_mm(surface, widest_mm);
                file.lens = lens.map_err(|error| (i, error.into()))?;
            }
        }
    }
    LensFile::of_configurations(files, in_use).map_err(|error| (in_use - 1, error))
}

/// Which rims the file leaves to the program: those that it fixes in no configuration and that are no stop.
fn open_rims(systems: &[(String, System)]) -> Vec<bool> {
    let is_open = |surface: usize| {
        systems.iter().all(|(_, system)| !system.surfaces[surface].is_rim_fixed && system.stop != Some(surface))
    };
    (0..systems[0].1.surfaces.len()).map(is_open).collect()
}
