//! The film surveyed: where its points look, how much light they get and how their blurs grow, at one wavelength.

use std::{f64::consts::TAU, sync::Arc};

use glam::DVec2;
use rayon::prelude::*;

use crate::{
    FilmMap,
    bladed::BladedSurvey,
    bundle::{Bundle, Frame, Moments},
    film_map::{PlaneMap, RadialMap, ShareMap},
    lattice::{AREA_OVER_RADIUS, DIM, Lattice, MOST_AREA_HALVINGS, MOST_OFF_SR, N_AZIMUTHS},
    mesh::Mesh,
    pupil::Outline,
    pupil_division::PupilDivision,
    station::{Station, SurveyedLens},
    symmetry::Symmetry,
};

/// How often steps along a radius are halved at most.
const MOST_HALVINGS: usize = 9;
/// How far what lies between samples may be off in direction, by the place on the film, over a step.
const MOST_OFF: f64 = 1e-5;
/// The place on the radius, over a step, that stands for the axis.
const NEXT_TO_AXIS: f64 = 1e-3;
/// Over how much of the lit radius the slope is taken with which directions go on beyond it.
const RIM: f64 = 0.1;

/// The film of the centered lens up to some distance from its axis.
#[derive(Debug)]
pub(crate) struct Survey {
    pub(crate) lattice: Lattice,
    /// Of the lens where it stands.
    pub(crate) map: Arc<FilmMap>,
    /// Along +x by distance from the axis, or over a grid of so many columns, rows from the bottom up.
    stations: Vec<Station>,
    n_columns: Option<usize>,
    /// Of a lens that is round but for its blades; the other stations are then of the round one.
    bladed: Option<BladedSurvey>,
    /// Where the axis meets the film, mm from its middle.
    axis_mm: DVec2,
    /// Of each station, or of each point of the first grid; of dark ones those of a lit one near by.
    moments: Vec<Moments>,
}

impl Survey {
    /// Surveys the film of the centered lens; stations along a radius that another survey has are not traced again.
    pub(crate) fn new(lens: &SurveyedLens<'_>, lattice: Lattice, known: Option<&Self>) -> Self {
        let known = known.map_or(&[][..], |survey| &survey.stations);
        let (map, stations, n_columns, bladed) = match (lens.symmetry, lens.round_job) {
            (Symmetry::Axis, _) => {
                let radius = Radius::survey(lens, lattice, known);
                (FilmMap::from(radius.map(lattice)), radius.stations, None, None)
            }
            (Symmetry::Blades(n_blades), Some(job)) => {
                let radius = Radius::survey(&SurveyedLens { job, ..*lens }, lattice, known);
                let round_sr = |radius_mm: f64| radius.irradiance_sr.at(radius_mm).max(0.0);
                let bladed = BladedSurvey::new(lens, n_blades, lattice.coarser(), &round_sr);
                (FilmMap::from(radius.map(lattice)), radius.stations, None, Some(bladed))
            }
            _ => {
                let (map, stations, n) = surveyed_grid(lens, lattice.of_grid());
                (FilmMap::from(map), stations, Some(n), None)
            }
        };
        // Of a grid the first one's points say it well enough.
        let stride = n_columns.map_or(1, |n| (n - 1) / (2 * lattice.of_grid().n_steps));
        let is_told =
            |i: usize| n_columns.is_none_or(|n| (i / n).is_multiple_of(stride) && (i % n).is_multiple_of(stride));
        let told: Vec<&Station> =
            stations.iter().enumerate().filter(|(i, _)| is_told(*i)).map(|(_, station)| station).collect();
        let own_moments = |station: &&Station| {
            station.bundle.as_ref().map(|bundle| bundle.moments(&map, &Frame::OWN, lens.focus_dioptres))
        };
        let known: Vec<Option<Moments>> = told.par_iter().map(own_moments).collect();
        let moments = nearest_known(&told, &known);
        // Move it to where the lens stands.
        let decenter = lens.decenter;
        let axis_tan = decenter.mm() * (1e-3 * lens.focus_dioptres);
        let axis_mm = decenter.axis_mm();
        let map = map.about(axis_mm, axis_tan);
        let map = match &bladed {
            Some(bladed) => map.with_share(bladed.share_map(axis_mm, lattice)),
            None => map,
        };
        Self { lattice, map: Arc::new(map), stations, n_columns, bladed, axis_mm, moments }
    }

