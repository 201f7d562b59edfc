//! Bursts and brackets, every color filter array, and files.

#![expect(clippy::unwrap_used, reason = "a test fails by a panic")]

#[allow(dead_code, reason = "each test file uses a part of it")]
mod common;

use approx::assert_relative_eq;
use common::chart;
use dioptric_pictures::{Limits, read};
use dioptric_sensor::{
    Adc, AutoExposure, Cfa, ChartReport, ColorCorrection, ColorSpace, Demosaic, Depth, DngDetails, ElectronRate,
    Exposure, ExposureControl, Filter, FrameTable, Illumination, LensCorrections, LensTables, Metering, Noise,
    NoiseSource, Picture, Processing, Raw, RawPlane, Response, Sensor,
};
use dioptric_spectrum::{Illuminant, Spectrum};
use ndarray::{Array2, Array3};

fn expose(sensor: &Sensor, rate: &ElectronRate, exposure: &Exposure, noise: &Noise) -> Raw {
    let electrons = sensor.electrons(rate, exposure, noise).unwrap();
    sensor.digitize(&sensor.volts(&electrons, exposure, noise).unwrap(), exposure).unwrap()
}

fn values(raw: &Raw) -> Vec<f64> {
    raw.linear()[0].iter().map(|&v| f64::from(v)).collect()
}

fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt())
}

#[test]
fn a_burst_of_sixteen_has_a_quarter_of_the_noise() {
    let sensor = Sensor { prnu_fraction: 0.0, dsnu_v: 0.0, ..Sensor::built_in("machine-vision-mono").unwrap() };
    let rate = ElectronRate { planes_e_per_s: vec![Array2::from_elem((64, 64), 2e5)] };
    let exposure = Exposure::seconds(0.01);
    let burst: Vec<Raw> = (0..16).map(|i| expose(&sensor, &rate, &exposure, &Noise::all(1).frame(i))).collect();
    let (one, merged) = (values(&burst[0]), values(&sensor.merge(&burst).unwrap()));
    let ((mean_one, noise_one), (mean, noise)) = (mean_and_deviation(&one), mean_and_deviation(&merged));
    // 4096 pixels: a standard error of 1.1 % of each deviation.
    assert_relative_eq!(noise_one / noise, 4.0, max_relative = 0.06);
    assert_relative_eq!(mean, mean_one, max_relative = 0.002);
}

#[test]
fn a_bracket_has_more_range_than_its_frames() {
    let sensor = Sensor { prnu_fraction: 0.0, dsnu_v: 0.0, ..Sensor::built_in("machine-vision-mono").unwrap() };
    // Light over five decades, a column each.
    let per_s = |c: usize| 10.0_f32.powi(2 + c as i32);
    let rate = ElectronRate { planes_e_per_s: vec![Array2::from_shape_fn((256, 6), |(_, c)| per_s(c))] };
    let exposures = Exposure::seconds(0.05).bracket(&[-10.0, -5.0, 0.0]);
    assert_relative_eq!(exposures[1].time_s, 0.05 / 32.0);
    let frames: Vec<Raw> =
        exposures.iter().zip(0..).map(|(e, i)| expose(&sensor, &rate, e, &Noise::all(3).frame(i))).collect();
    let merged = sensor.merge(&frames).unwrap();
    let scale = merged.levels.saturation_e() / merged.exposure.time_s;
    let linear = &merged.linear()[0];
    for c in 0..6 {
        let column: Vec<f64> = linear.column(c).iter().map(|&v| f64::from(v) * scale).collect();
        let (mean, _) = mean_and_deviation(&column);
        // The darkest column has 5 electrons ± 3.4 a pixel in the longest frame: 4 % of its mean over 256 pixels.
        assert_relative_eq!(mean, f64::from(per_s(c)), max_relative = if c == 0 { 0.25 } else { 0.02 });
    }
    assert!(sensor.merge(&[]).unwrap_err().to_string().contains("1 or more"));
}

