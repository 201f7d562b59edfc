//! Displays: what each of their primaries sends, how codes become light, and how far apart pixels are.

use dioptric_spectrum::{Display, Observer, Spectrum, WavelengthGrid, Xyz, adapt_bradford, srgb_decode};
use serde::{Deserialize, Serialize};

use crate::SceneError;

/// A display of three primaries, whose light adds up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DisplayModel {
    /// What to call it.
    pub name: String,
    /// Where the numbers come from.
    pub source: String,
    /// The spectral radiance of red, green and blue at full drive, W m⁻² sr⁻¹ nm⁻¹, or up to one factor where `white_cd_m2` says
    /// how bright white is.
    pub primaries: [Spectrum; 3],
    /// The luminance of white, cd/m²; left out, the primaries are absolute.
    #[serde(default)]
    pub white_cd_m2: Option<f64>,
    /// The luminance of a code of 0, cd/m², in the color of white; it is part of that of white.
    #[serde(default)]
    pub black_cd_m2: f64,
    /// From codes to drive.
    pub curve: DisplayCurve,
    /// The distance between pixels, µm; pixels are square.
    pub pixel_pitch_um: f64,
    /// What pixels are made of.
    #[serde(default)]
    pub pixels: PixelLayout,
}

/// From codes of 0–1 to the share of full drive.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum DisplayCurve {
    /// The curve of sRGB (IEC 61966-2-1).
    Srgb,
    /// A power: drive = code^exponent, as 2.2, or 2.4 (ITU-R BT.1886 with a black of 0).
    Gamma(f64),
    /// None: codes are drive.
    Linear,
    /// Tables of red, green and blue: the drive at codes that are evenly spaced from 0 to 1, in straight lines between them.
    Tables([Vec<f64>; 3]),
}

impl DisplayCurve {
    /// Returns the drive of a code of red (0), green (1) or blue (2); codes beyond 0–1 are clipped.
    pub fn decode(&self, primary: usize, code: f64) -> f64 {
        let code = code.clamp(0.0, 1.0);
        match self {
            Self::Srgb => srgb_decode(code),
            Self::Gamma(exponent) => code.powf(*exponent),
            Self::Linear => code,
            Self::Tables(tables) => {
                let table = &tables[primary];
                let at = code * (table.len() - 1) as f64;
                let below = (at as usize).min(table.len() - 2);
                let part = at - below as f64;
                (1.0 - part) * table[below] + part * table[below + 1]
            }
        }
    }
}

/// What a pixel is made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum PixelLayout {
    /// One even square of all three primaries.
    #[default]
    Even,
    /// Three upright stripes side by side: red, green, blue.
    Stripes,
}

impl PixelLayout {
    /// Returns how many samples a pixel needs along each side.
    pub fn samples(self) -> usize {
        match self {
            Self::Even => 1,
            Self::Stripes => 3,
        }
    }

    /// Returns the factor on a primary at a column of samples within a pixel.
    pub(crate) fn share(self, column: usize, primary: usize) -> f64 {
        match self {
            Self::Even => 1.0,
            Self::Stripes => {
                if column == primary {
                    3.0
                } else {
                    0.0
                }
            }
        }
    }
}

/// The wavelengths that ITU-R BT.2020 names for its primaries, nm, and the standard deviation of the bands about them.
const BANDS_NM: [f64; 3] = [630.0, 532.0, 467.0];
const BAND_DEVIATION_NM: f64 = 2.0;
/// D65, the white of all three systems.
const D65_XY: [f64; 2] = [0.3127, 0.3290];
/// The pitch of 96 pixels an inch, that of the reference pixel of CSS.
const REFERENCE_PITCH_UM: f64 = 25_400.0 / 96.0;
/// 218 pixels an inch, as Apple's data sheet has it.
const APPLE_STUDIO_PITCH_UM: f64 = 25_400.0 / 218.0;

impl DisplayModel {
    /// The names of the built-in displays.
    pub const NAMES: [&str; 4] = ["srgb", "display-p3", "rec2020", "apple-studio"];

