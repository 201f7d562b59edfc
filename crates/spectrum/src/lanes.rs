//! Values at several wavelengths at once.

/// Returns a value for each of `N` wavelengths, by its number from 0: as `std::array::from_fn`, but one loop, of which vector code is made.
#[inline(always)]
pub fn lanes<const N: usize>(value: impl Fn(usize) -> f32) -> [f32; N] {
    let mut all = [0.0; N];
    for (lane, of_lane) in all.iter_mut().enumerate() {
        *of_lane = value(lane);
    }
    all
}
