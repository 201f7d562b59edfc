//! Where a camera stands in a world, and which part of its picture is taken.

use dioptric_spectrum::SpectralImage;
use dioptric_world::glam::{DAffine3, DVec3};

use crate::BackwardError;

/// Puts a camera into a world: from its own frame in meters, +x right, +y up and +z to where it looks, into the world's.
///
/// The origin is the pinhole, the middle of a thin lens, or what a lens camera says. A transform that mirrors is right for
/// worlds whose frame is left-handed as seen by the camera, as those of pbrt are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// The transform.
    pub world_from_camera: DAffine3,
}

impl Placement {
    /// The camera's frame is the world's: it stands at the origin and looks along +z, x to the right and y up.
    pub const IDENTITY: Self = Self { world_from_camera: DAffine3::IDENTITY };

    /// Returns the placement of a camera at `eye_m` that looks at `target_m`, `up` being up in its picture.
    ///
    /// The world is right-handed: seen from the camera x is right, y up and z towards it.
    ///
    /// # Errors
    /// When the three don't fix a direction.
    pub fn look_at(eye_m: DVec3, target_m: DVec3, up: DVec3) -> Result<Self, BackwardError> {
        let forward = (target_m - eye_m).normalize_or_zero();
        let right = forward.cross(up).normalize_or_zero();
        if right == DVec3::ZERO || !eye_m.is_finite() {
            let found = format!("{eye_m} to {target_m}, {up} up");
            return Err(BackwardError::setting("the view of a camera", found, "two places, and an up across the view"));
        }
        let matrix = dioptric_world::glam::DMat3::from_cols(right, right.cross(forward), forward);
        Ok(Self { world_from_camera: DAffine3 { matrix3: matrix, translation: eye_m } })
    }
}

/// The pixels of a picture: of the whole, and of the part that is rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelGrid {
    /// Columns of the whole picture.
    pub columns: usize,
    /// Rows of the whole picture.
    pub rows: usize,
    /// The part that is rendered: first column and row, and how many of each.
    pub crop: [usize; 4],
}

impl PixelGrid {
    /// Returns the whole picture of so many columns and rows.
    pub fn new(columns: usize, rows: usize) -> Self {
        Self { columns, rows, crop: [0, 0, columns, rows] }
    }

    /// Returns the part of the picture from these columns and rows on, so many of each.
    ///
    /// # Errors
    /// When it does not lie in the picture.
    pub fn cropped(self, first: (usize, usize), size: (usize, usize)) -> Result<Self, BackwardError> {
        let crop = [first.0, first.1, size.0, size.1];
        let cropped = Self { crop, ..self };
        cropped.check()?;
        Ok(cropped)
    }

    /// Returns the same picture on pixels so many times as wide and as high; a part grows to whole ones of them.
    #[must_use]
    pub fn coarser(self, factor: usize) -> Self {
        let factor = factor.max(1);
        let fewer = |n: usize| n.div_ceil(factor);
        let [x, y, width, height] = self.crop;
        let (first, end) = ([x / factor, y / factor], [fewer(x + width), fewer(y + height)]);
        let crop = [first[0], first[1], end[0] - first[0], end[1] - first[1]];
        Self { columns: fewer(self.columns), rows: fewer(self.rows), crop }
    }

    pub(crate) fn check(&self) -> Result<(), BackwardError> {
        let [x, y, width, height] = self.crop;
        let is_within = width > 0
            && height > 0
            && x.checked_add(width).is_some_and(|end| end <= self.columns)
            && y.checked_add(height).is_some_and(|end| end <= self.rows)
            && self.columns.checked_mul(self.rows).is_some_and(|n| n <= MOST_PIXELS);
        match is_within {
            true => Ok(()),
            false => Err(BackwardError::setting(
                "the part of the picture",
                format!("{width}x{height} at {x},{y} of {}x{}", self.columns, self.rows),
                "at least a pixel, within a picture of at most 2^31 pixels",
            )),
        }
    }

    /// Rows and columns of the part.
    pub fn size(&self) -> (usize, usize) {
        (self.crop[3], self.crop[2])
    }

    /// Returns where a place in a pixel of the part lies in the whole picture: 0 to 1 to the right, and down.
    pub(crate) fn share(&self, pixel: usize, in_pixel: [f64; 2]) -> [f64; 2] {
        let [x, y, width, _] = self.crop;
        let (row, column) = (pixel / width, pixel % width);
        [((x + column) as f64 + in_pixel[0]) / self.columns as f64, ((y + row) as f64 + in_pixel[1]) / self.rows as f64]
    }

    /// The number of a pixel of the part in the whole picture: crops draw the numbers that the whole does.
    pub(crate) fn number(&self, pixel: usize) -> u32 {
        let [x, y, width, _] = self.crop;
        ((y + pixel / width) * self.columns + x + pixel % width) as u32
    }
}

const MOST_PIXELS: usize = 1 << 31;

/// A rendered picture so far.
#[derive(Clone, Debug)]
pub struct Rendering {
    /// Spectral irradiance on the film, or radiance for cameras without one.
    pub picture: SpectralImage,
    /// The standard error of each sample of it, in the same unit.
    pub standard_error: SpectralImage,
    /// How many samples each pixel has had.
    pub n_samples: ndarray::Array2<u32>,
}
