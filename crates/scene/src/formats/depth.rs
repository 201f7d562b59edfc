//! Depth of a scene's samples: in its file, in a file beside it, or in one that is named.

use std::{
    fs,
    path::{Path, PathBuf},
};

use super::{
    belonging::notes_of_companions,
    camera_files::beside,
    contents::{MATLAB_OR_HDF5, is_of},
    depth_names::{SaidOfDepth, may_be_of_a_buffer},
    depth_numbers::{DepthNumbers, depth_numbers},
    raw_depth::{DepthWords, RawDepth},
    reading::{DepthKind, DepthUnit},
    stated::{name_of, short},
    unusable::{check_whole, unreadable},
};
use crate::SceneError;

/// Endings of the depth of a picture beside it.
const ENDINGS: [&str; 12] = [
    ".depth.png",
    "_depth.png",
    ".depth.tif",
    "_depth.tif",
    ".depth.tiff",
    "_depth.tiff",
    ".depth.exr",
    "_depth.exr",
    ".depth.pfm",
    "_depth.pfm",
    ".depth.npy",
    "_depth.npy",
];
/// Endings of files that can be a map of depth, read or not.
const MAPS: [&str; 19] = [
    "png", "tif", "tiff", "exr", "pfm", "npy", "npz", "dpt", "jpg", "jpeg", "webp", "bmp", "ppm", "pgm", "pnm", "hdr",
    "txt", "csv", "asc",
];
/// The depth that one code of 16 bits stands for where nothing states it, m: depth cameras write millimetres.
const UNIT_M: f64 = 1e-3;
/// Codes of depth cameras end below; a map that goes on to the last code is stretched to all of them.
const STRETCHED_FROM: f32 = 60_000.0;

/// Reads the depth of a picture from a file beside it, or returns `None` where there is none.
///
/// For `room.png` the names looked for are `room.depth.png`, `room_depth.png` and the same with `.tif`, `.tiff`, `.exr`, `.pfm` and
/// `.npy`; the first is taken.
pub(super) fn depth_beside(picture: &Path, words: DepthWords<'_>) -> Result<Option<RawDepth>, SceneError> {
    let mut found = files_beside(picture).into_iter();
    let Some(path) = found.next() else { return Ok(None) };
    let mut depth = read_depth(&path, words)?;
    depth.notes.extend(super::stated::note_of(
        picture,
        "depth file",
        &found.map(|path| name_of(&path)).collect::<Vec<_>>(),
    ));
    Ok(Some(depth))
}

/// Returns the files of depth beside a picture, in their order.
pub(super) fn files_beside(picture: &Path) -> Vec<PathBuf> {
    beside(picture, &ENDINGS).into_iter().filter(|path| path != picture && path.is_file()).collect()
}

/// Returns files beside a picture that look like its depth but have other names than are looked for.
pub(super) fn likely_beside(picture: &Path) -> Vec<String> {
    let stem = picture.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
    // Hypersim has `frame.0000.depth_meters.hdf5` beside `frame.0000.color.hdf5`.
    let stem = stem.trim_end_matches(".color").to_owned();
    let folder = picture.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let Ok(entries) = fs::read_dir(folder) else { return vec![] };
    let known = files_beside(picture);
    let is_likely = |path: &PathBuf| {
        let name = name_of(path).to_lowercase();
        let ending = name.rsplit('.').next().unwrap_or_default();
        let is_map = MAPS.contains(&ending) || is_of(path, MATLAB_OR_HDF5);
        const WORDS: [&str; 2] = ["depth", "disp"];
        let is_end = |c: Option<char>| c.is_none_or(|c| !c.is_alphanumeric());
        // The stem is a word by itself, or stands before one of ours.
        let behind = name
            .strip_prefix(&stem)
            .filter(|rest| is_end(rest.chars().next()) || WORDS.iter().any(|word| rest.starts_with(word)));
        let before = || name.strip_suffix(ending)?.trim_end_matches('.').strip_suffix(&stem);
        let rest = behind.or_else(|| before().filter(|rest| is_end(rest.chars().last())));
        let says = |rest: &str| WORDS.iter().any(|word| rest.contains(word));
        is_map && rest.is_some_and(says) && path != picture && !known.contains(path)
    };
    let paths = entries.take(10_000).filter_map(|entry| Some(entry.ok()?.path()));
    let mut names: Vec<String> = paths.filter(is_likely).map(|path| name_of(&path)).collect();
    names.sort();
    names
}

