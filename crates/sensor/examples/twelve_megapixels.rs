//! One frame of 12 megapixels from 31 bands to the picture with all noise, once, to be timed and weighed from outside:
//!
//!     cargo build --release -p dioptric-sensor --example twelve_megapixels
//!     /usr/bin/time -v target/release/examples/twelve_megapixels [all]
//!
//! With `all` every step of the processing is on: denoising, lens corrections of barrel distortion and lateral color, sharpening
//! and local tone.
//! The light, four planes that stand for 31, takes 195 MB of the memory.

#![expect(clippy::print_stdout, reason = "an example tells what it did")]

#[path = "../benches/common/mod.rs"]
mod common;

use std::time::Instant;

use common::{COLUMNS, FourPlanes, ROWS};
use dioptric_sensor::{
    AutoExposure, ExposureControl, FrameTable, Illumination, LensCorrections, LensTables, LocalTone, Metering, Noise,
    Processing, Sensor, SensorError,
};
use dioptric_spectrum::Illuminant;

/// Tables of a lens with 3 % of barrel distortion in the corners, .1 % of lateral color and half the light in the corners.
fn lens() -> Result<LensTables, SensorError> {
    let place = |i: usize, down: f64, right: f64| [(right - 0.5) * COLUMNS as f64, (down - 0.5) * ROWS as f64][i];
    let r2 = |down: f64, right: f64| {
        (place(0, down, right).powi(2) + place(1, down, right).powi(2))
            / (0.25 * (COLUMNS * COLUMNS + ROWS * ROWS) as f64)
    };
    let table = |value: &dyn Fn(f64, f64) -> f64| FrameTable::tabulate(41, 41, value);
    let lateral = |k: f64| {
        let part = |i: usize| table(&|down, right| k * place(i, down, right));
        Ok::<_, SensorError>([part(0)?, part(1)?])
    };
    let barrel = |i: usize| table(&|down, right| -0.03 * r2(down, right) * place(i, down, right));
    Ok(LensTables {
        size: (ROWS, COLUMNS),
        distortion_px: [barrel(0)?, barrel(1)?],
        lateral_color_px: vec![lateral(1e-3)?, lateral(0.0)?, lateral(-1e-3)?],
        vignetting: vec![table(&|down, right| 1.0 + r2(down, right))?; 3],
    })
}

fn main() -> Result<(), SensorError> {
    let sensor = Sensor::built_in("imx363")?;
    let irradiance = FourPlanes::new();
    let control = ExposureControl::Auto(AutoExposure::new(Metering::Mean, 0.3));
    let start = Instant::now();
    let capture = sensor.capture(&Illumination::on_pixels(&irradiance), &control, &Noise::all(1))?;
    let captured_s = start.elapsed().as_secs_f64();
    let usual = Processing::for_light(Illuminant::D65);
    let developed = if std::env::args().any(|argument| argument == "all") {
        let processing = Processing {
            denoise: Some(0.5),
            lens_corrections: LensCorrections::ALL,
            sharpen_px: 0.7,
            local_tone: LocalTone { range: 0.6, detail: 1.2 },
            ..usual
        };
        sensor.develop_with(&capture.raw, &processing, Some(&lens()?))?
    } else {
        sensor.develop(&capture.raw, &usual)?
    };
    let code = developed.picture.rgb_at(ROWS / 2, COLUMNS / 2);
    let all_s = start.elapsed().as_secs_f64();
    println!(
        "{COLUMNS} × {ROWS} pixels: {captured_s:.2} s to the raw frame, {all_s:.2} s to the picture, code {code:.3?}"
    );
    Ok(())
}
