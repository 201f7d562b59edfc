//! Pixels of a sensor that no light reaches, and what is taken off the others by them.

use ndarray::{Array2, Axis, s};

use crate::{
    BinningKind, BlackClamp, Electrons, Exposure, MaskedPixels, Raw, RawPlane, Response, Sensor, SensorError, Volts,
};

/// The most rows or columns that no light reaches.
const MOST: usize = 4096;

impl MaskedPixels {
    /// Returns the samples of a plane that no light reaches.
    pub fn samples(&self, plane: usize) -> Vec<f32> {
        dark_of(&self.planes[plane].samples(), (self.rows, self.columns))
    }
}

impl Sensor {
    /// Returns the rows above and the columns to the left that no light reaches.
    pub(crate) fn masked(&self) -> (usize, usize) {
        self.optical_black.map_or((0, 0), |black| (black.rows, black.columns))
    }

    /// Returns planes within rows and columns that no light reaches.
    pub(crate) fn with_masked(&self, plane: &Array2<f32>) -> Array2<f32> {
        let (rows, columns) = self.masked();
        if (rows, columns) == (0, 0) {
            return plane.as_standard_layout().into_owned();
        }
        let mut all = Array2::zeros((plane.nrows() + rows, plane.ncols() + columns));
        all.slice_mut(s![rows.., columns..]).assign(plane);
        all
    }

    /// Checks what is stated of pixels in the dark.
    pub(crate) fn check_masked(&self) -> Result<(), SensorError> {
        let Some(black) = self.optical_black else { return Ok(()) };
        let tile = self.tile()?;
        let repeats = tile.map_or((1, 1), |tile| (tile.rows(), tile.columns()));
        for (key, n, period) in
            [("optical_black.rows", black.rows, repeats.0), ("optical_black.columns", black.columns, repeats.1)]
        {
            if n > MOST || !n.is_multiple_of(period) {
                let expected = "a multiple of what the mosaic repeats after, 4096 at most";
                return Err(SensorError::value(&self.name, key, n as f64, expected));
            }
        }
        let refused = |reason: String| Err(SensorError::Unsuitable { what: "optical_black.clamp", reason });
        match black.clamp {
            BlackClamp::None => Ok(()),
            _ if self.response != Response::Linear => {
                refused(format!("of {} takes numbers off each other, which needs a linear response", self.name))
            }
            BlackClamp::Row if black.columns == 0 => {
                refused(format!("of {} is by row, which needs columns that no light reaches", self.name))
            }
            BlackClamp::Frame if black.rows + black.columns == 0 => {
                refused(format!("of {} is by frame, which needs rows or columns that no light reaches", self.name))
            }
            _ => Ok(()),
        }
    }

    /// Refuses rows and columns in the dark where something is read that they have no part in.
    pub(crate) fn check_all_lit(&self, what: &'static str) -> Result<(), SensorError> {
        if self.optical_black.is_none() {
            return Ok(());
        }
        let reason = format!("cannot be read beside pixels in the dark, but {} states optical_black", self.name);
        Err(SensorError::Unsuitable { what, reason })
    }

    /// Returns the electrons of the pixels that see light.
    pub fn lit_electrons(&self, electrons: Electrons) -> Electrons {
        match self.masked() {
            (0, 0) => electrons,
            masked => Electrons { planes_e: electrons.planes_e.iter().map(|plane| lit(plane, masked)).collect() },
        }
    }

    /// Returns the voltages of the pixels that see light, those of several that are read as one being one.
    ///
    /// # Errors
    /// When the binning does not go with the sensor.
    pub fn lit_volts(&self, volts: Volts, exposure: &Exposure) -> Result<Volts, SensorError> {
        let is_single = exposure.binning.is_none_or(|binning| binning.kind == BinningKind::Digital);
        let masked = if is_single { self.masked() } else { self.as_read(exposure)?.masked() };
        Ok(match masked {
            (0, 0) => volts,
            masked => Volts { planes_v: volts.planes_v.iter().map(|plane| lit(plane, masked)).collect() },
        })
    }

