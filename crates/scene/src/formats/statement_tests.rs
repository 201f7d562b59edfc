//! What files state twice, not at all, or by a number that stands for none; and what they are refused with.

use std::{
    fs,
    path::{Path, PathBuf},
};

use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, Text, WritableImage,
};
use ndarray::Array2;

use super::{FileQuantity, FileReading, NoData, ReadOptions, kinds_tests::zip_of, npy::tests::npy, read_scene};
use crate::{Scene, SceneError};

const ROWS: usize = 2;
const COLUMNS: usize = 3;

/// A folder with a picture of gray.
fn folder_with_picture() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.png");
    let pixels = image::RgbImage::from_pixel(COLUMNS as u32, ROWS as u32, image::Rgb([99; 3]));
    dioptric_pictures::save(&pixels.into(), &path).unwrap();
    (folder, path)
}

fn options(reading: FileReading) -> ReadOptions {
    ReadOptions { horizontal_fov_deg: Some(20.0), reading, ..ReadOptions::default() }
}

#[track_caller]
fn check_noted(scene: &Scene, words: &[&str]) {
    for word in words {
        assert!(scene.notes.iter().any(|note| note.contains(word)), "{word}: {:?}", scene.notes);
    }
}

#[track_caller]
fn check_refused(read: Result<Scene, SceneError>, words: &[&str]) {
    let message = read.expect_err("a refusal").to_string();
    assert!(words.iter().all(|word| message.contains(word)) && !message.contains('\n'), "{message}");
}

/// Reads a file of depth beside a picture.
fn with_depth(name: &str, bytes: &[u8], unit: Option<&str>) -> Result<Scene, SceneError> {
    let (folder, picture) = folder_with_picture();
    let depth = folder.path().join(name);
    fs::write(&depth, bytes).unwrap();
    let reading = FileReading { depth: Some(depth), depth_unit: unit.map(str::to_owned), ..FileReading::default() };
    read_scene(&picture, &ReadOptions { fill_depth: Some("9".parse().unwrap()), ..options(reading) })
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

#[test]
fn numbers_that_stand_for_none_do_so_in_every_type() {
    let z_m = |name: &str, bytes: &[u8]| {
        let scene = with_depth(name, bytes, Some("mm")).unwrap();
        check_noted(&scene, &["have no depth; they get 9 m"]);
        scene.depth.unwrap().z_m().clone()
    };
    let expected = ndarray::arr2(&[[2.0, 9.0, 3.0], [4.0, 5.0, 9.0]]);
    let codes = [2000.0, 65_535.0, 3000.0, 4000.0, 5000.0, 0.0];
    let ints = |values: [i32; 6]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    assert_eq!(z_m("a.npy", &npy("<f4", false, "(2, 3)", &floats(&codes))), expected);
    assert_eq!(z_m("a.npy", &npy("<i4", false, "(2, 3)", &ints(codes.map(|v| v as i32)))), expected);
    for none in [-1, -9999, i32::MAX] {
        let codes = [2000, none, 3000, 4000, 5000, 0];
        assert_eq!(z_m("a.npy", &npy("<i4", false, "(2, 3)", &ints(codes))), expected, "{none}");
    }
    assert_eq!(z_m("a.txt", b"2000 nan 3000\n4000 5000 -1\n"), expected);
    for none in [f32::NEG_INFINITY, f32::MIN, -0.5] {
        let codes = [2000.0, none, 3000.0, 4000.0, 5000.0, 0.0];
        assert_eq!(z_m("a.npy", &npy("<f4", false, "(2, 3)", &floats(&codes))), expected, "{none}");
    }
    // An axis that points to the camera.
    let turned = npy("<f4", false, "(2, 3)", &floats(&[-2.0, -3.0, -4.0, -5.0, 6.0, f32::NAN]));
    check_refused(with_depth("a.npy", &turned, Some("m")), &["below 0", "other sign"]);
}

#[test]
fn names_of_depths_state_their_unit() {
    let plane = npy("<f4", false, "(2, 3)", &floats(&[2000.0; 6]));
    let archive = zip_of(&[("depth_mm", plane.clone())], false);
    let z_m = |name: &str, bytes: &[u8], unit| with_depth(name, bytes, unit).unwrap().depth.unwrap().range_m();
    assert_eq!(z_m("a.npz", &archive, None), (2.0, 2.0));
    assert_eq!(z_m("a.npz", &archive, Some("mm")), (2.0, 2.0));
    check_refused(with_depth("a.npz", &archive, Some("m")), &["a.npz", "states the unit"]);
    assert_eq!(z_m("depth_mm.npy", &plane, None), (2.0, 2.0));
    // A file may have been named by another.
    assert_eq!(z_m("depth_mm.npy", &plane, Some("cm")), (20.0, 20.0));
}

#[test]
fn numbers_and_units_in_names_are_named() {
    let plane = npy("<f4", false, "(2, 3)", &floats(&[2.0; 6]));
    for (array, file) in [("depth_2_mm_x", "a.npz"), ("depth", "lens_50mm.npz"), ("depth_0.5_m", "a.npz")] {
        let archive = zip_of(&[(array, plane.clone())], false);
        let scene = with_depth(file, &archive, None).unwrap();
        check_noted(&scene, &["the length in the name", "--depth-unit"]);
        assert!(with_depth(file, &archive, Some("m")).unwrap().notes.iter().all(|note| !note.contains("in the name")));
    }
    let folder = tempfile::tempdir().unwrap();
    for (array, file, is_named) in [
        ("radiance_2_uW", "a.npz", true),
        ("radiance_mW_m2_sr_nm", "a.npz", true),
        ("refl_percent", "a.npz", true),
        ("radiance", "cube_uW.npz", true),
        ("radiance", "a.npz", false),
    ] {
        let path = folder.path().join(file);
        fs::write(&path, zip_of(&[(array, npy("<f4", false, "(2, 3, 1)", &floats(&[0.5; 6])))], false)).unwrap();
        let told = |scale| FileReading {
            quantity: Some(FileQuantity::Radiance),
            wavelengths_nm: Some(vec![550.0]),
            axes: Some("yxb".to_owned()),
            scale,
            ..FileReading::default()
        };
        let is_noted = |scale| {
            let scene = read_scene(&path, &options(told(scale))).unwrap();
            scene.notes.iter().any(|note| note.contains("the unit in the name"))
        };
        assert_eq!([is_noted(None), is_noted(Some(1e-3))], [is_named, false], "{array} of {file}");
    }
}

#[test]
fn comments_of_depths_are_named() {
    let codes: Vec<u8> = [2000_u16; 6].iter().flat_map(|v| v.to_be_bytes()).collect();
    let scene = with_depth("a.pgm", &[&b"P5\n# depth_scale 5000\n3 2\n65535\n"[..], &codes].concat(), None).unwrap();
    check_noted(&scene, &["'comment 'depth_scale 5000''"]);
    let scene = with_depth("a.txt", b"# depths in mm\n2 2 2\n2 2 2\n", None).unwrap();
    check_noted(&scene, &["'depths in mm'"]);
}

/// The name of a layer, its rows and columns, and its channels with the number that they have everywhere.
type LayerOf<'a> = (&'a str, (usize, usize), &'a [(&'a str, f32)]);

