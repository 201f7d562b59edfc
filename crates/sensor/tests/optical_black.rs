//! Pixels that no light reaches: what they hold, what is taken off by them, and what of them is in raw files.

#![expect(clippy::unwrap_used, reason = "a test fails by a panic")]

use approx::assert_relative_eq;
use dioptric_sensor::{
    Adc, Binning, BinningKind, BlackClamp, Cfa, DarkCurrent, DngBlack, DngDetails, DngFile, DngReading, ElectronRate,
    Exposure, Noise, NoiseSource, OpticalBlack, Raw, Response, Sensor, ndarray::Array2,
};
use dioptric_spectrum::Illuminant;

const READ_E: f64 = 8.0;
const DARK_E: f64 = 50.0;
const ROW_V: f64 = 1.2e-3;
const GAIN_V_PER_E: f64 = 60e-6;
/// A step of 4 electrons.
const STEP_V: f64 = 240e-6;

fn camera(rows: usize, columns: usize, clamp: BlackClamp) -> Sensor {
    Sensor {
        cfa: Cfa::two_by_two("RGGB").unwrap(),
        conversion_gain_v_per_e: GAIN_V_PER_E,
        read_noise_v: READ_E * GAIN_V_PER_E,
        read_noise_e: None,
        row_noise_v: ROW_V,
        prnu_fraction: 0.0,
        dsnu_v: 0.0,
        dark_current: DarkCurrent { e_per_s: 100.0 * DARK_E, at_c: 25.0, doubling_k: 7.0 },
        full_well_e: 10_000.0,
        swing_v: 0.9,
        adc: Adc::Bits { bits: 12, black_level_dn: 200, step_v: Some(STEP_V) },
        optical_black: Some(OpticalBlack { rows, columns, clamp }),
        ..Sensor::built_in("imx363").unwrap()
    }
    .with_size(256, 512)
}

fn frame(sensor: &Sensor, light_e: f64, noise: &Noise) -> Raw {
    let exposure = Exposure::seconds(0.01);
    let e_per_s = (light_e / exposure.time_s) as f32;
    let rate = ElectronRate { planes_e_per_s: vec![Array2::from_elem((sensor.rows, sensor.columns), e_per_s)] };
    let electrons = sensor.electrons(&rate, &exposure, noise).unwrap();
    sensor.digitize(&sensor.volts(&electrons, &exposure, noise).unwrap(), &exposure).unwrap()
}

fn electrons(raw: &Raw) -> Array2<f64> {
    raw.linear()[0].mapv(|x| f64::from(x) * raw.levels.saturation_e())
}

/// The standard deviation of the means of rows.
fn of_rows(electrons: &Array2<f64>) -> f64 {
    electrons.mean_axis(dioptric_sensor::ndarray::Axis(1)).unwrap().std(0.0)
}

#[test]
fn pixels_in_the_dark_hold_dark_current_and_the_noise_of_their_rows() {
    let sensor = camera(16, 32, BlackClamp::None);
    let raw = frame(&sensor, 1000.0, &Noise::all(4));
    let masked = raw.masked.as_ref().unwrap();
    assert_eq!((raw.size(), masked.planes[0].size()), ((256, 512), (272, 544)));
    let dark = masked.samples(0);
    assert_eq!(dark.len(), 272 * 544 - 256 * 512);
    let of_dn = |dn: f64| (dn - 200.0) * STEP_V / GAIN_V_PER_E;
    let mean = dark.iter().map(|dn| of_dn(f64::from(*dn))).sum::<f64>() / dark.len() as f64;
    let row_e = ROW_V / GAIN_V_PER_E;
    // Half of these pixels lie in 16 rows, whose noise is 20 electrons.
    assert!((mean - DARK_E).abs() < 4.0 * 0.5 * row_e / 4.0, "{mean}");
    let lit = electrons(&raw);
    assert!((lit.mean().unwrap() - 1000.0 - DARK_E).abs() < 4.0 * row_e / 16.0, "{}", lit.mean().unwrap());
    // The first columns of a row and its light have the same draw.
    let all = masked.planes[0].samples().mapv(|dn| of_dn(f64::from(dn)));
    let mean_of = |row: usize, from: usize, to: usize| {
        all.row(row).iter().skip(from).take(to - from).sum::<f64>() / (to - from) as f64
    };
    let both: f64 =
        (16..272).map(|row| (mean_of(row, 0, 32) - DARK_E) * (mean_of(row, 32, 544) - 1000.0 - DARK_E)).sum();
    // A covariance of 256 rows: a standard error of some 9 %.
    assert_relative_eq!(both / 256.0, row_e * row_e, max_relative = 0.35);
}

#[test]
fn a_clamp_takes_darkness_and_the_noise_of_rows_off() {
    let own_e = (READ_E * READ_E + DARK_E + 16.0 / 12.0).sqrt();
    let row_e = ROW_V / GAIN_V_PER_E;
    for (clamp, n_columns) in [(BlackClamp::Row, 32), (BlackClamp::Row, 8), (BlackClamp::Frame, 32)] {
        let sensor = camera(16, n_columns, clamp);
        let raw = frame(&sensor, 0.0, &Noise::all(4));
        assert!(raw.masked.is_none());
        let electrons = electrons(&raw);
        let mean = electrons.mean().unwrap();
        let expected_rows = match clamp {
            // The noise of the mean of the dark ones, of that of the light ones, and of the second rounding.
            BlackClamp::Row => own_e * (1.0 / n_columns as f64 + 1.0 / 512.0).sqrt(),
            _ => row_e,
        };
        assert!(mean.abs() < 5.0 * expected_rows / 16.0, "{clamp:?}: {mean}");
        // 256 rows: a standard error of 4.4 %.
        assert_relative_eq!(of_rows(&electrons), expected_rows, max_relative = 0.15);
    }
}

