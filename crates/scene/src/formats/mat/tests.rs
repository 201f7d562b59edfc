//! MATLAB files that scipy wrote, by `scripts/mat_fixtures.py`, and files that must be refused.

use std::{
    fs,
    path::{Path, PathBuf},
};

use approx::assert_relative_eq;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{super::photons::joules_per_photon, *};
use crate::{FileReading, ReadOptions, SceneError, read_scene};

const WAVE_NM: [f64; 5] = [420.0, 480.0, 550.0, 630.0, 700.0];

fn fixture(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/scenes").join(name)
}

fn read_iset_mat(path: &Path) -> Result<IsetScene, SceneError> {
    match read_mat(path, &FileReading::default())? {
        MatScene::Iset(scene) => Ok(scene),
        MatScene::Cube(_) | MatScene::Linear(..) => panic!("no scene of ISETCam"),
    }
}

fn read(name: &str) -> IsetScene {
    read_iset_mat(&fixture(name)).unwrap()
}

/// Checks photons of 1e15 (1 + row + column / 10 + band / 100), to so many of them.
#[track_caller]
fn check_photons(scene: &IsetScene, within: f64) {
    assert_eq!(scene.image.grid().centers_nm(), WAVE_NM);
    assert_eq!((scene.image.rows(), scene.image.columns()), (4, 6));
    for row in 0..4 {
        for column in 0..6 {
            for (band, watts) in scene.image.spectrum_at(row, column).into_iter().enumerate() {
                let photons = 1e15 * (1.0 + row as f64 + column as f64 / 10.0 + band as f64 / 100.0);
                assert_relative_eq!(watts / joules_per_photon(WAVE_NM[band]), photons, epsilon = within);
            }
        }
    }
}

/// Single precision of the largest, 4.54e15, twice rounded.
const SINGLE: f64 = 1e9;

#[test]
fn a_scene_structure_is_read() {
    // The last is of version 7.3, HDF5.
    for name in ["iset_scene.mat", "iset_plain.mat", "iset_scene_v73.mat"] {
        let scene = read(name);
        check_photons(&scene, SINGLE);
        assert_eq!((scene.horizontal_fov_deg, scene.distance_m), (Some(30.0), Some(1.2)));
        let depth_m = scene.depth_m.unwrap();
        assert_eq!((depth_m.dim(), depth_m[(0, 0)], depth_m[(3, 1)]), ((4, 6), 2.0, 5.5));
        // The radiance of a white under it: equal photons.
        let light = scene.light.unwrap();
        let white = light.illuminant.white_radiance(scene.image.grid(), light.illuminance_lux.unwrap());
        for (watts, nm) in white.iter().zip(WAVE_NM) {
            assert_relative_eq!(watts / joules_per_photon(nm), 8e15, max_relative = 1e-6);
        }
    }
}

#[test]
fn coefficients_and_basis_make_a_scene() {
    let scene = read("iset_multispectral.mat");
    check_photons(&scene, SINGLE);
    let light = scene.light.unwrap();
    let white = light.illuminant.white_radiance(scene.image.grid(), light.illuminance_lux.unwrap());
    white.iter().for_each(|watts| assert_relative_eq!(*watts, 0.01, max_relative = 1e-9));
    assert_eq!((scene.depth_m, scene.distance_m), (None, None));
}

#[test]
fn bare_photons_make_a_scene() {
    let scene = read("iset_raw.mat");
    check_photons(&scene, SINGLE);
    assert_eq!((scene.horizontal_fov_deg, scene.distance_m, scene.light), (Some(20.0), Some(3.0), None));
}

#[test]
fn coded_photons_are_decoded() {
    // Half a step of 16 bits over 3.54e15 photons, and single precision.
    check_photons(&read("iset_coded.mat"), 0.5 * 3.54e15 / 65535.0 + SINGLE);
}

#[test]
fn distances_become_depths_of_the_view() {
    let scene = read_scene(&fixture("iset_scene.mat"), &ReadOptions::default()).unwrap();
    let view = scene.require_view().unwrap();
    assert_relative_eq!(view.horizontal_fov_deg(6), 30.0, max_relative = 1e-12);
    let z_m = f64::from(scene.require_depth().unwrap().z_m()[(3, 1)]);
    assert_relative_eq!(z_m * view.distance_per_depth(3.0, 1.0), 5.5, max_relative = 1e-6);
    // One distance for all is that of a plane.
    let raw = read_scene(&fixture("iset_raw.mat"), &ReadOptions::default()).unwrap();
    assert_eq!(raw.require_depth().unwrap().range_m(), (3.0, 3.0));
    assert_eq!(raw.name, "iset_raw.mat");
}

