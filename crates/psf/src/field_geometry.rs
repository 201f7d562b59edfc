//! From places on the film back to fields, for lenses without an axis of symmetry.

use dioptric_spectrum::{Cancel, Cancelled};
use glam::{DMat2, DVec2};

use crate::{
    FieldsAlong,
    axis::{Axis, Stencil},
    lit_fields::LitFields,
};

/// Nodes of a table along each side, for fields sampled as they are by default.
const NODES: usize = 129;
/// The same for at most this many fields each way.
const FEW_NODES: usize = 65;
const FEW_FIELDS: usize = 6;
/// Steps of Newton's method; it has converged after three or four.
const STEPS: usize = 24;

/// Field and irradiance over the film, for one depth and wavelength.
///
/// Fields are tangents of angles at the entrance pupil, places are mm from the lens's axis, both in the picture frame: x to
/// the right, y up, where a distant point at tan θ lands at about +f tan θ. It is the inverse of where the centroids of
/// point spread functions lie, so distortion, lateral color, tilts and different powers across and up are in it.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldGeometry {
    area: Area,
    /// Tangents across and up and irradiance over radiance (sr), row by row from the bottom; NaN where the field is not
    /// of the bank.
    nodes: Vec<[f64; 3]>,
}

/// A rectangle of the film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Area {
    first_mm: DVec2,
    last_mm: DVec2,
    /// Nodes along each side.
    side: usize,
    nodes_per_mm: DVec2,
}

impl Area {
    /// Returns the smallest rectangle about the places where so many fields each way land.
    pub(crate) fn around(mut places_mm: impl Iterator<Item = DVec2>, n_fields: usize) -> Option<Self> {
        let first = places_mm.next()?;
        let (first_mm, last_mm) = places_mm.fold((first, first), |(low, high), at| (low.min(at), high.max(at)));
        Some(Self::between(first_mm, last_mm, if n_fields <= FEW_FIELDS { FEW_NODES } else { NODES }))
    }

    /// Returns the rectangle between two of its corners: left below and right above.
    fn between(first_mm: DVec2, last_mm: DVec2, side: usize) -> Self {
        Self { first_mm, last_mm, side, nodes_per_mm: (side - 1) as f64 / (last_mm - first_mm) }
    }

    fn step_mm(&self) -> DVec2 {
        (self.last_mm - self.first_mm) / (self.side - 1) as f64
    }
}

