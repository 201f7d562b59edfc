//! The JSON lens files of ISET ("omni"): `surfaces` with `radius`, `thickness`, `ior` and `semi_aperture`, in mm.
//!
//! `ior` is that of the medium behind, a number or a table `[[wavelengths in nm], [indices]]`; `radius` 0 marks the
//! stop, where an `ior` of 0 means the medium before. Beyond what ISET reads, `"radius": null` is a refracting
//! plane, `ior` may name a glass of the catalogue, and `"stop": true` marks a stop that is also something else.

use serde_json::Value;

use crate::{Glass, Interface, Lens, OpticsError, Shape, Surface, prescription::TextError};

use super::{
    glasses::{Glasses, constant},
    json::{Object, number, numbers, wrong},
    shapes::even_asphere,
};

const SURFACE_KEYS: &str =
    "radius, thickness, ior, semi_aperture, conic_constant, aspheric_coefficients, transform and stop";

/// Reads a lens from the JSON value of an omni file; `name` serves where the file states none.
pub(super) fn lens_from_omni(value: &Value, name: &str, glasses: &Glasses) -> Result<Lens, TextError> {
    let file = Object::new(value, "")?;
    if let Some(microlens) = file.get("microlens")
        && !is_empty(microlens)
    {
        let reason = "microlens: microlens arrays are not supported; without this block the main lens can be read";
        return Err(TextError { line: None, reason: reason.to_owned() });
    }
    let mut interfaces: Vec<Interface> = Vec::new();
    let mut stops = Vec::new();
    for (i, row) in file.objects("surfaces")?.iter().enumerate() {
        if let Some(key) = row.keys().find(|key| !SURFACE_KEYS.split([' ', ',']).any(|known| known == *key)) {
            let reason = format!("{} is not known; expected {SURFACE_KEYS}", row.place(key));
            return Err(TextError { line: None, reason });
        }
        check_transform(row)?;
        let radius_mm = radius_mm(row)?;
        let is_stop = radius_mm == Some(0.0) || row.get("stop") == Some(&Value::Bool(true));
        if is_stop {
            stops.push(i);
        }
        let medium_before = interfaces.last().map_or(&Glass::Air, |before| &before.medium_after);
        let medium_after = medium(row, is_stop, medium_before, glasses)?;
        let curvature_per_mm = radius_mm.filter(|&radius| radius != 0.0).map_or(0.0, |radius| 1.0 / radius);
        let surface = Surface { curvature_per_mm, shape: shape(row)?, semi_aperture_mm: row.number("semi_aperture")? };
        let checked = surface.check(i).and_then(|()| medium_after.check());
        checked.map_err(|error| TextError { line: None, reason: format!("surfaces[{i}]: {error}") })?;
        interfaces.push(Interface { surface, medium_after, thickness_after_mm: row.number("thickness")? });
    }
    let &[stop] = stops.as_slice() else {
        let error = OpticsError::Stops { n_stops: stops.len() };
        return Err(TextError { line: None, reason: format!("{error} (a radius of 0)") });
    };
    let source = file.text("description").unwrap_or("an omni .json file");
    Ok(Lens::new(file.text("name").unwrap_or(name), source, interfaces, stop)?)
}

/// Returns the radius: 0 for the stop, nothing for a plane.
fn radius_mm(row: &Object) -> Result<Option<f64>, TextError> {
    if row.has("radius") && row.get("radius").is_none() {
        return Ok(None);
    }
    let radius = row.required("radius", "a number in mm, 0 for the stop, null for a plane")?;
    number(radius, &row.place("radius")).map(Some)
}

fn shape(row: &Object) -> Result<Shape, TextError> {
    let conic = row.number_or("conic_constant", 0.0)?;
    let place = row.place("aspheric_coefficients");
    let mut coefficients = vec![0.0];
    if let Some(list) = row.get("aspheric_coefficients") {
        coefficients.extend(numbers(list, &place)?);
    }
    Ok(even_asphere(conic, &coefficients))
}

