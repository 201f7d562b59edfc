//! The frames of one exposure as files: electrons, volts, raw and picture, in the formats asked for.

use std::{fs, path::Path};

use dioptric_scene::{ExrSamples, write_planes_exr};
use dioptric_sensor::{
    Depth, DngDetails, ElectronRate, ExitPupil, Exposure, LensTables, OpticalFilter, Picture, Processing, Raw, Sensor,
};
use dioptric_spectrum::{Illuminant, WavelengthGrid};
use ndarray::{Array2, Axis};
use serde::{Deserialize, Serialize};

use crate::{Exposed, PipelineError};

/// What is written besides the picture and the report.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Outputs {
    /// `irradiance.exr`, the spectral irradiance on the sensor; of photodiodes that are read one by one also `irradiance-left.exr` and so on.
    pub irradiance: bool,
    /// `depth.exr`, the depth that was used.
    pub depth: bool,
    /// `volts.exr`, the voltages of the pixels.
    pub volts: bool,
    /// `raw.png`, the digital numbers in 16 bits; of photodiodes that are read one by one also `raw-left.png` and so on, of the small ones of split
    /// pixels `raw-small.png`.
    pub raw: bool,
    /// More files of the sensor's frames.
    pub also: Vec<FrameFile>,
    /// How samples are stored in all EXR files. A run that continues from half floats is off by as much as they are.
    pub exr_samples: ExrSamples,
}

impl Default for Outputs {
    /// Everything but the additional files.
    fn default() -> Self {
        Self {
            irradiance: true,
            depth: true,
            volts: true,
            raw: true,
            also: Vec::new(),
            exr_samples: ExrSamples::Single,
        }
    }
}

/// A file of a sensor's frame or of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum FrameFile {
    /// `electrons.exr`: the electrons of each pixel.
    Electrons,
    /// `raw.tiff`: the digital numbers, 16 bits.
    RawTiff,
    /// `raw.dng`: the digital numbers with mosaic, levels and color matrices; of single photodiodes also `raw-left.dng` and so on.
    RawDng,
    /// `picture-16.png`: the picture, 16 bits.
    PicturePng16,
    /// `picture-8.tiff`: the picture, 8 bits.
    PictureTiff8,
    /// `picture-16.tiff`: the picture, 16 bits.
    PictureTiff16,
    /// `picture.exr`: the picture's light in the primaries of sRGB, linear and not clipped.
    PictureExr,
}

impl FrameFile {
    /// Every additional file with its name on the command line.
    pub const NAMES: [(&'static str, Self); 7] = [
        ("electrons", Self::Electrons),
        ("raw-tiff", Self::RawTiff),
        ("raw-dng", Self::RawDng),
        ("picture-png16", Self::PicturePng16),
        ("picture-tiff8", Self::PictureTiff8),
        ("picture-tiff16", Self::PictureTiff16),
        ("picture-exr", Self::PictureExr),
    ];

    /// The name of the file on the command line.
    pub fn name(self) -> &'static str {
        Self::NAMES.iter().find(|(_, file)| *file == self).map_or("", |(name, _)| name)
    }

    /// Returns the name and the depth of a picture of codes; `None` for other files.
    pub(crate) fn picture_name(self) -> Option<(&'static str, Depth)> {
        match self {
            Self::PicturePng16 => Some(("picture-16.png", Depth::Sixteen)),
            Self::PictureTiff8 => Some(("picture-8.tiff", Depth::Eight)),
            Self::PictureTiff16 => Some(("picture-16.tiff", Depth::Sixteen)),
            Self::Electrons | Self::RawTiff | Self::RawDng | Self::PictureExr => None,
        }
    }

    /// Returns the files of a list of names, separated by commas.
    ///
    /// # Errors
    /// Names the word that is no such file, and those that are.
    pub fn parse_list(text: &str) -> Result<Vec<Self>, PipelineError> {
        let known = || Self::NAMES.map(|(name, _)| name).join(", ");
        let file = |word: &str| {
            Self::NAMES.iter().find(|(name, _)| *name == word.trim()).map(|(_, file)| *file).ok_or_else(|| {
                PipelineError::Value {
                    origin: "the command line".to_owned(),
                    key: "--also",
                    found: format!("'{}'", word.trim()),
                    expected: format!("one or more of {}", known()),
                }
            })
        };
        text.split(',').map(file).collect()
    }
}

/// What a raw file says of a lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensFacts<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its f-number at infinity.
    pub f_number: f64,
    /// Its focal length, mm.
    pub focal_length_mm: f64,
}

