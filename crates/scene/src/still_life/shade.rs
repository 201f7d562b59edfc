//! The light that a point of a surface sends to the eye.

use dioptric_spectrum::{Illuminant, WavelengthGrid};
use glam::{DVec2, DVec3};

use super::{
    filter::{BOUNCE, Lights, SHEEN},
    lights::{Lux, direct},
    material::{Light, Mix},
    noise::{on_disc, pixel_offset, spread},
    pigment::{N_TONES, Palette, PigmentIndex},
    world::{Seen, World},
};

/// Rays for light a pixel: to the window, to each bulb, into the room, and for the sheen of a rough coat.
const N_WINDOW: usize = 4;
const N_BULB: usize = 3;
const N_BOUNCES: usize = 2;
const N_SHEEN: usize = 2;
/// What light bounced twice and more adds where it has bounced once, lx by day and by lamp.
const FAR_LUX: [f64; 2] = [70.0, 35.0];
/// A rough coat smears the image of a bulb, brighter than the first, as if it were no brighter than the second, cd/m²:
/// so few rays meet a bulb that more would make spots.
const BULB_SHEEN: [f64; 2] = [10_000.0, 800.0];

/// The daylight that comes in by the window.
pub(super) const WINDOW: Illuminant = Illuminant::Daylight(6200.0);

/// Everything that light meets, on the bands of the picture.
pub(super) struct Shader<'a> {
    pub(super) world: &'a World,
    /// Where the eye is.
    pub(super) eye: DVec3,
    pub(super) palette: Palette,
    /// Radiance of a white of 1 lx, by day and by lamp.
    white: [Vec<f32>; 2],
}

impl<'a> Shader<'a> {
    pub(super) fn new(world: &'a World, eye: DVec3, grid: &WavelengthGrid) -> Self {
        let white = [WINDOW, Illuminant::Blackbody(2850.0)]
            .map(|light| light.white_radiance(grid, 1.0).into_iter().map(|v| v as f32).collect());
        Self { world, eye, palette: Palette::on(grid), white }
    }

    fn white(&self, light: Light) -> &[f32] {
        &self.white[usize::from(light == Light::Warm)]
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
    pub(super) fn add_glow(&self, seen: &Seen, share: f32, tint: Option<&[f32]>, own: &mut [f32]) {
        let Some((light, luminance)) = seen.surface.glow else { return };
        let factor = share * (std::f64::consts::PI * luminance) as f32;
        for (band, (own, white)) in own.iter_mut().zip(self.white(light)).enumerate() {
            *own += factor * white * tint.map_or(1.0, |t| t[band]);
        }
    }

    /// Adds a share of what a clear coat or a polished metal mirrors.
    pub(super) fn add_mirrored(&self, seen: &Seen, share: f32, offset: DVec2, own: &mut [f32]) {
        let direction = self.mirrored(seen, DVec2::ZERO);
        let Some(hit) = self.world.first_hit(seen.ray(direction), 0.0, None) else { return };
        let far = self.world.seen(&hit, direction, 0.004);
        // A metal shows the noise of what it shows; under a clear coat hardly any is seen.
        let (n_window, n_bulb) = if seen.surface.coat.metal.is_some() { (4, 2) } else { (1, 1) };
        let lux = direct(self.world, &far, n_window, n_bulb, [offset, (offset + DVec2::splat(0.5)).fract()]);
        let light = [(lux.day + FAR_LUX[0]) as f32, (lux.warm + FAR_LUX[1]) as f32];
        let tint = seen.surface.coat.metal.map(|pigment| self.palette.of(pigment));
        for &(pigment, part) in far.surface.mix.parts() {
            for (band, (own, reflectance)) in own.iter_mut().zip(self.palette.of(pigment)).enumerate() {
                let white = light[0] * self.white[0][band] + light[1] * self.white[1][band];
                *own += share * part * reflectance * white * tint.map_or(1.0, |t| t[band]);
            }
        }
        self.add_glow(&far, share, tint, own);
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
    /// coat, which is what it sends on to the eye.
    pub(super) fn gather(&self, seen: &Seen, row: usize, column: usize) -> Lights {
        let offsets: [DVec2; 6] = std::array::from_fn(|which| pixel_offset(row, column, which));
        let lux = direct(self.world, seen, N_WINDOW, N_BULB, [offsets[0], offsets[1]]);
        let mut lights = Lights::default();
        (lights[0], lights[1]) = (lux.day as f32, lux.warm as f32);
        let (x, y) = seen.normal.any_orthonormal_pair();
        for i in 0..N_BOUNCES {
            let disc = on_disc(spread(i, offsets[2]));
            let up = (1.0 - disc.length_squared()).max(0.0).sqrt();
            let direction = disc.x * x + disc.y * y + up * seen.normal;
            // The window and the lamps have been counted: what glows does not count again.
            if let Some((far, lux)) = self.look(seen, direction, 0.02, spread(i, offsets[3])) {
                self.add_tones(&far.surface.mix, lux, 1.0 / N_BOUNCES as f32, &mut lights[BOUNCE..]);
            }
        }
        if seen.surface.coat.roughness > 0.0 {
            let share = self.fresnel(seen) as f32 / N_SHEEN as f32;
            for i in 0..N_SHEEN {
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
        let lux = direct(self.world, &far, 1, 1, [offset, (offset + DVec2::splat(0.5)).fract()]);
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
    pub(super) fn add_lit(&self, lights: &Lights, pigments: &[(PigmentIndex, f32)], sheen: f32, spectrum: &mut [f32]) {
        let [day, warm] = &self.white;
        let tones = &self.palette.tones;
        let in_tones =
            |first: usize, band: usize| -> f32 { (0..N_TONES).map(|i| lights[first + i] * tones[i][band]).sum() };
        let light: Vec<f32> = (0..spectrum.len())
            .map(|band| {
                (lights[0] + in_tones(BOUNCE, band)) * day[band]
                    + (lights[1] + in_tones(BOUNCE + N_TONES, band)) * warm[band]
            })
            .collect();
        for &(pigment, share) in pigments {
            for ((s, reflectance), light) in spectrum.iter_mut().zip(self.palette.of(pigment)).zip(&light) {
                *s += share * reflectance * light;
            }
        }
        if sheen > 0.0 {
            for (band, s) in spectrum.iter_mut().enumerate() {
                *s += sheen * (in_tones(SHEEN, band) * day[band] + in_tones(SHEEN + N_TONES, band) * warm[band]);
            }
        }
    }
}
