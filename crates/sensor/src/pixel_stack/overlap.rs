//! How much of a line lands within a photodiode, in closed form.

/// Where light from places of a line lands: at `scale × place + landing`, the landing spread evenly between two ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Map {
    pub(super) scale: f64,
    pub(super) landing_um: [f64; 2],
}

/// Spreads below this share of the photodiode's half width count as none: their differences would be lost in rounding.
const NARROW: f64 = 1e-5;

/// Returns the length of the part of a line that lands within a half width of 0, averaged over the landings (eq. 5).
pub(super) fn mean_overlap_um(line_um: [f64; 2], map: Map, half_um: f64) -> f64 {
    let Map { scale, landing_um } = map;
    let length_um = line_um[1] - line_um[0];
    let image_um = line_um.map(|x| scale * x);
    // Both spreads are as wide whichever end comes first.
    let (image_width_um, spread_um) = ((image_um[1] - image_um[0]).abs(), (landing_um[1] - landing_um[0]).abs());
    let (image_low_um, landing_low_um) = (image_um[0].min(image_um[1]), landing_um[0].min(landing_um[1]));
    let share = match (image_width_um < NARROW * half_um, spread_um < NARROW * half_um) {
        (true, true) => {
            let at_um = image_low_um + 0.5 * image_width_um + landing_low_um + 0.5 * spread_um;
            f64::from(u8::from(at_um.abs() <= half_um))
        }
        (false, true) => inside(image_low_um + landing_low_um + 0.5 * spread_um, image_width_um, half_um),
        (true, false) => inside(landing_low_um + image_low_um + 0.5 * image_width_um, spread_um, half_um),
        (false, false) => {
            let low_um = image_low_um + landing_low_um;
            let at = |by_um: f64| within_twice(low_um + by_um, half_um);
            let parts = at(image_width_um + spread_um) - at(image_width_um) - at(spread_um) + at(0.0);
            (parts / (image_width_um * spread_um)).clamp(0.0, 1.0)
        }
    };
    length_um * share
}

/// Returns the share of an interval that lies within a half width of 0.
fn inside(low_um: f64, width_um: f64, half_um: f64) -> f64 {
    ((low_um + width_um).min(half_um) - low_um.max(-half_um)).max(0.0) / width_um
}

/// The integral of the integral of what is 1 within a half width of 0: that of x held to it.
fn within_twice(x_um: f64, half_um: f64) -> f64 {
    let size_um = x_um.abs();
    if size_um <= half_um { 0.5 * x_um * x_um } else { half_um * (size_um - 0.5 * half_um) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// The double mean by half a million midpoints.
    fn counted(line_um: [f64; 2], map: Map, half_um: f64) -> f64 {
        const N: usize = 700;
        let between = |ends: [f64; 2], i: usize| ends[0] + (ends[1] - ends[0]) * (i as f64 + 0.5) / N as f64;
        let lands = |i: usize, j: usize| map.scale * between(line_um, i) + between(map.landing_um, j);
        let n = (0..N * N).filter(|k| lands(k / N, k % N).abs() <= half_um).count();
        (line_um[1] - line_um[0]) * n as f64 / (N * N) as f64
    }

    #[test]
    fn overlap_is_that_of_counted_rays() {
        for (scale, landing_um) in
            [(1.0, [0.2, 0.9]), (0.3, [0.7, 0.2]), (-0.4, [-1.0, -0.6]), (0.0, [0.1, 0.8]), (0.8, [0.4, 0.4])]
        {
            let map = Map { scale, landing_um };
            let found = mean_overlap_um([-1.0, 0.6], map, 0.5);
            // Steps of 1/700 of the line at the photodiode's two edges.
            assert!((found - counted([-1.0, 0.6], map, 0.5)).abs() < 3e-3, "{scale} {landing_um:?}: {found}");
        }
    }

    #[test]
    fn narrow_spreads_join_wide_ones() {
        for width in [0.5 * NARROW, 2.0 * NARROW] {
            let at = |scale, landing_um| mean_overlap_um([-1.0, 1.0], Map { scale, landing_um }, 1.0);
            assert_relative_eq!(at(0.5, [0.8, 0.8 + width]), 2.0 * 0.7, max_relative = 1e-4);
            assert_relative_eq!(at(0.5 * width, [0.6, 1.4]), 2.0 * 0.5, max_relative = 1e-4);
        }
        assert_eq!(mean_overlap_um([-1.0, 1.0], Map { scale: 0.0, landing_um: [0.3; 2] }, 1.0), 2.0);
    }
}
