//! A mailbox that holds the latest letter alone.

use std::{
    sync::{Condvar, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

/// Hands the latest letter from one thread to another; one that was not yet taken is replaced.
#[derive(Debug)]
pub(super) struct Mailbox<T> {
    state: Mutex<State<T>>,
    changed: Condvar,
}

#[derive(Debug)]
struct State<T> {
    letter: Option<T>,
    is_closed: bool,
}

impl<T> Default for Mailbox<T> {
    fn default() -> Self {
        Self { state: Mutex::new(State { letter: None, is_closed: false }), changed: Condvar::new() }
    }
}

impl<T> Mailbox<T> {
    /// Puts a letter in, in place of one that was not taken.
    pub(super) fn put(&self, letter: T) {
        self.lock().letter = Some(letter);
        self.changed.notify_one();
    }

    /// Waits for a letter and takes it; `None` once the mailbox is closed.
    pub(super) fn take(&self) -> Option<T> {
        let mut state = self.lock();
        loop {
            if state.is_closed {
                return None;
            }
            if let Some(letter) = state.letter.take() {
                return Some(letter);
            }
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Whether a letter waits.
    pub(super) fn is_full(&self) -> bool {
        self.lock().letter.is_some()
    }

    /// Waits until there is a letter, or that long.
    pub(super) fn wait_full(&self, most: Duration) {
        let is_waiting = |state: &mut State<T>| state.letter.is_none() && !state.is_closed;
        // Whoever waited looks for the letter.
        drop(self.changed.wait_timeout_while(self.lock(), most, is_waiting));
    }

    /// Takes a waiting letter away.
    pub(super) fn empty(&self) {
        self.lock().letter = None;
    }

    /// Lets nobody wait any more.
    pub(super) fn close(&self) {
        self.lock().is_closed = true;
        self.changed.notify_all();
    }

    fn lock(&self) -> MutexGuard<'_, State<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use std::{sync::Arc, thread};

    use super::*;

    #[test]
    fn the_latest_letter_is_taken() {
        let mailbox = Mailbox::default();
        mailbox.put(1);
        mailbox.put(2);
        assert!(mailbox.is_full());
        assert_eq!(mailbox.take(), Some(2));
        assert!(!mailbox.is_full());
        mailbox.put(3);
        mailbox.empty();
        assert!(!mailbox.is_full());
    }

    #[test]
    fn closing_wakes_who_waits() {
        let mailbox: Arc<Mailbox<u8>> = Arc::default();
        let waiting = thread::spawn({
            let mailbox = mailbox.clone();
            move || mailbox.take()
        });
        mailbox.close();
        assert_eq!(waiting.join().unwrap(), None);
    }
}
