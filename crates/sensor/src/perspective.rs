//! A part of the picture with upright sides made of one that leans: perspective crop.

use ndarray::Array2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{SensorError, lens_tables::sample_at, plane_rows::plane_rows};

/// The four-sided part of the picture that is stretched to the whole of it, as that of a plane seen aslant.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Perspective {
    /// Its corners clockwise from the upper left one: shares of the picture's width and height, from its upper left corner.
    pub corners: [(f64, f64); 4],
}

/// Corners may lie this far beyond the picture, a share of it; what is there is black.
const BEYOND: f64 = 0.5;

impl Perspective {
    /// Reads `x1,y1,…,x4,y4`.
    ///
    /// # Errors
    /// When these are not eight numbers.
    pub fn parse(text: &str) -> Result<Self, SensorError> {
        let numbers: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
        match numbers.as_deref() {
            Some(&[x1, y1, x2, y2, x3, y3, x4, y4]) => Ok(Self { corners: [(x1, y1), (x2, y2), (x3, y3), (x4, y4)] }),
            _ => Err(SensorError::Word {
                what: "the perspective",
                found: text.to_owned(),
                expected: "four corners x,y clockwise from the upper left one, shares of width and height, as 0.1,0,0.9,0,1,1,0,1"
                    .to_owned(),
            }),
        }
    }

    pub(crate) fn check(&self) -> Result<(), SensorError> {
        let range = -BEYOND..=1.0 + BEYOND;
        let wrong = self.corners.iter().flat_map(|&(x, y)| [x, y]).find(|share| !range.contains(share));
        if let Some(share) = wrong {
            let expected = "shares of the picture, from -0.5 to 1.5";
            return Err(SensorError::value("the processing", "perspective.corners", share, expected));
        }
        // Twice the area of each corner's triangle: above 0 where the way turns clockwise, rows being counted downwards.
        let turn = |i: usize| {
            let [(ax, ay), (bx, by), (cx, cy)] = [i, i + 1, i + 2].map(|k| self.corners[k % 4]);
            (bx - ax) * (cy - by) - (by - ay) * (cx - bx)
        };
        match (0..4).map(turn).find(|turn| *turn < 1e-4) {
            Some(turn) => {
                let expected = "above 0 at each corner: clockwise from the upper left one, no side crossing another";
                Err(SensorError::value("the processing", "the turn of perspective.corners", turn, expected))
            }
            None => Ok(()),
        }
    }

    /// Returns the map from shares of the new picture to shares of the old one (Heckbert, "Fundamentals of texture mapping and image
    /// warping", 1989, section 2.2.3).
    fn map(&self) -> impl Fn(f64, f64) -> (f64, f64) + Sync {
        let [(x0, y0), (x1, y1), (x2, y2), (x3, y3)] = self.corners;
        let (sum_x, sum_y) = (x0 - x1 + x2 - x3, y0 - y1 + y2 - y3);
        let (dx1, dx2, dy1, dy2) = (x1 - x2, x3 - x2, y1 - y2, y3 - y2);
        let determinant = dx1 * dy2 - dx2 * dy1;
        let g = (sum_x * dy2 - dx2 * sum_y) / determinant;
        let h = (dx1 * sum_y - sum_x * dy1) / determinant;
        let (a, b) = (x1 - x0 + g * x1, x3 - x0 + h * x3);
        let (d, e) = (y1 - y0 + g * y1, y3 - y0 + h * y3);
        move |u, v| {
            let w = g * u + h * v + 1.0;
            ((a * u + b * v + x0) / w, (d * u + e * v + y0) / w)
        }
    }

