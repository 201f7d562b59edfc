//! Building a bank and drawing from it, on one core.
#![expect(clippy::unwrap_used, reason = "a bench fails by panicking")]

use std::time::Duration;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use dioptric_optics::{Lens, glam::DVec2};
use dioptric_psf::{BankSettings, Diffraction, FieldSampling, LensImageModel, PsfQuery};

fn dgauss(f_number: f64) -> Lens {
    Lens::built_in("dgauss-50mm").unwrap().with_f_number(f_number, 550.0).unwrap()
}

const HURB: Diffraction = Diffraction::Hurb { gamma: 1.0 };

/// 10 fields × 9 depths × 4 wavelengths from 400 to 700 nm, focused at 2 m.
fn settings(lens: &Lens, diffraction: Diffraction) -> BankSettings {
    let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(2000.0).unwrap();
    let settings = BankSettings::covering(film_distance_mm, 0.2, (0.1, 1.2), (400.0, 700.0), diffraction);
    BankSettings { fields: FieldSampling::Radial((0..10).map(|i| 0.2 * f64::from(i) / 9.0).collect()), ..settings }
}

/// The bar: ray maps with wave data of 10 fields × 9 depths over 400–700 nm in 0.5 s.
fn build(criterion: &mut Criterion) {
    let one_core = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let mut group = criterion.benchmark_group("bank/build_10x9x4");
    group.sample_size(10);
    let lens = dgauss(4.0);
    for (name, diffraction) in [("geometric", Diffraction::None), ("hurb", HURB), ("wave", Diffraction::Wave)] {
        group.bench_function(name, |bencher| {
            bencher.iter(|| one_core.install(|| LensImageModel::build(&lens, &settings(&lens, diffraction)).unwrap()));
        });
    }
}

/// One kernel of a size of its own on pixels of 5 µm, from the mesh of 12 × 48.
///
/// The bars: an interpolated geometric one in 0.3 ms, and one of a blurred point with uncertainty bending in 0.5 ms.
fn kernel(criterion: &mut Criterion) {
    let lens = dgauss(4.0);
    for (name, diffraction) in [("geometric", Diffraction::None), ("hurb", HURB)] {
        let bank = LensImageModel::build(&lens, &settings(&lens, diffraction)).unwrap();
        let mut group = criterion.benchmark_group(format!("kernel/{name}"));
        for (place, dioptres) in [("focus", 0.495), ("blur_60um", 0.35), ("blur_260um", 0.13)] {
            group.bench_function(place, |bencher| {
                bencher.iter(|| bank.kernel(PsfQuery::new(DVec2::new(0.1, 0.05), dioptres, 433.0, 5.0)));
            });
        }
    }
}

/// Wave-optical pictures of 64 × 64 pixels of 2 µm, from interpolated nodes.
fn waves(criterion: &mut Criterion) {
    for f_number in [4.0, 8.0] {
        let lens = dgauss(f_number);
        let bank = LensImageModel::build(&lens, &settings(&lens, Diffraction::Wave)).unwrap();
        let mut group = criterion.benchmark_group("picture/wave_64x64");
        for (place, dioptres) in [("focus", 0.495), ("near_focus", 0.46)] {
            let query = PsfQuery { field_tan: DVec2::new(0.1, 0.05), dioptres, wavelength_nm: 555.0, pitch_um: 2.0 };
            group.bench_function(BenchmarkId::new(format!("f{f_number}"), place), |bencher| {
                bencher.iter(|| bank.picture(query, 64));
            });
        }
    }
}

/// All 10 fields × 9 depths × 31 wavelengths of a bank with waves where they serve, 64 × 64 pixels of 2 µm each.
///
/// The bar: 6 s, at f/4 as at f/8.
fn all(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("bank/all_2790_pictures_64x64");
    group.sample_size(10).warm_up_time(Duration::from_millis(1));
    for f_number in [4.0, 8.0] {
        let lens = dgauss(f_number);
        let bank = LensImageModel::build(&lens, &settings(&lens, Diffraction::Wave)).unwrap();
        group.bench_function(format!("f{f_number}"), |bencher| {
            bencher.iter(|| {
                let mut sum = 0.0;
                for &field in bank.settings().fields.axes().0 {
                    for &dioptres in &bank.settings().dioptres {
                        for i in 0..31 {
                            let wavelength_nm = 400.0 + 10.0 * f64::from(i);
                            let field_tan = DVec2::X * field;
                            let query = PsfQuery { field_tan, dioptres, wavelength_nm, pitch_um: 2.0 };
                            sum += bank.picture(query, 64).expect("the field sees light").0[(32, 32)];
                        }
                    }
                }
                sum
            });
        });
    }
}

criterion_group!(benches, build, kernel, waves, all);
criterion_main!(benches);
