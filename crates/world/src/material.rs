//! What surfaces are made of.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::{
    Beyond, Bsdf, Film, Hit, MaterialId, MediumId, SpectralCurve, TextureId, WorldError,
    bsdf::{Lobe, MAX_LOBES},
    film, fresnel,
    hair::Hair,
    microfacet::Ggx,
    sampling::Frame,
    texture::Textures,
    uv::TexturePoint,
    velvet,
};
use dioptric_optics::Glass;
use dioptric_spectrum::{Spectrum, lanes};

/// How a surface scatters light.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
    /// Diffuse and rough on a small scale, like clay: brighter than Lambert's where light goes back to where it came from
    /// (Oren & Nayar 1994).
    RoughMatte {
        /// Reflectance, 0–1.
        reflectance: TextureId,
        /// The standard deviation of its slopes, degrees.
        sigma_deg: TextureId,
    },
    /// What a boundary mirrors alone, times a color; light that enters it is lost. A part of a [`Sum`](Self::Sum), as
    /// pbrt's 3rd version has it.
    Glossy {
        /// What the reflectance by Fresnel's equations is multiplied by, 0–1.
        reflectance: TextureId,
        /// Index of refraction behind the boundary over that before it.
        index: SpectralCurve,
        /// How rough it is.
        roughness: Roughness,
    },
    /// A [`Dielectric`](Self::Dielectric) whose mirrored and refracted light is colored, as no clear medium's is.
    Glass {
        /// What the mirrored light is multiplied by, 0–1.
        reflectance: TextureId,
        /// What the refracted light is multiplied by, 0–1.
        transmittance: TextureId,
        /// Index of refraction.
        index: SpectralCurve,
        /// How rough it is.
        roughness: Roughness,
    },
    /// A clear pane so thin that it is one surface: light is mirrored between its sides to all orders and goes on straight.
    Pane {
        /// Index of refraction.
        index: SpectralCurve,
    },
    /// A diffuse base below a glossy coat, after Ashikhmin & Shirley (2000), as pbrt's 3rd version has it.
    Substrate {
        /// Reflectance of the base, 0–1.
        base: TextureId,
        /// Reflectance of the coat at right angles, 0–1; it rises to 1 at grazing ones.
        coat: TextureId,
        /// How rough the coat is.
        roughness: Roughness,
    },
    /// The material of glTF 2.0, by the formulas of its appendix B: a metal in the share `metallic`, else a diffuse base
    /// below a mirroring layer. A base of which the share `transmission` is a thin clear sheet follows
    /// `KHR_materials_transmission`.
    MetallicRoughness {
        /// The color of the base, or the reflectance of the metal at right angles.
        color: TextureId,
        /// The share of metal, 0–1.
        metallic: TextureId,
        /// The square root of GGX's α, 0–1.
        roughness: TextureId,
        /// Reflectance of the layer at right angles: 0.04 unless extensions say otherwise.
        mirrored: TextureId,
        /// Reflectance of the layer at grazing angles: 1 unless extensions say otherwise.
        edge: TextureId,
        /// The share of the base that lets light through; none for 0.
        transmission: Option<TextureId>,
        /// How strongly it is brushed, 0–1: along u α goes towards 1 by the square of it; none for 0 (`KHR_materials_anisotropy`).
        brushed: Option<TextureId>,
    },
    /// A material below a clear coat of index 1.5 that takes what it mirrors (`KHR_materials_clearcoat`).
    Clearcoat {
        /// What lies below.
        base: MaterialId,
        /// The share of the surface that is coated, 0–1.
        amount: TextureId,
        /// The square root of GGX's α of the coat, 0–1.
        roughness: TextureId,
    },
    /// A material below the sheen of cloth, which takes what its fibers send back (`KHR_materials_sheen`).
    Sheen {
        /// What lies below.
        base: MaterialId,
        /// The color of the fibers, 0–1.
        color: TextureId,
        /// The square root of their α, 0–1.
        roughness: TextureId,
    },
    /// A hair (Chiang & al. 2016), along u of a tube that is met from outside alone.
    Hair {
        /// The color of much of it, 0–1.
        color: TextureId,
        /// How rough it is along and around, 0–1.
        roughness: [f32; 2],
        /// How far the scales on it are tilted towards its root, degrees.
        tilt_deg: f32,
        /// Index of refraction.
        index: f32,
    },
    /// The light of two materials together.
    Sum {
        /// The two.
        of: [MaterialId; 2],
    },
    /// Two materials in a share of the surface each.
    Blend {
        /// The two.
        of: [MaterialId; 2],
        /// The share of the second, 0–1.
        amount: TextureId,
    },
    /// Nothing: rays pass as if the surface weren't there, unless it glows.
    Open,
}