/// Writes an EXR file of channels that are the same everywhere, of layers of so many samples.
fn write_exr(path: &Path, layers: &[LayerOf<'_>]) {
    let layers = layers.iter().map(|(name, size, channels)| {
        let plane = |v: f32| FlatSamples::F32(vec![v; size.0 * size.1]);
        let of = |(name, v): &(&str, f32)| {
            // As other programs write it: a byte a byte of UTF-8.
            AnyChannel::new(Text::from_bytes_unchecked(name.bytes().collect()), plane(*v))
        };
        let channels = channels.iter().map(of).collect();
        Layer::new(
            (size.1, size.0),
            LayerAttributes::named(*name),
            Encoding::FAST_LOSSLESS,
            AnyChannels::sort(channels),
        )
    });
    let layers: exr::image::Layers<AnyChannels<FlatSamples>> = layers.collect();
    let window = exr::meta::attribute::IntegerBounds::from_dimensions((COLUMNS, ROWS));
    Image::from_layers(exr::meta::header::ImageAttributes::new(window), layers).write().to_file(path).unwrap();
}

const FRONT: [(&str, f32); 4] = [("S0.450,0nm", 0.01), ("S0.550,0nm", 0.01), ("S0.650,0nm", 0.01), ("Z", 2.0)];

/// Reads a scene with a layer of these channels behind.
fn with_hidden(channels: &[(&str, f32)]) -> Result<Scene, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    let [front, behind] = ["front.exr", "behind.exr"].map(|name| folder.path().join(name));
    write_exr(&front, &[("", (ROWS, COLUMNS), &FRONT)]);
    write_exr(&behind, &[("", (ROWS, COLUMNS), channels)]);
    read_scene(&front, &ReadOptions { hidden: Some(behind), ..options(FileReading::default()) })
}

