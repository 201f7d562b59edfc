//! What camera and sensor files may hold, as JSON schemas.
//!
//! Files are RON; a schema describes the same data as JSON: a struct is an object, `Name(value)` is `{"Name": value}`, a bare
//! `Name` is a string. The texts are made from the types by `cargo xtask schema`, and a test of the workspace holds them to
//! the types, so that a program that only prints them builds no generator.

/// The schema of sensor files.
pub const SENSOR_SCHEMA: &str = include_str!("../data/sensor.schema.json");
/// A camera file with every key, its default and its choices in comments.
pub const CAMERA_TEMPLATE: &str = include_str!("../data/template.ron");

/// Returns the schemas as the types have them, each with the name of its file.
#[cfg(feature = "schema")]
pub fn generated_schemas() -> [(&'static str, String); 2] {
    let text = |schema: schemars::Schema| format!("{:#}\n", schema.to_value());
    [
        ("camera.schema.json", text(schemars::schema_for!(crate::Camera))),
        ("sensor.schema.json", text(schemars::schema_for!(dioptric_sensor::Sensor))),
    ]
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::{CAMERA_SCHEMA, Camera, LensSpec, SceneSource};

    #[test]
    fn template_is_a_camera_of_defaults() {
        let template = Camera::parse(CAMERA_TEMPLATE, Path::new("template.ron")).unwrap();
        template.validate().unwrap();
        // With no more than the keys that have no default.
        let short = r#"(name: "My camera", lens: BuiltIn("dgauss-50mm"), focus: DistanceMm(960.0),
            sensor: BuiltIn("nikon-d5100"), scene: (source: StillLife(columns: 1080, rows: 720)))"#;
        let short = Camera::parse(short, Path::new("short.ron")).unwrap();
        assert_eq!(template, short);
        assert!(matches!(
            (template.lens, template.scene.source),
            (LensSpec::BuiltIn(_), SceneSource::StillLife { .. })
        ));
    }

    #[test]
    fn schemas_and_template_name_every_key() {
        let camera: serde_json::Value = serde_json::from_str(CAMERA_SCHEMA).unwrap();
        let keys = camera["properties"].as_object().unwrap();
        assert!(keys.len() > 15);
        for key in keys.keys() {
            assert!(CAMERA_TEMPLATE.contains(&format!("\n    {key}: ")), "{key}");
        }
        let sensor: serde_json::Value = serde_json::from_str(SENSOR_SCHEMA).unwrap();
        assert!(sensor["properties"]["pixel_pitch_um"]["description"].is_string());
    }
}
