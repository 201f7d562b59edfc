//! Pixels of one filter that are read as one: sums, signal-to-noise ratios by closed form, frames that are developed and written.

#![expect(clippy::unwrap_used, reason = "a test fails by a panic")]

use approx::assert_relative_eq;
use dioptric_sensor::{
    Adc, AutoExposure, Binning, BinningKind, Cfa, DarkCurrent, DngDetails, DngFile, ElectronRate, Exposure,
    ExposureControl, Metering, Noise, NoiseSource, Processing, Raw, ReadLines, Response, Sensor, SensorError,
    SplitPixel, ndarray::Array2,
};
use dioptric_spectrum::Illuminant;

const KINDS: [BinningKind; 3] = [BinningKind::Charge, BinningKind::Voltage, BinningKind::Digital];

/// A monochrome sensor of steps of four electrons: where 16 pixels share one its rounding counts.
fn camera() -> Sensor {
    Sensor {
        conversion_gain_v_per_e: 60e-6,
        read_noise_v: 0.6e-3,
        dark_current: DarkCurrent { e_per_s: 1000.0, at_c: 25.0, doubling_k: 7.0 },
        full_well_e: 16_000.0,
        swing_v: 1.0,
        adc: Adc::Bits { bits: 12, black_level_dn: 160, step_v: None },
        ..Sensor::built_in("ideal-mono").unwrap()
    }
    .with_size(512, 512)
}

fn binned(kind: BinningKind, pixels: usize) -> Exposure {
    Exposure { binning: Some(Binning { kind, pixels }), ..Exposure::seconds(0.01) }
}

fn frame_of(sensor: &Sensor, rate: Array2<f32>, exposure: &Exposure, noise: &Noise) -> Result<Raw, SensorError> {
    let rate = ElectronRate { planes_e_per_s: vec![rate] };
    let electrons = sensor.electrons(&rate, exposure, noise)?;
    sensor.digitize(&sensor.volts(&electrons, exposure, noise)?, exposure)
}

fn even(sensor: &Sensor, electrons: f64, exposure: &Exposure, noise: &Noise) -> Raw {
    let e_per_s = (electrons / exposure.time_s) as f32;
    frame_of(sensor, Array2::from_elem((sensor.rows, sensor.columns), e_per_s), exposure, noise).unwrap()
}

fn mosaic(rows: &[&str]) -> Cfa {
    Cfa::Mosaic(rows.iter().map(|row| row.chars().map(String::from).collect()).collect())
}

#[test]
fn signal_to_noise_ratios_are_those_of_the_closed_form() {
    let sensor = camera();
    let step_e = sensor.adc.step_v(sensor.swing_v).unwrap() / sensor.conversion_gain_v_per_e;
    let (read_e, dark_e) = (10.0, 10.0);
    for pixels in [2, 4] {
        let n = (pixels * pixels) as f64;
        for light_e in [20.0, 900.0 / n] {
            for kind in KINDS {
                let (reads, steps) = match kind {
                    BinningKind::Charge => (1.0, 1.0),
                    BinningKind::Voltage => (n, n * n),
                    BinningKind::Digital => (n, n),
                };
                let exposure = binned(kind, pixels);
                let raw = even(&sensor, light_e, &exposure, &Noise::all(3));
                assert_eq!(raw.size(), (512 / pixels, 512 / pixels));
                let electrons = raw.linear()[0].mapv(|x| f64::from(x) * raw.levels.saturation_e());
                let (mean, deviation) = (electrons.mean().unwrap(), electrons.std(0.0));
                let variance = n * (light_e + dark_e) + reads * read_e * read_e + steps * step_e * step_e / 12.0;
                // 16 384 or 65 536 pixels: a standard error of .55 % or .28 % of the deviation.
                assert_relative_eq!(mean, n * (light_e + dark_e), max_relative = 4.0 * variance.sqrt() / mean / 128.0);
                assert_relative_eq!(deviation, variance.sqrt(), max_relative = 0.02);
                // The data sheet of the frame says the same of darkness, with one rounding.
                let sheet = sensor.as_read(&exposure).unwrap();
                let gain = sheet.conversion_gain_v_per_e;
                assert_relative_eq!(sheet.read_noise_v / gain, reads.sqrt() * read_e, max_relative = 1e-12);
                assert_relative_eq!(sheet.dark_current.e_per_s, 1000.0 * n, max_relative = 1e-12);
            }
        }
    }
}

