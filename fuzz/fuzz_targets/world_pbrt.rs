//! Reads pbrt files.

#![no_main]

use dioptric_spectrum::Cancel;
use dioptric_world::{ReadOptions, read_world};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| dioptric_fuzz::read(data, "pbrt", |path| read_world(path, &ReadOptions::default(), &Cancel::new()).is_ok()));
