//! Files of every reader with bytes changed, lost and doubled, and numbers made absurd: each is read or refused in one sentence that names it, never a
//! panic, and soon.
//!
//! `DIOPTRIC_FUZZ_CASES=1000000 TMPDIR=/dev/shm cargo test --release --workspace --lib -- mutations` makes that many files a reader.

use std::{
    fs,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{
    FileQuantity, ReadOptions,
    kinds_tests::{in_order, npy_of, told, waves_npy, zip_of},
    mat::fixtures::{mat_file, variable_of},
    read_scene,
    word_tests::{alone, n_cases},
};

/// No file of these sizes takes as long.
const LONGEST: Duration = Duration::from_secs(60);

/// Numbers that are rarely looked for in a text.
const ABSURD: [&str; 14] = [
    "0",
    "-1",
    "1e999",
    "nan",
    "inf",
    "-inf",
    "99999999999999999999",
    "4294967296",
    "1e-300",
    "65536",
    "",
    "0x10",
    "1,5",
    "{",
];

/// Returns bytes of which a few are others, are gone, are there twice, or stand where others should.
fn changed(rng: &mut ChaCha8Rng, bytes: &[u8], is_text: bool) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..rng.random_range(1..4) {
        if bytes.is_empty() {
            break;
        }
        let at = rng.random_range(0..bytes.len());
        let end = (at + rng.random_range(1..24)).min(bytes.len());
        match rng.random_range(0..if is_text { 8 } else { 6 }) {
            0 => bytes[at] = rng.random(),
            1 => bytes[at] ^= 1 << rng.random_range(0..8),
            2 => bytes.truncate(at),
            3 => drop(bytes.drain(at..end)),
            4 => {
                let part = bytes[at..end].to_vec();
                let to = rng.random_range(0..=bytes.len());
                bytes.splice(to..to, part);
            }
            5 => bytes[at..end].fill([0, 0xff, 0x7f, 0x80][rng.random_range(0..4)]),
            _ => absurd(rng, &mut bytes, at),
        }
    }
    bytes
}

/// Puts an absurd number in the place of the first number behind a place of a text.
fn absurd(rng: &mut ChaCha8Rng, bytes: &mut Vec<u8>, at: usize) {
    let Some(first) = bytes[at..].iter().position(u8::is_ascii_digit).map(|n| at + n) else { return };
    let length = bytes[first..].iter().take_while(|byte| byte.is_ascii_digit() || **byte == b'.').count();
    bytes.splice(first..first + length, ABSURD[rng.random_range(0..ABSURD.len())].bytes());
}

/// Reads changed files of a name, beside which others may lie.
fn check(
    name: &str,
    good: &[u8],
    is_text: bool,
    read: &dyn Fn(&Path) -> Result<crate::Scene, crate::SceneError>,
    path: &Path,
) {
    let mut rng = ChaCha8Rng::seed_from_u64(good.len() as u64);
    fs::write(path, good).unwrap();
    read(path).unwrap_or_else(|error| panic!("{name}: {error}"));
    let (n, start, mut n_read) = (n_cases(), Instant::now(), 0);
    for _ in 0..n {
        let bytes = changed(&mut rng, good, is_text);
        fs::write(path, &bytes).unwrap();
        let begun = Instant::now();
        match read(path) {
            Ok(scene) => {
                n_read += 1;
                assert!(scene.validate().is_ok(), "{name}: {:?}", scene.validate());
            }
            Err(error) => {
                let message = error.to_string();
                let stem = path.file_stem().unwrap().to_string_lossy().into_owned();
                let is_named = message.contains(&stem) || message.contains("of the scene");
                assert!(is_named && !message.contains('\n') && message.len() < 1000, "{name}: {message}");
            }
        }
        if begun.elapsed() > LONGEST {
            let kept = std::env::temp_dir().join(format!("slow-{}", path.file_name().unwrap().to_string_lossy()));
            fs::write(&kept, &bytes).unwrap();
            panic!("{name}: {:?} for {}", begun.elapsed(), kept.display());
        }
    }
    println!("{name}: {n} files, {n_read} read, the others refused, {:.1} s", start.elapsed().as_secs_f64());
}

fn fixture(name: &str) -> Vec<u8> {
    fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/scenes").join(name)).unwrap()
}

