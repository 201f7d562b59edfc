//! Portable float maps (`.pfm`): three lines of text and rows of floats from the bottom up.

use std::path::Path;

use ndarray::Array2;

use super::{
    stated::{Noted, name_of},
    unusable::{TRUNCATED, check_memory, unreadable},
};
use crate::SceneError;

/// The planes of a portable float map: one of gray, or red, green and blue.
///
/// The scale in its header says by its sign in which order bytes are. Its size is what most programs write anyhow and none multiplies by (the
/// disparities of Middlebury have 1/255): it is named.
pub(super) fn read_pfm(path: &Path) -> Result<Noted<Vec<Array2<f32>>>, SceneError> {
    let length = std::fs::metadata(path).map_err(|error| unreadable(path, error))?.len();
    check_memory(path, length.saturating_mul(2), length)?;
    let bytes = std::fs::read(path).map_err(|error| unreadable(path, error))?;
    let (planes, unused) = parse(&bytes).map_err(|reason| unreadable(path, reason))?;
    let note = (!unused.is_empty()).then(|| format!("{}: {} are not used", name_of(path), unused.join(" and ")));
    Ok(Noted::new(planes, note))
}

/// Returns the planes, and in words what else there is.
fn parse(bytes: &[u8]) -> Result<(Vec<Array2<f32>>, Vec<String>), String> {
    let mut at = 0;
    let mut word = || {
        let from = at + bytes[at..].iter().take_while(|b| b.is_ascii_whitespace()).count();
        let end = from + bytes[from..].iter().take(40).take_while(|b| !b.is_ascii_whitespace()).count();
        // One white space ends the header.
        at = (end + 1).min(bytes.len());
        String::from_utf8_lossy(&bytes[from..end]).into_owned()
    };
    let n_channels = match word().as_str() {
        "Pf" => 1,
        "PF" => 3,
        _ => return Err("it is no portable float map, expected 'Pf' or 'PF' at its start".to_owned()),
    };
    let mut number = |what: &str| -> Result<f64, String> {
        let text = word();
        text.parse().map_err(|_| format!("its {what} is '{text}', expected a number"))
    };
    let (columns, rows, scale) = (number("width")?, number("height")?, number("scale")?);
    let is_side = |n: f64| n >= 1.0 && n.fract() == 0.0 && n <= f64::from(1 << 20);
    if !(is_side(columns) && is_side(rows) && scale.is_finite() && scale != 0.0) {
        return Err(format!("it has {columns} × {rows} samples of scale {scale}"));
    }
    let (columns, rows) = (columns as usize, rows as usize);
    let mut data = &bytes[at..];
    // Programs that write lines as Windows does end it with two.
    if bytes[at - 1] == b'\r' && data.first() == Some(&b'\n') {
        data = &data[1..];
    }
    if data.len() / 4 / n_channels / columns < rows {
        return Err(TRUNCATED.to_owned());
    }
    let is_little = scale < 0.0;
    let plane = |channel: usize| {
        Array2::from_shape_fn((rows, columns), |(row, column)| {
            let index = 4 * (((rows - 1 - row) * columns + column) * n_channels + channel);
            let four = [data[index], data[index + 1], data[index + 2], data[index + 3]];
            if is_little { f32::from_le_bytes(four) } else { f32::from_be_bytes(four) }
        })
    };
    let n_more = data.len() - 4 * n_channels * columns * rows;
    let scale = (scale.abs() != 1.0).then(|| format!("the size of its scale, {}", scale.abs()));
    let more = (n_more > 0).then(|| format!("{n_more} bytes after its samples"));
    Ok(((0..n_channels).map(plane).collect(), scale.into_iter().chain(more).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_of_either_order_are_read_upright() {
        let of = |head: &str, floats: &[[u8; 4]]| [head.as_bytes(), &floats.concat()].concat();
        let values: Vec<f32> = (0..6).map(|v| v as f32).collect();
        let little: Vec<[u8; 4]> = values.iter().map(|v| v.to_le_bytes()).collect();
        let big: Vec<[u8; 4]> = values.iter().map(|v| v.to_be_bytes()).collect();
        let gray = ndarray::arr2(&[[3.0, 4.0, 5.0], [0.0, 1.0, 2.0]]);
        let plain = |bytes: &[u8]| {
            let (planes, unused) = parse(bytes).unwrap();
            assert!(unused.is_empty(), "{unused:?}");
            planes
        };
        assert_eq!(plain(&of("Pf\n3 2\n-1.0\n", &little)), std::slice::from_ref(&gray));
        assert_eq!(plain(&of("Pf\n3 2\n1\n", &big)), std::slice::from_ref(&gray));
        assert_eq!(plain(&of("Pf\r\n3 2\r\n-1\r\n", &little)), std::slice::from_ref(&gray));
        assert_eq!(plain(&of("PF\n1 2\n-1\n", &little))[1], ndarray::arr2(&[[4.0], [1.0]]));
        // The size of the scale is named: disparities of Middlebury have 1/255 there, and are what they are.
        let (planes, unused) = parse(&[of("Pf 3 2 -0.003922\n", &little), vec![0; 3]].concat()).unwrap();
        assert_eq!((planes, unused.len()), (vec![gray], 2));
        assert!(unused[0].contains("0.003922") && unused[1].contains("3 bytes"), "{unused:?}");
    }

    #[test]
    fn what_is_no_map_is_refused() {
        for (bytes, word) in [
            (&b""[..], "no portable float map"),
            (b"Pf\n3 2\n", "scale"),
            (b"Pf\n3 2\n0\n", "scale 0"),
            (b"Pf\n0 2\n1\n", "0 × 2"),
            (b"Pf\n3 2\n-1\n1234", "truncated"),
            (b"Pf\n1e6 1e6\n-1\n1234", "truncated"),
        ] {
            let message = parse(bytes).unwrap_err();
            assert!(message.contains(word), "{message}");
        }
    }
}
