//! What can be taken back.

/// The most steps that are kept: a camera takes some kilobytes.
const MOST: usize = 1000;

/// States before and after the present one.
#[derive(Clone, Debug)]
pub struct History<T> {
    /// Oldest first.
    past: Vec<T>,
    /// What was taken back last, last.
    future: Vec<T>,
    gesture: Option<u64>,
}

impl<T> Default for History<T> {
    fn default() -> Self {
        Self { past: Vec::new(), future: Vec::new(), gesture: None }
    }
}

impl<T> History<T> {
    /// The number of changes that can be taken back.
    pub fn n_past(&self) -> usize {
        self.past.len()
    }

    /// The number of changes that can be made again.
    pub fn n_future(&self) -> usize {
        self.future.len()
    }

    /// Notes the state before a change; those within one gesture are one.
    pub(super) fn note(&mut self, before: T, gesture: Option<u64>) {
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

    /// Ends a gesture.
    pub(super) fn end_gesture(&mut self) {
        self.gesture = None;
    }

    pub(super) fn undo(&mut self, present: &mut T) -> bool {
        self.gesture = None;
        let Some(before) = self.past.pop() else { return false };
        self.future.push(std::mem::replace(present, before));
        true
    }

    pub(super) fn redo(&mut self, present: &mut T) -> bool {
        self.gesture = None;
        let Some(after) = self.future.pop() else { return false };
        self.past.push(std::mem::replace(present, after));
        true
    }

    /// Calls `rename` for the states next to the present one, in both directions, as long as it says that they are of its kind.
    pub(super) fn rename(&mut self, mut rename: impl FnMut(&mut T) -> bool) {
        for states in [&mut self.past, &mut self.future] {
            for state in states.iter_mut().rev() {
                if !rename(state) {
                    break;
                }
            }
        }
    }
}
