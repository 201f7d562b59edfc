//! Points that shine beside the samples of a scene: stars, LEDs, lamps.

use dioptric_spectrum::{Spectrum, WavelengthGrid};
use ndarray::Array2;

use crate::SceneError;

/// Where a point lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PointPlace {
    /// In a direction from the projection center.
    Field {
        /// Tangent of the angle to the right.
        tan_x: f64,
        /// Tangent of the angle upwards.
        tan_y: f64,
        /// Axial depth, m; infinite for stars.
        depth_m: f64,
    },
    /// Where its chief ray of the middle wavelength meets the film.
    Film {
        /// To the right of the film's middle in the picture, mm.
        x_mm: f64,
        /// Above it, mm.
        y_mm: f64,
        /// Axial depth, m; infinite for stars.
        depth_m: f64,
    },
}

impl PointPlace {
    /// Axial depth, m; infinite for stars.
    pub fn depth_m(&self) -> f64 {
        match *self {
            Self::Field { depth_m, .. } | Self::Film { depth_m, .. } => depth_m,
        }
    }
}

/// Points that shine, and the light of each that arrives at the projection center.
///
/// A lamp of radiant intensity I, W sr⁻¹ nm⁻¹, at a distance r brings I / r²; a star brings the same wherever one stands.
#[derive(Clone, Debug, PartialEq)]
pub struct PointLights {
    places: Vec<PointPlace>,
    /// W m⁻² nm⁻¹ on a surface that faces the point, points × bands.
    irradiance: Array2<f32>,
}

impl PointLights {
    /// Takes places, and the irradiance that each point brings to the projection center, W m⁻² nm⁻¹ on a surface that faces it, points × bands.
    ///
    /// # Errors
    /// When there are not as many of both, a depth is not above 0, a place is not finite, or an irradiance is negative or not finite.
    pub fn new(places: Vec<PointPlace>, irradiance: Array2<f32>) -> Result<Self, SceneError> {
        let wrong = |what: &'static str, value: String, expected: &str| {
            Err(SceneError::Setting { what, value, expected: expected.to_owned() })
        };
        if irradiance.nrows() != places.len() {
            return wrong("the irradiance of points", format!("of {} points", irradiance.nrows()), &format!("{} as there are places", places.len()));
        }
        for place in &places {
            let (PointPlace::Field { tan_x: x, tan_y: y, depth_m } | PointPlace::Film { x_mm: x, y_mm: y, depth_m }) = *place;
            if !(x.is_finite() && y.is_finite()) {
                return wrong("the place of a point", format!("{x}, {y}"), "finite numbers");
            }
            if !(depth_m > 0.0) {
                return wrong("the depth of a point", format!("{depth_m} m"), "a number above 0, or infinite");
            }
        }
        if let Some(value) = irradiance.iter().find(|value| !(value.is_finite() && **value >= 0.0)) {
            return wrong("the irradiance of a point", value.to_string(), "a finite number of 0 or more");
        }
        Ok(Self { places, irradiance })
    }

    /// The places.
    pub fn places(&self) -> &[PointPlace] {
        &self.places
    }

    /// The irradiance that each brings to the projection center, W m⁻² nm⁻¹ on a surface that faces it, points × bands.
    pub fn irradiance(&self) -> &Array2<f32> {
        &self.irradiance
    }

    /// Returns the irradiance of all points in a band; nothing where there is no such band.
    pub fn of_band(&self, band: usize) -> Vec<f32> {
        if band < self.irradiance.ncols() { self.irradiance.column(band).to_vec() } else { vec![] }
    }

    /// Returns them on other bands than those of `from`, between which their light is linear.
    pub(crate) fn resampled(&self, from: &WavelengthGrid, to: &WavelengthGrid) -> Result<Self, SceneError> {
        let mut irradiance = Array2::zeros((self.places.len(), to.len()));
        for (old, mut new) in self.irradiance.rows().into_iter().zip(irradiance.rows_mut()) {
            let values = old.iter().map(|value| f64::from(*value)).collect();
            let spectrum = Spectrum::new(from.centers_nm().to_vec(), values)?;
            new.iter_mut().zip(spectrum.sample_held(to)).for_each(|(new, value)| *new = value as f32);
        }
        Ok(Self { places: self.places.clone(), irradiance })
    }

    /// Whether they have as many bands as a grid.
    pub fn fits(&self, grid: &WavelengthGrid) -> bool {
        self.irradiance.ncols() == grid.len()
    }
}
