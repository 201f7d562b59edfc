//! The colors of a camera as a DNG file states them: matrices for one light or two (DNG 1.4, chapter 6).

use dioptric_spectrum::{ColorTemperature, Xyz, adapt_bradford};
use serde::Serialize;

use crate::ColorMatrix;

/// The white of the profile connection space, D50.
const D50_XY: [f64; 2] = [0.3457, 0.3585];

/// The color matrices of a file, rows by its planes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DngColor {
    /// One for each calibration light, one or two.
    pub lights: Vec<DngLight>,
    /// The factor on each plane before the matrices (`AnalogBalance`).
    pub analog_balance: Vec<f64>,
}

/// What a file states for one light.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DngLight {
    /// The number of the light (Exif `LightSource`).
    pub illuminant: usize,
    /// A row a plane: the plane's signal of X, Y and Z (`ColorMatrix`).
    pub camera_from_xyz: Vec<[f64; 3]>,
    /// For X, Y and Z under D50 the factor of each balanced plane (`ForwardMatrix`); `None` where the file has none.
    pub xyz_d50_from_balanced: Option<[Vec<f64>; 3]>,
    /// A row a plane: what this camera gives of what one of its model gives (`CameraCalibration`).
    pub calibration: Vec<Vec<f64>>,
}

impl DngLight {
    /// Returns the color temperature of the light, K; that of daylight where the number names none.
    pub fn kelvin(&self) -> f64 {
        kelvin_of(self.illuminant)
    }
}

/// Returns the color temperature of a light by its Exif number: the middle of its range where it has one.
fn kelvin_of(number: usize) -> f64 {
    match number {
        3 | 17 => 2856.0,
        18 => 4874.0,
        19 => 6774.0,
        10 | 21 => 6504.0,
        11 | 22 => 7504.0,
        23 => 5003.0,
        24 => 3200.0,
        12 => 6400.0,
        13 => 5050.0,
        14 | 2 => 4200.0,
        15 => 3450.0,
        16 => 2925.0,
        _ => 5503.0,
    }
}

/// The matrices for one white.
struct AtWhite {
    camera_from_xyz: Vec<[f64; 3]>,
    xyz_d50_from_balanced: Option<[Vec<f64>; 3]>,
    calibration: Vec<Vec<f64>>,
}

impl DngColor {
    fn n_planes(&self) -> usize {
        self.analog_balance.len()
    }

    /// Returns the matrices for a white: between those of the two lights by the inverse of its temperature.
    fn at(&self, white_xy: [f64; 2]) -> AtWhite {
        let of = |light: &DngLight| AtWhite {
            camera_from_xyz: light.camera_from_xyz.clone(),
            xyz_d50_from_balanced: light.xyz_d50_from_balanced.clone(),
            calibration: light.calibration.clone(),
        };
        let [first, second] = self.lights.as_slice() else { return of(&self.lights[0]) };
        let mired = 1e6 / ColorTemperature::of_chromaticity(white_xy).kelvin;
        let [from, to] = [first, second].map(|light| 1e6 / light.kelvin());
        let share = if from == to { 0.0 } else { ((mired - from) / (to - from)).clamp(0.0, 1.0) };
        let share = if share.is_nan() { 0.0 } else { share };
        let mix = |a: f64, b: f64| a + share * (b - a);
        let mix_rows = |a: &Vec<f64>, b: &Vec<f64>| a.iter().zip(b).map(|(a, b)| mix(*a, *b)).collect::<Vec<f64>>();
        let forward = match (&first.xyz_d50_from_balanced, &second.xyz_d50_from_balanced) {
            (Some(a), Some(b)) => Some([0, 1, 2].map(|i| mix_rows(&a[i], &b[i]))),
            (a, b) => a.clone().or_else(|| b.clone()),
        };
        let matrices = first.camera_from_xyz.iter().zip(&second.camera_from_xyz);
        AtWhite {
            camera_from_xyz: matrices.map(|(a, b)| [0, 1, 2].map(|i| mix(a[i], b[i]))).collect(),
            xyz_d50_from_balanced: forward,
            calibration: first.calibration.iter().zip(&second.calibration).map(|(a, b)| mix_rows(a, b)).collect(),
        }
    }

    /// Returns what the file's planes are of those of the model: analog balance × calibration.
    fn of_model(&self, at: &AtWhite) -> Vec<Vec<f64>> {
        let scaled = |(row, balance): (&Vec<f64>, &f64)| row.iter().map(|v| v * balance).collect();
        at.calibration.iter().zip(&self.analog_balance).map(scaled).collect()
    }

    /// Returns a row a plane: the file's planes from XYZ, for a white.
    fn camera_from_xyz(&self, at: &AtWhite) -> Vec<[f64; 3]> {
        let row = |factors: &Vec<f64>| {
            [0, 1, 2].map(|j| factors.iter().zip(&at.camera_from_xyz).map(|(factor, row)| factor * row[j]).sum())
        };
        self.of_model(at).iter().map(row).collect()
    }

