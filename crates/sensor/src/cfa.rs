//! Which color filter lies on which pixel.

use serde::{Deserialize, Serialize};

use crate::SensorError;

/// The color filter array: which filter lies on which pixel.
///
/// In a data sheet `Mosaic([["R", "G"], ["G", "B"]])`; a monochrome sensor is `Mosaic([["Y"]])`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum Cfa {
    /// A tile of filter names, repeated from the top left pixel on.
    Mosaic(Vec<Vec<String>>),
    /// Every pixel has every filter, one layer over the other.
    Stacked,
}

impl Cfa {
    /// Returns the 2 × 2 mosaic of four one-letter filters, row by row: `"RGGB"`, `"GBRG"`, `"RYYB"`, `"RCCC"`.
    ///
    /// # Errors
    /// When there are not four letters.
    pub fn two_by_two(letters: &str) -> Result<Self, SensorError> {
        let names: Vec<String> = letters.chars().map(String::from).collect();
        match names.len() {
            4 => Ok(Self::Mosaic(names.chunks(2).map(<[String]>::to_vec).collect())),
            n => Err(SensorError::Shape {
                what: "letters of a 2 × 2 mosaic",
                expected: "4".into(),
                found: n.to_string(),
            }),
        }
    }

    /// Returns the mosaic with every filter repeated on `n` × `n` pixels, as in a quad-Bayer array.
    #[must_use]
    pub fn repeated(&self, n: usize) -> Self {
        let spread = |row: &Vec<String>| row.iter().flat_map(|name| std::iter::repeat_n(name.clone(), n)).collect();
        match self {
            Self::Mosaic(tile) => {
                Self::Mosaic(tile.iter().flat_map(|row| std::iter::repeat_n(spread(row), n)).collect())
            }
            Self::Stacked => Self::Stacked,
        }
    }

    /// Returns the mosaic as it is from a row and column on: that of a part of the pixels.
    #[must_use]
    pub fn from_pixel(&self, row: usize, column: usize) -> Self {
        let Self::Mosaic(tile) = self else { return Self::Stacked };
        let mut rows = tile.clone();
        if !rows.is_empty() {
            let n_rows = rows.len();
            rows.rotate_left(row % n_rows);
        }
        for names in rows.iter_mut().filter(|names| !names.is_empty()) {
            let n_columns = names.len();
            names.rotate_left(column % n_columns);
        }
        Self::Mosaic(rows)
    }

    /// Returns the tile as places in a list of filters, or `None` where every pixel has them all.
    ///
    /// # Errors
    /// When the tile is empty or ragged, or names an unknown filter.
    pub(crate) fn resolve(&self, owner: &str, filters: &[&str]) -> Result<Option<Tile>, SensorError> {
        let wrong = |reason| SensorError::Cfa { owner: owner.to_owned(), reason };
        let Self::Mosaic(rows) = self else { return Ok(None) };
        let columns = rows.first().map_or(0, Vec::len);
        if columns == 0 {
            return Err(wrong("the tile is empty, expected at least one filter name".to_owned()));
        }
        let mut places = Vec::with_capacity(rows.len() * columns);
        for (number, row) in rows.iter().enumerate() {
            if row.len() != columns {
                return Err(wrong(format!("row {number} has {} filters, expected {columns}", row.len())));
            }
            for name in row {
                let place = filters.iter().position(|f| f == name);
                places.push(place.ok_or_else(|| {
                    wrong(format!("'{name}' is not among the filters, expected one of {}", filters.join(", ")))
                })?);
            }
        }
        Ok(Some(Tile { rows: rows.len(), columns, filters: places }))
    }
}

/// A mosaic's tile as places in the sensor's list of filters.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tile {
    // Invariant: rows × columns filters, at least one.
    rows: usize,
    columns: usize,
    filters: Vec<usize>,
}

impl Tile {
    /// Returns the tile of one filter.
    pub fn single(filter: usize) -> Self {
        Self { rows: 1, columns: 1, filters: vec![filter] }
    }

    /// The rows after which the tile repeats.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The columns after which the tile repeats.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Returns the filter on a pixel.
    #[inline]
    pub fn filter_at(&self, row: usize, column: usize) -> usize {
        self.filters[(row % self.rows) * self.columns + column % self.columns]
    }

    /// Returns the filters of a row of pixels, one period of it.
    pub fn row(&self, row: usize) -> &[usize] {
        let start = (row % self.rows) * self.columns;
        &self.filters[start..start + self.columns]
    }

    /// Returns the tile with other numbers for its filters.
    pub(crate) fn renumbered(&self, number: impl Fn(usize) -> usize) -> Self {
        Self { filters: self.filters.iter().map(|&filter| number(filter)).collect(), ..self.clone() }
    }

    /// Returns the number of filters that are needed to describe the tile: one more than the last in use.
    pub fn n_filters(&self) -> usize {
        self.filters.iter().max().map_or(0, |last| last + 1)
    }

