//! The tables by which a picture is freed of the aberrations of its lens, from the model of the lens's image.

use std::{ops::Range, sync::Arc};

use dioptric_forward::Film;
use dioptric_optics::glam::{DMat2, DVec2};
use dioptric_psf::{Diffraction, FilmMap, ImageSettings, LensImage, LensImageModel};
use dioptric_sensor::{AngularResponse, FrameTable, LensTables, Sensor};
use dioptric_spectrum::{Illuminant, Observer, WavelengthGrid};
use rayon::prelude::*;
use serde::Serialize;

use super::{Watch, electrons, film::FilmPlace, lens::ResolvedLens};
use crate::PipelineError;

/// Nodes of the tables each way. Cubics between 41 nodes follow 10 % of distortion over 4,000 pixels to .01 pixel.
const NODES: usize = 41;
/// The most by which a place is brightened: what is darker than this part of the brightest place stays dark.
const MOST_GAIN: f64 = 32.0;
/// The most by which a picture is enlarged so that nothing beyond the frame is seen in it.
const MOST_SCALE: f64 = 2.0;

/// The corrections of a lens as tables, and how much they do.
#[derive(Clone, Debug, PartialEq)]
pub struct LensAberrations {
    /// The tables, for the frame that is simulated.
    pub tables: LensTables,
    /// How much they do.
    pub summary: AberrationSummary,
}

/// How much the corrections of a lens do.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AberrationSummary {
    /// The depth that they hold for, m: the plane in focus, or the end of the scene that comes nearest to it.
    pub depth_m: f64,
    /// How many times a picture without distortion is enlarged, so that nothing beyond the film is seen in it.
    pub scale: f64,
    /// The farthest that the light of a picture without distortion lies from its place in the frame, pixels.
    pub largest_distortion_px: f64,
    /// The largest distance between two channels of the same light in the frame, pixels.
    pub largest_lateral_color_px: f64,
    /// The largest factor that makes an even surface even.
    pub largest_gain: f64,
    /// The share of a picture without distortion that lies beyond the frame, where it is black: parts of a film have such borders.
    pub beyond_fraction: f64,
}

/// What the tables are made from.
pub(super) struct TableParts<'a> {
    pub(super) lens: &'a ResolvedLens,
    pub(super) place: &'a FilmPlace,
    pub(super) sensor: &'a Sensor,
    pub(super) light: Option<&'a Illuminant>,
    pub(super) grid: &'a WavelengthGrid,
    pub(super) depth_range_m: (f64, f64),
}

impl TableParts<'_> {
    /// Traces the lens at the depth in focus and tabulates what it does to the frame.
    pub(super) fn aberrations(&self, watch: &Watch<'_>) -> Result<LensAberrations, PipelineError> {
        let whole = self.whole_film();
        let depth_m = self.depth_m();
        let settings = ImageSettings::new(self.place.film_distance_mm, Diffraction::None);
        let model = LensImageModel::new(&self.lens.lens, self.grid.centers_nm(), &settings)?;
        let reach_mm = 1.1 * whole.half_diagonal_mm();
        let map = |&nm: &f64| model.film_map(nm, reach_mm);
        let bands: Vec<Arc<FilmMap>> = self.grid.centers_nm().par_iter().map(map).collect();
        watch.cancel.check()?;
        let channels = ChannelImages { bands: &bands, weights: self.channel_weights() };
        let geometry = Geometry::of(channels, self.reference_channel(), whole, self.place)?;
        let aberrations = geometry.tabulate(self, depth_m)?;
        watch.cancel.check()?;
        Ok(aberrations)
    }

    fn whole_film(&self) -> Film {
        let (rows, columns) = match self.place.part {
            Some(part) => (part.of_rows, part.of_columns),
            None => (self.place.rows, self.place.columns),
        };
        Film::centered(rows, columns, self.place.pitch_um)
    }

    /// Returns the depth in focus, m from the entrance pupil, held to the depths of the scene; their middle in dioptres where nothing
    /// is in focus.
    fn depth_m(&self) -> f64 {
        let (near_m, far_m) = self.depth_range_m;
        let middle_m = 2.0 / (1.0 / near_m + 1.0 / far_m);
        let focus_m = self.place.focus_distance_mm.map(|mm| 1e-3 * (mm + self.lens.reference.projection_center_z_mm()));
        focus_m.filter(|m| *m > 0.0).map_or(middle_m, |m| m.clamp(near_m, far_m))
    }

    /// Returns the share of each band in the signal of each channel under the light; of an even one where that is not known.
    fn channel_weights(&self) -> Vec<Vec<f64>> {
        let light = self.light.unwrap_or(&Illuminant::E).on_bands(self.grid);
        let shares = |weights: Vec<f64>| {
            let signal: Vec<f64> = weights.iter().zip(&light).map(|(w, s)| w * s).collect();
            let sum: f64 = signal.iter().sum();
            // A channel that sees none of this light is taken to see it evenly.
            let even = 1.0 / signal.len() as f64;
            signal.iter().map(|s| if sum > 0.0 { s / sum } else { even }).collect()
        };
        self.sensor.electron_weights(self.grid).into_iter().map(shares).collect()
    }

    /// Returns the channel that sees most as the eye does: the others are laid over it.
    fn reference_channel(&self) -> usize {
        let luminance = |shares: &Vec<f64>| Observer::Cie1931.xyz(self.grid, shares).0[1];
        let weights = self.channel_weights();
        let best = weights.iter().map(luminance).enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
        best.map_or(0, |(channel, _)| channel)
    }

    /// Returns the sensitivity of pixels to the light of a place of the frame, mm to the right and up of its middle.
    fn angular_factor(&self, response: &AngularResponse<'_>, at_mm: DVec2) -> f64 {
        // Pixels of a binned film stand for places farther apart, as the pupil's distance does.
        let at_mm = at_mm / self.place.binning as f64;
        response.factor_at_mm([at_mm.x, -at_mm.y])
    }
}

