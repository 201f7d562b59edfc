//! The allocator of a run.

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
