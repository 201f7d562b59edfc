//! How one point of a surface scatters light.

mod parts;

use dioptric_spectrum::lanes;
use glam::Vec3;
use std::f32::consts::FRAC_1_PI;

use crate::{
    film, fresnel,
    hair::Hair,
    microfacet::Ggx,
    sampling::{Frame, ONE_MINUS_EPSILON, cosine_hemisphere},
    velvet,
};

/// The scattering function of one point of a surface, for light that leaves it in one direction, at `N` wavelengths.
///
/// Directions are in the frame of the world, of length 1, and point away from the surface: `outgoing` to where the
/// light goes (the camera), `incident` to where it comes from (the light). The functions are those of radiance: light
/// that leaves a medium of index n for air loses n² of its radiance, and gains as much on its way in.
#[derive(Clone, Debug)]
pub struct Bsdf<const N: usize> {
    frame: Frame,
    geometric_normal: Vec3,
    outgoing: Vec3,
    /// Kinds of scattering, each with its factor.
    lobes: Vec<(Factor, Lobe<N>)>,
    /// The sum of the chances.
    chances: f32,
    /// Whether it is a thin round body whose light leaves on any side.
    is_round: bool,
}

/// What a kind of scattering counts in a sum, and how often it is drawn.
#[derive(Clone, Copy, Debug)]
struct Factor {
    /// What its values are multiplied by: the share of the surface that it has.
    share: f32,
    /// How often it is drawn, in proportion to the others.
    chance: f32,
}

/// The most kinds of scattering that a mixture of materials can have.
pub(crate) const MAX_LOBES: usize = 8;

/// One kind of scattering. Roughness `None` is a mirror.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Lobe<const N: usize> {
    Diffuse {
        reflectance: [f32; N],
        transmittance: [f32; N],
    },
    /// Oren & Nayar (1994) by their two constants.
    RoughDiffuse {
        reflectance: [f32; N],
        constants: [f32; 2],
    },
    Mirror {
        reflectance: [f32; N],
        rough: Option<Ggx>,
    },
    /// A boundary of which only what it mirrors is followed, times a color.
    Glossy {
        reflectance: [f32; N],
        index: [f32; N],
        rough: Option<Ggx>,
    },
    Metal {
        n: [f32; N],
        k: [f32; N],
        rough: Option<Ggx>,
    },
    Dielectric {
        index: [f32; N],
        reflectance: [f32; N],
        transmittance: [f32; N],
        rough: Option<Ggx>,
    },
    /// A pane whose two sides are one surface: light goes on straight, or about so where it is rough.
    Pane {
        reflectance: [f32; N],
        transmittance: [f32; N],
        rough: Option<Ggx>,
    },
    Coated {
        diffuse: [f32; N],
        index: [f32; N],
        inside: [f32; N],
        rough: Option<Ggx>,
    },
    /// A diffuse base below a mirroring layer by Schlick's formula (glTF 2.0, appendix B): `mirrored` at right angles,
    /// `edge` at grazing ones; the base loses what a layer of `lost` at both mirrors.
    Layered {
        diffuse: [f32; N],
        mirrored: [f32; N],
        edge: f32,
        lost: [f32; 2],
        rough: Option<Ggx>,
    },
    /// A diffuse base below a film that is about as thin as a wavelength: `base` is the reflectance of what bears the film at right angles,
    /// `waves` the way once there and back through the film in wavelengths.
    Filmed {
        diffuse: [f32; N],
        base: [f32; N],
        waves: [f32; N],
        index: f32,
        rough: Option<Ggx>,
    },
    /// A diffuse base below a glossy coat, which gains what the base loses (Ashikhmin & Shirley 2000).
    Substrate {
        diffuse: [f32; N],
        mirrored: [f32; N],
        rough: Option<Ggx>,
    },
    /// The sheen of cloth (`velvet.rs`).
    Velvet {
        color: [f32; N],
        alpha: f32,
    },
    Hair(Hair<N>),
    Open,
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

/// A direction that a smooth boundary sends light to, in the local frame.
struct Mirrored<const N: usize> {
    incident: Vec3,
    value: [f32; N],
    probability: f32,
    is_dispersed: bool,
}

impl<const N: usize> Bsdf<N> {
    pub(crate) fn new(frame: Frame, geometric_normal: Vec3, outgoing: Vec3) -> Self {
        Self { frame, geometric_normal, outgoing, lobes: Vec::new(), chances: 0.0, is_round: false }
    }

    /// Adds a kind of scattering of a share of the surface, which is drawn as often.
    pub(crate) fn push(&mut self, share: f32, lobe: Lobe<N>) {
        self.push_with(Factor { share, chance: share }, lobe);
    }

    /// Adds a kind of scattering to others of the same share of the surface: it is drawn by the light that it gives back.
    pub(crate) fn push_term(&mut self, share: f32, lobe: Lobe<N>) {
        let cos = self.frame.to_local(self.outgoing).z;
        let albedo = lobe.albedo(cos).iter().sum::<f32>() / N as f32;
        if albedo > 0.0 {
            self.push_with(Factor { share, chance: share * albedo.clamp(0.02, 1.0) }, lobe);
        }
    }

    /// What would be one too many takes the place of the last.
    fn push_with(&mut self, factor: Factor, lobe: Lobe<N>) {
        if factor.share > 0.0 {
            if self.lobes.len() == MAX_LOBES
                && let Some((last, _)) = self.lobes.pop()
            {
                self.chances -= last.chance;
            }
            if self.lobes.is_empty() {
                // Most surfaces have one.
                self.lobes.reserve_exact(1);
            }
            self.is_round |= matches!(lobe, Lobe::Hair(_));
            self.lobes.push((factor, lobe));
            self.chances += factor.chance;
        }
    }

    /// Divides all shares by a number.
    pub(crate) fn divide(&mut self, by: f32) {
        self.lobes.iter_mut().for_each(|(factor, _)| factor.share /= by);
    }