    /// Returns the outline of what is seen from a station near a point, if light is.
    pub(crate) fn seed(&self, place_mm: DVec2) -> Option<&Outline> {
        if let Some(bladed) = &self.bladed {
            return bladed.seed(place_mm);
        }
        let lit = self.stations.iter().filter(|station| station.bundle.is_some());
        let nearest = lit.min_by(|a, b| {
            let square = |station: &Station| station.place_mm.distance_squared(place_mm);
            square(a).total_cmp(&square(b))
        });
        nearest?.outline()
    }

    /// Returns how blurs grow at a point, mm from the axis.
    pub(crate) fn moments(&self, from_axis_mm: DVec2) -> Moments {
        if self.n_columns.is_none() {
            let radius_mm = from_axis_mm.length();
            let above = self.stations.partition_point(|station| station.place_mm.x < radius_mm);
            let above = above.clamp(1, self.stations.len() - 1);
            let [from, to] = [above - 1, above].map(|i| self.stations[i].place_mm.x);
            let fraction = ((radius_mm - from) / (to - from)).clamp(0.0, 1.0);
            return mixed([(self.moments[above - 1], 1.0 - fraction), (self.moments[above], fraction)]);
        }
        let grid = self.lattice.of_grid();
        let n = 2 * grid.n_steps + 1;
        let place = ((from_axis_mm + grid.reach_mm()) / grid.step_mm).clamp(DVec2::ZERO, DVec2::splat((n - 1) as f64));
        let below = place.floor().min(DVec2::splat((n - 2) as f64));
        let (f, at) = (place - below, below.y as usize * n + below.x as usize);
        mixed([
            (self.moments[at], (1.0 - f.x) * (1.0 - f.y)),
            (self.moments[at + 1], f.x * (1.0 - f.y)),
            (self.moments[at + n], (1.0 - f.x) * f.y),
            (self.moments[at + n + 1], f.x * f.y),
        ])
    }

