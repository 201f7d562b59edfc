//! Animations of glTF files: what the words of a file are at a time.

use std::collections::{BTreeSet, HashSet};

use glam::{DMat4, DQuat};
use serde_json::{Map, Value};

use super::{
    Reader,
    json::{extension, index, list, numbers},
};
use crate::{Animation, Choices, ReadOptions, WorldError};

/// What may move: the first words of the pointers to it.
const MAY_MOVE: [&str; 5] = ["cameras", "extensions", "materials", "meshes", "nodes"];

/// A word of a file and its numbers at a time.
pub(super) struct Posed {
    pointer: String,
    values: Vec<f64>,
}

impl<'c> Reader<'c> {
    /// Lists what the file can show in place of what it shows.
    pub(super) fn choices(&self) -> Choices {
        let end_s = |animation: &Value| {
            let inputs: BTreeSet<usize> =
                list(animation, "samplers").iter().filter_map(|sampler| index(sampler, "input")).collect();
            let rows = inputs.into_iter().filter_map(|input| self.rows(input).ok());
            rows.flat_map(|rows| rows.values).filter(|time_s| time_s.is_finite()).fold(0.0, f64::max)
        };
        let name = |of: &Value| of.get("name").and_then(Value::as_str).map(str::to_owned);
        let animation = |(number, of): (usize, &Value)| Animation {
            name: name(of).unwrap_or_else(|| format!("animation {}", number + 1)),
            end_s: end_s(of),
        };
        let variants = extension(self.root, "KHR_materials_variants").map_or(&[][..], |of| list(of, "variants"));
        Choices {
            animations: list(self.root, "animations").iter().enumerate().map(animation).collect(),
            variants: variants.iter().map(|of| name(of).unwrap_or_default()).collect(),
        }
    }

    /// Returns what moves, as it is at the time that is asked for.
    ///
    /// Without a choice these are of the first animation and of those that move what none before them does, as the viewer of
    /// the standard's makers has it: files of a walk and a run show the walk, files of an animation for each thing show them all.
    pub(super) fn pose(&mut self, options: &ReadOptions) -> Result<Vec<Posed>, WorldError> {
        let known = self.builder.choices().clone();
        let asked = options.animation.as_ref().map(|name| known.animation(name));
        let (mut posed, mut moved) = (Vec::new(), HashSet::new());
        for (number, (animation, Animation { name, end_s })) in
            list(self.root, "animations").iter().zip(&known.animations).enumerate()
        {
            let lasts = format!("{name} ({end_s:.3} s)");
            if options.time_s.is_none() && asked.is_none() {
                self.builder.note_of("animations, which move nothing without --time", &lasts);
                continue;
            }
            let time_s = options.time_s.unwrap_or(0.0);
            let channels = self.channels(animation, name);
            let is_shown = match asked {
                Some(asked) => asked == Some(number),
                None => !channels.iter().any(|(pointer, _)| moved.contains(pointer)),
            };
            if !is_shown {
                self.builder.note_of("animations beside the ones that are shown, left out", &lasts);
                continue;
            }
            if time_s > *end_s {
                self.builder.note(format!("{name} ends at {end_s:.3} s, and stands so at {time_s} s"));
            }
            for (pointer, sampler) in channels {
                posed.push(Posed {
                    values: self.sampled(sampler, time_s, pointer.ends_with("/rotation"))?,
                    pointer: pointer.clone(),
                });
                moved.insert(pointer);
            }
        }
        Ok(posed)
    }

    /// Returns the pointers to what an animation moves, each with its sampler.
    fn channels(&mut self, animation: &'c Value, name: &str) -> Vec<(String, &'c Value)> {
        let mut channels = Vec::new();
        for channel in list(animation, "channels") {
            let target = channel.get("target");
            let path = target.and_then(|target| target.get("path")).and_then(Value::as_str);
            let node = target.and_then(|target| index(target, "node"));
            let pointer = match (path, node) {
                (Some("pointer"), _) => target
                    .and_then(|target| extension(target, "KHR_animation_pointer")?.get("pointer")?.as_str())
                    .map(str::to_owned),
                (Some(path), Some(node)) => Some(format!("/nodes/{node}/{path}")),
                _ => None,
            };
            let pointer = pointer.filter(|pointer| MAY_MOVE.contains(&pointer.split('/').nth(1).unwrap_or("")));
            let sampler = index(channel, "sampler").and_then(|number| list(animation, "samplers").get(number));
            match (pointer, sampler) {
                (Some(pointer), Some(sampler)) => channels.push((pointer, sampler)),
                _ => self.builder.note_of("animations with channels that lead nowhere, left out", name),
            }
        }
        channels
    }

