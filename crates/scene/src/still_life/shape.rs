//! Shapes that a ray can be cut with in closed form.

use glam::{DMat3, DVec3};

/// A ray, `origin + t · direction`; the direction has length 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ray {
    pub(super) origin: DVec3,
    pub(super) direction: DVec3,
}

/// Where a ray meets a shape, in the frame of the shape.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crossing {
    pub(super) t: f64,
    pub(super) point: DVec3,
    /// Of length 1, outwards.
    pub(super) normal: DVec3,
}

/// A shape about its own origin; y is up.
#[derive(Clone, Debug)]
pub(super) enum Shape {
    /// A box with these half sides. A ray that starts inside meets its far wall.
    Block(DVec3),
    /// A sphere of this radius.
    Sphere(f64),
    /// A surface turned about the y axis.
    Lathe(Lathe),
}

impl Shape {
    /// Returns the corners of an upright box that holds the shape in a frame.
    pub(super) fn bounds(&self, frame: &Frame) -> (DVec3, DVec3) {
        let (middle, half) = match self {
            Self::Block(half) => (DVec3::ZERO, *half),
            Self::Sphere(radius) => {
                return (frame.origin - DVec3::splat(*radius), frame.origin + DVec3::splat(*radius));
            }
            Self::Lathe(Lathe { bottom, top, max_radius: radius, .. }) => {
                let half_height = 0.5 * (top - bottom);
                (DVec3::new(0.0, bottom + half_height, 0.0), DVec3::new(*radius, half_height, *radius))
            }
        };
        let axes = frame.rotation;
        let center = frame.origin + axes * middle;
        let half = axes.x_axis.abs() * half.x + axes.y_axis.abs() * half.y + axes.z_axis.abs() * half.z;
        (center - half, center + half)
    }

    /// Returns the first crossing beyond `t_min`.
    pub(super) fn cross(&self, ray: Ray, t_min: f64, t_max: f64) -> Option<Crossing> {
        match self {
            Self::Block(half) => cross_block(*half, ray, t_min, t_max),
            Self::Sphere(radius) => {
                let b = ray.origin.dot(ray.direction);
                let discriminant = b * b - ray.origin.length_squared() + radius * radius;
                if discriminant < 0.0 {
                    return None;
                }
                let root = discriminant.sqrt();
                let t = [-b - root, -b + root].into_iter().find(|&t| t > t_min && t < t_max)?;
                let point = ray.origin + t * ray.direction;
                Some(Crossing { t, point, normal: point / *radius })
            }
            Self::Lathe(lathe) => lathe.cross(ray, t_min, t_max),
        }
    }
}

fn cross_block(half: DVec3, ray: Ray, t_min: f64, t_max: f64) -> Option<Crossing> {
    let inverse = ray.direction.recip();
    let (a, b) = ((-half - ray.origin) * inverse, (half - ray.origin) * inverse);
    let (near, far) = (a.min(b), a.max(b));
    let (t_in, t_out) = (near.max_element(), far.min_element());
    if t_in > t_out {
        return None;
    }
    let (t, along) = if t_in > t_min { (t_in, near) } else { (t_out, far) };
    if !(t > t_min && t < t_max) {
        return None;
    }
    let point = ray.origin + t * ray.direction;
    let axis = if along.x == t {
        DVec3::X
    } else if along.y == t {
        DVec3::Y
    } else {
        DVec3::Z
    };
    Some(Crossing { t, point, normal: axis * point.dot(axis).signum() })
}

/// A surface turned about the y axis, in pieces on each of which radius² is a parabola of the height.
///
/// Spheres, cones, cylinders and all that a potter makes are such pieces or are followed closely by them, and a ray
/// meets each where a quadratic is 0.
#[derive(Clone, Debug)]
pub(super) struct Lathe {
    pieces: Vec<Piece>,
    /// Flat rings: height, inner and outer radius.
    rings: Vec<[f64; 3]>,
    bottom: f64,
    top: f64,
    max_radius: f64,
}

