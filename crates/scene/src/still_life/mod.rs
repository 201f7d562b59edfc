//! A still life made by formula: the built-in demonstration scene.

mod filter;
mod floor_plan;
mod light_probe;
mod lights;
mod lit;
mod material;
mod noise;
mod pattern;
mod pigment;
mod quick;
mod render;
mod room;
mod shade;
mod shape;
mod tree;
mod world;

use std::sync::OnceLock;

use dioptric_spectrum::{Cancel, DepthMap, SpectralImage, WavelengthGrid};
use glam::{DMat3, DVec3};

use crate::{HiddenLayer, Scene, SceneError, SceneLight, View};
use light_probe::light_on_grays;
pub use lit::{LitStillLife, StillLifePoint};
use quick::quick_picture;
use render::{Eye, Painting, Which, picture};

/// How the still life is pictured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StillLife {
    /// Rows of the picture.
    pub rows: usize,
    /// Columns of the picture.
    pub columns: usize,
    /// Angle from its left edge to its right; the arrangement is made for 3 × 2 pictures of 34°.
    pub horizontal_fov_deg: f64,
    /// Whether to picture what lies behind each first thing too, which takes twice the time.
    pub with_hidden: bool,
    /// Whether to paint it in a quarter of the time, for previews: pixels share the points they are looked at through, and light is gathered by a quarter of the
    /// rays. Edges and shadows are rougher, and things much thinner than a pixel can be missed. What is hidden is painted as always.
    pub quick: bool,
    /// How far the eye stands from its place in the arrangement, to its right, up and ahead, m.
    pub moved_m: [f64; 3],
}

impl StillLife {
    /// The picture that the arrangement is made for.
    pub fn new(columns: usize, rows: usize) -> Self {
        Self { rows, columns, horizontal_fov_deg: 34.0, with_hidden: false, quick: false, moved_m: [0.0; 3] }
    }

    /// Returns the still life on these bands: absolute radiance, the depth at the center of each sample, the view.
    ///
    /// A table by a window stands in a room, with things from 0.65 m to 4 m before the eye: fruit, a 24-patch chart
    /// and a printed card at 1 m; a vase, books, a bottle behind; a chair at 2.5 m; a sideboard, books, a lamp, a
    /// picture and small bulbs at the far wall. Reflectances are those of the chart or smooth formulas. Daylight of
    /// 6200 K comes through the window, light of a 2850 K black body from two lamps; light bounced once is traced,
    /// and what bounces more is taken as even. A mirror image has the depth of the mirror. The light that is stated for the
    /// scene is the mixture on the grays of the chart, measured on them.
    ///
    /// The result does not depend on the number of threads.
    ///
    /// # Errors
    /// When the size is 0 or the angle is not between 0° and 180°.
    pub fn scene(&self, grid: &WavelengthGrid) -> Result<Scene, SceneError> {
        self.scene_with(grid, &|_| {}, &Cancel::new())
    }

    /// As [`scene`](Self::scene); `progress` gets the part that is done, 0–1, from any thread, and a cancel is looked at every
    /// millisecond or so.
    ///
    /// # Errors
    /// As [`scene`](Self::scene), and when the work is cancelled.
    pub fn scene_with(
        &self,
        grid: &WavelengthGrid,
        progress: &(dyn Fn(f64) + Sync),
        cancel: &Cancel,
    ) -> Result<Scene, SceneError> {
        self.check()?;
        let world = room::world();
        let eye = eye(self.view()?, self.moved_m);
        let n_layers = if self.with_hidden { 2 } else { 1 };
        let painting = Painting::new(n_layers * 2 * self.rows, progress, cancel);
        let layer = |which| picture(&world, &eye, (self.rows, self.columns), grid, which, &painting);
        let first = match self.quick {
            true => quick_picture(&world, &eye, (self.rows, self.columns), grid, &painting)?,
            false => layer(Which::First)?,
        };
        let hidden = match self.with_hidden {
            true => Some(layer(Which::Behind)?).map(|l| HiddenLayer { radiance: l.radiance, depth: l.depth }),
            false => None,
        };
        Ok(Scene { hidden, ..self.of_painting(first.radiance, first.depth)? })
    }

    fn view(&self) -> Result<View, SceneError> {
        View::from_horizontal_fov_deg(self.horizontal_fov_deg, self.columns, self.rows)
    }

