//! Test support: golden tables and shared reference data that may be absent.
//!
//! This crate is a dev-dependency only; no product crate may use it outside tests.

#![expect(clippy::print_stderr, reason = "a test says on one line that it was skipped")]

use std::{
    fs,
    path::{Path, PathBuf},
};

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
    let path = workspace_root().join("fixtures/golden").join(name);
    let expected = fs::read_to_string(&path).unwrap_or_default();
    let Some(difference) = first_difference(&expected, actual, tolerance) else { return };
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        write(&path, actual);
        return;
    }
    let kept = workspace_root().join("target/golden").join(name);
    write(&kept, actual);
    panic!("{name}: {difference}; the actual table is in target/golden/{name} (UPDATE_GOLDEN=1 accepts it)");
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
    use super::first_difference;

    #[test]
    fn numbers_are_compared_within_the_tolerance_and_words_exactly() {
        assert_eq!(first_difference("a,1.0\n", "a,1.0000001\n", 1e-6), None);
        assert!(first_difference("a,1.0\n", "a,1.1\n", 1e-6).is_some());
        assert!(first_difference("a,1.0\n", "b,1.0\n", 1e-6).is_some());
        assert!(first_difference("a,1\nb,2\n", "a,1\n", 1e-6).is_some());
        assert!(first_difference("a,1\n", "a,NaN\n", 1e-6).is_some());
    }
}
