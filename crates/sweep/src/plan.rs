//! A plan: a camera, what is varied of it, and what is written of each picture.

use std::{
    fs,
    path::{Path, PathBuf},
};

use dioptric_pipeline::{Camera, ExrSamples, FrameFile, Outputs};
use ron::value::RawValue;
use serde::Deserialize;

use crate::{
    SweepError,
    axes::{MOST_POINTS, Sampling},
};

/// A plan of many pictures, as a file states it.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// The camera that every item starts from.
    pub base: Base,
    /// What is varied: the items are all combinations of a point of each; the last changes fastest.
    pub vary: Vec<Sampling>,
    /// What is written of each item beside what is kept of it anyway.
    #[serde(default)]
    pub outputs: PlanOutputs,
    /// What is kept of each item: all of these, or some. Its metrics always are.
    #[serde(default = "Keep::all")]
    pub keep: Vec<Keep>,
}

/// A file that is kept of each item.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum Keep {
    /// `picture.png`.
    Picture,
    /// `report.json`; without it `metrics.json` has the numbers of the index alone.
    Report,
    /// `camera.ron`, which takes the same picture again.
    Camera,
    /// `thumbnail.png`; without it the contact sheet shows the picture.
    Thumbnail,
}

impl Keep {
    /// All of them.
    pub(crate) fn all() -> Vec<Self> {
        vec![Self::Picture, Self::Report, Self::Camera, Self::Thumbnail]
    }
}

/// The camera that every item starts from.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum Base {
    /// The camera of the built-in demo.
    Demo,
    /// A camera file; its path is relative to the plan.
    File(PathBuf),
    /// This camera, the content of a camera file; paths in it are relative to the plan.
    Camera(#[cfg_attr(feature = "schema", schemars(with = "dioptric_pipeline::Camera"))] Box<RawValue>),
}

/// What is written of each item beside its picture and its report; the words are those of the camera file's `outputs`, which
/// these take the place of.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct PlanOutputs {
    /// `irradiance.exr`, the spectral irradiance on the sensor.
    pub irradiance: bool,
    /// `depth.exr`, the depth that was used.
    pub depth: bool,
    /// `volts.exr`, the voltages of the pixels.
    pub volts: bool,
    /// `raw.png`, the digital numbers in 16 bits.
    pub raw: bool,
    /// More files of the sensor's frames.
    pub also: Vec<FrameFile>,
    /// How samples are stored in EXR files.
    pub exr_samples: ExrSamples,
}

impl Base {
    /// Returns the camera, its paths absolute.
    ///
    /// `folder` is that of the plan, whose name errors begin with.
    pub(crate) fn open(&self, folder: &Path, plan: &Path) -> Result<Camera, SweepError> {
        Ok(match self {
            Self::Demo => Camera::demo()?,
            Self::File(file) => Camera::read(&folder.join(file))?,
            Self::Camera(text) => {
                // Lines count from the top of the plan, where that is a file that can be read once more.
                let name = Path::new(plan.file_name().unwrap_or(plan.as_os_str()));
                let whole = fs::read_to_string(plan).unwrap_or_default();
                let above = whole.find(text.get_ron()).map_or(0, |at| whole[..at].matches('\n').count());
                let mut camera = Camera::parse(&("\n".repeat(above) + text.get_ron()), name)?;
                camera.resolve_paths(folder);
                camera
            }
        })
    }
}

impl PlanOutputs {
    /// Returns them as those of a camera.
    pub(crate) fn of_camera(&self) -> Outputs {
        let Self { irradiance, depth, volts, raw, also, exr_samples } = self.clone();
        Outputs { irradiance, depth, volts, raw, also, exr_samples }
    }
}

impl Plan {
    /// Reads a plan file.
    ///
    /// # Errors
    /// As [`parse`](Self::parse), and when the file cannot be read.
    pub fn read(path: &Path) -> Result<Self, SweepError> {
        let text = dioptric_files::text::read(path).map_err(SweepError::reading(path))?;
        Self::parse(&text, path)
    }

    /// Reads a plan from text; `path` names it in errors.
    ///
    /// # Errors
    /// Names the line or the key that is wrong, and what was expected.
    pub fn parse(text: &str, path: &Path) -> Result<Self, SweepError> {
        let plan: Self = dioptric_files::ron::from_text(text).map_err(|error| SweepError::Syntax {
            path: path.to_owned(),
            line: error.line,
            column: error.column,
            reason: error.reason,
        })?;
        plan.check(path)?;
        Ok(plan)
    }

    /// Returns the number of items.
    pub fn count(&self) -> usize {
        // Checked when it was read.
        self.vary.iter().filter_map(Sampling::count).product()
    }

