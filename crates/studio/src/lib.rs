//! The window of dioptric: change anything of a camera and see its picture.
//!
//! [`engine`] takes the pictures, on a thread of its own; [`session`] holds the camera, what can be taken back and what is
//! compared. Neither knows of a window. [`ui`] is the window, in egui; the program `dioptric-studio` a shell around it.
#![doc = include_str!("../README.md")]

pub mod engine;
pub mod session;
pub mod ui;
