//! The data sheet of frames of which pixels are read as one, and the sums that they hold.

use std::borrow::Cow;

use ndarray::Array2;
use rayon::prelude::*;

use crate::{
    Adc, Binning, BinningKind, Cfa, DarkCurrent, Defects, Displacement, Exposure, FrameTable, GainMode, HighGain,
    LensTables, OpticalBlack, RawPlane, ReadLines, Response, Sensor, SensorError, SplitPixel, TelegraphNoise, Tile,
};

impl Sensor {
    /// Returns the rows and the columns that an exposure reads as one.
    ///
    /// # Errors
    /// When the mosaic makes no sense.
    pub fn read_lines(&self, exposure: &Exposure) -> Result<[ReadLines; 2], SensorError> {
        let Some(Binning { pixels, .. }) = exposure.binning else { return Ok([ReadLines::SINGLE; 2]) };
        Ok(match self.tile()? {
            Some(tile) if !is_of_blocks(&tile, pixels) => {
                [tile.rows(), tile.columns()].map(|period| ReadLines { period, pixels })
            }
            _ => [ReadLines { period: 1, pixels }; 2],
        })
    }

    /// Returns which rows are exposed together by a rolling shutter: those whose charges or voltages are read as one.
    ///
    /// # Errors
    /// When the mosaic makes no sense.
    pub fn rows_exposed_as_one(&self, exposure: &Exposure) -> Result<ReadLines, SensorError> {
        match exposure.binning {
            Some(Binning { kind: BinningKind::Digital, .. }) => Ok(ReadLines::SINGLE),
            _ => Ok(self.read_lines(exposure)?[0]),
        }
    }

