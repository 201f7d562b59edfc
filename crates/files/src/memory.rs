//! How much memory a file may take while it is read.
//!
//! One limit for the process, as there is one pool of threads: pictures, textures, frames and cubes of any command ask it before they
//! take memory. It changes no result: a file is read as it is, at fewer samples where its reader says so, or refused.

use std::{
    fs,
    sync::{
        LazyLock,
        atomic::{AtomicU64, Ordering},
    },
};

/// What was asked for, bytes; 0 where nothing was.
static ASKED: AtomicU64 = AtomicU64::new(0);

/// What the machine has, bytes.
static MACHINE: LazyLock<Option<u64>> =
    LazyLock::new(|| fs::read_to_string("/proc/meminfo").ok().as_deref().and_then(total_bytes));

/// Where nothing tells how much memory there is, bytes.
const UNKNOWN_BYTES: u64 = 4 << 30;

/// Where nothing is asked for, a file may take this much whatever its length, bytes, ...
const ALWAYS_BYTES: u64 = 3 << 28;

/// ... or this many times its length: pictures and cubes are compressed to a twentieth at best, files made to fill the memory of who opens
/// them a thousandfold.
const MOST_RATIO: u64 = 64;

/// What the program takes besides, bytes.
const PROGRAM_BYTES: u64 = 48 << 20;

/// Sets the memory that the process may take; `None` for half of the machine's.
pub fn allow(bytes: Option<u64>) {
    ASKED.store(bytes.unwrap_or(0), Ordering::Relaxed);
}

/// Returns the memory that the process may take, bytes: what was allowed, or half of the machine's; `None` where nothing tells how much it has.
pub fn allowed_bytes() -> Option<u64> {
    match ASKED.load(Ordering::Relaxed) {
        0 => MACHINE.map(|all| all / 2),
        asked => Some(asked),
    }
}

/// Returns what a file of this length may take while it is read, bytes.
pub fn file_bytes(length: u64) -> u64 {
    match ASKED.load(Ordering::Relaxed) {
        0 => allowed_bytes().unwrap_or(UNKNOWN_BYTES).min(ALWAYS_BYTES.max(length.saturating_mul(MOST_RATIO))),
        asked => asked.saturating_sub(PROGRAM_BYTES),
    }
}

/// More memory than a file may take.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "it would take {} of memory and may take {}: allow the program {} MiB or more (--memory, in Python memory=)",
    shown(*bytes),
    shown(*limit),
    bytes.saturating_add(PROGRAM_BYTES).div_ceil(1 << 20)
)]
pub struct TooLarge {
    /// What it would take, bytes.
    pub bytes: u64,
    /// What it may take, bytes.
    pub limit: u64,
}

/// Checks before a file of this length is read that what it takes is allowed.
///
/// # Errors
/// When it is not.
pub fn check(bytes: u64, length: u64) -> Result<(), TooLarge> {
    let limit = file_bytes(length);
    if bytes > limit { Err(TooLarge { bytes, limit }) } else { Ok(()) }
}

/// Returns an amount of memory as people read it.
pub fn shown(bytes: u64) -> String {
    const UNITS: [&str; 6] = ["bytes", "KiB", "MiB", "GiB", "TiB", "PiB"];
    let power = (bytes.max(1).ilog2() / 10).min(UNITS.len() as u32 - 1);
    let number = bytes as f64 / 1024_f64.powi(power as i32);
    if power == 0 { format!("{bytes} bytes") } else { format!("{number:.1} {}", UNITS[power as usize]) }
}

/// Returns the memory that Linux says the machine has.
fn total_bytes(meminfo: &str) -> Option<u64> {
    let line = meminfo.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kibibytes.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_of_the_machine_is_read() {
        assert_eq!(total_bytes("MemTotal:       16316412 kB\nMemFree: 1 kB\n"), Some(16_316_412 * 1024));
        assert_eq!(total_bytes("MemFree: 1 kB\n"), None);
    }

    #[test]
    fn amounts_are_shown_in_units() {
        assert_eq!(
            [1023, 1024, 3 << 29, 2_700_000_000].map(shown),
            ["1023 bytes", "1.0 KiB", "1.5 GiB", "2.5 GiB"].map(str::to_owned)
        );
    }

    /// One test, since the limit is one for all threads.
    #[test]
    fn what_was_asked_for_holds() {
        allow(Some(512 << 20));
        assert_eq!(allowed_bytes(), Some(512 << 20));
        let refused = check(500 << 20, 1 << 40).unwrap_err();
        assert_eq!(
            refused.to_string(),
            "it would take 500.0 MiB of memory and may take 464.0 MiB: allow the program 548 MiB or more (--memory, in \
             Python memory=)"
        );
        allow(None);
        // A small file gets little, a large one what the machine has to give.
        assert!(file_bytes(1000) <= ALWAYS_BYTES && file_bytes(1 << 40) == allowed_bytes().unwrap_or(UNKNOWN_BYTES));
        assert_eq!(check(1 << 60, 1000), Err(TooLarge { bytes: 1 << 60, limit: file_bytes(1000) }));
    }
}
