//! A lens that is moved sideways as a whole, before the scene and the film that stay.

use std::borrow::Cow;

use dioptric_optics::Lens;
use glam::DVec2;

/// Returns the lens, on its axis, whose fields may be sampled along a radius, and how far the lens stands from there, mm to the
/// right and upwards: of a rotationally symmetric lens itself, and of one that is moved sideways as a whole
/// ([`Lens::recentered`]) the one that stayed.
///
/// `None` of any other, and of a moved lens whose entrance pupil at a wavelength lies at infinity: it has no field that moves
/// with it.
pub fn lens_on_axis(lens: &Lens, wavelength_nm: f64) -> Option<(Cow<'_, Lens>, DVec2)> {
    if lens.is_rotational() {
        return Some((Cow::Borrowed(lens), DVec2::ZERO));
    }
    let (centered, aside_mm) = lens.recentered()?;
    let pupil_z_mm = centered.at(wavelength_nm).ok()?.projection_center_z_mm();
    pupil_z_mm.is_finite().then_some((Cow::Owned(centered), aside_mm))
}

/// How far a lens is moved sideways: its own fields and places count from its axis, those of scene and film do not.
///
/// Of a point at the field t and the depth of d dioptres the moved pupil sees the field t − m d, and what the lens images at
/// the place r from its axis lies at r − m in the picture, which is the film turned by 180°.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Decenter {
    /// To the right and upwards in the scene, mm.
    mm: DVec2,
}

impl Decenter {
    /// Returns the lens on its axis, where it has one, and how far it stands from there.
    pub(crate) fn of(lens: &Lens, wavelength_nm: f64) -> (Cow<'_, Lens>, Self) {
        let whole = || (Cow::Borrowed(lens), Self::default());
        lens_on_axis(lens, wavelength_nm).map_or_else(whole, |(centered, mm)| (centered, Self { mm }))
    }

    pub(crate) fn is_none(self) -> bool {
        self == Self::default()
    }

    /// Where the axis stands in the scene, mm to the right and upwards.
    pub(crate) fn mm(self) -> DVec2 {
        self.mm
    }

    /// The place of the axis in the picture, mm from the film's middle.
    pub(crate) fn axis_mm(self) -> DVec2 {
        -self.mm
    }
}
