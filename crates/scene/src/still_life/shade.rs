//! The light that a point of a surface sends to the eye.

use dioptric_spectrum::{Illuminant, WavelengthGrid};
use glam::{DVec2, DVec3};

use super::{
    filter::{BOUNCE, Lights, SHEEN},
    lights::{Lux, direct},
    material::{Light, Mix},
    noise::{fract, on_disc, spread},
    pigment::{N_TONES, Palette, PigmentIndex},
    world::{Seen, World},
};

/// Rays by which the light on a point is gathered.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightRays {
    /// To the window.
    n_window: usize,
    /// To the brighter bulb.
    n_bulb: usize,
    /// Into the room.
    n_bounces: usize,
    /// For the sheen of a rough coat.
    n_sheen: usize,
}

impl LightRays {
    /// Those of a picture.
    pub(super) const ALL: Self = Self { n_window: 4, n_bulb: 3, n_bounces: 2, n_sheen: 2 };
    /// Fewer, where it is smoothed more.
    pub(super) const FEW: Self = Self { n_window: 3, n_bulb: 2, n_bounces: 2, n_sheen: 2 };
}

/// The offsets that its rays take.
pub(super) const N_OFFSETS: usize = 6;
/// What light bounced twice and more adds where it has bounced once, lx by day and by lamp.
const FAR_LUX: [f64; 2] = [70.0, 35.0];
/// A rough coat smears the image of a bulb, brighter than the first, as if it were no brighter than the second, cd/m²:
/// so few rays meet a bulb that more would make spots.
const BULB_SHEEN: [f64; 2] = [10_000.0, 800.0];

/// The daylight that comes in by the window.
pub(super) const WINDOW: Illuminant = Illuminant::Daylight(6200.0);

/// The colors of lights and pigments at the wavelengths of a spectrum, by number.
pub(super) trait Spectra {
    /// Radiance of a white of 1 lx.
    fn white(&self, light: Light, number: usize) -> f32;
    /// The reflectance of a pigment.
    fn reflectance(&self, pigment: PigmentIndex, number: usize) -> f32;
    /// One of the tones that light bounced is kept in.
    fn tone(&self, tone: usize, number: usize) -> f32;
}

/// The colors on the bands of a picture.
#[derive(Clone, Debug)]
pub(super) struct Colors {
    pub(super) palette: Palette,
    /// Radiance of a white of 1 lx, by day and by lamp.
    white: [Vec<f32>; 2],
}

impl Colors {
    pub(super) fn on(grid: &WavelengthGrid) -> Self {
        let white = [WINDOW, Illuminant::Blackbody(2850.0)]
            .map(|light| light.white_radiance(grid, 1.0).into_iter().map(|v| v as f32).collect());
        Self { palette: Palette::on(grid), white }
    }
}

impl Spectra for Colors {
    fn white(&self, light: Light, number: usize) -> f32 {
        self.white[usize::from(light == Light::Warm)][number]
    }

    fn reflectance(&self, pigment: PigmentIndex, number: usize) -> f32 {
        self.palette.of(pigment)[number]
    }

    fn tone(&self, tone: usize, number: usize) -> f32 {
        self.palette.tones[tone][number]
    }
}

/// Everything that light meets, seen from one place.
pub(super) struct Shader<'a> {
    pub(super) world: &'a World,
    /// Where the eye is.
    pub(super) eye: DVec3,
    pub(super) palette: &'a Palette,
}

impl<'a> Shader<'a> {
    pub(super) fn new(world: &'a World, eye: DVec3, colors: &'a Colors) -> Self {
        Self { world, eye, palette: &colors.palette }
    }

    /// Returns the share of light that the coat sends to the eye.
    pub(super) fn fresnel(&self, seen: &Seen) -> f64 {
        let f0 = seen.surface.coat.f0;
        if f0 == 0.0 {
            return 0.0;
        }
        let cosine = seen.normal.dot((self.eye - seen.point).normalize()).clamp(0.0, 1.0);
        f0 + (1.0 - f0) * (1.0 - cosine).powi(5)
    }

    /// Adds a share of what a surface glows.
    pub(super) fn add_glow(
        &self,
        seen: &Seen,
        share: f32,
        tint: Option<PigmentIndex>,
        (spectra, own): (&impl Spectra, &mut [f32]),
    ) {
        let Some((light, luminance)) = seen.surface.glow else { return };
        let factor = share * (std::f64::consts::PI * luminance) as f32;
        for (band, own) in own.iter_mut().enumerate() {
            *own += factor * spectra.white(light, band) * tint.map_or(1.0, |t| spectra.reflectance(t, band));
        }
    }

    /// Adds a share of what a clear coat or a polished metal mirrors.
    pub(super) fn add_mirrored(
        &self,
        seen: &Seen,
        share: f32,
        offset: DVec2,
        (spectra, own): (&impl Spectra, &mut [f32]),
    ) {
        if own.is_empty() {
            return;
        }
        let direction = self.mirrored(seen, DVec2::ZERO);
        let Some(hit) = self.world.first_hit(seen.ray(direction), 0.0, None) else { return };
        let far = self.world.seen(&hit, direction, 0.004);
        // A metal shows the noise of what it shows; under a clear coat hardly any is seen.
        let (n_window, n_bulb) = if seen.surface.coat.metal.is_some() { (4, 2) } else { (1, 1) };
        let lux = direct(self.world, &far, n_window, n_bulb, [offset, fract(offset + DVec2::splat(0.5))]);
        let light = [(lux.day + FAR_LUX[0]) as f32, (lux.warm + FAR_LUX[1]) as f32];
        let tint = seen.surface.coat.metal;
        for &(pigment, part) in far.surface.mix.parts() {
            for (band, own) in own.iter_mut().enumerate() {
                let white = light[0] * spectra.white(Light::Day, band) + light[1] * spectra.white(Light::Warm, band);
                let reflectance = spectra.reflectance(pigment, band);
                *own += share * part * reflectance * white * tint.map_or(1.0, |t| spectra.reflectance(t, band));
            }
        }
        self.add_glow(&far, share, tint, (spectra, own));
    }

