//! Archives of arrays of `NumPy` (`.npz`): a ZIP file with a `.npy` an array.

use std::{
    fs::File,
    io::{BufReader, Read},
    path::Path,
};

use zip::{ZipArchive, result::ZipError};

use super::{
    axes,
    contents::Cube,
    mat::WAVES,
    npy::{NpyArray, parse},
    read_options::ReadOptions,
    stated::{name_of, note_of, short},
    unusable::{check_memory, unreadable},
};
use crate::SceneError;

/// Reads the cube of an archive: the array that is told, or the only one of three axes, with the wavelengths of an array beside it.
///
/// # Errors
/// When it is no archive, an array cannot be read, or no array or several could be the cube.
pub(super) fn read_npz(path: &Path, options: &ReadOptions) -> Result<Cube, SceneError> {
    let wrong = |reason: String| unreadable(path, reason);
    let file = File::open(path).map_err(|error| unreadable(path, error))?;
    let length = file.metadata().map_err(|error| unreadable(path, error))?.len();
    let mut archive =
        ZipArchive::new(BufReader::new(file)).map_err(|error| wrong(format!("it is no archive: {error}")))?;
    let names = archive.file_names().map(|name| Ok(name?.into_owned())).collect::<Result<Vec<String>, ZipError>>();
    let names = names.map_err(|error| wrong(format!("it is no archive: {error}")))?;
    let mut read = |name: &str| -> Result<NpyArray, SceneError> {
        let mut entry = archive.by_name(name).map_err(|error| wrong(format!("its '{}': {error}", short(name))))?;
        // The bytes of the array, the single floats that they become, and the planes that are made of these.
        check_memory(path, entry.size().saturating_mul(9), length)?;
        let mut bytes = vec![];
        let limit = entry.size();
        entry
            .by_ref()
            .take(limit)
            .read_to_end(&mut bytes)
            .map_err(|error| wrong(format!("its '{}': {error}", short(name))))?;
        parse(&bytes).map_err(|reason| wrong(format!("its '{}': {reason}", short(name))))
    };
    let bare = |name: &str| name.trim_end_matches(".npy").to_owned();
    let reading = &options.reading;
    let is_list = |name: &str| WAVES.contains(&bare(name).as_str());
    let chosen = match &reading.variable {
        Some(told) => names.iter().find(|name| bare(name) == *told).cloned().ok_or_else(|| {
            wrong(format!("it has no array '{told}', expected one of {}", shown(names.iter().map(|name| bare(name)))))
        })?,
        None => {
            let mut cubes = vec![];
            for name in names.iter().filter(|name| name.ends_with(".npy") && !is_list(name)) {
                if read(name)?.sides.len() == 3 {
                    cubes.push(name.clone());
                }
            }
            match &cubes[..] {
                [one] => one.clone(),
                [] => return Err(wrong("it has no array of three axes: expected --variable".to_owned())),
                _ => {
                    let cubes = shown(cubes.iter().map(|name| bare(name)));
                    return Err(wrong(format!("it has several cubes, {cubes}: expected --variable")));
                }
            }
        }
    };
    let array = read(&chosen)?;
    let list = names.iter().find(|name| is_list(name) && **name != chosen).cloned();
    let own: Option<Vec<f64>> = match &list {
        Some(name) => Some(read(name)?.values.into_iter().map(f64::from).collect()),
        None => None,
    };
    let told = reading.wavelengths_nm.as_ref().map(Vec::len);
    let n_bands = told
        .or_else(|| own.as_ref().map(Vec::len))
        .or_else(|| options.grid.as_ref().map(dioptric_spectrum::WavelengthGrid::len));
    let at = |index: usize| array.values[index];
    let planes = axes::planes(&array.sides, reading.axes.as_deref(), n_bands, true, at).map_err(wrong)?;
    let unused: Vec<String> =
        names.iter().filter(|name| **name != chosen && Some(*name) != list.as_ref()).map(|name| bare(name)).collect();
    let ambiguous = axes::note(&array.sides, reading.axes.as_deref(), n_bands);
    let ambiguous = ambiguous.map(|note| format!("{}: '{}': {note}", name_of(path), bare(&chosen)));
    let notes = note_of(path, "array", &unused).into_iter().chain(ambiguous).collect();
    Ok(Cube { planes, top: array.top, wavelengths_nm: own, quantity: None, notes })
}

fn shown(names: impl Iterator<Item = String>) -> String {
    names.collect::<Vec<_>>().join(", ")
}
