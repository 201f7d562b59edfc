//! Files of irradiance made others.

use std::path::Path;

use dioptric_scene::{
    ExrSamples, holds_iset_irradiance, is_irradiance_exr, read_iset_irradiance, read_spectral_exr,
    write_iset_irradiance,
};

use crate::{Irradiance, PipelineError, SceneRequest, SceneSource, SceneSpec, scene_files::no_exr_samples};

/// Makes a file of irradiance another: an optical image of `ISETCam` where the output ends in `.mat` and else spectral EXR. Returns what was
/// understood and not used, a sentence each; `None` where the file holds no irradiance, and nothing is written.
///
/// # Errors
/// When it cannot be read or written, or more is asked of it than of a scene without choices.
pub fn convert_irradiance(
    request: &SceneRequest,
    output: &Path,
    samples: Option<ExrSamples>,
) -> Result<Option<Vec<String>>, PipelineError> {
    let SceneSource::File(input) = &request.scene.source else { return Ok(None) };
    let is_mat = |path: &Path| path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("mat"));
    let told = request.scene.reading.variable.as_deref();
    let is_irradiance = match input.extension() {
        Some(ending) if ending.eq_ignore_ascii_case("exr") => is_irradiance_exr(input),
        _ => is_mat(input) && holds_iset_irradiance(input, told),
    };
    if !is_irradiance {
        return Ok(None);
    }
    let mut scene = SceneSpec::of_file(input.clone());
    scene.reading.variable = request.scene.reading.variable.clone().filter(|_| is_mat(input));
    let plain = SceneRequest { scene, wavelengths_nm: None, crop: None, bin: 1, quarter_turns: 0 };
    if *request != plain {
        let reason = format!("do not apply to {}, which holds irradiance: expected it without", input.display());
        return Err(PipelineError::Unsuitable { what: "choices of a scene", reason });
    }
    if is_mat(output) && samples.is_some() {
        return Err(no_exr_samples(output));
    }
    if !is_mat(output) {
        let (irradiance, white, notes) = Irradiance::read(input, None)?;
        irradiance.write_exr_under(&white, output, samples.unwrap_or_default())?;
        return Ok(Some(notes));
    }
    let name = input.file_stem().unwrap_or_default().to_string_lossy();
    let mut notes = vec![];
    let image = if is_mat(input) {
        let read = read_iset_irradiance(input)?;
        notes.extend(read.notes);
        read.image
    } else {
        read_spectral_exr(input)?.told_in(&mut notes).image
    };
    write_iset_irradiance(output, &image, &name)?;
    let way = "its focal length is as long as the film is wide, from which ISETCam finds the distance between samples";
    notes.insert(0, format!("{}: irradiance of {name}; {way}", output.display()));
    Ok(Some(notes))
}
