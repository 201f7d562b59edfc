//! Pixels of two or four photodiodes below one microlens, each read by itself.

use std::{fmt, str::FromStr};

use dioptric_psf::{Diffraction, PupilDivision, PupilSides, Sides};
use dioptric_sensor::DisparityAxis;
use serde::{Deserialize, Serialize};

use super::{BlurSpec, Camera, FramesSpec, Photodiodes, SceneSource, check::Checker};
use crate::PipelineError;

/// The share of light from far on one side of the pupil that the photodiode of the other side gets, where nothing else is said.
const CROSSTALK: f64 = 0.05;
/// Standard deviation of the boundary over the angle of incidence, degrees, where nothing else is said.
const TRANSITION_DEG: f64 = 3.0;

/// Pixels of several photodiodes below one microlens, each of which sees a part of the exit pupil and is read by itself.
///
/// The frame is the sum of the reads. As a word it is `left-right`, `left-right:0.05` with its crosstalk, or `left-right:0.05:3` with the
/// transition in degrees too.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct DualPixelSpec {
    /// Which parts of the pupil they see.
    pub photodiodes: Photodiodes,
    /// The share of light from far on one side of the pupil that the photodiode of the other side gets, 0 to .5; at .5 both see the whole pupil.
    #[serde(default = "crosstalk")]
    pub crosstalk: f64,
    /// How soft the boundary between the sides is: standard deviation over the angle of incidence at the pixel, degrees, 0 to 45. The
    /// narrower the lens's cone of light, the less of it lies beyond.
    #[serde(default = "transition_deg")]
    pub transition_deg: f64,
}

fn crosstalk() -> f64 {
    CROSSTALK
}

fn transition_deg() -> f64 {
    TRANSITION_DEG
}

impl DualPixelSpec {
    /// Photodiodes of the usual crosstalk and transition.
    pub fn of(photodiodes: Photodiodes) -> Self {
        Self { photodiodes, crosstalk: CROSSTALK, transition_deg: TRANSITION_DEG }
    }

    /// Returns how the pupil of a lens of a working f-number is shared.
    pub fn pupil_division(&self, working_f_number: f64) -> PupilDivision {
        let sides = match self.photodiodes {
            Photodiodes::LeftRight => Sides::LeftRight,
            Photodiodes::TopBottom => Sides::TopBottom,
            Photodiodes::Quad => Sides::Quarters,
        };
        // The edge of the pupil is seen at the sine of 1 / (2 N).
        let transition = 2.0 * working_f_number * self.transition_deg.to_radians().sin();
        PupilSides { sides, crosstalk: self.crosstalk, transition }.into()
    }

    /// Returns how far the centroids of the two halves lie apart in an evenly lit pupil, radii of the pupil: 8/(3π) = .849 without crosstalk.
    pub fn centroid_separation(&self, working_f_number: f64) -> f64 {
        let division = self.pupil_division(working_f_number);
        let [first, second] = self.photodiodes.halves().map(|half| division.centroid(half[0]));
        match self.photodiodes.disparity_axis() {
            DisparityAxis::Columns => second.x - first.x,
            DisparityAxis::Rows => first.y - second.y,
        }
    }

    /// Returns the defocus on the film that moves the halves apart by one pixel, µm; 0 where they are not apart at all.
    pub fn defocus_um_per_px(&self, working_f_number: f64, pitch_um: f64) -> Option<f64> {
        let separation = self.centroid_separation(working_f_number);
        (separation > 0.0).then(|| 2.0 * working_f_number * pitch_um / separation)
    }

    /// Checks the numbers, and that the rest of the camera allows photodiodes that see parts of the pupil.
    pub(super) fn check(&self, camera: &Camera, checker: &Checker<'_>) -> Result<(), PipelineError> {
        if !(0.0..=0.5).contains(&self.crosstalk) {
            checker.wrong("crosstalk", &self.crosstalk.to_string(), "a share from 0 to 0.5")?;
        }
        if !(0.0..=45.0).contains(&self.transition_deg) {
            checker.wrong("transition_deg", &self.transition_deg.to_string(), "0 to 45 degrees")?;
        }
        let with = |what: &str| format!("{what}, with dual_pixel");
        if camera.diffraction == Diffraction::Wave {
            checker.wrong("diffraction", "Wave", &with("HURB or no diffraction"))?;
        }
        if let BlurSpec::Views(_) = camera.blur {
            checker.wrong("blur", &camera.blur.to_string(), &with("layered or pointwise"))?;
        }
        if matches!(
            camera.frames,
            FramesSpec::MovingBurst { .. } | FramesSpec::BothGains | FramesSpec::Interleaved { .. }
        ) {
            checker.wrong("frames", "MovingBurst, BothGains or Interleaved", &with("Single, Burst or BracketStops"))?;
        }
        if camera.light_field.is_some() {
            checker.wrong("light_field", "a light-field camera", &with("none"))?;
        }
        if let SceneSource::World(world) = &camera.scene.source
            && world.backward().is_some()
        {
            checker.wrong("method", "Backward", &with("Forward: the view is imaged through parts of the pupil"))?;
        }
        Ok(())
    }
}

