//! What is measured of one point-spread function.

use std::{f64::consts::FRAC_PI_2, fmt::Write};

use dioptric_diffraction::{Covariance, TransferFunction, TransferMethod, TransferSpokes};
use dioptric_optics::glam::DVec2;
use dioptric_psf::Picture;
use serde::Serialize;

use super::spot::Moments;
use crate::field_angles::FieldAngles;

/// What is measured of one point-spread function.
///
/// Positions are in the picture frame: a point to the right of the axis has a positive x.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PsfRow {
    /// Field angle to the right, degrees.
    pub field_deg: f64,
    /// Field angle upwards, degrees.
    #[serde(skip_serializing_if = "is_zero")]
    pub field_y_deg: f64,
    /// Distance of the point before the first vertex, mm.
    pub distance_mm: f64,
    /// Distance of the film behind the last vertex, mm.
    #[serde(rename = "film_mm")]
    pub film_distance_mm: f64,
    /// What is at the film, in a few words.
    pub film: String,
    /// Wavelength, nm; of polychromatic light, the mean.
    pub wavelength_nm: f64,
    /// Whether this is the light of all wavelengths of the point together.
    #[serde(skip_serializing_if = "is_false")]
    pub is_polychromatic: bool,
    /// Where the middle of the picture lies, mm from the axis: at the centroid, but for own functions, which lie about their chief ray.
    #[serde(skip)]
    pub(crate) middle_mm: DVec2,
    /// Centroid, to the right, mm from the axis.
    pub centroid_x_mm: f64,
    /// Centroid, upwards, mm from the axis.
    pub centroid_y_mm: f64,
    /// Root-mean-square distance from the centroid, µm: of rays where there is no diffraction, else of the picture.
    pub rms_radius_um: f64,
    /// Standard deviation along x, µm.
    pub sigma_x_um: f64,
    /// Standard deviation along y, µm.
    pub sigma_y_um: f64,
    /// Mean of the product of the distances from the centroid along x and along y, µm²: what the two standard
    /// deviations do not say of an oblique picture.
    pub second_moment_xy_um2: f64,
    /// Full width at half maximum of the line spread along x, µm.
    pub lsf_fwhm_um: f64,
    /// The same along y.
    pub lsf_fwhm_y_um: f64,
    /// Radius about the centroid that holds half the energy, µm.
    pub ee50_radius_um: f64,
    /// Radius about the centroid that holds 80 % of the energy, µm.
    pub ee80_radius_um: f64,
    /// Half the side of the square about the centroid that holds half the energy, µm.
    pub es50_half_width_um: f64,
    /// Half the side of the square about the centroid that holds 80 % of the energy, µm.
    pub es80_half_width_um: f64,
    /// The light of the point that reaches the film over that of an axial point at the same distance and wavelength, or over that through
    /// the paraxial entrance pupil where the axis is dark: solid angles, or cross-sections of the beams of far points (paper mode: the
    /// share of the rays over the front rim's disc).
    pub energy: f64,
    /// The share of the point's light that lies on the picture: what the picture's metrics are of, but for the modulation, in which
    /// the rest counts as well.
    pub picture_share: f64,
    /// The share of the picture that is the diffraction integral; the rest is geometric rays or HURB. Not in the paper mode.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wave_fraction: Option<f64>,
    /// Why waves that were asked for were not summed, if so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fallback: Option<String>,
    /// The Strehl ratio: the highest point of the wave sum over that of the same light all in phase; where waves were asked for,
    /// also of a blur whose picture is of rays.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub strehl: Option<f64>,
    /// What is drawn of the transfer function, where waves were asked for.
    #[serde(skip)]
    pub(crate) curves: Option<WaveCurves>,
    /// What the line widths, the encircled energies and the modulations are of: `waves` and `rays and diffraction limit`, which know of
    /// no pixels and count all light, `coarser pixels` that hold all light of a blur larger than the picture (the modulations are the
    /// picture's), or the `picture` on its pixels.
    pub measured_on: &'static str,
    /// Modulation at the frequencies asked for, of all light of the point: what lies outside of the picture counts as if it fell off
    /// with the third power of the distance.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub mtf: Vec<MtfRow>,
}

