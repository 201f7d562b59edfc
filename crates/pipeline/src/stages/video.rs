//! Frames of a camera that turns, row by row.

use std::sync::Arc;

use dioptric_sensor::{
    Developed, ElectronRate, ExitPupil, Exposure, Illumination, LensTables, Noise, Processing, Raw, ReadLines,
    RollingShutter, Sensor,
};
use dioptric_spectrum::{Bands, Cancel};
use serde::Serialize;

use super::{KeptCamera, electrons, film::FilmPlace};
use crate::{CameraTurn, FilmSpec, PipelineError, Progress, Stage, TurnPath, VideoSpec, display::LEAST_DARK_FRACTION};

/// The farthest that the film of a video is larger than its frames, as a share of them, each way.
const LARGEST_MARGIN: f64 = 2.0;

/// A video that is ready to be taken, frame by frame.
#[derive(Clone, Debug)]
pub struct Video {
    /// What is taken.
    pub spec: VideoSpec,
    /// The sensor, of the size of a frame.
    pub sensor: Sensor,
    /// The exposure of every frame, metered at the start.
    pub exposure: Exposure,
    /// From the start of one row to that of the next, µs; 0 for a global shutter.
    pub row_time_us: f64,
    /// Samples of the image in a unit of the tangent of the field.
    pub samples_per_tan: f64,
    /// The notes on bands beyond the tables of sensor and filters, a sentence each.
    pub notes: Vec<String>,
    path: TurnPath,
    rows_as_one: ReadLines,
    exposed: Sensor,
    still: Arc<ElectronRate>,
    exit_pupil: Option<ExitPupil>,
    processing: Processing,
    tables: Option<LensTables>,
    noise: Noise,
}

/// A frame of a video.
#[derive(Clone, Debug)]
pub struct VideoFrame {
    /// When and where it was taken.
    pub facts: VideoFrameFacts,
    /// The frame as the converter gives it.
    pub raw: Raw,
    /// The picture.
    pub developed: Developed,
}

/// When a frame was taken, and where the camera pointed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct VideoFrameFacts {
    /// When the exposure of its first row begins, s.
    pub start_s: f64,
    /// Pan, tilt and roll in the middle of the exposure of its first row, degrees.
    pub first_row_deg: [f64; 3],
    /// Pan, tilt and roll in the middle of the exposure of its last row, degrees.
    pub last_row_deg: [f64; 3],
}

impl Video {
    /// The rows and the columns of a frame, those that are read as one being one.
    pub fn size(&self) -> (usize, usize) {
        let sheet = self.sensor.as_read(&self.exposure).expect("the binning was checked when the video was made ready");
        (sheet.rows, sheet.columns)
    }

    /// Takes a frame, counted from 0.
    ///
    /// # Errors
    /// When it cannot be developed.
    pub fn frame(&self, number: usize) -> Result<VideoFrame, PipelineError> {
        let shutter = self.shutter(number);
        let noise = self.noise.frame(number as u64);
        let electrons = self.exposed.electrons(&self.rate(&shutter)?, &self.exposure, &noise)?;
        let volts = self.exposed.volts(&electrons, &self.exposure, &noise)?;
        let raw = self.sensor.digitize(&volts, &self.exposure)?;
        let developed = self.sensor.develop_with(&raw, &self.processing, self.tables.as_ref())?;
        let at_row = |row: usize| self.path.turned_deg(shutter.middle_s(row));
        let facts = VideoFrameFacts {
            start_s: shutter.start_s,
            first_row_deg: at_row(0),
            last_row_deg: at_row(self.sensor.rows - 1),
        };
        Ok(VideoFrame { facts, raw, developed })
    }

    /// Checks that exposure and readout take no longer than a frame lasts.
    fn check_times(&self) -> Result<(), PipelineError> {
        let refused = |reason: String| Err(PipelineError::Unsuitable { what: "video", reason });
        let frame_s = 1.0 / self.spec.frames_per_s;
        if self.exposure.time_s > frame_s {
            return refused(format!(
                "an exposure of {:.4} s is longer than a frame of {frame_s:.4} s, expected fewer frames a second, a shorter exposure or a \
                 higher gain",
                self.exposure.time_s
            ));
        }
        let n_rows = self.rows_as_one.count(self.sensor.rows);
        let readout_s = 1e-6 * self.row_time_us * n_rows as f64;
        if readout_s > frame_s {
            return refused(format!(
                "reading {n_rows} rows takes {readout_s:.4} s, longer than a frame of {frame_s:.4} s, expected fewer frames a second or a shorter \
                 row_time_us"
            ));
        }
        Ok(())
    }

