//! Views from what lies behind an array of small lenses or holes: from each element the sample that sees one part of the pupil.

use std::f64::consts::FRAC_PI_3;

use dioptric_backward::{FilmLine, MicroArray, MicroLayout};
use dioptric_optics::{MonoLens, glam::DVec2};
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
    pub(crate) array: MicroArray,
    pub(crate) lens: &'a MonoLens,
    pub(crate) film: &'a ArrayFilm,
    /// Views along each side; as many as there are pixels across the image of the pupil if left out.
    pub(crate) n_views: Option<usize>,
}

/// What lies along lines from the film through the array: depth from the center of the entrance pupil, m.
pub(crate) type DepthAlong<'a> = dyn Fn(&[FilmLine]) -> Result<Vec<f32>, PipelineError> + 'a;

impl Decoding<'_> {
    /// Returns the light field of a picture on the film, a plane a channel; with what `depth_along` tells of each sample.
    ///
    /// # Errors
    /// When the lens has no exit pupil before the array, the picture is not of the film's size, or the film holds no image
    /// of the pupil or resolves it with less than a pixel.
    pub(crate) fn light_field(
        &self,
        planes: &[Array2<f32>],
        depth_along: Option<&DepthAlong<'_>>,
    ) -> Result<LightField, PipelineError> {
        let (array, film) = (&self.array, self.film);
        if planes.iter().any(|plane| plane.dim() != (film.rows, film.columns)) {
            return Err(wrong(format!("the picture is not of the film's {} × {} pixels", film.columns, film.rows)));
        }
        let Samples { share, radius_mm, n_views, raster } = self.samples()?;
        let pitch_mm = film.pitch_mm;
        let view = |i: usize| {
            let middle = 0.5 * (n_views as f64 - 1.0);
            let from_middle_mm = pitch_mm * DVec2::new((i % n_views) as f64 - middle, middle - (i / n_views) as f64);
            // A sample between pixels takes from what lies up to a pixel and a half diagonal away.
            let is_whole = from_middle_mm.length() + pitch_mm * (0.5 + 0.5_f64.sqrt()) <= radius_mm;
            let planes = planes.iter().map(|plane| raster.view(plane, from_middle_mm)).collect();
            let depth_m = depth_along.map(|along| along(&raster.lines(from_middle_mm))).transpose()?;
            let of_shape =
                |list| Array2::from_shape_vec((raster.rows, raster.columns), list).expect("a depth a sample");
            Ok(View { planes, weight: if is_whole { 1.0 } else { 0.0 }, depth_m: depth_m.map(of_shape) })
        };
        let views = (0..n_views * n_views).map(view).collect::<Result<Vec<View>, PipelineError>>()?;
        let step_mm = pitch_mm / share;
        // Light crosses an element a little towards its pixel, which moves all views apart.
        let still_px = array.crossing_share() * pitch_mm / raster.step_mm;
        let steps_mm = (step_mm, raster.step_mm);
        let geometry = ViewGeometry::pupil(self.lens, film.array_distance_mm, steps_mm, still_px);
        LightField::new((n_views, n_views), views, geometry)
    }

    /// Checks what can be known before there is a picture.
    ///
    /// # Errors
    /// As [`light_field`](Self::light_field), but for the picture's size.
    pub(crate) fn check(&self) -> Result<(), PipelineError> {
        self.samples().map(|_| ())
    }

    fn samples(&self) -> Result<Samples<'_>, PipelineError> {
        let (share, pitch_mm) = (self.pupil_share()?, self.film.pitch_mm);
        let radius_mm = 0.5 * self.lens.first_order().exit_pupil_diameter_mm * share;
        let n_views = self.n_views.unwrap_or((2.0 * radius_mm / pitch_mm).floor() as usize);
        if n_views == 0 {
            let reason = format!(
                "the image of the pupil behind an element is {} µm wide, expected at least a pixel of {} µm",
                2e3 * radius_mm,
                1e3 * pitch_mm
            );
            return Err(wrong(reason));
        }
        if self.array.pitch_mm < pitch_mm {
            let (pitch_um, pixel_um) = (1e3 * self.array.pitch_mm, 1e3 * pitch_mm);
            return Err(wrong(format!("elements lie {pitch_um} µm apart, expected at least a pixel of {pixel_um} µm")));
        }
        let raster = Raster::new(&self.array, self.film, share, radius_mm)
            .ok_or_else(|| wrong("the film holds the image of the pupil of no element".to_owned()))?;
        Ok(Samples { share, radius_mm, n_views, raster })
    }

    /// Returns the gap over the distance of the exit pupil from the array.
    pub(crate) fn pupil_share(&self) -> Result<f64, PipelineError> {
        let pupil_distance_mm = self.film.array_distance_mm - self.lens.first_order().exit_pupil_z_mm;
        if pupil_distance_mm > 0.0 && pupil_distance_mm.is_finite() {
            return Ok(self.array.gap_mm / pupil_distance_mm);
        }
        Err(wrong(format!("the array lies {pupil_distance_mm} mm behind the exit pupil, expected a length above 0")))
    }
}

/// Where a picture is sampled.
struct Samples<'a> {
    /// The gap over the distance of the exit pupil.
    share: f64,
    /// Of the image of the pupil behind an element, mm.
    radius_mm: f64,
    /// Views along each side.
    n_views: usize,
    raster: Raster<'a>,
}

fn wrong(reason: String) -> PipelineError {
    PipelineError::Unsuitable { what: "light_field", reason }
}

impl ArrayFilm {
    /// Returns a place of the film as the row and the column of a pixel, between pixels too.
    fn pixel_at(&self, place_mm: DVec2) -> (f64, f64) {
        let of_middle = |n: usize| 0.5 * (n as f64 - 1.0);
        (of_middle(self.rows) - place_mm.y / self.pitch_mm, place_mm.x / self.pitch_mm + of_middle(self.columns))
    }