impl FieldGeometry {
    /// The bytes of memory that it takes.
    pub(crate) fn size_bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
    }

    /// Returns the same with places counted from another: `from_mm` is where that is now.
    pub(crate) fn counted_from(mut self, from_mm: DVec2) -> Self {
        self.area.first_mm -= from_mm;
        self.area.last_mm -= from_mm;
        self
    }

    /// Returns the same with a share of the light.
    pub(crate) fn with_share(mut self, share: f64) -> Self {
        self.nodes.iter_mut().for_each(|node| node[2] *= share);
        self
    }

    /// Returns the field (tangents) seen at a place of the film and the irradiance there over the radiance of a locally
    /// uniform scene, sr; `None` where the bank has no field for it.
    ///
    /// The irradiance is the projected solid angle of the pupil times `|dA_object / dA_film|`: it holds vignetting and every
    /// cosine, but no losses in glass.
    #[inline]
    pub fn at(&self, place_mm: DVec2) -> Option<(DVec2, f64)> {
        let place = (place_mm - self.area.first_mm) * self.area.nodes_per_mm;
        let side = self.area.side;
        let last = (side - 1) as f64;
        if !(place.x >= 0.0 && place.y >= 0.0 && place.x <= last && place.y <= last) {
            return None;
        }
        let (column, row) = ((place.x as usize).min(side - 2), (place.y as usize).min(side - 2));
        let (across, up) = (place.x - column as f64, place.y - row as f64);
        let first = row * side + column;
        let [a, b, c, d] = [first, first + 1, first + side, first + side + 1].map(|node| self.nodes[node]);
        let mix = |i: usize| {
            (1.0 - up) * ((1.0 - across) * a[i] + across * b[i]) + up * ((1.0 - across) * c[i] + across * d[i])
        };
        let irradiance_per_radiance = mix(2);
        (!irradiance_per_radiance.is_nan()).then(|| (DVec2::new(mix(0), mix(1)), irradiance_per_radiance))
    }

    /// As [`at`](Self::at) at places of one height.
    pub(crate) fn along(&self, x_mm: &[f64], y_mm: f64, seen: &mut FieldsAlong) {
        for (i, &x_mm) in x_mm.iter().enumerate() {
            let found = self.at(DVec2::new(x_mm, y_mm));
            let (tan, gain) = found.unwrap_or((DVec2::ZERO, f64::NAN));
            (seen.tan_x[i], seen.tan_y[i], seen.irradiance_per_radiance[i]) = (tan.x, tan.y, gain);
        }
    }

    /// Returns the field seen at the place nearest to this one for which the bank has one.
    pub fn nearest_field_tan(&self, place_mm: DVec2) -> DVec2 {
        if let Some((field_tan, _)) = self.at(place_mm) {
            return field_tan;
        }
        // Most often the place lies beyond an area that is seen to its borders.
        let within_mm = place_mm.clamp(self.area.first_mm, self.area.last_mm);
        if let Some((field_tan, _)) = self.at(within_mm) {
            return field_tan;
        }
        self.nearest_known(within_mm).map_or(DVec2::ZERO, |node| DVec2::new(self.nodes[node][0], self.nodes[node][1]))
    }

    /// Returns the node nearest to a place in the area that has a field, sought in wider and wider squares about it.
    fn nearest_known(&self, place_mm: DVec2) -> Option<usize> {
        let step_mm = self.area.step_mm();
        let center = ((place_mm - self.area.first_mm) * self.area.nodes_per_mm).round().as_i64vec2();
        let last = self.area.side as i64 - 1;
        let mut nearest: Option<(f64, usize)> = None;
        for reach in 0..=last {
            // All nodes from here on lie at least so far away.
            let least_mm = (reach as f64 - 0.5) * step_mm.min_element();
            if nearest.is_some_and(|(distance_mm, _)| distance_mm <= least_mm) {
                break;
            }
            for down in -reach..=reach {
                let is_side = down.abs() == reach;
                for across in (-reach..=reach).step_by(if is_side { 1 } else { 2 * reach.max(1) as usize }) {
                    let (row, column) = (center.y + down, center.x + across);
                    if !(0..=last).contains(&row) || !(0..=last).contains(&column) {
                        continue;
                    }
                    let node = row as usize * self.area.side + column as usize;
                    if self.nodes[node][2].is_nan() {
                        continue;
                    }
                    let at_mm = self.area.first_mm + step_mm * DVec2::new(column as f64, row as f64);
                    let distance_mm = at_mm.distance(place_mm);
                    if nearest.is_none_or(|(least, _)| distance_mm < least) {
                        nearest = Some((distance_mm, node));
                    }
                }
            }
        }
        nearest.map(|(_, node)| node)
    }

    /// Returns the geometry that is the sum of these, of one area, with these weights.
    pub(crate) fn mix<'a>(mut weighted: impl Iterator<Item = (&'a Self, f64)>) -> Option<Self> {
        let (first, weight) = weighted.next()?;
        let mut sum = first.clone();
        sum.nodes.iter_mut().flatten().for_each(|number| *number *= weight);
        for (geometry, weight) in weighted {
            for (sum, node) in sum.nodes.iter_mut().flatten().zip(geometry.nodes.iter().flatten()) {
                *sum += weight * node;
            }
        }
        // Quadratics swing below 0 where light ends. What is not a number stays so.
        sum.nodes.iter_mut().filter(|node| node[2] < 0.0).for_each(|node| node[2] = 0.0);
        Some(sum)
    }
}

/// Where a grid of fields lands: what a [`FieldGeometry`] is the inverse of.
pub(crate) struct Landing<'a> {
    pub(crate) x: &'a Axis,
    pub(crate) y: &'a Axis,
    /// Centroids, mm, picture frame; x innermost.
    pub(crate) centroids_mm: Vec<DVec2>,
    /// Areas of the pupil, mm², as in a ray map's summary; 0 of fields that see no light.
    pub(crate) pupils_mm2: Vec<f64>,
    /// Where light ends within the grid, and the pupils up to there.
    pub(crate) lit_fields: Option<LitFields>,
}

/// Where a field lands, and how places move with it.
pub(crate) struct Landed {
    pub(crate) at_mm: DVec2,
    /// Derivatives with respect to the tangents across (first column) and up, mm.
    pub(crate) slope_mm: DMat2,
    pub(crate) pupil_mm2: f64,
}

impl Landed {
    /// Irradiance over radiance, sr.
    pub(crate) fn irradiance_per_radiance(&self) -> f64 {
        self.pupil_mm2 / self.slope_mm.determinant().abs()
    }
}

