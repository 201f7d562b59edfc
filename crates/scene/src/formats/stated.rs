//! What a file states, and what becomes of it.
//!
//! Whatever a reader meets by name (keys of a header, attributes, channels, parts, variables, pages) it puts into a [`Stated`] and
//! takes out what it uses. What is left and is not known to be harmless is named in a note: nothing that a file states is dropped.
//! Readers, of a scene's own file as of those beside it, return [`Noted`] values, which cannot be had without a place for the notes.

use std::path::{Path, PathBuf};

/// How many names a note holds; of more it has the number.
const MOST_NAMES: usize = 6;
/// Characters of a name that a note shows.
const MOST_CHARACTERS: usize = 40;

/// Names of one kind in a file, each with what stands under it.
#[derive(Clone, Debug)]
pub(super) struct Stated<T> {
    /// What they are: "key", "channel".
    kind: &'static str,
    entries: Vec<(String, T)>,
}

impl<T> Stated<T> {
    pub(super) fn new(kind: &'static str, entries: Vec<(String, T)>) -> Self {
        Self { kind, entries }
    }

    /// Takes the first entry of a name.
    pub(super) fn take(&mut self, name: &str) -> Option<T> {
        self.take_where(|own| own == name).map(|(_, value)| value)
    }

    /// Takes the first entry of the first of these names that is there however it is written: `imagewidth` for `image_width` and `imageWidth`.
    pub(super) fn take_called(&mut self, names: &[&str]) -> Option<(String, T)> {
        names.iter().find_map(|name| self.take_where(|own| bare(own) == *name))
    }

    /// Takes the first entry whose name is wanted; the others keep their order.
    pub(super) fn take_where(&mut self, is_wanted: impl Fn(&str) -> bool) -> Option<(String, T)> {
        let index = self.entries.iter().position(|(name, _)| is_wanted(name))?;
        Some(self.entries.remove(index))
    }

    /// Takes all entries whose names are wanted, in their order.
    pub(super) fn take_all(&mut self, is_wanted: impl Fn(&str) -> bool) -> Vec<(String, T)> {
        let (taken, left) = std::mem::take(&mut self.entries).into_iter().partition(|(name, _)| is_wanted(name));
        self.entries = left;
        taken
    }

    /// Adds entries of names that it does not have.
    pub(super) fn merge(&mut self, other: Self) {
        let new = other.entries.into_iter().filter(|(name, _)| self.entries.iter().all(|(own, _)| own != name));
        self.entries.extend(new.collect::<Vec<_>>());
    }

    pub(super) fn get(&self, name: &str) -> Option<&T> {
        self.entries.iter().find(|(own, _)| own == name).map(|(_, value)| value)
    }

    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.entries.iter().map(|(name, _)| name.as_str())
    }

    /// Returns the note of what is left, but for what is known to change nothing.
    pub(super) fn note(self, file: &Path, is_harmless: impl Fn(&str) -> bool) -> Option<String> {
        let left: Vec<String> =
            self.entries.into_iter().map(|(name, _)| name).filter(|name| !is_harmless(name)).collect();
        note_of(file, self.kind, &left)
    }
}

/// What was read of a file, with what is to be said of it: the first cannot be had without a place for the second.
#[must_use]
#[derive(Clone, Debug, PartialEq)]
pub struct Noted<T> {
    value: T,
    notes: Vec<String>,
}

impl<T> Noted<T> {
    /// Puts a value and the sentences on its file together.
    pub fn new(value: T, notes: impl IntoIterator<Item = String>) -> Self {
        Self { value, notes: notes.into_iter().collect() }
    }

    /// Returns another value of the same file.
    pub(crate) fn map<U>(self, of: impl FnOnce(T) -> U) -> Noted<U> {
        Noted { value: of(self.value), notes: self.notes }
    }

    /// Returns what is made of the value.
    ///
    /// # Errors
    /// That of whoever makes it.
    pub fn try_map<U, E>(self, of: impl FnOnce(T) -> Result<U, E>) -> Result<Noted<U>, E> {
        Ok(Noted { value: of(self.value)?, notes: self.notes })
    }

    /// Returns what was read of a file that the program wrote itself and reads again, of which nothing is to be said.
    pub fn of_own_file(self) -> T {
        self.value
    }

