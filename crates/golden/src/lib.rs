//! Test support: golden tables and shared reference data that may be absent.
//!
//! This crate is a dev-dependency only; no product crate may use it outside tests.

#![expect(clippy::print_stderr, clippy::print_stdout, reason = "tests say what they skip, commands what they read")]

mod mutants;

use std::{
    fs,
    path::{Path, PathBuf},
};

pub use dioptric_golden_macros::needs_shared;
pub use mutants::{mutant, mutants_wanted, read_mutants};

/// The lenses of the shared reference data (`reference/optics/NAME.json`).
pub const REFERENCE_LENSES: [&str; 10] = [
    "achromat_krakenos",
    "asphere_al1815c",
    "canon_ef50_f18_1m",
    "cooke_triplet",
    "double_gauss_f2",
    "microscope_20x",
    "relay_1to1",
    "singlet_lb1471a",
    "telephoto_laikin",
    "wideangle_100",
];

/// Returns the workspace's root folder.
pub fn workspace_root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.ancestors().nth(2).expect("this crate lies two folders below the root").to_owned()
}

/// Returns a file of the shared reference data beside the workspace, or `None` after saying in one line that
/// the test is skipped.
#[track_caller]
pub fn shared(relative: &str) -> Option<PathBuf> {
    let path = workspace_root().join("../shared").join(relative);
    if path.exists() {
        return Some(path);
    }
    let place = std::panic::Location::caller();
    eprintln!("skipped: {}:{} needs shared/{relative}", place.file(), place.line());
    None
}

/// Compares a table with `fixtures/golden/NAME`, number by number.
///
/// Cells that read as numbers may differ by `tolerance × max(1, |expected|)`; all others must be equal. With
/// `UPDATE_GOLDEN=1` in the environment a table that fails is written anew. A failure leaves the actual
/// table in `target/golden/NAME`.
///
/// # Panics
/// When the tables differ: this is an assertion.
#[track_caller]
pub fn check_csv(name: &str, actual: &str, tolerance: f64) {
    check(name, actual, |expected| first_difference(expected, actual, tolerance));
}

/// Compares a drawing with `fixtures/golden/NAME`, number by number: its numbers may differ by `tolerance_px`, all else
/// must be equal.
///
/// With `UPDATE_GOLDEN=1` in the environment a drawing that fails is written anew. A failure leaves the actual drawing in
/// `target/golden/NAME`, to be looked at beside the expected one.
///
/// # Panics
/// When the drawings differ: this is an assertion.
#[track_caller]
pub fn check_svg(name: &str, actual: &str, tolerance_px: f64) {
    check(name, actual, |expected| first_svg_difference(expected, actual, tolerance_px));
}

#[track_caller]
fn check(name: &str, actual: &str, first_difference: impl Fn(&str) -> Option<String>) {
    let path = workspace_root().join("fixtures/golden").join(name);
    let expected = fs::read_to_string(&path).unwrap_or_default();
    let Some(difference) = first_difference(&expected) else { return };
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        write(&path, actual);
        return;
    }
    let kept = workspace_root().join("target/golden").join(name);
    write(&kept, actual);
    panic!("{name}: {difference}; the actual file is target/golden/{name} (UPDATE_GOLDEN=1 accepts it)");
}

/// Returns where two drawings first differ, or `None` if they agree.
pub fn first_svg_difference(expected: &str, actual: &str, tolerance_px: f64) -> Option<String> {
    let (n_expected, n_actual) = (expected.lines().count(), actual.lines().count());
    if n_expected != n_actual {
        return Some(format!("{n_actual} lines, expected {n_expected}"));
    }
    let differs = |(e, a): (&str, &str)| match (e.parse::<f64>(), a.parse::<f64>()) {
        (Ok(e), Ok(a)) => (e - a).abs() > tolerance_px,
        _ => e != a,
    };
    for (number, (expected, actual)) in expected.lines().zip(actual.lines()).enumerate() {
        let (e, a) = (words_and_numbers(expected), words_and_numbers(actual));
        if e.len() != a.len() || e.into_iter().zip(a).any(differs) {
            let found = format!("line {}: {actual}, expected {expected} within {tolerance_px} px", number + 1);
            return Some(found);
        }
    }
    None
}

