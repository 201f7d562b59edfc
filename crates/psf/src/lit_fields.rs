//! The fields of which a lens passes light, followed outwards from one of them.
//!
//! Pupils get narrower towards the end of the light, and narrow ones are not found from nothing, and that there is none takes long to see. So each is looked for about that of a field just within.

use std::f64::consts::TAU;

use dioptric_spectrum::{Cancel, Cancelled};
use glam::DVec2;
use rayon::prelude::*;

use crate::{FieldSampling, axis::Axis, mesh::Mesh, pupil::Pupil, ray_map::RayMapJob};

/// Azimuths at which the end of the light is looked for.
const N_AZIMUTHS: usize = 32;
/// Even parts of the way to the end between which pupils are known, and a share of it more: areas end with the power 3/2, which no cubic does.
const N_PARTS: usize = 12;
const NEAR_END: f64 = 0.965;

/// To which share of a way the end of the light on it is found.
const TOLERANCE: f64 = 1e-3;
/// Up to pupils how narrow the next one is looked for as if nothing were known of it where none is found beside: their radius over that of the first.
const NARROWEST: f64 = 0.06;

/// The lit fields along a way outwards.
struct LitWalk {
    /// Shares of the way that are lit, ascending, with their pupils.
    lit: Vec<(f64, Pupil)>,
    is_dark_beyond: bool,
}

impl LitWalk {
    /// Goes from the field of a job, whose pupil is known, on a way that has a field (tangents) at each share of it from 0 to 1.
    ///
    /// Steps are halved where no pupil is found about the last one, and doubled again after two that went well.
    fn outwards(job: RayMapJob<'_>, first: Pupil, way: impl Fn(f64) -> DVec2) -> Self {
        const LONGEST: f64 = 1.0 / 8.0;
        let mut walk = Self { lit: vec![(0.0, first)], is_dark_beyond: false };
        let (mut step, mut n_went_well) = (LONGEST, 0);
        while walk.last_share() < 1.0 {
            let is_last_try = step < TOLERANCE;
            let share = (walk.last_share() + step).min(1.0);
            let found = match walk.look(job, way(share), share) {
                None if is_last_try && walk.relative_radius() >= NARROWEST => {
                    from_nothing(RayMapJob { field_tan: way(share), ..job })
                }
                found => found,
            };
            match found {
                Some((pupil, _)) => {
                    walk.lit.push((share, pupil));
                    n_went_well += 1;
                    if n_went_well == 2 {
                        (step, n_went_well) = (f64::min(2.0 * step, LONGEST), 0);
                    }
                }
                None if is_last_try => {
                    walk.is_dark_beyond = true;
                    break;
                }
                None => (step, n_went_well) = (0.5 * step, 0),
            }
        }
        walk
    }

    /// The radius of the last pupil over that of the first.
    fn relative_radius(&self) -> f64 {
        let radius_mm = |at: usize| self.lit[at].1.mean_radius_mm();
        radius_mm(self.lit.len() - 1) / radius_mm(0)
    }

    /// The share of the way up to which light gets through.
    fn last_share(&self) -> f64 {
        self.lit[self.lit.len() - 1].0
    }

    /// Returns the pupil of a field at a share of the way and its area, mm² as in a ray map's summary, looked for about that of the last share known before;
    /// `None` where no light gets through.
    fn look(&self, job: RayMapJob<'_>, field_tan: DVec2, share: f64) -> Option<(Pupil, f64)> {
        let job = RayMapJob { field_tan, ..job };
        let before = self.lit.partition_point(|(lit, _)| *lit <= share).max(1) - 1;
        let pupil = self.lit[before].1.clone().moved(job.lens, &job.point())?;
        let area_mm2 = job.trace(&pupil, false)?.summary.pupil_mm2;
        Some((pupil, area_mm2))
    }
}

