//! The names of spectral channels: `S0.550,000000nm`, `T.5,5e-7m`, `S0.545THz` (Fichet et al. 2021, and pbrt's spectral film),
//! `360.00-375.67nm` (a bin of Mitsuba 0.6) and the bare `550nm`.

use dioptric_spectrum::Quantity;

use super::wavelength_unit::PLAUSIBLE_NM;

/// Metres a second.
const SPEED_OF_LIGHT: f64 = 299_792_458.0;

/// What a spectral channel holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BandKind {
    /// `S0`: emitted or received light.
    Emissive,
    /// `T`: a reflectance or transmittance factor.
    Reflective,
}

/// Returns the name of the channel of a band.
pub(super) fn of(quantity: Quantity, wavelength_nm: f64) -> String {
    let kind = match quantity {
        Quantity::Radiance | Quantity::Irradiance => BandKind::Emissive,
        Quantity::Reflectance => BandKind::Reflective,
    };
    format(kind, wavelength_nm)
}

/// Returns the kind and wavelength (nm) of a channel name, or `None` if it is no spectral channel.
///
/// The decimal sign may be a comma or a point; polarised (`S1`–`S3`) and fluorescent channels are left alone. A wavelength alone
/// holds light; of a bin the wavelength is its middle.
pub(crate) fn parse(name: &str) -> Option<(BandKind, f64)> {
    if let Some(rest) = name.strip_prefix("S0.") {
        return Some((BandKind::Emissive, wavelength_nm(rest)?));
    }
    if let Some(rest) = name.strip_prefix("T.") {
        return Some((BandKind::Reflective, wavelength_nm(rest)?));
    }
    if !name.starts_with(|c: char| c.is_ascii_digit()) {
        return None;
    }
    if let Some((first, last)) = name.strip_suffix("nm").and_then(|bin| bin.split_once('-'))
        && let (Ok(first_nm), Ok(last_nm)) = (first.parse::<f64>(), last.parse::<f64>())
    {
        let is_bin = first_nm > 0.0 && last_nm > first_nm && last_nm.is_finite();
        return is_bin.then_some((BandKind::Emissive, 0.5 * (first_nm + last_nm)));
    }
    Some((BandKind::Emissive, wavelength_nm(name)?))
}

/// Returns the name of the layer that a band is in: `a` of `a.S0.550nm`; `None` of a band that is in none, of polarised and fluorescent channels, and of others.
pub(super) fn layer_of(name: &str) -> Option<&str> {
    let is_layer = |prefix: &str| {
        let last = prefix.rsplit('.').next().unwrap_or_default();
        !prefix.is_empty() && !["S0", "S1", "S2", "S3", "T"].contains(&last) && parse(prefix).is_none()
    };
    let is_band = |band: &str| parse(band).is_some_and(|(_, nm)| PLAUSIBLE_NM.contains(&nm));
    if parse(name).is_some() {
        return None;
    }
    let found = name.match_indices('.').find(|(at, _)| is_layer(&name[..*at]) && is_band(&name[at + 1..]));
    found.map(|(at, _)| &name[..at])
}

/// Returns the wavelength (nm) of a number with a unit.
fn wavelength_nm(text: &str) -> Option<f64> {
    let (number, unit) = split_number(text)?;
    let value: f64 = number.replace(',', ".").parse().ok()?;
    let wavelength_nm = if let Some(prefix) = unit.strip_suffix("Hz") {
        1e9 * SPEED_OF_LIGHT / (value * prefix_factor(prefix)?)
    } else {
        // nm first: 1e9 × 1e-9 is not exactly 1.
        match unit.strip_suffix('m')? {
            "n" => value,
            prefix => 1e9 * prefix_factor(prefix)? * value,
        }
    };
    (wavelength_nm.is_finite() && wavelength_nm > 0.0).then_some(wavelength_nm)
}

/// Returns the name of a band; parsed again it gives the same wavelength to the bit.
fn format(kind: BandKind, wavelength_nm: f64) -> String {
    let prefix = match kind {
        BandKind::Emissive => "S0",
        BandKind::Reflective => "T",
    };
    let mut number = format!("{wavelength_nm:.6}");
    if number.parse() != Ok(wavelength_nm) {
        number = format!("{wavelength_nm}");
    }
    format!("{prefix}.{}nm", number.replace('.', ","))
}

