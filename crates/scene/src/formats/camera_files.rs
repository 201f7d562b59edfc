//! Files of camera data: ours, or those of `Open3D`, nerfstudio, COLMAP, `OpenCV`, ROS and Kalibr.

use std::{
    fs,
    path::{Path, PathBuf},
};

use serde::{
    Deserialize, Deserializer,
    de::{MapAccess, SeqAccess, Visitor},
};
use serde_json::{Value, json};

use super::{
    camera::CameraFile,
    camera_models::{HARMLESS, check_matrix, is_fisheye, is_model, unknown_model},
    camera_yaml::{of_xml, of_yaml},
    depth_names::words_of,
    distortion::Distortion,
    npy::{MAGIC, parse as parse_npy},
    reading::DepthUnit,
    stated::{Stated, bare, name_of, short},
    unusable::{TRUNCATED, check_memory, check_whole, starts_with, unreadable},
};
use crate::SceneError;

/// What camera data are read as.
const EXPECTED: &str = "expected JSON, YAML or XML of OpenCV, a matrix of 3 × 3 numbers, or a line of COLMAP's cameras.txt (colmap model_converter --output_type \
                        TXT): number, model, width, height, parameters";
/// Endings of a picture's stem that its camera file does not repeat.
const PARTS: [&str; 4] = [".radiance_depth", ".radiance", ".reflectance", ".depth"];
impl CameraFile {
    /// Reads the camera file beside a picture, or returns `None` where there is none.
    ///
    /// For `a_1.radiance_depth.exr` the names looked for are `a_1.camera.json`, `a_1_camera.json` and `a_camera.json`.
    pub(super) fn beside(picture: &Path) -> Result<Option<Self>, SceneError> {
        let candidates = beside(picture, &[".camera.json", "_camera.json"]);
        let Some(path) = candidates.into_iter().find(|path| path.is_file()) else { return Ok(None) };
        Self::read(&path, picture).map(Some)
    }

    /// Reads the camera data of a picture: JSON, YAML or `OpenCV`'s XML of ours (`width`, `height`, `fx_px`, `fy_px`, `cx_px`, `cy_px`), of `Open3D`
    /// (`intrinsic_matrix`), nerfstudio (`fl_x`, …), `OpenCV` and ROS (`camera_matrix`) or Kalibr (`intrinsics`), or COLMAP's `cameras.txt`.
    ///
    /// # Errors
    /// When it is none of these, lacks what is needed, says a thing twice, or has a model of a lens that is not known.
    pub(super) fn read(path: &Path, picture: &Path) -> Result<Self, SceneError> {
        let length = fs::metadata(path).map_err(|error| unreadable(path, error))?.len();
        check_memory(path, length.saturating_mul(4), length)?;
        check_whole(path)?;
        if starts_with(path, MAGIC)? {
            let data = of_npy(path).and_then(|object| of_object(path, object, picture));
            return data.and_then(Self::checked).map_err(|reason| unreadable(path, reason));
        }
        let text = dioptric_files::text::read(path).map_err(|error| match error.kind() {
            std::io::ErrorKind::InvalidData => unreadable(path, format!("it is no text, {EXPECTED}")),
            _ => unreadable(path, error),
        })?;
        // JSON has its keys in quotes.
        let is_flow =
            |text: &str| text.strip_prefix('{').is_some_and(|rest| rest.trim_start().starts_with(char::is_alphabetic));
        let is_yaml =
            || path.extension().is_some_and(|own| ["yaml", "yml"].iter().any(|yaml| own.eq_ignore_ascii_case(yaml)));
        // Of a key in front of its value.
        let has_key = |line: &str| !line.starts_with('#') && (line.contains(": ") || line.ends_with(':'));
        let is_section = |line: &str| {
            let name = line.strip_prefix('[').and_then(|line| line.trim_end().strip_suffix(']'));
            name.is_some_and(|name| name.starts_with(char::is_alphabetic))
        };
        let object = match text.trim_start() {
            text if is_yaml() || is_flow(text) => of_yaml(text),
            text if text.starts_with('{') => of_json(text),
            text if is_section(text.lines().next().unwrap_or_default()) => Err(
                "it is an INI file, as ZED has it: expected fx, fy, cx and cy of one of its cameras as JSON or YAML"
                    .to_owned(),
            ),
            text if text.starts_with('[') => Err(
                "it is a list of JSON, expected the object of one camera (with fx, fy, cx and cy, or intrinsic_matrix)"
                    .to_owned(),
            ),
            text if text.starts_with('<') => of_xml(text),
            text => match matrix_of(text) {
                Some(numbers) => Ok(of_matrix(&numbers)),
                None if text.starts_with('%') || text.lines().any(|line| has_key(line.trim_end())) => of_yaml(text),
                None => {
                    return of_colmap(path, text, picture)
                        .and_then(Self::checked)
                        .map_err(|reason| unreadable(path, reason));
                }
            },
        };
        let data = object.and_then(|object| of_object(path, object, picture));
        data.and_then(Self::checked).map_err(|reason| unreadable(path, reason))
    }
}

