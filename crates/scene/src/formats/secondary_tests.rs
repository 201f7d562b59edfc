//! What files beside a scene's state, and parts of its own file that are not its picture, is used or named as what the picture states is.

use std::{
    fs,
    path::{Path, PathBuf},
};

use exr::{
    image::Layers,
    prelude::{
        AnyChannel, AnyChannels, AttributeValue, Encoding, FlatSamples, Image, Layer, LayerAttributes, Text,
        WritableImage,
    },
};
use flate2::Crc;
use ndarray::Array2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tiff::{
    encoder::{TiffEncoder, colortype},
    tags::{ExtraSamples, Tag},
};

use super::{
    FileQuantity, FileReading, ReadOptions,
    contents::Image as Samples,
    kinds_tests::{folder_and, npy_of, told, waves_npy, zip_of},
    npy::tests::npy,
    read_contents::contents_of,
    read_scene,
    word_tests::{alone, n_cases, word},
};
use crate::Scene;

const ROWS: usize = 3;
const COLUMNS: usize = 4;

fn picture(folder: &Path) -> PathBuf {
    let path = folder.join("room.png");
    let pixels = image::RgbImage::from_pixel(COLUMNS as u32, ROWS as u32, image::Rgb([99; 3]));
    dioptric_pictures::save(&pixels.into(), &path).unwrap();
    path
}

#[track_caller]
fn check_named(scene: &Scene, word: &str) {
    let n = scene.notes.iter().filter(|note| note.contains(word)).count();
    assert_eq!(n, 1, "{word}: {:?}", scene.notes);
}

fn quoted(word: &str) -> String {
    format!("'{word}'")
}

/// A layer of an EXR file, one of whose attributes has this name.
fn layer(name: &str, attribute: &str, channels: &[(&str, f32)]) -> Layer<AnyChannels<FlatSamples>> {
    let plane = |v: f32| FlatSamples::F32(vec![v; ROWS * COLUMNS]);
    let channels = channels.iter().map(|(name, v)| AnyChannel::new(*name, plane(*v))).collect();
    let mut attributes = LayerAttributes::named(name);
    attributes.other.insert(Text::from(attribute), AttributeValue::Text(Text::from("mm")));
    Layer::new((COLUMNS, ROWS), attributes, Encoding::FAST_LOSSLESS, AnyChannels::sort(channels))
}

fn write_exr(path: &Path, layers: Vec<Layer<AnyChannels<FlatSamples>>>) {
    let layers: Layers<AnyChannels<FlatSamples>> = layers.into_iter().collect();
    let window = exr::meta::attribute::IntegerBounds::from_dimensions((COLUMNS, ROWS));
    Image::from_layers(exr::meta::header::ImageAttributes::new(window), layers).write().to_file(path).unwrap();
}

fn options(hidden: Option<PathBuf>, depth: Option<PathBuf>) -> ReadOptions {
    let reading = FileReading { depth, ..FileReading::default() };
    ReadOptions { horizontal_fov_deg: Some(20.0), hidden, reading, ..ReadOptions::default() }
}

#[test]
fn unknown_words_of_depths_and_hidden_layers_are_named() {
    alone(|| {
        let mut rng = ChaCha8Rng::seed_from_u64(21);
        let folder = tempfile::tempdir().unwrap();
        let picture = picture(folder.path());
        let at = |name: &str| folder.path().join(name);
        let bands = [("S0.450,0nm", 0.1), ("S0.550,0nm", 0.1), ("Z", 2.0)];
        let behind = [("S0.450,0nm", 0.2), ("S0.550,0nm", 0.2), ("Z", 3.0)];
        for _ in 0..n_cases() {
            let [word, other] = [word(&mut rng), word(&mut rng)];
            // An attribute of a file of depth.
            write_exr(&at("z.exr"), vec![layer("", &word, &[("Z", 2.0)])]);
            let scene = read_scene(&picture, &options(None, Some(at("z.exr")))).unwrap();
            check_named(&scene, &quoted(&word));
            // Attributes and channels of a layer behind, in the file and in one of its own.
            let more = [&behind[..], &[(other.as_str(), 1.0)]].concat();
            write_exr(&at("a.exr"), vec![layer("", "Time", &bands), layer("hidden", &word, &more)]);
            let scene = read_scene(&at("a.exr"), &options(None, None)).unwrap();
            check_named(&scene, &quoted(&word));
            check_named(&scene, &quoted(&other));
            write_exr(&at("front.exr"), vec![layer("", "Time", &bands)]);
            write_exr(&at("behind.exr"), vec![layer("", &word, &more)]);
            let scene = read_scene(&at("front.exr"), &options(Some(at("behind.exr")), None)).unwrap();
            check_named(&scene, &quoted(&word));
            check_named(&scene, &quoted(&other));
            let hidden = scene.hidden.unwrap();
            assert_eq!(hidden.depth.range_m(), (3.0, 3.0));
            assert_eq!(hidden.radiance.planes()[0][(1, 1)], 0.2);
        }
    });
}

