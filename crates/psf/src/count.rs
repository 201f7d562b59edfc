//! The paper's way: rays spread evenly over the front of the lens, and counted on pixels.
//!
//! Kept so that the paper can be reproduced. For anything else a [`LensImageModel`](crate::LensImageModel) needs a thousandth of the
//! rays, keeps the light that is lost, and has no noise.

use dioptric_diffraction::{CircularStop, Hurb, HurbForm, SampledHurb};
use dioptric_optics::{Beam, FilmPoint, MonoLens, ObjectPoint, RayBatch, Vignetting, rays_towards};
use glam::{DVec2, DVec3};
use ndarray::Array2;
use rand::RngExt;
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};

/// A square grid of rays over the flat disc of the first rim.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrontGrid {
    /// Points along a side of the square about the disc.
    pub n_across: usize,
    /// Moves each point by up to half a step both ways, drawn from this seed.
    pub jitter_seed: Option<u64>,
}

/// Uncertainty bending as the authors did it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AuthorsBending {
    /// The model: γ = 1 for the paper.
    pub model: Hurb,
    /// Seed of the deviations.
    pub seed: u64,
}

/// A square film of counted rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CountingFilm {
    /// Pixels along a side.
    pub n_pixels: usize,
    /// Side, mm.
    pub side_mm: f64,
    /// Place of its middle on the film, mm along the film's own x and y.
    pub center_mm: DVec2,
}

impl FrontGrid {
    /// Returns the rays from a point of the lens frame to this grid, started on the first vertex plane.
    pub fn rays(self, lens: &MonoLens, source_mm: DVec3) -> RayBatch {
        rays_towards(&ObjectPoint::Finite(source_mm), &self.targets_mm(lens), 0.0, 0.0)
    }

    /// Returns the points of the grid, in the plane of the first vertex.
    pub fn targets_mm(self, lens: &MonoLens) -> Vec<DVec2> {
        let step = 2.0 / (self.n_across.max(2) - 1) as f64;
        let mut random = self.jitter_seed.map(ChaCha8Rng::seed_from_u64);
        let mut targets = vec![];
        for row in 0..self.n_across {
            for column in 0..self.n_across {
                let mut at = DVec2::new(column as f64, row as f64) * step - DVec2::ONE;
                if let Some(random) = &mut random {
                    at += DVec2::new(random.random::<f64>() - 0.5, random.random::<f64>() - 0.5) * step;
                }
                if at.length_squared() <= 1.0 {
                    targets.push(at * lens.semi_aperture_mm(0));
                }
            }
        }
        targets
    }
}

/// Traces rays to the film, with the authors' bending where asked for: behind every surface, by the rim of that
/// surface, in angles, with the vacuum wavelength.
///
/// For a single ideal lens that is right; for others it spreads light too much, and is kept for comparison only.
pub fn trace_as_authors(lens: &MonoLens, rays: &mut RayBatch, film_distance_mm: f64, bending: Option<AuthorsBending>) {
    for surface in 0..lens.n_surfaces() {
        lens.trace_surfaces(surface..surface + 1, rays, Vignetting::On);
        if let Some(AuthorsBending { model, seed }) = bending {
            let edge = CircularStop::new(lens.semi_aperture_mm(surface), lens.wavelength_nm(), 1.0);
            let seed = seed.wrapping_add(surface as u64);
            let hurb = SampledHurb { model, edge: edge.into(), form: HurbForm::Angles, seed };
            hurb.apply(rays, &lens.surface_placement(surface));
        }
    }
    lens.to_film(rays, film_distance_mm);
}

impl CountingFilm {
    /// Returns how many places fall on each pixel: row 0 has the largest y, column 0 the smallest x.
    ///
    /// The first column stays empty, as it did for the authors.
    pub fn count(self, landed: impl IntoIterator<Item = FilmPoint>) -> Array2<f64> {
        let mut counts = Array2::zeros((self.n_pixels, self.n_pixels));
        self.add(landed, &mut counts);
        counts
    }

