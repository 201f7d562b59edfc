//! A raw frame of any camera, from a DNG file, developed as simulated ones are.

use std::path::Path;

use dioptric_sensor::{Developed, DngFile, DngReading, Picture, Processing, SensorError};

use crate::{FrameFile, PipelineError, picture_png, write_file};

/// A frame from a file, and its picture.
#[derive(Clone, Debug)]
pub struct DevelopedFile {
    /// The frame with what the file states of it.
    pub file: DngFile,
    /// From the raw frame to the picture.
    pub processing: Processing,
    /// The picture.
    pub developed: Developed,
}

impl DevelopedFile {
    /// Reads a DNG file and develops its frame.
    ///
    /// # Errors
    /// When it cannot be read, or the processing asks for what such a file does not hold: corrections of a simulated lens, roots
    /// of channels, and what [`DngFile::develop`] refuses.
    pub fn read(path: &Path, processing: Processing) -> Result<Self, PipelineError> {
        Self::read_with(path, processing, &DngReading::default())
    }

    /// Reads a DNG file and develops its frame with or without the corrections that the file asks for, by its profile or another as far as is told.
    ///
    /// # Errors
    /// As [`read`](Self::read), and as [`DngFile::read_with`].
    pub fn read_with(path: &Path, processing: Processing, reading: &DngReading) -> Result<Self, PipelineError> {
        Self::of(DngFile::read_with(path, reading)?, processing)
    }

    /// Develops the frame of a file, or one that a program holds as such.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn of(file: DngFile, processing: Processing) -> Result<Self, PipelineError> {
        if !processing.lens_corrections.is_none() {
            let reason = "need a simulated lens, which a raw file does not hold, expected none".to_owned();
            return Err(SensorError::Unsuitable { what: "lens_corrections", reason }.into());
        }
        let developed = file.develop(&processing)?;
        Ok(Self { file, processing, developed })
    }

    /// Writes `picture.png` and the pictures that are asked for besides; returns the names of the files.
    ///
    /// # Errors
    /// When one is no picture of codes, or cannot be written.
    pub fn write_pictures(&self, also: &[FrameFile], folder: &Path) -> Result<Vec<String>, PipelineError> {
        let picture: &Picture = &self.developed.picture;
        write_file(&folder.join("picture.png"), &picture_png(picture)?)?;
        let mut names = vec!["picture.png".to_owned()];
        for file in also {
            let Some((name, depth)) = file.picture_name() else {
                let known = FrameFile::NAMES.iter().filter(|(_, file)| file.picture_name().is_some());
                return Err(PipelineError::Value {
                    origin: "the command line".to_owned(),
                    key: "--also",
                    found: format!("'{}'", file.name()),
                    expected: format!("pictures: {}", known.map(|(name, _)| *name).collect::<Vec<_>>().join(", ")),
                });
            };
            picture.write(&folder.join(name), depth)?;
            names.push(name.to_owned());
        }
        Ok(names)
    }
}
