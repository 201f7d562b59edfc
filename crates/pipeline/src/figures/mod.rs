//! The paper's Figures 1 to 3: functions that return data.

pub mod figure1;
pub mod figure2;
pub mod figure3;