    fn lobes(&self) -> &[(Factor, Lobe<N>)] {
        &self.lobes
    }

    /// Returns the scattering function times the cosine of the angle between `incident` and the shading normal, 1/sr.
    ///
    /// Mirror directions count as 0: they are found by [`sample`](Self::sample) alone.
    pub fn eval(&self, incident: Vec3) -> [f32; N] {
        let Some((o, i)) = self.local(incident) else { return [0.0; N] };
        let mut sum = [0.0; N];
        for (Factor { share, .. }, lobe) in self.lobes() {
            let value = lobe.eval(o, i);
            sum = lanes(|lane| sum[lane] + share * value[lane]);
        }
        sum
    }

    /// Returns the density, 1/sr, with which [`sample`](Self::sample) draws a direction, mirror directions left out.
    pub fn pdf(&self, incident: Vec3) -> f32 {
        let Some((o, i)) = self.local(incident) else { return 0.0 };
        self.lobes().iter().map(|(factor, lobe)| factor.chance * lobe.pdf(o, i)).sum::<f32>() / self.chances
    }

    /// Draws the direction that light comes from; `None` where the light ends here.
    ///
    /// The numbers are in [0, 1). Of a dispersive surface ([`is_dispersive`](Self::is_dispersive)) the direction is that
    /// of the first wavelength.
    pub fn sample(&self, u_lobe: f32, u: [f32; 2]) -> Option<BsdfSample<N>> {
        let (mut rest, mut chosen) = (u_lobe * self.chances, None);
        for (factor, lobe) in self.lobes() {
            let is_chosen = rest < factor.chance;
            chosen = Some((factor, lobe, (rest / factor.chance).clamp(0.0, ONE_MINUS_EPSILON)));
            if is_chosen {
                break;
            }
            rest -= factor.chance;
        }
        let (factor, lobe, u_lobe) = chosen?;
        let o = self.frame.to_local(self.outgoing);
        if o.z == 0.0 {
            return None;
        }
        if lobe.is_delta_for(u_lobe, o) {
            let Mirrored { incident, value, probability, is_dispersed } = lobe.mirrored(o, u_lobe)?;
            let incident = self.frame.to_world(incident).normalize();
            self.local(incident)?;
            let chance = factor.chance / self.chances;
            let weight = lanes(|lane| value[lane] * factor.share / (chance * probability));
            return Some(BsdfSample { incident, weight, pdf: chance * probability, is_delta: true, is_dispersed });
        }
        let incident = self.frame.to_world(lobe.draw(o, u_lobe, u)?).normalize();
        let pdf = self.pdf(incident);
        if !(pdf > 0.0 && pdf.is_finite()) {
            return None;
        }
        let value = self.eval(incident);
        let (o, i) = self.local(incident)?;
        let is_dispersed = o.z * i.z < 0.0 && self.is_dispersive();
        let weight = lanes(|lane| if is_dispersed && lane > 0 { 0.0 } else { value[lane] / pdf });
        Some(BsdfSample { incident, weight, pdf, is_delta: false, is_dispersed })
    }

    /// Whether light is only mirrored or refracted, so that sampling lights finds nothing.
    pub fn is_delta(&self) -> bool {
        self.lobes().iter().all(|(_, lobe)| match lobe {
            Lobe::Diffuse { .. }
            | Lobe::RoughDiffuse { .. }
            | Lobe::Velvet { .. }
            | Lobe::Coated { .. }
            | Lobe::Layered { .. }
            | Lobe::Filmed { .. }
            | Lobe::Hair(_)
            | Lobe::Substrate { .. } => false,
            Lobe::Mirror { rough, .. }
            | Lobe::Glossy { rough, .. }
            | Lobe::Metal { rough, .. }
            | Lobe::Dielectric { rough, .. }
            | Lobe::Pane { rough, .. } => rough.is_none(),
            Lobe::Open => true,
        })
    }

    /// Whether directions depend on the wavelength, so that a packet must be taken apart before it goes on.
    pub fn is_dispersive(&self) -> bool {
        self.lobes().iter().any(|(_, lobe)| match lobe {
            Lobe::Dielectric { index, .. } => index.iter().any(|n| n != &index[0]),
            _ => false,
        })
    }

    /// Returns the share of the light that the surface gives back in all directions, roughly: for albedo pictures.
    pub fn albedo(&self) -> [f32; N] {
        let cos = self.frame.to_local(self.outgoing).z;
        let mut sum = [0.0; N];
        for (Factor { share, .. }, lobe) in self.lobes() {
            let albedo = lobe.albedo(cos);
            sum = lanes(|lane| sum[lane] + share * albedo[lane]);
        }
        sum
    }

    /// The cosine between the direction that light leaves in and the shading normal, of whichever side.
    pub(crate) fn cosine(&self) -> f32 {
        self.frame.to_local(self.outgoing).z.abs()
    }

    /// The normal of the side from which light can be scattered towards `outgoing`; `None` where it can from both.
    pub fn lit_side(&self) -> Option<Vec3> {
        let is_opaque = |lobe: &Lobe<N>| match lobe {
            Lobe::Diffuse { transmittance, .. } => transmittance.iter().all(|&t| t == 0.0),
            Lobe::RoughDiffuse { .. }
            | Lobe::Velvet { .. }
            | Lobe::Mirror { .. }
            | Lobe::Glossy { .. }
            | Lobe::Metal { .. }
            | Lobe::Coated { .. }
            | Lobe::Layered { .. }
            | Lobe::Filmed { .. }
            | Lobe::Substrate { .. } => true,
            Lobe::Dielectric { .. } | Lobe::Pane { .. } | Lobe::Hair(_) | Lobe::Open => false,
        };
        let n = self.geometric_normal;
        let towards = if n.dot(self.outgoing) < 0.0 { -n } else { n };
        self.lobes().iter().all(|(_, lobe)| is_opaque(lobe)).then_some(towards)
    }

    /// The shading normal, bumps included, of length 1.
    pub fn normal(&self) -> Vec3 {
        self.frame.z
    }

