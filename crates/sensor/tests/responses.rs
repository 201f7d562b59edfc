//! Bent responses, oblique light, merged frames and the rolling shutter through the whole chain.

#![expect(clippy::unwrap_used, reason = "a test fails by a panic")]

#[allow(dead_code, reason = "each test file uses a part of it")]
mod common;

use approx::assert_relative_eq;
use common::{PATCH, chart};
use dioptric_sensor::{
    Adc, AutoExposure, Capture, ChartReport, ElectronRate, ExitPupil, Exposure, ExposureControl, Illumination,
    LensShading, LinearPicture, Metering, Noise, Processing, Raw, Response, Sensor, ShadingMap,
};
use dioptric_spectrum::{Illuminant, Quantity, SpectralImage, WavelengthGrid};
use ndarray::Array2;

/// A phone's sensor with 12 bits and a response of choice.
fn sensor(response: Response) -> Sensor {
    let adc = Adc::Bits { bits: 12, black_level_dn: 64, step_v: None };
    Sensor { adc, response, ..Sensor::built_in("imx363").unwrap() }
}

/// Returns one 10 nm band about 550 nm.
fn band(plane: Array2<f32>) -> SpectralImage {
    let grid = WavelengthGrid::uniform(550.0, 550.0, 10.0).unwrap();
    SpectralImage::new(Quantity::Irradiance, grid, vec![plane]).unwrap()
}

fn bent_responses(swing_v: f64) -> [Response; 2] {
    [
        Response::Logarithmic { knee_v: 0.05 * swing_v },
        Response::Companding { knees_v: vec![(0.1 * swing_v, 0.4 * swing_v), (0.4 * swing_v, 0.75 * swing_v)] },
    ]
}

fn shoot(sensor: &Sensor, noise: &Noise) -> Capture {
    let control = ExposureControl::Auto(AutoExposure::new(Metering::Percentile(99.5), 0.9));
    sensor.capture(&Illumination::on_pixels(&chart()), &control, noise).unwrap()
}

fn developed(sensor: &Sensor, raw: &Raw) -> LinearPicture {
    sensor.develop_linear(raw, &Processing::for_light(Illuminant::D65)).unwrap()
}

