//! An axis of a plot: values to pixels, and round numbers along it.

use dioptric_analysis::Scale;

/// One value for every so many pixels.
const TICK_PX: f64 = 45.0;

/// An axis from its first value, at 0 px, to its last.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Axis {
    range: (f64, f64),
    length_px: f64,
    scale: Scale,
}

impl Axis {
    pub(crate) fn new(range: (f64, f64), length_px: f64, scale: Scale) -> Self {
        Self { range, length_px, scale }
    }

    /// Returns where a value lies, px from the axis's start; not finite for a value that has no place.
    pub(crate) fn px(&self, value: f64) -> f64 {
        let [first, last, value] = match self.scale {
            Scale::Linear => [self.range.0, self.range.1, value],
            Scale::Logarithmic => [self.range.0, self.range.1, value].map(f64::log10),
        };
        self.length_px * (value - first) / (last - first)
    }

    /// Returns round numbers in the range and how to write them, first to last.
    pub(crate) fn ticks(&self) -> Vec<(f64, String)> {
        match self.scale {
            Scale::Linear => ticks(self.range, self.length_px),
            Scale::Logarithmic => decades(self.range, self.length_px),
        }
    }
}

/// Returns round numbers in a range, about one for every 45 px, and how to write them.
pub(crate) fn ticks((first, last): (f64, f64), length_px: f64) -> Vec<(f64, String)> {
    let span = last - first;
    if !(span > 0.0 && span.is_finite()) {
        return Vec::new();
    }
    let step = round_up(span * TICK_PX / length_px.max(TICK_PX));
    let decimals = (-step.log10().floor()).max(0.0) as usize;
    let mut values = Vec::new();
    let mut i = (first / step - 1e-9).ceil();
    while i * step <= last + 1e-9 * span {
        // Adding 0 turns −0 into 0.
        values.push((i * step, format!("{:.decimals$}", i * step + 0.0)));
        i += 1.0;
    }
    values
}

/// Returns the powers of ten in a range, with 2 and 5 times them where there is room, and how to write them.
fn decades((first, last): (f64, f64), length_px: f64) -> Vec<(f64, String)> {
    if !(first > 0.0 && last > first && last.is_finite()) {
        return Vec::new();
    }
    let n_decades = (last / first).log10();
    let room_px = length_px / n_decades;
    // Between 2 and 5 lie four tenths of a decade.
    let multiples: &[f64] = if 0.3 * room_px >= TICK_PX { &[1.0, 2.0, 5.0] } else { &[1.0] };
    let every = (TICK_PX / room_px).ceil().max(1.0) as i32;
    let (lowest, highest) = (first.log10().floor() as i32, last.log10().ceil() as i32);
    (lowest..=highest)
        .filter(|power| power % every == 0)
        .flat_map(|power| multiples.iter().map(move |&multiple| (multiple, power)))
        .map(|(multiple, power)| (multiple * 10_f64.powi(power), power_word(multiple, power)))
        .filter(|(value, _)| (first * (1.0 - 1e-9)..=last * (1.0 + 1e-9)).contains(value))
        .collect()
}

/// Writes a multiple of a power of ten: as a plain number where that is short.
fn power_word(multiple: f64, power: i32) -> String {
    const RAISED: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    if (-3..=4).contains(&power) {
        let decimals = (-power).max(0) as usize;
        return format!("{:.decimals$}", multiple * 10_f64.powi(power));
    }
    let sign = if power < 0 { "⁻" } else { "" };
    let digits: String =
        power.unsigned_abs().to_string().bytes().map(|digit| RAISED[usize::from(digit - b'0')]).collect();
    if multiple == 1.0 { format!("10{sign}{digits}") } else { format!("{multiple:.0}·10{sign}{digits}") }
}

/// Returns the least of 1, 2 or 5 times a power of ten that is at least this large; 1 for what is no positive number.
pub(crate) fn round_up(least: f64) -> f64 {
    if !(least > 0.0 && least.is_finite()) {
        return 1.0;
    }
    let power = 10_f64.powf(least.log10().floor());
    [1.0, 2.0, 5.0].into_iter().map(|m| m * power).find(|v| *v >= least * (1.0 - 1e-12)).unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(axis: Axis) -> Vec<String> {
        axis.ticks().into_iter().map(|(_, word)| word).collect()
    }

    #[test]
    fn ticks_are_round_and_inside() {
        let linear = |range, px| words(Axis::new(range, px, Scale::Linear));
        assert_eq!(linear((-1.0, 1.0), 200.0), ["-1.0", "-0.5", "0.0", "0.5", "1.0"]);
        assert_eq!(linear((0.0, 23.0), 150.0), ["0", "10", "20"]);
        assert!(linear((1.0, 1.0), 100.0).is_empty());
        assert_eq!([0.3, 2.0, 5.1, 0.0, f64::NAN].map(round_up), [0.5, 2.0, 10.0, 1.0, 1.0]);
    }

    #[test]
    fn logarithmic_ticks_are_powers_of_ten() {
        let logarithmic = |range, px| words(Axis::new(range, px, Scale::Logarithmic));
        assert_eq!(logarithmic((0.01, 100.0), 300.0), ["0.01", "0.1", "1", "10", "100"]);
        assert_eq!(logarithmic((1.0, 12.0), 300.0), ["1", "2", "5", "10"]);
        assert_eq!(logarithmic((1e-8, 1e8), 200.0), ["10⁻⁸", "10⁻⁴", "1", "10000", "10⁸"]);
        assert!(logarithmic((0.0, 1.0), 100.0).is_empty());
    }

    #[test]
    fn decades_have_equal_lengths() {
        let axis = Axis::new((0.1, 1000.0), 400.0, Scale::Logarithmic);
        for (value, px) in [(0.1, 0.0), (1.0, 100.0), (10.0, 200.0), (1000.0, 400.0)] {
            assert!((axis.px(value) - px).abs() < 1e-9, "{value}");
        }
        assert!(!axis.px(0.0).is_finite() && !axis.px(-1.0).is_finite());
        assert_eq!(Axis::new((-1.0, 1.0), 100.0, Scale::Linear).px(0.5), 75.0);
    }
}
