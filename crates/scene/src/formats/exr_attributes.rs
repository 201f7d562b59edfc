//! The header attributes of our EXR files: units, sample pitch, camera data.

use std::path::Path;

use exr::{
    meta::attribute::EnvironmentMap,
    prelude::{AttributeValue, LayerAttributes, Text},
};

use super::{
    camera::SAME_FOCAL,
    light_unit::LightUnit,
    stated::{Stated, name_of, short, tells},
};
use crate::{SceneError, SceneLight, View};

const LAYOUT_VERSION: &str = "spectralLayoutVersion";
const UNITS: &str = "emissiveUnits";
const PITCH: &str = "samplePitchUm";
const FOCAL: &str = "viewFocalPx";
const CENTER_X: &str = "viewCenterXPx";
const CENTER_Y: &str = "viewCenterYPx";
const FOV: &str = "viewHorizontalFovDeg";
/// The light on a scene, as JSON.
const LIGHT: &str = "sceneLight";
/// The luminance of a white of 1.
pub(super) const WHITE: &str = "whiteLuminance";

/// What the header of a layer states.
#[derive(Clone, Debug)]
pub(crate) struct Attributes {
    /// Of radiance or irradiance, `None` where nothing is said; or the text of a unit that is not known.
    pub(super) unit: Result<Option<LightUnit>, String>,
    /// The words of that unit.
    unit_words: Option<String>,
    /// Whether it is in the layout that understands a nanometre where no length of wavelength is named.
    is_in_layout: bool,
    pub(crate) pitch_um: Option<f64>,
    focal_px: Option<f64>,
    center_x_px: Option<f64>,
    center_y_px: Option<f64>,
    fov_deg: Option<f64>,
    /// The light on the scene; or what is wrong with it.
    pub(super) light: Result<Option<SceneLight>, String>,
    /// The luminance of red, green and blue of 1, cd/m².
    pub(super) white_cd_m2: Option<f64>,
    /// Of what kind the picture is, where it is one of all directions.
    pub(super) environment: Option<EnvironmentMap>,
    /// What else there is.
    pub(super) others: Stated<()>,
}

/// Attributes that change nothing of what a picture is: who made it when, with what, and how it was rendered.
pub(super) fn is_harmless(name: &str) -> bool {
    const NAMES: [&str; 27] = [
        "BlenderMultiChannel",
        "Camera",
        "Date",
        "DateTime",
        "File",
        "Frame",
        "RenderTime",
        "Scene",
        "Time",
        "Note",
        "Software",
        "software",
        "Copyright",
        "comments",
        "generatedBy",
        "version",
        "log",
        "samplesPerPixel",
        "renderTimeSeconds",
        "MSE",
        "cameraFromWorld",
        "NDCFromWorld",
        "worldFromCamera",
        "worldToCamera",
        "compressionLevel",
        "scanlineimage",
        "dwaCompressionLevel",
    ];
    // What Exif says of the view and the colors.
    const VIEW: [&str; 5] = ["FocalLength", "FocalLengthIn35mmFilm", "SubjectDistance", "Gamma", "ColorSpace"];
    const STARTS: [&str; 8] = ["oiio:", "nuke/", "cycles.", "Exif", "exif", "IPTC:", "input/", "cryptomatte/"];
    let is_usual = NAMES.contains(&name) || STARTS.iter().any(|start| name.starts_with(start));
    let is_of_view = name.split_once([':', '.', '_']).is_some_and(|(_, own)| VIEW.contains(&own));
    is_usual && !is_of_view && !COLOR_SPACES.iter().any(|own| name.starts_with(own))
}

/// What says of the colors which they are: `OpenImageIO`'s attribute, and that of the Color Interop Forum.
const COLOR_SPACES: [&str; 2] = ["oiio:ColorSpace", "colorInteropID"];

/// Whether a color space of `OpenImageIO` is what linear colors of an EXR file are without a word: of sRGB's primaries.
fn is_linear_srgb(text: &str) -> bool {
    let plain: String = text.chars().filter(char::is_ascii_alphanumeric).collect::<String>().to_lowercase();
    const NAMES: [&str; 12] = [
        "",
        "linear",
        "scenelinear",
        "linsrgb",
        "linsrgbscene",
        "linrec709",
        "linrec709srgb",
        "linrec709scene",
        "linearsrgb",
        "linearrec709",
        "linearrec709srgb",
        "utilitylinearsrgb",
    ];
    NAMES.contains(&plain.as_str())
}

