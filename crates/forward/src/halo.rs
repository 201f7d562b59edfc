//! The light of a point that diffraction takes beyond the window of its kernel.
//!
//! A window holds all but a hundredth of the light of a point; the rest falls with the third power of the distance (`docs/forward.md`, 2). It is taken
//! from the finished picture of a band, which is convolved with the wing of a point by transforms.

use std::collections::BTreeMap;

use dioptric_psf::{Kernel, LensImage};
use ndarray::{Array2, Zip};
use rayon::prelude::*;

use crate::{
    Film,
    beyond::Beyond,
    convolve::{fast_size, with_fft},
    splines::{doubled, halved},
    wing::{Directions, Wing},
};

/// Pixels of a film with what lies around it beyond which wings are drawn on pixels twice as wide, or four times, …
const MOST_PIXELS: usize = 1 << 21;
/// The most pixels beside a film that are looked at, and the pixels in all up to which there are as many; of larger films, as many pixels around as within.
const MOST_BESIDE: f64 = 256.0;
const AMPLE_PIXELS: f64 = 100_000.0;

/// Returns how far beside a film is looked, pixels.
pub(crate) fn beside(film: &Film) -> usize {
    let (rows, columns) = (film.rows as f64, film.columns as f64);
    let most = (2.0 * rows * columns).max(AMPLE_PIXELS);
    // Of (rows + 2 m)(columns + 2 m) = most.
    let sides = rows + columns;
    let beside = 0.25 * ((sides * sides + 4.0 * (most - rows * columns)).sqrt() - sides);
    beside.clamp(0.0, MOST_BESIDE) as usize
}

/// The halos of the bands of a plan.
#[derive(Debug)]
pub(crate) struct Halos {
    /// In a few bands, the first and the last among them; none where no light lies beyond the windows.
    known: BTreeMap<usize, Halo>,
}

impl Halos {
    /// Returns the halos on a film of a scene of some depths, found in a few bands, of given wavelengths, the first and the last among them. In the others kernels, and so what they leave
    /// to halos, lie between those.
    pub(crate) fn of(
        lens: &dyn LensImage,
        depths_dioptres: &[f64],
        (film, widest_px): (&Film, f64),
        looked_up: &[(usize, f64)],
    ) -> Self {
        let directions = lens.pupil_edges().as_ref().map_or_else(Directions::round, Directions::of);
        let beyond = looked_up.iter().map(|(band, wavelength_nm)| {
            (*band, Beyond::of((lens, *wavelength_nm), depths_dioptres, (film.pitch_um, widest_px)))
        });
        let beyond: Vec<(usize, Beyond)> = beyond.collect();
        if beyond.iter().all(|(_, beyond)| beyond.share <= Kernel::NEGLIGIBLE) {
            return Self { known: BTreeMap::new() };
        }
        let beside = beside(film);
        let size = (film.rows + 2 * beside, film.columns + 2 * beside);
        let of = |(band, beyond): (usize, Beyond)| (band, Halo::new(&directions, &beyond, size, beside));
        Self { known: beyond.into_par_iter().map(of).collect() }
    }

    /// Whether light lies beyond the windows of any band.
    pub(crate) fn are_any(&self) -> bool {
        !self.known.is_empty()
    }

    /// The bytes that they take.
    pub(crate) fn size_bytes(&self) -> usize {
        self.known.values().map(|halo| size_of::<f32>() * (halo.spectrum.len() + halo.landing.len())).sum()
    }

    /// The most values that a picture of so many pixels takes while it is convolved: its spectrum, and what it becomes on wider pixels.
    pub(crate) fn values(n_pixels: usize) -> usize {
        (4 + 1) * n_pixels.min(MOST_PIXELS)
    }

