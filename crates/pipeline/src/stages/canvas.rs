//! Of which paintings previews of the still life are parts. Those of previews are painted quickly.
//!
//! A film sees the same things in the same directions whatever the field of view of the scene is, as far as that reaches: what depends on it is
//! where the scene ends, and how fine its samples are. So there is one painting for all fields of view, as wide and as fine as the
//! film sees; where that is not known, one a little wider and finer than is wanted.

use std::ops::Range;

use dioptric_scene::{SceneError, View};

use crate::{Quality, still_life::StillLife};

/// Steps to twice the width, the height or the fineness of a canvas.
const STEPS_PER_OCTAVE: f64 = 8.0;

/// Fields of view that are looked at for what they are taken from lie so many steps apart; not a part of a step, where a painting serves one field of view
/// alone.
const STRIDE: f64 = 0.013;

/// Steps to those fields of view that are painted ahead first.
pub(super) const STEPS_AHEAD: f64 = 2.0;

/// The narrowest and the widest field of view that is painted ahead, degrees.
pub(super) const AHEAD_DEG: [f64; 2] = [5.0, 120.0];

/// Of so many columns of the usual picture, one is added on either side in a frame: a film that sees the usual picture sees more of it focused
/// farther, or blurred.
const COLUMNS_PER_MARGIN: usize = 20;

/// Steps to frames of twice the width and half the fineness.
const FRAMES_PER_OCTAVE: i32 = 4;

/// The steps to the narrowest and the widest frame: of 5° and of 132°.
const FRAMES: [i32; 2] = [-11, 11];

/// How a picture of the still life is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Viewing {
    /// The quality of the picture.
    pub(crate) quality: Quality,
    /// The steps from the usual picture to the frame that the film sees nothing beyond and nothing finer than, where that is known.
    pub(crate) frame: Option<i32>,
}

/// What a picture of the still life is taken from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Canvas {
    /// The picture that is painted.
    pub(super) painted: StillLife,
    /// The part of it that the scene is: the picture that was asked for, or what a frame has of it.
    pub(super) shown: StillLife,
}

/// Returns what a preview of the still life is taken from; `None` for a picture that is not worth a painting of its own: a coarse or a full one.
///
/// That is the frame of the usual picture, where it is wide enough and as fine as the picture; else the frame of the film. Where that is not
/// known, it is a painting as wide and as high as the picture and at least as fine, all three in steps of 9 %.
pub(super) fn canvas_of(life: &StillLife, viewing: Viewing) -> Option<Canvas> {
    let columns = viewing.quality.canvas_columns()?;
    if life.columns != columns {
        return None;
    }
    let quick = viewing.quality == Quality::Preview;
    let usual = StillLife { quick, ..frame(columns, 0) };
    if pitch_tan(life) >= pitch_tan(&usual) * (1.0 - 1e-9) && holds(&usual, life) {
        return Some(Canvas { painted: usual, shown: *life });
    }
    let Some(steps) = viewing.frame else {
        return Some(Canvas { painted: StillLife { quick, ..stepped(life, columns) }, shown: *life });
    };
    let painted = StillLife { quick, ..frame(columns, steps) };
    Some(Canvas { painted, shown: if holds(life, &painted) { painted } else { cut(life, &painted) } })
}

/// Returns the narrowest frame that a test of its half size and its pitch (tangents) finds to hold all that a film sees, as steps from the usual picture:
/// of those about a half size of the film itself. `None` where none does, and at qualities that have none.
pub(super) fn frame_that(
    quality: Quality,
    half_size: [f64; 2],
    holds_film: impl Fn([f64; 2], f64) -> bool,
) -> Option<i32> {
    let columns = quality.canvas_columns()?;
    let usual = half_size_tan(&StillLife::new(columns, 2 * columns / 3));
    let times = (half_size[0] / usual[0]).max(half_size[1] / usual[1]);
    let steps = (f64::from(FRAMES_PER_OCTAVE) * times.log2()).round();
    // A film that nothing is known of is as wide as none.
    let [first, last] = FRAMES.map(f64::from);
    if !(first..=last).contains(&steps) {
        return None;
    }
    let steps = steps as i32;
    (steps..=(steps + 1).min(FRAMES[1])).find(|&steps| {
        let frame = frame(columns, steps);
        holds_film(half_size_tan(&frame), pitch_tan(&frame))
    })
}

