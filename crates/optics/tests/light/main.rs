//! The light that lenses lose: coatings against an independent program, rays through lenses against closed forms and another tracer.
#![expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]

mod coatings;
mod ghosts;
mod transmission;
