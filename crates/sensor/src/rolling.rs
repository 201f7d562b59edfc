//! Frames whose rows are exposed one after the other while the image moves.

use ndarray::{Array2, ArrayView2};
use rayon::prelude::*;

use crate::{
    Cfa, ElectronRate, ExitPupil, Illumination, ReadLines, Sensor, SensorError, Tile, collect::after_filters,
    motion::keys,
};

/// When the rows of a frame are exposed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RollingShutter {
    /// When the exposure of the first row begins, s.
    pub start_s: f64,
    /// How long each row is exposed, s.
    pub exposure_s: f64,
    /// From the start of one row to that of the next, s; 0 for a global shutter.
    pub row_time_s: f64,
    /// Which rows are read, and so exposed, as one.
    pub rows: ReadLines,
}

impl RollingShutter {
    /// Returns when the middle of the exposure of a row of pixels is, s.
    pub fn middle_s(&self, row: usize) -> f64 {
        self.begin_s(row) + 0.5 * self.exposure_s
    }

    /// Returns when the exposure of a row of pixels begins, s.
    fn begin_s(&self, row: usize) -> f64 {
        self.start_s + self.row_time_s * self.rows.read_in(row) as f64
    }
}

/// Where a moving camera sees what: from a place of its frame to that of an image at rest.
///
/// Both are homogeneous: samples to the right of the middle of the frame or image, samples down from it, and 1. The matrix is row by row.
pub type ImagePlace = [[f64; 3]; 3];

/// The farthest, samples, that an image moves between two of the instants over which an exposure is summed.
const STEP_PX: f64 = 0.5;
/// The most instants of an exposure.
const MOST_INSTANTS: usize = 64;

impl Sensor {
    /// Returns the rate of electrons that each filter would have in each pixel: a plane a filter, from which moving frames are taken.
    ///
    /// What depends on the place of a pixel on the sensor (chief-ray response) and what follows the filters (electrical crosstalk) is left to
    /// [`rolling_rate`](Self::rolling_rate).
    ///
    /// # Errors
    /// As [`electron_rate`](Self::electron_rate).
    pub fn filter_rates(&self, light: &Illumination<'_>) -> Result<ElectronRate, SensorError> {
        let every = Self { cfa: Cfa::Stacked, electrical_crosstalk: None, ..self.clone() };
        every.electron_rate(&Illumination { exit_pupil: None, ..*light })
    }

    /// Returns the mean rate of electrons of a frame of `size` rows and columns over the time for which each row is exposed, while the camera
    /// moves.
    ///
    /// `still` has the [`filter_rates`](Self::filter_rates) of an image at rest, which may be larger than the frame; beyond it its outermost samples
    /// go on. `place_at` tells at a time, s, where the camera sees what. The exposure of a row is the mean over instants between which no
    /// corner of the frame moves by more than half a sample (64 at most); between samples the image is a cubic convolution (Keys 1981), cut
    /// at 0.
    ///
    /// # Errors
    /// When the sensor makes no sense.
    pub fn rolling_rate(
        &self,
        still: &ElectronRate,
        size: (usize, usize),
        shutter: &RollingShutter,
        place_at: &(dyn Fn(f64) -> ImagePlace + Sync),
        exit_pupil: Option<ExitPupil>,
    ) -> Result<ElectronRate, SensorError> {
        self.check()?;
        let tile = self.tile()?;
        let planes = (0..self.n_planes()).map(|number| {
            let tile = tile.clone().unwrap_or_else(|| Tile::single(number));
            let mut rate = Array2::<f32>::zeros(size);
            rate.outer_iter_mut().into_par_iter().enumerate().for_each(|(row, mut values)| {
                let places = places_of_row(row, size, shutter, place_at);
                let share = (places.len() as f32).recip();
                let filters = tile.row(row % tile.rows());
                for (column, value) in values.iter_mut().enumerate() {
                    let plane = still.planes_e_per_s[filters[column % filters.len()]].view();
                    let sum: f32 = places.iter().map(|place| sample(&plane, seen_at(place, (row, column), size))).sum();
                    *value = share * sum;
                }
            });
            rate
        });
        Ok(after_filters(self, exit_pupil, planes.collect()))
    }
}

