//! Lights and whites from the words of a command line.

use std::path::Path;

use dioptric_files::text;
use dioptric_scene::wavelengths_of_column;
use dioptric_sensor::WhiteBalance;
use dioptric_spectrum::{Illuminant, Spectrum};

use crate::PipelineError;

/// Returns the light of a name (in any case), a temperature (`3200K`), a chromaticity (`0.46,0.414`) or a table, whatever its file ends in, whose two
/// columns are wavelengths in nm and spectral power.
///
/// # Errors
/// When the text is none of these, or there can be no such light.
pub fn parse_illuminant(text: &str) -> Result<Illuminant, PipelineError> {
    let path = Path::new(text);
    if is_table(path) {
        return read_light(path);
    }
    Ok(Illuminant::parse(text)?)
}

/// Whether a text is the name of a table, by its ending or because it is there and no light is called so.
fn is_table(path: &Path) -> bool {
    let is_light = || path.to_str().is_some_and(|text| Illuminant::parse(text).is_ok());
    let is_there = || path.is_file() && (path.extension().is_some() || !is_light());
    path.extension().is_some_and(|own| own.eq_ignore_ascii_case("csv")) || is_there()
}

/// Returns the white of a command line: a word of [`WhiteBalance::parse`], or the CSV file of a light's spectrum.
///
/// # Errors
/// As [`WhiteBalance::parse`] and [`parse_illuminant`].
pub fn parse_white(text: &str) -> Result<WhiteBalance, PipelineError> {
    let path = Path::new(text);
    if is_table(path) {
        return Ok(WhiteBalance::Light(read_light(path)?));
    }
    Ok(WhiteBalance::parse(text)?)
}

fn read_light(path: &Path) -> Result<Illuminant, PipelineError> {
    let unreadable = |reason: String| PipelineError::Read { path: path.to_owned(), reason };
    let text = text::read(path).map_err(|e| unreadable(e.to_string()))?;
    let text = text::with_commas(&text);
    let text = text.lines().map(with_comma).collect::<Vec<_>>().join("\n");
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let has = |text: &str, words: &[&str]| words.iter().any(|of| text.to_lowercase().contains(of));
    let (mut names, mut wavelengths_nm, mut values) = (Vec::<String>::new(), Vec::new(), Vec::new());
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
            _ if number == 0 => names = record.iter().map(str::to_owned).collect(),
            _ => return Err(unreadable(format!("line {line} is not a wavelength in nm and a power"))),
        }
    }
    let wavelengths_nm =
        wavelengths_of_column(names.first().map_or("", String::as_str), &wavelengths_nm).map_err(unreadable)?;
    // Of a line of names that is not told apart, all of it.
    let of_power = names.get(1).or(names.first());
    let counts_photons = of_power.is_some_and(|name| has(name, &["photon", "quanta", "mol", "ppfd"]));
    let is_comment = |line: &&str| line.starts_with('#') && has(line, &["photon", "quanta"]);
    if let Some(comment) = text.lines().find(is_comment).filter(|_| !counts_photons) {
        return Err(unreadable(format!(
            "it says '{}': expected the name of its second column to say whether its numbers are photons or watts",
            comment.trim_start_matches('#').trim()
        )));
    }
    if values.is_empty() {
        return Err(unreadable("it has no line of a wavelength in nm and a power".to_owned()));
    }
    // A power a frequency, or in decibels, is none a nanometre.
    let is_other = |name: &String| {
        let lower = name.to_lowercase();
        let has_word = |of: &str| lower.split(|c: char| !c.is_alphabetic()).any(|word| word == of);
        ["db", "dbm", "decibel", "decibels", "log", "logarithm"].into_iter().any(has_word)
            || lower.ends_with("hz")
            || lower.contains("hz-1")
            || lower.contains("hz^-1")
    };
    if let Some(name) = of_power.filter(|name| is_other(name)) {
        return Err(unreadable(format!(
            "its column '{name}' is no power a nanometre, expected such (W/nm) or photons"
        )));
    }
    if counts_photons {
        values.iter_mut().zip(&wavelengths_nm).for_each(|(value, nm)| *value /= nm);
    }
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| wavelengths_nm[*a].total_cmp(&wavelengths_nm[*b]));
    let sorted = |list: &[f64]| order.iter().map(|at| list[*at]).collect();
    let light = Spectrum::new(sorted(&wavelengths_nm), sorted(&values)).map(Illuminant::Spectrum);
    let checked = light.and_then(|light| light.check().map(|()| light));
    checked.map_err(|e| unreadable(e.to_string()))
}

/// Returns a line of two numbers, or of the names of two columns, with a comma in place of the gap between them.
fn with_comma(line: &str) -> String {
    let words: Vec<&str> = line.split_whitespace().collect();
    // A unit in brackets belongs to the name before it.
    let n_first = 1 + words.get(1).map_or(0, |word| usize::from(word.starts_with(['(', '['])));
    match (&words[..], line.contains([',', '#', '"'])) {
        ([first, _, ..], false) if words.len() == 2 || first.parse::<f64>().is_err() => {
            let (first, second) = words.split_at(n_first.min(words.len() - 1));
            format!("{},{}", first.join(" "), second.join(" "))
        }
        _ => line.to_owned(),
    }
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
        let light = read("nm, power\n400, 1\n500, 2\n800, 1\n").unwrap();
        for text in [
            "µm;W/nm\n0,4;1\n0,5;2\n0,8;1\n",
            "cm^-1\tpower\n12500\t1\n20000\t2\n25000\t1\n",
            "nm, photons/s\n400, 400\n500, 1000\n800, 800\n",
            "400 1\n500   2\n800 1\n",
            "nm photons\n400 400\n500 1000\n800 800\n",
            "Wavelength (Å)  Power [W/nm]\n4000 1\n5000 2\n8000 1\n",
            "nm, PPFD\n400, 400\n500, 1000\n800, 800\n",
            "\u{feff}Å, W\n4000, 1\n5000, 2\n8000, 1\n",
        ] {
            assert_eq!(read(text).unwrap(), light, "{text}");
        }
        for (text, word) in [
            ("nm, a, b\n400, 1, 2\n700, 1, 2\n", "3 columns"),
            ("waves (zorp), a\n400, 1\n700, 1\n", "'zorp'"),
            ("400, 1\n500; 2\n", "line 2"),
            ("nm,dBm\n400, -1\n500, -2\n", "'dBm' is no power"),
            ("nm,dB\n400, -1\n500, -2\n", "'dB' is no power"),
            ("nm,absolute log irradiance\n400, -1\n500, -2\n", "irradiance' is no power"),
            ("nm,W m-2 Hz-1\n400, 1\n500, 2\n", "Hz-1' is no power"),
            ("Light in photons\nnm, a\n400, 1\n500, 2\n", "photons"),
            ("400, 1\n400, 2\n", "400"),
        ] {
            let message = read(text).unwrap_err().to_string();
            assert!(message.contains(word) && message.contains("light.csv"), "{message}");
        }
    }
}
