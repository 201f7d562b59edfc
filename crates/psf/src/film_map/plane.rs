//! The map of a lens without an axis of symmetry.

use glam::{DMat2, DVec2, DVec3};

use super::half_tan_of;

/// Newton's steps to the point that sees a direction, at most.
const MOST_STEPS: usize = 30;
/// A step of Newton's, over half the side, after which there is none.
const LAST_STEP: f64 = 1e-7;

/// A grid of points over a square of film, with the directions that they see and their irradiances; bicubic between them.
///
/// Directions are kept as the tangent of half the angle along x and y, which is smooth through 90° and beyond.
#[derive(Clone, Debug)]
pub(crate) struct PlaneMap {
    /// Half the side of the square, mm.
    half_mm: f64,
    /// Points along each side, of those within the square; there is one more on each side of it.
    n: usize,
    /// Rows from the bottom up, each from left to right: both tangents of half the angle, and the irradiance, sr.
    nodes: Vec<[f64; 3]>,
    /// About where a direction is seen: a point, and how far it moves with both tangents of half the angle, mm.
    middle: (DVec2, DVec2, DMat2),
}

impl PlaneMap {
    /// Takes n × n points (at least 3 × 3) over a square from −`half_mm` to `half_mm`, rows from the bottom up: the tangents of half
    /// the angle and the irradiance, sr.
    pub(crate) fn new(half_mm: f64, n: usize, nodes: &[(DVec2, f64)]) -> Self {
        // One more on each side: directions go on along the parabola through the last three, light straight.
        let beyond = |[near, next, far]: [[f64; 3]; 3]| {
            let parabola = |i: usize| 3.0 * (near[i] - next[i]) + far[i];
            [parabola(0), parabola(1), 2.0 * near[2] - next[2]]
        };
        let padded = |line: &[[f64; 3]]| -> Vec<[f64; 3]> {
            let first = beyond([line[0], line[1], line[2]]);
            let last = beyond([line[n - 1], line[n - 2], line[n - 3]]);
            std::iter::once(first).chain(line.iter().copied()).chain([last]).collect()
        };
        let within: Vec<[f64; 3]> = nodes.iter().map(|(half_tan, sr)| [half_tan.x, half_tan.y, *sr]).collect();
        let rows: Vec<Vec<[f64; 3]>> = within.chunks(n).map(padded).collect();
        let columns: Vec<Vec<[f64; 3]>> =
            (0..n + 2).map(|column| padded(&rows.iter().map(|row| row[column]).collect::<Vec<_>>())).collect();
        let all = (0..n + 2).flat_map(|row| columns.iter().map(move |column| column[row])).collect();
        let mut map = Self { half_mm, n, nodes: all, middle: (DVec2::ZERO, DVec2::ZERO, DMat2::IDENTITY) };
        let (half_tan, by_place) = map.half_tan(DVec2::ZERO);
        map.middle = (DVec2::ZERO, half_tan, by_place.inverse());
        map
    }

    /// Returns the map with the irradiances of its points each times a factor.
    pub(super) fn scaled(&self, factors: &[f64]) -> Self {
        let inner = (0..self.n).flat_map(|row| (0..self.n).map(move |column| (row + 1) * (self.n + 2) + column + 1));
        let node = |(i, factor): (usize, &f64)| {
            let [x, y, sr] = self.nodes[i];
            (DVec2::new(x, y), sr * factor)
        };
        Self::new(self.half_mm, self.n, &inner.zip(factors).map(node).collect::<Vec<_>>())
    }

    fn step_mm(&self) -> f64 {
        2.0 * self.half_mm / (self.n - 1) as f64
    }

    /// Returns values at a point within the square and their slopes, per mm, along x and y.
    #[inline]
    fn look_up(&self, place_mm: DVec2) -> [[f64; 3]; 3] {
        let step_mm = self.step_mm();
        let at = ((place_mm + self.half_mm) / step_mm).clamp(DVec2::ZERO, DVec2::splat((self.n - 1) as f64));
        let below = at.floor().min(DVec2::splat((self.n - 2) as f64));
        let (across, up) = (cubic(at.x - below.x), cubic(at.y - below.y));
        let (column, row) = (below.x as usize, below.y as usize);
        let mut sums = [[0.0; 3]; 3];
        for (i, (weight_y, slope_y)) in up.into_iter().enumerate() {
            let nodes = &self.nodes[(row + i) * (self.n + 2) + column..][..4];
            for ((weight_x, slope_x), node) in across.iter().zip(nodes) {
                for k in 0..3 {
                    sums[0][k] += weight_y * weight_x * node[k];
                    sums[1][k] += weight_y * slope_x * node[k] / step_mm;
                    sums[2][k] += slope_y * weight_x * node[k] / step_mm;
                }
            }
        }
        sums
    }

