//! Who follows a computation and may end it.

use std::{
    panic,
    sync::mpsc::{self, RecvTimeoutError},
    thread,
    time::Duration,
};

use dioptric_spectrum::{Cancel, Cancelled};

use crate::{PipelineError, Progress};

/// How often a cancel is looked at while a step runs that does not look itself.
const LOOK: Duration = Duration::from_millis(2);

/// Who follows a computation and may end it.
#[derive(Clone, Copy)]
pub(crate) struct Watch<'a> {
    pub(crate) progress: &'a dyn Progress,
    pub(crate) cancel: &'a Cancel,
}

impl Watch<'_> {
    /// Runs a step that does not check for a cancel, on a thread of its own, and leaves it when the work is cancelled; it then ends by
    /// itself, and its result is lost. For steps of a fraction of a second, and for reading files.
    ///
    /// On a thread of a pool of rayon the step runs there and to its end: another thread would use another pool.
    pub(super) fn run<T: Send + 'static>(
        &self,
        step: impl FnOnce() -> Result<T, PipelineError> + Send + 'static,
    ) -> Result<T, PipelineError> {
        self.run_reporting(&|_| {}, move |_| step())
    }

    /// Runs a step as [`run`](Self::run) does; the part of it that is done, 0–1, goes to `report`, on this thread unless it is
    /// one of a pool.
    ///
    /// A step that looks at the cancel itself may take its time to give back what memory it had: nobody waits for that.
    pub(super) fn run_reporting<T: Send + 'static>(
        &self,
        report: &(dyn Fn(f64) + Sync),
        step: impl FnOnce(&(dyn Fn(f64) + Sync)) -> Result<T, PipelineError> + Send + 'static,
    ) -> Result<T, PipelineError> {
        self.cancel.check()?;
        if rayon::current_thread_index().is_some() {
            return step(report);
        }
        let (sender, messages) = mpsc::channel();
        let worker = thread::Builder::new()
            .name("dioptric-step".to_owned())
            .spawn(move || {
                // Nobody may be waiting any more.
                let result = step(&|part| drop(sender.send(Message::Part(part))));
                drop(sender.send(Message::Done(result)));
            })
            .map_err(|error| PipelineError::Unsuitable { what: "a thread", reason: error.to_string() })?;
        loop {
            match messages.recv_timeout(LOOK) {
                Ok(Message::Done(result)) => return result,
                Ok(Message::Part(_)) if self.cancel.is_cancelled() => return Err(Cancelled.into()),
                Ok(Message::Part(part)) => report(part),
                Err(RecvTimeoutError::Timeout) if self.cancel.is_cancelled() => return Err(Cancelled.into()),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => match worker.join() {
                    Err(cause) => panic::resume_unwind(cause),
                    Ok(()) => unreachable!("a step that ends sends its result"),
                },
            }
        }
    }
}

/// What a step on a thread of its own sends.
enum Message<T> {
    /// The part of it that is done.
    Part(f64),
    Done(Result<T, PipelineError>),
}

#[cfg(test)]
mod tests {
    use std::sync::{
        Mutex,
        atomic::{AtomicBool, Ordering},
    };

    use super::*;
    use crate::Silent;

    #[test]
    fn a_step_is_left_when_cancelled() {
        static ENDED: AtomicBool = AtomicBool::new(false);
        let (cancel, (go, may_go)) = (Cancel::new(), mpsc::channel());
        let watch = Watch { progress: &Silent, cancel: &cancel };
        let canceller = cancel.clone();
        let left = watch.run(move || {
            canceller.cancel();
            // Only once the caller is back.
            may_go.recv().unwrap();
            ENDED.store(true, Ordering::SeqCst);
            Ok(())
        });
        assert!(matches!(left, Err(PipelineError::Cancelled(_))));
        assert!(!ENDED.load(Ordering::SeqCst));
        go.send(()).unwrap();
        // A cancelled watch starts nothing.
        assert!(watch.run(|| Ok(1)).is_err());
    }

    #[test]
    fn a_step_reports_on_the_thread_that_waits() {
        let here = thread::current().id();
        let parts = || {
            let seen = Mutex::new(vec![]);
            let watch = Watch { progress: &Silent, cancel: &Cancel::new() };
            let report = |part: f64| seen.lock().unwrap().push((part, thread::current().id() == here));
            let result = watch.run_reporting(&report, |report| {
                [0.25, 0.5].into_iter().for_each(report);
                Ok(3)
            });
            (result.unwrap(), seen.into_inner().unwrap())
        };
        assert_eq!(parts(), (3, vec![(0.25, true), (0.5, true)]));
        // In a pool there is no other thread, and the parts are reported as well.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        assert_eq!(pool.install(parts), (3, vec![(0.25, false), (0.5, false)]));
    }

    #[test]
    fn a_step_hands_on_its_result_or_panic() {
        let watch = Watch { progress: &Silent, cancel: &Cancel::new() };
        assert_eq!(watch.run(|| Ok(7)).unwrap(), 7);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let in_pool = pool.install(|| {
            Watch { progress: &Silent, cancel: &Cancel::new() }.run(|| Ok(rayon::current_thread_index().is_some()))
        });
        assert!(in_pool.unwrap());
        let panicked = panic::catch_unwind(|| {
            Watch { progress: &Silent, cancel: &Cancel::new() }.run::<()>(|| panic!("of the step"))
        });
        assert_eq!(panicked.unwrap_err().downcast_ref::<&str>(), Some(&"of the step"));
    }
}
