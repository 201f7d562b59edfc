//! Lenses and sensors as people name them: a built-in name or a file.

use std::path::{Path, PathBuf};

use dioptric_optics::{
    COATING_CENTER_NM, Coating, GlassCatalogue, GlassRange, IdealLens, Iris, Lens, LensFile, MissingGlass, MonoLens,
    ReadOptions, SchematicEye, SeqNumbers, SurfaceChange,
};
use dioptric_sensor::Sensor;
use serde::{Deserialize, Serialize};

use super::measured_eye;
use crate::{Camera, LensSpec, PipelineError, SensorSpec, StopSpec};

pub use dioptric_optics::{REFERENCE_WAVELENGTH_NM, nearest_to_reference_nm};

impl LensSpec {
    /// Returns what `LENS` on the command line means: an ideal lens where it is named by its numbers
    /// ([`IdealLens::PATTERNS`]), a built-in name where it is one, a path where it looks like one or is one, else a name that is not
    /// known.
    pub fn named(text: &str) -> Self {
        match IdealLens::named(text) {
            Some(Ok(IdealLens::Thin { focal_length_mm, diameter_mm })) => {
                return Self::Thin { focal_length_mm, diameter_mm };
            }
            Some(Ok(IdealLens::Pinhole { diameter_mm })) => return Self::Pinhole { diameter_mm },
            // What is wrong with the name is reported when it is opened.
            Some(Err(_)) if !Path::new(text).exists() => return Self::BuiltIn(text.to_owned()),
            _ => {}
        }
        if let Some(eye) = measured_eye::named(text) {
            return eye;
        }
        // Names such as fisheye-12.5mm and eye:arizona:2.5D look as though they had an extension.
        let is_eye = SchematicEye::named(text).is_some() && !Path::new(text).exists();
        let is_built_in = is_eye || Lens::built_in_names().any(|name| name == text);
        if !is_built_in && is_path(text) { Self::File(PathBuf::from(text)) } else { Self::BuiltIn(text.to_owned()) }
    }

    /// What `LENS` on the command line is for it: the name of a built-in lens, the path of a file, an eye of a file; `None` of others.
    pub fn text(&self) -> Option<String> {
        match self {
            Self::BuiltIn(name) => Some(name.clone()),
            Self::File(path) => Some(path.display().to_string()),
            Self::MeasuredEye { file, pupil_mm, drawn } => {
                let which = drawn.map_or(String::new(), |drawn| format!(":{}@{}", drawn.number, drawn.seed));
                Some(format!("eye:{}:{pupil_mm}mm{which}", file.display()))
            }
            Self::Thin { .. } | Self::Pinhole { .. } | Self::Changed { .. } => None,
        }
    }

    /// The lens that this is, or is a changed form of.
    pub fn base(&self) -> &Self {
        match self {
            Self::Changed { lens, .. } => lens.base(),
            other => other,
        }
    }

    /// What is changed of the lens; nothing of most.
    pub fn changes(&self) -> &[SurfaceChange] {
        match self {
            Self::Changed { surfaces, .. } => surfaces,
            _ => &[],
        }
    }

    /// Returns this lens with these changes of its surfaces, and no others.
    pub fn with_changes(&self, surfaces: Vec<SurfaceChange>) -> Self {
        let lens = self.base().clone();
        if surfaces.is_empty() { lens } else { Self::Changed { lens: Box::new(lens), surfaces } }
    }

    /// The file that it is read from.
    pub fn file(&self) -> Option<&Path> {
        match self.base() {
            Self::File(path) | Self::MeasuredEye { file: path, .. } => Some(path),
            _ => None,
        }
    }

    /// The file that it is read from, to be named otherwise.
    pub fn file_mut(&mut self) -> Option<&mut PathBuf> {
        match self {
            Self::File(path) | Self::MeasuredEye { file: path, .. } => Some(path),
            Self::Changed { lens, .. } => lens.file_mut(),
            _ => None,
        }
    }

