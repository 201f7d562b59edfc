//! What a laboratory measures: pictures and frames in, numbers and charts out.

mod chart;
mod compare;
mod edge;
mod edge_batch;
mod edge_map;
mod frames;
mod grid;
mod noise;
mod noise_charts;
mod open;
mod points;
mod region;
mod region_statistics;
mod shading;
mod star;
mod steps;
mod texture;

use serde::Serialize;

pub use chart::{ChartMeasurement, ChartRequest, PatchRow};
pub use compare::{CompareRequest, Comparison, DeltaESummary, PictureViewing, SeenPicture};
pub use edge::{EdgeChannel, EdgeMeasurement, EdgeRequest, UnmeasuredChannel};
pub use edge_batch::{EdgeBatch, EdgeBatchRequest, UnmeasuredPicture};
pub use edge_map::{EdgeMap, EdgeMapRequest, EdgePlace, UnmeasuredPlace};
pub use grid::{GridDot, GridMeasurement, LateralColor};
pub use noise::{
    BenchRequest, FrameSeries, NoiseData, NoiseDataSheet, NoisePoint, SpatialPatterns, measure_bench, measure_frames,
    measure_series,
};
pub use open::{CodeCurve, MeasuredPicture, notes_on_picture};
pub use points::{PointRequest, PointRow, PointSet};
pub use region::PixelRegion;
pub use region_statistics::{BandMean, ColorDifference, RegionChannel, RegionColor, RegionMeasurement, RegionRequest};
pub use shading::{ShadingChannel, ShadingMeasurement};
pub use star::{StarChannel, StarMeasurement, StarRequest};
pub use steps::{Step, StepRow, StepsChannel, StepsMeasurement, StepsRequest};
pub use texture::{TextureChannel, TextureCurve, TextureMeasurement, TextureNoiseRequest, TextureRequest};

use crate::LineChart;

/// Numbers that were measured, with plots of them.
pub trait Measurement: Serialize {
    /// Returns the plots, each with the name of its file.
    fn charts(&self) -> Vec<(String, LineChart)>;

    /// Returns the numbers as a table of comma-separated values, of measurements that are one.
    fn csv(&self) -> Option<String> {
        None
    }
}
