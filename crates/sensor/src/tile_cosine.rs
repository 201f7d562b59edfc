//! The cosine transform of small square tiles.

/// The orthonormal cosine transform (DCT-II) of `N` × `N` samples.
pub(crate) struct TileCosine<const N: usize> {
    /// A row a frequency, a column a place.
    forward: [[f32; N]; N],
    /// A row a place, a column a frequency.
    inverse: [[f32; N]; N],
}

impl<const N: usize> TileCosine<N> {
    pub(crate) fn new() -> Self {
        let one = |k: usize, i: usize| {
            let norm = if k == 0 { 1.0 / N as f64 } else { 2.0 / N as f64 }.sqrt();
            (norm * (std::f64::consts::PI * k as f64 * (i as f64 + 0.5) / N as f64).cos()) as f32
        };
        let forward = std::array::from_fn(|k| std::array::from_fn(|i| one(k, i)));
        Self { forward, inverse: std::array::from_fn(|i| std::array::from_fn(|k| one(k, i))) }
    }

    /// Returns the frequencies of a tile: rows are those down, columns those across.
    pub(crate) fn forward(&self, tile: &[[f32; N]; N]) -> [[f32; N]; N] {
        // F X Fᵀ.
        product(&product(&self.forward, tile), &self.inverse)
    }

    /// Returns the tile of its frequencies.
    pub(crate) fn inverse(&self, frequencies: &[[f32; N]; N]) -> [[f32; N]; N] {
        product(&product(&self.inverse, frequencies), &self.forward)
    }

    /// Returns the variance that white noise of 1 has at each frequency along one axis where it is weighted by a window.
    pub(crate) fn windowed_noise(&self, window: &[f32; N]) -> [f32; N] {
        self.forward.map(|row| row.iter().zip(window).map(|(f, w)| (f * w).powi(2)).sum())
    }
}

#[inline]
fn product<const N: usize>(a: &[[f32; N]; N], b: &[[f32; N]; N]) -> [[f32; N]; N] {
    let mut out = [[0.0; N]; N];
    for (row, out) in a.iter().zip(&mut out) {
        for (&factor, line) in row.iter().zip(b) {
            for (sum, &value) in out.iter_mut().zip(line) {
                *sum += factor * value;
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_transform_leads_back_and_keeps_energy() {
        let cosine = TileCosine::<8>::new();
        let tile = std::array::from_fn(|r| std::array::from_fn(|c| ((3 * r + 5 * c * c) % 11) as f32));
        let frequencies = cosine.forward(&tile);
        let energy = |tile: &[[f32; 8]; 8]| tile.iter().flatten().map(|v| v * v).sum::<f32>();
        assert!((energy(&frequencies) / energy(&tile) - 1.0).abs() < 1e-5);
        let back = cosine.inverse(&frequencies);
        assert!(back.iter().flatten().zip(tile.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-5));
        // The mean alone is at frequency 0.
        assert!((frequencies[0][0] - tile.iter().flatten().sum::<f32>() / 8.0).abs() < 1e-4);
    }
}
