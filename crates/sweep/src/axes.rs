//! What is varied, and over which values: parts of a plan.

use std::{collections::BTreeSet, fmt, marker::PhantomData};

use dioptric_backward::{SOBOL_DIMENSIONS, scrambled_sobol};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{
    Deserialize, Deserializer,
    de::{MapAccess, Visitor},
};

use crate::Value;

/// The most points of one way of varying, and of a plan.
pub(crate) const MOST_POINTS: usize = 10_000_000;

/// One way of varying cameras: a list of points, each a value for every key.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum Sampling {
    /// All combinations of the values of each key; the last key changes fastest.
    Grid(Axes<Values>),
    /// These points.
    List {
        /// The keys.
        keys: Vec<String>,
        /// The points, each with a value for every key.
        points: Vec<Vec<Value>>,
    },
    /// Points drawn at random, all independent of each other; more points keep those there were.
    Random {
        /// How many.
        count: usize,
        /// The seed of the draws.
        seed: u64,
        /// What each key is drawn from.
        axes: Axes<Distribution>,
    },
    /// A Latin hypercube: of as many equal parts of each axis as there are points, each part has one point.
    LatinHypercube {
        /// How many.
        count: usize,
        /// The seed of the draws.
        seed: u64,
        /// What each key is drawn from.
        axes: Axes<Distribution>,
    },
    /// Points of Sobol's sequence, scrambled as Owen does: even in all axes together, best for counts that are powers of two;
    /// more points keep those there were.
    Sobol {
        /// How many.
        count: usize,
        /// The seed of the scrambling.
        seed: u64,
        /// What each key is drawn from.
        axes: Axes<Distribution>,
    },
}

/// The values of an axis of a grid.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum Values {
    /// These.
    List(Vec<Value>),
    /// Numbers in equal steps, both ends included.
    Linear {
        /// First.
        first: f64,
        /// Last.
        last: f64,
        /// How many.
        count: usize,
    },
    /// Numbers in equal ratios, both ends included.
    Log {
        /// First, above 0.
        first: f64,
        /// Last, above 0.
        last: f64,
        /// How many.
        count: usize,
    },
}

/// What the values of an axis are drawn from.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum Distribution {
    /// Numbers from one to another, all alike.
    Uniform {
        /// The smallest.
        least: f64,
        /// The largest.
        most: f64,
    },
    /// Numbers from one to another, equal ratios alike.
    LogUniform {
        /// The smallest, above 0.
        least: f64,
        /// The largest.
        most: f64,
    },
    /// Whole numbers from one to another, both included, all alike.
    Whole {
        /// The smallest.
        least: u64,
        /// The largest, below 2⁵³.
        most: u64,
    },
    /// One of these, all alike.
    Choice(Vec<Value>),
}

/// Keys in the order of the plan, each with what it is varied over.
#[derive(Clone, Debug, PartialEq)]
pub struct Axes<T>(pub Vec<(String, T)>);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Axes<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Entries<T>(PhantomData<T>);

        impl<'de, T: Deserialize<'de>> Visitor<'de> for Entries<T> {
            type Value = Axes<T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a map of keys of the camera file, as {\"seed\": …}")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Axes<T>, A::Error> {
                let mut axes = Vec::new();
                while let Some(axis) = map.next_entry()? {
                    axes.push(axis);
                }
                Ok(Axes(axes))
            }
        }

        deserializer.deserialize_map(Entries(PhantomData))
    }
}

#[cfg(feature = "schema")]
impl<T: schemars::JsonSchema> schemars::JsonSchema for Axes<T> {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        format!("Axes_of_{}", T::schema_name()).into()
    }

    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({
            "type": "object",
            "description": "Keys of the camera file, each with what it is varied over.",
            "additionalProperties": generator.subschema_for::<T>(),
        })
    }
}

/// Why a way of varying is none: the key, or none for all of it, and the reason.
pub(crate) type Wrong = (Option<String>, String);

fn wrong(key: &str, reason: impl Into<String>) -> Wrong {
    (Some(key.to_owned()), reason.into())
}

