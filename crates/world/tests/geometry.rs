//! Rays against meshes, shapes and instances: what they meet, and that nothing slips through.

use dioptric_world::{
    Emission, Material, MaterialId, Ray, Shape, SpectralCurve, Texture, TriangleMesh, World, WorldBuilder,
    glam::{DAffine3, DVec3, Vec3},
};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn unit(rng: &mut ChaCha8Rng) -> f32 {
    (rng.next_u32() >> 8) as f32 / (1 << 24) as f32
}

fn direction(rng: &mut ChaCha8Rng) -> Vec3 {
    loop {
        let v = Vec3::new(unit(rng), unit(rng), unit(rng)) * 2.0 - 1.0;
        if (0.01..1.0).contains(&v.length_squared()) {
            return v.normalize();
        }
    }
}

fn with_matte() -> (WorldBuilder, MaterialId) {
    let mut builder = WorldBuilder::new();
    let gray = builder.add_texture(Texture::Curve(SpectralCurve::constant(0.5)));
    let matte = builder.add_material("gray", Material::Matte { reflectance: gray });
    (builder, matte)
}

/// A sphere of triangles about the origin, closed, its poles shared by many.
fn globe(radius_m: f32, n: u32) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for row in 0..=n {
        for column in 0..2 * n {
            let polar = std::f32::consts::PI * row as f32 / n as f32;
            let azimuth = std::f32::consts::PI * column as f32 / n as f32;
            let at = Vec3::new(polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos());
            // Every vertex of a pole is the same point, to the bit.
            let at = if row == 0 || row == n { Vec3::Z * polar.cos().signum() } else { at };
            mesh.positions.push(radius_m * at);
        }
    }
    for row in 0..n {
        for column in 0..2 * n {
            let next = (column + 1) % (2 * n);
            let [a, b] = [row * 2 * n + column, row * 2 * n + next];
            let [c, d] = [a + 2 * n, b + 2 * n];
            mesh.triangles.extend([[a, c, d], [a, d, b]]);
        }
    }
    mesh
}

fn world_of(mesh: TriangleMesh, place: DAffine3) -> World {
    let (mut builder, matte) = with_matte();
    builder.add_shape(Shape::Mesh(mesh), place, matte, None);
    builder.build().expect("a world of one mesh")
}

#[test]
fn tree_finds_the_nearest_triangle() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut mesh = TriangleMesh::default();
    for i in 0..3000 {
        let center = 4.0 * direction(&mut rng) * unit(&mut rng);
        mesh.positions.extend((0..3).map(|_| center + 0.2 * direction(&mut rng)));
        mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    let world = world_of(mesh.clone(), DAffine3::IDENTITY);
    let singles: Vec<World> = (0..3000)
        .step_by(7)
        .map(|i| {
            let corners = mesh.corners(i);
            let one = TriangleMesh { positions: corners.to_vec(), triangles: vec![[0, 1, 2]], ..Default::default() };
            world_of(one, DAffine3::IDENTITY)
        })
        .collect();
    let mut n_hits = 0;
    for _ in 0..2000 {
        let origin = 5.0 * direction(&mut rng);
        let aim = 3.0 * unit(&mut rng) * direction(&mut rng) - origin;
        let ray = Ray { origin, direction: aim.normalize() };
        let hit = world.intersect(&ray, f32::INFINITY);
        let length = hit.map_or(100.0, |hit| hit.distance_m);
        n_hits += usize::from(hit.is_some());
        for single in &singles {
            let alone = single.intersect(&ray, f32::INFINITY);
            assert!(alone.is_none_or(|alone| alone.distance_m >= length));
        }
        assert_eq!(world.is_occluded(&ray, 100.0), hit.is_some());
        assert!(!world.is_occluded(&ray, length));
    }
    assert!(n_hits > 300, "{n_hits}");
}

