//! A scattering function taken apart: what scatters evenly, what is gloss, and what mirrors or lets through.

use std::f32::consts::{FRAC_2_PI, PI};

use dioptric_spectrum::lanes;
use glam::Vec3;

use super::{Bsdf, Lobe, fresnel, refract, substrate_base};

impl<const N: usize> Bsdf<N> {
    /// Returns the share of even light that is scattered back alike in all directions; what a rough matte surface and the base of
    /// glTF's materials scatter is counted as such, by its mean over the directions of light. Under an irradiance E it is E times this over π that is sent
    /// out, where E is counted with [`diffuse_weight`](Self::diffuse_weight).
    pub fn diffuse_reflectance(&self) -> [f32; N] {
        let cos = self.frame.to_local(self.outgoing).z.abs();
        let mut sum = [0.0; N];
        for (factor, lobe) in self.lobes() {
            let reflectance = lobe.diffuse_reflectance(cos);
            sum = lanes(|lane| sum[lane] + factor.share * reflectance[lane]);
        }
        sum
    }

    /// Returns what irradiance from a direction counts for what is scattered evenly, relative to its mean over all directions: 1 but under a
    /// coat, which lets in less at grazing angles.
    pub fn diffuse_weight(&self, incident: Vec3) -> f32 {
        let cos = self.frame.to_local(incident).z.abs();
        let (mut sum, mut shares) = (0.0, 0.0);
        for (factor, lobe) in self.lobes() {
            let (weight, of) = match lobe {
                Lobe::Diffuse { .. } | Lobe::RoughDiffuse { .. } | Lobe::Layered { .. } | Lobe::Filmed { .. } => {
                    (1.0, factor.share)
                }
                Lobe::Substrate { .. } => (PI * substrate_base(1.0, cos) / base_seen(1.0), factor.share),
                Lobe::Coated { index, inside, .. } => {
                    let let_in = 1.0 - fresnel::dielectric(cos, index[0]);
                    (let_in / (index[0] * index[0] * (1.0 - inside[0])), factor.share)
                }
                _ => continue,
            };
            sum += of * weight;
            shares += of;
        }
        if shares > 0.0 { sum / shares } else { 1.0 }
    }

    /// Returns the part that is neither that nor a mirror: gloss, without what is below a coat, and what comes through evenly. `None` where there
    /// is none.
    pub fn gloss(&self) -> Option<Self> {
        let mut gloss = Self::new(self.frame, self.geometric_normal, self.outgoing);
        for (factor, lobe) in self.lobes() {
            let gloss_of = match *lobe {
                Lobe::Coated { index, inside, rough: rough @ Some(_), .. } => {
                    Lobe::Coated { diffuse: [0.0; N], index, inside, rough }
                }
                Lobe::Layered { mirrored, edge, lost, rough: rough @ Some(_), .. } => {
                    Lobe::Layered { diffuse: [0.0; N], mirrored, edge, lost, rough }
                }
                Lobe::Filmed { base, waves, index, rough: rough @ Some(_), .. } => {
                    Lobe::Filmed { diffuse: [0.0; N], base, waves, index, rough }
                }
                Lobe::Substrate { mirrored, rough: rough @ Some(_), .. } => {
                    Lobe::Substrate { diffuse: [0.0; N], mirrored, rough }
                }
                Lobe::Diffuse { transmittance, .. } if transmittance.iter().any(|&t| t > 0.0) => {
                    Lobe::Diffuse { reflectance: [0.0; N], transmittance }
                }
                Lobe::Velvet { .. }
                | Lobe::Hair(_)
                | Lobe::Mirror { rough: Some(_), .. }
                | Lobe::Glossy { rough: Some(_), .. }
                | Lobe::Metal { rough: Some(_), .. }
                | Lobe::Pane { rough: Some(_), .. }
                | Lobe::Dielectric { rough: Some(_), .. } => *lobe,
                Lobe::Diffuse { .. }
                | Lobe::RoughDiffuse { .. }
                | Lobe::Mirror { .. }
                | Lobe::Glossy { .. }
                | Lobe::Metal { .. }
                | Lobe::Pane { .. }
                | Lobe::Dielectric { .. }
                | Lobe::Coated { .. }
                | Lobe::Layered { .. }
                | Lobe::Filmed { .. }
                | Lobe::Substrate { .. }
                | Lobe::Open => continue,
            };
            gloss.push_with(*factor, gloss_of);
        }
        (!gloss.lobes.is_empty()).then_some(gloss)
    }

