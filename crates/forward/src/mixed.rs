//! Samples on edges of depth that show something of both sides.
//!
//! A picture whose samples are means over their squares has mixed ones along every outline, and each lies at one depth. Imaged there, what it shows of the
//! other side would be as sharp, or as blurred, as its own: a near edge out of focus would leave a thin line of its color on the wall that is in focus.

use std::borrow::Cow;

use dioptric_spectrum::{Cancel, Cancelled};
use ndarray::Array2;
use rayon::prelude::*;

use crate::{
    layers::{DEPTH_EDGE_PX, IN_FOCUS_PX, Layers},
    occluded::Distances,
};

/// Samples beside an edge of depth, and the samples around by which they are judged.
#[derive(Default)]
pub(crate) struct MixedSamples {
    samples: Vec<Mixed>,
    /// Indices of samples: of each mixed one those of its own side that lie beside no edge, then those of the other side.
    around: Vec<u32>,
}

/// A sample beside an edge, those of its own side that lie beside none, and its neighbors of the other side.
struct Found {
    sample: u32,
    own: Vec<u32>,
    other: Vec<u32>,
}

/// A sample beside an edge, and where its lists begin and end.
struct Mixed {
    sample: u32,
    first: u32,
    first_other: u32,
    end: u32,
}

/// How far around a sample others of its own side are looked for.
const AROUND: usize = 2;

impl MixedSamples {
    /// Finds the samples of which a neighbor lies farther or nearer by more than a jump, where of neither is known what lies behind it: what a
    /// second layer holds of mixed samples, and what these show of it, make up each other.
    pub(crate) fn find(distances: &Distances, layers: &Layers, cancel: &Cancel) -> Result<Self, Cancelled> {
        let (front, jump) = (&distances.front, DEPTH_EDGE_PX);
        // What is in focus keeps its outline, mixtures and all: pixels of a sharp picture show both sides too.
        let is_sharp = |at: (usize, usize)| {
            layers.radius_px_at(layers.coordinate_of_distance(front[at])) <= f64::from(IN_FOCUS_PX)
        };
        let (rows, columns) = front.dim();
        let near = |row: usize, column: usize, by: usize| {
            let lines = row.saturating_sub(by)..(row + by + 1).min(rows);
            let places = column.saturating_sub(by)..(column + by + 1).min(columns);
            lines.flat_map(move |r| places.clone().map(move |c| (r, c)))
        };
        let is_apart = |a: (usize, usize), b: (usize, usize)| (front[a] - front[b]).abs() > jump;
        let is_beside_edge = |at: (usize, usize)| near(at.0, at.1, 1).any(|other| is_apart(at, other));
        let index = |(row, column): (usize, usize)| (row * columns + column) as u32;
        let of_row = |row: usize| {
            cancel.check()?;
            let mut found = vec![];
            for at in (0..columns).map(|column| (row, column)).filter(|&at| is_beside_edge(at) && !is_sharp(at)) {
                let (row, column) = at;
                if near(row, column, 1).any(|other| distances.is_known_behind(other)) {
                    continue;
                }
                let own = near(row, column, AROUND).filter(|&other| !is_apart(at, other) && !is_beside_edge(other));
                let own: Vec<u32> = own.map(index).collect();
                let other: Vec<u32> = near(row, column, 1).filter(|&other| is_apart(at, other)).map(index).collect();
                // Something as thin as its own outline has no other color to go by.
                if !own.is_empty() {
                    found.push(Found { sample: index(at), own, other });
                }
            }
            Ok(found)
        };
        let found: Vec<Vec<Found>> = (0..rows).into_par_iter().map(of_row).collect::<Result<_, Cancelled>>()?;
        let mut this = Self::default();
        for Found { sample, own, other } in found.into_iter().flatten() {
            let first = this.around.len() as u32;
            this.around.extend(own);
            let first_other = this.around.len() as u32;
            this.around.extend(other);
            this.samples.push(Mixed { sample, first, first_other, end: this.around.len() as u32 });
        }
        Ok(this)
    }

    /// The bytes of memory of the lists.
    pub(crate) fn size_bytes(&self) -> usize {
        size_of_val(self.samples.as_slice()) + size_of_val(self.around.as_slice())
    }

