//! Building a bank and drawing from it.
#![expect(clippy::unwrap_used, reason = "a bench fails by panicking")]

use criterion::{Criterion, criterion_group, criterion_main};
use dioptric_optics::{Lens, glam::DVec2};
use dioptric_psf::{BankSettings, Diffraction, PsfBank};

fn dgauss() -> Lens {
    Lens::built_in("dgauss-50mm").unwrap().with_f_number(4.0, 550.0).unwrap()
}

fn settings(diffraction: Diffraction) -> BankSettings {
    let film_mm = dgauss().at(550.0).unwrap().film_mm_for(2000.0).unwrap();
    BankSettings::covering(film_mm, 0.2, (0.1, 1.2), (420.0, 680.0), diffraction)
}

fn build(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("bank/build_9x9x4");
    group.sample_size(10);
    for (name, diffraction) in [("geometric", Diffraction::None), ("hurb", Diffraction::Hurb { gamma: 1.0 })] {
        group.bench_function(name, |bencher| {
            bencher.iter(|| PsfBank::build(&dgauss(), &settings(diffraction)).unwrap());
        });
    }
}

fn kernel(criterion: &mut Criterion) {
    for (name, diffraction) in [("geometric", Diffraction::None), ("hurb", Diffraction::Hurb { gamma: 1.0 })] {
        let bank = PsfBank::build(&dgauss(), &settings(diffraction)).unwrap();
        let mut group = criterion.benchmark_group(format!("kernel/{name}"));
        for (place, dioptres) in [("focus", 0.495), ("blur_60um", 0.35), ("blur_260um", 0.13)] {
            group.bench_function(place, |bencher| {
                bencher.iter(|| bank.kernel(DVec2::new(0.1, 0.05), dioptres, 433.0, 5.0));
            });
        }
    }
}

/// Wave-optical kernels of points in focus and near it, traced and summed anew each time.
fn waves(criterion: &mut Criterion) {
    let bank = PsfBank::build(&dgauss(), &settings(Diffraction::Wave)).unwrap();
    let mut group = criterion.benchmark_group("kernel/wave");
    for (place, dioptres) in [("focus", 0.495), ("blur_12um", 0.46)] {
        group.bench_function(place, |bencher| {
            bencher.iter(|| bank.kernel(DVec2::new(0.1, 0.05), dioptres, 550.0, 5.0));
        });
    }
}

criterion_group!(benches, build, kernel, waves);
criterion_main!(benches);
