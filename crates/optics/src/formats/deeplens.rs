//! The JSON lens files of `DeepLens`: `surfaces` with type, r, c (or roc), d, k, ai and the media on both sides.

use glam::DVec2;
use serde_json::Value;

use crate::{Aperture, DiffractiveSurface, Glass, Interface, Lens, OpticsError, Outline, PhaseProfile, Shape, Surface};

use super::{
    glasses::{Glasses, constant, model},
    json::{Object, number, numbers},
    lens_file::LensFile,
    shapes::even_asphere,
    text_error::TextError,
};

/// Whether a JSON value has the looks of a `DeepLens` file: its surfaces have the media on both sides, or types, as those of
/// lenses that are diffractive alone.
pub(super) fn is_deeplens(value: &Value) -> bool {
    let surfaces = value.get("surfaces").and_then(Value::as_array);
    surfaces
        .is_some_and(|list| list.iter().any(|row| ["mat1", "mat2", "type"].iter().any(|key| row.get(key).is_some())))
}

/// Reads a lens from the JSON value of a `DeepLens` file, which has no name of its own.
pub(super) fn lens_from_deeplens(value: &Value, name: &str, glasses: &Glasses) -> Result<LensFile, TextError> {
    let file = Object::new(value, "")?;
    let (mut interfaces, mut openings): (Vec<Interface>, Vec<Aperture>) = (Vec::new(), Vec::new());
    let (mut stops, mut object_medium) = (Vec::new(), Glass::Air);
    let rows = file.objects("surfaces")?;
    for (i, row) in rows.iter().enumerate() {
        let wrong =
            |key: &str, reason: String| TextError { line: None, reason: format!("{}: {reason}", row.place(key)) };
        let kind = row.text("type").unwrap_or_default();
        if matches!(kind, "Stop" | "Aperture" | "Diaphragm") {
            stops.push(i);
        }
        let shape = shape(kind, row)?;
        // A square rim has its corners on the circle of the stated radius.
        if row.get("is_square") == Some(&Value::Bool(true)) {
            let half_mm = row.number("r")? * std::f64::consts::FRAC_1_SQRT_2;
            let outline = Outline::Rectangle { half_x_mm: half_mm, half_y_mm: half_mm };
            openings.push(Aperture { surface: i, outline, center_mm: [0.0; 2], is_obscuration: false });
        }
        let curvature_per_mm = if matches!(kind, "Plane" | "ThinLens") { 0.0 } else { curvature_per_mm(row)? };
        if let (0, Some(name)) = (i, row.text("mat1")) {
            object_medium = medium(name, glasses).map_err(|reason| wrong("mat1", reason))?;
        }
        let before = interfaces.last().map_or(&object_medium, |interface| &interface.medium_after);
        if let Some(name) = row.text("mat1")
            && medium(name, glasses).map_err(|reason| wrong("mat1", reason))? != *before
        {
            let reason = format!("is '{name}', but the medium behind the surface before is {}", before.describe());
            return Err(wrong("mat1", reason));
        }
        let medium_after = match row.text("mat2") {
            Some(name) => medium(name, glasses).map_err(|reason| wrong("mat2", reason))?,
            None if stops.last() == Some(&i) => before.clone(),
            None => return Err(wrong("mat2", "is missing, expected the medium behind the surface".to_owned())),
        };
        let surface = Surface { curvature_per_mm, shape, semi_aperture_mm: row.number("r")? };
        let thickness_after_mm = match rows.get(i + 1) {
            Some(next) if row.has("d") && next.has("d") => next.number("d")? - row.number("d")?,
            Some(_) => row.number("d_next")?,
            None => 0.0,
        };
        interfaces.push(Interface { surface, medium_after, thickness_after_mm });
    }
    let element = match file.get("DOE").filter(|element| !element.is_null()) {
        Some(element) => Some(Grating::read(&Object::new(element, "DOE")?)?),
        None => None,
    };
    let mut last_d_mm = rows.last().map_or(Ok(0.0), |last| last.number_or("d", 0.0))?;
    if let (Some(grating), Some(last)) = (&element, interfaces.last_mut()) {
        last.thickness_after_mm = grating.d_mm - last_d_mm;
        last_d_mm = grating.d_mm;
        let (surface, medium_after) = (Surface::plane(grating.half_mm.length()), last.medium_after.clone());
        interfaces.push(Interface { surface, medium_after, thickness_after_mm: 0.0 });
    }
    let &[stop] = stops.as_slice() else { return Err(OpticsError::Stops { n_stops: stops.len() }.into()) };
    let source = file.text("info").unwrap_or("a DeepLens file");
    let surface = interfaces.len() - 1;
    openings.extend(element.iter().map(|grating| grating.opening(surface)));
    let lens = Lens::new_with_apertures(name, source, interfaces, stop, openings)?;
    let diffractive = element.iter().map(|grating| grating.diffractive(surface)).collect();
    let mut read = LensFile::of_lens(lens.with_object_medium(object_medium)?.with_diffractive(diffractive)?);
    if element.is_some() {
        read.notes.push("DOE: of the grating the first order is traced, with all of the light".to_owned());
    }
    if let Some(sensor) = file.get("d_sensor") {
        read.film_distance_mm = Some(number(sensor, "d_sensor")? - last_d_mm);
    }
    Ok(read)
}

