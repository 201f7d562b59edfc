//! One frame of more range: rows of two times, split pixels, and filters that are exposed for a share of the time.

#![expect(clippy::unwrap_used, reason = "a test fails by a panic")]

use approx::assert_relative_eq;
use dioptric_sensor::{
    Adc, Cfa, ElectronRate, Exposure, Filter, GainMode, Illumination, Interleaved, Levels, Noise, Raw, Sensor,
    SplitPixel,
};
use dioptric_spectrum::{Quantity, SpectralImage, WavelengthGrid};
use ndarray::{Array2, s};

const ROWS: Interleaved = Interleaved { ratio: 8.0, period_rows: 2, gain_ratio: 1.0 };

/// Returns a monochrome sensor without a fixed pattern.
fn even_sensor() -> Sensor {
    Sensor { prnu_fraction: 0.0, dsnu_v: 0.0, column_offset_v: 0.0, ..Sensor::built_in("machine-vision-mono").unwrap() }
}

fn flat(e_per_s: f32) -> ElectronRate {
    ElectronRate { planes_e_per_s: vec![Array2::from_elem((64, 64), e_per_s)] }
}

fn exposed(sensor: &Sensor, rate: &ElectronRate, exposure: &Exposure, noise: &Noise) -> Raw {
    let electrons = sensor.electrons(rate, exposure, noise).unwrap();
    sensor.digitize(&sensor.volts(&electrons, exposure, noise).unwrap(), exposure).unwrap()
}

fn interleaved(sensor: &Sensor, rate: &ElectronRate, exposure: &Exposure, noise: &Noise) -> Raw {
    let electrons = sensor.electrons_interleaved(rate, exposure, &ROWS, noise).unwrap();
    sensor.digitize(&sensor.volts(&electrons, exposure, noise).unwrap(), exposure).unwrap()
}

/// Returns the samples as rates, electrons a second.
fn rates(raw: &Raw) -> Array2<f64> {
    let scale = raw.levels.saturation_e() / raw.exposure.time_s;
    raw.linear()[0].mapv(|v| f64::from(v) * scale)
}

#[test]
fn rows_have_the_volts_of_their_time() {
    let sensor = even_sensor();
    let exposure = Exposure::seconds(0.01);
    let electrons = sensor.electrons_interleaved(&flat(4e5), &exposure, &ROWS, &Noise::none()).unwrap();
    let volts = sensor.volts(&electrons, &exposure, &Noise::none()).unwrap();
    for row in 0..64 {
        let time_s = if row % 4 < 2 { 0.01 } else { 0.01 / 8.0 };
        // A dark current of 1 electron a second.
        let expected_v = (4e5 + 1.0) * time_s * sensor.conversion_gain_v_per_e;
        assert_relative_eq!(f64::from(volts.planes_v[0][(row, 5)]), expected_v, max_relative = 1e-6);
    }
}

#[test]
fn an_even_field_keeps_its_mean_and_gains_range_by_the_ratio() {
    let sensor = even_sensor();
    let exposure = Exposure::seconds(0.01);
    let raw = interleaved(&sensor, &flat(4e5), &exposure, &Noise::all(1));
    let merged = sensor.merge_interleaved(&raw, &ROWS).unwrap();
    // 4000 electrons a long sample, half of 4096 pixels: 3.5e-4 of the mean, which the short samples hardly change.
    assert_relative_eq!(rates(&merged).mean().unwrap(), 4e5, max_relative = 1.5e-3);
    let top = |levels: &Levels, exposure: &Exposure| levels.saturation_e() / exposure.time_s;
    assert_relative_eq!(
        top(&merged.levels, &merged.exposure) / top(&raw.levels, &raw.exposure),
        8.0,
        max_relative = 1e-9
    );
    // In the dark the merged frame is no noisier than one of the long time.
    let dark = interleaved(&sensor, &flat(0.0), &exposure, &Noise::all(2));
    let long = exposed(&sensor, &flat(0.0), &exposure, &Noise::all(2));
    let merged = sensor.merge_interleaved(&dark, &ROWS).unwrap();
    let (merged_noise, long_noise) = (rates(&merged).std(0.0), rates(&long).std(0.0));
    assert!(merged_noise < long_noise, "{merged_noise} {long_noise}");
}

