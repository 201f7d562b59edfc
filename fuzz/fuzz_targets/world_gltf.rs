//! Reads glTF.

#![no_main]

use dioptric_spectrum::Cancel;
use dioptric_world::{ReadOptions, read_world};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| dioptric_fuzz::read(data, "gltf", |path| read_world(path, &ReadOptions { time_s: Some(0.7), ..ReadOptions::default() }, &Cancel::new()).is_ok()));
