//! A world rendered both ways: rays from the film against the view blurred by point spread functions.

mod fit;
mod parts;

use dioptric_optics::glam::DVec2;
use dioptric_pipeline::{
    BandSampling, Camera, KeptCamera, PipelineError, Progress, REFERENCE_WAVELENGTH_NM, RenderEffort, RenderMethod,
    Rendering, SceneSource, WorldSpec, display::LinearRgb,
};
use dioptric_psf::{LensImage, LensImageModel};
use dioptric_spectrum::{Cancel, SpectralImage};
use ndarray::{Array2, Zip};
use serde::Serialize;

pub use self::fit::Fit;
use self::{
    fit::fit,
    parts::{Parts, divided, means_over_pixels},
};

/// A picture of a world both ways, and how they differ.
#[derive(Clone, Debug, Serialize)]
pub struct MethodComparison {
    /// What is pictured.
    pub name: String,
    /// Samples a pixel of the rays from the film, and of the view that is blurred.
    pub effort: RenderEffort,
    /// The share of pixels in the band of depth edges: those that the blur of an edge reaches.
    pub edge_fraction: f64,
    /// In how many parts each way the view was imaged on each pixel.
    pub parts_of_pixels: usize,
    /// The share of pixels that are lit by rays from the film and see nothing of the view, which ends before them.
    pub beyond_view_fraction: f64,
    /// What is to be known about the comparison, a sentence each.
    pub notes: Vec<String>,
    /// A row a band.
    pub rows: Vec<MethodRow>,
    /// The picture by rays from the film as an observer sees it, lux.
    #[serde(skip)]
    pub backward: LinearRgb,
    /// The view blurred.
    #[serde(skip)]
    pub forward: LinearRgb,
    /// Where the band of depth edges is.
    #[serde(skip)]
    pub is_edge: Array2<bool>,
}

/// How two pictures of a band differ: forward less backward.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct MethodRow {
    /// The center of the band, nm.
    pub wavelength_nm: f64,
    /// The difference of the totals, as a share.
    pub total: f64,
    /// One standard error of it, from the noise of the rays from the film; not a number after a single pass, whose noise
    /// nobody knows.
    pub total_error: f64,
    /// The mean absolute difference of pixels off depth edges, as a share of the mean of the picture.
    pub off_edges: f64,
    /// The same in the band of depth edges; none where there are no edges.
    pub edge_band: Option<f64>,
    /// The mean absolute difference that the noise of the rays from the film makes alone; not a number after a single pass.
    pub noise: f64,
    /// What moves and blurs the one picture into the other, off depth edges.
    #[serde(flatten)]
    pub fit: Fit,
}

/// A step of depth between neighbors, as a share of the nearer, that is an edge and no slope.
const EDGE_STEP: f32 = 0.03;

impl MethodComparison {
    /// Renders the world of a camera both ways, on bands of one wavelength each.
    ///
    /// # Errors
    /// When the scene is no world, or as [`KeptCamera::capture`].
    pub fn of(camera: &Camera, progress: &dyn Progress, cancel: &Cancel) -> Result<Self, PipelineError> {
        let mut camera = camera.clone();
        if let SceneSource::StillLife { columns, rows } = camera.scene.source {
            // As a world, of which what edges hide is known.
            camera.scene.source = SceneSource::World(WorldSpec { layers: 2, ..WorldSpec::still_life((columns, rows)) });
            camera.validate()?;
        }
        // Both ways under the light that the world has.
        let told_lux = camera.scene.mean_lux.take();
        let SceneSource::World(spec) = &camera.scene.source else {
            let reason = "it is no world, expected 'source: World((file: ...))' or the still life".to_owned();
            return Err(PipelineError::Unsuitable { what: "scene", reason });
        };
        let effort = spec.effort;
        let by = |method| {
            KeptCamera::new(camera.clone()).with(|camera| {
                if let SceneSource::World(spec) = &mut camera.scene.source {
                    (spec.method, spec.bands) = (method, BandSampling::Center);
                }
            })
        };
        let (forward, backward) = (by(RenderMethod::Forward), by(RenderMethod::Backward));
        // What one way cannot do is reported before the other is run.
        backward.camera().validate()?;
        let parts = Parts::of(&camera, forward.depth(progress, cancel)?.z_m().ncols())?;
        let divided = divided(&camera, parts.n)?;
        let forward = forward.with(|camera| (camera.film, camera.crop) = divided);
        let of_parts = forward.irradiance(progress, cancel)?;
        let blurred = means_over_pixels(&of_parts, parts.n)?;
        let render = backward.world_render(progress, cancel)?.in_large_passes(effort);
        let mut renderer = render.renderer()?;
        render.refine(&mut renderer, effort, progress, cancel, &mut |_| Ok(true))?;
        let z_m = render.auxiliary(cancel)?.z_m;
        let pitch_um = of_parts.pitch_um() * parts.n as f64;
        let is_edge = edge_band(&z_m, &*forward.model(progress, cancel)?, pitch_um);
        let mut comparison = Self::new(&camera.name, effort, (&blurred, &renderer.rendering()), is_edge);
        comparison.parts_of_pixels = parts.n;
        comparison.notes.extend(parts.note());
        comparison
            .notes
            .extend(told_lux.map(|_| "mean_lux is left out: it would hide how much light each way has".to_owned()));
        let centers_nm: Vec<f64> = comparison.rows.iter().map(|row| row.wavelength_nm).collect();
        comparison.notes.extend(forward.lens(progress, cancel)?.notes_at(&centers_nm));
        Ok(comparison)
    }

