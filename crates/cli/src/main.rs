//! The command line of dioptric.
fn main() {}
