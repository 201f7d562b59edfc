//! Building a tree over a mesh of a million triangles, and rays per second through it.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use dioptric_world::{
    Material, Ray, Shape, SpectralCurve, Texture, TriangleMesh, World, WorldBuilder,
    glam::{DAffine3, Vec3},
};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A bumpy sphere of 2 n² triangles, 1 m in radius.
fn bumpy_sphere(n: u32) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for row in 0..=n {
        for column in 0..=n {
            let polar = std::f32::consts::PI * row as f32 / n as f32;
            let azimuth = std::f32::consts::TAU * column as f32 / n as f32;
            let radius = 1.0 + 0.05 * (31.0 * azimuth).sin() * (23.0 * polar).cos();
            let flat = polar.sin();
            mesh.positions.push(radius * Vec3::new(flat * azimuth.cos(), flat * azimuth.sin(), polar.cos()));
        }
    }
    for row in 0..n {
        for column in 0..n {
            let a = row * (n + 1) + column;
            mesh.triangles.extend([[a, a + n + 1, a + n + 2], [a, a + n + 2, a + 1]]);
        }
    }
    mesh
}

fn world(mesh: TriangleMesh) -> World {
    let mut builder = WorldBuilder::new();
    let gray = builder.add_texture(Texture::Curve(SpectralCurve::constant(0.5)));
    let matte = builder.add_material("gray", Material::Matte { reflectance: gray });
    builder.add_shape(Shape::Mesh(mesh), DAffine3::IDENTITY, matte, None);
    builder.build().expect("the mesh is sound")
}

fn rays(n: usize, is_coherent: bool) -> Vec<Ray> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut unit = || (rng.next_u32() >> 8) as f32 / (1 << 24) as f32 * 2.0 - 1.0;
    let side = (n as f32).sqrt();
    (0..n)
        .map(|i| {
            if is_coherent {
                let (x, y) = (i as f32 % side / side - 0.5, i as f32 / side / side - 0.5);
                Ray { origin: Vec3::new(0.0, 0.0, -3.0), direction: Vec3::new(x, y, 1.5).normalize() }
            } else {
                let origin = 1.5 * Vec3::new(unit(), unit(), unit());
                let aim = 0.9 * Vec3::new(unit(), unit(), unit());
                Ray { origin, direction: (aim - origin).normalize_or(Vec3::Z) }
            }
        })
        .collect()
}

fn intersect(criterion: &mut Criterion) {
    let mesh = bumpy_sphere(707);
    let mut group = criterion.benchmark_group("world/million_triangles");
    group.sample_size(10);
    group.throughput(Throughput::Elements(mesh.triangles.len() as u64));
    group.bench_function("build", |bencher| bencher.iter(|| world(mesh.clone())));
    let world = world(mesh.clone());
    for (name, is_coherent) in [("coherent", true), ("incoherent", false)] {
        let rays = rays(65_536, is_coherent);
        group.throughput(Throughput::Elements(rays.len() as u64));
        group.bench_with_input(BenchmarkId::new("intersect", name), &rays, |bencher, rays| {
            bencher.iter(|| rays.iter().filter(|ray| world.intersect(ray, f32::INFINITY).is_some()).count());
        });
        group.bench_with_input(BenchmarkId::new("is_occluded", name), &rays, |bencher, rays| {
            bencher.iter(|| rays.iter().filter(|ray| world.is_occluded(ray, 10.0)).count());
        });
    }
    group.finish();
}

criterion_group!(benches, intersect);
criterion_main!(benches);
