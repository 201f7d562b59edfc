//! Shapes that glow.

use glam::{DVec3, Vec3};
use std::f32::consts::{FRAC_PI_2, TAU};

use crate::{
    Emission, Hit,
    light::visible_power,
    light_tree::LightBounds,
    mesh::triangle_area,
    placed::{PlacedKind, PlacedShape},
    sampling::{Distribution, Frame, cone, on_disc, on_triangle},
    shape::{Quadric, Shape},
};

/// A shape that glows, outside any instance.
#[derive(Clone, Debug)]
pub(crate) struct AreaLight {
    shape: u32,
    emission: Emission,
    /// Triangles by area; of one entry for other shapes.
    parts: Distribution,
}

impl AreaLight {
    /// Returns the light of a shape; `None` where it doesn't glow, has no extent, or stands in an instance.
    pub(crate) fn of(shape: &PlacedShape, index: u32) -> Option<Self> {
        let emission = shape.emission.as_ref().filter(|_| shape.group == 0)?.clone();
        let parts = match &shape.kind {
            PlacedKind::Mesh(mesh) if mesh.triangles.is_empty() => return None,
            PlacedKind::Mesh(mesh) => Distribution::new(
                &(0..mesh.triangles.len()).map(|t| triangle_area(mesh.corners(t))).collect::<Vec<_>>(),
            ),
            PlacedKind::Quadric(quadric) => Distribution::new(&[quadric.area_about()]),
        };
        Some(Self { shape: index, emission, parts })
    }

    pub(crate) fn emission(&self) -> &Emission {
        &self.emission
    }

    /// Its triangles, or 1.
    pub(crate) fn n_parts(&self) -> usize {
        self.parts.len()
    }

    /// The power, W, roughly.
    pub(crate) fn power(&self) -> f64 {
        self.power_of(self.parts.total())
    }

    fn power_of(&self, area: f64) -> f64 {
        let sides = if self.emission.is_two_sided { 2.0 } else { 1.0 };
        sides * std::f64::consts::PI * area * f64::from(visible_power(&self.emission.radiance))
    }

    /// Adds the bounds of each triangle, or of the whole where there are more than `most`; returns which.
    pub(crate) fn add_bounds(&self, shapes: &[PlacedShape], most: usize, bounds: &mut Vec<LightBounds>) -> bool {
        let placed = &shapes[self.shape as usize];
        let is_two_sided = self.emission.is_two_sided;
        // The power of a light that faces one way as if it shone all around as brightly.
        let flat = |low, high, normal: Vec3, area: f64| LightBounds {
            low,
            high,
            axis: if placed.is_reversed { -normal } else { normal },
            spread_rad: 0.0,
            reach_rad: FRAC_PI_2,
            is_two_sided,
            power: 4.0 * self.power_of(area) as f32 / if is_two_sided { 2.0 } else { 1.0 },
        };
        match &placed.kind {
            PlacedKind::Mesh(mesh) if self.parts.len() <= most => {
                bounds.extend((0..mesh.triangles.len()).map(|triangle| {
                    let corners = mesh.corners(triangle);
                    let [a, b, c] = corners;
                    flat(
                        a.min(b).min(c),
                        a.max(b).max(c),
                        mesh.outward_normal(triangle, corners),
                        triangle_area(corners),
                    )
                }));
                true
            }
            PlacedKind::Mesh(mesh) => {
                let corners = mesh.triangles.iter().flatten().map(|&vertex| mesh.positions[vertex as usize]);
                let (low, high) =
                    corners.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
                bounds.push(LightBounds::all_around(low, high, self.power() as f32));
                false
            }
            PlacedKind::Quadric(quadric) => {
                let (low, high) = quadric.bounds();
                let (low, high) = (low.as_vec3(), high.as_vec3());
                bounds.push(match quadric.shape() {
                    Shape::Disc { .. } => {
                        let normal = quadric.surface_at(quadric.place().translation).normal.as_vec3();
                        flat(low, high, normal, self.parts.total())
                    }
                    _ => LightBounds::all_around(low, high, self.power() as f32),
                });
                false
            }
        }
    }

