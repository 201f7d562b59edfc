//! A uniform plane seen on a strip of film: how smooth its picture is, and how bright.

use dioptric_forward::{Film, PsfDomain, Settings, Source, render};
use dioptric_optics::{Lens, ObjectPoint, PupilBoundary, Vignetting, rays_towards};
use dioptric_psf::{AdaptiveSettings, Diffraction, ErrorPlaces, FieldSampling, LensImageModel};
use dioptric_scene::View;
use dioptric_spectrum::{Cancel, DepthMap, Quantity, SpectralImage, WavelengthGrid};
use glam::DVec2;
use ndarray::Array2;
use rayon::prelude::*;

/// The wavelength for which lenses are focused, and at which real rays are traced.
pub(crate) const WAVELENGTH_NM: f64 = 550.0;

/// Bands of which the middle one has the kernels that halve cells.
pub(crate) const THREE_BANDS_NM: &[f64] = &[450.0, WAVELENGTH_NM, 650.0];

/// A strip of film from the axis' neighborhood to the corner of a square film, and the depth of a plane.
#[derive(Clone, Copy)]
pub(crate) struct Case {
    pub(crate) lens: &'static str,
    pub(crate) f_number: f64,
    pub(crate) focus_mm: f64,
    pub(crate) plane_mm: f64,
    pub(crate) columns: usize,
    pub(crate) pitch_um: f64,
    /// How far to the right of the axis the middle of the film lies.
    pub(crate) aside_mm: f64,
    pub(crate) diffraction: Diffraction,
    /// With [`WAVELENGTH_NM`] in the middle.
    pub(crate) bands_nm: &'static [f64],
}

pub(crate) struct Uniform {
    lens: Lens,
    bank: LensImageModel,
    film: Film,
    film_distance_mm: f64,
    plane_m: f64,
    bands_nm: &'static [f64],
    /// One a band.
    pictures: Vec<Array2<f32>>,
}

impl Uniform {
    pub(crate) fn new(case: &Case) -> Self {
        let lens = Lens::built_in(case.lens).unwrap().with_f_number(case.f_number, WAVELENGTH_NM).unwrap();
        let mono = lens.at(WAVELENGTH_NM).unwrap();
        let center_mm = DVec2::X * case.aside_mm;
        let film = Film { center_mm, ..Film::centered(48, case.columns, case.pitch_um) };
        let grid = WavelengthGrid::new(case.bands_nm.to_vec()).unwrap();
        let plane_m = 1e-3 * (case.plane_mm + mono.projection_center_z_mm());
        let film_distance_mm = mono.film_distance_mm_for(case.focus_mm).unwrap();
        let domain = PsfDomain {
            lens: &lens,
            film: &film,
            film_distance_mm,
            depth_range_m: (plane_m, plane_m),
            grid: &grid,
            diffraction: case.diffraction,
        };
        let settings = domain.settings().unwrap();
        let places = ErrorPlaces { pitch_um: case.pitch_um, ..ErrorPlaces::STANDARD };
        let wanted = AdaptiveSettings { places, ..AdaptiveSettings::STANDARD };
        // As `dioptric run` does.
        let bank = LensImageModel::build_adaptive(&lens, &settings, &wanted, &|_| {}, &Cancel::new()).unwrap();
        let last_tan = match &settings.fields {
            FieldSampling::Radial(tans) => tans[tans.len() - 1],
            _ => panic!("a lens with an axis of symmetry has fields along a radius"),
        };
        // A hundred samples over twice the film, all of one radiance.
        let view = View { focal_px: 49.0 / last_tan, center_x_px: 49.5, center_y_px: 49.5 };
        let radiance =
            SpectralImage::new(Quantity::Radiance, grid, vec![Array2::ones((100, 100)); case.bands_nm.len()]).unwrap();
        let depth = DepthMap::flat(100, 100, plane_m).unwrap();
        let source = Source { radiance: &radiance, depth: &depth, view, occluded: None };
        let mut pictures = vec![];
        render(&source, &bank, &film, &Settings::default(), &|_| {}, &mut |_, band| {
            pictures.push(band);
            Ok(())
        })
        .unwrap();
        Self { lens, bank, film, film_distance_mm, plane_m, bands_nm: case.bands_nm, pictures }
    }

    /// Returns the largest second difference along rows and columns in any band, over the mean, and where: of neighbors, less that
    /// of pixels eight apart, which is the curvature that a smooth picture has on both scales.
    pub(crate) fn worst_step(&self) -> WorstStep {
        let steps = self.bands_nm.iter().zip(&self.pictures).map(|(&wavelength_nm, picture)| {
            let (step, (row, column)) = worst_step_of(picture);
            WorstStep { step, wavelength_nm, row, column }
        });
        steps.max_by(|a, b| a.step.total_cmp(&b.step)).unwrap()
    }

