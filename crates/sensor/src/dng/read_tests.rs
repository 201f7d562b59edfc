//! Tests of reading DNG files: those written here, those built field by field, and broken ones.

use dioptric_spectrum::{Illuminant, Quantity, SpectralImage, WavelengthGrid};
use ndarray::Array2;

use super::{
    DngBlack, DngDetails, DngFile, DngNoise, DngOpcodes, DngReading, DngRendering, ProfileFile,
    lossless_jpeg::tests::{Coding, encode, uneven},
    tags::*,
    tiff_file::{Directory, Value},
};
use crate::{
    Exposure, ExposureControl, Illumination, Noise, Processing, Raw, RawPlane, Response, Sensor, WhiteBalance,
    process::develop_linear, psnr_db,
};

/// Returns a colorful frame of a sensor: patches of different spectra, and steps of brightness, with all noise.
fn frame(sensor: &Sensor) -> Raw {
    frame_of(sensor, 0.01)
}

/// Returns the same exposed so long, s.
fn frame_of(sensor: &Sensor, time_s: f64) -> Raw {
    let grid = WavelengthGrid::uniform(400.0, 700.0, 20.0).unwrap();
    let d65 = Illuminant::D65.spectrum().sample_held(&grid);
    let (rows, columns) = (sensor.rows, sensor.columns);
    let plane = |band: usize| {
        Array2::from_shape_fn((rows, columns), |(row, column)| {
            let hue = (column / 12) as f64;
            let color = 0.5 + 0.4 * (0.35 * band as f64 + 1.3 * hue).sin();
            (4e-5 * d65[band] * color * (1.0 + (row / 9) as f64)) as f32
        })
    };
    let planes = (0..grid.len()).map(plane).collect();
    let image = SpectralImage::new(Quantity::Irradiance, grid, planes).unwrap();
    let exposure = ExposureControl::Manual(Exposure::seconds(time_s));
    sensor.capture(&Illumination::on_pixels(&image), &exposure, &Noise::all(4)).unwrap().raw
}

fn written(sensor: &Sensor, raw: &Raw, details: &DngDetails<'_>) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("raw.dng");
    sensor.write_dng(raw, details, &path).unwrap();
    std::fs::read(path).unwrap()
}

fn small(name: &str) -> Sensor {
    Sensor::built_in(name).unwrap().with_size(54, 72)
}

#[test]
fn what_is_written_is_read_to_the_bit() {
    let sensor = small("imx363");
    let raw = frame(&sensor);
    let details = DngDetails {
        f_number: Some(1.8),
        focal_length_mm: Some(4.38),
        lens: Some("wide".to_owned()),
        ..DngDetails::of_light(Illuminant::D65)
    };
    let file = DngFile::from_bytes(&written(&sensor, &raw, &details)).unwrap();
    assert_eq!((&file.raw.planes, &file.raw.tile), (&raw.planes, &raw.tile));
    assert_eq!((&file.raw.filter_names, file.raw.exposure.time_s), (&raw.filter_names, 0.01));
    assert_eq!((file.raw.levels.black, file.raw.levels.white), (raw.levels.black, raw.levels.white.round()));
    let saturation_e = raw.levels.saturation_e();
    let offset = (sensor.noise_floor_e(&raw) / saturation_e).powi(2);
    assert_eq!(file.profile.noise, [DngNoise { scale: 1.0 / saturation_e, offset }]);
    assert_eq!(
        (file.shot.f_number, file.shot.focal_length_mm, file.shot.lens.as_deref()),
        (Some(1.8), Some(4.38), Some("wide"))
    );
    assert_eq!((file.shot.iso_speed, file.orientation), (Some(sensor.iso_speed(&raw, &Illuminant::D65).round()), 1));
    assert_eq!((file.shot.make.as_deref(), file.shot.model.as_deref()), (Some("dioptric"), Some(sensor.name.as_str())));
    assert!(file.notes.is_empty(), "{:?}", file.notes);
    // Matrices are written in ten thousandths, the neutral in millionths.
    let color = file.profile.color.unwrap();
    for (light, number, stated) in [(Illuminant::A, 17, &color.lights[0]), (Illuminant::D65, 21, &color.lights[1])] {
        assert_eq!(stated.illuminant, number);
        let rows = super::color::camera_from_xyz(&sensor, &light);
        let wanted: Vec<[f64; 3]> =
            rows.into_iter().map(|row| row.map(|v| (v * 10_000.0).round() / 10_000.0)).collect();
        assert_eq!(stated.camera_from_xyz, wanted);
    }
    let neutral = file.neutral.unwrap();
    let white = crate::white_light::white_response(&sensor, &Illuminant::D65);
    let brightest = white.iter().copied().fold(0.0, f64::max);
    for (found, white) in neutral.iter().zip(&white) {
        assert!((found - white / brightest).abs() <= 0.5e-6);
    }
}

#[test]
fn a_frame_through_a_file_is_developed_as_by_its_sensor() {
    for name in ["imx363", "nikon-d5100", "machine-vision-mono"] {
        let sensor = small(name);
        let raw = frame(&sensor);
        let file = DngFile::from_bytes(&written(&sensor, &raw, &DngDetails::of_light(Illuminant::D65))).unwrap();
        // A file holds matrices alone.
        let color = crate::ColorCorrection::Fitted(Illuminant::D65);
        let own = sensor.develop(&raw, &Processing { color, ..Processing::for_light(Illuminant::D65) }).unwrap();
        let through = file.develop(&Processing::default()).unwrap();
        // The white level is rounded to a whole code, the matrices to four places.
        let psnr = psnr_db(&own.picture, &through.picture).unwrap();
        assert!(psnr > 55.0, "{name}: {psnr} dB");
    }
}

#[test]
fn a_response_that_is_no_line_is_undone_by_its_table() {
    let sensor = Sensor { response: Response::Logarithmic { knee_v: 0.02 }, ..small("imx363") };
    let raw = frame(&sensor);
    let file = DngFile::from_bytes(&written(&sensor, &raw, &DngDetails::of_light(Illuminant::D65))).unwrap();
    assert_eq!(file.raw.planes, raw.planes);
    for (found, own) in file.raw.linear()[0].iter().zip(&raw.linear()[0]) {
        // The table has whole numbers on a scale of 61 439 steps.
        assert!((found - own).abs() <= 0.51 / 61_439.0, "{found} {own}");
    }
}

#[test]
fn stacked_filters_and_mosaics_of_four_are_read() {
    let mut stacked = small("imx363");
    stacked.cfa = crate::Cfa::Stacked;
    let quad = Sensor { cfa: crate::Cfa::two_by_two("RGGB").unwrap().repeated(2), ..small("imx363") };
    for sensor in [stacked, quad] {
        let raw = frame(&sensor);
        let file = DngFile::from_bytes(&written(&sensor, &raw, &DngDetails::of_light(Illuminant::A))).unwrap();
        assert_eq!((file.raw.planes, file.raw.tile), (raw.planes, raw.tile));
    }
}

/// A raw frame as other writers store it.
struct Stored {
    rows: usize,
    columns: usize,
    n_planes: usize,
    bits: u8,
    /// Rows and columns of a tile; strips of so many rows where there are no columns.
    tile: (usize, Option<usize>),
    /// The pixels that make one of lossless JPEG; 0 for plain samples.
    jpeg_components: usize,
}

impl Stored {
    fn codes(&self) -> Vec<u16> {
        uneven(self.rows * self.columns * self.n_planes, self.bits)
    }

    /// The bytes of a tile, filled up with its last column and row where it reaches beyond the frame.
    fn block(&self, codes: &[u16], (top, left): (usize, usize), (height, width): (usize, usize)) -> Vec<u8> {
        let code = |row: usize, column: usize, plane: usize| {
            let (row, column) = ((top + row).min(self.rows - 1), (left + column).min(self.columns - 1));
            codes[(row * self.columns + column) * self.n_planes + plane]
        };
        let n = self.n_planes;
        let lines: Vec<Vec<u16>> =
            (0..height).map(|r| (0..width * n).map(|i| code(r, i / n, i % n)).collect()).collect();
        if let Some(columns) = (width * n).checked_div(self.jpeg_components) {
            let size = (height, columns, self.jpeg_components);
            return encode(&lines.concat(), size, Coding::of_bits(self.bits));
        }
        lines.iter().flat_map(|line| self.packed(line)).collect()
    }

