//! Where the film is, and how large it is.

use std::borrow::Cow;

use dioptric_forward::Film;
use dioptric_optics::{MirrorFilm, MonoLens, ObjectPoint, Vignetting, glam::DVec2, rays_towards};
use dioptric_scene::{Scene, View, flat_size_of};
use dioptric_spectrum::DepthMap;
use serde::{Deserialize, Serialize};

use super::{
    lens::ResolvedLens,
    spec::{FilmInputs, Raster},
};
use crate::{Crop, FocusSpec, Movements, PipelineError, Quality, SceneSource, SceneSpec, display::level_at};

/// The share of the scene's samples that may be nearer than the near object.
const NEAR_SHARE: f64 = 0.02;

/// What decides how large a film a scene fills: how many samples it has, where they lie and how far away they are.
pub(super) struct Outline<'a> {
    rows: usize,
    columns: usize,
    view: View,
    depth: Cow<'a, DepthMap>,
}

impl<'a> Outline<'a> {
    pub(super) fn of(scene: &'a Scene) -> Result<Self, PipelineError> {
        let (view, depth) = (scene.require_view()?, Cow::Borrowed(scene.require_depth()?));
        Ok(Self { rows: scene.rows(), columns: scene.columns(), view, depth })
    }

    /// Returns that of a flat scene, as large and as far away as its file and its choice tell without its samples; `None` where they do not.
    pub(super) fn of_flat(choice: &SceneSpec) -> Result<Option<Outline<'static>>, PipelineError> {
        let SceneSource::File(path) = &choice.source else { return Ok(None) };
        let (Some(fov_deg), Some(depth_m)) = (choice.field_of_view_deg, choice.depth_m) else { return Ok(None) };
        let Some((rows, columns)) = flat_size_of(path, &choice.reading) else { return Ok(None) };
        let view = View::from_horizontal_fov_deg(fov_deg, columns, rows)?;
        let depth = DepthMap::flat(1, 1, depth_m).map_err(dioptric_scene::SceneError::from)?;
        Ok(Some(Outline { rows, columns, view, depth: Cow::Owned(depth) }))
    }
}

/// The film behind the lens.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FilmPlace {
    /// Rows of samples of the irradiance.
    pub rows: usize,
    /// Columns of samples of the irradiance.
    pub columns: usize,
    /// Distance between samples, µm.
    pub pitch_um: f64,
    /// Pixels of the sensor that are one sample, each way: 1 but for a preview.
    pub binning: usize,
    /// Distance of the film behind the last vertex, mm.
    pub film_distance_mm: f64,
    /// Distance before the first vertex that is in focus, mm, where there is one.
    pub focus_distance_mm: Option<f64>,
    /// Distance of the film behind the exit pupil, mm, below 0 where the pupil lies behind the film; `None` of a telecentric
    /// lens.
    pub exit_pupil_distance_mm: Option<f64>,
    /// Where the axis of the exit pupil meets the film, mm to the right and down in the picture from the middle of what is simulated.
    pub exit_pupil_axis_mm: [f64; 2],
    /// The part of the film that is simulated, where it is not all of it.
    #[serde(default)]
    pub part: Option<FilmPart>,
}

/// Which part of a film is simulated, in samples of the irradiance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FilmPart {
    /// Its first column, from the left of the picture.
    pub first_column: usize,
    /// Its first row, from the top.
    pub first_row: usize,
    /// Columns of the whole film.
    pub of_columns: usize,
    /// Rows of the whole film.
    pub of_rows: usize,
}

