//! Lenses from one file format to another.

use std::path::Path;

use dioptric_files::is_stream;
use dioptric_optics::D_LINE_NM;
use dioptric_pipeline::{LensReadOptions, LensSpec, PipelineError};

/// A lens in the format of another file.
#[derive(Clone, Debug, PartialEq)]
pub struct ConvertedLens {
    /// The text of the file.
    pub text: String,
    /// The text of a glass catalogue (`.agf`) that belongs beside it with the same name, if it needs one.
    pub glasses: Option<String>,
    /// What there is to say of what was asked for, a sentence each.
    pub notes: Vec<String>,
    /// What the file read says and this program takes otherwise or not at all, a sentence each.
    pub unread: Vec<String>,
    /// What the format written has no place for, a sentence each.
    pub losses: Vec<String>,
}

/// Returns the lens that `input` means (a file or a built-in name) in the format that `target`'s extension tells.
///
/// What the file read says beside the lens (film, fields, wavelengths) is kept where the format has a place for it; a
/// `.json` file has the indices from 400 to 700 nm all the same.
///
/// # Errors
/// When there is no such lens, or the format cannot hold it.
pub fn convert_lens(input: &str, target: &Path, reading: &LensReadOptions) -> Result<ConvertedLens, PipelineError> {
    let mut file = LensSpec::named(input).open(reading)?;
    let named = target.extension().map(|e| e.to_string_lossy().to_lowercase());
    // Standard output and devices have no name that tells: our own format.
    let extension = named.unwrap_or_else(|| if is_stream(target) { "ron".to_owned() } else { String::new() });
    let (unread, mut notes) = (std::mem::take(&mut file.notes), Vec::new());
    if reading.configuration.is_some() {
        let n_configurations = file.configurations.len();
        if n_configurations > 1 {
            notes.push(format!("configuration {} of {n_configurations} is written alone", file.configuration));
        }
        file = file.of_one_configuration();
    }
    let losses = file.left_out(&extension);
    // These two alone hold indices instead of glasses.
    let written_nm = match extension.as_str() {
        "dat" => vec![file.reference_wavelength_nm.unwrap_or(D_LINE_NM)],
        "json" => (0..=30).map(|step| 400.0 + 10.0 * f64::from(step)).collect(),
        _ => Vec::new(),
    };
    notes.extend(file.lens.notes_on_ranges(&written_nm));
    let (text, glasses) = match extension.as_str() {
        "ron" => (file.to_ron(), None),
        "dat" => (file.to_dat()?, None),
        "json" => {
            file.wavelengths_nm.clear();
            (file.to_omni_json()?, None)
        }
        "zmx" => file.to_zmx_and_agf(&target.file_stem().unwrap_or_default().to_string_lossy())?,
        "seq" => (file.to_seq()?, None),
        _ => {
            let expected = "expected .ron, .dat, .json (ISET), .zmx or .seq";
            let reason = format!("'.{extension}' is no lens format that can be written; {expected}");
            return Err(PipelineError::Write { path: target.to_owned(), reason });
        }
    };
    Ok(ConvertedLens { text, glasses, notes, unread, losses })
}
