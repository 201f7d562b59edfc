//! What imaging a scene asks of a traced lens.

use std::sync::Arc;

use glam::DVec2;

use crate::{
    FilmMap, Kernel, LensImage, LensImageModel, PsfError, PsfQuery, PupilDivision, RadialGeometry, RadialMap,
    WIDEST_FIELD_TAN, model::Form, part_image::PartImage,
};

impl LensImageModel {
    /// Returns the images through the parts of a division of the pupil, which add up to that of the whole: views of the scene from as many
    /// places, each blurred by what goes through its part. Blur radii are those of the whole pupil.
    ///
    /// The pupil of each field is divided as that field sees it, vignetted or not.
    ///
    /// # Errors
    /// For diffraction integrals, which parts of a pupil do not add up to; for blended pictures, and where fields are single points.
    pub fn through(&self, division: PupilDivision) -> Result<Vec<Arc<dyn LensImage + Send>>, PsfError> {
        let images = PartImage::all(self, division)?;
        Ok(images.into_iter().map(|image| Arc::new(image) as Arc<dyn LensImage + Send>).collect())
    }

    /// Returns the map from places of the film to the fields whose centroids land there, at least up to `extent_mm` from its middle where the lens is
    /// known so far.
    ///
    /// Of [`FieldSampling::Points`](crate::FieldSampling::Points) the map sees nothing.
    pub fn film_map(&self, dioptres: f64, wavelength_nm: f64, extent_mm: f64) -> FilmMap {
        match &self.form {
            Form::Rotational(bank) => self.radial_map(&bank.geometry(dioptres, wavelength_nm), dioptres, extent_mm),
            Form::General { bank, field_to_film: Some(inverse) } => {
                inverse.geometry(bank, dioptres, wavelength_nm).into()
            }
            Form::General { .. } => RadialMap::tabulate(extent_mm, |_| None, |_| 0.0).into(),
        }
    }

    fn radial_map(&self, geometry: &RadialGeometry, dioptres: f64, extent_mm: f64) -> FilmMap {
        let gain = |tan: f64| geometry.irradiance_per_radiance(tan);
        let extent_mm = extent_mm + self.decenter().length_mm();
        let map = RadialMap::tabulate(extent_mm, |r| geometry.field_tan(r), gain);
        map.about(self.decenter().axis_mm(), self.decenter().axis_tan(dioptres)).into()
    }
}

impl LensImage for LensImageModel {
    fn is_symmetric(&self) -> bool {
        self.form().is_ok() && self.decenter().is_none()
    }

    fn wavelengths_nm(&self) -> (f64, f64) {
        ends(&self.settings().wavelengths_nm)
    }

    fn dioptres(&self) -> (f64, f64) {
        ends(&self.settings().dioptres)
    }

    fn is_dark_beyond_extent(&self) -> bool {
        match &self.form {
            // Along a radius the fields that see no light, or scatter it, are left out; none holds more than the widest.
            Form::Rotational(bank) => {
                bank.is_dark_beyond()
                    || bank.n_fields() < bank.settings().fields.len()
                    || bank.last_field_tan() >= WIDEST_FIELD_TAN
                    || bank.is_scattered_beyond()
            }
            Form::General { bank, field_to_film } => {
                field_to_film.as_ref().is_some_and(|inverse| inverse.is_dark_beyond(bank, None))
            }
        }
    }

    fn is_dark_beyond_extent_on(&self, low_mm: DVec2, high_mm: DVec2) -> bool {
        match &self.form {
            Form::General { bank, field_to_film: Some(inverse) } => {
                inverse.is_dark_beyond(bank, Some((low_mm, high_mm)))
            }
            _ => self.is_dark_beyond_extent(),
        }
    }

    /// Of a lens with an axis, where middle rays land; of others, centroids ([`LensImageModel::film_map`]).
    fn film_map(&self, dioptres: f64, wavelength_nm: f64, extent_mm: f64) -> FilmMap {
        match &self.form {
            Form::Rotational(bank) => {
                self.radial_map(&bank.middle_geometry(dioptres, wavelength_nm), dioptres, extent_mm)
            }
            Form::General { .. } => self.film_map(dioptres, wavelength_nm, extent_mm),
        }
    }

    fn kernel(&self, query: PsfQuery) -> Kernel {
        match &self.form {
            Form::Rotational(bank) => bank.kernel_about_middle_ray(self.decenter().query(query)),
            Form::General { .. } => self.kernel(query),
        }
    }

    fn through_parts(&self, n_parts: usize) -> Result<Vec<Arc<dyn LensImage + Send>>, PsfError> {
        self.through(PupilDivision::new(n_parts))
    }

    fn blur_radius_mm(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> f64 {
        self.blur_radius_mm(field_tan, dioptres, wavelength_nm)
    }

    fn spread_mm(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> f64 {
        match &self.form {
            Form::Rotational(_) => self.blur_radius_mm(field_tan, dioptres, wavelength_nm).abs(),
            Form::General { bank, field_to_film } => {
                let nearest_lit = field_to_film.as_ref().map(|inverse| inverse.nearest_lit());
                bank.spread_mm(nearest_lit, field_tan, dioptres, wavelength_nm)
            }
        }
    }
}

fn ends(values: &[f64]) -> (f64, f64) {
    (values[0], values[values.len() - 1])
}
