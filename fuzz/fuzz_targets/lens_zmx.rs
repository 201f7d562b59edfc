//! Reads Zemax files.

#![no_main]

use dioptric_optics::{LensFile, ReadOptions};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| dioptric_fuzz::read(data, "zmx", |path| LensFile::read(path, &ReadOptions::default()).is_ok()));
