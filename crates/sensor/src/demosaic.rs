//! From one value a pixel to every colour in every pixel.

mod directional;
mod malvar;
mod padded;
mod tent;

use ndarray::Array2;
use serde::{Deserialize, Serialize};

use crate::{SensorError, Tile};

/// How the missing colours of a mosaic are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Demosaic {
    /// The nearest pixel of each colour. Any mosaic.
    Nearest,
    /// The mean of the neighbours of each colour, weighted by a tent as wide as the tile. Any mosaic.
    Bilinear,
    /// Linear 5 × 5 filters with a correction from the other colours (Malvar, He & Cutler, ICASSP 2004). Bayer-like
    /// mosaics; others are done as `Bilinear`.
    Malvar,
    /// Colour differences along the edges, weighted by their gradients in four directions (after Pekkucuksen &
    /// Altunbasak, "Gradient based threshold free color filter array interpolation", ICIP 2010). Bayer-like mosaics;
    /// others take the fine detail of each pixel over to all colours.
    Directional,
}

/// Returns one plane a channel from a mosaic of values.
///
/// # Errors
/// When the frame is smaller than the tile, or than 2 × 2 pixels.
pub fn demosaic(
    values: &Array2<f32>,
    tile: &Tile,
    n_channels: usize,
    method: Demosaic,
) -> Result<Vec<Array2<f32>>, SensorError> {
    let (rows, columns) = values.dim();
    if tile.n_filters() == 1 && n_channels == 1 {
        return Ok(vec![values.clone()]);
    }
    let (least_rows, least_columns) = (tile.rows().max(2), tile.columns().max(2));
    if rows < least_rows || columns < least_columns {
        return Err(SensorError::Shape {
            what: "rows × columns of a mosaic (at least)",
            expected: format!("{least_rows} × {least_columns}"),
            found: format!("{rows} × {columns}"),
        });
    }
    Ok(match (method, tile.bayer()) {
        (Demosaic::Nearest, _) => tent::nearest(values, tile, n_channels),
        (Demosaic::Bilinear, _) | (Demosaic::Malvar, None) => tent::bilinear(values, tile, n_channels),
        (Demosaic::Malvar, Some(bayer)) => malvar::demosaic(values, bayer, n_channels),
        (Demosaic::Directional, Some(bayer)) => directional::demosaic(values, bayer, n_channels),
        (Demosaic::Directional, None) => tent::with_detail(values, tile, n_channels),
    })
}
