//! The configurations of a Zemax file written: operands for what differs between the files of each alone.

use std::{collections::BTreeMap, fmt::Write as _};

use crate::OpticsError;

use super::super::write::one_line;

/// What a line is of: the surface, the keyword, and the number of a parameter or wavelength.
type Place = (Option<usize>, String, usize);

/// What stands behind the value of an operand; the program writes the same behind most.
const BEHIND: &str = "0 0 0 1 1 1 0 0 \"\" 0";

/// Returns the text of the first configuration with operands for what differs in the others, of which each text is of one alone.
pub(super) fn with_operands(texts: &[String], names: &[&str], in_use: usize) -> Result<String, OpticsError> {
    let [first, _, ..] = texts else { return Ok(texts.concat()) };
    let lines: Vec<BTreeMap<Place, Vec<&str>>> = texts.iter().map(|text| lines_of(text)).collect();
    let places: std::collections::BTreeSet<&Place> = lines.iter().flat_map(BTreeMap::keys).collect();
    let mut operands = String::new();
    for place in places {
        let words: Vec<Option<&Vec<&str>>> = lines.iter().map(|lines| lines.get(place)).collect();
        if words.iter().any(|words| *words != lines[0].get(place)) {
            write_operands(&mut operands, place, &words)?;
        }
    }
    let mut text = format!("{first}MNUM {} {in_use}\r\n", texts.len());
    if names.iter().any(|name| !name.is_empty()) {
        for (number, name) in (1..).zip(names) {
            let _ = write!(text, "LTTL 0 {number} \"{}\" 0 0 0 1 1 0 0 \"\" 0\r\n", one_line(name).replace('"', "'"));
        }
    }
    let mut operands: Vec<&str> = operands.lines().collect();
    operands.sort_by_key(|line| order_of(line));
    operands.iter().for_each(|line| text.extend([line, "\r\n"]));
    Ok(text)
}

/// Where an operand stands: all configurations of one before the next, as the program reads them.
fn order_of(line: &str) -> (String, usize, usize, usize) {
    let words: Vec<&str> = line.split_whitespace().collect();
    let number = |place: usize| words.get(place).and_then(|word| word.parse().ok()).unwrap_or(0);
    let parameter = if words[0] == "PRAM" { number(5) } else { 0 };
    (words[0].to_owned(), number(1), parameter, number(2))
}

/// Returns the lines of a file by what they are of.
fn lines_of(text: &str) -> BTreeMap<Place, Vec<&str>> {
    let mut surface = None;
    let mut lines = BTreeMap::new();
    for line in text.lines() {
        let mut words = line.split_whitespace();
        let Some(keyword) = words.next() else { continue };
        let mut words: Vec<&str> = words.collect();
        if keyword == "SURF" {
            surface = words.first().and_then(|word| word.parse().ok());
        }
        let number = match (keyword, words.first().and_then(|word| word.parse().ok())) {
            ("PARM" | "XDAT" | "WAVM", Some(number)) => {
                words.remove(0);
                number
            }
            // Lines of remarks are alike, and told apart by their place.
            ("NOTE", _) => lines.len(),
            _ => 0,
        };
        lines.insert((surface, keyword.to_owned(), number), words);
    }
    lines
}

/// Writes the operands of a line that differs among configurations.
fn write_operands(text: &mut String, place: &Place, words: &[Option<&Vec<&str>>]) -> Result<(), OpticsError> {
    let (surface, keyword, number) = place;
    let what = surface.map_or(String::new(), |surface| format!(" of the file's surface {surface}"));
    let reason = format!("{keyword}{what} differs among its configurations, for which the format has no operand");
    let refusal = || OpticsError::CannotWrite { format: "a .zmx file", reason: reason.clone() };
    let at = |words: &Option<&Vec<&str>>, i: usize| words.and_then(|words| words.get(i).copied()).map(str::to_owned);
    let of_surface = surface.unwrap_or(0);
    // One operand after the other, each with all of its configurations, as the program asks for.
    let mut put = |operand: &str, of: usize, i: usize, missing: Option<&str>, behind: &str| {
        let values: Option<Vec<String>> =
            words.iter().map(|words| at(words, i).or_else(|| missing.map(str::to_owned))).collect();
        let values = values.ok_or_else(refusal)?;
        if values.iter().any(|value| *value != values[0]) {
            for (configuration, value) in (1..).zip(values) {
                let value = if value == "INFINITY" { "1e10".to_owned() } else { value };
                let _ = write!(text, "{operand} {of} {configuration} {value} {behind}\r\n");
            }
        }
        Ok(())
    };
    let n_words = words.iter().map(|words| words.map_or(0, Vec::len)).max().unwrap_or(0);
    match keyword.as_str() {
        "DISZ" => put("THIC", of_surface, 0, None, BEHIND),
        "CURV" => put("CRVT", of_surface, 0, None, BEHIND),
        "CONI" => put("CONN", of_surface, 0, Some("0"), BEHIND),
        "DIAM" => put("SDIA", of_surface, 0, None, BEHIND),
        "PARM" => put("PRAM", of_surface, 0, Some("0"), &format!("0 {number} 0 1 1 1 0 0 \"\" 0")),
        "CLAP" => {
            put("APMN", of_surface, 0, None, BEHIND)?;
            put("APMX", of_surface, 1, None, BEHIND)
        }
        "STOP" => {
            // Of the configurations in which this surface is the stop.
            for (configuration, _) in (1..).zip(words).filter(|(_, words)| words.is_some()) {
                let _ = write!(text, "STPS 0 {configuration} {of_surface} {BEHIND}\r\n");
            }
            Ok(())
        }
        "ENPD" => put("APER", 0, 0, None, BEHIND),
        "XFLN" | "YFLN" | "FWGN" => {
            let operand = match keyword.as_str() {
                "XFLN" => "XFIE",
                "YFLN" => "YFIE",
                _ => "FLWT",
            };
            let missing = (keyword == "FWGN").then_some("1");
            (0..n_words).try_for_each(|i| put(operand, i + 1, i, missing, BEHIND))
        }
        "WAVM" => {
            put("WAVE", *number, 0, None, BEHIND)?;
            put("WLWT", *number, 1, None, BEHIND)
        }
        "PWAV" => put("PRWV", 0, 0, None, BEHIND),
        "GLAS" => write_glasses(text, of_surface, words).ok_or_else(refusal),
        _ => Err(refusal()),
    }
}

/// Writes the operands of the medium behind a surface: of a model glass index and Abbe number, of others the name.
fn write_glasses(text: &mut String, surface: usize, words: &[Option<&Vec<&str>>]) -> Option<()> {
    const MODEL: &str = "___BLANK";
    let names = words.iter().map(|words| words.and_then(|words| words.first().copied()).unwrap_or_default());
    let names: Vec<&str> = names.collect();
    let n_model = names.iter().filter(|name| **name == MODEL).count();
    if names.contains(&"MIRROR") || (n_model > 0 && n_model < names.len()) {
        return None;
    }
    if n_model == 0 {
        for (configuration, name) in (1..).zip(names) {
            let _ = write!(text, "GLSS {surface} {configuration} \"{name}\" 0 0 0 1 1 0 0 \"\" 0\r\n");
        }
        return Some(());
    }
    for (operand, i) in [("MIND", 3), ("MABB", 4)] {
        for (configuration, words) in (1..).zip(words) {
            let _ = write!(text, "{operand} {surface} {configuration} {} {BEHIND}\r\n", words.as_ref()?.get(i)?);
        }
    }
    Some(())
}
