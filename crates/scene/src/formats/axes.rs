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
        [] => return Err("it holds a single number, expected rows, columns and bands".to_owned()),
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

/// Names of rows, of columns and of bands, in small letters and without what stands between words.
const NAMES: [(char, [&str; 12]); 3] = [
    (
        'y',
        [
            "y",
            "lat",
            "latitude",
            "row",
            "line",
            "height",
            "northing",
            "downtrack",
            "alongtrack",
            "scanline",
            "scan",
            "v",
        ],
    ),
    (
        'x',
        [
            "x",
            "lon",
            "longitude",
            "column",
            "col",
            "width",
            "easting",
            "crosstrack",
            "acrosstrack",
            "sample",
            "pixel",
            "u",
        ],
    ),
    (
        'b',
        [
            "b",
            "band",
            "wavelength",
            "wave",
            "lambda",
            "wl",
            "channel",
            "spectral",
            "spectrum",
            "wavelengthnm",
            "c",
            "spectralband",
        ],
    ),
];

/// Returns the order of axes that is told, or that their names have; and in a sentence what is wrong with names, where they say something
/// else or not all of it.
pub(super) fn order(names: &[String], told: Option<&str>) -> (Option<String>, Option<String>) {
    let own = Named::of(names);
    let shown = || names.iter().map(|name| format!("'{name}'")).collect::<Vec<_>>().join(", ");
    match (told, own) {
        (Some(told), Named::Whole(own)) if own != told => {
            (Some(told.to_owned()), Some(format!("its axes are named {}, and --axes says otherwise", shown())))
        }
        (Some(told), _) => (Some(told.to_owned()), None),
        (None, Named::Whole(own)) => (Some(own), None),
        (None, Named::Nothing) => (None, None),
        (None, Named::Doubt(own)) => (
            own,
            Some(format!(
                "its axes are named {}, which does not tell all of rows, columns and bands: --axes does",
                shown()
            )),
        ),
    }
}

/// What the names of axes say of their order.
enum Named {
    Nothing,
    /// Not which are rows and which columns; the order if that is as usual, where the bands are known.
    Doubt(Option<String>),
    Whole(String),
}

impl Named {
    fn of(names: &[String]) -> Self {
        if names.len() != 3 || names.iter().all(String::is_empty) {
            return Self::Nothing;
        }
        let kinds: Vec<Option<char>> = names.iter().map(|name| kind_of(name)).collect();
        let n = |kind: char| kinds.iter().filter(|own| **own == Some(kind)).count();
        let missing: Vec<char> = ['y', 'x', 'b'].into_iter().filter(|kind| n(*kind) == 0).collect();
        if ['y', 'x', 'b'].into_iter().any(|kind| n(kind) > 1) {
            return Self::Doubt(None);
        }
        let mut rest = missing.iter();
        let order = kinds.iter().filter_map(|own| own.or_else(|| rest.next().copied())).collect();
        match missing[..] {
            [] | [_] => Self::Whole(order),
            ['y', 'x'] => Self::Doubt(Some(order)),
            _ => Self::Doubt(None),
        }
    }
}

/// Returns which axis one of this name is.
fn kind_of(name: &str) -> Option<char> {
    let bare: String = name.to_lowercase().chars().filter(|c| c.is_ascii_alphanumeric()).collect();
    let is = |own: &str| {
        let counted = ["n", "num", "dim"].iter().any(|start| bare.strip_prefix(start).is_some_and(|rest| rest == own));
        bare == own || counted
    };
    let is_any = |own: &&str| is(own) || is(&format!("{own}s"));
    NAMES.iter().find(|(_, names)| names.iter().any(is_any)).map(|(kind, _)| *kind)
}

/// Whether the names of two axes say that the first runs over columns and the second over rows.
pub(super) fn are_turned(names: &[String]) -> bool {
    matches!(names, [first, second] if kind_of(first) == Some('x') && kind_of(second) == Some('y'))
}

/// Returns in a sentence which axes are taken for what, where nothing is told and others are as long as there are bands; or where bands come first and
/// the last axis is the fastest, since MATLAB's `h5write` leaves columns before rows then.
pub(super) fn note(sides: &[usize], told: Option<&str>, n_bands: Option<usize>, is_row_major: bool) -> Option<String> {
    let &[a, b, c] = sides else { return None };
    let n = n_bands.filter(|n| told.is_none() && *n > 1)?;
    let taken = if c == n { "last" } else { "first" };
    if sides.iter().filter(|side| **side == n).count() > 1 {
        return Some(format!(
            "its sides are {a} × {b} × {c}, of which the {taken} is taken for bands: --axes says otherwise"
        ));
    }
    (is_row_major && a == n).then(|| {
        format!("its axes, {a} × {b} × {c}, are taken for bands, rows and columns: --axes bxy where columns come before rows, as MATLAB leaves them")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_axes_say_their_order() {
        let of = |names: [&str; 3], told: Option<&str>| order(&names.map(str::to_owned), told);
        for (names, expected) in [
            (["x", "y", "wavelength"], "xyb"),
            (["Lambda", "lat", "lon"], "byx"),
            (["downtrack", "crosstrack", "bands"], "yxb"),
            (["n_cols", "channel", "nrows"], "xby"),
            (["phony_dim_0", "x", "y"], "bxy"),
        ] {
            assert_eq!(of(names, None), (Some(expected.to_owned()), None), "{names:?}");
        }
        assert_eq!(of(["", "", ""], None), (None, None));
        for (names, expected) in [(["x", "x", "b"], None), (["p", "q", "band"], Some("yxb")), (["x", "p", "q"], None)] {
            let (order, note) = of(names, None);
            assert!(order.as_deref() == expected && note.is_some_and(|note| note.contains("--axes")), "{names:?}");
        }
        let (order, note) = of(["x", "y", "wavelength"], Some("yxb"));
        assert!(order.as_deref() == Some("yxb") && note.is_some_and(|note| note.contains("'wavelength'")));
        assert_eq!(of(["x", "y", "wavelength"], Some("xyb")).1, None);
    }

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
        for (sides, taken) in [([7, 7, 9], "first"), ([9, 7, 7], "last"), ([7, 9, 7], "last")] {
            assert!(note(&sides, None, Some(7), true).is_some_and(|note| note.contains(taken)), "{sides:?}");
        }
        assert!(
            note(&[7, 8, 9], None, Some(9), true).is_none() && note(&[7, 7, 9], Some("ybx"), Some(7), true).is_none()
        );
        assert!(note(&[7, 8, 9], None, Some(7), true).is_some() && note(&[7, 8, 9], None, Some(7), false).is_none());
        assert_eq!(planes(&[2, 3], None, Some(1), true, |i| i as f32).unwrap()[0][(1, 2)], 5.0);
    }
}
