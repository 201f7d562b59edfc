//! What surfaces are made of.

use glam::{Vec2, Vec3};

use crate::{
    Beyond, Bsdf, Hit, MaterialId, SpectralCurve, TextureId, WorldError,
    bsdf::{Lobe, MAX_LOBES},
    fresnel,
    microfacet::Ggx,
    patterned::OwnFrame,
    sampling::Frame,
    texture::Textures,
};
use dioptric_optics::Glass;
use dioptric_spectrum::Spectrum;

/// How a surface scatters light.
#[derive(Clone, Debug, PartialEq)]
pub enum Material {
    /// The ideal diffuse reflector (Lambert), from both sides.
    Matte {
        /// Reflectance, 0–1.
        reflectance: TextureId,
    },
    /// Thin and diffuse, like paper or a leaf: light comes back and goes through.
    Translucent {
        /// Reflectance, 0–1.
        reflectance: TextureId,
        /// Transmittance, 0–1; with the reflectance at most 1, else both are scaled down.
        transmittance: TextureId,
    },
    /// A mirror of given reflectance at all angles.
    Mirror {
        /// Reflectance, 0–1.
        reflectance: TextureId,
        /// How rough it is.
        roughness: Roughness,
    },
    /// Bare metal, by its complex index n + i k.
    Metal {
        /// Index of refraction.
        n: SpectralCurve,
        /// Extinction coefficient.
        k: SpectralCurve,
        /// How rough it is.
        roughness: Roughness,
    },
    /// The boundary of a clear medium that fills the shape; air is outside. The medium absorbs nothing.
    Dielectric {
        /// Index of refraction.
        index: SpectralCurve,
        /// How rough it is.
        roughness: Roughness,
    },
    /// A diffuse base below a clear coat: plastic, varnish, glazed porcelain. Light that the coat's inside mirrors back
    /// to the base is followed to all orders.
    Coated {
        /// Reflectance of the base, 0–1.
        base: TextureId,
        /// Index of refraction of the coat.
        index: SpectralCurve,
        /// How rough the coat is.
        roughness: Roughness,
    },
    /// Two materials in a share of the surface each.
    Blend {
        /// The two.
        of: [MaterialId; 2],
        /// The share of the second, 0–1.
        amount: TextureId,
    },
    /// Nothing: light passes as if the surface weren't there, but it is a hit to a ray.
    Open,
}

/// How rough a mirroring boundary is: the GGX distribution's α along u and v, or `None` for a smooth one.
pub type Roughness = Option<[TextureId; 2]>;

/// Detail of a surface that is too fine for its shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Relief {
    /// A texture of heights, m, over the surface.
    Heights(TextureId),
    /// A picture of normals: red, green and blue 0–1 stand for −1 to 1 along u, v and the normal.
    Normals(TextureId),
    /// The [tilt](crate::Pattern::tilt) of a pattern.
    Pattern(TextureId),
}

impl SpectralCurve {
    /// Returns the index of refraction of a glass, from 300 to 1100 nm where it is known; its ends are held.
    ///
    /// # Errors
    /// When the glass is unknown or has no index between those wavelengths.
    pub fn from_glass(glass: &Glass) -> Result<Self, WorldError> {
        let unknown = |e: String| WorldError::Setting {
            what: "a glass",
            value: e,
            expected: "one with an index between 300 and 1100 nm",
        };
        let (mut wavelengths_nm, mut indices) = (Vec::new(), Vec::new());
        let mut last_error = String::from("without an index");
        for wavelength_nm in (300..=1100).step_by(4).map(f64::from) {
            match glass.index_at(wavelength_nm) {
                Ok(index) => {
                    wavelengths_nm.push(wavelength_nm);
                    indices.push(index);
                }
                Err(error) => last_error = error.to_string(),
            }
        }
        let spectrum = Spectrum::new(wavelengths_nm, indices).map_err(|_| unknown(last_error))?;
        Ok(Self::new(&spectrum, Beyond::Held))
    }
}