    /// Returns where the eye looks in the coat, turned by the roughness towards a point of the unit disc.
    fn mirrored(&self, seen: &Seen, on_disc: DVec2) -> DVec3 {
        let to_eye = (self.eye - seen.point).normalize();
        let jitter = 0.5 * seen.surface.coat.roughness * on_disc;
        let (x, y) = seen.normal.any_orthonormal_pair();
        let half = (seen.normal + jitter.x * x + jitter.y * y).normalize();
        let direction = 2.0 * half.dot(to_eye) * half - to_eye;
        // Relief can turn the ray into the body: keep it just above.
        let sunk = (0.01 - seen.flat_normal.dot(direction)).max(0.0);
        (direction + sunk * seen.flat_normal).normalize()
    }

    /// Gathers the light on a surface: straight from the lights, bounced once by the room, and the sheen of a rough
    /// coat, which is what it sends on to the eye. The offsets turn the points that its rays go to.
    pub(super) fn gather(&self, seen: &Seen, rays: LightRays, offsets: &[DVec2; N_OFFSETS]) -> Lights {
        let LightRays { n_window, n_bulb, n_bounces, n_sheen } = rays;
        let lux = direct(self.world, seen, n_window, n_bulb, [offsets[0], offsets[1]]);
        let mut lights = Lights::default();
        (lights[0], lights[1]) = (lux.day as f32, lux.warm as f32);
        let (x, y) = seen.normal.any_orthonormal_pair();
        for i in 0..n_bounces {
            let disc = on_disc(spread(i, offsets[2]));
            let up = (1.0 - disc.length_squared()).max(0.0).sqrt();
            let direction = disc.x * x + disc.y * y + up * seen.normal;
            // The window and the lamps have been counted: what glows does not count again.
            if let Some((far, lux)) = self.look(seen, direction, 0.02, spread(i, offsets[3])) {
                self.add_tones(&far.surface.mix, lux, 1.0 / n_bounces as f32, &mut lights[BOUNCE..]);
            }
        }
        if seen.surface.coat.roughness > 0.0 {
            let share = self.fresnel(seen) as f32 / n_sheen as f32;
            for i in 0..n_sheen {
                let direction = self.mirrored(seen, on_disc(spread(i, offsets[4])));
                if let Some((far, lux)) = self.look(seen, direction, 0.01, spread(i, offsets[5])) {
                    self.add_tones(&far.surface.mix, lux, share, &mut lights[SHEEN..]);
                    if let Some((light, luminance)) = far.surface.glow {
                        let smeared = if luminance > BULB_SHEEN[0] { BULB_SHEEN[1] } else { luminance };
                        let lux = (std::f64::consts::PI * smeared) as f32;
                        let first = SHEEN + if light == Light::Warm { N_TONES } else { 0 };
                        lights[first..first + N_TONES].iter_mut().for_each(|l| *l += share * lux);
                    }
                }
            }
        }
        lights
    }

    /// Returns what is seen from a surface, and the light on it.
    fn look(&self, seen: &Seen, direction: DVec3, footprint_m: f64, offset: DVec2) -> Option<(Seen, Lux)> {
        if seen.flat_normal.dot(direction) <= 0.0 {
            return None;
        }
        let hit = self.world.first_hit(seen.ray(direction), 0.0, None)?;
        let far = self.world.seen(&hit, direction, footprint_m);
        let lux = direct(self.world, &far, 1, 1, [offset, fract(offset + DVec2::splat(0.5))]);
        Some((far, Lux { day: lux.day + FAR_LUX[0], warm: lux.warm + FAR_LUX[1] }))
    }

    /// Adds what a mixture sends back, in tones, by day and then by lamp.
    fn add_tones(&self, mix: &Mix, lux: Lux, share: f32, lights: &mut [f32]) {
        for &(pigment, part) in mix.parts() {
            for (tone, reflectance) in self.palette.in_tones[usize::from(pigment)].iter().enumerate() {
                lights[tone] += share * part * reflectance * lux.day as f32;
                lights[N_TONES + tone] += share * part * reflectance * lux.warm as f32;
            }
        }
    }

    /// Adds what a pixel sends from pigments under light, and the sheen over them.
    pub(super) fn add_lit(
        &self,
        lights: &Lights,
        pigments: &[(PigmentIndex, f32)],
        sheen: f32,
        (spectra, spectrum): (&impl Spectra, &mut [f32]),
    ) {
        for (band, s) in spectrum.iter_mut().enumerate() {
            let in_tones =
                |first: usize| -> f32 { (0..N_TONES).map(|i| lights[first + i] * spectra.tone(i, band)).sum() };
            let [day, warm] = [Light::Day, Light::Warm].map(|light| spectra.white(light, band));
            let light = (lights[0] + in_tones(BOUNCE)) * day + (lights[1] + in_tones(BOUNCE + N_TONES)) * warm;
            for &(pigment, share) in pigments {
                *s += share * spectra.reflectance(pigment, band) * light;
            }
            if sheen > 0.0 {
                *s += sheen * (in_tones(SHEEN) * day + in_tones(SHEEN + N_TONES) * warm);
            }
        }
    }
}
