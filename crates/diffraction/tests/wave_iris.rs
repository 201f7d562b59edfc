//! Starbursts: the pattern of an iris against the Fourier transform of its polygon.
#![allow(clippy::unwrap_used, reason = "a test may fail")]

use std::f64::consts::{PI, TAU};

use dioptric_diffraction::{PupilSamples, WaveQuality, WaveWindow, WindowCenter, pupil_samples};
use dioptric_optics::{
    Aperture, Iris, Lens, MonoLens, ObjectPoint, Outline,
    glam::{DVec2, DVec3},
};

const FOCAL_MM: f64 = 500.0;
const WAVELENGTH_NM: f64 = 550.0;
/// λN of the circle of as much area, mm: f/100, where sines are tangents to 1.3e-5.
const UNIT_MM: f64 = WAVELENGTH_NM * 1e-6 * 100.0;
/// How far from the middle patterns are looked at, λN.
const REACH: f64 = 20.0;

/// A stop and the corners of its opening, in turn.
struct Stop {
    lens: MonoLens,
    corners_mm: Vec<DVec2>,
}

fn iris(blades: u32, rotation_deg: f64) -> Stop {
    let lens = Lens::thin(FOCAL_MM, 20.0).unwrap();
    let lens = lens.with_iris(Some(Iris { blades, rotation_deg, curvature: 0.0 })).unwrap();
    let lens = lens.with_stop_diameter_mm(5.0).unwrap();
    Stop { corners_mm: lens.iris_opening().unwrap().outline_mm(0), lens: lens.at(WAVELENGTH_NM).unwrap() }
}

fn slit() -> Stop {
    let (half_x_mm, half_y_mm) = (0.4, 2.4);
    let outline = Outline::Rectangle { half_x_mm, half_y_mm };
    let opening = Aperture { surface: 0, outline, center_mm: [0.0; 2], is_obscuration: false };
    let thin = Lens::thin(FOCAL_MM, 5.0).unwrap().interfaces().to_vec();
    let lens = Lens::new_with_apertures("slit", "test", thin, 0, vec![opening]).unwrap().at(WAVELENGTH_NM).unwrap();
    let corner = |x: f64, y: f64| DVec2::new(x * half_x_mm, y * half_y_mm);
    Stop { lens, corners_mm: vec![corner(1.0, 1.0), corner(-1.0, 1.0), corner(-1.0, -1.0), corner(1.0, -1.0)] }
}

impl Stop {
    fn nodes(&self) -> PupilSamples {
        let side = (2.0 * REACH * UNIT_MM * 1e3 / 100.0).ceil() as usize;
        let center = WindowCenter::At(DVec2::ZERO);
        let window = WaveWindow { pitch_um: 100.0, rows: side, columns: side, center };
        let far = ObjectPoint::Infinite(DVec3::Z);
        pupil_samples(&self.lens, &far, FOCAL_MM, &window, WaveQuality::default()).unwrap()
    }

    fn sides(&self) -> impl Iterator<Item = (DVec2, DVec2)> {
        self.corners_mm.iter().copied().zip(self.corners_mm.iter().copied().cycle().skip(1))
    }

    /// The irradiance, 1/mm², of unit energy at a place of the focal plane: |∫ exp(−i k·x) dA|² over the opening, as a sum over its sides
    /// (Gauss's theorem: `(i/k²) Σ (k·n) l exp(−i k·m) sinc(k·e/2)` with the outward normals n, lengths l, middles m and sides e).
    fn closed_form(&self, at_mm: DVec2) -> f64 {
        let area_mm2 = 0.5 * self.sides().map(|(a, b)| a.perp_dot(b)).sum::<f64>();
        let focal = WAVELENGTH_NM * 1e-6 * FOCAL_MM;
        let k = TAU / focal * at_mm;
        let amplitude = match k.length() < 1e-6 {
            true => DVec2::new(area_mm2, 0.0),
            false => self
                .sides()
                .map(|(a, b)| {
                    let (side, middle) = (b - a, 0.5 * (a + b));
                    let half = 0.5 * k.dot(side);
                    let sinc = if half.abs() < 1e-9 { 1.0 } else { half.sin() / half };
                    // The normal times the length is the side turned to the right.
                    DVec2::from_angle(-k.dot(middle)) * (-k.dot(side.perp()) * sinc / k.length_squared())
                })
                .sum(),
        };
        amplitude.length_squared() / (area_mm2 * focal * focal)
    }
}

