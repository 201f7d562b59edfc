//! From places on the film to the fields that are seen there.

use glam::DVec2;
use multiversion::multiversion;

use crate::{FieldGeometry, FieldsAlong};

mod shifted;

pub use shifted::{PartOfPoint, ShiftedMap};

/// From a distance on the film to the field seen there, and the irradiance that it gets; for one depth and wavelength.
///
/// The map is that of the centroids of the PSFs, so distortion and lateral color are in it. Its axis is the middle of the film
/// and looks at the middle of the scene, unless it is [`about`](Self::about) another.
#[derive(Clone, Debug)]
pub struct RadialMap {
    // Invariants: at least two entries, evenly spaced in the square of the distance, as many gains as ratios.
    entries_per_mm2: f64,
    tan_per_mm: Table,
    irradiance_per_radiance: Table,
    extent_mm: f64,
    /// Where the axis meets the film and the field seen there, in the picture frame.
    axis_mm: DVec2,
    axis_tan: DVec2,
}

/// Evenly spaced values of a smooth function, and cubics between them whose slopes go on at each (Catmull and Rom's); they pass values where these bend: light
/// beside darkness falls below 0. Where rims cut the pupil from the smallest fields on, the film's light falls off in a cone, and a kink at an entry is seen:
/// in red light through a double Gauss at f/2 straight lines left 3e-4 of the light at the first one, 11 pixels from the axis, and parabolas 1.3e-4.
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
        // At its ends it bends as beside them.
        let bend = |i: usize| match i.clamp(1, (last - 1).max(1)) {
            i if i < last => 0.5 * (values[i - 1] - 2.0 * values[i] + values[i + 1]),
            _ => 0.0,
        };
        let bends = (0..=last).map(bend).collect();
        Self { values, bends }
    }

    /// The number of intervals.
    fn n_intervals(&self) -> usize {
        self.values.len() - 1
    }

    /// Returns the value a fraction of the way from one entry to the next.
    #[inline(always)]
    fn at(&self, below: usize, fraction: f64) -> f64 {
        let (from, to) = (self.values[below], self.values[below + 1]);
        let bend = self.bends[below] + fraction * (self.bends[below + 1] - self.bends[below]);
        from + fraction * (to - from) + fraction * (fraction - 1.0) * bend
    }

    fn size_bytes(&self) -> usize {
        size_of_val(self.values.as_slice()) + size_of_val(self.bends.as_slice())
    }
}

impl RadialMap {
    /// Entries of the table: an error below 1e-6 for the smooth maps of lenses.
    const N_ENTRIES: usize = 1025;

    /// Tabulates a lens up to `extent_mm` off axis, or to where the last field is seen if that is less.
    ///
    /// `tan_at` gives the field seen at a distance on the film, mm, `None` where nothing is; `gain_at` the irradiance
    /// per radiance of a field, sr.
    pub fn tabulate(extent_mm: f64, tan_at: impl Fn(f64) -> Option<f64>, gain_at: impl Fn(f64) -> f64) -> Self {
        let n = Self::N_ENTRIES;
        // Entries beyond the last field would be lost to the table, however many there are within.
        let extent_mm = last_seen_mm(extent_mm, &tan_at);
        let entries_per_mm2 = (n - 1) as f64 / (extent_mm * extent_mm);
        let (mut tan_per_mm, mut irradiance_per_radiance) = (Vec::with_capacity(n), Vec::with_capacity(n));
        for entry in 0..n {
            // At the axis the ratio is 0/0; a thousandth of the first step stands for it.
            let radius_mm = (f64::max(entry as f64, 1e-6) / entries_per_mm2).sqrt().min(extent_mm);
            let Some(tan) = tan_at(radius_mm) else { break };
            tan_per_mm.push(tan / radius_mm);
            irradiance_per_radiance.push(gain_at(tan));
        }
        let extent_mm = (tan_per_mm.len().saturating_sub(1) as f64 / entries_per_mm2).sqrt();
        if tan_per_mm.len() < 2 {
            (tan_per_mm, irradiance_per_radiance) = (vec![0.0; 2], vec![0.0; 2]);
        }
        let (tan_per_mm, irradiance_per_radiance) = (Table::new(tan_per_mm), Table::new(irradiance_per_radiance));
        let (axis_mm, axis_tan) = (DVec2::ZERO, DVec2::ZERO);
        Self { entries_per_mm2, tan_per_mm, irradiance_per_radiance, extent_mm, axis_mm, axis_tan }
    }

    /// Returns the map of a lens moved sideways: about an axis that meets the film at `axis_mm` (x right, y up, from its middle)
    /// and looks at the field `axis_tan` of the scene.
    #[must_use]
    pub fn about(self, axis_mm: DVec2, axis_tan: DVec2) -> Self {
        Self { axis_mm, axis_tan, ..self }
    }

