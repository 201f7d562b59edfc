//! Reads MATLAB files.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| dioptric_fuzz::read(data, "mat", |path| dioptric_scene::read_scene(path, &dioptric_scene::ReadOptions::default()).is_ok()));
