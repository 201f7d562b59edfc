//! Spot diagrams, ray for ray as the reference has them.

use dioptric_optics::{
    MonoLens, ObjectPoint, Vignetting,
    analysis::{PupilCoordinates, SpotDiagram, hexapolar},
    glam::{DVec2, DVec3},
};
use serde_json::Value;

use crate::reader::{NAMES, json, lens, number, numbers};

/// Returns the object point at a fraction of the largest field.
fn object_point(spec: &Value, fractions: &[f64]) -> ObjectPoint {
    let max = number(&spec["fields"]["max"]);
    match spec["fields"]["type"].as_str().unwrap() {
        "angle" => {
            let tangent = |fraction: f64| (fraction * max).to_radians().tan();
            ObjectPoint::Infinite(DVec3::new(tangent(fractions[0]), tangent(fractions[1]), 1.0).normalize())
        }
        _ => {
            let distance_mm = number(&spec["object"]["distance"]);
            ObjectPoint::Finite(DVec3::new(fractions[0] * max, fractions[1] * max, -distance_mm))
        }
    }
}

fn coordinates(spec: &Value) -> PupilCoordinates {
    match spec["pupil_mode"].as_str().unwrap() {
        "real_stop" => PupilCoordinates::Stop { radius_mm: number(&spec["stop_radius_real_axis"]) },
        _ => PupilCoordinates::Entrance {
            z_mm: number(&spec["entrance_pupil_z_primary"]),
            radius_mm: 0.5 * number(&spec["epd_mm"]),
        },
    }
}

/// Compares a spot with one part of a reference row and returns the largest relative error of its sizes.
fn compare(name: &str, spot: &SpotDiagram, expected: &Value) -> f64 {
    let Some(centroid_mm) = spot.centroid_mm() else { return 0.0 };
    let error_mm = centroid_mm.distance(DVec2::from_slice(&numbers(&expected["centroid"])));
    assert!(error_mm <= 1e-11, "{name}: {error_mm:e}");
    let sigma_mm = spot.sigma_mm().unwrap();
    let sizes = [
        ("rms_about_centroid", spot.rms_mm().unwrap()),
        ("rms_about_chief", spot.rms_about_chief_mm().unwrap()),
        ("geo_radius_about_chief", spot.radius_about_chief_mm().unwrap()),
        ("rms_x", sigma_mm.x),
        ("rms_y", sigma_mm.y),
    ];
    let error = |(key, found): (&str, f64)| (found / number(&expected[key]) - 1.0).abs();
    sizes.into_iter().map(error).fold(0.0, f64::max)
}

#[dioptric_golden::needs_shared]
#[test]
fn spots_agree_with_the_reference_to_nine_digits() {
    for name in NAMES {
        let Some(file) = json(name) else { return };
        let (spec, lens) = (&file["lens"], lens(&file));
        let film_distance_mm = number(&spec["image_z"]) - lens.last_vertex_z_mm();
        let (primary, places) = (lens.at(number(&spec["primary_nm"])).unwrap(), hexapolar(12));
        let (mut worst, mut n_compared) = (0.0_f64, 0);
        for row in file["spots"]["rows"].as_array().unwrap() {
            let mono: MonoLens = lens.at(number(&row["wavelength_nm"])).unwrap();
            let point = object_point(spec, &numbers(&row["field"]));
            // The reference aims at the stop with the rays of the main wavelength, for all of them.
            let spot = |places: &[DVec2], rims| {
                let mut rays = coordinates(spec).rays(&primary, &point, places);
                mono.trace(&mut rays, rims);
                mono.to_film(&mut rays, film_distance_mm);
                SpotDiagram::of(&rays, Some(DVec2::from_slice(&numbers(&row["chief_image"]))))
            };
            let chief = spot(&[DVec2::ZERO], Vignetting::Off);
            let error_mm = chief.points_mm[0].distance(chief.chief_mm.unwrap());
            assert!(error_mm <= 1e-11, "{name}: the chief ray is off by {error_mm:e}");
            worst = worst.max(compare(name, &spot(&places, Vignetting::Off), &row["all"]));
            // Where rays touch a rim to 1e-7 mm, as those aimed at the edge of the stop do, rounding decides.
            let rays = coordinates(spec).rays(&primary, &point, &places);
            let n_touching = mono.clearances_mm(rays).iter().filter(|c| c.abs() <= 1e-7).count();
            let (clipped, n_expected) =
                (spot(&places, Vignetting::On), row["unvignetted"]["n"].as_u64().unwrap() as usize);
            assert!(clipped.points_mm.len().abs_diff(n_expected) <= n_touching, "{name}: {n_expected}");
            if clipped.points_mm.len() == n_expected {
                worst = worst.max(compare(name, &clipped, &row["unvignetted"]));
                n_compared += 1;
            }
        }
        println!("{name}: {worst:e}, {n_compared} clipped spots");
        assert!(n_compared > 0, "{name}");
        assert!(worst <= 1e-9, "{name}: {worst:e}");
    }
}
