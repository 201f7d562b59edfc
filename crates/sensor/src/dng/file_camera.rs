//! The color matrices, the neutral and the noise that a DNG file states.

use super::{
    file_color::{DngColor, DngLight},
    file_profile::DngNoise,
    tags::{
        ANALOG_BALANCE, AS_SHOT_NEUTRAL, AS_SHOT_WHITE_XY, CALIBRATION_ILLUMINANT_1, CALIBRATION_ILLUMINANT_2,
        CAMERA_CALIBRATION_1, CAMERA_CALIBRATION_2, COLOR_MATRIX_1, COLOR_MATRIX_2, FORWARD_MATRIX_1, FORWARD_MATRIX_2,
        NOISE_PROFILE,
    },
    tiff_reader::Fields,
};

/// Returns the colors of a camera of so many filters, and what each gives of the white of the shot.
pub(super) fn color(first: &Fields<'_>, n: usize) -> Result<(Option<DngColor>, Option<Vec<f64>>), String> {
    if n == 1 {
        return Ok((None, None));
    }
    let mut lights = Vec::new();
    for (matrix, forward, calibration, illuminant) in [
        (COLOR_MATRIX_1, FORWARD_MATRIX_1, CAMERA_CALIBRATION_1, CALIBRATION_ILLUMINANT_1),
        (COLOR_MATRIX_2, FORWARD_MATRIX_2, CAMERA_CALIBRATION_2, CALIBRATION_ILLUMINANT_2),
    ] {
        let Some(rows) = first.finite(matrix, 3 * n)? else { continue };
        let unit = |i: usize| (0..n).map(|j| f64::from(u8::from(i == j))).collect::<Vec<f64>>();
        let calibration = match first.finite(calibration, n * n)? {
            Some(rows) => rows.chunks_exact(n).map(<[f64]>::to_vec).collect(),
            None => (0..n).map(unit).collect(),
        };
        let forward = first.finite(forward, 3 * n)?;
        lights.push(DngLight {
            illuminant: first.one_or(illuminant, 0)?,
            camera_from_xyz: rows.chunks_exact(3).map(|row| [row[0], row[1], row[2]]).collect(),
            xyz_d50_from_balanced: forward.map(|rows| [0, 1, 2].map(|i| rows[i * n..(i + 1) * n].to_vec())),
            calibration,
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
