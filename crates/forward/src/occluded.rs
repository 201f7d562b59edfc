//! The second samples of a scene: what lies behind near surfaces, close to their edges.

use dioptric_spectrum::{Cancel, Cancelled, DepthMap};

use crate::{
    BlurMode, SceneGeometry, Settings,
    hidden::{EdgeRule, Fill, reach_of_edges},
    layers::Layers,
    sampler::LayerCoordinates,
    work::plane_of,
};

/// Where the second samples come from, and their layer coordinates (NaN where there is none).
pub(crate) enum OccludedSamples {
    Nothing,
    Estimated { fill: Box<Fill>, layer_coordinates: LayerCoordinates },
    Known(LayerCoordinates),
}

impl OccludedSamples {
    /// Finds where blurred edges show what lies behind them.
    pub(crate) fn find(
        scene: &SceneGeometry<'_>,
        layers: &Layers,
        settings: &Settings,
        scene_per_film: f64,
        cancel: &Cancel,
    ) -> Result<Self, Cancelled> {
        if layers.len() == 1 || settings.mode == BlurMode::Pointwise {
            return Ok(Self::Nothing);
        }
        let reach =
            |distance: f32| layers.radius_px_at(layers.coordinate_of_distance(distance)) as f32 * scene_per_film as f32;
        let rule = EdgeRule { jump: settings.depth_edge_px as f32, reach: &reach };
        let size = scene.size();
        let distances = |depth: &DepthMap| {
            let z_m = depth.z_m();
            plane_of(size, cancel, |row, column| layers.distance_px(z_m[(row, column)]))
        };
        let front = distances(scene.depth)?;
        if let Some(depth) = scene.occluded_depth {
            let (known, reach) = (distances(depth)?, reach_of_edges(&front, &rule, cancel)?);
            let place = |row: usize, column: usize| {
                let distance = known[(row, column)];
                let shows = reach[row * size.1 + column] > 0.0 && distance > front[(row, column)] + 0.5 * rule.jump;
                if shows { layers.coordinate_of_distance(distance) } else { f32::NAN }
            };
            return Ok(Self::Known(LayerCoordinates::new(plane_of(size, cancel, place)?, cancel)?));
        }
        let fill = Fill::find(&front, &rule, cancel)?;
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
            Self::Estimated { layer_coordinates, .. } | Self::Known(layer_coordinates) => Some(layer_coordinates),
        }
    }

    /// Whether the light of the second samples is given, not estimated.
    pub(crate) fn needs_radiance(&self) -> bool {
        matches!(self, Self::Known(_))
    }

    /// The bytes of memory beside the layer coordinates.
    pub(crate) fn size_bytes(&self) -> usize {
        match self {
            Self::Estimated { fill, .. } => fill.size_bytes(),
            Self::Nothing | Self::Known(_) => 0,
        }
    }
}
