//! What is said of a file that it does not say itself.

use std::{
    path::{Path, PathBuf},
    str::FromStr,
};

use dioptric_spectrum::Quantity;
use ndarray::{Array2, s};
use serde::{Deserialize, Serialize};

use super::light_unit::LightUnit;
use crate::SceneError;

/// What the numbers of a file mean, where it does not state it, and the depth and the view of its samples, where they are in files
/// of their own. What a file states itself cannot be contradicted.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FileReading {
    /// What the numbers of a cube are; of a picture, that its colors are those of things under a light: `Reflectance`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub quantity: Option<FileQuantity>,
    /// Their unit, as `W/m^2/sr/nm`, `uW/(cm^2 sr nm)` or `photons/s/m^2/sr/nm`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// A factor on them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
    /// The center of each band, nm, in the order of the file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wavelengths_nm: Option<Vec<f64>>,
    /// The variable of a MATLAB file, or the array of an HDF5 or `.npz` file, that holds the cube; the layer of an EXR file that holds the colors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub variable: Option<String>,
    /// The order of the axes of an array: `yxb` (rows, columns, bands) and its like.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axes: Option<String>,
    /// What becomes of samples that are no light: no numbers, infinite, negative, or what the file says to ignore; black if left
    /// out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub no_data: Option<NoData>,
    /// A file of the depth, in place of one in the scene's file or beside it: a gray picture, float TIFF, PFM, EXR or `.npy`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth: Option<PathBuf>,
    /// What 1 of the depth's numbers is: `mm`, `cm`, `m`, or so many of them a metre, as `5000/m`; of a disparity `px` or `256/px`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_unit: Option<String>,
    /// What the depth's numbers are; along the axis if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_kind: Option<DepthKind>,
    /// The channel of an EXR file, or the array of a MATLAB, HDF5 or `.npz` file, that holds the depth; the number of one of several planes of a TIFF.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_variable: Option<String>,
    /// A file of camera data, in place of one in the scene's file or beside it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub view: Option<PathBuf>,
    /// The picture is one of all directions, of which the scene is what a field of view around this one holds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub panorama: Option<Panorama>,
}

impl FileReading {
    /// Checks that each choice makes sense by itself.
    ///
    /// # Errors
    /// Names the first that does not.
    pub fn check(&self) -> Result<(), SceneError> {
        if let Some(unit) = &self.unit {
            light_unit(unit)?;
        }
        if let Some(scale) = self.scale {
            positive("the factor on the numbers of the scene", scale)?;
        }
        if let Some(unit) = &self.depth_unit {
            DepthUnit::parse(unit)?;
        }
        if let Some(kind) = self.depth_kind {
            kind.check()?;
        }
        if let Some(axes) = &self.axes {
            axis_order(axes)?;
        }
        if let Some(panorama) = self.panorama {
            panorama.check()?;
        }
        if self.wavelengths_nm.as_ref().is_some_and(Vec::is_empty) {
            return Err(setting("the wavelengths of the scene's bands", "none", "one a band, nm"));
        }
        Ok(())
    }
}

impl FileReading {
    /// Checks that the quantity told is that of the unit of light that a file states or that is told.
    ///
    /// # Errors
    /// When photons are told of a unit of energy.
    pub(super) fn check_quantity(&self, file: &Path, unit: LightUnit) -> Result<(), SceneError> {
        if self.quantity != Some(FileQuantity::Photons) || unit.is_photons() {
            return Ok(());
        }
        let reason = "its unit is one of energy, which --quantity photons contradicts: expected one of them";
        Err(SceneError::Units { file: file.to_owned(), reason: reason.to_owned() })
    }
}

/// What the numbers of a cube are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum FileQuantity {
    /// Spectral radiance, W m⁻² sr⁻¹ nm⁻¹ unless a unit says otherwise.
    Radiance,
    /// A factor of reflectance or transmittance: 1, or what the white level says, is a perfect white.
    Reflectance,
    /// Photons s⁻¹ m⁻² sr⁻¹ nm⁻¹.
    Photons,
}

