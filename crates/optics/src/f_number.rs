//! Stopping a lens down: to a diameter, or to an f-number.

use crate::{Lens, OpticsError, glass::D_LINE_NM, lens::positive};

/// The wavelength at which a message states an f-number, nm.
const MESSAGE_WAVELENGTH_NM: f64 = D_LINE_NM;

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

    /// Returns the lens stopped down to this f-number (for a far object) at this wavelength.
    ///
    /// # Errors
    /// When the f-number is not positive or below that of the full stop, or of what the rims let through.
    pub fn with_f_number(&self, f_number: f64, wavelength_nm: f64) -> Result<Self, OpticsError> {
        positive("an f-number", f_number)?;
        let now = self.at(wavelength_nm)?.first_order_of_stop().f_number;
        let full = self.with_stop_semi_aperture_mm(self.full_stop_semi_aperture_mm()).at(wavelength_nm)?;
        if let Some(beam) = full.limiting_beam().filter(|_| f_number < full.first_order().f_number * (1.0 - 1e-3)) {
            return Err(OpticsError::RimsTooNarrow {
                lens: self.name().to_owned(),
                asked: f_number,
                surface: beam.limiting_surface,
                smallest: full.first_order().f_number,
            });
        }
        self.with_stop_diameter_mm(2.0 * self.stop_semi_aperture_mm() * now / f_number)
    }
}
