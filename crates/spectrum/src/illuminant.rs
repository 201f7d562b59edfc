//! Lights and the reflectances of the 24-patch chart.

use std::sync::LazyLock;

use serde::{Deserialize, Serialize};

use crate::{Observer, Spectrum, SpectrumError, WavelengthGrid, Xyz};

// CIE 015 and CIE 191 tables as collected in colour-science 0.4.7 (BSD-3-Clause).
const ILLUMINANTS: &str = include_str!("../data/cie_illuminants_5nm.csv");
const DAYLIGHT_BASIS: &str = include_str!("../data/cie_daylight_basis.csv");
// Average of 30 charts measured by BabelColor (D. Pascale), as collected in colour-science 0.4.7.
const COLOR_CHECKER: &str = include_str!("../data/colorchecker_babelcolor_average.csv");

/// A light, by name, by temperature, by chromaticity or by its measured spectrum.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
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
    /// The daylight of this correlated color temperature, 4000–25000 K.
    Daylight(f64),
    /// A smooth light of this chromaticity of the 1931 observer.
    ///
    /// It is the black body (below 5000 K) or the daylight of the nearest color temperature times exp(a t + b t²), t
    /// being the wavelength from 550 nm in units of 150 nm, held beyond ±1.2.
    Chromaticity {
        /// x.
        x: f64,
        /// y.
        y: f64,
    },
    /// A measured relative spectral power; beyond its table the end values are held.
    Spectrum(Spectrum),
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

    /// Returns the light of a name (in any case), of a temperature (`3200K`) or of a chromaticity (`0.46,0.414`).
    ///
    /// A temperature is that of a black body below 5000 K, and of a daylight from there on.
    ///
    /// # Errors
    /// When the text is none of these, or names a light that [`check`](Self::check) refuses.
    pub fn parse(text: &str) -> Result<Self, SpectrumError> {
        let kelvin = text.strip_suffix(['K', 'k']).and_then(|number| number.trim().parse().ok());
        let point = || {
            let (x, y) = text.split_once(',')?;
            Some(Self::Chromaticity { x: x.trim().parse().ok()?, y: y.trim().parse().ok()? })
        };
        let light = match kelvin {
            Some(kelvin) => Self::of_temperature(kelvin),
            None => point().map_or_else(|| Self::named(text), Ok)?,
        };
        light.check().map(|()| light)
    }

    /// Returns the black body of a temperature below 5000 K, and the daylight of a temperature from there on.
    pub fn of_temperature(kelvin: f64) -> Self {
        if kelvin < DAYLIGHT_FROM_K { Self::Blackbody(kelvin) } else { Self::Daylight(kelvin) }
    }

    /// Checks that there can be such a light.
    ///
    /// # Errors
    /// When a temperature is not 500–100 000 K (black body) or 4000–25 000 K (daylight), no smooth light has the
    /// chromaticity, or a spectrum has a negative value or none above 0.
    pub fn check(&self) -> Result<(), SpectrumError> {
        let within = |what, kelvin: f64, least: f64, most: f64| match (least..=most).contains(&kelvin) {
            true => Ok(()),
            false => Err(SpectrumError::Light {
                what,
                found: format!("{kelvin} K"),
                expected: format!("{least} to {most} K"),
            }),
        };
        match self {
            Self::Blackbody(kelvin) => within("the temperature of a black body", *kelvin, 500.0, 100_000.0),
            Self::Daylight(kelvin) => within("the temperature of a daylight", *kelvin, 4000.0, 25_000.0),
            Self::Chromaticity { x, y } => {
                let wrong = || SpectrumError::Light {
                    what: "the chromaticity of a light",
                    found: format!("{x}, {y}"),
                    expected: "x, y of a whitish light".to_owned(),
                };
                if !(*x > 0.0 && *y > 0.0 && x + y < 1.0) {
                    return Err(wrong());
                }
                let [cx, cy] = self.chromaticity();
                // A thousandth is less than an eye sees.
                if (cx - x).hypot(cy - y) < 1e-3 { Ok(()) } else { Err(wrong()) }
            }
            Self::Spectrum(spectrum) => {
                let negative = spectrum.values().iter().copied().find(|v| *v < 0.0);
                let wrong = negative.or(spectrum.values().iter().all(|v| *v == 0.0).then_some(0.0));
                wrong.map_or(Ok(()), |value| {
                    Err(SpectrumError::Light {
                        what: "the spectrum of a light",
                        found: value.to_string(),
                        expected: "values of 0 or more, one above 0".to_owned(),
                    })
                })
            }
            _ => Ok(()),
        }
    }

    /// Returns the chromaticity x, y for the 1931 observer.
    pub fn chromaticity(&self) -> [f64; 2] {
        Observer::Cie1931.xyz(&visible(), &self.on_bands(&visible())).chromaticity()
    }

    /// Returns the correlated color temperature.
    pub fn color_temperature(&self) -> ColorTemperature {
        ColorTemperature::of_chromaticity(self.chromaticity())
    }

    /// Returns the relative spectral power; the scale is that of its table (100 at 560 nm for most).
    ///
    /// From 830 nm to 2500 nm, where no table reaches, daylights go on as a black body of 5800 K does (within some tens of percent of
    /// sunlight between the bands of water), black bodies by Planck's law, and fluorescent lights and LEDs have nothing.
    pub fn spectrum(&self) -> Spectrum {
        let table = |name| Spectrum::from_embedded_csv(ILLUMINANTS, name).expect("the embedded table has this column");
        let infrared = |kelvin: f64| move |nm: f64| planck(nm, kelvin) / planck(TABLES_END_NM, kelvin);
        let spectrum = match self {
            Self::A => blackbody(2855.5).scaled(100.0 / blackbody(2855.5).at_held(560.0)),
            Self::D50 => table("D50"),
            Self::D55 => table("D55"),
            Self::D65 => table("D65"),
            Self::D75 => table("D75"),
            Self::E => Spectrum::constant(100.0),
            Self::Fl2 => table("FL2"),
            Self::Fl11 => table("FL11"),
            Self::LedB3 => table("LED-B3"),
            Self::Blackbody(kelvin) => blackbody(*kelvin),
            Self::Daylight(kelvin) => daylight(*kelvin),
            Self::Chromaticity { x, y } => of_chromaticity([*x, *y]),
            Self::Spectrum(spectrum) => spectrum.clone(),
        };
        match self {
            Self::D50 | Self::D55 | Self::D65 | Self::D75 | Self::Daylight(_) => beyond(spectrum, infrared(SUN_K)),
            // Its own temperature where it is a black body's.
            Self::Chromaticity { .. } => {
                let kelvin = self.base_kelvin();
                beyond(spectrum, infrared(if kelvin < DAYLIGHT_FROM_K { kelvin } else { SUN_K }))
            }
            Self::Fl2 | Self::Fl11 | Self::LedB3 => beyond(spectrum, |_| 0.0),
            Self::A | Self::E | Self::Blackbody(_) | Self::Spectrum(_) => spectrum,
        }
    }

    /// Returns the color temperature that a light of a chromaticity starts from.
    fn base_kelvin(&self) -> f64 {
        match self {
            Self::Chromaticity { x, y } => ColorTemperature::of_chromaticity([*x, *y]).kelvin,
            _ => SUN_K,
        }
    }

    /// Returns the radiance of a perfect white diffuser under this light, W m⁻² sr⁻¹ nm⁻¹ a band,
    /// at an illuminance in lux (luminance = illuminance / π).
    pub fn white_radiance(&self, grid: &WavelengthGrid, illuminance_lux: f64) -> Vec<f64> {
        // The luminance comes from the full 1 nm table, not from the caller's grid.
        let fine = WavelengthGrid::uniform(360.0, 830.0, 1.0).expect("a valid range");
        let luminance = Observer::Cie1931.xyz(&fine, &self.on_bands(&fine)).luminance_cd_m2();
        let scale = illuminance_lux / std::f64::consts::PI / luminance;
        self.on_bands(grid).iter().map(|v| v * scale).collect()
    }

    /// Returns its relative power, in each band: means where it has lines, or may have, that fall between the centers of bands, and of bands
    /// that are wider than the 10 nm by which daylight is known (CIE 015:2018, 4.1.2).
    pub fn on_bands(&self, grid: &WavelengthGrid) -> Vec<f64> {
        const DAYLIGHT_STEP_NM: f64 = 10.0;
        let has_lines = matches!(self, Self::Fl2 | Self::Fl11 | Self::LedB3 | Self::Spectrum(_));
        if has_lines || grid.widths_nm().iter().any(|width| *width > DAYLIGHT_STEP_NM + 1e-9) {
            return self.spectrum().band_means_held(grid);
        }
        self.spectrum().sample_held(grid)
    }

    /// Returns what is said of bands beyond a light's table, where there are any.
    pub fn note_beyond_table(&self, grid: &WavelengthGrid) -> Option<String> {
        let Self::Spectrum(spectrum) = self else { return None };
        let ((first, last), (from, to)) = (grid.range_nm(), spectrum.range_nm());
        let is_beyond = first < from || last > to;
        is_beyond.then(|| format!("the light is known from {from} to {to} nm; beyond, its end values are held"))
    }
}