#[test]
fn sums_hold_pixels_of_one_filter_alone() {
    let filters = Sensor::built_in("imx363").unwrap();
    // The light of a pixel tells which it is: its filter, and its row and column.
    let check = |cfa: Cfa,
                 size: (usize, usize),
                 pixels: usize,
                 expected: &Cfa,
                 from: fn(usize, usize) -> Vec<(usize, usize)>| {
        let dark_current = DarkCurrent::default();
        let sensor = Sensor { cfa, adc: Adc::Analog, dark_current, ..filters.with_size(size.0, size.1) };
        let value = |row: usize, column: usize| (1 + row * size.1 + column) as f32;
        let exposure = Exposure { time_s: 1.0, ..binned(BinningKind::Charge, pixels) };
        let rate = Array2::from_shape_fn(size, |(row, column)| value(row, column));
        let raw = frame_of(&sensor, rate, &exposure, &Noise::none()).unwrap();
        assert_eq!(sensor.as_read(&exposure).unwrap().cfa, *expected);
        let electrons = raw.planes[0].samples().mapv(|v| f64::from(v) / raw.levels.volts_per_electron);
        let tile = sensor.tile().unwrap().unwrap();
        for ((row, column), found) in electrons.indexed_iter() {
            let pixels = from(row, column);
            let sum: f64 = pixels.iter().map(|&(r, c)| f64::from(value(r, c))).sum();
            assert_relative_eq!(*found, sum, max_relative = 1e-5);
            let filter = raw.tile.as_ref().unwrap().filter_at(row, column);
            assert!(pixels.iter().all(|&(r, c)| tile.filter_at(r, c) == filter), "{row} {column}");
        }
        raw.size()
    };
    let bayer = mosaic(&["RG", "GB"]);
    let of_bayer = |row: usize, column: usize| {
        let of = |i: usize| [i / 2 * 4 + i % 2, i / 2 * 4 + i % 2 + 2];
        of(row).into_iter().flat_map(|r| of(column).map(|c| (r, c))).collect::<Vec<_>>()
    };
    assert_eq!(check(bayer.clone(), (10, 17), 2, &bayer, of_bayer), (4, 8));
    let of_quad = |row: usize, column: usize| {
        [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(r, c)| (2 * row + r, 2 * column + c)).to_vec()
    };
    assert_eq!(check(bayer.repeated(2), (10, 17), 2, &bayer, of_quad), (5, 8));
    let of_nona = |row: usize, column: usize| (0..9).map(|i| (3 * row + i / 3, 3 * column + i % 3)).collect();
    assert_eq!(check(bayer.repeated(3), (12, 12), 3, &bayer, of_nona), (4, 4));
    let green = mosaic(&["G"]);
    assert_eq!(check(green.clone(), (5, 4), 2, &green, of_quad), (2, 2));
}

#[test]
fn wells_and_converters_saturate_where_they_do() {
    // 16 000 electrons of 60 µV are 0.96 V: one pixel is full before the converter's 1 V, four are not.
    let sensor = camera();
    let full = |kind| {
        let exposure = binned(kind, 2);
        let raw = even(&sensor, 40_000.0, &exposure, &Noise::none());
        assert!(raw.saturated_fraction() == 1.0, "{kind:?}");
        raw.levels.saturation_e()
    };
    let by_swing_e = sensor.adc.top_v(1.0) / 60e-6;
    assert_relative_eq!(full(BinningKind::Charge), by_swing_e, max_relative = 1e-9);
    assert_relative_eq!(full(BinningKind::Voltage), 64_000.0, max_relative = 1e-9);
    assert_relative_eq!(full(BinningKind::Digital), 64_000.0, max_relative = 1e-9);
    // A node of its own well ends sooner.
    let small = Sensor { binned_well_e: Some(9000.0), ..sensor.clone() };
    let raw = even(&small, 4000.0, &binned(BinningKind::Charge, 2), &Noise::none());
    assert_relative_eq!(raw.levels.saturation_e(), 9000.0, max_relative = 1e-9);
    assert!(raw.saturated_fraction() == 1.0);
    // A metered frame ends where it was asked to, whatever saturates it.
    let rate = ElectronRate { planes_e_per_s: vec![Array2::from_elem((512, 512), 1e5)] };
    let quiet = Sensor { dark_current: DarkCurrent::default(), ..sensor };
    for kind in KINDS {
        let auto = AutoExposure { limit: binned(kind, 2), ..AutoExposure::new(Metering::Mean, 0.5) };
        let limit = Exposure { time_s: 10.0, ..auto.limit };
        let exposure = quiet.expose(&rate, &ExposureControl::Auto(AutoExposure { limit, ..auto })).unwrap();
        let raw = frame_of(&quiet, rate.planes_e_per_s[0].clone(), &exposure, &Noise::none()).unwrap();
        // Half a step of the converter for each number.
        let half = if kind == BinningKind::Digital { 2.0 } else { 0.5 };
        let range = raw.levels.white - raw.levels.black;
        assert!((f64::from(raw.linear()[0][(3, 5)]) - 0.5).abs() <= 1.01 * half / range, "{kind:?}");
    }
}

