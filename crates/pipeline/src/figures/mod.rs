//! The paper's Figures 1 to 3: functions that return data, and the drawings made of them.

mod drawing;
pub mod figure1;
pub mod figure2;
pub mod figure3;

pub use drawing::{Drawing, draw_all};
