//! Smoothing of sampled light over the pixels of one surface.

use dioptric_spectrum::{Cancel, Cancelled};
use glam::DVec3;
use rayon::prelude::*;

use super::world::Seen;

/// Numbers of light a pixel: by day and by lamp straight from the lights, then sheen, then light bounced.
pub(super) const N_LIGHTS: usize = 14;
/// The first number of sheen: by day and by lamp, each by tone.
pub(super) const SHEEN: usize = 2;
/// The first number of light bounced, likewise; these are smoothed more.
pub(super) const BOUNCE: usize = 8;

/// The surface that fills most of a pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Guide {
    pub(super) object: u32,
    pub(super) point: DVec3,
    pub(super) normal: DVec3,
}

impl Guide {
    pub(super) fn of(seen: &Seen) -> Self {
        Self { object: seen.object as u32, point: seen.point, normal: seen.normal }
    }
}

/// Light on each pixel's surface.
pub(super) type Lights = [f32; N_LIGHTS];

/// Passes of smoothing: how far apart the pixels of a window are, and the first number that takes part.
///
/// A 5 × 5 binomial window each, in which a pixel of another object, another slope or off the plane does not count
/// (Dammertz et al. 2010).
pub(super) type Passes = [(usize, usize); N_PASSES];

const N_PASSES: usize = 3;

/// Those for light on each pixel. Only bounced light takes part in the third.
pub(super) const PASSES: Passes = [(1, 0), (2, 0), (4, BOUNCE)];

/// Light on the rows of a picture, which come one after another, with the noise of its samples smoothed away and the edges of
/// surfaces kept; a row is smoothed as soon as those about it are there.
pub(super) struct Smoothing {
    /// By row; empty where a row has not come yet or is forgotten.
    guides: Vec<Vec<Guide>>,
    /// Likewise, as gathered and after each pass.
    lights: [Vec<Vec<Lights>>; N_PASSES + 1],
    /// How many rows are there, as gathered and after each pass.
    n_ready: [usize; N_PASSES + 1],
    passes: Passes,
}

impl Smoothing {
    /// Returns that of a picture of so many rows, none of which has come.
    pub(super) fn of_rows(rows: usize, passes: Passes) -> Self {
        Self {
            guides: vec![Vec::new(); rows],
            lights: std::array::from_fn(|_| vec![Vec::new(); rows]),
            n_ready: [0; N_PASSES + 1],
            passes,
        }
    }

    /// Adds the next rows, of one length all, and smooths what can be.
    pub(super) fn push(
        &mut self,
        rows: impl IntoIterator<Item = (Vec<Guide>, Vec<Lights>)>,
        cancel: &Cancel,
    ) -> Result<(), Cancelled> {
        for (guides, lights) in rows {
            let row = self.n_ready[0];
            (self.guides[row], self.lights[0][row]) = (guides, lights);
            self.n_ready[0] += 1;
        }
        for (pass, (step, first)) in self.passes.into_iter().enumerate() {
            let is_whole = self.n_ready[pass] == self.guides.len();
            let to = if is_whole { self.guides.len() } else { self.n_ready[pass].saturating_sub(2 * step) };
            let (before, after) = self.lights.split_at_mut(pass + 1);
            let (before, from) = (&before[pass], self.n_ready[pass + 1]);
            let rows = after[0].get_mut(from..to).unwrap_or_default();
            rows.par_iter_mut().enumerate().try_for_each(|(n, smoothed)| {
                let row = from + n;
                let pixel = |column| {
                    cancel.check()?;
                    Ok(smoothed_pixel(&self.guides, before, (row, column), step, first))
                };
                *smoothed = (0..before[row].len()).map(pixel).collect::<Result<_, Cancelled>>()?;
                Ok(())
            })?;
            self.n_ready[pass + 1] = from.max(to);
        }
        Ok(())
    }

    /// How many rows are smoothed.
    pub(super) fn n_smoothed(&self) -> usize {
        self.n_ready[N_PASSES]
    }

    /// The surfaces of all rows, and the light on them as far as it is smoothed.
    pub(super) fn smoothed(&self) -> (&[Vec<Guide>], &[Vec<Lights>]) {
        (&self.guides, &self.lights[N_PASSES])
    }

    /// Forgets the rows before one, as far as those to come need them no more.
    pub(super) fn forget_before(&mut self, row: usize) {
        let mut least = row;
        for (pass, (step, _)) in self.passes.into_iter().enumerate() {
            let needed = self.n_ready[pass + 1].saturating_sub(2 * step);
            self.lights[pass][..needed].iter_mut().for_each(|row| *row = Vec::new());
            least = least.min(needed);
        }
        self.lights[N_PASSES][..row].iter_mut().for_each(|row| *row = Vec::new());
        self.guides[..least].iter_mut().for_each(|row| *row = Vec::new());
    }
}

