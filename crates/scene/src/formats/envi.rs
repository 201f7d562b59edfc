//! ENVI files: a text header and a file of plain numbers.

use std::{
    fs::{self, File},
    io::{Read, Seek, SeekFrom},
    path::{Path, PathBuf},
};

use dioptric_spectrum::{Quantity, SpectralImage, WavelengthGrid};
use ndarray::Array2;

use super::{
    envi_header::{self, DataType, EnviHeader, Interleave},
    light_unit::LightUnit,
    unusable::{check_memory, unreadable},
};
use crate::SceneError;

/// A text header longer than this is none.
const LIMIT_HEADER_BYTES: u64 = 64 << 20;
/// Endings of the file of numbers beside `NAME.hdr`; none at all as well.
const DATA_ENDINGS: [&str; 8] = ["", "raw", "img", "dat", "bsq", "bil", "bip", "bin"];

/// The numbers of an ENVI file, as stored, with what its header states of them.
#[derive(Clone, Debug, PartialEq)]
pub struct EnviCube {
    file: PathBuf,
    /// The bands, in ascending order.
    pub grid: WavelengthGrid,
    /// The numbers as stored, one plane a band.
    pub planes: Vec<Array2<f32>>,
    /// What the header says a perfect white is stored as.
    pub reflectance_scale: Option<f64>,
    /// What the header says of units.
    pub data_units: Option<String>,
}

impl EnviCube {
    /// Returns the cube as an image: radiance where the header's `data units` are of radiance (`W/m^2/sr/nm`, `uW/(cm^2 sr nm)`,
    /// `photons/s/m^2/sr/nm` and their like), or else the reflectance.
    ///
    /// Reflectance is relative to, in this order: `white_level`, the header's `reflectance scale factor`, or the cubes
    /// `white_reference*.hdr` and `dark_reference*.hdr` beside the file. Numbers below 0, which the noise of a dark
    /// sample gives, become 0.
    ///
    /// # Errors
    /// When nothing states what a perfect white is.
    pub fn into_image(self, white_level: Option<f64>) -> Result<SpectralImage, SceneError> {
        let unit = self.data_units.as_deref().and_then(LightUnit::parse);
        if let (None, Some(unit)) = (white_level, unit.filter(|unit| unit.quantity == Quantity::Radiance)) {
            return self.radiance(unit);
        }
        if let Some(scale) = white_level.or(self.reflectance_scale) {
            let mut scaled = self;
            scaled.planes.iter_mut().for_each(|plane| plane.mapv_inplace(|v| (f64::from(v) / scale) as f32));
            return scaled.clipped().image(Quantity::Reflectance);
        }
        let (white, dark) = (self.beside("white_reference")?, self.beside("dark_reference")?);
        match (white, dark) {
            (Some(white), Some(dark)) => self.reflectance(&white, &dark),
            _ => Err(SceneError::Units {
                file: self.file,
                reason: "nothing tells what a perfect white is: expected 'reflectance scale factor' in the header, \
                    white_reference and dark_reference files beside it, or a white level"
                    .to_owned(),
            }),
        }
    }

    /// Returns the reflectance (sample − dark) / (white − dark) from cubes of a perfect white and of no light.
    ///
    /// The references may be of the cube's size, or of one line, which then serves for every line. A sample whose white
    /// is not above its dark is 0.
    ///
    /// # Errors
    /// When the references have other bands or another size.
    pub fn reflectance(mut self, white: &Self, dark: &Self) -> Result<SpectralImage, SceneError> {
        let (rows, columns) = self.planes[0].dim();
        for reference in [white, dark] {
            let (found_rows, found_columns) = reference.planes[0].dim();
            if reference.planes.len() != self.planes.len()
                || found_columns != columns
                || (found_rows != rows && found_rows != 1)
            {
                let reason = format!(
                    "{found_rows} × {found_columns} samples in {} bands: expected {rows} × {columns} in {}, as in {}",
                    reference.planes.len(),
                    self.planes.len(),
                    self.file.display()
                );
                return Err(unreadable(&reference.file, reason));
            }
        }
        for ((plane, white), dark) in self.planes.iter_mut().zip(&white.planes).zip(&dark.planes) {
            for ((row, column), sample) in plane.indexed_iter_mut() {
                let at = |reference: &Array2<f32>| reference[(row % reference.nrows(), column)];
                let (white, dark) = (at(white), at(dark));
                *sample = if white > dark { (*sample - dark) / (white - dark) } else { 0.0 };
            }
        }
        self.clipped().image(Quantity::Reflectance)
    }

