//! What a reader found in a file, before it is a scene.

use std::path::{Path, PathBuf};

use dioptric_pictures::{DynamicImage, StatedColors};
use dioptric_spectrum::{Quantity, SpectralImage, SpectrumError, WavelengthGrid};
use ndarray::Array2;
use rayon::prelude::*;

use super::{
    camera::{CameraData, Straightened},
    depth_names::words_of,
    light_unit::LightUnit,
    no_data::mend,
    raw_depth::RawDepth,
    read_options::{Part, ReadOptions},
    reading::{FileQuantity, Frame, Panorama, Place, light_unit},
    stated::{name_of, names_unit_of_light, short},
    unusable::unreadable,
    wavelength_unit::ascending,
};
use crate::{SceneError, SceneLight};

/// What a reader found.
pub(super) struct Contents {
    pub(super) image: Image,
    /// What the image is, for the line of what was understood.
    pub(super) what: String,
    /// The bands of the file, where the image is on those wanted already.
    pub(super) own_grid: Option<WavelengthGrid>,
    pub(super) depth: Option<RawDepth>,
    /// Camera data of the image's own samples.
    pub(super) view: Option<CameraData>,
    /// The picture that other camera data speaks of; all of the image where `None`.
    pub(super) frame: Option<Frame>,
    /// The part that is wanted, where the image is of it alone already.
    pub(super) part: Option<Part>,
    /// Whether the samples were turned upright, so that they lie otherwise than in the file.
    pub(super) is_turned: bool,
    /// Whether the file says that its picture is one of all directions.
    pub(super) panorama: Option<Panorama>,
    pub(super) hidden: Option<Box<Hidden>>,
    pub(super) light: Option<SceneLight>,
    pub(super) notes: Vec<String>,
    /// What may be said of such a file.
    pub(super) heeds: Heeds,
}

/// What lies behind the first surface, and its file.
pub(super) struct Hidden {
    pub(super) file: PathBuf,
    pub(super) contents: Contents,
}

/// The samples of a file.
pub(super) enum Image {
    Spectral(SpectralImage),
    /// Linear red, green and blue of sRGB's primaries.
    Linear {
        planes: [Array2<f32>; 3],
        /// The luminance of white, cd/m², where the file states it.
        white_cd_m2: Option<f64>,
    },
    /// Codes of sRGB, or of the colors that the file states.
    Codes(DynamicImage, Option<StatedColors>),
}

/// Which of the options that say what a file does not may be said of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Heeds {
    /// Nothing: the file says all itself, or is a picture.
    Nothing,
    /// A factor on its numbers.
    Scale,
    /// A quantity, a unit and a factor: light of which no unit is stated.
    Unit,
    /// All of them: a cube of plain numbers.
    Cube,
}

impl Image {
    /// Puts the samples into a larger picture.
    pub(super) fn pad(&mut self, place: Place) -> Result<(), SceneError> {
        match self {
            Self::Spectral(image) => {
                let planes = image.planes().iter().map(|plane| place.pad(plane)).collect();
                *image = SpectralImage::new(image.quantity(), image.grid().clone(), planes)?;
                Ok(())
            }
            Self::Linear { planes, .. } => {
                planes.iter_mut().for_each(|plane| *plane = place.pad(plane));
                Ok(())
            }
            // Only EXR files have frames.
            Self::Codes(..) => Ok(()),
        }
    }
}

impl Contents {
    pub(super) fn of(image: Image, what: impl Into<String>) -> Self {
        Self {
            image,
            what: what.into(),
            own_grid: None,
            depth: None,
            view: None,
            frame: None,
            part: None,
            is_turned: false,
            panorama: None,
            hidden: None,
            light: None,
            notes: vec![],
            heeds: Heeds::Cube,
        }
    }

    /// The picture of which the samples are a part.
    pub(super) fn frame(&self) -> Frame {
        let (rows, columns) = self.size();
        self.frame.unwrap_or_else(|| Frame::whole(rows, columns))
    }

    /// Puts samples and depths, and those behind, into a larger picture.
    pub(super) fn pad(&mut self, place: Place) -> Result<(), SceneError> {
        self.image.pad(place)?;
        if let Some(depth) = &mut self.depth {
            depth.values = place.pad_depth(&depth.values);
        }
        match &mut self.hidden {
            Some(hidden) => hidden.contents.pad(place),
            None => Ok(()),
        }
    }

