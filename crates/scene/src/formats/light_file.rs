//! Files of lights: tables of two columns, and those of `ISETCam`.

use std::path::Path;

use dioptric_files::text;
use dioptric_spectrum::{Illuminant, Spectrum};

use super::{
    column_names::{counts_photons, is_no_power},
    contents::is_of,
    light_unit::LightUnit,
    mat::{has_variable, read_mat_matrices},
    stated::short,
    unusable::unreadable,
    wavelength_unit::{behind_unit, comments_of, unit_in, unit_of_waves, wavelengths_of_column},
};
use crate::SceneError;

/// Whether a text is the name of the file of a light, by its ending or because it is there and no light is called so.
pub fn is_light_file(path: &Path) -> bool {
    let is_light = || path.to_str().is_some_and(|text| Illuminant::parse(text).is_ok());
    let is_there = || path.is_file() && (path.extension().is_some() || !is_light());
    is_of(path, &["csv"]) || is_there()
}

/// Reads the spectrum of a light: a table of two columns, wavelengths in nm and spectral power, or a MATLAB file as `ISETCam` has lights.
///
/// # Errors
/// When it is none, or there can be no such light.
pub fn read_light(path: &Path) -> Result<Illuminant, SceneError> {
    let unreadable = |reason: String| unreadable(path, reason);
    if is_of(path, &["mat"]) {
        return of_iset(path);
    }
    let text = text::read(path).map_err(|e| unreadable(e.to_string()))?;
    let text = text::with_commas(&text);
    let text = text.lines().map(with_comma).collect::<Vec<_>>().join("\n");
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let (mut names, mut wavelengths_nm, mut values) = (Vec::<String>::new(), Vec::new(), Vec::new());
    for (number, record) in reader.records().enumerate() {
        let record = record.map_err(|e| unreadable(e.to_string()))?;
        let line = record.position().map_or(number as u64 + 1, csv::Position::line);
        if record.len() > 2 {
            let n = record.len();
            return Err(unreadable(format!(
                "line {line} has {n} columns, expected a wavelength in nm and one power: of several lights a file each"
            )));
        }
        let number_at = |column: usize| record.get(column).and_then(|text| text.parse::<f64>().ok());
        match (number_at(0), number_at(1)) {
            (Some(nm), Some(value)) => {
                wavelengths_nm.push(nm);
                values.push(value);
            }
            _ if number == 0 => names = record.iter().map(str::to_owned).collect(),
            _ => return Err(unreadable(format!("line {line} is not a wavelength in nm and a power"))),
        }
    }
    let first = names.first().map_or("", String::as_str);
    let line = names.join(" ");
    let comments = comments_of(&text).chain([line.trim_start_matches([';', '%', '/', ' '])]);
    let wavelengths_nm = wavelengths_of_column(first, &wavelengths_nm, comments).map_err(unreadable)?;
    // Of a line of names that is not told apart, all of it.
    let of_power = names.get(1).or(names.first()).map_or("", String::as_str);
    let unit = unit_of_power(of_power, comments_of(&text)).map_err(unreadable)?;
    if values.is_empty() {
        return Err(unreadable("it has no line of a wavelength in nm and a power".to_owned()));
    }
    values.iter_mut().zip(&wavelengths_nm).for_each(|(value, nm)| *value /= unit.divisor_at(*nm));
    light_of(&wavelengths_nm, &values).map_err(unreadable)
}

/// Returns the unit of a light's numbers, by the name of their column or, where that has none, by what comments say.
///
/// # Errors
/// When it is none of a power, or of photons, or free words speak of photons or of a share.
fn unit_of_power<'a>(name: &str, comments: impl Iterator<Item = &'a str>) -> Result<LightUnit, String> {
    if let Some(unit) = power_in(name).map_err(|what| format!("its column {what}"))? {
        return Ok(unit);
    }
    for comment in comments {
        if let Some(own) = said_of_power(comment)
            && let Some(unit) = power_in(own).map_err(|what| format!("its comment: {what}"))?
        {
            return Ok(unit);
        }
        // A unit at its end, behind other words or alone behind a comma.
        let last = comment.rsplit([',', ';']).next().unwrap_or_default().trim();
        let is_unit = |words: &str| LightUnit::is_written_in(words) || words == last && words.len() > 2;
        let at_end = LightUnit::of_spectrum(comment)
            .filter(|(_, before)| !LightUnit::is_written_in(before))
            .filter(|(_, before)| is_unit(comment.get(before.len()..).unwrap_or_default().trim()));
        if let Some((unit, _)) = at_end {
            return Ok(unit);
        }
        if LightUnit::is_written_so(last) {
            return Err(format!(
                "its comment says '{}', which is no unit of power a nanometre: expected such (W/nm) or photons",
                short(last)
            ));
        }
        let lower = comment.to_lowercase();
        const OTHERS: [&str; 9] =
            ["photon", "quanta", "pfd", "ppfd", "reflectance", "transmittance", "absorbance", "albedo", "counts"];
        let is_other = |word: &str| OTHERS.iter().any(|own| word.starts_with(own));
        if lower.split(|c: char| !c.is_alphabetic()).any(is_other) {
            return Err(format!(
                "it says '{}': expected the name of its second column to say whether its numbers are photons or watts",
                short(comment)
            ));
        }
    }
    Ok(LightUnit::RADIANCE)
}

