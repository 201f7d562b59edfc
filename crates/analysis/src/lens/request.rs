//! What to analyze a lens for.

use std::f64::consts::FRAC_PI_2;

use dioptric_optics::{
    MonoLens, ObjectPoint, PupilRegion,
    analysis::{PupilLight, PupilRule, STEEPEST_FIELD_DEG, WIDEST_FIELD_DEG, field_limit_along_deg},
    glam::DVec2,
};

use super::{film::AnalysisFilm, rows::FieldPlace};
use crate::field_angles::{FieldAngles, KNOWN_ANGLES};
use dioptric_pipeline::PipelineError;

/// The share of the axial illumination down to which fields are chosen where none are given.
const DIMMEST: f64 = 0.25;
/// How wide a spot may be, twice its root mean square, over the focal length, for fields to be chosen up to there.
const WIDEST_SPOT: f64 = 0.05;
/// Azimuths of the pupil of a field of which is asked whether it is lit.
const LIT_AZIMUTHS: usize = 24;

/// The points of the field that are looked at.
#[derive(Clone, Debug, PartialEq)]
pub enum AnalysisFields {
    /// 0, 0.5, 0.7 and 1 of the field above the axis at which the illumination falls to a quarter; of a lens that is not
    /// rotationally symmetric the axis, that field above it, that beside it, and 0.7 of both. Where the axis is dark, the first, the
    /// middle and the last lit field along y or x.
    ByLight,
    /// Angles at the entrance pupil in the x–z and the y–z plane, degrees; of a far object up to 120 along one of them.
    AnglesDeg(Vec<[f64; 2]>),
    /// Places of the object point along x and y, mm from the axis; the object must not be far away.
    HeightsMm(Vec<[f64; 2]>),
}

impl AnalysisFields {
    /// The number of points that are named.
    pub fn count(&self) -> usize {
        match self {
            Self::ByLight => 0,
            Self::AnglesDeg(points) | Self::HeightsMm(points) => points.len(),
        }
    }

    /// Returns angles above the axis, degrees.
    pub fn above_axis_deg(angles_deg: &[f64]) -> Self {
        Self::AnglesDeg(angles_deg.iter().map(|&angle_deg| [0.0, angle_deg]).collect())
    }
}

/// What to analyze a lens for.
#[derive(Clone, Debug, PartialEq)]
pub struct AnalysisRequest {
    /// The points of the field.
    pub fields: AnalysisFields,
    /// Wavelengths, nm.
    pub wavelengths_nm: Vec<f64>,
    /// How much each of them counts, in foci and modulations; empty where all count alike.
    pub wavelength_weights: Vec<f64>,
    /// How much each point of the field counts for the film of least spots; empty where all count alike.
    pub field_weights: Vec<f64>,
    /// Which of them is the reference, nm; `None` for that nearest to 550 nm.
    pub main_wavelength_nm: Option<f64>,
    /// Distance of the object before the first vertex, mm; infinity for a far one.
    pub distance_mm: f64,
    /// Where the film is.
    pub film: AnalysisFilm,
    /// Rings of rays in a spot diagram.
    pub n_rings: usize,
}

/// A point of the field: its name, and its angle from the axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Field {
    pub(super) place: FieldPlace,
    /// Of a far point up to that of [`WIDEST_FIELD_DEG`].
    pub(super) angle_rad: f64,
    /// The unit vector from the axis to the point; upwards on the axis.
    pub(super) direction: DVec2,
}

impl Field {
    fn of_angles(angles_deg: [f64; 2]) -> Self {
        let FieldAngles { angle_deg, direction } = FieldAngles::of_deg(angles_deg);
        let direction_xy = direction.to_array();
        let place =
            FieldPlace { field_deg: angle_deg, field_xy_deg: angles_deg, direction: direction_xy, object_mm: None };
        Self { place, angle_rad: angle_deg.to_radians(), direction }
    }

    /// Returns the field of this name.
    pub(super) fn of_place(place: &FieldPlace) -> Self {
        let direction = DVec2::from_array(place.direction);
        Self { place: *place, angle_rad: place.field_deg.to_radians(), direction }
    }

    /// Returns the field at this angle in a direction, a unit vector.
    fn along(direction: DVec2, field_deg: f64) -> Self {
        match (direction.x == 0.0, direction.y == 0.0) {
            (true, _) => Self::of_angles([0.0, direction.y * field_deg]),
            (_, true) => Self::of_angles([direction.x * field_deg, 0.0]),
            (false, false) => {
                let (sine, cosine) = field_deg.to_radians().sin_cos();
                let field_xy_deg = direction.to_array().map(|part| (sine * part).atan2(cosine).to_degrees());
                let place = FieldPlace { field_deg, field_xy_deg, direction: direction.to_array(), object_mm: None };
                Self { place, angle_rad: field_deg.to_radians(), direction }
            }
        }
    }

