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

    /// Returns the part within a film, or `None` if there is none.
    pub(crate) fn clipped(&self, film_rows: usize, film_columns: usize) -> Option<Self> {
        self.intersection(&Self { first_row: 0, first_column: 0, rows: film_rows, columns: film_columns })
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

    /// Returns what light from its pixels reaches that is spread over a kernel's.
    pub(crate) fn spread_over(&self, kernel: &Self) -> Self {
        Self {
            first_row: self.first_row + kernel.first_row,
            first_column: self.first_column + kernel.first_column,
            rows: self.rows + kernel.rows - 1,
            columns: self.columns + kernel.columns - 1,
        }
    }

    /// Returns the part from which light reaches a film that is spread over a kernel's pixels, or `None` if there is none.
    pub(crate) fn in_reach_of(&self, film_rows: usize, film_columns: usize, kernel: &Self) -> Option<Self> {
        let (end_row, end_column) = kernel.end();
        let (rows, columns) = (film_rows + kernel.rows - 1, film_columns + kernel.columns - 1);
        self.intersection(&Self { first_row: 1 - end_row, first_column: 1 - end_column, rows, columns })
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
    fn rectangles_are_spread_and_found_again() {
        let kernel = Rectangle { first_row: -1, first_column: -2, rows: 4, columns: 3 };
        let pixel = Rectangle { first_row: 10, first_column: 20, rows: 1, columns: 1 };
        let spread = Rectangle { first_row: 9, first_column: 18, rows: 4, columns: 3 };
        assert_eq!(pixel.spread_over(&kernel), spread);
        assert_eq!((pixel.offset_in(&spread), spread.len()), (5, 12));
        assert_eq!(Rectangle::around([pixel, spread].into_iter()), Some(spread));
        assert_eq!(pixel.united(&pixel.grown(2)), pixel.grown(2));
    }

    /// Each pixel of a part is within reach where the pixels that its light is spread over are on the film.
    #[test]
    fn light_comes_from_pixels_within_reach() {
        let kernel = Rectangle { first_row: -1, first_column: 1, rows: 4, columns: 3 };
        let around = Rectangle { first_row: -9, first_column: -9, rows: 30, columns: 30 };
        let reaching = around.in_reach_of(8, 6, &kernel).unwrap();
        for row in -9..21 {
            for column in -9..21 {
                let pixel = Rectangle { first_row: row, first_column: column, ..Rectangle::PIXEL };
                let reaches = pixel.spread_over(&kernel).clipped(8, 6).is_some();
                assert_eq!(pixel.intersection(&reaching).is_some(), reaches, "{row}, {column}");
            }
        }
    }
}
