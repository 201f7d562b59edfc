//! Differences that deflated samples are stored as (TIFF 6.0, section 14; Adobe's TIFF technical note 3; DNG 1.4, `Predictor`).

/// How a row of samples is stored, each from one so many samples before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Predictor {
    /// As they are.
    None,
    /// The difference of whole numbers from that of the same plane this many pixels before.
    Whole(usize),
    /// Bytes of floats parted by their weight, and the difference of each byte from that this many pixels before.
    Float(usize),
}

impl Predictor {
    /// Returns that of a number.
    ///
    /// # Errors
    /// When there is no such, or it is not for such samples.
    pub(super) fn of(number: usize, is_float: bool) -> Result<Self, String> {
        Ok(match (number, is_float) {
            (1, _) => Self::None,
            (2, false) => Self::Whole(1),
            (34_892, false) => Self::Whole(2),
            (34_893, false) => Self::Whole(4),
            (3, true) => Self::Float(1),
            (34_894, true) => Self::Float(2),
            (34_895, true) => Self::Float(4),
            _ => {
                let kind = if is_float { "floats" } else { "whole numbers" };
                return Err(format!("has predictor {number} of deflated {kind}, which is not read"));
            }
        })
    }

    /// Turns a row of differences into samples of so many bytes in the order of the file, `n_planes` side by side.
    pub(super) fn undo(self, row: &mut [u8], n_bytes: usize, n_planes: usize, is_big_endian: bool) {
        match self {
            Self::None => {}
            Self::Whole(pixels) => {
                let back = pixels * n_planes * n_bytes;
                // The place of a byte of a weight, 0 the lowest.
                let place = |weight: usize| if is_big_endian { n_bytes - 1 - weight } else { weight };
                for sample in (back..row.len()).step_by(n_bytes) {
                    let mut carry = 0;
                    for at in (0..n_bytes).map(place) {
                        let sum = u16::from(row[sample + at]) + u16::from(row[sample + at - back]) + carry;
                        row[sample + at] = sum as u8;
                        carry = sum >> 8;
                    }
                }
            }
            Self::Float(pixels) => {
                let back = pixels * n_planes;
                for at in back..row.len() {
                    row[at] = row[at].wrapping_add(row[at - back]);
                }
                let n = row.len() / n_bytes;
                let parted = row.to_vec();
                for (sample, bytes) in row.chunks_exact_mut(n_bytes).enumerate() {
                    for (weight, byte) in bytes.iter_mut().enumerate() {
                        // The highest bytes of all come first.
                        let from = if is_big_endian { weight } else { n_bytes - 1 - weight };
                        *byte = parted[from * n + sample];
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_summed_over_all_bytes() {
        // 250, 260, 255 and 300 of 16 bits, each less the one before.
        for is_big_endian in [false, true] {
            let bytes = |v: i32| {
                let v = v as u16;
                if is_big_endian { v.to_be_bytes() } else { v.to_le_bytes() }
            };
            let mut row: Vec<u8> = [250, 10, -5, 45].into_iter().flat_map(bytes).collect();
            Predictor::Whole(1).undo(&mut row, 2, 1, is_big_endian);
            let wanted: Vec<u8> = [250, 260, 255, 300].into_iter().flat_map(bytes).collect();
            assert_eq!(row, wanted);
        }
    }

    #[test]
    fn floats_are_put_together_from_their_parted_bytes() {
        let values = [0.25_f32, 0.5, 1.0, -3.75];
        // Highest bytes first, then differences.
        let mut row: Vec<u8> = (0..4).flat_map(|weight| values.iter().map(move |v| v.to_be_bytes()[weight])).collect();
        (1..row.len()).rev().for_each(|at| row[at] = row[at].wrapping_sub(row[at - 1]));
        Predictor::Float(1).undo(&mut row, 4, 1, false);
        let found: Vec<f32> = row.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        assert_eq!(found, values);
    }
}
