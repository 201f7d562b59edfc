//! The numbers of files of depth, whatever they count.

use std::path::{Path, PathBuf};

use ndarray::Array2;

use super::{
    contents::{MATLAB_OR_HDF5, is_of},
    depth_names::SaidOfDepth,
    exr_depth_file::{DepthChannel, read_depth_exr},
    gray_picture::{GrayPicture, read_gray},
    length_unit::length_m,
    mat::{Plane, read_plane},
    npy::{NpyArray, read_npy},
    npz::read_npz_plane,
    pfm::read_pfm,
    reading::{DepthKind, Frame},
    stated::{Noted, name_of},
    text_depth::read_text_depth,
    tiff_depth_map::MappedDepths,
    tiff_file::TiffAs,
    unusable::{starts_with, unreadable},
};
use crate::SceneError;

/// Numbers of a file of depth as they stand there.
pub(super) struct DepthNumbers {
    pub(super) values: Array2<f32>,
    /// The largest number that whole numbers can be; none of floats.
    pub(super) top: Option<f64>,
    /// What the names in the file say that they count.
    pub(super) kind: DepthKind,
    /// What is asked for where the file says that they are no lengths of a known unit.
    pub(super) lacks: Option<&'static str>,
    /// The length of 1, m, where the file states it.
    pub(super) unit_m: Option<f64>,
    /// The picture of which they are a part, where the file tells.
    pub(super) frame: Option<Frame>,
    /// Where they are.
    pub(super) from: String,
    /// A name of theirs that has a number with a unit of length.
    pub(super) length_in: Option<String>,
}

/// Reads the numbers of a file of depth; of several arrays, channels or planes that of the name or number told.
pub(super) fn depth_numbers(path: &Path, told: Option<&str>) -> Result<Noted<DepthNumbers>, SceneError> {
    let of = |values: Array2<f32>, top: Option<f64>| DepthNumbers {
        values,
        top,
        kind: DepthKind::Axial,
        lacks: None,
        unit_m: None,
        frame: None,
        from: name_of(path),
        length_in: None,
    };
    let mut notes = vec![];
    let named = |name: &str| format!("'{name}' of {}", name_of(path));
    let ending = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    if told.is_some() && ["pfm", "npy", "txt", "csv", "asc"].contains(&ending.as_str()) {
        return Err(unreadable(path, "it has one depth without a name, expected it without --depth-variable"));
    }
    // What the file calls its array, in a name and in words.
    let (mut names, mut called) = (String::new(), String::new());
    let mut numbers = match ending.as_str() {
        "pfm" => {
            let mut planes = read_pfm(path)?.told_in(&mut notes);
            if planes[1..].iter().any(|plane| *plane != planes[0]) {
                return Err(unreadable(path, "it has colors, expected one plane of depth"));
            }
            of(planes.swap_remove(0), None)
        }
        "npy" => {
            let (values, top) = plane_of(path, read_npy(path)?.told_in(&mut notes))?;
            of(values, top)
        }
        "npz" => {
            let (name, array) = read_npz_plane(path, told)?.told_in(&mut notes);
            let (values, top) = plane_of(path, array)?;
            names = name.clone();
            DepthNumbers { from: named(&name), unit_m: SaidOfDepth::of_name(&name).unit_m, ..of(values, top) }
        }
        _ if is_of(path, MATLAB_OR_HDF5) => {
            let Plane { name, values, top, unit_m, words } = read_plane(path, told)?.told_in(&mut notes);
            let named_m = SaidOfDepth::of_name(&name).unit_m;
            if let (Some(unit_m), Some(named_m)) = (unit_m, named_m)
                && unit_m != named_m
            {
                let reason = format!("its {} states another unit than its name: expected one of them", named(&name));
                return Err(unreadable(path, reason));
            }
            let from = named(&name);
            (names, called) = (name, words);
            DepthNumbers { from, unit_m: unit_m.or(named_m), ..of(values, top) }
        }
        "exr" => {
            let DepthChannel { name, plane, kind, frame } = read_depth_exr(path, told)?.told_in(&mut notes);
            let (from, unit_m) = (format!("channel {}", named(&name)), SaidOfDepth::of_name(&name).unit_m);
            names = name;
            DepthNumbers { from, kind, unit_m, frame: Some(frame), ..of(plane, None) }
        }
        "txt" | "csv" | "asc" => of(read_text_depth(path)?.told_in(&mut notes), None),
        _ if is_envi(path, &ending) => {
            let reason = "it is an ENVI cube, of which no band is taken for a depth: expected the band as a TIFF of floats, .npy, .pfm or .exr";
            return Err(unreadable(path, reason));
        }
        _ => {
            let GrayPicture { values, top, page, .. } = read_gray(path, TiffAs::Depths, told)?.told_in(&mut notes);
            if page.is_white_zero {
                notes.push(format!(
                    "{}: its mark that 0 is white (tag 262) says how it is shown: its numbers are taken as they stand",
                    name_of(path)
                ));
            }
            let unit_m = page.unit.as_deref().map(str::trim).and_then(length_m);
            notes.extend(page.note_of_unit(path).filter(|_| unit_m.is_none()));
            called = page.called.clone();
            match page.depth_map.map(|tags| tags.depths(values.clone(), top)) {
                Some(MappedDepths { values, kind, top, unit_m, lacks }) => {
                    DepthNumbers { kind, unit_m, lacks, ..of(values, top) }
                }
                None => DepthNumbers { unit_m, ..of(values, top) },
            }
        }
    };
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    // What stands nearest to the numbers counts first.
    let said = [SaidOfDepth::of(&called), SaidOfDepth::of_name(&names), SaidOfDepth::of_file(&stem)];
    if numbers.kind == DepthKind::Axial && said.iter().find_map(|own| own.is_radial) == Some(true) {
        numbers.kind = DepthKind::Radial;
    }
    numbers.lacks = numbers.lacks.or_else(|| said.iter().find_map(|own| own.lacks));
    let own = [names.as_str(), &stem].into_iter().zip(&said[1..]).find(|(_, said)| said.has_length);
    numbers.length_in = own.map(|(name, _)| name.to_owned());
    Ok(Noted::new(numbers, notes))
}

/// Whether a file is the header of an ENVI cube, or has one.
fn is_envi(path: &Path, ending: &str) -> bool {
    let is_picture = ["png", "jpg", "jpeg", "tif", "tiff", "webp", "bmp", "ppm", "pgm", "pnm"].contains(&ending);
    let is_header = |header: &Path| starts_with(header, b"ENVI").unwrap_or(false);
    let appended = || {
        let mut name = path.as_os_str().to_owned();
        name.push(".hdr");
        PathBuf::from(name)
    };
    match ending {
        "hdr" => is_header(path),
        _ => !is_picture && (is_header(&path.with_extension("hdr")) || is_header(&appended())),
    }
}

/// Returns an array of rows and columns, whatever its further sides of 1.
fn plane_of(path: &Path, array: NpyArray) -> Result<(Array2<f32>, Option<f64>), SceneError> {
    let is_plane = array.sides.len() == 2;
    let sides: Vec<usize> = array.sides.iter().copied().filter(|side| is_plane || *side != 1).collect();
    let &[rows, columns] = &sides[..] else {
        return Err(unreadable(path, format!("its sides are {:?}, expected rows and columns", array.sides)));
    };
    let values = Array2::from_shape_vec((rows, columns), array.values).map_err(|error| unreadable(path, error))?;
    Ok((values, array.top))
}
