//! Many pictures of a varied camera: data sets, studies of a parameter, comparisons of cameras.
//!
//! A [`Plan`] is a file: a camera, and what is varied of it. A [`Sweep`] is a plan with all its items: their cameras, their
//! names, and the order in which they share the most work. A [`Store`] is a folder of finished items, each there whole or not
//! at all, so that a sweep goes on after any interruption and many machines fill one store. An [`Index`] is what came of all
//! items, as tables and as a contact sheet; nothing of it but names and places is held for all items at once.
//!
//! An item is called by a hash of its camera, of the files that it is made from and of [`RESULTS_EPOCH`], and is the same to
//! the byte whatever was made before it, in whichever shard, with any number of threads. This crate prints nothing and reads
//! no clock.
#![doc = include_str!("../README.md")]

mod axes;
mod cameras;
mod error;
mod index;
mod inputs;
mod item;
mod keep;
mod key;
mod lines;
mod metrics;
mod pack;
mod plan;
mod prune;
mod run;
mod schema;
mod sheet;
mod store;
mod sweep;
mod tables;
mod value;

pub use axes::{Axes, Distribution, Sampling, Values};
pub use error::SweepError;
pub use index::{Index, IndexRow};
pub use key::{ItemId, RESULTS_EPOCH};
pub use lines::IndexLines;
pub use metrics::Metrics;
pub use plan::{Base, Keep, Plan, PlanOutputs};
pub use prune::Pruned;
pub use run::{Made, Maker, Outcome, SweepProgress};
#[cfg(feature = "schema")]
pub use schema::generated_schema;
pub use schema::{PLAN_SCHEMA, PLAN_TEMPLATE};
pub use store::{Status, Store, Workplace};
pub use sweep::{Shard, Sweep};
pub use value::Value;