/// Returns the unit of power, or of photons, that a name has; `None` where it says nothing of it.
fn power_in(name: &str) -> Result<Option<LightUnit>, String> {
    let own = LightUnit::of_spectrum(name).filter(|(_, before)| !LightUnit::is_written_in(before));
    let is_unknown = own.is_none() && LightUnit::is_written_in(name);
    if is_unknown || is_no_power(own.map_or(name, |(_, before)| before)) {
        return Err(format!(
            "'{}' is no power a nanometre: expected such (W/nm) or photons, and a name that says so",
            short(name)
        ));
    }
    Ok(own.map(|(unit, _)| unit).or(counts_photons(name).then_some(LightUnit::PHOTONS)))
}

/// Returns what of a comment is about the numbers of a light: what stands behind the word for a unit, the last of the names of columns, or all of
/// one that is short.
fn said_of_power(comment: &str) -> Option<&str> {
    if let Some(rest) = behind_unit(comment) {
        return Some(rest).filter(|rest| unit_in(rest) != Some(rest));
    }
    let names: Vec<&str> = comment.split([',', ';', '\t']).map(str::trim).collect();
    if names.len() > 1 && unit_of_waves(names[0]).is_some() {
        return names.last().copied();
    }
    let words: Vec<&str> = comment.split_whitespace().collect();
    let is_of_unit = |text: &str| LightUnit::of_spectrum(text).is_some_and(|(_, before)| before.is_empty());
    match words[..] {
        [of_waves, of_power] if unit_in(of_waves) == Some(of_waves) => Some(of_power),
        [_] => Some(comment),
        [_, _] | [_, _, _] if is_of_unit(comment) || is_no_power(comment) => Some(comment),
        _ => None,
    }
}

fn light_of(wavelengths_nm: &[f64], values: &[f64]) -> Result<Illuminant, String> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| wavelengths_nm[*a].total_cmp(&wavelengths_nm[*b]));
    let sorted = |list: &[f64]| order.iter().map(|at| list[*at]).collect();
    let light = Spectrum::new(sorted(wavelengths_nm), sorted(values)).map(Illuminant::Spectrum);
    light.and_then(|light| light.check().map(|()| light)).map_err(|error| error.to_string())
}

/// Reads a light of `ISETCam`: `wavelength`, nm, and `data`, energy, as `ieReadSpectra.m` has them.
fn of_iset(path: &Path) -> Result<Illuminant, SceneError> {
    const WAVES: [&str; 2] = ["wavelength", "wave"];
    if let Some(name) = ["units", "unit", "quantity"].into_iter().find(|name| has_variable(path, name)) {
        let reason = format!("its '{name}' is not read: expected energy a nanometre, and the file without it");
        return Err(unreadable(path, reason));
    }
    let matrices = read_mat_matrices(path, &["wavelength", "wave", "data"])?;
    let of = |names: &[&str]| matrices.iter().find(|(name, _)| names.contains(&name.as_str())).map(|(_, own)| own);
    let (Some(waves), Some(data)) = (of(&WAVES), of(&["data"])) else {
        return Err(unreadable(path, "it holds no light, expected 'wavelength' and 'data' as ISETCam has them"));
    };
    if data.len() != waves.len() {
        let (rows, columns) = data.dim();
        let reason = format!(
            "its 'data' are {rows} × {columns} numbers of {} wavelengths: expected one light, of several a file each",
            waves.len()
        );
        return Err(unreadable(path, reason));
    }
    let [waves, data] = [waves, data].map(|own| own.iter().copied().collect::<Vec<f64>>());
    wavelengths_of_column("wavelength", &waves, [])
        .and_then(|nm| light_of(&nm, &data))
        .map_err(|reason| unreadable(path, reason))
}