impl FilmPart {
    /// Returns the part and the film that it is: of a film whose samples are so many pixels each way.
    fn of(crop: Crop, whole: Film, binning: usize) -> Result<(Self, Film), PipelineError> {
        crop.check((whole.rows * binning, whole.columns * binning))?;
        let part = Self {
            first_column: (crop.x / binning).min(whole.columns - 1),
            first_row: (crop.y / binning).min(whole.rows - 1),
            of_columns: whole.columns,
            of_rows: whole.rows,
        };
        let columns = (crop.columns / binning).clamp(1, whole.columns - part.first_column);
        let rows = (crop.rows / binning).clamp(1, whole.rows - part.first_row);
        let film = Film { rows, columns, center_mm: part.center_mm((rows, columns), whole.pitch_um), ..whole };
        Ok((part, film))
    }

    /// Returns the middle of the part, mm to the right of the middle of the film and above it.
    fn center_mm(self, (rows, columns): (usize, usize), pitch_um: f64) -> DVec2 {
        let right = self.first_column as f64 + 0.5 * (columns as f64 - self.of_columns as f64);
        let down = self.first_row as f64 + 0.5 * (rows as f64 - self.of_rows as f64);
        1e-3 * pitch_um * DVec2::new(right, -down)
    }
}

impl FilmPlace {
    /// The raster of samples.
    pub fn film(&self) -> Film {
        let center_mm = self.part.map(|part| part.center_mm((self.rows, self.columns), self.pitch_um));
        Film { center_mm: center_mm.unwrap_or_default(), ..Film::centered(self.rows, self.columns, self.pitch_um) }
    }

    /// Returns the whole film, of which this may be a part, as a mirror that reflects this share of its light.
    pub(super) fn mirror(&self, reflectance: f64) -> MirrorFilm {
        let (rows, columns) = self.part.map_or((self.rows, self.columns), |part| (part.of_rows, part.of_columns));
        Film::centered(rows, columns, self.pitch_um).as_mirror(self.film_distance_mm, reflectance)
    }

    /// Returns the f-number of the cone of light that a lens sends to a point of this film that is in focus.
    pub fn working_f_number(&self, lens: &ResolvedLens) -> f64 {
        lens.reference.working_f_number(self.focus_distance_mm.unwrap_or(f64::INFINITY))
    }

    /// The distance between the pixels of the sensor on this film, µm.
    pub fn pixel_pitch_um(&self) -> f64 {
        self.pitch_um / self.binning as f64
    }
}

/// Places the film and chooses its samples; `scene_binning` samples of the source are one of the scene, each way.
pub(super) fn place(
    inputs: &FilmInputs,
    lens: &ResolvedLens,
    scene: &Outline<'_>,
    scene_binning: usize,
) -> Result<FilmPlace, PipelineError> {
    let reference = &lens.reference;
    let film_distance_mm = place_film(inputs.focus, reference, scene)?;
    let (film, binning) = match inputs.raster {
        Raster::Pixels(full) => binned(&full, inputs.geometry.quality),
        // As coarse as the scene is by now.
        Raster::Scene => (size_film(reference, film_distance_mm, scene)?, scene_binning),
        Raster::Field(sensor) => {
            let covered = size_film(reference, film_distance_mm, scene)?;
            binned(&covered_pixels(&sensor, &covered), inputs.geometry.quality)
        }
    };
    let (part, film) = match inputs.crop {
        Some(crop) => {
            let (part, film) = FilmPart::of(crop, film, binning)?;
            (Some(part), film)
        }
        None => (None, film),
    };
    // A lens moved up and to the right moves its axis so on the film, which the picture shows turned by 180°. That a tilted
    // axis meets the film elsewhere is left out.
    let Movements { rise_mm, shift_mm, .. } = inputs.lens.movements;
    let exit_pupil_axis_mm = [-shift_mm - film.center_mm.x, rise_mm + film.center_mm.y];
    let exit_pupil_z_mm = reference.first_order().exit_pupil_z_mm;
    Ok(FilmPlace {
        rows: film.rows,
        columns: film.columns,
        pitch_um: film.pitch_um,
        binning,
        film_distance_mm,
        focus_distance_mm: reference.object_distance_mm_for(film_distance_mm).ok(),
        exit_pupil_distance_mm: exit_pupil_z_mm.is_finite().then_some(film_distance_mm - exit_pupil_z_mm),
        exit_pupil_axis_mm,
        part,
    })
}

