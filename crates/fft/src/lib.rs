//! Plans of Fourier transforms in single precision, compiled once for all crates that transform.
//!
//! Transforms are not scaled: one forth and one back multiply by the number of samples. Real transforms of n samples have
//! n / 2 + 1 coefficients.
#![doc = include_str!("../README.md")]

use std::{fmt, sync::Arc};

use realfft::RealFftPlanner;
use rustfft::FftPlanner;

pub use realfft::{ComplexToReal, FftError, RealToComplex};
pub use rustfft::{Fft, num_complex::Complex};

/// Makes plans, and keeps them for the next time.
pub struct Planner {
    complex: FftPlanner<f32>,
    real: RealFftPlanner<f32>,
}

impl Planner {
    /// Returns a planner that has no plans yet.
    pub fn new() -> Self {
        Self { complex: FftPlanner::new(), real: RealFftPlanner::new() }
    }

    /// Returns the plan of the transform of `n` complex samples, Σ x exp(−2πi jk/n).
    pub fn forward(&mut self, n: usize) -> Arc<dyn Fft<f32>> {
        self.complex.plan_fft_forward(n)
    }

    /// Returns the plan of the transform back of `n` complex samples, Σ x exp(2πi jk/n).
    pub fn inverse(&mut self, n: usize) -> Arc<dyn Fft<f32>> {
        self.complex.plan_fft_inverse(n)
    }

    /// Returns the plan of the transform of `n` real samples.
    pub fn real_forward(&mut self, n: usize) -> Arc<dyn RealToComplex<f32>> {
        self.real.plan_fft_forward(n)
    }

    /// Returns the plan of the transform back to `n` real samples.
    pub fn real_inverse(&mut self, n: usize) -> Arc<dyn ComplexToReal<f32>> {
        self.real.plan_fft_inverse(n)
    }
}

impl Default for Planner {
    fn default() -> Self {
        Self::new()
    }
}

impl fmt::Debug for Planner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Planner").finish_non_exhaustive()
    }
}