    /// Returns the data sheet of the frames that an exposure gives: that of the pixels as they are read.
    ///
    /// Their number, pitch, mosaic, wells, gain, noise and converter are those of the pixels that are read as one, so that a frame is developed, merged,
    /// measured and written by it as any other. The rounding of summed numbers is counted once. What takes a frame asks for this sheet itself.
    ///
    /// # Errors
    /// When the binning makes no sense, the sensor has fewer pixels than are read as one, or numbers cannot be summed: the response is no straight
    /// line, there is no converter, or sums have more than 16 bits.
    pub fn as_read(&self, exposure: &Exposure) -> Result<Cow<'_, Self>, SensorError> {
        let Some(binning) = exposure.binning else { return Ok(Cow::Borrowed(self)) };
        binning.check()?;
        let lines = self.read_lines(exposure)?;
        let (rows, columns) = binning.read_size(lines, (self.rows, self.columns))?;
        let optical_black = self.optical_black.map(|black| binning.of_masked(lines, black)).transpose()?;
        let (n, of_n) = (binning.pixels as f64, binning.n() as f64);
        let kind = binning.kind;
        // Over those of a pixel: volts that differ from pixel to pixel, volts that a column or row shares, and volts an electron.
        let (own, shared, gain) = match kind {
            BinningKind::Charge => (1.0, 1.0, 1.0),
            BinningKind::Voltage => (1.0 / n, 1.0, 1.0 / of_n),
            BinningKind::Digital => (n, n.powf(1.5), 1.0),
        };
        let well_e = |pixel_e: f64| match (kind, self.binned_well_e) {
            (BinningKind::Charge, Some(well_e)) => well_e.min(of_n * pixel_e),
            _ => of_n * pixel_e,
        };
        let sheet = Self {
            rows,
            columns,
            optical_black,
            cfa: self.cfa_as_read(lines),
            conversion_gain_v_per_e: gain * self.conversion_gain_v_per_e,
            full_well_e: well_e(self.full_well_e),
            high_gain: self.high_gain.map(|high| HighGain {
                conversion_gain_v_per_e: gain * high.conversion_gain_v_per_e,
                full_well_e: well_e(high.full_well_e),
                read_noise_v: own * high.read_noise_v,
            }),
            split_pixel: self.split_pixel.map(|split| SplitPixel {
                conversion_gain_v_per_e: gain * split.conversion_gain_v_per_e,
                full_well_e: well_e(split.full_well_e),
                read_noise_e: own / gain * split.read_noise_e,
                ..split
            }),
            binned_well_e: None,
            read_noise_v: own * self.read_noise_v(GainMode::Low),
            read_noise_e: None,
            reset_noise_v: own * self.reset_noise_v,
            dark_current: DarkCurrent { e_per_s: of_n * self.dark_current.e_per_s, ..self.dark_current },
            prnu_fraction: self.prnu_fraction / n,
            dsnu_v: own * self.dsnu_v,
            column_offset_v: shared * self.column_offset_v,
            // The mean over the columns that are read as one.
            column_gain_fraction: self.column_gain_fraction / if kind == BinningKind::Digital { n.sqrt() } else { 1.0 },
            row_noise_v: shared * self.row_noise_v,
            defects: Defects {
                hot_fraction: 1.0 - (1.0 - self.defects.hot_fraction).powf(of_n),
                dead_fraction: self.defects.dead_fraction.powf(of_n),
                ..self.defects
            },
            telegraph: TelegraphNoise {
                fraction: match kind {
                    BinningKind::Charge => self.telegraph.fraction,
                    _ => (of_n * self.telegraph.fraction).min(1.0),
                },
                ..self.telegraph
            },
            // A lux second makes as many times more of a full range.
            iso_at_unity_gain: self
                .iso_at_unity_gain
                .map(|iso| if kind == BinningKind::Charge { of_n * iso } else { iso }),
            row_time_us: if kind == BinningKind::Digital { n * self.row_time_us } else { self.row_time_us },
            ..self.with_pitch_um(n * self.pixel_pitch_um)
        };
        Ok(Cow::Owned(if kind == BinningKind::Digital { sheet.with_summed_numbers(binning)? } else { sheet }))
    }

    fn cfa_as_read(&self, [rows, columns]: [ReadLines; 2]) -> Cfa {
        let Cfa::Mosaic(tile) = &self.cfa else { return Cfa::Stacked };
        let first = |lines: ReadLines, n: usize| {
            let n_read = if lines.period == 1 { n.div_ceil(lines.pixels) } else { n };
            (0..n_read).map(move |line| lines.of(line).next().map_or(0, |first| first % n))
        };
        let row = |names: &Vec<String>| first(columns, names.len()).map(|column| names[column].clone()).collect();
        Cfa::Mosaic(first(rows, tile.len()).map(|number| row(&tile[number])).collect())
    }

    /// Returns the data sheet of sums of numbers: their black level, range and bits.
    fn with_summed_numbers(self, binning: Binning) -> Result<Self, SensorError> {
        let refused = |reason: String| Err(SensorError::Unsuitable { what: "digital binning", reason });
        if self.response != Response::Linear {
            return refused(format!("sums numbers, which needs a linear response: {} has another", self.name));
        }
        let n = binning.n();
        let (Adc::Bits { black_level_dn, .. }, Some(top)) = (self.adc, self.adc.top_dn()) else {
            return refused(format!("sums numbers, but {} has no converter", self.name));
        };
        let Ok(sum_top) = u16::try_from(n * usize::from(top)) else {
            return refused(format!("of {n} numbers up to {top} has sums beyond 65535, expected fewer pixels or bits"));
        };
        let (step_v, top_v) = (self.adc.step_v(self.swing_v), self.adc.top_v(self.swing_v));
        let bits = u16::BITS - sum_top.leading_zeros();
        let adc = Adc::Bits { bits, black_level_dn: n as u16 * black_level_dn, step_v };
        Ok(Self { adc, swing_v: n as f64 * top_v, offset_v: n as f64 * self.offset_v, ..self })
    }
}

/// Whether a tile is of blocks of so many pixels each way that have one filter.
fn is_of_blocks(tile: &Tile, pixels: usize) -> bool {
    let block = |i: usize| i - i % pixels;
    tile.rows().is_multiple_of(pixels)
        && tile.columns().is_multiple_of(pixels)
        && (0..tile.rows())
            .all(|r| (0..tile.columns()).all(|c| tile.filter_at(r, c) == tile.filter_at(block(r), block(c))))
}

