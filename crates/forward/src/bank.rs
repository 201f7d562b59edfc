//! PSF banks as the lens of a forward rendering.

use dioptric_psf::{ImagingBank, PsfBank, PsfQuery};
use dioptric_scene::Scene;
use glam::DVec2;
use ndarray::Array2;

use crate::{Film, FilmMap, ForwardError, Kernels, RadialMap, Settings, Sink, Source, render};

impl Kernels for PsfBank {
    fn is_symmetric(&self) -> bool {
        true
    }

    fn wavelengths_nm(&self) -> (f64, f64) {
        ends(&self.settings().wavelengths_nm)
    }

    fn dioptres(&self) -> (f64, f64) {
        ends(&self.settings().dioptres)
    }

    fn is_dark_beyond_reach(&self) -> bool {
        // A bank leaves out the fields that see no light.
        self.last_field_tan() < ends(&self.settings().field_tans).1
    }

    fn film_map(&self, dioptres: f64, wavelength_nm: f64, reach_mm: f64) -> FilmMap {
        let geometry = self.geometry(dioptres, wavelength_nm);
        RadialMap::tabulate(reach_mm, |r| geometry.field_tan(r), |tan| geometry.irradiance_per_radiance(tan)).into()
    }

    fn kernel(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64, pitch_um: f64) -> Array2<f32> {
        self.kernel(field_tan, dioptres, wavelength_nm, pitch_um).samples
    }

    fn blur_radius_mm(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> f64 {
        self.blur_radius_mm(field_tan.length(), dioptres, wavelength_nm)
    }
}

impl Kernels for ImagingBank {
    fn is_symmetric(&self) -> bool {
        false
    }

    fn wavelengths_nm(&self) -> (f64, f64) {
        ends(&self.bank().settings().wavelengths_nm)
    }

    fn dioptres(&self) -> (f64, f64) {
        ends(&self.bank().settings().dioptres)
    }

    fn is_dark_beyond_reach(&self) -> bool {
        self.is_dark_at_rim()
    }

    fn film_map(&self, dioptres: f64, wavelength_nm: f64, _reach_mm: f64) -> FilmMap {
        self.geometry(dioptres, wavelength_nm).into()
    }

    fn kernel(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64, pitch_um: f64) -> Array2<f32> {
        self.kernel(PsfQuery { field_tan, dioptres, wavelength_nm, pitch_um }).samples
    }

    fn blur_radius_mm(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> f64 {
        self.blur_radius_mm(field_tan, dioptres, wavelength_nm)
    }

    fn spread_mm(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> f64 {
        self.spread_mm(field_tan, dioptres, wavelength_nm)
    }
}

fn ends(values: &[f64]) -> (f64, f64) {
    (values[0], values[values.len() - 1])
}

/// Images a scene with depth through a lens: hands the irradiance on the film, W m⁻² nm⁻¹, to `sink` band by band.
///
/// `progress` is told the part that is done, from 0 to 1. The result does not depend on the number of threads.
///
/// # Errors
/// When the scene has no depth or no view, when the bank does not cover its wavelengths or depths or the corner of
/// the film, or when a band cannot be handed on.
pub fn irradiance(
    scene: &Scene,
    bank: &dyn Kernels,
    film: &Film,
    settings: &Settings,
    progress: &(dyn Fn(f64) + Sync),
    sink: &mut Sink<'_>,
) -> Result<(), ForwardError> {
    render(&Source::of_scene(scene)?, bank, film, settings, progress, sink)
}