    fn shutter(&self, number: usize) -> RollingShutter {
        let start_s = self.spec.start_s(number);
        let row_time_s = 1e-6 * self.row_time_us;
        RollingShutter { start_s, exposure_s: self.exposure.time_s, row_time_s, rows: self.rows_as_one }
    }

    fn rate(&self, shutter: &RollingShutter) -> Result<ElectronRate, PipelineError> {
        let place_at = |time_s: f64| self.path.place_at(time_s, self.samples_per_tan);
        let size = (self.sensor.rows, self.sensor.columns);
        Ok(self.exposed.rolling_rate(&self.still, size, shutter, &place_at, self.exit_pupil)?)
    }
}

impl KeptCamera {
    /// Makes ready the video that the camera's `video` asks for: the scene is imaged once, on a film that is larger than a frame by as much as the
    /// camera turns, and each frame is taken from there.
    ///
    /// The camera turns about its entrance pupil, so that nothing near moves before what is far, and the picture is taken to be free of
    /// distortion. The exposure is metered at the start and stays.
    ///
    /// # Errors
    /// As [`capture`](Self::capture); when the camera has no `video`, exposure or readout take longer than a frame lasts, or it turns by more
    /// than two frames.
    pub fn video(&self, progress: &dyn Progress, cancel: &Cancel) -> Result<Video, PipelineError> {
        self.camera().validate()?;
        let refused = |what, reason: String| Err(PipelineError::Unsuitable { what, reason });
        let Some(spec) = self.camera().video else {
            return refused("video", "is not in the camera, expected its frames and its motion".to_owned());
        };
        if self.camera().scene.mean_lux.is_some() {
            let reason = "is that of one picture, of which a video has many: expected mean_luminance_cd_m2".to_owned();
            return refused("mean_lux", reason);
        }
        let inputs = self.picture_inputs()?;
        let FrameLayout { mut frame, film_margin, mut samples_per_tan, path } = self.layout(spec, progress, cancel)?;
        if inputs.frames.electrons.sensor.split_pixel.is_some() {
            return refused("video", "is not taken with split pixels, expected a sensor of whole ones".to_owned());
        }
        let larger = self.with(|camera| {
            camera.film = FilmSpec::Pixels {
                columns: (frame.columns + 2 * film_margin[0]) * frame.binning,
                rows: (frame.rows + 2 * film_margin[1]) * frame.binning,
                pitch_um: frame.pitch_um / frame.binning as f64,
            }
        });
        let larger = if film_margin == [0; 2] { self.clone() } else { larger };
        let irradiance = larger.irradiance(progress, cancel)?;
        progress.at(Stage::Sensor, 0.0);
        // A preview of a larger film may be coarser.
        let (lens, place) = larger.lens_and_film(progress, cancel)?;
        let binning = place.binning;
        if binning != frame.binning {
            let fewer = |n: usize| (n * frame.binning / binning).max(1);
            samples_per_tan *= frame.pitch_um / irradiance.pitch_um();
            frame = FilmPlace {
                rows: fewer(frame.rows),
                columns: fewer(frame.columns),
                pitch_um: irradiance.pitch_um(),
                binning,
                ..frame
            };
        }
        let sensor = lens.calibrated(electrons::on_film(&inputs.frames.electrons.sensor, &frame));
        let exposed = sensor.behind(&inputs.frames.electrons.filters);
        let exit_pupil = electrons::exit_pupil(&sensor, &frame, &lens);
        let still = Arc::new(exposed.filter_rates(&Illumination::on_pixels(&*irradiance))?);
        let chain = self.chain(progress, cancel);
        let scene = chain.summary(&inputs.frames.electrons.irradiance.scene)?;
        let processing = self.camera().processing.under(scene.light.as_ref().map(|light| &light.illuminant));
        let tables = chain.aberrations(&inputs)?.map(|aberrations| aberrations.tables.clone());
        let row_time_us = spec.row_time_us.unwrap_or(sensor.row_time_us) * frame.binning as f64;
        let mut notes = sensor.bands_beyond_tables(irradiance.grid());
        notes.extend(
            inputs.frames.electrons.filters.iter().filter_map(|filter| filter.note_beyond_table(irradiance.grid())),
        );
        notes.extend(electrons::note_on_angles(&sensor, &lens.lens, self.camera().movements));
        notes.extend(note_on_dark_film(irradiance.summary.dark_fraction()));
        if spec.motion != CameraTurn::default() {
            notes.push(
                "frames move as through a lens without distortion that turns about its entrance pupil: straight lines stay straight and near \
                 things do not move before far ones"
                    .to_owned(),
            );
        }
        let mut video = Video {
            spec,
            exposure: Exposure::seconds(0.0),
            row_time_us,
            samples_per_tan,
            notes,
            path,
            rows_as_one: sensor.rows_exposed_as_one(inputs.frames.shutter.exposure.shot())?,
            exposed,
            still,
            exit_pupil,
            processing,
            tables,
            noise: inputs.frames.shutter.noise,
            sensor,
        };
        video.sensor.as_read(inputs.frames.shutter.exposure.shot())?;
        let rate = video.rate(&video.shutter(0))?;
        video.exposure = video.exposed.expose(&rate, &inputs.frames.shutter.exposure)?;
        video.check_times()?;
        Ok(video)
    }