    /// Returns the lens, and what its file says of it.
    ///
    /// # Errors
    /// When there is none of that name, or its file or a catalogue cannot be read.
    pub fn open(&self, reading: &LensReadOptions) -> Result<LensFile, PipelineError> {
        // Catalogues are read, and refused, for a lens of any kind.
        let options = reading.options()?;
        let mut file = match self {
            Self::File(path) => LensFile::read(path, &options)?,
            Self::BuiltIn(name) if measured_eye::is_meant(name) => {
                let (found, expected) = (name.clone(), measured_eye::PATTERNS.to_owned());
                return Err(PipelineError::Value { origin: "the lens".to_owned(), key: "lens", found, expected });
            }
            Self::BuiltIn(name) => LensFile::built_in(name)?,
            Self::MeasuredEye { file, pupil_mm, drawn } => measured_eye::open(file, *pupil_mm, *drawn)?,
            Self::Thin { focal_length_mm, diameter_mm } => LensFile::from(Lens::thin(*focal_length_mm, *diameter_mm)?),
            Self::Pinhole { diameter_mm } => LensFile::from(Lens::pinhole(*diameter_mm)?),
            Self::Changed { lens, surfaces } => {
                let mut file = lens.open(reading)?;
                file.lens = file.lens.with_surface_changes(surfaces)?;
                return Ok(file);
            }
        };
        // A file has chosen already, and names itself where it cannot.
        if let (Some(number), false) = (reading.configuration, matches!(self, Self::File(_))) {
            file = file.with_configuration(number)?;
        }
        if let Some(factor) = reading.lens_scale {
            file = file.scaled(factor)?;
        }
        let lenses = file.configurations.iter_mut().map(|configuration| &mut configuration.lens);
        for lens in lenses.chain([&mut file.lens]) {
            if let Some(slope_per_nm) = reading.slope_per_nm {
                *lens = lens.with_linear_dispersion(slope_per_nm, REFERENCE_WAVELENGTH_NM)?;
            }
            *lens = lens.clone().with_glass_range(reading.glass_range);
        }
        reading.coated(file)
    }
}

/// Returns the lens with what covers its surfaces: what its file states and a quarter wave of magnesium fluoride elsewhere, or one
/// coating on all of them.
fn coated(lens: Lens, coating: Option<&CoatingSpec>) -> Result<Lens, PipelineError> {
    let everywhere = match coating {
        None => return Ok(lens.with_light_loss(Some(Coating::MGF2))?),
        Some(CoatingSpec::Ideal) => return Ok(lens.with_light_loss(None)?),
        Some(CoatingSpec::Bare) => Coating::Bare,
        Some(CoatingSpec::MgF2) => Coating::MGF2,
        Some(CoatingSpec::VCoat) => Coating::VCoat { at_nm: COATING_CENTER_NM },
        Some(CoatingSpec::Bbar) => Coating::Broadband { at_nm: COATING_CENTER_NM },
        Some(CoatingSpec::File(path)) => Coating::read(path)?,
    };
    // What a mirror is made of stays.
    let of_mirrors = lens.coatings().iter().filter(|(surface, _)| lens.is_mirror(*surface)).cloned().collect();
    Ok(lens.with_coatings(of_mirrors)?.with_light_loss(Some(everywhere))?)
}

/// What covers the surfaces of a lens between air and glass.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum CoatingSpec {
    /// Nothing.
    Bare,
    /// A quarter wave of magnesium fluoride at 550 nm.
    MgF2,
    /// Two layers that reflect nothing at 550 nm.
    VCoat,
    /// Three layers for the whole of the visible.
    Bbar,
    /// Light passes as if no surface reflected and no glass absorbed any.
    Ideal,
    /// A coating of a file: a table of reflectance (`.csv`) or layers (`.ron`).
    File(PathBuf),
}

impl CoatingSpec {
    /// Returns what a word names, or else the file of that name.
    pub fn named(text: &str) -> Self {
        match text.to_ascii_lowercase().as_str() {
            "bare" => Self::Bare,
            "mgf2" => Self::MgF2,
            "vcoat" => Self::VCoat,
            "bbar" => Self::Bbar,
            "ideal" => Self::Ideal,
            _ => Self::File(PathBuf::from(text)),
        }
    }
}

impl StopSpec {
    /// Returns the lens with its stop set.
    ///
    /// # Errors
    /// When the stop does not open so far.
    pub fn apply(self, lens: Lens) -> Result<Lens, PipelineError> {
        self.apply_at(lens, REFERENCE_WAVELENGTH_NM)
    }

    /// Returns a sentence where [`apply_at`](Self::apply_at) takes another opening of the lens than that of the number.
    pub fn note_at(self, lens: &Lens, wavelength_nm: f64) -> Option<String> {
        match self {
            Self::FNumber(n) => lens.note_on_f_number(n, wavelength_nm),
            Self::AsGiven | Self::DiameterMm(_) => None,
        }
    }