/// Returns the film of a quality, and how many pixels of the full one are one of it, each way.
pub(super) fn binned(full: &Film, quality: Quality) -> (Film, usize) {
    let binning = quality.film_binning(full.columns);
    let fewer = |n: usize| (n / binning).max(1);
    (Film::centered(fewer(full.rows), fewer(full.columns), full.pitch_um * binning as f64), binning)
}

/// Returns as many pixels of a sensor, about its middle, as a film covers.
fn covered_pixels(sensor: &Film, covered: &Film) -> Film {
    let count = |samples: usize, most: usize| {
        let pixels = samples as f64 * covered.pitch_um / sensor.pitch_um;
        ((pixels + 1e-6).floor() as usize).clamp(1, most)
    };
    Film::centered(count(covered.rows, sensor.rows), count(covered.columns, sensor.columns), sensor.pitch_um)
}

fn place_film(focus: FocusSpec, lens: &MonoLens, scene: &Outline<'_>) -> Result<f64, PipelineError> {
    match focus {
        FocusSpec::FilmMm(film_distance_mm) => Ok(film_distance_mm),
        FocusSpec::DistanceMm(distance_mm) => Ok(lens.film_distance_mm_for(distance_mm)?),
        FocusSpec::NearObject => {
            let z_mm = 1e3 * level_at(&[scene.depth.z_m()], NEAR_SHARE);
            Ok(lens.film_distance_mm_for(z_mm - lens.projection_center_z_mm())?)
        }
    }
}

/// Returns the least and the most that the film is behind the last vertex, mm, of all scenes in which nothing is nearer than half a metre.
pub(super) fn film_distances_mm(focus: FocusSpec, lens: &MonoLens) -> Result<[f64; 2], PipelineError> {
    match focus {
        FocusSpec::FilmMm(film_distance_mm) => Ok([film_distance_mm; 2]),
        FocusSpec::DistanceMm(distance_mm) => Ok([lens.film_distance_mm_for(distance_mm)?; 2]),
        FocusSpec::NearObject => {
            let nearest_mm = 500.0 - lens.projection_center_z_mm();
            Ok([lens.film_distance_mm_for(f64::INFINITY)?, lens.film_distance_mm_for(nearest_mm)?])
        }
    }
}

/// Returns as many pixels as the scene has samples about the axis, of such a pitch that they see the scene's field.
fn size_film(lens: &MonoLens, film_distance_mm: f64, scene: &Outline<'_>) -> Result<Film, PipelineError> {
    let view = scene.view;
    let (rows, columns) = seen_evenly(&view, scene.rows, scene.columns)?;
    let (half_rows, half_columns) = (0.5 * rows as f64, 0.5 * columns as f64);
    let half = DVec2::new(half_columns, half_rows);
    let seen_um = match lens.is_rotational() {
        true => seen_pitch_um(lens, film_distance_mm, &view, half),
        false => seen_pitch_of_any_um(lens, film_distance_mm, &view, half),
    };
    // Blur mixes the rim of the scene with the dark beyond.
    let half_um = seen_um * half_rows.min(half_columns) - 1e3 * widest_blur_mm(lens, film_distance_mm, &scene.depth);
    let pitch_um = half_um / half_rows.min(half_columns);
    if !(pitch_um.is_finite() && pitch_um > 0.0) {
        let reason = format!("the film at {film_distance_mm} mm sees no upright picture of the scene");
        return Err(PipelineError::Unsuitable { what: "film: Scene", reason });
    }
    Ok(Film::centered(rows, columns, pitch_um))
}

