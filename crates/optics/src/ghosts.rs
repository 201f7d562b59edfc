//! Ghosts: light that surfaces of a lens reflect on its way to the film, twice or more often, and where all of the light goes.

mod beams;
mod from_film;

use std::collections::BTreeMap;

use glam::DVec2;
use rayon::prelude::*;
use serde::Serialize;

use crate::{
    Aperture, MonoLens, ObjectPoint, OpticsError, Outline, RayBatch, RayBatchF32,
    rays::RaySlices,
    reversed::mirrored,
    trace::{GhostTree, Kind, LightPass, LightSink, Loss, Real, SideLight, Step},
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
/// Reflections of the ghosts in pictures.
const PAIR: usize = 2;
/// The most reflections that are followed.
pub const MOST_BOUNCES: usize = 12;

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
    /// The share of the light on the film that it reflects as a mirror does.
    pub film_reflectance: f64,
    /// How often light is reflected at most: an even number up to [`MOST_BOUNCES`]. What is below 1e-10 of the source's light after two reflections is
    /// followed no further.
    pub most_bounces: usize,
}

/// A film that reflects as a mirror does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MirrorFilm {
    /// Its distance behind the last vertex, mm.
    pub distance_mm: f64,
    /// The share of the light that it reflects.
    pub reflectance: f64,
    /// Half its width and height, mm.
    pub half_mm: DVec2,
    /// Its middle, mm in the lens frame.
    pub center_mm: DVec2,
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
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ghost {
    /// The surface that light is reflected at first, counted from 0: the later one of both; the film counts as the one behind the last.
    pub first: usize,
    /// The surface that it is reflected at then.
    pub second: usize,
    /// Those that it is reflected at after these two.
    pub then: Vec<usize>,
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
    /// All pairs of surfaces, and longer ways, whose light reaches the plane of the film, the brightest first.
    pub pairs: Vec<Ghost>,
}

/// Where the light goes that falls on the circle of the first surface's rim, as shares of it. They add up to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct LightAccount {
    /// On the film, whichever way, less what that reflects.
    pub film: f64,
    /// Beside the film in its plane.
    pub beside_film: f64,
    /// Out of the first surface.
    pub reflected: f64,
    /// Absorbed by glass.
    pub glass: f64,
    /// Absorbed by coatings, or reflected at surfaces between equal media, whose reflections are not followed.
    pub coatings: f64,
    /// Ended by rims, the iris and obscurations, or beside surfaces.
    pub clipped: f64,
    /// Reflected more often than was followed.
    pub beyond: f64,
}

impl LightAccount {
    /// Returns the shares in turn.
    pub fn shares(&self) -> [f64; 7] {
        let Self { film, beside_film, reflected, glass, coatings, clipped, beyond } = *self;
        [film, beside_film, reflected, glass, coatings, clipped, beyond]
    }

    fn of([film, beside_film, reflected, glass, coatings, clipped, beyond]: [f64; 7]) -> Self {
        Self { film, beside_film, reflected, glass, coatings, clipped, beyond }
    }
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
    /// Light from gratings and from surfaces between equal media is not in it.
    ///
    /// # Errors
    /// When the lens is tilted or decentered or has mirrors, gratings or an ideal lens, the film is not behind it, or the numbers of the film's
    /// reflectance and of reflections make no sense.
    pub fn ghosts(&self, request: &GhostRequest) -> Result<Ghosts, OpticsError> {
        let film = self.check_request(request)?;
        // Many rays make up for the last digits of each.
        let traced = match request.n_rays > MOST_DOUBLE {
            true => self.traced::<f32, false>(&self.ghost_tree(&film, false, GHOST_TERMS), request),
            false => self.traced::<f64, false>(&self.ghost_tree(&film, false, EXACT_TERMS), request),
        };
        let direct = traced.light(&[]);
        let ghost = |way: &Vec<u16>| {
            let light = traced.light(way);
            let way: Vec<usize> = way.iter().copied().map(usize::from).collect();
            let magnification = self.ghost_magnification(&way, request);
            Ghost { first: way[0], second: way[1], then: way[2..].to_vec(), magnification, light }
        };
        let ways = traced.ways.keys().filter(|way| !way.is_empty());
        let mut pairs: Vec<Ghost> = ways.map(ghost).filter(|ghost| ghost.light.power > 0.0).collect();
        pairs.sort_by(|a, b| b.light.power.total_cmp(&a.light.power));
        Ok(Ghosts { direct, pairs })
    }

