//! An analysis of a lens as records.

use serde::Serialize;

use super::afocal::AfocalView;
use crate::PlaneData;
use dioptric_pipeline::number;

/// The real-ray analysis of a lens.
///
/// Fields are positive to the right and upwards as the photographer sees them. Heights and errors are in the picture frame,
/// in which the image of a point above the axis lies above the axis too. On a curved film they are along its x and y, seen
/// along the axis. What has no value (no light, no such ray) is
/// `null` in JSON.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LensAnalysis {
    /// The lens.
    pub lens: String,
    /// Distance of the object before the first vertex, mm; infinite, `null` in JSON, for a far one.
    pub distance_mm: f64,
    /// The wavelength of fields, pupils and scales, nm.
    pub reference_nm: f64,
    /// All wavelengths, nm.
    pub wavelengths_nm: Vec<f64>,
    /// How much each of them counts in foci and modulations; empty where all count alike.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub wavelength_weights: Vec<f64>,
    /// What there is to say of the request, a sentence each.
    pub notes: Vec<String>,
    /// How light that leaves in parallel is looked at: focal length, heights, spots and foci are then those of the lens with an ideal
    /// one behind it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub afocal: Option<AfocalView>,
    /// Index of the object space at the reference wavelength.
    pub object_index: f64,
    /// Index of the image space.
    pub image_index: f64,
    /// Numerical aperture at the object, index times sine, of real rays; none for a far object.
    pub object_na: Option<f64>,
    /// Numerical aperture at the image, of real rays.
    pub image_na: Option<f64>,
    /// Effective focal length at the reference wavelength, mm.
    pub efl_mm: f64,
    /// f-number for a far object.
    pub f_number: f64,
    /// The f-number of a lens without losses that has as much light; none where no light of the axis gets through.
    pub t_number: Option<f64>,
    /// f-number of the cone at the image of this object.
    pub working_f_number: f64,
    /// The first order of the x–z plane, where it is not that of the y–z plane, which the numbers above are of.
    pub x_plane: Option<PlaneData>,
    /// Where the film is, behind the last vertex, mm.
    #[serde(rename = "film_mm")]
    pub film_distance_mm: f64,
    /// What is there, in a few words: the image plane of the lens's file, a focus, or what was asked for.
    pub film: String,
    /// Radius of the film, mm, positive where its center lies behind; none for a flat one.
    pub film_radius_mm: Option<f64>,
    /// The field at which the illumination of a far object falls to half, degrees.
    pub half_illumination_deg: Option<f64>,
    /// Where the film would be best.
    pub focus: FocusData,
    /// Axial color.
    pub axial_color: Vec<AxialColorRow>,
    /// Spots, wavefronts and pupils: fields outermost, then wavelengths.
    pub spots: Vec<SpotRow>,
    /// Fans, in the same order.
    pub fans: Vec<FanRow>,
    /// What heights in step with the angle are multiplied by to be nearest to those of the lens, by least squares over the field.
    pub calibrated_scale: Option<f64>,
    /// What depends on the field alone, at the fields asked for.
    pub fields: Vec<FieldRow>,
    /// The same at equal steps from the axis to the largest of them.
    pub curves: Vec<FieldRow>,
    /// Chief rays of a grid of fields, rows from its lower left.
    pub grid: Vec<GridRow>,
    /// Path differences over the whole stop, in the order of the spots.
    pub opd_maps: Vec<OpdMap>,
}

/// A point of the field.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FieldPlace {
    /// Angle from the axis at the entrance pupil, degrees.
    pub field_deg: f64,
    /// Angles in the x–z and in the y–z plane, degrees.
    pub field_xy_deg: [f64; 2],
    /// The unit vector from the axis to the point, which the angles do not tell at 90°.
    #[serde(skip)]
    pub direction: [f64; 2],
    /// The object point, mm from the axis, where it was asked for so.
    pub object_mm: Option<[f64; 2]>,
}

