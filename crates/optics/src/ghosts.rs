//! Ghosts: light that surfaces of a lens reflect twice on its way to the film.

mod beams;
mod from_film;

use glam::DVec2;
use rayon::prelude::*;
use serde::Serialize;

use crate::{
    MonoLens, ObjectPoint, OpticsError, RayBatch, RayBatchF32,
    rays::RaySlices,
    reversed::mirrored,
    trace::{GhostTree, LightPass, Real, SideLight, Step},
    transmission::{EXACT_TERMS, GHOST_TERMS},
};

pub use self::{
    beams::{GhostBeam, GhostBeams},
    from_film::{FilmGhosts, GhostRay},
};

/// Rays that one task sends through the tree of all pairs.
const CHUNK: usize = 2048;
/// The most rays that are followed in double precision; of more the means are good to 1e-5 in single.
const MOST_DOUBLE: usize = 30_000;

/// What ghosts of a lens are asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GhostRequest {
    /// The source.
    pub point: ObjectPoint,
    /// Distance of the film behind the last vertex, mm.
    pub film_distance_mm: f64,
    /// About how many rays fall on the rim of the first surface.
    pub n_rays: usize,
    /// z of the plane in which they are spread over the circle of that rim, mm: [that of the rim itself](MonoLens::front_rim_z_mm) has all light that the
    /// surface gets; in others, as the vertex plane, slanted light passes beside the circle.
    pub rim_z_mm: f64,
    /// Half the width and half the height of the film, mm, of which the light on it is counted; `None` for a film without ends.
    pub film_half_mm: Option<DVec2>,
}

/// Light that reaches the film one way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct GhostLight {
    /// Over the light that falls on the circle of the first surface's rim.
    pub power: f64,
    /// The same of what falls within the ends of the film.
    pub power_on_film: f64,
    /// The share of the rays on that circle that reach the plane of the film.
    pub open: f64,
    /// The centroid on the film, mm in the lens frame; 0 where there is no light.
    pub centroid_mm: DVec2,
    /// The rms distance from the centroid, mm.
    pub rms_radius_mm: f64,
}

/// A ghost.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Ghost {
    /// The surface that light is reflected at first, counted from 0: the later one of both.
    pub first: usize,
    /// The surface that it is reflected at then.
    pub second: usize,
    /// How many times as far from the axis as the image the middle of the ghost lies, by first-order optics: negative on the other side.
    pub magnification: f64,
    /// Its light.
    #[serde(flatten)]
    pub light: GhostLight,
}

/// The ghosts of a point, and its direct light.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ghosts {
    /// The light that goes straight on.
    pub direct: GhostLight,
    /// All pairs of surfaces whose light reaches the plane of the film, the brightest first.
    pub pairs: Vec<Ghost>,
}

impl Ghosts {
    /// The light of all ghosts on the film over that of the image: the veil, where ghosts are wide.
    pub fn veil(&self) -> f64 {
        // Of no pairs the sum would be −0.
        self.pairs.iter().map(|ghost| ghost.light.power_on_film).fold(0.0, |sum, power| sum + power)
            / self.direct.power_on_film
    }
}

/// Sums over rays of one way.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    power: f64,
    on_film: f64,
    n_open: f64,
    place: DVec2,
    square: f64,
}

impl Sums {
    fn add(&mut self, other: &Self) {
        self.power += other.power;
        self.on_film += other.on_film;
        self.n_open += other.n_open;
        self.place += other.place;
        self.square += other.square;
    }

    /// Returns the light; `all` and `n_rays` are the weight and the number of all rays. Of half a pupil, whose other half is its mirror image
    /// in x, the place is on the y axis.
    fn light(&self, (all, n_rays): (f64, usize), is_half: bool) -> GhostLight {
        if self.power <= 0.0 {
            return GhostLight::default();
        }
        let mean = self.place / self.power;
        let centroid_mm = if is_half { DVec2::new(0.0, mean.y) } else { mean };
        let square = self.square / self.power - centroid_mm.length_squared();
        GhostLight {
            power: self.power / all,
            power_on_film: self.on_film / all,
            open: self.n_open / n_rays as f64,
            centroid_mm,
            rms_radius_mm: square.max(0.0).sqrt(),
        }
    }
}

impl MonoLens {
    /// Returns the ghosts of a point: for each pair of surfaces the light that both reflect, once each, followed by rays over the front rim
    /// with the polarization that it takes on. A lens without losses has none.
    ///
    /// What is reflected four times is not in it, nor is light from the film, from gratings, or from surfaces between equal media.
    ///
    /// # Errors
    /// When the lens is tilted or decentered or has mirrors, gratings or an ideal lens, or the film is not behind it.
    pub fn ghosts(&self, request: &GhostRequest) -> Result<Ghosts, OpticsError> {
        let film_distance_mm = request.film_distance_mm;
        self.check_ghosts(film_distance_mm)?;
        let reflects = |i: &usize| {
            self.losses.as_ref().is_some_and(|losses| losses.surfaces()[*i].back::<f64>(false, EXACT_TERMS).is_some())
        };
        let reflecting: Vec<usize> = (0..self.n_surfaces()).filter(reflects).collect();
        // Many rays make up for the last digits of each.
        Ok(match request.n_rays > MOST_DOUBLE {
            true => self.traced::<f32>(&self.ghost_tree(film_distance_mm, false, GHOST_TERMS), request, &reflecting),
            false => self.traced::<f64>(&self.ghost_tree(film_distance_mm, false, EXACT_TERMS), request, &reflecting),
        })
    }

