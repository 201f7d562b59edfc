//! Long work: on a pool of threads of our own, without the interpreter's lock, interruptible, and followed.

use std::{
    panic::AssertUnwindSafe,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicUsize, Ordering},
        mpsc::{self, RecvTimeoutError},
    },
    time::Duration,
};

use dioptric_pipeline::{PipelineError, Progress, Stage};
use dioptric_spectrum::Cancel;
use dioptric_sweep::{SweepError, SweepProgress};
use pyo3::{exceptions::PyRuntimeError, prelude::*};
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::errors::{exception, guarded, of_panic, sweep_exception, wrong};

/// How often a thread that waits looks at signals and reports how far the work is.
const POLL: Duration = Duration::from_millis(25);

/// The pool of a process.
struct Pool {
    process: u32,
    threads: Arc<ThreadPool>,
}

/// The pool of this process, made at the first use.
///
/// A fork copies the pool without its threads, so that a child makes one of its own. The lock is taken only by threads that
/// hold the interpreter's, as whoever forks does: no child finds it taken by a thread that it does not have.
static POOL: Mutex<Option<Pool>> = Mutex::new(None);
/// Pieces of work that run; a child that was forked meanwhile would wait for locks that no thread of it will release.
static RUNNING: AtomicUsize = AtomicUsize::new(0);

/// Counts a piece of work while it runs.
struct Running;

impl Running {
    fn new() -> Self {
        RUNNING.fetch_add(1, Ordering::Relaxed);
        Self
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        RUNNING.fetch_sub(1, Ordering::Relaxed);
    }
}

fn pool(_attached: Python<'_>) -> PyResult<Arc<ThreadPool>> {
    let mut pool = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    let process = std::process::id();
    match pool.take() {
        Some(own) if own.process == process => {
            let threads = own.threads.clone();
            *pool = Some(own);
            Ok(threads)
        }
        Some(parents) if RUNNING.load(Ordering::Relaxed) > 0 => {
            *pool = Some(parents);
            Err(PyRuntimeError::new_err(
                "this process was forked while dioptric worked in another thread; start processes with the method 'spawn'",
            ))
        }
        other => {
            // Threads that are not there cannot be ended.
            std::mem::forget(other);
            let threads = Arc::new(build(0)?);
            *pool = Some(Pool { process, threads: threads.clone() });
            Ok(threads)
        }
    }
}

fn build(n_threads: usize) -> PyResult<ThreadPool> {
    let builder = ThreadPoolBuilder::new().num_threads(n_threads).thread_name(|i| format!("dioptric-{i}"));
    builder.build().map_err(|e| PyRuntimeError::new_err(format!("cannot start threads: {e}")))
}

/// Sets the number of threads that work from now on; results do not depend on it.
///
/// Parameters
/// ----------
/// n : int
///     The number, 1 or more; 0 for one a core, or the number in ``RAYON_NUM_THREADS``.
#[pyfunction]
pub(crate) fn set_threads(py: Python<'_>, n: usize) -> PyResult<()> {
    const MOST: usize = 4096;
    if n > MOST {
        return Err(wrong("n", n, &format!("0 to {MOST} threads")));
    }
    // Refuses in a process that was forked at a bad moment.
    pool(py)?;
    let threads = Arc::new(build(n)?);
    *POOL.lock().unwrap_or_else(PoisonError::into_inner) = Some(Pool { process: std::process::id(), threads });
    Ok(())
}

/// Returns the number of threads that work.
#[pyfunction]
pub(crate) fn threads(py: Python<'_>) -> PyResult<usize> {
    Ok(pool(py)?.current_num_threads())
}

/// Panics in a thread of the pool, for the test that a panic is an exception like others.
#[pyfunction]
pub(crate) fn _panic(py: Python<'_>) -> PyResult<()> {
    run(py, &Follower::nobody(), |_, _| panic!("on purpose"))
}

/// Who follows how far the work is.
pub(crate) struct Follower {
    callable: Option<Py<PyAny>>,
    is_bar: bool,
}

impl Follower {
    /// Nobody.
    pub(crate) fn nobody() -> Self {
        Self { callable: None, is_bar: false }
    }

    /// Returns who an argument `progress` names: a bar for `True`, a callable of stage and fraction, else nobody.
    pub(crate) fn of(progress: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let Some(progress) = progress else { return Ok(Self::nobody()) };
        if progress.is_callable() {
            return Ok(Self { callable: Some(progress.clone().unbind()), is_bar: false });
        }
        match progress.extract::<bool>() {
            Ok(false) => Ok(Self::nobody()),
            Ok(true) => {
                let bar = progress.py().import("dioptric._progress")?.call_method0("Bar")?;
                Ok(Self { callable: Some(bar.unbind()), is_bar: true })
            }
            Err(_) => Err(crate::errors::wrong_type("progress", progress.get_type(), "True, False or a callable")),
        }
    }

    fn tell(&self, py: Python<'_>, latest: &Latest) -> PyResult<()> {
        let (Some(callable), Some((what, fraction))) = (&self.callable, latest.take()) else { return Ok(()) };
        callable.call1(py, (what, fraction)).map(|_| ())
    }

    fn close(&self, py: Python<'_>) -> PyResult<()> {
        match &self.callable {
            Some(bar) if self.is_bar => bar.call_method0(py, "close").map(|_| ()),
            _ => Ok(()),
        }
    }
}

