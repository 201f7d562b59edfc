//! Files as `tifffile`, `OpenImageIO`, `h5py`, `SciPy` and cameras write them: what they state twice, in a part that is rarely looked at, or in a kind that is
//! not read.

use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
};

use flate2::{Compression, Crc, write::ZlibEncoder};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tiff::{
    encoder::{TiffEncoder, colortype},
    tags::Tag,
};

use super::{
    FileQuantity, FileReading, ReadOptions,
    kinds_tests::{folder_and, npy_of, told, waves_npy, zip_of},
    mat::fixtures::mat_file,
    npy::tests::npy,
    read_picture_samples, read_scene,
    word_tests::{alone, n_cases, word},
};
use crate::{Scene, SceneError};

const PAGE_NAME: Tag = Tag::Unknown(285);

#[track_caller]
fn check_refused(read: Result<Scene, SceneError>, words: &[&str]) {
    let message = read.expect_err("a refusal").to_string();
    assert!(words.iter().all(|word| message.contains(word)) && !message.contains('\n'), "{message}");
}

#[track_caller]
fn check_named(scene: &Scene, word: &str, n: usize) {
    assert_eq!(scene.notes.iter().filter(|note| note.contains(word)).count(), n, "{word}: {:?}", scene.notes);
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Writes pages of gray, each with its tags of text.
fn write_pages(path: &Path, pages: &[&[(Tag, String)]]) {
    let mut file = fs::File::create(path).unwrap();
    let mut encoder = TiffEncoder::new(&mut file).unwrap();
    for (number, tags) in pages.iter().enumerate() {
        let mut page = encoder.new_image::<colortype::Gray16>(3, 2).unwrap();
        for (tag, text) in *tags {
            page.encoder().write_tag(*tag, text.as_str()).unwrap();
        }
        page.write_data(&[10_000 * (number as u16 + 1); 6]).unwrap();
    }
}

#[test]
fn complex_numbers_are_refused_as_such() {
    let options = told(Some(FileQuantity::Reflectance), Some("yxb"), true);
    let (_a, array) = folder_and("a.npy");
    let numbers = npy("<c8", false, "(3, 4, 5)", &[0; 480]);
    fs::write(&array, &numbers).unwrap();
    check_refused(read_scene(&array, &options), &["a.npy", "complex numbers", "abs"]);
    let (_b, archive) = folder_and("a.npz");
    fs::write(&archive, zip_of(&[("cube", numbers)], false)).unwrap();
    check_refused(read_scene(&archive, &options), &["a.npz", "cube", "complex numbers"]);
    // The flag of complex numbers beside the class of doubles (MAT-File Format, table 1-3).
    let (_c, mat) = folder_and("a.mat");
    let mut cube = super::mat::fixtures::variable_of("cube", &[3, 4, 5], 6, &[0.0; 60]);
    cube[17] |= 0x08;
    fs::write(&mat, mat_file(&[cube])).unwrap();
    check_refused(read_scene(&mat, &options), &["a.mat", "'cube' has complex numbers"]);
}

#[test]
fn pages_and_descriptions_may_not_say_two_things() {
    let (_folder, path) = folder_and("a.tif");
    let name = |text: &str| (PAGE_NAME, text.to_owned());
    let list = |text: &str| (Tag::ImageDescription, text.to_owned());
    let read = || read_scene(&path, &ReadOptions::default());
    let json = r#"{"wavelengths": [450, 550], "gain": 2}"#;
    write_pages(&path, &[&[name("450 nm"), list(json)], &[name("550 nm")]]);
    let scene = read().unwrap();
    assert_eq!(scene.radiance.grid().centers_nm(), [450.0, 550.0]);
    check_named(&scene, "'gain'", 1);
    write_pages(&path, &[&[name("450 nm"), list(json)], &[name("560 nm")]]);
    check_refused(read(), &["a.tif", "named after other wavelengths than its description"]);
    write_pages(&path, &[&[list(json)], &[], &[]]);
    check_refused(read(), &["a.tif", "states 2 wavelengths, but has 3 planes"]);
    // Names that are no wavelengths, and a description of a later page.
    write_pages(&path, &[&[name("green"), list(json)], &[name("red")]]);
    check_named(&read().unwrap(), "'green', 'red'", 1);
    write_pages(&path, &[&[name("450 nm")], &[name("550 nm"), list("exposure 2")]]);
    check_named(&read().unwrap(), "'exposure 2'", 1);
    // What programs write by themselves is the shape of the array; what more they say is named.
    for (text, names) in [
        (r#"{"shape": [2, 3, 4], "axes": "CYX"}"#, ""),
        (r#"{"shape": [2, 3, 4], "axes": "CXY", "gain": 2.5}"#, "'axes', 'gain'"),
        ("ImageJ=1.53\nimages=2\nslices=2\nmin=0.0\nloop=false", ""),
        ("ImageJ=1.53\nimages=4\nchannels=2\nslices=2\nframes=1", "'channels', 'slices'"),
        ("ImageJ=1.53\nimages=2\ncf=0\nc0=-32768.0\nc1=1.0", "'cf', 'c0', 'c1'"),
    ] {
        write_pages(&path, &[&[name("450 nm"), list(text)], &[name("550 nm")]]);
        let scene = read().unwrap();
        assert_eq!(scene.notes.len(), 1 + usize::from(!names.is_empty()), "{:?}", scene.notes);
        assert!(scene.notes.iter().any(|note| note.contains(names)), "{:?}", scene.notes);
    }
}

#[test]
fn kinds_of_tiff_that_are_not_read_are_refused_by_their_names() {
    let (_folder, path) = folder_and("a.tif");
    let write = |tag: Tag, value: u16| {
        let mut file = fs::File::create(&path).unwrap();
        let mut encoder = TiffEncoder::new(&mut file).unwrap();
        let mut page = encoder.new_image::<colortype::RGB8>(3, 2).unwrap();
        page.encoder().write_tag(tag, value).unwrap();
        page.write_data(&[9; 18]).unwrap();
    };
    let kind = Tag::PhotometricInterpretation;
    let dng_version = Tag::Unknown(50_706);
    for (tag, value, words) in [
        (kind, 3, "palette"),
        (kind, 5, "inks (CMYK)"),
        (kind, 6, "YCbCr"),
        (kind, 8, "L*a*b*"),
        (kind, 32_803, "those of a sensor"),
        (dng_version, 1, "raw photograph"),
    ] {
        write(tag, value);
        let way = if value > 1000 || tag != kind { "`dioptric develop`" } else { "convert it to sRGB" };
        check_refused(read_scene(&path, &ReadOptions::default()), &["a.tif", words, way]);
    }
    let raw = path.with_extension("nef");
    fs::write(&raw, [0; 64]).unwrap();
    check_refused(read_scene(&raw, &ReadOptions::default()), &["a.nef", "raw photograph", "`dioptric develop`"]);
}

/// Samples of 32 bits and of floats of every size, which a decoder of pictures takes for others.
#[test]
fn samples_of_tiff_files_are_measured_or_refused() {
    let (_folder, path) = folder_and("a.tif");
    let of = |write: &dyn Fn(&mut TiffEncoder<&mut fs::File>)| {
        let mut file = fs::File::create(&path).unwrap();
        write(&mut TiffEncoder::new(&mut file).unwrap());
        drop(file);
        read_picture_samples(&path)
    };
    let halves: Vec<f32> = (1..=18).map(|v| v as f32 / 2.0).collect();
    let mut notes = vec![];
    let read = of(&|encoder| encoder.write_image::<colortype::RGB32Float>(3, 2, &halves).unwrap()).unwrap();
    let samples = read.told_in(&mut notes);
    assert_eq!((samples.planes[2].0.as_str(), samples.planes[2].1[(1, 1)], samples.top), ("B", 7.5, None));
    let doubles: Vec<f64> = halves.iter().take(6).map(|v| f64::from(*v)).collect();
    let read = of(&|encoder| encoder.write_image::<colortype::Gray64Float>(3, 2, &doubles).unwrap()).unwrap();
    assert_eq!(read.told_in(&mut notes).planes[0].1[(1, 0)], 2.0);
    assert_eq!(notes, Vec::<String>::new());
    let whole: Vec<u32> = (1..=18).map(|v| v << 24).collect();
    let message =
        of(&|encoder| encoder.write_image::<colortype::RGB32>(3, 2, &whole).unwrap()).unwrap_err().to_string();
    assert!(message.contains("a.tif") && message.contains("32 bits"), "{message}");
    // As a picture that a display shows, too.
    let grid = dioptric_spectrum::WavelengthGrid::uniform(400.0, 700.0, 100.0).unwrap();
    let shown = super::read_picture(&path, &dioptric_spectrum::Display::apple_studio(), &grid, 100.0);
    assert!(shown.unwrap_err().to_string().contains("whole numbers of 32 bits"));
}

/// A stack is one whatever its name says.
#[test]
fn stacks_of_other_names_are_stacks() {
    let (_folder, path) = folder_and("a.tif");
    let name = |text: &str| (PAGE_NAME, text.to_owned());
    write_pages(&path, &[&[name("450 nm")], &[name("550 nm")]]);
    let stack = read_scene(&path, &ReadOptions::default()).unwrap();
    for ending in ["png", "jpg", "ppm"] {
        let other = path.with_extension(ending);
        fs::copy(&path, &other).unwrap();
        assert_eq!(read_scene(&other, &ReadOptions::default()).unwrap().radiance, stack.radiance, "{ending}");
    }
}

/// Texts of PNG files are looked at whatever chunk they stand in, compressed or not.
#[test]
fn texts_of_pictures_are_looked_at_in_every_chunk() {
    let (_folder, path) = folder_and("a.png");
    dioptric_pictures::save(&image::GrayImage::from_pixel(3, 2, image::Luma([99])).into(), &path).unwrap();
    let plain = fs::read(&path).unwrap();
    let deflated = |text: &str| {
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
        encoder.write_all(text.as_bytes()).unwrap();
        encoder.finish().unwrap()
    };
    let read = |kind: &[u8; 4], content: Vec<u8>| {
        let content = [&kind[..], &content].concat();
        let mut checksum = Crc::new();
        checksum.update(&content);
        let chunk = [&(content.len() as u32 - 4).to_be_bytes()[..], &content, &checksum.sum().to_be_bytes()].concat();
        let mut bytes = plain.clone();
        bytes.splice(33..33, chunk);
        fs::write(&path, bytes).unwrap();
        read_scene(&path, &ReadOptions::default()).unwrap()
    };
    alone(|| {
        let mut rng = ChaCha8Rng::seed_from_u64(31);
        for _ in 0..n_cases() {
            let scale = rng.random_range(2..99_999);
            let text = format!("depth scale {scale}");
            let word = word(&mut rng);
            for key in ["Comment", &word] {
                let told = if key == "Comment" { text.clone() } else { format!("text '{word}'") };
                let key = key.as_bytes();
                check_named(&read(b"tEXt", [key, b"\0", text.as_bytes()].concat()), &told, 1);
                check_named(&read(b"zTXt", [key, b"\0\0", &deflated(&text)].concat()), &told, 1);
                check_named(&read(b"iTXt", [key, b"\0\0\0en\0k\0", text.as_bytes()].concat()), &told, 1);
                check_named(&read(b"iTXt", [key, b"\0\x01\0en\0k\0", &deflated(&text)].concat()), &told, 1);
            }
        }
    });
    // What says nothing of the numbers is left alone, and what is broken.
    for content in [&b"Comment\0\0hello"[..], b"Comment\0\x01\0\0\0xx", b"Comment", b"Comment\0\x01"] {
        check_named(&read(b"iTXt", content.to_vec()), "comment", 0);
    }
}

#[test]
fn the_largest_half_float_is_no_depth() {
    let (folder, picture) = folder_and("room.png");
    dioptric_pictures::save(&image::GrayImage::from_pixel(3, 2, image::Luma([99])).into(), &picture).unwrap();
    let depth = |name: &str, bytes: Vec<u8>, fill: Option<&str>| {
        let file: PathBuf = folder.path().join(name);
        fs::write(&file, bytes).unwrap();
        let reading = FileReading { depth: Some(file), ..FileReading::default() };
        let fill_depth = fill.map(|fill| fill.parse().unwrap());
        read_scene(
            &picture,
            &ReadOptions { horizontal_fov_deg: Some(20.0), fill_depth, reading, ..ReadOptions::default() },
        )
    };
    let z_m = floats(&[2.0, 65_504.0, 3.0, 2.0, 2.5, 2.0]);
    let z_m = || npy("<f4", false, "(2, 3)", &z_m);
    check_refused(depth("a.npy", z_m(), None), &["a.npy", "row 0, column 1 was not measured", "1 of 6"]);
    let filled = depth("a.npy", z_m(), Some("7")).unwrap();
    assert_eq!(filled.require_depth().unwrap().z_m()[(0, 1)], 7.0);
    // Of whole numbers it is one as any other.
    let codes: Vec<u8> =
        [2000_u16, 65_504, 3000, 2000, 2500, 2000].iter().flat_map(|code| code.to_le_bytes()).collect();
    let scene = depth("b.npy", npy("<u2", false, "(2, 3)", &codes), None).unwrap();
    assert_eq!(scene.require_depth().unwrap().range_m(), (2.0, f64::from(65.504_f32)));
}

#[test]
fn what_counts_for_both_layers_is_said() {
    let (folder, front) = folder_and("front.npy");
    let at = |name: &str| folder.path().join(name);
    for (name, z_m) in [("front", 2.0), ("behind", 3.0)] {
        fs::write(at(&format!("{name}.npy")), npy_of("<f4", "yxb")).unwrap();
        fs::write(at(&format!("{name}.depth.npy")), npy("<f4", false, "(3, 4)", &floats(&[z_m; 12]))).unwrap();
    }
    let mut options = told(Some(FileQuantity::Reflectance), Some("yxb"), true);
    (options.hidden, options.horizontal_fov_deg) = (Some(at("behind.npy")), Some(20.0));
    let scene = read_scene(&front, &options).unwrap();
    let told = "what was said of the first surface (--quantity, --white-level, --scene-wavelengths-nm, --axes)";
    let note = &format!("behind.npy: {told} counts for it too");
    check_named(&scene, note, 1);
    let [front, behind] = [&scene.radiance, &scene.hidden.as_ref().unwrap().radiance];
    assert_eq!(front.planes()[2], behind.planes()[2]);
    // A file that says itself what it is needs none of it.
    let planes = [0.5, 0.5, 3.0].map(|v| ndarray::Array2::from_elem((3, 4), v));
    let channels = [("S0.450,0nm", &planes[0]), ("S0.650,0nm", &planes[1]), ("Z", &planes[2])];
    crate::write_planes_exr(&at("behind.exr"), &channels, crate::ExrSamples::Single).unwrap();
    options.hidden = Some(at("behind.exr"));
    let scene = read_scene(&at("front.npy"), &options).unwrap();
    check_named(&scene, &format!("behind.exr: {told} does not count for it"), 1);
    assert_eq!(scene.hidden.unwrap().radiance.planes()[2][(1, 1)], 0.5);
}

/// That numbers are radiance says nothing of their unit: that of gains is ENVI's, whoever says so.
#[test]
fn gains_have_their_unit_whatever_the_quantity() {
    let (_folder, path) = folder_and("a.hdr");
    fs::write(path.with_extension("raw"), floats(&[2.0; 4])).unwrap();
    let header = "ENVI\nsamples = 2\nlines = 1\nbands = 2\ndata type = 4\ninterleave = bip\nbyte order = 0\n\
                  wavelength = {500, 600}\ndata gain values = {3, 3}\n";
    fs::write(&path, header).unwrap();
    for quantity in [None, Some(FileQuantity::Radiance)] {
        let reading = FileReading { quantity, ..FileReading::default() };
        let scene = read_scene(&path, &ReadOptions { reading, ..ReadOptions::default() }).unwrap();
        assert_eq!(scene.radiance.planes()[1][(0, 1)], 0.006, "{quantity:?}");
        check_named(&scene, "W/m^2/sr/um by its gains", 1);
    }
}

/// Keys of a description, attributes of arrays and files, names of arrays: what nobody knows is named.
#[test]
fn unknown_words_of_stacks_and_attributes_are_named() {
    alone(|| {
        let mut rng = ChaCha8Rng::seed_from_u64(32);
        let (_a, stack) = folder_and("a.tif");
        let (_b, h5) = folder_and("a.h5");
        let (_c, npz) = folder_and("a.npz");
        let options = told(Some(FileQuantity::Reflectance), Some("yxb"), false);
        for case in 0..n_cases() {
            let word = word(&mut rng);
            let key =
                format!(r#"{{"wavelengths_nm": [450, 550], "{word}": {}}}"#, ["1", "[1]", "\"a\"", "{}"][case % 4]);
            let text = if case % 2 == 0 { key } else { word.clone() };
            let names = [450, 550].map(|nm| (PAGE_NAME, format!("{nm} nm")));
            let described = (Tag::ImageDescription, text);
            write_pages(&stack, &[&[names[0].clone(), described], &[names[1].clone()]]);
            check_named(&read_scene(&stack, &ReadOptions::default()).unwrap(), &word, 1);
            let mut file = hdf5_pure::FileBuilder::new();
            let cube = file.create_dataset("cube");
            cube.with_data(&super::kinds_tests::in_order("yxb")).with_shape(&[3, 4, 5]);
            if case % 3 == 0 {
                cube.set_attr(&word, hdf5_pure::AttrValue::F64(2.0));
            }
            file.create_dataset("wave").with_data(&super::kinds_tests::WAVE_NM).with_shape(&[5]);
            if case % 3 == 1 {
                file.set_attr(&word, hdf5_pure::AttrValue::F64(2.0));
            }
            if case % 3 == 2 {
                let mut group = file.create_group("of");
                group.set_attr(&word, hdf5_pure::AttrValue::F64(2.0));
                file.add_group(group.finish());
            }
            fs::write(&h5, file.finish().unwrap()).unwrap();
            check_named(&read_scene(&h5, &options).unwrap(), &word, 1);
            let text = npy("<U2", false, "(1,)", &[97, 0, 0, 0, 98, 0, 0, 0]);
            fs::write(
                &npz,
                zip_of(&[("cube", npy_of("<f4", "yxb")), ("wave", waves_npy()), (&word, text)], case % 2 == 0),
            )
            .unwrap();
            check_named(&read_scene(&npz, &options).unwrap(), &word, 1);
        }
    });
}
