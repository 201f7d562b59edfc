//! Point spread functions drawn from a bank, by the model that suits each.

use dioptric_diffraction::{CircularStop, DiffractionError, WaveQuality, WaveWindow, WindowCenter, wave_psf};
use dioptric_optics::ObjectPoint;
use glam::DVec2;
use ndarray::Array2;
use serde::Serialize;

use crate::{
    Diffraction, Interpolation, Kernel,
    hurb_splatter::StopHurb,
    ray_map::RayMap,
    render::{self, Layout},
    rotational::RotationalBank,
};

/// The largest range of phases, radians, at which a kernel is wave optics alone; at twice that there is none.
const ALL_WAVE: f64 = 200.0;

/// A point at one wavelength, on pixels of a pitch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PsfQuery {
    /// Tangents of the field angles, in the picture frame.
    pub field_tan: DVec2,
    /// Depth, dioptres.
    pub dioptres: f64,
    /// Wavelength, nm.
    pub wavelength_nm: f64,
    /// Side of a pixel, µm.
    pub pitch_um: f64,
}

/// Which model a point spread function was drawn with.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ModelUse {
    /// The share that is the diffraction integral; the rest is geometric rays or HURB, as the bank's setting says.
    pub wave_fraction: f64,
    /// Why waves that were wanted were not summed, if so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fallback: Option<String>,
}

impl PsfQuery {
    /// Returns the query of a point in this field, at this depth and wavelength, on pixels of this side.
    pub fn new(field_tan: DVec2, dioptres: f64, wavelength_nm: f64, pitch_um: f64) -> Self {
        Self { field_tan, dioptres, wavelength_nm, pitch_um }
    }
}

impl RotationalBank {
    /// Returns the energy on each pixel of a window of `size` × `size` about the centroid, in the picture frame, and
    /// the model that drew it.
    pub(crate) fn picture(&self, query: PsfQuery, size: usize) -> (Array2<f64>, ModelUse) {
        let Drawn { energies, model, .. } = self.draw(query, Some(size));
        (energies, model)
    }

    /// Returns the point spread function of a point about its centroid and the model that drew it. Fields outside the bank
    /// are moved to its ends.
    pub(crate) fn kernel_and_model(&self, query: PsfQuery) -> (Kernel, ModelUse) {
        self.draw(query, None).into_kernel(query.pitch_um)
    }

    fn draw(&self, query: PsfQuery, side: Option<usize>) -> Drawn {
        match self.settings().interpolation {
            Interpolation::Rays => self.draw_rays(query, side),
            Interpolation::Images => self.blend(query, side),
        }
    }

    /// Draws interpolated rays or waves.
    pub(crate) fn draw_rays(&self, query: PsfQuery, side: Option<usize>) -> Drawn {
        let record = self.record(query.field_tan.length(), query.dioptres, query.wavelength_nm);
        let layout = self.layout(&record, query, side);
        composed(layout, self.settings().diffraction, |side| self.wave_energies(query, side, DVec2::ZERO))
    }

    /// Returns the point spread function of a point about its middle ray. Fields outside the bank are moved to its ends.
    pub(crate) fn kernel_about_middle_ray(&self, query: PsfQuery) -> Kernel {
        let field_tan = query.field_tan.length();
        let outwards_mm = self.middle_rays(query.dioptres, query.wavelength_nm).outwards_mm(field_tan);
        if outwards_mm == 0.0 {
            return self.kernel_and_model(query).0;
        }
        let per_mm = DVec2::new(1e3, -1e3) / query.pitch_um;
        let middle_ray_px = query.field_tan / field_tan * outwards_mm * per_mm;
        // The pixels are those about the middle ray; the window is about the one in which the centroid lies, where it is smallest.
        let middle_px = (-middle_ray_px).round();
        let about_px = middle_ray_px + middle_px;
        let record = self.record(field_tan, query.dioptres, query.wavelength_nm);
        let layout = self.layout(&record, query, None).about(about_px);
        let diffraction = self.settings().diffraction;
        let drawn = composed(layout, diffraction, |side| self.wave_energies(query, side, about_px / per_mm));
        let (kernel, _) = drawn.into_kernel(query.pitch_um);
        Kernel { middle_px: middle_px.as_ivec2(), centroid_px: -about_px, ..kernel }
    }

