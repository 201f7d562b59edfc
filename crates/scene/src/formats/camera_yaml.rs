//! Objects of camera data in YAML, and in the XML of `OpenCV`.

use saphyr_parser::{Event, Parser, ScalarStyle, ScanError, StrInput};
use serde_json::{Map, Value};

use super::{stated::short, unusable::TRUNCATED};

/// Lists and objects within each other.
const MOST_DEEP: usize = 16;

/// Returns the object that a YAML file is.
///
/// # Errors
/// When it is none, has several, or a key stands twice.
pub(super) fn of_yaml(text: &str) -> Result<Value, String> {
    // OpenCV writes the version without a gap.
    let text = match text.split_once('\n') {
        Some((head, rest)) if head.starts_with("%YAML:") => rest,
        _ => text,
    };
    let mut parser = Parser::new_from_str(text);
    let mut object = None;
    loop {
        match next(&mut parser)? {
            Event::StreamEnd => return object.ok_or_else(|| "it has no key: value".to_owned()),
            Event::StreamStart | Event::DocumentStart(_) | Event::DocumentEnd => {}
            event => match value_of(&mut parser, event, 0)? {
                // Behind the last line of dashes.
                Value::Null => {}
                _ if object.is_some() => return Err("it has several documents (---): expected one".to_owned()),
                own => object = Some(own),
            },
        }
    }
}

fn next<'a>(parser: &mut Parser<'a, StrInput<'a>>) -> Result<Event<'a>, String> {
    let wrong = |error: ScanError| {
        let (line, column) = (error.marker().line(), error.marker().col() + 1);
        format!("line {line}, column {column}: it is no YAML: {}", short(error.info()))
    };
    parser.next_event().map_or(Ok(Event::StreamEnd), |event| event.map(|(event, _)| event).map_err(wrong))
}

/// Returns the value that begins with an event.
fn value_of<'a>(parser: &mut Parser<'a, StrInput<'a>>, event: Event<'a>, depth: usize) -> Result<Value, String> {
    if depth > MOST_DEEP {
        return Err(format!("its lists lie more than {MOST_DEEP} within each other"));
    }
    match event {
        Event::Scalar(text, ScalarStyle::Plain, ..) => Ok(plain(&text)),
        Event::Scalar(text, ..) => Ok(text.into_owned().into()),
        Event::SequenceStart(..) => {
            let mut items = vec![];
            loop {
                match next(parser)? {
                    Event::SequenceEnd => return Ok(items.into()),
                    event => items.push(value_of(parser, event, depth + 1)?),
                }
            }
        }
        Event::MappingStart(..) => {
            let mut entries = Map::new();
            loop {
                let key = match next(parser)? {
                    Event::MappingEnd => return Ok(entries.into()),
                    Event::Scalar(key, ..) => key.into_owned(),
                    _ => return Err("a key of it is no text".to_owned()),
                };
                let event = next(parser)?;
                put(&mut entries, key, value_of(parser, event, depth + 1)?)?;
            }
        }
        Event::Alias(_) => Err("it has an alias (*): expected each value where it belongs".to_owned()),
        _ => Err(TRUNCATED.to_owned()),
    }
}

/// Returns what a text without quotes is: a number, true or false, nothing, or a text.
fn plain(text: &str) -> Value {
    match (text, text.parse::<f64>().ok().filter(|number| number.is_finite())) {
        ("" | "~" | "null", _) => Value::Null,
        ("true" | "false", _) => (text == "true").into(),
        (_, Some(number)) => number.into(),
        _ => text.into(),
    }
}

/// Puts a value under a key that may stand once.
fn put(entries: &mut Map<String, Value>, key: String, value: Value) -> Result<(), String> {
    if entries.contains_key(&key) {
        return Err(format!("the key '{}' stands twice: expected it once", short(&key)));
    }
    entries.insert(key, value);
    Ok(())
}

/// Returns the object that a file of `OpenCV` in XML is, a matrix as the list of its data.
pub(super) fn of_xml(text: &str) -> Result<Value, String> {
    let (_, inner) = text.split_once("<opencv_storage>").ok_or("it is XML, but none of OpenCV (opencv_storage)")?;
    let (mut rest, _) = inner.split_once("</opencv_storage>").ok_or(TRUNCATED)?;
    let mut entries = Map::new();
    while let Some((_, after)) = rest.split_once('<') {
        if let Some(comment) = after.strip_prefix("!--") {
            rest = comment.split_once("-->").map_or("", |(_, next)| next);
            continue;
        }
        let (head, after) = after.split_once('>').ok_or(TRUNCATED)?;
        let name = head.split([' ', '/', '\n']).next().unwrap_or_default();
        let (body, next) = match after.split_once(&format!("</{name}>")) {
            _ if head.ends_with('/') => ("", after),
            Some(parts) => parts,
            None => return Err(format!("the element '{}' is never closed", short(name))),
        };
        let data = body.split_once("<data>").map(|(_, data)| data.split("</data>").next().unwrap_or_default());
        let value = match data {
            Some(data) => data.split_whitespace().map(plain).collect(),
            None => plain(body.trim().trim_matches('"')),
        };
        put(&mut entries, name.to_owned(), value)?;
        rest = next;
    }
    Ok(entries.into())
}
