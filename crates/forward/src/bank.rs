//! The PSF bank as the lens of a forward rendering, and the sampling that a scene needs of it.

use dioptric_optics::{Lens, MonoLens, ObjectPoint, PupilBoundary, Rims, rays_towards};
use dioptric_psf::{BankSettings, Diffraction, PsfBank};
use dioptric_scene::Scene;
use dioptric_spectrum::WavelengthGrid;
use glam::DVec2;
use ndarray::Array2;

use crate::{Behind, Film, ForwardError, Kernels, RadialMap, Settings, Sink, Source, render};

impl Kernels for PsfBank {
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

    fn radial_map(&self, dioptres: f64, wavelength_nm: f64, reach_mm: f64) -> RadialMap {
        let geometry = self.geometry(dioptres, wavelength_nm);
        RadialMap::tabulate(reach_mm, |r| geometry.field_tan(r), |tan| geometry.irradiance_per_radiance(tan))
    }

    fn kernel(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64, pitch_um: f64) -> Array2<f32> {
        self.kernel(field_tan, dioptres, wavelength_nm, pitch_um).samples
    }

    fn blur_radius_mm(&self, field_tan: f64, dioptres: f64, wavelength_nm: f64) -> f64 {
        self.blur_radius_mm(field_tan, dioptres, wavelength_nm)
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
    bank: &PsfBank,
    film: &Film,
    settings: &Settings,
    progress: &(dyn Fn(f64) + Sync),
    sink: &mut Sink<'_>,
) -> Result<(), ForwardError> {
    let depth = scene.depth.as_ref().ok_or_else(|| ForwardError::MissingDepth { scene: scene.name.clone() })?;
    let view = scene.view.ok_or_else(|| ForwardError::MissingView { scene: scene.name.clone() })?;
    let behind = scene.hidden.as_ref().map(|hidden| Behind { radiance: &hidden.radiance, depth: &hidden.depth });
    let source = Source { radiance: &scene.radiance, depth, view, behind };
    render(&source, bank, film, settings, progress, sink)
}

/// What a bank must cover, and through which lens.
#[derive(Clone, Copy, Debug)]
pub struct Coverage<'a> {
    /// The lens, its stop set.
    pub lens: &'a Lens,
    /// The film.
    pub film: &'a Film,
    /// Distance of the film behind the last vertex, mm.
    pub film_mm: f64,
    /// Nearest and farthest depth of the scene, m; the farthest may be infinite.
    pub depth_range_m: (f64, f64),
    /// The bands.
    pub grid: &'a WavelengthGrid,
    /// How diffraction is taken into account.
    pub diffraction: Diffraction,
}

/// Returns the settings of a bank that serves a scene on a film: fields to beyond the film's corner, depths from end
/// to end in dioptres, wavelengths evenly in 1/λ².
///
/// # Errors
/// When the film has no area, or the lens has no index at a wavelength of the grid or is not rotationally symmetric.
pub fn bank_settings_for(coverage: &Coverage<'_>) -> Result<BankSettings, ForwardError> {
    coverage.film.check()?;
    coverage.lens.check_rotational("the forward path")?;
    let (near_m, far_m) = coverage.depth_range_m;
    if !(near_m > 0.0 && near_m <= far_m) {
        let (what, value) = ("the nearest depth", near_m);
        return Err(ForwardError::Setting { what, value, expected: "above 0 and no larger than the farthest, m" });
    }
    let dioptres = (1.0 / far_m, 1.0 / near_m);
    let wavelengths_nm = coverage.grid.range_nm();
    let BankSettings { reference_wavelength_nm, .. } =
        BankSettings::covering(coverage.film_mm, 0.0, dioptres, wavelengths_nm, coverage.diffraction);
    let reference = coverage.lens.at(reference_wavelength_nm)?;
    let mut last_field_tan = 0.0_f64;
    for wavelength_nm in [wavelengths_nm.0, wavelengths_nm.1] {
        let lens = coverage.lens.at(wavelength_nm)?;
        for dioptres in [dioptres.0, dioptres.1] {
            let aim = Aim { lens: &lens, reference: &reference, dioptres, film_mm: coverage.film_mm };
            // The border of the film is blurred by light from beyond it.
            let reach_mm = 1.02 * coverage.film.half_diagonal_mm() + aim.blur_radius_mm();
            last_field_tan = last_field_tan.max(aim.field_tan_at(reach_mm));
        }
    }
    Ok(BankSettings::covering(coverage.film_mm, last_field_tan, dioptres, wavelengths_nm, coverage.diffraction))
}

/// A lens looking at one depth.
struct Aim<'a> {
    lens: &'a MonoLens,
    reference: &'a MonoLens,
    dioptres: f64,
    film_mm: f64,
}

impl Aim<'_> {
    /// Returns how far off axis the middle of the light of a field lands, mm; `None` where no light gets through.
    fn image_radius_mm(&self, field_tan: f64) -> Option<f64> {
        let point = ObjectPoint::from_field(self.reference, DVec2::new(field_tan, 0.0), self.dioptres);
        let pupil = PupilBoundary::find(self.lens, &point, 16)?;
        let mut rays = rays_towards(&point, &[pupil.center_mm()], pupil.z_mm(), 0.0);
        self.lens.trace(&mut rays, Rims::Ignore);
        self.lens.to_film(&mut rays, self.film_mm);
        rays.fate[0].is_in_flight().then(|| rays.x_mm[0].abs())
    }

    /// Returns the radius of the blur on the axis, mm, from first-order optics.
    fn blur_radius_mm(&self) -> f64 {
        let from_vertex_mm = 1e3 / self.dioptres - self.lens.projection_center_z_mm();
        let Ok(image_mm) = self.lens.film_mm_for(from_vertex_mm) else { return 0.0 };
        let cone = 0.5 / (self.lens.image_index() * self.lens.working_f_number(from_vertex_mm));
        (cone * (self.film_mm - image_mm)).abs()
    }

    /// Returns the field that lands this far off axis, or the last that gets through.
    fn field_tan_at(&self, reach_mm: f64) -> f64 {
        let is_within = |tan: f64| self.image_radius_mm(tan).map(|radius_mm| radius_mm < reach_mm);
        let (mut low, mut high) = (0.0, 0.01);
        // Widen until the light lands beyond, or there is none; 60 is a field of 89°.
        while high < 60.0 && is_within(high) == Some(true) {
            (low, high) = (high, 1.3 * high);
        }
        for _ in 0..24 {
            let middle = 0.5 * (low + high);
            if is_within(middle) == Some(true) {
                low = middle;
            } else {
                high = middle;
            }
        }
        // Just beyond, so that the reach itself is covered — or, where light ends, seen to be dark.
        high * (1.0 + 1e-3)
    }
}
