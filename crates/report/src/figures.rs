//! The figures as pictures and drawings.

use std::path::Path;

use dioptric_diffraction::Hurb;
use dioptric_psf::Profile;
use dioptric_spectrum::{Cancel, WavelengthGrid, srgb_decode};
use image::{Rgb, RgbImage, imageops};

use crate::{
    comparison_picture,
    mesh::Mesh,
    methods::side_by_side,
    png::{enlarged, png_bytes},
};
use dioptric_analysis::MethodComparison;
use dioptric_pipeline::{
    PipelineError, Silent,
    display::{LinearRgb, SpectrumToRgb},
    figures::{
        figure1::{self, Thumbnail},
        figure2::{self, Surface},
        figure3,
        figure4::{self, Panel},
    },
};

/// A file to be written: its name and what is in it.
#[derive(Clone, Debug)]
pub struct Drawing {
    /// File name.
    pub name: String,
    /// Contents.
    pub bytes: Vec<u8>,
}

impl Drawing {
    fn new(name: &str, bytes: impl Into<Vec<u8>>) -> Self {
        Self { name: name.to_owned(), bytes: bytes.into() }
    }
}

/// Returns Figures 1 to 4 at full quality: pictures, drawings, and the tables behind them.
///
/// `worlds` is the folder of the world of Figure 4, `metronome.pbrt`; `announce` is called with the name of each figure before it is made.
///
/// # Errors
/// When something cannot be computed or encoded; the built-in set-ups can.
pub fn draw_all(worlds: &Path, announce: &dyn Fn(&str)) -> Result<Vec<Drawing>, PipelineError> {
    announce("figure 1: point spread functions over field and depth");
    let thumbnails = figure1::thumbnails(401)?;
    let mut drawings = vec![
        Drawing::new("figure1.png", png_bytes(&mosaic(&thumbnails))?),
        Drawing::new("figure1.csv", figure1::table(&thumbnails)),
    ];
    announce("figure 2: line spread functions by ray bending and by theory");
    let nm: Vec<f64> = figure3::grid().centers_nm().to_vec();
    let counted = figure2::counted(&nm, 401)?;
    let theory = figure2::theory(&nm);
    drawings.push(Drawing::new("figure2.svg", meshes([&counted, &theory])));
    let calibrated = figure2::hurb("HURB calibrated, closed form", &nm, Hurb::CALIBRATED);
    let wave = figure2::wave(&nm)?;
    let all = [&counted, &calibrated, &wave, &theory];
    drawings.push(Drawing::new("figure2_all.svg", meshes(all)));
    let closed = figure2::hurb("HURB, closed form", &nm, Hurb::with_gamma(1.0));
    drawings.push(Drawing::new("figure2.csv", figure2::table(&[counted, closed, calibrated, wave, theory])));
    for (name, scale, blacks) in [
        ("figure3", figure3::PRINTED_BLUR_SCALE, None),
        ("figure3_lifted_blacks", figure3::PRINTED_BLUR_SCALE, Some(figure3::PRINTED_BLACKS)),
        ("figure3_true_scale", 1.0, None),
    ] {
        announce("figure 3: chromatic aberration at 8 m and 2 m");
        drawings.push(Drawing::new(&format!("{name}.png"), png_bytes(&panels(scale, blacks)?)?));
    }
    drawings.push(Drawing::new("figure3.csv", figure3::table()?));
    drawings.extend(draw_figure4(worlds, announce)?);
    Ok(drawings)
}

/// Returns Figure 4 alone, as [`draw_all`] does.
///
/// # Errors
/// When the world cannot be read or rendered.
pub fn draw_figure4(worlds: &Path, announce: &dyn Fn(&str)) -> Result<Vec<Drawing>, PipelineError> {
    announce("figure 4: a world by rays from the film");
    let camera = figure4::camera(&worlds.join("metronome.pbrt"), FIGURE_4_PX, FIGURE_4_SAMPLES)?;
    let world = figure4::panels(&camera, &Silent, &Cancel::new())?;
    announce("figure 4: the same by point spread functions, and the difference");
    let comparison = MethodComparison::of(&camera, &Silent, &Cancel::new())?;
    Ok(vec![
        Drawing::new("figure4.png", png_bytes(&row_of_panels(&world))?),
        Drawing::new("figure4.csv", figure4::table(&world)),
        Drawing::new("figure4_methods.png", png_bytes(&comparison_picture(&comparison))?),
        Drawing::new("figure4_methods.csv", comparison.table()),
    ])
}

/// Pixels of a panel of Figure 4 each way, and samples of each.
const FIGURE_4_PX: usize = 300;
const FIGURE_4_SAMPLES: u32 = 96;