    /// Refuses a file without samples, and what was said of the file and does not apply to it.
    pub(super) fn check_heeds(&self, path: &Path, options: &ReadOptions) -> Result<(), SceneError> {
        if [self.size().0, self.size().1].contains(&0) {
            return Err(unreadable(path, "it has no samples"));
        }
        let reading = &options.reading;
        let given = [
            ("a factor on its numbers (--scale)", reading.scale.is_some(), self.heeds == Heeds::Nothing),
            ("a unit (--unit)", reading.unit.is_some(), !matches!(self.heeds, Heeds::Unit | Heeds::Cube)),
            ("a quantity (--quantity)", reading.quantity.is_some(), !self.heeds_quantity(reading.quantity)),
            (
                "what becomes of samples without data (--no-data)",
                reading.no_data.is_some(),
                matches!(self.image, Image::Codes(..)),
            ),
            ("a white level (--white-level)", options.white_level.is_some(), self.heeds != Heeds::Cube),
            ("wavelengths (--scene-wavelengths-nm)", reading.wavelengths_nm.is_some(), self.heeds != Heeds::Cube),
            (
                "a variable (--variable)",
                reading.variable.is_some(),
                !(is_of(path, MATLAB_OR_HDF5) || is_of(path, &["npz", "exr"])),
            ),
            (
                "an order of axes (--axes)",
                reading.axes.is_some(),
                // A scene of ISETCam says which axes are which.
                self.heeds == Heeds::Nothing || !(is_of(path, MATLAB_OR_HDF5) || is_of(path, &["npy", "npz"])),
            ),
        ];
        match given.into_iter().find(|(_, is_given, is_wrong)| *is_given && *is_wrong) {
            Some((what, ..)) => Err(SceneError::DoesNotApply { file: path.to_owned(), what, kind: self.what.clone() }),
            None => Ok(()),
        }
    }

    /// Whether such a quantity may be said of the file: of a picture, that it is one of things that reflect light.
    fn heeds_quantity(&self, quantity: Option<FileQuantity>) -> bool {
        match self.image {
            Image::Spectral(_) => matches!(self.heeds, Heeds::Unit | Heeds::Cube),
            Image::Linear { .. } | Image::Codes(..) => quantity == Some(FileQuantity::Reflectance),
        }
    }

    /// The bands of the file; none of colors.
    pub(super) fn own_grid(&self) -> Option<WavelengthGrid> {
        match (&self.own_grid, &self.image) {
            (Some(own), _) => Some(own.clone()),
            (None, Image::Spectral(image)) => Some(image.grid().clone()),
            (None, _) => None,
        }
    }

    /// Whether a light is put on the samples, so that they shine.
    pub(super) fn is_reflectance(&self, options: &ReadOptions) -> bool {
        match &self.image {
            Image::Spectral(image) => image.quantity() == Quantity::Reflectance,
            Image::Linear { .. } | Image::Codes(..) => options.reading.quantity == Some(FileQuantity::Reflectance),
        }
    }

    /// The rows and columns of the samples.
    pub(super) fn size(&self) -> (usize, usize) {
        match &self.image {
            Image::Spectral(image) => (image.rows(), image.columns()),
            Image::Linear { planes, .. } => planes[0].dim(),
            Image::Codes(picture, _) => (picture.height() as usize, picture.width() as usize),
        }
    }
}

/// Endings of MATLAB and HDF5 files, of which `NetCDF` and HDF-EOS are kinds.
pub(super) const MATLAB_OR_HDF5: &[&str] = &["mat", "h5", "hdf5", "he5", "nc", "nc4"];

/// Whether the name of a file has one of these endings.
pub(super) fn is_of(path: &Path, endings: &[&str]) -> bool {
    path.extension().is_some_and(|own| endings.iter().any(|ending| own.eq_ignore_ascii_case(ending)))
}

