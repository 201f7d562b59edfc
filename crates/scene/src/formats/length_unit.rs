//! Units of length, as files state them and as names end in them.

/// Returns the metres of a unit of length.
pub(super) fn length_m(unit: &str) -> Option<f64> {
    Some(match unit.to_lowercase().as_str() {
        "m" | "meter" | "meters" | "metre" | "metres" => 1.0,
        "cm" | "centimeter" | "centimeters" | "centimetre" | "centimetres" => 1e-2,
        "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => 1e-3,
        _ => return None,
    })
}

/// Returns the metres of the unit that the name of an array, a channel or a file of depth ends in, as `depth_mm` or `room.depth_meters`.
pub(super) fn length_in_name(name: &str) -> Option<f64> {
    let (before, unit) = name.rsplit_once(['_', '-', ' ', '.'])?;
    (!before.is_empty()).then(|| length_m(unit)).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_state_units() {
        let of = |name: &str| length_in_name(name);
        assert_eq!([of("depth_mm"), of("a/z-cm"), of("room.depth_meters")], [Some(1e-3), Some(1e-2), Some(1.0)]);
        assert_eq!([of("mm"), of("_mm"), of("depthmm"), of("depth_map"), of("View.Depth.Z")], [None; 5]);
    }
}
