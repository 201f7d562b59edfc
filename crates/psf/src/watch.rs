//! Progress of work that threads share, and its cancelling.

use std::sync::atomic::{AtomicUsize, Ordering};

use dioptric_spectrum::{Cancel, Cancelled};

/// Steps of shared work: counts them, reports the part that is done, and ends when asked to.
pub(crate) struct Watch<'a> {
    progress: &'a (dyn Fn(f64) + Sync),
    cancel: &'a Cancel,
    n_done: AtomicUsize,
    n_steps: usize,
}

impl<'a> Watch<'a> {
    /// Watches work of this many steps.
    pub(crate) fn new(n_steps: usize, progress: &'a (dyn Fn(f64) + Sync), cancel: &'a Cancel) -> Self {
        Self { progress, cancel, n_done: AtomicUsize::new(0), n_steps }
    }

    /// Fails once the work was cancelled: to be called before each step.
    pub(crate) fn check(&self) -> Result<(), Cancelled> {
        self.cancel.check()
    }

    /// Counts steps that are done.
    pub(crate) fn done(&self, n_steps: usize) {
        let n_done = self.n_done.fetch_add(n_steps, Ordering::Relaxed) + n_steps;
        (self.progress)(n_done as f64 / self.n_steps.max(1) as f64);
    }
}
