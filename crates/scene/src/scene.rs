//! What stands before the camera: spectral radiance, depth and geometry.

use std::ops::Range;

use dioptric_spectrum::{DepthMap, Observer, Quantity, SpectralImage, SpectrumError, WavelengthGrid};
use ndarray::{Array2, s};
use rayon::prelude::*;

use crate::{PointLight, SceneError, SceneLight, View, resample::resampled};

/// How much nearer than the first surface, relatively, a hidden layer may be: half floats carry three digits.
const HIDDEN_TOLERANCE: f32 = 2e-3;

/// What stands before the camera, as seen from the projection center.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Where it comes from, for messages and reports.
    pub name: String,
    /// Spectral radiance, W m⁻² sr⁻¹ nm⁻¹.
    pub radiance: SpectralImage,
    /// Axial depth of each sample.
    pub depth: Option<DepthMap>,
    /// Pinhole geometry of the samples.
    pub view: Option<View>,
    /// What lies behind the first surface, where that is known.
    pub hidden: Option<HiddenLayer>,
    /// Stars and lamps beside its samples.
    pub points: Vec<PointLight>,
    /// The light on it, where that is known: what a white balance may go by.
    pub light: Option<SceneLight>,
    /// What was done to its samples to make it, a sentence each: depths filled, bands resampled.
    pub notes: Vec<String>,
}

/// What would be seen if the object at the center of each sample were taken away.
///
/// Where nothing lies behind, the layer repeats the sample of the first.
#[derive(Clone, Debug, PartialEq)]
pub struct HiddenLayer {
    /// Spectral radiance, W m⁻² sr⁻¹ nm⁻¹, on the bands of the first layer.
    pub radiance: SpectralImage,
    /// Axial depth, never nearer than that of the first layer.
    pub depth: DepthMap,
}

impl Scene {
    /// Returns a scene of radiance alone.
    pub fn new(name: impl Into<String>, radiance: SpectralImage) -> Self {
        Self {
            name: name.into(),
            radiance,
            depth: None,
            view: None,
            hidden: None,
            points: vec![],
            light: None,
            notes: vec![],
        }
    }

    /// The number of rows.
    pub fn rows(&self) -> usize {
        self.radiance.rows()
    }

    /// The number of columns.
    pub fn columns(&self) -> usize {
        self.radiance.columns()
    }

    /// Returns the scene with one depth for all samples where it has none.
    ///
    /// # Errors
    /// When the depth is not above 0.
    pub fn or_flat_depth_m(mut self, z_m: f64) -> Result<Self, SceneError> {
        if self.depth.is_none() {
            self.depth = Some(DepthMap::flat(self.rows(), self.columns(), z_m)?);
        }
        Ok(self)
    }

    /// Returns the scene with a centered view of this angle where it has none.
    ///
    /// # Errors
    /// When the angle is not between 0° and 180°.
    pub fn or_horizontal_fov_deg(mut self, fov_deg: f64) -> Result<Self, SceneError> {
        if self.view.is_none() {
            self.view = Some(View::from_horizontal_fov_deg(fov_deg, self.columns(), self.rows())?);
        }
        Ok(self)
    }

    /// Returns the depth.
    ///
    /// # Errors
    /// When the scene has none.
    pub fn require_depth(&self) -> Result<&DepthMap, SceneError> {
        self.depth.as_ref().ok_or_else(|| SceneError::MissingDepth { name: self.name.clone() })
    }

    /// Returns the view.
    ///
    /// # Errors
    /// When the scene has none.
    pub fn require_view(&self) -> Result<View, SceneError> {
        self.view.ok_or_else(|| SceneError::MissingView { name: self.name.clone() })
    }

    /// Checks that the scene has both a depth and a view.
    ///
    /// # Errors
    /// Names what is missing, both where both are.
    pub fn require_depth_and_view(&self) -> Result<(), SceneError> {
        if self.depth.is_none() && self.view.is_none() {
            return Err(SceneError::MissingDepthAndView { name: self.name.clone() });
        }
        self.require_depth()?;
        self.require_view()?;
        Ok(())
    }

