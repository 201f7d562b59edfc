//! ENVI files: a text header and a file of plain numbers.

use std::{
    fs::{self, File},
    io::Read,
    ops::Range,
    path::{Path, PathBuf},
};

use dioptric_spectrum::{Quantity, SpectralImage, WavelengthGrid};

use super::{
    belonging::{Reference, bare_stem, may_be_reference},
    camera::CameraFile,
    column_names::{is_no_power, is_no_reflectance},
    contents::{Contents, Image},
    depth::files_beside,
    envi_data::{EnviFile, Meaning, Wanted},
    envi_header::{self, DataType},
    light_unit::LightUnit,
    read_options::{Part, ReadOptions},
    reading::{FileQuantity, Frame, NoData, light_unit},
    reduced::reduced_size,
    stated::{name_of, note_of, short, tells},
    unusable::{in_file, starts_with, unreadable},
    wavelength_unit::ascending,
};
use crate::{SceneError, resample::resampling_weights};

/// A text header longer than this is none.
const LIMIT_HEADER_BYTES: u64 = 64 << 20;
/// Bands of a cube and of its references that lie no farther apart are the same, nm.
const SAME_BAND_NM: f64 = 0.1;
/// Endings of the file of numbers beside `NAME.hdr`; none at all as well.
const DATA_ENDINGS: [&str; 9] = ["", "raw", "img", "dat", "bsq", "bil", "bip", "bin", "cube"];

/// Reads an ENVI header and the file of numbers beside it: BSQ, BIL or BIP, any real data type and byte order. Of the file only what
/// the wanted bands need is read, a few lines at a time.
///
/// Numbers are light where the header's `data units` say so (`W/m^2/sr/nm`, `uW/(cm^2 sr nm)`, `photons/s/m^2/sr/nm` and their like)
/// or `data gain values` make them so, or else reflectances relative to, in this order: the white level of the options, the header's
/// `reflectance scale factor`, or the cubes of white and of no light beside the file (`white_reference*.hdr`, `WHITEREF_NAME.hdr`,
/// `darkReference.hdr`).
///
/// # Errors
/// Names the line and key of the header that is wrong, the file of numbers when it is absent or too short, or what is missing to
/// know what the numbers are.
pub(super) fn contents_of_envi(path: &Path, options: &ReadOptions) -> Result<Contents, SceneError> {
    let wanted_nm = options.grid.as_ref().map(WavelengthGrid::centers_nm);
    let file = EnviFile::open(path, options.reading.wavelengths_nm.as_deref(), wanted_nm)?;
    let (meaning, what) = file.meaning(options)?;
    let mut notes: Vec<String> = file.notes.clone();
    notes.extend(file.unused_description(path, options));
    notes.extend(file.unused_unit(path, matches!(meaning, Meaning::Light(_)) && file.header.gains.is_none()));
    let references = match &meaning {
        Meaning::Between(pair, _) => &pair[..],
        _ => &[],
    };
    notes.extend(references.iter().flat_map(|reference| reference.notes.clone()));
    let mut beside = vec![];
    if references.is_empty() {
        let known = [Reference::White, Reference::Dark].map(|reference| file.files_beside(reference));
        beside = known.into_iter().collect::<Result<Vec<_>, _>>()?.concat();
    }
    // Others may be references of which the names are not known.
    let own = bare_stem(&name_of(&file.header_path));
    beside.extend(headers_beside(&file.header_path)?.into_iter().filter(|path| {
        let name = name_of(path);
        may_be_reference(&name) && Reference::of_name(&name, &own).is_none()
    }));
    notes.extend(note_of(path, "reference", &beside.iter().map(|file| name_of(file)).collect::<Vec<_>>()));
    notes.extend(file.notes_of_exposures(references));
    if let (Meaning::Light(..), Some(own)) = (&meaning, file.header.reflectance_scale) {
        let name = name_of(path);
        notes.push(format!("{name}: its reflectance scale factor of {own} is not used: it has a unit of radiance"));
    }
    let order = ascending(path, &file.wavelengths_nm, file.good_bands())?;
    let own = WavelengthGrid::new(order.iter().map(|&band| file.wavelengths_nm[band]).collect())
        .map_err(|reason| SceneError::Values { file: path.to_owned(), reason })?;
    let wanted = options.grid.clone().unwrap_or_else(|| own.clone());
    // Each wanted band with those of the file that it is made of.
    let weights = if wanted == own {
        (0..own.len()).map(|band| vec![(band, 1.0)]).collect()
    } else {
        resampling_weights(&own, &wanted).map_err(|error| in_file(path, &error))?
    };
    let choice = options.reading.no_data.unwrap_or_default();
    let own_size = (file.header.rows, file.header.columns);
    // Rows that get the nearest of other rows need all of them.
    let needs_all = choice == NoData::Fill;
    let part = options.part.filter(|_| !needs_all && stands_alone(path, options));
    let reduced = match part {
        None if !needs_all => reduced_size(path, options, own_size, 4 * wanted.len() as u64),
        _ => None,
    };
    notes.extend(reduced.as_ref().map(|reduced| reduced.note.clone()));
    let mut size = reduced.map_or(own_size, |reduced| (reduced.rows, reduced.columns));
    let mut window = (0..own_size.0, 0..own_size.1);
    if let Some(part) = part {
        (window, size) = window_of(path, part, own_size, &mut notes)?;
    }
    let frame = part.map(|_| Frame {
        columns: own_size.1,
        rows: own_size.0,
        x0: window.1.start as i64,
        y0: window.0.start as i64,
        aspect: 1.0,
    });
    let asked = Wanted { order: &order, weights: &weights, grid: &wanted, window, size, choice };
    let (planes, mended) = file.planes(&asked, &meaning)?;
    notes.extend(mended.note(path, choice));
    let quantity = if matches!(meaning, Meaning::Light(..)) { Quantity::Radiance } else { Quantity::Reflectance };
    let image = SpectralImage::new(quantity, wanted, planes)
        .map_err(|reason| SceneError::Values { file: path.to_owned(), reason })?;
    Ok(Contents { notes, own_grid: Some(own), frame, part, ..Contents::of(Image::Spectral(image), what) })
}

