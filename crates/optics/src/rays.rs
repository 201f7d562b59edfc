//! Batches of rays, kept as a structure of arrays.

use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Rays that a thread makes in one go: about .4 MB of them, which stay in its cache.
const MADE_AT_ONCE: usize = 8192;

/// How a ray ended, or that it has not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
pub enum RayFate {
    /// The ray is on its way.
    #[default]
    InFlight,
    /// The ray met a surface outside its rim, and ended there.
    Vignetted {
        /// 0-based surface.
        surface: u16,
    },
    /// The ray passed a surface without meeting it; it is left on its line, before that surface.
    Missed {
        /// 0-based surface; a curved film counts as the one after the last.
        surface: u16,
    },
    /// The ray was totally reflected, and ended on that surface.
    TotalReflection {
        /// 0-based surface.
        surface: u16,
    },
}

impl RayFate {
    /// Whether the ray is still on its way.
    pub fn is_in_flight(self) -> bool {
        self == Self::InFlight
    }

    /// The surface that ended the ray.
    pub fn surface(self) -> Option<usize> {
        match self {
            Self::InFlight => None,
            Self::Vignetted { surface } | Self::Missed { surface } | Self::TotalReflection { surface } => {
                Some(surface.into())
            }
        }
    }
}

/// Rays of one wavelength, in the lens frame: a list each of positions, direction cosines and path lengths.
///
/// All lists have the same length. Tracing moves each ray in flight to where it meets a surface and turns it there;
/// a ray that ends stays where it ended.
#[derive(Debug, PartialEq)]
pub struct RayBatch {
    /// x of each ray's point, mm.
    pub x_mm: Vec<f64>,
    /// y of each ray's point, mm.
    pub y_mm: Vec<f64>,
    /// z of each ray's point from the first vertex, mm.
    pub z_mm: Vec<f64>,
    /// x of each unit direction.
    pub l: Vec<f64>,
    /// y of each unit direction.
    pub m: Vec<f64>,
    /// z of each unit direction.
    pub n: Vec<f64>,
    /// Optical path length gathered so far, mm.
    pub opl_mm: Vec<f64>,
    /// How each ray ended, or that it has not.
    pub fate: Vec<RayFate>,
    /// z of the object plane that the rays come from, mm; −∞ where it is far away.
    ///
    /// Only the path length through an ideal lens needs it: no lens delays the light of every object plane rightly.
    pub object_z_mm: f64,
}

impl Clone for RayBatch {
    fn clone(&self) -> Self {
        let mut rays = Self::with_capacity(self.len());
        rays.clone_from(self);
        rays
    }

    /// Copies rays into the lists that stand, so that a batch traced again and again needs no new memory.
    fn clone_from(&mut self, source: &Self) {
        let Self { x_mm, y_mm, z_mm, l, m, n, opl_mm, fate, object_z_mm } = source;
        self.x_mm.clone_from(x_mm);
        self.y_mm.clone_from(y_mm);
        self.z_mm.clone_from(z_mm);
        self.l.clone_from(l);
        self.m.clone_from(m);
        self.n.clone_from(n);
        self.opl_mm.clone_from(opl_mm);
        self.fate.clone_from(fate);
        self.object_z_mm = *object_z_mm;
    }
}

impl Default for RayBatch {
    fn default() -> Self {
        Self::with_capacity(0)
    }
}

impl RayBatch {
    /// Returns an empty batch with room for this many rays.
    pub fn with_capacity(n_rays: usize) -> Self {
        let list = || Vec::with_capacity(n_rays);
        let fate = Vec::with_capacity(n_rays);
        let object_z_mm = f64::NEG_INFINITY;
        Self {
            x_mm: list(),
            y_mm: list(),
            z_mm: list(),
            l: list(),
            m: list(),
            n: list(),
            opl_mm: list(),
            fate,
            object_z_mm,
        }
    }

    /// Returns rays from these points along these unit directions, of path length 0.
    pub fn from_points(points_mm: &[DVec3], directions: &[DVec3]) -> Self {
        assert_eq!(points_mm.len(), directions.len(), "a direction for each point");
        let mut batch = Self::with_capacity(points_mm.len());
        for (&point, &direction) in points_mm.iter().zip(directions) {
            batch.push(point, direction, 0.0);
        }
        batch
    }