    /// Returns both directions in the local frame; `None` where bumps would let light through a surface that mirrors it.
    fn local(&self, incident: Vec3) -> Option<(Vec3, Vec3)> {
        let (o, i) = (self.frame.to_local(self.outgoing), self.frame.to_local(incident));
        let flat = self.geometric_normal.dot(incident) * self.geometric_normal.dot(self.outgoing);
        (self.is_round || flat * o.z * i.z > 0.0).then_some((o, i))
    }
}

/// Turns both directions so that the outgoing one has z > 0.
fn upright(o: Vec3, i: Vec3) -> (Vec3, Vec3) {
    if o.z < 0.0 { (-o, -i) } else { (o, i) }
}

impl<const N: usize> Lobe<N> {
    fn eval(&self, o: Vec3, i: Vec3) -> [f32; N] {
        let is_reflection = o.z * i.z > 0.0;
        match self {
            Self::Diffuse { reflectance, transmittance } => {
                let of = if is_reflection { reflectance } else { transmittance };
                lanes(|lane| of[lane] * FRAC_1_PI * i.z.abs())
            }
            Self::RoughDiffuse { reflectance, constants: [a, b] } if is_reflection => {
                let (sin_o, sin_i) = (o.truncate().length(), i.truncate().length());
                // The cosine between the two azimuths.
                let along = o.truncate().dot(i.truncate()) / (sin_o * sin_i).max(f32::MIN_POSITIVE);
                let steeper = o.z.abs().max(i.z.abs()).max(1e-6);
                let shape = a + b * along.max(0.0) * sin_o * sin_i / steeper;
                lanes(|lane| reflectance[lane] * shape * FRAC_1_PI * i.z.abs())
            }
            Self::Hair(hair) => hair.value(o, i),
            Self::Velvet { color, alpha } if is_reflection => {
                let value = velvet::value(*alpha, o, i);
                color.map(|c| c * value)
            }
            Self::Mirror { reflectance, rough: Some(ggx) } if is_reflection => {
                let (common, _) = facet_reflection(ggx, o, i);
                lanes(|lane| reflectance[lane] * common)
            }
            Self::Glossy { reflectance, index, rough: Some(ggx) } if is_reflection => {
                let (common, cos) = facet_reflection(ggx, o, i);
                let mirrored = fresnel::dielectrics(cos, index);
                lanes(|lane| reflectance[lane] * common * mirrored[lane])
            }
            Self::Pane { reflectance, transmittance, rough: Some(ggx) } => {
                let (of, i) = if is_reflection { (reflectance, i) } else { (transmittance, across(i)) };
                let (common, _) = facet_reflection(ggx, o, i);
                lanes(|lane| of[lane] * common)
            }
            Self::Layered { diffuse, mirrored, edge, lost, rough } if is_reflection => {
                let (common, cos) = match rough {
                    Some(ggx) => facet_reflection(ggx, o, i),
                    None => (0.0, half_cosine(o, i)),
                };
                let tail = fresnel::schlick_tail(cos);
                let below = FRAC_1_PI * i.z.abs() * (1.0 - fresnel::between(lost[0], lost[1], tail));
                lanes(|lane| diffuse[lane] * below + common * fresnel::between(mirrored[lane], *edge, tail))
            }
            Self::Filmed { .. } if is_reflection => self.filmed_value(o, i),
            Self::Substrate { diffuse, mirrored, rough } if is_reflection => {
                let base = substrate_base(o.z.abs(), i.z.abs()) * i.z.abs();
                let (gloss, tail) = substrate_gloss(rough.as_ref(), o, i);
                lanes(|lane| {
                    let coat = fresnel::between(mirrored[lane], 1.0, tail);
                    diffuse[lane] * (1.0 - mirrored[lane]) * base + gloss * coat
                })
            }
            Self::Metal { n, k, rough: Some(ggx) } if is_reflection => {
                let (common, cos) = facet_reflection(ggx, o, i);
                lanes(|lane| common * fresnel::conductor(cos, n[lane], k[lane]))
            }
            Self::Dielectric { index, reflectance, transmittance, rough: Some(ggx) } => {
                let tint = if is_reflection { reflectance } else { transmittance };
                lanes(|lane| {
                    let eta = if o.z > 0.0 { index[lane] } else { 1.0 / index[lane] };
                    tint[lane] * rough_dielectric(ggx, eta, o, i).0
                })
            }
            Self::Coated { diffuse, index, inside, rough } if is_reflection => {
                let (common, cos) = rough.as_ref().map_or((0.0, 1.0), |ggx| facet_reflection(ggx, o, i));
                let [out, of, mirrored] = [o.z, i.z, cos].map(|z| fresnel::dielectrics(z.abs(), index));
                lanes(|lane| {
                    let n = index[lane];
                    let between = diffuse[lane] / (n * n * (1.0 - diffuse[lane] * inside[lane]));
                    let base = FRAC_1_PI * i.z.abs() * (1.0 - out[lane]) * (1.0 - of[lane]) * between;
                    base + common * mirrored[lane]
                })
            }
            _ => [0.0; N],
        }
    }

