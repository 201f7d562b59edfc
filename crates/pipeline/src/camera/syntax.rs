//! What is wrong with the text of a camera file.

use ron::error::Position;
use serde_json::Value;

/// The schema of camera files.
pub const CAMERA_SCHEMA: &str = include_str!("../../data/camera.schema.json");

/// Returns what is wrong with the text of a camera file: after which key, and what stands there.
pub(super) fn reason(text: &str, error: &ron::error::SpannedError) -> String {
    let Position { line, col } = error.span.start;
    let from: usize = text.split_inclusive('\n').take(line.saturating_sub(1)).map(str::len).sum();
    let of_line = &text[from..];
    let (before, found) =
        text.split_at(from + of_line.char_indices().nth(col.saturating_sub(1)).map_or(0, |(at, _)| at));
    let found = found.lines().next().unwrap_or_default();
    let is_of_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    // After a key, or after the word of a choice, whose values have not begun well.
    let head = before.trim_end().trim_end_matches('(').trim_end();
    let head = head.strip_suffix(':').or_else(|| head.trim_end_matches(is_of_word).trim_end().strip_suffix(':'));
    let key = head.map(|head| head.rsplit(|c| !is_of_word(c)).next().unwrap_or_default());
    let Some(key) = key.filter(|key| !key.is_empty()) else { return error.code.to_string() };
    let end = match found.strip_prefix('"') {
        Some(within) => within.find('"').map(|end| end + 2),
        None => found.find([',', ')', ']', '}']),
    };
    let found: String = found[..end.unwrap_or(found.len())].chars().take(24).collect();
    let word = before.trim_end().trim_end_matches('(').rsplit(|c| !is_of_word(c)).next().unwrap_or_default();
    let remedy = match error.code {
        ron::Error::ExpectedIdentifier if found.starts_with('"') => {
            ": words of choices stand without quotes".to_owned()
        }
        ron::Error::ExpectedIdentifier
        | ron::Error::SuggestRawIdentifier(_)
        | ron::Error::ExpectedStructLike
        | ron::Error::ExpectedNamedStructLike(_) => {
            values_of(word).map_or_else(String::new, |values| format!(": {word} takes {values}"))
        }
        _ => String::new(),
    };
    let found = if found.is_empty() { String::new() } else { format!(", found {}", found.trim_end()) };
    format!("{key}: {}{found}{remedy}", error.code)
}

/// Returns the values that the word of a choice takes, as the schema of camera files has them; `None` where words that are alike take others.
fn values_of(word: &str) -> Option<String> {
    let schema: Value = serde_json::from_str(CAMERA_SCHEMA).ok()?;
    let choices = schema["$defs"].as_object()?.values().filter_map(|own| own["oneOf"].as_array()).flatten();
    let mut shapes = choices.filter_map(|choice| choice["properties"].get(word)?["properties"].as_object());
    let shape = shapes.next()?;
    let is_optional = |key: &str| shape[key].get("default").is_some();
    let values =
        shape.keys().map(|key| if is_optional(key) { format!("{key}: … (or none)") } else { format!("{key}: …") });
    let text = format!("values, as {word}({})", values.collect::<Vec<_>>().join(", "));
    shapes.all(|other| other == shape).then_some(text)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::Camera;

    #[test]
    fn what_is_no_word_of_a_choice_is_named_with_its_key() {
        for (reading, expected) in [
            (
                "quantity: \"reflectance\"",
                "quantity: Expected identifier, found \"reflectance\": words of choices stand without quotes",
            ),
            (
                "depth_kind: Disparity",
                "depth_kind: Expected opening `(`: Disparity takes values, as Disparity(baseline_m: …, offset_px: … (or none))",
            ),
            ("depth_kind: Disparity(193)", "found 193: Disparity takes values, as Disparity("),
            ("depth_kind: InverseBetween\n  ", "as InverseBetween(far_m: …, near_m: …)"),
            ("depth_kind: Disparty", "Disparty"),
        ] {
            let text = format!(
                "(name: \"a\", lens: BuiltIn(\"dgauss-50mm\"), focus: DistanceMm(2000.0), sensor: BuiltIn(\"nikon-d5100\"),
                scene: (source: File(\"scene.exr\"), reading: ({reading})))"
            );
            let error = Camera::parse(&text, Path::new("shot.ron")).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
    }
}