/// A picture of 4 × 3 gray or colored pixels, encoded.
fn encoded(picture: image::DynamicImage, format: image::ImageFormat) -> Vec<u8> {
    dioptric_pictures::encode(&picture, format).unwrap()
}

fn rgb() -> image::DynamicImage {
    image::RgbImage::from_fn(4, 3, |x, y| image::Rgb([x as u8 * 60, y as u8 * 80, 99])).into()
}

fn folder() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().to_owned();
    (folder, path)
}

#[test]
fn mutations_of_arrays_are_read_or_refused() {
    alone(|| {
        let (_folder, folder) = folder();
        let options = told(Some(FileQuantity::Reflectance), Some("yxb"), false);
        let plain = |path: &Path| read_scene(path, &options);
        let waves = told(Some(FileQuantity::Reflectance), Some("yxb"), true);
        check("npy", &npy_of("<f4", "yxb"), false, &|path| read_scene(path, &waves), &folder.join("made.npy"));
        let zip = zip_of(&[("cube", npy_of("<f4", "yxb")), ("wave", waves_npy())], false);
        check("npz", &zip, false, &plain, &folder.join("made.npz"));
        let cube = variable_of("cube", &[3, 4, 5], 6, &in_order("bxy"));
        let mat = mat_file(&[cube, variable_of("wave", &[5, 1], 6, &super::kinds_tests::WAVE_NM)]);
        check("mat", &mat, false, &plain, &folder.join("made.mat"));
        let own = |path: &Path| read_scene(path, &ReadOptions::default());
        check("mat of ISET", &fixture("iset_scene.mat"), false, &own, &folder.join("made_iset.mat"));
        let mut file = hdf5_pure::FileBuilder::new();
        file.create_dataset("cube").with_data(&in_order("yxb")).with_shape(&[3, 4, 5]);
        file.create_dataset("wave").with_data(&super::kinds_tests::WAVE_NM).with_shape(&[5]);
        check("HDF5", &file.finish().unwrap(), false, &plain, &folder.join("made.h5"));
        check("MATLAB 7.3", &fixture("iset_scene_v73.mat"), false, &own, &folder.join("made_73.mat"));
    });
}

#[test]
fn mutations_of_pictures_are_read_or_refused() {
    alone(|| {
        let (_folder, folder) = folder();
        let plain = |path: &Path| read_scene(path, &ReadOptions::default());
        use image::ImageFormat::{Bmp, Png, Pnm, Tiff, WebP};
        for (name, format) in [("png", Png), ("tif", Tiff), ("bmp", Bmp), ("ppm", Pnm), ("webp", WebP)] {
            check(name, &encoded(rgb(), format), false, &plain, &folder.join(format!("made.{name}")));
        }
        #[cfg(feature = "jpeg")]
        check("jpg", &encoded(rgb(), image::ImageFormat::Jpeg), false, &plain, &folder.join("made.jpg"));
        let pfm = [&b"PF\n2 2\n-1\n"[..], &[0, 0, 0x80, 0x3f].repeat(12)].concat();
        check("pfm", &pfm, false, &plain, &folder.join("made.pfm"));
        let radiance =
            [&b"#?RADIANCE\nEXPOSURE=2\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 3\n"[..], &[128, 128, 128, 129].repeat(6)]
                .concat();
        check("Radiance", &radiance, false, &plain, &folder.join("made.hdr"));
        let planes = ndarray::Array2::from_elem((3, 4), 0.5_f32);
        let exr = folder.join("good.exr");
        let names = [("S0.450,0nm", &planes), ("S0.550,0nm", &planes), ("Z", &planes)];
        crate::write_planes_exr(&exr, &names, crate::ExrSamples::Uncompressed).unwrap();
        check("exr", &fs::read(&exr).unwrap(), false, &plain, &folder.join("made.exr"));
    });
}

