//! Points that shine: lamps among the samples of a scene, and stars and lamps beside it. Each is drawn once, by the kernel of its own place.

use std::collections::BTreeMap;

use dioptric_psf::{FilmMap, FilmQuery, LensImage};
use dioptric_scene::{PointBrightness, PointLight, PointPlace};
use dioptric_spectrum::{Cancel, Cancelled};
use glam::DVec2;
use rayon::prelude::*;

use crate::{
    Film, SceneGeometry,
    beyond::LEAST_CELL_PX,
    lamps::Lamp,
    node_kernels::NodeKernel,
    past_surfaces::{HiddenPoint, OpenPupil},
    places::SceneRaster,
    raster::{Level, Raster},
    rectangle::Rectangle,
    sight::{Before, Sight},
    surface::LayerCoordinates,
    tile::film_pixels,
};

/// A point as a band shows it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Point {
    /// Where its chief ray meets the film, mm from the middle.
    place_mm: DVec2,
    /// The same in the middle band, by which points share kernels.
    middle_mm: DVec2,
    dioptres: f64,
    /// The layer that it lies in, or behind.
    pub(crate) layer: usize,
    /// Side of the square that it is, mm on the film in the middle band; 0 for a point.
    width_mm: f64,
    /// Radiance times the area of film that sees it, in pixels.
    light: f64,
    /// The first surface where it lies, if it lies behind that.
    before: Option<Before>,
}

/// A point beside the scene, as it lies among its layers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Beside {
    field_tan: DVec2,
    /// Radiance times the area in tangents over its brightness.
    tan2: f64,
    dioptres: f64,
    layer: usize,
    /// The first surface where it lies, if it lies behind that.
    before: Option<Before>,
}

/// Where a film looks in a band and in the middle one.
#[derive(Clone, Copy)]
pub(crate) struct Maps<'a> {
    pub(crate) of_band: &'a FilmMap,
    pub(crate) of_middle: &'a FilmMap,
    /// Side of a pixel.
    pub(crate) pitch_mm: f64,
}

impl Maps<'_> {
    /// Returns the places of a direction on the film, and the area of film that sees an area in tangents of 1, mm²: both in the band, then in the middle one.
    fn find(&self, field_tan: DVec2) -> Option<([DVec2; 2], [f64; 2])> {
        let maps = [self.of_band, self.of_middle];
        let places_mm = [maps[0].place_mm(field_tan)?, maps[1].place_mm(field_tan)?];
        Some((places_mm, [0, 1].map(|i| maps[i].jacobian_mm(places_mm[i]).determinant().abs())))
    }
}

/// How much farther than the first surface a point may lie that is not behind it: depth maps are that exact.
const AT_SURFACE: f64 = 1.01;

impl Beside {
    /// Places the points of a scene before a film by the map of a band.
    pub(crate) fn all(
        scene: &SceneGeometry<'_>,
        (film, map): (&Film, &FilmMap),
        raster: &SceneRaster,
        (coordinates, coordinate_of): (&LayerCoordinates, &dyn Fn(f32) -> f32),
    ) -> Vec<Option<Self>> {
        let of = |point: &PointLight| {
            let field_tan = match point.place {
                PointPlace::Field { tan_x, tan_y } => DVec2::new(tan_x, tan_y),
                // Of the film that this one is a part of.
                PointPlace::Film { x_mm, y_mm } => map.field_tan(DVec2::new(x_mm, y_mm) - film.center_mm)?,
            };
            let seen_at = raster.position_of(field_tan.x, field_tan.y);
            let before = raster.is_within(seen_at).then(|| {
                let at = seen_at.map(|position| position.round().max(0.0) as usize);
                let at = (at[0].min(raster.rows - 1), at[1].min(raster.columns - 1));
                let depth_m = f64::from(scene.depth.z_m()[at]);
                let coordinate = coordinates.samples()[at.0 * raster.columns + at.1];
                (point.depth_m > AT_SURFACE * depth_m).then_some(Before { dioptres: 1.0 / depth_m, coordinate })
            });
            // Radiance times tan² is the irradiance of a star over cos³, the intensity of a lamp over z² cos.
            let per_cos = (1.0 + field_tan.length_squared()).sqrt();
            let tan2 = match point.light {
                PointBrightness::Irradiance(_) => per_cos.powi(3),
                PointBrightness::Intensity(_) => per_cos / (point.depth_m * point.depth_m),
            };
            let layer = coordinate_of(point.depth_m as f32) as usize;
            Some(Self { field_tan, tan2, dioptres: 1.0 / point.depth_m, layer, before: before.flatten() })
        };
        scene.points.iter().map(of).collect()
    }