    /// The density with which `draw` draws a direction, times the probability that it is asked to.
    fn pdf(&self, o: Vec3, i: Vec3) -> f32 {
        let is_reflection = o.z * i.z > 0.0;
        match self {
            Self::Diffuse { .. } => {
                let p = self.diffuse_reflection_probability();
                (if is_reflection { p } else { 1.0 - p }) * FRAC_1_PI * i.z.abs()
            }
            Self::Hair(hair) => hair.pdf(o, i),
            Self::RoughDiffuse { .. } | Self::Velvet { .. } if is_reflection => FRAC_1_PI * i.z.abs(),
            Self::Mirror { rough: Some(ggx), .. }
            | Self::Glossy { rough: Some(ggx), .. }
            | Self::Metal { rough: Some(ggx), .. }
                if is_reflection =>
            {
                facet_reflection_pdf(ggx, o, i)
            }
            Self::Pane { rough: Some(ggx), .. } => {
                let p = self.back_probability();
                if is_reflection {
                    p * facet_reflection_pdf(ggx, o, i)
                } else {
                    (1.0 - p) * facet_reflection_pdf(ggx, o, across(i))
                }
            }
            Self::Dielectric { index, rough: Some(ggx), .. } => {
                rough_dielectric(ggx, if o.z > 0.0 { index[0] } else { 1.0 / index[0] }, o, i).1
            }
            Self::Coated { rough, .. }
            | Self::Layered { rough, .. }
            | Self::Filmed { rough, .. }
            | Self::Substrate { rough, .. }
                if is_reflection =>
            {
                let p = self.coat_probability(o);
                let coat = rough.as_ref().map_or(0.0, |ggx| facet_reflection_pdf(ggx, o, i));
                p * coat + (1.0 - p) * FRAC_1_PI * i.z.abs()
            }
            _ => 0.0,
        }
    }

    /// Whether the number means a mirror direction.
    fn is_delta_for(&self, u_lobe: f32, o: Vec3) -> bool {
        match self {
            Self::Diffuse { .. } | Self::RoughDiffuse { .. } | Self::Velvet { .. } | Self::Hair(_) => false,
            Self::Mirror { rough, .. }
            | Self::Glossy { rough, .. }
            | Self::Metal { rough, .. }
            | Self::Dielectric { rough, .. }
            | Self::Pane { rough, .. } => rough.is_none(),
            Self::Coated { rough, .. }
            | Self::Layered { rough, .. }
            | Self::Filmed { rough, .. }
            | Self::Substrate { rough, .. } => rough.is_none() && u_lobe < self.coat_probability(o),
            Self::Open => true,
        }
    }

    /// Draws a direction; `u_lobe` chooses between the ways that light can go.
    fn draw(&self, o: Vec3, u_lobe: f32, u: [f32; 2]) -> Option<Vec3> {
        let side = o.z.signum();
        let diffuse = |side: f32| {
            let i = cosine_hemisphere(u);
            Vec3::new(i.x, i.y, side * i.z)
        };
        let mirrored = |ggx: &Ggx| {
            let m = side * ggx.sample_seen(side * o, u);
            let i = 2.0 * o.dot(m) * m - o;
            (i.z * o.z > 0.0).then_some(i)
        };
        match self {
            Self::Diffuse { .. } => {
                Some(diffuse(if u_lobe < self.diffuse_reflection_probability() { side } else { -side }))
            }
            Self::Hair(hair) => Some(hair.draw(o, u_lobe, u)),
            Self::RoughDiffuse { .. } | Self::Velvet { .. } => Some(diffuse(side)),
            Self::Mirror { rough, .. } | Self::Glossy { rough, .. } | Self::Metal { rough, .. } => {
                mirrored(rough.as_ref()?)
            }
            Self::Pane { rough, .. } => {
                let i = mirrored(rough.as_ref()?)?;
                Some(if u_lobe < self.back_probability() { i } else { across(i) })
            }
            Self::Dielectric { index, rough, .. } => {
                let ggx = rough.as_ref()?;
                let eta = if o.z > 0.0 { index[0] } else { 1.0 / index[0] };
                let m = side * ggx.sample_seen(side * o, u);
                if u_lobe < fresnel::dielectric(o.dot(m), eta) {
                    let i = 2.0 * o.dot(m) * m - o;
                    (i.z * o.z > 0.0).then_some(i)
                } else {
                    refract(o, m, eta).filter(|i| i.z * o.z < 0.0)
                }
            }
            Self::Coated { rough, .. }
            | Self::Layered { rough, .. }
            | Self::Filmed { rough, .. }
            | Self::Substrate { rough, .. } => match rough {
                Some(ggx) if u_lobe < self.coat_probability(o) => mirrored(ggx),
                _ => Some(diffuse(side)),
            },
            Self::Open => None,
        }
    }

    /// Returns where a smooth boundary sends light to.
    fn mirrored(&self, o: Vec3, u_lobe: f32) -> Option<Mirrored<N>> {
        let back = Vec3::new(-o.x, -o.y, o.z);
        let cos = o.z.abs();
        let all = |value| Some(Mirrored { incident: back, value, probability: 1.0, is_dispersed: false });
        match self {
            Self::Mirror { reflectance, .. } => all(*reflectance),
            Self::Glossy { reflectance, index, .. } => {
                let mirrored = fresnel::dielectrics(cos, index);
                all(lanes(|lane| reflectance[lane] * mirrored[lane]))
            }
            Self::Pane { reflectance, transmittance, .. } => {
                let p = self.back_probability();
                let (incident, value, probability) =
                    if u_lobe < p { (back, *reflectance, p) } else { (-o, *transmittance, 1.0 - p) };
                Some(Mirrored { incident, value, probability, is_dispersed: false })
            }
            Self::Layered { mirrored, edge, .. } => {
                let tail = fresnel::schlick_tail(cos);
                let value = lanes(|lane| fresnel::between(mirrored[lane], *edge, tail));
                Some(Mirrored { incident: back, value, probability: self.coat_probability(o), is_dispersed: false })
            }
            Self::Filmed { .. } => {
                let (value, probability) = (self.filmed(cos), self.coat_probability(o));
                Some(Mirrored { incident: back, value, probability, is_dispersed: false })
            }
            Self::Substrate { mirrored, .. } => {
                let tail = fresnel::schlick_tail(cos);
                let value = lanes(|lane| fresnel::between(mirrored[lane], 1.0, tail));
                Some(Mirrored { incident: back, value, probability: self.coat_probability(o), is_dispersed: false })
            }
            Self::Metal { n, k, .. } => all(lanes(|lane| fresnel::conductor(cos, n[lane], k[lane]))),
            Self::Coated { index, .. } => {
                let value = fresnel::dielectrics(cos, index);
                let probability = self.coat_probability(o);
                Some(Mirrored { incident: back, value, probability, is_dispersed: false })
            }
            Self::Dielectric { index, reflectance, transmittance, .. } => {
                let eta: [f32; N] = lanes(|lane| if o.z > 0.0 { index[lane] } else { 1.0 / index[lane] });
                let value = fresnel::dielectrics(cos, &eta);
                let probability = value[0];
                if u_lobe < probability {
                    let value = lanes(|lane| reflectance[lane] * value[lane]);
                    return Some(Mirrored { incident: back, value, probability, is_dispersed: false });
                }
                let incident = refract(o, Vec3::Z * o.z.signum(), eta[0])?;
                let is_dispersed = eta.iter().any(|e| *e != eta[0]);
                // Radiance over n² is what goes through unchanged.
                let value = lanes(|lane| match is_dispersed && lane > 0 {
                    true => 0.0,
                    false => transmittance[lane] * (1.0 - value[lane]) / (eta[lane] * eta[lane]),
                });
                Some(Mirrored { incident, value, probability: 1.0 - probability, is_dispersed })
            }
            Self::Open => Some(Mirrored { incident: -o, value: [1.0; N], probability: 1.0, is_dispersed: false }),
            Self::Diffuse { .. } | Self::RoughDiffuse { .. } | Self::Velvet { .. } | Self::Hair(_) => None,
        }
    }

