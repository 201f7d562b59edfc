//! A quarter of a megapixel of a scene by formula, four bands, through the double Gauss at f/4.

#[path = "../examples/photograph/by_formula.rs"]
mod by_formula;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use dioptric_forward::{BlurMode, Film, Settings, irradiance};
use dioptric_optics::Lens;
use dioptric_psf::{Diffraction, ImageSettings, LensImageModel};
use dioptric_spectrum::WavelengthGrid;

fn scene_through_the_double_gauss(criterion: &mut Criterion) {
    let film = Film::centered(480, 576, 12.0);
    let grid = WavelengthGrid::uniform(460.0, 640.0, 60.0).expect("four bands");
    let scene = by_formula::scene(film.rows, film.columns, &grid).expect("its depths are positive");
    let lens = Lens::built_in("dgauss-50mm").and_then(|lens| lens.with_f_number(4.0, 550.0)).expect("it is built in");
    let film_distance_mm =
        lens.at(550.0).and_then(|mono| mono.film_distance_mm_for(1000.0)).expect("1 m can be in focus");
    let settings = ImageSettings::new(film_distance_mm, Diffraction::Hurb { gamma: 1.0 });
    let bank = LensImageModel::new(&lens, grid.centers_nm(), &settings).expect("the lens passes light");

    let mut group = criterion.benchmark_group("irradiance/dgauss_f4");
    group.sample_size(10);
    group.throughput(Throughput::Elements((film.rows * film.columns * grid.len()) as u64));
    for (name, mode) in [("layered", BlurMode::Layered), ("pointwise", BlurMode::Pointwise)] {
        let settings = Settings { mode, ..Settings::default() };
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                let mut sum = 0.0;
                irradiance(&scene, &bank, &film, &settings, &|_| {}, &mut |_, band| {
                    sum += band[(0, 0)];
                    Ok(())
                })
                .expect("the bank covers the scene");
                sum
            });
        });
    }
    group.finish();
}

criterion_group!(benches, scene_through_the_double_gauss);
criterion_main!(benches);
