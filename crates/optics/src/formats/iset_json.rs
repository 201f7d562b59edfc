//! The JSON lens files of ISET ("omni"): `surfaces` with `radius`, `thickness`, `ior` and `semi_aperture`, in mm.
//!
//! `ior` is that of the medium behind, a number or a table `[[wavelengths in nm], [indices]]`; `radius` 0 marks the
//! stop, where an `ior` of 0 means the medium before. Beyond what ISET reads, `"radius": null` is a refracting
//! plane, `ior` may name a glass of the catalogue, and `"stop": true` marks a stop that is also something else. Two
//! numbers for a `radius` or `conic_constant` are those along x and y.

use glam::{DMat3, DVec3};
use serde_json::Value;

use crate::{CoordinateBreak, Glass, Interface, Lens, OpticsError, Placement, Shape, Surface};

use super::{
    glasses::{Glasses, constant},
    json::{Object, number, numbers, wrong},
    lens_file::{LensFile, Microlens},
    shapes::even_asphere,
    text_error::TextError,
};

const SURFACE_KEYS: &str =
    "radius, thickness, ior, semi_aperture, conic_constant, aspheric_coefficients, transform and stop";

/// What is read of a file, and what changes nothing.
const FILE_KEYS: [&str; 6] = ["name", "description", "type", "metadata", "surfaces", "microlens"];

/// Reads a lens from the JSON value of an omni file; `name` serves where the file states none.
pub(super) fn lens_from_omni(value: &Value, name: &str, glasses: &Glasses) -> Result<LensFile, TextError> {
    let file = Object::new(value, "")?;
    if ["polynomials", "poly"].iter().any(|key| file.get(key).is_some()) && file.get("surfaces").is_none() {
        let reason = "it is a ray-transfer function, polynomials in place of surfaces: expected a lens of surfaces; what another program makes \
                      of it can be used with psfs (run --psfs)";
        return Err(TextError { line: None, reason: reason.to_owned() });
    }
    let Rows { interfaces, stops, moves } = rows_of(&file, glasses)?;
    let &[stop] = stops.as_slice() else {
        let error = OpticsError::Stops { n_stops: stops.len() };
        return Err(TextError { line: None, reason: format!("{error} (a radius of 0)") });
    };
    let source = file.text("description").unwrap_or("an omni .json file");
    let lens = Lens::new(file.text("name").unwrap_or(name), source, interfaces, stop)?.with_moves(moves)?;
    let mut read = LensFile::of_lens(lens);
    let unknown: Vec<&str> = file.keys().map(String::as_str).filter(|key| !FILE_KEYS.contains(key)).collect();
    if !unknown.is_empty() {
        read.notes.push(format!("{} of the file is not known and left out", unknown.join(", ")));
    }
    if let Some(block) = file.get("microlens")
        && !is_empty(block)
    {
        let microlens = microlens(block, glasses)?;
        let [nx, ny] = microlens.dimensions;
        read.notes.push(format!("the array of {nx} × {ny} microlenses is kept, but not traced"));
        read.microlens = Some(microlens);
    }
    Ok(read)
}

/// The surfaces of a list, which of them are stops, and how they are moved.
struct Rows {
    interfaces: Vec<Interface>,
    stops: Vec<usize>,
    moves: Vec<CoordinateBreak>,
}

