//! The light that lenses lose: coatings against an independent program, rays through lenses against closed forms and another tracer.

mod coatings;
mod ghosts;
mod transmission;
