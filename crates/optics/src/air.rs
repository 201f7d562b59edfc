//! Air at any temperature, pressure and humidity.

use serde::{Deserialize, Serialize};

use crate::OpticsError;

/// Air in some state, whose refractive index relative to vacuum is given by Ciddor's equations (Applied Optics 35,
/// 1566 (1996)), good to 5e-8 from 300 to 1690 nm, −40 to 100 °C and 80 to 120 kPa.
///
/// Vacuum is air of pressure 0.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Air {
    /// Temperature, °C.
    pub temperature_c: f64,
    /// Pressure, Pa.
    pub pressure_pa: f64,
    /// Relative humidity, 0 to 1.
    #[serde(default)]
    pub humidity: f64,
    /// Molar share of carbon dioxide, parts in a million.
    #[serde(default = "usual_co2_ppm")]
    pub co2_ppm: f64,
}

fn usual_co2_ppm() -> f64 {
    450.0
}

/// The gas constant that the equations use, J/(mol K).
const GAS_CONSTANT: f64 = 8.314_510;
/// Molar mass of water, kg/mol.
const WATER_KG_PER_MOL: f64 = 0.018_015;

impl Air {
    /// The air that catalogues of glass relate their indices to: 20 °C, 101,325 Pa, dry.
    ///
    /// SCHOTT states 22 °C, which changes the index by 2e-6.
    pub const CATALOGUE: Self = Self { temperature_c: 20.0, pressure_pa: 101_325.0, humidity: 0.0, co2_ppm: 450.0 };
    /// Nothing at all.
    pub const VACUUM: Self = Self { pressure_pa: 0.0, ..Self::CATALOGUE };

    /// Returns the refractive index relative to vacuum at a vacuum wavelength.
    pub fn index_at(&self, wavelength_nm: f64) -> f64 {
        if self.pressure_pa == 0.0 {
            return 1.0;
        }
        let s2 = 1e6 / (wavelength_nm * wavelength_nm);
        // Standard dry air (15 °C, 101,325 Pa, 450 ppm of CO2), and water vapour (20 °C, 1333 Pa).
        let standard = 1e-8 * (5_792_105.0 / (238.0185 - s2) + 167_917.0 / (57.362 - s2));
        let dry = standard * (1.0 + 0.534e-6 * (self.co2_ppm - 450.0));
        let vapour = 1.022e-8 * (295.235 + s2 * (2.6422 + s2 * (-0.032_380 + s2 * 0.004_028)));
        let (air, water) = self.densities();
        let standard_air = Self { temperature_c: 15.0, pressure_pa: 101_325.0, humidity: 0.0, ..*self }.densities().0;
        let standard_vapour = partial_density(1333.0, 20.0, 1.0, WATER_KG_PER_MOL);
        1.0 + air / standard_air * dry + water / standard_vapour * vapour
    }

    /// Checks that the numbers make sense.
    pub(crate) fn check(&self) -> Result<(), OpticsError> {
        let within = |key, found: f64, least: f64, most: f64, expected| match (least..=most).contains(&found) {
            true => Ok(()),
            false => Err(OpticsError::Glass { key, found, expected }),
        };
        within("temperature_c", self.temperature_c, -100.0, 200.0, "-100 to 200 °C")?;
        within("pressure_pa", self.pressure_pa, 0.0, 1e6, "0 to 1e6 Pa")?;
        within("humidity", self.humidity, 0.0, 1.0, "0 to 1")?;
        within("co2_ppm", self.co2_ppm, 0.0, 1e5, "0 to 100000 parts in a million")
    }

    /// Returns the densities of the dry part and of the vapour, kg/m³.
    fn densities(&self) -> (f64, f64) {
        let Self { temperature_c: t, pressure_pa: p, humidity, co2_ppm } = *self;
        let kelvin = t + 273.15;
        let saturation_pa =
            (1.237_884_7e-5 * kelvin * kelvin - 1.912_131_6e-2 * kelvin + 33.937_110_47 - 6.343_164_5e3 / kelvin).exp();
        let enhancement = 1.000_62 + 3.14e-8 * p + 5.6e-7 * t * t;
        let share = (enhancement * humidity * saturation_pa / p).min(1.0);
        let air_kg_per_mol = 1e-3 * (28.9635 + 12.011e-6 * (co2_ppm - 400.0));
        let dry = (1.0 - share) * partial_density(p, t, share, air_kg_per_mol);
        (dry, share * partial_density(p, t, share, WATER_KG_PER_MOL))
    }
}

/// Returns the density that moist air would have if all its molecules weighed this much, kg/m³; `share` is that of
/// the vapour (equation 12 and appendix A of the paper, after the BIPM's of 1991).
fn partial_density(p: f64, t: f64, share: f64, kg_per_mol: f64) -> f64 {
    let kelvin = t + 273.15;
    let first = 1.581_23e-6 - 2.9331e-8 * t
        + 1.1043e-10 * t * t
        + (5.707e-6 - 2.051e-8 * t) * share
        + (1.9898e-4 - 2.376e-6 * t) * share * share;
    let over = p / kelvin;
    let compressibility = 1.0 - over * first + over * over * (1.83e-11 - 0.765e-8 * share * share);
    p * kg_per_mol / (compressibility * GAS_CONSTANT * kelvin)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(air: Air, expected: f64, within: f64) {
        let found = 1e8 * (air.index_at(633.0) - 1.0);
        assert!((found - expected).abs() <= within, "{air:?}: {found}, expected {expected}");
    }

    fn at(temperature_c: f64, kilopascals: f64, humidity: f64) -> Air {
        Air { temperature_c, pressure_pa: 1e3 * kilopascals, humidity, co2_ppm: 450.0 }
    }

    #[test]
    fn dry_and_moist_air_have_the_published_refractivities() {
        // Tables 1 and 3 of the paper, in 1e-8 at 633 nm, printed to 0.1.
        for (t, kilopascals, expected) in
            [(20.0, 80.0, 21458.0), (20.0, 100.0, 26824.4), (20.0, 120.0, 32191.6), (10.0, 100.0, 27774.7)]
        {
            check(at(t, kilopascals, 0.0), expected, 0.1);
        }
        check(at(30.0, 100.0, 0.0), 25937.2, 0.1);
        for (t, kilopascals, humidity, expected) in [
            (20.0, 80.0, 0.75, 21394.0),
            (20.0, 120.0, 0.75, 32127.8),
            (40.0, 120.0, 0.75, 29941.8),
            (50.0, 80.0, 1.0, 19058.4),
            (50.0, 120.0, 1.0, 28792.4),
        ] {
            check(at(t, kilopascals, humidity), expected, 0.1);
        }
    }

    #[test]
    fn standard_air_is_that_of_the_catalogue_and_vacuum_is_one() {
        let standard = at(15.0, 101.325, 0.0);
        let row = crate::GlassCatalogue::built_in().find("MISC:AIR").unwrap();
        for nm in [400.0, 550.0, 1000.0] {
            assert!((standard.index_at(nm) - row.glass.index_at(nm).unwrap()).abs() < 1e-15);
        }
        assert_eq!(Air::VACUUM.index_at(550.0), 1.0);
    }
}
