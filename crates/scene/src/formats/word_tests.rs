//! Words that nobody knows, put into every format at random: each is named in the notes, every time. Headers that are cut off, huge or
//! contradict themselves are refused in one sentence.
//!
//! `DIOPTRIC_FUZZ_CASES=1000000 cargo test --release --workspace --lib -- unknown_words` makes that many files a format.

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

/// Checks that a word in a file is named, or the file refused by its name.
fn check_named(path: &Path, options: &ReadOptions, word: &str) {
    match read_scene(path, options) {
        Ok(scene) => assert!(scene.notes.iter().any(|note| note.contains(word)), "{word}: {:?}", scene.notes),
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
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let (_a, packed) = folder_and("a.npz");
        let (_b, mat) = folder_and("a.mat");
        let (_c, h5) = folder_and("a.h5");
        for _ in 0..n_cases() {
            let word = word(&mut rng);
            let options = told(Some(FileQuantity::Reflectance), Some("yxb"), false);
            let one = npy("<f8", false, "(1,)", &1.0_f64.to_le_bytes());
            let bytes = zip_of(&[("cube", npy_of("<f4", "yxb")), ("wave", waves_npy()), (&word, one)], false);
            fs::write(&packed, bytes).unwrap();
            check_named(&packed, &options, &word);
            let turned = in_order("bxy");
            let cube = variable_of("cube", &sides("yxb"), 6, &turned);
            let others = [variable_of("wave", &[5, 1], 6, &WAVE_NM), variable_of(&word, &[1, 2], 7, &[1.0, 2.0])];
            fs::write(&mat, mat_file(&[vec![cube], others.to_vec()].concat())).unwrap();
            check_named(&mat, &options, &word);
            let mut file = hdf5_pure::FileBuilder::new();
            file.create_dataset("cube").with_data(&in_order("yxb")).with_shape(&[3, 4, 5]);
            file.create_dataset("wave").with_data(&WAVE_NM).with_shape(&[5]);
            file.create_dataset(&word).with_data(&[1.0, 2.0]).with_shape(&[2]);
            fs::write(&h5, file.finish().unwrap()).unwrap();
            check_named(&h5, &options, &word);
        }
    });
}

#[test]
fn unknown_words_of_headers_are_named() {
    alone(|| {
        let mut rng = ChaCha8Rng::seed_from_u64(12);
        let (_a, envi) = folder_and("a.hdr");
        let (_b, exr) = folder_and("a.exr");
        fs::write(envi.with_extension("raw"), bytes_as("<f4", &in_order("byx"))).unwrap();
        for case in 0..n_cases() {
            let word = word(&mut rng);
            let waves = WAVE_NM.map(|nm| nm.to_string()).join(", ");
            let value = ["1", "{1, 2, 3}", "some words", "{\n a,\n b}"][case % 4];
            let mut lines: Vec<String> = [
                format!("samples = {COLUMNS}"),
                format!("lines = {ROWS}"),
                "bands = 5".to_owned(),
                "data type = 4".to_owned(),
                "interleave = bsq".to_owned(),
                "byte order = 0".to_owned(),
                format!("wavelength = {{{waves}}}"),
            ]
            .to_vec();
            lines.insert(rng.random_range(0..=lines.len()), format!("{word} = {value}"));
            fs::write(&envi, format!("ENVI\n{}\n", lines.join("\n"))).unwrap();
            check_named(&envi, &told(Some(FileQuantity::Reflectance), None, false), &word);
            // An attribute of the header, or a channel.
            let samples = || FlatSamples::F32(vec![0.5; 4]);
            let mut channels: Vec<_> = ["R", "G", "B"].map(|name| AnyChannel::new(name, samples())).to_vec();
            let mut attributes = LayerAttributes::default();
            if case % 2 == 0 {
                channels.push(AnyChannel::new(word.as_str(), samples()));
            } else {
                attributes.other.insert(Text::from(word.as_str()), AttributeValue::Text(Text::from("x")));
            }
            let list: SmallVec<[_; 4]> = channels.into_iter().collect();
            let layer = Layer::new((2, 2), attributes, Encoding::FAST_LOSSLESS, AnyChannels::sort(list));
            Image::from_layer(layer).write().to_file(&exr).unwrap();
            check_named(&exr, &ReadOptions::default(), &word);
        }
    });
}

