//! Pages of the refractiveindex.info database (`.yml`): the dispersion formula or the table of one material.
//!
//! The pages use little of YAML: under `DATA:` a list of blocks, each with a `type` and either `coefficients` and
//! `wavelength_range` or, after `data: |`, rows of numbers. Of the blocks the first that gives an index is read, and the
//! first that gives an extinction coefficient.

use crate::{CatalogueGlass, Glass};

use super::{text_error::TextError, zmx::nm_of_um};

/// A block under `DATA:`.
#[derive(Default)]
struct Block {
    line: usize,
    kind: String,
    coefficients: Vec<f64>,
    range_um: Option<(f64, f64)>,
    rows: Vec<Vec<f64>>,
}

/// Reads the material of a page; a page does not say its name.
pub(super) fn glass_from_yaml(text: &str, name: &str) -> Result<CatalogueGlass, TextError> {
    let mut blocks: Vec<Block> = Vec::new();
    let (mut is_data, mut is_table) = (false, false);
    for (line, text) in text.lines().enumerate().map(|(i, text)| (i + 1, text)) {
        let trimmed = text.trim();
        if trimmed.is_empty() || trimmed.starts_with('#') {
            continue;
        }
        if !text.starts_with([' ', '\t', '-']) {
            is_data = trimmed.starts_with("DATA:");
            continue;
        }
        if !is_data {
            continue;
        }
        let entry = match trimmed.strip_prefix('-') {
            Some(rest) if rest.starts_with([' ', '\t']) => {
                blocks.push(Block { line, ..Default::default() });
                is_table = false;
                rest.trim()
            }
            _ => trimmed,
        };
        let Some(block) = blocks.last_mut() else { continue };
        match entry.split_once(':') {
            Some((key, value)) => {
                is_table = key.trim() == "data";
                block.take(key.trim(), value.trim().trim_matches(['"', '\'']), line)?;
            }
            None if is_table => block.rows.push(numbers(entry, line, "data")?),
            None => return Err(wrong(line, entry, "expected 'key: value'")),
        }
    }
    let Some(block) = blocks.iter().find(|block| block.gives_index()) else {
        let reason = "no refractive index in the file; expected DATA with a formula or a table of n".to_owned();
        return Err(TextError { line: None, reason });
    };
    let absorbing = blocks.iter().find(|block| matches!(block.kind.as_str(), "tabulated k" | "tabulated nk"));
    let extinctions = absorbing.map(Block::extinctions).transpose()?.unwrap_or_default();
    let glass = block.glass()?.with_extinction(extinctions);
    glass.check().map_err(|error| TextError { line: Some(block.line), reason: error.to_string() })?;
    Ok(CatalogueGlass { maker: String::new(), name: name.to_owned(), glass })
}

fn wrong(line: usize, key: &str, reason: &str) -> TextError {
    TextError { line: Some(line), reason: format!("{key}: {reason}") }
}

fn numbers(text: &str, line: usize, key: &str) -> Result<Vec<f64>, TextError> {
    let number = |word: &str| match word.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(wrong(line, key, &format!("'{word}' is not a number"))),
    };
    text.split([' ', '\t', ',']).filter(|word| !word.is_empty()).map(number).collect()
}

impl Block {
    fn take(&mut self, key: &str, value: &str, line: usize) -> Result<(), TextError> {
        match key {
            "type" => self.kind = value.to_owned(),
            "coefficients" => self.coefficients = numbers(value, line, key)?,
            "wavelength_range" | "range" => {
                let &[first_um, last_um] = numbers(value, line, key)?.as_slice() else {
                    return Err(wrong(line, key, "expected two wavelengths in µm"));
                };
                self.range_um = Some((first_um, last_um));
            }
            _ => {}
        }
        Ok(())
    }

    fn gives_index(&self) -> bool {
        self.kind.starts_with("formula") || matches!(self.kind.as_str(), "tabulated n" | "tabulated nk")
    }

