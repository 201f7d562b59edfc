//! Our own lens file: RON, with every number named and its unit in the name.

mod configuration_row;

use ron::extensions::Extensions;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

use crate::{
    Aperture, Coating, CoordinateBreak, DiffractiveSurface, Glass, ImageSurface, Interface, Iris, Lens, OpticsError,
    Shape, Surface,
};

use self::configuration_row::ConfigurationRow;
use super::{
    configuration::MOST_CONFIGURATIONS,
    lens_file::{Field, LensFile},
    number::reciprocal,
    text_error::TextError,
};

/// A lens as it stands in a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Prescription {
    pub(super) name: String,
    pub(super) source: String,
    /// Left out for air.
    #[serde(default, skip_serializing_if = "is_air")]
    pub(super) object_medium: Glass,
    pub(super) surfaces: Vec<Row>,
    /// Tilts and decenters.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) moves: Vec<CoordinateBreak>,
    /// Openings and obscurations beside the round rims.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) apertures: Vec<Aperture>,
    /// Blades that close the stop.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) iris: Option<Iris>,
    /// Half the diameter that blades close the stop to; left out where it is fully open.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) closed_to_mm: Option<f64>,
    /// Gratings and diffractive surfaces.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) diffractive: Vec<DiffractiveSurface>,
    /// Left out for a flat film.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) image_radius_mm: Option<f64>,
    #[serde(default, skip_serializing_if = "is_zero")]
    pub(super) image_conic: f64,
    /// How the lens is meant to be used, as far as that is known: the place of the film behind the last vertex, that of the
    /// object before the first (left out for a far one), wavelengths and the main one of them, and the points of the field.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) film_distance_mm: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) object_distance_mm: Option<f64>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) wavelengths_nm: Vec<f64>,
    /// One each of the wavelengths; left out where they count alike.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) wavelength_weights: Vec<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) reference_wavelength_nm: Option<f64>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) fields: Vec<Field>,
    /// One each of the fields; left out where they count alike.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) field_weights: Vec<f64>,
    /// What there is to say beside the source, a line each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) comments: Vec<String>,
    /// What differs in each of several configurations, the positions of a zoom lens, from what stands above.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) configurations: Vec<ConfigurationRow>,
    /// Which of them is in use, counted from 1.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub(super) configuration: usize,
}

/// A surface as it stands in a file, with what follows it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Row {
    /// What it is called, if anything.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub(super) comment: String,
    /// Left out for a plane.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) radius_mm: Option<f64>,
    #[serde(default, skip_serializing_if = "is_sphere")]
    pub(super) shape: Shape,
    #[serde(default, skip_serializing_if = "is_false")]
    pub(super) stop: bool,
    #[serde(default, skip_serializing_if = "is_false")]
    pub(super) mirror: bool,
    pub(super) semi_aperture_mm: f64,
    /// Left out for the usual one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) coating: Option<Coating>,
    /// Left out for air. Behind a mirror it is that before it.
    #[serde(default, skip_serializing_if = "is_air")]
    pub(super) medium: Glass,
    pub(super) thickness_mm: f64,
}