    /// Returns what [`count`](Self::count) does for the rays of a beam on the film, `film_distance_mm` behind the lens, without
    /// storing them.
    pub fn count_beam(self, lens: &MonoLens, beam: &Beam<'_>, film_distance_mm: f64) -> Array2<f64> {
        let mut counts = Array2::zeros((self.n_pixels, self.n_pixels));
        lens.trace_onto(beam, Vignetting::On, film_distance_mm, |rays| {
            self.add(lens.landed(rays, film_distance_mm), &mut counts)
        });
        counts
    }

    fn add(self, landed: impl IntoIterator<Item = FilmPoint>, counts: &mut Array2<f64>) {
        let pixels_per_mm = self.n_pixels as f64 / self.side_mm;
        let middle = 0.5 * (self.n_pixels as f64 + 1.0);
        let last = self.n_pixels as f64;
        for place in landed {
            // Places count from 1.
            let at = (place.mm - self.center_mm) * pixels_per_mm;
            let (row, column) = ((middle - at.y).round(), (middle + at.x).round());
            if (2.0..=last).contains(&column) && (1.0..=last).contains(&row) {
                counts[(row as usize - 1, column as usize - 1)] += 1.0;
            }
        }
    }

    /// Side of a pixel, µm.
    pub fn pitch_um(self) -> f64 {
        1e3 * self.side_mm / self.n_pixels as f64
    }
}

/// Returns the mean place, mm, or `None` if there are none.
pub fn mean_place_mm(landed: impl IntoIterator<Item = FilmPoint>) -> Option<DVec2> {
    let (sum, n) = landed.into_iter().fold((DVec2::ZERO, 0.0), |(sum, n), place| (sum + place.mm, n + 1.0));
    (n > 0.0).then(|| sum / n)
}

#[cfg(test)]
mod tests {
    use dioptric_optics::Lens;

    use super::*;

    #[test]
    fn the_grid_covers_the_disc() {
        let lens = Lens::built_in("paper-2el").unwrap().at(550.0).unwrap();
        for jitter_seed in [None, Some(1)] {
            let grid = FrontGrid { n_across: 201, jitter_seed };
            let rays = grid.rays(&lens, DVec3::new(0.0, 0.0, -8000.0));
            // π/4 of 201² cells of side 2/200.
            assert!((rays.len() as f64 / (std::f64::consts::PI / 4.0 * 200.0 * 200.0) - 1.0).abs() < 3e-3);
        }
    }

    #[test]
    fn the_authors_film_loses_its_first_column() {
        let film = CountingFilm { n_pixels: 5, side_mm: 5.0, center_mm: DVec2::new(1.0, 0.0) };
        let places = [(-1.0, 0.0), (0.0, 0.0), (1.4, 2.4), (3.4, -2.4), (3.6, 0.0)];
        let counts = film.count(places.map(|(x, y)| FilmPoint { mm: DVec2::new(x, y) }));
        let mut expected = Array2::zeros((5, 5));
        for at in [(2, 1), (0, 2), (4, 4)] {
            expected[at] = 1.0;
        }
        assert_eq!(counts, expected);
    }

    #[test]
    fn counting_a_beam_is_counting_its_rays() {
        let lens = Lens::built_in("paper-2el").unwrap().at(550.0).unwrap();
        let grid = FrontGrid { n_across: 201, jitter_seed: Some(1) };
        let source_mm = DVec3::new(100.0, 0.0, -2_000.0);
        let (film_distance_mm, targets_mm) = (52.0, grid.targets_mm(&lens));
        let mut rays = grid.rays(&lens, source_mm);
        lens.trace_to_film(&mut rays, Vignetting::On, film_distance_mm);
        let center_mm = mean_place_mm(lens.landed(&rays, film_distance_mm)).unwrap();
        let film = CountingFilm { n_pixels: 64, side_mm: 1.0, center_mm };
        let beam = Beam { point: ObjectPoint::Finite(source_mm), targets_mm: &targets_mm, z_mm: 0.0 };
        let counts = film.count_beam(&lens, &beam, film_distance_mm);
        assert!(counts.sum() > 1e3);
        assert_eq!(counts, film.count(lens.landed(&rays, film_distance_mm)));
    }
}
