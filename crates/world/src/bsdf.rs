//! How one point of a surface scatters light.

use glam::Vec3;
use std::f32::consts::{FRAC_1_PI, PI};

use crate::sampling::{Frame, cosine_hemisphere};

/// The scattering function of one point of a surface, for light that leaves it in one direction, at `N` wavelengths.
///
/// Directions are in the frame of the world, of length 1, and point away from the surface: `outgoing` to where the
/// light goes (the camera), `incident` to where it comes from (the light). The functions are those of radiance: light
/// that enters a medium of index n spreads its radiance by n².
#[derive(Clone, Debug)]
pub struct Bsdf<const N: usize> {
    frame: Frame,
    geometric_normal: Vec3,
    outgoing: Vec3,
    lobe: Lobe<N>,
}

#[derive(Clone, Debug)]
pub(crate) enum Lobe<const N: usize> {
    Diffuse { reflectance: [f32; N] },
}

/// A direction drawn from a [`Bsdf`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample<const N: usize> {
    /// Where the light comes from.
    pub incident: Vec3,
    /// The function times the cosine over the density: what the radiance from there is multiplied by.
    pub weight: [f32; N],
    /// The density over solid angle, 1/sr; for a mirror direction (`is_delta`) the probability.
    pub pdf: f32,
    /// Whether no other direction is near it: a mirror or smooth refraction, which sampling of lights can't find.
    pub is_delta: bool,
    /// Whether the direction holds for the first wavelength alone; the weights of the others are then 0.
    pub is_dispersed: bool,
}

impl<const N: usize> Bsdf<N> {
    pub(crate) fn new(frame: Frame, geometric_normal: Vec3, outgoing: Vec3, lobe: Lobe<N>) -> Self {
        Self { frame, geometric_normal, outgoing, lobe }
    }

    /// Returns the scattering function times the cosine of the angle between `incident` and the shading normal, 1/sr.
    ///
    /// Mirror directions count as 0: they are found by [`sample`](Self::sample) alone.
    pub fn eval(&self, incident: Vec3) -> [f32; N] {
        let (o, i) = (self.frame.to_local(self.outgoing), self.frame.to_local(incident));
        if !self.is_reflection(incident) || o.z * i.z <= 0.0 {
            return [0.0; N];
        }
        match &self.lobe {
            Lobe::Diffuse { reflectance } => reflectance.map(|r| r * FRAC_1_PI * i.z.abs()),
        }
    }

    /// Returns the density, 1/sr, with which [`sample`](Self::sample) draws a direction, mirror directions left out.
    pub fn pdf(&self, incident: Vec3) -> f32 {
        let (o, i) = (self.frame.to_local(self.outgoing), self.frame.to_local(incident));
        if o.z * i.z <= 0.0 { 0.0 } else { i.z.abs() / PI }
    }

    /// Draws the direction that light comes from; `None` where the light ends here.
    ///
    /// The numbers are in [0, 1).
    pub fn sample(&self, _u_lobe: f32, u: [f32; 2]) -> Option<BsdfSample<N>> {
        let o = self.frame.to_local(self.outgoing);
        let mut i = cosine_hemisphere(u);
        if o.z < 0.0 {
            i.z = -i.z;
        }
        let incident = self.frame.to_world(i);
        let pdf = self.pdf(incident);
        if pdf <= 0.0 {
            return None;
        }
        let weight = self.eval(incident).map(|f| f / pdf);
        Some(BsdfSample { incident, weight, pdf, is_delta: false, is_dispersed: false })
    }

    /// Whether light is only mirrored or refracted, so that sampling lights finds nothing.
    pub fn is_delta(&self) -> bool {
        false
    }

    /// Whether directions depend on the wavelength, so that a packet must be taken apart before it goes on.
    pub fn is_dispersive(&self) -> bool {
        false
    }

    /// Returns the share of the light that the surface gives back in all directions, roughly: for albedo pictures.
    pub fn albedo(&self) -> [f32; N] {
        match &self.lobe {
            Lobe::Diffuse { reflectance } => *reflectance,
        }
    }

    /// The shading normal, bumps included, of length 1.
    pub fn normal(&self) -> Vec3 {
        self.frame.z
    }

    fn is_reflection(&self, incident: Vec3) -> bool {
        self.geometric_normal.dot(incident) * self.geometric_normal.dot(self.outgoing) > 0.0
    }
}
