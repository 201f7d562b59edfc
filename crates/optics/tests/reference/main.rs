//! Lenses of the shared reference data, traced by a tool of fifty digits.

mod first_order;
mod lens;
mod rays;
