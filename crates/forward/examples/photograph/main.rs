//! Images a scene file with depth, or one made `by-formula`, through a built-in lens and draws the irradiance:
//! `photograph SCENE.exr OUT.png F_NUMBER FOCUS_M PITCH_UM ROWS COLUMNS [LENS] [layered|pointwise]`.

#![expect(clippy::print_stderr, reason = "an example says how long it took")]

mod by_formula;

use std::{path::Path, time::Instant};

use dioptric_forward::{BlurMode, Film, Settings, irradiance};
use dioptric_optics::Lens;
use dioptric_psf::{Diffraction, ImageSettings, LensImageModel};
use dioptric_scene::{ReadOptions, read_scene, write_preview_png};
use dioptric_spectrum::{Illuminant, Observer, Quantity, SpectralImage, WavelengthGrid, Xyz};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [scene, out, f_number, focus_m, pitch_um, rows, columns] = args.get(..7).and_then(|a| a.as_array()).ok_or(
        "usage: photograph SCENE.exr OUT.png F_NUMBER FOCUS_M PITCH_UM ROWS COLUMNS [LENS] [layered|pointwise]",
    )?;
    let lens =
        Lens::built_in(args.get(7).map_or("dgauss-50mm", |name| name))?.with_f_number(f_number.parse()?, 550.0)?;
    let film = Film::centered(rows.parse()?, columns.parse()?, pitch_um.parse()?);
    let scene = match scene.as_str() {
        "by-formula" => by_formula::scene(film.rows, film.columns, &WavelengthGrid::uniform(400.0, 700.0, 10.0)?)?,
        file => read_scene(Path::new(file), &ReadOptions::default())?,
    };
    let mode = if args.get(8).is_some_and(|m| m == "pointwise") { BlurMode::Pointwise } else { BlurMode::Layered };

    let mono = lens.at(550.0)?;
    let focus_mm = 1e3 * focus_m.parse::<f64>()? - mono.first_order().entrance_pupil_z_mm;
    let start = Instant::now();
    let settings = ImageSettings::new(mono.film_distance_mm_for(focus_mm)?, Diffraction::Hurb { gamma: 1.0 });
    let bank = LensImageModel::new(&lens, scene.radiance.grid().centers_nm(), &settings)?;
    let bank_s = start.elapsed().as_secs_f64();
    let mut planes = vec![];
    irradiance(&scene, &bank, &film, &Settings { mode, ..Settings::default() }, &|_| {}, &mut |_, plane| {
        planes.push(plane);
        Ok(())
    })?;
    let image = SpectralImage::new(Quantity::Irradiance, scene.radiance.grid().clone(), planes)?;
    let seconds = start.elapsed().as_secs_f64();
    let peak = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = peak.lines().find(|line| line.starts_with("VmHWM")).unwrap_or("peak memory unknown").to_owned();
    eprintln!("bank {bank_s:.2} s, irradiance {:.2} s, {peak}", seconds - bank_s);
    // White is what one pixel in a hundred outshines.
    let white = Observer::Cie1931.xyz(image.grid(), &Illuminant::D65.spectrum().sample_held(image.grid()));
    let mut luminance: Vec<f64> = (0..film.rows)
        .flat_map(|row| (0..film.columns).map(move |column| (row, column)))
        .map(|(r, c)| Observer::Cie1931.xyz(image.grid(), &image.spectrum_at(r, c)).luminance_cd_m2())
        .collect();
    luminance.sort_by(f64::total_cmp);
    let scale = luminance[luminance.len() * 99 / 100] / white.luminance_cd_m2();
    let white = Xyz(white.0.map(|v| v * scale));
    write_preview_png(Path::new(out), &image, white)?;
    Ok(())
}