    /// Returns its direction in tangents, its depth in dioptres, and the area in tangents times radiance of a point of brightness 1.
    pub(crate) fn seen_at(&self) -> (DVec2, f64, f64) {
        (self.field_tan, self.dioptres, self.tan2)
    }

    /// Whether it lies behind the first surface.
    pub(crate) fn is_behind(&self) -> bool {
        self.before.is_some()
    }

    /// Returns it with its brightness in a band; `None` where it cannot be seen.
    pub(crate) fn lit(&self, brightness: f32, maps: &Maps<'_>) -> Option<Point> {
        if brightness <= 0.0 {
            return None;
        }
        let ([place_mm, middle_mm], [area_mm2, _]) = maps.find(self.field_tan)?;
        let light = f64::from(brightness) * self.tan2 * area_mm2 / maps.pitch_mm.powi(2);
        let Self { dioptres, layer, before, .. } = *self;
        Some(Point { place_mm, middle_mm, dioptres, layer, width_mm: 0.0, light, before })
    }
}

impl Point {
    /// Returns how far below and to the right of the film's middle it lies, in pixels of a pitch.
    pub(crate) fn place_px(&self, pitch_mm: f64) -> [f64; 2] {
        [-self.place_mm.y, self.place_mm.x].map(|mm| mm / pitch_mm)
    }

    /// Its radiance times the area of film that sees it, in pixels.
    pub(crate) fn light(&self) -> f64 {
        self.light
    }

    /// Returns a lamp among the samples of a scene, at a depth, on the first surface or behind that.
    pub(crate) fn of_lamp(
        lamp: &Lamp,
        raster: &SceneRaster,
        maps: &Maps<'_>,
        ((layer, dioptres), before): ((usize, f64), Option<Before>),
    ) -> Option<Self> {
        let (tan_x, tan_y) = raster.view.tan_at(lamp.row as f64, lamp.column as f64);
        let ([place_mm, middle_mm], areas_mm2) = maps.find(DVec2::new(tan_x, tan_y))?;
        let [area_mm2, middle_mm2] = areas_mm2.map(|area| area / raster.view.focal_px.powi(2));
        let light = f64::from(lamp.radiance) * area_mm2 / maps.pitch_mm.powi(2);
        Some(Self { place_mm, middle_mm, dioptres, layer, width_mm: middle_mm2.sqrt(), light, before })
    }
}

/// What draws points in a band.
pub(crate) struct Drawing<'a> {
    pub(crate) lens: &'a dyn LensImage,
    pub(crate) film: &'a Film,
    /// Of the middle band.
    pub(crate) middle_nm: f64,
    /// Returns kernels of the band, whatever the wavelength asked for.
    pub(crate) kernel: &'a (dyn Fn(FilmQuery) -> NodeKernel + Sync),
    /// What hides points; `None` where nothing does.
    pub(crate) sight: Option<&'a Sight>,
}

/// Points no farther apart than this share a kernel, pixels; of more than so many kernels, twice as far, and so on.
const APART_PX: f64 = 16.0;
const MOST_KERNELS: usize = 256;
/// Change of blur radius between points that share a kernel, pixels.
const BLUR_STEP_PX: f64 = 0.5;
/// Cells of a kernel: the least, or wider ones where there would be more of them along its spread.
const CELLS: f64 = 32.0;