impl FileQuantity {
    /// Every choice with its name on the command line.
    pub const NAMES: [(&'static str, Self); 3] =
        [("radiance", Self::Radiance), ("reflectance", Self::Reflectance), ("photons", Self::Photons)];

    /// Returns the unit of light that it has by itself; `None` for a reflectance.
    pub(super) fn light_unit(self) -> Option<LightUnit> {
        match self {
            Self::Radiance => Some(LightUnit::RADIANCE),
            Self::Photons => LightUnit::parse("photons/s/m^2/sr/nm"),
            Self::Reflectance => None,
        }
    }
}

impl FromStr for FileQuantity {
    type Err = SceneError;

    fn from_str(text: &str) -> Result<Self, SceneError> {
        named(&Self::NAMES, "the quantity of the scene's numbers", text)
    }
}

/// A picture of all directions, and where in it a camera looks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum Panorama {
    /// Twice as wide as high: columns by the angle to the right, straight ahead in the middle, rows by height, the zenith at the top.
    Equirectangular {
        /// To the right of its middle, degrees.
        #[serde(default)]
        yaw_deg: f64,
        /// Above its middle, degrees.
        #[serde(default)]
        pitch_deg: f64,
    },
    /// The six faces of a cube, seen from its middle: as a cross, 4 × 3 (left, front, right and back in a row, up and down above and below
    /// the front), or side by side or below each other (right, left, up, down, front, back), each turned as in the cross.
    Cube {
        /// To the right of the front, degrees.
        #[serde(default)]
        yaw_deg: f64,
        /// Above the front, degrees.
        #[serde(default)]
        pitch_deg: f64,
    },
}

impl Panorama {
    /// Where the camera looks: to the right, and up, degrees.
    pub(super) fn looks_deg(self) -> [f64; 2] {
        match self {
            Self::Equirectangular { yaw_deg, pitch_deg } | Self::Cube { yaw_deg, pitch_deg } => [yaw_deg, pitch_deg],
        }
    }

    /// Checks that its angles can be.
    ///
    /// # Errors
    /// When they cannot.
    pub fn check(self) -> Result<(), SceneError> {
        let [yaw_deg, pitch_deg] = self.looks_deg();
        if yaw_deg.abs() <= 360.0 && pitch_deg.abs() <= 90.0 {
            return Ok(());
        }
        let expected = "within ±360° to the right and ±90° up";
        Err(setting("where in the panorama the camera looks", &format!("{yaw_deg}°, {pitch_deg}°"), expected))
    }
}

impl FromStr for Panorama {
    type Err = SceneError;

    /// Reads `equirectangular`, `cube`, or either with `:YAW_DEG,PITCH_DEG` behind it.
    fn from_str(text: &str) -> Result<Self, SceneError> {
        let wrong = || {
            let expected = "equirectangular or cube, or either with :YAW_DEG,PITCH_DEG";
            setting("the kind of panorama", &format!("'{text}'"), expected)
        };
        let (word, numbers) = text.trim().split_once(':').unwrap_or((text.trim(), ""));
        let numbers = numbers.split(',').map(str::trim).filter(|number| !number.is_empty());
        let numbers: Vec<f64> =
            numbers.map(str::parse).collect::<Result<_, _>>().map_err(|_: std::num::ParseFloatError| wrong())?;
        let (yaw_deg, pitch_deg) = match numbers[..] {
            [] => (0.0, 0.0),
            [yaw_deg, pitch_deg] => (yaw_deg, pitch_deg),
            _ => return Err(wrong()),
        };
        let panorama = match word {
            "equirectangular" => Self::Equirectangular { yaw_deg, pitch_deg },
            "cube" => Self::Cube { yaw_deg, pitch_deg },
            _ => return Err(wrong()),
        };
        panorama.check()?;
        Ok(panorama)
    }
}

/// What becomes of samples that are no light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum NoData {
    /// They are black.
    #[default]
    Black,
    /// They get the nearest sample of their row, but negative ones, which are noise around 0, become 0.
    Fill,
    /// The scene is refused by the place of the first.
    Refuse,
}

