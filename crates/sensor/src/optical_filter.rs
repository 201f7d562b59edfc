//! Filters before a lens: measured ones, and some that have a closed form.

use std::{f64::consts::PI, path::Path};

use dioptric_spectrum::{Illuminant, Observer, Spectrum, WavelengthGrid};
use serde::{Deserialize, Serialize};

use crate::{Layer, Sensor, SensorError, ron_file, white_light::fine_grid};

/// The names of the built-in filters and their data.
const BUILT_IN: [(&str, &str); 22] = [
    ("wratten-2b", include_str!("../data/filters/wratten-2b.ron")),
    ("wratten-8", include_str!("../data/filters/wratten-8.ron")),
    ("wratten-12", include_str!("../data/filters/wratten-12.ron")),
    ("wratten-15", include_str!("../data/filters/wratten-15.ron")),
    ("wratten-21", include_str!("../data/filters/wratten-21.ron")),
    ("wratten-25", include_str!("../data/filters/wratten-25.ron")),
    ("wratten-29", include_str!("../data/filters/wratten-29.ron")),
    ("wratten-44", include_str!("../data/filters/wratten-44.ron")),
    ("wratten-47", include_str!("../data/filters/wratten-47.ron")),
    ("wratten-47b", include_str!("../data/filters/wratten-47b.ron")),
    ("wratten-58", include_str!("../data/filters/wratten-58.ron")),
    ("wratten-61", include_str!("../data/filters/wratten-61.ron")),
    ("wratten-80a", include_str!("../data/filters/wratten-80a.ron")),
    ("wratten-81a", include_str!("../data/filters/wratten-81a.ron")),
    ("wratten-81ef", include_str!("../data/filters/wratten-81ef.ron")),
    ("wratten-82a", include_str!("../data/filters/wratten-82a.ron")),
    ("wratten-82c", include_str!("../data/filters/wratten-82c.ron")),
    ("wratten-85", include_str!("../data/filters/wratten-85.ron")),
    ("wratten-87", include_str!("../data/filters/wratten-87.ron")),
    ("wratten-87c", include_str!("../data/filters/wratten-87c.ron")),
    ("wratten-88a", include_str!("../data/filters/wratten-88a.ron")),
    ("wratten-89b", include_str!("../data/filters/wratten-89b.ron")),
];

/// The wavelengths between which closed forms are tabulated, nm.
const RANGE_NM: (f64, f64) = (100.0, 20_000.0);
/// Half the width of the step of an ideal edge, nm.
const STEP_NM: f64 = 1e-6;

/// A filter that light passes before it reaches a sensor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OpticalFilter {
    /// What to call it.
    pub name: String,
    /// Where the numbers come from.
    pub source: String,
    /// The share of light that passes, reflection at its surfaces included; the ends of the table are held.
    pub transmittance: Spectrum,
}