#[test]
fn no_ray_escapes_a_closed_mesh() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let mesh = globe(1.0, 40);
    // Far from the origin, as in a scene in millimetres, roundings are larger.
    for offset in [DVec3::ZERO, DVec3::new(37.0, -260.0, 113.0)] {
        let world = world_of(mesh.clone(), DAffine3::from_translation(offset));
        let offset = offset.as_vec3();
        for index in 0..20_000 {
            let origin = offset + 0.8 * unit(&mut rng) * direction(&mut rng);
            // At a vertex, at the middle of an edge, or anywhere.
            let [a, b, _] = mesh.corners(index % mesh.triangles.len());
            let aim = match index % 3 {
                0 => a + offset - origin,
                1 => 0.5 * (a + b) + offset - origin,
                _ => direction(&mut rng),
            };
            let ray = Ray { origin, direction: aim.normalize() };
            assert!(world.intersect(&ray, f32::INFINITY).is_some(), "{ray:?}");
        }
    }
}

#[test]
fn leaving_rays_meet_no_surface_again() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let place = |scale: f64, at: DVec3| {
        DAffine3::from_translation(at) * DAffine3::from_rotation_y(0.4) * DAffine3::from_scale(DVec3::splat(scale))
    };
    for (scale, at) in [(1.0, DVec3::ZERO), (0.01, DVec3::new(3.0, -2.0, 8.0)), (300.0, DVec3::new(1e3, 0.0, 0.0))] {
        for shape in [Shape::Mesh(globe(1.0, 20)), Shape::Sphere { radius_m: 1.0 }] {
            for is_instance in [false, true] {
                let (mut builder, matte) = with_matte();
                if is_instance {
                    let group = builder.add_group();
                    builder.add_shape_to(group, shape.clone(), DAffine3::IDENTITY, matte, None);
                    builder.add_instance(group, place(scale, at));
                } else {
                    builder.add_shape(shape.clone(), place(scale, at), matte, None);
                }
                let world = builder.build().unwrap();
                for _ in 0..5000 {
                    let from = at.as_vec3() + 3.0 * scale as f32 * direction(&mut rng);
                    let to = at.as_vec3() + 0.5 * scale as f32 * direction(&mut rng);
                    let ray = Ray { origin: from, direction: (to - from).normalize() };
                    let hit = world.intersect(&ray, f32::INFINITY).expect("the ray is aimed at the ball");
                    assert!(hit.geometric_normal.dot(ray.direction) < 0.0);
                    assert_eq!(hit.instance.is_some(), is_instance);
                    // A convex body is left for good.
                    let out = direction(&mut rng);
                    let out = if out.dot(hit.geometric_normal) < 0.0 { -out } else { out };
                    let again = world.intersect(&hit.ray_towards(out), f32::INFINITY);
                    assert!(again.is_none(), "{hit:?} left towards {out}: {again:?}");
                    // And going in, the far side is met, not the near one.
                    let far = world.intersect(&hit.ray_towards(ray.direction), f32::INFINITY).expect("it is closed");
                    assert!(far.distance_m > 1e-3 * scale as f32, "{far:?}");
                }
            }
        }
    }
}

#[test]
fn instance_is_a_moved_copy() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let place = DAffine3::from_translation(DVec3::new(0.3, -0.2, 4.0))
        * DAffine3::from_rotation_x(0.7)
        * DAffine3::from_scale(DVec3::new(1.0, -2.0, 0.5));
    for shape in [Shape::Mesh(globe(1.0, 12)), Shape::Sphere { radius_m: 1.0 }] {
        let (mut builder, matte) = with_matte();
        builder.add_shape(shape.clone(), place, matte, None);
        let copy = builder.build().unwrap();
        let (mut builder, matte) = with_matte();
        let group = builder.add_group();
        builder.add_shape_to(group, shape, DAffine3::IDENTITY, matte, None);
        builder.add_instance(group, place);
        let instanced = builder.build().unwrap();
        for _ in 0..3000 {
            let aim = Vec3::new(0.3, -0.2, 4.0) + 1.5 * direction(&mut rng);
            let ray = Ray { origin: Vec3::ZERO, direction: aim.normalize() };
            let [a, b] = [&copy, &instanced].map(|world| world.intersect(&ray, f32::INFINITY));
            let (Some(a), Some(b)) = (a, b) else {
                assert_eq!(a.is_some(), b.is_some());
                continue;
            };
            assert!(a.point.abs_diff_eq(b.point, 1e-5), "{a:?} {b:?}");
            assert!(a.geometric_normal.abs_diff_eq(b.geometric_normal, 1e-4), "{a:?} {b:?}");
            assert!((a.distance_m - b.distance_m).abs() < 1e-5);
        }
    }
}

