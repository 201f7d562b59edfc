//! The light on a world, for the white balance: what falls on the surfaces that are seen, straight from the lights.

use dioptric_backward::{Pinhole, Sampler};
use dioptric_scene::SceneLight;
use dioptric_spectrum::{Illuminant, Observer, Spectrum, SpectrumError, WavelengthGrid};
use dioptric_world::{World, glam::Vec3};

/// Places of the view that are looked at each way, and how often a light is drawn at each.
const PLACES: usize = 8;
const DRAWS: u32 = 32;

/// Returns the mean light on the surfaces that a view sees, before any is scattered; `None` where none comes so.
///
/// Its spectrum is known every 10 nm from 400 to 700 nm. The numbers that choose places and lights are always the same.
pub(super) fn light_on(world: &World, view: &Pinhole) -> Result<Option<SceneLight>, SpectrumError> {
    let grid = WavelengthGrid::uniform(400.0, 700.0, 10.0)?;
    let mut irradiance = vec![0.0_f64; grid.len()];
    let mut n_seen = 0_u32;
    for place in 0..PLACES * PLACES {
        let share = [place % PLACES, place / PLACES].map(|i| (i as f64 + 0.5) / PLACES as f64);
        let Some(hit) = world.intersect(&view.ray_at(share), f32::INFINITY) else { continue };
        n_seen += 1;
        let normal = facing(hit.shading_normal, hit.point - view.origin());
        for draw in 0..DRAWS {
            let random = Sampler::new(1, place as u32, 0, draw);
            let ([u_light, _], u) = (random.pair(0), random.pair(1));
            let light = |nm: f64| world.sample_light(hit.point, u_light, u, &[nm as f32]);
            let Some(first) = light(550.0) else { continue };
            let cosine = normal.dot(first.direction);
            if cosine <= 0.0 || world.is_occluded(&hit.ray_towards(first.direction), first.distance_m) {
                continue;
            }
            for (sum, &nm) in irradiance.iter_mut().zip(grid.centers_nm()) {
                let radiance = light(nm).map_or(0.0, |sample| sample.radiance[0] / sample.pdf);
                *sum += f64::from(radiance * cosine) / f64::from(DRAWS);
            }
        }
    }
    irradiance.iter_mut().for_each(|sum| *sum /= f64::from(n_seen.max(1)));
    let lux = Observer::Cie1931.xyz(&grid, &irradiance).luminance_cd_m2();
    if !(lux > 0.0 && lux.is_finite()) {
        return Ok(None);
    }
    let spectrum = Spectrum::new(grid.centers_nm().to_vec(), irradiance)?;
    Ok(Some(SceneLight::new(Illuminant::Spectrum(spectrum), lux)))
}

/// Returns the normal of the side that is seen along a direction.
fn facing(normal: Vec3, along: Vec3) -> Vec3 {
    if normal.dot(along) > 0.0 { -normal } else { normal }
}