/// Where the tables of lights end, and up to where they are continued, nm.
const TABLES_END_NM: f64 = 830.0;
const INFRARED_END_NM: f64 = 2500.0;
/// The temperature of a black body that sunlight in the infrared is like.
const SUN_K: f64 = 5800.0;

/// Returns a table continued by what a light is relative to its last value, which is held up to the end of tables.
fn beyond(table: Spectrum, ratio: impl Fn(f64) -> f64) -> Spectrum {
    const STEP_NM: f64 = 10.0;
    let (mut wavelengths_nm, mut values) = (table.wavelengths_nm().to_vec(), table.values().to_vec());
    let last = values[values.len() - 1];
    if table.range_nm().1 < TABLES_END_NM {
        wavelengths_nm.push(TABLES_END_NM);
        values.push(last);
    }
    let n = ((INFRARED_END_NM - TABLES_END_NM) / STEP_NM) as usize;
    for nm in (1..=n).map(|i| TABLES_END_NM + STEP_NM * i as f64) {
        wavelengths_nm.push(nm);
        values.push(last * ratio(nm));
    }
    Spectrum::new(wavelengths_nm, values).expect("wavelengths ascend")
}

/// Where the CIE turns from black bodies to daylights as reference lights (CIE 13.3), K.
const DAYLIGHT_FROM_K: f64 = 5000.0;

