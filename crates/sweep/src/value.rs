//! Data of a camera file without its types: what an axis sets, and where.

mod typed;

use std::{collections::BTreeMap, fmt};

use serde::{Deserialize, Serialize, Serializer, de::DeserializeOwned};

/// A value of a camera file, written in a plan as it is there: a number, a word, a choice such as `FNumber(4.0)`, a list or a
/// struct.
///
/// The form is that of the JSON schema of camera files: a struct is a map, `Name(value)` a map of its name and its value, a
/// bare `Name` a text. Infinity stays what it is.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(untagged, expecting = "a number, a text, a choice, a list or a struct of a camera file")]
pub enum Value {
    /// True or false.
    Bool(bool),
    /// A whole number from 0.
    Whole(u64),
    /// A whole number below 0.
    Below(i64),
    /// Any other number.
    Number(f64),
    /// A text, or a choice that holds nothing.
    Text(String),
    /// Nothing: `None`.
    Nothing,
    /// A list or a tuple.
    List(Vec<Self>),
    /// A struct by its keys, or a choice by its name.
    Map(BTreeMap<String, Self>),
}

impl Value {
    /// Returns the data of RON text.
    ///
    /// # Errors
    /// When the text is not RON.
    pub(crate) fn parse(text: &str) -> Result<Self, ron::error::SpannedError> {
        ron::from_str(text)
    }

    /// Returns a number, as a whole one where it is, since counts and seeds are read from whole numbers alone.
    pub fn number(value: f64) -> Self {
        // Below 2⁵³ whole numbers are exact.
        const EXACT: f64 = 9_007_199_254_740_992.0;
        let is_whole = value.fract() == 0.0 && value.abs() < EXACT;
        if !is_whole {
            return Self::Number(value);
        }
        if value < 0.0 { Self::Below(value as i64) } else { Self::Whole(value as u64) }
    }

    /// Returns it as a number, where it is one.
    pub fn as_f64(&self) -> Option<f64> {
        match self {
            Self::Whole(value) => Some(*value as f64),
            Self::Below(value) => Some(*value as f64),
            Self::Number(value) => Some(*value),
            _ => None,
        }
    }

    /// Puts a value at a path of keys and names of choices separated by dots: `exposure.Manual.time_s`.
    ///
    /// A part that begins with a capital letter is the name of a choice, which takes the place of any other choice there. A
    /// part that is a number counts the entries of a list from 0.
    ///
    /// # Errors
    /// Says which part of the path has no place.
    pub fn set(&mut self, path: &str, value: Self) -> Result<(), String> {
        let (mut place, mut above) = (self, "the camera");
        for part in path.split('.') {
            place = place.part(part).map_err(|reason| format!("{above} {reason}"))?;
            above = part;
        }
        *place = value;
        Ok(())
    }

    /// Returns the place of one part of a path.
    fn part(&mut self, part: &str) -> Result<&mut Self, String> {
        if part.starts_with(|c: char| c.is_uppercase()) {
            let is_chosen = matches!(self, Self::Map(map) if map.len() == 1 && map.contains_key(part));
            if !is_chosen {
                *self = Self::Map(BTreeMap::from([(part.to_owned(), Self::Nothing)]));
            }
        }
        // What was nothing is filled by what is set in it.
        if matches!(self, Self::Nothing) {
            *self = Self::Map(BTreeMap::new());
        }
        let found = self.description();
        match self {
            Self::List(list) => {
                let (n, index) = (list.len(), part.parse::<usize>().ok());
                index
                    .and_then(|index| list.get_mut(index))
                    .ok_or_else(|| format!("is a list of {n}, expected a number below that in place of '{part}'"))
            }
            Self::Map(map) if !map.keys().any(|key| starts_a_choice(key) && key != part) => {
                Ok(map.entry(part.to_owned()).or_insert(Self::Nothing))
            }
            _ => Err(format!("is {found} and has no '{part}'; a key of a choice follows the name of the choice")),
        }
    }

    /// Returns what it is, for an error.
    fn description(&self) -> String {
        match self {
            Self::Map(map) => match map.keys().next().filter(|key| starts_a_choice(key)) {
                Some(choice) => format!("{choice}(…)"),
                None => "a struct".to_owned(),
            },
            other => other.to_string(),
        }
    }

    /// Returns the value that this data is.
    ///
    /// # Errors
    /// When it is no such value.
    pub(crate) fn typed<T: DeserializeOwned>(self) -> Result<T, String> {
        T::deserialize(typed::Reader(self)).map_err(|error| error.to_string())
    }
}

fn starts_a_choice(key: &str) -> bool {
    key.starts_with(|c: char| c.is_uppercase())
}

impl Serialize for Value {
    /// As JSON, of which infinity and NaN are no part: they are the texts `inf`, `-inf` and `NaN`.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Bool(value) => serializer.serialize_bool(*value),
            Self::Whole(value) => serializer.serialize_u64(*value),
            Self::Below(value) => serializer.serialize_i64(*value),
            Self::Number(value) if value.is_finite() => serializer.serialize_f64(*value),
            Self::Number(value) => serializer.collect_str(value),
            Self::Text(value) => serializer.serialize_str(value),
            Self::Nothing => serializer.serialize_unit(),
            Self::List(list) => serializer.collect_seq(list),
            Self::Map(map) => serializer.collect_map(map),
        }
    }
}

