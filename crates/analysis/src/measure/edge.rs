//! The spatial frequency response of a slanted edge in a picture.

use dioptric_sensor::{EdgeResponse, SensorError, Tile, Viewing, find_edge, find_edges};
use ndarray::{Array2, ArrayView2, s};
use serde::Serialize;

use super::{MeasuredPicture, Measurement, PixelRegion};
use crate::{Corner, LineChart, Scale, Series, palette};
use dioptric_pipeline::PipelineError;

/// The sides of the regions that are looked for, in samples of one channel: the first will do where MTF50 is as certain as this share of it, larger
/// ones are tried where noise asks for more.
const SIDES: [usize; 4] = [64, 96, 128, 192];
const CERTAIN: f64 = 0.01;
/// Pixels a degree where none are given: one a minute of arc.
const PIXELS_PER_DEGREE: f64 = 60.0;
/// The luminance at which pictures are looked at, cd/m².
const LUMINANCE_CD_M2: f64 = 100.0;
/// The channel from whose edge the others' are counted.
const GREEN: &str = "G";
/// The most letters a mosaic may have.
const MOST_LETTERS: usize = 64;

/// How an edge is measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EdgeRequest {
    /// Where the edge is; looked for where it is not given.
    pub region: Option<PixelRegion>,
    /// The side of the region that is looked for, pixels.
    pub side: Option<usize>,
    /// The mosaic of a raw frame, a letter a filter row by row, such as `RGGB`.
    pub mosaic: Option<String>,
    /// The distance between pixels, µm.
    pub pixel_um: Option<f64>,
    /// Pixels a degree of the viewer's field, for acutance and square-root integral; 60 where it is not given.
    pub pixels_per_degree: Option<f64>,
}

/// The responses of an edge, a channel each.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EdgeMeasurement {
    /// The file.
    pub picture: String,
    /// The region that was measured.
    pub region: PixelRegion,
    /// The slant of the edge, degrees from the nearest of rows and columns.
    pub slant_deg: f64,
    /// The distance between pixels, µm, where it was given.
    pub pixel_um: Option<f64>,
    /// A response a channel.
    pub channels: Vec<EdgeChannel>,
    /// Channels in which the edge cannot be measured.
    pub not_measured: Vec<UnmeasuredChannel>,
    /// The share of the region's samples that lie at 0 or at the highest code: an edge that is clipped there looks sharper than it is.
    pub clipped_share: f64,
}

/// The response of one channel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EdgeChannel {
    /// The channel.
    pub channel: String,
    /// The frequency at which half the response is left, cycles a pixel.
    pub mtf50_cycles_per_pixel: Option<f64>,
    /// One standard error of it, by the noise of the pixels.
    pub mtf50_error_cycles_per_pixel: Option<f64>,
    /// The frequency beyond the peak at which half the peak is left, cycles a pixel.
    pub mtf50p_cycles_per_pixel: Option<f64>,
    /// The first of these in cycles a millimetre, where the distance between pixels was given.
    pub mtf50_cycles_per_mm: Option<f64>,
    /// The second in cycles a millimetre.
    pub mtf50p_cycles_per_mm: Option<f64>,
    /// The response at half a cycle a pixel; none where the channel's samples are too far apart to tell.
    pub response_at_nyquist: Option<f64>,
    /// The response weighed by the eye's contrast sensitivity, 1 of a perfect picture (IEEE 1858); none where the channel's samples are too far apart to
    /// tell.
    pub acutance: Option<f64>,
    /// The square-root integral of the whole picture at 100 cd/m², just noticeable differences (Barten 1990).
    pub square_root_integral_jnd: Option<f64>,
    /// The share of the response that lies beyond half a cycle a pixel and comes back as coarser patterns.
    pub aliasing_share: Option<f64>,
    /// Frequencies, cycles a pixel.
    pub frequencies_cycles_per_pixel: Vec<f64>,
    /// The response at each frequency, 1 at 0.
    pub response: Vec<f64>,
    /// One standard error of each response, by the noise of the pixels.
    pub response_error: Vec<f64>,
    /// The step of light in standard deviations of a pixel; none where there is no noise.
    pub contrast_to_noise: Option<f64>,
    /// By how much light changes from the edge to the border of the region, of the step: shading, which was taken off; 0 where there is none.
    pub shading: f64,
    /// How far the edge lies from that of the green channel, pixels along the direction across it, to the right, or down where it is nearer to a row:
    /// lateral color; none where there is no green one.
    pub offset_px: Option<f64>,
    /// One standard error of it, by the noise of the pixels.
    pub offset_error_px: Option<f64>,
}