/// Returns the light on a surface at a place between the pixels of a picture: of the four around, or else, as along an outline, of those about, so far as they
/// show that surface within a distance; `pixel` returns the surface and the light of one.
pub(super) fn light_between<'a>(
    here: &Guide,
    (row, column): (f64, f64),
    (rows, columns): (usize, usize),
    reach_m: f64,
    pixel: impl Fn(usize, usize) -> (&'a Guide, &'a Lights),
) -> Option<Lights> {
    /// With less than this the pixels are not of the surface.
    const LEAST_WEIGHT: f64 = 1e-3;
    let about = |at: f64, reach: f64, n: usize| {
        let within = |at: f64| at.clamp(0.0, n as f64) as usize;
        within(at.floor() + 1.0 - reach)..within(at.floor() + 1.0 + reach)
    };
    [1.0, 2.0].into_iter().find_map(|reach| {
        let near = |at: f64, n: usize| (reach - (at - n as f64).abs()).max(0.0);
        let (mut sum, mut weights) = ([0.0; N_LIGHTS], 0.0);
        for r in about(row, reach, rows) {
            for c in about(column, reach, columns) {
                let (there, lights) = pixel(r, c);
                let weight = near(row, r) * near(column, c) * likeness(here, there, reach_m);
                if weight > 0.0 {
                    weights += weight;
                    sum.iter_mut().zip(lights).for_each(|(s, l)| *s += weight * f64::from(*l));
                }
            }
        }
        (weights > LEAST_WEIGHT).then(|| sum.map(|s| (s / weights) as f32))
    })
}

/// Returns how well the light of a pixel is that of a surface, 0–1: by object, slope and plane, as they are smoothed.
fn likeness(here: &Guide, there: &Guide, reach_m: f64) -> f64 {
    let slope = here.normal.dot(there.normal);
    let apart = there.point - here.point;
    let square = apart.length_squared();
    if there.object != here.object || slope < 0.7 || square > reach_m * reach_m {
        return 0.0;
    }
    // Points of the same plane count fully; those a few pixels' width off it hardly.
    let off_plane = here.normal.dot(apart).powi(2) / (square + 1e-12);
    (slope * (1.0 - off_plane)).powi(8)
}

fn smoothed_pixel(
    guides: &[Vec<Guide>],
    lights: &[Vec<Lights>],
    (row, column): (usize, usize),
    step: usize,
    first: usize,
) -> Lights {
    const WINDOW: [f64; 5] = [1.0, 4.0, 6.0, 4.0, 1.0];
    let here = &guides[row][column];
    let (mut sum, mut weights) = ([0.0; N_LIGHTS], 0.0);
    for (i, wy) in WINDOW.iter().enumerate() {
        let Some(r) = (row + step * i).checked_sub(2 * step).filter(|&r| r < guides.len()) else { continue };
        let (guides, lights) = (&guides[r], &lights[r]);
        for (j, wx) in WINDOW.iter().enumerate() {
            let Some(c) = (column + step * j).checked_sub(2 * step).filter(|&c| c < guides.len()) else { continue };
            let weight = (wx * wy * likeness(here, &guides[c], f64::INFINITY)) as f32;
            if weight > 0.0 {
                weights += weight;
                sum.iter_mut().zip(&lights[c]).for_each(|(s, l)| *s += weight * l);
            }
        }
    }
    let mut result = lights[row][column];
    result[first..].iter_mut().zip(&sum[first..]).for_each(|(r, s)| *r = s / weights);
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_smoothed_within_an_object_and_not_across() {
        let columns = 32;
        let guide = |index: usize| Guide {
            object: u32::from(index % columns >= 16),
            point: DVec3::new((index % columns) as f64, (index / columns) as f64, 0.0),
            normal: DVec3::Z,
        };
        let noisy = |index: usize| {
            let (row, column) = (index / columns, index % columns);
            [if column >= 16 { 100.0 } else { 10.0 } + ((row + column) % 2) as f32; N_LIGHTS]
        };
        let row = |row: usize| {
            let indices = || row * columns..(row + 1) * columns;
            (indices().map(guide).collect(), indices().map(noisy).collect())
        };
        let mut whole = Smoothing::of_rows(40, PASSES);
        whole.push((0..40).map(row), &Cancel::new()).unwrap();
        assert_eq!(whole.n_smoothed(), 40);
        let lights = whole.smoothed().1.concat();
        for (index, light) in lights.iter().enumerate() {
            let expected = if index % columns >= 16 { 100.5 } else { 10.5 };
            assert!(light.iter().all(|v| (v - expected).abs() < 0.2), "{index}: {light:?}");
        }
    }

    #[test]
    fn rows_are_the_same_in_pieces_and_forgotten() {
        let (rows, columns) = (61, 9);
        let row = |row: usize| {
            let at = |column: usize| DVec3::new(column as f64, row as f64, 0.1 * ((row * column) % 7) as f64);
            let guide = |column| Guide { object: u32::from(row > 40), point: at(column), normal: DVec3::Z };
            let light = |column| [(row * 31 + column * 17) as f32 % 11.0; N_LIGHTS];
            ((0..columns).map(guide).collect(), (0..columns).map(light).collect())
        };
        let mut whole = Smoothing::of_rows(rows, PASSES);
        whole.push((0..rows).map(row), &Cancel::new()).unwrap();
        let (mut pieces, mut taken, mut first) = (Smoothing::of_rows(rows, PASSES), 0, 0);
        for n in [1, 3, 20, 2, 30, 5] {
            pieces.push((first..first + n).map(row), &Cancel::new()).unwrap();
            first += n;
            for row in taken..pieces.n_smoothed() {
                assert_eq!(pieces.smoothed().1[row], whole.smoothed().1[row], "{row}");
            }
            taken = pieces.n_smoothed();
            pieces.forget_before(taken);
        }
        assert_eq!((first, taken), (rows, rows));
        assert!(pieces.smoothed().1.iter().all(Vec::is_empty));
    }
}
