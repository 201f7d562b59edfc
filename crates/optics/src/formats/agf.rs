//! Zemax glass catalogues (`.agf`): of each glass the name and formula (`NM`), coefficients (`CD`), range (`LD`) and
//! internal transmission (`IT`).

use crate::{CatalogueGlass, Glass, extinction::extinction_of_share};

use super::{text_error::TextError, zmx::nm_of_um};

/// A glass whose lines are being read.
#[derive(Default)]
struct Entry {
    line: usize,
    name: String,
    formula: usize,
    coefficients: Vec<f64>,
    range_nm: Option<(f64, f64)>,
    /// Wavelengths, the shares of light let through there, and through what thickness.
    transmissions: Vec<Transmission>,
}

/// A line `IT` of a glass.
#[derive(Clone, Copy)]
struct Transmission {
    wavelength_nm: f64,
    share: f64,
    path_mm: f64,
}

/// Reads the glasses of a catalogue.
pub(super) fn glasses_from_agf(text: &str, maker: &str) -> Result<Vec<CatalogueGlass>, TextError> {
    let mut glasses = Vec::new();
    let mut entry: Option<Entry> = None;
    for (line, text) in text.lines().enumerate().map(|(i, text)| (i + 1, text)) {
        let mut words = text.split_whitespace();
        let keyword = words.next().unwrap_or_default();
        let words: Vec<&str> = words.collect();
        let numbers = || words.iter().map(|word| number(word, line, keyword)).collect::<Result<Vec<f64>, _>>();
        match (keyword, &mut entry) {
            ("NM", before) => {
                glasses.extend(before.take().map(|entry| entry.finish(maker)).transpose()?);
                let [name, formula, ..] = words[..] else {
                    return Err(wrong(line, keyword, "expected a name and the number of a formula"));
                };
                // Some catalogues write the whole number as 2.0.
                let formula = number(formula, line, keyword)?;
                let (name, formula) = (name.to_owned(), formula as usize);
                entry = Some(Entry { line, name, formula, ..Default::default() });
            }
            ("CD", Some(entry)) => entry.coefficients = numbers()?,
            ("LD", Some(entry)) => {
                let &[first_um, last_um, ..] = numbers()?.as_slice() else {
                    return Err(wrong(line, keyword, "expected the shortest and longest wavelength"));
                };
                entry.range_nm = Some((nm_of_um(first_um), nm_of_um(last_um)));
            }
            ("IT", Some(entry)) => {
                if let &[um, share, path_mm, ..] = numbers()?.as_slice() {
                    entry.transmissions.push(Transmission { wavelength_nm: nm_of_um(um), share, path_mm });
                }
            }
            ("CD" | "LD", None) => return Err(wrong(line, keyword, "no glass (NM) before it")),
            _ => {}
        }
    }
    glasses.extend(entry.map(|entry| entry.finish(maker)).transpose()?);
    if glasses.is_empty() {
        return Err(TextError { line: None, reason: "no glass (NM) in the file".to_owned() });
    }
    Ok(glasses)
}

fn number(word: &str, line: usize, keyword: &str) -> Result<f64, TextError> {
    match word.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(wrong(line, keyword, &format!("'{word}' is not a number"))),
    }
}

fn wrong(line: usize, keyword: &str, reason: &str) -> TextError {
    TextError { line: Some(line), reason: format!("{keyword}: {reason}") }
}

impl Entry {
    fn finish(self, maker: &str) -> Result<CatalogueGlass, TextError> {
        let wrong =
            |reason: String| TextError { line: Some(self.line), reason: format!("glass {}: {reason}", self.name) };
        if self.coefficients.is_empty() {
            return Err(wrong("its coefficients (CD) are missing".to_owned()));
        }
        let Some((formula, coefficients)) = as_database_formula(self.formula, &self.coefficients) else {
            return Err(wrong(format!("formula {} is not known; expected 1 to 13", self.formula)));
        };
        let law = Glass::Formula { formula, coefficients, range_nm: self.range_nm };
        let glass = law.with_extinction(extinctions(&self.transmissions));
        glass.check().map_err(|error| wrong(error.to_string()))?;
        Ok(CatalogueGlass { maker: maker.to_owned(), name: self.name.clone(), glass })
    }
}

