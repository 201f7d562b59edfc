//! Measures slanted edges of known response at every rational slope, without noise and with it, and prints how far MTF50 is off.
//!
//! `cargo run --release -p dioptric-sensor --example edge_grid [STEP]` takes every STEP-th slope (1 where none is given).

#![expect(clippy::print_stdout, reason = "an example prints what it found")]

use dioptric_sensor::EdgeResponse;
use ndarray::Array2;

/// An edge: its profile from dark (0) to bright (1) by pixels, and the frequency at which half its response is left, cycles a pixel.
struct Edge {
    name: &'static str,
    profile: Box<dyn Fn(f64) -> f64>,
    mtf50: f64,
}

/// A profile in steps of a hundredth of a pixel to 400 pixels on both sides: ½ + ∫ m(f) sin(2π f d) / (π f) df.
fn tabled(mtf: impl Fn(f64) -> f64, cutoff: f64) -> impl Fn(f64) -> f64 {
    const REACH: f64 = 120.0;
    const PER_PX: f64 = 100.0;
    let n = 2000;
    let step = cutoff / f64::from(n);
    let terms: Vec<(f64, f64)> = (0..n)
        .map(|i| (f64::from(i) + 0.5) * step)
        .map(|f| (std::f64::consts::TAU * f, step * mtf(f) / (std::f64::consts::PI * f)))
        .collect();
    let at = |d: f64| 0.5 + terms.iter().map(|(w, term)| term * (w * d).sin()).sum::<f64>();
    let table: Vec<f64> = (0..=(REACH * PER_PX) as usize).map(|i| at(i as f64 / PER_PX)).collect();
    move |d: f64| {
        let place = (d.abs() * PER_PX).min((table.len() - 2) as f64);
        let below = place as usize;
        let value = table[below] + (table[below + 1] - table[below]) * place.fract();
        if d < 0.0 { 1.0 - value } else { value }
    }
}

fn edges() -> Vec<Edge> {
    let half = |mtf: &dyn Fn(f64) -> f64| (1..).map(|i| 1e-5 * f64::from(i)).find(|&f| mtf(f) < 0.5).unwrap_or(1.0);
    let gaussian = |name, sigma: f64| {
        let mtf = move |f: f64| (-2.0 * (std::f64::consts::PI * sigma * f).powi(2)).exp();
        Edge { name, mtf50: half(&mtf), profile: Box::new(tabled(mtf, 1.6 / sigma)) }
    };
    let diffraction = |name, cutoff: f64| {
        let mtf = move |f: f64| {
            let s = (f / cutoff).min(1.0);
            2.0 / std::f64::consts::PI * (s.acos() - s * (1.0 - s * s).sqrt())
        };
        Edge { name, mtf50: half(&mtf), profile: Box::new(tabled(mtf, cutoff)) }
    };
    // The area of a disc to the left of a chord; half its response is left where 2 J1(x) / x = ½.
    let pillbox = |name, radius: f64| {
        let profile = move |d: f64| {
            let x = (d / radius).clamp(-1.0, 1.0);
            0.5 + (x.asin() + x * (1.0 - x * x).sqrt()) / std::f64::consts::PI
        };
        Edge { name, mtf50: 2.215_089_3 / (std::f64::consts::TAU * radius), profile: Box::new(profile) }
    };
    vec![
        gaussian("Gaussian, σ 0.5", 0.5),
        gaussian("Gaussian, σ 0.8", 0.8),
        gaussian("Gaussian, σ 2", 2.0),
        pillbox("pillbox, radius 1", 1.0),
        pillbox("pillbox, radius 2.5", 2.5),
        diffraction("diffraction, cutoff 0.5", 0.5),
        diffraction("diffraction, cutoff 1.2", 1.2),
    ]
}

const DARK: f64 = 0.1;
const BRIGHT: f64 = 0.8;

/// Returns a square of pixels with an edge of this slope (rows a column), dark at its left.
fn picture(edge: &Edge, slope: f64, side: usize, (noise, seed): (f64, u64)) -> Array2<f32> {
    let (sin, cos) = (1.0 / slope).atan().sin_cos();
    let middle = 0.5 * side as f64;
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut uniform = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..8).for_each(|_| _ = uniform());
    Array2::from_shape_fn((side, side), |(row, column)| {
        let d = (column as f64 - middle + 0.37) * cos + (row as f64 - middle + 0.21) * sin;
        // Box and Muller's normal numbers.
        let radius = if noise > 0.0 { noise * (-2.0 * (1.0 - uniform()).ln()).sqrt() } else { 0.0 };
        let angle = if noise > 0.0 { std::f64::consts::TAU * uniform() } else { 0.0 };
        (DARK + (BRIGHT - DARK) * (edge.profile)(d) + radius * angle.cos()) as f32
    })
}