impl Drawing<'_> {
    /// Returns what points bring to the pixels of the film, row by row: radiance; nothing where there are none.
    pub(crate) fn drawn(&self, points: &[Point], cancel: &Cancel) -> Result<Vec<f32>, Cancelled> {
        let film = film_pixels(self.film);
        let mut sums = vec![0.0; if points.is_empty() { 0 } else { film.len() }];
        let groups = self.groups(points);
        // One for each thread at once: each may be as large as the film.
        for groups in groups.chunks(rayon::current_num_threads()) {
            cancel.check()?;
            let patches: Vec<(Rectangle, Vec<f32>)> =
                groups.par_iter().filter_map(|group| self.patch(group, &film)).collect();
            for (at, light) in patches {
                let lines = sums[at.offset_in(&film)..].chunks_mut(film.columns);
                for (line, light) in lines.zip(light.chunks_exact(at.columns)) {
                    line.iter_mut().zip(light).for_each(|(sum, light)| *sum += light);
                }
            }
        }
        Ok(sums)
    }

    fn pitch_mm(&self) -> f64 {
        1e-3 * self.film.pitch_um
    }

    /// Returns points that share a kernel.
    fn groups<'p>(&self, points: &'p [Point]) -> Vec<Vec<&'p Point>> {
        let radius_px =
            |dioptres: f64| self.lens.blur_radius_mm(DVec2::ZERO, dioptres, self.middle_nm) / self.pitch_mm();
        let per_dioptre = radius_px(1.0) - radius_px(0.0);
        let mut apart_px = APART_PX;
        loop {
            let mut groups: BTreeMap<[i64; 4], Vec<&Point>> = BTreeMap::new();
            for point in points {
                let cell = (point.middle_mm / self.pitch_mm() / apart_px).floor();
                let blur = (point.dioptres * per_dioptre / BLUR_STEP_PX).round() as i64;
                let width = (point.width_mm / self.pitch_mm() * 8.0).round() as i64;
                groups.entry([cell.x as i64, cell.y as i64, blur, width]).or_default().push(point);
            }
            if groups.len() <= MOST_KERNELS || apart_px > 4.0 * (self.film.rows + self.film.columns) as f64 {
                return groups.into_values().collect();
            }
            apart_px *= 2.0;
        }
    }

    /// Returns what points that share a kernel bring to the film, and where.
    fn patch(&self, group: &[&Point], film: &Rectangle) -> Option<(Rectangle, Vec<f32>)> {
        // The same in all bands in which the same points shine.
        let n = group.len() as f64;
        let place_mm = group.iter().map(|point| point.middle_mm).sum::<DVec2>() / n;
        let dioptres = group.iter().map(|point| point.dioptres).sum::<f64>() / n;
        let pitch_mm = self.pitch_mm();
        let width_px = group[0].width_mm / pitch_mm;
        let spread_px = self.lens.spread_mm(place_mm, dioptres, self.middle_nm) / pitch_mm;
        let blur_px = self.lens.blur_radius_mm(place_mm, dioptres, self.middle_nm) / pitch_mm;
        let most_px = LEAST_CELL_PX * (spread_px / (CELLS * LEAST_CELL_PX)).log2().ceil().max(0.0).exp2();
        // Lamps are an odd number of cells wide: their rims and those of cells are the same.
        let wide = 2 * (0.5 * (width_px / most_px - 1.0)).ceil().max(0.0) as usize + 1;
        let cell_px = if width_px > 0.0 { width_px / wide as f64 } else { most_px };
        // In focus all of the pupil meets in a cell.
        let unclear_px = (spread_px * spread_px - blur_px * blur_px).max(cell_px * cell_px).sqrt();
        let pitch_um = cell_px * self.film.pitch_um;
        let kernel = (self.kernel)(FilmQuery { place_mm, dioptres, wavelength_nm: self.middle_nm, pitch_um });
        let whole = Sums::of(&kernel, (cell_px, wide), &|_, _| 1.0);

        let pixels = Raster::new(self.film, Level::PIXEL);
        let reached =
            group.iter().filter_map(|point| whole.reached(point.place_px(pitch_mm), &pixels).intersection(film));
        let at = Rectangle::around(reached)?;
        let mut light = vec![0.0; at.len()];
        for point in group {
            let place = point.place_px(pitch_mm);
            let Some(reached) = whole.reached(place, &pixels).intersection(film) else { continue };
            // Where nothing nearer lies in a bundle, it is seen by all of the pupil, or by none from behind a surface.
            let hidden = self.sight.map(|sight| (sight, sight.met_by(&reached)));
            let hidden = hidden.filter(|(_, met)| met.first().is_some_and(|met| met.layer + 1 < point.layer));
            let parts = match hidden {
                Some((sight, met)) => {
                    let hidden = HiddenPoint {
                        layer: point.layer,
                        dioptres,
                        before: point.before,
                        place_px: (place[0] as f32, place[1] as f32),
                        width_px: width_px as f32,
                        unclear_px: unclear_px as f32,
                    };
                    let pupil = OpenPupil::of(sight, &met, &hidden);
                    let seen = Sums::of(&kernel, (cell_px, wide), &|below, beside| pupil.part_at(below, beside));
                    seen.on_pixels(place, &pixels, &reached)
                }
                None if point.before.is_some() => continue,
                None => whole.on_pixels(place, &pixels, &reached),
            };
            let lines = light[reached.offset_in(&at)..].chunks_mut(at.columns);
            for (sums, parts) in lines.zip(parts.chunks_exact(reached.columns)) {
                sums.iter_mut().zip(parts).for_each(|(sum, part)| *sum += (point.light * part) as f32);
            }
        }
        Some((at, light))
    }
}

