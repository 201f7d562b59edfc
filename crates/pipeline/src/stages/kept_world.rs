//! A kept camera before a world.

use std::sync::Arc;

use dioptric_forward::check_depth_map;
use dioptric_spectrum::{Cancel, Quantity, SpectralImage};
use dioptric_world::World;
use ndarray::Array2;

use super::{
    chain::Chain,
    irradiance::Irradiance,
    kept::KeptCamera,
    lens::check_glasses,
    spec::{GeometryInputs, IrradianceInputs, SceneInputs},
    world::WorldRender,
    world_level,
};
use crate::{PipelineError, Progress};

impl KeptCamera {
    /// Returns the world before the camera, read now where it is not kept.
    ///
    /// # Errors
    /// When the scene is no world, or its files cannot be read.
    pub fn world(&self, progress: &dyn Progress, cancel: &Cancel) -> Result<Arc<World>, PipelineError> {
        let scene = SceneInputs::of(&self.camera, &self.given, self.quality);
        let chain = self.chain(progress, cancel);
        chain.world(&scene.geometry)
    }

    /// Returns the world before the camera as its lens sees it, to be rendered pass by pass.
    ///
    /// # Errors
    /// When the scene is no world, or as [`capture`](Self::capture).
    pub fn world_render(&self, progress: &dyn Progress, cancel: &Cancel) -> Result<WorldRender, PipelineError> {
        self.camera.validate()?;
        let inputs = self.irradiance_inputs()?;
        if self.camera.scene.points.is_some() {
            let reason = "are met by no ray from the film, expected none: 'run' images them".to_owned();
            return Err(PipelineError::Unsuitable { what: "points", reason });
        }
        let chain = self.chain(progress, cancel);
        let resolved = chain.scene(&inputs.scene)?;
        let lens = chain.lens(&inputs.plan.bank.film.lens)?;
        // What is too near for the lens is found before the work.
        let grid = resolved.scene.radiance.grid();
        check_glasses(&lens, Some(grid))?;
        check_depth_map(&lens.lens, grid, resolved.scene.require_depth()?)?;
        chain.world_render(&inputs)
    }

    /// Returns the object that the middle of each pixel sees of the world before the camera, by number plus 1, 0 for none; and the names of the
    /// objects.
    ///
    /// # Errors
    /// When the scene is no world, or as [`capture`](Self::capture).
    pub fn objects(
        &self,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> Result<(Array2<u32>, Vec<String>), PipelineError> {
        let names = self.world(progress, cancel)?.object_names().to_vec();
        let inputs = self.irradiance_inputs()?;
        let render = self.chain(progress, cancel).world_render(&inputs)?;
        Ok((render.auxiliary(cancel)?.object.mapv(|number| number as u32), names))
    }

    /// Whether the irradiance on the film is kept, so that a capture starts behind it.
    ///
    /// # Errors
    /// When the sensor cannot be read.
    pub fn has_irradiance(&self) -> Result<bool, PipelineError> {
        Ok(self.kept.irradiance.get(&self.irradiance_inputs()?).is_some())
    }

    /// Keeps a rendered picture as the irradiance of this camera, brought to the mean illuminance that it asks for, so that a capture starts
    /// behind it.
    ///
    /// # Errors
    /// When the picture is no irradiance on the film of this camera.
    pub fn keep_irradiance(&self, picture: SpectralImage) -> Result<(), PipelineError> {
        let inputs = self.irradiance_inputs()?;
        let (quantity, pitch_um) = (picture.quantity(), picture.pitch_um());
        let Some(pitch_um) = pitch_um.filter(|_| quantity == Quantity::Irradiance) else {
            let reason = format!("its unit is {}, expected an irradiance on pixels of a known pitch", quantity.unit());
            return Err(PipelineError::Unsuitable { what: "the picture", reason });
        };
        let irradiance = Irradiance::of_image(picture, pitch_um).with_mean_lux(inputs.mean_lux)?;
        self.kept.irradiance.put(inputs, irradiance);
        Ok(())
    }
}

impl Chain<'_> {
    pub(super) fn world(&self, geometry: &GeometryInputs) -> Result<Arc<World>, PipelineError> {
        let Some((inputs, _)) = geometry.world() else {
            let reason = "it is no world, expected 'source: World((file: ...))'".to_owned();
            return Err(PipelineError::Unsuitable { what: "scene", reason });
        };
        self.kept.world.get_or_make(inputs, |inputs| world_level::read_at_level(inputs, &self.watch))
    }

    pub(super) fn world_render(&self, inputs: &IrradianceInputs) -> Result<WorldRender, PipelineError> {
        let film = &inputs.plan.bank.film;
        if film.lens.psfs.is_some() {
            let reason =
                "rays from the film cannot go through them, expected none for a world with method: Backward".to_owned();
            return Err(PipelineError::Unsuitable { what: "psfs", reason });
        }
        let world = self.world(&inputs.scene.geometry)?;
        let grid = self.summary(&inputs.scene)?.grid()?;
        let (lens, place) = (self.lens(&film.lens)?, self.film(film, &inputs.scene)?);
        WorldRender::through_lens(world, inputs, (&lens, &place), grid)
    }
}
