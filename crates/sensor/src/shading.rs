//! Lens shading: the fall of light towards the corners, undone.

use ndarray::Array2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{Raw, SensorError, Tile};

/// The factor that undoes the fall of light at each place.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum LensShading {
    /// 1 + a2 r² + a4 r⁴ + a6 r⁶, the same for all filters; r is 0 in the middle and 1 in the corners.
    Radial {
        /// Factor of r².
        a2: f64,
        /// Factor of r⁴.
        a4: f64,
        /// Factor of r⁶.
        a6: f64,
    },
    /// A table for each filter, read with straight lines between its cells.
    Map(ShadingMap),
}

/// Factors in the middles of the cells of a coarse grid over the frame; beyond the outermost the lines go on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ShadingMap {
    /// Cells from top to bottom, 2 or more.
    pub rows: usize,
    /// Cells from left to right, 2 or more.
    pub columns: usize,
    /// For each filter the factors row by row.
    pub factors: Vec<Vec<f32>>,
}

impl ShadingMap {
    /// Returns the map that makes a frame of an evenly lit gray field even, 1 where each filter is brightest.
    ///
    /// Each cell takes the mean of its pixels, so that noise averages out.
    ///
    /// # Errors
    /// When the grid is smaller than 2 × 2, or finer than the frame, or a cell sees no light.
    pub fn measure(flat: &Raw, rows: usize, columns: usize) -> Result<Self, SensorError> {
        let (n_rows, n_columns) = flat.size();
        let tile = flat.tile.clone().unwrap_or_else(|| Tile::single(0));
        if rows < 2 || columns < 2 || rows * tile.rows() > n_rows || columns * tile.columns() > n_columns {
            let (expected, found) = ("2 × 2, and fewer cells than tiles".to_owned(), format!("{rows} × {columns}"));
            return Err(SensorError::Shape { what: "cells of a shading map (at least)", expected, found });
        }
        let n_filters = flat.filter_names.len();
        let mut sums = vec![vec![(0.0_f64, 0.0_f64); rows * columns]; n_filters];
        for (number, plane) in flat.linear().iter().enumerate() {
            for ((row, column), &value) in plane.indexed_iter() {
                let filter = if flat.tile.is_some() { tile.filter_at(row, column) } else { number };
                let place = row * rows / n_rows * columns + column * columns / n_columns;
                let (sum, count) = &mut sums[filter][place];
                (*sum, *count) = (*sum + f64::from(value), *count + 1.0);
            }
        }
        let mut factors = Vec::with_capacity(n_filters);
        for sums in sums {
            let means: Vec<f64> =
                sums.iter().map(|(sum, count)| if *count > 0.0 { sum / count } else { 0.0 }).collect();
            let brightest = means.iter().copied().fold(0.0, f64::max);
            if let Some(&dark) = means.iter().find(|&&mean| mean <= 0.0) {
                return Err(SensorError::value("the flat frame", "the mean of a cell", dark, "light everywhere"));
            }
            factors.push(means.iter().map(|mean| (brightest / mean) as f32).collect());
        }
        Ok(Self { rows, columns, factors })
    }

    fn at(&self, filter: usize, down: f64, right: f64) -> f64 {
        let (y, x) = (down * self.rows as f64 - 0.5, right * self.columns as f64 - 0.5);
        let (row, column) = ((y as usize).min(self.rows - 2), (x as usize).min(self.columns - 2));
        let (fy, fx) = (y - row as f64, x - column as f64);
        let value = |r: usize, c: usize| f64::from(self.factors[filter][r * self.columns + c]);
        let line = |r: usize| value(r, column) * (1.0 - fx) + value(r, column + 1) * fx;
        line(row) * (1.0 - fy) + line(row + 1) * fy
    }
}

impl LensShading {
    pub(crate) fn check(&self, n_filters: usize) -> Result<(), SensorError> {
        let wrong = |expected: String, found: String| {
            Err(SensorError::Shape { what: "factors of a shading map", expected, found })
        };
        match self {
            Self::Radial { a2, a4, a6 } if [a2, a4, a6].iter().all(|a| a.is_finite()) => Ok(()),
            Self::Radial { a2, a4, a6 } => {
                let sum = a2 + a4 + a6;
                Err(SensorError::value("the lens shading", "a2, a4 or a6", sum, "finite numbers"))
            }
            Self::Map(map) if map.rows < 2 || map.columns < 2 => {
                wrong("2 × 2 or more".to_owned(), format!("{} × {}", map.rows, map.columns))
            }
            Self::Map(map) if map.factors.len() != n_filters => {
                wrong(format!("{n_filters} filters"), format!("{}", map.factors.len()))
            }
            Self::Map(map) => match map.factors.iter().find(|f| f.len() != map.rows * map.columns) {
                Some(factors) => wrong(format!("{}", map.rows * map.columns), format!("{}", factors.len())),
                None => Ok(()),
            },
        }
    }

