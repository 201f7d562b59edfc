//! Third-order sums.

use dioptric_optics::{Lens, SeidelSettings, SeidelSums};

use crate::reader::{NAMES, json, lens, number, numbers};

fn list(sums: &SeidelSums) -> [f64; 7] {
    [sums.s1, sums.s2, sums.s3, sums.s4, sums.s5, sums.c1, sums.c2]
}

#[dioptric_golden::needs_shared]
#[test]
fn seidel_sums_agree_surface_by_surface() {
    for name in NAMES {
        let Some(file) = json(name) else { return };
        let (spec, expected) = (&file["lens"], &file["seidel"]);
        let wavelength_nm = number(&spec["primary_nm"]);
        // The aperture is stated as the diameter of the entrance pupil.
        let given = lens(&file);
        let first = given.at(wavelength_nm).unwrap().first_order();
        let mut interfaces = given.interfaces().to_vec();
        interfaces[given.stop()].surface.semi_aperture_mm *= number(&spec["epd_mm"]) / first.entrance_pupil_diameter_mm;
        let lens = Lens::new(name, "", interfaces, given.stop()).unwrap();
        let object_distance_mm = spec["object"]["distance"].as_f64().unwrap_or(f64::INFINITY);
        let max = number(&spec["fields"]["max"]);
        let chief_slope = match spec["fields"]["type"].as_str().unwrap() {
            "angle" => max.to_radians().tan(),
            _ => -max / (object_distance_mm + first.entrance_pupil_z_mm),
        };
        let colors = numbers(&expected["chromatic_pair_nm"]);
        let colors_nm = [colors[0], colors[1]];
        let settings = SeidelSettings { wavelength_nm, colors_nm, object_distance_mm, chief_slope };
        let found = lens.seidel(&settings).unwrap();

        let h = number(&expected["lagrange_H"]);
        assert!((found.lagrange_mm - h).abs() <= 1e-12 * h.abs(), "{name}: {} {h}", found.lagrange_mm);
        let largest = numbers(&expected["total"]).into_iter().map(f64::abs).fold(0.0, f64::max);
        let mut worst: f64 = 0.0;
        for (i, sums) in found.per_surface.iter().enumerate() {
            for (found, expected) in list(sums).into_iter().zip(numbers(&expected["per_surface"][i])) {
                worst = worst.max((found - expected).abs() / largest);
            }
        }
        for (found, expected) in list(&found.total).into_iter().zip(numbers(&expected["total"])) {
            worst = worst.max((found - expected).abs() / largest);
        }
        println!("{name}: {worst:e}");
        assert!(worst <= 1e-8, "{name}: {worst:e}");
    }
}