impl Values {
    fn count(&self) -> usize {
        match self {
            Self::List(values) => values.len(),
            Self::Linear { count, .. } | Self::Log { count, .. } => *count,
        }
    }

    fn check(&self) -> Result<(), String> {
        match self {
            Self::List(_) => {}
            Self::Linear { first, last, .. } if first.is_finite() && last.is_finite() => {}
            Self::Linear { .. } => return Err("its ends must be finite numbers".to_owned()),
            Self::Log { first, last, .. } if [first, last].iter().all(|v| v.is_finite() && **v > 0.0) => {}
            Self::Log { .. } => return Err("equal ratios need ends above 0".to_owned()),
        }
        if self.count() == 0 { Err("it has no values, expected one or more".to_owned()) } else { Ok(()) }
    }

    fn at(&self, index: usize) -> Value {
        let between = |first: f64, last: f64, count: usize, at: &dyn Fn(f64, f64) -> f64| match index {
            0 => Value::number(first),
            _ if index + 1 == count => Value::number(last),
            _ => Value::number(as_typed(at(index as f64, (count - 1) as f64))),
        };
        match self {
            Self::List(values) => values[index].clone(),
            // Both ends weighed by whole numbers, so that steps of whole numbers are whole: seeds and counts.
            Self::Linear { first, last, count } => {
                between(*first, *last, *count, &|at, steps| (first * (steps - at) + last * at) / steps)
            }
            // Exponents of `libm` have the same bits on every machine, and so have the names of items.
            Self::Log { first, last, count } => {
                between(*first, *last, *count, &|at, steps| first * libm::exp(libm::log(last / first) * (at / steps)))
            }
        }
    }
}

/// Returns a number without the digits that rounding left: .0004 of .0002 and .0016, not .00039999999999999996. What is no short number, a third,
/// stays as it is.
fn as_typed(number: f64) -> f64 {
    // An exponential, a logarithm and a product, each off by a few last digits.
    const ROUNDING: f64 = 32.0 * f64::EPSILON;
    let short: f64 = format!("{number:.11e}").parse().unwrap_or(number);
    if (short - number).abs() <= ROUNDING * number.abs() { short } else { number }
}

impl Distribution {
    fn check(&self) -> Result<(), String> {
        match self {
            Self::Uniform { least, most } if least.is_finite() && most.is_finite() && least <= most => Ok(()),
            Self::LogUniform { least, most } if *least > 0.0 && most.is_finite() && least <= most => Ok(()),
            Self::Whole { least, most } if least <= most && *most < 1 << 53 => Ok(()),
            Self::Choice(values) if values.is_empty() => Err("it has no values, expected one or more".to_owned()),
            Self::Choice(_) => Ok(()),
            Self::Uniform { .. } => Err("expected finite numbers, the smallest not above the largest".to_owned()),
            Self::LogUniform { .. } => Err("expected numbers above 0, the smallest not above the largest".to_owned()),
            Self::Whole { .. } => {
                Err("expected whole numbers below 2^53, the smallest not above the largest".to_owned())
            }
        }
    }

    /// Returns the value at a share, in [0, 1), of the distribution.
    fn at(&self, share: f64) -> Value {
        // Rounding must not lead beyond the last one.
        let one_of = |n: u64| ((share * n as f64) as u64).min(n - 1);
        match self {
            Self::Uniform { least, most } => Value::number((least + (most - least) * share).clamp(*least, *most)),
            Self::LogUniform { least, most } => {
                Value::number((least * libm::exp(libm::log(most / least) * share)).clamp(*least, *most))
            }
            Self::Whole { least, most } => Value::Whole(least + one_of(most - least + 1)),
            Self::Choice(values) => values[one_of(values.len() as u64) as usize].clone(),
        }
    }
}

impl Sampling {
    /// The keys that it varies.
    pub fn keys(&self) -> Vec<&str> {
        match self {
            Self::Grid(axes) => axes.0.iter().map(|(key, _)| key.as_str()).collect(),
            Self::List { keys, .. } => keys.iter().map(String::as_str).collect(),
            Self::Random { axes, .. } | Self::LatinHypercube { axes, .. } | Self::Sobol { axes, .. } => {
                axes.0.iter().map(|(key, _)| key.as_str()).collect()
            }
        }
    }

