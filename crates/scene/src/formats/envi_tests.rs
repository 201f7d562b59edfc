//! ENVI files of every order and type, with what their headers say.

use super::*;
use crate::{FileReading, Part, ReadOptions};
use ndarray::Array2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn read_with(path: &Path, options: &ReadOptions) -> Result<(SpectralImage, Vec<String>), SceneError> {
    let contents = contents_of_envi(path, options)?;
    match contents.image {
        Image::Spectral(image) => Ok((image, contents.notes)),
        _ => panic!("a picture"),
    }
}

/// Reads the numbers as they are.
fn read_plain(path: &Path) -> Result<SpectralImage, SceneError> {
    Ok(read_with(path, &ReadOptions { white_level: Some(1.0), ..ReadOptions::default() })?.0)
}

/// The number of sample (band, row, column) of the test cubes.
fn value(band: usize, row: usize, column: usize) -> u8 {
    (100 * band + 10 * row + column) as u8
}

fn header(data_type: u8, interleave: &str, order: u8) -> String {
    format!(
        "ENVI\nsamples = 3\nlines = 4\nbands = 2\nheader offset = 5\ndata type = {data_type}\n\
         interleave = {interleave}\nbyte order = {order}\nwavelength units = nm\nwavelength = {{600, 500}}\n"
    )
}

fn bytes_of(v: u8, data_type: u8) -> Vec<u8> {
    match data_type {
        1 => vec![v],
        2 => i16::from(v).to_le_bytes().to_vec(),
        3 => i32::from(v).to_le_bytes().to_vec(),
        4 => f32::from(v).to_le_bytes().to_vec(),
        5 => f64::from(v).to_le_bytes().to_vec(),
        12 => u16::from(v).to_le_bytes().to_vec(),
        13 => u32::from(v).to_le_bytes().to_vec(),
        14 => i64::from(v).to_le_bytes().to_vec(),
        _ => u64::from(v).to_le_bytes().to_vec(),
    }
}

fn samples(data_type: u8, interleave: &str, order: u8) -> Vec<u8> {
    let mut bytes = vec![0xAA; 5];
    for i in 0..24 {
        let (band, row, column) = match interleave {
            "bsq" => (i / 12, i / 3 % 4, i % 3),
            "bil" => (i / 3 % 2, i / 6, i % 3),
            _ => (i % 2, i / 6, i / 2 % 3),
        };
        let mut number = bytes_of(value(band, row, column), data_type);
        if order == 1 {
            number.reverse();
        }
        bytes.extend(number);
    }
    bytes
}

fn write(folder: &Path, name: &str, header: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(format!("{name}.hdr"));
    fs::write(&path, header).unwrap();
    fs::write(folder.join(format!("{name}.raw")), bytes).unwrap();
    path
}

#[test]
fn every_order_and_type_gives_the_same_cube() {
    let folder = tempfile::tempdir().unwrap();
    for interleave in ["bsq", "bil", "bip"] {
        for data_type in [1, 2, 3, 4, 5, 12, 13, 14, 15] {
            for order in [0, 1] {
                let text = header(data_type, interleave, order);
                let path = write(folder.path(), "a", &text, &samples(data_type, interleave, order));
                let cube = read_plain(&path).unwrap();
                // The header lists the bands downwards; they come back upwards.
                assert_eq!(cube.grid().centers_nm(), [500.0, 600.0]);
                for (place, band) in [(0, 1), (1, 0)] {
                    let expected = Array2::from_shape_fn((4, 3), |(r, c)| f32::from(value(band, r, c)));
                    assert_eq!(cube.planes()[place], expected, "{interleave} {data_type} {order}");
                }
            }
        }
    }
}

