//! What came of a camera.

use std::sync::Arc;

use dioptric_sensor::{Developed, ElectronRate, GainMode, Processing, Sensor};
use dioptric_spectrum::{Bands, Illuminant, WavelengthGrid};

use super::{
    electrons::{self, PixelRates},
    film::FilmPlace,
    frames::FrameSet,
    ghosts,
    irradiance::Irradiance,
    lens::ResolvedLens,
    lens_tables::LensAberrations,
    scene::SceneSummary,
    spec::ElectronInputs,
    white_of::WhiteOf,
};
use crate::{Camera, Frames, LensFacts, Quality};

/// What came of a camera, stage by stage.
#[derive(Clone, Debug)]
pub struct Capture {
    /// The camera.
    pub camera: Camera,
    /// How finely it was simulated.
    pub quality: Quality,
    /// The lens.
    pub lens: Arc<ResolvedLens>,
    /// The scene, in brief.
    pub scene: Arc<SceneSummary>,
    /// The film.
    pub place: Arc<FilmPlace>,
    /// The sensor, of the film's size.
    pub sensor: Sensor,
    /// The irradiance on the film.
    pub irradiance: Arc<Irradiance>,
    /// The mean rate of photo-electrons of whole pixels.
    pub rate: Arc<ElectronRate>,
    /// The frames.
    pub frames: Arc<FrameSet>,
    /// From the raw frame to the picture.
    pub processing: Processing,
    /// What the lens does to the frame, where the processing undoes some of it.
    pub aberrations: Option<Arc<LensAberrations>>,
    /// The picture.
    pub developed: Arc<Developed>,
    /// What the rate of electrons was made from.
    pub(super) inputs: ElectronInputs,
    /// The rates of photodiodes that are read by themselves, besides that of whole pixels.
    pub(super) rates: Arc<PixelRates>,
}

impl Capture {
    /// The bands.
    pub fn grid(&self) -> &WavelengthGrid {
        self.irradiance.grid()
    }

    /// Returns about what two surfaces of the lens reflect to the film over what it images there, for far points of equal brightness in three
    /// fields, at three wavelengths; none where ghosts of the lens are not followed.
    pub fn veil(&self) -> Option<f64> {
        ghosts::veil(&self.lens.lens, &self.place, self.grid().range_nm())
    }

    /// What is white on the film.
    pub fn white_of(&self) -> WhiteOf {
        WhiteOf {
            light: self.scene.light.as_ref().map(|light| light.illuminant.clone()),
            lens: self.sensor.calibrated_behind.clone(),
        }
    }

    /// Notes on the lens at the bands of the picture, a sentence each: what its file states and this program does otherwise,
    /// which glasses are continued beyond the range in which they are known, and what of it the pixels' response to angles leaves out.
    pub fn lens_notes(&self) -> Vec<String> {
        let on_angles = electrons::note_on_angles(&self.sensor, &self.lens.lens, self.camera.movements);
        self.lens
            .notes_at(self.grid().centers_nm())
            .into_iter()
            .chain(on_angles)
            .chain(self.note_on_gain())
            .chain(self.camera.bank.note())
            .collect()
    }

    /// Says that the sensor has no other readout than the usual one, where another was asked for.
    fn note_on_gain(&self) -> Option<String> {
        let is_asked = self.frames.exposure.gain_mode == GainMode::High;
        (is_asked && self.sensor.high_gain.is_none())
            .then(|| format!("{} has one gain: the gain mode 'high' changes nothing", self.sensor.name))
    }

    /// What is written of the frames.
    pub fn frame_parts(&self) -> Frames<'_> {
        let first = self.lens.reference.first_order();
        Frames {
            sensor: &self.sensor,
            filters: &self.inputs.filters,
            exposure: &self.frames.exposure,
            rate: &self.rate,
            exposed: &self.frames.exposed,
            processing: &self.processing,
            lens: self.aberrations.as_ref().map(|aberrations| &aberrations.tables),
            optics: Some(LensFacts {
                name: self.lens.lens.name(),
                f_number: first.f_number,
                focal_length_mm: first.efl_mm,
            }),
            grid: self.grid(),
            exit_pupil: electrons::exit_pupil(&self.sensor, &self.place, &self.lens),
            light: self.scene.light.as_ref().map_or(Illuminant::D65, |light| light.illuminant.clone()),
        }
    }
}
