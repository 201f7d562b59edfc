//! Numbers as people type them: lists, `400,550` or `400:700:10`, and amounts of memory, `1GiB`.

use crate::PipelineError;

/// The most numbers that one list may hold.
const LONGEST: usize = 100_000;

/// Returns the numbers of a list: values and `first:last:step` ranges, separated by commas.
///
/// `inf` is infinity. `what` names the list in the error.
///
/// ```
/// let wavelengths_nm = dioptric_pipeline::parse_numbers("wavelengths", "400:700:100,850")?;
/// assert_eq!(wavelengths_nm, [400.0, 500.0, 600.0, 700.0, 850.0]);
/// # Ok::<(), dioptric_pipeline::PipelineError>(())
/// ```
///
/// # Errors
/// When an item is neither a number nor a range with a step that leads from first to last.
pub fn parse_numbers(what: &'static str, text: &str) -> Result<Vec<f64>, PipelineError> {
    let wrong = |item: &str| PipelineError::List { what, item: item.trim().to_owned() };
    let mut numbers = Vec::new();
    for item in text.split(',') {
        let parts: Option<Vec<f64>> = item.split(':').map(|part| part.trim().parse().ok()).collect();
        match parts.as_deref() {
            Some(&[value]) if !value.is_nan() => numbers.push(value),
            Some(&[first, last, step]) => {
                let n_steps = ((last - first) / step + 1e-9).floor();
                if !(n_steps.is_finite() && n_steps >= 0.0 && (n_steps as usize) < LONGEST && step.is_finite()) {
                    return Err(wrong(item));
                }
                numbers.extend((0..=n_steps as usize).map(|i| first + step * i as f64));
            }
            _ => return Err(wrong(item)),
        }
    }
    Ok(numbers)
}

/// Returns the angles of a list of directions, degrees: as [`parse_pairs`] has them, or `ANGLE@AZIMUTH`, so far from the axis in that
/// direction from +x, as the angles along x and y that the x–z and the y–z plane see.
///
/// # Errors
/// When an item is none, or an angle of 90° has no such angles.
pub fn parse_directions(what: &'static str, text: &str) -> Result<Vec<[f64; 2]>, PipelineError> {
    let mut directions = Vec::new();
    for item in text.split(',') {
        let Some((angle, azimuth)) = item.split_once('@') else {
            directions.extend(parse_pairs(what, item)?);
            continue;
        };
        let number = |text: &str| text.trim().parse::<f64>().ok().filter(|v| v.is_finite());
        let wrong = || PipelineError::List { what, item: item.trim().to_owned() };
        let (angle_deg, azimuth_deg) = number(angle).zip(number(azimuth)).ok_or_else(wrong)?;
        let ((sine, z), (up, right)) = (angle_deg.to_radians().sin_cos(), azimuth_deg.to_radians().sin_cos());
        // Right angles leave rounding, which is no direction.
        let across = [right, up].map(|part| if part.abs() < 1e-15 { 0.0 } else { sine * part });
        let is_alone = across.contains(&0.0);
        if z.abs() < 1e-12 && !is_alone {
            return Err(wrong());
        }
        let of = |across: f64| if across == 0.0 { 0.0 } else { across.atan2(z).to_degrees() };
        directions.push(across.map(of));
    }
    Ok(directions)
}

/// Returns the pairs of a list: `x/y`, or numbers and ranges as [`parse_numbers`] reads them, which are y with x = 0.
///
/// # Errors
/// When an item is neither.
pub fn parse_pairs(what: &'static str, text: &str) -> Result<Vec<[f64; 2]>, PipelineError> {
    let mut pairs = Vec::new();
    for item in text.split(',') {
        match item.split_once('/') {
            None => pairs.extend(parse_numbers(what, item)?.into_iter().map(|y| [0.0, y])),
            Some((x, y)) => match [x, y].map(|part| part.trim().parse::<f64>().ok().filter(|v| !v.is_nan())) {
                [Some(x), Some(y)] => pairs.push([x, y]),
                _ => return Err(PipelineError::List { what, item: item.trim().to_owned() }),
            },
        }
    }
    Ok(pairs)
}

/// Returns a number without the digits that rounding left behind: to a thousandth.
pub fn number(value: f64) -> String {
    if value.is_infinite() {
        return if value > 0.0 { "∞" } else { "−∞" }.to_owned();
    }
    format!("{}", (value * 1e3).round() / 1e3 + 0.0)
}

