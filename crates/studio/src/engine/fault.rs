//! What is wrong with a camera, beside the part of it where that can be mended.

use dioptric_optics::OpticsError;
use dioptric_pipeline::{Camera, FilmSpec, FocusSpec, PipelineError, SceneLack, StopSpec};
use dioptric_psf::PsfError;
use dioptric_sensor::SensorError;

/// A part of the camera, as the window has them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Field {
    /// The scene and its light.
    Scene,
    /// The lens.
    Lens,
    /// How far the stop is open.
    Stop,
    /// Where the film is.
    Focus,
    /// How the lens is turned and moved.
    Movements,
    /// How large the film is.
    Film,
    /// The sensor.
    Sensor,
    /// Exposure, gain and number of frames.
    Exposure,
    /// From the raw frame to the picture.
    Processing,
    /// Bands, diffraction, sampling.
    Simulation,
    /// None of them: a file that cannot be written, an error of the program.
    Elsewhere,
}

/// A camera that has no picture: what is wrong, where, and what would do.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// The part of the camera.
    pub field: Field,
    /// One sentence, as the command line has it.
    pub message: String,
    /// What would do, in a few words, with the camera so changed; none where nothing near would.
    pub remedy: Option<(String, Box<Camera>)>,
}

impl Fault {
    /// Returns the fault of a camera that an error reports.
    pub fn of(error: &PipelineError, camera: &Camera) -> Self {
        Self { field: field_of(error, camera), message: error.to_string(), remedy: remedy(error, camera) }
    }

    /// Returns the fault of a computation that panicked.
    pub(super) fn of_panic(cause: &(dyn std::any::Any + Send)) -> Self {
        let words = cause.downcast_ref::<&str>().copied().map(str::to_owned);
        let words = words.or_else(|| cause.downcast_ref::<String>().cloned()).unwrap_or_default();
        let message = format!("an error of the program itself, please report it with the camera file: {words}");
        Self { field: Field::Elsewhere, message, remedy: None }
    }
}

fn field_of(error: &PipelineError, camera: &Camera) -> Field {
    match error {
        PipelineError::Value { key, .. } => field_of_key(key, camera),
        PipelineError::Setting { reason, .. } | PipelineError::Sensor(reason) => field_of_sensor(reason),
        PipelineError::Optics(error) | PipelineError::Psf(PsfError::Optics(error)) => field_of_optics(error),
        PipelineError::Psf(PsfError::Dark { .. }) => Field::Movements,
        PipelineError::Psf(_) | PipelineError::Spectrum(_) => Field::Simulation,
        PipelineError::Scene(_) | PipelineError::World(_) => Field::Scene,
        PipelineError::Forward(_) => Field::Film,
        PipelineError::Unsuitable { what: "film: Scene" | "crop", .. } => Field::Film,
        PipelineError::Unsuitable { what: "lens_corrections", .. } => Field::Processing,
        PipelineError::Unsuitable { what: "scene", .. } => Field::Scene,
        PipelineError::Unsuitable { what: "a moving burst", .. } => Field::Exposure,
        PipelineError::Unsuitable { .. } | PipelineError::Backward(_) => Field::Simulation,
        // A scene's file is looked for before it is opened; lenses and sensors have errors of their own.
        PipelineError::Read { .. } => Field::Scene,
        _ => Field::Elsewhere,
    }
}

fn field_of_key(key: &str, camera: &Camera) -> Field {
    match key {
        "lens" | "focal_length_mm" | "diameter_mm" | "slope_per_nm" | "lens_scale" => Field::Lens,
        "FNumber" | "DiameterMm" => Field::Stop,
        "DistanceMm" | "FilmMm" => Field::Focus,
        "tilt_deg" | "swing_deg" | "rise_mm" | "shift_mm" => Field::Movements,
        "pitch_um" => Field::Film,
        // Those of the film are looked at before those of the scene.
        "columns" | "rows" => match camera.film {
            FilmSpec::Pixels { columns, rows, .. } if !(1..=65_536).contains(&columns.min(rows)) => Field::Film,
            FilmSpec::Pixels { columns, rows, .. } if columns.max(rows) > 65_536 => Field::Film,
            _ => Field::Scene,
        },
        "Burst" | "BracketStops" | "MovingBurst.frames" | "MovingBurst.motion_px" => Field::Exposure,
        "first_nm" | "last_nm" | "step_nm" | "ListNm" | "error" | "gamma" | "Views" | "diffraction" | "bank" => {
            Field::Simulation
        }
        _ => Field::Scene,
    }
}

fn field_of_sensor(error: &SensorError) -> Field {
    match error {
        SensorError::Value { owner, .. } if owner.ends_with("exposure") => Field::Exposure,
        SensorError::Value { owner, .. } if owner == "the processing" => Field::Processing,
        SensorError::Word { .. } | SensorError::Shape { .. } | SensorError::Unsuitable { .. } => Field::Processing,
        SensorError::Spectrum(_) => Field::Simulation,
        _ => Field::Sensor,
    }
}

