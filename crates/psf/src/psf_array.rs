//! Point spread functions as arrays: measured, or of another program.

use glam::DVec2;
use ndarray::{Array2, Array5, ArrayView2, Axis};

use crate::{PsfError, bundle::rim_over_rms};

/// How far below 0 a sample may be, as a share of the highest one of its function: what transforms and noise leave.
const MOST_BELOW: f32 = 1e-3;
/// The share of the light that is worth a note, and how far below 0 a sample has to be for one.
const OF_NOTE: f64 = 0.01;
const BELOW_OF_NOTE: f32 = 1e-6;

/// The points across the field that functions are of, degrees.
#[derive(Clone, Debug, PartialEq)]
pub enum ArrayFields {
    /// One function for all of them.
    Everywhere,
    /// Angles from the axis, ascending: of points to the right of it. Those of others are turned about the axis.
    Heights(Vec<f64>),
    /// Each angle to the right with each angle upwards, which changes fastest; both ascending.
    Grid {
        /// To the right.
        x_deg: Vec<f64>,
        /// Upwards.
        y_deg: Vec<f64>,
    },
}

/// What point spread functions are of, and their samples.
#[derive(Clone, Debug, PartialEq)]
pub struct PsfArrayParts {
    /// The fields.
    pub fields: ArrayFields,
    /// Distances of points before the first vertex, ascending, mm; the last may be infinite. None where the functions are of all.
    pub distances_mm: Vec<f64>,
    /// Wavelengths, ascending, nm. None where the functions are of all.
    pub wavelengths_nm: Vec<f64>,
    /// The distance between samples, µm: one for all, or one a wavelength.
    pub pitch_um: Vec<f64>,
    /// Light by field, distance, wavelength, row (from the top of the picture) and column (from its left).
    pub samples: Array5<f32>,
}

/// Point spread functions over field, distance and wavelength, each of sum 1.
///
/// They are in the picture frame. The sample at row `rows / 2` and column `columns / 2`, rounded down, lies at the picture of the point: where
/// its chief ray meets the film. Between fields, distances (in dioptres) and wavelengths functions are mixed linearly.
#[derive(Clone, Debug, PartialEq)]
pub struct PsfArray {
    // Invariants: axes ascend and have as many entries as the samples; each function is finite, not below 0, and of sum 1.
    parts: PsfArrayParts,
    /// The sum of each function as it was given.
    sums: Vec<f64>,
    /// Where the middle of the light lies, µm to the right of the middle sample and above it, and its rms radius about that.
    places_um: Vec<(DVec2, f64)>,
    /// The most that a function had below 0, as a share of its highest sample.
    below: f32,
    /// The largest share of the light that lies on the border of the array.
    on_border: f64,
}

fn wrong(key: &'static str, reason: impl Into<String>) -> PsfError {
    PsfError::Array { key, reason: reason.into() }
}

/// Checks that an axis ascends within a range.
fn check_axis(key: &'static str, list: &[f64], range: (f64, f64), expected: &str) -> Result<(), PsfError> {
    let is_within = |v: &f64| *v >= range.0 && *v <= range.1;
    match list.iter().all(is_within) && list.windows(2).all(|pair| pair[0] < pair[1]) {
        true => Ok(()),
        false => Err(wrong(key, format!("they are {}, expected ascending {expected}", shown(list)))),
    }
}

/// Returns a list in words: all of a short one, the ends of a long one.
fn shown(list: &[f64]) -> String {
    let text = |list: &[f64]| list.iter().map(f64::to_string).collect::<Vec<_>>().join(", ");
    match list.len() {
        0..=6 => text(list),
        n => format!("{}, … {}", text(&list[..4]), list[n - 1]),
    }
}

impl ArrayFields {
    fn len(&self) -> usize {
        match self {
            Self::Everywhere => 1,
            Self::Heights(heights) => heights.len(),
            Self::Grid { x_deg, y_deg } => x_deg.len() * y_deg.len(),
        }
    }

    /// Returns each field: to the right and upwards, degrees.
    pub fn all_deg(&self) -> Vec<[f64; 2]> {
        match self {
            Self::Everywhere => vec![[0.0; 2]],
            Self::Heights(heights) => heights.iter().map(|x| [*x, 0.0]).collect(),
            Self::Grid { x_deg, y_deg } => x_deg.iter().flat_map(|x| y_deg.iter().map(move |y| [*x, *y])).collect(),
        }
    }
}