    fn check(&self) -> Result<(), SceneError> {
        if self.rows == 0 || self.columns == 0 || self.rows.saturating_mul(self.columns) > 1 << 28 {
            return Err(SceneError::Setting {
                what: "the size of the still life",
                value: format!("{} × {} samples", self.columns, self.rows),
                expected: "1 to 2²⁸ samples".to_owned(),
            });
        }
        let at = eye(self.view()?, self.moved_m).origin;
        if !room::is_inside(at) {
            return Err(SceneError::Setting {
                what: "the place of the eye before the still life",
                value: format!("{:?} m from where it stands", self.moved_m),
                expected: "one within the room".to_owned(),
            });
        }
        Ok(())
    }

    /// Returns the scene of what [`scene`](Self::scene) painted before, without a hidden layer.
    ///
    /// # Errors
    /// When the painting is not of this size.
    pub fn of_painting(&self, radiance: SpectralImage, depth: DepthMap) -> Result<Scene, SceneError> {
        let size = (radiance.rows(), radiance.columns());
        if size != (self.rows, self.columns) || depth.z_m().dim() != size {
            return Err(SceneError::Setting {
                what: "the size of the painting",
                value: format!("{} × {} samples", size.1, size.0),
                expected: format!("{} × {} samples, in radiance and depth", self.columns, self.rows),
            });
        }
        Ok(Scene {
            name: "still life".to_owned(),
            radiance,
            depth: Some(depth),
            view: Some(self.view()?),
            hidden: None,
            points: vec![],
            light: Some(light()?),
            notes: vec![],
        })
    }
}

/// Returns the light on the grays, measured once: it is the same for all pictures.
fn light() -> Result<SceneLight, SceneError> {
    static LIGHT: OnceLock<SceneLight> = OnceLock::new();
    if let Some(light) = LIGHT.get() {
        return Ok(light.clone());
    }
    let light = light_on_grays(&room::world())?;
    Ok(LIGHT.get_or_init(|| light).clone())
}