    /// Bits one after the other, the highest first; whole bytes in the file's order.
    fn packed(&self, line: &[u16]) -> Vec<u8> {
        if self.bits == 16 {
            return line.iter().flat_map(|code| code.to_le_bytes()).collect();
        }
        let bits = line.iter().flat_map(|code| (0..self.bits).rev().map(move |bit| code >> bit & 1));
        let bits: Vec<u8> = bits.map(|bit| bit as u8).collect();
        bits.chunks(8).map(|byte| byte.iter().enumerate().map(|(i, bit)| bit << (7 - i)).sum()).collect()
    }

    /// The directory of a DNG whose samples these are, as a Bayer mosaic or linear planes.
    fn directory(&self) -> Directory {
        let mut d = Directory::default();
        d.set(DNG_VERSION, Value::Byte(vec![1, 4, 0, 0]));
        d.set(IMAGE_LENGTH, Value::Long(vec![self.rows as u32]));
        d.set(IMAGE_WIDTH, Value::Long(vec![self.columns as u32]));
        d.set(BITS_PER_SAMPLE, Value::Short(vec![u16::from(self.bits); self.n_planes]));
        d.set(COMPRESSION, Value::Short(vec![if self.jpeg_components > 0 { 7 } else { 1 }]));
        d.set(SAMPLES_PER_PIXEL, Value::Short(vec![self.n_planes as u16]));
        let mosaic = self.n_planes == 1;
        d.set(PHOTOMETRIC_INTERPRETATION, Value::Short(vec![if mosaic { COLOR_FILTER_ARRAY } else { LINEAR_RAW }]));
        if mosaic {
            d.set(CFA_REPEAT_PATTERN_DIM, Value::Short(vec![2, 2]));
            d.set(CFA_PATTERN, Value::Byte(vec![1, 0, 2, 1]));
        }
        let matrix = [7000, -2000, -500, -4000, 13_000, 1500, -1000, 2000, 6000];
        d.set(COLOR_MATRIX_1, Value::SignedRational(matrix.map(|m| (m, 10_000)).to_vec()));
        d.set(CALIBRATION_ILLUMINANT_1, Value::Short(vec![21]));
        d.set(AS_SHOT_NEUTRAL, Value::Rational(vec![(1, 2), (1, 1), (3, 5)]));
        d
    }

    fn file(&self, change: impl FnOnce(&mut Directory)) -> Vec<u8> {
        let codes = self.codes();
        let mut d = self.directory();
        let (height, width) = (self.tile.0, self.tile.1.unwrap_or(self.columns));
        let mut blocks = Vec::new();
        for top in (0..self.rows).step_by(height) {
            for left in (0..self.columns).step_by(width) {
                let height = if self.tile.1.is_some() { height } else { height.min(self.rows - top) };
                blocks.push(self.block(&codes, (top, left), (height, width)));
            }
        }
        let counts = blocks.iter().map(|block| block.len() as u32).collect();
        // Blocks stand behind the header, before the directory.
        let mut place = 8;
        let places = blocks.iter().map(|block| {
            let here = place;
            place += block.len() as u32;
            here
        });
        let places = places.collect();
        let (offsets, byte_counts) = match self.tile.1 {
            Some(width) => {
                d.set(TILE_LENGTH, Value::Long(vec![height as u32]));
                d.set(TILE_WIDTH, Value::Long(vec![width as u32]));
                (TILE_OFFSETS, TILE_BYTE_COUNTS)
            }
            None => {
                d.set(ROWS_PER_STRIP, Value::Long(vec![height as u32]));
                (STRIP_OFFSETS, STRIP_BYTE_COUNTS)
            }
        };
        d.set(offsets, Value::Long(places));
        d.set(byte_counts, Value::Long(counts));
        change(&mut d);
        d.into_file_behind(&blocks.concat()).unwrap()
    }
}

fn codes_of(raw: &Raw) -> Vec<u16> {
    let planes: Vec<_> = raw.planes.iter().map(|plane| plane.dn().unwrap()).collect();
    let (rows, columns) = raw.size();
    (0..rows * columns).flat_map(|i| planes.iter().map(move |plane| plane[(i / columns, i % columns)])).collect()
}

const PLAIN: Stored = Stored { rows: 13, columns: 22, n_planes: 1, bits: 14, tile: (4, None), jpeg_components: 0 };

#[test]
fn strips_and_tiles_of_all_depths_are_read() {
    for bits in [8, 10, 12, 14, 16] {
        for (tile, n_planes, jpeg_components) in [
            ((4, None), 1, 0),
            ((13, None), 3, 0),
            ((5, Some(8)), 1, 0),
            ((8, Some(6)), 3, 0),
            ((5, Some(8)), 1, 1),
            ((6, Some(8)), 1, 2),
            ((6, Some(8)), 3, 3),
            ((5, None), 1, 2),
        ] {
            let stored = Stored { bits, tile, n_planes, jpeg_components, ..PLAIN };
            let file = DngFile::from_bytes(&stored.file(|_| ())).unwrap();
            assert_eq!(codes_of(&file.raw), stored.codes(), "{bits} bits, {tile:?}, {n_planes}, {jpeg_components}");
            assert_eq!(file.bits, u32::from(bits));
        }
    }
}

#[test]
fn a_tile_may_be_fewer_and_longer_rows_of_jpeg() {
    // Two rows of a tile as one of the compressed image.
    let stored = Stored { rows: 4, columns: 8, tile: (4, Some(8)), jpeg_components: 2, ..PLAIN };
    let codes = stored.codes();
    let block = encode(&codes, (2, 8, 2), Coding::of_bits(14));
    let mut d = stored.directory();
    d.set(TILE_LENGTH, Value::Long(vec![4]));
    d.set(TILE_WIDTH, Value::Long(vec![8]));
    d.set(TILE_OFFSETS, Value::Long(vec![8]));
    d.set(TILE_BYTE_COUNTS, Value::Long(vec![block.len() as u32]));
    let file = DngFile::from_bytes(&d.into_file_behind(&block).unwrap()).unwrap();
    assert_eq!(codes_of(&file.raw), codes);
}

/// Returns a file whose only strip is this, deflated.
fn deflated(bytes: &[u8], predictor: u16, change: impl FnOnce(&mut Directory)) -> Vec<u8> {
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
    std::io::Write::write_all(&mut encoder, bytes).unwrap();
    let block = encoder.finish().unwrap();
    let mut d = PLAIN.directory();
    d.set(COMPRESSION, Value::Short(vec![8]));
    d.set(PREDICTOR, Value::Short(vec![predictor]));
    d.set(ROWS_PER_STRIP, Value::Long(vec![PLAIN.rows as u32]));
    d.set(STRIP_OFFSETS, Value::Long(vec![8]));
    d.set(STRIP_BYTE_COUNTS, Value::Long(vec![block.len() as u32]));
    change(&mut d);
    d.into_file_behind(&block).unwrap()
}

