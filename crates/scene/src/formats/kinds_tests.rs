//! Cubes as every program writes them, with their truth beside: each type, order of axes, order of bytes and unit.

use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
};

use dioptric_spectrum::Illuminant;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{
    FileQuantity, FileReading, ReadOptions,
    mat::fixtures::{mat_file, variable_of},
    npy::tests::npy,
    photons::joules_per_photon,
    read_scene,
    word_tests::n_cases,
};

pub(super) const ROWS: usize = 3;
pub(super) const COLUMNS: usize = 4;
pub(super) const WAVE_NM: [f64; 5] = [450.0, 500.0, 560.0, 600.0, 650.0];
/// What a perfect white has.
const WHITE: f64 = 200.0;

/// The number of a sample: whole, so that every type holds it.
fn truth(row: usize, column: usize, band: usize) -> f64 {
    (40 * band + 10 * row + column) as f64
}

/// Returns all numbers in the order of axes that a text says, the last the fastest.
pub(super) fn in_order(axes: &str) -> Vec<f64> {
    let size = |axis: char| match axis {
        'y' => ROWS,
        'x' => COLUMNS,
        _ => WAVE_NM.len(),
    };
    let letters: Vec<char> = axes.chars().collect();
    let mut values = vec![];
    for a in 0..size(letters[0]) {
        for b in 0..size(letters[1]) {
            for c in 0..size(letters[2]) {
                let of = |axis: char| [a, b, c][letters.iter().position(|own| *own == axis).unwrap()];
                values.push(truth(of('y'), of('x'), of('b')));
            }
        }
    }
    values
}

pub(super) fn sides(axes: &str) -> Vec<usize> {
    axes.chars()
        .map(|axis| match axis {
            'y' => ROWS,
            'x' => COLUMNS,
            _ => WAVE_NM.len(),
        })
        .collect()
}

/// Checks a file against the truth: reflectances under D65, or radiance at so many watts a number.
#[track_caller]
fn check(path: &Path, options: &ReadOptions, watts: Option<&dyn Fn(f64) -> f64>, what: &str) {
    let scene = read_scene(path, options).unwrap_or_else(|error| panic!("{what}: {error}"));
    assert_eq!((scene.rows(), scene.columns()), (ROWS, COLUMNS), "{what}");
    assert_eq!(scene.radiance.grid().centers_nm(), WAVE_NM, "{what}");
    let white = Illuminant::D65.white_radiance(scene.radiance.grid(), 1000.0);
    for row in 0..ROWS {
        for column in 0..COLUMNS {
            for (band, found) in scene.radiance.spectrum_at(row, column).into_iter().enumerate() {
                let number = truth(row, column, band);
                let expected = match watts {
                    Some(watts) => number * watts(WAVE_NM[band]),
                    None => number / WHITE * white[band],
                };
                // Three roundings to single precision.
                assert!(
                    (found - expected).abs() <= 3e-7 * expected,
                    "{what}: {found} for {expected} at {row}, {column}, {band}"
                );
            }
        }
    }
}

/// What is said of a cube that says nothing.
pub(super) fn told(quantity: Option<FileQuantity>, axes: Option<&str>, with_waves: bool) -> ReadOptions {
    let reading = FileReading {
        quantity,
        axes: axes.map(str::to_owned),
        wavelengths_nm: with_waves.then(|| WAVE_NM.to_vec()),
        ..FileReading::default()
    };
    let white_level = (quantity == Some(FileQuantity::Reflectance)).then_some(WHITE);
    ReadOptions { reading, white_level, ..ReadOptions::default() }
}

const AXES: [&str; 6] = ["yxb", "xyb", "byx", "bxy", "ybx", "xby"];

/// Quantities that may be told, with the watts of a number.
type Told = (FileQuantity, Option<fn(f64) -> f64>);
const QUANTITIES: [Told; 3] = [
    (FileQuantity::Reflectance, None),
    (FileQuantity::Radiance, Some(|_| 1.0)),
    (FileQuantity::Photons, Some(joules_per_photon)),
];

fn watts_of(of: Option<fn(f64) -> f64>) -> Option<Box<dyn Fn(f64) -> f64>> {
    of.map(|of| Box::new(of) as Box<dyn Fn(f64) -> f64>)
}

pub(super) fn folder_and(name: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    (folder, path)
}

