//! Units of length, as files state them.

/// Returns the metres of a unit of length.
pub(super) fn length_m(unit: &str) -> Option<f64> {
    Some(match unit.to_lowercase().as_str() {
        "m" | "meter" | "meters" | "metre" | "metres" => 1.0,
        "dm" | "decimeter" | "decimeters" | "decimetre" | "decimetres" => 1e-1,
        "cm" | "centimeter" | "centimeters" | "centimetre" | "centimetres" => 1e-2,
        "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => 1e-3,
        "um" | "µm" | "micrometer" | "micrometers" | "micrometre" | "micrometres" => 1e-6,
        "km" | "kilometer" | "kilometers" | "kilometre" | "kilometres" => 1e3,
        "ft" | "foot" | "feet" => 0.3048,
        "inch" | "inches" => 0.0254,
        _ => return None,
    })
}
