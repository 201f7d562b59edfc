//! Long work that tells how far it is and can be cancelled.

use std::sync::{
    Mutex,
    atomic::{AtomicU64, Ordering},
};

use dioptric_spectrum::{Cancel, Cancelled};
use ndarray::Array2;
use rayon::prelude::*;

/// Receives the fraction of a piece of work that is done, from 0 to 1, from any thread.
pub(crate) type Progress<'a> = dyn Fn(f64) + Sync + 'a;

/// Who follows a piece of work.
pub(crate) struct Watch<'a> {
    pub(crate) progress: &'a Progress<'a>,
    /// The fractions reported at the start and at the end.
    pub(crate) range: (f64, f64),
    pub(crate) cancel: &'a Cancel,
}

/// A piece of work of a known number of units: its progress, and whether it has been cancelled.
pub(crate) struct Work<'a> {
    cancel: &'a Cancel,
    progress: &'a Progress<'a>,
    /// The fractions reported at the start and at the end.
    range: (f64, f64),
    n_units: u64,
    n_done: AtomicU64,
    /// Thousandths reported so far: reports never go back.
    reported: Mutex<u64>,
}

impl<'a> Work<'a> {
    /// Returns work of `n_units` whose progress runs through `range`.
    pub(crate) fn new(cancel: &'a Cancel, progress: &'a Progress<'a>, range: (f64, f64), n_units: u64) -> Self {
        Self { cancel, progress, range, n_units: n_units.max(1), n_done: AtomicU64::new(0), reported: Mutex::new(0) }
    }

    /// Returns work whose progress nobody follows.
    pub(crate) fn unobserved(cancel: &'a Cancel) -> Self {
        Self::new(cancel, &|_| {}, (0.0, 1.0), 1)
    }

    /// The request to stop.
    pub(crate) fn cancel(&self) -> &'a Cancel {
        self.cancel
    }

    /// Returns an error once the work was cancelled.
    pub(crate) fn check(&self) -> Result<(), Cancelled> {
        self.cancel.check()
    }

    /// Counts units as done, and reports each new thousandth.
    pub(crate) fn advance(&self, n_units: u64) {
        let n_done = (self.n_done.fetch_add(n_units, Ordering::Relaxed) + n_units).min(self.n_units);
        let thousandths = 1000 * n_done / self.n_units;
        let Ok(mut reported) = self.reported.try_lock() else { return };
        if thousandths > *reported {
            *reported = thousandths;
            let (start, end) = self.range;
            (self.progress)(start + (end - start) * 1e-3 * thousandths as f64);
        }
    }
}

/// Returns a plane whose sample at row, column is `at(row, column)`, unless cancelled.
pub(crate) fn plane_of(
    (rows, columns): (usize, usize),
    cancel: &Cancel,
    at: impl Fn(usize, usize) -> f32 + Sync,
) -> Result<Array2<f32>, Cancelled> {
    let mut plane = Array2::zeros((rows, columns));
    let samples = plane.as_slice_mut().expect("a new plane is in standard order");
    samples.par_chunks_mut(columns.max(1)).enumerate().try_for_each(|(row, line)| {
        cancel.check()?;
        line.iter_mut().enumerate().for_each(|(column, sample)| *sample = at(row, column));
        Ok(())
    })?;
    Ok(plane)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_ascends_to_the_end() {
        let seen = Mutex::new(vec![]);
        let progress = |fraction: f64| seen.lock().unwrap().push(fraction);
        let cancel = Cancel::new();
        let work = Work::new(&cancel, &progress, (0.25, 0.75), 40);
        (0..40).for_each(|_| work.advance(1));
        let seen = seen.lock().unwrap();
        assert!(seen.is_sorted() && seen.len() == 40);
        assert_eq!(seen.last(), Some(&0.75));
    }

    #[test]
    fn cancelled_plane_is_not_made() {
        let cancel = Cancel::new();
        assert_eq!(plane_of((2, 3), &cancel, |row, column| (10 * row + column) as f32).unwrap()[(1, 2)], 12.0);
        cancel.cancel();
        assert_eq!(plane_of((2, 3), &cancel, |_, _| 1.0), Err(Cancelled));
    }
}
