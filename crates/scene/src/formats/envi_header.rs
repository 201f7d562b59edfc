//! The text header of an ENVI file.

use std::path::Path;

use dioptric_spectrum::Quantity;

use super::{
    light_unit::LightUnit,
    stated::{self, name_of, note_of},
    wavelength_unit::{PLAUSIBLE_NM, UNITS, in_nm, without_unit},
};
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
    /// Bytes to be skipped before and after each frame: a band of band after band, a line of the others.
    pub(crate) frame_offsets: [u64; 2],
    /// The center of each band, where the header has them.
    pub(crate) wavelengths_nm: Option<Vec<f64>>,
    /// Bands that are marked as bad.
    pub(crate) bad_bands: Vec<bool>,
    /// What each number is multiplied by, and what is then added, a band each.
    pub(crate) gains: Option<Vec<f64>>,
    pub(crate) offsets: Option<Vec<f64>>,
    /// Whether these make reflectances of the numbers.
    pub(crate) are_gains_of_reflectance: bool,
    /// The number that stands for none.
    pub(crate) ignored: Option<f64>,
    /// What a perfect white is stored as.
    pub(crate) reflectance_scale: Option<f64>,
    /// What radiances are to be divided by.
    pub(crate) radiance_scale: Option<f64>,
    /// How long the light was gathered, or how much of it: keys with their numbers, which count between a cube and its references.
    pub(crate) exposures: Vec<(String, f64)>,
    /// How the camera was set and which it was: keys with their words, which count between a cube and its references.
    pub(crate) settings: Vec<(String, String)>,
    /// `data units`, as written, or the unit that the titles of plots or the description state.
    pub(crate) data_units: Option<String>,
    /// What it says of itself in free words.
    pub(crate) description: Option<String>,
    /// What of the header is not used, or contradicts itself, a sentence each.
    pub(crate) notes: Vec<String>,
}

/// A `key = value` of the header and the line it starts on.
#[derive(Clone)]
struct Entry {
    line: usize,
    key: String,
    value: String,
}

/// Keys that change nothing of what the numbers are: names, places on the globe, how they were once displayed.
const HARMLESS: [&str; 37] = [
    "description",
    "band names",
    "default bands",
    "default stretch",
    "fwhm",
    "sensor type",
    "acquisition time",
    "cloud cover",
    "coordinate system string",
    "dem band",
    "dem file",
    "geo points",
    "map info",
    "pixel size",
    "projection info",
    "read procedures",
    "rpc info",
    "security tag",
    "solar irradiance",
    "spectra names",
    "sun azimuth",
    "sun elevation",
    "timestamp",
    "x start",
    "y start",
    "z plot average",
    "z plot range",
    "z plot titles",
    "errors",
    "fps",
    "binning",
    "himg",
    "vimg",
    "hroi",
    "vroi",
    "camera id",
    "serial number",
];

/// Keys of how long the light was gathered, or how much of it.
const EXPOSURES: [&str; 4] = ["tint", "integration time", "exposure", "exposure time"];

/// Keys of how the camera was set, and of which it was.
const SETTINGS: [&str; 9] =
    ["binning", "himg", "vimg", "hroi", "vroi", "x start", "sensor type", "camera id", "serial number"];

/// Keys that are used. A writer may leave out the spaces in them, or put underscores in their place.
const USED: [&str; 23] = [
    "samples",
    "lines",
    "bands",
    "header offset",
    "data type",
    "interleave",
    "byte order",
    "file type",
    "file compression",
    "major frame offsets",
    "minor frame offsets",
    "wavelength",
    "wavelength units",
    "bbl",
    "data gain values",
    "data offset values",
    "data reflectance gain values",
    "data reflectance offset values",
    "data ignore value",
    "reflectance scale factor",
    "radiance scale factor",
    "data units",
    "classes",
];