    /// Returns a built-in display.
    ///
    /// `srgb`, `display-p3` and `rec2020` have the chromaticities that IEC 61966-2-1, SMPTE EG 432-1 with D65, and ITU-R BT.2020
    /// give; their light is of three bands of 2 nm about the wavelengths of BT.2020, mixed for each primary. `apple-studio` was measured.
    ///
    /// # Errors
    /// When none has that name.
    pub fn built_in(name: &str) -> Result<Self, SceneError> {
        let by_formula = |standard: &str, xy: [[f64; 2]; 3], white_cd_m2: f64, curve: DisplayCurve| Self {
            name: name.to_owned(),
            source: format!("{standard}; bands of 2 nm about 630, 532 and 467 nm, mixed to these chromaticities"),
            primaries: primaries_of(xy),
            white_cd_m2: Some(white_cd_m2),
            black_cd_m2: 0.0,
            curve,
            pixel_pitch_um: REFERENCE_PITCH_UM,
            pixels: PixelLayout::Even,
        };
        let (p3, rec2020) = ("SMPTE EG 432-1 with D65", "ITU-R BT.2020 and BT.1886");
        Ok(match name {
            // The reference display's luminance level (IEC 61966-2-1).
            "srgb" => by_formula("IEC 61966-2-1", [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]], 80.0, DisplayCurve::Srgb),
            "display-p3" => by_formula(p3, [[0.680, 0.320], [0.265, 0.690], [0.150, 0.060]], 80.0, DisplayCurve::Srgb),
            "rec2020" => {
                let xy = [[0.708, 0.292], [0.170, 0.797], [0.131, 0.046]];
                by_formula(rec2020, xy, 100.0, DisplayCurve::Gamma(2.4))
            }
            "apple-studio" => Self {
                name: name.to_owned(),
                source:
                    "measured, as collected in colour-science 0.4.7 (BSD-3-Clause); relative, with a white of 100 cd/m²"
                        .to_owned(),
                primaries: Display::apple_studio().primaries,
                white_cd_m2: Some(100.0),
                black_cd_m2: 0.0,
                curve: DisplayCurve::Srgb,
                pixel_pitch_um: APPLE_STUDIO_PITCH_UM,
                pixels: PixelLayout::Even,
            },
            _ => {
                return Err(SceneError::Setting {
                    what: "the display",
                    value: format!("'{name}'"),
                    expected: format!("a file, or one of {}", Self::NAMES.join(", ")),
                });
            }
        })
    }

    /// Checks that the numbers make sense.
    ///
    /// # Errors
    /// Names the number that does not.
    pub fn check(&self) -> Result<(), SceneError> {
        let wrong = |what: &'static str, value: f64, expected: &str| {
            Err(SceneError::Setting { what, value: format!("{value}"), expected: expected.to_owned() })
        };
        let is_positive = |value: f64| value > 0.0 && value.is_finite();
        if !is_positive(self.pixel_pitch_um) {
            return wrong("pixel_pitch_um of the display", self.pixel_pitch_um, "a number above 0");
        }
        match &self.curve {
            DisplayCurve::Gamma(exponent) if !is_positive(*exponent) => {
                return wrong("curve: Gamma of the display", *exponent, "a number above 0");
            }
            DisplayCurve::Tables(tables) => {
                if let Some(short) = tables.iter().find(|table| table.len() < 2) {
                    return wrong("the numbers in a table of the display", short.len() as f64, "two or more");
                }
                let is_drive = |drive: &&f64| (0.0..=1.0 + 1e-6).contains(*drive);
                if let Some(drive) = tables.iter().flatten().find(|drive| !is_drive(drive)) {
                    return wrong("a drive in a table of the display", *drive, "a number from 0 to 1");
                }
            }
            _ => {}
        }
        if let Some(white) = self.white_cd_m2
            && !is_positive(white)
        {
            return wrong("white_cd_m2 of the display", white, "a number above 0");
        }
        let dark = self.primaries.iter().flat_map(Spectrum::values).find(|v| !(**v >= 0.0 && v.is_finite()));
        if let Some(dark) = dark {
            return wrong("a primary of the display", *dark, "numbers of 0 or more");
        }
        let white = self.white_xyz().0[1];
        if !is_positive(white) {
            return wrong("the luminance of the display's primaries", white, "some light");
        }
        if !(0.0..white).contains(&self.black_cd_m2) {
            return wrong("black_cd_m2 of the display", self.black_cd_m2, "0 or more, and less than white");
        }
        Ok(())
    }

    /// Returns the tristimulus values of each primary at full drive, Y in cd/m².
    pub fn primaries_xyz(&self) -> [Xyz; 3] {
        let grid = fine();
        let xyz = self.primaries.each_ref().map(|p| Observer::Cie1931.xyz(&grid, &p.sample_or_zero(&grid)));
        let sum: f64 = xyz.iter().map(|xyz| xyz.0[1]).sum();
        let factor = self.white_cd_m2.map_or(1.0, |white| white / sum);
        xyz.map(|xyz| Xyz(xyz.0.map(|v| v * factor)))
    }

    /// Returns the tristimulus values of white, Y in cd/m².
    pub fn white_xyz(&self) -> Xyz {
        let [r, g, b] = self.primaries_xyz();
        Xyz([0, 1, 2].map(|i| r.0[i] + g.0[i] + b.0[i]))
    }

    /// Returns the radiance of each primary at full drive in the bands of a grid, of the same tristimulus values as the model's own
    /// spectra have, as far as light that is nowhere negative has them.
    ///
    /// # Errors
    /// When the bands do not tell the primaries apart.
    pub fn primaries_on(&self, grid: &WavelengthGrid) -> Result<[Vec<f64>; 3], SceneError> {
        let sampled = self.primaries.each_ref().map(|primary| primary.band_means(grid));
        let found = sampled.each_ref().map(|values| Observer::Cie1931.xyz(grid, values).0);
        let wanted = self.primaries_xyz();
        let inverse = inverse_of_columns(found).ok_or_else(|| SceneError::Setting {
            what: "the bands of a display's light",
            value: format!("{} from {:?} nm", grid.len(), grid.range_nm()),
            expected: "bands that tell its three primaries apart, as 400:700:10".to_owned(),
        })?;
        Ok(wanted.map(|xyz| {
            let shares = inverse.map(|row| (0..3).map(|j| row[j] * xyz.0[j]).sum::<f64>());
            (0..grid.len()).map(|band| (0..3).map(|p| shares[p] * sampled[p][band]).sum::<f64>().max(0.0)).collect()
        }))
    }

    /// Returns the share of full drive of each code, black being lifted to its luminance.
    pub fn drive(&self, codes: [f64; 3]) -> [f64; 3] {
        let black = self.black_cd_m2 / self.white_xyz().0[1];
        [0, 1, 2].map(|primary| black + (1.0 - black) * self.curve.decode(primary, codes[primary]))
    }

    /// Returns the matrix from drive to linear sRGB as an eye sees it that takes the display's white for white.
    pub fn srgb_from_drive(&self) -> [[f64; 3]; 3] {
        let white = self.white_xyz();
        let unit = |xyz: Xyz| Xyz(xyz.0.map(|v| v / white.0[1]));
        let to = Xyz::from_linear_srgb([1.0; 3]);
        let columns = self.primaries_xyz().map(|xyz| adapt_bradford(unit(xyz), unit(white), to).to_linear_srgb());
        [0, 1, 2].map(|i| columns.map(|column| column[i]))
    }

    /// Returns the pixels a degree at a distance, m.
    pub fn pixels_per_degree(&self, distance_m: f64) -> f64 {
        // One degree about the axis.
        2.0 * distance_m * 0.5_f64.to_radians().tan() / (1e-6 * self.pixel_pitch_um)
    }
}

