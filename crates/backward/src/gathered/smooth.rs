//! Smoothing of sampled light over the samples of one surface.

use dioptric_spectrum::{Cancel, Cancelled};
use dioptric_world::glam::Vec3;
use rayon::prelude::*;

/// The surface that is seen at a sample.
#[derive(Clone, Copy, Debug)]
pub(super) struct Guide {
    /// What differs between shapes, and between what is seen in different mirrors.
    pub(super) key: u64,
    pub(super) point: Vec3,
    pub(super) normal: Vec3,
    /// The width of a pixel there along the surface, m, as it would be without mirrors that bend.
    pub(super) width_m: f32,
}

impl Guide {
    /// Where there is no surface.
    pub(super) const NOTHING: Self = Self { key: u64::MAX, point: Vec3::ZERO, normal: Vec3::Z, width_m: 1.0 };
}

/// Light at some wavelengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lanes<const N: usize>(pub(super) [f32; N]);

impl<const N: usize> Lanes<N> {
    /// Adds a share of other light.
    fn add(&mut self, share: f32, other: &Self) {
        self.0.iter_mut().zip(&other.0).for_each(|(sum, value)| *sum += share * value);
    }
}

impl<const N: usize> Default for Lanes<N> {
    fn default() -> Self {
        Self([0.0; N])
    }
}

/// How light is smoothed, pass by pass.
#[derive(Clone, Copy, Debug)]
pub(super) struct Passes {
    /// How far apart the samples of a window are, of each pass.
    pub(super) steps: &'static [usize],
    /// From this step on samples of other light count less, so that edges of shadows stay; smaller windows have noise in place of them.
    pub(super) keeps_edges_from: usize,
}

impl Passes {
    /// Those that go by surfaces alone.
    pub(super) const fn by_surface(steps: &'static [usize]) -> Self {
        Self { steps, keeps_edges_from: usize::MAX }
    }
}

/// Light on the rows of a lattice of samples, which come one after another, with the noise of its samples smoothed away and the edges of
/// surfaces kept; a row is smoothed as soon as those about it are there.
///
/// Each pass is a 3 × 3 binomial window of samples some steps apart, in which one of another surface, another slope or off the plane does
/// not count (Dammertz et al. 2010): passes of steps 1, 2, 4, … together are a tent four times the last wide.
pub(super) struct Smoothing<const N: usize> {
    /// By row; empty where a row has not come yet or is forgotten.
    guides: Vec<Vec<Guide>>,
    /// Likewise, as gathered and after each pass.
    lights: Vec<Vec<Vec<Lanes<N>>>>,
    /// How many rows are there, as gathered and after each pass.
    n_ready: Vec<usize>,
    passes: Passes,
}

impl<const N: usize> Smoothing<N> {
    /// Returns that of a lattice of so many rows, none of which has come.
    pub(super) fn of_rows(rows: usize, passes: Passes) -> Self {
        let steps = passes.steps;
        Self {
            guides: vec![Vec::new(); rows],
            lights: vec![vec![Vec::new(); rows]; steps.len() + 1],
            n_ready: vec![0; steps.len() + 1],
            passes,
        }
    }

    /// Adds the next rows, of one length all, and smooths what can be.
    pub(super) fn push(
        &mut self,
        rows: impl IntoIterator<Item = (Vec<Guide>, Vec<Lanes<N>>)>,
        cancel: &Cancel,
    ) -> Result<(), Cancelled> {
        for (guides, lights) in rows {
            let row = self.n_ready[0];
            (self.guides[row], self.lights[0][row]) = (guides, lights);
            self.n_ready[0] += 1;
        }
        for (pass, &step) in self.passes.steps.iter().enumerate() {
            let is_whole = self.n_ready[pass] == self.guides.len();
            let to = if is_whole { self.guides.len() } else { self.n_ready[pass].saturating_sub(step) };
            let (before, after) = self.lights.split_at_mut(pass + 1);
            let (before, from) = (&before[pass], self.n_ready[pass + 1]);
            let keeps_edges = step >= self.passes.keeps_edges_from;
            let rows = after[0].get_mut(from..to).unwrap_or_default();
            rows.par_iter_mut().enumerate().try_for_each(|(n, smoothed)| {
                let row = from + n;
                smoothed.reserve_exact(before[row].len());
                for column in 0..before[row].len() {
                    cancel.check()?;
                    smoothed.push(smoothed_sample((&self.guides, before), (row, column), step, keeps_edges));
                }
                Ok(())
            })?;
            self.n_ready[pass + 1] = from.max(to);
        }
        Ok(())
    }

    /// How many rows are smoothed.
    pub(super) fn n_smoothed(&self) -> usize {
        self.n_ready[self.passes.steps.len()]
    }

    /// Whether all rows are.
    pub(super) fn is_whole(&self) -> bool {
        self.n_smoothed() == self.guides.len()
    }