/// Reads the text of a header.
pub(crate) fn parse(path: &Path, text: &str) -> Result<EnviHeader, SceneError> {
    let mut entries = Entries { path, list: entries(path, text)?, used: vec![] };
    entries.check_repeats()?;
    entries.check_kind()?;
    let bands = entries.required("bands")?;
    let reflecting =
        [entries.list("data reflectance gain values", bands)?, entries.list("data reflectance offset values", bands)?];
    let plain = [entries.list("data gain values", bands)?, entries.list("data offset values", bands)?];
    let are_gains_of_reflectance = reflecting.iter().any(Option::is_some) && plain.iter().all(Option::is_none);
    let [gains, offsets] = if are_gains_of_reflectance { reflecting.clone() } else { plain };
    let bad_bands =
        entries.list("bbl", bands)?.map_or_else(Vec::new, |list| list.iter().map(|good| *good <= 0.0).collect());
    let wavelengths_nm = entries.wavelengths_nm()?;
    let frame_offsets = entries.frame_offsets()?;
    let description = entries.get("description").map(|entry| words_of(&entry.value));
    let data_units = entries.get("data units").map(|entry| words_of(&entry.value)).or_else(|| entries.unit_of_titles());
    let described = || unit_described(description.as_deref()?);
    let data_units = data_units.or_else(described).map(|words| match LightUnit::in_words(&words) {
        Some((_, unit)) => unit.to_owned(),
        None => words,
    });
    let mut header = EnviHeader {
        columns: entries.required("samples")?,
        rows: entries.required("lines")?,
        bands,
        offset: entries.number("header offset")?.unwrap_or(0),
        data_type: entries.data_type()?,
        interleave: entries.interleave()?,
        is_big_endian: match entries.number::<u8>("byte order")? {
            None | Some(0) => false,
            Some(1) => true,
            Some(other) => return Err(entries.wrong("byte order", format!("{other}, expected 0 or 1"))),
        },
        frame_offsets,
        wavelengths_nm,
        bad_bands,
        gains,
        offsets,
        are_gains_of_reflectance,
        ignored: entries.number("data ignore value")?,
        reflectance_scale: entries.positive("reflectance scale factor")?,
        radiance_scale: entries.positive("radiance scale factor")?,
        exposures: entries.exposures(),
        settings: entries.settings(),
        data_units,
        description,
        notes: vec![],
    };
    if header.columns == 0 || header.rows == 0 || header.bands == 0 {
        return Err(entries.wrong("samples", "a cube without samples".to_owned()));
    }
    if let Some(found) = header.wavelengths_nm.as_ref().map(Vec::len).filter(|found| *found != header.bands) {
        let reason = format!("{found} wavelengths, expected one for each of {} bands", header.bands);
        return Err(entries.wrong("wavelength", reason));
    }
    if header.radiance_scale.is_some_and(|scale| scale < 1.0) {
        let reason = "below 1: some divide by it and some multiply, expected --scale in its place".to_owned();
        return Err(entries.wrong("radiance scale factor", reason));
    }
    if !are_gains_of_reflectance && reflecting.iter().any(Option::is_some) {
        // Both kinds of gains: those of radiance are used, the others named.
        entries.used.retain(|key| !key.starts_with("data reflectance"));
    }
    header.notes = entries.note().into_iter().collect();
    header.notes.extend(entries.note_of_shape());
    header.notes.extend(header.wavelengths_nm.as_deref().and_then(|list| entries.note_of_names(list)));
    header.notes.extend(entries.note_of_good_bands());
    if entries.list.iter().all(|entry| entry.key != "byte order") && header.data_type.bytes() > 1 {
        let note = format!("{}: it does not state the order of bytes: the lowest is taken to be first", name_of(path));
        header.notes.push(note);
    }
    Ok(header)
}

/// Returns the words of a value in braces, a space between them.
fn words_of(value: &str) -> String {
    value.trim_matches(['{', '}']).split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Returns the unit of radiance that a description of a radiance ends in or has in brackets.
fn unit_described(description: &str) -> Option<String> {
    if description.to_lowercase().contains("reflect") {
        return None;
    }
    // An exponent behind a bracket belongs to the unit, as in (cm-1)-1.
    let goes_on = |rest: &str| rest.starts_with(['-', '−', '⁻', '^', '*']);
    let ends = description.match_indices([')', ']']).map(|(at, _)| at + 1);
    let ends = ends.filter(|end| !goes_on(&description[*end..])).chain([description.len()]);
    let unit = |end: usize| LightUnit::in_words(&description[..end]);
    let of_radiance = ends.filter_map(unit).find(|(unit, _)| unit.quantity == Quantity::Radiance);
    of_radiance.map(|(_, words)| words.to_owned())
}

struct Entries<'a> {
    path: &'a Path,
    list: Vec<Entry>,
    used: Vec<String>,
}

