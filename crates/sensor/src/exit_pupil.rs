//! Where the light of a frame comes from.

use crate::SensorError;

/// Where the exit pupil of the lens stands before the frame, and how wide it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExitPupil {
    /// Its distance before the film, mm; negative where it lies behind the film, infinity for a telecentric lens. The chief ray of a pixel is
    /// the line through both; 0 is refused.
    pub distance_mm: f64,
    /// Where its axis meets the film, mm from the middle of the frame: to the right and down, as the picture is seen.
    pub axis_mm: [f64; 2],
    /// The working f-number of the cone of light that it sends to the axis: 1 / (2 sin U) with U half the angle of the cone, above .5; infinity
    /// for collimated light. Only pixels of a [`PixelStack`](crate::PixelStack) depend on it.
    pub f_number: f64,
}

impl ExitPupil {
    /// Returns a pupil before the middle of the frame, from which chief rays alone come.
    pub fn centered(distance_mm: f64) -> Self {
        Self { distance_mm, axis_mm: [0.0; 2], f_number: f64::INFINITY }
    }

    /// Checks that it is somewhere.
    ///
    /// # Errors
    /// Names the first number that makes no sense.
    pub(crate) fn check(&self) -> Result<(), SensorError> {
        let wrong = |key, value, expected| Err(SensorError::value("the illumination", key, value, expected));
        if self.distance_mm == 0.0 || self.distance_mm.is_nan() {
            return wrong("exit_pupil.distance_mm", self.distance_mm, "a number other than 0, or infinity");
        }
        if self.f_number.is_nan() || self.f_number <= 0.5 {
            return wrong("exit_pupil.f_number", self.f_number, "a number above 0.5");
        }
        match self.axis_mm.into_iter().find(|mm| !mm.is_finite()) {
            Some(mm) => wrong("exit_pupil.axis_mm", mm, "a finite number"),
            None => Ok(()),
        }
    }

    /// Returns the tangents of the chief ray's angles at a place, mm to the right of the middle of the frame and down: positive where light
    /// travels to the right and down.
    pub(crate) fn chief_slope(&self, place_mm: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|i| (place_mm[i] - self.axis_mm[i]) / self.distance_mm)
    }

    /// Returns the tangent of half the angle of the cone on the axis.
    pub(crate) fn cone_tangent(&self) -> f64 {
        (4.0 * self.f_number * self.f_number - 1.0).sqrt().recip()
    }
}
