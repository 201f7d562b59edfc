//! Reads N randomly changed world files of every format, as the test `scenes` does with a few hundred.
//!
//! `cargo run --release -p dioptric-world --all-features --example fuzz_readers -- 1000000 [first] [name]`: mutants `first` and on of
//! each seed, or of those whose name holds this; they are written to the folder for temporary files (`TMPDIR=/dev/shm` spares the disk). At the end, where
//! the system tells, the most memory that reading took.
#![expect(clippy::print_stdout, reason = "this is a command")]

use dioptric_golden::{mutants_wanted, read_mutants};

#[path = "../tests/mutate/mod.rs"]
mod mutate;

use mutate::{read, seeds, write_beside};

fn main() {
    let (numbers, part) = mutants_wanted();
    let folder = tempfile::tempdir().expect("a temporary folder");
    write_beside(folder.path());
    for (name, seed) in seeds().filter(|(name, _)| name.contains(&part)) {
        read_mutants(name, seed, numbers.clone(), |bytes| read(folder.path(), name, bytes));
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        if let Some(most) = status.lines().find_map(|line| line.strip_prefix("VmHWM:")) {
            println!("{name}: at most {} of memory so far", most.trim());
        }
    }
}
