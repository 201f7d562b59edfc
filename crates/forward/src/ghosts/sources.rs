//! A scene as points: cells of its samples, small where there is much light, and the points beside it.

use std::{cmp::Ordering, collections::BTreeMap, collections::BinaryHeap, ops::Range};

use dioptric_scene::PointLight;
use dioptric_spectrum::SpectrumError;
use glam::DVec2;
use ndarray::Array2;
use rayon::prelude::*;

use crate::{ForwardError, Source, points::Beside};

/// A point that throws ghosts.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SourcePoint {
    /// Its direction from the projection center: tangents to the right and upwards.
    pub(super) field_tan: DVec2,
    /// One over its axial depth, 1/m.
    pub(super) dioptres: f64,
    /// Radiance times the area in tangents, by band.
    pub(super) light: Vec<f64>,
}

/// Blocks of samples along the longer side of a scene that cells are made of.
const MOST_BLOCKS: usize = 384;
/// Cells a side in which points beside a scene are taken together that are not followed by themselves.
const POINT_CELLS: f64 = 16.0;

/// The samples of a scene, reduced to cells.
pub(super) struct Cells {
    pub(super) points: Vec<SourcePoint>,
}

/// Sums over samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Sums {
    light: f64,
    row: f64,
    column: f64,
    dioptres: f64,
}

/// A rectangle of blocks, to be cut where it has most light and is wide.
#[derive(Clone, Debug, PartialEq)]
struct Cell {
    rows: Range<usize>,
    columns: Range<usize>,
    sums: Sums,
    urgency: f64,
}

impl Eq for Cell {}

impl PartialOrd for Cell {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Cell {
    fn cmp(&self, other: &Self) -> Ordering {
        let place = |cell: &Self| (cell.rows.start, cell.columns.start);
        self.urgency.total_cmp(&other.urgency).then_with(|| place(other).cmp(&place(self)))
    }
}

impl Cell {
    fn of(blocks: &Array2<Sums>, rows: Range<usize>, columns: Range<usize>) -> Self {
        let mut sums = Sums::default();
        for row in rows.clone() {
            for column in columns.clone() {
                let block = &blocks[(row, column)];
                sums.light += block.light;
                sums.row += block.row;
                sums.column += block.column;
                sums.dioptres += block.dioptres;
            }
        }
        let longest = rows.len().max(columns.len());
        let urgency = if longest > 1 { sums.light * longest as f64 } else { 0.0 };
        Self { rows, columns, sums, urgency }
    }