impl PsfArray {
    /// Checks point spread functions and brings each to the sum 1. What is below 0 by less than a thousandth of a function's highest sample
    /// becomes 0.
    ///
    /// # Errors
    /// When an axis does not ascend or has another number of entries than the samples, or a function is dark, below 0 or no number.
    pub fn new(parts: PsfArrayParts) -> Result<Self, PsfError> {
        match &parts.fields {
            ArrayFields::Everywhere => {}
            ArrayFields::Heights(list) => check_axis("fields_deg", list, (0.0, 179.0), "angles from 0 to 179 degrees")?,
            ArrayFields::Grid { x_deg, y_deg } => {
                for list in [x_deg, y_deg] {
                    check_axis("fields_deg", list, (-89.0, 89.0), "angles from -89 to 89 degrees")?;
                }
            }
        }
        check_axis("distances_mm", &parts.distances_mm, (f64::MIN_POSITIVE, f64::INFINITY), "numbers above 0, or inf")?;
        check_axis("wavelengths_nm", &parts.wavelengths_nm, (1.0, 1e6), "numbers from 1 to 1e6")?;
        let n_colors = parts.wavelengths_nm.len().max(1);
        let are_pitches = parts.pitch_um.iter().all(|pitch| *pitch > 0.0 && pitch.is_finite());
        if !are_pitches || !(parts.pitch_um.len() == 1 || parts.pitch_um.len() == n_colors) {
            let expected = format!("expected 1 number above 0, or {n_colors}, one a wavelength");
            return Err(wrong("pitch_um", format!("it is {}, {expected}", shown(&parts.pitch_um))));
        }
        let wanted = [parts.fields.len(), parts.distances_mm.len().max(1), n_colors];
        let found = parts.samples.shape();
        if found[..3] != wanted || found[3] == 0 || found[4] == 0 {
            let reason = format!(
                "they have the shape {found:?}, expected {wanted:?} fields, distances and wavelengths, rows and columns"
            );
            return Err(wrong("samples", reason));
        }
        let mut array = Self { parts, sums: vec![], places_um: vec![], below: 0.0, on_border: 0.0 };
        for index in 0..array.n_functions() {
            array.take_up(index)?;
        }
        Ok(array)
    }

    /// Returns the functions whose transforms these are: by field, distance and wavelength, real and imaginary parts, as
    /// `numpy.fft.fft2` has them of pictures, with frequency 0 at the first row and column or, as `fftshift` leaves it, at row `rows / 2` and
    /// column `columns / 2`, wherever the modulus is greater. Frequencies are `step_per_mm` apart, cycles/mm.
    ///
    /// # Errors
    /// When the arrays are not square and of one shape, or the step is not above 0.
    pub fn samples_of_transfer(
        real: &Array5<f32>,
        imaginary: Option<&Array5<f32>>,
        step_per_mm: f64,
    ) -> Result<(Array5<f32>, f64), PsfError> {
        let shape = real.dim();
        let n = shape.3;
        if n != shape.4 || n == 0 || imaginary.is_some_and(|imaginary| imaginary.dim() != shape) {
            return Err(wrong("otf", format!("it has the shape {:?}, expected as many rows as columns", real.shape())));
        }
        if !(step_per_mm > 0.0 && step_per_mm.is_finite()) {
            return Err(wrong("otf_step_per_mm", format!("it is {step_per_mm}, expected a number above 0")));
        }
        let middle = n / 2;
        let mut samples = Array5::zeros(shape);
        for index in ndarray::indices((shape.0, shape.1, shape.2)) {
            let (i, j, k) = index;
            let plane = |of: &Array5<f32>| {
                let plane = of.index_axis(Axis(0), i);
                plane.index_axis(Axis(0), j).index_axis(Axis(0), k).mapv(f64::from)
            };
            let re = plane(real);
            let im = imaginary.map_or_else(|| Array2::zeros((n, n)), plane);
            let modulus = |at: usize| f64::hypot(re[(at, at)], im[(at, at)]);
            let zero = if modulus(0) >= modulus(middle) { 0 } else { middle };
            // picture[x] = Σ over u of transfer[u] exp(2πi (u − zero)(x − middle) / n), along both axes.
            let phase = |x: usize, u: usize| {
                let product = (x as i64 - middle as i64) * (u as i64 - zero as i64);
                std::f64::consts::TAU * product.rem_euclid(n as i64) as f64 / n as f64
            };
            let cos = Array2::from_shape_fn((n, n), |(x, u)| phase(x, u).cos());
            let sin = Array2::from_shape_fn((n, n), |(x, u)| phase(x, u).sin());
            let (down_re, down_im) = (cos.dot(&re) - sin.dot(&im), sin.dot(&re) + cos.dot(&im));
            let picture = down_re.dot(&cos.t()) - down_im.dot(&sin.t());
            let mut out = samples.index_axis_mut(Axis(0), i);
            let mut out = out.index_axis_mut(Axis(0), j);
            out.index_axis_mut(Axis(0), k).assign(&picture.mapv(|v| v as f32));
        }
        Ok((samples, 1e3 / (n as f64 * step_per_mm)))
    }

