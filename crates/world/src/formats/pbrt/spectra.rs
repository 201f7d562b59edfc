//! Spectra of pbrt files.

use dioptric_optics::{Glass, GlassCatalogue};
use dioptric_spectrum::{Illuminant, Observer, Spectrum, WavelengthGrid, Xyz, blackbody, blackbody_peak};

use super::{Fault, Reader, Version, params::Param};
use crate::{Beyond, MetalKind, SpectralCurve};

/// What a spectrum is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SpectrumUse {
    Reflectance,
    Light,
    Index,
}

impl Reader<'_> {
    /// Returns the curve of a parameter, or `None` with a note where it isn't understood.
    pub(super) fn curve(&mut self, param: &Param<'_>, of: SpectrumUse) -> Result<Option<SpectralCurve>, Fault> {
        let wrong = |expected: &str| Fault::Here(format!("the parameter '{}': expected {expected}", param.name));
        let beyond = if of == SpectrumUse::Light { Beyond::Zero } else { Beyond::Held };
        let three = || <[f64; 3]>::try_from(param.numbers.as_slice()).map_err(|_| wrong("three numbers"));
        let colored = |rgb: [f64; 3]| {
            let rgb = rgb.map(|v| v as f32);
            match of {
                SpectrumUse::Reflectance => SpectralCurve::from_rgb_reflectance(rgb),
                SpectrumUse::Light => SpectralCurve::from_rgb_light(rgb),
                SpectrumUse::Index => SpectralCurve::constant(rgb.iter().sum::<f32>() / 3.0),
            }
        };
        if let ("rgb" | "color", true) = (param.kind, of != SpectrumUse::Index) {
            let most = if of == SpectrumUse::Light { f64::INFINITY } else { 1.0 };
            if param.numbers.iter().any(|v| !(0.0..=most).contains(v)) {
                let sentence = match of {
                    SpectrumUse::Light => "colors of lights below 0: 0 in place of that",
                    _ => "colors of surfaces beyond 0 to 1: the nearest in their place",
                };
                self.builder.note_of(sentence, param.name);
            }
        }
        Ok(Some(match param.kind {
            "rgb" | "color" => colored(three()?),
            "xyz" => colored(Xyz(three()?).to_linear_srgb()),
            "float" => match *param.numbers {
                [value, ref more @ ..] => {
                    if !more.is_empty() {
                        self.builder.note_of("numbers of parameters behind the first, left out", param.name);
                    }
                    SpectralCurve::constant(value as f32)
                }
                [] => return Err(wrong("a number")),
            },
            "blackbody" => {
                let kelvin = *param.numbers.first().ok_or_else(|| wrong("a temperature, K"))?;
                if !(100.0..=1e6).contains(&kelvin) {
                    return Err(wrong("a temperature from 100 to 1000000 K"));
                }
                // Both versions scale a black body so that its peak is 1; the third has a factor after it.
                let factor = param.numbers.get(1).copied().unwrap_or(1.0);
                SpectralCurve::new(&blackbody(kelvin).scaled(factor / blackbody_peak(kelvin)), beyond)
            }
            "spectrum" if !param.numbers.is_empty() => {
                SpectralCurve::new(&knots(&param.numbers).map_err(Fault::Here)?, beyond)
            }
            "spectrum" => {
                let name = *param.texts.first().ok_or_else(|| wrong("numbers or a name"))?;
                return self.named_curve(name, beyond);
            }
            kind => {
                let sentence = format!("parameters of type '{kind}': not supported, their defaults stand");
                self.builder.note_of(&sentence, param.name);
                return Ok(None);
            }
        }))
    }

    fn named_curve(&mut self, name: &str, beyond: Beyond) -> Result<Option<SpectralCurve>, Fault> {
        let key = format!("{name} {beyond:?}");
        if let Some(curve) = self.named_curves.get(&key) {
            return Ok(Some(curve.clone()));
        }
        let curve = match (named_spectrum(name, beyond), self.find_file(name)) {
            (Some(curve), _) => curve,
            (None, Some(path)) => {
                let bytes = super::read_bytes(&path, self.bytes_left)?;
                self.bytes_left -= bytes.len() as u64;
                let spectrum = spectrum_file(&String::from_utf8_lossy(&bytes))
                    .map_err(|(line, reason)| crate::WorldError::Line { file: path, line, reason })?;
                SpectralCurve::new(&spectrum, beyond)
            }
            (None, None) => {
                self.builder.note_of("spectra that are neither a known name nor a file, their defaults stand", name);
                return Ok(None);
            }
        };
        self.named_curves.insert(key, curve.clone());
        Ok(Some(curve))
    }

    /// Returns the light of a parameter times `scale`, in the file's version's sense of scale.
    pub(super) fn light_curve(&mut self, param: Option<&Param<'_>>, scale: f64) -> Result<SpectralCurve, Fault> {
        let curve = match param {
            Some(param) => self.curve(param, SpectrumUse::Light)?,
            None => None,
        };
        let curve = curve.unwrap_or_else(|| SpectralCurve::from_rgb_light([1.0; 3]));
        let is_spectrum = param.is_some_and(|param| !matches!(param.kind, "rgb" | "color"));
        if self.version < Version::Four || !is_spectrum {
            return Ok(curve.scaled(scale as f32));
        }
        // The fourth version scales every spectrum of a light so that its mean weighted by the photopic sensitivity is 1.
        let mean = photopic_mean(&curve)?;
        Ok(curve.scaled(if mean > 0.0 { (scale / mean) as f32 } else { 0.0 }))
    }
}

