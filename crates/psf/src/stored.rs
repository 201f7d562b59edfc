//! The point spread functions of an array, behind a lens.

use std::sync::Arc;

use glam::{DVec2, DVec3};
use ndarray::{Array2, ArrayView2, Axis};

use crate::{
    ArrayFields, Kernel, PsfArray, PsfError,
    bundle::rim_over_rms,
    kernel::trim,
    raster::Raster,
    render::{NARROW, PARTS, of_parts},
};

/// Half the side of the largest window, pixels.
const MOST_PIXELS: usize = 600;
/// What is not worth drawing, as a share of the highest sample.
const UNSEEN: f64 = 1e-9;
/// How far two mirrored samples may differ, as a share of the highest one, where a function counts as symmetric.
const SYMMETRIC: f32 = 1e-4;

/// A mixture of two neighbors of an axis: their numbers and shares.
type Mixture = [(usize, f64); 2];

/// Point spread functions of an array in place of those that a lens has: where they lie and how bright they are is the lens's.
#[derive(Clone, Debug)]
pub(crate) struct StoredPsfs {
    array: Arc<PsfArray>,
    /// One over the distances of the array from the projection centre, 1/m, descending.
    dioptres: Vec<f64>,
    /// The signed radius of defocus of each function, mm: above 0 nearer than the sharpest one of its field and wavelength.
    blurs_mm: Vec<f64>,
    is_symmetric: bool,
}

/// A point that a stored function is asked for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StoredPoint {
    /// Where it is seen, of any length.
    pub(crate) direction: DVec3,
    pub(crate) dioptres: f64,
    pub(crate) wavelength_nm: f64,
}

impl StoredPsfs {
    /// Puts functions behind a lens whose projection centre lies so far behind its first vertex, mm.
    ///
    /// # Errors
    /// When a distance does not lie before the projection centre.
    pub(crate) fn behind(array: Arc<PsfArray>, center_z_mm: f64) -> Result<Self, PsfError> {
        let distances_mm = &array.parts().distances_mm;
        let dioptres: Vec<f64> = distances_mm.iter().map(|mm| 1e3 / (mm + center_z_mm)).collect();
        if dioptres.iter().any(|d| !(*d >= 0.0 && d.is_finite())) {
            let reason = format!("one is {} mm, expected points before the lens", distances_mm[0]);
            return Err(PsfError::Array { key: "distances_mm", reason });
        }
        let is_symmetric = match array.parts().fields {
            ArrayFields::Everywhere => (0..array.n_functions()).all(|i| is_mirrored(array.function(i), true)),
            ArrayFields::Heights(_) => (0..array.n_functions()).all(|i| is_mirrored(array.function(i), false)),
            ArrayFields::Grid { .. } => false,
        };
        let blurs_mm = array.blurs_mm();
        Ok(Self { array, dioptres, blurs_mm, is_symmetric })
    }

    /// Whether points that mirror each other about the axes or their diagonals have functions that do, where the lens does.
    pub(crate) fn is_symmetric(&self) -> bool {
        self.is_symmetric
    }

    pub(crate) fn array(&self) -> &Arc<PsfArray> {
        &self.array
    }

    /// The functions that a point's is mixed of, with their shares, and by which angle they are turned, counter-clockwise.
    fn mixture(&self, point: &StoredPoint) -> (Vec<(usize, f64)>, f64) {
        let parts = self.array.parts();
        let tan = |axis: f64| (axis / point.direction.z).atan().to_degrees();
        let (fields, turn_rad): (Vec<(usize, f64)>, f64) = match &parts.fields {
            ArrayFields::Everywhere => (vec![(0, 1.0)], 0.0),
            ArrayFields::Heights(heights) => {
                let aside = point.direction.truncate();
                let angle_deg = aside.length().atan2(point.direction.z).to_degrees();
                let turn_rad = if aside == DVec2::ZERO { 0.0 } else { aside.to_angle() };
                (between(heights, angle_deg).to_vec(), turn_rad)
            }
            ArrayFields::Grid { x_deg, y_deg } => {
                let (across, up) = (between(x_deg, tan(point.direction.x)), between(y_deg, tan(point.direction.y)));
                let pair = |(i, a): (usize, f64)| up.map(|(j, b)| (i * y_deg.len() + j, a * b));
                (across.into_iter().flat_map(pair).collect(), 0.0)
            }
        };
        let far_first: Vec<f64> = self.dioptres.iter().map(|d| -d).collect();
        let (depths, colors) =
            (between(&far_first, -point.dioptres), between(&parts.wavelengths_nm, point.wavelength_nm));
        let (n_depths, n_colors) = (self.dioptres.len().max(1), self.array.n_colors());
        let mut mixture = vec![];
        for (field, of_field) in fields {
            for (depth, of_depth) in depths {
                for (color, of_color) in colors {
                    let share = of_field * of_depth * of_color;
                    if share > 0.0 {
                        mixture.push(((field * n_depths + depth) * n_colors + color, share));
                    }
                }
            }
        }
        (mixture, turn_rad)
    }

