//! The glasses of the reference lenses.

use dioptric_optics::{C_LINE_NM, D_LINE_NM, F_LINE_NM};

use crate::reader::{NAMES, glass, json, number};

#[dioptric_golden::needs_shared]
#[test]
fn indices_agree_to_rounding() {
    for name in NAMES {
        let Some(file) = json(name) else { return };
        for row in file["lens"]["surfaces"].as_array().unwrap() {
            let material = &row["material_after"];
            let Some(indices) = material["n"].as_object() else { continue };
            for (nm, expected) in indices {
                // The keys are rounded to six digits; the lines meant are known to more.
                let wavelength_nm = match nm.as_str() {
                    "486.133" => F_LINE_NM,
                    "587.562" => D_LINE_NM,
                    "656.272" | "656.273" => C_LINE_NM,
                    other => other.parse().unwrap(),
                };
                let (found, expected) = (glass(material).index_at(wavelength_nm).unwrap(), number(expected));
                assert!((found - expected).abs() <= 1e-15, "{name}: {} at {nm}: {found}, {expected}", material["name"]);
            }
        }
    }
}