fn rows_of(file: &Object, glasses: &Glasses) -> Result<Rows, TextError> {
    let mut moves = Vec::new();
    let mut interfaces: Vec<Interface> = Vec::new();
    let mut stops = Vec::new();
    for (i, row) in file.objects("surfaces")?.iter().enumerate() {
        if let Some(key) = row.keys().find(|key| !SURFACE_KEYS.split([' ', ',']).any(|known| known == *key)) {
            let reason = format!("{} is not known; expected {SURFACE_KEYS}", row.place(key));
            return Err(TextError { line: None, reason });
        }
        moves.extend(transform(row)?.map(|placement| moved(i, &placement)));
        let radius_mm = radius_mm(row)?;
        let is_stop = radius_mm == Some([0.0; 2]) || row.get("stop") == Some(&Value::Bool(true));
        if is_stop {
            stops.push(i);
        }
        let medium_before = interfaces.last().map_or(&Glass::Air, |before| &before.medium_after);
        let medium_after = medium(row, is_stop, medium_before, glasses)?;
        let of_radius = |radius: f64| if radius == 0.0 { 0.0 } else { 1.0 / radius };
        let curvatures_per_mm = radius_mm.unwrap_or_default().map(of_radius);
        let shape = shape(row, curvatures_per_mm)?;
        let semi_aperture_mm = match pair(row.required("semi_aperture", "a number")?, &row.place("semi_aperture"))? {
            [x, y] if x == y => x,
            _ => return Err(plain(format!("{}: an elliptic rim is not supported", row.place("semi_aperture")))),
        };
        let surface = Surface { curvature_per_mm: curvatures_per_mm[1], shape, semi_aperture_mm };
        let checked = surface.check(i, &[]).and_then(|()| medium_after.check());
        checked.map_err(|error| TextError { line: None, reason: format!("surfaces[{i}]: {error}") })?;
        interfaces.push(Interface { surface, medium_after, thickness_after_mm: row.number("thickness")? });
    }
    Ok(Rows { interfaces, stops, moves })
}

/// Reads the block of microlenses.
fn microlens(value: &Value, glasses: &Glasses) -> Result<Microlens, TextError> {
    let block = Object::new(value, "microlens")?;
    let place = block.place("dimensions");
    let dimensions = block.required("dimensions", "how many microlenses there are along x and y")?;
    let counts = pair(dimensions, &place)?;
    if !counts.iter().all(|&n| (1.0..=1e6).contains(&n) && n.fract() == 0.0) {
        return Err(wrong(&place, dimensions, "whole numbers of microlenses along x and y"));
    }
    let dimensions = counts.map(|n| n as usize);
    let place = block.place("offsets");
    let offsets_mm: Vec<[f64; 2]> = match block.get("offsets") {
        None => Vec::new(),
        Some(Value::Array(list)) => list.iter().map(|offset| pair(offset, &place)).collect::<Result<_, _>>()?,
        Some(other) => return Err(wrong(&place, other, "a list of shifts in mm")),
    };
    if !offsets_mm.is_empty() && offsets_mm.len() != dimensions[0] * dimensions[1] {
        let (found, [nx, ny]) = (offsets_mm.len(), dimensions);
        return Err(plain(format!("{place} has {found} shifts, expected one each of the {nx} × {ny} microlenses")));
    }
    let Rows { interfaces, stops, moves } = rows_of(&block, glasses)?;
    let stop = match stops.as_slice() {
        [] => 0,
        [stop] => *stop,
        _ => return Err(OpticsError::Stops { n_stops: stops.len() }.into()),
    };
    let source = "the microlens block of an omni .json file";
    Ok(Microlens { dimensions, offsets_mm, lens: Lens::new("microlens", source, interfaces, stop)?.with_moves(moves)? })
}

fn plain(reason: String) -> TextError {
    TextError { line: None, reason }
}

/// Returns the two numbers of a list along x and y, or one number twice.
fn pair(value: &Value, place: &str) -> Result<[f64; 2], TextError> {
    match value {
        Value::Array(_) => match numbers(value, place)?.as_slice() {
            &[x, y] => Ok([x, y]),
            _ => Err(wrong(place, value, "a number, or two: along x and y")),
        },
        _ => number(value, place).map(|number| [number; 2]),
    }
}

/// Returns the radii along x and y: 0 for the stop, nothing for a plane.
fn radius_mm(row: &Object) -> Result<Option<[f64; 2]>, TextError> {
    if row.has("radius") && row.get("radius").is_none() {
        return Ok(None);
    }
    let radius = row.required("radius", "a number in mm, 0 for the stop, null for a plane")?;
    pair(radius, &row.place("radius")).map(Some)
}