/// Returns the extinction coefficients at the wavelengths where a glass's lines state them.
///
/// Of several thicknesses at one wavelength the largest that lets light through tells most. Where nothing gets through, k
/// is not known: it is given for the longest row of wavelengths without such. A share of 1 everywhere is what the program
/// writes where it knows nothing, and says nothing here; nor does a share beyond 0 to 1.
fn extinctions(transmissions: &[Transmission]) -> Vec<(f64, f64)> {
    let makes_sense = |t: &&Transmission| (0.0..=1.0).contains(&t.share) && t.path_mm > 0.0 && t.wavelength_nm > 0.0;
    let mut rows: Vec<Transmission> = transmissions.iter().filter(makes_sense).copied().collect();
    rows.sort_by(|a, b| a.wavelength_nm.total_cmp(&b.wavelength_nm).then(b.path_mm.total_cmp(&a.path_mm)));
    let at_one_wavelength = rows.chunk_by(|a, b| a.wavelength_nm == b.wavelength_nm);
    let telling: Vec<Transmission> =
        at_one_wavelength.map(|rows| *rows.iter().find(|row| row.share > 0.0).unwrap_or(&rows[0])).collect();
    let runs = telling.split(|row| row.share == 0.0);
    let longest = runs.max_by_key(|run| run.len()).unwrap_or_default();
    if longest.iter().all(|row| row.share == 1.0) {
        return Vec::new();
    }
    let extinction =
        |row: &Transmission| (row.wavelength_nm, extinction_of_share(row.share, row.wavelength_nm, row.path_mm));
    longest.iter().map(extinction).collect()
}

/// Returns one of Zemax's formulas as the formula of refractiveindex.info that says the same, λ in µm in both.
fn as_database_formula(formula: usize, c: &[f64]) -> Option<(u8, Vec<f64>)> {
    let at = |i: usize| c.get(i).copied().unwrap_or(0.0);
    // n² = Σ a λ^p, the powers in the order of the coefficients.
    let powers = |powers: &[f64]| {
        let terms = powers.iter().zip(1..).flat_map(|(&power, i)| [at(i), power]);
        Some((3, [at(0)].into_iter().chain(terms).collect()))
    };
    // n² = 1 + Σ K λ² / (λ² − L).
    let sellmeier = |n_terms: usize| Some((2, [0.0].into_iter().chain((0..2 * n_terms).map(at)).collect()));
    match formula {
        // Schott.
        1 => powers(&[2.0, -2.0, -4.0, -6.0, -8.0]),
        // Sellmeier 1.
        2 => sellmeier(3),
        // Herzberger.
        3 => Some((7, (0..6).map(at).collect())),
        // Sellmeier 2: n² = 1 + A + B λ²/(λ² − l²) + C/(λ² − m²).
        4 => Some((4, vec![1.0 + at(0), at(1), 2.0, at(2), 2.0, at(3), 0.0, at(4), 2.0])),
        // Conrady: n = n0 + A/λ + B/λ^3.5.
        5 => Some((5, vec![at(0), at(1), -1.0, at(2), -3.5])),
        // Sellmeier 3.
        6 => sellmeier(4),
        // Handbook of Optics 1: n² = A + B/(λ² − C) − D λ².
        7 => Some((4, vec![at(0), at(1), 0.0, at(2), 1.0, 0.0, 0.0, 0.0, 0.0, -at(3), 2.0])),
        // Handbook of Optics 2: n² = A + B λ²/(λ² − C) − D λ².
        8 => Some((4, vec![at(0), at(1), 2.0, at(2), 1.0, 0.0, 0.0, 0.0, 0.0, -at(3), 2.0])),
        // Sellmeier 4: n² = A + B λ²/(λ² − C) + D λ²/(λ² − E).
        9 => Some((4, vec![at(0), at(1), 2.0, at(2), 1.0, at(3), 2.0, at(4), 1.0])),
        // Extended.
        10 => powers(&[2.0, -2.0, -4.0, -6.0, -8.0, -10.0, -12.0]),
        // Sellmeier 5.
        11 => sellmeier(5),
        // Extended 2.
        12 => powers(&[2.0, -2.0, -4.0, -6.0, -8.0, 4.0, 6.0]),
        // Extended 3.
        13 => powers(&EXTENDED_3),
        _ => None,
    }
}

/// Returns the lines of a glass in a Zemax catalogue, or `None` where no formula of the format says the same.
///
/// A law without stated ends is given those of what light there is, 0.1 to 20 µm.
pub(super) fn agf_lines(name: &str, glass: &Glass) -> Option<String> {
    let (formula, coefficients) = as_agf_formula(glass)?;
    let (nd, vd) = glass.nd_vd().unwrap_or((0.0, 0.0));
    let (first_nm, last_nm) = glass.range_nm().unwrap_or((100.0, 20_000.0));
    let numbers: Vec<String> = coefficients.iter().map(|c| format!("{c:e}")).collect();
    let law = format!(
        "NM {name} {formula} 0 {nd:.6} {vd:.3} 0 0\r\nCD {}\r\nLD {} {}\r\n",
        numbers.join(" "),
        first_nm / 1e3,
        last_nm / 1e3
    );
    Some(law + &transmission_lines(glass))
}

