//! Pictures with a spectrum in each sample, and depth maps.

use std::borrow::Cow;

use ndarray::{Array2, Array3, ArrayView2, Axis};

use crate::{SpectrumError, WavelengthGrid};

/// What the samples of a spectral image are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Spectral radiance, W m⁻² sr⁻¹ nm⁻¹.
    Radiance,
    /// Spectral irradiance, W m⁻² nm⁻¹.
    Irradiance,
    /// Reflectance factor, no unit.
    Reflectance,
}

impl Quantity {
    /// The unit as written in files, `W.m^-2.sr^-1.nm^-1` for radiance.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Radiance => "W.m^-2.sr^-1.nm^-1",
            Self::Irradiance => "W.m^-2.nm^-1",
            Self::Reflectance => "1",
        }
    }
}

/// A picture of which a band at a time can be had: from memory, from a file, or computed.
///
/// A stage that takes `&dyn Bands` never needs the whole cube.
pub trait Bands: Sync {
    /// What the samples are.
    fn quantity(&self) -> Quantity;
    /// The bands.
    fn grid(&self) -> &WavelengthGrid;
    /// Rows and columns.
    fn size(&self) -> (usize, usize);
    /// Returns the samples of a band, rows × columns.
    ///
    /// # Errors
    /// When the band cannot be read.
    fn band(&self, band: usize) -> Result<Cow<'_, Array2<f32>>, SpectrumError>;
}

/// A picture with a spectrum in each sample: bands × rows × columns.
#[derive(Clone, Debug, PartialEq)]
pub struct SpectralImage {
    // Invariant: one plane a band of `grid`, all of one size and at least 1 × 1.
    quantity: Quantity,
    grid: WavelengthGrid,
    planes: Vec<Array2<f32>>,
    pitch_um: Option<f64>,
}

impl SpectralImage {
    /// Returns the image with these planes, one a band.
    ///
    /// # Errors
    /// When there are not as many planes as bands, or they differ in size or are empty.
    pub fn new(quantity: Quantity, grid: WavelengthGrid, planes: Vec<Array2<f32>>) -> Result<Self, SpectrumError> {
        let shape = |what, expected, found| Err(SpectrumError::Shape { what, expected, found });
        if planes.len() != grid.len() {
            return shape("bands of an image", grid.len(), planes.len());
        }
        let (rows, columns) = planes[0].dim();
        if rows * columns == 0 {
            return shape("samples of a band (at least)", 1, 0);
        }
        for plane in &planes {
            if plane.nrows() != rows {
                return shape("rows of a band", rows, plane.nrows());
            }
            if plane.ncols() != columns {
                return shape("columns of a band", columns, plane.ncols());
            }
        }
        Ok(Self { quantity, grid, planes, pitch_um: None })
    }

    /// Returns the image of zeros.
    pub fn zeros(quantity: Quantity, grid: WavelengthGrid, rows: usize, columns: usize) -> Self {
        assert!(rows > 0 && columns > 0, "an image has at least one sample");
        let planes = vec![Array2::zeros((rows, columns)); grid.len()];
        Self { quantity, grid, planes, pitch_um: None }
    }

    /// Returns the image of a cube, bands × rows × columns.
    ///
    /// # Errors
    /// As [`SpectralImage::new`].
    pub fn from_cube(quantity: Quantity, grid: WavelengthGrid, cube: &Array3<f32>) -> Result<Self, SpectrumError> {
        Self::new(quantity, grid, cube.axis_iter(Axis(0)).map(|plane| plane.to_owned()).collect())
    }

    /// Returns the samples as one cube, bands × rows × columns.
    pub fn to_cube(&self) -> Array3<f32> {
        let views: Vec<ArrayView2<'_, f32>> = self.planes.iter().map(|p| p.view()).collect();
        ndarray::stack(Axis(0), &views).expect("planes are of one size")
    }

    /// Returns the image with the distance between samples on the film set.
    #[must_use]
    pub fn with_pitch_um(mut self, pitch_um: f64) -> Self {
        self.pitch_um = Some(pitch_um);
        self
    }

    /// The distance between samples on the film, µm, where the image lies on one.
    pub fn pitch_um(&self) -> Option<f64> {
        self.pitch_um
    }

    /// What the samples are.
    pub fn quantity(&self) -> Quantity {
        self.quantity
    }

    /// The bands.
    pub fn grid(&self) -> &WavelengthGrid {
        &self.grid
    }

    /// The number of rows.
    pub fn rows(&self) -> usize {
        self.planes[0].nrows()
    }

    /// The number of columns.
    pub fn columns(&self) -> usize {
        self.planes[0].ncols()
    }

    /// The samples, one plane a band.
    pub fn planes(&self) -> &[Array2<f32>] {
        &self.planes
    }

