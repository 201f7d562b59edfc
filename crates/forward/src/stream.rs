//! The bands of a layout imaged one after the other, or some at once where there is room for them.

use std::{
    collections::BTreeMap,
    sync::{
        Mutex, MutexGuard, PoisonError,
        mpsc::{Receiver, Sender, TryRecvError, channel},
    },
    thread,
    time::Duration,
};

use dioptric_psf::LensImage;
use ndarray::Array2;
use rayon::{Scope, prelude::*};

use crate::{ForwardError, SceneRadiance, basis::BandBasis, layout::Layout, work::Work};

/// Receives bands in their order.
pub(crate) type HandOn<'a> = dyn FnMut(usize, Array2<f32>) -> Result<(), ForwardError> + 'a;

/// Pauses of a thread that waits for a picture and has no other work.
const PAUSE: Duration = Duration::from_micros(50);

impl Layout {
    /// Images the bands from `first` on, and hands on each as soon as those before it are done.
    pub(crate) fn stream_from(
        &self,
        first: usize,
        lens: &dyn LensImage,
        radiance: &SceneRadiance<'_>,
        work: &Work<'_>,
        hand_on: &mut HandOn<'_>,
    ) -> Result<(), ForwardError> {
        let task = Task { layout: self, lens, radiance, work };
        match self.in_flight_bytes {
            Some(_) => task.stream_within(first, hand_on),
            None => Stream::of(task, first).run(hand_on),
        }
    }
}

/// What is to be imaged, and through what.
#[derive(Clone, Copy)]
struct Task<'a> {
    layout: &'a Layout,
    lens: &'a dyn LensImage,
    radiance: &'a SceneRadiance<'a>,
    work: &'a Work<'a>,
}

impl Task<'_> {
    /// Images as many bands at once as memory allows; while they are handed on no other is imaged.
    fn stream_within(&self, first: usize, hand_on: &mut HandOn<'_>) -> Result<(), ForwardError> {
        let Self { layout, lens, radiance, work } = *self;
        let mut last_upper: Option<(usize, BandBasis)> = None;
        for (pair, bands) in layout.bands_between_bases(first) {
            let lower = match last_upper.take() {
                Some((band, basis)) if band == pair[0] => basis,
                _ => layout.basis(lens, pair[0], work)?,
            };
            let upper = if pair[1] == pair[0] { lower.clone() } else { layout.basis(lens, pair[1], work)? };
            for group in bands.chunks(layout.bands_at_once([&lower, &upper])) {
                let image = |&band: &usize| {
                    let basis = layout.between(lens, (band, pair), [&lower, &upper], work)?;
                    layout.image_of(lens, band, &basis, radiance, work).map(|picture| (band, picture))
                };
                let pictures: Vec<(usize, Array2<f32>)> = group.par_iter().map(image).collect::<Result<_, _>>()?;
                pictures.into_iter().try_for_each(|(band, picture)| hand_on(band, picture))?;
            }
            // Those of a lens without an axis are many.
            layout.drop_maps();
            last_upper = Some((pair[1], upper));
        }
        Ok(())
    }
}

/// Bands imaged some at once, the bases of the next ones computed meanwhile, so that no thread waits for the last part of one of them.
struct Stream<'a> {
    task: Task<'a>,
    /// The bands, each with the number of its pair of bases.
    bands: Vec<(usize, usize)>,
    pairs: Vec<[usize; 2]>,
    /// The bands at which bases are computed.
    basis_bands: Vec<usize>,
    state: Mutex<State>,
}

/// How far a stream is.
#[derive(Default)]
struct State {
    /// Bases that are computed and still needed.
    bases: BTreeMap<usize, BandBasis>,
    is_computing_basis: bool,
    /// Bases and bands begun, and bands done and handed on, numbers of each.
    n_bases: usize,
    n_begun: usize,
    n_done: usize,
    n_handed_on: usize,
    is_stopped: bool,
}

/// A piece of work of a stream.
enum Step {
    Basis { band: usize },
    Image { number: usize, band: usize, pair: [usize; 2], bases: Box<[BandBasis; 2]> },
}

/// What became of a step; nothing where it panicked.
type Outcome = Option<Result<(usize, Array2<f32>), ForwardError>>;