/// The bands on which lights are compared, every 5 nm.
fn visible() -> WavelengthGrid {
    WavelengthGrid::uniform(360.0, 830.0, 5.0).expect("a valid range")
}

/// A correlated color temperature: that of the black body whose color is nearest, in CIE 1960 u, v.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ColorTemperature {
    /// The temperature, K; moved into 1000–40 000.
    pub kelvin: f64,
    /// How far the color lies from that of the black body (Duv); above 0 on the green side.
    pub duv: f64,
}

impl ColorTemperature {
    /// Returns the correlated color temperature of a chromaticity x, y (CIE 15:2018, 9.5).
    pub fn of_chromaticity(xy: [f64; 2]) -> Self {
        let weights = Observer::Cie1931.weights(&visible());
        let grid = visible();
        let planckian = |mired: f64| {
            let values: Vec<f64> = grid.centers_nm().iter().map(|&nm| planck(nm, 1e6 / mired)).collect();
            let xyz = weights.each_ref().map(|w| w.iter().zip(&values).map(|(w, v)| w * v).sum::<f64>());
            uv(Xyz(xyz).chromaticity())
        };
        let wanted = uv(xy);
        let distance = |mired: f64| {
            let [u, v] = planckian(mired);
            (u - wanted[0]).hypot(v - wanted[1])
        };
        // The nearest of steps of 15 mired, then its surroundings by golden section.
        const STEP: f64 = 15.0;
        let nearest = (0..=65).map(|i| 25.0 + STEP * f64::from(i)).min_by(|a, b| distance(*a).total_cmp(&distance(*b)));
        let nearest = nearest.expect("there are steps");
        let (mut low, mut high) = ((nearest - STEP).max(25.0), (nearest + STEP).min(1000.0));
        let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
        while high - low > 1e-4 {
            let (a, b) = (high - golden * (high - low), low + golden * (high - low));
            if distance(a) < distance(b) { high = b } else { low = a }
        }
        let mired = 0.5 * (low + high);
        let [_, v] = planckian(mired);
        Self { kelvin: 1e6 / mired, duv: distance(mired).copysign(wanted[1] - v) }
    }
}

