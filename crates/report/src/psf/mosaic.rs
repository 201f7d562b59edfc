//! Point-spread functions in color, laid out over field and depth as in Figure 1.

use dioptric_optics::glam::DVec2;
use dioptric_psf::{LensImageModel, PointImage};
use dioptric_spectrum::WavelengthGrid;
use image::{Rgb, RgbImage, imageops};
use ndarray::Array2;
use rayon::prelude::*;

use crate::png::enlarged;
use dioptric_pipeline::{REFERENCE_WAVELENGTH_NM, display::LinearRgb, display::SpectrumToRgb};

/// Space between tiles, pixels, and its gray.
const GAP: u32 = 3;
const PAPER: Rgb<u8> = Rgb([36, 36, 40]);

/// Point-spread functions over field (across) and depth (down), each as an observer sees a white point.
#[derive(Clone, Debug)]
pub struct PsfMosaic {
    /// Field angles, degrees; a column each.
    pub fields_deg: Vec<f64>,
    /// Depths from the entrance pupil, m; a row each.
    pub depths_m: Vec<f64>,
    /// Side of the tiles of each row on the film, µm.
    pub tiles_um: Vec<f64>,
    /// Tiles row by row, each normalised to its brightest pixel.
    tiles: Vec<RgbImage>,
}

/// What a mosaic shows.
#[derive(Clone, Debug, PartialEq)]
pub struct MosaicPlan {
    /// Fields, tangents across and up.
    pub field_tans: Vec<DVec2>,
    /// Depths, dioptres.
    pub dioptres: Vec<f64>,
    /// Wavelengths of the white point, of equal energy.
    pub grid: WavelengthGrid,
    /// Pixels along the side of a tile, odd.
    pub tile_px: usize,
    /// Side of a tile on the film, µm; `None` for one that holds the largest of its row.
    pub tile_um: Option<f64>,
}

impl PsfMosaic {
    /// Draws the mosaic of a lens.
    pub fn draw(model: &LensImageModel, plan: &MosaicPlan) -> Self {
        let widest = |&dioptres: &f64| plan.tile_um.unwrap_or_else(|| widest_um(model, plan, dioptres));
        let tiles_um: Vec<f64> = plan.dioptres.iter().map(widest).collect();
        let white = vec![1.0; plan.grid.len()];
        let to_rgb = SpectrumToRgb::with_white(&plan.grid, &white);
        let tile = |(dioptres, tile_um, field_tan): (f64, f64, DVec2)| {
            let pitch_um = tile_um / plan.tile_px as f64;
            let mut light = LinearRgb::black(plan.tile_px, plan.tile_px);
            let image = |nm: f64| model.point(field_tan, dioptres, nm);
            let reference = image(REFERENCE_WAVELENGTH_NM);
            for (band, &wavelength_nm) in plan.grid.centers_nm().iter().enumerate() {
                let Some(image) = image(wavelength_nm) else { continue };
                let lateral_um = lateral_color_um(&image, reference.as_ref());
                light.add(&window(&image, lateral_um, pitch_um, plan.tile_px), to_rgb.of_band(band));
            }
            light.to_srgb(light.level_at(1.0).max(f64::MIN_POSITIVE))
        };
        let rows = plan.dioptres.iter().zip(&tiles_um);
        let places =
            rows.flat_map(|(&dioptres, &tile_um)| plan.field_tans.iter().map(move |&tan| (dioptres, tile_um, tan)));
        let tiles = places.collect::<Vec<_>>().into_par_iter().map(tile).collect();
        Self {
            fields_deg: plan.field_tans.iter().map(|tan| tan.length().atan().to_degrees()).collect(),
            depths_m: plan.dioptres.iter().map(|d| 1.0 / d).collect(),
            tiles_um,
            tiles,
        }
    }

    /// Returns the tile of a depth and field, counted from 0.
    pub fn tile(&self, depth: usize, field: usize) -> &RgbImage {
        &self.tiles[depth * self.fields_deg.len() + field]
    }