impl Landing<'_> {
    /// Returns where a field lands, by cubics through the samples about it.
    pub(crate) fn of(&self, field_tan: DVec2) -> Landed {
        let n_x = self.x.knots().len();
        let [x, x_slope] = self.x.value_and_slope(field_tan.x);
        let [y, y_slope] = self.y.value_and_slope(field_tan.y);
        let sum = |x: &Stencil, y: &Stencil| -> DVec2 {
            y.iter()
                .map(|(j, wy)| x.iter().map(|(i, wx)| self.centroids_mm[j * n_x + i] * (wx * wy)).sum::<DVec2>())
                .sum()
        };
        let pupil = |x: &Stencil, y: &Stencil| {
            let terms = y.iter().flat_map(|(j, wy)| x.iter().map(move |(i, wx)| (j * n_x + i, wx * wy)));
            terms.fold((0.0, true), |(sum, lit), (node, weight)| {
                (sum + weight * self.pupils_mm2[node], lit && self.pupils_mm2[node] > 0.0)
            })
        };
        let pupil_mm2 = self.lit_fields.as_ref().map_or_else(
            || {
                let (smooth_mm2, is_lit) = pupil(&x, &y);
                // Cubics swing at the edge of the light; straight lines do not.
                match is_lit {
                    true => smooth_mm2,
                    false => pupil(&self.x.linear(field_tan.x), &self.y.linear(field_tan.y)).0,
                }
            },
            |lit| lit.pupil_mm2(field_tan),
        );
        Landed {
            at_mm: sum(&x, &y),
            slope_mm: DMat2::from_cols(sum(&x_slope, &y), sum(&x, &y_slope)),
            pupil_mm2: pupil_mm2.max(0.0),
        }
    }

    /// Returns the field that lands at a place, sought from another, or `None` if it is not of the grid.
    fn field_at(&self, place_mm: DVec2, from: DVec2) -> Option<(DVec2, Landed)> {
        let ends = |axis: &Axis| (axis.knots()[0], axis.knots()[axis.knots().len() - 1]);
        let ((left, right), (bottom, top)) = (ends(self.x), ends(self.y));
        let (low, high) = (DVec2::new(left, bottom), DVec2::new(right, top));
        let span = high - low;
        let mut field_tan = from;
        let mut landed = self.of(field_tan);
        for _ in 0..STEPS {
            let step = landed.slope_mm.inverse() * (place_mm - landed.at_mm);
            if !step.is_finite() {
                return None;
            }
            // A little beyond the samples the cubics still mean something.
            field_tan = (field_tan + step).clamp(low - 0.2 * span, high + 0.2 * span);
            landed = self.of(field_tan);
            // The digits that are right double in each step, but across a knot of the cubics.
            if (step / span).abs().max_element() < 1e-9 {
                break;
            }
        }
        let is_found = (place_mm - landed.at_mm).length() <= 1e-9 * (1.0 + place_mm.length());
        let slack = 1e-9 * span;
        let is_inside = field_tan.cmpge(low - slack).all() && field_tan.cmple(high + slack).all();
        (is_found && is_inside).then_some((field_tan, landed))
    }

    /// Tabulates the inverse over an area of the film.
    pub(crate) fn inverse(&self, area: Area, cancel: &Cancel) -> Result<FieldGeometry, Cancelled> {
        let n_x = self.x.knots().len();
        let step_mm = area.step_mm();
        let nearest = |place_mm: DVec2| {
            let squares = self.centroids_mm.iter().map(|at| at.distance_squared(place_mm)).enumerate();
            let node = squares.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(node, _)| node);
            DVec2::new(self.x.knots()[node % n_x], self.y.knots()[node / n_x])
        };
        let mut nodes = Vec::with_capacity(area.side * area.side);
        for row in 0..area.side {
            cancel.check()?;
            let mut beside: Option<(DVec2, Landed)> = None;
            for column in 0..area.side {
                let place_mm = area.first_mm + step_mm * DVec2::new(column as f64, row as f64);
                let ahead =
                    beside.map(|(field_tan, landed)| field_tan + landed.slope_mm.inverse() * (place_mm - landed.at_mm));
                let from = ahead.filter(|from| from.is_finite()).unwrap_or_else(|| nearest(place_mm));
                beside = self.field_at(place_mm, from);
                let found = beside.as_ref();
                nodes.push(
                    found.map_or([f64::NAN; 3], |(tan, landed)| [tan.x, tan.y, landed.irradiance_per_radiance()]),
                );
            }
        }
        Ok(FieldGeometry { area, nodes })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A lens of 50 mm across and 40 mm up with keystone and barrel distortion, of 100 mm² of pupil.
    fn land(tan: DVec2) -> DVec2 {
        let barrel = 1.0 - 0.05 * tan.length_squared();
        DVec2::new(50.0 * tan.x, 40.0 * tan.y) * barrel * (1.0 + 0.1 * tan.y) + DVec2::new(0.7, -0.2)
    }

    fn landing<'a>(x: &'a Axis, y: &'a Axis, pupil: impl Fn(DVec2) -> f64) -> Landing<'a> {
        let fields = || y.knots().iter().flat_map(|&up| x.knots().iter().map(move |&across| DVec2::new(across, up)));
        Landing {
            x,
            y,
            centroids_mm: fields().map(land).collect(),
            pupils_mm2: fields().map(pupil).collect(),
            lit_fields: None,
        }
    }

    fn axis(half: f64, n: usize) -> Axis {
        Axis::new((0..n).map(|i| half * (2.0 * i as f64 / (n - 1) as f64 - 1.0)).collect()).unwrap()
    }

    #[test]
    fn places_are_traced_back_to_their_fields() {
        let (x, y) = (axis(0.4, 11), axis(0.3, 11));
        let landing = landing(&x, &y, |_| 100.0);
        let geometry =
            landing.inverse(Area::around(landing.centroids_mm.iter().copied(), 11).unwrap(), &Cancel::new()).unwrap();
        for (across, up) in [(0.0, 0.0), (0.31, -0.22), (-0.37, 0.27), (0.12, 0.05)] {
            let field_tan = DVec2::new(across, up);
            let (found, gain) = geometry.at(land(field_tan)).unwrap();
            // The table is straight between nodes 0.3 mm apart: 0.1 µm of 50 mm.
            assert!((found - field_tan).length() < 5e-6, "{found} {field_tan}");
            let by = 1e-6;
            let slope = DMat2::from_cols(
                (land(field_tan + DVec2::X * by) - land(field_tan - DVec2::X * by)) / (2.0 * by),
                (land(field_tan + DVec2::Y * by) - land(field_tan - DVec2::Y * by)) / (2.0 * by),
            );
            // Cubics between samples 0.06 to 0.08 apart miss the slope of this one, of fourth order, by some 1e-4.
            assert!((gain * slope.determinant() / 100.0 - 1.0).abs() < 3e-4, "{gain}");
        }
        assert!(geometry.at(DVec2::new(30.0, 0.0)).is_none());
        let corner = geometry.nearest_field_tan(DVec2::new(60.0, 40.0));
        assert!((corner - DVec2::new(0.4, 0.3)).length() < 0.02, "{corner}");
    }

    #[test]
    fn light_ends_without_swings() {
        let (x, y) = (axis(0.4, 11), axis(0.3, 11));
        let landing = landing(&x, &y, |tan| if tan.x > 0.25 { 0.0 } else { 100.0 });
        let geometry =
            landing.inverse(Area::around(landing.centroids_mm.iter().copied(), 11).unwrap(), &Cancel::new()).unwrap();
        let full = geometry.at(land(DVec2::new(0.1, 0.0))).unwrap().1;
        for i in 0..40 {
            let at = DVec2::new(0.01 * f64::from(i), 0.0);
            let gain = geometry.at(land(at)).unwrap().1;
            assert!(gain >= 0.0 && gain < 1.1 * full, "{at} {gain}");
            // Samples lie 0.08 apart, the last lit one at 0.24; nodes of the table 0.006.
            assert!(at.x < 0.327 || gain < 1e-12, "{at} {gain}");
        }
    }

    #[test]
    fn weights_mix_tables() {
        let (x, y) = (axis(0.4, 5), axis(0.3, 5));
        let landing = landing(&x, &y, |_| 100.0);
        let area = Area::between(DVec2::splat(-5.0), DVec2::splat(5.0), NODES);
        let geometry = landing.inverse(area, &Cancel::new()).unwrap();
        let mixed = FieldGeometry::mix([(&geometry, 0.75), (&geometry, 0.25)].into_iter()).unwrap();
        let at = DVec2::new(1.3, -2.2);
        assert!((mixed.at(at).unwrap().0 - geometry.at(at).unwrap().0).length() < 1e-15);
    }
}