    /// Returns the directions that light is mirrored from or let through from without any spread, each with what its radiance is
    /// multiplied by. Glass refracts all wavelengths as the first.
    pub fn mirrors(&self) -> Vec<(Vec3, [f32; N])> {
        let o = self.frame.to_local(self.outgoing);
        let mut mirrors = Vec::new();
        let mut add = |share: f32, incident: Vec3, value: [f32; N]| {
            let incident = self.frame.to_world(incident).normalize();
            if self.local(incident).is_some() {
                mirrors.push((incident, lanes(|lane| share * value[lane])));
            }
        };
        for (factor, lobe) in self.lobes() {
            match lobe {
                Lobe::Dielectric { index, reflectance, transmittance, rough: None } => {
                    let eta: [f32; N] = lanes(|lane| if o.z > 0.0 { index[lane] } else { 1.0 / index[lane] });
                    let mirrored = fresnel::dielectrics(o.z.abs(), &eta);
                    let value = lanes(|lane| reflectance[lane] * mirrored[lane]);
                    add(factor.share, Vec3::new(-o.x, -o.y, o.z), value);
                    if let Some(through) = refract(o, Vec3::Z * o.z.signum(), eta[0]) {
                        let value =
                            lanes(|lane| transmittance[lane] * (1.0 - mirrored[lane]) / (eta[lane] * eta[lane]));
                        add(factor.share, through, value);
                    }
                }
                Lobe::Pane { reflectance, transmittance, rough: None } => {
                    add(factor.share, Vec3::new(-o.x, -o.y, o.z), *reflectance);
                    add(factor.share, -o, *transmittance);
                }
                Lobe::Mirror { rough: None, .. }
                | Lobe::Glossy { rough: None, .. }
                | Lobe::Metal { rough: None, .. }
                | Lobe::Coated { rough: None, .. }
                | Lobe::Layered { rough: None, .. }
                | Lobe::Filmed { rough: None, .. }
                | Lobe::Substrate { rough: None, .. }
                | Lobe::Open => {
                    if let Some(mirrored) = lobe.mirrored(o, 0.0) {
                        add(factor.share, mirrored.incident, mirrored.value);
                    }
                }
                Lobe::Diffuse { .. }
                | Lobe::RoughDiffuse { .. }
                | Lobe::Velvet { .. }
                | Lobe::Mirror { .. }
                | Lobe::Glossy { .. }
                | Lobe::Metal { .. }
                | Lobe::Pane { .. }
                | Lobe::Dielectric { .. }
                | Lobe::Coated { .. }
                | Lobe::Layered { .. }
                | Lobe::Filmed { .. }
                | Lobe::Hair(_)
                | Lobe::Substrate { .. } => {}
            }
        }
        mirrors
    }
}

impl<const N: usize> Lobe<N> {
    fn diffuse_reflectance(&self, cos: f32) -> [f32; N] {
        match self {
            Self::Diffuse { reflectance, .. } => *reflectance,
            Self::Coated { diffuse, index, inside, .. } => {
                let mirrored = fresnel::dielectrics(cos, index);
                lanes(|lane| {
                    let below = diffuse[lane] * (1.0 - inside[lane]) / (1.0 - diffuse[lane] * inside[lane]);
                    (1.0 - mirrored[lane]) * below
                })
            }
            Self::RoughDiffuse { reflectance, constants: [a, b] } => {
                let shape = a + b * rough_matte_mean(cos);
                lanes(|lane| reflectance[lane] * shape)
            }
            Self::Layered { diffuse, lost, .. } => {
                let below = 1.0 - fresnel::between(lost[0], lost[1], mean_schlick_tail(cos));
                lanes(|lane| diffuse[lane] * below)
            }
            Self::Filmed { diffuse, .. } => {
                // At the cosine of the half vector whose tail is the mean one.
                let mirrored = self.filmed(1.0 - mean_schlick_tail(cos).max(0.0).powf(0.2));
                lanes(|lane| diffuse[lane] * (1.0 - mirrored[lane]))
            }
            Self::Substrate { diffuse, mirrored, .. } => {
                lanes(|lane| diffuse[lane] * (1.0 - mirrored[lane]) * base_seen(cos))
            }
            Self::Mirror { .. }
            | Self::Glossy { .. }
            | Self::Metal { .. }
            | Self::Pane { .. }
            | Self::Dielectric { .. }
            | Self::Velvet { .. }
            | Self::Hair(_)
            | Self::Open => [0.0; N],
        }
    }
}

/// What the base of a substrate sends out under even light, relative to its reflectance: the integral of
/// [`substrate_base`] times the cosine.
fn base_seen(cos: f32) -> f32 {
    1.0 - (1.0 - 0.5 * cos).powi(5)
}

/// Returns the mean of sin α tan β max(0, cos Δφ), which Oren and Nayar's second constant counts, over even light.
fn rough_matte_mean(cos: f32) -> f32 {
    let cos = cos.clamp(1e-4, 1.0);
    let sin = (1.0 - cos * cos).sqrt();
    FRAC_2_PI * sin * ((1.0 - sin * sin * sin) / (3.0 * cos) + 0.5 * (cos.acos() - cos * sin))
}