impl FieldPlace {
    /// Returns the field in a few characters: `12.0°`, `5.0°/10.0°` along x and y, or `0.05 mm`.
    pub fn label(&self) -> String {
        match (self.object_mm, self.field_xy_deg) {
            (Some([0.0, y_mm]), _) => format!("{} mm", number(y_mm)),
            (Some([x_mm, y_mm]), _) => format!("{}/{} mm", number(x_mm), number(y_mm)),
            (None, [0.0, y_deg]) => degrees(y_deg),
            (None, [x_deg, y_deg]) => format!("{}/{}", degrees(x_deg), degrees(y_deg)),
        }
    }
}

/// Returns an angle as people write it: without a sign of nothing.
fn degrees(angle_deg: f64) -> String {
    format!("{:.1}°", (10.0 * angle_deg).round() / 10.0 + 0.0)
}

/// A chief ray of a grid of fields on the film, at the reference wavelength.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GridRow {
    /// Angles in the x–z and in the y–z plane, degrees.
    pub field_xy_deg: [f64; 2],
    /// Where it lands, mm.
    pub image_mm: Option<[f64; 2]>,
    /// Where it would land with the scale and shear of small fields, mm.
    pub straight_mm: [f64; 2],
}

/// Optical path differences of one point at one wavelength over the stop, against the sphere about the chief ray's image.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OpdMap {
    /// The point of the field.
    #[serde(flatten)]
    pub place: FieldPlace,
    /// Wavelength, nm.
    pub wavelength_nm: f64,
    /// Cells across the stop.
    pub n_across: usize,
    /// Waves in each cell, positive where the wavefront is ahead: rows from the bottom of the stop, each from its left (lens frame); none
    /// outside the pupil.
    pub waves: Vec<Option<f64>>,
}

/// Places of the film, behind the last vertex, mm, and how good they are.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FocusData {
    /// The paraxial image at the reference wavelength.
    pub paraxial_film_mm: Option<f64>,
    /// That in the x–z plane, for lenses without an axis of symmetry.
    pub paraxial_x_film_mm: Option<f64>,
    /// The smallest spot on the axis, all wavelengths together.
    pub axis_film_mm: Option<f64>,
    /// Its root-mean-square radius, µm.
    pub axis_rms_um: Option<f64>,
    /// The least mean square of the spots of all fields.
    pub fields_film_mm: Option<f64>,
    /// Their root mean square, µm.
    pub fields_rms_um: Option<f64>,
    /// The least wavefront aberration on the axis at the reference wavelength.
    pub wavefront_film_mm: Option<f64>,
    /// Its root mean square, waves.
    pub wavefront_rms_waves: Option<f64>,
}

/// Where a wavelength is in focus.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AxialColorRow {
    /// Wavelength, nm.
    pub wavelength_nm: f64,
    /// Its paraxial image less that of the reference wavelength, mm.
    pub paraxial_shift_mm: f64,
    /// The film of its smallest spot on the axis less that of the reference wavelength, mm.
    pub rms_shift_mm: Option<f64>,
}

/// The image of one point at one wavelength. Centroid, root mean squares and standard deviations are those of the light
/// that gets through, whose pupil is filled evenly as the point sees it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SpotRow {
    /// The point of the field.
    #[serde(flatten)]
    pub place: FieldPlace,
    /// Wavelength, nm.
    pub wavelength_nm: f64,
    /// Height of the centroid in the direction of the field, mm.
    pub height_mm: Option<f64>,
    /// The centroid, mm.
    pub image_mm: Option<[f64; 2]>,
    /// Root-mean-square radius about the centroid, µm.
    pub rms_um: Option<f64>,
    /// Root-mean-square radius about the chief ray, µm.
    pub rms_about_chief_um: Option<f64>,
    /// Distance of the farthest ray from the chief ray, µm.
    pub radius_um: Option<f64>,
    /// Root mean square along x, µm: across a field above the axis.
    pub sigma_x_um: Option<f64>,
    /// Root mean square along y, µm.
    pub sigma_y_um: Option<f64>,
    /// The share of the rays through the stop that rims let pass, whatever light they lose at surfaces and in glass.
    pub ray_share: f64,
    /// The wavefront, about the film point for which it is best.
    pub wavefront: Option<WavefrontRow>,
    /// The true pupil.
    pub pupil: Option<PupilRow>,
    /// The rays' film points, µm from the chief ray of the reference wavelength.
    #[serde(skip)]
    pub points_um: Vec<(f64, f64)>,
}

