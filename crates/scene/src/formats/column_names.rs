//! What the names of columns say of their numbers, in tables of lights and of reflectances.

use super::light_unit::LightUnit;

/// Parts of the names of what is neither a power nor a reflectance; between spaces they are whole words.
const NEITHER: [&str; 21] = [
    "absor",
    "kubelka",
    "extinction",
    "attenuation",
    "coefficient",
    "emissivity",
    "responsivity",
    "quantum efficiency",
    "luminance",
    "brdf",
    "optical density",
    "optical depth",
    " f r ",
    " k/s ",
    " a/w ",
    " rrs ",
    " mu a ",
    " f nu ",
    " 1/sr ",
    " sr 1 ",
    "raman",
];
/// Words of that kind.
const WORDS: [&str; 24] = [
    "dn",
    "adu",
    "db",
    "dbm",
    "dbw",
    "decibel",
    "decibels",
    "log",
    "logarithm",
    "logr",
    "ln",
    "qe",
    "eqe",
    "iqe",
    "od",
    "lm",
    "lx",
    "lux",
    "count",
    "counts",
    "jy",
    "mjy",
    "fnu",
    "abs",
];
/// Words of how far numbers spread, and of arbitrary units.
const SPREADS: [&str; 8] = ["sd", "stdev", "stddev", "sem", "rmse", "variance", "uncertainty", "au"];
/// What may stand beside these in the name of a quantity.
const BESIDE: [&str; 10] = ["r", "t", "i", "a", "u", "nm", "sample", "reflectance", "transmittance", "value"];
/// Parts of the names of shares, and of powers of which it is not known a what.
const NO_POWERS: [&str; 10] =
    ["transmi", "reflectance", "albedo", " %t ", " %r ", "wavenumber", " cm 1 ", "hz ", " ev ", "cumulat"];
/// Parts of the names of light, and of what may be a reflectance's logarithm.
const NO_REFLECTANCES: [&str; 14] = [
    "density",
    "radian",
    "emission",
    "w/m",
    "w m 2",
    "w/cm",
    "counts",
    "sqrt",
    "refractive",
    "cross section",
    "fluoresc",
    "luminescen",
    "emittance",
    " a u ",
];
/// Whole names of what is made of reflectances.
const TURNED: [&str; 6] = ["1-r", "1/r", "km", "std", "loss", "error"];
/// Shares, and what stands behind their names where 1 is no perfect white.
const SHARES: [&str; 3] = ["reflectance", "transmittance", "albedo"];
const SCALES: [&str; 8] = ["*1", "×1", "x1", "/1", "0-10", "0-255", "0-4095", "0-65535"];
/// Words of what only counts.
const COUNTS: [&str; 20] = [
    "pixel",
    "pixels",
    "channel",
    "channels",
    "index",
    "sample",
    "samples",
    "time",
    "raman",
    "row",
    "column",
    "number",
    "frame",
    "id",
    "theta",
    "angle",
    "degrees",
    "temperature",
    "seconds",
    "position",
];
/// Words of photons, or parts of them.
const PHOTONS: [&str; 6] = ["photon", "quanta", "quantum", "mol", "pfd", "einstein"];

/// Returns a name in small letters, its words between single spaces.
fn spaced(name: &str) -> String {
    let words = name.to_lowercase().replace(|c: char| !c.is_alphanumeric() && !"/%".contains(c), " ");
    format!(" {} ", words.split_whitespace().collect::<Vec<_>>().join(" "))
}

fn words(spaced: &str) -> Vec<&str> {
    spaced.split(|c: char| !c.is_alphabetic()).filter(|word| !word.is_empty()).collect()
}

/// Whether a name is one of these words and what may stand beside them: beside others they are names, as of log cabins.
fn is_of_words(words: &[&str]) -> bool {
    let is_own = |word: &&str| WORDS.contains(word) || SPREADS.contains(word);
    words.iter().any(is_own) && words.iter().all(|word| is_own(word) || BESIDE.contains(word))
}

