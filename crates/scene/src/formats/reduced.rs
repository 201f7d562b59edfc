//! Files with more samples than the film needs, read as means over blocks of them.

use std::path::Path;

use dioptric_files::memory;

use super::{depth::files_beside, read_options::ReadOptions, reading::Panorama, stated::name_of};

/// How many times coarser than [`ReadOptions::finest_tangent`] says samples may be where the memory allows no more: one a pixel.
const COARSEST: f64 = 8.0;
/// Bytes that a reader may leave free for what follows, as a share of what the program may take.
const SHARE: u64 = 8;

/// The rows and columns as which a file is read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Reduced {
    pub(super) rows: usize,
    pub(super) columns: usize,
    /// Says so.
    pub(super) note: String,
}

/// Returns the rows and columns as which a file of so many samples is read, where they are fewer than its own: where the options allow
/// that and nothing lies beside it that counts its samples.
pub(super) fn reduced_size(
    path: &Path,
    options: &ReadOptions,
    (rows, columns): (usize, usize),
    bytes_a_sample: u64,
) -> Option<Reduced> {
    let (Some(finest), Some(fov_deg)) = (options.finest_tangent, options.horizontal_fov_deg) else { return None };
    if options.reading.depth.is_some() || !files_beside(path).is_empty() {
        return None;
    }
    let own = match options.reading.panorama {
        None => 2.0 * (0.5 * fov_deg.to_radians()).tan() / columns as f64,
        Some(Panorama::Equirectangular { .. }) => std::f64::consts::TAU / columns as f64,
        // Faces keep their places only whole.
        Some(Panorama::Cube { .. }) => return None,
    };
    let most = rows.min(columns);
    // Whole numbers of samples, of which some blocks may have one more.
    let finer = ((finest / own) as usize).clamp(1, most);
    let coarsest = ((COARSEST * finest / own) as usize).clamp(1, most);
    let takes = |block: usize| ((rows / block) as u64 * (columns / block) as u64).saturating_mul(bytes_a_sample);
    let allowed = memory::file_bytes(u64::MAX) / SHARE;
    let block = (finer..=coarsest.max(finer)).find(|block| takes(*block) <= allowed).unwrap_or(coarsest.max(finer));
    let why = match (block > finer, COARSEST * finest / own / block as f64) {
        (false, _) => "finer than those of the film by far".to_owned(),
        (true, a_pixel) => format!("{a_pixel:.1} a pixel of the film, as the memory allows: --memory says how much"),
    };
    let (name, (new_rows, new_columns)) = (name_of(path), (rows / block, columns / block));
    let note = format!("{name}: its {columns} × {rows} samples are read as {new_columns} × {new_rows} means, {why}");
    (block >= 2).then_some(Reduced { rows: new_rows, columns: new_columns, note })
}

/// Returns the block in which a sample lies, `n` of which are made of `own` samples.
pub(super) fn block_of(sample: usize, n: usize, own: usize) -> usize {
    sample * n / own
}

/// Returns the first sample of a block.
pub(super) fn start_of(block: usize, n: usize, own: usize) -> usize {
    (block * own).div_ceil(n)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_share_out_all_samples() {
        for (n, own) in [(1, 1), (3, 7), (5, 5), (7, 20), (1875, 3750), (16, 33)] {
            let mut counts = vec![0; n];
            (0..own).for_each(|sample| counts[block_of(sample, n, own)] += 1);
            for (block, count) in counts.iter().enumerate() {
                assert_eq!(*count, start_of(block + 1, n, own) - start_of(block, n, own), "{block} of {n} in {own}");
                assert!((own / n..=own.div_ceil(n)).contains(count));
            }
        }
    }
}
