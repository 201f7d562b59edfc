//! Glasses by the names that lens files use.

use crate::{CatalogueGlass, Glass, GlassCatalogue, OpticsError};

use super::lens_file::{MissingGlass, ReadOptions, SeqNumbers};

/// Where a lens file's glasses are looked up.
#[derive(Clone)]
pub(super) struct Glasses<'a> {
    options: &'a ReadOptions,
    /// The catalogues that the file itself names, in order.
    pub(super) makers: Vec<String>,
    /// Glasses that the file itself defines.
    pub(super) private: Vec<CatalogueGlass>,
}

/// A glass that was found, and what the reader of the file should know about it.
pub(super) struct Found {
    pub(super) glass: Glass,
    pub(super) note: Option<String>,
}

impl<'a> Glasses<'a> {
    pub(super) fn new(options: &'a ReadOptions) -> Self {
        Self { options, makers: Vec::new(), private: Vec::new() }
    }

    /// What the numbers of a CODE V file are taken for.
    pub(super) fn seq_numbers(&self) -> Option<SeqNumbers> {
        self.options.seq_numbers
    }

    /// The configuration that is asked for, counted from 1.
    pub(super) fn configuration(&self) -> Option<usize> {
        self.options.configuration
    }

    /// Returns the glass of this name; `nd_vd` is what the file states of it besides.
    pub(super) fn find(&self, name: &str, nd_vd: Option<(f64, f64)>) -> Result<Found, String> {
        let Found { glass, note } = self.named(name, nd_vd)?;
        let other = nd_vd.and_then(|stated| note_on_numbers(name, &glass, stated));
        Ok(Found { glass, note: [note, other].into_iter().flatten().reduce(|note, other| format!("{note}; {other}")) })
    }

    fn named(&self, name: &str, nd_vd: Option<(f64, f64)>) -> Result<Found, String> {
        let found = |glass| Ok(Found { glass, note: None });
        if let Some(private) = self.private.iter().find(|glass| glass.name.eq_ignore_ascii_case(name)) {
            return found(private.glass.clone());
        }
        let makers: Vec<String> = self.options.makers.iter().chain(&self.makers).cloned().collect();
        for catalogue in &self.options.catalogues {
            match catalogue.find_among(name, &makers) {
                Ok(entry) => return found(entry.glass.clone()),
                Err(OpticsError::Unknown { .. }) => {}
                Err(error) => return Err(error.to_string()),
            }
        }
        let error = match GlassCatalogue::built_in().find_among(name, &makers) {
            Ok(entry) => return Ok(self.built_in(name, entry)),
            Err(error) => error,
        };
        // Where nobody says whose, a name that several have is that of the catalogue which design programs look in first.
        if let (OpticsError::Ambiguous { candidates, .. }, Ok(entry)) =
            (&error, GlassCatalogue::built_in().find_among(name, &[USUAL_MAKER.to_owned()]))
        {
            let full_name = entry.full_name();
            let others: Vec<&str> = candidates.iter().map(String::as_str).filter(|other| *other != full_name).collect();
            let note = format!(
                "glass '{name}' is in several catalogues: {full_name} is taken, not {}; --catalog MAKER chooses another",
                others.join(" or ")
            );
            return Ok(Found { glass: Glass::Named(full_name), note: Some(note) });
        }
        if let Some(glass) = glass_of_digits(name) {
            let (own_nd, own_vd) = glass.nd_vd().unwrap_or_default();
            // The digits are those of the numbers, which may be stated whole.
            let whole = nd_vd.filter(|(nd, vd)| (nd - own_nd).abs() < 1e-3 && (vd - own_vd).abs() < 0.1);
            return found(whole.map_or(glass, |(nd, vd)| model(nd, vd)));
        }
        self.instead(name, nd_vd).ok_or_else(|| {
            let stated = match nd_vd {
                Some(PLACEHOLDER) => {
                    "; n_d 1.5 and V_d 40, which the file states for it, are no data: Zemax writes them \
                     for every glass that it does not know"
                        .to_owned()
                }
                Some((nd, vd)) => format!("; the file states n_d {nd} and V_d {vd} for it"),
                None => String::new(),
            };
            format!("{error}{stated}")
        })
    }