/// Returns the names beside a picture that its stem, and the part of it before the last underscore, have with these endings.
pub(super) fn beside(picture: &Path, endings: &[&str]) -> Vec<PathBuf> {
    let stem = picture.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let stem = PARTS.iter().find_map(|part| stem.strip_suffix(part)).unwrap_or(&stem);
    let mut names: Vec<String> = endings.iter().map(|ending| format!("{stem}{ending}")).collect();
    if let Some((first, _)) = stem.rsplit_once('_') {
        names.extend(endings.iter().filter(|ending| ending.starts_with('_')).map(|ending| format!("{first}{ending}")));
    }
    names.into_iter().map(|name| picture.with_file_name(name)).collect()
}

/// JSON in whose objects each key stands once.
struct Once(Value);

impl<'de> Deserialize<'de> for Once {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Any;
        impl<'de> Visitor<'de> for Any {
            type Value = Once;

            fn expecting(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                formatter.write_str("a number, a text, a list or an object")
            }

            fn visit_bool<E>(self, own: bool) -> Result<Once, E> {
                Ok(Once(own.into()))
            }

            fn visit_i64<E>(self, own: i64) -> Result<Once, E> {
                Ok(Once(own.into()))
            }

            fn visit_u64<E>(self, own: u64) -> Result<Once, E> {
                Ok(Once(own.into()))
            }

            fn visit_f64<E>(self, own: f64) -> Result<Once, E> {
                Ok(Once(own.into()))
            }

            fn visit_str<E>(self, own: &str) -> Result<Once, E> {
                Ok(Once(own.into()))
            }

