//! Light counted ray by ray, for what is found in other ways to be held to. Nothing here knows of pupils: rays fall on the
//! front of a lens, from a plane that faces the point or through even places of the first surface, and either get through or not.

use dioptric_optics::{
    MonoLens, ObjectPoint, RayBatch, Vignetting,
    glam::{DVec2, DVec3},
};

/// Rays across the grids that light is first looked for on, each but the first about what the one before found lit; the second
/// of the first place is for fields that the first leaves dark.
const FIRST_ACROSS: [usize; 2] = [300, 700];
/// How often a grid is fitted to the light that it sees, until its extent changes by less than this share.
const MOST_ZOOMS: usize = 12;
const SETTLED: f64 = 0.02;

/// A far point, and the plane that its rays start in.
struct FarLight {
    direction: DVec3,
    x: DVec3,
    y: DVec3,
}

impl FarLight {
    /// Returns the light of a far point; the y of its plane lies in the plane of the light and the axis.
    fn of(point: &ObjectPoint) -> Self {
        let direction = point.direction_to(DVec3::ZERO);
        let across = direction.cross(DVec3::Z);
        let x = if across.length() > 1e-9 { across.normalize() } else { DVec3::X };
        Self { direction, x, y: direction.cross(x) }
    }

    fn rays(&self, places_mm: &[DVec2]) -> RayBatch {
        let start = |place: &DVec2| self.x * place.x + self.y * place.y;
        let starts: Vec<DVec3> = places_mm.iter().map(start).collect();
        RayBatch::from_points(&starts, &vec![self.direction; places_mm.len()])
    }
}

/// A square grid of rays.
#[derive(Clone, Copy)]
struct Grid {
    low: DVec2,
    cell: DVec2,
    n_across: usize,
}

impl Grid {
    fn new(low: DVec2, high: DVec2, n_across: usize) -> Self {
        Self { low, cell: (high - low) / n_across as f64, n_across }
    }

    fn row(&self, row: usize) -> Vec<DVec2> {
        let at = |column: usize| self.low + self.cell * (DVec2::new(column as f64, row as f64) + 0.5);
        (0..self.n_across).map(at).collect()
    }

    /// Hands each row of rays, traced behind the lens, and where they started, to `visit`.
    fn trace(&self, lens: &MonoLens, light: &FarLight, mut visit: impl FnMut(&[DVec2], RayBatch)) {
        for row in 0..self.n_across {
            let places = self.row(row);
            let mut rays = light.rays(&places);
            lens.trace(&mut rays, Vignetting::On);
            visit(&places, rays);
        }
    }

    /// Returns from where to where this grid sees light.
    fn lit(&self, lens: &MonoLens, light: &FarLight) -> Option<[DVec2; 2]> {
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        self.trace(lens, light, |places, rays| {
            for (place, _) in places.iter().zip(&rays.fate).filter(|(_, fate)| fate.is_in_flight()) {
                (low, high) = (low.min(*place), high.max(*place));
            }
        });
        low.is_finite().then_some([low, high])
    }

    /// Returns a grid of so many rays across about all light, of which `lit` is from where to where a grid sees it.
    fn about_light(self, n_across: usize, lit: impl Fn(&Self) -> Option<[DVec2; 2]>) -> Option<Self> {
        let (mut grid, mut seen) = (self, lit(&self)?);
        for _ in 0..MOST_ZOOMS {
            let ([low, high], end) = (seen, grid.low + grid.cell * grid.n_across as f64);
            // The ends of a crescent are narrower than a cell; light at the end of a grid goes on beyond it.
            let room = |axis: usize, to_end: f64| {
                let extent = high[axis] - low[axis];
                1.5 * grid.cell[axis] + if to_end < 2.0 * grid.cell[axis] { 1.0 } else { 0.2 } * extent
            };
            let below = DVec2::new(room(0, low.x - grid.low.x), room(1, low.y - grid.low.y));
            let above = DVec2::new(room(0, end.x - high.x), room(1, end.y - high.y));
            let next = Self::new(low - below, high + above, FIRST_ACROSS[0]);
            let Some(found) = lit(&next) else { break };
            let extent = |[low, high]: [DVec2; 2]| high - low;
            let is_settled = (extent(found) - extent(seen)).abs().cmplt(SETTLED * extent(found)).all();
            (grid, seen) = (next, found);
            if is_settled {
                break;
            }
        }
        Some(Self::new(grid.low, grid.low + grid.cell * grid.n_across as f64, n_across))
    }
}

/// Returns a grid of so many rays across about all of the light of a far point that gets through; `None` of a dark one.
fn about_light(lens: &MonoLens, light: &FarLight, n_across: usize) -> Option<Grid> {
    let extent = DVec2::splat(3.0 * lens.semi_aperture_mm(0));
    let first = |n: usize| Grid::new(-extent, extent, n).about_light(n_across, |grid| grid.lit(lens, light));
    FIRST_ACROSS.into_iter().find_map(first)
}