/// Returns the pupil of a job's field and its area, mm², looked for as if nothing were known of it.
fn from_nothing(job: RayMapJob<'_>) -> Option<(Pupil, f64)> {
    let pupil = job.pupil()?;
    let area_mm2 = job.trace(&pupil, false)?.summary.pupil_mm2;
    Some((pupil, area_mm2))
}

/// The fields about one in their middle of which a lens passes light, and how large their pupils are, at one depth and wavelength.
#[derive(Clone, Debug)]
pub struct LitFields {
    // Invariants: lists have one entry an azimuth, counted from +x; `pupils_mm2` one a share on each, shares innermost.
    middle_tan: DVec2,
    /// How far out from the middle the light ends, or fields are known: angles whose tangents are distances of tangents.
    ends_rad: Vec<f64>,
    is_dark_beyond: Vec<bool>,
    /// Shares of those angles.
    shares: Axis,
    /// Areas of the pupil, mm², as in a ray map's summary; 0 where the light ends.
    pupils_mm2: Vec<f64>,
}

impl LitFields {
    /// Looks about the field of a job, up to `reach_tan` from it; `None` where that sees no light. The mesh need not be fine.
    pub(crate) fn about(job: RayMapJob<'_>, reach_tan: f64) -> Option<Self> {
        let first = job.pupil()?;
        job.trace(&first, false)?;
        let even = (0..N_PARTS).map(|i| i as f64 / N_PARTS as f64);
        let shares = Axis::new(even.chain([NEAR_END, 1.0]).collect()).expect("they ascend");
        let reach_rad = reach_tan.atan();
        let (mut ends_rad, mut is_dark_beyond, mut pupils_mm2) = (vec![], vec![], vec![]);
        for azimuth in 0..N_AZIMUTHS {
            let way = |share: f64| job.field_tan + direction(azimuth) * (share * reach_rad).tan();
            let walk = LitWalk::outwards(job, first.clone(), way);
            let end = walk.last_share();
            ends_rad.push(end * reach_rad);
            is_dark_beyond.push(walk.is_dark_beyond);
            pupils_mm2.extend(shares.knots().iter().map(|&share| {
                let field_tan = way(share * end);
                let found = || {
                    let beside = walk.look(job, field_tan, share * end);
                    beside.or_else(|| from_nothing(RayMapJob { field_tan, ..job }))
                };
                let is_end = share == 1.0 && walk.is_dark_beyond;
                if is_end { 0.0 } else { found().map_or(0.0, |(_, area_mm2)| area_mm2) }
            }));
        }
        Some(Self { middle_tan: job.field_tan, ends_rad, is_dark_beyond, shares, pupils_mm2 })
    }

    /// The field in the middle.
    pub(crate) fn middle_tan(&self) -> DVec2 {
        self.middle_tan
    }

    /// Returns the rectangle of tangents that holds the lit fields, from its corner left below to that right above; infinite where their end was not met.
    #[must_use]
    pub fn bounds_tan(&self) -> (DVec2, DVec2) {
        let end = |i: usize| match self.is_dark_beyond[i] {
            true => direction(i) * self.ends_rad[i].tan(),
            false => direction(i).map(|part| if part.abs() < 1e-9 { 0.0 } else { part * f64::INFINITY }),
        };
        let ends = (0..N_AZIMUTHS).map(|i| self.middle_tan + end(i));
        ends.fold((self.middle_tan, self.middle_tan), |(low, high), end| (low.min(end), high.max(end)))
    }

    /// Returns how far out a field lies, as a share of the angle at which light ends there, or of what is known.
    pub(crate) fn share_of(&self, field_tan: DVec2) -> f64 {
        let way_tan = field_tan - self.middle_tan;
        way_tan.length().atan() / Around::at(way_tan).mix(|i| self.ends_rad[i])
    }

