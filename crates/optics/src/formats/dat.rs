//! The `.dat` lens files of `Scene3D`, ISET and pbrt: four numbers a surface.
//!
//! A row is `radius axpos N aperture`: the radius (0 marks the stop), the distance to the next surface, the index
//! behind the surface, and the clear diameter, all in mm. Lines that begin with `#` are comments; a line of one
//! number before the rows is the focal length, which is not needed. On the stop's row N = 0 means the medium before.

use crate::{Glass, Interface, Lens, OpticsError, Surface};

use super::text_error::TextError;

/// Reads a lens from the text of a `.dat` file; `name` serves where the file states none.
pub(crate) fn lens_from_dat(text: &str, name: &str) -> Result<Lens, TextError> {
    let mut name = name.to_owned();
    let mut interfaces: Vec<Interface> = Vec::new();
    let mut stops = Vec::new();
    for (number, line) in text.lines().enumerate().map(|(i, line)| (i + 1, line.trim())) {
        if let Some(stated) = line.trim_start_matches('#').trim().strip_prefix("Name:") {
            name = stated.trim().to_owned();
        }
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let wrong = |reason: String| TextError { line: Some(number), reason };
        let cells: Vec<&str> = line.split([' ', '\t', ',']).filter(|cell| !cell.is_empty()).collect();
        let values: Vec<f64> = match cells.iter().map(|cell| cell.parse()).collect() {
            Ok(values) => values,
            // A header line that names the columns.
            Err(_) if interfaces.is_empty() && line.to_lowercase().contains("radius") => continue,
            Err(_) => {
                let cell = cells.iter().find(|cell| cell.parse::<f64>().is_err()).copied().unwrap_or_default();
                return Err(wrong(format!("'{cell}' is not a number; expected radius, axpos, N and aperture")));
            }
        };
        let [radius_mm, thickness_mm, index, diameter_mm] = match values[..] {
            // The focal length.
            [_] if interfaces.is_empty() => continue,
            [a, b, c, d] => [a, b, c, d],
            _ => {
                let reason = format!("{} numbers in a row; expected 4: radius, axpos, N and aperture", values.len());
                return Err(wrong(reason));
            }
        };
        let is_stop = radius_mm == 0.0;
        let medium_before = interfaces.last().map_or(Glass::Air, |before| before.medium_after.clone());
        let medium_after = match index {
            0.0 if is_stop => medium_before,
            1.0 => Glass::Air,
            index => Glass::Constant { index },
        };
        if is_stop {
            stops.push(interfaces.len());
        }
        let curvature_per_mm = if is_stop { 0.0 } else { 1.0 / radius_mm };
        let surface = Surface { curvature_per_mm, ..Surface::plane(0.5 * diameter_mm) };
        let checked = || {
            surface.check(interfaces.len(), &[])?;
            medium_after.check()?;
            if thickness_mm.is_finite() {
                return Ok(());
            }
            let (surface, found) = (interfaces.len(), thickness_mm);
            Err(OpticsError::Surface { surface, key: "axpos", found, expected: "a finite number" })
        };
        checked().map_err(|error: OpticsError| wrong(error.to_string()))?;
        interfaces.push(Interface { surface, medium_after, thickness_after_mm: thickness_mm });
    }
    let &[stop] = stops.as_slice() else {
        let error = OpticsError::Stops { n_stops: stops.len() };
        return Err(TextError { line: None, reason: format!("{error} (a row of radius 0)") });
    };
    Ok(Lens::new(name, "a .dat file", interfaces, stop)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO_ELEMENT: &str = "# 2 Element simple lens\t\t\n50\n#    radius\t axpos\tN\taperture\n\
        67\t1.5\t1.65\t25\n0\t1.5\t1.65\t25\n-67\t0\t1\t25\n";

    #[track_caller]
    fn message(text: &str) -> String {
        let Err(error) = lens_from_dat(text, "test") else { panic!("should be refused") };
        format!("{}: {}", error.line.unwrap_or(0), error.reason)
    }

    #[test]
    fn stop_inside_the_glass_keeps_its_medium() {
        for text in [TWO_ELEMENT.to_owned(), TWO_ELEMENT.replace("0\t1.5\t1.65", "0\t1.5\t0")] {
            let Ok(lens) = lens_from_dat(&text, "2el") else { panic!("{text}") };
            assert_eq!((lens.name(), lens.stop(), lens.interfaces().len()), ("2el", 1, 3));
            assert_eq!(lens.interfaces()[1].medium_after, Glass::Constant { index: 1.65 });
            assert_eq!(lens.last_vertex_z_mm(), 3.0);
        }
    }

    #[test]
    fn header_line_and_name_of_scene3d_are_read() {
        let text =
            format!("# Name: doublet\nradius\taxpos\tN\taperture\n{}", &TWO_ELEMENT[TWO_ELEMENT.find("67").unwrap()..]);
        let Ok(lens) = lens_from_dat(&text, "file") else { panic!("{text}") };
        assert_eq!(lens.name(), "doublet");
    }

    #[test]
    fn none_or_two_stops_are_refused() {
        assert!(message(&TWO_ELEMENT.replace("\n0\t", "\n80\t")).contains("but 0 surfaces"));
        assert!(message(&TWO_ELEMENT.replace("\n-67\t", "\n0\t")).contains("but 2 surfaces"));
        assert!(message("").contains("but 0 surfaces"));
    }

    #[test]
    fn broken_rows_are_reported_by_their_line() {
        assert!(message(&TWO_ELEMENT.replace("67\t1.5\t1.65\t25\n0", "67\t1.5\t1.65\n0")).starts_with("4: 3 numbers"));
        assert!(message(&TWO_ELEMENT.replace("-67", "R67")).starts_with("6: 'R67' is not a number"));
        assert!(message(&TWO_ELEMENT.replace("-67", "NaN")).starts_with("6: surface 2: curvature is NaN"));
        assert!(message(&TWO_ELEMENT.replace("-67\t0\t1\t25", "-67\t0\t1\t-25")).starts_with("6: surface 2"));
        assert!(message(&TWO_ELEMENT.replace("-67\t0\t1\t25", "-67\tinf\t1\t25")).contains("axpos is inf"));
    }
}
