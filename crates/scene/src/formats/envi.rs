//! ENVI files: a text header and a file of plain numbers.

use std::{
    fs::{self, File},
    io::Read,
    path::{Path, PathBuf},
};

use dioptric_spectrum::{Quantity, SpectralImage, WavelengthGrid};

use super::{
    contents::{Contents, Image},
    envi_data::{EnviFile, Meaning, Wanted},
    envi_header::{self, DataType},
    light_unit::LightUnit,
    read_options::ReadOptions,
    reading::{FileQuantity, NoData, light_unit},
    reduced::reduced_size,
    stated::{name_of, note_of, short},
    unusable::unreadable,
};
use crate::{SceneError, resample::resampling_weights};

/// A text header longer than this is none.
const LIMIT_HEADER_BYTES: u64 = 64 << 20;
/// Endings of the file of numbers beside `NAME.hdr`; none at all as well.
const DATA_ENDINGS: [&str; 9] = ["", "raw", "img", "dat", "bsq", "bil", "bip", "bin", "cube"];

/// Reads an ENVI header and the file of numbers beside it: BSQ, BIL or BIP, any real data type and byte order. Of the file only what
/// the wanted bands need is read, a few lines at a time.
///
/// Numbers are light where the header's `data units` say so (`W/m^2/sr/nm`, `uW/(cm^2 sr nm)`, `photons/s/m^2/sr/nm` and their like)
/// or `data gain values` make them so, or else reflectances relative to, in this order: the white level of the options, the header's
/// `reflectance scale factor`, or the cubes `white_reference*.hdr` and `dark_reference*.hdr` beside the file.
///
/// # Errors
/// Names the line and key of the header that is wrong, the file of numbers when it is absent or too short, or what is missing to
/// know what the numbers are.
pub(super) fn contents_of_envi(path: &Path, options: &ReadOptions) -> Result<Contents, SceneError> {
    let wanted_nm = options.grid.as_ref().map(WavelengthGrid::centers_nm);
    let file = EnviFile::open(path, options.reading.wavelengths_nm.as_deref(), wanted_nm)?;
    let (meaning, what) = file.meaning(options)?;
    let mut notes: Vec<String> = file.notes.clone();
    notes.extend(file.unused_unit(path));
    let order = file.order();
    let own = WavelengthGrid::new(order.iter().map(|&band| file.wavelengths_nm[band]).collect())
        .map_err(|reason| SceneError::Values { file: path.to_owned(), reason })?;
    let wanted = options.grid.clone().unwrap_or_else(|| own.clone());
    // Each wanted band with those of the file that it is made of.
    let weights = if wanted == own {
        (0..own.len()).map(|band| vec![(band, 1.0)]).collect()
    } else {
        resampling_weights(&own, &wanted)?
    };
    let choice = options.reading.no_data.unwrap_or_default();
    let own_size = (file.header.rows, file.header.columns);
    // Rows that get the nearest of other rows need all of them.
    let reduced = match choice {
        NoData::Fill => None,
        NoData::Black | NoData::Refuse => reduced_size(path, options, own_size, 4 * wanted.len() as u64),
    };
    notes.extend(reduced.as_ref().map(|reduced| reduced.note.clone()));
    let size = reduced.map_or(own_size, |reduced| (reduced.rows, reduced.columns));
    let asked = Wanted { order: &order, weights: &weights, grid: &wanted, size, choice };
    let (planes, mended) = file.planes(&asked, &meaning)?;
    notes.extend(mended.note(path, choice));
    let quantity = if matches!(meaning, Meaning::Light(..)) { Quantity::Radiance } else { Quantity::Reflectance };
    let image = SpectralImage::new(quantity, wanted, planes)
        .map_err(|reason| SceneError::Values { file: path.to_owned(), reason })?;
    Ok(Contents { notes, own_grid: Some(own), ..Contents::of(Image::Spectral(image), what) })
}

/// Returns the length of the numbers of an ENVI file, by its header or themselves; `None` where it is none.
pub fn envi_bytes(path: &Path) -> Option<u64> {
    let is_header = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("hdr"));
    let header = if is_header { path.to_owned() } else { header_of(path)? };
    Some(fs::metadata(data_file(&header, &mut vec![]).ok()?).ok()?.len())
}

