//! Reflectances and transmittances as measured, by wavelength and angle.

use serde::{Deserialize, Serialize};

use crate::OpticsError;

/// What a coating reflects and transmits, by wavelength and by the angle of incidence in the medium of lower index, air as a rule.
///
/// Between wavelengths it is interpolated along straight lines, between angles by monotone cubics. Before the first angle it is as there.
/// Beyond the last it rises to 1 at 90° as the reflectance of surfaces does, `R + (1 − R) (1 − cos θ / cos θ_last)⁵` (Schlick, *An
/// Inexpensive BRDF Model for Physically-based Rendering*, 1994), and what is transmitted falls as what is not reflected.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReflectanceTable {
    /// Ascending wavelengths, nm.
    pub wavelengths_nm: Vec<f64>,
    /// Ascending angles of incidence, degrees: from 0 on, or from one up to 15, at which instruments measure.
    pub angles_deg: Vec<f64>,
    /// For each wavelength, at each angle, the share reflected of light whose electric field is across the plane of incidence.
    pub r_s: Vec<Vec<f64>>,
    /// The same of light whose field is in that plane.
    pub r_p: Vec<Vec<f64>>,
    /// The shares transmitted of both, where the coating absorbs: what is left out goes on. Both or neither.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub t_s: Vec<Vec<f64>>,
    /// The second of them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub t_p: Vec<Vec<f64>>,
}

/// The largest angle that may stand for light that falls straight on a surface, degrees: instruments measure at 5 to 12.
const STRAIGHT_ON_DEG: f64 = 15.0;

impl ReflectanceTable {
    /// Returns the table of rows: wavelength, nm, angle, degrees, shares reflected of s and p, and those transmitted, if these count.
    pub(super) fn of_rows(mut rows: Vec<[f64; 6]>, transmits: bool) -> Result<Self, String> {
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
        let values = |k: usize| -> Vec<Vec<f64>> {
            rows.chunks(angles_deg.len()).map(|row| row.iter().map(|r| r[k]).collect()).collect()
        };
        let (r_s, r_p) = (values(2), values(3));
        let [t_s, t_p] = if transmits { [values(4), values(5)] } else { Default::default() };
        Ok(Self { wavelengths_nm, angles_deg, r_s, r_p, t_s, t_p })
    }

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
        if !(0.0..=STRAIGHT_ON_DEG).contains(&first_deg) || last_deg > 90.0 {
            return wrong(format!(
                "the angles of a table of reflectance are {first_deg} to {last_deg} degrees, expected from 0 (at most \
                 {STRAIGHT_ON_DEG}) to at most 90"
            ));
        }
        let has_none = self.t_s.is_empty() && self.t_p.is_empty();
        let all = [("r_s", &self.r_s), ("r_p", &self.r_p), ("t_s", &self.t_s), ("t_p", &self.t_p)];
        for (what, rows) in all.into_iter().take(if has_none { 2 } else { 4 }) {
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
        for (r, t) in [(&self.r_s, &self.t_s), (&self.r_p, &self.t_p)] {
            for ((nm, r), t) in self.wavelengths_nm.iter().zip(r).zip(t) {
                for ((deg, r), t) in self.angles_deg.iter().zip(r).zip(t) {
                    if r + t > 1.0 + ROUNDING {
                        return wrong(format!(
                            "a table of reflectance has {r} reflected and {t} transmitted at {nm} nm and {deg} degrees, \
                             expected 1 at most together"
                        ));
                    }
                }
            }
        }
        Ok(())
    }

    /// Returns the table at a wavelength: for each angle, degrees, the shares reflected of s and p, and those transmitted.
    ///
    /// # Errors
    /// Beyond the table's wavelengths.
    pub(crate) fn at(&self, wavelength_nm: f64) -> Result<Vec<TableRow>, OpticsError> {
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
        let angle = |(j, &deg): (usize, &f64)| {
            let [r_s, r_p] = [between(&self.r_s, j), between(&self.r_p, j)];
            match self.t_s.is_empty() {
                true => (deg, [r_s, r_p, 1.0 - r_s, 1.0 - r_p]),
                false => (deg, [r_s, r_p, between(&self.t_s, j), between(&self.t_p, j)]),
            }
        };
        Ok(self.angles_deg.iter().enumerate().map(angle).collect())
    }
}

/// An angle, degrees, and the shares reflected of s and p and transmitted of both.
pub(crate) type TableRow = (f64, [f64; 4]);

/// By how much shares of a file may exceed 1 together: they have six digits.
const ROUNDING: f64 = 1e-5;

