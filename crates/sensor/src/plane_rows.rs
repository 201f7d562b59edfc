//! Planes of one size, row by row.

use ndarray::Array2;

/// Returns the rows of all planes, which must be contiguous: for each row its line in every plane.
pub(crate) fn plane_rows(planes: &mut [Array2<f32>]) -> Vec<Vec<&mut [f32]>> {
    let (rows, columns) = planes[0].dim();
    let mut lines: Vec<Vec<&mut [f32]>> = (0..rows).map(|_| Vec::with_capacity(planes.len())).collect();
    for plane in planes {
        let all = plane.as_slice_mut().expect("demosaiced planes are contiguous");
        all.chunks_mut(columns).zip(&mut lines).for_each(|(line, row)| row.push(line));
    }
    lines
}
