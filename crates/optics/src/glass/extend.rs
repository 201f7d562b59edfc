//! Glass beyond the wavelengths at which it is known.

use serde::{Deserialize, Serialize};

use super::{Glass, named};
use crate::OpticsError;

/// What becomes of a wavelength outside the range in which a glass is known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum GlassRange {
    /// It is refused.
    #[default]
    Refuse,
    /// The glass is continued within a stated error ([`Glass::extended_at`]).
    Extend,
}

/// The index of a glass beyond the range in which it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExtendedIndex {
    /// The index.
    pub index: f64,
    /// How far the true one may lie from it.
    pub possible_error: f64,
}

/// The greatest possible error that is accepted: more than a crown glass disperses between the lines F and C, so that colors would
/// mean nothing.
const MOST_ERROR: f64 = 0.01;
/// How far from the end of the range samples count: as far as this factor in wavelength.
const NEAR: f64 = 2.0;
/// The least samples of a table that count where it has as many.
const FEWEST_SAMPLES: usize = 6;
/// Samples of a formula.
const FORMULA_SAMPLES: usize = 25;
/// The standard deviation of an index that is known to five decimals.
const ROUNDING: f64 = 0.5e-5 / 1.732_050_807_568_877_2;
/// Steps between the end of the range and the wavelength, at which a continuation must make sense.
const STEPS: usize = 32;
/// The terms of the long and of the short continuation.
const TERMS: (usize, usize) = (4, 3);

impl Glass {
    /// Returns the index at a wavelength, which outside the range in which the glass is known is refused or continued.
    ///
    /// # Errors
    /// As [`index_at`](Self::index_at), and as [`extended_at`](Self::extended_at) where the glass is continued.
    pub fn index_within(&self, range: GlassRange, wavelength_nm: f64) -> Result<f64, OpticsError> {
        match range {
            GlassRange::Extend if self.is_beyond(wavelength_nm) => Ok(self.extended_at(wavelength_nm)?.index),
            _ => self.index_at(wavelength_nm),
        }
    }

    /// Returns the index beyond the range in which the glass is known, and how far it may be off.
    ///
    /// A formula is taken as it stands. A table is continued from its end by `n² = A + B/λ² + Cλ² + D/λ⁴`, fitted by least squares to
    /// its samples up to twice as far in wavelength. The possible error of that continuation is twice its distance from the same fit
    /// without the last term, and three standard deviations of what noise of the samples (at least rounding in the fifth decimal) makes
    /// of it. That of a formula is that of the continuation of 25 samples of its own, and its distance from it. docs/glass.md in the
    /// repository has how often that holds.
    ///
    /// # Errors
    /// Where the glass has no such continuation: a law through an index and an Abbe number, a table of one point; a resonance of the
    /// formula, an index below 1 or one that grows with the wavelength on the way; a possible error above 0.01. Within the range, of 0.
    pub fn extended_at(&self, wavelength_nm: f64) -> Result<ExtendedIndex, OpticsError> {
        let law = self.law();
        let (Some(range_nm), true) = (law.range_nm(), self.is_beyond(wavelength_nm)) else {
            return Ok(ExtendedIndex { index: self.index_at(wavelength_nm)?, possible_error: 0.0 });
        };
        let refused = |reason: String| OpticsError::NotExtended { glass: self.describe(), wavelength_nm, reason };
        let end_nm = if wavelength_nm < range_nm.0 { range_nm.0 } else { range_nm.1 };
        let samples = law.samples_near(end_nm, range_nm).map_err(|reason| refused(reason.to_owned()))?;
        let [long, short] = [TERMS.0, TERMS.1].map(|n_terms| Continuation::of(&samples, n_terms, end_nm));
        let is_table = matches!(law, Self::Tabulated { .. });
        let index_at = |nm: f64| if is_table { long.index_at(nm) } else { law.index_unchecked(nm) };
        if let Some(nm) = law.resonance_between_nm(end_nm, wavelength_nm) {
            return Err(refused(format!("its formula has a resonance at {nm:.1} nm")));
        }
        let (index, continued) = (index_at(wavelength_nm), long.index_at(wavelength_nm));
        let of_continuation = 2.0 * (continued - short.index_at(wavelength_nm)).abs() + long.noise_at(wavelength_nm);
        let found = ExtendedIndex { index, possible_error: of_continuation + (index - continued).abs() };
        check_way(&index_at, (end_nm, wavelength_nm), found.possible_error).map_err(refused)?;
        Ok(found)
    }

