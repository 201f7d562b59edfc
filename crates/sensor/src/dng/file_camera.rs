//! The color matrices, the neutral and the noise that a DNG file states.

use dioptric_spectrum::{Observer, WavelengthGrid, Xyz};

use super::{
    file_color::{DngColor, DngLight},
    file_look::hue_sat_map,
    file_profile::DngNoise,
    tags::{
        ANALOG_BALANCE, AS_SHOT_NEUTRAL, AS_SHOT_WHITE_XY, CALIBRATION_ILLUMINANT_1, CALIBRATION_ILLUMINANT_2,
        CALIBRATION_ILLUMINANT_3, CAMERA_CALIBRATION_1, CAMERA_CALIBRATION_2, CAMERA_CALIBRATION_3,
        CAMERA_CALIBRATION_SIGNATURE, COLOR_MATRIX_1, COLOR_MATRIX_2, COLOR_MATRIX_3, FORWARD_MATRIX_1,
        FORWARD_MATRIX_2, FORWARD_MATRIX_3, ILLUMINANT_DATA_1, ILLUMINANT_DATA_2, ILLUMINANT_DATA_3, NOISE_PROFILE,
        PROFILE_CALIBRATION_SIGNATURE, PROFILE_HUE_SAT_MAP_DATA_1, PROFILE_HUE_SAT_MAP_DATA_2,
        PROFILE_HUE_SAT_MAP_DATA_3,
    },
    tiff_reader::Fields,
};

/// Returns the colors of a camera of so many filters by a profile, which may be that of the file, and what each gives of the white of the shot.
pub(super) fn color(
    first: &Fields<'_>,
    profile: &Fields<'_>,
    n: usize,
) -> Result<(Option<DngColor>, Option<Vec<f64>>), String> {
    if n == 1 {
        return Ok((None, None));
    }
    // What a camera differs by from its model goes with the profiles of one maker alone (DNG 1.6, `CameraCalibrationSignature`).
    let signature = |fields: &Fields<'_>, tag: u16| fields.text(tag).unwrap_or_default();
    let is_calibrated =
        signature(first, CAMERA_CALIBRATION_SIGNATURE) == signature(profile, PROFILE_CALIBRATION_SIGNATURE);
    let mut lights = Vec::new();
    for ((matrix, forward, calibration, illuminant, data), map) in [
        (
            (COLOR_MATRIX_1, FORWARD_MATRIX_1, CAMERA_CALIBRATION_1, CALIBRATION_ILLUMINANT_1, ILLUMINANT_DATA_1),
            PROFILE_HUE_SAT_MAP_DATA_1,
        ),
        (
            (COLOR_MATRIX_2, FORWARD_MATRIX_2, CAMERA_CALIBRATION_2, CALIBRATION_ILLUMINANT_2, ILLUMINANT_DATA_2),
            PROFILE_HUE_SAT_MAP_DATA_2,
        ),
        (
            (COLOR_MATRIX_3, FORWARD_MATRIX_3, CAMERA_CALIBRATION_3, CALIBRATION_ILLUMINANT_3, ILLUMINANT_DATA_3),
            PROFILE_HUE_SAT_MAP_DATA_3,
        ),
    ] {
        let Some(rows) = profile.finite(matrix, 3 * n)? else { continue };
        let unit = |i: usize| (0..n).map(|j| f64::from(u8::from(i == j))).collect::<Vec<f64>>();
        let calibration = match first.finite(calibration, n * n)?.filter(|_| is_calibrated) {
            Some(rows) => rows.chunks_exact(n).map(<[f64]>::to_vec).collect(),
            None => (0..n).map(unit).collect(),
        };
        let forward = profile.finite(forward, 3 * n)?;
        let illuminant = profile.one_or(illuminant, 0)?;
        lights.push(DngLight {
            illuminant,
            white_xy: if illuminant == OTHER_LIGHT { white_of_data(profile, data)? } else { None },
            camera_from_xyz: rows.chunks_exact(3).map(|row| [row[0], row[1], row[2]]).collect(),
            xyz_d50_from_balanced: forward.map(|rows| [0, 1, 2].map(|i| rows[i * n..(i + 1) * n].to_vec())),
            calibration,
            map: hue_sat_map(profile, map)?,
        });
    }
    let analog_balance = first.finite(ANALOG_BALANCE, n)?.unwrap_or(vec![1.0; n]);
    let color = (!lights.is_empty()).then_some(DngColor { lights, analog_balance });
    let neutral = match (first.finite(AS_SHOT_NEUTRAL, n)?, first.finite(AS_SHOT_WHITE_XY, 2)?, &color) {
        (Some(neutral), ..) => Some(neutral),
        (None, Some(white), Some(color)) if white.iter().all(|v| *v > 0.0) => {
            Some(color.neutral_of([white[0], white[1]]))
        }
        _ => None,
    };
    match neutral.as_ref().and_then(|parts| parts.iter().find(|part| !(**part > 0.0 && part.is_finite()))) {
        Some(part) => Err(format!("has a neutral of {part}, expected numbers above 0")),
        None => Ok((color, neutral)),
    }
}

