//! Reads JPEG.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| dioptric_fuzz::read(data, "jpg", |path| dioptric_scene::read_picture_samples(path).is_ok()));
