//! Shapes that a ray is cut with in closed form.

use glam::{DAffine3, DVec2, DVec3};
use std::f64::consts::TAU;

use crate::{Lathe, TriangleMesh, WorldError, lathe::SurfacePoint, mesh::normal_matrix};

/// A shape about its own origin.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// Triangles.
    Mesh(TriangleMesh),
    /// A sphere about the origin. `u` runs about the z axis from +x, `v` from the south pole at −z to the north pole.
    Sphere {
        /// Radius, m.
        radius_m: f64,
    },
    /// A disc, or ring, in the plane z = 0, whose outside is +z. `u` runs about the axis, `v` from the rim inwards.
    Disc {
        /// Radius of the rim, m.
        radius_m: f64,
        /// Radius of the hole, m; 0 for none.
        inner_radius_m: f64,
    },
    /// The mantle of a cylinder about the z axis, open at its ends. `u` runs about the axis, `v` along it.
    Cylinder {
        /// Radius, m.
        radius_m: f64,
        /// Where it begins, m.
        z_min_m: f64,
        /// Where it ends, m.
        z_max_m: f64,
    },
    /// A surface of revolution about the z axis.
    Lathe(Lathe),
}

impl Shape {
    /// Checks that the shape has an extent: finite, positive radii and heights, or a sound mesh.
    ///
    /// # Errors
    /// When it has not, with the number that is wrong.
    pub fn check(&self) -> Result<(), WorldError> {
        let wrong = |what, value: f64, expected| Err(WorldError::Setting { what, value: value.to_string(), expected });
        match *self {
            Self::Mesh(ref mesh) => mesh.check(),
            Self::Sphere { radius_m } | Self::Disc { radius_m, .. } | Self::Cylinder { radius_m, .. }
                if !(radius_m > 0.0 && radius_m.is_finite()) =>
            {
                wrong("the radius of a shape", radius_m, "a finite length over 0 m")
            }
            Self::Disc { radius_m, inner_radius_m } if !(0.0..radius_m).contains(&inner_radius_m) => {
                wrong("the inner radius of a disc", inner_radius_m, "0 m or more and less than the radius")
            }
            Self::Cylinder { z_min_m, z_max_m, .. }
                if !(z_min_m < z_max_m && z_min_m.is_finite() && z_max_m.is_finite()) =>
            {
                wrong("the upper end of a cylinder", z_max_m, "a finite height over its lower end")
            }
            _ => Ok(()),
        }
    }
}

/// A sphere, disc or cylinder that has been placed.
#[derive(Clone, Debug)]
pub(crate) struct Quadric {
    shape: Shape,
    place: DAffine3,
    inverse: DAffine3,
    normals_by: glam::DMat3,
}

impl Quadric {
    pub(crate) fn new(shape: Shape, place: DAffine3) -> Self {
        Self { shape, place, inverse: place.inverse(), normals_by: normal_matrix(&place) }
    }

    pub(crate) fn shape(&self) -> &Shape {
        &self.shape
    }

    pub(crate) fn place(&self) -> &DAffine3 {
        &self.place
    }

    /// Returns a point of its group's frame in its own.
    pub(crate) fn own_point(&self, point: DVec3) -> DVec3 {
        self.inverse.transform_point3(point)
    }

    /// Returns by how much placing enlarges areas at a point of the surface.
    pub(crate) fn area_ratio_at(&self, point: DVec3) -> f64 {
        let p = self.inverse.transform_point3(point);
        let own_normal = match self.shape {
            Shape::Sphere { .. } => p.normalize_or(DVec3::Z),
            Shape::Cylinder { .. } => p.truncate().normalize_or(DVec2::X).extend(0.0),
            Shape::Lathe(ref lathe) => lathe.normal_at(p),
            Shape::Disc { .. } | Shape::Mesh(_) => DVec3::Z,
        };
        (self.normals_by * own_normal).length()
    }

    /// Returns the corners of an upright box around it.
    pub(crate) fn bounds(&self) -> (DVec3, DVec3) {
        let (low, high) = match self.shape {
            Shape::Sphere { radius_m } => (DVec3::splat(-radius_m), DVec3::splat(radius_m)),
            Shape::Disc { radius_m: r, .. } => (DVec3::new(-r, -r, 0.0), DVec3::new(r, r, 0.0)),
            Shape::Cylinder { radius_m: r, z_min_m, z_max_m } => {
                (DVec3::new(-r, -r, z_min_m), DVec3::new(r, r, z_max_m))
            }
            Shape::Lathe(ref lathe) => lathe.bounds(),
            Shape::Mesh(_) => (DVec3::ZERO, DVec3::ZERO),
        };
        placed_bounds(&self.place, low, high)
    }