/// Whether all that is known of a cube's samples is in its own file and the options, so that a part of it may be read by itself.
fn stands_alone(path: &Path, options: &ReadOptions) -> bool {
    let reading = &options.reading;
    let others = reading.depth.is_some() || reading.view.is_some() || reading.panorama.is_some();
    !others && files_beside(path).is_empty() && matches!(CameraFile::beside(path), Ok(None))
}

/// Rows and columns of a file.
type Window = (Range<usize>, Range<usize>);

/// Returns the rows and columns of a part, and how many of its blocks there are.
fn window_of(
    path: &Path,
    part: Part,
    (rows, columns): (usize, usize),
    notes: &mut Vec<String>,
) -> Result<(Window, (usize, usize)), SceneError> {
    let [x, y, width, height] = part.window.unwrap_or([0, 0, columns, rows]);
    let setting = |what, value: String, expected: String| SceneError::Setting { what, value, expected };
    if width == 0 || height == 0 || x.saturating_add(width) > columns || y.saturating_add(height) > rows {
        let value = format!("rows {y}..{}, columns {x}..{}", y.saturating_add(height), x.saturating_add(width));
        return Err(setting("the part of the scene", value, format!("a part of 0..{rows} and 0..{columns}")));
    }
    let bin = part.bin;
    if bin == 0 || height < bin || width < bin {
        let expected = format!("1 to {}", height.min(width));
        return Err(setting("the side of a block of samples", bin.to_string(), expected));
    }
    notes.extend(part.left_over(&name_of(path), width, height));
    let (down, across) = (height / bin, width / bin);
    Ok(((y..y + down * bin, x..x + across * bin), (down, across)))
}

/// Returns the length of the numbers of an ENVI file, by its header or themselves; `None` where it is none.
pub fn envi_bytes(path: &Path) -> Option<u64> {
    let is_header = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("hdr"));
    let header = if is_header { path.to_owned() } else { header_of(path)? };
    Some(fs::metadata(data_file(&header, &mut vec![]).ok()?).ok()?.len())
}