/// Returns the mean of Schlick's (1 − cos)⁵ at the half vector over even light: a fit, to 1e-3.
fn mean_schlick_tail(cos: f32) -> f32 {
    let rest = 1.0 - cos.min(1.0);
    0.028 * rest * rest * rest.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{microfacet::Ggx, sampling::Frame};

    const UPRIGHT: Frame = Frame { x: Vec3::X, y: Vec3::Y, z: Vec3::Z };

    fn coated(rough: Option<Ggx>) -> Lobe<1> {
        Lobe::Coated { diffuse: [0.6], index: [1.5], inside: [fresnel::diffuse_reflectance(1.0 / 1.5)], rough }
    }

    fn layered(rough: Option<Ggx>) -> Lobe<1> {
        Lobe::Layered { diffuse: [0.6], mirrored: [0.04], edge: 1.0, lost: [0.04, 1.0], rough }
    }

    /// Radiance under light from all around: by the function itself, and by its parts.
    #[test]
    fn parts_sum_to_the_whole() {
        let outgoing = Vec3::new(0.6, 0.0, 0.8);
        let radiance = |i: Vec3| 1.0 + 0.7 * i.x + 0.4 * i.z;
        for lobe in [
            coated(None),
            coated(Ggx::new(0.3, 0.3)),
            Lobe::Diffuse { reflectance: [0.5], transmittance: [0.2] },
            Lobe::Dielectric { index: [1.5], reflectance: [0.8], transmittance: [0.9], rough: None },
            Lobe::RoughDiffuse { reflectance: [0.6], constants: [0.9, 0.2] },
            Lobe::Velvet { color: [0.6], alpha: 0.3 },
            layered(None),
            layered(Ggx::new(0.3, 0.3)),
            Lobe::Substrate { diffuse: [0.6], mirrored: [0.1], rough: None },
            Lobe::Substrate { diffuse: [0.6], mirrored: [0.1], rough: Ggx::new(0.3, 0.3) },
            Lobe::Glossy { reflectance: [0.9], index: [1.5], rough: None },
            Lobe::Glossy { reflectance: [0.9], index: [1.5], rough: Ggx::new(0.3, 0.3) },
            Lobe::Pane { reflectance: [0.1], transmittance: [0.8], rough: None },
            Lobe::Pane { reflectance: [0.1], transmittance: [0.8], rough: Ggx::new(0.3, 0.3) },
        ] {
            let mut bsdf = Bsdf::new(UPRIGHT, Vec3::Z, outgoing);
            bsdf.push(1.0, lobe);
            let (mut whole, mut parts, mut irradiance) = (0.0, 0.0, 0.0);
            let gloss = bsdf.gloss();
            let n = 400;
            for at in 0..n * n {
                let z = 2.0 * ((at / n) as f32 + 0.5) / n as f32 - 1.0;
                let angle = std::f32::consts::TAU * ((at % n) as f32 + 0.5) / n as f32;
                let r = (1.0 - z * z).sqrt();
                let i = Vec3::new(r * angle.cos(), r * angle.sin(), z);
                let light = radiance(i) * 4.0 * std::f32::consts::PI / (n * n) as f32;
                whole += f64::from(bsdf.eval(i)[0] * light);
                parts += f64::from(gloss.as_ref().map_or(0.0, |gloss| gloss.eval(i)[0]) * light);
                irradiance += f64::from(z.max(0.0) * bsdf.diffuse_weight(i) * light);
            }
            parts += f64::from(bsdf.diffuse_reflectance()[0]) * irradiance / std::f64::consts::PI;
            // The light of those two depends on both directions together; their parts have its mean over even light.
            let tolerance = match lobe {
                Lobe::RoughDiffuse { .. } | Lobe::Layered { .. } => 0.02,
                _ => 5e-3,
            };
            assert!((parts / whole - 1.0).abs() < tolerance || whole == 0.0, "{lobe:?}: {parts} {whole}");
            let mirrored: f32 = bsdf.mirrors().iter().map(|(i, value)| value[0] * radiance(*i)).sum();
            // What is drawn holds mirrors too.
            let drawn: f64 = (0..n * n)
                .filter_map(|at| {
                    let u = [(at / n) as f32, (at % n) as f32].map(|v| (v + 0.5) / n as f32);
                    let sample = bsdf.sample((at as f32 * 0.618_034).fract(), u)?;
                    Some(f64::from(sample.weight[0] * radiance(sample.incident)) / f64::from(n * n))
                })
                .sum();
            assert!(((parts + f64::from(mirrored)) / drawn - 1.0).abs() < 0.02, "{lobe:?}: {parts} {mirrored} {drawn}");
        }
    }
}
