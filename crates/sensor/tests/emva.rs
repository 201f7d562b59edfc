//! The EMVA 1288 test bench on a simulated sensor: what goes in comes out.

#![expect(clippy::unwrap_used, reason = "a test fails by a panic")]

use approx::assert_relative_eq;
use dioptric_sensor::{
    Adc, Bench, BenchSeries, BenchSettings, Binning, BinningKind, DarkCurrent, DarkCurrentEstimate, ElectronRate,
    Exposure, FlatPoint, FrameStack, Noise, NonUniformity, PhotonTransfer, RawPlane, Sensor,
};
use ndarray::Array2;

const SIDE: usize = 512;
const GAIN_V_PER_E: f64 = 60e-6;
const READ_NOISE_V: f64 = 0.5e-3;
const DARK_E_PER_S: f64 = 20.0;
const DSNU_E: f64 = 5.0;
const PRNU: f64 = 0.01;
const QUANTUM_EFFICIENCY: f64 = 0.6;

fn camera() -> Sensor {
    Sensor {
        conversion_gain_v_per_e: GAIN_V_PER_E,
        read_noise_v: READ_NOISE_V,
        dark_current: DarkCurrent { e_per_s: DARK_E_PER_S, at_c: 25.0, doubling_k: 7.0 },
        dsnu_v: DSNU_E * GAIN_V_PER_E,
        prnu_fraction: PRNU,
        full_well_e: 16_000.0,
        adc: Adc::Bits { bits: 12, black_level_dn: 100, step_v: None },
        ..Sensor::built_in("ideal-mono").unwrap()
    }
}

/// Returns a flat frame of mean photo-electrons and an exposure time.
fn frame(sensor: &Sensor, electrons: f64, time_s: f64, number: u64) -> Array2<f32> {
    let rate = ElectronRate { planes_e_per_s: vec![Array2::from_elem((SIDE, SIDE), (electrons / time_s) as f32)] };
    let (exposure, noise) = (Exposure::seconds(time_s), Noise::all(42).frame(number));
    let collected = sensor.electrons(&rate, &exposure, &noise).unwrap();
    let volts = sensor.volts(&collected, &exposure, &noise).unwrap();
    match sensor.digitize(&volts, &exposure).unwrap().planes.remove(0) {
        RawPlane::Dn(plane) => plane.mapv(f32::from),
        RawPlane::Volts(plane) | RawPlane::Evened(plane) => plane,
    }
}

fn point(sensor: &Sensor, electrons: f64, time_s: f64, number: u64) -> FlatPoint {
    let pair = [2 * number, 2 * number + 1].map(|n| frame(sensor, electrons, time_s, n));
    FlatPoint::measure(electrons / QUANTUM_EFFICIENCY, &pair[0], &pair[1]).unwrap()
}

#[test]
fn the_bench_finds_the_parameters_of_the_data_sheet() {
    let sensor = camera();
    let gain = GAIN_V_PER_E / sensor.adc.step_v(sensor.swing_v).unwrap();
    let time_s = 1e-3;
    let dark = point(&sensor, 0.0, time_s, 0);
    let points: Vec<FlatPoint> = (1..=40).map(|i| point(&sensor, 20_000.0 * i as f64 / 40.0, time_s, i)).collect();
    let transfer = PhotonTransfer::fit(dark, &points).unwrap();

    // The bars of the standard's users, several times the sampling error of 512² pixels.
    assert_relative_eq!(transfer.gain_dn_per_e, gain, max_relative = 0.01);
    assert_relative_eq!(transfer.quantum_efficiency, QUANTUM_EFFICIENCY, max_relative = 0.01);
    assert_relative_eq!(transfer.dark_noise_e, READ_NOISE_V / GAIN_V_PER_E, max_relative = 0.02);
    // The well is full between two of the forty levels.
    assert_relative_eq!(transfer.saturation_e, 16_000.0, max_relative = 0.05);

    let uniformity = {
        let stack = |electrons, first: u64| {
            let mut stack = FrameStack::default();
            (0..64_u64).for_each(|i| stack.add(&frame(&sensor, electrons, time_s, first + i)).unwrap());
            stack
        };
        NonUniformity::measure(&stack(0.0, 1000), &stack(8_000.0, 2000), transfer.gain_dn_per_e).unwrap()
    };
    assert_relative_eq!(uniformity.dsnu_e, DSNU_E, max_relative = 0.03);
    assert_relative_eq!(uniformity.prnu_fraction, PRNU, max_relative = 0.03);

    let times: Vec<(f64, FlatPoint)> =
        (0..6).map(|i| (1e-3 + 8.0 * i as f64, point(&sensor, 0.0, 1e-3 + 8.0 * i as f64, 3000 + i))).collect();
    let current = DarkCurrentEstimate::fit(&times, transfer.gain_dn_per_e);
    assert_relative_eq!(current.by_mean_e_per_s, DARK_E_PER_S, max_relative = 0.02);
    assert_relative_eq!(current.by_variance_e_per_s, DARK_E_PER_S, max_relative = 0.02);
}

