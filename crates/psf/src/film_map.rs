//! Where the points of a film look, and how much light reaches them.

use std::{f64::consts::TAU, sync::Arc};

use glam::{DMat2, DVec2, DVec3};

mod plane;
mod radial;

pub(crate) use plane::PlaneMap;
pub(crate) use radial::RadialMap;

/// The least cosine between the axis and a direction that has a tangent: 89.9°.
const LEAST_COSINE: f64 = 1.745_328_4e-3;

/// From points of the film to the tangents that their chief rays see, and to the irradiance that they get; for one wavelength.
///
/// Points are mm from the middle of the film, in the picture frame (x right, y up); tangents are those of directions from the projection
/// centre. The map does not depend on depth: what a point gathers from each depth is in its kernels. Which ray is the chief one is a
/// convention, a smooth one that [`LensImage::film_map`](crate::LensImage::film_map) and kernels share; beyond the light of the lens
/// directions go on smoothly.
#[derive(Clone, Debug)]
pub struct FilmMap {
    kind: Kind,
    /// Of a part of a pupil, or of a pupil that blades bound, the share of the light of the whole, or of a round one.
    share: Option<Arc<ShareMap>>,
    /// What is added to a point before it is looked up, mm.
    from_mm: DVec2,
}

#[derive(Clone, Debug)]
enum Kind {
    Radial(Arc<RadialMap>),
    Plane(Arc<PlaneMap>),
}

/// The tangents and the irradiances of a row of points.
#[derive(Clone, Debug, Default)]
pub struct FieldsAlong {
    /// Tangents to the right; NaN where nothing is seen.
    pub tan_x: Vec<f64>,
    /// Tangents upwards; NaN where nothing is seen.
    pub tan_y: Vec<f64>,
    /// Irradiance over the radiance of a uniform scene, sr.
    pub irradiance_sr: Vec<f64>,
}

impl FieldsAlong {
    fn resize(&mut self, n: usize) {
        for list in [&mut self.tan_x, &mut self.tan_y, &mut self.irradiance_sr] {
            list.resize(n, 0.0);
        }
    }
}

impl From<RadialMap> for FilmMap {
    fn from(map: RadialMap) -> Self {
        Self { kind: Kind::Radial(Arc::new(map)), share: None, from_mm: DVec2::ZERO }
    }
}

impl From<PlaneMap> for FilmMap {
    fn from(map: PlaneMap) -> Self {
        Self { kind: Kind::Plane(Arc::new(map)), share: None, from_mm: DVec2::ZERO }
    }
}

/// Returns the tangents of half the angle of a direction of any length.
#[inline]
fn half_tan_of(direction: DVec3) -> DVec2 {
    direction.truncate() / (direction.z + direction.length())
}

impl FilmMap {
    /// Tabulates a lens with an axis of symmetry, up to `reach_mm` from it.
    ///
    /// `tan_at` gives the tangent of the direction seen at a distance from the axis, mm, of one sign and growing in magnitude; `None`
    /// from where on nothing is seen. `irradiance_sr` gives the irradiance per radiance where a tangent is seen. What lies between 2048 entries is off
    /// by 1e-10 of smooth functions.
    pub fn radial(reach_mm: f64, tan_at: impl Fn(f64) -> Option<f64>, irradiance_sr: impl Fn(f64) -> f64) -> Self {
        RadialMap::tabulate(reach_mm, tan_at, irradiance_sr).into()
    }

    /// Where the axis of symmetry meets the film, mm; `None` of a lens without one.
    pub fn axis_mm(&self) -> Option<DVec2> {
        match &self.kind {
            Kind::Radial(map) => Some(map.axis_mm() - self.from_mm),
            Kind::Plane(_) => None,
        }
    }

    /// Returns the map of a lens moved sideways: about an axis that meets the film at `axis_mm` and looks along `axis_tan`.
    #[must_use]
    pub fn about(self, axis_mm: DVec2, axis_tan: DVec2) -> Self {
        match self.kind {
            Kind::Radial(map) => {
                let map = Arc::unwrap_or_clone(map).about(axis_mm, axis_tan);
                Self { kind: Kind::Radial(Arc::new(map)), ..self }
            }
            Kind::Plane(_) => Self { from_mm: self.from_mm - axis_mm, ..self },
        }
    }