/// Sums of the cells of each column of a kernel from its upper edge down: what lies between two heights is a difference.
struct Sums {
    /// Edges between rows of cells, the first and the last among them, and columns of cells.
    rows: usize,
    columns: usize,
    sums: Vec<f64>,
    /// Of the first cell's corner, pixels below and to the right of the point.
    first_px: [f64; 2],
    cell_px: f64,
}

impl Sums {
    /// Takes a kernel on cells that are so many pixels wide, each of whose points is a square of so many cells, an odd number, and `part` of its light so many pixels below and to the right.
    fn of(kernel: &NodeKernel, (cell_px, wide): (f64, usize), part: &dyn Fn(f64, f64) -> f64) -> Self {
        let NodeKernel { at, samples } = kernel;
        let taps = vec![1.0 / wide as f64; wide];
        let margin = taps.len() / 2;
        let (wide_rows, wide_columns) = (at.rows + 2 * margin, at.columns + 2 * margin);
        let total: f64 = samples.iter().map(|sample| f64::from(*sample)).sum();
        let px = |first: i64, cell: usize| (first + cell as i64) as f64 * cell_px;
        let mut across = vec![0.0; at.rows * wide_columns];
        let mut seen = vec![0.0; at.columns];
        let lines = across.chunks_exact_mut(wide_columns).zip(samples.chunks_exact(at.columns));
        for (row, (line, samples)) in lines.enumerate() {
            let below = px(at.first_row, row);
            for (column, (seen, sample)) in seen.iter_mut().zip(samples).enumerate() {
                let light = f64::from(*sample) / total;
                *seen = if light == 0.0 { 0.0 } else { light * part(below, px(at.first_column, column)) };
            }
            for (k, tap) in taps.iter().enumerate() {
                line[k..].iter_mut().zip(&seen).for_each(|(sum, seen)| *sum += tap * seen);
            }
        }
        let mut sums = vec![0.0; (wide_rows + 1) * wide_columns];
        for (k, tap) in taps.iter().enumerate() {
            for (row, line) in across.chunks_exact(wide_columns).enumerate() {
                let sums = &mut sums[(row + k + 1) * wide_columns..];
                sums.iter_mut().zip(line).for_each(|(sum, value)| *sum += tap * value);
            }
        }
        for row in 1..=wide_rows {
            let (above, own) = sums[(row - 1) * wide_columns..].split_at_mut(wide_columns);
            own.iter_mut().zip(above.iter()).for_each(|(sum, above)| *sum += above);
        }
        let first_px = [at.first_row, at.first_column].map(|first| (first as f64 - margin as f64 - 0.5) * cell_px);
        Self { rows: wide_rows + 1, columns: wide_columns, sums, first_px, cell_px }
    }