/// Returns a sensor like imx363 with other filters, which are sums of its own red, green and blue.
fn with_filters(cfa: Cfa, filters: &[(&str, [f64; 3])]) -> Sensor {
    let imx363 = Sensor::built_in("imx363").unwrap();
    let filter = |&(name, weights): &(&str, [f64; 3])| {
        let nm = imx363.filters[0].quantum_efficiency.wavelengths_nm().to_vec();
        let value = |&nm: &f64| -> f64 {
            weights.iter().zip(&imx363.filters).map(|(w, f)| w * f.quantum_efficiency.at_held(nm)).sum()
        };
        let values = nm.iter().map(value).collect();
        Filter { name: name.to_owned(), quantum_efficiency: Spectrum::new(nm, values).unwrap(), exposure_fraction: 1.0 }
    };
    Sensor { cfa, filters: filters.iter().map(filter).collect(), adc: Adc::Analog, ..imx363 }
}

const R: (&str, [f64; 3]) = ("R", [1.0, 0.0, 0.0]);
const G: (&str, [f64; 3]) = ("G", [0.0, 1.0, 0.0]);
const B: (&str, [f64; 3]) = ("B", [0.0, 0.0, 1.0]);
const C: (&str, [f64; 3]) = ("C", [0.0, 1.0, 1.0]);
const M: (&str, [f64; 3]) = ("M", [1.0, 0.0, 1.0]);
const Y: (&str, [f64; 3]) = ("Y", [1.0, 1.0, 0.0]);
const W: (&str, [f64; 3]) = ("W", [1.0, 1.0, 1.0]);

#[test]
fn every_color_filter_array_keeps_the_chart() {
    let two = |letters| Cfa::two_by_two(letters).unwrap();
    let rgbw = {
        let row = |names: &str| names.chars().map(String::from).collect();
        Cfa::Mosaic(["WBWG", "BWGW", "WGWR", "GWRW"].map(row).to_vec())
    };
    let cases = [
        ("RGGB", two("RGGB"), vec![R, G, B]),
        ("BGGR", two("BGGR"), vec![R, G, B]),
        ("GRBG", two("GRBG"), vec![R, G, B]),
        ("GBRG", two("GBRG"), vec![R, G, B]),
        ("quad Bayer", two("RGGB").repeated(2), vec![R, G, B]),
        ("RYYB", two("RYYB"), vec![R, Y, B]),
        ("CYYM", two("CYYM"), vec![C, Y, M]),
        ("RGBW", rgbw, vec![R, G, B, W]),
        ("stacked", Cfa::Stacked, vec![R, G, B]),
    ];
    let image = chart();
    for (name, cfa, filters) in cases {
        let sensor = with_filters(cfa, &filters);
        let control = ExposureControl::Auto(AutoExposure::new(Metering::Peak, 0.9));
        let capture = sensor.capture(&Illumination::on_pixels(&image), &control, &Noise::none()).unwrap();
        for demosaic in [Demosaic::Bilinear, Demosaic::Directional] {
            let processing = Processing { demosaic, ..Processing::for_light(Illuminant::D65) };
            let linear = sensor.develop_linear(&capture.raw, &processing).unwrap();
            let (rows, columns, _) = linear.light.dim();
            let corners =
                [(0, 0), (0, columns), (rows, columns), (rows, 0)].map(|(r, c)| (r as f64 - 0.5, c as f64 - 0.5));
            let report = ChartReport::measure(&linear.light, corners, &Illuminant::D65).unwrap();
            // All these filters span the same colors as imx363's own, whose matrix has a mean of 1.84.
            assert!(report.mean_delta_e() < 2.5, "{name} {demosaic:?}: {:.2}", report.mean_delta_e());
        }
    }
}

#[test]
fn a_car_camera_of_red_and_clear_sees_gray_and_red() {
    let sensor = with_filters(Cfa::two_by_two("RCCC").unwrap(), &[R, ("C", [1.0, 1.0, 1.0])]);
    let control = ExposureControl::Auto(AutoExposure::new(Metering::Peak, 0.9));
    let capture = sensor.capture(&Illumination::on_pixels(&chart()), &control, &Noise::none()).unwrap();
    let developed = sensor.develop(&capture.raw, &Processing::for_light(Illuminant::D65)).unwrap();
    let codes = &developed.picture.codes;
    let patch = |i: usize| [0, 1, 2].map(|k| codes[(24 * (i / 6) + 12, 24 * (i % 6) + 12, k)]);
    let (white, red) = (patch(18), patch(14));
    assert!((white[0] - white[1]).abs() < 0.02 && red[0] > red[1] + 0.2, "{white:?} {red:?}");
}