    /// Checks a function, brings it to the sum 1 and measures it.
    fn take_up(&mut self, index: usize) -> Result<(), PsfError> {
        let name = self.name(index);
        let pitch_um = self.pitch_um(index % self.n_colors());
        let ((rows, columns), [field, distance, color]) = (self.size(), self.place_of(index));
        let of_field = self.parts.samples.view_mut().index_axis_move(Axis(0), field);
        let mut function = of_field.index_axis_move(Axis(0), distance).index_axis_move(Axis(0), color);
        if function.iter().any(|v| !v.is_finite()) {
            return Err(wrong("samples", format!("{name} has samples that are no numbers")));
        }
        let highest = function.iter().copied().fold(0.0, f32::max);
        let lowest = function.iter().copied().fold(0.0, f32::min);
        if highest <= 0.0 {
            return Err(wrong("samples", format!("{name} is dark, expected light")));
        }
        let below = -lowest / highest;
        if below > MOST_BELOW {
            let reason = format!("{name} has samples of -{below:.3} of its highest one, expected none below 0");
            return Err(wrong("samples", reason));
        }
        function.mapv_inplace(|v| v.max(0.0));
        let sum: f64 = function.iter().map(|v| f64::from(*v)).sum();
        function.mapv_inplace(|v| (f64::from(v) / sum) as f32);
        let at_um = |(row, column): (usize, usize)| {
            DVec2::new(column as f64 - (columns / 2) as f64, (rows / 2) as f64 - row as f64) * pitch_um
        };
        let mean = |of: &dyn Fn(DVec2) -> DVec2| -> DVec2 {
            function.indexed_iter().map(|(place, v)| f64::from(*v) * of(at_um(place))).sum()
        };
        let middle_um = mean(&|at| at);
        let square_um2 = mean(&|at| DVec2::new((at - middle_um).length_squared(), 0.0)).x;
        let is_border =
            |(row, column): (usize, usize)| row == 0 || column == 0 || row + 1 == rows || column + 1 == columns;
        let border: f64 = function.indexed_iter().filter(|(at, _)| is_border(*at)).map(|(_, v)| f64::from(*v)).sum();
        self.below = self.below.max(below);
        self.on_border = self.on_border.max(border);
        self.sums.push(sum);
        self.places_um.push((middle_um, square_um2.sqrt()));
        Ok(())
    }

    /// Returns the field, the distance and the wavelength of a function, each counted from 0.
    fn place_of(&self, index: usize) -> [usize; 3] {
        let [_, n_distances, n_colors] = self.counts();
        [index / n_colors / n_distances, index / n_colors % n_distances, index % n_colors]
    }

    /// Which function it is, in words.
    fn name(&self, index: usize) -> String {
        let [field, distance, color] = self.place_of(index).map(|number| number + 1);
        format!("the function of field {field}, distance {distance} and wavelength {color}")
    }

    /// What the functions are of.
    pub fn parts(&self) -> &PsfArrayParts {
        &self.parts
    }

    /// How many functions there are: fields outermost, then distances, then wavelengths.
    pub fn n_functions(&self) -> usize {
        self.parts.samples.shape()[..3].iter().product()
    }

    pub(crate) fn n_colors(&self) -> usize {
        self.parts.wavelengths_nm.len().max(1)
    }

    /// Rows and columns of a function.
    pub fn size(&self) -> (usize, usize) {
        let shape = self.parts.samples.shape();
        (shape[3], shape[4])
    }

    /// The distance between the samples of the functions of a wavelength, by its number, µm.
    pub fn pitch_um(&self, color: usize) -> f64 {
        self.parts.pitch_um[color.min(self.parts.pitch_um.len() - 1)]
    }

