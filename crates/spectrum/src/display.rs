//! A three-primary display, to lift ordinary pictures to spectra.

use crate::{Observer, Spectrum, WavelengthGrid, Xyz};

// Apple Studio Display, measured; as collected in colour-science 0.4.7 (BSD-3-Clause).
const APPLE_STUDIO: &str = include_str!("../data/display_apple_studio.csv");

/// A display: the spectral radiance of each primary at full drive.
#[derive(Clone, Debug, PartialEq)]
pub struct Display {
    /// Red, green and blue at full drive; W m⁻² sr⁻¹ nm⁻¹ up to one common factor.
    pub primaries: [Spectrum; 3],
}

impl Display {
    /// The Apple Studio Display (a liquid crystal display).
    pub fn apple_studio() -> Self {
        Self {
            primaries: ["r", "g", "b"].map(|name| {
                Spectrum::from_embedded_csv(APPLE_STUDIO, name).expect("the embedded table has this column")
            }),
        }
    }

    /// Returns the spectra of red, green and blue such that an sRGB picture shown on this display keeps its color.
    ///
    /// The primaries are mixed so that linear sRGB (r, g, b) gives its own tristimulus values, white having the
    /// luminance `white_cd_m2`. A mixture can have negative parts: a display of smaller gamut than sRGB cannot show
    /// every color; the sum over one pixel is then clipped at 0 by the caller.
    ///
    /// The tristimulus values are those that the bands of the grid add up to, so that few bands keep colors too. Bands that cannot tell colors, such
    /// as two or two neighbors, would need a white without light in one of them or far too much: where its radiance in any band is not within a
    /// factor of 5 of that of the display's white, the spectra are the display's own light at these wavelengths.
    pub fn srgb_basis(&self, grid: &WavelengthGrid, white_cd_m2: f64) -> [Vec<f64>; 3] {
        /// Radiance in a band over the largest of all wavelengths that is too little to be compared.
        const DARK: f64 = 1e-2;
        let (tristimulus, visible) = self.seen_on(&visible());
        let own_drives = drives(&tristimulus, white_cd_m2);
        let (tristimulus, at_bands) = self.seen_on(grid);
        let own = spectra(&own_drives, &at_bands);
        let by_bands = spectra(&drives(&tristimulus, white_cd_m2), &at_bands);
        let white = |spectra: &[Vec<f64>; 3], band: usize| spectra.iter().map(|of| of[band]).sum::<f64>();
        let display_white = spectra(&own_drives, &visible);
        let brightest = (0..display_white[0].len()).map(|band| white(&display_white, band)).fold(0.0, f64::max);
        let tells_colors = (0..grid.len()).all(|band| {
            let (by_band, own) = (white(&by_bands, band), white(&own, band));
            own < DARK * brightest || (0.2..=5.0).contains(&(by_band / own))
        });
        if tells_colors { by_bands } else { own }
    }

    /// Returns the tristimulus values of the primaries as the bands of a grid add them up, and their samples there.
    fn seen_on(&self, grid: &WavelengthGrid) -> ([[f64; 3]; 3], [Vec<f64>; 3]) {
        let samples = self.primaries.each_ref().map(|p| p.sample_or_zero(grid));
        (samples.each_ref().map(|values| Observer::Cie1931.xyz(grid, values).0), samples)
    }
}

/// All that the eye sees, nm.
fn visible() -> WavelengthGrid {
    WavelengthGrid::uniform(380.0, 780.0, 5.0).expect("wavelengths ascend")
}

/// Returns how far the primaries, of these tristimulus values, are driven for red, green and blue of sRGB.
fn drives(primaries: &[[f64; 3]; 3], white_cd_m2: f64) -> [[f64; 3]; 3] {
    let inverse = inverse_of_columns(*primaries);
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|unit| {
        let xyz = Xyz::from_linear_srgb(unit).0.map(|v| v * white_cd_m2);
        [0, 1, 2].map(|i| (0..3).map(|j| inverse[i][j] * xyz[j]).sum::<f64>())
    })
}

/// Returns the spectra of primaries of these samples, driven so far.
fn spectra(drives: &[[f64; 3]; 3], samples: &[Vec<f64>; 3]) -> [Vec<f64>; 3] {
    drives.map(|drive| (0..samples[0].len()).map(|band| (0..3).map(|p| drive[p] * samples[p][band]).sum()).collect())
}

/// Returns the inverse, as rows, of the matrix with these columns.
fn inverse_of_columns([a, b, c]: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let cross =
        |u: [f64; 3], v: [f64; 3]| [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let bc = cross(b, c);
    let determinant: f64 = (0..3).map(|i| a[i] * bc[i]).sum();
    [bc, cross(c, a), cross(a, b)].map(|row| row.map(|v| v / determinant))
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn a_lifted_color_is_seen_as_it_was() {
        let grid = WavelengthGrid::uniform(400.0, 700.0, 10.0).unwrap();
        let basis = Display::apple_studio().srgb_basis(&grid, 100.0);
        let rgb = [0.8, 0.3, 0.1];
        let spectrum: Vec<f64> = (0..grid.len()).map(|b| (0..3).map(|i| rgb[i] * basis[i][b]).sum()).collect();
        let back = Xyz(Observer::Cie1931.xyz(&grid, &spectrum).0.map(|v| v / 100.0)).to_linear_srgb();
        for i in 0..3 {
            assert_abs_diff_eq!(back[i], rgb[i], epsilon = 1e-6);
        }
    }

    /// One band, two and two neighbors cannot tell colors: a white on them is as bright as the display's own.
    #[test]
    fn bands_that_cannot_tell_colors_see_the_light_of_the_display() {
        let display = Display::apple_studio();
        let white_on = |nm: &[f64]| -> Vec<f64> {
            let basis = display.srgb_basis(&WavelengthGrid::new(nm.to_vec()).unwrap(), 100.0);
            (0..nm.len()).map(|band| basis.iter().map(|of| of[band]).sum()).collect()
        };
        let fine: Vec<f64> = (380..=780).map(f64::from).collect();
        let display_white = white_on(&fine);
        for nm in [&[550.0][..], &[500.0, 600.0], &[600.0, 610.0], &[440.0, 460.0, 480.0]] {
            for (nm, found) in nm.iter().zip(white_on(nm)) {
                let expected = display_white[*nm as usize - 380];
                // Sums over steps of 1 and of 5 nm differ where the display's red has lines.
                assert!((found / expected - 1.0).abs() < 0.02, "{found} and {expected} at {nm} nm");
            }
        }
    }
}