/// A linear grating behind the lens: its phase is `alpha (x sin θ + y cos θ)` over half the width.
struct Grating {
    d_mm: f64,
    /// Half its widths along x and y, mm.
    half_mm: DVec2,
    lines_per_mm: DVec2,
}

impl Grating {
    fn read(element: &Object) -> Result<Self, TextError> {
        let wrong = |reason: String| TextError { line: None, reason };
        match element.text("type") {
            Some("Grating") => {}
            other => {
                let kind = other.unwrap_or("without a type");
                let expected = "expected a Grating, as the phases of others are those of waves, not of an order";
                return Err(wrong(format!("DOE: a diffractive element ({kind}) is not supported; {expected}")));
            }
        }
        let res = element.get("res").map_or(Ok(vec![2000.0]), |res| match res.as_f64() {
            Some(one) => Ok(vec![one]),
            None => numbers(res, &element.place("res")),
        })?;
        let pitch_mm = element.number_or("fab_ps", 1e-3)?;
        let half_mm = match *res.as_slice() {
            [n] => DVec2::splat(0.5 * n * pitch_mm),
            [x, y] => DVec2::new(x, y) * (0.5 * pitch_mm),
            _ => return Err(wrong(format!("{} has {} numbers, expected one or two", element.place("res"), res.len()))),
        };
        if !(half_mm.min_element() > 0.0 && half_mm.is_finite()) {
            return Err(wrong(format!("{} and fab_ps make no width above 0", element.place("res"))));
        }
        let (sine, cosine) = element.number_or("theta", 0.0)?.sin_cos();
        let per_mm = element.number_or("alpha", 0.0)? / (std::f64::consts::TAU * half_mm.x);
        Ok(Self { d_mm: element.number("d")?, half_mm, lines_per_mm: DVec2::new(sine, cosine) * per_mm })
    }

    fn opening(&self, surface: usize) -> Aperture {
        let outline = Outline::Rectangle { half_x_mm: self.half_mm.x, half_y_mm: self.half_mm.y };
        Aperture { surface, outline, center_mm: [0.0; 2], is_obscuration: false }
    }

    fn diffractive(&self, surface: usize) -> DiffractiveSurface {
        let profile = PhaseProfile::Grating { lines_per_mm: self.lines_per_mm.to_array() };
        DiffractiveSurface { surface, order: 1, profile, blaze: None }
    }
}

/// Returns the shape beyond the curvature at the vertex.
fn shape(kind: &str, row: &Object) -> Result<Shape, TextError> {
    match kind {
        "Stop" | "Aperture" | "Diaphragm" | "Plane" | "Spheric" => Ok(Shape::Sphere),
        "Aspheric" => {
            let coefficients = coefficients_from_r2(row)?;
            Ok(even_asphere(row.number_or("k", 0.0)?, &coefficients))
        }
        "ThinLens" => {
            let key = if row.has("f") { "f" } else { "foclen" };
            Ok(Shape::ThinLens { power_per_mm: 1.0 / row.number(key)? })
        }
        other => {
            let known = "expected Stop, Aperture, Plane, Spheric, Aspheric or ThinLens";
            let reason = format!("{}: surfaces of type '{other}' are not supported; {known}", row.place("type"));
            Err(TextError { line: None, reason })
        }
    }
}

/// Returns the aspheric coefficients from r² on: of the keys ai2, ai4, … where there are any, else of the list ai.
fn coefficients_from_r2(row: &Object) -> Result<Vec<f64>, TextError> {
    let keys: Vec<String> = (1..=15).map(|half| format!("ai{}", 2 * half)).collect();
    let Some(n_keys) = keys.iter().rposition(|key| row.get(key).is_some()) else {
        return row.get("ai").map_or(Ok(Vec::new()), |list| numbers(list, &row.place("ai")));
    };
    keys[..=n_keys].iter().map(|key| row.number_or(key, 0.0)).collect()
}

/// Returns the curvature: of `c`, or of the radius `roc`, of which 0 or infinity means a plane.
fn curvature_per_mm(row: &Object) -> Result<f64, TextError> {
    if row.get("c").is_some() {
        return row.number("c");
    }
    let radius_mm = row.number_or("roc", 0.0)?;
    Ok(if radius_mm == 0.0 { 0.0 } else { 1.0 / radius_mm })
}

