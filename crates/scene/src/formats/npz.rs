//! Archives of arrays of `NumPy` (`.npz`): a ZIP file with a `.npy` an array.

use std::{
    fs::File,
    io::{BufReader, Read, Write},
    path::Path,
};

use dioptric_files::Staged;
use zip::{CompressionMethod, ZipArchive, ZipWriter, result::ZipError, write::SimpleFileOptions};

use super::{
    axes,
    contents::Cube,
    depth_names::is_called,
    mat::{DEPTHS, Nearness, nearest_list, rank_of_waves},
    npy::{self, NpyArray, is_array_of, npy_bytes, parse, parse_complex},
    read_options::ReadOptions,
    stated::{Noted, name_of, note_of, short},
    unusable::{check_memory, fault, open_new, starts_with, unreadable, unwritable},
    wavelength_unit::{listed_nm, unit_in},
};
use crate::SceneError;

/// Bytes of an array in which its header ends.
const MOST_HEADER_BYTES: u64 = 1 << 16;

/// An archive whose arrays are read by name.
struct Archive<'a> {
    path: &'a Path,
    zip: ZipArchive<BufReader<File>>,
    length: u64,
    /// The names of its files.
    names: Vec<String>,
    /// What is to be said of what was read.
    notes: Vec<String>,
}

impl<'a> Archive<'a> {
    fn open(path: &'a Path) -> Result<Self, SceneError> {
        let wrong = |reason: String| unreadable(path, reason);
        let file = File::open(path).map_err(|error| unreadable(path, error))?;
        let length = file.metadata().map_err(|error| unreadable(path, error))?.len();
        if starts_with(path, npy::MAGIC)? {
            return Err(wrong("it is one array of NumPy, expected the ending .npy".to_owned()));
        }
        let zip = ZipArchive::new(BufReader::new(file)).map_err(|error| wrong(of_zip(&error)))?;
        let names = zip.file_names().map(|name| Ok(name?.into_owned())).collect::<Result<Vec<String>, ZipError>>();
        let names = names.map_err(|error| wrong(of_zip(&error)))?;
        Ok(Self { path, zip, length, names, notes: vec![] })
    }

    fn read(&mut self, name: &str) -> Result<NpyArray, SceneError> {
        self.read_any(name, |bytes| Ok((parse(bytes)?, false))).map(|(array, _)| array)
    }

    /// Reads an array, and whether its numbers are complex.
    fn read_any(
        &mut self,
        name: &str,
        parse: impl Fn(&[u8]) -> Result<(NpyArray, bool), String>,
    ) -> Result<(NpyArray, bool), SceneError> {
        let (path, length) = (self.path, self.length);
        let wrong = |reason: String| unreadable(path, format!("its '{}': {reason}", short(name)));
        let mut entry = self.zip.by_name(name).map_err(|error| wrong(fault("archive", error, None)))?;
        // The bytes of the array, the single floats that they become, and the planes that are made of these.
        check_memory(path, entry.size().saturating_mul(9), length)?;
        let mut bytes = vec![];
        let limit = entry.size();
        entry.by_ref().take(limit).read_to_end(&mut bytes).map_err(|error| wrong(fault("archive", error, None)))?;
        let (array, is_complex) = parse(&bytes).map_err(wrong)?;
        Ok((array.noted(Path::new(name)).told_in(&mut self.notes), is_complex))
    }

    /// Returns the file of the array of this name.
    fn named(&self, told: &str) -> Result<String, SceneError> {
        self.names.iter().find(|name| bare(name) == told).cloned().ok_or_else(|| {
            let reason = format!("it has no array '{told}', expected one of {}", shown(self.names.iter()));
            unreadable(self.path, reason)
        })
    }

    /// Returns the arrays of numbers whose sides are wanted; what else there is, as texts, is none.
    fn of_sides(&mut self, is_wanted: impl Fn(&[usize]) -> bool) -> Result<Vec<String>, SceneError> {
        let mut found = vec![];
        for name in self.names.clone() {
            let wrong = |error: String| unreadable(self.path, format!("its '{}': {error}", short(&name)));
            let entry = self.zip.by_name(&name).map_err(|error| wrong(fault("archive", error, None)))?;
            let mut start = vec![];
            entry
                .take(MOST_HEADER_BYTES)
                .read_to_end(&mut start)
                .map_err(|error| wrong(fault("archive", error, None)))?;
            if name.ends_with(".npy") && is_array_of(&start, &is_wanted) {
                found.push(name);
            }
        }
        Ok(found)
    }

