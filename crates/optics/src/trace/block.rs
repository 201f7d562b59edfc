//! Blocks of rays, lane by lane, and their way out of and back into a batch.

use super::{crossing::Ray, real::Real};
use crate::{RayFate, rays::RaySlices};

/// Rays in a block: a few vectors of any kind in use, so that one can wait while the others compute.
pub(super) const LANES: usize = 16;

/// Some rays; z is from the vertex of the last surface met.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block<T: Real, const N: usize = LANES> {
    pub(super) x: [T; N],
    pub(super) y: [T; N],
    pub(super) z: [T; N],
    pub(super) l: [T; N],
    pub(super) m: [T; N],
    pub(super) n: [T; N],
    pub(super) opl: [T; N],
    /// Whether the ray is in flight.
    pub(super) alive: [T::Mask; N],
    /// Whether the crossing, if finite, was of the right sheet of the last surface.
    pub(super) front: [T::Mask; N],
}

impl<T: Real, const N: usize> Block<T, N> {
    /// Rays along the axis, none in flight.
    pub(super) const EMPTY: Self = Self {
        x: [T::ZERO; N],
        y: [T::ZERO; N],
        z: [T::ZERO; N],
        l: [T::ZERO; N],
        m: [T::ZERO; N],
        n: [T::ONE; N],
        opl: [T::ZERO; N],
        alive: [T::NO; N],
        front: [T::NO; N],
    };

    /// A ray, with z from a vertex that lies further along by `shift`.
    #[inline(always)]
    pub(super) fn ray(&self, i: usize, shift: T) -> Ray<T> {
        let (x, y, z) = (self.x[i], self.y[i], self.z[i] - shift);
        Ray { x, y, z, l: self.l[i], m: self.m[i], n: self.n[i], opl: self.opl[i] }
    }

    #[inline(always)]
    pub(super) fn set(&mut self, i: usize, ray: &Ray<T>) {
        (self.x[i], self.y[i], self.z[i]) = (ray.x, ray.y, ray.z);
        (self.l[i], self.m[i], self.n[i]) = (ray.l, ray.m, ray.n);
        self.opl[i] = ray.opl;
    }

    pub(super) fn is_any_alive(&self) -> bool {
        self.alive.iter().fold(T::NO, |any, &alive| any | alive) != T::NO
    }

    fn is_all_alive(&self) -> bool {
        self.alive.iter().fold(T::YES, |all, &alive| all & alive) == T::YES
    }
}

impl<T: Real> Block<T> {
    /// Reads the rays from `start` on, with z from `vertex_z`; lanes without a ray hold one that has ended.
    pub(super) fn load(rays: &RaySlices<'_, T>, start: usize, vertex_z: T) -> Self {
        let mut block = Self::EMPTY;
        let n = LANES.min(rays.fate.len() - start);
        for (alive, fate) in block.alive.iter_mut().zip(&rays.fate[start..start + n]) {
            *alive = T::mask(fate.is_in_flight());
        }
        let take = |lanes: &mut [T; LANES], list: &[T]| lanes[..n].copy_from_slice(&list[start..start + n]);
        take(&mut block.x, rays.x);
        take(&mut block.y, rays.y);
        take(&mut block.z, rays.z);
        take(&mut block.l, rays.l);
        take(&mut block.m, rays.m);
        take(&mut block.n, rays.n);
        if T::HAS_PATH {
            take(&mut block.opl, rays.opl);
        }
        for z in &mut block.z {
            *z -= vertex_z;
        }
        block
    }

    /// Writes the rays that are still in flight; the others have been written where they ended.
    pub(super) fn store(&self, vertex_z: T, rays: &mut RaySlices<'_, T>, start: usize) {
        let n = LANES.min(rays.fate.len() - start);
        if n == LANES && self.is_all_alive() {
            let put = |list: &mut [T], lanes: &[T; LANES]| list[start..start + LANES].copy_from_slice(lanes);
            put(rays.x, &self.x);
            put(rays.y, &self.y);
            put(rays.z, &self.z.map(|z| z + vertex_z));
            put(rays.l, &self.l);
            put(rays.m, &self.m);
            put(rays.n, &self.n);
            if T::HAS_PATH {
                put(rays.opl, &self.opl);
            }
            return;
        }
        for i in (0..n).filter(|&i| self.alive[i] != T::NO) {
            rays.put(start + i, &self.ray(i, -vertex_z));
        }
    }
}

impl<T: Real> RaySlices<'_, T> {
    fn put(&mut self, i: usize, ray: &Ray<T>) {
        (self.x[i], self.y[i], self.z[i]) = (ray.x, ray.y, ray.z);
        (self.l[i], self.m[i], self.n[i]) = (ray.l, ray.m, ray.n);
        if T::HAS_PATH {
            self.opl[i] = ray.opl;
        }
    }

    /// Writes a ray where it ended.
    pub(super) fn end(&mut self, i: usize, ray: &Ray<T>, fate: RayFate) {
        self.put(i, ray);
        self.fate[i] = fate;
    }
}
