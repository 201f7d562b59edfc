//! The aberrations of a lens that a picture is freed of: distortion, lateral color and vignetting, from tables over the frame.

mod frame_table;
mod warp;

use ndarray::Array2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use frame_table::FrameTable;
pub(crate) use warp::{sample as sample_at, warp};

use self::frame_table::stencils;
use crate::{SensorError, Tile};

/// Which aberrations of its lens a picture is freed of; [`LensTables`] know them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct LensCorrections {
    /// Straight lines of the scene become straight; the middle of the picture keeps its scale, unless the frame must be enlarged
    /// so that nothing beyond it is seen.
    pub distortion: bool,
    /// The channels are laid over each other.
    pub lateral_color: bool,
    /// An even surface becomes even: the fall of light towards the corners is undone, as `shading` does by a given table.
    pub vignetting: bool,
}

impl LensCorrections {
    /// All of them.
    pub const ALL: Self = Self { distortion: true, lateral_color: true, vignetting: true };

    /// Whether there is nothing to do.
    pub fn is_none(self) -> bool {
        self == Self::default()
    }

    /// Whether places of the picture change.
    pub fn moves(self) -> bool {
        self.distortion || self.lateral_color
    }

    /// Returns the corrections of a list: `all`, `none`, or names separated by commas.
    ///
    /// # Errors
    /// When a name is not known.
    pub fn parse(list: &str) -> Result<Self, SensorError> {
        match list.trim().to_ascii_lowercase().as_str() {
            "all" => return Ok(Self::ALL),
            "none" => return Ok(Self::default()),
            _ => {}
        }
        list.split(',').map(|word| word.trim().to_ascii_lowercase().replace('_', "-")).try_fold(
            Self::default(),
            |chosen, word| match word.as_str() {
                "distortion" => Ok(Self { distortion: true, ..chosen }),
                "lateral-color" => Ok(Self { lateral_color: true, ..chosen }),
                "vignetting" => Ok(Self { vignetting: true, ..chosen }),
                _ => Err(SensorError::Word {
                    what: "a lens correction",
                    found: word,
                    expected: "all, none, distortion, lateral-color, vignetting".to_owned(),
                }),
            },
        )
    }
}

/// A displacement over the frame, pixels to the right and down.
pub type Displacement = [FrameTable; 2];

/// What a lens does to a frame, whatever it is of which they are known.
#[derive(Clone, Debug, PartialEq)]
pub struct LensTables {
    /// Rows and columns of the frame.
    pub size: (usize, usize),
    /// For places of the corrected picture: where the frame has their light, as one channel sees it, counted from the place.
    pub distortion_px: Displacement,
    /// For each channel and places of the frame: where it has the light that this one channel has there, counted from the place.
    pub lateral_color_px: Vec<Displacement>,
    /// For each channel and places of the frame: the factor that makes an even surface even, 1 or more.
    pub vignetting: Vec<FrameTable>,
}

impl LensTables {
    /// Checks that the tables are those of a frame with so many channels.
    ///
    /// # Errors
    /// When the size of the frame, the number of channels, or the sizes of the tables do not agree.
    pub fn check(&self, size: (usize, usize), n_channels: usize) -> Result<(), SensorError> {
        let text = |(rows, columns): (usize, usize)| format!("{rows} × {columns}");
        let wrong = |what, expected: String, found: String| Err(SensorError::Shape { what, expected, found });
        if self.size != size {
            return wrong("rows × columns of the frame of the lens tables", text(size), text(self.size));
        }
        for (what, n) in [
            ("channels of the lens tables' lateral color", self.lateral_color_px.len()),
            ("channels of the lens tables' vignetting", self.vignetting.len()),
        ] {
            if n != n_channels {
                return wrong(what, n_channels.to_string(), n.to_string());
            }
        }
        let nodes = self.distortion_px[0].nodes();
        let all = self.distortion_px.iter().chain(self.lateral_color_px.iter().flatten()).chain(&self.vignetting);
        match all.into_iter().find(|table| table.nodes() != nodes) {
            Some(table) => wrong("nodes of the lens tables", text(nodes), text(table.nodes())),
            None => Ok(()),
        }
    }

