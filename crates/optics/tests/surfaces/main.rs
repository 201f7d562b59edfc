//! Rays through surfaces of every kind and place. One program, which is compiled and linked once.

mod apertures;
mod configurations;
mod diffractive;
mod immersion;
mod mirrors;
mod placed;
mod reversed;
mod toric;
