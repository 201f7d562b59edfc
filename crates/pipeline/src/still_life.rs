//! The built-in still life of the demo: a world like others, seen by a pinhole.

use std::sync::{Arc, OnceLock};

use dioptric_backward::{Pinhole, PixelGrid, Placement, ViewDetail, gathered_view};
use dioptric_scene::{Scene, SceneError, SceneLight, View};
use dioptric_spectrum::{Cancel, Illuminant, Observer, Spectrum, WavelengthGrid};
use dioptric_world::{Hit, World, glam::DVec2};

use crate::{PaintingFolder, PipelineError, gathered::GatheredPicture};

/// How the still life is pictured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StillLife {
    /// Rows of the picture.
    pub(crate) rows: usize,
    /// Columns of the picture.
    pub(crate) columns: usize,
    /// Angle from its left edge to its right; the arrangement is made for 3 × 2 pictures of 34°.
    pub(crate) horizontal_fov_deg: f64,
    /// Whether it is for a preview: edges and shadows are rougher.
    pub(crate) quick: bool,
}

/// The most samples of a picture.
const MOST_SAMPLES: usize = 1 << 28;

/// Returns the world of the still life, made once.
pub(crate) fn world() -> Arc<World> {
    static WORLD: OnceLock<Arc<World>> = OnceLock::new();
    WORLD.get_or_init(|| Arc::new(World::still_life())).clone()
}

impl StillLife {
    /// The picture that the arrangement is made for.
    pub(crate) fn new(columns: usize, rows: usize) -> Self {
        Self { rows, columns, horizontal_fov_deg: 34.0, quick: false }
    }

    /// Returns the still life on these bands, from a folder of paintings where it is kept there: radiance, the depth at the center of each sample, the view.
    ///
    /// The light that is stated for the scene is the mixture on the grays of its chart, measured on them.
    ///
    /// # Errors
    /// When the size is 0, the angle is not between 0° and 180°, or the work is cancelled.
    pub(crate) fn scene(
        &self,
        grid: &WavelengthGrid,
        folder: Option<&PaintingFolder>,
        progress: &(dyn Fn(f64) + Sync),
        cancel: &Cancel,
    ) -> Result<Scene, PipelineError> {
        let seen = self.picture(grid)?.seen(folder, progress, cancel)?;
        Ok(Scene {
            depth: Some(seen.depth),
            view: Some(self.view()?),
            light: Some(light()?),
            ..Scene::new("still life".to_owned(), seen.radiance)
        })
    }

    /// Whether a folder that would keep the picture has none.
    pub(crate) fn is_lacked_by(&self, folder: &PaintingFolder, grid: &WavelengthGrid) -> Result<bool, PipelineError> {
        Ok(folder.lacks(&self.picture(grid)?.key()))
    }

    fn picture(&self, grid: &WavelengthGrid) -> Result<GatheredPicture, PipelineError> {
        let n_samples = self.rows.saturating_mul(self.columns);
        if !(1..=MOST_SAMPLES).contains(&n_samples) {
            return Err(PipelineError::from(SceneError::Setting {
                what: "the size of the still life",
                value: format!("{} × {} samples", self.columns, self.rows),
                expected: "1 to 2²⁸ samples".to_owned(),
            }));
        }
        Ok(GatheredPicture {
            world: world(),
            world_words: "still life".to_owned(),
            view: pinhole(&world(), self.view()?, (self.columns, self.rows)),
            grid: grid.clone(),
            detail: if self.quick { ViewDetail::Quick } else { ViewDetail::Fine },
            seed: 1,
        })
    }

    fn view(&self) -> Result<View, SceneError> {
        View::from_horizontal_fov_deg(self.horizontal_fov_deg, self.columns, self.rows)
    }
}

/// Returns the eye of the still life with this view.
fn pinhole(world: &World, view: View, (columns, rows): (usize, usize)) -> Pinhole {
    let eye = world.cameras().first().expect("the still life has the eye that it is made for");
    Pinhole {
        placement: Placement { world_from_camera: eye.world_from_camera },
        pixels: PixelGrid::new(columns, rows),
        half_tangents: 0.5 * DVec2::new(columns as f64, rows as f64) / view.focal_px,
        layer: 0,
    }
}