/// The frames of one exposure.
#[derive(Clone)]
pub struct Frames<'a> {
    /// The sensor.
    pub sensor: &'a Sensor,
    /// The distance between the pixels, or between those of them that a preview has, µm.
    pub pitch_um: f64,
    /// Filters before the lens.
    pub filters: &'a [OpticalFilter],
    /// The exposure, metered or given.
    pub exposure: &'a Exposure,
    /// The mean rate of photo-electrons.
    pub rate: &'a ElectronRate,
    /// The frames.
    pub exposed: &'a Exposed,
    /// From the raw frame to the picture.
    pub processing: &'a Processing,
    /// What the lens does to the frame, where the processing undoes some of it.
    pub lens: Option<&'a LensTables>,
    /// The lens, where it is known.
    pub optics: Option<LensFacts<'a>>,
    /// The bands of the irradiance.
    pub grid: &'a WavelengthGrid,
    /// The light on the scene; D65 where it is not known.
    pub light: Illuminant,
    /// Where the light of the sensor's pixels comes from, where that is known and they depend on it.
    pub exit_pupil: Option<ExitPupil>,
}

/// Writes the frames and the picture; returns the names of the files and the bytes of the 8-bit PNG picture.
///
/// # Errors
/// When a file cannot be written.
pub fn write_frames(
    frames: &Frames<'_>,
    picture: &Picture,
    outputs: &Outputs,
    folder: &Path,
) -> Result<(Vec<String>, Vec<u8>), PipelineError> {
    let mut names = vec!["picture.png".to_owned()];
    if outputs.volts {
        names.push(write_planes(
            frames,
            &frames.exposed.volts.planes_v,
            ("V", "volts.exr"),
            outputs.exr_samples,
            folder,
        )?);
    }
    if outputs.raw && frames.exposed.raw.planes.iter().all(|plane| plane.dn().is_some()) {
        names.extend(write_raw(&frames.exposed.raw, "png", folder)?);
        names.extend(write_photodiodes(frames, "png", folder)?);
    }
    if let Some(map) = frames.exposed.photodiodes.as_ref().and_then(|reads| reads.disparity.as_ref()) {
        let planes = [("disparity", &map.disparity_px), ("standard_error", &map.standard_error_px)];
        write_planes_exr(&folder.join("disparity.exr"), &planes, outputs.exr_samples)?;
        names.push("disparity.exr".to_owned());
    }
    for file in &outputs.also {
        names.extend(write_also(frames, picture, (*file, outputs.exr_samples), folder)?);
    }
    let png = picture_png(picture)?;
    let path = folder.join("picture.png");
    fs::write(&path, &png).map_err(|e| PipelineError::Write { path, reason: e.to_string() })?;
    Ok((names, png))
}

/// Returns a picture as an 8-bit PNG file, the `picture.png` of a run.
///
/// # Errors
/// When it cannot be encoded.
pub fn picture_png(picture: &Picture) -> Result<Vec<u8>, PipelineError> {
    let size = (picture.columns(), picture.rows());
    dioptric_pictures::encode_rgb8_png_in(&picture.to_rgb8(), size, picture.space.of_file())
        .map_err(|e| PipelineError::Png { reason: e.to_string() })
}

fn write_also(
    frames: &Frames<'_>,
    picture: &Picture,
    (file, samples): (FrameFile, ExrSamples),
    folder: &Path,
) -> Result<Vec<String>, PipelineError> {
    if let Some((name, depth)) = file.picture_name() {
        picture.write(&folder.join(name), depth)?;
        return Ok(vec![name.to_owned()]);
    }
    match file {
        FrameFile::Electrons => {
            Ok(vec![write_planes(frames, &frames.exposed.electrons.planes_e, ("e", "electrons.exr"), samples, folder)?])
        }
        FrameFile::RawTiff => {
            let whole = write_raw(&frames.exposed.raw, "tiff", folder)?;
            Ok([whole, write_photodiodes(frames, "tiff", folder)?].concat())
        }
        FrameFile::RawDng => {
            frames.sensor.write_dng(&frames.exposed.raw, &dng_details(frames, picture), &folder.join("raw.dng"))?;
            let mut names = vec!["raw.dng".to_owned()];
            for PhotodiodeFrame { name, raw, of } in photodiode_frames(frames) {
                let (file, description) = (format!("raw-{name}.dng"), Some(format!("this raw frame holds {of}")));
                let details = DngDetails { description, ..dng_details(frames, picture) };
                let sheet = match &frames.exposed.photodiodes {
                    Some(reads) => frames.sensor.of_one_read(reads.frames.len())?,
                    None => frames.sensor.small_photodiode().unwrap_or_else(|| frames.sensor.clone()),
                };
                sheet.write_dng(raw, &details, &folder.join(&file))?;
                names.push(file);
            }
            Ok(names)
        }
        _ => {
            // Developed once more, because the picture holds codes.
            let (raw, processing) = (frames.exposed.developed_from(), frames.processing);
            let light = frames.sensor.develop_linear_with(raw, processing, frames.lens)?;
            let light = light.bright(frames.processing.brightness);
            let planes: Vec<Array2<f32>> = (0..3).map(|k| light.index_axis(Axis(2), k).to_owned()).collect();
            let named: Vec<(&str, &Array2<f32>)> = ["R", "G", "B"].into_iter().zip(&planes).collect();
            write_planes_exr(&folder.join("picture.exr"), &named, samples)?;
            Ok(vec!["picture.exr".to_owned()])
        }
    }
}

