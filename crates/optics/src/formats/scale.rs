//! Lens files whose lens is made larger or smaller.

use super::lens_file::{Configuration, Field, LensFile};
use crate::{Lens, OpticsError};

impl LensFile {
    /// Returns the file with all lengths so many times as long: of the lens and its microlenses ([`Lens::scaled`]), the places of the
    /// film and of the object, and fields that are heights, in every configuration.
    ///
    /// # Errors
    /// Those of [`Lens::scaled`].
    pub fn scaled(mut self, factor: f64) -> Result<Self, OpticsError> {
        let Self { lens, film_distance_mm, object_distance_mm, fields, configurations, microlens, .. } = &mut self;
        scale((lens, film_distance_mm, object_distance_mm, fields), factor)?;
        for Configuration { lens, film_distance_mm, object_distance_mm, fields, .. } in configurations {
            scale((lens, film_distance_mm, object_distance_mm, fields), factor)?;
        }
        if let Some(microlens) = microlens {
            microlens.lens = microlens.lens.scaled(factor)?;
            microlens.offsets_mm.iter_mut().flatten().for_each(|length_mm| *length_mm *= factor);
        }
        Ok(self)
    }
}

/// A lens and the lengths of its use: of the film, of the object, and the fields.
type Use<'a> = (&'a mut Lens, &'a mut Option<f64>, &'a mut Option<f64>, &'a mut Vec<Field>);

fn scale((lens, film_mm, object_mm, fields): Use<'_>, factor: f64) -> Result<(), OpticsError> {
    *lens = lens.scaled(factor)?;
    for length_mm in [film_mm, object_mm].into_iter().flatten() {
        *length_mm *= factor;
    }
    for field in fields {
        match field {
            Field::Angle { .. } => {}
            Field::ObjectHeight { x_mm, y_mm }
            | Field::ImageHeight { x_mm, y_mm }
            | Field::RealImageHeight { x_mm, y_mm } => {
                *x_mm *= factor;
                *y_mm *= factor;
            }
        }
    }
    Ok(())
}
