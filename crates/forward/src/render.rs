//! The whole way from a scene to the irradiance on the film, band by band.

use dioptric_psf::{FilmMap, LensImage};
use std::{
    borrow::Cow,
    sync::atomic::{AtomicUsize, Ordering},
};

use dioptric_scene::View;
use dioptric_spectrum::{Bands, DepthMap, Quantity, SpectrumError};
use glam::DVec2;
use ndarray::Array2;
use rayon::prelude::*;

use crate::{
    BlurMode, Film, ForwardError, Settings, SinkError,
    blur::{LayerTask, blur_layer},
    geometry::{FilmFrame, check_reach},
    hidden::{EdgeRule, Fill, reach_of_edges},
    layers::{Blurs, Layers},
    occlusion::{BlurredLayer, Composite},
    sampler::{Sampler, Surface},
    tiles::{Cell, LayerKernels, Tiling, cells_over},
};

/// What is to be imaged: radiance, depth and geometry of its samples.
#[derive(Clone, Copy)]
pub struct Source<'a> {
    /// Spectral radiance.
    pub radiance: &'a dyn Bands,
    /// Axial depth of each sample.
    pub depth: &'a DepthMap,
    /// Directions of the samples.
    pub view: View,
    /// What lies behind the first surface, where that is known; elsewhere it is guessed.
    pub behind: Option<Behind<'a>>,
}

/// What would be seen if the first surface of a scene were taken away.
#[derive(Clone, Copy)]
pub struct Behind<'a> {
    /// Spectral radiance, on the bands and samples of the first surface.
    pub radiance: &'a dyn Bands,
    /// Axial depth; no deeper than the first surface where nothing lies behind it.
    pub depth: &'a DepthMap,
}

/// Takes the bands of a picture, one after the other, shortest wavelength first.
pub type Sink<'a> = dyn FnMut(usize, Array2<f32>) -> Result<(), SinkError> + 'a;

/// Images a source through a lens: hands the irradiance on the film, W m⁻² nm⁻¹, to `sink` band by band.
///
/// `progress` is told the part that is done, from 0 to 1. A few bands are worked on at once; the result does not
/// depend on the number of threads.
///
/// # Errors
/// When the parts of the source do not fit each other, when the lens is not known for its wavelengths or depths or
/// for the corner of the film, or when a band cannot be read or handed on.
pub fn render(
    source: &Source<'_>,
    kernels: &dyn LensImage,
    film: &Film,
    settings: &Settings,
    progress: &(dyn Fn(f64) + Sync),
    sink: &mut Sink<'_>,
) -> Result<(), ForwardError> {
    film.check()?;
    settings.check()?;
    check_source(source)?;
    let (near_m, far_m) = source.depth.range_m();
    let dioptres = (1.0 / far_m, 1.0 / near_m);
    check_reach(kernels, source.radiance.grid(), dioptres, film)?;
    progress(0.0);
    let plan = Plan::new(source, dioptres, kernels, film, settings);
    plan.render(source, progress, sink)
}

fn check_source(source: &Source<'_>) -> Result<(), ForwardError> {
    let (rows, columns) = source.radiance.size();
    let fits = |what, (found_rows, found_columns): (usize, usize)| {
        if (found_rows, found_columns) == (rows, columns) {
            return Ok(());
        }
        Err(ForwardError::Size { what, found_rows, found_columns, rows, columns })
    };
    fits("the depth map", source.depth.z_m().dim())?;
    if source.radiance.quantity() != Quantity::Radiance {
        return Err(ForwardError::NotRadiance { unit: source.radiance.quantity().unit() });
    }
    if let Some(behind) = &source.behind {
        fits("the hidden layer", behind.radiance.size())?;
        fits("the depth of the hidden layer", behind.depth.z_m().dim())?;
        let (expected, found) = (source.radiance.grid().len(), behind.radiance.grid().len());
        if expected != found {
            return Err(SpectrumError::Shape { what: "bands of the hidden layer", expected, found }.into());
        }
    }
    Ok(())
}