#[test]
fn files_of_hidden_layers_say_what_scenes_say() {
    let same = with_hidden(&[("S0.450,0nm", 0.01), ("S0.550,0nm", 0.01), ("S0.650,0nm", 0.01), ("Z", 4.0)]).unwrap();
    check_noted(
        &same,
        &["behind.exr: behind the first surface, radiance, taken for W/m^2/sr/nm, 3 bands", "depth 4.00 m", "6 of 6"],
    );
    let shifted = with_hidden(&[("S0.457,0nm", 0.01), ("S0.557,0nm", 0.01), ("S0.657,0nm", 0.01), ("Z", 4.0)]).unwrap();
    check_noted(&shifted, &["behind.exr: 3 bands of 457–657 nm, 100 nm apart become 3 bands of 450–650 nm"]);
    let reflecting = with_hidden(&[("T.450,0nm", 0.5), ("T.550,0nm", 0.5), ("T.650,0nm", 0.5), ("Z", 4.0)]).unwrap();
    check_noted(
        &reflecting,
        &["behind.exr: behind the first surface, reflectance, under a light of x, y 0.313, 0.329 and 1000 lx"],
    );
    let colors = with_hidden(&[("R", 1.0), ("G", 1.0), ("B", 1.0), ("Z", 4.0)]).unwrap();
    check_noted(&colors, &["behind.exr: behind the first surface, linear colors as a display shows them"]);
    let unknown = [("S0.450,0nm", 0.01), ("S0.550,0nm", 0.01), ("S0.650,0nm", 0.01), ("Z", f32::NAN)];
    check_refused(with_hidden(&unknown), &["behind.exr", "nowhere a number"]);
    check_refused(
        with_hidden(&[("S0.450,0nm", 0.01), ("S0.480,0nm", 0.01), ("Z", 4.0)]),
        &["behind.exr", "450–480 nm"],
    );
}

/// What reflects behind a first surface whose light is known is under that light.
#[test]
fn what_lies_behind_is_under_the_light_on_the_first_surface() {
    let folder = tempfile::tempdir().unwrap();
    let [front, behind] = ["front.exr", "behind.exr"].map(|name| folder.path().join(name));
    let reflecting = [("T.450,0nm", 0.5), ("T.550,0nm", 0.5), ("T.650,0nm", 0.5), ("Z", 2.0)];
    write_exr(&front, &[("", (ROWS, COLUMNS), &reflecting)]);
    write_exr(&behind, &[("", (ROWS, COLUMNS), &reflecting)]);
    let light = Some(dioptric_spectrum::Illuminant::A);
    let lit = ReadOptions { light, illuminance_lux: Some(300.0), ..options(FileReading::default()) };
    let scene = read_scene(&front, &ReadOptions { hidden: Some(behind), ..lit }).unwrap();
    let hidden = scene.hidden.as_ref().unwrap();
    assert_eq!(hidden.radiance, scene.radiance);
    check_noted(&scene, &["front.exr: reflectance, under a light of x, y 0.448, 0.407 and 300 lx"]);
}

#[test]
fn parts_and_names_of_exr_files_are_those_of_the_picture() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let colors = [("R", 1.0), ("G", 1.0), ("B", 1.0)];
    let dark = [("R", 0.1), ("G", 0.1), ("B", 0.1)];
    write_exr(&path, &[("thumb", (1, 2), &dark), ("beauty", (ROWS, COLUMNS), &colors)]);
    let scene = read_scene(&path, &ReadOptions::default()).unwrap();
    assert_eq!((scene.rows(), scene.columns()), (ROWS, COLUMNS));
    check_noted(&scene, &["its part 'thumb' is not used"]);
    write_exr(&path, &[("", (ROWS, COLUMNS), &[&colors[..], &[("Tiefe_ü.V", 2.0)]].concat())]);
    let reading = FileReading { depth_variable: Some("Tiefe_ü.V".to_owned()), ..FileReading::default() };
    assert_eq!(read_scene(&path, &options(reading)).unwrap().depth.unwrap().range_m(), (2.0, 2.0));
}

/// A JPEG picture with Exif data of a focal length, turned by a quarter, and what is said of it.
#[cfg(feature = "jpeg")]
#[test]
fn focal_lengths_of_cameras_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.jpg");
    let gray: image::DynamicImage = image::RgbImage::from_pixel(30, 20, image::Rgb([99; 3])).into();
    let bytes = dioptric_pictures::encode(&gray, image::ImageFormat::Jpeg).unwrap();
    let field = |tag: u16, value: u32| [&tag.to_le_bytes()[..], &[3, 0, 1, 0, 0, 0], &value.to_le_bytes()].concat();
    let exif = [&b"Exif\0\0II*\0\x08\0\0\0\x02\0"[..], &field(0x0112, 6), &field(0xA405, 50), &[0; 4]].concat();
    let segment = [&[0xff, 0xe1][..], &(exif.len() as u16 + 2).to_be_bytes(), &exif].concat();
    fs::write(&path, [&bytes[..2], &segment, &bytes[2..]].concat()).unwrap();
    let scene = read_scene(&path, &options(FileReading::default())).unwrap();
    // Of a diagonal of 43.27 mm the short side is 24 mm, at 50 mm 27.0°.
    check_noted(
        &scene,
        &[
            "it is turned upright",
            "a focal length of 50 mm on 35 mm film, with which it would be 27.0° wide (--fov-deg)",
        ],
    );
}