    /// Returns `n_rays` rays in flight, of path length 0, each from its point (mm) along its unit direction as `ray` has them for
    /// its number, made on the threads of the current rayon pool.
    ///
    /// # Errors
    ///
    /// That of the first ray, in order, for which `ray` fails.
    pub fn try_from_fn<E: Send>(
        n_rays: usize,
        ray: impl Fn(usize) -> Result<(DVec3, DVec3), E> + Sync,
    ) -> Result<Self, E> {
        let list = || vec![0.0; n_rays];
        let mut batch = Self {
            x_mm: list(),
            y_mm: list(),
            z_mm: list(),
            l: list(),
            m: list(),
            n: list(),
            opl_mm: list(),
            fate: rayon::iter::repeat_n(RayFate::InFlight, n_rays).collect(),
            object_z_mm: f64::NEG_INFINITY,
        };
        let fill = |(chunk, mut rays): (usize, RaySlices<'_>)| {
            let first = chunk * MADE_AT_ONCE;
            (0..rays.fate.len()).find_map(|i| {
                let made = ray(first + i).map(|(point_mm, direction)| {
                    rays.set_point(i, point_mm);
                    rays.set_direction(i, direction);
                });
                made.err()
            })
        };
        match batch.par_slices(MADE_AT_ONCE).enumerate().find_map_first(fill) {
            Some(error) => Err(error),
            None => Ok(batch),
        }
    }

    /// Adds a ray in flight; the direction must be of unit length.
    pub fn push(&mut self, point_mm: DVec3, direction: DVec3, opl_mm: f64) {
        self.x_mm.push(point_mm.x);
        self.y_mm.push(point_mm.y);
        self.z_mm.push(point_mm.z);
        self.l.push(direction.x);
        self.m.push(direction.y);
        self.n.push(direction.z);
        self.opl_mm.push(opl_mm);
        self.fate.push(RayFate::InFlight);
    }

    /// The number of rays, ended ones included.
    pub fn len(&self) -> usize {
        self.fate.len()
    }

    /// Whether there are no rays.
    pub fn is_empty(&self) -> bool {
        self.fate.is_empty()
    }

    /// The point of a ray, mm.
    pub fn point_mm(&self, ray: usize) -> DVec3 {
        DVec3::new(self.x_mm[ray], self.y_mm[ray], self.z_mm[ray])
    }

    /// The unit direction of a ray.
    pub fn direction(&self, ray: usize) -> DVec3 {
        DVec3::new(self.l[ray], self.m[ray], self.n[ray])
    }

    /// Turns a ray to a new unit direction.
    pub fn set_direction(&mut self, ray: usize, direction: DVec3) {
        (self.l[ray], self.m[ray], self.n[ray]) = direction.into();
    }

    /// The number of rays still in flight.
    pub fn n_in_flight(&self) -> usize {
        self.fate.iter().filter(|fate| fate.is_in_flight()).count()
    }

    /// Counts the fates of the rays: a row for each surface that ended any.
    pub fn losses(&self) -> Losses {
        let mut losses = Losses::default();
        for &fate in &self.fate {
            let Some(surface) = fate.surface() else {
                losses.n_in_flight += 1;
                continue;
            };
            if losses.by_surface.len() <= surface {
                losses.by_surface.resize(surface + 1, SurfaceLosses::default());
            }
            let row = &mut losses.by_surface[surface];
            match fate {
                RayFate::InFlight => {}
                RayFate::Vignetted { .. } => row.n_vignetted += 1,
                RayFate::Missed { .. } => row.n_missed += 1,
                RayFate::TotalReflection { .. } => row.n_totally_reflected += 1,
            }
        }
        losses
    }

    /// Makes room for exactly this many rays; those that are new are not set.
    pub(crate) fn resize(&mut self, n_rays: usize) {
        let position = [&mut self.x_mm, &mut self.y_mm, &mut self.z_mm];
        for list in position.into_iter().chain([&mut self.l, &mut self.m, &mut self.n, &mut self.opl_mm]) {
            list.resize(n_rays, 0.0);
        }
        self.fate.resize(n_rays, RayFate::InFlight);
    }

    pub(crate) fn slices(&mut self) -> RaySlices<'_> {
        RaySlices {
            x: &mut self.x_mm,
            y: &mut self.y_mm,
            z: &mut self.z_mm,
            l: &mut self.l,
            m: &mut self.m,
            n: &mut self.n,
            opl: &mut self.opl_mm,
            fate: &mut self.fate,
        }
    }

    /// Returns the rays in chunks of this many, for threads to share.
    pub(crate) fn par_slices(&mut self, n_rays: usize) -> impl IndexedParallelIterator<Item = RaySlices<'_>> {
        let position = triples(&mut self.x_mm, &mut self.y_mm, &mut self.z_mm, n_rays);
        let direction = triples(&mut self.l, &mut self.m, &mut self.n, n_rays);
        let rest = self.opl_mm.par_chunks_mut(n_rays).zip(self.fate.par_chunks_mut(n_rays));
        position.zip(direction).zip(rest).map(|(((x, y, z), (l, m, n)), (opl, fate))| RaySlices {
            x,
            y,
            z,
            l,
            m,
            n,
            opl,
            fate,
        })
    }
}

