//! From one value a pixel to every color in every pixel.

mod directional;
mod malvar;
mod neighbors;
mod padded;
mod ratio;
mod tent;

use ndarray::Array2;
use serde::{Deserialize, Serialize};

use crate::{SensorError, Tile};

/// How the missing colors of a mosaic are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum Demosaic {
    /// The nearest pixel of each color. Any mosaic.
    Nearest,
    /// The mean of the neighbors of each color, weighted by a tent as wide as the tile. Any mosaic.
    Bilinear,
    /// Linear 5 × 5 filters with a correction from the other colors (Malvar, He & Cutler, ICASSP 2004). Bayer-like
    /// mosaics; others are done as `Bilinear`.
    Malvar,
    /// Color differences along the edges, weighted by their gradients in four directions (after Pekkucuksen &
    /// Altunbasak, "Gradient based threshold free color filter array interpolation", ICIP 2010). Bayer-like mosaics;
    /// others take the fine detail of each pixel over to all colors, by the ratios of neighbors behind different filters.
    Directional,
    /// The same on a logarithmic scale of light, on which it is the ratios of colors that run on along edges: they do so at
    /// shadows and at edges of one material whatever the balance, which differences do only where white is neutral (Cok,
    /// US patent 4 642 678, 1987; Kimmel, IEEE Transactions on Image Processing 8, 1999). Other mosaics as `Directional`.
    #[default]
    DirectionalRatio,
}

impl Demosaic {
    /// Every method with its name on the command line.
    pub const NAMES: [(&'static str, Self); 5] = [
        ("nearest", Self::Nearest),
        ("bilinear", Self::Bilinear),
        ("malvar", Self::Malvar),
        ("directional", Self::Directional),
        ("directional-ratio", Self::DirectionalRatio),
    ];

    /// Returns the method of a name.
    ///
    /// # Errors
    /// When none has that name.
    pub fn parse(name: &str) -> Result<Self, SensorError> {
        let found = Self::NAMES.iter().find(|(known, _)| known.eq_ignore_ascii_case(name));
        found.map(|(_, method)| *method).ok_or_else(|| {
            let expected = Self::NAMES.map(|(known, _)| known).join(", ");
            SensorError::Word { what: "a demosaic", found: name.to_owned(), expected }
        })
    }
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
        (Demosaic::DirectionalRatio, Some(bayer)) => ratio::demosaic(values, bayer, n_channels),
        (Demosaic::Directional | Demosaic::DirectionalRatio, None) => neighbors::demosaic(values, tile, n_channels),
    })
}