    /// The share of light that is given back in all directions, roughly, for light that leaves at this cosine.
    fn albedo(&self, cos: f32) -> [f32; N] {
        let (is_outside, cos) = (cos > 0.0, cos.abs());
        match self {
            Self::Diffuse { reflectance, transmittance } => lanes(|lane| reflectance[lane] + transmittance[lane]),
            Self::RoughDiffuse { reflectance, .. } | Self::Mirror { reflectance, .. } => *reflectance,
            Self::Glossy { reflectance, index, .. } => {
                let mirrored = fresnel::dielectrics(cos, index);
                lanes(|lane| reflectance[lane] * mirrored[lane])
            }
            Self::Metal { n, k, .. } => lanes(|lane| fresnel::conductor(cos, n[lane], k[lane])),
            Self::Dielectric { index, reflectance, transmittance, .. } => lanes(|lane| {
                let mirrored = fresnel::dielectric(cos, if is_outside { index[lane] } else { 1.0 / index[lane] });
                fresnel::between(transmittance[lane], reflectance[lane], mirrored)
            }),
            Self::Pane { reflectance, transmittance, .. } => lanes(|lane| reflectance[lane] + transmittance[lane]),
            Self::Layered { diffuse, mirrored, edge, lost, .. } => {
                let tail = fresnel::schlick_tail(cos);
                let below = 1.0 - fresnel::between(lost[0], lost[1], tail);
                lanes(|lane| diffuse[lane] * below + fresnel::between(mirrored[lane], *edge, tail))
            }
            Self::Filmed { diffuse, .. } => {
                let mirrored = self.filmed(cos);
                lanes(|lane| fresnel::between(diffuse[lane], 1.0, mirrored[lane]))
            }
            // The integral of the base over all directions is 1 - (1 - cos o/2)^5 times its reflectance.
            Self::Substrate { diffuse, mirrored, .. } => {
                let tail = fresnel::schlick_tail(cos);
                let base = 1.0 - (1.0 - 0.5 * cos).powi(5);
                lanes(|lane| {
                    diffuse[lane] * (1.0 - mirrored[lane]) * base + fresnel::between(mirrored[lane], 1.0, tail)
                })
            }
            Self::Velvet { color, alpha } => {
                let albedo = velvet::albedo(*alpha, cos);
                color.map(|c| c * albedo)
            }
            // From the middle of the hair, at right angles.
            Self::Hair(hair) => hair.albedo(Vec3::Z),
            Self::Open => [1.0; N],
            Self::Coated { diffuse, index, inside, .. } => {
                let mirrored = fresnel::dielectrics(cos, index);
                lanes(|lane| {
                    let below = diffuse[lane] * (1.0 - inside[lane]) / (1.0 - diffuse[lane] * inside[lane]);
                    mirrored[lane] + (1.0 - mirrored[lane]) * below
                })
            }
        }
    }

    /// The value of a film and what is below it, apart from the other kinds, which are met more often.
    #[inline(never)]
    fn filmed_value(&self, o: Vec3, i: Vec3) -> [f32; N] {
        let Self::Filmed { diffuse, rough, .. } = self else { return [0.0; N] };
        let (common, cos) = match rough {
            Some(ggx) => facet_reflection(ggx, o, i),
            None => (0.0, half_cosine(o, i)),
        };
        let mirrored = self.filmed(cos);
        let below = FRAC_1_PI * i.z.abs();
        lanes(|lane| diffuse[lane] * below * (1.0 - mirrored[lane]) + common * mirrored[lane])
    }

    /// What a film mirrors at this cosine; of others nothing.
    #[inline(never)]
    fn filmed(&self, cos: f32) -> [f32; N] {
        let Self::Filmed { base, waves, index, .. } = self else { return [0.0; N] };
        lanes(|lane| film::reflectance(cos.abs(), *index, base[lane], waves[lane]))
    }

    fn diffuse_reflection_probability(&self) -> f32 {
        let Self::Diffuse { reflectance, transmittance } = self else { return 1.0 };
        let (r, t): (f32, f32) = (reflectance.iter().sum(), transmittance.iter().sum());
        if t <= 0.0 { 1.0 } else { r / (r + t) }
    }

    /// The share of draws of a pane that come back.
    fn back_probability(&self) -> f32 {
        let Self::Pane { reflectance, transmittance, .. } = self else { return 1.0 };
        let (r, t): (f32, f32) = (reflectance.iter().sum(), transmittance.iter().sum());
        if t <= 0.0 { 1.0 } else { r / (r + t) }
    }

