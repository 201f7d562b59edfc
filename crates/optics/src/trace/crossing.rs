//! Where one ray crosses a surface, and what becomes of it there.
//!
//! These few lines are the whole geometry. The kernel runs them lane by lane, as vectors; the scalar twin one by one.

use super::real::Real;

/// A ray: its point from the vertex at hand, its direction and its path so far.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ray<T> {
    pub(crate) x: T,
    pub(crate) y: T,
    pub(crate) z: T,
    pub(crate) l: T,
    pub(crate) m: T,
    pub(crate) n: T,
    pub(crate) opl: T,
}

impl<T: Real> Ray<T> {
    pub(super) fn to_f64(self) -> Ray<f64> {
        let Self { x, y, z, l, m, n, opl } = self;
        let [x, y, z, l, m, n, opl] = [x, y, z, l, m, n, opl].map(T::to_f64);
        Ray { x, y, z, l, m, n, opl }
    }
}

/// A ray's crossing of a surface. Where there is none, the distance is not finite.
#[derive(Clone, Copy)]
pub(super) struct Crossing<T> {
    /// Distance along the ray.
    pub(super) t: T,
    /// Unit normal there, pointing downstream.
    pub(super) normal: [T; 3],
    /// Cosine of the angle of incidence, and its square.
    pub(super) cos: T,
    pub(super) cos2: T,
    /// Whether the crossing lies on the sheet of the vertex.
    pub(super) is_front: bool,
}

/// What a surface does to rays, whatever its shape.
#[derive(Clone, Copy, Debug)]
pub(super) struct Interface<T> {
    /// The index before over the index after, and its square.
    pub(super) ratio: T,
    pub(super) ratio2: T,
    pub(super) index_before: T,
    /// Square of the rim's radius.
    pub(super) limit_mm2: T,
}

/// What becomes of a ray at a surface.
#[derive(Clone, Copy)]
pub(super) struct Interaction<T> {
    /// The ray on the surface, turned.
    pub(super) ray: Ray<T>,
    /// Whether it goes on; if not, the rest has the reason.
    pub(super) survives: bool,
    /// Whether its crossing, if it has a finite one, is of the right sheet.
    pub(super) is_front: bool,
}

impl<T: Real> Interface<T> {
    /// Whether a point of the surface lies inside the rim. One that is not finite does not.
    #[inline(always)]
    pub(super) fn is_within(&self, x: T, y: T) -> bool {
        x * x + y * y <= self.limit_mm2
    }
}

/// Crosses a sphere where the ray goes through it downstream.
///
/// Written in curvature, so that it stays accurate as the sphere flattens to a plane; the cosine of incidence comes
/// with it, and the normal is already of unit length. Beyond the equator the sphere is no longer the surface.
#[inline(always)]
pub(super) fn cross_sphere<T: Real>(c: T, ray: &Ray<T>) -> Crossing<T> {
    let &Ray { x, y, z, l, m, n, .. } = ray;
    let f = c * (x * x + y * y + z * z) - T::TWO * z;
    let g = n - c * (x * l + y * m + z * n);
    let cos2 = g * g - c * f;
    let cos = cos2.sqrt();
    // Both quotients are the same number; each is free of cancellation on its side.
    let is_ahead = g >= T::ZERO;
    let numerator = if is_ahead { f } else { g - cos };
    let denominator = if is_ahead { g + cos } else { c };
    let t = numerator / denominator;
    let normal = [-c * (x + l * t), -c * (y + m * t), T::ONE - c * (z + n * t)];
    Crossing { t, normal, cos, cos2, is_front: normal[2] > T::ZERO }
}

/// A conic of revolution: its curvature, 1 + its conic constant, and what depends on them.
#[derive(Clone, Copy, Debug)]
pub(super) struct ConicForm<T> {
    pub(super) c: T,
    pub(super) conic: T,
    pub(super) k1: T,
    /// c (1 + conic), and c² (1 + conic).
    pub(super) ck1: T,
    pub(super) c2k1: T,
}