    /// Its shape.
    pub(crate) fn shape(&self) -> u32 {
        self.shape
    }

    /// Returns direction, distance, density over solid angle and whether the outside is seen, and the triangle of a mesh; of
    /// one triangle, or of one that is drawn by area.
    pub(crate) fn sample(
        &self,
        shapes: &[PlacedShape],
        from: Vec3,
        triangle: Option<usize>,
        u_part: f32,
        u: [f32; 2],
    ) -> Option<(Vec3, f32, f32, bool, Option<u32>)> {
        let placed = &shapes[self.shape as usize];
        let (point, normal, area_pdf, triangle) = match &placed.kind {
            PlacedKind::Mesh(mesh) => {
                let area = triangle.map_or(self.parts.total(), |triangle| triangle_area(mesh.corners(triangle)));
                let triangle = triangle.unwrap_or_else(|| self.parts.pick(u_part).0);
                let corners = mesh.corners(triangle);
                let [a, b, c] = corners;
                let [b1, b2] = on_triangle(u);
                let normal = mesh.outward_normal(triangle, corners);
                ((1.0 - b1 - b2) * a + b1 * b + b2 * c, normal, (1.0 / area) as f32, Some(triangle as u32))
            }
            PlacedKind::Quadric(quadric) => match quadric.cone_to(from) {
                Some(sphere) => {
                    let (direction, distance_m, pdf, is_front) = sphere.sample(u, placed.is_reversed);
                    return Some((direction, distance_m, pdf, is_front, None));
                }
                None => {
                    let (point, normal, area_pdf) = quadric.sample_area(u);
                    (point, normal, area_pdf, None)
                }
            },
        };
        let normal = if placed.is_reversed { -normal } else { normal };
        let to = point - from;
        let distance_m = to.length();
        let direction = to / distance_m;
        let cosine = normal.dot(direction);
        let pdf = area_pdf * distance_m * distance_m / cosine.abs();
        (pdf.is_finite() && pdf > 0.0).then_some((direction, distance_m, pdf, cosine < 0.0, triangle))
    }

    /// The density with which `sample` draws the point of a hit, given the same choice of a triangle.
    pub(crate) fn pdf(&self, placed: &PlacedShape, from: Vec3, hit: &Hit, triangle: Option<usize>) -> f32 {
        let area_pdf = match &placed.kind {
            PlacedKind::Mesh(mesh) => {
                let area = triangle.map_or(self.parts.total(), |triangle| triangle_area(mesh.corners(triangle)));
                (1.0 / area) as f32
            }
            PlacedKind::Quadric(quadric) => match quadric.cone_to(from) {
                Some(sphere) => return sphere.pdf(),
                None => quadric.area_pdf(hit.point),
            },
        };
        let to = hit.point - from;
        let cosine = hit.geometric_normal.dot(to).abs() / to.length();
        if cosine > 0.0 { area_pdf * to.length_squared() / cosine } else { 0.0 }
    }
}

/// A sphere as seen from a point outside it.
pub(crate) struct SphereCone {
    to_center: Vec3,
    radius_m: f32,
    one_minus_cos: f32,
}

impl SphereCone {
    fn pdf(&self) -> f32 {
        1.0 / (TAU * self.one_minus_cos)
    }

    fn sample(&self, u: [f32; 2], is_reversed: bool) -> (Vec3, f32, f32, bool) {
        let distance = self.to_center.length();
        let axis = self.to_center / distance;
        let direction = Frame::about(axis).to_world(cone(u, self.one_minus_cos));
        // To the nearer crossing; a ray that grazes the rim is put at the tangent point.
        let along = direction.dot(self.to_center);
        let off_squared = (self.to_center - along * direction).length_squared();
        let half_chord = (self.radius_m * self.radius_m - off_squared).max(0.0).sqrt();
        (direction, along - half_chord, self.pdf(), !is_reversed)
    }
}