/// Returns the lines `IT` of a glass that is no glass of the built-in catalogue: through 10 mm.
fn transmission_lines(glass: &Glass) -> String {
    let Glass::Absorbing { wavelengths_nm, .. } = glass else { return String::new() };
    let line = |&nm: &f64| Some(format!("IT {} {:e} 10\r\n", nm / 1e3, glass.internal_transmittance(nm, 10.0)?));
    wavelengths_nm.iter().filter_map(line).collect()
}

/// Returns the formula of Zemax that says the same as a glass's law, with its coefficients.
fn as_agf_formula(glass: &Glass) -> Option<(u8, Vec<f64>)> {
    let sellmeier = |terms: Vec<(f64, f64)>| {
        let (formula, n_terms) = [(2, 3), (6, 4), (11, 5)].into_iter().find(|(_, n)| terms.len() <= *n)?;
        let rest = std::iter::repeat_n((0.0, 0.0), n_terms - terms.len());
        Some((formula, terms.iter().copied().chain(rest).flat_map(|(k, l)| [k, l]).collect()))
    };
    // n = a + b/λ² + c/λ⁴ is n² of Schott's formula.
    let squared =
        |a: f64, b: f64, c: f64| Some((1, vec![a * a, 0.0, 2.0 * a * b, b * b + 2.0 * a * c, 2.0 * b * c, c * c]));
    match glass {
        Glass::Constant { index } => squared(*index, 0.0, 0.0),
        Glass::Cauchy { a, b_um2 } => squared(*a, *b_um2, 0.0),
        Glass::Sellmeier { b, c_um2, .. } => sellmeier(b.iter().copied().zip(c_um2.iter().copied()).collect()),
        Glass::Formula { formula, coefficients, .. } => {
            let c = |i: usize| coefficients.get(i).copied().unwrap_or(0.0);
            let pairs: Vec<(f64, f64)> = (1..coefficients.len()).step_by(2).map(|i| (c(i), c(i + 1))).collect();
            // The coefficients of these powers, if the pairs have no others.
            let of_powers = |powers: &[f64]| {
                let is_one = |(a, power): &(f64, f64)| *a == 0.0 || powers.contains(power);
                let of = |p: &f64| pairs.iter().filter(|(_, power)| power == p).map(|(a, _)| a).sum::<f64>();
                pairs.iter().all(is_one).then(|| powers.iter().map(of).collect::<Vec<f64>>())
            };
            // A constant is a term whose resonance is at 0.
            let constant = (c(0) != 0.0).then_some((c(0), 0.0));
            match formula {
                1 => sellmeier(constant.into_iter().chain(pairs.iter().map(|(b, r)| (*b, r * r))).collect()),
                2 => sellmeier(constant.into_iter().chain(pairs.iter().copied()).collect()),
                3 => [(12, &[2.0, -2.0, -4.0, -6.0, -8.0, 4.0, 6.0][..]), (13, &EXTENDED_3)].into_iter().find_map(
                    |(formula, powers)| Some((formula, [c(0)].into_iter().chain(of_powers(powers)?).collect())),
                ),
                5 => match (of_powers(&[-2.0, -4.0]), of_powers(&[-1.0, -3.5])) {
                    (Some(even), _) => squared(c(0), even[0], even[1]),
                    (None, Some(conrady)) => Some((5, vec![c(0), conrady[0], conrady[1]])),
                    _ => None,
                },
                7 => Some((3, (0..6).map(c).collect())),
                _ => None,
            }
        }
        Glass::Absorbing { law, .. } => as_agf_formula(law),
        _ => None,
    }
}

/// The powers of λ of Zemax's formula Extended 3.
const EXTENDED_3: [f64; 8] = [2.0, 4.0, -2.0, -4.0, -6.0, -8.0, -10.0, -12.0];

#[cfg(test)]
mod tests {
    use super::*;

