//! Coatings as files: tables of reflectance as CSV, coating files of Zemax, anything else as RON.

use std::path::{Path, PathBuf};

use super::{Coating, ReflectanceTable, dat};
use crate::OpticsError;

/// The largest file that is read, bytes.
const MOST_BYTES: u64 = 16 << 20;

impl Coating {
    /// Reads a coating: a table of reflectance (`.csv` with the columns `wavelength_nm`, `angle_deg`, and `r` or both of `r_s` and `r_p`; `t`,
    /// or `t_s` and `t_p`, where it absorbs), one of a coating file of Zemax (`COATING.DAT:NAME`), or a coating as lens files have it (`.ron`).
    ///
    /// # Errors
    /// When the file cannot be read, is neither, or makes no sense.
    pub fn read(path: &Path) -> Result<Self, OpticsError> {
        let (file, name) = named_in_file(path);
        let path = file.as_path();
        let failed = |reason: String| OpticsError::Io { path: path.to_owned(), reason };
        if path.extension().is_none() && !path.exists() {
            let known = format!("coatings are {}, or a file (.csv, .ron, .dat:NAME)", Self::WORDS.join(", "));
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
        } else if is("dat") {
            dat::parse(&text, name.as_deref())
        } else if is("ron") {
            dioptric_files::ron::from_text(&text).map_err(|error| error.to_string())
        } else {
            Err(format!(
                "has no ending of a coating, expected .csv, .ron or .dat (or one of {})",
                Self::WORDS.join(", ")
            ))
        };
        let coating = coating.map_err(failed)?;
        coating.check().map_err(|error| failed(error.to_string()))?;
        Ok(coating)
    }
}

/// Returns the file of a path, and what stands behind a colon at its end where it is one of Zemax.
fn named_in_file(path: &Path) -> (PathBuf, Option<String>) {
    let words = path.to_string_lossy();
    match words.rsplit_once(':') {
        Some((file, name)) if file.to_ascii_lowercase().ends_with(".dat") => (file.into(), Some(name.to_owned())),
        _ => (path.to_owned(), None),
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
    const KNOWN: [&str; 8] = ["wavelength_nm", "angle_deg", "r", "r_s", "r_p", "t", "t_s", "t_p"];
    if let Some(unknown) = names.iter().find(|name| !KNOWN.contains(&name.as_str())) {
        return Err(format!(
            "column '{unknown}' is unknown, expected wavelength_nm, angle_deg and r, or r_s and r_p, and t, or t_s and t_p"
        ));
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
    let transmittances = match (column("t"), column("t_s"), column("t_p")) {
        (None, None, None) => None,
        (Some(t), None, None) => Some([t, t]),
        (None, Some(s), Some(p)) => Some([s, p]),
        _ => return Err("has a part of t, or of t_s and t_p, expected either the one or both of the others".to_owned()),
    };
    let mut rows: Vec<[f64; 6]> = Vec::new();
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
        let [s, p] = reflectances;
        let [t_s, t_p] = transmittances.unwrap_or(reflectances);
        rows.push([number(nm)?, number(deg)?, number(s)?, number(p)?, number(t_s)?, number(t_p)?]);
    }
    ReflectanceTable::of_rows(rows, transmittances.is_some())
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
    fn what_is_transmitted_may_be_stated() {
        let table = table_from_csv("wavelength_nm,angle_deg,r,t\n500,0,.1,.7\n").unwrap();
        assert_eq!((table.t_s.clone(), table.t_p.clone()), (vec![vec![0.7]], vec![vec![0.7]]));
        table.check().unwrap();
        let much = table_from_csv("wavelength_nm,angle_deg,r,t_s,t_p\n500,0,.1,.7,.95\n").unwrap();
        assert!(much.check().unwrap_err().to_string().contains("0.1 reflected and 0.95 transmitted at 500 nm"));
    }

    #[test]
    fn what_is_wrong_is_said() {
        let message = |text: &str| table_from_csv(text).unwrap_err();
        assert!(message("wavelength_nm,angle_deg,x\n").contains("column 'x' is unknown"));
        assert!(message("wavelength_nm,angle_deg,r,t_s\n").contains("a part of t"));
        assert!(message("wavelength_nm,angle_deg,r_s\n500,0,.1").contains("r_s and r_p"));
        assert!(message("wavelength_nm,angle_deg,r\n500,0,x").contains("line 2: 'x' is no number"));
        assert!(message("wavelength_nm,angle_deg,r\n500,0,.1\n600,10,.1").contains("2 rows"));
        assert!(message("wavelength_nm,angle_deg,r\n500,0,.1\n500,0,.1\n").contains("2 rows"));
        assert!(message("wavelength_nm,angle_deg,r,r\n500,0,.1,.2\n").contains("column r twice"));
        assert!(message("").contains("is empty"));
    }
}
