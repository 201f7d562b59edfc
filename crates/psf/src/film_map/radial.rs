//! The map of a lens with an axis of symmetry.

use glam::{DMat2, DVec2, DVec3};
use multiversion::multiversion;

use super::{FieldsAlong, LEAST_COSINE};
use crate::lattice::Lattice;

/// From the distance from an axis to the direction seen there, and to the irradiance.
///
/// Directions are kept as the tangent of half the angle, which is smooth through 90° and beyond.
#[derive(Clone, Debug)]
pub(crate) struct RadialMap {
    entries_per_mm: f64,
    reach_mm: f64,
    /// tan(θ/2) over the distance from the axis, 1/mm; negative where the picture is upright.
    half_tan_per_mm: Table,
    irradiance_sr: Table,
    /// tan(θ/2) at the last entry, and its slope, with which it goes on.
    last_half_tan: f64,
    last_slope: f64,
    /// The inverse: distance over tan(θ/2), mm, over the magnitude of tan(θ/2).
    entries_per_half_tan: f64,
    mm_per_half_tan: Table,
    /// Where the axis meets the film, and the tangents seen there.
    axis_mm: DVec2,
    axis_tan: DVec2,
}

/// Evenly spaced values of an even function from 0 on, and cubics between them whose slopes go on at each (Catmull and Rom's).
#[derive(Clone, Debug)]
struct Table {
    values: Vec<f64>,
    /// Half the second difference at each.
    bends: Vec<f64>,
}

impl Table {
    /// Takes two values or more.
    fn new(values: Vec<f64>) -> Self {
        let last = values.len() - 1;
        let bend = |i: usize| match i {
            0 => values[1] - values[0],
            i if i < last => 0.5 * (values[i - 1] - 2.0 * values[i] + values[i + 1]),
            // At its end it bends as beside it.
            _ if last > 1 => 0.5 * (values[last - 2] - 2.0 * values[last - 1] + values[last]),
            _ => 0.0,
        };
        let bends = (0..=last).map(bend).collect();
        Self { values, bends }
    }

    /// Returns the value at a place counted in entries; beyond the last, that.
    #[inline(always)]
    fn at(&self, place: f64) -> f64 {
        let last = self.values.len() - 1;
        let place = if place < last as f64 { place } else { last as f64 };
        let below = (place as i32 as usize).min(last - 1);
        let fraction = place - below as f64;
        let (from, to) = (self.values[below], self.values[below + 1]);
        let bend = self.bends[below] + fraction * (self.bends[below + 1] - self.bends[below]);
        from + fraction * (to - from) + fraction * (fraction - 1.0) * bend
    }

    /// Returns the slope per entry at a place within the table.
    #[inline]
    fn slope(&self, place: f64) -> f64 {
        let below = (place as usize).min(self.values.len() - 2);
        let fraction = place - below as f64;
        let change = self.bends[below + 1] - self.bends[below];
        let bend = self.bends[below] + fraction * change;
        self.values[below + 1] - self.values[below]
            + (2.0 * fraction - 1.0) * bend
            + fraction * (fraction - 1.0) * change
    }

    fn size_bytes(&self) -> usize {
        size_of_val(self.values.as_slice()) + size_of_val(self.bends.as_slice())
    }
}

impl RadialMap {
    /// Tabulates a lens: see [`FilmMap::radial`](super::FilmMap::radial).
    pub(super) fn tabulate(
        reach_mm: f64,
        tan_at: impl Fn(f64) -> Option<f64>,
        irradiance_sr: impl Fn(f64) -> f64,
    ) -> Self {
        Self::from_half_tans(
            (reach_mm, Lattice::STEPS_OF_SCALE * Lattice::ENTRIES),
            |radius_mm| tan_at(radius_mm).map(|tan| tan / (1.0 + tan.hypot(1.0))),
            |radius_mm| tan_at(radius_mm).map_or(0.0, &irradiance_sr),
        )
    }