/// Returns a frame: so many columns of the usual picture made so many steps wider, with a margin.
fn frame(columns: usize, steps: i32) -> StillLife {
    let usual = StillLife::new(columns, 2 * columns / 3);
    let margin = columns / COLUMNS_PER_MARGIN;
    let wider = columns + 2 * margin;
    let pitch = pitch_tan(&usual) * (f64::from(steps) / f64::from(FRAMES_PER_OCTAVE)).exp2();
    let horizontal_fov_deg = 2.0 * (pitch * 0.5 * wider as f64).atan().to_degrees();
    StillLife { columns: wider, rows: usual.rows + 2 * (2 * margin / 3), horizontal_fov_deg, ..usual }
}

/// Returns the picture that is as wide and as high as another and at least as fine, all three in steps of 9 % from the usual one.
fn stepped(life: &StillLife, columns: usize) -> StillLife {
    let usual = StillLife::new(columns, 2 * columns / 3);
    let steps = |factor: f64| STEPS_PER_OCTAVE * factor.log2();
    // A step is not missed by rounding.
    let up = |factor: f64| (steps(factor) - 1e-6).ceil();
    let stretched = |size: f64, n_steps: f64| size * (n_steps / STEPS_PER_OCTAVE).exp2();
    let [width, height] = [0, 1].map(|axis| {
        let [wanted, usual] = [life, &usual].map(|picture| half_size_tan(picture)[axis]);
        stretched(usual, up(wanted / usual))
    });
    let pitch = stretched(pitch_tan(&usual), -up(pitch_tan(&usual) / pitch_tan(life)));
    let count = |half_size: f64| (2.0 * half_size / pitch - 1e-6).ceil();
    let (columns, rows) = (count(width), count(height));
    let horizontal_fov_deg = 2.0 * (0.5 * columns * pitch).atan().to_degrees();
    StillLife { columns: columns as usize, rows: rows as usize, horizontal_fov_deg, ..*life }
}

/// Returns a picture without the outermost rows and columns that lie beyond another.
fn cut(life: &StillLife, within: &StillLife) -> StillLife {
    let (pitch, most) = (pitch_tan(life), half_size_tan(within));
    let left = |n: usize, most: f64| {
        let beyond = (0.5 * n as f64 - most / pitch - 1e-6).ceil().max(0.0);
        n.saturating_sub(2 * beyond as usize).max(1)
    };
    let (columns, rows) = (left(life.columns, most[0]), left(life.rows, most[1]));
    if columns == life.columns {
        return StillLife { rows, ..*life };
    }
    let horizontal_fov_deg = 2.0 * (0.5 * columns as f64 * pitch).atan().to_degrees();
    StillLife { rows, columns, horizontal_fov_deg, ..*life }
}

/// Whether a picture reaches as far as another in width and in height.
fn holds(picture: &StillLife, other: &StillLife) -> bool {
    let (sizes, others) = (half_size_tan(picture), half_size_tan(other));
    sizes.iter().zip(others).all(|(size, other)| other <= size * (1.0 + 1e-9))
}

/// Returns the tangents of the angles from the axis to the right and to the upper edge of a picture.
pub(super) fn half_size_tan(life: &StillLife) -> [f64; 2] {
    [life.columns, life.rows].map(|n| 0.5 * n as f64 * pitch_tan(life))
}

/// Returns the distance between the samples of a picture as a tangent.
pub(super) fn pitch_tan(life: &StillLife) -> f64 {
    2.0 * (0.5 * life.horizontal_fov_deg).to_radians().tan() / life.columns as f64
}

/// Returns where the samples of a picture lie.
pub(super) fn view_of(life: &StillLife) -> Result<View, SceneError> {
    View::from_horizontal_fov_deg(life.horizontal_fov_deg, life.columns, life.rows)
}

/// Returns the pictures that previews of fields of view in a range are taken from, but for this one's own: those of the nearest fields of view first. The ends
/// of the range do not belong to it.
pub(super) fn canvases_within(life: &StillLife, viewing: Viewing, range: Range<f64>) -> Vec<StillLife> {
    let own = steps_of(life.horizontal_fov_deg);
    let painting_of = |life: &StillLife| canvas_of(life, viewing).map(|canvas| canvas.painted);
    let mut canvases = vec![painting_of(life)];
    let mut n_steps = STRIDE;
    while n_steps < (own - range.start).max(range.end - own) {
        for steps in
            [own - n_steps, own + n_steps].into_iter().filter(|steps| range.start < *steps && *steps < range.end)
        {
            let canvas = painting_of(&StillLife { horizontal_fov_deg: fov_deg_at(steps), ..*life });
            if !canvases.contains(&canvas) {
                canvases.push(canvas);
            }
        }
        n_steps += STRIDE;
    }
    canvases.into_iter().skip(1).flatten().collect()
}

