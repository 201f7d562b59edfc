//! The map of a part of a pupil: that of the whole, with each place moved by what the part sees aside.

use glam::{DMat2, DVec2};

use super::FilmMap;

/// Nodes of the table along each side.
const SIDE: usize = 33;
/// Steps towards the place of the whole; each is right to a tenth of what is left or better.
const STEPS: usize = 12;

/// What a part of the pupil does to a point: its share of the pupil's light, and how far its centroid lies from that of the whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartOfPoint {
    /// Share of the light, 0 to 1.
    pub share: f64,
    /// From the centroid of the whole to that of the part, mm on the film, picture frame.
    pub shift_mm: DVec2,
}

/// From places of the film to fields through a part of the pupil: the map of the whole at a place that lies aside.
#[derive(Clone, Debug)]
pub struct ShiftedMap {
    whole: Box<FilmMap>,
    first_mm: DVec2,
    step_mm: f64,
    /// How far aside across and up, mm, and the factor of the irradiance; row by row from the bottom.
    nodes: Vec<[f64; 3]>,
}

impl ShiftedMap {
    /// Tabulates the places within `extent_mm` of the middle to the right, left, up and down: `part_at` is what the part does to a
    /// field.
    ///
    /// A field f that the whole pupil puts at y(f) lands at x = y + s(f) through the part, so the place x sees what the whole sees at
    /// y, brighter by the share of the part and |det ∂y/∂x|.
    pub fn tabulate(whole: FilmMap, extent_mm: f64, part_at: impl Fn(DVec2) -> PartOfPoint) -> Self {
        let step_mm = 2.0 * extent_mm / (SIDE - 1) as f64;
        let first_mm = DVec2::splat(-extent_mm);
        let shift_at = |y_mm: DVec2| part_at(whole.field_tan(y_mm));
        let by_mm = 0.05 * step_mm;
        let node = |index: usize| {
            let x_mm = first_mm + step_mm * DVec2::new((index % SIDE) as f64, (index / SIDE) as f64);
            let mut y_mm = x_mm;
            for _ in 0..STEPS {
                let next_mm = x_mm - shift_at(y_mm).shift_mm;
                let is_found = next_mm.distance(y_mm) < 1e-8 * extent_mm;
                y_mm = next_mm;
                if is_found {
                    break;
                }
            }
            let slope = |way: DVec2| {
                (shift_at(y_mm + way * by_mm).shift_mm - shift_at(y_mm - way * by_mm).shift_mm) / (2.0 * by_mm)
            };
            let x_by_y = DMat2::IDENTITY + DMat2::from_cols(slope(DVec2::X), slope(DVec2::Y));
            let aside_mm = y_mm - x_mm;
            [aside_mm.x, aside_mm.y, shift_at(y_mm).share / x_by_y.determinant().abs()]
        };
        let nodes = (0..SIDE * SIDE).map(node).collect();
        Self { whole: Box::new(whole), first_mm, step_mm, nodes }
    }

    /// Returns where the whole pupil sees what the part sees at a place, mm, and the factor of the irradiance.
    fn aside(&self, place_mm: DVec2) -> (DVec2, f64) {
        let last = (SIDE - 1) as f64;
        let place = ((place_mm - self.first_mm) / self.step_mm).clamp(DVec2::ZERO, DVec2::splat(last));
        let (column, row) = ((place.x as usize).min(SIDE - 2), (place.y as usize).min(SIDE - 2));
        let (across, up) = (place.x - column as f64, place.y - row as f64);
        let first = row * SIDE + column;
        let [a, b, c, d] = [first, first + 1, first + SIDE, first + SIDE + 1].map(|node| self.nodes[node]);
        let mix = |i: usize| {
            (1.0 - up) * ((1.0 - across) * a[i] + across * b[i]) + up * ((1.0 - across) * c[i] + across * d[i])
        };
        (place_mm + DVec2::new(mix(0), mix(1)), mix(2))
    }

    pub(crate) fn at(&self, place_mm: DVec2) -> Option<(DVec2, f64)> {
        let (place_mm, factor) = self.aside(place_mm);
        self.whole.at(place_mm).map(|(field_tan, gain)| (field_tan, gain * factor))
    }

    pub(crate) fn field_tan(&self, place_mm: DVec2) -> DVec2 {
        self.whole.field_tan(self.aside(place_mm).0)
    }

    pub(crate) fn whole(&self) -> &FilmMap {
        &self.whole
    }

    /// Returns the same with places counted from another: `from_mm` is where that is now.
    pub(crate) fn counted_from(self, from_mm: DVec2) -> Self {
        Self { whole: Box::new(self.whole.counted_from(from_mm)), first_mm: self.first_mm - from_mm, ..self }
    }

    pub(crate) fn size_bytes(&self) -> usize {
        self.whole.size_bytes() + size_of_val(self.nodes.as_slice())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::RadialMap;

    /// A part that sees aside by .8 mm and a share of the field, of a lens of 50 mm with distortion.
    #[test]
    fn part_sees_what_lands_there_through_it() {
        let tan_at = |r: f64| Some(r / 50.0 * (1.0 + 1e-4 * r * r));
        let whole: FilmMap = RadialMap::tabulate(30.0, tan_at, |tan| 2.0 - tan).into();
        let part_at = |tan: DVec2| PartOfPoint {
            share: 0.1 + 0.02 * tan.x,
            shift_mm: DVec2::new(0.8 + 2.0 * tan.x, -0.5 + 1.5 * tan.x * tan.y),
        };
        let map = ShiftedMap::tabulate(whole.clone(), 20.0, part_at);
        for y_mm in [DVec2::new(0.3, -0.4), DVec2::new(11.0, 7.0), DVec2::new(-15.0, 14.0)] {
            let (field_tan, gain) = whole.at(y_mm).unwrap();
            let part = part_at(field_tan);
            let x_mm = y_mm + part.shift_mm;
            let (found_tan, found_gain) = map.at(x_mm).unwrap();
            // A thousandth of a pixel of 4 µm at 50 mm; the table is straight between nodes 1.25 mm apart.
            assert!(found_tan.distance(field_tan) < 2e-6, "{found_tan} {field_tan}");
            assert!(map.field_tan(x_mm).distance(found_tan) < 1e-12);
            let landed = |y: DVec2| y + part_at(whole.at(y).unwrap().0).shift_mm;
            let by = 1e-4;
            let column = |way: DVec2| (landed(y_mm + way * by) - landed(y_mm - way * by)) / (2.0 * by);
            let det = DMat2::from_cols(column(DVec2::X), column(DVec2::Y)).determinant();
            assert!((found_gain * det / (gain * part.share) - 1.0).abs() < 1e-4, "{found_gain}");
            let moved = map.clone().counted_from(DVec2::new(2.0, 1.0));
            let (tan_there, gain_there) = moved.at(x_mm - DVec2::new(2.0, 1.0)).unwrap();
            assert!(tan_there.distance(found_tan) < 1e-12 && (gain_there / found_gain - 1.0).abs() < 1e-12);
        }
    }
}