    fn mean(&self, point: &StoredPoint, of: impl Fn(usize) -> f64) -> f64 {
        self.mixture(point).0.into_iter().map(|(index, share)| share * of(index)).sum()
    }

    /// The signed radius of the blur of defocus of a point, mm.
    pub(crate) fn blur_radius_mm(&self, point: &StoredPoint) -> f64 {
        self.mean(point, |index| self.blurs_mm[index])
    }

    /// The radius that holds 95 % of an even disc of the function's rms radius, mm.
    pub(crate) fn spread_mm(&self, point: &StoredPoint) -> f64 {
        rim_over_rms() * 1e-3 * self.mean(point, |index| self.array.rms_radius_um(index))
    }

    /// How far from the middle the farthest sample of a point's function reaches, mm.
    pub(crate) fn extent_mm(&self, point: &StoredPoint) -> f64 {
        let (rows, columns) = self.array.size();
        let half = 0.5 * (rows as f64).hypot(columns as f64) + 1.0;
        let pitch_um = |index: usize| self.array.pitch_um(index % self.array.n_colors());
        self.mixture(point).0.into_iter().map(|(index, _)| 1e-3 * half * pitch_um(index)).fold(0.0, f64::max)
    }

    /// Returns the function of a point on pixels of a side, the light of each sample spread evenly over its own square: of sum 1, about the
    /// picture of the point. Where pixels are the samples, these are taken as they are.
    pub(crate) fn kernel(&self, point: &StoredPoint, pitch_um: f64) -> Kernel {
        let half = (1e3 * self.extent_mm(point) / pitch_um).ceil().min(MOST_PIXELS as f64) as usize;
        let (mixture, turn_rad) = self.mixture(point);
        let is_own = |(index, _): &(usize, f64)| self.array.pitch_um(index % self.array.n_colors()) == pitch_um;
        let (energies, excess_px2) = if turn_rad == 0.0 && mixture.iter().all(is_own) {
            (self.window(point, pitch_um, half), [0.0; 2])
        } else if 1e3 * self.spread_mm(point) <= NARROW * pitch_um {
            of_parts(&self.window(point, pitch_um / PARTS as f64, PARTS * half + PARTS / 2))
        } else {
            (self.window(point, pitch_um, half), [1.0 / 12.0; 2])
        };
        let kernel = Kernel::centered(trim(&energies, 1.0 - Kernel::NEGLIGIBLE), pitch_um).normalized();
        Kernel { excess_px2, ..kernel }
    }

    /// Returns the light of a point on so many pixels each way from the one about its picture, and that one.
    pub(crate) fn window(&self, point: &StoredPoint, pitch_um: f64, half: usize) -> Array2<f64> {
        let (mixture, turn_rad) = self.mixture(point);
        let mut window = Array2::zeros((2 * half + 1, 2 * half + 1));
        let n_colors = self.array.n_colors();
        let pitch_of = |index: usize| self.array.pitch_um(index % n_colors);
        let mut left = mixture;
        while let Some(&(first, _)) = left.first() {
            // Those with samples as far apart are mixed before they are drawn.
            let own_um = pitch_of(first);
            let (alike, others): (Vec<_>, Vec<_>) = left.into_iter().partition(|(i, _)| pitch_of(*i) == own_um);
            let mut mixed = Array2::<f64>::zeros(self.array.size());
            for (index, share) in alike {
                mixed.zip_mut_with(&self.array.function(index), |sum, v| *sum += share * f64::from(*v));
            }
            let step = own_um / pitch_um;
            window += &if turn_rad == 0.0 { spread(&mixed, step, half) } else { turned(&mixed, step, turn_rad, half) };
            left = others;
        }
        window
    }
}