/// A cube of plain numbers, and what its file says of them.
pub(super) struct Cube {
    /// The planes of the bands, in the order of the file.
    pub(super) planes: Vec<Array2<f32>>,
    /// The largest number that its whole numbers have.
    pub(super) top: Option<f64>,
    /// The wavelengths that the file states.
    pub(super) wavelengths_nm: Option<Vec<f64>>,
    /// What the file's names say that the numbers are.
    pub(super) quantity: Option<FileQuantity>,
    /// The unit of light that the file states, and its words.
    pub(super) unit: Option<(LightUnit, String)>,
    /// The factor that the file states of its numbers, which they have.
    pub(super) packed: Option<f64>,
    /// The name of its array.
    pub(super) called: Option<String>,
    pub(super) notes: Vec<String>,
}

impl Cube {
    /// Makes an image of the numbers, as far as the file or the options say what they are.
    ///
    /// Whole numbers of which nothing is said are reflectances, the largest that there can be being a perfect white; of floats it must
    /// be said.
    ///
    /// # Errors
    /// When wavelengths or the quantity are missing, or there is another number of wavelengths.
    pub(super) fn into_contents(mut self, path: &Path, options: &ReadOptions) -> Result<Contents, SceneError> {
        let wavelengths_nm = self.bands_nm(path, options)?;
        let order = ascending(path, &wavelengths_nm, 0..wavelengths_nm.len())?;
        let unit = self.unit(path, options)?;
        let (level, what) = self.level(path, options, unit)?;
        if let (Some(factor), Some(scale)) = (self.packed, options.reading.scale)
            && (scale / factor - 1.0).abs() < 1e-6
        {
            let reason = format!("its numbers have the factor {factor} that it states: expected it without --scale");
            return Err(SceneError::Units { file: path.to_owned(), reason });
        }
        let what = self.packed.map_or(what.clone(), |factor| format!("{what}, by the factor {factor} that it states"));
        self.notes.extend(self.note_of_name(path, options));
        self.notes.extend(self.note_of_kind(path, unit.is_some()));
        let values = |reason: SpectrumError| SceneError::Values { file: path.to_owned(), reason };
        let grid = WavelengthGrid::new(order.iter().map(|&band| wavelengths_nm[band]).collect()).map_err(values)?;
        let mut planes: Vec<Option<Array2<f32>>> = self.planes.into_iter().map(Some).collect();
        let mut planes: Vec<Array2<f32>> = order.iter().filter_map(|&band| planes[band].take()).collect();
        let scale = options.reading.scale.unwrap_or(1.0);
        planes.par_iter_mut().zip(grid.centers_nm()).for_each(|(plane, &nm)| {
            let factor = scale / level * unit.map_or(1.0, |unit| unit.factor_at(nm));
            if factor != 1.0 {
                plane.mapv_inplace(|v| (f64::from(v) * factor) as f32);
            }
        });
        let choice = options.reading.no_data.unwrap_or_default();
        self.notes.extend(mend(path, &grid, &mut planes, choice)?.note(path, choice));
        let quantity = if unit.is_none() { Quantity::Reflectance } else { Quantity::Radiance };
        let image = SpectralImage::new(quantity, grid, planes).map_err(values)?;
        Ok(Contents { notes: self.notes, ..Contents::of(Image::Spectral(image), what) })
    }

    /// Returns what is said of a unit in the name of the array, or of the file, where nothing else says what the numbers are.
    fn note_of_name(&self, path: &Path, options: &ReadOptions) -> Option<String> {
        let is_told = self.unit.is_some()
            || self.quantity.is_some()
            || options.reading.unit.is_some()
            || options.reading.scale.is_some()
            || options.white_level.is_some();
        let stem = path.file_stem()?.to_string_lossy();
        let name = self.called.as_deref().into_iter().chain([&*stem]).find(|name| names_unit_of_light(name))?;
        let (file, name) = (name_of(path), short(name));
        let note =
            || format!("{file}: the unit in the name '{name}' is not used: --unit, --scale or --white-level says it");
        (!is_told).then(note)
    }

    /// Returns what is said of an array that is called another kind of quantity than its numbers are taken for.
    fn note_of_kind(&self, path: &Path, is_light: bool) -> Option<String> {
        const SHARES: [&str; 4] = ["reflectance", "reflectances", "transmittance", "albedo"];
        const LIGHT: [&str; 4] = ["radiance", "radiances", "irradiance", "photons"];
        let name = self.called.as_deref()?;
        let words = words_of(name);
        let says = |known: [&str; 4]| words.iter().any(|word| known.contains(&word.as_str()));
        let (is_other, taken) = if is_light {
            (says(SHARES) && !says(LIGHT), "light")
        } else {
            (says(LIGHT) && !says(SHARES), "reflectance")
        };
        is_other
            .then(|| format!("{}: its '{}' is taken for {taken}, whatever its name says", name_of(path), short(name)))
    }