/// How rough a mirroring boundary is: the GGX distribution's α along u and v, or `None` for a smooth one.
pub type Roughness = Option<[TextureId; 2]>;

/// Detail of a surface that is too fine for its shape.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Relief {
    /// A texture of heights, m, over the surface.
    Heights(TextureId),
    /// A picture of normals: red, green and blue 0–1 stand for −1 to 1 along u, v and the normal.
    Normals(TextureId),
    /// The same with the parts along u and v multiplied.
    ScaledNormals(TextureId, f32),
    /// The [tilt](crate::Pattern::tilt) of a pattern.
    Pattern(TextureId),
}

impl Relief {
    pub(crate) fn texture(self) -> TextureId {
        match self {
            Self::Heights(texture)
            | Self::Normals(texture)
            | Self::ScaledNormals(texture, _)
            | Self::Pattern(texture) => texture,
        }
    }
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
    pub(crate) inside: Option<SpectralCurve>,
    /// How much of the surface is there, 0–1; all of it where there is none.
    pub(crate) coverage: Option<TextureId>,
    /// What the radiance of shapes that glow is multiplied by.
    pub(crate) glow: Option<TextureId>,
    /// What fills shapes that it lets light into.
    pub(crate) filling: Option<MediumId>,
    /// How far what is brushed is turned from u, counterclockwise, rad.
    pub(crate) turn_rad: f32,
    /// A picture of directions besides: red and green 0–1 stand for −1 to 1 along u and v.
    pub(crate) directions: Option<TextureId>,
    /// What lets diffuse light through the base of glTF's material: the share of it, and its color (`KHR_materials_diffuse_transmission`).
    pub(crate) behind: Option<[TextureId; 2]>,
    /// The film over the base of glTF's material (`KHR_materials_iridescence`).
    pub(crate) film: Option<Film>,
    /// Whether rays may pass as if the surface weren't there.
    pub(crate) has_gaps: bool,
}

impl Surface {
    pub(crate) fn new(name: String, material: Material, relief: Option<Relief>) -> Self {
        let inside = match &material {
            Material::Coated { index, .. } => Some(index.mapped(|n| fresnel::diffuse_reflectance(1.0 / n))),
            _ => None,
        };
        let has_gaps = matches!(material, Material::Open | Material::Hair { .. });
        let (coverage, glow, filling, directions, behind, film) = (None, None, None, None, None, None);
        let turn_rad = 0.0;
        Self { name, material, relief, inside, coverage, glow, filling, turn_rad, directions, behind, film, has_gaps }
    }

    /// How many kinds of scattering it has besides those of its parts.
    fn n_own_lobes(&self) -> usize {
        match &self.material {
            Material::Blend { .. } | Material::Sum { .. } => 0,
            Material::MetallicRoughness { transmission, .. } => {
                1 + usize::from(transmission.is_some()) + usize::from(self.behind.is_some())
            }
            _ => 1,
        }
    }
}

impl Material {
    /// The textures that the material names.
    pub(crate) fn textures(&self) -> Vec<TextureId> {
        let rough = |roughness: &Roughness| roughness.iter().flatten().copied().collect::<Vec<_>>();
        match self {
            Self::Matte { reflectance } => vec![*reflectance],
            Self::Hair { color, .. } => vec![*color],
            Self::Translucent { reflectance, transmittance } => vec![*reflectance, *transmittance],
            Self::RoughMatte { reflectance, sigma_deg } => vec![*reflectance, *sigma_deg],
            Self::Mirror { reflectance, roughness } | Self::Glossy { reflectance, roughness, .. } => {
                [vec![*reflectance], rough(roughness)].concat()
            }
            Self::Glass { reflectance, transmittance, roughness, .. } => {
                [vec![*reflectance, *transmittance], rough(roughness)].concat()
            }
            Self::Substrate { base, coat, roughness } => [vec![*base, *coat], rough(roughness)].concat(),
            Self::MetallicRoughness { color, metallic, roughness, mirrored, edge, transmission, brushed } => {
                let parts = [*color, *metallic, *roughness, *mirrored, *edge];
                parts.into_iter().chain(*transmission).chain(*brushed).collect()
            }
            Self::Clearcoat { amount, roughness, .. } => vec![*amount, *roughness],
            Self::Sheen { color, roughness, .. } => vec![*color, *roughness],
            Self::Metal { roughness, .. } | Self::Dielectric { roughness, .. } => rough(roughness),
            Self::Coated { base, roughness, .. } => [vec![*base], rough(roughness)].concat(),
            Self::Blend { amount, .. } => vec![*amount],
            Self::Open | Self::Pane { .. } | Self::Sum { .. } => Vec::new(),
        }
    }

