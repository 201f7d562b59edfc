//! Slanted edges all over a picture: the response over the field.

use std::path::Path;

use dioptric_pipeline::PipelineError;
use serde::Serialize;

use super::{EdgeChannel, EdgeRequest, MeasuredPicture, Measurement, PixelRegion, edge};
use crate::{Corner, LineChart, Scale, Series, palette};

/// The most edges that are measured.
const MOST: usize = 400;
/// The sides of the squares that are looked for, one after the other, as shares of the first.
const SIDES: [f64; 3] = [1.0, 0.75, 0.5];

/// Edges that are looked for all over a picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EdgeMapRequest {
    /// How each is measured; its region is not used, its side is that of the squares that are looked for.
    pub edge: EdgeRequest,
}

/// The response over the field.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EdgeMap {
    /// The file.
    pub picture: String,
    /// The edges, from the middle of the picture outwards.
    pub edges: Vec<EdgePlace>,
    /// Places that look like edges and cannot be measured, with the reason.
    pub not_measured: Vec<UnmeasuredPlace>,
}

/// An edge at its place.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EdgePlace {
    /// The region that was measured.
    pub region: PixelRegion,
    /// How far its middle is from that of the picture, in shares of half the diagonal.
    pub field: f64,
    /// The slant of the edge, degrees from the nearest of rows and columns.
    pub slant_deg: f64,
    /// A response a channel.
    pub channels: Vec<EdgeChannel>,
}

/// A place that looks like an edge and cannot be measured.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UnmeasuredPlace {
    /// The region.
    pub region: PixelRegion,
    /// Why.
    pub reason: String,
}

impl EdgeMapRequest {
    /// Finds and measures the slanted edges of a picture file.
    ///
    /// # Errors
    /// When the file cannot be read, a setting makes no sense, or no edge can be measured.
    pub fn measure(&self, path: &Path) -> Result<EdgeMap, PipelineError> {
        let picture = MeasuredPicture::open(path, self.edge.curve)?;
        let (rows, columns) = picture.size();
        let half_diagonal = 0.5 * (rows as f64).hypot(columns as f64);
        let field = |region: &PixelRegion| {
            let off = |first: usize, n: usize, all: usize| first as f64 + 0.5 * n as f64 - 0.5 * all as f64;
            off(region.column, region.columns, columns).hypot(off(region.row, region.rows, rows)) / half_diagonal
        };
        let (mut edges, mut not_measured): (Vec<EdgePlace>, Vec<UnmeasuredPlace>) = (Vec::new(), Vec::new());
        let first = self.edge.side_for(&picture)?;
        // Smaller squares find the edges of which larger ones hold corners.
        for side in SIDES.map(|share| (share * first as f64) as usize) {
            let sized = EdgeRequest { side: Some(side), ..self.edge.clone() };
            let Ok(regions) = sized.regions(&picture, MOST) else { continue };
            for region in regions {
                if edges.iter().any(|edge| overlap(&edge.region, &region)) {
                    continue;
                }
                let request = EdgeRequest { region: Some(region), ..self.edge.clone() };
                match request.measure_picture(&picture) {
                    Ok(measured) => edges.push(EdgePlace {
                        region,
                        field: field(&region),
                        slant_deg: measured.slant_deg,
                        channels: measured.channels,
                    }),
                    Err(error) if side == first => {
                        not_measured.push(UnmeasuredPlace { region, reason: edge::reason_of(&error) });
                    }
                    Err(_) => {}
                }
            }
        }
        not_measured.retain(|place| !edges.iter().any(|edge| overlap(&edge.region, &place.region)));
        if edges.is_empty() {
            let reason =
                not_measured.first().map_or_else(|| "holds no slanted edge".to_owned(), |first| first.reason.clone());
            return Err(PipelineError::Read { path: path.to_owned(), reason });
        }
        edges.sort_by(|a, b| a.field.total_cmp(&b.field));
        Ok(EdgeMap { picture: picture.name, edges, not_measured })
    }
}

fn overlap(a: &PixelRegion, b: &PixelRegion) -> bool {
    let meet = |first: usize, n: usize, other: usize, m: usize| first < other + m && other < first + n;
    meet(a.column, a.columns, b.column, b.columns) && meet(a.row, a.rows, b.row, b.rows)
}

impl Measurement for EdgeMap {
    fn charts(&self) -> Vec<(String, LineChart)> {
        let mut names: Vec<&str> =
            self.edges.iter().flat_map(|edge| &edge.channels).map(|c| c.channel.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        let points = |name: &str| -> Vec<(f64, f64)> {
            let of = |edge: &EdgePlace| {
                let channel = edge.channels.iter().find(|channel| channel.channel == name)?;
                Some((edge.field, channel.mtf50_cycles_per_pixel?))
            };
            self.edges.iter().filter_map(of).collect()
        };
        let series: Vec<Series> = names
            .iter()
            .map(|name| Series {
                label: Some((*name).to_owned()),
                color: palette::channel(name),
                points: points(name),
                is_dashed: *name == "luminance",
            })
            .collect();
        let most = series.iter().flat_map(|line| &line.points).map(|point| point.1).fold(0.1, f64::max);
        let chart = LineChart {
            title: "MTF50 over the field".to_owned(),
            x_label: "field, share of half the diagonal".to_owned(),
            y_label: "MTF50, cycles a pixel".to_owned(),
            x_range: (0.0, 1.0),
            y_range: (0.0, 1.1 * most),
            series,
            legend: Corner::BottomLeft,
            scale: Scale::Linear,
        };
        vec![("mtf-field".to_owned(), chart)]
    }
}