/// Returns the header that belongs to a file: itself, or `a.raw.hdr` or `a.hdr` for `a.raw`.
pub(super) fn header_of(path: &Path) -> Option<PathBuf> {
    let appended = |ending: &str| {
        let mut name = path.as_os_str().to_owned();
        name.push(ending);
        PathBuf::from(name)
    };
    let candidates = [appended(".hdr"), path.with_extension("hdr"), appended(".HDR"), path.with_extension("HDR")];
    candidates.into_iter().find(|header| header != path && header.is_file())
}

impl EnviFile {
    /// Reads the header and finds the file of numbers. Bands whose wavelengths nothing states are those wanted, where there are as many.
    fn open(header_path: &Path, told_nm: Option<&[f64]>, wanted_nm: Option<&[f64]>) -> Result<Self, SceneError> {
        let mut bytes = Vec::new();
        let file = File::open(header_path).map_err(|error| unreadable(header_path, error))?;
        file.take(LIMIT_HEADER_BYTES).read_to_end(&mut bytes).map_err(|error| unreadable(header_path, error))?;
        let mut header = envi_header::parse(header_path, &String::from_utf8_lossy(&bytes))?;
        let mut notes: Vec<String> = header.note.take().into_iter().collect();
        let wrong = |key: &str, reason: String| SceneError::Header {
            file: header_path.to_owned(),
            line: 0,
            key: key.to_owned(),
            reason,
        };
        let wavelengths_nm = match (told_nm, header.wavelengths_nm.take()) {
            (Some(told), own) => {
                if own.as_ref().is_some_and(|own| own != told) {
                    return Err(wrong(
                        "wavelength",
                        "the header has it: --wavelengths-nm says something else".to_owned(),
                    ));
                }
                told.to_vec()
            }
            (None, Some(own)) => own,
            (None, None) => match wanted_nm.filter(|wanted| wanted.len() == header.bands) {
                Some(wanted) => wanted.to_vec(),
                None => {
                    let reason = format!(
                        "the header lacks it: expected it there, or --wavelengths-nm, {} numbers",
                        header.bands
                    );
                    return Err(wrong("wavelength", reason));
                }
            },
        };
        if wavelengths_nm.len() != header.bands {
            let reason =
                format!("{} wavelengths, expected one for each of {} bands", wavelengths_nm.len(), header.bands);
            return Err(wrong("wavelength", reason));
        }
        let n_bad = header.bad_bands.iter().filter(|bad| **bad).count();
        if n_bad == header.bands {
            return Err(wrong("bbl", "all bands are bad".to_owned()));
        }
        if n_bad > 0 {
            let name = name_of(header_path);
            notes.push(format!(
                "{name}: {n_bad} of {} bands are bad (bbl) and left out: spectra run across",
                header.bands
            ));
        }
        let data_path = data_file(header_path, &mut notes)?;
        let this = Self { header_path: header_path.to_owned(), data_path, header, wavelengths_nm, notes };
        this.checked()
    }

    /// Checks that the file of numbers is as long as the header says.
    fn checked(mut self) -> Result<Self, SceneError> {
        let wanted = self.frame_bytes().saturating_mul(self.n_frames());
        let length = fs::metadata(&self.data_path).map_err(|error| unreadable(&self.data_path, error))?.len();
        // What follows the last frame may be left out.
        let needed = self.header.offset.saturating_add(wanted).saturating_sub(self.header.frame_offsets[1]);
        if length < needed {
            let reason = format!(
                "it holds {length} bytes, but its header asks for {wanted} after an offset of {}: truncated?",
                self.header.offset
            );
            return Err(unreadable(&self.data_path, reason));
        }
        let end = self.header.offset.saturating_add(wanted);
        if length > end {
            let name = name_of(&self.data_path);
            self.notes
                .push(format!("{name}: {} bytes after those that its header speaks of are not used", length - end));
        }
        Ok(self)
    }

