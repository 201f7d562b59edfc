//! The image of a traced lens: one model, whatever the symmetry of the lens.

use dioptric_optics::Lens;
use dioptric_spectrum::Cancel;
use glam::DVec2;
use ndarray::Array2;

use crate::{
    BankSettings, FieldSampling, Kernel, MeasuredError, ModelUse, PsfError, PsfQuery, RadialGeometry,
    decenter::Decenter, field_to_film::FieldToFilm, general::GeneralBank, ray_map::RayMap, render::Layout,
    rotational::RotationalBank,
};

/// The image that a lens forms, from ray maps sampled over field, depth and wavelength.
///
/// It interpolates rays, not pictures: 50 to 300 samples are better than thousands of blended ones. Where points land and
/// how bright they are is kept apart from blur. Of a rotationally symmetric lens, on the axis or moved sideways as a whole, fields
/// are sampled along one radius and turned; of any other over a grid ([`FieldSampling`]).
///
/// Fields are tangents at the entrance pupil and places mm from the film's middle, both in the picture frame (x right, y
/// up); depths are dioptres from the entrance pupil. What lies outside the ranges of the samples is moved to their ends.
#[derive(Clone, Debug)]
pub struct LensImageModel {
    lens: Lens,
    pub(crate) form: Form,
    /// Of fields along a radius: how far the lens stands from the axis of scene and film.
    decenter: Decenter,
    error: Option<MeasuredError>,
}

/// What was sampled.
#[derive(Clone, Debug)]
pub(crate) enum Form {
    /// Of a lens with an axis of symmetry.
    Rotational(Box<RotationalBank>),
    /// Of any lens.
    General {
        bank: Box<GeneralBank>,
        /// Which field is seen where; `None` of [`FieldSampling::Points`].
        field_to_film: Option<Box<FieldToFilm>>,
    },
}

impl LensImageModel {
    /// Traces the samples on all threads.
    ///
    /// Along a radius, fields that see no light at some depth or wavelength are left out, and those beyond them; on a grid
    /// they are dark.
    ///
    /// # Errors
    /// When the settings make no sense, the lens has no index at a wavelength, a lens without an axis of symmetry is to be
    /// sampled along a radius, or so few fields see light that nothing can be imaged.
    pub fn build(lens: &Lens, settings: &BankSettings) -> Result<Self, PsfError> {
        Self::build_with(lens, settings, &|_| {}, &Cancel::new())
    }

    /// Traces the samples as [`build`](Self::build) does; `progress` hears the part that is done, from 0 to 1, on any
    /// thread.
    ///
    /// # Errors
    /// Those of [`build`](Self::build), and [`PsfError::Cancelled`] a few milliseconds after `cancel` asks for it.
    pub fn build_with(
        lens: &Lens,
        settings: &BankSettings,
        progress: &(dyn Fn(f64) + Sync),
        cancel: &Cancel,
    ) -> Result<Self, PsfError> {
        let mut decenter = Decenter::default();
        let form = match &settings.fields {
            FieldSampling::Radial(_) => {
                let (centered, aside) = Decenter::of(lens, settings.reference_wavelength_nm);
                decenter = aside;
                Form::Rotational(Box::new(RotationalBank::build(&centered, settings, progress, cancel)?))
            }
            FieldSampling::Grid { .. } => {
                let mut bank = GeneralBank::build(lens, settings, progress, cancel)?;
                let field_to_film = Some(Box::new(FieldToFilm::new(&mut bank, cancel)?));
                Form::General { bank: Box::new(bank), field_to_film }
            }
            FieldSampling::Points { .. } => {
                let bank = Box::new(GeneralBank::build(lens, settings, progress, cancel)?);
                Form::General { bank, field_to_film: None }
            }
        };
        progress(1.0);
        Ok(Self { lens: lens.clone(), form, decenter, error: None })
    }

    pub(crate) fn form(&self) -> Result<&RotationalBank, &GeneralBank> {
        match &self.form {
            Form::Rotational(bank) => Ok(bank),
            Form::General { bank, .. } => Err(bank),
        }
    }

    /// How far the lens stands from the axis of scene and film.
    pub(crate) fn decenter(&self) -> Decenter {
        self.decenter
    }

    /// Of a grid of fields: the sample that stands for each, itself where it is lit.
    pub(crate) fn nearest_lit(&self) -> Option<&[usize]> {
        match &self.form {
            Form::General { field_to_film: Some(inverse), .. } => Some(inverse.nearest_lit()),
            _ => None,
        }
    }

