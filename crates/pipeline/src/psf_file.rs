//! Files of point spread functions that take the place of those of a lens.

use std::{collections::BTreeMap, path::Path, sync::Arc};

use dioptric_psf::{ArrayFields, PsfArray, PsfArrayParts};
use dioptric_scene::{NamedArray, read_npz_arrays};
use ndarray::{Array5, Axis};

use crate::PipelineError;

/// The arrays that are known.
const NAMES: [&str; 7] = ["psf", "otf", "fields_deg", "distances_mm", "wavelengths_nm", "pitch_um", "otf_step_per_mm"];

/// Point spread functions of a file, and what is to be said of it.
#[derive(Clone, Debug)]
pub struct PsfFile {
    /// The functions.
    pub array: Arc<PsfArray>,
    /// What of the file is not used, and what is to be known of the functions, a sentence each.
    pub notes: Vec<String>,
}

/// An axis of the functions: where they are, in the order of the file.
struct Axes {
    fields_deg: Option<NamedArray>,
    distances_mm: Option<NamedArray>,
    wavelengths_nm: Option<NamedArray>,
}

impl PsfFile {
    /// Whether the name of a file is that of an archive of arrays.
    pub fn is_named(path: &Path) -> bool {
        path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("npz"))
    }

    /// Reads an archive of `NumPy` (`.npz`).
    ///
    /// Its array `psf` has the axes fields, distances, wavelengths, rows and columns, in the picture frame; or `otf` has in their place what
    /// `numpy.fft.fft2` makes of them. `fields_deg`, `distances_mm` and `wavelengths_nm` list where they are; an axis whose list is left out
    /// or is a single number is none of `psf`. `pitch_um` is the distance between samples, one or one a wavelength, `otf_step_per_mm` that between
    /// frequencies.
    ///
    /// # Errors
    /// Names the file, the array, and what was expected.
    pub fn read(path: &Path) -> Result<Self, PipelineError> {
        let wrong = |reason: String| PipelineError::Read { path: path.to_owned(), reason };
        if !Self::is_named(path) {
            return Err(wrong("expected an archive of NumPy (.npz) with the array psf or otf".to_owned()));
        }
        let mut notes = vec![];
        let mut arrays: BTreeMap<String, NamedArray> = read_npz_arrays(path, &NAMES)?
            .told_in(&mut notes)
            .into_iter()
            .map(|array| (array.name.clone(), array))
            .collect();
        let mut take = |name: &str| arrays.remove(name);
        let axes = Axes {
            fields_deg: take("fields_deg"),
            distances_mm: take("distances_mm"),
            wavelengths_nm: take("wavelengths_nm"),
        };
        let (samples, pitch_um) = match (take("psf"), take("otf"), take("pitch_um"), take("otf_step_per_mm")) {
            (Some(psf), None, Some(pitch), None) => {
                if psf.is_complex {
                    return Err(wrong("its psf is complex, expected real numbers".to_owned()));
                }
                (axes.cube(&psf, &psf.sides).map_err(wrong)?, pitch.decimals())
            }
            (None, Some(otf), None, Some(step)) => {
                let [step_per_mm] = step.decimals()[..] else {
                    return Err(wrong(format!("its otf_step_per_mm has {} numbers, expected 1", step.values.len())));
                };
                let (real, imaginary) = axes.transfer(&otf).map_err(wrong)?;
                let (samples, pitch_um) = PsfArray::samples_of_transfer(&real, imaginary.as_ref(), step_per_mm)
                    .map_err(|error| wrong(error.to_string()))?;
                (samples, vec![pitch_um])
            }
            (None, None, ..) => return Err(wrong("it has no array psf, expected it, or otf".to_owned())),
            (Some(_), Some(_), ..) => return Err(wrong("it has psf and otf, expected one of them".to_owned())),
            (Some(_), None, None, _) => {
                return Err(wrong("it has no pitch_um, expected the distance between samples, µm".to_owned()));
            }
            (None, Some(_), _, None) => {
                return Err(wrong(
                    "it has no otf_step_per_mm, expected the distance between frequencies, cycles/mm".to_owned(),
                ));
            }
            (Some(_), None, Some(_), Some(_)) => {
                return Err(wrong("it has otf_step_per_mm, which goes with otf, expected none beside psf".to_owned()));
            }
            (None, Some(_), Some(_), Some(_)) => {
                return Err(wrong("it has pitch_um, which otf_step_per_mm tells, expected none beside otf".to_owned()));
            }
        };
        let parts = axes.ordered(samples, pitch_um).map_err(wrong)?;
        let array = PsfArray::new(parts).map_err(|error| wrong(error.to_string()))?;
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        notes.extend(array.notes().into_iter().map(|note| format!("{name}: {note}")));
        Ok(Self { array: Arc::new(array), notes })
    }

    /// Says that points of these fields, to the right and upwards, degrees, and distances before the first vertex, mm, lie beyond those of the
    /// functions, where any does.
    pub fn note_on_ends(&self, fields_deg: &[[f64; 2]], distances_mm: &[f64]) -> Option<String> {
        let parts = self.array.parts();
        // Angles that come from tangents have rounding.
        let is_beyond = |value: f64, list: &[f64]| match (list.first(), list.last()) {
            (Some(first), Some(last)) => value < first - 1e-6 || value > last + 1e-6,
            _ => false,
        };
        let from_axis_deg = |x: f64, y: f64| x.to_radians().tan().hypot(y.to_radians().tan()).atan().to_degrees();
        let is_wide = fields_deg.iter().any(|&[x, y]| match &parts.fields {
            ArrayFields::Everywhere => false,
            ArrayFields::Heights(heights) => is_beyond(from_axis_deg(x, y), heights),
            ArrayFields::Grid { x_deg, y_deg } => is_beyond(x, x_deg) || is_beyond(y, y_deg),
        });
        let is_far = distances_mm.iter().any(|mm| is_beyond(*mm, &parts.distances_mm));
        let what = match (is_wide, is_far) {
            (true, true) => "fields and distances",
            (true, false) => "fields",
            (false, true) => "distances",
            (false, false) => return None,
        };
        Some(format!("psfs: {what} beyond those of the file have the functions of its ends"))
    }
}