    /// The keys that are varied, in the order of the plan.
    pub fn keys(&self) -> Vec<&str> {
        self.vary.iter().flat_map(Sampling::keys).collect()
    }

    fn check(&self, path: &Path) -> Result<(), SweepError> {
        let whole = |reason: String| SweepError::Plan { path: path.to_owned(), reason };
        let of_key =
            |key: &str, reason: String| SweepError::Axis { path: path.to_owned(), key: key.to_owned(), reason };
        if let Some(twice) = self.keep.iter().enumerate().find(|(n, own)| self.keep[..*n].contains(own)) {
            return Err(whole(format!("keep names {:?} twice", twice.1)));
        }
        if self.vary.is_empty() {
            return Err(whole("vary is empty, expected one or more ways of varying".to_owned()));
        }
        for sampling in &self.vary {
            sampling.check().map_err(|(key, reason)| match key {
                Some(key) => of_key(&key, reason),
                None => whole(reason),
            })?;
        }
        let keys = self.keys();
        for (n, key) in keys.iter().enumerate() {
            if key.split('.').next() == Some("outputs") {
                return Err(of_key(key, "what is written is stated in the outputs of the plan".to_owned()));
            }
            if key.split('.').any(str::is_empty) {
                return Err(of_key(
                    key,
                    "expected keys of the camera file separated by dots, as focus.DistanceMm".to_owned(),
                ));
            }
            if let Some(other) = keys[..n].iter().find(|other| is_same_place(other, key)) {
                let reason =
                    if other == key { "it is varied twice".to_owned() } else { format!("'{other}' sets it too") };
                return Err(of_key(key, reason));
            }
        }
        let count = self.vary.iter().try_fold(1_usize, |n, sampling| n.checked_mul(sampling.count()?));
        match count.filter(|count| *count <= MOST_POINTS) {
            Some(_) => Ok(()),
            None => Err(whole(format!("it has more than {MOST_POINTS} items"))),
        }
    }
}

/// Whether two paths cannot both be set: one holds the other, or both choose at one place.
fn is_same_place(one: &str, other: &str) -> bool {
    let (mut one, mut other) = (one.split('.'), other.split('.'));
    loop {
        match (one.next(), other.next()) {
            (Some(a), Some(b)) if a == b => {}
            (Some(a), Some(b)) => return [a, b].iter().all(|part| part.starts_with(|c: char| c.is_uppercase())),
            _ => return true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(vary: &str) -> String {
        Plan::parse(&format!("(base: Demo, vary: {vary})"), Path::new("p.ron")).unwrap_err().to_string()
    }

    #[test]
    fn blocks_multiply() {
        let text = r#"(base: Demo, vary: [Grid({"seed": List([1, 2, 3])}),
            Sobol(count: 8, seed: 1, axes: {"stop.FNumber": Uniform(least: 4, most: 8)})])"#;
        let plan = Plan::parse(text, Path::new("p.ron")).unwrap();
        assert_eq!((plan.count(), plan.keys()), (24, vec!["seed", "stop.FNumber"]));
    }

    #[test]
    fn impossible_plans_end_in_one_sentence() {
        for (vary, words) in [
            ("[]", "p.ron: vary is empty"),
            ("[Grid({\"seed\": List([])})]", "p.ron: 'seed': it has no values"),
            ("[Grid({\"seed\": List([1])}), Grid({\"seed\": List([2])})]", "p.ron: 'seed': it is varied twice"),
            ("[Grid({\"stop\": List([AsGiven]), \"stop.FNumber\": List([2])})]", "'stop.FNumber': 'stop' sets it too"),
            ("[Grid({\"stop.FNumber\": List([2]), \"stop.DiameterMm\": List([2])})]", "'stop.FNumber' sets it too"),
            ("[Grid({\"outputs.raw\": List([true])})]", "outputs of the plan"),
            ("[Grid({\"focus.\": List([1])})]", "'focus.': expected keys"),
            ("[Grid({\"seed\": Linear(first: 1, last: 2, count: 20000000)})]", "more than 10000000 items"),
            ("[Grid({\"seed\": Liste([1])})]", "p.ron:1:"),
            ("[Grid({\"seed\": List([1])}", "p.ron:1:"),
        ] {
            let message = error(vary);
            assert!(message.contains(words) && !message.contains('\n'), "{message}");
        }
        let text = "(base: Demo, vary: [Grid({\"seed\": List([1])})], keep: [Picture, Picture])";
        let message = Plan::parse(text, Path::new("p.ron")).unwrap_err().to_string();
        assert_eq!(message, "p.ron: keep names Picture twice");
        assert!(Plan::parse("never", Path::new("p.ron")).unwrap_err().to_string().starts_with("p.ron:1:1: "));
    }
}
