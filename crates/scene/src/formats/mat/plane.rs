//! An array of two axes of a MATLAB or HDF5 file: a depth.

use std::path::Path;

use ndarray::Array2;

use super::{
    super::{
        axes,
        depth_names::{SaidOfDepth, is_called},
        length_unit::length_m,
        stated::{Noted, note_of},
        unusable::unreadable,
    },
    container::{MatFile, WHOLE},
    elements::Listed,
    hdf5::NAMING,
    packing::Packing,
};
use crate::SceneError;

/// Names of arrays of depth, those of distances from the camera first.
pub(in super::super) const DEPTHS: [&str; 9] =
    ["distance", "depth", "depths", "depthmap", "depth_map", "z", "dataset", "rawdepths", "disparity"];

/// A plane of numbers.
pub(in super::super) struct Plane {
    /// The name of the array.
    pub(in super::super) name: String,
    pub(in super::super) values: Array2<f32>,
    /// The largest number that its whole numbers have.
    pub(in super::super) top: Option<f64>,
    /// The length of 1, m, where the file states it.
    pub(in super::super) unit_m: Option<f64>,
    /// What the file calls it in words.
    pub(in super::super) words: String,
}

/// Whether a MATLAB or HDF5 file has a variable of this name, of whatever kind; not where it cannot be read.
pub(in super::super) fn has_variable(path: &Path, name: &str) -> bool {
    MatFile::read(path, &|_| false).is_ok_and(|file| file.listed.iter().any(|own| own.name == name))
}

/// Returns the real matrices of these names that a MATLAB or HDF5 file has, with their names.
///
/// # Errors
/// When the file cannot be read, or one of them has more than two axes.
pub fn read_mat_matrices(path: &Path, wanted: &[&str]) -> Result<Vec<(String, Array2<f64>)>, SceneError> {
    let is_wanted = |own: &Listed| own.is_numeric && wanted.contains(&own.name.as_str());
    let file = MatFile::read(path, &is_wanted)?;
    let wrong = |reason: String| unreadable(path, reason);
    let matrix = |own: &Listed| {
        let array =
            file.array(&own.name).map_err(wrong)?.ok_or_else(|| wrong(format!("its '{}' is not there", own.name)))?;
        let numbers =
            array.numbers().map_err(|what| wrong(format!("its '{}' is {what}, expected numbers", own.name)))?;
        let (rows, columns) = match own.sides[..] {
            [] => (1, 1),
            [n] => (n, 1),
            [rows, columns] => (rows, columns),
            _ => return Err(wrong(format!("its '{}' has {} axes, expected a matrix", own.name, own.sides.len()))),
        };
        let at =
            |(row, column)| numbers.at(if file.is_row_major { column + columns * row } else { row + rows * column });
        Ok((own.name.clone(), Array2::from_shape_fn((rows, columns), at)))
    };
    file.listed.iter().filter(|own| is_wanted(own)).map(matrix).collect()
}

