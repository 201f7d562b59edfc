//! Pictures the built-in still life: `cargo run -p dioptric-scene --example still_life -- OUT.png [COLUMNS] [WHITE_CD_M2]`.

use std::{path::Path, time::Instant};

use dioptric_scene::{StillLife, write_preview_png};
use dioptric_spectrum::{Illuminant, Observer, WavelengthGrid, Xyz};

#[expect(clippy::print_stdout, reason = "an example tells what it did")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let out = arguments.first().ok_or("give the path of the PNG to write")?;
    let columns: usize = arguments.get(1).map_or(Ok(960), |text| text.parse())?;
    let white_cd_m2: f64 = arguments.get(2).map_or(Ok(260.0), |text| text.parse())?;
    let grid = WavelengthGrid::uniform(400.0, 700.0, 10.0)?;
    let start = Instant::now();
    let scene = StillLife::new(columns, columns * 2 / 3).scene(&grid)?;
    println!("{columns} × {} × {} in {:.2} s", scene.rows(), grid.len(), start.elapsed().as_secs_f64());
    println!(
        "mean luminance {:.1} cd/m², depth {:?} m",
        scene.mean_luminance_cd_m2(),
        scene.require_depth()?.range_m()
    );
    // A white between the two lights of the room.
    let light = Illuminant::Daylight(5300.0).white_radiance(&grid, white_cd_m2 * std::f64::consts::PI);
    let white: Xyz = Observer::Cie1931.xyz(&grid, &light);
    write_preview_png(Path::new(out), &scene.radiance, white)?;
    Ok(())
}
