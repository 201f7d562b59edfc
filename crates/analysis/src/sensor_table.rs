//! The built-in sensors in brief.

use dioptric_pipeline::PipelineError;
use dioptric_sensor::{Cfa, Sensor};
use serde::Serialize;

/// A built-in sensor in brief.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SensorRow {
    /// Its name on the command line and in camera files.
    pub name: String,
    /// What it is.
    pub title: String,
    /// Columns of pixels.
    pub columns: usize,
    /// Rows of pixels.
    pub rows: usize,
    /// Distance between pixels, µm.
    pub pixel_pitch_um: f64,
    /// The filters of the tile, row by row, as `RG/GB`; `stacked` where every pixel has them all.
    pub mosaic: String,
    /// Electrons that a pixel holds.
    pub full_well_e: f64,
    /// Read noise, rms electrons.
    pub read_noise_e: f64,
    /// Where the numbers come from.
    pub source: String,
}

/// Returns the built-in sensors.
///
/// # Errors
/// Never; the built-in sensors are held to by tests.
pub fn built_in_sensors() -> Result<Vec<SensorRow>, PipelineError> {
    Sensor::built_in_names()
        .map(|name| {
            let sensor = Sensor::built_in(name)?;
            Ok(SensorRow {
                name: name.to_owned(),
                read_noise_e: sensor.read_noise_e.unwrap_or(sensor.read_noise_v / sensor.conversion_gain_v_per_e),
                title: sensor.name,
                columns: sensor.columns,
                rows: sensor.rows,
                pixel_pitch_um: sensor.pixel_pitch_um,
                mosaic: match sensor.cfa {
                    Cfa::Mosaic(rows) => rows.iter().map(|row| row.concat()).collect::<Vec<_>>().join("/"),
                    Cfa::Stacked => "stacked".to_owned(),
                },
                full_well_e: sensor.full_well_e,
                source: sensor.source,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn built_in_sensors_have_rows() {
        let rows = built_in_sensors().unwrap();
        let nikon = rows.iter().find(|row| row.name == "nikon-d5100").unwrap();
        assert_eq!((nikon.columns, nikon.rows, nikon.mosaic.as_str()), (4928, 3264, "RG/GB"));
        assert!(rows.iter().all(|row| row.read_noise_e >= 0.0 && row.full_well_e > 0.0));
    }
}