/// Returns the pitch at which the scene, `half` a size across and up in samples, just fills the film, µm: by first order, but
/// no more than barrel distortion leaves of it, which draws the rim of the scene inwards.
fn seen_pitch_um(lens: &MonoLens, film_distance_mm: f64, view: &View, half: DVec2) -> f64 {
    let paraxial_um = 1e3 * height_per_tan_mm(lens, film_distance_mm) / view.focal_px;
    let seen = [DVec2::new(half.x, 0.0), DVec2::new(0.0, half.y), half]
        .map(|place| height_over_paraxial(lens, place.length() / view.focal_px, film_distance_mm))
        .into_iter()
        .fold(1.0, f64::min);
    seen * paraxial_um
}

/// Returns the same of a lens without an axis of symmetry, by the chief rays of the scene's border.
fn seen_pitch_of_any_um(lens: &MonoLens, film_distance_mm: f64, view: &View, half: DVec2) -> f64 {
    const ALONG: i32 = 4;
    let parts = (-ALONG..=ALONG).map(|i| f64::from(i) / f64::from(ALONG));
    let border = parts.flat_map(|part| {
        [DVec2::new(part, 1.0), DVec2::new(part, -1.0), DVec2::new(1.0, part), DVec2::new(-1.0, part)]
    });
    // The film ends where the first point of the border lies on it.
    let pitch_um = |part: DVec2| {
        let at_mm = chief_ray_mm(lens, part * half / view.focal_px, film_distance_mm)?;
        Some(1e3 * (at_mm / half).abs().max_element())
    };
    border.filter_map(pitch_um).fold(f64::INFINITY, f64::min)
}

/// Returns the rows and columns of the largest film about the axis that the scene fills.
fn seen_evenly(view: &View, rows: usize, columns: usize) -> Result<(usize, usize), PipelineError> {
    let even = |center: f64, n: usize| {
        let half = (center + 0.5).min(n as f64 - 0.5 - center);
        (2.0 * half + 1e-6).floor().max(0.0) as usize
    };
    let (even_rows, even_columns) = (even(view.center_y_px, rows), even(view.center_x_px, columns));
    if even_rows == 0 || even_columns == 0 {
        let reason = "the axis of the scene's camera data lies outside its picture".to_owned();
        return Err(PipelineError::Unsuitable { what: "film: Scene", reason });
    }
    Ok((even_rows, even_columns))
}

/// Returns how far off axis the chief ray of a unit tangent lands, mm, by first order.
fn height_per_tan_mm(lens: &MonoLens, film_distance_mm: f64) -> f64 {
    lens.film_scale_mm(film_distance_mm).abs()
}

/// Returns by how much the chief ray of a field lands farther out than in first order; 1 where it does not get through.
fn height_over_paraxial(lens: &MonoLens, tan: f64, film_distance_mm: f64) -> f64 {
    let landed = chief_ray_mm(lens, DVec2::new(tan, 0.0), film_distance_mm);
    landed.map_or(1.0, |at_mm| at_mm.x.abs() / (tan * height_per_tan_mm(lens, film_distance_mm)))
}

/// Returns where the ray of a far field through the middle of the paraxial entrance pupil lands, mm.
fn chief_ray_mm(lens: &MonoLens, field_tan: DVec2, film_distance_mm: f64) -> Option<DVec2> {
    let point = ObjectPoint::from_field(lens, field_tan, 0.0);
    let mut rays = rays_towards(&point, &[DVec2::ZERO], lens.projection_center_z_mm(), 0.0);
    lens.trace(&mut rays, Vignetting::Off);
    lens.to_film(&mut rays, film_distance_mm);
    rays.fate[0].is_in_flight().then(|| lens.film_point(rays.point_mm(0), film_distance_mm).mm)
}

