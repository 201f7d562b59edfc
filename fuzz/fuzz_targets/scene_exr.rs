//! Reads spectral EXR.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| dioptric_fuzz::read(data, "exr", |path| dioptric_scene::read_spectral_exr(path).is_ok()));