impl Binning {
    /// Returns the rows and the columns that so many are read as.
    fn read_size(self, [rows, columns]: [ReadLines; 2], size: (usize, usize)) -> Result<(usize, usize), SensorError> {
        let read = (rows.count(size.0), columns.count(size.1));
        if read.0 == 0 || read.1 == 0 {
            let least = [rows, columns].map(|lines| lines.period * lines.pixels);
            let reason = format!(
                "of {0} × {0} pixels needs {1} × {2} of them (rows × columns), found {3} × {4}",
                self.pixels, least[0], least[1], size.0, size.1
            );
            return Err(SensorError::Unsuitable { what: "binning", reason });
        }
        Ok(read)
    }

    /// Returns what rows and columns in the dark are read as.
    fn of_masked(self, [rows, columns]: [ReadLines; 2], black: OpticalBlack) -> Result<OpticalBlack, SensorError> {
        let [of_rows, of_columns] = [rows, columns].map(|lines| lines.period * lines.pixels);
        if !black.rows.is_multiple_of(of_rows) || !black.columns.is_multiple_of(of_columns) {
            let reason = format!(
                "of {0} × {0} pixels needs optical_black in multiples of {of_rows} rows and {of_columns} columns, found {1} and {2}",
                self.pixels, black.rows, black.columns
            );
            return Err(SensorError::Unsuitable { what: "binning", reason });
        }
        Ok(OpticalBlack { rows: rows.count(black.rows), columns: columns.count(black.columns), ..black })
    }

    /// Returns the sums over pixels that are read as one, each times a factor.
    pub(crate) fn sums(
        self,
        lines: [ReadLines; 2],
        plane: &Array2<f32>,
        factor: f64,
    ) -> Result<Array2<f32>, SensorError> {
        self.gathered(lines, plane.dim(), |row, column| f64::from(plane[(row, column)]), |sum| (factor * sum) as f32)
    }

    /// Returns the sums of numbers over pixels that are read as one.
    pub(crate) fn sums_of_numbers(self, lines: [ReadLines; 2], plane: RawPlane) -> Result<RawPlane, SensorError> {
        let RawPlane::Dn(dn) = plane else { return Ok(plane) };
        let number = |row: usize, column: usize| f64::from(dn[(row, column)]);
        Ok(RawPlane::Dn(self.gathered(lines, dn.dim(), number, |sum| sum as u16)?))
    }

    fn gathered<T: Copy + Default + Send>(
        self,
        lines: [ReadLines; 2],
        size: (usize, usize),
        value: impl Fn(usize, usize) -> f64 + Sync,
        of_sum: impl Fn(f64) -> T + Sync,
    ) -> Result<Array2<T>, SensorError> {
        let [of_rows, of_columns] = lines;
        let mut read = Array2::default(self.read_size(lines, size)?);
        let n_columns = read.ncols();
        let rows = read.as_slice_mut().expect("a new array is contiguous").par_chunks_mut(n_columns);
        rows.enumerate().for_each(|(row, values)| {
            for (column, read) in values.iter_mut().enumerate() {
                let pixels = of_rows.of(row).flat_map(|r| of_columns.of(column).map(move |c| (r, c)));
                *read = of_sum(pixels.map(|(r, c)| value(r, c)).sum());
            }
        });
        Ok(read)
    }
}

impl LensTables {
    /// Returns the tables of a frame of which pixels are read as one.
    #[must_use]
    pub fn as_read(&self, sensor: &Sensor, exposure: &Exposure) -> Cow<'_, Self> {
        let (Some(binning), Ok(lines)) = (exposure.binning, sensor.read_lines(exposure)) else {
            return Cow::Borrowed(self);
        };
        let Ok(size) = binning.read_size(lines, self.size) else { return Cow::Borrowed(self) };
        let n = binning.pixels as f64;
        // Lines at the end that are not read are not in the shares of the frame that is.
        let (down, right) = (n * size.0 as f64 / self.size.0 as f64, n * size.1 as f64 / self.size.1 as f64);
        let of = |table: &FrameTable, factor: f64| table.map(|y, x| factor * table.at(down * y, right * x));
        let moved = |tables: &Displacement| [0, 1].map(|i| of(&tables[i], 1.0 / n));
        Cow::Owned(Self {
            size,
            distortion_px: moved(&self.distortion_px),
            lateral_color_px: self.lateral_color_px.iter().map(moved).collect(),
            vignetting: self.vignetting.iter().map(|table| of(table, 1.0)).collect(),
        })
    }
}