#[test]
fn a_bent_response_is_undone_by_the_time_there_is_a_picture() {
    let straight = sensor(Response::Linear);
    let metered = shoot(&straight, &Noise::none());
    let control = ExposureControl::Manual(metered.exposure);
    let wanted = developed(&straight, &metered.raw).light;
    for response in bent_responses(straight.swing_v) {
        let bent = sensor(response.clone());
        let capture = bent.capture(&Illumination::on_pixels(&chart()), &control, &Noise::none()).unwrap();
        // The same light, exposure and saturation, but for the last code; other digital numbers.
        assert_relative_eq!(
            capture.raw.levels.saturation_e(),
            straight.saturation_e(&capture.exposure),
            max_relative = 2e-3
        );
        assert_ne!(capture.raw.dn(), metered.raw.dn());
        let light = developed(&bent, &capture.raw).light;
        let worst = light.iter().zip(&wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        // A step of 1/4032 is up to 7 times as much light where a curve is flattest, and the color matrix doubles it.
        assert!(worst < 0.01, "{response:?}: {worst}");
        let corners = {
            let (rows, columns) = (4.0 * PATCH as f64 - 0.5, 6.0 * PATCH as f64 - 0.5);
            [(-0.5, -0.5), (-0.5, columns), (rows, columns), (rows, -0.5)]
        };
        let report = ChartReport::measure(&light, corners, &Illuminant::D65).unwrap();
        assert!(report.mean_delta_e() < 2.5, "{response:?}: {:.2}", report.mean_delta_e());
    }
}

#[test]
fn a_bent_response_gives_the_shadows_more_codes_than_a_straight_one() {
    let straight = sensor(Response::Linear);
    // A hundredth of saturation, without noise, in steps of a tenth of that.
    let saturation_e = straight.saturation_e(&Exposure::seconds(1.0));
    let ramp = Array2::from_shape_fn((1, 50), |(_, c)| (saturation_e * 0.01 * (1.0 + 0.002 * c as f64)) as f32);
    let codes = |sensor: &Sensor| {
        let rate = ElectronRate { planes_e_per_s: vec![ramp.clone()] };
        let exposure = Exposure::seconds(1.0);
        let electrons = sensor.electrons(&rate, &exposure, &Noise::none()).unwrap();
        let raw = sensor.digitize(&sensor.volts(&electrons, &exposure, &Noise::none()).unwrap(), &exposure).unwrap();
        let dn = raw.dn().unwrap().clone();
        dn[(0, 49)] - dn[(0, 0)]
    };
    for response in bent_responses(straight.swing_v) {
        // Slopes at a hundredth of the swing: 5.5 of the logarithm, 4 of the companding curve.
        assert!(codes(&sensor(response.clone())) >= 3 * codes(&straight), "{response:?}");
    }
}

#[test]
fn frames_of_a_bent_response_merge_like_those_of_a_straight_one() {
    let straight = Sensor { prnu_fraction: 0.0, dsnu_v: 0.0, ..sensor(Response::Linear) };
    let rate =
        ElectronRate { planes_e_per_s: vec![Array2::from_shape_fn((64, 64), |(_, c)| 10.0 * 1.2_f32.powi(c as i32))] };
    let exposures = Exposure::seconds(1.0).bracket(&[-6.0, -3.0, 0.0]);
    for response in bent_responses(straight.swing_v) {
        let bent = Sensor { response: response.clone(), ..straight.clone() };
        let frames: Vec<Raw> = exposures
            .iter()
            .zip(0..)
            .map(|(exposure, number)| {
                let noise = Noise::all(5).frame(number);
                let electrons = bent.electrons(&rate, exposure, &noise).unwrap();
                bent.digitize(&bent.volts(&electrons, exposure, &noise).unwrap(), exposure).unwrap()
            })
            .collect();
        let merged = bent.merge(&frames).unwrap();
        let scale = merged.levels.saturation_e() / merged.exposure.time_s;
        let linear = &merged.linear()[0];
        for c in (0..64).step_by(7) {
            let expected = f64::from(rate.planes_e_per_s[0][(0, c)]);
            if expected > 0.9 * scale {
                continue;
            }
            let mean = linear.column(c).iter().map(|&v| f64::from(v) * scale).sum::<f64>() / 64.0;
            // Shot and read noise of the merged frames, five standard errors of 64 pixels, and the converter's steps.
            let error = 5.0 * (expected + 25.0).sqrt() / 8.0 + 0.01 * expected;
            assert!((mean - expected).abs() < error, "{response:?}, column {c}: {mean}, not {expected}");
        }
    }
}

#[test]
fn oblique_light_is_lost_by_the_table_and_shading_correction_brings_it_back() {
    let table = vec![(0.0, 1.0), (10.0, 0.9), (20.0, 0.6), (30.0, 0.3)];
    let sensor = Sensor { chief_ray_response: table, pixel_pitch_um: 20.0, ..sensor(Response::Linear) };
    let grid = WavelengthGrid::uniform(400.0, 700.0, 20.0).unwrap();
    let planes = vec![Array2::from_elem((120, 160), 1e-3_f32); grid.len()];
    let image = SpectralImage::new(Quantity::Irradiance, grid, planes).unwrap();
    // The corner is 2 mm from the axis: with the pupil 5.5 mm away its chief ray comes in at 20°.
    let distance_mm = 2.0 / 20.0_f64.to_radians().tan();
    let exit_pupil = Some(ExitPupil::centered(distance_mm));
    let light = Illumination { exit_pupil, ..Illumination::on_pixels(&image) };
    let control = ExposureControl::Auto(AutoExposure::new(Metering::Peak, 0.8));
    let capture = sensor.capture(&light, &control, &Noise::none()).unwrap();
    let linear = &capture.raw.linear()[0];
    // Pixels of one filter: the first of the frame, and the same corner of the tile in the middle.
    let ratio = linear[(0, 0)] / linear[(60, 80)];
    // Half a pixel from the corner and from the middle, and steps of the converter.
    assert!((ratio - 0.6).abs() < 0.01, "{ratio}");
    let edge_deg = (1.2 / distance_mm).atan().to_degrees();
    let expected = 0.9 - 0.03 * (edge_deg - 10.0);
    let top = linear[(0, 80)] / linear[(60, 80)];
    assert!((f64::from(top) - expected).abs() < 0.01, "{top}, not {expected}");

    let shading = LensShading::Map(ShadingMap::measure(&capture.raw, 12, 16).unwrap());
    let processing = Processing { shading: Some(shading), ..Processing::for_light(Illuminant::E) };
    let corrected = sensor.develop_linear(&capture.raw, &processing).unwrap().light;
    let plain = sensor.develop_linear(&capture.raw, &Processing::for_light(Illuminant::E)).unwrap().light;
    let fall = |light: &ndarray::Array3<f32>| light[(2, 2, 1)] / light[(60, 80, 1)];
    assert!(fall(&plain) < 0.65 && (fall(&corrected) - 1.0).abs() < 0.03, "{} {}", fall(&plain), fall(&corrected));
}

#[test]
fn chief_rays_follow_the_exit_pupil() {
    let even = band(Array2::from_elem((41, 61), 1e-3));
    let table = vec![(0.0, 1.0), (45.0, 0.1)];
    let sensor = Sensor { chief_ray_response: table, pixel_pitch_um: 50.0, ..sensor(Response::Linear) };
    let rate = |sensor: &Sensor, exit_pupil| {
        let light = Illumination { exit_pupil: Some(exit_pupil), ..Illumination::on_pixels(&even) };
        sensor.electron_rate(&light).map(|rate| rate.planes_e_per_s[0].clone())
    };
    let before = rate(&sensor, ExitPupil::centered(3.0)).unwrap();
    assert!(before[(20, 0)] < 0.7 * before[(20, 30)]);
    // A chief ray is a line: which side of the film the pupil lies on does not turn it.
    assert_eq!(rate(&sensor, ExitPupil::centered(-3.0)).unwrap(), before);
    // With the axis half a millimeter to the right and 0.3 mm down, so is the frame of rates.
    let aside = rate(&sensor, ExitPupil { axis_mm: [0.5, 0.3], ..ExitPupil::centered(3.0) }).unwrap();
    for (row, column) in [(20, 30), (3, 12), (30, 48)] {
        // Pixels of the same filter; the places round differently.
        assert_relative_eq!(aside[(row + 6, column + 10)], before[(row, column)], max_relative = 1e-6);
    }
    // A sensor that does not depend on the angle takes a pupil on either side too.
    let plain = Sensor { chief_ray_response: Vec::new(), ..sensor.clone() };
    assert_eq!(rate(&plain, ExitPupil::centered(-3.0)).unwrap(), rate(&plain, ExitPupil::centered(3.0)).unwrap());
    // Of a telecentric lens every chief ray runs along the axis.
    assert_eq!(
        rate(&sensor, ExitPupil::centered(f64::INFINITY)).unwrap(),
        rate(&plain, ExitPupil::centered(3.0)).unwrap()
    );
    for wrong in [0.0, f64::NAN] {
        assert!(rate(&sensor, ExitPupil::centered(wrong)).unwrap_err().to_string().contains("exit_pupil"), "{wrong}");
    }
}

/// Returns the rms difference of the light of two pictures over the patches' middles.
fn rms(a: &LinearPicture, b: &LinearPicture) -> f64 {
    let square: f64 = a.light.iter().zip(&b.light).map(|(a, b)| f64::from(a - b).powi(2)).sum();
    (square / a.light.len() as f64).sqrt()
}

#[test]
fn merged_frames_are_denoised_by_their_own_noise() {
    let sensor = Sensor { prnu_fraction: 0.0, ..sensor(Response::Linear) };
    // The chart's patches at four times their size, so that there is more to them than edges.
    let small = sensor.electron_rate(&Illumination::on_pixels(&chart())).unwrap().planes_e_per_s.remove(0);
    let side = 4 * PATCH;
    let inside = |i: usize| PATCH * (i / side) + PATCH / 3 + i % 2;
    let large = Array2::from_shape_fn((4 * side, 6 * side), |(r, c)| small[(inside(r), inside(c))]);
    let rate = ElectronRate { planes_e_per_s: vec![large] };
    let control = ExposureControl::Auto(AutoExposure::new(Metering::Percentile(99.5), 0.9));
    let exposure = sensor.expose(&rate, &control).unwrap();
    let frames = |exposures: &[Exposure], noise: Noise| -> Vec<Raw> {
        let frame = |(exposure, number): (&Exposure, u64)| {
            let noise = noise.frame(number);
            let electrons = sensor.electrons(&rate, exposure, &noise).unwrap();
            sensor.digitize(&sensor.volts(&electrons, exposure, &noise).unwrap(), exposure).unwrap()
        };
        exposures.iter().zip(0..).map(frame).collect()
    };
    // How much of the noise is left, and how much of what is none is lost.
    let left_and_lost = |exposures: &[Exposure]| {
        let picture = |noise: Noise, denoise: f64| {
            let mut frames = frames(exposures, noise);
            let raw = if frames.len() > 1 { sensor.merge(&frames).unwrap() } else { frames.remove(0) };
            sensor
                .develop_linear(&raw, &Processing { denoise: Some(denoise), ..Processing::for_light(Illuminant::D65) })
                .unwrap()
        };
        let clean = picture(Noise::none(), 0.0);
        let noisy = rms(&picture(Noise::all(3), 0.0), &clean);
        (rms(&picture(Noise::all(3), 1.0), &clean) / noisy, rms(&picture(Noise::none(), 1.0), &clean) / noisy)
    };
    let short = Exposure { time_s: 0.02 * exposure.time_s, ..exposure };
    for (what, exposures) in [("burst", vec![short; 4]), ("bracket", exposure.bracket(&[-5.0, -2.0]))] {
        let time_s = exposures.iter().map(|e| e.time_s).sum();
        let single = left_and_lost(&[Exposure { time_s, ..exposure }]);
        let merged = left_and_lost(&exposures);
        // One frame of the same time has the same shot noise and less of the rest, so that it is no worse by much.
        assert!(merged.0 < 1.0 && merged.0 < 1.15 * single.0, "{what}: {merged:?}, a single frame {single:?}");
        assert!(merged.1 < 1.25 * single.1, "{what}: {merged:?}, a single frame {single:?}");
    }
}

#[test]
fn merged_frames_are_not_merged_again() {
    let sensor = sensor(Response::Linear);
    let raw = shoot(&sensor, &Noise::all(1)).raw;
    let merged = sensor.merge(&[raw.clone(), raw.clone()]).unwrap();
    assert!(sensor.merge(&[merged, raw]).unwrap_err().to_string().contains("merged again"));
}

#[test]
fn a_rolling_shutter_says_when_each_row_begins() {
    let rolling = Sensor { row_time_us: 12.5, ..sensor(Response::Linear) };
    let raw = shoot(&rolling, &Noise::none()).raw;
    assert_eq!((raw.row_time_us, raw.row_start_s(0)), (12.5, 0.0));
    assert_relative_eq!(raw.row_start_s(80), 1e-3, max_relative = 1e-12);
    let merged = rolling.merge(&[raw.clone(), raw]).unwrap();
    assert_eq!(merged.row_time_us, 12.5);
}