/// Returns a text of a header, which is UTF-8 or, where it cannot be, Latin-1.
pub(super) fn words_of(text: &Text) -> String {
    String::from_utf8(text.as_slice().to_vec()).unwrap_or_else(|_| text.to_string())
}

impl Attributes {
    /// Returns what is known of them, without what else there is.
    pub(super) fn known(&self) -> Self {
        Self { others: Stated::new("attribute", vec![]), ..self.clone() }
    }

    /// Takes unit and brightness of another part of the picture where it states none of its own.
    pub(super) fn inherit(&mut self, first: &Self) {
        if self.unit == Ok(None) {
            self.unit.clone_from(&first.unit);
            self.unit_words.clone_from(&first.unit_words);
            self.is_in_layout = first.is_in_layout;
        }
        self.white_cd_m2 = self.white_cd_m2.or(first.white_cd_m2);
    }

    /// Returns the unit in the file's words, with the nanometre that is understood; `None` where nothing is stated.
    pub(super) fn told_unit(&self) -> Option<String> {
        let words = self.unit_words.as_ref()?;
        let understood = if LightUnit::lacks_wavelength(words) { ", a nanometre" } else { "" };
        Some(short(words) + understood)
    }

    /// Returns what is understood of a unit that does not state it, outside the layout that says so.
    pub(super) fn note_of_unit(&self, path: &Path) -> Option<String> {
        let words =
            self.unit_words.as_ref().filter(|words| !self.is_in_layout && LightUnit::lacks_wavelength(words))?;
        Some(format!(
            "{}: its {UNITS} '{}' names no length of wavelength: a nanometre is understood",
            name_of(path),
            short(words)
        ))
    }

    /// Returns what is taken in place of camera data that the header should state beside its focal length.
    pub(super) fn note_of_center(&self, path: &Path) -> Option<String> {
        let is_whole = self.center_x_px.is_some() && self.center_y_px.is_some();
        (self.focal_px.is_some() && !is_whole).then(|| {
            format!("{}: it does not state {CENTER_X} and {CENTER_Y}: its axis is taken for the middle", name_of(path))
        })
    }

    /// Returns the names of what a part of the same picture states otherwise, which is not used.
    pub(super) fn other_of(&self, part: &Self) -> Vec<String> {
        let numbers = [
            (PITCH, self.pitch_um, part.pitch_um),
            (FOCAL, self.focal_px, part.focal_px),
            (CENTER_X, self.center_x_px, part.center_x_px),
            (CENTER_Y, self.center_y_px, part.center_y_px),
            (FOV, self.fov_deg, part.fov_deg),
            (WHITE, self.white_cd_m2, part.white_cd_m2),
        ];
        let is_other = |own: Option<f64>, theirs: Option<f64>| theirs.is_some() && theirs != own;
        let numbers = numbers.into_iter().filter(|(_, own, theirs)| is_other(*own, *theirs)).map(|(name, ..)| name);
        let light = (part.light != Ok(None) && part.light != self.light).then_some(LIGHT);
        numbers.chain(light).map(str::to_owned).collect()
    }

    /// Returns the camera data; a center that is not given lies in the middle.
    pub(crate) fn view(&self, columns: usize, rows: usize) -> Result<Option<View>, SceneError> {
        let centered = |focal_px| View {
            focal_px,
            center_x_px: self.center_x_px.unwrap_or(0.5 * (columns as f64 - 1.0)),
            center_y_px: self.center_y_px.unwrap_or(0.5 * (rows as f64 - 1.0)),
        };
        let of_angle = |fov_deg| View::from_horizontal_fov_deg(fov_deg, columns, rows).map(|view| view.focal_px);
        let view = match (self.focal_px, self.fov_deg.map(of_angle).transpose()?) {
            (Some(own), Some(other)) if (own / other - 1.0).abs() > SAME_FOCAL => {
                return Err(SceneError::Setting {
                    what: FOCAL,
                    value: format!("{own} px, and {FOV} makes it {other:.2} px"),
                    expected: "one of them, or both alike".to_owned(),
                });
            }
            (Some(own), _) => centered(own),
            (None, Some(other)) => centered(other),
            (None, None) => return Ok(None),
        };
        view.check()?;
        Ok(Some(view))
    }
}

