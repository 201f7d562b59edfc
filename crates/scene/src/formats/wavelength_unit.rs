//! Units in which files state wavelengths, and the order of bands by them.

use std::path::Path;

use super::{
    column_names::is_no_wavelength,
    stated::{short, shown},
};
use crate::SceneError;

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
        "angstroms" | "angstrom" | "ångström" | "å" | "aa" | "a" => times(0.1),
        "wavenumber" | "cm-1" | "cm^-1" | "cm⁻¹" | "1/cm" => over(1e7),
        "hz" => over(NM_PER_S),
        "ghz" => over(1e-9 * NM_PER_S),
        "thz" => over(1e-12 * NM_PER_S),
        "ev" | "electronvolt" | "electronvolts" => over(EV_NM),
        _ => None,
    }
}

/// Returns a list whose unit nothing states as nm, where it can be of nm or of µm alone; `None` of all else, as of counted bands.
pub(super) fn without_unit(numbers: &[f64]) -> Option<Vec<f64>> {
    let all = |range: std::ops::Range<f64>| numbers.iter().all(|number| range.contains(number));
    if !are_counted(numbers) && all(0.15..20.0) {
        return in_nm("um", numbers);
    }
    let are_angstrom = !numbers.is_empty() && numbers.iter().all(|number| *number >= MAYBE_ANGSTROM);
    (all(150.0..20_000.0) && !are_angstrom).then(|| numbers.to_vec())
}

/// Whether numbers count bands, from 0 or 1, or are those of some of them, as 2, 3, 4 and 8 of a satellite.
pub(super) fn are_counted(numbers: &[f64]) -> bool {
    let are_in_turn = numbers.windows(2).all(|pair| pair[1] - pair[0] == 1.0)
        && numbers.first().is_some_and(|first| [0.0, 1.0].contains(first));
    numbers.len() > 1
        && (are_in_turn || numbers.iter().all(|number| number.fract() == 0.0 && (0.0..20.0).contains(number)))
}

/// Returns the wavelengths, nm, of a list beside a cube, as its unit says or as [`without_unit`]; `None` of a list that counts bands.
///
/// # Errors
/// When its unit is not known, or its numbers are no likely wavelengths.
pub(super) fn listed_nm(name: &str, unit: Option<&str>, numbers: &[f64]) -> Result<Option<Vec<f64>>, String> {
    list_of(name, unit, numbers, ", or --scene-wavelengths-nm")
}

fn list_of(name: &str, unit: Option<&str>, numbers: &[f64], or: &str) -> Result<Option<Vec<f64>>, String> {
    // A letter that may also tell one camera from another.
    let last = name.trim_end_matches([']', ')']).rsplit(['_', '[', '(', ' ']).next();
    let is_angstrom =
        last == Some("A") && numbers.iter().all(|number| (1500.0..PLAUSIBLE_NM.end() * 10.0).contains(number));
    let Some(unit) = unit.or(is_angstrom.then_some("A")) else {
        if are_counted(numbers) {
            return Ok(None);
        }
        let reason = || {
            let is_odd = |number: &&f64| !(0.15..20_000.0).contains(*number);
            if let Some(odd) = numbers.iter().find(is_odd).filter(|_| !numbers.iter().all(|number| is_odd(&number))) {
                return format!(
                    "its '{}' holds {}, which is no wavelength of light: expected nm{or}",
                    short(name),
                    shown(*odd)
                );
            }
            let shown = numbers.iter().take(3).map(|number| shown(*number)).collect::<Vec<_>>().join(", ");
            format!("its '{}' ({shown}, …) has no unit and is no likely nm or µm: expected nm{or}", short(name))
        };
        return without_unit(numbers).map(Some).ok_or_else(reason);
    };
    let own = in_nm(unit, numbers)
        .ok_or_else(|| format!("its '{}' are in '{}': expected {UNITS}{or}", short(name), short(unit)))?;
    match own.iter().zip(numbers).find(|(nm, _)| !PLAUSIBLE_NM.contains(*nm)) {
        Some((_, number)) => {
            Err(format!("{} of its '{}' in {} is no wavelength of light", shown(*number), short(name), short(unit)))
        }
        None => Ok(Some(own)),
    }
}