    /// Returns a glass of the built-in catalogue, with a note where its maker is none of those that the file names.
    fn built_in(&self, name: &str, entry: &CatalogueGlass) -> Found {
        let full_name = entry.full_name();
        let named = self.makers.iter().chain(&self.options.makers);
        let is_of_file = named.into_iter().any(|maker| maker.eq_ignore_ascii_case(&entry.maker));
        let note = (!self.makers.is_empty() && !is_of_file).then(|| {
            format!(
                "glass '{name}' is in none of the file's catalogues ({}): it is {full_name}",
                self.makers.join(", ")
            )
        });
        Found { glass: Glass::Named(full_name), note }
    }

    /// Returns what stands for a glass that no catalogue has, where that was asked for.
    fn instead(&self, name: &str, nd_vd: Option<(f64, f64)>) -> Option<Found> {
        let (nd, vd) = nd_vd.filter(|nd_vd| *nd_vd != PLACEHOLDER)?;
        match self.options.missing_glass {
            MissingGlass::Refuse => None,
            MissingGlass::FromNdVd => {
                let note = format!("glass '{name}' is in no catalogue: its n_d {nd} and V_d {vd} stand for it");
                Some(Found { glass: model(nd, vd), note: Some(note) })
            }
            MissingGlass::Nearest => {
                let (nearest, distance) = GlassCatalogue::built_in().nearest(nd, vd, 1).into_iter().next()?;
                let full_name = nearest.full_name();
                let note = format!(
                    "glass '{name}' is in no catalogue: {full_name} stands for it, {distance:.1} melt tolerances away"
                );
                Some(Found { glass: Glass::Named(full_name), note: Some(note) })
            }
        }
    }
}

/// Returns a note where a file states numbers for a glass that are not those of its name.
fn note_on_numbers(name: &str, glass: &Glass, (nd, vd): (f64, f64)) -> Option<String> {
    let (own_nd, own_vd) = glass.nd_vd().filter(|_| (nd, vd) != PLACEHOLDER && nd > 1.0)?;
    let differs = (nd - own_nd).abs() > MELT_ND || (vd > 0.0 && (vd / own_vd - 1.0).abs() > MELT_VD);
    differs.then(|| {
        format!(
            "the file states n_d {nd} and V_d {vd} for '{name}', of which {} is taken with n_d {own_nd:.6} and V_d {own_vd:.2}",
            glass.describe()
        )
    })
}

/// The most that the index at the d line, and the Abbe number by its share, of one glass differ between melts: the usual tolerances of catalogues, and as much again for
/// numbers of other years.
const MELT_ND: f64 = 3e-4;
const MELT_VD: f64 = 0.016;

/// The maker whose glass a name means that several have, where neither the file nor its reader names any.
const USUAL_MAKER: &str = "SCHOTT";

/// What Zemax writes as index and Abbe number of a glass of a catalogue, unless they are stored with the file: no data.
const PLACEHOLDER: (f64, f64) = (1.5, 40.0);

/// Returns the glass of the six digits by which makers code an index less 1 and an Abbe number: `517642`, `517.642` or, with more of them,
/// `516800.641700`. Of `003283` the index is 2.003, since no glass has less than 1.2.
pub(super) fn glass_of_digits(word: &str) -> Option<Glass> {
    let (nd, vd) = match word.split_once('.') {
        Some(parts) => parts,
        None if word.len() == 6 => word.split_at_checked(3)?,
        None => return None,
    };
    let are_digits = |digits: &str| digits.len() >= 3 && digits.bytes().all(|sign| sign.is_ascii_digit());
    if !(are_digits(nd) && are_digits(vd)) {
        return None;
    }
    let whole = if nd < "2" { 2 } else { 1 };
    let (nd, vd) = (format!("{whole}.{nd}"), format!("{}.{}", &vd[..2], &vd[2..]));
    Some(model(nd.parse().ok()?, vd.parse().ok()?))
}