#[test]
fn wavelengths_of_arrays_are_in_the_unit_that_is_stated() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.h5");
    let nm = [450.0, 550.0, 650.0];
    let read = |unit: Option<&str>, waves: &[f64]| {
        let mut file = hdf5_pure::FileBuilder::new();
        file.create_dataset("cube").with_data(&[0.5; 18]).with_shape(&[2, 3, 3]);
        let list = file.create_dataset("wavelengths").with_data(waves).with_shape(&[3]);
        if let Some(unit) = unit {
            list.set_attr("units", hdf5_pure::AttrValue::String(unit.to_owned()));
        }
        fs::write(&path, file.finish().unwrap()).unwrap();
        let reading = FileReading {
            quantity: Some(FileQuantity::Radiance),
            axes: Some("yxb".to_owned()),
            ..FileReading::default()
        };
        read_scene(&path, &options(reading))
    };
    for (unit, of) in [
        (None, (|nm| nm) as fn(f64) -> f64),
        (None, |nm| nm * 1e-3),
        (Some("nm"), |nm| nm),
        (Some("um"), |nm| nm * 1e-3),
        (Some("angstrom"), |nm| nm * 10.0),
        (Some("m"), |nm| nm * 1e-9),
        (Some("cm-1"), |nm| 1e7 / nm),
        (Some("THz"), |nm| 299_792.458 / nm),
        (Some("eV"), |nm| 1_239.841_984 / nm),
    ] {
        let scene = read(unit, &nm.map(of)).unwrap_or_else(|error| panic!("{unit:?}: {error}"));
        for (found, expected) in scene.radiance.grid().centers_nm().iter().zip(nm) {
            assert!((found - expected).abs() < 1e-6, "{unit:?}: {found}");
        }
    }
    check_refused(read(Some("zorp"), &nm), &["a.h5", "'wavelengths' are in 'zorp'", "--scene-wavelengths-nm"]);
    check_refused(read(Some("um"), &nm), &["a.h5", "no wavelength of light"]);
    check_refused(read(None, &[45.0, 55.0, 65.0]), &["a.h5", "'wavelengths' (45, 55, 65, …) has no unit"]);
    check_refused(read(None, &[450.0, 450.0, 650.0]), &["a.h5", "bands 1 and 2 lie both at 450 nm"]);
}

/// What a file says of its numbers cannot be contradicted.
#[test]
fn reflectances_of_a_file_are_no_light() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    fs::write(&path, "nm,a\n450,0.1\n550,0.2\n").unwrap();
    let quantity = Some(FileQuantity::Radiance);
    check_refused(
        read_scene(&path, &options(FileReading { quantity, ..FileReading::default() })),
        &["a.csv", "--quantity"],
    );
    let unit = Some("W/m^2/sr/nm".to_owned());
    check_refused(read_scene(&path, &options(FileReading { unit, ..FileReading::default() })), &["a.csv", "--unit"]);
    assert!(read_scene(&path, &options(FileReading::default())).is_ok());
}

#[test]
fn bands_of_folders_are_refused_by_the_names_of_their_files() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, rows: u32| {
        let plane = image::ImageBuffer::from_pixel(3, rows, image::Luma([9_u8]));
        dioptric_pictures::save(&plane.into(), &folder.path().join(name)).unwrap();
    };
    write("a_450.png", 2);
    write("b_450.png", 2);
    check_refused(read_scene(folder.path(), &ReadOptions::default()), &["a_450.png and b_450.png are both of 450 nm"]);
    fs::remove_file(folder.path().join("b_450.png")).unwrap();
    write("b_500.png", 4);
    let words = ["b_500.png", "it is 3 × 4 samples, but a_450.png 3 × 2"];
    check_refused(read_scene(folder.path(), &ReadOptions::default()), &words);
}

/// Depths that nobody has measured make no layer, those that are known lie where they are.
#[test]
fn samples_without_a_layer_behind_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let [front, behind] = ["front.exr", "behind.exr"].map(|name| folder.path().join(name));
    write_exr(&front, &[("", (ROWS, COLUMNS), &FRONT)]);
    let plane = |v: f32| Array2::from_elem((ROWS, COLUMNS), v);
    let mut z = plane(4.0);
    z[(0, 0)] = f32::NAN;
    let own = plane(0.01);
    let planes = [("S0.450,0nm", &own), ("S0.550,0nm", &own), ("S0.650,0nm", &own), ("Z", &z)];
    crate::write_planes_exr(&behind, &planes, crate::ExrSamples::Single).unwrap();
    let scene = read_scene(&front, &ReadOptions { hidden: Some(behind), ..options(FileReading::default()) }).unwrap();
    check_noted(&scene, &["known of 5 of 6 samples"]);
    assert_eq!(scene.hidden.unwrap().depth.z_m()[(0, 0)], 2.0);
}