    /// Returns all tiles as one picture, each pixel enlarged by a whole number.
    pub fn to_picture(&self, factor: u32) -> RgbImage {
        let side = self.tiles[0].width() * factor;
        let span = |n: usize| n as u32 * (side + GAP) + GAP;
        let mut picture = RgbImage::from_pixel(span(self.fields_deg.len()), span(self.depths_m.len()), PAPER);
        for row in 0..self.depths_m.len() {
            for column in 0..self.fields_deg.len() {
                let at = |i: usize| i64::from(GAP) + i as i64 * i64::from(side + GAP);
                imageops::replace(&mut picture, &enlarged(self.tile(row, column), factor), at(column), at(row));
            }
        }
        picture
    }
}

/// How far from the reference wavelength's image one lies, µm, right and up: lateral color.
fn lateral_color_um(image: &PointImage, reference: Option<&PointImage>) -> DVec2 {
    reference.map_or(DVec2::ZERO, |reference| 1e3 * (image.centroid_mm() - reference.centroid_mm()))
}

/// Returns a point-spread function in a window that is centered on the image of the reference wavelength.
fn window(image: &PointImage, lateral_um: DVec2, pitch_um: f64, size: usize) -> Array2<f32> {
    let shift = (lateral_um / pitch_um).round();
    let (right, up) = (shift.x as isize, shift.y as isize);
    // No more than what is shown: diffraction has tails that go on far beyond it.
    let side = size + 2 * right.unsigned_abs().max(up.unsigned_abs());
    let picture = image.picture(pitch_um, side).0;
    let offset = (side / 2) as isize - (size / 2) as isize;
    Array2::from_shape_fn((size, size), |(row, column)| {
        let (r, c) = (row as isize + offset + up, column as isize + offset - right);
        if r < 0 || c < 0 { 0.0 } else { picture.get((r as usize, c as usize)).map_or(0.0, |v| *v as f32) }
    })
}

/// Returns the side of a tile that holds all but the tails of every point-spread function of a depth, µm.
fn widest_um(model: &LensImageModel, plan: &MosaicPlan, dioptres: f64) -> f64 {
    let (first, last) = plan.grid.range_nm();
    let mut reach_um: f64 = 5.0;
    for &field_tan in &plan.field_tans {
        let reference = model.point(field_tan, dioptres, REFERENCE_WAVELENGTH_NM);
        for image in [first, last].into_iter().filter_map(|nm| model.point(field_tan, dioptres, nm)) {
            let lateral_um = lateral_color_um(&image, reference.as_ref()).length();
            reach_um = reach_um.max(1e3 * image.spread_mm() + lateral_um);
        }
    }
    2.6 * reach_um
}

#[cfg(test)]
mod tests {
    use super::*;
    use dioptric_optics::Lens;
    use dioptric_psf::{Diffraction, ImageSettings};

    #[test]
    fn a_mosaic_has_a_tile_a_field_and_depth() {
        let lens = Lens::built_in("paper-2el").unwrap().with_stop_diameter_mm(4.0).unwrap();
        let settings = ImageSettings::new(51.8145, Diffraction::None);
        let model = LensImageModel::new(&lens, &[400.0, 700.0], &settings).unwrap();
        let plan = MosaicPlan {
            field_tans: vec![DVec2::ZERO, DVec2::new(0.05, 0.0)],
            dioptres: vec![0.0625, 0.25, 0.5],
            grid: WavelengthGrid::uniform(400.0, 700.0, 50.0).unwrap(),
            tile_px: 31,
            tile_um: None,
        };
        let mosaic = PsfMosaic::draw(&model, &plan);
        let picture = mosaic.to_picture(2);
        assert_eq!((picture.width(), picture.height()), (2 * 65 + 3, 3 * 65 + 3));
        // Nothing is bright at the rim of a tile; its middle is.
        let tile = mosaic.tile(0, 0);
        assert!(tile.get_pixel(0, 0).0.iter().all(|&v| v < 60));
        assert!(tile.pixels().any(|p| p.0.contains(&255)));
    }
}