/// The modulation at a spatial frequency, as ISO 9334 names it.
///
/// The meridional plane holds the axis and the point; of a point on the axis it is taken through x. Tangential is the
/// modulation of lines across that plane (a wave along the radius of the field), sagittal that of lines along it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MtfRow {
    /// Spatial frequency, cycles per mm.
    pub cycles_per_mm: f64,
    /// Of lines across the meridional plane.
    pub tangential: f64,
    /// Of lines along it.
    pub sagittal: f64,
    /// The same as tangential, by the name that it had before.
    pub radial: f64,
    /// The tangential and the sagittal modulation that the pupil would leave without aberrations: the diffraction limit, where waves
    /// were asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limit: Option<[f64; 2]>,
}

/// What is drawn of a point's transfer function: free of pixels and windows.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct WaveCurves {
    /// Frequencies, cycles per mm, with the tangential and the sagittal modulation and the limits of both.
    pub(crate) modulation: Vec<(f64, [f64; 2], [f64; 2])>,
    /// Radii, µm, and the share of all light within.
    pub(crate) encircled: Vec<(f64, f64)>,
    /// The transfer function itself, along the meridian and across it among others.
    pub(crate) spokes: TransferSpokes,
}

/// Places of a curve.
const CURVE_PLACES: usize = 160;

/// The share of the light on a picture from which on its widths are those of the point.
pub(crate) const WHOLE: f64 = 0.97;

/// Which point a row is of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PointName {
    pub(crate) field_deg: f64,
    pub(crate) field_y_deg: f64,
    pub(crate) distance_mm: f64,
    pub(crate) wavelength_nm: f64,
}

impl PsfRow {
    /// Measures a picture whose light lies at this place and has these second moments, µm².
    pub(crate) fn measure(name: PointName, place_mm: DVec2, second: Covariance, picture: &Picture) -> Self {
        let [encircled, ensquared] = [picture.encircled(), picture.ensquared()];
        let lit = |value: f64| if picture.energy().sum() > 0.0 { value } else { f64::NAN };
        let width_um = |direction: f64| lit(picture.line_spread(direction).full_width_at_half_maximum_um());
        let (sigma_x_um, sigma_y_um) = (second.xx.sqrt(), second.yy.sqrt());
        Self {
            field_deg: name.field_deg,
            field_y_deg: name.field_y_deg,
            distance_mm: name.distance_mm,
            film_distance_mm: f64::NAN,
            film: String::new(),
            wavelength_nm: name.wavelength_nm,
            is_polychromatic: false,
            middle_mm: place_mm,
            // Adding 0 takes the sign from a zero.
            centroid_x_mm: place_mm.x + 0.0,
            centroid_y_mm: place_mm.y + 0.0,
            rms_radius_um: sigma_x_um.hypot(sigma_y_um),
            sigma_x_um,
            sigma_y_um,
            second_moment_xy_um2: second.xy + 0.0,
            lsf_fwhm_um: width_um(0.0),
            lsf_fwhm_y_um: width_um(FRAC_PI_2),
            ee50_radius_um: lit(encircled.reach_um(0.5)),
            ee80_radius_um: lit(encircled.reach_um(0.8)),
            es50_half_width_um: lit(ensquared.reach_um(0.5)),
            es80_half_width_um: lit(ensquared.reach_um(0.8)),
            energy: 0.0,
            picture_share: 0.0,
            wave_fraction: None,
            fallback: None,
            strehl: None,
            curves: None,
            measured_on: "picture",
            mtf: Vec::new(),
        }
    }

    /// Returns the direction of the point's meridional plane, from +x.
    pub(crate) fn meridian_rad(&self) -> f64 {
        FieldAngles::of_deg([self.field_deg, self.field_y_deg]).meridian_rad()
    }