/// Returns CIE 1960 u, v of a chromaticity x, y.
fn uv([x, y]: [f64; 2]) -> [f64; 2] {
    let denominator = -2.0 * x + 12.0 * y + 3.0;
    [4.0 * x / denominator, 6.0 * y / denominator]
}

/// Returns the spectrum of [`Illuminant::Chromaticity`].
fn of_chromaticity(wanted: [f64; 2]) -> Spectrum {
    let kelvin = ColorTemperature::of_chromaticity(wanted).kelvin;
    let base = Illuminant::of_temperature(kelvin).spectrum();
    let grid = WavelengthGrid::uniform(300.0, 830.0, 5.0).expect("a valid range");
    let base = base.sample_held(&grid);
    let tilted = |[a, b]: [f64; 2]| -> Vec<f64> {
        let factor = |nm: &f64| {
            let t = ((nm - 550.0) / 150.0).clamp(-1.2, 1.2);
            (a * t + b * t * t).exp()
        };
        grid.centers_nm().iter().map(factor).zip(&base).map(|(f, s)| f * s).collect()
    };
    let weights = Observer::Cie1931.weights(&grid);
    let miss = |p: [f64; 2]| {
        let values = tilted(p);
        let xyz = weights.each_ref().map(|w| w.iter().zip(&values).map(|(w, v)| w * v).sum::<f64>());
        let [x, y] = Xyz(xyz).chromaticity();
        [x - wanted[0], y - wanted[1]]
    };
    // Newton's method; steps are held so that a far chromaticity does not overflow.
    const STEP: f64 = 1e-5;
    let mut p = [0.0; 2];
    for _ in 0..40 {
        let now = miss(p);
        let slopes = [0, 1].map(|i| {
            let mut moved = p;
            moved[i] += STEP;
            let next = miss(moved);
            [(next[0] - now[0]) / STEP, (next[1] - now[1]) / STEP]
        });
        let determinant = slopes[0][0] * slopes[1][1] - slopes[1][0] * slopes[0][1];
        if determinant.abs() < 1e-12 {
            break;
        }
        let step = [
            (now[1] * slopes[1][0] - now[0] * slopes[1][1]) / determinant,
            (now[0] * slopes[0][1] - now[1] * slopes[0][0]) / determinant,
        ];
        for (p, step) in p.iter_mut().zip(step) {
            *p = (*p + step.clamp(-1.0, 1.0)).clamp(-20.0, 20.0);
        }
        if step[0].hypot(step[1]) < 1e-10 {
            break;
        }
    }
    Spectrum::new(grid.centers_nm().to_vec(), tilted(p)).expect("exponentials of held numbers are finite")
}

/// Returns the spectral radiance of a black body at one wavelength, W m⁻² sr⁻¹ nm⁻¹ (Planck's law).
pub fn planck(wavelength_nm: f64, kelvin: f64) -> f64 {
    const C1L: f64 = 1.191_042_972e-16; // 2 h c², W m² sr⁻¹
    const C2: f64 = 1.438_776_877e-2;
    let m = wavelength_nm * 1e-9;
    1e-9 * C1L / (m.powi(5) * (C2 / (m * kelvin)).exp_m1())
}

/// Returns the spectral radiance of a black body, W m⁻² sr⁻¹ nm⁻¹, every 5 nm from 300 to 2500 nm.
///
/// Planck's law with c₂ = 1.438 776 877 × 10⁻² m K.
pub fn blackbody(kelvin: f64) -> Spectrum {
    let wavelengths_nm: Vec<f64> = (0..=440).map(|i| 300.0 + 5.0 * f64::from(i)).collect();
    let values = wavelengths_nm.iter().map(|&nm| planck(nm, kelvin)).collect();
    Spectrum::new(wavelengths_nm, values).expect("Planck's law is finite at a positive temperature")
}

/// Returns the largest spectral radiance of a black body at any wavelength, W m⁻² sr⁻¹ nm⁻¹: that at 2.897 771 955 mm K / T (Wien's
/// displacement law).
pub fn blackbody_peak(kelvin: f64) -> f64 {
    planck(2.897_771_955e6 / kelvin, kelvin)
}

