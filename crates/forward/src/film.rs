//! The film and the settings of a forward rendering.

use glam::DVec2;

use crate::ForwardError;

/// The raster of the sensor's pixels, anywhere in the lens's image.
///
/// Row 0 is the top of the picture, upright as the photographer sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Film {
    /// Rows of pixels.
    pub rows: usize,
    /// Columns of pixels.
    pub columns: usize,
    /// Distance between pixels, µm.
    pub pitch_um: f64,
    /// Where its middle is, mm from the optical axis, x to the right and y up in the picture.
    pub center_mm: DVec2,
}

impl Film {
    /// Returns a film with the optical axis in its middle.
    pub fn centered(rows: usize, columns: usize, pitch_um: f64) -> Self {
        Self { rows, columns, pitch_um, center_mm: DVec2::ZERO }
    }

    /// Whether the optical axis passes through its middle.
    pub fn is_centered(&self) -> bool {
        self.center_mm == DVec2::ZERO
    }

    /// Returns half the diagonal, corner to center, mm.
    pub fn half_diagonal_mm(&self) -> f64 {
        0.5e-3 * self.pitch_um * f64::hypot(self.rows as f64, self.columns as f64)
    }

    /// Returns how far from the optical axis its farthest corner lies, mm.
    pub fn reach_mm(&self) -> f64 {
        if self.is_centered() { self.half_diagonal_mm() } else { (self.half_size_mm() + self.center_mm.abs()).length() }
    }

    /// Returns half the width and half the height, mm: the corner at the top right as it is seen from the center.
    pub fn half_size_mm(&self) -> DVec2 {
        0.5e-3 * self.pitch_um * DVec2::new(self.columns as f64, self.rows as f64)
    }

    /// Checks that the film has an area, and a place.
    ///
    /// # Errors
    /// When it has no pixels, pixels of no size, or a middle that is not finite.
    pub fn check(&self) -> Result<(), ForwardError> {
        let Self { rows, columns, pitch_um, center_mm } = *self;
        if !center_mm.is_finite() {
            let (what, value) = ("the middle of the film", center_mm.x + center_mm.y);
            return Err(ForwardError::Setting { what, value, expected: "finite numbers of millimeters" });
        }
        if rows * columns > 0 && pitch_um.is_finite() && pitch_um > 0.0 {
            return Ok(());
        }
        Err(ForwardError::EmptyFilm { rows, columns, pitch_um })
    }
}

/// How the blur treats one surface in front of another.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BlurMode {
    /// Layers by depth with saturating coverage: near surfaces hide far ones.
    #[default]
    Layered,
    /// The paper's way: every sample is spread by its own PSF and nothing hides anything.
    Pointwise,
    /// As in layers, through so many parts of the pupil, 2 to 256, one after the other: each is a view of its own of what hides what, blurred by the width of
    /// its part. It takes as many times as long, and is right where a surface in front is narrower than the pupil.
    Views(usize),
}

/// How finely a forward rendering is made.
///
/// The defaults are those whose accuracy was measured; a larger step or spacing is faster and less exact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// How surfaces hide each other.
    pub mode: BlurMode,
    /// Distance between the points of the film at which the PSF is computed, pixels. Cells in which the
    /// interpolated PSF is off by more than `max_edge_error` are halved.
    pub knot_spacing_px: usize,
    /// Largest error of the edge spread function in the middle band that interpolation over the field may cause, where cells are not yet as small as the
    /// raster of their kernels allows.
    pub max_edge_error: f64,
    /// Largest relative error of the irradiance of a uniform plane in the middle band by interpolated PSFs: cells where it is larger are halved likewise.
    pub max_shading_error: f64,
    /// Distance between depth layers, pixels of blur radius.
    pub layer_step_px: f64,
    /// A change of blur radius between neighbors that counts as a depth edge, pixels.
    pub depth_edge_px: f64,
    /// Largest change of blur radius between wavelengths among which PSFs are interpolated, pixels.
    pub chromatic_step_px: f64,
    /// Largest motion of a point of the film between wavelengths among which what layers cover is interpolated, pixels; off an even
    /// motion it may be by a 25th of it.
    pub coverage_step_px: f64,
    /// A change of kernels over a cell that moves no spread function of an edge or a corner by more than this is left out. What is left out shows as
    /// steps between cells.
    pub negligible_edge: f64,
    /// Largest blur radius that is imaged on the pixels of the film; where on the film a blur is wider, pixels are 2, 4, 8 … times
    /// as wide, so that the radius is between half of this and this. At least 4.
    pub widest_blur_px: f64,
    /// Length that the weights of knots are smoothed over where kernels change so from cell to cell that a uniform plane would show seams, pixels; twice
    /// that where they would show most. An even number up to 8; 0 leaves seams.
    pub smoothing_px: usize,
    /// Whether what layers cover takes account of fourth moments of kernels where blur is a tenth of the film wide or more: whole surfaces are up to 2.5 % too bright
    /// without, in scenes of several depths.
    pub levels_wide_blur: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            mode: BlurMode::Layered,
            knot_spacing_px: 128,
            max_edge_error: 0.01,
            max_shading_error: 5e-4,
            layer_step_px: 2.0,
            depth_edge_px: 3.0,
            chromatic_step_px: 0.25,
            coverage_step_px: 0.25,
            negligible_edge: 4e-6,
            widest_blur_px: 64.0,
            smoothing_px: 4,
            levels_wide_blur: true,
        }
    }
}

impl Settings {
    /// Checks every setting's range.
    ///
    /// # Errors
    /// Names the first setting that is out of range.
    pub fn check(&self) -> Result<(), ForwardError> {
        let positive = [
            ("the largest edge error", self.max_edge_error),
            ("the largest shading error", self.max_shading_error),
            ("the layer step", self.layer_step_px),
            ("the depth edge", self.depth_edge_px),
        ];
        for (what, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                return Err(ForwardError::Setting { what, value, expected: "a number above 0" });
            }
        }
        let not_negative = [
            ("the chromatic step", self.chromatic_step_px),
            ("the coverage step", self.coverage_step_px),
            ("the negligible edge", self.negligible_edge),
        ];
        for (what, value) in not_negative {
            if !(value.is_finite() && value >= 0.0) {
                return Err(ForwardError::Setting { what, value, expected: "a number, 0 or more" });
            }
        }
        if let BlurMode::Views(n) = self.mode
            && !(2..=256).contains(&n)
        {
            let (what, value) = ("the number of views", n as f64);
            return Err(ForwardError::Setting { what, value, expected: "a whole number from 2 to 256" });
        }
        if !(self.widest_blur_px.is_finite() && self.widest_blur_px >= 4.0) {
            let (what, value) = ("the widest blur", self.widest_blur_px);
            return Err(ForwardError::Setting { what, value, expected: "a number, 4 pixels or more" });
        }
        // Twice that is no longer than the smallest cell.
        if self.smoothing_px > 8 || self.smoothing_px % 2 == 1 {
            let (what, value) = ("the smoothing of weights", self.smoothing_px as f64);
            return Err(ForwardError::Setting { what, value, expected: "an even number of pixels, 8 at most" });
        }
        if !(16..=1024).contains(&self.knot_spacing_px) || self.knot_spacing_px % 2 == 1 {
            let (what, value) = ("the knot spacing", self.knot_spacing_px as f64);
            return Err(ForwardError::Setting { what, value, expected: "an even number from 16 to 1024 pixels" });
        }
        Ok(())
    }
}
