//! Wavefronts and point spread functions of lenses whose reference comes from other tools.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may fail, and prints what it found")]

mod huygens;
mod lens;
mod opd;
mod psf;
#[path = "../../../optics/tests/reference/reader.rs"]
mod reader;