    /// Returns the map of a part of the pupil: the directions of the whole, and its share of the irradiances.
    pub(crate) fn part_map(&self, mesh: Mesh, division: &PupilDivision, part: usize) -> FilmMap {
        if let Some(bladed) = &self.bladed {
            let shares = bladed.part_share_map((self.axis_mm, self.lattice), mesh, (division, part));
            return FilmMap::clone(&self.map).with_share(shares);
        }
        let n_directions = if self.n_columns.is_some() { 2 } else { N_AZIMUTHS };
        let turn = |i: usize| DVec2::from_angle(TAU * i as f64 / n_directions as f64);
        let cell_shares: Vec<Vec<f64>> = (0..n_directions).map(|i| division.cell_shares(part, mesh, turn(i))).collect();
        // Of each station, as if it lay in each direction from the axis; in darkness that of the nearest light.
        let shares_of = |bundle: &Bundle, i: usize| -> f64 {
            let i = if bundle.pupil_sign < 0.0 { (i + n_directions / 2) % n_directions } else { i };
            bundle.energies.iter().zip(&cell_shares[i]).map(|(energy, share)| energy * share).sum()
        };
        if self.n_columns.is_some() {
            let n = self.n_columns.unwrap_or(1);
            let share = |i: usize| self.stations[i].bundle.as_ref().map(|bundle| shares_of(bundle, 0));
            // Where the grid foresaw the whole, between the points of the finest grid about it that were traced.
            let around = |i: usize| -> f64 {
                let strides = std::iter::successors(Some(2), |stride| Some(2 * stride));
                let of_stride = |stride: usize| {
                    let ends = |k: usize| {
                        let (low, part) = (k - k % stride, (k % stride) as f64 / stride as f64);
                        [(low, 1.0 - part), ((low + stride).min(n - 1), part)]
                    };
                    let corners = ends(i / n).into_iter().flat_map(|row| ends(i % n).map(|column| (row, column)));
                    let known = corners
                        .filter_map(|((row, down), (column, across))| Some((down * across, share(row * n + column)?)));
                    let (weight, sum) =
                        known.fold((0.0, 0.0), |(weight, sum), (w, share)| (weight + w, sum + w * share));
                    (weight > 0.0).then(|| sum / weight)
                };
                strides.take_while(|stride| *stride < n).find_map(of_stride).unwrap_or(0.0)
            };
            let shares: Vec<f64> = (0..n * n).map(|i| share(i).unwrap_or_else(|| around(i))).collect();
            return self.map.scaled(&shares);
        }
        let lit: Vec<(f64, &Bundle)> =
            self.stations.iter().filter_map(|station| Some((station.place_mm.x, station.bundle.as_deref()?))).collect();
        let at_radius = |radius_mm: f64| -> Vec<f64> {
            let Some(last) = lit.len().checked_sub(1) else { return vec![0.0; n_directions] };
            let above = lit.partition_point(|(at_mm, _)| *at_mm < radius_mm).min(last);
            let below = above.saturating_sub(1);
            let step_mm = lit[above].0 - lit[below].0;
            let fraction = if step_mm > 0.0 { ((radius_mm - lit[below].0) / step_mm).clamp(0.0, 1.0) } else { 0.0 };
            let mix = |i: usize| shares_of(lit[below].1, i) * (1.0 - fraction) + shares_of(lit[above].1, i) * fraction;
            (0..n_directions).map(mix).collect()
        };
        let (step_mm, n_radii) = self.lattice.table_radii();
        let shares = (0..n_radii).flat_map(|i| at_radius(step_mm * i as f64)).collect();
        FilmMap::clone(&self.map).with_share(ShareMap::new(self.axis_mm, step_mm, n_directions, shares))
    }
}

fn mixed<const N: usize>(weighted: [(Moments, f64); N]) -> Moments {
    let sum = |of: fn(&Moments) -> f64| weighted.iter().map(|(moments, weight)| of(moments) * weight).sum();
    Moments {
        blur_mm: sum(|m| m.blur_mm),
        blur_mm_per_dioptre: sum(|m| m.blur_mm_per_dioptre),
        residue_mm: sum(|m| m.residue_mm),
    }
}

/// Returns what is known of each station, or of the nearest one of which something is.
fn nearest_known(stations: &[&Station], known: &[Option<Moments>]) -> Vec<Moments> {
    let nearest = |place_mm: DVec2| {
        let square = |i: &usize| stations[*i].place_mm.distance_squared(place_mm);
        let lit = (0..stations.len()).filter(|&i| known[i].is_some());
        lit.min_by(|a, b| square(a).total_cmp(&square(b))).and_then(|i| known[i]).unwrap_or_default()
    };
    stations.iter().zip(known).map(|(station, known)| known.unwrap_or_else(|| nearest(station.place_mm))).collect()
}

/// Stations along a radius, and what they say by distance from the axis.
struct Radius {
    step_mm: f64,
    stations: Vec<Station>,
    half_tan: EvenCurve,
    irradiance_sr: MonotoneCurve,
}