fn shape(row: &Object, [curvature_x_per_mm, curvature_y_per_mm]: [f64; 2]) -> Result<Shape, TextError> {
    // ISET writes an empty list for none.
    let is_stated = |conic: &&Value| conic.as_array().is_none_or(|list| !list.is_empty());
    let conics = row.get("conic_constant").filter(is_stated).map(|conic| pair(conic, &row.place("conic_constant")));
    let [conic_x, conic] = conics.transpose()?.unwrap_or_default();
    let place = row.place("aspheric_coefficients");
    let mut coefficients = vec![0.0];
    if let Some(list) = row.get("aspheric_coefficients") {
        coefficients.extend(numbers(list, &place)?);
    }
    if curvature_x_per_mm == curvature_y_per_mm && conic_x == conic {
        return Ok(even_asphere(conic, &coefficients));
    }
    if coefficients.iter().any(|&a| a != 0.0) {
        return Err(plain(format!("{place}: an asphere with two radii is not supported")));
    }
    Ok(Shape::Biconic { conic, curvature_x_per_mm, conic_x })
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

/// Returns how a surface is shifted and turned from its place, if it is.
///
/// The four columns say where its x, y and z axes point and how far its vertex is shifted, in mm.
fn transform(row: &Object) -> Result<Option<Placement>, TextError> {
    let Some(transform) = row.get("transform") else { return Ok(None) };
    let place = row.place("transform");
    let mut flat = Vec::new();
    flatten(transform, &place, &mut flat)?;
    let n_columns = if flat.len() == 9 { 3 } else { 4 };
    let is_identity = |(i, &value): (usize, &f64)| value == if i / n_columns == i % n_columns { 1.0 } else { 0.0 };
    let expected = "four columns of three numbers: the x, y and z axes and the shift in mm";
    let columns: Option<Vec<DVec3>> = transform.as_array().filter(|columns| columns.len() == 4).and_then(|columns| {
        let column = |column: &Value| <[f64; 3]>::try_from(numbers(column, &place).ok()?).ok().map(DVec3::from_array);
        columns.iter().map(column).collect()
    });
    match (flat.len(), columns.as_deref()) {
        (0, _) => Ok(None),
        (_, Some(&[x, y, z, shift])) => {
            let rotation = DMat3::from_cols(x, y, z);
            let apart = (rotation * rotation.transpose() - DMat3::IDENTITY).to_cols_array();
            // Files of single precision have seven digits.
            if apart.iter().any(|v| v.abs() > 1e-6) || rotation.determinant() < 0.0 {
                return Err(plain(format!("{place}: its axes are not those of a rotation")));
            }
            let placement = Placement { vertex_mm: shift, rotation };
            Ok(Some(placement).filter(|placement| *placement != Placement::centered(0.0)))
        }
        (9 | 12 | 16, None) if flat.iter().enumerate().all(is_identity) => Ok(None),
        _ => Err(wrong(&place, transform, expected)),
    }
}

/// Returns the move of one surface about its own vertex.
fn moved(surface: usize, placement: &Placement) -> CoordinateBreak {
    CoordinateBreak {
        surfaces: (surface, surface),
        pivot_mm: 0.0,
        decenter_mm: placement.vertex_mm.into(),
        tilt_deg: placement.tilt_deg(),
        tilt_first: false,
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

    fn read_file(text: &str) -> Result<LensFile, TextError> {
        lens_from_omni(&serde_json::from_str(text).unwrap(), "file", &Glasses::new(&ReadOptions::default()))
    }

    fn read(text: &str) -> Result<Lens, TextError> {
        read_file(text).map(|file| file.lens)
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
        let polynomials = message(r#"{"name": "fit", "polynomials": []}"#);
        assert!(polynomials.contains("ray-transfer") && polynomials.contains("--psfs"), "{polynomials}");
        assert!(ior("-1").err().unwrap().reason.contains("surfaces[0].ior is -1, expected an index above 0"));
    }

    #[test]
    fn conic_and_asphere_start_at_the_fourth_power() {
        let with = |keys: &str| read(&SINGLET.replace("\"radius\": 50", &format!("\"radius\": 50, {keys}")));
        let shape = |keys: &str| with(keys).ok().unwrap().interfaces()[0].surface.shape.clone();
        assert_eq!(shape("\"conic_constant\": -1"), Shape::Conic { conic: -1.0 });
        assert_eq!(shape("\"conic_constant\": []"), Shape::Sphere);
        let expected = Shape::EvenAsphere { conic: 0.0, coefficients: vec![1e-5] };
        assert_eq!(shape("\"aspheric_coefficients\": [1e-5, 0]"), expected);
        assert!(with("\"aspheric_coefficients\": [1e-5, \"x\"]").err().unwrap().reason.starts_with("surfaces[0].asph"));
    }

    #[test]
    fn what_is_not_supported_is_named() {
        let with = |key: &str| message(&SINGLET.replace("\"radius\": 50", &format!("\"radius\": 50, {key}")));
        assert_eq!(with("\"glass\": 1"), format!("surfaces[0].glass is not known; expected {SURFACE_KEYS}"));
        let expected = "expected four columns of three numbers: the x, y and z axes and the shift in mm";
        assert!(with("\"transform\": [1,0,0,0.5,0,1,0,0,0,0,1,0,0,0,0,1]").ends_with(expected));
        assert!(with("\"transform\": [1,0]").ends_with(expected));
        assert!(with("\"transform\": [[2,0,0],[0,1,0],[0,0,1],[0,0,0]]").ends_with("not those of a rotation"));
        let identity = "\"radius\": 50, \"transform\": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";
        assert!(read(&SINGLET.replace("\"radius\": 50", identity)).is_ok_and(|lens| lens.is_rotational()));
        assert!(with("\"conic_constant\": [1, 2], \"aspheric_coefficients\": [1e-6]").contains("two radii"));
        assert!(
            message(&SINGLET.replace("\"semi_aperture\": 4", "\"semi_aperture\": [4, 3]")).contains("elliptic rim")
        );
    }

    #[test]
    fn transform_and_two_radii_are_read() {
        let keys = "\"radius\": [40, 50], \"conic_constant\": [0.5, -1], \
                    \"transform\": [[1,0,0],[0,0.8,0.6],[0,-0.6,0.8],[0.1,0.2,0.3]]";
        let lens = read(&SINGLET.replace("\"radius\": 50", keys)).ok().unwrap();
        let shape = Shape::Biconic { conic: -1.0, curvature_x_per_mm: 0.025, conic_x: 0.5 };
        assert_eq!(
            (&lens.interfaces()[0].surface.shape, lens.interfaces()[0].surface.curvature_per_mm),
            (&shape, 0.02)
        );
        let placement = lens.placements()[0];
        assert_eq!(placement.vertex_mm, DVec3::new(0.1, 0.2, 0.3));
        assert!((placement.lens_from_surface(DVec3::Z) - DVec3::new(0.1, -0.4, 1.1)).length() < 1e-15);
        assert_eq!(lens.placements()[1], Placement::centered(3.0));
    }

    #[test]
    fn microlens_block_is_kept() {
        let with =
            |block: &str| read_file(&SINGLET.replace("{\"name\"", &format!("{{\"microlens\": {block}, \"name\"")));
        let block = r#"{"dimensions": [2, 1], "offsets": [[0, 0], [0.1, -0.1]],
            "surfaces": [{"radius": 0.02, "thickness": 0.02, "ior": 1.5, "semi_aperture": 0.01}]}"#;
        let file = with(block).ok().unwrap();
        let microlens = file.microlens.unwrap();
        assert_eq!((microlens.dimensions, microlens.offsets_mm), ([2, 1], vec![[0.0, 0.0], [0.1, -0.1]]));
        assert_eq!((microlens.lens.interfaces().len(), microlens.lens.stop()), (1, 0));
        assert_eq!(file.notes, ["the array of 2 × 1 microlenses is kept, but not traced"]);
        assert_eq!(with("[]").ok().unwrap().microlens, None);
        let stated = read_file(&SINGLET.replace("{\"name\"", "{\"units\": \"m\", \"name\"")).ok().unwrap();
        assert_eq!(stated.notes, ["units of the file is not known and left out"]);
        let message = |from: &str, to: &str| with(&block.replace(from, to)).err().unwrap().reason;
        assert!(message("[2, 1]", "[2.5, 1]").starts_with("microlens.dimensions is [2.5,1], expected whole numbers"));
        assert!(message("[2, 1]", "[2, 2]").contains("has 2 shifts, expected one each of the 2 × 2 microlenses"));
        assert!(message("\"radius\": 0.02", "\"radius\": \"x\"").starts_with("microlens.surfaces[0].radius is"));
    }

    #[test]
    fn mistakes_are_reported_by_their_key() {
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
