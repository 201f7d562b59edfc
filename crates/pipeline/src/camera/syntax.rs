//! What is wrong with the text of a camera file.

use dioptric_files::ron::RonError;
use serde_json::Value;

/// The schema of camera files.
pub const CAMERA_SCHEMA: &str = include_str!("../../data/camera.schema.json");

/// Returns the error of a camera file with the values that the word of a choice takes, where they have not begun well.
pub(super) fn with_values(mut error: RonError) -> RonError {
    if let Some(word) = &error.choice
        && let Some(values) = values_of(word)
    {
        error.reason = format!("{}: {word} takes {values}", error.reason);
    }
    error
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