    /// Returns the pixels that some of it falls on, of a point so far below and to the right of the film's middle.
    fn reached(&self, place_px: [f64; 2], pixels: &Raster) -> Rectangle {
        let [top, left] = [0, 1].map(|axis| place_px[axis] + self.first_px[axis]);
        let [bottom, right] =
            [(top, self.rows - 1), (left, self.columns)].map(|(first, n)| first + n as f64 * self.cell_px);
        let (first_row, first_column) = (pixels.row_before(top + 0.5), pixels.column_before(left + 0.5));
        let (last_row, last_column) = (pixels.row_before(bottom + 0.5), pixels.column_before(right + 0.5));
        let n = |first: i64, last: i64| (last - first + 1) as usize;
        Rectangle { first_row, first_column, rows: n(first_row, last_row), columns: n(first_column, last_column) }
    }

    /// Returns the parts that fall on some pixels.
    fn on_pixels(&self, place_px: [f64; 2], pixels: &Raster, at: &Rectangle) -> Vec<f64> {
        // The cell edge before that of a pixel, of so many cells, and how far it lies beyond.
        let split = |edge_px: f64, axis: usize, n: usize| {
            let cells = ((edge_px - place_px[axis] - self.first_px[axis]) / self.cell_px).clamp(0.0, n as f64);
            let below = (cells as usize).min(n - 1);
            (below, cells - below as f64)
        };
        let columns: Vec<(usize, f64)> = (0..=at.columns as i64)
            .map(|column| split(pixels.across_px(at.first_column + column) - 0.5, 1, self.columns))
            .collect();
        // Of each column of cells what lies above the upper edge of a row of pixels.
        let above = |row: i64| -> Vec<f64> {
            let (edge, down) = split(pixels.down_px(at.first_row + row) - 0.5, 0, self.rows - 1);
            let [before, from, to, after] = four_about(edge, self.rows).map(|edge| &self.sums[edge * self.columns..]);
            (0..self.columns).map(|i| between([before[i], from[i], to[i], after[i]], down)).collect()
        };
        let mut parts = Vec::with_capacity(at.len());
        let mut before = above(0);
        let mut sums = vec![0.0; self.columns + 1];
        for row in 1..=at.rows as i64 {
            let next = above(row);
            for (i, (next, before)) in next.iter().zip(&before).enumerate() {
                sums[i + 1] = sums[i] + next - before;
            }
            let left_of = |&(edge, across): &(usize, f64)| {
                between(four_about(edge, self.columns + 1).map(|edge| sums[edge]), across)
            };
            let left_of: Vec<f64> = columns.iter().map(left_of).collect();
            parts.extend(left_of.windows(2).map(|sides| (sides[1] - sides[0]).max(0.0)));
            before = next;
        }
        parts
    }
}

/// Returns the numbers of an edge, the next one and those beside them, of so many; beyond the ends there is no more light.
fn four_about(edge: usize, n: usize) -> [usize; 4] {
    [edge.saturating_sub(1), edge, edge + 1, (edge + 2).min(n - 1)]
}

/// Returns a running sum between the second and the third of four edges. Light is even within a cell but for what it changes by from each of the neighbors to the cell, the less
/// of both: an outline stays one.
#[inline]
fn between([before, from, to, after]: [f64; 4], part: f64) -> f64 {
    let bends = [before - 2.0 * from + to, from - 2.0 * to + after].map(|change| 0.5 * change);
    let bend = if bends[0] * bends[1] > 0.0 { bends[0].abs().min(bends[1].abs()).copysign(bends[0]) } else { 0.0 };
    from + part * (to - from) + part * (part - 1.0) * bend
}