impl Entries<'_> {
    fn get(&mut self, key: &str) -> Option<Entry> {
        let found = self.list.iter().find(|entry| entry.key == key).cloned();
        self.used.extend(found.iter().map(|entry| entry.key.clone()));
        found
    }

    /// Names the keys that nothing asked for.
    fn note(&self) -> Option<String> {
        let is_known = |key: &String| self.used.contains(key) || HARMLESS.contains(&key.as_str());
        let left: Vec<String> = self.list.iter().map(|entry| entry.key.clone()).filter(|key| !is_known(key)).collect();
        note_of(self.path, "key", &left)
    }

    /// Returns the words of a list in braces, which is looked at but not used.
    fn words(&self, key: &str) -> Vec<&str> {
        let entry = self.list.iter().find(|entry| entry.key == key);
        let list = entry.map_or("", |entry| entry.value.trim_matches(['{', '}']));
        list.split(',').map(str::trim).filter(|word| !word.is_empty()).collect()
    }

    /// Returns what the second title of plots says that values are, as in `{Wavelength (nm), Radiance (uW/cm2/sr/nm)}`, where it says more than usual.
    fn unit_of_titles(&mut self) -> Option<String> {
        const USUAL: [&str; 6] = ["", "value", "values", "data value", "data values", "radiance"];
        let titles = words_of(&self.get("z plot titles")?.value);
        let (_, title) = titles.split_once(',')?;
        Some(title.trim().to_owned()).filter(|title| !USUAL.contains(&title.to_lowercase().as_str()))
    }

    /// Returns what is said of samples that are not square, and of a map that they are turned on.
    fn note_of_shape(&self) -> Option<String> {
        let side = |word: Option<&&str>| word.and_then(|word| word.parse::<f64>().ok()).filter(|side| *side > 0.0);
        let (sizes, map) = (self.words("pixel size"), self.words("map info"));
        // A projection, two numbers of a sample and two of its place stand before the sides of samples on the map.
        let stated = [("pixel size", [sizes.first(), sizes.get(1)]), ("map info", [map.get(5), map.get(6)])];
        let shapes = stated.into_iter().filter_map(|(key, [across, down])| {
            let (across, down) = (side(across)?, side(down)?);
            ((across / down - 1.0).abs() > 0.01).then(|| format!("'{key}' states samples of {across} × {down}"))
        });
        let turned = map.iter().find_map(|word| {
            let (key, angle) = word.split_once('=')?;
            let degrees: f64 = angle.trim().parse().ok()?;
            (key.trim().eq_ignore_ascii_case("rotation") && degrees != 0.0)
                .then(|| format!("'map info' states that north is turned by {degrees}°"))
        });
        let all: Vec<String> = shapes.chain(turned).collect();
        (!all.is_empty()).then(|| {
            format!(
                "{}: its {}: samples are taken to be square and to lie as stored",
                name_of(self.path),
                all.join(", its ")
            )
        })
    }

    /// Returns what is said of names of bands that state other wavelengths.
    fn note_of_names(&self, wavelengths_nm: &[f64]) -> Option<String> {
        let names = self.words("band names");
        let other = names.iter().zip(wavelengths_nm).find(|(name, nm)| {
            named_nm(name).is_some_and(|(own_nm, half_nm)| (own_nm - **nm).abs() > half_nm.max(1.0))
        });
        other.map(|(name, nm)| {
            format!(
                "{}: its band names state other wavelengths ('{}' of the band at {} nm): those of 'wavelength' are used",
                name_of(self.path),
                shown(name),
                stated::shown(*nm)
            )
        })
    }

    /// Returns what is said of marks of bands that are neither good nor bad.
    fn note_of_good_bands(&self) -> Option<String> {
        let odd = self
            .words("bbl")
            .into_iter()
            .find(|word| word.parse::<f64>().is_ok_and(|mark| mark != 0.0 && mark != 1.0))?;
        Some(format!(
            "{}: its bbl has {}, expected 0 (bad) or 1 (good): bands above 0 are taken to be good",
            name_of(self.path),
            shown(odd)
        ))
    }

    /// Refuses a key that says two things.
    fn check_repeats(&self) -> Result<(), SceneError> {
        for (index, entry) in self.list.iter().enumerate() {
            let is_used = USED.contains(&entry.key.as_str());
            let first = self.list[..index].iter().find(|first| is_used && first.key == entry.key);
            if let Some(first) = first.filter(|first| first.value != entry.value) {
                let reason = format!(
                    "'{}', but line {} has '{}': expected the key once",
                    shown(&entry.value),
                    first.line,
                    shown(&first.value)
                );
                let (file, key) = (self.path.to_owned(), entry.key.clone());
                return Err(SceneError::Header { file, line: entry.line, key, reason });
            }
        }
        Ok(())
    }

    fn wrong(&self, key: &str, reason: String) -> SceneError {
        let line = self.list.iter().find(|entry| entry.key == key).map_or(0, |entry| entry.line);
        SceneError::Header { file: self.path.to_owned(), line, key: key.to_owned(), reason }
    }

    /// Returns how long the light was gathered; what is no number above 0 is left to be named.
    fn exposures(&mut self) -> Vec<(String, f64)> {
        let number = |key: &str| {
            let entry = self.list.iter().find(|entry| entry.key == key)?;
            let number: f64 = entry.value.trim_matches(['{', '}']).trim().parse().ok()?;
            (number.is_finite() && number > 0.0).then(|| (key.to_owned(), number))
        };
        let found: Vec<(String, f64)> = EXPOSURES.iter().filter_map(|key| number(key)).collect();
        self.used.extend(found.iter().map(|(key, _)| key.clone()));
        found
    }

    /// Returns how the camera was set, without the spaces of lists.
    fn settings(&self) -> Vec<(String, String)> {
        let own = self.list.iter().filter(|entry| SETTINGS.contains(&entry.key.as_str()));
        own.map(|entry| (entry.key.clone(), shown(&entry.value.replace(' ', "")))).collect()
    }

    fn number<T: std::str::FromStr>(&mut self, key: &str) -> Result<Option<T>, SceneError> {
        let Some(entry) = self.get(key) else { return Ok(None) };
        match entry.value.parse() {
            Ok(number) => Ok(Some(number)),
            Err(_) => {
                let what = format!("'{}' is not a number that can stand here", shown(&entry.value));
                Err(self.wrong(key, what + ": expected a single one, without a point where it counts"))
            }
        }
    }

    fn positive(&mut self, key: &str) -> Result<Option<f64>, SceneError> {
        let number = self.number::<f64>(key)?;
        if number.is_some_and(|number| !(number.is_finite() && number > 0.0)) {
            return Err(self.wrong(key, "expected a number above 0".to_owned()));
        }
        Ok(number)
    }

    fn required(&mut self, key: &str) -> Result<usize, SceneError> {
        self.number(key)?.ok_or_else(|| self.wrong(key, "the header lacks it".to_owned()))
    }

    /// Returns the numbers of a list in braces.
    fn numbers(&mut self, key: &str) -> Result<Option<Vec<f64>>, SceneError> {
        let Some(entry) = self.get(key) else { return Ok(None) };
        let words = entry.value.trim_start_matches('{').trim_end_matches('}').split(',').map(str::trim);
        let mut numbers = Vec::new();
        for word in words.filter(|word| !word.is_empty()) {
            match word.parse::<f64>() {
                Ok(number) => numbers.push(number),
                Err(_) => return Err(self.wrong(key, format!("'{}' is not a number", shown(word)))),
            }
        }
        Ok(Some(numbers))
    }

    /// Returns the numbers of a list that has one a band.
    fn list(&mut self, key: &str, bands: usize) -> Result<Option<Vec<f64>>, SceneError> {
        let Some(list) = self.numbers(key)? else { return Ok(None) };
        if list.len() != bands || list.iter().any(|number| !number.is_finite()) {
            let reason = format!("{} numbers, expected a finite one for each of {bands} bands", list.len());
            return Err(self.wrong(key, reason));
        }
        Ok(Some(list))
    }

    /// Refuses files whose samples are no plain numbers of an image.
    fn check_kind(&mut self) -> Result<(), SceneError> {
        const OTHERS: [&str; 9] =
            ["library", "classification", "tiff", "hdf", "nitf", "meta", "jpeg", "virtual", "mosaic"];
        if let Some(entry) = self.get("file type") {
            let kind = entry.value.to_ascii_lowercase();
            if OTHERS.iter().any(|other| kind.contains(other)) {
                let reason = format!("'{}', expected ENVI Standard, an image of plain numbers", shown(&entry.value));
                return Err(self.wrong("file type", reason));
            }
        }
        match self.number::<f64>("file compression")? {
            None | Some(0.0) => Ok(()),
            Some(_) => {
                let reason =
                    "the file of numbers is compressed, expected a plain one: unpack it and set it to 0".to_owned();
                Err(self.wrong("file compression", reason))
            }
        }
    }

    fn frame_offsets(&mut self) -> Result<[u64; 2], SceneError> {
        if self.numbers("minor frame offsets")?.is_some_and(|list| list.iter().any(|n| *n != 0.0)) {
            return Err(self.wrong("minor frame offsets", "expected 0, samples that follow each other".to_owned()));
        }
        let Some(list) = self.numbers("major frame offsets")? else { return Ok([0, 0]) };
        let is_count = |n: f64| (0.0..1e15).contains(&n) && n.fract() == 0.0;
        match list[..] {
            [before, after] if is_count(before) && is_count(after) => Ok([before as u64, after as u64]),
            _ => Err(self.wrong("major frame offsets", "expected two numbers of bytes, as {0, 0}".to_owned())),
        }
    }

    fn data_type(&mut self) -> Result<DataType, SceneError> {
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
            6 | 9 => {
                let reason = "it holds complex numbers, expected real ones (1–5 or 12–15): save their magnitudes";
                return Err(self.wrong("data type", reason.to_owned()));
            }
            other => return Err(self.wrong("data type", format!("{other}, expected 1–5 or 12–15"))),
        })
    }

    fn interleave(&mut self) -> Result<Interleave, SceneError> {
        let value = self.get("interleave").map(|entry| entry.value.to_ascii_lowercase());
        match value.as_deref() {
            Some("bsq") => Ok(Interleave::Bsq),
            Some("bil") => Ok(Interleave::Bil),
            Some("bip") => Ok(Interleave::Bip),
            Some(other) => Err(self.wrong("interleave", format!("'{}', expected bsq, bil or bip", shown(other)))),
            None => Err(self.wrong("interleave", "the header lacks it".to_owned())),
        }
    }

    fn wavelengths_nm(&mut self) -> Result<Option<Vec<f64>>, SceneError> {
        let unit = self.get("wavelength units").map(|entry| entry.value.to_ascii_lowercase());
        let Some(numbers) = self.numbers("wavelength")? else { return Ok(None) };
        match unit.as_deref() {
            Some("index") => Ok(None),
            None | Some("unknown" | "") => {
                let reason = "the header does not say their unit, and they are no likely nm or µm: expected 'wavelength units' in \
                              the header, or --scene-wavelengths-nm";
                without_unit(&numbers).map(Some).ok_or_else(|| self.wrong("wavelength", reason.to_owned()))
            }
            Some(other) => match in_nm(other, &numbers) {
                Some(all) => match all.iter().zip(&numbers).find(|(nm, _)| !PLAUSIBLE_NM.contains(*nm)) {
                    Some((_, number)) => {
                        let reason =
                            format!("{} in {} is no wavelength of light", stated::shown(*number), shown(other));
                        Err(self.wrong("wavelength units", reason))
                    }
                    None => Ok(Some(all)),
                },
                None => Err(self.wrong("wavelength units", format!("'{}', expected {UNITS}", shown(other)))),
            },
        }
    }
}

