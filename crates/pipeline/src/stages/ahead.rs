//! What is painted before it is asked for.

use super::{
    chain::Chain,
    painting::{PaintReach, PaintingInputs},
    spec::{GeometryInputs, SceneInputs},
};
use crate::{PipelineError, SceneSource, camera::bands_or_own};

impl Chain<'_> {
    /// Paints what previews of the still life need in other fields of view; nothing of any other scene.
    pub(super) fn paint_ahead(&self, inputs: &SceneInputs, reach: PaintReach) -> Result<(), PipelineError> {
        let Some(painting) = painting_of(inputs)? else { return Ok(()) };
        self.paintings().paint_ahead(&painting, inputs.geometry.viewing(), reach, &self.watch)
    }
}

/// Returns the picture of the built-in still life that a quality asks for, and its bands; `None` for any other scene.
fn painting_of(inputs: &SceneInputs) -> Result<Option<PaintingInputs>, PipelineError> {
    let GeometryInputs { source, wavelengths, quality, given, .. } = &inputs.geometry;
    let SceneSource::StillLife { columns, rows } = source else { return Ok(None) };
    if given.is_some() {
        return Ok(None);
    }
    let binning = quality.scene_binning(*columns);
    let fewer = |n: usize| (n / binning).max(1);
    let bands = quality.bands_of(&bands_or_own(wavelengths.grid()?.as_ref())?)?;
    Ok(Some((inputs.choice().still_life(fewer(*columns), fewer(*rows)), bands)))
}