/// Returns the rows and columns that an ENVI header states; `None` where it is none.
pub(super) fn envi_size(header_path: &Path) -> Option<(usize, usize)> {
    let header = envi_header::parse(header_path, &header_text(header_path).ok()?).ok()?;
    Some((header.rows, header.columns))
}

fn header_text(header_path: &Path) -> Result<String, SceneError> {
    let mut bytes = Vec::new();
    let file = File::open(header_path).map_err(|error| unreadable(header_path, error))?;
    file.take(LIMIT_HEADER_BYTES).read_to_end(&mut bytes).map_err(|error| unreadable(header_path, error))?;
    Ok(dioptric_files::text::of_bytes(&bytes))
}

/// Returns the header that belongs to a file: itself, or `a.raw.hdr` or `a.hdr` for `a.raw`.
pub(super) fn header_of(path: &Path) -> Option<PathBuf> {
    let appended = |ending: &str| {
        let mut name = path.as_os_str().to_owned();
        name.push(ending);
        PathBuf::from(name)
    };
    let candidates = [appended(".hdr"), path.with_extension("hdr"), appended(".HDR"), path.with_extension("HDR")];
    // Radiance pictures have the same ending.
    let is_radiance = |header: &PathBuf| starts_with(header, b"#?").unwrap_or(false);
    // Of several files of numbers beside a header the first is its own.
    let is_own = |header: &PathBuf| {
        data_file(header, &mut vec![]).is_ok_and(|data| fs::canonicalize(data).ok() == fs::canonicalize(path).ok())
    };
    let is_header = |header: &PathBuf| header != path && header.is_file() && !is_radiance(header) && is_own(header);
    candidates.into_iter().find(is_header)
}