    /// Where the axis meets the film, mm from its middle.
    pub fn axis_mm(&self) -> DVec2 {
        self.axis_mm
    }

    /// How far from the axis anything is seen, mm.
    pub fn extent_mm(&self) -> f64 {
        self.extent_mm
    }

    /// Returns the field per mm of film (1/mm) and the irradiance per radiance (sr) where the squared distance
    /// from the axis is `radius2_mm2`; `None` beyond the extent.
    // Within the loops over the samples of a film, whose time it is half of when called.
    #[inline]
    pub fn at(&self, radius2_mm2: f64) -> Option<(f64, f64)> {
        let place = radius2_mm2 * self.entries_per_mm2;
        let last = self.tan_per_mm.n_intervals();
        if place > last as f64 || self.extent_mm == 0.0 {
            return None;
        }
        let below = (place as usize).min(last - 1);
        let fraction = place - below as f64;
        Some((self.tan_per_mm.at(below, fraction), self.irradiance_per_radiance.at(below, fraction).max(0.0)))
    }

    /// As [`at`](Self::at) at each place.
    fn along(&self, x_mm: &[f64], y_mm: f64, seen: &mut FieldsAlong) {
        if self.extent_mm == 0.0 {
            seen.irradiance_per_radiance.fill(f64::NAN);
            return;
        }
        let tables = (&self.tan_per_mm, &self.irradiance_per_radiance);
        look_up(tables, self.entries_per_mm2, (x_mm, y_mm), (self.axis_mm, self.axis_tan), seen);
    }

    /// Returns the field at a place of the film, mm from its middle; beyond the extent, that of the last place in it.
    pub fn field_tan(&self, place_mm: DVec2) -> DVec2 {
        let place_mm = place_mm - self.axis_mm;
        if let Some((tan_per_mm, _)) = self.at(place_mm.length_squared()) {
            return place_mm * tan_per_mm + self.axis_tan;
        }
        let tan = self.tan_per_mm.values[self.tan_per_mm.n_intervals()] * self.extent_mm;
        place_mm / place_mm.length() * tan + self.axis_tan
    }
}

/// Looks up a radial map at each place of a row.
#[multiversion(targets("x86_64+avx2", "aarch64+neon"))]
fn look_up(
    (tan_per_mm, irradiance_per_radiance): (&Table, &Table),
    entries_per_mm2: f64,
    (x_mm, y_mm): (&[f64], f64),
    (axis_mm, axis_tan): (DVec2, DVec2),
    seen: &mut FieldsAlong,
) {
    let y_mm = y_mm - axis_mm.y;
    let last = tan_per_mm.n_intervals();
    let end = last as f64;
    let FieldsAlong { tan_x, tan_y, irradiance_per_radiance: gain } = seen;
    let outputs = tan_x.iter_mut().zip(tan_y.iter_mut()).zip(gain.iter_mut());
    for (&x_mm, ((tan_x, tan_y), gain)) in x_mm.iter().zip(outputs) {
        let x_mm = x_mm - axis_mm.x;
        let place = (x_mm * x_mm + y_mm * y_mm) * entries_per_mm2;
        // Beyond the table its last entry is read, and not used.
        let below = (place.min(end) as i32 as usize).min(last - 1);
        let fraction = place - below as f64;
        let tan = tan_per_mm.at(below, fraction);
        (*tan_x, *tan_y) = (x_mm * tan + axis_tan.x, y_mm * tan + axis_tan.y);
        *gain = if place > end { f64::NAN } else { irradiance_per_radiance.at(below, fraction).max(0.0) };
    }
}

/// Returns the distance up to which something is seen, at most `extent_mm`, from within: to the last digits of a number.
fn last_seen_mm(extent_mm: f64, tan_at: impl Fn(f64) -> Option<f64>) -> f64 {
    let (mut seen, mut dark) = (0.0, extent_mm);
    if tan_at(extent_mm).is_some() {
        return extent_mm;
    }
    while dark - seen > 1e-14 * extent_mm {
        let middle = 0.5 * (seen + dark);
        if middle <= seen || middle >= dark {
            break;
        }
        if tan_at(middle).is_some() { seen = middle } else { dark = middle }
    }
    // Where nothing is seen at all there is a table of one entry, of nothing.
    if seen > 0.0 { seen } else { extent_mm }
}

/// From places of the film to the fields seen there, and the irradiance that they get; for one depth and wavelength.
#[derive(Clone, Debug)]
pub enum FilmMap {
    /// Of a lens with an axis of symmetry.
    Radial(RadialMap),
    /// Of any other.
    Plane(FieldGeometry),
    /// Of a part of a pupil.
    Shifted(ShiftedMap),
}

impl From<RadialMap> for FilmMap {
    fn from(map: RadialMap) -> Self {
        Self::Radial(map)
    }
}