    /// Tabulates a lens over so many intervals by tan(θ/2) and irradiance, sr, at distances from the axis, mm; where there is no direction, or from where on
    /// directions turn back, they go on straight in tan(θ/2).
    pub(crate) fn from_half_tans(
        (reach_mm, last): (f64, usize),
        half_tan_at: impl Fn(f64) -> Option<f64>,
        irradiance_sr: impl Fn(f64) -> f64,
    ) -> Self {
        let entries_per_mm = last as f64 / reach_mm;
        let radius_mm = |entry: f64| entry / entries_per_mm;
        // At the axis the ratio is 0/0; a thousandth of the first step stands for it.
        let first = half_tan_at(radius_mm(1e-3)).map(|half_tan| half_tan / radius_mm(1e-3));
        let first = first.filter(|ratio| *ratio != 0.0).unwrap_or(1.0 / reach_mm);
        let mut per_mm = vec![first];
        let mut half_tan_before = 0.0;
        let mut rise = first.abs() * radius_mm(1.0);
        let mut goes_on = true;
        for entry in 1..=last {
            let found = if goes_on { half_tan_at(radius_mm(entry as f64)) } else { None };
            let half_tan = found.map(|half_tan| half_tan * first.signum());
            // By more than rounding.
            let is_rising = |half_tan: &f64| *half_tan - half_tan_before > f64::EPSILON.sqrt() * half_tan.abs();
            let half_tan = half_tan.filter(is_rising).unwrap_or_else(|| {
                goes_on = false;
                half_tan_before + rise
            });
            rise = half_tan - half_tan_before;
            half_tan_before = half_tan;
            per_mm.push(half_tan * first.signum() / radius_mm(entry as f64));
        }
        let half_tan_per_mm = Table::new(per_mm);
        let irradiance_sr = Table::new((0..=last).map(|entry| irradiance_sr(radius_mm(entry as f64))).collect());
        let mut map = Self {
            entries_per_mm,
            reach_mm,
            last_half_tan: half_tan_per_mm.values[last] * reach_mm,
            last_slope: half_tan_per_mm.values[last] + reach_mm * entries_per_mm * half_tan_per_mm.slope(last as f64),
            half_tan_per_mm,
            irradiance_sr,
            entries_per_half_tan: 0.0,
            mm_per_half_tan: Table { values: vec![], bends: vec![] },
            axis_mm: DVec2::ZERO,
            axis_tan: DVec2::ZERO,
        };
        map.invert();
        map
    }

    /// Tabulates the inverse.
    fn invert(&mut self) {
        let last = self.half_tan_per_mm.values.len() - 1;
        let sign = self.last_half_tan.signum();
        self.entries_per_half_tan = last as f64 / self.last_half_tan.abs();
        let mut values = vec![1.0 / self.half_tan_per_mm.values[0]];
        let half_tan = |radius_mm: f64| sign * self.half_tan_per_mm.at(radius_mm * self.entries_per_mm) * radius_mm;
        let mut above = 1;
        for entry in 1..=last {
            let wanted = entry as f64 / self.entries_per_half_tan;
            while above < last && half_tan(above as f64 / self.entries_per_mm) < wanted {
                above += 1;
            }
            let [mut low, mut high] = [above - 1, above].map(|entry| entry as f64 / self.entries_per_mm);
            let mut radius_mm = high;
            // Newton's steps, halving where they leave the bracket.
            for _ in 0..60 {
                let off = half_tan(radius_mm) - wanted;
                if off > 0.0 {
                    high = radius_mm
                } else {
                    low = radius_mm
                }
                let slope = sign * self.half_tan_slope(radius_mm);
                let next = radius_mm - off / slope;
                let next = if next > low && next < high { next } else { 0.5 * (low + high) };
                let is_found = (next - radius_mm).abs() <= 1e-15 * self.reach_mm;
                radius_mm = next;
                if is_found {
                    break;
                }
            }
            values.push(sign * radius_mm / wanted);
        }
        self.mm_per_half_tan = Table::new(values);
    }

    /// Returns d tan(θ/2) / dr, 1/mm.
    #[inline]
    fn half_tan_slope(&self, radius_mm: f64) -> f64 {
        if radius_mm >= self.reach_mm {
            return self.last_slope;
        }
        let place = radius_mm * self.entries_per_mm;
        self.half_tan_per_mm.at(place) + place * self.half_tan_per_mm.slope(place)
    }

    pub(super) fn axis_mm(&self) -> DVec2 {
        self.axis_mm
    }

    pub(super) fn about(self, axis_mm: DVec2, axis_tan: DVec2) -> Self {
        Self { axis_mm, axis_tan, ..self }
    }

    /// Returns tan(θ/2) over the distance from the axis.
    #[inline(always)]
    fn per_mm(&self, radius_mm: f64) -> f64 {
        let within = self.half_tan_per_mm.at(radius_mm * self.entries_per_mm);
        let beyond = (self.last_half_tan + self.last_slope * (radius_mm - self.reach_mm)) / radius_mm;
        if radius_mm > self.reach_mm { beyond } else { within }
    }

