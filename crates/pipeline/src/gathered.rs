//! Views of worlds that are gathered: clean at once, and kept from run to run.

use std::sync::Arc;

use dioptric_backward::{GatheredView, Pinhole, ViewDetail, gathered_view};
use dioptric_spectrum::{Cancel, WavelengthGrid};
use dioptric_world::World;

use crate::{PaintingFolder, PipelineError, paintings::ViewKey};

/// What is gathered: a world, and who looks at it how.
#[derive(Clone, Debug)]
pub(crate) struct GatheredPicture {
    pub(crate) world: Arc<World>,
    /// Words that differ between worlds.
    pub(crate) world_words: String,
    pub(crate) view: Pinhole,
    pub(crate) grid: WavelengthGrid,
    pub(crate) detail: ViewDetail,
    pub(crate) seed: u64,
}

impl GatheredPicture {
    /// Returns the view, from a folder where it is kept there; `progress` gets the part that is done, 0–1, from any thread.
    ///
    /// # Errors
    /// When the view makes no sense, or the work is cancelled.
    pub(crate) fn seen(
        &self,
        folder: Option<&PaintingFolder>,
        progress: &(dyn Fn(f64) + Sync),
        cancel: &Cancel,
    ) -> Result<GatheredView, PipelineError> {
        let gather =
            || Ok(gathered_view(&self.world, &self.view, &self.grid, (self.detail, self.seed), progress, cancel)?);
        match folder {
            Some(folder) => folder.view(&self.key(), gather),
            None => gather(),
        }
    }

    /// Returns what a folder keeps it by.
    pub(crate) fn key(&self) -> ViewKey {
        let Self { world_words, view, grid, detail, seed, .. } = self;
        let (rows, columns) = view.pixels.size();
        ViewKey { words: format!("{world_words} {view:?} {detail:?} {seed}"), rows, columns, grid: grid.clone() }
    }
}