impl Radius {
    /// Traces stations until what lies between them is known, on all threads.
    fn survey(lens: &SurveyedLens<'_>, Lattice { step_mm, n_steps }: Lattice, known: &[Station]) -> Self {
        let station = |radius_mm: f64, seed: Option<&Outline>| {
            let known = known.iter().find(|station| station.place_mm.x == radius_mm).cloned();
            known.unwrap_or_else(|| lens.station(DVec2::X * radius_mm, seed))
        };
        // From the axis outwards, each from the last.
        let mut stations: Vec<Station> = Vec::new();
        for i in 0..=n_steps {
            let steps = if i == 0 { NEXT_TO_AXIS } else { i as f64 };
            let seed = stations.iter().rev().find_map(Station::outline);
            stations.push(station(step_mm * steps, seed));
        }
        let mut radius = Self::of(stations, step_mm);
        // Halve the intervals that held a station which was not foreseen.
        let mut open: Vec<[f64; 2]> =
            radius.stations.windows(2).map(|pair| [0, 1].map(|i| pair[i].place_mm.x)).collect();
        for _ in 0..MOST_HALVINGS {
            let largest_sr = radius.stations.iter().map(|station| station.irradiance_sr).fold(0.0, f64::max);
            if largest_sr == 0.0 {
                break;
            }
            let between = |&[from, to]: &[f64; 2]| {
                let at_mm = 0.5 * (from + to);
                let found = station(at_mm, radius.seed(at_mm));
                let is_foreseen = radius.foresees(&found, largest_sr);
                (found, is_foreseen)
            };
            let found: Vec<(Station, bool)> = open.par_iter().map(between).collect();
            let halves = open.iter().zip(&found).filter(|(_, (_, is_foreseen))| !is_foreseen);
            let next: Vec<[f64; 2]> = halves
                .flat_map(|(&[from, to], (station, _))| [[from, station.place_mm.x], [station.place_mm.x, to]])
                .collect();
            let mut stations = radius.stations;
            stations.extend(found.into_iter().map(|(station, _)| station));
            stations.sort_by(|a, b| a.place_mm.x.total_cmp(&b.place_mm.x));
            radius = Self::of(stations, step_mm);
            open = next;
            if open.is_empty() {
                break;
            }
        }
        radius
    }

    fn of(stations: Vec<Station>, step_mm: f64) -> Self {
        let largest_sr = stations.iter().map(|station| station.irradiance_sr).fold(0.0, f64::max);
        let bright = stations.iter().filter(|station| station.irradiance_sr > DIM * largest_sr);
        let half_tans: Vec<(f64, f64)> =
            bright.filter_map(|station| Some((station.place_mm.x, station.half_tan?.x / station.place_mm.x))).collect();
        let irradiances = stations.iter().map(|station| (station.place_mm.x, station.irradiance_sr)).collect();
        let (half_tan, irradiance_sr) = (EvenCurve::new(half_tans), MonotoneCurve::new(irradiances));
        Self { step_mm, stations, half_tan, irradiance_sr }
    }

    fn seed(&self, radius_mm: f64) -> Option<&Outline> {
        let lit = self.stations.iter().filter(|station| station.bundle.is_some());
        let off = |station: &&Station| (station.place_mm.x - radius_mm).abs();
        lit.min_by(|a, b| off(a).total_cmp(&off(b)))?.outline()
    }

    /// Whether a station is as those about it say.
    fn foresees(&self, station: &Station, largest_sr: f64) -> bool {
        let radius_mm = station.place_mm.x;
        let off_sr = (self.irradiance_sr.at(radius_mm) - station.irradiance_sr).abs();
        let is_dim = station.irradiance_sr <= DIM * largest_sr;
        let direction = station.half_tan.filter(|_| !is_dim);
        let is_foreseen = direction.is_none_or(|half_tan| {
            let per_mm = self.half_tan.at(radius_mm);
            (per_mm * radius_mm - half_tan.x).abs() <= MOST_OFF * self.step_mm * per_mm.abs()
        });
        is_foreseen && off_sr <= MOST_OFF_SR * largest_sr
    }