    fn sampled(&self, sampler: &Value, time_s: f64, is_rotation: bool) -> Result<Vec<f64>, WorldError> {
        let rows = |word: &str| {
            let accessor = index(sampler, word);
            self.rows(accessor.ok_or_else(|| self.fault(format!("a sampler of an animation has no {word}")))?)
        };
        let (times_s, values) = (rows("input")?.values, rows("output")?.values);
        let curve = Curve {
            interpolation: sampler.get("interpolation").and_then(Value::as_str).unwrap_or("LINEAR"),
            times_s: &times_s,
            values: &values,
            is_rotation,
        };
        let (n, of) = (values.len(), times_s.len());
        curve.at(time_s).ok_or_else(|| self.fault(format!("a sampler of an animation has {n} numbers at {of} times")))
    }
}

/// What a sampler says.
struct Curve<'v> {
    interpolation: &'v str,
    times_s: &'v [f64],
    values: &'v [f64],
    is_rotation: bool,
}

impl Curve<'_> {
    /// Returns the values at a time, by the standard's appendix C; before the first and after the last key as there.
    fn at(&self, time_s: f64) -> Option<Vec<f64>> {
        let n_keys = self.times_s.len();
        let is_cubic = self.interpolation == "CUBICSPLINE";
        let parts = if is_cubic { 3 } else { 1 };
        let n = self.values.len().checked_div(parts * n_keys).filter(|n| *n > 0)?;
        // Of a cubic spline a key has its tangent before, its value and its tangent after.
        let part = |key: usize, part: usize| &self.values[(parts * key + part) * n..][..n];
        let value = |key: usize| part(key, parts / 2);
        let next = self.times_s.partition_point(|key_s| *key_s <= time_s);
        if next == 0 || next == n_keys || self.interpolation == "STEP" {
            return Some(value(next.saturating_sub(1)).to_vec());
        }
        let (from, to) = (value(next - 1), value(next));
        let span_s = self.times_s[next] - self.times_s[next - 1];
        let s = (time_s - self.times_s[next - 1]) / span_s;
        if is_cubic {
            let (after, before) = (part(next - 1, 2), part(next, 0));
            let (s2, s3) = (s * s, s * s * s);
            let hermite = |k: usize| {
                (2.0 * s3 - 3.0 * s2 + 1.0) * from[k]
                    + span_s * (s3 - 2.0 * s2 + s) * after[k]
                    + (3.0 * s2 - 2.0 * s3) * to[k]
                    + span_s * (s3 - s2) * before[k]
            };
            return Some((0..n).map(hermite).collect());
        }
        if let (true, Some(from), Some(to)) = (self.is_rotation, rotation(from), rotation(to)) {
            // The shorter way round.
            return Some(from.slerp(to, s).to_array().to_vec());
        }
        Some(from.iter().zip(to).map(|(from, to)| from + s * (to - from)).collect())
    }
}

fn rotation(values: &[f64]) -> Option<DQuat> {
    let rotation = DQuat::from_array(values.try_into().ok()?);
    (rotation.length_squared() > 0.0 && rotation.is_finite()).then(|| rotation.normalize())
}

/// Returns a file in a pose, and the pointers that lead nowhere.
pub(super) fn posed(root: &Value, pose: &[Posed]) -> (Value, Vec<String>) {
    let mut root = root.clone();
    let lost = pose.iter().filter(|posed| posed.put_into(&mut root).is_none()).map(|posed| posed.pointer.clone());
    let lost = lost.collect();
    (root, lost)
}

