//! The built-in sensors: that each states its sources, and gives back what its data sheet says.

#![expect(clippy::unwrap_used, reason = "a test fails by a panic")]

use approx::{assert_abs_diff_eq, assert_relative_eq};
use dioptric_sensor::{Adc, ElectronRate, Exposure, FlatPoint, GainMode, Noise, RawPlane, Sensor};
use ndarray::Array2;

const SIDE: usize = 128;

/// Silicon's absorption at 300 K, 1/µm, every 50 nm from 400 nm: Green (2008), Sol. Energ. Mat. Sol. Cells 92, 1305.
const ABSORPTION_PER_UM: [(f64, f64); 15] = [
    (400.0, 9.30),
    (450.0, 2.41),
    (500.0, 1.11),
    (550.0, 0.639),
    (600.0, 0.417),
    (650.0, 0.279),
    (700.0, 0.189),
    (750.0, 0.129),
    (800.0, 0.0850),
    (850.0, 0.0534),
    (900.0, 0.0303),
    (950.0, 0.0155),
    (1000.0, 0.00640),
    (1050.0, 0.00163),
    (1100.0, 0.00035),
];
/// Silicon at the surface whose electrons are lost, µm.
const DEAD_UM: f64 = 0.044;

fn all() -> impl Iterator<Item = (&'static str, Sensor)> {
    Sensor::built_in_names().map(|name| (name, Sensor::built_in(name).unwrap()))
}

fn code_frame(sensor: &Sensor, rate_e_per_s: f64, exposure: &Exposure, number: u64) -> Array2<f32> {
    let planes = vec![Array2::from_elem((SIDE, SIDE), rate_e_per_s as f32); sensor.n_planes()];
    let noise = Noise::all(7).frame(number);
    let electrons = sensor.electrons(&ElectronRate { planes_e_per_s: planes }, exposure, &noise).unwrap();
    let volts = sensor.volts(&electrons, exposure, &noise).unwrap();
    match sensor.digitize(&volts, exposure).unwrap().planes.remove(0) {
        RawPlane::Dn(plane) => plane.mapv(f32::from),
        RawPlane::Volts(plane) | RawPlane::Evened(plane) => plane,
    }
}

#[test]
fn at_least_25_sensors_state_sources() {
    assert!(all().count() >= 25);
    for (name, sensor) in all() {
        // Words that a reader can look up, or that the numbers are nobody's.
        let words = [
            "data sheet",
            "handbook",
            "manual",
            "EMVA 1288",
            "arXiv",
            "report",
            "technical note",
            "press release",
            "page",
            "as collected in",
            "ISETCam",
            "Claff",
            "colour-science",
            "no particular camera",
            "By definition",
            "script",
        ];
        assert!(words.iter().any(|word| sensor.source.contains(word)), "{name}: {}", sensor.source);
    }
}

#[test]
fn every_sensor_transfers_photons_by_the_formula() {
    for (name, sensor) in all() {
        let sensor = sensor.with_size(SIDE, SIDE);
        for mode in [GainMode::Low, GainMode::High] {
            let exposure = Exposure { gain_mode: mode, ..Exposure::seconds(1e-3) };
            let gain = |v: f64| v / sensor.adc.step_v(sensor.swing_v).unwrap_or(1.0);
            let k = gain(sensor.conversion_gain_v_per_e(mode));
            let mean_e = 0.5 * sensor.saturation_e(&exposure);
            let frames = [0, 1].map(|number| code_frame(&sensor, mean_e / exposure.time_s, &exposure, number));
            let point = FlatPoint::measure(1.0, &frames[0], &frames[1]).unwrap();

            let dark_e = sensor.dark_current.at(exposure.temperature_c) * exposure.time_s;
            let black = match sensor.adc {
                Adc::Bits { black_level_dn, .. } => f64::from(black_level_dn),
                Adc::Analog => 0.0,
            };
            let rounding = if sensor.adc == Adc::Analog { 0.0 } else { 1.0 / 12.0 };
            let variance = k * k * (mean_e + dark_e) + gain(sensor.read_noise_v(mode)).powi(2) + rounding;
            // Two frames of 128² pixels: one standard error of the variance is 1.1 %, that of the mean, where the gain
            // of columns or pixels differs by a hundredth, .01 % (rows and columns apart: .1 %).
            assert_relative_eq!(point.mean_dn, black + k * (mean_e + dark_e), max_relative = 0.004);
            assert!(
                (point.variance_dn2 / variance - 1.0).abs() < 0.045,
                "{name}: {} of {variance}",
                point.variance_dn2
            );
        }
    }
}

#[test]
fn quantum_efficiencies_are_of_silicon() {
    for (name, sensor) in all().filter(|(name, _)| !name.starts_with("ideal")) {
        for (index, filter) in sensor.filters.iter().enumerate() {
            let peak = (300..=1100).map(|nm| sensor.quantum_efficiency(index, f64::from(nm))).fold(0.0, f64::max);
            // The D100's filters are stated relative to 1.
            assert!(peak > 0.2 && peak < 1.0, "{name}, {}: {peak}", filter.name);
            assert_eq!(sensor.quantum_efficiency(index, 1200.0), 0.0, "{name}: silicon is transparent there");
        }
    }
}

