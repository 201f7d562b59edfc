//! Which noises there are, and where their random numbers come from.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// The switches of every noise, and the two seeds.
///
/// A pixel's numbers depend on the seed, the kind of noise and the row alone, so that a frame is the same for any
/// number of threads, and switching one noise off leaves the others as they were.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Noise {
    /// The seed of what changes from frame to frame.
    pub seed: u64,
    /// The seed of what stays with the chip: PRNU, DSNU, columns, defects.
    pub fixed_pattern_seed: u64,
    /// Photon (shot) noise.
    pub photon: bool,
    /// The shot noise of the dark current; its mean is always there.
    pub dark_current: bool,
    /// Read noise.
    pub read: bool,
    /// Reset noise, where the sensor has no correlated double sampling.
    pub reset: bool,
    /// Row noise.
    pub row: bool,
    /// Photo-response non-uniformity.
    pub prnu: bool,
    /// Dark-signal non-uniformity.
    pub dsnu: bool,
    /// The columns' offsets and gains.
    pub column: bool,
    /// Hot and dead pixels.
    pub defects: bool,
}

impl Noise {
    /// Returns all noises on; the chip's own pattern is that of seed 0.
    pub fn all(seed: u64) -> Self {
        Self { seed, ..Self::switched(true) }
    }

    /// Returns all noises off.
    pub fn none() -> Self {
        Self::switched(false)
    }

    /// Returns the same switches for frame `number` of a burst: other temporal noise, the same fixed pattern.
    #[must_use]
    pub fn frame(self, number: u64) -> Self {
        // An odd constant spreads neighbouring frames of neighbouring seeds over the seeds.
        Self { seed: self.seed.wrapping_add(number.wrapping_mul(0x9e37_79b9_7f4a_7c15)), ..self }
    }

    fn switched(on: bool) -> Self {
        Self {
            seed: 0,
            fixed_pattern_seed: 0,
            photon: on,
            dark_current: on,
            read: on,
            reset: on,
            row: on,
            prnu: on,
            dsnu: on,
            column: on,
            defects: on,
        }
    }

    /// Returns the generator of one kind of noise for one row of one plane.
    pub(crate) fn rng(&self, kind: Kind, plane: usize, row: usize) -> ChaCha8Rng {
        let seed = if kind.is_fixed() { !self.fixed_pattern_seed } else { self.seed };
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream((kind as u64) << 48 | (plane as u64) << 32 | row as u64);
        rng
    }
}

/// The kinds of noise; each has streams of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Photon = 1,
    Read = 2,
    Reset = 3,
    Row = 4,
    Prnu = 17,
    Dsnu = 18,
    ColumnOffset = 19,
    ColumnGain = 20,
    Defects = 21,
}

impl Kind {
    fn is_fixed(self) -> bool {
        self as u64 >= Self::Prnu as u64
    }
}
