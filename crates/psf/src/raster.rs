//! Triangles deposited on pixels by the exact area that they cover.
//!
//! Each edge adds, in every pixel that it crosses, the area to its right; one running sum along the rows, at the
//! end, turns the edges of all triangles into coverage. The cost is that of the outlines, and energy is conserved to
//! rounding. Folds do no harm: every triangle counts by the magnitude of its area.

use std::cell::RefCell;

use glam::DVec2;
use multiversion::multiversion;
use ndarray::Array2;

use crate::mesh::Mesh;

/// Below this area, in pixels², a triangle is a segment: the rounding error of the running sum is its energy
/// × 1e-16 / area.
const SEGMENT_AREA: f64 = 1e-6;

/// Samples of the largest buffer that is kept for the next grid.
const MOST_SPARE: usize = 1 << 20;

/// Buffers that a thread keeps: those of one grid.
const N_SPARE: usize = 2;

thread_local! {
    // The grids of kernels come and go by the thousand: fresh memory for each is a page fault every 512 samples.
    static SPARE: RefCell<Vec<Vec<f64>>> = const { RefCell::new(vec![]) };
}

/// Returns so many zeros, in the buffer of an earlier grid if there is one.
fn spare_zeros(n: usize) -> Vec<f64> {
    let mut zeros = SPARE.with_borrow_mut(Vec::pop).unwrap_or_default();
    zeros.clear();
    zeros.resize(n, 0.0);
    zeros
}

/// Energy on a grid of pixels, in the making. Pixel (row, column) covers [column, column + 1] × [row, row + 1].
#[derive(Clone, Debug)]
pub struct Raster {
    rows: usize,
    columns: usize,
    /// Slopes of coverage along each row: one column more than the picture, where what is beyond ends up.
    edges: Vec<f64>,
    /// Energy deposited directly.
    direct: Vec<f64>,
}

impl Raster {
    /// Returns an empty grid.
    pub fn new(rows: usize, columns: usize) -> Self {
        Self { rows, columns, edges: spare_zeros(rows * (columns + 2)), direct: spare_zeros(rows * columns) }
    }

    /// Deposits energy at a point; what falls outside is lost.
    pub fn point(&mut self, at: DVec2, energy: f64) {
        if at.x >= 0.0 && at.y >= 0.0 && at.x < self.columns as f64 && at.y < self.rows as f64 {
            self.direct[at.y as usize * self.columns + at.x as usize] += energy;
        }
    }

    /// The pixels, row by row, to be added to.
    pub(crate) fn pixels_mut(&mut self) -> &mut [f64] {
        &mut self.direct
    }

    /// The number of rows and columns.
    pub fn size(&self) -> (usize, usize) {
        (self.rows, self.columns)
    }

    /// Deposits energy evenly on a triangle; what falls outside is lost.
    pub fn triangle(&mut self, [a, b, c]: [DVec2; 3], energy: f64) {
        let density = self.density([a, b, c], energy);
        for (from, to) in [(a, b), (b, c), (c, a)] {
            self.edge(from, to, density);
        }
    }

    /// Returns the energy per area of a triangle, negative if it runs the other way; or deposits it, if it covers next
    /// to nothing or a part of one pixel, and returns 0.
    #[inline(always)]
    fn density(&mut self, [a, b, c]: [DVec2; 3], energy: f64) -> f64 {
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        if energy == 0.0 || !(low.is_finite() && high.is_finite() && self.meets(low, high)) {
            return 0.0;
        }
        if low.floor() == high.floor() {
            self.point(a, energy);
            return 0.0;
        }
        let doubled = (b - a).perp_dot(c - a);
        if doubled.abs() < 2.0 * SEGMENT_AREA {
            self.sliver([a, b, c], energy);
            return 0.0;
        }
        // A triangle that runs the other way has a negative area, and so has every piece of it.
        2.0 * energy / doubled
    }

    /// Deposits energies on the cells of a mesh whose nodes lie at these places, each as by
    /// [`quadrilateral`](Self::quadrilateral); edges between two cells are walked once.
    pub(crate) fn mesh(&mut self, mesh: Mesh, at: &[DVec2], energies: &[f64]) {
        deposit_mesh(self, mesh, at, energies);
    }

    /// Deposits energy on a quadrilateral a, b, c, d, given in order, as two triangles: `first_share` of it evenly on a,
    /// b, c and the rest on a, c, d.
    pub fn quadrilateral(&mut self, [a, b, c, d]: [DVec2; 4], energy: f64, first_share: f64) {
        if a.min(b).min(c.min(d)).floor() == a.max(b).max(c.max(d)).floor() {
            return self.point(a, energy);
        }
        self.triangle([a, b, c], first_share * energy);
        self.triangle([a, c, d], (1.0 - first_share) * energy);
    }