/// A material with what is computed for it once.
#[derive(Clone, Debug)]
pub(crate) struct Surface {
    pub(crate) name: String,
    pub(crate) material: Material,
    pub(crate) relief: Option<Relief>,
    /// For a coat: the share of even light below it that it mirrors back.
    inside: Option<SpectralCurve>,
}

impl Surface {
    pub(crate) fn new(name: String, material: Material, relief: Option<Relief>) -> Self {
        let inside = match &material {
            Material::Coated { index, .. } => Some(index.mapped(|n| fresnel::diffuse_reflectance(1.0 / n))),
            _ => None,
        };
        Self { name, material, relief, inside }
    }
}

impl Material {
    /// The textures that the material names.
    pub(crate) fn textures(&self) -> Vec<TextureId> {
        let rough = |roughness: &Roughness| roughness.iter().flatten().copied().collect::<Vec<_>>();
        match self {
            Self::Matte { reflectance } => vec![*reflectance],
            Self::Translucent { reflectance, transmittance } => vec![*reflectance, *transmittance],
            Self::Mirror { reflectance, roughness } => [vec![*reflectance], rough(roughness)].concat(),
            Self::Metal { roughness, .. } | Self::Dielectric { roughness, .. } => rough(roughness),
            Self::Coated { base, roughness, .. } => [vec![*base], rough(roughness)].concat(),
            Self::Blend { amount, .. } => vec![*amount],
            Self::Open => Vec::new(),
        }
    }
}

/// All materials and textures of a world.
#[derive(Clone, Copy)]
pub(crate) struct Surfaces<'a> {
    pub(crate) surfaces: &'a [Surface],
    pub(crate) textures: Textures<'a>,
    pub(crate) place: OwnFrame<'a>,
}

