//! The colors of a camera as a DNG file states them: matrices for one to three lights (DNG 1.6, chapter 6).

use dioptric_spectrum::{ColorTemperature, Illuminant, Xyz, adapt_bradford};
use serde::Serialize;

use super::{
    color::{D50_XY, xyz_of},
    file_look::ColorMap,
};
use crate::ColorMatrix;

/// The color matrices of a file, rows by its planes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DngColor {
    /// One for each calibration light, one to three.
    pub lights: Vec<DngLight>,
    /// The factor on each plane before the matrices (`AnalogBalance`).
    pub analog_balance: Vec<f64>,
}

/// What a file states for one light.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DngLight {
    /// The number of the light (Exif `LightSource`).
    pub illuminant: usize,
    /// The chromaticity of a light that the file describes itself (`IlluminantData`).
    pub white_xy: Option<[f64; 2]>,
    /// A row a plane: the plane's signal of X, Y and Z (`ColorMatrix`).
    pub camera_from_xyz: Vec<[f64; 3]>,
    /// For X, Y and Z under D50 the factor of each balanced plane (`ForwardMatrix`); `None` where the file has none.
    pub xyz_d50_from_balanced: Option<[Vec<f64>; 3]>,
    /// A row a plane: what this camera gives of what one of its model gives (`CameraCalibration`).
    pub calibration: Vec<Vec<f64>>,
    /// What is changed of colors by their hue, saturation and value (`ProfileHueSatMap`); `None` where the file has none.
    pub map: Option<ColorMap>,
}

impl DngLight {
    /// Returns the color temperature of the light, K; `None` where the file does not tell it.
    pub fn kelvin(&self) -> Option<f64> {
        match self.white_xy {
            Some(white) => Some(ColorTemperature::of_chromaticity(white).kelvin),
            None => kelvin_of(self.illuminant),
        }
    }

    /// Returns how far the light is from that of a black body (Duv).
    fn duv(&self) -> f64 {
        let standard = match self.illuminant {
            20 => Some(Illuminant::D55),
            21 => Some(Illuminant::D65),
            22 => Some(Illuminant::D75),
            23 => Some(Illuminant::D50),
            _ => None,
        };
        let white = self.white_xy.or_else(|| standard.map(|light| light.chromaticity()));
        white.map_or(0.0, |white| ColorTemperature::of_chromaticity(white).duv)
    }
}

