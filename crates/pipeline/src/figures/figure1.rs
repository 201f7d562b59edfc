//! Figure 1: the point spread functions of the paper's two-element lens over field and depth.

use dioptric_psf::{CountingFilm, FrontGrid, Picture, PsfError};
use glam::{DVec2, DVec3};
use ndarray::Array2;

use super::paper::{FIGURE_3_FILM_MM, counted_psfs, film_center_mm, two_element_lens};

/// Depths of the points, mm before the last vertex.
pub const DEPTHS_MM: [f64; 4] = [2000.0, 4000.0, 8000.0, 16000.0];
/// Heights at 16 m of the three points of equal field, mm; nearer ones lie lower in proportion.
pub const HEIGHTS_AT_16_M_MM: [f64; 3] = [0.0, 400.0, 800.0];
/// Wavelengths, nm.
pub const WAVELENGTHS_NM: [f64; 4] = [400.0, 500.0, 600.0, 700.0];
/// The film about each centroid: 75 × 75 pixels of 4 µm.
pub const FILM: CountingFilm = CountingFilm { n_pixels: 75, side_mm: 0.3, center_mm: DVec2::ZERO };

/// The picture of one point.
#[derive(Clone, Debug)]
pub struct Thumbnail {
    /// Angle of the point from the axis, degrees.
    pub field_deg: f64,
    /// Depth of the point, mm before the last vertex.
    pub depth_mm: f64,
    /// Rays counted on each pixel, a picture a wavelength.
    pub counts: Vec<Array2<f64>>,
}

/// Returns the pictures of all points, depth by depth from the nearest, made of `n_across`² jittered rays each.
///
/// The stop has 4 mm, the elements 6 mm, and the film stands where 8 m is in focus at 587 nm.
///
/// # Errors
/// When the lens cannot be built, which the built-in one always can.
pub fn thumbnails(n_across: usize) -> Result<Vec<Thumbnail>, PsfError> {
    let lens = two_element_lens(4.0, 6.0)?;
    let lenses = WAVELENGTHS_NM.iter().map(|&nm| lens.at(nm)).collect::<Result<Vec<_>, _>>()?;
    let grid = FrontGrid { n_across, jitter_seed: Some(1) };
    let places = DEPTHS_MM.iter().flat_map(|&depth_mm| HEIGHTS_AT_16_M_MM.map(|height_mm| (depth_mm, height_mm)));
    Ok(places
        .map(|(depth_mm, height_mm)| {
            let tangent = height_mm / 16000.0;
            let source_mm = DVec3::new(-tangent * depth_mm, 0.0, -depth_mm);
            let center_mm = film_center_mm(&lenses, source_mm, FIGURE_3_FILM_MM).unwrap_or(DVec2::ZERO);
            let film = CountingFilm { center_mm, ..FILM };
            let counts = counted_psfs(&lenses, source_mm, FIGURE_3_FILM_MM, grid, film);
            Thumbnail { field_deg: tangent.atan().to_degrees(), depth_mm, counts }
        })
        .collect())
}

/// Returns the widths of the pictures as a table: field, depth, wavelength, σx and σy in µm, rays counted.
pub fn table(thumbnails: &[Thumbnail]) -> String {
    let mut text = "field_deg,depth_mm,wavelength_nm,sigma_x_um,sigma_y_um,rays\n".to_owned();
    for thumbnail in thumbnails {
        for (nm, counts) in WAVELENGTHS_NM.iter().zip(&thumbnail.counts) {
            let moments = Picture::new(counts.view(), FILM.pitch_um()).second_moments_um2();
            let (field, depth, rays) = (thumbnail.field_deg, thumbnail.depth_mm, counts.sum());
            let (x, y) = (moments.xx.sqrt(), moments.yy.sqrt());
            text += &format!("{field:.4},{depth},{nm},{x:.3},{y:.3},{rays}\n");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blur_shrinks_towards_the_distance_in_focus_and_grows_off_axis() {
        let thumbnails = thumbnails(51).unwrap();
        let rms = |field: usize, depth: usize, wavelength: usize| {
            let counts = &thumbnails[3 * depth + field].counts[wavelength];
            Picture::new(counts.view(), FILM.pitch_um()).rms_radius_um()
        };
        // At 600 nm 8 m is nearly in focus: 2.8 µm in the authors' own data, plus the pixels of 4 µm.
        assert!(rms(0, 2, 2) < 5.0 && rms(0, 0, 2) > 25.0 && rms(0, 3, 2) > rms(0, 2, 2));
        // Field curvature: light of 500 nm, in focus before the film, comes to a focus still earlier off axis.
        assert!(rms(2, 2, 1) > rms(0, 2, 1));
    }

    #[test]
    fn figure1_matches_its_golden() {
        // A ray that crosses the edge of a pixel moves a width by less than 1e-3 µm.
        dioptric_golden::check_csv("figure1_widths.csv", &table(&thumbnails(101).unwrap()), 1e-3);
    }
}