/// What is the same for all bands.
struct Plan<'a> {
    kernels: &'a dyn LensImage,
    film: &'a Film,
    settings: &'a Settings,
    wavelengths_nm: Vec<f64>,
    /// The bands at which PSFs are computed; between them they are interpolated.
    kernel_bands: Vec<usize>,
    layers: Layers,
    sampler: Sampler,
    tiling: Tiling,
    places: Array2<f32>,
    hidden: Hidden,
    /// How far off axis light is taken from, mm.
    reach_mm: f64,
}

/// Where the second samples come from.
enum Hidden {
    Nothing,
    Guessed { fill: Box<Fill>, places: Array2<f32> },
    Known(Array2<f32>),
}

impl Hidden {
    fn places(&self) -> Option<&Array2<f32>> {
        match self {
            Self::Nothing => None,
            Self::Guessed { places, .. } | Self::Known(places) => Some(places),
        }
    }
}

impl<'a> Plan<'a> {
    fn new(
        source: &Source<'_>,
        dioptres: (f64, f64),
        kernels: &'a dyn LensImage,
        film: &'a Film,
        settings: &'a Settings,
    ) -> Self {
        let wavelengths_nm = source.radiance.grid().centers_nm().to_vec();
        let middle_nm = wavelengths_nm[wavelengths_nm.len() / 2];
        let corner_mm = film.half_diagonal_mm();
        let fields = blur_fields(kernels, &kernels.film_map(dioptres.0, middle_nm, corner_mm), film);
        let blurs = Blurs { kernels, pitch_mm: 1e-3 * film.pitch_um, fields: &fields, wavelengths_nm: &wavelengths_nm };
        let layers = Layers::over(dioptres, settings.layer_step_px, &blurs);
        let kernel_bands = layers.chromatic_knots(settings.chromatic_step_px, &blurs);
        let places = source.depth.z_m().mapv(|z| layers.place_of(z));
        // The 95 % radius of a blur, doubled, holds all but the faintest of its light.
        let pad_px = (0..layers.len()).map(|l| layers.radius_px_at(l as f32)).fold(0.0, f64::max) * 2.0 + 8.0;
        let cell_size = settings.knot_spacing_px;
        let reach_mm = corner_mm + 1e-3 * film.pitch_um * std::f64::consts::SQRT_2 * (pad_px + cell_size as f64);
        let maps_at = |wavelength_nm: f64| -> Vec<FilmMap> {
            layers.dioptres().iter().map(|&d| kernels.film_map(d, wavelength_nm, reach_mm)).collect()
        };
        let maps = maps_at(middle_nm);
        let sampler = Sampler::new(source.view, FilmFrame::new(film), &maps[0]);
        let hidden = hidden_samples(source, &layers, settings, &sampler);
        let ends: Vec<FilmMap> = [wavelengths_nm[0], wavelengths_nm[wavelengths_nm.len() - 1], middle_nm]
            .into_iter()
            .flat_map(|w| [0, layers.len() - 1].map(|l| kernels.film_map(layers.dioptres()[l], w, reach_mm)))
            .collect();
        let surfaces: Vec<&Array2<f32>> = std::iter::once(&places).chain(hidden.places()).collect();
        let active = active_cells(
            &cells_over(film, pad_px.ceil() as usize, cell_size),
            &sampler,
            &ends,
            &surfaces,
            layers.len(),
        );
        let tiling = Tiling::new(active, &maps, &layers, film, middle_nm, kernels, settings);
        Self {
            kernels,
            film,
            settings,
            kernel_bands,
            wavelengths_nm,
            layers,
            sampler,
            tiling,
            places,
            hidden,
            reach_mm,
        }
    }