    fn map(&self, lattice: Lattice) -> RadialMap {
        let last_mm = self.half_tan.x.last().copied().unwrap_or(0.0);
        let half_tan = |radius_mm: f64| self.half_tan.at(radius_mm) * radius_mm;
        // Beyond the light directions go on with the slope of the last part of it, in angle.
        let angle = |radius_mm: f64| 2.0 * half_tan(radius_mm).atan();
        let from_mm = last_mm * (1.0 - RIM);
        let slope = if last_mm > 0.0 { (angle(last_mm) - angle(from_mm)) / (last_mm - from_mm) } else { 0.0 };
        let half_tan_at = |radius_mm: f64| match radius_mm <= last_mm {
            true => Some(half_tan(radius_mm)),
            false if last_mm > 0.0 => {
                let angle = angle(last_mm) + slope * (radius_mm - last_mm);
                (angle.abs() < 0.9 * std::f64::consts::PI).then(|| (0.5 * angle).tan())
            }
            false => None,
        };
        let table = (lattice.reach_mm(), lattice.n_steps * Lattice::ENTRIES);
        RadialMap::from_half_tans(table, half_tan_at, |radius_mm| self.irradiance_sr.at(radius_mm).max(0.0))
    }
}

/// An even function known at points of ascending x above 0: Lagrange's polynomial through the nearest of them and their mirror images.
struct EvenCurve {
    x: Vec<f64>,
    y: Vec<f64>,
}

impl EvenCurve {
    /// Points of a polynomial.
    const N: usize = 6;

    fn new(points: Vec<(f64, f64)>) -> Self {
        let (x, y) = points.into_iter().unzip();
        Self { x, y }
    }

    fn point(&self, i: i64) -> (f64, f64) {
        if i >= 0 { (self.x[i as usize], self.y[i as usize]) } else { (-self.x[!i as usize], self.y[!i as usize]) }
    }

    /// Returns the value at a place up to the last point.
    fn at(&self, x: f64) -> f64 {
        let n = self.x.len() as i64;
        let first = self.x.partition_point(|&known| known < x) as i64 - Self::N as i64 / 2;
        // As many mirrored points as there are others.
        let first = first.min(n - Self::N as i64).max(-n);
        let points: Vec<(f64, f64)> = (first..(first + Self::N as i64).min(n)).map(|i| self.point(i)).collect();
        let term = |(i, &(own, value)): (usize, &(f64, f64))| {
            let others = points.iter().enumerate().filter(|(j, _)| *j != i);
            value * others.map(|(_, &(other, _))| (x - other) / (own - other)).product::<f64>()
        };
        points.iter().enumerate().map(term).sum()
    }
}

/// A curve that passes no value of its points by, level at the first: cubics with limited slopes (Fritsch & Carlson 1980, Monotone piecewise
/// cubic interpolation), for what has kinks.
struct MonotoneCurve {
    x: Vec<f64>,
    y: Vec<f64>,
    slopes: Vec<f64>,
}

impl MonotoneCurve {
    /// Takes points of ascending x.
    fn new(points: Vec<(f64, f64)>) -> Self {
        let (x, y): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
        let n = x.len();
        let secant = |i: usize| (y[i + 1] - y[i]) / (x[i + 1] - x[i]);
        let slope = |i: usize| {
            if n < 3 || i == 0 {
                return 0.0;
            }
            // That of the parabola through three points, at the middle or at the last.
            let (k, is_last) = (i.min(n - 2), i == n - 1);
            let (before, after) = (secant(k - 1), secant(k));
            let (step_before, step_after) = (x[k] - x[k - 1], x[k + 1] - x[k]);
            let bend = (after - before) / (step_before + step_after);
            if is_last {
                let parabola = after + bend * step_after;
                return if parabola * after > 0.0 {
                    parabola.abs().min(3.0 * after.abs()).copysign(after)
                } else {
                    0.0
                };
            }
            let parabola = before + bend * step_before;
            match before * after > 0.0 {
                true => parabola.abs().min(3.0 * before.abs().min(after.abs())).copysign(before),
                false => 0.0,
            }
        };
        let slopes = (0..n).map(slope).collect();
        Self { x, y, slopes }
    }