    /// Returns channels whose whole is the part of these, by Keys's cubic convolution; what lies beyond them is 0.
    pub(crate) fn apply(&self, channels: &[Array2<f32>]) -> Vec<Array2<f32>> {
        let (rows, columns) = channels[0].dim();
        let (width, height) = (columns as f64, rows as f64);
        let map = self.map();
        let mut moved: Vec<Array2<f32>> = channels.iter().map(|_| Array2::zeros((rows, columns))).collect();
        plane_rows(&mut moved).into_par_iter().enumerate().for_each(|(row, mut out)| {
            let v = (row as f64 + 0.5) / height;
            for column in 0..columns {
                let (x, y) = map((column as f64 + 0.5) / width, v);
                let (x, y) = (x * width - 0.5, y * height - 0.5);
                if (-0.5..=width - 0.5).contains(&x) && (-0.5..=height - 0.5).contains(&y) {
                    out.iter_mut().zip(channels).for_each(|(out, plane)| out[column] = sample_at(plane, x, y));
                }
            }
        });
        moved
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_become_corners_and_lines_stay_straight() {
        let leaning = Perspective { corners: [(0.2, 0.1), (0.8, 0.15), (0.95, 0.9), (0.05, 0.85)] };
        leaning.check().unwrap();
        let map = leaning.map();
        for ((u, v), (x, y)) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].into_iter().zip(leaning.corners) {
            let found = map(u, v);
            assert!((found.0 - x).abs() < 1e-12 && (found.1 - y).abs() < 1e-12, "{found:?}");
        }
        // Three places of a row lie on a line, and cross ratios are kept.
        let [a, b, c, d] = [0.0, 0.25, 0.5, 1.0].map(|u| map(u, 0.3));
        let along = |p: (f64, f64)| (p.0 - a.0).hypot(p.1 - a.1);
        let off = (b.0 - a.0) * (d.1 - a.1) - (b.1 - a.1) * (d.0 - a.0);
        assert!(off.abs() < 1e-12);
        let ratio = (along(c) - along(a)) * (along(d) - along(b)) / ((along(c) - along(b)) * (along(d) - along(a)));
        assert!((ratio - 0.5 * 0.75 / 0.25).abs() < 1e-9, "{ratio}");
    }

    #[test]
    fn the_whole_picture_stays_and_a_known_one_is_straightened() {
        let whole = Perspective { corners: [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] };
        let plane = Array2::from_shape_fn((40, 60), |(row, column)| ((row * 7 + column * 3) % 11) as f32);
        let same = whole.apply(std::slice::from_ref(&plane));
        assert!(same[0].iter().zip(&plane).all(|(a, b)| (a - b).abs() < 1e-5));
        // A plane of smooth waves as a camera sees it aslant, straightened again.
        let leaning = Perspective { corners: [(0.25, 0.1), (0.75, 0.1), (0.95, 0.9), (0.05, 0.9)] };
        let wave = |u: f64, v: f64| (0.5 + 0.25 * (6.0 * u).sin() + 0.25 * (5.0 * v).cos()) as f32;
        let (rows, columns) = (240, 320);
        let map = leaning.map();
        let mut seen = Array2::zeros((rows, columns));
        // Finer than pixels, so that each place of the seen picture has its wave by bisection in v and then u.
        for row in 0..rows {
            for column in 0..columns {
                let (x, y) = ((column as f64 + 0.5) / columns as f64, (row as f64 + 0.5) / rows as f64);
                let (mut low, mut high) = (-0.5, 1.5);
                for _ in 0..60 {
                    let v = 0.5 * (low + high);
                    // Rows of this quadrilateral stay rows.
                    if map(0.5, v).1 < y { low = v } else { high = v }
                }
                let v = 0.5 * (low + high);
                let (left, right) = (map(0.0, v).0, map(1.0, v).0);
                seen[(row, column)] = wave((x - left) / (right - left), v);
            }
        }
        let straight = &leaning.apply(&[seen])[0];
        for ((row, column), value) in straight.indexed_iter() {
            let wanted = wave((column as f64 + 0.5) / columns as f64, (row as f64 + 0.5) / rows as f64);
            // Cubic convolution of waves a hundred pixels long.
            assert!((value - wanted).abs() < 1e-3, "{row}, {column}: {value} {wanted}");
        }
    }

    #[test]
    fn what_is_no_quadrilateral_is_refused() {
        let read = Perspective::parse("0.1,0,0.9,0,1,1,0,1").unwrap();
        assert_eq!(read.corners, [(0.1, 0.0), (0.9, 0.0), (1.0, 1.0), (0.0, 1.0)]);
        assert!(Perspective::parse("0,0,1,1").unwrap_err().to_string().contains("0.1,0,0.9,0,1,1,0,1"));
        for wrong in ["0,0,1,0,0,1,1,1", "0,0,0,1,1,1,1,0", "0,0,1,0,1,9,0,1", "0,0,NaN,0,1,1,0,1", "0,0,1,0,0.5,0,0,1"]
        {
            assert!(Perspective::parse(wrong).unwrap().check().is_err(), "{wrong}");
        }
    }
}
