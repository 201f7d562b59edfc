//! Least squares by normal equations.

/// Normal equations of a least-squares fit.
pub(crate) struct Normal {
    matrix: Vec<Vec<f64>>,
    right: Vec<f64>,
}

impl Normal {
    pub(crate) fn new(n: usize) -> Self {
        Self { matrix: vec![vec![0.0; n]; n], right: vec![0.0; n] }
    }

    pub(crate) fn add(&mut self, slopes: &[f64], value: f64) {
        for (i, si) in slopes.iter().enumerate() {
            self.right[i] += si * value;
            for (j, sj) in slopes.iter().enumerate() {
                self.matrix[i][j] += si * sj;
            }
        }
    }

    /// Returns the solution, with the diagonal raised by a share of itself; directions that nothing fixes give 0.
    pub(crate) fn solve(mut self, damping: f64) -> Vec<f64> {
        let n = self.right.len();
        let largest = (0..n).map(|i| self.matrix[i][i]).fold(0.0, f64::max);
        for i in 0..n {
            self.matrix[i][i] += damping * self.matrix[i][i] + 1e-14 * largest + f64::MIN_POSITIVE;
        }
        // Elimination without exchange: the matrix is symmetric and positive.
        for i in 0..n {
            for k in i + 1..n {
                let factor = self.matrix[k][i] / self.matrix[i][i];
                for j in i..n {
                    self.matrix[k][j] -= factor * self.matrix[i][j];
                }
                self.right[k] -= factor * self.right[i];
            }
        }
        for i in (0..n).rev() {
            let known: f64 = (i + 1..n).map(|j| self.matrix[i][j] * self.right[j]).sum();
            self.right[i] = (self.right[i] - known) / self.matrix[i][i];
        }
        self.right
    }
}
