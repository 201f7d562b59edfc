//! The cameras of a plan, each drawn up when it is asked for.

use std::path::{Path, PathBuf};

use dioptric_pipeline::Camera;

use crate::{Plan, SweepError, Value, axes::Points, inputs::Inputs, key::ItemKey};

/// A plan whose items can be asked for one by one.
#[derive(Debug)]
pub(crate) struct Cameras {
    path: PathBuf,
    /// That of the plan, absolute: what paths are relative to.
    folder: PathBuf,
    plan: Plan,
    points: Vec<Points>,
    base: Value,
    /// What takes the place of settings that an irradiance does not depend on.
    still: Camera,
    inputs: Inputs,
}

impl Cameras {
    /// Opens the base of a plan; `path` names the plan in errors, and its paths are relative to that one's folder.
    pub(crate) fn of(plan: Plan, path: &Path) -> Result<Self, SweepError> {
        let parent = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let folder = parent.canonicalize().map_err(SweepError::reading(parent))?;
        let camera = plan.base.open(&folder, path)?;
        let base = Value::parse(&camera.to_ron()).expect("what a camera writes is RON");
        let points = plan.vary.iter().map(Points::of).collect();
        let (still, inputs) = (Camera::demo()?, Inputs::default());
        Ok(Self { path: path.to_owned(), folder, plan, points, base, still, inputs })
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    pub(crate) fn plan(&self) -> &Plan {
        &self.plan
    }

    pub(crate) fn inputs(&self) -> &Inputs {
        &self.inputs
    }

    /// Returns what an item sets, in the order of [`Plan::keys`].
    pub(crate) fn values(&self, mut item: usize) -> Vec<Value> {
        let mut blocks: Vec<Vec<Value>> = Vec::with_capacity(self.points.len());
        for (sampling, points) in self.plan.vary.iter().zip(&self.points).rev() {
            // Checked when the plan was read.
            let n = sampling.count().unwrap_or(1);
            blocks.push(points.at(item % n));
            item /= n;
        }
        blocks.into_iter().rev().flatten().collect()
    }

    /// Returns the camera of an item, its paths absolute and its outputs those of the plan.
    pub(crate) fn camera(&self, item: usize) -> Result<Camera, SweepError> {
        let values = self.values(item);
        let mut camera = self.with(values.iter().enumerate()).map_err(|reason| self.blame(&values, reason))?;
        camera.resolve_paths(&self.folder);
        camera.outputs = self.plan.outputs.of_camera();
        Ok(camera)
    }

    /// Returns the names of an item and of what it shares with others.
    pub(crate) fn key(&self, camera: &Camera) -> Result<ItemKey, SweepError> {
        Ok(ItemKey::of(camera, &self.still, &self.inputs)?.keeping(&self.plan.keep))
    }

    /// Returns the base with some of the keys set.
    fn with<'a>(&self, values: impl Iterator<Item = (usize, &'a Value)>) -> Result<Camera, String> {
        let (keys, mut camera) = (self.plan.keys(), self.base.clone());
        for (axis, value) in values {
            camera.set(keys[axis], value.clone())?;
        }
        camera.typed()
    }

    /// Returns the error of values that make no camera, with the key that it is about.
    fn blame(&self, values: &[Value], reason: String) -> SweepError {
        let keys = self.plan.keys();
        let alone = |axis: &usize| self.with(std::iter::once((*axis, &values[*axis]))).is_err_and(|own| own == reason);
        let first = |n: &usize| self.with(values.iter().enumerate().take(*n + 1)).is_err();
        let axis = (0..values.len()).find(alone).or_else(|| (0..values.len()).find(first)).unwrap_or(0);
        SweepError::Axis { path: self.path.clone(), key: keys[axis].to_owned(), reason }
    }
}
