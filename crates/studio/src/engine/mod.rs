//! The engine: from a camera to its pictures, the first of them at once. It knows of no window.
//!
//! One thread works on one camera at a time, the latest that was [submitted](Engine::submit), and delivers a ladder of
//! pictures of it ([`Rung`]), each with its time; the last has the bytes of `dioptric run`, and of a world it is shown on its way too. A second thread
//! answers smaller questions ([`Asker`]): the point spread at a place, the analysis of the lens. Both wait without using the processor.

mod asker;
mod bench;
mod fault;
mod mailbox;
mod probe;
mod product;
mod refine;
mod rung;
mod worker;

pub(crate) use product::three;

pub use asker::Asker;
pub use bench::{LensAnswer, LensQuestion, sensor_answer};
pub use fault::{Fault, Field};
pub use probe::{Probe, Spread};
pub use product::{LightStep, Product};
pub use rung::Rung;
pub use worker::{Busy, Delivery, Engine, EngineSettings};