/// Returns the mean of a curve weighted by the photopic sensitivity.
pub(crate) fn photopic_mean(curve: &SpectralCurve) -> Result<f64, String> {
    let grid = WavelengthGrid::uniform(360.0, 830.0, 1.0).map_err(|e| e.to_string())?;
    let sensitivity = &Observer::Cie1931.weights(&grid)[1];
    let weighted: f64 =
        grid.centers_nm().iter().zip(sensitivity).map(|(&w, y)| y * f64::from(curve.at(&[w as f32])[0])).sum();
    Ok(weighted / sensitivity.iter().sum::<f64>())
}

fn knots(numbers: &[f64]) -> Result<Spectrum, String> {
    let pairs = numbers.chunks_exact(2);
    if !pairs.remainder().is_empty() {
        return Err(format!("a spectrum of {} numbers: expected pairs of wavelength and value", numbers.len()));
    }
    let (wavelengths_nm, values) = pairs.map(|pair| (pair[0], pair[1])).unzip();
    Spectrum::new(wavelengths_nm, values).map_err(|e| e.to_string())
}

/// Reads a table of wavelengths, nm, and values, a pair a line; the error has its line.
fn spectrum_file(text: &str) -> Result<Spectrum, (usize, String)> {
    let (mut wavelengths_nm, mut values) = (Vec::new(), Vec::new());
    for (index, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or("");
        let mut words = line.split_ascii_whitespace();
        let (Some(wavelength), value) = (words.next(), words.next()) else { continue };
        let pair = (wavelength.parse(), value.unwrap_or("").parse());
        let (Ok(wavelength_nm), Ok(value)) = pair else {
            return Err((index + 1, format!("'{}': expected a wavelength and a value", line.trim())));
        };
        wavelengths_nm.push(wavelength_nm);
        values.push(value);
    }
    Spectrum::new(wavelengths_nm, values).map_err(|e| (text.lines().count().max(1), e.to_string()))
}

/// Returns a spectrum that pbrt has a name for: metals, glasses and standard illuminants.
fn named_spectrum(name: &str, beyond: Beyond) -> Option<SpectralCurve> {
    if let Some(metal) = name.strip_prefix("metal-") {
        let (metal, part) = metal.rsplit_once('-')?;
        let [n, k] = MetalKind::named(metal)?.index();
        return match part {
            "eta" => Some(n),
            "k" => Some(k),
            _ => None,
        };
    }
    if let Some(glass) = name.strip_prefix("glass-") {
        // pbrt leaves the makers out, and the N of newer kinds.
        let found = ["", "N-"].iter().find_map(|prefix| {
            let name = format!("{prefix}{glass}");
            let makers = ["SCHOTT".to_owned()];
            GlassCatalogue::built_in().find_among(&name, &makers).ok().map(|glass| glass.full_name())
        })?;
        return SpectralCurve::from_glass(&Glass::Named(found)).ok();
    }
    let illuminant = name.strip_prefix("stdillum-")?;
    let illuminant = match illuminant {
        "F2" => "FL2",
        "F11" => "FL11",
        other => other,
    };
    Some(SpectralCurve::new(&Illuminant::named(illuminant).ok()?.spectrum(), beyond))
}