/// Returns what the attributes of a layer state.
pub(crate) fn from_layer(layer: &LayerAttributes) -> Attributes {
    let get = |name: &str| layer.other.get(&Text::from(name));
    let number = |name: &str| match get(name) {
        Some(&AttributeValue::F64(value)) => Some(value),
        Some(&AttributeValue::F32(value)) => Some(f64::from(value)),
        Some(AttributeValue::Text(text)) => words_of(text).trim().parse().ok(),
        _ => None,
    };
    let unit_words = match get(UNITS) {
        Some(AttributeValue::Text(text)) => Some(words_of(text)),
        _ => None,
    };
    // `W.m^-2.sr^-1` is what the layout's reference library writes for values a nanometre.
    let unit = unit_words.as_ref().map(|text| LightUnit::parse(text).ok_or_else(|| text.clone())).transpose();
    let ours = [LAYOUT_VERSION, UNITS, PITCH, FOCAL, CENTER_X, CENTER_Y, FOV, LIGHT];
    let own = layer.other.keys().map(words_of).filter(|name| !ours.contains(&name.as_str()));
    let own = own.filter_map(|name| match get(&name).filter(|_| COLOR_SPACES.contains(&name.as_str())) {
        Some(AttributeValue::Text(text)) if is_linear_srgb(&words_of(text)) => None,
        Some(AttributeValue::Text(text)) => Some(format!("{name} ({})", words_of(text))),
        _ => match get(&name) {
            Some(AttributeValue::Text(text)) if is_harmless(&name) && tells(&words_of(text)) => {
                Some(format!("{name} '{}'", short(&words_of(text))))
            }
            _ => Some(name),
        },
    });
    // Attributes of the standard that would change where or how bright things are.
    let standard = [
        ("adoptedNeutral", layer.adopted_neutral.is_some()),
        ("lookModTransform", layer.look_modification_transform_name.is_some()),
        ("renderingTransform", layer.rendering_transform_name.is_some()),
        ("multiView", layer.multi_view_names.is_some()),
        ("near", layer.near_clip_plane.is_some()),
        ("far", layer.far_clip_plane.is_some()),
        ("fieldOfViewHorizontal", layer.horizontal_field_of_view.is_some()),
        ("fieldOfViewVertical", layer.vertical_field_of_view.is_some()),
        ("screenWindowWidth", layer.screen_window_width != 1.0),
        ("screenWindowCenter", layer.screen_window_center.0 != 0.0 || layer.screen_window_center.1 != 0.0),
    ];
    let comments = layer.comments.as_ref().map(words_of).filter(|text| tells(text));
    let comments = comments.map(|text| format!("comments '{}'", short(&text)));
    let standard = standard.into_iter().filter(|(_, is_there)| *is_there).map(|(name, _)| name.to_owned());
    let is_text = |name: &str| matches!(get(name), Some(AttributeValue::Text(_)));
    // Ours whose values are none that can stand there.
    let unfit = [PITCH, FOCAL, CENTER_X, CENTER_Y, FOV].into_iter().filter(|name| number(name).is_none());
    let unfit = unfit.chain([UNITS, LIGHT].into_iter().filter(|name| !is_text(name)));
    let white = layer.white_luminance.map(f64::from);
    let is_white = |white: &f64| white.is_finite() && *white > 0.0;
    let unfit = unfit.filter(|name| get(name).is_some()).chain(white.filter(|own| !is_white(own)).map(|_| WHITE));
    let unfit = unfit.map(|name| format!("{name}, which is no likely value"));
    let mut others: Vec<String> = own.chain(standard).chain(comments).chain(unfit).collect();
    others.sort();
    let light = match get(LIGHT) {
        Some(AttributeValue::Text(text)) => {
            let light = serde_json::from_str::<SceneLight>(&words_of(text)).map_err(|error| error.to_string());
            let is_light =
                |light: SceneLight| light.illuminant.check().map(|()| light).map_err(|error| error.to_string());
            light.and_then(is_light).map(Some)
        }
        _ => Ok(None),
    };
    Attributes {
        light,
        unit_words,
        is_in_layout: get(LAYOUT_VERSION).is_some(),
        white_cd_m2: white.filter(is_white),
        environment: layer.environment_map,
        others: Stated::new("attribute", others.into_iter().map(|name| (name, ())).collect()),
        unit,
        pitch_um: number(PITCH).filter(|pitch| pitch.is_finite() && *pitch > 0.0),
        focal_px: number(FOCAL),
        center_x_px: number(CENTER_X),
        center_y_px: number(CENTER_Y),
        fov_deg: number(FOV),
    }
}