/// Returns the shares of s and p reflected at a cosine of incidence, and those transmitted, of a table at one wavelength.
pub(crate) fn share_between(table: &[TableRow], cos: f64) -> [f64; 4] {
    let deg = cos.clamp(0.0, 1.0).acos().to_degrees();
    let above = table.partition_point(|(at, _)| *at <= deg);
    let last = table.len() - 1;
    if above == 0 {
        return table[0].1;
    }
    let (from_deg, from_r) = table[above - 1];
    if above > last {
        let rise = (1.0 - cos.max(0.0) / from_deg.to_radians().cos()).clamp(0.0, 1.0).powi(5);
        let [r_s, r_p, t_s, t_p] = from_r;
        let risen = [r_s + (1.0 - r_s) * rise, r_p + (1.0 - r_p) * rise, t_s * (1.0 - rise), t_p * (1.0 - rise)];
        return if from_deg < 90.0 { risen } else { from_r };
    }
    let (to_deg, to_r) = table[above];
    let step = to_deg - from_deg;
    let t = (deg - from_deg) / step;
    std::array::from_fn(|k| {
        let (from, to) = (from_r[k], to_r[k]);
        let [slope_from, slope_to] = [above - 1, above].map(|i| step * slope_at(table, i, k));
        let s = 1.0 - t;
        from * s * s * (1.0 + 2.0 * t) + to * t * t * (3.0 - 2.0 * t) + t * s * (slope_from * s - slope_to * t)
    })
}

/// Returns the slope of a share per degree at an angle of a table: the harmonic mean of those beside it, so that no cubic leaves the range
/// of its ends (Fritsch & Butland 1984); level at the first, as what is even about 0° is.
fn slope_at(table: &[TableRow], i: usize, k: usize) -> f64 {
    let secant = |i: usize| (table[i + 1].1[k] - table[i].1[k]) / (table[i + 1].0 - table[i].0);
    if i == 0 {
        return 0.0;
    }
    let before = secant(i - 1);
    if i + 1 == table.len() {
        return before;
    }
    let after = secant(i);
    if before * after > 0.0 { 2.0 * before * after / (before + after) } else { 0.0 }
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
            t_s: Vec::new(),
            t_p: Vec::new(),
        }
    }

    #[test]
    fn cubics_lie_between_points_and_a_rise_beyond() {
        let at = table().at(500.0).unwrap();
        let close = |found: [f64; 4], expected: [f64; 2]| {
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?} {expected:?}");
            assert!((0..2).all(|k| (found[k] + found[k + 2] - 1.0).abs() < 1e-12), "{found:?}");
        };
        // Halfway with slopes of 0 and of the secant: less than the mean by an eighth of the step.
        close(share_between(&at, 15f64.to_radians().cos()), [0.025 - 0.02 / 8.0, 0.01 + 0.01 / 8.0]);
        let rise = (1.0 - 0.5 / 30f64.to_radians().cos()).powi(5);
        close(share_between(&at, 60f64.to_radians().cos()), [0.035 + 0.965 * rise, 0.005 + 0.995 * rise]);
        close(share_between(&at, 0.0), [1.0, 1.0]);
        // Catalogues state one angle, instruments measure at 8°: at small angles that is what a coating reflects.
        for deg in [0.0, 8.0] {
            let single = [(deg, [0.01, 0.01, 0.99, 0.99])];
            close(share_between(&single, 1.0), [0.01, 0.01]);
            assert!(share_between(&single, 20f64.to_radians().cos())[0] < 0.0101);
        }
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
        assert!(message(ReflectanceTable { angles_deg: vec![25.0, 30.0], ..table() }).contains("25 to 30 degrees"));
        let gray = |t: f64| ReflectanceTable { t_s: vec![vec![t; 2]; 2], t_p: vec![vec![t; 2]; 2], ..table() };
        assert!(message(gray(0.98)).contains("0.03 reflected and 0.98 transmitted at 400 nm and 30 degrees"));
        assert!(message(ReflectanceTable { t_p: Vec::new(), ..gray(0.5) }).contains("t_p of a table"));
        let half = share_between(&gray(0.5).at(400.0).unwrap(), 60f64.to_radians().cos());
        let rise = (1.0 - 0.5 / 30f64.to_radians().cos()).powi(5);
        assert!((half[2] - 0.5 * (1.0 - rise)).abs() < 1e-12, "{half:?}");
        assert!(table().at(700.0).unwrap_err().to_string().contains("from 400 to 600 nm"));
    }
}