    /// Returns the field that lies so far out in the direction of another.
    pub(crate) fn field_at(&self, share: f64, towards_tan: DVec2) -> DVec2 {
        let way_tan = towards_tan - self.middle_tan;
        let end_rad = Around::at(way_tan).mix(|i| self.ends_rad[i]);
        self.middle_tan + way_tan.normalize_or_zero() * (share * end_rad).tan()
    }

    /// Whether light ends before a field (tangents).
    #[must_use]
    pub fn is_dark_at(&self, field_tan: DVec2) -> bool {
        let nearest = Around::at(field_tan - self.middle_tan).nearest();
        self.is_dark_beyond[nearest] && self.share_of(field_tan) >= 1.0
    }

    /// Returns the area of the pupil of a field, mm²; 0 beyond the end of the light.
    pub(crate) fn pupil_mm2(&self, field_tan: DVec2) -> f64 {
        let around = Around::at(field_tan - self.middle_tan);
        let share = self.share_of(field_tan);
        if share >= 1.0 && self.is_dark_beyond[around.nearest()] {
            return 0.0;
        }
        let (stencil, n_shares) = (self.shares.cubic(share), self.shares.knots().len());
        let at = |i: usize| stencil.iter().map(|(k, weight)| weight * self.pupils_mm2[i * n_shares + k]).sum();
        around.mix(at).max(0.0)
    }

    /// Returns what is the sum of these, all about one middle, with these weights.
    pub(crate) fn mix<'a>(mut weighted: impl Iterator<Item = (&'a Self, f64)>) -> Option<Self> {
        let (first, weight) = weighted.next()?;
        let mut sum = first.clone();
        sum.ends_rad.iter_mut().chain(&mut sum.pupils_mm2).for_each(|number| *number *= weight);
        for (lit, weight) in weighted {
            let add = |sums: &mut [f64], numbers: &[f64]| {
                sums.iter_mut().zip(numbers).for_each(|(sum, number)| *sum += weight * number);
            };
            add(&mut sum.ends_rad, &lit.ends_rad);
            add(&mut sum.pupils_mm2, &lit.pupils_mm2);
            sum.is_dark_beyond.iter_mut().zip(&lit.is_dark_beyond).for_each(|(sum, dark)| *sum &= dark);
        }
        Some(sum)
    }
}

/// Wavelengths, by a coordinate, and depths at which light is followed: planes are those of each wavelength at all depths.
pub(crate) struct Planes<'a> {
    pub(crate) jobs: &'a [RayMapJob<'a>],
    pub(crate) colors: &'a Axis,
    pub(crate) dioptres: &'a Axis,
}

impl Planes<'_> {
    /// Follows the light outwards from a field at some of them.
    #[inline(never)]
    fn follow(
        &self,
        numbers: &[usize],
        start: (DVec2, f64),
        cancel: &Cancel,
    ) -> Result<Option<Vec<LitFields>>, Cancelled> {
        /// A mesh that is fine enough for the area of a pupil, with the edge of the bank's.
        const N_RINGS: usize = 4;
        let (field_tan, reach_tan) = start;
        let found = numbers.par_iter().map(|&number| {
            cancel.check()?;
            let job = self.jobs[number];
            let mesh = Mesh { n_rings: N_RINGS, ..job.mesh };
            Ok(LitFields::about(RayMapJob { field_tan, mesh, ..job }, reach_tan))
        });
        found.collect()
    }

    /// Follows the light at all of them: by rays at three wavelengths and three depths, between which its end is a parabola.
    fn follow_all(&self, start: (DVec2, f64), cancel: &Cancel) -> Result<Option<Vec<LitFields>>, Cancelled> {
        let (colors, depths) = (ends_and_middle(self.colors), ends_and_middle(self.dioptres));
        let n_depths = self.dioptres.knots().len();
        let few: Vec<usize> =
            colors.iter().flat_map(|color| depths.iter().map(move |depth| color * n_depths + depth)).collect();
        let Some(followed) = self.follow(&few, start, cancel)? else { return Ok(None) };
        let is_alike = followed.iter().all(|lit| lit.is_dark_beyond == followed[0].is_dark_beyond);
        if !is_alike {
            // Light that ends at one wavelength and is not followed to its end at another.
            return self.follow(&(0..self.jobs.len()).collect::<Vec<_>>(), start, cancel);
        }
        let among = |axis: &Axis, numbers: &[usize]| {
            Axis::new(numbers.iter().map(|&i| axis.knots()[i]).collect()).expect("knots of an axis ascend")
        };
        let (few_colors, few_depths) = (among(self.colors, &colors), among(self.dioptres, &depths));
        let places =
            self.colors.knots().iter().flat_map(|&color| self.dioptres.knots().iter().map(move |&d| (color, d)));
        let n_few = depths.len();
        let between = |(color, dioptres): (f64, f64)| {
            let (of_colors, of_depths) = (few_colors.stencil(color), few_depths.stencil(dioptres));
            let of_color = |(i, weight): (usize, f64)| of_depths.iter().map(move |(j, w)| (i * n_few + j, weight * w));
            let weighted = of_colors.iter().flat_map(of_color);
            LitFields::mix(weighted.map(|(i, weight)| (&followed[i], weight)))
        };
        Ok(places.map(between).collect())
    }
}

