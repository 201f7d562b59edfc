//! Coatings: what surfaces are covered with, and how that becomes a thin film at a wavelength.

mod dat;
mod file;
mod film;
mod table;

use num_complex::Complex64;
use serde::{Deserialize, Serialize};

use crate::{Glass, OpticsError};

pub(crate) use self::table::{TableRow, share_between};
pub use self::{
    film::{Amplitudes, Film, Shares},
    table::ReflectanceTable,
};

/// The index of evaporated magnesium fluoride, as coatings have it.
pub const MGF2_INDEX: f64 = 1.38;
/// The index of the dense layer of V and broadband coatings, about that of zirconia and titania mixed.
const DENSE_INDEX: f64 = 2.1;
/// The wavelength for which coatings are made unless they say otherwise, nm.
pub const COATING_CENTER_NM: f64 = 550.0;
/// The thickest layer, nm: light of a band would no longer interfere in one much thicker.
const THICKEST_NM: f64 = 100_000.0;
/// The largest number of layers.
const MOST_LAYERS: usize = 1000;

/// What covers a surface.
///
/// Layers are named from the medium of the lower index, air as a rule, to that of the higher one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub enum Coating {
    /// Something that lets all light through and reflects none; of a mirror, that reflects it all.
    Ideal,
    /// Nothing: the surface reflects by Fresnel's equations.
    Bare,
    /// A quarter wave of magnesium fluoride (index 1.38) for light that falls straight on it.
    MgF2 {
        /// The wavelength, nm.
        #[serde(default = "center_nm")]
        at_nm: f64,
    },
    /// Two layers, magnesium fluoride on a dense one of index 2.1, that reflect nothing of one wavelength (Macleod, *Thin-Film Optical
    /// Filters*, § 3.2); a quarter wave of magnesium fluoride where the glass is too dense for it.
    VCoat {
        /// The wavelength, nm.
        #[serde(default = "center_nm")]
        at_nm: f64,
    },
    /// Three layers that reflect little of a broad band: a quarter wave of magnesium fluoride, a half wave of index 2.1, and a quarter wave
    /// of index 1.38 √n on glass of index n.
    Broadband {
        /// The wavelength of the middle of the band, nm.
        #[serde(default = "center_nm")]
        at_nm: f64,
    },
    /// Layers as stated.
    Layers(Vec<CoatingLayer>),
    /// Reflectances as measured; what is not reflected goes on, unless it is stated how much does.
    Table(ReflectanceTable),
    /// Of mirrors alone: layers on a metal.
    Metal {
        /// The metal: a medium whose index and extinction are both known.
        metal: Glass,
        /// Layers on it, the outermost first.
        #[serde(default)]
        layers: Vec<CoatingLayer>,
    },
}

/// A layer of a coating.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CoatingLayer {
    /// What it is made of. Its extinction counts where it is known.
    pub medium: Glass,
    /// Its thickness, nm.
    pub thickness_nm: f64,
}

fn center_nm() -> f64 {
    COATING_CENTER_NM
}

impl Coating {
    /// A quarter wave of magnesium fluoride at 550 nm: what lenses have whose files state no coatings.
    pub const MGF2: Self = Self::MgF2 { at_nm: COATING_CENTER_NM };

    /// The words that name coatings, in the order of their losses.
    pub const WORDS: [&str; 5] = ["bare", "mgf2", "vcoat", "bbar", "ideal"];

    /// Returns the coating of a word of [`WORDS`](Self::WORDS), in any case.
    pub fn named(word: &str) -> Option<Self> {
        Some(match word.to_ascii_lowercase().as_str() {
            "bare" => Self::Bare,
            "mgf2" => Self::MGF2,
            "vcoat" => Self::VCoat { at_nm: COATING_CENTER_NM },
            "bbar" => Self::Broadband { at_nm: COATING_CENTER_NM },
            "ideal" => Self::Ideal,
            _ => return None,
        })
    }

