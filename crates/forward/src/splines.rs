//! Pictures on pixels twice as wide, and back, by quadratic splines.

use ndarray::Array2;

/// Pixels beyond the edges that a raster of wider pixels has.
const MARGIN: usize = 1;

/// Returns the number of pixels twice as wide that cover some, with their margin.
fn n_halved(n: usize) -> usize {
    n.div_ceil(2) + 2 * MARGIN
}

/// Returns the means of a picture over pixels twice as wide, by quadratic splines, with a margin: ⅛, ⅜, ⅜, ⅛ each way.
pub(crate) fn halved(picture: &Array2<f32>) -> Array2<f32> {
    let (rows, columns) = picture.dim();
    let (n_rows, n_columns) = (n_halved(rows), n_halved(columns));
    let mut means = Array2::zeros((n_rows, n_columns));
    let mut down = vec![0.0; 2 * n_columns + 2];
    for (row, mut means) in means.rows_mut().into_iter().enumerate() {
        // Pixel i of these has the pixels 2 (i − 1) and the next one in it.
        down.fill(0.0);
        for (k, weight) in WEIGHTS.into_iter().enumerate() {
            let line = (2 * row + k).checked_sub(3).filter(|row| *row < rows);
            let line = line.and_then(|row| picture.as_slice().map(|values| &values[row * columns..][..columns]));
            if let Some(line) = line {
                down[3..].iter_mut().zip(line).for_each(|(sum, light)| *sum += weight * light);
            }
        }
        for (mean, four) in means.iter_mut().zip(down.windows(4).step_by(2)) {
            *mean = WEIGHTS[0] * (four[0] + four[3]) + WEIGHTS[1] * (four[1] + four[2]);
        }
    }
    means
}

const WEIGHTS: [f32; 4] = [0.125, 0.375, 0.375, 0.125];

/// Returns a plane on pixels half as wide, by quadratic splines: ¾ of the wider pixel and ¼ of the next, each way.
pub(crate) fn doubled(plane: &Array2<f32>, (rows, columns): (usize, usize)) -> Array2<f32> {
    let values = (0..rows).flat_map(|row| doubled_row(plane, row, columns)).collect();
    Array2::from_shape_vec((rows, columns), values).expect("it has a value for each pixel")
}

fn doubled_row(plane: &Array2<f32>, row: usize, columns: usize) -> Vec<f32> {
    let own = row / 2 + MARGIN;
    let next = if row.is_multiple_of(2) { own - 1 } else { own + 1 };
    let mut line = Vec::with_capacity(plane.ncols());
    line.extend(plane.row(own).iter().zip(plane.row(next)).map(|(own, next)| 0.75 * own + 0.25 * next));
    let mut doubled = vec![0.0; 2 * columns.div_ceil(2)];
    for (two, three) in doubled.as_chunks_mut::<2>().0.iter_mut().zip(line.windows(3)) {
        *two = [0.75 * three[1] + 0.25 * three[0], 0.75 * three[1] + 0.25 * three[2]];
    }
    doubled.truncate(columns);
    doubled
}
