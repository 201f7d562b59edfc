//! The part of the last vertex plane through which light reaches each place of the film: the vignetted exit pupil, as
//! bounds to sample rays in.
//!
//! For film places in a table, rays are traced back through a grid of points without rims, and the least clearance from
//! any rim gives the points that are lit. Bounds are a span of x for each of some rows of y. Each is one cell of the grid wider than
//! the points that were lit, and holds those of all wavelengths and of the neighboring film places about their middles,
//! so that nothing lit lies outside.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::{MonoLens, OpticsError, Placement, RayBatch, ReversedLens};

/// How far a ray must get to count as lit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PupilReach {
    /// Through the whole lens.
    WholeLens,
    /// To the stop and through it: where diffraction turns rays there, what lies beyond does not bound them.
    Stop,
}

/// Bounds of the exit pupil seen from each place of a film, on the tangent plane of the last surface.
///
/// They are conservative: light that reaches the film crosses the plane inside of them.
#[derive(Clone, Debug, PartialEq)]
pub struct ExitPupilBounds {
    plane: Placement,
    layout: FilmLayout,
    regions: Vec<Option<Region>>,
}

/// A point of the plane, drawn uniformly from within the bounds of a film place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PupilSample {
    /// The point in the lens frame, mm.
    pub point_mm: DVec3,
    /// The area of the bounds, mm²: one over the density of the point.
    pub area_mm2: f64,
}

/// For which film places there are bounds.
#[derive(Clone, Copy, Debug, PartialEq)]
enum FilmLayout {
    /// Rings of this width; bounds are those of a place on the x axis.
    Rings { width_mm: f64 },
    /// Equal cells over a film of this half size, so many along each side.
    Cells { half_mm: DVec2 },
}

/// Rings of a film of a rotationally symmetric lens.
const N_RINGS: usize = 32;
/// Cells along each side of the film of any other.
const N_CELLS: usize = 8;
/// Points along each side of the grids with which the pupil is sought.
const SEEK: usize = 32;
/// Points along each side of the last grid.
const GRID: usize = 128;
/// How often the box around the pupil is narrowed at most.
const N_NARROWINGS: usize = 6;
/// Rows of y of which bounds are made.
const N_ROWS: usize = 128;

impl ExitPupilBounds {
    /// Finds the bounds for a film of this half size (along its x and y, mm) so far behind the last vertex, for a lens at a
    /// few wavelengths: the shortest, the longest and one between them.
    ///
    /// # Errors
    /// When the film does not lie behind the last vertex, or there is no wavelength.
    pub fn find(
        lenses: &[ReversedLens],
        film_distance_mm: f64,
        film_half_mm: DVec2,
        reach: PupilReach,
    ) -> Result<Self, OpticsError> {
        let first = lenses.first().ok_or(OpticsError::Wavelength { wavelength_nm: f64::NAN })?.forward();
        if !(film_distance_mm > 0.0 && film_distance_mm.is_finite()) {
            return Err(OpticsError::FilmInLens { lens: first.name().to_owned(), film_distance_mm });
        }
        let plane = first.surface_placement(first.n_surfaces() - 1);
        let seek = |place_mm: DVec2| -> Vec<LitPoints> {
            let find = |lens| LitPoints::find(lens, &plane, place_mm, film_distance_mm, reach);
            lenses.iter().filter_map(find).collect()
        };
        if first.is_rotational() {
            let width_mm = film_half_mm.length() / N_RINGS as f64;
            let at: Vec<_> = (0..=N_RINGS).into_par_iter().map(|i| seek(DVec2::X * (i as f64 * width_mm))).collect();
            let regions = at.windows(2).map(|two| Region::around(&[&two[0], &two[1]])).collect();
            return Ok(Self { plane, layout: FilmLayout::Rings { width_mm }, regions });
        }
        let n = N_CELLS + 1;
        let corner = |i: usize| DVec2::new((i % n) as f64, (i / n) as f64) * (2.0 / N_CELLS as f64) - DVec2::ONE;
        let at: Vec<_> = (0..n * n).into_par_iter().map(|i| seek(corner(i) * film_half_mm)).collect();
        let cell = |i: usize| {
            let low = (i / N_CELLS) * n + i % N_CELLS;
            Region::around(&[low, low + 1, low + n, low + n + 1].map(|corner| &at[corner][..]))
        };
        let regions = (0..N_CELLS * N_CELLS).map(cell).collect();
        Ok(Self { plane, layout: FilmLayout::Cells { half_mm: film_half_mm }, regions })
    }

