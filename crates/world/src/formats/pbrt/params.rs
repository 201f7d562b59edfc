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

    /// Returns the parameter of a name, unless its values aren't those of its type.
    pub(super) fn find(&self, name: &str) -> Option<&Param<'a>> {
        let param = self.0.iter().find(|param| param.name == name && param.is_sound())?;
        param.is_used.set(true);
        Some(param)
    }

    /// Returns the first parameter of these names.
    pub(super) fn find_any(&self, names: &[&str]) -> Option<&Param<'a>> {
        names.iter().find_map(|name| self.find(name))
    }

    pub(super) fn numbers(&self, name: &str) -> Option<&[f64]> {
        self.values(name, |param| (!param.numbers.is_empty()).then_some(param.numbers.as_slice()))
    }

    pub(super) fn number(&self, name: &str) -> Option<f64> {
        self.values(name, |param| if let [number] = *param.numbers { Some(number) } else { None })
    }

    pub(super) fn number_of(&self, names: &[&str]) -> Option<f64> {
        names.iter().find_map(|name| self.number(name))
    }

    /// Returns a number of a name from `least` to `most`.
    pub(super) fn within(&self, name: &str, [least, most]: [f64; 2]) -> Option<f64> {
        self.values(name, |param| match *param.numbers {
            [number] if (least..=most).contains(&number) => Some(number),
            _ => None,
        })
    }

    pub(super) fn text(&self, name: &str) -> Option<&'a str> {
        self.values(name, |param| if let [text] = *param.texts { Some(text) } else { None })
    }

    /// Returns the place of a name's text in a list, without regard to case.
    pub(super) fn choice(&self, name: &str, of: &[&str]) -> Option<usize> {
        self.values(name, |param| {
            let [text] = *param.texts else { return None };
            of.iter().position(|word| word.eq_ignore_ascii_case(text))
        })
    }

    pub(super) fn flag(&self, name: &str) -> Option<bool> {
        self.values(name, |param| match (&*param.texts, &*param.numbers) {
            (&["true"], []) | ([], &[1.0]) => Some(true),
            (&["false"], []) | ([], &[0.0]) => Some(false),
            _ => None,
        })
    }

    /// Returns so many numbers of a name.
    pub(super) fn exactly<const N: usize>(&self, name: &str) -> Option<[f64; N]> {
        self.values(name, |param| param.numbers.as_slice().try_into().ok())
    }

    /// Returns what is made of a parameter's values; one that they don't fit counts as not asked for, and its default stands.
    fn values<'p, T>(&'p self, name: &str, of: impl FnOnce(&'p Param<'a>) -> Option<T>) -> Option<T> {
        let param = self.find(name)?;
        let values = of(param);
        param.is_used.set(values.is_some());
        values
    }

    /// The names of the parameters that nobody asked for.
    pub(super) fn unused(&self) -> Vec<&'a str> {
        self.0.iter().filter(|param| !param.is_used.get()).map(|param| param.name).collect()
    }
}

impl Param<'_> {
    /// Whether its type is one of pbrt's, and its values are of that.
    fn is_sound(&self) -> bool {
        let (has_numbers, has_texts) = (!self.numbers.is_empty(), !self.texts.is_empty());
        match self.kind {
            "integer" | "float" | "point" | "point2" | "point3" | "vector" | "vector2" | "vector3" | "normal"
            | "normal3" | "rgb" | "color" | "xyz" => has_numbers && !has_texts,
            "blackbody" | "spectrum" => has_numbers != has_texts,
            "string" | "texture" => has_texts && !has_numbers,
            "bool" => has_texts != has_numbers,
            _ => false,
        }
    }
}