impl Quadric {
    /// Its area, m², to choose lights by; exact where it wasn't stretched.
    fn area_about(&self) -> f64 {
        let stretch = self.place().matrix3.determinant().abs().powf(2.0 / 3.0);
        self.own_area() * stretch
    }

    fn own_area(&self) -> f64 {
        use std::f64::consts::PI;
        match *self.shape() {
            Shape::Sphere { radius_m } => 4.0 * PI * radius_m * radius_m,
            Shape::Disc { radius_m, inner_radius_m } => PI * (radius_m * radius_m - inner_radius_m * inner_radius_m),
            Shape::Cylinder { radius_m, z_min_m, z_max_m } => 2.0 * PI * radius_m * (z_max_m - z_min_m),
            Shape::Lathe(ref lathe) => lathe.area(),
            Shape::Mesh(_) => 0.0,
        }
    }

    /// Returns the cone in which a sphere that is still round is seen from a point clearly outside it.
    fn cone_to(&self, from: Vec3) -> Option<SphereCone> {
        let Shape::Sphere { radius_m } = *self.shape() else { return None };
        let m = self.place().matrix3;
        let scale = m.x_axis.length();
        let is_round = [m.y_axis.length(), m.z_axis.length()].iter().all(|s| (s / scale - 1.0).abs() < 1e-9)
            && [m.x_axis.dot(m.y_axis), m.y_axis.dot(m.z_axis), m.z_axis.dot(m.x_axis)]
                .iter()
                .all(|d| d.abs() < 1e-9 * scale * scale);
        let to_center = self.place().translation - from.as_dvec3();
        let sin = radius_m * scale / to_center.length();
        if !is_round || sin.is_nan() || sin >= 0.9999 {
            return None;
        }
        // 1 − cos without cancellation for small cones.
        let one_minus_cos = sin * sin / (1.0 + (1.0 - sin * sin).sqrt());
        Some(SphereCone {
            to_center: to_center.as_vec3(),
            radius_m: (radius_m * scale) as f32,
            one_minus_cos: one_minus_cos as f32,
        })
    }

    /// Returns a point evenly spread over the surface before it was placed, its outward normal, and the density, 1/m².
    fn sample_area(&self, u: [f32; 2]) -> (Vec3, Vec3, f32) {
        let own = match *self.shape() {
            Shape::Sphere { radius_m } => radius_m * cone(u, 2.0).as_dvec3(),
            Shape::Disc { radius_m, inner_radius_m } => {
                let p = on_disc(u).as_dvec2();
                // Move the rings outwards so that the hole is left free and areas stay in proportion.
                let share = inner_radius_m / radius_m;
                let r = (share * share + p.length_squared() * (1.0 - share * share)).sqrt();
                (radius_m * r * p.normalize_or(glam::DVec2::X)).extend(0.0)
            }
            Shape::Cylinder { radius_m, z_min_m, z_max_m } => {
                let around = glam::DVec2::from_angle(f64::from(TAU * u[0]));
                (radius_m * around).extend(z_min_m + f64::from(u[1]) * (z_max_m - z_min_m))
            }
            Shape::Lathe(ref lathe) => lathe.sample(u),
            Shape::Mesh(_) => DVec3::ZERO,
        };
        let point = self.place().transform_point3(own);
        let at = self.surface_at(point);
        (at.point.as_vec3(), at.normal.as_vec3(), self.area_pdf(at.point.as_vec3()))
    }

    /// The density of `sample_area` at a point of the surface, 1/m².
    fn area_pdf(&self, point: Vec3) -> f32 {
        let own_density = match self.shape() {
            Shape::Lathe(lathe) => lathe.density_at(self.own_point(point.as_dvec3())),
            _ => 1.0 / self.own_area(),
        };
        (own_density / self.area_ratio_at(point.as_dvec3())) as f32
    }
}