/// Returns the numbers of the first knot of an axis, that nearest to its middle, and the last.
fn ends_and_middle(axis: &Axis) -> Vec<usize> {
    let knots = axis.knots();
    let last = knots.len() - 1;
    let off = |i: usize| (knots[i] - 0.5 * (knots[0] + knots[last])).abs();
    let middle = (1..last).min_by(|&a, &b| off(a).total_cmp(&off(b)));
    let mut numbers: Vec<usize> = [0].into_iter().chain(middle).chain([last]).collect();
    numbers.dedup();
    numbers
}

/// Follows the light of a grid of fields outwards from their middle, at each wavelength and depth that a job is given for; `None` where it does not end
/// within the grid, or there is none in the middle.
pub(crate) fn within_grid(
    planes: &Planes<'_>,
    fields: &FieldSampling,
    cancel: &Cancel,
) -> Result<Option<Vec<LitFields>>, Cancelled> {
    let FieldSampling::Grid { tans_x, tans_y } = fields else { return Ok(None) };
    let (x, y) = ((tans_x[0], tans_x[tans_x.len() - 1]), (tans_y[0], tans_y[tans_y.len() - 1]));
    let corners = [(x.0, y.0), (x.1, y.0), (x.0, y.1), (x.1, y.1)].map(DVec2::from);
    let middle_tan = 0.5 * (corners[0] + corners[3]);
    // Lit fields have no hollows: where the corners are lit, all between them are.
    let is_dark =
        |job: &RayMapJob<'_>| corners.iter().any(|&field_tan| RayMapJob { field_tan, ..*job }.pupil().is_none());
    if !planes.jobs.par_iter().any(is_dark) {
        return Ok(None);
    }
    planes.follow_all((middle_tan, 1.1 * middle_tan.distance(corners[0])), cancel)
}

fn direction(azimuth: usize) -> DVec2 {
    DVec2::from_angle(TAU * azimuth as f64 / N_AZIMUTHS as f64)
}

/// A direction between the azimuths at which the light was followed.
struct Around {
    below: usize,
    fraction: f64,
}

impl Around {
    fn at(way: DVec2) -> Self {
        let turns = if way == DVec2::ZERO { 0.0 } else { way.to_angle() / TAU };
        let place = turns.rem_euclid(1.0) * N_AZIMUTHS as f64;
        Self { below: place as usize, fraction: place.fract() }
    }

    fn nearest(&self) -> usize {
        (self.below + usize::from(self.fraction > 0.5)) % N_AZIMUTHS
    }