/// A channel in which the edge cannot be measured.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UnmeasuredChannel {
    /// The channel.
    pub channel: String,
    /// Why.
    pub reason: String,
}

impl EdgeRequest {
    /// Measures the edge of a picture.
    ///
    /// In a picture of R, G and B the luminance is measured too; in a mosaic each filter by itself, over all its places
    /// in the tile.
    ///
    /// # Errors
    /// When there is no edge, or a setting does not go with the picture.
    pub fn measure(&self, picture: &MeasuredPicture) -> Result<EdgeMeasurement, PipelineError> {
        if let Some(value) = self.pixel_um.filter(|v| !(*v > 0.0 && v.is_finite())) {
            return Err(wrong("--pixel-um", value.to_string(), "a number above 0"));
        }
        let viewing = viewing_of(self.pixels_per_degree, picture.size())?;
        let samples = self.samples(picture)?;
        let region = self.region(picture, samples.period)?;
        let mut measured: Vec<(String, EdgeResponse)> = Vec::new();
        let mut not_measured = Vec::new();
        for (channel, parts) in &samples.channels {
            let of_part = |part: &Part<'_>| {
                let response = EdgeResponse::measure(&part.of(region, samples.period))?;
                Ok::<_, SensorError>(EdgeResponse {
                    position_px: part.position_px(&response, region, samples.period),
                    position_error_px: samples.period as f64 * response.position_error_px,
                    ..response
                })
            };
            let responses: Result<Vec<EdgeResponse>, _> = parts.iter().map(of_part).collect();
            match responses {
                Ok(responses) => measured.push((channel.clone(), mean_response(&responses, samples.period))),
                Err(error) => {
                    not_measured.push(UnmeasuredChannel { channel: channel.clone(), reason: error.to_string() });
                }
            }
        }
        match (measured.last(), not_measured.first()) {
            (Some((_, last)), _) => Ok(EdgeMeasurement {
                picture: picture.name.clone(),
                region,
                slant_deg: last.slant_deg,
                pixel_um: self.pixel_um,
                channels: {
                    let green = measured.iter().find(|(name, _)| name == GREEN).map(|(_, response)| response);
                    let channel = |(name, response): &(String, EdgeResponse)| -> Result<EdgeChannel, PipelineError> {
                        let offset = green.map(|green| offset_px(response, green));
                        let (offset_px, offset_error_px) = (offset.map(|(px, _)| px), offset.map(|(_, error)| error));
                        Ok(EdgeChannel { offset_px, offset_error_px, ..self.channel(name, response, &viewing)? })
                    };
                    measured.iter().map(channel).collect::<Result<_, _>>()?
                },
                not_measured,
                clipped_share: picture.clipped_share_of(region),
            }),
            (None, first) => {
                let reason = first.map_or_else(|| "has no channel".to_owned(), |first| first.reason.clone());
                Err(picture.unfit(reason))
            }
        }
    }

    /// Parts a picture into channels.
    fn samples<'a>(&self, picture: &'a MeasuredPicture) -> Result<Samples<'a>, PipelineError> {
        if let (None, Some((tile, names))) = (&self.mosaic, &picture.mosaic) {
            return Self::filters(picture, tile, names);
        }
        let Some(letters) = &self.mosaic else {
            let whole = |plane| vec![Part { plane: Plane::Borrowed(plane), first: (0, 0) }];
            let mut channels: Vec<(String, Vec<Part<'a>>)> =
                picture.planes.iter().map(|(name, plane)| (name.clone(), whole(plane))).collect();
            if picture.rgb().is_ok() && picture.planes.len() > 1 {
                let part = Part { plane: Plane::Owned(picture.luminance()), first: (0, 0) };
                channels.push(("luminance".to_owned(), vec![part]));
            }
            return Ok(Samples { period: 1, channels });
        };
        let [(_, plane)] = picture.planes.as_slice() else {
            return Err(wrong("--mosaic", format!("'{letters}'"), "a raw frame of one channel beside it"));
        };
        let letters: Vec<char> = letters.chars().collect();
        let period = (1..=8).find(|n| n * n == letters.len()).filter(|n| n * n <= MOST_LETTERS);
        let Some(period) = period.filter(|_| letters.iter().all(|c| c.is_alphanumeric())) else {
            let found = letters.iter().collect::<String>();
            return Err(wrong("--mosaic", format!("'{found}'"), "the letters of a square tile, as RGGB"));
        };
        let mut channels: Vec<(String, Vec<Part<'a>>)> = Vec::new();
        for (index, letter) in letters.iter().enumerate() {
            let part = Part { plane: Plane::Borrowed(plane), first: (index / period, index % period) };
            match channels.iter_mut().find(|(name, _)| *name == letter.to_string()) {
                Some((_, parts)) => parts.push(part),
                None => channels.push((letter.to_string(), vec![part])),
            }
        }
        Ok(Samples { period, channels })
    }

    /// Parts the mosaic of a raw file into its filters, each with a part for every place in the tile.
    fn filters<'a>(picture: &'a MeasuredPicture, tile: &Tile, names: &[String]) -> Result<Samples<'a>, PipelineError> {
        let (rows, columns) = (tile.rows(), tile.columns());
        if rows != columns {
            let reason = format!("has a mosaic of {rows} × {columns} pixels, expected a square one");
            return Err(picture.unfit(reason));
        }
        let mut channels: Vec<(String, Vec<Part<'a>>)> = names.iter().map(|name| (name.clone(), Vec::new())).collect();
        for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
            let part = Part { plane: Plane::Borrowed(&picture.planes[0].1), first: (row, column) };
            channels[tile.filter_at(row, column)].1.push(part);
        }
        channels.retain(|(_, parts)| !parts.is_empty());
        Ok(Samples { period: rows, channels })
    }

    /// Returns the region given, or the most edge-like square.
    fn region(&self, picture: &MeasuredPicture, period: usize) -> Result<PixelRegion, PipelineError> {
        let (rows, columns) = picture.size();
        if let Some(region) = self.region {
            return region.check_within((rows, columns));
        }
        let in_file = |reason: String| picture.unfit(reason);
        let binned = binned(picture, period);
        let most = binned.nrows().min(binned.ncols());
        let square = |side: usize| find_edge(&binned, side).map(|corner| (corner, side));
        let found = match self.side {
            Some(side) => square(side / period),
            None => most_certain(&binned, square(SIDES[0].min(most)), SIDES[1..].iter().filter(|side| **side <= most)),
        };
        let ((row, column), side) = found.map_err(|e| in_file(e.to_string()))?;
        let (rows, columns) = (side * period, side * period);
        Ok(PixelRegion { row: row * period, column: column * period, rows, columns })
    }

    /// Returns the side of the squares that are looked for, pixels.
    pub(super) fn side_for(&self, picture: &MeasuredPicture) -> Result<usize, PipelineError> {
        let period = self.samples(picture)?.period;
        let (rows, columns) = picture.size();
        Ok(self.side.unwrap_or(period * SIDES[0].min(rows.min(columns) / period)))
    }

    /// Returns the regions all over a picture that look like slanted edges, most like one first, `most` of them at most.
    pub(super) fn regions(&self, picture: &MeasuredPicture, most: usize) -> Result<Vec<PixelRegion>, PipelineError> {
        let period = self.samples(picture)?.period;
        let binned = binned(picture, period);
        let side = self.side_for(picture)? / period;
        let corners = find_edges(&binned, side).map_err(|e| picture.unfit(e.to_string()))?;
        let region = |(row, column)| PixelRegion {
            row: row * period,
            column: column * period,
            rows: side * period,
            columns: side * period,
        };
        Ok(corners.into_iter().take(most).map(region).collect())
    }

    fn channel(&self, name: &str, response: &EdgeResponse, viewing: &Viewing) -> Result<EdgeChannel, PipelineError> {
        let per_mm = |cycles_per_pixel: f64| self.pixel_um.map(|um| cycles_per_pixel / um * 1e3);
        let (mtf50, mtf50p) = (response.mtf50(), response.mtf50p());
        let last = response.frequencies.last().copied().unwrap_or(0.0);
        let is_known = last > 0.5 - 1e-9;
        Ok(EdgeChannel {
            channel: name.to_owned(),
            mtf50_cycles_per_pixel: mtf50,
            mtf50_error_cycles_per_pixel: response.mtf50_error(),
            mtf50p_cycles_per_pixel: mtf50p,
            mtf50_cycles_per_mm: mtf50.and_then(per_mm),
            mtf50p_cycles_per_mm: mtf50p.and_then(per_mm),
            response_at_nyquist: is_known.then(|| response.at(0.5)),
            acutance: is_known.then(|| response.acutance(viewing)).transpose()?,
            square_root_integral_jnd: is_known.then(|| response.square_root_integral(viewing)).transpose()?,
            aliasing_share: (last > 1.0 - 1e-9).then(|| response.aliasing_share()),
            frequencies_cycles_per_pixel: response.frequencies.clone(),
            response: response.response.clone(),
            response_error: response.standard_error.clone(),
            contrast_to_noise: Some(response.contrast_to_noise).filter(|ratio| ratio.is_finite()),
            shading: response.shading,
            offset_px: None,
            offset_error_px: None,
        })
    }
}