/// Returns what a DNG file says besides its frame.
fn dng_details<'a>(frames: &Frames<'a>, picture: &'a Picture) -> DngDetails<'a> {
    DngDetails {
        light: frames.light.clone(),
        f_number: frames.optics.map(|lens| lens.f_number),
        focal_length_mm: frames.optics.map(|lens| lens.focal_length_mm),
        lens: frames.optics.map(|lens| lens.name.to_owned()),
        description: frames.exposed.raw_note.clone(),
        picture: Some(picture),
        corrections: frames.lens.map(|tables| (frames.processing.lens_corrections, tables)),
    }
}

/// Writes planes of numbers as EXR: one channel of a name, or one a filter.
fn write_planes(
    frames: &Frames<'_>,
    planes: &[Array2<f32>],
    (name, file): (&str, &str),
    samples: ExrSamples,
    folder: &Path,
) -> Result<String, PipelineError> {
    let names: Vec<&str> = match planes.len() {
        1 => vec![name],
        _ => frames.exposed.raw.filter_names.iter().map(String::as_str).collect(),
    };
    let named: Vec<_> = names.into_iter().zip(planes).collect();
    write_planes_exr(&folder.join(file), &named, samples)?;
    Ok(file.to_owned())
}

/// The frame of photodiodes that were read by themselves.
struct PhotodiodeFrame<'a> {
    /// Which they are, in names of files.
    name: &'a str,
    raw: &'a Raw,
    /// Which they are, in a sentence, in ASCII.
    of: String,
}

/// Returns the frames of the first exposure that belong to photodiodes alone: each of those below a microlens, or the small ones of split pixels.
fn photodiode_frames<'a>(frames: &Frames<'a>) -> Vec<PhotodiodeFrame<'a>> {
    let Exposed { photodiodes, small, .. } = frames.exposed;
    let of_reads = photodiodes.iter().flat_map(|reads| {
        let of = |name: &str| format!("the {name} photodiode of each pixel alone, which sees its part of the pupil");
        let names = reads.photodiodes.names().iter().zip(&reads.frames);
        names.map(move |(name, raw)| PhotodiodeFrame { name, raw, of: of(name) })
    });
    let of_small = "the small photodiodes of split pixels, without the large ones";
    let of_small = small.iter().map(|raw| PhotodiodeFrame { name: "small", raw, of: of_small.to_owned() });
    of_reads.chain(of_small).collect()
}

/// Writes the frame of each photodiode that was read by itself.
fn write_photodiodes(frames: &Frames<'_>, extension: &str, folder: &Path) -> Result<Vec<String>, PipelineError> {
    let files = photodiode_frames(frames)
        .into_iter()
        .map(|PhotodiodeFrame { name, raw, .. }| write_raw_as(&format!("raw-{name}"), raw, extension, folder));
    Ok(files.collect::<Result<Vec<_>, _>>()?.concat())
}

/// Writes each plane of digital numbers as a 16-bit gray picture.
fn write_raw(raw: &Raw, extension: &str, folder: &Path) -> Result<Vec<String>, PipelineError> {
    write_raw_as("raw", raw, extension, folder)
}

pub(crate) fn write_raw_as(
    stem: &str,
    raw: &Raw,
    extension: &str,
    folder: &Path,
) -> Result<Vec<String>, PipelineError> {
    let names = raw.planes.iter().zip(&raw.filter_names).map(|(plane, filter)| {
        let is_single = raw.planes.len() == 1;
        let name = if is_single { format!("{stem}.{extension}") } else { format!("{stem}.{filter}.{extension}") };
        plane.write(&folder.join(&name))?;
        Ok(name)
    });
    names.collect()
}