    /// Returns the field at a share of the angle from the axis.
    pub(super) fn at_share(&self, share: f64) -> Self {
        Self { direction: self.direction, ..Self::along(self.direction, share * self.place.field_deg) }
    }

    /// The tangent of the angle; `None` from 90° on.
    pub(super) fn tan(&self) -> Option<f64> {
        (self.angle_rad < FRAC_PI_2).then(|| self.angle_rad.tan())
    }

    /// Returns the point, `dioptres` = 1/Z away, as [`ObjectPoint::from_field`] has it.
    pub(super) fn point(&self, lens: &MonoLens, dioptres: f64) -> ObjectPoint {
        FieldAngles { angle_deg: self.place.field_deg, direction: self.direction }.point(lens, dioptres)
    }
}

impl AnalysisRequest {
    /// Checks what does not depend on the lens.
    pub(super) fn check(&self) -> Result<(), PipelineError> {
        let n_fields = match &self.fields {
            AnalysisFields::ByLight => 1,
            AnalysisFields::AnglesDeg(fields) => {
                let is_beyond = |field: &&[f64; 2]| !FieldAngles::are_known(**field, self.distance_mm);
                if let Some([x, y]) = fields.iter().find(is_beyond) {
                    let field = if x.abs() > y.abs() || x.is_nan() { x } else { y };
                    return Err(wrong("fields_deg", *field, KNOWN_ANGLES));
                }
                fields.len()
            }
            AnalysisFields::HeightsMm(fields) => {
                if let Some(field) = fields.iter().flatten().find(|field| !field.is_finite()) {
                    return Err(wrong("fields_mm", *field, "finite places of object points"));
                }
                if self.distance_mm.is_infinite() {
                    return Err(wrong("distance_mm", self.distance_mm, "a finite one for fields in mm"));
                }
                fields.len()
            }
        };
        if self.wavelengths_nm.is_empty() || n_fields == 0 {
            return Err(wrong("the number of fields or wavelengths", 0.0, "at least 1"));
        }
        if self.distance_mm.is_nan() || self.distance_mm <= 0.0 {
            return Err(wrong("distance_mm", self.distance_mm, "a number above 0, or inf"));
        }
        if !(1..=200).contains(&self.n_rings) {
            return Err(wrong("rings", self.n_rings as f64, "1 to 200"));
        }
        Ok(())
    }

    /// Returns the fields of a lens, of which none is steeper than rays are looked for, and what there is to say of them.
    pub(super) fn fields_of(&self, lens: &MonoLens, way_mm: f64) -> (Vec<Field>, Vec<String>) {
        // Far points are looked at by their angles, which end nowhere.
        let steepest_deg = if self.distance_mm.is_infinite() { WIDEST_FIELD_DEG } else { STEEPEST_FIELD_DEG };
        let mut notes = Vec::new();
        let fields: Vec<Field> = match &self.fields {
            AnalysisFields::ByLight => {
                let (fields, end) = by_light(lens, 1e3 / way_mm);
                if end == FieldEnd::BesideAxis {
                    notes.push(
                        "no light comes in along the axis: the fields are the first, the middle and the last that is lit beside it"
                            .to_owned(),
                    );
                }
                if end == FieldEnd::Blur {
                    notes.push(
                        "the fields end where light no longer comes together: beyond, spots are wider than a twentieth of the \
                         focal length"
                            .to_owned(),
                    );
                }
                if end == FieldEnd::Steepest {
                    notes.push(format!(
                        "the light has not fallen to a quarter at {steepest_deg}°, the steepest field that is \
                         looked at: the fields are shares of that"
                    ));
                }
                fields
            }
            AnalysisFields::AnglesDeg(angles_deg) => {
                angles_deg.iter().map(|&angles| Field::of_angles(angles)).collect()
            }
            AnalysisFields::HeightsMm(heights_mm) => {
                let of_height = |&height_mm: &[f64; 2]| {
                    let tan = DVec2::from_array(height_mm) / way_mm;
                    let upwards = DVec2::new(0.0, if tan.y < 0.0 { -1.0 } else { 1.0 });
                    let direction = if tan.x == 0.0 { upwards } else { tan.normalize() };
                    let field = Field::along(direction, tan.length().atan().to_degrees());
                    Field { place: FieldPlace { object_mm: Some(height_mm), ..field.place }, ..field }
                };
                heights_mm.iter().map(of_height).collect()
            }
        };
        let cut = |field: Field| match field.place.field_deg > steepest_deg {
            true => {
                notes.push(format!(
                    "the field of {} is cut to {steepest_deg}°, the steepest that is looked at",
                    field.place.label()
                ));
                Field::along(field.direction, steepest_deg)
            }
            false => field,
        };
        let fields = fields.into_iter().map(cut).collect();
        (fields, notes)
    }
}