/// Camera files of each kind beside a picture: a key that nobody knows stands among theirs.
#[test]
fn unknown_words_of_camera_files_are_named() {
    alone(|| {
        let mut rng = ChaCha8Rng::seed_from_u64(14);
        let (_folder, picture) = folder_and("a.png");
        dioptric_pictures::save(&image::GrayImage::from_pixel(6, 4, image::Luma([99])).into(), &picture).unwrap();
        let camera = picture.with_file_name("a.camera.json");
        let ours =
            ["\"width\": 6", "\"height\": 4", "\"fx_px\": 5", "\"fy_px\": 5", "\"cx_px\": 2.5", "\"cy_px\": 1.5"];
        let nerf = ["\"w\": 6", "\"h\": 4", "\"fl_x\": 5", "\"fl_y\": 5", "\"cx\": 3", "\"cy\": 2", "\"frames\": []"];
        let open3d = ["\"width\": 6", "\"height\": 4", "\"intrinsic_matrix\": [5, 0, 0, 0, 5, 0, 2.5, 1.5, 1]"];
        let kinds: [&[&str]; 3] = [&ours, &nerf, &open3d];
        for case in 0..n_cases() {
            let word = word(&mut rng);
            let mut lines: Vec<String> = kinds[case % 3].iter().map(|line| (*line).to_owned()).collect();
            let value = ["1", "\"text\"", "[1, 2]", "{\"a\": 1}", "true"][rng.random_range(0..5)];
            lines.insert(rng.random_range(0..=lines.len()), format!("\"{word}\": {value}"));
            fs::write(&camera, format!("{{{}}}", lines.join(", "))).unwrap();
            check_named(&picture, &ReadOptions::default(), &word);
            // OpenCV's YAML, by its own name.
            let matrix = "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [5., 0., 2.5, 0., 5., 1.5, 0., 0., 1.]\n";
            let mut parts = vec!["image_width: 6\n".to_owned(), "image_height: 4\n".to_owned(), matrix.to_owned()];
            parts.insert(rng.random_range(0..=parts.len()), format!("{word}: 1.5\n"));
            let yaml = picture.with_file_name("view.yml");
            fs::write(&yaml, format!("%YAML:1.0\n---\n{}", parts.concat())).unwrap();
            fs::remove_file(&camera).unwrap();
            let mut options = ReadOptions::default();
            options.reading.view = Some(yaml);
            check_named(&picture, &options, &word);
        }
    });
}

/// Files and pictures beside those of a folder, fields of structures, lines of headers.
#[test]
fn unknown_words_of_folders_and_structures_are_named() {
    alone(|| {
        let mut rng = ChaCha8Rng::seed_from_u64(15);
        let folder = tempfile::tempdir().unwrap();
        for nm in [450, 550, 650] {
            let plane = image::ImageBuffer::from_pixel(4, 3, image::Luma([30_000_u16]));
            dioptric_pictures::save(&plane.into(), &folder.path().join(format!("a_{nm}.png"))).unwrap();
        }
        let gray: image::DynamicImage = image::GrayImage::from_pixel(4, 3, image::Luma([9])).into();
        for _ in 0..n_cases() {
            let word = word(&mut rng);
            let other = folder.path().join(format!("{word}.png"));
            dioptric_pictures::save(&gray, &other).unwrap();
            check_named(folder.path(), &ReadOptions::default(), &word);
            fs::remove_file(&other).unwrap();
        }
        let (_scene, mat) = folder_and("a.mat");
        let scene =
            fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/scenes/iset_plain.mat")).unwrap();
        for _ in 0..n_cases() {
            let word = word(&mut rng);
            // A variable beside the structure.
            let more = variable_of(&word, &[1, 2], 7, &[1.0, 2.0]);
            fs::write(&mat, [scene.clone(), more].concat()).unwrap();
            check_named(&mat, &ReadOptions::default(), &word);
        }
    });
}

/// Lines of a Radiance picture and chunks of text in a PNG tell how it was made; a factor on its numbers is obeyed.
#[test]
fn lines_of_radiance_pictures_are_obeyed_or_named() {
    alone(|| {
        let mut rng = ChaCha8Rng::seed_from_u64(16);
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
        for _ in 0..n_cases() {
            let word = word(&mut rng).to_uppercase();
            let (_, notes) = luminance(&format!("{word}=1 2 3\n"));
            assert!(notes.iter().any(|note| note.contains(&word)), "{word}: {notes:?}");
        }
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