/// Returns the unit of wavelengths, wavenumbers, frequencies or energies that a name is or has among its words, as `wavelength_um`.
pub(super) fn unit_in(name: &str) -> Option<&str> {
    // Single letters are in too many names.
    let is_unit = |word: &&str| (word.chars().count() > 1 || *word == "Å") && in_nm(word, &[]).is_some();
    const BETWEEN: [char; 11] = ['/', '_', ' ', '-', ',', '\t', '[', ']', '(', ')', '.'];
    // A capital behind a small letter begins a word.
    let behind = |word: &&str| {
        let starts = word.char_indices().zip(word.chars().skip(1));
        let starts = starts.filter(|((_, a), b)| a.is_lowercase() && b.is_uppercase());
        starts.last().map(|((at, a), _)| at + a.len_utf8())
    };
    Some(name.trim())
        .filter(is_unit)
        .or_else(|| name.rsplit(BETWEEN).find(is_unit))
        .or_else(|| name.rsplit(BETWEEN).find_map(|word| Some(&word[behind(&word)?..]).filter(is_unit)))
}

/// Returns the wavelengths, nm, of the column of a table, as the unit in its name says (`wavelength_nm`, `Wavelength (µm)`, `cm^-1`), or that in a
/// comment on wavelengths which they can be in, or, where there is none, its numbers.
///
/// # Errors
/// When its unit is not known, or its numbers are no likely wavelengths, or may be nm as well as Å.
pub(super) fn wavelengths_of_column<'a>(
    name: &str,
    numbers: &[f64],
    comments: impl IntoIterator<Item = &'a str>,
) -> Result<Vec<f64>, String> {
    if is_no_wavelength(name) {
        return Err(format!(
            "its column '{}' holds no wavelengths: expected such in nm, and in its name that they are",
            short(name)
        ));
    }
    let bracketed = name.rsplit_once(['(', '[']).map(|(_, rest)| rest.trim_end_matches([')', ']', ' ']));
    let can_be = |unit: &&str| {
        let nm = in_nm(unit, numbers);
        nm.is_some_and(|own| own.iter().all(|nm| PLAUSIBLE_NM.contains(nm)))
    };
    let unit = bracketed.or_else(|| unit_in(name));
    let unit = unit.or_else(|| comments.into_iter().filter_map(unit_of_waves).find(can_be));
    if unit.is_none()
        && !name.ends_with('A')
        && !numbers.is_empty()
        && numbers.iter().all(|number| *number >= MAYBE_ANGSTROM)
    {
        return Err(format!(
            "its wavelengths, {} and more, have no unit and may be nm or Å: expected it in the name of their column",
            shown(numbers.iter().copied().fold(f64::INFINITY, f64::min))
        ));
    }
    let name = if name.is_empty() { "first column" } else { name };
    let counted = || format!("its '{}' counts bands: expected wavelengths in nm", short(name));
    list_of(name, unit, numbers, "")?.ok_or_else(counted)
}

/// Numbers from which on wavelengths without a unit may be Å: no light of so many nm is seen.
const MAYBE_ANGSTROM: f64 = 2500.0;

/// Returns the comments of a table, which begin with #.
pub(super) fn comments_of(text: &str) -> impl Iterator<Item = &str> {
    text.lines().filter_map(|line| line.strip_prefix('#')).map(str::trim).filter(|comment| !comment.is_empty())
}

/// Returns what stands behind the last word for a unit.
pub(super) fn behind_unit(text: &str) -> Option<&str> {
    let at = text.to_lowercase().rfind("unit")?;
    Some(text.get(at + "unit".len()..)?.trim_start_matches(['s', ')', ':', '=', ' ']))
}