#[test]
fn mutations_of_texts_are_read_or_refused() {
    alone(|| {
        let (_folder, folder) = folder();
        let plain = |path: &Path| read_scene(path, &ReadOptions::default());
        let envi = "ENVI\nsamples = 4\nlines = 3\nbands = 5\nheader offset = 0\ndata type = 4\ninterleave = bil\nbyte order = 0\n\
                    wavelength units = um\nwavelength = {0.45, 0.5, 0.56, 0.6,\n 0.65}\nbbl = {1, 1, 0, 1, 1}\n\
                    data gain values = {1, 1, 1, 1, 1}\nreflectance scale factor = 200\nmajor frame offsets = {0, 0}\n";
        fs::write(folder.join("made.raw"), [0, 0, 0x80, 0x3f].repeat(60)).unwrap();
        check("ENVI header", envi.as_bytes(), true, &plain, &folder.join("made.hdr"));
        check("table", b"nm,a,b\n450,0.1,0.2\n550,0.3,0.4\n650,0.5,0.6\n", true, &plain, &folder.join("made.csv"));
        // Files beside a picture: the picture is good, what is said of it is not.
        let picture = folder.join("room.png");
        fs::write(&picture, encoded(rgb(), image::ImageFormat::Png)).unwrap();
        let view = |path: &Path| {
            let mut options = ReadOptions::default();
            options.reading.view = Some(path.to_owned());
            read_scene(&picture, &options)
        };
        let json = r#"{"width": 4, "height": 3, "fx_px": 5.0, "fy_px": 5.0, "cx_px": 1.5, "cy_px": 1.0, "k1": 0.1, "depth_unit_m": 0.001}"#;
        check("camera JSON", json.as_bytes(), true, &view, &folder.join("made.json"));
        let yaml = "%YAML:1.0\n---\nimage_width: 4\nimage_height: 3\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   \
                    data: [5., 0., 1.5, 0., 5., 1., 0., 0., 1.]\ndistortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   \
                    data: [0.1, 0., 0., 0., 0.]\n";
        check("camera YAML", yaml.as_bytes(), true, &view, &folder.join("made.yml"));
        check("COLMAP", b"# cameras\n1 OPENCV 4 3 5 5 2 1.5 0.1 0 0 0\n", true, &view, &folder.join("made_colmap.txt"));
        let depth = |path: &Path| {
            let mut options = ReadOptions { horizontal_fov_deg: Some(20.0), ..ReadOptions::default() };
            (options.reading.depth, options.fill_depth) = (Some(path.to_owned()), Some("far".parse().unwrap()));
            read_scene(&picture, &options)
        };
        check("depth text", b"# m\n1 2 3 4\n5 6 7 8\n1.5 2 2 3\n", true, &depth, &folder.join("made_depth.txt"));
        let codes: Vec<u8> = (1..13_u16).flat_map(|code| (code * 500).to_be_bytes()).collect();
        let pgm = [&b"P5\n# a word\n4 3\n65535\n"[..], &codes].concat();
        check("depth PGM", &pgm, false, &depth, &folder.join("made_depth.pgm"));
        let nerf = r#"{"w": 4, "h": 3, "camera_angle_x": 0.8, "fl_x": 4.731, "cx": 2.0, "cy": 1.5, "frames": []}"#;
        check("transforms.json", nerf.as_bytes(), true, &view, &folder.join("made_transforms.json"));
        let points = "name,x_deg,y_deg,depth_m,candela,light\na lamp,-3,2,0.45,0.02,625nm\nstar,1,2,,1,D65\n";
        check_table(points, &folder.join("points.csv"));
    });
}

/// Reads changed tables of points.
fn check_table(good: &str, path: &Path) {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    for _ in 0..n_cases() {
        fs::write(path, changed(&mut rng, good.as_bytes(), true)).unwrap();
        if let Err(error) = super::PointTable::read(path) {
            let message = error.to_string();
            assert!(message.contains("points.csv") && !message.contains('\n') && message.len() < 1000, "{message}");
        }
    }
}