    /// Whether a range is stated and a wavelength lies outside.
    pub(crate) fn is_beyond(&self, wavelength_nm: f64) -> bool {
        let is_wavelength = wavelength_nm > 0.0 && wavelength_nm.is_finite();
        is_wavelength && self.range_nm().is_some_and(|(first, last)| !(first..=last).contains(&wavelength_nm))
    }

    /// What to do where a wavelength outside the range is refused, to follow the message.
    pub(super) fn remedy(&self) -> &'static str {
        if matches!(self.law(), Self::NdVd { .. }) { "" } else { "; --glass-range extend continues it" }
    }

    /// The formula or table behind a name or a table of extinction.
    fn law(&self) -> &Self {
        match self {
            Self::Named(name) => named(name).map_or(self, Self::law),
            Self::Absorbing { law, .. } => law.law(),
            other => other,
        }
    }

    /// Returns wavelengths (nm) near an end of the range, and the index at each.
    fn samples_near(&self, end_nm: f64, range_nm: (f64, f64)) -> Result<Vec<(f64, f64)>, &'static str> {
        let (first_nm, last_nm) = (range_nm.0.max(end_nm / NEAR), range_nm.1.min(end_nm * NEAR));
        match self {
            Self::NdVd { .. } => Err("a law through an index and an Abbe number is a guess within its range already"),
            Self::Tabulated { wavelengths_nm, .. } if wavelengths_nm.len() < 2 => {
                Err("a table of one point has no continuation")
            }
            Self::Tabulated { wavelengths_nm, indices } => {
                let mut all: Vec<(f64, f64)> = wavelengths_nm.iter().copied().zip(indices.iter().copied()).collect();
                all.sort_by(|a, b| (a.0 - end_nm).abs().total_cmp(&(b.0 - end_nm).abs()));
                let n_near = all.iter().filter(|(nm, _)| (first_nm..=last_nm).contains(nm)).count();
                all.truncate(n_near.max(FEWEST_SAMPLES));
                Ok(all)
            }
            _ => {
                let step_nm = (last_nm - first_nm) / (FORMULA_SAMPLES - 1) as f64;
                let at = |i: usize| first_nm + step_nm * i as f64;
                Ok((0..FORMULA_SAMPLES).map(|i| (at(i), self.index_unchecked(at(i)))).collect())
            }
        }
    }

    /// Returns the wavelength of a resonance between two wavelengths, nm.
    fn resonance_between_nm(&self, a_nm: f64, b_nm: f64) -> Option<f64> {
        let resonances_nm: Vec<f64> = match self {
            Self::Sellmeier { b, c_um2, .. } => {
                let of_terms = b.iter().zip(c_um2).filter(|(b, c)| **b != 0.0 && **c > 0.0);
                of_terms.map(|(_, c)| 1e3 * c.sqrt()).collect()
            }
            Self::Formula { formula: formula @ (1 | 2), coefficients, .. } => {
                let pairs = coefficients.get(1..).unwrap_or_default().chunks_exact(2);
                let of_pairs = pairs.filter(|pair| pair[0] != 0.0 && pair[1] > 0.0);
                of_pairs.map(|pair| 1e3 * if *formula == 1 { pair[1] } else { pair[1].sqrt() }).collect()
            }
            _ => Vec::new(),
        };
        let between = a_nm.min(b_nm)..=a_nm.max(b_nm);
        resonances_nm.into_iter().find(|nm| between.contains(nm))
    }
}