    /// Returns the lens with its stop set; an f-number is that at this wavelength, nm.
    ///
    /// # Errors
    /// When the stop does not open so far, or a glass is not known at the wavelength.
    pub fn apply_at(self, lens: Lens, wavelength_nm: f64) -> Result<Lens, PipelineError> {
        Ok(match self {
            Self::AsGiven => lens,
            Self::FNumber(n) => lens.with_f_number(n, wavelength_nm)?,
            Self::DiameterMm(d) => lens.with_stop_diameter_mm(d)?,
        })
    }
}

impl Camera {
    /// Returns the lens with its blades and its stop set, not yet moved before the film, at the wavelength of its focus.
    ///
    /// # Errors
    /// When there is none of that name, its file cannot be read, it has no iris, or the stop does not open so far.
    pub fn stopped_lens(&self) -> Result<MonoLens, PipelineError> {
        let file = self.lens.open(&self.lens_reading)?;
        let reference_nm = reference_nm_of(&file);
        Ok(self.stop.apply_at(with_blades(file.lens, self.iris)?, reference_nm)?.at(reference_nm)?)
    }
}

/// Returns the wavelength of focus, stop and field of a lens, nm: the main one of its file, else 550 nm.
pub fn reference_nm_of(file: &LensFile) -> f64 {
    let is_known = |nm: &f64| file.lens.at(*nm).is_ok();
    file.main_wavelength_nm().filter(is_known).unwrap_or(REFERENCE_WAVELENGTH_NM)
}

/// Returns a lens with these blades, or with its own where there are none.
///
/// # Errors
/// When their numbers make no sense, or the lens is a pinhole.
pub fn with_blades(lens: Lens, iris: Option<Iris>) -> Result<Lens, PipelineError> {
    Ok(if iris.is_some() { lens.with_iris(iris)? } else { lens })
}

impl SensorSpec {
    /// Returns what `SENSOR` on the command line means: a path where it looks like one or is one, else a built-in name.
    pub fn named(text: &str) -> Self {
        if is_path(text) { Self::File(PathBuf::from(text)) } else { Self::BuiltIn(text.to_owned()) }
    }

    /// Returns the sensor.
    ///
    /// # Errors
    /// When there is none of that name, or the file cannot be read.
    pub fn open(&self) -> Result<Sensor, PipelineError> {
        Ok(match self {
            Self::BuiltIn(name) => Sensor::built_in(name)?,
            Self::File(path) => Sensor::read(path)?,
        })
    }
}

pub(super) fn is_path(text: &str) -> bool {
    let path = Path::new(text);
    path.extension().is_some() || text.contains(std::path::MAIN_SEPARATOR) || path.exists()
}

/// What a lens file leaves open, and how to close it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct LensReadOptions {
    /// Glass catalogues (`.agf`, `.yml`) to look in before the built-in one.
    pub glasses: Vec<PathBuf>,
    /// What to do with a glass that no catalogue has.
    pub missing_glass: MissingGlass,
    /// What becomes of a wavelength outside the range in which a glass is known.
    pub glass_range: GlassRange,
    /// The change of index a nanometre, about [`REFERENCE_WAVELENGTH_NM`], of the media of which only one index is stated.
    pub slope_per_nm: Option<f64>,
    /// How many times as large the lens is as its prescription has it, in all its lengths; `None` for as large. What is changed of a lens
    /// ([`LensSpec::Changed`]) is changed of the larger one.
    pub lens_scale: Option<f64>,
    /// What covers all surfaces between air and glass; `None` for what the lens's file states and, where it states nothing, a quarter wave of
    /// magnesium fluoride at 550 nm. Surfaces between two glasses reflect by Fresnel's equations, and glass absorbs what is known of it.
    pub coating: Option<CoatingSpec>,
    /// What the numbers of surfaces are in a CODE V file that says neither radii nor curvatures; `None` for what is plausible.
    pub seq_numbers: Option<SeqNumbers>,
    /// Which configuration of a lens file that has several, as the positions of a zoom lens, counted from 1; `None` for the one that the
    /// file has in use.
    pub configuration: Option<usize>,
}

impl LensReadOptions {
    /// Returns a lens file with what covers the surfaces of its lens.
    ///
    /// # Errors
    /// When the file of a coating cannot be read, or its coatings make no sense.
    pub fn coated(&self, mut file: LensFile) -> Result<LensFile, PipelineError> {
        let lenses = file.configurations.iter_mut().map(|configuration| &mut configuration.lens);
        for lens in lenses.chain([&mut file.lens]) {
            *lens = coated(lens.clone(), self.coating.as_ref())?;
        }
        Ok(file)
    }