    /// Checks that the numbers make sense.
    ///
    /// # Errors
    /// When a thickness or a wavelength is no number above 0, there are too many layers, or a medium makes no sense.
    pub fn check(&self) -> Result<(), OpticsError> {
        let wrong = |reason: String| Err(OpticsError::Coating { reason });
        let check_layers = |layers: &[CoatingLayer]| {
            if layers.len() > MOST_LAYERS {
                return wrong(format!("a coating has {} layers, expected at most {MOST_LAYERS}", layers.len()));
            }
            for CoatingLayer { medium, thickness_nm } in layers {
                medium.check()?;
                if !(*thickness_nm > 0.0 && *thickness_nm <= THICKEST_NM) {
                    return wrong(format!(
                        "thickness_nm of a layer is {thickness_nm}, expected a number above 0, at most {THICKEST_NM}"
                    ));
                }
            }
            Ok(())
        };
        match self {
            Self::Ideal | Self::Bare => Ok(()),
            Self::MgF2 { at_nm } | Self::VCoat { at_nm } | Self::Broadband { at_nm } => {
                match *at_nm > 0.0 && at_nm.is_finite() {
                    true => Ok(()),
                    false => wrong(format!("at_nm of a coating is {at_nm}, expected a wavelength above 0")),
                }
            }
            Self::Layers(layers) => check_layers(layers),
            Self::Table(table) => table.check(),
            Self::Metal { metal, layers } => {
                metal.check()?;
                check_layers(layers)
            }
        }
    }

    /// Returns layers (index and thickness in nm), from the medium of the lower index to that of the higher, at a wavelength; `dense_at`
    /// gives the index of the latter at another wavelength, as far as it is known.
    pub(crate) fn layers_at(
        &self,
        wavelength_nm: f64,
        dense_at: &dyn Fn(f64) -> Option<f64>,
    ) -> Result<Vec<(Complex64, f64)>, OpticsError> {
        let mgf2 = Complex64::from(MGF2_INDEX);
        let quarter = |at_nm: f64, index: f64| (Complex64::from(index), 0.25 * at_nm / index);
        Ok(match self {
            Self::Ideal | Self::Bare | Self::Table(_) => Vec::new(),
            Self::MgF2 { at_nm } => vec![quarter(*at_nm, MGF2_INDEX)],
            Self::VCoat { at_nm } => match v_coat(dense_at(*at_nm).unwrap_or(1.0)) {
                Some([outer, inner]) => {
                    let nm = |phase: f64, index: f64| phase / std::f64::consts::TAU * at_nm / index;
                    vec![(mgf2, nm(outer, MGF2_INDEX)), (DENSE_INDEX.into(), nm(inner, DENSE_INDEX))]
                }
                None => vec![quarter(*at_nm, MGF2_INDEX)],
            },
            Self::Broadband { at_nm } => {
                let glass = dense_at(*at_nm).unwrap_or(1.0);
                let (half_index, half_nm) = quarter(2.0 * at_nm, DENSE_INDEX);
                vec![quarter(*at_nm, MGF2_INDEX), (half_index, half_nm), quarter(*at_nm, MGF2_INDEX * glass.sqrt())]
            }
            Self::Layers(layers) | Self::Metal { layers, .. } => {
                layers.iter().map(|layer| layer.at(wavelength_nm)).collect::<Result<_, _>>()?
            }
        })
    }
}

impl CoatingLayer {
    /// Returns the complex index at a wavelength, and the thickness in nm.
    fn at(&self, wavelength_nm: f64) -> Result<(Complex64, f64), OpticsError> {
        Ok((complex_index(&self.medium, wavelength_nm)?, self.thickness_nm))
    }
}

/// Returns n + ik of the medium of a layer; k is 0 of one of which none is stated.
fn complex_index(medium: &Glass, wavelength_nm: f64) -> Result<Complex64, OpticsError> {
    match medium {
        Glass::Absorbing { .. } => absorbing_index(medium, wavelength_nm),
        _ => Ok(Complex64::new(medium.index_at(wavelength_nm)?, medium.extinction_at(wavelength_nm).unwrap_or(0.0))),
    }
}