#[test]
fn a_lamp_twice_over_saturation_is_recovered() {
    let sensor = even_sensor();
    let exposure = Exposure::seconds(0.01);
    let lamp = 2.0 * sensor.saturation_e(&exposure) / exposure.time_s;
    let mut light = Array2::from_elem((64, 64), 1e5_f32);
    light.slice_mut(s![20..44, 20..44]).fill(lamp as f32);
    let rate = ElectronRate { planes_e_per_s: vec![light] };
    let raw = interleaved(&sensor, &rate, &exposure, &Noise::all(3));
    let merged = rates(&sensor.merge_interleaved(&raw, &ROWS).unwrap());
    // 2600 electrons a short sample, 20 rows and columns of them: .1 % of the mean.
    assert_relative_eq!(merged.slice(s![22..42, 22..42]).mean().unwrap(), lamp, max_relative = 4e-3);
    assert_relative_eq!(merged.slice(s![2..18, ..]).mean().unwrap(), 1e5, max_relative = 4e-3);
    // Every saturated long row means at least that much.
    assert!(merged.slice(s![20..44, 20..44]).iter().all(|&rate| rate > 0.47 * lamp));
}

#[test]
fn filters_are_interpolated_from_their_own_rows() {
    let mono = even_sensor();
    let filter = |name: &str| Filter { name: name.to_owned(), ..mono.filters[0].clone() };
    let sensor =
        Sensor { cfa: Cfa::two_by_two("RGGB").unwrap(), filters: ["R", "G", "B"].map(filter).to_vec(), ..mono.clone() };
    let exposure = Exposure::seconds(0.01);
    let at = |r: usize, c: usize| [[3e5_f32, 2e6], [2e6, 8e5]][r % 2][c % 2];
    let rate = ElectronRate { planes_e_per_s: vec![Array2::from_shape_fn((32, 32), |(r, c)| at(r, c))] };
    let raw = interleaved(&sensor, &rate, &exposure, &Noise::none());
    for ((r, c), found) in rates(&sensor.merge_interleaved(&raw, &ROWS).unwrap()).indexed_iter() {
        // Twelve bits: half a step of 2.6 electrons of 2500 short green ones, and of 375 red ones.
        assert_relative_eq!(*found, f64::from(at(r, c)), max_relative = 4e-3);
    }
    let odd = Interleaved { period_rows: 1, ..ROWS };
    let error = sensor.electrons_interleaved(&rate, &exposure, &odd, &Noise::none()).unwrap_err();
    assert!(error.to_string().contains("period_rows"), "{error}");
}