/// Whether a file is a `frame.0000.depth_meters.hdf5` of Hypersim, whose depths are distances from the camera.
fn is_of_hypersim(path: &Path) -> bool {
    name_of(path).to_lowercase().ends_with(".depth_meters.hdf5")
}

/// Reads a file of depth: a gray picture of 8 or 16 bits, a TIFF of floats, PFM, EXR, an array of `NumPy`, MATLAB or HDF5.
///
/// Codes of 16 bits are millimetres, floats metres, unless something says otherwise; codes of 8 bits and the floats of a PFM, which
/// may be disparities, need their unit or kind.
///
/// # Errors
/// When the file is none of these, or its unit is not known.
pub(super) fn read_depth(path: &Path, words: DepthWords<'_>) -> Result<RawDepth, SceneError> {
    let mut notes = vec![];
    check_whole(path)?;
    let numbers = depth_numbers(path, words.variable)?.told_in(&mut notes);
    if numbers.values.is_empty() {
        return Err(unreadable(path, "it has no samples"));
    }
    // Distances that are counted from the camera say so by the name of their channel, or their file.
    let kind = if is_of_hypersim(path) { DepthKind::Radial } else { numbers.kind };
    notes.extend(notes_of_companions(path));
    let (unit_m, is_stated) = unit_m_of(path, &numbers, words)?;
    // Whole metres, and many of them, are rarely measured.
    let most = numbers.values.iter().copied().filter(|v| v.is_finite() && *v < NEVER_M).fold(0.0, f32::max);
    let are_whole = || numbers.values.iter().all(|v| !v.is_finite() || v.fract() == 0.0);
    notes.extend((!is_stated && unit_m == 1.0 && most >= MANY_M && are_whole()).then(|| {
        let name = name_of(path);
        format!(
            "{name}: its depths are whole numbers, up to {most}, and taken for metres: millimetres are --depth-unit mm"
        )
    }));
    // Those of renderers and of programs that guess depths go from 0 to 1, whatever they are called.
    let are_shares = numbers.top.is_none() && unit_m == 1.0 && most > 0.0 && most <= 1.0;
    let is_asked = are_shares || may_be_of_a_buffer(&name_of(path));
    notes.extend((is_asked && !is_stated && words.kind.is_none()).then(|| {
        let (name, most_m) = (name_of(path), f64::from(most) * unit_m);
        format!(
            "{name}: its depths go up to {most_m:.3} m, and are taken for lengths: --depth-unit says so, and --depth-kind if they are those \
             of a depth buffer or inverse"
        )
    }));
    notes.extend(numbers.length_in.filter(|_| words.unit.is_none()).map(|name| {
        let (file, name) = (name_of(path), short(&name));
        format!("{file}: the length in the name '{name}' is not used: --depth-unit says what 1 of its numbers is")
    }));
    let depth = RawDepth {
        kind,
        unit: DepthUnit::Metres(unit_m),
        is_picture: numbers.top.is_some(),
        top: numbers.top,
        columns_per_column: 1.0,
        frame: numbers.frame,
        values: numbers.values,
        file: path.to_owned(),
        from: numbers.from,
        notes,
    };
    depth.told(words)
}

/// Whole numbers up to so many are not likely to be metres; those from this on stand for a sky.
const MANY_M: f32 = 256.0;
const NEVER_M: f32 = 1e9;

