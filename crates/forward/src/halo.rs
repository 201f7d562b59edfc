//! The light of a point that diffraction takes beyond the window of its kernel.
//!
//! A window holds all but a hundredth of the light of a point; the rest falls with the third power of the distance (`docs/forward.md`, 2). It is taken
//! from the finished picture of a band and spread on pixels 2, 4, 8 … times as wide, the farther the wider.

use std::{collections::BTreeMap, ops::Range};

use dioptric_psf::{Kernel, LensImage};
use multiversion::multiversion;
use ndarray::{Array2, Zip};
use rayon::prelude::*;

use crate::{
    Film,
    beyond::{Beyond, POINTS},
    layers::Layers,
    points::Point,
    splines::{doubled, doubled_row, halved, halved_line},
    stars::{self, Directions, Star},
    surroundings::{Surroundings, beside},
};

/// Distance, in pixels of a raster, over which a halo passes to the next one of wider pixels.
const PASSES_OVER: [f64; 2] = [3.0, 4.5];
/// Distance at which the halo begins on the first raster, in its pixels, or more; where that is less than on the film's own, that is the first.
const FIRST: f64 = 1.25;
/// Pixels beside the middle that the halo of one raster reaches.
const REACH: usize = 5;

/// The halos of the bands of a plan.
#[derive(Debug)]
pub(crate) struct Halos {
    /// None where no light lies beyond the windows.
    of_bands: Vec<Option<Halo>>,
    /// Where edges of a pupil that is not round bend light to.
    directions: Option<Directions>,
}

impl Halos {
    /// Returns the halos of so many bands on a film. Windows are looked up in some of them, of given wavelengths, the first and the last among them, and lie
    /// between two of those in the others.
    pub(crate) fn of(
        (lens, layers): (&dyn LensImage, &Layers),
        (film, widest_px): (&Film, f64),
        looked_up: &[(usize, f64)],
        n_bands: usize,
    ) -> Self {
        let of = |&(band, wavelength_nm): &(usize, f64)| {
            (band, Beyond::of(lens, layers, (wavelength_nm, film.pitch_um), widest_px))
        };
        let known: BTreeMap<usize, Beyond> = looked_up.par_iter().map(of).collect();
        let halo = |band: usize| {
            let ((lower, below), (upper, above)) = (known.range(..=band).next_back()?, known.range(band..).next()?);
            let fraction = (band - lower) as f64 / (upper - lower).max(1) as f64;
            let beyond = Beyond::between(*below, *above, fraction);
            let (rows, columns) = (film.rows + 2 * beside(film), film.columns + 2 * beside(film));
            (beyond.share > Kernel::NEGLIGIBLE).then(|| Halo::new(beyond, (rows, columns)))
        };
        let of_bands = (0..n_bands).into_par_iter().map(halo).collect();
        Self { of_bands, directions: lens.pupil_edges().as_ref().map(Directions::of) }
    }

    /// Whether light lies beyond the windows of any band.
    pub(crate) fn are_any(&self) -> bool {
        self.of_bands.iter().any(Option::is_some)
    }

    /// The values in which stars about all that a picture shows are found, of so many pixels.
    pub(crate) fn star_values(&self, n_pixels: usize) -> usize {
        if self.directions.is_some() { stars::values(n_pixels) } else { 0 }
    }

    /// Returns the picture of a band with the halos of its points and of what lies around it, if any light lies beyond its windows.
    pub(crate) fn applied(
        &self,
        band: usize,
        picture: Array2<f32>,
        (surroundings, radiance, points): (&Surroundings<'_>, &[f32], &[Point]),
    ) -> Array2<f32> {
        match self.of_bands.get(band) {
            Some(Some(halo)) => surroundings.with(&picture, (radiance, points), |wide, beside| {
                let star = self.directions.as_ref().map(|directions| Star::new(directions, &halo.beyond));
                halo.applied(wide, beside, star.as_ref())
            }),
            _ => picture,
        }
    }
}

/// The halo around each point of a band: parts of it on rasters of pixels 2, 4, 8 … times as wide as the film's, of sum 1.
#[derive(Debug)]
struct Halo {
    beyond: Beyond,
    /// How many times pixels are doubled before the first raster.
    n_doublings: usize,
    rasters: Vec<RasterPart>,
}

/// The part of a halo on one raster: of each pixel from the middle, to the right and down.
#[derive(Debug)]
struct RasterPart([[f32; REACH + 1]; REACH + 1]);

impl Halo {
    fn new(beyond: Beyond, (rows, columns): (usize, usize)) -> Self {
        let n_doublings = (beyond.fade_px[0] / FIRST).log2().floor().max(0.0) as usize;
        let n_rasters = f64::hypot(rows as f64, columns as f64).log2().ceil().max(0.0) as usize + 1;
        let part = |doublings: usize| RasterPart::new(beyond, doublings, doublings == n_doublings);
        let rasters = (n_doublings..n_rasters.max(n_doublings + 1)).map(part).collect();
        Self { beyond, n_doublings, rasters }
    }

