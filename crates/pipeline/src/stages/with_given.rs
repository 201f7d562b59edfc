//! A camera with parts that a program made, and with what a capture holds kept.

use std::path::PathBuf;

use dioptric_optics::LensFile;
use dioptric_scene::Scene;
use dioptric_sensor::Sensor;

use super::{
    capture::Capture,
    given::{Given, GivenParts},
    kept::KeptCamera,
};
use crate::{Camera, LensReadOptions, LensSpec, SceneSource, SensorSpec, StopSpec};

/// What stands in a camera in place of a file's path.
fn in_memory(name: &str) -> PathBuf {
    PathBuf::from(format!("(in memory) {name}"))
}

impl KeptCamera {
    /// The parts that a program made.
    pub fn given(&self) -> &GivenParts {
        &self.given
    }

    /// Returns the camera with a lens that a program made, its stop as it is set; what is kept is shared.
    ///
    /// ```
    /// use dioptric_optics::{Lens, LensFile};
    /// use dioptric_pipeline::{Camera, Given, KeptCamera};
    ///
    /// let lens = Given::new(LensFile::from(Lens::thin(50.0, 10.0)?));
    /// let kept = KeptCamera::new(Camera::demo()?).with_given_lens(lens);
    /// assert!(kept.given().lens.is_some() && kept.given().check_none().is_err());
    /// # Ok::<(), dioptric_pipeline::PipelineError>(())
    /// ```
    #[must_use]
    pub fn with_given_lens(&self, lens: Given<LensFile>) -> Self {
        let mut changed = self.with(|camera| {
            camera.lens = LensSpec::File(in_memory(lens.lens.name()));
            camera.lens_reading = LensReadOptions::default();
            (camera.stop, camera.iris) = (StopSpec::AsGiven, None);
        });
        changed.given.lens = Some(lens);
        changed
    }

    /// Returns the camera with a scene that a program made; what is kept is shared.
    ///
    /// The scene must have a depth and a view, or the camera file must give them.
    #[must_use]
    pub fn with_given_scene(&self, scene: Given<Scene>) -> Self {
        let mut changed = self.with(|camera| camera.scene.source = SceneSource::File(in_memory(&scene.name)));
        changed.given.scene = Some(scene);
        changed
    }

    /// Returns the camera with a sensor that a program made; what is kept is shared.
    #[must_use]
    pub fn with_given_sensor(&self, sensor: Given<Sensor>) -> Self {
        let mut changed = self.with(|camera| camera.sensor = SensorSpec::File(in_memory(&sensor.name)));
        changed.given.sensor = Some(sensor);
        changed
    }

    /// Returns another camera that shares what is kept.
    #[must_use]
    pub fn with_camera(&self, camera: Camera, given: GivenParts) -> Self {
        let mut changed = self.with(|own| *own = camera);
        changed.given = given;
        changed
    }

    /// Keeps the irradiance of a capture, and what the stages after it need, as what was asked for last, so that a change of
    /// exposure, sensor or processing of its camera images nothing, however many cameras were asked since.
    pub fn keep(&self, capture: &Capture) {
        let (electrons, results) = (&capture.inputs, self.results());
        let irradiance = &electrons.irradiance;
        let film = &irradiance.plan.bank.film;
        results.lens.put_shared(film.lens.clone(), capture.lens.clone());
        results.film.put_shared(film.clone(), capture.place.clone());
        results.summary.put_shared(irradiance.scene.clone(), capture.scene.clone());
        results.irradiance.put_shared(irradiance.clone(), capture.irradiance.clone());
        results.electrons.put_shared(electrons.clone(), capture.rates.clone());
    }
}