/// The eye, a hand's breadth above the table, looking slightly down; moved so far to its right, up and ahead, m.
fn eye(view: View, moved_m: [f64; 3]) -> Eye {
    const HEIGHT_M: f64 = 0.225;
    const DOWN_DEG: f64 = 5.6;
    let (sin, cos) = DOWN_DEG.to_radians().sin_cos();
    let axes = DMat3::from_cols(DVec3::X, DVec3::new(0.0, cos, sin), DVec3::new(0.0, -sin, cos));
    Eye { origin: DVec3::new(0.0, HEIGHT_M, 0.0) + axes * DVec3::from_array(moved_m), axes, view }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    #[test]
    fn the_still_life_is_a_scene_with_depth_steps_and_highlights() {
        let grid = WavelengthGrid::uniform(400.0, 700.0, 20.0).unwrap();
        let scene = StillLife { with_hidden: true, ..StillLife::new(96, 64) }.scene(&grid).unwrap();
        scene.validate().unwrap();
        let (near, far) = scene.require_depth().unwrap().range_m();
        assert!(near < 0.75 && far > 3.7 && far < 4.3, "{near} m to {far} m");
        let mean = scene.mean_luminance_cd_m2();
        assert!((20.0..150.0).contains(&mean), "{mean} cd/m²");
        let hidden = scene.hidden.as_ref().unwrap();
        let first = scene.require_depth().unwrap().z_m();
        assert!(hidden.depth.z_m().iter().zip(first).all(|(behind, first)| behind >= first));
        assert!(hidden.depth.z_m().iter().zip(first).any(|(behind, first)| behind > &(first + 1.0)));
    }

    #[test]
    fn the_light_stated_is_that_on_the_grays() {
        let grid = WavelengthGrid::uniform(400.0, 700.0, 10.0).unwrap();
        let scene = StillLife::new(96, 64).scene(&grid).unwrap();
        let light = scene.light.unwrap();
        // Between the lamps of 2850 K and the window of 6200 K.
        let found = light.illuminant.color_temperature();
        assert!((4000.0..5500.0).contains(&found.kelvin) && found.duv.abs() < 0.02, "{found:?}");
        assert!((100.0..2000.0).contains(&light.illuminance_lux.unwrap()), "{light:?}");
        // The size of the picture does not matter.
        assert_eq!(StillLife::new(30, 20).scene(&grid).unwrap().light, Some(light));
    }

    #[test]
    fn one_thread_and_three_make_the_same_picture() {
        let grid = WavelengthGrid::uniform(450.0, 650.0, 100.0).unwrap();
        for quick in [false, true] {
            let on = |n_threads: usize| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
                pool.install(|| StillLife { quick, ..StillLife::new(48, 32) }.scene(&grid).unwrap())
            };
            assert_eq!(on(1), on(3));
        }
    }

    /// Of its pixels' edges, textures and shadows, not of its light or its depth.
    #[test]
    fn a_quick_picture_shows_what_the_whole_one_does() {
        let grid = WavelengthGrid::uniform(450.0, 650.0, 100.0).unwrap();
        // More rows than are drawn in one go; an odd number of them and of columns; narrow, and so wide that its light is gathered otherwise.
        for (columns, rows, fov_deg) in [(203, 137, 34.0), (150, 101, 8.0), (150, 101, 70.0), (3, 1, 34.0)] {
            let whole = StillLife { horizontal_fov_deg: fov_deg, ..StillLife::new(columns, rows) };
            let quick = StillLife { quick: true, ..whole }.scene(&grid).unwrap();
            let whole = whole.scene(&grid).unwrap();
            // To the rounding of single precision, but where something thin is missed between the corners of a pixel.
            let depths = [&quick, &whole].map(|scene| scene.require_depth().unwrap().z_m());
            let n_other = depths[0].iter().zip(depths[1]).filter(|(a, b)| (*a / *b - 1.0).abs() > 3e-7).count();
            assert!(n_other * 500 < rows * columns, "{n_other} depths");
            let (mut squares, mut n) = (0.0, 0.0);
            for (few, all) in quick.radiance.planes().iter().zip(whole.radiance.planes()) {
                let mean = |plane: &ndarray::Array2<f32>| {
                    plane.iter().map(|v| f64::from(*v)).sum::<f64>() / plane.len() as f64
                };
                let full_scale = 4.0 * mean(all);
                // A highlight is seen or missed.
                assert!(
                    (mean(few) / mean(all) - 1.0).abs() < 0.04 || rows == 1,
                    "{fov_deg}°: {} for {}",
                    mean(few),
                    mean(all)
                );
                for (few, all) in few.iter().zip(all) {
                    let [few, all] = [few, all].map(|v| (f64::from(*v) / full_scale).min(1.0));
                    squares += (few - all).powi(2);
                    n += 1.0;
                }
            }
            let rms = f64::sqrt(squares / n);
            println!("{fov_deg}°: {rms:.4} of full scale");
            // Coarse as they are, a pixel in five is an edge.
            assert!(rms < 0.05 || rows == 1, "{fov_deg}°: {rms}");
        }
    }

    #[test]
    fn what_is_hidden_behind_a_quick_picture_is_that_of_the_whole_one() {
        let grid = WavelengthGrid::new(vec![550.0]).unwrap();
        let whole = StillLife { with_hidden: true, ..StillLife::new(36, 24) };
        let quick = StillLife { quick: true, ..whole }.scene(&grid).unwrap();
        assert_eq!(quick.hidden, whole.scene(&grid).unwrap().hidden);
    }

    #[test]
    fn painting_reports_progress_and_is_cancelled() {
        let grid = WavelengthGrid::new(vec![550.0]).unwrap();
        for quick in [false, true] {
            let life = StillLife { with_hidden: true, quick, ..StillLife::new(24, 16) };
            let (done, cancel) = (Mutex::new(Vec::new()), Cancel::new());
            life.scene_with(&grid, &|part| done.lock().unwrap().push(part), &cancel).unwrap();
            let mut done = done.into_inner().unwrap();
            done.sort_by(f64::total_cmp);
            // Two layers, each row of which is drawn and then lit.
            assert_eq!(done, (1..=64).map(|n| f64::from(n) / 64.0).collect::<Vec<_>>());
            for after in [0.0, 0.2, 0.4, 0.7] {
                let cancel = Cancel::new();
                let stop = |part: f64| {
                    if part > after {
                        cancel.cancel()
                    }
                };
                assert!(matches!(life.scene_with(&grid, &stop, &cancel), Err(SceneError::Cancelled(_))), "{after}");
            }
        }
    }

    #[test]
    fn an_empty_picture_is_refused() {
        let grid = WavelengthGrid::new(vec![550.0]).unwrap();
        assert!(StillLife::new(0, 10).scene(&grid).is_err());
        assert!(StillLife { horizontal_fov_deg: 180.0, ..StillLife::new(4, 4) }.scene(&grid).is_err());
    }
}
