//! Units of length, as files state them and as names end in them.

/// Returns the metres of a unit of length.
pub(super) fn length_m(unit: &str) -> Option<f64> {
    Some(match unit.to_lowercase().as_str() {
        "m" | "meter" | "meters" | "metre" | "metres" => 1.0,
        "cm" | "centimeter" | "centimeters" | "centimetre" | "centimetres" => 1e-2,
        "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => 1e-3,
        "um" | "µm" | "micrometer" | "micrometers" | "micrometre" | "micrometres" => 1e-6,
        "km" | "kilometer" | "kilometers" | "kilometre" | "kilometres" => 1e3,
        "ft" | "foot" | "feet" => 0.3048,
        _ => return None,
    })
}

/// Returns the metres of the unit that the name of an array, a channel or a file of depth ends in, as `depth_mm` or `room.depth_meters`.
pub(super) fn length_in_name(name: &str) -> Option<f64> {
    let (before, unit) = name.rsplit_once(['_', '-', ' ', '.'])?;
    (!before.is_empty()).then(|| length_m(unit)).flatten()
}

/// Returns the metres of the one unit of length in words such as `depth in mm`; none of several.
pub(super) fn length_in_words(words: &str) -> Option<f64> {
    let mut found: Vec<f64> = words.split(|c: char| !c.is_alphanumeric()).filter_map(length_m).collect();
    found.dedup();
    Some(found).filter(|found| found.len() == 1).map(|found| found[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_state_units() {
        let of = |name: &str| length_in_name(name);
        assert_eq!([of("depth_mm"), of("a/z-cm"), of("room.depth_meters")], [Some(1e-3), Some(1e-2), Some(1.0)]);
        assert_eq!([length_in_words("depth [mm] of a film"), length_in_words("m or mm")], [Some(1e-3), None]);
        assert_eq!([of("mm"), of("_mm"), of("depthmm"), of("depth_map"), of("View.Depth.Z")], [None; 5]);
    }
}
