//! The still life as rays meet it, wherever they come from: what the picture of it is made of, a ray at a time.
//!
//! The light on surfaces is gathered once for each pixel of the picture and smoothed, as the painter does it, and
//! looked up where a ray meets what the picture shows. What the picture does not show, since something stands before
//! it or it lies beside the picture, gathers its light anew for each ray. Mirrors and gloss without roughness are seen
//! from where the ray comes; the gloss of rough coats is that of the picture.

use dioptric_spectrum::{Cancel, Cancelled, WavelengthGrid};
use glam::{DAffine3, DVec2, DVec3};

use super::{
    StillLife, eye,
    filter::{Guide, Lights, light_between},
    material::{Light, Material},
    pigment::PigmentIndex,
    render::{Eye, LitPixels, Painting, Which, footprint_m, lit_pixels},
    room,
    shade::{Colors, LightRays, Shader, Spectra},
    shape::Ray,
    world::{Hit, Seen, World},
};
use crate::SceneError;

/// The still life with light on its surfaces, to be met by rays.
///
/// Points are in meters in the frame of the room; [`world_from_eye`](Self::world_from_eye) is where the eye of the
/// picture stands in it.
#[derive(Clone, Debug)]
pub struct LitStillLife {
    life: StillLife,
    world: World,
    eye: Eye,
    /// What the picture shows, and what that hides.
    layers: Vec<LitPixels>,
    colors: Colors,
    /// The numbers of the objects' materials.
    material_of: Vec<u32>,
}

/// What a ray meets first.
#[derive(Clone, Debug, PartialEq)]
pub struct StillLifePoint {
    /// The point, m.
    pub point_m: DVec3,
    /// How far along the ray it is, m.
    pub distance_m: f64,
    /// The normal with the relief of the surface, of length 1, turned to where the ray comes from.
    pub normal: DVec3,
    /// The number of the shape, from 0.
    pub object: u32,
    /// The number of the thing that the shape belongs to, from 0.
    pub thing: u32,
    /// The number of the material, from 0.
    pub material: u32,
    /// The share of light that it gives back, scattered or mirrored, at each wavelength that was asked for.
    pub albedo: Vec<f32>,
}

impl StillLife {
    /// Returns where the eye stands in the room and how it looks: from right, up and ahead, m.
    ///
    /// # Errors
    /// When the angle is not between 0° and 180°.
    pub fn world_from_eye(&self) -> Result<DAffine3, SceneError> {
        let eye = eye(self.view()?, self.moved_m);
        Ok(DAffine3 { matrix3: eye.axes, translation: eye.origin })
    }

    /// Lights the still life for rays that come from near the eye of this picture; `progress` gets the part that is done,
    /// 0–1, from any thread.
    ///
    /// It takes about as long as the picture. What lies behind the first things is lit too `with_hidden`.
    ///
    /// # Errors
    /// As [`scene_with`](Self::scene_with).
    pub fn lit(&self, progress: &(dyn Fn(f64) + Sync), cancel: &Cancel) -> Result<LitStillLife, SceneError> {
        let unlit = self.unlit()?;
        let which: &[Which] = if self.with_hidden { &[Which::First, Which::Behind] } else { &[Which::First] };
        let painting = Painting::new(which.len() * self.rows, progress, cancel);
        let (scene, size) = ((&unlit.world, &unlit.colors), (self.rows, self.columns));
        let lit = |&which| lit_pixels(scene, &unlit.eye, size, which, &painting);
        let layers = which.iter().map(lit).collect::<Result<Vec<LitPixels>, Cancelled>>()?;
        Ok(LitStillLife { layers, ..unlit })
    }

