//! A request to stop long work, shared between threads.

use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

/// A request to stop, which the one who waits for a result makes and the workers look at.
///
/// Clones share one request. Every long computation of the workspace takes one, looks at it at least every few
/// milliseconds of work, and ends with its crate's `Cancelled` error.
///
/// ```
/// use dioptric_spectrum::{Cancel, Cancelled};
/// let cancel = Cancel::new();
/// assert_eq!(cancel.check(), Ok(()));
/// cancel.clone().cancel();
/// assert_eq!(cancel.check(), Err(Cancelled));
/// ```
#[derive(Clone, Debug, Default)]
pub struct Cancel(Arc<AtomicBool>);

impl Cancel {
    /// A request that has not been made.
    pub fn new() -> Self {
        Self::default()
    }

    /// Makes the request, once and for all.
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether the request was made.
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// Returns an error once the request was made, for use with `?`.
    ///
    /// # Errors
    /// When the request was made.
    pub fn check(&self) -> Result<(), Cancelled> {
        if self.is_cancelled() { Err(Cancelled) } else { Ok(()) }
    }
}

/// Work that was stopped on request before it was done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the work was cancelled")]
pub struct Cancelled;
