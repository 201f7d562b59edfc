//! The modulation of point-spread functions as the film moves.

use std::f64::consts::FRAC_PI_2;

use dioptric_optics::Lens;
use dioptric_psf::PointImage;
use rayon::prelude::*;

use super::request::Item;
use super::spot::{PaperRays, Spot};
use super::windowed::Windowed;
use crate::{PsfRequest, PsfSampling, PsfSet};
use dioptric_pipeline::PipelineError;

/// Steps of the film to each side of its place.
const STEPS: i32 = 12;
/// The frequency where none is asked for, cycles per mm.
const FREQUENCY_PER_MM: f64 = 30.0;
/// Pixels in a period of the wave: fewer and what they average away is no longer known well, more and large blurs cost
/// too much.
const PIXELS_A_PERIOD: f64 = 8.0;
/// The largest window, pixels along its side: 75 periods.
const LARGEST_WINDOW: usize = 601;

/// The modulation at one frequency as the film moves.
#[derive(Clone, Debug, PartialEq)]
pub struct ThroughFocus {
    /// Spatial frequency, cycles per mm.
    pub cycles_per_mm: f64,
    /// How far the film is moved away from the lens, mm.
    pub shifts_mm: Vec<f64>,
    /// The rows of the set that were followed: those that its plots show.
    pub rows: Vec<usize>,
    /// For each of these, the tangential and the sagittal modulations.
    pub modulations: Vec<Vec<(f64, f64)>>,
}

impl PsfRequest {
    /// Computes the modulation at the first of the frequencies asked for (or 30 cycles per mm) while the film moves by
    /// so much that the sharpest of the pictures is blurred past it.
    ///
    /// Only what plots show is followed, on pixels as coarse as the frequency allows; the modulation is that of the
    /// pixels asked for. Light that falls outside 75 periods counts as unmodulated. Functions of an array know of no other film: of them nothing
    /// is followed.
    ///
    /// # Errors
    /// Those of [`compute`](Self::compute).
    pub fn through_focus(&self, lens: &Lens, set: &PsfSet) -> Result<ThroughFocus, PipelineError> {
        let cycles_per_mm = self.mtf_per_mm.iter().copied().find(|f| *f > 0.0).unwrap_or(FREQUENCY_PER_MM);
        let (lens, _) = self.lens_with_image(lens)?;
        let lens = &*lens;
        let reference = self.reference(lens)?;
        let first = reference.first_order();
        // A telecentric lens has the cone of its object's image on any film.
        let f_number = match (set.film_distance_mm - first.exit_pupil_z_mm) / first.exit_pupil_diameter_mm {
            f_number if f_number.is_finite() => f_number,
            _ => reference.working_f_number(self.distances_mm.first().copied().unwrap_or(f64::INFINITY)),
        };
        // Where the blur is 1.2 periods wide, the modulation of an even disc is at its first zero.
        let extent_mm = match 1.5 * 1.22 * f_number.abs() / cycles_per_mm {
            reach if reach.is_finite() => reach.min(5.0),
            _ => 1.0,
        };
        let shifts_mm: Vec<f64> = (-STEPS..=STEPS).map(|i| extent_mm * f64::from(i) / f64::from(STEPS)).collect();
        let rows = if let PsfSampling::Stored(_) = self.sampling { vec![] } else { set.plotted() };
        let all = self.items(lens)?;
        let items: Vec<Item> = rows.iter().map(|row| all[*row]).collect();
        let mut modulations = vec![Vec::with_capacity(shifts_mm.len()); rows.len()];
        for shift_mm in &shifts_mm {
            let here = Here {
                request: self,
                lens,
                items: &items,
                film_distance_mm: set.film_distance_mm + shift_mm,
                cycles_per_mm,
            };
            for (found, modulation) in modulations.iter_mut().zip(here.modulations()?) {
                found.push(modulation);
            }
        }
        Ok(ThroughFocus { cycles_per_mm, shifts_mm, rows, modulations })
    }
}

/// A place of the film.
struct Here<'a> {
    request: &'a PsfRequest,
    lens: &'a Lens,
    items: &'a [Item],
    film_distance_mm: f64,
    cycles_per_mm: f64,
}