#[test]
fn a_written_scene_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("again.mat");
    let scene = read_scene(&fixture("iset_scene.mat"), &ReadOptions::default()).unwrap();
    write_iset_scene(&path, &scene).unwrap();
    let again = read_scene(&path, &ReadOptions::default()).unwrap();
    assert_eq!(again.radiance.grid(), scene.radiance.grid());
    for (found, expected) in again.radiance.planes().iter().zip(scene.radiance.planes()) {
        // Photons and energy in single precision.
        found.iter().zip(expected).for_each(|(a, b)| assert_relative_eq!(a, b, max_relative = 3e-7));
    }
    for (found, expected) in again.require_depth().unwrap().z_m().iter().zip(scene.require_depth().unwrap().z_m()) {
        assert_relative_eq!(found, expected, max_relative = 3e-7);
    }
    let (found, expected) = (again.require_view().unwrap(), scene.require_view().unwrap());
    assert_relative_eq!(found.focal_px, expected.focal_px, max_relative = 1e-12);
    let white = |scene: &crate::Scene| {
        let light = scene.light.clone().unwrap();
        light.illuminant.white_radiance(scene.radiance.grid(), light.illuminance_lux.unwrap())
    };
    white(&again).iter().zip(white(&scene)).for_each(|(a, b)| assert_relative_eq!(*a, b, max_relative = 1e-9));
    assert_eq!(again.notes.len(), 1, "{:?}", again.notes);
    // What the format cannot hold is refused, and no file is left.
    let off_axis = scene.cropped(0..4, 0..3).unwrap();
    let path = folder.path().join("part.mat");
    assert!(write_iset_scene(&path, &off_axis).unwrap_err().to_string().contains("axis"));
    assert!(!path.exists());
}

/// Writes an element: its tag, its content and what fills it up to a multiple of 8 bytes, big-endian.
fn element(kind: u32, content: &[u8]) -> Vec<u8> {
    let mut bytes = [kind.to_be_bytes(), (content.len() as u32).to_be_bytes()].concat();
    bytes.extend(content);
    bytes.resize(bytes.len().next_multiple_of(8), 0);
    bytes
}

fn words(values: &[u32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_be_bytes()).collect()
}

/// A variable of numbers, big-endian.
fn variable(name: &str, sides: &[u32], numbers: &[f64]) -> Vec<u8> {
    let doubles: Vec<u8> = numbers.iter().flat_map(|number| number.to_be_bytes()).collect();
    let parts =
        [element(6, &words(&[6, 0])), element(5, &words(sides)), element(1, name.as_bytes()), element(9, &doubles)];
    element(14, &parts.concat())
}

#[test]
fn big_endian_files_are_read() {
    let mut bytes = vec![b' '; 124];
    bytes.extend([1, 0, b'M', b'I']);
    bytes.extend(variable("wave", &[1, 2], &[600.0, 500.0]));
    bytes.extend(variable("photons", &[1, 3, 2], &[1e15, 2e15, 3e15, 4e15, 5e15, 6e15]));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("old.mat");
    fs::write(&path, bytes).unwrap();
    let scene = read_iset_mat(&path).unwrap();
    // Bands that descend are put in order.
    assert_eq!(scene.image.grid().centers_nm(), [500.0, 600.0]);
    let photons =
        scene.image.spectrum_at(0, 1).into_iter().zip([500.0, 600.0]).map(|(w, nm)| w / joules_per_photon(nm));
    photons.zip([5e15, 2e15]).for_each(|(found, expected)| assert_relative_eq!(found, expected, max_relative = 1e-6));
}

#[track_caller]
fn check_refused(bytes: &[u8], word: &str) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bad.mat");
    fs::write(&path, bytes).unwrap();
    let message = read_iset_mat(&path).unwrap_err().to_string();
    assert!(message.contains("bad.mat") && message.contains(word) && !message.contains('\n'), "{message}");
}

#[test]
fn other_files_are_refused_in_a_sentence() {
    let good = fs::read(fixture("iset_plain.mat")).unwrap();
    check_refused(b"", "nor a MATLAB file");
    check_refused(&[b' '; 500], "nor a MATLAB file");
    let new = fs::read(fixture("iset_scene_v73.mat")).unwrap();
    check_refused(&new[..new.len() / 2], "truncated");
    check_refused(&good[..good.len() / 2], "truncated");
    check_refused(&good[..128], "no scene");
    // Twice the bands that the photons have.
    let mut bytes = good[..124].to_vec();
    bytes.extend([1, 0, b'M', b'I']);
    let with = |wave: &[f64], sides: &[u32], n: usize| {
        [bytes.clone(), variable("wave", &[1, wave.len() as u32], wave), variable("photons", sides, &vec![1.0; n])]
            .concat()
    };
    check_refused(&with(&[500.0, 600.0], &[1, 3, 4], 12), "1 × 3 × 4, expected rows × columns × 2");
    check_refused(&with(&[500.0, 500.0], &[1, 3, 2], 6), "bands 1 and 2 lie both at 500 nm");
    check_refused(&with(&[-500.0, 500.0], &[1, 3, 2], 6), "-500 nm");
    check_refused(&with(&[500.0, 600.0], &[1, 300, 2], 6), "600 numbers has 48 bytes");
    check_refused(&with(&[500.0, 600.0], &[u32::MAX, u32::MAX, u32::MAX], 6), "sides");
    check_refused(&with(&[500.0, 600.0], &[0, 3, 2], 0), "samples");
    assert!(matches!(read_iset_mat(&fixture("absent.mat")), Err(SceneError::Unreadable { .. })));
}