/// Returns what 1 of a file's numbers is, m, and whether something says so; 1 where something says what else they are.
fn unit_m_of(path: &Path, numbers: &DepthNumbers, words: DepthWords<'_>) -> Result<(f64, bool), SceneError> {
    let wrong = |reason: &str| Err(unreadable(path, reason));
    let of_other_kind = words.kind.is_some_and(|kind| kind != DepthKind::Axial && kind != DepthKind::Radial);
    if let (Some(lacks), None, None) = (numbers.lacks, words.kind, words.unit) {
        return wrong(lacks);
    }
    if let Some(own_m) = numbers.unit_m {
        let told = words.unit.map(DepthUnit::parse).transpose()?;
        if of_other_kind || told.is_some_and(|told| told != DepthUnit::Metres(own_m)) {
            return wrong("it states the unit of its lengths: --depth-unit or --depth-kind says something else");
        }
        return Ok((own_m, true));
    }
    if words.unit.is_some() || of_other_kind {
        return Ok((1.0, true));
    }
    if let Some(unit_m) = words.unit_m {
        return Ok((unit_m, true));
    }
    let said = SaidOfDepth::of_file(&path.file_stem().unwrap_or_default().to_string_lossy());
    let own = said.unit_m;
    // Codes of metres would be of whole ones.
    if let Some(own_m) = own.filter(|own_m| numbers.top.is_none() || *own_m < 1.0) {
        return Ok((own_m, true));
    }
    match numbers.top {
        Some(..=255.0) => wrong(
            "what one of its codes of 8 bits stands for is not known: expected --depth-unit, as 255/m, or --depth-kind",
        ),
        Some(65_535.0) => {
            // Neither end counts: each may stand for what was not measured.
            let inner = numbers.values.iter().copied().filter(|v| *v > 0.0 && *v < 65535.0).fold(0.0, f32::max);
            if inner > STRETCHED_FROM && numbers.values.iter().any(|v| *v == 65535.0) {
                return wrong(
                    "its codes are stretched to all of 16 bits, as maps of inverse depth are: expected --depth-unit, as 65535/m, or \
                     --depth-kind, as inverse:0.5,inf",
                );
            }
            Ok((UNIT_M, false))
        }
        Some(_) => Ok((UNIT_M, false)),
        None if is_of(path, &["pfm"]) && !said.is_of_depth => wrong(
            "whether it holds depths or disparities is not known: expected --depth-unit m, or --depth-kind, as disparity:BASELINE_M",
        ),
        None => Ok((1.0, false)),
    }
}

#[cfg(test)]
mod tests {
    use super::{super::reading::Frame, *};
    use dioptric_pictures::save;
    use image::{ImageBuffer, Luma};
    use ndarray::Array2;

