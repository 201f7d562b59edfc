//! Light from beyond a world: an even sky, a clear day, a picture.

use std::sync::Arc;

use dioptric_spectrum::Spectrum;
use dioptric_world::{
    Beyond, Encoding, ImageTexture, Light, SkyImage, SkyMapping, SpectralCurve, WorldBuilder, Wrap,
    glam::{DMat3, DVec3},
};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

use crate::{PipelineError, WorldSky};

/// A luminance, cd/m², of a light of linear sRGB (1, 1, 1).
const CD_M2_OF_WHITE: f64 = 683.002 * 106.857;
/// Rows of the picture of a clear sky, and twice as many columns.
const ROWS: usize = 128;
/// The reflectance of the ground below the horizon of a clear day.
const GROUND: f64 = 0.2;

/// Adds a sky to a world whose `up` and `front` are known.
pub(super) fn add_sky(
    builder: &mut WorldBuilder,
    sky: &WorldSky,
    up: DVec3,
    front: DVec3,
) -> Result<(), PipelineError> {
    let right = up.cross(front).normalize_or(DVec3::X);
    let world_from_sky = DMat3::from_cols(front, right, up);
    match sky {
        WorldSky::Even(radiance) => {
            builder.add_light(Light::Sky { radiance: SpectralCurve::constant(*radiance as f32) })
        }
        WorldSky::Picture(path) => {
            let image = ImageTexture::read(path, Encoding::Srgb, Wrap::Repeat)?;
            builder.add_source(path);
            let mapping = SkyMapping::LatLong;
            builder.add_light(Light::SkyImage(SkyImage {
                image: Arc::new(image),
                mapping,
                world_from_sky,
                scale: 1.0,
            }));
        }
        WorldSky::Day { elevation_deg, azimuth_deg, turbidity } => {
            let day = Day::new(elevation_deg.to_radians(), azimuth_deg.to_radians(), *turbidity);
            let image = ImageTexture::from_linear(2 * ROWS, day.picture(), Wrap::Repeat)?;
            let mapping = SkyMapping::LatLong;
            builder.add_light(Light::SkyImage(SkyImage {
                image: Arc::new(image),
                mapping,
                world_from_sky,
                scale: 1.0,
            }));
            builder.add_light(Light::Distant {
                direction: -(world_from_sky * day.sun),
                irradiance: SpectralCurve::new(&day.sunlight(), Beyond::Zero),
            });
        }
    }
    Ok(())
}

/// A clear day after Preetham, Shirley & Smits (1999), "A practical analytic model for daylight". z is up.
struct Day {
    /// Towards the sun.
    sun: DVec3,
    turbidity: f64,
    /// The five constants of luminance and of both chromaticities.
    perez: [[f64; 5]; 3],
    /// Luminance, kcd/m², and chromaticities at the zenith, each over its function there.
    zenith: [f64; 3],
}

impl Day {
    fn new(elevation_rad: f64, azimuth_rad: f64, turbidity: f64) -> Self {
        let t = turbidity;
        let perez = [
            [
                0.1787 * t - 1.4630,
                -0.3554 * t + 0.4275,
                -0.0227 * t + 5.3251,
                0.1206 * t - 2.5771,
                -0.0670 * t + 0.3703,
            ],
            [
                -0.0193 * t - 0.2592,
                -0.0665 * t + 0.0008,
                -0.0004 * t + 0.2125,
                -0.0641 * t - 0.8989,
                -0.0033 * t + 0.0452,
            ],
            [
                -0.0167 * t - 0.2608,
                -0.0950 * t + 0.0092,
                -0.0079 * t + 0.2102,
                -0.0441 * t - 1.6537,
                -0.0109 * t + 0.0529,
            ],
        ];
        let s = FRAC_PI_2 - elevation_rad;
        let chi = (4.0 / 9.0 - t / 120.0) * (PI - 2.0 * s);
        let luminance = (4.0453 * t - 4.9710) * chi.tan() - 0.2155 * t + 2.4192;
        let cubic = |rows: [[f64; 4]; 3]| {
            let by_angle = |[a, b, c, d]: [f64; 4]| ((a * s + b) * s + c) * s + d;
            (by_angle(rows[0]) * t + by_angle(rows[1])) * t + by_angle(rows[2])
        };
        let x = cubic([
            [0.00166, -0.00375, 0.00209, 0.0],
            [-0.02903, 0.06377, -0.03202, 0.00394],
            [0.11693, -0.21196, 0.06052, 0.25886],
        ]);
        let y = cubic([
            [0.00275, -0.00610, 0.00317, 0.0],
            [-0.04214, 0.08970, -0.04153, 0.00516],
            [0.15346, -0.26756, 0.06670, 0.26688],
        ]);
        let at_zenith = perez.map(|of| function(of, 0.0, s));
        let sun = DVec3::new(
            elevation_rad.cos() * azimuth_rad.cos(),
            elevation_rad.cos() * azimuth_rad.sin(),
            elevation_rad.sin(),
        );
        let zenith = std::array::from_fn(|k| [luminance.max(0.0), x, y][k] / at_zenith[k]);
        Self { sun, turbidity, perez, zenith }
    }

    /// Returns the sky in a direction: X, Y and Z, cd/m².
    fn xyz(&self, direction: DVec3) -> [f64; 3] {
        // The formula has a pole at the horizon.
        let theta = direction.z.max(0.01).acos();
        let gamma = direction.dot(self.sun).clamp(-1.0, 1.0).acos();
        let [luminance, x, y] = std::array::from_fn(|k| self.zenith[k] * function(self.perez[k], theta, gamma));
        let whole = 1e3 * luminance.max(0.0) / y.max(0.01);
        [x * whole, 1e3 * luminance.max(0.0), (1.0 - x - y).max(0.0) * whole]
    }