/// Puts a text before the end of a PNG file.
fn with_text(png: &[u8], key: &str) -> Vec<u8> {
    let (head, end) = png.split_at(png.len() - 12);
    let content = [b"tEXt".to_vec(), key.as_bytes().to_vec(), b"\0 20".to_vec()].concat();
    let mut checksum = Crc::new();
    checksum.update(&content);
    [head, &(content.len() as u32 - 4).to_be_bytes(), &content, &checksum.sum().to_be_bytes(), end].concat()
}

/// A key of text, a tag or a page of one band or of each is named, and once.
#[test]
fn unknown_words_of_band_pictures_are_named() {
    alone(|| {
        let mut rng = ChaCha8Rng::seed_from_u64(22);
        let folder = tempfile::tempdir().unwrap();
        let at = |nm: u32, ending: &str| folder.path().join(format!("a_{nm}.{ending}"));
        let clear =
            || fs::read_dir(folder.path()).unwrap().for_each(|entry| fs::remove_file(entry.unwrap().path()).unwrap());
        let plane = image::ImageBuffer::from_pixel(COLUMNS as u32, ROWS as u32, image::Luma([30_000_u16]));
        dioptric_pictures::save(&plane.into(), &at(450, "png")).unwrap();
        let plain = fs::read(at(450, "png")).unwrap();
        for case in 0..n_cases() {
            let word = word(&mut rng);
            let n_words = 1 + case % 3;
            for (index, nm) in [450, 550, 650].into_iter().enumerate() {
                let bytes = if index < n_words { with_text(&plain, &word) } else { plain.clone() };
                fs::write(at(nm, "png"), bytes).unwrap();
            }
            let scene = read_scene(folder.path(), &ReadOptions::default()).unwrap();
            check_named(&scene, &quoted(&word));
        }
        clear();
        for case in 0..n_cases() {
            let (tag, word) = (rng.random_range(50_000..60_000_u16), word(&mut rng));
            for nm in [450, 550, 650] {
                let mut encoder = TiffEncoder::new(fs::File::create(at(nm, "tif")).unwrap()).unwrap();
                for page in 0..1 + case % 2 {
                    let mut image = encoder.new_image::<colortype::Gray16>(COLUMNS as u32, ROWS as u32).unwrap();
                    if page == 0 {
                        image.encoder().write_tag(Tag::Unknown(tag), 7_u16).unwrap();
                        image.encoder().write_tag(Tag::ImageDescription, word.as_str()).unwrap();
                    }
                    image.write_data(&[1000 * (1 + page as u16); ROWS * COLUMNS]).unwrap();
                }
            }
            let found = read_scene(folder.path(), &ReadOptions::default());
            if case % 2 == 1 {
                // Which of two pages is the band nobody says.
                let message = found.unwrap_err().to_string();
                assert!(message.contains("2 planes"), "{message}");
            } else {
                let scene = found.unwrap();
                check_named(&scene, &quoted(&tag.to_string()));
                check_named(&scene, &quoted(&word));
            }
        }
    });
}