/// Returns the radius of the largest blur of the scene on the axis, mm, by first order.
fn widest_blur_mm(lens: &MonoLens, film_distance_mm: f64, depth: &DepthMap) -> f64 {
    let first = lens.first_order();
    let (near_m, far_m) = depth.range_m();
    let focus_dioptres = match lens.object_distance_mm_for(film_distance_mm) {
        Ok(distance_mm) => 1e3 / (distance_mm + lens.projection_center_z_mm()),
        Err(_) => return 0.0,
    };
    let farthest = [1.0 / near_m, 1.0 / far_m].map(|d| (d - focus_dioptres).abs()).into_iter().fold(0.0, f64::max);
    let radius_mm = 0.5e-3 * first.entrance_pupil_diameter_mm * farthest * height_per_tan_mm(lens, film_distance_mm);
    if radius_mm.is_finite() { radius_mm } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::{assert_abs_diff_eq, assert_relative_eq};
    use dioptric_optics::{CoordinateBreak, Lens};

    #[test]
    fn a_unit_tangent_lands_a_focal_length_off_axis_at_infinity_focus() {
        let lens = Lens::built_in("dgauss-50mm").unwrap().at(550.0).unwrap();
        let first = lens.first_order();
        assert_relative_eq!(height_per_tan_mm(&lens, first.bfl_mm), first.efl_mm, max_relative = 1e-9);
        let hole = Lens::pinhole(0.2).unwrap().at(550.0).unwrap();
        assert_relative_eq!(height_per_tan_mm(&hole, 40.0), 40.0, max_relative = 1e-12);
    }

    #[test]
    fn a_film_of_a_lens_without_an_axis_ends_where_the_scene_does() {
        let lens = Lens::built_in("dgauss-50mm").unwrap();
        let (view, half) =
            (View { focal_px: 1000.0, center_x_px: 300.0, center_y_px: 200.0 }, DVec2::new(300.0, 200.0));
        let mono = lens.at(550.0).unwrap();
        let film_distance_mm = mono.first_order().bfl_mm;
        let straight_um = seen_pitch_um(&mono, film_distance_mm, &view, half);
        // A symmetric lens: both ways lead to the same, but for how distortion is sampled.
        assert_relative_eq!(
            seen_pitch_of_any_um(&mono, film_distance_mm, &view, half),
            straight_um,
            max_relative = 2e-3
        );
        let whole = (0, lens.interfaces().len() - 1);
        let aside = CoordinateBreak {
            surfaces: whole,
            pivot_mm: 0.0,
            decenter_mm: [1.0, 0.0, 0.0],
            tilt_deg: [0.0; 3],
            tilt_first: false,
        };
        let aside = lens.with_moves(vec![aside]).unwrap().at(550.0).unwrap();
        // A lens 1 mm to the side moves the picture of a far scene by 1 mm, which half the film's width of 15 mm loses: but
        // for the distortion between the corner, which ends the film without the shift, and the side, which ends it with.
        let shift_um = straight_um - seen_pitch_of_any_um(&aside, film_distance_mm, &view, half);
        assert_abs_diff_eq!(shift_um, 1e3 / half.x, epsilon = 2e-3 * straight_um);
    }

    #[test]
    fn a_scene_covers_pixels_of_the_sensor_and_no_more_than_it_has() {
        let sensor = Film::centered(1088, 1456, 3.45);
        let covered = covered_pixels(&sensor, &Film::centered(100, 150, 10.0));
        assert_eq!((covered.rows, covered.columns, covered.pitch_um), (289, 434, 3.45));
        let wide = covered_pixels(&sensor, &Film::centered(4000, 6000, 10.0));
        assert_eq!((wide.rows, wide.columns), (1088, 1456));
        assert_eq!(covered_pixels(&sensor, &Film::centered(1, 1, 0.1)).columns, 1);
    }

    #[test]
    fn a_film_of_the_scene_is_centered_on_its_axis() {
        let view = View { focal_px: 500.0, center_x_px: 155.0, center_y_px: 124.5 };
        assert_eq!(seen_evenly(&view, 250, 370).unwrap(), (250, 311));
        assert!(seen_evenly(&View { center_x_px: -3.0, ..view }, 250, 370).is_err());
    }
}