    /// Returns the good bands by ascending wavelength.
    fn order(&self) -> Vec<usize> {
        let is_good = |band: &usize| !self.header.bad_bands.get(*band).copied().unwrap_or(false);
        let mut order: Vec<usize> = (0..self.header.bands).filter(is_good).collect();
        order.sort_by(|&a, &b| self.wavelengths_nm[a].total_cmp(&self.wavelengths_nm[b]));
        order
    }

    /// Returns the note of data units that are none of light, and say more than that the numbers are a share or a count.
    fn unused_unit(&self, path: &Path) -> Option<String> {
        const PLAIN: [&str; 9] =
            ["", "reflectance", "transmittance", "unitless", "dimensionless", "none", "unknown", "dn", "%"];
        let unit = self.header.data_units.as_deref()?;
        let is_plain = PLAIN.contains(&unit.to_lowercase().as_str()) || LightUnit::parse(unit).is_some();
        if is_plain { None } else { note_of(path, "unit", &[unit.to_owned()]) }
    }

    /// Decides what the numbers are, and says so.
    fn meaning(&self, options: &ReadOptions) -> Result<(Meaning, String), SceneError> {
        let (header, reading) = (&self.header, &options.reading);
        let scale = reading.scale.unwrap_or(1.0);
        let units = |reason: String| Err(SceneError::Units { file: self.header_path.clone(), reason });
        let own_unit = header.data_units.as_deref().and_then(LightUnit::parse);
        let own_unit = own_unit.filter(|unit| unit.quantity == Quantity::Radiance);
        let has_gains = header.gains.is_some() || header.offsets.is_some();
        let is_reflecting = header.are_gains_of_reflectance || header.reflectance_scale.is_some();
        let told_unit = reading.unit.as_deref().map(light_unit).transpose()?;
        let wants_light = match reading.quantity {
            Some(FileQuantity::Reflectance) => Some(false),
            Some(_) => Some(true),
            None if told_unit.is_some() => Some(true),
            None if options.white_level.is_some() => Some(false),
            None => None,
        };
        if let (Some(wanted), Some(_)) = (wants_light, own_unit)
            && (!wanted || told_unit.is_some_and(|told| Some(told) != own_unit))
            && options.white_level.is_none()
        {
            let unit = header.data_units.as_deref().unwrap_or_default();
            return units(format!(
                "its data units are '{}', which says something else than was asked for",
                short(unit)
            ));
        }
        // Gains without a unit are those of ENVI, W m⁻² sr⁻¹ µm⁻¹.
        let gain_unit = || LightUnit::parse("W/m^2/sr/um").filter(|_| has_gains && !is_reflecting);
        let is_light = wants_light.unwrap_or(own_unit.is_some() || gain_unit().is_some());
        if is_light {
            let by_quantity = || reading.quantity.and_then(FileQuantity::light_unit);
            let unit = told_unit.or(own_unit).or_else(by_quantity).or_else(gain_unit).unwrap_or(LightUnit::RADIANCE);
            let words = match (reading.unit.as_deref(), header.data_units.as_deref().filter(|_| own_unit.is_some())) {
                (Some(told), _) => told.to_owned(),
                (None, Some(own)) => short(own),
                (None, None) if reading.quantity == Some(FileQuantity::Photons) => "photons/s/m^2/sr/nm".to_owned(),
                (None, None) if reading.quantity.is_none() => "W/m^2/sr/um by its gains".to_owned(),
                (None, None) => "W/m^2/sr/nm".to_owned(),
            };
            let factor = scale / header.radiance_scale.unwrap_or(1.0);
            let of_band = |&nm: &f64| factor * unit.factor_at(nm);
            let factors = self.wavelengths_nm.iter().map(of_band).collect();
            return Ok((Meaning::Light(factors), format!("radiance in {words}")));
        }
        let level = options.white_level.or(header.reflectance_scale);
        if let Some(level) = level {
            return Ok((Meaning::Reflectance(scale / level), format!("reflectance, {level} being a perfect white")));
        }
        if header.are_gains_of_reflectance {
            return Ok((Meaning::Reflectance(scale), "reflectance by its gains".to_owned()));
        }
        if let (Some(white), Some(dark)) = (self.beside("white_reference")?, self.beside("dark_reference")?) {
            let what =
                format!("reflectance between {} and {}", name_of(&white.header_path), name_of(&dark.header_path));
            self.check_reference(&white)?;
            self.check_reference(&dark)?;
            return Ok((Meaning::Between(Box::new([white, dark])), what));
        }
        let is_float = matches!(header.data_type, DataType::F32 | DataType::F64);
        if wants_light == Some(false) && (is_float || reading.scale.is_some()) {
            return Ok((Meaning::Reflectance(scale), "reflectance, 1 being a perfect white".to_owned()));
        }
        let unknown = header.data_units.as_deref().filter(|text| !text.is_empty());
        let unknown =
            unknown.map_or_else(String::new, |text| format!(", and '{}' is no unit of radiance", short(text)));
        units(format!(
            "nothing tells what a perfect white is{unknown}: expected 'reflectance scale factor' in the header, white_reference and \
             dark_reference files beside it, a white level (--white-level), or what the numbers are (--quantity, --unit)"
        ))
    }

