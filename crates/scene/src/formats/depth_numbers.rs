//! The numbers of files of depth, whatever they count.

use std::path::Path;

use dioptric_pictures::DynamicImage;
use ndarray::Array2;

use super::{
    exr_depth_file::{DepthChannel, read_depth_exr},
    mat::{Plane, read_plane},
    npy::{NpyArray, read_npy},
    npz::read_npz_plane,
    pfm::read_pfm,
    picture::{decode, pnm_top},
    picture_parts::unknown_parts,
    reading::{DepthKind, Frame},
    stated::{name_of, note_of},
    tiff_file::{TiffFile, read_tiff},
    unusable::unreadable,
};
use crate::SceneError;

/// Numbers of a file of depth as they stand there.
pub(super) struct DepthNumbers {
    pub(super) values: Array2<f32>,
    /// The last code of whole numbers: 255 and 65535 of bytes and of words, 0 of others; none of floats.
    pub(super) top: Option<u16>,
    /// What the names in the file say that they count.
    pub(super) kind: DepthKind,
    /// The length of 1, m, where the file states it.
    pub(super) unit_m: Option<f64>,
    /// The picture of which they are a part, where the file tells.
    pub(super) frame: Option<Frame>,
    /// Where they are.
    pub(super) from: String,
    pub(super) notes: Vec<String>,
}

/// Reads the numbers of a file of depth; of several arrays or channels that of the name told.
pub(super) fn depth_numbers(path: &Path, told: Option<&str>) -> Result<DepthNumbers, SceneError> {
    let of = |values: Array2<f32>, top: Option<u16>, notes: Vec<String>| DepthNumbers {
        values,
        top,
        kind: DepthKind::Axial,
        unit_m: None,
        frame: None,
        from: name_of(path),
        notes,
    };
    let named = |name: &str| format!("'{name}' of {}", name_of(path));
    let ending = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    if told.is_some() && !["mat", "h5", "hdf5", "npz", "exr"].contains(&ending.as_str()) {
        return Err(unreadable(path, "it has one depth without a name, expected it without --depth-variable"));
    }
    Ok(match ending.as_str() {
        "pfm" => {
            let (mut planes, note) = read_pfm(path)?;
            of(planes.swap_remove(0), None, note.into_iter().collect())
        }
        "npy" => {
            let (values, top) = plane_of(path, read_npy(path)?)?;
            of(values, top, vec![])
        }
        "npz" => {
            let (name, array, notes) = read_npz_plane(path, told)?;
            let (values, top) = plane_of(path, array)?;
            DepthNumbers { from: named(&name), kind: kind_of_array(&name), ..of(values, top, notes) }
        }
        "mat" | "h5" | "hdf5" => {
            let Plane { name, values, top, unit_m, notes } = read_plane(path, told)?;
            DepthNumbers {
                from: named(&name),
                kind: kind_of_array(&name),
                unit_m,
                ..of(values, codes_of_top(top), notes)
            }
        }
        "exr" => {
            let DepthChannel { name, plane, kind, frame, notes } = read_depth_exr(path, told)?;
            DepthNumbers {
                from: format!("channel {}", named(&name)),
                kind,
                frame: Some(frame),
                ..of(plane, None, notes)
            }
        }
        "tif" | "tiff" => match read_tiff(path)? {
            TiffFile::Linear([mut plane, ..], page) => {
                page.undo(&mut plane, 1.0);
                of(plane, None, page.notes_of_depth(path))
            }
            TiffFile::Stack(mut stack) if stack.planes.len() == 1 => {
                let mut plane = stack.planes.swap_remove(0);
                stack.page.undo(&mut plane, stack.top.unwrap_or(1.0) as f32);
                of(plane, stack.top.map(|_| 0), stack.page.notes_of_depth(path))
            }
            TiffFile::Stack(stack) => {
                let reason = format!("it has {} planes, expected one of depth", stack.planes.len());
                return Err(unreadable(path, reason));
            }
            TiffFile::Picture(page) => {
                let (mut values, top) = codes_of(path)?;
                page.undo(&mut values, top.into());
                of(values, Some(top), page.notes_of_depth(path))
            }
        },
        _ => {
            let (values, top) = codes_of(path)?;
            of(values, Some(top), note_of(path, "part", &unknown_parts(path)?).into_iter().collect())
        }
    })
}

/// What the name of an array says that it counts.
fn kind_of_array(name: &str) -> DepthKind {
    let last = name.rsplit('/').next().unwrap_or(name);
    if last.eq_ignore_ascii_case("distance") { DepthKind::Radial } else { DepthKind::Axial }
}

/// Returns the last code of whole numbers whose largest is this.
fn codes_of_top(top: Option<f64>) -> Option<u16> {
    top.map(|top| match top {
        _ if top <= 255.0 => u16::from(u8::MAX),
        65535.0 => u16::MAX,
        _ => 0,
    })
}

/// Returns an array of rows and columns, whatever its sides of 1.
fn plane_of(path: &Path, array: NpyArray) -> Result<(Array2<f32>, Option<u16>), SceneError> {
    let sides: Vec<usize> = array.sides.iter().copied().filter(|side| *side != 1).collect();
    let &[rows, columns] = &sides[..] else {
        return Err(unreadable(path, format!("its sides are {:?}, expected rows and columns", array.sides)));
    };
    let values = Array2::from_shape_vec((rows, columns), array.values).map_err(|error| unreadable(path, error))?;
    Ok((values, codes_of_top(array.top)))
}

/// Returns the codes of a gray picture and the largest that there can be.
fn codes_of(path: &Path) -> Result<(Array2<f32>, u16), SceneError> {
    let of = |columns: u32, rows: u32, codes: Vec<f32>| {
        Array2::from_shape_vec((rows as usize, columns as usize), codes).expect("a code a pixel")
    };
    let (mut values, top) = match decode(path, 4)? {
        DynamicImage::ImageLuma16(p) => {
            let (columns, rows) = p.dimensions();
            (of(columns, rows, p.into_raw().into_iter().map(f32::from).collect()), u16::MAX)
        }
        DynamicImage::ImageLuma8(p) => {
            let (columns, rows) = p.dimensions();
            (of(columns, rows, p.into_raw().into_iter().map(f32::from).collect()), u16::from(u8::MAX))
        }
        other => {
            let reason = format!("its samples are {:?}, expected gray ones of 8 or 16 bits", other.color());
            return Err(unreadable(path, reason));
        }
    };
    // Codes whose largest is another were stretched to all of their bits: these are the numbers again.
    match pnm_top(path).filter(|own| *own != u32::from(top)) {
        Some(own) => {
            let factor = own as f32 / f32::from(top);
            values.mapv_inplace(|code| (code * factor).round());
            Ok((values, if own < 255 { u16::from(u8::MAX) } else { 0 }))
        }
        None => Ok((values, top)),
    }
}
