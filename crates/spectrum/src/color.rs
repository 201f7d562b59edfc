//! What an observer sees of a spectrum, and how far apart two colors are.

use std::sync::LazyLock;

use crate::{Spectrum, WavelengthGrid};

// CIE 018:2019 color-matching functions, 1 nm, as collected in colour-science 0.4.7 (BSD-3-Clause).
const CMF: &str = include_str!("../data/cie_cmf_1nm.csv");

/// Lumens a watt at the peak of V(λ) (SI, 683.002 for the CMF table).
const MAX_LUMINOUS_EFFICACY: f64 = 683.002;

static CIE1931: LazyLock<[Spectrum; 3]> = LazyLock::new(|| observer_table("cie1931"));
static CIE1964: LazyLock<[Spectrum; 3]> = LazyLock::new(|| observer_table("cie1964"));

fn observer_table(prefix: &str) -> [Spectrum; 3] {
    ["xbar", "ybar", "zbar"].map(|bar| {
        Spectrum::from_embedded_csv(CMF, &format!("{prefix}_{bar}")).expect("the embedded table has this column")
    })
}

/// A standard observer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Observer {
    /// The 2° observer of 1931.
    Cie1931,
    /// The 10° observer of 1964.
    Cie1964,
}

impl Observer {
    /// The color-matching functions x̄, ȳ, z̄.
    pub fn matching_functions(self) -> &'static [Spectrum; 3] {
        match self {
            Self::Cie1931 => &CIE1931,
            Self::Cie1964 => &CIE1964,
        }
    }

    /// Returns the weights w with X = Σ w\[0\]\[band\] value\[band\], and so on for Y and Z.
    ///
    /// Each is 683 × the mean of the matching function over the band × the width of the band, so that
    /// 10 and 20 nm grids keep the area under the curves.
    pub fn weights(self, grid: &WavelengthGrid) -> [Vec<f64>; 3] {
        self.matching_functions().each_ref().map(|bar| {
            grid.middles_nm()
                .into_iter()
                .zip(grid.widths_nm())
                .map(|(center, &width)| {
                    // The table is given every nanometer: a mean of points half a nanometer apart is exact to 1e-4.
                    let n = (2.0 * width).ceil().max(1.0) as usize;
                    let (first, last) = bar.range_nm();
                    // Of a band wider than all that is seen only the part within the table counts.
                    let place = |nm: f64| ((nm - center) / width + 0.5) * n as f64;
                    let range =
                        place(first).floor().max(0.0) as usize..place(last).ceil().clamp(0.0, n as f64) as usize;
                    let mean = range
                        .map(|i| bar.at_or_zero(center + width * ((i as f64 + 0.5) / n as f64 - 0.5)))
                        .sum::<f64>()
                        / n as f64;
                    MAX_LUMINOUS_EFFICACY * mean * width
                })
                .collect()
        })
    }

    /// Returns the tristimulus values of a spectrum, one value a band; Y is cd/m² for radiance, lux for irradiance.
    pub fn xyz(self, grid: &WavelengthGrid, values: &[f64]) -> Xyz {
        assert_eq!(values.len(), grid.len(), "one value a band");
        Xyz(self.weights(grid).map(|w| w.iter().zip(values).map(|(w, v)| w * v).sum()))
    }
}

/// Tristimulus values X, Y, Z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Xyz(pub [f64; 3]);

impl Xyz {
    /// The white of sRGB, D65 with Y = 1.
    pub const D65: Self = Self([0.950_47, 1.0, 1.088_83]);

    /// Y: luminance in cd/m² where the spectrum was a radiance.
    pub fn luminance_cd_m2(self) -> f64 {
        self.0[1]
    }

    /// The chromaticity x, y.
    pub fn chromaticity(self) -> [f64; 2] {
        let sum: f64 = self.0.iter().sum();
        [self.0[0] / sum, self.0[1] / sum]
    }

    /// Returns linear sRGB (IEC 61966-2-1), not clipped; white is Y = 1.
    pub fn to_linear_srgb(self) -> [f64; 3] {
        multiply(&SRGB_FROM_XYZ, self.0)
    }

    /// Returns the tristimulus values of linear sRGB.
    pub fn from_linear_srgb(rgb: [f64; 3]) -> Self {
        Self(multiply(&XYZ_FROM_SRGB, rgb))
    }