    /// Returns what is known at each azimuth, by the cubic of Catmull and Rom, whose slopes are continuous.
    fn mix(&self, at: impl Fn(usize) -> f64) -> f64 {
        let t = self.fraction;
        let weights = [
            0.5 * t * ((2.0 - t) * t - 1.0),
            0.5 * ((3.0 * t - 5.0) * t * t + 2.0),
            0.5 * t * ((4.0 - 3.0 * t) * t + 1.0),
            0.5 * (t - 1.0) * t * t,
        ];
        weights.iter().enumerate().map(|(i, weight)| weight * at((self.below + i + N_AZIMUTHS - 1) % N_AZIMUTHS)).sum()
    }
}

#[cfg(test)]
mod tests {
    use dioptric_optics::{CoordinateBreak, Lens, MonoLens, rays_towards};

    use super::*;

    /// Of a lens with an axis light ends at one angle all around, where no ray of a dense grid gets through.
    #[test]
    fn light_ends_in_a_circle() {
        let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(4.0, 550.0).unwrap().at(550.0).unwrap();
        let mesh = Mesh { n_rings: 4, n_azimuths: 32 };
        let job = |field_tan| RayMapJob {
            lens: &lens,
            reference: &lens,
            field_tan,
            dioptres: 0.5,
            film_distance_mm: 37.0,
            mesh,
        };
        let lit = LitFields::about(job(DVec2::ZERO), 1.2).unwrap();
        // The last pupils are slivers across the field.
        let targets: Vec<DVec2> = (0..240_000)
            .map(|i: u32| 0.025 * DVec2::new(f64::from(i % 1000) - 499.5, f64::from(i / 1000) - 119.5))
            .collect();
        let is_lit = |field_tan: DVec2| {
            let rays = rays_towards(&job(field_tan).point(), &targets, lens.projection_center_z_mm(), 0.0);
            lens.clearances_mm(rays).iter().any(|clearance_mm| *clearance_mm > 0.0)
        };
        let (mut within, mut dark) = (0.2, 1.2);
        for _ in 0..14 {
            let middle = 0.5 * (within + dark);
            if is_lit(DVec2::X * middle) { within = middle } else { dark = middle }
        }
        let (low_tan, high_tan) = lit.bounds_tan();
        for end_tan in [-low_tan.x, -low_tan.y, high_tan.x, high_tan.y] {
            // A thousandth of the reach.
            assert!((end_tan - within).abs() < 1.5e-3, "{end_tan} {within}");
        }
        let area_mm2 =
            |field_tan| job(field_tan).trace(&job(field_tan).pupil().unwrap(), false).unwrap().summary.pupil_mm2;
        let whole_mm2 = area_mm2(DVec2::ZERO);
        for (angle, share) in [(0.0, 0.1), (0.7, 0.45), (2.0, 0.7), (3.3, 0.9), (5.0, 0.97)] {
            let field_tan = lit.field_at(share, DVec2::from_angle(angle));
            assert!((lit.share_of(field_tan) - share).abs() < 1e-12 && !lit.is_dark_at(field_tan));
            let error = (lit.pupil_mm2(field_tan) - area_mm2(field_tan)) / whole_mm2;
            // Vignetting begins within a part of the way.
            assert!(error.abs() < 5e-3, "{share}: {error}");
        }
        let outside_tan = lit.field_at(1.01, DVec2::new(-0.3, 0.4));
        assert!(lit.is_dark_at(outside_tan) && lit.pupil_mm2(outside_tan) == 0.0);
    }

