//! Bands handed from one thread to another, a few at a time.

use std::{
    borrow::Cow,
    sync::{
        Mutex, PoisonError,
        mpsc::{Receiver, SyncSender, sync_channel},
    },
};

use dioptric_spectrum::{Bands, Quantity, SpectrumError, WavelengthGrid};
use ndarray::Array2;

/// Why a band is not to be had.
pub(crate) const GAVE_UP: &str = "the stage before gave up";
/// Bands that wait to be taken at most.
const WAITING: usize = 2;

/// An image whose bands come out of a channel: each can be had once, in order.
pub(crate) struct BandStream<'a> {
    quantity: Quantity,
    grid: &'a WavelengthGrid,
    size: (usize, usize),
    receiver: Mutex<Receiver<Array2<f32>>>,
}

/// Returns an image and where its bands are to be put in.
pub(crate) fn band_stream(
    quantity: Quantity,
    grid: &WavelengthGrid,
    size: (usize, usize),
) -> (SyncSender<Array2<f32>>, BandStream<'_>) {
    let (sender, receiver) = sync_channel(WAITING);
    (sender, BandStream { quantity, grid, size, receiver: Mutex::new(receiver) })
}

impl Bands for BandStream<'_> {
    fn quantity(&self) -> Quantity {
        self.quantity
    }

    fn grid(&self) -> &WavelengthGrid {
        self.grid
    }

    fn size(&self) -> (usize, usize) {
        self.size
    }

    fn band(&self, band: usize) -> Result<Cow<'_, Array2<f32>>, SpectrumError> {
        let receiver = self.receiver.lock().unwrap_or_else(PoisonError::into_inner);
        let plane = receiver.recv().map_err(|_| SpectrumError::Band { band, reason: GAVE_UP.to_owned() })?;
        Ok(Cow::Owned(plane))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_come_out_in_order_and_an_end_is_an_error() {
        let grid = WavelengthGrid::uniform(400.0, 600.0, 100.0).unwrap();
        let (sender, stream) = band_stream(Quantity::Irradiance, &grid, (1, 1));
        let taken = std::thread::scope(|scope| {
            let taker = scope.spawn(|| (0..3).map(|b| stream.band(b).map(|p| p[(0, 0)])).collect::<Vec<_>>());
            for value in [1.0, 2.0] {
                sender.send(Array2::from_elem((1, 1), value)).unwrap();
            }
            drop(sender);
            taker.join().unwrap()
        });
        assert_eq!((taken[0].clone().unwrap(), taken[1].clone().unwrap()), (1.0, 2.0));
        assert!(taken[2].is_err());
    }
}