/// Where channels have fields, and how bright.
struct ChannelImages<'a> {
    /// The maps of the bands.
    bands: &'a [Arc<FilmMap>],
    /// For each channel the share of each band.
    weights: Vec<Vec<f64>>,
}

impl ChannelImages<'_> {
    /// Returns the mean place of a field in a channel, mm in the picture frame; `None` where no band has it.
    fn place_mm(&self, channel: usize, field_tan: DVec2) -> Option<DVec2> {
        let bands = self.bands.iter().zip(&self.weights[channel]).filter(|(_, share)| **share > 0.0);
        let (mut sum, mut weight) = (DVec2::ZERO, 0.0);
        for (map, share) in bands {
            if let Some(at_mm) = map.place_mm(field_tan).filter(|at_mm| map.irradiance_sr(*at_mm) > 0.0) {
                (sum, weight) = (sum + *share * at_mm, weight + share);
            }
        }
        (weight > 0.0).then(|| sum / weight)
    }

    /// Returns the mean field that a channel sees at a place; NaN where none is.
    fn field_tan(&self, channel: usize, place_mm: DVec2) -> DVec2 {
        let bands = self.bands.iter().zip(&self.weights[channel]).filter(|(_, share)| **share > 0.0);
        bands.map(|(map, share)| *share * map.field_tan(place_mm).unwrap_or(DVec2::NAN)).sum()
    }

    /// Returns the mean irradiance of a channel over radiance, sr; 0 where nothing is seen.
    fn irradiance_per_radiance(&self, channel: usize, place_mm: DVec2) -> f64 {
        let bands = self.bands.iter().zip(&self.weights[channel]);
        bands.map(|(map, share)| share * map.irradiance_sr(place_mm)).sum()
    }
}

/// The frame behind the lens, and the perspective that the lens would have without distortion.
struct Geometry<'a> {
    channels: ChannelImages<'a>,
    reference: usize,
    whole: Film,
    /// The frame that is simulated.
    frame: Film,
    /// A field and where it lies with and without distortion.
    axis_tan: DVec2,
    axis_mm: DVec2,
    /// Millimetres a tangent about it.
    mm_per_tan: DMat2,
}

impl<'a> Geometry<'a> {
    /// Returns the geometry whose scale is that of the lens about its axis; of a lens without one, about the middle of the film.
    fn of(
        channels: ChannelImages<'a>,
        reference: usize,
        whole: Film,
        place: &FilmPlace,
    ) -> Result<Self, PipelineError> {
        let center_mm = channels.bands[channels.bands.len() / 2].axis_mm().unwrap_or(DVec2::ZERO);
        let dark = || PipelineError::Unsuitable {
            what: "lens_corrections",
            reason: "the lens shows nothing about its axis or the middle of the film, from where its scale is taken"
                .to_owned(),
        };
        let axis_tan = channels.field_tan(reference, center_mm);
        let by_mm = 0.02 * whole.half_diagonal_mm();
        let by_tan = |way: DVec2| channels.field_tan(reference, center_mm + way * by_mm) - axis_tan;
        let steps = DMat2::from_cols(by_tan(DVec2::X), by_tan(DVec2::Y));
        let place_of = |field_tan: DVec2| channels.place_mm(reference, field_tan).ok_or_else(dark);
        let axis_mm = place_of(axis_tan)?;
        let mut places = [DVec2::ZERO; 2];
        for (place, step) in places.iter_mut().zip([steps.x_axis, steps.y_axis]) {
            *place = 0.5 * (place_of(axis_tan + step)? - place_of(axis_tan - step)?);
        }
        let mm_per_tan = DMat2::from_cols(places[0], places[1]) * steps.inverse();
        if !mm_per_tan.is_finite() {
            return Err(dark());
        }
        Ok(Self { channels, reference, whole, frame: place.film(), axis_tan, axis_mm, mm_per_tan })
    }