/// Splits a text where numbers begin and end.
fn words_and_numbers(text: &str) -> Vec<&str> {
    let mut parts = Vec::new();
    let (mut start, mut in_number) = (0, false);
    for (at, letter) in text.char_indices() {
        let is_number = letter.is_ascii_digit() || (letter == '.' && in_number) || letter == '-';
        // A minus begins a number of its own.
        if is_number != in_number || letter == '-' {
            parts.push(&text[start..at]);
            (start, in_number) = (at, is_number);
        }
    }
    parts.push(&text[start..]);
    parts
}

fn write(path: &Path, text: &str) {
    fs::create_dir_all(path.parent().expect("a golden file lies in a folder")).expect("the folder can be made");
    fs::write(path, text).expect("the golden file can be written");
}

/// Returns where two tables first differ, or `None` if they agree.
pub fn first_difference(expected: &str, actual: &str, tolerance: f64) -> Option<String> {
    let (n_expected, n_actual) = (expected.lines().count(), actual.lines().count());
    for (number, (expected, actual)) in expected.lines().zip(actual.lines()).enumerate() {
        let (e, a): (Vec<&str>, Vec<&str>) = (expected.split(',').collect(), actual.split(',').collect());
        if e.len() != a.len() {
            return Some(format!("line {}: {} cells, expected {}", number + 1, a.len(), e.len()));
        }
        for (e, a) in e.into_iter().zip(a) {
            let same = match (e.trim().parse::<f64>(), a.trim().parse::<f64>()) {
                (Ok(e), Ok(a)) => (e - a).abs() <= tolerance * e.abs().max(1.0),
                _ => e == a,
            };
            if !same {
                return Some(format!("line {}: {a}, expected {e} within {tolerance}", number + 1));
            }
        }
    }
    (n_expected != n_actual).then(|| format!("{n_actual} lines, expected {n_expected}"))
}

#[cfg(test)]
mod tests {
    use super::{first_difference, first_svg_difference};

    #[test]
    fn numbers_are_compared_within_the_tolerance_and_words_exactly() {
        assert_eq!(first_difference("a,1.0\n", "a,1.0000001\n", 1e-6), None);
        assert!(first_difference("a,1.0\n", "a,1.1\n", 1e-6).is_some());
        assert!(first_difference("a,1.0\n", "b,1.0\n", 1e-6).is_some());
        assert!(first_difference("a,1\nb,2\n", "a,1\n", 1e-6).is_some());
        assert!(first_difference("a,1\n", "a,NaN\n", 1e-6).is_some());
    }

    #[test]
    fn drawings_are_compared_by_their_numbers() {
        let differs = |a: &str, b: &str| first_svg_difference(a, b, 0.2).is_some();
        let line = "<path d=\"M1.0 2.0L-3.1-4.0\" stroke=\"#00aa00\"/>";
        assert!(!differs(line, "<path d=\"M1.1 1.9L-3.1-4.1\" stroke=\"#00aa00\"/>"));
        for other in [
            "<path d=\"M1.3 2.0L-3.1-4.0\" stroke=\"#00aa00\"/>",
            "<path d=\"M1.0 2.0L3.1-4.0\" stroke=\"#00aa00\"/>",
            "<path d=\"M1.0 2.0L-3.1-4.0\" stroke=\"#00aa01\"/>",
            "<path d=\"M1.0 2.0H-3.1-4.0\" stroke=\"#00aa00\"/>",
            "<path d=\"M1.0 2.0L-3.1-4.0\" stroke=\"#00aa00\"/>\n<g/>",
        ] {
            assert!(differs(line, other), "{other}");
        }
    }
}