#[test]
fn white_is_reported_by_the_caller_the_header_or_references() {
    let folder = tempfile::tempdir().unwrap();
    let (text, bytes) = (header(1, "bsq", 0), samples(1, "bsq", 0));
    let path = write(folder.path(), "a", &text, &bytes);
    let open = |path: &Path| read_with(path, &ReadOptions::default()).map(|(image, _)| image);
    let message = open(&path).unwrap_err().to_string();
    assert!(message.contains("a.hdr") && message.contains("reflectance scale factor"), "{message}");
    let told = ReadOptions { white_level: Some(100.0), ..ReadOptions::default() };
    let (given, _) = read_with(&path, &told).unwrap();
    assert_eq!(given.spectrum_at(0, 1), [1.01_f32, 0.01].map(f64::from));
    let scaled = write(folder.path(), "b", &format!("{text}reflectance scale factor = 100\n"), &bytes);
    assert_eq!(open(&scaled).unwrap(), given);
    write(folder.path(), "white_reference_1", &text, &[201; 29]);
    write(folder.path(), "dark_reference_1", &text, &[1; 29]);
    let referred = open(&path).unwrap();
    // (101 − 1) / (201 − 1), and a sample below the dark is 0.
    assert_eq!(referred.spectrum_at(0, 1)[0], 0.5);
    assert_eq!(referred.spectrum_at(0, 0)[1], 0.0);
    // References of other lengths count by their mean line.
    let lines = text.replace("lines = 4", "lines = 2").replace("header offset = 5", "header offset = 0");
    write(folder.path(), "white_reference_1", &lines, &[200, 200, 200, 202, 202, 202, 200, 200, 200, 202, 202, 202]);
    assert_eq!(open(&path).unwrap(), referred);
    // A white of half the time is half as bright; what one of them alone states is named.
    write(folder.path(), "white_reference_1", &format!("{text}tint = 5\nexposure = 3\n"), &[101; 29]);
    write(folder.path(), "dark_reference_1", &format!("{text}tint = 10\nzorpal = 1\n"), &[1; 29]);
    let path = write(folder.path(), "a", &format!("{text}tint = 10\n"), &bytes);
    let (image, notes) = read_with(&path, &ReadOptions::default()).unwrap();
    assert_eq!(image, referred);
    let expected = [
        "dark_reference_1.hdr: its key 'zorpal' is not used",
        "white_reference_1.hdr: its tint is 5, that of a.hdr 10: its light is multiplied by 2",
        "white_reference_1.hdr: its key 'exposure' is not used",
    ];
    assert_eq!(notes[..3], expected, "{notes:?}");
    write(folder.path(), "white_reference_1", &text, &[201; 29]);
    write(folder.path(), "dark_reference_1", &text, &[1; 29]);
    let (image, notes) = read_with(&path, &ReadOptions::default()).unwrap();
    assert_eq!((image, notes[0].as_str()), (referred, "a.hdr: its key 'tint' is not used"));
    // Bands are those of the cube in its order; what a reference's numbers are besides is named.
    for (bands, words) in [("500, 600", "a band at 500 nm where"), ("610, 510", "a band at 610 nm where")] {
        write(folder.path(), "white_reference_1", &text.replace("600, 500", bands), &[201; 29]);
        let message = open(&path).unwrap_err().to_string();
        assert!(message.contains("white_reference_1.hdr") && message.contains(words), "{message}");
    }
    write(folder.path(), "white_reference_1", &format!("{text}reflectance scale factor = 50\n"), &[201; 29]);
    let (_, notes) = read_with(&path, &ReadOptions::default()).unwrap();
    assert!(notes.iter().any(|note| note.contains("its key 'reflectance scale factor' is not used")), "{notes:?}");
    for (unit, factor) in [("Micrometers", 1e-3), ("Angstroms", 10.0), ("eV", 0.0)] {
        let stated = match factor {
            0.0 => "2.06640331, 2.47968397".to_owned(),
            factor => format!("{}, {}", 600.0 * factor, 500.0 * factor),
        };
        let other = text.replace("units = nm", &format!("units = {unit}")).replace("600, 500", &stated);
        let own = write(folder.path(), "d", &format!("{other}reflectance scale factor = 100\n"), &bytes);
        let found = open(&own).unwrap().grid().centers_nm().to_vec();
        assert!((found[0] - 500.0).abs() < 1e-5 && (found[1] - 600.0).abs() < 1e-5, "{unit}: {found:?}");
    }
    let far = write(folder.path(), "e", &text.replace("units = nm", "units = um"), &bytes);
    assert!(open(&far).unwrap_err().to_string().contains("600 in um is no wavelength of light"));
    let units = write(folder.path(), "c", &format!("{text}data units = W/m^2/sr/nm\n"), &bytes);
    assert_eq!(open(&units).unwrap().quantity(), Quantity::Radiance);
    // Where nothing else does, the title of the values states their unit.
    let of_watts = open(&units).unwrap().spectrum_at(1, 2);
    let plotted = format!("{text}z plot titles = {{Wavelength (nm), Radiance (uW/cm2/sr/nm)}}\n");
    let plotted = open(&write(folder.path(), "f", &plotted, &bytes)).unwrap();
    assert_eq!(plotted.quantity(), Quantity::Radiance);
    for (plotted, watts) in plotted.spectrum_at(1, 2).into_iter().zip(of_watts) {
        assert!(watts > 0.0 && (plotted / (0.01 * watts) - 1.0).abs() < 1e-6, "{plotted} {watts}");
    }
}

