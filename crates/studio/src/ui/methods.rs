//! A world by both methods, as the two snapshots.

use dioptric_pipeline::{Camera, RenderMethod, SceneSource};

use super::{Shown, Studio, Tab};
use crate::{engine::Rung, session::Snapshot};

/// Two pictures of a world being taken for comparison, the one of the other method first.
#[derive(Clone, Debug)]
pub(super) struct Comparison {
    /// The camera on the desk, to whose picture the window returns.
    of: Camera,
    /// The number of the camera whose picture is awaited.
    generation: u64,
    is_second: bool,
}

/// Returns the method of a world's camera.
fn method(camera: &Camera) -> Option<RenderMethod> {
    match &camera.scene.source {
        SceneSource::World(world) => Some(world.method),
        _ => None,
    }
}

/// Returns the snapshot of a method: A is backward, B forward.
fn snapshot(method: RenderMethod) -> Snapshot {
    match method {
        RenderMethod::Backward => Snapshot::A,
        RenderMethod::Forward => Snapshot::B,
    }
}

impl Studio {
    /// Takes the picture of the world by the other method and by its own, backward as A and forward as B, and shows A − B.
    pub fn compare_methods(&mut self) {
        let mut other = self.session.camera().clone();
        let SceneSource::World(world) = &mut other.scene.source else { return };
        world.method = match world.method {
            RenderMethod::Backward => RenderMethod::Forward,
            RenderMethod::Forward => RenderMethod::Backward,
        };
        let of = self.session.camera().clone();
        self.fault = None;
        self.generation = self.engine.submit(other, Rung::Full);
        self.comparison = Some(Comparison { of, generation: self.generation, is_second: false });
        self.note = Some("taking the picture of the world by both methods".to_owned());
    }

    /// Keeps what has come of a comparison and goes on with it; one whose camera was changed meanwhile is given up.
    pub(super) fn go_on_comparing(&mut self) {
        let Some(comparison) = self.comparison.clone() else { return };
        if comparison.generation != self.generation || comparison.of != *self.session.camera() || self.fault.is_some() {
            self.comparison = None;
            return;
        }
        let arrived = self.results.as_ref().filter(|results| {
            results.delivery.generation == comparison.generation && results.delivery.rung == Rung::Full
        });
        let Some(product) = arrived.map(|results| results.product.clone()) else { return };
        let Some(method) = method(product.camera()) else { return };
        self.session.keep_snapshot_of(snapshot(method), product.camera().clone());
        self.snapshots[snapshot(method) as usize] = Some(product);
        self.unsaved.get_or_insert_with(std::time::Instant::now);
        if comparison.is_second {
            self.comparison = None;
            (self.tab, self.shown) = (Tab::Picture, Shown::Difference);
            self.note = Some("A is backward, B is forward".to_owned());
        } else {
            self.generation = self.engine.submit(comparison.of.clone(), Rung::Full);
            self.comparison = Some(Comparison { generation: self.generation, is_second: true, ..comparison });
        }
    }
}
