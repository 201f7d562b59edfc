//! The sheen of cloth: fibers that stand up (Estevez & Kulla 2017), as glTF's `KHR_materials_sheen` has it.

use std::{f32::consts::PI, sync::LazyLock};

use glam::Vec3;

/// The least roughness squared: thinner rims are those of this one.
const LEAST_ALPHA: f32 = 0.01;
/// Steps of the table of what is scattered, over the cosine and over the square root of α.
const COSINES: usize = 32;
const ROUGHNESSES: usize = 32;

/// Returns the function times the cosine for light from one direction towards another, of a white sheen.
pub(crate) fn value(alpha: f32, o: Vec3, i: Vec3) -> f32 {
    let alpha = alpha.clamp(LEAST_ALPHA, 1.0);
    let (cos_o, cos_i) = (o.z.abs(), i.z.abs());
    let half = (o + i).normalize_or(Vec3::Z);
    let sin = (1.0 - half.z * half.z).max(0.0).sqrt();
    let density = (2.0 + 1.0 / alpha) * sin.powf(1.0 / alpha) / (2.0 * PI);
    let seen_and_lit = 1.0 / (1.0 + masked(alpha, cos_o) + masked(alpha, cos_i));
    density * seen_and_lit / (4.0 * cos_o.max(1e-4))
}

/// The fit to Smith's Λ of these fibers.
fn masked(alpha: f32, cos: f32) -> f32 {
    let smooth = (1.0 - alpha) * (1.0 - alpha);
    let [a, b, c, d, e] =
        [(21.5473, 25.3245), (3.82987, 3.32435), (0.19823, 0.16801), (-1.97760, -1.27393), (-4.32054, -4.85967)]
            .map(|(rough, fine)| rough + smooth * (fine - rough));
    let fit = |x: f32| a / (1.0 + b * x.powf(c)) + d * x + e;
    if cos < 0.5 { fit(cos).exp() } else { (2.0 * fit(0.5) - fit(1.0 - cos)).exp() }
}

/// Returns the share of light that a white sheen sends back from a direction.
pub(crate) fn albedo(alpha: f32, cos: f32) -> f32 {
    static TABLE: LazyLock<Vec<[f32; COSINES]>> =
        LazyLock::new(|| (0..ROUGHNESSES).map(|row| std::array::from_fn(|column| integral(row, column))).collect());
    let place = |share: f32, n: usize| {
        let at = share.clamp(0.0, 1.0) * (n - 1) as f32;
        let low = (at as usize).min(n - 2);
        (low, at - low as f32)
    };
    let (row, y) = place(alpha.sqrt(), ROUGHNESSES);
    let (column, x) = place(cos.abs(), COSINES);
    let along = |row: usize| TABLE[row][column] + x * (TABLE[row][column + 1] - TABLE[row][column]);
    along(row) + y * (along(row + 1) - along(row))
}

/// The integral over all directions, evenly over the projected disc's square of sines and the azimuth.
fn integral(row: usize, column: usize) -> f32 {
    let alpha = (row as f32 / (ROUGHNESSES - 1) as f32).powi(2);
    let cos = (column as f32 / (COSINES - 1) as f32).max(1e-3);
    let o = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
    let (rings, spokes) = (48, 48);
    let mut sum = 0.0;
    for ring in 0..rings {
        let z = (ring as f32 + 0.5) / rings as f32;
        let r = (1.0 - z * z).sqrt();
        for spoke in 0..spokes {
            let (sin, cos) = (PI * (spoke as f32 + 0.5) / spokes as f32).sin_cos();
            sum += value(alpha, o, Vec3::new(r * cos, r * sin, z));
        }
    }
    sum * 2.0 * PI / (rings * spokes) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is sent back rises towards the rim, is at most 1, and is nearly none of a fine sheen from above.
    #[test]
    fn sheen_is_brightest_at_the_rim() {
        for alpha in [0.04, 0.25, 1.0] {
            let [above, aside, rim] = [1.0, 0.5, 0.05].map(|cos| albedo(alpha, cos));
            assert!(above <= aside && aside < rim && rim <= 1.0, "{alpha}: {above} {aside} {rim}");
        }
        assert!(albedo(0.04, 1.0) < 0.01, "{}", albedo(0.04, 1.0));
    }
}