/// Returns the CIE daylight of a correlated color temperature, 100 at 560 nm (CIE 015:2018, 4.1.2).
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
    static PATCHES: LazyLock<Vec<(String, Spectrum)>> = LazyLock::new(|| {
        let header = COLOR_CHECKER.lines().next().expect("the embedded table has a header");
        let patch = |name: &str| {
            let spectrum = Spectrum::from_embedded_csv(COLOR_CHECKER, name).expect("the embedded table is whole");
            (name.to_owned(), spectrum)
        };
        header.split(',').skip(1).map(patch).collect()
    });
    PATCHES.clone()
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
    fn lights_go_on_in_the_infrared() {
        let at = |light: &Illuminant, nm: f64| light.spectrum().at_held(nm);
        for light in [Illuminant::D50, Illuminant::D65, Illuminant::Daylight(6500.0)] {
            let ratio = at(&light, 1700.0) / at(&light, 830.0);
            // Planck's law at 5800 K: λ⁻⁵ / (exp(c₂ / λT) − 1).
            let planck = |um: f64| um.powi(-5) / ((14_387.77 / (um * 5800.0)).exp() - 1.0);
            assert!((ratio / (planck(1.7) / planck(0.83)) - 1.0).abs() < 2e-3, "{ratio}");
        }
        let a = Illuminant::A;
        assert!(at(&a, 1600.0) < at(&a, 1000.0) && at(&a, 2500.0) > 0.2 * at(&a, 1000.0));
        for light in [Illuminant::Fl2, Illuminant::Fl11, Illuminant::LedB3] {
            assert_eq!(at(&light, 900.0), 0.0);
        }
        assert_eq!(at(&Illuminant::E, 2000.0), 100.0);
    }

    #[test]
    fn color_temperatures_are_those_of_the_tables() {
        // CIE 15:2018 gives D65 6504 K and D50 5003 K; A is a black body of 2856 K; FL2 4230 K, FL11 4000 K.
        for (light, kelvin, within) in [
            (Illuminant::D65, 6504.0, 6.0),
            (Illuminant::D50, 5003.0, 5.0),
            (Illuminant::A, 2855.5, 1.0),
            (Illuminant::Blackbody(4321.0), 4321.0, 1.0),
            (Illuminant::Fl2, 4230.0, 10.0),
            (Illuminant::Fl11, 4000.0, 10.0),
        ] {
            let found = light.color_temperature();
            assert_abs_diff_eq!(found.kelvin, kelvin, epsilon = within);
        }
        // Daylight lies above the black bodies, by about 0.003.
        let d65 = Illuminant::D65.color_temperature();
        assert!((0.0028..0.0036).contains(&d65.duv), "{d65:?}");
        assert!(Illuminant::Blackbody(3000.0).color_temperature().duv.abs() < 1e-5);
    }

    #[test]
    fn light_of_a_chromaticity_has_it() {
        for xy in [[0.46, 0.414], [0.3127, 0.329], [0.3127, 0.350], [0.38, 0.36], [0.28, 0.29]] {
            let light = Illuminant::parse(&format!("{},{}", xy[0], xy[1])).unwrap();
            let [x, y] = light.chromaticity();
            assert_abs_diff_eq!(x, xy[0], epsilon = 1e-4);
            assert_abs_diff_eq!(y, xy[1], epsilon = 1e-4);
            assert!(light.spectrum().values().iter().all(|v| *v > 0.0));
        }
    }

    #[test]
    fn impossible_lights_are_refused() {
        assert_eq!(Illuminant::parse("3200K").unwrap(), Illuminant::Blackbody(3200.0));
        assert_eq!(Illuminant::parse("6500 k").unwrap(), Illuminant::Daylight(6500.0));
        assert_eq!(Illuminant::parse("fl2").unwrap(), Illuminant::Fl2);
        for (text, word) in [
            ("-3K", "500 to"),
            ("nanK", "25000 K"),
            ("30000K", "25000 K"),
            ("0.9,0.3", "whitish"),
            ("0,0.3", "whitish"),
            ("D66", "D65"),
            ("0.3,0.3,0.3", "D65"),
        ] {
            let message = Illuminant::parse(text).unwrap_err().to_string();
            assert!(message.contains(word), "{text}: {message}");
        }
        let dark = Spectrum::new(vec![400.0, 700.0], vec![0.0, 0.0]).unwrap();
        assert!(Illuminant::Spectrum(dark).check().is_err());
        assert!(Illuminant::Blackbody(f64::NAN).check().is_err());
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
