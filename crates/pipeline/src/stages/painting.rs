//! The still life as previews see it: painted once, a little wider and finer than it is wanted, so that another light, another field of view
//! or another shape paints nothing. Those of previews are painted quickly.

use std::ops::Range;

use dioptric_scene::{Scene, StillLife, View};
use dioptric_spectrum::WavelengthGrid;

use super::{Watch, slot::Slot};
use crate::{PaintingFolder, PipelineError, Quality, Stage};

/// A picture of the still life on these bands.
pub(crate) type PaintingInputs = (StillLife, WavelengthGrid);

/// Steps to twice the width, the height or the fineness of a canvas.
const STEPS_PER_OCTAVE: f64 = 8.0;

/// Steps to those fields of view that are painted ahead first.
const STEPS_AHEAD: f64 = 2.0;

/// Fields of view that are looked at for what they are taken from lie so many steps apart; not a part of a step, where a painting serves one field of view
/// alone.
const STRIDE: f64 = 0.013;

/// The narrowest and the widest field of view that is painted ahead, degrees.
const AHEAD_DEG: [f64; 2] = [5.0, 120.0];

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
    /// Returns the still life, painted now where it is not kept.
    pub(super) fn scene(
        &self,
        life: &StillLife,
        grid: &WavelengthGrid,
        quality: Quality,
        watch: &Watch<'_>,
    ) -> Result<Scene, PipelineError> {
        let Some(canvas) = canvas_of(life, quality) else { return self.painted(life, grid, watch) };
        let make = |(canvas, grid): &PaintingInputs| self.painted(canvas, grid, watch);
        let painting = self.kept.get_or_make((canvas, grid.clone()), make)?;
        if canvas == *life {
            return Ok((*painting).clone());
        }
        let StillLife { rows, columns, horizontal_fov_deg, .. } = *life;
        let view = View::from_horizontal_fov_deg(horizontal_fov_deg, columns, rows)?;
        watch.run(move || Ok(painting.reframed(view, rows, columns)?))
    }

    /// Paints what the still life is taken from in other fields of view, where that is not kept.
    pub(super) fn paint_ahead(
        &self,
        (life, grid): &PaintingInputs,
        quality: Quality,
        reach: PaintReach,
        watch: &Watch<'_>,
    ) -> Result<(), PipelineError> {
        let own = steps_of(life.horizontal_fov_deg);
        for canvas in canvases_within(life, quality, own - STEPS_AHEAD..own + STEPS_AHEAD) {
            self.kept.get_or_make((canvas, grid.clone()), |(canvas, grid)| self.painted(canvas, grid, watch))?;
        }
        let Some(folder) = self.folder.filter(|_| reach == PaintReach::All) else { return Ok(()) };
        let [narrowest, widest] = AHEAD_DEG.map(steps_of);
        for canvas in canvases_within(life, quality, narrowest..widest) {
            if folder.lacks(&canvas, grid) {
                self.painted(&canvas, grid, watch)?;
                if folder.lacks(&canvas, grid) {
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
        watch.run_reporting(&report, move |progress| match folder {
            Some(folder) => folder.scene(&life, &grid, progress, &cancel),
            None => Ok(life.scene_with(&grid, progress, &cancel)?),
        })
    }
}

/// Returns the picture that a preview of the still life is taken from: as wide and as high as it and at least as fine, all three in steps of
/// 9 %; the picture that the arrangement is made for is its own. `None` for a picture that is not worth one: a coarse or a full one.
fn canvas_of(life: &StillLife, quality: Quality) -> Option<StillLife> {
    let columns = quality.canvas_columns()?;
    if life.columns != columns || life.with_hidden || life.moved_m != [0.0; 3] {
        return None;
    }
    let usual = StillLife::new(columns, 2 * columns / 3);
    let half_width = |life: &StillLife| (0.5 * life.horizontal_fov_deg).to_radians().tan();
    let half_height = |life: &StillLife| half_width(life) * life.rows as f64 / life.columns as f64;
    let steps = |factor: f64| STEPS_PER_OCTAVE * factor.log2();
    // A step is not missed by rounding.
    let up = |factor: f64| (steps(factor) - 1e-6).ceil();
    let stretched = |size: f64, n_steps: f64| size * (n_steps / STEPS_PER_OCTAVE).exp2();
    let width = stretched(half_width(&usual), up(half_width(life) / half_width(&usual)));
    let height = stretched(half_height(&usual), up(half_height(life) / half_height(&usual)));
    let finer = up(half_width(&usual) / half_width(life));
    let samples_per_tan = stretched(0.5 * columns as f64 / half_width(&usual), finer);
    let count = |half_size: f64| (2.0 * half_size * samples_per_tan - 1e-6).ceil();
    let (columns, rows) = (count(width), count(height));
    let horizontal_fov_deg = 2.0 * (0.5 * columns / samples_per_tan).atan().to_degrees();
    let canvas = StillLife { columns: columns as usize, rows: rows as usize, horizontal_fov_deg, ..*life };
    let is_usual = (canvas.columns, canvas.rows) == (usual.columns, usual.rows) && finer == 0.0;
    Some(StillLife { quick: quality == Quality::Preview, ..if is_usual { usual } else { canvas } })
}

/// Returns the pictures that previews of fields of view in a range are taken from, but for this one's own: those of the nearest fields of view first. The ends
/// of the range do not belong to it.
fn canvases_within(life: &StillLife, quality: Quality, range: Range<f64>) -> Vec<StillLife> {
    let own = steps_of(life.horizontal_fov_deg);
    let mut canvases = vec![canvas_of(life, quality)];
    let mut n_steps = STRIDE;
    while n_steps < (own - range.start).max(range.end - own) {
        for steps in
            [own - n_steps, own + n_steps].into_iter().filter(|steps| range.start < *steps && *steps < range.end)
        {
            let canvas = canvas_of(&StillLife { horizontal_fov_deg: fov_deg_at(steps), ..*life }, quality);
            if !canvases.contains(&canvas) {
                canvases.push(canvas);
            }
        }
        n_steps += STRIDE;
    }
    canvases.into_iter().skip(1).flatten().collect()
}

/// Returns the steps from a field of view of 90° to another.
fn steps_of(fov_deg: f64) -> f64 {
    STEPS_PER_OCTAVE * (0.5 * fov_deg).to_radians().tan().log2()
}

/// Returns the field of view so many steps from 90°.
fn fov_deg_at(n_steps: f64) -> f64 {
    2.0 * (n_steps / STEPS_PER_OCTAVE).exp2().atan().to_degrees()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn preview(fov_deg: f64, rows: usize) -> StillLife {
        StillLife { horizontal_fov_deg: fov_deg, ..StillLife::new(540, rows) }
    }

    #[test]
    fn the_picture_of_the_arrangement_is_its_own_canvas() {
        let quick = StillLife { quick: true, ..StillLife::new(540, 360) };
        assert_eq!(canvas_of(&StillLife::new(540, 360), Quality::Preview), Some(quick));
        assert_eq!(canvas_of(&StillLife::new(180, 120), Quality::Sketch), Some(StillLife::new(180, 120)));
        // Of a full or a coarse picture there is none.
        assert_eq!(canvas_of(&StillLife::new(1080, 720), Quality::Full), None);
        assert_eq!(canvas_of(&StillLife::new(480, 320), Quality::Preview), None);
    }

    #[test]
    fn canvases_cover_what_is_wanted_and_little_more() {
        for tenth in 50..1600 {
            for rows in [100, 300, 360, 405, 960] {
                let life = preview(0.1 * f64::from(tenth), rows);
                let canvas = canvas_of(&life, Quality::Preview).unwrap();
                let tan = |life: &StillLife| (0.5 * life.horizontal_fov_deg).to_radians().tan();
                let pitch = |life: &StillLife| 2.0 * tan(life) / life.columns as f64;
                let height = |life: &StillLife| pitch(life) * life.rows as f64;
                let finer = pitch(&life) / pitch(&canvas);
                assert!((1.0 - 1e-9..1.091).contains(&finer), "{life:?}: {finer} times as fine");
                for over in [tan(&canvas) / tan(&life), height(&canvas) / height(&life)] {
                    // And one sample for rounding up.
                    assert!(
                        (1.0 - 1e-9..1.091 * (1.0 + 1.2 / 100.0)).contains(&over),
                        "{life:?}: {over} times as large"
                    );
                }
            }
        }
    }

    #[test]
    fn what_is_painted_ahead_serves_the_next_fields_of_view() {
        let canvas = |fov_deg, rows| canvas_of(&preview(fov_deg, rows), Quality::Preview).unwrap();
        for tenth in 60..1500 {
            for (rows, most) in [(360, 5), (405, 9), (100, 9)] {
                let fov_deg = 0.1 * f64::from(tenth);
                let own = steps_of(fov_deg);
                let ahead = own - STEPS_AHEAD..own + STEPS_AHEAD;
                let mut known = canvases_within(&preview(fov_deg, rows), Quality::Preview, ahead);
                assert!(known.len() <= most, "{fov_deg}°, {rows} rows: {known:?}");
                known.push(canvas(fov_deg, rows));
                let tan = (0.5 * fov_deg).to_radians().tan();
                for percent in 86..=118 {
                    let other_deg = 2.0 * (0.01 * f64::from(percent) * tan).atan().to_degrees();
                    assert!(known.contains(&canvas(other_deg, rows)), "{fov_deg}° and {other_deg}°, {rows} rows");
                }
            }
        }
        assert_eq!(canvases_within(&StillLife::new(1080, 720), Quality::Full, -8.0..8.0), []);
    }

    #[test]
    fn all_that_is_painted_ahead_is_a_few_paintings() {
        let [narrowest, widest] = AHEAD_DEG.map(steps_of);
        for fov_deg in [5.1, 34.0, 47.3, 119.0] {
            let life = preview(fov_deg, 360);
            let mut known = canvases_within(&life, Quality::Preview, narrowest..widest);
            let distance = |canvas: &StillLife| (steps_of(canvas.horizontal_fov_deg) - steps_of(fov_deg)).abs();
            // Whole canvases apart, the next is farther off by a step at most.
            assert!(known.windows(2).all(|pair| distance(&pair[1]) > distance(&pair[0]) - 2.0), "{known:?}");
            known.push(canvas_of(&life, Quality::Preview).unwrap());
            assert!(known.len() <= 48, "{}", known.len());
            for other in (51..1199).map(|tenth| preview(0.1 * f64::from(tenth), 360)) {
                let canvas = canvas_of(&other, Quality::Preview).unwrap();
                // The picture of the arrangement serves its own field of view alone.
                assert!(known.contains(&canvas) || other.horizontal_fov_deg == 34.0, "{fov_deg}° and {other:?}");
            }
        }
    }

    #[test]
    fn neighbors_share_a_canvas() {
        let canvas = |fov_deg, rows| canvas_of(&preview(fov_deg, rows), Quality::Preview).unwrap();
        assert_eq!(canvas(36.0, 360), canvas(36.7, 360));
        assert_eq!(canvas(36.0, 370), canvas(36.0, 400));
        assert_ne!(canvas(36.0, 360), canvas(42.0, 360));
    }
}