    /// The plane that rays are aimed at: its origin and the directions of its axes in the lens frame.
    pub fn plane(&self) -> Placement {
        self.plane
    }

    /// Returns the point of the bounds of a film place, mm, for two numbers from 0 to 1; `None` where no light reaches the
    /// film. Even numbers give even points, neighboring numbers mostly neighboring points.
    pub fn sample(&self, on_film_mm: DVec2, u: DVec2) -> Option<PupilSample> {
        let Seen { region, x_axis, middle_mm } = self.region_at(on_film_mm)?;
        let place_mm = middle_mm + region.at(u);
        let on_plane_mm = x_axis * place_mm.x + x_axis.perp() * place_mm.y;
        let point_mm = self.plane.lens_from_surface(on_plane_mm.extend(0.0));
        Some(PupilSample { point_mm, area_mm2: region.area_mm2() })
    }

    /// Whether a point of the plane, in the lens frame, lies inside the bounds of a film place.
    pub fn contains(&self, on_film_mm: DVec2, point_mm: DVec3) -> bool {
        let own_mm = self.plane.surface_from_lens(point_mm).truncate();
        self.region_at(on_film_mm).is_some_and(|Seen { region, x_axis, middle_mm }| {
            region.contains(DVec2::new(own_mm.dot(x_axis), own_mm.dot(x_axis.perp())) - middle_mm)
        })
    }

    /// Returns the bounds with every row this many times as long and as high, each region about its own middle.
    #[must_use]
    pub fn inflated(&self, factor: f64) -> Self {
        let regions = self.regions.iter().map(|region| region.as_ref().map(|region| region.inflated(factor))).collect();
        Self { regions, ..self.clone() }
    }

    /// Returns the region of a film place.
    fn region_at(&self, on_film_mm: DVec2) -> Option<Seen<'_>> {
        match self.layout {
            FilmLayout::Rings { width_mm } => {
                let r_mm = on_film_mm.length();
                let (ring, share) = cell(r_mm / width_mm, N_RINGS);
                let x_axis = if r_mm > 0.0 { on_film_mm / r_mm } else { DVec2::X };
                let region = self.regions[ring].as_ref()?;
                Some(Seen { region, x_axis, middle_mm: region.middles_mm[0].lerp(region.middles_mm[1], share) })
            }
            FilmLayout::Cells { half_mm } => {
                let place = (on_film_mm / half_mm + DVec2::ONE) * (0.5 * N_CELLS as f64);
                let ((column, x), (row, y)) = (cell(place.x, N_CELLS), cell(place.y, N_CELLS));
                let region = self.regions[row * N_CELLS + column].as_ref()?;
                let middle = |row: usize| region.middles_mm[2 * row].lerp(region.middles_mm[2 * row + 1], x);
                Some(Seen { region, x_axis: DVec2::X, middle_mm: middle(0).lerp(middle(1), y) })
            }
        }
    }
}

/// A region as a film place sees it: the direction of its x axis on the plane, and its middle along its own axes.
struct Seen<'a> {
    region: &'a Region,
    x_axis: DVec2,
    middle_mm: DVec2,
}

/// Returns the cell of so many that a place lies in, and where in it.
fn cell(place: f64, n: usize) -> (usize, f64) {
    let cell = (place.max(0.0) as usize).min(n - 1);
    (cell, (place - cell as f64).clamp(0.0, 1.0))
}

/// A grid of points of the plane that holds all lit ones, and which points of each row are lit.
#[derive(Clone, Debug)]
struct LitPoints {
    low_mm: DVec2,
    step_mm: DVec2,
    /// For each row the places in it of the first and the last lit point.
    rows: Vec<Option<[usize; 2]>>,
}