impl NoData {
    /// Every choice with its name on the command line.
    pub const NAMES: [(&'static str, Self); 3] =
        [("black", Self::Black), ("fill", Self::Fill), ("refuse", Self::Refuse)];
}

impl FromStr for NoData {
    type Err = SceneError;

    fn from_str(text: &str) -> Result<Self, SceneError> {
        named(&Self::NAMES, "what becomes of samples without data", text)
    }
}

/// What the numbers of a depth are.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum DepthKind {
    /// The distance along the axis.
    Axial,
    /// The distance from the projection center.
    Radial,
    /// 1 over the distance along the axis.
    Inverse,
    /// Inverse distance without a scale: the largest number lies here, the smallest there.
    InverseBetween {
        /// The axial distance of the largest number, m.
        near_m: f64,
        /// The axial distance of the smallest, m; `inf` for the sky.
        far_m: f64,
    },
    /// The depth buffer of a renderer, evenly in 1 over the distance along the axis, or so many whole numbers in place of 1.
    Buffer {
        /// The axial distance of 0, m: of the near plane, or of the far one where the buffer is reversed; `inf` for none.
        near_m: f64,
        /// The axial distance of 1, m.
        far_m: f64,
    },
    /// Normalized device coordinates: as `Buffer`, from -1 to 1.
    Ndc {
        /// The axial distance of -1, m.
        near_m: f64,
        /// The axial distance of 1, m.
        far_m: f64,
    },
    /// The shift between two cameras side by side, samples: focal length × baseline / distance.
    Disparity {
        /// The distance between the cameras, m.
        baseline_m: f64,
        /// What is added to each number: the distance between the two principal points.
        #[serde(default)]
        offset_px: f64,
    },
}

impl DepthKind {
    /// Checks that its numbers make sense.
    ///
    /// # Errors
    /// Names the number that does not.
    pub fn check(self) -> Result<(), SceneError> {
        match self {
            Self::InverseBetween { near_m, far_m } if !(near_m > 0.0 && near_m.is_finite() && far_m > near_m) => {
                Err(setting("the pair of anchors of the depth", &format!("{near_m} m and {far_m} m"), "0 < near < far"))
            }
            Self::Buffer { near_m, far_m } | Self::Ndc { near_m, far_m }
                if !(near_m > 0.0 && far_m > 0.0 && near_m != far_m) =>
            {
                let value = format!("{near_m} m and {far_m} m");
                Err(setting("the pair of planes of the depth", &value, "two distances above 0"))
            }
            Self::Disparity { baseline_m, offset_px } => {
                positive("the baseline of the disparity", baseline_m)?;
                if offset_px.is_finite() {
                    return Ok(());
                }
                Err(setting("the offset of the disparity", &format!("{offset_px}"), "a finite number of samples"))
            }
            _ => Ok(()),
        }
    }
}

impl FromStr for DepthKind {
    type Err = SceneError;

    /// Reads `axial`, `radial`, `inverse`, `inverse:NEAR_M,FAR_M`, `buffer:NEAR_M,FAR_M`, `ndc:NEAR_M,FAR_M` or
    /// `disparity:BASELINE_M[,OFFSET_PX]`.
    fn from_str(text: &str) -> Result<Self, SceneError> {
        let wrong = || {
            let expected = "axial, radial, inverse, inverse:NEAR_M,FAR_M, buffer:NEAR_M,FAR_M, ndc:NEAR_M,FAR_M or \
                            disparity:BASELINE_M[,OFFSET_PX]";
            setting("the kind of depth", &format!("'{text}'"), expected)
        };
        let (word, numbers) = text.trim().split_once(':').unwrap_or((text.trim(), ""));
        let numbers = numbers.split(',').map(str::trim).filter(|number| !number.is_empty());
        let numbers: Vec<f64> =
            numbers.map(str::parse).collect::<Result<_, _>>().map_err(|_: std::num::ParseFloatError| wrong())?;
        let kind = match (word, numbers[..].as_ref()) {
            ("axial", []) => Self::Axial,
            ("radial", []) => Self::Radial,
            ("inverse", []) => Self::Inverse,
            ("inverse", &[near_m, far_m]) => Self::InverseBetween { near_m, far_m },
            ("buffer", &[near_m, far_m]) => Self::Buffer { near_m, far_m },
            ("ndc", &[near_m, far_m]) => Self::Ndc { near_m, far_m },
            ("disparity", &[baseline_m]) => Self::Disparity { baseline_m, offset_px: 0.0 },
            ("disparity", &[baseline_m, offset_px]) => Self::Disparity { baseline_m, offset_px },
            _ => return Err(wrong()),
        };
        kind.check()?;
        Ok(kind)
    }
}

/// What 1 of a depth's numbers is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum DepthUnit {
    /// So many metres.
    Metres(f64),
    /// So many samples, of a disparity.
    Samples(f64),
}