    #[inline]
    pub(super) fn direction(&self, place_mm: DVec2) -> DVec3 {
        let from_axis_mm = place_mm - self.axis_mm;
        let half_tan = from_axis_mm * self.per_mm(from_axis_mm.length());
        // tan θ = 2 q / (1 − q²)
        let ahead = 1.0 - half_tan.length_squared();
        (2.0 * half_tan + self.axis_tan * ahead).extend(ahead)
    }

    #[inline]
    pub(super) fn irradiance_sr(&self, place_mm: DVec2) -> f64 {
        self.irradiance_sr.at(place_mm.distance(self.axis_mm) * self.entries_per_mm).max(0.0)
    }

    #[inline]
    pub(super) fn place_of(&self, direction: DVec3) -> DVec2 {
        let across = direction.truncate() - self.axis_tan * direction.z;
        let square = across.length_squared();
        let half_tan = across / (direction.z + (square + direction.z * direction.z).sqrt());
        let magnitude = half_tan.length();
        let last = self.last_half_tan.abs();
        if magnitude > last {
            let radius_mm = self.reach_mm + (magnitude - last) / self.last_slope.abs();
            return self.axis_mm + half_tan * (self.last_half_tan.signum() * radius_mm / magnitude);
        }
        self.axis_mm + half_tan * self.mm_per_half_tan.at(magnitude * self.entries_per_half_tan)
    }

    /// Returns the tangent of the axis.
    pub(super) fn axis_tan(&self) -> DVec2 {
        self.axis_tan
    }

    /// Returns the derivative of points by the tangents of half the angle to the axis that they see, mm.
    #[inline]
    pub(super) fn by_half_tan(&self, place_mm: DVec2) -> DMat2 {
        let from_axis_mm = place_mm - self.axis_mm;
        let radius_mm = from_axis_mm.length();
        let (across, along) = (1.0 / self.per_mm(radius_mm), 1.0 / self.half_tan_slope(radius_mm));
        let radial = from_axis_mm.try_normalize().unwrap_or(DVec2::X);
        let outer = DMat2::from_cols(radial * radial.x, radial * radial.y);
        outer * (along - across) + DMat2::IDENTITY * across
    }

    #[inline]
    pub(super) fn jacobian_mm(&self, place_mm: DVec2) -> DMat2 {
        let from_axis_mm = place_mm - self.axis_mm;
        let radius_mm = from_axis_mm.length();
        let (per_mm, slope) = (self.per_mm(radius_mm), self.half_tan_slope(radius_mm));
        let square = (per_mm * radius_mm).powi(2);
        let across = (1.0 - square) / (2.0 * per_mm);
        let along = (1.0 - square).powi(2) / (2.0 * (1.0 + square) * slope);
        let radial = from_axis_mm.try_normalize().unwrap_or(DVec2::X);
        let outer = DMat2::from_cols(radial * radial.x, radial * radial.y);
        outer * (along - across) + DMat2::IDENTITY * across
    }

    pub(super) fn along(&self, (x_mm, y_mm): (&[f64], f64), from_mm: DVec2, seen: &mut FieldsAlong) {
        look_up(self, (x_mm, y_mm), self.axis_mm - from_mm, seen);
    }

    pub(super) fn size_bytes(&self) -> usize {
        let tables = [&self.half_tan_per_mm, &self.irradiance_sr, &self.mm_per_half_tan];
        tables.into_iter().map(Table::size_bytes).sum()
    }
}