#[test]
fn texts_and_dates_beside_a_cube_are_named() {
    let (_folder, file) = folder_and("a.npz");
    let options = told(Some(FileQuantity::Reflectance), Some("yxb"), false);
    let text = npy("<U2", false, "()", &[0; 8]);
    let date = npy("<M8[s]", false, "(1,)", &[0; 8]);
    let parts = [("cube", npy_of("<f4", "yxb")), ("wave", waves_npy()), ("unit", text), ("when", date)];
    fs::write(&file, zip_of(&parts, false)).unwrap();
    check_named(&read_scene(&file, &options).unwrap(), "'unit', 'when'");
    // Another array behind the first, as two calls of `save` leave it.
    let (_folder, file) = folder_and("a.npy");
    fs::write(&file, [npy_of("<f4", "yxb"), npy_of("<f4", "yxb")].concat()).unwrap();
    let options = told(Some(FileQuantity::Reflectance), Some("yxb"), true);
    check_named(&read_scene(&file, &options).unwrap(), "bytes behind its array");
}

/// Writes codes of four samples a pixel, of which the last is marked so.
fn write_four<C: colortype::ColorType<Inner = T>, T>(path: &Path, last: ExtraSamples, values: &[T])
where
    [T]: tiff::encoder::TiffValue,
{
    let mut encoder = TiffEncoder::new(fs::File::create(path).unwrap()).unwrap();
    let mut image = encoder.new_image::<C>(COLUMNS as u32, ROWS as u32).unwrap();
    image.extra_samples(&[last]).unwrap();
    image.write_data(values).unwrap();
}

/// Red, green, blue and a near infrared: a picture whose fourth sample is named, or four bands where their wavelengths are told.
#[test]
fn four_samples_are_bands_where_wavelengths_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let codes: Vec<u16> = (0..ROWS * COLUMNS).flat_map(|i| [100, 200, 300, 400].map(|v| v + i as u16)).collect();
    let floats: Vec<f32> = codes.iter().map(|v| f32::from(*v) / 1000.0).collect();
    write_four::<colortype::RGB16, _>(&at("nir.tif"), ExtraSamples::Unspecified, &codes);
    write_four::<colortype::RGB16, _>(&at("alpha.tif"), ExtraSamples::UnassociatedAlpha, &codes);
    write_four::<colortype::RGB32Float, _>(&at("float.tif"), ExtraSamples::Unspecified, &floats);
    let as_cube = |nm: &[f64]| {
        let reading = FileReading {
            quantity: Some(FileQuantity::Reflectance),
            wavelengths_nm: Some(nm.to_vec()),
            ..FileReading::default()
        };
        ReadOptions { reading, ..ReadOptions::default() }
    };
    for (name, white) in [("nir.tif", 65535.0), ("alpha.tif", 65535.0), ("float.tif", 1000.0)] {
        let contents = contents_of(&at(name), &as_cube(&[650.0, 550.0, 450.0, 850.0])).unwrap();
        let Samples::Spectral(image) = contents.image else { panic!("{name}: no cube") };
        assert_eq!(image.grid().centers_nm(), [450.0, 550.0, 650.0, 850.0]);
        let expected = [300.0, 200.0, 100.0, 400.0].map(|code: f64| (code + 6.0) / white);
        for (value, expected) in image.spectrum_at(1, 2).into_iter().zip(expected) {
            assert!((value - expected).abs() < 1e-7, "{name}: {value} {expected}");
        }
        let scene = read_scene(&at(name), &ReadOptions::default()).unwrap();
        let word = if name == "alpha.tif" { "'opacity'" } else { "'sample 4 (ExtraSamples 0)'" };
        check_named(&scene, word);
    }
    // Without the opacity there are three.
    let contents = contents_of(&at("alpha.tif"), &as_cube(&[650.0, 550.0, 450.0])).unwrap();
    assert!(contents.notes.iter().any(|note| note.contains("opacity")), "{:?}", contents.notes);
    assert!(contents_of(&at("nir.tif"), &as_cube(&[650.0, 550.0, 450.0])).is_err());
}

