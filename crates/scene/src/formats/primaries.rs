//! Linear light of one set of primaries as that of another.

use ndarray::Array2;

/// Makes linear light of other primaries that of sRGB's.
pub(super) fn into_srgb(planes: &mut [Array2<f32>; 3], to_srgb: &[[f64; 3]; 3]) {
    let [red, green, blue] = planes;
    ndarray::Zip::from(red).and(green).and(blue).par_for_each(|r, g, b| {
        let rgb = [*r, *g, *b].map(f64::from);
        [*r, *g, *b] = to_srgb.map(|row| row.iter().zip(rgb).map(|(m, v)| m * v).sum::<f64>() as f32);
    });
}