    /// Returns the largest difference from the irradiance by traced rays, as a share of it, and where, mm.
    pub(crate) fn worst_illumination(&self) -> (f64, f64) {
        let row = self.film.rows / 2;
        let all_over = (8..self.film.columns).step_by((self.film.columns - 16) / 31);
        // What is off on the axis changes over less than the blur.
        let axis = (0.5 * self.film.columns as f64 - 1e3 * self.film.center_mm.x / self.film.pitch_um) as usize;
        let near_axis = (axis..axis + 36).step_by(4).filter(|column| *column < self.film.columns);
        let places: Vec<usize> = all_over.chain(near_axis).collect();
        let differences = places.into_par_iter().map(|column| {
            let (x, y) = (column as f64 + 0.5 - 0.5 * self.film.columns as f64, -0.5);
            let place_mm = self.film.center_mm + 1e-3 * self.film.pitch_um * DVec2::new(x, y);
            (
                f64::from(self.pictures[self.bands_nm.len() / 2][(row, column)]) / self.solid_angle(place_mm) - 1.0,
                place_mm.length(),
            )
        });
        differences.reduce(|| (0.0, 0.0), |a, b| if b.0.abs() > a.0.abs() { b } else { a })
    }

    /// Returns the projected solid angle of the light that a place of the film gets from the plane, picture frame: the area
    /// that the direction cosines of the rays fill which land there, each from the edge of its own point's pupil.
    fn solid_angle(&self, place_mm: DVec2) -> f64 {
        const N: usize = 128;
        let mono = self.lens.at(WAVELENGTH_NM).unwrap();
        let geometry = self.bank.radial_geometry(1.0 / self.plane_m, WAVELENGTH_NM).unwrap();
        let tan = geometry.field_tan(place_mm.length()).unwrap();
        let tan_per_mm = tan / place_mm.length();
        let cosines: Vec<DVec2> = (0..N)
            .map(|i| {
                let azimuth = std::f64::consts::TAU * i as f64 / N as f64;
                let mut field_tan = place_mm * tan_per_mm;
                for step in 0..120 {
                    // Where one rim takes over from another, whole steps go to and fro.
                    let share = if step < 40 { 0.8 } else { 0.3 };
                    let point = ObjectPoint::from_field(&mono, field_tan, 1.0 / self.plane_m);
                    let pupil = PupilBoundary::find(&mono, &point, 64)
                        .unwrap_or_else(|| panic!("no pupil at {field_tan} for {place_mm}"));
                    let target = pupil.center_mm() + DVec2::from_angle(azimuth) * pupil.rho_max_mm(azimuth);
                    let mut rays = rays_towards(&point, &[target], pupil.z_mm(), 0.0);
                    mono.trace(&mut rays, Vignetting::Off);
                    mono.to_film(&mut rays, self.film_distance_mm);
                    let cosine = rays.direction(0).truncate();
                    let off_mm = place_mm - mono.landed(&rays, self.film_distance_mm).next().unwrap().in_picture_mm();
                    if off_mm.length() < 1e-6 {
                        return cosine;
                    }
                    field_tan += off_mm * (share * tan_per_mm);
                }
                panic!("no ray from the edge of the pupil lands at {place_mm}");
            })
            .collect();
        let pairs = cosines.iter().zip(cosines.iter().cycle().skip(1));
        // A polygon of N sides falls short of a circle by (2 π / N)² / 6.
        0.5 * pairs.map(|(a, b)| a.perp_dot(*b)).sum::<f64>().abs()
            * (1.0 + (std::f64::consts::TAU / N as f64).powi(2) / 6.0)
    }
}

/// The largest second difference of a uniform plane, over its mean, and where it is.
pub(crate) struct WorstStep {
    pub(crate) step: f64,
    pub(crate) wavelength_nm: f64,
    pub(crate) row: usize,
    pub(crate) column: usize,
}

fn worst_step_of(picture: &Array2<f32>) -> (f64, (usize, usize)) {
    const APART: usize = 8;
    let mean = f64::from(picture.mean().unwrap());
    let (rows, columns) = picture.dim();
    let bend = |(row, column): (usize, usize), (down, across): (usize, usize)| {
        let at = |row: usize, column: usize| f64::from(picture[(row, column)]) / mean;
        at(row - down, column - across) + at(row + down, column + across) - 2.0 * at(row, column)
    };
    let far = (APART * APART) as f64;
    let inner = (APART..rows - APART).flat_map(|row| (APART..columns - APART).map(move |column| (row, column)));
    let steps = inner.map(|at| {
        let down = bend(at, (1, 0)) - bend(at, (APART, 0)) / far;
        let across = bend(at, (0, 1)) - bend(at, (0, APART)) / far;
        (down.abs().max(across.abs()), at)
    });
    steps.fold((0.0, (0, 0)), |worst, here| if here.0 > worst.0 { here } else { worst })
}
