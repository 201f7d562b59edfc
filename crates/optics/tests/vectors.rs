//! The guard that the kernel is vector code: reads the machine code of this very test program.
//!
//! Instructions are counted, not timed, so a loaded machine changes nothing. The compiler turns the kernel's loops into
//! vectors by itself; a change that makes it stop costs a factor of four and nothing else would tell.
#![cfg(all(target_arch = "x86_64", target_os = "linux"))]

use std::hint::black_box;

use dioptric_optics::{Lens, RayBatch, RayBatchF32, Vignetting};
use iced_x86::{Decoder, DecoderOptions, Instruction, Mnemonic as M};
use multiversion::multiversion;
use object::{Object, ObjectSection, ObjectSymbol};

/// Kinds of surfaces whose rays are crossed one after another: those with two curvatures, and aspheres of more terms
/// than any file's.
const KINDS_RAY_BY_RAY: usize = 2;
/// The other kinds of `trace::plan::Form`.
const KINDS_IN_VECTORS: usize = 9;
/// Double and single precision.
const PRECISIONS: usize = 2;

/// Float arithmetic in a piece of machine code.
#[derive(Clone, Copy, Debug, Default)]
struct Arithmetic {
    /// Instructions on whole vectors of 256 or 512 bits.
    in_vectors: usize,
    /// Instructions on single numbers, or on narrower vectors.
    by_pieces: usize,
}

impl Arithmetic {
    /// A single scalar instruction may stand before the loop, for a constant of the surface.
    fn is_vector_code(self) -> bool {
        self.in_vectors > 0 && self.by_pieces <= 1
    }

    fn count(&mut self, instruction: &Instruction) {
        match instruction.mnemonic() {
            M::Vaddpd | M::Vsubpd | M::Vmulpd | M::Vdivpd | M::Vsqrtpd if is_wide(instruction) => self.in_vectors += 1,
            M::Vaddps | M::Vsubps | M::Vmulps | M::Vdivps | M::Vsqrtps if is_wide(instruction) => self.in_vectors += 1,
            M::Vaddpd | M::Vsubpd | M::Vmulpd | M::Vdivpd | M::Vsqrtpd => self.by_pieces += 1,
            M::Vaddps | M::Vsubps | M::Vmulps | M::Vdivps | M::Vsqrtps => self.by_pieces += 1,
            M::Vaddsd | M::Vsubsd | M::Vmulsd | M::Vdivsd | M::Vsqrtsd => self.by_pieces += 1,
            M::Vaddss | M::Vsubss | M::Vmulss | M::Vdivss | M::Vsqrtss => self.by_pieces += 1,
            _ => {}
        }
    }
}

fn is_wide(instruction: &Instruction) -> bool {
    let register = instruction.op0_register();
    register.is_ymm() || register.is_zmm()
}

/// Whether an instruction rounds once where the others round twice, which would give other bits.
fn is_fused(instruction: &Instruction) -> bool {
    format!("{:?}", instruction.mnemonic()).starts_with("Vfm")
        || format!("{:?}", instruction.mnemonic()).starts_with("Vfnm")
}

/// Counts the arithmetic of each function of this program whose path has this part, up to the features that it is compiled for.
fn arithmetic_of(path: &str) -> Vec<Arithmetic> {
    let program =
        std::fs::read(std::env::current_exe().expect("the program has a path")).expect("the program can be read");
    let file = object::File::parse(&*program).expect("the program is ELF");
    let is_it = |name: &str| {
        let name = format!("{:#}", rustc_demangle::demangle(name));
        name.contains(path) && name.ends_with("_version")
    };
    let count = |symbol: object::Symbol<'_, '_>| {
        let section = file.section_by_index(symbol.section_index()?).ok()?;
        let code = section.data_range(symbol.address(), symbol.size()).ok()??;
        let mut found = Arithmetic::default();
        for instruction in &mut Decoder::with_ip(64, code, symbol.address(), DecoderOptions::NONE) {
            assert!(!is_fused(&instruction), "{path}: {:?}", instruction.mnemonic());
            found.count(&instruction);
        }
        Some(found)
    };
    let found = file.symbols().filter(|symbol| symbol.name().is_ok_and(is_it)).filter_map(count).collect();
    // So that the linker keeps the kernel.
    let lens = Lens::built_in("dgauss-50mm").and_then(|lens| lens.at(550.0)).expect("the lens is built in");
    let mut rays = black_box(RayBatch::default());
    lens.trace_to_film(&mut rays, Vignetting::On, 36.0);
    lens.trace_to_film_f32(&mut RayBatchF32::from(&rays), Vignetting::On, 36.0);
    found
}

#[test]
fn every_kind_of_surface_is_vector_code() {
    for copy in ["kernel::pass_blocks::pass_blocks_avx2_", "kernel::pass_blocks::pass_blocks_avx512"] {
        let found = arithmetic_of(copy);
        assert_eq!(found.len(), PRECISIONS * (KINDS_IN_VECTORS + KINDS_RAY_BY_RAY), "{copy}: {found:#?}");
        let n_vector = found.iter().filter(|arithmetic| arithmetic.is_vector_code()).count();
        assert_eq!(n_vector, PRECISIONS * KINDS_IN_VECTORS, "{copy}: {found:#?}");
    }
}

#[test]
fn way_to_the_lens_and_to_the_film_is_vector_code() {
    for copy in ["avx2_", "avx512"] {
        for way in ["kernel::to_plane::to_plane", "kernel::approach::approach"] {
            let found = arithmetic_of(&format!("{way}_{copy}"));
            let are_vectors = found.iter().all(|arithmetic| arithmetic.is_vector_code());
            assert!(found.len() == PRECISIONS && are_vectors, "{way} {copy}: {found:?}");
        }
    }
}

/// Each number waits for the one before, so that no compiler makes vectors of them.
#[multiversion(targets("x86_64+avx2"), dispatcher = "direct")]
fn one_after_another(numbers: &mut [f64]) {
    let mut last = 1.0;
    for number in numbers {
        last = (*number / last + 1.0).sqrt();
        *number = last;
    }
}

/// The same without waiting.
#[multiversion(targets("x86_64+avx2"), dispatcher = "direct")]
fn side_by_side(numbers: &mut [f64; 64]) {
    for number in numbers {
        *number = (3.0 / *number + 1.0).sqrt();
    }
}

#[test]
fn guard_tells_vectors_from_single_numbers() {
    one_after_another(black_box(&mut [1.0, 2.0, 3.0]));
    side_by_side(black_box(&mut [1.0; 64]));
    let scalar = arithmetic_of("one_after_another_avx2_");
    assert!(scalar.len() == 1 && !scalar[0].is_vector_code(), "{scalar:?}");
    let vector = arithmetic_of("side_by_side_avx2_");
    assert!(vector.len() == 1 && vector[0].is_vector_code(), "{vector:?}");
    assert!(arithmetic_of("no_such_function").is_empty());
}