/// Returns the first unit behind a word for wavelengths, or one alone behind a word for a unit, or that which a text begins with, as names of columns do.
pub(super) fn unit_of_waves(text: &str) -> Option<&str> {
    if let Some(unit) = behind_unit(text).filter(|own| unit_in(own) == Some(own)) {
        return Some(unit);
    }
    let lower = text.to_lowercase();
    let at = ["wavelength", "lambda", "wavenumber", "frequency"].iter().find_map(|word| lower.find(word));
    let mut words = text.get(at.unwrap_or(0)..)?.split(|c: char| c.is_whitespace() || ",;:=[]()".contains(c));
    match at {
        Some(_) => words.find(|word| unit_in(word).is_some() || *word == "A"),
        None => words.next().filter(|word| unit_in(word).is_some()),
    }
}

/// Returns the wavelength of a text such as `450 nm`, `Band 450.5nm, FWHM 10 nm` or, of a band, `445-455 nm`: the first that it names.
pub(super) fn wavelength_in(text: &str) -> Option<f64> {
    let number = |text: &str| -> Option<f64> {
        let number = text.rsplit(|c: char| !(c.is_ascii_digit() || c == '.')).next()?;
        number.parse().ok().filter(|nm| *nm > 0.0)
    };
    let named = |(at, _): (usize, &str)| {
        let is_word = !text[at + 2..].starts_with(char::is_alphanumeric);
        let before = text[..at].trim_end();
        let last = number(before).filter(|_| is_word)?;
        let start = before.trim_end_matches(|c: char| c.is_ascii_digit() || c == '.').trim_end();
        let first = ["-", "–", "to"].iter().find_map(|sign| number(start.strip_suffix(sign)?.trim_end()));
        // No wider than a filter's: `2 - 450 nm` counts the band.
        let first = first.filter(|first| *first < last && last - first <= 100.0);
        Some(first.map_or(last, |first| 0.5 * (first + last)))
    };
    text.match_indices("nm").find_map(named)
}