    fn new(
        name: &str,
        effort: RenderEffort,
        (forward, backward): (&SpectralImage, &Rendering),
        is_edge: Array2<bool>,
    ) -> Self {
        let mut rows = Vec::new();
        let grid = backward.picture.grid();
        for (band, &wavelength_nm) in grid.centers_nm().iter().enumerate() {
            let (truth, error) = (&backward.picture.planes()[band], &backward.standard_error.planes()[band]);
            rows.push(MethodRow::of(wavelength_nm, &forward.planes()[band], (truth, error), &is_edge));
        }
        let n_edge = is_edge.iter().filter(|&&is| is).count();
        let (forward_seen, backward_seen) = (LinearRgb::of_image(forward), LinearRgb::of_image(&backward.picture));
        let is_of_one_pass = rows.iter().any(|row| row.noise.is_nan());
        let one_pass = is_of_one_pass.then(|| {
            "the noise is not known: a single pass shows no spread; more samples, as --samples 64, tell it".to_owned()
        });
        let beyond_view_fraction = beyond_view_fraction(forward.planes(), backward.picture.planes());
        let is_beyond = (beyond_view_fraction > LEAST_BEYOND_VIEW).then(|| {
            format!(
                "{:.1} % of the film is lit by rays and dark in the blurred view, which ends before it: a larger \
                 'field_of_view_deg' of the scene shows it",
                100.0 * beyond_view_fraction
            )
        });
        Self {
            name: name.to_owned(),
            effort,
            edge_fraction: n_edge as f64 / is_edge.len() as f64,
            parts_of_pixels: 1,
            beyond_view_fraction,
            notes: one_pass.into_iter().chain(is_beyond).collect(),
            rows,
            backward: backward_seen,
            forward: forward_seen,
            is_edge,
        }
    }
}

impl MethodComparison {
    /// Returns the rows as a table: a line a band.
    pub fn table(&self) -> String {
        let mut text = "wavelength_nm,total,total_error,off_edges,edge_band,noise,gain,right_px,down_px,magnification,\
                        blur_px2,blur_error_px2\n"
            .to_owned();
        for row in &self.rows {
            let MethodRow { wavelength_nm, total, total_error, off_edges, edge_band, noise, fit } = row;
            let band = edge_band.map_or_else(String::new, |share| format!("{share:.5}"));
            text += &format!(
                "{wavelength_nm},{total:.5},{total_error:.5},{off_edges:.5},{band},{noise:.5},{:.5},{:.4},{:.4},{:.6},{:.4},{:.4}\n",
                fit.gain, fit.right_px, fit.down_px, fit.magnification, fit.blur_px2, fit.errors[4]
            );
        }
        text
    }
}

/// The share of pixels beyond the view from which on there is a note.
const LEAST_BEYOND_VIEW: f64 = 1e-3;

/// Returns the share of pixels without light in any band of a blurred view that have light in a picture by rays.
fn beyond_view_fraction(forward: &[Array2<f32>], backward: &[Array2<f32>]) -> f64 {
    let is_lit = |planes: &[Array2<f32>], at: (usize, usize)| planes.iter().any(|plane| plane[at] > 0.0);
    let Some(first) = forward.first() else { return 0.0 };
    let n_beyond = first.indexed_iter().filter(|(at, _)| !is_lit(forward, *at) && is_lit(backward, *at)).count();
    n_beyond as f64 / first.len() as f64
}