/// Returns the glass of an index and an Abbe number as files state them: an Abbe number of 0 means no dispersion.
pub(super) fn model(nd: f64, vd: f64) -> Glass {
    if vd == 0.0 { constant(nd) } else { Glass::NdVd { nd, vd } }
}

/// Returns the medium of an index that does not depend on the wavelength.
pub(super) fn constant(index: f64) -> Glass {
    if index == 1.0 { Glass::Air } else { Glass::Constant { index } }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_are_not_those_of_a_name_are_noted() {
        let options = ReadOptions::default();
        let note = |name: &str, nd_vd: (f64, f64)| Glasses::new(&options).find(name, Some(nd_vd)).unwrap().note;
        for nd_vd in [(1.516_800, 64.17), (1.5168, 0.0), PLACEHOLDER, (0.0, 0.0)] {
            assert_eq!(note("N-BK7", nd_vd), None, "{nd_vd:?}");
        }
        for nd_vd in [(1.9, 30.0), (1.5168, 60.0)] {
            let note = note("N-BK7", nd_vd).unwrap();
            assert!(
                note.contains(&format!("n_d {}", nd_vd.0)) && note.contains("n_d 1.516800 and V_d 64.17"),
                "{note}"
            );
        }
    }

    #[test]
    fn name_of_several_glasses_is_that_of_the_first_maker_named() {
        let find = |name: &str, of_user: &[&str], of_file: &[&str]| {
            let own = |list: &[&str]| list.iter().map(|&maker| maker.to_owned()).collect::<Vec<_>>();
            let options = ReadOptions { makers: own(of_user), ..Default::default() };
            let mut glasses = Glasses::new(&options);
            glasses.makers = own(of_file);
            let found = glasses.find(name, None)?;
            Ok::<_, String>((found.glass, found.note))
        };
        let named = |name: &str| Glass::Named(name.to_owned());
        // SCHOTT, HIKARI and CDGM have an F2; of two others two makers have one.
        let (glass, note) = find("F2", &[], &[]).unwrap();
        assert!(glass == named("SCHOTT:F2") && note.unwrap().contains("CDGM:F2 or HIKARI:F2"));
        assert_eq!(find("F2", &["HIKARI"], &[]).unwrap(), (named("HIKARI:F2"), None));
        assert_eq!(find("F2", &[], &["CDGM"]).unwrap(), (named("CDGM:F2"), None));
        assert_eq!(find("F2", &["HIKARI"], &["CDGM"]).unwrap(), (named("HIKARI:F2"), None));
        let message = find("BAF4", &[], &[]).unwrap_err();
        assert!(message.contains("CDGM:BAF4") && message.contains("HIKARI:BAF4"), "{message}");
        assert_eq!(find("BAF4", &["cdgm"], &[]).unwrap().0, named("CDGM:BAF4"));
    }

    #[test]
    fn placeholder_of_zemax_is_no_glass() {
        for missing_glass in [MissingGlass::Refuse, MissingGlass::FromNdVd, MissingGlass::Nearest] {
            let options = ReadOptions { missing_glass, ..Default::default() };
            let glasses = Glasses::new(&options);
            let reason = glasses.find("UNOBTAINIUM", Some((1.5, 40.0))).err().expect("it is refused");
            assert!(reason.contains("UNOBTAINIUM") && reason.contains("are no data"), "{reason}");
            let is_taken = glasses.find("UNOBTAINIUM", Some((1.523, 58.6))).is_ok();
            assert_eq!(is_taken, missing_glass != MissingGlass::Refuse);
        }
    }
}