impl<T: Real> ConicForm<T> {
    pub(super) fn new(c: T, conic: T) -> Self {
        let k1 = T::ONE + conic;
        Self { c, conic, k1, ck1: c * k1, c2k1: k1 * c * c }
    }
}

/// Returns how far along a ray crosses a conic of revolution downstream, and the root that the distance takes.
#[inline(always)]
pub(super) fn conic_distance<T: Real>(form: &ConicForm<T>, ray: &Ray<T>) -> (T, T) {
    let &Ray { x, y, z, l, m, n, .. } = ray;
    let &ConicForm { c, conic, k1, .. } = form;
    let a = c * (T::ONE + conic * n * n);
    let f = c * (x * x + y * y + k1 * z * z) - T::TWO * z;
    let g = n - c * (x * l + y * m + k1 * z * n);
    let s = (g * g - a * f).sqrt();
    let is_ahead = g >= T::ZERO;
    let numerator = if is_ahead { f } else { g - s };
    let denominator = if is_ahead { g + s } else { a };
    (numerator / denominator, s)
}

/// Crosses a conic of revolution where the ray goes through it downstream.
#[inline(always)]
pub(super) fn cross_conic<T: Real>(form: &ConicForm<T>, ray: &Ray<T>) -> Crossing<T> {
    let &Ray { x, y, z, l, m, n, .. } = ray;
    let &ConicForm { c, ck1, .. } = form;
    let (t, s) = conic_distance(form, ray);
    let gradient = [-c * (x + l * t), -c * (y + m * t), T::ONE - ck1 * (z + n * t)];
    let square = gradient[0] * gradient[0] + gradient[1] * gradient[1] + gradient[2] * gradient[2];
    let inverse = T::ONE / square.sqrt();
    let cos = s * inverse;
    Crossing { t, normal: gradient.map(|v| v * inverse), cos, cos2: cos * cos, is_front: gradient[2] > T::ZERO }
}

/// Moves a ray to its crossing and refracts it there.
#[inline(always)]
pub(super) fn refract<T: Real>(interface: &Interface<T>, ray: &Ray<T>, crossing: &Crossing<T>) -> Interaction<T> {
    let &Crossing { t, normal, cos, cos2, is_front } = crossing;
    let &Interface { ratio, ratio2, index_before, .. } = interface;
    let (x, y, z) = (ray.x + ray.l * t, ray.y + ray.m * t, ray.z + ray.n * t);
    let after2 = T::ONE - ratio2 * (T::ONE - cos2);
    let bend = after2.sqrt() - ratio * cos;
    let refracted = Ray {
        x,
        y,
        z,
        l: ratio * ray.l + bend * normal[0],
        m: ratio * ray.m + bend * normal[1],
        n: ratio * ray.n + bend * normal[2],
        opl: longer(ray.opl, index_before, t),
    };
    let survives = interface.is_within(x, y) & is_front & (after2 >= T::ZERO);
    Interaction { ray: refracted, survives, is_front }
}

/// Moves a ray to the vertex plane, where nothing bends it.
#[inline(always)]
pub(super) fn cross_plane<T: Real>(interface: &Interface<T>, ray: &Ray<T>) -> Interaction<T> {
    let t = -ray.z / ray.n;
    let (x, y) = (ray.x + ray.l * t, ray.y + ray.m * t);
    let is_ahead = ray.n > T::ZERO;
    let moved = Ray { x, y, z: T::ZERO, opl: longer(ray.opl, interface.index_before, t), ..*ray };
    let survives = interface.is_within(x, y) & is_ahead;
    Interaction { ray: moved, survives, is_front: is_ahead }
}

/// A path that goes on by `t` in a medium.
#[inline(always)]
pub(super) fn longer<T: Real>(opl: T, index: T, t: T) -> T {
    if T::HAS_PATH { opl + index * t } else { opl }
}