#[test]
fn a_multispectral_mosaic_comes_from_a_table() {
    let text = Sensor::built_in("ideal-mono").unwrap().to_ron();
    let band = |i: usize| {
        let nm = 420.0 + 40.0 * i as f64;
        format!(
            "(name: \"{i}\", quantum_efficiency: (wavelengths_nm: [{}, {nm}, {}], values: [0.0, 0.8, 0.0]))",
            nm - 30.0,
            nm + 30.0
        )
    };
    let filters: Vec<String> = (0..9).map(band).collect();
    let start = text.find("cfa:").unwrap();
    let end = text.find("filter_stack:").unwrap();
    let table = format!(
        "cfa: Mosaic([[\"0\", \"1\", \"2\"], [\"3\", \"4\", \"5\"], [\"6\", \"7\", \"8\"]]), filters: [{}], ",
        filters.join(", ")
    );
    let sensor = Sensor::from_ron(&format!("{}{table}{}", &text[..start], &text[end..]), "nine bands").unwrap();
    let control = ExposureControl::Auto(AutoExposure::new(Metering::Peak, 0.9));
    let capture = sensor.capture(&Illumination::on_pixels(&chart()), &control, &Noise::none()).unwrap();
    let linear = sensor.develop_linear(&capture.raw, &Processing::for_light(Illuminant::D65)).unwrap();
    assert_eq!(linear.color.rows[0].len(), 9);
    // Nine bands see color better than three.
    assert!(linear.color.mean_delta_e().unwrap() < 1.0, "{:?}", linear.color.mean_delta_e());
}

#[test]
fn hot_and_dead_pixels_are_mended() {
    let defects = dioptric_sensor::Defects { hot_fraction: 0.002, hot_e_per_s: 1e6, dead_fraction: 0.002 };
    let sensor = Sensor { defects, prnu_fraction: 0.0, ..Sensor::built_in("imx363").unwrap() };
    let rate = ElectronRate { planes_e_per_s: vec![Array2::from_elem((120, 160), 2e5)] };
    let raw = expose(&sensor, &rate, &Exposure::seconds(0.01), &Noise::only(0, &[NoiseSource::Defects]));
    let processing = Processing { color: ColorCorrection::None, ..Processing::for_light(Illuminant::D65) };
    let spread = |defect_threshold| {
        let processing = Processing { defect_threshold, ..processing.clone() };
        let light = sensor.develop_linear(&raw, &processing).unwrap().light;
        let green: Vec<f64> = light.index_axis(ndarray::Axis(2), 1).iter().map(|&v| f64::from(v)).collect();
        mean_and_deviation(&green).1
    };
    assert!(spread(None) > 0.005 && spread(Some(0.05)) < 0.2 * spread(None), "{} {}", spread(None), spread(Some(0.05)));
}

fn raw_of(name: &str) -> (Sensor, Raw) {
    let sensor = Sensor::built_in(name).unwrap();
    let raw = chart_raw(&sensor);
    (sensor, raw)
}

fn chart_raw(sensor: &Sensor) -> Raw {
    let control = ExposureControl::Auto(AutoExposure::new(Metering::Percentile(99.5), 0.9));
    sensor.capture(&Illumination::on_pixels(&chart()), &control, &Noise::all(2)).unwrap().raw
}

/// Returns the whole numbers of the tags of a little-endian TIFF file's first directory; fractions give two each.
fn tags_of(file: &[u8]) -> std::collections::BTreeMap<u16, Vec<u32>> {
    tags_at(file, u32::from_le_bytes(file[4..8].try_into().unwrap()))
}

/// Returns the same of the directory at a place.
fn tags_at(file: &[u8], place: u32) -> std::collections::BTreeMap<u16, Vec<u32>> {
    let number = |at: usize, bytes: usize| (0..bytes).rev().fold(0_u32, |n, i| n << 8 | u32::from(file[at + i]));
    let directory = place as usize;
    let entry = |i: usize| {
        let at = directory + 2 + 12 * i;
        let (kind, count) = (number(at + 2, 2), number(at + 4, 4) as usize);
        // BYTE, ASCII and UNDEFINED, SHORT, LONG, and the two LONGs of a RATIONAL or DOUBLE.
        let (bytes, count) = match kind {
            1 | 2 | 7 => (1, count),
            3 => (2, count),
            5 | 10 | 12 => (4, 2 * count),
            _ => (4, count),
        };
        let from = if bytes * count <= 4 { at + 8 } else { number(at + 8, 4) as usize };
        (number(at, 2) as u16, (0..count).map(|k| number(from + bytes * k, bytes)).collect())
    };
    (0..number(directory, 2) as usize).map(entry).collect()
}