/// Returns how far an edge lies from another across the latter, and the standard error of that, pixels.
fn offset_px(response: &EdgeResponse, from: &EdgeResponse) -> (f64, f64) {
    if std::ptr::eq(response, from) {
        return (0.0, 0.0);
    }
    let along = response.normal[0] * from.normal[0] + response.normal[1] * from.normal[1];
    let error = response.position_error_px.hypot(from.position_error_px);
    (response.position_px * along - from.position_px, error)
}

/// Returns the luminance of a picture, each tile of a mosaic as one sample: its colors would look like edges.
fn binned(picture: &MeasuredPicture, period: usize) -> Array2<f32> {
    let (rows, columns) = picture.size();
    let luminance = picture.luminance();
    Array2::from_shape_fn((rows / period, columns / period), |(r, c)| {
        let tile = luminance.slice(s![r * period..(r + 1) * period, c * period..(c + 1) * period]);
        tile.sum() / (period * period) as f32
    })
}

/// Returns why an edge is not measured, without the name of the file.
pub(super) fn reason_of(error: &PipelineError) -> String {
    match error {
        PipelineError::Read { reason, .. } | PipelineError::Unsuitable { reason, .. } => reason.clone(),
        other => other.to_string(),
    }
}

/// A square with an edge: its corner, row and column, and its side.
type Square = ((usize, usize), usize);

