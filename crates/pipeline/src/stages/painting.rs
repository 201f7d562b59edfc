//! The still life as previews see it: painted on a canvas from which others are taken, so that another light, another field of view or another
//! shape paints nothing.

use dioptric_scene::Scene;
use dioptric_spectrum::WavelengthGrid;

use super::{
    Watch,
    canvas::{AHEAD_DEG, STEPS_AHEAD, Viewing, canvas_of, canvases_within, steps_of, view_of},
    slot::Slot,
};
use crate::{PaintingFolder, PipelineError, Stage, still_life::StillLife};

/// A picture of the still life on these bands.
pub(crate) type PaintingInputs = (StillLife, WavelengthGrid);

/// Of which fields of view the still life is painted ahead.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PaintReach {
    /// Those narrower or wider than the camera's by up to 19 %.
    Next,
    /// These, and all from 5° to 120° where paintings are kept in a folder; the nearest first.
    All,
}

/// Where paintings come from.
#[derive(Clone, Copy)]
pub(super) struct Paintings<'a> {
    /// Those of previews.
    pub(super) kept: &'a Slot<PaintingInputs, Scene>,
    /// Those of earlier runs.
    pub(super) folder: Option<&'a PaintingFolder>,
}

impl Paintings<'_> {
    /// Returns the still life, painted now where it is not kept; where it is wider than the film of a preview sees, what that sees of it.
    pub(super) fn scene(
        &self,
        life: &StillLife,
        grid: &WavelengthGrid,
        viewing: Viewing,
        watch: &Watch<'_>,
    ) -> Result<Scene, PipelineError> {
        let Some(canvas) = canvas_of(life, viewing) else { return self.painted(life, grid, watch) };
        let make = |(painted, grid): &PaintingInputs| self.painted(painted, grid, watch);
        let painting = self.kept.get_or_make((canvas.painted, grid.clone()), make)?;
        let shown = canvas.shown;
        let mut scene = match shown == canvas.painted {
            true => (*painting).clone(),
            false => watch.run(move || Ok(painting.reframed(view_of(&shown)?, shown.rows, shown.columns)?))?,
        };
        if shown.horizontal_fov_deg < life.horizontal_fov_deg {
            let (wide, part) = (life.horizontal_fov_deg, shown.horizontal_fov_deg);
            let note = format!("of the {wide:.1}° of the still life a preview has {part:.1}°, more than the film sees");
            scene.notes.push(note);
        }
        Ok(scene)
    }

    /// Paints what the still life is taken from in other fields of view, where that is not kept.
    pub(super) fn paint_ahead(
        &self,
        (life, grid): &PaintingInputs,
        viewing: Viewing,
        reach: PaintReach,
        watch: &Watch<'_>,
    ) -> Result<(), PipelineError> {
        let own = steps_of(life.horizontal_fov_deg);
        for canvas in canvases_within(life, viewing, own - STEPS_AHEAD..own + STEPS_AHEAD) {
            self.kept.get_or_make((canvas, grid.clone()), |(canvas, grid)| self.painted(canvas, grid, watch))?;
        }
        let Some(folder) = self.folder.filter(|_| reach == PaintReach::All) else { return Ok(()) };
        let [narrowest, widest] = AHEAD_DEG.map(steps_of);
        for canvas in canvases_within(life, viewing, narrowest..widest) {
            if canvas.is_lacked_by(folder, grid)? {
                self.painted(&canvas, grid, watch)?;
                if canvas.is_lacked_by(folder, grid)? {
                    // It takes no file: what else is painted would be painted again each time.
                    break;
                }
            }
        }
        Ok(())
    }

    fn painted(&self, life: &StillLife, grid: &WavelengthGrid, watch: &Watch<'_>) -> Result<Scene, PipelineError> {
        let report = |part| watch.progress.at(Stage::Scene, part);
        let (cancel, folder, life, grid) = (watch.cancel.clone(), self.folder.cloned(), *life, grid.clone());
        watch.run_reporting(&report, move |progress| life.scene(&grid, folder.as_ref(), progress, &cancel))
    }
}