impl Surfaces<'_> {
    /// Returns the scattering function at a hit.
    pub(crate) fn bsdf<const N: usize>(self, hit: &Hit, outgoing: Vec3, wavelengths_nm: &[f32; N]) -> Bsdf<N> {
        let frame = self.frame(hit);
        let mut bsdf = Bsdf::new(frame, hit.geometric_normal, outgoing);
        self.add_lobes(&mut bsdf, hit.material, hit.uv, 1.0, wavelengths_nm);
        bsdf
    }

    fn add_lobes<const N: usize>(
        self,
        bsdf: &mut Bsdf<N>,
        material: MaterialId,
        uv: Vec2,
        share: f32,
        wavelengths_nm: &[f32; N],
    ) {
        let surface = &self.surfaces[material.0 as usize];
        let share_of =
            |texture: TextureId| self.textures.spectral(texture, uv, wavelengths_nm).map(|v| v.clamp(0.0, 1.0));
        let rough = |roughness: &Roughness| {
            roughness.and_then(|alphas| {
                let [x, y] = alphas.map(|alpha| self.textures.number(alpha, uv));
                Ggx::new(x, y)
            })
        };
        let lobe = match &surface.material {
            Material::Matte { reflectance } => {
                Lobe::Diffuse { reflectance: share_of(*reflectance), transmittance: [0.0; N] }
            }
            Material::Translucent { reflectance, transmittance } => {
                let (r, t) = (share_of(*reflectance), share_of(*transmittance));
                let down: [f32; N] = std::array::from_fn(|lane| (r[lane] + t[lane]).max(1.0).recip());
                Lobe::Diffuse {
                    reflectance: std::array::from_fn(|lane| r[lane] * down[lane]),
                    transmittance: std::array::from_fn(|lane| t[lane] * down[lane]),
                }
            }
            Material::Mirror { reflectance, roughness } => {
                Lobe::Mirror { reflectance: share_of(*reflectance), rough: rough(roughness) }
            }
            Material::Metal { n, k, roughness } => {
                Lobe::Metal { n: n.at(wavelengths_nm), k: k.at(wavelengths_nm), rough: rough(roughness) }
            }
            Material::Dielectric { index, roughness } => {
                let index = index.at(wavelengths_nm);
                // Equal media leave nothing to refract; the rough model would divide by 0.
                if index.iter().all(|n| *n == 1.0) {
                    Lobe::Open
                } else {
                    Lobe::Dielectric { index, rough: rough(roughness) }
                }
            }
            Material::Coated { base, index, roughness } => Lobe::Coated {
                diffuse: share_of(*base),
                index: index.at(wavelengths_nm),
                inside: surface.inside.as_ref().map_or([0.0; N], |inside| inside.at(wavelengths_nm)),
                rough: rough(roughness),
            },
            Material::Blend { of: [a, b], amount } => {
                let amount = self.textures.number(*amount, uv).clamp(0.0, 1.0);
                self.add_lobes(bsdf, *a, uv, share * (1.0 - amount), wavelengths_nm);
                self.add_lobes(bsdf, *b, uv, share * amount, wavelengths_nm);
                return;
            }
            Material::Open => Lobe::Open,
        };
        bsdf.push(share, lobe);
    }

    /// Returns the shading frame at a hit, with relief: x runs along u.
    fn frame(self, hit: &Hit) -> Frame {
        let plain = Frame::about_with(hit.shading_normal, hit.dp_du);
        match self.surfaces[hit.material.0 as usize].relief {
            None => plain,
            Some(Relief::Heights(heights)) => {
                // Tilt the tangents by the slope of the heights (Blinn 1978).
                const STEP: f32 = 1e-3;
                let at = |du: f32, dv: f32| self.textures.number(heights, hit.uv + Vec2::new(du, dv));
                let slope_u = (at(0.5 * STEP, 0.0) - at(-0.5 * STEP, 0.0)) / STEP;
                let slope_v = (at(0.0, 0.5 * STEP) - at(0.0, -0.5 * STEP)) / STEP;
                let n = hit.shading_normal;
                let along = |tangent: Vec3| tangent - n * n.dot(tangent);
                let (along_u, along_v) = (along(hit.dp_du), along(hit.dp_dv));
                let normal = (along_u + slope_u * n).cross(along_v + slope_v * n).normalize_or(n);
                let normal = if normal.dot(n) < 0.0 { -normal } else { normal };
                Frame::about_with(normal, hit.dp_du)
            }
            Some(Relief::Pattern(pattern)) => {
                let tilted = self.textures.1.normal + self.textures.tilt(pattern);
                Frame::about_with(self.place.world_normal(tilted), hit.dp_du)
            }
            Some(Relief::Normals(normals)) => {
                let n = Vec3::from_array(self.textures.rgb(normals, hit.uv).map(|v| 2.0 * v - 1.0));
                let y = plain.y * plain.y.dot(hit.dp_dv).signum();
                let normal = (plain.x * n.x + y * n.y + plain.z * n.z.max(1e-3)).normalize_or(plain.z);
                Frame::about_with(normal, hit.dp_du)
            }
        }
    }

    /// How many kinds of scattering a material has, or how deep its mixtures go, whichever is the larger.
    pub(crate) fn check_blends(surfaces: &[Surface]) -> Result<(), WorldError> {
        let mut n_lobes = vec![1_usize; surfaces.len()];
        for (index, surface) in surfaces.iter().enumerate() {
            let Material::Blend { of, .. } = &surface.material else { continue };
            if let Some(later) = of.iter().find(|part| part.0 as usize >= index) {
                return Err(WorldError::Dangling {
                    what: "a blend of materials",
                    target: "material",
                    index: later.0 as usize,
                    n: index,
                });
            }
            n_lobes[index] = of.iter().map(|part| n_lobes[part.0 as usize]).sum();
            if n_lobes[index] > MAX_LOBES {
                return Err(WorldError::TooMany {
                    what: "materials in a blend",
                    n: n_lobes[index] as u64,
                    limit: MAX_LOBES as u64,
                });
            }
        }
        Ok(())
    }
}
