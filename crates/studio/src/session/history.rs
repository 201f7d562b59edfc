//! What can be taken back.

use dioptric_pipeline::Camera;

/// The most steps that are kept: a camera takes some kilobytes.
const MOST: usize = 1000;

/// Cameras before and after the present one.
#[derive(Clone, Debug, Default)]
pub struct History {
    /// Oldest first.
    past: Vec<Camera>,
    /// What was taken back last, last.
    future: Vec<Camera>,
    gesture: Option<u64>,
}

impl History {
    /// The number of changes that can be taken back.
    pub fn n_past(&self) -> usize {
        self.past.len()
    }

    /// The number of changes that can be made again.
    pub fn n_future(&self) -> usize {
        self.future.len()
    }

    /// Notes the camera before a change; those within one gesture are one.
    pub(super) fn note(&mut self, before: Camera, gesture: Option<u64>) {
        self.future.clear();
        if gesture.is_some() && gesture == self.gesture {
            return;
        }
        self.gesture = gesture;
        self.past.push(before);
        if self.past.len() > MOST {
            self.past.remove(0);
        }
    }

    pub(super) fn end_gesture(&mut self) {
        self.gesture = None;
    }

    pub(super) fn undo(&mut self, present: &mut Camera) -> bool {
        self.gesture = None;
        let Some(before) = self.past.pop() else { return false };
        self.future.push(std::mem::replace(present, before));
        true
    }

    pub(super) fn redo(&mut self, present: &mut Camera) -> bool {
        self.gesture = None;
        let Some(after) = self.future.pop() else { return false };
        self.past.push(std::mem::replace(present, after));
        true
    }
}