fn one() -> usize {
    1
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_one(number: &usize) -> bool {
    *number == 1
}

fn is_sphere(shape: &Shape) -> bool {
    *shape == Shape::Sphere
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_zero(number: &f64) -> bool {
    *number == 0.0
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_false(flag: &bool) -> bool {
    !flag
}

fn is_air(glass: &Glass) -> bool {
    *glass == Glass::Air
}

/// Reads a lens from the text of our own file.
pub(crate) fn lens_from_ron(text: &str) -> Result<Lens, TextError> {
    file_from_ron(text).map(|file| file.lens)
}

/// Reads a lens and its use from the text of our own file.
pub(super) fn file_from_ron(text: &str) -> Result<LensFile, TextError> {
    let prescription: Prescription = dioptric_files::ron::from_text(text).map_err(|error| TextError {
        line: Some(error.line),
        reason: format!("column {}: {}", error.column, error.reason),
    })?;
    file_of_all(prescription)
}

/// Returns the lens of a prescription and its use, with all its configurations.
fn file_of_all(prescription: Prescription) -> Result<LensFile, TextError> {
    if prescription.configurations.is_empty() {
        if prescription.configuration != 1 {
            let error = OpticsError::Configuration { number: prescription.configuration, n_configurations: 1 };
            return Err(error.into());
        }
        return file_of(prescription);
    }
    if prescription.configurations.len() > MOST_CONFIGURATIONS {
        let found = prescription.configurations.len();
        let reason = format!("{found} configurations, expected at most {MOST_CONFIGURATIONS}");
        return Err(TextError { line: None, reason });
    }
    let state = |(i, row): (usize, &ConfigurationRow)| {
        let file = row.clone().of(&prescription).and_then(file_of);
        let of_state =
            |error: TextError| TextError { reason: format!("configuration {}: {}", i + 1, error.reason), ..error };
        Ok((row.name.clone(), file.map_err(of_state)?))
    };
    let files = prescription.configurations.iter().enumerate().map(state).collect::<Result<_, TextError>>()?;
    LensFile::of_configurations(files, prescription.configuration)
}

/// Returns the lens of a prescription and its use, whatever its configurations.
fn file_of(prescription: Prescription) -> Result<LensFile, TextError> {
    let stops: Vec<usize> = (0..prescription.surfaces.len()).filter(|&i| prescription.surfaces[i].stop).collect();
    let &[stop] = stops.as_slice() else { return Err(OpticsError::Stops { n_stops: stops.len() }.into()) };
    let mirrors: Vec<usize> = (0..prescription.surfaces.len()).filter(|&i| prescription.surfaces[i].mirror).collect();
    let mut interfaces = Vec::with_capacity(prescription.surfaces.len());
    let mut coatings = Vec::new();
    let mut surface_comments = Vec::with_capacity(prescription.surfaces.len());
    for (surface, row) in prescription.surfaces.into_iter().enumerate() {
        let curvature_per_mm = curvature_per_mm(surface, "radius_mm", row.radius_mm)?;
        coatings.extend(row.coating.map(|coating| (surface, coating)));
        let surface = Surface { curvature_per_mm, shape: row.shape, semi_aperture_mm: row.semi_aperture_mm };
        interfaces.push(Interface { surface, medium_after: row.medium, thickness_after_mm: row.thickness_mm });
        surface_comments.push(row.comment);
    }
    let curvature_per_mm = curvature_per_mm(interfaces.len(), "image_radius_mm", prescription.image_radius_mm)?;
    let image_surface = ImageSurface { curvature_per_mm, conic: prescription.image_conic };
    let lens =
        Lens::new_with_apertures(prescription.name, prescription.source, interfaces, stop, prescription.apertures)?;
    let lens = lens.with_object_medium(prescription.object_medium)?.with_mirrors(mirrors)?;
    let lens = lens.with_iris(prescription.iris)?;
    let lens = match prescription.closed_to_mm {
        Some(mm) => lens.with_stop_diameter_mm(2.0 * mm)?,
        None => lens,
    };
    let lens = lens.with_diffractive(prescription.diffractive)?.with_coatings(coatings)?;
    let lens = lens.with_moves(prescription.moves)?.with_image_surface(image_surface)?;
    let positive = |key: &str, found: Option<f64>| match found.filter(|mm| !(mm.is_finite() && *mm > 0.0)) {
        Some(found) => Err(TextError { line: None, reason: format!("{key} is {found}, expected a number above 0") }),
        None => Ok(found),
    };
    let finite = |key: &str, found: Option<f64>| match found.filter(|v| !v.is_finite()) {
        Some(found) => Err(TextError { line: None, reason: format!("{key} is {found}, expected a finite number") }),
        None => Ok(found),
    };
    for &nm in &prescription.wavelengths_nm {
        positive("a wavelength of wavelengths_nm", Some(nm))?;
    }
    for field in &prescription.fields {
        let (Field::Angle { x_deg: x, y_deg: y }
        | Field::ObjectHeight { x_mm: x, y_mm: y }
        | Field::ImageHeight { x_mm: x, y_mm: y }
        | Field::RealImageHeight { x_mm: x, y_mm: y }) = *field;
        finite("a number of fields", Some(x))?;
        finite("a number of fields", Some(y))?;
    }
    if surface_comments.iter().all(String::is_empty) {
        surface_comments.clear();
    }
    check_weights("wavelength_weights", &prescription.wavelength_weights, prescription.wavelengths_nm.len())?;
    check_weights("field_weights", &prescription.field_weights, prescription.fields.len())?;
    Ok(LensFile {
        wavelength_weights: prescription.wavelength_weights,
        field_weights: prescription.field_weights,
        surface_comments,
        comments: prescription.comments,
        film_distance_mm: finite("film_distance_mm", prescription.film_distance_mm)?,
        object_distance_mm: finite("object_distance_mm", prescription.object_distance_mm)?,
        reference_wavelength_nm: positive("reference_wavelength_nm", prescription.reference_wavelength_nm)?,
        wavelengths_nm: prescription.wavelengths_nm,
        fields: prescription.fields,
        ..LensFile::from(lens)
    })
}

/// Checks that weights, where there are any, are one each of so many things.
fn check_weights(key: &str, weights: &[f64], n: usize) -> Result<(), TextError> {
    let are_good = weights.iter().all(|weight| weight.is_finite() && *weight >= 0.0);
    if weights.is_empty() || (weights.len() == n && are_good) {
        return Ok(());
    }
    Err(TextError { line: None, reason: format!("{key} is {weights:?}, expected {n} numbers of 0 or more") })
}

/// Returns the curvature of a radius, which is left out for a plane.
fn curvature_per_mm(surface: usize, key: &'static str, radius_mm: Option<f64>) -> Result<f64, OpticsError> {
    match radius_mm {
        None => Ok(0.0),
        Some(found) if found == 0.0 || found.is_nan() => {
            let expected = "a radius other than 0, or no radius for a plane";
            Err(OpticsError::Surface { surface, key, found, expected })
        }
        Some(radius_mm) => Ok(1.0 / radius_mm),
    }
}

impl Lens {
    /// Returns the lens as the text of our own file, which reads back as the same lens.
    pub fn to_ron(&self) -> String {
        LensFile::from(self.clone()).to_ron()
    }

    /// Returns the lens as it stands in our own file.
    fn prescription(&self) -> Prescription {
        let radius_mm = |curvature_per_mm: f64| (curvature_per_mm != 0.0).then(|| reciprocal(curvature_per_mm));
        // Where blades close it, the file states how wide the stop opens, and what it is closed to.
        let closed_to_mm = self.iris_opening().map(|_| self.stop_semi_aperture_mm());
        let full_mm = closed_to_mm.map(|_| self.full_stop_semi_aperture_mm());
        let row = |(i, interface): (usize, &Interface)| Row {
            comment: String::new(),
            radius_mm: radius_mm(interface.surface.curvature_per_mm),
            shape: interface.surface.shape.clone(),
            stop: i == self.stop(),
            mirror: self.is_mirror(i),
            coating: self.coatings().iter().find(|(surface, _)| *surface == i).map(|(_, coating)| coating.clone()),
            semi_aperture_mm: full_mm.filter(|_| i == self.stop()).unwrap_or(interface.surface.semi_aperture_mm),
            medium: interface.medium_after.clone(),
            thickness_mm: interface.thickness_after_mm,
        };
        Prescription {
            name: self.name().to_owned(),
            source: self.source().to_owned(),
            object_medium: self.object_medium().clone(),
            surfaces: self.interfaces().iter().enumerate().map(row).collect(),
            moves: self.moves().to_vec(),
            apertures: self.apertures().to_vec(),
            iris: self.iris().copied(),
            closed_to_mm,
            diffractive: self.diffractive().to_vec(),
            image_radius_mm: radius_mm(self.image_surface().curvature_per_mm),
            image_conic: self.image_surface().conic,
            film_distance_mm: None,
            object_distance_mm: None,
            wavelengths_nm: Vec::new(),
            wavelength_weights: Vec::new(),
            reference_wavelength_nm: None,
            fields: Vec::new(),
            field_weights: Vec::new(),
            comments: Vec::new(),
            configurations: Vec::new(),
            configuration: 1,
        }
    }
}

impl LensFile {
    /// Returns the lens, and what is known of its use, as the text of our own file, which reads back as the same but for an
    /// array of microlenses.
    pub fn to_ron(&self) -> String {
        let pretty = ron::ser::PrettyConfig::new().depth_limit(2);
        ron::Options::default()
            .with_default_extension(Extensions::IMPLICIT_SOME)
            .to_string_pretty(&self.whole_prescription(), pretty)
            .expect("numbers and text always have a RON form")
    }

    /// Returns the lens with all its configurations as it stands in our own file.
    fn whole_prescription(&self) -> Prescription {
        let states: Vec<Prescription> = self.states().iter().map(Self::own_prescription).collect();
        let mut body = self.own_prescription();
        if let [first, ..] = states.as_slice()
            && !self.configurations.is_empty()
        {
            body.clone_from(first);
            // What some configuration does without is not said of all.
            if states.iter().any(|state| state.film_distance_mm.is_none()) {
                body.film_distance_mm = None;
            }
            if states.iter().any(|state| state.reference_wavelength_nm.is_none()) {
                body.reference_wavelength_nm = None;
            }
            let rows = states.iter().zip(self.configuration_names());
            body.configurations = rows.map(|(state, name)| ConfigurationRow::between(&body, state, name)).collect();
            body.configuration = self.configuration;
        }
        body
    }

    /// Returns the lens in use as it stands in our own file.
    fn own_prescription(&self) -> Prescription {
        let mut prescription = Prescription {
            wavelength_weights: self.wavelength_weights.clone(),
            field_weights: self.field_weights.clone(),
            comments: self.comments.clone(),
            film_distance_mm: self.film_distance_mm,
            object_distance_mm: self.object_distance_mm.filter(|mm| mm.is_finite()),
            wavelengths_nm: self.wavelengths_nm.clone(),
            reference_wavelength_nm: self.reference_wavelength_nm,
            fields: self.fields.clone(),
            ..self.lens.prescription()
        };
        for (row, comment) in prescription.surfaces.iter_mut().zip(&self.surface_comments) {
            row.comment.clone_from(comment);
        }
        prescription
    }
}

/// The entries of our own file; an array of microlenses and what a reader noted are left out.
impl Serialize for LensFile {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.whole_prescription().serialize(serializer)
    }
}

/// Checked as a file is.
impl<'de> Deserialize<'de> for LensFile {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        file_of_all(Prescription::deserialize(deserializer)?).map_err(|error| D::Error::custom(error.reason))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SINGLET: &str = "(
        name: \"singlet\",
        source: \"made up\",
        surfaces: [
            (radius_mm: 50.0, semi_aperture_mm: 5.0, medium: NdVd(nd: 1.5, vd: 60.0), thickness_mm: 2.0),
            (stop: true, semi_aperture_mm: 4.0, thickness_mm: 0.0),
        ],
    )";

    #[track_caller]
    fn message(text: &str) -> String {
        let Err(error) = lens_from_ron(text) else { panic!("should be refused") };
        format!("{}: {}", error.line.unwrap_or(0), error.reason)
    }

    #[test]
    fn file_and_back() {
        let Ok(lens) = lens_from_ron(SINGLET) else { panic!("should be read") };
        assert_eq!(lens.stop(), 1);
        assert_eq!(lens.interfaces()[1].surface.curvature_per_mm, 0.0);
        let Ok(again) = lens_from_ron(&lens.to_ron()) else { panic!("{}", lens.to_ron()) };
        assert_eq!(again, lens);
    }

    #[test]
    fn what_is_wrong_is_said_with_its_line() {
        assert!(message(&SINGLET.replace("thickness_mm: 2.0", "thickness: 2.0")).starts_with("5: "));
        assert!(message(&SINGLET.replace("thickness_mm: 2.0", "thickness: 2.0")).contains("thickness"));
        assert!(message(&SINGLET.replace("stop: true, ", "")).contains("exactly one stop, but 0"));
        assert!(message(&SINGLET.replace("radius_mm", "stop: true, radius_mm")).contains("exactly one stop, but 2"));
        assert!(message(&SINGLET.replace("50.0", "NaN")).contains("radius_mm is NaN"));
        assert!(message(&SINGLET.replace("2.0)", "inf)")).contains("surface 0: thickness_mm is inf"));
        assert!(message(&SINGLET.replace("vd: 60.0", "vd: -1.0")).contains("vd is -1"));
        assert!(message("(name: ").starts_with("1: "));
    }
}