impl From<FieldGeometry> for FilmMap {
    fn from(map: FieldGeometry) -> Self {
        Self::Plane(map)
    }
}

impl FilmMap {
    /// Returns the field seen at a place of the film (mm from its middle, x right, y up) and the irradiance per radiance (sr);
    /// `None` where nothing is seen.
    #[inline]
    pub fn at(&self, place_mm: DVec2) -> Option<(DVec2, f64)> {
        match self {
            Self::Radial(map) => {
                let place_mm = place_mm - map.axis_mm;
                let seen = map.at(place_mm.length_squared());
                seen.map(|(tan_per_mm, gain)| (place_mm * tan_per_mm + map.axis_tan, gain))
            }
            Self::Plane(map) => map.at(place_mm),
            Self::Shifted(map) => map.at(place_mm),
        }
    }

    /// As [`at`](Self::at) at places of one height: `x_mm` to the right of the middle and `y_mm` above it.
    pub fn along(&self, x_mm: &[f64], y_mm: f64, seen: &mut FieldsAlong) {
        seen.resize(x_mm.len());
        match self {
            Self::Radial(map) => map.along(x_mm, y_mm, seen),
            Self::Plane(map) => map.along(x_mm, y_mm, seen),
            Self::Shifted(map) => {
                for (i, &x_mm) in x_mm.iter().enumerate() {
                    let (tan, gain) = map.at(DVec2::new(x_mm, y_mm)).unwrap_or((DVec2::ZERO, f64::NAN));
                    (seen.tan_x[i], seen.tan_y[i], seen.irradiance_per_radiance[i]) = (tan.x, tan.y, gain);
                }
            }
        }
    }

    /// Returns the field at a place of the film; where nothing is seen, that of a place near by.
    pub fn field_tan(&self, place_mm: DVec2) -> DVec2 {
        match self {
            Self::Radial(map) => map.field_tan(place_mm),
            Self::Plane(map) => map.nearest_field_tan(place_mm),
            Self::Shifted(map) => map.field_tan(place_mm),
        }
    }

    /// Returns the map with places counted from another: `from_mm` is where that is now.
    #[must_use]
    pub fn counted_from(self, from_mm: DVec2) -> Self {
        match self {
            Self::Radial(map) => {
                let (axis_mm, axis_tan) = (map.axis_mm - from_mm, map.axis_tan);
                Self::Radial(map.about(axis_mm, axis_tan))
            }
            Self::Plane(map) => Self::Plane(map.counted_from(from_mm)),
            Self::Shifted(map) => Self::Shifted(map.counted_from(from_mm)),
        }
    }

    /// The bytes of memory that it takes.
    pub fn size_bytes(&self) -> usize {
        match self {
            Self::Radial(map) => map.tan_per_mm.size_bytes() + map.irradiance_per_radiance.size_bytes(),
            Self::Plane(map) => map.size_bytes(),
            Self::Shifted(map) => map.size_bytes(),
        }
    }