fn fine() -> WavelengthGrid {
    WavelengthGrid::uniform(360.0, 830.0, 1.0).expect("a valid range")
}

/// Returns primaries of these chromaticities whose sum is D65: mixtures of three narrow bands, without what would be negative.
fn primaries_of(xy: [[f64; 2]; 3]) -> [Spectrum; 3] {
    let grid = fine();
    let bands = BANDS_NM.map(|center_nm| -> Vec<f64> {
        let value = |nm: &f64| (-0.5 * ((nm - center_nm) / BAND_DEVIATION_NM).powi(2)).exp();
        grid.centers_nm().iter().map(value).collect()
    });
    let of_bands = bands.each_ref().map(|band| Observer::Cie1931.xyz(&grid, band).0);
    let from_xyz = inverse_of_columns(of_bands).expect("three bands of different colors");
    let wanted = xy.map(xyz_of);
    // How much of each primary makes white.
    let shares = inverse_of_columns(wanted).expect("three different chromaticities");
    let white = xyz_of(D65_XY);
    [0, 1, 2].map(|primary| {
        let luminance: f64 = (0..3).map(|j| shares[primary][j] * white[j]).sum();
        let mixture = from_xyz.map(|row| (0..3).map(|j| row[j] * wanted[primary][j] * luminance).sum::<f64>().max(0.0));
        let values = (0..grid.len()).map(|i| (0..3).map(|band| mixture[band] * bands[band][i]).sum()).collect();
        Spectrum::new(grid.centers_nm().to_vec(), values).expect("a value a wavelength")
    })
}

fn xyz_of([x, y]: [f64; 2]) -> [f64; 3] {
    [x / y, 1.0, (1.0 - x - y) / y]
}