impl Posed {
    fn put_into(&self, root: &mut Value) -> Option<()> {
        let (object, word) = self.pointer.rsplit_once('/')?;
        let object = object.split('/').skip(1).try_fold(root, |at, word| inner(at, word))?;
        if ["translation", "rotation", "scale"].contains(&word) {
            part_matrix(object);
        }
        let at = inner(object, word)?;
        let is_list = at.is_array() || word == "weights" || !at.is_number() && self.values.len() > 1;
        *at = match (at.is_boolean() || word == "visible", is_list) {
            (true, _) => Value::Bool(self.values[0] != 0.0),
            (false, true) => self.values.iter().copied().map(Value::from).collect(),
            (false, false) => Value::from(self.values[0]),
        };
        Some(())
    }
}

/// Returns what a word of a pointer leads to; a word that an object lacks is added to it.
fn inner<'v>(at: &'v mut Value, word: &str) -> Option<&'v mut Value> {
    if at.is_null() {
        *at = Value::Object(Map::new());
    }
    match at {
        Value::Array(items) => items.get_mut(word.parse::<usize>().ok()?),
        Value::Object(object) => Some(object.entry(word.replace("~1", "/").replace("~0", "~")).or_insert(Value::Null)),
        _ => None,
    }
}

/// Writes a node's matrix as the three words that move.
fn part_matrix(node: &mut Value) {
    let Some(m) = numbers::<16>(node, "matrix") else { return };
    let (scale, rotation, translation) = DMat4::from_cols_array(&m).to_scale_rotation_translation();
    let Some(node) = node.as_object_mut() else { return };
    node.remove("matrix");
    for (word, values) in [
        ("scale", &scale.to_array()[..]),
        ("rotation", &rotation.to_array()[..]),
        ("translation", &translation.to_array()[..]),
    ] {
        node.insert(word.to_owned(), values.iter().copied().map(Value::from).collect());
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    fn at(interpolation: &str, times_s: &[f64], values: &[f64], time_s: f64) -> Vec<f64> {
        Curve { interpolation, times_s, values, is_rotation: false }.at(time_s).unwrap()
    }

    /// A fall is a polynomial of the second degree, which cubic splines with its speeds at the keys go through.
    #[test]
    fn splines_follow_a_fall() {
        let (height_m, speed_m_s) = (|t: f64| 7.0 * t - 4.905 * t * t, |t: f64| 7.0 - 9.81 * t);
        let times_s = [0.0, 0.4, 1.5];
        let values: Vec<f64> = times_s.iter().flat_map(|&t| [speed_m_s(t), height_m(t), speed_m_s(t)]).collect();
        for time_s in [0.0, 0.1, 0.4, 0.9, 1.49] {
            let found = at("CUBICSPLINE", &times_s, &values, time_s)[0];
            assert!((found - height_m(time_s)).abs() < 1e-12, "{found} at {time_s} s");
        }
        assert_eq!(at("CUBICSPLINE", &times_s, &values, 9.0), [height_m(1.5)]);
    }

    /// An even turn has come by a third of its angle after a third of its time, also where its end is written with the other sign.
    #[test]
    fn turns_are_even_and_short() {
        let (sin, cos) = (0.5 * FRAC_PI_2).sin_cos();
        for sign in [1.0, -1.0] {
            let values = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, sign * sin, sign * cos];
            let curve = Curve { interpolation: "LINEAR", times_s: &[1.0, 4.0], values: &values, is_rotation: true };
            let turned = DQuat::from_slice(&curve.at(2.0).unwrap());
            assert!((turned.to_axis_angle().1 - FRAC_PI_2 / 3.0).abs() < 1e-12, "{turned}");
        }
    }

    #[test]
    fn steps_hold_and_lines_are_straight() {
        let (times_s, values) = ([1.0, 2.0, 4.0], [0.0, 10.0, 1.0, 20.0, 5.0, 40.0]);
        for (time_s, step, line) in
            [(0.0, 0.0, 0.0), (1.5, 0.0, 0.5), (2.0, 1.0, 1.0), (3.0, 1.0, 3.0), (4.0, 5.0, 5.0), (9.0, 5.0, 5.0)]
        {
            assert_eq!(at("STEP", &times_s, &values, time_s)[0], step, "{time_s}");
            assert_eq!(at("LINEAR", &times_s, &values, time_s)[0], line, "{time_s}");
        }
        let short = Curve { interpolation: "LINEAR", times_s: &times_s, values: &[1.0], is_rotation: false };
        assert_eq!(short.at(1.0), None);
    }
}