    fn glass(&self) -> Result<Glass, TextError> {
        let glass = match self.kind.strip_prefix("formula") {
            Some(formula) => Glass::Formula {
                formula: formula.trim().parse().map_err(|_| wrong(self.line, "type", "expected 'formula 1' to 9"))?,
                coefficients: self.coefficients.clone(),
                range_nm: self.range_um.map(|(first, last)| (nm_of_um(first), nm_of_um(last))),
            },
            None => {
                let mut rows = self.column(1)?;
                rows.sort_by(|a, b| a.0.total_cmp(&b.0));
                let (wavelengths_nm, indices) = rows.into_iter().unzip();
                Glass::Tabulated { wavelengths_nm, indices }
            }
        };
        Ok(glass)
    }

    /// Returns the extinction coefficients of the table, each with its wavelength in nm.
    fn extinctions(&self) -> Result<Vec<(f64, f64)>, TextError> {
        self.column(if self.kind == "tabulated nk" { 2 } else { 1 })
    }

    /// Returns a column of the table, each number with its wavelength in nm.
    fn column(&self, column: usize) -> Result<Vec<(f64, f64)>, TextError> {
        let n_columns = if self.kind == "tabulated nk" { 3 } else { 2 };
        if self.rows.iter().any(|row| row.len() != n_columns) {
            return Err(wrong(self.line, "data", &format!("expected {n_columns} numbers in each row")));
        }
        Ok(self.rows.iter().map(|row| (nm_of_um(row[0]), row[column])).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FORMULA: &str = "# this file is part of refractiveindex.info database\nREFERENCES: |\n    a: book - with signs\n\
        COMMENTS: \"none\"\nDATA:\n  - type: tabulated k\n    data: |\n        0.3 2.8e-6\n        0.4 1e-8\n\
        \x20 - type: formula 2 \n    wavelength_range: 0.3 2.5\n    coefficients: 0 1.03961212 0.00600069867 0.231792344 \
        0.0200179144 1.01046945 103.560653\nSPECS:\n    n_is_absolute: false\n";
    const TABLE: &str = "DATA:\n- type: tabulated nk\n  data: |\n    0.5 1.5 0.1\n    0.4 1.6 0.2\n";

    #[test]
    fn formula_is_found_beside_the_absorption() {
        let found = glass_from_yaml(FORMULA, "N-BK7").ok().unwrap();
        assert_eq!((found.full_name().as_str(), found.glass.range_nm()), ("N-BK7", Some((300.0, 2500.0))));
        assert!((found.glass.index_at(587.5618).unwrap() - 1.5168).abs() < 1e-6);
        assert_eq!(found.glass.extinction_at(400.0), Some(1e-8));
        let negative = glass_from_yaml(&FORMULA.replace("1e-8", "-1e-8"), "").err().unwrap();
        assert!(negative.reason.contains("extinction is -0.00000001"), "{}", negative.reason);
    }

    #[test]
    fn table_is_sorted_and_read_with_its_absorption() {
        let found = glass_from_yaml(TABLE, "").ok().unwrap().glass;
        let law = Glass::Tabulated { wavelengths_nm: vec![400.0, 500.0], indices: vec![1.6, 1.5] };
        assert_eq!((found.extinction_at(400.0), found.extinction_at(500.0)), (Some(0.2), Some(0.1)));
        assert_eq!(found.index_at(400.0).unwrap(), 1.6);
        let plain = TABLE.replace("nk", "n").replace(" 0.1", "").replace(" 0.2", "");
        assert_eq!(glass_from_yaml(&plain, "").ok().unwrap().glass, law);
    }

    #[test]
    fn mistakes_are_reported_by_line_and_key() {
        let message = |text: &str, from: &str, to: &str| {
            let error = glass_from_yaml(&text.replace(from, to), "").err().unwrap();
            format!("{}: {}", error.line.unwrap_or(0), error.reason)
        };
        assert_eq!(message(TABLE, "1.6", "x"), "5: data: 'x' is not a number");
        assert_eq!(message(TABLE, "1.6 ", ""), "2: data: expected 3 numbers in each row");
        assert_eq!(message(FORMULA, "formula 2", "formula x"), "10: type: expected 'formula 1' to 9");
        assert_eq!(message(FORMULA, "formula 2", "formula 12"), "10: glass: formula is 12, expected 1 to 9");
        assert_eq!(message(FORMULA, "0.3 2.5", "0.3"), "11: wavelength_range: expected two wavelengths in µm");
        assert!(message(FORMULA, "formula 2", "tabulated k").contains("no refractive index in the file"));
    }
}