#[test]
fn deflated_codes_and_floats_are_read() {
    let codes = PLAIN.codes();
    let columns = PLAIN.columns;
    // Differences of whole numbers along each row.
    let differences = codes
        .chunks_exact(columns)
        .flat_map(|row| (0..columns).map(move |i| if i == 0 { row[0] } else { row[i].wrapping_sub(row[i - 1]) }));
    let bytes: Vec<u8> = differences.flat_map(u16::to_le_bytes).collect();
    let file = deflated(&bytes, 2, |d| d.set(BITS_PER_SAMPLE, Value::Short(vec![16])));
    assert_eq!(codes_of(&DngFile::from_bytes(&file).unwrap().raw), codes);
    // Floats beyond 1, of which 1 is white where the file does not say.
    let light: Vec<f32> = codes.iter().map(|&code| f32::from(code) / 10_000.0).collect();
    let parted: Vec<u8> = light
        .chunks_exact(columns)
        .flat_map(|row| {
            let mut bytes: Vec<u8> =
                (0..4).flat_map(|weight| row.iter().map(move |v| v.to_be_bytes()[weight])).collect();
            (1..bytes.len()).rev().for_each(|at| bytes[at] = bytes[at].wrapping_sub(bytes[at - 1]));
            bytes
        })
        .collect();
    let floats = |d: &mut Directory, bits: u16| {
        d.set(BITS_PER_SAMPLE, Value::Short(vec![bits]));
        d.set(SAMPLE_FORMAT, Value::Short(vec![3]));
        d.set(WHITE_LEVEL, Value::Long(vec![1]));
        d.set(BLACK_LEVEL, Value::Short(vec![0]));
    };
    let file = DngFile::from_bytes(&deflated(&parted, 3, |d| floats(d, 32))).unwrap();
    for (found, wanted) in file.raw.linear()[0].iter().zip(&light) {
        assert!((found - wanted).abs() <= 1e-6, "{found} {wanted}");
    }
    assert_eq!(file.bits, 32);
    // The same without differences, and as floats of 16 bits: 1.5 × 2⁻² is 0 01101 1000000000.
    let plain: Vec<u8> = light.iter().flat_map(|v| v.to_le_bytes()).collect();
    let file = DngFile::from_bytes(&deflated(&plain, 1, |d| floats(d, 32))).unwrap();
    assert!((file.raw.linear()[0][(1, 2)] - light[columns + 2]).abs() < 1e-6);
    let half: Vec<u8> = light.iter().flat_map(|_| 0b0011_0110_0000_0000_u16.to_le_bytes()).collect();
    let file = DngFile::from_bytes(&deflated(&half, 1, |d| floats(d, 16))).unwrap();
    assert!(file.raw.linear()[0].iter().all(|v| *v == 0.375));
    // Too few samples, and a predictor of whole numbers for floats.
    let short = DngFile::from_bytes(&deflated(&plain[..40], 1, |d| floats(d, 32))).unwrap_err();
    assert!(short.contains("bytes in a strip"), "{short}");
    let other = DngFile::from_bytes(&deflated(&plain, 2, |d| floats(d, 32))).unwrap_err();
    assert!(other.contains("predictor 2"), "{other}");
}

#[test]
fn active_area_and_crop_move_the_mosaic() {
    let file = PLAIN.file(|d| {
        d.set(ACTIVE_AREA, Value::Short(vec![2, 3, 12, 21]));
        d.set(DEFAULT_CROP_ORIGIN, Value::Rational(vec![(3, 1), (1, 1)]));
        d.set(DEFAULT_CROP_SIZE, Value::Short(vec![12, 8]));
    });
    let file = DngFile::from_bytes(&file).unwrap();
    assert_eq!((file.raw.size(), file.origin, file.stored), ((8, 12), (6, 3), (22, 13)));
    let dn = file.raw.dn().unwrap();
    assert_eq!(dn[(1, 2)], PLAIN.codes()[4 * 22 + 8]);
    // The mosaic GR, BG begins at the active area: one row down and three columns across it is GB, RG.
    let tile = file.raw.tile.unwrap();
    let letters: String = [(0, 0), (0, 1), (1, 0), (1, 1)]
        .map(|(row, column)| file.raw.filter_names[tile.filter_at(row, column)].clone())
        .concat();
    assert_eq!(letters, "GBRG");
}

#[test]
fn black_of_each_place_column_and_row_is_taken_off() {
    let file = PLAIN.file(|d| {
        d.set(ACTIVE_AREA, Value::Short(vec![1, 1, 13, 22]));
        d.set(BLACK_LEVEL_REPEAT_DIM, Value::Short(vec![2, 2]));
        d.set(BLACK_LEVEL, Value::Rational(vec![(100, 1), (101, 1), (205, 2), (99, 1)]));
        d.set(BLACK_LEVEL_DELTA_H, Value::SignedRational((0..21).map(|i| (i - 3, 4)).collect()));
        d.set(BLACK_LEVEL_DELTA_V, Value::SignedRational((0..12).map(|i| (-i, 2)).collect()));
        d.set(WHITE_LEVEL, Value::Long(vec![15_000]));
    });
    let file = DngFile::from_bytes(&file).unwrap();
    assert!(matches!(file.raw.planes[0], RawPlane::Evened(_)));
    let linear = &file.raw.linear()[0];
    let codes = PLAIN.codes();
    for (row, column, black) in [(0, 0, 100.0), (0, 3, 101.0), (3, 4, 102.5), (5, 7, 99.0)] {
        let black = black + (column as f64 - 3.0) / 4.0 - row as f64 / 2.0;
        let code = f64::from(codes[(row + 1) * 22 + column + 1]);
        // Saturation is counted from the highest black: 102.5 + 17 / 4 (DNG 1.4, chapter 5, rescaling).
        let wanted = (code - black) / (15_000.0 - 106.75);
        assert!((f64::from(linear[(row, column)]) - wanted).abs() < 1e-6, "{row}, {column}");
    }
}

#[test]
fn a_linearization_table_stands_before_the_levels() {
    let table: Vec<u16> = (0..=255_u16).map(|code| code * code).collect();
    let stored = Stored { bits: 8, ..PLAIN };
    let file = stored.file(|d| {
        d.set(LINEARIZATION_TABLE, Value::Short(table));
        d.set(BLACK_LEVEL, Value::Short(vec![25]));
        d.set(WHITE_LEVEL, Value::Long(vec![60_025]));
    });
    let file = DngFile::from_bytes(&file).unwrap();
    // Black is the code 5, saturation the code 245.
    assert_eq!((file.raw.levels.black, file.raw.levels.white), (5.0, 245.0));
    for (found, code) in file.raw.linear()[0].iter().zip(stored.codes()) {
        let wanted = (f64::from(code).powi(2) - 25.0) / 60_000.0;
        assert!((f64::from(*found) - wanted).abs() < 1e-6);
    }
}

#[test]
fn the_picture_is_turned_and_white_by_the_shot() {
    let stored = Stored { rows: 16, columns: 24, bits: 12, ..PLAIN };
    let flat = |d: &mut Directory| d.set(ORIENTATION, Value::Short(vec![6]));
    let file = DngFile::from_bytes(&stored.file(flat)).unwrap();
    let developed = file.develop(&Processing { denoise: Some(0.0), ..Processing::default() }).unwrap();
    assert_eq!((developed.picture.rows(), developed.picture.columns()), (24, 16));
    assert_eq!(developed.balance, [2.0, 1.0, 1.0 / 0.6]);
    for row in &developed.color.rows {
        assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-9);
    }
    // The first row of the stored frame is the last column of the picture.
    let upright = DngFile { orientation: 1, ..file.clone() }.develop(&Processing::default()).unwrap();
    assert_eq!(developed.picture.rgb_at(5, 15), upright.picture.rgb_at(0, 5));
}

#[test]
fn what_a_file_does_not_hold_is_refused() {
    let file = DngFile::from_bytes(&PLAIN.file(|_| ())).unwrap();
    let reason = |processing: Processing| file.develop(&processing).unwrap_err().to_string();
    let usual = Processing::default;
    assert!(reason(Processing { denoise: Some(0.5), ..usual() }).contains("NoiseProfile"));
    assert!(reason(Processing { color: crate::ColorCorrection::Roots, ..usual() }).contains("quantum efficiencies"));
    let all = crate::LensCorrections::parse("all").unwrap();
    assert!(reason(Processing { lens_corrections: all, ..usual() }).contains("lens"));
    let light = WhiteBalance::Light(Illuminant::A);
    assert!(file.develop(&Processing { white: light, ..usual() }).is_ok());
}

/// Returns the bytes of an opcode.
fn opcode(number: u32, parameters: &[u8]) -> Vec<u8> {
    let head = [number, 0x0103_0000, 1, parameters.len() as u32];
    head.into_iter().flat_map(u32::to_be_bytes).chain(parameters.iter().copied()).collect()
}

fn list(opcodes: &[Vec<u8>]) -> Value {
    Value::Undefined([(opcodes.len() as u32).to_be_bytes().to_vec(), opcodes.concat()].concat())
}

fn wholes(values: &[u32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_be_bytes()).collect()
}

fn doubles(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_be_bytes()).collect()
}

fn singles(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_be_bytes()).collect()
}

