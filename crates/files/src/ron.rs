//! Values as RON text, and what is wrong with such a text.

use ron::{
    Options,
    error::{Position, SpannedError},
    extensions::Extensions,
};
use serde::de::DeserializeOwned;

/// A text that does not hold what was expected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("line {line}, column {column}: {reason}")]
pub struct RonError {
    /// The line, from 1.
    pub line: usize,
    /// The column of the line, from 1.
    pub column: usize,
    /// What is wrong: the key, what was expected and what stands there.
    pub reason: String,
    /// The word of a choice whose values are missing or are no values.
    pub choice: Option<String>,
}

/// Returns what a text holds; optional values stand without `Some`.
///
/// # Errors
/// Names the place, the key and what stands there.
pub fn from_text<T: DeserializeOwned>(text: &str) -> Result<T, RonError> {
    let options = Options::default().with_default_extension(Extensions::IMPLICIT_SOME);
    options.from_str(text).map_err(|error| RonError::of(text, &error))
}

impl RonError {
    fn of(text: &str, error: &SpannedError) -> Self {
        let Position { line, col: column } = error.span.start;
        let (reason, choice) = reason(text, error);
        Self { line, column, reason, choice }
    }
}

fn is_of_word(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}

fn is_of_number(c: char) -> bool {
    is_of_word(c) || matches!(c, '-' | '+' | '.')
}

/// Returns the number before a comma behind which digits stand as no field of a struct does.
fn with_decimal_comma<'a>(before: &'a str, found: &str) -> Option<&'a str> {
    let number = before.trim_end().strip_suffix(',')?;
    let is_digit = |c: char| c.is_ascii_digit();
    (number.ends_with(is_digit) && found.starts_with(is_digit)).then_some(number)
}

/// Returns what is wrong, after which key, and what stands there; and the word of a choice whose values have not begun well.
fn reason(text: &str, error: &SpannedError) -> (String, Option<String>) {
    let Position { line, col } = error.span.start;
    let from: usize = text.split_inclusive('\n').take(line.saturating_sub(1)).map(str::len).sum();
    let of_line = &text[from..];
    let (before, found) =
        text.split_at(from + of_line.char_indices().nth(col.saturating_sub(1)).map_or(of_line.len(), |(at, _)| at));
    let found = found.lines().next().unwrap_or_default();
    let comma = with_decimal_comma(before, found);
    let head = comma.unwrap_or(before).trim_end().trim_end_matches('(').trim_end();
    let head = head.strip_suffix(':').or_else(|| head.trim_end_matches(is_of_number).trim_end().strip_suffix(':'));
    let key = head.map(|head| head.rsplit(|c| !is_of_word(c)).next().unwrap_or_default());
    let Some(key) = key.filter(|key| !key.is_empty()) else { return (error.code.to_string(), None) };
    if let Some(number) = comma {
        let number = number.rsplit(|c| !is_of_number(c)).next().unwrap_or_default();
        let digits = &found[..found.find(|c: char| !is_of_number(c)).unwrap_or(found.len())];
        return (format!("{key}: expected a point within a number, found {number},{digits}"), None);
    }
    let end = match found.strip_prefix('"') {
        Some(within) => within.find('"').map(|end| end + 2),
        None => found.find([',', ')', ']', '}']),
    };
    let found: String = found[..end.unwrap_or(found.len())].chars().take(24).collect();
    let word = before.trim_end().trim_end_matches('(').rsplit(|c| !is_of_word(c)).next().unwrap_or_default();
    let (remedy, choice) = match error.code {
        ron::Error::ExpectedIdentifier if found.starts_with('"') => (": words of choices stand without quotes", None),
        ron::Error::ExpectedIdentifier
        | ron::Error::SuggestRawIdentifier(_)
        | ron::Error::ExpectedStructLike
        | ron::Error::ExpectedNamedStructLike(_) => ("", Some(word.to_owned())),
        _ => ("", None),
    };
    let found = if found.trim().is_empty() { String::new() } else { format!(", found {}", found.trim()) };
    (format!("{key}: {}{found}{remedy}", error.code), choice)
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::*;

    #[derive(Debug, Deserialize)]
    #[expect(dead_code, reason = "read alone")]
    struct Lens {
        name: String,
        radius_mm: Option<f64>,
        count: Option<u32>,
    }

    #[test]
    fn a_text_on_one_line_names_its_column_and_key() {
        assert!(from_text::<Lens>("(name: \"a\", radius_mm: 3.5)").is_ok());
        let error = from_text::<Lens>("(name: \"a\", radius_mm: big, more: 1)").unwrap_err();
        assert_eq!((error.line, error.column), (1, 23));
        assert_eq!(error.reason, "radius_mm: Expected float, found big");
        for (wrong, reason) in [
            ("(name: \"a\", radius_mm: -50,25)", "radius_mm: expected a point within a number, found -50,25"),
            ("(name: \"a\", count: -3)", "count: Integer is out of bounds"),
        ] {
            let error = from_text::<Lens>(wrong).unwrap_err();
            assert!(error.reason.starts_with(reason), "{error}");
        }
        for cut in ["", "(", "(name", "(name:", "(name: \"é\", radius_mm:", "(name: \"a"] {
            assert!(!from_text::<Lens>(cut).unwrap_err().to_string().contains('\n'), "{cut}");
        }
    }
}
