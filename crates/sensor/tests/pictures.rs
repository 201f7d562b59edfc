//! Pictures: colors of a chart, and demosaics held to a sensor that has every filter in every pixel.

#![expect(clippy::unwrap_used, reason = "a test fails by a panic")]

mod common;

use common::{PATCH, chart, lit, lit_by_d65};
use dioptric_sensor::{
    Adc, AutoExposure, Brightness, Cfa, Demosaic, Developed, Exposure, ExposureControl, Highlights, Illumination,
    Metering, Noise, Picture, Processing, Sensor, ToneCurve, WhiteBalance, psnr_db,
};
use dioptric_spectrum::{
    Illuminant, Lab, Observer, Quantity, SpectralImage, WavelengthGrid, Xyz, color_checker_reflectances, delta_e_2000,
    srgb_decode,
};
use ndarray::Array2;

/// Puts the brightest pixels but a few at 90 % of saturation.
const WHITE_AT_90: ExposureControl = ExposureControl::Auto(AutoExposure::new(Metering::Percentile(99.5), 0.9));

fn develop(sensor: &Sensor, image: &SpectralImage, noise: &Noise, processing: &Processing) -> Developed {
    let capture = sensor.capture(&Illumination::on_pixels(image), &WHITE_AT_90, noise).unwrap();
    sensor.develop(&capture.raw, processing).unwrap()
}