    /// Returns those that are no lists of wavelengths.
    fn but_wavelengths(&mut self, is_wanted: impl Fn(&[usize]) -> bool) -> Result<Vec<String>, SceneError> {
        let lists = self.of_sides(|sides| sides.iter().filter(|side| **side != 1).count() < 2)?;
        let is_list = |name: &String| lists.contains(name) && rank_of_waves(bare(name)).is_some();
        Ok(self.of_sides(is_wanted)?.into_iter().filter(|name| !is_list(name)).collect())
    }
}

/// Returns what is wrong with an archive.
fn of_zip(error: &ZipError) -> String {
    let is_variant = matches!(error, ZipError::UnsupportedArchive(_) | ZipError::CompressionMethodNotSupported(_));
    fault("archive", error, is_variant.then_some("one of numpy.savez or savez_compressed"))
}

fn bare(name: &str) -> &str {
    name.trim_end_matches(".npy")
}

/// Reads the cube of an archive: the array that is told, or the only one of three axes, with the wavelengths of an array beside it.
///
/// # Errors
/// When it is no archive, an array cannot be read, or no array or several could be the cube.
pub(super) fn read_npz(path: &Path, options: &ReadOptions) -> Result<Cube, SceneError> {
    let wrong = |reason: String| unreadable(path, reason);
    let mut archive = Archive::open(path)?;
    let reading = &options.reading;
    let chosen = match &reading.variable {
        Some(told) => archive.named(told)?,
        None => match &archive.but_wavelengths(|sides| sides.len() == 3)?[..] {
            [one] => one.clone(),
            [] if archive.names.is_empty() => {
                return Err(wrong("it is empty, expected an array of three axes".to_owned()));
            }
            [] => {
                let reason =
                    format!("it has no array of three axes, but {}: expected a cube", shown(archive.names.iter()));
                return Err(wrong(reason));
            }
            cubes => return Err(wrong(format!("it has several cubes, {}: expected --variable", shown(cubes.iter())))),
        },
    };
    let array = archive.read(&chosen)?;
    let is_list = |name: &&String| **name != chosen && rank_of_waves(bare(name)).is_some();
    let mut lists: Vec<String> = archive.of_sides(|_| true)?.iter().filter(is_list).cloned().collect();
    let nearness = |name: &str| Nearness::of(bare(&chosen), bare(name));
    lists.sort_by_key(|name| (nearness(name), rank_of_waves(bare(name))));
    let mut found = vec![];
    for name in &lists {
        let list = archive.read(name)?;
        // Singles of decimals, as they were written.
        let numbers = list.values.iter().map(|v| v.to_string().parse().unwrap_or(f64::NAN)).collect::<Vec<f64>>();
        if lists.len() > 1 && !array.sides.contains(&numbers.len()) {
            continue;
        }
        match listed_nm(bare(name), unit_in(bare(name)), &numbers) {
            Ok(Some(nm)) => found.push((bare(name).to_owned(), nearness(name), nm)),
            Err(reason) if found.is_empty() && reading.wavelengths_nm.is_none() => return Err(wrong(reason)),
            Ok(None) | Err(_) => {}
        }
    }
    let nearest = match nearest_list(found) {
        Err(_) if reading.wavelengths_nm.is_some() => None,
        own => own.map_err(wrong)?,
    };
    let (named, own) = nearest.unzip();
    // A list that counts bands is none of wavelengths.
    let list = named.filter(|_| own.is_some());
    let told = reading.wavelengths_nm.as_ref().map(Vec::len);
    let n_bands = told
        .or_else(|| own.as_ref().map(Vec::len))
        .or_else(|| options.grid.as_ref().map(dioptric_spectrum::WavelengthGrid::len));
    let at = |index: usize| array.values[index];
    let planes = axes::planes(&array.sides, reading.axes.as_deref(), n_bands, true, at).map_err(wrong)?;
    let is_depth = |name: &str| reading.depth.is_none() && reading.depth_variable.as_deref() == Some(bare(name));
    let is_unused = |name: &&String| **name != chosen && Some(bare(name)) != list.as_deref() && !is_depth(name);
    let unused: Vec<String> = archive.names.iter().filter(is_unused).map(|name| bare(name).to_owned()).collect();
    let ambiguous = axes::note(&array.sides, reading.axes.as_deref(), n_bands, true);
    let ambiguous = ambiguous.map(|note| format!("{}: '{}': {note}", name_of(path), bare(&chosen)));
    let notes = archive.notes.into_iter().chain(note_of(path, "array", &unused)).chain(ambiguous).collect();
    Ok(Cube {
        planes,
        top: array.top,
        wavelengths_nm: own,
        quantity: None,
        unit: None,
        packed: None,
        called: Some(bare(&chosen).to_owned()),
        notes,
    })
}