            fn visit_unit<E>(self) -> Result<Once, E> {
                Ok(Once(Value::Null))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Once, A::Error> {
                let mut items = vec![];
                while let Some(Once(item)) = list.next_element()? {
                    items.push(item);
                }
                Ok(Once(items.into()))
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Once, A::Error> {
                let mut entries = serde_json::Map::new();
                while let Some((key, Once(value))) = map.next_entry::<String, Once>()? {
                    if entries.contains_key(&key) {
                        return Err(serde::de::Error::custom(format!("the key '{}' stands twice", short(&key))));
                    }
                    entries.insert(key, value);
                }
                Ok(Once(entries.into()))
            }
        }
        deserializer.deserialize_any(Any)
    }
}

/// Reads the matrix of a camera: 3 rows of 3 numbers of `NumPy`.
fn of_npy(path: &Path) -> Result<Value, String> {
    let array = parse_npy(&fs::read(path).map_err(|error| error.to_string())?)?;
    if array.sides != [3, 3] {
        return Err(format!("its array has sides of {:?}, expected the 3 × 3 matrix of a camera", array.sides));
    }
    Ok(of_matrix(&array.values.iter().map(|v| f64::from(*v)).collect::<Vec<_>>()))
}

/// Returns the object of the matrix of a camera, row by row.
fn of_matrix(numbers: &[f64]) -> Value {
    json!({ "intrinsic_matrix": numbers.chunks(3).collect::<Vec<_>>() })
}

/// Returns the numbers of a text that is a matrix of 3 rows of 3 numbers, as `savetxt` of `NumPy` writes it.
fn matrix_of(text: &str) -> Option<Vec<f64>> {
    let is_comment = |line: &&str| line.trim().is_empty() || line.starts_with('#');
    let number = |word: &str| word.parse().ok();
    let row = |line: &str| line.split([' ', '\t', ',', ';']).filter(|word| !word.is_empty()).map(number).collect();
    let rows: Option<Vec<Vec<f64>>> = text.lines().filter(|line| !is_comment(line)).map(row).collect();
    rows.filter(|rows| rows.len() == 3 && rows.iter().all(|row| row.len() == 3)).map(|rows| rows.concat())
}

/// Returns where and why a text is no JSON.
fn no_json(text: &str, error: &serde_json::Error) -> String {
    let (line, column) = (error.line(), error.column());
    let said = error.to_string();
    let said = said.split(" at line ").next().unwrap_or_default();
    if error.is_data() {
        return format!("line {line}: {said}");
    }
    if error.is_eof() {
        return TRUNCATED.to_owned();
    }
    let of_line = text.lines().nth(line.saturating_sub(1)).unwrap_or_default();
    let from = of_line.char_indices().nth(column.saturating_sub(1)).map_or(of_line.len(), |(at, _)| at);
    let rest = &of_line[from..];
    let end = rest.find([',', '}', ']']).unwrap_or(rest.len());
    let found = rest.get(..end.max(1)).unwrap_or(rest);
    let expected = match said.strip_prefix("expected ") {
        Some("value") => "a number, a text, a list or an object",
        expected => expected.unwrap_or("JSON"),
    };
    format!("line {line}, column {column}: found '{}', expected {expected}", short(found))
}

fn of_json(text: &str) -> Result<Value, String> {
    let Once(all) = serde_json::from_str(text).map_err(|error| no_json(text, &error))?;
    Ok(all)
}

/// Reads an object of ours, `Open3D`, nerfstudio, `OpenCV`, ROS or Kalibr.
fn of_object(path: &Path, object: Value, picture: &Path) -> Result<CameraFile, String> {
    let Value::Object(entries) = object else { return Err("it is no object of a camera (key: value)".to_owned()) };
    let (mut keys, frames_note) = with_frame(path, picture, of_one_camera(entries.into_iter().collect())?)?;
    let depth_file = match keys.take("depth_file_path") {
        None | Some(Value::Null) => None,
        Some(Value::String(own)) => Some(path.with_file_name(own.replace('\\', "/"))),
        Some(other) => return Err(format!("depth_file_path is {other}, expected the name of a file")),
    };
    // Centers of pixels are at whole numbers for OpenCV and Open3D, at halves for nerfstudio.
    let is_nerf = ["fl_x", "camera_angle_x"].iter().any(|name| keys.get(name).is_some())
        && ["fx_px", "fx"].iter().all(|name| keys.get(name).is_none());
    let is_fisheye = is_of_fisheye(&mut keys)?;
    if keys.get("units").and_then(Value::as_str).is_some_and(|unit| ["px", "pixel", "pixels"].contains(&unit)) {
        keys.take("units");
    }
    let size = size_of(&mut keys)?;
    let angles_rad = [number(&mut keys, &["camera_angle_x"])?, number(&mut keys, &["camera_angle_y"])?];
    let [fx, fy, cx, cy] = pinhole_of(&mut keys)?;
    let depth_unit_m = depth_unit_of(&mut keys)?;
    let distortion = distortion_of(&mut keys, is_fisheye, is_nerf)?;
    // A rectification that turns nothing is none.
    const NO_TURN: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    for name in ["rectification_matrix", "R", "r"] {
        let turn = keys.get(name).and_then(|own| numbers_of(own, name).ok());
        if turn.is_some_and(|own| own == NO_TURN) {
            keys.take(name);
        }
    }
    let half = if is_nerf { 0.5 } else { 0.0 };
    let missing = |name: &str| format!("missing {name}: expected width, height, fx_px, fy_px, cx_px and cy_px");
    Ok(CameraFile {
        file: path.to_owned(),
        size: match size {
            (Some(width), Some(height)) => Some((width, height)),
            (None, None) => None,
            (None, _) => return Err(missing("width")),
            (_, None) => return Err(missing("height")),
        },
        focal_px: [fx, fy],
        angles_rad,
        center_px: [cx, cy].map(|center| center.map(|center| center - half)),
        distortion,
        depth_unit_m,
        depth_file,
        notes: keys
            .note(path, |name| {
                HARMLESS.contains(&name)
                    || words_of(name).iter().any(|word| ["error", "errors"].contains(&word.as_str()))
            })
            .into_iter()
            .chain(frames_note)
            .collect(),
    })
}

/// The keys of a camera file.
type Keys = Stated<Value>;

/// Puts what the only camera of a file states (`cam0` of Kalibr, `camera`, `Camera.` of ORB-SLAM) among what the file states.
fn of_one_camera(mut entries: Vec<(String, Value)>) -> Result<Keys, String> {
    for (name, _) in &mut entries {
        *name = ["Camera.", "Camera1."].iter().find_map(|head| name.strip_prefix(head)).unwrap_or(name).to_owned();
    }
    let is_counted = |name: &str| name.strip_prefix("cam").is_some_and(|n| n.parse::<u32>().is_ok());
    let is_camera = |name: &str| ["camera", "intrinsics", "intrinsic"].contains(&name) || is_counted(name);
    let (cameras, mut all): (Vec<_>, Vec<_>) = entries
        .into_iter()
        .partition(|(name, own)| is_camera(name) && own.as_object().is_some_and(|own| !own.contains_key("data")));
    if cameras.len() > 1 {
        let names = cameras.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ");
        return Err(format!("it has cameras {names}: expected the keys of one"));
    }
    for (_, camera) in cameras {
        let Value::Object(own) = camera else { continue };
        all.extend(own);
    }
    let twice = all.iter().enumerate().find(|(i, (name, _))| all[..*i].iter().any(|(own, _)| own == name));
    match twice {
        Some((_, (name, _))) => Err(format!("the key '{}' stands twice: expected it once", short(name))),
        None => Ok(Stated::new("key", all)),
    }
}

/// Puts what the frame of a picture states in the place of what is stated for all (`frames` of nerfstudio); of frames none of which is
/// the picture's it is said where they state more than poses.
fn with_frame(path: &Path, picture: &Path, mut all: Keys) -> Result<(Keys, Option<String>), String> {
    let frames = match all.take("frames") {
        None | Some(Value::Null) => return Ok((all, None)),
        Some(Value::Array(frames)) => frames,
        Some(_) => return Err("its frames are no list, expected an object for each".to_owned()),
    };
    let alike = frames_of(path, picture, &frames);
    let [Value::Object(frame)] = alike[..] else {
        let how_many = if alike.is_empty() {
            "none of the file_path of its frames is"
        } else {
            "several of the file_path of its frames are"
        };
        if frames.iter().any(|frame| frame.get("fl_x").is_some()) {
            return Err(format!(
                "its frames have focal lengths of their own, and {how_many} {}: expected one for all, or that of the picture",
                name_of(picture)
            ));
        }
        let have_depth = frames.iter().any(|frame| frame.get("depth_file_path").is_some());
        let note =
            format!("{}: {how_many} {}, so that no depth_file_path of theirs is used", name_of(path), name_of(picture));
        return Ok((all, have_depth.then_some(note)));
    };
    let mut own = Stated::new("key", frame.clone().into_iter().collect());
    // Where it was taken from, and how sharp it is.
    own.take_all(|name| ["file_path", "transform_matrix", "sharpness", "colmap_im_id"].contains(&name));
    own.merge(all);
    Ok((own, None))
}

/// Returns the frames whose file is a picture, or else those that are called like it elsewhere; the ending may be left out.
fn frames_of<'a>(path: &Path, picture: &Path, frames: &'a [Value]) -> Vec<&'a Value> {
    let Some(name) = picture.file_name() else { return vec![] };
    let here = picture.canonicalize().ok();
    let is_called = |own: &Path| own.file_name() == Some(name) || own.file_name() == picture.file_stem();
    let is_here = |own: &Path| here.is_some() && own.with_file_name(name).canonicalize().ok() == here;
    let of = |is_wanted: &dyn Fn(&Path) -> bool| {
        let file = |frame: &Value| Some(path.with_file_name(frame.get("file_path")?.as_str()?.replace('\\', "/")));
        let mut found: Vec<_> = frames.iter().filter(|frame| file(frame).is_some_and(|own| is_wanted(&own))).collect();
        found.dedup();
        found
    };
    let alike = of(&|own| is_called(own) && is_here(own));
    if alike.is_empty() { of(&is_called) } else { alike }
}