impl Axes {
    /// The lists that are axes of the samples, in their order; a single number is none.
    fn lists(&self) -> [Option<&NamedArray>; 3] {
        [&self.fields_deg, &self.distances_mm, &self.wavelengths_nm]
            .map(|list| list.as_ref().filter(|list| !list.sides.is_empty()))
    }

    /// Returns samples of these sides with all five axes.
    fn cube(&self, array: &NamedArray, sides: &[usize]) -> Result<Array5<f32>, String> {
        let lists = self.lists();
        let wanted = || lists.into_iter().flatten();
        let lengths: Vec<usize> = wanted().map(|list| list.sides[0]).collect();
        if sides.len() != lengths.len() + 2 || sides[..lengths.len()] != lengths[..] {
            let axes: String = wanted().map(|list| format!("{} {}, ", list.sides[0], list.name)).collect();
            return Err(format!("its {} has the shape {sides:?}, expected [{axes}rows, columns]", array.name));
        }
        let [fields, distances, colors] = lists.map(|list| list.map_or(1, |list| list.sides[0]));
        let [rows, columns] = [sides[sides.len() - 2], sides[sides.len() - 1]];
        let values = array.values.clone();
        Array5::from_shape_vec((fields, distances, colors, rows, columns), values).map_err(|error| error.to_string())
    }

    /// Returns the real and, where there is one, the imaginary part of transforms.
    fn transfer(&self, otf: &NamedArray) -> Result<(Array5<f32>, Option<Array5<f32>>), String> {
        if !otf.is_complex {
            return Ok((self.cube(otf, &otf.sides)?, None));
        }
        let sides = &otf.sides[..otf.sides.len() - 1];
        let part = |part: usize| {
            let values = otf.values.iter().skip(part).step_by(2).copied().collect();
            self.cube(&NamedArray { values, ..otf.clone() }, sides)
        };
        Ok((part(0)?, Some(part(1)?)))
    }

