//! Reads camera files.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| dioptric_fuzz::read(data, "ron", |path| dioptric_pipeline::Camera::read(path).is_ok()));