    /// The samples, one plane a band; their sizes cannot be changed.
    pub fn planes_mut(&mut self) -> impl Iterator<Item = ndarray::ArrayViewMut2<'_, f32>> {
        self.planes.iter_mut().map(|plane| plane.view_mut())
    }

    /// Takes the image apart into its planes.
    pub fn into_planes(self) -> Vec<Array2<f32>> {
        self.planes
    }

    /// Returns the spectrum of a sample, one value a band.
    pub fn spectrum_at(&self, row: usize, column: usize) -> Vec<f64> {
        self.planes.iter().map(|plane| f64::from(plane[(row, column)])).collect()
    }

    /// Checks that every sample is finite and not negative.
    ///
    /// # Errors
    /// Names the first sample that is not.
    pub fn check_samples(&self) -> Result<(), SpectrumError> {
        let is_light = |value: f32| value.is_finite() && value >= 0.0;
        for (plane, &wavelength_nm) in self.planes.iter().zip(self.grid.centers_nm()) {
            for (row, samples) in plane.outer_iter().enumerate() {
                // All of a row, so that samples are compared in vectors.
                if samples.iter().fold(true, |are_light, &value| are_light & is_light(value)) {
                    continue;
                }
                if let Some((column, &value)) = samples.iter().enumerate().find(|(_, value)| !is_light(**value)) {
                    return Err(SpectrumError::Sample { wavelength_nm, row, column, value });
                }
            }
        }
        Ok(())
    }
}

impl Bands for SpectralImage {
    fn quantity(&self) -> Quantity {
        self.quantity
    }
    fn grid(&self) -> &WavelengthGrid {
        &self.grid
    }
    fn size(&self) -> (usize, usize) {
        self.planes[0].dim()
    }
    fn band(&self, band: usize) -> Result<Cow<'_, Array2<f32>>, SpectrumError> {
        Ok(Cow::Borrowed(&self.planes[band]))
    }
}

/// Distance along the axis from the projection center, in metres, a value a sample.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthMap {
    // Invariant: every value is above 0; infinity is allowed (sky).
    z_m: Array2<f32>,
}

impl DepthMap {
    /// Returns the map of these axial depths, m; infinity is allowed.
    ///
    /// # Errors
    /// Names the first value that is not above 0.
    pub fn new(z_m: Array2<f32>) -> Result<Self, SpectrumError> {
        match z_m.indexed_iter().find(|(_, value)| value.is_nan() || **value <= 0.0) {
            Some(((row, column), &value)) => Err(SpectrumError::Depth { row, column, value }),
            None => Ok(Self { z_m }),
        }
    }

    /// Returns a map of one depth.
    ///
    /// # Errors
    /// When the depth is not above 0.
    pub fn flat(rows: usize, columns: usize, z_m: f64) -> Result<Self, SpectrumError> {
        Self::new(Array2::from_elem((rows, columns), z_m as f32))
    }

    /// The axial depths, m, rows × columns.
    pub fn z_m(&self) -> &Array2<f32> {
        &self.z_m
    }

    /// The nearest and the farthest depth, m.
    pub fn range_m(&self) -> (f64, f64) {
        self.z_m
            .iter()
            .fold((f64::INFINITY, 0.0), |(near, far), &z| (near.min(f64::from(z)), f64::max(far, f64::from(z))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_and_cube_are_one_thing() {
        let grid = WavelengthGrid::uniform(400.0, 500.0, 100.0).unwrap();
        let cube = Array3::from_shape_fn((2, 3, 4), |(b, r, c)| (100 * b + 10 * r + c) as f32);
        let image = SpectralImage::from_cube(Quantity::Radiance, grid, &cube).unwrap();
        assert_eq!((image.rows(), image.columns()), (3, 4));
        assert_eq!(image.spectrum_at(2, 3), [23.0, 123.0]);
        assert_eq!(image.to_cube(), cube);
    }

    #[test]
    fn a_bad_sample_is_named() {
        let grid = WavelengthGrid::new(vec![500.0]).unwrap();
        for bad in [f32::NAN, -1.0, f32::INFINITY] {
            let mut plane = Array2::zeros((2, 2));
            plane[(1, 0)] = bad;
            let image = SpectralImage::new(Quantity::Radiance, grid.clone(), vec![plane]).unwrap();
            let message = image.check_samples().unwrap_err().to_string();
            assert!(message.contains("row 1, column 0") && message.contains("500 nm"), "{message}");
        }
    }

    #[test]
    fn depth_must_be_in_front_of_the_camera() {
        assert!(DepthMap::flat(2, 2, 0.0).is_err());
        assert!(DepthMap::flat(2, 2, f64::NAN).is_err());
        assert_eq!(DepthMap::flat(2, 2, f64::INFINITY).unwrap().range_m().1, f64::INFINITY);
    }
}