    /// Takes from each pixel of a picture what its halo takes to others, and adds that to them.
    ///
    /// With T the halo of a point, E + T ⊗ E − E (T ⊗ 1): the sum of the picture is kept, and an even one stays even, for beyond its edges it counts as even.
    ///
    /// What lies less than `beside` pixels from its edges is not wanted.
    fn applied(&self, mut picture: Array2<f32>, beside: usize, star: Option<&Star>) -> Array2<f32> {
        let (rows, columns) = picture.dim();
        let wanted = beside..rows - beside;
        let share = self.beyond.share as f32;
        // Where rasters are sharpened to make up for their blur, next to a bright point, less than nothing may come.
        let change =
            |light: &mut f32, (came, went): (f32, f32)| *light = (*light + share * (came - *light * went)).max(0.0);
        if let Some(star) = star {
            let [brought, landing] = star.about(&picture, beside);
            Zip::from(&mut picture)
                .and(&brought)
                .and(&landing)
                .for_each(|light, came, went| change(light, (*came, *went)));
            return picture;
        }
        let (brought, landing) = (self.of(&picture, &wanted), self.of_ones((rows, columns), beside));
        for (row, mut line) in picture.rows_mut().into_iter().enumerate().filter(|(row, _)| wanted.contains(row)) {
            let came = self.on_film(&brought, row, columns);
            let went = self.on_film(&landing, row, columns);
            line.iter_mut().zip(came.into_iter().zip(went)).for_each(|(light, both)| change(light, both));
        }
        picture
    }

    /// Returns how much of the halo of each pixel lands on a picture of so many rows and columns, on pixels as [`of`](Self::of) has them: right where pixels lie
    /// `beside` its edges or more.
    fn of_ones(&self, (rows, columns): (usize, usize), beside: usize) -> Array2<f32> {
        // Ones on ever wider pixels are products of lines.
        let mut lines = vec![[vec![1.0; rows], vec![1.0; columns]]];
        for doublings in 1..self.n_doublings + self.rasters.len() {
            lines.push([0, 1].map(|way| halved_line(&lines[doublings - 1][way])));
        }
        // What lands through rasters that reach no edge is all of it: their parts, and the splines to them.
        let reaches_edge = |raster: usize| (REACH + 3) << (self.n_doublings + raster) > beside;
        let outer = (0..self.rasters.len()).find(|raster| reaches_edge(*raster)).unwrap_or(self.rasters.len() - 1);
        let [down, across] = &lines[self.n_doublings + outer];
        let ones = Array2::from_shape_fn((down.len(), across.len()), |(row, column)| down[row] * across[column]);
        let mut landing = on_rasters(&ones, &self.rasters[outer..], &(0..ones.nrows()));
        for doublings in (self.n_doublings.min(1)..self.n_doublings + outer).rev() {
            let [down, across] = &lines[doublings];
            landing = doubled(&landing, (down.len(), across.len()));
            if let Some(raster) = doublings.checked_sub(self.n_doublings) {
                landing += self.rasters[raster].total();
            }
        }
        landing
    }

    /// Returns what halos bring to the pixels of some rows of a picture, on its own or, to all, on pixels twice as wide: see [`on_film`](Self::on_film).
    fn of(&self, picture: &Array2<f32>, wanted: &Range<usize>) -> Array2<f32> {
        match self.n_doublings {
            0 => on_rasters(picture, &self.rasters, wanted),
            n => self.by_doublings(&halved(picture), n - 1),
        }
    }

    fn by_doublings(&self, picture: &Array2<f32>, n_doublings: usize) -> Array2<f32> {
        match n_doublings {
            0 => on_rasters(picture, &self.rasters, &(0..picture.nrows())),
            n => doubled(&self.by_doublings(&halved(picture), n - 1), picture.dim()),
        }
    }