    /// The materials that it is made of.
    pub(crate) fn parts(&self) -> &[MaterialId] {
        match self {
            Self::Blend { of, .. } | Self::Sum { of } => of,
            Self::Clearcoat { base, .. } | Self::Sheen { base, .. } => std::slice::from_ref(base),
            _ => &[],
        }
    }
}

/// All materials and textures of a world.
#[derive(Clone, Copy)]
pub(crate) struct Surfaces<'a> {
    pub(crate) surfaces: &'a [Surface],
    pub(crate) textures: Textures<'a>,
}

impl Surfaces<'_> {
    /// Whether a material may mirror light or let it through without any spread, wherever it is met.
    pub(crate) fn may_mirror(self, material: MaterialId) -> bool {
        match &self.surfaces[material.0 as usize].material {
            Material::Matte { .. }
            | Material::RoughMatte { .. }
            | Material::Translucent { .. }
            | Material::Hair { .. } => false,
            Material::Sum { of } | Material::Blend { of, .. } => of.iter().any(|&part| self.may_mirror(part)),
            Material::Sheen { base, .. } => self.may_mirror(*base),
            _ => true,
        }
    }

    /// Returns the scattering function at a hit.
    pub(crate) fn bsdf<const N: usize>(
        self,
        hit: &Hit,
        at: &TexturePoint<'_>,
        outgoing: Vec3,
        wavelengths_nm: &[f32; N],
    ) -> Bsdf<N> {
        let surface = &self.surfaces[hit.material.0 as usize];
        let mut frame = self.frame(hit, at);
        if surface.turn_rad != 0.0 || surface.directions.is_some() {
            frame = frame.turned(self.turn_rad(hit, at, frame));
        }
        let mut bsdf = Bsdf::new(frame, hit.geometric_normal, outgoing);
        self.add_lobes(&mut bsdf, hit.material, at, (1.0, false), wavelengths_nm);
        // Where a part of a mixture is open, the hit is one of the rest.
        if surface.has_gaps && surface.material != Material::Open {
            let share = self.share_of_parts(&surface.material, at);
            if share > 0.0 {
                bsdf.divide(share);
            }
        }
        bsdf
    }

    /// Returns how much of the surface of a material is there, 0–1.
    pub(crate) fn coverage(self, material: MaterialId, at: &TexturePoint<'_>) -> f32 {
        let surface = &self.surfaces[material.0 as usize];
        let own = surface.coverage.map_or(1.0, |coverage| self.textures.number(coverage, at).clamp(0.0, 1.0));
        if own > 0.0 { own * self.share_of_parts(&surface.material, at) } else { 0.0 }
    }

    fn share_of_parts(self, material: &Material, at: &TexturePoint<'_>) -> f32 {
        match material {
            Material::Open => 0.0,
            Material::Blend { of: [a, b], amount } => {
                let amount = self.textures.number(*amount, at).clamp(0.0, 1.0);
                (1.0 - amount) * self.coverage(*a, at) + amount * self.coverage(*b, at)
            }
            _ => 1.0,
        }
    }

    /// Adds what a material scatters in a share of the surface; as one term of a sum where that is said.
    fn add_lobes<const N: usize>(
        self,
        bsdf: &mut Bsdf<N>,
        material: MaterialId,
        at: &TexturePoint<'_>,
        (share, is_term): (f32, bool),
        wavelengths_nm: &[f32; N],
    ) {
        let surface = &self.surfaces[material.0 as usize];
        let share_of = |texture: TextureId| -> [f32; N] {
            let value = self.textures.spectral(texture, at, wavelengths_nm);
            lanes(|lane| value[lane].clamp(0.0, 1.0))
        };
        let number = |texture: TextureId| self.textures.number(texture, at).clamp(0.0, 1.0);
        let rough = |roughness: &Roughness| {
            roughness.and_then(|alphas| {
                let [x, y] = alphas.map(|alpha| self.textures.number(alpha, at));
                Ggx::new(x, y)
            })
        };
        let part = |bsdf: &mut Bsdf<N>, part: MaterialId, share: f32, is_term: bool| {
            if share > 0.0 {
                let own = self.surfaces[part.0 as usize].coverage.map_or(1.0, number);
                self.add_lobes(bsdf, part, at, (share * own, is_term), wavelengths_nm);
            }
        };
        let lobe = match &surface.material {
            Material::Matte { reflectance } => {
                Lobe::Diffuse { reflectance: share_of(*reflectance), transmittance: [0.0; N] }
            }
            Material::Translucent { reflectance, transmittance } => {
                let (r, t) = (share_of(*reflectance), share_of(*transmittance));
                let down: [f32; N] = lanes(|lane| (r[lane] + t[lane]).max(1.0).recip());
                Lobe::Diffuse {
                    reflectance: lanes(|lane| r[lane] * down[lane]),
                    transmittance: lanes(|lane| t[lane] * down[lane]),
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
                    Lobe::Dielectric { index, reflectance: [1.0; N], transmittance: [1.0; N], rough: rough(roughness) }
                }
            }
            Material::Glass { reflectance, transmittance, index, roughness } => {
                let (index, transmittance) = (index.at(wavelengths_nm), share_of(*transmittance));
                if index.iter().all(|n| *n == 1.0) {
                    Lobe::Pane { reflectance: [0.0; N], transmittance, rough: None }
                } else {
                    let reflectance = share_of(*reflectance);
                    Lobe::Dielectric { index, reflectance, transmittance, rough: rough(roughness) }
                }
            }
            Material::Pane { index } => {
                let index = index.at(wavelengths_nm);
                let cos = bsdf.cosine();
                // R + T² R + T² R³ + … of its two sides.
                let reflectance = index.map(|n| {
                    let once = fresnel::dielectric(cos, n);
                    2.0 * once / (1.0 + once)
                });
                Lobe::Pane { reflectance, transmittance: reflectance.map(|r| 1.0 - r), rough: None }
            }
            Material::RoughMatte { reflectance, sigma_deg } => {
                let variance = self.textures.number(*sigma_deg, at).to_radians().powi(2);
                let constants = [1.0 - variance / (2.0 * (variance + 0.33)), 0.45 * variance / (variance + 0.09)];
                Lobe::RoughDiffuse { reflectance: share_of(*reflectance), constants }
            }
            Material::Hair { color, roughness, tilt_deg, index } => {
                Lobe::Hair(Hair::new(share_of(*color), *roughness, *tilt_deg, *index))
            }
            Material::Glossy { reflectance, index, roughness } => Lobe::Glossy {
                reflectance: share_of(*reflectance),
                index: index.at(wavelengths_nm),
                rough: rough(roughness),
            },
            Material::Substrate { base, coat, roughness } => {
                Lobe::Substrate { diffuse: share_of(*base), mirrored: share_of(*coat), rough: rough(roughness) }
            }
            Material::MetallicRoughness { color, metallic, roughness, mirrored, edge, transmission, brushed } => {
                let (color, metallic, alpha) = (share_of(*color), number(*metallic), number(*roughness).powi(2));
                let (mirrored, edge) = (share_of(*mirrored), number(*edge));
                let through = transmission.map_or(0.0, number);
                let strength = brushed.map_or(0.0, number);
                let rough = Ggx::new(alpha + (1.0 - alpha) * strength * strength, alpha);
                let straight = lanes(|lane| mirrored[lane] + metallic * (color[lane] - mirrored[lane]));
                let lost = [mirrored.iter().copied().fold(0.0, f32::max), edge];
                let (clear, below) = ((1.0 - metallic) * through, (1.0 - metallic) * (1.0 - through));
                let diffuse = lanes(|lane| color[lane] * below);
                let edge = edge + metallic * (1.0 - edge);
                let layered = Lobe::Layered { diffuse, mirrored: straight, edge, lost, rough };
                if clear <= 0.0 && surface.film.is_none() && surface.behind.is_none() {
                    layered
                } else {
                    self.add_based(bsdf, (share, layered), (color, clear, below), (surface, at), wavelengths_nm);
                    return;
                }
            }
            Material::Clearcoat { base, amount, roughness } => {
                let mirrored = number(*amount) * fresnel::between(0.04, 1.0, fresnel::schlick_tail(bsdf.cosine()));
                let alpha = number(*roughness).powi(2);
                let coat = Lobe::Mirror { reflectance: [1.0; N], rough: Ggx::new(alpha, alpha) };
                bsdf.push(share * mirrored, coat);
                part(bsdf, *base, share * (1.0 - mirrored), is_term);
                return;
            }
            Material::Sheen { base, color, roughness } => {
                let (color, alpha) = (share_of(*color), number(*roughness).powi(2));
                let most = color.iter().copied().fold(0.0, f32::max);
                let sent_back = most * velvet::albedo(alpha, bsdf.cosine());
                bsdf.push_term(share, Lobe::Velvet { color, alpha });
                part(bsdf, *base, share * (1.0 - sent_back), true);
                return;
            }
            Material::Sum { of } => {
                of.iter().for_each(|of| part(bsdf, *of, share, true));
                return;
            }
            Material::Coated { base, index, roughness } => Lobe::Coated {
                diffuse: share_of(*base),
                index: index.at(wavelengths_nm),
                inside: surface.inside.as_ref().map_or([0.0; N], |inside| inside.at(wavelengths_nm)),
                rough: rough(roughness),
            },
            Material::Blend { of: [a, b], amount } => {
                let amount = number(*amount);
                part(bsdf, *a, share * (1.0 - amount), is_term);
                part(bsdf, *b, share * amount, is_term);
                return;
            }
            // Of a mixture, which rays pass without a hit, it is no part.
            Material::Open if share < 1.0 => return,
            Material::Open => Lobe::Open,
        };
        match is_term {
            true => bsdf.push_term(share, lobe),
            false => bsdf.push(share, lobe),
        }
    }

    /// Returns how far what is brushed is turned from u about the normal.
    #[inline(never)]
    fn turn_rad(self, hit: &Hit, at: &TexturePoint<'_>, frame: Frame) -> f32 {
        let surface = &self.surfaces[hit.material.0 as usize];
        let of_picture = surface.directions.map_or(0.0, |picture| {
            let [x, y, _] = self.textures.rgb(picture, at).map(|v| 2.0 * v - 1.0);
            y.atan2(x)
        });
        let turn_rad = surface.turn_rad + of_picture;
        // Pictures may be laid mirrored.
        if frame.y.dot(hit.dp_dv) < 0.0 { -turn_rad } else { turn_rad }
    }

    /// Adds glTF's material where its layer bears a film, or its base lets light through: `clear` of it straight, and of what is `below` as
    /// much as the surface says by Lambert's law.
    #[inline(never)]
    fn add_based<const N: usize>(
        self,
        bsdf: &mut Bsdf<N>,
        (share, layered): (f32, Lobe<N>),
        (color, clear, below): ([f32; N], f32, f32),
        (surface, at): (&Surface, &TexturePoint<'_>),
        wavelengths_nm: &[f32; N],
    ) {
        let Lobe::Layered { mut diffuse, mirrored, edge, lost, rough } = layered else { return };
        let mut behind = [0.0; N];
        if let Some([amount, color]) = surface.behind {
            let amount = self.textures.number(amount, at).clamp(0.0, 1.0);
            let behind_color: [f32; N] = self.textures.spectral(color, at, wavelengths_nm);
            behind = behind_color.map(|c| c.clamp(0.0, 1.0) * amount * below);
            diffuse = diffuse.map(|d| d * (1.0 - amount));
        }
        let cos = bsdf.cosine();
        let (layer, let_through): (Lobe<N>, [f32; N]) = match surface.film {
            None => {
                let let_through = 1.0 - fresnel::between(lost[0], lost[1], fresnel::schlick_tail(cos));
                (Lobe::Layered { diffuse, mirrored, edge, lost, rough }, [let_through; N])
            }
            Some(Film { index, thickness_nm }) => {
                let thickness_nm = self.textures.number(thickness_nm, at).max(0.0);
                let waves = wavelengths_nm.map(|nm| 2.0 * index * thickness_nm / nm);
                let let_through = lanes(|lane| 1.0 - film::reflectance(cos, index, mirrored[lane], waves[lane]));
                (Lobe::Filmed { diffuse, base: mirrored, waves, index, rough }, let_through)
            }
        };
        bsdf.push_term(share, layer);
        let transmittance = lanes(|lane| color[lane] * (clear * let_through[lane]));
        bsdf.push_term(share, Lobe::Pane { reflectance: [0.0; N], transmittance, rough });
        let transmittance = lanes(|lane| behind[lane] * let_through[lane]);
        bsdf.push_term(share, Lobe::Diffuse { reflectance: [0.0; N], transmittance });
    }

    /// Returns the shading frame at a hit, with relief: x runs along u.
    fn frame(self, hit: &Hit, at: &TexturePoint<'_>) -> Frame {
        let plain = Frame::about_with(hit.shading_normal, hit.dp_du);
        match self.surfaces[hit.material.0 as usize].relief {
            None => plain,
            Some(Relief::Heights(heights)) => {
                // Tilt the tangents by the slope of the heights (Blinn 1978).
                const STEP: f32 = 1e-3;
                let tangents = [hit.dp_du, hit.dp_dv];
                let height = |du: f32, dv: f32| self.textures.number(heights, &at.beside((du, dv), tangents));
                let slope_u = (height(0.5 * STEP, 0.0) - height(-0.5 * STEP, 0.0)) / STEP;
                let slope_v = (height(0.0, 0.5 * STEP) - height(0.0, -0.5 * STEP)) / STEP;
                let n = hit.shading_normal;
                let along = |tangent: Vec3| tangent - n * n.dot(tangent);
                let (along_u, along_v) = (along(hit.dp_du), along(hit.dp_dv));
                let normal = (along_u + slope_u * n).cross(along_v + slope_v * n).normalize_or(n);
                let normal = if normal.dot(n) < 0.0 { -normal } else { normal };
                Frame::about_with(normal, hit.dp_du)
            }
            Some(Relief::Normals(normals)) => self.with_normals(hit, at, plain, (normals, 1.0)),
            Some(Relief::ScaledNormals(normals, scale)) => self.with_normals(hit, at, plain, (normals, scale)),
            Some(Relief::Pattern(pattern)) => {
                let tilted = at.own().normal + self.textures.tilt(pattern, at);
                Frame::about_with(at.frame.world_normal(tilted), hit.dp_du)
            }
        }
    }

    /// Returns the shading frame by a picture of normals, those along u and v multiplied.
    fn with_normals(self, hit: &Hit, at: &TexturePoint<'_>, plain: Frame, (normals, scale): (TextureId, f32)) -> Frame {
        let n = Vec3::from_array(self.textures.rgb(normals, at).map(|v| 2.0 * v - 1.0));
        let n = n * Vec3::new(scale, scale, 1.0);
        let y = plain.y * plain.y.dot(hit.dp_dv).signum();
        let normal = (plain.x * n.x + y * n.y + plain.z * n.z.max(1e-3)).normalize_or(plain.z);
        Frame::about_with(normal, hit.dp_du)
    }

    /// Checks that materials are made of earlier ones and have few enough kinds of scattering, and finds those with gaps.
    pub(crate) fn check_parts(surfaces: &mut [Surface]) -> Result<(), WorldError> {
        let mut n_lobes = vec![0_usize; surfaces.len()];
        for index in 0..surfaces.len() {
            let (earlier, rest) = surfaces.split_at_mut(index);
            let Some(surface) = rest.first_mut() else { break };
            let parts = surface.material.parts();
            if let Some(later) = parts.iter().find(|part| part.0 as usize >= index) {
                return Err(WorldError::Dangling {
                    what: "a material made of others",
                    target: "material",
                    index: later.0 as usize,
                    n: index,
                });
            }
            n_lobes[index] = surface.n_own_lobes() + parts.iter().map(|part| n_lobes[part.0 as usize]).sum::<usize>();
            surface.has_gaps |= surface.coverage.is_some()
                || matches!(surface.material, Material::Blend { .. })
                    && parts.iter().any(|part| earlier[part.0 as usize].has_gaps);
            if n_lobes[index] > MAX_LOBES {
                return Err(WorldError::TooMany {
                    what: "kinds of scattering in a material",
                    n: n_lobes[index] as u64,
                    limit: MAX_LOBES as u64,
                });
            }
        }
        Ok(())
    }
}