    /// Returns the first `t` in (0, `t_max`) at which `origin + t · direction` meets it.
    pub(crate) fn meets(&self, origin: DVec3, direction: DVec3, t_max: f64) -> Option<f64> {
        let o = self.inverse.transform_point3(origin);
        let d = self.inverse.transform_vector3(direction);
        let within = |t: &f64| *t > 0.0 && *t < t_max;
        match self.shape {
            Shape::Mesh(_) => None,
            Shape::Lathe(ref lathe) => lathe.meets(o, d, t_max),
            Shape::Sphere { radius_m } => {
                // The distance of the center from the line, squared, computed from the nearest point: no cancellation.
                let nearest = -o.dot(d) / d.length_squared();
                let off_center = o + nearest * d;
                let half_chord_squared = (radius_m * radius_m - off_center.length_squared()) / d.length_squared();
                if half_chord_squared < 0.0 {
                    return None;
                }
                let half_chord = half_chord_squared.sqrt();
                [nearest - half_chord, nearest + half_chord].into_iter().find(within)
            }
            Shape::Disc { radius_m, inner_radius_m } => {
                let t = -o.z / d.z;
                let r_squared = (o + t * d).truncate().length_squared();
                let is_on = r_squared <= radius_m * radius_m && r_squared >= inner_radius_m * inner_radius_m;
                (within(&t) && is_on).then_some(t)
            }
            Shape::Cylinder { radius_m, z_min_m, z_max_m } => {
                let (o2, d2) = (o.truncate(), d.truncate());
                let nearest = -o2.dot(d2) / d2.length_squared();
                let off_axis = o2 + nearest * d2;
                let half_chord_squared = (radius_m * radius_m - off_axis.length_squared()) / d2.length_squared();
                if half_chord_squared.is_nan() || half_chord_squared < 0.0 {
                    return None;
                }
                let half_chord = half_chord_squared.sqrt();
                let is_on = |t: &f64| (z_min_m..=z_max_m).contains(&(o.z + t * d.z));
                [nearest - half_chord, nearest + half_chord].into_iter().find(|t| within(t) && is_on(t))
            }
        }
    }

    /// Returns the surface where a point close to it lies, the point put on the surface.
    pub(crate) fn surface_at(&self, point: DVec3) -> SurfacePoint {
        let p = self.inverse.transform_point3(point);
        let azimuth = |p: DVec3| {
            let angle = p.y.atan2(p.x);
            if angle < 0.0 { angle + TAU } else { angle }
        };
        let (p, normal, dp_du, dp_dv, uv) = match self.shape {
            Shape::Sphere { radius_m } => {
                let normal = p.normalize_or(DVec3::Z);
                let p = radius_m * normal;
                let from_axis = p.truncate().length().max(1e-12 * radius_m);
                let v = 1.0 - (normal.z).clamp(-1.0, 1.0).acos() / (0.5 * TAU);
                let dp_du = TAU * DVec3::new(-p.y, p.x, 0.0);
                let dp_du = if dp_du == DVec3::ZERO { TAU * DVec3::Y * from_axis } else { dp_du };
                let along = DVec3::new(-p.x * p.z / from_axis, -p.y * p.z / from_axis, from_axis);
                (p, normal, dp_du, 0.5 * TAU * along, DVec2::new(azimuth(p) / TAU, v))
            }
            Shape::Disc { radius_m, inner_radius_m } => {
                let p = DVec3::new(p.x, p.y, 0.0);
                let r = p.length();
                let width = radius_m - inner_radius_m;
                let outwards = p.normalize_or(DVec3::X);
                let dp_du = TAU * DVec3::new(-outwards.y, outwards.x, 0.0) * r.max(1e-12 * radius_m);
                (p, DVec3::Z, dp_du, -outwards * width, DVec2::new(azimuth(p) / TAU, (radius_m - r) / width))
            }
            Shape::Cylinder { radius_m, z_min_m, z_max_m } => {
                let outwards = p.truncate().normalize_or(DVec2::X).extend(0.0);
                let height = z_max_m - z_min_m;
                let on = radius_m * outwards + DVec3::Z * p.z;
                let dp_du = TAU * DVec3::new(-on.y, on.x, 0.0);
                (on, outwards, dp_du, DVec3::Z * height, DVec2::new(azimuth(p) / TAU, (p.z - z_min_m) / height))
            }
            Shape::Lathe(ref lathe) => {
                let SurfacePoint { point, normal, dp_du, dp_dv, uv } = lathe.surface_at(p);
                (point, normal, dp_du, dp_dv, uv)
            }
            Shape::Mesh(_) => (p, DVec3::Z, DVec3::X, DVec3::Y, DVec2::ZERO),
        };
        SurfacePoint {
            point: self.place.transform_point3(p),
            normal: (self.normals_by * normal).normalize(),
            dp_du: self.place.transform_vector3(dp_du),
            dp_dv: self.place.transform_vector3(dp_dv),
            uv,
        }
    }
}

