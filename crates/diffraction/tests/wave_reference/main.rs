//! Wavefronts and point spread functions of lenses whose reference comes from other tools.
#![allow(clippy::unwrap_used, reason = "a test may fail")]

mod lens;
mod opd;
mod psf;
