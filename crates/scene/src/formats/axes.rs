//! Arrays of three axes as planes of bands.

use ndarray::Array2;

use super::reading::axis_order;

/// Returns the planes of the bands of an array.
///
/// Its axes are in the order that is told, or rows, columns and bands; where the last axis has another length than there are bands and
/// the first has it, bands, rows and columns. An array of two axes is one band. `is_row_major` says that the last axis is the fastest,
/// else the first is.
pub(super) fn planes(
    sides: &[usize],
    told: Option<&str>,
    n_bands: Option<usize>,
    is_row_major: bool,
    at: impl Fn(usize) -> f32,
) -> Result<Vec<Array2<f32>>, String> {
    let shown = || sides.iter().map(ToString::to_string).collect::<Vec<_>>().join(" × ");
    let sides: [usize; 3] = match *sides {
        [rows, columns] => [rows, columns, 1],
        [a, b, c] => [a, b, c],
        _ => return Err(format!("it has the sides {}, expected rows, columns and bands", shown())),
    };
    let [y, x, b] = match told {
        Some(text) => axis_order(text).map_err(|error| error.to_string())?,
        None if n_bands == Some(sides[0]) && n_bands != Some(sides[2]) => [1, 2, 0],
        None => [0, 1, 2],
    };
    if let Some(n) = n_bands.filter(|n| *n != sides[b]) {
        return Err(format!("it is {}, which has not {n} bands: expected --axes, or as many wavelengths", shown()));
    }
    if sides.contains(&0) {
        return Err(format!("it is {}: it has no samples", shown()));
    }
    let strides = if is_row_major { [sides[1] * sides[2], sides[2], 1] } else { [1, sides[0], sides[0] * sides[1]] };
    let plane = |band: usize| {
        Array2::from_shape_fn((sides[y], sides[x]), |(row, column)| {
            at(row * strides[y] + column * strides[x] + band * strides[b])
        })
    };
    Ok((0..sides[b]).map(plane).collect())
}

/// Returns in a sentence which axis is taken for bands, where two are as long as there are bands and nothing is told.
pub(super) fn note(sides: &[usize], told: Option<&str>, n_bands: Option<usize>) -> Option<String> {
    let &[a, b, c] = sides else { return None };
    let is_open = told.is_none() && a == c && c > 1 && n_bands == Some(c);
    is_open
        .then(|| format!("its sides are {a} × {b} × {c}, of which the last is taken for bands: --axes says otherwise"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_told_or_found_by_the_number_of_bands() {
        // 2 rows, 3 columns, 4 bands; 100 band + 10 row + column.
        let value = |row: usize, column: usize, band: usize| (100 * band + 10 * row + column) as f32;
        let check = |told: Option<&str>, sides: [usize; 3], n_bands: Option<usize>, of: &dyn Fn([usize; 3]) -> f32| {
            for is_row_major in [true, false] {
                let at = |index: usize| {
                    let [a, b, c] = sides;
                    let place = if is_row_major {
                        [index / (b * c), index / c % b, index % c]
                    } else {
                        [index % a, index / a % b, index / (a * b)]
                    };
                    of(place)
                };
                let planes = planes(&sides, told, n_bands, is_row_major, at).unwrap();
                assert_eq!((planes.len(), planes[0].dim()), (4, (2, 3)));
                assert_eq!((planes[3][(1, 2)], planes[0][(1, 0)]), (312.0, 10.0));
            }
        };
        check(None, [2, 3, 4], Some(4), &|[r, c, b]| value(r, c, b));
        check(None, [2, 3, 4], None, &|[r, c, b]| value(r, c, b));
        check(None, [4, 2, 3], Some(4), &|[b, r, c]| value(r, c, b));
        check(Some("xby"), [3, 4, 2], None, &|[c, b, r]| value(r, c, b));
        assert!(planes(&[2, 3, 4], None, Some(7), true, |_| 0.0).unwrap_err().contains("--axes"));
        assert!(planes(&[2, 0, 4], None, None, true, |_| 0.0).is_err());
        assert_eq!(planes(&[2, 3], None, Some(1), true, |i| i as f32).unwrap()[0][(1, 2)], 5.0);
    }
}
