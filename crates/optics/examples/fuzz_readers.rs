//! Reads N randomly changed files of every format, as the test `formats::robust` does with a few thousand.
//!
//! `cargo run --release -p dioptric-optics --example fuzz_readers -- 1000000 [first] [name]`: mutants `first` and on of
//! each seed, or of those whose name holds this. A panic names the seed and the mutant's number, and its input is left in `crash-NUMBER-NAME`.

use dioptric_golden::{mutants_wanted, read_mutants};

#[path = "../tests/mutate/mod.rs"]
mod mutate;

use mutate::{SEEDS, read};

fn main() {
    let (numbers, part) = mutants_wanted();
    for (name, seed) in SEEDS.into_iter().filter(|(name, _)| name.contains(&part)) {
        read_mutants(name, seed, numbers.clone(), |bytes| read(name, bytes));
    }
}