    /// Returns the tangents of half the angle at a point and their derivatives by the point, per mm; beyond the square they go on
    /// straight.
    #[inline]
    fn half_tan(&self, place_mm: DVec2) -> (DVec2, DMat2) {
        let inside_mm = place_mm.clamp(DVec2::splat(-self.half_mm), DVec2::splat(self.half_mm));
        let [value, x, y] = self.look_up(inside_mm).map(|[x, y, _]| DVec2::new(x, y));
        let by_place = DMat2::from_cols(x, y);
        (value + by_place * (place_mm - inside_mm), by_place)
    }

    /// Returns the tangents of half the angle of what a point sees.
    pub(crate) fn half_tan_at(&self, place_mm: DVec2) -> DVec2 {
        self.half_tan(place_mm).0
    }

    #[inline]
    pub(super) fn direction(&self, place_mm: DVec2) -> DVec3 {
        let (half_tan, _) = self.half_tan(place_mm);
        (2.0 * half_tan).extend(1.0 - half_tan.length_squared())
    }

    /// Returns the irradiance at a point, sr: between those of the four nodes about it, so that there are no rings beside the edge of light.
    #[inline]
    pub(crate) fn irradiance_sr(&self, place_mm: DVec2) -> f64 {
        let at = ((place_mm + self.half_mm) / self.step_mm()).clamp(DVec2::ZERO, DVec2::splat((self.n - 1) as f64));
        let below = at.floor().min(DVec2::splat((self.n - 2) as f64));
        // One node more lies on each side of the square.
        let first = (below.y as usize + 1) * (self.n + 2) + below.x as usize + 1;
        let corners = [0, 1, self.n + 2, self.n + 3].map(|offset| self.nodes[first + offset][2]);
        let (least, most) = corners.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), sr| (a.min(*sr), b.max(*sr)));
        self.look_up(place_mm)[0][2].clamp(least.max(0.0), most.max(0.0).max(least))
    }

    pub(crate) fn place_of(&self, direction: DVec3) -> DVec2 {
        self.place_near(direction, None)
    }

    /// Returns the point that sees a direction, looked for from a point near by or from about where it is.
    pub(super) fn place_near(&self, direction: DVec3, near_mm: Option<DVec2>) -> DVec2 {
        let half_tan = half_tan_of(direction);
        let (middle_mm, middle_tan, by_half_tan) = self.middle;
        let mut place_mm = near_mm.unwrap_or_else(|| middle_mm + by_half_tan * (half_tan - middle_tan));
        for _ in 0..MOST_STEPS {
            let (here, by_place) = self.half_tan(place_mm);
            let step_mm = (by_place.inverse() * (half_tan - here)).clamp_length_max(self.half_mm);
            if !step_mm.is_finite() {
                break;
            }
            place_mm += step_mm;
            // The next step would be about the square of this one.
            if step_mm.length_squared() < (LAST_STEP * self.half_mm).powi(2) {
                break;
            }
        }
        place_mm
    }

    /// Returns the derivative of points by the tangents of half the angle that they see, mm.
    #[inline]
    pub(super) fn by_half_tan(&self, place_mm: DVec2) -> DMat2 {
        self.half_tan(place_mm).1.inverse()
    }

    pub(super) fn jacobian_mm(&self, place_mm: DVec2) -> DMat2 {
        let (half_tan, by_place) = self.half_tan(place_mm);
        // t = 2 q / (1 − |q|²)
        let ahead = 1.0 - half_tan.length_squared();
        let outer = DMat2::from_cols(half_tan * half_tan.x, half_tan * half_tan.y);
        let tan_by_half_tan = DMat2::IDENTITY * (2.0 / ahead) + outer * (4.0 / (ahead * ahead));
        (tan_by_half_tan * by_place).inverse()
    }

    pub(super) fn size_bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
    }
}