impl Here<'_> {
    /// Returns the tangential and the sagittal modulation of each point.
    fn modulations(&self) -> Result<Vec<(f64, f64)>, PipelineError> {
        match &self.request.sampling {
            PsfSampling::Stored(_) => Ok(vec![]),
            PsfSampling::Pupil => {
                let settings = self.request.image_settings(self.lens, self.film_distance_mm)?;
                let modulation = |item: &Item| Ok(self.of_picture(item, item.image(self.lens, &settings)?.as_ref()));
                self.items.par_iter().map(modulation).collect()
            }
            &PsfSampling::Paper { n_across, jitter } => {
                let rays =
                    PaperRays { n_across, jitter, bending: self.request.diffraction.hurb(), seed: self.request.seed };
                self.items.par_iter().map(|item| self.of_rays(item, &rays)).collect()
            }
        }
    }

    fn of_picture(&self, item: &Item, image: Option<&PointImage>) -> (f64, f64) {
        let Some((picture, pitch_um)) = image.map(|image| self.window(image)) else { return (f64::NAN, f64::NAN) };
        let modulation = |direction| {
            let own = picture.modulation(direction, self.cycles_per_mm);
            let [asked, drawn] = [self.request.pixel_um, pitch_um].map(|um| self.pixels(um, direction));
            (own * asked / drawn).min(1.0)
        };
        let meridian = item.angles().meridian_rad();
        (modulation(meridian), modulation(meridian + FRAC_PI_2))
    }

    /// Draws a point on the coarsest pixels that do, of a side in µm, in a window that is not too large.
    fn window(&self, image: &PointImage) -> (Windowed, f64) {
        let asked_um = self.request.pixel_um;
        let reach_um = 1e3 * image.extent_mm();
        let pitch_um = pitch_um(asked_um, self.cycles_per_mm, reach_um);
        if 2.0 * reach_um > pitch_um * LARGEST_WINDOW as f64 {
            let (energy, _) = image.picture(pitch_um, LARGEST_WINDOW);
            return (Windowed::new(energy.mapv(|e| e as f32).view(), pitch_um), pitch_um);
        }
        let (kernel, _) = image.kernel(pitch_um);
        (Windowed::new(kernel.samples.view(), pitch_um), pitch_um)
    }

    fn of_rays(&self, item: &Item, rays: &PaperRays) -> Result<(f64, f64), PipelineError> {
        let reference = self.request.reference(self.lens)?;
        let mono = self.lens.at(item.wavelength_nm)?;
        let point = item.point(&reference);
        let spot = Spot::over_front(&mono, &point, self.film_distance_mm, rays);
        let modulation = |direction: f64| {
            spot.modulation(direction, self.cycles_per_mm) * self.pixels(self.request.pixel_um, direction)
        };
        let meridian = item.angles().meridian_rad();
        Ok((modulation(meridian), modulation(meridian + FRAC_PI_2)))
    }

    /// Returns the modulation that square pixels leave of a wave along a direction from +x.
    fn pixels(&self, pitch_um: f64, direction: f64) -> f64 {
        let side = |share: f64| {
            let x = std::f64::consts::PI * 1e-3 * pitch_um * self.cycles_per_mm * share;
            if x == 0.0 { 1.0 } else { (x.sin() / x).abs() }
        };
        side(direction.cos()) * side(direction.sin())
    }
}

/// Returns the side of the pixels on which a modulation is computed, µm: those asked for where the blur is small, up to
/// an eighth of a period where it is large.
fn pitch_um(asked_um: f64, cycles_per_mm: f64, reach_um: f64) -> f64 {
    let coarsest_um = 1e3 / (PIXELS_A_PERIOD * cycles_per_mm);
    // A blur of fewer pixels costs nothing, and what is sharper than a pixel would be read off wrongly.
    let fine_um = reach_um / 32.0;
    asked_um.max(coarsest_um.min(fine_um))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_stay_small_whatever_the_blur() {
        for (cycles_per_mm, reach_um) in [(30.0, 0.5), (30.0, 40.0), (30.0, 900.0), (2.0, 900.0), (200.0, 3000.0)] {
            let pitch = pitch_um(0.1, cycles_per_mm, reach_um);
            let held_px = (2.0 * reach_um / pitch).min(LARGEST_WINDOW as f64);
            assert!(pitch >= 0.1 && pitch <= 1e3 / (8.0 * cycles_per_mm), "{pitch}");
            // The window is cut only where it holds 75 periods.
            assert!(held_px <= 64.0 + 1e-9 || pitch * held_px * 1e-3 * cycles_per_mm <= 75.2, "{held_px} of {pitch}");
        }
        assert_eq!(pitch_um(5.0, 30.0, 900.0), 5.0);
    }
}