    /// Returns the samples of a function: of sum 1.
    pub fn function(&self, index: usize) -> ArrayView2<'_, f32> {
        let [field, distance, color] = self.place_of(index);
        let of_field = self.parts.samples.index_axis(Axis(0), field);
        of_field.index_axis_move(Axis(0), distance).index_axis_move(Axis(0), color)
    }

    /// Where the middle of the light of a function lies, µm to the right of the middle sample and above it.
    pub fn centroid_um(&self, index: usize) -> DVec2 {
        self.places_um[index].0
    }

    /// The rms radius of a function about the middle of its light, µm; samples count as points.
    pub fn rms_radius_um(&self, index: usize) -> f64 {
        self.places_um[index].1
    }

    /// The sum that a function had.
    pub fn sum(&self, index: usize) -> f64 {
        self.sums[index]
    }

    /// Checks that functions are known at a wavelength.
    ///
    /// # Errors
    /// When it lies outside those of the array.
    pub fn check_at(&self, wavelength_nm: f64) -> Result<(), PsfError> {
        let list = &self.parts.wavelengths_nm;
        let (Some(first), Some(last)) = (list.first(), list.last()) else { return Ok(()) };
        if wavelength_nm >= first - 1e-3 && wavelength_nm <= last + 1e-3 {
            return Ok(());
        }
        let reason = format!(
            "they are {}, without {wavelength_nm} nm: expected functions of all wavelengths that are simulated, or no wavelengths_nm for \
             functions that are of all of them",
            shown(list)
        );
        Err(wrong("wavelengths_nm", reason))
    }

    /// The signed radius of defocus of each function, mm: that of an even disc whose rms radius is what the function has beyond that of the sharpest
    /// one of its field and wavelength, 95 % of it; above 0 nearer than that one.
    pub(crate) fn blurs_mm(&self) -> Vec<f64> {
        let [_, n_distances, n_colors] = self.counts();
        let of = |index: usize| {
            let [field, distance, color] = self.place_of(index);
            let rms_um = |distance: usize| self.rms_radius_um((field * n_distances + distance) * n_colors + color);
            let sharpest = (0..n_distances).min_by(|a, b| rms_um(*a).total_cmp(&rms_um(*b))).unwrap_or(0);
            let beyond_um2 = rms_um(distance).powi(2) - rms_um(sharpest).powi(2);
            let radius_mm = 1e-3 * rim_over_rms() * beyond_um2.max(0.0).sqrt();
            // Distances ascend: those before the sharpest one are nearer.
            if distance < sharpest { radius_mm } else { -radius_mm }
        };
        (0..self.n_functions()).map(of).collect()
    }

    /// The largest change of the radius of defocus from one distance to the next, mm; 0 of one distance.
    pub fn largest_blur_step_mm(&self) -> f64 {
        let (blurs_mm, [n_fields, n_distances, n_colors]) = (self.blurs_mm(), self.counts());
        let of_field = |field: usize| &blurs_mm[field * n_distances * n_colors..][..n_distances * n_colors];
        let steps = (0..n_fields).flat_map(|field| {
            let here = of_field(field);
            here.iter().zip(&here[n_colors..]).map(|(a, b)| (a - b).abs()).collect::<Vec<_>>()
        });
        steps.fold(0.0, f64::max)
    }

    /// How many fields, distances and wavelengths there are.
    fn counts(&self) -> [usize; 3] {
        let shape = self.parts.samples.shape();
        [shape[0], shape[1], shape[2]]
    }

    /// What is to be known of the samples, a sentence each.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = vec![];
        let (low, high) = self.sums.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(*v), high.max(*v)));
        if low < 1.0 - OF_NOTE || high > 1.0 + OF_NOTE {
            notes.push(format!(
                "the functions have sums of {low:.4} to {high:.4}: each counts as all the light of its point, as bright as the lens makes it"
            ));
        }
        if self.below > BELOW_OF_NOTE {
            notes.push(format!(
                "samples below 0, by up to {:.1e} of the highest one of their function, count as 0",
                self.below
            ));
        }
        let (rows, columns) = self.size();
        if self.on_border > OF_NOTE && rows.min(columns) > 2 {
            let share = 100.0 * self.on_border;
            notes.push(format!(
                "up to {share:.1} % of the light of a function lies on the border of its array: more may lie beyond"
            ));
        }
        let off = |(i, (at_um, _)): (usize, &(DVec2, f64))| at_um.length() / self.pitch_um(i % self.n_colors());
        let farthest = self.places_um.iter().enumerate().map(off).fold(0.0, f64::max);
        if farthest > 0.5 {
            notes.push(format!(
                "the middle of the light lies up to {farthest:.1} samples beside the middle sample, which moves the picture by as much"
            ));
        }
        notes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(super) fn parts(samples: Array5<f32>) -> PsfArrayParts {
        PsfArrayParts {
            fields: ArrayFields::Everywhere,
            distances_mm: vec![],
            wavelengths_nm: vec![],
            pitch_um: vec![2.0],
            samples,
        }
    }

    /// A picture of light at one sample.
    fn dot(n: usize, at: (usize, usize)) -> Array5<f32> {
        let mut samples = Array5::zeros((1, 1, 1, n, n));
        samples[(0, 0, 0, at.0, at.1)] = 3.0;
        samples
    }

    #[test]
    fn sums_places_and_sizes_are_those_of_the_light() {
        let mut samples = dot(5, (1, 4));
        samples[(0, 0, 0, 1, 2)] = 3.0;
        let array = PsfArray::new(parts(samples)).unwrap();
        assert_eq!((array.sum(0), array.function(0)[(1, 4)]), (6.0, 0.5));
        // Two samples of 2 µm up, and on the mean one to the right.
        assert_eq!((array.centroid_um(0), array.rms_radius_um(0)), (DVec2::new(2.0, 2.0), 2.0));
        let notes = array.notes();
        assert!(notes[0].contains("6.0000 to 6.0000"), "{notes:?}");
        assert!(notes[1].contains("50.0 %") && notes[2].contains("1.4 samples"), "{notes:?}");
        assert!(PsfArray::new(parts(dot(5, (2, 2)) / 3.0)).unwrap().notes().is_empty());
    }

    #[test]
    fn a_transfer_function_is_that_of_its_picture() {
        // A dot one row down and two columns to the right of the middle of an even and an odd picture.
        for n in [8_usize, 9] {
            let middle = n / 2;
            let phase = |u: usize, v: usize| -std::f64::consts::TAU * ((u + 2 * v) as f64) / n as f64;
            let at = |u: usize, v: usize, zero: usize| phase((u + n - zero) % n, (v + n - zero) % n);
            for zero in [0, middle] {
                // At the shifted zero the modulus has to be greater, as it is of any picture but a dot.
                let fade = |u: usize, v: usize| if (u, v) == (zero, zero) { 1.0 } else { 1.0 - 1e-6 };
                let of = |part: fn(f64) -> f64| {
                    Array5::from_shape_fn((1, 1, 1, n, n), |(_, _, _, u, v)| (fade(u, v) * part(at(u, v, zero))) as f32)
                };
                let (real, imaginary) = (of(f64::cos), of(f64::sin));
                let (samples, pitch_um) = PsfArray::samples_of_transfer(&real, Some(&imaginary), 12.5).unwrap();
                assert!((pitch_um - 1e3 / (12.5 * n as f64)).abs() < 1e-12);
                let function = PsfArray::new(PsfArrayParts { pitch_um: vec![pitch_um], ..parts(samples) }).unwrap();
                assert!(function.function(0)[(middle + 1, middle + 2)] > 1.0 - 1e-5, "{n}, {zero}");
            }
        }
    }

    #[test]
    fn nonsense_is_refused() {
        let good = || parts(dot(3, (1, 1)));
        let with = |value: f32| {
            let mut samples = dot(3, (1, 1));
            samples[(0, 0, 0, 0, 0)] = value;
            parts(samples)
        };
        let cases = [
            (with(f32::NAN), "no numbers"),
            (with(-0.1), "-0.033"),
            (parts(Array5::zeros((1, 1, 1, 3, 3))), "dark"),
            (PsfArrayParts { pitch_um: vec![0.0], ..good() }, "above 0"),
            (PsfArrayParts { pitch_um: vec![1.0, 2.0], ..good() }, "one a wavelength"),
            (PsfArrayParts { wavelengths_nm: vec![500.0, 400.0], ..good() }, "ascending"),
            (PsfArrayParts { distances_mm: vec![500.0, 900.0], ..good() }, "[1, 2, 1]"),
            (PsfArrayParts { fields: ArrayFields::Heights(vec![-1.0]), ..good() }, "0 to 179"),
        ];
        for (parts, word) in cases {
            let message = PsfArray::new(parts).unwrap_err().to_string();
            assert!(message.contains(word), "{message}");
        }
        let one = PsfArray::new(PsfArrayParts { wavelengths_nm: vec![550.0], ..good() }).unwrap();
        assert!(one.check_at(550.0).is_ok());
        assert!(one.check_at(560.0).unwrap_err().to_string().contains("without 560 nm"));
    }
}