    /// Returns how much of a kernel is wave optics.
    pub(crate) fn wave_fraction(&self, query: PsfQuery) -> f64 {
        let record = self.record(query.field_tan.length(), query.dioptres, query.wavelength_nm);
        wave_fraction_of(&self.layout(&record, query, None), self.settings().diffraction)
    }

    pub(crate) fn layout<'a>(&self, record: &'a RayMap, query: PsfQuery, side: Option<usize>) -> Layout<'a> {
        let turn = query.field_tan.try_normalize().unwrap_or(DVec2::X);
        let bending = self.settings().diffraction.hurb().map(|model| {
            let index = self.stop_index(query.wavelength_nm);
            StopHurb {
                model,
                edge: CircularStop::new(self.reference().stop_semi_aperture_mm(), query.wavelength_nm, index),
            }
        });
        Layout::new(record, turn, bending, query.pitch_um).with_side(side)
    }

    /// Returns the wave-optical energies about a place beside the centroid, mm, picture frame.
    fn wave_energies(&self, query: PsfQuery, side: usize, about_mm: DVec2) -> Result<Array2<f64>, DiffractionError> {
        let PsfQuery { field_tan, dioptres, pitch_um, .. } = query;
        let wavelength_nm = self.within_colors(query.wavelength_nm);
        // The picture is the film turned by 180°.
        let window = WaveWindow { pitch_um, rows: side, columns: side, center: WindowCenter::FromCentroid(-about_mm) };
        if let Some(map) = self.wave_map(field_tan.length(), dioptres, wavelength_nm) {
            let turn = field_tan.try_normalize().unwrap_or(DVec2::X);
            return Ok(map.psf(wavelength_nm, turn, &window)?.samples);
        }
        let lens = self.lens().at(wavelength_nm)?;
        let (least, most) = self.dioptre_range();
        let field_tan = field_tan.clamp_length_max(self.last_field_tan());
        let point = ObjectPoint::from_field(self.reference(), field_tan, dioptres.clamp(least, most));
        Ok(wave_psf(&lens, &point, self.settings().film_distance_mm, &window, WaveQuality::default())?.samples)
    }
}

/// What was drawn of a point.
pub(crate) struct Drawn {
    /// The share of its energy on each pixel.
    pub(crate) energies: Array2<f64>,
    /// λN, pixels; 0 without diffraction.
    pub(crate) lambda_n_px: f64,
    pub(crate) model: ModelUse,
}

impl Drawn {
    pub(crate) fn into_kernel(self, pitch_um: f64) -> (Kernel, ModelUse) {
        (render::kernel(&self.energies, self.lambda_n_px, pitch_um), self.model)
    }
}

/// Draws a layout, with waves of a window of a given side in so far as the setting and its blur want them.
pub(crate) fn composed(
    layout: Layout<'_>,
    diffraction: Diffraction,
    waves: impl FnOnce(usize) -> Result<Array2<f64>, DiffractionError>,
) -> Drawn {
    let (share, lambda_n_px) = (wave_fraction_of(&layout, diffraction), layout.lambda_n_px());
    let none = ModelUse { wave_fraction: 0.0, fallback: None };
    if share == 0.0 {
        return Drawn { energies: layout.draw(), lambda_n_px, model: none };
    }
    let (energies, model) = match waves(layout.side()) {
        Ok(waves) if share == 1.0 => (waves, ModelUse { wave_fraction: 1.0, ..none }),
        Ok(waves) => (waves * share + layout.draw() * (1.0 - share), ModelUse { wave_fraction: share, ..none }),
        Err(error) => (layout.draw(), ModelUse { fallback: Some(error.to_string()), ..none }),
    };
    Drawn { energies, lambda_n_px, model }
}

/// Returns how much of a layout is wave optics: 1 up to a range of phases of 200, falling with its logarithm to 0 at 400.
pub(crate) fn wave_fraction_of(layout: &Layout<'_>, diffraction: Diffraction) -> f64 {
    match diffraction {
        Diffraction::Wave => (2.0 - (layout.bandwidth() / ALL_WAVE).log2()).clamp(1.0, 2.0) - 1.0,
        _ => 0.0,
    }
}