#[test]
fn mutations_of_stacks_and_parts_are_read_or_refused() {
    alone(|| {
        let (_folder, folder) = folder();
        let plain = |path: &Path| read_scene(path, &ReadOptions::default());
        let mut stack = std::io::Cursor::new(vec![]);
        let mut encoder = tiff::encoder::TiffEncoder::new(&mut stack).unwrap();
        for nm in [450, 550] {
            let mut page = encoder.new_image::<tiff::encoder::colortype::Gray32Float>(4, 3).unwrap();
            page.encoder().write_tag(tiff::tags::Tag::Unknown(285), format!("{nm} nm").as_str()).unwrap();
            let text = r#"{"wavelengths_nm": [450, 550], "gain": 2}"#;
            page.encoder().write_tag(tiff::tags::Tag::ImageDescription, text).unwrap();
            page.write_data(&[0.5; 12]).unwrap();
        }
        let reflecting = told(Some(FileQuantity::Reflectance), None, false);
        let reflecting = ReadOptions { white_level: None, ..reflecting };
        let as_bands = |path: &Path| read_scene(path, &reflecting);
        check("TIFF stack", stack.get_ref(), false, &as_bands, &folder.join("made.tif"));
        // Two parts of an EXR file, of which one lies behind the other.
        let planes = [2.0_f32, 3.0].map(|z_m| [0.5, 0.5, z_m].map(|v| ndarray::Array2::from_elem((3, 4), v)));
        let exr = folder.join("good.exr");
        let names = ["S0.450,0nm", "S0.550,0nm", "Z"].map(|name| [name.to_owned(), format!("hidden.{name}")]);
        let mut channels = vec![];
        for (name, k) in names.iter().zip(0..) {
            channels.extend([(name[0].as_str(), &planes[0][k]), (name[1].as_str(), &planes[1][k])]);
        }
        crate::write_planes_exr(&exr, &channels, crate::ExrSamples::Single).unwrap();
        check("EXR of layers", &fs::read(&exr).unwrap(), false, &plain, &folder.join("made_layers.exr"));
        // A list of wavelengths beside the pictures of a folder.
        let bands = folder.join("wavelengths");
        fs::create_dir(&bands).unwrap();
        for name in ["a_01.png", "a_02.png"] {
            fs::write(bands.join(name), encoded(image::GrayImage::new(4, 3).into(), image::ImageFormat::Png)).unwrap();
        }
        let listed = |_: &Path| read_scene(&bands, &ReadOptions::default());
        check("list of bands", b"450\n550\n", true, &listed, &bands.join("wavelengths.txt"));
    });
}

#[test]
fn mutations_of_depths_are_read_or_refused() {
    alone(|| {
        let (_folder, folder) = folder();
        let picture = folder.join("room.png");
        fs::write(&picture, encoded(rgb(), image::ImageFormat::Png)).unwrap();
        let depth = |path: &Path| {
            let mut options = ReadOptions { horizontal_fov_deg: Some(20.0), ..ReadOptions::default() };
            (options.reading.depth, options.fill_depth) = (Some(path.to_owned()), Some("far".parse().unwrap()));
            options.reading.depth_unit = Some("m".to_owned());
            read_scene(&picture, &options)
        };
        let z_m: Vec<f64> = (2..14).map(f64::from).collect();
        let bytes: Vec<u8> = z_m.iter().flat_map(|v| (*v as f32).to_le_bytes()).collect();
        let npy = super::npy::tests::npy("<f4", false, "(3, 4)", &bytes);
        check("depth npy", &npy, false, &depth, &folder.join("made.npy"));
        let words = super::npy::tests::npy("<f8", false, "(1,)", &2.0_f64.to_le_bytes());
        let zip = zip_of(&[("depth", npy), ("scale", words)], false);
        check("depth npz", &zip, false, &depth, &folder.join("made.npz"));
        let mat = mat_file(&[variable_of("depth", &[3, 4], 6, &z_m)]);
        check("depth mat", &mat, false, &depth, &folder.join("made.mat"));
        let mut file = hdf5_pure::FileBuilder::new();
        file.create_dataset("depth").with_data(&z_m).with_shape(&[3, 4]);
        check("depth HDF5", &file.finish().unwrap(), false, &depth, &folder.join("made.h5"));
        let pfm = [&b"Pf\n4 3\n-1\n"[..], &bytes].concat();
        check("depth PFM", &pfm, false, &depth, &folder.join("made.pfm"));
        let mut tiff = std::io::Cursor::new(vec![]);
        let mut encoder = tiff::encoder::TiffEncoder::new(&mut tiff).unwrap();
        let floats: Vec<f32> = z_m.iter().map(|v| *v as f32).collect();
        encoder.write_image::<tiff::encoder::colortype::Gray32Float>(4, 3, &floats).unwrap();
        check("depth TIFF", tiff.get_ref(), false, &depth, &folder.join("made.tif"));
        let plane = ndarray::Array2::from_shape_vec((3, 4), floats).unwrap();
        let exr = folder.join("good.exr");
        crate::write_planes_exr(&exr, &[("Z", &plane)], crate::ExrSamples::Single).unwrap();
        check("depth EXR", &fs::read(&exr).unwrap(), false, &depth, &folder.join("made.exr"));
    });
}