    /// Checks that every part fits the others and every sample is finite and not negative.
    ///
    /// # Errors
    /// Names the first thing that is wrong.
    pub fn validate(&self) -> Result<(), SceneError> {
        self.check_radiance(&self.radiance)?;
        if let Some(depth) = &self.depth {
            self.check_size("the depth", depth.z_m().dim())?;
        }
        if let Some(view) = &self.view {
            view.check()?;
        }
        if let Some(hidden) = &self.hidden {
            self.check_size("the hidden layer", (hidden.radiance.rows(), hidden.radiance.columns()))?;
            self.check_size("the depth of the hidden layer", hidden.depth.z_m().dim())?;
            self.check_radiance(&hidden.radiance)?;
            self.check_behind(hidden)?;
        }
        Ok(())
    }

    /// Checks that a hidden layer lies behind the first surface, but for roundings of the files that the two come from.
    fn check_behind(&self, hidden: &HiddenLayer) -> Result<(), SceneError> {
        let Some(first) = &self.depth else { return Ok(()) };
        for (((row, column), &first_m), &hidden_m) in first.z_m().indexed_iter().zip(hidden.depth.z_m()) {
            if hidden_m < (1.0 - HIDDEN_TOLERANCE) * first_m {
                let name = self.name.clone();
                return Err(SceneError::HiddenInFront { name, row, column, hidden_m, first_m });
            }
        }
        Ok(())
    }

    fn check_radiance(&self, image: &SpectralImage) -> Result<(), SceneError> {
        if image.quantity() != Quantity::Radiance {
            return Err(SceneError::Setting {
                what: "the quantity of a scene",
                value: image.quantity().unit().to_owned(),
                expected: format!("{}; a reflectance needs a light first", Quantity::Radiance.unit()),
            });
        }
        Ok(image.check_samples()?)
    }

    fn check_size(&self, what: &'static str, (found_rows, found_columns): (usize, usize)) -> Result<(), SceneError> {
        let (rows, columns) = (self.rows(), self.columns());
        if (rows, columns) == (found_rows, found_columns) {
            return Ok(());
        }
        Err(SceneError::Size { name: self.name.clone(), what, rows, columns, found_rows, found_columns })
    }

    /// Returns a part of the scene; directions and depths stay what they were.
    ///
    /// # Errors
    /// When the part is empty or reaches beyond the scene.
    pub fn cropped(&self, rows: Range<usize>, columns: Range<usize>) -> Result<Self, SceneError> {
        if rows.is_empty() || columns.is_empty() || rows.end > self.rows() || columns.end > self.columns() {
            return Err(SceneError::Setting {
                what: "the part of the scene",
                value: format!("rows {rows:?}, columns {columns:?}"),
                expected: format!("a part of 0..{} and 0..{}", self.rows(), self.columns()),
            });
        }
        let plane = |p: &Array2<f32>| p.slice(s![rows.clone(), columns.clone()]).to_owned();
        let image = |i: &SpectralImage| {
            SpectralImage::new(i.quantity(), i.grid().clone(), i.planes().iter().map(plane).collect())
        };
        let depth = |depth: &DepthMap| DepthMap::new(plane(depth.z_m()));
        self.with_samples(image, depth, self.view.map(|v| v.cropped(rows.start, columns.start)))
    }

    /// Returns the scene with other samples in all its layers, as another view has them.
    pub(crate) fn with_samples(
        &self,
        image: impl Fn(&SpectralImage) -> Result<SpectralImage, SpectrumError>,
        depth: impl Fn(&DepthMap) -> Result<DepthMap, SpectrumError>,
        view: Option<View>,
    ) -> Result<Self, SceneError> {
        let hidden = match &self.hidden {
            Some(h) => Some(HiddenLayer { radiance: image(&h.radiance)?, depth: depth(&h.depth)? }),
            None => None,
        };
        Ok(Self {
            name: self.name.clone(),
            radiance: image(&self.radiance)?,
            depth: self.depth.as_ref().map(depth).transpose()?,
            view,
            hidden,
            points: self.points.clone(),
            light: self.light.clone(),
            notes: self.notes.clone(),
        })
    }