    /// Checks that there are points, and that they can be.
    pub(crate) fn check(&self) -> Result<(), Wrong> {
        if self.keys().is_empty() {
            return Err((None, "a way of varying has no keys, expected one or more".to_owned()));
        }
        let mut seen = BTreeSet::new();
        if let Some(twice) = self.keys().into_iter().find(|key| !seen.insert(*key)) {
            return Err(wrong(twice, "it is varied twice"));
        }
        match self {
            Self::Grid(axes) => axes.0.iter().try_for_each(|(key, values)| values.check().map_err(|r| wrong(key, r))),
            Self::List { keys, points } if points.is_empty() => Err(wrong(&keys[0], "the list has no points")),
            Self::List { keys, points } => match points.iter().position(|point| point.len() != keys.len()) {
                Some(n) => {
                    let (found, expected) = (points[n].len(), keys.len());
                    Err((None, format!("point {} of the list has {found} values, expected {expected}", n + 1)))
                }
                None => Ok(()),
            },
            Self::Random { count, axes, .. }
            | Self::LatinHypercube { count, axes, .. }
            | Self::Sobol { count, axes, .. } => {
                if *count == 0 || *count > MOST_POINTS {
                    return Err((None, format!("a way of varying has {count} points, expected 1 to {MOST_POINTS}")));
                }
                if matches!(self, Self::Sobol { .. }) && axes.0.len() > SOBOL_DIMENSIONS {
                    let found = axes.0.len();
                    return Err((None, format!("Sobol has {found} keys, expected {SOBOL_DIMENSIONS} at most")));
                }
                axes.0.iter().try_for_each(|(key, drawn)| drawn.check().map_err(|reason| wrong(key, reason)))
            }
        }
    }

    /// Returns how many points it has, or none where that cannot be counted.
    pub(crate) fn count(&self) -> Option<usize> {
        match self {
            Self::Grid(axes) => axes.0.iter().try_fold(1_usize, |n, (_, values)| n.checked_mul(values.count())),
            Self::List { points, .. } => Some(points.len()),
            Self::Random { count, .. } | Self::LatinHypercube { count, .. } | Self::Sobol { count, .. } => Some(*count),
        }
    }
}

/// The points of a way of varying, to be asked one by one.
#[derive(Clone, Debug)]
pub(crate) struct Points {
    sampling: Sampling,
    /// Where each point of one that is drawn lies within each axis, 0 to 1.
    shares: Vec<Vec<f64>>,
}

impl Points {
    /// Returns the points of a way of varying that was checked.
    pub(crate) fn of(sampling: &Sampling) -> Self {
        let shares = match sampling {
            Sampling::Grid(_) | Sampling::List { .. } => Vec::new(),
            Sampling::Random { count, seed, axes } => of_each(axes, |axis| {
                let mut draws = draws(*seed, axis);
                (0..*count).map(|_| unit(&mut draws)).collect()
            }),
            Sampling::LatinHypercube { count, seed, axes } => {
                of_each(axes, |axis| latin_shares(*count, &mut draws(*seed, axis)))
            }
            Sampling::Sobol { count, seed, axes } => {
                of_each(axes, |axis| (0..*count).map(|index| scrambled_sobol(index as u32, axis, *seed)).collect())
            }
        };
        Self { sampling: sampling.clone(), shares }
    }

    /// Returns the values of a point in the order of the keys.
    pub(crate) fn at(&self, mut index: usize) -> Vec<Value> {
        match &self.sampling {
            Sampling::Grid(axes) => {
                let mut values: Vec<Value> = Vec::with_capacity(axes.0.len());
                for (_, of_key) in axes.0.iter().rev() {
                    values.push(of_key.at(index % of_key.count()));
                    index /= of_key.count();
                }
                values.reverse();
                values
            }
            Sampling::List { points, .. } => points[index].clone(),
            Sampling::Random { axes, .. } | Sampling::LatinHypercube { axes, .. } | Sampling::Sobol { axes, .. } => {
                axes.0.iter().zip(&self.shares).map(|((_, drawn), shares)| drawn.at(shares[index])).collect()
            }
        }
    }
}