/// Returns the light of a file whose second list has these opcodes; its codes are 1000 + 100 × row + 10 × column, its black 0 and its
/// saturation 10 000.
fn corrected(tag: u16, opcodes: &[Vec<u8>]) -> Array2<f32> {
    let (rows, columns) = (12, 16);
    let code = |i: usize| (1000 + 100 * (i / columns) + 10 * (i % columns)) as u16;
    let codes: Vec<u8> = (0..rows * columns).flat_map(|i| code(i).to_le_bytes()).collect();
    let stored = Stored { rows: 12, columns: 16, bits: 16, ..PLAIN };
    let mut d = stored.directory();
    d.set(ROWS_PER_STRIP, Value::Long(vec![12]));
    d.set(STRIP_OFFSETS, Value::Long(vec![8]));
    d.set(STRIP_BYTE_COUNTS, Value::Long(vec![codes.len() as u32]));
    d.set(WHITE_LEVEL, Value::Long(vec![10_000]));
    d.set(tag, list(opcodes));
    let file = DngFile::from_bytes(&d.into_file_behind(&codes).unwrap()).unwrap();
    assert!(file.notes.is_empty(), "{:?}", file.notes);
    file.raw.linear().swap_remove(0)
}

/// The light of those codes.
fn light(row: usize, column: usize) -> f64 {
    0.1 + 0.01 * row as f64 + 0.001 * column as f64
}

/// Top, left, bottom, right, first plane, planes, row and column pitch.
const ALL: [u32; 8] = [0, 0, 12, 16, 0, 1, 1, 1];

#[track_caller]
fn check_corrected(tag: u16, opcodes: &[Vec<u8>], wanted: impl Fn(usize, usize) -> f64) {
    for ((row, column), found) in corrected(tag, opcodes).indexed_iter() {
        let wanted = wanted(row, column);
        // Half a code of the first list's 16 bits, and rounding of the others.
        assert!((f64::from(*found) - wanted).abs() < 6e-5, "{row}, {column}: {found} for {wanted}");
    }
}

#[test]
fn opcodes_of_light_follow_the_formulas_of_the_specification() {
    let area = |area: [u32; 8], rest: &[u8]| [wholes(&area), rest.to_vec()].concat();
    // A gain of 1 at the left and 3 at the right quarter, 2 rows of points; on every second row and column from 1, 0 on.
    let map = [wholes(&[2, 2]), doubles(&[1.0, 0.5, 0.0, 0.25]), wholes(&[1]), singles(&[1.0, 3.0, 2.0, 4.0])].concat();
    check_corrected(OPCODE_LIST_2, &[opcode(9, &area([1, 0, 12, 16, 0, 1, 2, 2], &map))], |row, column| {
        let (down, right) = ((row as f64 + 0.5) / 12.0, ((column as f64 + 0.5) / 16.0 - 0.25) / 0.5);
        let gain = 1.0 + 2.0 * right.clamp(0.0, 1.0) + down;
        light(row, column) * if row % 2 == 1 && column % 2 == 0 { gain } else { 1.0 }
    });
    // The area of rows 2 to 9 and columns 4 to 7 alone.
    let part = [2, 4, 10, 8, 0, 1, 1, 1];
    let is_within = |row: usize, column: usize| (2..10).contains(&row) && (4..8).contains(&column);
    let lines = |n: u32| [wholes(&[n]), singles(&(0..n).map(|i| 0.01 * i as f32).collect::<Vec<_>>())].concat();
    check_corrected(OPCODE_LIST_2, &[opcode(10, &area(part, &lines(8)))], |row, column| {
        light(row, column) + if is_within(row, column) { 0.01 * (row - 2) as f64 } else { 0.0 }
    });
    check_corrected(OPCODE_LIST_2, &[opcode(11, &area(part, &lines(4)))], |row, column| {
        light(row, column) + if is_within(row, column) { 0.01 * (column - 4) as f64 } else { 0.0 }
    });
    check_corrected(OPCODE_LIST_2, &[opcode(12, &area(part, &lines(8)))], |row, column| {
        light(row, column) * if is_within(row, column) { 0.01 * (row - 2) as f64 } else { 1.0 }
    });
    check_corrected(OPCODE_LIST_2, &[opcode(13, &area(part, &lines(4)))], |row, column| {
        light(row, column) * if is_within(row, column) { 0.01 * (column - 4) as f64 } else { 1.0 }
    });
    let polynomial = [wholes(&[2]), doubles(&[0.02, 0.5, 0.8])].concat();
    check_corrected(OPCODE_LIST_2, &[opcode(8, &area(ALL, &polynomial))], |row, column| {
        let x = light(row, column);
        0.02 + 0.5 * x + 0.8 * x * x
    });
    let table: Vec<u8> = (0..40_000_u32).flat_map(|code| ((code / 2 + 300) as u16).to_be_bytes()).collect();
    let table = [wholes(&[40_000]), table].concat();
    check_corrected(OPCODE_LIST_2, &[opcode(7, &area(ALL, &table))], |row, column| {
        ((light(row, column) * 65_535.0 / 2.0).floor() + 300.0) / 65_535.0
    });
    // What is made brighter than saturation is saturated.
    let bright = [wholes(&[1, 1]), doubles(&[1.0, 1.0, 0.0, 0.0]), wholes(&[1]), singles(&[20.0])].concat();
    check_corrected(OPCODE_LIST_2, &[opcode(9, &area(ALL, &bright))], |_, _| 1.0);
    let falls = doubles(&[0.5, 0.25, 0.0, 0.0, 0.1, 0.4, 0.6]);
    check_corrected(OPCODE_LIST_2, &[opcode(3, &falls)], |row, column| {
        let (x, y) = (column as f64 - 0.4 * 15.0, row as f64 - 0.6 * 11.0);
        let r2 = (x * x + y * y) / ((0.6_f64 * 15.0).powi(2) + (0.6_f64 * 11.0).powi(2));
        light(row, column) * (1.0 + 0.5 * r2 + 0.25 * r2 * r2 + 0.1 * r2.powi(5))
    });
    // The first list is for codes, whose top is 65 535 here: a tenth of it is two thirds of saturation.
    let tenth = [wholes(&[1]), singles(&[0.01])].concat();
    check_corrected(OPCODE_LIST_1, &[opcode(10, &area([3, 0, 4, 16, 0, 1, 1, 1], &tenth))], |row, column| {
        light(row, column) + if row == 3 { 0.065_535 } else { 0.0 }
    });
}

#[test]
fn bad_pixels_are_mended_from_their_own_filter() {
    // The code 1000 + 100 × 5 + 10 × 6 is at row 5, column 6; a point and a rectangle are named too.
    let by_code = opcode(4, &wholes(&[1560, 0]));
    let listed = opcode(5, &wholes(&[0, 1, 1, 2, 3, 8, 9, 10, 11]));
    for tag in [OPCODE_LIST_1, OPCODE_LIST_2] {
        let opcodes = if tag == OPCODE_LIST_1 { vec![by_code.clone(), listed.clone()] } else { vec![listed.clone()] };
        let found = corrected(tag, &opcodes);
        // Means of neighbors at equal distances on all sides are those of a plane itself.
        for (row, column) in [(5, 6), (2, 3)] {
            assert!((f64::from(found[(row, column)]) - light(row, column)).abs() < 6e-5);
        }
        // The rectangle has two rows and two columns: each filter has one bad pixel, and sound ones beside it.
        for (row, column) in [(8, 9), (8, 10), (9, 9), (9, 10)] {
            assert!((f64::from(found[(row, column)]) - light(row, column)).abs() < 0.012);
        }
    }
}

