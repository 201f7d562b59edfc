//! What turns a lens into itself, and so which points of its film need to be traced.

use std::f64::consts::TAU;

use dioptric_optics::Lens;
use glam::DVec2;

/// What turns a lens into itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Symmetry {
    /// Any turn about its axis.
    Axis,
    /// A turn by one of so many blades.
    Blades(usize),
    /// None that is known.
    None,
}

impl Symmetry {
    pub(crate) fn of(lens: &Lens) -> Self {
        if lens.is_rotational() {
            return Self::Axis;
        }
        let is_round_but_for_blades =
            || lens.iris_opening().is_some() && lens.clone().with_iris(None).is_ok_and(|lens| lens.is_rotational());
        match lens.iris() {
            Some(iris) if is_round_but_for_blades() => Self::Blades(iris.blades as usize),
            _ => Self::None,
        }
    }

    /// Returns the place, of those that are alike, at which a bundle is traced, and the turn from there to the place asked for.
    pub(crate) fn traced(self, place_mm: DVec2) -> (DVec2, DVec2) {
        match self {
            Self::Axis => (DVec2::X * place_mm.length(), place_mm.try_normalize().unwrap_or(DVec2::X)),
            Self::Blades(n) => {
                let sector = (place_mm.to_angle().rem_euclid(TAU) * n as f64 / TAU).floor();
                let turn = DVec2::from_angle(TAU * sector / n as f64);
                (DVec2::new(turn.x, -turn.y).rotate(place_mm), turn)
            }
            Self::None => (place_mm, DVec2::X),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_traced_in_one_sector_and_turned_back() {
        for (symmetry, most_deg) in [(Symmetry::Axis, 1e-9), (Symmetry::Blades(5), 72.0), (Symmetry::None, 360.0)] {
            for angle_deg in [0.0, 10.0, 71.9, 72.1, 200.0, -1e-13, 359.0_f64] {
                let place_mm = DVec2::from_angle(angle_deg.to_radians()) * 7.0;
                let (traced_mm, turn) = symmetry.traced(place_mm);
                assert!((turn.rotate(traced_mm) - place_mm).length() < 1e-12, "{symmetry:?} {angle_deg}");
                let traced_deg = traced_mm.to_angle().rem_euclid(TAU).to_degrees();
                assert!(traced_deg <= most_deg + 1e-9 || traced_deg > 360.0 - 1e-9, "{symmetry:?} {angle_deg}");
            }
        }
    }
}