#[test]
fn what_titles_and_descriptions_say_of_numbers_is_obeyed_or_named() {
    let folder = tempfile::tempdir().unwrap();
    let (text, bytes) = (header(4, "bsq", 0), samples(4, "bsq", 0));
    let read = |more: &str, quantity: FileQuantity, unit: Option<&str>| {
        let path = write(folder.path(), "a", &format!("{text}{more}\n"), &bytes);
        let reading = FileReading { quantity: Some(quantity), unit: unit.map(str::to_owned), ..FileReading::default() };
        read_with(&path, &ReadOptions { reading, ..ReadOptions::default() })
            .map(|(image, notes)| (image.spectrum_at(1, 2), notes.join("\n")))
            .map_err(|error| error.to_string())
    };
    let (light, shares) = (FileQuantity::Radiance, FileQuantity::Reflectance);
    let (plain, notes) = read("", light, None).unwrap();
    assert_eq!(notes, "");
    for (more, factor) in [
        ("description = {EMIT L1B calibrated spectral\n radiance (units: uW nm-1 cm-2 sr-1)}", 0.01),
        ("z plot titles = {Wavelength (nm), Radiance W/m2/sr/um}", 1e-3),
        ("data units = Radiance (W/m2/sr/um)", 1e-3),
        ("description = {File imported}\nz plot titles = {Wavelength, Radiance}", 1.0),
    ] {
        let (found, notes) = read(more, light, None).unwrap();
        assert_eq!(notes, "", "{more}");
        for (found, plain) in found.iter().zip(&plain) {
            assert!((found / (factor * plain) - 1.0).abs() < 1e-6, "{more}: {found} {plain}");
        }
    }
    for (more, quantity, words) in [
        ("z plot titles = {Wavelength, Counts}", light, "unit 'Counts' is not used"),
        ("z plot titles = {Wavelength, Brightness Temperature (K)}", light, "Temperature (K)' is not used"),
        ("z plot titles = {Wavelength, Absorbance}", shares, "'Absorbance' is not used"),
        ("description = {top of atmosphere reflectance * 10000}", shares, "reflectance * 10000' is not used"),
    ] {
        let (_, notes) = read(more, quantity, None).unwrap();
        assert!(notes.contains(words), "{more}: {notes}");
    }
    for (more, words) in [
        ("z plot titles = {Wavelength, Reflectance (%)}", "says that it is a reflectance"),
        ("z plot titles = {Wavelength, Reflectance}", "says that it is a reflectance"),
        ("data units = uW/cm^2/nm", "'uW/cm^2/nm', of irradiance: expected the unit of its radiance (--unit)"),
        ("data units = photons/s/m2/nm", "of irradiance"),
        ("data units = W/m^2", "of irradiance"),
    ] {
        let message = read(more, light, None).unwrap_err();
        assert!(message.contains(words), "{more}: {message}");
    }
    let (_, notes) = read("data units = uW/cm^2/nm", light, Some("uW/cm^2/sr/nm")).unwrap();
    assert!(notes.contains("unit 'uW/cm^2/nm' is not used"), "{notes}");
}