#[test]
fn columns_and_rows_are_read_once_unless_numbers_are_summed() {
    let quiet = Sensor {
        column_offset_v: 4e-3,
        row_noise_v: 4e-3,
        read_noise_v: 0.0,
        dark_current: DarkCurrent::default(),
        adc: Adc::Bits { bits: 12, black_level_dn: 400, step_v: None },
        ..camera()
    };
    for (kind, factor) in
        [(BinningKind::Charge, 1.0), (BinningKind::Voltage, 1.0), (BinningKind::Digital, 8.0_f64.sqrt())]
    {
        let exposure = binned(kind, 2);
        for source in [NoiseSource::Column, NoiseSource::Row] {
            let raw = even(&quiet, 0.0, &exposure, &Noise::only(5, &[source]));
            let volts = raw.planes[0].samples().mapv(|dn| f64::from(dn) * raw.levels.step_v);
            // 256 columns or rows: a standard error of 4.4 %.
            assert_relative_eq!(volts.std(0.0), factor * 4e-3, max_relative = 0.15);
        }
        let sheet = quiet.as_read(&exposure).unwrap();
        assert_relative_eq!(sheet.column_offset_v, factor * 4e-3, max_relative = 1e-12);
        assert_relative_eq!(sheet.row_noise_v, factor * 4e-3, max_relative = 1e-12);
    }
}

#[test]
fn frames_are_developed_merged_and_written_as_of_larger_pixels() {
    let sensor = Sensor::built_in("imx363").unwrap().with_size(64, 96);
    let light = |row: usize, column: usize| 1e5 * (1.0 + 0.5 * ((row / 16 + column / 16) % 2) as f32);
    let rate = Array2::from_shape_fn((64, 96), |(row, column)| light(row, column));
    let processing = Processing { denoise: Some(0.0), ..Processing::for_light(Illuminant::D65) };
    let whole = frame_of(&sensor, rate.clone(), &Exposure::seconds(0.01), &Noise::none()).unwrap();
    let whole = sensor.develop(&whole, &processing).unwrap().picture;
    for kind in KINDS {
        // Charges of four pixels reach the end of the converter four times sooner.
        let time_s = if kind == BinningKind::Charge { 0.0025 } else { 0.01 };
        let exposure = Exposure { time_s, ..binned(kind, 2) };
        let raw = frame_of(&sensor, rate.clone(), &exposure, &Noise::none()).unwrap();
        let picture = sensor.develop(&raw, &processing).unwrap().picture;
        assert_eq!((picture.rows(), picture.columns()), (32, 48));
        // In the middle of the squares, where no other light is near.
        for (row, column) in [(4, 4), (4, 12), (12, 20), (20, 28)] {
            for channel in 0..3 {
                let (found, expected) =
                    (picture.codes[(row, column, channel)], whole.codes[(2 * row, 2 * column, channel)]);
                assert!((found - expected).abs() < 0.012, "{kind:?} {row} {column}: {found} {expected}");
            }
        }
        let merged = sensor.merge(&[raw.clone(), raw.clone()]).unwrap();
        let again = sensor.develop(&merged, &processing).unwrap().picture;
        assert!((again.codes[(4, 4, 1)] - picture.codes[(4, 4, 1)]).abs() < 0.004, "{kind:?}");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("binned.dng");
        sensor.write_dng(&raw, &DngDetails::of_light(Illuminant::D65), &path).unwrap();
        let file = DngFile::read(&path).unwrap();
        assert_eq!((file.raw.size(), &file.raw.tile, &file.raw.planes), ((32, 48), &raw.tile, &raw.planes));
        assert_eq!((file.raw.levels.black, file.raw.levels.white), (raw.levels.black, raw.levels.white.round()));
        // Pixels of 2.8 µm: 1e4 / 2.8 of them a centimeter, as a fraction of 10 000ths.
        let bytes = std::fs::read(&path).unwrap();
        let pitch = [35_714_286_u32.to_le_bytes(), 10_000_u32.to_le_bytes()].concat();
        assert!(bytes.windows(8).any(|window| window == pitch), "{kind:?}");
    }
}