/// Returns the color temperature of a light by its Exif number: the middle of its range where it has one, `None` where the number names none.
fn kelvin_of(number: usize) -> Option<f64> {
    Some(match number {
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
        1 | 4 | 9 | 20 => 5503.0,
        _ => return None,
    })
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

    /// Returns the share of each light in the matrices for a white; the first has all where the file tells the temperature of no other.
    fn shares(&self, white_xy: [f64; 2]) -> Vec<f64> {
        let known: Vec<(usize, f64)> =
            self.lights.iter().enumerate().filter_map(|(i, light)| Some((i, light.kelvin()?))).collect();
        let mut shares = vec![0.0; self.lights.len()];
        match known.as_slice() {
            [] => shares[0] = 1.0,
            &[(only, _)] => shares[only] = 1.0,
            &[(first, from_k), (second, to_k)] => {
                // By the inverse of the temperature, held to those of the lights.
                let mired = 1e6 / ColorTemperature::of_chromaticity(white_xy).kelvin;
                let [from, to] = [from_k, to_k].map(|kelvin| 1e6 / kelvin);
                let share = if from == to { 0.0 } else { ((mired - from) / (to - from)).clamp(0.0, 1.0) };
                (shares[first], shares[second]) = (1.0 - share, share);
            }
            several => {
                let white = ColorTemperature::of_chromaticity(white_xy);
                let [wx, wy] = place_of(white.kelvin, white.duv);
                for &(i, kelvin) in several {
                    let [x, y] = place_of(kelvin, self.lights[i].duv());
                    shares[i] = 1.0 / ((x - wx).powi(2) + (y - wy).powi(2) + 1e-8);
                }
                normalize(&mut shares);
                // What is far away does not count at all, and nothing jumps.
                shares.iter_mut().for_each(|share| {
                    let smooth = *share * *share * (3.0 - 2.0 * *share);
                    *share = ((smooth - 0.02) / 0.98).clamp(0.0, 1.0);
                });
                normalize(&mut shares);
            }
        }
        shares
    }

    /// Returns the matrices for a white.
    fn at(&self, white_xy: [f64; 2]) -> AtWhite {
        let shares = self.shares(white_xy);
        let mixed: Vec<(f64, &DngLight)> =
            shares.into_iter().zip(&self.lights).filter(|(share, _)| *share > 0.0).collect();
        let n = self.n_planes();
        let sum = |of: &dyn Fn(&DngLight) -> f64| mixed.iter().map(|(share, light)| share * of(light)).sum::<f64>();
        let forward = |i: usize, plane: usize| {
            sum(&|light| light.xyz_d50_from_balanced.as_ref().map_or(0.0, |rows| rows[i][plane]))
        };
        let all_forward = mixed.iter().all(|(_, light)| light.xyz_d50_from_balanced.is_some());
        AtWhite {
            camera_from_xyz: (0..n)
                .map(|plane| [0, 1, 2].map(|i| sum(&|light| light.camera_from_xyz[plane][i])))
                .collect(),
            xyz_d50_from_balanced: if all_forward {
                Some([0, 1, 2].map(|i| (0..n).map(|plane| forward(i, plane)).collect()))
            } else {
                mixed.iter().find_map(|(_, light)| light.xyz_d50_from_balanced.clone())
            },
            calibration: (0..n)
                .map(|plane| (0..n).map(|j| sum(&|light| light.calibration[plane][j])).collect())
                .collect(),
        }
    }

    /// Returns the map of hues, saturations and values for a neutral, if the file has any.
    pub(super) fn map(&self, neutral: &[f64]) -> Option<ColorMap> {
        let shares = self.shares(self.white_of(neutral));
        let maps = shares.into_iter().zip(&self.lights).filter_map(|(share, light)| Some((share, light.map.as_ref()?)));
        ColorMap::mixed(&maps.filter(|(share, _)| *share > 0.0).collect::<Vec<_>>())
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

/// Returns the place of a light among three: tint (a three-thousandth of Duv) over 200, and 1500 K over its temperature (DNG 1.6).
fn place_of(kelvin: f64, duv: f64) -> [f64; 2] {
    [-3000.0 * duv / 200.0, (1500.0 / kelvin).min(1.0)]
}

fn normalize(shares: &mut [f64]) {
    let sum: f64 = shares.iter().sum();
    shares.iter_mut().for_each(|share| *share /= sum);
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
            white_xy: None,
            camera_from_xyz: rows.map(|row| row.map(|v| v * scale)).to_vec(),
            xyz_d50_from_balanced: forward
                .then(|| [vec![0.6, 0.2, 0.16], vec![0.25, 0.7, 0.05], vec![0.01, 0.02, 0.79]]),
            calibration: (0..3).map(|i| (0..3).map(|j| f64::from(u8::from(i == j))).collect()).collect(),
            map: None,
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
    fn shares_are_those_of_the_whites_of_the_lights() {
        let of_lights = |lights: Vec<DngLight>| DngColor { lights, analog_balance: vec![1.0; 3] };
        let described = |xy: [f64; 2]| DngLight { white_xy: Some(xy), ..light(255, 1.0, false) };
        let (a, d65, fl11) = ([0.447_57, 0.407_45], [0.312_72, 0.329_03], [0.3805, 0.3769]);
        // A light that the file describes is one that it numbers.
        for white in [a, d65, fl11, [0.35, 0.36]] {
            let numbered = of_lights(vec![light(17, 1.0, false), light(21, 1.0, false)]).shares(white);
            let stated = of_lights(vec![described(a), described(d65)]).shares(white);
            assert!((numbered[0] - stated[0]).abs() < 1e-3, "{numbered:?} {stated:?}");
        }
        // One that it does not tell leaves the first alone.
        assert_eq!(of_lights(vec![light(255, 1.0, false), light(0, 1.0, false)]).shares(d65), [1.0, 0.0]);
        assert_eq!(of_lights(vec![light(255, 1.0, false), light(21, 1.0, false)]).shares(a), [0.0, 1.0]);
        // Of three each has its own white for itself, and shares always sum to 1.
        let three = of_lights(vec![described(a), described(d65), described(fl11)]);
        for (i, white) in [a, d65, fl11].into_iter().enumerate() {
            assert!(three.shares(white)[i] > 0.999, "{:?}", three.shares(white));
        }
        let between = three.shares([0.345, 0.352]);
        assert!((between.iter().sum::<f64>() - 1.0).abs() < 1e-12 && between[1] > between[0], "{between:?}");
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