/// radius² = c0 + c1 (y − bottom) + c2 (y − bottom)² from `bottom` to `top`.
#[derive(Clone, Copy, Debug)]
struct Piece {
    bottom: f64,
    top: f64,
    c: [f64; 3],
}

impl Lathe {
    /// Returns the smooth surface through (height, radius) points, heights ascending.
    ///
    /// Radius² follows a curve of continuous slope that keeps between neighboring points: a parabola on each half of
    /// each interval, with slopes limited as Fritsch and Butland (1984) do.
    pub(super) fn smooth(profile: &[[f64; 2]]) -> Self {
        let squared: Vec<[f64; 2]> = profile.iter().map(|[y, r]| [*y, r * r]).collect();
        let slopes = limited_slopes(&squared);
        let mut pieces = Vec::new();
        for (i, pair) in squared.windows(2).enumerate() {
            let ([y0, f0], [y1, f1]) = (pair[0], pair[1]);
            let (h, d0, d1) = (y1 - y0, slopes[i], slopes[i + 1]);
            // The slope at the middle that makes both parabolas meet.
            let middle = 2.0 * (f1 - f0) / h - 0.5 * (d0 + d1);
            let half = 0.5 * h;
            pieces.push(Piece { bottom: y0, top: y0 + half, c: [f0, d0, (middle - d0) / h] });
            let f_middle = f0 + half * 0.5 * (d0 + middle);
            pieces.push(Piece { bottom: y0 + half, top: y1, c: [f_middle, middle, (d1 - middle) / h] });
        }
        Self::of(pieces, Vec::new())
    }

    /// Returns cones through (height, radius) points, with flat ends.
    pub(super) fn cones(profile: &[[f64; 2]]) -> Self {
        let piece = |pair: &[[f64; 2]]| {
            let ([y0, r0], [y1, r1]) = (pair[0], pair[1]);
            let k = (r1 - r0) / (y1 - y0);
            Piece { bottom: y0, top: y1, c: [r0 * r0, 2.0 * r0 * k, k * k] }
        };
        let ends = [profile[0], profile[profile.len() - 1]];
        let rings = ends.into_iter().filter(|[_, r]| *r > 0.0).map(|[y, r]| [y, 0.0, r]).collect();
        Self::of(profile.windows(2).map(piece).collect(), rings)
    }

    /// Adds a flat ring.
    pub(super) fn with_ring(mut self, y: f64, inner: f64, outer: f64) -> Self {
        self.rings.push([y, inner, outer]);
        self
    }

    fn of(pieces: Vec<Piece>, rings: Vec<[f64; 3]>) -> Self {
        let (bottom, top) = (pieces[0].bottom, pieces[pieces.len() - 1].top);
        let radius_squared = |p: &Piece| {
            let h = p.top - p.bottom;
            let vertex = if p.c[2] < 0.0 { (-0.5 * p.c[1] / p.c[2]).clamp(0.0, h) } else { 0.0 };
            [0.0, vertex, h].map(|u| p.c[0] + u * (p.c[1] + u * p.c[2])).into_iter().fold(0.0, f64::max)
        };
        let max_radius = pieces.iter().map(radius_squared).fold(0.0, f64::max).sqrt();
        Self { pieces, rings, bottom, top, max_radius }
    }

