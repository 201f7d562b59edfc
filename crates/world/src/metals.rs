//! Indices of metals.

use dioptric_spectrum::Spectrum;

use crate::{Beyond, SpectralCurve};

/// Photon energies, eV, of the tables of Johnson & Christy (1972), Phys. Rev. B 6, 4370, table I.
const ENERGIES_EV: [f64; 22] = [
    1.02, 1.14, 1.26, 1.39, 1.51, 1.64, 1.76, 1.88, 2.01, 2.13, 2.26, 2.38, 2.50, 2.63, 2.75, 2.88, 3.00, 3.12, 3.25,
    3.37, 3.50, 3.62,
];
const SILVER: [[f64; 22]; 2] = [
    [
        0.09, 0.04, 0.04, 0.04, 0.04, 0.03, 0.04, 0.05, 0.06, 0.05, 0.06, 0.05, 0.05, 0.05, 0.04, 0.04, 0.05, 0.05,
        0.05, 0.07, 0.10, 0.14,
    ],
    [
        8.828, 7.795, 6.992, 6.312, 5.727, 5.242, 4.838, 4.483, 4.152, 3.858, 3.586, 3.324, 3.093, 2.869, 2.657, 2.462,
        2.275, 2.070, 1.864, 1.657, 1.419, 1.142,
    ],
];
const GOLD: [[f64; 22]; 2] = [
    [
        0.35, 0.27, 0.22, 0.17, 0.16, 0.14, 0.13, 0.14, 0.21, 0.29, 0.43, 0.62, 1.04, 1.31, 1.38, 1.45, 1.46, 1.47,
        1.46, 1.48, 1.50, 1.48,
    ],
    [
        8.145, 7.150, 6.350, 5.663, 5.083, 4.542, 4.103, 3.697, 3.272, 2.863, 2.455, 2.081, 1.833, 1.849, 1.914, 1.948,
        1.958, 1.952, 1.933, 1.895, 1.866, 1.871,
    ],
];
const COPPER: [[f64; 22]; 2] = [
    [
        0.48, 0.36, 0.32, 0.30, 0.26, 0.24, 0.21, 0.22, 0.30, 0.70, 1.02, 1.18, 1.22, 1.25, 1.24, 1.25, 1.28, 1.32,
        1.33, 1.36, 1.37, 1.36,
    ],
    [
        8.245, 7.217, 6.421, 5.768, 5.180, 4.665, 4.205, 3.747, 3.205, 2.704, 2.577, 2.608, 2.564, 2.483, 2.397, 2.305,
        2.207, 2.116, 2.045, 1.975, 1.916, 1.864,
    ],
];
/// Every 50 nm from 400 nm: Smith, Shiles & Inokuti in Palik, Handbook of Optical Constants of Solids (1985).
const ALUMINIUM: [[f64; 9]; 2] = [
    [0.490, 0.618, 0.769, 0.958, 1.20, 1.47, 1.83, 2.40, 2.80],
    [4.86, 5.47, 6.08, 6.69, 7.26, 7.79, 8.31, 8.62, 8.45],
];

/// A metal whose complex index is known here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MetalKind {
    /// Silver (Johnson & Christy 1972).
    Silver,
    /// Gold (Johnson & Christy 1972).
    Gold,
    /// Copper (Johnson & Christy 1972).
    Copper,
    /// Aluminium (Palik 1985), from 400 to 800 nm, held beyond.
    Aluminium,
}

impl MetalKind {
    /// Returns the metal of a name or chemical symbol, in any case.
    pub fn named(name: &str) -> Option<Self> {
        Some(match name.to_ascii_lowercase().as_str() {
            "ag" | "silver" => Self::Silver,
            "au" | "gold" => Self::Gold,
            "cu" | "copper" => Self::Copper,
            "al" | "aluminium" | "aluminum" => Self::Aluminium,
            _ => return None,
        })
    }

    /// Returns n and k, from 343 to 1216 nm (aluminium 400 to 800 nm); their ends are held.
    pub fn index(self) -> [SpectralCurve; 2] {
        let curve = |wavelengths_nm: Vec<f64>, values: Vec<f64>| {
            let spectrum = Spectrum::new(wavelengths_nm, values).expect("the tables ascend and are finite");
            SpectralCurve::new(&spectrum, Beyond::Held)
        };
        let by_energy = |table: [[f64; 22]; 2]| {
            table.map(|values| {
                // h c = 1239.842 eV nm; wavelengths ascend as energies fall.
                let wavelengths_nm = ENERGIES_EV.iter().rev().map(|ev| 1239.842 / ev).collect();
                curve(wavelengths_nm, values.into_iter().rev().collect())
            })
        };
        match self {
            Self::Silver => by_energy(SILVER),
            Self::Gold => by_energy(GOLD),
            Self::Copper => by_energy(COPPER),
            Self::Aluminium => {
                ALUMINIUM.map(|values| curve((0..9).map(|i| 400.0 + 50.0 * f64::from(i)).collect(), values.to_vec()))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fresnel;

    /// Reflectances straight on, as handbooks have them to a few hundredths.
    #[test]
    fn metals_have_their_colors() {
        let at = |metal: MetalKind, wavelength_nm: f32| {
            let [n, k] = metal.index().map(|curve| curve.at(&[wavelength_nm])[0]);
            fresnel::conductor(1.0, n, k)
        };
        for (metal, blue, red) in [
            (MetalKind::Silver, 0.97, 0.985),
            (MetalKind::Gold, 0.385, 0.97),
            (MetalKind::Copper, 0.55, 0.96),
            (MetalKind::Aluminium, 0.92, 0.905),
        ] {
            let found = (at(metal, 450.0), at(metal, 680.0));
            assert!((found.0 - blue).abs() < 0.025 && (found.1 - red).abs() < 0.025, "{metal:?}: {found:?}");
        }
        assert_eq!(MetalKind::named("Au"), Some(MetalKind::Gold));
        assert_eq!(MetalKind::named("W"), None);
    }
}
