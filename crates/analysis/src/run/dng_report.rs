//! Numbers of a raw file and its picture.

use dioptric_pipeline::DevelopedFile;
use dioptric_sensor::{DngProfile, DngShot, MaskedSamples, Processing, WhiteBalance};
use dioptric_spectrum::ColorTemperature;
use serde::Serialize;

/// What a raw file holds and what was made of it, as `report.json` of `dioptric develop` has it.
#[derive(Clone, Debug, Serialize)]
pub struct DngReport {
    /// The camera and how it was set.
    #[serde(flatten)]
    pub shot: DngShot,
    /// Columns and rows that are stored.
    pub stored_px: (usize, usize),
    /// The first column and row that are shown.
    pub origin_px: (usize, usize),
    /// Columns and rows that are shown.
    pub shown_px: (usize, usize),
    /// How the picture is turned (Exif, 1 to 8).
    pub orientation: usize,
    /// The bits of a stored sample.
    pub bits: u32,
    /// The mosaic from the first pixel shown, a text a row; none where every pixel has all filters.
    pub mosaic: Option<Vec<String>>,
    /// The sample of no light.
    pub black: f64,
    /// The sample at saturation.
    pub white: f64,
    /// The share of samples at saturation.
    pub saturated_fraction: f64,
    /// What the file states of the camera: filters, colors, noise.
    pub camera: DngProfile,
    /// What its masked pixels hold; none where it has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub masked: Option<MaskedSamples>,
    /// What each filter gives of the white of the shot, by the camera.
    pub neutral: Option<Vec<f64>>,
    /// The correlated color temperature of what was made white, K; none where the file has no colors.
    pub white_kelvin: Option<f64>,
    /// Factor on each channel that made white neutral.
    pub white_balance: Vec<f64>,
    /// The matrix from balanced channels to linear sRGB.
    pub color_matrix: [Vec<f64>; 3],
    /// The factor on linear light.
    pub brightness: f64,
    /// The processing.
    pub processing: Processing,
    /// The corrections that the file asks for and that were made, by the names of their opcodes.
    pub opcodes: Vec<String>,
    /// What the file asks for and was not done, a sentence each.
    pub notes: Vec<String>,
}

impl DngReport {
    /// Returns the numbers of a developed file.
    pub fn new(of: &DevelopedFile) -> Self {
        let DevelopedFile { file, processing, developed } = of;
        let raw = &file.raw;
        let (rows, columns) = raw.size();
        let row = |tile: &dioptric_sensor::Tile, row: usize| -> String {
            tile.row(row).iter().map(|&filter| raw.filter_names[filter].as_str()).collect()
        };
        let neutral: Vec<f64> = developed.balance.iter().map(|gain| 1.0 / gain).collect();
        let white = file.profile.color.as_ref().map(|color| color.white_of(&neutral));
        Self {
            shot: file.shot.clone(),
            stored_px: file.stored,
            origin_px: file.origin,
            shown_px: (columns, rows),
            orientation: file.orientation,
            bits: file.bits,
            mosaic: raw.tile.as_ref().map(|tile| (0..tile.rows()).map(|r| row(tile, r)).collect()),
            black: raw.levels.black,
            white: raw.levels.white,
            saturated_fraction: raw.saturated_fraction(),
            camera: file.profile.clone(),
            masked: file.masked.clone(),
            neutral: file.neutral.clone(),
            white_kelvin: white.map(|xy| ColorTemperature::of_chromaticity(xy).kelvin),
            white_balance: developed.balance.clone(),
            color_matrix: developed.color.rows.clone(),
            brightness: developed.brightness,
            processing: processing.clone(),
            opcodes: file.opcodes.clone(),
            notes: file.notes.iter().cloned().chain(file.left_out()).chain(white_note(of)).collect(),
        }
    }
}

/// Returns the note on a white that the file does not tell.
fn white_note(of: &DevelopedFile) -> Option<String> {
    let is_untold = of.file.neutral.is_none() && of.file.raw.filter_names.len() > 1;
    (is_untold && of.processing.white == WhiteBalance::Scene).then(|| {
        "the file does not tell the white of the shot (AsShotNeutral or AsShotWhiteXY): the mean of the frame was made gray".to_owned()
    })
}
