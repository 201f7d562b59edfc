//! A smooth function over the frame as a table.

use crate::SensorError;

/// A smooth function over the frame as a table of nodes, of which the outermost lie on the frame's edges; read by cubic
/// convolution (Keys, "Cubic convolution interpolation for digital image processing", IEEE Trans. Acoust. Speech Signal
/// Process. 29, 1981), which is exact for quadratic functions.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameTable {
    // Invariants: three nodes or more each way; the values are those of the nodes within a border of one more node.
    rows: usize,
    columns: usize,
    padded: Vec<f64>,
}

impl FrameTable {
    /// Returns the table of a function of the place: shares of the frame from its top and from its left, 0–1.
    ///
    /// # Errors
    /// When there are fewer than 3 × 3 nodes, or a value is not finite.
    pub fn tabulate(rows: usize, columns: usize, value: impl Fn(f64, f64) -> f64) -> Result<Self, SensorError> {
        let share = |i: usize, n: usize| i as f64 / (n - 1).max(1) as f64;
        let nodes = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
        let values = nodes.map(|(row, column)| value(share(row, rows), share(column, columns))).collect();
        Self::new(rows, columns, values)
    }

    /// Returns the table of the values at the nodes, row by row.
    ///
    /// # Errors
    /// When there are fewer than 3 × 3 nodes or not one value for each, or one is not finite.
    pub fn new(rows: usize, columns: usize, values: Vec<f64>) -> Result<Self, SensorError> {
        if rows < 3 || columns < 3 || values.len() != rows * columns {
            let found = format!("{rows} × {columns} nodes with {} values", values.len());
            return Err(SensorError::Shape {
                what: "a table over the frame",
                expected: "3 × 3 or more".to_owned(),
                found,
            });
        }
        if let Some(&value) = values.iter().find(|v| !v.is_finite()) {
            return Err(SensorError::value("a table over the frame", "a value", value, "finite numbers"));
        }
        // Keys's border: the parabola through the last three nodes goes on.
        let beyond = |a: f64, b: f64, c: f64| 3.0 * a - 3.0 * b + c;
        let mut padded: Vec<f64> = Vec::with_capacity((rows + 2) * (columns + 2));
        let wide: Vec<Vec<f64>> = values
            .chunks_exact(columns)
            .map(|line| {
                let last = columns - 1;
                let (before, after) =
                    (beyond(line[0], line[1], line[2]), beyond(line[last], line[last - 1], line[last - 2]));
                [&[before], line, &[after]].concat()
            })
            .collect();
        let outer = |a: &[f64], b: &[f64], c: &[f64]| -> Vec<f64> {
            (0..columns + 2).map(|i| beyond(a[i], b[i], c[i])).collect()
        };
        padded.extend(outer(&wide[0], &wide[1], &wide[2]));
        padded.extend(wide.iter().flatten());
        padded.extend(outer(&wide[rows - 1], &wide[rows - 2], &wide[rows - 3]));
        Ok(Self { rows, columns, padded })
    }

    /// Rows and columns of nodes.
    pub fn nodes(&self) -> (usize, usize) {
        (self.rows, self.columns)
    }

    /// Returns the value at the nodes, row by row.
    pub fn values(&self) -> impl Iterator<Item = f64> {
        let inner = self.padded.chunks_exact(self.columns + 2).skip(1).take(self.rows);
        inner.flat_map(|line| &line[1..=self.columns]).copied()
    }

    /// Returns the table with each value changed by a function of its place.
    #[must_use]
    pub(crate) fn map(&self, value: impl Fn(f64, f64) -> f64) -> Self {
        Self::tabulate(self.rows, self.columns, value).expect("sums of table values are finite")
    }

    /// Returns the value at a place: shares of the frame from its top and from its left. Beyond the frame it goes on as at its
    /// edge.
    pub fn at(&self, down: f64, right: f64) -> f64 {
        self.line(down).at(right)
    }

    /// Returns the function along one height of the frame.
    pub(crate) fn line(&self, down: f64) -> FrameLine {
        let (first, weights) = stencil(down, self.rows);
        let width = self.columns + 2;
        let value = |column: usize| (0..4).map(|k| weights[k] * self.padded[(first + k) * width + column]).sum();
        FrameLine { columns: self.columns, padded: (0..width).map(value).collect() }
    }
}

/// A function along one height of the frame.
pub(crate) struct FrameLine {
    columns: usize,
    padded: Vec<f64>,
}

/// Four padded nodes, by the first of them, and their weights.
pub(crate) type Stencil = (usize, [f64; 4]);

impl FrameLine {
    pub(crate) fn at(&self, right: f64) -> f64 {
        self.with_stencil(&stencil(right, self.columns))
    }

    /// As [`at`](Self::at), with the stencil of the place at hand.
    #[inline]
    pub(crate) fn with_stencil(&self, (first, weights): &Stencil) -> f64 {
        let nodes = &self.padded[*first..*first + 4];
        weights[0] * nodes[0] + weights[1] * nodes[1] + weights[2] * nodes[2] + weights[3] * nodes[3]
    }
}

/// Returns the stencils of the middles of so many pixels along a frame of so many nodes.
pub(crate) fn stencils(n_pixels: usize, n_nodes: usize) -> Vec<Stencil> {
    (0..n_pixels).map(|i| stencil((i as f64 + 0.5) / n_pixels as f64, n_nodes)).collect()
}

/// Returns the nodes about a share of the frame.
fn stencil(share: f64, n: usize) -> Stencil {
    let place = share.clamp(0.0, 1.0) * (n - 1) as f64;
    let below = (place as usize).min(n - 2);
    (below, keys(place - below as f64))
}

/// Keys's weights of the samples at −1, 0, 1 and 2 for a place from 0 to 1.
#[inline]
pub(crate) fn keys(t: f64) -> [f64; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [0.5 * (-t3 + 2.0 * t2 - t), 0.5 * (3.0 * t3 - 5.0 * t2 + 2.0), 0.5 * (-3.0 * t3 + 4.0 * t2 + t), 0.5 * (t3 - t2)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn quadratic_functions_are_exact_to_the_edges() {
        let function =
            |down: f64, right: f64| 2.0 - down + 3.0 * right * right - 1.5 * down * right + 0.7 * down * down;
        let table = FrameTable::tabulate(5, 4, function).unwrap();
        for (down, right) in [(0.0, 0.0), (1.0, 1.0), (0.03, 0.97), (0.5, 0.2), (0.99, 0.01)] {
            assert_abs_diff_eq!(table.at(down, right), function(down, right), epsilon = 1e-12);
        }
        assert_eq!(table.values().count(), 20);
        assert_abs_diff_eq!(table.values().nth(5).unwrap(), function(0.25, 1.0 / 3.0), epsilon = 1e-15);
    }

    #[test]
    fn wrong_tables_are_refused() {
        assert!(FrameTable::new(2, 3, vec![0.0; 6]).is_err());
        assert!(FrameTable::new(3, 3, vec![0.0; 8]).is_err());
        assert!(FrameTable::new(3, 3, vec![f64::NAN; 9]).is_err());
    }
}