impl fmt::Display for DualPixelSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Photodiodes::NAMES.iter().find(|(_, kind)| *kind == self.photodiodes).map_or("", |(name, _)| name);
        f.write_str(name)?;
        if *self != Self::of(self.photodiodes) {
            write!(f, ":{}", self.crosstalk)?;
        }
        if self.transition_deg != TRANSITION_DEG { write!(f, ":{}", self.transition_deg) } else { Ok(()) }
    }
}

impl FromStr for DualPixelSpec {
    type Err = PipelineError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let mut parts = text.split(':');
        let mut read = || -> Option<Self> {
            let name = parts.next()?;
            let (_, photodiodes) = Photodiodes::NAMES.iter().find(|(known, _)| *known == name)?;
            let mut number = |usual: f64| parts.next().map_or(Some(usual), |part| part.parse().ok());
            let (crosstalk, transition_deg) = (number(CROSSTALK)?, number(TRANSITION_DEG)?);
            parts.next().is_none().then_some(Self { photodiodes: *photodiodes, crosstalk, transition_deg })
        };
        read().ok_or_else(|| {
            let reason = format!(
                "found '{text}', expected left-right, top-bottom or quad, with crosstalk and transition in degrees if \
                 they are others than the usual: left-right:{CROSSTALK}:{TRANSITION_DEG}"
            );
            PipelineError::Unsuitable { what: "dual pixel", reason }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_read_as_they_are_written() {
        for photodiodes in [Photodiodes::LeftRight, Photodiodes::TopBottom, Photodiodes::Quad] {
            for (crosstalk, transition_deg) in [(CROSSTALK, TRANSITION_DEG), (0.1, TRANSITION_DEG), (0.0, 0.0)] {
                let spec = DualPixelSpec { photodiodes, crosstalk, transition_deg };
                assert_eq!(spec.to_string().parse::<DualPixelSpec>().unwrap(), spec);
            }
        }
        assert_eq!("quad".parse::<DualPixelSpec>().unwrap(), DualPixelSpec::of(Photodiodes::Quad));
        for wrong in ["", "left", "left-right:x", "left-right:0.1:2:3", "left-right:"] {
            let error = wrong.parse::<DualPixelSpec>().unwrap_err().to_string();
            assert!(error.contains("top-bottom"), "{error}");
        }
    }

    #[test]
    fn what_cannot_be_divided_is_named() {
        let check = |change: &dyn Fn(&mut Camera)| {
            let mut camera = Camera::demo().unwrap();
            camera.dual_pixel = Some(DualPixelSpec::of(Photodiodes::LeftRight));
            change(&mut camera);
            camera.validate().map_err(|error| error.to_string())
        };
        assert_eq!(check(&|_| {}), Ok(()));
        let set = |camera: &mut Camera, crosstalk, transition_deg| {
            camera.dual_pixel = Some(DualPixelSpec { photodiodes: Photodiodes::Quad, crosstalk, transition_deg });
        };
        assert!(check(&|camera| set(camera, 0.6, 1.0)).unwrap_err().contains("0 to 0.5"));
        assert!(check(&|camera| set(camera, 0.1, f64::NAN)).unwrap_err().contains("transition_deg"));
        assert!(check(&|camera| camera.diffraction = Diffraction::Wave).unwrap_err().contains("HURB"));
        assert!(check(&|camera| camera.blur = BlurSpec::Views(4)).unwrap_err().contains("layered or pointwise"));
        let frames = FramesSpec::Interleaved { ratio: 4.0, period_rows: 2, gain_ratio: 1.0 };
        assert!(check(&|camera| camera.frames = frames.clone()).unwrap_err().contains("BracketStops"));
    }

    /// A soft boundary of 3° is a seventh of the pupil of f/1.4 and more than half of that of f/5.6.
    #[test]
    fn narrow_cones_are_divided_less() {
        let spec = DualPixelSpec { crosstalk: 0.0, ..DualPixelSpec::of(Photodiodes::LeftRight) };
        let sharp = DualPixelSpec { transition_deg: 0.0, ..spec };
        let ideal = 8.0 / (3.0 * std::f64::consts::PI);
        assert!((sharp.centroid_separation(1.4) / ideal - 1.0).abs() < 1e-4);
        let [fast, slow] = [1.4, 5.6].map(|f_number| spec.centroid_separation(f_number) / ideal);
        assert!(fast > 0.96 && slow < 0.8 && slow > 0.5, "{fast} {slow}");
        // 2 N pitch over .849.
        assert!((sharp.defocus_um_per_px(2.0, 1.4).unwrap() - 5.6 / ideal).abs() < 1e-3);
    }
}