#[test]
fn warps_take_light_from_where_the_specification_says() {
    // Linear planes of a slope along columns and rows: any place has a known light.
    let (rows, columns) = (40_usize, 60_usize);
    let code = |row: usize, column: usize, plane: usize| (2000 + 300 * row + 200 * column + 1000 * plane) as u16;
    let codes: Vec<u8> =
        (0..rows * columns * 3).flat_map(|i| code(i / (3 * columns), i / 3 % columns, i % 3).to_le_bytes()).collect();
    let stored = Stored { rows, columns, n_planes: 3, bits: 16, ..PLAIN };
    let developed = |opcode: Vec<u8>| {
        let mut d = stored.directory();
        d.set(ROWS_PER_STRIP, Value::Long(vec![rows as u32]));
        d.set(STRIP_OFFSETS, Value::Long(vec![8]));
        d.set(STRIP_BYTE_COUNTS, Value::Long(vec![codes.len() as u32]));
        d.set(DEFAULT_CROP_ORIGIN, Value::Short(vec![4, 2]));
        d.set(DEFAULT_CROP_SIZE, Value::Short(vec![50, 36]));
        d.set(OPCODE_LIST_3, list(&[opcode]));
        let file = DngFile::from_bytes(&d.into_file_behind(&codes).unwrap()).unwrap();
        let plain =
            Processing { white: WhiteBalance::None, color: crate::ColorCorrection::None, ..Processing::plain() };
        let raw = file.with_border.as_ref().unwrap_or(&file.raw);
        develop_linear(&file.profile, raw, &plain, None).unwrap().light
    };
    let (center_x, center_y) = (0.45 * 59.0, 0.55 * 39.0);
    let farthest = (0.55_f64 * 59.0).hypot(0.55 * 39.0);
    let check = |opcode: Vec<u8>, source: &dyn Fn(f64, f64) -> [f64; 2], what: &str| {
        let light = developed(opcode);
        assert_eq!(light.dim(), (36, 50, 3), "{what}");
        for (row, column) in [(3, 5), (18, 22), (30, 44), (12, 36)] {
            let (x, y) = (((column + 4) as f64 - center_x) / farthest, ((row + 2) as f64 - center_y) / farthest);
            let [sx, sy] = source(x, y);
            let (from_column, from_row) = (center_x + farthest * sx, center_y + farthest * sy);
            for plane in 0..3 {
                let wanted = (2000.0 + 300.0 * from_row + 200.0 * from_column + 1000.0 * plane as f64) / 65_535.0;
                let found = f64::from(light[(row, column, plane)]);
                assert!((found - wanted).abs() < 1e-5, "{what}, {row}, {column}: {found} for {wanted}");
            }
        }
    };
    let center = [0.45, 0.55];
    let rectilinear = [1.0, -0.06, 0.02, -0.004, 0.003, -0.002];
    let radial = |r2: f64| 1.0 - 0.06 * r2 + 0.02 * r2 * r2 - 0.004 * r2.powi(3);
    let brown = |x: f64, y: f64| {
        let r2 = x * x + y * y;
        [
            x * radial(r2) + 0.003 * 2.0 * x * y - 0.002 * (r2 + 2.0 * x * x),
            y * radial(r2) - 0.002 * 2.0 * x * y + 0.003 * (r2 + 2.0 * y * y),
        ]
    };
    check(opcode(1, &[wholes(&[1]), doubles(&rectilinear), doubles(&center)].concat()), &brown, "WarpRectilinear");
    let fisheye = [1.0, 0.2, -0.02, 0.0];
    let by_angle = |x: f64, y: f64| {
        let r = x.hypot(y);
        let t = r.atan();
        [x, y].map(|v| v / r * (t + 0.2 * t.powi(3) - 0.02 * t.powi(5)))
    };
    check(opcode(2, &[wholes(&[1]), doubles(&fisheye), doubles(&center)].concat()), &by_angle, "WarpFisheye");
    let mut second = vec![1.0, 0.02, -0.03];
    second.extend([0.0; 12]);
    second.extend([0.003, -0.002, 0.0, 2.0]);
    for reciprocal in [0, 1] {
        let by_powers = |x: f64, y: f64| {
            let r = x.hypot(y);
            let sum = 1.0 + 0.02 * r - 0.03 * r * r;
            let factor = if reciprocal == 1 { 1.0 / sum } else { sum };
            [
                x * factor + 0.003 * 2.0 * x * y - 0.002 * (r * r + 2.0 * x * x),
                y * factor - 0.002 * 2.0 * x * y + 0.003 * (r * r + 2.0 * y * y),
            ]
        };
        let parameters = [wholes(&[1]), doubles(&second), doubles(&center), wholes(&[reciprocal])].concat();
        check(opcode(14, &parameters), &by_powers, "WarpRectilinear2");
    }
    // What is trimmed is not shown.
    assert_eq!(developed(opcode(6, &wholes(&[5, 10, 40, 50]))).dim(), (33, 40, 3));
}

#[test]
fn opcodes_written_here_undo_the_lens_when_read() {
    let sensor = small("imx363");
    // Nothing is saturated: highlights are rebuilt before the corrections of a file, and after those of tables.
    let raw = frame_of(&sensor, 1e-3);
    let table = |value: &dyn Fn(f64, f64) -> f64| crate::FrameTable::tabulate(21, 21, value).unwrap();
    let r2 = |down: f64, right: f64| {
        let (x, y) = ((right - 0.5) * 72.0, (down - 0.5) * 54.0);
        (x * x + y * y) / (36.0_f64.powi(2) + 27.0_f64.powi(2))
    };
    let tables = crate::LensTables {
        size: (54, 72),
        distortion_px: [
            table(&|d, r| -0.05 * r2(d, r) * (r - 0.5) * 72.0),
            table(&|d, r| -0.05 * r2(d, r) * (d - 0.5) * 54.0),
        ],
        lateral_color_px: vec![[table(&|_, _| 0.0), table(&|_, _| 0.0)]; 3],
        vignetting: vec![table(&|d, r| 1.0 + 0.6 * r2(d, r)); 3],
    };
    let corrections = crate::LensCorrections::ALL;
    let details = DngDetails { corrections: Some((corrections, &tables)), ..DngDetails::of_light(Illuminant::D65) };
    let bytes = written(&sensor, &raw, &details);
    let color = crate::ColorCorrection::Fitted(Illuminant::D65);
    let plain = Processing { color, denoise: Some(0.0), ..Processing::for_light(Illuminant::D65) };
    let own = sensor
        .develop_with(&raw, &Processing { lens_corrections: corrections, ..plain.clone() }, Some(&tables))
        .unwrap();
    let file = DngFile::from_bytes(&bytes).unwrap();
    assert_eq!((file.opcodes.join(" "), file.notes.len()), ("FixVignetteRadial WarpRectilinear".to_owned(), 0));
    let through = file.develop(&Processing { denoise: Some(0.0), ..Processing::default() }).unwrap();
    // Tables by cubic convolution and polynomials from middles of pixels differ by hundredths of a pixel.
    let psnr = psnr_db(&own.picture, &through.picture).unwrap();
    let ignored =
        DngFile::from_bytes_with(&bytes, &DngReading { opcodes: DngOpcodes::Ignored, ..DngReading::default() })
            .unwrap();
    assert!(ignored.opcodes.is_empty() && ignored.notes[0].contains("left out as asked"), "{:?}", ignored.notes);
    let uncorrected = ignored.develop(&Processing { denoise: Some(0.0), ..Processing::default() }).unwrap();
    let without = psnr_db(&own.picture, &uncorrected.picture).unwrap();
    assert!(psnr > 35.0 && psnr > without + 12.0, "{psnr} dB, without {without}");
}

#[test]
fn what_is_asked_for_and_not_done_is_noted() {
    let file = PLAIN.file(|d| {
        d.set(OPCODE_LIST_2, list(&[opcode(99, &[1, 2, 3]), opcode(6, &wholes(&[0, 0, 4, 4]))]));
        d.set(BASELINE_EXPOSURE, Value::SignedRational(vec![(1, 4)]));
        d.set(PROFILE_TONE_CURVE, Value::Double(vec![0.0, 0.0, 1.0, 1.0]));
    });
    let file = DngFile::from_bytes(&file).unwrap();
    let notes = [file.notes.clone(), file.left_out()].concat().join("; ");
    for word in ["opcode 99, TrimBounds, which is not done", "0.25 stops", "a tone curve"] {
        assert!(notes.contains(word), "{word}: {notes}");
    }
    let nothing = PLAIN.file(|d| d.set(BASELINE_EXPOSURE, Value::SignedRational(vec![(0, 0)])));
    let nothing = DngFile::from_bytes(&nothing).unwrap();
    assert!(nothing.notes.is_empty() && nothing.left_out().is_empty());
}

/// The parameters of a gain map of so many points each way, without its factors.
fn map_head(points: u32) -> Vec<u8> {
    [wholes(&ALL), wholes(&[points, points]), doubles(&[0.1, 0.1, 0.0, 0.0]), wholes(&[1])].concat()
}