    /// Returns the radiance of numbers in a unit.
    fn radiance(mut self, unit: LightUnit) -> Result<SpectralImage, SceneError> {
        for (plane, &wavelength_nm) in self.planes.iter_mut().zip(self.grid.centers_nm()) {
            unit.convert(plane, wavelength_nm);
        }
        self.image(Quantity::Radiance)
    }

    fn clipped(mut self) -> Self {
        self.planes.iter_mut().for_each(|plane| plane.mapv_inplace(|v| if v < 0.0 { 0.0 } else { v }));
        self
    }

    fn image(self, quantity: Quantity) -> Result<SpectralImage, SceneError> {
        let values = |reason| SceneError::Values { file: self.file.clone(), reason };
        let image = SpectralImage::new(quantity, self.grid, self.planes).map_err(values)?;
        image.check_samples().map_err(values)?;
        Ok(image)
    }

    /// Reads the cube beside this one whose name starts so, if there is one.
    fn beside(&self, start: &str) -> Result<Option<Self>, SceneError> {
        let folder = self.file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let entries = fs::read_dir(folder).map_err(|error| unreadable(folder, error))?;
        let mut found: Vec<PathBuf> = entries
            .filter_map(|entry| Some(entry.ok()?.path()))
            .filter(|path| path.extension().is_some_and(|e| e == "hdr"))
            .filter(|path| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(start)))
            .collect();
        found.sort();
        found.first().map(|path| read_envi(path)).transpose()
    }
}

/// Reads an ENVI header and the file of numbers beside it: BSQ, BIL or BIP, any real data type and byte order.
///
/// # Errors
/// Names the line and key of the header that is wrong, or the file of numbers when it is absent or too short.
pub fn read_envi(header_path: &Path) -> Result<EnviCube, SceneError> {
    let mut bytes = Vec::new();
    let file = File::open(header_path).map_err(|error| unreadable(header_path, error))?;
    file.take(LIMIT_HEADER_BYTES).read_to_end(&mut bytes).map_err(|error| unreadable(header_path, error))?;
    let header = envi_header::parse(header_path, &String::from_utf8_lossy(&bytes))?;
    let data_path = data_file(header_path)?;
    let bytes = read_samples(&data_path, &header)?;
    let mut bands: Vec<(f64, Array2<f32>)> =
        header.wavelengths_nm.iter().enumerate().map(|(band, &nm)| (nm, plane(&header, &bytes, band))).collect();
    bands.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (wavelengths_nm, planes) = bands.into_iter().unzip();
    let grid = WavelengthGrid::new(wavelengths_nm)
        .map_err(|reason| SceneError::Values { file: header_path.to_owned(), reason })?;
    Ok(EnviCube {
        file: header_path.to_owned(),
        grid,
        planes,
        reflectance_scale: header.reflectance_scale,
        data_units: header.data_units,
    })
}

/// Returns the file of numbers: `a.raw` and the like beside `a.hdr`, or `a.raw` beside `a.raw.hdr`.
fn data_file(header_path: &Path) -> Result<PathBuf, SceneError> {
    let found = DATA_ENDINGS.iter().map(|ending| header_path.with_extension(ending)).find(|path| path.is_file());
    found.ok_or_else(|| {
        let names = format!("{}[.raw, .img, …]", header_path.with_extension("").display());
        unreadable(header_path, format!("its file of numbers, {names}, is not there"))
    })
}

/// Reads exactly the samples that the header promises.
fn read_samples(path: &Path, header: &EnviHeader) -> Result<Vec<u8>, SceneError> {
    let wanted = [header.columns, header.rows, header.bands]
        .iter()
        .fold(header.data_type.bytes() as u64, |product, &n| product.saturating_mul(n as u64));
    let samples = wanted / header.data_type.bytes() as u64;
    let mut file = File::open(path).map_err(|error| unreadable(path, error))?;
    let length = file.metadata().map_err(|error| unreadable(path, error))?.len();
    // The bytes of the file, and the single floats that they become.
    check_memory(path, wanted.saturating_add(samples.saturating_mul(4)), length)?;
    if length < header.offset.saturating_add(wanted) {
        let reason = format!(
            "it holds {length} bytes, but its header asks for {wanted} after an offset of {}: truncated?",
            header.offset
        );
        return Err(unreadable(path, reason));
    }
    let mut bytes = vec![0; wanted as usize];
    file.seek(SeekFrom::Start(header.offset))
        .and_then(|_| file.read_exact(&mut bytes))
        .map_err(|error| unreadable(path, error))?;
    Ok(bytes)
}