    const TWO: &str = "CC a comment\r\nNM N-BK7 2 517642.251 1.5168 64.17 0 1\r\nGC comment\r\n\
        CD 1.03961212 0.00600069867 0.231792344 0.0200179144 1.01046945 103.560653\r\nLD 0.3 2.5\r\n\
        NM OLD 1.0 0\r\nCD 2.25 -0.01 0.02\r\nIT 0.4 0.99 25\r\n";

    #[test]
    fn glasses_are_read_with_their_range() {
        let glasses = glasses_from_agf(TWO, "SCHOTT").ok().unwrap();
        assert_eq!(glasses.len(), 2);
        assert_eq!(glasses[0].full_name(), "SCHOTT:N-BK7");
        assert!((glasses[0].glass.index_at(587.5618).unwrap() - 1.5168).abs() < 1e-6);
        assert_eq!(glasses[0].glass.range_nm(), Some((300.0, 2500.0)));
        let expected = (2.25_f64 - 0.01 * 0.25 + 0.02 / 0.25).sqrt();
        assert!((glasses[1].glass.index_at(500.0).unwrap() - expected).abs() < 1e-15);
    }

    /// Beer and Lambert: what two thicknesses let through is what each does, multiplied.
    #[test]
    fn internal_transmission_is_read_with_its_thickness() {
        let with = |lines: &str| {
            let text = format!("NM G 1 0\nCD 2.25\nLD 0.3 2.5\n{lines}");
            glasses_from_agf(&text, "").ok().unwrap().swap_remove(0).glass
        };
        let glass = with("IT 0.5 0.9 25\nIT 0.4 0.25 10\nIT 0.4 0.03125 25\nIT 0.35 0 25\nIT 0.7 1 25\n");
        let share = |nm: f64, mm: f64| glass.internal_transmittance(nm, mm).unwrap();
        assert!((share(500.0, 25.0) - 0.9).abs() < 1e-15 && (share(500.0, 50.0) - 0.81).abs() < 1e-15);
        assert!((share(400.0, 5.0) - 0.5).abs() < 1e-15, "the law of 25 mm is that of 10 mm");
        assert_eq!((share(700.0, 1e6), glass.index_at(400.0).unwrap()), (1.0, 1.5));
        // k is a straight line between its points, and not known where nothing gets through.
        let k = |nm: f64| glass.extinction_at(nm).unwrap();
        assert!((k(450.0) - 0.5 * (k(400.0) + k(500.0))).abs() < 1e-20);
        assert_eq!((glass.extinction_at(399.0), glass.extinction_at(701.0)), (None, None));
        // 5e-7 m · ln(1/0.9) / (4π · 0.025 m).
        assert!((k(500.0) - 1.676_864_69e-7).abs() < 1e-15, "{}", k(500.0));
        for nothing in ["", "IT 0.4 1 25\nIT 0.5 1 25\n", "IT 0.4 0 25\n", "IT 0.4 1.2 25\nIT 0.5 0.9 0\nIT 0.6 0.5\n"]
        {
            assert_eq!(with(nothing), with(""), "{nothing}");
        }
        let again = with(&transmission_lines(&glass));
        for nm in [400.0, 450.0, 555.5] {
            assert!((again.extinction_at(nm).unwrap() / k(nm) - 1.0).abs() < 1e-12);
        }
    }

