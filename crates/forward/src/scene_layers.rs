//! The depths of a scene in layers, and what their edges hide: the same for all parts of a pupil.

use std::{collections::BTreeSet, sync::Arc};

use dioptric_psf::LensImage;
use dioptric_spectrum::Cancel;
use glam::DVec2;

use crate::{
    BlurMode, Film, ForwardError, ImagingSpec, SceneGeometry,
    halo::Halos,
    layers::{Blurs, DEPTH_EDGE_PX, Layers},
    mixed::MixedSamples,
    narrow::NarrowRule,
    occluded::{Distances, OccludedSamples},
    surface::LayerCoordinates,
    work::plane_of,
};

/// The step of blur radius between bands in which kernels of points are computed, over that of others: a quarter of it leaves a sixteenth of the error in a peak.
const OF_POINTS: f64 = 0.25;

/// A scene laid in layers of depth by the blur of a lens.
pub(crate) struct SceneLayers {
    pub(crate) layers: Layers,
    /// The bands at which kernels are computed; between them they are interpolated.
    pub(crate) kernel_bands: Vec<usize>,
    /// Likewise of points that shine, which no texture hides: closer together.
    pub(crate) point_bands: Vec<usize>,
    /// Of the first surface.
    pub(crate) coordinates: LayerCoordinates,
    pub(crate) occluded: OccludedSamples,
    /// Samples that show both sides of an edge of depth.
    pub(crate) mixed: MixedSamples,
    /// The fraction of samples on surfaces narrower than the pupil.
    pub(crate) narrow_fraction: f64,
    /// Whether layers hide those behind them.
    pub(crate) hides: bool,
    /// Edges of the whole pupil bend light, not those between its parts.
    pub(crate) halos: Halos,
}

impl SceneLayers {
    /// Lays a scene in layers of the blur of a lens.
    pub(crate) fn over(
        lens: &dyn LensImage,
        scene: &SceneGeometry<'_>,
        spec: &ImagingSpec,
        cancel: &Cancel,
    ) -> Result<Arc<Self>, ForwardError> {
        let ImagingSpec { film, grid, settings } = spec;
        film.check()?;
        settings.check()?;
        scene.check()?;
        // What is asked of the lens is asked of one survey of its film.
        let map = lens.film_map(grid.centers_nm()[grid.len() / 2], film.half_diagonal_mm());
        let (near_m, far_m) = scene.depth.range_m();
        let (pitch_mm, places_mm) = (1e-3 * film.pitch_um, places_over(lens, film));
        let blurs = Blurs { lens, pitch_mm, places_mm: &places_mm, wavelengths_nm: grid.centers_nm() };
        let layers = Layers::over((1.0 / far_m, 1.0 / near_m), settings.layer_step_px, &blurs);
        let [kernel_bands, point_bands] =
            [1.0, OF_POINTS].map(|part| layers.chromatic_knots(part * settings.chromatic_step_px, &blurs));
        let of_points = scene.points.iter().map(|point| 1.0 / point.depth_m);
        let depths_dioptres: Vec<f64> = layers.dioptres().iter().copied().chain(of_points).collect();
        let looked_up = few_of(&kernel_bands).map(|band| (band, grid.centers_nm()[band]));
        let on_film = (film, settings.widest_blur_px);
        let halos = Halos::of(lens, &depths_dioptres, on_film, &looked_up.collect::<Vec<_>>());
        let z_m = scene.depth.z_m();
        let coordinate = |row: usize, column: usize| layers.coordinate_of(z_m[(row, column)]);
        let coordinates = LayerCoordinates::new(plane_of(z_m.dim(), cancel, coordinate)?, cancel)?;
        let hides = settings.mode != BlurMode::Pointwise && layers.len() > 1;
        if !hides {
            let (occluded, mixed) = (OccludedSamples::Nothing, MixedSamples::default());
            let narrow_fraction = 0.0;
            let this =
                Self { layers, kernel_bands, point_bands, coordinates, occluded, mixed, narrow_fraction, hides, halos };
            return Ok(Arc::new(this));
        }
        // How fine the scene is in the film's middle.
        let tan = |x_mm: f64| map.field_tan(DVec2::X * x_mm).unwrap_or_default();
        let samples_per_pixel = scene.view.focal_px * (tan(0.5 * pitch_mm) - tan(-0.5 * pitch_mm)).length();
        let distances = Distances::of(scene, &layers, cancel)?;
        let narrow = NarrowRule { jump: DEPTH_EDGE_PX, scene_per_film: samples_per_pixel as f32 };
        let occluded = OccludedSamples::find(&distances, &layers, samples_per_pixel, cancel)?;
        let mixed = MixedSamples::find(&distances, &layers, cancel)?;
        let narrow_fraction = narrow.fraction(&distances.front, cancel)?;
        let this =
            Self { layers, kernel_bands, point_bands, coordinates, occluded, mixed, narrow_fraction, hides, halos };
        Ok(Arc::new(this))
    }

    /// Rows and columns of the scene.
    pub(crate) fn size(&self) -> (usize, usize) {
        self.coordinates.size()
    }

    pub(crate) fn size_bytes(&self) -> usize {
        self.coordinates.size_bytes()
            + self.occluded.layer_coordinates().map_or(0, LayerCoordinates::size_bytes)
            + self.occluded.size_bytes()
            + self.mixed.size_bytes()
            + self.halos.size_bytes()
    }
}

/// Returns the first, the middle and the last of some bands.
fn few_of(bands: &[usize]) -> impl Iterator<Item = usize> {
    BTreeSet::from([0, bands.len() / 2, bands.len() - 1].map(|number| bands[number])).into_iter()
}

/// Returns a few points of the film, of which the blur tells that of all: from the axis outwards, or all over it.
fn places_over(lens: &dyn LensImage, film: &Film) -> Vec<DVec2> {
    if lens.is_symmetric() {
        return [0.0, 0.5, 1.0].map(|part| DVec2::X * part * film.half_diagonal_mm()).to_vec();
    }
    let parts = [-1.0, 0.0, 1.0];
    let places = parts.iter().flat_map(|&up| parts.iter().map(move |&across| DVec2::new(across, up)));
    places.map(|place| place * film.half_size_mm()).collect()
}