/// Looks up each point of a row.
#[multiversion(targets("x86_64+avx2", "aarch64+neon"))]
fn look_up(map: &RadialMap, (x_mm, y_mm): (&[f64], f64), axis_mm: DVec2, seen: &mut FieldsAlong) {
    let y_mm = y_mm - axis_mm.y;
    let FieldsAlong { tan_x, tan_y, irradiance_sr } = seen;
    let outputs = tan_x.iter_mut().zip(tan_y.iter_mut()).zip(irradiance_sr.iter_mut());
    for (&x_mm, ((tan_x, tan_y), sr)) in x_mm.iter().zip(outputs) {
        let x_mm = x_mm - axis_mm.x;
        let radius_mm = (x_mm * x_mm + y_mm * y_mm).sqrt();
        let per_mm = map.per_mm(radius_mm);
        let square = (per_mm * radius_mm) * (per_mm * radius_mm);
        let ahead = 1.0 - square;
        let tan_per_mm = if ahead > LEAST_COSINE * (1.0 + square) { 2.0 * per_mm / ahead } else { f64::NAN };
        (*tan_x, *tan_y) = (x_mm * tan_per_mm + map.axis_tan.x, y_mm * tan_per_mm + map.axis_tan.y);
        *sr = map.irradiance_sr.at(radius_mm * map.entries_per_mm).max(0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::{super::FilmMap, *};

    /// A lens of 50 mm with distortion, an erect picture, and a fisheye up to 100°.
    #[test]
    fn points_and_directions_are_each_others_inverse() {
        let barrel = |r: f64| Some(r / 50.0 * (1.0 + 1e-4 * r * r));
        let upright = |r: f64| Some(-r / 50.0 * (1.0 - 1e-4 * r * r));
        let fisheye = |r: f64| Some(0.5 * f64::tan(r / 12.0) * 2.0);
        check(FilmMap::radial(20.0, barrel, |_| 1.0), barrel);
        check(FilmMap::radial(20.0, upright, |_| 1.0), upright);
        check(FilmMap::radial(18.0, fisheye, |_| 1.0), fisheye);
    }

    #[track_caller]
    fn check(map: FilmMap, tan_at: impl Fn(f64) -> Option<f64>) {
        let map = map.about(DVec2::new(0.3, -0.2), DVec2::new(0.01, 0.0)).counted_from(DVec2::new(0.5, 0.5));
        let mut seen = FieldsAlong::default();
        for r in [1e-9, 0.01, 3.3, 12.0, 17.9] {
            let outwards = DVec2::new(0.6, -0.8);
            let place_mm = DVec2::new(-0.2, -0.7) + r * outwards;
            let tan = map.field_tan(place_mm).unwrap();
            let expected = DVec2::new(0.01, 0.0) + outwards * tan_at(r).unwrap();
            assert!((tan - expected).length() < 1e-9 * (1.0 + expected.length_squared()), "{r}: {tan} {expected}");
            let back_mm = map.place_mm(tan).unwrap();
            assert!((back_mm - place_mm).length() < 1e-9 * 20.0, "{r}: {back_mm} {place_mm}");
            map.along(&[place_mm.x], place_mm.y, &mut seen);
            assert!((DVec2::new(seen.tan_x[0], seen.tan_y[0]) - tan).length() < 1e-12 * (1.0 + tan.length()));
            let by = 1e-5;
            let slope = |way: DVec2| {
                (map.place_mm(tan + by * way).unwrap() - map.place_mm(tan - by * way).unwrap()) / (2.0 * by)
            };
            let jacobian = map.jacobian_mm(place_mm);
            let changes = [DVec3::new(0.3, 0.1, -0.2), DVec3::new(0.0, 1.0, 0.5)];
            let direction = 1.7 * map.direction(place_mm);
            for (found, change) in map.moves_mm(place_mm, direction, changes).into_iter().zip(changes) {
                let place = |by: f64| map.place_of(direction + by * change);
                let expected = (place(1e-5) - place(-1e-5)) / 2e-5;
                assert!((found - expected).length() < 1e-4 * expected.length(), "{r}: {found} {expected}");
            }
            for way in [DVec2::X, DVec2::Y] {
                assert!((jacobian * way - slope(way)).length() < 1e-4 * jacobian.determinant().abs().sqrt(), "{r}");
            }
        }
    }

    /// Light ends, directions go on.
    #[test]
    fn directions_go_on_beyond_the_light() {
        let map = FilmMap::radial(32.0, |r| (r < 8.0).then_some(r / 50.0), |_| 2.0);
        assert_eq!((map.irradiance_sr(DVec2::X * 7.9), map.irradiance_sr(DVec2::X * 8.1)), (2.0, 0.0));
        let tans: Vec<f64> = (0..60).map(|r| map.field_tan(DVec2::Y * f64::from(r)).unwrap().y).collect();
        assert!(tans.windows(2).all(|pair| pair[1] > pair[0]), "{tans:?}");
        assert!((tans[16] / (16.0 / 50.0) - 1.0).abs() < 0.02);
        // Nothing at all is seen.
        let dark = FilmMap::radial(10.0, |_| None, |_| 2.0);
        assert_eq!(dark.irradiance_sr(DVec2::X), 0.0);
        assert!(dark.field_tan(DVec2::X).is_some());
    }

    /// Near the axis light that falls off in a cone has no kinks but its own.
    #[test]
    fn light_has_no_kinks_at_entries() {
        let peak = |r: f64| 1.0 + 0.01 * (1.0 - r / 3.0);
        let map = FilmMap::radial(12.0, |r| Some(r / 50.0), |tan| peak(50.0 * tan));
        for i in 1..400 {
            let r = 0.01 * f64::from(i);
            let off = map.irradiance_sr(DVec2::X * r) - peak(r);
            assert!(off.abs() < 3e-6, "{off} at {r} mm");
        }
    }
}
