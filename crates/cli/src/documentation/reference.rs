//! The pages of the book that list every key of camera and sensor files, made from their schemas.

use std::{collections::BTreeSet, env, fmt::Write, fs, path::Path};

use dioptric_pipeline::{CAMERA_SCHEMA, Camera, SENSOR_SCHEMA};
use serde_json::{Map, Value};

use super::root;

/// The start of a page: what it is about.
const CAMERA: &str = "\
# Camera files: every key

One camera file is one RON record: everything about a shot. `dioptric camera init -o camera.ron` writes one with every key, its
default and its choices; `dioptric camera check FILE` reads it without taking the picture; `dioptric camera schema` prints the JSON
schema that this page is made from. Keys without a default must be given. Paths are relative to the file.";
const SENSOR: &str = "\
# Sensor files: every key

A sensor file is the data sheet of a sensor as one RON record. `dioptric sensor init NAME -o sensor.ron` writes that of a built-in
sensor to begin with, `dioptric sensor schema` prints the JSON schema that this page is made from. Keys without a default must be
given.";

#[test]
fn reference_pages_are_those_of_the_schemas() {
    for (name, start, schema) in [("camera-file.md", CAMERA, CAMERA_SCHEMA), ("sensor-file.md", SENSOR, SENSOR_SCHEMA)]
    {
        let path = root().join("docs/book/src/reference").join(name);
        let page = page(start, &serde_json::from_str(schema).unwrap());
        if env::var_os("UPDATE_GOLDEN").is_some() {
            fs::write(&path, &page).unwrap();
        }
        let kept = fs::read_to_string(&path).unwrap_or_default();
        assert!(kept == page, "{name} is stale: run `UPDATE_GOLDEN=1 cargo test -p dioptric reference`");
    }
}

/// Returns the page of a schema: the keys of the file, then every type that they lead to, in the order they are met.
fn page(start: &str, schema: &Value) -> String {
    let mut text = format!("{start}\n\n## The file\n\n");
    let (mut waiting, mut seen) = (Vec::new(), BTreeSet::new());
    let defs = &schema["$defs"];
    text += &fields(schema, defs, &mut waiting);
    while !waiting.is_empty() {
        for name in std::mem::take(&mut waiting) {
            if seen.insert(name.clone()) {
                let definition = &defs[&name];
                let _ = writeln!(text, "\n## {name}\n\n{}\n", whole(definition));
                text += &body(definition, defs, &mut waiting);
            }
        }
    }
    text
}

/// What stands below the heading of a type: its keys, or its variants.
fn body(schema: &Value, defs: &Value, names: &mut Vec<String>) -> String {
    let variants = variants(schema);
    if variants.is_empty() {
        return match schema.get("properties") {
            Some(_) => fields(schema, defs, names),
            None => format!("As {}.\n", word(schema, names)),
        };
    }
    let mut text = "| one of | |\n|---|---|\n".to_owned();
    for (form, what) in variants.iter().flat_map(|variant| forms(variant, defs, names)) {
        let _ = writeln!(text, "| {form} | {what} |");
    }
    text
}

fn variants(schema: &Value) -> Vec<&Value> {
    match (schema["oneOf"].as_array(), schema["enum"].as_array()) {
        (Some(list), _) => list.iter().collect(),
        (None, Some(_)) => vec![schema],
        (None, None) => Vec::new(),
    }
}

/// Returns how a variant is written, and what it is.
fn forms(variant: &Value, defs: &Value, names: &mut Vec<String>) -> Vec<(String, String)> {
    if let Some(name) = variant["const"].as_str() {
        return vec![(format!("`{name}`"), short(variant))];
    }
    if let Some(list) = variant["enum"].as_array() {
        return list.iter().filter_map(Value::as_str).map(|name| (format!("`{name}`"), String::new())).collect();
    }
    let empty = Map::new();
    let payloads = variant["properties"].as_object().unwrap_or(&empty);
    let mut forms = Vec::new();
    for (name, payload) in payloads {
        let mut what = short(variant);
        let form = match payload["properties"].as_object() {
            // The record's keys, each with what it is.
            Some(keys) => {
                let required = required(payload);
                for (key, field) in ordered(keys, &required) {
                    let default =
                        default_of(field, defs).map(|value| format!(", {value} if left out")).unwrap_or_default();
                    let _ = write!(what, "<br>`{key}` ({}{default}): {}", word(field, names), short(field));
                }
                format!("`{name}({})`", required.iter().map(|key| format!("{key}: …")).collect::<Vec<_>>().join(", "))
            }
            None if is_record(payload, defs) => format!("`{name}((…))` of {}", word(payload, names)),
            None => format!("`{name}(…)` of {}", word(payload, names)),
        };
        forms.push((form, what));
    }
    forms
}

/// Returns the table of a record's keys.
fn fields(schema: &Value, defs: &Value, names: &mut Vec<String>) -> String {
    let mut text = "| key | is | default | |\n|---|---|---|---|\n".to_owned();
    let Some(keys) = schema["properties"].as_object() else { return text };
    for (key, field) in ordered(keys, &required(schema)) {
        let default = default_of(field, defs).unwrap_or_default();
        let _ = writeln!(text, "| `{key}` | {} | {default} | {} |", word(field, names), short(field));
    }
    text
}

fn required(schema: &Value) -> Vec<&str> {
    schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str).collect()
}

/// Returns the keys that must be given first, in their own order, then the others by name.
fn ordered<'a>(keys: &'a Map<String, Value>, required: &[&'a str]) -> Vec<(&'a str, &'a Value)> {
    let first = required.iter().filter_map(|key| Some((*key, keys.get(*key)?)));
    let others = keys.iter().filter(|(key, _)| !required.contains(&key.as_str()));
    first.chain(others.map(|(key, field)| (key.as_str(), field))).collect()
}

