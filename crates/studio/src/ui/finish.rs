//! Full pictures that are waited for: of snapshots whose difference is shown, and of cameras whose picture is to be written.
//!
//! The engine takes pictures of the camera on the desk alone; those of others are taken by another one, a camera at a time.

use std::{io, path::PathBuf, sync::Arc};

use dioptric_pipeline::Camera;

use super::{Shown, Studio, Tab};
use crate::{
    engine::{Engine, EngineSettings, Product, Rung},
    session::Snapshot,
};

/// What is to be written when a full picture is there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Waiting {
    /// The picture.
    Picture(PathBuf),
    /// The folder of a run.
    Export(PathBuf),
}

/// Full pictures that are waited for.
#[derive(Debug)]
pub(super) struct Finish {
    engine: Engine,
    /// Of which camera, and what for.
    waiting: Vec<(Camera, Waiting)>,
    /// The camera whose picture this engine takes, and the number of its submission.
    current: Option<(Camera, u64)>,
    /// Cameras of which there is no picture, with the reason.
    faults: Vec<(Camera, String)>,
}

impl Finish {
    pub(super) fn start(settings: EngineSettings, wake: impl Fn() + Send + Sync + 'static) -> io::Result<Self> {
        let engine = Engine::start(settings, wake)?;
        Ok(Self { engine, waiting: Vec::new(), current: None, faults: Vec::new() })
    }

    /// Whether a picture is being taken.
    pub(super) fn is_busy(&self) -> bool {
        self.current.is_some()
    }

    /// Returns why there is no picture of one of two cameras, where there is none.
    pub(super) fn fault(&self, a: Option<&Camera>, b: Option<&Camera>) -> Option<&str> {
        let is_of = |camera: &Camera| [a, b].contains(&Some(camera));
        self.faults.iter().find(|(camera, _)| is_of(camera)).map(|(_, words)| words.as_str())
    }
}

impl Studio {
    /// Writes something of the camera on the desk as soon as its full picture is there.
    pub(super) fn when_full(&mut self, waiting: Waiting) {
        let camera = self.session.camera().clone();
        match self.full_of(&camera) {
            Some(product) => self.write_full(&product, waiting),
            None => {
                let (Waiting::Picture(path) | Waiting::Export(path)) = &waiting;
                self.note = Some(format!("{} is written when the full picture is there", path.display()));
                self.finish.faults.retain(|(other, _)| *other != camera);
                self.finish.waiting.push((camera, waiting));
            }
        }
    }

    /// Returns the full picture of a camera, where it is at hand.
    fn full_of(&self, camera: &Camera) -> Option<Arc<Product>> {
        let shown = self.results.as_ref().map(|results| &results.product);
        let known = shown.into_iter().chain(self.snapshots.iter().flatten());
        known.into_iter().find(|product| product.rung == Rung::Full && product.camera() == camera).cloned()
    }

    /// Takes a picture for the snapshots whose camera it is of, where it is better than theirs.
    pub(super) fn improve(&mut self, product: &Arc<Product>) {
        for which in Snapshot::ALL {
            let is_own = self.session.snapshot(which) == Some(product.camera());
            let kept = &mut self.snapshots[which as usize];
            let is_better = |kept: &Arc<Product>| {
                kept.camera() != product.camera() || (kept.rung, kept.n_samples) < (product.rung, product.n_samples)
            };
            // A full picture of a world has no number of samples.
            let is_full = product.rung == Rung::Full;
            if is_own && kept.as_ref().is_none_or(|kept| is_full || is_better(kept)) {
                *kept = Some(product.clone());
            }
        }
    }

    /// Takes what came of full pictures, writes what waited for them, and has the next one taken.
    pub(super) fn finish(&mut self) {
        for delivery in self.finish.engine.take() {
            let Some((camera, generation)) = self.finish.current.clone() else { continue };
            if generation != delivery.generation {
                continue;
            }
            match delivery.outcome {
                Ok(product) => {
                    self.improve(&product);
                    if product.rung == Rung::Full {
                        self.write_waiting(&product);
                        self.finished();
                    }
                }
                Err(fault) => {
                    self.fail(&camera, &fault.message);
                    self.finished();
                }
            }
        }
        // What the desk's own engine has taken need not be taken again.
        let shown = self.results.as_ref().map(|results| results.product.clone());
        if let Some(product) = shown.filter(|product| product.rung == Rung::Full) {
            self.write_waiting(&product);
        }
        if let Some(fault) = self.fault.clone() {
            let camera = self.session.camera().clone();
            self.fail(&camera, &fault.message);
        }
        let next = self.next_to_finish();
        if self.finish.current.as_ref().map(|(camera, _)| camera) != next.as_ref() {
            self.finish.engine.stop();
            self.finish.current = next.map(|camera| {
                let generation = self.finish.engine.submit(camera.clone(), Rung::Full);
                (camera, generation)
            });
        }
    }

    fn finished(&mut self) {
        self.finish.current = None;
        // What it would paint ahead is for a hand that changes this camera.
        self.finish.engine.stop();
    }

    fn write_waiting(&mut self, product: &Arc<Product>) {
        let waiting = std::mem::take(&mut self.finish.waiting);
        let (own, others) = waiting.into_iter().partition(|(camera, _)| camera == product.camera());
        self.finish.waiting = others;
        let own: Vec<(Camera, Waiting)> = own;
        own.into_iter().for_each(|(_, waiting)| self.write_full(product, waiting));
    }

    /// Gives up what waited for the picture of a camera.
    fn fail(&mut self, camera: &Camera, words: &str) {
        let n = self.finish.waiting.len();
        self.finish.waiting.retain(|(other, _)| other != camera);
        if self.finish.waiting.len() < n {
            self.note = Some(format!("nothing is written, for there is no picture: {words}"));
        }
        let is_snapshot = Snapshot::ALL.into_iter().any(|which| self.session.snapshot(which) == Some(camera));
        if is_snapshot && self.finish.faults.iter().all(|(other, _)| other != camera) {
            self.finish.faults.push((camera.clone(), words.to_owned()));
        }
    }

    /// Returns the camera whose full picture is to be taken next; none where the desk's own engine is at it.
    fn next_to_finish(&self) -> Option<Camera> {
        let waiting = self.finish.waiting.iter().map(|(camera, _)| camera);
        let is_shown = self.tab == Tab::Picture && self.shown == Shown::Difference;
        let snapshots = Snapshot::ALL.into_iter().filter(|_| is_shown).filter_map(|which| self.session.snapshot(which));
        let is_on_desk = |camera: &Camera| !self.is_paused && self.fault.is_none() && camera == self.session.camera();
        let is_known = |camera: &Camera| {
            self.full_of(camera).is_some() || self.finish.faults.iter().any(|(other, _)| other == camera)
        };
        let mut missing = waiting.chain(snapshots).filter(|camera| !is_known(camera));
        missing.find(|camera| !is_on_desk(camera)).cloned()
    }
}