#[test]
fn broken_opcodes_are_refused_in_a_sentence() {
    for (word, opcodes) in [
        ("list with 4 entries", opcode(1, &wholes(&[1]))[..18].to_vec()),
        ("cut short", opcode(3, &[1, 2, 3])),
        ("as many as its bytes hold", opcode(9, &[map_head(1 << 30), singles(&[1.0])].concat())),
        ("WarpRectilinear with 7 entries", opcode(1, &wholes(&[7]))),
        ("of no plane", opcode(2, &[wholes(&[0]), doubles(&[0.5, 0.5])].concat())),
        ("degree 9", opcode(8, &[wholes(&ALL), wholes(&[9])].concat())),
        ("without pixels", opcode(8, &[wholes(&[5, 0, 5, 16, 0, 1, 1, 1]), wholes(&[0]), doubles(&[1.0])].concat())),
        ("not finite", opcode(3, &doubles(&[f64::NAN; 7]))),
    ] {
        let reason = DngFile::from_bytes(&PLAIN.file(|d| d.set(OPCODE_LIST_3, list(std::slice::from_ref(&opcodes)))))
            .unwrap_err();
        assert!(reason.contains(word) && !reason.contains('\n'), "{word}: {reason}");
    }
}

#[test]
fn other_raw_formats_are_named_with_the_way_on() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("shot");
    let nikon = Stored { ..PLAIN }.file(|d| {
        d.set(MAKE, Value::Ascii("NIKON CORPORATION".to_owned()));
        d.set(SUB_DIRECTORIES, Value::Long(vec![8]));
        d.remove(DNG_VERSION);
    });
    for (bytes, name) in [
        (b"II*\0\x10\0\0\0CR\x02\0".to_vec(), "Canon CR2"),
        (b"\0\0\0\x18ftypcrx \0\0".to_vec(), "Canon CR3"),
        (b"FUJIFILMCCD-RAW 0201".to_vec(), "Fujifilm RAF"),
        (b"IIU\0\x18\0\0\0".to_vec(), "Panasonic RW2"),
        (nikon, "Nikon NEF"),
    ] {
        std::fs::write(&path, bytes).unwrap();
        let reason = DngFile::read(&path).unwrap_err().to_string();
        assert!(reason.contains(name) && reason.contains("DNG Converter"), "{reason}");
    }
}

#[test]
fn what_a_frame_lacks_is_noted_and_captions_of_cameras_are_not() {
    let read = |make: &str| {
        let file = PLAIN.file(|d| {
            d.set(MAKE, Value::Ascii(make.to_owned()));
            d.set(IMAGE_DESCRIPTION, Value::Ascii("a street".to_owned()));
        });
        DngFile::from_bytes(&file).unwrap()
    };
    for (make, n_notes) in [(OWN_MAKE, 1), ("Nikon", 0)] {
        let file = read(make);
        assert_eq!((file.notes.len(), file.shot.description.as_deref()), (n_notes, Some("a street")), "{make}");
    }
}

#[test]
fn files_that_are_no_such_frames_are_refused_in_a_sentence() {
    let refused = |word: &str, change: &dyn Fn(&mut Directory)| {
        let reason = DngFile::from_bytes(&PLAIN.file(change)).unwrap_err();
        assert!(reason.contains(word) && !reason.contains('\n'), "{word}: {reason}");
    };
    refused("compression 34892 of 14 bits", &|d| d.set(COMPRESSION, Value::Short(vec![34_892])));
    refused("compression 34713", &|d| d.set(COMPRESSION, Value::Short(vec![34_713])));
    refused("[32] bits", &|d| d.set(BITS_PER_SAMPLE, Value::Short(vec![32])));
    refused("no whole numbers", &|d| d.set(SAMPLE_FORMAT, Value::Short(vec![2])));
    refused("floats of [14] bits", &|d| d.set(SAMPLE_FORMAT, Value::Short(vec![3])));
    refused("deflated samples of 14 bits", &|d| d.set(COMPRESSION, Value::Short(vec![8])));
    refused("JPEG XL that cannot be decoded", &|d| d.set(COMPRESSION, Value::Short(vec![52_546])));
    refused("rows of 14 and columns of 1 fields", &|d| d.set(ROW_INTERLEAVE_FACTOR, Value::Short(vec![14])));
    refused("color map in field 50938 of 6 numbers", &|d| {
        d.set(PROFILE_HUE_SAT_MAP_DIMS, Value::Long(vec![1, 3, 1]));
        d.set(PROFILE_HUE_SAT_MAP_DATA_1, Value::Double(vec![0.0, 1.0, 1.0, 0.0, 1.0, 1.0]));
    });
    refused("tone curve", &|d| d.set(PROFILE_TONE_CURVE, Value::Double(vec![0.5, 0.0, 0.5, 1.0])));
    refused("planes one after the other", &|d| d.set(PLANAR_CONFIGURATION, Value::Short(vec![2])));
    refused("no raw frame", &|d| d.set(PHOTOMETRIC_INTERPRETATION, Value::Short(vec![2])));
    refused("mosaic of the size", &|d| d.set(CFA_REPEAT_PATTERN_DIM, Value::Short(vec![2, 99])));
    refused("number 9", &|d| d.set(CFA_PATTERN, Value::Byte(vec![0, 1, 9, 1])));
    refused("'C' is not among", &|d| d.set(CFA_PATTERN, Value::Byte(vec![0, 1, 3, 1])));
    refused("shifted", &|d| d.set(CFA_LAYOUT, Value::Short(vec![2])));
    refused("active area", &|d| d.set(ACTIVE_AREA, Value::Short(vec![0, 0, 14, 22])));
    refused("cropped", &|d| d.set(DEFAULT_CROP_SIZE, Value::Short(vec![23, 4])));
    refused("saturated at 5", &|d| {
        d.set(WHITE_LEVEL, Value::Long(vec![5]));
        d.set(BLACK_LEVEL, Value::Short(vec![9]));
    });
    refused("neutral of 0", &|d| d.set(AS_SHOT_NEUTRAL, Value::Rational(vec![(0, 1), (1, 1), (1, 1)])));
    refused("fraction over 0", &|d| d.set(AS_SHOT_NEUTRAL, Value::Rational(vec![(1, 0), (1, 1), (1, 1)])));
    refused("NoiseProfile", &|d| d.set(NOISE_PROFILE, Value::Double(vec![1.0; 4])));
    // Neither the samples of so many pixels nor their number may be taken on trust.
    refused("strips or tiles", &|d| d.set(IMAGE_LENGTH, Value::Long(vec![4_000_000_000])));
    refused("would take", &|d| {
        d.set(IMAGE_LENGTH, Value::Long(vec![4_000_000_000]));
        d.set(ROWS_PER_STRIP, Value::Long(vec![4_000_000_000]));
    });
    refused("bytes in a strip", &|d| d.set(STRIP_BYTE_COUNTS, Value::Long(vec![7; 4])));
    refused("ends before", &|d| d.set(STRIP_OFFSETS, Value::Long(vec![1 << 30; 4])));
}

/// Files of libjxl and libjpeg-turbo (`scripts/dng_pictured.py`), of codes by a formula.
const PICTURED: [(&str, &[u8]); 7] = [
    ("mosaic", include_bytes!("../../tests/dng/mosaic.dng")),
    ("mosaic-10", include_bytes!("../../tests/dng/mosaic-10.dng")),
    ("mosaic-jpeg", include_bytes!("../../tests/dng/mosaic-jpeg.dng")),
    ("planes", include_bytes!("../../tests/dng/planes.dng")),
    ("planes-half", include_bytes!("../../tests/dng/planes-half.dng")),
    ("planes-jpeg", include_bytes!("../../tests/dng/planes-jpeg.dng")),
    ("planes-jpeg-rgb", include_bytes!("../../tests/dng/planes-jpeg-rgb.dng")),
];

#[test]
fn tiles_that_are_pictures_are_read() {
    let uneven = |row: usize, column: usize| (row * 977 + column * 701 + (row * column * 37) % 251 * 50) % 65_536;
    let smooth = |row: usize, column: usize| {
        [10_000 + 300 * row + 400 * column, 20_000 + 500 * column, 40_000 - 700 * row].map(|code| code as f32)
    };
    for (name, bytes) in PICTURED {
        let file = DngFile::from_bytes(bytes).unwrap_or_else(|reason| panic!("{name} {reason}"));
        assert_eq!(file.stored, (44, 30), "{name}");
        // Without loss to the bit; with it within a hundredth of the range, two where a quarter of the pixels have chroma, a half float by its own
        // steps.
        let tolerance = match name {
            "mosaic" | "mosaic-10" => 1e-6,
            "planes-half" => 2.5e-4,
            "planes-jpeg" => 0.02,
            _ => 0.01,
        };
        for (plane, light) in file.raw.linear().iter().enumerate() {
            for ((row, column), light) in light.indexed_iter() {
                let wanted = match name {
                    "mosaic" => uneven(row, column) as f32 / 65_535.0,
                    "mosaic-10" => (uneven(row, column) >> 6) as f32 / 1023.0,
                    name if name.contains("jpeg") => (smooth(row, column)[plane] / 256.0).floor() / 255.0,
                    _ => smooth(row, column)[plane] / 65_535.0,
                };
                assert!((light - wanted).abs() <= tolerance, "{name} {plane} {row} {column}: {light} {wanted}");
            }
        }
        file.develop(&Processing::plain()).unwrap();
    }
}

