//! Seams: a uniform plane through seven lenses, wide open and at f/8, in focus and 2 dioptres off, by rays without diffraction, HURB and waves.
//! `cargo run --release --example seams -p dioptric-forward [LENS …]` prints a table: the largest second difference beyond the
//! curvature at eight pixels at 450, 550 or 650 nm, and without diffraction the largest difference from real rays, of a strip from corner to corner.

#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "an example shows its numbers, and stops where one is missing"
)]

use dioptric_psf::Diffraction;

#[path = "../tests/uniform/plane.rs"]
mod plane;

use plane::{Case, THREE_BANDS_NM, Uniform, WorstStep};

/// Lenses, the f-numbers of their stops wide open, closed a little for some, and at f/8, and half the diagonal that they light, mm.
const LENSES: [(&str, &[f64], f64); 7] = [
    ("paper-2el", &[2.08, 2.8, 4.0, 5.6, 8.0, 11.0, 16.0], 10.0),
    ("dgauss-50mm", &[2.03, 8.0], 11.3),
    ("cooke-50mm", &[4.93, 8.0], 11.3),
    ("canon-50mm", &[1.85, 8.0], 11.3),
    ("achromat-100mm", &[3.34, 4.0, 8.0], 5.0),
    ("tessar-50mm", &[3.47, 4.5, 8.0], 7.5),
    ("fisheye-12.5mm", &[2.75, 8.0], 7.0),
];

fn main() {
    let wanted: Vec<String> = std::env::args().skip(1).collect();
    println!("lens, f-number, plane, diffraction, second difference, illumination");
    for (lens, f_numbers, radius_mm) in LENSES {
        if !wanted.is_empty() && !wanted.iter().any(|name| name == lens) {
            continue;
        }
        for &f_number in f_numbers {
            for (plane, plane_mm) in [("in focus", 2000.0), ("2 dioptres off", 400.0)] {
                for diffraction in [Diffraction::None, Diffraction::Hurb { gamma: 1.0 }, Diffraction::Wave] {
                    let (columns, focus_mm) = (724, 2000.0);
                    let pitch_um = 2e3 * radius_mm / columns as f64;
                    let bands_nm = THREE_BANDS_NM;
                    let case = Case {
                        lens,
                        f_number,
                        focus_mm,
                        plane_mm,
                        columns,
                        pitch_um,
                        aside_mm: 0.0,
                        diffraction,
                        bands_nm,
                    };
                    let uniform = Uniform::new(&case);
                    let WorstStep { step, wavelength_nm, row, column } = uniform.worst_step();
                    let illumination = match diffraction {
                        Diffraction::None => {
                            let (error, radius_mm) = uniform.worst_illumination();
                            format!("{error:+.2e} at {radius_mm:.2} mm")
                        }
                        _ => String::new(),
                    };
                    println!(
                        "{lens}, {f_number}, {plane}, {diffraction:?}, {step:.1e} at {wavelength_nm} nm {row} {column}, {illumination}"
                    );
                }
            }
        }
    }
}
