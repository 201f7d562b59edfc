//! The numbers of files of depth, whatever they count.

use std::path::{Path, PathBuf};

use ndarray::Array2;

use super::{
    contents::{MATLAB_OR_HDF5, is_of},
    exr_depth_file::{DepthChannel, read_depth_exr},
    gray_picture::{GrayPicture, read_gray},
    length_unit::{length_in_name, length_m, words_of_name},
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
            DepthNumbers { from: named(&name), unit_m: length_in_name(&name), ..of(values, top) }
        }
        _ if is_of(path, MATLAB_OR_HDF5) => {
            let Plane { name, values, top, unit_m, words } = read_plane(path, told)?.told_in(&mut notes);
            let named_m = length_in_name(&name);
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
            let (from, unit_m) = (format!("channel {}", named(&name)), length_in_name(&name));
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
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    if numbers.kind == DepthKind::Axial && is_radial(&stem, &names, &called) {
        numbers.kind = DepthKind::Radial;
    }
    numbers.lacks = numbers.lacks.or_else(|| [&stem, &names, &called].into_iter().find_map(|own| lacks_length(own)));
    Ok(Noted::new(numbers, notes))
}

/// Whether distances are counted from the camera by the name of their file, their array or channel, or the words that the file has for it.
fn is_radial(stem: &str, name: &str, called: &str) -> bool {
    const RAYS: [&str; 7] = ["ray", "rays", "radial", "euclidean", "slant", "sight", "range"];
    const DISTANCES: [&str; 3] = ["distance", "distances", "dist"];
    let last = name.rsplit('/').next().unwrap_or(name);
    let ([stem, name], lower) = ([stem, last].map(words_of_name), called.to_lowercase());
    let called = words_of_name(called);
    let is_in = |words: &[String], known: &[&str]| words.iter().any(|own| known.contains(&own.as_str()));
    let is_last = |words: &[String], known: &[&str]| words.last().is_some_and(|own| known.contains(&own.as_str()));
    let says = |words: &[String], known: &[&str]| words.windows(known.len()).any(|own| own == known);
    let is_axial = |words: &[String]| is_in(words, &["axial", "planar"]) || says(words, &["image", "plane"]);
    if is_in(&called, &["axis", "perpendicular"]) || [&stem, &name, &called].into_iter().any(|own| is_axial(own)) {
        return false;
    }
    is_in(&name, &RAYS)
        || is_in(&name, &DISTANCES)
        || is_in(&called, &RAYS)
        || ["distance from ", "distance to "].iter().any(|start| lower.contains(start))
        // AirSim's.
        || [&stem, &name].into_iter().any(|own| says(own, &["depth", "perspective"]))
        // Files may be called after what they show.
        || is_in(&stem, &["radial", "euclidean"])
        || [["to", "camera"], ["from", "camera"], ["ray", "length"], ["ray", "depth"], ["depth", "ray"]]
            .iter()
            .any(|own| says(&stem, own))
        || is_last(&stem, &DISTANCES)
        || is_last(&stem, &["range"])
}

/// Returns what is asked for where words speak of what is no length.
fn lacks_length(words: &str) -> Option<&'static str> {
    let (lower, own) = (words.to_lowercase(), words_of_name(words));
    let has = |word: &str| own.iter().any(|own| own == word);
    if has("mist") {
        return Some(
            "its name says that it is a mist, whose numbers are no lengths: expected the pass of depth (Z), or --depth-unit or --depth-kind",
        );
    }
    let of_depth = own.iter().any(|own| own.contains("depth"));
    let is_other = ["log", "relative", "rel", "norm", "normalized", "normalised"].into_iter().any(has) && of_depth;
    if is_other || ["diopter", "diopters", "dioptre", "dioptres"].into_iter().any(has) {
        return Some(
            "its name or words say that its numbers are no lengths, but logarithms, shares or dioptres: expected --depth-unit or --depth-kind, as \
             inverse of dioptres",
        );
    }
    const INVERSE: [&str; 5] = ["inv", "idepth", "invdepth", "depthinv", "reciprocal"];
    let is_inverse = lower.contains("inverse") || INVERSE.into_iter().any(has);
    (lower.contains("disparit") || has("disp") || has("dispmap") || is_inverse).then_some(
        "its name or words say that it holds disparities or inverse distances: expected --depth-kind, as disparity:BASELINE_M or inverse",
    )
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