/// Returns the wavelength that the name of a band ends in or has in brackets, and half its last digit, nm: `550 nm`, `Red (0.66 Micrometers)`.
fn named_nm(name: &str) -> Option<(f64, f64)> {
    let words: Vec<&str> =
        name.split(|c: char| c.is_whitespace() || "()[]:_".contains(c)).filter(|w| !w.is_empty()).collect();
    words.iter().enumerate().find_map(|(index, word)| {
        let end = word.find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(word.len());
        let (number, unit) = word.split_at(end);
        let unit = if unit.is_empty() { words.get(index + 1).copied()? } else { unit };
        // A letter alone is a name.
        let unit = Some(unit).filter(|unit| unit.len() > 1)?;
        let digits = number.split_once('.').map_or(0, |(_, digits)| digits.len());
        let own = in_nm(unit, &[number.parse().ok()?, 0.5 * 0.1_f64.powi(digits as i32)])?;
        PLAUSIBLE_NM.contains(&own[0]).then(|| (own[0], own[1]))
    })
}

/// Returns a key as it is known, whatever its spaces.
fn known_key(key: &str) -> String {
    let squeezed = |text: &str| text.chars().filter(|c| !c.is_whitespace() && *c != '_').collect::<String>();
    let own = squeezed(key);
    let known = USED.iter().chain(&HARMLESS).find(|known| squeezed(known) == own);
    known.map_or_else(|| key.to_owned(), |known| (*known).to_owned())
}

