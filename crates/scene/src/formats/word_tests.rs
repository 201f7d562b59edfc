//! Words that nobody knows, put into every format at random: each is named in the notes, every time. Headers that are cut off, huge or
//! contradict themselves are refused in one sentence.
//!
//! `DIOPTRIC_FUZZ_CASES=10000 TMPDIR=/dev/shm cargo test --workspace --lib -- word_tests` puts a hundred times as many words into files of each format.

use std::{fs, path::Path};

use exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Encoding, FlatSamples, Image, Layer, LayerAttributes, SmallVec, Text,
    WritableImage,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{
    FileQuantity, ReadOptions,
    kinds_tests::{COLUMNS, ROWS, WAVE_NM, bytes_as, folder_and, in_order, npy_of, sides, told, waves_npy, zip_of},
    mat::fixtures::{mat_file, variable_of},
    npy::tests::npy,
    read_scene,
};

pub(super) fn n_cases() -> usize {
    std::env::var("DIOPTRIC_FUZZ_CASES").map_or(100, |text| text.parse().unwrap())
}

/// Runs in a pool of one thread: to hand each small file to the threads of another takes most of the time.
pub(super) fn alone(run: impl FnOnce() + Send) {
    rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(run);
}

/// A word of which no format knows.
pub(super) fn word(rng: &mut ChaCha8Rng) -> String {
    let tail: String = (0..rng.random_range(2..9)).map(|_| rng.random_range('a'..='z')).collect();
    format!("zq{tail}")
}

/// How many words are put into files of each reader: by `DIOPTRIC_FUZZ_CASES` a hundred a case.
fn n_words() -> usize {
    100 * n_cases()
}

/// Makes files until all words are used up, each with one word or with up to some hundreds, no two alike.
fn with_words(seed: u64, check: impl Fn(&mut ChaCha8Rng, &[String])) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut n_left = n_words();
    while n_left > 0 {
        let n = 1 + (400.0 * rng.random::<f64>().powi(3)) as usize;
        // The last tells words of one file apart.
        let own: Vec<String> = (0..n).map(|i| format!("{}q{i}q", word(&mut rng))).collect();
        check(&mut rng, &own);
        n_left = n_left.saturating_sub(n);
    }
}

/// Puts lines that words are made into among others.
fn among(
    rng: &mut ChaCha8Rng,
    lines: &[&str],
    words: &[String],
    line: impl Fn(&mut ChaCha8Rng, &str) -> String,
) -> Vec<String> {
    let mut all: Vec<String> = lines.iter().map(|line| (*line).to_owned()).collect();
    for word in words {
        let line = line(rng, word);
        all.insert(rng.random_range(0..=all.len()), line);
    }
    all
}

/// Checks that each of the words in a file is named, those that a note has no room for by their number.
fn check_named(path: &Path, options: &ReadOptions, words: &[String]) {
    match read_scene(path, options) {
        Ok(scene) => {
            let notes = scene.notes.join("\n");
            let more = notes.split(" and ").filter_map(|part| part.split_once(" more")?.0.parse::<usize>().ok());
            let n_named = words.iter().filter(|word| notes.contains(word.as_str())).count();
            assert_eq!(n_named + more.sum::<usize>(), words.len(), "{words:?}: {:?}", scene.notes);
        }
        Err(error) => {
            let message = error.to_string();
            assert!(
                message.contains(&*path.file_name().unwrap().to_string_lossy()) && !message.contains('\n'),
                "{message}"
            );
            panic!("a word that nobody knows closes the file: {message}");
        }
    }
}