impl EnviFile {
    /// Reads the header and finds the file of numbers. Bands whose wavelengths nothing states are those wanted, where there are as many.
    fn open(header_path: &Path, told_nm: Option<&[f64]>, wanted_nm: Option<&[f64]>) -> Result<Self, SceneError> {
        let mut header = envi_header::parse(header_path, &header_text(header_path)?)?;
        let mut notes = std::mem::take(&mut header.notes);
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
                        "the header has it: --scene-wavelengths-nm says something else".to_owned(),
                    ));
                }
                told.to_vec()
            }
            (None, Some(own)) => own,
            (None, None) => match wanted_nm.filter(|wanted| wanted.len() == header.bands) {
                Some(wanted) => wanted.to_vec(),
                None => {
                    let reason = format!(
                        "the header lacks it, or does not say in which unit: expected it there, or \
                         --scene-wavelengths-nm, {} numbers",
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

    /// Returns the bands that are not marked as bad.
    fn good_bands(&self) -> impl Iterator<Item = usize> {
        (0..self.header.bands).filter(|band| !self.header.bad_bands.get(*band).copied().unwrap_or(false))
    }

    /// Returns the note of data units that are none of light, and say more than that the numbers are a share or a count where they are taken for such.
    fn unused_unit(&self, path: &Path, is_light: bool) -> Option<String> {
        const OF_ANY: [&str; 2] = ["", "unknown"];
        const OF_SHARES: [&str; 7] =
            ["reflectance", "transmittance", "unitless", "dimensionless", "none", "dn", "counts"];
        let unit = self.header.data_units.as_deref()?;
        let words = unit.to_lowercase();
        let is_plain = OF_ANY.contains(&words.as_str())
            || !is_light && OF_SHARES.contains(&words.as_str())
            || self.has_percent()
            || LightUnit::parse(unit).is_some_and(|unit| unit.quantity == Quantity::Radiance);
        if is_plain { None } else { note_of(path, "unit", &[unit.to_owned()]) }
    }

    /// Returns the note of a description that says something of the numbers, where options say what they are, or more than the unit that it has.
    fn unused_description(&self, path: &Path, options: &ReadOptions) -> Option<String> {
        let description = self.header.description.as_deref()?;
        let is_told =
            options.reading.quantity.is_some() || options.reading.unit.is_some() || options.white_level.is_some();
        let unit = self.header.data_units.as_deref().filter(|unit| !unit.is_empty());
        let is_more = match unit.and_then(|unit| description.rsplit_once(unit)) {
            // A factor may stand behind it.
            Some((_, rest)) => rest.contains(|c: char| c.is_ascii_digit()),
            None => is_told && (tells(description) || is_no_power(description) || is_no_reflectance(description)),
        };
        if is_more { note_of(path, "description", &[description.to_owned()]) } else { None }
    }

    /// Whether its units say that a perfect white is 100.
    fn has_percent(&self) -> bool {
        let unit = self.header.data_units.as_deref().unwrap_or_default().to_lowercase();
        ["%", "percent", "percent reflectance", "reflectance (%)", "reflectance %"].contains(&unit.trim())
    }

    /// Decides what the numbers are, and says so.
    fn meaning(&self, options: &ReadOptions) -> Result<(Meaning, String), SceneError> {
        let (header, reading) = (&self.header, &options.reading);
        let scale = reading.scale.unwrap_or(1.0);
        let units = |reason: String| Err(SceneError::Units { file: self.header_path.clone(), reason });
        let any_unit = header.data_units.as_deref().and_then(LightUnit::parse);
        let own_unit = any_unit.filter(|unit| unit.quantity == Quantity::Radiance);
        let has_gains = header.gains.is_some() || header.offsets.is_some();
        let own_level = header.reflectance_scale.or(self.has_percent().then_some(100.0));
        let is_reflecting = header.are_gains_of_reflectance || own_level.is_some();
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
        {
            let unit = header.data_units.as_deref().unwrap_or_default();
            return units(format!(
                "its data units are '{}', which says something else than was asked for",
                short(unit)
            ));
        }
        if wants_light == Some(true) && told_unit.is_none() && any_unit != own_unit {
            let unit = header.data_units.as_deref().unwrap_or_default();
            return units(format!(
                "its data units are '{}', of irradiance: expected the unit of its radiance (--unit), with /sr",
                short(unit)
            ));
        }
        let words = header.data_units.as_deref().unwrap_or_default().trim().to_lowercase();
        if wants_light == Some(true) && (is_reflecting || ["reflectance", "transmittance"].contains(&words.as_str())) {
            return units(
                "its header says that it is a reflectance: expected it without a unit or quantity of light".to_owned(),
            );
        }
        if let (Some(own), Some(told)) = (own_level, options.white_level)
            && own != told
        {
            return units(format!("its header says that {own} is white, which a white level of {told} contradicts"));
        }
        // Gains without a unit are those of ENVI, W m⁻² sr⁻¹ µm⁻¹, and make no photons.
        let is_of_gains = has_gains && !is_reflecting && reading.quantity != Some(FileQuantity::Photons);
        let gain_unit = || LightUnit::parse("W/m^2/sr/um").filter(|_| is_of_gains);
        let is_light = wants_light.unwrap_or(own_unit.is_some() || gain_unit().is_some());
        if is_light {
            if let Some(unit) = told_unit.or(own_unit) {
                reading.check_quantity(&self.header_path, unit)?;
            }
            let by_quantity = || reading.quantity.and_then(FileQuantity::light_unit);
            let unit = told_unit.or(own_unit).or_else(gain_unit).or_else(by_quantity).unwrap_or(LightUnit::RADIANCE);
            let words = match (reading.unit.as_deref(), header.data_units.as_deref().filter(|_| own_unit.is_some())) {
                (Some(told), _) => told.to_owned(),
                (None, Some(own)) if LightUnit::lacks_wavelength(own) => {
                    format!("{}, a nanometre understood", short(own))
                }
                (None, Some(own)) => short(own),
                (None, None) if reading.quantity == Some(FileQuantity::Photons) => "photons/s/m^2/sr/nm".to_owned(),
                (None, None) if is_of_gains => "W/m^2/sr/um by its gains".to_owned(),
                (None, None) => "W/m^2/sr/nm".to_owned(),
            };
            let factor = scale / header.radiance_scale.unwrap_or(1.0);
            let of_band = |&nm: &f64| factor * unit.factor_at(nm);
            let factors = self.wavelengths_nm.iter().map(of_band).collect();
            return Ok((Meaning::Light(factors), format!("radiance in {words}")));
        }
        let level = options.white_level.or(own_level);
        // Gains and a level that say the same of what is white are applied once.
        if let (Some(gains), Some(level)) = (&header.gains, level)
            && gains.iter().all(|gain| (gain * level - 1.0).abs() < 1e-6)
        {
            return Ok((Meaning::Reflectance(scale), "reflectance by its gains".to_owned()));
        }
        if let Some(level) = level {
            return Ok((Meaning::Reflectance(scale / level), format!("reflectance, {level} being a perfect white")));
        }
        if header.are_gains_of_reflectance {
            return Ok((Meaning::Reflectance(scale), "reflectance by its gains".to_owned()));
        }
        if let (Some(white), Some(dark)) = (self.beside(Reference::White)?, self.beside(Reference::Dark)?) {
            let what =
                format!("reflectance between {} and {}", name_of(&white.header_path), name_of(&dark.header_path));
            self.check_reference(&white)?;
            self.check_reference(&dark)?;
            let times = self.times_as_long_as(&white)?;
            return Ok((Meaning::Between(Box::new([white, dark]), scale / times), what));
        }
        let is_float = matches!(header.data_type, DataType::F32 | DataType::F64);
        if wants_light == Some(false) && (is_float || reading.scale.is_some()) {
            return Ok((Meaning::Reflectance(scale), "reflectance, 1 being a perfect white".to_owned()));
        }
        let unknown = header.data_units.as_deref().filter(|text| !text.is_empty());
        let unknown =
            unknown.map_or_else(String::new, |text| format!(", and '{}' is no unit of radiance", short(text)));
        units(format!(
            "nothing tells what a perfect white is{unknown}: expected 'reflectance scale factor' in the header, cubes \
             white_reference and dark_reference beside it (or WHITEREF_… and DARKREF_…), a white level (--white-level), or what the numbers are (--quantity, --unit)"
        ))
    }

    /// Checks that a reference has the bands and columns of this cube.
    fn check_reference(&self, reference: &Self) -> Result<(), SceneError> {
        let (own, found) = (&self.header, &reference.header);
        if (found.bands, found.columns) == (own.bands, own.columns) {
            let mut bands = self.wavelengths_nm.iter().zip(&reference.wavelengths_nm);
            let other = bands.find(|(own, found)| (*own - *found).abs() > SAME_BAND_NM);
            return match other {
                None => Ok(()),
                Some((own, found)) => {
                    let of = self.header_path.display();
                    let reason = format!(
                        "a band at {found} nm where {of} has {own} nm: expected the bands of that, in its order"
                    );
                    Err(unreadable(&reference.header_path, reason))
                }
            };
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

    /// Returns how many times as long as in a reference the light was gathered; 1 where the two do not tell.
    fn times_as_long_as(&self, reference: &Self) -> Result<f64, SceneError> {
        let of = |own: &Self, key: &str| own.header.exposures.iter().find(|(own, _)| own == key).map(|(_, v)| *v);
        let keys = self.header.exposures.iter().filter_map(|(key, v)| Some((key, v / of(reference, key)?)));
        let ratios: Vec<(&String, f64)> = keys.collect();
        let Some(&(_, first)) = ratios.first() else { return Ok(1.0) };
        if let Some((key, other)) = ratios.iter().find(|(_, ratio)| (ratio - first).abs() > 1e-6 * first) {
            let reason = format!(
                "its '{}' and '{key}' differ from those of {} by {first} and {other} times: expected the same ratio",
                ratios[0].0,
                name_of(&reference.header_path)
            );
            return Err(unreadable(&self.header_path, reason));
        }
        Ok(first)
    }

    /// Returns what is said of the times that light was gathered for in this cube and in its references.
    fn notes_of_exposures(&self, references: &[Self]) -> Vec<String> {
        let mut notes = vec![];
        let mut compared = vec![];
        for (index, reference) in references.iter().enumerate() {
            let mut alone = vec![];
            for (key, theirs) in &reference.header.exposures {
                let Some((_, own)) = self.header.exposures.iter().find(|(own, _)| own == key) else {
                    alone.push(key.clone());
                    continue;
                };
                compared.push(key.clone());
                if own != theirs {
                    let becomes = match index {
                        0 => format!("its light is multiplied by {}", own / theirs),
                        _ => "its numbers are taken as they are".to_owned(),
                    };
                    let (name, of) = (name_of(&reference.header_path), name_of(&self.header_path));
                    notes.push(format!("{name}: its {key} is {theirs}, that of {of} {own}: {becomes}"));
                }
            }
            notes.extend(note_of(&reference.header_path, "key", &alone));
            notes.extend(self.notes_of_settings(reference));
        }
        // Without references `tint` changes nothing.
        let is_alone = |key: &String| !(compared.contains(key) || references.is_empty() && key == "tint");
        let alone: Vec<String> = self.header.exposures.iter().map(|(key, _)| key.clone()).filter(is_alone).collect();
        notes.extend(note_of(&self.header_path, "key", &alone));
        notes
    }

    /// Returns what is said of a reference that was taken with another setting of the camera, a sentence each.
    fn notes_of_settings(&self, reference: &Self) -> Vec<String> {
        let (own, theirs) = (&self.header.settings, &reference.header.settings);
        let other = |(key, value): &(String, String)| {
            let (_, own) = own.iter().find(|(own, _)| own == key)?;
            (own != value).then(|| {
                let (name, of) = (name_of(&reference.header_path), name_of(&self.header_path));
                format!("{name}: its {key} is {value}, that of {of} {own}: its numbers are taken as they are")
            })
        };
        theirs.iter().filter_map(other).collect()
    }

    /// Returns the headers of references beside this one, in their order: those with its own name, or else all.
    fn files_beside(&self, wanted: Reference) -> Result<Vec<PathBuf>, SceneError> {
        let own = bare_stem(&name_of(&self.header_path));
        let mut found: Vec<(bool, PathBuf)> = headers_beside(&self.header_path)?
            .into_iter()
            .filter_map(|path| {
                let found = Reference::of_name(&name_of(&path), &own).filter(|(reference, _)| *reference == wanted);
                found.map(|(_, is_own)| (!is_own, path))
            })
            .collect();
        found.sort();
        // Those with its name are its own, others of other cubes.
        let has_own = found.first().is_some_and(|(is_other, _)| !is_other);
        Ok(found.into_iter().filter(|(is_other, _)| !(has_own && *is_other)).map(|(_, path)| path).collect())
    }

    /// Opens the reference beside this cube, if there is one.
    fn beside(&self, wanted: Reference) -> Result<Option<Self>, SceneError> {
        let found = self.files_beside(wanted)?;
        let Some((first, others)) = found.split_first() else { return Ok(None) };
        let mut reference = Self::open(first, None, Some(&self.wavelengths_nm))?;
        // What a reference holds is a perfect white, or darkness, whatever else its header makes of its numbers.
        let header = &reference.header;
        let left = [
            ("reflectance scale factor", header.reflectance_scale.is_some()),
            ("data units", header.data_units.as_deref().is_some_and(|unit| !unit.is_empty())),
        ];
        let left: Vec<String> =
            left.into_iter().filter(|(_, is_there)| *is_there).map(|(key, _)| key.to_owned()).collect();
        reference.notes.extend(note_of(first, "key", &left));
        let others: Vec<String> = others.iter().map(|path| name_of(path)).collect();
        reference.notes.extend(note_of(&self.header_path, "reference", &others));
        Ok(Some(reference))
    }
}

/// Returns the other headers in the folder of one, by name.
fn headers_beside(header_path: &Path) -> Result<Vec<PathBuf>, SceneError> {
    let folder = header_path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let entries = fs::read_dir(folder).map_err(|error| unreadable(folder, error))?;
    let mut found: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("hdr")) && path != header_path)
        .collect();
    found.sort();
    Ok(found)
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
#[path = "envi_tests.rs"]
mod tests;