/// Returns the corners of an upright box around a placed box.
pub(crate) fn placed_bounds(place: &DAffine3, low: DVec3, high: DVec3) -> (DVec3, DVec3) {
    let center = place.transform_point3(0.5 * (low + high));
    let half = 0.5 * (high - low);
    let m = place.matrix3;
    let half = m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z;
    (center - half, center + half)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    fn placed(shape: Shape) -> Quadric {
        shape.check().unwrap();
        let place = DAffine3::from_translation(DVec3::new(0.0, 0.0, 5.0))
            * DAffine3::from_rotation_x(1.1)
            * DAffine3::from_scale(DVec3::new(2.0, 1.0, 1.5));
        Quadric::new(shape, place)
    }

    fn shapes() -> [Shape; 3] {
        [
            Shape::Sphere { radius_m: 0.7 },
            Shape::Disc { radius_m: 1.1, inner_radius_m: 0.2 },
            Shape::Cylinder { radius_m: 0.5, z_min_m: -0.3, z_max_m: 0.8 },
        ]
    }

    /// Surface derivatives are held to differences of the surface itself, moved along them.
    #[test]
    fn derivatives_follow_texture_coordinates() {
        for quadric in shapes().map(placed) {
            for i in 0..40 {
                let aim = DVec3::new(0.9 * (0.7 * f64::from(i)).sin(), 0.9 * (1.3 * f64::from(i)).cos(), 5.0);
                let Some(t) = quadric.meets(DVec3::ZERO, aim, f64::INFINITY) else { continue };
                let at = quadric.surface_at(t * aim);
                assert!(at.point.abs_diff_eq(t * aim, 1e-12));
                assert_abs_diff_eq!(at.normal.dot(at.dp_du), 0.0, epsilon = 1e-9);
                assert_abs_diff_eq!(at.normal.dot(at.dp_dv), 0.0, epsilon = 1e-9);
                let step = 1e-6;
                let along_u = quadric.surface_at(at.point + step * at.dp_du).uv - at.uv;
                let along_v = quadric.surface_at(at.point + step * at.dp_dv).uv - at.uv;
                assert!((along_u / step).abs_diff_eq(DVec2::X, 1e-4));
                assert!((along_v / step).abs_diff_eq(DVec2::Y, 1e-4));
            }
        }
    }

    #[test]
    fn bounds_hold_every_crossing() {
        for quadric in shapes().map(placed) {
            let (low, high) = quadric.bounds();
            let mut n_met = 0;
            for i in 0..2000 {
                let aim = DVec3::new(2.0 * (0.71 * f64::from(i)).sin(), 2.0 * (1.37 * f64::from(i)).cos(), 5.0);
                if let Some(t) = quadric.meets(DVec3::ZERO, aim, f64::INFINITY) {
                    n_met += 1;
                    let p = t * aim;
                    assert!(p.cmpge(low - 1e-9).all() && p.cmple(high + 1e-9).all(), "{p} in {low} to {high}");
                }
            }
            assert!(n_met > 50, "{n_met}");
        }
    }

    #[test]
    fn sphere_is_met_from_inside() {
        let sphere = Quadric::new(Shape::Sphere { radius_m: 2.0 }, DAffine3::IDENTITY);
        assert_eq!(sphere.meets(DVec3::ZERO, DVec3::X, 9.0), Some(2.0));
        assert_eq!(sphere.meets(-4.0 * DVec3::X, DVec3::X, 9.0), Some(2.0));
        assert_eq!(sphere.meets(-4.0 * DVec3::X, DVec3::X, 1.9), None);
    }
}
