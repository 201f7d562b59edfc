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

fn error_of(name: &str, bytes: &[u8]) -> Option<OpticsError> {
    LensFile::from_bytes(Path::new(name), bytes, &ReadOptions::default()).err()
}