    /// The share of draws that go to a coat's mirror rather than to what is below it.
    fn coat_probability(&self, o: Vec3) -> f32 {
        let (cos, mean) = (o.z.abs(), |values: &[f32; N]| values.iter().sum::<f32>() / N as f32);
        let (mirrored, below) = match self {
            Self::Coated { diffuse, index, .. } => {
                let mirrored = fresnel::dielectric(cos, index[0]);
                (mirrored, (1.0 - mirrored) * mean(diffuse))
            }
            Self::Layered { diffuse, mirrored, edge, lost, .. } => {
                let tail = fresnel::schlick_tail(cos);
                let left = 1.0 - fresnel::between(lost[0], lost[1], tail);
                (fresnel::between(mean(mirrored), *edge, tail), mean(diffuse) * left)
            }
            Self::Filmed { diffuse, .. } => {
                let mirrored = mean(&self.filmed(cos));
                (mirrored, mean(diffuse) * (1.0 - mirrored))
            }
            Self::Substrate { diffuse, mirrored, .. } => {
                let tail = fresnel::schlick_tail(cos);
                (fresnel::between(mean(mirrored), 1.0, tail), mean(diffuse) * (1.0 - mean(mirrored)))
            }
            _ => return 0.0,
        };
        match (mirrored > 0.0, below > 0.0) {
            (true, true) => (mirrored / (mirrored + below)).clamp(0.05, 0.95),
            (true, false) => 1.0,
            _ => 0.0,
        }
    }
}

/// Returns a direction on the other side of the surface.
fn across(i: Vec3) -> Vec3 {
    Vec3::new(i.x, i.y, -i.z)
}

/// The cosine between either direction and the half between them.
fn half_cosine(o: Vec3, i: Vec3) -> f32 {
    (o + i).try_normalize().map_or(1.0, |half| o.dot(half))
}

/// The base below a coat after Ashikhmin & Shirley (2000), 28/(23 pi) (1 - (1 - cos o/2)^5) (1 - (1 - cos i/2)^5), which
/// its reflectances multiply.
fn substrate_base(cos_o: f32, cos_i: f32) -> f32 {
    let seen = |cos: f32| 1.0 - (1.0 - 0.5 * cos).powi(5);
    28.0 / 23.0 * FRAC_1_PI * seen(cos_o) * seen(cos_i)
}

/// The coat after Ashikhmin & Shirley (2000), D cos i / (4 (o.m) max(cos o, cos i)), and the tail of its reflectance on the
/// small mirrors; 0 for a smooth one.
fn substrate_gloss(rough: Option<&Ggx>, o: Vec3, i: Vec3) -> (f32, f32) {
    let (o, i) = upright(o, i);
    let (Some(ggx), Some(m)) = (rough, (o + i).try_normalize()) else { return (0.0, 0.0) };
    let cos = o.dot(m);
    (ggx.density(m) * i.z / (4.0 * cos * o.z.max(i.z)), fresnel::schlick_tail(cos))
}

/// Returns D G / (4 cos o), the part of a rough mirror's value (cosine of `i` included) that all wavelengths share, and
/// the cosine on the small mirrors.
fn facet_reflection(ggx: &Ggx, o: Vec3, i: Vec3) -> (f32, f32) {
    let (o, i) = upright(o, i);
    let Some(m) = (o + i).try_normalize() else { return (0.0, 1.0) };
    (ggx.density(m) * ggx.seen_and_lit(o, i) / (4.0 * o.z), o.dot(m))
}

fn facet_reflection_pdf(ggx: &Ggx, o: Vec3, i: Vec3) -> f32 {
    let (o, i) = upright(o, i);
    let Some(m) = (o + i).try_normalize() else { return 0.0 };
    ggx.seen_density(o, m) / (4.0 * o.dot(m))
}

/// Returns the value, cosine of `i` included, and the density of a rough boundary (Walter et al. 2007, 4.2).
///
/// `eta` is the index on the side of `i` over that on the side of `o`, were they on different sides.
fn rough_dielectric(ggx: &Ggx, eta: f32, o: Vec3, i: Vec3) -> (f32, f32) {
    let (o, i) = upright(o, i);
    let is_reflection = i.z > 0.0;
    let half = if is_reflection { o + i } else { o + eta * i };
    let Some(m) = half.try_normalize() else { return (0.0, 0.0) };
    let m = if m.z < 0.0 { -m } else { m };
    let (cos_o, cos_i) = (o.dot(m), i.dot(m));
    if cos_o <= 0.0 || cos_i * i.z <= 0.0 {
        return (0.0, 0.0);
    }
    let mirrored = fresnel::dielectric(cos_o, eta);
    if is_reflection {
        let value = mirrored * ggx.density(m) * ggx.seen_and_lit(o, i) / (4.0 * o.z);
        return (value, mirrored * ggx.seen_density(o, m) / (4.0 * cos_o));
    }
    let along = cos_o + eta * cos_i;
    // The solid angle of tilts by that of refracted directions; η² of it is lost to the radiance.
    let jacobian = eta * eta * cos_i.abs() / (along * along);
    let lit = Vec3::new(i.x, i.y, -i.z);
    let value = (1.0 - mirrored) * ggx.density(m) * ggx.seen_and_lit(o, lit) * cos_o / o.z * jacobian / (eta * eta);
    (value, (1.0 - mirrored) * ggx.seen_density(o, m) * jacobian)
}