#[test]
fn fields_of_structures_are_taken_by_their_names() {
    let field = |name: &str, sides: &[usize], numbers: &[f64]| {
        (name.to_owned(), elements::doubles("", sides, numbers).unwrap())
    };
    let numbers: Vec<f64> = (0..12).map(|i| f64::from(i) / 12.0).collect();
    let fields = [
        field("cube", &[2, 3, 2], &numbers),
        field("wavelengths", &[2, 1], &[450.0, 550.0]),
        field("gain", &[1, 1], &[2.0]),
        ("unit".to_owned(), elements::text("", "W/m2/sr/um").unwrap()),
    ];
    let data = elements::variable(&elements::structure("data", &fields).unwrap()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mat");
    fs::write(&path, [elements::file_head(), data].concat()).unwrap();
    let read = |variable: Option<&str>| {
        let quantity = Some(crate::FileQuantity::Reflectance);
        let reading = crate::FileReading { variable: variable.map(str::to_owned), quantity, ..Default::default() };
        crate::read_scene(&path, &crate::ReadOptions { reading, ..Default::default() })
    };
    let scene = read(Some("data.cube")).unwrap();
    assert_eq!(scene.radiance.grid().centers_nm(), [450.0, 550.0]);
    for left in ["'data.gain'", "'data.unit'"] {
        assert!(scene.notes.join(" ").contains(left), "{:?}", scene.notes);
    }
    for (variable, words) in [
        (None, "or --variable data.cube"),
        (Some("data"), "is a structure, expected numbers: --variable data.cube"),
        (Some("data.cub"), "expected one of data, data.cube, data.wavelengths"),
    ] {
        let message = read(variable).unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    }
}

#[test]
fn a_variable_that_claims_terabytes_is_refused() {
    // A tag of 4 GiB, compressed into a few bytes.
    let mut inner = Vec::new();
    inner.extend(14_u32.to_le_bytes());
    inner.extend(u32::MAX.to_le_bytes());
    let rest = fs::read(fixture("iset_plain.mat")).unwrap();
    inner.extend(&rest[136..]);
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
    std::io::Write::write_all(&mut encoder, &inner).unwrap();
    let packed = encoder.finish().unwrap();
    let mut bytes = rest[..128].to_vec();
    bytes.extend(15_u32.to_le_bytes());
    bytes.extend((packed.len() as u32).to_le_bytes());
    bytes.extend(packed);
    check_refused(&bytes, "claims 4294967295 bytes");
}

#[test]
fn no_mutation_of_a_matlab_file_makes_the_reader_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mat");
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut n_refused = 0;
    for name in ["iset_plain.mat", "iset_scene.mat", "iset_multispectral.mat", "iset_coded.mat"] {
        let whole = fs::read(fixture(name)).unwrap();
        for _ in 0..1000 {
            let mut bytes = whole.clone();
            if rng.random::<f32>() < 0.2 {
                bytes.truncate(rng.random_range(0..whole.len()));
            } else {
                for _ in 0..rng.random_range(1..4) {
                    // Past the text at the start.
                    let at = rng.random_range(124..bytes.len());
                    bytes[at] ^= rng.random_range(1..=255_u8);
                }
            }
            fs::write(&path, &bytes).unwrap();
            n_refused += usize::from(read_scene(&path, &ReadOptions::default()).is_err());
        }
    }
    // Any change of a compressed file is seen; of a plain one many change a sample.
    assert!(n_refused > 2500, "{n_refused} of 4000 refused");
}

/// A file of 3 MB whose variable is inflated to 3.2 GB, refused before it is.
#[test]
fn a_variable_that_fills_the_memory_is_refused() {
    let side = 20_000_u32;
    let mut array = Vec::new();
    let mut words = |words: &[u32]| words.iter().for_each(|word| array.extend(word.to_le_bytes()));
    words(&[14, 8 * side * side + 56, 6, 8, 6, 0, 5, 8, side, side, 1, 7]);
    array.extend(*b"photons\0");
    array.extend([9_u32, 8 * side * side].iter().flat_map(|word| word.to_le_bytes()));
    array.resize(600, 0);
    let mut packed = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut packed, &array).unwrap();
    let mut packed = packed.finish().unwrap();
    packed.resize(3_200_000, 0);
    let mut bytes = vec![b' '; 124];
    bytes.extend([0, 1, b'I', b'M']);
    bytes.extend([15_u32, packed.len() as u32].iter().flat_map(|word| word.to_le_bytes()));
    bytes.extend(packed);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large.mat");
    fs::write(&path, bytes).unwrap();
    let message = read_iset_mat(&path).unwrap_err().to_string();
    assert!(message.contains("large.mat: it would take 6.0 GiB of memory"), "{message}");
}

