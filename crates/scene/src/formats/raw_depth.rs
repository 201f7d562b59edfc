//! Depth as it stands in a file, and what it comes to.

use std::path::{Path, PathBuf};

use ndarray::Array2;

use super::{
    reading::{DepthKind, DepthUnit, Frame},
    stated::name_of,
    unusable::unreadable,
};
use crate::{SceneError, View};

/// Depths from here on are those of the sky: Blender writes 1e10.
const SKY_M: f64 = 1e9;
/// Numbers that stand for none in arrays of any type: the last code of 16 bits, and what programs put where nothing was measured.
const NONES: [f32; 8] = [65_535.0, -1.0, -99.0, -999.0, -9999.0, -99_999.0, -32_768.0, -2_147_483_648.0];
/// The largest half float, which stands for what was farther or not measured in files of floats.
const LARGEST_HALF: f32 = 65_504.0;
/// The largest numbers of types of whole numbers, which stand for none in arrays of these.
const TOPS: [f64; 4] = [32_767.0, 65_535.0, 2_147_483_647.0, 4_294_967_295.0];
/// The last code of 24 bits.
const OF_24_BITS: f32 = 16_777_215.0;

/// Depths as they stand in a file.
pub(super) struct RawDepth {
    pub(super) values: Array2<f32>,
    pub(super) kind: DepthKind,
    pub(super) unit: DepthUnit,
    /// The largest number of whole numbers, which stands for none where it is that of their type.
    pub(super) top: Option<f64>,
    /// Columns of the file a column of these, the first being what a disparity counts.
    pub(super) columns_per_column: f64,
    /// The picture of which the depths are a part, where the file tells.
    pub(super) frame: Option<Frame>,
    pub(super) file: PathBuf,
    /// Where it is in the file, for the line of what was understood.
    pub(super) from: String,
    /// Whether places without depth are filled without being asked: those of a picture.
    pub(super) is_picture: bool,
    pub(super) notes: Vec<String>,
}

/// What is said of a depth by who asks for it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct DepthWords<'a> {
    pub(super) kind: Option<DepthKind>,
    pub(super) unit: Option<&'a str>,
    /// The name of the channel or array.
    pub(super) variable: Option<&'a str>,
    /// What the camera file says.
    pub(super) unit_m: Option<f64>,
}

impl RawDepth {
    /// Depths in metres of a scene's own file.
    pub(super) fn in_file(file: &Path, from: String, values: Array2<f32>, kind: DepthKind) -> Self {
        Self {
            values,
            kind,
            unit: DepthUnit::Metres(1.0),
            top: None,
            columns_per_column: 1.0,
            frame: None,
            file: file.to_owned(),
            from,
            is_picture: false,
            notes: vec![],
        }
    }

    /// Takes what is said of the depth in place of what is usual.
    pub(super) fn told(mut self, words: DepthWords<'_>) -> Result<Self, SceneError> {
        self.kind = words.kind.unwrap_or(self.kind);
        if let Some(unit) = words.unit {
            self.unit = DepthUnit::parse(unit)?;
        }
        let is_disparity = matches!(self.kind, DepthKind::Disparity { .. });
        if is_disparity && words.unit.is_none() {
            self.unit = DepthUnit::Samples(1.0);
        }
        let is_inverse = !(is_disparity || matches!(self.kind, DepthKind::Axial | DepthKind::Radial));
        let is_length = |unit: &str| ["mm", "cm"].iter().any(|length| unit.ends_with(length));
        let fits = match self.unit {
            DepthUnit::Samples(_) => is_disparity,
            // An inverse distance is so many a metre, and a number of a buffer so many codes in place of 1.
            DepthUnit::Metres(_) => !(is_disparity || is_inverse && words.unit.is_some_and(is_length)),
        };
        if fits {
            return self.between_anchors(words.unit.is_some());
        }
        Err(SceneError::Setting {
            what: "the unit of the depth",
            value: format!("'{}'", words.unit.unwrap_or_default()),
            expected: "px or 256/px for a disparity, m or 1000/m for an inverse distance or so many codes of a buffer, a length for all else"
                .to_owned(),
        })
    }

