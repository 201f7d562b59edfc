//! The thread that takes pictures, a ladder of them for the latest camera.

use std::{
    fmt,
    panic::{self, AssertUnwindSafe},
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use dioptric_pipeline::{Camera, KeptCamera, PaintReach, PaintingFolder, PipelineError, Progress, Stage};
use dioptric_spectrum::Cancel;

use super::{Fault, Product, Rung, mailbox::Mailbox, refine};

/// How long the first rung may go on for a camera that was changed meanwhile: while a hand drags, each step is shown, and a first rung
/// that takes long does not hold up the next camera.
const GRACE: Duration = Duration::from_millis(150);

/// How long a camera must stay as it is before its full picture is begun: a hand that drags has not to share the processor with it.
const SETTLED: Duration = Duration::from_millis(60);

/// How often a stop is looked for meanwhile.
const LOOK: Duration = Duration::from_millis(5);

/// What an engine is started with.
#[derive(Clone, Debug, Default)]
pub struct EngineSettings {
    /// Where paintings of the built-in still life are kept.
    pub paintings: Option<PaintingFolder>,
}

/// Takes pictures of the latest camera, on a thread of its own.
pub struct Engine {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

/// A picture, or why there is none.
#[derive(Clone, Debug)]
pub struct Delivery {
    /// Which camera, in the order of their submission.
    pub generation: u64,
    /// The rung.
    pub rung: Rung,
    /// From the submission of the camera.
    pub elapsed: Duration,
    /// From the start of this rung.
    pub work: Duration,
    /// The picture, or what is wrong with the camera.
    pub outcome: Result<Arc<Product>, Fault>,
}

/// What the engine is at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Busy {
    /// Which camera.
    pub generation: u64,
    /// The rung.
    pub rung: Rung,
    /// The stage of the simulation.
    pub stage: Stage,
    /// The part of the stage that is done, 0–1.
    pub fraction: f64,
}

/// A camera to be taken pictures of.
struct Job {
    generation: u64,
    camera: Camera,
    /// The last rung.
    top: Rung,
    submitted: Instant,
}

struct Shared {
    mailbox: Mailbox<Job>,
    generation: AtomicU64,
    /// Cameras up to this one are not worked on any more.
    stopped: AtomicU64,
    current: Mutex<Current>,
    deliveries: Mutex<Vec<Delivery>>,
    wake: Box<dyn Fn() + Send + Sync>,
}

/// What is being worked on.
#[derive(Default)]
struct Current {
    cancel: Cancel,
    busy: Option<Busy>,
    started: Option<Instant>,
}

impl fmt::Debug for Engine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Engine").field("busy", &self.busy()).finish_non_exhaustive()
    }
}

impl Engine {
    /// Starts the thread; `wake` is called from it after each delivery.
    ///
    /// # Errors
    /// When the system starts no thread.
    pub fn start(settings: EngineSettings, wake: impl Fn() + Send + Sync + 'static) -> std::io::Result<Self> {
        let shared = Arc::new(Shared {
            mailbox: Mailbox::default(),
            generation: AtomicU64::new(0),
            stopped: AtomicU64::new(0),
            current: Mutex::default(),
            deliveries: Mutex::default(),
            wake: Box::new(wake),
        });
        let theirs = shared.clone();
        let thread = thread::Builder::new().name("studio-engine".to_owned()).spawn(move || work(&theirs, &settings))?;
        Ok(Self { shared, thread: Some(thread) })
    }

    /// Asks for the pictures of a camera up to a rung, in place of those of any other, and returns its number.
    ///
    /// Work on another camera is cancelled, unless it is a first rung that has just begun, which is delivered first.
    pub fn submit(&self, camera: Camera, top: Rung) -> u64 {
        let generation = self.shared.generation.fetch_add(1, Ordering::SeqCst) + 1;
        self.shared.mailbox.put(Job { generation, camera, top, submitted: Instant::now() });
        self.shared.cancel_overdue();
        generation
    }

    /// Cancels what is being worked on, and what waits.
    pub fn stop(&self) {
        self.shared.stopped.store(self.shared.generation.load(Ordering::SeqCst), Ordering::SeqCst);
        self.shared.mailbox.empty();
        self.shared.current().cancel.cancel();
    }