/// The latest that is known of the work, until it is passed on.
#[derive(Default)]
pub(crate) struct Latest {
    known: Mutex<Option<(String, f64)>>,
    /// Of a sweep: how many items there are, of how many.
    items: Mutex<Option<(usize, usize)>>,
}

impl Latest {
    fn take(&self) -> Option<(String, f64)> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    fn set(&self, what: String, fraction: f64) {
        *self.known.lock().unwrap_or_else(PoisonError::into_inner) = Some((what, fraction));
    }
}

impl Progress for Latest {
    fn at(&self, stage: Stage, fraction: f64) {
        match *self.items.lock().unwrap_or_else(PoisonError::into_inner) {
            Some((n_made, n_all)) => {
                self.set(format!("{}/{n_all} {}", n_made + 1, stage.title()), n_made as f64 / n_all as f64);
            }
            None => self.set(stage.title().to_owned(), fraction),
        }
    }
}

impl SweepProgress for Latest {
    fn items(&self, n_made: usize, n_all: usize) {
        *self.items.lock().unwrap_or_else(PoisonError::into_inner) = Some((n_made, n_all));
    }
}

/// Runs work on the pool without the interpreter's lock.
///
/// The thread that asked waits, looks at signals and calls the follower: what either raises cancels the work and is raised
/// once it has stopped.
pub(crate) fn run<T: Send>(
    py: Python<'_>,
    follower: &Follower,
    work: impl FnOnce(&dyn Progress, &Cancel) -> Result<T, PipelineError> + Send,
) -> PyResult<T> {
    run_as(py, follower, |latest, cancel| work(latest, cancel), exception)
}

/// As [`run`], for work on a sweep.
pub(crate) fn run_sweep<T: Send>(
    py: Python<'_>,
    follower: &Follower,
    work: impl FnOnce(&Latest, &Cancel) -> Result<T, SweepError> + Send,
) -> PyResult<T> {
    run_as(py, follower, work, sweep_exception)
}

fn run_as<T: Send, E: Send>(
    py: Python<'_>,
    follower: &Follower,
    work: impl FnOnce(&Latest, &Cancel) -> Result<T, E> + Send,
    exception: impl FnOnce(E) -> PyErr,
) -> PyResult<T> {
    let threads = pool(py)?;
    let (cancel, latest) = (Cancel::new(), Latest::default());
    let running = Running::new();
    let outcome = py.detach(|| {
        let (cancel, latest) = (&cancel, &latest);
        let (sender, receiver) = mpsc::sync_channel(1);
        threads.in_place_scope(move |scope| {
            scope.spawn(move |_| {
                let result = std::panic::catch_unwind(AssertUnwindSafe(|| work(latest, cancel)));
                // The receiver is there until something came.
                let _ = sender.send(result);
            });
            let mut raised: Option<PyErr> = None;
            loop {
                match receiver.recv_timeout(POLL) {
                    Ok(result) => return (result, raised),
                    Err(RecvTimeoutError::Timeout) if raised.is_none() => {
                        let told = Python::attach(|py| py.check_signals().and_then(|()| follower.tell(py, latest)));
                        raised = told.err();
                        if raised.is_some() {
                            cancel.cancel();
                        }
                    }
                    Err(RecvTimeoutError::Timeout) => {}
                    Err(RecvTimeoutError::Disconnected) => {
                        return (Err(Box::new("the work ended without a result")), raised);
                    }
                }
            }
        })
    });
    drop(running);
    let result = match outcome {
        (_, Some(raised)) => Err(raised),
        (Err(payload), None) => Err(of_panic(payload.as_ref())),
        (Ok(result), None) => result.map_err(exception).and_then(|value| {
            py.check_signals()?;
            follower.tell(py, &latest)?;
            Ok(value)
        }),
    };
    // What was raised first is what is raised.
    let closed = follower.close(py);
    result.and_then(|value| closed.map(|()| value))
}

/// Runs work that owns all it needs on the pool without the interpreter's lock.
///
/// The thread that asked looks at signals: what they raise cancels the work and is raised at once. The work goes on beside until it
/// sees that it is cancelled, and its result is dropped.
pub(crate) fn run_apart<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(&Cancel) -> Result<T, PipelineError> + Send + 'static,
) -> PyResult<T> {
    let threads = pool(py)?;
    let (cancel, running) = (Cancel::new(), Running::new());
    let (sender, receiver) = mpsc::sync_channel(1);
    let of_work = cancel.clone();
    threads.spawn(move || {
        let result = std::panic::catch_unwind(AssertUnwindSafe(|| work(&of_work)));
        drop(running);
        // Whoever was interrupted waits no more.
        let _ = sender.send(result);
    });
    let outcome = py.detach(move || {
        loop {
            match receiver.recv_timeout(POLL) {
                Ok(result) => return Ok(result),
                Err(RecvTimeoutError::Timeout) => {
                    if let Err(raised) = Python::attach(|py| py.check_signals()) {
                        cancel.cancel();
                        return Err(raised);
                    }
                }
                Err(RecvTimeoutError::Disconnected) => {
                    return Ok(Err(Box::new("the work ended without a result")));
                }
            }
        }
    })?;
    py.check_signals()?;
    match outcome {
        Ok(result) => result.map_err(exception),
        Err(payload) => Err(of_panic(payload.as_ref())),
    }
}

/// Runs short work that borrows from Python on the pool, with the interpreter's lock held.
pub(crate) fn install<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let threads = pool(py)?;
    guarded(|| Ok(threads.install(work)))
}