    /// Returns what each plane sees of a white of luminance 1.
    pub(crate) fn neutral_of(&self, white_xy: [f64; 2]) -> Vec<f64> {
        let white = xyz_of(white_xy);
        let rows = self.camera_from_xyz(&self.at(white_xy));
        rows.iter().map(|row| row.iter().zip(white.0).map(|(m, v)| m * v).sum()).collect()
    }

    /// Returns the chromaticity of a neutral, by the iteration of the specification; that of D50 where it leads nowhere.
    pub fn white_of(&self, neutral: &[f64]) -> [f64; 2] {
        let mut white = D50_XY;
        for _ in 0..30 {
            let rows: Vec<Vec<f64>> = self.camera_from_xyz(&self.at(white)).iter().map(|row| row.to_vec()).collect();
            let Some(inverse) = pseudo_inverse(&rows) else { return D50_XY };
            let xyz = [0, 1, 2].map(|i| dot(&inverse[i], neutral));
            let next = Xyz(xyz).chromaticity();
            if !(next.iter().all(|v| v.is_finite() && *v > 0.0) && next[0] + next[1] < 1.0) {
                return D50_XY;
            }
            if (next[0] - white[0]).abs() + (next[1] - white[1]).abs() < 1e-9 {
                return next;
            }
            white = next;
        }
        white
    }

    /// Returns the matrix from planes that were balanced for a neutral to linear sRGB, neutral to (1, 1, 1).
    pub(crate) fn matrix(&self, neutral: &[f64]) -> Option<ColorMatrix> {
        let white_xy = self.white_of(neutral);
        let at = self.at(white_xy);
        let n = self.n_planes();
        // A column a balanced plane: what it is in XYZ under D50.
        let to_d50: Vec<Vec<f64>> = if let Some(forward) = &at.xyz_d50_from_balanced {
            let of_file = pseudo_inverse(&self.of_model(&at))?;
            let reference: Vec<f64> = of_file.iter().map(|row| dot(row, neutral)).collect();
            let balanced = |i: usize, plane: usize| of_file[i][plane] * neutral[plane] / reference[i];
            let entry = |row: &Vec<f64>, plane: usize| (0..n).map(|i| row[i] * balanced(i, plane)).sum();
            forward.iter().map(|row| (0..n).map(|plane| entry(row, plane)).collect()).collect()
        } else {
            let rows: Vec<Vec<f64>> = self.camera_from_xyz(&at).iter().map(|row| row.to_vec()).collect();
            let inverse = pseudo_inverse(&rows)?;
            let (white, d50) = (xyz_of(white_xy), xyz_of(D50_XY));
            let columns: Vec<[f64; 3]> = (0..n)
                .map(|plane| {
                    let xyz = Xyz([0, 1, 2].map(|i| inverse[i][plane] * neutral[plane]));
                    adapt_bradford(xyz, white, d50).0
                })
                .collect();
            (0..3).map(|i| columns.iter().map(|column| column[i]).collect()).collect()
        };
        to_srgb(&to_d50)
    }
}

/// Returns the matrix to linear sRGB of one to XYZ under D50, its white made (1, 1, 1).
fn to_srgb(to_d50: &[Vec<f64>]) -> Option<ColorMatrix> {
    let white = Xyz([0, 1, 2].map(|i| to_d50[i].iter().sum()));
    let unit = Xyz::from_linear_srgb([1.0; 3]);
    let n = to_d50[0].len();
    let columns: Vec<[f64; 3]> = (0..n)
        .map(|plane| {
            let xyz = Xyz([0, 1, 2].map(|i| to_d50[i][plane] / white.0[1]));
            adapt_bradford(xyz, Xyz(white.0.map(|v| v / white.0[1])), unit).to_linear_srgb()
        })
        .collect();
    let rows = [0, 1, 2].map(|i| columns.iter().map(|column| column[i]).collect::<Vec<f64>>());
    let is_finite = rows.iter().flatten().all(|v| v.is_finite());
    is_finite.then(|| ColorMatrix { rows, has_roots: false, delta_e: Vec::new() })
}

