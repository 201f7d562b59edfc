//! Files changed at random: what a reader must survive.

use std::{ops::Range, panic, path::Path, time::Instant};

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Words that have broken readers of other programs.
const WORDS: [&str; 18] = [
    "0",
    "-1",
    "1e400",
    "-1e-400",
    "1e300",
    "NaN",
    "inf",
    "null",
    "true",
    "[]",
    "{}",
    "\"\"",
    "999999999999",
    "INFINITY",
    "é",
    "\n",
    "\r\n\t ",
    "0.5",
];

/// Returns the seed changed at random in one to eight places; the number selects one of all such files.
pub fn mutant(seed: &[u8], number: u64) -> Vec<u8> {
    let mut random = ChaCha8Rng::seed_from_u64(number);
    let mut bytes = seed.to_vec();
    for _ in 0..random.random_range(1..=8) {
        change(&mut bytes, &mut random);
    }
    match random.random_range(0..40) {
        0 => utf16(&bytes, u16::to_le_bytes),
        1 => utf16(&bytes, u16::to_be_bytes),
        _ => bytes,
    }
}

fn change(bytes: &mut Vec<u8>, random: &mut impl Rng) {
    let at = random.random_range(0..=bytes.len());
    let end = (at + random.random_range(0..=24)).min(bytes.len());
    match random.random_range(0..8) {
        0 if at < bytes.len() => bytes[at] = random.random(),
        1 if at < bytes.len() => bytes[at] ^= 1 << random.random_range(0..8),
        2 => bytes.insert(at, random.random()),
        3 => drop(bytes.drain(at..end)),
        4 => {
            let copy = bytes[at..end].to_vec();
            let to = random.random_range(0..=bytes.len());
            bytes.splice(to..to, copy);
        }
        5 | 6 => replace_word(bytes, at, random),
        _ => bytes.truncate(if random.random_range(0..8) == 0 { at } else { bytes.len() }),
    }
}

/// Puts one of the words in the place of the number or word at a place.
fn replace_word(bytes: &mut Vec<u8>, at: usize, random: &mut impl Rng) {
    let is_of_word = |byte: &u8| byte.is_ascii_alphanumeric() || b"+-._".contains(byte);
    let first = bytes[..at].iter().rposition(|byte| !is_of_word(byte)).map_or(0, |before| before + 1);
    let end = bytes[at..].iter().position(|byte| !is_of_word(byte)).map_or(bytes.len(), |after| at + after);
    let word = WORDS[random.random_range(0..WORDS.len())];
    bytes.splice(first..end, word.bytes());
}

fn utf16(bytes: &[u8], unit: fn(u16) -> [u8; 2]) -> Vec<u8> {
    let text = String::from_utf8_lossy(bytes);
    let marked = std::iter::once(0xFEFF).chain(text.encode_utf16());
    marked.flat_map(unit).collect()
}

/// Reads mutants of a seed, one after the other, and prints how many panicked, how many were read and which took longest.
///
/// `read` returns whether a mutant was still a file of its kind. The input of a panic is left in `crash-NUMBER-NAME`.
///
/// # Panics
/// When such a file cannot be written.
pub fn read_mutants(name: &str, seed: &[u8], numbers: Range<u64>, read: impl Fn(&[u8]) -> bool) {
    let n_mutants = numbers.end - numbers.start;
    let (start, mut slowest_s, mut n_read, mut n_panics) = (Instant::now(), (0.0_f64, 0), 0_u64, 0_u64);
    for number in numbers {
        let bytes = mutant(seed, number);
        let began = Instant::now();
        match panic::catch_unwind(panic::AssertUnwindSafe(|| read(&bytes))) {
            Ok(is_read) => n_read += u64::from(is_read),
            Err(_) => {
                n_panics += 1;
                println!("{name}: mutant {number} panics");
                let crash = format!("crash-{number}-{name}");
                std::fs::write(Path::new(&crash), &bytes).expect("the folder can be written to");
            }
        }
        let took_s = began.elapsed().as_secs_f64();
        if took_s > slowest_s.0 {
            slowest_s = (took_s, number);
        }
    }
    let per_s = n_mutants as f64 / start.elapsed().as_secs_f64();
    println!(
        "{name}: {n_mutants} mutants, {n_panics} panics, {n_read} read, {per_s:.0}/s, slowest {:.3} s (mutant {})",
        slowest_s.0, slowest_s.1
    );
}

/// The words of a command that reads mutants: `N [first] [part of a name]`; returns the numbers of the mutants and that part.
pub fn mutants_wanted() -> (Range<u64>, String) {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let number = |place: usize, otherwise: u64| words.get(place).map_or(otherwise, |word| word.parse().unwrap_or(0));
    let first = number(1, 0);
    (first..first + number(0, 1000), words.get(2).cloned().unwrap_or_default())
}