/// Takes the number of the first of these keys that is there.
fn number(keys: &mut Keys, names: &[&str]) -> Result<Option<f64>, String> {
    let own = names.iter().find_map(|name| Some((name, keys.take(name)?)));
    own.map_or(Ok(None), |(name, own)| number_in(name, &own))
}

/// Returns the number of a key; `null` is none.
fn number_in(name: &str, own: &Value) -> Result<Option<f64>, String> {
    match own {
        Value::Null => Ok(None),
        own => own.as_f64().map(Some).ok_or_else(|| format!("{name} is {own}, expected a number")),
    }
}

/// Names of the size of the picture, as a pair.
const SIZES: [&str; 6] =
    ["resolution", "imageresolution", "imagesize", "imgsize", "imagedimensions", "referencedimensions"];

/// Takes the columns and rows of the picture that the file speaks of, as a pair or by themselves.
fn size_of(keys: &mut Keys) -> Result<(Option<usize>, Option<usize>), String> {
    let pair = |own: &Value| -> Option<Vec<f64>> {
        match own {
            Value::String(text) => {
                let own: Option<Vec<f64>> = text.split([' ', ',', 'x', '×']).map(|word| word.parse().ok()).collect();
                own.filter(|own| own.len() == 2)
            }
            own => numbers_of(own, "")
                .ok()
                .or_else(|| Some(vec![own.get("width")?.as_f64()?, own.get("height")?.as_f64()?])),
        }
    };
    // What is called so may be another text or a number of dots an inch, which is named.
    let is_pair = |name: &&&str| keys.names().any(|own| bare(own) == **name && keys.get(own).and_then(pair).is_some());
    if let Some(name) = SIZES.iter().find(is_pair)
        && let Some((name, own)) = keys.take_called(&[name])
    {
        return match pair(&own).as_deref() {
            Some(&[width, height]) => Ok((Some(n_samples(width, &name)?), Some(n_samples(height, &name)?))),
            _ => Err(format!("its {name} is no width and height")),
        };
    }
    let mut side = |names: &[&str]| -> Result<Option<usize>, String> {
        let Some((name, own)) = keys.take_called(names) else { return Ok(None) };
        number_in(&name, &own)?.map(|n| n_samples(n, &name)).transpose()
    };
    Ok((
        side(&["width", "w", "imagewidth", "imgwidth", "imagew", "imgw", "cols", "columns", "resolutionx"])?,
        side(&["height", "h", "imageheight", "imgheight", "imageh", "imgh", "rows", "resolutiony"])?,
    ))
}

