//! The stages of a sensor on a frame of 12 megapixels from 31 bands.

mod common;

use std::{hint::black_box, time::Duration};

use common::{COLUMNS, FourPlanes, ROWS};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use dioptric_sensor::{
    AutoExposure, Demosaic, Exposure, ExposureControl, Illumination, Metering, Noise, Processing, Sensor, demosaic,
};
use dioptric_spectrum::Illuminant;

fn stages(criterion: &mut Criterion) {
    let sensor = Sensor::built_in("imx363").expect("it is built in");
    let irradiance = FourPlanes::new();
    let light = Illumination::on_pixels(&irradiance);
    let noise = Noise::all(1);
    let control = ExposureControl::Auto(AutoExposure::new(Metering::Mean, 0.3));
    let processing = Processing::for_light(Illuminant::D65);
    let works = "the bench's own input is sound";

    let mut group = criterion.benchmark_group("sensor/12_megapixels");
    group.throughput(Throughput::Elements((ROWS * COLUMNS) as u64));
    group.sample_size(10).warm_up_time(Duration::from_millis(1)).measurement_time(Duration::from_secs(5));
    group.bench_function("irradiance_to_picture", |bencher| {
        bencher.iter(|| {
            let capture = sensor.capture(&light, &control, &noise).expect(works);
            black_box(sensor.develop(&capture.raw, &processing).expect(works))
        });
    });
    group.bench_function("electron_rate", |bencher| bencher.iter(|| sensor.electron_rate(&light).expect(works)));
    let rate = sensor.electron_rate(&light).expect(works);
    let exposure: Exposure = sensor.expose(&rate, &control).expect(works);
    group.bench_function("electrons", |bencher| {
        bencher.iter(|| sensor.electrons(&rate, &exposure, &noise).expect(works));
    });
    let electrons = sensor.electrons(&rate, &exposure, &noise).expect(works);
    group.bench_function("volts", |bencher| {
        bencher.iter(|| sensor.volts(&electrons, &exposure, &noise).expect(works));
    });
    let volts = sensor.volts(&electrons, &exposure, &noise).expect(works);
    group.bench_function("digitize", |bencher| bencher.iter(|| sensor.digitize(&volts, &exposure).expect(works)));
    let raw = sensor.digitize(&volts, &exposure).expect(works);
    group.bench_function("develop", |bencher| bencher.iter(|| sensor.develop(&raw, &processing).expect(works)));
    let (values, tile) = (raw.linear().remove(0), raw.tile.as_ref().expect("a mosaic"));
    for method in [Demosaic::Bilinear, Demosaic::Malvar, Demosaic::Directional] {
        group.bench_function(format!("demosaic/{method:?}"), |bencher| {
            bencher.iter(|| demosaic(&values, tile, 3, method).expect(works));
        });
    }
    group.finish();
}

criterion_group!(benches, stages);
criterion_main!(benches);
