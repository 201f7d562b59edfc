//! Lights and whites from the words of a command line.

use std::path::Path;

use dioptric_sensor::WhiteBalance;
use dioptric_spectrum::{Illuminant, Spectrum};

use crate::PipelineError;

/// Returns the light of a name (in any case), a temperature (`3200K`), a chromaticity (`0.46,0.414`) or a CSV file whose two
/// columns are wavelengths in nm and spectral power.
///
/// # Errors
/// When the text is none of these, or there can be no such light.
pub fn parse_illuminant(text: &str) -> Result<Illuminant, PipelineError> {
    let path = Path::new(text);
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv")) {
        return read_light(path);
    }
    Ok(Illuminant::parse(text)?)
}

/// Returns the white of a command line: a word of [`WhiteBalance::parse`], or the CSV file of a light's spectrum.
///
/// # Errors
/// As [`WhiteBalance::parse`] and [`parse_illuminant`].
pub fn parse_white(text: &str) -> Result<WhiteBalance, PipelineError> {
    let path = Path::new(text);
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv")) {
        return Ok(WhiteBalance::Light(read_light(path)?));
    }
    Ok(WhiteBalance::parse(text)?)
}

/// Below lie wavelengths in micrometres, and of no light that a camera sees.
const SHORTEST_NM: f64 = 50.0;

fn read_light(path: &Path) -> Result<Illuminant, PipelineError> {
    let unreadable = |reason: String| PipelineError::Read { path: path.to_owned(), reason };
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_path(path)
        .map_err(|e| unreadable(e.to_string()))?;
    let (mut wavelengths_nm, mut values) = (Vec::new(), Vec::new());
    for (number, record) in reader.records().enumerate() {
        let record = record.map_err(|e| unreadable(e.to_string()))?;
        let line = record.position().map_or(number as u64 + 1, csv::Position::line);
        if record.len() > 2 {
            let n = record.len();
            return Err(unreadable(format!(
                "line {line} has {n} columns, expected a wavelength in nm and one power: of several lights a file each"
            )));
        }
        let number_at = |column: usize| record.get(column).and_then(|text| text.parse::<f64>().ok());
        match (number_at(0), number_at(1)) {
            (Some(nm), Some(value)) => {
                wavelengths_nm.push(nm);
                values.push(value);
            }
            // Names of the columns.
            _ if number == 0 => {}
            _ => return Err(unreadable(format!("line {line} is not a wavelength in nm and a power"))),
        }
    }
    if let Some(nm) = wavelengths_nm.iter().find(|nm| **nm < SHORTEST_NM) {
        return Err(unreadable(format!("a wavelength is {nm}, expected nm")));
    }
    let light = Spectrum::new(wavelengths_nm, values).map(Illuminant::Spectrum);
    let checked = light.and_then(|light| light.check().map(|()| light));
    checked.map_err(|e| unreadable(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_of_one_light_in_nanometres_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("light.csv");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            parse_illuminant(&path.to_string_lossy())
        };
        assert!(read("nm, power\n400, 1\n500, 2\n700, 1\n").is_ok());
        for (text, word) in [
            ("nm, a, b\n400, 1, 2\n700, 1, 2\n", "3 columns"),
            ("0.4, 1\n0.7, 1\n", "expected nm"),
            ("400, 1\n500; 2\n", "line 2"),
            ("400, 1\n400, 2\n", "400"),
        ] {
            let message = read(text).unwrap_err().to_string();
            assert!(message.contains(word) && message.contains("light.csv"), "{message}");
        }
    }
}