    fn render(
        &self,
        source: &Source<'_>,
        progress: &(dyn Fn(f64) + Sync),
        sink: &mut Sink<'_>,
    ) -> Result<(), ForwardError> {
        let n_bands = self.wavelengths_nm.len();
        let done = AtomicUsize::new(0);
        let mut lower = self.kernels_at(0);
        for pair in self.kernel_bands.windows(2) {
            let upper = self.kernels_at(pair[1]);
            let bands: Vec<usize> = (pair[0]..pair[1]).collect();
            for group in bands.chunks(rayon::current_num_threads().clamp(1, 4)) {
                let pictures: Vec<Result<Array2<f32>, ForwardError>> = group
                    .par_iter()
                    .map(|&band| {
                        let fraction = (band - pair[0]) as f32 / (pair[1] - pair[0]) as f32;
                        let picture = self.render_band(source, band, &mixed(&lower, &upper, fraction));
                        let n_done = done.fetch_add(1, Ordering::Relaxed) + 1;
                        progress(n_done as f64 / n_bands as f64);
                        picture
                    })
                    .collect();
                for (&band, picture) in group.iter().zip(pictures) {
                    sink(band, picture?).map_err(|reason| ForwardError::Sink { band, reason })?;
                }
            }
            lower = upper;
        }
        let last = n_bands - 1;
        let picture = self.render_band(source, last, &lower)?;
        progress(1.0);
        sink(last, picture).map_err(|reason| ForwardError::Sink { band: last, reason })
    }

    fn maps_at(&self, band: usize) -> Vec<FilmMap> {
        let wavelength_nm = self.wavelengths_nm[band];
        let map = |&dioptres: &f64| self.kernels.film_map(dioptres, wavelength_nm, self.reach_mm);
        self.layers.dioptres().iter().map(map).collect()
    }

    fn kernels_at(&self, band: usize) -> Vec<LayerKernels> {
        let maps = self.maps_at(band);
        self.tiling.kernels_at(&maps, &self.layers, self.film, self.wavelengths_nm[band], self.kernels)
    }

    fn render_band(
        &self,
        source: &Source<'_>,
        band: usize,
        kernels: &[LayerKernels],
    ) -> Result<Array2<f32>, ForwardError> {
        let maps = self.maps_at(band);
        let front = source.radiance.band(band)?;
        let behind: Option<Cow<'_, Array2<f32>>> = match (&self.hidden, &source.behind) {
            (Hidden::Guessed { fill, .. }, _) => Some(Cow::Owned(fill.samples(&front))),
            (Hidden::Known(_), Some(behind)) => Some(behind.radiance.band(band)?),
            _ => None,
        };
        let mut surfaces = vec![Surface { radiance: &front, places: &self.places }];
        if let (Some(radiance), Some(places)) = (&behind, self.hidden.places()) {
            surfaces.push(Surface { radiance, places });
        }
        let Film { rows, columns, .. } = *self.film;
        let hides = self.settings.mode == BlurMode::Layered && self.layers.len() > 1;
        let (mut picture, mut blurred) = (Composite::new(rows, columns), BlurredLayer::new(rows, columns));
        for (layer, cells) in self.tiling.cells.iter().enumerate() {
            let task = LayerTask {
                sampler: &self.sampler,
                map: &maps[layer],
                layer,
                surfaces: &surfaces,
                cells,
                kernels: &kernels[layer],
                film_rows: rows,
                film_columns: columns,
                with_cover: hides,
            };
            blur_layer(&task, &mut blurred);
            if hides {
                picture.lay_behind(&mut blurred);
            } else {
                picture.add(&mut blurred);
            }
        }
        Ok(if hides { picture.finish() } else { picture.finish_sum() })
    }
}

/// Returns a few fields over the film, of which the blur tells that of all: from the axis outwards, or all over it.
fn blur_fields(kernels: &dyn LensImage, map: &FilmMap, film: &Film) -> Vec<DVec2> {
    if kernels.is_symmetric() {
        let corner = map.field_tan(DVec2::X * film.half_diagonal_mm());
        return [0.0, 0.5, 1.0].map(|part| part * corner).to_vec();
    }
    let half_mm = 0.5e-3 * film.pitch_um * DVec2::new(film.columns as f64, film.rows as f64);
    let parts = [-1.0, 0.0, 1.0];
    let places = parts.iter().flat_map(|&up| parts.iter().map(move |&across| DVec2::new(across, up)));
    places.map(|place| map.field_tan(place * half_mm)).collect()
}

/// Returns the kernels of all layers between two bands.
fn mixed(lower: &[LayerKernels], upper: &[LayerKernels], fraction: f32) -> Vec<LayerKernels> {
    lower.iter().zip(upper).map(|(lower, upper)| lower.mixed(upper, fraction)).collect()
}