/// What an EXR file says of its white is used, or named where it cannot be or an option takes its place.
#[test]
fn whites_of_files_are_used_or_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let read = |white: f32, value: f32, lux: Option<f64>, no_data: Option<NoData>| {
        let channels = ["R", "G", "B"].map(|name| AnyChannel::new(name, FlatSamples::F32(vec![value; ROWS * COLUMNS])));
        let attributes = LayerAttributes { white_luminance: Some(white), ..LayerAttributes::default() };
        let channels = AnyChannels::sort(channels.into_iter().collect());
        let layer = Layer::new((COLUMNS, ROWS), attributes, Encoding::FAST_LOSSLESS, channels);
        Image::from_layer(layer).write().to_file(&path).unwrap();
        read_scene(
            &path,
            &ReadOptions { illuminance_lux: lux, ..options(FileReading { no_data, ..FileReading::default() }) },
        )
    };
    for white in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        check_noted(&read(white, 0.5, None, None).unwrap(), &["whiteLuminance, which is no likely value"]);
    }
    let level = |scene: Scene| scene.mean_luminance_cd_m2();
    assert!((level(read(100.0, 0.5, None, None).unwrap()) / 50.0 - 1.0).abs() < 1e-3);
    let told = read(100.0, 0.5, Some(std::f64::consts::PI), None).unwrap();
    check_noted(&told, &["its white luminance by --illuminance-lux"]);
    assert!((level(told) / 0.5 - 1.0).abs() < 1e-3);
    // Of no color is the light below 0.
    check_noted(&read(100.0, -0.1, None, None).unwrap(), &["of 18 samples of all bands 18 below 0 are 0"]);
    let refused = read(100.0, -0.1, None, Some(NoData::Refuse));
    check_refused(refused, &["row 0, column 0 is -0.1, -0.1, -0.1", "--no-data refuse"]);
}

#[test]
fn lights_known_in_part_are_named_whatever_is_under_them() {
    let (_folder, path) = folder_with_picture();
    let light = dioptric_spectrum::Spectrum::new(vec![500.0, 600.0], vec![1.0, 1.0]).unwrap();
    let light = Some(dioptric_spectrum::Illuminant::Spectrum(light));
    for quantity in [None, Some(FileQuantity::Reflectance)] {
        let own = options(FileReading { quantity, ..FileReading::default() });
        let scene = read_scene(&path, &ReadOptions { light: light.clone(), ..own }).unwrap();
        check_noted(&scene, &["known from 500 to 600 nm"]);
    }
    let refused = FileReading { no_data: Some(NoData::Refuse), ..FileReading::default() };
    check_refused(read_scene(&path, &options(refused)), &["--no-data"]);
}

/// Parts of profiles, and chunks of colors that nobody can read, are not passed over.
#[cfg(feature = "jpeg")]
#[test]
fn damaged_colors_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let gray: image::DynamicImage = image::RgbImage::from_pixel(3, 2, image::Rgb([99; 3])).into();
    let encoded = |format| dioptric_pictures::encode(&gray, format).unwrap();
    let jpeg = encoded(image::ImageFormat::Jpeg);
    let segment = [&[0xff, 0xe2, 0, 20][..], b"ICC_PROFILE\0\x01\x02abcd"].concat();
    let png = encoded(image::ImageFormat::Png);
    // With a checksum that does not fit.
    let chunk = [&[0, 0, 0, 4][..], b"gAMA", &100_000_u32.to_be_bytes(), &[9; 4]].concat();
    for (name, bytes, word) in [
        ("a.jpg", [&jpeg[..2], &segment, &jpeg[2..]].concat(), "an ICC profile that is damaged"),
        ("a.png", [&png[..33], &chunk, &png[33..]].concat(), "gAMA of its colors that is damaged"),
    ] {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        check_refused(read_scene(&path, &options(FileReading::default())), &[name, word]);
    }
}

