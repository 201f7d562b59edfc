//! The Python package `dioptric`: the whole camera for scripts, notebooks and data sets.
//!
//! Each class holds what the crates below hold and adds nothing to their results. Results are read-only NumPy views of the
//! memory that Rust owns (`view`); long work runs without the interpreter's lock, can be interrupted, and reports its
//! progress (`worker`); errors are `ValueError` or `OSError` with the sentence of the crate that found them (`errors`).
//!
//! The Python side of the package (`python/dioptric`) has the type stubs, and what is easier said in Python: progress bars,
//! xarray, HTML for notebooks.

#![expect(clippy::doc_markdown, reason = "the words of classes and methods are Python docstrings, in NumPy's format")]

mod camera;
mod changes;
mod developed;
mod errors;
mod input;
mod lens;
mod lens_requests;
mod lens_rows;
mod light_field;
mod measure;
mod options;
mod paintings;
mod pickle;
mod rays;
mod restorer;
mod samples;
mod save;
mod scene;
mod scene_options;
mod sensor;
mod serial;
mod shot;
mod sweep;
mod video;
mod view;
mod worker;
mod world;

use pyo3::prelude::*;

/// The native part of the package `dioptric`; import `dioptric` instead.
#[pymodule(gil_used = true)]
mod _native {
    #[pymodule_export]
    use super::{
        camera::Camera,
        developed::{Developed, develop},
        lens::Lens,
        light_field::LightField,
        measure::_measure,
        pickle::{_restore_camera, _restore_lens, _restore_scene, _restore_scene_spec, _restore_sensor, _restore_shot},
        rays::Rays,
        samples::read_samples,
        scene::Scene,
        sensor::Sensor,
        shot::Shot,
        sweep::{Maker, Plan, Sweep, read_index},
        video::{Video, VideoFrame},
        view::Memory,
        worker::{_panic, set_threads, threads},
        world::{_World, _restore_world},
    };
    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