/// Returns the inverse, as rows, of the matrix with these columns; `None` where there is none.
fn inverse_of_columns([a, b, c]: [[f64; 3]; 3]) -> Option<[[f64; 3]; 3]> {
    let cross =
        |u: [f64; 3], v: [f64; 3]| [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let length = |u: [f64; 3]| u.iter().map(|v| v * v).sum::<f64>().sqrt();
    let bc = cross(b, c);
    let determinant: f64 = (0..3).map(|i| a[i] * bc[i]).sum();
    let is_invertible = determinant.abs() > 1e-9 * length(a) * length(b) * length(c);
    is_invertible.then(|| [bc, cross(c, a), cross(a, b)].map(|row| row.map(|v| v / determinant)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn built_in_displays_have_the_chromaticities_of_their_standards() {
        for (name, xy) in [
            ("srgb", [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]]),
            ("display-p3", [[0.680, 0.320], [0.265, 0.690], [0.150, 0.060]]),
            ("rec2020", [[0.708, 0.292], [0.170, 0.797], [0.131, 0.046]]),
        ] {
            let display = DisplayModel::built_in(name).unwrap();
            display.check().unwrap();
            for (found, wanted) in display.primaries_xyz().map(|xyz| xyz.chromaticity()).iter().zip(xy) {
                // Bands of 2 nm are a little inside the spectral locus, on which the primaries of BT.2020 lie; the red of Display P3
                // has no Z at all.
                assert!((0..2).all(|i| (found[i] - wanted[i]).abs() < 2e-3), "{name}: {found:?} {wanted:?}");
            }
            let white = display.white_xyz();
            assert!((white.0[1] - display.white_cd_m2.unwrap()).abs() < 1e-9);
            assert!((0..2).all(|i| (white.chromaticity()[i] - D65_XY[i]).abs() < 1e-3), "{name}: {white:?}");
        }
        let message = DisplayModel::built_in("lcd").unwrap_err().to_string();
        assert!(message.contains("'lcd'") && message.contains("display-p3"), "{message}");
    }

    #[test]
    fn coarse_bands_keep_the_colors() {
        for name in DisplayModel::NAMES {
            let display = DisplayModel::built_in(name).unwrap();
            for step_nm in [1.0, 5.0, 10.0, 20.0] {
                let grid = WavelengthGrid::uniform(400.0, 700.0, step_nm).unwrap();
                let on = display.primaries_on(&grid).unwrap();
                let most = if step_nm > 10.0 { 0.06 } else { 0.02 };
                for (values, wanted) in on.iter().zip(display.primaries_xyz()) {
                    let found = Observer::Cie1931.xyz(&grid, values);
                    let off = (0..3).map(|i| (found.0[i] - wanted.0[i]).abs()).fold(0.0, f64::max);
                    // Of the luminance of white; what would be negative is left out, most with single lines in wide bands.
                    assert!(off < most * display.white_xyz().0[1], "{name}, {step_nm} nm: {found:?} {wanted:?}");
                }
            }
        }
        let two = WavelengthGrid::new(vec![500.0, 600.0]).unwrap();
        assert!(DisplayModel::built_in("srgb").unwrap().primaries_on(&two).is_err());
    }

    #[test]
    fn an_srgb_picture_on_an_srgb_display_is_itself() {
        let display = DisplayModel::built_in("srgb").unwrap();
        let codes = [0.7, 0.4, 0.2];
        let drive = display.drive(codes);
        let seen = display.srgb_from_drive().map(|row| (0..3).map(|j| row[j] * drive[j]).sum::<f64>());
        for (seen, code) in seen.iter().zip(codes) {
            assert!((seen - srgb_decode(code)).abs() < 2e-3, "{seen} {code}");
        }
        // The same codes on wider primaries are more colorful.
        let wide = DisplayModel::built_in("rec2020").unwrap();
        let red = wide.srgb_from_drive().map(|row| row[0]);
        assert!(red[0] > 1.2 && red[1] < 0.0, "{red:?}");
    }

    #[test]
    fn black_is_lifted_and_white_stays() {
        let display = DisplayModel { black_cd_m2: 0.8, ..DisplayModel::built_in("srgb").unwrap() };
        assert!((display.drive([0.0; 3])[0] - 0.01).abs() < 1e-12 && (display.drive([1.0; 3])[1] - 1.0).abs() < 1e-12);
        for wrong in [
            DisplayModel { black_cd_m2: 80.0, ..display.clone() },
            DisplayModel { pixel_pitch_um: 0.0, ..display.clone() },
            DisplayModel { curve: DisplayCurve::Gamma(f64::NAN), ..display.clone() },
            DisplayModel { white_cd_m2: Some(-1.0), ..display.clone() },
        ] {
            assert!(wrong.check().is_err());
        }
    }

    #[test]
    fn pixels_a_degree_follow_pitch_and_distance() {
        // The reference pixel of CSS is seen at an arm's length of 28 inches under 0.0213 degrees.
        let display = DisplayModel::built_in("srgb").unwrap();
        assert!((1.0 / display.pixels_per_degree(0.0254 * 28.0) - 0.0213).abs() < 1e-4);
    }
}
