//! Numbers as people type them.

/// Units and how long, in the first of their kind, each is: what is typed in one is converted to that of the field.
const UNITS: [&[(&str, f64)]; 3] = [
    &[("mm", 1.0), ("nm", 1e-6), ("µm", 1e-3), ("um", 1e-3), ("cm", 10.0), ("m", 1e3), ("km", 1e6)],
    &[("s", 1.0), ("ms", 1e-3), ("µs", 1e-6), ("us", 1e-6), ("min", 60.0)],
    &[("°", 1.0), ("deg", 1.0), ("rad", 57.295_779_513_082_32)],
];

/// Returns the number of a text in a field of this unit: decimals with a point or a comma, thousands in groups of three, fractions as
/// `1/60`, f-numbers as `f/4`, and units as `550nm` or `2 m`; `None` of anything else.
///
/// A comma before exactly three digits parts thousands (`1,500` is 1500), unless a 0 stands alone before it; any other is that of
/// a decimal (`2,8`).
pub(super) fn number_of(text: &str, unit: &str) -> Option<f64> {
    let text = text.trim();
    let text = ["f/", "F/"].iter().find_map(|mark| text.strip_prefix(mark)).unwrap_or(text).trim();
    let unit = unit.trim();
    let digits_end = text.rfind(|c: char| c.is_ascii_digit() || c == '.').map_or(0, |place| place + 1);
    let (number, stated) = text.split_at(digits_end);
    let stated = stated.trim();
    if digits_end == 0 {
        return plain(text);
    }
    let factor = if stated.is_empty() || stated == unit { 1.0 } else { conversion(stated, unit)? };
    let value = match number.split_once('/') {
        Some((above, below)) => plain(above)? / plain(below)?,
        None => plain(number)?,
    };
    value.is_finite().then_some(value * factor)
}

/// Returns how many of one unit another is; `None` where they are not of one kind.
fn conversion(from: &str, to: &str) -> Option<f64> {
    UNITS.iter().find_map(|units| {
        let of = |name: &str| units.iter().find(|(own, _)| *own == name).map(|(_, factor)| factor);
        Some(of(from)? / of(to)?)
    })
}

/// Returns a number without a unit.
fn plain(text: &str) -> Option<f64> {
    let text = text.trim().replace('−', "-");
    let groups: Vec<&str> = text.split(',').collect();
    let number = match groups.as_slice() {
        [_] => text,
        [first, rest @ ..] => {
            let whole = first.trim_start_matches(['-', '+']);
            let (last, middle) = rest.split_last()?;
            let last_group = last.split('.').next().unwrap_or_default();
            let is_group = |group: &str| group.len() == 3 && group.bytes().all(|b| b.is_ascii_digit());
            let is_head = (1..=3).contains(&whole.len()) && !whole.starts_with('0');
            if is_head && middle.iter().all(|group| is_group(group)) && is_group(last_group) {
                groups.concat()
            } else if rest.len() == 1 && !text.contains('.') {
                text.replace(',', ".")
            } else {
                return None;
            }
        }
        [] => return None,
    };
    number.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_as_people_type_them() {
        for (text, unit, expected) in [
            ("2.8", "", Some(2.8)),
            (" 2,8 ", "", Some(2.8)),
            ("1,500", "mm", Some(1500.0)),
            ("1,500.5", "mm", Some(1500.5)),
            ("12,345,678", "", Some(12_345_678.0)),
            ("0,125", "s", Some(0.125)),
            ("1,5000", "", Some(1.5)),
            ("1/60", "s", Some(1.0 / 60.0)),
            ("1/60 s", "s", Some(1.0 / 60.0)),
            ("20 ms", "s", Some(0.02)),
            ("f/4", "", Some(4.0)),
            ("F/2,8", "", Some(2.8)),
            ("550nm", "nm", Some(550.0)),
            ("0.55 µm", "nm", Some(550.0)),
            ("2 m", "mm", Some(2000.0)),
            ("−3", "°", Some(-3.0)),
            ("-3deg", "°", Some(-3.0)),
            ("1e3", "", Some(1000.0)),
            ("inf", "mm", Some(f64::INFINITY)),
            ("5 kg", "mm", None),
            ("5 s", "mm", None),
            ("1,50,0", "", None),
            ("1/0", "s", None),
            ("wide", "", None),
            ("", "", None),
        ] {
            let found = number_of(text, unit);
            let is_right = match (found, expected) {
                (Some(found), Some(expected)) => found == expected || (found - expected).abs() < 1e-12 * expected.abs(),
                (found, expected) => found == expected,
            };
            assert!(is_right, "'{text}' in {unit}: {found:?}, expected {expected:?}");
        }
    }
}
