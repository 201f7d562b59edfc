//! Parts of a camera that a program made: no file and no name stands for them.

use std::{ops::Deref, sync::Arc};

use dioptric_optics::LensFile;
use dioptric_scene::Scene;
use dioptric_sensor::Sensor;

use crate::PipelineError;

/// A part that is shared, and equal to its own clones alone: large contents are never compared.
#[derive(Debug)]
pub struct Given<T>(Arc<T>);

impl<T> Given<T> {
    /// A part of its own.
    pub fn new(part: T) -> Self {
        Self(Arc::new(part))
    }
}

impl<T> Clone for Given<T> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<T> PartialEq for Given<T> {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl<T> Deref for Given<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.0
    }
}

/// The parts of a camera that a program made, each in place of what the camera file names.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GivenParts {
    /// The lens as a file would state it; the camera's stop and movements are applied to it.
    pub lens: Option<Given<LensFile>>,
    /// The scene; the camera's bands, light and luminance are applied to it.
    pub scene: Option<Given<Scene>>,
    /// The sensor.
    pub sensor: Option<Given<Sensor>>,
}

impl GivenParts {
    /// Checks that a camera file can say all there is to say.
    ///
    /// # Errors
    /// Names the part that is in no file.
    pub fn check_none(&self) -> Result<(), PipelineError> {
        let (lens, sensor) = (self.lens.as_ref().map(|_| "lens"), self.sensor.as_ref().map(|_| "sensor"));
        match lens.or(self.scene.as_ref().map(|_| "scene")).or(sensor) {
            Some(what) => {
                let reason =
                    "it was made in a program and is in no file, so that a camera file cannot name it".to_owned();
                Err(PipelineError::Unsuitable { what, reason })
            }
            None => Ok(()),
        }
    }
}
