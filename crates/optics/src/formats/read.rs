//! Reading a lens file of any format, by its extension.

use std::path::Path;

use dioptric_files::text;

use crate::{GlassCatalogue, Lens, OpticsError};

use super::{
    bench, dat,
    decode::bytes_of,
    deeplens,
    glasses::Glasses,
    iset_json, len,
    lens_file::{LensFile, ReadOptions},
    pbrt_list,
    prescription::file_from_ron,
    seq,
    text_error::TextError,
    zar, zmx,
};

/// The shortest wavelength that a lens is of, nm; what is less was meant in micrometres.
const SHORTEST_NM: f64 = 10.0;

impl Lens {
    /// Reads a lens file, by its extension: `.ron` (our own), `.dat`, `.json`, `.zmx`, `.zar`, `.seq`, `.len` or `.lens`.
    ///
    /// [`LensFile::read`](crate::LensFile::read) returns what else the file states, as where the film lies.
    ///
    /// # Errors
    /// When the file cannot be read or is not what it should be; the message names the file and, where it can, the
    /// line and key.
    pub fn read(path: &Path) -> Result<Self, OpticsError> {
        LensFile::read(path, &ReadOptions::default()).map(|file| file.lens)
    }
}

impl LensFile {
    /// Reads a lens file, by its extension: `.ron` (our own), `.dat` or `.txt`, `.json` (ISET's omni format or
    /// `DeepLens`), `.zmx` and `.zar` (Zemax), `.seq` (CODE V), `.len` (OSLO), `.txt` (the Optical Bench's) or `.lens`.
    ///
    /// A glass catalogue beside a `.zmx` file that has its name and the extension `.agf` is read with it.
    ///
    /// # Errors
    /// When the file cannot be read, is not what it should be, or holds what this crate cannot trace; the message
    /// names the file and, where it can, the line and key.
    pub fn read(path: &Path, options: &ReadOptions) -> Result<Self, OpticsError> {
        let companion = path.with_extension("agf");
        if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("zmx")) && companion.is_file() {
            let mut options = options.clone();
            options.catalogues.push(GlassCatalogue::read(&companion)?);
            return Self::from_bytes(path, &bytes_of(path)?, &options);
        }
        Self::from_bytes(path, &bytes_of(path)?, options)
    }

    /// Reads a lens file from its bytes; the path gives the format and the name, and is not opened.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn from_bytes(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Self, OpticsError> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        let name = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        // Lines end by a carriage return alone on old Macintoshes.
        let text = text::of_bytes(bytes);
        let text = if text.contains('\n') { text } else { text.replace('\r', "\n") };
        let glasses = Glasses::new(options);
        let read: Result<Self, TextError> = match extension.as_str() {
            "ron" => file_from_ron(&text),
            "lens" => bench::lens_from_lens_text(&text, &name),
            "txt" if bench::is_bench(&text) => bench::lens_from_bench(&text, &name, &glasses),
            "dat" | "txt" => match pbrt_list::numbers_of(&text) {
                Some(numbers) => pbrt_list::lens_from_numbers(&numbers, &name).map(Self::of_lens),
                None => dat::lens_from_dat(&text, &name).map(Self::of_lens),
            },
            "json" => json(&text, &name, &glasses),
            "len" => len::lens_from_len(&text, &name, &glasses),
            "zmx" => zmx::lens_from_zmx(&text, &name, glasses),
            "seq" => seq::lens_from_seq(&text, &name, glasses),
            "zar" => return Self::from_archive(path, bytes, options),
            "zos" => {
                let reason =
                    "the layout of .zos files is not published: save the lens as .zmx and read that".to_owned();
                return Err(OpticsError::Io { path: path.to_owned(), reason });
            }
            _ => {
                let expected = "expected .ron, .dat, .txt, .json, .zmx, .zar, .seq, .len or .lens";
                let reason = format!("the extension '.{extension}' is no lens format; {expected}");
                return Err(OpticsError::Io { path: path.to_owned(), reason });
            }
        };
        let read = read.and_then(Self::with_wavelengths_of_light).and_then(|file| file.in_use(options.configuration));
        read.map_err(|TextError { line, reason }| OpticsError::File { path: path.to_owned(), line, reason })
    }

    /// Reads the lens of a Zemax archive, with the glasses that are in it.
    fn from_archive(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Self, OpticsError> {
        let wrong = |reason: String| OpticsError::Io { path: path.to_owned(), reason };
        let files = zar::unpack(bytes).map_err(wrong)?;
        let names = |files: &[&zar::Packed]| files.iter().map(|file| file.name.as_str()).collect::<Vec<_>>().join(", ");
        let lenses: Vec<_> = files.iter().filter(|file| file.has_extension("zmx")).collect();
        let [lens] = lenses.as_slice() else {
            let found = names(&files.iter().collect::<Vec<_>>());
            return Err(wrong(format!(
                "the archive has {} lenses as .zmx, expected one; it holds {found}",
                lenses.len()
            )));
        };
        let mut options = options.clone();
        for file in files.iter().filter(|file| file.has_extension("agf")) {
            options.catalogues.push(GlassCatalogue::from_bytes(Path::new(&file.name), &file.bytes)?);
        }
        let mut read = Self::from_bytes(&path.with_file_name(&lens.name), &lens.bytes, &options)?;
        let left: Vec<_> =
            files.iter().filter(|file| !(file.has_extension("zmx") || file.has_extension("agf"))).collect();
        if !left.is_empty() {
            read.notes.push(format!(
                "{} of the archive are left aside, which say nothing of the lens but its coatings",
                names(&left)
            ));
        }
        Ok(read)
    }

    /// Returns the file if its wavelengths, of all configurations, are of light.
    fn with_wavelengths_of_light(self) -> Result<Self, TextError> {
        let all =
            self.states().into_iter().flat_map(|state| state.wavelengths_nm.clone()).chain(self.wavelengths_nm.clone());
        match all.into_iter().find(|nm| *nm < SHORTEST_NM) {
            Some(nm) => {
                let reason = format!("a wavelength is {nm} nm, expected {SHORTEST_NM} nm or more");
                Err(TextError { line: None, reason })
            }
            None => Ok(self),
        }
    }

    /// Returns the file with the configuration in use that was asked for; where none was, with a note on the one that is.
    fn in_use(mut self, asked: Option<usize>) -> Result<Self, TextError> {
        if let Some(number) = asked {
            return Ok(self.with_configuration(number)?);
        }
        self.notes.extend(self.note_on_configuration());
        Ok(self)
    }
}

fn json(text: &str, name: &str, glasses: &Glasses) -> Result<LensFile, TextError> {
    let value = serde_json::from_str(text)
        .map_err(|error| TextError { line: Some(error.line()), reason: format!("not JSON: {error}") })?;
    if deeplens::is_deeplens(&value) {
        deeplens::lens_from_deeplens(&value, name, glasses)
    } else {
        iset_json::lens_from_omni(&value, name, glasses)
    }
}