/// Returns the direction, pointing away, of light that goes to `o` through a boundary of normal `m` on the side of `o`;
/// `eta` is the index beyond it over that before it. `None` where it is totally reflected.
fn refract(o: Vec3, m: Vec3, eta: f32) -> Option<Vec3> {
    let cos = o.dot(m);
    let sin2 = (1.0 - cos * cos).max(0.0) / (eta * eta);
    (sin2 < 1.0).then(|| -o / eta + (cos / eta - (1.0 - sin2).sqrt()) * m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec2;
    use std::f32::consts::TAU;

    fn direction(cos: f32, azimuth: f32) -> Vec3 {
        ((1.0 - cos * cos).sqrt() * Vec2::from_angle(azimuth)).extend(cos)
    }

    fn of(lobe: Lobe<1>, o: Vec3) -> Bsdf<1> {
        let mut bsdf = Bsdf::new(Frame { x: Vec3::X, y: Vec3::Y, z: Vec3::Z }, Vec3::Z, o);
        bsdf.push(1.0, lobe);
        bsdf
    }

    fn coated(diffuse: f32, rough: Option<Ggx>) -> Lobe<1> {
        let inside = [fresnel::diffuse_reflectance(1.0 / 1.5)];
        Lobe::Coated { diffuse: [diffuse], index: [1.5], inside, rough }
    }

    fn glass(index: f32, rough: Option<Ggx>) -> Lobe<1> {
        Lobe::Dielectric { index: [index], reflectance: [1.0], transmittance: [1.0], rough }
    }

    fn lobes() -> Vec<Lobe<1>> {
        let rough = Ggx::new(0.4, 0.25);
        vec![
            Lobe::Diffuse { reflectance: [0.6], transmittance: [0.3] },
            Lobe::Mirror { reflectance: [0.9], rough },
            Lobe::Metal { n: [0.2], k: [3.0], rough },
            glass(1.5, rough),
            coated(0.7, rough),
            coated(0.7, None),
            Lobe::RoughDiffuse { reflectance: [0.6], constants: [0.8, 0.3] },
            Lobe::Velvet { color: [0.8], alpha: 0.25 },
            Lobe::Glossy { reflectance: [0.8], index: [1.5], rough },
            Lobe::Pane { reflectance: [0.2], transmittance: [0.7], rough },
            Lobe::Layered { diffuse: [0.5], mirrored: [0.1], edge: 0.9, lost: [0.04, 1.0], rough },
            Lobe::Layered { diffuse: [0.5], mirrored: [0.1], edge: 0.9, lost: [0.04, 1.0], rough: None },
            Lobe::Filmed { diffuse: [0.5], base: [0.1], waves: [1.2], index: 1.4, rough },
            Lobe::Filmed { diffuse: [0.5], base: [0.1], waves: [1.2], index: 1.4, rough: None },
            Lobe::Substrate { diffuse: [0.5], mirrored: [0.1], rough },
            Lobe::Substrate { diffuse: [0.5], mirrored: [0.1], rough: None },
            glass(1.5, None),
            Lobe::Open,
        ]
    }

    const OUTGOING: [(f32, f32); 4] = [(0.9, 0.3), (0.35, 2.0), (-0.8, 4.0), (-0.3, 1.0)];

    fn sphere(n: usize) -> impl Iterator<Item = (Vec3, f64)> {
        (0..n * n).map(move |index| {
            let cos = 2.0 * ((index / n) as f32 + 0.5) / n as f32 - 1.0;
            (direction(cos, TAU * ((index % n) as f32 + 0.5) / n as f32), 2.0 * std::f64::consts::TAU / (n * n) as f64)
        })
    }

    fn squares(n: usize) -> impl Iterator<Item = (f32, [f32; 2])> {
        (0..n * n).map(move |i| {
            let u = [((i % n) as f32 + 0.5) / n as f32, ((i / n) as f32 + 0.5) / n as f32];
            ((i as f32 * 0.618_034).fract(), u)
        })
    }

    /// f(o, i) / cos is the same both ways; through a boundary after the n² of radiance.
    #[test]
    fn scattering_is_reciprocal() {
        for lobe in lobes() {
            for (a, b) in [((0.9, 0.3), (0.4, 2.5)), ((0.6, 1.0), (0.2, 1.7)), ((0.8, 0.3), (-0.7, 3.3))] {
                let (a, b) = (direction(a.0, a.1), direction(b.0, b.1));
                let forth = of(lobe, a).eval(b)[0] / b.z.abs();
                let back = of(lobe, b).eval(a)[0] / a.z.abs();
                let ratio = match lobe {
                    Lobe::Dielectric { index: [n], .. } if b.z < 0.0 => n * n,
                    _ => 1.0,
                };
                assert!((forth * ratio - back).abs() <= 1e-4 * back.max(1e-3), "{lobe:?}: {forth} {back}");
            }
        }
    }

    #[test]
    fn density_integrates_to_what_is_drawn() {
        for lobe in lobes() {
            for (cos, azimuth) in OUTGOING {
                let bsdf = of(lobe, direction(cos, azimuth));
                let integral: f64 = sphere(500).map(|(i, dw)| f64::from(bsdf.pdf(i)) * dw).sum();
                let n = 60;
                let drawn = squares(n)
                    .filter(|(u_lobe, u)| bsdf.sample(*u_lobe, *u).is_some_and(|s| !s.is_delta))
                    .count() as f64
                    / (n * n) as f64;
                // The density also counts tilts that would mirror light into the surface: those draws end.
                assert!(integral < drawn + 0.02 && integral > drawn - 0.03, "{lobe:?} {cos}: {integral} {drawn}");
            }
        }
    }

    /// The mean weight of draws is the integral of the function, and of its squares' center: both ways agree.
    #[test]
    fn weights_are_value_over_density() {
        for lobe in lobes() {
            for (cos, azimuth) in OUTGOING {
                let bsdf = of(lobe, direction(cos, azimuth));
                let integral: f64 = sphere(500).map(|(i, dw)| f64::from(bsdf.eval(i)[0]) * dw).sum();
                let n = 150;
                let mean: f64 = squares(n)
                    .filter_map(|(u_lobe, u)| bsdf.sample(u_lobe, u))
                    .filter(|sample| !sample.is_delta)
                    .map(|sample| f64::from(sample.weight[0]) / (n * n) as f64)
                    .sum();
                assert!((integral - mean).abs() < 0.02 * integral + 2e-3, "{lobe:?} {cos}: {integral} {mean}");
            }
        }
    }

    /// What a sheen sends back, by its table and by draws.
    #[test]
    fn sheen_sends_back_what_its_table_says() {
        for (alpha, cos) in [(0.09, 0.3), (0.25, 0.8), (0.5, 0.5), (1.0, 0.2), (1.0, 1.0)] {
            let total = furnace(Lobe::Velvet { color: [1.0], alpha }, direction(cos, 1.0));
            let table = f64::from(velvet::albedo(alpha, cos));
            assert!((total - table).abs() < 0.01, "{alpha} {cos}: {total} {table}");
        }
    }

    /// Returns the share of a white furnace that a boundary gives back towards a direction.
    fn furnace(lobe: Lobe<1>, outgoing: Vec3) -> f64 {
        let bsdf = of(lobe, outgoing);
        // Radiance in a medium of index n is n² in the furnace.
        let medium = |z: f32| if matches!(lobe, Lobe::Dielectric { .. }) && z < 0.0 { 2.25 } else { 1.0 };
        let n = 120;
        let weights = squares(n).filter_map(|(u_lobe, u)| bsdf.sample(u_lobe, u));
        let total: f64 = weights.map(|s| f64::from(s.weight[0] * medium(s.incident.z)) / (n * n) as f64).sum();
        total / f64::from(medium(outgoing.z))
    }

    /// In a furnace of radiance 1 (n² inside a medium) nothing gets brighter; what absorbs nothing and isn't rough stays
    /// as it is. A rough coat over white loses light between its small mirrors, by an amount that has no closed form: its lower
    /// bounds only show that no kind of light is left out.
    #[test]
    fn white_furnace_stays_white() {
        let glass = |rough| glass(1.5, rough);
        let white_metal = |rough| Lobe::Mirror { reflectance: [1.0], rough };
        let (mild, rough) = (Ggx::new(0.2, 0.2), Ggx::new(0.6, 0.6));
        let cases = [
            (Lobe::Diffuse { reflectance: [0.5], transmittance: [0.5] }, 0.999, 1.001),
            (white_metal(None), 0.999, 1.001),
            (glass(None), 0.999, 1.001),
            (coated(1.0, None), 0.997, 1.003),
            (coated(1.0, mild), 0.80, 1.02),
            (coated(1.0, rough), 0.60, 1.02),
            (Lobe::Open, 0.999, 1.001),
        ];
        for (lobe, least, most) in cases {
            for (cos, azimuth) in [(0.95, 0.3), (0.6, 1.0), (0.3, 2.0), (-0.95, 0.0), (-0.6, 1.0), (-0.3, 2.0)] {
                if cos < 0.0 && matches!(lobe, Lobe::Coated { .. }) {
                    continue;
                }
                let total = furnace(lobe, direction(cos, azimuth));
                assert!(total > least - 0.01 && total < most + 0.01, "{lobe:?} at {cos}: {total}");
            }
        }
    }

    /// Rough boundaries lose what their small mirrors send into each other, and no more: the share of a white furnace that
    /// they give back is that of a numerical integral over the tilts that are seen, of Smith's height-correlated masking and
    /// Fresnel's equations, made apart from this code (1500 × 1500 tilts, to 0.003).
    #[test]
    fn rough_boundaries_lose_what_is_masked() {
        let (mild, rough) = (Ggx::new(0.2, 0.2), Ggx::new(0.6, 0.6));
        let metal = |rough| Lobe::Mirror { reflectance: [1.0], rough };
        let glass = |rough| glass(1.5, rough);
        for (lobe, cosines, expected) in [
            (metal(mild), [0.95, 0.6, 0.3], [0.9448, 0.9109, 0.8616]),
            (metal(rough), [0.95, 0.6, 0.3], [0.5928, 0.6233, 0.7074]),
            (glass(mild), [0.95, 0.6, 0.3], [0.9941, 0.9797, 0.9410]),
            (glass(mild), [-0.95, -0.6, -0.3], [0.9510, 0.8875, 0.8325]),
            (glass(rough), [0.95, 0.6, 0.3], [0.9495, 0.8820, 0.8154]),
            (glass(rough), [-0.95, -0.6, -0.3], [0.6685, 0.6257, 0.6071]),
        ] {
            for (cos, expected) in cosines.into_iter().zip(expected) {
                let total = furnace(lobe, direction(cos, 1.0));
                assert!((total - expected).abs() < 0.01, "{lobe:?} at {cos}: {total}, expected {expected}");
            }
        }
    }

    #[test]
    fn smooth_glass_follows_snell() {
        let o = direction(0.6, 0.0);
        let bsdf = of(glass(1.5, None), o);
        let sample = bsdf.sample(0.99, [0.5; 2]).unwrap();
        assert!(sample.is_delta && sample.incident.z < 0.0);
        assert!((sample.incident.x + 0.8 / 1.5).abs() < 1e-6);
        let mirrored = bsdf.sample(0.0, [0.5; 2]).unwrap();
        assert!(mirrored.incident.abs_diff_eq(Vec3::new(-0.8, 0.0, 0.6), 1e-6) && bsdf.is_delta());
        assert!((mirrored.pdf - fresnel::dielectric(0.6, 1.5)).abs() < 1e-6);
    }

    #[test]
    fn dispersion_keeps_the_first_wavelength() {
        let mut bsdf = Bsdf::new(Frame { x: Vec3::X, y: Vec3::Y, z: Vec3::Z }, Vec3::Z, direction(0.6, 0.0));
        bsdf.push(
            1.0,
            Lobe::Dielectric { index: [1.5, 1.6], reflectance: [1.0; 2], transmittance: [1.0; 2], rough: None },
        );
        assert!(bsdf.is_dispersive());
        let through = bsdf.sample(0.99, [0.5; 2]).unwrap();
        assert!(through.is_dispersed && through.weight[1] == 0.0 && through.weight[0] > 0.0);
        let mirrored = bsdf.sample(0.0, [0.5; 2]).unwrap();
        assert!(!mirrored.is_dispersed && mirrored.weight[1] > mirrored.weight[0]);
    }
}