    /// Returns the ray map of a point, of a dark one that of the nearest lit field, and how it is turned in the picture.
    ///
    /// # Panics
    /// Of [`FieldSampling::Points`].
    pub(crate) fn record(&self, query: PsfQuery) -> (RayMap, DVec2) {
        let PsfQuery { field_tan, dioptres, wavelength_nm, .. } = self.decenter.query(query);
        match &self.form {
            Form::Rotational(bank) => {
                let turn = field_tan.try_normalize().unwrap_or(DVec2::X);
                (bank.record(field_tan.length(), dioptres, wavelength_nm), turn)
            }
            Form::General { bank, field_to_film } => {
                let inverse = field_to_film.as_ref().expect("single points are not divided");
                (inverse.record(bank, field_tan, dioptres, wavelength_nm), DVec2::X)
            }
        }
    }

    /// Returns a point's ray map laid out on pixels.
    pub(crate) fn ray_layout<'a>(&self, record: &'a RayMap, query: PsfQuery) -> Layout<'a> {
        match self.form() {
            Ok(bank) => bank.layout(record, self.decenter.query(query), None),
            Err(bank) => bank.layout(record, query, None),
        }
    }

    /// Returns the model with the error of its interpolation noted: see [`measured_error`](Self::measured_error).
    #[must_use]
    pub fn with_error(self, error: MeasuredError) -> Self {
        Self { error: Some(error), ..self }
    }

    /// The error of what lies between the samples, if it was measured.
    pub fn error(&self) -> Option<MeasuredError> {
        self.error
    }

    /// What was sampled, dark fields included.
    pub fn settings(&self) -> &BankSettings {
        match self.form() {
            Ok(bank) => bank.settings(),
            Err(bank) => bank.settings(),
        }
    }

    /// The lens.
    pub fn lens(&self) -> &Lens {
        &self.lens
    }

    /// The number of fields: of those along a radius, as many as see light.
    pub fn n_fields(&self) -> usize {
        match self.form() {
            Ok(bank) => bank.n_fields(),
            Err(bank) => bank.settings().fields.len(),
        }
    }

    /// The field (tangent) beyond which light reaches the film but is not gathered to an image ([`GatheredFields`](crate::GatheredFields)), where the model
    /// ends for that.
    pub fn scattered_beyond_tan(&self) -> Option<f64> {
        self.form().ok().filter(|bank| bank.is_scattered_beyond()).map(|bank| bank.last_field_tan())
    }

    /// Whether samples about a point see light: of dark points there are no pictures.
    pub fn is_lit(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> bool {
        match self.form() {
            Ok(bank) => self.decenter.seen_from_lens(field_tan, dioptres).length() <= bank.last_field_tan(),
            Err(bank) => bank.centroid_mm(field_tan, dioptres, wavelength_nm).is_some(),
        }
    }

    /// Returns the point spread function of a point about its centroid.
    ///
    /// The window holds the whole geometric picture, and of diffraction's Gaussians all but their far tails; the sum says
    /// how much. Of a dark point it is that of the nearest field that sees light.
    pub fn kernel(&self, query: PsfQuery) -> Kernel {
        match &self.form {
            Form::Rotational(bank) => bank.kernel_and_model(self.decenter.query(query)).0,
            Form::General { bank, field_to_film: Some(inverse) } => inverse.kernel(bank, query),
            Form::General { bank, field_to_film: None } => {
                bank.kernel_and_model(query).map_or_else(|| Kernel::identity(query.pitch_um), |(kernel, _)| kernel)
            }
        }
    }

    /// Returns the point spread function of a point about its centroid and the model that drew it, or `None` of a dark point.
    pub fn kernel_and_model(&self, query: PsfQuery) -> Option<(Kernel, ModelUse)> {
        match self.form() {
            Ok(bank) => self.is_lit_at(query).then(|| bank.kernel_and_model(self.decenter.query(query))),
            Err(bank) => bank.kernel_and_model(query),
        }
    }

    /// Returns the energy on each pixel of a window of `size` × `size` about the centroid, in the picture frame, and the
    /// model that drew it, or `None` of a dark point. The energy of the point is 1; what falls outside is lost.
    pub fn picture(&self, query: PsfQuery, size: usize) -> Option<(Array2<f64>, ModelUse)> {
        match self.form() {
            Ok(bank) => self.is_lit_at(query).then(|| bank.picture(self.decenter.query(query), size)),
            Err(bank) => bank.picture(query, size),
        }
    }

    fn is_lit_at(&self, query: PsfQuery) -> bool {
        self.is_lit(query.field_tan, query.dioptres, query.wavelength_nm)
    }

    /// Returns how far from the centroid the farthest ray of a point lands, mm, or `None` of a dark point.
    pub fn extent_mm(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> Option<f64> {
        match self.form() {
            Ok(bank) => self.is_lit(field_tan, dioptres, wavelength_nm).then(|| {
                let field_tan = self.decenter.seen_from_lens(field_tan, dioptres);
                bank.extent_mm(field_tan.length(), dioptres, wavelength_nm)
            }),
            Err(bank) => bank.extent_mm(field_tan, dioptres, wavelength_nm),
        }
    }

    /// Returns how much of the kernel of a point is wave optics, and not HURB: 1 or 0, or between them where they are
    /// blended. It is 0 unless the settings have [`Diffraction::Wave`](crate::Diffraction::Wave), and of dark points.
    ///
    /// It falls with the range of phases B over the pupil that the diffraction integral has to follow, on a scale of its
    /// logarithm: from 1 at B = 200 to 0 at B = 400, a blur of about ten waves of defocus.
    pub fn wave_fraction(&self, query: PsfQuery) -> f64 {
        match self.form() {
            Ok(bank) => bank.wave_fraction(self.decenter.query(query)),
            Err(bank) => bank.wave_fraction(query),
        }
    }

    /// Returns where the centroid of a point lands, mm.
    ///
    /// Fields beyond the last that sees light go on straight; of [`FieldSampling::Points`] a dark one has NaN.
    pub fn centroid_mm(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> DVec2 {
        match &self.form {
            Form::Rotational(bank) => {
                let field_tan = self.decenter.seen_from_lens(field_tan, dioptres);
                let direction = field_tan.try_normalize().unwrap_or(DVec2::X);
                let radius_mm = bank.geometry(dioptres, wavelength_nm).image_radius_mm(field_tan.length());
                direction * radius_mm + self.decenter.axis_mm()
            }
            Form::General { bank, field_to_film: Some(inverse) } => {
                inverse.centroid_mm(bank, field_tan, dioptres, wavelength_nm)
            }
            Form::General { bank, .. } => {
                bank.centroid_mm(field_tan, dioptres, wavelength_nm).unwrap_or(DVec2::splat(f64::NAN))
            }
        }
    }

    /// Returns irradiance on the film over radiance of a locally uniform scene, sr: the projected solid angle of the pupil
    /// times `|dA_object / dA_film|`. It holds vignetting and every cosine; losses in glass are not in it.
    ///
    /// [`FieldSampling::Points`] do not tell it: there it is NaN.
    pub fn irradiance_per_radiance(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> f64 {
        match &self.form {
            Form::Rotational(bank) => {
                let field_tan = self.decenter.seen_from_lens(field_tan, dioptres);
                bank.geometry(dioptres, wavelength_nm).irradiance_per_radiance(field_tan.length())
            }
            Form::General { bank, field_to_film: Some(inverse) } => {
                inverse.irradiance_per_radiance(bank, field_tan, dioptres, wavelength_nm)
            }
            Form::General { .. } => f64::NAN,
        }
    }

    /// Returns image height and brightness over the field, at one depth and wavelength; `None` unless fields are sampled
    /// along a radius, about the middle of the scene.
    pub fn radial_geometry(&self, dioptres: f64, wavelength_nm: f64) -> Option<RadialGeometry> {
        Some(self.form().ok().filter(|_| self.decenter.is_none())?.geometry(dioptres, wavelength_nm))
    }

    /// Returns the field that a corner of the film sees, `corner_mm` from its middle: of a radius about the middle, along +x.
    ///
    /// Where the corner sees nothing it is the last field that is seen.
    pub fn corner_field_tan(&self, corner_mm: DVec2, dioptres: f64, wavelength_nm: f64) -> DVec2 {
        match &self.form {
            Form::Rotational(bank) if self.decenter.is_none() => {
                let geometry = bank.geometry(dioptres, wavelength_nm);
                DVec2::X * geometry.field_tan(corner_mm.length()).unwrap_or(bank.last_field_tan())
            }
            _ => self.film_map(dioptres, wavelength_nm, corner_mm.length()).field_tan(corner_mm),
        }
    }

    /// Returns the signed radius of the circle of confusion, mm: above 0 for objects nearer than the focus.
    ///
    /// It is that of the part of the ray map that is linear in the pupil, scaled so that an even disc of this size has 95 %
    /// of its energy within it. So it goes smoothly through 0, where aberrations keep a spot from vanishing.
    pub fn blur_radius_mm(&self, field_tan: DVec2, dioptres: f64, wavelength_nm: f64) -> f64 {
        match &self.form {
            Form::Rotational(bank) => {
                let field_tan = self.decenter.seen_from_lens(field_tan, dioptres);
                bank.blur_radius_mm(field_tan.length(), dioptres, wavelength_nm)
            }
            Form::General { bank, field_to_film } => {
                let nearest_lit = field_to_film.as_ref().map(|inverse| inverse.nearest_lit());
                bank.blur_radius_mm(nearest_lit, field_tan, dioptres, wavelength_nm)
            }
        }
    }
}
