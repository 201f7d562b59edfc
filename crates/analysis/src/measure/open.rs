//! Pictures opened to be measured, in linear light.

use std::{fs::File, io::Read, path::Path};

use dioptric_scene::{PictureSamples, notes_on_samples, read_picture_samples};
use dioptric_sensor::{ColorSpace, DngFile, Picture, Tile};
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
    /// Each channel with its name; the highest code of a file of whole numbers is 1, saturation of a raw file.
    pub planes: Vec<(String, Array2<f32>)>,
    /// The mosaic of the single plane of a raw file, and the names of its filters.
    pub mosaic: Option<(Tile, Vec<String>)>,
}

/// Returns the raw frame of a file that is a DNG, whose first picture is but a preview; `None` for other files.
///
/// # Errors
/// When it begins as a DNG does and cannot be read.
pub(crate) fn read_dng(path: &Path) -> Result<Option<DngFile>, PipelineError> {
    let mut head = [0; 4];
    let is_tiff = File::open(path).and_then(|mut file| file.read_exact(&mut head)).is_ok()
        && [*b"II*\0", *b"MM\0*"].contains(&head);
    if !is_tiff || !std::fs::read(path).is_ok_and(|bytes| DngFile::is_dng(&bytes)) {
        return Ok(None);
    }
    Ok(Some(DngFile::read(path)?))
}

/// Returns what of a picture's statements is not used when it is measured, a sentence each: another color space than sRGB, and how it is
/// turned.
pub fn notes_on_picture(path: &Path) -> Vec<String> {
    notes_on_samples(path)
}

impl MeasuredPicture {
    /// Opens a PNG, JPEG, TIFF or EXR file, or the raw frame of a DNG: linear, and corrected as far as the file asks before demosaicing.
    ///
    /// # Errors
    /// When the file cannot be read, is empty or holds samples that are not finite.
    pub fn open(path: &Path, curve: CodeCurve) -> Result<Self, PipelineError> {
        if let Some(DngFile { raw, .. }) = read_dng(path)? {
            let (planes, names) = (raw.linear(), raw.filter_names);
            // One filter everywhere is no mosaic.
            let tile = raw.tile.filter(|_| names.len() > 1);
            let named = if tile.is_some() { vec!["raw".to_owned()] } else { names.clone() };
            return Ok(Self {
                name: path.display().to_string(),
                planes: named.into_iter().zip(planes).collect(),
                mosaic: tile.map(|tile| (tile, names)),
            });
        }
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
        Ok(Self { name: path.display().to_string(), planes, mosaic: None })
    }

    /// Refuses a mosaic, whose pixels are not all of one filter.
    ///
    /// # Errors
    /// When the picture is the frame of a raw file with a mosaic.
    pub(crate) fn require_whole(&self) -> Result<(), PipelineError> {
        if self.mosaic.is_none() {
            return Ok(());
        }
        let reason =
            "holds a mosaic, of whose pixels each has one filter, expected a picture: `dioptric develop` makes one";
        Err(PipelineError::Read { path: self.name.clone().into(), reason: reason.to_owned() })
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
    /// When the picture has other channels, or is a mosaic.
    pub fn rgb(&self) -> Result<Array3<f32>, PipelineError> {
        self.require_whole()?;
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
        Ok(Picture { codes, space: ColorSpace::Srgb })
    }
}
