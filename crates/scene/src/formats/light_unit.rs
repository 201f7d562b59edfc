//! Units of spectral light as files write them: `W.m^-2.sr^-1`, `uW/(cm^2 sr nm)`, `photons/s/m^2/sr/nm`.

use dioptric_spectrum::Quantity;
use ndarray::Array2;

use super::photons::joules_per_photon;

/// What the numbers of a file are, and what makes them W m⁻² sr⁻¹ nm⁻¹ or W m⁻² nm⁻¹.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LightUnit {
    /// Radiance or irradiance.
    pub(super) quantity: Quantity,
    factor: f64,
    is_photons: bool,
    /// Whether it is of a step of frequency, energy or wavenumber, to which a step of wavelength is as the square of that.
    is_per_frequency: bool,
}

/// Planck's constant times the speed of light, eV nm, the latter, nm/s, and the photons of a mole (CODATA 2018).
const EV_NM: f64 = 1_239.841_984;
const NM_PER_S: f64 = 2.997_924_58e17;
const PER_MOLE: f64 = 6.022_140_76e23;

impl LightUnit {
    /// Radiance in W m⁻² sr⁻¹ nm⁻¹.
    pub(super) const RADIANCE: Self =
        Self { quantity: Quantity::Radiance, factor: 1.0, is_photons: false, is_per_frequency: false };

    /// Returns the unit of a text, or `None` where it is no unit of spectral light. A nanometre is understood where no length
    /// of wavelength is stated.
    pub(super) fn parse(text: &str) -> Option<Self> {
        Sum::of(text)?.unit()
    }

    /// Returns the unit of spectral light that a text is or ends in, as `Radiance (uW/cm2/sr/nm)`, and its words.
    pub(super) fn in_words(text: &str) -> Option<(Self, &str)> {
        endings(text).find_map(|(_, words)| Some((Self::parse(words)?, words)))
    }

    /// Returns the unit of watts, or of photons, that the name of a relative spectrum is or ends in, whatever it says of areas, angles and times,
    /// and what stands before it.
    pub(super) fn of_spectrum(name: &str) -> Option<(Self, &str)> {
        endings(name).find_map(|(before, words)| Some((Sum::of(words)?.spectral()?, before)))
    }

    /// Whether a name holds what is written as a unit is: a quotient or exponents of lengths and times, understood or not.
    pub(super) fn is_written_in(name: &str) -> bool {
        let is_power = |word: &str| {
            let base = power(word).filter(|(_, exponent, rest)| *exponent != 1 && rest.is_empty());
            base.is_some_and(|(base, ..)| ["m", "cm", "mm", "um", "µm", "nm", "s", "sr", "Hz", "eV"].contains(&base))
        };
        let is_quotient = |word: &str| {
            let ends = word.split_once('/').map(|(above, below)| (above.trim_end(), below.trim_start()));
            ends.is_some_and(|(above, below)| !above.is_empty() && !below.is_empty() && word != "n/a")
        };
        let symbols = symbols(name);
        let mut words = symbols.split(|c: char| c.is_whitespace() || "()[],;:=*·".contains(c));
        is_quotient(&symbols) || words.any(|word| is_power(word) || is_quotient(word))
    }

    /// Whether a text is written as a unit is and holds no other words than may be symbols: of three letters.
    pub(super) fn is_written_so(text: &str) -> bool {
        let symbols = symbols(text);
        let mut words = symbols.split(|c: char| !c.is_alphabetic());
        Self::is_written_in(text) && words.all(|word| word.chars().count() <= 3 || Sum::of(word).is_some())
    }

    /// That of photons a nanometre of a relative spectrum.
    pub(super) const PHOTONS: Self = Self { is_photons: true, ..Self::RADIANCE };

    /// Returns what makes a relative power a nanometre of a number when it is divided by it.
    pub(super) fn divisor_at(self, wavelength_nm: f64) -> f64 {
        let of = |is: bool, divisor: f64| if is { divisor } else { 1.0 };
        of(self.is_photons, wavelength_nm) * of(self.is_per_frequency, wavelength_nm.powi(2))
    }

    /// Whether a unit of spectral light states no length of wavelength, so that a nanometre is understood.
    pub(super) fn lacks_wavelength(text: &str) -> bool {
        Sum::of(text).is_some_and(|sum| sum.wavelengths == 0 && sum.metres != -3 && sum.per_frequency() == Some(None))
    }

    /// Whether it counts photons, and not their energy.
    pub(super) fn is_photons(self) -> bool {
        self.is_photons
    }

