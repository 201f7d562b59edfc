//! The light on a scene, and a scene under another light.

use dioptric_spectrum::Illuminant;
use serde::{Deserialize, Serialize};

use crate::{Scene, SceneError};

/// The light on a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneLight {
    /// Its spectrum.
    pub illuminant: Illuminant,
    /// The illuminance of a surface at the place that the light is stated for, lux, where that is known.
    pub illuminance_lux: Option<f64>,
}

impl SceneLight {
    /// Returns a light of an illuminance.
    pub fn new(illuminant: Illuminant, illuminance_lux: f64) -> Self {
        Self { illuminant, illuminance_lux: Some(illuminance_lux) }
    }
}

impl Scene {
    /// Puts the scene under another light: of another spectrum, another illuminance, or both.
    ///
    /// Every radiance is multiplied by new over old, band by band, as if a filter lay over all lights: what is in the shade
    /// stays so, and lamps in the picture change with the rest. It is exact where the whole scene is under one light;
    /// where several mix, the light at the place that is stated becomes the new one, and elsewhere their mixture stays.
    ///
    /// # Errors
    /// When the light on the scene is not known, its illuminance is not where another is wanted, the new light is none, or a
    /// band in which the scene shines had none of the old light.
    pub fn relight(&mut self, illuminant: Option<&Illuminant>, illuminance_lux: Option<f64>) -> Result<(), SceneError> {
        let unknown = |what: &str, instead: &str| SceneError::UnknownLight {
            name: self.name.clone(),
            what: what.to_owned(),
            instead: instead.to_owned(),
        };
        let Some(old) = self.light.clone() else {
            let instead = "state the light that is on it, or choose a white for the picture alone";
            return Err(unknown("light", instead));
        };
        if illuminance_lux.is_some() && old.illuminance_lux.is_none() {
            return Err(unknown("illuminance", "give a mean luminance"));
        }
        if let Some(lux) = illuminance_lux.filter(|lux| !(lux.is_finite() && *lux > 0.0)) {
            return Err(SceneError::Setting {
                what: "the illuminance on the scene",
                value: format!("{lux} lx"),
                expected: "a finite number above 0".to_owned(),
            });
        }
        let new = SceneLight {
            illuminant: illuminant.unwrap_or(&old.illuminant).clone(),
            illuminance_lux: illuminance_lux.or(old.illuminance_lux),
        };
        new.illuminant.check()?;
        if new == old {
            return Ok(());
        }
        let grid = self.radiance.grid().clone();
        let white = |light: &SceneLight| light.illuminant.white_radiance(&grid, light.illuminance_lux.unwrap_or(1.0));
        let (before, after) = (white(&old), white(&new));
        let factors: Vec<f64> = before.iter().zip(&after).map(|(b, a)| if *a == *b { 1.0 } else { a / b }).collect();
        let hidden = self.hidden.as_mut().map(|h| &mut h.radiance);
        for image in std::iter::once(&mut self.radiance).chain(hidden) {
            for ((mut plane, &factor), &nm) in image.planes_mut().zip(&factors).zip(grid.centers_nm()) {
                if factor.is_finite() {
                    plane.mapv_inplace(|v| (f64::from(v) * factor) as f32);
                } else if plane.iter().any(|&v| v > 0.0) {
                    return Err(SceneError::Setting {
                        what: "the light that is on the scene",
                        value: format!("0 at {nm} nm"),
                        expected: "some, because the scene shines there".to_owned(),
                    });
                }
            }
        }
        let note = new.illuminant.note_beyond_table(&grid).filter(|note| !self.notes.contains(note));
        self.notes.extend(note);
        self.light = Some(new);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Pattern, Target, TargetLight};
    use approx::assert_relative_eq;
    use dioptric_spectrum::WavelengthGrid;

    fn chart(light: Illuminant, lux: f64) -> Scene {
        let target = Target {
            pattern: Pattern::ColorChart,
            rows: 24,
            columns: 36,
            light: TargetLight::Illuminant(light),
            luminance_cd_m2: lux / std::f64::consts::PI,
            dark: 0.0,
            supersampling: 2,
            horizontal_fov_deg: 10.0,
            distance_m: 1.0,
        };
        target.scene(&WavelengthGrid::uniform(400.0, 700.0, 10.0).unwrap()).unwrap()
    }

    #[test]
    fn a_relit_scene_is_the_scene_under_that_light() {
        let mut relit = chart(Illuminant::D65, 1000.0);
        relit.relight(Some(&Illuminant::A), Some(5.0)).unwrap();
        let wanted = chart(Illuminant::A, 5.0);
        assert_eq!(relit.light, wanted.light);
        for (a, b) in relit.radiance.planes().iter().zip(wanted.radiance.planes()) {
            for (a, b) in a.iter().zip(b) {
                // Two roundings to single precision.
                assert_relative_eq!(*a, *b, max_relative = 3e-7);
            }
        }
        // Another spectrum alone keeps the illuminance.
        let mut warm = chart(Illuminant::D65, 1000.0);
        warm.relight(Some(&Illuminant::A), None).unwrap();
        assert_relative_eq!(
            warm.mean_luminance_cd_m2(),
            chart(Illuminant::A, 1000.0).mean_luminance_cd_m2(),
            max_relative = 1e-6
        );
    }

    #[test]
    fn unknown_light_is_not_replaced() {
        let mut dark = Scene { light: None, ..chart(Illuminant::E, 10.0) };
        let message = dark.relight(Some(&Illuminant::A), None).unwrap_err().to_string();
        assert!(message.contains("light") && message.contains("not known"), "{message}");
        let mut relative = chart(Illuminant::E, 10.0);
        relative.light = Some(SceneLight { illuminant: Illuminant::E, illuminance_lux: None });
        assert!(relative.relight(None, Some(5.0)).unwrap_err().to_string().contains("illuminance"));
        relative.relight(Some(&Illuminant::D50), None).unwrap();
        assert!(chart(Illuminant::E, 1.0).relight(None, Some(f64::NAN)).is_err());
        assert!(chart(Illuminant::E, 1.0).relight(Some(&Illuminant::Blackbody(-1.0)), None).is_err());
    }
}