fn slopes() -> Vec<(u32, u32)> {
    fn divisor(a: u32, b: u32) -> u32 {
        if b == 0 { a } else { divisor(b, a % b) }
    }
    let (least, most) = (1.0 / 40.0_f64.to_radians().tan(), 1.0 / 2.0_f64.to_radians().tan());
    (1..=7)
        .flat_map(|q| (1..=210).map(move |p| (p, q)))
        .filter(|&(p, q)| divisor(p, q) == 1 && (least..=most).contains(&(f64::from(p) / f64::from(q))))
        .collect()
}

fn main() {
    let step = std::env::args().nth(1).and_then(|text| text.parse().ok()).unwrap_or(1);
    let (edges, slopes) = (edges(), slopes());
    println!("without noise: {} slopes p/q, q ≤ 7, every {step}; regions of 64 to 150 pixels", slopes.len());
    println!("{:<26} {:>8} {:>9} {:>10} {:>10}   at", "edge", "measured", "refused", "rms %", "largest %");
    for edge in &edges {
        let (mut n, mut refused, mut squares, mut largest) = (0, 0, 0.0, (0.0_f64, String::new()));
        for &(p, q) in slopes.iter().step_by(step) {
            for side in [64, 80, 100, 128, 150] {
                let region = picture(edge, f64::from(p) / f64::from(q), side, (0.0, 1));
                let Ok(response) = EdgeResponse::measure(&region.view()) else {
                    refused += 1;
                    continue;
                };
                let off = 100.0 * (response.mtf50().unwrap_or(0.0) / edge.mtf50 - 1.0);
                (n, squares) = (n + 1, squares + off * off);
                if off.abs() > largest.0 {
                    largest = (off.abs(), format!("{p}/{q}, {side} px, {off:+.3} %"));
                }
            }
        }
        let rms = (squares / f64::from(n.max(1))).sqrt();
        println!("{:<26} {n:>8} {refused:>9} {rms:>10.4} {:>10.4}   {}", edge.name, largest.0, largest.1);
    }
    println!("\nwith noise: 100 seeds; bias and scatter of MTF50 in %, and the standard error that is stated");
    println!(
        "{:<26} {:>6} {:>5} {:>5} {:>9} {:>8} {:>8} {:>8}",
        "edge", "slope", "side", "SNR", "refused", "bias", "σ", "stated"
    );
    for edge in edges.iter().filter(|edge| [1, 3, 5].contains(&index(&edges, edge))) {
        for (p, q) in [(7, 3), (4, 1), (23, 2)] {
            for side in [64, 120] {
                for snr in [10.0, 20.0, 40.0, 100.0] {
                    print_noisy(edge, (p, q), side, snr);
                }
            }
        }
    }
}

fn index(edges: &[Edge], edge: &Edge) -> usize {
    edges.iter().position(|other| other.name == edge.name).unwrap_or(0)
}

/// Prints what a hundred noisy pictures of an edge give; the signal-to-noise ratio is that of the bright side.
fn print_noisy(edge: &Edge, (p, q): (u32, u32), side: usize, snr: f64) {
    let noise = BRIGHT / snr;
    let measure = |seed| EdgeResponse::measure(&picture(edge, f64::from(p) / f64::from(q), side, (noise, seed)).view());
    let measured: Vec<EdgeResponse> = (1..=100).filter_map(|seed| measure(seed).ok()).collect();
    let n = measured.len() as f64;
    let off: Vec<f64> = measured.iter().map(|r| 100.0 * (r.mtf50().unwrap_or(0.0) / edge.mtf50 - 1.0)).collect();
    let stated = measured.iter().map(|r| 100.0 * r.mtf50_error().unwrap_or(0.0) / edge.mtf50).sum::<f64>() / n;
    let bias = off.iter().sum::<f64>() / n;
    let scatter = (off.iter().map(|v| (v - bias).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
    println!(
        "{:<26} {:>6} {side:>5} {snr:>5} {:>9} {bias:>+8.2} {scatter:>8.2} {stated:>8.2}",
        edge.name,
        format!("{p}/{q}"),
        100 - measured.len()
    );
}
