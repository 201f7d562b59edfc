//! How much memory a run may take.

use std::fs;

use dioptric_pipeline::parse_bytes;

/// The share of the machine's memory that a run takes where nothing else is asked for: one in so many.
const SHARE: u64 = 2;

/// Returns the bytes that were asked for, or a share of the machine's; `None` where nothing tells how much it has.
pub(crate) fn memory_budget(asked: Option<&str>) -> anyhow::Result<Option<u64>> {
    match asked {
        Some(text) => Ok(Some(parse_bytes(text)?)),
        None => Ok(fs::read_to_string("/proc/meminfo").ok().as_deref().and_then(total_bytes).map(|all| all / SHARE)),
    }
}

/// Gives memory that was freed back to the system where the allocator would keep it: kernels of a lens are many small pieces, and one of them
/// that stays holds megabytes of freed ones.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
pub(crate) fn give_back_freed() {
    #[expect(unsafe_code, reason = "a function of the C library without a safe form")]
    unsafe extern "C" {
        safe fn malloc_trim(pad: usize) -> std::ffi::c_int;
    }
    // Whether anything was given back.
    let _ = malloc_trim(0);
}

/// What of the memory that was freed the C library keeps for what is asked for next.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
struct Kept {
    /// Pieces up to this are kept, bytes; at most half of what an arena holds, 32 MiB.
    largest: std::ffi::c_int,
    /// So much of the free end of an arena, bytes.
    at_end: std::ffi::c_int,
    /// So much more than it needs is asked of the system, bytes.
    more: std::ffi::c_int,
}

#[cfg(all(target_os = "linux", target_env = "gnu"))]
impl Kept {
    /// Planes of a film and blocks of transforms come and go by the hundred, and each page that is new to a process costs as much as all that is done on it.
    const MUCH: Self = Self { largest: 32 << 20, at_end: 256 << 20, more: 16 << 20 };
    /// The least of the C library, whatever was freed before.
    const LITTLE: Self = Self { largest: 128 << 10, at_end: 128 << 10, more: 128 << 10 };

    fn apply(&self) {
        #[expect(unsafe_code, reason = "a function of the C library without a safe form")]
        unsafe extern "C" {
            safe fn mallopt(parameter: std::ffi::c_int, value: std::ffi::c_int) -> std::ffi::c_int;
        }
        /// `M_TRIM_THRESHOLD`, `M_TOP_PAD` and `M_MMAP_THRESHOLD` of malloc.h.
        const PARAMETERS: [std::ffi::c_int; 3] = [-1, -2, -3];
        for (parameter, value) in PARAMETERS.into_iter().zip([self.at_end, self.more, self.largest]) {
            // Whether it was obeyed.
            let _ = mallopt(parameter, value);
        }
    }
}

/// Keeps what is freed for what is asked for next.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
pub(crate) fn keep_freed() {
    Kept::MUCH.apply();
}

/// Lets what is larger than 128 KiB be given back as soon as it is freed.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
pub(crate) fn give_back_at_once() {
    Kept::LITTLE.apply();
}

/// Other allocators keep what they see fit.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(crate) fn keep_freed() {}

/// Other allocators give back what they see fit.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(crate) fn give_back_at_once() {}

/// Other allocators give back what they see fit.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(crate) fn give_back_freed() {}

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
        assert_eq!(memory_budget(Some("1GiB")).unwrap(), Some(1 << 30));
        assert!(memory_budget(Some("much")).is_err());
    }
}
