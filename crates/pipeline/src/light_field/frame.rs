//! Frames from behind an array as they come from a camera, and white pictures to even them out by.

use std::path::Path;

use dioptric_scene::read_picture_samples;
use dioptric_sensor::{DngFile, DngOpcodes, DngReading, DngRendering, Processing};
use ndarray::Array2;

use crate::PipelineError;

/// The least share of the brightest light that a white picture is divided by.
const DARKEST: f32 = 0.05;

/// A frame from behind an array, linear light.
#[derive(Clone, Debug)]
pub struct ArrayFrame {
    planes: Vec<Array2<f32>>,
    white: Option<Array2<f32>>,
    notes: Vec<String>,
}

impl ArrayFrame {
    /// Reads a frame, and divides it by the white picture that is given: one taken with the same camera of an even white surface.
    /// A DNG file's mosaic is divided and then interpolated, by no more than white balance and the file's matrix; an EXR file
    /// holds linear light. What a DNG file corrects by opcodes is left as it is.
    ///
    /// # Errors
    /// When a file cannot be read, is of another kind, or the two do not go together.
    pub fn read(frame: &Path, white: Option<&Path>) -> Result<Self, PipelineError> {
        let is_exr = |path: &Path| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr"));
        if let Some(white) = white.filter(|white| is_exr(white) != is_exr(frame)) {
            let reason = format!("is of another kind than {}, expected both DNG or both EXR files", frame.display());
            return Err(PipelineError::Read { path: white.to_owned(), reason });
        }
        if is_exr(frame) { Self::of_exr(frame, white) } else { Self::of_dng(frame, white) }
    }

    /// Light, a plane a channel.
    pub(crate) fn planes(&self) -> &[Array2<f32>] {
        &self.planes
    }

    /// The share of white light that reached each pixel, where a white picture is given.
    pub(crate) fn white(&self) -> Option<&Array2<f32>> {
        self.white.as_ref()
    }

    /// What was not taken as it stands in a file, a sentence each.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    fn of_dng(frame: &Path, white: Option<&Path>) -> Result<Self, PipelineError> {
        let reading =
            DngReading { opcodes: DngOpcodes::Ignored, rendering: DngRendering::Matrices, ..DngReading::default() };
        let mut file = DngFile::read_with(frame, &reading)?;
        let mut notes = file.notes.clone();
        let white = white.map(|path| DngFile::read_with(path, &reading)).transpose()?;
        let shares = white.as_ref().map(|white| mean(white.raw.unshaded_shares()));
        if let Some(white) = &white {
            file.raw = file.raw.flat_fielded(&white.raw)?;
            notes.extend(white.notes.iter().filter(|note| !file.notes.contains(note)).cloned());
        }
        if file.raw.saturated_fraction() > 0.0 && white.is_none() {
            notes.push(format!("{:.3} % of the frame's pixels are saturated", 100.0 * file.raw.saturated_fraction()));
        }
        let light = file.develop_linear(&Processing::plain())?.light;
        let planes = light.axis_iter(ndarray::Axis(2)).map(|plane| plane.to_owned()).collect();
        Ok(Self { planes, white: shares, notes })
    }

    fn of_exr(frame: &Path, white: Option<&Path>) -> Result<Self, PipelineError> {
        let mut notes = Vec::new();
        let mut planes = exr_planes(frame, &mut notes)?;
        let white =
            white.map(|path| Ok::<_, PipelineError>((path, mean(exr_planes(path, &mut notes)?)))).transpose()?;
        if let Some((path, white)) = &white {
            if white.dim() != planes[0].dim() {
                let ((rows, columns), (own_rows, own_columns)) = (white.dim(), planes[0].dim());
                let reason = format!("has {columns} × {rows} pixels, expected the frame's {own_columns} × {own_rows}");
                return Err(PipelineError::Read { path: (*path).to_owned(), reason });
            }
            let full = white.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
            let even = |v: &mut f32, w: &f32| *v /= (w / full).max(DARKEST);
            planes.iter_mut().for_each(|plane| plane.zip_mut_with(white, even));
        }
        Ok(Self { planes, white: white.map(|(_, white)| white), notes })
    }
}

/// Returns red, green and blue of a file, or its only plane.
fn exr_planes(path: &Path, notes: &mut Vec<String>) -> Result<Vec<Array2<f32>>, PipelineError> {
    let samples = read_picture_samples(path)?.told_in(notes);
    let named = |name: &str| samples.planes.iter().find(|(own, _)| own == name).map(|(_, plane)| plane.clone());
    if let Some(planes) = ["R", "G", "B"].map(named).into_iter().collect::<Option<Vec<_>>>() {
        return Ok(planes);
    }
    match samples.planes.as_slice() {
        [(_, plane)] => Ok(vec![plane.clone()]),
        all => {
            let names: Vec<&str> = all.iter().map(|(name, _)| name.as_str()).collect();
            let reason = format!("has the channels {}, expected R, G and B, or a single one", names.join(" "));
            Err(PipelineError::Read { path: path.to_owned(), reason })
        }
    }
}

fn mean(planes: Vec<Array2<f32>>) -> Array2<f32> {
    let n = planes.len() as f32;
    planes.into_iter().reduce(|a, b| a + b).map(|sum| sum / n).unwrap_or_default()
}