    /// Returns the energy of each pixel.
    pub fn finish(self) -> Array2<f64> {
        let mut pixels = Vec::with_capacity(self.direct.len());
        for (row, edges) in self.direct.chunks(self.columns).zip(self.edges.chunks(self.columns + 2)) {
            let mut covered = 0.0;
            pixels.extend(row.iter().zip(edges).map(|(direct, slope)| {
                covered += slope;
                direct + covered
            }));
        }
        SPARE.with_borrow_mut(|spare| {
            let buffers = [self.edges, self.direct].into_iter().filter(|buffer| buffer.len() <= MOST_SPARE);
            spare.extend(buffers);
            spare.truncate(N_SPARE);
        });
        Array2::from_shape_vec((self.rows, self.columns), pixels).expect("as many pixels as there are")
    }

    #[inline(always)]
    fn meets(&self, low: DVec2, high: DVec2) -> bool {
        high.x >= 0.0 && high.y >= 0.0 && low.x < self.columns as f64 && low.y < self.rows as f64
    }

    /// Deposits a triangle of next to no area along its longest side.
    fn sliver(&mut self, [a, b, c]: [DVec2; 3], energy: f64) {
        let sides = [(a, b), (b, c), (c, a)];
        let longer = |x: (DVec2, DVec2), y: (DVec2, DVec2)| if x.0.distance(x.1) >= y.0.distance(y.1) { x } else { y };
        let (from, to) = longer(sides[0], longer(sides[1], sides[2]));
        let n = 8 * from.distance(to).ceil().min(1e4) as usize + 3;
        for i in 0..n {
            self.point(from.lerp(to, (i as f64 + 0.5) / n as f64), energy / n as f64);
        }
    }

    /// Adds an edge, cut at the borders of the grid. What lies to the left still covers the row; what lies to the
    /// right does not.
    #[inline(always)]
    fn edge(&mut self, from: DVec2, to: DVec2, density: f64) {
        if density == 0.0 {
            return;
        }
        let (top, bottom, sign) = if from.y < to.y { (from, to, -density) } else { (to, from, density) };
        let height = self.rows as f64;
        let (first, last) = (top.y.max(0.0), bottom.y.min(height));
        if first >= last {
            return;
        }
        let slope = (bottom.x - top.x) / (bottom.y - top.y);
        let x_at = |y: f64| top.x + (y - top.y) * slope;
        let mut y = first;
        while y < last {
            let row = (y as usize).min(self.rows - 1);
            let next = ((row + 1) as f64).min(last);
            let (x, x_next) = (x_at(y), if next == bottom.y { bottom.x } else { x_at(next) });
            self.span(row, (x, x_next), sign * (next - y));
            y = next;
        }
    }

    /// Adds the piece of an edge within one row; `share` is its height times the density.
    #[inline(always)]
    fn span(&mut self, row: usize, (x, x_next): (f64, f64), share: f64) {
        let width = self.columns as f64;
        let (low, high) = if x < x_next { (x, x_next) } else { (x_next, x) };
        let start = row * (self.columns + 2);
        if high <= 0.0 {
            self.edges[start] += share;
            return;
        }
        if low >= width {
            return;
        }
        let (clipped_low, clipped_high) = (low.max(0.0), high.min(width));
        let first = clipped_low as usize;
        if clipped_high <= (first + 1) as f64 && low >= 0.0 && high <= width {
            let into = 0.5 * (low + high) - first as f64;
            self.edges[start + first] += share * (1.0 - into);
            self.edges[start + first + 1] += share * into;
            return;
        }
        let per_x = share / (high - low);
        self.edges[start] += per_x * (clipped_low - low);
        let mut from = clipped_low;
        while from < clipped_high {
            let column = (from as usize).min(self.columns - 1);
            let to = ((column + 1) as f64).min(clipped_high);
            let part = per_x * (to - from);
            let into = 0.5 * (from + to) - column as f64;
            self.edges[start + column] += part * (1.0 - into);
            self.edges[start + column + 1] += part * into;
            from = to;
        }
    }
}