    /// Returns, for places of the corrected picture, where the frame has the light of a channel, counted from the place.
    pub fn source_px(&self, channel: usize, corrections: LensCorrections) -> Displacement {
        let lateral = &self.lateral_color_px[channel];
        let distortion = &self.distortion_px;
        match (corrections.distortion, corrections.lateral_color) {
            (false, false) => [0, 1].map(|i| distortion[i].map(|_, _| 0.0)),
            (true, false) => distortion.clone(),
            (false, true) => lateral.clone(),
            (true, true) => {
                let (rows, columns) = (self.size.0 as f64, self.size.1 as f64);
                [0, 1].map(|i| {
                    distortion[i].map(|down, right| {
                        let moved = [0, 1].map(|k| distortion[k].at(down, right));
                        moved[i] + lateral[i].at(down + moved[1] / rows, right + moved[0] / columns)
                    })
                })
            }
        }
    }

    /// Multiplies each sample by the factor that undoes vignetting.
    pub(crate) fn even_out(&self, planes: &mut [Array2<f32>], tile: Option<&Tile>) {
        for (number, plane) in planes.iter_mut().enumerate() {
            let (n_rows, n_columns) = plane.dim();
            let along = stencils(n_columns, self.vignetting[0].nodes().1);
            plane.outer_iter_mut().into_par_iter().enumerate().for_each(|(row, mut values)| {
                let filters = tile.map_or(std::slice::from_ref(&number), |tile| tile.row(row));
                let down = (row as f64 + 0.5) / n_rows as f64;
                let lines: Vec<_> = filters.iter().map(|&filter| self.vignetting[filter].line(down)).collect();
                for ((value, stencil), line) in values.iter_mut().zip(&along).zip(lines.iter().cycle()) {
                    *value *= line.with_stencil(stencil) as f32;
                }
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Adc, ElectronRate, Exposure, Noise, Processing, Raw, Sensor, WhiteBalance};
    use approx::assert_abs_diff_eq;

    const SIZE: (usize, usize) = (240, 320);

    /// Tables of 17 × 17 nodes of functions of the place, shares of the frame down and to the right.
    fn tables(
        distortion: impl Fn(f64, f64) -> [f64; 2],
        lateral: impl Fn(usize, f64, f64) -> [f64; 2],
        factor: impl Fn(f64, f64) -> f64,
        n_channels: usize,
    ) -> LensTables {
        let table = |value: &dyn Fn(f64, f64) -> f64| FrameTable::tabulate(17, 17, value).unwrap();
        LensTables {
            size: SIZE,
            distortion_px: [0, 1].map(|i| table(&|down, right| distortion(down, right)[i])),
            lateral_color_px: (0..n_channels)
                .map(|c| [0, 1].map(|i| table(&|down, right| lateral(c, down, right)[i])))
                .collect(),
            vignetting: (0..n_channels).map(|_| table(&factor)).collect(),
        }
    }

    /// Pixels to the right of the middle and down of a place.
    fn from_middle(down: f64, right: f64) -> [f64; 2] {
        [(right - 0.5) * SIZE.1 as f64, (down - 0.5) * SIZE.0 as f64]
    }

    /// Barrel distortion of 5 % in the corners, 200 pixels from the middle.
    fn barrel(down: f64, right: f64) -> [f64; 2] {
        let [x, y] = from_middle(down, right);
        let k = -0.05 * (x * x + y * y) / 200.0_f64.powi(2);
        [k * x, k * y]
    }

    fn stacked_raw(planes: Vec<Array2<f32>>) -> (Sensor, Raw) {
        let mut sensor = Sensor::built_in("ideal").unwrap().with_size(SIZE.0, SIZE.1);
        sensor.adc = Adc::Analog;
        let exposure = Exposure::seconds(0.01);
        let scale = (0.5 * sensor.saturation_e(&exposure) / 0.01) as f32;
        let rate = ElectronRate { planes_e_per_s: planes.into_iter().map(|plane| plane * scale).collect() };
        let electrons = sensor.electrons(&rate, &exposure, &Noise::none()).unwrap();
        let raw = sensor.digitize(&sensor.volts(&electrons, &exposure, &Noise::none()).unwrap(), &exposure).unwrap();
        (sensor, raw)
    }

    /// A smooth pattern whose value at any place is known.
    fn pattern(x: f64, y: f64) -> f64 {
        0.5 + 0.3 * (x / 7.0).sin() * (y / 9.0).cos()
    }

    fn processing(lens_corrections: LensCorrections) -> Processing {
        let mut processing = Processing { lens_corrections, white: WhiteBalance::None, ..Processing::plain() };
        processing.color = crate::ColorCorrection::None;
        processing
    }

    #[test]
    fn each_is_undone_by_itself_and_with_the_others() {
        let lateral = |c: usize, down: f64, right: f64| from_middle(down, right).map(|v| 0.01 * (c as f64 - 1.0) * v);
        let factor = |down: f64, right: f64| {
            let [x, y] = from_middle(down, right);
            1.0 + 0.8 * (x * x + y * y) / 200.0_f64.powi(2)
        };
        let tables = tables(barrel, lateral, factor, 3);
        for bits in 0..8_u8 {
            let on = |bit: u8| bits >> bit & 1 == 1;
            let corrections = LensCorrections { distortion: on(0), lateral_color: on(1), vignetting: on(2) };
            // What the lens makes of the pattern: exact, by the inverse of the tables' functions.
            let planes = (0..3)
                .map(|c| {
                    Array2::from_shape_fn(SIZE, |(row, column)| {
                        let (down, right) = ((row as f64 + 0.5) / 240.0, (column as f64 + 0.5) / 320.0);
                        let place = from_middle(down, right);
                        let share = |[x, y]: [f64; 2]| (y / 240.0 + 0.5, x / 320.0 + 0.5);
                        let back = |at: [f64; 2], moved: &dyn Fn(f64, f64) -> [f64; 2]| {
                            (0..60).fold(at, |seen, _| {
                                let (down, right) = share(seen);
                                let by = moved(down, right);
                                [at[0] - by[0], at[1] - by[1]]
                            })
                        };
                        let mut seen = place;
                        if corrections.lateral_color {
                            seen = back(seen, &|down, right| lateral(c, down, right));
                        }
                        if corrections.distortion {
                            seen = back(seen, &barrel);
                        }
                        let dimmer = if corrections.vignetting { factor(down, right) } else { 1.0 };
                        (pattern(seen[0], seen[1]) / dimmer) as f32
                    })
                })
                .collect();
            let (sensor, raw) = stacked_raw(planes);
            let light = sensor.develop_linear_with(&raw, &processing(corrections), Some(&tables)).unwrap().light;
            for ((row, column, channel), &value) in light.indexed_iter() {
                let [x, y] = from_middle((row as f64 + 0.5) / 240.0, (column as f64 + 0.5) / 320.0);
                // The cubic is off by some thousandths of this pattern's amplitude between pixels; at the borders samples
                // that are not there are missing.
                if (8..232).contains(&row) && (8..312).contains(&column) {
                    let error = f64::from(value) - 0.5 * pattern(x, y);
                    assert!(error.abs() < 1.5e-3, "{corrections:?}: {row} {column} {channel}: {error}");
                }
            }
        }
    }

    #[test]
    fn what_the_frame_does_not_hold_is_black() {
        // Light from 20 pixels to the left, which the first 20 columns cannot have; 4 of them take the border's.
        let tables = tables(|_, _| [-20.0, 0.0], |_, _, _| [0.0; 2], |_, _| 1.0, 3);
        let (sensor, raw) = stacked_raw(vec![Array2::from_elem(SIZE, 1.0); 3]);
        let corrections = LensCorrections { distortion: true, ..LensCorrections::default() };
        let light = sensor.develop_linear_with(&raw, &processing(corrections), Some(&tables)).unwrap().light;
        assert_eq!((light[(100, 15, 1)], light[(100, 10, 0)]), (0.0, 0.0));
        assert_abs_diff_eq!(light[(100, 17, 1)], 0.5, epsilon = 1e-3);
    }

    #[test]
    fn corrections_without_tables_or_with_others_are_refused() {
        let (sensor, raw) = stacked_raw(vec![Array2::from_elem(SIZE, 1.0); 3]);
        let all = processing(LensCorrections::ALL);
        let message = sensor.develop(&raw, &all).unwrap_err().to_string();
        assert!(message.contains("lens_corrections"), "{message}");
        let two = tables(barrel, |_, _, _| [0.0; 2], |_, _| 1.0, 2);
        assert!(sensor.develop_with(&raw, &all, Some(&two)).is_err());
        let smaller = LensTables { size: (10, 10), ..tables(barrel, |_, _, _| [0.0; 2], |_, _| 1.0, 3) };
        assert!(sensor.develop_with(&raw, &all, Some(&smaller)).is_err());
    }

    #[test]
    fn lists_are_read() {
        let parsed = LensCorrections::parse("distortion, vignetting").unwrap();
        assert_eq!(parsed, LensCorrections { distortion: true, lateral_color: false, vignetting: true });
        assert_eq!(LensCorrections::parse("ALL").unwrap(), LensCorrections::ALL);
        assert!(LensCorrections::parse("none").unwrap().is_none());
        assert!(LensCorrections::parse("distortion,coma").unwrap_err().to_string().contains("'coma'"));
    }
}