    /// Returns the picture of a band and of so many pixels beside its film with the halos of what it holds, if any light lies beyond its windows.
    pub(crate) fn applied(&self, band: usize, picture: Array2<f32>, beside: usize) -> Array2<f32> {
        let (Some((lower, below)), Some((upper, above))) =
            (self.known.range(..=band).next_back(), self.known.range(band..).next())
        else {
            return picture;
        };
        let fraction = (band - lower) as f32 / (upper - lower).max(1) as f32;
        below.applied(picture, beside, (above, fraction))
    }
}

/// What halos of a band take from points and bring to others, of a film with what lies around it.
#[derive(Debug)]
struct Halo {
    /// How many times as wide as the film's pixels are those it is found on.
    doublings: u32,
    /// Of the light beyond the window of a point of light 1: half of it, column by column, real since both halves of a turn have the same light.
    spectrum: Vec<f32>,
    /// What lands on a picture of that of each pixel.
    landing: Array2<f32>,
}

impl Halo {
    /// Of pictures of so many rows and columns of which those are wanted that lie `beside` their edges or more.
    fn new(directions: &Directions, beyond: &Beyond, (rows, columns): (usize, usize), beside: usize) -> Self {
        let mut ones = Array2::ones((rows, columns));
        let mut doublings = 0;
        while ones.len() > MOST_PIXELS {
            ones = halved(&ones);
            doublings += 1;
        }
        let size = transformed(ones.dim(), beside >> doublings);
        let reach = (size.0 / 2, size.1 / 2);
        let wing = Wing::new(directions, beyond).rectangle(reach, size, f64::from(doublings).exp2());
        let spectrum = with_fft(size, |fft| {
            let mut spectrum = Vec::new();
            fft.forward(&wing, size.1, &mut spectrum);
            let scale = beyond.share as f32 / fft.len() as f32;
            spectrum.into_iter().map(|value| scale * value.re).collect()
        });
        let mut halo = Self { doublings, spectrum, landing: Array2::zeros((0, 0)) };
        halo.landing = halo.brought(&ones, beside >> doublings, (&halo, 0.0));
        halo
    }

    /// Takes from each pixel of a picture what a mean of halos, a fraction from this one to another, takes to others, and adds that to them.
    ///
    /// With T the halo of a point, E + T ⊗ E − E (T ⊗ 1): the sum of the picture is kept, and an even one stays even, for beyond its edges it counts as even.
    ///
    /// What lies less than `beside` pixels from its edges is not wanted.
    fn applied(&self, mut picture: Array2<f32>, beside: usize, (other, fraction): (&Self, f32)) -> Array2<f32> {
        let [brought, landing] = on_pixels(&picture, self.doublings, &|picture| {
            let brought = self.brought(picture, beside >> self.doublings, (other, fraction));
            [brought, &self.landing * (1.0 - fraction) + &other.landing * fraction]
        });
        Zip::from(&mut picture).and(&brought).and(&landing).for_each(|light, came, went| {
            // In the dark beside a bright point transforms may leave less than nothing.
            *light = (*light + came - *light * went).max(0.0);
        });
        picture
    }

    /// Returns what a mean of halos brings to the pixels of a picture on the pixels that they are found on.
    fn brought(&self, picture: &Array2<f32>, beside: usize, (other, fraction): (&Self, f32)) -> Array2<f32> {
        let brought = with_fft(transformed(picture.dim(), beside), |fft| {
            let mut spectrum = Vec::new();
            fft.forward(picture.as_slice().unwrap_or_default(), picture.ncols(), &mut spectrum);
            let factors = self.spectrum.iter().zip(&other.spectrum);
            let mixed = factors.map(|(own, other)| own + fraction * (other - own));
            spectrum.iter_mut().zip(mixed).for_each(|(value, factor)| *value *= factor);
            fft.inverse(&mut spectrum, picture.dim())
        });
        Array2::from_shape_vec(picture.dim(), brought).expect("a value for each pixel")
    }
}

/// Returns what planes become of a picture on pixels doubled so many times.
fn on_pixels(
    picture: &Array2<f32>,
    doublings: u32,
    of: &impl Fn(&Array2<f32>) -> [Array2<f32>; 2],
) -> [Array2<f32>; 2] {
    match doublings {
        0 => of(picture),
        _ => on_pixels(&halved(picture), doublings - 1, of).map(|wide| doubled(&wide, picture.dim())),
    }
}