    /// Multiplies each sample by its factor.
    pub(crate) fn correct(&self, planes: &mut [Array2<f32>], tile: Option<&Tile>) {
        for (number, plane) in planes.iter_mut().enumerate() {
            let (n_rows, n_columns) = plane.dim();
            let share = |i: usize, n: usize| (i as f64 + 0.5) / n as f64;
            plane.outer_iter_mut().into_par_iter().enumerate().for_each(|(row, mut values)| {
                let filters = tile.map_or(std::slice::from_ref(&number), |tile| tile.row(row));
                let down = share(row, n_rows);
                for (column, value) in values.iter_mut().enumerate() {
                    let right = share(column, n_columns);
                    *value *=
                        self.factor(filters[column % filters.len()], down, right, n_columns as f64 / n_rows as f64)
                            as f32;
                }
            });
        }
    }

    fn factor(&self, filter: usize, down: f64, right: f64, aspect: f64) -> f64 {
        match self {
            Self::Radial { a2, a4, a6 } => {
                let (y, x) = (2.0 * down - 1.0, aspect * (2.0 * right - 1.0));
                let r2 = (x * x + y * y) / (1.0 + aspect * aspect);
                1.0 + r2 * (a2 + r2 * (a4 + r2 * a6))
            }
            Self::Map(map) => map.at(filter, down, right),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ElectronRate, Exposure, Noise, Sensor};

    fn vignetted() -> Raw {
        let sensor = Sensor::built_in("imx363").unwrap();
        let fall = |r: usize, c: usize| {
            let (y, x) = ((r as f32 + 0.5) / 60.0 - 1.0, 4.0 / 3.0 * ((c as f32 + 0.5) / 80.0 - 1.0));
            1.0 / (1.0 + 0.5 * (x * x + y * y) / (25.0 / 9.0))
        };
        let rate = ElectronRate { planes_e_per_s: vec![Array2::from_shape_fn((120, 160), |(r, c)| 3e5 * fall(r, c))] };
        let exposure = Exposure::seconds(0.01);
        let electrons = sensor.electrons(&rate, &exposure, &Noise::none()).unwrap();
        sensor.digitize(&sensor.volts(&electrons, &exposure, &Noise::none()).unwrap(), &exposure).unwrap()
    }

    fn evenness(shading: &LensShading) -> f32 {
        let raw = vignetted();
        let mut planes = raw.linear();
        shading.check(3).unwrap();
        shading.correct(&mut planes, raw.tile.as_ref());
        let (low, high) = planes[0].iter().fold((f32::MAX, f32::MIN), |(l, h), &v| (l.min(v), h.max(v)));
        low / high
    }

    #[test]
    fn a_known_fall_and_a_measured_one_are_undone() {
        assert!(evenness(&LensShading::Radial { a2: 0.0, a4: 0.0, a6: 0.0 }) < 0.7);
        // Rounding to 10 bits leaves 0.1 %.
        assert!(evenness(&LensShading::Radial { a2: 0.5, a4: 0.0, a6: 0.0 }) > 0.995);
        // Straight lines between 10 × 10 cells, and beyond the outermost, leave two per cent in the corners.
        assert!(evenness(&LensShading::Map(ShadingMap::measure(&vignetted(), 10, 10).unwrap())) > 0.97);
    }

    #[test]
    fn maps_of_the_wrong_size_are_refused() {
        let map = |rows, columns, factors| LensShading::Map(ShadingMap { rows, columns, factors });
        assert!(map(1, 2, vec![vec![1.0; 2]; 3]).check(3).is_err());
        assert!(map(2, 2, vec![vec![1.0; 4]; 2]).check(3).is_err());
        assert!(map(2, 2, vec![vec![1.0; 3]; 3]).check(3).is_err());
        assert!(ShadingMap::measure(&vignetted(), 1000, 2).is_err());
    }
}
