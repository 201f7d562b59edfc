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
    pub fn srgb_basis(&self, grid: &WavelengthGrid, white_cd_m2: f64) -> [Vec<f64>; 3] {
        let sampled = self.primaries.each_ref().map(|p| p.sample_or_zero(grid));
        let columns = sampled.each_ref().map(|values| Observer::Cie1931.xyz(grid, values).0);
        let inverse = inverse_of_columns(columns);
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|unit| {
            let xyz = Xyz::from_linear_srgb(unit).0.map(|v| v * white_cd_m2);
            let drive = [0, 1, 2].map(|i| (0..3).map(|j| inverse[i][j] * xyz[j]).sum::<f64>());
            (0..grid.len()).map(|band| (0..3).map(|p| drive[p] * sampled[p][band]).sum()).collect()
        })
    }
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
}
