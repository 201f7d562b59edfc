//! Lens files of every format: the lens, and what else the file says about its use.

use std::{fs, path::Path};

use serde::{Deserialize, Serialize};

use crate::{
    GlassCatalogue, Lens, OpticsError,
    prescription::{TextError, file_from_ron},
};

use super::{dat, decode::text_of, deeplens, glasses::Glasses, iset_json, pbrt_list, seq, zmx};

/// What a lens file says: the lens, and how it is meant to be used.
///
/// Files of the `.dat` kind hold the lens alone.
#[derive(Clone, Debug, PartialEq)]
pub struct LensFile {
    /// The lens.
    pub lens: Lens,
    /// Distance from the last vertex to the film, mm, where the file states it.
    pub film_distance_mm: Option<f64>,
    /// Distance from the object to the first vertex, mm; `None` where it is far away or not stated.
    pub object_distance_mm: Option<f64>,
    /// The wavelengths that the file names, nm.
    pub wavelengths_nm: Vec<f64>,
    /// The one of them that first-order data refer to, nm.
    pub reference_wavelength_nm: Option<f64>,
    /// The fields that the file names.
    pub fields: Vec<Field>,
    /// The array of microlenses before the film that the file states. It is kept, not traced.
    pub microlens: Option<Microlens>,
    /// What the file says and this crate does otherwise or not at all, a sentence each.
    pub notes: Vec<String>,
}

/// An array of like microlenses before the film.
#[derive(Clone, Debug, PartialEq)]
pub struct Microlens {
    /// How many there are along x and y.
    pub dimensions: [usize; 2],
    /// The shift of each from its place in the grid, mm; empty where none is shifted.
    pub offsets_mm: Vec<[f64; 2]>,
    /// One of them. Where the file marks no stop, its first surface is it.
    pub lens: Lens,
}

/// A point of the field, as lens files name them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Field {
    /// The angle in object space, degrees, at the entrance pupil: positive where the chief ray's slope is, as light from an
    /// object at negative coordinates has it. So Zemax's manual says, and so ray-optics reads CODE V's (`obj_coords`).
    Angle {
        /// In the x–z plane.
        x_deg: f64,
        /// In the y–z plane.
        y_deg: f64,
    },
    /// The height of the object point, mm.
    ObjectHeight {
        /// Along x.
        x_mm: f64,
        /// Along y.
        y_mm: f64,
    },
    /// The height of the image point, mm, by first-order optics.
    ImageHeight {
        /// Along x.
        x_mm: f64,
        /// Along y.
        y_mm: f64,
    },
    /// The height at which the real chief ray meets the film, mm.
    RealImageHeight {
        /// Along x.
        x_mm: f64,
        /// Along y.
        y_mm: f64,
    },
}

/// What to do with a glass that no catalogue has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum MissingGlass {
    /// Refuse the file and say which glass is missing.
    #[default]
    Refuse,
    /// Take the index and Abbe number that the file states for it, if any.
    FromNdVd,
    /// Take the built-in glass nearest to the index and Abbe number that the file states, if any.
    Nearest,
}

/// What the numbers of surfaces are in a CODE V file that says neither (`RDM`, `CUM`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum SeqNumbers {
    /// Radii of curvature.
    Radii,
    /// Curvatures.
    Curvatures,
}

/// How to read a lens file.
#[derive(Clone, Debug, Default)]
pub struct ReadOptions {
    /// Catalogues to look in before the built-in one.
    pub catalogues: Vec<GlassCatalogue>,
    /// What to do with a glass that no catalogue has.
    pub missing_glass: MissingGlass,
    /// What the numbers of surfaces are in a CODE V file that does not say; `None` for what is plausible.
    pub seq_numbers: Option<SeqNumbers>,
}

/// The largest lens file, bytes: far more than any lens needs.
const LARGEST_FILE: u64 = 16 << 20;

impl LensFile {
    /// Reads a lens file, by its extension: `.ron` (our own), `.dat` or `.txt`, `.json` (ISET's omni format or
    /// `DeepLens`), `.zmx` (Zemax) or `.seq` (CODE V).
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

    /// Reads a lens file from its bytes; the path tells the format and the name, and is not opened.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn from_bytes(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Self, OpticsError> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        let name = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        let text = text_of(bytes);
        let glasses = Glasses::new(options);
        let read = match extension.as_str() {
            "ron" => file_from_ron(&text),
            "dat" | "txt" => match pbrt_list::numbers_of(&text) {
                Some(numbers) => pbrt_list::lens_from_numbers(&numbers, &name).map(Self::of_lens),
                None => dat::lens_from_dat(&text, &name).map(Self::of_lens),
            },
            "json" => json(&text, &name, &glasses),
            "zmx" => zmx::lens_from_zmx(&text, &name, glasses),
            "seq" => seq::lens_from_seq(&text, &name, glasses),
            _ => {
                let expected = "expected .ron, .dat, .txt, .json, .zmx or .seq";
                let reason = format!("the extension '.{extension}' is no lens format; {expected}");
                return Err(OpticsError::Io { path: path.to_owned(), reason });
            }
        };
        read.map_err(|TextError { line, reason }| OpticsError::File { path: path.to_owned(), line, reason })
    }

    pub(super) fn of_lens(lens: Lens) -> Self {
        Self {
            lens,
            film_distance_mm: None,
            object_distance_mm: None,
            wavelengths_nm: Vec::new(),
            reference_wavelength_nm: None,
            fields: Vec::new(),
            microlens: None,
            notes: Vec::new(),
        }
    }
}

/// Returns what a file holds, unless it is larger than any that this crate reads.
pub(super) fn bytes_of(path: &Path) -> Result<Vec<u8>, OpticsError> {
    let failed = |reason: String| OpticsError::Io { path: path.to_owned(), reason };
    let n_bytes = fs::metadata(path).map_err(|error| failed(error.to_string()))?.len();
    if n_bytes > LARGEST_FILE {
        return Err(failed(format!("the file has {n_bytes} bytes; expected at most {LARGEST_FILE}")));
    }
    fs::read(path).map_err(|error| failed(error.to_string()))
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