/// Splits the text into entries; a value in braces may run over many lines.
fn entries(path: &Path, text: &str) -> Result<Vec<Entry>, SceneError> {
    let wrong = |line: usize, key: &str, reason: &str| {
        Err(SceneError::Header { file: path.to_owned(), line, key: shown(key), reason: reason.to_owned() })
    };
    let mut lines = text.lines().enumerate().map(|(i, line)| (i + 1, line.trim()));
    match lines.next() {
        Some((_, "ENVI")) => {}
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
        list.push(Entry { line, key: known_key(&key), value });
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
    fn exponents_behind_brackets_belong_to_units() {
        for words in ["W m⁻² sr⁻¹ (cm⁻¹)⁻¹", "mW m-2 sr-1 (cm-1)-1"] {
            assert_eq!(unit_described(&format!("calibrated radiance, {words}")).as_deref(), Some(words));
        }
    }

    #[test]
    fn a_header_is_read() {
        let header = parse(Path::new("a.hdr"), GOOD).unwrap();
        assert_eq!((header.columns, header.rows, header.bands, header.offset), (4, 3, 2, 16));
        assert_eq!((header.data_type, header.interleave), (DataType::U16, Interleave::Bil));
        assert!(header.is_big_endian);
        assert_eq!((header.wavelengths_nm, header.reflectance_scale), (Some(vec![500.0, 600.0]), Some(10000.0)));
        assert_eq!(header.notes, [""; 0]);
    }

    #[test]
    fn all_that_a_header_states_is_used_or_named() {
        let text = GOOD
            .replace("bands = 2", "bands=2\nbbl = {1, 0}\nDATA_GAIN_VALUES = {2, 3}\ndata ignore value = -9999")
            + "description = { a\n b }\nfrobnicate = {1}\nsamples = 4\nmajor frame offsets = {8, 4}\n";
        let header = parse(Path::new("folder/a.hdr"), &text).unwrap();
        assert_eq!((header.columns, header.frame_offsets, header.ignored), (4, [8, 4], Some(-9999.0)));
        assert_eq!((header.bad_bands, header.gains), (vec![false, true], Some(vec![2.0, 3.0])));
        assert_eq!(header.notes, ["a.hdr: its key 'frobnicate' is not used"]);
    }

    #[test]
    fn what_contradicts_the_numbers_is_said() {
        let notes = |more: &str| parse(Path::new("a.hdr"), &format!("{GOOD}{more}\n")).unwrap().notes.join(" ");
        for more in [
            "pixel size = {2, 2, units=Meters}",
            "map info = {UTM, 1, 1, 5e5, 4e6, 30, 30, 13, North, WGS-84, units=Meters, rotation=0}",
            "band names = {500 nm, Red (0.6 Micrometers)}",
            "band names = {Band 1, Band 2}",
            "band names = {2 m, 600 nm}",
            "bbl = {1, 1}",
        ] {
            assert_eq!(notes(more), "", "{more}");
        }
        for (more, words) in [
            ("pixel size = {1, 2, units=Meters}", "'pixel size' states samples of 1 × 2"),
            (
                "map info = {UTM, 1, 1, 5e5, 4e6, 10, 20, 13, North, rotation=30}",
                "of 10 × 20, its 'map info' states that north",
            ),
            ("band names = {600 nm, 500 nm}", "'600 nm' of the band at 500 nm"),
            ("band names = {a (0.50 um), b (0.72 Micrometers)}", "of the band at 600 nm"),
            ("bbl = {1, 2}", "its bbl has 2"),
        ] {
            assert!(notes(more).contains(words), "{more}: {}", notes(more));
        }
        let bad = parse(Path::new("a.hdr"), &format!("{GOOD}bbl = {{-1, 1}}\n")).unwrap();
        assert!(bad.bad_bands == [true, false] && bad.notes[0].contains("-1"), "{:?}", bad.notes);
    }

    #[test]
    fn wavelengths_without_a_unit_are_not_guessed() {
        let read = |units: &str, list: &str| {
            let text = GOOD.replace("Wavelength Units = Micrometers", units).replace("{0.5,\n 0.6,\n}", list);
            parse(Path::new("a.hdr"), &text).map(|header| header.wavelengths_nm)
        };
        assert_eq!(read("", "{0.5, 0.6}").unwrap(), Some(vec![500.0, 600.0]));
        assert_eq!(read("", "{500, 600}").unwrap(), Some(vec![500.0, 600.0]));
        assert_eq!(read("wavelength units = Index", "{1, 2}").unwrap(), None);
        assert_eq!(read("wavelength units = Wavenumber", "{20000, 10000}").unwrap(), Some(vec![500.0, 1000.0]));
        for list in ["{1, 2}", "{0, 1}", "{30, 40}", "{0.5, 600}"] {
            assert!(read("", list).unwrap_err().to_string().contains("--scene-wavelengths-nm"), "{list}");
        }
    }

    #[test]
    fn wrong_headers_are_refused_by_line_and_key() {
        for (from, to, words) in [
            ("ENVI", "ENVY", "line 1"),
            ("samples = 4", "samples = four", "line 3: 'samples': 'four'"),
            ("samples = 4", "samples = 0", "without samples"),
            ("lines   = 3", "", "'lines': the header lacks it"),
            ("data type = 12", "data type = 6", "line 7: 'data type': it holds complex numbers"),
            ("data type = 12", "data type = 7", "line 7: 'data type': 7, expected"),
            ("BIL", "bob", "expected bsq, bil or bip"),
            ("byte order = 1", "byte order = 2", "expected 0 or 1"),
            ("Micrometers", "furlongs", "'wavelength units': 'furlongs'"),
            (" 0.6,\n}", " 0.6,\n", "never closed"),
            (" 0.6,\n}", "}", "1 wavelengths, expected one for each of 2"),
            (" 0.6,", " six,", "'six'"),
            ("10000.0", "-1", "above 0"),
            ("interleave", "file type = ENVI Spectral Library\ninterleave", "ENVI Standard"),
            ("interleave", "file compression = 1\ninterleave", "compressed"),
            ("interleave", "bbl = {1}\ninterleave", "1 numbers, expected"),
            ("interleave", "data gain values = {1, nan}\ninterleave", "finite"),
            ("interleave", "radiance scale factor = 0.1\ninterleave", "--scale"),
            ("interleave", "minor frame offsets = {1, 0}\ninterleave", "expected 0"),
            ("byte order = 1", "byte order", "expected 'key = value'"),
            ("interleave", "SAMPLES = 5\ninterleave", "line 8: 'samples': '5', but line 3 has '4'"),
        ] {
            let message = parse(Path::new("a.hdr"), &GOOD.replace(from, to)).unwrap_err().to_string();
            assert!(message.contains(words) && message.starts_with("a.hdr: "), "{message}");
        }
    }
}
