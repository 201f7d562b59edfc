//! Lenses of the shared reference data, traced by a tool of fifty digits.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test's helpers may fail the test")]

mod first_order;
mod lens;
mod opticstudio;
mod rays;
mod reader;
mod seidel;
mod spots;