#[test]
fn references_are_known_as_cameras_call_them() {
    let folder = tempfile::tempdir().unwrap();
    let (text, bytes) = (header(1, "bsq", 0), samples(1, "bsq", 0));
    let path = write(folder.path(), "451", &text, &bytes);
    // Specim's of another cube count where there are no others.
    for (white, dark, level) in [
        ("WHITEREF_450", "DARKREF_450", 101),
        ("whiteReference", "darkReference", 101),
        ("451_white_reference", "451_dark_reference", 201),
        ("WHITEREF_451", "DARKREF_451", 201),
    ] {
        write(folder.path(), white, &text, &[level; 29]);
        write(folder.path(), dark, &text, &[1; 29]);
        let (image, _) = read_with(&path, &ReadOptions::default()).unwrap();
        assert_eq!(image.spectrum_at(0, 1)[0], 100.0 / f64::from(level - 1), "{white}");
        let told = ReadOptions { white_level: Some(100.0), ..ReadOptions::default() };
        let (_, notes) = read_with(&path, &told).unwrap();
        assert!(notes.iter().any(|note| note.contains(&format!("'{white}.hdr'"))), "{notes:?}");
    }
}

#[test]
fn a_black_body_is_one_in_every_unit() {
    // Planck's law by its variable, with constants of CODATA 2018.
    const H: f64 = 6.626_070_15e-34;
    const C: f64 = 299_792_458.0;
    const KT: f64 = 1.380_649e-23 * 5000.0;
    const EV: f64 = 1.602_176_634e-19;
    let bose = |joules: f64| 1.0 / (joules / KT).exp_m1();
    let folder = tempfile::tempdir().unwrap();
    let text = header(4, "bsq", 0).replace("header offset = 5", "header offset = 0");
    let per_nm = |m: f64| 1e-9 * 2.0 * H * C.powi(2) / m.powi(5) * bose(H * C / m);
    let per_hz = |m: f64| 2.0 * H * (C / m).powi(3) / C.powi(2) * bose(H * C / m);
    let laws: [(&str, &dyn Fn(f64) -> f64); 9] = [
        ("W/m^2/sr/nm", &per_nm),
        ("uW/cm^2/sr/nm", &|m| 100.0 * per_nm(m)),
        ("photons/s/m^2/sr/nm", &|m| per_nm(m) * m / (H * C)),
        ("W/m^2/sr/Hz", &per_hz),
        ("W m-2 sr-1 THz-1", &|m| 1e12 * per_hz(m)),
        ("W/m^2/sr/cm^-1", &|m| 100.0 * 2.0 * H * C.powi(2) / m.powi(3) * bose(H * C / m)),
        ("mW m-2 sr-1 (cm-1)-1", &|m| 1e5 * 2.0 * H * C.powi(2) / m.powi(3) * bose(H * C / m)),
        ("W/m^2/sr/eV", &|m| 2.0 * (H * C / m).powi(3) / (H.powi(3) * C.powi(2)) * bose(H * C / m) * EV),
        ("photons/s/m^2/sr/eV", &|m| 2.0 * (H * C / m).powi(2) / (H.powi(3) * C.powi(2)) * bose(H * C / m) * EV),
    ];
    for (unit, law) in laws {
        let bytes: Vec<u8> =
            [600e-9, 500e-9].into_iter().flat_map(|m| (law(m) as f32).to_le_bytes().repeat(12)).collect();
        let path = write(folder.path(), "a", &format!("{text}data units = {unit}\n"), &bytes);
        let (image, _) = read_with(&path, &ReadOptions::default()).unwrap();
        for (own, m) in image.spectrum_at(2, 1).into_iter().zip([500e-9, 600e-9]) {
            approx::assert_relative_eq!(own, per_nm(m), max_relative = 2e-7);
        }
    }
}