impl fmt::Display for Value {
    /// As RON has it: in a table or beside a picture.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let list = |f: &mut fmt::Formatter<'_>, values: &mut dyn Iterator<Item = String>| {
            f.write_str(&values.collect::<Vec<_>>().join(", "))
        };
        match self {
            Self::Bool(value) => value.fmt(f),
            Self::Whole(value) => value.fmt(f),
            Self::Below(value) => value.fmt(f),
            Self::Number(value) => value.fmt(f),
            Self::Text(value) => f.write_str(value),
            Self::Nothing => f.write_str("None"),
            Self::List(values) => {
                f.write_str("[")?;
                list(f, &mut values.iter().map(Self::to_string))?;
                f.write_str("]")
            }
            Self::Map(map) => match map.iter().next().filter(|(key, _)| map.len() == 1 && starts_a_choice(key)) {
                Some((choice, value @ Self::Map(_))) => write!(f, "{choice}{value}"),
                Some((choice, value)) => write!(f, "{choice}({value})"),
                None => {
                    f.write_str("(")?;
                    list(f, &mut map.iter().map(|(key, value)| format!("{key}: {value}")))?;
                    f.write_str(")")
                }
            },
        }
    }
}

#[cfg(feature = "schema")]
impl schemars::JsonSchema for Value {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Value".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({ "description": "A value of a camera file, as it is there." })
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use dioptric_pipeline::{CAMERA_TEMPLATE, Camera};

    use super::*;

    fn demo() -> Value {
        Value::parse(&Camera::demo().unwrap().to_ron()).unwrap()
    }

    #[test]
    fn cameras_survive_the_loss_of_types() {
        let rich = r#"(name: "x", lens: Thin(focal_length_mm: 50, diameter_mm: 10.25), focus: DistanceMm(inf),
            diffraction: None, noise: Only([Photon]), frames: MovingBurst(frames: 4, motion_px: 0.1),
            light_field: Some(Array((elements: Lenses(focal_length_mm: 0.4), pitch_mm: 0.1, gap_mm: 0.4))),
            wavelengths: ListNm([450.1, 1e3]), seed: 18446744073709551615, stop: FNumber(0.30000000000000004),
            sensor: File("s.ron"), exposure: Manual((time_s: 1e-3, gain_mode: High)),
            processing: (white: Light(Chromaticity(x: 0.46, y: 0.414)), denoise: Some(0.5)),
            scene: (source: World((file: "w.pbrt", size: Some((3, 4)), effort: Noise(0.1))), light: Blackbody(3200)))"#;
        for text in [CAMERA_TEMPLATE, rich, &Camera::demo().unwrap().to_ron()] {
            let camera = Camera::parse(text, Path::new("")).unwrap();
            let value = Value::parse(&camera.to_ron()).unwrap();
            assert_eq!(value.typed::<Camera>().unwrap(), camera);
        }
    }

    #[test]
    fn choices_take_the_place_of_others() {
        let mut value = demo();
        for (path, set) in [
            ("exposure.Manual.time_s", Value::number(0.02)),
            ("exposure.Manual.analog_gain", Value::number(2.0)),
            ("scene.source.StillLife.columns", Value::number(54.0)),
            ("diffraction", Value::Nothing),
            ("focus", Value::parse("DistanceMm(1e3)").unwrap()),
            ("sensor.BuiltIn", Value::Text("imx363".to_owned())),
        ] {
            value.set(path, set).unwrap();
        }
        let camera: Camera = value.typed().unwrap();
        let words = "exposure: Manual((time_s: 0.02, analog_gain: 2.0)), scene: (source: StillLife(columns: 54, rows: 720)), \
                     diffraction: None, focus: DistanceMm(1e3), sensor: BuiltIn(\"imx363\"), ";
        let demo = Camera::demo().unwrap();
        let expected = Camera::parse(
            &format!(
                "({words} name: {:?}, lens: BuiltIn(\"dgauss-50mm\"), stop: FNumber(4), film: Pixels(columns: 960, rows: 640, \
                pitch_um: 33.0), wavelengths: Range(first_nm: 400, last_nm: 700, step_nm: 10))",
                demo.name
            ),
            Path::new(""),
        );
        assert_eq!(camera, expected.unwrap());
    }

    #[test]
    fn paths_without_a_place_are_named() {
        let error = |path: &str| {
            let mut value = demo();
            match value.set(path, Value::number(1.0)) {
                Err(reason) => reason,
                Ok(()) => value.typed::<Camera>().unwrap_err(),
            }
        };
        assert!(error("fokus.DistanceMm").contains("unknown field `fokus`"), "{}", error("fokus.DistanceMm"));
        assert!(
            error("exposure.time_s").contains("exposure is Auto(…) and has no 'time_s'"),
            "{}",
            error("exposure.time_s")
        );
        assert!(error("focus.Distance").contains("unknown variant `Distance`"), "{}", error("focus.Distance"));
        assert!(error("seed.x").contains("seed is 1 and has no 'x'"), "{}", error("seed.x"));
        assert_eq!(error("stop"), "1 is none of AsGiven, FNumber, DiameterMm");
        assert_eq!(error("name"), "invalid type: integer `1`, expected a string");
    }

    #[test]
    fn values_are_written_as_ron_and_json() {
        let text = "Hurb(gamma: 1.5)";
        let value = Value::parse(text).unwrap();
        assert_eq!(
            (value.to_string(), serde_json::to_string(&value).unwrap()),
            (text.to_owned(), "{\"Hurb\":{\"gamma\":1.5}}".to_owned())
        );
        let list = Value::parse("[1, -2, inf, None, All]").unwrap();
        assert_eq!(
            (list.to_string(), serde_json::to_string(&list).unwrap()),
            ("[1, -2, inf, None, All]".to_owned(), "[1,-2,\"inf\",null,\"All\"]".to_owned())
        );
    }
}
