//! Shows a scene file as an sRGB PNG: `cargo run -p dioptric-scene --example preview -- SCENE OUT.png [WHITE_CD_M2]`.

use std::path::Path;

use dioptric_scene::{ReadOptions, read_scene, write_preview_png};
use dioptric_spectrum::{Illuminant, Observer};

#[expect(clippy::print_stdout, reason = "an example tells what it did")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [path, out] = arguments.get(..2).and_then(|a| a.first_chunk()).ok_or("give a scene and the PNG to write")?;
    let scene = read_scene(Path::new(path), &ReadOptions::default())?;
    let mean = scene.mean_luminance_cd_m2();
    let white_cd_m2: f64 = arguments.get(2).map_or(Ok(3.0 * mean), |text| text.parse())?;
    println!("{}: {} × {} × {}", scene.name, scene.columns(), scene.rows(), scene.radiance.grid().len());
    println!("mean luminance {mean:.1} cd/m², depth {:?} m", scene.depth.as_ref().map(|depth| depth.range_m()));
    println!("field of view {:?}°", scene.view.map(|view| view.horizontal_fov_deg(scene.columns())));
    let light = Illuminant::D65.white_radiance(scene.radiance.grid(), white_cd_m2 * std::f64::consts::PI);
    let white = Observer::Cie1931.xyz(scene.radiance.grid(), &light);
    write_preview_png(Path::new(out), &scene.radiance, white)?;
    Ok(())
}
