//! Figure 4: a world by rays from the film through a lens: a pinhole, f/5, and f/5 with 0.05 V of read noise.

use std::path::Path;

use dioptric_sensor::{Noise, Picture, Processing, Sensor};
use dioptric_spectrum::Cancel;

use crate::{
    Camera, FilmSpec, KeptCamera, LensSpec, PipelineError, Progress, RenderEffort, SceneSource, SceneSpec, SensorSpec,
    Silent, WavelengthSpec, WorldSpec, camera::at_rest,
};

/// The read noise of the third panel, V; the sensor swings over 1.15 V.
pub const READ_NOISE_V: f64 = 0.05;
/// The diameter of the stop that stands for a pinhole, mm: a hundredth of that of f/5, without its diffraction.
const PINHOLE_MM: f64 = 0.1;

/// One of the panels.
#[derive(Clone, Debug)]
pub struct Panel {
    /// What it shows.
    pub name: &'static str,
    /// The exposure, metered, s.
    pub exposure_s: f64,
    /// The picture.
    pub picture: Picture,
}

/// Returns the camera of the figure before the world of a file, on a film of so many pixels each way.
///
/// The lens and the film are those of the world's own camera: an ideal lens of 50 mm with a stop of 10 mm, f/5 for what is far;
/// so near as the world is, it works at f/13.7. The sensor is the paper's, its pixels as large as the film's.
///
/// # Errors
/// When the world cannot be read, or has no camera with a lens.
pub fn camera(world: &Path, columns: usize, samples: u32) -> Result<Camera, PipelineError> {
    let mut camera = Camera::demo()?;
    camera.name = "Figure 4".to_owned();
    let spec = WorldSpec { effort: RenderEffort::Samples(samples), ..WorldSpec::of_file(world.to_owned()) };
    camera.scene = SceneSpec { source: SceneSource::World(spec), ..SceneSpec::of_file(world.to_owned()) };
    camera.sensor = SensorSpec::BuiltIn("nikon-d100".to_owned());
    // The figure shows the noise.
    camera.processing = Processing { denoise: Some(0.0), ..Processing::default() };
    camera.wavelengths = WavelengthSpec::Range { first_nm: 400.0, last_nm: 700.0, step_nm: 10.0 };
    let read = KeptCamera::new(camera.clone()).world(&Silent, &Cancel::new())?;
    let has_lens = read.cameras().first().map_or(Ok(false), |of_file| camera.take_from_world(of_file))?;
    let FilmSpec::Pixels { columns: full, pitch_um, .. } = camera.film else { return Err(no_lens(world)) };
    if !has_lens {
        return Err(no_lens(world));
    }
    camera.film = FilmSpec::Pixels { columns, rows: columns, pitch_um: pitch_um * full as f64 / columns as f64 };
    if let SceneSource::World(spec) = &mut camera.scene.source {
        // A view wider than the film, its samples a little finer than the film's.
        spec.size = Some((3 * columns / 2, 3 * columns / 2));
    }
    Ok(camera)
}

fn no_lens(world: &Path) -> PipelineError {
    let reason = format!("{} has no camera with a lens, which the figure takes", world.display());
    PipelineError::Unsuitable { what: "scene", reason }
}

/// Returns the three panels: with a pinhole, at f/5 without and with read noise.
///
/// # Errors
/// When the world cannot be rendered.
pub fn panels(camera: &Camera, progress: &dyn Progress, cancel: &Cancel) -> Result<[Panel; 3], PipelineError> {
    let open = KeptCamera::new(camera.clone());
    let closed = open.with(|camera| {
        if let LensSpec::Thin { diameter_mm, .. } = &mut camera.lens {
            *diameter_mm = PINHOLE_MM;
        }
    });
    let panel = |name, kept: &KeptCamera, read_noise_v: f64| -> Result<Panel, PipelineError> {
        let capture = kept.capture(progress, cancel)?;
        let sensor = Sensor { read_noise_v, ..capture.sensor.clone() };
        let exposure = capture.frames.exposure;
        let noise = Noise { sources: camera.noise, fixed_pattern_seed: camera.chip_seed, ..Noise::all(camera.seed) };
        let exposed = camera.frames.expose(&sensor, &at_rest(&capture.rate), &exposure, &noise)?;
        let picture = sensor.develop(exposed.developed_from(), &capture.processing)?.picture;
        Ok(Panel { name, exposure_s: exposure.time_s, picture })
    };
    Ok([
        panel("pinhole", &closed, 0.0)?,
        panel("f/5", &open, 0.0)?,
        panel("f/5, read noise 0.05 V", &open, READ_NOISE_V)?,
    ])
}

impl Panel {
    /// Returns the median, over the picture, of how far the green of a pixel is from the mean of its four neighbors, in
    /// codes of 8 bits: a measure of noise that edges hardly change.
    pub fn graininess(&self) -> f64 {
        let (rows, columns) = (self.picture.rows(), self.picture.columns());
        let green = |row: usize, column: usize| 255.0 * f64::from(self.picture.rgb_at(row, column)[1]);
        let mut off: Vec<f64> = (1..rows - 1)
            .flat_map(|row| (1..columns - 1).map(move |column| (row, column)))
            .map(|(r, c)| {
                let beside = green(r - 1, c) + green(r + 1, c) + green(r, c - 1) + green(r, c + 1);
                (green(r, c) - 0.25 * beside).abs()
            })
            .collect();
        let middle = off.len() / 2;
        *off.select_nth_unstable_by(middle, f64::total_cmp).1
    }
}

/// Returns the panels in numbers: exposure, mean codes of red, green and blue, graininess.
pub fn table(panels: &[Panel]) -> String {
    let mut text = "panel,exposure_s,mean_red,mean_green,mean_blue,graininess\n".to_owned();
    for panel in panels {
        let codes = panel.picture.to_rgb8();
        let mean = |channel: usize| {
            codes.iter().skip(channel).step_by(3).map(|&code| f64::from(code)).sum::<f64>() / (codes.len() / 3) as f64
        };
        let name = panel.name.replace(',', "");
        let [red, green, blue] = [mean(0), mean(1), mean(2)];
        let grain = panel.graininess();
        text += &format!("{name},{:.6},{red:.3},{green:.3},{blue:.3},{grain:.3}\n", panel.exposure_s);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small() -> [Panel; 3] {
        let world = dioptric_golden::workspace_root().join("fixtures/worlds/metronome.pbrt");
        let mut camera = camera(&world, 40, 64).unwrap();
        camera.wavelengths = WavelengthSpec::Range { first_nm: 420.0, last_nm: 700.0, step_nm: 40.0 };
        panels(&camera, &Silent, &Cancel::new()).unwrap()
    }

    #[test]
    fn figure4_has_the_papers_three_looks() {
        let panels = small();
        let [closed, open, noisy] = &panels;
        // The area of the stop: (10/0.1)², but for highlights of other parts of the lens.
        let ratio = closed.exposure_s / open.exposure_s;
        assert!((ratio / 1e4 - 1.0).abs() < 0.15, "{ratio}");
        // The authors' pictures: 9 times.
        assert!(noisy.graininess() > 4.0 * open.graininess(), "{} {}", noisy.graininess(), open.graininess());
        // Another machine's sines and logarithms may turn a few paths, which is noise of the rendering.
        dioptric_golden::check_csv("figure4_panels.csv", &table(&panels), 0.02);
    }
}