/// An ideal lens: its media, its power in air, and the z of the object plane and of its image as it sees them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ideal<T> {
    pub(super) index_before: T,
    pub(super) index_after: T,
    pub(super) power: T,
    pub(super) object_z: T,
    pub(super) image_z: T,
}

/// Moves a ray to an ideal lens in the vertex plane, and turns it there.
#[inline(always)]
pub(super) fn thin_lens<T: Real>(lens: &Ideal<T>, interface: &Interface<T>, ray: &Ray<T>) -> Interaction<T> {
    let &Ideal { index_before: n1, index_after: n2, power, object_z, image_z } = lens;
    let passed = cross_plane(interface, ray);
    let Ray { x, y, l, m, n, opl, .. } = passed.ray;
    let (tx, ty) = (l / n, m / n);
    let (sx, sy) = ((n1 * tx - power * x) / n2, (n1 * ty - power * y) / n2);
    let n_after = T::ONE / (T::ONE + sx * sx + sy * sy).sqrt();
    let mut turned = Ray { l: sx * n_after, m: sy * n_after, n: n_after, ..passed.ray };
    if T::HAS_PATH {
        // The path from the object point, and on to its image, is made that of the ray through the center.
        let before = path_difference([x, y], [tx, ty], object_z);
        let after = path_difference([x, y], [sx, sy], image_z);
        turned.opl = opl + (n2 * after - n1 * before);
    }
    Interaction { ray: turned, ..passed }
}