/// Whether any of a coarse grid of rays of a far point gets through.
#[allow(dead_code, reason = "the example looks at fields that should be dark")]
pub(crate) fn is_any_lit(lens: &MonoLens, point: &ObjectPoint) -> bool {
    let (light, radius) = (FarLight::of(point), DVec2::splat(lens.semi_aperture_mm(0)));
    Grid::new(-3.0 * radius, 3.0 * radius, FIRST_ACROSS[0]).lit(lens, &light).is_some()
        || Grid::new(-radius, radius, FIRST_ACROSS[0]).lit_over_front(lens, &light).is_some()
}

/// The cosine of light to the axis below which rays are counted through even places of the first surface: on a plane that faces the
/// light they would be few along the front's outline, where light gets through last.
const STEEP: f64 = 0.5;

/// Returns the cross-section of the light of a far point that gets through, mm², by a grid of so many rays across, and the standard
/// error of the count.
#[allow(dead_code, reason = "not every test looks at fields")]
pub(crate) fn cross_section_mm2(lens: &MonoLens, point: &ObjectPoint, n_across: usize) -> (f64, f64) {
    let light = FarLight::of(point);
    if light.direction.z < STEEP {
        return cross_section_over_front_mm2(lens, &light, n_across);
    }
    let Some(grid) = about_light(lens, &light, n_across) else {
        return cross_section_over_front_mm2(lens, &light, n_across);
    };
    // Four grids, each of every other ray of every other row: how far they differ bounds how far all may be off.
    let (mut n_lit, mut row) = ([0.0_f64; 4], 0);
    grid.trace(lens, &light, |_, rays| {
        for (column, _) in rays.fate.iter().enumerate().filter(|(_, fate)| fate.is_in_flight()) {
            n_lit[2 * (row % 2) + column % 2] += 1.0;
        }
        row += 1;
    });
    let total: f64 = n_lit.iter().sum();
    let squares: f64 = n_lit.iter().map(|n| (n - 0.25 * total).powi(2)).sum();
    let cell_mm2 = grid.cell.x * grid.cell.y;
    (total * cell_mm2, (squares / 3.0 * 4.0).sqrt() * cell_mm2)
}

/// Returns the same by a grid of rays through places of the first surface, each of which counts with the cross-section of its
/// cell of the surface.
fn cross_section_over_front_mm2(lens: &MonoLens, light: &FarLight, n_across: usize) -> (f64, f64) {
    let radius_mm = lens.semi_aperture_mm(0);
    let first = |n: usize| {
        let grid = Grid::new(DVec2::splat(-radius_mm), DVec2::splat(radius_mm), n);
        grid.about_light(n_across, |grid| grid.lit_over_front(lens, light))
    };
    let Some(grid) = FIRST_OVER_FRONT.into_iter().find_map(first) else { return (0.0, 0.0) };
    let mut areas_mm2 = [0.0_f64; 4];
    for row in 0..n_across {
        for (column, (_, area_mm2)) in grid.row_on_front(lens, light, row).into_iter().enumerate() {
            areas_mm2[2 * (row % 2) + column % 2] += area_mm2;
        }
    }
    let total: f64 = areas_mm2.iter().sum();
    let squares: f64 = areas_mm2.iter().map(|area| (area - 0.25 * total).powi(2)).sum();
    (total, (squares / 3.0 * 4.0).sqrt())
}

/// Rays across the front where light is first looked for there; the second is for slivers.
const FIRST_OVER_FRONT: [usize; 2] = [300, 2000];

impl Grid {
    /// Returns from where to where this grid of places of the front sees light.
    fn lit_over_front(&self, lens: &MonoLens, light: &FarLight) -> Option<[DVec2; 2]> {
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for row in 0..self.n_across {
            for (place, _) in self.row_on_front(lens, light, row).into_iter().filter(|(_, area_mm2)| *area_mm2 > 0.0) {
                (low, high) = (low.min(place), high.max(place));
            }
        }
        low.is_finite().then_some([low, high])
    }

    /// Returns the places of a row, and the cross-section of the light through the cell of the first surface about each that gets
    /// through the lens.
    fn row_on_front(&self, lens: &MonoLens, light: &FarLight, row: usize) -> Vec<(DVec2, f64)> {
        let places = self.row(row);
        let placement = lens.surface_placement(0);
        // Of a mirror it has its z against the light that falls on it.
        let along = placement.rotation.z_axis * placement.rotation.z_axis.z.signum();
        let on_front = |offset: DVec2| {
            let start = |place: &DVec2| placement.lens_from_surface((*place + offset * self.cell).extend(0.0)) - along;
            let starts: Vec<DVec3> = places.iter().map(start).collect();
            let mut rays = RayBatch::from_points(&starts, &vec![along; places.len()]);
            lens.trace_surfaces(0..1, &mut rays, Vignetting::Off);
            rays
        };
        let middles = on_front(DVec2::ZERO);
        let corners = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)].map(|corner| on_front(corner.into()));
        let starts: Vec<DVec3> = (0..places.len()).map(|i| middles.point_mm(i) - light.direction).collect();
        let mut rays = RayBatch::from_points(&starts, &vec![light.direction; places.len()]);
        let mut met = rays.clone();
        lens.trace_surfaces(0..1, &mut met, Vignetting::Off);
        lens.trace(&mut rays, Vignetting::On);
        let area_mm2 = |i: usize| {
            let [a, b, c, d] = corners.each_ref().map(|corner| corner.point_mm(i));
            let is_met = met.point_mm(i).distance(middles.point_mm(i)) < 1e-9 * lens.semi_aperture_mm(0);
            let facing_mm2 = 0.5 * (c - a).cross(d - b).dot(light.direction);
            if is_met && rays.fate[i].is_in_flight() && facing_mm2 > 0.0 { facing_mm2 } else { 0.0 }
        };
        (0..places.len()).map(|i| (places[i], area_mm2(i))).collect()
    }
}

