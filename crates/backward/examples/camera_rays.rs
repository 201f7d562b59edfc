//! Counts wavelength-paths per second of processor time from the film through a double Gauss into an empty world: what the
//! lens costs a rendering: `cargo run --release --example camera_rays [none | hurb]`.
#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a program for developers ends at the first thing amiss")]

use cpu_time::ProcessTime;
use dioptric_backward::{
    BandSampling, Bands, Camera, LensCamera, LensCameraSettings, LensOrigin, LightPaths, PixelGrid, Placement,
    RenderSettings, Renderer,
};
use dioptric_diffraction::Hurb;
use dioptric_optics::{Lens, glam::DVec2};
use dioptric_spectrum::{Cancel, WavelengthGrid};
use dioptric_world::WorldBuilder;

fn main() {
    let diffraction = (std::env::args().nth(1).as_deref() == Some("hurb")).then_some(Hurb::PAPER);
    let bands = Bands { grid: WavelengthGrid::uniform(400.0, 700.0, 10.0).unwrap(), sampling: BandSampling::default() };
    let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(5.0, 550.0).unwrap();
    let (columns, rows) = (240, 160);
    let settings = LensCameraSettings {
        film_distance_mm: lens.at(550.0).unwrap().film_distance_mm_for(2_000.0).unwrap(),
        film_size_mm: DVec2::new(24.0, 16.0),
        pixels: PixelGrid::new(columns, rows),
        placement: Placement::IDENTITY,
        origin: LensOrigin::EntrancePupil,
        diffraction,
        micro_array: None,
    };
    let began = ProcessTime::now();
    let camera = Camera::Lens(Box::new(LensCamera::new(&lens, &bands, settings).unwrap()));
    println!("camera: {:.2} s", began.elapsed().as_secs_f64());
    let world = WorldBuilder::new().build().unwrap();
    let (samples_per_pass, n_passes) = (8, 4);
    let settings = RenderSettings { bands, paths: LightPaths::Emission, samples_per_pass, seed: 1, clamp: None };
    let mut renderer = Renderer::new(&world, &camera, settings).unwrap();
    let began = ProcessTime::now();
    for _ in 0..n_passes {
        renderer.pass(&Cancel::new(), &|_| {}).unwrap();
    }
    let n_paths = columns * rows * n_passes * renderer.settings().samples_per_pass as usize * 8;
    println!("{:.2} million wavelength-paths a second", 1e-6 * n_paths as f64 / began.elapsed().as_secs_f64());
}
