//! Batches of rays in single precision, for pictures.

use glam::{DVec3, Vec3};

use crate::{RayBatch, RayFate, rays::RaySlices};

/// Rays of one wavelength in single precision, in the lens frame: a list each of positions and direction cosines.
///
/// Enough for where rays land on the film, to a few nanometres, at twice the speed of a [`RayBatch`]; never for path
/// lengths, of which single precision holds no fraction of a wave. To keep those digits a ray must start near the
/// first vertex, so a batch is made from rays in double precision, which it first moves there.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct RayBatchF32 {
    /// x of each ray's point, mm.
    pub x_mm: Vec<f32>,
    /// y of each ray's point, mm.
    pub y_mm: Vec<f32>,
    /// z of each ray's point from the first vertex, mm.
    pub z_mm: Vec<f32>,
    /// x of each unit direction.
    pub l: Vec<f32>,
    /// y of each unit direction.
    pub m: Vec<f32>,
    /// z of each unit direction.
    pub n: Vec<f32>,
    /// How each ray ended, or that it has not.
    pub fate: Vec<RayFate>,
}

impl From<&RayBatch> for RayBatchF32 {
    /// Moves each ray in flight to where it passes nearest to the first vertex, and rounds it. For rays that have not
    /// met a surface yet.
    fn from(rays: &RayBatch) -> Self {
        let mut batch = Self::default();
        batch.set(rays);
        batch
    }
}

impl RayBatchF32 {
    /// Makes this the batch of these rays, as [`From`] does, in the room that it has.
    pub fn set(&mut self, rays: &RayBatch) {
        self.set_rounded(rays, |point_mm, direction| point_mm - direction * point_mm.dot(direction));
    }

    /// Adds a ray in flight, rounded as it stands: for rays that start near the lens.
    pub fn push(&mut self, point_mm: DVec3, direction: DVec3) {
        let (point_mm, direction) = (point_mm.as_vec3(), direction.as_vec3());
        self.x_mm.push(point_mm.x);
        self.y_mm.push(point_mm.y);
        self.z_mm.push(point_mm.z);
        self.l.push(direction.x);
        self.m.push(direction.y);
        self.n.push(direction.z);
        self.fate.push(RayFate::InFlight);
    }

    /// Rounds rays, those in flight from another point of their lines.
    pub(crate) fn set_rounded(&mut self, rays: &RayBatch, move_mm: impl Fn(DVec3, DVec3) -> DVec3) {
        let lists = [&mut self.x_mm, &mut self.y_mm, &mut self.z_mm, &mut self.l, &mut self.m, &mut self.n];
        for list in lists {
            list.resize(rays.len(), 0.0);
        }
        self.fate.clone_from(&rays.fate);
        for i in 0..rays.len() {
            let (point_mm, direction) = (rays.point_mm(i), rays.direction(i));
            let place_mm = if rays.fate[i].is_in_flight() { move_mm(point_mm, direction) } else { point_mm };
            (self.x_mm[i], self.y_mm[i], self.z_mm[i]) = place_mm.as_vec3().into();
            (self.l[i], self.m[i], self.n[i]) = direction.as_vec3().into();
        }
    }

    /// Returns the same rays in double precision, of path length 0.
    pub(crate) fn widened(&self) -> RayBatch {
        let mut wide = RayBatch::with_capacity(self.len());
        for i in 0..self.len() {
            let point_mm = Vec3::new(self.x_mm[i], self.y_mm[i], self.z_mm[i]);
            wide.push(point_mm.as_dvec3(), Vec3::new(self.l[i], self.m[i], self.n[i]).as_dvec3(), 0.0);
        }
        wide.fate.clone_from(&self.fate);
        wide
    }

    /// The number of rays, ended ones included.
    pub fn len(&self) -> usize {
        self.fate.len()
    }

    /// Whether there are no rays.
    pub fn is_empty(&self) -> bool {
        self.fate.is_empty()
    }

    /// The number of rays still in flight.
    pub fn n_in_flight(&self) -> usize {
        self.fate.iter().filter(|fate| fate.is_in_flight()).count()
    }

    pub(crate) fn slices(&mut self) -> RaySlices<'_, f32> {
        RaySlices {
            x: &mut self.x_mm,
            y: &mut self.y_mm,
            z: &mut self.z_mm,
            l: &mut self.l,
            m: &mut self.m,
            n: &mut self.n,
            opl: &mut [],
            fate: &mut self.fate,
        }
    }
}