/// Splits `5,5e2nm` into number and unit.
fn split_number(text: &str) -> Option<(&str, &str)> {
    let bytes = text.as_bytes();
    let digits = |from: usize| from + bytes[from..].iter().take_while(|b| b.is_ascii_digit()).count();
    let mut end = digits(0);
    if matches!(bytes.get(end), Some(b',' | b'.')) {
        end = digits(end + 1);
    }
    // An exponent has a digit after the e and its sign; else the E is the prefix exa.
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
        let exponent_end = digits((end + 1 + sign).min(bytes.len()));
        if exponent_end > end + 1 + sign {
            end = exponent_end;
        }
    }
    (end > 0).then(|| text.split_at(end))
}

fn prefix_factor(prefix: &str) -> Option<f64> {
    Some(match prefix {
        "Y" => 1e24,
        "Z" => 1e21,
        "E" => 1e18,
        "P" => 1e15,
        "T" => 1e12,
        "G" => 1e9,
        "M" => 1e6,
        "k" => 1e3,
        "h" => 1e2,
        "da" => 1e1,
        "" => 1.0,
        "d" => 1e-1,
        "c" => 1e-2,
        "m" => 1e-3,
        "u" => 1e-6,
        "n" => 1e-9,
        "p" => 1e-12,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[track_caller]
    fn check(name: &str, kind: BandKind, wavelength_nm: f64) {
        let (found, nm) = parse(name).unwrap();
        assert_eq!(found, kind);
        assert_relative_eq!(nm, wavelength_nm, max_relative = 1e-14);
    }

    #[test]
    fn every_way_to_write_a_wavelength_is_read() {
        check("S0.550,000000nm", BandKind::Emissive, 550.0);
        check("S0.550,000nm", BandKind::Emissive, 550.0);
        check("S0.550nm", BandKind::Emissive, 550.0);
        check("S0.550.5nm", BandKind::Emissive, 550.5);
        check("S0.5.5e2nm", BandKind::Emissive, 550.0);
        check("T.5,5E+2nm", BandKind::Reflective, 550.0);
        check("T.5,5e-7m", BandKind::Reflective, 550.0);
        check("T.0,55um", BandKind::Reflective, 550.0);
        check("S0.550000pm", BandKind::Emissive, 550.0);
        check("S0.500THz", BandKind::Emissive, 599.584916);
        check("S0.0,0005EHz", BandKind::Emissive, 599.584916);
        check("S0.5e14Hz", BandKind::Emissive, 599.584916);
        check("550nm", BandKind::Emissive, 550.0);
        check("550.25nm", BandKind::Emissive, 550.25);
        check("0,55um", BandKind::Emissive, 550.0);
        check("360.00-375.50nm", BandKind::Emissive, 367.75);
    }

    #[test]
    fn other_channels_are_left_alone() {
        for name in [
            "R",
            "Z",
            "S1.550nm",
            "T.400nm.550nm",
            "S0.",
            "S0.nm",
            "S0.0nm",
            "S0.550",
            "S0.550xm",
            "T.é",
            "",
            "550",
            "7",
            "2.A",
            "400-300nm",
            "0-1nm",
            "-1-2nm",
            "1e-7",
        ] {
            assert_eq!(parse(name), None, "{name}");
        }
    }

    #[test]
    fn bands_lie_in_layers() {
        for (name, layer) in [
            ("a.S0.450,5nm", Some("a")),
            ("a.b.T.450nm", Some("a.b")),
            ("a.450.5nm", Some("a")),
            ("S0.450.5nm", None),
            ("S1.450nm", None),
            ("a.S1.450nm", None),
            ("T.400nm.550nm", None),
            ("depth.1m", None),
            ("a.R", None),
        ] {
            assert_eq!(layer_of(name), layer, "{name}");
        }
    }

    #[test]
    fn names_come_back_to_the_bit() {
        assert_eq!(format(BandKind::Emissive, 550.0), "S0.550,000000nm");
        for nm in [400.0, 366.551, 1000.0 / 3.0, 589.294_123_456_789] {
            assert_eq!(parse(&format(BandKind::Reflective, nm)), Some((BandKind::Reflective, nm)));
        }
    }
}
