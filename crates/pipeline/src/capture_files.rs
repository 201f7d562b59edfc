//! The stages of a capture as files.

use std::path::Path;

use dioptric_scene::{write_planes_exr, write_scene_exr};
use dioptric_spectrum::{Cancel, DepthMap};

use crate::{
    PipelineError, Progress,
    frame_files::write_frames,
    stages::{Capture, IRRADIANCE_FILE, KeptCamera, photodiode_irradiance_file},
};

/// Writes what the camera's outputs ask for of a capture into a folder: irradiance, depth, frames and picture. Returns the names
/// of the files and the bytes of `picture.png`.
///
/// `depth` is that of the scene's samples, where it is at hand.
///
/// # Errors
/// When a file cannot be written.
pub fn write_capture(
    capture: &Capture,
    depth: Option<&DepthMap>,
    folder: &Path,
) -> Result<(Vec<String>, Vec<u8>), PipelineError> {
    write_irradiance(capture, folder)?;
    let (files, png) = write_frames_and_depth(capture, depth, folder)?;
    Ok((irradiance_files(capture).into_iter().chain(files).collect(), png))
}

/// The names of the files of the irradiance, where the camera's outputs ask for it: that of whole pixels, and where photodiodes are read one
/// by one that of each.
pub fn irradiance_files(capture: &Capture) -> Vec<String> {
    if !capture.camera.outputs.irradiance {
        return Vec::new();
    }
    let of_photodiodes = capture.camera.dual_pixel.map(|spec| spec.photodiodes.names()).unwrap_or_default();
    let of_photodiodes = of_photodiodes.iter().map(|name| photodiode_irradiance_file(name));
    std::iter::once(IRRADIANCE_FILE.to_owned()).chain(of_photodiodes).collect()
}

/// Writes the irradiance of a capture into a folder, where its camera's outputs ask for it.
///
/// # Errors
/// When the file cannot be written.
pub fn write_irradiance(capture: &Capture, folder: &Path) -> Result<(), PipelineError> {
    let irradiances = std::iter::once(&*capture.irradiance).chain(capture.irradiance.photodiodes());
    let mut files = irradiance_files(capture).into_iter().zip(irradiances);
    let (white, samples) = (capture.white_of(), capture.camera.outputs.exr_samples);
    files.try_for_each(|(file, own)| own.write_exr_under(&white, &folder.join(file), samples))
}

/// Writes what [`write_capture`] does but for the irradiance, the largest file by far.
///
/// # Errors
/// When a file cannot be written.
pub fn write_frames_and_depth(
    capture: &Capture,
    depth: Option<&DepthMap>,
    folder: &Path,
) -> Result<(Vec<String>, Vec<u8>), PipelineError> {
    let outputs = &capture.camera.outputs;
    let mut files = Vec::new();
    if let Some(depth) = depth.filter(|_| outputs.depth) {
        write_planes_exr(&folder.join("depth.exr"), &[("Z", depth.z_m())], outputs.exr_samples)?;
        files.push("depth.exr".to_owned());
    }
    let (frame_files, png) = write_frames(&capture.frame_parts(), &capture.developed.picture, outputs, folder)?;
    files.extend(frame_files);
    Ok((files, png))
}

/// Writes the scene of a camera as it is imaged, a scene file of its own: radiance, depth, view, and what its surfaces hide where that is known.
///
/// # Errors
/// As [`KeptCamera::scene`], and when the file cannot be written.
pub fn write_scene(
    kept: &KeptCamera,
    path: &Path,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<(), PipelineError> {
    let resolved = kept.scene(progress, cancel)?;
    Ok(write_scene_exr(path, &resolved.scene, kept.camera().outputs.exr_samples)?)
}
