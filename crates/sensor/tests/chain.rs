//! The whole chain against numbers worked out by hand.

#![expect(clippy::unwrap_used, reason = "a test fails by a panic")]

use approx::assert_relative_eq;
use dioptric_sensor::{
    Adc, AutoExposure, Cfa, Exposure, ExposureControl, Filter, GainMode, HighGain, Illumination, Metering, Noise,
    NoiseSource, RawPlane, Sensor,
};
use dioptric_spectrum::{Quantity, SpectralImage, Spectrum, WavelengthGrid};
use ndarray::{Array2, array};

/// Returns one 10 nm band about 550 nm.
fn band(plane: Array2<f32>) -> SpectralImage {
    let grid = WavelengthGrid::uniform(550.0, 550.0, 10.0).unwrap();
    SpectralImage::new(Quantity::Irradiance, grid, vec![plane]).unwrap()
}

fn photon_counter() -> Sensor {
    Sensor::built_in("ideal-mono").unwrap()
}

#[test]
fn a_milliwatt_in_ten_nanometers_gives_3987_photons() {
    // 1e-3 W m⁻² nm⁻¹ × 10 nm × (4 µm)² × 0.9 × 10 ms × 550 nm / (h c).
    let sensor = Sensor { pixel_pitch_um: 4.0, fill_factor: 0.9, ..photon_counter() };
    let rate = sensor.electron_rate(&Illumination::on_pixels(&band(array![[1e-3]]))).unwrap();
    let electrons = sensor.electrons(&rate, &Exposure::seconds(0.01), &Noise::none()).unwrap();
    // The number is given to five digits.
    assert_relative_eq!(f64::from(electrons.planes_e[0][(0, 0)]), 3987.0, epsilon = 0.05);
}

/// The hand-computed mosaic: quantum efficiencies of 0.5, 0.25 and 0.125 behind R, G and B.
fn mosaic_sensor() -> Sensor {
    let filter = |name: &str, value: f64| Filter {
        name: name.to_owned(),
        quantum_efficiency: Spectrum::new(vec![400.0, 700.0], vec![value, value]).unwrap(),
        exposure_fraction: 1.0,
    };
    Sensor {
        cfa: Cfa::two_by_two("GRBG").unwrap(),
        filters: vec![filter("R", 0.5), filter("G", 0.25), filter("B", 0.125)],
        fill_factor: 0.9,
        conversion_gain_v_per_e: 1e-4,
        full_well_e: 12_000.0,
        swing_v: 1.0,
        offset_v: 0.01,
        adc: Adc::Bits { bits: 10, black_level_dn: 64, step_v: None },
        ..photon_counter()
    }
}

#[test]
fn a_chain_without_noise_gives_the_mosaic_worked_out_by_hand() {
    let sensor = mosaic_sensor();
    let light = Array2::from_shape_fn((4, 4), |(r, c)| 1e-3 * (1 + 4 * r + c) as f32);
    let exposure = Exposure { analog_gain: 2.0, ..Exposure::seconds(0.01) };
    let image = band(light);
    let control = ExposureControl::Manual(exposure);
    let capture = sensor.capture(&Illumination::on_pixels(&image), &control, &Noise::none()).unwrap();

    // Photons: (1 + 4 r + c) × 3986.9966, the number of the first test with its digits written out:
    // 1e-2 W m⁻² × 14.4e-12 m² × 0.01 s / (6.62607015e-34 × 299792458 / 550e-9 J).
    let photons_per_step = 1.44e-15 * 550e-9 / (6.626_070_15e-34 * 299_792_458.0);
    let efficiencies =
        [[0.25, 0.5, 0.25, 0.5], [0.125, 0.25, 0.125, 0.25], [0.25, 0.5, 0.25, 0.5], [0.125, 0.25, 0.125, 0.25]];
    let raw = capture.raw.dn().unwrap();
    for (row, efficiencies) in efficiencies.iter().enumerate() {
        for (column, efficiency) in efficiencies.iter().enumerate() {
            let step = (1 + 4 * row + column) as f64;
            let electrons = (step * photons_per_step * efficiency).min(12_000.0);
            let volts = electrons * 1e-4;
            let out = ((volts + 0.01) * 2.0).min(1.0);
            let dn = (out / (1.0 / 960.0) + 64.0 + 0.5).floor().min(1023.0);
            let at = (row, column);
            // Single precision has 24 bits; four operations lose two of them.
            let close = |got: f32, want: f64| assert_relative_eq!(f64::from(got), want, max_relative = 2.5e-7);
            close(capture.electrons.planes_e[0][at], electrons);
            close(capture.volts.planes_v[0][at], volts);
            assert_eq!(f64::from(raw[at]), dn, "row {row}, column {column}");
        }
    }
    // Spelt out: G 3987 × .25 = 996.75 e, (0.0997 + 0.01) × 2 = 0.2193 V, 210.6 + 64 = 274.6 → 275.
    assert_eq!([raw[(0, 0)], raw[(1, 0)], raw[(0, 3)]], [275, 562, 1023]);
}

