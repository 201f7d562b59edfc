//! How a lens changes with the wavelength: the coordinate in which rays change evenly, and what is not left to them.

use dioptric_optics::Lens;

/// A measure of wavelength, ascending from red to blue: the sum of the refractive indices of the lens's media where
/// they disperse, else 1/λ².
///
/// Ray maps are nearly quadratic in it whatever the law of dispersion is, so that few wavelengths do.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Dispersion {
    lens: Option<Lens>,
}

impl Dispersion {
    /// Returns the measure for a lens, such that it ascends over these wavelengths from the last to the first.
    pub(crate) fn of(lens: &Lens, wavelengths_nm: &[f64]) -> Self {
        let by_index = Self { lens: Some(lens.clone()) };
        let values: Vec<f64> = wavelengths_nm.iter().rev().map(|&nm| by_index.coordinate(nm)).collect();
        // Steps too small would turn rounding into error.
        let does_ascend = values.windows(2).all(|pair| pair[1] - pair[0] > 1e-7);
        if does_ascend { by_index } else { Self { lens: None } }
    }

    /// Returns the measure at a wavelength for which the lens has indices.
    pub(crate) fn coordinate(&self, wavelength_nm: f64) -> f64 {
        let index_sum = self.lens.as_ref().and_then(|lens| {
            let indices = lens.interfaces().iter().map(|i| lens.index_in(&i.medium_after, wavelength_nm).ok());
            indices.sum::<Option<f64>>()
        });
        index_sum.unwrap_or(1e6 / (wavelength_nm * wavelength_nm))
    }
}

/// Returns the share of light that the diffraction orders of a lens have, at a wavelength between those of a bank. It may change faster over
/// wavelengths than rays do (of a high order), so it is not among what is interpolated.
pub(crate) fn share_of_orders(lens: &Lens, wavelength_nm: f64) -> f64 {
    lens.diffraction_efficiency_at(wavelength_nm).expect("a lens is known between wavelengths at which it was traced")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_ascends_from_red_to_blue() {
        for lens in [Lens::built_in("paper-2el").unwrap(), Lens::thin(50.0, 10.0).unwrap()] {
            let nm = [400.0, 500.0, 700.0];
            let measure = Dispersion::of(&lens, &nm);
            let [blue, green, red] = nm.map(|nm| measure.coordinate(nm));
            assert!(red < green && green < blue, "{}", lens.name());
        }
    }
}