/// The lists of a batch, or of some of its rays.
pub(crate) struct RaySlices<'a, T = f64> {
    pub(crate) x: &'a mut [T],
    pub(crate) y: &'a mut [T],
    pub(crate) z: &'a mut [T],
    pub(crate) l: &'a mut [T],
    pub(crate) m: &'a mut [T],
    pub(crate) n: &'a mut [T],
    pub(crate) opl: &'a mut [T],
    pub(crate) fate: &'a mut [RayFate],
}

impl RaySlices<'_> {
    pub(crate) fn reborrow(&mut self) -> RaySlices<'_> {
        let Self { x, y, z, l, m, n, opl, fate } = self;
        RaySlices { x, y, z, l, m, n, opl, fate }
    }

    pub(crate) fn point(&self, i: usize) -> DVec3 {
        DVec3::new(self.x[i], self.y[i], self.z[i])
    }

    pub(crate) fn set_point(&mut self, i: usize, point: DVec3) {
        (self.x[i], self.y[i], self.z[i]) = point.into();
    }

    pub(crate) fn direction(&self, i: usize) -> DVec3 {
        DVec3::new(self.l[i], self.m[i], self.n[i])
    }

    pub(crate) fn set_direction(&mut self, i: usize, direction: DVec3) {
        (self.l[i], self.m[i], self.n[i]) = direction.into();
    }
}

type Triple<'a> = (&'a mut [f64], &'a mut [f64], &'a mut [f64]);

fn triples<'a>(
    a: &'a mut [f64],
    b: &'a mut [f64],
    c: &'a mut [f64],
    n: usize,
) -> impl IndexedParallelIterator<Item = Triple<'a>> {
    a.par_chunks_mut(n).zip(b.par_chunks_mut(n)).zip(c.par_chunks_mut(n)).map(|((a, b), c)| (a, b, c))
}

/// How many rays a batch has lost, and where.
#[derive(Clone, Debug, PartialEq, Eq, Default, Serialize)]
pub struct Losses {
    /// Rays still in flight.
    pub n_in_flight: usize,
    /// Losses at each surface, as far as the last that lost any.
    pub by_surface: Vec<SurfaceLosses>,
}

/// How many rays one surface has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize)]
pub struct SurfaceLosses {
    /// Rays outside its rim.
    pub n_vignetted: usize,
    /// Rays that did not meet it.
    pub n_missed: usize,
    /// Rays that it reflected totally.
    pub n_totally_reflected: usize,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ray of this number, unlike any other.
    fn numbered(ray: usize) -> (DVec3, DVec3) {
        let x = ray as f64;
        (DVec3::new(x, -x, 0.5 * x), DVec3::new(x, 1.0, -2.0).normalize())
    }

    #[test]
    fn rays_made_in_parallel_are_those_made_in_order() {
        for n_rays in [0, 1, MADE_AT_ONCE, 3 * MADE_AT_ONCE + 17] {
            let made = RayBatch::try_from_fn(n_rays, |ray| Ok::<_, ()>(numbered(ray))).expect("no ray fails");
            let (points_mm, directions): (Vec<_>, Vec<_>) = (0..n_rays).map(numbered).unzip();
            let listed = RayBatch::from_points(&points_mm, &directions);
            assert_eq!(made.len(), n_rays);
            for (list, expected) in [
                (&made.x_mm, &listed.x_mm),
                (&made.y_mm, &listed.y_mm),
                (&made.z_mm, &listed.z_mm),
                (&made.l, &listed.l),
                (&made.m, &listed.m),
                (&made.n, &listed.n),
                (&made.opl_mm, &listed.opl_mm),
            ] {
                assert_eq!(list, expected);
            }
            assert_eq!((made.fate, made.object_z_mm), (listed.fate, listed.object_z_mm));
        }
    }

    #[test]
    fn the_first_ray_that_fails_is_named() {
        let failing = |ray| if ray % (2 * MADE_AT_ONCE) == MADE_AT_ONCE + 5 { Err(ray) } else { Ok(numbered(ray)) };
        assert_eq!(RayBatch::try_from_fn(9 * MADE_AT_ONCE, failing).err(), Some(MADE_AT_ONCE + 5));
        assert!(RayBatch::try_from_fn(MADE_AT_ONCE, failing).is_ok());
    }
}