fn of_each(axes: &Axes<Distribution>, shares: impl Fn(usize) -> Vec<f64>) -> Vec<Vec<f64>> {
    (0..axes.0.len()).map(shares).collect()
}

/// Returns the draws of an axis: a stream of its own, so that another axis changes none.
fn draws(seed: u64, axis: usize) -> ChaCha8Rng {
    let mut draws = ChaCha8Rng::seed_from_u64(seed);
    draws.set_stream(axis as u64);
    draws
}

/// Returns a number in [0, 1) of 53 bits.
fn unit(draws: &mut ChaCha8Rng) -> f64 {
    (draws.next_u64() >> 11) as f64 / 9_007_199_254_740_992.0
}

/// Returns one number in each of so many equal parts of [0, 1), the parts in random order.
fn latin_shares(count: usize, draws: &mut ChaCha8Rng) -> Vec<f64> {
    let mut parts: Vec<usize> = (0..count).collect();
    for last in (1..count).rev() {
        parts.swap(last, (unit(draws) * (last + 1) as f64) as usize);
    }
    let n = count as f64;
    // Rounding must not lead into the next part.
    let within = |part: usize, share: f64| ((part as f64 + share) / n).min(((part + 1) as f64 / n).next_down());
    parts.into_iter().map(|part| within(part, unit(draws))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sampling(text: &str) -> Sampling {
        ron::from_str(text).unwrap()
    }

    fn numbers(text: &str) -> Vec<Vec<f64>> {
        let sampling = sampling(text);
        sampling.check().unwrap();
        let points = Points::of(&sampling);
        let row = |i| points.at(i).iter().map(|value| value.as_f64().unwrap()).collect();
        (0..sampling.count().unwrap()).map(row).collect()
    }

    #[test]
    fn grids_have_all_combinations() {
        let grid = numbers(r#"Grid({"seed": List([1, 2]), "a": Linear(first: 0, last: 1, count: 5)})"#);
        let expected: Vec<Vec<f64>> =
            [1.0, 2.0].iter().flat_map(|s| [0.0, 0.25, 0.5, 0.75, 1.0].map(|a| vec![*s, a])).collect();
        assert_eq!(grid, expected);
        // Whole numbers stay whole: seeds and counts are read from them.
        let whole = sampling(r#"Grid({"seed": Linear(first: 1, last: 9, count: 5)})"#);
        assert_eq!(Points::of(&whole).at(3), [Value::Whole(7)]);
        let many = sampling(r#"Grid({"seed": Linear(first: 1, last: 1000, count: 1000)})"#);
        assert!((0..1000).all(|n| Points::of(&many).at(n) == [Value::Whole(n as u64 + 1)]));
    }

    #[test]
    fn log_steps_have_one_ratio() {
        let steps = numbers(r#"Grid({"t": Log(first: 0.001, last: 1, count: 4)})"#);
        // As one would type them, in camera files, tables and legends.
        assert_eq!(steps, [[1e-3], [1e-2], [1e-1], [1.0]]);
        assert_eq!(numbers(r#"Grid({"t": Log(first: 0.0002, last: 0.0016, count: 4)})"#)[1], [0.0004]);
        assert_eq!(numbers(r#"Grid({"t": Linear(first: 0, last: 1, count: 11)})"#)[3], [0.3]);
        assert_eq!(numbers(r#"Grid({"t": Linear(first: 0, last: 1, count: 4)})"#)[1], [1.0 / 3.0]);
        assert_eq!(numbers(r#"Grid({"t": Log(first: 2, last: 3, count: 1)})"#), [[2.0]]);
    }

    #[test]
    fn latin_hypercube_fills_each_stratum_once() {
        let n = 97;
        let cube = numbers(&format!(
            r#"LatinHypercube(count: {n}, seed: 5, axes: {{"a": Uniform(least: -1, most: 1), "b": LogUniform(least: 1, most: 16),
            "c": Whole(least: 1, most: {n})}})"#
        ));
        let shares: [fn(&[f64]) -> f64; 3] = [|p| 0.5 * (p[0] + 1.0), |p| p[1].log2() / 4.0, |p| (p[2] - 0.5) / 97.0];
        for share in shares {
            let mut strata: Vec<usize> = cube.iter().map(|point| (share(point) * f64::from(n)) as usize).collect();
            assert!(strata.windows(2).any(|pair| pair[0] > pair[1]));
            strata.sort_unstable();
            assert_eq!(strata, (0..n as usize).collect::<Vec<_>>());
        }
    }

    #[test]
    fn sobol_points_are_a_net() {
        let points = numbers(
            r#"Sobol(count: 64, seed: 3, axes: {"a": Uniform(least: 0, most: 8), "b": Uniform(least: 0, most: 8)})"#,
        );
        let mut cells: Vec<(u8, u8)> = points.iter().map(|p| (p[0] as u8, p[1] as u8)).collect();
        cells.sort_unstable();
        assert_eq!(cells, (0..8).flat_map(|a| (0..8).map(move |b| (a, b))).collect::<Vec<_>>());
    }

    #[test]
    fn random_points_follow_their_distributions() {
        let text = |count: usize| {
            format!(
                r#"Random(count: {count}, seed: 1, axes: {{"u": Uniform(least: 2, most: 4), "l": LogUniform(least: 0.01, most: 100),
                "w": Whole(least: 3, most: 6), "c": Choice([10, 20])}})"#
            )
        };
        let points = numbers(&text(4000));
        let mean = |of: &dyn Fn(&[f64]) -> f64| points.iter().map(|p| of(p)).sum::<f64>() / 4000.0;
        // Four standard errors of each mean from 4000 draws.
        assert!((mean(&|p| p[0]) - 3.0).abs() < 4.0 * 0.577 / 63.2);
        assert!(mean(&|p| p[1].log10()).abs() < 4.0 * 1.155 / 63.2);
        assert!((mean(&|p| p[2]) - 4.5).abs() < 4.0 * 1.118 / 63.2);
        assert!((mean(&|p| p[3]) - 15.0).abs() < 4.0 * 5.0 / 63.2);
        assert!(points.iter().all(|p| (2.0..4.0).contains(&p[0]) && [3.0, 4.0, 5.0, 6.0].contains(&p[2])));
        // More points keep those there were.
        assert_eq!(numbers(&text(7)), points[..7]);
    }

    #[test]
    fn what_varies_nothing_is_named() {
        let error = |text: &str| {
            let (key, reason) = sampling(text).check().unwrap_err();
            format!("{}: {reason}", key.unwrap_or_default())
        };
        for (text, words) in [
            (r#"Grid({"a": List([])})"#, "a: it has no values"),
            (r#"Grid({"a": List([1]), "a": List([2])})"#, "a: it is varied twice"),
            (r#"Grid({"a": Log(first: 0, last: 1, count: 3)})"#, "a: equal ratios need ends above 0"),
            (r#"Grid({"a": Linear(first: 0, last: 1, count: 0)})"#, "a: it has no values"),
            ("Grid({})", "no keys"),
            (r#"List(keys: ["a", "b"], points: [[1, 2], [3]])"#, "point 2 of the list has 1 values, expected 2"),
            (r#"List(keys: ["a"], points: [])"#, "a: the list has no points"),
            (r#"Random(count: 0, seed: 1, axes: {"a": Choice([1])})"#, "0 points"),
            (r#"Random(count: 1, seed: 1, axes: {"a": Choice([])})"#, "a: it has no values"),
            (r#"Sobol(count: 1, seed: 1, axes: {"a": LogUniform(least: 0, most: 1)})"#, "a: expected numbers above 0"),
            (r#"Sobol(count: 1, seed: 1, axes: {"a": Uniform(least: 2, most: 1)})"#, "a: expected finite numbers"),
        ] {
            assert!(error(text).contains(words), "{}", error(text));
        }
    }
}
