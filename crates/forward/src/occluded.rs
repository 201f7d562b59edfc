//! The second samples of a scene: what lies behind near surfaces, close to their edges.

use std::borrow::Cow;

use dioptric_spectrum::{Cancel, Cancelled, DepthMap};
use ndarray::Array2;

use crate::{
    SceneGeometry,
    hidden::{EdgeRule, Fill, reach_of_edges},
    layers::{DEPTH_EDGE_PX, Layers},
    surface::LayerCoordinates,
    work::plane_of,
};

/// Where the second samples come from, and their layer coordinates (NaN where there is none).
pub(crate) enum OccludedSamples {
    Nothing,
    Estimated {
        fill: Box<Fill>,
        layer_coordinates: LayerCoordinates,
    },
    /// Given, and estimated where nothing is known.
    Known {
        guesses: Option<Box<Guesses>>,
        layer_coordinates: LayerCoordinates,
    },
}

/// Second samples that are estimated beside those that are given.
pub(crate) struct Guesses {
    fill: Fill,
    /// Row and column of each.
    places: Vec<(u32, u32)>,
}

/// A change of blur radius between neighbors from which on an edge shows what is known to lie behind it, half that far at least, pixels: far less than what a
/// guess takes for an edge, since what is known does no harm beside a slope.
const KNOWN_EDGE_PX: f32 = 0.5;

/// Where the samples of a scene lie, in pixels of blur radius behind the nearest.
pub(crate) struct Distances {
    pub(crate) front: Array2<f32>,
    /// Those of a second layer, where one is given.
    pub(crate) behind: Option<Array2<f32>>,
}

impl Distances {
    /// Returns those of a scene among layers.
    pub(crate) fn of(scene: &SceneGeometry<'_>, layers: &Layers, cancel: &Cancel) -> Result<Self, Cancelled> {
        let distances = |depth: &DepthMap| {
            let z_m = depth.z_m();
            plane_of(z_m.dim(), cancel, |row, column| layers.distance_px(z_m[(row, column)]))
        };
        Ok(Self { front: distances(scene.depth)?, behind: scene.occluded_depth.map(distances).transpose()? })
    }

    /// Whether it is known what lies behind a sample.
    pub(crate) fn is_known_behind(&self, at: (usize, usize)) -> bool {
        self.behind.as_ref().is_some_and(|behind| behind[at] > self.front[at] + 0.5 * KNOWN_EDGE_PX)
    }
}

impl OccludedSamples {
    /// Finds where blurred edges show what lies behind them.
    pub(crate) fn find(
        distances: &Distances,
        layers: &Layers,
        scene_per_film: f64,
        cancel: &Cancel,
    ) -> Result<Self, Cancelled> {
        // A pixel looks past an edge as far within as the near side is blurred. On the other side of the focus rays go on inwards: they see as far as both blurs together.
        let radius_px = |distance: f32| layers.radius_px_at(layers.coordinate_of_distance(distance)) as f32;
        let reach = |near: f32, far: f32| radius_px(near).max(radius_px(far)).max(far - near) * scene_per_film as f32;
        let rule = EdgeRule { jump: DEPTH_EDGE_PX, reach: &reach };
        let Distances { front, behind } = distances;
        let size = front.dim();
        if let Some(known) = behind {
            let known_rule = EdgeRule { jump: KNOWN_EDGE_PX, reach: rule.reach };
            let reach = reach_of_edges(front, &known_rule, cancel)?;
            let fill = Fill::find(front, &rule, cancel)?;
            let is_guessed = |row: usize, column: usize| {
                !distances.is_known_behind((row, column)) && !fill.distances[(row, column)].is_nan()
            };
            let place = |row: usize, column: usize| {
                if is_guessed(row, column) {
                    return layers.coordinate_of_distance(fill.distances[(row, column)]);
                }
                let distance = known[(row, column)];
                let shows = reach[row * size.1 + column] > 0.0 && distances.is_known_behind((row, column));
                if shows { layers.coordinate_of_distance(distance) } else { f32::NAN }
            };
            let layer_coordinates = LayerCoordinates::new(plane_of(size, cancel, place)?, cancel)?;
            let all = (0..size.0).flat_map(|row| (0..size.1).map(move |column| (row, column)));
            let places: Vec<(u32, u32)> =
                all.filter(|&(r, c)| is_guessed(r, c)).map(|(r, c)| (r as u32, c as u32)).collect();
            let guesses = if places.is_empty() { None } else { Some(Box::new(Guesses { fill, places })) };
            return Ok(Self::Known { guesses, layer_coordinates });
        }
        let fill = Fill::find(front, &rule, cancel)?;
        if fill.is_empty() {
            return Ok(Self::Nothing);
        }
        let place = |row: usize, column: usize| {
            let distance = fill.distances[(row, column)];
            if distance.is_nan() { f32::NAN } else { layers.coordinate_of_distance(distance) }
        };
        let layer_coordinates = LayerCoordinates::new(plane_of(size, cancel, place)?, cancel)?;
        Ok(Self::Estimated { fill: Box::new(fill), layer_coordinates })
    }

    /// The layer coordinates of the second samples among the layers.
    pub(crate) fn layer_coordinates(&self) -> Option<&LayerCoordinates> {
        match self {
            Self::Nothing => None,
            Self::Estimated { layer_coordinates, .. } | Self::Known { layer_coordinates, .. } => {
                Some(layer_coordinates)
            }
        }
    }

    /// Whether the light of the second samples is given, not estimated.
    pub(crate) fn needs_radiance(&self) -> bool {
        matches!(self, Self::Known { .. })
    }

    /// The bytes of memory beside the layer coordinates.
    pub(crate) fn size_bytes(&self) -> usize {
        match self {
            Self::Estimated { fill, .. } => fill.size_bytes(),
            Self::Known { guesses: Some(guesses), .. } => {
                guesses.fill.size_bytes() + size_of_val(guesses.places.as_slice())
            }
            Self::Nothing | Self::Known { guesses: None, .. } => 0,
        }
    }

    /// Returns the light of the second samples of a band, `front` being that of the first and `given` what is known of them.
    pub(crate) fn samples<'a>(
        &self,
        front: &Array2<f32>,
        given: Option<&'a Array2<f32>>,
        cancel: &Cancel,
    ) -> Result<Option<Cow<'a, Array2<f32>>>, Cancelled> {
        Ok(match self {
            Self::Nothing => None,
            Self::Estimated { fill, .. } => Some(Cow::Owned(fill.samples(front, cancel)?)),
            Self::Known { guesses: None, .. } => given.map(Cow::Borrowed),
            Self::Known { guesses: Some(guesses), .. } => {
                let Some(mut samples) = given.cloned() else { return Ok(None) };
                let filled = guesses.fill.samples(front, cancel)?;
                for &(row, column) in &guesses.places {
                    let place = (row as usize, column as usize);
                    samples[place] = filled[place];
                }
                Some(Cow::Owned(samples))
            }
        })
    }
}