    /// Returns the still life for rays at once: light is gathered anew for each of them, with more noise and for longer than
    /// where it is [`lit`](Self::lit) before.
    ///
    /// # Errors
    /// When the size is 0, the angle is not between 0° and 180°, or the eye stands outside the room.
    pub fn unlit(&self) -> Result<LitStillLife, SceneError> {
        self.check()?;
        let world = room::world();
        let eye = eye(self.view()?, self.moved_m);
        let colors = Colors::on(&WavelengthGrid::uniform(LitStillLife::RANGE_NM.0, LitStillLife::RANGE_NM.1, 1.0)?);
        let mut known: Vec<Material> = Vec::new();
        let mut number_of = |material: Material| {
            let number = known.iter().position(|other| *other == material).unwrap_or_else(|| {
                known.push(material);
                known.len() - 1
            });
            number as u32
        };
        let material_of = world.materials().map(&mut number_of).collect();
        Ok(LitStillLife { life: *self, world, eye, layers: Vec::new(), colors, material_of })
    }
}

impl LitStillLife {
    /// The wavelengths at which colors are known, every nanometer; beyond, they would be those at the ends.
    pub const RANGE_NM: (f64, f64) = (300.0, 1100.0);

    /// The picture whose eye it is lit for.
    pub fn picture(&self) -> &StillLife {
        &self.life
    }

    /// Where the eye stands in the room and how it looks: from right, up and ahead, m.
    pub fn world_from_eye(&self) -> DAffine3 {
        DAffine3 { matrix3: self.eye.axes, translation: self.eye.origin }
    }

    /// Adds to `radiance` the spectral radiance that comes along a ray at each of some wavelengths, W m⁻² sr⁻¹ nm⁻¹: to the origin
    /// (m) from the direction, of length 1, into which it looks. Wavelengths are of [`RANGE_NM`](Self::RANGE_NM).
    ///
    /// Details finer than a pixel of the picture are blurred away, as they are in the picture. `random` returns the pair of numbers of 0–1
    /// of a number: what is mirrored, and light that is gathered anew, are sampled with them without bias.
    pub fn add_radiance(
        &self,
        (origin_m, direction): (DVec3, DVec3),
        wavelengths_nm: &[f32],
        random: &dyn Fn(u32) -> [f32; 2],
        radiance: &mut [f32],
    ) {
        let Some((_, seen)) = self.seen(origin_m, direction) else { return };
        let spectra = At { colors: &self.colors, wavelengths_nm };
        let shader = Shader::new(&self.world, origin_m, &self.colors);
        let pair = |number: u32| DVec2::from_array(random(number).map(f64::from));
        shader.add_glow(&seen, 1.0, None, (&spectra, &mut *radiance));
        let (coat, fresnel) = (seen.surface.coat, shader.fresnel(&seen) as f32);
        let is_clear = coat.f0 > 0.0 && coat.roughness == 0.0;
        if is_clear {
            shader.add_mirrored(&seen, fresnel, pair(0), (&spectra, &mut *radiance));
        }
        let (diffuse, sheen) = (diffuse_share(&seen, fresnel), if is_clear { 0.0 } else { 1.0 });
        if diffuse == 0.0 && sheen == 0.0 {
            return;
        }
        let mut pigments: [(PigmentIndex, f32); 4] = [(0, 0.0); 4];
        let parts = seen.surface.mix.parts();
        let pigments = &mut pigments[..parts.len()];
        pigments.iter_mut().zip(parts).for_each(|(own, &(pigment, part))| *own = (pigment, diffuse * part));
        let gathered = || shader.gather(&seen, LightRays::ALL, &std::array::from_fn(|which| pair(1 + which as u32)));
        let lights = self.light_on(&seen).unwrap_or_else(gathered);
        shader.add_lit(&lights, pigments, sheen, (&spectra, radiance));
    }