fn medium(row: &Object, is_stop: bool, before: &Glass, glasses: &Glasses) -> Result<Glass, TextError> {
    let place = row.place("ior");
    let ior = row.required("ior", "an index, a table or the name of a glass")?;
    let glass = match ior {
        Value::Number(_) => match number(ior, &place)? {
            0.0 if is_stop => before.clone(),
            index if index > 0.0 => constant(index),
            _ => return Err(wrong(&place, ior, "an index above 0")),
        },
        Value::String(name) if name.eq_ignore_ascii_case("air") => Glass::Air,
        Value::String(name) => {
            let found = glasses.find(name, None);
            found.map_err(|reason| TextError { line: None, reason: format!("{place}: {reason}") })?.glass
        }
        _ => table(ior, &place)?,
    };
    glass.check().map_err(|error| TextError { line: None, reason: format!("{place}: {error}") })?;
    Ok(glass)
}

/// Returns the medium of a table `[[wavelengths], [indices]]` or `[[wavelength, index], …]`.
fn table(value: &Value, place: &str) -> Result<Glass, TextError> {
    let expected = "an index or a table [[wavelengths in nm], [indices]]";
    let lists = value.as_array().ok_or_else(|| wrong(place, value, expected))?;
    let rows = lists.iter().enumerate().map(|(i, list)| numbers(list, &format!("{place}[{i}]")));
    let rows: Vec<Vec<f64>> = rows.collect::<Result<_, _>>()?;
    // No index reaches 20, and no wavelength of light is shorter than that.
    let is_pair = |row: &Vec<f64>| matches!(row[..], [nm, index] if nm > 20.0 && index < 20.0);
    let (wavelengths_nm, indices) = match rows.as_slice() {
        pairs if !pairs.is_empty() && pairs.iter().all(is_pair) => pairs.iter().map(|row| (row[0], row[1])).unzip(),
        [wavelengths_nm, indices] if wavelengths_nm.len() == indices.len() => (wavelengths_nm.clone(), indices.clone()),
        _ => return Err(wrong(place, value, expected)),
    };
    match indices.as_slice() {
        [index] => Ok(constant(*index)),
        _ => Ok(Glass::Tabulated { wavelengths_nm, indices }),
    }
}

/// Refuses a surface that is moved or turned.
fn check_transform(row: &Object) -> Result<(), TextError> {
    let Some(transform) = row.get("transform") else { return Ok(()) };
    let place = row.place("transform");
    let mut flat = Vec::new();
    flatten(transform, &place, &mut flat)?;
    let n_columns = if flat.len() == 9 { 3 } else { 4 };
    let is_identity = |(i, &value): (usize, &f64)| value == if i / n_columns == i % n_columns { 1.0 } else { 0.0 };
    match flat.len() {
        0 => Ok(()),
        9 | 12 | 16 if flat.iter().enumerate().all(is_identity) => Ok(()),
        9 | 12 | 16 => {
            let reason = format!("{place}: tilted or decentred surfaces are not supported");
            Err(TextError { line: None, reason })
        }
        _ => Err(wrong(&place, transform, "a matrix of 9, 12 or 16 numbers")),
    }
}

fn flatten(value: &Value, place: &str, flat: &mut Vec<f64>) -> Result<(), TextError> {
    match value {
        Value::Array(list) => list.iter().try_for_each(|value| flatten(value, place, flat)),
        _ => {
            flat.push(number(value, place)?);
            Ok(())
        }
    }
}

