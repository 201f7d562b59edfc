//! Places in the stop and on the film, each in its own frame.
//!
//! A point of the lens frame has three coordinates ([`RayBatch::point_mm`]); a place in the stop or on the film has two, along
//! the axes of that surface. They are types of their own, and only [`MonoLens`] turns one into another, so that the frames
//! of a decentred stop or a tilted film cannot be taken for that of the lens.

use glam::{DVec2, DVec3};

use crate::{MonoLens, Pose, RayBatch};

/// A place in the stop: mm from its center, along its own x and y.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StopPoint {
    /// The coordinates, mm.
    pub mm: DVec2,
}

/// A place on the film: mm from its vertex, along its own x and y.
///
/// On a curved film it is the projection onto the plane through the film's vertex.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FilmPoint {
    /// The coordinates, mm.
    pub mm: DVec2,
}

impl FilmPoint {
    /// Returns the place in the picture, mm from its middle: the film turned by 180°, x to the right, y up.
    #[inline]
    pub fn in_picture_mm(self) -> DVec2 {
        -self.mm
    }
}

impl MonoLens {
    /// Where a surface stands: on the axis at its vertex, unless it is tilted or decentred.
    pub fn surface_pose(&self, surface: usize) -> Pose {
        self.poses().map_or_else(|| Pose::centered(self.vertex_z_mm(surface)), |poses| poses[surface])
    }

    /// Where the stop stands.
    pub fn stop_pose(&self) -> Pose {
        self.surface_pose(self.stop())
    }

    /// Returns the place in the stop of a point of the lens frame.
    pub fn stop_point(&self, point_mm: DVec3) -> StopPoint {
        StopPoint { mm: self.in_stop_mm(point_mm) }
    }

    /// Returns the places in the stop of rays that are there, those that have ended included.
    pub fn stop_points(&self, rays: &RayBatch) -> Vec<StopPoint> {
        (0..rays.len()).map(|ray| self.stop_point(rays.point_mm(ray))).collect()
    }

    /// Returns the place on the film, `film_mm` behind the last vertex, of a point of the lens frame.
    pub fn film_point(&self, point_mm: DVec3, film_mm: f64) -> FilmPoint {
        FilmPoint { mm: self.on_film_mm(point_mm, film_mm) }
    }

    /// Returns the places on the film, `film_mm` behind the last vertex, of rays that are there, those that have ended
    /// included.
    pub fn film_points(&self, rays: &RayBatch, film_mm: f64) -> Vec<FilmPoint> {
        (0..rays.len()).map(|ray| self.film_point(rays.point_mm(ray), film_mm)).collect()
    }

    /// Returns the places on the film, `film_mm` behind the last vertex, of those rays that are in flight there.
    pub fn landed<'a>(&'a self, rays: &'a RayBatch, film_mm: f64) -> impl Iterator<Item = FilmPoint> + 'a {
        let in_flight = (0..rays.len()).filter(|&ray| rays.fate[ray].is_in_flight());
        in_flight.map(move |ray| self.film_point(rays.point_mm(ray), film_mm))
    }
}