#[test]
fn references_of_other_settings_and_those_that_do_not_count_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let (text, bytes) = (header(1, "bsq", 0), samples(1, "bsq", 0));
    write(folder.path(), "dark_reference_1", &text, &[1; 29]);
    // A factor that is told counts with references too.
    write(folder.path(), "white_reference_1", &format!("{text}binning = {{2, 2}}\n"), &[201; 29]);
    let binned = write(folder.path(), "b", &format!("{text}binning = {{1, 1}}\n"), &bytes);
    let scaled = |scale: Option<f64>| {
        let reading = FileReading { scale, ..FileReading::default() };
        read_with(&binned, &ReadOptions { reading, ..ReadOptions::default() }).unwrap()
    };
    let ((plain, notes), (double, _)) = (scaled(None), scaled(Some(2.0)));
    assert_eq!(double.planes()[1][(3, 2)], 2.0 * plain.planes()[1][(3, 2)]);
    let expected =
        "white_reference_1.hdr: its binning is {2,2}, that of b.hdr {1,1}: its numbers are taken as they are";
    assert!(notes.iter().any(|note| note == expected), "{notes:?}");
    // References beside a cube that says itself what its numbers are.
    let factor = write(folder.path(), "c", &format!("{text}reflectance scale factor = 50\n"), &bytes);
    let (_, notes) = read_with(&factor, &ReadOptions::default()).unwrap();
    let expected = "c.hdr: its references 'white_reference_1.hdr', 'dark_reference_1.hdr' are not used";
    assert!(notes.iter().any(|note| note == expected), "{notes:?}");
}

#[test]
fn gains_offsets_and_scale_factors_are_obeyed() {
    let folder = tempfile::tempdir().unwrap();
    let (text, bytes) = (header(1, "bil", 0), samples(1, "bil", 0));
    let check = |more: &str, reading: FileReading, quantity: Quantity, expected: [f64; 2]| {
        let path = write(folder.path(), "a", &format!("{text}{more}\n"), &bytes);
        let (image, _) = read_with(&path, &ReadOptions { reading, ..ReadOptions::default() }).unwrap();
        assert_eq!(image.quantity(), quantity, "{more}");
        for (found, expected) in image.spectrum_at(1, 2).iter().zip(expected) {
            assert!((found / expected - 1.0).abs() < 1e-6, "{more}: {found} {expected}");
        }
    };
    let none = FileReading::default;
    // Sample 12 of band 0 (600 nm) and 112 of band 1 (500 nm), which comes first.
    let watts = "data units = W/m^2/sr/nm";
    check(&format!("{watts}\ndata gain values = {{2, 3}}"), none(), Quantity::Radiance, [336.0, 24.0]);
    check(&format!("{watts}\ndata offset values = {{1, 5}}"), none(), Quantity::Radiance, [117.0, 13.0]);
    check(&format!("{watts}\nradiance scale factor = 100"), none(), Quantity::Radiance, [1.12, 0.12]);
    // Gains alone are those of ENVI, W m⁻² sr⁻¹ µm⁻¹.
    check("data gain values = {2, 3}", none(), Quantity::Radiance, [0.336, 0.024]);
    check("data reflectance gain values = {0.01, 0.005}", none(), Quantity::Reflectance, [0.56, 0.12]);
    let told = FileReading { unit: Some("mW/m^2/sr/nm".to_owned()), scale: Some(10.0), ..none() };
    check("", told, Quantity::Radiance, [1.12, 0.12]);
    let told = FileReading { quantity: Some(FileQuantity::Reflectance), scale: Some(0.01), ..none() };
    check("", told, Quantity::Reflectance, [1.12, 0.12]);
    let path = write(folder.path(), "b", &format!("{text}{watts}\n"), &bytes);
    let told = FileReading { quantity: Some(FileQuantity::Reflectance), ..none() };
    let refused = read_with(&path, &ReadOptions { reading: told, ..ReadOptions::default() }).unwrap_err().to_string();
    assert!(refused.contains("says something else"), "{refused}");
}