/// Bytes of whole numbers as a type of `NumPy`.
pub(super) fn bytes_as(descr: &str, values: &[f64]) -> Vec<u8> {
    let is_big = descr.starts_with('>');
    values
        .iter()
        .flat_map(|&v| {
            let mut bytes = match &descr[1..] {
                "u1" => vec![v as u8],
                "u2" => (v as u16).to_le_bytes().to_vec(),
                "i2" => (v as i16).to_le_bytes().to_vec(),
                "u4" => (v as u32).to_le_bytes().to_vec(),
                "i4" => (v as i32).to_le_bytes().to_vec(),
                "i8" => (v as i64).to_le_bytes().to_vec(),
                "u8" => (v as u64).to_le_bytes().to_vec(),
                "f4" => (v as f32).to_le_bytes().to_vec(),
                _ => v.to_le_bytes().to_vec(),
            };
            if is_big {
                bytes.reverse();
            }
            bytes
        })
        .collect()
}

const TYPES: [&str; 9] = ["|u1", "<u2", ">u2", "<i2", ">i4", "<f4", ">f4", "<f8", "<i8"];

pub(super) fn npy_of(descr: &str, axes: &str) -> Vec<u8> {
    let shape = format!("({})", sides(axes).iter().map(ToString::to_string).collect::<Vec<_>>().join(", "));
    npy(descr, false, &shape, &bytes_as(descr, &in_order(axes)))
}