    /// Returns the scene with blocks of samples averaged into one, `factor` each way; what is left over at the right and at
    /// the bottom is left out. A depth is that of the sample in the middle of its block.
    ///
    /// # Errors
    /// When the scene is smaller than a block, or the factor is 0.
    pub fn binned(&self, factor: usize) -> Result<Self, SceneError> {
        if factor == 1 {
            return Ok(self.clone());
        }
        if factor == 0 || self.rows() < factor || self.columns() < factor {
            return Err(SceneError::Setting {
                what: "the side of a block of samples",
                value: factor.to_string(),
                expected: format!("1 to {}", self.rows().min(self.columns())),
            });
        }
        let (rows, columns) = (self.rows() / factor, self.columns() / factor);
        let share = 1.0 / (factor * factor) as f32;
        let mean = |plane: &Array2<f32>| {
            Array2::from_shape_fn((rows, columns), |(row, column)| {
                let (top, left) = (row * factor, column * factor);
                share * plane.slice(s![top..top + factor, left..left + factor]).sum()
            })
        };
        let image = |image: &SpectralImage| {
            SpectralImage::new(image.quantity(), image.grid().clone(), image.planes().iter().map(mean).collect())
        };
        let depth = |depth: &DepthMap| {
            let middle = |i: usize| i * factor + factor / 2;
            DepthMap::new(Array2::from_shape_fn((rows, columns), |(r, c)| depth.z_m()[(middle(r), middle(c))]))
        };
        self.with_samples(image, depth, self.view.map(|view| view.binned(factor)))
    }

    /// Returns the scene turned clockwise by quarters of a turn.
    ///
    /// # Errors
    /// None: a turned scene is one.
    pub fn turned(self, quarters: usize) -> Result<Self, SceneError> {
        let mut scene = self;
        for _ in 0..quarters % 4 {
            let rows = scene.rows() as f64;
            let turn = |plane: &Array2<f32>| {
                let mut turned = plane.t().to_owned();
                turned.invert_axis(ndarray::Axis(1));
                turned.as_standard_layout().into_owned()
            };
            let image = |image: &SpectralImage| {
                SpectralImage::new(image.quantity(), image.grid().clone(), image.planes().iter().map(turn).collect())
            };
            let view = scene.view.map(|view| View {
                center_x_px: rows - 1.0 - view.center_y_px,
                center_y_px: view.center_x_px,
                ..view
            });
            scene = scene.with_samples(image, |depth| DepthMap::new(turn(depth.z_m())), view)?;
        }
        Ok(scene)
    }

    /// Returns the scene on other bands.
    ///
    /// Between band centers radiance runs in straight lines; a band wider than those of the scene takes the mean
    /// over its width.
    ///
    /// # Errors
    /// When the new bands reach more than a band's width beyond those of the scene: radiance is not made up.
    pub fn resampled(&self, grid: &WavelengthGrid) -> Result<Self, SceneError> {
        let hidden = match &self.hidden {
            Some(h) => Some(HiddenLayer { radiance: resampled(&h.radiance, grid)?, depth: h.depth.clone() }),
            None => None,
        };
        Ok(Self {
            name: self.name.clone(),
            radiance: resampled(&self.radiance, grid)?,
            depth: self.depth.clone(),
            view: self.view,
            hidden,
            points: self
                .points
                .iter()
                .map(|point| point.resampled(self.radiance.grid(), grid))
                .collect::<Result<_, _>>()?,
            light: self.light.clone(),
            notes: self.notes.clone(),
        })
    }

    /// Returns the mean luminance, cd/m² (CIE 1931).
    pub fn mean_luminance_cd_m2(&self) -> f64 {
        let [_, weights, _] = Observer::Cie1931.weights(self.radiance.grid());
        let means: Vec<f64> = self.radiance.planes().par_iter().map(mean).collect();
        means.into_iter().zip(weights).map(|(mean, weight)| mean * weight).sum()
    }

    /// Multiplies every radiance.
    ///
    /// # Errors
    /// When the factor is not finite and above 0.
    pub fn scale(&mut self, factor: f64) -> Result<(), SceneError> {
        if !(factor.is_finite() && factor > 0.0) {
            return Err(SceneError::Setting {
                what: "the factor on the radiance",
                value: factor.to_string(),
                expected: "a finite number above 0".to_owned(),
            });
        }
        let hidden = self.hidden.as_mut().map(|h| &mut h.radiance);
        for image in std::iter::once(&mut self.radiance).chain(hidden) {
            image.planes_mut().for_each(|mut plane| plane.mapv_inplace(|v| (f64::from(v) * factor) as f32));
        }
        Ok(())
    }
}

