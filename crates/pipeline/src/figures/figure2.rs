//! Figure 2: line spread functions of an ideal 50 mm f/22 lens by ray bending, beside the theory of Airy.

use dioptric_diffraction::{Hurb, WaveQuality, WaveWindow, WindowCenter, airy, wave_psf};
use dioptric_optics::{Lens, ObjectPoint, glam::DVec2};
use dioptric_psf::{Profile, PsfError};
use rayon::prelude::*;

use super::paper::{FIGURE_2_FILM_MM, Figure2};

/// A line spread function at each of several wavelengths.
#[derive(Clone, Debug)]
pub struct Surface {
    /// What made it.
    pub name: &'static str,
    /// Wavelengths, nm.
    pub wavelengths_nm: Vec<f64>,
    /// Share of the energy per µm over places in µm, a profile a wavelength.
    pub profiles: Vec<Profile>,
}

/// Places at which the closed forms are sampled, µm: those of the authors' film, ±30.2 µm in 65 pixels.
fn places_um() -> Vec<f64> {
    (-32..=32).map(|i| f64::from(i) * 70.710_678 / 75.0).collect()
}

/// Returns what the authors drew: rays bent at random and counted on their film, `n_across`² of them a wavelength.
///
/// # Errors
/// When the lens cannot be built, which it can.
pub fn counted(wavelengths_nm: &[f64], n_across: usize) -> Result<Surface, PsfError> {
    let profiles = wavelengths_nm
        .par_iter()
        .map(|&nm| {
            let whole = Figure2::PRINTED.counted(Hurb::PAPER, n_across, nm, 1)?;
            let middle = whole.at_um.len() / 2;
            let shown = middle - 32..=middle + 32;
            Ok(Profile { at_um: places_um(), values: whole.values[shown].to_vec() })
        })
        .collect::<Result<_, PsfError>>()?;
    Ok(Surface { name: "HURB, rays counted", wavelengths_nm: wavelengths_nm.to_vec(), profiles })
}

/// Returns a line spread given in units of λN, at each wavelength on the film of the figure.
fn closed_form(name: &'static str, wavelengths_nm: &[f64], lsf: impl Fn(f64) -> f64 + Sync) -> Surface {
    let profiles = wavelengths_nm
        .par_iter()
        .map(|&nm| {
            let unit_um = Figure2::PRINTED.unit_um(nm);
            let values = places_um().iter().map(|x| lsf(x / unit_um) / unit_um).collect();
            Profile { at_um: places_um(), values }
        })
        .collect();
    Surface { name, wavelengths_nm: wavelengths_nm.to_vec(), profiles }
}

/// Returns the closed form of ray bending with a factor γ.
pub fn hurb(name: &'static str, wavelengths_nm: &[f64], model: Hurb) -> Surface {
    closed_form(name, wavelengths_nm, |u| model.lsf(u))
}

/// Rows of the window over which a line spread of waves is summed: ±630 µm, 40 λN at 700 nm. What it leaves out, half a
/// percent, is far from the line too.
const WAVE_ROWS: usize = 1341;

/// Returns the line spread of the diffraction integral through the ideal lens, from the point at 2 m.
///
/// # Errors
/// When the lens cannot be built or its light not be summed, which they can.
pub fn wave(wavelengths_nm: &[f64]) -> Result<Surface, PsfError> {
    let pitch_um = places_um()[1] - places_um()[0];
    let lens = Lens::thin(50.0, Figure2::PRINTED.diameter_mm)?;
    let columns = places_um().len();
    let window = WaveWindow { pitch_um, rows: WAVE_ROWS, columns, center: WindowCenter::At(DVec2::ZERO) };
    let profile = |&nm: &f64| {
        let lens = lens.at(nm)?;
        let point = ObjectPoint::from_field(&lens, DVec2::ZERO, 0.5);
        let psf = wave_psf(&lens, &point, FIGURE_2_FILM_MM, &window, WaveQuality::default())?;
        let values = psf.samples.columns().into_iter().map(|column| column.sum() / pitch_um).collect();
        Ok(Profile { at_um: places_um(), values })
    };
    let profiles = wavelengths_nm.par_iter().map(profile).collect::<Result<_, PsfError>>()?;
    Ok(Surface { name: "diffraction integral", wavelengths_nm: wavelengths_nm.to_vec(), profiles })
}

/// Returns the theory: the line spread function of Airy's pattern.
pub fn theory(wavelengths_nm: &[f64]) -> Surface {
    closed_form("Airy, circular aperture", wavelengths_nm, airy::lsf)
}

/// Returns the widths of surfaces as a table: name, wavelength, full width at half maximum in µm and in λN, peak.
pub fn table(surfaces: &[Surface]) -> String {
    let mut text = "surface,wavelength_nm,fwhm_um,fwhm_over_lambda_n,peak_per_um\n".to_owned();
    for surface in surfaces {
        for (nm, profile) in surface.wavelengths_nm.iter().zip(&surface.profiles) {
            let fwhm = profile.full_width_at_half_maximum_um();
            let peak = profile.values.iter().copied().fold(0.0, f64::max);
            let name = surface.name.replace(',', "");
            text += &format!("{name},{nm},{fwhm:.4},{:.4},{peak:.6}\n", fwhm / Figure2::PRINTED.unit_um(*nm));
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widths_grow_in_step_with_the_wavelength() {
        for surface in [hurb("γ = 1", &[400.0, 700.0], Hurb::with_gamma(1.0)), theory(&[400.0, 700.0])] {
            let [narrow, wide] = [0, 1].map(|i| surface.profiles[i].full_width_at_half_maximum_um());
            // Straight lines between samples 0.94 µm apart cost a percent of a width of 6 µm.
            assert!((wide / narrow / 1.75 - 1.0).abs() < 0.02, "{} {narrow} {wide}", surface.name);
        }
    }

    #[test]
    fn waves_have_the_line_spread_of_theory() {
        let nm = [400.0, 700.0];
        let (waves, theory) = (wave(&nm).unwrap(), theory(&nm));
        for (found, expected) in waves.profiles.iter().zip(&theory.profiles) {
            let peak = expected.values[32];
            for (a, b) in found.values.iter().zip(&expected.values) {
                // Waves are averaged over pixels of a tenth of λN, and the window leaves out .5 %.
                assert!((a - b).abs() < 0.01 * peak, "{a} {b}");
            }
        }
    }

    #[test]
    fn figure2_matches_its_golden() {
        let nm = [400.0, 550.0, 700.0];
        let surfaces = [
            counted(&nm, 201).unwrap(),
            hurb("HURB closed form", &nm, Hurb::with_gamma(1.0)),
            hurb("HURB calibrated", &nm, Hurb::CALIBRATED),
            wave(&nm).unwrap(),
            theory(&nm),
        ];
        // A ray that crosses the edge of a pixel changes a sample of the counted surface by 1/30 000 of the whole.
        dioptric_golden::check_csv("figure2_widths.csv", &table(&surfaces), 1e-3);
    }
}