fn n_samples(n: f64, name: &str) -> Result<usize, String> {
    let is_whole = n >= 1.0 && n.fract() == 0.0 && n < 1e6;
    is_whole.then_some(n as usize).ok_or_else(|| format!("{name} is {n}, expected a number of samples"))
}

/// Names of lists of coefficients of a distortion.
const LISTS: [&str; 16] = [
    "distortion",
    "distcoeff",
    "dist",
    "coeffs",
    "distcoeffs",
    "distortioncoefficients",
    "distortioncoeffs",
    "d",
    "distortioncoeff",
    "distortionparams",
    "distortionparameters",
    "distortionvector",
    "distcoef",
    "distcoefs",
    "disto",
    "kc",
];

/// Whether the file names a model of fisheyes.
fn is_of_fisheye(keys: &mut Keys) -> Result<bool, String> {
    let mut is_any = false;
    let list =
        |name: &str| if LISTS.contains(&bare(name).as_str()) { numbers_of(keys.get(name)?, name).ok() } else { None };
    let own = keys.names().find_map(list);
    let is_zero = own.is_some_and(|own| own.iter().all(|v| *v == 0.0));
    const MODELS: [&str; 11] = [
        "cameramodel",
        "distortionmodel",
        "model",
        "type",
        "lensmodel",
        "lenstype",
        "modeltype",
        "distortiontype",
        "projection",
        "projectiontype",
        "projectionmodel",
    ];
    for called in MODELS {
        let Some(name) = keys.names().find(|name| bare(name) == called).map(str::to_owned) else { continue };
        let Some(model) = keys.get(&name).and_then(Value::as_str).map(str::to_owned) else { continue };
        match is_fisheye(&model, is_zero) {
            Some(is_fisheye) => {
                is_any |= is_fisheye;
                keys.take(&name);
            }
            // Who made the camera or the lens may stand there as well, which is named.
            None if !["cameramodel", "distortionmodel"].contains(&called) && !is_model(&model) => {}
            None => return Err(unknown_model(&model)),
        }
    }
    // A sample of OpenCV writes 1 or 0.
    for called in ["isfisheye", "fisheyemodel", "fisheye"] {
        let Some(name) = keys.names().find(|name| bare(name) == called).map(str::to_owned) else { continue };
        let is = |own: &Value| own.as_bool().or(own.as_f64().map(|own| own != 0.0));
        if let Some(is_fisheye) = keys.get(&name).and_then(is) {
            is_any |= is_fisheye;
            keys.take(&name);
        }
    }
    Ok(is_any)
}

