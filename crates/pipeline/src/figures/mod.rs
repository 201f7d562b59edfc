//! The paper's Figures 1 to 4: functions that return data.

pub mod figure1;
pub mod figure2;
pub mod figure3;
pub mod figure4;
pub mod paper;