/// Returns the square of those with an edge in which MTF50 is most certain; the first where it is certain enough, or no other can be measured.
fn most_certain<'a>(
    picture: &Array2<f32>,
    first: Result<Square, SensorError>,
    larger: impl Iterator<Item = &'a usize>,
) -> Result<Square, SensorError> {
    let uncertainty = |((row, column), side): Square| {
        let response = EdgeResponse::measure(&picture.slice(s![row..row + side, column..column + side])).ok()?;
        Some(response.mtf50_error()? / response.mtf50()?)
    };
    let first = first?;
    let mut best = (uncertainty(first).unwrap_or(f64::INFINITY), first);
    for &side in larger {
        if best.0 <= CERTAIN {
            break;
        }
        let Ok(corner) = find_edge(picture, side) else { continue };
        if let Some(uncertainty) = uncertainty((corner, side)).filter(|share| *share < best.0) {
            best = (uncertainty, (corner, side));
        }
    }
    Ok(best.1)
}

/// The channels of a picture, each in one or more parts with a sample every `period` pixels.
struct Samples<'a> {
    period: usize,
    channels: Vec<(String, Vec<Part<'a>>)>,
}

enum Plane<'a> {
    Borrowed(&'a Array2<f32>),
    Owned(Array2<f32>),
}

struct Part<'a> {
    plane: Plane<'a>,
    /// The first row and column in the tile.
    first: (usize, usize),
}

