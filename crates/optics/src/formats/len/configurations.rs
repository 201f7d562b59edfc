//! The table of configurations of an OSLO file: `TH 3 2 8` is the thickness behind surface 3 in configuration 2.

use super::{
    super::{
        configuration::MOST_CONFIGURATIONS,
        lens_file::LensFile,
        system_states::{self, SystemState},
        text_error::TextError,
    },
    Len,
    statement::Statement,
    surface::LenSurface,
};

/// A number of a surface in another configuration than the first.
#[derive(Clone)]
pub(super) struct Override {
    line: usize,
    keyword: String,
    surface: usize,
    /// Counted from 1.
    configuration: usize,
    value: f64,
    /// What is wrong with it, where it cannot be worked out.
    refusal: Option<String>,
}

impl Override {
    pub(super) fn of(statement: &Statement) -> Result<Self, TextError> {
        let is_of_wavelength = statement.of_wavelength().is_some();
        let is_known = !is_of_wavelength && LenSurface::default().put(&statement.keyword, 0.0);
        // Of what is not known, the configuration may stand in either place.
        let configuration = statement.count(usize::from(is_known)).unwrap_or(2);
        if !(1..=MOST_CONFIGURATIONS).contains(&configuration) {
            return Err(statement.wrong(format!("configuration {configuration}, expected 1 to {MOST_CONFIGURATIONS}")));
        }
        let refusal = (!is_known).then(|| "is not supported in a table of configurations".to_owned());
        Ok(Self {
            line: statement.line,
            keyword: statement.keyword.clone(),
            surface: if is_known { statement.count(0)? } else { 0 },
            configuration,
            value: if is_known { statement.number(2)? } else { 0.0 },
            refusal,
        })
    }

    fn wrong(&self, reason: &str) -> TextError {
        TextError { line: Some(self.line), reason: format!("{}: {reason}", self.keyword) }
    }
}

impl Len<'_> {
    /// Returns the file with all of its configurations.
    pub(super) fn build(self) -> Result<LensFile, TextError> {
        let n_configurations = self.overrides.iter().map(|change| change.configuration).max().unwrap_or(1);
        if n_configurations < 2 {
            return self.build_one();
        }
        let glasses = self.glasses.clone();
        let state =
            |number: usize| SystemState { name: String::new(), system: self.state(number).and_then(Self::into_system) };
        system_states::build((1..=n_configurations).map(state).collect(), 1, &glasses)
    }

    /// Returns the file of the one configuration, its film at the paraxial focus where a solve puts it there.
    fn build_one(mut self) -> Result<LensFile, TextError> {
        let last = self.surfaces.len().saturating_sub(2);
        let focused = self.surfaces.get_mut(last).filter(|surface| surface.axial_height == Some(0.0));
        let Some(surface) = focused else { return self.into_system()?.build() };
        surface.axial_height = None;
        let line = surface.line;
        let shift_mm = self.surfaces.last().map_or(0.0, |image| image.thickness) * self.mm_per_unit;
        let mut file = LensFile { film_distance_mm: None, ..self.into_system()?.build()? };
        let Some(focus_mm) = file.focus_mm() else {
            let reason = "PY: the lens has no focus for the image to stand at".to_owned();
            return Err(TextError { line: Some(line), reason });
        };
        file.film_distance_mm = Some(focus_mm + shift_mm);
        file.notes.push("the film stands at the paraxial focus, as the file asks for (PY)".to_owned());
        Ok(file)
    }

    /// Returns the file as it is in this configuration.
    fn state(&self, number: usize) -> Result<Self, TextError> {
        let mut state = self.clone();
        for change in self.overrides.iter().filter(|change| change.configuration == number) {
            if let Some(refusal) = &change.refusal {
                return Err(change.wrong(refusal));
            }
            let n_surfaces = state.surfaces.len();
            let Some(surface) = state.surfaces.get_mut(change.surface) else {
                return Err(change.wrong(&format!(
                    "surface {}, expected 0 to {}",
                    change.surface,
                    n_surfaces.saturating_sub(1)
                )));
            };
            let _ = surface.put(&change.keyword, change.value);
        }
        if let (Some((solve, line)), true) = (self.solves.first(), number > 1) {
            let reason = format!("{solve}: the value of the solve is stored for configuration 1 alone");
            return Err(TextError { line: Some(*line), reason });
        }
        Ok(state)
    }
}