#[test]
fn codes_stay_below_two_to_the_bits() {
    for (bits, top) in [(1, 1_u16), (8, 255), (10, 1023), (12, 4095), (16, 65535)] {
        let sensor = Sensor {
            adc: Adc::Bits { bits, black_level_dn: 0, step_v: None },
            read_noise_v: 0.05,
            full_well_e: 1e9,
            ..photon_counter()
        };
        let image = band(Array2::from_elem((8, 8), 1e6));
        let control = ExposureControl::Manual(Exposure { analog_gain: 8.0, ..Exposure::seconds(1.0) });
        let capture = sensor.capture(&Illumination::on_pixels(&image), &control, &Noise::all(1)).unwrap();
        assert!(capture.raw.dn().unwrap().iter().all(|&dn| dn == top), "{bits} bits");
        assert_eq!(capture.raw.saturated_fraction(), 1.0);
    }
}

#[test]
fn one_thread_and_two_give_the_same_bits() {
    let image = {
        let grid = WavelengthGrid::uniform(400.0, 700.0, 20.0).unwrap();
        let plane = |b: usize| Array2::from_shape_fn((97, 131), |(r, c)| 1e-4 * (1 + (r * c + b) % 17) as f32);
        let planes = (0..grid.len()).map(plane).collect();
        SpectralImage::new(Quantity::Irradiance, grid, planes).unwrap()
    };
    let sensor = Sensor {
        column_gain_fraction: 0.01,
        row_noise_v: 1e-4,
        reset_noise_v: 1e-4,
        correlated_double_sampling: false,
        blooming_fraction: 0.5,
        defects: dioptric_sensor::Defects { hot_fraction: 0.01, hot_e_per_s: 1e4, dead_fraction: 0.01 },
        telegraph: dioptric_sensor::TelegraphNoise { fraction: 0.1, mean_amplitude_e: 5.0 },
        ..Sensor::built_in("imx363").unwrap()
    };
    let control = ExposureControl::Auto(AutoExposure::new(Metering::Mean, 0.6));
    let processing = dioptric_sensor::Processing::for_light(dioptric_spectrum::Illuminant::D65);
    let run = |n_threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        pool.install(|| {
            let capture = sensor.capture(&Illumination::on_pixels(&image), &control, &Noise::all(5)).unwrap();
            let developed = sensor.develop(&capture.raw, &processing).unwrap();
            (capture, developed)
        })
    };
    assert!(run(1) == run(2));
}

#[test]
fn switching_one_noise_off_leaves_the_others_as_they_were() {
    let sensor = Sensor { dsnu_v: 1e-3, read_noise_v: 1e-3, ..photon_counter() };
    let image = band(Array2::from_elem((16, 16), 1e-3));
    let control = ExposureControl::Manual(Exposure::seconds(0.01));
    let volts = |noise: Noise| {
        sensor.capture(&Illumination::on_pixels(&image), &control, &noise).unwrap().volts.planes_v.remove(0)
    };
    let none = volts(Noise::none());
    let (dsnu, read) = (Noise::only(0, &[NoiseSource::Dsnu]), Noise::only(3, &[NoiseSource::Read]));
    let both = volts(Noise::only(3, &[NoiseSource::Dsnu, NoiseSource::Read]));
    let sum = &(&volts(dsnu) - &none) + &(&volts(read) - &none);
    for (a, b) in (&both - &none).iter().zip(&sum) {
        // Differences of voltages near 0.4 V in single precision.
        assert!((a - b).abs() < 2e-7, "{a} and {b}");
    }
    assert_ne!(volts(read), volts(read.frame(1)));
    assert_eq!(volts(dsnu), volts(dsnu.frame(1)));
    assert_ne!(volts(dsnu), volts(Noise { fixed_pattern_seed: 9, ..dsnu }));
}

