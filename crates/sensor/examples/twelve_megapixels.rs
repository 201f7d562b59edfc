//! One frame of 12 megapixels from 31 bands to the picture with all noise, once, to be timed and weighed from outside:
//!
//!     cargo build --release -p dioptric-sensor --example twelve_megapixels
//!     /usr/bin/time -v target/release/examples/twelve_megapixels
//!
//! The light, four planes that stand for 31, takes 195 MB of the memory.

#![expect(clippy::print_stdout, reason = "an example tells what it did")]

#[path = "../benches/common/mod.rs"]
mod common;

use std::time::Instant;

use common::{COLUMNS, FourPlanes, ROWS};
use dioptric_sensor::{AutoExposure, ExposureControl, Illumination, Metering, Noise, Processing, Sensor, SensorError};
use dioptric_spectrum::Illuminant;

fn main() -> Result<(), SensorError> {
    let sensor = Sensor::built_in("imx363")?;
    let irradiance = FourPlanes::new();
    let control = ExposureControl::Auto(AutoExposure::new(Metering::Mean, 0.3));
    let start = Instant::now();
    let capture = sensor.capture(&Illumination::on_pixels(&irradiance), &control, &Noise::all(1))?;
    let developed = sensor.develop(&capture.raw, &Processing::for_light(Illuminant::D65))?;
    let code = developed.picture.rgb_at(ROWS / 2, COLUMNS / 2);
    println!("{COLUMNS} × {ROWS} pixels: {:.2} s, code {code:.3?} in the middle", start.elapsed().as_secs_f64());
    Ok(())
}
