//! The header attributes of our EXR files: units, sample pitch, camera data.

use exr::prelude::{AttributeValue, LayerAttributes, Text};

use super::light_unit::LightUnit;
use crate::{SceneError, View};

const LAYOUT_VERSION: &str = "spectralLayoutVersion";
const UNITS: &str = "emissiveUnits";
const PITCH: &str = "samplePitchUm";
const FOCAL: &str = "viewFocalPx";
const CENTER_X: &str = "viewCenterXPx";
const CENTER_Y: &str = "viewCenterYPx";
const FOV: &str = "viewHorizontalFovDeg";

/// What the header of a layer states.
#[derive(Clone, Debug)]
pub(crate) struct Attributes {
    /// Of radiance or irradiance, `None` where nothing is said; or the text of a unit that is not known.
    pub(super) unit: Result<Option<LightUnit>, String>,
    pub(crate) pitch_um: Option<f64>,
    focal_px: Option<f64>,
    center_x_px: Option<f64>,
    center_y_px: Option<f64>,
    fov_deg: Option<f64>,
}

impl Attributes {
    /// Returns the camera data; a center that is not given lies in the middle.
    pub(crate) fn view(&self, columns: usize, rows: usize) -> Result<Option<View>, SceneError> {
        let centered = |focal_px| View {
            focal_px,
            center_x_px: self.center_x_px.unwrap_or(0.5 * (columns as f64 - 1.0)),
            center_y_px: self.center_y_px.unwrap_or(0.5 * (rows as f64 - 1.0)),
        };
        let view = match (self.focal_px, self.fov_deg) {
            (Some(focal_px), _) => centered(focal_px),
            (None, Some(fov_deg)) => centered(View::from_horizontal_fov_deg(fov_deg, columns, rows)?.focal_px),
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
        Some(AttributeValue::Text(text)) => text.to_string().trim().parse().ok(),
        _ => None,
    };
    let unit = match get(UNITS) {
        // `W.m^-2.sr^-1` is what the layout's reference library writes for values a nanometre.
        Some(AttributeValue::Text(text)) => {
            let text = text.to_string();
            LightUnit::parse(&text).map(Some).ok_or(text)
        }
        _ => Ok(None),
    };
    Attributes {
        unit,
        pitch_um: number(PITCH).filter(|pitch| pitch.is_finite() && *pitch > 0.0),
        focal_px: number(FOCAL),
        center_x_px: number(CENTER_X),
        center_y_px: number(CENTER_Y),
        fov_deg: number(FOV),
    }
}

/// Adds the attributes of the spectral layout, the unit of light, the pitch and the camera data to a layer.
pub(super) fn add_to(layer: &mut LayerAttributes, unit: Option<&str>, pitch_um: Option<f64>, view: Option<View>) {
    let mut put = |name: &str, value| layer.other.insert(Text::from(name), value);
    put(LAYOUT_VERSION, AttributeValue::Text(Text::from("1.0")));
    if let Some(unit) = unit {
        put(UNITS, AttributeValue::Text(Text::from(unit)));
    }
    if let Some(pitch_um) = pitch_um {
        put(PITCH, AttributeValue::F64(pitch_um));
    }
    if let Some(view) = view {
        put(FOCAL, AttributeValue::F64(view.focal_px));
        put(CENTER_X, AttributeValue::F64(view.center_x_px));
        put(CENTER_Y, AttributeValue::F64(view.center_y_px));
    }
}

#[cfg(test)]
mod tests {
    use dioptric_spectrum::Quantity;

    use super::*;

    #[test]
    fn attributes_there_and_back() {
        let view = View { focal_px: 100.0 / 3.0, center_x_px: 1.5, center_y_px: 2.0 };
        let mut layer = LayerAttributes::default();
        add_to(&mut layer, Some("W.m^-2"), Some(1.4), Some(view));
        let back = from_layer(&layer);
        let quantity = back.unit.clone().unwrap().map(|unit| unit.quantity);
        assert_eq!((quantity, back.pitch_um), (Some(Quantity::Irradiance), Some(1.4)));
        assert_eq!(back.view(10, 10).unwrap(), Some(view));
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