    /// About a field off the middle of the light its end lies at another angle each way; mixed with itself it stays there.
    #[test]
    fn light_is_followed_from_any_field_and_mixed() {
        let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(4.0, 550.0).unwrap().at(550.0).unwrap();
        let job = RayMapJob {
            lens: &lens,
            reference: &lens,
            field_tan: DVec2::new(0.1, -0.05),
            dioptres: 0.5,
            film_distance_mm: 37.0,
            mesh: Mesh { n_rings: 4, n_azimuths: 32 },
        };
        let lit = LitFields::about(job, 1.2).unwrap();
        let centered = LitFields::about(RayMapJob { field_tan: DVec2::ZERO, ..job }, 1.2).unwrap();
        let end_tan = centered.bounds_tan().1.x;
        let mixed = LitFields::mix([(&lit, 1.5), (&lit, -0.5)].into_iter()).unwrap();
        for i in 0..40 {
            let direction = DVec2::from_angle(0.16 * f64::from(i));
            assert!(!lit.is_dark_at(0.98 * end_tan * direction) && lit.is_dark_at(1.02 * end_tan * direction), "{i}");
            let field_tan = 0.8 * end_tan * direction;
            assert!((mixed.pupil_mm2(field_tan) - lit.pupil_mm2(field_tan)).abs() < 1e-9);
        }
        // Not met within a short reach.
        let short = LitFields::about(job, 0.1).unwrap();
        assert!(short.bounds_tan().0 == DVec2::NEG_INFINITY && !short.is_dark_at(DVec2::X));
        assert!((short.pupil_mm2(DVec2::new(0.15, 0.0)) / lit.pupil_mm2(DVec2::new(0.15, 0.0)) - 1.0).abs() < 0.02);
    }

    /// Light through a tilted lens at five wavelengths and nine depths: followed at three of each it ends where it does when it is followed at all.
    #[test]
    fn light_between_some_wavelengths_and_depths_ends_where_it_is_followed_to() {
        let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(4.0, 550.0).unwrap();
        let tilt = CoordinateBreak {
            surfaces: (0, lens.interfaces().len() - 1),
            pivot_mm: 20.0,
            decenter_mm: [0.0; 3],
            tilt_deg: [3.0, 1.0, 0.0],
            tilt_first: false,
        };
        let lens = lens.with_moves(vec![tilt]).unwrap();
        let wavelengths_nm = [700.0, 625.0, 550.0, 475.0, 400.0];
        let lenses: Vec<MonoLens> = wavelengths_nm.iter().map(|&nm| lens.at(nm).unwrap()).collect();
        let dioptres: Vec<f64> = (0..9).map(|i| 0.05 + 0.3 * f64::from(i)).collect();
        let job = |lens, dioptres| RayMapJob {
            lens,
            reference: &lenses[2],
            field_tan: DVec2::ZERO,
            dioptres,
            film_distance_mm: 37.0,
            mesh: Mesh { n_rings: 4, n_azimuths: 32 },
        };
        let jobs: Vec<RayMapJob<'_>> =
            lenses.iter().flat_map(|lens| dioptres.iter().map(move |&d| job(lens, d))).collect();
        let axis = |knots: &[f64]| Axis::new(knots.to_vec()).unwrap();
        let (colors, depths) = (axis(&wavelengths_nm.map(|nm| -nm)), axis(&dioptres));
        let planes = Planes { jobs: &jobs, colors: &colors, dioptres: &depths };
        let (start, cancel) = ((DVec2::ZERO, 1.2), Cancel::new());
        let between = planes.follow_all(start, &cancel).unwrap().unwrap();
        for number in [0, 12, 20, 26, 31, 44] {
            let followed = &planes.follow(&[number], start, &cancel).unwrap().unwrap()[0];
            assert_eq!(between[number].is_dark_beyond, followed.is_dark_beyond);
            for (found, expected) in between[number].ends_rad.iter().zip(&followed.ends_rad) {
                // Each is found to a thousandth of the way.
                assert!((found - expected).abs() < 2e-3, "{number}: {found} {expected}");
            }
            let whole_mm2 = followed.pupils_mm2[0];
            for (found, expected) in between[number].pupils_mm2.iter().zip(&followed.pupils_mm2) {
                assert!((found - expected).abs() < 1e-2 * whole_mm2, "{number}: {found} {expected}");
            }
        }
    }
}