/// Returns these bands of a file, counted from 0, by ascending wavelength.
///
/// # Errors
/// Names a band, counted from 1, that lies at no wavelength of light, or two that lie at one.
pub(super) fn ascending(
    path: &Path,
    wavelengths_nm: &[f64],
    bands: impl IntoIterator<Item = usize>,
) -> Result<Vec<usize>, SceneError> {
    let mut order: Vec<usize> = bands.into_iter().collect();
    let wrong = |reason: String| SceneError::Units { file: path.to_owned(), reason };
    if let Some(band) = order.iter().find(|band| !PLAUSIBLE_NM.contains(&wavelengths_nm[**band])) {
        return Err(wrong(format!(
            "its band {} lies at {} nm: expected a wavelength of light in nm, in the file or by --scene-wavelengths-nm",
            band + 1,
            shown(wavelengths_nm[*band])
        )));
    }
    order.sort_by(|&a, &b| wavelengths_nm[a].total_cmp(&wavelengths_nm[b]));
    match order.windows(2).find(|pair| wavelengths_nm[pair[0]] == wavelengths_nm[pair[1]]) {
        Some(pair) => Err(wrong(format!(
            "its bands {} and {} lie both at {} nm: expected a wavelength of its own for each",
            pair[0] + 1,
            pair[1] + 1,
            wavelengths_nm[pair[0]]
        ))),
        None => Ok(order),
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

    #[test]
    fn lists_without_a_unit_are_nm_or_micrometres_or_no_wavelengths() {
        let of = |unit, numbers: &[f64]| listed_nm("waves", unit, numbers);
        assert_eq!(of(None, &[0.45, 0.55]), Ok(Some(vec![450.0, 550.0])));
        assert_eq!(of(None, &[450.0, 550.0]), Ok(Some(vec![450.0, 550.0])));
        assert_eq!(of(None, &[1.0, 2.0, 3.0]), Ok(None));
        assert_eq!(of(None, &[2.0, 3.0, 4.0, 8.0]), Ok(None));
        assert_eq!(of(Some("THz"), &[599.584_916]).map(|list| list.map(|list| list[0].round())), Ok(Some(500.0)));
        for (unit, numbers) in [
            (None, [22_222.0, 15_384.0]),
            (None, [4500.0, 6200.0]),
            (Some("zorp"), [1.0, 2.0]),
            (Some("um"), [450.0, 550.0]),
        ] {
            assert!(of(unit, &numbers).unwrap_err().contains("'waves'"), "{unit:?}");
        }
    }

    #[test]
    fn columns_state_their_unit_in_their_name() {
        for (name, number) in [
            ("wavelength_nm", 500.0),
            ("Wavelength (nm)", 500.0),
            ("λ [µm]", 0.5),
            ("Wavelength/nm", 500.0),
            ("cm^-1", 20_000.0),
            ("wavenumber (1/cm)", 20_000.0),
            ("Wavelength Å", 5000.0),
            ("Wavelength angstrom", 5000.0),
            ("wavelengthAngstrom", 5000.0),
            ("wavelengths_A", 5000.0),
            ("wavelengths_A", 500.0),
            ("wavelength_AA", 5000.0),
            ("wavelength[A]", 5000.0),
            ("wavelength", 0.5),
            ("", 500.0),
        ] {
            let nm = wavelengths_of_column(name, &[number], []).map(|nm| nm[0].round());
            assert_eq!(nm, Ok(500.0), "{name}");
        }
        assert!(wavelengths_of_column("waves (zorp)", &[500.0], []).unwrap_err().contains("'zorp'"));
        assert!(wavelengths_of_column("band", &[1.0, 2.0], []).unwrap_err().contains("counts bands"));
        // Comments say it where they can be right.
        for (comment, number) in [
            ("Wavelength (Angstroms), flux (W/um)", 5000.0),
            ("lambda: A", 5000.0),
            ("wavelength in angstrom", 5000.0),
            ("Angstrom power", 5000.0),
            ("Wavelength (1/cm), flux (erg/s/cm2/A)", 20_000.0),
            ("1/cm power", 20_000.0),
        ] {
            assert_eq!(wavelengths_of_column("", &[number], [comment]), Ok(vec![500.0]), "{comment}");
        }
        for comment in ["made by A", "a slit of 10 um", "calibrated wavelengths, slit of 10 um"] {
            assert!(wavelengths_of_column("", &[5000.0], [comment]).unwrap_err().contains("nm or Å"), "{comment}");
            assert_eq!(wavelengths_of_column("", &[500.0], [comment]), Ok(vec![500.0]), "{comment}");
        }
        assert_eq!(wavelengths_of_column("nm", &[5000.0], ["wavelength in Å"]), Ok(vec![5000.0]));
    }

    #[test]
    fn words_name_wavelengths() {
        for text in [
            "450 nm",
            "Band 450nm",
            "450 nm, FWHM 10 nm",
            "445-455 nm",
            "445 – 455nm",
            "445 to 455 nm",
            "B-450.0 nm",
            "2 - 450 nm",
        ] {
            assert_eq!(wavelength_in(text), Some(450.0), "{text}");
        }
        assert_eq!(["450", "450 nmol", "nm", "0 nm"].map(wavelength_in), [None; 4]);
    }

    #[test]
    fn bands_that_are_none_or_twice_are_named_as_they_stand_in_the_file() {
        let of = |list: &[f64]| ascending(Path::new("a.hdr"), list, 0..list.len()).map_err(|error| error.to_string());
        assert_eq!(of(&[600.0, 450.0, 500.0]), Ok(vec![1, 2, 0]));
        assert!(of(&[600.0, 450.0, 600.0]).unwrap_err().contains("its bands 1 and 3 lie both at 600 nm"));
        assert!(of(&[f64::NAN, 450.0]).unwrap_err().contains("its band 1 lies at NaN nm"));
        // A band that is left out may be what it likes.
        assert_eq!(ascending(Path::new("a"), &[f64::NAN, 450.0], [1]).unwrap(), [1]);
    }
}