/// Returns the size of a transform of a picture that is wanted `beside` its edges or more: as far as from one pixel that is wanted to the farthest other each
/// way; what lies farther comes around.
fn transformed((rows, columns): (usize, usize), beside: usize) -> (usize, usize) {
    (fast_size(2 * (rows - beside)), fast_size(2 * (columns - beside)))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use glam::DVec2;
    use ndarray::s;

    use super::*;

    fn applied(picture: Array2<f32>, beyond: &Beyond, beside: usize) -> Array2<f32> {
        let halo = Halo::new(&Directions::round(), beyond, picture.dim(), beside);
        halo.applied(picture, beside, (&halo, 0.0))
    }

    #[test]
    fn even_pictures_stay_even_and_sums_are_kept() {
        for (start_px, size) in [(0.5, (33, 70)), (5.5, (101, 90)), (23.5, (40, 61)), (200.5, (7, 1))] {
            let beyond = Beyond::from_step(0.02, start_px, 0.1);
            for light in applied(Array2::from_elem(size, 3.0), &beyond, 0) {
                assert!((light - 3.0).abs() < 1e-6, "{start_px}: {light}");
            }
            let uneven = Array2::from_shape_fn(size, |(row, column)| ((row * 7 + column * 13) % 11) as f32);
            let (before, after) = (uneven.sum(), applied(uneven, &beyond, 0).sum());
            assert!((after / before - 1.0).abs() < 1e-5, "{start_px}: {before} {after}");
        }
        // Also on wider pixels.
        let even = applied(Array2::from_elem((1500, 1430), 3.0), &Beyond::from_step(0.02, 9.0, 0.8), 8);
        for light in even.slice(s![8..1492, 8..1422]) {
            assert!((light - 3.0).abs() < 1e-5, "{light}");
        }
    }

    /// Beyond the radius h lies 1, and h / r beyond another.
    #[test]
    fn a_halo_falls_with_the_third_power_of_the_distance() {
        let (n, share) = (401, 0.5);
        for start_px in [0.5, 2.5, 9.5] {
            let beyond = Beyond::from_step(share, start_px, 0.1);
            // Wherever the point lies.
            for at in [(200, 200), (203, 198)] {
                let mut point = Array2::zeros((n, n));
                point[at] = 1.0;
                for ((row, column), light) in applied(point, &beyond, 0).indexed_iter() {
                    let r = DVec2::new(column as f64 - at.1 as f64, row as f64 - at.0 as f64).length();
                    if r > (start_px + 1.0).max(8.0) {
                        let law = share * start_px / (2.0 * PI) / r.powi(3);
                        // The mean over a pixel is 1 + 9 / 24 r² of its middle; transforms leave a few parts in 1e8 of the largest light.
                        let difference = (f64::from(*light) - law).abs();
                        assert!(difference < 0.01 * law + 4e-9, "{start_px} {at:?}, {row} {column}: {light} {law}");
                    }
                }
            }
        }
    }

    /// But for what lamps lose, which is less where less of a halo lands.
    #[test]
    fn parts_of_a_picture_have_the_halos_of_the_whole() {
        let mut whole = Array2::zeros((120, 150));
        whole[(61, 47)] = 1000.0;
        whole[(30, 90)] = 300.0;
        let beyond = Beyond::from_step(0.02, 3.0, 0.2);
        let part = applied(whole.slice(s![13.., 9..]).to_owned(), &beyond, 20);
        let whole = applied(whole, &beyond, 20);
        for (part, whole) in part.slice(s![20..87, 20..121]).iter().zip(whole.slice(s![33..100, 29..130])) {
            assert!((part - whole).abs() < if *whole > 100.0 { 2e-4 * whole } else { 1e-5 }, "{part} {whole}");
        }
    }
}
