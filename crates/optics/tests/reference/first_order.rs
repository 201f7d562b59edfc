//! Cardinal points, pupils and conjugates.

use serde_json::Value;

use crate::reader::{NAMES, json, lens, number};

#[dioptric_golden::needs_shared]
#[test]
fn first_order_data_agree_to_twelve_digits() {
    for name in NAMES {
        let Some(file) = json(name) else { return };
        let lens = lens(&file);
        for row in file["paraxial"]["rows"].as_array().unwrap() {
            let wavelength_nm = number(&row["wavelength_nm"]);
            let stop_mm = number(&row["stop_diameter_paraxial"]);
            let mut interfaces = lens.interfaces().to_vec();
            interfaces[lens.stop()].surface.semi_aperture_mm = 0.5 * stop_mm;
            let lens = dioptric_optics::Lens::new(name, "", interfaces, lens.stop()).unwrap();
            let mono = lens.at(wavelength_nm).unwrap();
            let first = mono.first_order();
            let distance_mm = row["object_distance"].as_f64().unwrap_or(f64::INFINITY);
            let conjugate = mono.conjugate(distance_mm);
            let scale_mm = first.efl_mm.abs();
            let check = |key: &str, found: f64, scale: f64| {
                let Some(expected) = row.get(key).and_then(Value::as_f64) else {
                    assert_eq!(key, "magnification", "{name}: no {key}");
                    return;
                };
                let error = (found - expected).abs() / expected.abs().max(scale);
                assert!(error <= 1e-12, "{name} at {wavelength_nm} nm: {key} {found}, expected {expected} ({error:e})");
            };
            check("power", first.power_per_mm, 0.0);
            check("efl", first.efl_mm, 0.0);
            check("bfl", first.bfl_mm, 0.0);
            check("ffl", first.ffl_mm, 0.0);
            // A position near the vertex is known relative to the focal length.
            check("principal_object_from_S1", first.front_principal_mm, scale_mm);
            check("principal_image_from_Sk", first.rear_principal_mm, scale_mm);
            check("entrance_pupil_from_S1", first.entrance_pupil_z_mm, scale_mm);
            check("exit_pupil_from_Sk", first.exit_pupil_z_mm, scale_mm);
            check("entrance_pupil_diameter", first.entrance_pupil_diameter_mm, 0.0);
            check("exit_pupil_diameter", first.exit_pupil_diameter_mm, 0.0);
            check("fno_infinity", first.f_number, 0.0);
            check("image_from_Sk", conjugate.image_z_mm, 0.0);
            check("magnification", conjugate.magnification, 0.0);
            check("fno_working_paraxial", mono.working_f_number(distance_mm), 0.0);
            if distance_mm.is_finite() {
                let back_mm = mono.object_distance_mm_for(conjugate.image_z_mm).unwrap();
                assert!((back_mm - distance_mm).abs() <= 1e-11 * distance_mm, "{name}: {back_mm}");
            }
        }
    }
}

#[dioptric_golden::needs_shared]
#[test]
fn focus_shifts_with_wavelength_as_published() {
    for name in NAMES {
        let Some(file) = json(name) else { return };
        let (lens, shift) = (lens(&file), &file["chromatic_focal_shift"]);
        for (i, wavelength_nm) in crate::reader::numbers(&shift["wavelength_nm"]).into_iter().enumerate() {
            let first = lens.at(wavelength_nm).unwrap().first_order();
            let (bfl, efl) = (number(&shift["bfl_mm"][i]), number(&shift["efl_mm"][i]));
            assert!((first.bfl_mm - bfl).abs() <= 1e-12 * efl, "{name}: {} {bfl}", first.bfl_mm);
            assert!((first.efl_mm - efl).abs() <= 1e-12 * efl, "{name}: {} {efl}", first.efl_mm);
        }
    }
}