#[test]
fn samples_of_another_pitch_are_averaged_over_the_pixels() {
    let sensor = photon_counter().with_size(2, 2);
    let fine = band(Array2::from_shape_fn((4, 4), |(r, c)| 1e-3 * (1 + 4 * r + c) as f32));
    let coarse = band(array![[3.5e-3, 5.5e-3], [11.5e-3, 13.5e-3]]);
    let rate = |light: Illumination<'_>| sensor.electron_rate(&light).unwrap().planes_e_per_s.remove(0);
    let (averaged, direct) = (rate(Illumination::with_pitch_um(&fine, 2.0)), rate(Illumination::on_pixels(&coarse)));
    for (a, d) in averaged.iter().zip(&direct) {
        assert_relative_eq!(*a, *d, max_relative = 1e-6);
    }
}

#[test]
fn exposures_are_metered() {
    let sensor = photon_counter();
    // 100 pixels of which one is ten times brighter.
    let mut plane = Array2::from_elem((10, 10), 1e-3);
    plane[(4, 5)] = 1e-2;
    let image = band(plane);
    let rate = sensor.electron_rate(&Illumination::on_pixels(&image)).unwrap();
    let check = |metering, max_time_s, expected_e: f64| {
        let auto = AutoExposure { limit: Exposure::seconds(max_time_s), ..AutoExposure::new(metering, 0.5) };
        let exposure = sensor.expose(&rate, &ExposureControl::Auto(auto)).unwrap();
        let at_dim = f64::from(rate.planes_e_per_s[0][(0, 0)]) * exposure.time_s;
        assert_relative_eq!(at_dim, expected_e, max_relative = 1e-5);
    };
    check(Metering::Percentile(50.0), f64::INFINITY, 50_000.0);
    check(Metering::Peak, f64::INFINITY, 5_000.0);
    check(Metering::Mean, f64::INFINITY, 50_000.0 / 1.09);
    check(Metering::Peak, 1e-3, 443.0 * (3986.9966 / 0.9 / 4430.0));
    for wrong in [f64::NAN, -1.0, 100.1] {
        let metering = Metering::Percentile(wrong);
        for message in [
            rate.metered(metering).unwrap_err().to_string(),
            ExposureControl::Auto(AutoExposure::new(metering, 0.5)).check().unwrap_err().to_string(),
        ] {
            assert!(message.contains("Percentile") && message.contains("0 to 100"), "{message}");
        }
    }
    let dark = sensor.electron_rate(&Illumination::on_pixels(&band(Array2::zeros((4, 4))))).unwrap();
    let auto = ExposureControl::Auto(AutoExposure::new(Metering::Mean, 0.5));
    assert!(sensor.expose(&dark, &auto).unwrap_err().to_string().contains("no light"));
}

#[test]
fn no_time_is_a_bias_frame() {
    let sensor = Sensor { read_noise_v: 1e-3, ..photon_counter() };
    let image = band(Array2::from_elem((64, 64), 1e-2));
    let control = |time_s| ExposureControl::Manual(Exposure::seconds(time_s));
    let bias = sensor.capture(&Illumination::on_pixels(&image), &control(0.0), &Noise::all(1)).unwrap();
    assert!(bias.electrons.planes_e[0].iter().all(|&e| e == 0.0));
    // The standard error of a deviation from 4096 pixels is 1.1 %.
    assert_relative_eq!(f64::from(bias.volts.planes_v[0].std(0.0)), 1e-3, max_relative = 0.05);
    for wrong in [-1e-3, f64::NAN, f64::INFINITY] {
        assert!(control(wrong).check().unwrap_err().to_string().contains("time_s"), "{wrong}");
    }
}

#[test]
fn the_last_band_of_a_table_is_whole() {
    let flat = |first_nm: f64, last_nm: f64| {
        let quantum_efficiency = Spectrum::new(vec![first_nm, last_nm], vec![0.5, 0.5]).unwrap();
        Sensor {
            filters: vec![Filter { name: "Y".to_owned(), quantum_efficiency, exposure_fraction: 1.0 }],
            ..photon_counter()
        }
    };
    let grid = WavelengthGrid::uniform(400.0, 700.0, 10.0).unwrap();
    let (short, long) = (flat(400.0, 700.0), flat(300.0, 800.0));
    // The tables end at the centers of the outermost bands.
    assert_eq!(short.electron_weights(&grid), long.electron_weights(&grid));
    assert!(short.bands_beyond_tables(&grid).is_empty());
    // Bands whose centers lie beyond collect nothing, and are named.
    let shorter = flat(400.0, 680.0);
    assert_eq!(shorter.electron_weights(&grid)[0][29..], [0.0; 2]);
    let sentences = shorter.bands_beyond_tables(&grid);
    assert!(sentences.len() == 1 && sentences[0].contains("400 to 680 nm"), "{sentences:?}");
    // A filter that has ended where its table does loses nothing.
    assert!(Sensor::built_in("nikon-d5100").unwrap().bands_beyond_tables(&grid).is_empty());
}

