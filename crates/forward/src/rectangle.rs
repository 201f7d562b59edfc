//! Rectangles of pixels.

/// A rectangle of pixels: of a film, beyond which it may reach, or about the one that a kernel has its reference point in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Rectangle {
    pub(crate) first_row: i64,
    pub(crate) first_column: i64,
    pub(crate) rows: usize,
    pub(crate) columns: usize,
}

impl Rectangle {
    /// One pixel, the first of all.
    pub(crate) const PIXEL: Self = Self { first_row: 0, first_column: 0, rows: 1, columns: 1 };

    /// The number of pixels.
    pub(crate) fn len(&self) -> usize {
        self.rows * self.columns
    }

    /// Rows and columns of the pixels after the last ones.
    fn end(&self) -> (i64, i64) {
        (self.first_row + self.rows as i64, self.first_column + self.columns as i64)
    }

    /// Whether it has a pixel.
    pub(crate) fn has(&self, (row, column): (i64, i64)) -> bool {
        let (end_row, end_column) = self.end();
        (self.first_row..end_row).contains(&row) && (self.first_column..end_column).contains(&column)
    }

    /// Returns it with a margin all around.
    pub(crate) fn grown(&self, margin: usize) -> Self {
        Self {
            first_row: self.first_row - margin as i64,
            first_column: self.first_column - margin as i64,
            rows: self.rows + 2 * margin,
            columns: self.columns + 2 * margin,
        }
    }

    /// Returns what it and another have in common, or `None`.
    pub(crate) fn intersection(&self, other: &Self) -> Option<Self> {
        let common = |(first, n): (i64, usize), (other, m): (i64, usize)| {
            let (start, end) = (first.max(other), (first + n as i64).min(other + m as i64));
            (end > start).then(|| (start, (end - start) as usize))
        };
        let (first_row, rows) = common((self.first_row, self.rows), (other.first_row, other.rows))?;
        let (first_column, columns) = common((self.first_column, self.columns), (other.first_column, other.columns))?;
        Some(Self { first_row, first_column, rows, columns })
    }

    /// Returns the rectangle around both.
    pub(crate) fn united(&self, other: &Self) -> Self {
        let (first_row, first_column) =
            (self.first_row.min(other.first_row), self.first_column.min(other.first_column));
        let ((end_row, end_column), (other_row, other_column)) = (self.end(), other.end());
        let rows = (end_row.max(other_row) - first_row) as usize;
        Self { first_row, first_column, rows, columns: (end_column.max(other_column) - first_column) as usize }
    }

    /// Returns the rectangle around all of these, if there are any.
    pub(crate) fn around(rectangles: impl Iterator<Item = Self>) -> Option<Self> {
        rectangles.reduce(|all, next| all.united(&next))
    }

    /// Returns the samples that its own gather from, by a kernel that lies in a window: of the sample x those at x − d, for d in the window.
    pub(crate) fn seen_through(&self, window: &Self) -> Self {
        Self {
            first_row: self.first_row - (window.first_row + window.rows as i64 - 1),
            first_column: self.first_column - (window.first_column + window.columns as i64 - 1),
            rows: self.rows + window.rows - 1,
            columns: self.columns + window.columns - 1,
        }
    }

    /// Returns the number of its first pixel among those of another around it, row by row.
    pub(crate) fn offset_in(&self, outer: &Self) -> usize {
        let (down, across) = (self.first_row - outer.first_row, self.first_column - outer.first_column);
        down as usize * outer.columns + across as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_seen_through_windows() {
        let window = Rectangle { first_row: -1, first_column: 2, rows: 4, columns: 3 };
        let pixel = Rectangle { first_row: 10, first_column: 20, rows: 1, columns: 1 };
        let seen = Rectangle { first_row: 8, first_column: 16, rows: 4, columns: 3 };
        assert_eq!(pixel.seen_through(&window), seen);
        assert_eq!(Rectangle { rows: 3, ..pixel }.seen_through(&window).rows, 6);
        assert_eq!((pixel.united(&seen).rows, seen.len()), (4, 12));
        assert_eq!(pixel.united(&pixel.grown(2)), pixel.grown(2));
        assert_eq!(pixel.offset_in(&pixel.grown(2)), 12);
    }
}