/// Returns n + ik of a medium whose k must be known, as that of a metal.
pub(crate) fn absorbing_index(medium: &Glass, wavelength_nm: f64) -> Result<Complex64, OpticsError> {
    let index = medium.index_at(wavelength_nm)?;
    let extinction = medium.extinction_at(wavelength_nm).ok_or_else(|| OpticsError::Coating {
        reason: format!("the extinction is not known at {wavelength_nm} nm, expected a medium with that, as Absorbing"),
    })?;
    Ok(Complex64::new(index, extinction))
}

/// Returns the phase thicknesses of magnesium fluoride, outside, and of the dense layer that together reflect nothing on glass of this
/// index in air; `None` where there are none.
fn v_coat(glass: f64) -> Option<[f64; 2]> {
    let (n1, n2) = (MGF2_INDEX * MGF2_INDEX, DENSE_INDEX * DENSE_INDEX);
    let step = glass - 1.0;
    let (a, b, c) = (n2 - glass, glass - n1, n1 * glass - n2);
    let (outer, inner) = ((step * a * n1 / (c * b)).sqrt(), (step * b * n2 / (c * a)).sqrt());
    if !(outer.is_finite() && inner.is_finite()) {
        return None;
    }
    // The product of both tangents has the sign of c.
    let outer = if c < 0.0 { std::f64::consts::PI - outer.atan() } else { outer.atan() };
    Some([outer, inner.atan()])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn film(coating: &Coating, glass: f64, nm: f64) -> Film {
        let layers = coating.layers_at(nm, &|_| Some(glass)).unwrap();
        Film::new(1.0, &layers, glass.into(), nm)
    }

    #[test]
    fn v_coat_reflects_nothing_at_its_wavelength() {
        let coating = Coating::VCoat { at_nm: 532.0 };
        for glass in [1.46, 1.52, 1.7, 1.85] {
            assert!(film(&coating, glass, 532.0).shares(1.0).r_s < 1e-24, "{glass}");
            assert!(film(&coating, glass, 420.0).shares(1.0).r_s > 1e-3, "{glass}");
        }
        // Where magnesium fluoride alone does as well.
        assert!(film(&coating, 1.95, 532.0).shares(1.0).r_s < 2e-4);
    }

    #[test]
    fn broadband_reflects_less_than_one_layer_over_the_visible() {
        let mean = |coating: &Coating, glass: f64| {
            (0..=28).map(|i| film(coating, glass, 420.0 + 10.0 * f64::from(i)).shares(1.0).r_s).sum::<f64>() / 29.0
        };
        for glass in [1.5, 1.6, 1.7, 1.8] {
            let (broad, single) = (mean(&Coating::named("bbar").unwrap(), glass), mean(&Coating::MGF2, glass));
            // The denser the glass, the better one layer does: 1.38² is 1.9.
            let most = if glass < 1.7 { 0.5 } else { 0.7 };
            assert!(broad < most * single && broad < 6e-3, "{glass}: {broad} {single}");
            // In the middle of the band nothing is left.
            assert!(film(&Coating::named("bbar").unwrap(), glass, 550.0).shares(1.0).r_s < 1e-24);
        }
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        let message = |coating: Coating| coating.check().unwrap_err().to_string();
        let layer = |thickness_nm| CoatingLayer { medium: Glass::Constant { index: 1.38 }, thickness_nm };
        assert!(message(Coating::Layers(vec![layer(-3.0)])).contains("thickness_nm of a layer is -3"));
        assert!(message(Coating::MgF2 { at_nm: 0.0 }).contains("at_nm of a coating is 0"));
        assert!(message(Coating::Layers(vec![layer(1.0); 1001])).contains("1001 layers"));
        assert_eq!((Coating::named("BBAR").is_some(), Coating::named("t-star")), (true, None));
    }
}
