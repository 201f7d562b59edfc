//! The text header of an ENVI file.

use std::path::Path;

use crate::SceneError;

/// How the samples of a cube follow each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Interleave {
    /// Band after band.
    Bsq,
    /// Line after line, band after band in each.
    Bil,
    /// Sample after sample, band after band in each.
    Bip,
}

/// The numbers of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DataType {
    U8,
    I16,
    I32,
    F32,
    F64,
    U16,
    U32,
    I64,
    U64,
}

impl DataType {
    pub(crate) fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 | Self::I64 | Self::U64 => 8,
        }
    }
}

/// A header that has been checked.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct EnviHeader {
    pub(crate) columns: usize,
    pub(crate) rows: usize,
    pub(crate) bands: usize,
    pub(crate) offset: u64,
    pub(crate) data_type: DataType,
    pub(crate) interleave: Interleave,
    pub(crate) is_big_endian: bool,
    pub(crate) wavelengths_nm: Vec<f64>,
    /// What a perfect white is stored as.
    pub(crate) reflectance_scale: Option<f64>,
    /// `data units`, as written.
    pub(crate) data_units: Option<String>,
}

/// A `key = value` of the header and the line it starts on.
struct Entry {
    line: usize,
    key: String,
    value: String,
}

/// Reads the text of a header.
pub(crate) fn parse(path: &Path, text: &str) -> Result<EnviHeader, SceneError> {
    let entries = Entries { path, list: entries(path, text)? };
    let wavelengths_nm = entries.wavelengths_nm()?;
    let header = EnviHeader {
        columns: entries.required("samples")?,
        rows: entries.required("lines")?,
        bands: entries.required("bands")?,
        offset: entries.number("header offset")?.unwrap_or(0),
        data_type: entries.data_type()?,
        interleave: entries.interleave()?,
        is_big_endian: match entries.number::<u8>("byte order")? {
            None | Some(0) => false,
            Some(1) => true,
            Some(other) => return Err(entries.wrong("byte order", format!("{other}, expected 0 or 1"))),
        },
        wavelengths_nm,
        reflectance_scale: entries.number("reflectance scale factor")?,
        data_units: entries.get("data units").map(|entry| entry.value.clone()),
    };
    if header.columns == 0 || header.rows == 0 || header.bands == 0 {
        return Err(entries.wrong("samples", "a cube without samples".to_owned()));
    }
    if header.wavelengths_nm.len() != header.bands {
        let reason =
            format!("{} wavelengths, expected one for each of {} bands", header.wavelengths_nm.len(), header.bands);
        return Err(entries.wrong("wavelength", reason));
    }
    if header.reflectance_scale.is_some_and(|scale| !(scale.is_finite() && scale > 0.0)) {
        return Err(entries.wrong("reflectance scale factor", "expected a number above 0".to_owned()));
    }
    Ok(header)
}

struct Entries<'a> {
    path: &'a Path,
    list: Vec<Entry>,
}

impl Entries<'_> {
    fn get(&self, key: &str) -> Option<&Entry> {
        self.list.iter().find(|entry| entry.key == key)
    }

    fn wrong(&self, key: &str, reason: String) -> SceneError {
        let line = self.get(key).map_or(0, |entry| entry.line);
        SceneError::Header { file: self.path.to_owned(), line, key: key.to_owned(), reason }
    }

    fn number<T: std::str::FromStr>(&self, key: &str) -> Result<Option<T>, SceneError> {
        let Some(entry) = self.get(key) else { return Ok(None) };
        match entry.value.parse() {
            Ok(number) => Ok(Some(number)),
            Err(_) => Err(self.wrong(key, format!("'{}' is not a number that can stand here", shown(&entry.value)))),
        }
    }

    fn required(&self, key: &str) -> Result<usize, SceneError> {
        self.number(key)?.ok_or_else(|| self.wrong(key, "the header lacks it".to_owned()))
    }

    fn data_type(&self) -> Result<DataType, SceneError> {
        Ok(match self.required("data type")? {
            1 => DataType::U8,
            2 => DataType::I16,
            3 => DataType::I32,
            4 => DataType::F32,
            5 => DataType::F64,
            12 => DataType::U16,
            13 => DataType::U32,
            14 => DataType::I64,
            15 => DataType::U64,
            other => return Err(self.wrong("data type", format!("{other}, expected 1–5 or 12–15"))),
        })
    }

    fn interleave(&self) -> Result<Interleave, SceneError> {
        let value = self.get("interleave").map(|entry| entry.value.to_ascii_lowercase());
        match value.as_deref() {
            Some("bsq") => Ok(Interleave::Bsq),
            Some("bil") => Ok(Interleave::Bil),
            Some("bip") => Ok(Interleave::Bip),
            Some(other) => Err(self.wrong("interleave", format!("'{}', expected bsq, bil or bip", shown(other)))),
            None => Err(self.wrong("interleave", "the header lacks it".to_owned())),
        }
    }

    fn wavelengths_nm(&self) -> Result<Vec<f64>, SceneError> {
        let Some(entry) = self.get("wavelength") else {
            return Err(self.wrong("wavelength", "the header lacks it".to_owned()));
        };
        let words = entry.value.trim_start_matches('{').trim_end_matches('}').split(',').map(str::trim);
        let mut numbers = Vec::new();
        for word in words.filter(|word| !word.is_empty()) {
            match word.parse::<f64>() {
                Ok(number) => numbers.push(number),
                Err(_) => return Err(self.wrong("wavelength", format!("'{}' is not a number", shown(word)))),
            }
        }
        let factor = match self.get("wavelength units").map(|entry| entry.value.to_ascii_lowercase()).as_deref() {
            Some("nm" | "nanometers" | "nanometer" | "nanometres") => 1.0,
            Some("um" | "µm" | "μm" | "micrometers" | "micrometer" | "micrometres" | "microns") => 1000.0,
            // Nobody writes visible light as 0.4 nm or as 400 µm.
            None | Some("unknown" | "") => {
                if numbers.iter().all(|&number| number < 50.0) {
                    1000.0
                } else {
                    1.0
                }
            }
            Some(other) => {
                return Err(self.wrong("wavelength units", format!("'{}', expected nm or µm", shown(other))));
            }
        };
        // A product of 1.0 keeps the number to the bit.
        Ok(numbers.into_iter().map(|number| number * factor).collect())
    }
}

