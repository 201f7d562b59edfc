//! Patterns by formula: what varies with the place on a shape, and not with texture coordinates.

use std::{fmt, sync::Arc};

use glam::DVec3;

/// A point of a surface, in the frame of its shape.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PatternPoint {
    /// The point, m.
    pub point_m: DVec3,
    /// The shading normal, of length 1; 0 where only the glow of a place is asked for.
    pub normal: DVec3,
    /// The size of details that are to be blurred away, m: 0 for none.
    pub footprint_m: f64,
}

/// How textures share a surface, by formula.
///
/// ```
/// use dioptric_world::{Pattern, PatternPoint};
/// /// Stripes along x, of 2 cm.
/// #[derive(Debug)]
/// struct Stripes;
/// impl Pattern for Stripes {
///     fn shares(&self, at: &PatternPoint, shares: &mut [f32]) {
///         shares[usize::from((at.point_m.x / 0.02).floor().rem_euclid(2.0) == 1.0)] = 1.0;
///     }
/// }
/// ```
pub trait Pattern: fmt::Debug + Send + Sync {
    /// Writes what each texture counts at a point; all are 0 before. Reflectances stay below 1 where the sum is 1 or less.
    fn shares(&self, at: &PatternPoint, shares: &mut [f32]);

    /// Returns what is added to the normal of length 1, for relief.
    fn tilt(&self, at: &PatternPoint) -> DVec3 {
        let _ = at;
        DVec3::ZERO
    }
}

/// A pattern that textures share; equal to itself alone.
#[derive(Clone, Debug)]
pub struct PatternRef(Arc<dyn Pattern>);

impl PatternRef {
    /// Returns a pattern to be shared.
    pub fn new(pattern: impl Pattern + 'static) -> Self {
        Self(Arc::new(pattern))
    }
}

impl PartialEq for PatternRef {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl std::ops::Deref for PatternRef {
    type Target = dyn Pattern;

    fn deref(&self) -> &Self::Target {
        &*self.0
    }
}

/// The most textures of one pattern.
pub(crate) const MOST_SHARES: usize = 32;