/// Reads the depth of an archive: the array that is told, that which is called one, or the only one of two axes; with its name.
///
/// # Errors
/// When it is no archive, an array cannot be read, or no array or several could be the depth.
pub(super) fn read_npz_plane(path: &Path, told: Option<&str>) -> Result<Noted<(String, NpyArray)>, SceneError> {
    let mut archive = Archive::open(path)?;
    let chosen = match told {
        Some(told) => archive.named(told)?,
        None => {
            let planes = archive.but_wavelengths(|sides| sides.iter().filter(|side| **side != 1).count() == 2)?;
            // One of a single row or column, where there is no other.
            let planes = if planes.is_empty() { archive.but_wavelengths(|sides| sides.len() == 2)? } else { planes };
            let called = DEPTHS.iter().find_map(|own| planes.iter().find(|name| is_called(bare(name), own)));
            match (called, &planes[..]) {
                (Some(called), _) => called.clone(),
                (None, [one]) => one.clone(),
                (None, _) => {
                    let reason = format!(
                        "it has no array of rows and columns that is called depth, expected one of {} (--depth-variable)",
                        shown(archive.names.iter())
                    );
                    return Err(unreadable(path, reason));
                }
            }
        }
    };
    let array = archive.read(&chosen)?;
    let unused: Vec<String> =
        archive.names.iter().filter(|name| **name != chosen).map(|name| bare(name).to_owned()).collect();
    let notes = archive.notes.into_iter().chain(note_of(path, "array", &unused));
    Ok(Noted::new((bare(&chosen).to_owned(), array), notes))
}

/// An array of an archive.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedArray {
    /// Its name.
    pub name: String,
    /// The lengths of its axes, the slowest first; none of a single number. Of complex numbers the last axis has the real and the imaginary part.
    pub sides: Vec<usize>,
    /// Whether its numbers are complex.
    pub is_complex: bool,
    /// Its numbers in that order.
    pub values: Vec<f32>,
}

impl NamedArray {
    /// Returns its numbers as they were written in decimals, of which singles keep seven digits.
    pub fn decimals(&self) -> Vec<f64> {
        self.values.iter().map(|v| v.to_string().parse().unwrap_or(f64::NAN)).collect()
    }
}

/// Reads those arrays of an archive of `NumPy` (`.npz`) that have one of these names; what else it has is named in a note.
///
/// # Errors
/// When it is no archive, or one of these arrays cannot be read.
pub fn read_npz_arrays(path: &Path, wanted: &[&str]) -> Result<Noted<Vec<NamedArray>>, SceneError> {
    let mut archive = Archive::open(path)?;
    let (known, unused): (Vec<String>, Vec<String>) =
        archive.names.clone().into_iter().partition(|name| wanted.contains(&bare(name)));
    let mut arrays = vec![];
    for name in known {
        let (array, is_complex) = archive.read_any(&name, parse_complex)?;
        arrays.push(NamedArray { name: bare(&name).to_owned(), sides: array.sides, is_complex, values: array.values });
    }
    let unused: Vec<String> = unused.iter().map(|name| bare(name).to_owned()).collect();
    let notes = archive.notes.into_iter().chain(note_of(path, "array", &unused));
    Ok(Noted::new(arrays, notes))
}

/// Writes arrays of real numbers as single floats into an archive of `NumPy` (`.npz`), uncompressed as `numpy.savez` has them.
///
/// # Errors
/// When it cannot be written.
pub fn write_npz_arrays(path: &Path, arrays: &[(&str, &[usize], &[f32])]) -> Result<(), SceneError> {
    let cannot = |error: &dyn std::fmt::Display| unwritable(path, error);
    let staged = Staged::file(path)?;
    let mut zip = ZipWriter::new(open_new(&staged, path)?);
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored).large_file(true);
    for (name, sides, values) in arrays {
        zip.start_file(format!("{name}.npy"), options).map_err(|error| cannot(&error))?;
        zip.write_all(&npy_bytes(sides, values)).map_err(|error| cannot(&error))?;
    }
    zip.finish().map_err(|error| cannot(&error))?;
    Ok(staged.commit()?)
}

fn shown<'a>(names: impl Iterator<Item = &'a String>) -> String {
    names.map(|name| bare(name)).collect::<Vec<_>>().join(", ")
}
