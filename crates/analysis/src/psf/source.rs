//! What point-spread functions are drawn from: samples at the points themselves, or a bank over their range.

use dioptric_optics::Lens;
use dioptric_psf::{BankSettings, FieldBank, FieldBankSettings, Interpolation, Kernel, ModelUse, PsfBank, PsfQuery};
use ndarray::Array2;

use super::request::Item;
use crate::PsfRequest;
use dioptric_pipeline::{BankData, PipelineError};

/// Rings and azimuths of the rays through a pupil.
const RINGS: usize = 24;
const AZIMUTHS: usize = 96;

/// A bank for any lens.
pub(crate) enum PsfSource {
    /// Of a lens with an axis of symmetry: fields are turned.
    Turned(PsfBank),
    /// Of any other: a grid of fields.
    Plane(FieldBank),
}

impl PsfRequest {
    /// Returns a bank over the range of points where that was asked for, else one of the points.
    pub(crate) fn source(&self, lens: &Lens, items: &[Item], film_mm: f64) -> Result<PsfSource, PipelineError> {
        let Some(choice) = self.bank else { return self.exact_source(lens, items, film_mm) };
        if !lens.is_rotational() {
            let found = format!("a bank of {}", lens.name());
            return Err(self.wrong("bank", &found, "none: of a lens without an axis of symmetry each point is traced"));
        }
        let reference_wavelength_nm = self.reference(lens)?.wavelength_nm();
        let exact = self.turned_settings(items, film_mm, reference_wavelength_nm);
        let ends = |list: &[f64]| (list[0], list[list.len() - 1]);
        let (_, last_field_tan) = ends(&exact.field_tans);
        let (dioptres, wavelengths_nm) = (ends(&exact.dioptres), ends(&exact.wavelengths_nm));
        let standard = BankSettings::covering(film_mm, last_field_tan, dioptres, wavelengths_nm, exact.diffraction);
        let standard = BankSettings { reference_wavelength_nm, ..standard };
        Ok(PsfSource::Turned(choice.build(lens, standard, self.pixel_um)?))
    }

    /// Returns a bank with a sample at every point, so that nothing is interpolated.
    pub(crate) fn exact_source(&self, lens: &Lens, items: &[Item], film_mm: f64) -> Result<PsfSource, PipelineError> {
        let reference_wavelength_nm = self.reference(lens)?.wavelength_nm();
        if lens.is_rotational() {
            let settings = self.turned_settings(items, film_mm, reference_wavelength_nm);
            return Ok(PsfSource::Turned(PsfBank::build(lens, &settings)?));
        }
        let settings = FieldBankSettings {
            film_mm,
            reference_wavelength_nm,
            tans_x: sorted(items.iter().map(|item| item.field_tan().x)),
            tans_y: sorted(items.iter().map(|item| item.field_tan().y)),
            dioptres: sorted(items.iter().map(|item| item.dioptres)),
            wavelengths_nm: sorted(items.iter().map(|item| item.wavelength_nm)),
            n_rings: RINGS,
            n_azimuths: AZIMUTHS,
            diffraction: self.diffraction.into(),
        };
        Ok(PsfSource::Plane(FieldBank::build(lens, &settings)?))
    }

    fn turned_settings(&self, items: &[Item], film_mm: f64, reference_wavelength_nm: f64) -> BankSettings {
        BankSettings {
            film_mm,
            reference_wavelength_nm,
            field_tans: sorted(items.iter().map(|item| item.field_tan().length()).chain([0.0])),
            dioptres: sorted(items.iter().map(|item| item.dioptres)),
            wavelengths_nm: sorted(items.iter().map(|item| item.wavelength_nm)),
            n_rings: RINGS,
            n_azimuths: AZIMUTHS,
            diffraction: self.diffraction.into(),
            interpolation: Interpolation::Rays,
        }
    }
}

impl PsfSource {
    /// Returns the energy on a window about the centroid, and the model that drew it; `None` of a dark point.
    pub(crate) fn picture(&self, query: PsfQuery, size: usize) -> Option<(Array2<f64>, ModelUse)> {
        match self {
            Self::Turned(bank) => is_lit(bank, query).then(|| bank.picture(query, size)),
            Self::Plane(bank) => bank.picture(query, size),
        }
    }

    /// Returns the energy on a window that holds it, and the model that drew it; `None` of a dark point.
    pub(crate) fn kernel(&self, query: PsfQuery) -> Option<(Kernel, ModelUse)> {
        match self {
            Self::Turned(bank) => is_lit(bank, query).then(|| bank.kernel_and_model(query)),
            Self::Plane(bank) => bank.kernel_and_model(query),
        }
    }

    /// Returns how far from the centroid the farthest ray lands, mm; `None` of a dark point.
    pub(crate) fn reach_mm(&self, query: PsfQuery) -> Option<f64> {
        let PsfQuery { field_tan, dioptres, wavelength_nm, .. } = query;
        match self {
            Self::Turned(bank) => {
                is_lit(bank, query).then(|| bank.reach_mm(field_tan.length(), dioptres, wavelength_nm))
            }
            Self::Plane(bank) => bank.reach_mm(field_tan, dioptres, wavelength_nm),
        }
    }

    /// Returns how it was sampled, where its error was measured.
    pub(crate) fn data(&self) -> Option<BankData> {
        match self {
            Self::Turned(bank) => BankData::of(bank),
            Self::Plane(_) => None,
        }
    }
}

fn is_lit(bank: &PsfBank, query: PsfQuery) -> bool {
    query.field_tan.length() <= bank.last_field_tan()
}

fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    values
}
