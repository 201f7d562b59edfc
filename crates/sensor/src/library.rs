//! Built-in sensors, and sensors from files.

use std::path::Path;

use crate::{Sensor, SensorError, ron_file};

/// The names of the built-in sensors and their data sheets: ideal ones, cameras, machine vision, microscopes, astronomy.
const BUILT_IN: [(&str, &str); 30] = [
    ("ideal", include_str!("../data/ideal.ron")),
    ("ideal-mono", include_str!("../data/ideal-mono.ron")),
    ("imx363", include_str!("../data/imx363.ron")),
    ("mt9v024", include_str!("../data/mt9v024.ron")),
    ("nikon-d100", include_str!("../data/nikon-d100.ron")),
    ("nikon-d5100", include_str!("../data/nikon-d5100.ron")),
    ("sony-a7r2", include_str!("../data/sony-a7r2.ron")),
    ("machine-vision-mono", include_str!("../data/machine-vision-mono.ron")),
    ("imx174", include_str!("../data/imx174.ron")),
    ("imx178", include_str!("../data/imx178.ron")),
    ("imx183", include_str!("../data/imx183.ron")),
    ("imx226", include_str!("../data/imx226.ron")),
    ("imx250", include_str!("../data/imx250.ron")),
    ("imx900", include_str!("../data/imx900.ron")),
    ("cmv4000", include_str!("../data/cmv4000.ron")),
    ("kac-12040", include_str!("../data/kac-12040.ron")),
    ("kai-02170", include_str!("../data/kai-02170.ron")),
    ("python-5000", include_str!("../data/python-5000.ron")),
    ("scmos", include_str!("../data/scmos.ron")),
    ("gsense400bsi", include_str!("../data/gsense400bsi.ron")),
    ("gsense4040bsi", include_str!("../data/gsense4040bsi.ron")),
    ("gsense6510bsi", include_str!("../data/gsense6510bsi.ron")),
    ("hwk4123", include_str!("../data/hwk4123.ron")),
    ("icx285", include_str!("../data/icx285.ron")),
    ("imx455", include_str!("../data/imx455.ron")),
    ("imx492", include_str!("../data/imx492.ron")),
    ("ccd42-80", include_str!("../data/ccd42-80.ron")),
    ("ccd44-82", include_str!("../data/ccd44-82.ron")),
    ("cis115", include_str!("../data/cis115.ron")),
    ("wfc3-uvis", include_str!("../data/wfc3-uvis.ron")),
];

impl Sensor {
    /// Returns the names of the built-in sensors.
    pub fn built_in_names() -> impl Iterator<Item = &'static str> {
        BUILT_IN.iter().map(|(name, _)| *name)
    }

    /// Returns a built-in sensor.
    ///
    /// # Errors
    /// When none has that name.
    pub fn built_in(name: &str) -> Result<Self, SensorError> {
        match BUILT_IN.iter().find(|(known, _)| *known == name) {
            Some((_, text)) => Self::from_ron(text, name),
            None => {
                let known = Self::built_in_names().collect::<Vec<_>>().join(", ");
                Err(SensorError::Unknown { name: name.to_owned(), known })
            }
        }
    }

    /// Reads a data sheet from a RON file.
    ///
    /// # Errors
    /// Names the file and line that cannot be read, or the field whose value makes no sense.
    pub fn read(path: &Path) -> Result<Self, SensorError> {
        Self::from_ron(&ron_file::read_text(path)?, &path.display().to_string())
    }

    /// Returns the sensor of a data sheet's text; `origin` names it in errors.
    ///
    /// # Errors
    /// Names the line that cannot be read, or the field whose value makes no sense.
    pub fn from_ron(text: &str, origin: &str) -> Result<Self, SensorError> {
        let sensor: Self = ron_file::parse(text, origin)?;
        sensor.check()?;
        Ok(sensor)
    }

    /// Returns the data sheet as RON text, which reads back the same.
    pub fn to_ron(&self) -> String {
        ron_file::write(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_built_in_sensor_makes_sense_and_reads_back() {
        for name in Sensor::built_in_names() {
            let sensor = Sensor::built_in(name).unwrap();
            assert!(!sensor.source.is_empty(), "{name}");
            assert_eq!(Sensor::from_ron(&sensor.to_ron(), name).unwrap(), sensor, "{name}");
        }
    }

    #[test]
    fn the_sensor_of_figure_4_is_the_papers() {
        let sensor = Sensor::built_in("nikon-d100").unwrap();
        assert_eq!((sensor.rows, sensor.columns, sensor.pixel_pitch_um, sensor.fill_factor), (500, 500, 72.0, 0.45));
        assert_eq!((sensor.swing_v, sensor.full_well_e, sensor.conversion_gain_v_per_e), (1.15, 90_000.0, 1.2778e-5));
        assert_eq!((sensor.prnu_fraction, sensor.adc), (0.002_218, crate::Adc::Analog));
        assert!((sensor.size_mm().0 - 36.0).abs() < 1e-9);
    }

    #[test]
    fn read_noise_may_be_given_in_electrons() {
        let volts = Sensor::built_in("machine-vision-mono").unwrap();
        let read_noise_e = Some(volts.read_noise_v / volts.conversion_gain_v_per_e);
        let electrons = Sensor { read_noise_v: 0.0, read_noise_e, ..volts.clone() };
        electrons.check().unwrap();
        let mode = crate::GainMode::Low;
        assert!((electrons.read_noise_v(mode) / volts.read_noise_v(mode) - 1.0).abs() < 1e-12);
        assert_eq!(Sensor::from_ron(&electrons.to_ron(), "electrons").unwrap(), electrons);
    }

    #[test]
    fn what_is_wrong_is_named() {
        let good = Sensor::built_in("imx363").unwrap().to_ron();
        let check = |from: &str, to: &str, words: &[&str]| {
            assert!(good.contains(from), "{from}");
            let message = Sensor::from_ron(&good.replace(from, to), "bad.ron").unwrap_err().to_string();
            for word in words {
                assert!(message.contains(word), "'{word}' is not in: {message}");
            }
        };
        check("pixel_pitch_um: 1.4", "pixel_pitch_um: -1.4", &["pixel_pitch_um", "-1.4", "above 0"]);
        check("read_noise_e: None", "read_noise_e: Some(2.0)", &["read_noise_v", "read_noise_e"]);
        check("pixel_pitch_um: 1.4", "pixel_pitch_mm: 1.4", &["bad.ron:6", "pixel_pitch_mm"]);
        check("fill_factor: 1.0", "fill_factor: 1.5", &["fill_factor", "1.5", "0 to 1"]);
        check("rows: 3024", "rows: 0", &["rows", "1 or more"]);
        check("bits: 10", "bits: 17", &["adc.bits", "17", "1 to 16"]);
        check("name: \"G\"", "name: \"X\"", &["color filter array", "'G'", "R, X, B"]);
        check("rows: 3024", "rows: many", &["bad.ron:4", "integer"]);
        assert!(Sensor::built_in("imx000").unwrap_err().to_string().contains("imx363"));
        assert!(Sensor::read(Path::new("no/such.ron")).unwrap_err().to_string().contains("such.ron"));
    }
}
