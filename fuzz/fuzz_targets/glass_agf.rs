//! Reads glass catalogues.

#![no_main]

use dioptric_optics::GlassCatalogue;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| dioptric_fuzz::read(data, "agf", |path| GlassCatalogue::read(path).is_ok()));