#[test]
fn many_equal_triangles_are_built() {
    let one = TriangleMesh::quad(Vec3::Z, Vec3::X, Vec3::Y);
    let mut mesh = TriangleMesh { triangles: Vec::new(), ..one };
    mesh.triangles.extend(std::iter::repeat_n([0, 1, 2], 50_000));
    let world = world_of(mesh, DAffine3::IDENTITY);
    let ray = Ray { origin: Vec3::new(0.5, 0.2, 0.0), direction: Vec3::Z };
    assert_eq!(world.intersect(&ray, 9.0).unwrap().distance_m, 1.0);
}

#[test]
fn empty_world_is_empty() {
    let world = WorldBuilder::new().build().unwrap();
    let ray = Ray { origin: Vec3::ZERO, direction: Vec3::Z };
    assert!(world.intersect(&ray, f32::INFINITY).is_none() && !world.is_occluded(&ray, 1.0));
    assert!(world.bounds().is_none());
    assert_eq!(world.sky(Vec3::Z, &[550.0]), [0.0]);
    assert!(world.sample_light(Vec3::ZERO, 0.5, [0.5; 2], &[550.0]).is_none());
}

#[test]
fn dangling_parts_are_refused() {
    let (mut builder, _) = with_matte();
    builder.add_shape(Shape::Sphere { radius_m: 1.0 }, DAffine3::IDENTITY, MaterialId(7), None);
    assert_eq!(builder.build().unwrap_err().to_string(), "a shape names material 7, of which there are 1");
    let (mut builder, matte) = with_matte();
    builder.add_shape(Shape::Sphere { radius_m: 1.0 }, DAffine3::from_scale(DVec3::X), matte, None);
    assert!(builder.build().unwrap_err().to_string().contains("flatten"));
    let (mut builder, matte) = with_matte();
    builder.add_shape(Shape::Sphere { radius_m: f64::NAN }, DAffine3::IDENTITY, matte, None);
    assert!(builder.build().unwrap_err().to_string().contains("NaN"));
}