fn field_of_optics(error: &OpticsError) -> Field {
    match error {
        OpticsError::StopTooWide { .. } | OpticsError::FNumberTooSmall { .. } => Field::Stop,
        OpticsError::NoFocus { .. } | OpticsError::FilmInLens { .. } => Field::Focus,
        OpticsError::WavelengthOutsideGlass { .. }
        | OpticsError::NotExtended { .. }
        | OpticsError::Wavelength { .. } => Field::Simulation,
        _ => Field::Lens,
    }
}

fn remedy(error: &PipelineError, camera: &Camera) -> Option<(String, Box<Camera>)> {
    let with = |words: String, change: &dyn Fn(&mut Camera)| {
        let mut mended = camera.clone();
        change(&mut mended);
        Some((words, Box::new(mended)))
    };
    match error {
        PipelineError::Optics(OpticsError::StopTooWide { largest_mm, smallest_f_number, .. }) => {
            match (camera.stop, smallest_f_number.is_finite()) {
                (StopSpec::FNumber(_), true) => {
                    let widest = rounded_up(*smallest_f_number);
                    with(format!("open it to f/{widest}"), &|camera| camera.stop = StopSpec::FNumber(widest))
                }
                _ => with(format!("open it to {largest_mm} mm"), &|camera| {
                    camera.stop = StopSpec::DiameterMm(*largest_mm);
                }),
            }
        }
        PipelineError::Optics(OpticsError::FNumberTooSmall { smallest, .. }) => {
            let widest = rounded_up(*smallest);
            with(format!("open it to f/{widest}"), &|camera| camera.stop = StopSpec::FNumber(widest))
        }
        PipelineError::Optics(OpticsError::NoFocus { .. }) if camera.focus != FocusSpec::NearObject => {
            with("focus on the near part of the scene".to_owned(), &|camera| camera.focus = FocusSpec::NearObject)
        }
        PipelineError::Value { key: "FNumber", .. } => {
            with("take the lens's own stop".to_owned(), &|camera| camera.stop = StopSpec::AsGiven)
        }
        PipelineError::Value { key: "DistanceMm", .. } => {
            with("focus on the near part of the scene".to_owned(), &|camera| camera.focus = FocusSpec::NearObject)
        }
        error => {
            let lack = error.scene_lack()?;
            with("take a depth of 2 m and a field of view of 40°".to_owned(), &|camera| {
                if lack != SceneLack::View {
                    camera.scene.depth_m = Some(2.0);
                }
                if lack != SceneLack::Depth {
                    camera.scene.field_of_view_deg = Some(40.0);
                }
            })
        }
    }
}

/// Returns the least number of two decimals that is safely above an f-number which was computed at another wavelength.
fn rounded_up(f_number: f64) -> f64 {
    (100.0 * f_number * 1.003).ceil() / 100.0
}

#[cfg(test)]
mod tests {
    use dioptric_pipeline::{KeptCamera, LensSpec, Quality, SensorSpec, Silent};
    use dioptric_spectrum::Cancel;

    use super::*;

    #[track_caller]
    fn check(change: impl Fn(&mut Camera), field: Field) -> Fault {
        let kept = KeptCamera::new(Camera::demo().unwrap()).with(change).with_quality(Quality::Sketch);
        let error = kept.capture(&Silent, &Cancel::new()).unwrap_err();
        let fault = Fault::of(&error, kept.camera());
        assert_eq!(fault.field, field, "{fault:?}");
        fault
    }

    #[test]
    fn errors_stand_beside_their_field() {
        check(|camera| camera.lens = LensSpec::BuiltIn("no such lens".to_owned()), Field::Lens);
        check(|camera| camera.sensor = SensorSpec::BuiltIn("no such sensor".to_owned()), Field::Sensor);
        check(|camera| camera.movements.tilt_deg = f64::NAN, Field::Movements);
        check(|camera| camera.film = FilmSpec::Pixels { columns: 0, rows: 1, pitch_um: 1.0 }, Field::Film);
        check(|camera| camera.scene.illuminance_lux = Some(-1.0), Field::Scene);
        let far = std::path::PathBuf::from("no/such/scene.exr");
        check(|camera| camera.scene.source = dioptric_pipeline::SceneSource::File(far.clone()), Field::Scene);
        check(|camera| camera.processing.denoise = Some(-1.0), Field::Processing);
        let dark = |camera: &mut Camera| camera.exposure = dioptric_pipeline::with_exposure_s(camera.exposure, -1.0);
        check(dark, Field::Exposure);
    }

    #[test]
    fn the_remedy_is_a_camera_that_works() {
        let wide = |camera: &mut Camera| camera.stop = StopSpec::FNumber(0.5);
        let near = |camera: &mut Camera| camera.focus = FocusSpec::DistanceMm(10.0);
        for (change, field) in [(&wide as &dyn Fn(&mut Camera), Field::Stop), (&near, Field::Focus)] {
            let fault = check(change, field);
            let (words, mended) = fault.remedy.unwrap();
            assert!(words.len() > 5);
            KeptCamera::new(*mended).check().unwrap();
        }
    }
}
