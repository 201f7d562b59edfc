//! Connected regions of a mask.

use ndarray::Array2;

/// A connected region.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Region {
    /// Its pixels: row and column.
    pub(crate) pixels: Vec<(usize, usize)>,
}

impl Region {
    /// Returns the mean row and column.
    pub(crate) fn center(&self) -> (f64, f64) {
        let n = self.pixels.len() as f64;
        let sum = self.pixels.iter().fold((0.0, 0.0), |s, p| (s.0 + p.0 as f64, s.1 + p.1 as f64));
        (sum.0 / n, sum.1 / n)
    }

    /// Returns the height and width of the smallest upright rectangle about it.
    pub(crate) fn extent(&self) -> (usize, usize) {
        let span = |of: fn(&(usize, usize)) -> usize| {
            let (low, high) = self.pixels.iter().map(of).fold((usize::MAX, 0), |(l, h), v| (l.min(v), h.max(v)));
            high + 1 - low
        };
        (span(|p| p.0), span(|p| p.1))
    }
}

/// Returns the regions of pixels that are set and touch, at corners too where asked, in the order of their first pixel.
pub(crate) fn regions(mask: &Array2<bool>, corners_touch: bool) -> Vec<Region> {
    let (rows, columns) = mask.dim();
    let mut is_new = mask.clone();
    let mut found = Vec::new();
    for (start, _) in mask.indexed_iter() {
        if !is_new[start] {
            continue;
        }
        is_new[start] = false;
        let (mut pixels, mut next) = (vec![start], 0);
        while next < pixels.len() {
            let (r, c) = pixels[next];
            next += 1;
            for (dr, dc) in [(-1, 0), (0, -1), (0, 1), (1, 0), (-1, -1), (-1, 1), (1, -1), (1, 1)] {
                if dr != 0 && dc != 0 && !corners_touch {
                    break;
                }
                let at = (r.wrapping_add_signed(dr), c.wrapping_add_signed(dc));
                if at.0 < rows && at.1 < columns && is_new[at] {
                    is_new[at] = false;
                    pixels.push(at);
                }
            }
        }
        found.push(Region { pixels });
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_touch_only_where_asked() {
        let rows = ["##...", "##..#", "..#..", "....#"];
        let mask = Array2::from_shape_fn((4, 5), |(r, c)| rows[r].as_bytes()[c] == b'#');
        let sizes = |corners| regions(&mask, corners).iter().map(|region| region.pixels.len()).collect::<Vec<_>>();
        assert_eq!(sizes(false), [4, 1, 1, 1]);
        assert_eq!(sizes(true), [5, 1, 1]);
        let square = &regions(&mask, false)[0];
        assert_eq!((square.center(), square.extent()), ((0.5, 0.5), (2, 2)));
    }
}