/// Returns where the camera sees what at instants evenly spread over the exposure of a row.
fn places_of_row(
    row: usize,
    size: (usize, usize),
    shutter: &RollingShutter,
    place_at: &(dyn Fn(f64) -> ImagePlace + Sync),
) -> Vec<ImagePlace> {
    let start_s = shutter.begin_s(row);
    let at = |share: f64| place_at(start_s + share * shutter.exposure_s);
    const PARTS: usize = 8;
    // A camera that shakes may be back where it was at the end.
    let ends: Vec<[[f64; 2]; 2]> = (0..=PARTS)
        .map(|part| at(part as f64 / PARTS as f64))
        .map(|place| [0, size.1 - 1].map(|column| seen_at(&place, (row, column), size)))
        .collect();
    let way = |end: usize| -> f64 {
        ends.windows(2).map(|pair| (pair[1][end][0] - pair[0][end][0]).hypot(pair[1][end][1] - pair[0][end][1])).sum()
    };
    let n = (way(0).max(way(1)) / STEP_PX).ceil().clamp(1.0, MOST_INSTANTS as f64) as usize;
    (0..n).map(|i| at((i as f64 + 0.5) / n as f64)).collect()
}

/// Returns the place of the image at rest, samples to the right of its middle and down, that a pixel of the frame sees.
fn seen_at(place: &ImagePlace, (row, column): (usize, usize), (rows, columns): (usize, usize)) -> [f64; 2] {
    let right = column as f64 - 0.5 * (columns as f64 - 1.0);
    let down = row as f64 - 0.5 * (rows as f64 - 1.0);
    let [x, y, z] = [0, 1, 2].map(|i| place[i][0] * right + place[i][1] * down + place[i][2]);
    [x / z, y / z]
}

/// Returns the value of a plane at samples to the right of its middle and down.
fn sample(plane: &ArrayView2<'_, f32>, [right, down]: [f64; 2]) -> f32 {
    let (rows, columns) = plane.dim();
    let ((row, down), (column, right)) = (tap(down, rows), tap(right, columns));
    let at = |first: isize, tap: usize, n: usize| (first + tap as isize).clamp(0, n as isize - 1) as usize;
    let line = |i: usize| -> f32 {
        let line = plane.row(at(row, i, rows));
        (0..4).map(|j| right[j] * line[at(column, j, columns)]).sum()
    };
    (0..4).map(|i| down[i] * line(i)).sum::<f32>().max(0.0)
}

