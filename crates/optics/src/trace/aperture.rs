//! Apertures that are no round rims, for blocks of rays: after the kernel, and only where there are any.

use super::{
    block::{Block, LANES},
    real::Real,
};
use crate::Aperture;

/// Ends the rays of blocks on a surface that its apertures stop, and returns whether there was one.
pub(super) fn clip<T: Real>(apertures: &[Aperture], blocks: &mut [Block<T>]) -> bool {
    let mut is_any_ended = false;
    for block in blocks {
        for lane in 0..LANES {
            let (x, y) = (block.x[lane].to_f64(), block.y[lane].to_f64());
            if block.alive[lane] != T::NO && !apertures.iter().all(|aperture| aperture.is_clear_at(x, y)) {
                block.alive[lane] = T::NO;
                is_any_ended = true;
            }
        }
    }
    is_any_ended
}

/// Keeps for each ray the least so far of its clearance from the edges of openings.
pub(super) fn keep_clearance(apertures: &[Aperture], blocks: &[Block<f64>], least: &mut [f64]) {
    for (block, least) in blocks.iter().zip(least.chunks_mut(LANES)) {
        for (lane, least) in least.iter_mut().enumerate() {
            for aperture in apertures {
                *least = least.min(aperture.clearance_mm(block.x[lane], block.y[lane]));
            }
        }
    }
}
