//! Views from what lies behind an array of small lenses or holes: from each element the sample that sees one part of the pupil.

use dioptric_backward::{MicroArray, MicroLayout};
use dioptric_optics::MonoLens;
use ndarray::Array2;

use super::{LightField, View, ViewGeometry};
use crate::PipelineError;

/// A film behind an array. Places are mm to the right of the axis and above it, as in the picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ArrayFilm {
    /// Rows of pixels.
    pub(crate) rows: usize,
    /// Columns of pixels.
    pub(crate) columns: usize,
    /// Distance between pixels, mm.
    pub(crate) pitch_mm: f64,
    /// From the last vertex to the array, mm.
    pub(crate) array_distance_mm: f64,
    /// Where the axis of the exit pupil meets the film, mm.
    pub(crate) exit_pupil_axis_mm: [f64; 2],
}

/// How a picture behind an array is taken apart.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Decoding<'a> {
    pub(crate) array: &'a MicroArray,
    pub(crate) lens: &'a MonoLens,
    pub(crate) film: &'a ArrayFilm,
    /// Views along each side; as many as there are pixels across the image of the pupil if left out.
    pub(crate) n_views: Option<usize>,
}

impl Decoding<'_> {
    /// Returns the light field of a picture on the film, a plane a channel.
    ///
    /// # Errors
    /// When the lens has no exit pupil before the array, the picture is not of the film's size, or the film holds no image
    /// of the pupil or resolves it with less than a pixel.
    pub(crate) fn light_field(&self, planes: &[Array2<f32>]) -> Result<LightField, PipelineError> {
        let wrong = |reason: String| PipelineError::Unsuitable { what: "light_field", reason };
        let (array, film, first) = (self.array, self.film, self.lens.first_order());
        if planes.iter().any(|plane| plane.dim() != (film.rows, film.columns)) {
            return Err(wrong(format!("the picture is not of the film's {} × {} pixels", film.columns, film.rows)));
        }
        let pupil_distance_mm = film.array_distance_mm - first.exit_pupil_z_mm;
        if !(pupil_distance_mm > 0.0 && pupil_distance_mm.is_finite()) {
            let reason =
                format!("the array lies {pupil_distance_mm} mm behind the exit pupil, expected a length above 0");
            return Err(wrong(reason));
        }
        let pitch_mm = film.pitch_mm;
        let share = array.gap_mm / pupil_distance_mm;
        let radius_mm = 0.5 * first.exit_pupil_diameter_mm * share;
        let n_views = self.n_views.unwrap_or((2.0 * radius_mm / pitch_mm).floor() as usize);
        if n_views == 0 {
            let reason = format!(
                "the image of the pupil behind an element is {} µm wide, expected at least a pixel of {} µm",
                2e3 * radius_mm,
                1e3 * pitch_mm
            );
            return Err(wrong(reason));
        }
        let raster = Raster::new(array, film, share, radius_mm)
            .ok_or_else(|| wrong("the film holds the image of the pupil of no element".to_owned()))?;
        let views = (0..n_views * n_views)
            .map(|i| {
                let middle = 0.5 * (n_views as f64 - 1.0);
                let right_mm = ((i % n_views) as f64 - middle) * pitch_mm;
                let up_mm = (middle - (i / n_views) as f64) * pitch_mm;
                // A sample between pixels takes from what lies up to a pixel and a half diagonal away.
                let is_whole = right_mm.hypot(up_mm) + pitch_mm * (0.5 + 0.5_f64.sqrt()) <= radius_mm;
                let planes = planes.iter().map(|plane| raster.view(plane, [right_mm, up_mm])).collect();
                View { planes, weight: if is_whole { 1.0 } else { 0.0 } }
            })
            .collect();
        let step_mm = pitch_mm / share;
        // Light crosses an element a little towards its pixel, which moves all views apart.
        let still_px = array.crossing_share() * pitch_mm / raster.step_mm;
        let steps_mm = (step_mm, raster.step_mm);
        let geometry = ViewGeometry::pupil(self.lens, film.array_distance_mm, steps_mm, still_px);
        LightField::new((n_views, n_views), views, geometry)
    }
}