#[test]
fn split_pixels_are_merged_as_read() {
    let split =
        SplitPixel { area_ratio: 8.0, conversion_gain_v_per_e: 15e-6, full_well_e: 20_000.0, read_noise_e: 6.0 };
    let sensor = Sensor { split_pixel: Some(split), dark_current: DarkCurrent::default(), ..camera() };
    let small = sensor.small_photodiode().unwrap();
    for kind in KINDS {
        let exposure = binned(kind, 2);
        // Beyond what the large ones hold, within what the small ones do.
        let large = even(&sensor, 30_000.0, &exposure, &Noise::none());
        let of_small = even(&small, 30_000.0 / 8.0, &exposure, &Noise::none());
        let merged = sensor.merge_split(&[large], &[of_small]).unwrap();
        let electrons = f64::from(merged.linear()[0][(7, 9)]) * merged.levels.saturation_e();
        assert_relative_eq!(electrons, 4.0 * 30_000.0, max_relative = 0.01);
    }
}

#[test]
fn rolling_shutters_expose_rows_together_that_are_read_as_one() {
    let sensor = Sensor { cfa: mosaic(&["RG", "GB"]), row_time_us: 10.0, ..Sensor::built_in("imx363").unwrap() };
    let rows = |kind| sensor.rows_exposed_as_one(&binned(kind, 2)).unwrap();
    let of_charge: Vec<usize> = (0..10).map(|row| rows(BinningKind::Charge).read_in(row)).collect();
    assert_eq!(of_charge, [0, 1, 0, 1, 2, 3, 2, 3, 4, 5]);
    assert_eq!(rows(BinningKind::Charge).count(10), 4);
    assert_eq!(rows(BinningKind::Digital), ReadLines::SINGLE);
    let row_time_us = |kind| sensor.as_read(&binned(kind, 2)).unwrap().row_time_us;
    assert_eq!(KINDS.map(row_time_us), [10.0, 10.0, 20.0]);
}

#[test]
fn what_cannot_be_read_as_one_is_named() {
    for (word, binning) in [
        ("none", None),
        ("Charge", Some(Binning { kind: BinningKind::Charge, pixels: 2 })),
        ("voltage:3", Some(Binning { kind: BinningKind::Voltage, pixels: 3 })),
        ("digital: 4", Some(Binning { kind: BinningKind::Digital, pixels: 4 })),
    ] {
        assert_eq!(Binning::parse(word).unwrap(), binning);
    }
    let text = |error: SensorError| error.to_string();
    for (word, part) in
        [("sum:2", "charge:2"), ("charge:two", "charge:2"), ("charge:1", "2 to 16"), ("charge:17", "2 to 16")]
    {
        let message = text(Binning::parse(word).unwrap_err());
        assert!(message.contains(part), "{message}");
    }
    let as_read = |sensor: &Sensor, kind, pixels| text(sensor.as_read(&binned(kind, pixels)).unwrap_err());
    let curved = Sensor { response: Response::Logarithmic { knee_v: 0.1 }, ..camera() };
    assert!(as_read(&curved, BinningKind::Digital, 2).contains("linear"));
    let analog = Sensor { adc: Adc::Analog, ..camera() };
    assert!(as_read(&analog, BinningKind::Digital, 2).contains("no converter"));
    assert!(as_read(&camera(), BinningKind::Digital, 9).contains("65535"));
    assert!(as_read(&camera().with_size(3, 9), BinningKind::Charge, 4).contains("4 × 4"));
    let negative = Sensor { binned_well_e: Some(-1.0), ..camera() };
    assert!(text(negative.check().unwrap_err()).contains("binned_well_e"));
}