/// Takes focal lengths and center, by names or as a matrix: `fx`, `fy`, `cx`, `cy`.
fn pinhole_of(keys: &mut Keys) -> Result<[Option<f64>; 4], String> {
    let named = [
        number(keys, &["fx_px", "fl_x", "fx"])?,
        number(keys, &["fy_px", "fl_y", "fy"])?,
        number(keys, &["cx_px", "cx", "ppx"])?,
        number(keys, &["cy_px", "cy", "ppy"])?,
    ];
    // A k in small letters may be the distortion.
    let is_matrix = |own: &Value| numbers_of(own, "k").is_ok_and(|own| own.len() == 9);
    let mut matrix = keys.take_called(&["intrinsicmatrix", "cameramatrix"]).map(|(_, own)| own).or(keys.take("K"));
    if matrix.is_none() && keys.get("k").is_some_and(is_matrix) {
        matrix = keys.take("k");
    }
    let matrix = matrix.map(|own| (own, "intrinsic_matrix"));
    // A text names a file.
    let has_list = keys.get("intrinsics").is_some_and(|own| !own.is_string());
    let intrinsics = || if has_list { Some((keys.take("intrinsics")?, "intrinsics")) } else { None };
    let Some((matrix, name)) = matrix.or_else(intrinsics) else { return Ok(named) };
    let m = match numbers_of(&matrix, name)? {
        m if m.len() == 9 => m,
        // Those of Kalibr.
        m if m.len() == 4 && name == "intrinsics" => vec![m[0], 0.0, m[2], 0.0, m[1], m[3], 0.0, 0.0, 1.0],
        m => {
            let expected = if name == "intrinsics" { "4, those of a pinhole, or" } else { "those" };
            return Err(format!("its {name} has {} numbers, expected {expected} 9 of a matrix", m.len()));
        }
    };
    // Open3D's nine numbers run down the columns, rows of rows are a table.
    let is_table = matrix.as_array().is_some_and(|rows| rows.iter().any(Value::is_array));
    let [a, b] = if is_table || m[6] == 0.0 { [2, 5] } else { [6, 7] };
    let rest = [m[1], m[3], m[if a == 2 { 6 } else { 2 }], m[if a == 2 { 7 } else { 5 }], m[8] - 1.0];
    check_matrix("intrinsic_matrix", &rest)?;
    let own = [m[0], m[4], m[a], m[b]];
    if named.iter().zip(own).any(|(given, own)| given.is_some_and(|given| (given - own).abs() > 1e-9)) {
        return Err("its intrinsic_matrix says something else than its focal lengths and center".to_owned());
    }
    Ok(own.map(Some))
}

/// Takes the coefficients of a distortion, by names or as a list.
fn distortion_of(keys: &mut Keys, is_fisheye: bool, is_nerf: bool) -> Result<Distortion, String> {
    const NAMES: [&str; 8] = ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"];
    let mut k = [0.0; 8];
    for (place, name) in NAMES.into_iter().enumerate() {
        k[place] = number(keys, &[name])?.unwrap_or(0.0);
    }
    for (names, places) in [
        (["k", "radial", "radialdistortion", "radialcoeffs"], &[0, 1, 4, 5, 6, 7][..]),
        (["p", "tangential", "tangentialdistortion", "tangentialcoeffs"], &[2, 3]),
    ] {
        // A text says something else, and so does a matrix.
        let is_list = |own: &&str| names.contains(&bare(own).as_str()) && keys.get(own).is_some_and(Value::is_array);
        let Some(name) = keys.names().find(is_list).map(str::to_owned) else { continue };
        let own = numbers_of(keys.get(&name).unwrap_or(&Value::Null), &name)?;
        if own.len() > places.len() {
            continue;
        }
        keys.take(&name);
        if places.iter().any(|place| k[*place] != 0.0) {
            return Err(format!("it states its distortion twice, as {name} and by names: expected one"));
        }
        own.iter().zip(places).for_each(|(own, place)| k[*place] = *own);
    }
    let list = keys.take_called(&LISTS).map(|(_, list)| list).filter(|list| !list.is_null());
    // Of none.
    let list = list.filter(|list| !list.as_str().is_some_and(|text| text.eq_ignore_ascii_case("none")));
    if let Some(list) = list {
        if k.iter().any(|v| *v != 0.0) {
            return Err("it states its distortion twice, as a list and by names: expected one".to_owned());
        }
        return Distortion::of_list(&numbers_of(&list, "distortion")?, is_fisheye);
    }
    let [k1, k2, p1, p2, k3, k4, k5, k6] = k;
    if is_fisheye {
        if [p1, p2, k5, k6].iter().any(|v| *v != 0.0) {
            return Err("its fisheye has other coefficients than k1 to k4".to_owned());
        }
        return Ok(Distortion::Fisheye([k1, k2, k3, k4]));
    }
    Ok(match is_nerf {
        true => Distortion::Polynomial { k: [k1, k2, p1, p2, k3, 0.0, k5, k6], r8: k4 },
        false => Distortion::Polynomial { k, r8: 0.0 },
    })
}