    /// Returns the wavelength of each band: those of the file, or those told.
    fn bands_nm(&mut self, path: &Path, options: &ReadOptions) -> Result<Vec<f64>, SceneError> {
        let n = self.planes.len();
        let wavelengths_nm = match (&options.reading.wavelengths_nm, self.wavelengths_nm.take()) {
            (Some(told), Some(own)) if *told != own => {
                let reason = "it states its wavelengths: --scene-wavelengths-nm says something else";
                return Err(unreadable(path, reason));
            }
            (Some(told), _) => told.clone(),
            (None, Some(own)) => own,
            // Bands that are asked for are the file's own where there are as many.
            (None, None) => match options.grid.as_ref().filter(|grid| grid.len() == n) {
                Some(grid) => grid.centers_nm().to_vec(),
                None => {
                    let reason = format!(
                        "it does not tell the wavelengths of its {n} bands: expected --scene-wavelengths-nm, {n} numbers; \
                         where they lie along another axis, --axes (byx: the first)"
                    );
                    return Err(unreadable(path, reason));
                }
            },
        };
        if wavelengths_nm.len() != n {
            return Err(unreadable(
                path,
                format!(
                    "it has {n} bands, but {} wavelengths: expected as many (--scene-wavelengths-nm), or, where bands lie \
                     along another axis of an array, --axes",
                    wavelengths_nm.len()
                ),
            ));
        }
        Ok(wavelengths_nm)
    }

    /// Returns the unit of light of the numbers; `None` of reflectances, and where nothing says what they are.
    fn unit(&self, path: &Path, options: &ReadOptions) -> Result<Option<LightUnit>, SceneError> {
        let reading = &options.reading;
        let units = |reason: &str| Err(SceneError::Units { file: path.to_owned(), reason: reason.to_owned() });
        let told = reading.unit.as_deref().map(light_unit).transpose()?;
        if let Some((own, words)) = &self.unit {
            let is_other = told.is_some_and(|told| told != *own)
                || reading.quantity == Some(FileQuantity::Reflectance)
                || options.white_level.is_some();
            if is_other {
                return units(&format!("its unit is '{}', which says something else than was asked for", short(words)));
            }
        }
        // What a file says of its numbers holds where nothing else is said.
        let says_light = told.is_some() || reading.quantity.is_some_and(|told| told != FileQuantity::Reflectance);
        if self.quantity == Some(FileQuantity::Reflectance) && says_light {
            return units("it holds reflectances, which --quantity or --unit contradicts");
        }
        let quantity = reading.quantity.or(self.quantity);
        match (quantity, told.or(self.unit.as_ref().map(|(unit, _)| *unit))) {
            (Some(FileQuantity::Reflectance), Some(_)) => {
                units("a reflectance has no unit: expected --unit or --quantity reflectance, not both")
            }
            (_, Some(unit)) => reading.check_quantity(path, unit).map(|()| Some(unit)),
            (quantity, None) => Ok(quantity.and_then(FileQuantity::light_unit)),
        }
    }