    /// z of the plane of the first surface's rim, mm.
    pub fn front_rim_z_mm(&self) -> f64 {
        let sag_mm = self.front().sag_at_mm(0.0, self.semi_aperture_mm(0));
        if sag_mm.is_finite() { sag_mm } else { 0.0 }
    }

    /// Checks that ghosts can be followed to a film so far behind the last vertex.
    fn check_ghosts(&self, film_distance_mm: f64) -> Result<(), OpticsError> {
        let refuse = |reason: &str| {
            let reason = format!("{}: ghosts are followed {reason}", self.name());
            Err(OpticsError::Coating { reason })
        };
        if self.placements().is_some() {
            return refuse("through centered lenses without mirrors and gratings alone");
        }
        if !self.has_plain_film() {
            return refuse("to flat films alone");
        }
        if !film_distance_mm.is_finite() {
            return refuse("to a film at a finite distance alone");
        }
        Ok(())
    }

    /// Returns the tree of all pairs for light that comes from the scene or, with `is_from_film`, from the film, which then goes to a plane so
    /// far before the first vertex.
    fn ghost_tree<T: Real>(&self, film_mm: f64, is_from_film: bool, least_terms: [f64; 4]) -> GhostTree<T> {
        let steps = self.steps_for(f64::NEG_INFINITY);
        let backward: Vec<Step> = steps.iter().map(mirrored).collect();
        let n = steps.len();
        let sides = |is_from_behind: bool| -> Vec<SideLight<T>> {
            let side = |i: usize| {
                let Some(losses) = &self.losses else { return SideLight { on: LightPass::NOTHING, back: None } };
                // Of the medium that the light comes through; not of that before the lens and behind it.
                let per_mm = match is_from_behind {
                    false if i > 0 => losses.per_mm()[i - 1],
                    true if i + 1 < n => losses.per_mm()[i],
                    _ => 0.0,
                };
                let surface = &losses.surfaces()[i];
                let back = surface.back::<T>(is_from_behind, least_terms);
                SideLight {
                    on: surface.pass(per_mm, least_terms),
                    back: back.map(|back| LightPass { per_mm: T::of(per_mm), ..back }),
                }
            };
            (0..n).map(side).collect()
        };
        if is_from_film {
            let [steps, backward] =
                [&steps[..], &backward].map(|steps| steps.iter().rev().cloned().collect::<Vec<_>>());
            let [lit, lit_back] = [true, false].map(|is_from_behind| sides(is_from_behind).into_iter().rev().collect());
            return GhostTree::new([&backward, &steps], [lit, lit_back], film_mm);
        }
        GhostTree::new([&steps, &backward], [sides(false), sides(true)], film_mm)
    }

    fn traced<T: Traced>(&self, tree: &GhostTree<T>, request: &GhostRequest, reflecting: &[usize]) -> Ghosts {
        let n = self.n_surfaces();
        let is_half = self.is_rotational() && lies_along_y(&request.point);
        let targets = self.front_targets(request, is_half);
        let weight = |target: &DVec2| match request.point {
            ObjectPoint::Infinite(_) => 1.0,
            ObjectPoint::Finite(place) => {
                let way = target.extend(request.rim_z_mm) - place;
                way.z.abs() / way.length().powi(3)
            }
        };
        let weights: Vec<f64> = targets.iter().map(weight).collect();
        let all: f64 = weights.iter().sum();
        let n_rays = weights.len();
        let at = |pair: Option<[usize; 2]>| pair.map_or(0, |[first, second]| 1 + first * n + second);
        let half_mm = request.film_half_mm.unwrap_or(DVec2::INFINITY);
        let of_chunk = |(targets, weights): (&[DVec2], &[f64])| {
            let mut sums = vec![Sums::default(); 1 + n * n];
            T::with_slices(&self.rays_towards(&request.point, targets, request.rim_z_mm, 0.0), |rays| {
                tree.trace(&rays, &mut |pair, start, [x, y, ..], shares| {
                    let here = &mut sums[at(pair)];
                    for (i, share) in shares.iter().enumerate().filter(|(_, share)| **share > 0.0) {
                        let power = share * weights[start + i];
                        let place = DVec2::new(x[i].to_f64(), y[i].to_f64());
                        here.power += power;
                        here.n_open += 1.0;
                        here.place += power * place;
                        here.square += power * place.length_squared();
                        if place.abs().cmple(half_mm).all() {
                            here.on_film += power;
                        }
                    }
                });
            });
            sums
        };
        let parts: Vec<Vec<Sums>> = targets.par_chunks(CHUNK).zip(weights.par_chunks(CHUNK)).map(of_chunk).collect();
        let mut sums = vec![Sums::default(); 1 + n * n];
        for part in &parts {
            sums.iter_mut().zip(part).for_each(|(sum, here)| sum.add(here));
        }
        let direct = sums[0].light((all, n_rays), is_half);
        let mut pairs: Vec<Ghost> = Vec::new();
        for &first in reflecting {
            for &second in reflecting.iter().take_while(|&&second| second < first) {
                let light = sums[at(Some([first, second]))].light((all, n_rays), is_half);
                if light.power > 0.0 {
                    let magnification = self.ghost_magnification(first, second, request);
                    pairs.push(Ghost { first, second, magnification, light });
                }
            }
        }
        pairs.sort_by(|a, b| b.light.power.total_cmp(&a.light.power));
        Ghosts { direct, pairs }
    }