#[test]
fn raw_numbers_come_back_from_png_tiff_and_dng() {
    let folder = tempfile::tempdir().unwrap();
    let (sensor, raw) = raw_of("imx363");
    let dn = raw.dn().unwrap();
    for name in ["raw.png", "raw.tif"] {
        let path = folder.path().join(name);
        raw.write(&path).unwrap();
        let back = read(&path, Limits::no_limits()).unwrap().into_luma16();
        assert!(back.pixels().zip(dn).all(|(pixel, &dn)| pixel.0[0] == dn), "{name}");
    }
    let path = folder.path().join("raw.dng");
    sensor.write_dng(&raw, &DngDetails::of_light(Illuminant::D65), &path).unwrap();
    let tags = tags_of(&std::fs::read(&path).unwrap());
    assert_eq!(tags[&262], [32803]);
    assert_eq!(tags[&33421], [2, 2]);
    assert_eq!(tags[&33422], [0, 1, 1, 2]);
    assert_eq!(tags[&50717], [1023]);
    assert_eq!((tags[&50721].len(), tags[&50722].len(), tags[&50728].len()), (18, 18, 6));
    // Nothing but the three finished files is left.
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 3);
}

#[test]
fn a_dng_says_how_it_was_taken_and_through_what() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("raw.dng");
    let (sensor, raw) = raw_of("imx363");
    let picture = sensor.develop(&raw, &Processing::for_light(Illuminant::D65)).unwrap().picture;
    let table = |value: f64| FrameTable::tabulate(5, 5, |_, _| value).unwrap();
    let tables = LensTables {
        size: raw.size(),
        distortion_px: [0, 1].map(|i| {
            let size = [raw.size().1 as f64, raw.size().0 as f64];
            FrameTable::tabulate(5, 5, |down, right| 0.01 * size[i] * ([right, down][i] - 0.5)).unwrap()
        }),
        lateral_color_px: vec![[table(0.0), table(0.0)]; 3],
        vignetting: vec![table(1.0); 3],
    };
    let details = DngDetails {
        f_number: Some(1.8),
        focal_length_mm: Some(4.38),
        lens: Some("thin".to_owned()),
        picture: Some(&picture),
        corrections: Some((LensCorrections { distortion: true, ..LensCorrections::default() }, &tables)),
        ..DngDetails::of_light(Illuminant::A)
    };
    sensor.write_dng(&raw, &details, &path).unwrap();
    let file = std::fs::read(&path).unwrap();
    let first = tags_of(&file);
    // A preview of eight bits, then the frame in a directory of its own.
    assert_eq!((&first[&254], &first[&258], &first[&262]), (&vec![1], &vec![8, 8, 8], &vec![2]));
    let frame = tags_at(&file, first[&330][0]);
    assert_eq!((&frame[&254], &frame[&258], &frame[&262]), (&vec![0], &vec![16], &vec![32803]));
    let number = |at: u32| u16::from_le_bytes(file[at as usize..at as usize + 2].try_into().unwrap());
    assert_eq!(number(frame[&273][0] + 2), raw.dn().unwrap()[(0, 1)]);
    assert_eq!((frame[&273][0] % 2, first[&273][0] % 2, frame[&279][0] as usize), (0, 0, 2 * raw.dn().unwrap().len()));
    // The numbers of an exposure, and the two matrices from the balanced camera to D50.
    let exif = tags_at(&file, first[&34665][0]);
    let iso = sensor.iso_at_unity_gain.unwrap() * raw.exposure.analog_gain;
    assert_eq!((&exif[&33437], &exif[&37386]), (&vec![1800, 1000], &vec![4380, 1000]));
    assert_eq!((exif[&34855][0], exif[&33434][0]), (iso.round() as u32, (raw.exposure.time_s * 1e6).round() as u32));
    for tag in [50964, 50965] {
        let white: Vec<f64> =
            first[&tag].chunks(6).map(|row| row.chunks(2).map(|v| f64::from(v[0] as i32) / 1e4).sum()).collect();
        assert!(white.iter().zip([0.9642, 1.0, 0.8249]).all(|(v, wanted)| (v - wanted).abs() < 1e-3), "{white:?}");
    }
    // The noise that is stated is that of an even surface.
    let double = |words: &[u32]| f64::from_bits(u64::from(words[0]) | u64::from(words[1]) << 32);
    let [slope, floor] = [0, 2].map(|i| double(&frame[&51041][i..i + 2]));
    let even = ElectronRate { planes_e_per_s: vec![Array2::from_elem((200, 200), 2e5)] };
    let quiet = Sensor { prnu_fraction: 0.0, ..sensor };
    let flat = expose(&quiet, &even, &Exposure { time_s: 0.01, ..raw.exposure }, &Noise::all(5));
    let light: Vec<f64> = flat.linear()[0].iter().map(|&v| f64::from(v)).collect();
    let (mean, deviation) = mean_and_deviation(&light);
    assert!((deviation.powi(2) / (slope * mean + floor) - 1.0).abs() < 0.05, "{deviation} {slope} {floor}");
    // One opcode, of one scale: WarpRectilinear.
    let opcodes: Vec<u8> = frame[&51022].iter().map(|&byte| byte as u8).collect();
    assert_eq!((&opcodes[..8], &opcodes[16..24]), (&[0, 0, 0, 1, 0, 0, 0, 1][..], &[0, 0, 0, 164, 0, 0, 0, 3][..]));
    assert!((f64::from_be_bytes(opcodes[24..32].try_into().unwrap()) - 1.01).abs() < 1e-6);
}