    /// Returns where the frame has the light of a place of the picture without distortion, enlarged so many times about the middle of
    /// the film; both mm in the picture frame.
    fn source_mm(&self, place_mm: DVec2, scale: f64) -> Option<DVec2> {
        let place_mm = place_mm / scale;
        let field_tan = self.axis_tan + self.mm_per_tan.inverse() * (place_mm - self.axis_mm);
        self.channels.place_mm(self.reference, field_tan)
    }

    /// Returns the least enlargement at which every place of the picture has light from within the film.
    fn scale(&self) -> f64 {
        let half_mm = self.whole.half_size_mm();
        let parts = [-1.0, -0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0];
        let border: Vec<DVec2> = parts
            .into_iter()
            .flat_map(|part| [(part, 1.0), (part, -1.0), (1.0, part), (-1.0, part)])
            .map(|(x, y)| DVec2::new(x, y) * half_mm)
            .collect();
        let is_within = |scale: f64| {
            border.iter().all(|place_mm| {
                // What the lens does not show is beyond.
                self.source_mm(*place_mm, scale).is_some_and(|at| (at.abs() / half_mm).max_element() <= 1.0 + 1e-9)
            })
        };
        if is_within(1.0) {
            return 1.0;
        }
        let (mut low, mut high) = (1.0, MOST_SCALE);
        for _ in 0..20 {
            let middle = 0.5 * (low + high);
            if is_within(middle) { high = middle } else { low = middle }
        }
        high
    }

    /// Returns the place of a node of the tables, mm to the right and up of the middle of the film.
    fn node_mm(&self, node: usize) -> DVec2 {
        let share = |i: usize| i as f64 / (NODES - 1) as f64;
        let half_mm = self.frame.half_size_mm();
        let (row, column) = (node / NODES, node % NODES);
        self.frame.center_mm + DVec2::new(2.0 * share(column) - 1.0, 1.0 - 2.0 * share(row)) * half_mm
    }

