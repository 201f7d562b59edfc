//! Numbers as files state them: decimals, which sums and reciprocals should not blur.

/// How many neighbors of a reciprocal are looked at on each side.
const N_NEIGHBORS: i32 = 4;

/// Returns the number, of the fewest digits, whose reciprocal is exactly this, or else the reciprocal; 0 of 0.
///
/// Files state radii, lenses keep curvatures: the reciprocal of a reciprocal may be off in its last digit.
pub(super) fn reciprocal(number: f64) -> f64 {
    if number == 0.0 {
        return 0.0;
    }
    let nearest = 1.0 / number;
    let neighbor =
        |steps: i32| (0..steps.abs()).fold(nearest, |at, _| if steps < 0 { at.next_down() } else { at.next_up() });
    let exact = (-N_NEIGHBORS..=N_NEIGHBORS).map(neighbor).filter(|candidate| 1.0 / candidate == number);
    exact.min_by_key(|candidate| digits(*candidate).len()).unwrap_or(nearest)
}

/// Whether the reciprocal of [`reciprocal`] is this number.
pub(super) fn has_reciprocal(number: f64) -> bool {
    number == 0.0 || 1.0 / reciprocal(number) == number
}

/// Returns the sum of two numbers as they are written: 12.3 and 3.02 are 15.32, not 15.319999999999999.
pub(super) fn decimal_sum(a: f64, b: f64) -> f64 {
    exact_sum(a, b).unwrap_or(a + b)
}

/// Returns the sum of the shortest decimals of two numbers, where their digits overlap enough to be added.
fn exact_sum(a: f64, b: f64) -> Option<f64> {
    let ((a, a_power), (b, b_power)) = (decimal(a)?, decimal(b)?);
    let power = a_power.min(b_power);
    let scaled = |digits: i128, own: i32| digits.checked_mul(10_i128.checked_pow((own - power).try_into().ok()?)?);
    let sum = scaled(a, a_power)?.checked_add(scaled(b, b_power)?)?;
    format!("{sum}e{power}").parse().ok()
}

/// Returns a number as digits times a power of ten.
fn decimal(number: f64) -> Option<(i128, i32)> {
    let text = format!("{number:e}");
    let (mantissa, power) = text.split_once('e')?;
    let n_behind_point = mantissa.split_once('.').map_or(0, |(_, behind)| behind.len());
    let digits = mantissa.replace('.', "").parse().ok()?;
    Some((digits, power.parse::<i32>().ok()? - i32::try_from(n_behind_point).ok()?))
}

fn digits(number: f64) -> String {
    format!("{number:e}")
}

/// Returns a number as people write it: plain, or with an exponent where it would have many zeros.
pub(super) fn written(number: f64) -> String {
    let size = number.abs();
    if size == 0.0 || (1e-4..1e7).contains(&size) { format!("{number}") } else { format!("{number:e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn radii_come_back_from_their_curvatures_as_they_were_written() {
        for i in 1..20_000_i32 {
            let radius = f64::from(i) * 0.037;
            let radius: f64 = format!("{radius:.3}").parse().unwrap();
            let curvature = 1.0 / radius;
            assert_eq!(reciprocal(curvature), radius, "{radius}");
            assert_eq!(reciprocal(-curvature), -radius);
            assert!(has_reciprocal(curvature));
        }
        assert_eq!((reciprocal(0.0), has_reciprocal(0.0)), (0.0, true));
    }

    #[test]
    fn sums_are_those_of_the_decimals() {
        assert_ne!(0.1 + 0.2, 0.3);
        assert_eq!(decimal_sum(12.3, 3.02), 15.32);
        assert_eq!(decimal_sum(0.1, 0.2), 0.3);
        assert_eq!(decimal_sum(-0.3, 0.1), -0.2);
        assert_eq!(decimal_sum(1e300, 1.0), 1e300);
        assert_eq!(decimal_sum(f64::INFINITY, 1.5), f64::INFINITY);
        assert_eq!(decimal_sum(0.0, 2.5), 2.5);
    }

    #[test]
    fn numbers_are_written_to_be_read_back() {
        for (number, text) in [(15.32, "15.32"), (-2.5e-9, "-2.5e-9"), (0.0, "0"), (1e10, "1e10"), (1e-4, "0.0001")] {
            assert_eq!(written(number), text);
        }
    }
}
