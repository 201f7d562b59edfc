//! Lights and the reflectances of the 24-patch chart.

use serde::{Deserialize, Serialize};

use crate::{Observer, Spectrum, SpectrumError, WavelengthGrid};

// CIE 015 and CIE 191 tables as collected in colour-science 0.4.7 (BSD-3-Clause).
const ILLUMINANTS: &str = include_str!("../data/cie_illuminants_5nm.csv");
const DAYLIGHT_BASIS: &str = include_str!("../data/cie_daylight_basis.csv");
// Average of 30 charts measured by BabelColor (D. Pascale), as collected in colour-science 0.4.7.
const COLOR_CHECKER: &str = include_str!("../data/colorchecker_babelcolor_average.csv");

/// A light, by name or by temperature.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Illuminant {
    /// Incandescent light, CIE A.
    A,
    /// Horizon daylight, CIE D50.
    D50,
    /// CIE D55.
    D55,
    /// Noon daylight, CIE D65.
    D65,
    /// North-sky daylight, CIE D75.
    D75,
    /// Equal energy at every wavelength.
    E,
    /// Cool white fluorescent, CIE FL2.
    Fl2,
    /// Narrow-band fluorescent, CIE FL11.
    Fl11,
    /// Phosphor white LED of 4103 K, CIE LED-B3.
    LedB3,
    /// A black body of this temperature, K.
    Blackbody(f64),
    /// The daylight of this correlated colour temperature, 4000–25000 K.
    Daylight(f64),
}

impl Illuminant {
    /// The names that [`Illuminant::named`] takes.
    pub const NAMES: [&str; 9] = ["A", "D50", "D55", "D65", "D75", "E", "FL2", "FL11", "LED-B3"];

    /// Returns the light of a name, in any case.
    ///
    /// # Errors
    /// When no light has that name.
    pub fn named(name: &str) -> Result<Self, SpectrumError> {
        Ok(match name.to_ascii_uppercase().as_str() {
            "A" => Self::A,
            "D50" => Self::D50,
            "D55" => Self::D55,
            "D65" => Self::D65,
            "D75" => Self::D75,
            "E" => Self::E,
            "FL2" => Self::Fl2,
            "FL11" => Self::Fl11,
            "LED-B3" => Self::LedB3,
            _ => {
                return Err(SpectrumError::Unknown {
                    kind: "illuminant",
                    name: name.to_owned(),
                    known: Self::NAMES.join(", "),
                });
            }
        })
    }

    /// Returns the relative spectral power; the scale is that of its table (100 at 560 nm for most).
    pub fn spectrum(self) -> Spectrum {
        let table = |name| Spectrum::from_embedded_csv(ILLUMINANTS, name).expect("the embedded table has this column");
        match self {
            Self::A => blackbody(2855.5).scaled(100.0 / blackbody(2855.5).at_held(560.0)),
            Self::D50 => table("D50"),
            Self::D55 => table("D55"),
            Self::D65 => table("D65"),
            Self::D75 => table("D75"),
            Self::E => Spectrum::constant(100.0),
            Self::Fl2 => table("FL2"),
            Self::Fl11 => table("FL11"),
            Self::LedB3 => table("LED-B3"),
            Self::Blackbody(kelvin) => blackbody(kelvin),
            Self::Daylight(kelvin) => daylight(kelvin),
        }
    }

    /// Returns the radiance of a perfect white diffuser under this light, W m⁻² sr⁻¹ nm⁻¹ a band,
    /// at an illuminance in lux (luminance = illuminance / π).
    pub fn white_radiance(self, grid: &WavelengthGrid, illuminance_lux: f64) -> Vec<f64> {
        let spectrum = self.spectrum();
        // The luminance comes from the full 1 nm table, not from the caller's grid.
        let fine = WavelengthGrid::uniform(360.0, 830.0, 1.0).expect("a valid range");
        let luminance = Observer::Cie1931.xyz(&fine, &spectrum.sample_held(&fine)).luminance_cd_m2();
        let scale = illuminance_lux / std::f64::consts::PI / luminance;
        spectrum.sample_held(grid).iter().map(|v| v * scale).collect()
    }
}

