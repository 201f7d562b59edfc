//! The optics of a pixel: a photodiode below layers and a microlens, and the share of a cone of light that reaches it.
//!
//! The derivation is in docs/pixel-optics.md; equations are numbered there. Lengths are micrometers, places count from the middle of the
//! photodiode to the right and down as the picture is seen, slopes are tangents in air, positive where light travels to the right and down.

mod optics;
mod overlap;
#[cfg(test)]
mod samples;
mod surface;

use serde::{Deserialize, Serialize};

use self::surface::{Surface, sag_um};
use crate::SensorError;

pub(crate) use self::optics::{Cone, PixelOptics};

/// What lies over the photodiode of a pixel, by which the share of a cone of light that reaches it is worked out.
///
/// The top of the stack is a square opening, the share `fill_factor` of the pixel, which the microlens fills or lies in. Light is rays, which
/// spheres and layers refract exactly; a microlens by its focal length is thin and keeps the sine condition. Diffraction is left out, as is what goes on to the photodiodes of other
/// pixels (`optical_crosstalk`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct PixelStack {
    /// The side of the square photodiode in the middle of the pixel, µm, at most the pixel pitch.
    pub photodiode_um: f64,
    /// The layers between microlens and photodiode, from the top down.
    #[serde(default)]
    pub layers: Vec<StackLayer>,
    /// The microlens; left out, the opening is bare.
    #[serde(default)]
    pub microlens: Option<Microlens>,
    /// What the boundaries between layers reflect.
    #[serde(default)]
    pub interfaces: Interfaces,
    /// What the quantum efficiencies of the filters count.
    #[serde(default)]
    pub quantum_efficiency: QuantumEfficiencyOf,
}

/// A layer over the photodiode: planarization, filter, oxide.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct StackLayer {
    /// How thick it is, µm.
    pub thickness_um: f64,
    /// Its refractive index.
    pub index: f64,
}

/// The small lens over a pixel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Microlens {
    /// How strong it is.
    pub power: MicrolensPower,
    /// Which part of the opening it fills.
    #[serde(default)]
    pub outline: MicrolensOutline,
    /// By how much it is shifted towards the axis, pixel by pixel.
    #[serde(default)]
    pub shift: MicrolensShift,
    /// The place of the array above which a microlens is not shifted, mm to the right of its middle and down.
    #[serde(default)]
    pub center_mm: [f64; 2],
}

/// The power of a microlens.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum MicrolensPower {
    /// That which has its focus on the photodiode.
    FocusOnPhotodiode,
    /// By the focal length in air, µm: in a layer of index n the focus is n times as deep.
    FocalLengthUm(f64),
    /// By the radius of curvature of its surface, µm: a sphere on the first layer, of which the lens is made.
    RadiusUm(f64),
}

/// The outline of a microlens. Beside it the opening is flat.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum MicrolensOutline {
    /// All of the opening.
    #[default]
    Gapless,
    /// A square of this side, µm.
    SquareUm(f64),
    /// A disc of this diameter, µm.
    RoundUm(f64),
}

/// How microlenses are shifted against their pixels, so that oblique light still meets the photodiode.
///
/// The opening moves with its lens. A shift that is designed for a chief ray takes it through the middle of the lens to that of the photodiode.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum MicrolensShift {
    /// Not at all.
    #[default]
    None,
    /// For the chief rays of the very lens before the sensor.
    Optimal,
    /// For a lens whose exit pupil is this far before the sensor, mm; below 0, behind it.
    ExitPupilMm(f64),
    /// By this share of the distance from the middle: the pitch of the microlenses is so much smaller than that of the pixels.
    Shrink(f64),
    /// For chief-ray angles by image height, as data sheets state them: pairs of mm from the middle and degrees, ascending from 0 mm, straight
    /// lines between and the last angle beyond.
    ChiefRayDeg(Vec<(f64, f64)>),
}

