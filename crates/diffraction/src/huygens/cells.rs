//! A pupil cut into the cells of a square grid, by trying which rays get through.

use dioptric_optics::{MonoLens, ObjectPoint, PupilBoundary, Vignetting};
use glam::DVec2;

/// A part of the pupil, in the plane that [`PupilBoundary`] lies in.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    pub(super) at_mm: DVec2,
    pub(super) area_mm2: f64,
}

/// Bisections of a grid's edge: to 1e-12 of its length.
const BISECTIONS: usize = 40;
/// By how much the grid is widened, of its width, until no light passes at its border.
const MARGIN: f64 = 0.04;
const WIDENINGS: usize = 8;

/// Cuts the pupil into cells, `n_across` along its width and height, four places in each cell that is wholly clear.
///
/// Only whether a ray gets through is asked, by tracing it with its rims: at the corners of the grid, and by bisection
/// along its edges. A cell across a rim is the polygon between the crossings, so that areas err by the square of the grid's
/// step: for a disc by 2/(3 n²) of it. Holes no wider than a cell are not seen.
pub(super) fn cells(lens: &MonoLens, point: &ObjectPoint, n_across: usize) -> Option<(Vec<Cell>, f64)> {
    let boundary = PupilBoundary::find(lens, point, 64)?;
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for (i, rho) in boundary.rho_at_azimuths_mm().iter().enumerate() {
        let edge = boundary.center_mm() + *rho * DVec2::from_angle(std::f64::consts::TAU * i as f64 / 64.0);
        (low, high) = (low.min(edge), high.max(edge));
    }
    let z_mm = boundary.z_mm();
    // The boundary is used only to find where to look.
    let mut trial = None;
    for _ in 0..WIDENINGS {
        let margin = MARGIN * (high - low);
        (low, high) = (low - margin, high + margin);
        let grid = Grid { lens, point, z_mm, low, step: (high - low) / n_across as f64, n: n_across };
        let is_clear = grid.corners_clear();
        let is_border = |i: usize| i == 0 || i == n_across;
        let n = n_across + 1;
        let reaches_out = (0..n * n).any(|k| is_clear[k] && (is_border(k / n) || is_border(k % n)));
        trial = Some(grid.cut(&is_clear));
        if !reaches_out {
            break;
        }
    }
    trial.map(|cells| (cells, z_mm))
}

struct Grid<'a> {
    lens: &'a MonoLens,
    point: &'a ObjectPoint,
    z_mm: f64,
    low: DVec2,
    step: DVec2,
    n: usize,
}

impl Grid<'_> {
    fn corner_mm(&self, row: usize, column: usize) -> DVec2 {
        self.low + self.step * DVec2::new(column as f64, row as f64)
    }

    fn are_clear(&self, targets_mm: &[DVec2]) -> Vec<bool> {
        let mut rays = self.lens.rays_towards(self.point, targets_mm, self.z_mm, 0.0);
        self.lens.trace(&mut rays, Vignetting::On);
        rays.fate.iter().map(|fate| fate.is_in_flight()).collect()
    }

    fn corners_clear(&self) -> Vec<bool> {
        let n = self.n + 1;
        let corners: Vec<DVec2> = (0..n * n).map(|k| self.corner_mm(k / n, k % n)).collect();
        self.are_clear(&corners)
    }

    /// Returns where rims cross pairs of a clear and a dark place.
    fn crossings_mm(&self, pairs: &[(DVec2, DVec2)]) -> Vec<DVec2> {
        let mut pairs = pairs.to_vec();
        for _ in 0..BISECTIONS {
            let middles: Vec<DVec2> = pairs.iter().map(|(clear, dark)| clear.midpoint(*dark)).collect();
            for ((pair, middle), is_clear) in pairs.iter_mut().zip(&middles).zip(self.are_clear(&middles)) {
                *(if is_clear { &mut pair.0 } else { &mut pair.1 }) = *middle;
            }
        }
        pairs.iter().map(|(clear, dark)| clear.midpoint(*dark)).collect()
    }

    fn cut(&self, is_clear: &[bool]) -> Vec<Cell> {
        let (mut cells, mut pairs, mut cut) = (vec![], vec![], vec![]);
        for k in 0..self.n * self.n {
            let (row, column) = (k / self.n, k % self.n);
            let around = [(row, column), (row, column + 1), (row + 1, column + 1), (row + 1, column)];
            let corners =
                around.map(|(row, column)| (self.corner_mm(row, column), is_clear[row * (self.n + 1) + column]));
            match corners.iter().filter(|(_, is_clear)| *is_clear).count() {
                0 => {}
                4 => cells.extend(whole(corners[0].0, self.step)),
                _ => {
                    cut.push((corners, pairs.len()));
                    for i in 0..4 {
                        let ((a, a_clear), (b, b_clear)) = (corners[i], corners[(i + 1) % 4]);
                        if a_clear != b_clear {
                            pairs.push(if a_clear { (a, b) } else { (b, a) });
                        }
                    }
                }
            }
        }
        let crossings = self.crossings_mm(&pairs);
        for (corners, first) in cut {
            let mut crossing = crossings[first..].iter();
            let mut polygon = vec![];
            for i in 0..4 {
                let ((corner, is_clear), (_, next_clear)) = (corners[i], corners[(i + 1) % 4]);
                if is_clear {
                    polygon.push(corner);
                }
                if is_clear != next_clear {
                    polygon.extend(crossing.next());
                }
            }
            cells.extend(fan(&polygon));
        }
        cells
    }
}

/// Returns Gauss and Legendre's 2 × 2 points of a cell.
fn whole(low: DVec2, step: DVec2) -> [Cell; 4] {
    let (middle, reach) = (low + 0.5 * step, 0.5 / 3f64.sqrt() * step);
    let area_mm2 = 0.25 * step.x * step.y;
    [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)]
        .map(|(x, y)| Cell { at_mm: middle + reach * DVec2::new(x, y), area_mm2 })
}

/// Returns three points of each triangle of a convex polygon: exact for quadratic functions.
fn fan(polygon: &[DVec2]) -> impl Iterator<Item = Cell> {
    let first = polygon[0];
    polygon[1..].windows(2).flat_map(move |pair| {
        let corners = [first, pair[0], pair[1]];
        let (area, sum) = (0.5 * (corners[1] - first).perp_dot(corners[2] - first), corners.iter().sum::<DVec2>());
        corners.map(|corner| Cell { at_mm: (sum + 3.0 * corner) / 6.0, area_mm2: area / 3.0 })
    })
}
