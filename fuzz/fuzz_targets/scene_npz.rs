//! Reads archives of arrays of NumPy.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| dioptric_fuzz::read(data, "npz", |path| {
    dioptric_scene::read_scene(path, &dioptric_scene::ReadOptions::default()).is_ok()
}));