    /// Returns what makes watts of a number.
    pub(super) fn factor_at(self, wavelength_nm: f64) -> f64 {
        let joules = if self.is_photons { joules_per_photon(wavelength_nm) } else { 1.0 };
        let step = if self.is_per_frequency { wavelength_nm.powi(-2) } else { 1.0 };
        self.factor * joules * step
    }

    /// Puts the samples of a band into watts.
    pub(super) fn convert(self, plane: &mut Array2<f32>, wavelength_nm: f64) {
        let factor = self.factor_at(wavelength_nm);
        // A factor of 1 keeps samples to the bit.
        if factor != 1.0 {
            plane.mapv_inplace(|v| (f64::from(v) * factor) as f32);
        }
    }
}

/// Returns a text, and what is behind each of its words and brackets, with what stands before.
fn endings(text: &str) -> impl Iterator<Item = (&str, &str)> {
    let is_between = |c: char| c.is_whitespace() || "([:=,".contains(c);
    let inner = text.char_indices().filter(move |(_, c)| is_between(*c)).map(|(at, c)| at + c.len_utf8());
    // What is in brackets follows by itself.
    let is_whole = |at: &usize| {
        let rest = text[*at..].trim();
        rest.starts_with('(') && group(rest).is_some_and(|(.., behind)| behind.is_empty() && rest.ends_with(')'))
    };
    std::iter::once(0).chain(inner).filter(move |at| !is_whole(at)).map(|at| {
        let (before, rest) = text.split_at(at);
        let rest = rest.trim();
        let n = |signs: [char; 2]| rest.matches(signs).count();
        let is_closed = n([')', ']']) > n(['(', '[']);
        (before, rest.strip_suffix([')', ']']).filter(|_| is_closed).unwrap_or(rest))
    })
}

/// Returns a text with the symbols of units that are written out: `Microwatts per square centimeter …` becomes `uW / cm^2 …`.
fn symbols(text: &str) -> String {
    let raised = [('⁻', "-"), ('⁰', "0"), ('¹', "1"), ('²', "2"), ('³', "3")];
    let text = raised.iter().fold(text.to_owned(), |text, (from, to)| text.replace(*from, to));
    // Exponents of LaTeX and of programs.
    let text = text.replace(['{', '}', '$'], "").replace("**", "^");
    let mut result = String::new();
    let mut is_square = false;
    let mut rest = text.as_str();
    while !rest.is_empty() {
        let end = rest.find(|c: char| !c.is_alphabetic()).unwrap_or(rest.len());
        if end == 0 {
            let next = rest.find(char::is_alphabetic).unwrap_or(rest.len());
            result.push_str(&rest[..next]);
            rest = &rest[next..];
            continue;
        }
        let (word, after) = rest.split_at(end);
        rest = after;
        let lower = word.to_lowercase();
        let symbol = match lower.as_str() {
            "per" => "/",
            "square" | "sq" => {
                is_square = true;
                continue;
            }
            "mole" | "moles" => "mol",
            "millimol" | "millimole" | "millimoles" => "mmol",
            "micromol" | "micromole" | "micromoles" => "umol",
            "nanomol" | "nanomole" | "nanomoles" => "nmol",
            "microeinstein" | "microeinsteins" => "uE",
            "watt" | "watts" => "W",
            "milliwatt" | "milliwatts" => "mW",
            "microwatt" | "microwatts" => "uW",
            "nanowatt" | "nanowatts" => "nW",
            "meter" | "meters" | "metre" | "metres" => "m",
            "centimeter" | "centimeters" | "centimetre" | "centimetres" => "cm",
            "nanometer" | "nanometers" | "nanometre" | "nanometres" => "nm",
            "micrometer" | "micrometers" | "micrometre" | "micrometres" | "microns" => "um",
            "steradian" | "steradians" | "ster" => "sr",
            "second" | "seconds" => "s",
            "joule" | "joules" => "J",
            "ergs" => "erg",
            "angstrom" | "angstroms" | "ångström" => "Å",
            "hertz" => "Hz",
            // Of astronomers.
            "photlam" => "photon/s/cm^2/Å",
            "photnu" => "photon/s/cm^2/Hz",
            "flam" => "erg/s/cm^2/Å",
            "fnu" => "erg/s/cm^2/Hz",
            "jansky" | "janskys" => "Jy",
            // Sr is written as often as sr.
            "sr" => "sr",
            _ => word,
        };
        result.push_str(symbol);
        if std::mem::take(&mut is_square) {
            result.push_str("^2");
        }
    }
    result
}