    /// Makes inverse distances of numbers between two that are told: the smallest and the largest, those of all the file before a part of them is
    /// taken, or the ends of a depth buffer, of which a unit may be told.
    fn between_anchors(mut self, has_unit: bool) -> Result<Self, SceneError> {
        let one = match (self.unit, self.top.filter(|_| !has_unit)) {
            (_, Some(top)) => top,
            (DepthUnit::Metres(factor) | DepthUnit::Samples(factor), None) => 1.0 / factor,
        };
        let is_buffer = matches!(self.kind, DepthKind::Buffer { .. } | DepthKind::Ndc { .. });
        if is_buffer
            && has_unit
            && one > 1.0
            && let Some(other) = self.values.iter().find(|v| v.is_finite() && v.fract() != 0.0)
        {
            let reason = format!("it holds {other}, expected whole numbers up to {one}, as --depth-unit says");
            return Err(unreadable(&self.file, reason));
        }
        // Buffers of 24 bits are read back as numbers of 32.
        let in_24_bits = |v: &f32| !v.is_finite() || v.abs() <= OF_24_BITS;
        if is_buffer && !has_unit && one > f64::from(OF_24_BITS) && self.values.iter().all(in_24_bits) {
            let reason = format!(
                "its numbers have 32 bits, of which 24 hold them all: expected --depth-unit {OF_24_BITS}/m (1 is the last of 24 bits) \
                 or {one}/m"
            );
            return Err(unreadable(&self.file, reason));
        }
        let ([low, high], [low_m, high_m]) = match self.kind {
            DepthKind::InverseBetween { near_m, far_m } => {
                let finite = self.values.iter().copied().filter(|v| v.is_finite()).map(f64::from);
                let ends = finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)]);
                (ends, [far_m, near_m])
            }
            DepthKind::Buffer { near_m, far_m } => ([0.0, one], [near_m, far_m]),
            DepthKind::Ndc { near_m, far_m } => ([-one, one], [near_m, far_m]),
            _ => return Ok(self),
        };
        if high.partial_cmp(&low) != Some(std::cmp::Ordering::Greater) {
            return Err(unreadable(&self.file, "its numbers are all alike, expected some between two anchors"));
        }
        // Rounding may leave the ends.
        let ends = low - 1e-6 * (high - low)..=high + 1e-6 * (high - low);
        if let Some(other) = self.values.iter().find(|v| v.is_finite() && !ends.contains(&f64::from(**v))) {
            let reason = format!("it holds {other}, expected numbers from {low} to {high}, as depth buffers have them");
            return Err(unreadable(&self.file, reason));
        }
        self.values.mapv_inplace(|v| {
            let share = (f64::from(v) - low) / (high - low);
            if v.is_finite() { (1.0 / low_m + share * (1.0 / high_m - 1.0 / low_m)) as f32 } else { v }
        });
        self.unit = DepthUnit::Metres(1.0);
        Ok(self)
    }

    /// Returns the depths of so many samples at a place of a picture, where the file has depths of that picture or of a part of it; those of
    /// another picture as they are. Where the file has none they are no numbers.
    pub(super) fn laid_on(mut self, frame: Frame, (rows, columns): (usize, usize)) -> Self {
        let (own_rows, own_columns) = self.values.dim();
        let own = self.frame.unwrap_or(Frame::whole(own_rows, own_columns));
        let is_of_frame = (own.columns, own.rows) == (frame.columns, frame.rows);
        let is_placed = (own.x0, own.y0, own_rows, own_columns) == (frame.x0, frame.y0, rows, columns);
        // Of a picture with more or fewer samples all of it is taken.
        let (wanted, (rows, columns)) = match is_of_frame {
            true if is_placed => return self,
            true => (frame, (rows, columns)),
            false if own.is_whole(own_rows, own_columns) => return self,
            false => (Frame { x0: 0, y0: 0, ..own }, (own.rows, own.columns)),
        };
        let at = |index: usize, wanted: i64, own: i64, n: usize| {
            usize::try_from(index as i64 + wanted - own).ok().filter(|at| *at < n)
        };
        self.values = Array2::from_shape_fn((rows, columns), |(row, column)| {
            let place = at(row, wanted.y0, own.y0, own_rows).zip(at(column, wanted.x0, own.x0, own_columns));
            place.map_or(f32::NAN, |place| self.values[place])
        });
        self
    }

    /// Returns the depths on so many samples, those of the nearest of the file's: no depth is mixed of two.
    pub(super) fn resized(mut self, rows: usize, columns: usize) -> Result<Self, SceneError> {
        let (own_rows, own_columns) = self.values.dim();
        if (own_rows, own_columns) == (rows, columns) {
            return Ok(self);
        }
        let (across, down) = (own_columns as f64 / columns as f64, own_rows as f64 / rows as f64);
        // Half a sample of either may be cut off.
        if (across / down - 1.0).abs() > 1.0 / rows.min(own_rows).min(columns).min(own_columns) as f64 {
            let reason = format!(
                "it has {own_columns} × {own_rows} samples, but the scene {columns} × {rows}: expected as many, or a picture of \
                 the same shape"
            );
            return Err(unreadable(&self.file, reason));
        }
        let at = |index: usize, ratio: f64, most: usize| (((index as f64 + 0.5) * ratio) as usize).min(most - 1);
        let counted = match self.kind {
            DepthKind::Disparity { .. } => "; its disparities count its own samples",
            _ => "",
        };
        self.notes.push(format!(
            "{}: its {own_columns} × {own_rows} depths become {columns} × {rows}, each that of the nearest sample{counted}",
            name_of(&self.file)
        ));
        self.columns_per_column *= across;
        self.values = Array2::from_shape_fn((rows, columns), |(row, column)| {
            self.values[(at(row, down, own_rows), at(column, across, own_columns))]
        });
        Ok(self)
    }

    /// Whether a number of lengths stands for none.
    fn is_none(&self, value: f32) -> bool {
        let top = match self.top {
            Some(top) => TOPS.contains(&top).then_some(top as f32),
            None => Some(LARGEST_HALF),
        };
        NONES.contains(&value) || top == Some(value)
    }

    /// Returns the depths in metres along the axis; 0 where none was measured, infinity for the sky. `None` for what needs the
    /// view of the samples and has none.
    pub(super) fn axial_m(&self, view: Option<View>) -> Option<Array2<f32>> {
        let is_none = |value: f32| self.is_none(value);
        let factor = match self.unit {
            DepthUnit::Metres(factor) | DepthUnit::Samples(factor) => factor,
        };
        let along = |z_m: f64| if z_m >= SKY_M { f32::INFINITY } else { z_m as f32 };
        Some(match self.kind {
            DepthKind::Axial => self.values.mapv(|v| if is_none(v) { 0.0 } else { along(factor * f64::from(v)) }),
            DepthKind::Radial => {
                let view = view?;
                Array2::from_shape_fn(self.values.dim(), |(row, column)| {
                    let v = self.values[(row, column)];
                    let z_m = factor * f64::from(v) / view.distance_per_depth(row as f64, column as f64);
                    if is_none(v) { 0.0 } else { along(z_m) }
                })
            }
            // The inverse of nothing is the sky; what is no number was not measured.
            DepthKind::Inverse
            | DepthKind::InverseBetween { .. }
            | DepthKind::Buffer { .. }
            | DepthKind::Ndc { .. } => self.values.mapv(|v| {
                let inverse = f64::from(v) * factor;
                // The sum has no 0 below 0.
                if v.is_finite() { along(1.0 / (inverse + 0.0)) } else { 0.0 }
            }),
            DepthKind::Disparity { baseline_m, offset_px } => {
                let view = view?;
                // A disparity counts the file's own samples.
                let focal_px = view.focal_px * self.columns_per_column;
                self.values.mapv(|v| {
                    let shift_px = factor * f64::from(v) + offset_px;
                    let is_measured = v.is_finite() && v > 0.0 && shift_px > 0.0;
                    if is_measured { along(focal_px * baseline_m / shift_px) } else { 0.0 }
                })
            }
        })
    }

    /// Returns the words for where the depth comes from.
    pub(super) fn describe(&self) -> String {
        let kind = match self.kind {
            DepthKind::Axial => "along the axis",
            DepthKind::Radial => "from distances from the camera",
            DepthKind::Inverse | DepthKind::InverseBetween { .. } => "from inverse distances",
            DepthKind::Buffer { .. } | DepthKind::Ndc { .. } => "from a depth buffer",
            DepthKind::Disparity { .. } => "from disparities",
        };
        format!("{kind}, of {}", self.from)
    }
}
