//! Coatings as files: tables of reflectance as CSV, anything else as RON.

use std::path::Path;

use super::{Coating, ReflectanceTable};
use crate::OpticsError;

/// The largest file that is read, bytes.
const MOST_BYTES: u64 = 16 << 20;

impl Coating {
    /// Reads a coating: a table of reflectance (`.csv` with the columns `wavelength_nm`, `angle_deg`, and `r` or both of `r_s` and `r_p`), or
    /// a coating as lens files have it (`.ron`).
    ///
    /// # Errors
    /// When the file cannot be read, is neither, or makes no sense.
    pub fn read(path: &Path) -> Result<Self, OpticsError> {
        let failed = |reason: String| OpticsError::Io { path: path.to_owned(), reason };
        if path.extension().is_none() && !path.exists() {
            let known = format!("coatings are {}, or a file (.csv, .ron)", Self::WORDS.join(", "));
            return Err(OpticsError::Unknown { kind: "coating", name: path.display().to_string(), known });
        }
        let size = std::fs::metadata(path).map_err(|error| failed(format!("cannot be read: {error}")))?.len();
        if size > MOST_BYTES {
            return Err(failed(format!("is {size} bytes long, expected a coating of at most {MOST_BYTES}")));
        }
        let text = dioptric_files::text::read(path).map_err(|error| failed(format!("cannot be read: {error}")))?;
        let is = |extension: &str| path.extension().is_some_and(|found| found.eq_ignore_ascii_case(extension));
        let coating = if is("csv") {
            table_from_csv(&text).map(Self::Table)
        } else if is("ron") {
            dioptric_files::ron::from_text(&text).map_err(|error| error.to_string())
        } else {
            Err(format!("has no ending of a coating, expected .csv or .ron (or one of {})", Self::WORDS.join(", ")))
        };
        let coating = coating.map_err(failed)?;
        coating.check().map_err(|error| failed(error.to_string()))?;
        Ok(coating)
    }
}

/// Reads a table whose rows are all pairs of some wavelengths and some angles, in any order.
fn table_from_csv(text: &str) -> Result<ReflectanceTable, String> {
    let text = dioptric_files::text::with_commas(text);
    let lines = text.lines().enumerate().map(|(i, line)| (i + 1, line.trim()));
    let mut lines = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let (_, header) = lines.next().ok_or("is empty, expected wavelength_nm,angle_deg,r or r_s,r_p")?;
    let names: Vec<String> =
        header.split(',').map(|name| name.trim().trim_matches('"').trim().to_lowercase()).collect();
    const KNOWN: [&str; 5] = ["wavelength_nm", "angle_deg", "r", "r_s", "r_p"];
    if let Some(unknown) = names.iter().find(|name| !KNOWN.contains(&name.as_str())) {
        return Err(format!("column '{unknown}' is unknown, expected wavelength_nm, angle_deg and r, or r_s and r_p"));
    }
    if let Some(twice) = names.iter().enumerate().find(|(i, name)| names[..*i].contains(name)) {
        return Err(format!("has the column {} twice", twice.1));
    }
    let column = |name: &str| names.iter().position(|found| found == name);
    let needed = |name: &str| column(name).ok_or(format!("has no column {name}"));
    let (nm, deg) = (needed("wavelength_nm")?, needed("angle_deg")?);
    let reflectances = match (column("r"), column("r_s"), column("r_p")) {
        (Some(r), None, None) => [r, r],
        (None, Some(s), Some(p)) => [s, p],
        _ => return Err("needs either the column r or both of r_s and r_p".to_owned()),
    };
    let mut rows: Vec<[f64; 4]> = Vec::new();
    for (line, text) in lines {
        let cells: Vec<&str> = text.split(',').map(str::trim).collect();
        if cells.len() != names.len() {
            return Err(format!("line {line} has {} numbers, expected {}", cells.len(), names.len()));
        }
        let number = |i: usize| {
            cells[i]
                .parse::<f64>()
                .ok()
                .filter(|v| v.is_finite())
                .ok_or(format!("line {line}: '{}' is no number", cells[i]))
        };
        rows.push([number(nm)?, number(deg)?, number(reflectances[0])?, number(reflectances[1])?]);
    }
    let distinct = |k: usize| {
        let mut list: Vec<f64> = rows.iter().map(|row| row[k]).collect();
        list.sort_by(f64::total_cmp);
        list.dedup();
        list
    };
    let (wavelengths_nm, angles_deg) = (distinct(0), distinct(1));
    if rows.is_empty() || rows.len() != wavelengths_nm.len() * angles_deg.len() {
        return Err(format!(
            "has {} rows, expected each of its {} wavelengths with each of its {} angles once",
            rows.len(),
            wavelengths_nm.len(),
            angles_deg.len()
        ));
    }
    rows.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    if let Some(twice) = rows.windows(2).find(|two| two[0][..2] == two[1][..2]) {
        return Err(format!("states {} nm at {} degrees twice", twice[0][0], twice[0][1]));
    }
    let values = |k: usize| rows.chunks(angles_deg.len()).map(|row| row.iter().map(|r| r[k]).collect()).collect();
    let (r_s, r_p) = (values(2), values(3));
    Ok(ReflectanceTable { wavelengths_nm, angles_deg, r_s, r_p })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn csv_is_read_in_any_order() {
        let table = table_from_csv(
            "# lab\nangle_deg, wavelength_nm, r_p, r_s\n0,600,.02,.02\n30,400,0.01,.03\n0,400,.01,.01\n30,600,0,.04\n",
        )
        .unwrap();
        assert_eq!((table.wavelengths_nm.clone(), table.angles_deg.clone()), (vec![400.0, 600.0], vec![0.0, 30.0]));
        assert_eq!((table.r_s[0].clone(), table.r_p[1].clone()), (vec![0.01, 0.03], vec![0.02, 0.0]));
        for text in ["wavelength_nm,angle_deg,r\n500,0,.01", "# lab\n\"wavelength_nm\",\"angle_deg\",\"r\"\n500,0,.01"]
        {
            assert_eq!(table_from_csv(text).unwrap().r_p, vec![vec![0.01]]);
        }
    }

    #[test]
    fn what_is_wrong_is_said() {
        let message = |text: &str| table_from_csv(text).unwrap_err();
        assert!(message("wavelength_nm,angle_deg,t\n").contains("column 't' is unknown"));
        assert!(message("wavelength_nm,angle_deg,r_s\n500,0,.1").contains("r_s and r_p"));
        assert!(message("wavelength_nm,angle_deg,r\n500,0,x").contains("line 2: 'x' is no number"));
        assert!(message("wavelength_nm,angle_deg,r\n500,0,.1\n600,10,.1").contains("2 rows"));
        assert!(message("wavelength_nm,angle_deg,r\n500,0,.1\n500,0,.1\n").contains("2 rows"));
        assert!(message("wavelength_nm,angle_deg,r,r\n500,0,.1,.2\n").contains("column r twice"));
        assert!(message("").contains("is empty"));
    }
}
