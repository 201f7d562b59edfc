//! Reads N randomly changed files of every format, as the test `formats_robust` does with a few thousand.
//!
//! `cargo run --release -p dioptric-optics --example fuzz_readers -- 1000000 [first] [name]`: mutants `first` and on of
//! each seed, or of those whose name holds this. A panic names the seed and the mutant's number, and its input is left in `crash-NUMBER-NAME`.
#![expect(clippy::print_stdout, reason = "this is a command")]

use std::{panic, time::Instant};

#[path = "../tests/mutate/mod.rs"]
mod mutate;

use mutate::{SEEDS, mutant, read};

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let number = |place: usize, otherwise: u64| words.get(place).map_or(otherwise, |word| word.parse().unwrap_or(0));
    let (n_mutants, first) = (number(0, 1000), number(1, 0));
    let part = words.get(2).map_or("", String::as_str);
    for (name, seed) in SEEDS.into_iter().filter(|(name, _)| name.contains(part)) {
        let (start, mut slowest_s, mut n_read) = (Instant::now(), (0.0_f64, 0), 0_u64);
        let mut n_crashes = 0;
        for number in first..first + n_mutants {
            let bytes = mutant(seed, number);
            let began = Instant::now();
            match panic::catch_unwind(|| read(name, &bytes)) {
                Ok(is_read) => n_read += u64::from(is_read),
                Err(_) => {
                    n_crashes += 1;
                    println!("{name}: mutant {number} panics");
                    std::fs::write(format!("crash-{number}-{name}"), &bytes).expect("the folder can be written to");
                }
            }
            let took_s = began.elapsed().as_secs_f64();
            if took_s > slowest_s.0 {
                slowest_s = (took_s, number);
            }
        }
        let per_s = n_mutants as f64 / start.elapsed().as_secs_f64();
        println!(
            "{name}: {n_mutants} mutants, {n_crashes} panics, {n_read} read, {per_s:.0}/s, slowest {:.3} s (mutant {})",
            slowest_s.0, slowest_s.1
        );
    }
}