/// A depth with a confidence beside it, as a sample or as a page, is asked for by its number.
#[test]
fn one_of_several_planes_of_depth_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let picture = picture(folder.path());
    let file = folder.path().join("d.tif");
    let mut encoder = TiffEncoder::new(fs::File::create(&file).unwrap()).unwrap();
    let mut image = encoder.new_image::<colortype::Gray16>(COLUMNS as u32, ROWS as u32).unwrap();
    image.extra_samples(&[ExtraSamples::Unspecified]).unwrap();
    image.write_data(&[2000_u16, 99].repeat(ROWS * COLUMNS)).unwrap();
    drop(encoder);
    let with = |number: Option<&str>| {
        let mut options = options(None, Some(file.clone()));
        options.reading.depth_variable = number.map(str::to_owned);
        read_scene(&picture, &options)
    };
    let message = with(None).unwrap_err().to_string();
    assert!(message.contains("2 planes") && message.contains("--depth-variable, 1 to 2"), "{message}");
    let scene = with(Some("1")).unwrap();
    assert_eq!(scene.require_depth().unwrap().range_m(), (2.0, 2.0));
    check_named(&scene, "its plane '2' is not used");
    assert!(with(Some("3")).is_err() && with(Some("z")).is_err());
}

/// Two gray samples whose wavelengths a description lists are bands, as they stand whatever the mark says of white.
#[test]
fn two_gray_samples_are_bands() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.tif");
    let mut encoder = TiffEncoder::new(fs::File::create(&file).unwrap()).unwrap();
    let mut image = encoder.new_image::<colortype::Gray8>(COLUMNS as u32, ROWS as u32).unwrap();
    image.extra_samples(&[ExtraSamples::Unspecified]).unwrap();
    image.encoder().write_tag(Tag::PhotometricInterpretation, 0_u16).unwrap();
    image.encoder().write_tag(Tag::ImageDescription, r#"{"wavelengths_nm": [550, 450]}"#).unwrap();
    image.write_data(&[200_u8, 99].repeat(ROWS * COLUMNS)).unwrap();
    drop(encoder);
    let scene = read_scene(&file, &told(Some(FileQuantity::Radiance), None, false)).unwrap();
    assert_eq!(scene.radiance.grid().centers_nm(), [450.0, 550.0]);
    assert_eq!([0, 1].map(|band: usize| scene.radiance.planes()[band][(1, 1)]), [99.0, 200.0]);
    check_named(&scene, "0 is white (tag 262) is not used");
}

/// Bands in which a display sends no light at all are no black scene.
#[test]
fn pictures_in_the_infrared_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let picture = picture(folder.path());
    let grid = Some(dioptric_spectrum::WavelengthGrid::new(vec![850.0, 900.0]).unwrap());
    let message = read_scene(&picture, &ReadOptions { grid, ..options(None, None) }).unwrap_err().to_string();
    assert!(message.contains("2 bands of 850–900 nm"), "{message}");
}

/// Bands of floats stay as they are; of 8 and of 16 bits one white is white.
#[test]
fn bands_of_several_kinds_have_one_white() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let save = |name: &str, code: u16| {
        let picture: image::DynamicImage = match code {
            0..=255 => image::GrayImage::from_pixel(4, 3, image::Luma([code as u8])).into(),
            _ => image::ImageBuffer::from_pixel(4, 3, image::Luma([code])).into(),
        };
        dioptric_pictures::save(&picture, &at(name)).unwrap();
    };
    save("a_450.png", 51);
    save("a_550.png", 13_107);
    let of = |options: &ReadOptions| contents_of(folder.path(), options).map(|contents| contents.image);
    let Ok(Samples::Spectral(image)) = of(&ReadOptions::default()) else { panic!("no cube") };
    for value in image.spectrum_at(0, 0) {
        assert!((value - 0.2).abs() < 1e-7, "{value}");
    }
    // The white level counts codes.
    let Ok(Samples::Spectral(image)) = of(&ReadOptions { white_level: Some(26_214.0), ..ReadOptions::default() })
    else {
        panic!("no cube")
    };
    assert!((image.spectrum_at(0, 0)[1] - 0.5).abs() < 1e-6);
    let floats = Array2::from_elem((3, 4), 3.5_f32);
    let mut encoder = TiffEncoder::new(fs::File::create(at("a_650.tif")).unwrap()).unwrap();
    encoder.write_image::<colortype::Gray32Float>(4, 3, floats.as_slice().unwrap()).unwrap();
    drop(encoder);
    assert!(of(&ReadOptions::default()).is_err_and(|error| error.to_string().contains("one kind")));
    fs::remove_file(at("a_450.png")).unwrap();
    fs::remove_file(at("a_550.png")).unwrap();
    let reading = FileReading { quantity: Some(FileQuantity::Radiance), ..FileReading::default() };
    let Ok(Samples::Spectral(image)) = of(&ReadOptions { reading, ..ReadOptions::default() }) else {
        panic!("no cube")
    };
    assert_eq!(image.spectrum_at(0, 0), [3.5]);
}

