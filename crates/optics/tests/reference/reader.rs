//! The reference lenses as lenses.
//!
//! The tests of `diffraction` read this file too, by its path. It cannot lie in `golden`, which every crate's tests use and
//! which therefore may use none: not even the lenses that this makes.

use std::fs;

use dioptric_optics::{Glass, Interface, Lens, Shape, Surface};
use serde_json::Value;

pub(crate) use dioptric_golden::REFERENCE_LENSES as NAMES;

/// Reads one JSON file of the reference, or says that the test is skipped.
pub(crate) fn json(name: &str) -> Option<Value> {
    let path = dioptric_golden::shared(&format!("reference/optics/{name}.json"))?;
    Some(serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap())
}

/// A number of a JSON file.
pub(crate) fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

/// Every number of a JSON list.
pub(crate) fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(number).collect()
}

/// Returns the glass of a surface.
pub(crate) fn glass(material: &Value) -> Glass {
    let coefficients = || numbers(&material["coefficients"]);
    match material["model"].as_str().unwrap() {
        "air" => Glass::Air,
        "cauchy_nd_vd" => Glass::cauchy_from_nd_vd(number(&material["nd"]), number(&material["vd"])).unwrap(),
        formula => {
            let formula = formula.strip_prefix("rii_formula").unwrap().parse().unwrap();
            Glass::Formula { formula, coefficients: coefficients(), range_nm: None }
        }
    }
}

/// Returns the lens of a reference file.
pub(crate) fn lens(file: &Value) -> Lens {
    let lens = &file["lens"];
    let rows = lens["surfaces"].as_array().unwrap();
    let stop = rows.iter().position(|row| row["stop"] == true).unwrap();
    let interface = |row: &Value| {
        let (conic, coefficients) = (number(&row["conic"]), numbers(&row["asph_a4_a6_etc"]));
        let shape = match (conic, coefficients.is_empty()) {
            (0.0, true) => Shape::Sphere,
            (_, true) => Shape::Conic { conic },
            _ => Shape::EvenAsphere { conic, coefficients },
        };
        let (curvature_per_mm, semi_aperture_mm) = (number(&row["curvature"]), number(&row["semi_diameter"]));
        Interface {
            surface: Surface { curvature_per_mm, shape, semi_aperture_mm },
            medium_after: glass(&row["material_after"]),
            thickness_after_mm: number(&row["thickness_after"]),
        }
    };
    let interfaces = rows.iter().map(interface).collect();
    Lens::new(lens["name"].as_str().unwrap(), lens["source"].as_str().unwrap(), interfaces, stop).unwrap()
}