    /// Returns the place of the middle of a pixel, mm.
    pub(crate) fn place_mm(&self, row: usize, column: usize) -> DVec2 {
        let of_middle = |n: usize| 0.5 * (n as f64 - 1.0);
        self.pitch_mm * DVec2::new(column as f64 - of_middle(self.columns), of_middle(self.rows) - row as f64)
    }
}

/// The samples of a view: upright, as far apart as the rows of elements, one on the element at the offset. What is between
/// elements is interpolated between those about it.
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

    /// Returns the place of a sample on the array, mm from the element at the offset.
    fn sample_place_mm(&self, row: usize, column: usize) -> DVec2 {
        self.step_mm * DVec2::new((self.left + column as i64) as f64, (self.top - row as i64) as f64)
    }

    /// Returns the view through the part of the pupil whose image lies this far to the right of its middle and above it, mm.
    fn view(&self, plane: &Array2<f32>, from_middle_mm: DVec2) -> Array2<f32> {
        let offset_mm = DVec2::from(self.array.offset_mm);
        Array2::from_shape_fn((self.rows, self.columns), |(row, column)| {
            let about = elements_about(self.array, self.sample_place_mm(row, column));
            let sample = |(from_offset_mm, weight): &(DVec2, f64)| {
                let (row, column) = self.film.pixel_at(self.behind(offset_mm + *from_offset_mm) + from_middle_mm);
                if *weight > 0.0 { *weight as f32 * bilinear(plane, row, column) } else { 0.0 }
            };
            about.iter().map(sample).sum()
        })
    }

    /// Returns for each sample of a view the line from the film through the array that is the middle of its light.
    fn lines(&self, from_middle_mm: DVec2) -> Vec<FilmLine> {
        let places = (0..self.rows).flat_map(|row| (0..self.columns).map(move |column| (row, column)));
        places
            .map(|(row, column)| {
                let array_mm = DVec2::from(self.array.offset_mm) + self.sample_place_mm(row, column);
                FilmLine { film_mm: self.behind(array_mm) + from_middle_mm, array_mm }
            })
            .collect()
    }

    /// Returns the middle of the image of the pupil behind an element, mm on the film.
    fn behind(&self, center_mm: DVec2) -> DVec2 {
        center_mm + (center_mm - DVec2::from(self.film.exit_pupil_axis_mm)) * self.share
    }
}

/// Returns the elements about a place of an array with what each counts there: in a square of four by the area across, in a triangle
/// of three by its barycentric coordinates. Places are mm to the right of the element at the offset and above it.
fn elements_about(array: &MicroArray, place_mm: DVec2) -> [(DVec2, f64); 4] {
    let along = DVec2::from_angle(array.turned_deg.to_radians());
    let across = match array.layout {
        MicroLayout::Square => along.perp(),
        MicroLayout::Hexagonal => DVec2::from_angle(array.turned_deg.to_radians() + FRAC_PI_3),
    };
    let (along, across) = (array.pitch_mm * along, array.pitch_mm * across);
    let area = along.perp_dot(across);
    // A place on an element stays there whatever rounding does.
    let on_lattice = DVec2::new(place_mm.perp_dot(across), along.perp_dot(place_mm)) / area;
    let on_lattice = DVec2::select(
        (on_lattice - on_lattice.round()).abs().cmplt(DVec2::splat(1e-9)),
        on_lattice.round(),
        on_lattice,
    );
    let cell = on_lattice.floor();
    let DVec2 { x, y } = on_lattice - cell;
    let weights = match array.layout {
        MicroLayout::Square => [(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y],
        MicroLayout::Hexagonal if x + y < 1.0 => [1.0 - x - y, x, y, 0.0],
        MicroLayout::Hexagonal => [0.0, 1.0 - y, 1.0 - x, x + y - 1.0],
    };
    let corners = [DVec2::ZERO, DVec2::X, DVec2::Y, DVec2::ONE].map(|corner| cell + corner);
    std::array::from_fn(|i| (corners[i].x * along + corners[i].y * across, weights[i]))
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

#[cfg(test)]
mod tests {
    use dioptric_backward::MicroElements;

    use super::*;

    /// What is linear over the array is interpolated exactly, whatever the lattice and its turn.
    #[test]
    fn elements_about_a_place_have_it_for_their_mean() {
        for (layout, turned_deg) in [
            (MicroLayout::Square, 0.0),
            (MicroLayout::Square, 8.0),
            (MicroLayout::Hexagonal, 0.0),
            (MicroLayout::Hexagonal, -31.0),
        ] {
            let elements = MicroElements::Holes { diameter_mm: 0.02 };
            let offset_mm = (0.0, 0.0);
            let array = MicroArray { elements, pitch_mm: 0.1, gap_mm: 0.4, layout, offset_mm, turned_deg };
            for place_mm in [DVec2::ZERO, DVec2::new(0.037, -0.211), DVec2::new(-1.04, 0.33)] {
                let about = elements_about(&array, place_mm);
                let total: f64 = about.iter().map(|(_, weight)| weight).sum();
                let mean_mm: DVec2 = about.iter().map(|(center_mm, weight)| *weight * *center_mm).sum();
                assert!((total - 1.0).abs() < 1e-12 && mean_mm.distance(place_mm) < 1e-12, "{layout:?} {mean_mm}");
                let near = |(center_mm, weight): &(DVec2, f64)| *weight < 1e-12 || center_mm.distance(place_mm) < 0.142;
                assert!(about.iter().all(near) && about.iter().all(|(_, weight)| *weight > -1e-12));
            }
        }
    }
}