/// Returns the two entries of an ascending axis that a value lies between, and their shares; beyond its ends the last one, and without
/// entries the only function.
fn between(axis: &[f64], value: f64) -> Mixture {
    let above = axis.partition_point(|entry| *entry < value).min(axis.len().saturating_sub(1));
    let below = above.saturating_sub(1);
    if axis.len() < 2 || value <= axis[0] {
        return [(0, 1.0), (0, 0.0)];
    }
    let share = ((value - axis[below]) / (axis[above] - axis[below])).clamp(0.0, 1.0);
    [(below, 1.0 - share), (above, share)]
}

/// Whether a function stays when it is mirrored about the row through its middle sample and, if wanted, also about the column and the diagonals.
fn is_mirrored(function: ArrayView2<'_, f32>, all_ways: bool) -> bool {
    let (rows, columns) = function.dim();
    let (middle_row, middle_column) = (rows / 2, columns / 2);
    let highest = function.iter().copied().fold(0.0, f32::max);
    let at = |row: Option<usize>, column: Option<usize>| {
        row.zip(column).and_then(|place| function.get(place)).copied().unwrap_or(0.0)
    };
    let is_same = |((row, column), v): ((usize, usize), &f32)| {
        let (up, left) = ((2 * middle_row).checked_sub(row), (2 * middle_column).checked_sub(column));
        let across = ((middle_row + column).checked_sub(middle_column), (middle_column + row).checked_sub(middle_row));
        let mut others = vec![at(up, Some(column))];
        if all_ways {
            others.extend([at(Some(row), left), at(across.0, across.1)]);
        }
        others.iter().all(|other| (other - v).abs() <= SYMMETRIC * highest)
    };
    function.indexed_iter().all(is_same)
}

/// Returns samples that are `step` pixels apart on so many pixels each way from the middle, each spread evenly over its own square.
fn spread(samples: &Array2<f64>, step: f64, half: usize) -> Array2<f64> {
    let side = 2 * half + 1;
    // The pixels that the `i`-th of `n` samples along an axis covers, and the shares of it on them.
    let cover = |i: usize, n: usize| {
        let middle = half as f64 + 0.5 + (i as f64 - (n / 2) as f64) * step;
        let (from, to) = (middle - 0.5 * step, middle + 0.5 * step);
        let pixels = from.floor().max(0.0) as usize..(to.ceil().max(0.0) as usize).min(side);
        pixels.map(move |pixel| (pixel, (to.min(pixel as f64 + 1.0) - from.max(pixel as f64)).max(0.0) / step))
    };
    let (rows, columns) = samples.dim();
    let mut across = Array2::zeros((rows, side));
    for (column, lane) in samples.axis_iter(Axis(1)).enumerate() {
        for (pixel, share) in cover(column, columns) {
            across.column_mut(pixel).scaled_add(share, &lane);
        }
    }
    let mut window = Array2::zeros((side, side));
    for (row, lane) in across.axis_iter(Axis(0)).enumerate() {
        for (pixel, share) in cover(row, rows) {
            window.row_mut(pixel).scaled_add(share, &lane);
        }
    }
    window
}

