//! Small questions beside the picture, each answered by a thread of its own.

use std::{
    panic::{self, AssertUnwindSafe},
    sync::{Arc, Mutex, PoisonError},
    thread::{self, JoinHandle},
};

use super::mailbox::Mailbox;

/// A question: work that ends in an answer.
type Question<A> = Box<dyn FnOnce() -> A + Send>;

/// A thread that answers the latest question of one kind; older ones that were not begun are dropped.
#[derive(Debug)]
pub struct Asker<A> {
    shared: Arc<Shared<A>>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug)]
struct Shared<A> {
    mailbox: Mailbox<Letter<A>>,
    answer: Mutex<Option<A>>,
}

/// A question that can be printed.
struct Letter<A>(Question<A>);

impl<A> std::fmt::Debug for Letter<A> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Letter")
    }
}

impl<A: Send + 'static> Asker<A> {
    /// Starts the thread; `wake` is called after each answer.
    pub fn start(wake: impl Fn() + Send + 'static) -> Self {
        let shared = Arc::new(Shared { mailbox: Mailbox::default(), answer: Mutex::new(None) });
        let theirs = shared.clone();
        let work = move || {
            while let Some(Letter(question)) = theirs.mailbox.take() {
                // A question that panics has no answer.
                if let Ok(answer) = panic::catch_unwind(AssertUnwindSafe(question)) {
                    *theirs.answer.lock().unwrap_or_else(PoisonError::into_inner) = Some(answer);
                    wake();
                }
            }
        };
        let thread = thread::Builder::new().name("studio-asker".to_owned()).spawn(work).ok();
        Self { shared, thread }
    }

    /// Asks; an older question that was not begun is dropped.
    pub fn ask(&self, question: impl FnOnce() -> A + Send + 'static) {
        self.shared.mailbox.put(Letter(Box::new(question)));
    }

    /// Takes the latest answer, if one came since.
    pub fn answer(&self) -> Option<A> {
        self.shared.answer.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

impl<A> Drop for Asker<A> {
    fn drop(&mut self) {
        self.shared.mailbox.close();
        if let Some(thread) = self.thread.take() {
            // What it panicked of was dropped with its question.
            drop(thread.join());
        }
    }
}

#[cfg(test)]
mod tests {
    use std::{sync::mpsc, time::Duration};

    use super::*;

    #[test]
    fn an_answer_comes_once() {
        let (sender, woken) = mpsc::channel();
        let asker = Asker::start(move || _ = sender.send(()));
        asker.ask(|| 7);
        woken.recv_timeout(Duration::from_secs(10)).unwrap();
        assert_eq!((asker.answer(), asker.answer()), (Some(7), None));
        // A question that panics leaves the thread alive.
        asker.ask(|| panic!("of the question"));
        asker.ask(|| 8);
        let answered = (0..2).any(|_| woken.recv_timeout(Duration::from_secs(10)).is_ok());
        assert!(answered && asker.answer() == Some(8));
    }
}
