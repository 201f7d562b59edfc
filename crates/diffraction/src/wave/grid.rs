//! How many nodes a wave sum needs.

/// How many nodes a pupil has: Gauss–Legendre along the radius, equally spaced in azimuth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PupilGrid {
    /// Nodes from the center to the edge.
    pub n_radii: usize,
    /// Azimuths.
    pub n_azimuths: usize,
}

impl PupilGrid {
    /// The 12 × 48 nodes that do for any point in focus on a small window.
    pub const STANDARD: Self = Self { n_radii: 12, n_azimuths: 48 };

    /// Returns the fewest nodes that resolve these ranges of phase. With fewer the sum fails abruptly.
    ///
    /// With B the sum of both ranges: `B/7 + 8` radii and `0.8 B + 16` azimuths. Those serve while the blur exceeds the
    /// window. Light at the window's corner turns with the azimuth by all of its range, and along a radius by all of it
    /// too, where defocus gathers half of its own; for it (an error of 1e-5 in L1, measured on
    /// windows of up to 60 λN and defoci of up to 64 waves) `rays/6 + window/4 + 5` radii and
    /// `window + 3 ∛window + 6` azimuths are needed. Aberrations whose slope is large within the pupil, where radii are far
    /// apart, take `(along_radius − rays)/2.5` radii more: measured on fast lenses' spherical aberration (Tessar f/2.2, 22
    /// of 50 radii by the rule without it: L1 .03 where 24 do).
    pub fn needed(range: PhaseRange) -> Self {
        let (rays, window, total) = (range.rays, range.window, range.total());
        let zonal = (range.along_radius - rays).max(0.0) / 2.5;
        let n_radii = ((total / 7.0 + 8.0).max(rays / 6.0 + window / 4.0 + 5.0) + zonal).ceil() as usize;
        let n_azimuths = (0.8 * total + 16.0).max(window + 3.0 * window.cbrt() + 6.0).ceil() as usize;
        Self { n_radii, n_azimuths: n_azimuths.next_multiple_of(2) }
    }

    /// Returns the grid with both numbers multiplied by `factor` and rounded up.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        let scaled = |n: usize| (n as f64 * factor - 1e-9).ceil() as usize;
        Self { n_radii: scaled(self.n_radii), n_azimuths: scaled(self.n_azimuths).next_multiple_of(2) }
    }

    /// Returns the larger of both, in each direction.
    #[must_use]
    pub fn max(self, other: Self) -> Self {
        let (n_radii, n_azimuths) = (self.n_radii.max(other.n_radii), self.n_azimuths.max(other.n_azimuths));
        Self { n_radii, n_azimuths }
    }

    /// Returns the smaller of both, in each direction.
    #[must_use]
    pub fn min(self, other: Self) -> Self {
        let (n_radii, n_azimuths) = (self.n_radii.min(other.n_radii), self.n_azimuths.min(other.n_azimuths));
        Self { n_radii, n_azimuths }
    }

    /// Whether this grid is no coarser than another.
    pub fn covers(self, other: Self) -> bool {
        self.n_radii >= other.n_radii && self.n_azimuths >= other.n_azimuths
    }

    /// The number of nodes.
    pub fn n_nodes(self) -> usize {
        self.n_radii * self.n_azimuths
    }
}

/// How far phases range from the pupil's center to its edge, in radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseRange {
    /// By the rays' places on the film about their centroid, `(2π/λ) NA q_max`: defocus and aberrations.
    pub rays: f64,
    /// By the rays' places too, each weighed with how far apart the radii are where it passes the pupil: that of `rays` for
    /// defocus, up to twice as much for aberrations that turn back towards the edge.
    pub along_radius: f64,
    /// By the window's reach beyond that centroid, `(2π/λ) NA δ_max`.
    pub window: f64,
}

impl PhaseRange {
    /// The largest of t √(t (1 − t)) over the radius: what defocus has of `rays` along it.
    pub(super) const DEFOCUS_ALONG_RADIUS: f64 = 0.324_759_526_419_164_5;

    /// B, the sum of that of the rays and the window.
    pub fn total(self) -> f64 {
        self.rays + self.window
    }

    /// Returns all ranges multiplied by `factor`.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        let (rays, along_radius) = (factor * self.rays, factor * self.along_radius);
        Self { rays, along_radius, window: factor * self.window }
    }
}