    /// The files that it names.
    pub fn files_mut(&mut self) -> impl Iterator<Item = &mut PathBuf> {
        let coating = match &mut self.coating {
            Some(CoatingSpec::File(path)) => Some(path),
            _ => None,
        };
        self.glasses.iter_mut().chain(coating)
    }

    /// The files that it names.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        let coating = match &self.coating {
            Some(CoatingSpec::File(path)) => Some(path),
            _ => None,
        };
        self.glasses.iter().chain(coating).map(PathBuf::as_path)
    }

    /// Returns it as options of the lens readers.
    fn options(&self) -> Result<ReadOptions, PipelineError> {
        // A catalogue is a file, or that of a maker, whose glass a name then means that several have.
        let built_in = GlassCatalogue::built_in().makers();
        let is_maker = |path: &Path| built_in.iter().any(|maker| path.as_os_str().eq_ignore_ascii_case(maker));
        let (makers, files): (Vec<&PathBuf>, Vec<&PathBuf>) =
            self.glasses.iter().partition(|path| is_maker(path) && !path.exists());
        if let Some(unknown) = files.iter().find(|path| path.extension().is_none() && !path.exists()) {
            return Err(PipelineError::Value {
                origin: "the glasses".to_owned(),
                key: "catalog",
                found: unknown.display().to_string(),
                expected: format!("a catalogue (.agf, .yml) or a maker: {}", built_in.join(", ")),
            });
        }
        let catalogues = files.into_iter().map(|path| GlassCatalogue::read(path)).collect::<Result<_, _>>()?;
        let makers = makers.into_iter().map(|path| path.to_string_lossy().into_owned()).collect();
        let Self { missing_glass, seq_numbers, configuration, .. } = *self;
        Ok(ReadOptions { catalogues, makers, missing_glass, seq_numbers, configuration })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DrawnEye;

    #[test]
    fn names_and_paths_are_told_apart() {
        assert_eq!(LensSpec::named("dgauss-50mm"), LensSpec::BuiltIn("dgauss-50mm".to_owned()));
        assert_eq!(LensSpec::named("fisheye-12.5mm"), LensSpec::BuiltIn("fisheye-12.5mm".to_owned()));
        assert_eq!(LensSpec::named("thin:50mm:f2"), LensSpec::Thin { focal_length_mm: 50.0, diameter_mm: 25.0 });
        assert_eq!(LensSpec::named("pinhole:0.1mm"), LensSpec::Pinhole { diameter_mm: 0.1 });
        assert_eq!(LensSpec::named("pinhole:0.1"), LensSpec::BuiltIn("pinhole:0.1".to_owned()));
        let eye = |drawn: Option<DrawnEye>| LensSpec::MeasuredEye { file: "a:b.mat".into(), pupil_mm: 4.5, drawn };
        assert_eq!(LensSpec::named("eye:a:b.mat:4.5mm"), eye(None));
        assert_eq!(LensSpec::named("eye:a:b.mat:4.5mm:7"), eye(Some(DrawnEye { number: 7, seed: 0 })));
        let drawn = eye(Some(DrawnEye { number: 7, seed: 2 }));
        assert_eq!(LensSpec::named(&drawn.text().unwrap()), drawn);
        let message = LensSpec::named("eye:b.mat:4.5").open(&LensReadOptions::default()).unwrap_err().to_string();
        assert!(message.contains("eye:FILE:PUPILmm"), "{message}");
        for path in ["lens.dat", "./lens", "folder/lens"] {
            assert_eq!(LensSpec::named(path), LensSpec::File(PathBuf::from(path)));
        }
    }

    #[test]
    fn a_changed_lens_is_that_lens_with_other_numbers() {
        let plain = LensSpec::BuiltIn("dgauss-50mm".to_owned());
        let reading = LensReadOptions::default();
        let lens = plain.open(&reading).unwrap().lens;
        let change = SurfaceChange { surface: 1, thickness_mm: Some(9.25), ..SurfaceChange::default() };
        let changed = plain.with_changes(vec![change]);
        let opened = changed.open(&reading).unwrap().lens;
        assert_eq!(opened.interfaces()[1].thickness_after_mm, 9.25);
        assert_eq!(opened.interfaces()[1].surface, lens.interfaces()[1].surface);
        assert_eq!((changed.base(), changed.with_changes(Vec::new())), (&plain, plain.clone()));
        let wrong = plain.with_changes(vec![SurfaceChange { surface: 99, ..change }]);
        assert!(wrong.open(&reading).unwrap_err().to_string().contains("surface 99, expected 0 to"));
    }
}