#[test]
fn pictures_come_back_from_their_files() {
    let folder = tempfile::tempdir().unwrap();
    let codes = Array3::from_shape_fn((5, 7, 3), |(r, c, i)| (r * 21 + c * 3 + i) as f32 / 104.0);
    let picture = Picture { codes, space: ColorSpace::DisplayP3 };
    for (name, depth) in
        [("a.png", Depth::Eight), ("b.png", Depth::Sixteen), ("c.tiff", Depth::Eight), ("d.tif", Depth::Sixteen)]
    {
        let path = folder.path().join(name);
        picture.write(&path, depth).unwrap();
        // The profile is compressed in PNG files, and stands in TIFF files as it is.
        let (bytes, profile) = (std::fs::read(&path).unwrap(), picture.space.of_file().icc_profile());
        let holds = |what: &[u8]| bytes.windows(what.len()).any(|part| part == what);
        assert!(if name.ends_with("png") { holds(b"iCCP") } else { holds(&profile) }, "{name}");
        let back = read(&path, Limits::no_limits()).unwrap();
        assert_eq!((back.width(), back.height()), (7, 5));
        match depth {
            Depth::Eight => assert_eq!(back.into_rgb8().into_raw(), picture.to_rgb8()),
            Depth::Sixteen => assert_eq!(back.into_rgb16().into_raw(), picture.to_rgb16()),
        }
    }
}

#[test]
fn what_cannot_be_written_says_why_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (sensor, raw) = raw_of("imx363");
    let message = |result: Result<(), dioptric_sensor::SensorError>| result.unwrap_err().to_string();
    assert!(message(raw.write(&folder.path().join("raw.jpg"))).contains("png, tif or tiff"));
    // Folders are made, but not below a file.
    std::fs::write(folder.path().join("no"), b"").unwrap();
    assert!(message(raw.write(&folder.path().join("no/such/raw.png"))).contains("no/such"));
    std::fs::remove_file(folder.path().join("no")).unwrap();
    let (ideal, planes) = raw_of("ideal");
    assert!(
        message(ideal.write_dng(&planes, &DngDetails::of_light(Illuminant::D65), &folder.path().join("a.dng")))
            .contains("volts")
    );
    let (d100, volts) = raw_of("nikon-d100");
    assert!(matches!(volts.planes[0], RawPlane::Volts(_)));
    assert!(
        message(d100.write_dng(&volts, &DngDetails::of_light(Illuminant::D65), &folder.path().join("a.dng")))
            .contains("volts")
    );
    let odd = Sensor { filters: vec![], ..sensor };
    assert!(odd.check().is_err());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