#[test]
fn unknown_words_of_arrays_are_named() {
    alone(|| {
        let (_a, packed) = folder_and("a.npz");
        let (_b, mat) = folder_and("a.mat");
        let (_c, h5) = folder_and("a.h5");
        let options = told(Some(FileQuantity::Reflectance), Some("yxb"), false);
        with_words(11, |rng, words| {
            let one = npy("<f8", false, "(1,)", &1.0_f64.to_le_bytes());
            let mut arrays = vec![("cube", npy_of("<f4", "yxb")), ("wave", waves_npy())];
            for word in words {
                arrays.insert(rng.random_range(0..=arrays.len()), (word, one.clone()));
            }
            fs::write(&packed, zip_of(&arrays, false)).unwrap();
            check_named(&packed, &options, words);
            let mut variables = vec![
                variable_of("cube", &sides("yxb"), 6, &in_order("bxy")),
                variable_of("wave", &[5, 1], 6, &WAVE_NM),
            ];
            let mut file = hdf5_pure::FileBuilder::new();
            file.create_dataset("cube").with_data(&in_order("yxb")).with_shape(&[3, 4, 5]);
            file.create_dataset("wave").with_data(&WAVE_NM).with_shape(&[5]);
            for word in words {
                let class = [6, 7, 9][rng.random_range(0..3)];
                variables.insert(rng.random_range(0..=variables.len()), variable_of(word, &[1, 2], class, &[1.0, 2.0]));
                file.create_dataset(word).with_data(&[1.0, 2.0]).with_shape(&[2]);
            }
            fs::write(&mat, mat_file(&variables)).unwrap();
            check_named(&mat, &options, words);
            fs::write(&h5, file.finish().unwrap()).unwrap();
            check_named(&h5, &options, words);
        });
    });
}

#[test]
fn unknown_words_of_headers_are_named() {
    alone(|| {
        let (_a, envi) = folder_and("a.hdr");
        let (_b, exr) = folder_and("a.exr");
        fs::write(envi.with_extension("raw"), bytes_as("<f4", &in_order("byx"))).unwrap();
        let waves = format!("wavelength = {{{}}}", WAVE_NM.map(|nm| nm.to_string()).join(", "));
        let samples = format!("samples = {COLUMNS}");
        let rows = format!("lines = {ROWS}");
        let lines = [&samples, &rows, "bands = 5", "data type = 4", "interleave = bsq", "byte order = 0", &waves];
        let value = |rng: &mut ChaCha8Rng| ["1", "{1, 2, 3}", "some words", "{\n a,\n b}"][rng.random_range(0..4)];
        let reflecting = told(Some(FileQuantity::Reflectance), None, false);
        with_words(12, |rng, words| {
            let lines = among(rng, &lines, words, |rng, word| format!("{word} = {}", value(rng)));
            fs::write(&envi, format!("ENVI\n{}\n", lines.join("\n"))).unwrap();
            check_named(&envi, &reflecting, words);
            // Attributes of the header, and channels.
            let samples = || FlatSamples::F32(vec![0.5; 4]);
            let mut channels: Vec<_> = ["R", "G", "B"].map(|name| AnyChannel::new(name, samples())).to_vec();
            let mut attributes = LayerAttributes::default();
            for word in words {
                if rng.random() {
                    channels.push(AnyChannel::new(word.as_str(), samples()));
                } else {
                    attributes.other.insert(Text::from(word.as_str()), AttributeValue::Text(Text::from("x")));
                }
            }
            let list: SmallVec<[_; 4]> = channels.into_iter().collect();
            let layer = Layer::new((2, 2), attributes, Encoding::FAST_LOSSLESS, AnyChannels::sort(list));
            Image::from_layer(layer).write().to_file(&exr).unwrap();
            check_named(&exr, &ReadOptions::default(), words);
        });
    });
}

/// Camera files of each kind beside a picture: keys that nobody knows stand among theirs.
#[test]
fn unknown_words_of_camera_files_are_named() {
    alone(|| {
        let (_folder, picture) = folder_and("a.png");
        dioptric_pictures::save(&image::GrayImage::from_pixel(6, 4, image::Luma([99])).into(), &picture).unwrap();
        let camera = picture.with_file_name("a.camera.json");
        let ours =
            ["\"width\": 6", "\"height\": 4", "\"fx_px\": 5", "\"fy_px\": 5", "\"cx_px\": 2.5", "\"cy_px\": 1.5"];
        let nerf = ["\"w\": 6", "\"h\": 4", "\"fl_x\": 5", "\"fl_y\": 5", "\"cx\": 3", "\"cy\": 2", "\"frames\": []"];
        let open3d = ["\"width\": 6", "\"height\": 4", "\"intrinsic_matrix\": [5, 0, 0, 0, 5, 0, 2.5, 1.5, 1]"];
        let value = |rng: &mut ChaCha8Rng| ["1", "\"text\"", "[1, 2]", "{\"a\": 1}", "true"][rng.random_range(0..5)];
        for kind in [&ours[..], &nerf, &open3d] {
            with_words(14, |rng, words| {
                let lines = among(rng, kind, words, |rng, word| format!("\"{word}\": {}", value(rng)));
                fs::write(&camera, format!("{{{}}}", lines.join(", "))).unwrap();
                check_named(&picture, &ReadOptions::default(), words);
            });
        }
        fs::remove_file(&camera).unwrap();
        // OpenCV's YAML, by its own name.
        let matrix = "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [5., 0., 2.5, 0., 5., 1.5, 0., 0., 1.]\n";
        let parts = ["image_width: 6\n", "image_height: 4\n", matrix];
        let yaml = picture.with_file_name("view.yml");
        let mut options = ReadOptions::default();
        options.reading.view = Some(yaml.clone());
        with_words(15, |rng, words| {
            let parts = among(rng, &parts, words, |_, word| format!("{word}: 1.5\n"));
            fs::write(&yaml, format!("%YAML:1.0\n---\n{}", parts.concat())).unwrap();
            check_named(&picture, &options, words);
        });
    });
}