/// Checks that a continuation makes sense from an end of the range to a wavelength; else returns why not.
fn check_way(index_at: &dyn Fn(f64) -> f64, (end_nm, nm): (f64, f64), possible_error: f64) -> Result<(), String> {
    let at = |i: usize| end_nm + (nm - end_nm) * i as f64 / STEPS as f64;
    let way: Vec<(f64, f64)> = (0..=STEPS).map(|i| (at(i), index_at(at(i)))).collect();
    if let Some((nm, _)) = way.iter().find(|(_, index)| !(*index >= 1.0 && index.is_finite())) {
        return Err(format!("its continuation has no index of at least 1 at {nm:.1} nm"));
    }
    if possible_error.is_nan() || possible_error > MOST_ERROR {
        return Err(format!("its index could be off by {possible_error:.1e} there, more than {MOST_ERROR}"));
    }
    // Clear media disperse normally: the index falls as the wavelength grows.
    let towards_red = (nm - end_nm).signum();
    match way.iter().find(|(_, index)| towards_red * (index - way[0].1) > possible_error) {
        Some((nm, _)) => Err(format!("its continuation grows with the wavelength at {nm:.1} nm")),
        None => Ok(()),
    }
}

/// `n²` beyond an end of a range: the first terms of `A + B/λ² + Cλ² + D/λ⁴`, fitted by least squares, and moved so that it goes through
/// the sample at the end.
struct Continuation {
    end_nm: f64,
    end_square: f64,
    /// Coefficients of the orthogonal functions that the terms are made into.
    coefficients: Vec<f64>,
    /// Each orthogonal function as a sum of terms.
    functions: Vec<Vec<f64>>,
    /// The standard deviation of n².
    deviation: f64,
}

impl Continuation {
    fn of(samples: &[(f64, f64)], n_terms: usize, end_nm: f64) -> Self {
        let end = samples.iter().min_by(|a, b| (a.0 - end_nm).abs().total_cmp(&(b.0 - end_nm).abs()));
        let end_square = end.map_or(1.0, |(_, index)| index * index);
        let rows: Vec<[f64; TERMS.0]> = samples.iter().map(|(nm, _)| terms(nm / end_nm)).collect();
        let mut rest: Vec<f64> = samples.iter().map(|(_, index)| index * index - end_square).collect();
        // Two points leave a short continuation of one term less than the long one.
        let n_terms = n_terms.min((samples.len() + n_terms).saturating_sub(TERMS.0)).max(1);
        let (mut functions, mut values, mut coefficients) =
            (Vec::<Vec<f64>>::new(), Vec::<Vec<f64>>::new(), Vec::new());
        for term in 0..n_terms {
            let mut function = vec![0.0; TERMS.0];
            function[term] = 1.0;
            let mut value: Vec<f64> = rows.iter().map(|row| row[term]).collect();
            // Twice, against rounding.
            for _ in 0..2 {
                for (other, its_value) in functions.iter().zip(&values) {
                    let share = dot(&value, its_value);
                    subtract(&mut value, share, its_value);
                    subtract(&mut function, share, other);
                }
            }
            let length = dot(&value, &value).sqrt();
            value.iter_mut().chain(&mut function).for_each(|v| *v /= length);
            let coefficient = dot(&rest, &value);
            subtract(&mut rest, coefficient, &value);
            coefficients.push(coefficient);
            functions.push(function);
            values.push(value);
        }
        let n_free = samples.len().saturating_sub(n_terms).max(1);
        let rounding = 2.0 * end_square.sqrt() * ROUNDING;
        let deviation = (dot(&rest, &rest) / n_free as f64).sqrt().max(rounding);
        Self { end_nm, end_square, coefficients, functions, deviation }
    }

