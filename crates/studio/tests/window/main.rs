//! The window without a screen.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

mod desk;
mod drags;
mod edits;
mod files;
mod losses;
mod panels;
mod worlds;