/// Rows of the whole and of a quarter of the gain, exposed alike: what saturates the converter in one has room in the other, and shadows keep the
/// fine steps of the high gain.
#[test]
fn rows_of_two_gains_reach_as_far_as_the_lower_one() {
    let sensor = Sensor { adc: Adc::Bits { bits: 8, black_level_dn: 16, step_v: None }, ..even_sensor() };
    let rows = Interleaved { ratio: 1.0, period_rows: 2, gain_ratio: 4.0 };
    let high = Exposure { analog_gain: 8.0, ..Exposure::seconds(0.01) };
    let low = rows.short(&high);
    assert_eq!((low.analog_gain, low.time_s), (2.0, high.time_s));
    let frame = |e_per_s: f64, noise: &Noise| {
        let electrons = sensor.electrons_interleaved(&flat(e_per_s as f32), &high, &rows, noise).unwrap();
        let volts = sensor.volts(&electrons, &high, noise).unwrap();
        sensor.digitize_interleaved(&volts, &high, &rows).unwrap()
    };
    // Each row has the code of a frame of its own gain.
    let dim = 0.2 * sensor.saturation_e(&high) / high.time_s;
    let raw = frame(dim, &Noise::none());
    let own = |exposure: &Exposure| exposed(&sensor, &flat(dim as f32), exposure, &Noise::none());
    for row in 0..64 {
        let expected = own(if row % 4 < 2 { &high } else { &low });
        assert_eq!(raw.dn().unwrap().row(row), expected.dn().unwrap().row(row), "row {row}");
    }
    // Three times what saturates the high gain comes back, to half a step of the converter.
    let bright = 3.0 * sensor.saturation_e(&high) / high.time_s;
    let merged = sensor.merge_interleaved(&frame(bright, &Noise::none()), &rows).unwrap();
    assert_relative_eq!(rates(&merged).mean().unwrap(), bright, max_relative = 4e-3);
    let reach = merged.levels.saturation_e() / sensor.saturation_e(&high);
    assert_relative_eq!(reach, sensor.saturation_e(&low) / sensor.saturation_e(&high), max_relative = 1e-9);
    assert!(reach > 3.5, "{reach}");
    // In the shadows a step of the low gain is as large as four of the high one; the merge is nearly as quiet as the high gain alone.
    let noise = |exposure: &Exposure| rates(&exposed(&sensor, &flat(dim as f32), exposure, &Noise::all(4))).std(0.0);
    let merged = rates(&sensor.merge_interleaved(&frame(dim, &Noise::all(4)), &rows).unwrap()).std(0.0);
    assert!(merged < noise(&high) && noise(&high) < noise(&low), "{merged} {} {}", noise(&high), noise(&low));
    let none = Interleaved { gain_ratio: 1.0, ..rows };
    let error = sensor.electrons_interleaved(&flat(1.0), &high, &none, &Noise::none()).unwrap_err().to_string();
    assert!(error.contains("gain_ratio"), "{error}");
}

fn split_sensor() -> Sensor {
    let split_pixel =
        Some(SplitPixel { area_ratio: 10.0, conversion_gain_v_per_e: 8.0e-5, full_well_e: 9000.0, read_noise_e: 3.0 });
    Sensor { split_pixel, ..even_sensor() }
}

#[test]
fn a_small_photodiode_collects_its_share_and_extends_the_range() {
    let sensor = split_sensor();
    let small = sensor.small_photodiode().unwrap();
    let exposure = Exposure::seconds(0.01);
    let merge = |e_per_s: f32, seed: u64| {
        let (rate, noise) = (flat(e_per_s), Noise::all(seed));
        let large = exposed(&sensor, &rate, &exposure, &noise);
        let low = exposed(&small, &sensor.small_rate(&rate).unwrap(), &exposure, &noise.of_small_photodiode());
        (sensor.merge_split(&[large], std::slice::from_ref(&low)).unwrap(), low)
    };
    let (dim, low) = merge(2e5, 1);
    // 200 electrons of 2000, by shot noise of 14 over 4096 pixels.
    assert_relative_eq!(rates(&low).mean().unwrap(), 2e4, max_relative = 5e-3);
    assert_relative_eq!(rates(&dim).mean().unwrap(), 2e5, max_relative = 1.5e-3);
    // Five times what saturates the large photodiode.
    let lamp = 5.0 * sensor.saturation_e(&exposure) / exposure.time_s;
    assert_relative_eq!(rates(&merge(lamp as f32, 2).0).mean().unwrap(), lamp, max_relative = 2e-3);
    let range = dim.levels.saturation_e() / sensor.saturation_e(&exposure);
    assert_relative_eq!(
        range,
        10.0 * small.saturation_e(&exposure) / sensor.saturation_e(&exposure),
        max_relative = 1e-9
    );
    assert!(even_sensor().merge_split(&[], &[]).unwrap_err().to_string().contains("split_pixel"));
}