    /// Forgets the rows before one, as far as those to come need them no more.
    pub(super) fn forget_before(&mut self, row: usize) {
        let mut least = row;
        for (pass, step) in self.passes.steps.iter().enumerate() {
            let needed = self.n_ready[pass + 1].saturating_sub(*step).min(self.guides.len());
            self.lights[pass][..needed].iter_mut().for_each(|row| *row = Vec::new());
            least = least.min(needed);
        }
        let last = self.passes.steps.len();
        self.lights[last][..row].iter_mut().for_each(|row| *row = Vec::new());
        self.guides[..least].iter_mut().for_each(|row| *row = Vec::new());
    }

    /// Returns the light on a surface at a place between the samples: of the four around, or else, as along an outline, of those about, so
    /// far as they show that surface.
    pub(super) fn between(&self, here: &Guide, (row, column): (f64, f64)) -> Option<Lanes<N>> {
        /// With less than this the samples are not of the surface.
        const LEAST_WEIGHT: f32 = 1e-3;
        let (guides, lights) = (&self.guides, &self.lights[self.passes.steps.len()]);
        let about = |at: f64, reach: f64, n: usize| {
            let within = |at: f64| at.clamp(0.0, n as f64) as usize;
            within(at.floor() + 1.0 - reach)..within(at.floor() + 1.0 + reach)
        };
        [1.0, 2.0].into_iter().find_map(|reach| {
            let near = |at: f64, n: usize| (reach - (at - n as f64).abs()).max(0.0) as f32;
            let (mut sum, mut weights) = (Lanes::default(), 0.0);
            for r in about(row, reach, guides.len()) {
                for c in about(column, reach, lights[r].len()) {
                    let weight = near(row, r) * near(column, c) * likeness(here, &guides[r][c], 1.0);
                    if weight > 0.0 {
                        weights += weight;
                        sum.add(weight, &lights[r][c]);
                    }
                }
            }
            (weights > LEAST_WEIGHT).then(|| {
                let mut mean = Lanes::default();
                mean.add(weights.recip(), &sum);
                mean
            })
        })
    }
}

/// Returns how many of the samples of a row that smoothing by these steps takes go with one, 0–1: the guide of that in this place of the row.
pub(super) fn alike<'a>(here: &Guide, at: usize, steps: &[usize], beside: impl Fn(usize) -> Option<&'a Guide>) -> f32 {
    let of = |there: Option<usize>, step: usize| {
        there.and_then(&beside).map_or(0.0, |there| likeness(here, there, step as f32))
    };
    let sum: f32 = steps.iter().map(|&step| of(at.checked_sub(step), step) + of(Some(at + step), step)).sum();
    sum / (2 * steps.len()) as f32
}

/// Returns how well the light of a sample is that of a surface, 0–1: by shape, slope and plane.
fn likeness(here: &Guide, there: &Guide, step: f32) -> f32 {
    /// Samples so many times as far apart as those of a plain surface count half.
    const FAR: f32 = 6.0;
    /// Samples no more steps apart are neighbors, wherever they lie.
    const NEAR: f32 = 2.0;
    let slope = here.normal.dot(there.normal);
    if there.key != here.key || slope < 0.7 {
        return 0.0;
    }
    let apart = there.point - here.point;
    // Points of the same plane count fully; those a few samples' width off it hardly.
    let square = apart.length_squared();
    let off_plane = here.normal.dot(apart).powi(2) / (square + 1e-12);
    // In a mirror that bends neighbors lie far apart; those a few samples apart lie under other light.
    let far = if step > NEAR { square / (FAR * step * here.width_m).powi(2) } else { 0.0 };
    (slope * (1.0 - off_plane)).powi(8) / (1.0 + far)
}

/// Returns how well the light of a sample goes with another's, 0–1: a half where they differ by a quarter.
fn likeness_of_light<const N: usize>(here: &Lanes<N>, there: &Lanes<N>) -> f32 {
    /// Lanes that are looked at.
    const LOOKED_AT: usize = 4;
    const LARGE: f32 = 0.25;
    let (mut apart, mut sum) = (0.0, f32::MIN_POSITIVE);
    for lane in (0..N).step_by(N.div_ceil(LOOKED_AT)) {
        apart += (here.0[lane] - there.0[lane]).abs();
        sum += 0.5 * (here.0[lane] + there.0[lane]);
    }
    1.0 / (1.0 + (apart / (LARGE * sum)).powi(4))
}

