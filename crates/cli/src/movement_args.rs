//! The movements of a view camera on the command line.

use clap::Args;
use dioptric_pipeline::Movements;

/// How the lens is turned about its entrance pupil and moved before the film.
#[derive(Clone, Copy, Debug, Args)]
#[command(next_help_heading = "Movements of the lens")]
pub(crate) struct MovementArgs {
    /// Tilts the lens forwards, degrees: it looks down
    #[arg(long, value_name = "A")]
    tilt_deg: Option<f64>,
    /// Swings the lens to the right, degrees
    #[arg(long, value_name = "A")]
    swing_deg: Option<f64>,
    /// Moves the lens up, mm
    #[arg(long, value_name = "D")]
    rise_mm: Option<f64>,
    /// Moves the lens to the right, mm
    #[arg(long, value_name = "D")]
    shift_mm: Option<f64>,
}

impl MovementArgs {
    /// The movements that were asked for.
    pub(crate) fn movements(self) -> Movements {
        let mut movements = Movements::default();
        self.change(&mut movements);
        movements
    }

    /// Changes what was asked for.
    pub(crate) fn change(self, movements: &mut Movements) {
        *movements = Movements {
            tilt_deg: self.tilt_deg.unwrap_or(movements.tilt_deg),
            swing_deg: self.swing_deg.unwrap_or(movements.swing_deg),
            rise_mm: self.rise_mm.unwrap_or(movements.rise_mm),
            shift_mm: self.shift_mm.unwrap_or(movements.shift_mm),
        };
    }
}
