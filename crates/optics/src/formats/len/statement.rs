//! The statements of an OSLO file.

use super::super::text_error::TextError;

/// A word and what follows it.
pub(super) struct Statement {
    pub(super) line: usize,
    pub(super) keyword: String,
    pub(super) words: Vec<String>,
}

/// Returns the statements of a file, several of which may stand on a line with `;` between them; `//` begins a comment.
pub(super) fn statements_of(text: &str) -> Result<Vec<Statement>, TextError> {
    let mut statements = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let (mut words, mut word) = (Vec::new(), String::new());
        let (mut is_quoted, mut is_escaped) = (false, false);
        let mut signs = line.chars().peekable();
        while let Some(sign) = signs.next() {
            match sign {
                _ if is_escaped => {
                    word.push(sign);
                    is_escaped = false;
                }
                '\\' if is_quoted => is_escaped = true,
                '"' => {
                    if is_quoted || !word.is_empty() {
                        words.push(std::mem::take(&mut word));
                    }
                    is_quoted = !is_quoted;
                }
                _ if is_quoted => word.push(sign),
                '/' if signs.peek() == Some(&'/') => break,
                ';' => {
                    finish(&mut statements, number + 1, &mut words, &mut word);
                }
                _ if sign.is_whitespace() => push(&mut words, &mut word),
                _ => word.push(sign),
            }
        }
        if is_quoted {
            return Err(TextError { line: Some(number + 1), reason: "a text in quotes does not end".to_owned() });
        }
        finish(&mut statements, number + 1, &mut words, &mut word);
    }
    Ok(statements)
}

fn push(words: &mut Vec<String>, word: &mut String) {
    if !word.is_empty() {
        words.push(std::mem::take(word));
    }
}

fn finish(statements: &mut Vec<Statement>, line: usize, words: &mut Vec<String>, word: &mut String) {
    push(words, word);
    let mut words = std::mem::take(words).into_iter();
    if let Some(keyword) = words.next() {
        statements.push(Statement { line, keyword: keyword.to_uppercase(), words: words.collect() });
    }
}

impl Statement {
    pub(super) fn wrong(&self, reason: impl std::fmt::Display) -> TextError {
        TextError { line: Some(self.line), reason: format!("{}: {reason}", self.keyword) }
    }

    /// Returns the word at a place behind the first; none is empty.
    pub(super) fn word(&self, place: usize) -> &str {
        self.words.get(place).map_or("", String::as_str)
    }

    pub(super) fn number(&self, place: usize) -> Result<f64, TextError> {
        let Some(word) = self.words.get(place) else {
            return Err(self.wrong(format!("expected {} words behind it, found {}", place + 1, self.words.len())));
        };
        match word.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            _ => Err(self.wrong(format!("'{word}' is not a number"))),
        }
    }

    pub(super) fn number_or(&self, place: usize, otherwise: f64) -> Result<f64, TextError> {
        if place < self.words.len() { self.number(place) } else { Ok(otherwise) }
    }

    pub(super) fn count(&self, place: usize) -> Result<usize, TextError> {
        let found = self.number(place)?;
        match (0.0..=1e6).contains(&found) && found.fract() == 0.0 {
            true => Ok(found as usize),
            false => Err(self.wrong(format!("{found} is not a whole number"))),
        }
    }

    pub(super) fn numbers(&self) -> Result<Vec<f64>, TextError> {
        (0..self.words.len()).map(|place| self.number(place)).collect()
    }

    /// Returns the list and the number of a word as `WV2` or `WW2`.
    pub(super) fn of_wavelength(&self) -> Option<(&str, usize)> {
        let (list, digits) = self.keyword.split_at_checked(2)?;
        let number = digits.parse().ok().filter(|number| (1..=100).contains(number))?;
        matches!(list, "WV" | "WW").then_some((list, number))
    }
}