/// Splits `cm^-2 …` into its name, its exponent and the rest.
fn power(text: &str) -> Option<(&str, i32, &str)> {
    let end = text.find(|c: char| !c.is_alphabetic()).unwrap_or(text.len());
    let (name, rest) = text.split_at(end);
    let (exponent, rest) = exponent(rest)?;
    (!name.is_empty()).then_some((name, exponent, rest))
}

/// Splits `(cm^-1)^-1 …` into what is in the brackets, its exponent and the rest.
fn group(text: &str) -> Option<(&str, i32, &str)> {
    let mut depth = 0;
    let (end, _) = text.char_indices().find(|(_, c)| {
        depth += i32::from(*c == '(') - i32::from(*c == ')');
        depth == 0
    })?;
    let (exponent, rest) = exponent(&text[end + 1..])?;
    Some((&text[1..end], exponent, rest))
}

/// Splits `^-2 …` into the number and the rest; 1 where there is none.
fn exponent(text: &str) -> Option<(i32, &str)> {
    let rest = text.strip_prefix("**").or_else(|| text.strip_prefix('^')).unwrap_or(text);
    let digits = rest.strip_prefix(['-', '+', '−']).unwrap_or(rest);
    let n_digits = digits.bytes().take_while(u8::is_ascii_digit).count();
    match n_digits {
        0 => Some((1, rest)),
        1 | 2 => {
            let number: i32 = digits[..n_digits].parse().ok()?;
            let sign = if rest.starts_with(['-', '−']) { -1 } else { 1 };
            Some((sign * number, &digits[n_digits..]))
        }
        _ => None,
    }
}

/// Exponents of what a unit is made of, and its factor.
#[derive(Default)]
struct Sum {
    watts: i32,
    photons: i32,
    seconds: i32,
    metres: i32,
    steradians: i32,
    wavelengths: i32,
    /// Of what a step of frequency, energy or wavenumber may be counted in.
    hertz: i32,
    electronvolts: i32,
    wavenumbers: i32,
    moles: i32,
    log10_factor: i32,
    /// Whether a centimetre stands in it that may be one of wavelength or of a wavenumber.
    is_per_cm: bool,
}

impl Sum {
    /// Returns the sum of the exponents of a text; `None` of what is no product of units.
    fn of(text: &str) -> Option<Self> {
        let mut sum = Self::default();
        sum.add_product(&symbols(text), 1)?;
        Some(sum)
    }

    /// Adds the exponents of a product of units, so many times.
    fn add_product(&mut self, text: &str, times: i32) -> Option<()> {
        let mut rest = text.trim();
        rest = if rest.starts_with("1/") { &rest[1..] } else { rest };
        let mut sign = 1;
        while let Some(first) = rest.chars().next() {
            match first {
                '/' if sign == 1 => (sign, rest) = (-1, &rest[1..]),
                _ if first.is_whitespace() || matches!(first, '.' | '*' | '·') => rest = &rest[first.len_utf8()..],
                '(' => {
                    let (inner, exponent, after) = group(rest)?;
                    self.add_product(inner, times * sign * exponent)?;
                    (sign, rest) = (1, after);
                }
                _ => {
                    let (name, exponent, after) = power(rest)?;
                    self.add(name, times * sign * exponent)?;
                    (sign, rest) = (1, after);
                }
            }
        }
        (sign == 1).then_some(())
    }

    fn add(&mut self, name: &str, exponent: i32) -> Option<()> {
        let (what, log10) = match name {
            "J" | "erg" => {
                self.seconds += exponent;
                (&mut self.watts, if name == "J" { 0 } else { -7 })
            }
            "mol" | "mmol" | "umol" | "µmol" | "μmol" | "nmol" | "uE" | "µE" | "μE" => {
                self.moles += exponent;
                let log10 = [("mol", 0), ("mmol", -3), ("nmol", -9)].iter().find(|(own, _)| *own == name);
                (&mut self.photons, log10.map_or(-6, |(_, log10)| *log10))
            }
            // 1e-26 W m⁻² Hz⁻¹.
            "Jy" | "MJy" | "mJy" | "uJy" | "µJy" | "μJy" => {
                self.metres -= 2 * exponent;
                self.hertz -= exponent;
                let log10 = [("Jy", -26), ("MJy", -20), ("mJy", -29)].iter().find(|(own, _)| *own == name);
                (&mut self.watts, log10.map_or(-32, |(_, log10)| *log10))
            }
            "Hz" => (&mut self.hertz, 0),
            "GHz" => (&mut self.hertz, 9),
            "THz" => (&mut self.hertz, 12),
            "eV" => (&mut self.electronvolts, 0),
            // Of a wavenumber, as in W/m2/cm-1.
            "m" if exponent == 1 => (&mut self.wavenumbers, 0),
            "cm" if exponent == 1 => (&mut self.wavenumbers, -2),
            "Å" | "A" => (&mut self.wavelengths, -1),
            "W" | "watt" | "watts" => (&mut self.watts, 0),
            "kW" => (&mut self.watts, 3),
            "mW" => (&mut self.watts, -3),
            "uW" | "µW" | "μW" => (&mut self.watts, -6),
            "nW" => (&mut self.watts, -9),
            "pW" => (&mut self.watts, -12),
            "photon" | "photons" | "phot" | "quanta" | "ph" | "q" => (&mut self.photons, 0),
            "s" | "sec" => (&mut self.seconds, 0),
            "m" => (&mut self.metres, 0),
            "cm" => {
                self.is_per_cm |= exponent == -1;
                (&mut self.metres, -2)
            }
            "mm" => (&mut self.metres, -3),
            "sr" => (&mut self.steradians, 0),
            "nm" => (&mut self.wavelengths, 0),
            "um" | "µm" | "μm" | "micron" => (&mut self.wavelengths, 3),
            _ => return None,
        };
        *what += exponent;
        self.log10_factor += log10 * exponent;
        Some(())
    }