impl DepthUnit {
    /// Reads `mm`, `cm`, `m`, `px`, or so many of them in place of one: `5000/m`, `256/px`.
    pub(super) fn parse(text: &str) -> Result<Self, SceneError> {
        let wrong = || setting("the unit of the depth", &format!("'{text}'"), "mm, cm, m, 5000/m, px or 256/px");
        let (parts, unit) = match text.trim().split_once('/') {
            Some((number, unit)) => (number.trim().parse::<f64>().map_err(|_| wrong())?, unit.trim()),
            None => (1.0, text.trim()),
        };
        if !(parts > 0.0 && parts.is_finite()) {
            return Err(wrong());
        }
        Ok(match unit {
            "mm" => Self::Metres(1e-3 / parts),
            "cm" => Self::Metres(1e-2 / parts),
            "m" => Self::Metres(1.0 / parts),
            "px" => Self::Samples(1.0 / parts),
            _ => return Err(wrong()),
        })
    }
}

/// Returns for each axis of an array whether it is rows (`y`), columns (`x`) or bands (`b`).
pub(super) fn axis_order(text: &str) -> Result<[usize; 3], SceneError> {
    let place = |letter: char| text.chars().position(|c| c == letter);
    match (text.chars().count(), place('y'), place('x'), place('b')) {
        (3, Some(y), Some(x), Some(b)) => Ok([y, x, b]),
        _ => Err(setting("the order of axes", &format!("'{text}'"), "y, x and b in their order, as yxb or byx")),
    }
}

/// Returns the unit of light of a text.
pub(super) fn light_unit(text: &str) -> Result<LightUnit, SceneError> {
    let unit = LightUnit::parse(text).filter(|unit| unit.quantity == Quantity::Radiance);
    unit.ok_or_else(|| {
        let expected = "one of spectral radiance, as W/m^2/sr/nm, uW/(cm^2 sr nm) or photons/s/m^2/sr/nm";
        setting("the unit of the scene's numbers", &format!("'{text}'"), expected)
    })
}

/// The picture that camera data speaks of, of which a scene may be a part or more than all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Frame {
    pub(super) columns: usize,
    pub(super) rows: usize,
    /// The column and the row of the frame at which the scene's first sample lies.
    pub(super) x0: i64,
    pub(super) y0: i64,
    /// How many times wider a sample is than high.
    pub(super) aspect: f64,
}

impl Frame {
    /// The frame of a scene that is all of it.
    pub(super) fn whole(rows: usize, columns: usize) -> Self {
        Self { columns, rows, x0: 0, y0: 0, aspect: 1.0 }
    }

    /// Returns where so many samples lie in the smallest picture that holds them and the frame; `None` where that has no others.
    pub(super) fn place_of(self, rows: usize, columns: usize) -> Option<Place> {
        let before = |start: i64| start.max(0) as usize;
        let whole = |start: i64, n: usize, side: usize| {
            let last = (start + n as i64).max(side as i64);
            (last - start.min(0)) as usize
        };
        let place = Place {
            top: before(self.y0),
            left: before(self.x0),
            rows: whole(self.y0, rows, self.rows),
            columns: whole(self.x0, columns, self.columns),
        };
        ((place.rows, place.columns) != (rows, columns)).then_some(place)
    }

    /// Returns whether the scene has just the samples of the frame.
    pub(super) fn is_whole(self, rows: usize, columns: usize) -> bool {
        (self.x0, self.y0, self.columns, self.rows) == (0, 0, columns, rows)
    }
}

/// Where samples lie in a larger picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) top: usize,
    pub(super) left: usize,
    pub(super) rows: usize,
    pub(super) columns: usize,
}

impl Place {
    /// Returns a plane in the larger picture, which is 0 elsewhere.
    pub(super) fn pad(self, plane: &Array2<f32>) -> Array2<f32> {
        let (rows, columns) = plane.dim();
        let mut padded = Array2::zeros((self.rows, self.columns));
        padded.slice_mut(s![self.top..self.top + rows, self.left..self.left + columns]).assign(plane);
        padded
    }