/// The samples of a view: one an element, or between the elements of a row where rows are nearer than elements.
struct Raster<'a> {
    array: &'a MicroArray,
    film: &'a ArrayFilm,
    /// Gap over distance of the pupil.
    share: f64,
    /// Between samples, along rows and columns, mm on the array.
    step_mm: f64,
    /// The sample on the left and the one at the top, counted from the element at the offset; and how many of each.
    left: i64,
    top: i64,
    columns: usize,
    rows: usize,
}

impl<'a> Raster<'a> {
    /// Returns the samples whose images of the pupil, of this radius, lie on the film.
    fn new(array: &'a MicroArray, film: &'a ArrayFilm, share: f64, radius_mm: f64) -> Option<Self> {
        let step_mm = array.pitch_mm * array.layout.row_step();
        let half_mm = |n: usize| 0.5 * film.pitch_mm * n as f64;
        let range = |offset_mm: f64, axis_mm: f64, half_mm: f64| {
            // The image of the pupil behind the element at c lies at c + (c − axis) g/Z.
            let at_film = |film_mm: f64| (film_mm + axis_mm * share) / (1.0 + share);
            let (low, high) = (at_film(radius_mm - half_mm), at_film(half_mm - radius_mm));
            (((low - offset_mm) / step_mm).ceil() as i64, ((high - offset_mm) / step_mm).floor() as i64)
        };
        let [axis_x_mm, axis_y_mm] = film.exit_pupil_axis_mm;
        let (left, right) = range(array.offset_mm.0, axis_x_mm, half_mm(film.columns));
        let (bottom, top) = range(array.offset_mm.1, axis_y_mm, half_mm(film.rows));
        let (columns, rows) = (usize::try_from(right - left + 1).ok()?, usize::try_from(top - bottom + 1).ok()?);
        (columns > 0 && rows > 0).then_some(Self { array, film, share, step_mm, left, top, columns, rows })
    }

    /// Returns the view through the part of the pupil whose image lies this far to the right of its middle and above it, mm.
    fn view(&self, plane: &Array2<f32>, from_middle_mm: [f64; 2]) -> Array2<f32> {
        Array2::from_shape_fn((self.rows, self.columns), |(row, column)| {
            let up = self.top - row as i64;
            let along = self.left + column as i64;
            let at_element = |index: i64, shift: f64| {
                let x_mm = self.array.offset_mm.0 + self.array.pitch_mm * (index as f64 + shift);
                let y_mm = self.array.offset_mm.1 + self.step_mm * up as f64;
                self.behind(plane, [x_mm, y_mm], from_middle_mm)
            };
            match self.array.layout {
                MicroLayout::Square => at_element(along, 0.0),
                MicroLayout::Hexagonal => {
                    let shift = 0.5 * up.rem_euclid(2) as f64;
                    let place = along as f64 * self.array.layout.row_step() - shift;
                    let (before, share) = (place.floor(), (place - place.floor()) as f32);
                    let [left, right] = [0, 1].map(|k| at_element(before as i64 + k, shift));
                    left + share * (right - left)
                }
            }
        })
    }

    /// Returns the sample behind the element at a place, this far from the middle of its image of the pupil.
    fn behind(&self, plane: &Array2<f32>, center_mm: [f64; 2], from_middle_mm: [f64; 2]) -> f32 {
        let on_film =
            |i: usize| center_mm[i] + (center_mm[i] - self.film.exit_pupil_axis_mm[i]) * self.share + from_middle_mm[i];
        let pitch_mm = self.film.pitch_mm;
        let column = on_film(0) / pitch_mm + 0.5 * (self.film.columns as f64 - 1.0);
        let row = 0.5 * (self.film.rows as f64 - 1.0) - on_film(1) / pitch_mm;
        bilinear(plane, row, column)
    }
}

/// Returns the value between the samples of a picture; beyond its border that at the border.
fn bilinear(plane: &Array2<f32>, row: f64, column: f64) -> f32 {
    let (rows, columns) = plane.dim();
    let cell = |place: f64, n: usize| {
        let place = place.clamp(0.0, (n - 1) as f64);
        let low = (place as usize).min(n.saturating_sub(2));
        (low, (low + 1).min(n - 1), (place - low as f64) as f32)
    };
    let ((top, bottom, down), (left, right, across)) = (cell(row, rows), cell(column, columns));
    let along = |row: usize| plane[(row, left)] + across * (plane[(row, right)] - plane[(row, left)]);
    along(top) + down * (along(bottom) - along(top))
}
