//! Stopping a lens down: to a diameter, or to an f-number.

use crate::{Lens, OpticsError, glass::D_LINE_NM, lens::positive};

/// The wavelength at which a message states an f-number, nm.
const MESSAGE_WAVELENGTH_NM: f64 = D_LINE_NM;
/// By how much of it the widest f-number of a lens may differ from the marked one: lenses are marked with round numbers, and a twentieth is what we
/// take to be rounding.
const MARKED: f64 = 0.05;
/// By how much of it an f-number may differ from another for both to be the same: numbers are printed with four digits.
const SAME: f64 = 1e-3;

impl Lens {
    /// Returns the lens with its stop set to this diameter.
    ///
    /// # Errors
    /// When the diameter is not positive or wider than the prescription's stop.
    pub fn with_stop_diameter_mm(&self, diameter_mm: f64) -> Result<Self, OpticsError> {
        let semi_aperture_mm = 0.5 * positive("the diameter of a stop in mm", diameter_mm)?;
        let full_mm = self.full_stop_semi_aperture_mm();
        // A diameter that came from the full stop by way of its f-number may be off by rounding.
        if semi_aperture_mm > full_mm * (1.0 + 1e-9) {
            let full = self.with_stop_semi_aperture_mm(full_mm);
            return Err(OpticsError::StopTooWide {
                lens: self.name().to_owned(),
                asked_mm: diameter_mm,
                largest_mm: 2.0 * full_mm,
                smallest_f_number: full.at(MESSAGE_WAVELENGTH_NM).map_or(f64::NAN, |lens| lens.first_order().f_number),
            });
        }
        Ok(self.with_stop_semi_aperture_mm(semi_aperture_mm))
    }

    /// Returns the lens stopped down to this f-number (for a far object) at this wavelength; fully open where that is no more than
    /// 5 % above it, since lenses are marked with round numbers ([`note_on_f_number`](Self::note_on_f_number)).
    ///
    /// # Errors
    /// When the f-number is not positive, the lens has none by its stop (telecentric or afocal), or it is further below that of the full stop, or of what the rims let through.
    pub fn with_f_number(&self, f_number: f64, wavelength_nm: f64) -> Result<Self, OpticsError> {
        positive("an f-number", f_number)?;
        let first = self.at(wavelength_nm)?.first_order_of_stop();
        let now = first.f_number;
        if now == 0.0 || !now.is_finite() {
            let is_telecentric = first.power_per_mm != 0.0;
            return Err(OpticsError::NoFNumber {
                lens: self.name().to_owned(),
                reason: if is_telecentric { "its entrance pupil is infinitely far" } else { "it has no focal length" },
            });
        }
        let (full, smallest) = self.fully_open(wavelength_nm)?;
        if f_number < smallest * (1.0 - MARKED) {
            return Err(OpticsError::FNumberTooSmall {
                lens: self.name().to_owned(),
                asked: f_number,
                smallest,
                rim: full.at(wavelength_nm)?.limiting_beam().map(|beam| beam.limiting_surface),
            });
        }
        match f_number < smallest * (1.0 - SAME) {
            true => Ok(full),
            // The full stop where rounding asks for more.
            false => Ok(self.with_stop_semi_aperture_mm(self.stop_semi_aperture_mm() * now / f_number)),
        }
    }

    /// Returns a sentence where [`with_f_number`](Self::with_f_number) takes the fully open lens for an f-number below its own.
    pub fn note_on_f_number(&self, f_number: f64, wavelength_nm: f64) -> Option<String> {
        let (_, smallest) = self.fully_open(wavelength_nm).ok()?;
        ((1.0 - MARKED)..(1.0 - SAME)).contains(&(f_number / smallest)).then(|| {
            format!("f/{f_number} is taken for the widest opening of {}, which is f/{smallest:.3}", self.name())
        })
    }

    /// Returns the lens with its stop fully open, and the f-number that it then has.
    fn fully_open(&self, wavelength_nm: f64) -> Result<(Self, f64), OpticsError> {
        let full = self.with_stop_semi_aperture_mm(self.full_stop_semi_aperture_mm());
        let smallest = full.at(wavelength_nm)?.first_order().f_number;
        Ok((full, smallest))
    }
}
