//! Places on the film, which may be moved, tilted and curved.

use glam::{DVec2, DVec3};

use crate::MonoLens;

/// A place on the film, in the lens frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmSite {
    /// The point, mm.
    pub point_mm: DVec3,
    /// The unit normal of the film there, along the light.
    pub normal: DVec3,
}

impl MonoLens {
    /// Returns the site of the film over this place of its own x–y plane, mm, its vertex `film_distance_mm` behind the
    /// last vertex; `None` where a curved film does not reach.
    pub fn film_site(&self, place_mm: DVec2, film_distance_mm: f64) -> Option<FilmSite> {
        let (surface, placement) = (self.image_surface(), self.film_placement(film_distance_mm));
        let sag_mm = surface.sag_at_mm(place_mm);
        let slope = surface.slope_at(place_mm);
        let is_there = sag_mm.is_finite() && slope.is_finite();
        is_there.then(|| FilmSite {
            point_mm: placement.lens_from_surface(place_mm.extend(sag_mm)),
            normal: placement.rotation * (-slope).extend(1.0).normalize(),
        })
    }
}