    /// Returns the map with this share of the irradiances.
    pub(crate) fn with_share(self, share: ShareMap) -> Self {
        Self { share: Some(Arc::new(share)), ..self }
    }

    /// Returns the map of a grid with the irradiances of its points each times a factor.
    pub(crate) fn scaled(&self, factors: &[f64]) -> Self {
        match &self.kind {
            Kind::Plane(map) => Self { kind: Kind::Plane(Arc::new(map.scaled(factors))), ..self.clone() },
            Kind::Radial(_) => self.clone(),
        }
    }

    /// Returns the map with points counted from another: `center_mm` is where that is now.
    #[must_use]
    pub fn counted_from(&self, center_mm: DVec2) -> Self {
        Self { from_mm: self.from_mm + center_mm, ..self.clone() }
    }

    /// Returns the tangents of the direction that the chief ray of a point sees; `None` beyond 89.9° from the axis.
    #[inline]
    pub fn field_tan(&self, place_mm: DVec2) -> Option<DVec2> {
        tangent(self.direction(place_mm))
    }

    /// Returns the direction that a point sees, of any length: x to the right, y up, z ahead.
    #[inline]
    pub(crate) fn direction(&self, place_mm: DVec2) -> DVec3 {
        match &self.kind {
            Kind::Radial(map) => map.direction(place_mm + self.from_mm),
            Kind::Plane(map) => map.direction(place_mm + self.from_mm),
        }
    }

    /// Returns the irradiance at a point over the radiance of a uniform scene, sr; 0 in darkness.
    #[inline]
    pub fn irradiance_sr(&self, place_mm: DVec2) -> f64 {
        let at_mm = place_mm + self.from_mm;
        let whole = match &self.kind {
            Kind::Radial(map) => map.irradiance_sr(at_mm),
            Kind::Plane(map) => map.irradiance_sr(at_mm),
        };
        self.share.as_ref().map_or(whole, |share| whole * share.at(at_mm))
    }

    /// Returns the point whose chief ray sees a direction.
    #[inline]
    pub fn place_mm(&self, field_tan: DVec2) -> Option<DVec2> {
        let place_mm = self.place_of(field_tan.extend(1.0));
        place_mm.is_finite().then_some(place_mm)
    }

    /// Returns the point that sees a direction of any length, which may lie 90° and more from the axis.
    #[inline]
    pub(crate) fn place_of(&self, direction: DVec3) -> DVec2 {
        let at_mm = match &self.kind {
            Kind::Radial(map) => map.place_of(direction),
            Kind::Plane(map) => map.place_of(direction),
        };
        at_mm - self.from_mm
    }

    /// Returns the point that sees a direction, where another one is known that sees nearly the same.
    #[inline]
    pub(crate) fn place_near(&self, direction: DVec3, near_mm: DVec2) -> DVec2 {
        let at_mm = match &self.kind {
            Kind::Radial(map) => map.place_of(direction),
            Kind::Plane(map) => map.place_near(direction, Some(near_mm + self.from_mm)),
        };
        at_mm - self.from_mm
    }

    /// Returns by how much the point that sees a direction moves, mm, over how much the direction changes, in each of two ways.
    #[inline]
    pub(crate) fn moves_mm(&self, place_mm: DVec2, direction: DVec3, changes: [DVec3; 2]) -> [DVec2; 2] {
        let at_mm = place_mm + self.from_mm;
        let (axis_tan, by_half_tan) = match &self.kind {
            Kind::Radial(map) => (map.axis_tan(), map.by_half_tan(at_mm)),
            Kind::Plane(map) => (DVec2::ZERO, map.by_half_tan(at_mm)),
        };
        let from_axis = |direction: DVec3| (direction.truncate() - axis_tan * direction.z).extend(direction.z);
        let direction = from_axis(direction);
        let length = direction.length();
        let half_tan = half_tan_of(direction);
        // q = (x, y) / (z + |d|)
        changes.map(from_axis).map(|change| {
            let by = change.z + direction.dot(change) / length;
            by_half_tan * ((change.truncate() - half_tan * by) / (direction.z + length))
        })
    }