fn smoothed_sample<const N: usize>(
    (guides, lights): (&[Vec<Guide>], &[Vec<Lanes<N>>]),
    (row, column): (usize, usize),
    step: usize,
    keeps_edges: bool,
) -> Lanes<N> {
    const WINDOW: [f32; 3] = [1.0, 2.0, 1.0];
    let (here, own) = (&guides[row][column], &lights[row][column]);
    if here.key == Guide::NOTHING.key {
        return Lanes::default();
    }
    let (mut sum, mut weights) = (Lanes::default(), 0.0);
    for (i, wy) in WINDOW.iter().enumerate() {
        let Some(r) = (row + step * i).checked_sub(step).filter(|&r| r < guides.len()) else { continue };
        let (guides, lights) = (&guides[r], &lights[r]);
        for (j, wx) in WINDOW.iter().enumerate() {
            let Some(c) = (column + step * j).checked_sub(step).filter(|&c| c < guides.len()) else { continue };
            let mut weight = wx * wy * likeness(here, &guides[c], step as f32);
            if keeps_edges && weight > 0.0 {
                weight *= likeness_of_light(own, &lights[c]);
            }
            if weight > 0.0 {
                weights += weight;
                sum.add(weight, &lights[c]);
            }
        }
    }
    let mut mean = Lanes::default();
    mean.add(weights.recip(), &sum);
    mean
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_smoothed_within_a_surface_and_not_across() {
        let columns = 32;
        let guide = |row: usize, column: usize| Guide {
            key: u64::from(column >= 16),
            point: Vec3::new(column as f32, row as f32, 0.0),
            normal: Vec3::Z,
            width_m: 1.0,
        };
        let noisy =
            |row: usize, column: usize| Lanes([if column >= 16 { 100.0 } else { 10.0 } + ((row + column) % 2) as f32]);
        let of_row = |row: usize| {
            let all = || 0..columns;
            (all().map(|column| guide(row, column)).collect(), all().map(|column| noisy(row, column)).collect())
        };
        let mut whole = Smoothing::<1>::of_rows(40, Passes::by_surface(&[1, 2, 4]));
        whole.push((0..40).map(of_row), &Cancel::new()).unwrap();
        assert!(whole.is_whole());
        for (row, column) in (0..40).flat_map(|row| (0..columns).map(move |column| (row, column))) {
            let expected = if column >= 16 { 100.5 } else { 10.5 };
            let found = whole.between(&guide(row, column), (row as f64, column as f64)).unwrap();
            assert!((found.0[0] - expected).abs() < 0.2, "{row} {column}: {found:?}");
        }
        assert!(whole.between(&Guide { key: 7, ..guide(3, 3) }, (3.0, 3.0)).is_none());
    }

    #[test]
    fn edge_of_a_shadow_is_kept_where_that_is_asked_for() {
        let columns = 64;
        let guide = |row: usize, column: usize| Guide {
            key: 1,
            point: Vec3::new(column as f32, row as f32, 0.0),
            normal: Vec3::Z,
            width_m: 1.0,
        };
        let lit = |column: usize| Lanes([if column >= 32 { 10.0 } else { 4.0 }]);
        let row = |row| ((0..columns).map(|c| guide(row, c)).collect(), (0..columns).map(lit).collect());
        let beside = |keeps_edges_from| {
            let mut whole = Smoothing::<1>::of_rows(40, Passes { steps: &[4], keeps_edges_from });
            whole.push((0..40).map(row), &Cancel::new()).unwrap();
            whole.between(&guide(20, 31), (20.0, 31.0)).unwrap().0[0]
        };
        // The light side counts a quarter there, and a little less since it lies farther off.
        let [blurred, kept] = [usize::MAX, 4].map(beside);
        assert!((blurred - 5.480).abs() < 0.01 && (kept - 4.0).abs() < 0.05, "{blurred} {kept}");
    }

    #[test]
    fn rows_are_the_same_in_pieces_and_forgotten() {
        let (rows, columns) = (61, 9);
        let guide = |row: usize, column: usize| Guide {
            key: u64::from(row > 40),
            point: Vec3::new(column as f32, row as f32, 0.1 * ((row * column) % 7) as f32),
            normal: Vec3::Z,
            width_m: 1.0,
        };
        let of_row = |row: usize| {
            let light = |column| Lanes([(row * 31 + column * 17) as f32 % 11.0]);
            ((0..columns).map(|column| guide(row, column)).collect(), (0..columns).map(light).collect())
        };
        let mut whole = Smoothing::<1>::of_rows(rows, Passes { steps: &[1, 2, 4], keeps_edges_from: 4 });
        whole.push((0..rows).map(of_row), &Cancel::new()).unwrap();
        let (mut pieces, mut taken, mut first) =
            (Smoothing::<1>::of_rows(rows, Passes { steps: &[1, 2, 4], keeps_edges_from: 4 }), 0, 0);
        for n in [1, 3, 20, 2, 30, 5] {
            pieces.push((first..first + n).map(of_row), &Cancel::new()).unwrap();
            first += n;
            for row in taken..pieces.n_smoothed() {
                assert_eq!(pieces.lights[3][row], whole.lights[3][row], "{row}");
            }
            taken = pieces.n_smoothed();
            pieces.forget_before(taken);
        }
        assert_eq!((first, taken), (rows, rows));
        assert!(pieces.lights[3].iter().all(Vec::is_empty));
    }
}