/// Returns the mean of a plane, summed in lanes: vectors, in an order that does not depend on the machine.
fn mean(plane: &Array2<f32>) -> f64 {
    const LANES: usize = 8;
    let Some(samples) = plane.as_slice() else {
        return plane.iter().map(|&v| f64::from(v)).sum::<f64>() / plane.len() as f64;
    };
    let (whole, rest) = samples.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for lanes in whole {
        sums.iter_mut().zip(lanes).for_each(|(sum, &v)| *sum += f64::from(v));
    }
    (sums.iter().sum::<f64>() + rest.iter().map(|&v| f64::from(v)).sum::<f64>()) / samples.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene() -> Scene {
        let grid = WavelengthGrid::uniform(400.0, 700.0, 100.0).unwrap();
        let planes = (0..4).map(|b| Array2::from_shape_fn((5, 6), |(r, c)| (100 * b + 10 * r + c) as f32)).collect();
        let radiance = SpectralImage::new(Quantity::Radiance, grid, planes).unwrap();
        Scene::new("test", radiance).or_flat_depth_m(2.0).unwrap().or_horizontal_fov_deg(30.0).unwrap()
    }

    #[test]
    fn a_part_keeps_its_samples_and_directions() {
        let scene = scene();
        let part = scene.cropped(1..4, 2..6).unwrap();
        part.validate().unwrap();
        assert_eq!((part.rows(), part.columns()), (3, 4));
        assert_eq!(part.radiance.spectrum_at(0, 0), scene.radiance.spectrum_at(1, 2));
        assert_eq!(part.view.unwrap().tan_at(0.0, 0.0), scene.view.unwrap().tan_at(1.0, 2.0));
        assert!(scene.cropped(0..6, 0..1).is_err() && scene.cropped(2..2, 0..1).is_err());
    }

    #[test]
    fn turned_scene_keeps_its_directions() {
        let scene = scene().cropped(0..4, 1..6).unwrap();
        let turned = scene.clone().turned(1).unwrap();
        assert_eq!((turned.rows(), turned.columns()), (5, 4));
        // What was at the left of the last row is at the top left.
        assert_eq!(turned.radiance.spectrum_at(0, 0), scene.radiance.spectrum_at(3, 0));
        let ((x, y), (u, v)) = (scene.view.unwrap().tan_at(3.0, 0.0), turned.view.unwrap().tan_at(0.0, 0.0));
        assert!((u - y).abs() < 1e-12 && (v + x).abs() < 1e-12);
        assert_eq!(turned.turned(3).unwrap(), scene);
    }

    #[test]
    fn what_is_missing_is_named() {
        let bare = Scene::new("kitchen", scene().radiance);
        assert!(bare.require_depth().unwrap_err().to_string().starts_with("kitchen: the scene has no depth"));
        assert!(bare.require_view().unwrap_err().to_string().contains("field of view"));
        assert!(bare.or_flat_depth_m(-1.0).is_err());
    }

    #[test]
    fn wrong_scenes_are_refused() {
        let mut wrong = scene();
        wrong.depth = Some(DepthMap::flat(5, 5, 1.0).unwrap());
        assert!(wrong.validate().unwrap_err().to_string().contains("the depth is 5 × 5 samples"));
        let mut wrong = scene();
        wrong.view = Some(View { focal_px: 0.0, center_x_px: 0.0, center_y_px: 0.0 });
        assert!(wrong.validate().is_err());
        let mut wrong = scene();
        wrong.radiance.planes_mut().next().unwrap()[(3, 2)] = f32::NAN;
        assert!(wrong.validate().unwrap_err().to_string().contains("row 3, column 2"));
        let mut wrong = scene();
        wrong.radiance = SpectralImage::zeros(Quantity::Reflectance, wrong.radiance.grid().clone(), 5, 6);
        assert!(wrong.validate().unwrap_err().to_string().contains("needs a light"));
        assert!(scene().scale(f64::NAN).is_err());
    }

    #[test]
    fn scaling_scales_the_luminance() {
        let mut scene = scene();
        let before = scene.mean_luminance_cd_m2();
        scene.scale(0.5).unwrap();
        // f32 samples of at most 400 halved are exact.
        assert_eq!(scene.mean_luminance_cd_m2(), 0.5 * before);
    }
}
