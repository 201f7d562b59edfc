//! The lattice of distances from the axis at which films are surveyed.

/// How often steps over an area are halved at most.
pub(crate) const MOST_AREA_HALVINGS: usize = 3;
/// How far irradiances between samples along a radius may be off, over the largest.
pub(crate) const MOST_OFF_SR: f64 = 1e-4;
/// So many times as far where an area is sampled, and not a radius.
pub(crate) const AREA_OVER_RADIUS: f64 = 10.0;
/// Points with less of the largest irradiance do not tell how directions go on beyond the light.
pub(crate) const DIM: f64 = 1e-3;
/// About how many directions from the axis are looked at: of the film of a lens with blades, and for the share of a part of a pupil.
pub(crate) const N_AZIMUTHS: usize = 24;

/// The distances from the axis of a lens at which its film is looked at first: whole steps, a power of two of mm, whatever is asked for.
///
/// The stations of a wide survey are those of a narrow one and more, so that both say the same of the film that they share: the light of a
/// pixel does not depend on how far beside the film a scene is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lattice {
    pub(crate) step_mm: f64,
    pub(crate) n_steps: usize,
}

impl Lattice {
    /// Least steps in the height of a picture seen at a tangent of 1, and the most that reach from the axis outwards: beyond, they are twice as wide.
    pub(crate) const STEPS_OF_SCALE: usize = 16;
    const MOST_STEPS: usize = 64;
    /// Steps beyond what is asked for: how a curve goes on is told by those.
    const BESIDE: usize = 2;
    /// Entries of tables in a step: of directions and irradiances along a radius, and of shares over an area.
    pub(crate) const ENTRIES: usize = 128;
    const SHARES: usize = 8;

    /// Returns that of a film up to a distance from the axis, before which a lens has a picture of this height at a tangent of 1.
    pub(crate) fn over(reach_mm: f64, scale_mm: f64) -> Self {
        let mut step_mm = (scale_mm / Self::STEPS_OF_SCALE as f64).log2().floor().exp2();
        while reach_mm > step_mm * (Self::MOST_STEPS - Self::BESIDE) as f64 {
            step_mm *= 2.0;
        }
        Self { step_mm, n_steps: (reach_mm / step_mm).ceil().max(1.0) as usize + Self::BESIDE }
    }

    /// Returns the same film in steps twice as wide.
    pub(crate) fn coarser(self) -> Self {
        Self { step_mm: 2.0 * self.step_mm, n_steps: self.n_steps.div_ceil(2) }
    }

    /// Returns that of the square grid over the same film, in steps twice as wide and without those beyond what is asked for: a grid ends a step beyond its reach anyway, and
    /// where it meets the rim of the light it takes the most points.
    pub(crate) fn of_grid(self) -> Self {
        Self { step_mm: 2.0 * self.step_mm, n_steps: self.n_steps.saturating_sub(Self::BESIDE).div_ceil(2).max(1) }
    }

    pub(crate) fn reach_mm(self) -> f64 {
        self.step_mm * self.n_steps as f64
    }

    /// Returns the radii of a table of shares: how far apart they are, mm, and how many.
    pub(crate) fn table_radii(self) -> (f64, usize) {
        (self.step_mm / Self::SHARES as f64, self.n_steps * Self::SHARES + 1)
    }
}