#[test]
fn schematic_curves_follow_silicon() {
    let sensors = [
        ("imx174", 6.0, 545.0, 0.70),
        ("imx250", 6.0, 550.0, 0.676),
        ("cmv4000", 6.0, 545.0, 0.62),
        ("python-5000", 6.0, 545.0, 0.55),
    ];
    for (name, depth_um, at_nm, quantum_efficiency) in sensors {
        let sensor = Sensor::built_in(name).unwrap();
        let collected = |per_um: f64| (-per_um * DEAD_UM).exp() * (1.0 - (-per_um * depth_um).exp());
        // Between 545 and 550 nm the model changes by .2 %.
        assert_abs_diff_eq!(sensor.quantum_efficiency(0, at_nm), quantum_efficiency, epsilon = 0.006);
        let scale = quantum_efficiency / collected(0.645);
        for (nm, per_um) in ABSORPTION_PER_UM {
            // Tables are rounded to .005, and the absorption here to three digits.
            let found = sensor.quantum_efficiency(0, nm);
            assert_abs_diff_eq!(found, scale * collected(per_um), epsilon = 0.006);
        }
    }
}

#[test]
fn a_published_curve_follows_silicon() {
    // What the schematic curves rest on: two numbers meet the ICX285's published curve, 2.4 µm deep.
    let sensor = Sensor::built_in("icx285").unwrap();
    let mean_square = ABSORPTION_PER_UM[..12]
        .iter()
        .map(|&(nm, per_um)| {
            let model = 0.758 * (-per_um * DEAD_UM).exp() * (1.0 - (-per_um * 2.4).exp());
            (sensor.quantum_efficiency(0, nm) - model).powi(2)
        })
        .sum::<f64>()
        / 12.0;
    assert!(mean_square.sqrt() < 0.009, "{}", mean_square.sqrt());
    // And 6 µm meet the two infrared points of the KAC-12040 from its point at 500 nm.
    let collected = |per_um: f64| (-per_um * DEAD_UM).exp() * (1.0 - (-per_um * 6.0_f64).exp());
    assert_abs_diff_eq!(0.53 * collected(0.0534) / collected(1.11), 0.15, epsilon = 0.005);
    assert_abs_diff_eq!(0.53 * collected(0.0303) / collected(1.11), 0.10, epsilon = 0.01);
}

#[test]
fn published_ranges_come_back() {
    // Dynamic range and largest signal-to-noise ratio, dB, as makers and laboratories publish them beside the numbers of
    // the data sheets. The range is saturation over dark noise; whole electrons of it leave 20 log₁₀((σ + ½)/σ) open
    // (7 e: .6 dB, 3 e: 1.3 dB, 2 e: 1.9 dB), whole decibels another .5.
    let of_well_and_noise = [
        ("imx174", 74.0, 1.1, 45.0),
        ("imx178", 73.0, 1.8, 42.0),
        ("imx183", 71.0, 2.4, 41.0),
        ("imx226", 70.0, 1.8, 40.0),
        ("cmv4000", 59.0, 1.0, 41.0),
        ("python-5000", 57.0, 1.0, 39.0),
        ("kac-12040", 73.0, 0.5, 42.04),
        ("cis115", 74.6, 0.1, 44.3),
    ];
    for (name, range_db, open_db, snr_db) in of_well_and_noise {
        let sensor = Sensor::built_in(name).unwrap();
        let well_e = sensor.full_well_e(GainMode::Low);
        let found_db = 20.0 * (well_e * sensor.conversion_gain_v_per_e / sensor.read_noise_v(GainMode::Low)).log10();
        assert!((found_db - range_db).abs() <= open_db, "{name}: {found_db} dB, published {range_db}");
        assert_abs_diff_eq!(10.0 * well_e.log10(), snr_db, epsilon = 0.6);
    }
    // EMVA 1288, release 3.1: saturation over the electrons of a ratio of 1, rounding of codes included. What the
    // reports measure in dark frames and what they derive from rounded numbers differ by up to .3 dB.
    for (mode, range_db, snr_db) in [(GainMode::Low, 63.8, 39.76), (GainMode::High, 59.0, 33.39)] {
        let sensor = Sensor::built_in("imx900").unwrap();
        let (well_e, conversion_v) = (sensor.full_well_e(mode), sensor.conversion_gain_v_per_e(mode));
        let noise_e2 = (sensor.read_noise_v(mode) / conversion_v).powi(2);
        let rounding_e2 = (sensor.adc.step_v(sensor.swing_v).unwrap() / conversion_v).powi(2) / 12.0;
        let threshold_e = 0.5 + (noise_e2 + rounding_e2 + 0.25).sqrt();
        assert_abs_diff_eq!(20.0 * (well_e / threshold_e).log10(), range_db, epsilon = 0.3);
        assert_abs_diff_eq!(10.0 * well_e.log10(), snr_db, epsilon = 0.05);
    }
}
