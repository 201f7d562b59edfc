//! No file, however broken, makes a reader panic or hang.

use std::path::Path;

use dioptric_optics::{LensFile, OpticsError, ReadOptions};

use crate::mutate::{SEEDS, read};
use dioptric_golden::mutant;

#[test]
fn every_seed_is_read_and_thousands_of_its_mutants_end_in_a_lens_or_an_error() {
    for (name, seed) in SEEDS {
        assert!(read(name, seed), "{name}: {:?}", error_of(name, seed));
        let n_read = (0..3000).filter(|&number| read(name, &mutant(seed, number))).count();
        // Some changes are harmless and most are not: else the readers, or the mutants, would be asleep.
        assert!((30..2970).contains(&n_read), "{name}: {n_read} of 3000 mutants were read");
    }
}

/// What would be written has a distance that readers refuse.
#[test]
fn tilted_film_too_far_to_be_read_again_is_not_written() {
    let of = |film_mm: &str| {
        let text = format!(
            "RDM;LEN\nDIM M\nWL 588\nEPD 300\nSO 0 1e11\nS -1600 -550 REFL\n  STO\nS -666.7 550 REFL\n  ADE 45; BEN\nSI 0 {film_mm}\nGO\n"
        );
        LensFile::from_bytes(Path::new("far.seq"), text.as_bytes(), &ReadOptions::default()).unwrap()
    };
    assert!(read("near.seq", of("1000").to_seq().unwrap().as_bytes()));
    let error = of("999999999").to_seq().unwrap_err();
    assert!(matches!(error, OpticsError::CannotWrite { .. }), "{error}");
    assert!(error.to_string().contains("the film stands 2.5e8 mm"), "{error}");
}

fn error_of(name: &str, bytes: &[u8]) -> Option<OpticsError> {
    LensFile::from_bytes(Path::new(name), bytes, &ReadOptions::default()).err()
}