/// Reads the one plane of a file, that whose name says that it is a depth, or that of the name told.
///
/// # Errors
/// When it has none, or several of other names.
pub(in super::super) fn read_plane(path: &Path, told: Option<&str>) -> Result<Noted<Plane>, SceneError> {
    let are_plane = |sides: &[usize]| sides.iter().filter(|side| **side != 1).count() == 2;
    let file = MatFile::read(path, &|own| !own.is_numeric || are_plane(&own.sides))?;
    let wrong = |reason: String| unreadable(path, reason);
    // Those of the file, and those in its structures as `s.depth`.
    let mut arrays: Vec<(String, Vec<usize>)> = vec![];
    for own in &file.listed {
        match own.is_numeric {
            true => arrays.push((own.name.clone(), own.sides.clone())),
            false => {
                let array = file.array(&own.name).ok().flatten();
                arrays.extend(array.map(|array| array.numeric_fields(&own.name)).unwrap_or_default());
            }
        }
    }
    let planes: Vec<&(String, Vec<usize>)> = arrays.iter().filter(|(_, sides)| are_plane(sides)).collect();
    let last = |name: &str| name.rsplit(['/', '.']).next().unwrap_or_default().to_lowercase();
    let named = match told {
        Some(told) => planes.iter().find(|(name, _)| name == told),
        // Depths before disparities, and those of the file itself before those in its structures.
        None => [false, true].into_iter().find_map(|is_disparity| {
            let names = DEPTHS.iter().filter(|name| (**name == "disparity") == is_disparity);
            [false, true].into_iter().find_map(|is_inner| {
                let is_own =
                    |name: &str, wanted: &str| name.contains('.') == is_inner && is_called(&last(name), wanted);
                names.clone().find_map(|wanted| planes.iter().find(|(name, _)| is_own(name, wanted)))
            })
        }),
    };
    let (chosen, sides) = match (named, &planes[..]) {
        (Some(named), _) => named,
        (None, _) if told.is_some() => {
            let told = told.unwrap_or_default();
            if let Some((_, own)) = arrays.iter().find(|(name, _)| name == told) {
                let sides = own.iter().map(usize::to_string).collect::<Vec<_>>().join(" × ");
                return Err(wrong(format!(
                    "its '{told}' has {} axes ({sides}), expected rows and columns: save one picture's of them alone",
                    own.len()
                )));
            }
            let names = arrays.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ");
            return Err(wrong(format!("it has no array '{told}' of rows and columns, expected one of {names}")));
        }
        (None, [only]) => only,
        (None, []) if file.listed.iter().any(|own| own.is_complex) => {
            return Err(wrong("its arrays have complex numbers, expected real ones of depth".to_owned()));
        }
        (None, []) => return Err(wrong("it has no array of rows and columns, expected one of depth".to_owned())),
        (None, _) => {
            let names = planes.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ");
            return Err(wrong(format!("it has several arrays, {names}: expected one, or its name (--depth-variable)")));
        }
    };
    let all_sides = sides;
    let sides: Vec<usize> = all_sides.iter().copied().filter(|side| *side != 1).collect();
    let array = file.array(chosen).map_err(wrong)?.ok_or_else(|| wrong("its depth is not there".to_owned()))?;
    let numbers = array.numbers().map_err(|what| wrong(format!("its '{chosen}' is {what}, expected numbers")))?;
    let (words, axes) = file.words_of(chosen);
    let axes: Vec<String> =
        axes.iter().zip(all_sides).filter(|(_, side)| **side != 1).map(|(axis, _)| axis.clone()).collect();
    let is_turned = axes::are_turned(&axes);
    let [rows, columns] = if is_turned { [sides[1], sides[0]] } else { [sides[0], sides[1]] };
    let at = |(row, column): (usize, usize)| {
        // Where the first axis is that of the columns its neighbors are those of a row.
        if file.is_row_major != is_turned { column + columns * row } else { row + rows * column }
    };
    let mut others: Vec<String> = vec![];
    for own in &file.listed {
        let array = file.array(&own.name).ok().flatten().filter(|_| !own.is_numeric);
        others.extend(array.map_or_else(|| vec![own.name.clone()], |array| array.leaves(&own.name)));
    }
    others.retain(|own| own != chosen);
    let packing = Packing::of(file.attributes_of(chosen));
    // What it is called may have its unit.
    let called_m = SaidOfDepth::of(words).unit_m;
    let unit_m = packing.unit.as_deref().and_then(length_m).or(called_m);
    let mut notes: Vec<String> = note_of(path, "array", &others).into_iter().collect();
    let of_file = file.attributes_of(WHOLE).iter().map(|own| own.name.clone());
    let mut left = packing.left(unit_m.is_some(), false);
    left.retain(|name| called_m.is_none() || called_m != unit_m || !NAMING.contains(&name.as_str()));
    notes.extend(note_of(path, "attribute", &of_file.chain(left).collect::<Vec<_>>()));
    let plane = Plane {
        name: chosen.clone(),
        values: Array2::from_shape_fn((rows, columns), |place| packing.unpacked(numbers.at(at(place))) as f32),
        top: (numbers.is_integer && !packing.is_packed()).then(|| numbers.top()),
        unit_m,
        words: words.to_owned(),
    };
    Ok(Noted::new(plane, notes))
}