/// What ends the fields that are chosen.
#[derive(Clone, Copy, PartialEq, Eq)]
enum FieldEnd {
    /// Light has fallen to a quarter.
    Light,
    /// Spots are no longer spots.
    Blur,
    /// No steeper field is looked at.
    Steepest,
    /// The axis is dark, and light comes in beside it.
    BesideAxis,
}

/// Whether any light of a field gets through.
fn is_lit(lens: &MonoLens, field: &Field, dioptres: f64) -> bool {
    lens.over_clear_pupil(&|part| {
        PupilRegion::find(part, &field.point(lens, dioptres), LIT_AZIMUTHS).map_or(0.0, |region| region.area_mm2())
    }) > 0.0
}

/// Returns the first, the middle and the last field, in whole degrees, that is lit without a gap from the first on, along the first of the
/// four directions of x and y that has one.
fn fields_beside_axis(lens: &MonoLens, dioptres: f64, steepest_deg: f64) -> Option<Vec<Field>> {
    [DVec2::Y, DVec2::NEG_Y, DVec2::X, DVec2::NEG_X].into_iter().find_map(|direction| {
        let is_lit = |deg: &u32| is_lit(lens, &Field::along(direction, f64::from(*deg)), dioptres);
        let all = 1..=steepest_deg as u32;
        let first = all.clone().find(is_lit)?;
        let last = (first..).take_while(|deg| all.contains(deg) && is_lit(deg)).last()?;
        let mut fields_deg = vec![f64::from(first), 0.5 * f64::from(first + last), f64::from(last)];
        fields_deg.dedup();
        Some(fields_deg.into_iter().map(|field_deg| Field::along(direction, field_deg)).collect())
    })
}

/// Returns fields up to where the light falls to a quarter or no longer comes together, and which of them ends the fields.
fn by_light(lens: &MonoLens, dioptres: f64) -> (Vec<Field>, FieldEnd) {
    let steepest_deg = if dioptres == 0.0 { WIDEST_FIELD_DEG } else { STEEPEST_FIELD_DEG };
    if !is_lit(lens, &Field::of_angles([0.0; 2]), dioptres)
        && let Some(fields) = fields_beside_axis(lens, dioptres, steepest_deg)
    {
        return (fields, FieldEnd::BesideAxis);
    }
    let limit_deg = |direction| {
        let by_light_deg = field_limit_along_deg(lens, DIMMEST, direction, dioptres).unwrap_or(0.0);
        let by_blur_deg = blur_limit_deg(lens, direction, dioptres, by_light_deg);
        let end = match by_blur_deg {
            Some(_) => FieldEnd::Blur,
            None if by_light_deg >= steepest_deg => FieldEnd::Steepest,
            None => FieldEnd::Light,
        };
        (by_blur_deg.unwrap_or(by_light_deg), end)
    };
    let (y_deg, end) = limit_deg(DVec2::Y);
    // A tenth of a degree is a round number; a field narrower than that has none.
    let round = |angle_deg: f64| match angle_deg >= 1.0 {
        true => (angle_deg * 10.0).floor() / 10.0,
        false => angle_deg,
    };
    if lens.is_rotational() {
        let fields = [0.0, 0.5, 0.7, 1.0].map(|share| Field::of_angles([0.0, round(share * y_deg)]));
        return (fields.to_vec(), end);
    }
    let (x_deg, end_x) = limit_deg(DVec2::X);
    let fields = [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.7, 0.7]];
    let fields = fields.map(|[x, y]| Field::of_angles([round(x * x_deg), round(y * y_deg)]));
    (fields.to_vec(), if end == FieldEnd::Light { end_x } else { end })
}

/// Returns the last whole degree, up to a field, at which spots on the paraxial film are no wider than a share of the focal
/// length; `None` if they are not at any, or on the axis already are.
fn blur_limit_deg(lens: &MonoLens, direction: DVec2, dioptres: f64, last_deg: f64) -> Option<f64> {
    let distance_mm = 1e3 / dioptres - lens.projection_center_z_mm();
    let film_mm = lens.film_distance_mm_for(if dioptres == 0.0 { f64::INFINITY } else { distance_mm }).ok()?;
    let widest_mm = WIDEST_SPOT * lens.first_order().efl_mm.abs();
    let is_spot = |field_deg: f64| {
        let point = Field::along(direction, field_deg).point(lens, dioptres);
        let light = PupilLight::to_film(lens, &point, film_mm, PupilRule::of_rings(3));
        light.is_some_and(|light| {
            let (_, [xx, yy, _]) = light.moments(lens, film_mm);
            2.0 * (xx + yy).sqrt() <= widest_mm
        })
    };
    let wide = (0..=last_deg as u32).map(f64::from).find(|&field_deg| !is_spot(field_deg))?;
    (wide > 0.0).then_some(wide - 1.0)
}

fn wrong(key: &'static str, found: f64, expected: &str) -> PipelineError {
    let (origin, expected) = ("the analysis".to_owned(), expected.to_owned());
    PipelineError::Value { origin, key, found: found.to_string(), expected }
}
