//! Units in which files state wavelengths.

/// The speed of light times 1e9 nm per m, nm/s, and the energy of a photon times its wavelength, eV nm (CODATA 2018).
const NM_PER_S: f64 = 2.997_924_58e17;
const EV_NM: f64 = 1_239.841_984;

/// Wavelengths that a file can mean, nm: from X-rays to the far infrared.
pub(super) const PLAUSIBLE_NM: std::ops::RangeInclusive<f64> = 10.0..=1e5;

/// The units that are known, as refusals name them.
pub(super) const UNITS: &str = "nm, µm, mm, m, Å, cm⁻¹, THz or eV";

/// Returns numbers in a unit of wavelength, wavenumber, frequency or energy as nm; `None` where it is no unit that is known.
pub(super) fn in_nm(unit: &str, numbers: &[f64]) -> Option<Vec<f64>> {
    // A product of 1.0 keeps the number to the bit.
    let times = |factor: f64| Some(numbers.iter().map(|number| number * factor).collect());
    let over = |of: f64| Some(numbers.iter().map(|number| of / number).collect());
    match unit.trim().to_lowercase().as_str() {
        "nm" | "nanometers" | "nanometer" | "nanometres" | "nanometre" => times(1.0),
        "um" | "µm" | "μm" | "micrometers" | "micrometer" | "micrometres" | "micrometre" | "microns" | "micron" => {
            times(1e3)
        }
        "mm" | "millimeters" | "millimeter" | "millimetres" | "millimetre" => times(1e6),
        "m" | "meters" | "meter" | "metres" | "metre" => times(1e9),
        "angstroms" | "angstrom" | "ångström" | "å" | "a" => times(0.1),
        "wavenumber" | "cm-1" | "cm^-1" | "cm⁻¹" | "1/cm" => over(1e7),
        "hz" => over(NM_PER_S),
        "ghz" => over(1e-9 * NM_PER_S),
        "thz" => over(1e-12 * NM_PER_S),
        "ev" | "electronvolt" | "electronvolts" => over(EV_NM),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_light_in_every_unit() {
        for (unit, number) in [
            ("nm", 500.0),
            (" Microns ", 0.5),
            ("mm", 5e-4),
            ("m", 5e-7),
            ("Å", 5000.0),
            ("1/cm", 20_000.0),
            ("THz", 599.584_916),
            ("eV", 2.479_683_968),
        ] {
            let nm = in_nm(unit, &[number]).unwrap()[0];
            assert!((nm - 500.0).abs() < 1e-5, "{unit}: {nm}");
        }
        assert_eq!(in_nm("zorp", &[500.0]), None);
    }
}