    /// Returns a band with what mixed samples show of the other side taken away: one that lies between the values of its own side and
    /// those of the other becomes the nearest of its own side's.
    pub(crate) fn unmixed<'a>(&self, plane: &'a Array2<f32>) -> Cow<'a, Array2<f32>> {
        if self.samples.is_empty() {
            return Cow::Borrowed(plane);
        }
        let samples = plane.as_standard_layout();
        let samples = samples.as_slice().expect("it is in standard order");
        let mut unmixed = plane.as_standard_layout().into_owned();
        let own_only = unmixed.as_slice_mut().expect("it is in standard order");
        for mixed in &self.samples {
            let values =
                |first: u32, end: u32| self.around[first as usize..end as usize].iter().map(|&at| samples[at as usize]);
            let range = |first: u32, end: u32| {
                values(first, end).fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
            };
            let (least, most) = range(mixed.first, mixed.first_other);
            let (other_least, other_most) = range(mixed.first_other, mixed.end);
            let value = &mut own_only[mixed.sample as usize];
            if (other_least..least).contains(value) {
                *value = least;
            } else if *value > most && *value <= other_most {
                *value = most;
            }
        }
        Cow::Owned(unmixed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layers::Blurs;

    /// Layers whose nearest is blurred over 20 pixels and whose farthest over 10.
    fn out_of_focus() -> Layers {
        let lens = crate::DiscLens { focus_dioptres: 0.0, ..crate::DiscLens::default() };
        let (places_mm, wavelengths_nm) = ([glam::DVec2::ZERO], [550.0]);
        let blurs = Blurs { lens: &lens, pitch_mm: 1e-3, places_mm: &places_mm, wavelengths_nm: &wavelengths_nm };
        Layers::over((2.0, 20.0), 2.0, &blurs)
    }

    fn found(front: &Array2<f32>) -> MixedSamples {
        let distances = Distances { front: front.clone(), behind: None };
        MixedSamples::find(&distances, &out_of_focus(), &Cancel::new()).unwrap()
    }

    /// A near half plane of 2 before a wall of stripes of 5 and 6; the edge passes through column 8 or 9.
    fn edge(share_of_near: [f32; 2]) -> (Array2<f32>, Array2<f32>) {
        let distances = Array2::from_shape_fn((12, 20), |(_, column)| if column < 9 { 0.0 } else { 10.0 });
        let wall = |row: usize| if row.is_multiple_of(2) { 5.0 } else { 6.0 };
        let plane = Array2::from_shape_fn((12, 20), |(row, column)| {
            let near = match column {
                8 => share_of_near[0],
                9 => share_of_near[1],
                _ => {
                    if column < 8 {
                        1.0
                    } else {
                        0.0
                    }
                }
            };
            2.0 * near + (1.0 - near) * wall(row)
        });
        (distances, plane)
    }

    #[test]
    fn mixed_colors_become_those_of_their_own_side() {
        for share_of_near in [[1.0, 0.4], [0.6, 0.0], [1.0, 0.0]] {
            let (distances, plane) = edge(share_of_near);
            let mixed = found(&distances);
            let unmixed = mixed.unmixed(&plane);
            for ((row, column), &value) in unmixed.indexed_iter() {
                match column {
                    0..9 => assert_eq!(value, 2.0, "{row}, {column}"),
                    // Between the stripes of the wall, or on one.
                    9 => assert!((5.0..=6.0).contains(&value), "{row}, {column}: {value}"),
                    _ => assert_eq!(value, plane[(row, column)]),
                }
            }
        }
    }

    #[test]
    fn what_is_made_up_for_by_a_second_layer_stays() {
        let (front, plane) = edge([1.0, 0.4]);
        // Known behind the near side, in the upper half.
        let behind = Array2::from_shape_fn((12, 20), |(row, column)| if row < 6 && column < 9 { 10.0 } else { 0.0 });
        let distances = Distances { front, behind: Some(behind) };
        let unmixed =
            MixedSamples::find(&distances, &out_of_focus(), &Cancel::new()).unwrap().unmixed(&plane).into_owned();
        for (row, value) in unmixed.column(9).iter().enumerate() {
            // The row beside the known half has known neighbors.
            assert_eq!(*value == plane[(row, 9)], row < 7, "{row}: {value}");
        }
    }

    #[test]
    fn a_bright_rim_and_a_continuous_surface_stay() {
        let (distances, mut plane) = edge([1.0, 0.0]);
        // Brighter than both sides: no mixture of them.
        plane.column_mut(8).fill(40.0);
        assert_eq!(*found(&distances).unmixed(&plane), plane);
        let slope = Array2::from_shape_fn((12, 20), |(_, column)| 2.0 * column as f32);
        assert!(found(&slope).samples.is_empty());
    }

    #[test]
    fn what_is_too_thin_to_have_a_color_of_its_own_stays() {
        let distances = Array2::from_shape_fn((12, 20), |(_, column)| if column == 9 { 0.0 } else { 10.0 });
        let plane = Array2::from_shape_fn((12, 20), |(_, column)| if column == 9 { 3.0 } else { 8.0 });
        assert_eq!(*found(&distances).unmixed(&plane), plane);
    }
}