/// Files and pictures beside those of a folder, fields of structures, items of TIFF files.
#[test]
fn unknown_words_of_folders_and_structures_are_named() {
    alone(|| {
        let folder = tempfile::tempdir().unwrap();
        for nm in [450, 550, 650] {
            let plane = image::ImageBuffer::from_pixel(4, 3, image::Luma([30_000_u16]));
            dioptric_pictures::save(&plane.into(), &folder.path().join(format!("a_{nm}.png"))).unwrap();
        }
        let gray: image::DynamicImage = image::GrayImage::from_pixel(4, 3, image::Luma([9])).into();
        let gray = dioptric_pictures::encode(&gray, image::ImageFormat::Png).unwrap();
        with_words(16, |rng, words| {
            // Words that end in no number are no bands.
            let words: Vec<String> = words.iter().map(|word| format!("{word}x")).collect();
            let ending = |rng: &mut ChaCha8Rng| ["png", "tif", "jpg", "json", "bin"][rng.random_range(0..5)];
            let names: Vec<String> = words.iter().map(|word| format!("{word}.{}", ending(rng))).collect();
            names.iter().for_each(|name| fs::write(folder.path().join(name), &gray).unwrap());
            check_named(folder.path(), &ReadOptions::default(), &words);
            names.iter().for_each(|name| fs::remove_file(folder.path().join(name)).unwrap());
        });
        let (_scene, mat) = folder_and("a.mat");
        let scene =
            fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/scenes/iset_plain.mat")).unwrap();
        with_words(17, |_, words| {
            // Variables beside the structure.
            let more: Vec<u8> = words.iter().flat_map(|word| variable_of(word, &[1, 2], 7, &[1.0, 2.0])).collect();
            fs::write(&mat, [scene.clone(), more].concat()).unwrap();
            check_named(&mat, &ReadOptions::default(), words);
        });
        let (_tiff, tiff) = folder_and("a.tif");
        let options = ReadOptions { white_level: None, ..told(Some(FileQuantity::Reflectance), None, true) };
        with_words(18, |rng, words| {
            let (json, items) = words.split_at(rng.random_range(0..=words.len()));
            let json: Vec<String> = json.iter().map(|word| format!("\"{word}\": 1")).collect();
            let items: Vec<String> = items.iter().map(|word| format!("<Item name=\"{word}\">1</Item>")).collect();
            let mut encoder = tiff::encoder::TiffEncoder::new(fs::File::create(&tiff).unwrap()).unwrap();
            for index in 0..WAVE_NM.len() {
                let mut page = encoder.new_image::<tiff::encoder::colortype::Gray32Float>(4, 3).unwrap();
                if index == 0 {
                    let text = format!(
                        "{{\"shape\": [5, 3, 4]{}}}",
                        json.iter().map(|own| format!(", {own}")).collect::<String>()
                    );
                    page.encoder().write_tag(tiff::tags::Tag::ImageDescription, text.as_str()).unwrap();
                    let text = format!("<GDALMetadata>{}</GDALMetadata>", items.concat());
                    page.encoder().write_tag(tiff::tags::Tag::Unknown(42112), text.as_str()).unwrap();
                }
                page.write_data(&[0.5; 12]).unwrap();
            }
            drop(encoder);
            check_named(&tiff, &options, words);
        });
    });
}

