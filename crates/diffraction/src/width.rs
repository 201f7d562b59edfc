//! The width of a symmetric profile.

/// Returns the full width at half maximum of a profile that falls from 0 to beyond `reach`, found by bisection.
///
/// The profile should fall monotonically until half its value at 0; NaN if it stays above that up to `reach`.
pub fn full_width_at_half_maximum(profile: impl Fn(f64) -> f64, reach: f64) -> f64 {
    let half = 0.5 * profile(0.0);
    let n = 400;
    let Some(first) = (1..=n).map(|i| reach * f64::from(i) / f64::from(n)).find(|&u| profile(u) < half) else {
        return f64::NAN;
    };
    let (mut inside, mut outside) = (first - reach / f64::from(n), first);
    for _ in 0..60 {
        let middle = 0.5 * (inside + outside);
        if profile(middle) < half {
            outside = middle;
        } else {
            inside = middle;
        }
    }
    inside + outside
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gaussian_is_2_355_sigma_wide() {
        let width = full_width_at_half_maximum(|u| (-0.5 * u * u).exp(), 5.0);
        assert!((width - 2.0 * (2.0 * 2.0f64.ln()).sqrt()).abs() < 1e-12);
        assert!(full_width_at_half_maximum(|_| 1.0, 5.0).is_nan());
    }
}
