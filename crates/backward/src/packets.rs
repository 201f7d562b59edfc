//! Which wavelengths a sample takes: eight at once, spread over all bands.
//!
//! Each band is the mean over eight wavelengths at the middles of its eighths, so that a band that is wide sees the
//! dispersion within it. A sample takes eight of all of them, an eighth of their number apart; the next sample the same,
//! moved on, so that after as many samples as there are bands every wavelength has been taken once.

use dioptric_spectrum::WavelengthGrid;

/// Wavelengths of one sample.
pub(crate) const PACKET: usize = 8;

/// What the value of a band is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum BandSampling {
    /// The mean over the width of the band.
    #[default]
    Mean,
    /// The value at its center.
    Center,
}

/// The wavelengths that can be taken, and the order in which they are.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Packets {
    /// Eight a band, bands in order, nm.
    nodes_nm: Vec<f64>,
    n_bands: usize,
    stride: usize,
    /// Half the width that each of a band's wavelengths stands for, nm.
    half_widths_nm: Vec<f64>,
}

impl Packets {
    pub(crate) fn new(grid: &WavelengthGrid, sampling: BandSampling) -> Self {
        let n_bands = grid.len();
        let eighth = |i: usize| match sampling {
            BandSampling::Mean => (i as f64 + 0.5) / PACKET as f64 - 0.5,
            BandSampling::Center => 0.0,
        };
        let of_band =
            |(place, &width): (f64, &f64)| (0..PACKET).map(move |i| place + width * eighth(i)).collect::<Vec<f64>>();
        let places = match sampling {
            BandSampling::Mean => grid.middles_nm(),
            BandSampling::Center => grid.centers_nm().to_vec(),
        };
        let nodes_nm = places.into_iter().zip(grid.widths_nm()).flat_map(of_band).collect();
        // Steps of eight nodes reach every band soonest; they must not close before all have been taken.
        let from = if n_bands > PACKET { PACKET } else { (5 * n_bands).div_ceil(8) };
        let stride = (from.max(1)..).find(|&stride| greatest_common_divisor(stride, n_bands) == 1).unwrap_or(1);
        let half_width_nm = |&width: &f64| match sampling {
            BandSampling::Mean => 0.5 * width / PACKET as f64,
            BandSampling::Center => 0.0,
        };
        let half_widths_nm = grid.widths_nm().iter().map(half_width_nm).collect();
        Self { nodes_nm, n_bands, stride, half_widths_nm }
    }

    /// All wavelengths, nm.
    pub(crate) fn nodes_nm(&self) -> &[f64] {
        &self.nodes_nm
    }

    /// The least number of samples in a row that give every band a value, from wherever they begin.
    pub(crate) fn n_for_all_bands(&self) -> usize {
        let reaches_all = |n: usize| {
            (0..self.n_bands).all(|start| {
                let mut is_reached = vec![false; self.n_bands];
                (start..start + n).flat_map(|i| self.nodes_of(i)).for_each(|node| is_reached[node / PACKET] = true);
                is_reached.into_iter().all(|is| is)
            })
        };
        (1..=self.n_bands).find(|&n| reaches_all(n)).unwrap_or(self.n_bands)
    }

    /// Returns the nodes of the sample of this number, shortest wavelength first.
    pub(crate) fn nodes_of(&self, sample: usize) -> [usize; PACKET] {
        let first = (sample % self.n_bands) * self.stride % self.n_bands;
        std::array::from_fn(|k| first + k * self.n_bands)
    }

    /// Returns a wavelength of those that a node stands for, nm; `share` of 0 to 1 chooses among them evenly.
    ///
    /// Lenses are traced at the node itself: over an eighth of a band they do not change.
    pub(crate) fn wavelength_nm(&self, node: usize, share: f64) -> f64 {
        self.nodes_nm[node] + (2.0 * share - 1.0) * self.half_widths_nm[Self::band_of(node)]
    }

    /// The band of a node.
    pub(crate) fn band_of(node: usize) -> usize {
        node / PACKET
    }
}

fn greatest_common_divisor(a: usize, b: usize) -> usize {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_take_turns_evenly() {
        for n_bands in [1, 2, 3, 7, 8, 9, 16, 31, 64] {
            let centers: Vec<f64> = (0..n_bands).map(|i| 400.0 + 10.0 * f64::from(i)).collect();
            let packets = Packets::new(&WavelengthGrid::new(centers).unwrap(), BandSampling::Mean);
            let mut counts = vec![0; packets.nodes_nm().len()];
            for sample in 5..5 + n_bands as usize {
                packets.nodes_of(sample).into_iter().for_each(|node| counts[node] += 1);
            }
            assert!(counts.iter().all(|&n| n == 1), "{n_bands}: {counts:?}");
            // Twice as many as would do if no two of them took the same band.
            let soonest = (n_bands as usize).div_ceil(PACKET);
            assert!(packets.n_for_all_bands() <= 2 * soonest, "{n_bands}: {}", packets.n_for_all_bands());
        }
    }

    #[test]
    fn wavelengths_of_a_band_leave_no_gap() {
        let grid = WavelengthGrid::uniform(420.0, 700.0, 40.0).unwrap();
        let packets = Packets::new(&grid, BandSampling::Mean);
        assert_eq!((packets.wavelength_nm(0, 0.0), packets.wavelength_nm(63, 1.0)), (400.0, 720.0));
        for node in 1..64 {
            assert!((packets.wavelength_nm(node, 0.0) - packets.wavelength_nm(node - 1, 1.0)).abs() < 1e-9);
        }
        assert_eq!(Packets::new(&grid, BandSampling::Center).wavelength_nm(9, 0.7), 460.0);
    }

    #[test]
    fn nodes_are_the_middles_of_eighths() {
        let grid = WavelengthGrid::uniform(420.0, 700.0, 40.0).unwrap();
        let packets = Packets::new(&grid, BandSampling::Mean);
        assert_eq!(packets.nodes_nm()[..2], [402.5, 407.5]);
        assert_eq!(packets.nodes_nm()[63], 717.5);
        assert_eq!(Packets::new(&grid, BandSampling::Center).nodes_nm()[9], 460.0);
    }
}