    fn halves(&self, blocks: &Array2<Sums>) -> [Self; 2] {
        let half = |range: &Range<usize>| range.start + range.len() / 2;
        if self.rows.len() > self.columns.len() {
            let middle = half(&self.rows);
            let of = |rows| Self::of(blocks, rows, self.columns.clone());
            return [of(self.rows.start..middle), of(middle..self.rows.end)];
        }
        let middle = half(&self.columns);
        let of = |columns| Self::of(blocks, self.rows.clone(), columns);
        [of(self.columns.start..middle), of(middle..self.columns.end)]
    }
}

impl Cells {
    /// Reduces the first surface of a scene to so many cells at most.
    pub(super) fn of(source: &Source<'_>, n_cells: usize) -> Result<Self, ForwardError> {
        let (rows, columns) = source.radiance.size();
        let step = rows.max(columns).div_ceil(MOST_BLOCKS).max(1);
        let shape = (rows.div_ceil(step), columns.div_ceil(step));
        let n_bands = source.radiance.grid().len();
        // What each block shines in each band; where in it the light is, and how near.
        let of_band = |band: usize| -> Result<Array2<f64>, SpectrumError> {
            let plane = source.radiance.band(band)?;
            let mut blocks = Array2::zeros(shape);
            for ((row, column), &value) in plane.indexed_iter() {
                blocks[(row / step, column / step)] += f64::from(value);
            }
            Ok(blocks)
        };
        let by_band: Vec<Array2<f64>> =
            (0..n_bands).into_par_iter().map(of_band).collect::<Result<_, SpectrumError>>()?;
        // The middle one of the bands tells where within a block its light lies.
        let plane = source.radiance.band(n_bands / 2)?;
        let mut blocks = Array2::from_elem(shape, Sums::default());
        for ((row, column), &value) in plane.indexed_iter() {
            // A dark block has a middle too.
            let light = f64::from(value) + DARK;
            let block: &mut Sums = &mut blocks[(row / step, column / step)];
            block.light += light;
            block.row += light * row as f64;
            block.column += light * column as f64;
            block.dioptres += light / f64::from(source.depth.z_m()[(row, column)]);
        }
        for (at, block) in blocks.indexed_iter_mut() {
            let light: f64 = by_band.iter().map(|band| band[at]).sum();
            let factor = light / block.light;
            let Sums { row, column, dioptres, .. } = *block;
            *block = Sums { light, row: factor * row, column: factor * column, dioptres: factor * dioptres };
        }
        let mut heap = BinaryHeap::from([Cell::of(&blocks, 0..shape.0, 0..shape.1)]);
        while heap.len() < n_cells && heap.peek().is_some_and(|cell| cell.urgency > 0.0) {
            let Some(cell) = heap.pop() else { break };
            heap.extend(cell.halves(&blocks));
        }
        let area_tan2 = source.view.focal_px.powi(-2);
        let point = |cell: &Cell| {
            let Sums { light: all, row, column, dioptres } = cell.sums;
            let (tan_x, tan_y) = source.view.tan_at(row / all, column / all);
            let light =
                |band: &Array2<f64>| area_tan2 * band.slice(ndarray::s![cell.rows.clone(), cell.columns.clone()]).sum();
            SourcePoint {
                field_tan: DVec2::new(tan_x, tan_y),
                dioptres: dioptres / all,
                light: by_band.iter().map(light).collect(),
            }
        };
        let cells = heap.into_sorted_vec();
        Ok(Self { points: cells.iter().filter(|cell| cell.sums.light > 0.0).map(point).collect() })
    }
}

/// Light far below that of any scene, W m⁻² sr⁻¹ nm⁻¹.
const DARK: f64 = 1e-30;

impl SourcePoint {
    /// Returns the points beside a scene that the lens sees; all but so many of the brightest together where they are close.
    pub(super) fn all_beside(places: &[Option<Beside>], lights: &[PointLight], n_alone: usize) -> Vec<Self> {
        let seen = places.iter().zip(lights).filter_map(|(place, light)| Some((place.as_ref()?, light)));
        let point = |(place, light): (&Beside, &PointLight)| {
            let (field_tan, dioptres, tan2) = place.seen_at();
            let light = light.light.by_band().iter().map(|value| tan2 * f64::from(*value)).collect();
            Self { field_tan, dioptres, light }
        };
        let mut points: Vec<Self> = seen.filter(|(place, _)| !place.is_behind()).map(point).collect();
        let all = |point: &Self| point.light.iter().sum::<f64>();
        points.retain(|point| all(point) > 0.0);
        points.sort_by(|a, b| all(b).total_cmp(&all(a)));
        let rest = points.split_off(points.len().min(n_alone));
        let [low, high] = [DVec2::min, DVec2::max].map(|of: fn(DVec2, DVec2) -> DVec2| {
            rest.iter().map(|point| point.field_tan).reduce(of).unwrap_or_default()
        });
        let mut cells: BTreeMap<[i64; 2], Vec<&Self>> = BTreeMap::new();
        for point in &rest {
            let cell = ((point.field_tan - low) / (high - low).max(DVec2::splat(1e-9)) * POINT_CELLS).floor();
            cells.entry([cell.x as i64, cell.y as i64]).or_default().push(point);
        }
        let together = |points: Vec<&Self>| {
            let light: f64 = points.iter().map(|point| all(point)).sum();
            let mean =
                |of: &dyn Fn(&Self) -> f64| points.iter().map(|point| all(point) * of(point)).sum::<f64>() / light;
            Self {
                field_tan: DVec2::new(mean(&|point| point.field_tan.x), mean(&|point| point.field_tan.y)),
                dioptres: mean(&|point| point.dioptres),
                light: (0..points[0].light.len())
                    .map(|band| points.iter().map(|point| point.light[band]).sum())
                    .collect(),
            }
        };
        points.extend(cells.into_values().map(together));
        points
    }
}