    /// Returns the value at a place; before the first point and beyond the last, theirs.
    fn at(&self, x: f64) -> f64 {
        let n = self.x.len();
        let above = self.x.partition_point(|&known| known < x).clamp(1, n - 1);
        let below = above - 1;
        let step = self.x[above] - self.x[below];
        let t = ((x - self.x[below]) / step).clamp(0.0, 1.0);
        // Hermite's cubic.
        let (from, to) = (self.y[below], self.y[above]);
        let (slope_from, slope_to) = (self.slopes[below] * step, self.slopes[above] * step);
        let s = 1.0 - t;
        from * s * s * (1.0 + 2.0 * t) + to * t * t * (3.0 - 2.0 * t) + t * s * (slope_from * s - slope_to * t)
    }
}

/// Surveys a square of film, with ever finer grids where what lies between their points was not foreseen; returns the number of columns too.
///
/// Beyond the circle in the square nobody asks; there, as in darkness, directions go on.
fn surveyed_grid(lens: &SurveyedLens<'_>, lattice: Lattice) -> (PlaneMap, Vec<Station>, usize) {
    let (focus_dioptres, reach_mm) = (lens.focus_dioptres, lattice.reach_mm());
    let place_mm =
        |n: usize, i: usize| DVec2::new((i % n) as f64, (i / n) as f64) * (2.0 * reach_mm / (n - 1) as f64) - reach_mm;
    let asked_mm = reach_mm + std::f64::consts::SQRT_2 * lattice.step_mm;
    let traced = |place_mm: DVec2, seed: Option<&Outline>| match place_mm.length() <= asked_mm {
        true => lens.station(place_mm, seed),
        false => Station::new(place_mm, None, focus_dioptres),
    };
    let map_of = |stations: &[Station], n: usize| {
        let lit = stations.iter().map(|station| station.half_tan).collect();
        // Where nothing is seen far and wide, as through a hole in place of the lens.
        let through_hole = |station: &Station| station.place_mm / (2.0 * lens.job.film_distance_mm);
        let half_tans = straight_on(lit, n).unwrap_or_else(|| stations.iter().map(through_hole).collect());
        let nodes: Vec<(DVec2, f64)> =
            half_tans.into_iter().zip(stations).map(|(half_tan, station)| (half_tan, station.irradiance_sr)).collect();
        PlaneMap::new(reach_mm, n, &nodes)
    };
    let n_first = 2 * lattice.n_steps + 1;
    let mut n = n_first;
    let middle = traced(DVec2::ZERO, None);
    let mut stations: Vec<Station> =
        (0..n * n).into_par_iter().map(|i| traced(place_mm(n, i), middle.outline())).collect();
    let mut map = map_of(&stations, n);
    // Whether each point was as the coarser grid says.
    let mut are_foreseen = vec![false; n * n];
    for _ in 0..MOST_AREA_HALVINGS {
        let finer = 2 * n - 1;
        let largest_sr = stations.iter().map(|station| station.irradiance_sr).fold(0.0, f64::max);
        let is_foreseen = |station: &Station| {
            let off_sr = (map.irradiance_sr(station.place_mm) - station.irradiance_sr).abs();
            let chief = station.bundle.as_ref().filter(|bundle| bundle.irradiance_sr > DIM * largest_sr);
            let off_mm =
                chief.map_or(0.0, |bundle| map.place_of(bundle.chief(focus_dioptres)).distance(station.place_mm));
            off_sr <= AREA_OVER_RADIUS * MOST_OFF_SR * largest_sr
                && off_mm <= AREA_OVER_RADIUS * MOST_OFF * lattice.step_mm
        };
        let found: Vec<(Station, bool)> = (0..finer * finer)
            .into_par_iter()
            .map(|i| {
                let (row, column) = (i / finer, i % finer);
                let [rows, columns] = [row, column].map(|k| [k / 2, k.div_ceil(2)]);
                let about = || rows.into_iter().flat_map(|row| columns.map(|column| row * n + column));
                if about().all(|k| are_foreseen[k]) {
                    let place_mm = place_mm(finer, i);
                    let known = &stations[rows[0] * n + columns[0]];
                    let is_known = row % 2 == 0 && column % 2 == 0;
                    let between = || Station {
                        place_mm,
                        half_tan: Some(map.half_tan_at(place_mm)),
                        irradiance_sr: map.irradiance_sr(place_mm),
                        bundle: None,
                    };
                    return (if is_known { known.clone() } else { between() }, true);
                }
                if row % 2 == 0 && column % 2 == 0 {
                    return (stations[rows[0] * n + columns[0]].clone(), are_foreseen[rows[0] * n + columns[0]]);
                }
                // The first two grids look everywhere; what is left is beside light that they found.
                let at_mm = place_mm(finer, i);
                let seed = about().find_map(|k| stations[k].outline());
                let station = match n == n_first || seed.is_some() {
                    true => traced(at_mm, seed),
                    false => Station::new(at_mm, None, focus_dioptres),
                };
                let is_foreseen = is_foreseen(&station);
                (station.without_rays(), is_foreseen)
            })
            .collect();
        let is_done = found.iter().enumerate().all(|(i, (_, is_foreseen))| {
            let is_known = (i / finer).is_multiple_of(2) && (i % finer).is_multiple_of(2);
            is_known || *is_foreseen
        });
        // A point that both grids have was foreseen where all new ones about it were.
        let of_grid: Vec<bool> = found.iter().map(|(_, is_foreseen)| *is_foreseen).collect();
        are_foreseen = (0..finer * finer)
            .map(|i| {
                let (row, column) = (i / finer, i % finer);
                if !(row.is_multiple_of(2) && column.is_multiple_of(2)) {
                    return of_grid[i];
                }
                let around = |k: usize| k.saturating_sub(1)..=(k + 1).min(finer - 1);
                around(row).all(|r| {
                    around(column).all(|c| (r.is_multiple_of(2) && c.is_multiple_of(2)) || of_grid[r * finer + c])
                })
            })
            .collect();
        stations = found.into_iter().map(|(station, _)| station).collect();
        map = map_of(&stations, finer);
        n = finer;
        if is_done {
            break;
        }
    }
    (map, stations, n)
}