    /// Returns CIELAB relative to a white (CIE 015:2018, 8.2.1).
    pub fn to_lab(self, white: Self) -> Lab {
        let f = |t: f64| {
            if t > (6.0_f64 / 29.0).powi(3) { t.cbrt() } else { t * (29.0_f64 / 6.0).powi(2) / 3.0 + 4.0 / 29.0 }
        };
        let [fx, fy, fz] = [0, 1, 2].map(|i| f(self.0[i] / white.0[i]));
        Lab { l: 116.0 * fy - 16.0, a: 500.0 * (fx - fy), b: 200.0 * (fy - fz) }
    }
}

/// A color in CIELAB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lab {
    /// Lightness, 0–100.
    pub l: f64,
    /// Green to red.
    pub a: f64,
    /// Blue to yellow.
    pub b: f64,
}

// IEC 61966-2-1 primaries and D65, to the digits at which the two matrices are each other's inverse.
const SRGB_FROM_XYZ: [[f64; 3]; 3] = [
    [3.240_454_162_114_103, -1.537_138_512_797_716, -0.498_531_409_556_016],
    [-0.969_266_030_505_187, 1.876_010_845_446_694, 0.041_556_017_530_350],
    [0.055_643_430_959_115, -0.204_025_913_516_754, 1.057_225_188_223_179],
];
const XYZ_FROM_SRGB: [[f64; 3]; 3] = [
    [0.412_456_439_089_692, 0.357_576_077_643_909, 0.180_437_483_266_399],
    [0.212_672_851_405_623, 0.715_152_155_287_818, 0.072_174_993_306_560],
    [0.019_333_895_582_329, 0.119_192_025_881_303, 0.950_304_078_536_368],
];