    /// Returns what a power a nanometre times the square of wavelengths is of one a step of frequency, energy or wavenumber, where it is one; `None`
    /// of what is no step.
    fn per_frequency(&self) -> Option<Option<f64>> {
        match (self.hertz, self.electronvolts, self.wavenumbers) {
            (0, 0, 0) => Some(None),
            (-1, 0, 0) => Some(Some(NM_PER_S)),
            (0, -1, 0) => Some(Some(EV_NM)),
            (0, 0, 1) => Some(Some(1e9)),
            _ => None,
        }
        .filter(|own| !self.is_per_cm && (own.is_none() || self.wavelengths == 0))
    }

    /// Returns the unit of a relative spectrum.
    fn spectral(&self) -> Option<LightUnit> {
        // What is per nm alone is a power.
        let is_bare = (self.seconds, self.metres, self.steradians, self.wavelengths) == (0, 0, 0, -1);
        let is_photons = match (self.watts, self.photons) {
            (1, 0) => false,
            (0, 0) if is_bare => false,
            (0, 1) => true,
            _ => return None,
        };
        let is_per_frequency = self.per_frequency()?.is_some();
        matches!(self.wavelengths, 0 | -1).then(|| LightUnit { is_photons, is_per_frequency, ..LightUnit::RADIANCE })
    }

