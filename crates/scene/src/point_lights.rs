//! Points that shine beside the samples of a scene: stars, LEDs, lamps.

use dioptric_spectrum::{Spectrum, WavelengthGrid};

use crate::SceneError;

/// A point that shines.
#[derive(Clone, Debug, PartialEq)]
pub struct PointLight {
    /// Where it is seen.
    pub place: PointPlace,
    /// Its axial depth, m; infinite for stars.
    pub depth_m: f64,
    /// How bright it is.
    pub light: PointBrightness,
}

/// Where a point is seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PointPlace {
    /// In a direction from the projection center: tangents of the angles to the right and upwards.
    Field {
        /// To the right.
        tan_x: f64,
        /// Upwards.
        tan_y: f64,
    },
    /// Where its chief ray of the middle wavelength meets the film.
    Film {
        /// To the right of the film's middle in the picture, mm.
        x_mm: f64,
        /// Above it, mm.
        y_mm: f64,
    },
}

/// How bright a point is, a value per band.
#[derive(Clone, Debug, PartialEq)]
pub enum PointBrightness {
    /// What it brings to a surface at the projection center that faces it, W m⁻² nm⁻¹: of stars.
    Irradiance(Vec<f32>),
    /// What it sends towards the camera, W sr⁻¹ nm⁻¹: of lamps at a depth.
    Intensity(Vec<f32>),
}

impl PointBrightness {
    /// The values by band.
    pub fn by_band(&self) -> &[f32] {
        let (Self::Irradiance(by_band) | Self::Intensity(by_band)) = self;
        by_band
    }
}

impl PointLight {
    /// Checks that there can be such a point in so many bands.
    ///
    /// # Errors
    /// When its place is not finite, its depth not above 0, an intensity stands at an infinite depth, or its brightness is negative, not finite or
    /// of another number of bands.
    pub fn check(&self, n_bands: usize) -> Result<(), SceneError> {
        let wrong = |what, value: String, expected: &str| {
            Err(SceneError::Setting { what, value, expected: expected.to_owned() })
        };
        let (PointPlace::Field { tan_x: x, tan_y: y } | PointPlace::Film { x_mm: x, y_mm: y }) = self.place;
        if !(x.is_finite() && y.is_finite()) {
            return wrong("the place of a point", format!("{x}, {y}"), "finite numbers");
        }
        let is_lamp = matches!(self.light, PointBrightness::Intensity(_));
        if self.depth_m.is_nan() || self.depth_m <= 0.0 || (is_lamp && self.depth_m.is_infinite()) {
            let expected = if is_lamp {
                "a finite number above 0: its brightness is an intensity"
            } else {
                "a number above 0, or inf"
            };
            return wrong("the depth of a point", format!("{} m", self.depth_m), expected);
        }
        let by_band = self.light.by_band();
        if by_band.len() != n_bands {
            return wrong(
                "the brightness of a point",
                format!("{} bands", by_band.len()),
                &format!("{n_bands} as the scene"),
            );
        }
        match by_band.iter().find(|value| !(value.is_finite() && **value >= 0.0)) {
            Some(value) => wrong("the brightness of a point", value.to_string(), "finite numbers of 0 or more"),
            None => Ok(()),
        }
    }

    /// Returns it on other bands than those of `from`, between which its light is linear.
    pub(crate) fn resampled(&self, from: &WavelengthGrid, to: &WavelengthGrid) -> Result<Self, SceneError> {
        let values = self.light.by_band().iter().map(|value| f64::from(*value)).collect();
        let spectrum = Spectrum::new(from.centers_nm().to_vec(), values)?;
        let by_band = spectrum.sample_held(to).into_iter().map(|value| value as f32).collect();
        let light = match self.light {
            PointBrightness::Irradiance(_) => PointBrightness::Irradiance(by_band),
            PointBrightness::Intensity(_) => PointBrightness::Intensity(by_band),
        };
        Ok(Self { light, ..self.clone() })
    }
}