impl LitPoints {
    /// Finds the lit points for one place of the film, or that there are none.
    fn find(
        lens: &ReversedLens,
        plane: &Placement,
        on_film_mm: DVec2,
        film_distance_mm: f64,
        reach: PupilReach,
    ) -> Option<Self> {
        let film_point_mm = lens.forward().film_site(on_film_mm, film_distance_mm)?.point_mm;
        let (mut low_mm, mut high_mm) = rim_box_mm(lens.forward(), plane.surface_from_lens(film_point_mm))?;
        // Narrow the box to the points that are lit, or may have a lit one between them and the next.
        for _ in 0..N_NARROWINGS {
            let grid = Clearances::trace(lens, plane, film_point_mm, (low_mm, high_mm), SEEK, reach);
            let (first, last) = grid.extent(|i| grid.may_be_lit(i))?;
            let (old_mm, step_mm) = (high_mm - low_mm, grid.step_mm);
            let begin_mm = low_mm;
            low_mm = begin_mm + step_mm * (first.as_dvec2() - DVec2::ONE);
            high_mm = begin_mm + step_mm * (last.as_dvec2() + DVec2::ONE);
            if ((high_mm - low_mm) / old_mm).max_element() > 0.85 {
                break;
            }
        }
        let grid = Clearances::trace(lens, plane, film_point_mm, (low_mm, high_mm), GRID, reach);
        let row = |y: usize| {
            let is_lit = |&x: &usize| grid.mm[y * GRID + x] > 0.0;
            Some([(0..GRID).find(is_lit)?, (0..GRID).rev().find(is_lit)?])
        };
        let rows: Vec<_> = (0..GRID).map(row).collect();
        rows.iter().any(Option::is_some).then_some(Self { low_mm, step_mm: grid.step_mm, rows })
    }

    /// The middle of the box around what is lit.
    fn middle_mm(&self) -> DVec2 {
        let [low, high] =
            self.rows.iter().flatten().copied().reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]).unwrap_or([0, 0]);
        let [low_y_mm, high_y_mm] = self.y_range_mm();
        let x_mm = self.low_mm.x + 0.5 * self.step_mm.x * (low + high) as f64;
        DVec2::new(x_mm, 0.5 * (low_y_mm + high_y_mm))
    }

    /// The lowest and the highest lit row, each one wider.
    fn y_range_mm(&self) -> [f64; 2] {
        let lit: Vec<usize> = (0..self.rows.len()).filter(|&y| self.rows[y].is_some()).collect();
        let y_mm = |row: f64| self.low_mm.y + self.step_mm.y * row;
        [y_mm(lit[0] as f64 - 1.0), y_mm(lit[lit.len() - 1] as f64 + 1.0)]
    }

    /// The span of x that holds what is lit between two heights.
    fn x_span_mm(&self, [low_mm, high_mm]: [f64; 2]) -> Option<[f64; 2]> {
        let row = |y_mm: f64| (y_mm - self.low_mm.y) / self.step_mm.y;
        let first = (row(low_mm).floor() - 1.0).max(0.0) as usize;
        let last = ((row(high_mm).ceil() + 1.0).max(0.0) as usize).min(self.rows.len() - 1);
        let x_mm = |column: f64| self.low_mm.x + self.step_mm.x * column;
        let lit = self.rows.get(first..=last)?.iter().flatten();
        lit.map(|&[a, b]| [x_mm(a as f64 - 1.0), x_mm(b as f64 + 1.0)]).reduce(union)
    }
}