#[test]
fn ignored_values_and_bad_bands_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let text = header(1, "bip", 0) + "reflectance scale factor = 100\n";
    let bytes = samples(1, "bip", 0);
    let path = write(folder.path(), "a", &format!("{text}data ignore value = 112\n"), &bytes);
    let (image, notes) = read_with(&path, &ReadOptions::default()).unwrap();
    assert_eq!(image.spectrum_at(1, 2), [0.0, f64::from(0.12_f32)]);
    assert!(notes[0].starts_with("a.hdr: of 24 samples of all bands 1 without data are black"), "{notes:?}");
    let path = write(folder.path(), "b", &format!("{text}bbl = {{1, 0}}\n"), &bytes);
    let (image, notes) = read_with(&path, &ReadOptions::default()).unwrap();
    assert_eq!(image.grid().centers_nm(), [600.0]);
    assert!(notes[0].contains("1 of 2 bands are bad"), "{notes:?}");
}

#[test]
fn frames_with_bytes_between_are_read() {
    let folder = tempfile::tempdir().unwrap();
    for interleave in ["bsq", "bil", "bip"] {
        let plain = samples(1, interleave, 0);
        let frame = if interleave == "bsq" { 12 } else { 6 };
        let framed = plain[5..].chunks(frame).flat_map(|frame| [&[9; 3], frame, &[9; 2]].concat());
        let framed: Vec<u8> = plain[..5].iter().copied().chain(framed).collect();
        let text = header(1, interleave, 0);
        let usual = read_plain(&write(folder.path(), "a", &text, &plain)).unwrap();
        let path = write(folder.path(), "b", &format!("{text}major frame offsets = {{3, 2}}\n"), &framed);
        assert_eq!(read_plain(&path).unwrap(), usual, "{interleave}");
    }
}

#[test]
fn wanted_bands_are_those_of_the_whole_cube() {
    let folder = tempfile::tempdir().unwrap();
    let (rows, columns, n_bands) = (5, 4, 30);
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let values: Vec<f32> = (0..rows * columns * n_bands).map(|_| rng.random()).collect();
    let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    let wavelengths = (0..n_bands).map(|i| format!("{}", 400 + 10 * i)).collect::<Vec<_>>().join(", ");
    for interleave in ["bsq", "bil", "bip"] {
        let text = format!(
            "ENVI\nsamples = {columns}\nlines = {rows}\nbands = {n_bands}\ndata type = 4\ninterleave = {interleave}\n\
             wavelength units = nm\nwavelength = {{{wavelengths}}}\n"
        );
        let path = write(folder.path(), "a", &text, &bytes);
        let whole = read_plain(&path).unwrap();
        for wanted in [vec![450.0, 555.0, 680.0], vec![500.0, 600.0]] {
            let grid = WavelengthGrid::new(wanted).unwrap();
            let options = ReadOptions { white_level: Some(1.0), grid: Some(grid.clone()), ..ReadOptions::default() };
            let (part, _) = read_with(&path, &options).unwrap();
            assert_eq!(part, crate::resampled(&whole, &grid).unwrap(), "{interleave}");
        }
    }
}

