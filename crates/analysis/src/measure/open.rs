//! Pictures opened to be measured, in linear light.

use std::path::Path;

use dioptric_scene::{PictureSamples, read_picture_samples};
use dioptric_sensor::Picture;
use dioptric_spectrum::{Xyz, srgb_decode, srgb_encode};
use ndarray::{Array2, Array3};

use dioptric_pipeline::PipelineError;

/// How a picture's samples stand for light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CodeCurve {
    /// Linear for 16-bit gray (raw frames) and floating-point samples, the curve of sRGB for everything else.
    #[default]
    ByFile,
    /// Linear.
    Linear,
    /// The curve of sRGB.
    Srgb,
}

/// A picture in linear light.
#[derive(Clone, Debug)]
pub struct MeasuredPicture {
    /// The file.
    pub name: String,
    /// Each channel with its name; the highest code of a file of whole numbers is 1.
    pub planes: Vec<(String, Array2<f32>)>,
}

impl MeasuredPicture {
    /// Opens a PNG, JPEG, TIFF or EXR file.
    ///
    /// # Errors
    /// When the file cannot be read, is empty or holds samples that are not finite.
    pub fn open(path: &Path, curve: CodeCurve) -> Result<Self, PipelineError> {
        let PictureSamples { planes, top } = read_picture_samples(path)?;
        let wrong = |reason: &str| PipelineError::Read { path: path.to_owned(), reason: reason.to_owned() };
        if planes.first().is_none_or(|(_, plane)| plane.is_empty()) {
            return Err(wrong("it has no pixels"));
        }
        if planes.iter().any(|(_, plane)| plane.iter().any(|v| !v.is_finite())) {
            return Err(wrong("a sample is not finite"));
        }
        let is_coded = match curve {
            CodeCurve::Linear => false,
            CodeCurve::Srgb => true,
            CodeCurve::ByFile => top.is_some_and(|top| top == u16::from(u8::MAX) || planes.len() > 1),
        };
        let scale = top.map_or(1.0, |top| 1.0 / f32::from(top));
        let linear = |v: f32| if is_coded { srgb_decode(f64::from(v * scale)) as f32 } else { v * scale };
        let planes = planes.into_iter().map(|(name, plane)| (name, plane.mapv(linear))).collect();
        Ok(Self { name: path.display().to_string(), planes })
    }

    /// Rows and columns.
    pub fn size(&self) -> (usize, usize) {
        self.planes[0].1.dim()
    }

    /// Returns the channel of a name.
    fn plane(&self, name: &str) -> Option<&Array2<f32>> {
        self.planes.iter().find(|(own, _)| own == name).map(|(_, plane)| plane)
    }

    /// Returns the three channels R, G and B, or one gray channel three times; rows × columns × 3.
    ///
    /// # Errors
    /// When the picture has other channels.
    pub fn rgb(&self) -> Result<Array3<f32>, PipelineError> {
        let planes = match (self.plane("R"), self.plane("G"), self.plane("B"), self.planes.as_slice()) {
            (Some(r), Some(g), Some(b), _) => [r, g, b],
            (_, _, _, [(_, gray)]) => [gray; 3],
            _ => {
                let names: Vec<&str> = self.planes.iter().map(|(name, _)| name.as_str()).collect();
                let reason = format!("its channels are {}, expected R, G and B or a single one", names.join(", "));
                return Err(PipelineError::Read { path: self.name.clone().into(), reason });
            }
        };
        let (rows, columns) = self.size();
        Ok(Array3::from_shape_fn((rows, columns, 3), |(r, c, k)| planes[k][(r, c)]))
    }

    /// Returns the luminance where there are R, G and B, else the mean of all channels.
    pub fn luminance(&self) -> Array2<f32> {
        match (self.plane("R"), self.plane("G"), self.plane("B")) {
            (Some(r), Some(g), Some(b)) => Array2::from_shape_fn(self.size(), |at| {
                Xyz::from_linear_srgb([r[at], g[at], b[at]].map(f64::from)).luminance_cd_m2() as f32
            }),
            _ => {
                let mut sum = Array2::zeros(self.size());
                self.planes.iter().for_each(|(_, plane)| sum += plane);
                sum / self.planes.len() as f32
            }
        }
    }

    /// Returns the picture as sRGB codes of 0–1.
    ///
    /// # Errors
    /// As [`rgb`](Self::rgb).
    pub fn coded(&self) -> Result<Picture, PipelineError> {
        let codes = self.rgb()?.mapv(|v| srgb_encode(f64::from(v.clamp(0.0, 1.0))) as f32);
        Ok(Picture { codes })
    }
}
