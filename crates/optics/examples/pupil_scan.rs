//! Compares pupils with rays counted one by one, over all fields of lenses.
//!
//! `cargo run --release -p dioptric-optics --example pupil_scan -- [STEP_DEG] [RAYS_ACROSS] [LENS …]`: of each lens (built-in
//! names or files; without any, all that are built in) and each far field the cross-section of the light that gets through,
//! by the pupil's boundary and by a square grid of rays; at the end the largest differences.
#![expect(clippy::print_stdout, reason = "this is a command")]

use std::path::Path;

use dioptric_optics::{
    Lens, MonoLens, ObjectPoint, PupilBoundary,
    glam::{DVec2, DVec3},
};

#[path = "../tests/counted/mod.rs"]
mod counted;

use counted::cross_section_mm2;

const LAST_FIELD_DEG: f64 = 110.0;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let number = |place: usize, otherwise: f64| words.get(place).and_then(|w| w.parse().ok()).unwrap_or(otherwise);
    let (step_deg, n_across) = (number(0, 0.5), number(1, 1000.0) as usize);
    let mut names: Vec<String> = words.into_iter().skip(2).collect();
    if names.is_empty() {
        names = Lens::built_in_names().map(str::to_owned).collect();
    }
    for name in names {
        let lens = if Path::new(&name).exists() { Lens::read(Path::new(&name)) } else { Lens::built_in(&name) };
        match lens.and_then(|lens| lens.at(550.0)) {
            Ok(lens) => scan(&name, &lens, step_deg, n_across),
            Err(error) => println!("{name}: {error}"),
        }
    }
}

fn scan(name: &str, lens: &MonoLens, step_deg: f64, n_across: usize) {
    let name = Path::new(name).file_name().map_or(name, |n| n.to_str().unwrap_or(name));
    let (mut worst, mut most_parts, mut before): (_, usize, Option<[f64; 2]>) = ((0.0_f64, 0.0), 0, None);
    let mut worst_step = (0.0_f64, 0.0);
    let (mut axial, mut last_lit) = (0.0_f64, 0.0);
    for i in 0..=(LAST_FIELD_DEG / step_deg) as usize {
        let field_deg = i as f64 * step_deg;
        let point = ObjectPoint::far(field_deg.to_radians(), DVec2::new(0.28, 0.96));
        let parts = PupilBoundary::find_parts(lens, &point, 192);
        let cosine = |part: &PupilBoundary| point.direction_to(DVec3::ZERO).dot(part.plane().normal());
        let found: f64 = parts.iter().map(|part| part.area_mm2() * cosine(part)).sum();
        let counted = cross_section_mm2(lens, &point, n_across);
        axial = axial.max(counted);
        let difference = if counted == found { 0.0 } else { (found - counted) / counted.max(found) };
        most_parts = most_parts.max(parts.len());
        if counted > 0.0 {
            last_lit = field_deg;
        }
        if difference.abs() > worst.0 {
            worst = (difference.abs(), field_deg);
        }
        if let Some([found_before, counted_before]) = before {
            // By how much a step of what is found differs from that of the rays, over the light on the brighter side.
            let step =
                ((found - found_before) - (counted - counted_before)).abs() / counted.max(counted_before).max(1e-300);
            if step.is_finite() && step > worst_step.0 && counted > 1e-5 * axial {
                worst_step = (step, field_deg);
            }
        }
        if difference.abs() > 2e-3 || (parts.len() > 1 && counted > 0.0) {
            let areas: Vec<f64> = parts.iter().map(|part| part.area_mm2() * cosine(part) / found).collect();
            println!(
                "  {name} {field_deg}: found {found:.6e} counted {counted:.6e} mm2, {:+.2e}; parts {areas:.4?}",
                difference
            );
        }
        before = Some([found, counted]);
    }
    let (first, axial_mm2) = (lens.first_order(), cross_section_mm2(lens, &ObjectPoint::far(0.0, DVec2::Y), n_across));
    let counted_f_number = first.efl_mm.abs() / (2.0 * (axial_mm2 / std::f64::consts::PI).sqrt());
    println!(
        "{name}: f-number {:.6}, real {:?}, counted {counted_f_number:.6}; limited by {:?}, stop {}",
        first.f_number,
        lens.real_f_number(),
        lens.limiting_beam().map(|beam| beam.limiting_surface),
        lens.stop()
    );
    println!(
        "{name}: last light {last_lit} deg; largest difference {:.2e} at {} deg, of steps {:.2e} at {}; at most {most_parts} parts",
        worst.0, worst.1, worst_step.0, worst_step.1
    );
}