/// Returns the panels of Figure 4 side by side, with their names.
fn row_of_panels(panels: &[Panel]) -> RgbImage {
    let pictures: Vec<(String, RgbImage)> = panels
        .iter()
        .map(|panel| {
            let (width, height) = (panel.picture.columns() as u32, panel.picture.rows() as u32);
            let picture = RgbImage::from_raw(width, height, panel.picture.to_rgb8());
            (panel.name.to_owned(), picture.expect("three codes a pixel"))
        })
        .collect();
    side_by_side(&pictures)
}

/// Returns the pictures of Figure 1 side by side: fields to the right, depths downwards, nearest on top.
fn mosaic(thumbnails: &[Thumbnail]) -> RgbImage {
    const FACTOR: u32 = 3;
    const GAP: u32 = 6;
    let side = figure1::FILM.n_pixels as u32 * FACTOR;
    let fields = figure1::HEIGHTS_AT_16_M_MM.len() as u32;
    let depths = figure1::DEPTHS_MM.len() as u32;
    let grid = WavelengthGrid::new(figure1::WAVELENGTHS_NM.to_vec()).expect("the wavelengths ascend");
    let to_rgb = SpectrumToRgb::with_white(&grid, &vec![1.0; grid.len()]);
    let mut sheet =
        RgbImage::from_pixel(fields * (side + GAP) + GAP, depths * (side + GAP) + GAP, Rgb([255, 255, 255]));
    for (i, thumbnail) in thumbnails.iter().enumerate() {
        let mut picture = LinearRgb::black(figure1::FILM.n_pixels, figure1::FILM.n_pixels);
        for (band, counts) in thumbnail.counts.iter().enumerate() {
            picture.add(&counts.mapv(|n| n as f32), to_rgb.of_band(band));
        }
        let tile = enlarged(&picture.to_srgb(picture.level_at(0.999).max(1e-9)), FACTOR);
        let (column, row) = (i as u32 % fields, i as u32 / fields);
        let (x, y) = (GAP + column * (side + GAP), GAP + row * (side + GAP));
        imageops::replace(&mut sheet, &tile, i64::from(x), i64::from(y));
    }
    sheet
}

/// Returns surfaces over place and wavelength, two side by side, as one SVG document; heights are over the last's peak, and all boxes end at the
/// highest of them.
fn meshes<const N: usize>(surfaces: [&Surface; N]) -> String {
    const WIDTH: f64 = 560.0;
    const HEIGHT: f64 = 470.0;
    let last = surfaces[N - 1];
    let peak = last.profiles.iter().flat_map(|p| &p.values).copied().fold(0.0, f64::max);
    let over_peak = |profile: &Profile| -> Vec<f64> { profile.values.iter().map(|v| v / peak).collect() };
    let heights = |surface: &&Surface| -> Vec<Vec<f64>> { surface.profiles.iter().map(over_peak).collect() };
    let heights: Vec<Vec<Vec<f64>>> = surfaces.iter().map(heights).collect();
    let highest = heights.iter().flatten().flatten().copied().fold(1.0, f64::max);
    let part = |(i, (surface, heights)): (usize, (&Surface, Vec<Vec<f64>>))| {
        let mesh = Mesh {
            title: surface.name,
            labels: ["place, µm", "wavelength, nm", "relative irradiance"],
            x: &surface.profiles[0].at_um,
            y: &surface.wavelengths_nm,
            highest,
            heights,
        };
        mesh.to_svg([(i % 2) as f64 * WIDTH, (i / 2) as f64 * HEIGHT, WIDTH, HEIGHT])
    };
    let (width, height) = (2.0 * WIDTH, N.div_ceil(2) as f64 * HEIGHT);
    let parts: String = surfaces.into_iter().zip(heights).enumerate().map(part).collect();
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\">\n{parts}</svg>\n"
    )
}

/// Returns the six pictures of Figure 3: targets to the right, 8 m above 2 m; `blacks` are the codes of the display's black in each.
fn panels(blur_scale: f64, blacks: Option<[[[u8; 3]; 3]; 2]>) -> Result<RgbImage, PipelineError> {
    const SIDE: u32 = 300;
    let mut sheet = RgbImage::new(3 * SIDE, 2 * SIDE);
    for (row, distance_mm) in figure3::DISTANCES_MM.into_iter().enumerate() {
        for (column, target) in figure3::targets().iter().enumerate() {
            let irradiance = figure3::irradiance(target, distance_mm, blur_scale)?;
            let rgb = LinearRgb::of_image(&irradiance).within_gamut();
            let black = blacks.map_or([0; 3], |blacks| blacks[row][column]);
            let black = black.map(|of| srgb_decode(f64::from(of) / 255.0));
            let picture = rgb.to_srgb_with_black(rgb.level_at(1.0), black);
            let tile = imageops::resize(&picture, SIDE, SIDE, imageops::FilterType::Triangle);
            imageops::replace(&mut sheet, &tile, i64::from(column as u32 * SIDE), i64::from(row as u32 * SIDE));
        }
    }
    Ok(sheet)
}