/// The map of a profile is followed, its look where that is asked for, and what is left out is said.
#[test]
fn profiles_are_followed_as_far_as_asked() {
    let file = PLAIN.file(|d| {
        d.set(PROFILE_HUE_SAT_MAP_DIMS, Value::Long(vec![1, 2, 1]));
        d.set(PROFILE_HUE_SAT_MAP_DATA_1, Value::Double([0.0, 0.0, 1.0].repeat(2)));
        d.set(BASELINE_EXPOSURE, Value::SignedRational(vec![(-1, 1)]));
        d.set(PROFILE_TONE_CURVE, Value::Double(vec![0.0, 0.0, 1.0, 0.5]));
    });
    let file = DngFile::from_bytes(&file).unwrap();
    let picture = |rendering: DngRendering| {
        let file = DngFile { rendering, ..file.clone() };
        let curve = crate::ToneCurve::Linear;
        let picture = file.develop(&Processing { curve, ..Processing::plain() }).unwrap().picture.codes;
        (picture, file.left_out().concat())
    };
    let [(plain, left), (gray, less), (look, nothing)] =
        [DngRendering::Matrices, DngRendering::Colors, DngRendering::Look].map(picture);
    assert!(left.contains("hues") && left.contains("-1 stops") && less.contains("tone curve"), "{left} {less}");
    assert!(!less.contains("hues") && nothing.is_empty());
    let mut colored = 0;
    for ((plain, gray), look) in plain.outer_iter().zip(gray.outer_iter()).zip(look.outer_iter()) {
        for ((plain, gray), look) in plain.outer_iter().zip(gray.outer_iter()).zip(look.outer_iter()) {
            colored += usize::from((plain[0] - plain[1]).abs() > 0.01);
            // Without saturation all parts are alike; half the light is halved again by the curve.
            let inside = gray[1] < 0.99;
            assert!((gray[0] - gray[1]).abs() < 1e-4 && (gray[2] - gray[1]).abs() < 1e-4, "{gray}");
            assert!(!inside || (look[1] - 0.25 * gray[1]).abs() < 1e-4, "{look} {gray}");
        }
    }
    assert!(colored > 0);
}