    /// The change of each orthogonal function from the end.
    fn changes(&self, nm: f64) -> impl Iterator<Item = f64> {
        let (at_end, here) = (terms(1.0), terms(nm / self.end_nm));
        self.functions.iter().map(move |function| dot(function, &here) - dot(function, &at_end))
    }

    fn index_at(&self, nm: f64) -> f64 {
        let change: f64 = self.changes(nm).zip(&self.coefficients).map(|(change, c)| c * change).sum();
        (self.end_square + change).sqrt()
    }

    /// Three standard deviations of the index by the noise of the samples.
    fn noise_at(&self, nm: f64) -> f64 {
        let leverage = self.changes(nm).map(|change| change * change).sum::<f64>().sqrt();
        3.0 * self.deviation * leverage / (2.0 * self.index_at(nm))
    }
}

/// The terms of a continuation in their order, at a wavelength as a multiple of that of the end.
fn terms(relative: f64) -> [f64; TERMS.0] {
    let square = relative * relative;
    [1.0, 1.0 / square, square, 1.0 / (square * square)]
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn subtract(from: &mut [f64], share: f64, of: &[f64]) {
    from.iter_mut().zip(of).for_each(|(value, other)| *value -= share * other);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::GlassCatalogue;

    fn bk7(range_nm: Option<(f64, f64)>) -> Glass {
        let b = vec![1.03961212, 0.231792344, 1.01046945];
        let c_um2 = vec![0.00600069867, 0.0200179144, 103.560653];
        Glass::Sellmeier { b, c_um2, range_nm }
    }

    /// A table of a glass from 440 to 660 nm every 10 nm, to five decimals.
    fn table_of(glass: &Glass) -> Glass {
        table_at(glass, (44..=66).map(|i| 10.0 * f64::from(i)).collect())
    }

    /// A table of a glass to five decimals.
    fn table_at(glass: &Glass, wavelengths_nm: Vec<f64>) -> Glass {
        let indices = wavelengths_nm.iter().map(|&nm| (1e5 * glass.index_at(nm).unwrap()).round() / 1e5).collect();
        Glass::Tabulated { wavelengths_nm, indices }
    }

    #[test]
    fn a_formula_is_continued_by_its_own_law() {
        let (known, whole) = (bk7(Some((450.0, 650.0))), bk7(None));
        for nm in [380.0, 400.0, 449.0, 651.0, 700.0, 1000.0] {
            let found = known.extended_at(nm).unwrap();
            assert_eq!(found.index, whole.index_at(nm).unwrap(), "{nm}");
            assert!(found.possible_error > 0.0 && found.possible_error < 3e-3, "{nm}: {found:?}");
            assert_eq!(known.index_within(GlassRange::Extend, nm).unwrap(), found.index);
            assert!(known.index_within(GlassRange::Refuse, nm).is_err());
        }
        assert_eq!(known.extended_at(500.0).unwrap().possible_error, 0.0);
    }

    #[test]
    fn a_table_is_continued_within_its_possible_error() {
        let table = table_of(&bk7(None));
        for nm in [390.0, 430.0, 670.0, 710.0] {
            let (found, expected) = (table.extended_at(nm).unwrap(), bk7(None).index_at(nm).unwrap());
            let off = (found.index - expected).abs();
            assert!(off <= found.possible_error && found.possible_error < 1e-3, "{nm}: {off:.1e} {found:?}");
        }
        // It begins where the table ends.
        let (at_end, beyond) = (table.index_at(440.0).unwrap(), table.extended_at(439.999).unwrap().index);
        assert!((at_end - beyond).abs() < 1e-6);
    }

    /// Every glass of the catalogue whose formula is known to be true there, from a table of its visible part alone.
    #[test]
    fn possible_errors_hold_throughout_the_catalogue() {
        for (nm, most) in [(420.0, 5e-4), (390.0, 2e-3), (680.0, 1e-3), (710.0, 1e-3), (760.0, 1e-3)] {
            let all = GlassCatalogue::built_in().glasses().iter().map(|glass| &glass.glass);
            let known = |glass: &&Glass| {
                let is_formula = matches!(glass, Glass::Formula { .. });
                is_formula && [nm, 440.0, 660.0].iter().all(|&nm| glass.index_at(nm).is_ok())
            };
            let (mut n, mut n_held, mut errors) = (0, 0, Vec::new());
            for glass in all.filter(known) {
                let Ok(found) = table_of(glass).extended_at(nm) else { continue };
                let off = (found.index - glass.index_at(nm).unwrap()).abs();
                n += 1;
                n_held += usize::from(off <= found.possible_error);
                errors.push(found.possible_error);
            }
            errors.sort_by(f64::total_cmp);
            let median = errors[n / 2];
            assert!(n > 1300 && n_held as f64 >= 0.998 * n as f64, "{nm}: {n_held} of {n}");
            assert!(median < most, "{nm}: {median:.1e}");
        }
    }

    /// Longer steps in the infrared, where a formula bends towards an absorption that its table does not reach, hold less often (docs/glass.md).
    #[test]
    fn possible_errors_hold_less_often_in_the_infrared() {
        for (last_nm, nm, least) in [(1500.0, 2000.0, 0.995), (1800.0, 2325.0, 0.97)] {
            let is_known = |glass: &&Glass| {
                matches!(glass, Glass::Formula { .. }) && [404.0, nm].iter().all(|&nm| glass.index_at(nm).is_ok())
            };
            let glasses = GlassCatalogue::built_in().glasses().iter().map(|glass| &glass.glass).filter(is_known);
            let wavelengths_nm: Vec<f64> = (0..25).map(|i| 404.0 + (last_nm - 404.0) * f64::from(i) / 24.0).collect();
            let is_held = |glass: &Glass| {
                let found = table_at(glass, wavelengths_nm.clone()).extended_at(nm).ok()?;
                Some((found.index - glass.index_at(nm).unwrap()).abs() <= found.possible_error)
            };
            let held: Vec<bool> = glasses.filter_map(is_held).collect();
            let n_held = held.iter().filter(|held| **held).count();
            println!("from {last_nm} to {nm} nm: {n_held} of {}", held.len());
            assert!(held.len() > 300 && n_held as f64 >= least * held.len() as f64, "{nm}: {n_held} of {}", held.len());
        }
    }

    #[track_caller]
    fn check_refused(glass: &Glass, nm: f64, words: &str) {
        let message = glass.extended_at(nm).unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    }

    #[test]
    fn what_cannot_go_on_is_refused_with_its_reason() {
        let known = bk7(Some((450.0, 650.0)));
        check_refused(&known, 140.0, "its formula has a resonance at 141.5 nm");
        check_refused(&known, 160.0, "its index could be off by");
        check_refused(&known, 11_000.0, "resonance at 10176.5 nm");
        check_refused(&Glass::NdVd { nd: 1.5, vd: 60.0 }, 250.0, "is a guess within its range already");
        let one = Glass::Tabulated { wavelengths_nm: vec![550.0], indices: vec![1.5] };
        check_refused(&one, 560.0, "a table of one point");
        let two = Glass::Tabulated { wavelengths_nm: vec![450.0, 550.0], indices: vec![1.5, 1.6] };
        check_refused(&two, 650.0, "could be off by");
        assert!(known.extended_at(f64::NAN).is_err() && known.extended_at(-1.0).is_err());
    }

    #[test]
    fn medium_without_dispersion_stays_so() {
        let flat = Glass::Tabulated { wavelengths_nm: vec![400.0, 500.0, 600.0, 700.0], indices: vec![1.5; 4] };
        let found = flat.extended_at(720.0).unwrap();
        assert!((found.index - 1.5).abs() < 1e-12 && found.possible_error < 1e-4, "{found:?}");
    }
}
