//! The blades of the stop on the command line.

use anyhow::bail;
use clap::Args;
use dioptric_pipeline::Iris;

/// Which blades close the stop.
#[derive(Clone, Copy, Debug, Args)]
#[command(next_help_heading = "Lens")]
pub(crate) struct IrisArgs {
    /// Closes the stop by so many blades, 3 to 64: round only where it is fully open
    #[arg(long, value_name = "N")]
    blades: Option<u32>,
    /// Turns the opening of the blades by this angle from one with a corner at its top, degrees
    #[arg(long, value_name = "A")]
    blade_rotation_deg: Option<f64>,
    /// How much the edges of the blades are curved, 0 (straight) to 1 (as the rim of the fully open stop)
    #[arg(long, value_name = "C")]
    blade_curvature: Option<f64>,
}

impl IrisArgs {
    /// Changes what was asked for.
    pub(crate) fn change(self, iris: &mut Option<Iris>) -> anyhow::Result<()> {
        if let Some(blades) = self.blades {
            let Iris { rotation_deg, curvature, .. } =
                iris.unwrap_or(Iris { blades, rotation_deg: 0.0, curvature: 0.0 });
            *iris = Some(Iris { blades, rotation_deg, curvature });
        }
        let Some(iris) = iris else {
            if self.blade_rotation_deg.is_some() || self.blade_curvature.is_some() {
                bail!("--blade-rotation-deg and --blade-curvature are of blades, expected with --blades");
            }
            return Ok(());
        };
        iris.rotation_deg = self.blade_rotation_deg.unwrap_or(iris.rotation_deg);
        iris.curvature = self.blade_curvature.unwrap_or(iris.curvature);
        Ok(())
    }
}
