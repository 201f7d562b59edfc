//! Where the time of imaging goes.

use std::{
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};

/// Returns a time that grows: of the day, or that a thread has run.
pub type Clock = dyn Fn() -> Duration + Send + Sync;

/// The time that the parts of imaging took, summed over threads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ImagingTimes {
    /// Computing kernels of the lens, but for those that the plan was made with.
    pub kernels: Duration,
    /// Sampling the scene on the film.
    pub sampling: Duration,
    /// Spreading by Fourier transforms.
    pub transforms: Duration,
    /// Spreading by sums.
    pub direct: Duration,
    /// Adding patches up and compositing layers.
    pub compositing: Duration,
}

impl ImagingTimes {
    /// The parts with their names, in the order of the work.
    pub fn parts(&self) -> [(&'static str, Duration); 5] {
        [
            ("kernels", self.kernels),
            ("sampling", self.sampling),
            ("transforms", self.transforms),
            ("direct", self.direct),
            ("compositing", self.compositing),
        ]
    }

    /// Returns what has been added since an earlier time of the same plan.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        Self {
            kernels: self.kernels.saturating_sub(earlier.kernels),
            sampling: self.sampling.saturating_sub(earlier.sampling),
            transforms: self.transforms.saturating_sub(earlier.transforms),
            direct: self.direct.saturating_sub(earlier.direct),
            compositing: self.compositing.saturating_sub(earlier.compositing),
        }
    }
}

/// A part of imaging.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Part {
    Kernels,
    Sampling,
    Transforms,
    Direct,
    Compositing,
}

/// Adds up the time of each part, where there is a clock; clones add to the same sums.
#[derive(Clone, Default)]
pub(crate) struct Stopwatch {
    clock: Option<Arc<Clock>>,
    /// In the order of [`Part`].
    nanoseconds: Arc<[AtomicU64; 5]>,
}

impl Stopwatch {
    pub(crate) fn of(clock: Arc<Clock>) -> Self {
        Self { clock: Some(clock), ..Self::default() }
    }

    /// Does a piece of work on this thread.
    pub(crate) fn time<R>(&self, part: Part, work: impl FnOnce() -> R) -> R {
        let Some(clock) = &self.clock else { return work() };
        let start = clock();
        let result = work();
        let taken = clock().saturating_sub(start);
        self.nanoseconds[part as usize].fetch_add(taken.as_nanos() as u64, Ordering::Relaxed);
        result
    }

    pub(crate) fn times(&self) -> ImagingTimes {
        let of = |part: Part| Duration::from_nanos(self.nanoseconds[part as usize].load(Ordering::Relaxed));
        ImagingTimes {
            kernels: of(Part::Kernels),
            sampling: of(Part::Sampling),
            transforms: of(Part::Transforms),
            direct: of(Part::Direct),
            compositing: of(Part::Compositing),
        }
    }
}