/// Returns the medium of a name, as `air`, `pmma`, `n-bk7`, `1.6280/57.0` or `1.5`.
fn medium(name: &str, glasses: &Glasses) -> Result<Glass, String> {
    if matches!(name.to_lowercase().as_str(), "air" | "vacuum" | "occluder") {
        return Ok(Glass::Air);
    }
    let glass = match name.split_once('/').map(|(nd, vd)| (nd.trim().parse(), vd.trim().parse())) {
        Some((Ok(nd), Ok(vd))) => model(nd, vd),
        _ => match name.parse() {
            Ok(index) => constant(index),
            Err(_) => glasses.find(name, None)?.glass,
        },
    };
    glass.check().map_err(|error| error.to_string())?;
    Ok(glass)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::lens_file::ReadOptions;

    const SINGLET: &str = r#"{"info": "a test", "d_sensor": 52.5, "surfaces": [
        {"type": "Stop", "r": 1.0, "c": 0.0, "d": 0.0, "mat1": "air", "mat2": "air"},
        {"type": "Aspheric", "r": 2.0, "c": 0.02, "d": 0.5, "k": -1.0, "ai": [0.0, 1e-5], "mat1": "air", "mat2": "1.5/60"},
        {"type": "Spheric", "r": 2.0, "roc": -50, "d": 2.5, "mat1": "1.5/60", "mat2": "air"}]}"#;

    fn read(text: &str) -> Result<LensFile, TextError> {
        lens_from_deeplens(&serde_json::from_str(text).unwrap(), "file", &Glasses::new(&ReadOptions::default()))
    }

    #[track_caller]
    fn message(text: &str) -> String {
        read(text).expect_err("should be refused").reason
    }

    #[test]
    fn surfaces_film_and_media_are_read() {
        let file = read(SINGLET).ok().unwrap();
        assert_eq!((file.lens.stop(), file.lens.last_vertex_z_mm(), file.film_distance_mm), (0, 2.5, Some(50.0)));
        let asphere = &file.lens.interfaces()[1];
        assert_eq!(asphere.medium_after, Glass::NdVd { nd: 1.5, vd: 60.0 });
        assert_eq!(asphere.surface.shape, Shape::EvenAsphere { conic: -1.0, coefficients: vec![1e-5] });
        assert_eq!(file.lens.interfaces()[2].surface.curvature_per_mm, -0.02);

        let file = read(&SINGLET.replace("[0.0, 1e-5]", "[0.01, 1e-5]")).ok().unwrap();
        let with_square = Shape::OddAsphere { conic: -1.0, coefficients: vec![0.0, 0.01, 0.0, 1e-5] };
        assert_eq!(file.lens.interfaces()[1].surface.shape, with_square);
    }

    #[test]
    fn grating_behind_the_lens_is_a_surface() {
        let with = |element: &str| SINGLET.replace("\"d_sensor\"", &format!("\"DOE\": {element}, \"d_sensor\""));
        let grating = "{\"type\": \"Grating\", \"d\": 8.5, \"res\": [4000, 2000], \"alpha\": 100.0, \"theta\": 0.5}";
        let file = read(&with(grating)).ok().unwrap();
        assert_eq!((file.lens.interfaces().len(), file.lens.last_vertex_z_mm()), (4, 8.5));
        assert_eq!((file.film_distance_mm, file.lens.apertures().len(), file.notes.len()), (Some(44.0), 1, 1));
        let [DiffractiveSurface { surface: 3, order: 1, profile: PhaseProfile::Grating { lines_per_mm }, .. }] =
            file.lens.diffractive()
        else {
            panic!("{:?}", file.lens.diffractive())
        };
        // 100 rad over half the width along x, 2 mm.
        let expected = DVec2::new(0.5_f64.sin(), 0.5_f64.cos()) * (50.0 / std::f64::consts::TAU);
        assert!((DVec2::from_array(*lines_per_mm) - expected).length() < 1e-14);
        assert!(read(&with("null")).is_ok());
        let reason = message(&with("{\"type\": \"Fresnel\", \"d\": 8.3}"));
        assert!(reason.starts_with("DOE: a diffractive element (Fresnel) is not supported"), "{reason}");
    }

    #[test]
    fn what_is_wrong_or_not_supported_is_reported_by_its_key() {
        assert!(
            message(&SINGLET.replace("Spheric", "Cubic")).starts_with("surfaces[2].type: surfaces of type 'Cubic'")
        );
        assert!(message(&SINGLET.replace("\"Stop\"", "\"Plane\"")).contains("but 0 surfaces"));
        assert!(
            message(&SINGLET.replace("1.5/60\"}", "unobtainium\"}")).contains("surfaces[1].mat2: no glass is named")
        );
        assert!(
            message(&SINGLET.replace("\"mat1\": \"1.5/60\"", "\"mat1\": \"pmma\""))
                .starts_with("surfaces[2].mat1: is 'pmma'")
        );
        assert!(
            message(&SINGLET.replace("\"r\": 1.0", "\"r\": [1]")).contains("surfaces[0].r is [1], expected a number")
        );
    }
}
