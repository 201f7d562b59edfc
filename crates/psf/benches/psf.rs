//! Describing a lens from its film, on one core.
#![expect(clippy::unwrap_used, reason = "a bench fails by panicking")]

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use dioptric_optics::{Lens, glam::DVec2};
use dioptric_psf::{Diffraction, FilmQuery, ImageSettings, LensImage, LensImageModel};

const HURB: Diffraction = Diffraction::Hurb { gamma: 1.0 };

fn dgauss(f_number: f64, diffraction: Diffraction) -> LensImageModel {
    let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(f_number, 550.0).unwrap();
    let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2000.0).unwrap();
    LensImageModel::new(&lens, &[550.0], &ImageSettings::new(film_distance_mm, diffraction)).unwrap()
}

/// Directions and irradiances of a film of 36 × 24 mm at one wavelength.
fn film_map(criterion: &mut Criterion) {
    let one_core = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    criterion.bench_function("film_map/dgauss_f4", |bencher| {
        bencher.iter(|| one_core.install(|| dgauss(4.0, Diffraction::None).film_map(550.0, 21.6)));
    });
}

/// One kernel on pixels of 5 µm from the mesh of 12 × 48: with its bundle traced, and from one that is kept.
fn kernel(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("kernel/dgauss_f4");
    for (name, diffraction) in [("geometric", Diffraction::None), ("hurb", HURB), ("wave", Diffraction::Wave)] {
        let model = dgauss(4.0, diffraction);
        model.film_map(550.0, 21.6);
        for dioptres in [0.495, 0.7] {
            let query = |place_mm| FilmQuery { place_mm, dioptres, wavelength_nm: 550.0, pitch_um: 5.0 };
            let mut n = 0;
            group.bench_function(BenchmarkId::new(format!("{name}/traced"), dioptres), |bencher| {
                bencher.iter(|| {
                    n += 1;
                    model.kernel(query(DVec2::new(6.0 + 1e-9 * f64::from(n), 4.0)))
                });
            });
            group.bench_function(BenchmarkId::new(format!("{name}/kept"), dioptres), |bencher| {
                bencher.iter(|| model.kernel(query(DVec2::new(6.0, 4.0))));
            });
        }
    }
}

criterion_group!(benches, film_map, kernel);
criterion_main!(benches);