/// Holds the sum to the closed form along a direction, to 2 % of the greatest value within λN about each place.
#[track_caller]
fn check_along(stop: &Stop, nodes: &PupilSamples, angle_rad: f64) {
    let at = |u: f64| DVec2::from_angle(angle_rad) * (u * UNIT_MM);
    for i in 0..150 {
        let u = REACH * f64::from(i) / 150.0;
        let (found, expected) = (nodes.irradiance_per_mm2(at(u)), stop.closed_form(at(u)));
        let about = (-10..=10).map(|k| stop.closed_form(at(u + 0.1 * f64::from(k)))).fold(0.0, f64::max);
        assert!((found - expected).abs() < 0.02 * about, "{u} λN at {angle_rad}: {found} {expected} {about}");
    }
}

/// Returns the directions of spikes, rad: those in which a ring is brighter than to both sides, four times as bright as mostly, and at
/// least a tenth as bright as anywhere.
fn spikes(nodes: &PupilSamples) -> Vec<f64> {
    const N: usize = 360;
    let angle = |i: usize| TAU * i as f64 / N as f64;
    let ring = |i: usize| -> f64 {
        let radii = (0..12).map(|k| REACH * (0.4 + 0.6 * (f64::from(k) + 0.5) / 12.0));
        radii.map(|u| u * nodes.irradiance_per_mm2(DVec2::from_angle(angle(i)) * (u * UNIT_MM))).sum()
    };
    let rings: Vec<f64> = (0..N).map(ring).collect();
    let mut sorted = rings.clone();
    sorted.sort_by(f64::total_cmp);
    let is_spike = |i: usize| {
        let around = (1..=6).flat_map(|k| [rings[(i + k) % N], rings[(i + N - k) % N]]);
        rings[i] > (4.0 * sorted[N / 2]).max(0.1 * sorted[N - 1]) && around.fold(0.0, f64::max) < rings[i]
    };
    (0..N).filter(|&i| is_spike(i)).map(angle).collect()
}

#[test]
fn a_hexagon_has_six_spikes_a_pentagon_ten_and_a_slit_two() {
    for (stop, n_spikes) in [(iris(6, 0.0), 6), (iris(5, 7.0), 10), (slit(), 2)] {
        let nodes = stop.nodes();
        let found = spikes(&nodes);
        assert_eq!(found.len(), n_spikes, "{found:?}");
        // Each lies across a side: of a slit the long ones.
        let longest = stop.sides().map(|(a, b)| a.distance(b)).fold(0.0, f64::max);
        let sides: Vec<DVec2> = stop.sides().map(|(a, b)| b - a).filter(|side| side.length() > 0.9 * longest).collect();
        for spike in found {
            let across = |side: &DVec2| DVec2::from_angle(spike).dot(side.normalize()).abs();
            let off = sides.iter().map(across).fold(1.0, f64::min);
            assert!(off < 2.0f64.to_radians(), "{spike}");
        }
    }
}

#[test]
fn the_pattern_is_the_transform_of_the_polygon_along_spikes_and_between() {
    for stop in [iris(6, 0.0), iris(5, 7.0), slit()] {
        let nodes = stop.nodes();
        let (a, b) = stop.sides().next().unwrap();
        let across = (b - a).perp().to_angle();
        for angle_rad in [across, across + 0.07, across + 0.3 + PI] {
            check_along(&stop, &nodes, angle_rad);
        }
        // In the middle it is the area over λ²f².
        let peak = nodes.irradiance_per_mm2(DVec2::ZERO) / stop.closed_form(DVec2::ZERO);
        assert!((peak - 1.0).abs() < 1e-4, "{peak}");
    }
}
