//! Rays, surface by surface.

use dioptric_optics::{Lens, MonoLens, RayBatch, RayFate, Vignetting, glam::DVec3};
use serde_json::Value;

use crate::reader::{NAMES, json, lens, number, numbers};

/// The largest differences of one lens's rays.
#[derive(Debug, Default)]
struct Worst {
    position_mm: f64,
    cosine: f64,
    opl_mm: f64,
}

fn start(row: &Value) -> RayBatch {
    let vector = |key: &str| DVec3::from_slice(&numbers(&row[key]));
    RayBatch::from_points(&[vector("start")], &[vector("dir")])
}

/// Follows one ray without rims, and returns the surface at which it failed.
fn follow(mono: &MonoLens, row: &Value, image_z_mm: f64, worst: &mut Worst) -> Option<usize> {
    let mut rays = start(row);
    let trace = row["trace"].as_array().unwrap();
    let mut compare = |rays: &RayBatch, expected: &Value| {
        let Some(expected) = expected.as_array().filter(|e| e.iter().all(Value::is_number)) else { return };
        let e: Vec<f64> = expected.iter().map(number).collect();
        let (p, d) = (rays.point_mm(0) - DVec3::from_slice(&e[..3]), rays.direction(0) - DVec3::from_slice(&e[3..6]));
        worst.position_mm = worst.position_mm.max(p.abs().max_element());
        worst.cosine = worst.cosine.max(d.abs().max_element());
        worst.opl_mm = worst.opl_mm.max((rays.opl_mm[0] - e[6]).abs());
    };
    for surface in 0..mono.n_surfaces() {
        mono.trace_surfaces(surface..surface + 1, &mut rays, Vignetting::Off);
        if !rays.fate[0].is_in_flight() {
            return rays.fate[0].surface();
        }
        compare(&rays, trace.get(surface).unwrap_or(&Value::Null));
    }
    mono.to_film(&mut rays, image_z_mm - mono.last_vertex_z_mm());
    compare(&rays, &trace[mono.n_surfaces()]);
    None
}

/// Returns what the reference says of a ray that rims may end.
fn expected_fate(row: &Value) -> RayFate {
    let surface = |key: &str| row[key].as_u64().map(|one_based| (one_based - 1) as u16);
    match (surface("vignetted_at"), surface("fail_surface")) {
        (Some(surface), None) => RayFate::Vignetted { surface },
        (Some(surface), Some(failed)) if surface < failed || row["status"] == "tir" && surface == failed => {
            RayFate::Vignetted { surface }
        }
        (_, Some(surface)) if row["status"] == "miss" => RayFate::Missed { surface },
        (_, Some(surface)) => RayFate::TotalReflection { surface },
        (None, None) => RayFate::InFlight,
    }
}

/// Whether the ray passes within 1e-7 mm of a rim, where rounding decides.
fn is_at_a_rim(lens: &Lens, row: &Value) -> bool {
    let trace = row["trace"].as_array().unwrap();
    lens.interfaces().iter().zip(trace).any(|(interface, state)| {
        let r_mm = number(&state[0]).hypot(number(&state[1]));
        (r_mm - interface.surface.semi_aperture_mm).abs() <= 1e-7
    })
}

#[dioptric_golden::needs_shared]
#[test]
fn rays_agree_with_fifty_digits_on_every_surface() {
    for name in NAMES {
        let (Some(file), Some(rays)) = (json(name), json(&format!("{name}.rays"))) else { return };
        let lens = lens(&file);
        let image_z_mm = number(&file["lens"]["image_z"]);
        let mut worst = Worst::default();
        for (i, row) in rays["rays"].as_array().unwrap().iter().enumerate() {
            let mono = lens.at(number(&row["wavelength_nm"])).unwrap();
            let failed = follow(&mono, row, image_z_mm, &mut worst);
            assert_eq!(failed, row["fail_surface"].as_u64().map(|s| s as usize - 1), "{name} ray {i}");
            if is_at_a_rim(&lens, row) {
                continue;
            }
            let mut clipped = start(row);
            mono.trace(&mut clipped, Vignetting::On);
            assert_eq!(clipped.fate[0], expected_fate(row), "{name} ray {i}");
        }
        println!("{name}: {worst:?}");
        assert!(worst.position_mm <= 1e-11, "{name}: {worst:?}");
        assert!(worst.cosine <= 1e-13, "{name}: {worst:?}");
        assert!(worst.opl_mm <= 1e-11, "{name}: {worst:?}");
    }
}
