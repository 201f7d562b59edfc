//! Places on the film, which may be moved, tilted and curved.

use glam::{DVec2, DVec3};

use crate::{ImageSurface, MonoLens};

/// A place on the film, in the lens frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmSite {
    /// The point, mm.
    pub point_mm: DVec3,
    /// The unit normal of the film there, along the light.
    pub normal: DVec3,
}

impl ImageSurface {
    /// Returns how far behind its vertex plane the film lies over a place of that plane, mm; NaN where it does not reach.
    pub fn sag_at_mm(&self, place_mm: DVec2) -> f64 {
        let (c, r2) = (self.curvature_per_mm, place_mm.length_squared());
        c * r2 / (1.0 + (1.0 - (1.0 + self.conic) * c * c * r2).sqrt())
    }
}

impl MonoLens {
    /// Returns the site of the film over this place of its own x–y plane, mm, its vertex `film_distance_mm` behind the
    /// last vertex; `None` where a curved film does not reach.
    pub fn film_site(&self, place_mm: DVec2, film_distance_mm: f64) -> Option<FilmSite> {
        let (surface, pose) = (self.image_surface(), self.film_pose(film_distance_mm));
        let sag_mm = surface.sag_at_mm(place_mm);
        let slope = surface.slope_at(place_mm);
        let is_there = sag_mm.is_finite() && slope.is_finite();
        is_there.then(|| FilmSite {
            point_mm: pose.to_lens(place_mm.extend(sag_mm)),
            normal: pose.rotation * (-slope).extend(1.0).normalize(),
        })
    }
}
