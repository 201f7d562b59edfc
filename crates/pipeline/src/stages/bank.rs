//! The point-spread functions of a camera: of a lens with an axis of symmetry, or of any other.

use dioptric_forward::{Coverage, Film, Kernels, bank_settings_for, field_bank_settings_for};
use dioptric_optics::glam::DVec2;
use dioptric_psf::{FieldBank, ImagingBank, Kernel, MeasuredError, PsfBank, PsfQuery};

use crate::{BankChoice, PipelineError};

/// The point-spread functions that a scene and a film need, through any lens.
///
/// Fields are tangents at the entrance pupil, places mm from the axis, both in the picture frame: x right, y up.
#[derive(Clone, Debug)]
pub enum CameraBank {
    /// Of a lens with an axis of symmetry, over field angle.
    Turned(Box<PsfBank>),
    /// Of any other lens, over fields across and up.
    Plane {
        /// The ray maps and the way back from the film.
        bank: Box<ImagingBank>,
        /// The error of what lies between the samples.
        error: MeasuredError,
    },
}

impl CameraBank {
    /// Traces what a scene and a film need.
    pub fn build(choice: BankChoice, coverage: &Coverage<'_>) -> Result<Self, PipelineError> {
        let pitch_um = coverage.film.pitch_um;
        if coverage.lens.is_rotational() {
            let bank = choice.build(coverage.lens, bank_settings_for(coverage)?, pitch_um)?;
            return Ok(Self::Turned(Box::new(bank)));
        }
        let places = choice.places_of_plane(coverage.lens, pitch_um)?;
        let bank = FieldBank::build(coverage.lens, &field_bank_settings_for(coverage)?)?;
        let error = bank.measured_error(&places)?;
        Ok(Self::Plane { bank: Box::new(ImagingBank::new(bank)?), error })
    }

    /// What the forward path asks.
    pub fn kernels(&self) -> &dyn Kernels {
        match self {
            Self::Turned(bank) => bank.as_ref(),
            Self::Plane { bank, .. } => bank.as_ref(),
        }
    }

    /// Returns the point-spread function of a point about its centroid.
    pub fn kernel(&self, query: PsfQuery) -> Kernel {
        match self {
            Self::Turned(bank) => bank.kernel_and_model(query).0,
            Self::Plane { bank, .. } => bank.kernel(query),
        }
    }

    /// Returns where the centroid of a point lands, mm.
    pub fn centroid_mm(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> DVec2 {
        match self {
            Self::Turned(bank) => {
                let way = field_tan.try_normalize().unwrap_or(DVec2::X);
                way * bank.geometry(dioptres, wavelength_nm).image_radius_mm(field_tan.length())
            }
            Self::Plane { bank, .. } => bank.centroid_mm(field_tan, dioptres, wavelength_nm),
        }
    }

    /// Returns irradiance on the film over radiance of a locally uniform scene, sr.
    pub fn irradiance_per_radiance(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> f64 {
        match self {
            Self::Turned(bank) => bank.geometry(dioptres, wavelength_nm).irradiance_per_radiance(field_tan.length()),
            Self::Plane { bank, .. } => bank.irradiance_per_radiance(field_tan, dioptres, wavelength_nm),
        }
    }

    /// Returns the field that the film's corner sees: to the right of a lens with an axis of symmetry, of any other that of
    /// the corner at the top right.
    pub fn corner_tan(&self, film: &Film, dioptres: f64, wavelength_nm: f64) -> DVec2 {
        match self {
            Self::Turned(bank) => {
                let geometry = bank.geometry(dioptres, wavelength_nm);
                DVec2::X * geometry.field_tan(film.half_diagonal_mm()).unwrap_or(bank.last_field_tan())
            }
            Self::Plane { bank, .. } => {
                let half_mm = 0.5e-3 * film.pitch_um * DVec2::new(film.columns as f64, film.rows as f64);
                bank.geometry(dioptres, wavelength_nm).nearest_field_tan(half_mm)
            }
        }
    }

    /// The error of what lies between the samples.
    pub fn error(&self) -> Option<MeasuredError> {
        match self {
            Self::Turned(bank) => bank.error(),
            Self::Plane { error, .. } => Some(*error),
        }
    }
}