impl MethodRow {
    fn of(
        wavelength_nm: f64,
        forward: &Array2<f32>,
        (backward, error): (&Array2<f32>, &Array2<f32>),
        is_edge: &Array2<bool>,
    ) -> Self {
        let sum = |plane: &Array2<f32>| plane.iter().map(|&v| f64::from(v)).sum::<f64>();
        let (of_backward, n) = (sum(backward), backward.len() as f64);
        let mean = of_backward / n;
        // Sums of absolute differences and numbers of pixels, off edges and in their band.
        let mut zones = [[0.0; 2]; 2];
        Zip::from(forward).and(backward).and(is_edge).for_each(|&f, &b, &is_edge| {
            let zone = &mut zones[usize::from(is_edge)];
            zone[0] += (f64::from(f) - f64::from(b)).abs();
            zone[1] += 1.0;
        });
        let share = |[sum, n]: [f64; 2]| if n > 0.0 { sum / n / mean } else { 0.0 };
        let variance: f64 = error.iter().map(|&v| f64::from(v).powi(2)).sum();
        // Where noise isn't known all pixels weigh alike.
        let fit = match variance.is_nan() {
            false => fit(forward, (backward, error), is_edge),
            true => Fit { errors: [f64::NAN; 5], ..fit(forward, (backward, &Array2::zeros(error.dim())), is_edge) },
        };
        Self {
            wavelength_nm,
            total: sum(forward) / of_backward - 1.0,
            total_error: variance.sqrt() / of_backward,
            off_edges: share(zones[0]),
            edge_band: (zones[1][1] > 0.0).then(|| share(zones[1])),
            // The mean of a normal number's absolute value is √(2/π) of its deviation.
            noise: std::f64::consts::FRAC_2_PI.sqrt() * sum(error) / n / mean,
            fit,
        }
    }
}

/// Returns the pixels that the blur at a depth edge reaches: that of the more blurred side, and one more.
fn edge_band(z_m: &Array2<f32>, model: &LensImageModel, pitch_um: f64) -> Array2<bool> {
    let radius_px = |z_m: f32| {
        let dioptres = 1.0 / f64::from(z_m);
        1e3 * model.blur_radius_mm(DVec2::ZERO, dioptres, REFERENCE_WAVELENGTH_NM).abs() / pitch_um
    };
    let (rows, columns) = z_m.dim();
    let mut is_edge = Array2::from_elem((rows, columns), false);
    let mut mark = |(row, column): (usize, usize), reach_px: f64| {
        let reach = reach_px.ceil() as isize;
        for down in -reach..=reach {
            for right in -reach..=reach {
                let at = (row.checked_add_signed(down), column.checked_add_signed(right));
                let (Some(r), Some(c)) = at else { continue };
                if ((down * down + right * right) as f64) <= reach_px * reach_px && r < rows && c < columns {
                    is_edge[(r, c)] = true;
                }
            }
        }
    };
    for row in 0..rows {
        for column in 0..columns {
            let here = z_m[(row, column)];
            for next in [(row + 1, column), (row, column + 1)].into_iter().filter(|&(r, c)| r < rows && c < columns) {
                let there = z_m[next];
                let is_step =
                    (here - there).abs() > EDGE_STEP * here.min(there) || here.is_finite() != there.is_finite();
                if is_step {
                    let reach_px = 1.5 + radius_px(here).max(radius_px(there));
                    mark((row, column), reach_px);
                }
            }
        }
    }
    is_edge
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_told_apart_by_place() {
        let truth = Array2::from_shape_fn((20, 30), |(r, c)| 2.0 + ((r * 3 + c * 5) % 7) as f32 / 7.0);
        let error = Array2::from_elem((20, 30), 0.01_f32);
        let is_edge = Array2::from_shape_fn((20, 30), |(_, c)| (10..15).contains(&c));
        let mean = truth.iter().map(|&v| f64::from(v)).sum::<f64>() / 600.0;
        // Off by 1 % of the mean off the edges, and by 5 % in their band.
        let off = |is: bool| (if is { 0.05 * mean } else { 0.01 * mean }) as f32;
        let forward = Zip::from(&truth).and(&is_edge).map_collect(|&v, &is| v + off(is));
        let row = MethodRow::of(550.0, &forward, (&truth, &error), &is_edge);
        // Single precision.
        assert!((row.off_edges - 0.01).abs() < 1e-5 && (row.edge_band.unwrap() - 0.05).abs() < 1e-5, "{row:?}");
        assert!((row.total - (0.01 * 5.0 + 0.05) / 6.0).abs() < 1e-5, "{row:?}");
        // After one pass the noise is unknown, and not 0; the differences stand.
        let unknown = Array2::from_elem((20, 30), f32::NAN);
        let blind = MethodRow::of(550.0, &forward, (&truth, &unknown), &is_edge);
        assert!(blind.noise.is_nan() && blind.total_error.is_nan() && blind.fit.errors.iter().all(|e| e.is_nan()));
        assert!(blind.off_edges == row.off_edges && blind.fit.gain.is_finite(), "{blind:?}");
    }

    #[test]
    fn film_beyond_the_view_is_found() {
        let lit = Array2::from_elem((4, 10), 2.0_f32);
        // In one band light ends after seven columns, in the other after eight; where no ray brings any, none is missing.
        let ends = |end: usize| Array2::from_shape_fn((4, 10), |(_, c)| if c < end { 1.0 } else { 0.0 });
        assert_eq!(beyond_view_fraction(&[ends(7), ends(8)], &[lit.clone(), lit.clone()]), 0.2);
        assert_eq!(beyond_view_fraction(&[ends(7), ends(8)], &[ends(9), ends(7)]), 0.1);
        assert_eq!(beyond_view_fraction(std::slice::from_ref(&lit), std::slice::from_ref(&lit)), 0.0);
    }
}
