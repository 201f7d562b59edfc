//! The parameters of a pbrt directive.

use std::cell::Cell;

use super::tokens::{Token, Tokens};

/// The parameters that follow a directive.
#[derive(Debug, Default)]
pub(super) struct Params<'a>(Vec<Param<'a>>);

/// One parameter: `"float radius" [1]`.
#[derive(Debug)]
pub(super) struct Param<'a> {
    pub(super) kind: &'a str,
    pub(super) name: &'a str,
    pub(super) numbers: Vec<f64>,
    pub(super) texts: Vec<&'a str>,
    /// Whether a reader asked for it.
    is_used: Cell<bool>,
}

impl<'a> Params<'a> {
    /// Reads parameters up to the next directive.
    pub(super) fn read(tokens: &mut Tokens<'a>) -> Result<Self, String> {
        let mut params = Vec::new();
        while let Some(Token::Text(declaration)) = tokens.peek()? {
            tokens.next()?;
            let mut words = declaration.split_ascii_whitespace();
            let (Some(kind), Some(name), None) = (words.next(), words.next(), words.next()) else {
                return Err(format!("the parameter \"{declaration}\": expected \"type name\""));
            };
            let mut param = Param { kind, name, numbers: Vec::new(), texts: Vec::new(), is_used: Cell::new(false) };
            let mut is_list = false;
            loop {
                match tokens.next()? {
                    Some((Token::Open, _)) if !is_list => {
                        is_list = true;
                        continue;
                    }
                    Some((Token::Close, _)) if is_list => break,
                    Some((Token::Number(number), _)) => param.numbers.push(number),
                    Some((Token::Text(text), _)) => param.texts.push(text),
                    Some((Token::Word(word @ ("true" | "false")), _)) => param.texts.push(word),
                    Some((token, _)) => {
                        return Err(format!("the parameter \"{declaration}\": {token:?} among its values"));
                    }
                    None => return Err(format!("the parameter \"{declaration}\": the file ends before its value")),
                }
                if !is_list {
                    break;
                }
            }
            params.push(param);
        }
        Ok(Self(params))
    }

    /// Returns the parameter of a name.
    pub(super) fn find(&self, name: &str) -> Option<&Param<'a>> {
        let param = self.0.iter().find(|param| param.name == name)?;
        param.is_used.set(true);
        Some(param)
    }

    /// Returns the first parameter of these names.
    pub(super) fn find_any(&self, names: &[&str]) -> Option<&Param<'a>> {
        names.iter().find_map(|name| self.find(name))
    }

    pub(super) fn numbers(&self, name: &str) -> Option<&[f64]> {
        self.find(name).map(|param| param.numbers.as_slice()).filter(|numbers| !numbers.is_empty())
    }

    pub(super) fn number(&self, name: &str) -> Option<f64> {
        self.numbers(name).map(|numbers| numbers[0])
    }

    pub(super) fn number_of(&self, names: &[&str]) -> Option<f64> {
        names.iter().find_map(|name| self.number(name))
    }

    pub(super) fn text(&self, name: &str) -> Option<&'a str> {
        self.find(name)?.texts.first().copied()
    }

    pub(super) fn flag(&self, name: &str) -> Option<bool> {
        let param = self.find(name)?;
        match (param.texts.first(), param.numbers.first()) {
            (Some(text), _) => Some(*text == "true"),
            (None, Some(number)) => Some(*number != 0.0),
            (None, None) => None,
        }
    }

    /// Returns three numbers of a name.
    pub(super) fn three(&self, name: &str) -> Option<[f64; 3]> {
        self.numbers(name)?.get(..3)?.try_into().ok()
    }

    /// The names of the parameters that nobody asked for.
    pub(super) fn unused(&self) -> Vec<&'a str> {
        self.0.iter().filter(|param| !param.is_used.get()).map(|param| param.name).collect()
    }
}
