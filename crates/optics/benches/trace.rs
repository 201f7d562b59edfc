//! Rays through the 50 mm double Gauss: read "elements" as ray-surfaces, eleven surfaces and the film a ray.

use std::hint::black_box;

use criterion::{BatchSize, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use dioptric_optics::{
    Glass, Interface, Lens, MonoLens, ObjectPoint, RayBatch, Rims, Shape, Surface, glam::DVec2, rays_towards,
};

/// Rays from an axial point at 2 m over a disc a little wider than the entrance pupil.
fn bundle(lens: &MonoLens, n_rays: usize) -> RayBatch {
    let first = lens.first_order();
    let point = ObjectPoint::from_field(lens, DVec2::new(0.1, 0.0), 0.5);
    let radius_mm = 0.55 * first.entrance_pupil_diameter_mm;
    // Vogel's spiral.
    let place = |i: usize| {
        let rho = radius_mm * ((i as f64 + 0.5) / n_rays as f64).sqrt();
        rho * DVec2::from_angle(2.399963229728653 * i as f64)
    };
    let targets: Vec<DVec2> = (0..n_rays).map(place).collect();
    rays_towards(&point, &targets, first.entrance_pupil_z_mm, 0.0)
}

/// Eight aspheres of six even powers each, as a phone's lens has.
fn aspheres() -> MonoLens {
    let coefficients = vec![1e-5, -1e-7, 1e-9, 1e-12, 1e-14];
    let interface = |i: usize| Interface {
        surface: Surface {
            shape: Shape::EvenAsphere { conic: -0.5, coefficients: coefficients.clone() },
            ..Surface::sphere(if i.is_multiple_of(3) { -40.0 } else { 30.0 }, 6.0)
        },
        medium_after: if i.is_multiple_of(2) { Glass::Constant { index: 1.53 } } else { Glass::Air },
        thickness_after_mm: 1.0,
    };
    let lens = Lens::new("aspheres", "made up", (0..8).map(interface).collect(), 0);
    lens.and_then(|lens| lens.at(550.0)).expect("the lens is well formed")
}

fn trace_aspheres(criterion: &mut Criterion) {
    let lens = aspheres();
    let rays = bundle(&lens, 10_000);
    let mut group = criterion.benchmark_group("trace/aspheres");
    group.throughput(Throughput::Elements((rays.len() * lens.n_surfaces()) as u64));
    group.bench_with_input(BenchmarkId::from_parameter(rays.len()), &rays, |bencher, rays| {
        bencher.iter_batched_ref(|| rays.clone(), |rays| lens.trace(rays, Rims::Clip), BatchSize::LargeInput);
    });
    group.finish();
}

fn trace(criterion: &mut Criterion) {
    let lens = Lens::built_in("dgauss-50mm").expect("the lens is built in").at(550.0).expect("the glass is known");
    let film_mm = lens.film_mm_for(2_000.0).expect("the lens focuses");
    for (name, parallel) in [("trace/one_core", false), ("trace/all_cores", true)] {
        let mut group = criterion.benchmark_group(name);
        for n_rays in [1_000, 100_000] {
            let rays = bundle(&lens, n_rays);
            group.throughput(Throughput::Elements((n_rays * (lens.n_surfaces() + 1)) as u64));
            group.bench_with_input(BenchmarkId::from_parameter(n_rays), &rays, |bencher, rays| {
                let run = |rays: &mut RayBatch| {
                    match parallel {
                        true => lens.trace_parallel(rays, Rims::Clip),
                        false => lens.trace(rays, Rims::Clip),
                    }
                    lens.to_film(rays, film_mm);
                    black_box(rays.x_mm[0])
                };
                bencher.iter_batched_ref(|| rays.clone(), run, BatchSize::LargeInput);
            });
        }
        group.finish();
    }
}

criterion_group!(benches, trace, trace_aspheres);
criterion_main!(benches);