/// A TIFF file that begins with a thumbnail is read by its first page of full size, as a picture and as a depth.
#[test]
fn thumbnails_are_left() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, is_big: bool| {
        let path = folder.path().join(name);
        let file = fs::File::create(&path).unwrap();
        let full: Vec<u16> = (0..ROWS * COLUMNS).map(|i| 2000 + i as u16).collect();
        // A page of 1 × 2 samples before the picture and one of 2 × 1 behind it.
        macro_rules! write_pages {
            ($encoder:expr) => {{
                let mut encoder = $encoder;
                for (columns, rows, codes) in
                    [(1, 2, &[7; 2][..]), (COLUMNS as u32, ROWS as u32, &full), (2, 1, &[7; 2])]
                {
                    let mut image = encoder.new_image::<colortype::Gray16>(columns, rows).unwrap();
                    let is_reduced = u32::from(codes.len() == 2);
                    image.encoder().write_tag(Tag::NewSubfileType, is_reduced).unwrap();
                    image.write_data(codes).unwrap();
                }
            }};
        }
        if is_big {
            write_pages!(TiffEncoder::new_big(file).unwrap());
        } else {
            write_pages!(TiffEncoder::new(file).unwrap());
        }
        path
    };
    for is_big in [false, true] {
        let path = write("a.tif", is_big);
        let scene = read_scene(&path, &ReadOptions::default()).unwrap();
        assert_eq!((scene.rows(), scene.columns()), (ROWS, COLUMNS));
        check_named(&scene, "its pages '1 (reduced)', '3 (reduced)' are not used");
        assert_eq!(super::flat_size_of(&path, &FileReading::default()), Some((ROWS, COLUMNS)));
        let scene = read_scene(&picture(folder.path()), &options(None, Some(path))).unwrap();
        let (nearest, farthest) = scene.require_depth().unwrap().range_m();
        // Single floats.
        let expected = 2.0 + 0.001 * (ROWS * COLUMNS - 1) as f64;
        assert!(nearest == 2.0 && (farthest - expected).abs() < 1e-6, "{farthest} {expected}");
    }
}

/// Writes a gray picture with Exif data of one short number.
fn write_with_exif(path: &Path, tag: u16, value: u16) {
    let [a, b] = tag.to_le_bytes();
    let [c, d] = value.to_le_bytes();
    let exif = [&b"II*\0\x08\0\0\0\x01\0"[..], &[a, b, 3, 0, 1, 0, 0, 0, c, d, 0, 0, 0, 0, 0, 0]].concat();
    let mut encoder = image::codecs::png::PngEncoder::new(fs::File::create(path).unwrap());
    image::ImageEncoder::set_exif_metadata(&mut encoder, exif).unwrap();
    let codes = [0x07, 0xd0].repeat(ROWS * COLUMNS);
    // Codes of 16 bits are in the order of the machine.
    let codes: Vec<u8> = codes.chunks(2).flat_map(|two| u16::from_be_bytes([two[0], two[1]]).to_ne_bytes()).collect();
    image::ImageEncoder::write_image(encoder, &codes, COLUMNS as u32, ROWS as u32, image::ExtendedColorType::L16)
        .unwrap();
}

