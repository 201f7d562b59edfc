//! A configuration as it stands in our own lens file: what differs from the rest of the file.

use serde::{Deserialize, Serialize};

use crate::{Aperture, CoordinateBreak, DiffractiveSurface, Glass, Shape};

use super::{
    super::{lens_file::Field, text_error::TextError},
    Prescription, Row,
};

/// What differs in a configuration from what the file says outside of it; whatever is left out stays. An infinite radius is that of a
/// plane, an infinite distance that of a far object.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(in crate::formats) struct ConfigurationRow {
    /// What it is called, if anything.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub(super) name: String,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    surfaces: Vec<RowChange>,
    /// The surface that is the stop, counted from 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    stop: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    object_medium: Option<Glass>,
    #[serde(skip_serializing_if = "Option::is_none")]
    moves: Option<Vec<CoordinateBreak>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    apertures: Option<Vec<Aperture>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    diffractive: Option<Vec<DiffractiveSurface>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    image_radius_mm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    image_conic: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    film_distance_mm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    object_distance_mm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    wavelengths_nm: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    wavelength_weights: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    reference_wavelength_nm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fields: Option<Vec<Field>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    field_weights: Option<Vec<f64>>,
}

/// What differs of a surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RowChange {
    /// The surface, counted from 0.
    surface: usize,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    radius_mm: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    shape: Option<Shape>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    mirror: Option<bool>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    semi_aperture_mm: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    medium: Option<Glass>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    thickness_mm: Option<f64>,
}

impl ConfigurationRow {
    /// Returns what differs in a prescription from one that has as many surfaces.
    pub(super) fn between(body: &Prescription, state: &Prescription, name: &str) -> Self {
        let pairs = body.surfaces.iter().zip(&state.surfaces).enumerate();
        Self {
            name: name.to_owned(),
            surfaces: pairs
                .filter_map(|(surface, (before, after))| RowChange::between(surface, before, after))
                .collect(),
            stop: changed(&stop_of(body), &stop_of(state)).flatten(),
            object_medium: changed(&body.object_medium, &state.object_medium),
            moves: changed(&body.moves, &state.moves),
            apertures: changed(&body.apertures, &state.apertures),
            diffractive: changed(&body.diffractive, &state.diffractive),
            image_radius_mm: changed_length(body.image_radius_mm, state.image_radius_mm),
            image_conic: changed(&body.image_conic, &state.image_conic),
            film_distance_mm: changed(&body.film_distance_mm, &state.film_distance_mm).flatten(),
            object_distance_mm: changed_length(body.object_distance_mm, state.object_distance_mm),
            wavelengths_nm: changed(&body.wavelengths_nm, &state.wavelengths_nm),
            wavelength_weights: changed(&body.wavelength_weights, &state.wavelength_weights),
            reference_wavelength_nm: changed(&body.reference_wavelength_nm, &state.reference_wavelength_nm).flatten(),
            fields: changed(&body.fields, &state.fields),
            field_weights: changed(&body.field_weights, &state.field_weights),
        }
    }

    /// Returns the prescription of this configuration.
    pub(super) fn of(self, body: &Prescription) -> Result<Prescription, TextError> {
        let mut state = Prescription { configurations: Vec::new(), ..body.clone() };
        let n_surfaces = state.surfaces.len();
        let beyond = |key: &str, surface: usize| TextError {
            line: None,
            reason: format!(
                "configurations: {key} {surface}, expected a surface from 0 to {}",
                n_surfaces.saturating_sub(1)
            ),
        };
        for change in self.surfaces {
            let row = state.surfaces.get_mut(change.surface).ok_or_else(|| beyond("surface", change.surface))?;
            change.apply(row);
        }
        if let Some(stop) = self.stop {
            if stop >= n_surfaces {
                return Err(beyond("stop", stop));
            }
            state.surfaces.iter_mut().enumerate().for_each(|(surface, row)| row.stop = surface == stop);
        }
        put(&mut state.object_medium, self.object_medium);
        put(&mut state.moves, self.moves);
        put(&mut state.apertures, self.apertures);
        put(&mut state.diffractive, self.diffractive);
        put(&mut state.image_radius_mm, self.image_radius_mm.map(Some));
        put(&mut state.image_conic, self.image_conic);
        put(&mut state.film_distance_mm, self.film_distance_mm.map(Some));
        put(&mut state.object_distance_mm, self.object_distance_mm.map(|mm| (mm != f64::INFINITY).then_some(mm)));
        put(&mut state.wavelengths_nm, self.wavelengths_nm);
        put(&mut state.wavelength_weights, self.wavelength_weights);
        put(&mut state.reference_wavelength_nm, self.reference_wavelength_nm.map(Some));
        put(&mut state.fields, self.fields);
        put(&mut state.field_weights, self.field_weights);
        Ok(state)
    }
}

impl RowChange {
    fn between(surface: usize, before: &Row, after: &Row) -> Option<Self> {
        let change = Self {
            surface,
            radius_mm: changed_length(before.radius_mm, after.radius_mm),
            shape: changed(&before.shape, &after.shape),
            mirror: changed(&before.mirror, &after.mirror),
            semi_aperture_mm: changed(&before.semi_aperture_mm, &after.semi_aperture_mm),
            medium: changed(&before.medium, &after.medium),
            thickness_mm: changed(&before.thickness_mm, &after.thickness_mm),
        };
        let none = Self {
            surface,
            radius_mm: None,
            shape: None,
            mirror: None,
            semi_aperture_mm: None,
            medium: None,
            thickness_mm: None,
        };
        (change != none).then_some(change)
    }

    fn apply(self, row: &mut Row) {
        put(&mut row.radius_mm, self.radius_mm.map(Some));
        put(&mut row.shape, self.shape);
        put(&mut row.mirror, self.mirror);
        put(&mut row.semi_aperture_mm, self.semi_aperture_mm);
        put(&mut row.medium, self.medium);
        put(&mut row.thickness_mm, self.thickness_mm);
    }
}

fn stop_of(prescription: &Prescription) -> Option<usize> {
    prescription.surfaces.iter().position(|row| row.stop)
}

/// Returns what is there after, where that is not what was before.
fn changed<T: Clone + PartialEq>(before: &T, after: &T) -> Option<T> {
    (before != after).then(|| after.clone())
}

/// The same of a radius or distance, of which none is an infinite one.
fn changed_length(before: Option<f64>, after: Option<f64>) -> Option<f64> {
    changed(&before, &after).map(|mm| mm.unwrap_or(f64::INFINITY))
}

fn put<T>(place: &mut T, value: Option<T>) {
    if let Some(value) = value {
        *place = value;
    }
}