/// Returns the places of what lies behind near surfaces, close to their edges.
fn hidden_samples(source: &Source<'_>, layers: &Layers, settings: &Settings, sampler: &Sampler) -> Hidden {
    if layers.len() == 1 || settings.mode == BlurMode::Pointwise {
        return Hidden::Nothing;
    }
    let scene_per_film = sampler.scene_per_film as f32;
    let reach = |distance: f32| layers.radius_px_at(layers.place_of_distance(distance)) as f32 * scene_per_film;
    let rule = EdgeRule { jump: settings.depth_edge_px as f32, reach: &reach };
    let distances = |depth: &DepthMap| depth.z_m().mapv(|z| layers.distance_px(z));
    let front = distances(source.depth);
    if let Some(behind) = &source.behind {
        let mut known = distances(behind.depth);
        for ((hidden, &front), reach) in known.iter_mut().zip(&front).zip(reach_of_edges(&front, &rule)) {
            let shows = reach > 0.0 && *hidden > front + 0.5 * rule.jump;
            *hidden = if shows { layers.place_of_distance(*hidden) } else { f32::NAN };
        }
        return Hidden::Known(known);
    }
    let fill = Fill::find(&front, &rule);
    if fill.is_empty() {
        return Hidden::Nothing;
    }
    let places = fill.distances.mapv(|d| if d.is_nan() { f32::NAN } else { layers.place_of_distance(d) });
    Hidden::Guessed { fill: Box::new(fill), places }
}

/// Returns, for each layer, the cells in which the scene has anything at its depth.
fn active_cells(
    cells: &[Cell],
    sampler: &Sampler,
    maps: &[FilmMap],
    surfaces: &[&Array2<f32>],
    n_layers: usize,
) -> Vec<Vec<Cell>> {
    let found: Vec<Vec<bool>> =
        cells.par_iter().map(|cell| layers_in(cell, sampler, maps, surfaces, n_layers)).collect();
    (0..n_layers)
        .map(|layer| cells.iter().zip(&found).filter(|(_, found)| found[layer]).map(|(&c, _)| c).collect())
        .collect()
}

fn layers_in(
    cell: &Cell,
    sampler: &Sampler,
    maps: &[FilmMap],
    surfaces: &[&Array2<f32>],
    n_layers: usize,
) -> Vec<bool> {
    const STEPS: usize = 4;
    let (rows, columns) = surfaces[0].dim();
    let (mut top, mut bottom, mut left, mut right) = (f64::MAX, f64::MIN, f64::MAX, f64::MIN);
    let (first_row, first_column) = cell.first_pixel(&sampler.frame);
    let side = cell.size as f64;
    let along = |first: i64, k: usize| first as f64 - 0.5 + side * k as f64 / STEPS as f64;
    for (map, k) in maps.iter().flat_map(|map| (0..(STEPS + 1) * (STEPS + 1)).map(move |k| (map, k))) {
        let place_mm = sampler.frame.place_mm(along(first_row, k / (STEPS + 1)), along(first_column, k % (STEPS + 1)));
        let tan = map.field_tan(place_mm);
        let (row, column) = sampler.view.position_of(tan.x, tan.y);
        (top, bottom) = (top.min(row), bottom.max(row));
        (left, right) = (left.min(column), right.max(column));
    }
    // Beyond the edge the scene goes on in the dark at the depth of the edge; two samples of slack for curved maps.
    let clamp = |low: f64, high: f64, n: usize| {
        let last = (n - 1) as f64;
        (low.floor() - 2.0).clamp(0.0, last) as usize..=(high.ceil() + 2.0).clamp(0.0, last) as usize
    };
    let mut found = vec![false; n_layers];
    for row in clamp(top, bottom, rows) {
        for column in clamp(left, right, columns) {
            for surface in surfaces {
                let place = surface[(row, column)];
                if !place.is_nan() {
                    let below = place as usize;
                    found[below] = true;
                    found[(below + usize::from(place.fract() > 0.0)).min(n_layers - 1)] = true;
                }
            }
        }
    }
    found
}