#[cfg(test)]
mod tests {
    use super::*;
    use dioptric_psf::Kernel;
    use ndarray::Array2;

    /// Whatever its cells and wherever it lies, a kernel keeps its sum and its middle.
    #[test]
    fn parts_on_pixels_keep_sum_and_centroid() {
        let film = Film::centered(40, 41, 3.0);
        let pixels = Raster::new(&film, Level::PIXEL);
        let samples = Array2::from_shape_fn((5, 7), |(row, column)| (1 + row * column) as f32);
        let sum: f32 = samples.sum();
        let mean = |weight: &dyn Fn(usize, usize) -> f64| {
            samples.indexed_iter().map(|((r, c), v)| weight(r, c) * f64::from(*v)).sum::<f64>() / f64::from(sum)
        };
        let middle = [mean(&|row, _| row as f64 - 2.0), mean(&|_, column| column as f64 - 3.0)];
        for (cell_px, wide) in [(0.25, 1), (0.25, 3), (1.0, 1), (4.0, 3)] {
            let sums =
                Sums::of(&NodeKernel::new(&Kernel::centered(samples.clone(), 1.0)), (cell_px, wide), &|_, _| 1.0);
            for place in [[0.0, 0.0], [0.13, -3.42], [2.77, 1.5]] {
                let at = sums.reached(place, &pixels);
                let parts = sums.on_pixels(place, &pixels, &at);
                let centroid = [0, 1].map(|axis| {
                    let px = |i: usize| match axis {
                        0 => pixels.down_px(at.first_row + (i / at.columns) as i64),
                        _ => pixels.across_px(at.first_column + (i % at.columns) as i64),
                    };
                    parts.iter().enumerate().map(|(i, part)| px(i) * part).sum::<f64>()
                });
                assert!((parts.iter().sum::<f64>() - 1.0).abs() < 1e-12);
                for axis in [0, 1] {
                    let expected = place[axis] + cell_px * middle[axis];
                    // A pixel counts by its middle: exact for cells of whole pixels or in the mean of even light.
                    assert!((centroid[axis] - expected).abs() < 0.25, "{cell_px} {place:?}: {centroid:?}");
                }
            }
        }
    }

    /// A Gaussian two thirds of a pixel wide on eighths of pixels, wherever it lies.
    #[test]
    fn parts_on_pixels_are_integrals() {
        let film = Film::centered(20, 20, 3.0);
        let pixels = Raster::new(&film, Level::PIXEL);
        let (cell_px, sigma_px) = (0.125, 0.66);
        let up_to = |px: f64| 0.5 * libm::erfc(-px / (sigma_px * std::f64::consts::SQRT_2));
        let in_cell = |i: usize| {
            let px = (i as f64 - 30.5) * cell_px;
            up_to(px + cell_px) - up_to(px)
        };
        let samples = Array2::from_shape_fn((61, 61), |(row, column)| (in_cell(row) * in_cell(column)) as f32);
        let sums = Sums::of(&NodeKernel::new(&Kernel::centered(samples, 1.0)), (cell_px, 1), &|_, _| 1.0);
        for place in [[0.5, 0.5], [0.56, 0.5], [0.43, 0.37], [1.0, 0.21]] {
            let at = sums.reached(place, &pixels);
            for (i, part) in sums.on_pixels(place, &pixels, &at).into_iter().enumerate() {
                let middle = [
                    pixels.down_px(at.first_row + (i / at.columns) as i64) - place[0],
                    pixels.across_px(at.first_column + (i % at.columns) as i64) - place[1],
                ];
                let expected: f64 = middle.iter().map(|px| up_to(px + 0.5) - up_to(px - 0.5)).product();
                // Straight lines within cells were 1 % off in the brightest pixel.
                assert!((part - expected).abs() < 1e-3, "{place:?} {i}: {part} {expected}");
            }
        }
    }
}
