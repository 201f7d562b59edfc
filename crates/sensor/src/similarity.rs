//! How alike two pictures are.

use ndarray::Array3;
use rayon::prelude::*;

use crate::{Picture, SensorError};

/// Returns the peak signal-to-noise ratio of codes, dB, the peak being 1; infinity for equal pictures.
///
/// # Errors
/// When the pictures differ in size.
pub fn psnr_db(first: &Picture, second: &Picture) -> Result<f64, SensorError> {
    check_sizes(&first.codes, &second.codes)?;
    let row_sums: Vec<f64> = (first.codes.outer_iter().into_par_iter())
        .zip(second.codes.outer_iter())
        .map(|(a, b)| a.iter().zip(&b).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum())
        .collect();
    Ok(-10.0 * (row_sums.iter().sum::<f64>() / first.codes.len() as f64).log10())
}

fn check_sizes(first: &Array3<f32>, second: &Array3<f32>) -> Result<(), SensorError> {
    let text = |codes: &Array3<f32>| format!("{} × {}", codes.dim().0, codes.dim().1);
    match first.dim() == second.dim() {
        true => Ok(()),
        false => Err(SensorError::Shape {
            what: "rows × columns of the second picture",
            expected: text(first),
            found: text(second),
        }),
    }
}
