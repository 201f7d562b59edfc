//! Rays through the 50 mm double Gauss: read "elements" as ray-surfaces, eleven surfaces and the film a ray.

use std::hint::black_box;

use criterion::{BatchSize, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use dioptric_optics::{Lens, MonoLens, ObjectPoint, RayBatch, Rims, glam::DVec2, rays_towards};

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

criterion_group!(benches, trace);
criterion_main!(benches);