    /// Returns the field per mm of film at the axis, 1/mm: the root of how much field an area of film sees, about
    /// `over_mm` each way.
    pub fn tan_per_mm(&self, over_mm: f64) -> f64 {
        match self {
            Self::Radial(map) => map.at(0.0).map_or(0.0, |(tan_per_mm, _)| tan_per_mm),
            Self::Plane(map) => {
                let tan = |place_mm: DVec2| map.nearest_field_tan(place_mm);
                let across = tan(DVec2::X * over_mm) - tan(DVec2::NEG_X * over_mm);
                let up = tan(DVec2::Y * over_mm) - tan(DVec2::NEG_Y * over_mm);
                across.perp_dot(up).abs().sqrt() / (2.0 * over_mm)
            }
            Self::Shifted(map) => map.whole().tan_per_mm(over_mm),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A table that was asked for far beyond the last field had few entries left within it, or none.
    #[test]
    fn map_ends_where_the_last_field_is_seen() {
        for extent_mm in [3.6, 4.0, 40.0, 4e3, 4e6] {
            let tan_at = |r: f64| (r <= 3.5).then_some(r / 50.0);
            let map = RadialMap::tabulate(extent_mm, tan_at, |_| 2.0);
            assert!((map.extent_mm() / 3.5 - 1.0).abs() < 1e-6, "{extent_mm}: {}", map.extent_mm());
            for r in [0.0, 1.0, 3.4999] {
                let (tan_per_mm, gain) = map.at(r * r).unwrap();
                assert!((tan_per_mm * 50.0 - 1.0).abs() < 1e-12 && (gain - 2.0).abs() < 1e-12);
            }
            assert!(map.at(3.5001_f64.powi(2)).is_none());
        }
        let dark = RadialMap::tabulate(10.0, |_| None, |_| 2.0);
        assert!(dark.extent_mm() == 0.0 && dark.at(0.0).is_none());
    }

    #[test]
    fn map_follows_a_lens_with_distortion() {
        let tan_at = |r: f64| Some(r / 50.0 * (1.0 + 1e-4 * r * r));
        let map = RadialMap::tabulate(20.0, tan_at, |tan| 1.0 / (1.0 + tan * tan).powi(2));
        for r in [0.0_f64, 0.01, 3.3, 12.0, 19.9] {
            let tan = map.field_tan(DVec2::new(r, 0.0)).x;
            let expected = tan_at(r).unwrap();
            // A thousandth of a 4 µm pixel at 50 mm.
            assert!((tan - expected).abs() < 1e-7, "{r} mm: {tan} {expected}");
            let gain = map.at(r * r).unwrap().1;
            assert!((gain - (1.0 + expected * expected).powi(-2)).abs() < 1e-6);
        }
    }

    /// Near the axis, where entries lie farthest apart, light that falls off there alone has no kinks.
    #[test]
    fn light_has_no_kinks_at_entries() {
        let peak = |r2: f64| 1.0 + 0.01 / (1.0 + r2 / 0.5);
        let map = RadialMap::tabulate(12.0, |r| Some(r / 50.0), |tan| peak((50.0 * tan).powi(2)));
        let gain = |i: i32| map.at((0.01 * f64::from(i)).powi(2)).unwrap().1;
        for i in 1..400 {
            let expected = |i: i32| peak((0.01 * f64::from(i)).powi(2));
            let bend = |value: &dyn Fn(i32) -> f64| value(i - 1) - 2.0 * value(i) + value(i + 1);
            let kink = bend(&gain) - bend(&expected);
            // 3.1e-6; straight lines between entries leave 2.9e-5.
            assert!(kink.abs() < 5e-6, "{kink} {i} hundredths of a millimetre off axis");
        }
    }

    /// Where light ends at an entry the parabola beside it falls below 0.
    #[test]
    fn light_is_never_below_darkness() {
        let map = FilmMap::Radial(RadialMap::tabulate(32.0, |r| Some(r / 50.0), |tan| f64::from(50.0 * tan < 8.0)));
        let x_mm: Vec<f64> = (0..4000).map(|i| 7.9 + 5e-5 * f64::from(i)).collect();
        let mut seen = FieldsAlong::default();
        map.along(&x_mm, 0.0, &mut seen);
        let gains =
            || x_mm.iter().map(|&x| map.at(DVec2::new(x, 0.0)).unwrap().1).chain(seen.irradiance_per_radiance.clone());
        assert!(gains().all(|gain| (0.0..1.1).contains(&gain)));
        assert!(gains().any(|gain| gain == 0.0) && gains().any(|gain| (0.3..0.7).contains(&gain)));
    }

    #[test]
    fn row_is_seen_as_its_places() {
        let tan_at = |r: f64| (r < 15.0).then_some(r / 50.0 * (1.0 + 1e-4 * r * r));
        let map = FilmMap::Radial(RadialMap::tabulate(20.0, tan_at, |tan| 1.0 / (1.0 + tan * tan).powi(2)));
        let dark = FilmMap::Radial(RadialMap::tabulate(20.0, |_| None, |_| 1.0));
        let x_mm: Vec<f64> = (0..83).map(|i| 0.47 * f64::from(i) - 20.0).collect();
        let mut seen = FieldsAlong::default();
        let aside = RadialMap::tabulate(20.0, tan_at, |tan| 1.0 / (1.0 + tan * tan).powi(2));
        let aside = FilmMap::Radial(aside.about(DVec2::new(3.0, -2.0), DVec2::new(0.01, 0.02)));
        for (map, y_mm) in [(&map, 0.0), (&map, -9.3), (&dark, 1.0), (&aside, 4.0)] {
            map.along(&x_mm, y_mm, &mut seen);
            for (i, &x_mm) in x_mm.iter().enumerate() {
                let gain = seen.irradiance_per_radiance[i];
                let along = (!gain.is_nan()).then(|| (DVec2::new(seen.tan_x[i], seen.tan_y[i]), gain));
                assert_eq!(along, map.at(DVec2::new(x_mm, y_mm)), "{x_mm}, {y_mm}");
            }
        }
    }

    #[test]
    fn field_ends_where_the_lens_does() {
        let map = RadialMap::tabulate(20.0, |r| (r < 15.0).then_some(r / 50.0), |_| 1.0);
        assert!((map.extent_mm() - 15.0).abs() < 0.02);
        assert!(map.at(16.0 * 16.0).is_none());
        let tan = map.field_tan(DVec2::new(30.0, 40.0));
        assert!((tan - 0.3 * DVec2::new(0.6, 0.8)).length() < 1e-3);
    }
}
