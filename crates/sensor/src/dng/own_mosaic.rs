//! Mosaics that a program holds, as files hold them.

use ndarray::Array2;

use super::{
    file_color::{DngColor, DngLight},
    file_look::{DngLook, DngRendering},
    file_profile::DngProfile,
    read::{DngFile, DngShot},
};
use crate::{Cfa, Exposure, Levels, Raw, RawPlane, SensorError};

/// The light of a matrix of colors that a program gives: D65 (Exif `LightSource`).
const D65: usize = 21;
/// The filters whose channels are red, green and blue without a matrix.
const RED_GREEN_BLUE: [&str; 3] = ["R", "G", "B"];

/// A mosaic that a program holds, and what it knows of the camera.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnMosaic {
    /// The digital numbers; row 0 is the top.
    pub dn: Array2<u16>,
    /// The letters of the tile from the top left pixel on, a text a row; one letter for a single filter.
    pub tile: Vec<String>,
    /// The digital number of no light.
    pub black: f64,
    /// The digital number at which a pixel is saturated.
    pub white: f64,
    /// A row for each filter, in the order R, G, B, others by the alphabet: its signal of X, Y and Z, as `ColorMatrix` of a DNG file for
    /// D65; `None` where it is not known.
    pub camera_from_xyz: Option<Vec<[f64; 3]>>,
}

impl OwnMosaic {
    /// Returns the names of the filters, in the order of their channels.
    fn filter_names(&self) -> Vec<String> {
        let mut names: Vec<String> = self.tile.iter().flat_map(|row| row.chars()).map(String::from).collect();
        let order = |name: &String| RED_GREEN_BLUE.iter().position(|own| own == name).unwrap_or(RED_GREEN_BLUE.len());
        names.sort_by_key(|name| (order(name), name.clone()));
        names.dedup();
        names
    }
}