    fn unit(mut self) -> Option<LightUnit> {
        // A spectral unit in metres alone: W.m^-3.sr^-1.
        if self.metres == -3 && self.wavelengths == 0 {
            self.metres = -2;
            self.log10_factor -= 9;
        }
        let is_photons = match (self.watts, self.photons, self.seconds) {
            (1, 0, 0) => false,
            (0, 1, -1) => true,
            _ => return None,
        };
        let quantity = match self.steradians {
            -1 => Quantity::Radiance,
            0 => Quantity::Irradiance,
            _ => return None,
        };
        let step = self.per_frequency()?;
        let is_light = self.metres == -2 && matches!(self.wavelengths, 0 | -1);
        is_light.then(|| LightUnit {
            quantity,
            factor: 10.0_f64.powi(self.log10_factor) * PER_MOLE.powi(self.moles) * step.unwrap_or(1.0),
            is_photons,
            is_per_frequency: step.is_some(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[track_caller]
    fn check(text: &str, quantity: Quantity, per_watt: f64) {
        let unit = LightUnit::parse(text).unwrap();
        assert_eq!((unit.quantity, unit.is_photons), (quantity, false), "{text}");
        assert_relative_eq!(unit.factor, per_watt, max_relative = 1e-15);
    }

    #[test]
    fn units_are_read_in_every_spelling() {
        for text in [
            "W.m^-2.sr^-1",
            "W.m^-2.sr^-1.nm^-1",
            "W/m^2/sr/nm",
            "W/(m^2 sr nm)",
            "W m-2 sr-1 nm-1",
            "W / (m^2 * sr * nm)",
            "W·m−2·sr−1·nm−1",
            "W m**-2 sr**-1 nm**-1",
            "W m⁻² sr⁻¹ nm⁻¹",
            "Watts/Square Meter/Steradian/Nanometer",
            "watts per square metre per steradian per nanometre",
            "W/m2/Sr/nm",
        ] {
            check(text, Quantity::Radiance, 1.0);
        }
        check("W . m^-2", Quantity::Irradiance, 1.0);
        // 1 µW/cm² is 0.01 W/m²; a micrometre holds a thousand nanometres.
        check("uW/cm^2/nm/sr", Quantity::Radiance, 1e-2);
        check("µW/(cm^2 nm sr)", Quantity::Radiance, 1e-2);
        check("Microwatts per sq cm per ster per nanometer", Quantity::Radiance, 1e-2);
        check("µW/cm²/nm/sr", Quantity::Radiance, 1e-2);
        check("W/m^2/sr/um", Quantity::Radiance, 1e-3);
        check("mW/(m^2 sr nm)", Quantity::Radiance, 1e-3);
        check("W.m^-3.sr^-1", Quantity::Radiance, 1e-9);
    }

    #[test]
    fn photons_carry_their_energy() {
        for text in ["photons/s/m^2/sr/nm", "photon.s^-1.m^-2.sr^-1.nm^-1", "q/(s m^2 sr nm)"] {
            let mut plane = Array2::from_elem((1, 1), 1e15);
            LightUnit::parse(text).unwrap().convert(&mut plane, 550.0);
            // A photon of 550 nm has 3.6117e-19 J (CODATA: h c = 1.98644586e-25 J m).
            assert_relative_eq!(plane[(0, 0)], 3.611_72e-4, max_relative = 1e-5);
        }
    }

    #[test]
    fn steps_of_frequency_become_those_of_wavelength() {
        // At 500 nm a nanometre is 40 cm⁻¹, 1.199 170 THz and 4.959 368 meV.
        for (text, expected) in [
            ("W/m2/cm-1/sr", 40.0),
            ("W m-2 sr-1 cm", 40.0),
            ("mW/(m^2 sr cm^-1)", 0.04),
            ("W m-2 sr-1 (cm-1)-1", 40.0),
            ("W m-2 sr-1 (cm^-1)^-1", 40.0),
            ("(W/m^2/sr)/(cm^-1)", 40.0),
            ("W m^{-2} sr^{-1} (cm^{-1})^{-1}", 40.0),
            ("mW/(m^2/sr^-1)/cm^-1", 0.04),
            ("W/m^2/sr/THz", 1.199_169_832),
            ("W/m2/sr/eV", 4.959_367_936e-3),
            ("MJy/sr", 1.199_169_832e-8),
            ("erg/s/cm2/sr/A", 1e-2),
        ] {
            let unit = LightUnit::parse(text).unwrap();
            assert_relative_eq!(unit.factor_at(500.0), expected, max_relative = 1e-9);
            assert!(!LightUnit::lacks_wavelength(text), "{text}");
        }
        // A micromole of photons of 550 nm has 0.217 502 J.
        let unit = LightUnit::parse("umol/m2/s/nm").unwrap();
        assert_relative_eq!(unit.factor_at(550.0), 0.217_502, max_relative = 1e-5);
    }

    #[test]
    fn words_end_in_units() {
        let unit = |text| LightUnit::in_words(text).map(|(_, words)| words);
        for (text, expected) in [
            ("Radiance (uW/cm2/nm/sr)", "uW/cm2/nm/sr"),
            ("Radiance W/(m2 sr um)", "W/(m2 sr um)"),
            ("calibrated radiance (units: uW nm-1 cm-2 sr-1)", "uW nm-1 cm-2 sr-1"),
        ] {
            assert_eq!(unit(text), Some(expected), "{text}");
        }
        assert_eq!([unit("Radiance"), unit("Counts"), unit("Temperature (K)")], [None; 3]);
        let spectrum = |text| LightUnit::of_spectrum(text).map(|(own, before)| (own.divisor_at(10.0), before));
        for (text, expected) in [
            ("power (W)", (1.0, "power (")),
            ("W/nm", (1.0, "")),
            ("irradiance W/m2/cm-1", (100.0, "irradiance ")),
            ("photons", (10.0, "")),
            ("PFD (umol m-2 s-1 nm-1)", (10.0, "PFD (")),
            ("log10(W)", (1.0, "log10(")),
        ] {
            assert_eq!(spectrum(text), Some(expected), "{text}");
        }
        assert_eq!([spectrum("power"), spectrum("A/W"), spectrum("counts")], [None; 3]);
    }

    #[test]
    fn other_units_are_none() {
        for text in
            ["", "photons", "lm", "W", "W/m^4", "DN", "W/m^2 sr", "W m-2 sr-2", "W/(m^2", "reflectance", "W^999", "é"]
        {
            assert_eq!(LightUnit::parse(text), None, "{text}");
        }
    }
}