#[test]
fn what_is_full_is_full_after_a_clamp() {
    for clamp in [BlackClamp::None, BlackClamp::Row, BlackClamp::Frame] {
        let sensor = camera(16, 32, clamp);
        let raw = frame(&sensor, 50_000.0, &Noise::only(4, &[NoiseSource::Photon]));
        assert_eq!(raw.saturated_fraction(), 1.0, "{clamp:?}");
        // The well holds dark electrons too.
        let held_e = if clamp == BlackClamp::None { 10_000.0 } else { 10_000.0 - DARK_E };
        assert_relative_eq!(raw.levels.saturation_e(), held_e, max_relative = 1e-3);
    }
}

#[test]
fn light_is_that_of_the_sensor_without_them() {
    let sensor = camera(16, 32, BlackClamp::None);
    let bare = Sensor { optical_black: None, ..sensor.clone() };
    let [with, without] = [&sensor, &bare].map(|sensor| frame(sensor, 1000.0, &Noise::none()));
    assert_eq!(with.planes, without.planes);
}

#[test]
fn raw_files_hold_them_unless_they_were_used() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("raw.dng");
    let written = |sensor: &Sensor| {
        let raw = frame(sensor, 1000.0, &Noise::all(4));
        sensor.write_dng(&raw, &DngDetails::of_light(Illuminant::D65), &path).unwrap();
        raw
    };
    let by_masked = DngReading { black: DngBlack::Masked, ..DngReading::default() };
    for (rows, columns) in [(16, 32), (0, 32), (16, 0)] {
        let raw = written(&camera(rows, columns, BlackClamp::None));
        let file = DngFile::read(&path).unwrap();
        assert_eq!((file.raw.size(), &file.raw.planes, &file.raw.tile), (raw.size(), &raw.planes, &raw.tile));
        assert_eq!((file.stored, file.origin), ((512 + columns, 256 + rows), (columns, rows)));
        let masked = file.masked.unwrap();
        let dark = raw.masked.as_ref().unwrap().samples(0);
        let mean = dark.iter().map(|dn| f64::from(*dn)).sum::<f64>() / dark.len() as f64;
        assert_eq!(masked.n_pixels, dark.len());
        assert_relative_eq!(masked.above_black[0], mean - 200.0, max_relative = 1e-5);
        assert!(file.notes.iter().any(|note| note.contains("--black masked")), "{:?}", file.notes);
        let by_masked = DngFile::read_with(&path, &by_masked).unwrap();
        assert_relative_eq!(by_masked.raw.levels.black, mean, max_relative = 1e-5);
        assert!(by_masked.notes.is_empty(), "{:?}", by_masked.notes);
    }
    written(&camera(16, 32, BlackClamp::Row));
    let file = DngFile::read(&path).unwrap();
    assert_eq!((file.masked, file.stored, file.notes), (None, (512, 256), vec![]));
    let message = DngFile::read_with(&path, &by_masked).unwrap_err().to_string();
    assert!(message.contains("MaskedAreas"), "{message}");
}

#[test]
fn binned_frames_have_them_too() {
    for kind in [BinningKind::Charge, BinningKind::Voltage, BinningKind::Digital] {
        let exposure = Exposure { binning: Some(Binning { kind, pixels: 2 }), ..Exposure::seconds(0.01) };
        for clamp in [BlackClamp::None, BlackClamp::Row] {
            let sensor = camera(16, 32, clamp);
            let rate = ElectronRate { planes_e_per_s: vec![Array2::from_elem((256, 512), 1e5)] };
            let electrons_of = sensor.electrons(&rate, &exposure, &Noise::none()).unwrap();
            let volts = sensor.volts(&electrons_of, &exposure, &Noise::none()).unwrap();
            let raw = sensor.digitize(&volts, &exposure).unwrap();
            assert_eq!(raw.size(), (128, 256));
            let dark_e = if clamp == BlackClamp::None { 4.0 * DARK_E } else { 0.0 };
            let step_e = if kind == BinningKind::Charge { 4.0 } else { 16.0 };
            assert!(
                (electrons(&raw)[(9, 9)] - 4000.0 - dark_e).abs() <= step_e,
                "{kind:?} {}",
                electrons(&raw)[(9, 9)]
            );
            let lit = sensor.lit_volts(volts, &exposure).unwrap();
            let whole = kind == BinningKind::Digital;
            assert_eq!(lit.planes_v[0].dim(), if whole { (256, 512) } else { (128, 256) });
            assert_eq!(sensor.lit_electrons(electrons_of.clone()).planes_e[0].dim(), (256, 512));
        }
    }
    let sensor = camera(6, 32, BlackClamp::None);
    let exposure =
        Exposure { binning: Some(Binning { kind: BinningKind::Charge, pixels: 2 }), ..Exposure::seconds(0.01) };
    let message = sensor.as_read(&exposure).unwrap_err().to_string();
    assert!(message.contains("multiples of 4 rows"), "{message}");
}

#[test]
fn what_makes_no_sense_is_named() {
    let message = |sensor: Sensor| sensor.check().unwrap_err().to_string();
    assert!(message(camera(3, 32, BlackClamp::None)).contains("optical_black.rows"));
    assert!(message(camera(16, 8192, BlackClamp::None)).contains("4096"));
    assert!(message(camera(16, 0, BlackClamp::Row)).contains("columns"));
    assert!(message(camera(0, 0, BlackClamp::Frame)).contains("rows or columns"));
    let curved = Sensor { response: Response::Logarithmic { knee_v: 0.1 }, ..camera(16, 32, BlackClamp::Row) };
    assert!(message(curved).contains("linear"));
}