/// Returns the first of the four samples about a place, and their weights.
fn tap(from_middle: f64, n: usize) -> (isize, [f32; 4]) {
    // What rounding leaves of a whole number is no fraction.
    let place = from_middle + 0.5 * (n as f64 - 1.0);
    let place = if (place - place.round()).abs() < 1e-9 { place.round() } else { place };
    let whole = place.floor();
    (whole as isize - 1, keys(place - whole))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (60, 80);

    /// A bright upright line on an image 20 samples larger than the frame all around, a Gaussian of 1.5 samples.
    fn line() -> ElectronRate {
        let plane = Array2::from_shape_fn((SIZE.0 + 40, SIZE.1 + 40), |(_, column)| {
            let x = column as f64 - 0.5 * (SIZE.1 as f64 + 39.0);
            (1e4 * (-0.5 * (x / 1.5).powi(2)).exp()) as f32
        });
        ElectronRate { planes_e_per_s: vec![plane] }
    }

    fn sensor() -> Sensor {
        Sensor::built_in("machine-vision-mono").unwrap().with_size(SIZE.0, SIZE.1)
    }

    /// A frame that moves to the right over the image, so that what it shows moves to the left.
    fn moving(px_per_s: f64) -> impl Fn(f64) -> ImagePlace {
        move |time_s| [[1.0, 0.0, px_per_s * time_s], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    }

    fn moments(rate: &ElectronRate, row: usize) -> (f64, f64) {
        let line = rate.planes_e_per_s[0].row(row);
        let x = |column: usize| column as f64 - 0.5 * (SIZE.1 as f64 - 1.0);
        let sum: f64 = line.iter().map(|&v| f64::from(v)).sum();
        let mean = line.iter().enumerate().map(|(c, &v)| f64::from(v) * x(c)).sum::<f64>() / sum;
        let square = line.iter().enumerate().map(|(c, &v)| f64::from(v) * (x(c) - mean).powi(2)).sum::<f64>() / sum;
        (mean, square)
    }

    #[test]
    fn a_camera_at_rest_sees_the_image() {
        let shutter = RollingShutter { start_s: 0.4, exposure_s: 0.01, row_time_s: 1e-4, rows: ReadLines::SINGLE };
        let rate = sensor().rolling_rate(&line(), SIZE, &shutter, &moving(0.0), None).unwrap();
        assert_eq!(rate.planes_e_per_s[0], line().planes_e_per_s[0].slice(ndarray::s![20..80, 20..100]));
    }

    /// Row r sees the line where it is at its own time: 400 px/s and 2 × 10⁻⁴ s a row slant it by .08 of a pixel a row.
    #[test]
    fn an_upright_line_slants_by_the_way_in_a_row_time() {
        let shutter = RollingShutter { start_s: 0.0, exposure_s: 1e-3, row_time_s: 2e-4, rows: ReadLines::SINGLE };
        let rate = sensor().rolling_rate(&line(), SIZE, &shutter, &moving(400.0), None).unwrap();
        let (first, last) = (moments(&rate, 0).0, moments(&rate, 59).0);
        // Cubic convolution keeps first moments; single floats.
        assert!((last - first + 59.0 * 0.08).abs() < 1e-3, "{first} {last}");
        // The middle of the first row's exposure is at half a millisecond.
        assert!((first + 0.2).abs() < 1e-3, "{first}");
        let global = RollingShutter { row_time_s: 0.0, ..shutter };
        let rate = sensor().rolling_rate(&line(), SIZE, &global, &moving(400.0), None).unwrap();
        assert!((moments(&rate, 59).0 - moments(&rate, 0).0).abs() < 1e-6);
    }

    /// A way of w during the exposure adds w² / 12 to the variance of the line.
    #[test]
    fn motion_during_the_exposure_blurs() {
        let shutter = RollingShutter { start_s: -0.005, exposure_s: 0.01, row_time_s: 0.0, rows: ReadLines::SINGLE };
        let blurred = sensor().rolling_rate(&line(), SIZE, &shutter, &moving(800.0), None).unwrap();
        let ((mean, variance), (_, still)) = (moments(&blurred, 30), moments(&line_frame(), 30));
        assert!(mean.abs() < 1e-3, "{mean}");
        // 16 instants of steps of half a sample: their own variance is 1/256 less, what lies between samples some thousandths.
        assert!(((variance - still) / (64.0 / 12.0) - 1.0).abs() < 0.01, "{variance} {still}");
    }

    fn line_frame() -> ElectronRate {
        ElectronRate { planes_e_per_s: vec![line().planes_e_per_s[0].slice(ndarray::s![20..80, 20..100]).to_owned()] }
    }

    #[test]
    fn filters_of_a_mosaic_see_the_same_place() {
        use dioptric_spectrum::{Quantity, SpectralImage, WavelengthGrid};
        let sensor = Sensor::built_in("imx363").unwrap().with_size(8, 8);
        let grid = WavelengthGrid::uniform(450.0, 650.0, 100.0).unwrap();
        let plane = |k: usize| Array2::from_shape_fn((8, 8), move |(r, c)| 1e-3 * (1 + k + r * 3 + c) as f32);
        let image = SpectralImage::new(Quantity::Irradiance, grid, (0..3).map(plane).collect()).unwrap();
        let light = Illumination::on_pixels(&image);
        let shutter = RollingShutter { start_s: 0.0, exposure_s: 0.01, row_time_s: 1e-5, rows: ReadLines::SINGLE };
        let still = sensor.filter_rates(&light).unwrap();
        let rate = sensor.rolling_rate(&still, (8, 8), &shutter, &moving(0.0), None).unwrap();
        let expected = sensor.electron_rate(&light).unwrap();
        for (found, expected) in rate.planes_e_per_s[0].iter().zip(&expected.planes_e_per_s[0]) {
            assert!((found - expected).abs() <= 1e-6 * expected, "{found} {expected}");
        }
    }
}
