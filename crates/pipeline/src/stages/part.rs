//! Progress of work that is a part of other work.

use std::sync::Arc;

use crate::{Clock, ImagingTimes, Progress, Stage};

/// Progress of one of so many equal parts.
pub(super) struct Part<'a> {
    pub(super) progress: &'a dyn Progress,
    pub(super) number: usize,
    pub(super) of: usize,
}

impl Progress for Part<'_> {
    fn at(&self, stage: Stage, fraction: f64) {
        self.progress.at(stage, (self.number as f64 + fraction) / self.of as f64);
    }

    fn clock(&self) -> Option<Arc<Clock>> {
        self.progress.clock()
    }

    fn imaged(&self, times: &ImagingTimes) {
        self.progress.imaged(times);
    }
}