    /// Returns places of a square grid over the front rim's circle; of half the circle at x > 0 where the other half is its mirror image.
    fn front_targets(&self, request: &GhostRequest, is_half: bool) -> Vec<DVec2> {
        let radius_mm = self.semi_aperture_mm(0);
        let n_across = (2.0 * (request.n_rays.max(1) as f64 / std::f64::consts::PI).sqrt()).ceil().max(2.0) as usize;
        let n_across = n_across.next_multiple_of(2);
        let at = |i: usize| radius_mm * ((2 * i + 1) as f64 / n_across as f64 - 1.0);
        let columns = if is_half { n_across / 2..n_across } else { 0..n_across };
        (0..n_across)
            .flat_map(|row| columns.clone().map(move |column| DVec2::new(at(column), at(row))))
            .filter(|place| place.length() <= radius_mm)
            .collect()
    }

    /// Returns how many times as far from the axis as the image a ghost's middle lies on the film: along the paraxial ray through the
    /// middle of the entrance pupil.
    fn ghost_magnification(&self, first: usize, second: usize, request: &GhostRequest) -> f64 {
        let pupil_z_mm = self.first_order().entrance_pupil_z_mm;
        let from = if pupil_z_mm.is_finite() { (-pupil_z_mm, 1.0) } else { (1.0, 0.0) };
        let steps = self.steps();
        let curvature = |i: usize| steps[i].curvature;
        let gap = |i: usize| steps[i + 1].vertex_z - steps[i].vertex_z;
        let pass = |(y, u): (f64, f64), i: usize, is_backward: bool| {
            let step = &steps[i];
            let (c, n1, n2) = match is_backward {
                false => (curvature(i), step.index_before, step.index_after),
                true => (-curvature(i), step.index_after, step.index_before),
            };
            (y, (n1 * u - (n2 - n1) * c * y) / n2)
        };
        let reflect = |(y, u): (f64, f64), c: f64| (y, u + 2.0 * c * y);
        let go = |(y, u): (f64, f64), gap: f64| (y + u * gap, u);
        let to_film = |(y, u): (f64, f64)| y + u * request.film_distance_mm;
        let forward = |mut ray: (f64, f64), from: usize| {
            for i in from..steps.len() {
                ray = pass(ray, i, false);
                if i + 1 < steps.len() {
                    ray = go(ray, gap(i));
                }
            }
            ray
        };
        let direct = to_film(forward(from, 0));
        let mut ray = from;
        for i in 0..first {
            ray = go(pass(ray, i, false), gap(i));
        }
        ray = reflect(ray, curvature(first));
        for i in (second..first).rev() {
            ray = go(ray, gap(i));
            if i > second {
                ray = pass(ray, i, true);
            }
        }
        ray = go(reflect(ray, -curvature(second)), gap(second));
        to_film(forward(ray, second + 1)) / direct
    }
}

/// A precision in which ghosts are followed.
trait Traced: Real {
    /// Hands rays on in this precision.
    fn with_slices(rays: &RayBatch, work: impl FnOnce(RaySlices<'_, Self>));
}

impl Traced for f64 {
    fn with_slices(rays: &RayBatch, work: impl FnOnce(RaySlices<'_, Self>)) {
        work(rays.clone().slices());
    }
}

impl Traced for f32 {
    fn with_slices(rays: &RayBatch, work: impl FnOnce(RaySlices<'_, Self>)) {
        work(RayBatchF32::from(rays).slices());
    }
}

/// Whether a point lies in the y–z plane.
fn lies_along_y(point: &ObjectPoint) -> bool {
    match point {
        ObjectPoint::Finite(place) => place.x == 0.0,
        ObjectPoint::Infinite(direction) => direction.x == 0.0,
    }
}