fn multiply(matrix: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// Returns tristimulus values as they would be under another white (linear Bradford).
pub fn adapt_bradford(xyz: Xyz, from_white: Xyz, to_white: Xyz) -> Xyz {
    const CONE_FROM_XYZ: [[f64; 3]; 3] =
        [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];
    const XYZ_FROM_CONE: [[f64; 3]; 3] = [
        [0.986_992_905_466_7, -0.147_054_256_421, 0.159_962_651_663_7],
        [0.432_305_269_723_4, 0.518_360_271_536_8, 0.049_291_228_212_9],
        [-0.008_528_664_575_2, 0.040_042_821_654_1, 0.968_486_695_787_6],
    ];
    let from = multiply(&CONE_FROM_XYZ, from_white.0);
    let to = multiply(&CONE_FROM_XYZ, to_white.0);
    let cone = multiply(&CONE_FROM_XYZ, xyz.0);
    Xyz(multiply(&XYZ_FROM_CONE, [0, 1, 2].map(|i| cone[i] * to[i] / from[i])))
}

/// Returns the sRGB code, 0–1, of a linear value; values outside 0–1 are clipped.
pub fn srgb_encode(linear: f64) -> f64 {
    let v = linear.clamp(0.0, 1.0);
    if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

/// Returns the linear value, 0–1, of an sRGB code, 0–1.
pub fn srgb_decode(code: f64) -> f64 {
    if code <= 0.040_45 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
}

/// Returns the color difference ΔE₀₀ (CIE 142-2001, with k's of 1).
pub fn delta_e_2000(first: Lab, second: Lab) -> f64 {
    let c_mean7 = (0.5 * (first.a.hypot(first.b) + second.a.hypot(second.b))).powi(7);
    let g = 0.5 * (1.0 - (c_mean7 / (c_mean7 + 25.0_f64.powi(7))).sqrt());
    let (a1, a2) = ((1.0 + g) * first.a, (1.0 + g) * second.a);
    let (c1, c2) = (a1.hypot(first.b), a2.hypot(second.b));
    let hue_deg = |a: f64, b: f64| if a == 0.0 && b == 0.0 { 0.0 } else { b.atan2(a).to_degrees().rem_euclid(360.0) };
    let (h1, h2) = (hue_deg(a1, first.b), hue_deg(a2, second.b));
    let gray = c1 * c2 == 0.0;
    let dh_deg = match h2 - h1 {
        _ if gray => 0.0,
        d if d > 180.0 => d - 360.0,
        d if d < -180.0 => d + 360.0,
        d => d,
    };
    let dl = second.l - first.l;
    let dc = c2 - c1;
    let dh = 2.0 * (c1 * c2).sqrt() * (0.5 * dh_deg).to_radians().sin();
    let l_mean = 0.5 * (first.l + second.l);
    let c_mean = 0.5 * (c1 + c2);
    let h_mean = match h1 + h2 {
        sum if gray => sum,
        sum if (h1 - h2).abs() <= 180.0 => 0.5 * sum,
        sum if sum < 360.0 => 0.5 * (sum + 360.0),
        sum => 0.5 * (sum - 360.0),
    };
    let cos_deg = |deg: f64| deg.to_radians().cos();
    let t = 1.0 - 0.17 * cos_deg(h_mean - 30.0) + 0.24 * cos_deg(2.0 * h_mean) + 0.32 * cos_deg(3.0 * h_mean + 6.0)
        - 0.20 * cos_deg(4.0 * h_mean - 63.0);
    let d_theta = 30.0 * (-((h_mean - 275.0) / 25.0).powi(2)).exp();
    let rc = 2.0 * (c_mean.powi(7) / (c_mean.powi(7) + 25.0_f64.powi(7))).sqrt();
    let sl = 1.0 + 0.015 * (l_mean - 50.0).powi(2) / (20.0 + (l_mean - 50.0).powi(2)).sqrt();
    let (sc, sh) = (1.0 + 0.045 * c_mean, 1.0 + 0.015 * c_mean * t);
    let rt = -(2.0 * d_theta).to_radians().sin() * rc;
    let (l, c, h) = (dl / sl, dc / sc, dh / sh);
    (l * l + c * c + h * h + rt * c * h).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn delta_e_matches_the_published_pairs() {
        // Sharma, Wu & Dalal (2005), table 1, pairs 1, 7, 13, 17, 25 and 34.
        for (first, second, expected) in [
            ([50.0, 2.6772, -79.7751], [50.0, 0.0, -82.7485], 2.0425),
            ([50.0, 0.0, 0.0], [50.0, -1.0, 2.0], 2.3669),
            ([50.0, -0.0010, 2.4900], [50.0, 0.0009, -2.4900], 4.8045),
            ([50.0, 2.5, 0.0], [73.0, 25.0, -18.0], 27.1492),
            ([60.2574, -34.0099, 36.2677], [60.4626, -34.1751, 39.4387], 1.2644),
            ([2.0776, 0.0795, -1.1350], [0.9033, -0.0636, -0.5514], 0.9082),
        ] {
            let lab = |[l, a, b]: [f64; 3]| Lab { l, a, b };
            assert_abs_diff_eq!(delta_e_2000(lab(first), lab(second)), expected, epsilon = 5e-5);
        }
    }

    #[test]
    fn equal_energy_is_neutral_and_one_watt_at_555_nm_is_683_lumens() {
        let grid = WavelengthGrid::uniform(360.0, 830.0, 1.0).unwrap();
        let [x, y] = Observer::Cie1931.xyz(&grid, &vec![1.0; grid.len()]).chromaticity();
        assert_abs_diff_eq!(x, 1.0 / 3.0, epsilon = 1e-4);
        assert_abs_diff_eq!(y, 1.0 / 3.0, epsilon = 1e-4);
        let line = WavelengthGrid::new(vec![555.0]).unwrap();
        assert_abs_diff_eq!(Observer::Cie1931.xyz(&line, &[1.0]).0[1], 683.0, epsilon = 0.1);
    }

    #[test]
    fn a_coarse_grid_keeps_the_luminance() {
        let luminance = |step| {
            let grid = WavelengthGrid::uniform(380.0, 740.0, step).unwrap();
            Observer::Cie1931.xyz(&grid, &vec![1.0; grid.len()]).0[1]
        };
        assert_abs_diff_eq!(luminance(20.0) / luminance(1.0), 1.0, epsilon = 1e-3);
    }

    #[test]
    fn srgb_there_and_back() {
        for rgb in [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [0.2, 0.5, 0.9]] {
            let back = Xyz::from_linear_srgb(rgb).to_linear_srgb();
            for i in 0..3 {
                assert_abs_diff_eq!(back[i], rgb[i], epsilon = 1e-6);
                assert_abs_diff_eq!(srgb_decode(srgb_encode(rgb[i])), rgb[i], epsilon = 1e-7);
            }
        }
        for i in 0..3 {
            assert_abs_diff_eq!(Xyz::from_linear_srgb([1.0; 3]).0[i], Xyz::D65.0[i], epsilon = 1e-4);
        }
    }

    #[test]
    fn adapting_the_white_gives_the_other_white() {
        let a = Xyz([1.0985, 1.0, 0.3558]);
        for (got, want) in adapt_bradford(a, a, Xyz::D65).0.into_iter().zip(Xyz::D65.0) {
            assert_abs_diff_eq!(got, want, epsilon = 1e-6);
        }
    }
}