#[test]
fn file_of_numbers_leads_to_its_header() {
    let folder = tempfile::tempdir().unwrap();
    let header_path = write(folder.path(), "a", &header(1, "bsq", 0), &samples(1, "bsq", 0));
    assert_eq!(header_of(&folder.path().join("a.raw")), Some(header_path.clone()));
    fs::rename(&header_path, folder.path().join("a.raw.hdr")).unwrap();
    assert_eq!(header_of(&folder.path().join("a.raw")), Some(folder.path().join("a.raw.hdr")));
    assert_eq!(header_of(&folder.path().join("b.raw")), None);
    read_plain(&folder.path().join("a.raw.hdr")).unwrap();
}

#[test]
fn a_short_or_absent_file_of_numbers_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), "a", &header(4, "bsq", 0), &samples(1, "bsq", 0));
    let message = read_plain(&path).unwrap_err().to_string();
    assert!(message.contains("a.raw") && message.contains("truncated"), "{message}");
    fs::remove_file(folder.path().join("a.raw")).unwrap();
    assert!(read_plain(&path).unwrap_err().to_string().contains("is not there"));
    let huge = header(4, "bsq", 0).replace("samples = 3", "samples = 99999999999");
    let path = write(folder.path(), "a", &huge, &[]);
    assert!(read_plain(&path).unwrap_err().to_string().contains("truncated"));
}

#[test]
fn no_mutation_of_a_header_makes_the_reader_panic() {
    let folder = tempfile::tempdir().unwrap();
    let good = header(12, "bil", 0);
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut n_refused = 0;
    for _ in 0..3000 {
        let mut bytes = good.clone().into_bytes();
        if rng.random::<f32>() < 0.2 {
            bytes.truncate(rng.random_range(0..good.len()));
        } else {
            let at = rng.random_range(0..bytes.len());
            bytes[at] = rng.random();
        }
        let text = String::from_utf8_lossy(&bytes).into_owned();
        let path = write(folder.path(), "a", &text, &samples(12, "bil", 0));
        n_refused += usize::from(read_plain(&path).is_err());
    }
    assert!(n_refused > 1000, "{n_refused} of 3000 refused");
}

#[dioptric_golden::needs_shared]
#[test]
fn the_corn_kernel_is_a_reflectance() {
    let Some(path) = dioptric_golden::shared("data/scenes/envi_corn_kernel/4-22-22_right_same_B73_top_00.hdr") else {
        return;
    };
    let (image, _) = read_with(&path, &ReadOptions::default()).unwrap();
    assert_eq!((image.grid().len(), image.planes()[0].dim()), (580, (31, 43)));
    let (row, column) = (15, 21);
    let at = |nm: f64| image.spectrum_at(row, column)[image.grid().nearest(nm)];
    // A yellow kernel: blue is absorbed, red is not.
    assert!(at(450.0) < 0.5 * at(600.0) && at(600.0) > 0.2 && at(600.0) < 1.2);
}

/// Samples that are far finer than those of the film are read as their means, the same as those of the whole cube.
#[test]
fn fine_cubes_are_read_as_means() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fine.hdr");
    let (rows, columns) = (41, 62);
    let head = format!(
        "ENVI\nsamples = {columns}\nlines = {rows}\nbands = 2\ndata type = 12\ninterleave = bil\nbyte order = 0\n\
         reflectance scale factor = 4000\ndata ignore value = 0\nwavelength = {{500, 600}}\n"
    );
    std::fs::write(&path, head).unwrap();
    let number = |row: usize, band: usize, column: usize| (1000 * band + 20 * row + column) as u16;
    let lines = (0..rows).flat_map(|row| (0..2).map(move |band| (row, band)));
    let numbers = lines.flat_map(|(row, band)| (0..columns).map(move |column| number(row, band, column)));
    std::fs::write(path.with_extension("raw"), numbers.flat_map(u16::to_le_bytes).collect::<Vec<u8>>()).unwrap();
    let whole = ReadOptions { horizontal_fov_deg: Some(20.0), ..ReadOptions::default() };
    let own = 2.0 * 10.0_f64.to_radians().tan() / columns as f64;
    let fine = ReadOptions { finest_tangent: Some(4.1 * own), ..whole.clone() };
    let ((all, _), (means, notes)) = (read_with(&path, &whole).unwrap(), read_with(&path, &fine).unwrap());
    assert_eq!((means.rows(), means.columns()), (10, 15));
    assert!(notes.iter().any(|note| note.contains("62 × 41 samples are read as 15 × 10 means")), "{notes:?}");
    for (mean, all) in means.planes().iter().zip(all.planes()) {
        for ((row, column), found) in mean.indexed_iter() {
            let within =
                |block: usize, n: usize, own: usize| (block * own).div_ceil(n)..((block + 1) * own).div_ceil(n);
            let block = all.slice(ndarray::s![within(row, 10, rows), within(column, 15, columns)]);
            assert!((found - block.mean().unwrap()).abs() < 1e-6);
        }
    }
}