impl OpticalFilter {
    /// Returns the names of the built-in filters.
    pub fn built_in_names() -> impl Iterator<Item = &'static str> {
        BUILT_IN.iter().map(|(name, _)| *name)
    }

    /// Returns a built-in filter.
    ///
    /// # Errors
    /// When none has that name.
    pub fn built_in(name: &str) -> Result<Self, SensorError> {
        match BUILT_IN.iter().find(|(known, _)| *known == name) {
            Some((_, text)) => Self::from_ron(text, name),
            None => {
                let known = Self::built_in_names().collect::<Vec<_>>().join(", ");
                Err(SensorError::UnknownFilter { name: name.to_owned(), known })
            }
        }
    }

    /// Reads a filter from a RON file.
    ///
    /// # Errors
    /// Names the file and line that cannot be read, or the value that is no share.
    pub fn read(path: &Path) -> Result<Self, SensorError> {
        Self::from_ron(&ron_file::read_text(path)?, &path.display().to_string())
    }

    /// Returns the filter of a file's text; `origin` names it in errors.
    ///
    /// # Errors
    /// Names the line that cannot be read, or the value that is no share.
    pub fn from_ron(text: &str, origin: &str) -> Result<Self, SensorError> {
        let filter: Self = ron_file::parse(text, origin)?;
        match filter.transmittance.values().iter().find(|v| !(0.0..=1.0).contains(*v)) {
            Some(&value) => Err(SensorError::value(origin, "transmittance", value, "shares from 0 to 1")),
            None => Ok(filter),
        }
    }

    /// Returns the filter as RON text, which reads back the same.
    pub fn to_ron(&self) -> String {
        ron_file::write(self)
    }

    /// A neutral filter of an optical density D: 10^−D of all light passes.
    ///
    /// # Errors
    /// When the density is below 0 or not finite.
    pub fn neutral_density(density: f64) -> Result<Self, SensorError> {
        check("density", density, density >= 0.0, "a number of 0 or more")?;
        let value = 10.0_f64.powf(-density);
        Ok(Self::even(format!("neutral density {density}"), "10^(-density)", value))
    }

    /// An ideal linear polarizer in unpolarized light, half of which passes. Light has no polarization in this program.
    pub fn polarizer() -> Self {
        Self::even("polarizer".to_owned(), "an ideal polarizer in unpolarized light", 0.5)
    }

    /// Two ideal linear polarizers, their axes at an angle: cos² of it of the half that the first lets through (Malus).
    ///
    /// # Errors
    /// When the angle is not from 0 to 90°.
    pub fn polarizers(angle_deg: f64) -> Result<Self, SensorError> {
        check("angle_deg", angle_deg, (0.0..=90.0).contains(&angle_deg), "0 to 90 degrees")?;
        let value = 0.5 * (angle_deg * PI / 180.0).cos().powi(2);
        Ok(Self::even(format!("polarizers at {angle_deg} degrees"), "Malus's law in unpolarized light", value))
    }

    /// An ideal edge that passes what is longer than a wavelength, nm.
    ///
    /// # Errors
    /// When the wavelength is not within 100 to 20,000 nm.
    pub fn long_pass(edge_nm: f64) -> Result<Self, SensorError> {
        Self::steps(format!("long pass from {edge_nm} nm"), 0.0, &[edge_nm])
    }

    /// An ideal edge that passes what is shorter than a wavelength, nm: an infrared cut.
    ///
    /// # Errors
    /// When the wavelength is not within 100 to 20,000 nm.
    pub fn short_pass(edge_nm: f64) -> Result<Self, SensorError> {
        Self::steps(format!("short pass to {edge_nm} nm"), 1.0, &[edge_nm])
    }

    /// An ideal band of a width about a wavelength, nm.
    ///
    /// # Errors
    /// When its edges do not ascend within 100 to 20,000 nm.
    pub fn band_pass(center_nm: f64, width_nm: f64) -> Result<Self, SensorError> {
        check("width_nm", width_nm, width_nm > 0.01, "a number above 0.01")?;
        let edges_nm = [center_nm - 0.5 * width_nm, center_nm + 0.5 * width_nm];
        Self::steps(format!("band of {width_nm} nm about {center_nm} nm"), 0.0, &edges_nm)
    }

    /// A plane plate of glass in air, crossed along its normal: (1 − R)² τ / (1 − R² τ²) with R = ((n − 1) / (n + 1))² at each surface
    /// (Fresnel) and τ what the glass itself lets through (Bouguer), all reflections between the surfaces added up.
    ///
    /// `glass` has a wavelength, nm, the index there and the internal transmittance of the plate in each row.
    ///
    /// # Errors
    /// When the wavelengths do not ascend or a transmittance is no share.
    pub fn plate(name: String, source: String, glass: &[[f64; 3]]) -> Result<Self, SensorError> {
        let share = |&[_, index, internal]: &[f64; 3]| {
            let reflected = ((index - 1.0) / (index + 1.0)).powi(2);
            (1.0 - reflected).powi(2) * internal / (1.0 - (reflected * internal).powi(2))
        };
        let (wavelengths_nm, values) = (glass.iter().map(|row| row[0]).collect(), glass.iter().map(share).collect());
        Ok(Self { name, source, transmittance: Spectrum::new(wavelengths_nm, values)? })
    }

    /// The share of a light that passes as an eye sees it: ∫ τ S V dλ / ∫ S V dλ, with the ȳ of the 1931 observer.
    pub fn luminous_transmittance(&self, light: &Illuminant) -> f64 {
        let grid = fine_grid();
        let spectrum = light.on_bands(&grid);
        let passed: Vec<f64> =
            self.transmittance.sample_held(&grid).iter().zip(&spectrum).map(|(t, s)| t * s).collect();
        let [whole, passed] = [&spectrum, &passed].map(|of| Observer::Cie1931.xyz(&grid, of).luminance_cd_m2());
        passed / whole
    }

    /// Returns a sentence where bands lie beyond the table, whose end is held there.
    pub fn note_beyond_table(&self, grid: &WavelengthGrid) -> Option<String> {
        let ((first_nm, last_nm), (from_nm, to_nm)) = (self.transmittance.range_nm(), grid.range_nm());
        (from_nm < first_nm || to_nm > last_nm).then(|| {
            format!(
                "the transmittance of {} is known from {first_nm} to {last_nm} nm, and its ends are held in the bands beyond, which \
                 reach from {from_nm} to {to_nm} nm",
                self.name
            )
        })
    }

    fn even(name: String, source: &str, value: f64) -> Self {
        let transmittance = Spectrum::new(vec![RANGE_NM.0, RANGE_NM.1], vec![value; 2]).expect("two points");
        Self { name, source: source.to_owned(), transmittance }
    }

    /// Returns a filter that passes a share of `first`, 0 or 1, up to the first edge, and the other behind each edge.
    fn steps(name: String, first: f64, edges_nm: &[f64]) -> Result<Self, SensorError> {
        let (mut wavelengths_nm, mut values) = (vec![RANGE_NM.0], vec![first]);
        for &edge_nm in edges_nm {
            check("edge_nm", edge_nm, RANGE_NM.0 < edge_nm && edge_nm < RANGE_NM.1, "100 to 20000 nm")?;
            let before = values[values.len() - 1];
            wavelengths_nm.extend([edge_nm - STEP_NM, edge_nm + STEP_NM]);
            values.extend([before, 1.0 - before]);
        }
        wavelengths_nm.push(RANGE_NM.1);
        values.push(values[values.len() - 1]);
        let transmittance = Spectrum::new(wavelengths_nm, values)?;
        Ok(Self { name, source: "an ideal filter".to_owned(), transmittance })
    }
}