    /// Returns a row of the film of what halos bring.
    fn on_film(&self, brought: &Array2<f32>, row: usize, columns: usize) -> Vec<f32> {
        match self.n_doublings {
            0 => brought.row(row).to_vec(),
            _ => doubled_row(brought, row, columns),
        }
    }
}

/// Returns what the parts of a halo on a raster and wider ones bring to each pixel of some rows of a picture on the first.
fn on_rasters(picture: &Array2<f32>, rasters: &[RasterPart], wanted: &Range<usize>) -> Array2<f32> {
    let [part, wider @ ..] = rasters else { return Array2::zeros(picture.dim()) };
    let mut brought = part.of(picture, wanted);
    if !wider.is_empty() {
        let means = halved(picture);
        let from_farther = on_rasters(&means, wider, &(0..means.nrows()));
        for (row, mut line) in brought.rows_mut().into_iter().enumerate().filter(|(row, _)| wanted.contains(row)) {
            let more = doubled_row(&from_farther, row, line.len());
            line.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
        }
    }
    brought
}

impl RasterPart {
    /// Returns the part of the halo beyond a window on pixels that are doubled so many times.
    fn new(beyond: Beyond, doublings: usize, is_first: bool) -> Self {
        let pixel = (doublings as f64).exp2();
        // Of sum 1.
        let density = beyond.density();
        let passed = |r_pixels: f64| {
            let [start, end] = PASSES_OVER;
            ((r_pixels - start) / (end - start)).clamp(0.0, 1.0)
        };
        let share = |r: f64| (if is_first { 1.0 } else { passed(2.0 * r) }) - passed(r);
        let at = |pixel_at: usize, point: usize| pixel_at as f64 + (point as f64 + 0.5) / POINTS as f64 - 0.5;
        let energy = |right: usize, down: usize| {
            let points = (0..POINTS * POINTS).map(|i| (at(right, i % POINTS).abs(), at(down, i / POINTS).abs()));
            let energies = points.map(|(x, y)| share(x.hypot(y)) * density(pixel * x.hypot(y)));
            energies.sum::<f64>() * (pixel / POINTS as f64).powi(2)
        };
        let raw: [[f64; REACH + 2]; REACH + 2] =
            std::array::from_fn(|down| std::array::from_fn(|right| energy(right, down)));
        // Less half the variance of the blur times the second differences, so that it is blurred back to what it is: of splines to wider pixels and back, and of pixels between.
        let blur = 2.0 * 0.25 + 1.0 / 12.0;
        let sharp = |right: usize, down: usize| {
            let beside = raw[down][right.abs_diff(1)]
                + raw[down][right + 1]
                + raw[down.abs_diff(1)][right]
                + raw[down + 1][right];
            raw[down][right] + 0.5 * blur * (4.0 * raw[down][right] - beside)
        };
        Self(std::array::from_fn(|down| std::array::from_fn(|right| sharp(right, down) as f32)))
    }

    /// What lands of a pixel's part, near and far.
    fn total(&self) -> f32 {
        let times = |pixels: usize| if pixels == 0 { 1.0 } else { 2.0 };
        let line = |energies: &[f32; REACH + 1]| -> f32 {
            energies.iter().enumerate().map(|(right, energy)| times(right) * energy).sum()
        };
        self.0.iter().enumerate().map(|(down, energies)| times(down) * line(energies)).sum()
    }