/// What the boundaries of a pixel's layers reflect.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub enum Interfaces {
    /// Nothing.
    #[default]
    Coated,
    /// What Fresnel's equations give for unpolarized light at each boundary from air to photodiode, each counted by itself, without interference.
    Fresnel {
        /// The refractive index of the photodiode.
        photodiode_index: f64,
    },
}

/// What the quantum efficiencies of a sensor with a stack count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum QuantumEfficiencyOf {
    /// Electrons a photon on the opening, as measured in collimated light along the axis: shares of any other light count relative to that.
    #[default]
    Pixel,
    /// Electrons a photon that reaches the photodiode: the share of the light on the opening that does is counted besides.
    Photodiode,
}

impl PixelStack {
    /// Returns the stack of pixels that are so many times as large at the same places of a film: each takes light from the same angles.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let layer = |layer: &StackLayer| StackLayer { thickness_um: factor * layer.thickness_um, ..*layer };
        Self {
            photodiode_um: factor * self.photodiode_um,
            layers: self.layers.iter().map(layer).collect(),
            microlens: self.microlens.as_ref().map(|lens| lens.scaled(factor)),
            ..self.clone()
        }
    }

    /// Returns the stack for a frame of a part of the array, whose middle lies so many mm to the right of that of the array and down, and whose
    /// distances count as the part of them that `binning` pixels are of one.
    #[must_use]
    pub fn seen_in_part(&self, middle_mm: [f64; 2], binning: usize) -> Self {
        let microlens = self.microlens.as_ref().map(|lens| {
            let center_mm = [0, 1].map(|i| lens.center_mm[i] - middle_mm[i]);
            let binning = binning as f64;
            let closer = Microlens { center_mm, ..lens.clone() }.with_array_scaled(binning.recip());
            match closer.shift {
                MicrolensShift::Shrink(share) => Microlens { shift: MicrolensShift::Shrink(binning * share), ..closer },
                _ => closer,
            }
        });
        Self { microlens, ..self.clone() }
    }

    /// Returns the microlens's shift at a place of the array, mm from its middle, before a lens whose chief ray there has this slope.
    pub(crate) fn shift_um(&self, place_mm: [f64; 2], chief: [f64; 2]) -> [f64; 2] {
        let Some(lens) = &self.microlens else { return [0.0; 2] };
        let [right_mm, down_mm] = [0, 1].map(|i| place_mm[i] - lens.center_mm[i]);
        let designed = match &lens.shift {
            MicrolensShift::None => return [0.0; 2],
            MicrolensShift::Shrink(share) => return [-1e3 * share * right_mm, -1e3 * share * down_mm],
            MicrolensShift::Optimal => chief,
            MicrolensShift::ExitPupilMm(distance_mm) => [right_mm / distance_mm, down_mm / distance_mm],
            MicrolensShift::ChiefRayDeg(table) => {
                let height_mm = right_mm.hypot(down_mm);
                let slope_per_mm = chief_ray_deg(table, height_mm).to_radians().tan() / height_mm.max(1e-12);
                [slope_per_mm * right_mm, slope_per_mm * down_mm]
            }
        };
        self.displacement_um(designed).map(|um| 0.0 - um)
    }

    /// Returns the share of collimated light along the axis on an opening of this side that reaches the photodiode, with the lens in the middle.
    pub(crate) fn axial_share(&self, opening_um: f64) -> f64 {
        PixelOptics::new(self, opening_um).share(&Cone::NORMAL, [0.0; 2])
    }

    /// Returns how far a ray through the middle of the microlens lands from below it.
    fn displacement_um(&self, slope: [f64; 2]) -> [f64; 2] {
        let root = (1.0 + slope[0] * slope[0] + slope[1] * slope[1]).sqrt();
        self.fall(slope.map(|s| s / root), 0.0).expect("light from air enters every layer").displacement_um
    }

    /// Returns how far a ray of these direction cosines, times index, goes aside in the layers from so far below their top, by Snell's law
    /// (eq. 3); `None` where one reflects it totally.
    fn fall(&self, cosines: [f64; 2], sag_um: f64) -> Option<Fall> {
        let sine_square = cosines[0] * cosines[0] + cosines[1] * cosines[1];
        let (mut height_um, mut bend_um, mut first, mut above_um) = (0.0, 0.0, None, sag_um);
        for layer in &self.layers {
            // Index times cosine, squared.
            let down_square = layer.index * layer.index - sine_square;
            if down_square <= 0.0 {
                return None;
            }
            let per_thickness = down_square.sqrt().recip();
            let part_um = (layer.thickness_um - above_um) * per_thickness;
            height_um += part_um;
            bend_um += part_um / down_square;
            first.get_or_insert(per_thickness);
            above_um = 0.0;
        }
        let per_thickness = first.unwrap_or(0.0);
        Some(Fall {
            displacement_um: cosines.map(|cosine| height_um * cosine),
            per_cosine_um: cosines.map(|cosine| height_um + bend_um * cosine * cosine),
            per_thickness: cosines.map(|cosine| per_thickness * cosine),
        })
    }

    /// Returns the sum of thickness over index, µm: how deep the stack is to rays near the axis.
    fn reduced_height_um(&self) -> f64 {
        self.layers.iter().map(|layer| layer.thickness_um / layer.index).sum()
    }

    /// Returns the surface of the microlens.
    fn lens_surface(&self, power: MicrolensPower) -> Surface {
        match power {
            MicrolensPower::FocusOnPhotodiode => Surface::Thin { power_per_um: self.reduced_height_um().recip() },
            MicrolensPower::FocalLengthUm(focal_length_um) => Surface::Thin { power_per_um: focal_length_um.recip() },
            MicrolensPower::RadiusUm(radius_um) => Surface::Sphere { radius_um, index: self.first_index() },
        }
    }

    /// The index below the top of the stack.
    fn first_index(&self) -> f64 {
        self.layers.first().map_or(1.0, |layer| layer.index)
    }

    /// Returns the share of unpolarized light that no boundary reflects, for the square of the sine in air (eq. 8).
    fn transmittance(&self, sine_square: f64) -> f64 {
        let Interfaces::Fresnel { photodiode_index } = self.interfaces else { return 1.0 };
        let behind = self.layers.iter().map(|layer| layer.index).chain([photodiode_index]);
        // The sine times the index is the same in all layers.
        let cosine = |index: f64| (1.0 - sine_square / (index * index)).sqrt();
        let (mut s, mut p, mut before) = (1.0, 1.0, 1.0);
        for index in behind {
            let (cos_before, cos_behind) = (cosine(before), cosine(index));
            let reflected = |a: f64, b: f64| ((a - b) / (a + b)).powi(2);
            s *= 1.0 - reflected(before * cos_before, index * cos_behind);
            p *= 1.0 - reflected(index * cos_before, before * cos_behind);
            before = index;
        }
        0.5 * (s + p)
    }

    /// Checks the numbers of a stack below an opening of this side.
    ///
    /// # Errors
    /// Names the first that makes no sense, its value and what was expected.
    pub(crate) fn check(&self, owner: &str, pitch_um: f64, opening_um: f64) -> Result<(), SensorError> {
        let wrong =
            |key: &str, value, expected| Err(SensorError::value(owner, &format!("pixel_stack.{key}"), value, expected));
        if !(self.photodiode_um > 0.0 && self.photodiode_um <= pitch_um * (1.0 + 1e-9)) {
            return wrong("photodiode_um", self.photodiode_um, "a number above 0 and at most the pixel pitch");
        }
        for &StackLayer { thickness_um, index } in &self.layers {
            if !(thickness_um >= 0.0 && thickness_um.is_finite()) {
                return wrong("layers.thickness_um", thickness_um, "a number of 0 or more");
            }
            if !(1.0..=MOST_INDEX).contains(&index) {
                return wrong("layers.index", index, EXPECTED_INDEX);
            }
        }
        if let Interfaces::Fresnel { photodiode_index: index } = self.interfaces
            && !(1.0..=MOST_INDEX).contains(&index)
        {
            return wrong("interfaces.photodiode_index", index, EXPECTED_INDEX);
        }
        if let Some(lens) = &self.microlens {
            self.check_power(lens, opening_um, &wrong)?;
            lens.check_shift(&wrong)?;
        }
        match self.axial_share(opening_um) {
            share if share > 0.0 => Ok(()),
            share => wrong("share of light along the axis", share, "a stack that leads some of it to the photodiode"),
        }
    }

    fn check_power(
        &self,
        lens: &Microlens,
        opening_um: f64,
        wrong: &dyn Fn(&str, f64, &'static str) -> Result<(), SensorError>,
    ) -> Result<(), SensorError> {
        let side_um = lens.side_um(opening_um);
        if !(side_um > 0.0 && side_um <= opening_um * (1.0 + 1e-9)) {
            return wrong("microlens.outline", side_um, "a side above 0 and at most that of the opening");
        }
        let power_per_um = match self.lens_surface(lens.power) {
            Surface::Sphere { radius_um, .. } => return self.check_sphere(radius_um, lens.reach_um(opening_um), wrong),
            Surface::Thin { power_per_um } => power_per_um,
            Surface::Flat { .. } => 0.0,
        };
        if let MicrolensPower::FocalLengthUm(um) = lens.power
            && !(um > 0.0 && um.is_finite())
        {
            return wrong("microlens.power.FocalLengthUm", um, "a number above 0");
        }
        if power_per_um.is_infinite() {
            return wrong("layers", 0.0, "layers of some thickness below a microlens with its focus on the photodiode");
        }
        let aperture = 0.5 * power_per_um * side_um;
        if aperture >= self.first_index() {
            let expected =
                "less than the index below the lens: a longer focal length, a deeper stack or a smaller lens";
            return wrong("microlens's numerical aperture", aperture, expected);
        }
        Ok(())
    }

    fn check_sphere(
        &self,
        radius_um: f64,
        reach_um: f64,
        wrong: &dyn Fn(&str, f64, &'static str) -> Result<(), SensorError>,
    ) -> Result<(), SensorError> {
        if !(radius_um >= reach_um && radius_um.is_finite()) {
            return wrong(
                "microlens.power.RadiusUm",
                radius_um,
                "at least the distance from the lens's middle to its rim",
            );
        }
        let sag_um = sag_um(radius_um, reach_um);
        match self.layers.first().map_or(0.0, |layer| layer.thickness_um) {
            thickness_um if thickness_um >= sag_um => Ok(()),
            thickness_um => {
                wrong("layers.thickness_um", thickness_um, "a first layer as thick as its microlens is high at least")
            }
        }
    }
}

/// How far a ray goes aside in the layers.
struct Fall {
    displacement_um: [f64; 2],
    /// Its derivative along each axis by the direction cosine along that.
    per_cosine_um: [f64; 2],
    /// Its derivative by the thickness of the first layer.
    per_thickness: [f64; 2],
}

/// The highest refractive index that is taken: that of germanium is 4 to 5.8.
const MOST_INDEX: f64 = 6.0;
const EXPECTED_INDEX: &str = "a refractive index from 1 to 6";

impl Microlens {
    fn scaled(&self, factor: f64) -> Self {
        let power = match self.power {
            MicrolensPower::FocusOnPhotodiode => MicrolensPower::FocusOnPhotodiode,
            MicrolensPower::FocalLengthUm(um) => MicrolensPower::FocalLengthUm(factor * um),
            MicrolensPower::RadiusUm(um) => MicrolensPower::RadiusUm(factor * um),
        };
        let outline = match self.outline {
            MicrolensOutline::Gapless => MicrolensOutline::Gapless,
            MicrolensOutline::SquareUm(um) => MicrolensOutline::SquareUm(factor * um),
            MicrolensOutline::RoundUm(um) => MicrolensOutline::RoundUm(factor * um),
        };
        let shift = match self.shift {
            MicrolensShift::Shrink(share) => MicrolensShift::Shrink(factor * share),
            _ => self.shift.clone(),
        };
        Self { power, outline, shift, ..self.clone() }
    }

    /// Returns the same lenses where distances on the array and before it are so many times as large.
    fn with_array_scaled(&self, factor: f64) -> Self {
        let shift = match &self.shift {
            MicrolensShift::None => MicrolensShift::None,
            MicrolensShift::Optimal => MicrolensShift::Optimal,
            MicrolensShift::ExitPupilMm(mm) => MicrolensShift::ExitPupilMm(factor * mm),
            MicrolensShift::Shrink(share) => MicrolensShift::Shrink(*share),
            MicrolensShift::ChiefRayDeg(table) => {
                MicrolensShift::ChiefRayDeg(table.iter().map(|&(mm, deg)| (factor * mm, deg)).collect())
            }
        };
        Self { shift, center_mm: self.center_mm.map(|mm| factor * mm), ..self.clone() }
    }

    /// The side or the diameter.
    fn side_um(&self, opening_um: f64) -> f64 {
        match self.outline {
            MicrolensOutline::Gapless => opening_um,
            MicrolensOutline::SquareUm(um) | MicrolensOutline::RoundUm(um) => um,
        }
    }

    /// The distance from the middle of the lens to its farthest rim.
    fn reach_um(&self, opening_um: f64) -> f64 {
        match self.outline {
            MicrolensOutline::Gapless => opening_um * 0.5_f64.sqrt(),
            MicrolensOutline::SquareUm(um) => um * 0.5_f64.sqrt(),
            MicrolensOutline::RoundUm(um) => 0.5 * um,
        }
    }

    fn check_shift(
        &self,
        wrong: &dyn Fn(&str, f64, &'static str) -> Result<(), SensorError>,
    ) -> Result<(), SensorError> {
        if let Some(mm) = self.center_mm.into_iter().find(|mm| !mm.is_finite()) {
            return wrong("microlens.center_mm", mm, "a finite number");
        }
        match &self.shift {
            MicrolensShift::None | MicrolensShift::Optimal => Ok(()),
            MicrolensShift::ExitPupilMm(mm) if *mm == 0.0 || !mm.is_finite() => {
                wrong("microlens.shift.ExitPupilMm", *mm, "a number other than 0")
            }
            MicrolensShift::ExitPupilMm(_) => Ok(()),
            MicrolensShift::Shrink(share) if !(-0.5..=0.5).contains(share) => {
                wrong("microlens.shift.Shrink", *share, "a share from -0.5 to 0.5")
            }
            MicrolensShift::Shrink(_) => Ok(()),
            MicrolensShift::ChiefRayDeg(table) => {
                let mut last_mm = -1.0;
                for &(mm, deg) in table {
                    let is_right = mm > last_mm && (last_mm >= 0.0 || mm == 0.0 && deg == 0.0);
                    if !(is_right && mm.is_finite() && deg.abs() < 85.0) {
                        let expected = "heights that ascend from 0 mm at 0 degrees, with angles below 85 degrees";
                        return wrong("microlens.shift.ChiefRayDeg", if mm > last_mm { deg } else { mm }, expected);
                    }
                    last_mm = mm;
                }
                if table.len() < 2 {
                    wrong("number of pairs of microlens.shift.ChiefRayDeg", table.len() as f64, "2 or more")
                } else {
                    Ok(())
                }
            }
        }
    }
}

/// Returns the angle of a table of two pairs or more at a height.
fn chief_ray_deg(table: &[(f64, f64)], height_mm: f64) -> f64 {
    let above = table.partition_point(|&(mm, _)| mm < height_mm);
    match (above.checked_sub(1).and_then(|i| table.get(i)), table.get(above)) {
        (Some(&(mm0, deg0)), Some(&(mm1, deg1))) => deg0 + (deg1 - deg0) * (height_mm - mm0) / (mm1 - mm0),
        (Some(&(_, deg)), None) | (None, Some(&(_, deg))) => deg,
        (None, None) => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;

    use super::{
        samples::{PITCH_UM, focused, layer},
        *,
    };

    #[test]
    fn designed_shifts_agree_where_they_mean_the_same() {
        let mut stack = focused(1.6, &[layer(3.0, 1.0)]);
        let mut shift = |shift| {
            stack.microlens.as_mut().unwrap().shift = shift;
            stack.shift_um([0.3, -0.4], [9.0, 9.0])
        };
        let pupil = shift(MicrolensShift::ExitPupilMm(4.0));
        // In air a chief ray comes down along its slope.
        assert_abs_diff_eq!(pupil[0], -3.0 * 0.3 / 4.0, epsilon = 1e-12);
        assert_abs_diff_eq!(pupil[1], 3.0 * 0.4 / 4.0, epsilon = 1e-12);
        let shrunk = shift(MicrolensShift::Shrink(3.0e-3 / 4.0));
        let table: Vec<(f64, f64)> =
            (0..=100).map(|i| 0.01 * f64::from(i)).map(|mm| (mm, (mm / 4.0).atan().to_degrees())).collect();
        let tabulated = shift(MicrolensShift::ChiefRayDeg(table));
        for i in 0..2 {
            assert_abs_diff_eq!(shrunk[i], pupil[i], epsilon = 1e-12);
            assert_abs_diff_eq!(tabulated[i], pupil[i], epsilon = 1e-9);
        }
        assert_eq!(shift(MicrolensShift::None), [0.0; 2]);
    }

    #[test]
    fn what_no_pixel_has_is_named() {
        let good = focused(2.0, &[layer(4.0, 1.5)]);
        let check = |change: &dyn Fn(&mut PixelStack), words: &[&str]| {
            let mut stack = good.clone();
            change(&mut stack);
            let message = stack.check("test", PITCH_UM, PITCH_UM).unwrap_err().to_string();
            words.iter().for_each(|word| assert!(message.contains(word), "'{word}' is not in: {message}"));
        };
        let lens = |change: fn(&mut Microlens)| move |stack: &mut PixelStack| change(stack.microlens.as_mut().unwrap());
        good.check("test", PITCH_UM, PITCH_UM).unwrap();
        check(&|stack| stack.photodiode_um = 4.1, &["pixel_stack.photodiode_um of test is 4.1", "pitch"]);
        check(&|stack| stack.photodiode_um = f64::NAN, &["photodiode_um", "NaN"]);
        check(&|stack| stack.layers[0].thickness_um = -1.0, &["layers.thickness_um", "-1"]);
        check(&|stack| stack.layers[0].index = 0.9, &["layers.index", "1 to 6"]);
        check(&|stack| stack.layers.clear(), &["layers", "thickness"]);
        check(&|stack| stack.layers[0].thickness_um = 1.0, &["numerical aperture", "deeper stack"]);
        check(&lens(|lens| lens.power = MicrolensPower::FocalLengthUm(0.0)), &["FocalLengthUm", "above 0"]);
        check(&lens(|lens| lens.power = MicrolensPower::RadiusUm(2.7)), &["RadiusUm", "2.7", "rim"]);
        let high = |stack: &mut PixelStack| {
            stack.layers = vec![layer(1.0, 1.5), layer(3.0, 1.5)];
            stack.microlens.as_mut().unwrap().power = MicrolensPower::RadiusUm(3.0);
        };
        check(&high, &["layers.thickness_um", "1", "as its microlens is high"]);
        check(&lens(|lens| lens.outline = MicrolensOutline::RoundUm(4.2)), &["outline", "4.2", "opening"]);
        check(&lens(|lens| lens.shift = MicrolensShift::ExitPupilMm(0.0)), &["ExitPupilMm", "other than 0"]);
        check(&lens(|lens| lens.shift = MicrolensShift::Shrink(1.0)), &["Shrink", "-0.5 to 0.5"]);
        let table = lens(|lens| lens.shift = MicrolensShift::ChiefRayDeg(vec![(0.0, 0.0), (1.0, 90.0)]));
        check(&table, &["ChiefRayDeg", "90", "85"]);
        check(&lens(|lens| lens.center_mm = [f64::NAN, 0.0]), &["center_mm", "NaN"]);
        check(&|stack| stack.interfaces = Interfaces::Fresnel { photodiode_index: 0.0 }, &["photodiode_index"]);
    }
}