    /// Returns the number of pixels in the dark whose mean is taken off a pixel, none where nothing is.
    pub(crate) fn n_clamped_by(&self) -> Option<f64> {
        let black = self.optical_black?;
        match black.clamp {
            BlackClamp::None => None,
            BlackClamp::Row => Some(black.columns as f64),
            BlackClamp::Frame => Some((black.rows * (self.columns + black.columns) + black.columns * self.rows) as f64),
        }
    }
}

impl Raw {
    /// Parts a frame, as it was read, into what sees light and what does not, and takes the mean of the latter off the former.
    pub(crate) fn clamped(mut self, sensor: &Sensor) -> Self {
        let Some(black) = sensor.optical_black else { return self };
        let margins = (black.rows, black.columns);
        let planes = std::mem::take(&mut self.planes);
        if black.clamp == BlackClamp::None {
            self.planes = planes.iter().map(|plane| lit_of(plane, margins)).collect();
            self.masked = Some(MaskedPixels { rows: black.rows, columns: black.columns, planes });
            return self;
        }
        let (level, top) = (self.levels.black, self.levels.top);
        let mut lowered = 0.0;
        let n_planes = planes.len() as f64;
        self.planes = planes
            .iter()
            .map(|plane| {
                let samples = plane.samples();
                let of_frame = mean(dark_of(&samples, margins).into_iter());
                let shifts: Vec<f64> = samples
                    .axis_iter(Axis(0))
                    .skip(black.rows)
                    .map(|row| match black.clamp {
                        BlackClamp::Row => mean(row.iter().take(black.columns).copied()) - level,
                        _ => of_frame - level,
                    })
                    .collect();
                lowered += shifts.iter().sum::<f64>() / (shifts.len() as f64 * n_planes);
                let mut lit = lit_of(plane, margins);
                match &mut lit {
                    RawPlane::Dn(dn) => shift_rows(dn, &shifts, |dn, shift| {
                        (f64::from(dn) - shift + 0.5).floor().clamp(0.0, top) as u16
                    }),
                    RawPlane::Volts(volts) | RawPlane::Evened(volts) => {
                        shift_rows(volts, &shifts, |v, shift| (f64::from(v) - shift) as f32);
                    }
                }
                lit
            })
            .collect();
        // What is full is as much below the end of the range as darkness was above its level.
        self.levels = self.levels.lowered(lowered);
        self
    }
}

/// Returns the part of a plane that sees light.
fn lit(plane: &Array2<f32>, (rows, columns): (usize, usize)) -> Array2<f32> {
    plane.slice(s![rows.., columns..]).to_owned()
}

fn lit_of(plane: &RawPlane, margins @ (rows, columns): (usize, usize)) -> RawPlane {
    match plane {
        RawPlane::Dn(dn) => RawPlane::Dn(dn.slice(s![rows.., columns..]).to_owned()),
        RawPlane::Volts(volts) => RawPlane::Volts(lit(volts, margins)),
        RawPlane::Evened(values) => RawPlane::Evened(lit(values, margins)),
    }
}

/// Returns the samples of rows above and columns to the left.
fn dark_of(plane: &Array2<f32>, (rows, columns): (usize, usize)) -> Vec<f32> {
    let above = plane.slice(s![..rows, ..]);
    let left = plane.slice(s![rows.., ..columns]);
    above.iter().chain(left.iter()).copied().collect()
}

fn mean(values: impl Iterator<Item = f32>) -> f64 {
    let (sum, n) = values.fold((0.0, 0_usize), |(sum, n), value| (sum + f64::from(value), n + 1));
    sum / n.max(1) as f64
}

fn shift_rows<T: Copy>(plane: &mut Array2<T>, shifts: &[f64], shifted: impl Fn(T, f64) -> T) {
    for (mut row, &shift) in plane.axis_iter_mut(Axis(0)).zip(shifts) {
        row.mapv_inplace(|value| shifted(value, shift));
    }
}