    fn words<'a>(unit: Option<&'a str>, kind: Option<&str>) -> DepthWords<'a> {
        DepthWords { unit, kind: kind.map(|kind| kind.parse().unwrap()), ..DepthWords::default() }
    }

    /// Writes codes of 16 bits and returns the depths that they are read as.
    fn read(codes: &[[u16; 4]], words: DepthWords<'_>) -> Result<Array2<f32>, SceneError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("room.depth.png");
        let picture = ImageBuffer::from_fn(4, codes.len() as u32, |x, y| Luma([codes[y as usize][x as usize]]));
        save(&picture.into(), &path).unwrap();
        let view = crate::View { focal_px: 100.0, center_x_px: 1.5, center_y_px: 0.5 };
        Ok(read_depth(&path, words)?.axial_m(Some(view)).unwrap())
    }

    #[test]
    fn codes_are_millimetres_unless_something_says_otherwise() {
        let none = DepthWords::default();
        let depth = read(&[[500, 1000, 0, 65535], [700; 4]], none).unwrap();
        // The last code, as the first, stands for nothing measured.
        assert_eq!(depth, ndarray::arr2(&[[0.5, 1.0, 0.0, 0.0], [0.7; 4]]));
        assert_eq!(read(&[[5000, 10_000, 1, 0]], words(Some("5000/m"), None)).unwrap()[(0, 1)], 2.0);
        assert_eq!(read(&[[50, 100, 1, 0]], DepthWords { unit_m: Some(0.01), ..none }).unwrap()[(0, 1)], 1.0);
        let stretched = [[0, 65535, 61_000, 7]];
        assert!(read(&stretched, none).unwrap_err().to_string().contains("inverse:0.5,inf"));
        assert!(read(&stretched, words(Some("mm"), None)).is_ok());
    }

    #[test]
    fn every_kind_becomes_depth_along_the_axis() {
        let flat = |kind: &str, unit: &str, code: u16| {
            read(&[[code; 4], [code; 4]], words(Some(unit), Some(kind))).unwrap()[(0, 0)]
        };
        // 1/z = .4 a metre; focal length 100 px, baseline .2 m, 8 px: 2.5 m.
        assert_eq!(flat("inverse", "1000/m", 400), 2.5);
        assert_eq!(flat("disparity:0.2", "256/px", 8 * 256), 2.5);
        assert_eq!(flat("disparity:0.2,3", "px", 5), 2.5);
        let radial = flat("radial", "mm", 2500);
        assert!(
            (f64::from(radial) - 2.5 / (1.0 + (1.5 / 100.0_f64).powi(2) + (0.5 / 100.0_f64).powi(2)).sqrt()).abs()
                < 1e-6
        );
        let relative = read(&[[0, 65535, 32768, 16384]], words(None, Some("inverse:0.5,inf"))).unwrap();
        assert_eq!((relative[(0, 0)], relative[(0, 1)]), (f32::INFINITY, 0.5));
        assert!((relative[(0, 2)] - 1.0).abs() < 1e-4);
        // Near at 0.5 m and far at 2 m are 2 and 0.5 a metre; reversed, without a far plane, and from -1 on.
        for (kind, unit, code, expected_m) in [
            ("buffer:0.5,2", "65535/m", 0, 0.5),
            ("buffer:0.5,2", "1000/m", 500, 0.8),
            ("buffer:0.5,inf", "1000/m", 750, 2.0),
            ("buffer:inf,0.5", "1000/m", 250, 2.0),
            ("ndc:0.5,2", "1000/m", 0, 0.8),
            ("ndc:0.5,2", "1000/m", 1000, 2.0),
        ] {
            assert!((flat(kind, unit, code) - expected_m).abs() < 1e-6, "{kind} {code}");
        }
        let all = read(&[[0, 65535, 13107, 26214]], words(None, Some("buffer:0.5,2"))).unwrap();
        for (own, expected) in all.iter().zip([0.5, 2.0, 1.0 / 1.7, 1.0 / 1.4]) {
            assert!((own - expected).abs() < 1e-6, "{all}");
        }
        for kind in ["buffer:0.5,2", "ndc:0.5,2", "inverse:0.5,2"] {
            let wrong = read(&[[1, 2, 3, 4]], words(Some("mm"), Some(kind))).unwrap_err().to_string();
            assert!(wrong.contains("'mm'") && wrong.contains("codes"), "{wrong}");
        }
        let wrong = read(&[[1001; 4]], words(Some("1000/m"), Some("buffer:0.5,2"))).unwrap_err().to_string();
        assert!(wrong.contains("1001") && wrong.contains("from 0 to 1000"), "{wrong}");
        assert!(read(&[[1; 4]], words(Some("px"), None)).unwrap_err().to_string().contains("disparity"));
        assert!(read(&[[1; 4]], words(Some("mm"), Some("disparity:1"))).is_err());
        assert!(read(&[[1; 4]], words(Some("mm"), Some("inverse"))).is_err());
        assert!(read(&[[3; 4]], words(None, Some("inverse:0.5,2"))).unwrap_err().to_string().contains("alike"));
    }

    #[test]
    fn numbers_of_buffers_tell_what_they_count() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npy");
        let read = |kind: &str, bytes: &[u8], words: DepthWords<'_>| {
            fs::write(&path, super::super::npy::tests::npy(kind, false, "(1, 2)", bytes)).unwrap();
            read_depth(&path, words)
        };
        let codes = |codes: [u32; 2]| codes.map(u32::to_le_bytes).concat();
        let last_24 = 16_777_215;
        for (own, unit, expected) in [
            ([last_24, 0], None, None),
            ([last_24, 0], Some("16777215/m"), Some([2.0, 0.5])),
            ([last_24, 0], Some("4294967295/m"), Some([0.501_469, 0.5])),
            ([u32::MAX, 0], None, Some([2.0, 0.5])),
        ] {
            let found = read("<u4", &codes(own), words(unit, Some("buffer:0.5,2")));
            match (found, expected) {
                (Ok(found), Some(expected_m)) => {
                    let z_m = found.axial_m(None).unwrap();
                    assert!(z_m.iter().zip(expected_m).all(|(z_m, own)| (z_m - own).abs() < 1e-6), "{z_m} {unit:?}");
                }
                (Err(error), None) => assert!(error.to_string().contains("16777215/m"), "{error}"),
                (found, _) => panic!("{own:?} {unit:?}: {:?}", found.err()),
            }
        }
        let floats = |floats: [f32; 2]| floats.map(f32::to_le_bytes).concat();
        let wrong = read("<f4", &floats([0.5, 1.0]), words(Some("1000/m"), Some("buffer:0.5,2"))).err().unwrap();
        assert!(wrong.to_string().contains("whole numbers up to 1000"), "{wrong}");
        // Whatever their names, numbers up to 1 may be no metres.
        for (own, told, is_noted) in [
            ([0.5, 0.9], DepthWords::default(), true),
            ([0.5, 0.9], words(Some("m"), None), false),
            ([0.5, 0.9], words(None, Some("axial")), false),
            ([0.5, 1.5], DepthWords::default(), false),
        ] {
            let notes = read("<f4", &floats(own), told).unwrap().notes;
            assert_eq!(notes.iter().any(|note| note.contains("taken for lengths")), is_noted, "{own:?} {notes:?}");
        }
        assert!(may_be_of_a_buffer("device_depth.png") && !may_be_of_a_buffer("window_1_depth.png"));
    }

    #[test]
    fn files_of_every_format_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let values = ndarray::arr2(&[[0.5, 1.0, 1.5, 2.0], [1e10, f32::NAN, 0.0, 0.7]]);
        let bytes: Vec<u8> = values.iter().flat_map(|v: &f32| v.to_le_bytes()).collect();
        fs::write(at("a.npy"), super::super::npy::tests::npy("<f4", false, "(2, 4)", &bytes)).unwrap();
        let upside_down: Vec<u8> = [&bytes[16..], &bytes[..16]].concat();
        fs::write(at("a.pfm"), [&b"Pf\n4 2\n-1.0\n"[..], &upside_down].concat()).unwrap();
        crate::write_planes_exr(&at("a.exr"), &[("A", &values), ("View.Depth.Z", &values)], crate::ExrSamples::Single)
            .unwrap();
        let mut file = fs::File::create(at("a.tif")).unwrap();
        let mut encoder = tiff::encoder::TiffEncoder::new(&mut file).unwrap();
        encoder.write_image::<tiff::encoder::colortype::Gray32Float>(4, 2, values.as_slice().unwrap()).unwrap();
        for name in ["a.npy", "a.pfm", "a.exr", "a.tif"] {
            let told = if name == "a.pfm" { words(Some("m"), None) } else { DepthWords::default() };
            let depth = read_depth(&at(name), told).unwrap();
            let z_m = depth.axial_m(None).unwrap();
            assert_eq!(z_m.row(0).to_vec(), [0.5, 1.0, 1.5, 2.0], "{name}");
            // Blender's sky, and places that were not measured.
            assert!(z_m[(1, 0)] == f32::INFINITY && z_m[(1, 1)].is_nan() && z_m[(1, 2)] == 0.0, "{name}: {z_m}");
        }
        assert!(read_depth(&at("a.pfm"), DepthWords::default()).is_err_and(|e| e.to_string().contains("disparity")));
        for name in ["room.depth.pfm", "img_0_DepthPlanar.pfm", "distance.pfm"] {
            std::fs::copy(at("a.pfm"), at(name)).unwrap();
            assert!(read_depth(&at(name), DepthWords::default()).is_ok(), "{name}");
        }
        for name in [
            "left_inverse_depth.npy",
            "disp.npy",
            "a_inv.npy",
            "invDepth_mm.npy",
            "disparity.tif",
            "inverse_depth.exr",
            "room.Mist.exr",
            "log_depth.npy",
            "dispmap_0001.npy",
            "depthinv.tif",
            "relative_depth.exr",
        ] {
            fs::copy(at("a").with_extension(name.rsplit('.').next().unwrap()), at(name)).unwrap();
            assert!(
                read_depth(&at(name), DepthWords::default()).is_err_and(|e| e.to_string().contains("--depth-kind"))
            );
        }
        // Files are counted; what stands before the number says what they are.
        for (name, kind, unit_m) in [
            ("distance_to_camera_0001.npy", DepthKind::Radial, 1.0),
            ("range_0001.exr", DepthKind::Radial, 1.0),
            ("img_0_DepthPerspective.npy", DepthKind::Radial, 1.0),
            ("distance_to_image_plane.tif", DepthKind::Axial, 1.0),
            ("depth_mm_0001.npy", DepthKind::Axial, 1e-3),
        ] {
            fs::copy(at("a").with_extension(name.rsplit('.').next().unwrap()), at(name)).unwrap();
            let depth = read_depth(&at(name), DepthWords::default()).unwrap();
            assert_eq!((depth.kind, depth.unit), (kind, DepthUnit::Metres(unit_m)), "{name}");
        }
        let gray = image::GrayImage::from_pixel(4, 2, Luma([51]));
        save(&gray.into(), &at("b.png")).unwrap();
        assert!(read_depth(&at("b.png"), DepthWords::default()).is_err_and(|e| e.to_string().contains("8 bits")));
        let told = read_depth(&at("b.png"), words(Some("25.5/m"), None)).unwrap();
        assert_eq!(told.axial_m(None).unwrap()[(0, 0)], 2.0);
    }

    #[test]
    fn words_of_arrays_say_what_they_count() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.h5");
        let read = |name: &str, long_name: &str| {
            let mut file = hdf5_pure::FileBuilder::new();
            let array = file.create_dataset(name).with_data(&[1.0_f32; 4]).with_shape(&[2, 2]);
            array.set_attr("long_name", hdf5_pure::AttrValue::String(long_name.to_owned()));
            let array = file.create_dataset("other").with_data(&[1.0_f32; 4]).with_shape(&[2, 2]);
            array.set_attr("long_name", hdf5_pure::AttrValue::String("distance from the camera".to_owned()));
            fs::write(&path, file.finish().unwrap()).unwrap();
            let variable = match name {
                "x" => Some("other"),
                own => Some(own).filter(|own| !["depth", "distance", "disparity"].contains(own)),
            };
            read_depth(&path, DepthWords { variable, ..DepthWords::default() })
        };
        for (name, words, kind) in [
            ("depth", "distance along the ray", DepthKind::Radial),
            ("depth", "Euclidean range", DepthKind::Radial),
            ("depth", "depth of the array", DepthKind::Axial),
            ("distance", "distance along the optical axis", DepthKind::Axial),
            ("distance", "", DepthKind::Radial),
            ("x", "", DepthKind::Radial),
            ("radial_depth", "", DepthKind::Radial),
            ("depthRay", "", DepthKind::Radial),
            ("euclidean_distance_mm", "", DepthKind::Radial),
            ("range", "", DepthKind::Radial),
            ("distance", "planar depth", DepthKind::Axial),
            ("array_of_depth", "", DepthKind::Axial),
            ("distance_to_image_plane", "", DepthKind::Axial),
            ("DepthPerspective", "", DepthKind::Radial),
        ] {
            let found = read(name, words);
            assert!(found.as_ref().is_ok_and(|depth| depth.kind == kind), "{name}, {words}: {:?}", found.err());
        }
        let millimetres = read("depth", "depth in mm").unwrap();
        assert_eq!(millimetres.unit, DepthUnit::Metres(1e-3));
        assert!(!millimetres.notes.iter().any(|note| note.contains("long_name")), "{:?}", millimetres.notes);
        let notes = read("depth", "depth in mm or km").unwrap().notes;
        assert!(notes.iter().any(|note| note.contains("long_name")), "{notes:?}");
        for (name, words) in [("depth", "inverse depth"), ("disparity", "")] {
            let message = read(name, words).err().unwrap().to_string();
            assert!(message.contains("--depth-kind"), "{message}");
        }
        assert!(likely_beside(&folder.path().join("b.png")).is_empty());
        for name in ["b.depth.jpg", "b_depth.webp", "b.disp.png"] {
            fs::write(folder.path().join(name), "").unwrap();
        }
        assert_eq!(likely_beside(&folder.path().join("b.png")), ["b.depth.jpg", "b.disp.png", "b_depth.webp"]);
    }

    #[test]
    fn codes_are_the_numbers_whatever_they_are_counted_from() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let z_m = |name: &str, told: DepthWords<'_>| read_depth(&at(name), told).unwrap().axial_m(None).unwrap();
        // A largest code below that of the bits is no reason to stretch.
        let codes: Vec<u8> = [2000_u16, 5000, 1, 0].iter().flat_map(|code| code.to_be_bytes()).collect();
        fs::write(at("a.pgm"), [&b"P5\n# a word\n2 2\n5000\n"[..], &codes].concat()).unwrap();
        assert_eq!(z_m("a.pgm", DepthWords::default()), ndarray::arr2(&[[2.0, 5.0], [0.001, 0.0]]));
        fs::write(at("b.pgm"), "P2 2 2 100\n50 99 1 0\n").unwrap();
        assert_eq!(z_m("b.pgm", words(Some("cm"), None)), ndarray::arr2(&[[0.5, 0.99], [0.01, 0.0]]));
        // Where 0 is white, and a number that stands for none.
        let tiff = |name: &str, white_zero: bool, none: Option<&str>| {
            let mut file = fs::File::create(at(name)).unwrap();
            let mut encoder = tiff::encoder::TiffEncoder::new(&mut file).unwrap();
            let mut image = encoder.new_image::<tiff::encoder::colortype::Gray16>(2, 2).unwrap();
            if white_zero {
                image.encoder().write_tag(tiff::tags::Tag::PhotometricInterpretation, 0_u16).unwrap();
            }
            if let Some(none) = none {
                image.encoder().write_tag(tiff::tags::Tag::GdalNodata, none).unwrap();
            }
            image.encoder().write_tag(tiff::tags::Tag::ImageDescription, "depth_scale=5000").unwrap();
            image.write_data(&[2000, 9999, 500, 700]).unwrap();
        };
        let mut file = fs::File::create(at("c.tif")).unwrap();
        let mut encoder = tiff::encoder::TiffEncoder::new(&mut file).unwrap();
        let mut image = encoder.new_image::<tiff::encoder::colortype::Gray32Float>(2, 1).unwrap();
        image.encoder().write_tag(tiff::tags::Tag::PhotometricInterpretation, 0_u16).unwrap();
        image.write_data(&[0.001_234_567, 1234.567]).unwrap();
        assert_eq!(z_m("c.tif", DepthWords::default()), ndarray::arr2(&[[0.001_234_567, 1234.567]]));
        for (name, white_zero) in [("a.tif", false), ("b.tif", true)] {
            tiff(name, white_zero, Some("9999"));
            let depth = z_m(name, DepthWords::default());
            assert!(depth[(0, 1)].is_nan() && depth[(0, 0)] == 2.0 && depth.row(1).to_vec() == [0.5, 0.7], "{depth}");
            let notes = read_depth(&at(name), DepthWords::default()).unwrap().notes;
            assert_eq!(notes[0], format!("{name}: its description 'depth_scale=5000' is not used"));
            // A number of depth is no light, and what is marked is said.
            assert_eq!(notes.get(1).is_some_and(|note| note.contains("0 is white")), white_zero, "{notes:?}");
        }
    }

    #[test]
    fn other_resolutions_keep_outlines() {
        let values = ndarray::arr2(&[[1.0, 4.0], [1.0, 4.0]]);
        let depth = RawDepth::in_file(Path::new("a.exr"), "Z".to_owned(), values, DepthKind::Axial);
        let finer = depth.resized(4, 4).unwrap();
        assert_eq!(finer.values, ndarray::arr2(&[[1.0, 1.0, 4.0, 4.0]; 4]));
        assert_eq!(finer.notes.len(), 1);
        assert_eq!(finer.resized(2, 2).unwrap().values[(0, 1)], 4.0);
        let depth = RawDepth::in_file(Path::new("a.exr"), "Z".to_owned(), Array2::ones((20, 20)), DepthKind::Axial);
        assert!(depth.resized(20, 40).is_err_and(|error| error.to_string().contains("20 × 20")));
        // Anchors are those of all the map, whatever of it is taken.
        let map = Array2::from_shape_fn((3, 3), |(row, column)| (3 * row + column) as f32);
        let kind = Some(DepthKind::InverseBetween { near_m: 0.5, far_m: f64::INFINITY });
        let depth = RawDepth::in_file(Path::new("a.exr"), "Z".to_owned(), map, DepthKind::Axial);
        let depth = depth.told(DepthWords { kind, ..DepthWords::default() }).unwrap().resized(1, 1).unwrap();
        assert_eq!(depth.axial_m(None).unwrap()[(0, 0)], 1.0);
        // A disparity counts the samples of its own map: those of half of the picture are as large, those of half its resolution half as large.
        let view = crate::View { focal_px: 100.0, center_x_px: 3.5, center_y_px: 1.5 };
        for (own, frame, disparity) in [((4, 8), (4, 8), 10.0), ((2, 4), (2, 4), 5.0), ((4, 4), (4, 8), 10.0)] {
            let kind = DepthKind::Disparity { baseline_m: 0.2, offset_px: 0.0 };
            let map = Array2::from_elem(own, disparity);
            let depth = RawDepth {
                frame: Some(Frame::whole(frame.0, frame.1)),
                unit: DepthUnit::Samples(1.0),
                ..RawDepth::in_file(Path::new("a.exr"), "Z".to_owned(), map, kind)
            };
            let depth = depth.laid_on(Frame::whole(4, 8), (4, 8)).resized(4, 8).unwrap();
            assert_eq!(depth.axial_m(Some(view)).unwrap()[(3, 2)], 2.0, "{own:?}");
        }
    }

    #[test]
    fn the_first_file_beside_is_taken_and_the_others_named() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for (name, code) in [("room_depth.png", 700_u16), ("room.depth.png", 500), ("room_disp.png", 9)] {
            save(&ImageBuffer::from_pixel(4, 2, Luma([code])).into(), &at(name)).unwrap();
        }
        let depth = depth_beside(&at("room.png"), DepthWords::default()).unwrap().unwrap();
        assert_eq!(depth.axial_m(None).unwrap()[(0, 0)], 0.5);
        assert_eq!(depth.notes, ["room.png: its depth file 'room_depth.png' is not used"]);
        assert_eq!(likely_beside(&at("room.png")), ["room_disp.png"]);
        assert!(depth_beside(&at("other.png"), DepthWords::default()).unwrap().is_none());
    }
}
