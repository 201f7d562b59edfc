//! The colors that the header of a BMP file states (BITMAPV4HEADER and BITMAPV5HEADER of the Windows GDI).

use std::path::Path;

/// What a header of version 4 or 5 says its colors are.
#[derive(Debug, PartialEq)]
pub(crate) enum BmpColors {
    /// sRGB, the system's own, or nothing.
    Usual,
    /// Primaries by their x and y, the white that they make together, and gammas of red, green and blue.
    Calibrated { primaries: [[f32; 2]; 3], white: [f64; 2], gammas: [f64; 3] },
    /// An ICC profile.
    Profile(Vec<u8>),
    /// A profile in a file of this machine or another.
    Linked,
}

/// Where the header begins, and where in it stand the kind of color space, primaries, gammas, and place and size of a profile.
const HEADER: usize = 14;
const KIND: usize = HEADER + 56;
const ENDPOINTS: usize = HEADER + 60;
const GAMMAS: usize = HEADER + 96;
const PROFILE: usize = HEADER + 112;
/// Sizes of headers of version 4 and 5.
const VERSION_4: u32 = 108;
const VERSION_5: u32 = 124;

/// Returns what a file says; the usual colors where it is no such file.
pub(crate) fn colors_of_bmp(path: &Path) -> BmpColors {
    std::fs::read(path).ok().and_then(|bytes| stated(&bytes)).unwrap_or(BmpColors::Usual)
}

fn stated(bytes: &[u8]) -> Option<BmpColors> {
    let word = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?));
    let size = word(HEADER)?;
    if !bytes.starts_with(b"BM") || size < VERSION_4 {
        return None;
    }
    match &word(KIND)?.to_be_bytes() {
        [0, 0, 0, 0] => {
            // Fixed point: 30 bits below the point of X, Y and Z, 16 of gammas.
            let values: Option<Vec<f64>> =
                (0..9).map(|i| Some(f64::from(word(ENDPOINTS + 4 * i)?) / 2_f64.powi(30))).collect();
            let values = values?;
            let gamma = |i: usize| Some(f64::from(word(GAMMAS + 4 * i)?) / 2_f64.powi(16));
            let gammas = [gamma(0)?, gamma(1)?, gamma(2)?];
            let xyz = values.as_chunks::<3>().0;
            let point = |xyz: &[f64; 3]| {
                let sum: f64 = xyz.iter().sum();
                [xyz[0] / sum, xyz[1] / sum]
            };
            let white = [0, 1, 2].map(|k| xyz.iter().map(|xyz| xyz[k]).sum::<f64>());
            // Many writers leave zeros.
            let is_stated =
                xyz.iter().all(|xyz| xyz.iter().sum::<f64>() > 0.0) && gammas.iter().all(|gamma| *gamma > 0.0);
            let primaries = [0, 1, 2].map(|i| point(&xyz[i]).map(|v| v as f32));
            is_stated.then(|| BmpColors::Calibrated { primaries, white: point(&white), gammas })
        }
        b"LINK" if size >= VERSION_5 => Some(BmpColors::Linked),
        b"MBED" if size >= VERSION_5 => {
            let (at, length) = (HEADER + word(PROFILE)? as usize, word(PROFILE + 4)? as usize);
            Some(BmpColors::Profile(bytes.get(at..at.checked_add(length)?)?.to_vec()))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(size: u32, kind: [u8; 4]) -> Vec<u8> {
        let mut bytes = vec![0; HEADER + size.max(VERSION_4) as usize];
        bytes[..2].copy_from_slice(b"BM");
        bytes[HEADER..HEADER + 4].copy_from_slice(&size.to_le_bytes());
        bytes[KIND..KIND + 4].copy_from_slice(&u32::from_be_bytes(kind).to_le_bytes());
        bytes
    }

    #[test]
    fn headers_say_their_colors() {
        assert_eq!(stated(&header(40, *b"\0\0\0\0")), None);
        assert_eq!(stated(&header(108, *b"sRGB")), None);
        assert_eq!(stated(&header(108, *b"\0\0\0\0")), None);
        assert_eq!(stated(&header(124, *b"LINK")), Some(BmpColors::Linked));
        let mut own = header(124, *b"MBED");
        own[PROFILE..PROFILE + 8].copy_from_slice(&[124, 0, 0, 0, 3, 0, 0, 0]);
        own.extend(b"icc");
        assert_eq!(stated(&own), Some(BmpColors::Profile(b"icc".to_vec())));
        let mut calibrated = header(108, *b"\0\0\0\0");
        let xyz = [0.64_f64, 0.33, 0.03, 0.21, 0.71, 0.08, 0.15, 0.06, 0.79];
        for (i, value) in xyz.iter().enumerate() {
            let fixed = (value * 2_f64.powi(30)) as u32;
            calibrated[ENDPOINTS + 4 * i..ENDPOINTS + 4 * i + 4].copy_from_slice(&fixed.to_le_bytes());
        }
        (0..3)
            .for_each(|i| calibrated[GAMMAS + 4 * i..GAMMAS + 4 * i + 4].copy_from_slice(&(144_179_u32).to_le_bytes()));
        let Some(BmpColors::Calibrated { primaries, white, gammas }) = stated(&calibrated) else { panic!() };
        assert!((primaries[1][1] - 0.71).abs() < 1e-6 && (gammas[2] - 2.2).abs() < 1e-4);
        assert!((white[0] - 1.0 / 3.0).abs() < 1e-6);
        // Cut off.
        assert_eq!(stated(&calibrated[..90]), None);
    }
}