    fn cross(&self, ray: Ray, t_min: f64, t_max: f64) -> Option<Crossing> {
        let (o, d) = (ray.origin, ray.direction);
        // Heights over which the ray is within the largest radius.
        let across = d.x * d.x + d.z * d.z;
        let half_b = o.x * d.x + o.z * d.z;
        let discriminant =
            half_b * half_b - across * (o.x * o.x + o.z * o.z - self.max_radius * self.max_radius * (1.0 + 1e-9));
        if discriminant < 0.0 {
            return None;
        }
        let root = discriminant.sqrt();
        let heights = [-half_b - root, -half_b + root].map(|t| o.y + d.y * t / across);
        // Straight up and down the heights are not numbers, and bound nothing.
        let (low, high) = match across > 0.0 {
            true => (heights[0].min(heights[1]), heights[0].max(heights[1])),
            false => (f64::MIN, f64::MAX),
        };
        let mut found: Option<Crossing> = None;
        for &[y, inner, outer] in &self.rings {
            let t = (y - o.y) / d.y;
            if t > t_min && t < found.map_or(t_max, |c| c.t) {
                let point = o + t * d;
                let r2 = point.x * point.x + point.z * point.z;
                if r2 <= outer * outer && r2 >= inner * inner {
                    found = Some(Crossing { t, point, normal: DVec3::Y });
                }
            }
        }
        for piece in self.pieces.iter().filter(|piece| piece.bottom <= high && piece.top >= low) {
            let y = o.y - piece.bottom;
            let [c0, c1, c2] = piece.c;
            let a = d.x * d.x + d.z * d.z - c2 * d.y * d.y;
            let half_b = o.x * d.x + o.z * d.z - 0.5 * c1 * d.y - c2 * y * d.y;
            let c = o.x * o.x + o.z * o.z - c0 - y * (c1 + c2 * y);
            for t in roots(a, half_b, c) {
                let height = y + t * d.y;
                let is_on = height >= 0.0 && height <= piece.top - piece.bottom;
                if is_on && t > t_min && t < found.map_or(t_max, |c| c.t) {
                    let point = o + t * d;
                    let slope = -0.5 * c1 - c2 * height;
                    let normal = DVec3::new(point.x, slope, point.z).try_normalize().unwrap_or(DVec3::Y);
                    found = Some(Crossing { t, point, normal });
                }
            }
        }
        found
    }
}

/// Returns the slopes at the points of a table, 0 at its hills and valleys.
fn limited_slopes(points: &[[f64; 2]]) -> Vec<f64> {
    let secants: Vec<f64> = points.windows(2).map(|p| (p[1][1] - p[0][1]) / (p[1][0] - p[0][0])).collect();
    let n = points.len();
    (0..n)
        .map(|i| match i {
            // At the ends the slope goes on as the curve's own parabola would; a closed end is then round.
            0 if n > 2 => end_slope(secants[0], secants[1]),
            _ if i == n - 1 && n > 2 => end_slope(secants[n - 2], secants[n - 3]),
            0 => secants[0],
            _ if i == n - 1 => secants[n - 2],
            _ => {
                let (a, b) = (secants[i - 1], secants[i]);
                if a * b <= 0.0 { 0.0 } else { 2.0 * a * b / (a + b) }
            }
        })
        .collect()
}

fn end_slope(secant: f64, next: f64) -> f64 {
    let slope = 1.5 * secant - 0.5 * next;
    if slope * secant <= 0.0 { 0.0 } else { slope }
}

/// Returns the roots of a t² + 2 b t + c, or as many as there are.
fn roots(a: f64, half_b: f64, c: f64) -> impl Iterator<Item = f64> {
    let discriminant = half_b * half_b - a * c;
    let q = if discriminant < 0.0 { f64::NAN } else { -half_b - half_b.signum() * discriminant.sqrt() };
    // A comparison with NaN is false: what is no root is never on a piece.
    [q / a, c / q].into_iter()
}

/// Where a shape stands: a point of the shape is at `origin + rotation · point`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub(super) origin: DVec3,
    pub(super) rotation: DMat3,
}

impl Frame {
    pub(super) fn at(x: f64, y: f64, z: f64) -> Self {
        Self { origin: DVec3::new(x, y, z), rotation: DMat3::IDENTITY }
    }

    /// Turns about the vertical by an angle, then leaves the rest as it was.
    #[must_use]
    pub(super) fn turned_deg(self, degrees: f64) -> Self {
        Self { rotation: self.rotation * DMat3::from_rotation_y(degrees.to_radians()), ..self }
    }

    /// Leans back by an angle, about the shape's own x axis.
    #[must_use]
    pub(super) fn leaning_deg(self, degrees: f64) -> Self {
        Self { rotation: self.rotation * DMat3::from_rotation_x(degrees.to_radians()), ..self }
    }

    /// Tips over to the side by an angle, about the shape's own z axis.
    #[must_use]
    pub(super) fn tipped_deg(self, degrees: f64) -> Self {
        Self { rotation: self.rotation * DMat3::from_rotation_z(degrees.to_radians()), ..self }
    }