/// Names of what one code of depth is, m, and of how many are a metre, as TUM, `Open3D` and NICE-SLAM have it.
const DEPTH_UNITS: [&str; 5] = ["depthunitm", "depthunitscalefactor", "integerdepthscale", "depthunit", "depthunits"];
const DEPTH_SCALES: [&str; 6] =
    ["depthscale", "pngdepthscale", "depthfactor", "depthscalefactor", "depthmapfactor", "rgbddepthmapfactor"];

/// Takes what one code of the depth beside the picture stands for, m.
fn depth_unit_of(keys: &mut Keys) -> Result<Option<f64>, String> {
    let unit = match keys.take_called(&DEPTH_UNITS) {
        Some((name, Value::String(text))) => match DepthUnit::parse(&text) {
            Ok(DepthUnit::Metres(unit_m)) => Some((name, unit_m)),
            _ => return Err(format!("{name} is '{}', expected metres, or mm, cm, m or 5000/m", short(&text))),
        },
        Some((name, own)) => match number_in(&name, &own)? {
            Some(many) if many > 1.0 => {
                return Err(format!(
                    "{name} is {many}, expected metres a code, 1 or less, or codes a metre as depth_scale"
                ));
            }
            unit_m => unit_m.map(|unit_m| (name, unit_m)),
        },
        None => None,
    };
    let scale = match keys.take_called(&DEPTH_SCALES) {
        None => None,
        Some((name, own)) => match number_in(&name, &own)? {
            None => None,
            Some(scale) if scale >= 10.0 => Some((name, 1.0 / scale)),
            // Small factors are metres to some and millimetres to others.
            Some(scale) => {
                return Err(format!(
                    "{name} is {scale}, which is metres or millimetres a code: expected codes a metre, 10 or more, or \
                     depth_unit_m"
                ));
            }
        },
    };
    match (unit, scale) {
        (Some((unit, unit_m)), Some((scale, other_m))) if (unit_m / other_m - 1.0).abs() > 1e-6 => {
            Err(format!("{unit} is {unit_m}, and {scale} says {other_m}: expected one of them"))
        }
        (unit, scale) => Ok(unit.or(scale).map(|(_, unit_m)| unit_m)),
    }
}

/// Returns all numbers of a list, of a table row by row, or of a matrix of `OpenCV` and ROS (`rows`, `cols`, `data`).
fn numbers_of(value: &Value, name: &str) -> Result<Vec<f64>, String> {
    let wrong = || format!("{name} is no list of numbers");
    let list = value.get("data").unwrap_or(value);
    let mut numbers = vec![];
    for item in list.as_array().ok_or_else(wrong)? {
        match item {
            Value::Array(row) => {
                numbers.extend(row.iter().map(Value::as_f64).collect::<Option<Vec<f64>>>().ok_or_else(wrong)?);
            }
            item => numbers.push(item.as_f64().ok_or_else(wrong)?),
        }
    }
    let side = |side: &str| value.get(side).and_then(Value::as_f64);
    if let (Some(rows), Some(columns)) = (side("rows"), side("cols"))
        && rows * columns != numbers.len() as f64
    {
        return Err(format!("{name} has {} numbers, but {rows} rows and {columns} columns", numbers.len()));
    }
    Ok(numbers)
}