fn plane(header: &EnviHeader, bytes: &[u8], band: usize) -> Array2<f32> {
    let (rows, columns, bands) = (header.rows, header.columns, header.bands);
    let size = header.data_type.bytes();
    Array2::from_shape_fn((rows, columns), |(row, column)| {
        let index = match header.interleave {
            Interleave::Bsq => (band * rows + row) * columns + column,
            Interleave::Bil => (row * bands + band) * columns + column,
            Interleave::Bip => (row * columns + column) * bands + band,
        };
        number(&bytes[index * size..(index + 1) * size], header.data_type, header.is_big_endian)
    })
}

fn number(bytes: &[u8], data_type: DataType, is_big_endian: bool) -> f32 {
    let mut little = [0; 8];
    little[..bytes.len()].copy_from_slice(bytes);
    if is_big_endian {
        little[..bytes.len()].reverse();
    }
    let four = [little[0], little[1], little[2], little[3]];
    let two = [little[0], little[1]];
    match data_type {
        DataType::U8 => f32::from(little[0]),
        DataType::I16 => f32::from(i16::from_le_bytes(two)),
        DataType::U16 => f32::from(u16::from_le_bytes(two)),
        DataType::I32 => i32::from_le_bytes(four) as f32,
        DataType::U32 => u32::from_le_bytes(four) as f32,
        DataType::F32 => f32::from_le_bytes(four),
        DataType::F64 => f64::from_le_bytes(little) as f32,
        DataType::I64 => i64::from_le_bytes(little) as f32,
        DataType::U64 => u64::from_le_bytes(little) as f32,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

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
                    let cube = read_envi(&path).unwrap();
                    // The header lists the bands downwards; they come back upwards.
                    assert_eq!(cube.grid.centers_nm(), [500.0, 600.0]);
                    for (place, band) in [(0, 1), (1, 0)] {
                        let expected = Array2::from_shape_fn((4, 3), |(r, c)| f32::from(value(band, r, c)));
                        assert_eq!(cube.planes[place], expected, "{interleave} {data_type} {order}");
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
        let cube = read_envi(&path).unwrap();
        let message = cube.clone().into_image(None).unwrap_err().to_string();
        assert!(message.contains("a.hdr") && message.contains("reflectance scale factor"), "{message}");
        let given = cube.clone().into_image(Some(100.0)).unwrap();
        assert_eq!(given.spectrum_at(0, 1), [1.01_f32, 0.01].map(f64::from));
        let scaled = write(folder.path(), "b", &format!("{text}reflectance scale factor = 100\n"), &bytes);
        assert_eq!(read_envi(&scaled).unwrap().into_image(None).unwrap(), given);
        write(folder.path(), "white_reference_1", &text, &[201; 29]);
        write(folder.path(), "dark_reference_1", &text, &[1; 29]);
        let referred = cube.into_image(None).unwrap();
        // (101 − 1) / (201 − 1), and a sample below the dark is 0.
        assert_eq!(referred.spectrum_at(0, 1)[0], 0.5);
        assert_eq!(referred.spectrum_at(0, 0)[1], 0.0);
        let units = write(folder.path(), "c", &format!("{text}data units = W/m^2/sr/nm\n"), &bytes);
        assert_eq!(read_envi(&units).unwrap().into_image(None).unwrap().quantity(), Quantity::Radiance);
    }

    #[test]
    fn a_short_or_absent_file_of_numbers_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = write(folder.path(), "a", &header(4, "bsq", 0), &samples(1, "bsq", 0));
        let message = read_envi(&path).unwrap_err().to_string();
        assert!(message.contains("a.raw") && message.contains("truncated"), "{message}");
        fs::remove_file(folder.path().join("a.raw")).unwrap();
        assert!(read_envi(&path).unwrap_err().to_string().contains("is not there"));
        let huge = header(4, "bsq", 0).replace("samples = 3", "samples = 99999999999");
        let path = write(folder.path(), "a", &huge, &[]);
        assert!(matches!(read_envi(&path), Err(SceneError::TooLarge { .. })));
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
            n_refused += usize::from(read_envi(&path).is_err());
        }
        assert!(n_refused > 1000, "{n_refused} of 3000 refused");
    }

    #[dioptric_golden::needs_shared]
    #[test]
    fn the_corn_kernel_is_a_reflectance() {
        let Some(path) = dioptric_golden::shared("data/scenes/envi_corn_kernel/4-22-22_right_same_B73_top_00.hdr")
        else {
            return;
        };
        let cube = read_envi(&path).unwrap();
        assert_eq!((cube.grid.len(), cube.planes[0].dim()), (580, (31, 43)));
        let image = cube.into_image(None).unwrap();
        let (row, column) = (15, 21);
        let at = |nm: f64| image.spectrum_at(row, column)[image.grid().nearest(nm)];
        // A yellow kernel: blue is absorbed, red is not.
        assert!(at(450.0) < 0.5 * at(600.0) && at(600.0) > 0.2 && at(600.0) < 1.2);
    }
}