/// Returns ΔE₀₀ of each patch of a developed chart against what the 1931 observer sees under D65.
fn chart_delta_e(sensor: &Sensor, noise: &Noise) -> Vec<f64> {
    let image = chart();
    let capture = sensor.capture(&Illumination::on_pixels(&image), &WHITE_AT_90, noise).unwrap();
    let linear = sensor.develop_linear(&capture.raw, &Processing::for_light(Illuminant::D65)).unwrap();
    let grid = WavelengthGrid::uniform(380.0, 780.0, 1.0).unwrap();
    let light = Illuminant::D65.spectrum().sample_held(&grid);
    let white = Observer::Cie1931.xyz(&grid, &light);
    let wanted: Vec<Lab> = color_checker_reflectances()
        .iter()
        .map(|(_, s)| {
            let lit: Vec<f64> = s.sample_held(&grid).iter().zip(&light).map(|(r, s)| r * s).collect();
            Observer::Cie1931.xyz(&grid, &lit).to_lab(white)
        })
        .collect();
    let got: Vec<[f64; 3]> = (0..24)
        .map(|patch| {
            // The middle of the patch, away from its neighbors.
            let (row, column) = (PATCH * (patch / 6) + 8, PATCH * (patch % 6) + 8);
            let mean = |i: usize| {
                let view = linear.light.slice(ndarray::s![row..row + 8, column..column + 8, i]);
                view.iter().map(|&v| f64::from(v)).sum::<f64>() / 64.0
            };
            [mean(0), mean(1), mean(2)]
        })
        .collect();
    // The exposure is a free factor: the white patch is given its luminance.
    let white_y = (wanted[18].l + 16.0) / 116.0;
    let scale = white_y.powi(3) / Xyz::from_linear_srgb(got[18]).luminance_cd_m2();
    got.iter()
        .zip(&wanted)
        .map(|(rgb, wanted)| delta_e_2000(Xyz::from_linear_srgb(rgb.map(|v| v * scale)).to_lab(Xyz::D65), *wanted))
        .collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[test]
fn a_chart_through_a_phones_sensor_keeps_its_colors() {
    let delta_e = chart_delta_e(&Sensor::built_in("imx363").unwrap(), &Noise::none());
    assert!(mean(&delta_e) <= 3.0, "mean {:.3}: {delta_e:.2?}", mean(&delta_e));
}

#[test]
fn a_chart_through_an_observing_sensor_is_exact() {
    let delta_e = chart_delta_e(&Sensor::built_in("ideal").unwrap(), &Noise::none());
    // Bands of 10 nm and steps of 5 nm in the sensor's curves are what is left.
    assert!(mean(&delta_e) <= 0.1, "mean {:.3}: {delta_e:.2?}", mean(&delta_e));
}

#[test]
fn monochrome_gives_a_gray_picture() {
    let sensor = Sensor::built_in("machine-vision-mono").unwrap();
    let developed = develop(&sensor, &chart(), &Noise::all(1), &Processing::for_light(Illuminant::D65));
    assert_eq!(developed.balance, [1.0]);
    for pixel in developed.picture.codes.rows() {
        assert!(pixel[0] == pixel[1] && pixel[1] == pixel[2]);
    }
}

#[test]
fn white_is_found_by_every_balance() {
    let sensor = Sensor::built_in("imx363").unwrap();
    let grid = WavelengthGrid::uniform(380.0, 730.0, 10.0).unwrap();
    // A hill that is its own mirror image, so that the pixels of each filter have the same mean.
    let slope = |i: usize| (i as f32 - 31.5).abs();
    let gray = Array2::from_shape_fn((64, 64), |(r, c)| 0.5 - 0.004 * (slope(r) + slope(c)));
    let planes = vec![gray; grid.len()];
    let image = lit(grid, planes);
    // The mean of 4096 pixels of 10 bits each; of the edges it is that of steps of four codes, each rounded to one, of which
    // the sixth power counts.
    for (white, most) in [
        (WhiteBalance::GrayWorld, 2e-3),
        (WhiteBalance::WhitePatch { percentile: 99.0 }, 2e-3),
        (WhiteBalance::Light(Illuminant::D65), 2e-3),
        (WhiteBalance::ShadesOfGray { exponent: 6.0 }, 2e-3),
        (WhiteBalance::GrayEdge { exponent: 6.0, sigma_px: 1.0 }, 5e-3),
        (WhiteBalance::Patch { left: 8, top: 16, width: 48, height: 32 }, 2e-3),
    ] {
        let processing = Processing { white: white.clone(), ..Processing::for_light(Illuminant::D65) };
        let developed = develop(&sensor, &image, &Noise::none(), &processing);
        let mean = |i: usize| developed.picture.codes.index_axis(ndarray::Axis(2), i).mean().unwrap();
        let (red, green, blue) = (mean(0), mean(1), mean(2));
        assert!((red - green).abs() < most && (blue - green).abs() < most, "{white:?}: {red} {green} {blue}");
    }
}

/// Returns CIELAB of the middle of a picture.
fn middle_lab(picture: &Picture) -> Lab {
    let (row, column) = (picture.rows() / 2, picture.columns() / 2);
    let linear = [0, 1, 2].map(|k| srgb_decode(f64::from(picture.codes[(row, column, k)])));
    Xyz::from_linear_srgb(linear).to_lab(Xyz::D65)
}

#[test]
fn a_blown_lamp_keeps_its_hue() {
    let sensor = Sensor::built_in("nikon-d5100").unwrap();
    let grid = WavelengthGrid::uniform(400.0, 700.0, 10.0).unwrap();
    let lamp = Illuminant::Blackbody(2600.0).white_radiance(&grid, 1.0);
    let ground = Illuminant::D65.white_radiance(&grid, 0.002);
    let shape = |r: usize, c: usize| (-((r as f64 - 32.0).powi(2) + (c as f64 - 32.0).powi(2)) / 72.0).exp();
    let plane = |b: usize| Array2::from_shape_fn((64, 64), |(r, c)| (lamp[b] * shape(r, c) + ground[b]) as f32);
    let planes = (0..grid.len()).map(plane).collect();
    let image = SpectralImage::new(Quantity::Irradiance, grid, planes).unwrap();
    let light = Illumination::on_pixels(&image);
    let metered = ExposureControl::Auto(AutoExposure::new(Metering::Peak, 0.8));
    let dim = sensor.capture(&light, &metered, &Noise::none()).unwrap();
    let processing = Processing::for_light(Illuminant::D65);
    let wanted = middle_lab(&sensor.develop(&dim.raw, &processing).unwrap().picture);
    for times in [1.6, 3.0, 20.0] {
        let longer = Exposure { time_s: times * dim.exposure.time_s, ..dim.exposure };
        let blown = sensor.capture(&light, &ExposureControl::Manual(longer), &Noise::all(1)).unwrap();
        let lab = |highlights| {
            let processing = Processing { highlights, ..processing.clone() };
            middle_lab(&sensor.develop(&blown.raw, &processing).unwrap().picture)
        };
        let (kept, clipped) = (lab(Highlights::Reconstruct), lab(Highlights::Clip));
        let hue_deg = |lab: Lab| lab.b.atan2(lab.a).to_degrees();
        let chroma = |lab: Lab| lab.a.hypot(lab.b);
        assert!((hue_deg(kept) - hue_deg(wanted)).abs() < 5.0, "{times}: {kept:?}, not {wanted:?}");
        assert!(chroma(kept) > 0.8 * chroma(wanted), "{times}: {kept:?}, not {wanted:?}");
        // Cut channel by channel it turns to yellow, then white.
        let turned = (hue_deg(clipped) - hue_deg(wanted)).abs() > 5.0 || chroma(clipped) < 0.5 * chroma(wanted);
        assert!(turned, "{times}: {clipped:?}, not far from {wanted:?}");
    }
}

#[test]
fn brightness_is_put_where_it_is_asked() {
    let sensor = Sensor::built_in("ideal").unwrap();
    let brightness = Brightness::Percentile { percent: 50.0, to: 0.18 };
    let processing = Processing { brightness, curve: ToneCurve::Linear, ..Processing::for_light(Illuminant::D65) };
    let grid = WavelengthGrid::uniform(380.0, 730.0, 10.0).unwrap();
    let ramp = Array2::from_shape_fn((21, 21), |(r, c)| 0.001 * (1 + 21 * r + c) as f32);
    let planes = vec![ramp; grid.len()];
    let developed = develop(&sensor, &lit(grid, planes), &Noise::none(), &processing);
    let mut luminances: Vec<f32> =
        developed.picture.codes.rows().into_iter().map(|p| 0.2126 * p[0] + 0.7152 * p[1] + 0.0722 * p[2]).collect();
    luminances.sort_by(f32::total_cmp);
    assert!((luminances[luminances.len() / 2] - 0.18).abs() < 1e-3);
}

const METHODS: [Demosaic; 5] =
    [Demosaic::Nearest, Demosaic::Bilinear, Demosaic::Malvar, Demosaic::Directional, Demosaic::DirectionalRatio];

/// Returns the PSNR of each method, dB, of codes against those of a sensor with every filter in every pixel.
fn demosaic_psnr_db(path: &std::path::Path, cfa: &Cfa) -> [f64; 5] {
    let image = lit_by_d65(path);
    let mosaic = Sensor { cfa: cfa.clone(), adc: Adc::Analog, ..Sensor::built_in("imx363").unwrap() };
    let full = Sensor { cfa: Cfa::Stacked, ..mosaic.clone() };
    let processing = |demosaic| Processing { demosaic, ..Processing::for_light(Illuminant::D65) };
    let wanted = develop(&full, &image, &Noise::none(), &processing(Demosaic::Nearest));
    METHODS.map(|method| {
        let got = develop(&mosaic, &image, &Noise::none(), &processing(method));
        psnr_db(&got.picture, &wanted.picture).unwrap()
    })
}

#[dioptric_golden::needs_shared]
#[test]
fn the_good_demosaic_beats_bilinear_by_three_decibels() {
    for name in ["cave_chart_and_stuffed_toy", "cave_stuffed_toys_256"] {
        let path = dioptric_golden::shared(&format!("data/scenes/{name}.reflectance.exr")).unwrap();
        for letters in ["RGGB", "GBRG"] {
            let found = demosaic_psnr_db(&path, &Cfa::two_by_two(letters).unwrap());
            let [nearest, bilinear, malvar, directional, ratio] = found;
            let quoted = format!("{name} {letters}: {found:.2?}");
            assert!(nearest < bilinear && bilinear < malvar && bilinear + 3.0 <= directional, "{quoted}");
            assert!(directional + 1.0 <= ratio, "{quoted}");
        }
    }
}

#[dioptric_golden::needs_shared]
#[test]
fn other_mosaics_gain_from_detail() {
    let path = dioptric_golden::shared("data/scenes/cave_stuffed_toys_256.reflectance.exr").unwrap();
    let quad = Cfa::two_by_two("RGGB").unwrap().repeated(2);
    let [nearest, bilinear, _, directional, _] = demosaic_psnr_db(&path, &quad);
    let quoted = format!("quad Bayer: {nearest:.2} {bilinear:.2} {directional:.2}");
    assert!(nearest < bilinear && bilinear < directional, "{quoted}");
}

/// Returns the PSNR, dB, of a noisy picture against one without noise, at a strength of denoising.
fn noisy_psnr_db(path: &std::path::Path, strength: f64) -> f64 {
    let image = lit_by_d65(path);
    let sensor = Sensor::built_in("imx363").unwrap();
    // A short exposure at a high gain: 8 % of the well at white.
    let limit = Exposure { analog_gain: 11.0, ..Exposure::seconds(f64::INFINITY) };
    let control = ExposureControl::Auto(AutoExposure { limit, ..AutoExposure::new(Metering::Percentile(99.5), 0.9) });
    let processing = |denoise| Processing { denoise: Some(denoise), ..Processing::for_light(Illuminant::D65) };
    let picture = |noise: Noise, strength| {
        let capture = sensor.capture(&Illumination::on_pixels(&image), &control, &noise).unwrap();
        sensor.develop(&capture.raw, &processing(strength)).unwrap().picture
    };
    psnr_db(&picture(Noise::all(7), strength), &picture(Noise::none(), 0.0)).unwrap()
}

#[dioptric_golden::needs_shared]
#[test]
fn denoising_brings_a_noisy_picture_nearer_to_the_clean_one() {
    for name in ["cave_chart_and_stuffed_toy", "cave_stuffed_toys_256"] {
        let path = dioptric_golden::shared(&format!("data/scenes/{name}.reflectance.exr")).unwrap();
        let (noisy, denoised) = (noisy_psnr_db(&path, 0.0), noisy_psnr_db(&path, 1.0));
        // The toys at 256 pixels are texture nearly everywhere, which must not be lost with the noise.
        assert!(denoised > noisy + 1.0, "{name}: {noisy:.2} dB, denoised {denoised:.2} dB");
    }
}
