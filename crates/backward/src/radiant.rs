//! Scenes whose light is known along every ray, beside worlds in which it is followed.

use std::fmt;

use dioptric_world::{Ray, World, glam::Vec3};

use crate::Sampler;

/// A scene that tells the radiance along any ray by itself: light that was followed before, or is known by formula.
pub trait RadiantScene: fmt::Debug + Sync {
    /// Adds to `radiance` an estimate without bias of the spectral radiance at each of some wavelengths (nm) that comes along a ray to its
    /// origin, W m⁻² sr⁻¹ nm⁻¹; what it draws, it draws from `random`.
    fn add_radiance(&self, ray: &Ray, wavelengths_nm: &[f32], random: &Sampler, radiance: &mut [f32]);

    /// Returns what a ray meets first, with its albedo at some wavelengths (nm); none where it meets nothing.
    fn look(&self, ray: &Ray, wavelengths_nm: &[f32]) -> Option<RadiantPoint>;
}

/// A point of a surface that a ray meets.
#[derive(Clone, Debug, PartialEq)]
pub struct RadiantPoint {
    /// The point, m, in the frame of the world.
    pub point: Vec3,
    /// The normal, of length 1, turned to where the ray comes from.
    pub normal: Vec3,
    /// The number of the material, from 0.
    pub material: u32,
    /// The number of the group that the shape belongs to, from 0, if any.
    pub instance: Option<u32>,
    /// The number of the shape, from 0.
    pub shape: u32,
    /// The share of light that it gives back, at each wavelength.
    pub albedo: Vec<f32>,
}

/// What stands before a camera.
#[derive(Clone, Copy, Debug)]
pub enum Subject<'a> {
    /// A world, in which light is followed.
    World(&'a World),
    /// A scene that knows its light.
    Radiant(&'a dyn RadiantScene),
}

impl<'a> From<&'a World> for Subject<'a> {
    fn from(world: &'a World) -> Self {
        Self::World(world)
    }
}

impl<'a> From<&'a dyn RadiantScene> for Subject<'a> {
    fn from(scene: &'a dyn RadiantScene) -> Self {
        Self::Radiant(scene)
    }
}

impl Subject<'_> {
    /// Returns the point that a ray meets first, m; none where it meets nothing.
    pub(crate) fn first_point(&self, ray: &Ray) -> Option<Vec3> {
        match self {
            Self::World(world) => world.intersect(ray, f32::INFINITY).map(|hit| hit.point),
            Self::Radiant(scene) => scene.look(ray, &[]).map(|seen| seen.point),
        }
    }
}