/// The number of a light that the file describes itself (Exif `LightSource`).
const OTHER_LIGHT: usize = 255;

/// Returns the chromaticity of a light that the file describes itself (`IlluminantData`, DNG 1.6): as such or as a spectrum.
fn white_of_data(first: &Fields<'_>, tag: u16) -> Result<Option<[f64; 2]>, String> {
    let Some(bytes) = first.bytes(tag) else { return Ok(None) };
    let cut = || format!("has a light in field {tag} that is cut short");
    let whole = |at: usize, n: usize| bytes.get(at..at + n).map(|own| first.number_of(own)).ok_or_else(cut);
    let fraction = |at: usize| Ok::<f64, String>(whole(at, 4)? as f64 / whole(at + 4, 4)? as f64);
    let wrong = |reason: &str| Err(format!("has a light in field {tag} {reason}"));
    match whole(0, 2)? {
        0 => {
            let [x, y] = [fraction(2)?, fraction(10)?];
            if x > 0.0 && y > 0.0 && x + y < 1.0 {
                Ok(Some([x, y]))
            } else {
                wrong(&format!("of chromaticity {x}, {y}"))
            }
        }
        1 => {
            let n = whole(2, 4)? as usize;
            let (first_nm, step_nm) = (fraction(6)?, fraction(14)?);
            if n < 2 || n > bytes.len() / 8 || !(first_nm > 0.0 && step_nm > 0.0 && step_nm < 1e4) {
                return wrong(&format!("of {n} values from {first_nm} nm in steps of {step_nm} nm"));
            }
            let values = (0..n).map(|i| fraction(22 + 8 * i)).collect::<Result<Vec<f64>, String>>()?;
            if !values.iter().all(|value| value.is_finite()) {
                return wrong("with a fraction over 0");
            }
            let grid = WavelengthGrid::uniform(380.0, 780.0, 5.0).map_err(|e| e.to_string())?;
            let at = |nm: f64| {
                let place = ((nm - first_nm) / step_nm).clamp(0.0, (n - 1) as f64);
                let below = (place as usize).min(n - 2);
                values[below] + (place - below as f64) * (values[below + 1] - values[below])
            };
            let light: Vec<f64> = grid.centers_nm().iter().map(|&nm| at(nm)).collect();
            let weights = Observer::Cie1931.weights(&grid);
            let xyz = weights.each_ref().map(|w| w.iter().zip(&light).map(|(w, v)| w * v).sum::<f64>());
            let white = Xyz(xyz).chromaticity();
            if white.iter().all(|v| *v > 0.0) { Ok(Some(white)) } else { wrong("without visible light") }
        }
        kind => wrong(&format!("of kind {kind}, expected 0 (chromaticity) or 1 (spectrum)")),
    }
}

/// Returns the noise of the frame: none, one for all filters, or one each.
pub(super) fn noise(frame: &Fields<'_>, first: &Fields<'_>, n: usize) -> Result<Vec<DngNoise>, String> {
    let fields = if frame.has(NOISE_PROFILE) { frame } else { first };
    let values = fields.numbers(NOISE_PROFILE)?;
    let is_right = [0, 2, 2 * n].contains(&values.len()) && values.iter().all(|value| value.is_finite());
    if !is_right {
        return Err(format!("has {} numbers in its NoiseProfile, expected 2 or {}", values.len(), 2 * n));
    }
    Ok(values.chunks_exact(2).map(|pair| DngNoise { scale: pair[0].max(0.0), offset: pair[1] }).collect())
}