#[test]
fn mutations_are_read_or_refused() {
    let sensor = small("imx363").with_size(12, 16);
    let own = written(&sensor, &frame(&sensor), &DngDetails::of_light(Illuminant::D65));
    let jpeg = Stored { tile: (6, Some(8)), jpeg_components: 2, ..PLAIN }.file(|d| {
        d.set(LINEARIZATION_TABLE, Value::Short((0..300).collect()));
        d.set(BLACK_LEVEL_REPEAT_DIM, Value::Short(vec![2, 2]));
        d.set(BLACK_LEVEL, Value::Rational(vec![(1, 1), (2, 1), (3, 1), (4, 1)]));
        let map = [wholes(&ALL), wholes(&[1, 2]), doubles(&[1.0, 1.0, 0.0, 0.0]), wholes(&[1]), singles(&[1.0, 2.0])];
        d.set(OPCODE_LIST_2, list(&[opcode(9, &map.concat()), opcode(5, &wholes(&[0, 1, 0, 3, 3]))]));
        let warp = [wholes(&[1]), doubles(&[1.0, 0.01, 0.0, 0.0, 0.0, 0.0, 0.5, 0.5])].concat();
        d.set(OPCODE_LIST_3, list(&[opcode(1, &warp), opcode(6, &wholes(&[1, 1, 12, 20]))]));
    });
    let mut state = 1_u64;
    let mut next = |below: usize| {
        // Knuth's linear congruential generator (MMIX).
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    let mut n_read = 0;
    let pictured = PICTURED.map(|(_, bytes)| bytes.to_vec());
    for whole in [own, jpeg, PLAIN.file(|_| ())].into_iter().chain(pictured) {
        for _ in 0..1500 {
            let mut bytes = whole.clone();
            for _ in 0..=next(3) {
                let at = next(bytes.len());
                bytes[at] = [0, 1, 0x7f, 0xff, next(256) as u8][next(5)];
            }
            if next(4) == 0 {
                bytes.truncate(next(bytes.len()));
            }
            match DngFile::from_bytes(&bytes) {
                Ok(file) => {
                    n_read += 1;
                    // What is read can be developed, or is refused.
                    let _ = file.develop(&Processing::plain());
                }
                Err(reason) => assert!(!reason.is_empty() && !reason.contains('\n'), "{reason}"),
            }
        }
    }
    assert!(n_read > 500, "{n_read}");
}

/// Returns a camera profile of these fields in a file of its own.
fn profile_file(change: impl FnOnce(&mut Directory)) -> Vec<u8> {
    let mut d = Directory::default();
    let matrix = [9000, -3000, -1000, -5000, 14_000, 1000, -500, 1500, 7000];
    d.set(UNIQUE_CAMERA_MODEL, Value::Ascii("Maker X1".to_owned()));
    d.set(PROFILE_NAME, Value::Ascii("Neutral".to_owned()));
    d.set(COLOR_MATRIX_1, Value::SignedRational(matrix.map(|m| (m, 10_000)).to_vec()));
    d.set(CALIBRATION_ILLUMINANT_1, Value::Short(vec![21]));
    change(&mut d);
    let mut bytes = d.into_file().unwrap();
    bytes[2..4].copy_from_slice(b"RC");
    bytes
}

#[test]
fn a_profile_of_its_own_stands_in_place_of_that_of_the_file() {
    // The same fields within the frame's file and beside it make the same picture.
    let map = |d: &mut Directory| {
        d.set(PROFILE_HUE_SAT_MAP_DIMS, Value::Long(vec![1, 2, 1]));
        d.set(PROFILE_HUE_SAT_MAP_DATA_1, Value::Double([[0.0, 1.0, 1.0], [20.0, 0.6, 0.9]].concat()));
        d.set(PROFILE_TONE_CURVE, Value::Double(vec![0.0, 0.0, 0.3, 0.5, 1.0, 1.0]));
        d.set(BASELINE_EXPOSURE_OFFSET, Value::SignedRational(vec![(1, 4)]));
    };
    let calibration = [9500, 0, 0, 0, 10_000, 0, 0, 0, 10_500].map(|m| (m, 10_000)).to_vec();
    let of_camera = |d: &mut Directory| {
        d.set(CAMERA_CALIBRATION_1, Value::SignedRational(calibration.clone()));
        d.set(BASELINE_EXPOSURE, Value::SignedRational(vec![(1, 2)]));
    };
    let own = PLAIN.file(|d| {
        of_camera(d);
        let matrix = [9000, -3000, -1000, -5000, 14_000, 1000, -500, 1500, 7000];
        d.set(COLOR_MATRIX_1, Value::SignedRational(matrix.map(|m| (m, 10_000)).to_vec()));
        map(d);
    });
    let plain = PLAIN.file(|d| {
        of_camera(d);
        d.set(UNIQUE_CAMERA_MODEL, Value::Ascii("Maker X1".to_owned()));
    });
    let reading = |bytes: &[u8]| DngReading {
        rendering: DngRendering::Look,
        profile: Some(ProfileFile::from_bytes(bytes).unwrap()),
        ..DngReading::default()
    };
    let picture = |bytes: &[u8], reading: &DngReading| {
        let file = DngFile::from_bytes_with(bytes, reading).unwrap();
        let usual = Processing { denoise: Some(0.0), ..Processing::default() };
        (file.develop(&usual).unwrap().picture, file.notes)
    };
    let look = DngReading { rendering: DngRendering::Look, ..DngReading::default() };
    let (expected, _) = picture(&own, &look);
    let (found, notes) = picture(&plain, &reading(&profile_file(map)));
    assert_eq!((found, notes), (expected.clone(), vec![]));
    // A DNG file lends its profile too.
    assert_eq!(picture(&plain, &reading(&own)).0, expected);
    let (without, _) = picture(&plain, &look);
    assert!(without != expected);
    // Calibrations of a camera go with profiles of the same signature alone.
    let signed = profile_file(|d| {
        map(d);
        d.set(PROFILE_CALIBRATION_SIGNATURE, Value::Ascii("com.adobe".to_owned()));
    });
    assert!(picture(&plain, &reading(&signed)).0 != expected);
    let name = ProfileFile::from_bytes(&signed).unwrap().name();
    assert_eq!(name.as_deref(), Some("Neutral"));
    // A profile for another camera is named.
    let other = profile_file(|d| d.set(UNIQUE_CAMERA_MODEL, Value::Ascii("Maker X2".to_owned())));
    let (_, notes) = picture(&plain, &reading(&other));
    assert!(notes[0].contains("Maker X2") && notes[0].contains("Maker X1"), "{notes:?}");
    let refused = |bytes: &[u8]| ProfileFile::from_bytes(bytes).unwrap_err();
    assert!(refused(b"RIFF....").contains("IIRC"));
    assert!(refused(&profile_file(|d| d.set(COLOR_MATRIX_1, Value::SignedRational(vec![])))[..40]).contains("ends"));
    let single = Stored { n_planes: 1, ..PLAIN }.file(|d| {
        d.set(PHOTOMETRIC_INTERPRETATION, Value::Short(vec![LINEAR_RAW]));
    });
    let reason = DngFile::from_bytes_with(&single, &reading(&profile_file(|_| ()))).unwrap_err();
    assert!(reason.contains("one filter"), "{reason}");
}

#[test]
fn masked_pixels_are_black_where_a_file_states_none_or_it_is_asked() {
    // Codes rise by row and column; the first two rows are masked.
    let stored = Stored { rows: 16, columns: 24, bits: 12, ..PLAIN };
    let codes = stored.codes();
    let mean = codes[..48].iter().map(|code| f64::from(*code)).sum::<f64>() / 48.0;
    let areas = |d: &mut Directory| {
        d.set(ACTIVE_AREA, Value::Long(vec![2, 0, 16, 24]));
        d.set(MASKED_AREAS, Value::Long(vec![0, 0, 2, 24]));
        d.set(WHITE_LEVEL, Value::Long(vec![4095]));
    };
    let black = |bytes: &[u8], black: DngBlack| {
        DngFile::from_bytes_with(bytes, &DngReading { black, ..DngReading::default() }).unwrap().raw.levels.black
    };
    let without = stored.file(areas);
    assert!((black(&without, DngBlack::Stated) - mean).abs() < 1e-9);
    let with = stored.file(|d| {
        areas(d);
        d.set(BLACK_LEVEL, Value::Long(vec![7]));
    });
    assert_eq!(black(&with, DngBlack::Stated), 7.0);
    assert!((black(&with, DngBlack::Masked) - mean).abs() < 1e-9);
    for (areas, reason) in [
        (vec![0, 0, 2, 25], "masked areas"),
        (vec![0, 0, 2], "masked areas"),
        ([0, 0, 16, 24].repeat(2), "overlap"),
        ([0, 0, 1, 1].repeat(65), "up to 64"),
    ] {
        let file = stored.file(|d| d.set(MASKED_AREAS, Value::Long(areas.clone())));
        assert!(DngFile::from_bytes(&file).unwrap_err().contains(reason), "{areas:?}");
    }
    let bright = stored.file(|d| {
        areas(d);
        d.set(WHITE_LEVEL, Value::Long(vec![1]));
    });
    assert!(DngFile::from_bytes(&bright).unwrap_err().contains("masked pixels"));
}

#[test]
fn local_gains_follow_the_formula_of_the_specification() {
    // Four tables over the pixels that see light, of which a row and a column are not shown: gains rise with light and from table to table.
    let gain =
        |row: u32, column: u32, entry: u32| 1.0 + 0.25 * row as f32 + 0.125 * column as f32 + 0.0625 * entry as f32;
    let weights = [0.25, 0.25, 0.25, 0.125, 0.125];
    let (spacing, origin, entries) = (0.5, 0.25, 8);
    let map = super::gain_table::tests::bytes([2, 2, entries], [spacing, spacing, origin, origin], weights, gain);
    let stored = Stored { rows: 16, columns: 24, bits: 12, ..PLAIN };
    let with_map = |d: &mut Directory| {
        d.set(DEFAULT_CROP_ORIGIN, Value::Long(vec![2, 4]));
        d.set(DEFAULT_CROP_SIZE, Value::Long(vec![20, 10]));
        d.set(BASELINE_EXPOSURE, Value::SignedRational(vec![(-1, 1)]));
        d.set(PROFILE_GAIN_TABLE_MAP, Value::Undefined(map.clone()));
    };
    let picture = |rendering: DngRendering, processing: &Processing| {
        let file = DngFile { rendering, ..DngFile::from_bytes(&stored.file(with_map)).unwrap() };
        assert!(file.notes.is_empty(), "{:?}", file.notes);
        file.develop(processing).map(|developed| (developed.picture.codes, file.left_out().concat()))
    };
    let linear = Processing { curve: crate::ToneCurve::Linear, ..Processing::plain() };
    let (plain, left) = picture(DngRendering::Colors, &linear).unwrap();
    assert!(left.contains("local map of gains"), "{left}");
    let (found, left) = picture(DngRendering::Look, &linear).unwrap();
    assert!(left.is_empty(), "{left}");
    // ROMM RGB of linear sRGB, D65 to D50 by Bradford.
    let romm =
        [[0.529_280, 0.330_162, 0.140_477], [0.098_366, 0.873_463, 0.028_178], [0.016_875, 0.117_662, 0.865_426]];
    let mut compared = 0;
    for row in 0..10 {
        for column in 0..20 {
            let srgb = [0, 1, 2].map(|i| 0.5 * plain[(row, column, i)]);
            let inside =
                srgb.iter().all(|part| (0.001..0.49).contains(part)) && (0..3).all(|i| found[(row, column, i)] < 0.99);
            if !inside {
                continue;
            }
            let rgb: [f32; 3] = romm.map(|line: [f32; 3]| line.iter().zip(srgb).map(|(m, v)| m * v).sum());
            let (least, most) = (rgb[0].min(rgb[1]).min(rgb[2]), rgb[0].max(rgb[1]).max(rgb[2]));
            let light = (0.25 * (rgb[0] + rgb[1] + rgb[2]) + 0.125 * (least + most)).clamp(0.0, 1.0);
            // Half a pixel in, over all that sees light; the ends of the map go on.
            let place = |i: usize, n: f32| ((i as f32 + 0.5) / n - 0.25) / 0.5;
            let (down, right) = (place(row + 4, 16.0).clamp(0.0, 1.0), place(column + 2, 24.0).clamp(0.0, 1.0));
            let expected = 1.0 + 0.25 * down + 0.125 * right + 0.0625 * (8.0 * light).min(7.0);
            for i in 0..3 {
                let ratio = found[(row, column, i)] / srgb[i];
                assert!((ratio / expected - 1.0).abs() < 2e-3, "{row} {column} {i}: {ratio} {expected}");
            }
            compared += 1;
        }
    }
    assert!(compared > 20, "{compared}");
    let aslant = Processing { perspective: Some(crate::Perspective::parse("0.1,0,0.9,0,1,1,0,1").unwrap()), ..linear };
    assert!(picture(DngRendering::Look, &aslant).unwrap_err().to_string().contains("local map of gains"));
    let broken = |bytes: Vec<u8>| {
        let file = stored.file(|d| d.set(PROFILE_GAIN_TABLE_MAP, Value::Undefined(bytes.clone())));
        DngFile::from_bytes(&file).unwrap_err()
    };
    assert!(broken(map[..60].to_vec()).contains("cut short"));
    assert!(broken(map[..map.len() - 4].to_vec()).contains("bytes"));
    let infinite = super::gain_table::tests::bytes([1, 1, 1], [0.0; 4], weights, |_, _, _| f32::INFINITY);
    assert!(broken(infinite).contains("numbers that are none"));
    let spaced = super::gain_table::tests::bytes([2, 1, 1], [0.0; 4], weights, |_, _, _| 1.0);
    assert!(broken(spaced).contains("spaced"));
}
