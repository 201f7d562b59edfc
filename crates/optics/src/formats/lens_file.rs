//! Lens files of every format: the lens, and what else the file says about its use.

use serde::{Deserialize, Serialize};

use crate::{GlassCatalogue, Lens};

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
    /// The weight of each of them; empty where they count alike.
    pub wavelength_weights: Vec<f64>,
    /// The one of them that first-order data refer to, nm.
    pub reference_wavelength_nm: Option<f64>,
    /// The fields that the file names.
    pub fields: Vec<Field>,
    /// The weight of each of them; empty where they count alike.
    pub field_weights: Vec<f64>,
    /// What the file calls each surface; empty where it names none.
    pub surface_comments: Vec<String>,
    /// What the file says of itself beside the source of the lens, a line each.
    pub comments: Vec<String>,
    /// The array of microlenses before the film that the file states. It is kept, not traced.
    pub microlens: Option<Microlens>,
    /// All configurations of a file that has several, the one in use among them; empty where there is one alone.
    pub configurations: Vec<Configuration>,
    /// Which of them is in use, counted from 1: the lens and its use are its own.
    pub configuration: usize,
    /// What the file says and this crate does otherwise or not at all, a sentence each.
    pub notes: Vec<String>,
}

/// One of several configurations of a lens: a position of a zoom lens, a distance that it is focused on, a glass put in.
///
/// All configurations of a file have the same surfaces; what differs is how these stand, and how the lens is used.
#[derive(Clone, Debug, PartialEq)]
pub struct Configuration {
    /// What the file calls it; empty where it does not.
    pub name: String,
    /// The lens.
    pub lens: Lens,
    /// As [`LensFile::film_distance_mm`].
    pub film_distance_mm: Option<f64>,
    /// As [`LensFile::object_distance_mm`].
    pub object_distance_mm: Option<f64>,
    /// As [`LensFile::wavelengths_nm`].
    pub wavelengths_nm: Vec<f64>,
    /// As [`LensFile::wavelength_weights`].
    pub wavelength_weights: Vec<f64>,
    /// As [`LensFile::reference_wavelength_nm`].
    pub reference_wavelength_nm: Option<f64>,
    /// As [`LensFile::fields`].
    pub fields: Vec<Field>,
    /// As [`LensFile::field_weights`].
    pub field_weights: Vec<f64>,
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
    /// Makers whose glass a name means that several have, the first first; before those that the file names.
    pub makers: Vec<String>,
    /// What to do with a glass that no catalogue has.
    pub missing_glass: MissingGlass,
    /// What the numbers of surfaces are in a CODE V file that does not say; `None` for what is plausible.
    pub seq_numbers: Option<SeqNumbers>,
    /// Which configuration of a file that has several, counted from 1; `None` for the one that the file has in use.
    pub configuration: Option<usize>,
}

/// The wavelength of f-numbers, fields and focus where nothing else is said, nm.
pub const REFERENCE_WAVELENGTH_NM: f64 = 550.0;
/// Wavelengths that are seen, nm.
const VISIBLE_NM: std::ops::RangeInclusive<f64> = 380.0..=780.0;

/// Returns that of these wavelengths which is nearest to 550 nm: the one that fields, f-numbers and focus are stated at.
pub fn nearest_to_reference_nm(wavelengths_nm: &[f64]) -> f64 {
    nearest_nm(wavelengths_nm, REFERENCE_WAVELENGTH_NM).unwrap_or(REFERENCE_WAVELENGTH_NM)
}

/// Returns that of these wavelengths which is nearest to another, nm.
pub(super) fn nearest_nm(wavelengths_nm: &[f64], to_nm: f64) -> Option<f64> {
    let off = |nm: &f64| (nm - to_nm).abs();
    wavelengths_nm.iter().copied().min_by(|a, b| off(a).total_cmp(&off(b)))
}

impl LensFile {
    /// The wavelength of its focus, f-number and first-order data, nm: the one that it states, or of a lens for other light than is seen
    /// the one of its wavelengths that is nearest to 550 nm; `None` of a lens without, which 550 nm stand for.
    pub fn main_wavelength_nm(&self) -> Option<f64> {
        let is_seen = self.wavelengths_nm.iter().any(|nm| VISIBLE_NM.contains(nm));
        let is_for_other_light = !is_seen && !self.wavelengths_nm.is_empty();
        self.reference_wavelength_nm.or(is_for_other_light.then(|| nearest_to_reference_nm(&self.wavelengths_nm)))
    }

    pub(super) fn of_lens(lens: Lens) -> Self {
        Self {
            lens,
            film_distance_mm: None,
            object_distance_mm: None,
            wavelengths_nm: Vec::new(),
            wavelength_weights: Vec::new(),
            reference_wavelength_nm: None,
            fields: Vec::new(),
            field_weights: Vec::new(),
            surface_comments: Vec::new(),
            comments: Vec::new(),
            microlens: None,
            configurations: Vec::new(),
            configuration: 1,
            notes: Vec::new(),
        }
    }
}

/// Returns weights, one each of `n` things, if they are not all alike; what is not stated counts as 1.
pub(super) fn weights_of(stated: &[f64], n: usize) -> Vec<f64> {
    let weights: Vec<f64> = (0..n).map(|i| stated.get(i).copied().unwrap_or(1.0)).collect();
    if weights.iter().all(|weight| *weight == weights[0]) { Vec::new() } else { weights }
}
