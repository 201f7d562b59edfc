//! The light on the still life, measured where a photographer would: on the grays of the chart.

use dioptric_spectrum::{Illuminant, Observer, Spectrum, WavelengthGrid};
use glam::DVec3;

use super::{
    eye,
    pigment::Pigment,
    render::pixel_offsets,
    shade::{Colors, LightRays, Shader},
    shape::Ray,
    world::World,
};
use crate::{SceneError, SceneLight, View};

/// Rows and columns of the rays that look for the grays, over the angle that the arrangement is made for.
const RASTER: (usize, usize) = (144, 216);
const RASTER_FOV_DEG: f64 = 34.0;
/// The grays of the chart: white and four grays; the black reflects too little.
const GRAYS: std::ops::Range<u8> = 18..23;

/// Returns the mean light on the grays of the chart that the eye sees, every 5 nm.
///
/// # Errors
/// When the eye sees none.
pub(super) fn light_on_grays(world: &World) -> Result<SceneLight, SceneError> {
    let (rows, columns) = RASTER;
    let eye = eye(View::from_horizontal_fov_deg(RASTER_FOV_DEG, columns, rows)?, [0.0; 3]);
    let grid = WavelengthGrid::uniform(360.0, 830.0, 5.0)?;
    let colors = Colors::on(&grid);
    let shader = Shader::new(world, eye.origin, &colors);
    let mut sum = vec![0.0_f64; grid.len()];
    let mut n = 0.0;
    for row in 0..rows {
        for column in 0..columns {
            let (x, y) = eye.view.tan_at(row as f64, column as f64);
            let direction = (eye.axes * DVec3::new(x, y, 1.0)).normalize();
            let Some(hit) = world.first_hit(Ray { origin: eye.origin, direction }, 0.0, None) else { continue };
            let seen = world.seen(&hit, direction, 1e-4);
            let &[(pigment, _)] = seen.surface.mix.parts() else { continue };
            if !GRAYS.map(Pigment::patch).any(|gray| gray == pigment) {
                continue;
            }
            let mut spectrum = vec![0.0_f32; grid.len()];
            let lights = shader.gather(&seen, LightRays::ALL, &pixel_offsets(row, column));
            shader.add_lit(&lights, &[(pigment, 1.0)], 0.0, (&colors, &mut spectrum));
            for ((sum, radiance), reflectance) in sum.iter_mut().zip(spectrum).zip(shader.palette.of(pigment)) {
                *sum += f64::from(radiance) / f64::from(*reflectance);
            }
            n += 1.0;
        }
    }
    if n == 0.0 {
        return Err(SceneError::Setting {
            what: "the view of the still life",
            value: "no gray of its chart".to_owned(),
            expected: "one at least, to measure the light on".to_owned(),
        });
    }
    let white: Vec<f64> = sum.iter().map(|v| v / n).collect();
    // A perfect white sends out its illuminance over π.
    let lux = std::f64::consts::PI * Observer::Cie1931.xyz(&grid, &white).luminance_cd_m2();
    let spectrum = Spectrum::new(grid.centers_nm().to_vec(), white)?;
    Ok(SceneLight::new(Illuminant::Spectrum(spectrum), lux))
}