fn is_empty(value: &Value) -> bool {
    match value {
        Value::Object(map) => map.is_empty(),
        Value::Array(list) => list.is_empty(),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::lens_file::ReadOptions;

    const SINGLET: &str = r#"{"name": "singlet", "surfaces": [
        {"radius": 50, "thickness": 3, "ior": 1.5, "semi_aperture": 5},
        {"radius": 0, "thickness": 1, "ior": 0, "semi_aperture": 4},
        {"radius": null, "thickness": 0, "ior": 1, "semi_aperture": 5}]}"#;

    fn read(text: &str) -> Result<Lens, TextError> {
        lens_from_omni(&serde_json::from_str(text).unwrap(), "file", &Glasses::new(&ReadOptions::default()))
    }

    #[track_caller]
    fn message(text: &str) -> String {
        read(text).expect_err("should be refused").reason
    }

    #[test]
    fn stop_plane_and_media_are_what_the_format_says() {
        let lens = read(SINGLET).ok().unwrap();
        assert_eq!((lens.name(), lens.stop()), ("singlet", 1));
        let media: Vec<&Glass> = lens.interfaces().iter().map(|interface| &interface.medium_after).collect();
        assert_eq!(media, [&constant(1.5), &constant(1.5), &Glass::Air]);
        assert_eq!(lens.interfaces()[2].surface.curvature_per_mm, 0.0);
    }

    #[test]
    fn index_may_be_a_table_or_a_name() {
        let ior = |ior: &str| {
            read(&SINGLET.replace("\"ior\": 1.5", &format!("\"ior\": {ior}"))).map(|lens| {
                lens.at(550.0).unwrap();
                lens.interfaces()[0].medium_after.index_at(550.0).unwrap()
            })
        };
        assert_eq!(ior("[[500, 600], [1.6, 1.5]]").ok(), Some(1.55));
        assert_eq!(ior("[[500, 1.6], [600, 1.5]]").ok(), Some(1.55));
        assert_eq!(ior("[[500, 1.6], [600, 1.5], [700, 1.4]]").ok(), Some(1.55));
        assert_eq!(ior("[[550], [1.6]]").ok(), Some(1.6));
        assert!((ior("\"N-BK7\"").ok().unwrap() - 1.51852).abs() < 1e-5);
        assert!(ior("\"TIF6\"").err().unwrap().reason.starts_with("surfaces[0].ior: no glass is named 'TIF6'"));
        assert!(ior("[[500, 600], [1.6]]").err().unwrap().reason.contains("expected an index or a table"));
        assert!(ior("[[600, 500], [1.6, 1.5]]").err().unwrap().reason.contains("ascending"));
        assert!(ior("-1").err().unwrap().reason.contains("surfaces[0].ior is -1, expected an index above 0"));
    }

    #[test]
    fn conic_and_asphere_start_at_the_fourth_power() {
        let with = |keys: &str| read(&SINGLET.replace("\"radius\": 50", &format!("\"radius\": 50, {keys}")));
        let shape = |keys: &str| with(keys).ok().unwrap().interfaces()[0].surface.shape.clone();
        assert_eq!(shape("\"conic_constant\": -1"), Shape::Conic { conic: -1.0 });
        let expected = Shape::EvenAsphere { conic: 0.0, coefficients: vec![1e-5] };
        assert_eq!(shape("\"aspheric_coefficients\": [1e-5, 0]"), expected);
        assert!(with("\"aspheric_coefficients\": [1e-5, \"x\"]").err().unwrap().reason.starts_with("surfaces[0].asph"));
    }

    #[test]
    fn what_is_not_supported_is_named() {
        let with = |key: &str| message(&SINGLET.replace("\"radius\": 50", &format!("\"radius\": 50, {key}")));
        assert_eq!(with("\"glass\": 1"), format!("surfaces[0].glass is not known; expected {SURFACE_KEYS}"));
        assert!(with("\"transform\": [1,0,0,0.5,0,1,0,0,0,0,1,0,0,0,0,1]").contains("surfaces[0].transform: tilted"));
        assert!(with("\"transform\": [1,0]").contains("expected a matrix of 9, 12 or 16 numbers"));
        let identity = "\"radius\": 50, \"transform\": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";
        assert!(read(&SINGLET.replace("\"radius\": 50", identity)).is_ok());
        assert!(
            message(&SINGLET.replace("{\"name\"", "{\"microlens\": {\"surfaces\": []}, \"name\"")).contains("micro")
        );
        assert!(read(&SINGLET.replace("{\"name\"", "{\"microlens\": [], \"name\"")).is_ok());
    }

    #[test]
    fn mistakes_are_told_by_their_key() {
        assert_eq!(message("[]"), "the file is [], expected an object {…}");
        assert_eq!(message("{}"), "surfaces is missing, expected a list of objects");
        assert_eq!(
            message(&SINGLET.replace("\"thickness\": 3", "\"thickness\": \"3\"")),
            "surfaces[0].thickness is \"3\", expected a number"
        );
        assert!(
            message(&SINGLET.replace("\"semi_aperture\": 4", "\"semi_aperture\": -4"))
                .starts_with("surfaces[1]: surface 1: semi_aperture_mm is -4")
        );
        assert!(message(&SINGLET.replace("\"radius\": 0,", "\"radius\": 90,")).contains("ior is 0, expected an index"));
        assert!(message(&SINGLET.replace("null", "0")).contains("2 surfaces are marked as the stop (a radius of 0)"));
        assert!(message(&SINGLET.replace("\"radius\": 0,", "")).contains("surfaces[1].radius is missing"));
    }
}