/// Returns a line of two numbers, or of the names of two columns, with a comma in place of the gap between them.
fn with_comma(line: &str) -> String {
    let words: Vec<&str> = line.split_whitespace().collect();
    // A unit in brackets belongs to the name before it.
    let n_first = 1 + words.get(1).map_or(0, |word| usize::from(word.starts_with(['(', '['])));
    match (&words[..], line.contains([',', '#', '"'])) {
        ([first, _, ..], false) if words.len() == 2 || first.parse::<f64>().is_err() => {
            let (first, second) = words.split_at(n_first.min(words.len() - 1));
            format!("{},{}", first.join(" "), second.join(" "))
        }
        _ => line.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::{
        super::mat::fixtures::{mat_file, variable_of},
        *,
    };

    #[test]
    fn tables_of_one_light_in_nanometres_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("light.csv");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            read_light(&path)
        };
        let light = read("nm, power\n400, 1\n500, 2\n800, 1\n").unwrap();
        for text in [
            "µm;W/nm\n0,4;1\n0,5;2\n0,8;1\n",
            "cm^-1\tpower\n12500\t1\n20000\t2\n25000\t1\n",
            "nm, photons/s\n400, 400\n500, 1000\n800, 800\n",
            "400 1\n500   2\n800 1\n",
            "nm photons\n400 400\n500 1000\n800 800\n",
            "Wavelength (Å)  Power [W/nm]\n4000 1\n5000 2\n8000 1\n",
            "wavelength in Angstroms\n4000 1\n5000 2\n8000 1\n",
            "% Angstrom power\n4000 1\n5000 2\n8000 1\n",
            "# units: Angstrom\n4000 1\n5000 2\n8000 1\n",
            "Units: Å\nx, y\n4000, 1\n5000, 2\n8000, 1\n",
            "# Wavelength (Angstroms), flux\n4000 1\n5000 2\n8000 1\n",
            "nm, quantum flux\n400, 400\n500, 1000\n800, 800\n",
            "nm, PPFD\n400, 400\n500, 1000\n800, 800\n",
            "# units: umol/m2/s/nm\n400 400\n500 1000\n800 800\n",
            "Unit: µmol m-2 s-1 nm-1\nnm, value\n400, 400\n500, 1000\n800, 800\n",
            "# quanta\n400 400\n500 1000\n800 800\n",
            "# PPFD\n400 400\n500 1000\n800 800\n",
            "# nm photons\n400 400\n500 1000\n800 800\n",
            "# Wavelength (nm), photon flux\n400 400\n500 1000\n800 800\n",
            "# y unit = erg/s/cm2/A\n400 1\n500 2\n800 1\n",
            "# log of the lamp 2020, units: nm\n400 1\n500 2\n800 1\n",
            // Steps of frequency and of energy.
            "nm,W/m2/cm-1\n400,160000\n500,500000\n800,640000\n",
            "# W/m2/Hz\n400 160000\n500 500000\n800 640000\n",
            "nm,W/m2/eV\n400,160000\n500,500000\n800,640000\n",
            "nm,flux (Jy)\n400,160000\n500,500000\n800,640000\n",
            "nm,relative power (1/nm)\n400,1\n500,2\n800,1\n",
            "# spectral irradiance, W/m2/cm-1\n400 160000\n500 500000\n800 640000\n",
            "# spectral irradiance, W/(m2 Hz)\n400 160000\n500 500000\n800 640000\n",
            "# spectral irradiance, umol/m2/s/nm\n400 400\n500 1000\n800 800\n",
            "nm,µE m-2 s-1 nm-1\n400, 400\n500, 1000\n800, 800\n",
            "nm,PHOTLAM\n400, 400\n500, 1000\n800, 800\n",
            "# spectral irradiance, uJy\n400 160000\n500 500000\n800 640000\n",
            "# spectral irradiance, W m**-2 (cm**-1)**-1\n400 160000\n500 500000\n800 640000\n",
            "# spectral irradiance, micromol/m2/s/nm\n400 400\n500 1000\n800 800\n",
            "# phot/s/cm2/nm\n400 400\n500 1000\n800 800\n",
            "# bought 2020/11/28, 3 mW/cm2 in all, see http://a.b/c\n400 1\n500 2\n800 1\n",
            "\u{feff}Å, W\n4000, 1\n5000, 2\n8000, 1\n",
        ] {
            assert_eq!(read(text).unwrap(), light, "{text}");
        }
        for (text, word) in [
            ("nm, a, b\n400, 1, 2\n700, 1, 2\n", "3 columns"),
            ("waves (zorp), a\n400, 1\n700, 1\n", "'zorp'"),
            ("400, 1\n500; 2\n", "line 2"),
            ("nm,dBm\n400, -1\n500, -2\n", "'dBm' is no power"),
            ("nm,absorbance\n400, 1\n500, 2\n", "'absorbance' is no power"),
            ("nm,%T\n400, 1\n500, 2\n", "'%T' is no power"),
            ("nm,dB\n400, -1\n500, -2\n", "'dB' is no power"),
            ("nm,absolute log irradiance\n400, -1\n500, -2\n", "irradiance' is no power"),
            ("nm,Intensity (counts)\n400, 1\n500, 2\n", "(counts)' is no power"),
            ("nm,log10(W)\n400, 1\n500, 2\n", "log10(W)' is no power"),
            ("nm,A/W\n400, 1\n500, 2\n", "'A/W' is no power"),
            ("nm,f_nu\n400, 1\n500, 2\n", "'f_nu' is no power"),
            ("nm,foo/bar\n400, 1\n500, 2\n", "'foo/bar' is no power"),
            ("nm,1/s/m2/nm\n400, 1\n500, 2\n", "'1/s/m2/nm' is no power"),
            ("nm,s-1 m-2 nm-1\n400, 1\n500, 2\n", "'s-1 m-2 nm-1' is no power"),
            ("nm,W/m2 cm-1\n400, 1\n500, 2\n", "'W/m2 cm-1' is no power"),
            ("nm,photons/s/0.1%BW\n400, 1\n500, 2\n", "'photons/s/0.1%BW' is no power"),
            ("# units: #/s/m2/nm\n400 1\n500 2\n", "'#/s/m2/nm' is no power"),
            ("# lamp, W/m2/1/cm\n400 1\n500 2\n", "'W/m2/1/cm', which is no unit"),
            ("# spectral irradiance, s-1 m-2 nm-1\n400 1\n500 2\n", "'s-1 m-2 nm-1', which is no unit"),
            ("# spectral irradiance, 1/s/m2/nm\n400 1\n500 2\n", "'1/s/m2/nm', which is no unit"),
            ("# spectral irradiance, W/m2 cm-1\n400 1\n500 2\n", "'W/m2 cm-1', which is no unit"),
            ("# Units: counts\n400 1\n500 2\n", "'counts' is no power"),
            ("# dB\n400 1\n500 2\n", "'dB' is no power"),
            ("# reflectance of white tile\n400 1\n500 2\n", "'reflectance of white tile'"),
            ("# not photons\n400 1\n500 2\n", "'not photons'"),
            ("Pixel,power\n400, 1\n500, 2\n", "'Pixel' holds no wavelengths"),
            ("Light in photons\nnm, a\n400, 1\n500, 2\n", "photons"),
            ("400, 1\n400, 2\n", "400"),
            ("4000, 1\n7000, 2\n", "may be nm or Å"),
        ] {
            let message = read(text).map_err(|error| error.to_string()).expect_err(text);
            assert!(message.contains(word) && message.contains("light.csv"), "{message}");
        }
    }

    #[test]
    fn lights_of_isetcam_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lamp.mat");
        let write = |columns: usize| {
            let nm = [400.0, 500.0, 800.0];
            let data: Vec<f64> = [1.0, 2.0, 1.0].repeat(columns);
            let waves = variable_of("wavelength", &[3, 1], 6, &nm);
            std::fs::write(&path, mat_file(&[waves, variable_of("data", &[3, columns], 6, &data)])).unwrap();
        };
        write(1);
        let light = Spectrum::new(vec![400.0, 500.0, 800.0], vec![1.0, 2.0, 1.0]).unwrap();
        assert_eq!(read_light(&path), Ok(Illuminant::Spectrum(light)));
        let all = std::fs::read(&path).unwrap();
        std::fs::write(&path, [all, variable_of("units", &[1, 1], 6, &[1.0])].concat()).unwrap();
        assert!(read_light(&path).unwrap_err().to_string().contains("'units' is not read"));
        write(2);
        assert!(read_light(&path).unwrap_err().to_string().contains("expected one light"));
        std::fs::write(&path, mat_file(&[variable_of("x", &[3, 1], 6, &[1.0, 2.0, 3.0])])).unwrap();
        assert!(read_light(&path).unwrap_err().to_string().contains("'wavelength' and 'data'"));
    }
}