    /// Returns where the light of a point goes that falls on the circle of the first surface's rim: what reaches the film, and what does not.
    ///
    /// # Errors
    /// As [`ghosts`](Self::ghosts).
    pub fn light_account(&self, request: &GhostRequest) -> Result<LightAccount, OpticsError> {
        let film = self.check_request(request)?;
        let traced = self.traced::<f64, true>(&self.ghost_tree(&film, false, EXACT_TERMS), request);
        Ok(LightAccount::of(traced.account.map(|power| power / traced.all)))
    }

    /// Checks a request, and returns its film.
    fn check_request(&self, request: &GhostRequest) -> Result<MirrorFilm, OpticsError> {
        let GhostRequest { film_distance_mm: distance_mm, film_reflectance: reflectance, most_bounces, .. } = *request;
        if !(2..=MOST_BOUNCES).contains(&most_bounces) || most_bounces % 2 == 1 {
            let reason = format!("{most_bounces} reflections, expected an even number from 2 to {MOST_BOUNCES}");
            return Err(OpticsError::Coating { reason });
        }
        let half_mm = request.film_half_mm.unwrap_or(DVec2::INFINITY);
        let film = MirrorFilm { distance_mm, reflectance, half_mm, center_mm: DVec2::ZERO };
        self.check_ghosts(&film)?;
        Ok(film)
    }

    /// z of the plane of the first surface's rim, mm.
    pub fn front_rim_z_mm(&self) -> f64 {
        let sag_mm = self.front().sag_at_mm(0.0, self.semi_aperture_mm(0));
        if sag_mm.is_finite() { sag_mm } else { 0.0 }
    }

    /// Checks that ghosts can be followed to a film.
    fn check_ghosts(&self, film: &MirrorFilm) -> Result<(), OpticsError> {
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
        if !film.distance_mm.is_finite() {
            return refuse("to a film at a finite distance alone");
        }
        film.check()?;
        Ok(())
    }