/// Returns the root-mean-square distance from their centroid of the places where the light of a far point meets a film, mm, by a
/// grid of so many rays across.
#[allow(dead_code, reason = "not every test looks at spots")]
pub(crate) fn spot_rms_mm(lens: &MonoLens, point: &ObjectPoint, film_distance_mm: f64, n_across: usize) -> Option<f64> {
    let light = FarLight::of(point);
    let grid = about_light(lens, &light, n_across)?;
    let (mut sum, mut squares, mut n_lit, mut origin) = (DVec2::ZERO, 0.0, 0_usize, None);
    grid.trace(lens, &light, |_, mut rays| {
        lens.to_film(&mut rays, film_distance_mm);
        for landed in lens.landed(&rays, film_distance_mm) {
            // About a place of the spot, so that its distance from the axis costs no digits.
            let from_first = landed.mm - *origin.get_or_insert(landed.mm);
            (sum, squares, n_lit) = (sum + from_first, squares + from_first.length_squared(), n_lit + 1);
        }
    });
    let n = n_lit as f64;
    Some((squares / n - (sum / n).length_squared()).max(0.0).sqrt())
}

/// Returns the same for the far point on the axis of a lens of revolution, by so many rays from the axis to the rim of the first
/// surface, each of which stands for its ring.
#[allow(dead_code, reason = "not every test looks at spots on the axis")]
pub(crate) fn axial_spot_rms_mm(lens: &MonoLens, film_distance_mm: f64, n_rays: usize) -> Option<f64> {
    const LOT: usize = 10_000;
    // A few rays show how far out light gets through; the front of a wide-angle lens is many times wider.
    let n_first = n_rays / 100;
    let first_mm = lens.semi_aperture_mm(0) / n_first as f64;
    let points: Vec<DVec3> = (0..n_first).map(|i| DVec3::new(0.0, first_mm * (i as f64 + 0.5), -1.0)).collect();
    let mut rays = RayBatch::from_points(&points, &vec![DVec3::Z; n_first]);
    lens.trace(&mut rays, Vignetting::On);
    let last = rays.fate.iter().rposition(|fate| fate.is_in_flight())?;
    let reach_mm = first_mm * (last as f64 + 2.0);
    let (mut squares, mut total) = (0.0, 0.0);
    for first in (0..n_rays).step_by(LOT) {
        let height = |i: usize| reach_mm * (i as f64 + 0.5) / n_rays as f64;
        let heights: Vec<f64> = (first..n_rays.min(first + LOT)).map(height).collect();
        let points: Vec<DVec3> = heights.iter().map(|height| DVec3::new(0.0, *height, -1.0)).collect();
        let mut rays = RayBatch::from_points(&points, &vec![DVec3::Z; points.len()]);
        lens.trace(&mut rays, Vignetting::On);
        lens.to_film(&mut rays, film_distance_mm);
        for i in (0..rays.len()).filter(|&i| rays.fate[i].is_in_flight()) {
            squares += heights[i] * rays.y_mm[i].powi(2);
            total += heights[i];
        }
    }
    (total > 0.0).then(|| (squares / total).sqrt())
}

/// Returns the height of the outermost ray of the beam about the axis that gets through, of so many rays from the axis to the
/// rim of the first surface, mm.
#[allow(dead_code, reason = "not every test looks at beams")]
pub(crate) fn beam_radius_mm(lens: &MonoLens, n_rays: usize) -> f64 {
    let height = |i: usize| lens.semi_aperture_mm(0) * (i as f64 + 0.5) / n_rays as f64;
    let points: Vec<DVec3> = (0..n_rays).map(|i| DVec3::new(0.0, height(i), -1.0)).collect();
    let mut rays = RayBatch::from_points(&points, &vec![DVec3::Z; n_rays]);
    lens.trace(&mut rays, Vignetting::On);
    let dark = rays.fate.iter().position(|fate| !fate.is_in_flight()).unwrap_or(n_rays);
    lens.semi_aperture_mm(0) * dark as f64 / n_rays as f64
}
