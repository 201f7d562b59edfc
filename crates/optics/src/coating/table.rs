//! Reflectances as measured, by wavelength and angle.

use serde::{Deserialize, Serialize};

use crate::OpticsError;

/// What a coating reflects, by wavelength and by the angle of incidence in the medium of lower index, air as a rule; between its points
/// straight lines, beyond the last angle up to 1 at 90°.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReflectanceTable {
    /// Ascending wavelengths, nm.
    pub wavelengths_nm: Vec<f64>,
    /// Ascending angles of incidence from 0 on, degrees.
    pub angles_deg: Vec<f64>,
    /// For each wavelength, at each angle, the share reflected of light whose electric field is across the plane of incidence.
    pub r_s: Vec<Vec<f64>>,
    /// The same of light whose field is in that plane.
    pub r_p: Vec<Vec<f64>>,
}

impl ReflectanceTable {
    /// Checks that all numbers are there and make sense.
    ///
    /// # Errors
    /// When they do not.
    pub fn check(&self) -> Result<(), OpticsError> {
        let wrong = |reason: String| Err(OpticsError::Coating { reason });
        for (what, list) in [("wavelengths_nm", &self.wavelengths_nm), ("angles_deg", &self.angles_deg)] {
            let ascends = list.windows(2).all(|two| two[0] < two[1]);
            if list.is_empty() || !ascends || list.iter().any(|v| !v.is_finite()) {
                return wrong(format!("{what} of a table of reflectance is {list:?}, expected ascending numbers"));
            }
        }
        if self.wavelengths_nm[0] <= 0.0 {
            return wrong(format!("a table of reflectance begins at {} nm", self.wavelengths_nm[0]));
        }
        let (first_deg, last_deg) = (self.angles_deg[0], self.angles_deg[self.angles_deg.len() - 1]);
        if first_deg != 0.0 || last_deg > 90.0 {
            return wrong(format!(
                "the angles of a table of reflectance are {first_deg} to {last_deg} degrees, expected 0 to at most 90"
            ));
        }
        for (what, rows) in [("r_s", &self.r_s), ("r_p", &self.r_p)] {
            let is_full =
                rows.len() == self.wavelengths_nm.len() && rows.iter().all(|row| row.len() == self.angles_deg.len());
            if !is_full {
                return wrong(format!(
                    "{what} of a table of reflectance needs {} rows, one a wavelength, of {} numbers, one an angle",
                    self.wavelengths_nm.len(),
                    self.angles_deg.len()
                ));
            }
            if let Some(found) = rows.iter().flatten().find(|r| !(0.0..=1.0).contains(*r)) {
                return wrong(format!("{what} of a table of reflectance is {found}, expected 0 to 1"));
            }
        }
        Ok(())
    }

    /// Returns the table at a wavelength: for each angle, degrees, the shares reflected of s and p.
    ///
    /// # Errors
    /// Beyond the table's wavelengths.
    pub(crate) fn at(&self, wavelength_nm: f64) -> Result<Vec<(f64, [f64; 2])>, OpticsError> {
        let list = &self.wavelengths_nm;
        let (first, last) = (list[0], list[list.len() - 1]);
        if !(first..=last).contains(&wavelength_nm) {
            let reason =
                format!("a table of reflectance is known from {first} to {last} nm, not at {wavelength_nm} nm");
            return Err(OpticsError::Coating { reason });
        }
        let above = list.partition_point(|&nm| nm < wavelength_nm).clamp(1, list.len().max(2) - 1).min(list.len() - 1);
        let below = above.saturating_sub(1);
        let share = match list[above] - list[below] {
            0.0 => 0.0,
            step => (wavelength_nm - list[below]) / step,
        };
        let between = |rows: &[Vec<f64>], j: usize| rows[below][j] + share * (rows[above][j] - rows[below][j]);
        let angle = |(j, &deg): (usize, &f64)| (deg, [between(&self.r_s, j), between(&self.r_p, j)]);
        Ok(self.angles_deg.iter().enumerate().map(angle).collect())
    }
}

/// Returns the shares of s and p reflected at a cosine of incidence, of a table at one wavelength.
pub(crate) fn share_between(table: &[(f64, [f64; 2])], cos: f64) -> [f64; 2] {
    let deg = cos.clamp(0.0, 1.0).acos().to_degrees();
    let above = table.partition_point(|(at, _)| *at <= deg);
    let (from, from_r) = table[above.saturating_sub(1)];
    let (to, to_r) = table.get(above).copied().unwrap_or((90.0, [1.0; 2]));
    let share = if to > from { (deg - from) / (to - from) } else { 0.0 };
    std::array::from_fn(|k| from_r[k] + share * (to_r[k] - from_r[k]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> ReflectanceTable {
        ReflectanceTable {
            wavelengths_nm: vec![400.0, 600.0],
            angles_deg: vec![0.0, 30.0],
            r_s: vec![vec![0.01, 0.03], vec![0.02, 0.04]],
            r_p: vec![vec![0.01, 0.0], vec![0.02, 0.01]],
        }
    }

    #[test]
    fn straight_lines_lie_between_points() {
        let at = table().at(500.0).unwrap();
        let close = |found: [f64; 2], expected: [f64; 2]| {
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?} {expected:?}");
        };
        close(share_between(&at, 15f64.to_radians().cos()), [0.025, 0.01]);
        close(share_between(&at, 60f64.to_radians().cos()), [0.5175, 0.5025]);
        close(share_between(&at, 0.0), [1.0, 1.0]);
        close(share_between(&table().at(600.0).unwrap(), 1.0), [0.02, 0.02]);
        let single = ReflectanceTable {
            wavelengths_nm: vec![500.0],
            r_s: vec![vec![0.1; 2]],
            r_p: vec![vec![0.1; 2]],
            ..table()
        };
        close(share_between(&single.at(500.0).unwrap(), 1.0), [0.1, 0.1]);
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        let message = |table: ReflectanceTable| table.check().unwrap_err().to_string();
        assert!(
            message(ReflectanceTable { r_s: vec![vec![1.2, 0.0]; 2], ..table() })
                .contains("r_s of a table of reflectance is 1.2")
        );
        assert!(message(ReflectanceTable { r_p: vec![vec![0.1; 2]], ..table() }).contains("needs 2 rows"));
        assert!(message(ReflectanceTable { angles_deg: vec![5.0, 30.0], ..table() }).contains("5 to 30 degrees"));
        assert!(table().at(700.0).unwrap_err().to_string().contains("from 400 to 600 nm"));
    }
}