/// Writes an array of three axes as netCDF has it: its dimensions by their numbers, each with its name and length.
fn netcdf(path: &Path, dimensions: [(&str, usize); 3], values: &[f64]) {
    use hdf5_pure::AttrValue;
    let mut file = hdf5_pure::FileBuilder::new();
    // Their numbers are not in the order of the axes.
    for (place, (name, length)) in dimensions.iter().enumerate() {
        let is_bare = *name != "wavelength";
        let data: Vec<f64> = (0..*length).map(|i| if is_bare { 0.0 } else { 450.0 + 50.0 * i as f64 }).collect();
        let scale = file.create_dataset(name).with_data(&data).with_shape(&[*length as u64]);
        let own = if is_bare {
            format!("This is a netCDF dimension but not a netCDF variable.{length:10}")
        } else {
            (*name).to_owned()
        };
        scale.set_attr("CLASS", AttrValue::AsciiString("DIMENSION_SCALE".to_owned()));
        scale.set_attr("NAME", AttrValue::AsciiString(own));
        scale.set_attr("_Netcdf4Dimid", AttrValue::I32(2 - place as i32));
    }
    let shape = dimensions.map(|(_, length)| length as u64);
    let cube = file.create_dataset("r").with_data(values).with_shape(&shape);
    cube.set_attr("_Netcdf4Coordinates", AttrValue::I32Array(vec![2, 1, 0]));
    fs::write(path, file.finish().unwrap()).unwrap();
}

#[test]
fn dimensions_of_netcdf_say_which_axis_is_which() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.nc");
    let reading = FileReading { quantity: Some(crate::FileQuantity::Reflectance), ..FileReading::default() };
    // Row, column and band in the digits of a number; also where all sides are alike.
    for (n_rows, n_columns) in [(2, 3), (4, 4)] {
        let length = |name: &str| match name {
            "y" => n_rows,
            "x" => n_columns,
            _ => 4,
        };
        for names in
            [["x", "y", "wavelength"], ["wavelength", "y", "x"], ["y", "x", "wavelength"], ["y", "wavelength", "x"]]
        {
            let [a, b, c] = names.map(length);
            let value = |index: usize| {
                let place = [index / (b * c), index / c % b, index % c];
                let at = |name: &str| place[names.iter().position(|own| *own == name).unwrap()] as f64;
                at("y") / 10.0 + at("x") / 100.0 + at("wavelength") / 1000.0
            };
            let values: Vec<f64> = (0..a * b * c).map(value).collect();
            netcdf(&path, names.map(|name| (name, length(name))), &values);
            let Ok(MatScene::Cube(cube)) = read_mat(&path, &reading) else { panic!("a cube") };
            assert_eq!((cube.planes.len(), cube.planes[0].dim()), (4, (n_rows, n_columns)), "{names:?}");
            assert_relative_eq!(cube.planes[3][(1, 2)], 0.123, epsilon = 1e-6);
            assert_eq!(cube.notes, [""; 0]);
        }
    }
    // A depth of columns and rows.
    let mut file = hdf5_pure::FileBuilder::new();
    let depth = file.create_dataset("depth").with_data(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]).with_shape(&[3, 2]);
    depth.set_attr(
        "DIMENSION_LABELS",
        hdf5_pure::AttrValue::VarLenStringArray(vec!["lon".to_owned(), "lat".to_owned()]),
    );
    fs::write(&path, file.finish().unwrap()).unwrap();
    let plane = read_plane(&path, None).unwrap().of_own_file().values;
    assert_eq!(plane, ndarray::arr2(&[[1.0, 3.0, 5.0], [2.0, 4.0, 6.0]]));
}

#[test]
fn true_is_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mat");
    let waves = fixtures::variable_of("wave", &[2, 1], 6, &[450.0, 550.0]);
    let cube = fixtures::variable_of("cube", &[2, 3, 2], fixtures::LOGICAL_BYTES, &[1.0; 12]);
    fs::write(&path, fixtures::mat_file(&[cube, waves])).unwrap();
    let Ok(MatScene::Cube(cube)) = read_mat(&path, &FileReading::default()) else { panic!("a cube") };
    assert_eq!((cube.top, cube.planes[1][(1, 2)]), (Some(1.0), 1.0));
}