    /// Returns the spectral irradiance that faces the sun, W m⁻² nm⁻¹: that of a black body of 5778 K of the sun's size, less what
    /// molecules and aerosols scatter out of it (ozone and water are left out).
    fn sunlight(&self) -> Spectrum {
        let zenith_deg = self.sun.z.clamp(-1.0, 1.0).acos().to_degrees();
        let air_mass = 1.0 / (self.sun.z.max(0.0) + 0.15 * (93.885 - zenith_deg).max(0.1).powf(-1.253));
        let aerosol = (0.04608 * self.turbidity - 0.04586).max(0.0);
        let wavelengths_nm: Vec<f64> = (30..=250).map(|i| 10.0 * f64::from(i)).collect();
        let value = |nm: &f64| {
            let um = 1e-3 * nm;
            // 2 h c²/λ⁵ per metre, of which a nanometre has 1e-9.
            let planck = 1.191_043e-16 * (1e-9 * nm).powi(-5) / (1.438_777e7 / (nm * 5778.0)).exp_m1() * 1e-9;
            let left = (-air_mass * (0.008_735 * um.powf(-4.08) + aerosol * um.powf(-1.3))).exp();
            planck * 6.794e-5 * left * if self.sun.z > 0.0 { 1.0 } else { 0.0 }
        };
        let values = wavelengths_nm.iter().map(value).collect();
        Spectrum::new(wavelengths_nm, values).expect("wavelengths that rise")
    }

    /// Returns linear sRGB row by row from the zenith, in the unit of lights by color; below the horizon the ground.
    fn picture(&self) -> Vec<[f32; 3]> {
        let direction = |row: usize, column: usize| {
            let (sin, cos) = (PI * (row as f64 + 0.5) / ROWS as f64).sin_cos();
            let (y, x) = (TAU * (column as f64 + 0.5) / (2 * ROWS) as f64).sin_cos();
            DVec3::new(sin * x, sin * y, cos)
        };
        let cell = PI / ROWS as f64;
        let mut sky = Vec::with_capacity(ROWS * ROWS);
        let mut illuminance = [0.0; 3];
        for row in 0..ROWS / 2 {
            for column in 0..2 * ROWS {
                let d = direction(row, column);
                let xyz = self.xyz(d);
                let counts = d.z * (1.0 - d.z * d.z).sqrt() * cell * cell;
                illuminance = std::array::from_fn(|k| illuminance[k] + xyz[k] * counts);
                sky.push(xyz);
            }
        }
        let grid = dioptric_spectrum::WavelengthGrid::uniform(380.0, 780.0, 5.0).expect("a valid range");
        let sun = dioptric_spectrum::Observer::Cie1931.xyz(&grid, &self.sunlight().sample_or_zero(&grid)).0;
        let ground: [f64; 3] = std::array::from_fn(|k| GROUND / PI * (illuminance[k] + sun[k] * self.sun.z.max(0.0)));
        let rgb =
            |xyz: [f64; 3]| dioptric_spectrum::Xyz(xyz).to_linear_srgb().map(|v| (v.max(0.0) / CD_M2_OF_WHITE) as f32);
        sky.into_iter().chain(std::iter::repeat_n(ground, ROWS * ROWS)).map(rgb).collect()
    }
}

/// Perez' function of the angle from the zenith and that from the sun.
fn function([a, b, c, d, e]: [f64; 5], theta: f64, gamma: f64) -> f64 {
    (1.0 + a * (b / theta.cos()).exp()) * (1.0 + c * (d * gamma).exp() + e * gamma.cos().powi(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A clear noon gives some 100,000 lux, four fifths of it from the sun, which is warmer than the sky.
    #[test]
    fn clear_noon_is_as_bright_as_known() {
        let day = Day::new(60_f64.to_radians(), 0.3, 2.5);
        let grid = dioptric_spectrum::WavelengthGrid::uniform(380.0, 780.0, 5.0).unwrap();
        let sun = dioptric_spectrum::Observer::Cie1931.xyz(&grid, &day.sunlight().sample_or_zero(&grid)).0;
        let from_sun = sun[1] * day.sun.z;
        // Outside the air 127.5 klx face the sun; a clear sky of turbidity 2.5 lets some three quarters through at 60°.
        assert!((70_000.0..105_000.0).contains(&from_sun), "{from_sun}");
        let picture = day.picture();
        let n = 2 * ROWS;
        let mut sky = 0.0;
        for (index, rgb) in picture.iter().take(ROWS * ROWS).enumerate() {
            let theta = PI * ((index / n) as f64 + 0.5) / ROWS as f64;
            let luminance = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
            sky += f64::from(luminance) * CD_M2_OF_WHITE * theta.cos() * theta.sin() * (PI / ROWS as f64).powi(2);
        }
        // Preetham's zenith of 8.2 kcd/m² by his formula and a sky as bright all over are 26 klx; the model is above measured
        // skies (15 klx by the IES), as is known of it.
        assert!((20_000.0..30_000.0).contains(&sky), "{sky}");
        let [r, _, b] = picture[10 * n + 200];
        assert!(b > 1.3 * r, "blue overhead: {:?}", picture[10 * n + 200]);
        assert!(sun[2] < 1.089 * sun[1], "warmer than D65: {sun:?}");
        assert!(picture.iter().flatten().all(|v| v.is_finite()));
    }
}
