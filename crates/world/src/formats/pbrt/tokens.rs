//! The words of a pbrt file.

/// A word of a pbrt file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Token<'a> {
    /// A directive, or `true` and `false`.
    Word(&'a str),
    /// What stands between quotes.
    Text(&'a str),
    Number(f64),
    Open,
    Close,
}

/// Takes a text apart; what follows # on a line is left out.
pub(super) struct Tokens<'a> {
    text: &'a str,
    at: usize,
    line: usize,
    peeked: Option<(Token<'a>, usize)>,
    object_name: Option<&'a str>,
}

impl<'a> Tokens<'a> {
    pub(super) fn new(text: &'a str) -> Self {
        Self { text, at: 0, line: 1, peeked: None, object_name: None }
    }

    /// The line that the next token is looked for on, from 1.
    pub(super) fn line(&self) -> usize {
        self.peeked.map_or(self.line, |(_, line)| line)
    }

    /// Returns the name that a comment of ISET's gave what follows, `#ObjectName chair:...`, once.
    pub(super) fn take_object_name(&mut self) -> Option<&'a str> {
        self.object_name.take().filter(|name| !name.is_empty())
    }

    /// Returns the next token and the line that it stands on; `None` at the end.
    pub(super) fn next(&mut self) -> Result<Option<(Token<'a>, usize)>, String> {
        match self.peeked.take() {
            Some(peeked) => Ok(Some(peeked)),
            None => self.read(),
        }
    }

    /// Returns the next token without taking it.
    pub(super) fn peek(&mut self) -> Result<Option<Token<'a>>, String> {
        if self.peeked.is_none() {
            self.peeked = self.read()?;
        }
        Ok(self.peeked.map(|(token, _)| token))
    }

    fn read(&mut self) -> Result<Option<(Token<'a>, usize)>, String> {
        let bytes = self.text.as_bytes();
        while let Some(&byte) = bytes.get(self.at) {
            match byte {
                b'\n' => self.line += 1,
                b'#' => {
                    let line = self.text[self.at + 1..].lines().next().unwrap_or("").trim_start();
                    if let Some(name) = line.strip_prefix("ObjectName") {
                        self.object_name = name.trim().split(':').next();
                    }
                    self.at += bytes[self.at..].iter().position(|b| *b == b'\n').unwrap_or(bytes.len() - self.at);
                    continue;
                }
                byte if byte.is_ascii_whitespace() => {}
                _ => break,
            }
            self.at += 1;
        }
        let (start, line) = (self.at, self.line);
        let token = match bytes.get(start) {
            None => return Ok(None),
            Some(b'[') => Token::Open,
            Some(b']') => Token::Close,
            Some(b'"') => {
                let inside = &bytes[start + 1..];
                let n = inside.iter().position(|b| *b == b'"' || *b == b'\n').filter(|n| inside[*n] == b'"');
                let Some(n) = n else { return Err("a quoted text that doesn't end on its line".to_owned()) };
                self.at = start + n + 2;
                return Ok(Some((Token::Text(&self.text[start + 1..start + 1 + n]), line)));
            }
            Some(_) => {
                let is_end = |b: &u8| b.is_ascii_whitespace() || matches!(b, b'"' | b'[' | b']' | b'#');
                let n = bytes[start..].iter().position(is_end).unwrap_or(bytes.len() - start);
                self.at = start + n;
                let word = &self.text[start..start + n];
                return Ok(Some((word_or_number(word)?, line)));
            }
        };
        self.at += 1;
        Ok(Some((token, line)))
    }
}

fn word_or_number(word: &str) -> Result<Token<'_>, String> {
    let is_number = word.starts_with(|c: char| c.is_ascii_digit() || matches!(c, '-' | '+' | '.'));
    if !is_number {
        return Ok(Token::Word(word));
    }
    match word.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(Token::Number(number)),
        _ => Err(format!("'{word}' is not a finite number")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_taken_apart() {
        let mut tokens = Tokens::new("Shape \"sphere\" # round\n  \"float radius\"[1.5 -2e-3]true");
        let mut found = Vec::new();
        while let Some(token) = tokens.next().unwrap() {
            found.push(token);
        }
        let expected = [
            (Token::Word("Shape"), 1),
            (Token::Text("sphere"), 1),
            (Token::Text("float radius"), 2),
            (Token::Open, 2),
            (Token::Number(1.5), 2),
            (Token::Number(-2e-3), 2),
            (Token::Close, 2),
            (Token::Word("true"), 2),
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn wrong_words_are_refused() {
        assert!(Tokens::new("\"open").next().unwrap_err().contains("quoted"));
        assert!(Tokens::new("1e999").next().unwrap_err().contains("1e999"));
        assert!(Tokens::new("1.2.3").next().unwrap_err().contains("1.2.3"));
    }
}