fn xyz_of([x, y]: [f64; 2]) -> Xyz {
    Xyz([x / y, 1.0, (1.0 - x - y) / y])
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Returns (AᵀA)⁻¹Aᵀ, the inverse of a square matrix; `None` where there is none.
fn pseudo_inverse(rows: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
    let n = rows.first()?.len();
    let product = |i: usize, j: usize| rows.iter().map(|row| row[i] * row[j]).sum::<f64>();
    // [AᵀA | Aᵀ], reduced until the left half is the unit matrix.
    let mut wide: Vec<Vec<f64>> =
        (0..n).map(|i| (0..n).map(|j| product(i, j)).chain(rows.iter().map(|row| row[i])).collect()).collect();
    for i in 0..n {
        let largest = (i..n).max_by(|&a, &b| wide[a][i].abs().total_cmp(&wide[b][i].abs()))?;
        wide.swap(i, largest);
        let pivot = wide[i][i];
        if pivot.is_nan() || pivot.abs() <= 1e-12 {
            return None;
        }
        wide[i].iter_mut().for_each(|v| *v /= pivot);
        let row = wide[i].clone();
        for (_, other) in wide.iter_mut().enumerate().filter(|(k, _)| *k != i) {
            let factor = other[i];
            other.iter_mut().zip(&row).for_each(|(v, r)| *v -= factor * r);
        }
    }
    Some(wide.into_iter().map(|row| row[n..].to_vec()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light(illuminant: usize, scale: f64, forward: bool) -> DngLight {
        let rows = [[0.7, -0.2, -0.05], [-0.4, 1.3, 0.15], [-0.1, 0.2, 0.6]];
        DngLight {
            illuminant,
            camera_from_xyz: rows.map(|row| row.map(|v| v * scale)).to_vec(),
            xyz_d50_from_balanced: forward
                .then(|| [vec![0.6, 0.2, 0.16], vec![0.25, 0.7, 0.05], vec![0.01, 0.02, 0.79]]),
            calibration: (0..3).map(|i| (0..3).map(|j| f64::from(u8::from(i == j))).collect()).collect(),
        }
    }

    #[test]
    fn neutrals_and_whites_are_each_others() {
        let mut second = light(21, 1.0, false);
        second.camera_from_xyz[0][0] = 0.5;
        let color = DngColor { lights: vec![light(17, 1.0, false), second], analog_balance: vec![1.0, 0.9, 1.1] };
        for white in [[0.4476, 0.4074], [0.38, 0.377], [0.3127, 0.329], [0.28, 0.29]] {
            let neutral = color.neutral_of(white);
            let found = color.white_of(&neutral);
            assert!((found[0] - white[0]).abs() < 1e-6 && (found[1] - white[1]).abs() < 1e-6, "{white:?} {found:?}");
        }
    }

    #[test]
    fn a_color_of_known_xyz_comes_out_adapted() {
        // Without forward matrices the planes' inverse is exact: a color of the light's XYZ becomes its adapted sRGB.
        let color = DngColor { lights: vec![light(21, 1.0, false)], analog_balance: vec![1.0; 3] };
        let white = [0.345, 0.352];
        let neutral = color.neutral_of(white);
        let matrix = color.matrix(&neutral).unwrap();
        let xyz = Xyz([0.31, 0.24, 0.11]);
        let balanced: Vec<f64> = light(21, 1.0, false)
            .camera_from_xyz
            .iter()
            .zip(&neutral)
            .map(|(row, n)| row.iter().zip(xyz.0).map(|(m, v)| m * v).sum::<f64>() / n)
            .collect();
        let unit = Xyz::from_linear_srgb([1.0; 3]);
        // Through D50, as the specification has it; two steps of Bradford's adaptation are one.
        let wanted = adapt_bradford(xyz, xyz_of(white), unit).to_linear_srgb();
        for (found, wanted) in matrix.apply(&balanced).iter().zip(wanted) {
            assert!((found - wanted).abs() < 1e-6, "{found} {wanted}");
        }
    }

    #[test]
    fn forward_matrices_keep_neutrals_whatever_the_calibration() {
        let mut first = light(17, 1.0, true);
        first.calibration = vec![vec![1.02, 0.0, 0.0], vec![0.0, 1.0, 0.0], vec![0.0, 0.0, 0.97]];
        let color = DngColor { lights: vec![first, light(21, 0.9, true)], analog_balance: vec![1.0; 3] };
        for neutral in [[0.5, 1.0, 0.4], [0.9, 1.0, 0.3]] {
            for row in &color.matrix(&neutral).unwrap().rows {
                assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{row:?}");
            }
        }
    }

    #[test]
    fn four_planes_are_solved_by_least_squares() {
        let rows = vec![vec![1.0, 0.0, 0.0], vec![0.0, 1.0, 0.0], vec![0.0, 0.0, 1.0], vec![1.0, 1.0, 1.0]];
        let inverse = pseudo_inverse(&rows).unwrap();
        let seen: Vec<f64> = rows.iter().map(|row| dot(row, &[0.2, 0.3, 0.4])).collect();
        for (row, wanted) in inverse.iter().zip([0.2, 0.3, 0.4]) {
            assert!((dot(row, &seen) - wanted).abs() < 1e-12);
        }
        assert_eq!(pseudo_inverse(&[vec![1.0, 1.0], vec![1.0, 1.0]]), None);
    }
}
