//! The speed of tracing: read "elements" as ray-surfaces, the film counted as one; in `trace/psf`, as pictures.
//!
//! Times are core-seconds, those that the thread itself ran, so that other work on the machine disturbs little; only
//! `trace/threads`, which compares one thread with all, goes by the clock and wants a quiet machine.

use std::{
    hint::black_box,
    path::Path,
    time::{Duration, Instant},
};

use cpu_time::ThreadTime;
use criterion::{
    BatchSize, BenchmarkGroup, Criterion, Throughput, criterion_group, criterion_main,
    measurement::{Measurement, ValueFormatter, WallTime},
};
use dioptric_optics::{
    Beam, Glass, Interface, Lens, MonoLens, ObjectPoint, RayBatch, RayBatchF32, Shape, Surface, Vignetting,
    glam::DVec2, rays_towards,
};
use multiversion::multiversion;
use rayon::prelude::*;

/// Time that this thread ran.
struct CoreTime;

impl Measurement for CoreTime {
    type Intermediate = ThreadTime;
    type Value = Duration;

    fn start(&self) -> ThreadTime {
        ThreadTime::now()
    }

    fn end(&self, start: ThreadTime) -> Duration {
        start.elapsed()
    }

    fn add(&self, a: &Duration, b: &Duration) -> Duration {
        *a + *b
    }

    fn zero(&self) -> Duration {
        Duration::ZERO
    }

    fn to_f64(&self, value: &Duration) -> f64 {
        WallTime.to_f64(value)
    }

    fn formatter(&self) -> &dyn ValueFormatter {
        WallTime.formatter()
    }
}

/// Rays of the 50 mm double Gauss.
const N_RAYS: usize = 100_000;

/// Targets over a disc in the entrance pupil plane, so many pupil radii wide: Vogel's spiral.
fn targets(lens: &MonoLens, n_rays: usize, reach: f64) -> Vec<DVec2> {
    let radius_mm = 0.5 * reach * lens.first_order().entrance_pupil_diameter_mm;
    let place = |i: usize| {
        let rho = radius_mm * ((i as f64 + 0.5) / n_rays as f64).sqrt();
        rho * DVec2::from_angle(2.399963229728653 * i as f64)
    };
    (0..n_rays).map(place).collect()
}

/// Rays from a point 2 m away over a disc a little wider than the entrance pupil: about a quarter meet a rim.
fn bundle(lens: &MonoLens, n_rays: usize) -> RayBatch {
    let point = ObjectPoint::from_field(lens, DVec2::new(0.1, 0.0), 0.5);
    rays_towards(&point, &targets(lens, n_rays, 1.1), lens.first_order().entrance_pupil_z_mm, 0.0)
}

fn double_gauss() -> (MonoLens, f64) {
    let lens = Lens::built_in("dgauss-50mm").expect("the lens is built in").at(550.0).expect("the glass is known");
    let film_distance_mm = lens.film_distance_mm_for(2_000.0).expect("the lens focuses");
    (lens, film_distance_mm)
}

