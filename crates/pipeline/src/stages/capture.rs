//! What came of a camera.

use std::sync::Arc;

use dioptric_psf::ArrayFields;
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

/// Pixels by which the radius of the blur may change between two stored distances, before that is told: as far apart as the layers of the imaging,
/// between which kernels are mixed too.
const MIXED_BLURS_PX: f64 = 2.0;

impl Capture {
    /// The bands.
    pub fn grid(&self) -> &WavelengthGrid {
        self.irradiance.grid()
    }

    /// Returns about what two surfaces of the lens reflect to the film over what it images there, for far points of equal brightness in three
    /// fields, at three wavelengths; none where ghosts of the lens are not followed.
    pub fn veil(&self) -> Option<f64> {
        let film_reflectance = self.camera.lens_reflections.film_reflectance().unwrap_or(0.0);
        ghosts::veil(&self.lens.lens, &self.place, film_reflectance, self.grid().range_nm())
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
            .chain(self.notes_on_psfs())
            .chain(self.note_on_gain())
            .chain(self.camera.bank.note())
            .collect()
    }

    /// Says that the film is not where the file of the lens has it, if that is so.
    pub fn note_on_film(&self) -> Option<String> {
        self.lens.note_on_film(self.place.film_distance_mm)
    }

    /// Says what the point spread functions of a file leave open on this film and before this scene.
    fn notes_on_psfs(&self) -> Vec<String> {
        let Some(psfs) = &self.lens.psfs else { return vec![] };
        let (Self { scene, place, lens, .. }, parts) = (self, psfs.array.parts());
        let mut notes = psfs.notes.clone();
        notes.push(
            "psfs: blur is that of the file at every focus and f-number, which place and light the picture alone"
                .to_owned(),
        );
        let name = lens.lens.name();
        let finest_um = parts.pitch_um.iter().copied().fold(f64::INFINITY, f64::min);
        let pixel_um = place.pixel_pitch_um();
        if finest_um > pixel_um * (1.0 + 1e-6) {
            notes.push(format!(
                "psfs: their samples of {finest_um} µm are wider than the pixels of {pixel_um} µm, and the light of each is spread evenly over it"
            ));
        }
        let center_m = 1e-3 * lens.reference.projection_center_z_mm();
        let ends_m =
            [parts.distances_mm.first(), parts.distances_mm.last()].map(|mm| mm.map(|mm| 1e-3 * mm + center_m));
        if let [Some(near_m), Some(far_m)] = ends_m
            && parts.distances_mm.len() > 1
            && (scene.near_m < near_m * (1.0 - 1e-6) || scene.far_m > far_m * (1.0 + 1e-6))
        {
            notes.push(format!(
                "psfs: they are of {near_m:.3} to {far_m:.3} m, the scene lies at {:.3} to {:.3} m: beyond their ends they are those of the end",
                scene.near_m, scene.far_m
            ));
        }
        let step_px = 1e3 * psfs.array.largest_blur_step_mm() / pixel_um;
        if step_px > MIXED_BLURS_PX {
            notes.push(format!(
                "psfs: their blur changes by up to {step_px:.0} pixels from one distance to the next, and points between are given a mixture of \
                 both: more distances make it one blur"
            ));
        }
        let last_deg = match &parts.fields {
            ArrayFields::Heights(heights) if heights.len() > 1 => heights.last().copied(),
            ArrayFields::Grid { x_deg, y_deg } => {
                let reach = |axis: &[f64]| axis.iter().map(|deg| deg.abs()).fold(0.0, f64::max);
                let tan = |deg: f64| deg.to_radians().tan();
                Some(tan(reach(x_deg)).hypot(tan(reach(y_deg))).atan().to_degrees())
            }
            _ => None,
        };
        let film = place.film();
        let corner_mm = (film.half_size_mm() + film.center_mm.abs()).length();
        let corner_deg = (corner_mm / lens.reference.film_scale_mm(place.film_distance_mm).abs()).atan().to_degrees();
        if let Some(last_deg) = last_deg.filter(|last_deg| corner_deg > last_deg * 1.01 + 0.01) {
            notes.push(format!(
                "psfs: they go to {last_deg:.2} degrees, the corner of the film to some {corner_deg:.1} by the focal length of {name}: beyond \
                 their ends they are those of the end"
            ));
        }
        notes
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
            pitch_um: self.place.pitch_um,
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
