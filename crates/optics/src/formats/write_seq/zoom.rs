//! The configurations of a CODE V file written: zoom positions for what differs between the files of each alone.

use std::{collections::BTreeMap, fmt::Write as _};

use crate::OpticsError;

use super::{
    super::number::{reciprocal, written},
    quoted,
};

/// What a number is of: the place of the surface (0 for the whole system), the keyword, and the field, wavelength or coefficient.
type Place = (usize, String, usize);

/// Returns the text of the first configuration with zoom positions for what differs in the others, of which each text is of one alone.
pub(super) fn with_zoom(texts: &[String], names: &[&str]) -> Result<String, OpticsError> {
    let [first, _, ..] = texts else { return Ok(texts.concat()) };
    let states: Vec<BTreeMap<Place, String>> = texts.iter().map(|text| values_of(text)).collect();
    let places: std::collections::BTreeSet<&Place> = states.iter().flat_map(BTreeMap::keys).collect();
    let mut zoom = format!("ZOO {}\n", texts.len());
    if names.iter().any(|name| !name.is_empty()) {
        zoom.push_str("ZOO TIT\n");
        for (number, name) in (1..).zip(names) {
            let _ = writeln!(zoom, "TIT Z{number} {}", quoted(name));
        }
    }
    for place in places {
        if states.iter().any(|state| state.get(place) != states[0].get(place)) {
            write_zoom(&mut zoom, place, &states)?;
        }
    }
    let body = first.strip_suffix("GO\n").unwrap_or(first);
    Ok(format!("{body}{zoom}GO\n"))
}

/// Returns the numbers and words of a file by what they are of.
fn values_of(text: &str) -> BTreeMap<Place, String> {
    let mut values = BTreeMap::new();
    let mut surface = None;
    let joined = text.replace("&\n", " ");
    for line in joined.lines().filter(|line| !line.starts_with('!')) {
        let words: Vec<&str> = line.split_whitespace().collect();
        let Some((&keyword, rest)) = words.split_first() else { continue };
        let mut put = |surface: Option<usize>, keyword: &str, number: usize, value: &str| {
            values.insert((surface.map_or(0, |s| s + 1), keyword.to_owned(), number), value.to_owned());
        };
        match keyword {
            "SO" | "S" | "SI" => {
                surface = Some(surface.map_or(0, |before: usize| before + 1));
                put(surface, "RDY", 0, rest[0]);
                put(surface, "THI", 0, rest[1]);
                let glass = rest[2..].join(" ");
                put(surface, "GLA", 0, if glass.is_empty() { "AIR" } else { &glass });
            }
            "CUY" => {
                values.remove(&(surface.map_or(0, |s| s + 1), "RDY".to_owned(), 0));
                values.insert((surface.map_or(0, |s| s + 1), keyword.to_owned(), 0), rest[0].to_owned());
            }
            "WL" | "WTW" | "WTF" | "XAN" | "YAN" | "XOB" | "YOB" | "XIM" | "YIM" | "XRI" | "YRI" => {
                (1..).zip(rest).for_each(|(number, value)| put(None, keyword, number, value));
            }
            "HCO" => {
                let number = rest[0].trim_start_matches('C').parse().unwrap_or(0);
                put(surface, keyword, number, rest[1]);
            }
            _ => put(surface, keyword, 0, &rest.join(" ")),
        }
    }
    values
}

/// Writes the zoom positions of a number that differs among them.
fn write_zoom(text: &mut String, place: &Place, states: &[BTreeMap<Place, String>]) -> Result<(), OpticsError> {
    let (surface, keyword, number) = place;
    let of = surface.checked_sub(1);
    let what = of.map_or(String::new(), |surface| format!(" of the file's surface S{surface}"));
    let reason =
        format!("{keyword}{what} differs among its configurations, for which the format has no zoom positions");
    let refusal = || OpticsError::CannotWrite { format: "a .seq file", reason: reason.clone() };
    let (command, values): (String, Option<Vec<String>>) = match keyword.as_str() {
        "RDY" | "CUY" => return write_curvatures(text, place, states).ok_or_else(refusal),
        "K" | "KX" | "CUX" | "A" | "B" | "C" | "D" | "E" | "F" | "G" | "H" | "J" | "XDE" | "YDE" | "ZDE" | "ADE"
        | "BDE" | "CDE" => {
            let zero = |state: &BTreeMap<Place, String>| state.get(place).cloned().unwrap_or("0".to_owned());
            (keyword.clone(), Some(states.iter().map(zero).collect()))
        }
        "THI" | "GLA" | "CIR" | "EPD" | "REF" | "GRS" | "WL" | "WTW" | "WTF" | "XAN" | "YAN" | "XOB" | "YOB"
        | "XIM" | "YIM" | "XRI" | "YRI" | "HCO" => {
            let missing = matches!(keyword.as_str(), "WTW" | "WTF").then(|| "1".to_owned());
            let of_state = |state: &BTreeMap<Place, String>| state.get(place).cloned().or_else(|| missing.clone());
            (keyword.clone(), states.iter().map(of_state).collect())
        }
        _ => return Err(refusal()),
    };
    let values = values.filter(|values| !values.iter().any(|value| value == "REFL")).ok_or_else(refusal)?;
    let selector = match (keyword.as_str(), of) {
        ("WL" | "WTW", _) => format!(" W{number}"),
        (_, None) if *number > 0 => format!(" F{number}"),
        ("HCO", Some(surface)) => format!(" S{surface} C{number}"),
        (_, Some(surface)) => format!(" S{surface}"),
        (_, None) => String::new(),
    };
    let _ = writeln!(text, "ZOO {command}{selector} {}", values.join(" "));
    Ok(())
}

/// Writes the zoom positions of a curvature, as radii where all are exactly those.
fn write_curvatures(text: &mut String, place: &Place, states: &[BTreeMap<Place, String>]) -> Option<()> {
    let (surface, keyword, _) = place;
    let of = |keyword: &str| (*surface, keyword.to_owned(), 0);
    let radius = |state: &BTreeMap<Place, String>| state.get(&of("RDY")).cloned();
    if let Some(radii) = states.iter().map(radius).collect::<Option<Vec<String>>>() {
        let _ = writeln!(text, "ZOO RDY S{} {}", surface - 1, radii.join(" "));
        return Some(());
    }
    if keyword == "RDY" && states.iter().any(|state| state.contains_key(&of("CUY"))) {
        // Written with CUY, of which some state has one.
        return Some(());
    }
    let curvature = |state: &BTreeMap<Place, String>| match state.get(&of("CUY")) {
        Some(curvature) => Some(curvature.clone()),
        None => Some(written(reciprocal(state.get(&of("RDY"))?.parse().ok()?))),
    };
    let curvatures = states.iter().map(curvature).collect::<Option<Vec<String>>>()?;
    let _ = writeln!(text, "ZOO CUY S{} {}", surface - 1, curvatures.join(" "));
    Some(())
}
