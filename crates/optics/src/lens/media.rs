//! The indices of a lens's media, within and beyond the ranges in which they are known.

use super::Lens;
use crate::{Glass, GlassRange, OpticsError};

impl Lens {
    /// Returns the lens with its media refused or continued at wavelengths outside the ranges in which they are known.
    #[must_use]
    pub fn with_glass_range(mut self, glass_range: GlassRange) -> Self {
        self.glass_range = glass_range;
        self
    }

    /// What becomes of a wavelength outside the range in which a medium is known.
    pub fn glass_range(&self) -> GlassRange {
        self.glass_range
    }

    /// Returns the index that one of the lens's media has for the lens, which may continue it beyond its range.
    ///
    /// # Errors
    /// As [`Glass::index_within`].
    pub fn index_in(&self, medium: &Glass, wavelength_nm: f64) -> Result<f64, OpticsError> {
        medium.index_within(self.glass_range, wavelength_nm)
    }

    /// Returns a sentence for each medium that is continued beyond the range in which it is known, with the greatest possible error of
    /// its index at these wavelengths, and for wavefront errors that are held beyond theirs; none where nothing is.
    pub fn notes_on_ranges(&self, wavelengths_nm: &[f64]) -> Vec<String> {
        let mut notes: Vec<String> =
            self.wavefront_errors().flat_map(|error| error.notes_on_ranges(wavelengths_nm)).collect();
        if self.glass_range == GlassRange::Refuse {
            return notes;
        }
        let behind = self.interfaces.iter().map(|interface| &interface.medium_after);
        for medium in std::iter::once(&self.object_medium).chain(behind) {
            let Some((first_nm, last_nm)) = medium.range_nm() else { continue };
            let beyond = wavelengths_nm.iter().copied().filter(|&nm| medium.is_beyond(nm));
            let found = beyond.filter_map(|nm| Some((nm, medium.extended_at(nm).ok()?)));
            let Some((nm, most)) = found.max_by(|a, b| a.1.possible_error.total_cmp(&b.1.possible_error)) else {
                continue;
            };
            let note = format!(
                "{} is known from {first_nm} to {last_nm} nm and continued: at {nm} nm its index {:.5} may be off by {:.1e}",
                medium.describe(),
                most.index,
                most.possible_error
            );
            if !notes.contains(&note) {
                notes.push(note);
            }
        }
        notes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notes_name_what_is_continued_once() {
        let bk7 = Glass::Named("SCHOTT:N-BK7".to_owned());
        let lens = Lens::built_in("dgauss-50mm").unwrap();
        let mut interfaces = lens.interfaces().to_vec();
        interfaces.iter_mut().take(1).for_each(|interface| interface.medium_after = bk7.clone());
        let lens = Lens::new("mixed", "made up", interfaces, lens.stop()).unwrap();
        assert!(lens.at(290.0).is_err() && lens.notes_on_ranges(&[290.0]).is_empty());
        let lens = lens.with_glass_range(GlassRange::Extend);
        let notes = lens.notes_on_ranges(&[280.0, 290.0, 550.0]);
        assert_eq!(notes.len(), 1, "{notes:?}");
        assert!(notes[0].starts_with("the glass SCHOTT:N-BK7 is known from 300 to 2500 nm and continued: at 280 nm"));
        assert!(lens.notes_on_ranges(&[550.0]).is_empty());
        // The others are laws through an index and an Abbe number.
        assert!(lens.at(290.0).unwrap_err().to_string().contains("cannot be continued to 290 nm"));
    }
}
