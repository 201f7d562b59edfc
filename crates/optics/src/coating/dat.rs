//! Coating files of Zemax: materials by index and extinction, coatings of layers, tables and ideal ones.

use std::collections::BTreeMap;

use super::{COATING_CENTER_NM, Coating, CoatingLayer, ReflectanceTable};
use crate::Glass;

/// Wavelengths far beyond all, nm, to which the ends of a table of a material are held.
const FAR_NM: [f64; 2] = [1.0, 1e7];
/// Names of a file that a message lists.
const MOST_NAMED: usize = 12;

/// A coating of a file, as its lines have it.
#[derive(Debug, Default)]
struct Entry<'a> {
    kind: &'a str,
    /// The number of a line, and its words.
    lines: Vec<(usize, Vec<&'a str>)>,
}

/// Reads the coating of a name, in any case; without one the only coating of the file.
///
/// The thickness of layers is in waves in the material at 550 nm, or in micrometers where a 1 follows. Beyond the wavelengths that are stated of a
/// material, its numbers are those of the nearest.
pub(super) fn parse(text: &str, name: Option<&str>) -> Result<Coating, String> {
    let mut materials: BTreeMap<String, Vec<[f64; 3]>> = BTreeMap::new();
    let mut coatings: Vec<(&str, Entry<'_>)> = Vec::new();
    // What the lines that follow are of.
    let mut section = "";
    let mut material = String::new();
    for (i, line) in text.lines().enumerate().map(|(i, line)| (i + 1, line.split('!').next().unwrap_or_default())) {
        let words: Vec<&str> = line.split_whitespace().collect();
        let Some(&first) = words.first() else { continue };
        let named = || words.get(1).copied().ok_or(format!("line {i}: {first} has no name"));
        match first.to_ascii_uppercase().as_str() {
            "MATE" => {
                (section, material) = ("MATE", named()?.to_ascii_uppercase());
                materials.insert(material.clone(), Vec::new());
            }
            "COAT" | "TABLE" | "IDEAL" => {
                section = "COAT";
                let lines = if words.len() > 2 { vec![(i, words[2..].to_vec())] } else { Vec::new() };
                coatings.push((named()?, Entry { kind: first, lines }));
            }
            // Of materials and coatings that are not read here.
            "TAPR" | "IDEAL2" | "ENCRYPTED" => section = "",
            _ if section == "MATE" => {
                let numbers: Option<Vec<f64>> = words.iter().map(|word| word.parse().ok()).collect();
                let Some([um, n, k]) = numbers.as_deref() else {
                    return Err(format!("line {i} of {material}: expected wavelength, index and its imaginary part"));
                };
                materials.entry(material.clone()).or_default().push([1e3 * um, *n, -k]);
            }
            _ if section == "COAT" => {
                if let Some((_, entry)) = coatings.last_mut() {
                    entry.lines.push((i, words));
                }
            }
            _ => {}
        }
    }
    let names = || {
        let mut names: Vec<&str> = coatings.iter().take(MOST_NAMED).map(|(name, _)| *name).collect();
        if coatings.len() > MOST_NAMED {
            names.push("…");
        }
        names.join(", ")
    };
    let found = match name {
        Some(name) => coatings.iter().find(|(found, _)| found.eq_ignore_ascii_case(name)),
        None if coatings.len() == 1 => coatings.first(),
        None => None,
    };
    let Some((name, entry)) = found else {
        return Err(format!("has the coatings {}: expected one of them, as in COATING.DAT:NAME", names()));
    };
    let coating = match entry.kind.to_ascii_uppercase().as_str() {
        "COAT" if entry.lines.is_empty() && share_of_name(name).is_some() => {
            let t = share_of_name(name).unwrap_or(1.0);
            even(t, 1.0 - t).map(Coating::Table)
        }
        "COAT" => layers(&entry.lines, &materials).map(Coating::Layers),
        "TABLE" => table(&entry.lines).map(Coating::Table),
        _ => ideal(&entry.lines).map(Coating::Table),
    };
    coating.map_err(|reason| format!("coating {name}: {reason}"))
}

fn layers(
    lines: &[(usize, Vec<&str>)],
    materials: &BTreeMap<String, Vec<[f64; 3]>>,
) -> Result<Vec<CoatingLayer>, String> {
    let layer = |(line, words): &(usize, Vec<&str>)| {
        let name = words[0].to_ascii_uppercase();
        let rows = materials.get(&name).ok_or(format!("line {line}: the material {name} is not in the file"))?;
        let medium = medium(rows).ok_or(format!("line {line}: the material {name} has no ascending wavelengths"))?;
        let number = |i: usize| match words.get(i) {
            None => Ok(0.0),
            Some(word) => word.parse::<f64>().map_err(|_| format!("line {line}: '{word}' is no number")),
        };
        let (thickness, is_absolute) = (number(1)?, number(2)? != 0.0);
        if number(3)? != 0.0 || words.len() > 4 {
            return Err(format!("line {line}: layers in loops and tapered ones are not read"));
        }
        let index = medium.index_at(COATING_CENTER_NM).map_err(|error| format!("line {line}: {error}"))?;
        let thickness_nm = if is_absolute { 1e3 * thickness } else { thickness * COATING_CENTER_NM / index };
        Ok(CoatingLayer { medium, thickness_nm })
    };
    lines.iter().map(layer).collect()
}

/// Returns the medium of wavelengths, nm, indices and extinctions.
fn medium(rows: &[[f64; 3]]) -> Option<Glass> {
    let (first, last) = (rows.first()?, rows.last()?);
    if !rows.windows(2).all(|two| two[0][0] < two[1][0]) {
        return None;
    }
    let list = |k: usize, ends: [f64; 2]| -> Vec<f64> {
        std::iter::once(ends[0]).chain(rows.iter().map(|row| row[k])).chain([ends[1]]).collect()
    };
    let wavelengths_nm = list(0, FAR_NM);
    let law = match rows {
        [[_, index, _]] => Glass::Constant { index: *index },
        _ => Glass::Tabulated { wavelengths_nm: wavelengths_nm.clone(), indices: list(1, [first[1], last[1]]) },
    };
    if rows.iter().all(|row| row[2] == 0.0) {
        return Some(law);
    }
    Some(Glass::Absorbing { law: Box::new(law), wavelengths_nm, extinctions: list(2, [first[2], last[2]]) })
}

fn table(lines: &[(usize, Vec<&str>)]) -> Result<ReflectanceTable, String> {
    let mut rows = Vec::new();
    let mut angle_deg = None;
    for (line, words) in lines {
        let numbers: Option<Vec<f64>> = words[1..].iter().map(|word| word.parse().ok()).collect();
        let numbers = numbers.ok_or(format!("line {line} has words where numbers are expected"))?;
        match (words[0].to_ascii_uppercase().as_str(), numbers.as_slice()) {
            ("ANGL", [deg]) => angle_deg = Some(*deg),
            ("WAVE", [um, r_s, r_p, t_s, t_p, ..]) => {
                let deg = angle_deg.ok_or(format!("line {line}: WAVE before ANGL"))?;
                rows.push([1e3 * um, deg, *r_s, *r_p, *t_s, *t_p]);
            }
            _ => {
                return Err(format!(
                    "line {line}: expected ANGL with an angle, or WAVE with a wavelength, Rs, Rp, Ts and Tp"
                ));
            }
        }
    }
    ReflectanceTable::of_rows(rows, true)
}

/// Returns an ideal coating: shares transmitted and reflected that are the same at all wavelengths and angles.
fn ideal(lines: &[(usize, Vec<&str>)]) -> Result<ReflectanceTable, String> {
    let numbers = lines.first().and_then(|(_, words)| words.iter().map(|word| word.parse::<f64>().ok()).collect());
    let numbers: Vec<f64> = numbers.unwrap_or_default();
    let &[t, r, ..] = numbers.as_slice() else {
        return Err("expected the shares transmitted and reflected behind IDEAL and the name".to_owned());
    };
    even(t, r)
}

/// Returns the share that a coating transmits whose name says it, as I.95 does.
fn share_of_name(name: &str) -> Option<f64> {
    let digits = name.strip_prefix("I.").or_else(|| name.strip_prefix("i."))?;
    format!("0.{digits}").parse().ok()
}

/// Returns the table of shares transmitted and reflected that are the same everywhere.
fn even(t: f64, r: f64) -> Result<ReflectanceTable, String> {
    ReflectanceTable::of_rows(
        FAR_NM.iter().flat_map(|&nm| [0.0, 90.0].map(|deg| [nm, deg, r, r, t, t])).collect(),
        true,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "\
! A file as Zemax has them.
MATE AIR
0.55 1.0 0
MATE mgf2   ! evaporated
0.4 1.384 0
0.7 1.376 0
MATE ALUM
.550 0.7 -7.0
COAT AR
MGF2 .25
COAT DARK
MGF2 0.1 1
ALUM 0.005 1 0
COAT LOOPED
MGF2 0.25 0 1
COAT STRANGE
ZNS 0.25
TABLE HALF
ANGL 0.0
WAVE 0.40 .3 .3 .5 .5 0 0 0 0
WAVE 0.70 .2 .2 .6 .6
ANGL 45
WAVE 0.40 .35 .25 .5 .5
WAVE 0.70 .2 .2 .8 .81
IDEAL GRAY 0.6 0.3
IDEAL BRIGHT 0.8 0.3
COAT I.95
TAPR EDGE
1 2
";

    fn layers_of(name: &str) -> Vec<CoatingLayer> {
        let Coating::Layers(layers) = parse(FILE, Some(name)).unwrap() else { panic!("{name} has no layers") };
        layers
    }

    #[test]
    fn layers_are_waves_or_micrometers() {
        let [layer] = &layers_of("ar")[..] else { panic!("one layer") };
        // A quarter wave of the index at 550 nm, midway.
        assert!((layer.thickness_nm - 0.25 * 550.0 / 1.38).abs() < 1e-9, "{layer:?}");
        assert!((layer.medium.index_at(390.0).unwrap() - 1.384).abs() < 1e-12);
        let [outer, metal] = &layers_of("DARK")[..] else { panic!("two layers") };
        assert_eq!((outer.thickness_nm, metal.thickness_nm), (100.0, 5.0));
        assert_eq!((metal.medium.index_at(480.0).unwrap(), metal.medium.extinction_at(480.0)), (0.7, Some(7.0)));
    }

    #[test]
    fn tables_and_ideal_coatings_are_read() {
        let Coating::Table(table) = parse(FILE, Some("GRAY")).unwrap() else { panic!("a table") };
        table.check().unwrap();
        assert_eq!(table.at(633.0).unwrap()[0].1, [0.3, 0.3, 0.6, 0.6]);
        let Coating::Table(table) = parse(FILE, Some("I.95")).unwrap() else { panic!("a table") };
        let row = table.at(500.0).unwrap()[0].1;
        assert!((row[0] - 0.05).abs() < 1e-12 && (row[2] - 0.95).abs() < 1e-12, "{row:?}");
        let message = |name: &str| parse(FILE, Some(name)).unwrap().check().unwrap_err().to_string();
        assert!(message("BRIGHT").contains("0.3 reflected and 0.8 transmitted"));
        assert!(message("HALF").contains("0.2 reflected and 0.81 transmitted at 700 nm and 45 degrees"));
    }

    #[test]
    fn what_is_wrong_is_said() {
        let message = |name: Option<&str>| parse(FILE, name).unwrap_err();
        assert!(message(None).contains("has the coatings AR, DARK, LOOPED"));
        assert!(message(Some("BLUE")).contains("expected one of them, as in COATING.DAT:NAME"));
        assert!(message(Some("STRANGE")).contains("line 17: the material ZNS is not in the file"));
        assert!(message(Some("LOOPED")).contains("layers in loops"));
        assert!(parse("MATE X\n0.5 1.4\n", None).unwrap_err().contains("line 2 of X"));
    }
}