    /// Returns what was read, and puts what is to be said of it behind the notes of who asked.
    pub fn told_in(self, notes: &mut Vec<String>) -> T {
        notes.extend(self.notes);
        self.value
    }
}

/// Returns the notes on several files of a folder, each of the same words once.
pub(super) fn merged(files: impl Iterator<Item = (PathBuf, Vec<String>)>) -> Vec<String> {
    let mut told: Vec<(String, String, usize)> = vec![];
    for (file, notes) in files {
        let start = format!("{}: ", name_of(&file));
        for note in notes {
            let words = note.strip_prefix(&start).unwrap_or(&note).to_owned();
            match told.iter_mut().find(|(own, ..)| *own == words) {
                Some((.., n_more)) => *n_more += 1,
                None => told.push((words, note, 0)),
            }
        }
    }
    let sentence = |(_, note, n_more): (String, String, usize)| match n_more {
        0 => note,
        n => format!("{note}; {n} files beside it say the same"),
    };
    told.into_iter().map(sentence).collect()
}

/// Returns the sentence that names what of a file is not used.
pub(super) fn note_of(file: &Path, kind: &str, names: &[String]) -> Option<String> {
    if names.is_empty() {
        return None;
    }
    // Of many what may change numbers stands first, all of it.
    let is_first = |name: &&String| names.len() > MOST_NAMES && is_of_numbers(name);
    let (first, rest): (Vec<&String>, Vec<&String>) = names.iter().partition(is_first);
    let n = MOST_NAMES.max(first.len()).min(names.len());
    let last_of = |name: &String| match name.rsplit_once('/') {
        Some((_, last)) if name.chars().count() > MOST_CHARACTERS => short(&format!("…/{last}")),
        _ => short(name),
    };
    let shown: Vec<String> = first.into_iter().chain(rest).take(n).map(|name| format!("'{}'", last_of(name))).collect();
    let more = match names.len() - n {
        0 => String::new(),
        n => format!(" and {n} more"),
    };
    let (plural, are) = if names.len() == 1 { ("", "is") } else { ("s", "are") };
    Some(format!("{}: its {kind}{plural} {}{more} {are} not used", name_of(file), shown.join(", ")))
}

/// Whether a name is that of what makes quantities of numbers.
fn is_of_numbers(name: &str) -> bool {
    let lower = name.to_lowercase();
    ["scale", "factor", "gain", "offset", "unit", "slope", "intercept"].iter().any(|word| lower.contains(word))
}

/// Returns the letters and digits of a name, in small letters.
pub(super) fn bare(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

/// Returns the name of a file, for a note.
pub(super) fn name_of(file: &Path) -> String {
    file.file_name().unwrap_or(file.as_os_str()).to_string_lossy().into_owned()
}

/// Returns the start of a text of a file, for a message.
pub(super) fn short(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).take(MOST_CHARACTERS).collect()
}

/// Whether a text says something of numbers or of a view, and not who made them when: a unit, or a quantity with a number.
pub(super) fn tells(text: &str) -> bool {
    const UNITS: [&str; 44] = [
        "mm",
        "cm",
        "km",
        "nm",
        "um",
        "µm",
        "percent",
        "inch",
        "inches",
        "feet",
        "inverse",
        "disparity",
        "disparities",
        "reciprocal",
        "wavenumber",
        "thz",
        "radiance",
        "irradiance",
        "reflectance",
        "reflectances",
        "luminance",
        "absorbance",
        "transmittance",
        "photons",
        "watt",
        "watts",
        "lux",
        "nits",
        "candela",
        "radial",
        "euclidean",
        "axial",
        "distance",
        "distances",
        "flipped",
        "mirrored",
        "rotated",
        "upside",
        "linear",
        "ray",
        "rays",
        "normalized",
        "normalised",
        "uncalibrated",
    ];
    const PARTS: [&str; 4] = ["metre", "meter", "micron", "angstrom"];
    const QUANTITIES: [&str; 19] = [
        "depth",
        "scale",
        "unit",
        "focal",
        "fov",
        "wavelength",
        "gain",
        "offset",
        "baseline",
        "exposure",
        "gamma",
        "divide",
        "divided",
        "multiply",
        "multiplied",
        "times",
        "factor",
        "dark",
        "bands",
    ];
    let lower = text.to_lowercase();
    let words: Vec<&str> = lower.split(|c: char| !c.is_alphabetic()).filter(|word| !word.is_empty()).collect();
    let has = |known: &str| words.iter().any(|word| *word == known || (known.len() > 3 && word.contains(known)));
    let has_digit = lower.contains(|c: char| c.is_ascii_digit());
    words.iter().any(|word| UNITS.contains(word) || PARTS.iter().any(|part| word.contains(part)))
        || has_digit && QUANTITIES.iter().any(|known| has(known))
}