#[test]
fn signal_to_noise_follows_the_model() {
    // The law itself, without what differs from pixel to pixel.
    let sensor = Sensor { prnu_fraction: 0.0, dsnu_v: 0.0, ..camera() };
    let gain = GAIN_V_PER_E / sensor.adc.step_v(sensor.swing_v).unwrap();
    let time_s = 1e-3;
    let dark = point(&sensor, 0.0, time_s, 0);
    for (number, electrons) in [10.0, 30.0, 100.0, 300.0, 1e3, 3e3, 1e4].into_iter().enumerate() {
        let bright = point(&sensor, electrons, time_s, 10 + number as u64);
        let snr = (bright.mean_dn - dark.mean_dn) / bright.variance_dn2.sqrt();
        let dark_e2 = (READ_NOISE_V / GAIN_V_PER_E).powi(2) + DARK_E_PER_S * time_s + 1.0 / 12.0 / gain.powi(2);
        assert_relative_eq!(snr, electrons / (electrons + dark_e2).sqrt(), max_relative = 0.01);
    }
}

#[test]
fn dark_current_doubles_with_its_step_of_temperature() {
    let sensor = Sensor { read_noise_v: 0.0, dsnu_v: 0.0, adc: Adc::Analog, ..camera() };
    let rate = ElectronRate { planes_e_per_s: vec![Array2::zeros((64, 64))] };
    let mean = |temperature_c: f64| {
        let exposure = Exposure { temperature_c, ..Exposure::seconds(100.0) };
        let electrons = sensor.electrons(&rate, &exposure, &Noise::all(1)).unwrap();
        f64::from(electrons.planes_e[0].mean().unwrap())
    };
    // 4096 pixels of 2000 electrons and more: a standard error of 0.035 %.
    for (temperature_c, expected) in [(25.0, 2000.0), (32.0, 4000.0), (39.0, 8000.0), (18.0, 1000.0)] {
        assert_relative_eq!(mean(temperature_c), expected, max_relative = 0.003);
    }
}

#[test]
fn figure_4_has_the_variance_of_its_read_noise() {
    let paper = Sensor::built_in("nikon-d100").unwrap();
    let rate = ElectronRate { planes_e_per_s: vec![Array2::from_elem((500, 500), 3_000_000.0)] };
    let exposure = Exposure::seconds(0.01);
    for read_noise_v in [0.0, 0.05] {
        let sensor = Sensor { read_noise_v, ..paper.clone() };
        let noise = Noise::all(3);
        let volts = sensor.volts(&sensor.electrons(&rate, &exposure, &noise).unwrap(), &exposure, &noise).unwrap();
        let values: Vec<f64> = volts.planes_v[0].iter().map(|&v| f64::from(v)).collect();
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
        // 30 000 electrons: shot noise, PRNU of 0.2218 % and read noise, in volts.
        let cg = 1.2778e-5_f64;
        let expected = cg * cg * 30_000.0 + (0.002_218 * cg * 30_000.0).powi(2) + read_noise_v.powi(2);
        assert_relative_eq!(mean, 30_000.0 * cg, max_relative = 0.001);
        // One standard error of a variance from 250 000 values is 0.28 %.
        assert_relative_eq!(variance, expected, max_relative = 0.012);
    }
}

#[test]
fn the_bench_finds_the_data_sheet_of_pixels_that_are_read_as_one() {
    for kind in [BinningKind::Charge, BinningKind::Voltage, BinningKind::Digital] {
        let exposure = Exposure { binning: Some(Binning { kind, pixels: 2 }), ..Exposure::seconds(1e-3) };
        let settings = BenchSettings { side: 256, n_levels: 20, n_stacked: 3, exposure, ..BenchSettings::default() };
        let bench = Bench::new(&camera(), settings, None).unwrap();
        let mut number = 0;
        let mut point = |series: &BenchSeries| {
            let [first, second] =
                [0, 1].map(|shot| bench.frame(series, number + shot).unwrap().planes[0].samples().into_owned());
            number += 2;
            FlatPoint::measure(series.photons, &first, &second).unwrap()
        };
        let series = bench.series();
        let dark = point(&series[0]);
        let points: Vec<FlatPoint> = series[1..=20].iter().map(point).collect();
        let transfer = PhotonTransfer::fit(dark, &points).unwrap();
        let sheet = bench.sheet();
        // A photon on the pixel as read, whatever it is read from.
        assert_relative_eq!(bench.quantum_efficiency(), 1.0, max_relative = 1e-4);
        let step_v = sheet.adc.step_v(sheet.swing_v).unwrap();
        assert_relative_eq!(transfer.gain_dn_per_e, sheet.conversion_gain_v_per_e / step_v, max_relative = 0.02);
        let read_e = READ_NOISE_V / GAIN_V_PER_E * if kind == BinningKind::Charge { 1.0 } else { 2.0 };
        assert_relative_eq!(transfer.dark_noise_e, read_e, max_relative = 0.03);
        // Levels are 5.5 % of saturation apart, and the last one that is whole is the one found.
        let ratio = transfer.saturation_e / sheet.saturation_e(&exposure);
        assert!((0.93..1.01).contains(&ratio), "{kind:?}: {ratio}");
    }
}
