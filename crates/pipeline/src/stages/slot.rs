//! Results that are kept beside what they were made from.

use std::sync::{
    Arc, Mutex, PoisonError,
    atomic::{AtomicUsize, Ordering},
};

/// The latest results of one stage, each with the inputs it was made from.
///
/// A stage is a function of its inputs alone, so equal inputs have the same result, and nothing else ever has to be
/// declared out of date.
#[derive(Debug)]
pub(crate) struct Slot<K, T> {
    /// Newest last.
    entries: Mutex<Vec<(K, Arc<T>)>>,
    capacity: usize,
    n_made: AtomicUsize,
}

impl<K: PartialEq, T> Slot<K, T> {
    /// Keeps up to `capacity` results.
    pub(crate) fn new(capacity: usize) -> Self {
        Self { entries: Mutex::default(), capacity, n_made: AtomicUsize::new(0) }
    }

    /// Returns the result of these inputs if it is kept.
    pub(crate) fn get(&self, key: &K) -> Option<Arc<T>> {
        let mut entries = self.entries.lock().unwrap_or_else(PoisonError::into_inner);
        let found = entries.iter().position(|(kept, _)| kept == key)?;
        // What was asked for last is dropped last.
        let entry = entries.remove(found);
        let result = entry.1.clone();
        entries.push(entry);
        Some(result)
    }

    /// Returns the result of these inputs, made now where it is not kept.
    ///
    /// Nothing is locked while it is made: two threads that ask at once both make it, and get equal results.
    pub(crate) fn get_or_make<E>(&self, key: K, make: impl FnOnce(&K) -> Result<T, E>) -> Result<Arc<T>, E> {
        if let Some(kept) = self.get(&key) {
            return Ok(kept);
        }
        let made = make(&key)?;
        self.n_made.fetch_add(1, Ordering::Relaxed);
        Ok(self.put(key, made))
    }

    /// Keeps a result that was made elsewhere.
    pub(crate) fn put(&self, key: K, result: T) -> Arc<T> {
        self.put_shared(key, Arc::new(result))
    }

    /// Keeps a result that others hold too.
    pub(crate) fn put_shared(&self, key: K, result: Arc<T>) -> Arc<T> {
        let mut entries = self.entries.lock().unwrap_or_else(PoisonError::into_inner);
        entries.retain(|(kept, _)| *kept != key);
        entries.push((key, result.clone()));
        if entries.len() > self.capacity {
            entries.remove(0);
        }
        result
    }

    /// Returns all results that are kept, the one that was asked for last at the end.
    pub(crate) fn all(&self) -> Vec<Arc<T>> {
        let entries = self.entries.lock().unwrap_or_else(PoisonError::into_inner);
        entries.iter().map(|(_, result)| result.clone()).collect()
    }

    /// Lets go of all results; who holds one keeps it.
    pub(crate) fn clear(&self) {
        self.entries.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }

    /// The number of results that were made.
    pub(crate) fn n_made(&self) -> usize {
        self.n_made.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use super::*;

    #[test]
    fn equal_inputs_are_made_once() {
        let slot = Slot::new(2);
        let ask = |key: u32| *slot.get_or_make(key, |k| Ok::<_, Infallible>(k * 10)).unwrap();
        assert_eq!([ask(1), ask(1), ask(2), ask(1)], [10, 10, 20, 10]);
        assert_eq!(slot.n_made(), 2);
    }

    #[test]
    fn least_recently_asked_is_dropped() {
        let slot = Slot::new(2);
        let ask = |key: u32| *slot.get_or_make(key, |k| Ok::<_, Infallible>(*k)).unwrap();
        let _ = [ask(1), ask(2), ask(1), ask(3)];
        assert!(slot.get(&1).is_some() && slot.get(&2).is_none() && slot.get(&3).is_some());
    }

    #[test]
    fn cleared_results_are_made_again() {
        let slot = Slot::new(2);
        let ask = |key: u32| slot.get_or_make(key, |k| Ok::<_, Infallible>(k * 10)).unwrap();
        let held = ask(1);
        assert_eq!((*ask(2), slot.all()), (20, vec![Arc::new(10), Arc::new(20)]));
        slot.clear();
        assert_eq!((slot.all().len(), *held, *ask(1), slot.n_made()), (0, 10, 10, 3));
    }

    #[test]
    fn failure_keeps_nothing() {
        let slot: Slot<u32, u32> = Slot::new(2);
        assert!(slot.get_or_make(1, |_| Err("no")).is_err());
        assert_eq!((slot.get(&1), slot.n_made()), (None, 0));
    }
}