/// The work of [`Raster::mesh`], compiled for the instructions that round a number too.
#[multiversion(targets("x86_64+avx2", "x86_64+avx"))]
fn deposit_mesh(raster: &mut Raster, mesh: Mesh, at: &[DVec2], energies: &[f64]) {
    let n = mesh.n_azimuths;
    let mut densities = Vec::with_capacity(energies.len());
    for (ring, energies) in energies.chunks_exact(n).enumerate() {
        if energies.iter().all(|energy| *energy == 0.0) {
            densities.resize(densities.len() + n, [0.0; 2]);
            continue;
        }
        let share = mesh.outer_share(ring);
        for (j, &energy) in energies.iter().enumerate() {
            let [a, b, c, d] = mesh.corners(ring, j).map(|node| at[node]);
            if energy != 0.0 && a.min(b).min(c.min(d)).floor() == a.max(b).max(c.max(d)).floor() {
                raster.point(a, energy);
                densities.push([0.0; 2]);
                continue;
            }
            let (outer, inner) = (share * energy, (1.0 - share) * energy);
            densities.push([raster.density([a, b, c], outer), raster.density([a, c, d], inner)]);
        }
    }
    for (ring, row) in densities.chunks_exact(n).enumerate() {
        if densities[ring * n..].iter().take(2 * n).all(|pair| *pair == [0.0; 2]) {
            continue;
        }
        for (j, [outer, inner]) in row.iter().enumerate() {
            let [a, b, c, _] = mesh.corners(ring, j).map(|node| at[node]);
            // The neighbors run along the same edges the other way.
            let [_, before] = row[if j == 0 { n - 1 } else { j - 1 }];
            let beyond = densities.get((ring + 1) * n + j).map_or(0.0, |[_, inner]| *inner);
            raster.edge(a, b, outer - before);
            raster.edge(b, c, outer - beyond);
            raster.edge(a, c, inner - outer);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_covers_what_it_covers() {
        let mut raster = Raster::new(3, 4);
        let corners = [(0.5, 0.25), (2.5, 0.25), (2.5, 2.0), (0.5, 2.0)].map(|(x, y)| DVec2::new(x, y));
        raster.quadrilateral(corners, 3.5, 0.5);
        let expected = [[0.375, 0.75, 0.375, 0.0], [0.5, 1.0, 0.5, 0.0], [0.0; 4]];
        for (row, expected) in raster.finish().rows().into_iter().zip(expected) {
            for (a, e) in row.iter().zip(expected) {
                assert!((a - e).abs() < 1e-14, "{row} is not {expected:?}");
            }
        }
    }

    fn triangles(n: usize, span: f64, offset: f64) -> impl Iterator<Item = [DVec2; 3]> {
        // A fixed low-discrepancy walk: no need for a generator.
        let at = move |i: usize, k: f64| offset + span * (i as f64 * k).fract();
        (1..=n).map(move |i| {
            [0.0, 1.0, 2.0].map(|c| DVec2::new(at(i, 0.754_877_666 + 0.31 * c), at(i, 0.569_840_291 + 0.173 * c)))
        })
    }

    #[test]
    fn energy_and_first_moments_are_conserved_to_rounding() {
        let mut raster = Raster::new(40, 40);
        let mut moment = DVec2::ZERO;
        for t in triangles(500, 40.0, 0.0) {
            raster.triangle(t, 1.0);
            moment += (t[0] + t[1] + t[2]) / 3.0;
        }
        let image = raster.finish();
        assert!((image.sum() - 500.0).abs() < 500.0 * 1e-12);
        // The centroid of what covers a pixel is within half a pixel of its center, and the errors average.
        let x: f64 = image.indexed_iter().map(|((_, c), e)| e * (c as f64 + 0.5)).sum();
        assert!((x - moment.x).abs() < 500.0 * 0.01);
    }

    #[test]
    fn a_window_shows_what_the_whole_shows_there() {
        let (mut whole, mut window) = (Raster::new(60, 60), Raster::new(20, 15));
        for t in triangles(300, 60.0, 0.0) {
            whole.triangle(t, 1.0);
            window.triangle(t.map(|p| p - DVec2::new(21.0, 17.0)), 1.0);
        }
        let (whole, window) = (whole.finish(), window.finish());
        for ((row, column), &value) in window.indexed_iter() {
            assert!((value - whole[(row + 17, column + 21)]).abs() < 1e-9, "at {row}, {column}");
        }
    }

    #[test]
    fn a_mesh_is_the_sum_of_its_cells() {
        let mesh = Mesh { n_rings: 5, n_azimuths: 12 };
        // A fold: the outer rings come back inwards and to one side; part of it lies outside.
        let at: Vec<DVec2> = mesh
            .nodes()
            .map(|(t, a)| DVec2::new(13.0, 12.0) + DVec2::from_angle(a) * (14.0 * (t - 0.7 * t.powi(3))) + t * t)
            .collect();
        let energies: Vec<f64> =
            (0..mesh.n_cells()).map(|i| if i % 7 == 3 { 0.0 } else { 1.0 + 0.01 * i as f64 }).collect();
        let (mut whole, mut parts) = (Raster::new(25, 21), Raster::new(25, 21));
        whole.mesh(mesh, &at, &energies);
        for ((ring, j), &energy) in mesh.cells().zip(&energies) {
            parts.quadrilateral(mesh.corners(ring, j).map(|node| at[node]), energy, mesh.outer_share(ring));
        }
        for (a, b) in whole.finish().iter().zip(&parts.finish()) {
            assert!((a - b).abs() < 1e-11, "{a} {b}");
        }
    }

    #[test]
    fn slivers_and_points_keep_their_energy() {
        let mut raster = Raster::new(8, 8);
        raster.triangle([DVec2::splat(4.0); 3], 1.0);
        raster.triangle([DVec2::new(1.0, 1.0), DVec2::new(6.0, 5.0), DVec2::new(3.5, 3.0)], 1.0);
        assert!((raster.finish().sum() - 2.0).abs() < 1e-12);
    }
}