/// The irradiance from any glowing shape, by sampling it, is that found by casting rays about at random.
#[test]
fn sampled_lights_equal_cast_rays() {
    let place = DAffine3::from_translation(DVec3::new(0.4, 0.3, 1.5)) * DAffine3::from_rotation_x(2.5);
    let stretched = place * DAffine3::from_scale(DVec3::new(1.4, 0.8, 1.0));
    let shapes = [
        (Shape::Sphere { radius_m: 0.8 }, place),
        (Shape::Sphere { radius_m: 0.8 }, stretched),
        (Shape::Disc { radius_m: 1.0, inner_radius_m: 0.4 }, stretched),
        (Shape::Cylinder { radius_m: 0.5, z_min_m: -0.5, z_max_m: 0.4 }, stretched),
        (Shape::Mesh(globe(0.8, 6)), stretched),
    ];
    for (shape, place) in shapes {
        for is_two_sided in [false, true] {
            let (mut builder, matte) = with_matte();
            let emission = Emission { radiance: SpectralCurve::constant(3.0), is_two_sided };
            builder.add_shape(shape.clone(), place, matte, Some(emission));
            let world = builder.build().unwrap();
            let mut rng = ChaCha8Rng::seed_from_u64(5);
            let n = 60_000;
            let (mut n_missed, mut n_beside_edge, mut n_seen, mut pdf_squared) = (0, 0, 0, 0.0);
            let (mut by_rays, mut by_light, mut pdf_of_light, mut light_squared) = (0.0, 0.0, 0.0, 0.0);
            for _ in 0..n {
                let out = direction(&mut rng);
                let ray = Ray { origin: Vec3::ZERO, direction: out };
                if let Some(hit) = world.intersect(&ray, f32::INFINITY) {
                    let [radiance] = world.emission(&hit, -out, &[550.0]);
                    by_rays += f64::from(radiance * out.z.max(0.0)) * 4.0 * std::f64::consts::PI / f64::from(n);
                    let value = f64::from(world.light_pdf(Vec3::ZERO, &hit)) * 4.0 * std::f64::consts::PI;
                    pdf_of_light += value / f64::from(n);
                    pdf_squared += value * value / f64::from(n);
                }
                let drawn = world.sample_light(Vec3::ZERO, unit(&mut rng), [unit(&mut rng), unit(&mut rng)], &[550.0]);
                let Some(light) = drawn else { continue };
                if !world.is_occluded(&ray_to(light.direction), light.distance_m) {
                    n_seen += 1;
                    let value = f64::from(light.radiance[0] * light.direction.z.max(0.0) / light.pdf);
                    by_light += value / f64::from(n);
                    light_squared += value * value / f64::from(n);
                    // A ray to the very rim can miss it by a rounding.
                    let Some(hit) = world.intersect(&ray_to(light.direction), f32::INFINITY) else {
                        n_missed += 1;
                        continue;
                    };
                    let ratio = world.light_pdf(Vec3::ZERO, &hit) / light.pdf;
                    // A grazing point's cosine is as exact as the point itself; a ray to a point within a rounding of an edge
                    // between facets can meet the other one, whose cosine differs.
                    if (ratio - 1.0).abs() >= 0.02 && light.pdf <= 50.0 {
                        assert!(matches!(shape, Shape::Mesh(_)), "{shape:?}: {ratio} at {light:?}");
                        n_beside_edge += 1;
                    }
                }
            }
            let sigma = ((light_squared - by_light * by_light) / f64::from(n)).sqrt();
            // Casting 60 000 rays over the sphere has an error of about 1.5 % for lights of this size.
            assert!((by_light - by_rays).abs() < 0.05 * by_rays + 4.0 * sigma, "{shape:?}: {by_light} {by_rays}");
            println!("{n_missed} missed, {n_beside_edge} beside an edge, of {n}");
            assert!(n_missed < n / 1000 && n_beside_edge < n / 10_000, "{shape:?}: {n_missed} {n_beside_edge}");
            // ∫ pdf dω over what is seen is the share of samples that are seen; those of sides that don't glow are no
            // samples, so this holds where both do.
            if is_two_sided {
                let share = f64::from(n_seen) / f64::from(n);
                let variance = pdf_squared - pdf_of_light * pdf_of_light + share * (1.0 - share);
                let sigma = (variance / f64::from(n)).sqrt();
                assert!((pdf_of_light - share).abs() < 4.0 * sigma, "{shape:?}: {pdf_of_light} {share} ± {sigma}");
                // A round sphere is sampled by its cone, all of which is seen; a stretched one evenly over the sphere
                // it was, whose cap (1 − r/d)/2 is seen.
                if let Shape::Sphere { radius_m } = shape {
                    let distance_m = place.inverse().translation.length();
                    let is_round = (place.matrix3.x_axis.length() - 1.0).abs() < 1e-9;
                    let closed = if is_round { 1.0 } else { 0.5 * (1.0 - radius_m / distance_m) };
                    // A ray to the very rim can miss by a rounding.
                    let sigma = (closed * (1.0 - closed) / f64::from(n)).sqrt();
                    assert!((share - closed).abs() < 4.0 * sigma + 1e-3, "{shape:?}: {share} {closed}");
                }
            }
        }
    }
}

fn ray_to(direction: Vec3) -> Ray {
    Ray { origin: Vec3::ZERO, direction }
}