    /// Returns the frame whose y axis runs from one point to another.
    pub(super) fn along(from: DVec3, to: DVec3) -> Self {
        let y = (to - from).normalize();
        let x = y.any_orthonormal_vector();
        Self { origin: from, rotation: DMat3::from_cols(x, y, x.cross(y)) }
    }

    /// Returns a ray of the room in the frame of the shape.
    pub(super) fn inward(&self, ray: Ray) -> Ray {
        let back = self.rotation.transpose();
        Ray { origin: back * (ray.origin - self.origin), direction: back * ray.direction }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    const FORWARD: Ray = Ray { origin: DVec3::new(0.0, 0.0, -3.0), direction: DVec3::Z };

    #[test]
    fn a_sphere_a_block_and_a_turned_sphere_are_met_where_they_are() {
        // A parabola of radius² through five points of a sphere is the sphere itself.
        let profile = [-1.0, -0.5, 0.0, 0.5, 1.0].map(|y: f64| [y, (1.0 - y * y).sqrt()]);
        for shape in [Shape::Sphere(1.0), Shape::Block(DVec3::ONE), Shape::Lathe(Lathe::smooth(&profile))] {
            let crossing = shape.cross(FORWARD, 0.0, 10.0).unwrap();
            assert_abs_diff_eq!(crossing.t, 2.0, epsilon = 1e-12);
            assert_abs_diff_eq!(crossing.normal.z, -1.0, epsilon = 1e-12);
            let inside = Ray { origin: DVec3::ZERO, ..FORWARD };
            assert_abs_diff_eq!(shape.cross(inside, 1e-9, 10.0).unwrap().t, 1.0, epsilon = 1e-12);
            let beside = Ray { origin: DVec3::new(5.0, 0.0, -3.0), ..FORWARD };
            assert!(shape.cross(beside, 0.0, 10.0).is_none());
            assert!(shape.cross(FORWARD, 0.0, 1.9).is_none());
        }
    }

    #[test]
    fn a_vase_passes_through_its_points_and_its_normals_are_its_slopes() {
        let profile = [[0.0, 0.3], [0.4, 0.8], [0.9, 0.35], [1.2, 0.5]];
        let vase = Shape::Lathe(Lathe::smooth(&profile));
        let at = |y: f64| {
            let ray = Ray { origin: DVec3::new(0.0, y, -3.0), direction: DVec3::Z };
            vase.cross(ray, 0.0, 10.0).unwrap()
        };
        for [y, r] in [[1e-6, 0.3], [0.4, 0.8], [0.9, 0.35], [1.2 - 1e-6, 0.5]] {
            // The slope at the ends is about 4.
            assert_abs_diff_eq!(3.0 - at(y).t, r, epsilon = 1e-5);
        }
        for y in [0.1, 0.3, 0.6, 0.8, 1.0] {
            let slope = (at(y - 1e-5).t - at(y + 1e-5).t) / 2e-5;
            let normal = at(y).normal;
            assert_abs_diff_eq!(normal.y / -normal.z, -slope, epsilon = 1e-4);
        }
    }

    #[test]
    fn a_cylinder_has_lids_and_frames_turn() {
        let pencil = Shape::Lathe(Lathe::cones(&[[0.0, 0.1], [1.0, 0.1]]));
        let frame = Frame::along(DVec3::new(0.0, 0.0, 2.0), DVec3::new(0.0, 0.0, 3.0));
        let crossing = pencil.cross(frame.inward(FORWARD), 0.0, 10.0).unwrap();
        assert_abs_diff_eq!(crossing.t, 5.0, epsilon = 1e-12);
        assert_abs_diff_eq!(crossing.normal.y.abs(), 1.0, epsilon = 1e-12);
        let down = Ray { origin: DVec3::new(0.05, 4.0, 0.0), direction: DVec3::NEG_Y };
        assert_abs_diff_eq!(pencil.cross(down, 0.0, 10.0).unwrap().t, 3.0, epsilon = 1e-12);
    }
}