    /// Returns what was delivered since the last call, oldest first.
    pub fn take(&self) -> Vec<Delivery> {
        self.shared.cancel_overdue();
        std::mem::take(&mut *self.shared.deliveries.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Returns what the engine is at; `None` where it waits for a camera.
    pub fn busy(&self) -> Option<Busy> {
        self.shared.current().busy
    }

    /// Whether it works, or has work waiting.
    pub fn is_busy(&self) -> bool {
        self.shared.mailbox.is_full() || self.busy().is_some()
    }
}

impl Drop for Engine {
    fn drop(&mut self) {
        self.stop();
        self.shared.mailbox.close();
        if let Some(thread) = self.thread.take() {
            // Panics of the work were caught there.
            drop(thread.join());
        }
    }
}

impl Shared {
    fn current(&self) -> MutexGuard<'_, Current> {
        self.current.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes what is begun.
    fn begin(&self, job: &Job, rung: Rung, started: Instant, cancel: &Cancel) {
        let mut current = self.current();
        current.cancel = cancel.clone();
        current.started = Some(started);
        current.busy = Some(Busy { generation: job.generation, rung, stage: Stage::Scene, fraction: 0.0 });
    }

    /// Hands a picture over, or what is wrong.
    fn deliver(&self, job: &Job, rung: Rung, started: Instant, outcome: Result<Arc<Product>, Fault>) {
        let (elapsed, work) = (job.submitted.elapsed(), started.elapsed());
        let delivery = Delivery { generation: job.generation, rung, elapsed, work, outcome };
        self.deliveries.lock().unwrap_or_else(PoisonError::into_inner).push(delivery);
        (self.wake)();
    }

    /// Ends the work on a camera that another waits to replace, but for a first rung that may soon be done.
    fn cancel_overdue(&self) {
        if !self.mailbox.is_full() {
            return;
        }
        let current = self.current();
        let is_first = current.busy.is_some_and(|busy| busy.rung == Rung::Sketch);
        if !is_first || current.started.is_some_and(|started| started.elapsed() > GRACE) {
            current.cancel.cancel();
        }
    }
}

/// Notes how far the work is.
struct Follower<'a>(&'a Shared);

impl Progress for Follower<'_> {
    fn at(&self, stage: Stage, fraction: f64) {
        self.0.cancel_overdue();
        if let Some(busy) = &mut self.0.current().busy {
            (busy.stage, busy.fraction) = (stage, fraction);
        }
    }
}

fn work(shared: &Shared, settings: &EngineSettings) {
    // A camera a rung: each keeps results of its own quality.
    let mut ladder: Option<[KeptCamera; 3]> = None;
    let mut field_of_view_deg = None;
    while let Some(job) = shared.mailbox.take() {
        // A hand that has changed the field of view goes on to change it; of the first camera nothing is known.
        let own_deg = job.camera.scene.field_of_view_deg;
        let is_zooming = field_of_view_deg.replace(own_deg).is_some_and(|before| before != own_deg);
        let ladder = ladder.get_or_insert_with(|| {
            Rung::ALL.map(|rung| {
                let kept = KeptCamera::new(job.camera.clone()).with_quality(rung.quality());
                kept.with_paintings(settings.paintings.clone())
            })
        });
        climb(shared, ladder, &job, is_zooming);
        paint_ahead(shared, ladder, &job, PaintReach::All);
        let mut current = shared.current();
        (current.busy, current.started) = (None, None);
    }
}

/// Paints what changes of the field of view need, until another camera is asked for.
fn paint_ahead(shared: &Shared, ladder: &[KeptCamera; 3], job: &Job, reach: PaintReach) {
    let cancel = Cancel::new();
    {
        let mut current = shared.current();
        (current.busy, current.started, current.cancel) = (None, None, cancel.clone());
    }
    for kept in ladder {
        // Whoever stopped the work or has another camera may have come before this cancel could be seen.
        let is_stopped = shared.stopped.load(Ordering::SeqCst) >= job.generation;
        if is_stopped || shared.mailbox.is_full() {
            return;
        }
        let kept = kept.with(|own| own.clone_from(&job.camera));
        let painted = panic::catch_unwind(AssertUnwindSafe(|| kept.paint_ahead(reach, &Follower(shared), &cancel)));
        if !matches!(painted, Ok(Ok(()))) {
            // What is wrong with the camera has been delivered.
            return;
        }
    }
}

/// Delivers the rungs of a camera until another is asked for; while its field of view is changed, the full picture waits for what the next change needs.
fn climb(shared: &Shared, ladder: &[KeptCamera; 3], job: &Job, is_zooming: bool) {
    for (rung, kept) in Rung::ALL.into_iter().zip(ladder).filter(|(rung, _)| *rung <= job.top) {
        if rung == Rung::Full && is_zooming {
            paint_ahead(shared, ladder, job, PaintReach::Next);
        }
        let (started, cancel) = (Instant::now(), Cancel::new());
        shared.begin(job, rung, started, &cancel);
        if rung == Rung::Full {
            let is_waiting = || started.elapsed() < SETTLED && !cancel.is_cancelled() && !shared.mailbox.is_full();
            while is_waiting() {
                shared.mailbox.wait_full(LOOK);
            }
        }
        // Whoever stopped the work or has another camera may have come before this cancel could be seen.
        let is_stopped = shared.stopped.load(Ordering::SeqCst) >= job.generation;
        if is_stopped || (rung > Rung::Sketch && shared.mailbox.is_full()) {
            return;
        }
        let make = || {
            if rung == Rung::Full {
                let mut show = |product| shared.deliver(job, Rung::Refining, started, Ok(Arc::new(product)));
                refine::refine(kept, &job.camera, &Follower(shared), &cancel, &mut show)?;
            }
            Product::make(kept, &job.camera, rung, &Follower(shared), &cancel)
        };
        let outcome = match panic::catch_unwind(AssertUnwindSafe(make)) {
            Ok(Ok(product)) => Ok(Arc::new(product)),
            Ok(Err(PipelineError::Cancelled(_))) => return,
            Ok(Err(error)) => Err(Fault::of(&error, &job.camera)),
            Err(cause) => Err(Fault::of_panic(&*cause)),
        };
        let is_wrong = outcome.is_err();
        shared.deliver(job, rung, started, outcome);
        if is_wrong {
            return;
        }
    }
}