/// Returns the steps from a field of view of 90° to another.
pub(super) fn steps_of(fov_deg: f64) -> f64 {
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

    fn viewing(quality: Quality) -> Viewing {
        Viewing { quality, frame: None }
    }

    #[test]
    fn the_usual_picture_is_a_part_of_its_frame() {
        let canvas = |life: &StillLife, quality| canvas_of(life, viewing(quality));
        for (quality, columns, size) in [(Quality::Preview, 540, (594, 396)), (Quality::Sketch, 180, (198, 132))] {
            let usual = StillLife::new(columns, 2 * columns / 3);
            let Canvas { painted, shown } = canvas(&usual, quality).unwrap();
            assert_eq!((shown, (painted.columns, painted.rows)), (usual, size));
            assert_eq!(painted.quick, quality == Quality::Preview);
            // Its samples are those of the usual picture.
            assert!((pitch_tan(&painted) / pitch_tan(&usual) - 1.0).abs() < 1e-12);
        }
        // Of a full or a coarse picture there is none.
        assert_eq!(canvas(&StillLife::new(1080, 720), Quality::Full), None);
        assert_eq!(canvas(&StillLife::new(480, 320), Quality::Preview), None);
    }

    #[test]
    fn one_painting_serves_all_fields_of_view() {
        let within = Viewing { quality: Quality::Preview, frame: Some(0) };
        let usual = canvas_of(&preview(34.0, 360), within).unwrap().painted;
        for tenth in 50..1600 {
            let life = preview(0.1 * f64::from(tenth), 360);
            let Canvas { painted, shown } = canvas_of(&life, within).unwrap();
            assert_eq!(painted, usual);
            assert_eq!(shown, if life.horizontal_fov_deg < usual.horizontal_fov_deg { life } else { usual });
        }
        // Wider than the painting, and lower; and the other way round.
        for (strip, is_lower) in [(preview(60.0, 100), true), (preview(20.0, 900), false), (preview(37.5, 350), true)] {
            let Canvas { painted, shown } = canvas_of(&strip, within).unwrap();
            assert_eq!(painted, usual);
            let (size, shown_size) = ([strip.columns, strip.rows], [shown.columns, shown.rows]);
            let (cut, kept) = if is_lower { (0, 1) } else { (1, 0) };
            assert!(size[kept] == shown_size[kept] && size[cut] > shown_size[cut], "{shown:?}");
            // No more is cut than must be, and evenly.
            let over = (half_size_tan(&usual)[cut] - half_size_tan(&shown)[cut]) / pitch_tan(&shown);
            assert!((-1e-5..1.0).contains(&over) && (size[cut] - shown_size[cut]) % 2 == 0, "{over} samples");
            assert!((pitch_tan(&shown) / pitch_tan(&strip) - 1.0).abs() < 1e-12);
        }
        assert_eq!(canvases_within(&preview(34.0, 360), within, -30.0..30.0), []);
    }

    #[test]
    fn every_film_of_the_usual_shape_has_a_frame() {
        for part in 0..1000 {
            let half_width = 0.05 * 1.0036_f64.powi(part);
            // What is seen of a film of 480 columns, blurred by a two-hundredth of its width, and no finer than its samples by 5 %.
            let holds = |half_size: [f64; 2], pitch: f64| {
                let blur = 0.01 * half_width;
                let is_wide = half_size[0] > half_width + blur && half_size[1] > half_width / 1.5 + blur;
                is_wide && pitch < 1.05 * half_width / 240.0
            };
            let steps = frame_that(Quality::Preview, [half_width, half_width / 1.5], holds).unwrap();
            let viewing = Viewing { quality: Quality::Preview, frame: Some(steps) };
            // One painting for all fields of view but those that the usual one serves.
            let usual = canvas_of(&preview(34.0, 360), viewing).unwrap().painted;
            let framed = canvas_of(&preview(150.0, 360), viewing).unwrap().painted;
            assert_eq!((framed.columns, framed.rows), (594, 396));
            for tenth in 50..1600 {
                let life = preview(0.1 * f64::from(tenth), 360);
                let painted = canvas_of(&life, viewing).unwrap().painted;
                assert!(painted == framed || painted == usual, "{life:?}");
            }
        }
        // Nothing is known of a film that is infinitely wide, or has no width.
        for width in [f64::INFINITY, f64::NAN, 0.0, 1e-9] {
            assert_eq!(frame_that(Quality::Preview, [width; 2], |_, _| true), None);
        }
        assert_eq!(frame_that(Quality::Full, [0.3, 0.2], |_, _| true), None);
    }

    #[test]
    fn canvases_cover_what_is_wanted_and_little_more() {
        for tenth in 50..1600 {
            for rows in [100, 300, 360, 405, 960] {
                let life = preview(0.1 * f64::from(tenth), rows);
                let canvas = canvas_of(&life, viewing(Quality::Preview)).unwrap().painted;
                let finer = pitch_tan(&life) / pitch_tan(&canvas);
                if (canvas.columns, canvas.rows) == (594, 396) {
                    assert!(holds(&canvas, &life) && finer > 1.0 - 1e-9, "{life:?}: {finer} times as fine");
                    continue;
                }
                assert!((1.0 - 1e-9..1.091).contains(&finer), "{life:?}: {finer} times as fine");
                let (painted, wanted) = (half_size_tan(&canvas), half_size_tan(&life));
                for over in [painted[0] / wanted[0], painted[1] / wanted[1]] {
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
        let canvas = |fov_deg, rows| canvas_of(&preview(fov_deg, rows), viewing(Quality::Preview)).unwrap().painted;
        for tenth in 60..1500 {
            for (rows, most) in [(360, 5), (405, 9), (100, 9)] {
                let fov_deg = 0.1 * f64::from(tenth);
                let own = steps_of(fov_deg);
                let ahead = own - STEPS_AHEAD..own + STEPS_AHEAD;
                let mut known = canvases_within(&preview(fov_deg, rows), viewing(Quality::Preview), ahead);
                assert!(known.len() <= most, "{fov_deg}°, {rows} rows: {known:?}");
                known.push(canvas(fov_deg, rows));
                let tan = (0.5 * fov_deg).to_radians().tan();
                for percent in 86..=118 {
                    let other_deg = 2.0 * (0.01 * f64::from(percent) * tan).atan().to_degrees();
                    assert!(known.contains(&canvas(other_deg, rows)), "{fov_deg}° and {other_deg}°, {rows} rows");
                }
            }
        }
        assert_eq!(canvases_within(&StillLife::new(1080, 720), viewing(Quality::Full), -8.0..8.0), []);
    }

    #[test]
    fn all_that_is_painted_ahead_is_a_few_paintings() {
        let [narrowest, widest] = AHEAD_DEG.map(steps_of);
        for fov_deg in [5.1, 34.0, 47.3, 119.0] {
            let life = preview(fov_deg, 360);
            let mut known = canvases_within(&life, viewing(Quality::Preview), narrowest..widest);
            let distance = |canvas: &StillLife| (steps_of(canvas.horizontal_fov_deg) - steps_of(fov_deg)).abs();
            // Whole canvases apart, the next is farther off by a step at most.
            assert!(known.windows(2).all(|pair| distance(&pair[1]) > distance(&pair[0]) - 2.0), "{known:?}");
            known.push(canvas_of(&life, viewing(Quality::Preview)).unwrap().painted);
            assert!(known.len() <= 48, "{}", known.len());
            for other in (51..1199).map(|tenth| preview(0.1 * f64::from(tenth), 360)) {
                let canvas = canvas_of(&other, viewing(Quality::Preview)).unwrap().painted;
                assert!(known.contains(&canvas), "{fov_deg}° and {other:?}");
            }
        }
    }

    #[test]
    fn neighbors_share_a_canvas() {
        let canvas = |fov_deg, rows| canvas_of(&preview(fov_deg, rows), viewing(Quality::Preview)).unwrap().painted;
        assert_eq!(canvas(36.0, 360), canvas(36.7, 360));
        assert_eq!(canvas(42.0, 360), canvas(42.9, 360));
        assert_eq!(canvas(36.0, 420), canvas(36.0, 430));
        assert_ne!(canvas(36.0, 360), canvas(42.0, 360));
    }
}