/// Whether the name of a light's column says that it holds no power a nanometre.
pub(super) fn is_no_power(name: &str) -> bool {
    let spaced = spaced(name);
    let words = words(&spaced);
    // Absolute powers are called so.
    words.iter().any(|word| WORDS.contains(word) && *word != "abs")
        || is_of_words(&words)
        || NEITHER.iter().chain(&NO_POWERS).any(|part| spaced.contains(part))
}

/// Whether the name of a chart's column says that it holds no reflectances.
pub(super) fn is_no_reflectance(name: &str) -> bool {
    let spaced = spaced(name);
    let words = words(&spaced);
    let bare: String = name.to_lowercase().chars().filter(|c| !c.is_whitespace()).collect();
    let has = |parts: &[&str]| parts.iter().any(|part| bare.contains(part));
    let is_scaled = has(&SHARES) && has(&SCALES) && !bare.contains('%');
    let is_photon = |word: &&str| word.starts_with("photon") && !word.starts_with("photonic");
    let has_unit =
        name.split(['(', '[']).skip(1).any(|inner| LightUnit::is_written_in(inner.trim_end_matches([')', ']'])));
    let is_turned = TURNED.contains(&bare.as_str());
    has_unit
        || is_turned
        || words.iter().any(|word| *word == "od" || is_photon(word))
        || is_scaled
        || is_of_words(&words)
        || NEITHER.iter().chain(&NO_REFLECTANCES).any(|part| spaced.contains(part))
}

/// Whether the name of a first column says that it holds no wavelengths.
pub(super) fn is_no_wavelength(name: &str) -> bool {
    let spaced = spaced(name);
    words(&spaced).iter().any(|word| COUNTS.contains(word))
        && !["wave", "lambda", "λ"].iter().any(|w| spaced.contains(w))
}

/// Whether a name says that its numbers are photons.
pub(super) fn counts_photons(name: &str) -> bool {
    let lower = name.to_lowercase();
    PHOTONS.iter().any(|part| lower.contains(part))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_say_what_is_neither_a_power_nor_a_reflectance() {
        for name in [
            "counts",
            "Intensity (counts)",
            "ADU",
            "DN",
            "absorbance",
            "QE",
            "quantum efficiency",
            "A/W",
            "lm/nm",
            "Illuminance (lx)",
            "dBm",
            "F(R)",
            "Kubelka-Munk",
            "optical depth",
            "Optical_Density",
            "emissivity",
            "Rrs (1/sr)",
            "sr-1",
            "BRDF",
            "K/S",
            "mu_a",
            "logR",
            "log(1/T)",
            "Raman shift (cm-1)",
        ] {
            assert!(is_no_power(name) && is_no_reflectance(name), "{name}");
        }
        for name in
            ["Transmittance", "%T", "Reflectance (%)", "absolute log irradiance", "per cm^-1", "f_nu", "cumulative"]
        {
            assert!(is_no_power(name), "{name}");
        }
        for name in ["power", "abs irradiance", "intensity", "photon flux density", "W/nm", "catalog", "power density"]
        {
            assert!(!is_no_power(name), "{name}");
        }
        for name in
            ["SD", "std", "R stdev", "1-R", "alpha (cm-1)", "PL intensity (a.u.)", "sqrt(R)", "refractive index"]
        {
            assert!(is_no_reflectance(name), "{name}");
        }
        for name in ["reflectance*10000", "Reflectance (0-255)", "W/m2/nm", "photon flux", "skin OD", "radiance"] {
            assert!(is_no_reflectance(name), "{name}");
        }
        for name in [
            "Std red",
            "error bar red",
            "log cabin",
            "ABS plastic",
            "photonic paint",
            "reflectance",
            "Reflectance (0-100 %)",
            "leaf 0-45",
            "red",
        ] {
            assert!(!is_no_reflectance(name), "{name}");
        }
        for (name, is_none) in [
            ("Pixel", true),
            ("Channel", true),
            ("Index", true),
            ("Time (s)", true),
            ("2theta", true),
            ("Temperature (K)", true),
            ("Raman shift (cm-1)", true),
            ("wavelength", false),
            ("nm", false),
            ("wavelength of channel", false),
            ("", false),
        ] {
            assert_eq!(is_no_wavelength(name), is_none, "{name}");
        }
    }
}