/// Radiance pictures lie in eight ways (Ward 2004); each is read upright.
#[test]
fn radiance_pictures_are_turned_upright() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.hdr");
    // As it is seen, 3 columns and 2 rows.
    let seen = [[10_u8, 20, 30], [40, 50, 60]];
    let read = |axes: &str, codes: &[u8]| {
        let pixels: Vec<u8> = codes.iter().flat_map(|&v| [v, v, v, 128]).collect();
        fs::write(&path, [b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n", axes.as_bytes(), b"\n", &pixels].concat())
            .unwrap();
        let scene = read_scene(&path, &options(FileReading::default())).unwrap();
        assert_eq!(scene.notes.iter().any(|note| note.contains("turned upright")), axes != "-Y 2 +X 3", "{axes}");
        scene.radiance.planes()[15].clone()
    };
    let upright = read("-Y 2 +X 3", &seen.concat());
    for (down, right) in [("-Y", "+X"), ("+Y", "+X"), ("-Y", "-X"), ("+Y", "-X")] {
        let row = |i: usize| if down == "-Y" { i } else { 1 - i };
        let column = |j: usize| if right == "+X" { j } else { 2 - j };
        let by_rows: Vec<u8> = (0..6).map(|k| seen[row(k / 3)][column(k % 3)]).collect();
        assert_eq!(read(&format!("{down} 2 {right} 3"), &by_rows), upright, "{down} {right}");
        let by_columns: Vec<u8> = (0..6).map(|k| seen[row(k % 2)][column(k / 2)]).collect();
        assert_eq!(read(&format!("{right} 3 {down} 2"), &by_columns), upright, "{right} {down}");
    }
}

/// X, Y and Z of 1, 2 and 3 times the white of D65 are gray.
#[test]
fn radiance_pictures_of_xyz_are_those_of_rgb() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.hdr");
    let read = |head: &str, pixels: &[u8]| {
        fs::write(&path, [head.as_bytes(), b"\n-Y 1 +X 2\n", pixels].concat()).unwrap();
        read_scene(&path, &options(FileReading::default()))
    };
    let rgb = read("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n", &[128, 128, 128, 129, 64, 64, 64, 129]).unwrap();
    // 0.9505, 1 and 1.089 in steps of 1/128: 122, 128 and 139 of 256 / 2.
    let head = "#?RADIANCE\nEXPOSURE=1\nFORMAT=32-bit_rle_xyze\n";
    let xyz = read(head, &[122, 128, 139, 129, 61, 64, 70, 129]).unwrap();
    check_noted(&xyz, &["its X, Y and Z become red, green and blue"]);
    for column in 0..2 {
        let (own, expected) = (xyz.radiance.spectrum_at(0, column), rgb.radiance.spectrum_at(0, column));
        for (own, expected) in own.iter().zip(&expected) {
            assert!((own - expected).abs() < 0.02 * expected + 1e-6, "{own} for {expected}");
        }
    }
    let corrected = read(&format!("{head}COLORCORR=1 2 3\n"), &[0; 8]);
    check_refused(corrected, &["COLORCORR is of X, Y and Z"]);
}

/// The list of wavelengths is that of the cube's group, or of its name, or known to be none of these.
#[test]
fn lists_belong_to_the_cube_that_is_near() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    let cube = || npy("<f4", false, "(2, 3, 2)", &floats(&[0.5; 12]));
    let list = |nm: [f32; 2]| npy("<f4", false, "(2,)", &floats(&nm));
    let (near, far) = ([450.0, 550.0], [900.0, 1000.0]);
    let read = |arrays: &[(&str, Option<[f32; 2]>)], told: &str| {
        let arrays: Vec<(&str, Vec<u8>)> =
            arrays.iter().map(|(name, own)| (*name, own.map_or_else(cube, list))).collect();
        fs::write(&path, zip_of(&arrays, false)).unwrap();
        let reading = FileReading {
            variable: Some(told.to_owned()),
            quantity: Some(FileQuantity::Radiance),
            axes: Some("yxb".to_owned()),
            ..FileReading::default()
        };
        read_scene(&path, &options(reading))
    };
    for (arrays, told, expected) in [
        (
            [("swir", None), ("swir_wavelengths", Some(far)), ("vnir", None), ("vnir_wavelengths", Some(near))],
            "swir",
            far,
        ),
        (
            [("swir", None), ("swir_wavelengths", Some(far)), ("vnir", None), ("vnir_wavelengths", Some(near))],
            "vnir",
            near,
        ),
        (
            [("a/cube", None), ("a/wavelength", Some(near)), ("b/cube", None), ("b/wavelength", Some(far))],
            "b/cube",
            far,
        ),
        (
            [("cube", None), ("wavelength", Some(near)), ("cube_raw", None), ("wavelength_raw", Some(far))],
            "cube_raw",
            far,
        ),
        ([("cube", None), ("wavelength", Some(near)), ("cube_raw", None), ("wavelength_raw", Some(far))], "cube", near),
        ([("cube", None), ("wavelength", Some(near)), ("other", None), ("wavelengths_nm", Some(near))], "other", near),
    ] {
        let scene = read(&arrays, told).unwrap();
        assert_eq!(scene.radiance.grid().centers_nm(), expected.map(f64::from), "{told} of {arrays:?}");
    }
    let twice = [("cube", None), ("wavelength", Some(near)), ("wavelengths", Some(far))];
    check_refused(read(&twice, "cube"), &["'wavelength' and 'wavelengths' differ", "--scene-wavelengths-nm"]);
    // Single letters tell lists from each other, and are no units.
    for (first, second) in [("wavelength_a", "wavelength_b"), ("wavelength_m", "wavelength_n")] {
        let twice = [("cube", None), (first, Some(far)), (second, Some(near))];
        check_refused(read(&twice, "cube"), &["differ", "--scene-wavelengths-nm"]);
    }
}