/// Measures a trace of rays that each time start anew.
fn measure<M, B>(group: &mut BenchmarkGroup<'_, M>, name: &str, rays: &B, run: impl Fn(&mut B))
where
    M: Measurement,
    B: Clone,
{
    group.bench_function(name, |bencher| {
        bencher.iter_batched_ref(|| rays.clone(), |rays| run(rays), BatchSize::LargeInput);
    });
}

fn trace(criterion: &mut Criterion<CoreTime>) {
    let (lens, film_distance_mm) = double_gauss();
    let mut group = criterion.benchmark_group("trace/double_gauss");
    for n_rays in [1_000, N_RAYS] {
        let rays = bundle(&lens, n_rays);
        group.throughput(Throughput::Elements((n_rays * (lens.n_surfaces() + 1)) as u64));
        let named = |name: &str| format!("{name}/{n_rays}");
        measure(&mut group, &named("f64"), &rays, |rays| lens.trace_to_film(rays, Vignetting::On, film_distance_mm));
        measure(&mut group, &named("f32"), &RayBatchF32::from(&rays), |rays| {
            lens.trace_to_film_f32(rays, Vignetting::On, film_distance_mm);
        });
    }
    group.finish();
}

fn threads(criterion: &mut Criterion) {
    let (lens, film_distance_mm) = double_gauss();
    let rays = bundle(&lens, N_RAYS);
    let mut group = criterion.benchmark_group("trace/threads");
    group.throughput(Throughput::Elements((rays.len() * lens.n_surfaces()) as u64));
    measure_in_place(&mut group, "batch/one", &rays, |rays| lens.trace(rays, Vignetting::On));
    measure_in_place(&mut group, "batch/all", &rays, |rays| lens.trace_parallel(rays, Vignetting::On));

    // Ten batches that threads share among them, made as they are traced and nowhere kept.
    let targets_mm = targets(&lens, N_RAYS, 1.1);
    let place = |batch: usize| {
        let point = ObjectPoint::from_field(&lens, DVec2::new(0.01 * batch as f64, 0.0), 0.5);
        let beam = Beam { point, targets_mm: &targets_mm, z_mm: lens.first_order().entrance_pupil_z_mm };
        let mut sum = DVec2::ZERO;
        lens.trace_onto(&beam, Vignetting::On, film_distance_mm, |rays| {
            for i in (0..rays.len()).filter(|&i| rays.fate[i].is_in_flight()) {
                sum += DVec2::new(rays.x_mm[i], rays.y_mm[i]);
            }
        });
        sum
    };
    const N_BATCHES: usize = 10;
    group.throughput(Throughput::Elements((N_BATCHES * N_RAYS * (lens.n_surfaces() + 1)) as u64));
    group.bench_function("batches/one", |bencher| {
        bencher.iter(|| (0..N_BATCHES).map(place).collect::<Vec<_>>());
    });
    group.bench_function("batches/all", |bencher| {
        bencher.iter(|| (0..N_BATCHES).into_par_iter().with_max_len(1).map(place).collect::<Vec<_>>());
    });
    group.finish();
}

/// Measures a trace of rays that each time start anew, in the same memory: new memory comes from afar, and threads
/// share the way to it.
fn measure_in_place(
    group: &mut BenchmarkGroup<'_, WallTime>,
    name: &str,
    rays: &RayBatch,
    run: impl Fn(&mut RayBatch),
) {
    let mut traced = rays.clone();
    group.bench_function(name, |bencher| {
        bencher.iter_custom(|rounds| {
            let mut time = Duration::ZERO;
            for _ in 0..rounds {
                traced.clone_from(rays);
                let start = Instant::now();
                run(&mut traced);
                time += start.elapsed();
            }
            time
        });
    });
}

/// The least that a ray-surface costs: two square roots and a division, on numbers that do not wait for each other.
#[multiversion(targets("x86_64+avx2"))]
fn divider(rounds: usize, numbers: &mut [[f64; 8]; 3]) {
    let [roots, more_roots, quotients] = numbers;
    for _ in 0..rounds {
        for i in 0..8 {
            roots[i] = (roots[i] + 1.0).sqrt();
            more_roots[i] = (more_roots[i] + 2.0).sqrt();
            quotients[i] = 1.0 / (quotients[i] + 1.5);
        }
    }
}

/// All the arithmetic of a ray at a sphere and nothing else: no rims, no failures, no way in or out.
#[multiversion(targets("x86_64+avx2"))]
fn bare_spheres(rounds: usize, rays: &mut [[f64; 32]; 6]) {
    let (c, ratio, shift) = (0.02, 0.6, 1.0);
    for round in 0..rounds {
        // In and out of the glass, so that rays stay rays.
        let (c, ratio) = if round % 2 == 0 { (c, ratio) } else { (-c, 1.0 / ratio) };
        let [x, y, z, l, m, n] = rays;
        for i in 0..32 {
            let before = z[i] - shift;
            let f = c * (x[i] * x[i] + y[i] * y[i] + before * before) - 2.0 * before;
            let g = n[i] - c * (x[i] * l[i] + y[i] * m[i] + before * n[i]);
            let cos2 = g * g - c * f;
            let cos = cos2.sqrt();
            let t = f / (g + cos);
            let bend = (1.0 - ratio * ratio * (1.0 - cos2)).sqrt() - ratio * cos;
            x[i] += l[i] * t;
            y[i] += m[i] * t;
            z[i] = before + n[i] * t;
            l[i] = ratio * l[i] - bend * c * x[i];
            m[i] = ratio * m[i] - bend * c * y[i];
            n[i] = ratio * n[i] + bend * (1.0 - c * z[i]);
        }
    }
}

fn bounds(criterion: &mut Criterion<CoreTime>) {
    const ROUNDS: usize = 1000;
    let mut group = criterion.benchmark_group("trace/bound");
    group.throughput(Throughput::Elements((8 * ROUNDS) as u64));
    group.bench_function("divider_f64", |bencher| {
        let mut numbers = [[2.0; 8]; 3];
        bencher.iter(|| divider(black_box(ROUNDS), black_box(&mut numbers)));
    });
    group.throughput(Throughput::Elements((32 * ROUNDS) as u64));
    group.bench_function("arithmetic_f64", |bencher| {
        let start = |i: usize, spread: f64| 0.1 + spread * i as f64;
        let lanes = |spread: f64| std::array::from_fn(|i| start(i, spread));
        bencher.iter(|| {
            let mut rays = [lanes(0.05), lanes(0.02), [0.0; 32], [0.0; 32], [0.0; 32], [1.0; 32]];
            bare_spheres(black_box(ROUNDS), &mut rays);
            rays
        });
    });
    group.finish();
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

/// A phone's lens from the shared data beside the workspace, where that is there.
fn phone() -> Option<MonoLens> {
    let path = dioptric_golden::shared("data/lenses/deeplens_cellphone68deg.json")?;
    Some(Lens::read(Path::new(&path)).expect("the lens is read").at(550.0).expect("the glass is known"))
}

#[expect(clippy::print_stderr, reason = "a bench says what it skips")]
fn trace_aspheres(criterion: &mut Criterion<CoreTime>) {
    let mut group = criterion.benchmark_group("trace/aspheres");
    let lenses = [("made_up", Some(aspheres())), ("phone", phone())];
    if lenses[1].1.is_none() {
        eprintln!("trace/aspheres/phone: skipped, for the shared data are absent");
    }
    for (name, lens) in lenses.iter().filter_map(|(name, lens)| Some((name, lens.as_ref()?))) {
        let rays = bundle(lens, N_RAYS);
        group.throughput(Throughput::Elements((rays.len() * lens.n_surfaces()) as u64));
        measure(&mut group, &format!("{name}/f64"), &rays, |rays| lens.trace(rays, Vignetting::On));
    }
    group.finish();
}

/// Counted pictures: 10 fields by 31 wavelengths of 100,000 rays each on 64 × 64 pixels are 310 of these.
fn count(criterion: &mut Criterion<CoreTime>) {
    const SIDE: usize = 64;
    let (lens, film_distance_mm) = double_gauss();
    let point = ObjectPoint::from_field(&lens, DVec2::new(0.1, 0.0), 0.5);
    let targets_mm = targets(&lens, N_RAYS, 1.0);
    let beam = Beam { point, targets_mm: &targets_mm, z_mm: lens.first_order().entrance_pupil_z_mm };
    // The chief ray lands in the middle of pixels of 3 µm.
    let mut middle = DVec2::ZERO;
    lens.trace_onto(&Beam { targets_mm: &[DVec2::ZERO], ..beam }, Vignetting::On, film_distance_mm, |rays| {
        middle = rays.point_mm(0).truncate();
    });
    let pixel = |x_mm: f64, y_mm: f64| {
        let (column, row) = ((x_mm - middle.x) / 3e-3 + 32.0, (y_mm - middle.y) / 3e-3 + 32.0);
        let inside = 0.0..SIDE as f64;
        (inside.contains(&column) && inside.contains(&row)).then(|| row as usize * SIDE + column as usize)
    };
    let mut group = criterion.benchmark_group("trace/psf");
    group.throughput(Throughput::Elements(1));
    group.bench_function("f64", |bencher| {
        bencher.iter(|| {
            let mut counts = vec![0_u32; SIDE * SIDE];
            lens.trace_onto(&beam, Vignetting::On, film_distance_mm, |rays| {
                for i in (0..rays.len()).filter(|&i| rays.fate[i].is_in_flight()) {
                    if let Some(pixel) = pixel(rays.x_mm[i], rays.y_mm[i]) {
                        counts[pixel] += 1;
                    }
                }
            });
            assert!(counts.iter().sum::<u32>() > N_RAYS as u32 / 4, "the light falls on the film");
            counts
        });
    });
    group.bench_function("f32", |bencher| {
        bencher.iter(|| {
            let mut counts = vec![0_u32; SIDE * SIDE];
            lens.trace_onto_f32(&beam, Vignetting::On, film_distance_mm, |rays| {
                for i in (0..rays.len()).filter(|&i| rays.fate[i].is_in_flight()) {
                    if let Some(pixel) = pixel(rays.x_mm[i].into(), rays.y_mm[i].into()) {
                        counts[pixel] += 1;
                    }
                }
            });
            counts
        });
    });
    group.finish();
}

criterion_group! {
    name = core_time;
    config = Criterion::default().with_measurement(CoreTime);
    targets = trace, bounds, trace_aspheres, count
}
criterion_group!(by_the_clock, threads);
criterion_main!(core_time, by_the_clock);
