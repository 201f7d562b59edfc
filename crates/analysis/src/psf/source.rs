//! What point-spread functions are drawn from: samples at the points themselves, or a bank over their range.

use dioptric_optics::Lens;
use dioptric_psf::{BankSettings, FieldSampling, Interpolation, LensImageModel};
use dioptric_spectrum::Cancel;

use super::request::Item;
use crate::PsfRequest;
use dioptric_pipeline::PipelineError;

/// Rings and azimuths of the rays through a pupil.
const RINGS: usize = 24;
const AZIMUTHS: usize = 96;

impl PsfRequest {
    /// Returns a bank over the range of points where that was asked for, else one of the points.
    pub(crate) fn source(
        &self,
        lens: &Lens,
        items: &[Item],
        film_distance_mm: f64,
    ) -> Result<LensImageModel, PipelineError> {
        let Some(choice) = self.bank else { return self.exact_source(lens, items, film_distance_mm) };
        if !lens.is_rotational() {
            let found = format!("a bank of {}", lens.name());
            return Err(self.wrong("bank", &found, "none: of a lens without an axis of symmetry each point is traced"));
        }
        let reference_wavelength_nm = self.reference(lens)?.wavelength_nm();
        let exact = self.exact_settings(radius_of(items), items, film_distance_mm, reference_wavelength_nm);
        let ends = |list: &[f64]| (list[0], list[list.len() - 1]);
        let (_, last_field_tan) = ends(exact.fields.axes().0);
        let (dioptres, wavelengths_nm) = (ends(&exact.dioptres), ends(&exact.wavelengths_nm));
        let standard =
            BankSettings::covering(film_distance_mm, last_field_tan, dioptres, wavelengths_nm, exact.diffraction);
        let standard = BankSettings { reference_wavelength_nm, ..standard };
        choice.build(lens, standard, self.pixel_um, &|_| {}, &Cancel::new())
    }

    /// Returns a bank with a sample at every point, so that nothing is interpolated.
    pub(crate) fn exact_source(
        &self,
        lens: &Lens,
        items: &[Item],
        film_distance_mm: f64,
    ) -> Result<LensImageModel, PipelineError> {
        let reference_wavelength_nm = self.reference(lens)?.wavelength_nm();
        let fields = match lens.is_rotational() {
            true => radius_of(items),
            false => FieldSampling::Points {
                tans_x: sorted(items.iter().map(|item| item.field_tan().x)),
                tans_y: sorted(items.iter().map(|item| item.field_tan().y)),
            },
        };
        Ok(LensImageModel::build(lens, &self.exact_settings(fields, items, film_distance_mm, reference_wavelength_nm))?)
    }

    fn exact_settings(
        &self,
        fields: FieldSampling,
        items: &[Item],
        film_distance_mm: f64,
        reference_wavelength_nm: f64,
    ) -> BankSettings {
        BankSettings {
            film_distance_mm,
            reference_wavelength_nm,
            fields,
            dioptres: sorted(items.iter().map(|item| item.dioptres)),
            wavelengths_nm: sorted(items.iter().map(|item| item.wavelength_nm)),
            n_rings: RINGS,
            n_azimuths: AZIMUTHS,
            diffraction: self.diffraction,
            interpolation: Interpolation::Rays,
        }
    }
}

/// Returns the fields of points, and 0, turned into one radius.
fn radius_of(items: &[Item]) -> FieldSampling {
    FieldSampling::Radial(sorted(items.iter().map(|item| item.field_tan().length()).chain([0.0])))
}

fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    values
}