/// The only scale of the axis of bands has its wavelengths, whatever it is called and wherever it lies.
#[test]
fn scales_of_axes_have_their_wavelengths() {
    use hdf5_pure::{AttrValue, FileBuilder};
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.h5");
    // A scale, its unit, a list beside the cube, and the axes that are told.
    let read = |scale: &str, unit: &str, numbers: &[f64], list: Option<&str>, axes: Option<&str>, is_attached: bool| {
        let mut file = FileBuilder::new();
        let mut group = file.create_group("g");
        group
            .create_dataset("cube")
            .with_data(&[0.5; 24])
            .with_shape(&[2, 3, 4])
            .set_attr("DIMENSION_LIST", AttrValue::I32(0));
        if let Some(list) = list {
            group.create_dataset(list).with_data(&[900.0, 1000.0, 1100.0, 1200.0]).with_shape(&[4]);
        }
        file.add_group(group.finish());
        let own = file.create_dataset(scale).with_data(numbers).with_shape(&[4]);
        own.set_attr("CLASS", AttrValue::AsciiString("DIMENSION_SCALE".to_owned()));
        own.set_attr("units", AttrValue::AsciiString(unit.to_owned()));
        if is_attached {
            own.set_attr("REFERENCE_LIST", AttrValue::I32(0));
        }
        fs::write(&path, file.finish().unwrap()).unwrap();
        let quantity = Some(FileQuantity::Radiance);
        let reading = FileReading { quantity, axes: axes.map(str::to_owned), ..FileReading::default() };
        read_scene(&path, &options(reading))
    };
    let (nm, um) = ([450.0, 500.0, 560.0, 620.0], [0.45, 0.5, 0.56, 0.62]);
    for (scale, unit, numbers, list, axes) in [
        ("good_wavelength", "nm", nm, Some("wavelength"), Some("yxb")),
        ("wl_true", "nm", nm, Some("wavelength"), None),
        ("centers", "um", um, Some("wavelength"), Some("yxb")),
        ("centers", "um", um, None, Some("yxb")),
        ("wavelength", "nm", nm, Some("wavelength"), None),
    ] {
        for is_attached in [true, false] {
            let scene = read(scale, unit, &numbers, list, axes, is_attached).unwrap();
            assert_eq!(scene.radiance.grid().centers_nm(), nm, "{scale} {axes:?}");
            if let Some(list) = list {
                check_noted(&scene, &[&format!("'g/{list}' is not used")]);
            }
        }
    }
    // A scale of numbers that are no wavelengths is none.
    for (scale, unit, numbers) in [("band", "", [1.0, 2.0, 3.0, 4.0]), ("t", "s", [450.0, 500.0, 560.0, 620.0])] {
        let scene = read(scale, unit, &numbers, Some("wavelength"), Some("yxb"), true).unwrap();
        assert_eq!(scene.radiance.grid().centers_nm(), [900.0, 1000.0, 1100.0, 1200.0], "{scale}");
    }
    // Where nothing says which axis is that of bands.
    check_refused(read("centers", "um", &um, None, None, true), &["--scene-wavelengths-nm"]);
}

/// An array or a unit that says something else than is asked for is named.
#[test]
fn names_and_units_of_another_quantity_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    let read = |name: &str, quantity: FileQuantity| {
        let arrays = [
            (name, npy("<f4", false, "(2, 3, 2)", &floats(&[0.5; 12]))),
            ("wave", npy("<f4", false, "(2,)", &floats(&[450.0, 550.0]))),
        ];
        fs::write(&path, zip_of(&arrays, false)).unwrap();
        let reading = FileReading { quantity: Some(quantity), axes: Some("yxb".to_owned()), ..FileReading::default() };
        read_scene(&path, &options(reading)).unwrap()
    };
    check_noted(&read("reflectance", FileQuantity::Radiance), &["'reflectance' is taken for light"]);
    check_noted(&read("raw_radiance", FileQuantity::Reflectance), &["'raw_radiance' is taken for reflectance"]);
    for (name, quantity) in [
        ("reflectance", FileQuantity::Reflectance),
        ("radiance", FileQuantity::Photons),
        ("cube", FileQuantity::Radiance),
    ] {
        assert!(!read(name, quantity).notes.iter().any(|note| note.contains("is taken for")), "{name}");
    }
    let header = folder.path().join("b.hdr");
    fs::write(header.with_extension("raw"), floats(&[0.5; 12])).unwrap();
    for (unit, quantity, is_named) in [
        ("DN", FileQuantity::Radiance, true),
        ("unitless", FileQuantity::Photons, true),
        ("DN", FileQuantity::Reflectance, false),
        ("none", FileQuantity::Reflectance, false),
    ] {
        let text = format!(
            "ENVI\nsamples = 3\nlines = 2\nbands = 2\ndata type = 4\ninterleave = bsq\nbyte order = 0\nwavelength = {{450, 550}}\ndata units = {unit}\n"
        );
        fs::write(&header, text).unwrap();
        let scene =
            read_scene(&header, &options(FileReading { quantity: Some(quantity), ..FileReading::default() })).unwrap();
        assert_eq!(scene.notes.iter().any(|note| note.contains(unit)), is_named, "{unit}: {:?}", scene.notes);
    }
}