    /// Returns where the quincunx filter of a Bayer-like tile lies, or `None` for any other tile.
    pub fn bayer(&self) -> Option<Bayer> {
        if (self.rows, self.columns) != (2, 2) {
            return None;
        }
        let f = |row, column| self.filter_at(row, column);
        let (row, first) = if f(0, 0) == f(1, 1) { (0, (f(0, 1), f(1, 0))) } else { (1, (f(0, 0), f(1, 1))) };
        let green = if row == 0 { f(0, 0) } else { f(0, 1) };
        let is_quincunx = if row == 0 { true } else { f(0, 1) == f(1, 0) };
        let all_differ = first.0 != green && first.1 != green && first.0 != first.1;
        (is_quincunx && all_differ).then_some(Bayer {
            green,
            in_even_rows: first.0,
            in_odd_rows: first.1,
            green_first: row == 0,
        })
    }
}

/// A Bayer-like tile: one filter on every second pixel like the black squares of a chess board, and two others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bayer {
    /// The filter on every second pixel.
    pub green: usize,
    /// The other filter of rows 0, 2, 4 ….
    pub in_even_rows: usize,
    /// The other filter of rows 1, 3, 5 ….
    pub in_odd_rows: usize,
    /// Whether `green` lies on row 0, column 0.
    pub green_first: bool,
}

impl Bayer {
    /// Returns whether the quincunx filter lies on a pixel.
    #[inline]
    pub fn is_green(self, row: usize, column: usize) -> bool {
        (row + column).is_multiple_of(2) == self.green_first
    }

    /// Returns the other filter of a row.
    #[inline]
    pub fn other_of_row(self, row: usize) -> usize {
        if row.is_multiple_of(2) { self.in_even_rows } else { self.in_odd_rows }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tile(letters: &str) -> Tile {
        Cfa::two_by_two(letters).unwrap().resolve("test", &["R", "G", "B", "C"]).unwrap().unwrap()
    }

    #[test]
    fn all_four_phases_are_bayer() {
        for (letters, even, odd, green_first) in
            [("RGGB", 0, 2, false), ("BGGR", 2, 0, false), ("GRBG", 0, 2, true), ("GBRG", 2, 0, true)]
        {
            let bayer = tile(letters).bayer().unwrap();
            assert_eq!(bayer, Bayer { green: 1, in_even_rows: even, in_odd_rows: odd, green_first }, "{letters}");
            for (row, column) in [(0, 0), (0, 1), (1, 0), (3, 2)] {
                assert_eq!(bayer.is_green(row, column), tile(letters).filter_at(row, column) == 1, "{letters}");
            }
        }
    }

    #[test]
    fn a_tile_needs_filters_up_to_its_last() {
        // Red, green and blue of red, green, blue and clear; a single clear one.
        assert_eq!((tile("RGGB").n_filters(), tile("RCCC").n_filters(), tile("RRRR").n_filters()), (3, 4, 1));
        assert_eq!((Tile::single(0).n_filters(), Tile::single(3).n_filters()), (1, 4));
    }

    #[test]
    fn others_are_not_bayer() {
        assert_eq!(tile("RCCC").bayer(), None);
        assert_eq!(tile("RRGB").bayer(), None);
        let quad = Cfa::two_by_two("RGGB").unwrap().repeated(2);
        let quad = quad.resolve("test", &["R", "G", "B"]).unwrap().unwrap();
        assert_eq!((quad.rows(), quad.columns(), quad.bayer()), (4, 4, None));
        assert_eq!((quad.filter_at(1, 1), quad.filter_at(1, 2), quad.filter_at(2, 2)), (0, 1, 2));
    }

    #[test]
    fn a_part_of_the_pixels_has_its_part_of_the_mosaic() {
        let bayer = Cfa::two_by_two("RGGB").unwrap();
        for (row, column, letters) in [(0, 1, "GRBG"), (1, 0, "GBRG"), (1, 1, "BGGR"), (2, 4, "RGGB")] {
            assert_eq!(bayer.from_pixel(row, column), Cfa::two_by_two(letters).unwrap());
        }
        let quad = bayer.repeated(2);
        let tile = |cfa: &Cfa| cfa.resolve("test", &["R", "G", "B"]).unwrap().unwrap();
        let (whole, part) = (tile(&quad), tile(&quad.from_pixel(3, 5)));
        for (row, column) in (0..4).flat_map(|row| (0..4).map(move |column| (row, column))) {
            assert_eq!(part.filter_at(row, column), whole.filter_at(row + 3, column + 5));
        }
        assert_eq!(
            (Cfa::Stacked.from_pixel(1, 1), Cfa::Mosaic(vec![]).from_pixel(1, 1)),
            (Cfa::Stacked, Cfa::Mosaic(vec![]))
        );
    }

    #[test]
    fn a_wrong_tile_says_what_is_wrong() {
        let names = |rows: &[&[&str]]| {
            Cfa::Mosaic(rows.iter().map(|row| row.iter().map(|&name| name.to_owned()).collect()).collect())
        };
        let error = |cfa: Cfa| cfa.resolve("s", &["R", "G"]).unwrap_err().to_string();
        assert!(error(names(&[&["R", "X"]])).contains("'X'"));
        assert!(error(names(&[&["R", "G"], &["R"]])).contains("row 1 has 1"));
        assert!(error(names(&[])).contains("empty"));
        assert!(Cfa::two_by_two("RGB").is_err());
    }
}