/// Rows and columns of the picture in which the grays of the chart are looked for.
const RASTER: (usize, usize) = (144, 216);
/// The material of the chart.
const CHART: &str = "chart";
/// Wavelengths at which a patch that is gray reflects alike, nm, how much alike, and the least that is no black.
const GRAY_NM: [f32; 8] = [450.0, 480.0, 510.0, 540.0, 570.0, 600.0, 640.0, 680.0];
const GRAY_RANGE: f32 = 1.12;
const LEAST_GRAY: f32 = 0.075;

/// Returns the light on the still life, measured once where a photographer would: on the grays of its chart.
pub(crate) fn light() -> Result<SceneLight, PipelineError> {
    static LIGHT: OnceLock<SceneLight> = OnceLock::new();
    if let Some(light) = LIGHT.get() {
        return Ok(light.clone());
    }
    let light = light_on_grays(&world())?;
    Ok(LIGHT.get_or_init(|| light).clone())
}

/// Returns the mean light on the grays of the chart that the eye sees, every 5 nm.
fn light_on_grays(world: &World) -> Result<SceneLight, PipelineError> {
    let (rows, columns) = RASTER;
    let usual = StillLife::new(columns, rows);
    let whole = pinhole(world, usual.view()?, (columns, rows));
    let hit = |row: usize, column: usize| {
        let ray = whole.ray_at([(column as f64 + 0.5) / columns as f64, (row as f64 + 0.5) / rows as f64]);
        world.intersect(&ray, f32::INFINITY).map(|hit| (hit, -ray.direction))
    };
    let is_chart = |hit: &Hit| world.material_names().nth(hit.material.0 as usize) == Some(CHART);
    let gray = |row: usize, column: usize| {
        let (hit, outgoing) = hit(row, column).filter(|(hit, _)| is_chart(hit))?;
        let values = world.bsdf(&hit, outgoing, &GRAY_NM).diffuse_reflectance();
        let (least, most) = values.iter().fold((f32::INFINITY, 0.0_f32), |(a, b), &v| (a.min(v), b.max(v)));
        (least > LEAST_GRAY && most < GRAY_RANGE * least).then_some(values[0])
    };
    // Those whose neighbors are of the same gray: nothing of another is in them.
    let at = |row: usize, column: usize| {
        let own = gray(row, column)?;
        let beside = [(row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)];
        beside.iter().all(|&(r, c)| gray(r, c).is_some_and(|other| (other - own).abs() < 0.01 * own)).then_some(())
    };
    let inner = (1..rows - 1).flat_map(|row| (1..columns - 1).map(move |column| (row, column)));
    let grays: Vec<(usize, usize)> = inner.filter(|&(row, column)| at(row, column).is_some()).collect();
    let range =
        |of: &dyn Fn(&(usize, usize)) -> usize| Some((grays.iter().map(of).min()?, grays.iter().map(of).max()? + 1));
    let (Some((top, bottom)), Some((left, right))) = (range(&|gray| gray.0), range(&|gray| gray.1)) else {
        return Err(PipelineError::from(SceneError::Setting {
            what: "the view of the still life",
            value: "no gray of its chart".to_owned(),
            expected: "one at least, to measure the light on".to_owned(),
        }));
    };
    let grid = WavelengthGrid::uniform(360.0, 830.0, 5.0)?;
    let part = Pinhole { pixels: whole.pixels.cropped((left, top), (right - left, bottom - top))?, ..whole };
    let seen = gathered_view(world, &part, &grid, (ViewDetail::Fine, 1), &|_| {}, &Cancel::new())?;
    let mut white = vec![0.0_f64; grid.len()];
    for &(row, column) in &grays {
        let (hit, outgoing) = hit(row, column).expect("the chart is met here");
        for ((sum, &nm), plane) in white.iter_mut().zip(grid.centers_nm()).zip(seen.radiance.planes()) {
            let [reflectance] = world.bsdf(&hit, outgoing, &[nm as f32]).diffuse_reflectance();
            *sum += f64::from(plane[(row - top, column - left)] / reflectance) / grays.len() as f64;
        }
    }
    // A perfect white sends out its illuminance over π.
    let lux = std::f64::consts::PI * Observer::Cie1931.xyz(&grid, &white).luminance_cd_m2();
    let spectrum = Spectrum::new(grid.centers_nm().to_vec(), white)?;
    Ok(SceneLight::new(Illuminant::Spectrum(spectrum), lux))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_stated_is_that_on_the_grays() {
        let light = light().unwrap();
        // Between the lamps of 2850 K and the window of 6200 K.
        let found = light.illuminant.color_temperature();
        assert!((4000.0..5500.0).contains(&found.kelvin) && found.duv.abs() < 0.02, "{found:?}");
        assert!((100.0..2000.0).contains(&light.illuminance_lux.unwrap()), "{light:?}");
    }

    #[test]
    fn scene_has_depth_view_and_light_of_a_room() {
        let grid = WavelengthGrid::uniform(400.0, 700.0, 20.0).unwrap();
        let scene = StillLife::new(96, 64).scene(&grid, None, &|_| {}, &Cancel::new()).unwrap();
        let (near, far) = scene.require_depth().unwrap().range_m();
        assert!((0.5..0.85).contains(&near) && (3.9..4.3).contains(&far), "{near} to {far} m");
        let mean = scene.mean_luminance_cd_m2();
        assert!((20.0..150.0).contains(&mean), "{mean} cd/m²");
        assert_eq!((scene.rows(), scene.columns(), scene.light), (64, 96, Some(light().unwrap())));
    }

    /// Of its pixels' edges, textures and shadows, not of its light or its depth.
    #[test]
    fn quick_picture_shows_what_the_whole_one_does() {
        let grid = WavelengthGrid::uniform(450.0, 650.0, 100.0).unwrap();
        for (columns, rows, fov_deg) in [(90, 61, 34.0), (3, 1, 34.0)] {
            let whole = StillLife { horizontal_fov_deg: fov_deg, ..StillLife::new(columns, rows) };
            let [quick, whole] = [StillLife { quick: true, ..whole }, whole]
                .map(|life| life.scene(&grid, None, &|_| {}, &Cancel::new()).unwrap());
            let (mut squares, mut n) = (0.0, 0.0);
            for (few, all) in quick.radiance.planes().iter().zip(whole.radiance.planes()) {
                let mean = |plane: &ndarray::Array2<f32>| f64::from(plane.mean().unwrap());
                // What is brighter than a picture shows is left out: a highlight is seen or missed.
                let full = 4.0 * mean(all);
                let shown = |plane: &ndarray::Array2<f32>| plane.iter().map(|v| f64::from(*v).min(full)).sum::<f64>();
                assert!((shown(few) / shown(all) - 1.0).abs() < 0.02 || rows == 1, "{fov_deg}°");
                for (few, all) in few.iter().zip(all) {
                    let [few, all] = [few, all]
                        .map(|v| (f64::from(*v) / (4.0 * mean(whole.radiance.planes().first().unwrap()))).min(1.0));
                    squares += (few - all).powi(2);
                    n += 1.0;
                }
            }
            let rms = f64::sqrt(squares / n);
            println!("{fov_deg}°: {rms:.4} of full scale");
            // Coarse as they are, a pixel in five is an edge.
            assert!(rms < 0.06 || rows == 1, "{fov_deg}°: {rms}");
        }
    }

    #[test]
    fn empty_picture_is_refused() {
        let grid = WavelengthGrid::new(vec![550.0]).unwrap();
        let scene = |life: StillLife| life.scene(&grid, None, &|_| {}, &Cancel::new());
        assert!(scene(StillLife::new(0, 10)).unwrap_err().to_string().contains("1 to 2²⁸"));
        assert!(scene(StillLife { horizontal_fov_deg: 180.0, ..StillLife::new(4, 4) }).is_err());
    }
}