#[test]
fn a_filter_exposed_for_a_quarter_of_the_time_collects_a_quarter() {
    let whole = even_sensor();
    let filter = Filter { exposure_fraction: 0.25, ..whole.filters[0].clone() };
    let part = Sensor { filters: vec![filter.clone()], ..whole.clone() };
    let grid = WavelengthGrid::uniform(500.0, 600.0, 10.0).unwrap();
    let planes = vec![Array2::from_elem((4, 4), 1e-4_f32); grid.len()];
    let image = SpectralImage::new(Quantity::Irradiance, grid, planes).unwrap();
    // Light and dark current alike.
    let exposure = Exposure { temperature_c: 90.0, ..Exposure::seconds(0.01) };
    let electrons = |sensor: &Sensor| {
        let rate = sensor.electron_rate(&Illumination::on_pixels(&image)).unwrap();
        f64::from(sensor.electrons(&rate, &exposure, &Noise::none()).unwrap().planes_e[0][(1, 1)])
    };
    assert_relative_eq!(electrons(&part) / electrons(&whole), 0.25, max_relative = 1e-6);
    let none = Sensor { filters: vec![Filter { exposure_fraction: 0.0, ..filter }], ..whole };
    assert!(none.check().unwrap_err().to_string().contains("exposure_fraction"));
}

/// Both reads see the same electrons: noise is that of the shot and of the better read, from the dark to the low gain's saturation, at no
/// level more than a read with the low gain alone; means hold, also where the high gain is full.
#[test]
fn both_gains_have_the_noise_of_one_and_the_range_of_the_other() {
    let sensor = Sensor { prnu_fraction: 0.0, dsnu_v: 0.0, ..Sensor::built_in("imx900").unwrap() };
    let exposure = Exposure::seconds(0.01);
    let rate = |e_per_s: f32| ElectronRate { planes_e_per_s: vec![Array2::from_elem((256, 256), e_per_s)] };
    let dark_e = sensor.dark_current.at(exposure.temperature_c) * exposure.time_s;
    // Rounding is part of either read's noise.
    let floor_e = |mode: GainMode| {
        let gain = sensor.conversion_gain_v_per_e(mode);
        (sensor.read_noise_v(mode) / gain).hypot(2.505e-5 / 12_f64.sqrt() / gain)
    };
    let both_e = (floor_e(GainMode::High).powi(-2) + floor_e(GainMode::Low).powi(-2)).sqrt().recip();
    for (electrons, expected_floor_e) in [(5.0, both_e), (300.0, both_e), (5000.0, floor_e(GainMode::Low))] {
        let noise = Noise::all(3);
        let taken = sensor.electrons(&rate(electrons as f32 / 0.01), &exposure, &noise).unwrap();
        let [high, low] = sensor.read_both_gains(&taken, &exposure, &noise).unwrap();
        let merged = sensor.merge_gains(&[[high.raw, low.raw]]).unwrap();
        let found_e = rates(&merged) * 0.01;
        let (mean_e, deviation_e) = (found_e.mean().unwrap(), found_e.std(1.0));
        let expected_e = (electrons + dark_e + expected_floor_e.powi(2)).sqrt();
        // 65,536 pixels: 0.28 % of the deviation at one standard error; the codes of the high read are 0.6 electrons apart.
        assert_relative_eq!(mean_e, electrons + dark_e, max_relative = 4e-3, epsilon = 0.05);
        assert_relative_eq!(deviation_e, expected_e, max_relative = 0.012);
    }
    // The high gain is full at 2,183 electrons, the low one at 9,458.
    let light = rate(3e6);
    let taken = sensor.electrons(&light, &exposure, &Noise::none()).unwrap();
    let [high, low] = sensor.read_both_gains(&taken, &exposure, &Noise::none()).unwrap();
    let merged = sensor.merge_gains(&[[high.raw.clone(), low.raw.clone()]]).unwrap();
    assert!(high.raw.saturated_fraction() > 0.99 && low.raw.saturated_fraction() > 0.99);
    assert_relative_eq!(merged.linear()[0][(0, 0)], 1.0, max_relative = 1e-3);
    let none = Sensor { high_gain: None, ..sensor };
    let message = none.read_both_gains(&taken, &exposure, &Noise::none()).unwrap_err().to_string();
    assert!(message.contains("needs high_gain"), "{message}");
}
