//! JSON values by their place in the file, so that a mistake is reported by its key.

use serde_json::{Map, Value};

use super::text_error::TextError;

/// A JSON object and where it stands, as `surfaces[3]`.
pub(super) struct Object<'a> {
    map: &'a Map<String, Value>,
    place: String,
}

/// Returns the error of a value that is not what it should be.
pub(super) fn wrong(place: &str, found: &Value, expected: &str) -> TextError {
    let mut found = found.to_string();
    if let Some((end, _)) = found.char_indices().nth(40) {
        found.truncate(end);
        found.push('…');
    }
    TextError { line: None, reason: format!("{place} is {found}, expected {expected}") }
}

/// Returns the finite number in a value.
pub(super) fn number(value: &Value, place: &str) -> Result<f64, TextError> {
    value.as_f64().filter(|number| number.is_finite()).ok_or_else(|| wrong(place, value, "a number"))
}

/// Returns the finite numbers in a list.
pub(super) fn numbers(value: &Value, place: &str) -> Result<Vec<f64>, TextError> {
    let list = value.as_array().ok_or_else(|| wrong(place, value, "a list of numbers"))?;
    list.iter().enumerate().map(|(i, value)| number(value, &format!("{place}[{i}]"))).collect()
}

impl<'a> Object<'a> {
    pub(super) fn new(value: &'a Value, place: impl Into<String>) -> Result<Self, TextError> {
        let place = place.into();
        match value.as_object() {
            Some(map) => Ok(Self { map, place }),
            None => Err(wrong(if place.is_empty() { "the file" } else { &place }, value, "an object {…}")),
        }
    }

    /// Where a key of this object stands.
    pub(super) fn place(&self, key: &str) -> String {
        if self.place.is_empty() { key.to_owned() } else { format!("{}.{key}", self.place) }
    }

    /// Returns the value of a key, and nothing for `null`.
    pub(super) fn get(&self, key: &str) -> Option<&'a Value> {
        self.map.get(key).filter(|value| !value.is_null())
    }

    /// Whether a key is there, be it `null`.
    pub(super) fn has(&self, key: &str) -> bool {
        self.map.contains_key(key)
    }

    pub(super) fn keys(&self) -> impl Iterator<Item = &'a String> {
        self.map.keys()
    }

    /// Returns the value of a key that must be there.
    pub(super) fn required(&self, key: &str, expected: &str) -> Result<&'a Value, TextError> {
        self.get(key).ok_or_else(|| TextError {
            line: None,
            reason: format!("{} is missing, expected {expected}", self.place(key)),
        })
    }

    pub(super) fn number(&self, key: &str) -> Result<f64, TextError> {
        number(self.required(key, "a number")?, &self.place(key))
    }

    /// Returns the number of a key, or a default where the key is absent or `null`.
    pub(super) fn number_or(&self, key: &str, default: f64) -> Result<f64, TextError> {
        self.get(key).map_or(Ok(default), |value| number(value, &self.place(key)))
    }

    pub(super) fn text(&self, key: &str) -> Option<&'a str> {
        self.get(key).and_then(Value::as_str).map(str::trim).filter(|text| !text.is_empty())
    }

    /// Returns the objects of a list that must be there and not be empty.
    pub(super) fn objects(&self, key: &str) -> Result<Vec<Self>, TextError> {
        let value = self.required(key, "a list of objects")?;
        let list = value.as_array().filter(|list| !list.is_empty());
        let list = list.ok_or_else(|| wrong(&self.place(key), value, "a list of objects"))?;
        list.iter().enumerate().map(|(i, value)| Self::new(value, format!("{}[{i}]", self.place(key)))).collect()
    }
}