impl<'a> Stream<'a> {
    fn of(task: Task<'a>, first: usize) -> Self {
        let (pairs, bands_of): (Vec<[usize; 2]>, Vec<Vec<usize>>) =
            task.layout.bands_between_bases(first).into_iter().unzip();
        let bands = bands_of.into_iter().enumerate();
        let bands = bands.flat_map(|(pair, bands)| bands.into_iter().map(move |band| (band, pair))).collect();
        let mut basis_bands: Vec<usize> = pairs.iter().flatten().copied().collect();
        basis_bands.dedup();
        Self { task, bands, pairs, basis_bands, state: Mutex::default() }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Images all bands; the calling thread hands them on, as others work on the next ones.
    fn run(&self, hand_on: &mut HandOn<'_>) -> Result<(), ForwardError> {
        if self.bands.is_empty() {
            return Ok(());
        }
        let (sender, receiver) = channel();
        rayon::in_place_scope(|scope| {
            self.begin(scope, &sender);
            let handed_on = self.hand_on(&receiver, hand_on, || self.begin(scope, &sender));
            self.state().is_stopped = true;
            handed_on
        })
    }

    /// Hands on bands as they are done, and calls `begin` after each.
    fn hand_on(
        &self,
        receiver: &Receiver<Outcome>,
        hand_on: &mut HandOn<'_>,
        begin: impl Fn(),
    ) -> Result<(), ForwardError> {
        let mut done: BTreeMap<usize, Array2<f32>> = BTreeMap::new();
        for (next, (band, _)) in self.bands.iter().enumerate() {
            let picture = loop {
                if let Some(picture) = done.remove(&next) {
                    break picture;
                }
                // The scope passes a panic on.
                let Some(outcome) = wait_for(receiver) else { return Ok(()) };
                let (number, picture) = outcome?;
                done.insert(number, picture);
            };
            hand_on(*band, picture)?;
            self.state().n_handed_on = next + 1;
            begin();
        }
        Ok(())
    }

    /// Begins all steps that can be begun; each begins others when it ends.
    fn begin<'s>(&'s self, scope: &Scope<'s>, sender: &Sender<Outcome>) {
        while let Some(step) = self.next_step() {
            let unless_sent = UnlessSent { sender: sender.clone(), is_sent: false };
            scope.spawn(move |scope| {
                let mut unless_sent = unless_sent;
                let outcome = self.take(step);
                let sender = unless_sent.sender.clone();
                unless_sent.is_sent = true;
                if let Some(outcome) = outcome.transpose() {
                    // Where nobody receives it the stream has stopped.
                    let _ = sender.send(Some(outcome));
                }
                self.begin(scope, &sender);
            });
        }
    }

    /// Chooses the next step: a basis, one at a time and up to that of the next pair, or else a band whose bases are there.
    fn next_step(&self) -> Option<Step> {
        let mut state = self.state();
        if state.is_stopped {
            return None;
        }
        let next = self.bands.get(state.n_begun).copied();
        let wanted_pair = next.and_then(|(_, pair)| self.pairs.get(pair + 1)).or(self.pairs.last())?;
        let last_wanted = wanted_pair[1];
        let basis = self.basis_bands.get(state.n_bases).filter(|&&band| band <= last_wanted);
        if let Some(&band) = basis.filter(|_| !state.is_computing_basis) {
            (state.n_bases, state.is_computing_basis) = (state.n_bases + 1, true);
            return Some(Step::Basis { band });
        }
        let (band, pair) = next?;
        let [lower_band, upper_band] = self.pairs[pair];
        let (lower, upper) = (state.bases.get(&lower_band)?, state.bases.get(&upper_band)?);
        let at_once = self.task.layout.bands_at_once([lower, upper]);
        // As many again may wait to be handed on.
        if state.n_begun - state.n_done >= at_once || state.n_begun - state.n_handed_on >= 2 * at_once {
            return None;
        }
        let bases = Box::new([lower.clone(), upper.clone()]);
        let number = state.n_begun;
        state.n_begun += 1;
        let needed_from = self.bands.get(number + 1).map_or(usize::MAX, |(_, pair)| self.pairs[*pair][0]);
        state.bases.retain(|&band, _| band >= needed_from);
        Some(Step::Image { number, band, pair: self.pairs[pair], bases })
    }

    /// Takes a step; returns the number and the picture of a band that it imaged.
    fn take(&self, step: Step) -> Result<Option<(usize, Array2<f32>)>, ForwardError> {
        let Task { layout, lens, radiance, work } = self.task;
        match step {
            Step::Basis { band } => {
                let basis = layout.basis(lens, band, work)?;
                let mut state = self.state();
                state.bases.insert(band, basis);
                state.is_computing_basis = false;
                Ok(None)
            }
            Step::Image { number, band, pair, bases } => {
                let basis = layout.between(lens, (band, pair), [&bases[0], &bases[1]], work)?;
                let picture = layout.image_of(lens, band, &basis, radiance, work)?;
                self.state().n_done += 1;
                Ok(Some((number, picture)))
            }
        }
    }
}

/// Has whoever waits for an outcome go on where a step panics.
struct UnlessSent {
    sender: Sender<Outcome>,
    is_sent: bool,
}

impl Drop for UnlessSent {
    fn drop(&mut self) {
        if !self.is_sent {
            let _ = self.sender.send(None);
        }
    }
}

/// Waits for an outcome; a thread of the pool works meanwhile.
fn wait_for(receiver: &Receiver<Outcome>) -> Outcome {
    if rayon::current_thread_index().is_none() {
        return receiver.recv().ok().flatten();
    }
    loop {
        match receiver.try_recv() {
            Ok(outcome) => return outcome,
            Err(TryRecvError::Disconnected) => return None,
            Err(TryRecvError::Empty) if rayon::yield_now() == Some(rayon::Yield::Executed) => {}
            Err(TryRecvError::Empty) => thread::sleep(PAUSE),
        }
    }
}