/// Adds the attributes of the spectral layout, the unit of light, the pitch, the camera data and the light on the scene to a layer.
pub(super) fn add_to(
    layer: &mut LayerAttributes,
    unit: Option<&str>,
    pitch_um: Option<f64>,
    view: Option<View>,
    light: Option<&SceneLight>,
) {
    let mut put = |name: &str, value| layer.other.insert(Text::from(name), value);
    put(LAYOUT_VERSION, AttributeValue::Text(Text::from("1.0")));
    if let Some(unit) = unit {
        put(UNITS, AttributeValue::Text(Text::from(unit)));
    }
    if let Some(pitch_um) = pitch_um {
        put(PITCH, AttributeValue::F64(pitch_um));
    }
    if let Some(light) = light.and_then(|light| serde_json::to_string(light).ok()) {
        put(LIGHT, AttributeValue::Text(Text::from(light.as_str())));
    }
    if let Some(view) = view {
        put(FOCAL, AttributeValue::F64(view.focal_px));
        put(CENTER_X, AttributeValue::F64(view.center_x_px));
        put(CENTER_Y, AttributeValue::F64(view.center_y_px));
    }
}

#[cfg(test)]
mod tests {
    use dioptric_spectrum::{Illuminant, Quantity};

    use super::*;

    #[test]
    fn attributes_there_and_back() {
        let view = View { focal_px: 100.0 / 3.0, center_x_px: 1.5, center_y_px: 2.0 };
        let mut layer = LayerAttributes::default();
        let light = SceneLight::new(Illuminant::Chromaticity { x: 0.4, y: 0.41 }, 100.0 / 3.0);
        add_to(&mut layer, Some("W.m^-2"), Some(1.4), Some(view), Some(&light));
        let back = from_layer(&layer);
        let quantity = back.unit.clone().unwrap().map(|unit| unit.quantity);
        assert_eq!((quantity, back.pitch_um), (Some(Quantity::Irradiance), Some(1.4)));
        assert_eq!(back.view(10, 10).unwrap(), Some(view));
        assert_eq!(back.light, Ok(Some(light)));
    }

    #[test]
    fn other_colors_are_named() {
        let names = |key: &str, space: &str| {
            let mut layer = LayerAttributes::default();
            layer.other.insert(Text::from(key), AttributeValue::Text(Text::from(space)));
            let stated = from_layer(&layer).others;
            stated.names().filter(|name| !is_harmless(name)).map(str::to_owned).collect::<Vec<_>>()
        };
        for key in COLOR_SPACES {
            for space in ["Linear", "lin_rec709", "Linear Rec.709 (sRGB)", "scene_linear", "lin_rec709_scene"] {
                assert_eq!(names(key, space), Vec::<String>::new(), "{space}");
            }
            for space in ["ACEScg", "sRGB", "Rec709", "lin_ap1_scene", "srgb_rec709_scene"] {
                assert_eq!(names(key, space), [format!("{key} ({space})")]);
            }
        }
    }

    #[test]
    fn a_field_of_view_does_instead_of_a_focal_length() {
        let mut layer = LayerAttributes::default();
        layer.other.insert(Text::from(FOV), AttributeValue::F32(40.0));
        let view = from_layer(&layer).view(200, 100).unwrap().unwrap();
        assert_eq!(view, View::from_horizontal_fov_deg(40.0, 200, 100).unwrap());
        layer.other.insert(Text::from(FOV), AttributeValue::F32(400.0));
        assert!(from_layer(&layer).view(200, 100).is_err());
    }
}
