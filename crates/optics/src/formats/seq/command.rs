//! The commands of a CODE V file.

use super::super::text_error::TextError;

/// A command and what follows it.
#[derive(Clone)]
pub(super) struct Command {
    pub(super) line: usize,
    pub(super) words: Vec<String>,
}

/// Returns the commands of a file: comments gone, continued lines joined, quoted words whole.
pub(super) fn commands_of(text: &str) -> Vec<Command> {
    let mut commands = Vec::new();
    let mut command = Command { line: 1, words: Vec::new() };
    for (number, line) in text.lines().enumerate() {
        let mut word = String::new();
        let (mut quote, mut is_continued) = (None, false);
        for (at, sign) in line.char_indices().chain([(line.len(), '\n')]) {
            match (quote, sign) {
                (Some(mark), sign) if sign == mark || sign == '\n' => {
                    command.words.push(std::mem::take(&mut word));
                    quote = None;
                }
                (Some(_), sign) => word.push(sign),
                (None, '\'' | '"') if word.is_empty() => quote = Some(sign),
                (None, '!') => {
                    push_word(&mut command, &mut word);
                    break;
                }
                (None, '&') if is_last(&line[at + 1..]) => is_continued = true,
                (None, ';') => {
                    push_word(&mut command, &mut word);
                    finish(&mut commands, &mut command, number + 1);
                }
                (None, sign) if sign.is_whitespace() => push_word(&mut command, &mut word),
                (None, sign) => word.push(sign),
            }
        }
        push_word(&mut command, &mut word);
        if !is_continued {
            finish(&mut commands, &mut command, number + 2);
        }
    }
    finish(&mut commands, &mut command, 0);
    commands
}

/// Whether no command stands in the rest of a line.
fn is_last(rest: &str) -> bool {
    let rest = rest.trim_start();
    rest.is_empty() || rest.starts_with('!')
}

fn push_word(command: &mut Command, word: &mut String) {
    if !word.is_empty() {
        command.words.push(std::mem::take(word));
    }
}

fn finish(commands: &mut Vec<Command>, command: &mut Command, next_line: usize) {
    let done = std::mem::replace(command, Command { line: next_line, words: Vec::new() });
    if !done.words.is_empty() {
        commands.push(done);
    }
}

impl Command {
    pub(super) fn wrong(&self, reason: impl std::fmt::Display) -> TextError {
        TextError { line: Some(self.line), reason: format!("{}: {reason}", self.words[0]) }
    }

    pub(super) fn number(&self, place: usize) -> Result<f64, TextError> {
        let Some(word) = self.words.get(place) else {
            return Err(self.wrong(format!("expected {place} numbers, found {}", self.words.len() - 1)));
        };
        match word.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            _ => Err(self.wrong(format!("'{word}' is not a number"))),
        }
    }

    /// Returns the command without the labels of apertures, as `L'A'`.
    pub(super) fn without_labels(&self) -> Self {
        let is_label = |word: &str| word.strip_prefix(['L', 'l']).is_some_and(|rest| rest.starts_with(['\'', '"']));
        Self { line: self.line, words: self.words.iter().filter(|word| !is_label(word)).cloned().collect() }
    }

    /// Returns a distance, which may be infinite.
    pub(super) fn distance(&self, place: usize) -> Result<f64, TextError> {
        match self.words.get(place).map(|word| word.to_uppercase()).as_deref() {
            Some("INF" | "INFINITY") => Ok(f64::INFINITY),
            _ => self.number(place),
        }
    }

    pub(super) fn numbers(&self) -> Result<Vec<f64>, TextError> {
        (1..self.words.len()).map(|place| self.number(place)).collect()
    }
}