    /// Returns the number of a perfect white, 1 of light, and what the numbers are in words.
    fn level(&self, path: &Path, options: &ReadOptions, unit: Option<LightUnit>) -> Result<(f64, String), SceneError> {
        let reading = &options.reading;
        let quantity = reading.quantity.or(self.quantity);
        let units = |reason: &str| Err(SceneError::Units { file: path.to_owned(), reason: reason.to_owned() });
        if unit.is_some() {
            if options.white_level.is_some() {
                return units(
                    "it holds light, of which no number is a perfect white: expected it without --white-level",
                );
            }
            let usual = match quantity {
                Some(FileQuantity::Photons) => "photons/s/m^2/sr/nm",
                _ => "W/m^2/sr/nm",
            };
            let own = self.unit.as_ref().map(|(_, words)| words.as_str());
            let words = reading.unit.as_deref().or(own).unwrap_or(usual);
            let understood = if LightUnit::lacks_wavelength(words) { ", a nanometre understood" } else { "" };
            return Ok((1.0, format!("radiance in {}{understood}", short(words))));
        }
        // One number says what white is: that of the file, or the one told.
        if let (Some(factor), Some(level)) = (self.packed, options.white_level) {
            if (level * factor - 1.0).abs() > 1e-6 {
                return units(&format!(
                    "it states a factor of {factor} on its numbers, by which they are no codes, and a white level of {level} says \
                     something else: expected it without --white-level, or --scale"
                ));
            }
            return Ok((1.0, format!("reflectance, {level} being a perfect white")));
        }
        match (options.white_level, self.top) {
            (Some(level), _) => Ok((level, format!("reflectance, {level} being a perfect white"))),
            (None, Some(top)) if reading.scale.is_none() => {
                Ok((top, format!("reflectance, {top}, its largest code, being a perfect white")))
            }
            (None, _) if quantity.is_some() => Ok((1.0, "reflectance, 1 being a perfect white".to_owned())),
            (None, _) => {
                units("it does not tell what its numbers are: expected --quantity radiance, reflectance or photons")
            }
        }
    }
}

/// Returns a plane on straight and square samples: in straight lines between the old ones, held beyond them.
pub(super) fn straightened(plane: &Array2<f32>, how: &Straightened) -> Array2<f32> {
    let (rows, columns) = plane.dim();
    Array2::from_shape_fn((how.rows, how.columns), |(row, column)| {
        let (y, x) = how.source_of(row, column);
        let (y, x) = (y.clamp(0.0, rows as f64 - 1.0), x.clamp(0.0, columns as f64 - 1.0));
        let (top, left) = ((y as usize).min(rows.saturating_sub(2)), (x as usize).min(columns.saturating_sub(2)));
        let (down, across) = ((y - top as f64) as f32, (x - left as f64) as f32);
        let (bottom, right) = ((top + 1).min(rows - 1), (left + 1).min(columns - 1));
        let along = |row: usize| (1.0 - across) * plane[(row, left)] + across * plane[(row, right)];
        (1.0 - down) * along(top) + down * along(bottom)
    })
}

/// Returns a plane of depths on straight and square samples: that of the nearest.
pub(super) fn straightened_depth(plane: &Array2<f32>, how: &Straightened) -> Array2<f32> {
    let (rows, columns) = plane.dim();
    Array2::from_shape_fn((how.rows, how.columns), |(row, column)| {
        let (y, x) = how.source_of(row, column);
        let nearest = |v: f64, n: usize| v.round().clamp(0.0, n as f64 - 1.0) as usize;
        plane[(nearest(y, rows), nearest(x, columns))]
    })
}

#[cfg(test)]
mod tests {
    use super::{super::reading::FileReading, *};

    #[test]
    fn stated_factors_and_those_told_are_applied_once() {
        let first = |white_level: Option<f64>, scale: Option<f64>| {
            let cube = Cube {
                planes: vec![Array2::from_elem((1, 1), 0.5)],
                top: None,
                wavelengths_nm: Some(vec![500.0]),
                quantity: Some(FileQuantity::Reflectance),
                unit: None,
                packed: Some(1e-4),
                called: None,
                notes: vec![],
            };
            let reading = FileReading { scale, ..FileReading::default() };
            let options = ReadOptions { white_level, reading, ..ReadOptions::default() };
            let contents = cube.into_contents(Path::new("a.h5"), &options).map_err(|error| error.to_string())?;
            let Image::Spectral(image) = contents.image else { return Err("no bands".to_owned()) };
            Ok((image.planes()[0][(0, 0)], contents.what))
        };
        for (level, scale) in [(None, None), (Some(10_000.0), None)] {
            let (number, what) = first(level, scale).unwrap();
            assert!(number == 0.5 && what.contains("the factor 0.0001"), "{number} {what}");
        }
        assert_eq!(first(None, Some(2.0)).unwrap().0, 1.0);
        assert!(first(Some(100.0), None).unwrap_err().contains("--white-level"));
        assert!(first(None, Some(1e-4)).unwrap_err().contains("without --scale"));
    }
}