    fn tabulate(&self, parts: &TableParts<'_>, depth_m: f64) -> Result<LensAberrations, PipelineError> {
        let scale = self.scale();
        let distortion = self.displacements(|at_mm| self.source_mm(at_mm, scale));
        let n_channels = self.channels.weights.len();
        let lateral: Vec<Vec<Option<DVec2>>> = (0..n_channels)
            .map(|channel| {
                self.displacements(|at_mm| {
                    if channel == self.reference {
                        return Some(at_mm);
                    }
                    let field_tan = self.channels.field_tan(self.reference, at_mm);
                    let own = self.channels.place_mm(self.reference, field_tan)?;
                    Some(at_mm + self.channels.place_mm(channel, field_tan)? - own)
                })
            })
            .collect();
        let distortion_px = to_tables(&filled(&distortion))?;
        let filled_lateral: Vec<Vec<DVec2>> = lateral.iter().map(|moved| filled(moved)).collect();
        let gains = self.gains(parts)?;
        let tables = LensTables {
            size: (self.frame.rows, self.frame.columns),
            distortion_px,
            lateral_color_px: filled_lateral.iter().map(|moved| to_tables(moved)).collect::<Result<_, _>>()?,
            vignetting: gains
                .iter()
                .map(|gains| Ok(FrameTable::new(NODES, NODES, gains.clone())?))
                .collect::<Result<_, PipelineError>>()?,
        };
        let most = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, f64::max);
        let apart = |node: usize| {
            let pairs =
                filled_lateral.iter().flat_map(|a| filled_lateral.iter().map(move |b| a[node].distance(b[node])));
            pairs.fold(0.0, f64::max)
        };
        let summary = AberrationSummary {
            depth_m,
            scale,
            largest_distortion_px: most(&mut distortion.iter().flatten().map(|moved| moved.length())),
            largest_lateral_color_px: most(&mut (0..NODES * NODES).map(apart)),
            largest_gain: most(&mut gains.iter().flatten().copied()),
            beyond_fraction: self.beyond_fraction(&tables),
        };
        Ok(LensAberrations { tables, summary })
    }

    /// Returns, for each node, where a function puts it, counted from the node: pixels to the right and down.
    fn displacements(&self, place: impl Fn(DVec2) -> Option<DVec2> + Sync) -> Vec<Option<DVec2>> {
        let per_mm = 1e3 / self.frame.pitch_um;
        let moved = |node: usize| {
            let at_mm = self.node_mm(node);
            place(at_mm).map(|to_mm| DVec2::new(to_mm.x - at_mm.x, at_mm.y - to_mm.y) * per_mm)
        };
        nodes().into_par_iter().map(moved).collect()
    }

    /// Returns for each channel and node the factor that makes an even surface even.
    fn gains(&self, parts: &TableParts<'_>) -> Result<Vec<Vec<f64>>, PipelineError> {
        let response = parts.sensor.angular_response(electrons::exit_pupil(parts.sensor, parts.place, parts.lens))?;
        let of_channel = |channel: usize| {
            let light = |node: usize| {
                let at_mm = self.node_mm(node);
                let seen = parts.angular_factor(&response, at_mm - self.frame.center_mm);
                seen * self.channels.irradiance_per_radiance(channel, at_mm)
            };
            let lights: Vec<f64> = nodes().into_par_iter().map(light).collect();
            // The brightest place of the whole film, so that its parts are as bright as it is.
            let brightest = self.brightest(channel, parts, &response).max(lights.iter().copied().fold(0.0, f64::max));
            lights.into_iter().map(|light| (brightest / light).min(MOST_GAIN)).collect()
        };
        Ok((0..self.channels.weights.len()).map(of_channel).collect())
    }

    /// Returns the light of a channel where the whole film has most.
    fn brightest(&self, channel: usize, parts: &TableParts<'_>, response: &AngularResponse<'_>) -> f64 {
        let whole = Self {
            frame: self.whole,
            channels: ChannelImages { bands: self.channels.bands, weights: self.channels.weights.clone() },
            ..*self
        };
        let light = |node: usize| {
            let at_mm = whole.node_mm(node);
            parts.angular_factor(response, at_mm - self.frame.center_mm)
                * whole.channels.irradiance_per_radiance(channel, at_mm)
        };
        nodes().into_par_iter().map(light).reduce(|| 0.0, f64::max)
    }

    /// Returns the share of the nodes of a picture without distortion whose light lies beyond the frame.
    fn beyond_fraction(&self, tables: &LensTables) -> f64 {
        let (rows, columns) = (self.frame.rows as f64, self.frame.columns as f64);
        let [across, along] = &tables.distortion_px;
        let moved = across.values().zip(along.values()).enumerate();
        let n_beyond = moved.filter(|&(node, (right, down))| {
            let share = |i: usize| i as f64 / (NODES - 1) as f64;
            let (x, y) = (share(node % NODES) + right / columns, share(node / NODES) + down / rows);
            // What is taken from the border.
            let slack = 4.0;
            let is_on = |share: f64, n: f64| share >= -slack / n && share <= 1.0 + slack / n;
            !(is_on(x, columns) && is_on(y, rows))
        });
        n_beyond.count() as f64 / (NODES * NODES) as f64
    }
}

fn nodes() -> Range<usize> {
    0..NODES * NODES
}

/// Returns displacements at all nodes: where none is known, that of the nearest node with one; none where there is none at all.
fn filled(moved: &[Option<DVec2>]) -> Vec<DVec2> {
    let known: Vec<(usize, DVec2)> =
        moved.iter().enumerate().filter_map(|(node, moved)| Some((node, (*moved)?))).collect();
    let nearest = |node: usize| {
        let apart = |other: usize| {
            (node / NODES).abs_diff(other / NODES).pow(2) + (node % NODES).abs_diff(other % NODES).pow(2)
        };
        known.iter().min_by_key(|(other, _)| apart(*other)).map_or(DVec2::ZERO, |(_, moved)| *moved)
    };
    moved.iter().enumerate().map(|(node, moved)| moved.unwrap_or_else(|| nearest(node))).collect()
}

fn to_tables(moved: &[DVec2]) -> Result<[FrameTable; 2], PipelineError> {
    let table = |part: fn(&DVec2) -> f64| FrameTable::new(NODES, NODES, moved.iter().map(part).collect());
    Ok([table(|moved| moved.x)?, table(|moved| moved.y)?])
}