/// Whether a name has a unit of light, or of a share, among its words, as `radiance_uW` and `reflectance_percent`.
pub(super) fn names_unit_of_light(name: &str) -> bool {
    const UNITS: [&str; 14] = [
        "kw",
        "mw",
        "uw",
        "µw",
        "μw",
        "watt",
        "watts",
        "milliwatt",
        "milliwatts",
        "microwatt",
        "microwatts",
        "percent",
        "pct",
        "%",
    ];
    let words = name.split(|c: char| !c.is_alphanumeric() && c != '%').filter(|word| !word.is_empty());
    let is_unit = |(i, word): (usize, &str)| {
        let unit = word.trim_start_matches(|c: char| c.is_ascii_digit());
        UNITS.contains(&unit.to_lowercase().as_str()) || i > 0 && unit == "W"
    };
    words.enumerate().any(is_unit)
}

/// Returns a number of a file for a message, however large or small.
pub(super) fn shown(number: f64) -> String {
    let is_usual = number == 0.0 || !number.is_finite() || (1e-4..1e9).contains(&number.abs());
    if is_usual { number.to_string() } else { format!("{number:e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notes_of_several_files_are_told_once() {
        let notes = |name: &str, words: &[&str]| {
            (PathBuf::from("f").join(name), words.iter().map(|words| format!("{name}: {words}")).collect::<Vec<_>>())
        };
        let told = merged([notes("a", &["x"]), notes("b", &["x", "y"]), notes("c", &["x"])].into_iter());
        assert_eq!(told, ["a: x; 2 files beside it say the same", "b: y"]);
        let mut all = vec!["before".to_owned()];
        assert_eq!(Noted::new(4, told).told_in(&mut all), 4);
        assert_eq!(all.len(), 3);
    }

    #[test]
    fn names_have_units() {
        for name in
            ["radiance_uW", "radiance_2_uW", "refl_percent", "cube (mW/m2)", "L_W_m2_sr_um", "2uW_cube", "refl_%"]
        {
            assert!(names_unit_of_light(name), "{name}");
        }
        for name in ["radiance", "W", "cube_1", "window", "Wcube", "scene_450_700nm"] {
            assert!(!names_unit_of_light(name), "{name}");
        }
    }

    #[test]
    fn what_is_left_is_named() {
        let entries = ["a", "b", "b", "time"].map(|name| (name.to_owned(), ())).to_vec();
        let mut stated = Stated::new("key", entries);
        assert!(stated.take("b").is_some() && stated.take("c").is_none());
        let file = Path::new("folder/x.hdr");
        // A name that stands twice is used once.
        let note = stated.clone().note(file, |name| name == "time");
        assert_eq!(note.as_deref(), Some("x.hdr: its keys 'a', 'b' are not used"));
        stated.take_all(|name| name != "time");
        assert_eq!(stated.note(file, |name| name == "time"), None);
        let many = (0..9).map(|i| (format!("{i}\n{}", "x".repeat(99)), ())).collect();
        let note = Stated::new("channel", many).note(file, |_| false).unwrap();
        assert!(note.contains("and 3 more") && note.chars().count() < 400 && !note.contains('\n'), "{note}");
    }

    #[test]
    fn what_may_change_numbers_stands_first_of_many() {
        let names = ["a", "b", "c", "d", "e", "f", "g", "Scalefactor"].map(str::to_owned);
        let note = note_of(Path::new("x"), "key", &names).unwrap();
        assert_eq!(note, "x: its keys 'Scalefactor', 'a', 'b', 'c', 'd', 'e' and 2 more are not used");
        let long = ["HDFEOS/SWATHS/PRS_L1_HCO/Data Fields/VNIR_Cube".to_owned()];
        assert_eq!(note_of(Path::new("x"), "variable", &long).unwrap(), "x: its variable '…/VNIR_Cube' is not used");
    }
}