    /// Returns the row with the modulations at these frequencies, of a wave along a direction from +x.
    pub(crate) fn with_mtf(self, cycles_per_mm: &[f64], modulation: impl Fn(f64, f64) -> f64) -> Self {
        let meridian = self.meridian_rad();
        let row = |&cycles_per_mm: &f64| {
            let tangential = modulation(meridian, cycles_per_mm);
            let sagittal = modulation(meridian + FRAC_PI_2, cycles_per_mm);
            MtfRow { cycles_per_mm, tangential, sagittal, radial: tangential, limit: None }
        };
        Self { mtf: cycles_per_mm.iter().map(row).collect(), ..self }
    }

    /// Returns the row with the widths, radii and modulations of a transfer function and that of its diffraction limit in place of those of
    /// the picture: they know of no pixels, and count all light.
    pub(crate) fn with_transfer(self, transfer: &TransferFunction, limit: &TransferFunction) -> Self {
        let meridian = self.meridian_rad();
        let directions = [meridian, meridian + FRAC_PI_2];
        let both = |transfer: &TransferFunction, f: f64| directions.map(|direction| transfer.modulation(direction, f));
        let spokes = transfer.spokes(directions);
        let encircled = spokes.encircled();
        let radius_um = |share: f64| 1e3 * encircled.radius_mm(share);
        let mtf = self.mtf.iter().map(|row| {
            let [tangential, sagittal] = both(transfer, row.cycles_per_mm);
            let limit = Some(both(limit, row.cycles_per_mm));
            MtfRow { cycles_per_mm: row.cycles_per_mm, tangential, sagittal, radial: tangential, limit }
        });
        let place = |i: usize, last: f64| last * i as f64 / CURVE_PLACES as f64;
        let (cutoff_per_mm, reach_um) = (transfer.cutoff_per_mm(), 1.3 * radius_um(0.95));
        let reach_um = if reach_um.is_finite() { reach_um } else { 3.0 * radius_um(0.8) };
        let curves = WaveCurves {
            modulation: (0..=CURVE_PLACES)
                .map(|i| place(i, cutoff_per_mm))
                .map(|f| (f, both(transfer, f), both(limit, f)))
                .collect(),
            encircled: (0..=CURVE_PLACES)
                .map(|i| place(i, reach_um))
                .map(|radius_um| (radius_um, encircled.share(1e-3 * radius_um)))
                .collect(),
            spokes,
        };
        let row = Self { mtf: mtf.collect(), ..self }.with_spokes(&curves.spokes);
        Self { curves: Some(curves), ..row }
    }

    /// Returns the row with the widths and radii of light along spokes of its transfer function.
    pub(crate) fn with_spokes(self, spokes: &TransferSpokes) -> Self {
        let encircled = spokes.encircled();
        let [lsf_fwhm_um, lsf_fwhm_y_um] =
            spokes.line_spreads().map(|spread| 1e3 * spread.full_width_at_half_maximum_mm());
        Self {
            lsf_fwhm_um,
            lsf_fwhm_y_um,
            ee50_radius_um: 1e3 * encircled.radius_mm(0.5),
            ee80_radius_um: 1e3 * encircled.radius_mm(0.8),
            measured_on: match spokes.method() {
                TransferMethod::Waves => "waves",
                TransferMethod::Rays => "rays and diffraction limit",
            },
            ..self
        }
    }

    /// Returns the row with the widths and radii of a picture that holds all of the light, of coarser pixels.
    pub(crate) fn with_widths_of(self, whole: &Picture) -> Self {
        let [encircled, ensquared] = [whole.encircled(), whole.ensquared()];
        let width_um = |direction: f64| whole.line_spread(direction).full_width_at_half_maximum_um();
        Self {
            lsf_fwhm_um: width_um(0.0),
            lsf_fwhm_y_um: width_um(FRAC_PI_2),
            ee50_radius_um: encircled.reach_um(0.5),
            ee80_radius_um: encircled.reach_um(0.8),
            es50_half_width_um: ensquared.reach_um(0.5),
            es80_half_width_um: ensquared.reach_um(0.8),
            measured_on: "coarser pixels",
            ..self
        }
    }