/// Lines of a Radiance picture and chunks of text in a PNG tell how it was made; a factor on its numbers is obeyed.
#[test]
fn lines_of_radiance_pictures_are_obeyed_or_named() {
    alone(|| {
        let (_folder, path) = folder_and("a.hdr");
        let picture = |lines: &str| {
            // Mantissas of 128 and an exponent of 129 are 1: flat scanlines of fewer than 8 pixels.
            let pixels = [128_u8, 128, 128, 129].repeat(6);
            [format!("#?RADIANCE\n{lines}FORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 3\n").into_bytes(), pixels].concat()
        };
        let luminance = |lines: &str| {
            fs::write(&path, picture(lines)).unwrap();
            let scene = read_scene(&path, &ReadOptions::default()).unwrap();
            (scene.mean_luminance_cd_m2(), scene.notes)
        };
        let (plain, _) = luminance("");
        // The numbers of a file are those of light times all exposures in its header.
        let (exposed, _) = luminance("EXPOSURE=4\nEXPOSURE= 0.5\n");
        assert!((exposed / plain * 2.0 - 1.0).abs() < 1e-4, "{exposed} {plain}");
        // Commands that made a picture say how it is seen, or that it was fitted to a display.
        assert_eq!(luminance("oconv room.rad\n# by hand\n").1.len(), 1);
        for line in ["rpict -vh 45 room.oct", "pcond -h", "# lengths in mm"] {
            let (_, notes) = luminance(&format!("{line}\n"));
            assert!(notes.iter().any(|note| note.contains(line)), "{line}: {notes:?}");
        }
        with_words(19, |_, words| {
            let lines: String = words.iter().map(|word| format!("{word}=1 2 3\n")).collect();
            fs::write(&path, picture(&lines)).unwrap();
            check_named(&path, &ReadOptions::default(), words);
        });
    });
}

/// Headers that ask for more than there is, twice, or for the impossible.
#[test]
fn contradictory_headers_are_refused_in_a_sentence() {
    let (_a, envi) = folder_and("a.hdr");
    fs::write(envi.with_extension("raw"), [0; 240]).unwrap();
    let good = "samples = 4\nlines = 3\nbands = 5\ndata type = 4\ninterleave = bsq\nbyte order = 0\nwavelength = {450, 500, 560, 600, 650}\n";
    let wrong = [
        good.replace("lines = 3", "lines = 18446744073709551615"),
        good.replace("bands = 5", "bands = 0"),
        good.replace("bands = 5", "bands = 6"),
        good.replace("samples = 4", "samples = -4"),
        good.replace("650}", "650, 700}"),
        good.replace("500", "450"),
        good.replace("data type = 4", "data type = 6"),
        good.replace("interleave = bsq", "interleave = bqs"),
        good.replace("byte order = 0", "byte order = 7"),
        good.replace("650}", "650"),
        format!("{good}header offset = 99999999999999\n"),
        format!("{good}data gain values = {{1, 2}}\n"),
        format!("{good}bbl = {{0, 0, 0, 0, 0}}\n"),
    ];
    let options = told(Some(FileQuantity::Reflectance), None, false);
    let check = |path: &Path, bytes: &[u8]| {
        fs::write(path, bytes).unwrap();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let message = read_scene(path, &options).err().map(|error| error.to_string());
        let message = message.unwrap_or_else(|| panic!("read: {}", String::from_utf8_lossy(bytes)));
        assert!(message.contains(name.trim_end_matches(".hdr")) && !message.contains('\n'), "{message}");
    };
    for text in wrong {
        check(&envi, format!("ENVI\n{text}").as_bytes());
    }
    // A key may stand twice, but not say two things.
    check(&envi, format!("ENVI\n{good}").replace("samples = 4", "samples = 4\nsamples = 5").as_bytes());
    fs::write(&envi, format!("ENVI\n{good}").replace("samples = 4", "samples = 4\nsamples = 4")).unwrap();
    assert!(read_scene(&envi, &options).is_ok());
    let (_b, array) = folder_and("a.npy");
    for shape in
        ["(3, 4, 18446744073709551615)", "(99999999, 99999999, 99999999)", "(-3, 4, 5)", "(3, 4)", "()", "(0, 4, 5)"]
    {
        check(&array, &npy("<f4", false, shape, &[0; 240]));
    }
    let (_c, map) = folder_and("a.pfm");
    for head in
        ["PF\n99999999 99999999\n-1\n", "PF\n0 0\n-1\n", "PF\n-3 2\n-1\n", "PF\n3 2\n0\n", "PX\n3 2\n-1\n", "PF\n3"]
    {
        check(&map, head.as_bytes());
    }
}