#[test]
fn iso_speeds_are_gains() {
    let imx363 = Sensor::built_in("imx363").unwrap();
    assert_relative_eq!(Exposure::seconds(0.01).at_iso(&imx363, 220.0).unwrap().analog_gain, 4.0);
    assert!(
        Exposure::seconds(0.01).at_iso(&photon_counter(), 100.0).unwrap_err().to_string().contains("iso_at_unity_gain")
    );
}

#[test]
fn the_high_gain_readout_is_more_sensitive() {
    let high = HighGain { conversion_gain_v_per_e: 1e-4, full_well_e: 5_000.0, read_noise_v: 1e-4 };
    let sensor = Sensor { high_gain: Some(high), ..photon_counter() };
    let image = band(array![[1e-3, 1.0]]);
    let exposure = Exposure { gain_mode: GainMode::High, ..Exposure::seconds(0.01) };
    let light = Illumination::on_pixels(&image);
    let capture = sensor.capture(&light, &ExposureControl::Manual(exposure), &Noise::none()).unwrap();
    assert_relative_eq!(capture.volts.planes_v[0][(0, 0)], 0.443, max_relative = 1e-3);
    assert_relative_eq!(capture.volts.planes_v[0][(0, 1)], 0.5, max_relative = 1e-6);
}

#[test]
fn light_that_cannot_be_is_named() {
    let sensor = photon_counter();
    let error = |image: &SpectralImage| sensor.electron_rate(&Illumination::on_pixels(image)).unwrap_err().to_string();
    for bad in [-1.0, f32::NAN, f32::INFINITY] {
        let message = error(&band(array![[0.0, 1.0], [0.0, bad]]));
        assert!(message.contains("550 nm") && message.contains("row 1, column 1"), "{message}");
    }
    let radiance = SpectralImage::zeros(Quantity::Radiance, WavelengthGrid::new(vec![500.0]).unwrap(), 1, 1);
    assert!(error(&radiance).contains("irradiance"));
    let light = band(array![[1.0]]);
    let bad_pitch = Illumination::with_pitch_um(&light, 0.0);
    assert!(sensor.electron_rate(&bad_pitch).unwrap_err().to_string().contains("pitch_um"));
}

#[test]
fn a_sensor_without_converter_hands_on_volts() {
    let sensor = Sensor::built_in("nikon-d100").unwrap();
    let image = band(Array2::from_elem((4, 4), 1e-4));
    let control = ExposureControl::Manual(Exposure::seconds(1e-4));
    let capture = sensor.capture(&Illumination::on_pixels(&image), &control, &Noise::none()).unwrap();
    let RawPlane::Volts(volts) = &capture.raw.planes[0] else { panic!("expected volts") };
    assert_eq!(volts, &capture.volts.planes_v[0]);
}

#[test]
fn what_overflows_spills_along_the_column() {
    let sensor = Sensor { full_well_e: 1000.0, blooming_fraction: 0.5, ..photon_counter() };
    let mut plane = Array2::zeros((7, 3));
    plane[(3, 1)] = 1e-3; // 4430 electrons in 10 ms: 3430 too many, of which a quarter goes each way.
    let image = band(plane);
    let control = ExposureControl::Manual(Exposure::seconds(0.01));
    let electrons = sensor.capture(&Illumination::on_pixels(&image), &control, &Noise::none()).unwrap().electrons;
    let column: Vec<f32> = electrons.planes_e[0].column(1).to_vec();
    let excess = 0.25 * (3986.9966 / 0.9 - 1000.0) as f32;
    for (got, want) in column.iter().zip([0.0, 0.0, excess, 1000.0, excess, 0.0, 0.0]) {
        assert_relative_eq!(*got, want, max_relative = 1e-5);
    }
    assert!(electrons.planes_e[0].column(0).iter().all(|&e| e == 0.0));
}