    /// Whether none of the point's light reaches the film: all that is measured of it is then no number.
    pub fn is_dark(&self) -> bool {
        self.energy.is_nan() || self.energy <= 0.0
    }

    /// Whether so much of the light lies beside the picture that its metrics are not those of the point.
    pub fn is_cut(&self) -> bool {
        !self.is_dark() && self.picture_share < WHOLE && self.measured_on == "picture"
    }

    /// Whether any of the picture is the diffraction integral.
    pub fn is_of_waves(&self) -> bool {
        self.wave_fraction.is_some_and(|share| share > 0.0)
    }

    /// The centroid, mm.
    pub(crate) fn centroid_mm(&self) -> DVec2 {
        DVec2::new(self.centroid_x_mm, self.centroid_y_mm)
    }

    /// The second moments about the centroid, µm².
    pub(crate) fn second_moments_um2(&self) -> Covariance {
        Covariance { xx: self.sigma_x_um.powi(2), xy: self.second_moment_xy_um2, yy: self.sigma_y_um.powi(2) }
    }
}

/// Returns where the light of a spot lies, and its second moments in µm²; numbers that are none where it has no light.
pub(crate) fn place_and_size(moments: Option<Moments>) -> (DVec2, Covariance) {
    match moments {
        Some(Moments { centroid_mm, second_mm2: m }) => {
            (centroid_mm, Covariance { xx: 1e6 * m.xx, xy: 1e6 * m.xy, yy: 1e6 * m.yy })
        }
        None => (DVec2::NAN, Covariance { xx: f64::NAN, xy: f64::NAN, yy: f64::NAN }),
    }
}

/// Returns rows as a table with a line of names; modulations are named by their frequency.
pub fn psf_csv(rows: &[PsfRow]) -> String {
    let mut csv =
        "field_deg,field_y_deg,distance_mm,wavelength_nm,is_polychromatic,centroid_x_mm,centroid_y_mm,rms_radius_um,sigma_x_um,\
                   sigma_y_um,second_moment_xy_um2,lsf_fwhm_um,lsf_fwhm_y_um,ee50_radius_um,ee80_radius_um,\
                   es50_half_width_um,es80_half_width_um,energy,picture_share,wave_fraction,strehl"
            .to_owned();
    for mtf in rows.first().map_or(&[][..], |row| &row.mtf) {
        let f = mtf.cycles_per_mm;
        let _ = write!(csv, ",mtf_tangential_{f}_per_mm,mtf_sagittal_{f}_per_mm");
    }
    csv.push('\n');
    let or_empty = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
    for row in rows {
        let numbers = [
            row.centroid_x_mm,
            row.centroid_y_mm,
            row.rms_radius_um,
            row.sigma_x_um,
            row.sigma_y_um,
            row.second_moment_xy_um2,
            row.lsf_fwhm_um,
            row.lsf_fwhm_y_um,
            row.ee50_radius_um,
            row.ee80_radius_um,
            row.es50_half_width_um,
            row.es80_half_width_um,
            row.energy,
            row.picture_share,
        ];
        let PsfRow { field_deg, field_y_deg, distance_mm, wavelength_nm, is_polychromatic, .. } = row;
        let _ = write!(csv, "{field_deg},{field_y_deg},{distance_mm},{wavelength_nm},{is_polychromatic}");
        for value in numbers {
            let _ = write!(csv, ",{value}");
        }
        let _ = write!(csv, ",{},{}", or_empty(row.wave_fraction), or_empty(row.strehl));
        for mtf in &row.mtf {
            let _ = write!(csv, ",{},{}", mtf.tangential, mtf.sagittal);
        }
        csv.push('\n');
    }
    csv
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes references")]
fn is_false(value: &bool) -> bool {
    !value
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes references")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}