/// Returns by how much the ray of these slopes through `height` has further to go from its point in the plane `z`
/// than the ray through the lens center has; the plane may be infinitely far.
#[inline(always)]
fn path_difference<T: Real>(height: [T; 2], slopes: [T; 2], z: T) -> T {
    let (ux, uy) = (slopes[0] + height[0] / z, slopes[1] + height[1] / z);
    let along = T::ONE + slopes[0] * slopes[0] + slopes[1] * slopes[1];
    let center = T::ONE + ux * ux + uy * uy;
    let sum = (slopes[0] + ux) * height[0] + (slopes[1] + uy) * height[1];
    sum / (along.sqrt() + center.sqrt())
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, DVec3};

    use crate::{Glass, Interface, Lens, ObjectPoint, RayBatch, Shape, Surface, Vignetting, rays_towards};

    const TARGETS: [DVec2; 4] = [DVec2::ZERO, DVec2::new(4.0, 0.0), DVec2::new(-2.0, 3.0), DVec2::new(0.0, -4.9)];

    #[test]
    fn thin_lens_images_every_point_to_a_point_by_equal_paths() {
        let lens = Lens::thin(50.0, 10.0).unwrap().at(550.0).unwrap();
        for dioptres in [0.0, 0.5, 4.0] {
            let field_tan = DVec2::new(0.3, -0.2);
            let point = ObjectPoint::from_field(&lens, field_tan, dioptres);
            let film_distance_mm = lens.film_distance_mm_for(1e3 / dioptres).unwrap();
            let mut rays = rays_towards(&point, &TARGETS, 0.0, 0.0);
            lens.trace(&mut rays, Vignetting::On);
            lens.to_film(&mut rays, film_distance_mm);
            for i in 0..rays.len() {
                let image = field_tan * -film_distance_mm;
                assert!((rays.point_mm(i).truncate() - image).length() < 1e-12, "{dioptres}: {}", rays.point_mm(i));
                assert!((rays.opl_mm[i] - rays.opl_mm[0]).abs() < 1e-12, "{dioptres}: {:?}", rays.opl_mm);
            }
        }
    }

    #[test]
    fn thin_lens_behind_another_sees_its_image() {
        let [first, second] = [80.0, -120.0].map(|focal_length_mm: f64| Interface {
            surface: Surface { shape: Shape::ThinLens { power_per_mm: 1.0 / focal_length_mm }, ..Surface::plane(20.0) },
            medium_after: Glass::Air,
            thickness_after_mm: 15.0,
        });
        let lens = Lens::new("pair", "test", vec![first, second], 0).unwrap().at(550.0).unwrap();
        let point = ObjectPoint::from_field(&lens, DVec2::new(0.1, 0.05), 1.0);
        let film_distance_mm = lens.film_distance_mm_for(1_000.0).unwrap();
        let mut rays = rays_towards(&point, &TARGETS, 0.0, 0.0);
        lens.trace(&mut rays, Vignetting::On);
        lens.to_film(&mut rays, film_distance_mm);
        for i in 1..rays.len() {
            assert!((rays.point_mm(i) - rays.point_mm(0)).length() < 1e-12);
            assert!((rays.opl_mm[i] - rays.opl_mm[0]).abs() < 1e-12);
        }
    }

    fn single(shape: Shape, radius_mm: f64, index: f64) -> Lens {
        let surface = Surface { shape, ..Surface::sphere(radius_mm, 8.0) };
        let medium_after = Glass::Constant { index };
        Lens::new("surface", "test", vec![Interface { surface, medium_after, thickness_after_mm: 0.0 }], 0).unwrap()
    }

    #[test]
    fn ellipsoid_images_a_far_point_perfectly() {
        // The Cartesian oval of a far axial point: conic constant −1/n², focus at n R/(n − 1).
        let (radius_mm, index) = (20.0, 1.5);
        let lens = single(Shape::Conic { conic: -1.0 / (index * index) }, radius_mm, index).at(550.0).unwrap();
        let focus_mm = index * radius_mm / (index - 1.0);
        let mut rays = rays_towards(&ObjectPoint::Infinite(DVec3::Z), &TARGETS, 0.0, 0.0);
        lens.trace(&mut rays, Vignetting::On);
        lens.to_film(&mut rays, focus_mm);
        for i in 0..rays.len() {
            assert!(rays.point_mm(i).truncate().length() < 1e-13, "{}", rays.point_mm(i));
            assert!((rays.opl_mm[i] - rays.opl_mm[0]).abs() < 1e-13);
        }
    }

    #[test]
    fn conic_and_asphere_of_no_asphericity_are_the_sphere() {
        let trace = |shape: Shape| {
            let lens = single(shape, 20.0, 1.6).at(550.0).unwrap();
            let point = ObjectPoint::from_field(&lens, DVec2::new(0.2, 0.1), 1.0);
            let mut rays = rays_towards(&point, &TARGETS, 0.0, 0.0);
            lens.trace(&mut rays, Vignetting::On);
            rays
        };
        let sphere = trace(Shape::Sphere);
        let others = [
            Shape::Conic { conic: 0.0 },
            Shape::EvenAsphere { conic: 0.0, coefficients: vec![0.0, 0.0] },
            Shape::OddAsphere { conic: 0.0, coefficients: vec![0.0, 0.0, 1e-300] },
        ]
        .map(trace);
        for (i, other) in others.iter().flat_map(|other| (0..4).map(move |i| (i, other))) {
            assert!((sphere.point_mm(i) - other.point_mm(i)).length() < 1e-14);
            assert!((sphere.direction(i) - other.direction(i)).length() < 1e-15);
        }
    }

    #[test]
    fn even_and_odd_powers_say_the_same_where_they_can() {
        let trace = |shape: Shape| {
            let lens = single(shape, 20.0, 1.6).at(550.0).unwrap();
            let point = ObjectPoint::from_field(&lens, DVec2::new(0.2, 0.1), 1.0);
            let mut rays = rays_towards(&point, &TARGETS, 0.0, 0.0);
            lens.trace(&mut rays, Vignetting::On);
            rays
        };
        let even = trace(Shape::EvenAsphere { conic: -0.4, coefficients: vec![2e-5, -3e-7] });
        // The last, no more than nothing, keeps the odd kernel in use.
        let odd = trace(Shape::OddAsphere { conic: -0.4, coefficients: vec![0.0, 0.0, 0.0, 2e-5, 0.0, -3e-7, 1e-300] });
        for i in 0..4 {
            assert!((even.point_mm(i) - odd.point_mm(i)).length() < 1e-14);
            assert!((even.direction(i) - odd.direction(i)).length() < 1e-15);
        }
    }

    #[test]
    fn paraboloid_may_be_written_as_a_square_term() {
        // r²/2R is a paraboloid of radius R, whichever way it is written.
        let plane =
            Surface { shape: Shape::OddAsphere { conic: 0.0, coefficients: vec![0.0, 0.025] }, ..Surface::plane(8.0) };
        let medium_after = Glass::Constant { index: 1.6 };
        let interface = Interface { surface: plane, medium_after, thickness_after_mm: 0.0 };
        let written = Lens::new("square term", "test", vec![interface], 0).unwrap().at(550.0).unwrap();
        let conic = single(Shape::Conic { conic: -1.0 }, 20.0, 1.6).at(550.0).unwrap();
        assert_eq!(written.first_order().efl_mm, conic.first_order().efl_mm);
        let trace = |lens: &crate::MonoLens| {
            let mut rays =
                rays_towards(&ObjectPoint::Infinite(DVec3::new(0.1, 0.0, 1.0).normalize()), &TARGETS, 0.0, 0.0);
            lens.trace(&mut rays, Vignetting::On);
            rays
        };
        let (a, b) = (trace(&written), trace(&conic));
        for i in 0..4 {
            assert!((a.point_mm(i) - b.point_mm(i)).length() < 1e-14);
            assert!((a.direction(i) - b.direction(i)).length() < 1e-15);
        }
    }

    #[test]
    fn light_goes_back_the_way_it_came() {
        let lens = Lens::built_in("dgauss-50mm").unwrap();
        // The same lens met from behind.
        let n = lens.interfaces().len();
        let reversed: Vec<Interface> = (0..n)
            .rev()
            .map(|i| {
                let surface = &lens.interfaces()[i].surface;
                let before = |i: usize| &lens.interfaces()[i - 1];
                Interface {
                    surface: Surface { curvature_per_mm: -surface.curvature_per_mm, ..surface.clone() },
                    medium_after: if i == 0 { Glass::Air } else { before(i).medium_after.clone() },
                    thickness_after_mm: if i == 0 { 0.0 } else { before(i).thickness_after_mm },
                }
            })
            .collect();
        let back = Lens::new("reversed", "test", reversed, n - 1 - lens.stop()).unwrap().at(550.0).unwrap();
        let lens = lens.at(550.0).unwrap();
        let point = ObjectPoint::from_field(&lens, DVec2::new(0.1, 0.2), 0.5);
        let start = rays_towards(&point, &TARGETS, lens.first_order().entrance_pupil_z_mm, 0.0);
        let mut rays = start.clone();
        lens.trace(&mut rays, Vignetting::On);
        lens.to_film(&mut rays, 30.0);
        let film_z_mm = lens.last_vertex_z_mm() + 30.0;
        let mut home = RayBatch::with_capacity(4);
        for i in 0..rays.len() {
            let (mut p, mut d) = (rays.point_mm(i), -rays.direction(i));
            (p.z, d.z) = (lens.last_vertex_z_mm() - p.z, -d.z);
            assert!((p.z - (lens.last_vertex_z_mm() - film_z_mm)).abs() < 1e-12);
            home.push(p, d, 0.0);
        }
        back.trace(&mut home, Vignetting::On);
        back.to_film(&mut home, 0.0);
        for i in 0..rays.len() {
            assert!((home.point_mm(i).truncate() - start.point_mm(i).truncate()).length() < 1e-12);
            assert!((home.opl_mm[i] - (rays.opl_mm[i] - start.opl_mm[i])).abs() < 1e-12);
        }
    }
}