    /// Returns the derivative of points by the tangents that they see, mm.
    #[inline]
    pub fn jacobian_mm(&self, place_mm: DVec2) -> DMat2 {
        match &self.kind {
            Kind::Radial(map) => map.jacobian_mm(place_mm + self.from_mm),
            Kind::Plane(map) => map.jacobian_mm(place_mm + self.from_mm),
        }
    }

    /// As [`field_tan`](Self::field_tan) and [`irradiance_sr`](Self::irradiance_sr), at points of one height: `x_mm` to the right of the
    /// middle and `y_mm` above it.
    pub fn along(&self, x_mm: &[f64], y_mm: f64, seen: &mut FieldsAlong) {
        seen.resize(x_mm.len());
        match &self.kind {
            Kind::Radial(map) => map.along((x_mm, y_mm), self.from_mm, seen),
            Kind::Plane(map) => {
                for (i, &x_mm) in x_mm.iter().enumerate() {
                    let at_mm = DVec2::new(x_mm, y_mm) + self.from_mm;
                    let tan = tangent(map.direction(at_mm)).unwrap_or(DVec2::NAN);
                    (seen.tan_x[i], seen.tan_y[i], seen.irradiance_sr[i]) = (tan.x, tan.y, map.irradiance_sr(at_mm));
                }
            }
        }
        if let Some(share) = &self.share {
            for (sr, &x_mm) in seen.irradiance_sr.iter_mut().zip(x_mm) {
                *sr *= share.at(DVec2::new(x_mm, y_mm) + self.from_mm);
            }
        }
    }

    /// The bytes of memory that it takes.
    pub fn size_bytes(&self) -> usize {
        let shares = self.share.as_ref().map_or(0, |share| size_of_val(share.shares.as_slice()));
        shares
            + match &self.kind {
                Kind::Radial(map) => map.size_bytes(),
                Kind::Plane(map) => map.size_bytes(),
            }
    }
}

#[inline]
fn tangent(direction: DVec3) -> Option<DVec2> {
    (direction.z > LEAST_COSINE * direction.length()).then(|| direction.truncate() / direction.z)
}

/// The share of the light that goes through a part of the pupil, or an opening of blades, over the film.
#[derive(Clone, Debug)]
pub(crate) struct ShareMap {
    /// Where the axis meets the film, mm.
    axis_mm: DVec2,
    step_mm: f64,
    n_azimuths: usize,
    /// For each radius the azimuths from +x on, innermost.
    shares: Vec<f64>,
}

impl ShareMap {
    /// Takes shares at radii of these steps from 0 on, each at so many azimuths.
    pub(crate) fn new(axis_mm: DVec2, step_mm: f64, n_azimuths: usize, shares: Vec<f64>) -> Self {
        Self { axis_mm, step_mm, n_azimuths, shares }
    }

    /// Returns the share at a point: linear over the radius, cubic over the azimuth.
    fn at(&self, place_mm: DVec2) -> f64 {
        let from_axis_mm = place_mm - self.axis_mm;
        let n_radii = self.shares.len() / self.n_azimuths;
        let radius = (from_axis_mm.length() / self.step_mm).min((n_radii - 1) as f64);
        let below = (radius as usize).min(n_radii - 2);
        let azimuth = from_axis_mm.to_angle().rem_euclid(TAU) / TAU * self.n_azimuths as f64;
        let (first, u) = (azimuth.floor() as usize + self.n_azimuths - 1, azimuth.fract());
        let weights = [
            -u * (u - 1.0) * (u - 2.0) / 6.0,
            (u + 1.0) * (u - 1.0) * (u - 2.0) / 2.0,
            -(u + 1.0) * u * (u - 2.0) / 2.0,
            (u + 1.0) * u * (u - 1.0) / 6.0,
        ];
        let ring = |number: usize| -> f64 {
            let ring = &self.shares[number * self.n_azimuths..][..self.n_azimuths];
            weights.iter().enumerate().map(|(i, weight)| weight * ring[(first + i) % self.n_azimuths]).sum()
        };
        let fraction = radius - below as f64;
        (ring(below) * (1.0 - fraction) + ring(below + 1) * fraction).max(0.0)
    }
}