    /// Checks that a reference has the bands and columns of this cube.
    fn check_reference(&self, reference: &Self) -> Result<(), SceneError> {
        let (own, found) = (&self.header, &reference.header);
        if (found.bands, found.columns) == (own.bands, own.columns) {
            return Ok(());
        }
        let reason = format!(
            "{} columns in {} bands: expected {} in {}, as in {}",
            found.columns,
            found.bands,
            own.columns,
            own.bands,
            self.header_path.display()
        );
        Err(unreadable(&reference.header_path, reason))
    }

    /// Opens the cube beside this one whose name starts so, if there is one.
    fn beside(&self, start: &str) -> Result<Option<Self>, SceneError> {
        let folder = self.header_path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new("."));
        let entries = fs::read_dir(folder).map_err(|error| unreadable(folder, error))?;
        let mut found: Vec<PathBuf> = entries
            .filter_map(|entry| Some(entry.ok()?.path()))
            .filter(|path| path.extension().is_some_and(|e| e == "hdr") && *path != self.header_path)
            .filter(|path| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(start)))
            .collect();
        found.sort();
        found.first().map(|path| Self::open(path, None, Some(&self.wavelengths_nm))).transpose()
    }
}

/// Returns the file of numbers: `a.raw` and the like beside `a.hdr`, or `a.raw` beside `a.raw.hdr`.
fn data_file(header_path: &Path, notes: &mut Vec<String>) -> Result<PathBuf, SceneError> {
    let upper = DATA_ENDINGS.iter().map(|ending| ending.to_uppercase());
    let endings = DATA_ENDINGS.iter().map(|ending| (*ending).to_owned()).chain(upper.skip(1));
    let mut found = endings.map(|ending| header_path.with_extension(ending)).filter(|path| path.is_file());
    let first = found.next().ok_or_else(|| {
        let names = format!("{}[.raw, .img, …]", header_path.with_extension("").display());
        unreadable(header_path, format!("its file of numbers, {names}, is not there"))
    })?;
    let is_other = |path: &PathBuf| fs::canonicalize(path).ok() != fs::canonicalize(&first).ok();
    notes.extend(note_of(header_path, "file", &found.filter(is_other).map(|path| name_of(&path)).collect::<Vec<_>>()));
    Ok(first)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FileReading, ReadOptions};
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
        write(
            folder.path(),
            "white_reference_1",
            &lines,
            &[200, 200, 200, 202, 202, 202, 200, 200, 200, 202, 202, 202],
        );
        assert_eq!(open(&path).unwrap(), referred);
        let units = write(folder.path(), "c", &format!("{text}data units = W/m^2/sr/nm\n"), &bytes);
        assert_eq!(open(&units).unwrap().quantity(), Quantity::Radiance);
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
        let refused =
            read_with(&path, &ReadOptions { reading: told, ..ReadOptions::default() }).unwrap_err().to_string();
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
                let options =
                    ReadOptions { white_level: Some(1.0), grid: Some(grid.clone()), ..ReadOptions::default() };
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
        let Some(path) = dioptric_golden::shared("data/scenes/envi_corn_kernel/4-22-22_right_same_B73_top_00.hdr")
        else {
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
}