/// A part that is read by itself is that of the whole, seen in the same directions.
#[test]
fn parts_are_those_of_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    let (rows, columns) = (9, 13);
    let mut rng = ChaCha8Rng::seed_from_u64(21);
    let values: Vec<f32> = (0..rows * columns * 3).map(|_| rng.random()).collect();
    let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    for interleave in ["bsq", "bil", "bip"] {
        let text = format!(
            "ENVI\nsamples = {columns}\nlines = {rows}\nbands = 3\ndata type = 4\ninterleave = {interleave}\n\
             reflectance scale factor = 1\nwavelength units = nm\nwavelength = {{450, 550, 650}}\n"
        );
        let path = write(folder.path(), "a", &text, &bytes);
        let usual = ReadOptions { horizontal_fov_deg: Some(30.0), depth_m: Some(2.0), ..ReadOptions::default() };
        let whole = crate::read_scene(&path, &usual).unwrap();
        for (window, bin) in [(Some([3, 2, 7, 6]), 1), (Some([1, 1, 11, 7]), 3), (None, 2), (Some([12, 8, 1, 1]), 1)] {
            let part = Part { window, bin };
            let found = crate::read_scene(&path, &ReadOptions { part: Some(part), ..usual.clone() }).unwrap();
            let expected = part.of(whole.clone()).unwrap();
            assert_eq!(found.depth, expected.depth);
            let (view, own) = (found.view.unwrap(), expected.view.unwrap());
            let off =
                [view.focal_px - own.focal_px, view.center_x_px - own.center_x_px, view.center_y_px - own.center_y_px];
            assert!(off.iter().all(|v| v.abs() < 1e-9), "{view:?} {own:?}");
            for (a, b) in found.radiance.planes().iter().zip(expected.radiance.planes()) {
                // Means of single floats in another order.
                assert!(
                    a.dim() == b.dim() && a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-6 * b),
                    "{interleave} {part:?}"
                );
            }
            let says = found.notes.iter().any(|note| note.contains("fill no block"));
            assert_eq!(says, bin > 1, "{:?}", found.notes);
        }
        for (window, bin) in [([3, 2, 70, 6], 1), ([3, 2, 2, 2], 3), ([0, 0, 0, 2], 1), ([0, 0, 2, 2], 0)] {
            let part = Some(Part { window: Some(window), bin });
            assert!(crate::read_scene(&path, &ReadOptions { part, ..usual.clone() }).is_err(), "{window:?}");
        }
    }
}

#[test]
fn units_of_percent_make_white_100() {
    let folder = tempfile::tempdir().unwrap();
    let text = header(1, "bsq", 0) + "data units = %\n";
    let path = write(folder.path(), "a", &text, &samples(1, "bsq", 0));
    let (image, _) = read_with(&path, &ReadOptions::default()).unwrap();
    assert_eq!(image.spectrum_at(0, 1), [1.01_f32, 0.01].map(f64::from));
    let told = ReadOptions { white_level: Some(1.0), ..ReadOptions::default() };
    assert!(read_with(&path, &told).unwrap_err().to_string().contains("contradicts"));
}