/// Reads an amount of memory: bytes, or a number with kB, MB, GB (powers of 1000) or KiB, MiB, GiB (of 1024).
///
/// # Errors
/// When it is none.
pub fn parse_bytes(text: &str) -> Result<u64, PipelineError> {
    let wrong = || PipelineError::Bytes { found: text.to_owned() };
    let trimmed = text.trim();
    let end = trimmed.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(trimmed.len());
    let (number, unit) = trimmed.split_at(end);
    let factor: f64 = match unit.to_ascii_lowercase().as_str() {
        "" | "b" => 1.0,
        "k" | "kb" => 1e3,
        "m" | "mb" => 1e6,
        "g" | "gb" => 1e9,
        "tb" => 1e12,
        "kib" => 1024.0,
        "mib" => 1024.0 * 1024.0,
        "gib" => 1024.0 * 1024.0 * 1024.0,
        "tib" => 1024.0 * 1024.0 * 1024.0 * 1024.0,
        _ => return Err(wrong()),
    };
    let bytes = factor * number.trim().parse::<f64>().map_err(|_| wrong())?;
    // Beyond 2⁵³ bytes no machine tells them apart.
    if (1.0..9e15).contains(&bytes) { Ok(bytes as u64) } else { Err(wrong()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(text: &str, expected: &[f64]) {
        assert_eq!(parse_numbers("numbers", text).unwrap(), expected);
    }

    #[test]
    fn lists_and_ranges_mix() {
        check("5", &[5.0]);
        check(" -5, 0 ,inf", &[-5.0, 0.0, f64::INFINITY]);
        check("0:1:0.25", &[0.0, 0.25, 0.5, 0.75, 1.0]);
        check("400:690:100", &[400.0, 500.0, 600.0]);
        check("3:1:-1,7", &[3.0, 2.0, 1.0, 7.0]);
    }

    #[test]
    fn pairs_mix_with_numbers() {
        let found = parse_pairs("fields", "0, 5/10,-2/-1.5,10:20:10").unwrap();
        assert_eq!(found, [[0.0, 0.0], [5.0, 10.0], [-2.0, -1.5], [0.0, 10.0], [0.0, 20.0]]);
        for item in ["1/x", "1/2/3", "/"] {
            assert!(parse_pairs("fields", item).unwrap_err().to_string().contains(item));
        }
    }

    #[test]
    fn directions_are_seen_by_two_planes() {
        let found = parse_directions("fields", "30@90, 100@0,5/10, 110@-90,3").unwrap();
        let expected = [[0.0, 30.0], [100.0, 0.0], [5.0, 10.0], [0.0, -110.0], [0.0, 3.0]];
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
        // tan 104.0° = tan 100° · cos 45°, as both planes see 100° between them.
        let [[x, y]] = parse_directions("fields", "100@45").unwrap()[..] else { panic!("one") };
        assert!((x.to_radians().tan() / (100f64.to_radians().tan() * 0.5f64.sqrt()) - 1.0).abs() < 1e-12 && x > 90.0);
        assert!((x - y).abs() < 1e-12);
        for item in ["90@45", "1@", "@2", "1@2@3", "inf@0"] {
            assert!(parse_directions("fields", item).unwrap_err().to_string().contains(item), "{item}");
        }
    }

    #[test]
    fn the_wrong_item_is_named() {
        for (text, item) in [("1,two", "two"), ("1:2", "1:2"), ("1:2:0", "1:2:0"), ("2:1:1", "2:1:1"), ("NaN", "NaN")] {
            let message = parse_numbers("fields", text).unwrap_err().to_string();
            assert!(message.contains(item) && message.contains("fields"), "{message}");
        }
        assert!(parse_numbers("fields", "").is_err());
        assert!(parse_numbers("fields", "0:1:1e-9").is_err());
    }

    #[test]
    fn amounts_of_memory_are_read() {
        for (text, bytes) in [
            ("1GiB", 1 << 30),
            ("500MB", 500_000_000),
            ("1.5 kib", 1536),
            ("4096", 4096),
            ("2g", 2_000_000_000),
            (" 64 MiB ", 64 << 20),
        ] {
            assert_eq!(parse_bytes(text).unwrap(), bytes, "{text}");
        }
        for wrong in ["", "GiB", "-1GB", "0", "1 parsec", "1e400", "NaN", "1GiB2"] {
            let message = parse_bytes(wrong).unwrap_err().to_string();
            assert!(message.contains("1GiB") && message.contains(wrong), "{message}");
        }
    }
}
