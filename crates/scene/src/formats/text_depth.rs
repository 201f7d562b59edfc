//! Depths as text: a row a line, numbers between spaces or commas, as `savetxt` of `NumPy` and spreadsheets write them.

use std::path::Path;

use dioptric_files::text;
use ndarray::Array2;

use super::{
    stated::{Noted, name_of, short},
    unusable::{check_memory, unreadable},
};
use crate::SceneError;

/// Lines of words that a note shows.
const MOST_LINES: usize = 3;

/// Reads a table of numbers; lines that begin with `#` are named.
///
/// # Errors
/// Names the line that is no row of numbers, or is longer or shorter than the first.
pub(super) fn read_text_depth(path: &Path) -> Result<Noted<Array2<f32>>, SceneError> {
    let length = std::fs::metadata(path).map_err(|error| unreadable(path, error))?.len();
    // A number takes two characters at least.
    check_memory(path, length.saturating_mul(4), length)?;
    let text = text::read(path).map_err(|error| unreadable(path, error))?;
    let text = text::with_commas(&text);
    let (table, words) = parse(&text).map_err(|reason| unreadable(path, reason))?;
    let shown: Vec<String> = words.iter().take(MOST_LINES).map(|line| format!("'{}'", short(line))).collect();
    let note = (!words.is_empty())
        .then(|| format!("{}: its {} lines of words, {}, are not used", name_of(path), words.len(), shown.join(", ")));
    Ok(Noted::new(table, note))
}

/// Returns the table of a text, and its lines of words.
fn parse(text: &str) -> Result<(Array2<f32>, Vec<&str>), String> {
    let (mut values, mut words, mut columns, mut rows) = (vec![], vec![], 0, 0);
    for (index, line) in text.lines().map(str::trim).enumerate() {
        if line.is_empty() {
            continue;
        }
        if let Some(comment) = line.strip_prefix('#') {
            words.push(comment.trim());
            continue;
        }
        let before = values.len();
        for word in line.split([' ', '\t', ',', ';']).filter(|word| !word.is_empty()) {
            let number = word.parse::<f32>();
            values.push(number.map_err(|_| {
                format!("line {}: '{}' is no number, expected depths, a row a line", index + 1, short(word))
            })?);
        }
        let found = values.len() - before;
        if rows == 0 {
            columns = found;
        }
        if found != columns {
            return Err(format!("line {}: {found} numbers, expected {columns}, as in the first row", index + 1));
        }
        rows += 1;
    }
    let table = Array2::from_shape_vec((rows, columns), values).map_err(|error| error.to_string())?;
    if table.is_empty() {
        Err("it has no numbers, expected depths, a row a line".to_owned())
    } else {
        Ok((table, words))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_of_text_are_read() {
        let expected = ndarray::arr2(&[[1.5, 2.0], [3.0, f32::INFINITY]]);
        for text in ["1.5 2\n3 inf\n", "1.5,2\r\n3,inf", "  1.5\t 2e0 \n\n 3 ; inf"] {
            assert_eq!(parse(text).unwrap(), (expected.clone(), vec![]), "{text}");
        }
        assert_eq!(parse("# depths, mm\n1 2\n").unwrap().1, ["depths, mm"]);
        for (text, word) in [
            ("", "no numbers"),
            ("1 2\n3", "line 2: 1 numbers"),
            ("ncols 4\n", "line 1: 'ncols'"),
            ("1 2\n# x\n3 q", "line 3"),
        ] {
            assert!(parse(text).unwrap_err().contains(word), "{text}");
        }
    }
}