    /// Each formula at 0.5 µm, where λ² = 1/4, against its definition worked out by hand.
    #[test]
    fn formulas_are_those_of_their_definition() {
        let check = |formula: usize, c: &[f64], expected: f64| {
            let (formula_there, coefficients) = as_database_formula(formula, c).unwrap();
            let glass = Glass::Formula { formula: formula_there, coefficients, range_nm: None };
            let found = glass.index_at(500.0).unwrap();
            assert!((found - expected).abs() < 4e-16 * expected, "formula {formula}: {found}, expected {expected}");
        };
        let (w2, root) = (0.25_f64, f64::sqrt);
        let l = 1.0 / (w2 - 0.028);
        check(1, &[2.0, 0.1, 0.01, 1e-3, 1e-4, 1e-5], root(2.0 + 0.025 + 0.04 + 0.016 + 0.0064 + 0.00256));
        check(2, &[1.0, 0.01, 0.1, 0.02], root(1.0 + 0.25 / 0.24 + 0.025 / 0.23));
        check(3, &[1.5, 0.01, 1e-3, 0.1, 0.2, 0.3], 1.5 + 0.01 * l + 1e-3 * l * l + 0.025 + 0.0125 + 0.3 / 64.0);
        check(4, &[0.2, 1.0, 0.1, 0.01, 0.2], root(1.2 + 0.25 / 0.24 + 0.01 / 0.21));
        check(5, &[1.5, 0.01, 1e-4], 1.5 + 0.02 + 1e-4 * 2.0_f64.powf(3.5));
        check(7, &[2.2, 0.01, 0.05, 0.1], root(2.2 + 0.01 / 0.2 - 0.025));
        check(8, &[2.2, 0.01, 0.05, 0.1], root(2.2 + 0.0025 / 0.2 - 0.025));
        check(9, &[1.2, 1.0, 0.05, 0.1, 0.15], root(1.2 + 0.25 / 0.2 + 0.025 / 0.1));
        check(10, &[2.0, 0.1, 0.01, 0.0, 0.0, 0.0, 1e-6, 1e-7], root(2.0 + 0.025 + 0.04 + 1.024e-3 + 4.096e-4));
        check(12, &[2.0, 0.1, 0.01, 0.0, 0.0, 0.0, 0.1, 0.2], root(2.0 + 0.025 + 0.04 + 0.00625 + 0.003125));
        check(13, &[2.0, 0.1, 0.2, 0.01, 0.0, 0.0, 0.0, 0.0, 1e-7], root(2.0 + 0.025 + 0.0125 + 0.04 + 4.096e-4));
        for (formula, n_terms) in [(6, 4), (11, 5)] {
            let c: Vec<f64> = (0..n_terms).flat_map(|_| [0.2, 0.05]).collect();
            check(formula, &c, root(1.0 + n_terms as f64 * 0.2 * 0.25 / 0.2));
        }
    }

    #[test]
    fn laws_that_the_format_has_read_back_as_they_were() {
        let formula = |formula: u8, coefficients: &[f64]| Glass::Formula {
            formula,
            coefficients: coefficients.to_vec(),
            range_nm: Some((350.0, 1000.0)),
        };
        let sellmeier = Glass::Sellmeier { b: vec![1.0, 0.2], c_um2: vec![0.006, 100.0], range_nm: None };
        for glass in [
            Glass::Constant { index: 1.5 },
            Glass::Cauchy { a: 1.5, b_um2: 0.006 },
            sellmeier,
            formula(1, &[0.35, 0.78, 0.1, 0.18, 4.4]),
            formula(2, &[0.0, 1.0, 0.006, 0.2, 0.02, 1.0, 100.0, 0.01, 0.03]),
            formula(3, &[2.25, -0.01, 2.0, 0.01, -2.0, 1e-4, -10.0]),
            formula(5, &[1.5, 0.005, -2.0, 1e-4, -4.0]),
            formula(5, &[1.5, 0.005, -1.0, 1e-4, -3.5]),
            formula(7, &[1.5, 0.005, 1e-4, -1e-3, 1e-5, 1e-6]),
        ] {
            let text = agf_lines("MINE", &glass).unwrap();
            let again = &glasses_from_agf(&text, "").ok().unwrap()[0].glass;
            for nm in [400.0, 550.0, 900.0] {
                let (a, b) = (glass.index_at(nm).unwrap(), again.index_at(nm).unwrap());
                assert!((a - b).abs() < 4e-16, "{text}: {a} {b}");
            }
            assert_eq!(glass.range_nm().is_some(), again.range_nm() == glass.range_nm(), "{text}");
        }
        let paper = Glass::Linear { index: 1.65, reference_nm: 550.0, slope_per_nm: -1e-4 };
        assert_eq!(agf_lines("PAPER", &paper), None);
        assert_eq!(agf_lines("GAS", &formula(6, &[0.0, 0.05, 238.0])), None);
    }

    #[test]
    fn mistakes_are_reported_by_line_and_glass() {
        let message = |from: &str, to: &str| {
            let error = glasses_from_agf(&TWO.replace(from, to), "").err().unwrap();
            format!("{}: {}", error.line.unwrap_or(0), error.reason)
        };
        assert_eq!(message("0.3 2.5", "0.3 x"), "5: LD: 'x' is not a number");
        assert_eq!(message("0.3 2.5", "0.3"), "5: LD: expected the shortest and longest wavelength");
        assert_eq!(message("N-BK7 2", "N-BK7 14"), "2: glass N-BK7: formula 14 is not known; expected 1 to 13");
        assert_eq!(message("CD 2.25 -0.01 0.02", ""), "6: glass OLD: its coefficients (CD) are missing");
        assert_eq!(message("NM N-BK7", "XX N-BK7"), "4: CD: no glass (NM) before it");
        assert_eq!(message(TWO, ""), "0: no glass (NM) in the file");
    }
}
