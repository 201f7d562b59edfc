//! Configurations: the positions of a zoom lens, and whatever else a file has several of.

use crate::OpticsError;

use super::{
    lens_file::{Configuration, LensFile},
    text_error::TextError,
};

/// The most configurations of a file.
pub(super) const MOST_CONFIGURATIONS: usize = 100;

impl LensFile {
    /// Returns the file with this configuration in use, counted from 1. A file that names none has one.
    ///
    /// # Errors
    /// When the file does not have so many.
    pub fn with_configuration(mut self, number: usize) -> Result<Self, OpticsError> {
        let n_configurations = self.configurations.len().max(1);
        // A file may have been read with one alone of several.
        if number == self.configuration {
            return Ok(self);
        }
        if !(1..=n_configurations).contains(&number) {
            return Err(OpticsError::Configuration { number, n_configurations });
        }
        let states = self.states();
        self.configurations =
            states.iter().zip(&self.configurations).map(|(file, kept)| file.as_configuration(&kept.name)).collect();
        Ok(Self { configurations: self.configurations, configuration: number, ..states[number - 1].clone() })
    }

    /// Returns the file with the configuration in use alone.
    pub fn of_one_configuration(self) -> Self {
        Self { configurations: Vec::new(), configuration: 1, ..self }
    }

    /// Returns the file once for each configuration, each with that one alone. The lens and its use as the file has them stand for the
    /// configuration in use, whatever is kept of it.
    pub fn states(&self) -> Vec<Self> {
        let alone = Self { configurations: Vec::new(), configuration: 1, ..self.clone() };
        if self.configurations.is_empty() {
            return vec![alone];
        }
        let state = |(i, kept): (usize, &Configuration)| match i + 1 == self.configuration {
            true => alone.clone(),
            false => Self {
                lens: kept.lens.clone(),
                film_distance_mm: kept.film_distance_mm,
                object_distance_mm: kept.object_distance_mm,
                wavelengths_nm: kept.wavelengths_nm.clone(),
                wavelength_weights: kept.wavelength_weights.clone(),
                reference_wavelength_nm: kept.reference_wavelength_nm,
                fields: kept.fields.clone(),
                field_weights: kept.field_weights.clone(),
                ..alone.clone()
            },
        };
        self.configurations.iter().enumerate().map(state).collect()
    }

    /// Returns how the file calls its configurations, as far as it does; nothing of a file with one.
    pub fn configuration_names(&self) -> Vec<&str> {
        self.configurations.iter().map(|configuration| configuration.name.as_str()).collect()
    }

    fn as_configuration(&self, name: &str) -> Configuration {
        Configuration {
            name: name.to_owned(),
            lens: self.lens.clone(),
            film_distance_mm: self.film_distance_mm,
            object_distance_mm: self.object_distance_mm,
            wavelengths_nm: self.wavelengths_nm.clone(),
            wavelength_weights: self.wavelength_weights.clone(),
            reference_wavelength_nm: self.reference_wavelength_nm,
            fields: self.fields.clone(),
            field_weights: self.field_weights.clone(),
        }
    }

    /// Returns the file whose configurations are these, each with its name, and of which this one is in use, counted from 1.
    pub(super) fn of_configurations(files: Vec<(String, Self)>, in_use: usize) -> Result<Self, TextError> {
        let configurations = files.iter().map(|(name, file)| file.as_configuration(name)).collect();
        let n_configurations = files.len();
        match files.into_iter().nth(in_use.wrapping_sub(1)) {
            Some((_, file)) if n_configurations > 1 => Ok(Self { configurations, configuration: in_use, ..file }),
            Some((_, file)) => Ok(file),
            None => Err(OpticsError::Configuration { number: in_use, n_configurations }.into()),
        }
    }

    /// Returns a sentence on which configuration is in use, of a file that has several.
    pub(super) fn note_on_configuration(&self) -> Option<String> {
        let n = self.configurations.len();
        let name = match self.configurations.get(self.configuration.wrapping_sub(1)).map(|kept| kept.name.as_str()) {
            None | Some("") => String::new(),
            Some(name) => format!(" ({name})"),
        };
        (n > 1).then(|| format!("of {n} configurations number {}{name} is in use", self.configuration))
    }
}