/// What Exif data state of how a picture of numbers lies, and of colors without a profile, is named.
#[test]
fn orientations_and_colors_of_exif_data_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let depth = folder.path().join("d.png");
    for (orientation, n) in [(1, 0), (3, 1), (6, 1)] {
        write_with_exif(&depth, 274, orientation);
        let scene = read_scene(&picture(folder.path()), &options(None, Some(depth.clone()))).unwrap();
        let note = format!("d.png: its orientation, {orientation} (Exif), is not used");
        assert_eq!(scene.notes.iter().filter(|own| **own == note).count(), n, "{:?}", scene.notes);
    }
    let bands = folder.path().join("bands");
    fs::create_dir(&bands).unwrap();
    [450, 550].iter().for_each(|nm| write_with_exif(&bands.join(format!("b_{nm}.png")), 274, 3));
    check_named(&read_scene(&bands, &ReadOptions::default()).unwrap(), "its orientation, 3 (Exif), is not used");
    for (space, word) in [(1, ""), (65_535, "uncalibrated colors (ColorSpace 65535)"), (2, "Adobe RGB (ColorSpace 2)")]
    {
        write_with_exif(&depth, 0xA001, space);
        let scene = read_scene(&depth, &ReadOptions::default()).unwrap();
        let n = scene.notes.iter().filter(|note| note.contains("ColorSpace") && note.contains(word)).count();
        assert_eq!(n, usize::from(space != 1), "{:?}", scene.notes);
        // A chunk that says sRGB counts before them.
        let mut bytes = fs::read(&depth).unwrap();
        let chunk = [0, 0, 0, 1, b's', b'R', b'G', b'B', 0, 0xae, 0xce, 0x1c, 0xe9];
        bytes.splice(33..33, chunk);
        fs::write(&depth, bytes).unwrap();
        let scene = read_scene(&depth, &ReadOptions::default()).unwrap();
        assert!(scene.notes.iter().all(|note| !note.contains("ColorSpace")), "{:?}", scene.notes);
    }
}

/// Photons of which the file or the options state a unit of energy are refused, whatever the kind of file.
#[test]
fn photons_are_not_counted_in_watts() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let bytes: Vec<u8> = [0.5_f32; 4].iter().flat_map(|v| v.to_le_bytes()).collect();
    fs::write(at("a.npy"), npy("<f4", false, "(1, 2, 2)", &bytes)).unwrap();
    let head = |unit: &str| {
        format!(
            "ENVI\nsamples = 2\nlines = 1\nbands = 2\ndata type = 4\ninterleave = bip\nwavelength = {{500, 600}}\n{unit}"
        )
    };
    for (name, unit) in [("b", "data units = W/m^2/sr/nm\n"), ("c", "")] {
        fs::write(at(&format!("{name}.hdr")), head(unit)).unwrap();
        fs::write(at(&format!("{name}.raw")), &bytes).unwrap();
    }
    write_exr(&at("d.exr"), vec![layer("", "scanner", &[("S0.500nm", 0.5), ("S0.600nm", 0.5)])]);
    let read = |name: &str, quantity, unit: Option<&str>| {
        let reading = FileReading {
            quantity: Some(quantity),
            unit: unit.map(str::to_owned),
            wavelengths_nm: (name == "a.npy").then(|| vec![500.0, 600.0]),
            ..FileReading::default()
        };
        read_scene(&at(name), &ReadOptions { reading, ..ReadOptions::default() })
    };
    for (name, unit) in [("a.npy", Some("W/m^2/sr/nm")), ("b.hdr", None), ("c.hdr", Some("uW/(cm^2 sr nm)"))] {
        let message = read(name, FileQuantity::Photons, unit).unwrap_err().to_string();
        assert!(message.contains(name) && message.contains("--quantity photons contradicts"), "{message}");
        assert!(read(name, FileQuantity::Radiance, unit).is_ok(), "{name}");
    }
    let message = read("d.exr", FileQuantity::Photons, Some("W/m^2/sr/nm")).unwrap_err().to_string();
    assert!(message.contains("--quantity photons contradicts"), "{message}");
    for name in ["a.npy", "c.hdr", "d.exr"] {
        assert!(read(name, FileQuantity::Photons, Some("photons/s/m^2/sr/nm")).is_ok(), "{name}");
    }
}

/// CIE colors are no gray picture with a depth: those of a white of D65 become white.
#[test]
fn channels_x_y_and_z_are_colors() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("xyz.exr");
    let white = dioptric_spectrum::Xyz::from_linear_srgb([0.5; 3]).0;
    write_exr(
        &path,
        vec![layer("", "scanner", &[("X", white[0] as f32), ("Y", white[1] as f32), ("Z", white[2] as f32)])],
    );
    let contents = contents_of(&path, &ReadOptions::default()).unwrap();
    assert!(contents.depth.is_none() && contents.notes.iter().any(|note| note.contains("CIE XYZ")));
    let Samples::Linear { planes, .. } = contents.image else { panic!("no colors") };
    // Single floats.
    assert!(planes.iter().flatten().all(|v| (v - 0.5).abs() < 1e-6), "{planes:?}");
}