    /// Returns the functions in ascending order of their axes.
    fn ordered(&self, samples: Array5<f32>, mut pitch_um: Vec<f64>) -> Result<PsfArrayParts, String> {
        let list = |list: &Option<NamedArray>| -> Result<Vec<f64>, String> {
            match list {
                Some(list) if list.sides.len() > 1 || list.is_complex => {
                    Err(format!("its {} has the shape {:?}, expected a list of real numbers", list.name, list.sides))
                }
                list => Ok(list.as_ref().map_or_else(Vec::new, NamedArray::decimals)),
            }
        };
        let (fields, field_order) = self.fields()?;
        let (distances_mm, distance_order) = ascending(list(&self.distances_mm)?);
        let (wavelengths_nm, color_order) = ascending(list(&self.wavelengths_nm)?);
        if pitch_um.len() == color_order.len() && pitch_um.len() > 1 {
            pitch_um = color_order.iter().map(|i| pitch_um[*i]).collect();
        }
        let samples =
            [field_order, distance_order, color_order].iter().enumerate().fold(samples, |samples, (axis, order)| {
                let is_as_it_is = order.iter().enumerate().all(|(i, from)| i == *from);
                if is_as_it_is { samples } else { samples.select(Axis(axis), order) }
            });
        Ok(PsfArrayParts { fields, distances_mm, wavelengths_nm, pitch_um, samples })
    }

    /// Returns the fields, and in which order the file has them.
    fn fields(&self) -> Result<(ArrayFields, Vec<usize>), String> {
        let Some(list) = &self.fields_deg else { return Ok((ArrayFields::Everywhere, vec![])) };
        let numbers = list.decimals();
        match list.sides[..] {
            [] | [_] if !list.is_complex => {
                let (heights, order) = ascending(numbers);
                Ok((ArrayFields::Heights(heights), order))
            }
            [n, 2] if !list.is_complex => {
                let axis = |i: usize| {
                    let mut axis: Vec<f64> = numbers.iter().skip(i).step_by(2).copied().collect();
                    axis.sort_by(f64::total_cmp);
                    axis.dedup();
                    axis
                };
                let (x_deg, y_deg) = (axis(0), axis(1));
                let place = |x: f64, y: f64| numbers.chunks_exact(2).position(|pair| pair == [x, y]);
                let order: Option<Vec<usize>> =
                    x_deg.iter().flat_map(|x| y_deg.iter().map(|y| place(*x, *y))).collect();
                match order.filter(|order| order.len() == n) {
                    Some(order) => Ok((ArrayFields::Grid { x_deg, y_deg }, order)),
                    None => Err(format!(
                        "its fields_deg are {n} pairs, expected each of {} angles to the right with each of {} upwards, once",
                        x_deg.len(),
                        y_deg.len()
                    )),
                }
            }
            _ => Err(format!(
                "its fields_deg has the shape {:?}, expected a list of angles, or of pairs of them, to the right and upwards",
                list.sides
            )),
        }
    }
}

/// Returns a list in ascending order, and where its entries were.
fn ascending(list: Vec<f64>) -> (Vec<f64>, Vec<usize>) {
    let mut order: Vec<usize> = (0..list.len()).collect();
    order.sort_by(|a, b| list[*a].total_cmp(&list[*b]));
    (order.iter().map(|i| list[*i]).collect(), order)
}

#[cfg(test)]
mod tests {
    use dioptric_scene::write_npz_arrays;

    use super::*;