/// A file of an editor beside a picture is named.
#[test]
fn side_cars_of_editors_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    dioptric_pictures::save(&image::GrayImage::from_pixel(4, 3, image::Luma([99])).into(), &path).unwrap();
    for name in ["a.xmp", "a.png.xmp"] {
        fs::write(folder.path().join(name), "<x/>").unwrap();
        let scene = read_scene(&path, &options(FileReading::default())).unwrap();
        check_noted(&scene, &[&format!("its side-car '{name}' is not used")]);
        fs::remove_file(folder.path().join(name)).unwrap();
    }
}

/// Layers of other bands are one cube unless one of them is asked for.
#[test]
fn a_layer_of_bands_that_is_asked_for_is_all() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let channels = [("vnir.S0.450nm", 1.0), ("vnir.S0.550nm", 1.0), ("swir.S0.900nm", 1.0), ("swir.S0.950nm", 1.0)];
    write_exr(&path, &[("", (ROWS, COLUMNS), &channels)]);
    let read = |told: Option<&str>| {
        let scene =
            read_scene(&path, &options(FileReading { variable: told.map(str::to_owned), ..FileReading::default() }));
        let scene = scene.unwrap();
        (scene.radiance.grid().len(), scene.notes.iter().any(|note| note.contains("are taken for one cube")))
    };
    assert_eq!([read(None), read(Some("vnir")), read(Some("swir"))], [(4, true), (2, false), (2, false)]);
}

/// A mask beside a picture, as GDAL writes it, is named.
#[test]
fn masks_of_tiff_files_are_named() {
    use tiff::{
        encoder::{
            TiffEncoder,
            colortype::{Gray8, RGB8},
        },
        tags::Tag,
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let mut encoder = TiffEncoder::new(fs::File::create(&path).unwrap()).unwrap();
    encoder.write_image::<RGB8>(3, 2, &[99; 18]).unwrap();
    let mut mask = encoder.new_image::<Gray8>(3, 2).unwrap();
    mask.encoder().write_tag(Tag::NewSubfileType, 4_u32).unwrap();
    mask.encoder().write_tag(Tag::PhotometricInterpretation, 4_u16).unwrap();
    mask.write_data(&[255; 6]).unwrap();
    drop(encoder);
    check_noted(&read_scene(&path, &options(FileReading::default())).unwrap(), &["its page '2 (a mask)' is not used"]);
}

/// tifffile's description in JSON states the unit of numbers and of wavelengths.
#[test]
fn units_of_tifffile_are_obeyed() {
    use tiff::{
        encoder::{TiffEncoder, colortype::Gray32Float},
        tags::Tag,
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let write = |description: &str| {
        let mut encoder = TiffEncoder::new(fs::File::create(&path).unwrap()).unwrap();
        for _ in 0..2 {
            let mut page = encoder.new_image::<Gray32Float>(3, 2).unwrap();
            page.encoder().write_tag(Tag::ImageDescription, description).unwrap();
            page.write_data(&[2.0; 6]).unwrap();
        }
    };
    let read = |description: &str| {
        write(description);
        let reading = FileReading { quantity: Some(FileQuantity::Radiance), ..FileReading::default() };
        read_scene(&path, &options(reading)).unwrap()
    };
    let micrometres = read(r#"{"shape": [2, 2, 3], "wavelengths": [450, 550], "unit": "W/m2/sr/um"}"#);
    let found = micrometres.radiance.spectrum_at(0, 0);
    assert!(found.iter().all(|v| (v - 2e-3).abs() < 1e-9), "{found:?}");
    let angstroms = read(r#"{"shape": [2, 2, 3], "wavelengths": [4500, 5500], "unit": "angstrom"}"#);
    assert_eq!(angstroms.radiance.grid().centers_nm(), [450.0, 550.0]);
    let other = read(r#"{"shape": [2, 2, 3], "wavelengths": [450, 550], "unit": "zorp", "mode": "x", "min": 0}"#);
    check_noted(&other, &["'min', 'mode', 'unit'"]);
    write(r#"{"shape": [2, 2, 3], "unit": "mm"}"#);
    let depth = with_depth("d.tif", &fs::read(&path).unwrap(), None).unwrap().depth.unwrap();
    assert!((depth.range_m().0 - 0.002).abs() < 1e-9);
}