/// A scene of `ISETCam` says all itself.
#[test]
fn nothing_can_be_said_of_a_scene_of_isetcam() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/scenes/iset_scene.mat");
    for (reading, word) in [
        (FileReading { axes: Some("yxb".to_owned()), ..FileReading::default() }, "--axes"),
        (FileReading { unit: Some("W/m^2/sr/nm".to_owned()), ..FileReading::default() }, "--unit"),
        (FileReading { scale: Some(2.0), ..FileReading::default() }, "--scale"),
        (FileReading { variable: Some("data".to_owned()), ..FileReading::default() }, "data"),
    ] {
        let message = read_scene(&path, &ReadOptions { reading, ..ReadOptions::default() }).unwrap_err().to_string();
        assert!(message.contains(word), "{message}");
    }
    // It may be called by its name, whatever that is.
    let reading = FileReading { variable: Some("scene".to_owned()), ..FileReading::default() };
    let named = read_scene(&path, &ReadOptions { reading, ..ReadOptions::default() }).unwrap();
    assert_eq!(named.radiance, read_scene(&path, &ReadOptions::default()).unwrap().radiance);
}

/// The frame of a picture in nerfstudio's file names its depth, in millimetres unless the file says otherwise.
#[test]
fn frames_of_nerfstudio_name_their_depth() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("images")).unwrap();
    let room = picture(&at("images"));
    let codes = image::ImageBuffer::from_pixel(COLUMNS as u32, ROWS as u32, image::Luma([2500_u16]));
    dioptric_pictures::save(&codes.into(), &at("d.png")).unwrap();
    let floats: Vec<u8> = [2500.0_f32; ROWS * COLUMNS].iter().flat_map(|v| v.to_le_bytes()).collect();
    fs::write(at("d.npy"), npy("<f4", false, "(3, 4)", &floats)).unwrap();
    let read = |more: &str, frame: &str| {
        let other = r#"{"file_path": "images/hall.png", "depth_file_path": "absent.png"}"#;
        let text = format!(
            r#"{{"w": 4, "h": 3, "fl_x": 9, "fl_y": 9, "cx": 2, "cy": 1.5{more}, "frames": [{other}, {{{frame}}}]}}"#
        );
        fs::write(at("transforms.json"), text).unwrap();
        let reading = FileReading { view: Some(at("transforms.json")), ..FileReading::default() };
        read_scene(&room, &ReadOptions { reading, ..ReadOptions::default() })
    };
    let file = r#""file_path": "images/room.png""#;
    let with = |depth: &str| format!(r#"{file}, "depth_file_path": "{depth}""#);
    for (more, frame, z_m, words) in [
        ("", with("d.png"), 2.5, ""),
        (r#", "depth_unit_scale_factor": 0.01"#, with("d.png"), 25.0, ""),
        ("", with("d.npy"), 2.5, "taken for millimetres"),
        ("", with("d.png").replace("room.png", "room"), 2.5, ""),
        ("", with("d.png") + r#", "mask_path": "m.png""#, 2.5, "its key 'mask_path' is not used"),
    ] {
        let scene = read(more, &frame).unwrap();
        let depth = scene.require_depth().unwrap().range_m();
        assert!((depth.0 - z_m).abs() < 1e-6 && depth.0 == depth.1, "{frame}: {depth:?}");
        assert_eq!(scene.notes.len(), 1 + usize::from(!words.is_empty()), "{:?}", scene.notes);
        assert!(scene.notes.iter().any(|note| note.contains(words)), "{:?}", scene.notes);
    }
    let longer = read("", &(with("d.png") + r#", "fl_x": 18, "fl_y": 18"#)).unwrap();
    assert_eq!(longer.view.unwrap().focal_px, 18.0);
    let scene = read("", r#""file_path": "images/lobby.png""#).unwrap();
    check_named(&scene, "none of the file_path of its frames is room.png");
    for (frame, words) in
        [(with("absent.png"), "absent.png', which is no file"), (r#""fl_x": 1"#.to_owned(), "none of the file_path")]
    {
        let message = read("", &frame).unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    }
}
