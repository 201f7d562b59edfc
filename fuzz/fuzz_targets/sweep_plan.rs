//! Reads plans of sweeps.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| dioptric_fuzz::read(data, "ron", |path| dioptric_sweep::Sweep::read(path).is_ok()));