    /// Returns the tree of all ways for light that comes from the scene or, with `is_from_film`, from the film, which then goes to the plane of the first
    /// vertex.
    fn ghost_tree<T: Real>(&self, film: &MirrorFilm, is_from_film: bool, least_terms: [f64; 4]) -> GhostTree<T> {
        let mut steps = self.steps_for(f64::NEG_INFINITY).into_owned();
        let n = steps.len();
        let film_step = (film.reflectance > 0.0).then_some(n);
        if film_step.is_some() {
            steps.push(film.step(&steps[n - 1]));
        }
        let backward: Vec<Step> = steps.iter().map(mirrored).collect();
        let sides = |is_from_behind: bool| -> Vec<SideLight<T>> {
            let side = |i: usize| {
                if i == n {
                    let back = (!is_from_behind).then(|| LightPass::constant(T::of(film.reflectance)));
                    return SideLight { on: LightPass::NOTHING, back };
                }
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
            (0..steps.len()).map(side).collect()
        };
        if is_from_film {
            let [steps, backward] =
                [&steps[..], &backward].map(|steps| steps.iter().rev().cloned().collect::<Vec<_>>());
            let [lit, lit_back] = [true, false].map(|is_from_behind| sides(is_from_behind).into_iter().rev().collect());
            return GhostTree::new([&backward, &steps], [lit, lit_back], 0.0, film_step.map(|_| 0));
        }
        // The film that reflects is the last step.
        let film_mm = if film_step.is_some() { 0.0 } else { film.distance_mm };
        GhostTree::new([&steps, &backward], [sides(false), sides(true)], film_mm, film_step)
    }

    fn traced<T: Traced, const IS_ACCOUNT: bool>(&self, tree: &GhostTree<T>, request: &GhostRequest) -> Totals {
        let is_half = self.is_rotational() && lies_along_y(&request.point);
        let targets = on_disc(self.semi_aperture_mm(0), request.n_rays, is_half);
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
        let half_mm = request.film_half_mm.unwrap_or(DVec2::INFINITY);
        let of_chunk = |(targets, weights): (&[DVec2], &[f64])| {
            let mut tally = Tally::<IS_ACCOUNT> { weights, half_mm, ways: BTreeMap::new(), account: [0.0; 7] };
            T::with_slices(&self.rays_towards(&request.point, targets, request.rim_z_mm, 0.0), |rays| {
                tree.trace(&rays, request.most_bounces, &mut tally);
            });
            (tally.ways, tally.account)
        };
        let parts: Vec<_> = targets.par_chunks(CHUNK).zip(weights.par_chunks(CHUNK)).map(of_chunk).collect();
        let mut totals = Totals { ways: BTreeMap::new(), account: [0.0; 7], all, n_rays, is_half };
        for (part, shares) in parts {
            part.into_iter().for_each(|(way, sums)| totals.ways.entry(way).or_default().add(&sums));
            totals.account.iter_mut().zip(shares).for_each(|(sum, share)| *sum += share);
        }
        totals
    }

    /// Returns how many times as far from the axis as the image a ghost's middle lies on the film: along the paraxial ray through the
    /// middle of the entrance pupil.
    fn ghost_magnification(&self, way: &[usize], request: &GhostRequest) -> f64 {
        let pupil_z_mm = self.first_order().entrance_pupil_z_mm;
        let from = if pupil_z_mm.is_finite() { (-pupil_z_mm, 1.0) } else { (1.0, 0.0) };
        let steps = self.steps();
        // The film is a plane behind all surfaces.
        let n = steps.len();
        let curvature = |i: usize| if i == n { 0.0 } else { steps[i].curvature };
        let gap = |i: usize| match i + 1 == n {
            true => request.film_distance_mm,
            false => steps[i + 1].vertex_z - steps[i].vertex_z,
        };
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
        // From before a surface to before another one behind it.
        let forward =
            |ray: (f64, f64), from: usize, to: usize| (from..to).fold(ray, |ray, i| go(pass(ray, i, false), gap(i)));
        let (mut ray, mut before) = (from, 0);
        for both in way.chunks_exact(2) {
            let [first, second] = [both[0], both[1]];
            ray = reflect(forward(ray, before, first), curvature(first));
            for i in (second..first).rev() {
                ray = go(ray, gap(i));
                if i > second {
                    ray = pass(ray, i, true);
                }
            }
            ray = go(reflect(ray, -curvature(second)), gap(second));
            before = second + 1;
        }
        forward(ray, before, n).0 / forward(from, 0, n).0
    }
}

impl MirrorFilm {
    /// A film so far behind the last vertex that reflects nothing.
    pub fn dark(distance_mm: f64) -> Self {
        Self { distance_mm, reflectance: 0.0, half_mm: DVec2::INFINITY, center_mm: DVec2::ZERO }
    }

    fn check(&self) -> Result<(), OpticsError> {
        if (0.0..=1.0).contains(&self.reflectance) {
            return Ok(());
        }
        let reason = format!("the film's reflectance is {}, expected 0 to 1", self.reflectance);
        Err(OpticsError::Coating { reason })
    }