impl DngFile {
    /// Takes a mosaic that a program holds as the frame of a file that states as much.
    ///
    /// # Errors
    /// When it has no pixel, the tile is empty or ragged, the levels do not lie in order, or colors are not known: the matrix has not a
    /// row a filter, or is left out of filters that are not red, green and blue.
    pub fn of_mosaic(mosaic: OwnMosaic) -> Result<Self, SensorError> {
        let refused = |what, reason: String| Err(SensorError::Unsuitable { what, reason });
        let (rows, columns) = mosaic.dn.dim();
        if mosaic.dn.is_empty() {
            return refused("the raw frame", format!("is of shape [{rows}, {columns}], expected pixels"));
        }
        let names = mosaic.filter_names();
        let filters: Vec<&str> = names.iter().map(String::as_str).collect();
        let letters = mosaic.tile.iter().map(|row| row.chars().map(String::from).collect()).collect();
        let tile = Cfa::Mosaic(letters).resolve("the frame", &filters)?;
        let top = f64::from(u16::MAX);
        let are_levels = mosaic.black >= 0.0 && mosaic.white > mosaic.black && mosaic.white <= top;
        if !are_levels {
            let reason = format!("are {} and {}, expected 0 <= black < white <= {top}", mosaic.black, mosaic.white);
            return refused("black and white", reason);
        }
        let color = match mosaic.camera_from_xyz {
            Some(rows) if rows.len() != names.len() || rows.iter().flatten().any(|v| !v.is_finite()) => {
                let n = names.len();
                return refused("the color matrix", format!("does not have {n} rows of three numbers, a row a filter"));
            }
            Some(camera_from_xyz) if names.len() > 1 => {
                let n = names.len();
                let unit = |i: usize| (0..n).map(|j| f64::from(u8::from(i == j))).collect::<Vec<f64>>();
                let light = DngLight {
                    illuminant: D65,
                    white_xy: None,
                    camera_from_xyz,
                    xyz_d50_from_balanced: None,
                    calibration: (0..n).map(unit).collect(),
                    map: None,
                };
                Some(DngColor { lights: vec![light], analog_balance: vec![1.0; n] })
            }
            _ => None,
        };
        if color.is_none() && names.len() > 1 && filters != RED_GREEN_BLUE {
            let found = names.join(", ");
            return refused("the color", format!("of the filters {found} is not known, expected a color matrix"));
        }
        let raw = Raw {
            planes: vec![RawPlane::Dn(mosaic.dn)],
            tile: tile.filter(|_| names.len() > 1),
            filter_names: names.clone(),
            levels: Levels::of_file((mosaic.black, mosaic.white, top), f64::INFINITY, None),
            exposure: Exposure::seconds(0.0),
            row_time_us: 0.0,
            merged: Vec::new(),
            masked: None,
        };
        Ok(Self {
            raw,
            bits: u16::BITS,
            stored: (columns, rows),
            origin: (0, 0),
            profile: DngProfile {
                filter_names: names,
                color,
                look: DngLook::default(),
                noise: Vec::new(),
                corrections: None,
            },
            neutral: None,
            orientation: 1,
            shot: DngShot::default(),
            rendering: DngRendering::default(),
            masked: None,
            opcodes: Vec::new(),
            notes: Vec::new(),
            with_border: None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ColorCorrection, Processing, WhiteBalance};

    fn mosaic(tile: &[&str], code: impl Fn(usize, usize) -> u16) -> OwnMosaic {
        OwnMosaic {
            dn: Array2::from_shape_fn((12, 16), |(row, column)| code(row, column)),
            tile: tile.iter().map(|row| (*row).to_owned()).collect(),
            black: 64.0,
            white: 1023.0,
            camera_from_xyz: None,
        }
    }

    fn plain() -> Processing {
        let white = WhiteBalance::Gains(vec![1.0; 3]);
        Processing { white, color: ColorCorrection::None, ..Processing::default() }
    }

    #[test]
    fn each_letter_is_its_channel() {
        // Red alone is at half of saturation, wherever the tile has it; green and blue are dark.
        for tile in [["RG", "GB"], ["BG", "GR"], ["GR", "BG"], ["GB", "RG"]] {
            let at = |row: usize, column: usize| tile[row % 2].as_bytes()[column % 2];
            let code = |row, column| if at(row, column) == b'R' { 64 + 480 } else { 64 };
            let file = DngFile::of_mosaic(mosaic(&tile, code)).unwrap();
            let [r, g, b] = file.develop(&plain()).unwrap().picture.rgb_at(6, 8);
            assert!(r > 0.5 && g < 1e-6 && b < 1e-6, "{tile:?}: {r} {g} {b}");
        }
        let gray = OwnMosaic { tile: vec!["W".to_owned()], ..mosaic(&["W"], |_, _| 543) };
        let file = DngFile::of_mosaic(gray).unwrap();
        assert!((f64::from(file.raw.linear()[0][(3, 3)]) - 479.0 / 959.0).abs() < 1e-6);
    }

    #[test]
    fn what_is_not_known_is_refused() {
        let message = |mosaic: OwnMosaic| DngFile::of_mosaic(mosaic).unwrap_err().to_string();
        let good = mosaic(&["RG", "GB"], |_, _| 100);
        assert!(message(OwnMosaic { white: 64.0, ..good.clone() }).contains("are 64 and 64"));
        assert!(message(mosaic(&["RG", "G"], |_, _| 100)).contains("row 1 has 1 filters"));
        assert!(message(mosaic(&["CY", "YM"], |_, _| 100)).contains("C, M, Y is not known"));
        let short = OwnMosaic { camera_from_xyz: Some(vec![[1.0, 0.0, 0.0]]), ..good.clone() };
        assert!(message(short).contains("3 rows"));
        assert!(message(OwnMosaic { dn: Array2::zeros((0, 4)), ..good }).contains("expected pixels"));
    }
}