pub(super) fn zip_of(entries: &[(&str, Vec<u8>)], is_deflated: bool) -> Vec<u8> {
    let mut writer = zip::ZipWriter::new(std::io::Cursor::new(vec![]));
    let method = if is_deflated { zip::CompressionMethod::Deflated } else { zip::CompressionMethod::Stored };
    let how = zip::write::SimpleFileOptions::default().compression_method(method);
    for (name, bytes) in entries {
        writer.start_file(format!("{name}.npy"), how).unwrap();
        writer.write_all(bytes).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

pub(super) fn waves_npy() -> Vec<u8> {
    npy("<f8", false, "(5,)", &bytes_as("<f8", &WAVE_NM))
}

#[test]
fn arrays_of_numpy_of_every_kind_are_right() {
    let (_folder, path) = folder_and("a.npy");
    let (_other, packed) = folder_and("a.npz");
    for descr in TYPES {
        for axes in AXES {
            for (quantity, watts) in QUANTITIES {
                let what = format!("{descr} {axes} {quantity:?}");
                let watts = watts_of(watts);
                fs::write(&path, npy_of(descr, axes)).unwrap();
                check(&path, &told(Some(quantity), Some(axes), true), watts.as_deref(), &what);
                let bytes = zip_of(&[("cube", npy_of(descr, axes)), ("wavelengths", waves_npy())], axes == "yxb");
                fs::write(&packed, bytes).unwrap();
                check(&packed, &told(Some(quantity), Some(axes), false), watts.as_deref(), &format!("npz of {what}"));
            }
        }
    }
}

#[test]
fn hdf5_of_every_kind_is_right() {
    let (_folder, path) = folder_and("a.h5");
    let mut n = 0;
    for axes in AXES {
        for (kind, is_chunked) in [(0, false), (1, true), (2, false), (3, true)] {
            let (values, shape) = (in_order(axes), sides(axes).iter().map(|side| *side as u64).collect::<Vec<u64>>());
            let mut file = hdf5_pure::FileBuilder::new();
            let mut group = file.create_group("data");
            let dataset = group.create_dataset("cube");
            match kind {
                0 => dataset.with_data(&values),
                1 => dataset.with_data(&values.iter().map(|v| *v as f32).collect::<Vec<_>>()),
                2 => dataset.with_data(&values.iter().map(|v| *v as u16).collect::<Vec<_>>()),
                _ => dataset.with_data(&values.iter().map(|v| *v as u8).collect::<Vec<_>>()),
            };
            dataset.with_shape(&shape);
            if is_chunked {
                dataset.with_chunks(&[2, 2, 2]).with_deflate(4);
            }
            group.create_dataset("wavelength").with_data(&WAVE_NM).with_shape(&[5]);
            file.add_group(group.finish());
            fs::write(&path, file.finish().unwrap()).unwrap();
            for (quantity, watts) in QUANTITIES {
                let watts = watts_of(watts);
                check(
                    &path,
                    &told(Some(quantity), Some(axes), false),
                    watts.as_deref(),
                    &format!("h5 {kind} {axes} {quantity:?}"),
                );
                n += 1;
            }
        }
    }
    assert_eq!(n, 72);
}

#[test]
fn matlab_files_of_every_kind_are_right() {
    let (_folder, path) = folder_and("a.mat");
    for axes in AXES {
        for class in [6, 7, 9, 11, 13] {
            // MATLAB has the first index as the fastest: the numbers in the order of the axes turned round.
            let turned: String = axes.chars().rev().collect();
            let cube = variable_of("cube", &sides(axes), class, &in_order(&turned));
            let bytes = mat_file(&[cube, variable_of("bands", &[1, 5], 6, &WAVE_NM)]);
            fs::write(&path, bytes).unwrap();
            for (quantity, watts) in QUANTITIES {
                let watts = watts_of(watts);
                let what = format!("mat of class {class} {axes} {quantity:?}");
                check(&path, &told(Some(quantity), Some(axes), false), watts.as_deref(), &what);
            }
        }
    }
}

#[test]
fn envi_files_of_every_kind_are_right() {
    let (_folder, path) = folder_and("a.hdr");
    let units: [(&str, f64); 3] = [("nm", 1.0), ("Micrometers", 1e-3), ("Nanometers", 1.0)];
    for (data_type, descr) in
        [(1, "|u1"), (2, "<i2"), (3, "<i4"), (4, "<f4"), (5, "<f8"), (12, "<u2"), (13, "<u4"), (14, "<i8")]
    {
        for (interleave, axes) in [("bsq", "byx"), ("bil", "ybx"), ("bip", "yxb")] {
            for (order, (unit, factor)) in [0, 1].into_iter().flat_map(|order| units.map(|unit| (order, unit))) {
                let descr = if order == 1 { descr.replace(['<', '|'], ">") } else { descr.to_owned() };
                fs::write(path.with_extension("raw"), bytes_as(&descr, &in_order(axes))).unwrap();
                let waves = WAVE_NM.map(|nm| (factor * nm).to_string()).join(", ");
                let head = format!(
                    "ENVI\nsamples = {COLUMNS}\nlines = {ROWS}\nbands = 5\nheader offset = 0\ndata type = {data_type}\ninterleave = \
                     {interleave}\nbyte order = {order}\nwavelength units = {unit}\nwavelength = {{{waves}}}\n"
                );
                let what = format!("envi {data_type} {interleave} {order} {unit}");
                let with = |line: &str| fs::write(&path, format!("{head}{line}\n")).unwrap();
                with(&format!("reflectance scale factor = {WHITE}"));
                check(&path, &ReadOptions::default(), None, &what);
                with("data units = uW/(cm^2 sr nm)");
                check(&path, &ReadOptions::default(), Some(&|_| 0.01), &what);
                with("data units = photons/s/m^2/sr/nm");
                check(&path, &ReadOptions::default(), Some(&joules_per_photon), &what);
                with("data gain values = {2, 2, 2, 2, 2}");
                // Gains without a unit are those of ENVI, a micrometre.
                check(&path, &ReadOptions::default(), Some(&|_| 2e-3), &what);
            }
        }
    }
}

/// Any change of bytes is read or refused in a sentence.
#[test]
fn no_mutation_of_an_array_makes_a_reader_panic() {
    let mut rng = ChaCha8Rng::seed_from_u64(13);
    let (folder, _) = folder_and("a");
    let mut file = hdf5_pure::FileBuilder::new();
    file.create_dataset("cube")
        .with_data(&in_order("yxb"))
        .with_shape(&[3, 4, 5])
        .with_chunks(&[2, 2, 2])
        .with_deflate(4);
    file.create_dataset("wave").with_data(&WAVE_NM).with_shape(&[5]);
    let v73 = fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/scenes/iset_scene_v73.mat")).unwrap();
    let table = "nm,a,b\n450,0.1,0.2\n500,0.1,0.3\n600,0.2,0.3\n";
    for (name, whole) in [
        ("a.h5", file.finish().unwrap()),
        ("b.mat", v73),
        ("c.npz", zip_of(&[("cube", npy_of("<f4", "yxb")), ("wave", waves_npy())], true)),
        ("d.csv", table.as_bytes().to_vec()),
    ] {
        let path = folder.path().join(name);
        for _ in 0..n_cases() * 5 {
            let mut bytes = whole.clone();
            if rng.random::<f32>() < 0.2 {
                bytes.truncate(rng.random_range(0..whole.len()));
            } else {
                for _ in 0..rng.random_range(1..4) {
                    let at = rng.random_range(0..bytes.len());
                    bytes[at] ^= rng.random_range(1..=255_u8);
                }
            }
            fs::write(&path, &bytes).unwrap();
            if let Err(error) = read_scene(&path, &told(Some(FileQuantity::Reflectance), None, false)) {
                let message = error.to_string();
                assert!(message.contains(name) && !message.contains('\n'), "{message}");
            }
        }
    }
}
