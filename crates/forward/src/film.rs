//! The film and the settings of a forward rendering.

use dioptric_optics::MirrorFilm;
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

    /// Returns the film as a mirror at this distance behind the last vertex of a lens, which reflects this share of the light.
    pub fn as_mirror(&self, distance_mm: f64, reflectance: f64) -> MirrorFilm {
        // The picture is the film turned by 180°.
        MirrorFilm { distance_mm, reflectance, half_mm: self.half_size_mm(), center_mm: -self.center_mm }
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

/// What lies beyond the edges of a scene, for the blur of what the film sees near them. Points of the film that look beyond the scene stay dark.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Border {
    /// The outermost samples go on.
    #[default]
    Hold,
    /// The scene is mirrored at its edges.
    Mirror,
    /// Darkness, at the depth of the edge.
    Black,
}

/// How finely a forward rendering is made.
///
/// The defaults are those whose accuracy was measured; a larger step is faster and less exact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// How surfaces hide each other.
    pub mode: BlurMode,
    /// Side of the largest tiles of the film, between whose corners point spread functions are interpolated, pixels (samples where those are wider).
    pub tile_px: usize,
    /// Largest error of the edge spread function in the middle of a tile, in the middle band: larger ones are cut in four.
    pub max_edge_error: f64,
    /// Distance between depth layers, pixels of blur radius.
    pub layer_step_px: f64,
    /// Largest change of blur radius between wavelengths among which point spread functions are interpolated, pixels.
    pub chromatic_step_px: f64,
    /// Largest blur radius that is imaged on the pixels of the film; wider blurs are imaged on samples 2, 4, 8 … times as wide, so that the radius is
    /// between half of this and this. At least 4.
    pub widest_blur_px: f64,
    /// Whether detail of the scene below a pixel is imaged on samples of half a pixel where the blur leaves any of it.
    pub subpixels: bool,
    /// What lies beyond the edges of the scene.
    pub border: Border,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            mode: BlurMode::Layered,
            tile_px: 128,
            max_edge_error: 0.007,
            layer_step_px: 2.0,
            chromatic_step_px: 0.25,
            widest_blur_px: 64.0,
            subpixels: true,
            border: Border::Hold,
        }
    }
}

impl Settings {
    /// Checks every setting's range.
    ///
    /// # Errors
    /// Names the first setting that is out of range.
    pub fn check(&self) -> Result<(), ForwardError> {
        let check = |what, value: f64, expected, is_good: bool| match is_good {
            true => Ok(()),
            false => Err(ForwardError::Setting { what, value, expected }),
        };
        for (what, value) in [("the largest edge error", self.max_edge_error), ("the layer step", self.layer_step_px)] {
            check(what, value, "a number above 0", value.is_finite() && value > 0.0)?;
        }
        let step = self.chromatic_step_px;
        check("the chromatic step", step, "a number, 0 or more", step.is_finite() && step >= 0.0)?;
        if let BlurMode::Views(n) = self.mode {
            check("the number of views", n as f64, "a whole number from 2 to 256", (2..=256).contains(&n))?;
        }
        let widest = self.widest_blur_px;
        check("the widest blur", widest, "a number, 4 pixels or more", widest.is_finite() && widest >= 4.0)?;
        let is_good = (16..=1024).contains(&self.tile_px) && self.tile_px.is_power_of_two();
        check("the side of tiles", self.tile_px as f64, "a power of two from 16 to 1024 pixels", is_good)
    }
}