/// Returns what a value is, and adds the names of the types in it.
fn word(schema: &Value, names: &mut Vec<String>) -> String {
    if let Some(target) = schema["$ref"].as_str() {
        let name = target.trim_start_matches("#/$defs/").to_owned();
        let link = format!("[{name}](#{})", name.to_lowercase());
        names.push(name);
        return link;
    }
    if let Some(choices) = schema["anyOf"].as_array() {
        let some = choices.iter().filter(|choice| choice["type"] != "null").map(|choice| word(choice, names));
        return some.collect::<Vec<_>>().join(" or ");
    }
    let kind = match &schema["type"] {
        Value::Array(kinds) => kinds.iter().filter_map(Value::as_str).find(|kind| *kind != "null"),
        kind => kind.as_str(),
    };
    match kind {
        Some("number") => "number".to_owned(),
        Some("integer") => "whole number".to_owned(),
        Some("string") => "text".to_owned(),
        Some("boolean") => "`true` or `false`".to_owned(),
        Some("array") => match schema["prefixItems"].as_array() {
            Some(items) => format!("({})", items.iter().map(|item| word(item, names)).collect::<Vec<_>>().join(", ")),
            None => format!("list of {}", word(&schema["items"], names)),
        },
        _ => "record".to_owned(),
    }
}

/// Returns a default as a camera file has it, or `None` where there is none.
fn default_of(field: &Value, defs: &Value) -> Option<String> {
    field.get("default").map(|value| format!("`{}`", ron_of(value, field, defs)))
}

/// Returns the definition that a schema stands for, itself if none.
fn resolved<'a>(schema: &'a Value, defs: &'a Value) -> &'a Value {
    let some = |choice: &&Value| choice.get("$ref").is_some();
    let schema = schema["anyOf"].as_array().and_then(|choices| choices.iter().find(some)).unwrap_or(schema);
    schema["$ref"].as_str().map_or(schema, |target| &defs[target.trim_start_matches("#/$defs/")])
}

/// Whether a schema names a type that is a record, which a file writes in parentheses of its own.
fn is_record(schema: &Value, defs: &Value) -> bool {
    schema.get("$ref").is_some() && resolved(schema, defs).get("properties").is_some()
}

/// Returns a value of a type as a file has it.
fn ron_of(value: &Value, schema: &Value, defs: &Value) -> String {
    let schema = resolved(schema, defs);
    match value {
        // JSON has no other word for it.
        Value::Null if schema["type"] == "number" => "inf".to_owned(),
        Value::Null => "None".to_owned(),
        // The names of variants are text in JSON.
        Value::String(name) => name.clone(),
        Value::Array(values) => {
            let all: Vec<_> = values.iter().map(|value| ron_of(value, &schema["items"], defs)).collect();
            match schema.get("prefixItems") {
                Some(_) => format!("({})", all.join(", ")),
                None => format!("[{}]", all.join(", ")),
            }
        }
        Value::Object(keys) => match keys.iter().next() {
            Some((name, payload)) if keys.len() == 1 && name.starts_with(char::is_uppercase) => {
                let variant = variants(schema).into_iter().map(|v| &v["properties"][name]).find(|v| !v.is_null());
                let of = variant.unwrap_or(&Value::Null);
                let text = ron_of(payload, of, defs);
                match text.strip_prefix('(') {
                    // The keys of the variant itself.
                    Some(inner) if !is_record(of, defs) => format!("{name}({inner}"),
                    _ => format!("{name}({text})"),
                }
            }
            _ => {
                let of = |key: &str| &schema["properties"][key];
                let all: Vec<_> =
                    keys.iter().map(|(key, value)| format!("{key}: {}", ron_of(value, of(key), defs))).collect();
                format!("({})", all.join(", "))
            }
        },
        other => other.to_string(),
    }
}

/// Returns a description in one line of a table.
fn short(schema: &Value) -> String {
    whole(schema).split_whitespace().collect::<Vec<_>>().join(" ").replace('|', "\\|")
}

/// Returns a description without links into the documentation of the code.
fn whole(schema: &Value) -> String {
    let text = schema["description"].as_str().unwrap_or_default();
    let mut kept = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once("](") {
        let (label_start, target_end) = (before.rfind('['), after.find(')'));
        let (Some(start), Some(end)) = (label_start, target_end) else { break };
        kept += &before[..start];
        kept += &before[start + 1..];
        rest = &after[end + 1..];
    }
    // What is left of the links is a name alone: [`Name`].
    (kept + rest).replace("[`", "`").replace("`]", "`")
}

/// Each default of the page, written into a camera file, is the default.
#[test]
fn defaults_are_written_as_files_have_them() {
    let schema: Value = serde_json::from_str(CAMERA_SCHEMA).unwrap();
    let start = "name: \"short\", lens: BuiltIn(\"dgauss-50mm\"), focus: NearObject, sensor: BuiltIn(\"imx363\"), \
                 scene: (source: StillLife(columns: 3, rows: 2))";
    let parse = |text: String| Camera::parse(&text, Path::new("short.ron"));
    let short = parse(format!("({start})")).unwrap();
    let keys = schema["properties"].as_object().unwrap();
    let mut n_defaults = 0;
    for (key, field) in keys {
        let Some(default) = default_of(field, &schema["$defs"]) else { continue };
        let camera = parse(format!("({start}, {key}: {})", default.trim_matches('`')));
        assert_eq!(camera.unwrap_or_else(|error| panic!("{key}: {error}")), short, "{key}");
        n_defaults += 1;
    }
    assert_eq!(n_defaults, keys.len() - 5);
}