/// Fills the gaps of a grid by going on straight from two neighbors in a line, or returns `None` where there are no two.
fn straight_on(mut values: Vec<Option<DVec2>>, n_columns: usize) -> Option<Vec<DVec2>> {
    let n_rows = values.len() / n_columns;
    while values.iter().any(Option::is_none) {
        let at = |row: i64, column: i64| {
            let is_inside = (0..n_rows as i64).contains(&row) && (0..n_columns as i64).contains(&column);
            is_inside.then(|| values[row as usize * n_columns + column as usize]).flatten()
        };
        let filled: Vec<Option<DVec2>> = (0..values.len())
            .map(|i| {
                let (row, column) = ((i / n_columns) as i64, (i % n_columns) as i64);
                let ways = [(0, 1), (0, -1), (1, 0), (-1, 0)];
                let found: Vec<DVec2> = ways
                    .into_iter()
                    .filter_map(|(down, right)| {
                        let near = at(row + down, column + right)?;
                        Some(2.0 * near - at(row + 2 * down, column + 2 * right)?)
                    })
                    .collect();
                values[i].or_else(|| (!found.is_empty()).then(|| found.iter().sum::<DVec2>() / found.len() as f64))
            })
            .collect();
        if filled == values {
            return None;
        }
        values = filled;
    }
    values.into_iter().collect()
}