impl Sensor {
    /// Returns the sensor behind filters, whose transmittances multiply every quantum efficiency.
    #[must_use]
    pub fn behind(&self, filters: &[OpticalFilter]) -> Self {
        let layer =
            |filter: &OpticalFilter| Layer { name: filter.name.clone(), transmittance: filter.transmittance.clone() };
        let mut behind = self.clone();
        behind.filter_stack.extend(filters.iter().map(layer));
        behind
    }
}

fn check(key: &str, value: f64, is_right: bool, expected: &'static str) -> Result<(), SensorError> {
    if is_right && value.is_finite() { Ok(()) } else { Err(SensorError::value("the filter", key, value, expected)) }
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;

    fn under(filter: &OpticalFilter, light: &Illuminant) -> (f64, f64) {
        let grid = fine_grid();
        let light = light.on_bands(&grid);
        let passed: Vec<f64> = filter.transmittance.sample_held(&grid).iter().zip(light).map(|(t, s)| t * s).collect();
        let [x, y, z] = Observer::Cie1931.xyz(&grid, &passed).0;
        (x / (x + y + z), y / (x + y + z))
    }

    #[test]
    fn built_in_filters_state_sources_and_read_back() {
        assert!(OpticalFilter::built_in_names().count() >= 20);
        for name in OpticalFilter::built_in_names() {
            let filter = OpticalFilter::built_in(name).unwrap();
            assert!(filter.source.contains("Kodak"), "{name}");
            assert_eq!(OpticalFilter::from_ron(&filter.to_ron(), name).unwrap(), filter, "{name}");
        }
        assert!(OpticalFilter::built_in("wratten-1000").unwrap_err().to_string().contains("wratten-25"));
    }

    /// D. L. `MacAdam`, "Colorimetric specifications of Wratten light filters", J. Opt. Soc. Am. 35 (1945), 670: chromaticities under
    /// illuminant C. Dyes were changed since, and 10 nm are coarse for their edges.
    #[test]
    fn tricolor_filters_have_the_published_chromaticities() {
        // Illuminant C: daylight of 6774 K to .003 in x and y, which moves saturated colors by less.
        let light = Illuminant::Daylight(6774.0);
        for (name, (x, y), within) in [
            ("wratten-25", (0.6805, 0.3193), 0.002),
            ("wratten-47", (0.1477, 0.0412), 0.006),
            ("wratten-58", (0.2500, 0.6885), 0.014),
        ] {
            let found = under(&OpticalFilter::built_in(name).unwrap(), &light);
            assert!((found.0 - x).abs() < within && (found.1 - y).abs() < within, "{name}: {found:?}");
        }
    }

    /// The shifts of color temperature that Kodak names, in mired; those of the strong 80A and 85 have become less since this edition.
    #[test]
    fn conversion_filters_shift_color_temperature_as_named() {
        for (name, from_k, mired, within) in [
            ("wratten-80a", 3200.0, -131.0, 20.0),
            ("wratten-81a", 3400.0, 18.0, 4.0),
            ("wratten-81ef", 3400.0, 52.0, 4.0),
            ("wratten-82a", 3000.0, -21.0, 4.0),
            ("wratten-82c", 3000.0, -45.0, 4.0),
            ("wratten-85", 5500.0, 112.0, 20.0),
        ] {
            let found = under(&OpticalFilter::built_in(name).unwrap(), &Illuminant::Blackbody(from_k));
            // McCamy, "Correlated color temperature as an explicit function of chromaticity coordinates", Color Res. Appl. 17 (1992): to 2 mired.
            let n = (found.0 - 0.3320) / (0.1858 - found.1);
            let to_k = 449.0 * n.powi(3) + 3525.0 * n.powi(2) + 6823.3 * n + 5520.33;
            let shift = 1e6 / to_k - 1e6 / from_k;
            assert!((shift - mired).abs() < within, "{name}: {shift:.1} mired, not {mired}");
        }
    }

    #[test]
    fn closed_forms_are_theirs() {
        let at = |filter: &OpticalFilter, nm: f64| filter.transmittance.at_held(nm);
        let density = OpticalFilter::neutral_density(0.9).unwrap();
        assert_relative_eq!(at(&density, 550.0), 0.125_892_5, max_relative = 1e-6);
        assert_relative_eq!(density.luminous_transmittance(&Illuminant::A), 0.125_892_5, max_relative = 1e-6);
        assert_relative_eq!(at(&OpticalFilter::polarizers(60.0).unwrap(), 500.0), 0.125, max_relative = 1e-12);
        assert_eq!(at(&OpticalFilter::polarizer(), 500.0), 0.5);
        let band = OpticalFilter::band_pass(550.0, 40.0).unwrap();
        assert_eq!([529.9, 530.1, 569.9, 570.1].map(|nm| at(&band, nm)), [0.0, 1.0, 1.0, 0.0]);
        let (long, short) = (OpticalFilter::long_pass(590.0).unwrap(), OpticalFilter::short_pass(590.0).unwrap());
        for nm in [400.0, 589.9, 590.1, 900.0] {
            assert_relative_eq!(at(&long, nm) + at(&short, nm), 1.0, max_relative = 1e-12);
        }
        // Glass of 1.5: 4 % a surface; of two surfaces 7.69 % in all, 2n / (n² + 1) passing.
        let clear = OpticalFilter::plate("n = 1.5".to_owned(), String::new(), &[[550.0, 1.5, 1.0]]).unwrap();
        assert_relative_eq!(at(&clear, 550.0), 3.0 / 3.25, max_relative = 1e-12);
        assert!(OpticalFilter::neutral_density(-1.0).unwrap_err().to_string().contains("density"));
        assert!(OpticalFilter::band_pass(550.0, -3.0).is_err() && OpticalFilter::long_pass(f64::NAN).is_err());
    }

    #[test]
    fn a_filter_multiplies_quantum_efficiency() {
        let sensor = Sensor::built_in("imx363").unwrap();
        let grid = WavelengthGrid::uniform(400.0, 700.0, 10.0).unwrap();
        let filters = [OpticalFilter::neutral_density(0.3).unwrap(), OpticalFilter::short_pass(645.0).unwrap()];
        let (bare, behind) = (sensor.electron_weights(&grid), sensor.behind(&filters).electron_weights(&grid));
        for (bare, behind) in bare.iter().zip(&behind) {
            for (band, (bare, behind)) in bare.iter().zip(behind).enumerate() {
                let share = if band < 25 { 10f64.powf(-0.3) } else { 0.0 };
                // The band about 640 nm ends at the edge, that about 650 nm begins there.
                assert!((behind - share * bare).abs() <= 1e-9 * bare, "{band}: {behind} {bare}");
            }
        }
    }

    #[test]
    fn shares_beyond_one_are_named() {
        let text = OpticalFilter::polarizer().to_ron().replace("0.5", "1.5");
        let message = OpticalFilter::from_ron(&text, "mine.ron").unwrap_err().to_string();
        assert!(message.contains("mine.ron") && message.contains("1.5"), "{message}");
        let grid = WavelengthGrid::uniform(400.0, 900.0, 10.0).unwrap();
        let note = OpticalFilter::built_in("wratten-25").unwrap().note_beyond_table(&grid).unwrap();
        assert!(note.contains("700") && note.contains("900"), "{note}");
        assert_eq!(OpticalFilter::polarizer().note_beyond_table(&grid), None);
    }
}