    /// Returns depths in the larger picture, elsewhere those of the nearest sample.
    pub(super) fn pad_depth(self, plane: &Array2<f32>) -> Array2<f32> {
        let (rows, columns) = plane.dim();
        Array2::from_shape_fn((self.rows, self.columns), |(row, column)| {
            let row = row.saturating_sub(self.top).min(rows - 1);
            plane[(row, column.saturating_sub(self.left).min(columns - 1))]
        })
    }
}

fn named<T: Copy>(names: &[(&'static str, T)], what: &'static str, text: &str) -> Result<T, SceneError> {
    let found = names.iter().find(|(name, _)| *name == text.trim());
    found.map(|(_, value)| *value).ok_or_else(|| {
        let expected = names.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
        setting(what, &format!("'{text}'"), &expected)
    })
}

fn positive(what: &'static str, value: f64) -> Result<(), SceneError> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(setting(what, &value.to_string(), "a finite number above 0"))
}

fn setting(what: &'static str, value: &str, expected: &str) -> SceneError {
    SceneError::Setting { what, value: value.to_owned(), expected: expected.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_read() {
        assert_eq!("photons".parse(), Ok(FileQuantity::Photons));
        assert_eq!("fill".parse(), Ok(NoData::Fill));
        assert_eq!("radial".parse(), Ok(DepthKind::Radial));
        assert_eq!("inverse:0.5,inf".parse(), Ok(DepthKind::InverseBetween { near_m: 0.5, far_m: f64::INFINITY }));
        let middlebury = DepthKind::Disparity { baseline_m: 0.193, offset_px: 31.08 };
        assert_eq!("disparity:0.193,31.08".parse(), Ok(middlebury));
        assert_eq!(DepthUnit::parse("5000/m"), Ok(DepthUnit::Metres(2e-4)));
        assert_eq!(DepthUnit::parse("mm"), Ok(DepthUnit::Metres(1e-3)));
        assert_eq!(DepthUnit::parse("256/px"), Ok(DepthUnit::Samples(1.0 / 256.0)));
        assert_eq!(axis_order("bxy"), Ok([2, 1, 0]));
    }

    #[test]
    fn samples_lie_where_their_frame_has_them() {
        let frame = Frame { columns: 6, rows: 4, x0: 4, y0: -1, aspect: 1.0 };
        // Columns 4 and 5 of 6, and a row above the frame.
        let place = frame.place_of(3, 2).unwrap();
        assert_eq!(place, Place { top: 0, left: 4, rows: 5, columns: 6 });
        let plane = place.pad(&Array2::from_elem((3, 2), 1.0));
        assert_eq!((plane.sum(), plane[(0, 4)], plane[(2, 5)], plane[(3, 5)]), (6.0, 1.0, 1.0, 0.0));
        assert_eq!(place.pad_depth(&ndarray::arr2(&[[1.0, 2.0]; 3])).row(4).to_vec(), [1.0, 1.0, 1.0, 1.0, 1.0, 2.0]);
        // More samples than the frame has need no others.
        assert_eq!(Frame { columns: 6, rows: 4, x0: -2, y0: -1, aspect: 1.0 }.place_of(8, 10), None);
    }

    #[test]
    fn words_that_are_none_are_refused() {
        for text in [
            "",
            "inverse:1",
            "inverse:2,1",
            "disparity",
            "disparity:0",
            "axial:1",
            "inverse:a,b",
            "z",
            "buffer:1",
            "ndc:0,1",
        ] {
            assert!(text.parse::<DepthKind>().is_err(), "{text}");
        }
        for text in ["", "0/m", "-1/m", "nan/m", "inch", "/m", "5000"] {
            assert!(DepthUnit::parse(text).unwrap_err().to_string().contains("5000/m"), "{text}");
        }
        for text in ["", "yx", "yxbb", "yyb", "abc"] {
            assert!(axis_order(text).is_err(), "{text}");
        }
        let wrong = FileReading { unit: Some("lm".to_owned()), ..FileReading::default() };
        assert!(wrong.check().unwrap_err().to_string().contains("'lm'"));
        assert!(FileReading { scale: Some(0.0), ..FileReading::default() }.check().is_err());
    }
}