    /// Returns what a ray meets first, with its albedo at some wavelengths; `None` outside the room.
    pub fn look(&self, origin_m: DVec3, direction: DVec3, wavelengths_nm: &[f32]) -> Option<StillLifePoint> {
        let (hit, seen) = self.seen(origin_m, direction)?;
        let spectra = At { colors: &self.colors, wavelengths_nm };
        let fresnel = Shader::new(&self.world, origin_m, &self.colors).fresnel(&seen) as f32;
        let diffuse = diffuse_share(&seen, fresnel);
        let at = |number: usize| {
            let of = |&(pigment, part): &(PigmentIndex, f32)| diffuse * part * spectra.reflectance(pigment, number);
            let mirrored = seen.surface.coat.metal.map_or(1.0, |metal| spectra.reflectance(metal, number));
            fresnel * mirrored + seen.surface.mix.parts().iter().map(of).sum::<f32>()
        };
        Some(StillLifePoint {
            point_m: hit.point,
            distance_m: hit.t,
            normal: seen.normal,
            object: hit.object as u32,
            thing: self.world.thing_of(hit.object) as u32,
            material: self.material_of[hit.object],
            albedo: (0..wavelengths_nm.len()).map(at).collect(),
        })
    }

    fn seen(&self, origin: DVec3, direction: DVec3) -> Option<(Hit, Seen)> {
        let hit = self.world.first_hit(Ray { origin, direction }, 0.0, None)?;
        let footprint_m = footprint_m(&self.world, &hit, direction, self.eye.view);
        Some((hit, self.world.seen(&hit, direction, footprint_m)))
    }

    /// Returns the light that was gathered for the picture where this is seen in it, between the pixels around.
    fn light_on(&self, seen: &Seen) -> Option<Lights> {
        let to_point = self.eye.axes.transpose() * (seen.point - self.eye.origin);
        if to_point.z <= 0.0 {
            return None;
        }
        let (row, column) = self.eye.view.position_of(to_point.x / to_point.z, to_point.y / to_point.z);
        // The pixels of a surface lie no farther apart than this, sloped as it may be.
        let cosine = (seen.flat_normal.dot(to_point_in_room(seen, &self.eye)) / to_point.length()).abs();
        let reach_m = 3.0 * to_point.length() / (self.eye.view.focal_px * cosine.max(0.05));
        let (here, size) = (Guide::of(seen), (self.life.rows, self.life.columns));
        self.layers.iter().find_map(|layer| {
            let pixel = |r: usize, c: usize| (&layer.guides[r * size.1 + c], &layer.lights[r * size.1 + c]);
            light_between(&here, (row, column), size, reach_m, pixel)
        })
    }
}

fn to_point_in_room(seen: &Seen, eye: &Eye) -> DVec3 {
    seen.point - eye.origin
}

/// The share of light that pigments scatter: none of a metal, all that the coat lets through of others.
fn diffuse_share(seen: &Seen, fresnel: f32) -> f32 {
    if seen.surface.coat.metal.is_some() { 0.0 } else { 1.0 - fresnel }
}

/// Colors at any wavelengths, between those that are known.
struct At<'a> {
    colors: &'a Colors,
    wavelengths_nm: &'a [f32],
}

impl At<'_> {
    fn between(&self, number: usize, value: impl Fn(usize) -> f32) -> f32 {
        let place = f64::from(self.wavelengths_nm[number]).clamp(LitStillLife::RANGE_NM.0, LitStillLife::RANGE_NM.1)
            - LitStillLife::RANGE_NM.0;
        let (first, share) = (place as usize, place.fract() as f32);
        if share == 0.0 { value(first) } else { value(first) + share * (value(first + 1) - value(first)) }
    }
}

impl Spectra for At<'_> {
    fn white(&self, light: Light, number: usize) -> f32 {
        self.between(number, |nm| self.colors.white(light, nm))
    }

    fn reflectance(&self, pigment: PigmentIndex, number: usize) -> f32 {
        self.between(number, |nm| self.colors.reflectance(pigment, nm))
    }

    fn tone(&self, tone: usize, number: usize) -> f32 {
        self.between(number, |nm| self.colors.tone(tone, nm))
    }
}
