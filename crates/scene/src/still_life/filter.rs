//! Smoothing of sampled light over the pixels of one surface.

use dioptric_spectrum::{Cancel, Cancelled};
use glam::DVec3;
use rayon::prelude::*;

/// Numbers of light a pixel: by day and by lamp straight from the lights, then sheen, then light bounced.
pub(super) const N_LIGHTS: usize = 14;
/// The first number of sheen: by day and by lamp, each by tone.
pub(super) const SHEEN: usize = 2;
/// The first number of light bounced, likewise; these are smoothed more.
pub(super) const BOUNCE: usize = 8;

/// The surface that fills most of a pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Guide {
    pub(super) object: u32,
    pub(super) point: DVec3,
    pub(super) normal: DVec3,
}

/// Light on each pixel's surface.
pub(super) type Lights = [f32; N_LIGHTS];

/// Returns the light with the noise of its samples smoothed away, edges of surfaces kept.
///
/// Three passes of a 5 × 5 binomial window, 1, 2 and 4 pixels apart, in which a pixel of another object, another
/// slope or off the plane does not count (Dammertz et al. 2010). Only bounced light takes part in the third.
pub(super) fn smoothed(
    guides: &[Guide],
    lights: Vec<Lights>,
    columns: usize,
    cancel: &Cancel,
) -> Result<Vec<Lights>, Cancelled> {
    let mut lights = lights;
    for (step, first) in [(1, 0), (2, 0), (4, BOUNCE)] {
        lights = (0..guides.len())
            .into_par_iter()
            .with_min_len(columns)
            .map(|index| {
                cancel.check()?;
                Ok(smoothed_pixel(guides, &lights, columns, index, step, first))
            })
            .collect::<Result<_, _>>()?;
    }
    Ok(lights)
}

fn smoothed_pixel(
    guides: &[Guide],
    lights: &[Lights],
    columns: usize,
    index: usize,
    step: i64,
    first: usize,
) -> Lights {
    const WINDOW: [f64; 5] = [1.0, 4.0, 6.0, 4.0, 1.0];
    let rows = guides.len() / columns;
    let (row, column) = ((index / columns) as i64, (index % columns) as i64);
    let here = &guides[index];
    let (mut sum, mut weights) = ([0.0; N_LIGHTS], 0.0);
    for (i, wy) in WINDOW.iter().enumerate() {
        let r = row + step * (i as i64 - 2);
        if r < 0 || r >= rows as i64 {
            continue;
        }
        for (j, wx) in WINDOW.iter().enumerate() {
            let c = column + step * (j as i64 - 2);
            if c < 0 || c >= columns as i64 {
                continue;
            }
            let other = r as usize * columns + c as usize;
            let there = &guides[other];
            let slope = here.normal.dot(there.normal);
            if there.object != here.object || slope < 0.7 {
                continue;
            }
            // Points of the same plane count fully; those a few pixels' width off it hardly.
            let apart = there.point - here.point;
            let off_plane = here.normal.dot(apart).powi(2) / (apart.length_squared() + 1e-12);
            let weight = wx * wy * slope.powi(8) * (-8.0 * off_plane).exp();
            weights += weight;
            for k in first..N_LIGHTS {
                sum[k] += weight * f64::from(lights[other][k]);
            }
        }
    }
    let mut result = lights[index];
    for k in first..N_LIGHTS {
        result[k] = (sum[k] / weights) as f32;
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_smoothed_within_an_object_and_not_across() {
        let columns = 32;
        let guide = |index: usize| Guide {
            object: u32::from(index % columns >= 16),
            point: DVec3::new((index % columns) as f64, (index / columns) as f64, 0.0),
            normal: DVec3::Z,
        };
        let guides: Vec<Guide> = (0..columns * 8).map(guide).collect();
        let noisy = |index: usize| {
            let (row, column) = (index / columns, index % columns);
            [if column >= 16 { 100.0 } else { 10.0 } + ((row + column) % 2) as f32; N_LIGHTS]
        };
        let lights = smoothed(&guides, (0..columns * 8).map(noisy).collect(), columns, &Cancel::new()).unwrap();
        for (index, light) in lights.iter().enumerate() {
            let expected = if index % columns >= 16 { 100.5 } else { 10.5 };
            assert!(light.iter().all(|v| (v - expected).abs() < 0.2), "{index}: {light:?}");
        }
    }
}