    /// Returns the film as a surface behind the last one.
    fn step(&self, last: &Step) -> Step {
        let outline = Outline::Rectangle { half_x_mm: self.half_mm.x, half_y_mm: self.half_mm.y };
        let aperture = Aperture { surface: 0, outline, center_mm: self.center_mm.to_array(), is_obscuration: false };
        Step {
            kind: Kind::Sphere,
            curvature: 0.0,
            index_before: last.index_after,
            vertex_z: last.vertex_z + self.distance_mm,
            semi_aperture: f64::INFINITY,
            apertures: if self.half_mm.is_finite() { vec![aperture] } else { Vec::new() },
            is_mirror: false,
            phase: None,
            ..last.clone()
        }
    }
}

/// What became of the light of all rays.
struct Totals {
    ways: BTreeMap<Vec<u16>, Sums>,
    /// As [`LightAccount`] has it.
    account: [f64; 7],
    /// The weight of all rays, their number, and whether they are half of them.
    all: f64,
    n_rays: usize,
    is_half: bool,
}

impl Totals {
    /// Returns the light that these surfaces have reflected.
    fn light(&self, way: &[u16]) -> GhostLight {
        self.ways.get(way).copied().unwrap_or_default().light((self.all, self.n_rays), self.is_half)
    }
}

/// Sums of the light of some rays, by the surfaces that have reflected it.
struct Tally<'a, const IS_ACCOUNT: bool> {
    weights: &'a [f64],
    half_mm: DVec2,
    ways: BTreeMap<Vec<u16>, Sums>,
    /// As [`LightAccount`] has it.
    account: [f64; 7],
}

impl<T: Real, const IS_ACCOUNT: bool> LightSink<T> for Tally<'_, IS_ACCOUNT> {
    const IS_ACCOUNT: bool = IS_ACCOUNT;

    fn on_film(&mut self, way: &[u16], start: usize, [x, y, ..]: [&[T]; 5], shares: &[f64]) {
        if !self.ways.contains_key(way) {
            self.ways.insert(way.to_vec(), Sums::default());
        }
        let Some(here) = self.ways.get_mut(way) else { return };
        for (i, share) in shares.iter().enumerate().filter(|(_, share)| **share > 0.0) {
            let power = share * self.weights[start + i];
            let place = DVec2::new(x[i].to_f64(), y[i].to_f64());
            here.power += power;
            here.n_open += 1.0;
            here.place += power * place;
            here.square += power * place.length_squared();
            let is_on_film = place.abs().cmple(self.half_mm).all();
            if is_on_film {
                here.on_film += power;
            }
            self.account[usize::from(!is_on_film)] += power;
        }
    }

    fn lost(&mut self, loss: Loss, start: usize, shares: &[f64]) {
        let (to, sign) = match loss {
            Loss::OffFilm => (0, -1.0),
            Loss::Reflected => (2, 1.0),
            Loss::Glass => (3, 1.0),
            Loss::Coating => (4, 1.0),
            Loss::Clipped => (5, 1.0),
            Loss::Beyond => (6, 1.0),
        };
        let weights = self.weights.iter().skip(start);
        self.account[to] += sign * weights.zip(shares).map(|(weight, share)| weight * share).sum::<f64>();
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

/// Returns about so many places of a square grid over a circle; of half of it at x > 0 where the other half is its mirror image.
fn on_disc(radius_mm: f64, n: usize, is_half: bool) -> Vec<DVec2> {
    let n_across = (2.0 * (n.max(1) as f64 / std::f64::consts::PI).sqrt()).ceil().max(2.0) as usize;
    let n_across = n_across.next_multiple_of(2);
    let at = |i: usize| radius_mm * ((2 * i + 1) as f64 / n_across as f64 - 1.0);
    let columns = if is_half { n_across / 2..n_across } else { 0..n_across };
    (0..n_across)
        .flat_map(|row| columns.clone().map(move |column| DVec2::new(at(column), at(row))))
        .filter(|place| place.length() <= radius_mm)
        .collect()
}

/// Whether a point lies in the y–z plane.
fn lies_along_y(point: &ObjectPoint) -> bool {
    match point {
        ObjectPoint::Finite(place) => place.x == 0.0,
        ObjectPoint::Infinite(direction) => direction.x == 0.0,
    }
}