fn union(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// Returns the box of the plane through which lines from a film point (in the plane's frame) meet the last surface inside
/// its rim.
fn rim_box_mm(lens: &MonoLens, film_point_mm: DVec3) -> Option<(DVec2, DVec2)> {
    let radius_mm = lens.semi_aperture_mm(lens.n_surfaces() - 1);
    let (mut low_mm, mut high_mm) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for i in 0..=RIM_RADII {
        for direction in
            (0..RIM_DIRECTIONS).map(|j| DVec2::from_angle(std::f64::consts::TAU * j as f64 / RIM_DIRECTIONS as f64))
        {
            let place_mm = direction * (radius_mm * i as f64 / RIM_RADII as f64);
            let sag_mm = lens.last_sag_mm(place_mm);
            if !sag_mm.is_finite() {
                continue;
            }
            // A rim that reaches beyond the film is met by rays that leave it almost sideways.
            let share = film_point_mm.z / (film_point_mm.z - sag_mm.min(0.9 * film_point_mm.z));
            let crossing_mm = film_point_mm.truncate().lerp(place_mm, share);
            (low_mm, high_mm) = (low_mm.min(crossing_mm), high_mm.max(crossing_mm));
        }
    }
    let margin_mm = 0.05 * (high_mm - low_mm);
    (film_point_mm.z > 0.0 && margin_mm.is_finite()).then_some((low_mm - margin_mm, high_mm + margin_mm))
}

/// Places along the radius at which the last surface is looked at.
const RIM_RADII: usize = 8;
/// Places around it.
const RIM_DIRECTIONS: usize = 16;

/// The clearances of rays from one film point through a grid of points of the plane.
struct Clearances {
    n: usize,
    step_mm: DVec2,
    mm: Vec<f64>,
}

impl Clearances {
    fn trace(
        lens: &ReversedLens,
        plane: &Placement,
        film_point_mm: DVec3,
        (low_mm, high_mm): (DVec2, DVec2),
        n: usize,
        reach: PupilReach,
    ) -> Self {
        let step_mm = (high_mm - low_mm) / (n - 1) as f64;
        let mut rays = RayBatch::with_capacity(n * n);
        for i in 0..n * n {
            let place_mm = low_mm + step_mm * DVec2::new((i % n) as f64, (i / n) as f64);
            let point_mm = plane.lens_from_surface(place_mm.extend(0.0));
            rays.push(point_mm, (point_mm - film_point_mm).normalize(), 0.0);
        }
        let mm = lens.clearances_mm(&mut rays, reach == PupilReach::Stop);
        Self { n, step_mm, mm }
    }

    /// Whether a point is lit, or the clearance changes so much from it to its neighbors that a place between may be.
    fn may_be_lit(&self, i: usize) -> bool {
        let (here, n) = (self.mm[i], self.n);
        if here > 0.0 || here == f64::NEG_INFINITY {
            return here > 0.0;
        }
        let (x, y) = (i % n, i / n);
        let columns = x.saturating_sub(1)..=(x + 1).min(n - 1);
        let rows = y.saturating_sub(1)..=(y + 1).min(n - 1);
        let around = rows.flat_map(|y| columns.clone().map(move |x| self.mm[y * n + x]));
        let change = around.map(|there| there - here).filter(|v| v.is_finite()).map(f64::abs).fold(0.0, f64::max);
        here + 2.0 * change > 0.0
    }

    /// Returns the least and the greatest column and row of the points that are such.
    fn extent(&self, is_such: impl Fn(usize) -> bool) -> Option<(glam::UVec2, glam::UVec2)> {
        let places = (0..self.mm.len()).filter(|&i| is_such(i));
        let place = |i: usize| glam::UVec2::new((i % self.n) as u32, (i / self.n) as u32);
        places.map(|i| (place(i), place(i))).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }
}

/// Rows of y with a span of x each.
#[derive(Clone, Debug, PartialEq)]
struct Region {
    low_y_mm: f64,
    row_mm: f64,
    spans_mm: Vec<[f64; 2]>,
    /// The area up to the end of each row, mm².
    ends_mm2: Vec<f64>,
    /// The middle of the region at the ends of the ring, or the corners of the cell, of the film; rows and spans count
    /// from it.
    middles_mm: Vec<DVec2>,
}

impl Region {
    /// Returns the region that holds what is lit for each of these film places, at several wavelengths each.
    fn around(places: &[&[LitPoints]]) -> Option<Self> {
        let mean =
            |middles: &[DVec2]| (!middles.is_empty()).then(|| middles.iter().sum::<DVec2>() / middles.len() as f64);
        let middle = |lit: &&[LitPoints]| mean(&lit.iter().map(LitPoints::middle_mm).collect::<Vec<_>>());
        let lit_middles: Vec<DVec2> = places.iter().filter_map(middle).collect();
        let of_all = mean(&lit_middles)?;
        let middles_mm: Vec<DVec2> = places.iter().map(|lit| middle(lit).unwrap_or(of_all)).collect();
        let centered = |(lit, &middle): (&&[LitPoints], &DVec2)| {
            lit.iter().map(|lit| LitPoints { low_mm: lit.low_mm - middle, ..lit.clone() }).collect::<Vec<_>>()
        };
        let lit: Vec<LitPoints> = places.iter().zip(&middles_mm).flat_map(centered).collect();
        let [low_y_mm, high_y_mm] = lit.iter().map(LitPoints::y_range_mm).reduce(union)?;
        let row_mm = (high_y_mm - low_y_mm) / N_ROWS as f64;
        let span = |row: usize| {
            let y_mm = low_y_mm + row_mm * row as f64;
            let spans = lit.iter().filter_map(|lit| lit.x_span_mm([y_mm, y_mm + row_mm]));
            spans.reduce(union).unwrap_or([0.0; 2])
        };
        Some(Self::new(low_y_mm, row_mm, (0..N_ROWS).map(span).collect(), middles_mm))
    }

    fn new(low_y_mm: f64, row_mm: f64, spans_mm: Vec<[f64; 2]>, middles_mm: Vec<DVec2>) -> Self {
        let mut end_mm2 = 0.0;
        let add = |[low, high]: &[f64; 2]| {
            end_mm2 += (high - low) * row_mm;
            end_mm2
        };
        let ends_mm2 = spans_mm.iter().map(add).collect();
        Self { low_y_mm, row_mm, spans_mm, ends_mm2, middles_mm }
    }

    fn area_mm2(&self) -> f64 {
        self.ends_mm2[self.ends_mm2.len() - 1]
    }

    /// Returns the point with the share `u.y` of the area in rows below it, and the share `u.x` of its row before it.
    fn at(&self, u: DVec2) -> DVec2 {
        let area_mm2 = u.y * self.area_mm2();
        let row = self.ends_mm2.partition_point(|&end| end <= area_mm2).min(self.ends_mm2.len() - 1);
        let [low_mm, high_mm] = self.spans_mm[row];
        let begin_mm2 = if row == 0 { 0.0 } else { self.ends_mm2[row - 1] };
        let height_mm = (area_mm2 - begin_mm2) / (high_mm - low_mm).max(f64::MIN_POSITIVE);
        let y_mm = self.low_y_mm + self.row_mm * row as f64 + height_mm.clamp(0.0, self.row_mm);
        DVec2::new(low_mm + (high_mm - low_mm) * u.x, y_mm)
    }

    fn contains(&self, place_mm: DVec2) -> bool {
        let row = (place_mm.y - self.low_y_mm) / self.row_mm;
        let span = if row >= 0.0 { self.spans_mm.get(row as usize) } else { None };
        span.is_some_and(|&[low, high]| (low..=high).contains(&place_mm.x))
    }

    fn inflated(&self, factor: f64) -> Self {
        let middle_y_mm = self.low_y_mm + 0.5 * self.row_mm * self.spans_mm.len() as f64;
        let [low, high] = self.spans_mm.iter().copied().reduce(union).unwrap_or([0.0; 2]);
        let middle_x_mm = 0.5 * (low + high);
        let spans_mm = self.spans_mm.iter().map(|span| span.map(|x| middle_x_mm + factor * (x - middle_x_mm)));
        let low_y_mm = middle_y_mm + factor * (self.low_y_mm - middle_y_mm);
        Self::new(low_y_mm, factor * self.row_mm, spans_mm.collect(), self.middles_mm.clone())
    }
}
