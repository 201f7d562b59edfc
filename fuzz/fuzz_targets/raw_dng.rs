//! Reads DNG.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| dioptric_fuzz::read(data, "dng", |path| dioptric_sensor::DngFile::read(path).is_ok()));