/// The sensors whose frames other readers open: four built in, and every kind of mosaic that DNG can hold.
fn dng_sensors() -> Vec<(&'static str, Sensor)> {
    let imx363 = Sensor::built_in("imx363").unwrap();
    let two = |letters| Cfa::two_by_two(letters).unwrap();
    let with = |cfa, filters: &[_]| Sensor { adc: imx363.adc, ..with_filters(cfa, filters) };
    let mut sensors: Vec<(&str, Sensor)> = ["imx363", "mt9v024", "nikon-d5100", "machine-vision-mono"]
        .map(|name| (name, Sensor::built_in(name).unwrap()))
        .into();
    sensors.extend([
        ("bayer-rggb", with(two("RGGB"), &[R, G, B])),
        ("bayer-bggr", with(two("BGGR"), &[R, G, B])),
        ("bayer-grbg", with(two("GRBG"), &[R, G, B])),
        ("bayer-gbrg", with(two("GBRG"), &[R, G, B])),
        ("quad-bayer", with(two("RGGB").repeated(2), &[R, G, B])),
        ("ryyb", with(two("RYYB"), &[R, Y, B])),
        ("cyym", with(two("CYYM"), &[C, Y, M])),
        ("rgbw", with(two("RGBW"), &[R, G, B, W])),
        ("stacked", with(Cfa::Stacked, &[R, G, B])),
        ("logarithmic", Sensor { response: Response::Logarithmic { knee_v: 0.05 }, ..with(two("RGGB"), &[R, G, B]) }),
    ]);
    sensors
}

/// Writes the frames that `scripts/check_dng.py` opens with other readers, where `DIOPTRIC_DNG_FOLDER` says.
#[test]
fn frames_for_other_readers_are_written_where_asked() {
    let kept = std::env::var_os("DIOPTRIC_DNG_FOLDER").map(std::path::PathBuf::from);
    let folder = tempfile::tempdir().unwrap();
    let folder = kept.as_deref().unwrap_or(folder.path());
    for (name, sensor) in dng_sensors() {
        let raw = chart_raw(&sensor);
        let path = folder.join(format!("{name}.dng"));
        sensor.write_dng(&raw, &DngDetails::of_light(Illuminant::D65), &path).unwrap();
        for (plane, filter) in raw.planes.iter().zip(&raw.filter_names) {
            let one = Raw { planes: vec![plane.clone()], ..raw.clone() };
            let png = if raw.planes.len() == 1 { format!("{name}.png") } else { format!("{name}.{filter}.png") };
            one.write(&folder.join(png)).unwrap();
        }
        let tags = tags_of(&std::fs::read(&path).unwrap());
        let n_planes = raw.planes.len();
        assert_eq!((tags[&277][0] as usize, tags[&50717].len()), (n_planes, n_planes), "{name}");
        match sensor.tile().unwrap().filter(|_| sensor.filters.len() > 1) {
            // One filter and stacked ones have no mosaic: PhotometricInterpretation is LinearRaw.
            None => assert!(tags[&262] == [34892] && !tags.contains_key(&33422), "{name}"),
            Some(tile) => {
                assert_eq!(tags[&33421], [tile.rows() as u32, tile.columns() as u32], "{name}");
                let letters: String = tags[&33422].iter().map(|&code| char::from(b"RGBCMYW"[code as usize])).collect();
                let expected: String = (0..tile.rows())
                    .flat_map(|row| tile.row(row).to_vec())
                    .map(|filter| sensor.filters[filter].name.clone())
                    .collect();
                assert_eq!(letters, expected, "{name}");
            }
        }
        if sensor.filters.len() > 1 {
            assert_eq!(tags[&50721].len(), 6 * sensor.filters.len(), "{name}");
        }
    }
}