/// Returns the weights of four values in a row, and those of the slope per step, at a place between the second and the third (Catmull and Rom's
/// cubic).
#[inline(always)]
fn cubic(u: f64) -> [(f64, f64); 4] {
    [
        (0.5 * u * (u * (2.0 - u) - 1.0), 0.5 * (u * (4.0 - 3.0 * u) - 1.0)),
        (0.5 * (u * u * (3.0 * u - 5.0) + 2.0), 0.5 * u * (9.0 * u - 10.0)),
        (0.5 * u * (u * (4.0 - 3.0 * u) + 1.0), 0.5 * (u * (8.0 - 9.0 * u) + 1.0)),
        (0.5 * u * u * (u - 1.0), 0.5 * u * (3.0 * u - 2.0)),
    ]
}

#[cfg(test)]
mod tests {
    use super::{super::FilmMap, *};

    /// Changes of a direction of any length, along it and across.
    fn check_moves(map: &FilmMap, at_mm: DVec2) {
        let direction = 1.7 * map.direction(at_mm);
        let changes = [DVec3::new(0.3, 0.1, -0.2), DVec3::new(0.0, 1.0, 0.5)];
        let moves = map.moves_mm(at_mm, direction, changes);
        for (found, change) in moves.into_iter().zip(changes) {
            let place = |by: f64| map.place_near(direction + by * change, at_mm);
            let expected = (place(1e-5) - place(-1e-5)) / 2e-5;
            assert!((found - expected).length() < 1e-4 * expected.length(), "{at_mm}: {found} {expected}");
        }
    }

    /// A lens of 50 mm with distortion of its own along x and y, whose picture is turned and moved.
    #[test]
    fn points_and_directions_are_each_others_inverse() {
        let tan_at = |at_mm: DVec2| {
            let own = at_mm - DVec2::new(0.4, -0.2);
            own.rotate(DVec2::from_angle(0.1)) / 50.0 * (1.0 + 1e-4 * own.x * own.x - 5e-5 * own.y * own.y)
        };
        let (half_mm, n) = (15.0, 25);
        let node = |i: usize| {
            let at_mm = DVec2::new((i % n) as f64, (i / n) as f64) * (2.0 * half_mm / (n - 1) as f64) - half_mm;
            let tan = tan_at(at_mm);
            (tan / (1.0 + tan.length_squared().sqrt().hypot(1.0)), 0.1 + 1e-3 * at_mm.x)
        };
        let map = FilmMap::from(PlaneMap::new(half_mm, n, &(0..n * n).map(node).collect::<Vec<_>>()));
        for at_mm in [DVec2::ZERO, DVec2::new(3.3, -8.1), DVec2::new(-14.2, 14.9), DVec2::new(16.0, 3.0)] {
            let tan = map.field_tan(at_mm).unwrap();
            // Cubics over steps of 1.25 mm, to a tenth of a micrometre; a millimetre beyond, straight lines.
            let most = if at_mm.x > half_mm { 2e-3 } else { 3e-6 };
            assert!((tan - tan_at(at_mm)).length() < most, "{at_mm}: {tan} {}", tan_at(at_mm));
            assert!((map.place_mm(tan).unwrap() - at_mm).length() < 1e-9, "{at_mm}");
            let by = 1e-6;
            let slope = |way: DVec2| {
                (map.place_mm(tan + by * way).unwrap() - map.place_mm(tan - by * way).unwrap()) / (2.0 * by)
            };
            let jacobian = map.jacobian_mm(at_mm);
            // Beyond the square the slope is that at its edge.
            if at_mm.x < half_mm {
                check_moves(&map, at_mm);
            }
            for way in [DVec2::X, DVec2::Y].into_iter().filter(|_| at_mm.x < half_mm) {
                assert!((jacobian * way - slope(way)).length() < 1e-4 * 50.0, "{at_mm}");
            }
        }
        assert!((map.irradiance_sr(DVec2::new(3.0, 1.0)) - 0.103).abs() < 1e-9);
        assert_eq!(map.axis_mm(), None);
    }
}