    /// Writes an archive and reads it.
    fn read(arrays: &[(&str, &[usize], &[f32])]) -> Result<PsfFile, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("psfs.npz");
        write_npz_arrays(&path, arrays).unwrap();
        PsfFile::read(&path).map_err(|error| error.to_string())
    }

    /// Functions of 3 × 3 samples with all their light at the sample of their number.
    fn dots(n: usize) -> Vec<f32> {
        (0..n).flat_map(|i| (0..9).map(move |at| f32::from(u8::from(at == i)))).collect()
    }

    #[test]
    fn functions_come_in_ascending_order_of_their_axes() {
        let file = read(&[
            ("psf", &[2, 3, 3, 3], &dots(6)),
            ("distances_mm", &[2], &[f32::INFINITY, 500.0]),
            ("wavelengths_nm", &[3], &[650.0, 450.0, 550.0]),
            ("fields_deg", &[], &[0.0]),
            ("pitch_um", &[3], &[3.0, 1.0, 2.0]),
        ]);
        let array = file.unwrap().array;
        let parts = array.parts();
        assert_eq!(parts.fields, ArrayFields::Heights(vec![0.0]));
        assert_eq!(
            (&parts.distances_mm[..], &parts.wavelengths_nm[..]),
            (&[500.0, f64::INFINITY][..], &[450.0, 550.0, 650.0][..])
        );
        assert_eq!(parts.pitch_um, [1.0, 2.0, 3.0]);
        // The nearer distance is the second of the file, its functions the last three: 450 nm the second of them.
        let place = |i: usize| array.function(i).iter().position(|v| *v == 1.0);
        assert_eq!((0..6).map(place).collect::<Vec<_>>(), [4, 5, 3, 1, 2, 0].map(Some));
    }

    #[test]
    fn points_beyond_the_ends_are_told() {
        let file = read(&[
            ("psf", &[2, 1, 3, 3], &dots(2)),
            ("fields_deg", &[2], &[0.0, 10.0]),
            ("distances_mm", &[1], &[1000.0]),
            ("pitch_um", &[], &[1.0]),
        ])
        .unwrap();
        assert_eq!(file.note_on_ends(&[[0.0, 10.0], [-6.0, 3.0]], &[1000.0]), None);
        let note = |field: [f64; 2], mm: f64| file.note_on_ends(&[field], &[mm]).unwrap();
        assert!(note([8.0, 8.0], 1000.0).contains("fields beyond"));
        assert!(note([0.0, 11.0], f64::INFINITY).contains("fields and distances"));
    }

    #[test]
    fn pairs_of_fields_are_a_grid() {
        let pairs = [0.0, 5.0, 0.0, -5.0, 10.0, 5.0, 10.0, -5.0];
        let file = read(&[("psf", &[4, 3, 3], &dots(4)), ("fields_deg", &[4, 2], &pairs), ("pitch_um", &[], &[1.0])]);
        let array = file.unwrap().array;
        let grid = ArrayFields::Grid { x_deg: vec![0.0, 10.0], y_deg: vec![-5.0, 5.0] };
        assert_eq!(array.parts().fields, grid);
        assert_eq!(array.function(0)[(0, 1)], 1.0);
        let twice = [0.0, 5.0, 0.0, 5.0, 10.0, 5.0, 10.0, -5.0];
        let message =
            read(&[("psf", &[4, 3, 3], &dots(4)), ("fields_deg", &[4, 2], &twice), ("pitch_um", &[], &[1.0])])
                .unwrap_err();
        assert!(message.contains("4 pairs"), "{message}");
    }

    #[test]
    fn transforms_are_functions_too() {
        let file = read(&[("otf", &[4, 4], &[1.0; 16]), ("otf_step_per_mm", &[], &[50.0])]).unwrap();
        assert_eq!(file.array.pitch_um(0), 5.0);
        assert!(file.array.function(0)[(2, 2)] > 0.999_99);
    }

    #[test]
    fn files_that_are_none_are_refused() {
        let psf = ("psf", &[3_usize, 3][..], &dots(1)[..9]);
        let pitch = ("pitch_um", &[][..], &[1.0_f32][..]);
        type Array<'a> = (&'a str, &'a [usize], &'a [f32]);
        let cases: [(&[Array<'_>], &str); 7] = [
            (&[pitch], "no array psf"),
            (&[psf], "no pitch_um"),
            (&[psf, pitch, ("otf_step_per_mm", &[], &[1.0])], "otf_step_per_mm"),
            (&[("otf", &[3, 3], &[1.0; 9])], "no otf_step_per_mm"),
            (&[psf, pitch, ("wavelengths_nm", &[2], &[450.0, 550.0])], "[2 wavelengths_nm, rows, columns]"),
            (&[psf, pitch, ("wavelengths_nm", &[1, 1], &[450.0])], "shape"),
            (&[psf, pitch, ("fields_deg", &[1, 3], &[1.0; 3])], "shape"),
        ];
        for (arrays, word) in cases {
            let message = read(arrays).unwrap_err();
            assert!(message.contains(word) && message.contains("psfs.npz"), "{message}");
        }
        let message = PsfFile::read(Path::new("psfs.txt")).unwrap_err().to_string();
        assert!(message.contains(".npz"), "{message}");
        let noted = read(&[psf, pitch, ("comment", &[1], &[1.0])]).unwrap();
        assert!(noted.notes.iter().any(|note| note.contains("'comment'")), "{:?}", noted.notes);
    }
}