#[test]
fn a_bent_response_goes_with_the_table_that_straightens_it() {
    let folder = tempfile::tempdir().unwrap();
    let (_, sensor) = dng_sensors().into_iter().find(|(name, _)| *name == "logarithmic").unwrap();
    let raw = chart_raw(&sensor);
    let path = folder.path().join("log.dng");
    sensor.write_dng(&raw, &DngDetails::of_light(Illuminant::D65), &path).unwrap();
    let tags = tags_of(&std::fs::read(&path).unwrap());
    let (table, black, white) = (&tags[&50712], tags[&50714][0] / tags[&50714][1], tags[&50717][0]);
    let linear = &raw.linear()[0];
    for (dn, light) in raw.dn().unwrap().iter().zip(linear) {
        let found = (f64::from(table[usize::from(*dn)]) - f64::from(black)) / f64::from(white - black);
        // Codes of the table are whole numbers of 61 440.
        assert!((found - f64::from(light.clamp(-0.06, 1.0))).abs() < 2e-5, "{dn}: {found}, not {light}");
    }
}

#[test]
fn what_dng_cannot_hold_is_refused_in_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("raw.dng");
    let imx363 = Sensor::built_in("imx363").unwrap();
    let clear = ("C", [1.0, 1.0, 1.0]);
    let odd = [("1", R.1), ("2", G.1), ("3", B.1)];
    let five = [R, G, B, W, Y];
    let row = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
    for (what, cfa, filters) in [
        ("two filters", Cfa::two_by_two("RCCC").unwrap(), &[R, clear][..]),
        ("unknown filters", Cfa::two_by_two("1223").unwrap(), &odd),
        ("five filters", Cfa::Mosaic(vec![row(&["R", "G", "B", "W", "Y"])]), &five),
        ("four planes", Cfa::Stacked, &[R, G, B, W]),
        ("a large tile", Cfa::two_by_two("RGGB").unwrap().repeated(8), &[R, G, B]),
    ] {
        let sensor = Sensor { adc: imx363.adc, ..with_filters(cfa, filters) };
        let message = sensor
            .write_dng(&chart_raw(&sensor), &DngDetails::of_light(Illuminant::D65), &path)
            .unwrap_err()
            .to_string();
        assert!(message.starts_with("a DNG file has") && !message.contains('\n'), "{what}: {message}");
        assert!(!path.exists());
    }
}

/// Of the pixels with a trap a quarter of the frames are one amplitude up, a quarter one down; the same pixels in all of them.
#[test]
fn telegraph_noise_jumps_by_the_amplitude_of_a_pixel() {
    let (fraction, mean_amplitude_e) = (0.2, 30.0);
    let sensor = Sensor {
        telegraph: dioptric_sensor::TelegraphNoise { fraction, mean_amplitude_e },
        dark_current: dioptric_sensor::DarkCurrent::default(),
        ..Sensor::built_in("imx363").unwrap()
    };
    let (rows, columns) = (120, 160);
    let rate = ElectronRate { planes_e_per_s: vec![Array2::zeros((rows, columns))] };
    let exposure = Exposure::seconds(0.01);
    let frame = |seed| {
        let noise = Noise::only(seed, &[NoiseSource::Telegraph]);
        let electrons = sensor.electrons(&rate, &exposure, &noise).unwrap();
        let volts = sensor.volts(&electrons, &exposure, &noise).unwrap();
        let gain = sensor.conversion_gain_v_per_e(exposure.gain_mode) as f32;
        volts.planes_v[0].mapv(|v| v / gain)
    };
    let frames: Vec<_> = (0..40).map(frame).collect();
    let n = (rows * columns) as f64;
    let variance = frames.iter().flatten().map(|v| f64::from(*v).powi(2)).sum::<f64>() / (n * frames.len() as f64);
    let expected = sensor.telegraph.rms_e(true).powi(2);
    assert!((variance / expected - 1.0).abs() < 0.1, "{variance} {expected}");
    let mut with_trap = 0;
    for at in 0..rows * columns {
        let values: Vec<f32> = frames.iter().map(|frame| frame[(at / columns, at % columns)]).collect();
        let most = values.iter().fold(0.0_f32, |most, v| most.max(v.abs()));
        with_trap += usize::from(most > 0.0);
        assert!(values.iter().all(|v| v.abs() < 1e-4 * most + 1e-6 || (v.abs() - most).abs() < 1e-4 * most + 1e-6));
    }
    assert!((with_trap as f64 / n / fraction - 1.0).abs() < 0.05, "{with_trap}");
}