/// The wavefront of a point over its true pupil.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WavefrontRow {
    /// Root mean square, waves.
    pub rms_waves: f64,
    /// Largest less least, waves.
    pub peak_to_valley_waves: f64,
    /// Strehl's ratio: the highest point of the point spread function over that of the same light all in phase; none of a blur that
    /// needs more nodes than a wave sum has.
    pub strehl: Option<f64>,
    /// Why there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_strehl: Option<String>,
    /// What Maréchal's formula makes of the root mean square, exp(−(2πσ)²): within a hundredth down to ratios of 0.8.
    pub strehl_of_rms: f64,
    /// Zernike coefficients over the unit disc of the stop, in Noll's order from piston, waves rms: `OpticStudio`'s standard ones.
    pub zernike_waves: Vec<f64>,
    /// Coefficients of the 37 polynomials of the Fringe set, waves at the edge of that disc.
    pub fringe_waves: Vec<f64>,
}

/// The edge of the true, vignetted pupil of a point in the plane of the paraxial entrance pupil.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PupilRow {
    /// z of that plane from the first vertex, mm.
    pub z_mm: f64,
    /// The center that radii count from, mm from the axis (lens frame).
    pub center_mm: [f64; 2],
    /// Largest radius at equal steps of azimuth from +x towards +y, mm.
    pub rho_max_mm: Vec<f64>,
    /// Area, mm².
    pub area_mm2: f64,
}

/// Aberrations along two lines across the stop.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FanRow {
    /// The point of the field.
    #[serde(flatten)]
    pub place: FieldPlace,
    /// Wavelength, nm.
    pub wavelength_nm: f64,
    /// Places along the lines, in units of the stop's radius.
    pub places: Vec<f64>,
    /// Transverse aberration along y of rays along y, µm from the chief ray of the same wavelength.
    pub tangential_um: Vec<Option<f64>>,
    /// Transverse aberration along x of rays along x, µm.
    pub sagittal_um: Vec<Option<f64>>,
    /// Optical path difference of rays along y, waves; positive where the wavefront is ahead of the
    /// sphere about the chief ray's image, the sign of `OpticStudio`, CODE V and the third-order sums.
    pub tangential_waves: Vec<Option<f64>>,
    /// Optical path difference of rays along x, waves.
    pub sagittal_waves: Vec<Option<f64>>,
}

/// What depends on the field alone.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FieldRow {
    /// The point of the field.
    #[serde(flatten)]
    pub place: FieldPlace,
    /// Height of the chief ray at the reference wavelength in the direction of the field, mm.
    pub height_mm: Option<f64>,
    /// Where it lands, mm.
    pub image_mm: Option<[f64; 2]>,
    /// Distortion against a height in step with the angle's tangent, percent.
    pub distortion_tangent_percent: Option<f64>,
    /// Distortion against a height in step with the angle, percent.
    pub distortion_angle_percent: Option<f64>,
    /// The same with the scale for which it is least over the field ([`LensAnalysis::calibrated_scale`]), percent.
    pub distortion_calibrated_percent: Option<f64>,
    /// The focus of close rays in the plane of the field, mm along the axis behind the film where the chief ray meets it.
    pub tangential_focus_mm: Option<f64>,
    /// The focus of close rays beside it, mm behind the film.
    pub sagittal_focus_mm: Option<f64>,
    /// The focus of close rays beside the chief ray along x, mm behind the film; for lenses without an axis of symmetry.
    pub x_focus_mm: Option<f64>,
    /// The same along y.
    pub y_focus_mm: Option<f64>,
    /// Illumination over that on the axis, by the solid angles of the cones that light the image: that of a sharp image. Where
    /// aberrations reach over places that are lit differently, the film's differs.
    pub relative_illumination: Option<f64>,
    /// Chief-ray height at each wavelength less that at the reference, µm.
    pub lateral_color_um: Vec<Option<f64>>,
}