impl Part<'_> {
    /// Returns the part's samples in a region.
    fn of(&self, region: PixelRegion, period: usize) -> ArrayView2<'_, f32> {
        let plane = match &self.plane {
            Plane::Borrowed(plane) => plane,
            Plane::Owned(plane) => plane,
        };
        // The tile begins at pixel 0 of the picture, wherever the region does.
        let (row, column) = self.offset(region, period);
        region.of(plane).slice_move(s![row..; period, column..; period])
    }

    /// Returns the row and column of a region at which the part's samples begin.
    fn offset(&self, region: PixelRegion, period: usize) -> (usize, usize) {
        let offset = |first: usize, start: usize| (first + period - start % period) % period;
        (offset(self.first.0, region.row), offset(self.first.1, region.column))
    }

    /// Returns where an edge lies that was found in the part, pixels across it from the middle of the region.
    fn position_px(&self, response: &EdgeResponse, region: PixelRegion, period: usize) -> f64 {
        let middle = |first: usize, n: usize| {
            let n_samples = (n - first).div_ceil(period);
            first as f64 + 0.5 * (period * (n_samples - 1)) as f64 - 0.5 * (n as f64 - 1.0)
        };
        let (row, column) = self.offset(region, period);
        let [right, down] = response.normal;
        let moved = right * middle(column, region.columns) + down * middle(row, region.rows);
        period as f64 * response.position_px + moved
    }
}

/// Returns the mean of responses, with frequencies in cycles a pixel where samples are `period` pixels apart.
fn mean_response(parts: &[EdgeResponse], period: usize) -> EdgeResponse {
    let n = parts.len() as f64;
    let mean = |of: &dyn Fn(&EdgeResponse) -> f64| parts.iter().map(of).sum::<f64>() / n;
    EdgeResponse {
        frequencies: parts[0].frequencies.iter().map(|f| f / period as f64).collect(),
        response: (0..parts[0].response.len()).map(|i| mean(&|part| part.response[i])).collect(),
        // Parts have pixels of their own.
        standard_error: (0..parts[0].response.len())
            .map(|i| (mean(&|part| part.standard_error[i].powi(2)) / n).sqrt())
            .collect(),
        slant_deg: mean(&|part| part.slant_deg),
        contrast: mean(&|part| part.contrast),
        contrast_to_noise: mean(&|part| part.contrast_to_noise),
        shading: mean(&|part| part.shading),
        normal: parts[0].normal,
        position_px: mean(&|part| part.position_px),
        position_error_px: (mean(&|part| part.position_error_px.powi(2)) / n).sqrt(),
    }
}

/// Returns how a picture of so many rows and columns is looked at.
pub(super) fn viewing_of(
    pixels_per_degree: Option<f64>,
    (rows, columns): (usize, usize),
) -> Result<Viewing, PipelineError> {
    let pixels_per_degree = pixels_per_degree.unwrap_or(PIXELS_PER_DEGREE);
    if !(pixels_per_degree > 0.0 && pixels_per_degree.is_finite()) {
        return Err(wrong("--pixels-per-degree", pixels_per_degree.to_string(), "a number above 0"));
    }
    let picture_deg = (rows as f64 * columns as f64).sqrt() / pixels_per_degree;
    Ok(Viewing { pixels_per_degree, picture_deg, luminance_cd_m2: LUMINANCE_CD_M2 })
}

fn wrong(key: &'static str, found: String, expected: &str) -> PipelineError {
    PipelineError::Value { origin: "the command line".to_owned(), key, found, expected: expected.to_owned() }
}

/// Returns the line of a channel's response over frequencies, cycles a pixel.
pub(super) fn response_series(channel: &str, frequencies: &[f64], response: &[f64]) -> Series {
    Series {
        label: Some(channel.to_owned()),
        color: palette::channel(channel),
        points: frequencies.iter().copied().zip(response.iter().copied()).collect(),
        is_dashed: channel == "luminance",
    }
}

impl Measurement for EdgeMeasurement {
    fn charts(&self) -> Vec<(String, LineChart)> {
        let series = self
            .channels
            .iter()
            .map(|channel| response_series(&channel.channel, &channel.frequencies_cycles_per_pixel, &channel.response));
        let highest = self.channels.iter().flat_map(|c| &c.response).copied().fold(1.0, f64::max);
        let chart = LineChart {
            title: format!("Spatial frequency response, edge slanted by {:.2}°", self.slant_deg),
            x_label: "cycles a pixel".to_owned(),
            y_label: "response".to_owned(),
            x_range: (0.0, 1.0),
            y_range: (0.0, (10.0 * highest).ceil() / 10.0),
            series: series.collect(),
            legend: Corner::TopRight,
            scale: Scale::Linear,
        };
        vec![("mtf".to_owned(), chart)]
    }
}