/// Returns the spectral radiance of a black body, W m⁻² sr⁻¹ nm⁻¹, every 5 nm from 300 to 1100 nm.
///
/// Planck's law with c₂ = 1.438 776 877 × 10⁻² m K.
pub fn blackbody(kelvin: f64) -> Spectrum {
    const C1L: f64 = 1.191_042_972e-16; // 2 h c², W m² sr⁻¹
    const C2: f64 = 1.438_776_877e-2;
    let wavelengths_nm: Vec<f64> = (0..=160).map(|i| 300.0 + 5.0 * f64::from(i)).collect();
    let values = wavelengths_nm
        .iter()
        .map(|nm| {
            let m = nm * 1e-9;
            1e-9 * C1L / (m.powi(5) * (C2 / (m * kelvin)).exp_m1())
        })
        .collect();
    Spectrum::new(wavelengths_nm, values).expect("Planck's law is finite at a positive temperature")
}

/// Returns the CIE daylight of a correlated colour temperature, 100 at 560 nm (CIE 015:2018, 4.1.2).
///
/// The temperature is moved into 4000–25000 K, where the formulas hold.
pub fn daylight(kelvin: f64) -> Spectrum {
    let t = kelvin.clamp(4000.0, 25000.0);
    let x = if t <= 7000.0 {
        0.244_063 + 0.099_11e3 / t + 2.9678e6 / t.powi(2) - 4.6070e9 / t.powi(3)
    } else {
        0.237_040 + 0.247_48e3 / t + 1.9018e6 / t.powi(2) - 2.0064e9 / t.powi(3)
    };
    let y = -3.0 * x * x + 2.870 * x - 0.275;
    let m = 0.0241 + 0.2562 * x - 0.7341 * y;
    let m1 = (-1.3515 - 1.7703 * x + 5.9114 * y) / m;
    let m2 = (0.0300 - 31.4424 * x + 30.0717 * y) / m;
    let [s0, s1, s2] = ["S0", "S1", "S2"]
        .map(|name| Spectrum::from_embedded_csv(DAYLIGHT_BASIS, name).expect("the embedded table has this column"));
    let values = (0..s0.values().len()).map(|i| s0.values()[i] + m1 * s1.values()[i] + m2 * s2.values()[i]).collect();
    Spectrum::new(s0.wavelengths_nm().to_vec(), values).expect("the basis is finite")
}

/// Returns the names and reflectances of the 24 patches, row by row from dark skin to black.
pub fn color_checker_reflectances() -> Vec<(String, Spectrum)> {
    let header = COLOR_CHECKER.lines().next().expect("the embedded table has a header");
    header
        .split(',')
        .skip(1)
        .map(|name| {
            let spectrum = Spectrum::from_embedded_csv(COLOR_CHECKER, name).expect("the embedded table is whole");
            (name.to_owned(), spectrum)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    fn chromaticity(light: Illuminant) -> [f64; 2] {
        let grid = WavelengthGrid::uniform(380.0, 780.0, 5.0).unwrap();
        Observer::Cie1931.xyz(&grid, &light.spectrum().sample_held(&grid)).chromaticity()
    }

    #[test]
    fn chromaticities_are_those_of_cie_015() {
        for (light, x, y) in [
            (Illuminant::A, 0.44758, 0.40745),
            (Illuminant::D50, 0.34567, 0.35851),
            (Illuminant::D65, 0.31272, 0.32903),
            (Illuminant::Fl2, 0.37208, 0.37529),
            (Illuminant::Daylight(6504.0), 0.31272, 0.32903),
        ] {
            let [cx, cy] = chromaticity(light);
            // The published values come from 1 nm sums; 5 nm sums move them by up to 1e-4.
            assert_abs_diff_eq!(cx, x, epsilon = 1.5e-4);
            assert_abs_diff_eq!(cy, y, epsilon = 1.5e-4);
        }
    }

    #[test]
    fn every_name_names_a_light() {
        for name in Illuminant::NAMES {
            let light = Illuminant::named(&name.to_lowercase()).unwrap();
            assert!(light.spectrum().at_held(550.0) > 0.0);
        }
        assert!(Illuminant::named("D66").unwrap_err().to_string().contains("D65"));
    }

    #[test]
    fn white_under_a_thousand_lux_has_318_candela() {
        let grid = WavelengthGrid::uniform(360.0, 830.0, 1.0).unwrap();
        let white = Illuminant::D65.white_radiance(&grid, 1000.0);
        assert_abs_diff_eq!(Observer::Cie1931.xyz(&grid, &white).luminance_cd_m2(), 318.31, epsilon = 0.01);
    }

    #[test]
    fn the_chart_has_24_patches_and_its_white_is_white() {
        let chart = color_checker_reflectances();
        assert_eq!(chart.len(), 24);
        assert!(chart[18].1.at_held(550.0) > 0.85 && chart[23].1.at_held(550.0) < 0.04);
    }
}