    /// Returns the frame on the film, and how much larger the film must be for all that the camera sees.
    fn layout(&self, spec: VideoSpec, progress: &dyn Progress, cancel: &Cancel) -> Result<FrameLayout, PipelineError> {
        let (lens, frame) = self.lens_and_film(progress, cancel)?;
        let samples_per_tan = 1e3 * lens.reference.film_scale_mm(frame.film_distance_mm).abs() / frame.pitch_um;
        let path = TurnPath::new(spec.motion, self.camera().seed);
        let half = [0.5 * (frame.columns as f64 - 1.0), 0.5 * (frame.rows as f64 - 1.0)];
        // The last frame is read for as long as all are.
        let end_s = spec.start_s(spec.frames);
        let n = (spec.frames * 32).max(256);
        let mut beyond = [0.0_f64; 2];
        for instant in 0..=n {
            let place = path.place_at(end_s * instant as f64 / n as f64, samples_per_tan);
            for corner in [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]] {
                let (x, y) = (corner[0] * half[0], corner[1] * half[1]);
                let [u, v, w] = [0, 1, 2].map(|i| place[i][0] * x + place[i][1] * y + place[i][2]);
                if w <= 0.0 {
                    beyond = [f64::INFINITY; 2];
                }
                for (axis, at) in [u / w, v / w].into_iter().enumerate() {
                    beyond[axis] = beyond[axis].max(at.abs() - half[axis]);
                }
            }
        }
        if (0..2).any(|axis| beyond[axis].is_nan() || beyond[axis] > LARGEST_MARGIN * 2.0 * (half[axis] + 1.0)) {
            let reason = format!(
                "turns by more than {LARGEST_MARGIN} frames in {end_s:.3} s, expected a slower or shorter motion: all that it sees is imaged at \
                 once"
            );
            return Err(PipelineError::Unsuitable { what: "video", reason });
        }
        // Two samples more for the interpolation; between instants a shake moves on.
        let film_margin = beyond.map(|px| if px > 1e-9 { px.ceil() as usize + 4 } else { 0 });
        Ok(FrameLayout { frame: (*frame).clone(), film_margin, samples_per_tan, path })
    }
}

/// Returns a sentence on a film of which more than a thousandth gets no light.
fn note_on_dark_film(dark_fraction: f64) -> Option<String> {
    (dark_fraction > LEAST_DARK_FRACTION).then(|| {
        let percent = 100.0 * dark_fraction;
        format!(
            "{percent:.1} % of the film that frames move over gets no light: where that is not black in the scene, take a slower motion, a \
             smaller film or a wider scene"
        )
    })
}

/// A frame, and the film that it moves over.
struct FrameLayout {
    frame: FilmPlace,
    /// Samples by which the film is larger on each side: columns, rows.
    film_margin: [usize; 2],
    samples_per_tan: f64,
    path: TurnPath,
}
