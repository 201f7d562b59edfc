//! The numbers that the kernel computes with: f64, or f32 where pictures need no more.

use std::{
    fmt::Debug,
    ops::{Add, AddAssign, BitAnd, BitOr, Div, Mul, Neg, Not, Sub, SubAssign},
};

/// A float with its lane mask. Everything the kernel does with it is correctly rounded on every machine.
pub(crate) trait Real:
    Copy
    + Debug
    + Send
    + Sync
    + PartialOrd
    + Neg<Output = Self>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + AddAssign
    + SubAssign
{
    /// An integer of the float's width: all ones for yes, 0 for no, so that a vector compares into it at no cost.
    type Mask: Copy
        + Debug
        + PartialEq
        + BitAnd<Output = Self::Mask>
        + BitOr<Output = Self::Mask>
        + Not<Output = Self::Mask>;

    const ZERO: Self;
    const ONE: Self;
    const TWO: Self;
    const HALF: Self;
    const MAX: Self;
    const INFINITY: Self;
    /// A Newton step, against 1 + distance, after which the next would be lost in rounding: its square is.
    const SMALL_STEP: Self;
    /// Of the square of a product of two sines: below it is a plane of incidence that rounding made.
    const TINY: Self;
    /// Whether rays gather path length; f32 holds no fraction of a wave of it.
    const HAS_PATH: bool;
    const YES: Self::Mask;
    const NO: Self::Mask;

    fn of(value: f64) -> Self;
    fn to_f64(self) -> f64;
    fn sqrt(self) -> Self;
    fn abs(self) -> Self;

    #[inline(always)]
    fn mask(is: bool) -> Self::Mask {
        if is { Self::YES } else { Self::NO }
    }
}

macro_rules! real {
    ($float:ty, $mask:ty, $small_step:expr, $tiny:expr, $has_path:expr) => {
        impl Real for $float {
            type Mask = $mask;

            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            const TWO: Self = 2.0;
            const HALF: Self = 0.5;
            const MAX: Self = Self::MAX;
            const INFINITY: Self = Self::INFINITY;
            const SMALL_STEP: Self = $small_step;
            const TINY: Self = $tiny;
            const HAS_PATH: bool = $has_path;
            const YES: $mask = <$mask>::MAX;
            const NO: $mask = 0;

            #[inline(always)]
            fn of(value: f64) -> Self {
                value as Self
            }

            #[inline(always)]
            fn to_f64(self) -> f64 {
                self.into()
            }

            #[inline(always)]
            fn sqrt(self) -> Self {
                self.sqrt()
            }

            #[inline(always)]
            fn abs(self) -> Self {
                self.abs()
            }
        }
    };
}

real!(f64, u64, 1e-9, 1e-80, true);
real!(f32, u32, 2e-5, 1e-34, false);
