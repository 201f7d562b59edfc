//! The fields seen along a row of places.

/// The fields seen along a row of places on the film, and the irradiance that they get.
#[derive(Clone, Debug, Default)]
pub struct FieldsAlong {
    /// Tangents to the right.
    pub tan_x: Vec<f64>,
    /// Tangents upwards.
    pub tan_y: Vec<f64>,
    /// Irradiance per radiance, sr; NaN where nothing is seen.
    pub irradiance_per_radiance: Vec<f64>,
}

impl FieldsAlong {
    /// Makes room for so many places.
    pub(crate) fn resize(&mut self, len: usize) {
        for values in [&mut self.tan_x, &mut self.tan_y, &mut self.irradiance_per_radiance] {
            values.clear();
            values.resize(len, 0.0);
        }
    }
}
