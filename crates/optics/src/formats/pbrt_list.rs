//! pbrt's lens lists: nothing but numbers, four a surface, in any number of lines.
//!
//! The four are `radius thickness eta aperture_diameter`, in mm and in the order that light meets the surfaces; a
//! radius of 0 marks the stop. Where each surface has a line of its own the file is a `.dat` file as well, and that
//! reader, which can name the line of a mistake, reads it.

use crate::{Interface, Lens, OpticsError, Surface};

use super::{glasses::constant, text_error::TextError};

/// Returns the numbers of a list whose lines are not rows of four, or `None` if the text is anything else.
pub(super) fn numbers_of(text: &str) -> Option<Vec<f64>> {
    let mut numbers = Vec::new();
    for line in text.lines() {
        let line = line.split('#').next().unwrap_or_default();
        let before = numbers.len();
        for word in line.split(|c: char| c.is_whitespace() || matches!(c, '[' | ']' | ',')).filter(|w| !w.is_empty()) {
            numbers.push(word.parse().ok()?);
        }
        if numbers.len() - before == 4 {
            return None;
        }
    }
    (!numbers.is_empty() && numbers.len() % 4 == 0).then_some(numbers)
}

/// Returns the lens of a list of numbers.
pub(super) fn lens_from_numbers(numbers: &[f64], name: &str) -> Result<Lens, TextError> {
    let mut interfaces: Vec<Interface> = Vec::new();
    let mut stops = Vec::new();
    for (surface, &[radius_mm, thickness_mm, index, diameter_mm]) in numbers.as_chunks::<4>().0.iter().enumerate() {
        let is_stop = radius_mm == 0.0;
        if is_stop {
            stops.push(surface);
        }
        let medium_after = match (is_stop && index == 0.0, interfaces.last()) {
            (true, Some(before)) => before.medium_after.clone(),
            (true, None) => constant(1.0),
            (false, _) => constant(index),
        };
        let curvature_per_mm = if is_stop { 0.0 } else { 1.0 / radius_mm };
        let surface = Surface { curvature_per_mm, ..Surface::plane(0.5 * diameter_mm) };
        interfaces.push(Interface { surface, medium_after, thickness_after_mm: thickness_mm });
    }
    let &[stop] = stops.as_slice() else {
        let error = OpticsError::Stops { n_stops: stops.len() };
        return Err(TextError { line: None, reason: format!("{error} (a radius of 0)") });
    };
    Ok(Lens::new(name, "a pbrt lens list", interfaces, stop)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn list_in_any_lines_is_read() {
        let text = "# singlet\n[ 67 1.5 1.65 25 0 1.5 0\n25 -67\n0 1 25 ]\n";
        let lens = lens_from_numbers(&numbers_of(text).unwrap(), "2el").ok().unwrap();
        assert_eq!((lens.stop(), lens.last_vertex_z_mm()), (1, 3.0));
        assert_eq!(lens.interfaces()[1].medium_after, constant(1.65));
    }

    #[test]
    fn rows_of_four_and_words_are_left_to_the_other_reader() {
        assert_eq!(numbers_of("50\n67 1.5 1.65 25\n"), None);
        assert_eq!(numbers_of("67 1.5 1.65 R25 0 0 1 25\n"), None);
        assert_eq!(numbers_of("67 1.5 1.65\n"), None);
        assert_eq!(numbers_of(""), None);
    }

    #[test]
    fn list_without_a_stop_is_refused() {
        let error = lens_from_numbers(&[67.0, 1.5, 1.65, 25.0, -67.0, 0.0, 1.0, 25.0], "").err().unwrap();
        assert!(error.reason.contains("0 surfaces are marked as the stop (a radius of 0)"), "{}", error.reason);
    }
}