/// Returns the same, turned about the middle by an angle, counter-clockwise.
fn turned(samples: &Array2<f64>, step: f64, turn_rad: f64, half: usize) -> Array2<f64> {
    let side = 2 * half + 1;
    let (rows, columns) = samples.dim();
    let mut raster = Raster::new(side, side);
    let highest = samples.iter().copied().fold(0.0, f64::max);
    // Rows go down: what turns counter-clockwise in the picture turns the other way in rows and columns.
    let along = DVec2::from_angle(-turn_rad) * step;
    let down = along.perp();
    let middle = DVec2::splat(half as f64 + 0.5);
    for ((row, column), light) in samples.indexed_iter().filter(|(_, light)| **light > UNSEEN * highest) {
        let (x, y) = (column as f64 - (columns / 2) as f64, row as f64 - (rows / 2) as f64);
        let corner = |dx: f64, dy: f64| middle + along * (x + dx) + down * (y + dy);
        let corners = [corner(-0.5, -0.5), corner(0.5, -0.5), corner(0.5, 0.5), corner(-0.5, 0.5)];
        raster.quadrilateral(corners, *light, 0.5);
    }
    raster.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PsfArrayParts;
    use ndarray::Array5;

    /// Gaussians, `sigma` samples wide, by field, distance and wavelength.
    fn gaussians(n: usize, shape: (usize, usize, usize), sigma: impl Fn(usize, usize, usize) -> f64) -> Array5<f32> {
        Array5::from_shape_fn((shape.0, shape.1, shape.2, n, n), |(f, d, w, row, column)| {
            let (x, y) = (column as f64 - (n / 2) as f64, row as f64 - (n / 2) as f64);
            (-0.5 * (x * x + y * y) / sigma(f, d, w).powi(2)).exp() as f32
        })
    }

    fn array(parts: PsfArrayParts) -> Arc<PsfArray> {
        Arc::new(PsfArray::new(parts).unwrap())
    }

    fn towards(x: f64, y: f64) -> StoredPoint {
        StoredPoint { direction: DVec3::new(x, y, 1.0), dioptres: 0.0, wavelength_nm: 550.0 }
    }

    fn everywhere(samples: Array5<f32>) -> PsfArrayParts {
        let (fields, pitch_um) = (ArrayFields::Everywhere, vec![2.0]);
        PsfArrayParts { fields, distances_mm: vec![], wavelengths_nm: vec![], pitch_um, samples }
    }

    /// Returns the centroid, µm to the right and up, and the rms radius of a kernel, pixels counted as squares.
    fn measured(kernel: &Kernel) -> (DVec2, f64) {
        let (rows, columns) = kernel.samples.dim();
        let at = |(row, column): (usize, usize)| {
            DVec2::new(column as f64 - (columns / 2) as f64, (rows / 2) as f64 - row as f64) * kernel.pitch_um
        };
        let mean: DVec2 = kernel.samples.indexed_iter().map(|(place, v)| f64::from(*v) * at(place)).sum();
        let square: f64 =
            kernel.samples.indexed_iter().map(|(place, v)| f64::from(*v) * (at(place) - mean).length_squared()).sum();
        (mean, square.sqrt())
    }

    #[test]
    fn kernels_keep_light_place_and_size_on_any_pixels_and_turned_any_way() {
        // One sample to the right of the middle, as wide as 3 samples.
        let mut samples = Array5::zeros((1, 1, 1, 31, 31));
        for ((_, _, _, row, column), v) in samples.indexed_iter_mut() {
            let (x, y) = (column as f64 - 16.0, row as f64 - 15.0);
            *v = (-0.5 * (x * x / 9.0 + y * y / 4.0)).exp() as f32;
        }
        let fields = ArrayFields::Heights(vec![10.0]);
        let stored = StoredPsfs::behind(array(PsfArrayParts { fields, ..everywhere(samples) }), 0.0).unwrap();
        let rms_um = stored.array().rms_radius_um(0);
        for (angle_deg, pitch_um) in [(0.0_f64, 2.0), (0.0, 0.7), (90.0, 1.3), (-37.0, 2.0), (200.0, 5.0)] {
            let direction = DVec2::from_angle(angle_deg.to_radians());
            let kernel = stored.kernel(&towards(direction.x, direction.y), pitch_um);
            assert!((kernel.sum() - 1.0).abs() < 1e-5, "{}", kernel.sum());
            let (mean_um, found_um) = measured(&kernel);
            // Light counts at the middle of its pixel, by up to half of which a narrow one is off.
            assert!((mean_um - 2.0 * direction).length() < 0.02 * pitch_um, "{angle_deg}: {mean_um}");
            // The squares of samples and of pixels add their own variances, unless they are the same ones.
            let added_um2 = if pitch_um == 2.0 && angle_deg == 0.0 { 0.0 } else { (4.0 + pitch_um * pitch_um) / 6.0 };
            let expected_um = (rms_um * rms_um + added_um2).sqrt();
            assert!((found_um / expected_um - 1.0).abs() < 0.01, "{angle_deg}, {pitch_um}: {found_um} {expected_um}");
        }
        // On its own pixels a function is itself.
        let own = stored.kernel(&towards(1.0, 0.0), 2.0);
        let half = own.samples.nrows() / 2;
        assert!((own.samples[(half, half + 1)] - stored.array().function(0)[(15, 16)]).abs() < 1e-6);
    }

    #[test]
    fn functions_between_two_are_their_mixture_and_beyond_the_ends_the_last() {
        let samples = gaussians(41, (1, 2, 2), |_, depth, color| 1.0 + depth as f64 + 2.0 * color as f64);
        let parts = PsfArrayParts {
            distances_mm: vec![500.0, 1000.0],
            wavelengths_nm: vec![500.0, 600.0],
            pitch_um: vec![1.0, 1.5],
            ..everywhere(samples)
        };
        let stored = StoredPsfs::behind(array(parts), 0.0).unwrap();
        let peak = |dioptres: f64, wavelength_nm: f64| {
            let point = StoredPoint { dioptres, wavelength_nm, ..towards(0.0, 0.0) };
            let kernel = stored.kernel(&point, 0.25);
            let half = kernel.samples.nrows() / 2;
            f64::from(kernel.samples[(half, half)])
        };
        for (mixed, ends) in [
            (peak(1.5, 500.0), [peak(1.0, 500.0), peak(2.0, 500.0)]),
            (peak(1.0, 550.0), [peak(1.0, 500.0), peak(1.0, 600.0)]),
        ] {
            assert!((mixed - 0.5 * (ends[0] + ends[1])).abs() < 1e-4 * ends[0], "{mixed} {ends:?}");
        }
        assert_eq!((peak(0.3, 500.0), peak(9.0, 600.0)), (peak(1.0, 500.0), peak(2.0, 600.0)));
    }

    #[test]
    fn blur_has_a_sign_about_the_sharpest_distance() {
        let samples = gaussians(41, (1, 3, 1), |_, depth, _| [4.0, 1.0, 2.0][depth]);
        let parts = PsfArrayParts { distances_mm: vec![500.0, 1000.0, f64::INFINITY], ..everywhere(samples) };
        let stored = StoredPsfs::behind(array(parts), 0.0).unwrap();
        let blur_mm = |dioptres: f64| stored.blur_radius_mm(&StoredPoint { dioptres, ..towards(0.0, 0.0) });
        let (near, sharp, far) = (blur_mm(2.0), blur_mm(1.0), blur_mm(0.0));
        assert!(near > 0.0 && sharp == 0.0 && far < 0.0, "{near} {sharp} {far}");
        // √(σ² − 1) of 4 and 2: the ratio of √15 and √3.
        assert!((near / far + 5f64.sqrt()).abs() < 0.02, "{near} {far}");
        assert!((blur_mm(1.5) - 0.5 * near).abs() < 1e-12);
        let before = StoredPsfs::behind(stored.array().clone(), -600.0);
        assert!(before.unwrap_err().to_string().contains("500 mm"));
    }

    #[test]
    fn symmetry_is_that_of_the_functions() {
        let round = || gaussians(21, (1, 1, 1), |_, _, _| 2.0);
        let is_symmetric = |fields: ArrayFields, samples: Array5<f32>| {
            StoredPsfs::behind(array(PsfArrayParts { fields, ..everywhere(samples) }), 0.0).unwrap().is_symmetric()
        };
        let skew = |aside: (usize, usize)| {
            let mut samples = round();
            samples[(0, 0, 0, 10 + aside.0, 10 + aside.1)] += 0.5;
            samples
        };
        let heights = || ArrayFields::Heights(vec![0.0]);
        assert!(is_symmetric(ArrayFields::Everywhere, round()) && is_symmetric(heights(), round()));
        // Coma along the radius of the field is mirrored about it.
        assert!(is_symmetric(heights(), skew((0, 3))) && !is_symmetric(heights(), skew((3, 0))));
        assert!(!is_symmetric(ArrayFields::Everywhere, skew((0, 3))));
    }
}