/// Returns the line of the camera of a picture in COLMAP's `cameras.txt`: that which `images.txt` beside it names, or else the only one of the picture's size, or
/// the only one at all.
fn colmap_line<'a>(path: &Path, lines: &[&'a str], picture: &Path) -> Result<&'a str, String> {
    fn words(line: &str) -> Vec<&str> {
        line.split_whitespace().collect()
    }
    let with_id = |id: &str| lines.iter().copied().find(|line| line.split_whitespace().next() == Some(id));
    let images = dioptric_files::text::read(&path.with_file_name("images.txt")).unwrap_or_default();
    // Number, rotation, place, camera and name of a picture, which may have folders.
    let named = images.lines().map(words).filter(|own| own.len() == 10).map(|own| (own[8], Path::new(own[9])));
    let called: Vec<(&str, &Path)> = named.filter(|(_, own)| own.file_name() == picture.file_name()).collect();
    let whole = std::path::absolute(picture).unwrap_or_else(|_| picture.to_owned());
    let in_folder: Vec<(&str, &Path)> = called.iter().copied().filter(|(_, own)| whole.ends_with(own)).collect();
    let own = if in_folder.is_empty() { called } else { in_folder };
    if let Some((id, _)) = own.first() {
        if own.iter().any(|(other, _)| other != id) {
            return Err(format!(
                "images.txt has pictures of several cameras called {}: expected one",
                name_of(picture)
            ));
        }
        return with_id(id).ok_or_else(|| format!("images.txt says that its camera is {id}, which it has not"));
    }
    let is_camera = |line: &&str| words(line).len() > 4 && words(line)[0].parse::<u32>().is_ok();
    let [first, others @ ..] = lines else { return Err(EXPECTED.to_owned()) };
    if !lines.iter().all(is_camera) {
        return Err(EXPECTED.to_owned());
    }
    if others.iter().all(|line| words(line).get(1..) == words(first).get(1..)) {
        return Ok(*first);
    }
    let size = dioptric_pictures::size_of(picture).ok().map(|(columns, rows)| [columns.to_string(), rows.to_string()]);
    let has_size =
        |line: &&&str| size.as_ref().is_some_and(|size| words(line).get(2..4).is_some_and(|own| own == size));
    let alike: Vec<&&str> = lines.iter().filter(has_size).collect();
    match alike[..] {
        [one] => Ok(*one),
        _ => Err(format!(
            "it has {} cameras, and no images.txt beside it says which {} has: expected one",
            lines.len(),
            name_of(picture)
        )),
    }
}

/// Reads the camera of a picture in COLMAP's `cameras.txt`: number, model, width, height and parameters, with centers of pixels at halves.
fn of_colmap(path: &Path, text: &str, picture: &Path) -> Result<CameraFile, String> {
    let lines: Vec<&str> =
        text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#')).collect();
    let line = colmap_line(path, &lines, picture)?;
    let words: Vec<&str> = line.split_whitespace().collect();
    let [_, model, width, height, parameters @ ..] = &words[..] else { return Err(EXPECTED.to_owned()) };
    let side = |word: &str| word.parse::<usize>().ok().filter(|n| *n > 0).ok_or(EXPECTED);
    let size = (side(width)?, side(height)?);
    let p: Vec<f64> = parameters.iter().map(|word| word.parse()).collect::<Result<_, _>>().map_err(|_| EXPECTED)?;
    let (f, c, k): (_, _, &[f64]) = match (*model, &p[..]) {
        ("SIMPLE_PINHOLE", &[f, cx, cy]) => ((f, f), (cx, cy), &[]),
        ("PINHOLE", &[fx, fy, cx, cy]) => ((fx, fy), (cx, cy), &[]),
        ("SIMPLE_RADIAL" | "SIMPLE_RADIAL_FISHEYE", &[f, cx, cy, _]) => ((f, f), (cx, cy), &p[3..]),
        ("RADIAL" | "RADIAL_FISHEYE", &[f, cx, cy, _, _]) => ((f, f), (cx, cy), &p[3..]),
        ("OPENCV" | "OPENCV_FISHEYE", &[fx, fy, cx, cy, _, _, _, _]) => ((fx, fy), (cx, cy), &p[4..]),
        ("FULL_OPENCV", &[fx, fy, cx, cy, _, _, _, _, _, _, _, _]) => ((fx, fy), (cx, cy), &p[4..]),
        _ => {
            return Err(format!(
                "its camera model is '{}' with {} parameters, expected SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, \
                 FULL_OPENCV or a fisheye of them",
                short(model),
                p.len()
            ));
        }
    };
    Ok(CameraFile {
        file: path.to_owned(),
        size: Some(size),
        focal_px: [Some(f.0), Some(f.1)],
        angles_rad: [None; 2],
        center_px: [Some(c.0 - 0.5), Some(c.1 - 0.5)],
        distortion: Distortion::of_list(k, model.ends_with("_FISHEYE"))?,
        depth_unit_m: None,
        depth_file: None,
        notes: vec![],
    })
}

#[cfg(test)]
#[path = "camera_tests.rs"]
mod tests;