    /// Returns what it brings to each pixel of some rows of a picture.
    fn of(&self, picture: &Array2<f32>, wanted: &Range<usize>) -> Array2<f32> {
        let (rows, columns) = picture.dim();
        let mut spread = vec![0.0; rows * columns];
        let line_at = |row: isize| {
            let row = usize::try_from(row).ok().filter(|row| *row < rows);
            row.and_then(|row| picture.as_slice().map(|values| &values[row * columns..][..columns]))
        };
        let mut padded = vec![0.0; columns + 2 * REACH];
        for (row, sums) in
            (0..).zip(spread.chunks_exact_mut(columns)).filter(|(row, _)| wanted.contains(&(*row as usize)))
        {
            for (down, energies) in (0..).zip(&self.0) {
                // Rows above and below have the same energies.
                padded[REACH..][..columns].fill(0.0);
                let above = if down == 0 { None } else { line_at(row - down) };
                for line in above.into_iter().chain(line_at(row + down)) {
                    padded[REACH..].iter_mut().zip(line).for_each(|(sum, light)| *sum += light);
                }
                add_line(energies, &padded, sums);
            }
        }
        Array2::from_shape_vec((rows, columns), spread).expect("it has a value for each pixel")
    }
}

/// Adds a line with a margin, spread to both sides.
#[multiversion(targets("x86_64+avx2", "aarch64+neon"))]
fn add_line(energies: &[f32; REACH + 1], padded: &[f32], sums: &mut [f32]) {
    sums.iter_mut().zip(&padded[REACH..]).for_each(|(sum, light)| *sum += energies[0] * light);
    for (right, energy) in (1..).zip(&energies[1..]) {
        let pairs = padded[REACH - right..].iter().zip(&padded[REACH + right..]);
        sums.iter_mut().zip(pairs).for_each(|(sum, (left, right))| *sum += energy * (left + right));
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use glam::DVec2;

    use super::*;

    fn halo(half_px: f64, share: f64, size: (usize, usize)) -> Halo {
        Halo::new(Beyond::from_step(share, half_px, 0.0), size)
    }

    #[test]
    fn even_pictures_stay_even_and_sums_are_kept() {
        for (half_px, size) in [(0.5, (33, 70)), (2.5, (64, 48)), (5.5, (101, 90)), (23.5, (40, 61)), (200.5, (7, 1))] {
            let halo = halo(half_px, 0.02, size);
            for light in halo.applied(Array2::from_elem(size, 3.0), 0, None) {
                assert!((light - 3.0).abs() < 1e-6, "{half_px}: {light}");
            }
            let uneven = Array2::from_shape_fn(size, |(row, column)| ((row * 7 + column * 13) % 11) as f32);
            let (before, after) = (uneven.sum(), halo.applied(uneven, 0, None).sum());
            assert!((after / before - 1.0).abs() < 1e-5, "{half_px}: {before} {after}");
        }
    }

    /// Beside the edges by more than rasters reach, what lands is found without them.
    #[test]
    fn what_lands_is_all_where_no_edge_is_near() {
        for half_px in [0.5, 2.5, 5.5, 23.5] {
            let halo = halo(half_px, 0.02, (300, 260));
            let (beside, whole) = (100, halo.of_ones((300, 260), 0));
            for ((row, column), landing) in halo.of_ones((300, 260), beside).indexed_iter() {
                let wide = if halo.n_doublings == 0 { 1 } else { 2 };
                let is_inner = |at: usize, n: usize| (beside + 4..n - beside - 4).contains(&(wide * at));
                if is_inner(row, 300) && is_inner(column, 260) {
                    assert!((landing - whole[(row, column)]).abs() < 2e-6, "{half_px} {row} {column}: {landing}");
                }
            }
        }
    }

    /// Beyond the radius h lies 1, and h / r beyond another.
    #[test]
    fn a_halo_falls_with_the_third_power_of_the_distance() {
        let (n, share) = (801, 0.5);
        for half_px in [0.5, 1.5, 2.5, 4.5, 9.5, 14.5] {
            let halo = halo(half_px, share, (n, n));
            // Wherever the point lies among the pixels of wider rasters.
            for at in [(400, 400), (403, 398), (397, 401)] {
                let mut point = Array2::zeros((n, n));
                point[at] = 1.0;
                let picture = halo.applied(point, 0, None);
                let from_point = |row: usize, column: usize| {
                    DVec2::new(column as f64 - at.1 as f64, row as f64 - at.0 as f64).length()
                };
                let beyond = |r: f64| share * half_px / r;
                for r in [2.0, 3.0, 5.0, 10.0].map(|times| times * half_px).into_iter().filter(|r| *r > 4.0) {
                    let lights = picture.indexed_iter();
                    let between = lights.filter(|((row, column), _)| (r..395.0).contains(&from_point(*row, *column)));
                    let sum: f64 = between.map(|(_, light)| f64::from(*light)).sum();
                    let ratio = sum / (beyond(r) - beyond(395.0));
                    assert!((0.92..1.12).contains(&ratio), "{half_px} {at:?}, beyond {r}: {ratio}");
                }
                // Single pixels of a ring: parts of the halo are shares of wide pixels.
                for r in [3.0, 5.0, 7.0, 10.0].map(|times| times * half_px).into_iter().filter(|r| *r > 7.0) {
                    let on_ring = (0..63).map(|i| DVec2::from_angle(0.1 * f64::from(i)) * r);
                    for place in on_ring {
                        let pixel =
                            ((at.0 as f64 + place.y).round() as usize, (at.1 as f64 + place.x).round() as usize);
                        let law = share * half_px / (2.0 * PI) / from_point(pixel.0, pixel.1).powi(3);
                        let ratio = f64::from(picture[pixel]) / law;
                        assert!((0.63..1.35).contains(&ratio), "{half_px} {at:?}, at {place}: {ratio}");
                    }
                }
            }
        }
    }
}