/// Splits the text into entries; a value in braces may run over many lines.
fn entries(path: &Path, text: &str) -> Result<Vec<Entry>, SceneError> {
    let wrong = |line: usize, key: &str, reason: &str| {
        Err(SceneError::Header { file: path.to_owned(), line, key: shown(key), reason: reason.to_owned() })
    };
    let mut lines = text.lines().enumerate().map(|(i, line)| (i + 1, line.trim()));
    match lines.next() {
        Some((_, first)) if first.trim_start_matches('\u{feff}') == "ENVI" => {}
        first => return wrong(1, first.map_or("", |(_, line)| line), "expected the word ENVI on the first line"),
    }
    let mut list = Vec::new();
    while let Some((line, text)) = lines.next() {
        if text.is_empty() || text.starts_with(';') {
            continue;
        }
        let Some((key, value)) = text.split_once('=') else {
            return wrong(line, text, "expected 'key = value'");
        };
        let mut value = value.trim().to_owned();
        if value.starts_with('{') {
            while !value.ends_with('}') {
                let Some((_, more)) = lines.next() else {
                    return wrong(line, key.trim(), "the list is never closed by '}'");
                };
                value.push(' ');
                value.push_str(more);
            }
        }
        let key = key.split_whitespace().collect::<Vec<_>>().join(" ").to_ascii_lowercase();
        list.push(Entry { line, key, value });
    }
    Ok(list)
}

/// Returns the start of a text, for a message.
fn shown(text: &str) -> String {
    text.chars().take(40).filter(|c| !c.is_control()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "ENVI\n; made by hand\nsamples = 4\nlines   = 3\nbands = 2\nheader offset = 16\ndata type = 12\n\
        interleave = BIL\nbyte order = 1\nWavelength Units = Micrometers\nwavelength = {0.5,\n 0.6,\n}\n\
        reflectance scale factor = 10000.0\n";

    #[test]
    fn a_header_is_read() {
        let header = parse(Path::new("a.hdr"), GOOD).unwrap();
        assert_eq!((header.columns, header.rows, header.bands, header.offset), (4, 3, 2, 16));
        assert_eq!((header.data_type, header.interleave), (DataType::U16, Interleave::Bil));
        assert!(header.is_big_endian);
        assert_eq!((header.wavelengths_nm, header.reflectance_scale), (vec![500.0, 600.0], Some(10000.0)));
    }

    #[test]
    fn wrong_headers_are_refused_by_line_and_key() {
        for (from, to, words) in [
            ("ENVI", "ENVY", "line 1"),
            ("samples = 4", "samples = four", "line 3: 'samples': 'four'"),
            ("samples = 4", "samples = 0", "without samples"),
            ("lines   = 3", "", "'lines': the header lacks it"),
            ("data type = 12", "data type = 6", "line 7: 'data type': 6, expected"),
            ("BIL", "bob", "expected bsq, bil or bip"),
            ("byte order = 1", "byte order = 2", "expected 0 or 1"),
            ("Micrometers", "furlongs", "'wavelength units': 'furlongs'"),
            (" 0.6,\n}", " 0.6,\n", "never closed"),
            (" 0.6,\n}", "}", "1 wavelengths, expected one for each of 2"),
            (" 0.6,", " six,", "'six'"),
            ("10000.0", "-1", "above 0"),
            ("byte order = 1", "byte order", "expected 'key = value'"),
        ] {
            let message = parse(Path::new("a.hdr"), &GOOD.replace(from, to)).unwrap_err().to_string();
            assert!(message.contains(words) && message.starts_with("a.hdr: "), "{message}");
        }
    }
}
