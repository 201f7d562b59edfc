//! Reads data sheets of sensors.

#![no_main]

use dioptric_sensor::Sensor;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| dioptric_fuzz::read(data, "ron", |path| Sensor::read(path).is_ok()));
